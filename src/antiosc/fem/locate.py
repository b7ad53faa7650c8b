"""Where a point lies in a mesh: the closest cell, its reference coordinates and the distance."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
import scipy.optimize
from numpy.typing import NDArray

from antiosc.fem import compat
from antiosc.fem.mesh import Mesh

Array = NDArray[np.float64]

#: Reference coordinates may lie this far outside a cell that still holds the point (rounding).
INSIDE = 1e-9


@dataclass(frozen=True)
class Place:
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


def closest(mesh: Mesh, point: Array) -> Place:
    """The closest point of the mesh, the same answer on every rank; `point` has shape (3,)."""
    mine = _closest_here(mesh, point)
    ranked = mesh.comm.allgather(mine)
    found = min((place for place in ranked if place is not None), key=lambda p: p.distance)
    return found


def cell_nodes(mesh: Mesh, cell: int) -> Array:
    """Coordinates (nodes, 3) of a cell of this rank."""
    nodes = compat.geometry_nodes(mesh.dolfinx)[cell]
    return np.asarray(mesh.dolfinx.geometry.x[nodes])


def size_at(mesh: Mesh, place: Place) -> float:
    """Largest distance in m between two nodes of the cell at a place, on all ranks."""
    size = 0.0
    if mesh.comm.rank == place.rank:
        x = cell_nodes(mesh, place.cell)
        size = float(np.linalg.norm(x[:, None] - x[None], axis=2).max())
    return float(mesh.comm.bcast(size, root=place.rank))


def sheet_normal(mesh: Mesh, place: Place) -> Array:
    """Unit normal (3,) of a mesh of faces at a place, on all ranks; its sign is the cell's."""
    normal = np.zeros(3)
    if mesh.comm.rank == place.rank:
        nodes = np.ascontiguousarray(cell_nodes(mesh, place.cell)[:, : mesh.gdim])
        step = 1e-3 * (1 if mesh.order > 1 else 100)  # inside or outside, the map is a polynomial
        X = place.X + step * np.array([[1, 0], [-1, 0], [0, 1], [0, -1]])
        x = np.zeros((4, 3))
        x[:, : mesh.gdim] = compat.coordinate_map(mesh.dolfinx).push_forward(X, nodes)
        normal = np.cross(x[0] - x[1], x[2] - x[3])
        normal /= np.linalg.norm(normal)
    return np.asarray(mesh.comm.bcast(normal, root=place.rank))


def _closest_here(mesh: Mesh, point: Array) -> Place | None:
    """Cells in the order of the distance to their boxes, until no box can hold a closer point."""
    n_cells = compat.cell_map(mesh.dolfinx).size_local
    if not n_cells:
        return None
    low, high = mesh.boxes
    bound = np.linalg.norm(np.maximum(0.0, np.maximum(low - point, point - high)), axis=1)
    best: Place | None = None
    for cell in np.argsort(bound, kind="stable"):
        if best is not None and bound[cell] >= best.distance:
            break
        place = _closest_in(mesh, int(cell), cell_nodes(mesh, int(cell)), point)
        if best is None or place.distance < best.distance:
            best = place
    return best


def _closest_in(mesh: Mesh, cell: int, nodes: Array, point: Array) -> Place:
    cmap = compat.coordinate_map(mesh.dolfinx)
    simplex = mesh.cell in ("interval", "triangle", "tetrahedron")
    here = np.ascontiguousarray(nodes[:, : mesh.gdim])
    scale = float(np.ptp(nodes, axis=0).max())

    def position(X: Array) -> Array:
        return np.asarray(cmap.push_forward(X.reshape(1, -1), here))[0]

    X = _pulled_back(cmap, here, point[: mesh.gdim])
    if X is not None and _excess(X, simplex) <= INSIDE:
        at = np.zeros(3)
        at[: mesh.gdim] = point[: mesh.gdim] if mesh.tdim == mesh.gdim else position(X)
        off = float(np.linalg.norm(at - point))
        if mesh.tdim == mesh.gdim or off <= INSIDE * scale:
            return _place(mesh, cell, X, at, off)

    def objective(X: Array) -> float:
        return float(np.sum(((position(X) - point[: mesh.gdim]) / scale) ** 2))

    constraint: list[Any] = []
    if simplex and mesh.tdim > 1:
        constraint = [
            {"type": "ineq", "fun": lambda X: 1 - X.sum(), "jac": lambda X: -np.ones_like(X)}
        ]
    start = np.full(mesh.tdim, 1 / (mesh.tdim + 1) if simplex else 0.5)
    result = scipy.optimize.minimize(
        objective,
        start,
        method="SLSQP",
        bounds=[(0, 1)] * mesh.tdim,
        constraints=constraint,
        options={"ftol": 1e-15, "maxiter": 200},
    )
    X = np.clip(result.x, 0, 1)
    at = np.zeros(3)
    at[: mesh.gdim] = position(X)
    return _place(mesh, cell, X, at, float(np.linalg.norm(at - point)))


def _pulled_back(cmap: Any, nodes: Array, point: Array) -> Array | None:
    try:
        return np.asarray(cmap.pull_back(np.ascontiguousarray(point).reshape(1, -1), nodes))[0]
    except RuntimeError:  # Newton's method left a curved cell: the point is not inside
        return None


def _excess(X: Array, simplex: bool) -> float:
    """How far reference coordinates lie outside the cell."""
    outside = [-X.min(), X.sum() - 1] if simplex else [-X.min(), X.max() - 1]
    return float(max(outside))


def _place(mesh: Mesh, cell: int, X: Array, x: Array, distance: float) -> Place:
    return Place(mesh.comm.rank, cell, X, x, distance)
