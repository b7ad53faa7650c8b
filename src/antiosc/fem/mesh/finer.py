"""Finished meshes with smaller cells: every cell is halved, and groups follow.

The vertices of the halves of a cell are its corners and the middles of its edges, of its faces of
four corners and of itself. Four of the eight halves of a tetrahedron fill the octahedron inside it;
their order is that of J. Bey (Computing 55 (1995) 355), with which repeated halving makes cells of
three shapes at most. Second-order cells keep their curved sides.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cache
from itertools import product
from typing import Any, NamedTuple

import basix
import numpy as np
from mpi4py import MPI
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from antiosc.base._types import Array, IntArray
from antiosc.base.errors import MeshError
from antiosc.fem.mesh import Mesh, distributed
from antiosc.fem.platform import compat
from antiosc.io.by_gmsh import MOST_CELLS
from antiosc.io.isolation import GRADING, Refinement
from antiosc.io.neutral import KINDS, RawMesh
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
    """The halving of a shape, in dolfinx's order of nodes."""

    #: corners between which each middle lies: of edges, of faces of four corners, of all
    members: list[list[int]]
    halves: IntArray  # (halves, corners) corners and middles that are the vertices of each half
    #: for geometric order 1 and 2: (cells, middles, nodes) weights of the nodes of a cell at the
    #: middles of the cell itself, or at those of its halves
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
    """The mesh, halved until no cell is longer than `size` [m]; MeshError for too many cells."""
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
    order = compat.node_order(kind.shape, kind.nodes, "vtk")
    nodes = raw.cells[:, order]
    old_corners = nodes[:, : kind.vertices]

    if kind.order == 1:
        middles, first = _middles(old_corners, shape, len(raw.points))
        lattice = np.hstack([nodes, middles])
        cells = lattice[:, shape.halves].reshape(-1, kind.vertices)
    else:
        lattice = nodes
        corners = lattice[:, shape.halves].reshape(-1, kind.vertices)
        middles, first = _middles(corners, shape, len(raw.points))
        cells = np.hstack([corners, middles])

    places = np.einsum("hmk,cki->chmi", shape.weights[kind.order - 1], raw.points[nodes])
    x = places.reshape(-1, raw.points.shape[1])[first]
    without = np.full(len(x) if len(raw.labels) else 0, -1)

    return replace(
        raw,
        points=np.vstack([raw.points, x]),
        cells=cells[:, np.argsort(order)].astype(np.int64),
        groups=_groups(raw, old_corners, lattice),
        numbers=np.zeros(0, dtype=np.int64),
        labels=np.concatenate([raw.labels, without]),
    )


def _middles(corners: IntArray, shape: Scheme, start: int) -> tuple[IntArray, IntArray]:
    """(new nodes (cells, middles) of cells, numbered from `start` on, the first place of each)."""
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
    order = compat.node_order(SIDES[count], count, "vtk")
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


# -- bisection of straight triangles and tetrahedra, and the sizes of cells around points


#: A cell is divided if the ratio of its sizes is below this.
DIVIDED = 0.75
#: Most rounds of division.
ROUNDS = 3
#: Distance of a node from the middle of its edge up to which the edge is straight, over its length.
STRAIGHT = 1e-9
#: Kinds of cells that can be divided, by dolfinx's names.
KIND_OF = {"triangle": "triangle", "tetrahedron": "tetra"}
#: Rounds of divisions around points.
MOST_DIVISIONS = 6


def near(mesh: Mesh, refine: Sequence[Refinement]) -> Mesh:
    """The mesh of straight simplices, divided to the sizes of `refine`; MeshError for others."""
    if refine and not divisible(mesh):
        raise MeshError(
            f"{mesh.name}: refine divides straight triangles and tetrahedra, not {mesh.cell} cells"
            f" of order {mesh.order}; size makes all cells smaller."
        )

    for _ in range(MOST_DIVISIONS):
        ratio = np.minimum(graded_sizes(mesh, refine) / edge_lengths(mesh), 1.0)
        if mesh.comm.allreduce(float(np.sum(ratio < DIVIDED))) == 0:
            break
        mesh = refined(mesh, ratio)

    return mesh


