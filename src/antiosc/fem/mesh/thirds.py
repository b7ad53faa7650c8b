"""Finished meshes of sheets and lines with smaller cells around points, without hanging nodes.

In each round the vertices of the cells that are too large are marked. An edge gets a new node at a
third of its length from each of its marked ends, so that all cells at the edge, also those of other
meshes, have the same new nodes. A quadrilateral with a marked corner gets four new nodes inside,
one near each corner, and a triangle one: with all corners marked they become nine equal cells, with
fewer corners the cells at the others are larger (after R. Schneiders, Engineering with Computers 12
(1996) 168, whose quadrilaterals have no node near the other corners).
"""

from __future__ import annotations

from collections.abc import Sequence
from functools import cache
from itertools import pairwise
from typing import Any, NamedTuple

import basix
import numpy as np
from numpy.typing import NDArray

from antiosc.base._types import Array, BoolArray
from antiosc.base.checks import point_text
from antiosc.base.errors import MeshError
from antiosc.fem.mesh.halving import (
    ROUNDING,
    Divided,
    common_numbers,
    lengths,
    numbered,
    scheme,
    weights_at,
    with_nodes,
)
from antiosc.fem.platform import compat
from antiosc.io.by_gmsh import MOST_CELLS
from antiosc.io.neutral import IntArray, RawMesh
from antiosc.io.reading import keys, positions
from antiosc.io.request import Refinement

#: Corners of a cell in dolfinx's order, one beside the other.
RINGS = {
    "interval": [0, 1],
    "triangle": [0, 1, 2],
    "quadrilateral": [0, 1, 3, 2],
    "tetrahedron": [*range(4)],  # solids, which stay
    "hexahedron": [*range(8)],
}
#: Growth of the sizes per unit of distance from a point, and how many of the smallest size are
#: between the point and where it begins. A mass and a spring on a plate with cells of 100 mm, and
#: around the site of 0.3 and 0.5 bending waves, had forces within 1.2 % of those on an infinite
#: plate (without: 147 %), as with a growth of 0.35, which has twice the dofs, and of 2.
GRADING = (1.0, 2.0)
#: Size of the cells of a round over that of the round before.
SHARE = 1 / 3


def with_cells_near(
    refine: Sequence[Refinement], raws: Sequence[RawMesh], name: str
) -> list[RawMesh]:
    """Meshes with common numbers of nodes, with cells of the sizes of `refine` around its points.

    The sizes grow away from the points as those of `read_mesh` of a geometry.

    Raises
    ------
    MeshError
        Solids around a point; too many cells.
    """
    raws = list(raws)
    told = [_stays(raws, point, size, name) for point, size in refine]
    for _ in range(_rounds(refine, raws)):
        finer = _thirds(raws, _marked(refine, raws, name))
        if sum(len(raw.cells) for raw in finer) > MOST_CELLS:
            raise MeshError(
                f"{name} would have more than {MOST_CELLS:.0e} cells: choose larger sizes in"
                " refine."
            )
        raws = finer
    told += [_large(raws, point, size, name) for point, size in refine]
    raws[0].remarks = [*raws[0].remarks, *filter(None, told)]
    return raws


def _stays(raws: Sequence[RawMesh], point: Sequence[float], size: float, name: str) -> str:
    """Sentence that no cell is larger than a size around a point; "" if one is."""
    if any(_too_large([(point, size)], raw).any() for raw in raws):
        return ""
    return (
        f"{name}: its cells around {point_text(point)} are no longer than {size:g} m, so that"
        " refine changes nothing there."
    )


def _large(raws: Sequence[RawMesh], point: Sequence[float], size: float, name: str) -> str:
    """Sentence that the cells at a point stay larger than a size; "" if they do not."""
    longest = max(
        float(lengths(_corners(raw))[_distances(raw, point) <= 0].max(initial=0.0)) for raw in raws
    )
    if longest <= size * (1 + ROUNDING):
        return ""
    return (
        f"{name}: cells of {longest:.3g} m stay at {point_text(point)}, larger than the {size:g} m"
        " of refine: solids beside them keep them; choose a point farther from these."
    )


