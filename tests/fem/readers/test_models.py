"""What decks say of materials, masses, supports and springs, in SI units; turned instances."""

from __future__ import annotations

from functools import partial

import numpy as np
import pytest

import abaqus_decks as inp
import nastran_decks as bdf
from antiosc.base.errors import MeshError
from antiosc.io.deck import Block, Deck
from antiosc_decks.properties import (
    constants_of_stiffness,
    fixed_along_axes,
    isotropic,
    measures_of,
)


def ply(card: str) -> str:
    section = "*SHELL SECTION,ELSET=ALL,MATERIAL=M\n.5\n"
    return SHEET + section + "*MATERIAL,NAME=M\n" + card + DENSITY


def fixed(deck) -> dict[str, list[int]]:
    return {name.removeprefix("fixed "): (rows + 1).tolist() for name, rows in deck.fixed.items()}


TURNED = "CORD2R,5,,0.,0.,0.,1.,0.,0.\n,0.,1.,0.\n"  # its z is x, its x is y, its y is z


CORNERS = [(x, y, z) for z in (0, 1) for x, y in ((0, 0), (1, 0), (1, 1), (0, 1))]


@pytest.fixture
def abaqus(tmp_path):
    return partial(inp.read, tmp_path)


@pytest.fixture
def bulk(tmp_path):
    return partial(bdf.read, tmp_path)


def constants(E, nu, G) -> np.ndarray:
    """Stiffness (6, 6) of three moduli, ν12, ν13, ν23 and three shear moduli."""
    S = np.diag([*(1 / np.array(E)), *(1 / np.array(G))])
    S[0, 1] = S[1, 0] = -nu[0] / E[0]
    S[0, 2] = S[2, 0] = -nu[1] / E[0]
    S[1, 2] = S[2, 1] = -nu[2] / E[1]
    return np.linalg.inv(S)


NODES = "*NODE,NSET=N\n" + "".join(f"{k},{x},{y},{z}\n" for k, (x, y, z) in enumerate(CORNERS, 1))
SHEET = NODES + "*ELEMENT,TYPE=S4,ELSET=ALL\n1,1,2,3,4\n"
DENSITY = "*DENSITY\n2.E-9\n"


D = constants([9e4, 2e4, 1e4], [0.3, 0.25, 0.4], [5e3, 4e3, 3e3])
ORTHO = ",".join(repr(float(D[i, j])) for i, j in ((0, 0), (0, 1), (1, 1), (0, 2), (1, 2), (2, 2)))
CARDS = {
    "engineering": "*ELASTIC,TYPE=ENGINEERING CONSTANTS\n9E4,2E4,1E4,.3,.25,.4,5E3,4E3,\n3E3\n",
    "lamina": "*ELASTIC,TYPE=LAMINA\n9E4,2E4,.3,5E3,4E3,3E3\n",
    "ortho": f"*ELASTIC,TYPE=ORTHOTROPIC\n{ORTHO},5E3,4E3,\n3E3\n",
}


@pytest.mark.parametrize(
    ("layer", "angle"), [("", 0), (",30.", 30), (",TURNED", 40), (",SWAPPED", 90)]
)
def test_angles_of_layers_count_from_the_axis_of_the_stack(abaqus, layer, angle):
    """By a number, or by an orientation of the layer's own; the stack's own lies 20° from x."""
    axes = (
        "*ORIENTATION,NAME=O\n1,0,0,0,1,0\n3,20.\n"
        "*ORIENTATION,NAME=TURNED\n1,0,0,0,1,0\n3,60.\n"
        "*ORIENTATION,NAME=SWAPPED\n-0.3420201,0.9396926,0,1,0,0\n"
    )
    section = f"*SHELL SECTION,ELSET=ALL,COMPOSITE,ORIENTATION=O\n.5,3,M{layer}\n"
    model, _ = abaqus(SHEET + section + "*MATERIAL,NAME=M\n" + CARDS["lamina"] + DENSITY + axes)
    ((_, _, given, _),) = model["families"]
    cos, sin = np.cos(np.radians(20)), np.sin(np.radians(20))
    assert given["axis"] == pytest.approx([cos, sin, 0])
    assert given["layers"][0]["angle"] == pytest.approx(angle, abs=1e-5)


