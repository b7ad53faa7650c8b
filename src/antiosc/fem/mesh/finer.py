"""Finished meshes with smaller cells: every cell is halved, and groups follow.

Halving a cell adds the middles of its edges, of its quadrilateral faces and of the cell as
vertices. Four of the eight parts of a tetrahedron fill the octahedron inside it; they are ordered
as by J. Bey (Computing 55 (1995) 355), so that repeated halving makes at most three shapes of
cells. Second-order cells keep their curved sides.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from functools import cache
from itertools import product
from typing import NamedTuple, TypeAlias

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
from antiosc.io.isolation import SIZE_GRADING, Refinement, with_growth
from antiosc.io.neutral import CELL_KINDS, RawMesh
from antiosc.io.reading import row_hashes, row_positions

#: name -> {dimension: (entities, vertices of one)}
Groups: TypeAlias = dict[str, dict[int, NDArray[np.int64]]]
#: Halves of a simplex; each vertex lies between two corners.
SIMPLEX_HALVES = {
    "triangle": ("00 01 02", "01 11 12", "02 12 22", "01 12 02"),
    "tetrahedron": (
        *("00 01 02 03", "01 11 12 13", "02 12 22 23", "03 13 23 33"),
        *("01 02 03 13", "01 02 12 13", "02 03 13 23", "02 12 13 23"),
    ),
}
#: Corners of a hexahedron.
MOST_CORNERS = 8
#: Number of a node that is not in the file.
UNLABELLED = -1
#: Cells may exceed a size by this share.
SIZE_ROUNDING = 1e-9


class HalvingScheme(NamedTuple):
    """How a cell of one shape is halved, in dolfinx's order of nodes."""

    #: the cell's corners at each edge, quadrilateral face or cell that has a middle node
    members: list[list[int]]
    halves: IntArray  # (halves, corners) corners and middles that are the vertices of each half
    #: weights of the cell's nodes: for order 1 at the middles of the cell, (1, middles, nodes), for
    #: order 2 at those of its halves, (halves, middles, nodes)
    weights: tuple[Array, Array]


@cache
def halving_scheme(shape: str) -> HalvingScheme:
    """The halving of a shape, by its dolfinx name."""
    kind = getattr(basix.CellType, shape)
    corners = np.asarray(basix.geometry(kind))
    ordered = sorted(compat.nodes_between(shape), key=lambda pair: pair[1])
    members = [vertices for vertices, _ in ordered]
    lattice = np.vstack([corners, *(corners[vertices].mean(axis=0) for vertices in members)])

    if shape in SIMPLEX_HALVES:
        pairs = [[list(map(int, pair)) for pair in half.split()] for half in SIMPLEX_HALVES[shape]]
        vertices_of_halves = corners[np.array(pairs)].mean(axis=2)
    else:
        shifts = np.array(list(product((0.0, 0.5), repeat=corners.shape[1])))
        vertices_of_halves = shifts[:, None] + corners / 2

    distance = np.linalg.norm(vertices_of_halves[:, :, None] - lattice, axis=-1)
    halves = distance.argmin(axis=-1)
    of_cell = [[corners[vertices].mean(axis=0) for vertices in members]]
    of_halves = [[lattice[half[vertices]].mean(axis=0) for vertices in members] for half in halves]
    weights = weights_at(shape, 1, np.array(of_cell)), weights_at(shape, 2, np.array(of_halves))
    return HalvingScheme(members, halves, weights)


def weights_at(shape: str, degree: int, places: Array) -> Array:
    """Values (…, nodes) of a cell's Lagrange functions at reference points (…, dim)."""
    kind = getattr(basix.CellType, shape)
    element = basix.create_element(basix.ElementFamily.P, kind, degree)
    if not places.size:  # which basix does not take
        return np.zeros((*places.shape[:-1], element.dim))
    flat = places.reshape(-1, places.shape[-1])
    return np.asarray(element.tabulate(0, flat)[0, :, :, 0]).reshape(*places.shape[:-1], -1)


