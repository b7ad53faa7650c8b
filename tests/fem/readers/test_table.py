"""The table of decks: its independent parser and matrices, and what it says of decks made here."""

from __future__ import annotations

import shutil
import sys

import numpy as np
import pytest

pytest.importorskip("dolfinx")

from paths import BENCHMARKS, DECKS

sys.path.insert(0, str(BENCHMARKS / "decks"))
import census
import table

pytestmark = pytest.mark.fem

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
    (tmp_path / "contact.inp").write_text(
        (DECKS / "block.inp").read_text() + "*CONTACT PAIR, INTERACTION=I\nA, B\n"
    )
    text, good = table.summary(tmp_path)
    assert good, text
    lines = text.splitlines()
    assert lines[0].startswith("4 decks: 4 read as meshes, 3 are structures, 3 struck")
    assert "3 of 3 struck" in lines[1]
    assert "contact.inp (contact)" in text