def _rounds(refine: Sequence[Refinement], raws: Sequence[RawMesh]) -> int:
    """How often cells are divided until none is longer than the smallest size of `refine`."""
    if not refine:
        return 0
    smallest = min(size for _, size in refine)
    longest = max(float(lengths(_corners(raw)).max()) for raw in raws)
    return max(0, int(np.ceil(np.log(longest / smallest) / np.log(1 / SHARE) - ROUNDING)))


def _marked(refine: Sequence[Refinement], raws: Sequence[RawMesh], name: str) -> IntArray:
    """Numbers of the vertices at which cells are divided."""
    vertices = []
    for raw in raws:
        which = _too_large(refine, raw)
        if raw.kind.dim > 2 and which.any():
            raise MeshError(
                f"{name} has solid elements at a point of refine, which makes elements of shells"
                " and beams smaller: leave refine out; size makes all elements smaller."
            )
        vertices.append(raw.numbers[raw.cells[which, : raw.kind.vertices]].ravel())
    solids = [raw.numbers[raw.cells[:, : raw.kind.vertices]] for raw in raws if raw.kind.dim > 2]
    stay = np.concatenate([np.zeros(0, dtype=np.int64), *(rows.ravel() for rows in solids)])
    return np.setdiff1d(np.concatenate(vertices), stay)


def _corners(raw: RawMesh) -> Array:
    """Coordinates (cells, corners, dim) of the corners of cells [m]."""
    return raw.points[raw.cells[:, : raw.kind.vertices]]


def _too_large(refine: Sequence[Refinement], raw: RawMesh) -> BoolArray:
    """Mask of the cells that are longer than the sizes around the points."""
    growth, reach = GRADING
    allowed = np.full(len(raw.cells), np.inf)
    for point, size in refine:
        distance = np.maximum(_distances(raw, point) - reach * size, 0.0)
        allowed = np.minimum(allowed, size + growth * distance)
    return np.asarray(lengths(_corners(raw)) > allowed * (1 + ROUNDING))


def _distances(raw: RawMesh, point: Sequence[float]) -> Array:
    """Distances (cells,) [m] of a point from the balls around the cells; negative inside."""
    corners = _corners(raw)
    centres = corners.mean(axis=1)
    radii = np.linalg.norm(corners - centres[:, None], axis=2).max(axis=1)
    x = np.asarray(point, dtype=float)[: centres.shape[1]]
    return np.asarray(np.linalg.norm(centres - x, axis=1) - radii)


class Lattice(NamedTuple):
    """The corners of a cell and all new nodes that it may get, by the ring of its corners.

    Attributes
    ----------
    X : (points, dim) reference coordinates.
    between : (points, 8) corners between which each point lies, by their place in the ring, -1:
        fewer; twice that which is nearer. No two points have the same.
    after, before : of each corner, the points on the edges to the next and to the last corner.
    inside : of each corner, the point inside near it.
    """

    X: Array
    between: IntArray
    after: list[int]
    before: list[int]
    inside: list[int]


@cache
def _lattice(shape: str) -> Lattice:
    """The lattice of a shape."""
    corners = np.asarray(basix.geometry(getattr(basix.CellType, shape)))[RINGS[shape]]
    n = len(corners)
    ring = [*range(n)]
    edges = [[k, k, (k + 1) % n] for k in ring], [[k, k, k - 1] for k in ring]
    between = [*([k] for k in ring), *edges[0], *edges[1]]
    X = [corners[[k % n for k in row]].mean(axis=0) for row in between]
    inside = [3 * n] * n
    if shape == "quadrilateral":
        inside = [3 * n + k for k in ring]
        between += [[*ring, k] for k in ring]
        X += [(2 * corners.mean(axis=0) + corners[k]) / 3 for k in ring]
    elif shape == "triangle":
        between.append(ring)
        X.append(corners.mean(axis=0))
    rows = [[k % n for k in row] + [-1] * (8 - len(row)) for row in between]
    return Lattice(
        np.array(X), np.array(rows), [n + k for k in ring], [2 * n + k for k in ring], inside
    )