def graded_sizes(mesh: Mesh, refine: Sequence[Refinement]) -> Array:
    """Sizes [m] of the cells of this rank near the points of `refine`, as gmsh is given them."""
    nodes = compat.geometry_nodes(mesh.dolfinx)[: compat.cell_map(mesh.dolfinx).size_local]
    centres = mesh.dolfinx.geometry.x[nodes].mean(axis=1)

    sizes = np.full(len(centres), np.inf)
    for point, local in refine:
        distance = np.linalg.norm(centres - np.pad(point, (0, 3 - len(point))), axis=1)
        size_there = local + GRADING[0] * np.maximum(distance - GRADING[1] * local, 0.0)
        sizes = np.minimum(sizes, size_there)

    return sizes


def edge_lengths(mesh: Mesh) -> Array:
    """Mean length [m] of the edges of each cell that this rank owns, (cells,)."""
    nodes = compat.geometry_nodes(mesh.dolfinx)[: compat.cell_map(mesh.dolfinx).size_local]
    return _mean_edges(mesh.dolfinx.geometry.x[nodes[:, : len(mesh.geometry.corners)]])


def _mean_edges(corners: Array) -> Array:
    """Mean edge length (cells,) of simplices by their corners (cells, corners, dim)."""
    first, second = np.triu_indices(corners.shape[1], 1)  # all pairs of corners are edges
    return np.asarray(np.linalg.norm(corners[:, first] - corners[:, second], axis=2).mean(axis=1))


@dataclass(frozen=True)
class Pieces:
    """A whole mesh on one rank with a value for each cell."""

    points: Array  # (n, gdim) m
    cells: IntArray  # (c, dim + 1) numbers of points
    #: name -> {dimension: (entities, vertices of one) numbers of points}
    groups: dict[str, dict[int, IntArray]]
    values: Array  # (c,) one for each cell


def divisible(mesh: Mesh) -> bool:
    """Whether the cells of the mesh can be bisected: straight triangles and tetrahedra."""
    if mesh.cell not in KIND_OF:
        return False

    # of second-order cells the further nodes are the middles of edges
    x = mesh.dolfinx.geometry.x[compat.geometry_nodes(mesh.dolfinx)]
    off = 0.0
    for vertices, node in compat.nodes_between(mesh.cell) if mesh.order == 2 else ():
        distance = np.linalg.norm(x[:, node] - x[:, vertices].mean(axis=1), axis=1)
        length = np.linalg.norm(np.ptp(x[:, vertices], axis=1), axis=1)
        off = max(off, float((distance / length).max(initial=0.0)))

    return bool(mesh.comm.allreduce(off, op=MPI.MAX) <= STRAIGHT)


def refined(mesh: Mesh, ratio: Array) -> Mesh:
    """The mesh, bisected until its sizes are about `ratio` (cells,) times the present ones."""
    pieces = gathered(mesh, ratio)
    if pieces is not None:
        for _ in range(ROUNDS):
            if not np.any(pieces.values < DIVIDED):
                break
            pieces = divided(pieces, mesh.cell)

    pieces = mesh.comm.bcast(pieces)
    kind = KINDS[KIND_OF[mesh.cell]]
    raw = RawMesh(pieces.points, pieces.cells, kind, pieces.groups)
    return distributed(raw, mesh.name, mesh.comm)


