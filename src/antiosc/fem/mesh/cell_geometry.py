"""The map x(X) from reference coordinates to points, for many cells at once, and its inverse."""

from __future__ import annotations

from collections.abc import Callable

import basix
import numpy as np
from scipy.spatial import cKDTree

from antiosc.base._types import Array, IntArray

#: Cells whose reference shape is a simplex; the others are products of intervals.
SIMPLICES = ("interval", "triangle", "tetrahedron")
#: Most Gauss–Newton steps onto a curved cell, and the step (reference lengths) that ends them: what
#: is left is its square.
FOOT_STEPS, FOOT_SETTLED = 12, 1e-8
#: A foot that leaves its cell by more than this is not sought any further (reference lengths).
FOOT_BEYOND = 1.0


class CellGeometry:
    """Nodes and shape functions of the cells of one rank.

    Parameters
    ----------
    nodes : (cells, k, 3) coordinates of the nodes of each cell [m]
    cell : shape of the cells, as dolfinx names it
    order : geometric order, 1 or 2
    """

    def __init__(self, nodes: Array, cell: str, order: int) -> None:
        kind = getattr(basix.CellType, cell)
        self.nodes = nodes
        self.simplex = cell in SIMPLICES
        self.affine = self.simplex and order == 1
        self.corners = np.asarray(basix.geometry(kind))
        self._element = basix.create_element(basix.ElementFamily.P, kind, order)

    @property
    def reference_nodes(self) -> Array:
        """Reference coordinates (k, tdim) of the nodes of a cell, in their order."""
        return np.asarray(self._element.points)

    def at(self, cell: IntArray, X: Array) -> tuple[Array, Array]:
        """(points (n, 3) [m], their derivatives (n, 3, tdim)) at X (n, tdim) in cells (n,)."""
        if not len(X):  # Basix 0.5 aborts
            return np.zeros((0, 3)), np.zeros((0, 3, len(self.corners[0])))
        tables = self._element.tabulate(1, X)[..., 0]
        nodes = self.nodes[cell]
        both = np.swapaxes(tables, 0, 1) @ nodes  # (n, 1 + tdim, 3)
        return both[:, 0], np.swapaxes(both[:, 1:], 1, 2)

    def slopes(self, X: Array) -> Array:
        """Slopes (n, nodes, tdim) of the shape functions of the map at X (n, tdim)."""
        tables = self._element.tabulate(1, X)[1:, :, :, 0]
        return np.asarray(np.moveaxis(tables, 0, 2))

    def centre(self) -> Array:
        """Reference coordinates (tdim,) of the middle of a cell."""
        return np.asarray(self.corners.mean(axis=0))


def projected(
    at: Callable[[IntArray, Array], tuple[Array, Array]],
    points: Array,
    start: Array,
    *,
    affine: bool,
    along: Array | None = None,
) -> Array:
    """Reference coordinates (n, t) at which x(ξ) is nearest to each point, in or out of its cell.

    Gauss–Newton iteration; it stops for points whose projection lies far outside the cell.

    Parameters
    ----------
    at : numbers k of points, ξ (k, t) -> (x (k, 3), dx/dξ (k, 3, t))
    points : (n, 3)
    start : (n, t)
    affine : whether one step is exact
    along : (n, 3) unit vectors, optional; the points are projected along these directions.
    """
    xi = np.array(start)
    moving = np.arange(len(points))
    for _ in range(1 if affine else FOOT_STEPS):
        x, J = at(moving, xi[moving])
        gap = points[moving] - x
        if along is not None:
            n = along[moving]
            gap = gap - n * np.einsum("nd,nd->n", n, gap)[:, None]
            J = J - n[:, :, None] * np.einsum("nd,ndt->nt", n, J)[:, None, :]
        normal = np.einsum("ndt,nds->nts", J, J)
        size = np.einsum("ntt->n", normal)[:, None, None] + np.finfo(float).tiny
        # A direction in which the surface does not extend stays where it is.
        normal = normal / size + 1e-14 * np.eye(xi.shape[1])
        right = np.einsum("ndt,nd->nt", J, gap)[..., None] / size
        step = np.linalg.solve(normal, right)[..., 0]
        xi[moving] += step
        here = xi[moving]
        far = (here.min(axis=1) < -FOOT_BEYOND) | (here.max(axis=1) > 1 + FOOT_BEYOND)
        moving = moving[(np.abs(step).max(axis=1) > FOOT_SETTLED) & ~far]
        if not len(moving):
            break
    return xi


def excess(xi: Array, simplex: bool) -> Array:
    """How far reference coordinates (n, t) lie outside their cells (n,); <= 0 inside."""
    above = xi.sum(axis=1) - 1 if simplex else xi.max(axis=1) - 1
    return np.maximum(-xi.min(axis=1), above)


def clamped(xi: Array, simplex: bool) -> Array:
    """Reference coordinates (n, t) brought into their cells."""
    xi = np.clip(xi, 0.0, 1.0)
    if simplex:
        xi = xi / np.maximum(xi.sum(axis=1, keepdims=True), 1.0)
    return xi


def near(centres: Array, reach: Array, points: Array) -> tuple[IntArray, IntArray]:
    """Pairs (item, point) with |centre − point| <= reach, items and points as numbers."""
    if not len(points) or not len(centres):
        return np.zeros(0, dtype=int), np.zeros(0, dtype=int)
    low, high = points.min(axis=0), points.max(axis=0)
    gap = np.maximum(0.0, np.maximum(low - centres, centres - high))
    close = np.flatnonzero(np.linalg.norm(gap, axis=1) <= reach)
    found = cKDTree(points).query_ball_point(centres[close], reach[close])
    count = np.array([len(f) for f in found], dtype=int)
    item = np.repeat(close, count)
    point = np.concatenate([np.zeros(0, dtype=int), *[np.asarray(f, dtype=int) for f in found]])
    return item, point
