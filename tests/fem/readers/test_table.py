"""The table of decks: its independent parser and matrices, and what it says of decks made here."""

from __future__ import annotations

import shutil
import sys

import numpy as np
import pytest

from paths import BENCHMARKS, DECKS

sys.path.insert(0, str(BENCHMARKS / "decks"))
import census
import table

#: Corners and middles of a brick of 20 nodes in Abaqus' order, sides 2.
BRICK = census._BRICK
MIDDLES = np.array([(BRICK[a] + BRICK[b]) / 2 for a, b in census._EDGES])


def test_measures_are_those_of_closed_forms():
    brick = np.vstack([BRICK, MIDDLES])
    stretch = np.array([[2.0, 0.3, 0], [0, 1, 0.2], [0, 0, 3]])
    assert census.measure("C3D20R", brick @ stretch) == pytest.approx(8 * 6, rel=1e-13)
    assert census.measure("C3D8", BRICK @ stretch) == pytest.approx(8 * 6, rel=1e-13)
    tetra = np.vstack([np.zeros(3), np.eye(3)])
    ends = [(0, 1), (1, 2), (2, 0), (0, 3), (1, 3), (2, 3)]
    curved = np.vstack([tetra, [(tetra[a] + tetra[b]) / 2 for a, b in ends]])
    assert census.measure("C3D10", curved) == pytest.approx(1 / 6, rel=1e-13)
    # a side raised by h: a parabola of area 2/3 h over each of its lines
    plate = np.vstack([BRICK[:4], MIDDLES[:4]])[:, :2]
    plate[4, 1] -= 0.5
    plane = np.column_stack([plate, np.zeros(8)])
    assert census.measure("CPS8", plane) == pytest.approx(4 + 2 * 0.5 * 2 / 3, rel=1e-12)
    wedge = np.array([[0, 0, -1], [1, 0, -1], [0, 1, -1], [0, 0, 1], [1, 0, 1], [0, 1, 1.0]])
    pairs = [(0, 1), (1, 2), (2, 0), (3, 4), (4, 5), (5, 3), (0, 3), (1, 4), (2, 5)]
    both = np.vstack([wedge, [(wedge[a] + wedge[b]) / 2 for a, b in pairs]])
    assert census.measure("C3D6", wedge) == pytest.approx(1, rel=1e-13)
    assert census.measure("C3D15", both) == pytest.approx(1, rel=1e-13)


@pytest.mark.slow  # a process of its own loads dolfinx
def test_decks_made_here_are_struck_as_the_references_say(tmp_path):
    made = {"block.inp", "cantilever.inp", "layers.inp"}
    for name in made:
        shutil.copy(DECKS / name, tmp_path)
    (tmp_path / "contact.inp").write_text((DECKS / "block.inp").read_text() + "*CONTACT\n")
    text, good = table.summary(tmp_path)
    assert good, text
    lines = text.splitlines()
    assert lines[0].startswith("4 decks: 4 read as meshes, 3 are structures, 3 struck")
    assert "3 of 3 struck" in lines[1]
    assert "contact.inp (contact)" in text


@pytest.mark.slow
def test_a_plate_of_thin_cells_is_as_stiff_as_in_extended_precision(tmp_path):
    """300 × 30 × 1 in 18 cells: the entries of K alone leave five digits."""
    x, y = np.linspace(0, 300, 7), np.linspace(0, 30, 4)
    text, number = "*NODE\n", {}
    for k in range(2):
        for j in range(4):
            for i in range(7):
                number[i, j, k] = len(number) + 1
                text += f"{len(number)},{x[i]:.17g},{y[j]:.17g},{k}\n"
    text += "*ELEMENT,TYPE=C3D8,ELSET=ALL\n"
    for i in range(6):
        for j in range(3):
            ring = [(i, j), (i + 1, j), (i + 1, j + 1), (i, j + 1)]
            nodes = [number[a, b, k] for k in (0, 1) for a, b in ring]
            text += f"{3 * i + j + 1}," + ",".join(map(str, nodes)) + "\n"
    text += "*BOUNDARY\n" + "".join(f"{number[0, j, k]},1,3\n" for j in range(4) for k in (0, 1))
    text += "*SOLID SECTION,ELSET=ALL,MATERIAL=M\n*MATERIAL,NAME=M\n*ELASTIC\n2.1E11,.3\n"
    (tmp_path / "plate.inp").write_text(text + "*DENSITY\n7850.\n")
    found = table.tried(tmp_path / "plate.inp")
    assert found["by"] == "NumPy's K"
    assert found["k0"] == pytest.approx(found["reference"], rel=1e-8)
