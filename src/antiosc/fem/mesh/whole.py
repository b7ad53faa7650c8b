"""`whole`: the mesh that several ranks share, on each of them in full."""

from __future__ import annotations

import numpy as np
from mpi4py import MPI

from antiosc._types import Array, IntArray
from antiosc.fem import compat
from antiosc.fem.mesh.mesh import Mesh, local_groups


def whole(mesh: Mesh) -> Mesh:
    """A copy of `mesh` on this rank alone, with the same nodes, cells and groups on every rank.

    All ranks of the mesh must call it. Nodes keep the numbers with which the mesh was made.
    """
    numbers = np.asarray(mesh.dolfinx.geometry.input_global_indices, dtype=np.int64)
    points = _points(mesh, numbers)
    cells = _cells(mesh, numbers)
    groups = _groups(mesh, numbers)
    made = compat.create_mesh(MPI.COMM_SELF, cells, points, mesh.cell, mesh.order)
    return Mesh(made, local_groups(made, groups), mesh.name)


def _points(mesh: Mesh, numbers: IntArray) -> Array:
    """Coordinates of all nodes by their numbers; zero for numbers that no cell uses."""
    found = mesh.comm.allgather((numbers, mesh.dolfinx.geometry.x[:, : mesh.gdim]))
    most = max((int(own.max()) for own, _ in found if len(own)), default=-1)
    points = np.zeros((most + 1, mesh.gdim))
    for own, x in found:
        points[own] = x
    return points


def _cells(mesh: Mesh, numbers: IntArray) -> IntArray:
    """Nodes of all cells, in the order in which the cells were given."""
    count = compat.cell_map(mesh.dolfinx).size_local
    given = np.asarray(mesh.dolfinx.topology.original_cell_index)[:count]
    nodes = numbers[compat.geometry_nodes(mesh.dolfinx)[:count]]
    found = mesh.comm.allgather((given, nodes))
    order = np.argsort(np.concatenate([own for own, _ in found]), kind="stable")
    return np.ascontiguousarray(np.vstack([cells for _, cells in found])[order])


def _groups(mesh: Mesh, numbers: IntArray) -> dict[str, dict[int, IntArray]]:
    """The vertices of all entities of each group, by their numbers."""
    own: dict[str, dict[int, IntArray]] = {}
    vertices: dict[int, IntArray] = {}
    for dim in range(mesh.tdim + 1):  # a collective call of dolfinx
        vertices[dim] = numbers[compat.entity_vertices(mesh.dolfinx, dim)]
    for name, parts in mesh.groups.items():
        own[name] = {dim: vertices[dim][entities] for dim, entities in parts.items()}
    joined: dict[str, dict[int, IntArray]] = {name: {} for name in own}
    for name, dim in _pairs(mesh):
        joined[name][dim] = np.zeros((0, vertices[dim].shape[1]), dtype=np.int64)
    for part in mesh.comm.allgather(own):
        for name, parts in part.items():
            for dim, entities in parts.items():
                if len(entities):
                    joined[name][dim] = np.vstack([joined[name][dim], entities])
    return joined


def _pairs(mesh: Mesh) -> list[tuple[str, int]]:
    """(group, dimension) of all ranks."""
    own = [(name, dim) for name, parts in mesh.groups.items() for dim in parts]
    return list(dict.fromkeys(pair for part in mesh.comm.allgather(own) for pair in part))