@cache
def _parts(shape: str, marked: tuple[bool, ...]) -> IntArray:
    """Points of the lattice (parts, corners) that are the corners of the parts of a cell, whose
    marked corners are given, in rings.
    """
    lattice = _lattice(shape)
    ring = [*range(len(marked))]
    if not any(marked):
        return np.array([ring])
    after, before = (
        [points[k] if marked[k] else k for k in ring] for points in (lattice.after, lattice.before)
    )
    if shape == "interval":
        line = dict.fromkeys([0, after[0], before[1], 1])
        return np.array([*pairwise(line)])
    inside = lattice.inside
    pairs = [*zip(ring, [*ring[1:], 0], strict=True)]
    at_corners = [k for k in ring if marked[k]]
    if shape == "triangle":
        parts = [[after[k], before[j], inside[k]] for k, j in pairs]
        parts += [[k, after[k], before[k]] for k in at_corners]
        parts += [[after[k], inside[k], before[k]] for k in at_corners]
    else:
        parts = [inside, *([after[k], before[j], inside[j], inside[k]] for k, j in pairs)]
        parts += [[k, after[k], inside[k], before[k]] for k in at_corners]
    return np.array(parts)


class _New(NamedTuple):
    """New nodes: a cell of each (m,), its reference coordinates there (m, dim), and the numbers
    (m, 8) of the nodes between which it lies, as in `Divided`.
    """

    cell: IntArray
    X: Array
    between: IntArray


class _Cut(NamedTuple):
    """The parts of the cells of a mesh.

    Attributes
    ----------
    parents : (parts,) the cell of each part; ascending.
    points : (parts, corners) points of its cell's lattice, in rings.
    rows : (parts, corners) rows of nodes, in dolfinx's order.
    new : the new vertices.
    """

    parents: IntArray
    points: IntArray
    rows: IntArray
    new: _New


def _cut(raw: RawMesh, nodes: IntArray, marked: IntArray) -> _Cut:
    """The parts of the cells, whose nodes are given in dolfinx's order."""
    shape = raw.kind.shape
    corners = nodes[:, RINGS[shape]]
    lattice = _lattice(shape)
    patterns, of_cell = np.unique(
        np.isin(raw.numbers[corners], marked), axis=0, return_inverse=True
    )
    parents, points = [], []
    for k, pattern in enumerate(patterns):
        cells = np.flatnonzero(of_cell.ravel() == k)
        parts = _parts(shape, tuple(pattern.tolist()))
        parents.append(np.repeat(cells, len(parts)))
        points.append(np.tile(parts, (len(cells), 1)))
    parent = np.concatenate(parents)
    order = np.argsort(parent, kind="stable")
    parent, point = parent[order], np.vstack(points)[order]
    n = corners.shape[1]
    cells = np.repeat(parent, n)
    is_new = point.ravel() >= n
    cell, local = cells[is_new], point.ravel()[is_new]
    between = lattice.between[local]
    numbers = np.where(between >= 0, raw.numbers[corners[cell[:, None], between]], -1)
    _, first, index = np.unique(keys(numbers), return_index=True, return_inverse=True)
    rows = np.empty(len(cells), dtype=np.int64)
    rows[~is_new] = corners[cells[~is_new], point.ravel()[~is_new]]
    rows[is_new] = len(raw.points) + index.ravel()
    rows = rows.reshape(-1, n)[:, RINGS[shape]]
    return _Cut(parent, point, rows, _New(cell[first], lattice.X[local[first]], numbers[first]))


def _thirds(raws: Sequence[RawMesh], marked: IntArray) -> list[RawMesh]:
    """The meshes with the cells at the marked vertices divided."""
    orders = [compat.node_order(raw.kind.shape, raw.kind.nodes, raw.convention) for raw in raws]
    nodes = [raw.cells[:, order] for raw, order in zip(raws, orders, strict=True)]
    cuts = [_cut(raw, cells, marked) for raw, cells in zip(raws, nodes, strict=True)]
    first = 1 + max(int(raw.numbers.max()) for raw in raws)
    vertices = common_numbers([cut.new.between for cut in cuts], first)
    first += sum(map(len, vertices))
    of_raws = zip(raws, nodes, cuts, vertices, strict=True)
    filled = [_filled(raw, cells, cut, new) for raw, cells, cut, new in of_raws]
    middles = common_numbers([new.between for _, new in filled], first)
    divided = [
        _divided(raw, cells, cut, rows[:, np.argsort(order)], new)
        for raw, cells, cut, (rows, new), order in zip(
            raws, nodes, cuts, filled, orders, strict=True
        )
    ]
    numbers = [np.concatenate(pair) for pair in zip(vertices, middles, strict=True)]
    return numbered(divided, numbers)


