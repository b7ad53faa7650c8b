"""`MeshedStructure`: K and M of a structure with the mesh and the weak form that they come from."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any, ClassVar, TypeVar

import numpy as np
from mpi4py import MPI
from petsc4py import PETSc

from antiosc.base import plausible
from antiosc.base._types import Array, Box, IntArray
from antiosc.base.checks import array, several, shown, whole
from antiosc.base.errors import InputError, without_warnings
from antiosc.base.progress import doing
from antiosc.fem import compat
from antiosc.fem.elements.weak_form import Family, Kind, Parts, WeakForm, measure, restricted
from antiosc.fem.linalg.algebra import dot, multiply
from antiosc.fem.linalg.solver import Choice, checked_choice
from antiosc.fem.linalg.strains import attach
from antiosc.fem.mesh.mesh import Mesh
from antiosc.fem.mesh.surface import Faces
from antiosc.fem.mpi import bounds, warn
from antiosc.fem.structure import rigid_body_modes
from antiosc.fem.structure.attachments import (
    Attachment,
    Matrices,
    Stiffener,
    add_at_points,
    add_beams,
    attachments_of,
)
from antiosc.fem.structure.dissipation import Dissipation
from antiosc.fem.structure.materials import divided, parts_of
from antiosc.fem.structure.matrices import StructureMatrices
from antiosc.fem.structure.member import Member
from antiosc.fem.structure.placement import Placement
from antiosc.fem.structure.support import NO_DOFS, Support, fixed_dofs
from antiosc.models.motion import Inertia

T = TypeVar("T")


@dataclass(eq=False)
class MeshedStructure(StructureMatrices):
    """K and M of a mesh, and the mesh.

    Attributes
    ----------
    mesh : Mesh
    form : WeakForm
        That was assembled on it.
    parts : sequence of (material, cells of this rank)
    total_mass : kg
    attached_inertia : M e for unit accelerations e along x, y, z, of the attachments alone (rows of
        this rank, 3).
    again : gives the same structure of a copy of its mesh, for instance on other ranks, or with
        other supports.
    supports : what holds it.
    stiffeners : the beams on the edges of a sheet, by group.
    dampers : of its attachments; conditions : its fixed dofs, as its forms are assembled with.
    doubts : sentences on what is implausible of its size and its materials.
    """

    mesh: Mesh = field(kw_only=True)
    form: WeakForm = field(kw_only=True)
    parts: Parts = field(kw_only=True)
    total_mass: float = field(kw_only=True)
    attached_inertia: Array = field(kw_only=True)
    again: Callable[..., MeshedStructure] = field(kw_only=True)
    supports: Sequence[Support] = field(default=(), kw_only=True)
    stiffeners: Mapping[str, Stiffener] = field(default_factory=dict, kw_only=True)
    doubts: tuple[str, ...] = field(default=(), kw_only=True)
    dampers: Sequence[Dissipation] = field(default=(), kw_only=True)
    conditions: Any = field(default_factory=dict, kw_only=True)

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
        """Rigid-body motions of the unsupported body (rows of this rank, r)."""
        return rigid_body_modes.motions(self.form, self.K)

    @property
    def mass(self) -> float:
        """Total mass in kg."""
        return self.total_mass

    @property
    def plausibility(self) -> dict[str, Any]:
        """What was implausible, and the largest √(E/ρ) of its materials, m/s."""
        speed = max(material.bar_speed() for material, _ in self.parts)
        return {"wave_speed": speed, **({"doubts": list(self.doubts)} if self.doubts else {})}

    @property
    def dimensions(self) -> Box:
        """Length, width and thickness of the part, m; see `Structure.dimensions`."""
        low, high = bounds(self.comm, self.mesh.dolfinx.geometry.x)
        length, width, thickness = sorted((float(e) for e in high - low), reverse=True)
        materials = [material for material, _ in self.parts]
        return self._material.dimensions((length, width, thickness), materials)

    def constants(self) -> tuple[float, float, float]:
        """(E [Pa], nu, rho [kg/m³]) of the first material; InputError for one with directions."""
        return self._material.constants()

    def uniform_inertia(self, direction: Array) -> Array:
        """Me on the rows of this rank for e, a unit uniform motion along `direction` (3,)."""
        direction = array("direction", direction, (3,))
        along = compat.constant(self.mesh.dolfinx, direction)
        load = self.form.momentum(along) * measure(self.mesh, 5)
        own = compat.assemble_functional(load, self.form.space)
        return np.asarray(own[: len(self.attached_inertia)] + self.attached_inertia @ direction)

    @cached_property
    def rigid_inertia(self) -> tuple[Inertia, Array] | None:
        """The whole body's inertia and M r of its rigid motions r; see `Structure`."""
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
        """Whether a material has a loss factor."""
        return any(getattr(material, "loss", 0.0) for material, _ in self.parts)

    def dissipation(self) -> list[Dissipation]:
        """Its dampers, and the layers of materials that relax."""
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
        """Σ η VᵀKV of the materials; None where none has a loss factor."""
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
        """One line: what was modelled and with how many dofs."""
        family = " and ".join(sorted({type(material).__name__ for material, _ in self.parts}))
        return (
            f"{self.mesh.name}: {self.mesh.n_cells} {self.mesh.cell} cells, {family}, "
            f"{dofs} dofs, {self.rigid_modes.shape[1]} rigid-body modes"
        )