@pytest.mark.parametrize(("askew", "axis"), [(0.0, [0, 0, 1]), (0.05, [0, 0, 1]), (0.2, [1, 0, 0])])
def test_the_axis_of_a_stack_without_orientation(abaqus, askew, axis):
    """x along the surface; z where the normal lies within 0.1° of x, as Abaqus defines it."""
    deck = SHEET.replace("ELSET=ALL\n1,1,2,3,4", "ELSET=ALL\n1,11,12,13,14")
    slope = np.tan(np.radians(askew))
    corners = [(slope * z, y, z) for y, z in ((0, 0), (1, 0), (1, 1), (0, 1))]
    deck += "*NODE\n" + "".join(f"{k},{x},{y},{z}\n" for k, (x, y, z) in enumerate(corners, 11))
    section = "*SHELL SECTION,ELSET=ALL,COMPOSITE\n.5,3,M\n"
    model, _ = abaqus(deck + section + "*MATERIAL,NAME=M\n" + CARDS["lamina"] + DENSITY)
    ((_, _, given, _),) = model["families"]
    assert given["axis"] == axis


MAT = "MAT1,1,2.+5,,.3,2.-9\n"
QUAD = bdf.UNIT_GRIDS + "CQUAD4,1,1,1,2,3,4\nCQUAD4,2,1,5,6,7,8\nPSHELL,1,1,.1,1\n" + MAT


@pytest.mark.parametrize(
    ("given", "E", "nu"),
    [("2.+5,,.3", 2e11, 0.3), (",1.+5,.3", 2.6e11, 0.3), ("2.+5,8.+4,", 2e11, 0.25)],
)
def test_one_of_the_three_constants_may_be_missing(bulk, given, E, nu):
    model, _ = bulk(QUAD.replace("2.+5,,.3", given))
    assert model["families"][0][2]["E"] == pytest.approx(E)
    assert model["families"][0][2]["nu"] == pytest.approx(nu)
    assert not any("MAT1" in text for text in model["ignored"])


@pytest.mark.parametrize(
    ("own", "expected"),
    [
        ([0, 0, 0], [0, 0, 0]),
        ([1, 1, 1], [1, 1, 1]),
        ([1, 0, 0], None),
        ([0, 1, 0], None),
        ([0, 0, 1], [0, 1, 0]),
        ([1, 1, 0], [1, 0, 1]),
        ([1, 0, 1], None),
    ],
)
def test_directions_askew_in_a_plane(own, expected):
    """Rows 1 and 2 lie askew in the plane of x and z, row 3 along −y."""
    c = np.sqrt(0.5)
    frame = np.array([[c, 0, c], [c, 0, -c], [0, -1, 0]])
    found = fixed_along_axes(np.array(own, dtype=bool), frame)
    assert (found if found is None else found.astype(int).tolist()) == expected


def test_stiffness_gives_back_the_constants():
    E, nu, G = [9e4, 2e4, 1e4], [0.3, 0.25, 0.4], [5e3, 4e3, 3e3]
    np.testing.assert_allclose(
        constants_of_stiffness(constants(E, nu, G)), [*E, *nu, *G], rtol=1e-12
    )
    steel = isotropic(2e5, 0.3)
    np.testing.assert_allclose(
        constants_of_stiffness(constants(steel[:3], steel[3:6], steel[6:])), steel
    )


@pytest.mark.parametrize("kind", CARDS)
def test_an_orthotropic_shell_is_a_laminate_of_one_layer(abaqus, kind):
    """In N and mm: moduli × 10⁶ Pa, density × 10¹² kg/m³."""
    model, _ = abaqus(ply(CARDS[kind]))
    ((name, family, given, _),) = model["families"]
    assert (name, family) == ("ALL", "Laminate")
    (layer,) = given["layers"]
    expected = {"E1": 9e10, "E2": 2e10, "nu12": 0.3, "G12": 5e9, "G13": 4e9, "G23": 3e9}
    expected |= {"rho": 2e3, "thickness": 5e-4, "angle": 0.0}
    assert layer == pytest.approx(expected)
    assert given["axis"] == pytest.approx([1, 0, 0])
    assert given["top"] == pytest.approx([0, 0, 1])