def halved_to_size(size: float, raw: RawMesh, name: str) -> RawMesh:
    """The mesh, halved until no cell is longer than `size` [m]; MeshError for too many cells."""
    longest = longest_cell(raw.points[raw.cells[:, : raw.kind.vertices]])
    if longest <= size:
        told = f"{name}: its cells measure {longest:.3g} m at most, so that size changes nothing."
        return replace(raw, remarks=[*raw.remarks, told])

    rounds = max(0, int(np.ceil(np.log2(longest / size) - SIZE_ROUNDING)))
    count = len(raw.cells) * 2.0 ** (rounds * raw.kind.dim)
    if count > MOST_CELLS:
        raise MeshError(
            f"{name} would have {count:.1e} cells, over {MOST_CELLS:.0e}: choose a larger size."
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
    shape = halving_scheme(kind.shape)
    order = compat.node_order(kind.shape, kind.nodes, "vtk")
    nodes = raw.cells[:, order]
    old_corners = nodes[:, : kind.vertices]

    if kind.order == 1:
        middles, first = _middle_nodes(old_corners, shape, len(raw.points))
        lattice = np.hstack([nodes, middles])
        cells = lattice[:, shape.halves].reshape(-1, kind.vertices)
    else:
        lattice = nodes
        corners = lattice[:, shape.halves].reshape(-1, kind.vertices)
        middles, first = _middle_nodes(corners, shape, len(raw.points))
        cells = np.hstack([corners, middles])

    places = np.einsum("hmk,cki->chmi", shape.weights[kind.order - 1], raw.points[nodes])
    x = places.reshape(-1, raw.points.shape[1])[first]
    without = np.full(len(x) if len(raw.labels) else 0, UNLABELLED)
    points = np.vstack([raw.points, x])

    # the old corners between which each node lies
    support = np.full((len(points), MOST_CORNERS), -1)
    support[:, 0] = np.arange(len(points))
    for k, vertices in enumerate(shape.members, start=kind.vertices):
        support[lattice[:, k], : len(vertices)] = old_corners[:, vertices]

    def entities(dim: int) -> IntArray:
        of_cell = np.array(basix.topology(getattr(basix.CellType, kind.shape))[dim])
        rows = cells[:, of_cell].reshape(-1, of_cell.shape[1])
        return rows[np.unique(row_hashes(rows), return_index=True)[1]]

    return replace(
        raw,
        points=points,
        cells=cells[:, np.argsort(order)].astype(np.int64),
        groups=_groups_of_division(raw.groups, support, entities),
        numbers=np.zeros(0, dtype=np.int64),
        labels=np.concatenate([raw.labels, without]),
    )


def _middle_nodes(corners: IntArray, shape: HalvingScheme, start: int) -> tuple[IntArray, IntArray]:
    """(numbers (cells, middles) of the middles as new nodes, from `start` on; flat index in them of
    the first use of each new node), for cells with `corners` (cells, corners)."""
    rows = np.full((len(corners), len(shape.members), MOST_CORNERS), -1, dtype=np.int64)
    for k, vertices in enumerate(shape.members):
        rows[:, k, : len(vertices)] = corners[:, vertices]
    _, first, index = np.unique(
        row_hashes(rows.reshape(-1, MOST_CORNERS)), return_index=True, return_inverse=True
    )
    return start + index.reshape(len(corners), -1), first


def _groups_of_division(
    groups: Groups, support: IntArray, entities_of: Callable[[int], IntArray]
) -> Groups:
    """Groups of the new entities that lie in entities of `groups`. `entities_of(dimension)`:
    vertices of the new entities; `support` (n, k): old points between which a point lies, or -1."""
    result: Groups = {name: {} for name in groups}
    for dim in sorted({dim for parts in groups.values() for dim in parts}):
        entities = entities_of(dim).astype(np.int64)
        carriers = _old_points_under(support, entities)
        for name, parts in groups.items():
            if dim in parts:
                result[name][dim] = entities[row_positions(carriers, parts[dim]) >= 0]

    return result


# -- bisection of straight triangles and tetrahedra, and the sizes of cells around points


#: A cell is divided if the ratio of its sizes is below this.
DIVIDED_RATIO = 0.75
#: Most rounds of division.
MOST_ROUNDS = 3
#: Kinds of cells that can be divided, by dolfinx's names.
KIND_OF_SHAPE = {"triangle": "triangle", "tetrahedron": "tetra"}
#: Rounds of divisions around points.
MOST_POINT_ROUNDS = 6


def refined_near(mesh: Mesh, refine: Sequence[Refinement]) -> Mesh:
    """The mesh with cells bisected to the sizes of `refine`; MeshError unless it is `divisible`."""
    if refine and not divisible(mesh):
        raise MeshError(
            f"{mesh.name}: refine divides straight triangles and tetrahedra, not {mesh.cell} cells"
            f" of order {mesh.order}; size makes all cells smaller."
        )

    for _ in range(MOST_POINT_ROUNDS):
        ratio = np.minimum(graded_sizes(mesh, refine) / edge_lengths(mesh), 1.0)
        if mesh.comm.allreduce(float(np.sum(ratio < DIVIDED_RATIO))) == 0:
            break
        mesh = refined(mesh, ratio)

    return mesh


def graded_sizes(mesh: Mesh, refine: Sequence[Refinement]) -> Array:
    """Wanted sizes (cells,) [m] of the cells that this rank owns; they grow around the points of
    `refine` as in gmsh, and are inf without any."""
    count = compat.cell_index_map(mesh.dolfinx).size_local
    centres = mesh.geometry.nodes[:count].mean(axis=1)

    sizes = np.full(len(centres), np.inf)
    for place in refine:
        point, local, growth = with_growth(place, SIZE_GRADING[0])
        distance = np.linalg.norm(centres - np.pad(point, (0, 3 - len(point))), axis=1)
        size_there = local + growth * np.maximum(distance - SIZE_GRADING[1] * local, 0.0)
        sizes = np.minimum(sizes, size_there)

    return sizes


def edge_lengths(mesh: Mesh) -> Array:
    """Mean length [m] of the edges of each cell that this rank owns, (cells,)."""
    count = compat.cell_index_map(mesh.dolfinx).size_local
    return _mean_edges(mesh.geometry.nodes[:count, : len(mesh.geometry.corners)])


def _mean_edges(corners: Array) -> Array:
    """Mean edge length (cells,) of simplices by their corners (cells, corners, dim)."""
    first, second = np.triu_indices(corners.shape[1], 1)  # all pairs of corners are edges
    return np.asarray(np.linalg.norm(corners[:, first] - corners[:, second], axis=2).mean(axis=1))


def divisible(mesh: Mesh) -> bool:
    """Whether the cells of the mesh can be bisected: straight triangles and tetrahedra."""
    return mesh.cell in KIND_OF_SHAPE and all(
        mesh.comm.allgather(bool(mesh.geometry.straight.all()))
    )


def refined(mesh: Mesh, ratio: Array) -> Mesh:
    """The mesh, bisected until its sizes are about `ratio` times the present ones, in at most
    `MOST_ROUNDS` rounds; `ratio`: (cells that this rank owns,)."""
    whole = gathered(mesh, ratio)
    raw = None
    if whole is not None:
        raw, values = _without_midside_nodes(whole[0]), whole[1]
        for _ in range(MOST_ROUNDS):
            if not np.any(values < DIVIDED_RATIO):
                break
            raw, values = bisected_once(raw, values)

    return distributed(mesh.comm.bcast(raw), mesh.name, mesh.comm)


def _without_midside_nodes(raw: RawMesh) -> RawMesh:
    """The mesh of simplices without mid-side nodes."""
    used, cells = np.unique(raw.cells[:, : raw.kind.vertices], return_inverse=True)
    groups: Groups = {
        name: {dim: np.searchsorted(used, rows) for dim, rows in parts.items()}
        for name, parts in raw.groups.items()
    }
    return RawMesh(
        points=raw.points[used],
        cells=cells.reshape(-1, raw.kind.vertices),
        kind=CELL_KINDS[KIND_OF_SHAPE[raw.kind.shape]],
        groups=groups,
        labels=raw.labels[used],
    )


def gathered(mesh: Mesh, values: Array) -> tuple[RawMesh, Array] | None:
    """The whole mesh and `values` of its cells on rank 0; None on other ranks. `values`: (cells
    that this rank owns,)."""
    geometry = mesh.dolfinx.geometry
    nodes_here = np.arange(len(geometry.x), dtype=np.int32)
    number = np.asarray(geometry.index_map().local_to_global(nodes_here))
    count = compat.cell_index_map(mesh.dolfinx).size_local
    cells = number[compat.geometry_nodes(mesh.dolfinx)[:count]]
    groups = {
        name: {
            dim: number[compat.vertex_nodes(mesh.dolfinx, dim)[entities]]
            for dim, entities in sorted(parts.items())
        }
        for name, parts in mesh.groups.items()
    }
    labels_here = np.full(len(number), UNLABELLED)
    if len(mesh.labels):
        labels_here = mesh.labels[np.asarray(geometry.input_global_indices)]
    x_here = geometry.x[:, : mesh.gdim]
    of_ranks = mesh.comm.gather((number, x_here, labels_here, cells, values, groups))
    if of_ranks is None:
        return None

    numbers, x, of_nodes, all_cells, all_values, all_groups = zip(*of_ranks, strict=True)
    count = int(geometry.index_map().size_global)
    points, labels = np.zeros((count, mesh.gdim)), np.zeros(count, dtype=np.int64)
    points[np.concatenate(numbers)] = np.vstack(x)
    labels[np.concatenate(numbers)] = np.concatenate(of_nodes)
    whole: Groups = {name: {} for name in mesh.groups}
    for name, parts in whole.items():
        for dim in set().union(*(of_rank[name] for of_rank in all_groups)):
            rows = [of_rank[name][dim] for of_rank in all_groups if dim in of_rank[name]]
            parts[dim] = np.unique(np.sort(np.vstack(rows), axis=1), axis=0).astype(np.int64)

    kind = next(k for k in CELL_KINDS.values() if (k.shape, k.order) == (mesh.cell, mesh.order))
    order = np.argsort(compat.node_order(kind.shape, kind.nodes, "vtk"))
    cells = np.vstack(all_cells)[:, order].astype(np.int64)
    return RawMesh(points, cells, kind, whole, labels=labels), np.concatenate(all_values)


def bisected_once(raw: RawMesh, values: Array) -> tuple[RawMesh, Array]:
    """(mesh, values) after halving all edges of cells whose value is below `DIVIDED_RATIO`.
    `values` (cells,): ratios of wanted to present size, updated for the new cells."""
    arguments = np.ascontiguousarray(raw.cells), raw.points, raw.kind.shape, 1
    old_mesh = compat.create_mesh(MPI.COMM_SELF, *arguments)
    input_cells = np.asarray(old_mesh.topology.original_cell_index)
    is_refined = values[input_cells] < DIVIDED_RATIO
    new = compat.refined(old_mesh, np.unique(compat.cell_entities(old_mesh, 1)[is_refined]))
    gdim = raw.points.shape[1]
    x = new.geometry.x[:, :gdim].copy()
    support = _supporting_nodes(raw, x)
    cells = compat.geometry_nodes(new).astype(np.int64)
    parent = row_positions(_old_points_under(support, cells), raw.cells)
    old_corners = raw.points[raw.cells]
    if raw.kind.shape == "triangle" and gdim == 3:  # the normals tell the side of layers
        turned = np.einsum("ci,ci->c", _normals(x[cells]), _normals(old_corners[parent])) < 0
        cells[turned] = cells[turned][:, [0, 2, 1]]
    sizes = _mean_edges(old_corners)[parent] / _mean_edges(x[cells])
    groups = _groups_of_division(raw.groups, support, lambda dim: compat.vertex_nodes(new, dim))
    labels = np.where(support[:, 0] == support[:, 1], raw.labels[support[:, 0]], UNLABELLED)
    new_mesh = replace(raw, points=x, cells=cells, groups=groups, labels=labels)
    return new_mesh, values[parent] * sizes


def _normals(corners: Array) -> Array:
    """Normals (cells, 3) of triangles in space."""
    return np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])


