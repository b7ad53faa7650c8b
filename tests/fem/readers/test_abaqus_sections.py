"""Materials, sections, rods and parts of Abaqus decks as arguments of the families."""

from __future__ import annotations

import math

import numpy as np
import pytest

from abaqus_decks import BARS, BENT, CUBE, NODES, NU, RHO, SHEET, SOLID, STEEL, E, alike, line, read
from antiosc.base.errors import MeshError
from refusals import refused

#: Stiffness by rows 11, 22, 33, 12, 13, 23, as Abaqus counts them; 10 · row + column of its half.
FULL = np.array([[10.0 * min(i, j) + max(i, j) for j in range(1, 7)] for i in range(1, 7)])
FULL += 100 * np.eye(6)
HALF = [FULL[i, j] for j in range(6) for i in range(j + 1)]


def rows(values, count: int = 8) -> str:
    words = [f"{v:.12g}" for v in values]
    return "".join(",".join(words[k : k + count]) + "\n" for k in range(0, len(words), count))


AXES = "*ORIENTATION,NAME=O\n0,2,0,-3,0,0\n"


def solid(elastic: str, option: str = "") -> str:
    section = SOLID.replace("=M", f"=M{option}")
    return f"{CUBE}{section}*MATERIAL,NAME=m\n{elastic}*DENSITY\n8.E-9\n{AXES}"


@pytest.mark.parametrize("option", ["", ",ORIENTATION=O"])
def test_a_solid_of_21_constants(tmp_path, option):
    """The rows of the result are 11, 22, 33, 23, 13, 12."""
    text = solid("*ELASTIC,TYPE=ANISOTROPIC\n" + rows(HALF), option)
    model, _ = read(tmp_path, text)
    order = [0, 1, 2, 5, 4, 3]
    expected = {"stiffness": (1e6 * FULL[np.ix_(order, order)]).tolist(), "rho": RHO}
    if option:
        expected["axes"] = [[0.0, 1.0, 0.0], [-1.0, 0.0, 0.0]]
    alike(model["families"], [["ALL", "AnisotropicSolid", expected, line(text, "*SOLID")]])
    with pytest.raises(MeshError) as caught:
        read(tmp_path, solid("*ELASTIC,TYPE=ANISO\n" + rows(HALF[:20])))
    assert str(caught.value) == f"{line(text, '*ELASTIC')}: *ELASTIC needs 21 constants; it has 20."


@pytest.mark.parametrize(
    ("rows_of", "x", "y"),
    [
        ("0,2,0,-3", (0, 1, 0), (-1, 0, 0)),
        ("1,0,0,5,1\n3,90.", (0, 1, 0), (-1, 0, 0)),
        ("1,0,0,0,1,0\n2,0.", (1, 0, 0), (0, 1, 0)),
        ("0,0,2,1,0,0\n3,-30.", (-0.5, 0, np.sqrt(0.75)), (np.sqrt(0.75), 0, 0.5)),
    ],
)
def test_orientations_of_solids(tmp_path, rows_of, x, y):
    """Points on axis 1 and in the plane of 1 and 2, then a rotation about axis 3."""
    text = solid("*ELASTIC,TYPE=ANISO\n" + rows(HALF), ",ORIENTATION=O")
    model, _ = read(tmp_path, text.replace("0,2,0,-3,0,0", rows_of))
    np.testing.assert_allclose(model["families"][0][2]["axes"], [x, y], atol=1e-12)


@pytest.mark.parametrize("kind", ["ENGINEERING CONSTANTS", "ORTHO"])
def test_a_solid_of_nine_constants(tmp_path, kind):
    """Strains of unit stresses: 1/E on the diagonal, -ν12/E1, -ν13/E1, -ν23/E2 beside it."""
    moduli, ratios, shears = [9e4, 4e4, 2e4], [0.3, 0.2, 0.4], [7e3, 6e3, 5e3]
    S = np.diag([*(1 / np.array(moduli)), *(1 / np.array(shears[::-1]))])
    for (i, j), nu in zip(((0, 1), (0, 2), (1, 2)), ratios, strict=True):
        S[i, j] = S[j, i] = -nu / moduli[i]
    C = np.linalg.inv(S)
    given = [*moduli, *ratios, *shears]
    if kind == "ORTHO":
        given = [C[i, j] for i, j in ((0, 0), (0, 1), (1, 1), (0, 2), (1, 2), (2, 2))] + shears
    text = solid(f"*ELASTIC,TYPE={kind}\n" + rows(given))
    model, _ = read(tmp_path, text)
    (((_, family, found, _)),) = model["families"]
    assert family == "AnisotropicSolid"
    np.testing.assert_allclose(found["stiffness"], 1e6 * C, rtol=1e-9, atol=1e-3)
    for count in range(9):
        with pytest.raises(MeshError) as caught:
            read(tmp_path, solid(f"*ELASTIC,TYPE={kind}\n" + rows(given[:count])))
        message = f"{line(text, '*ELASTIC')}: *ELASTIC needs 9 constants; it has {count}."
        assert str(caught.value) == message