def test_springs_and_supports_follow_the_system_of_their_node(bulk):
    quad = QUAD.replace("GRID,3,,1.,1.,0.", "GRID,3,,1.,1.,0.,5") + TURNED
    model, deck = bulk(quad + "CELAS2,9,5.,3,1\nCELAS2,10,7.,3,6\nSPC1,1,2,3\nSPC,1,3,5,,4,123\n")
    assert model["springs"][0][1] == pytest.approx({"y": 5e3})
    assert model["springs"][1][1] == pytest.approx({"rx": 7e-3})
    assert fixed(deck) == {"x": [4], "y": [4], "z": [3, 4], "rz": [3]}


def test_masses_with_a_factor(bulk):
    """WTMASS: densities, point and nonstructural masses are weights."""
    quad = QUAD.replace("PSHELL,1,1,.1,1", "PSHELL,1,1,.1,1,,,,4.-9")
    model, _ = bulk(quad + "PARAM,WTMASS,.5\nCONM2,9,2,,3.-3,,,,\n,1.,,2.,,,3.\n")
    ((_, _, given, _),) = model["families"]
    assert given["rho"] == pytest.approx(0.5 * (2e3 + 4e-9 / 0.1 * 1e12))
    ((point, mass, inertia),) = model["masses"]
    assert point == pytest.approx([1e-3, 0, 0])
    assert mass == pytest.approx(1.5)
    assert inertia == pytest.approx([5e-4, 1e-3, 1.5e-3])


#: kg/m³ of a t/mm³.
UNIT = 1e12
#: Two cells of 20 x 10 mm, 2 mm thick, 8e-9 t/mm³; beams of 2 mm² along 20 mm.
SOLID = inp.CUBE + inp.SOLID
PLATE = inp.SHEET + "*SHELL SECTION,ELSET=ALL,MATERIAL=M\n2.\n"
LAYERS = inp.SHEET + "*SHELL SECTION,ELSET=ALL,COMPOSITE\n.5,,M,0\n1.5,,M,0\n"
BARS = inp.BARS + "*BEAM SECTION,ELSET=ALL,MATERIAL=M,SECTION=RECT\n2.,1.\n0,0,1\n"
RODS = inp.BARS.replace("B31", "T3D2") + "*SOLID SECTION,ELSET=ALL,MATERIAL=M\n2.\n"
CASES = {
    "total": (SOLID, "TOTAL MASS", 3e-6, 3e-6 / 2000),
    "per volume": (SOLID, "MASS PER VOLUME", 1e-9, 1e-9),
    "shell, per area": (PLATE, "MASS PER AREA", 3e-9, 3e-9 / 2),
    "layers, per area": (LAYERS, "MASS PER AREA", 3e-9, 3e-9 / 2),
    "shell, total": (PLATE, "TOTAL MASS,DISTRIBUTION=VOLUME PROPORTIONAL", 4e-7, 4e-7 / 400),
    "beam, per length": (BARS, "MASS PER LENGTH", 3e-9, 3e-9 / 2),
    "rods, total": (RODS, "TOTAL MASS", 8e-8, 8e-8 / 80),
}


def densities(model) -> list[float]:
    """kg/m³ of the families of a model."""
    given = [arguments for _, _, arguments, *_ in model["families"]]
    return [a.get("rho") or np.mean([layer["rho"] for layer in a["layers"]]) for a in given]


@pytest.mark.parametrize("case", CASES)
def test_nonstructural_mass_of_abaqus(tmp_path, case):
    deck, units, value, more = CASES[case]
    card = f"*NONSTRUCTURAL MASS,ELSET=ALL,UNITS={units}\n{value!r}\n"
    model, _ = inp.read(tmp_path, deck + inp.STEEL + card)
    assert densities(model) == pytest.approx([(8e-9 + more) * UNIT])