def _supporting_nodes(raw: RawMesh, x: Array) -> IntArray:
    """The two old points (n, 2) between which each point of `x` lies; equal for an old point."""
    first, second = np.triu_indices(raw.kind.vertices, 1)
    edges = np.stack([raw.cells[:, first].ravel(), raw.cells[:, second].ravel()], axis=1)
    edges = np.unique(np.sort(edges, axis=1), axis=0)
    old_points = np.repeat(np.arange(len(raw.points))[:, None], 2, axis=1)
    pairs = np.vstack([old_points, edges])
    _, nearest = cKDTree(raw.points[pairs].mean(axis=1)).query(x)
    return np.asarray(pairs[nearest])


def _old_points_under(support: IntArray, entities: IntArray) -> IntArray:
    """Vertices (n, k) of the old entity that contains each new entity (n, k); -1 if only an entity
    of higher dimension does. `support` (points, s): old points between which each point lies."""
    k = entities.shape[1]
    rows = np.sort(support[entities].reshape(len(entities), -1), axis=1)
    first = rows >= 0
    first[:, 1:] &= np.diff(rows, axis=1) > 0
    fit = first.sum(axis=1) == k
    carriers = np.full((len(entities), k), -1, dtype=np.int64)
    carriers[fit] = rows[fit][first[fit]].reshape(-1, k)
    return carriers
