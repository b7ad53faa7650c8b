"""Folded second-order cells: their mid-side nodes move to the midpoints, those of others stay."""

from __future__ import annotations

import numpy as np
import pytest

pytest.importorskip("dolfinx")

from antiosc.fem.mesh.soundness import MID_SIDE_EDGES, collapsed, folded, straightened
from antiosc.fem.platform import compat

pytestmark = pytest.mark.fem

VERTICES = {
    "triangle": np.array([[0.0, 0, 0], [1, 0, 0], [0, 1, 0]]),
    "tetrahedron": np.array([[0.0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1]]),
}


def curved(shape: str) -> np.ndarray:
    """Nodes of one cell in gmsh's order, a little off the midpoints."""
    corners = VERTICES[shape]
    middles = [(corners[i] + corners[j]) / 2 + 0.01 for i, j in MID_SIDE_EDGES[shape]]
    nodes = np.vstack([corners, middles])
    if shape == "triangle":
        nodes[:, 2] = 0.0
    return nodes


EVERY_EDGE = [(shape, k) for shape, ends in MID_SIDE_EDGES.items() for k in range(len(ends))]


@pytest.mark.parametrize(("shape", "edge"), EVERY_EDGE)
def test_one_of_two_cells_is_straightened(shape, edge):
    ends = MID_SIDE_EDGES[shape]
    n, corners = len(curved(shape)), len(VERTICES[shape])
    points = np.vstack([curved(shape), curved(shape) + 5.0])
    i, j = ends[edge]
    points[corners + edge] = 1.4 * points[j] - 0.4 * points[i]  # beyond the end of its edge
    if shape == "triangle":
        points = points[:, :2]
    cells = np.arange(2 * n).reshape(2, n)
    order = compat.node_order(shape, n, "gmsh")
    assert folded(points, cells[:, order], shape, 2, 0.02).tolist() == [0]
    assert not len(collapsed(points, cells[:, order], shape, 2))
    found = straightened(points, cells, shape)
    np.testing.assert_array_equal(found[n:], points[n:])
    np.testing.assert_array_equal(found[:corners], points[:corners])
    for k, (i, j) in enumerate(ends):
        np.testing.assert_allclose(found[corners + k], (points[i] + points[j]) / 2, atol=1e-15)
    assert not len(folded(found, cells[:, order], shape, 2, 0.02))


def test_a_cell_without_measure_is_collapsed():
    points = np.vstack([curved("triangle"), curved("triangle") + 5.0])
    points[:6, 1] = 0.0  # on a line
    order = compat.node_order("triangle", 6, "gmsh")
    cells = np.arange(12).reshape(2, 6)[:, order]
    assert collapsed(points, cells, "triangle", 2).tolist() == [0]
    points[:6] = 3.0  # at a point
    assert collapsed(points, cells, "triangle", 2).tolist() == [0]
