"""Finished meshes with smaller cells: every cell is halved, and groups follow.

The vertices of the halves of a cell are its corners and the middles of its edges, of its faces of
four corners and of itself. Four of the eight halves of a tetrahedron fill the octahedron inside it;
their order is that of J. Bey (Computing 55 (1995) 355), with which repeated halving makes cells of
three shapes at most. Second-order cells keep their curved sides.
"""

from __future__ import annotations

from dataclasses import replace
from functools import cache
from itertools import product
from typing import Any, NamedTuple

import basix
import numpy as np
from numpy.typing import NDArray

from antiosc.base._types import Array, IntArray
from antiosc.base.errors import MeshError
from antiosc.fem.platform import compat
from antiosc.io.by_gmsh import MOST_CELLS
from antiosc.io.neutral import RawMesh
from antiosc.io.reading import keys, positions

#: Halves of a simplex; each vertex lies between two corners.
SIMPLICES = {
    "triangle": ("00 01 02", "01 11 12", "02 12 22", "01 12 02"),
    "tetrahedron": (
        *("00 01 02 03", "01 11 12 13", "02 12 22 23", "03 13 23 33"),
        *("01 02 03 13", "01 02 12 13", "02 03 13 23", "02 12 13 23"),
    ),
}
#: Shapes of edges and faces by their number of vertices.
SIDES = {2: "interval", 3: "triangle", 4: "quadrilateral"}
#: Cells may exceed a size by this share.
ROUNDING = 1e-9


class Scheme(NamedTuple):
    """The halving of a shape, in dolfinx's order of nodes.

    Attributes
    ----------
    members : corners between which each middle lies: of edges, of faces of four corners, of all.
    halves : (halves, corners) corners and middles that are the vertices of each half.
    weights : for geometric order 1 and 2: (cells, middles, nodes) weights of the nodes of a cell at
        the middles of the cell itself, or at those of its halves.
    """

    members: list[list[int]]
    halves: IntArray
    weights: tuple[Array, Array]


@cache
def scheme(shape: str) -> Scheme:
    """The halving of a shape, by its dolfinx name."""
    kind = getattr(basix.CellType, shape)
    corners = np.asarray(basix.geometry(kind))
    ordered = sorted(compat.nodes_between(shape), key=lambda pair: pair[1])
    members = [vertices for vertices, _ in ordered]
    lattice = np.vstack([corners, *(corners[vertices].mean(axis=0) for vertices in members)])
    if shape in SIMPLICES:
        pairs = [[list(map(int, pair)) for pair in half.split()] for half in SIMPLICES[shape]]
        vertices_of_halves = corners[np.array(pairs)].mean(axis=2)
    else:
        shifts = np.array(list(product((0.0, 0.5), repeat=corners.shape[1])))
        vertices_of_halves = shifts[:, None] + corners / 2
    distance = np.linalg.norm(vertices_of_halves[:, :, None] - lattice, axis=-1)
    halves = distance.argmin(axis=-1)
    of_cell = [[corners[vertices].mean(axis=0) for vertices in members]]
    of_halves = [[lattice[half[vertices]].mean(axis=0) for vertices in members] for half in halves]
    weights = weights_at(shape, 1, np.array(of_cell)), weights_at(shape, 2, np.array(of_halves))
    return Scheme(members, halves, weights)


def weights_at(shape: str, degree: int, places: Array) -> Array:
    """Weights (…, nodes) of the nodes of a cell at reference places (…, dim)."""
    kind = getattr(basix.CellType, shape)
    element = basix.create_element(basix.ElementFamily.P, kind, degree)
    if not places.size:  # which basix does not take
        return np.zeros((*places.shape[:-1], element.dim))
    flat = places.reshape(-1, places.shape[-1])
    return np.asarray(element.tabulate(0, flat)[0, :, :, 0]).reshape(*places.shape[:-1], -1)


def with_cells_of(size: float, raw: RawMesh, name: str) -> RawMesh:
    """The mesh, halved until no cell is longer than `size` [m].

    Raises
    ------
    MeshError
        There would be too many cells.
    """
    longest = longest_cell(raw.points[raw.cells[:, : raw.kind.vertices]])
    if longest <= size:
        told = f"{name}: its cells measure {longest:.3g} m at most, so that size changes nothing."
        return replace(raw, remarks=[*raw.remarks, told])

    rounds = max(0, int(np.ceil(np.log2(longest / size) - ROUNDING)))
    count = len(raw.cells) * 2.0 ** (rounds * raw.kind.dim)
    if count > MOST_CELLS:
        raise MeshError(
            f"{name} has cells of up to {longest:.3g} m: halved to {size:g} m they would be "
            f"{count:.1e}, more than {MOST_CELLS:.0e}; choose a larger size."
        )
    for _ in range(rounds):
        raw = halved(raw)
    return raw