def _filled(
    raw: RawMesh, nodes: IntArray, cut: _Cut, vertices: NDArray[Any]
) -> tuple[IntArray, _New]:
    """The nodes (parts, nodes of a cell) of the parts in dolfinx's order, and the new ones in the
    middles of edges and cells; `vertices`: numbers of the new vertices.
    """
    kind = raw.kind
    members = scheme(kind.shape).members if kind.order > 1 else []
    numbers = np.concatenate([raw.numbers, vertices])
    old, rows = (
        _between(numbers[corners], members) for corners in (nodes[:, : kind.vertices], cut.rows)
    )
    at = positions(rows, old)
    result = np.where(at >= 0, nodes[:, kind.vertices :].ravel()[at], -1) if len(at) else at
    lacking = np.flatnonzero(at < 0)
    _, first, index = np.unique(keys(rows[lacking]), return_index=True, return_inverse=True)
    result[lacking] = len(numbers) + index.ravel()
    part, member = np.divmod(lacking[first], max(len(members), 1))
    X = _lattice(kind.shape).X[cut.points][:, RINGS[kind.shape]]
    places = [X[p, members[m]].mean(axis=0) for p, m in zip(part, member, strict=True)]
    new = _New(cut.parents[part], np.reshape(places, (len(part), X.shape[2])), rows[lacking[first]])
    return np.hstack([cut.rows, result.reshape(len(cut.rows), -1)]), new


def _between(numbers: IntArray, members: Sequence[Sequence[int]]) -> IntArray:
    """Numbers (cells × members, 8) of the corners of the edges and faces of cells, -1: fewer."""
    rows = np.full((len(numbers), len(members), 8), -1, dtype=np.int64)
    for k, corners in enumerate(members):
        rows[:, k, : len(corners)] = numbers[:, corners]
    return rows.reshape(-1, 8)


def _divided(raw: RawMesh, nodes: IntArray, cut: _Cut, cells: IntArray, middles: _New) -> Divided:
    """The mesh of the parts of its cells."""
    new = _New(*(np.concatenate(pair) for pair in zip(cut.new, middles, strict=True)))
    weights = weights_at(raw.kind.shape, raw.kind.order, new.X)
    of_new = nodes[new.cell]
    x = np.einsum("nk,nki->ni", weights, raw.points[of_new])
    groups = _groups(raw, nodes[:, : raw.kind.vertices], cut)
    mesh = with_nodes(raw, x, cells=cells, groups=groups)
    return Divided(mesh, new.between)


def _groups(raw: RawMesh, corners: IntArray, cut: _Cut) -> dict[str, dict[int, IntArray]]:
    """The groups of the mesh of the parts; `corners` (cells, corners): those of the cells."""
    groups: dict[str, dict[int, IntArray]] = {name: {} for name in raw.groups}
    for name, parts in raw.groups.items():
        for dim, rows in parts.items():
            groups[name][dim] = rows
            if dim == raw.kind.dim:
                at = positions(rows, corners)
                groups[name][dim] = cut.rows[_spans(cut.parents, at[at >= 0])]
            elif dim == 1:
                groups[name][dim] = _edges(raw, rows, cut)
    return groups


def _spans(parents: IntArray, cells: IntArray) -> IntArray:
    """Rows of the parts of cells, in the order of these."""
    first, end = (np.searchsorted(parents, cells, side) for side in ("left", "right"))
    count = end - first
    rows = np.repeat(first - np.cumsum(count) + count, count) + np.arange(count.sum())
    return np.asarray(rows, dtype=np.int64)


def _edges(raw: RawMesh, edges: IntArray, cut: _Cut) -> IntArray:
    """The parts (m, 2) of edges (n, 2)."""
    numbers = raw.numbers[edges]
    points = [edges[:, 0]]
    for k, ends in enumerate((numbers, numbers[:, ::-1])):
        rows = np.full((len(edges), 8), -1)
        rows[:, :3] = ends[:, [0, 0, 1]]
        at = positions(rows, cut.new.between)
        points.append(np.where(at >= 0, len(raw.points) + at, edges[:, k]))
    pieces = np.stack([*points, edges[:, 1]], axis=1)[:, [[0, 1], [1, 2], [2, 3]]].reshape(-1, 2)
    is_part = pieces[:, 0] != pieces[:, 1]
    return pieces[is_part]
