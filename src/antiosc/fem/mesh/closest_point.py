"""Closest points of a mesh: cell, reference coordinates and distance."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from antiosc.base._types import Array, IntArray
from antiosc.fem.mesh.mesh import Mesh, clamped, excess, near, projected
from antiosc.fem.platform import compat

#: Reference coordinates may lie this far outside a cell that still holds the point (rounding).
OUTSIDE_CELL = 1e-9


@dataclass(frozen=True)
class ClosestPoint:
    """The point of the structure closest to a given one."""

    #: rank that owns the cell, and the cell's number there
    rank: int
    cell: int
    #: reference coordinates (tdim,) in the cell
    X: Array
    #: the closest point itself (3,), m
    x: Array
    #: its distance to the given point, m
    distance: float


@dataclass(frozen=True, eq=False)
class ClosestPoints:
    """The same for P points, as arrays: (P,), (P,), (P, tdim), (P, 3), (P,)."""

    rank: IntArray
    cell: IntArray
    X: Array
    x: Array
    distance: Array

    def __len__(self) -> int:
        return len(self.rank)

    def __getitem__(self, i: int) -> ClosestPoint:
        return ClosestPoint(
            int(self.rank[i]), int(self.cell[i]), self.X[i], self.x[i], float(self.distance[i])
        )


def closest(mesh: Mesh, point: Array) -> ClosestPoint:
    """The closest point of the mesh, the same answer on every rank; `point` has shape (3,)."""
    return closest_many(mesh, np.asarray(point)[None])[0]


def closest_many(mesh: Mesh, points: Array) -> ClosestPoints:
    """The closest points of the mesh to points of shape (P, 3), the same answer on every rank.

    Points inside cells are found together; the others one by one, cell by cell.
    """
    cell, X, distance = _inside(mesh, points)
    found = np.array(mesh.comm.allgather(np.isfinite(distance)))
    x = points.copy()
    for i in np.flatnonzero(~found.any(axis=0)):
        nearest = _closest_here(mesh, points[i])
        if nearest is not None:
            cell[i], X[i], x[i], distance[i] = nearest.cell, nearest.X, nearest.x, nearest.distance
    rank = np.array(mesh.comm.allgather(distance)).argmin(axis=0)
    mine = rank == mesh.comm.rank
    own = [np.where(mine if a.ndim == 1 else mine[:, None], a, 0) for a in (cell, X, x, distance)]
    cell, X, x, distance = (mesh.comm.allreduce(a) for a in own)
    return ClosestPoints(rank, cell, X, x, distance)


def size_at(mesh: Mesh, nearest: ClosestPoint) -> float:
    """Largest distance in m between two nodes of the cell with the closest point, on all ranks."""
    size = 0.0
    if mesh.comm.rank == nearest.rank:
        x = mesh.geometry.nodes[nearest.cell]
        size = float(np.linalg.norm(x[:, None] - x[None], axis=2).max())
    return float(mesh.comm.bcast(size, root=nearest.rank))


def _inside(mesh: Mesh, points: Array) -> tuple[IntArray, Array, Array]:
    """(cell, reference coordinates, distance) of points inside cells of this rank; inf elsewhere.

    Of several cells that share the point the first is taken.
    """
    cell, distance = np.zeros(len(points), dtype=int), np.full(len(points), np.inf)
    X = np.zeros((len(points), mesh.tdim))
    low, high = mesh.boxes
    if not len(low):
        return cell, X, distance
    reach = 0.5 * np.linalg.norm(high - low, axis=1)
    item, point = near((low + high) / 2, reach * (1 + OUTSIDE_CELL), points)
    geometry = mesh.geometry
    margin = OUTSIDE_CELL * reach[item, None]
    boxed = (points[point] >= low[item] - margin) & (points[point] <= high[item] + margin)
    item, point = item[boxed.all(axis=1)], point[boxed.all(axis=1)]
    start = np.tile(geometry.centre(), (len(item), 1))
    xi = projected(
        lambda k, X: geometry.at(item[k], X), points[point], start, affine=geometry.affine
    )
    off = np.linalg.norm(geometry.at(item, xi)[0] - points[point], axis=1)
    holds = (excess(xi, geometry.simplex) <= OUTSIDE_CELL) & (off <= OUTSIDE_CELL * reach[item])
    item, point, xi, off = item[holds], point[holds], xi[holds], off[holds]
    order = np.lexsort((-item, point))  # the first cell is written last
    cell[point[order]], X[point[order]] = item[order], xi[order]
    distance[point[order]] = off[order]
    return cell, X, distance


def _closest_here(mesh: Mesh, point: Array) -> ClosestPoint | None:
    """Cells in the order of the distance to their boxes, until no box can hold a closer point."""
    n_cells = compat.cell_map(mesh.dolfinx).size_local
    if not n_cells:
        return None
    low, high = mesh.boxes
    bound = np.linalg.norm(np.maximum(0.0, np.maximum(low - point, point - high)), axis=1)
    best: ClosestPoint | None = None
    for cell in np.argsort(bound, kind="stable"):
        if best is not None and bound[cell] >= best.distance:
            break
        nearest = _closest_in(mesh, int(cell), point)
        if best is None or nearest.distance < best.distance:
            best = nearest
    return best


def _closest_in(mesh: Mesh, cell: int, point: Array) -> ClosestPoint:
    """The closest point of one cell: the foot of the perpendicular, or a point of its boundary."""
    geometry = mesh.geometry
    scale = float(np.ptp(geometry.nodes[cell], axis=0).max())
    one = np.array([cell])

    def at(X: Array) -> tuple[Array, Array]:
        return geometry.at(one, X.reshape(1, -1))

    middle = geometry.centre()
    X = projected(lambda _, X: at(X), point[None], middle[None], affine=geometry.affine)
    if mesh.tdim == mesh.gdim or not excess(X, geometry.simplex)[0] <= OUTSIDE_CELL:
        X = clamped(X, geometry.simplex)

        from scipy.optimize import minimize  # loaded where it is used: it takes long

        def objective(X: Array) -> tuple[float, Array]:
            x, J = at(X)
            gap = (x[0] - point) / scale
            return float(gap @ gap), 2 * (gap @ J[0]) / scale

        inside: list[Any] = []
        if geometry.simplex and mesh.tdim > 1:
            inside = [
                {"type": "ineq", "fun": lambda X: 1 - X.sum(), "jac": lambda X: -np.ones_like(X)}
            ]
        starts = [X[0]] if geometry.affine else [X[0], middle]
        results = [
            minimize(
                objective,
                start,
                jac=True,
                method="SLSQP",
                bounds=[(0, 1)] * mesh.tdim,
                constraints=inside,
                options={"ftol": 1e-15, "maxiter": 200},
            )
            for start in starts
        ]
        X = clamped(min(results, key=lambda r: r.fun).x[None], geometry.simplex)
    x = at(X)[0][0]
    return ClosestPoint(mesh.comm.rank, cell, X[0], x, float(np.linalg.norm(x - point)))