def test_mass_in_proportion_to_mass_or_volume(tmp_path):
    """Two sheets, one of twice the density."""
    sheets = inp.BENT.replace("2,2,9,10,3\n", "*ELEMENT,TYPE=S4,ELSET=B\n2,5,6,7,8\n")
    text = sheets + "*SHELL SECTION,ELSET=ALL,MATERIAL=M\n2.\n*SHELL SECTION,ELSET=B,MATERIAL=N\n"
    text += "2.\n*MPC\nTIE,1,5\n" + inp.STEEL + inp.STEEL.replace("=M", "=N").replace("8.E", "16.E")
    text += "*ELSET,ELSET=BOTH\nALL,B\n*NONSTRUCTURAL MASS,ELSET=BOTH,UNITS=TOTAL MASS"
    by_mass, _ = inp.read(tmp_path, text + "\n9.6e-6\n")
    assert densities(by_mass) == pytest.approx([16e3, 32e3])
    by_volume, _ = inp.read(tmp_path, text + ",DISTRIBUTION=VOLUME PROPORTIONAL\n8e-6\n")
    assert densities(by_volume) == pytest.approx([18e3, 26e3])


@pytest.mark.parametrize("kind", ["BEAM", "TIE", "PIN", "LINK"])
def test_a_node_that_is_joined_with_itself_is_refused(tmp_path, kind):
    sheets = inp.BENT + "*SHELL SECTION,ELSET=ALL,MATERIAL=M\n2.\n"
    text = sheets + f"*MPC\n{kind},5,5\n" + inp.STEEL
    with pytest.raises(MeshError, match=f"MPC of type {kind} joins a node with itself"):
        inp.read(tmp_path, text)


@pytest.mark.parametrize("units", ["MASS PER LENGTH", "MASS PER AREA", "MASS PER YEAR"])
def test_masses_of_another_dimension_are_refused(tmp_path, units):
    card = f"*NONSTRUCTURAL MASS,ELSET=ALL,UNITS={units}\n1\n"
    with pytest.raises(MeshError, match=inp.line(SOLID + inp.STEEL + card, "*NONST")):
        inp.read(tmp_path, SOLID + inp.STEEL + card)


SHELLS = bdf.GRIDS + bdf.MAT1 + "CQUAD4,1,7,1,2,3,4\nCQUAD4,2,8,5,6,7,8\nRBE2,9,1,123456,5\n"
SHELLS += "PSHELL,7,1,2.,1,,1\nPSHELL,8,1,2.,1,,1\n"
#: Entry -> densities of both shells beyond the material's, t/mm³.
ENTRIES = {
    "NSM,3,PSHELL,7,2.-9,8,4.-9": (1e-9, 2e-9),
    "NSM1,3,PSHELL,2.-9,7,THRU,8": (1e-9, 1e-9),
    "NSM1,3,PSHELL,2.-9,ALL": (1e-9, 1e-9),
    "NSM,3,ELEMENT,2,4.-9": (0, 2e-9),
    "NSML,3,PSHELL,7,4.-7,8,8.-7": (1e-9, 2e-9),
    "NSML1,3,PSHELL,8.-7,7,8": (1e-9, 1e-9),
    "NSML1,3,ELEMENT,8.-7,1": (2e-9, 0),
}


@pytest.mark.parametrize("entry", ENTRIES)
def test_nonstructural_mass_of_nastran(tmp_path, entry):
    """By properties and elements, per area (NSM) or in all (NSML); WTMASS counts."""
    for factor in (1.0, 0.5):
        text = f"{SHELLS}{entry}\nPARAM,WTMASS,{factor}\n"
        model, _ = bdf.read(tmp_path, text)
        expected = [(8e-9 + more) * UNIT * factor for more in ENTRIES[entry]]
        assert sorted(densities(model)) == pytest.approx(sorted(expected))


def test_the_case_control_selects_nonstructural_mass(tmp_path):
    text = SHELLS + "NSM,3,PSHELL,7,2.-9\nNSM,4,PSHELL,8,2.-9\nNSMADD,5,3,4\n"
    for control, more in (("NSM=4\n", (0, 1)), ("NSM=5\n", (1, 1)), ("LOAD=1\n", (0, 0))):
        model, deck = bdf.read(tmp_path, f"{control}BEGIN BULK\n{text}")
        assert densities(model) == pytest.approx([8e3 + 1e3 * k for k in more])
        assert any("NSM set" in told for told in deck.remarks) == (sum(more) < 2)