def longest_cell(corners: Array) -> float:
    """Largest distance [m] between two corners of one of the cells (cells, corners, dim)."""
    a, b = np.triu_indices(corners.shape[1], 1)
    return float(np.linalg.norm(corners[:, a] - corners[:, b], axis=2).max())


def halved(raw: RawMesh) -> RawMesh:
    """A mesh with all cells halved once; its new nodes have no labels."""
    kind = raw.kind
    shape = scheme(kind.shape)
    order = compat.node_order(kind.shape, kind.nodes, raw.convention)
    nodes = raw.cells[:, order]
    old_corners = nodes[:, : kind.vertices]
    if kind.order == 1:
        middles, first = _middles(old_corners, shape, len(raw.points))
        lattice = np.hstack([nodes, middles])
        cells = _of_halves(lattice, shape)
    else:
        lattice = nodes
        corners = _of_halves(lattice, shape)
        middles, first = _middles(corners, shape, len(raw.points))
        cells = np.hstack([corners, middles])

    places = np.einsum("hmk,cki->chmi", shape.weights[kind.order - 1], raw.points[nodes])
    x = places.reshape(-1, raw.points.shape[1])[first]
    labels = raw.labels
    if len(labels):
        labels = np.concatenate([labels, np.full(len(x), -1)])
    return replace(
        raw,
        points=np.vstack([raw.points, x]),
        cells=cells[:, np.argsort(order)].astype(np.int64),
        groups=_groups(raw, old_corners, lattice),
        numbers=np.zeros(0, dtype=np.int64),
        labels=labels,
    )


def _of_halves(lattice: IntArray, shape: Scheme) -> IntArray:
    """Vertices of the halves of cells with corners and middles `lattice`, in the order of cells."""
    return lattice[:, shape.halves].reshape(-1, shape.halves.shape[1])


def _middles(corners: IntArray, shape: Scheme, start: int) -> tuple[IntArray, IntArray]:
    """New nodes in the middles of cells with these corners, numbered from `start` on.

    Returns the middles (cells, middles) of each cell, and of each new node its first place in this
    table.
    """
    rows = np.full((len(corners), len(shape.members), 8), -1, dtype=np.int64)
    for k, vertices in enumerate(shape.members):
        rows[:, k, : len(vertices)] = corners[:, vertices]
    _, first, index = np.unique(keys(rows.reshape(-1, 8)), return_index=True, return_inverse=True)
    return start + index.reshape(len(corners), -1), first


def _groups(
    raw: RawMesh, corners: IntArray, lattice: IntArray
) -> dict[str, dict[int, NDArray[np.int64]]]:
    """The groups of the halved mesh; `corners`, `lattice`: old nodes and middles of its cells."""
    groups: dict[str, dict[int, NDArray[np.int64]]] = {name: {} for name in raw.groups}
    for dim in sorted({dim for parts in raw.groups.values() for dim in parts}):
        names = [name for name, parts in raw.groups.items() if dim in parts]
        blocks = [raw.groups[name][dim] for name in names]
        entities = np.vstack(blocks)
        if dim == 0:
            halves: NDArray[Any] = entities[:, None]
        elif dim == raw.kind.dim:
            at = positions(entities, corners)
            halves = lattice[:, scheme(raw.kind.shape).halves][at]
            halves[at < 0] = -1
        else:
            halves = _halves_of_sides(raw, entities, corners, lattice)
        ends = np.cumsum([len(block) for block in blocks])[:-1]
        for name, part in zip(names, np.split(halves, ends), strict=True):
            rows = part.reshape(-1, part.shape[-1])
            groups[name][dim] = rows[(rows >= 0).all(axis=1)].astype(np.int64)
    return groups


def _halves_of_sides(
    raw: RawMesh, sides: IntArray, corners: IntArray, lattice: IntArray
) -> IntArray:
    """Vertices (n, halves, k) of the halves of edges or faces (n, k); -1 of those of no cell."""
    count = sides.shape[1]
    order = compat.node_order(SIDES[count], count, raw.convention)
    sides = sides[:, order]
    shape = scheme(SIDES[count])
    columns = [sides]
    for vertices in shape.members:
        middles = [
            (corners[:, of_cell], lattice[:, corners.shape[1] + k])
            for k, of_cell in enumerate(scheme(raw.kind.shape).members)
            if len(of_cell) == len(vertices)
        ]
        rows, nodes = (np.concatenate(parts) for parts in zip(*middles, strict=True))
        at = positions(sides[:, vertices], rows)
        columns.append(np.where(at >= 0, nodes[at], -1)[:, None])
    return np.hstack(columns)[:, shape.halves][:, :, np.argsort(order)]