def assembled(
    mesh: Mesh,
    material: Family | Mapping[str, Family],
    supports: Sequence[Support],
    *,
    order: int,
    attached: Sequence[Attachment],
    solver: Choice,
) -> MeshedStructure:
    """The structure of a mesh; parameters and errors are those of `Structure`."""
    if not isinstance(mesh, Mesh):
        raise InputError(f"mesh must come from read_mesh; got {type(mesh).__name__}.")
    order = whole("order", order)
    if order not in (1, 2):
        raise InputError(f"order must be 1 or 2; got {order}.")
    checked_choice(solver)
    held = several("supports", supports, Support, "Support(where, fix)")
    carried = attachments_of(attached)
    cells, beams = divided(mesh, material)
    parts = parts_of(mesh, cells)
    stiffeners = [beam for _, beam, _ in beams]
    materials = [*(one for one, _ in parts), *stiffeners]
    doubts = plausible.tell(
        [
            plausible.of_part(mesh.extent()),
            *map(plausible.of_material, materials),
            *(
                plausible.of_thickness(one.section.thickness, mesh.extent())
                for one in materials
                if hasattr(getattr(one, "section", None), "thickness")
            ),
        ]
    )
    form = parts[0][0].weak_form(mesh, parts, order)
    conditions = fixed_dofs(mesh, form, held)
    with doing(f"assembly of {mesh.n_cells} cells", mesh.comm.rank):
        K = compat.assemble(form.stiffness, form.space, conditions, 1.0)
        M = compat.assemble(form.mass, form.space, conditions, 0.0)
    fixed = np.unique(np.concatenate([NO_DOFS, *conditions.values()]))
    free = compat.local_size(form.space) - int((fixed < compat.local_size(form.space)).sum())
    if mesh.comm.allreduce(free) == 0:
        raise InputError("the supports fix every dof of the structure: nothing can move.")
    mass = compat.integrate(form.density * measure(mesh, 5), mesh.dolfinx)
    # What is added to K, apart where K is taken by its strains.
    rest = K if form.strains is None else _zeros_like(K)
    to = Matrices(mesh, form, rest, M, fixed)
    on_edges = {name: add_beams(to, name, beam, edges) for name, beam, edges in beams}
    added = [one for one, _ in on_edges.values()]
    added += [add_at_points(to, one) for one in carried]
    if form.strains is not None:
        strains, degree = form.strains
        S = compat.strain_matrix(strains, degree, form.space, conditions)
        _take_by_strains(K, S, rest, fixed)
    mass += sum(one.mass for one in added)
    attached_inertia = sum(
        (one.inertia for one in added), np.zeros((compat.local_size(form.space), 3))
    )
    springs = np.column_stack([attached_inertia[:, :0], *(one.springs for one in added)])
    modes, shift = rigid_body_modes.of_mesh(form, fixed, K, M, springs)
    if conditions and modes.shape[1]:
        motions = rigid_body_modes.described(mesh, form, modes)
        warn(
            mesh.comm,
            f"the supports leave the structure free to move as a rigid body: {motions}; hold "
            "that too unless it is intended.",
        )
    given = dict(material) if isinstance(material, Mapping) else material

    def again(copy: Mesh, supports: Sequence[Support] = held) -> MeshedStructure:
        return assembled(copy, given, supports, order=order, attached=carried, solver=solver)

    return MeshedStructure(
        K,
        M,
        fixed,
        modes,
        shift,
        solver,
        mesh=mesh,
        form=form,
        parts=parts,
        total_mass=mass,
        attached_inertia=attached_inertia,
        again=again,
        supports=held,
        stiffeners={name: lines for name, (_, lines) in on_edges.items()},
        dampers=[damper for one in added for damper in one.dampers],
        conditions=conditions,
        doubts=doubts,
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


def _take_by_strains(K: PETSc.Mat, S: PETSc.Mat, rest: PETSc.Mat, fixed: IntArray) -> None:
    """Add `rest` to K, and let products with K be taken by S, its strains."""
    K.axpy(1.0, rest, structure=PETSc.Mat.Structure.SAME_NONZERO_PATTERN)
    first, last = rest.getOwnershipRange()
    for dof in fixed[fixed < last - first]:
        rest.setValue(first + dof, first + dof, 1.0)
    rest.assemble()
    attach(K, S, rest)


def _zeros_like(matrix: PETSc.Mat) -> PETSc.Mat:
    result = matrix.duplicate()
    result.zeroEntries()
    return result