def test_a_density_for_materials_without_one(tmp_path):
    text = CUBE + SOLID + STEEL.replace("*DENSITY\n8.E-9\n", "*DENSITY\n")
    model, _ = read(tmp_path, text, density=5.0)
    alike(model["families"][0][2], {"E": E, "nu": NU, "rho": 5.0})
    with pytest.raises(MeshError, match=rf"^{line(text, '*ELASTIC')}: the material 'M' has no den"):
        read(tmp_path, text)


SHELL = "*SHELL SECTION,ELSET=ALL,MATERIAL=M{}\n.5\n"
PLY = "*MATERIAL,NAME=P\n*ELASTIC,TYPE=LAMINA\n9E4,2E4,.25,5E3,4E3,3E3\n*DENSITY\n2.E-9\n"


def layer(thickness: float, angle: float) -> dict[str, float]:
    constants = {"E1": 9e10, "E2": 2e10, "nu12": 0.25, "G12": 5e9, "G13": 4e9, "G23": 3e9}
    return {**constants, "rho": 2e3, "thickness": thickness, "angle": angle}


OFFSETS = {"": None, ",OFFSET=SPOS": -2.5e-4, ",OFFSET=sneg": 2.5e-4, ",OFFSET=.2": -1e-4,
           ",OFFSET=MIDDLE": None, ",OFFSET=": None}  # fmt: skip


@pytest.mark.parametrize("option", OFFSETS)
def test_shells_beside_their_nodes(tmp_path, option):
    """OFFSET is the share of the thickness from the middle surface to the nodes."""
    for text in (SHEET, BENT):
        text += SHELL.format(option) + STEEL
        model, deck = read(tmp_path, text)
        expected = {"E": E, "nu": NU, "rho": RHO, "thickness": 5e-4}
        told = []
        if OFFSETS[option] is not None:
            expected["offset"] = OFFSETS[option]
            told = [f"the area of the offset surface of curved shells ({line(text, '*SHELL')}), "
                    "that at the nodes is taken"] if "2,2,9" in text else []  # fmt: skip
        alike(model["families"], [["All", "Shell", expected, line(text, "*SHELL")]])
        assert (model["ignored"], deck.remarks) == (told, [])
        assert (model["gdim"], model["halve"], model["joined"]) == (3, False, False)


def test_thicknesses_at_nodes(tmp_path):
    """The mean of the corners in each element, which keeps the share of its offset."""
    text = BENT + SHELL.format(",OFFSET=SPOS") + STEEL
    text += "*ELEMENT,TYPE=S8R,ELSET=CAP\n3,5,6,7,8,11,12,13,14\n*NODE\n11,10,0,10\n12,20,5,10\n"
    text += "13,10,10,10\n14,0,5,10\n*SHELL SECTION,ELSET=CAP,MATERIAL=M\n.75\n"
    text += "*NODAL THICKNESS\nN,.25\n2,\n9,.35\n10,.45\n3,.25\n11,.4\n"
    model, _ = read(tmp_path, text)
    found = {name: (one["thickness"], one.get("offset")) for name, _, one, _ in model["families"]}
    place = line(text, "*SHELL")
    last = line(text, "*SHELL SECTION,ELSET=CAP")
    assert found == {
        f"All of thickness 0.25 ({place})": pytest.approx((2.5e-4, -1.25e-4)),
        f"All of thickness 0.325 ({place})": pytest.approx((3.25e-4, -1.625e-4)),
        f"CAP of thickness 0.25 ({last})": (pytest.approx(2.5e-4), None),
    }
    assert f"within 2 elements (*NODAL THICKNESS, {line(text, '*NODAL')})" in model["ignored"][0]
    text = BENT + SHELL.format("") + STEEL + "*NODAL THICKNESS\n9,.25\n10,.25\n"
    model, deck = read(tmp_path, text)
    thin = {name.partition(" (")[0]: one["thickness"] for name, _, one, _ in model["families"]}
    assert thin == pytest.approx({"All of thickness 0.5": 5e-4, "All of thickness 0.375": 3.75e-4})
    own = {name: some.tolist() for name, some in deck.element_sets.items() if "of" in name}
    assert sorted(own.values()) == [[0], [1]]
    model, _ = read(tmp_path, SHEET + SHELL.format("") + STEEL + "*NODAL THICKNESS\nN,.25\n")
    assert model["ignored"] == []
    composite = SHEET + "*SHELL SECTION,ELSET=ALL,COMPOSITE\n.5,3,P,10.\n" + PLY
    model, _ = read(tmp_path, composite + "*NODAL THICKNESS\nN,.25\n")
    assert [kind for _, kind, _, _ in model["families"]] == ["Laminate"]
    assert any("NODAL THICKNESS" in sentence for sentence in model["ignored"])


