"""Meshes of lines, divided: their groups are kept, and a site inside a cell becomes a node."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from antiosc._types import Array, IntArray
from antiosc.errors import InputError
from antiosc.fem import compat
from antiosc.fem.error.bisection import Pieces, gathered
from antiosc.fem.mesh.mesh import Mesh, distributed
from antiosc.fem.readers import KINDS, RawMesh
from antiosc.fem.readers.selection import keys

#: Share of an element within which a site is taken to be at its node.
AT_NODE = 1e-3
#: Angles in degrees between the two cells at a node of a polygon that stands for a curve: above
#: rounding, and up to those of a circle of 16 cells.
LEAST_ANGLE, MOST_ANGLE = 0.2, 23.0


def halved(mesh: Mesh, point: Array | None = None) -> Mesh:
    """The mesh of lines with two cells in place of each: of c the input cells 2c and 2c + 1.

    They meet in the middle, those nearest to `point` there, unless it lies close to a node.
    """
    return _divided(mesh, 0.5, point)


def with_node(mesh: Mesh, point: Array) -> Mesh:
    """The mesh of lines with a node at the place nearest to `point`."""
    return _divided(mesh, np.nan, point)


def inside(mesh: Mesh, point: Array) -> bool:
    """Whether a point lies inside an element, not at one of its nodes."""
    ends = mesh.geometry.nodes[:, :2, : mesh.gdim]
    lengths = np.linalg.norm(ends[:, 1] - ends[:, 0], axis=1)
    away = np.linalg.norm(ends - point[: mesh.gdim], axis=2) / lengths[:, None]
    return bool(away.min() > AT_NODE)


def polygon(mesh: Mesh) -> str:
    """A sentence if lines of the mesh look like the sides of a polygon in place of a curve."""
    pieces = gathered(mesh, np.zeros(compat.cell_map(mesh.dolfinx).size_local))
    angle = 0.0 if pieces is None else _largest_angle(pieces)
    angle = mesh.comm.bcast(angle)
    if not angle:
        return ""
    return (
        f"Not included: the lines of {mesh.name} that meet at angles of up to {angle:.2g}°, if "
        "they stand for a curve."
    )


def _largest_angle(pieces: Pieces) -> float:
    """Of those between the two cells at a node that are taken for a curve, degrees; 0: none."""
    cells = pieces.cells
    ends, cell = cells.ravel(), np.repeat(np.arange(len(cells)), 2)
    two = np.flatnonzero(np.bincount(ends, minlength=len(pieces.points)) == 2)
    order = np.argsort(ends, kind="stable")
    at = np.searchsorted(ends[order], two)
    outward = []
    for number in (order[at], order[np.minimum(at + 1, len(order) - 1)]):
        far = cells[cell[number], 1 - number % 2]
        along = pieces.points[far] - pieces.points[two]
        outward.append(along / np.linalg.norm(along, axis=1, keepdims=True))
    cosine = np.clip(-np.einsum("nd,nd->n", *outward), -1.0, 1.0)
    angle = np.degrees(np.arccos(cosine))
    return float(max(angle[(angle > LEAST_ANGLE) & (angle < MOST_ANGLE)], default=0.0))


def _divided(mesh: Mesh, usual: float, point: Array | None) -> Mesh:
    """The mesh with each cell cut at the share `usual` of its length (NaN: not), one at `point`."""
    pieces = gathered(mesh, np.zeros(compat.cell_map(mesh.dolfinx).size_local))
    raw: RawMesh | InputError | None = None
    if pieces is not None:
        cuts = np.full(len(pieces.cells), usual)
        if point is not None:
            _cut_at(cuts, pieces, point)
        raw = _pieced(pieces, cuts)
    raw = mesh.comm.bcast(raw)
    if isinstance(raw, InputError):
        raise raw
    assert raw is not None
    return distributed(raw, mesh.name, mesh.comm)


def _cut_at(cuts: Array, pieces: Pieces, point: Array) -> None:
    """Cut the cell nearest to the point there, unless it lies close to a node."""
    ends = pieces.points[pieces.cells]
    along = ends[:, 1] - ends[:, 0]
    start = ends[:, 0] - point[: ends.shape[2]]
    nearest = np.clip(-np.einsum("cd,cd->c", start, along) / (along**2).sum(axis=1), 0.0, 1.0)
    distance = np.linalg.norm(start + nearest[:, None] * along, axis=1)
    closest = int(np.argmin(distance))
    if AT_NODE < nearest[closest] < 1 - AT_NODE:
        cuts[closest] = nearest[closest]


def _pieced(pieces: Pieces, cuts: Array) -> RawMesh | InputError:
    """The mesh with its cells cut at these shares of their lengths, NaN where they are not."""
    cells = pieces.cells.astype(np.int64)
    known = keys(cells)
    if len(np.unique(known)) < len(known):
        return InputError("the error estimate of beams takes no two beams between the same nodes.")
    cut = np.isfinite(cuts)
    middle = np.full(len(cells), -1)
    middle[cut] = len(pieces.points) + np.arange(cut.sum())
    order = np.argsort(known)
    groups: dict[str, dict[int, NDArray[np.int64]]] = {}
    for name, parts in pieces.groups.items():
        groups[name] = {dim: rows.astype(np.int64) for dim, rows in parts.items()}
        if 1 in parts:
            found = order[np.searchsorted(known[order], keys(groups[name][1]))]
            groups[name][1] = _children(cells, middle, found)
    start, end = (pieces.points[cells[cut, side]] for side in (0, 1))
    points = np.vstack([pieces.points, start + cuts[cut, None] * (end - start)])
    every = _children(cells, middle, np.arange(len(cells)))
    return RawMesh(points, every, KINDS["line"], "gmsh", groups)


def _children(cells: IntArray, middle: IntArray, which: IntArray) -> NDArray[np.int64]:
    """The cells in place of cells `which`, in their order; `middle`: -1 where they are whole."""
    ends, between = cells[which], middle[which]
    pairs = np.stack([ends[:, 0], between, between, ends[:, 1]], axis=1).reshape(-1, 2, 2)
    pairs[between < 0, 0] = ends[between < 0]
    kept = np.ones((len(which), 2), dtype=bool)
    kept[between < 0, 1] = False
    return pairs[kept].astype(np.int64)
