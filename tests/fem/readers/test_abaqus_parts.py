"""Rods, parts and element types of Abaqus decks, and sections that are refused."""

from __future__ import annotations

import math

import numpy as np
import pytest

from abaqus_decks import BARS, BENT, CUBE, NODES, NU, RHO, SHEET, SOLID, STEEL, E, alike, line, read
from antiosc.base.errors import MeshError
from refusals import refused

SHELL = "*SHELL SECTION,ELSET=ALL,MATERIAL=M{}\n.5\n"
PLY = "*MATERIAL,NAME=P\n*ELASTIC,TYPE=LAMINA\n9E4,2E4,.25,5E3,4E3,3E3\n*DENSITY\n2.E-9\n"

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


def test_bars_of_the_plane_do_not_leave_it(tmp_path):
    text = RODS.replace("T3D2", "T2D2").replace(",7", ",4")
    _, deck = read(tmp_path, text)
    assert {name: nodes.tolist() for name, nodes in deck.fixed.items()} == {"fixed z": [0, 1, 3]}


def test_rods_beside_other_elements_are_springs(tmp_path):
    text = RODS + "*ELEMENT,TYPE=C3D8,ELSET=C\n9,1,2,3,4,5,6,7,8\n"
    text += "*SOLID SECTION,ELSET=C,MATERIAL=M\n*BOUNDARY\n1,1,3\n"
    model, deck = read(tmp_path, text)
    assert all("T3D2 of part.inp are springs" in told for told in deck.told)
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


def test_a_rod_without_a_length_or_a_section(tmp_path):
    cube = "*ELEMENT,TYPE=C3D8,ELSET=C\n9,1,2,3,4,5,6,7,8\n*SOLID SECTION,ELSET=C,MATERIAL=M\n"
    text = RODS.replace("1,1,2\n", "1,2,11\n") + "*NODE\n11,20,0,0\n" + cube
    with pytest.raises(MeshError, match=rf"{line(text, '*SOLID')}: .*coincide"):
        read(tmp_path, text)
    with pytest.raises(MeshError, match=r"T3D2 .*section"):
        read(tmp_path, RODS.replace("*SOLID SECTION,ELSET=B,MATERIAL=M\n", "") + cube)


PARTS = CUBE + "*ELEMENT,TYPE=S4,ELSET=LID\n2,5,6,7,8\n*ELEMENT,TYPE=S4,ELSET=WING\n3,2,9,10,3\n"
PARTS += "*ELSET,ELSET=NONE\n*SHELL SECTION,ELSET=LID,MATERIAL=M\n.5\n"
PARTS += "*SHELL SECTION,ELSET=WING,MATERIAL=M\n.5\n*SHELL SECTION,ELSET=NONE,MATERIAL=M\n.5\n"
PARTS += SOLID + STEEL
ON = "*ELEMENT,TYPE=MASS,ELSET=Q\n9,9\n10,6\n*MASS,ELSET=Q\n1.\n*ELEMENT,TYPE=SPRING1,ELSET=K\n"
ON += "11,10\n12,1\n*SPRING,ELSET=K\n3\n4.\n*EQUATION\n2\n9,1,1.,6,1,-1.\n"
ON += "*EQUATION\n2\n6,1,1.,7,1,1.\n"


def test_some_parts_of_a_deck(tmp_path):
    """What acts on nodes of the others alone is left out, and counted."""
    model, deck = read(tmp_path, PARTS + ON, parts=["ALL", "LID"])
    assert [name for name, *_ in model["families"]] == ["LID", "ALL"]
    assert {name: some.tolist() for name, some in deck.element_sets.items() if len(some)} == {
        "ALL": [0], "LID": [1],
    }  # fmt: skip
    left_out = "3 constraints, springs, dampers or masses on parts that are left out"
    assert model["ignored"] == [left_out]
    assert len(model["joints"]["equations"]) == 1
    assert [mass for _, _, mass in model["joints"]["masses"]] == [pytest.approx(1e3)]
    assert [k for _, k in model["joints"]["springs"]] == [pytest.approx(4e3)]
    everything, _ = read(tmp_path, PARTS + ON)
    assert everything["ignored"] == []
    assert len(everything["joints"]["equations"]) == 2
    with refused(None, "'ALL', 'LID', 'WING'", MeshError):
        read(tmp_path, PARTS, parts=["LID", "NONE"])


def test_points_of_no_element_are_fixed_by_their_motions(tmp_path):
    """Reference nodes of rigid bodies, and the node whose displacements are rotations."""
    text = PARTS + "*NODE\n11,1,1,1\n12,2,2,2\n13,3,3,3\n*NSET,NSET=A\n1,4\n*NSET,NSET=B\n5,6\n"
    text += "*RIGID BODY,NSET=A,REF NODE=11,ROT NODE=13\n*RIGID BODY,NSET=B,REF NODE=12\n"
    model, deck = read(tmp_path, text + "*BOUNDARY\n11,2,3\n12,4\n13,1\n2,1\n")
    points = [[1e-3] * 3, [2e-3] * 3]
    np.testing.assert_allclose(model["joints"]["points"], points)
    # node 13 has the rotations of node 11
    assert model["fixed_points"] == [[-1, ["rx", "y", "z"]], [-2, ["rx"]]]
    assert {name: rows.tolist() for name, rows in deck.fixed.items()} == {"fixed x": [1]}


REFUSED = {
    "general": (
        SHEET + "*SHELL GENERAL SECTION,ELSET=ALL,MATERIAL=M\n.5\n", None, "*SHELLGENERALSECTION"),
    "material": (SHEET + SHELL.format("ATTER"), None, "*MATERIAL"),
    "no elasticity": (CUBE + SOLID + "*MATERIAL,NAME=M\n*DENSITY\n1.\n", None, "elasticity"),
    "a layer without": (
        SHEET + "*SHELL SECTION,ELSET=ALL,COMPOSITE\n.5,3,M\n*MATERIAL,NAME=M\n",
        None, "elasticity"),
    "beams askew": (BARS + "*BEAM SECTION,ELSET=ALL,MATERIAL=P\n1,1\n" + PLY, None, "orthotropic"),
    "two families": (
        SHEET.replace("S4", "CPS4") + "*ELEMENT,TYPE=C3D8,ELSET=C\n2,1,2,3,4,5,6,7,8\n"
                     + SOLID + "*SOLID SECTION,ELSET=C,MATERIAL=M\n" + STEEL, None, "structure"),
    "other": (SHEET.replace("S4", "M3D4") + STEEL, None, "element"),
    "bare": (
        BENT.replace("2,2,9", "*ELEMENT,TYPE=S4\n2,2,9") + SHELL.format("") + STEEL,
        None, "section"),
}  # fmt: skip


@pytest.mark.parametrize("case", REFUSED)
def test_what_is_refused(tmp_path, case):
    text, line, word = REFUSED[case]
    with refused(line, word, MeshError):
        read(tmp_path, text)
