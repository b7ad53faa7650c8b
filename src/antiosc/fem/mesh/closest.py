"""Points of cells and faces that are closest to given points."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from scipy.spatial import cKDTree

from antiosc.base._types import Array, IntArray
from antiosc.fem.mesh import CellEntities, Mesh
from antiosc.fem.platform import compat

#: Most Gauss–Newton steps onto a curved cell.
FOOT_STEPS = 12
#: Step (reference lengths) that ends them; the remaining error is the square of this step.
FOOT_SETTLED = 1e-8
#: The iteration ends for a foot that leaves its cell by more than this (reference lengths).
FOOT_BEYOND = 1.0


def projected(
    at: Callable[[IntArray, Array], tuple[Array, Array]],
    points: Array,
    start: Array,
    *,
    affine: bool,
    along: Array | None = None,
) -> Array:
    """Reference coordinates (n, t) at which x(ξ) is nearest to each point, inside its cell or
    outside.

    Gauss–Newton iteration from `start` (n, t); it stops for points (n, 3) whose projection lies far
    outside the cell. `at`: numbers k of points, ξ (k, t) -> (x (k, 3), dx/dξ (k, 3, t)); `affine`:
    whether x(ξ) is, so that one step is exact; `along`: unit vectors (n, 3) of the projection.
    """
    xi = np.array(start)
    step = np.zeros_like(xi)
    least = np.full(len(points), np.inf)
    moving = np.arange(len(points))
    for _ in range(1 if affine else FOOT_STEPS):
        trial = xi[moving] + step[moving]
        x, J = at(moving, trial)
        gap = points[moving] - x
        if along is not None:
            n = along[moving]
            gap = gap - n * np.einsum("nd,nd->n", n, gap)[:, None]
            J = J - n[:, :, None] * np.einsum("nd,ndt->nt", n, J)[:, None, :]
        distance = np.linalg.norm(gap, axis=1)
        # A step that leads away is halved: far from a curved cell, whole ones can grow for ever.
        closer = (distance <= least[moving])[:, None]
        least[moving] = np.minimum(least[moving], distance)
        xi[moving] = np.where(closer, trial, xi[moving])
        step[moving] = np.where(closer, _gauss_newton(J, gap), step[moving] / 2)
        ahead = xi[moving] + step[moving]
        far = (ahead.min(axis=1) < -FOOT_BEYOND) | (ahead.max(axis=1) > 1 + FOOT_BEYOND)
        moving = moving[(np.abs(step[moving]).max(axis=1) > FOOT_SETTLED) & ~far]
        if not len(moving):
            break
    return xi + step


def _gauss_newton(J: Array, gap: Array) -> Array:
    """Steps (n, t) that lessen the gaps (n, 3) of points with derivatives J (n, 3, t) most."""
    normal = np.einsum("ndt,nds->nts", J, J)
    size = np.einsum("ntt->n", normal)[:, None, None] + np.finfo(float).tiny
    # A direction in which the surface does not extend stays where it is.
    normal = normal / size + 1e-14 * np.eye(J.shape[2])
    right = np.einsum("ndt,nd->nt", J, gap)[..., None] / size
    return np.asarray(np.linalg.solve(normal, right)[..., 0])


def excess(xi: Array, simplex: bool) -> Array:
    """Distance (n,) by which reference coordinates (n, t) lie outside their cells; <= 0 inside."""
    upper_excess = xi.sum(axis=1) - 1 if simplex else xi.max(axis=1) - 1
    return np.maximum(-xi.min(axis=1), upper_excess)


def clamped(xi: Array, simplex: bool) -> Array:
    """Reference coordinates (n, t) moved to the nearest point of their cells."""
    xi = np.clip(xi, 0.0, 1.0)
    if simplex:
        xi = xi / np.maximum(xi.sum(axis=1, keepdims=True), 1.0)
    return xi


def pairs_within(centres: Array, reach: Array, points: Array) -> tuple[IntArray, IntArray]:
    """Pairs (item, point) of numbers with |centre of item − point| <= reach of item: two arrays."""
    if not len(points) or not len(centres):
        return np.zeros(0, dtype=int), np.zeros(0, dtype=int)
    low, high = points.min(axis=0), points.max(axis=0)
    gap = np.maximum(0.0, np.maximum(low - centres, centres - high))
    close = np.flatnonzero(np.linalg.norm(gap, axis=1) <= reach)
    near = cKDTree(points).query_ball_point(centres[close], reach[close])
    item = np.repeat(close, np.array([len(found) for found in near], dtype=int))
    return item, np.array([point for found in near for point in found], dtype=int)


#: Reference coordinates may lie this far outside a cell that still holds the point (rounding).
OUTSIDE_CELL = 1e-9


@dataclass(frozen=True)
class ClosestPoint:
    """The point of the structure closest to a given one."""

    #: rank that owns the cell, and the cell's number there
    rank: int
    cell: int
    X: Array  # reference coordinates (tdim,) in the cell
    x: Array  # the closest point itself (3,), m
    distance: float  # its distance to the given point, m


@dataclass(frozen=True, eq=False)
class ClosestPoints:
    """The points of the structure closest to P given ones; fields of `ClosestPoint` as arrays."""

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
    """The point of the mesh closest to `point` (3,), the same on every rank."""
    return closest_many(mesh, np.asarray(point)[None])[0]


def closest_many(mesh: Mesh, points: Array) -> ClosestPoints:
    """The points of the mesh closest to `points` (P, 3), the same on every rank.

    Points inside cells are found together, the others one by one.
    """
    cell, X, distance = _cells_containing(mesh, points)
    in_cell = np.array(mesh.comm.allgather(np.isfinite(distance)))
    x = points.copy()
    for i in np.flatnonzero(~in_cell.any(axis=0)):
        nearest = _closest_here(mesh, points[i])
        if nearest is not None:
            cell[i], X[i] = nearest.cell, nearest.X
            x[i], distance[i] = nearest.x, nearest.distance
    rank = np.array(mesh.comm.allgather(distance)).argmin(axis=0)
    on_rank = rank == mesh.comm.rank
    mine_or_zero = [
        np.where(on_rank if a.ndim == 1 else on_rank[:, None], a, 0) for a in (cell, X, x, distance)
    ]
    cell, X, x, distance = (mesh.comm.allreduce(a) for a in mine_or_zero)
    return ClosestPoints(rank, cell, X, x, distance)


def size_at(mesh: Mesh, nearest: ClosestPoint) -> float:
    """Largest distance [m] between corners of the cell of the closest point."""
    x = corners_at(mesh, nearest)
    return float(np.linalg.norm(x[:, None] - x[None], axis=2).max())


def corners_at(mesh: Mesh, nearest: ClosestPoint) -> Array:
    """Corners (n, 3) of the cell that holds the closest point, on all ranks."""
    corners = None
    if mesh.comm.rank == nearest.rank:
        corners = mesh.geometry.nodes[nearest.cell][: len(mesh.geometry.corners)]
    return np.asarray(mesh.comm.bcast(corners, root=nearest.rank))


def _cells_containing(mesh: Mesh, points: Array) -> tuple[IntArray, Array, Array]:
    """(cell, reference coordinates, distance) of points in cells of this rank; distance inf
    elsewhere.

    If several cells share a point, the first is taken.
    """
    cell = np.zeros(len(points), dtype=int)
    distance = np.full(len(points), np.inf)
    X = np.zeros((len(points), mesh.tdim))
    low, high = mesh.boxes
    if not len(low):
        return cell, X, distance
    reach = 0.5 * np.linalg.norm(high - low, axis=1)
    item, point = pairs_within((low + high) / 2, reach * (1 + OUTSIDE_CELL), points)
    geometry = mesh.geometry
    margin = OUTSIDE_CELL * reach[item, None]
    boxed = (points[point] >= low[item] - margin) & (points[point] <= high[item] + margin)
    item, point = item[boxed.all(axis=1)], point[boxed.all(axis=1)]
    start = np.tile(geometry.centre(), (len(item), 1))
    xi = projected(
        lambda k, X: geometry.at(item[k], X), points[point], start, affine=geometry.affine
    )
    gap = np.linalg.norm(geometry.at(item, xi)[0] - points[point], axis=1)
    holds = np.flatnonzero(
        (excess(xi, geometry.simplex) <= OUTSIDE_CELL) & (gap <= OUTSIDE_CELL * reach[item])
    )
    last = holds[np.lexsort((-item[holds], point[holds]))]  # the first cell is written last
    cell[point[last]], X[point[last]], distance[point[last]] = item[last], xi[last], gap[last]
    return cell, X, distance


def _closest_here(mesh: Mesh, point: Array) -> ClosestPoint | None:
    """The closest point on this rank, of a point in none of its cells; None if it has no cells.

    The closest point is the foot of a perpendicular on a cell, a face or an edge, or an end of an
    edge. A foot outside its entity is moved onto it: that point is on the structure too, but some
    other entity has a closer one.
    """
    n_cells = compat.cell_map(mesh.dolfinx).size_local
    if not n_cells:
        return None
    geometry = mesh.geometry
    low, high = mesh.boxes
    from_box = np.linalg.norm(np.maximum(0.0, np.maximum(low - point, point - high)), axis=1)
    from_nodes = np.linalg.norm(geometry.nodes[:n_cells] - point, axis=2).min()
    near_cells = np.flatnonzero(from_box <= from_nodes)
    cells = []
    feet = []
    for dim in range(1, mesh.tdim + 1):
        origin, axes = geometry.entities(dim)
        cell = np.repeat(near_cells, len(origin))
        of_cells = np.tile(np.arange(len(origin)), len(near_cells))
        entities = CellEntities(geometry, cell, origin[of_cells], axes[of_cells])
        cells.append(cell)
        feet.append(_feet(entities, point))
    cell = np.concatenate(cells)
    X = np.concatenate(feet)
    x = geometry.at(cell, X)[0]
    distance = np.linalg.norm(x - point, axis=1)
    i = int(distance.argmin())
    return ClosestPoint(mesh.comm.rank, int(cell[i]), X[i], x[i], float(distance[i]))


def _feet(entities: CellEntities, point: Array) -> Array:
    """Reference coordinates (n, tdim) in the cells of the feet of perpendiculars from `point` on
    entities, moved onto the entities.
    """
    points = np.broadcast_to(point, (len(entities), 3))
    xi = projected(entities.at, points, entities.middle, affine=entities.affine)
    return entities.reference(np.arange(len(entities)), clamped(xi, entities.simplex))