BOX = [(5 * 4**3 - 3 * 3**3) / 12, (4 * 5**3 - 3 * 3**3) / 12]


def test_offsets_of_beams_are_shares_of_their_height_and_width(tmp_path):
    section = "*BEAM SECTION,ELSET=ALL,MATERIAL=M,SECTION=BOX{}\n4.,5.,.5,1.,.5,1.\n0,1\n" + STEEL
    model, _ = read(tmp_path, BARS + section.format(",OFFSET1=-.5"))
    assert model["families"][0][2]["offset"] == pytest.approx(-2e-3)
    model, _ = read(tmp_path, BARS + section.format(",OFFSET2=.5"))
    found = model["families"][0][2]
    assert found["offset"] == pytest.approx(2.5e-3)
    assert found["orientation"] == [0, 0, 1]
    assert 1e12 * found["section"]["I"] == pytest.approx(BOX[1])
    assert 1e12 * found["section"]["I_side"] == pytest.approx(BOX[0])
    apart = BARS.replace("2,4,3", "2,4,5") + section.format(",OFFSET2=.5")
    with pytest.raises(MeshError, match=rf"^{line(apart, '*BEAM')}: OFFSET2 is read for beams in"):
        read(tmp_path, apart)


RODS = NODES + "*ELEMENT,TYPE=T3D2,ELSET=ALL\n1,1,2\n2,2,7\n*ELEMENT,TYPE=T3D2,ELSET=B\n3,1,7\n"
RODS += SOLID + "3.\n*SOLID SECTION,ELSET=B,MATERIAL=M\n" + STEEL


def test_rods_alone_are_a_truss(tmp_path):
    model, deck = read(tmp_path, RODS + "*BOUNDARY\n1,1,2\n")
    given = {"E": E, "nu": NU, "rho": RHO}
    expected = [["rods", "Truss", {**given, "area": area}, place] for area, place in (
        (3e-6, line(RODS, "*SOLID")), (1e-6, line(RODS, "*SOLID SECTION,ELSET=B")))]  # fmt: skip
    found = [[name.partition(" (")[0], *rest] for name, *rest in model["families"]]
    alike(found, expected)
    assert [deck.element_sets[name].tolist() for name, *_ in model["families"]] == [[0, 1], [2]]
    assert (model["gdim"], model["joined"], model["halve"]) == (3, False, False)
    assert model["supports"] == [["fixed x", ["x"]], ["fixed y", ["y"]]]
    assert model["ignored"] == model["masses"] == model["springs"] == []
    with pytest.raises(MeshError, match="the area of rods must be above 0; it is -3"):
        read(tmp_path, RODS.replace("3.\n*SOLID", "-3.\n*SOLID"))


