"""Folded and collapsed cells: found by their Jacobian, straightened if gmsh made them.

A curved cell at a tight fillet may have a negative Jacobian at a corner. Integrals over it are
wrong without any other symptom, and a point in it has two sets of reference coordinates.
"""

from __future__ import annotations

import numpy as np

from antiosc._types import Array, IntArray
from antiosc.errors import MeshError
from antiosc.fem import compat

#: Smallest Jacobian determinant over the largest in a cell, from which on it counts as sound.
SOUND = 0.02
#: Measure of a cell over its size to the power of its dimension below which it has none.
LEAST_MEASURE = 1e-7
#: Size of a cell over that of the mesh below which it is a point.
POINT = 1e-12
#: Mid-side nodes of second-order simplices in gmsh's order, from the third vertex on.
MID_SIDE_EDGES = {
    "triangle": [(0, 1), (1, 2), (2, 0)],
    "tetrahedron": [(0, 1), (1, 2), (2, 0), (3, 0), (3, 2), (3, 1)],
}


def folded(points: Array, cells: IntArray, shape: str, order: int, least: float = 0.0) -> IntArray:
    """Cells whose smallest Jacobian is at most `least` of the largest.

    Solids, or faces in the plane or in space; their nodes are in dolfinx's order.
    """
    slopes = compat.lattice_gradients(shape, order, 3 if order > 1 else 1)
    found = []
    for start in range(0, len(cells), 20_000):
        x = points[cells[start : start + 20_000]]
        J = np.einsum("dqn,cni->cqdi", slopes, x, optimize=True)
        det = np.linalg.det(J) if J.shape[2] == J.shape[3] else _along_mean_normal(J)
        det = det * np.sign(det.sum(axis=1))[:, None]
        found.append(start + np.flatnonzero(det.min(axis=1) <= least * det.max(axis=1)))
    return np.concatenate([np.zeros(0, dtype=np.int64), *found])


def _along_mean_normal(J: Array) -> Array:
    """Areas (cells, q) of faces in space, as seen along the mean normal of each."""
    normals = np.cross(J[:, :, 0], J[:, :, 1])
    mean = normals.sum(axis=1)
    size = np.linalg.norm(mean, axis=1, keepdims=True)
    return np.einsum("cqi,ci->cq", normals, mean / np.where(size > 0, size, 1.0))


def collapsed(points: Array, cells: IntArray, shape: str, order: int) -> IntArray:
    """Cells (nodes in dolfinx's order) without length, area or volume, in any space."""
    slopes = compat.lattice_gradients(shape, order, order)
    J = np.einsum("dqn,cni->cqdi", slopes, points[cells], optimize=True)
    measure = np.sqrt(np.abs(np.linalg.det(J @ J.swapaxes(2, 3)))).max(axis=1)
    size = np.abs(J).max(axis=(1, 2, 3))
    nothing = size <= POINT * np.ptp(points, axis=0).max()
    return np.flatnonzero(nothing | (measure <= LEAST_MEASURE * size ** slopes.shape[0]))


def straightened(points: Array, cells: IntArray, shape: str) -> Array:
    """`points` with the mid-side nodes of folded second-order simplices moved to the midpoints.

    `cells` are in gmsh's order. Neighbours share those nodes: repeated until no cell is folded.
    """
    points = points.copy()
    edges = np.array(MID_SIDE_EDGES[shape])
    middles = slice(edges.max() + 1, edges.max() + 1 + len(edges))
    reordered = cells[:, compat.node_order(shape, cells.shape[1], "gmsh")]
    bad = folded(points, reordered, shape, 2, SOUND)
    before = -1
    straight = np.zeros(len(cells), dtype=bool)
    while len(bad):
        straight[bad] = True
        if straight.sum() == before:
            raise MeshError(
                f"gmsh made {len(bad)} cells without volume: choose another element size."
            )
        before = int(straight.sum())
        points[cells[straight][:, middles]] = points[cells[straight][:, edges]].mean(axis=2)
        near = np.isin(cells, cells[straight][:, middles]).any(axis=1)
        suspects = np.flatnonzero(near)
        bad = suspects[folded(points, reordered[suspects], shape, 2, SOUND)]
    return points