def test_nonstructural_mass_of_nothing_is_refused(tmp_path):
    with pytest.raises(MeshError, match="of no element"):
        bdf.read(tmp_path, SHELLS + "NSM,3,PSHELL,99,2.-9\n")
    card = "*NONSTRUCTURAL MASS,ELSET=ALL,UNITS=MASS PER AREA\n3e-9\n"
    for sheet in (PLATE.replace("2.\n", "0.\n"), LAYERS.replace("1.5,", "-.5,")):
        with pytest.raises(MeshError, match="without thickness"):
            inp.read(tmp_path, sheet + inp.STEEL + card)


def test_measures_of_cells():
    """An affine image of each reference cell has its measure times the determinant."""
    rng = np.random.default_rng(5)
    J = rng.normal(size=(3, 3))
    square = np.array([[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]], dtype=float)
    up = np.array([0.0, 0.0, 1.0])
    flat, across = square[[0, 1, 3]], np.linalg.norm(np.cross(J[:, 0], J[:, 1]))
    det = abs(np.linalg.det(J))
    cells = {
        "line": (square[:2], np.linalg.norm(J[:, 0])),
        "triangle": (flat, across / 2),
        "quad": (square, across),
        "tetra": (np.vstack([flat, up]), det / 6),
        "pyramid": (np.vstack([square, up]), det / 3),
        "wedge": (np.vstack([flat, flat + up]), det / 2),
        "hexahedron": (np.vstack([square, square + up]), det),
    }
    for shape, (x, expected) in cells.items():
        none = np.zeros((1, 0), dtype=np.int64)
        deck = Deck("a", x @ J.T, [Block(shape, "", np.arange(len(x))[None], none, none)])
        assert measures_of(deck, np.array([0]))[0] == pytest.approx(expected, rel=1e-12)


#: A rotation by 90° about the line along z through (5, 0, 0), after a shift by 100.
ROTATED = "*INSTANCE,NAME=I,PART=P\n100,0,0\n5,0,0,5,0,1,90\n*END INSTANCE\n"
STRAIGHT = "*INSTANCE,NAME=J,PART=P\n0,0,50\n*END INSTANCE\n"
BEAM = "*BEAM SECTION,ELSET=ALL,MATERIAL=M,SECTION=RECT\n2,1\n"
ORTHOTROPIC = "*MATERIAL,NAME=M\n*ELASTIC,TYPE=LAMINA\n9E4,2E4,.25,5E3,4E3,3E3\n*DENSITY\n2.E-9\n"
COMPOSITE = "*SHELL SECTION,ELSET=ALL,COMPOSITE{}\n.5,3,M,0.\n"
ALONG = "*ORIENTATION,NAME=O\n{}\n"


def deck(part: str, placed: str, rest: str = "", material: str = inp.STEEL) -> str:
    """A deck of one part."""
    return f"*PART,NAME=P\n{part}*END PART\n*ASSEMBLY\n{placed}{rest}*END ASSEMBLY\n{material}"


@pytest.mark.parametrize("points", ["1,0,0,0,1,0", "3,2,1,2,3,1,2,2,1"])
def test_the_axes_of_layers(tmp_path, points):
    """By two points, and an origin if it is given."""
    part = inp.SHEET + ALONG.format(points) + COMPOSITE.format(",ORIENTATION=O")
    model, _ = inp.read(tmp_path, deck(part, ROTATED + STRAIGHT, material=ORTHOTROPIC))
    found = {name: arguments["axis"] for name, _, arguments, _ in model["families"]}
    assert found["I.All"] == pytest.approx([0, 1, 0], abs=1e-12)
    assert found["J.All"] == pytest.approx([1, 0, 0], abs=1e-12)


