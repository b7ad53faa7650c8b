"""The tables of cells, supports and element types against the geometry that they stand for."""

from __future__ import annotations

from collections import Counter
from itertools import pairwise

import numpy as np
import pytest

from antiosc.io import neutral
from antiosc.io.conversion import NodeTable
from antiosc.io.mesh_files import GMSH_FACES
from antiosc_decks.abaqus_joints import SOLID_FACES
from antiosc_decks.abaqus_mesh import element_type

BASE = {"triangle": [(0, 0), (1, 0), (0, 1)], "quad": [(0, 0), (1, 0), (1, 1), (0, 1)]}
POINTS = {
    "triangle": BASE["triangle"],
    "quad": BASE["quad"],
    "tetra": [*((*p, 0) for p in BASE["triangle"]), (0, 0, 1)],
    "pyramid": [*((*p, 0) for p in BASE["quad"]), (0, 0, 1)],
    "wedge": [(*p, z) for z in (0, 1) for p in BASE["triangle"]],
    "hexahedron": [(*p, z) for z in (0, 1) for p in BASE["quad"]],
}


def rings(face):
    return {frozenset(pair) for pair in pairwise([*face, face[0]])}


@pytest.mark.parametrize("shape", ["tetra", "pyramid", "wedge", "hexahedron"])
def test_volumes_are_closed_by_their_faces(shape):
    """Every edge lies in two faces, and V − E + F = 2; corners go around plane faces."""
    x = np.array(POINTS[shape], dtype=float)
    edges, faces = neutral.EDGES[shape], neutral.FACES[shape]
    assert neutral.DIMENSION[shape] == 3
    assert neutral.CORNERS[shape] == len(x)
    assert len(x) - len(edges) + len(faces) == 2
    count = Counter(edge for face in faces for edge in rings(face))
    assert count == dict.fromkeys(map(frozenset, edges), 2)
    for face in faces:
        corners = x[list(face)]
        assert np.linalg.matrix_rank(corners[1:] - corners[0]) == 2
        sides = np.roll(corners, -1, axis=0) - corners
        turns = np.cross(sides, np.roll(sides, -1, axis=0))
        assert (turns @ turns[0] > 0).all()
    assert all(len(face) == 4 for face in neutral.rectangles(shape))
    assert len(neutral.rectangles(shape)) == sum(len(face) == 4 for face in faces)


@pytest.mark.parametrize(
    ("faces", "shape"),
    [(faces, shape) for shape, faces in SOLID_FACES.items()]
    + [(faces, shape) for shape, faces in GMSH_FACES.items()],
)
def test_faces_of_other_programs_are_those_of_the_cell(faces, shape):
    """Each is a face of the cell with its corners around it; gmsh's are those with four."""
    own = neutral.FACES[shape]
    if faces is GMSH_FACES.get(shape):
        own = [face for face in own if len(face) == 4]
    assert sorted(map(sorted, faces)) == sorted(map(sorted, own))
    around = {frozenset(face): rings(face) for face in own}
    assert all(rings(face) == around[frozenset(face)] for face in faces)


def test_middles_that_are_placed_lie_there_among_their_nodes():
    """The first, the second, and one that is not placed: that lies halfway."""
    table = NodeTable(np.arange(30.0).reshape(10, 3))
    around = np.arange(2, 10)[None]
    table.place(np.array([[3, 1]]), np.full((1, 3), 7.5), around)
    table.place(np.array([[4, 6]]), np.full((1, 3), 8.5), around[:, ::-1])
    for ends, x, parents in (
        ((1, 3), [7.5] * 3, range(2, 10)),
        ((6, 4), [8.5] * 3, range(9, 1, -1)),
        ((0, 2), [3, 4, 5], (0, 2)),
    ):
        node = int(table.between(np.array(ends)))
        assert table.all_points()[node].tolist() == list(x)
        assert int(table.between(np.array(ends[::-1]))) == node  # once
        own = [*parents]
        assert node in table.grown(np.array(own))
        for missing in range(len(own)):
            assert node not in table.grown(np.delete(own, missing))


def test_inner_nodes_of_the_hexahedron_of_27():
    """Node 21 is the centre; 22 bottom, 23 top, then the sides y = 0, x = 1, y = 1, x = 0.

    In VTK's order they stand as x = 0, x = 1, y = 0, y = 1, bottom, top, centre.
    """
    found = element_type("C3D27")
    sides = {21: "centre", 22: "bottom", 23: "top", 24: "y0", 25: "x1", 26: "y1", 27: "x0"}
    names = [sides[place + 1] for place in found.inner]
    assert names == ["x0", "x1", "y0", "y1", "bottom", "top", "centre"]
    assert list(found.corners) == list(range(8))
    assert list(found.mids) == list(range(8, 20))
