"""`MeshedStructure`: K, M, mesh and weak form of a part; `Member`: the part in an assembly."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import KW_ONLY, dataclass, field, replace
from functools import cached_property
from typing import Any, ClassVar, TypeVar

import numpy as np
import scipy.sparse
import scipy.sparse.csgraph
from mpi4py import MPI
from petsc4py import PETSc

from antiosc.base._types import Array, Box, IntArray
from antiosc.base.checks import array, shown
from antiosc.base.errors import InputError, without_warnings
from antiosc.fem.elements.weak_form import Family, Kind, Parts, WeakForm, measure, restricted
from antiosc.fem.linalg.algebra import dot, multiply
from antiosc.fem.mesh.closest_point import ClosestPoints, closest_many
from antiosc.fem.mesh.entities import DEGREE, Quadrature, largest, quadrature
from antiosc.fem.mesh.mesh import Mesh
from antiosc.fem.mesh.surface import Faces
from antiosc.fem.platform import compat
from antiosc.fem.platform.mpi import bounds
from antiosc.fem.structure import rigid_body_modes
from antiosc.fem.structure.dissipation import Dissipation
from antiosc.fem.structure.matrices import Plausibility, StructureMatrices
from antiosc.fem.structure.placement import Placement
from antiosc.fem.structure.rigid_body_modes import about
from antiosc.fem.structure.stiffeners import Stiffener
from antiosc.fem.structure.support import NO_DOFS, Support, dofs_of_group
from antiosc.models.motion import Inertia

T = TypeVar("T")

DISPLACEMENTS, ROTATIONS = ("x", "y", "z"), ("rx", "ry", "rz")


@dataclass(frozen=True, eq=False)
class Member:
    """A part of an assembly in its position."""

    name: str  # of the part in the assembly
    part: MeshedStructure  # the structure
    at: Placement  # its placement
    first: int  # number of its first dof in u

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


@dataclass(eq=False)
class MeshedStructure(StructureMatrices):
    """K and M of a mesh, and the mesh."""

    _: KW_ONLY
    mesh: Mesh
    form: WeakForm  # that was assembled on it
    parts: Parts  # (material, cells of this rank)
    total_mass: float  # kg
    #: M e for unit accelerations e along x, y, z, of the attachments alone (rows of this rank, 3)
    attached_inertia: Array
    #: gives the same structure of a copy of its mesh, for instance on other ranks, or with other
    #: supports
    again: Callable[..., MeshedStructure]
    supports: Sequence[Support] = ()
    #: the beams on the edges of a sheet, by group
    stiffeners: Mapping[str, Stiffener] = field(default_factory=dict)
    #: sentences on what is implausible of its size and its materials
    doubts: tuple[str, ...] = ()
    #: the least of a sheet [m], unless it is held along one line alone
    thickness: float | None = None
    dampers: Sequence[Dissipation] = ()  # of its attachments
    #: its fixed dofs, as its forms are assembled with
    conditions: Mapping[tuple[int, ...], IntArray] = field(default_factory=dict)

    meshed: ClassVar[bool] = True

    @property
    def comm(self) -> MPI.Comm:
        """The MPI communicator that shares the mesh."""
        return self.mesh.comm

    # -- the one part of an assembly without joints

    #: each rank has its own rows, and all ranks work on them together
    workers = comm

    def members(self, name: str | None = None) -> list[Member]:
        """The structure as the only part; InputError for the name of a part."""
        if name is not None:
            raise InputError(
                f"part={shown(name)} names a part of an assembly; {self.mesh.name} is one."
            )
        return [Member("", self, Placement(), 0)]

    def fields(self, shapes: Array, name: str | None = None) -> list[tuple[Member, Array]]:
        """[(part, its dofs)] for `shapes` (rows of this rank, k)."""
        return [(member, shapes) for member in self.members(name)]

    def decided(self, work: Callable[[], T]) -> T:
        """The result of `work()`, which all ranks do."""
        return work()

    def own(self, rows: T) -> T:
        """The rows of this rank of what `decided` work has found: those that it has."""
        return rows

    def joined(self, member: Member, loads: T) -> T:
        """Loads on the dofs of the part as loads on those of the structure: the same."""
        return loads

    @property
    def kind(self) -> Kind:
        """The facts of the element family that all its materials are of."""
        return self._material.kind

    @property
    def _material(self) -> Family:
        material: Family = self.parts[0][0]
        return material

    @cached_property
    def faces(self) -> Faces:
        """The faces of this rank at which impacts are possible."""
        return Faces(self.mesh, not self.kind.outside)

    @property
    def rigid_motions(self) -> Array:
        return rigid_body_modes.motions(self.form, self.K)

    @property
    def mass(self) -> float:
        return self.total_mass

    @property
    def plausibility(self) -> Plausibility:
        speed = max(material.bar_speed() for material, _ in self.parts)
        found: Plausibility = {"wave_speed": speed}
        if self.thickness is not None:
            found["thickness"] = self.thickness
        return {**found, "doubts": list(self.doubts)} if self.doubts else found

    @property
    def dimensions(self) -> Box:
        low, high = bounds(self.comm, self.mesh.dolfinx.geometry.x)
        length, width, thickness = sorted((float(e) for e in high - low), reverse=True)
        materials = [material for material, _ in self.parts]
        return self._material.dimensions((length, width, thickness), materials)

    def constants(self) -> tuple[float, float, float]:
        return self._material.constants()

    def uniform_inertia(self, direction: Array) -> Array:
        direction = array("direction", direction, (3,))
        along = compat.constant(self.mesh.dolfinx, direction)
        load = self.form.momentum(along) * measure(self.mesh, 5)
        own = compat.assemble_functional(load, self.form.space)
        return np.asarray(own[: len(self.attached_inertia)] + self.attached_inertia @ direction)

    @cached_property
    def rigid_inertia(self) -> tuple[Inertia, Array] | None:
        if not self.rigid_modes.shape[1]:
            return None
        low, high = bounds(self.comm, self.mesh.dolfinx.geometry.x)
        point = (low + high) / 2
        motions = rigid_body_modes.about(self.form, point)
        loads = self.inertial_loads(motions)
        S = dot(self.comm, motions, loads)
        return Inertia(point, (S + S.T) / 2, np.zeros((0, 6))), loads

    def inertial_loads(self, motions: Array) -> Array:
        """M times motions (rows of this rank, k) in which fixed dofs move with the body."""
        loads = multiply(self.M, motions)
        owned = self.fixed[self.fixed < len(motions)]
        if self.comm.allreduce(len(owned)):
            # M has no entries on the held dofs
            whole = compat.assemble(self.form.mass, self.form.space, {}, 0.0)
            free = motions.copy()
            free[owned] = 0.0
            kept = multiply(whole, free)
            kept[owned] = 0.0
            loads += multiply(whole, motions) - kept
        return loads

    def unsupported(self) -> MeshedStructure:
        """The same without its supports."""
        with without_warnings():  # it was warned of when the structure was made
            return self.again(self.mesh, ())

    def part_of_cells(self) -> IntArray:
        """Number in `parts` of the material of each cell of this rank, ghosts included."""
        imap = compat.cell_map(self.mesh.dolfinx)
        part = np.zeros(imap.size_local + imap.num_ghosts, dtype=int)
        for number, (_, cells) in enumerate(self.parts):
            part[cells] = number
        return part

    @property
    def lossy(self) -> bool:
        return any(getattr(material, "loss", 0.0) for material, _ in self.parts)

    def dissipation(self) -> list[Dissipation]:
        return [*self.dampers, *self._layers]

    @cached_property
    def _layers(self) -> list[Dissipation]:
        return [
            Dissipation(matrix=K, factor=ratio, tau=tau)
            for material, K in self._stiffnesses("prony")
            for ratio, tau in material.prony
        ]

    @cached_property
    def _losses(self) -> list[tuple[Any, PETSc.Mat]]:
        return self._stiffnesses("loss")

    def loss_stiffness(self, V: Array) -> Array | None:
        if not self.lossy:
            return None
        own = (material.loss * dot(self.comm, V, multiply(K, V)) for material, K in self._losses)
        return np.asarray(sum(own))

    def _stiffnesses(self, name: str) -> list[tuple[Any, PETSc.Mat]]:
        """(material, its share of K) of the materials in which `name` is set."""
        found = []
        for material, cells in self.parts:
            if getattr(material, name, None):
                own = restricted(self.form.stiffness, self.mesh, cells)
                found.append(
                    (material, compat.assemble(own, self.form.space, self.conditions, 0.0))
                )
        return found

    def describe(self, dofs: int) -> str:
        family = " and ".join(sorted({type(material).__name__ for material, _ in self.parts}))
        return (
            f"{self.mesh.name}: {self.mesh.n_cells} {self.mesh.cell} cells, {family}, "
            f"{dofs} dofs, {self.rigid_modes.shape[1]} rigid-body modes"
        )


def alone(stiffener: Stiffener) -> MeshedStructure:
    """The beams of a stiffener as a structure, for what is asked of its cells."""
    rows = compat.local_size(stiffener.form.space)
    return MeshedStructure(
        stiffener.K,
        stiffener.M,
        NO_DOFS,
        np.zeros((rows, 0)),
        0.0,
        "auto",
        mesh=stiffener.mesh,
        form=stiffener.form,
        parts=stiffener.parts,
        total_mass=0.0,
        attached_inertia=np.zeros((rows, 3)),
        again=lambda _: alone(stiffener),
    )
