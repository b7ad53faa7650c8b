"""Entities of a mesh as weighted points of its cells."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import basix
import numpy as np
from mpi4py import MPI

from antiosc.base._types import Array, IntArray
from antiosc.base.errors import InputError
from antiosc.fem.mesh.mesh import Mesh
from antiosc.fem.platform import compat

#: Degree of the rules with which groups are integrated: products of two cubics on straight cells.
DEGREE = 6


@dataclass(frozen=True, eq=False)
class Quadrature:
    """Weighted points in cells of a mesh, n of them."""

    entity: IntArray  # (n,) number of the entity of each
    #: cell, X: (n,) cell and (n, tdim) reference coordinates in it
    cell: IntArray
    X: Array
    x: Array  # (n, 3) coordinates [m]
    weight: Array  # (n,) [m, m² or m³; 1 for points]


def largest(mesh: Mesh, group: str) -> tuple[int, IntArray]:
    """(dimension, entities of this rank) of the largest dimension in a group, on all ranks."""
    found = mesh.group(group)
    dim = mesh.comm.allreduce(max((d for d in found if len(found[d])), default=-1), op=MPI.MAX)
    if dim < 0:
        raise InputError(f"the group {group!r} of {mesh.name} is empty.")
    return dim, np.asarray(found.get(dim, np.zeros(0, dtype=np.int32)))


def cells_at(mesh: Mesh, dim: int, entities: IntArray) -> tuple[IntArray, IntArray]:
    """(a cell at each entity, the number of the entity in this cell)."""
    topology = mesh.dolfinx.topology
    if dim == mesh.tdim:
        return np.asarray(entities), np.zeros(len(entities), dtype=int)
    topology.create_entities(dim)
    topology.create_connectivity(dim, mesh.tdim)
    to_cell = topology.connectivity(dim, mesh.tdim)
    cells = np.asarray(to_cell.array)[np.asarray(to_cell.offsets)[entities]]
    own = compat.cell_entities(mesh.dolfinx, dim)[cells]
    return cells, np.asarray((own == np.asarray(entities)[:, None]).argmax(axis=1))


def frames(mesh: Mesh, dim: int, number: IntArray) -> tuple[Array, Array]:
    """Origin (n, tdim) and axes (n, tdim, dim) of entities of cells in the reference cell."""
    if dim == mesh.tdim:
        count = len(number)
        return np.zeros((count, dim)), np.tile(np.eye(dim), (count, 1, 1))
    kind = getattr(basix.CellType, mesh.cell)
    corners, entities = np.asarray(basix.geometry(kind)), basix.topology(kind)[dim]
    origin = np.array([corners[e[0]] for e in entities])
    axes = np.array([(corners[e[1 : dim + 1]] - corners[e[0]]).T for e in entities])
    return origin[number], axes.reshape(len(entities), mesh.tdim, dim)[number]


class Entities:
    """Entities of one dimension of a mesh, F of them.

    A point of one has coordinates ξ in the reference entity and X = origin + axes ξ in the
    reference cell.

    Attributes
    ----------
    cells : (F,) a cell at each.
    vertices : (F, v) numbers of the geometry nodes at their vertices.
    corners : (F, v, 3) vertices [m].
    middle : (F, dim) coordinates ξ of their middles.
    """

    def __init__(self, mesh: Mesh, dim: int, entities: IntArray) -> None:
        self.mesh, self.dim = mesh, dim
        self.cells, number = cells_at(mesh, dim, entities)
        self._origin, self._axes = frames(mesh, dim, number)
        self.vertices = compat.entity_vertices(mesh.dolfinx, dim)[entities]
        self.corners = mesh.dolfinx.geometry.x[self.vertices]
        self.simplex = self.corners.shape[1] == dim + 1
        self.affine = mesh.geometry.affine
        self.middle = np.full((len(self), dim), 1 / (dim + 1) if self.simplex else 0.5)

    def __len__(self) -> int:
        return len(self.cells)

    @cached_property
    def centres(self) -> Array:
        """Middles of the vertices (F, 3) [m]."""
        return np.asarray(self.corners.mean(axis=1))

    @cached_property
    def radii(self) -> Array:
        """Radius (F,) of a ball around the middle that holds the entity [m]."""
        away = np.linalg.norm(self.corners - self.centres[:, None], axis=2)
        return np.asarray(away.max(axis=1, initial=0.0) * (1.0 if self.affine else 1.3))

    def reference(self, face: IntArray, xi: Array) -> Array:
        """Reference coordinates (n, tdim) in the cells of points ξ (n, dim) of entities (n,)."""
        return np.asarray(self._origin[face] + np.einsum("ntd,nd->nt", self._axes[face], xi))

    def at(self, face: IntArray, xi: Array) -> tuple[Array, Array]:
        """(points (n, 3) [m], derivatives (n, 3, dim)) at ξ in entities."""
        x, J = self.mesh.geometry.at(self.cells[face], self.reference(face, xi))
        return x, np.einsum("nxt,ntd->nxd", J, self._axes[face])


def shape(mesh: Mesh, dim: int) -> str:
    """Shape of the entities of a dimension: "point", "interval", "triangle", …"""
    if dim == mesh.tdim:
        return mesh.cell
    if dim < 2:
        return ("point", "interval")[dim]
    return "triangle" if mesh.geometry.simplex else "quadrilateral"


def quadrature(mesh: Mesh, dim: int, entities: IntArray, degree: int) -> Quadrature:
    """A rule on entities of a mesh: exact for polynomials of `degree` on straight simplices."""
    cells, number = cells_at(mesh, dim, entities)
    origin, axes = frames(mesh, dim, number)
    if dim == 0:
        xi, weights = np.zeros((1, 0)), np.ones(1)
    else:
        xi, weights = basix.make_quadrature(getattr(basix.CellType, shape(mesh, dim)), degree)
    many, count = len(entities), len(weights)
    X = origin[:, None] + np.einsum("ntd,qd->nqt", axes, np.asarray(xi).reshape(count, dim))
    cell = np.repeat(cells, count)
    X = X.reshape(many * count, -1)
    x, J = mesh.geometry.at(cell, X)
    area = np.ones(many * count)
    if dim:
        J = np.einsum("nxt,ntd->nxd", J, np.repeat(axes, count, axis=0))
        area = np.sqrt(np.linalg.det(np.einsum("nxd,nxe->nde", J, J)))
    return Quadrature(
        np.repeat(np.arange(many), count),
        cell,
        X,
        x,
        area * np.tile(weights, many),
    )


def centre(mesh: Mesh, group: str) -> Array:
    """Centroid (3,) of the entities of the largest dimension in a group [m]; of all ranks."""
    dim, entities = largest(mesh, group)
    mesh.dolfinx.topology.create_entities(dim)
    entities = entities[entities < mesh.dolfinx.topology.index_map(dim).size_local]
    points = quadrature(mesh, dim, entities, DEGREE)
    total = mesh.comm.allreduce(points.weight.sum())
    return np.asarray(mesh.comm.allreduce(points.weight @ points.x) / total)