def test_orientations_of_the_same_name_belong_to_their_parts(tmp_path):
    sheet = inp.SHEET + ALONG + COMPOSITE.format(",ORIENTATION=O")
    parts = "".join(
        f"*PART,NAME={name}\n{sheet.format(points)}*END PART\n"
        for name, points in (("P", "1,0,0,0,1,0"), ("Q", "0,1,0,-1,0,0"))
    )
    placed = STRAIGHT + "*INSTANCE,NAME=K,PART=Q\n*END INSTANCE\n"
    model, _ = inp.read(tmp_path, f"{parts}*ASSEMBLY\n{placed}*END ASSEMBLY\n{ORTHOTROPIC}")
    found = {name: arguments["axis"] for name, _, arguments, _ in model["families"]}
    assert found == {"J.All": [1, 0, 0], "K.All": [0, 1, 0]}


@pytest.mark.parametrize(
    ("transform", "fixed"),
    [
        ("*TRANSFORM,NSET=N\n0,1,0,-1,0,0\n", "fixed x"),  # 1 along y of the part
        ("*TRANSFORM,NSET=N\n1,0,0,0,1,0\n", "fixed y"),
        # 1 away from the line along z through (40, 5, 0) of the part, as seen from node 9
        ("*TRANSFORM,NSET=E,TYPE=C\n40,5,0,40,5,1\n", "fixed x"),
    ],
)
def test_supports_in_the_axes_of_their_part(tmp_path, transform, fixed):
    part = inp.BENT + "*NSET,NSET=E\n9\n*SHELL SECTION,ELSET=ALL,MATERIAL=M\n.5\n" + transform
    _, found = inp.read(tmp_path, deck(part, ROTATED, "*BOUNDARY\nI.E,1,1\n"))
    assert {name: rows.tolist() for name, rows in found.fixed.items()} == {fixed: [8]}


@pytest.mark.parametrize(
    ("part", "material"),
    [
        (inp.BARS + BEAM, inp.STEEL),
        (inp.BARS + BEAM + "0,1,0\n*BOUNDARY\n1,1,1\n", inp.STEEL),
        (inp.BARS + BEAM + "0,1,0\n*EQUATION\n2\n2,1,1.,3,1,-1.\n", inp.STEEL),
        (inp.SHEET + COMPOSITE.format(""), ORTHOTROPIC),
        (
            inp.CUBE + inp.SOLID,
            "*MATERIAL,NAME=M\n*ELASTIC,TYPE=ENGINEERING CONSTANTS\n9E4,2E4,2E4,.2,.2,.2,5E3,5E3,\n"
            "5E3\n*DENSITY\n2.E-9\n",
        ),
        (
            inp.BARS + BEAM + "0,1,0\n*ELEMENT,TYPE=SPRING1,ELSET=K\n5,2\n*SPRING,ELSET=K\n1\n4.\n",
            inp.STEEL,
        ),
    ],
)
def test_motions_and_axes_by_their_numbers_are_refused(tmp_path, part, material):
    inp.read(tmp_path, deck(part, STRAIGHT, material=material))
    with pytest.raises(MeshError, match="rotated"):
        inp.read(tmp_path, deck(part, ROTATED, material=material))


def test_the_axes_of_beams(tmp_path):
    text = deck(inp.BARS + BEAM + "0,1,0\n", ROTATED + STRAIGHT)
    model, _ = inp.read(tmp_path, text)
    found = {name: arguments["orientation"] for name, _, arguments, _ in model["families"]}
    assert found["I.ALL"] == pytest.approx([-1, 0, 0], abs=1e-12)
    assert found["J.ALL"] == [0, 1, 0]


def test_springs_along_axes_of_their_part(tmp_path):
    spring = "*ELEMENT,TYPE=SPRING1,ELSET=K\n5,2\n*SPRING,ELSET=K,ORIENTATION=O\n1\n4.\n"
    part = inp.BARS + BEAM + "0,1,0\n" + ALONG.format("1,0,0,0,0,1") + spring
    for placed, motion in ((ROTATED, "y"), (STRAIGHT, "x")):
        model, _ = inp.read(tmp_path, deck(part, placed))
        ((_, stiffness),) = model["springs"]
        assert stiffness == {motion: pytest.approx(4e3)}
