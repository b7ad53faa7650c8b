"""Bisection of straight triangles and tetrahedra, and the sizes of cells around points."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import dolfinx
import numpy as np
from mpi4py import MPI
from scipy.spatial import cKDTree

from antiosc.base._types import Array, IntArray
from antiosc.base.errors import MeshError
from antiosc.fem.mesh import Mesh, distributed
from antiosc.fem.platform import compat
from antiosc.io.isolation import GRADING, Refinement
from antiosc.io.neutral import KINDS, RawMesh
from antiosc.io.reading import positions

#: A cell is divided if the ratio of its sizes is below this.
DIVIDED = 0.75
#: Most rounds of division.
ROUNDS = 3
#: Kinds of cells that can be divided, by dolfinx's names.
KIND_OF = {"triangle": "triangle", "tetrahedron": "tetra"}
#: Rounds of divisions around points.
MOST_DIVISIONS = 6


def near(mesh: Mesh, refine: Sequence[Refinement]) -> Mesh:
    """The mesh, divided until its cells have the sizes of `refine` around its points.

    Raises
    ------
    MeshError
        Other cells than straight triangles and tetrahedra.
    """
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
    corners = mesh.dolfinx.geometry.x[nodes[:, : len(mesh.geometry.corners)]]
    count = corners.shape[1]
    first, second = np.triu_indices(count, 1)  # of a simplex all pairs of corners are edges
    return np.asarray(np.linalg.norm(corners[:, first] - corners[:, second], axis=2).mean(axis=1))


@dataclass(frozen=True)
class Pieces:
    """A whole mesh on one rank with a value for each cell.

    Attributes
    ----------
    points : (n, gdim) m.
    cells : (c, dim + 1) numbers of points.
    groups : name -> {dimension: (entities, vertices of one) numbers of points}.
    values : (c,) one for each cell.
    """

    points: Array
    cells: IntArray
    groups: dict[str, dict[int, IntArray]]
    values: Array


def divisible(mesh: Mesh) -> bool:
    """Whether the cells of the mesh can be bisected: straight triangles and tetrahedra."""
    return mesh.cell in KIND_OF and mesh.order == 1


def refined(mesh: Mesh, ratio: Array) -> Mesh:
    """The mesh with cells bisected until their sizes are about `ratio` times the present ones.

    `ratio` (cells that this rank owns,). The refinement is made on one rank and distributed anew.
    """
    pieces = gathered(mesh, ratio)
    if pieces is not None:
        for _ in range(ROUNDS):
            if not np.any(pieces.values < DIVIDED):
                break
            pieces = divided(pieces, mesh.cell)
    pieces = mesh.comm.bcast(pieces)
    kind = KINDS[KIND_OF[mesh.cell]]
    raw = RawMesh(pieces.points, pieces.cells, kind, "gmsh", pieces.groups)
    return distributed(raw, mesh.name, mesh.comm)


def gathered(mesh: Mesh, values: Array) -> Pieces | None:
    """The mesh and `values` of its cells on rank 0; None on other ranks."""
    geometry = mesh.dolfinx.geometry
    nodes_here = np.arange(len(geometry.x), dtype=np.int32)
    number = np.asarray(geometry.index_map().local_to_global(nodes_here))
    count = compat.cell_map(mesh.dolfinx).size_local
    cells = number[compat.geometry_nodes(mesh.dolfinx)[:count]]
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
    points = np.zeros((int(geometry.index_map().size_global), mesh.gdim))
    all_groups: dict[str, dict[int, list[IntArray]]] = {}
    for numbers, x, _, _, own_groups in of_ranks:
        points[numbers] = x
        for name, parts in own_groups.items():
            for dim, rows in parts.items():
                all_groups.setdefault(name, {}).setdefault(dim, []).append(np.sort(rows, axis=1))
    return Pieces(
        points,
        np.vstack([of_rank[2] for of_rank in of_ranks]).astype(np.int64),
        {
            name: {dim: np.unique(np.vstack(rows), axis=0) for dim, rows in parts.items()}
            for name, parts in all_groups.items()
        },
        np.concatenate([of_rank[3] for of_rank in of_ranks]),
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
    new_pieces = replace(pieces, points=x, cells=cells, groups={})
    parent = positions(_carriers(support, cells), pieces.cells)
    if cell == "triangle" and gdim == 3:  # the normals tell the side of layers
        cosine = np.einsum("ci,ci->c", _normals(x[cells]), _normals(_corners(pieces)[parent])) < 0
        cells[cosine] = cells[cosine][:, [0, 2, 1]]
        new_pieces = replace(new_pieces, cells=cells)
    values = pieces.values[parent] * _sizes(pieces)[parent] / _sizes(new_pieces)
    carried = {dim: _carried(new, dim, support) for dim in set().union(*pieces.groups.values())}
    groups = {
        name: {dim: _in_group(*carried[dim], rows) for dim, rows in parts.items()}
        for name, parts in pieces.groups.items()
    }
    return replace(new_pieces, groups=groups, values=values)


def _corners(pieces: Pieces) -> Array:
    """Corners (cells, corners, gdim) of the cells."""
    return pieces.points[pieces.cells]


def _normals(corners: Array) -> Array:
    """Normals (cells, 3) of triangles in space."""
    return np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])


def _sizes(pieces: Pieces) -> Array:
    """Mean edge length of each cell."""
    corners = _corners(pieces)
    first, second = np.triu_indices(corners.shape[1], 1)
    return np.asarray(np.linalg.norm(corners[:, first] - corners[:, second], axis=2).mean(axis=1))


def _supports(pieces: Pieces, x: Array) -> IntArray:
    """The two old points (n, 2) between which each new point lies; an old point is listed twice."""
    first, second = np.triu_indices(pieces.cells.shape[1], 1)
    edges = np.stack([pieces.cells[:, first].ravel(), pieces.cells[:, second].ravel()], axis=1)
    edges = np.unique(np.sort(edges, axis=1), axis=0)
    old_points = np.repeat(np.arange(len(pieces.points))[:, None], 2, axis=1)
    pairs = np.vstack([old_points, edges])
    _, nearest = cKDTree(pieces.points[pairs].mean(axis=1)).query(x)
    return np.asarray(pairs[nearest])


def _carriers(support: IntArray, entities: IntArray) -> IntArray:
    """Old points (n, k) between which each new entity (n, k) lies; -1 for an entity with more than
    k.

    An entity lies in an old one of its own dimension if and only if k old points support it.
    """
    k = entities.shape[1]
    rows = np.sort(support[entities].reshape(len(entities), -1), axis=1)
    first = np.ones(rows.shape, dtype=bool)
    first[:, 1:] = np.diff(rows, axis=1) > 0
    fit = first.sum(axis=1) == k
    carriers = np.full((len(entities), k), -1, dtype=np.int64)
    carriers[fit] = rows[fit][first[fit]].reshape(-1, k)
    return carriers


def _carried(mesh: dolfinx.mesh.Mesh, dim: int, support: IntArray) -> tuple[IntArray, IntArray]:
    """Vertices (n, dim + 1) of the new entities that lie in old ones, and of these old ones."""
    entities = compat.entity_vertices(mesh, dim).astype(np.int64)
    carriers = _carriers(support, entities)
    inside = carriers[:, 0] >= 0
    return entities[inside], carriers[inside]


def _in_group(entities: IntArray, carriers: IntArray, group: IntArray) -> IntArray:
    """Vertices of the new entities whose old ones are among `group`."""
    return entities[positions(carriers, group) >= 0]