def test_rods_beside_other_elements_are_springs(tmp_path):
    text = RODS + "*ELEMENT,TYPE=C3D8,ELSET=C\n9,1,2,3,4,5,6,7,8\n"
    text += "*SOLID SECTION,ELSET=C,MATERIAL=M\n*BOUNDARY\n1,1,3\n"
    model, deck = read(tmp_path, text)
    assert all("T3D2 of part.inp are springs" in told for told in deck.remarks)
    x = np.array([(0, 0, 0), (20, 0, 0), (20, 10, 10)])
    # rod 1 ends at the fixed node 1, as rod 3 does
    expected = []
    for a, b, area in ((0, 1, 3.0), (1, 2, 3.0), (0, 2, 1.0)):
        along = x[b] - x[a]
        length = np.linalg.norm(along)
        row = np.zeros((3, 3))
        row[a], row[b] = -along / length, along / length
        row[0] = 0.0
        expected.append(2e8 * area / length * np.outer(row, row))
    K = np.zeros((9, 9))
    number = {0: 0, 1: 1, 6: 2}
    for terms, stiffness in model["joints"]["springs"]:
        row = np.zeros((3, 3))
        for node, motion, value in terms:
            row[number[node], motion] += value
        K += stiffness * np.outer(row, row)
    np.testing.assert_allclose(K, sum(expected), rtol=1e-9, atol=1e-6)
    masses = {rows[0][0][0]: mass for rows, _, mass in model["joints"]["masses"]}
    lengths = {(0, 1): 20.0, (1, 6): math.sqrt(200), (0, 6): math.sqrt(600)}
    half = {ends: 4e-6 * (1 if ends == (0, 6) else 3) * L for ends, L in lengths.items()}
    assert masses == pytest.approx(
        {node: sum(m for ends, m in half.items() if node in ends) for node in (0, 1, 6)}
    )


PARTS = CUBE + "*ELEMENT,TYPE=S4,ELSET=LID\n2,5,6,7,8\n*ELEMENT,TYPE=S4,ELSET=WING\n3,2,9,10,3\n"
PARTS += "*ELSET,ELSET=NONE\n*SHELL SECTION,ELSET=LID,MATERIAL=M\n.5\n"
PARTS += "*SHELL SECTION,ELSET=WING,MATERIAL=M\n.5\n*SHELL SECTION,ELSET=NONE,MATERIAL=M\n.5\n"
PARTS += SOLID + STEEL
ON = "*ELEMENT,TYPE=MASS,ELSET=Q\n9,9\n10,6\n*MASS,ELSET=Q\n1.\n*ELEMENT,TYPE=SPRING1,ELSET=K\n"
ON += "11,10\n12,1\n*SPRING,ELSET=K\n3\n4.\n*EQUATION\n2\n9,1,1.,6,1,-1.\n"
ON += "*EQUATION\n2\n6,1,1.,7,1,1.\n"


@pytest.mark.parametrize(
    "rest", [",MATERIAL=M\n.5\n", ",COMPOSITE\n.2,3,M\n.3,3,M\n"], ids=["material", "composite"]
)
def test_a_general_section_of_shells_is_the_section_of_its_material(tmp_path, rest):
    found = [
        read(tmp_path, f"{SHEET}*SHELL {word}SECTION,ELSET=ALL{rest}{STEEL}")[0]["families"][0][1:3]
        for word in ("", "GENERAL ")
    ]
    assert found[0] == found[1]


REFUSED = {
    "general": (
        SHEET + "*SHELL GENERAL SECTION,ELSET=ALL\n1.,2.,3.\n" + STEEL, None, "MATERIAL"),
    "material": (SHEET + SHELL.format("ATTER"), None, "*MATERIAL"),
    "no elasticity": (CUBE + SOLID + "*MATERIAL,NAME=M\n*DENSITY\n1.\n", None, "elasticity"),
    "a layer without": (
        SHEET + "*SHELL SECTION,ELSET=ALL,COMPOSITE\n.5,3,M\n*MATERIAL,NAME=M\n",
        None, "elasticity"),
    "beams of nodal thickness": (
        BARS + "*BEAM SECTION,ELSET=ALL,MATERIAL=M,NODAL THICKNESS\n1,1\n"
        "*NODAL THICKNESS\n1,2.,2.\n" + STEEL, None, "NODAL THICKNESS",
    ),
    "beams askew": (BARS + "*BEAM SECTION,ELSET=ALL,MATERIAL=P\n1,1\n" + PLY, None, "isotropic"),
    "two families": (
        SHEET.replace("S4", "CPS4") + "*ELEMENT,TYPE=C3D8,ELSET=C\n2,1,2,3,4,5,6,7,8\n"
                     + SOLID + "*SOLID SECTION,ELSET=C,MATERIAL=M\n" + STEEL, None, "structure"),
    "other": (SHEET.replace("S4", "R3D4") + STEEL, None, "element"),
    "bare": (
        BENT.replace("2,2,9", "*ELEMENT,TYPE=S4\n2,2,9") + SHELL.format("") + STEEL,
        None, "section"),
}  # fmt: skip


@pytest.mark.parametrize("case", REFUSED)
def test_what_is_refused(tmp_path, case):
    text, line, word = REFUSED[case]
    with refused(line, word, MeshError):
        read(tmp_path, text)
