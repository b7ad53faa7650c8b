"""`Member`: a part in its place, with its nodes, motions and closest points in common axes."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np
import scipy.sparse
import scipy.sparse.csgraph

from antiosc.base._types import Array, IntArray
from antiosc.fem import compat
from antiosc.fem.mesh.closest_point import ClosestPoints, closest_many
from antiosc.fem.mesh.entities import DEGREE, Quadrature, largest, quadrature
from antiosc.fem.structure.placement import Placement
from antiosc.fem.structure.rigid_body_modes import about
from antiosc.fem.structure.support import dofs_of_group

if TYPE_CHECKING:
    from antiosc.fem.structure.meshed import MeshedStructure

DISPLACEMENTS, ROTATIONS = ("x", "y", "z"), ("rx", "ry", "rz")


@dataclass(frozen=True, eq=False)
class Member:
    """A part of an assembly in its position.

    Attributes
    ----------
    name : of the part in the assembly.
    part : the structure.
    at : its placement.
    first : number of its first dof in u.
    """

    name: str
    part: MeshedStructure
    at: Placement
    first: int

    @property
    def size(self) -> int:
        """Number of dofs."""
        return int(self.part.K.getSize()[0])

    @property
    def rows(self) -> slice:
        """Its dofs in u."""
        return slice(self.first, self.first + self.size)

    @property
    def block(self) -> int:
        """Dofs of a node."""
        return int(self.part.form.space.dofmap.index_map_bs)

    @property
    def has_rotations(self) -> bool:
        """Whether nodes have rotations."""
        return "rz" in self.part.form.components

    @cached_property
    def nodes(self) -> Array:
        """Coordinates (nodes, 3) of the nodes of the displacements in the assembly [m]."""
        return self.at.placed(self.part.form.space.tabulate_dof_coordinates())

    @cached_property
    def vertices(self) -> Array:
        """Coordinates (n, 3) of the geometry nodes in the assembly [m]."""
        return self.at.placed(self.part.mesh.dolfinx.geometry.x)

    @cached_property
    def pieces(self) -> IntArray:
        """Number of the connected piece of the mesh to which each node belongs (nodes,)."""
        space = self.part.form.space
        own = compat.cell_map(self.part.mesh.dolfinx).size_local
        (path, *_) = self.part.form.components.values()
        nodes = compat.cell_dofs(space, path, np.arange(own)) // self.block
        first = np.repeat(nodes[:, 0], nodes.shape[1] - 1)
        count = len(self.nodes)
        graph = scipy.sparse.coo_matrix(
            (np.ones(len(first)), (first, nodes[:, 1:].ravel())), shape=(count, count)
        )
        return np.asarray(scipy.sparse.csgraph.connected_components(graph, directed=False)[1])

    def closest(self, points: Array) -> ClosestPoints:
        """The closest points of the part to points (n, 3) of the assembly."""
        return closest_many(self.part.mesh, self.at.own(points))

    def nodes_of(self, group: str) -> IntArray:
        """The nodes of the displacements in a group of the part."""
        form = self.part.form
        dofs = dofs_of_group(self.part.mesh, form, group, form.components["x"])
        return np.unique(np.asarray(dofs) // self.block)

    def points_of(self, group: str) -> Quadrature:
        """Points of a rule on the entities of the largest dimension in a group, in the assembly."""
        mesh = self.part.mesh
        own = quadrature(mesh, *largest(mesh, group), DEGREE)
        return replace(own, x=self.at.placed(own.x))

    def rigid(self, point: Array) -> Array:
        """Six rigid motions about `point` on the dofs of this rank, in the axes of the part."""
        return about(self.part.form, point, self.at)