def gathered(mesh: Mesh, values: Array) -> Pieces | None:
    """The mesh and `values` of its cells on rank 0; None on other ranks."""
    geometry = mesh.dolfinx.geometry
    nodes_here = np.arange(len(geometry.x), dtype=np.int32)
    number = np.asarray(geometry.index_map().local_to_global(nodes_here))
    count = compat.cell_map(mesh.dolfinx).size_local
    nodes = compat.geometry_nodes(mesh.dolfinx)[:count, : len(mesh.geometry.corners)]
    cells = number[nodes]
    groups = {
        name: {
            dim: number[compat.entity_vertices(mesh.dolfinx, dim)[entities]]
            for dim, entities in sorted(parts.items())
        }
        for name, parts in mesh.groups.items()
    }
    of_ranks = mesh.comm.gather((number, geometry.x[:, : mesh.gdim], cells, values, groups))
    if of_ranks is None:
        return None

    numbers, x, all_cells, all_values, all_groups = zip(*of_ranks, strict=True)
    points = np.zeros((int(geometry.index_map().size_global), mesh.gdim))
    points[np.concatenate(numbers)] = np.vstack(x)
    whole: dict[str, dict[int, IntArray]] = {name: {} for name in mesh.groups}
    for name, parts in whole.items():
        for dim in set().union(*(of_rank[name] for of_rank in all_groups)):
            rows = [of_rank[name][dim] for of_rank in all_groups if dim in of_rank[name]]
            parts[dim] = np.unique(np.sort(np.vstack(rows), axis=1), axis=0)
    # corners alone
    used, cells = np.unique(np.vstack(all_cells), return_inverse=True)
    for parts in whole.values():
        parts.update({dim: np.searchsorted(used, rows) for dim, rows in parts.items()})
    return Pieces(
        points[used], cells.reshape(-1, nodes.shape[1]), whole, np.concatenate(all_values)
    )


def divided(pieces: Pieces, cell: str) -> Pieces:
    """The mesh with all edges halved of the cells that have small values, once.

    The new values are those of the parents times the old size over the new one.
    """
    arguments = np.ascontiguousarray(pieces.cells), pieces.points, cell, 1
    old_mesh = compat.create_mesh(MPI.COMM_SELF, *arguments)
    input_cells = np.asarray(old_mesh.topology.original_cell_index)
    is_refined = pieces.values[input_cells] < DIVIDED
    new = compat.refined(old_mesh, np.unique(compat.cell_entities(old_mesh, 1)[is_refined]))
    gdim = pieces.points.shape[1]
    x = new.geometry.x[:, :gdim].copy()
    support = _supports(pieces, x)
    cells = compat.geometry_nodes(new).astype(np.int64)
    parent = positions(_old_points_under(support, cells), pieces.cells)
    old_corners = pieces.points[pieces.cells]
    if cell == "triangle" and gdim == 3:  # the normals tell the side of layers
        turned = np.einsum("ci,ci->c", _normals(x[cells]), _normals(old_corners[parent])) < 0
        cells[turned] = cells[turned][:, [0, 2, 1]]
    values = pieces.values[parent] * _mean_edges(old_corners)[parent] / _mean_edges(x[cells])

    groups: dict[str, dict[int, IntArray]] = {name: {} for name in pieces.groups}
    for dim in set().union(*pieces.groups.values()):
        entities = compat.entity_vertices(new, dim).astype(np.int64)
        carriers = _old_points_under(support, entities)
        for name, parts in pieces.groups.items():
            if dim in parts:
                groups[name][dim] = entities[positions(carriers, parts[dim]) >= 0]

    return Pieces(x, cells, groups, values)


def _normals(corners: Array) -> Array:
    """Normals (cells, 3) of triangles in space."""
    return np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])


def _supports(pieces: Pieces, x: Array) -> IntArray:
    """The two old points (n, 2) between which each new point lies; of an old one itself, twice."""
    first, second = np.triu_indices(pieces.cells.shape[1], 1)
    edges = np.stack([pieces.cells[:, first].ravel(), pieces.cells[:, second].ravel()], axis=1)
    edges = np.unique(np.sort(edges, axis=1), axis=0)
    old_points = np.repeat(np.arange(len(pieces.points))[:, None], 2, axis=1)
    pairs = np.vstack([old_points, edges])
    _, nearest = cKDTree(pieces.points[pairs].mean(axis=1)).query(x)
    return np.asarray(pairs[nearest])


def _old_points_under(support: IntArray, entities: IntArray) -> IntArray:
    """Old points (n, k) under each new entity (n, k); -1 of those of a larger dimension."""
    k = entities.shape[1]
    rows = np.sort(support[entities].reshape(len(entities), -1), axis=1)
    first = np.ones(rows.shape, dtype=bool)
    first[:, 1:] = np.diff(rows, axis=1) > 0
    fit = first.sum(axis=1) == k
    carriers = np.full((len(entities), k), -1, dtype=np.int64)
    carriers[fit] = rows[fit][first[fit]].reshape(-1, k)
    return carriers
