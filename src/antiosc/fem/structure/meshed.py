"""`MeshedStructure`: K, M, mesh and weak form of a part, and their assembly."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import KW_ONLY, dataclass, field, replace
from functools import cached_property, partial
from typing import Any, ClassVar, TypeVar, cast

import numpy as np
import scipy.sparse
import scipy.sparse.csgraph
from petsc4py import PETSc

from antiosc.base import plausible
from antiosc.base._types import Array, Box, IntArray, SolverChoice
from antiosc.base.checks import floats, list_of, shown, whole
from antiosc.base.errors import InputError, without_warnings
from antiosc.base.progress import doing
from antiosc.fem.elements.beam import Beam
from antiosc.fem.elements.tetrahedra import cellwise_tetrahedra
from antiosc.fem.elements.weak_form import (
    Family,
    Kind,
    Material,
    Parts,
    WeakForm,
    axes_and_sides,
    measure,
    restricted_forms,
)
from antiosc.fem.linalg import algebra
from antiosc.fem.linalg.algebra import dot, multiply
from antiosc.fem.linalg.iterative import without_fixed
from antiosc.fem.linalg.petsc_algebra import CELLS_KEY, cell_matrix, uses_cells, without_zeros
from antiosc.fem.linalg.solver import checked_choice
from antiosc.fem.linalg.solver_choice import use_strain_product
from antiosc.fem.mesh import Mesh
from antiosc.fem.mesh.surface import (
    GROUP_DEGREE,
    ClosestPoint,
    ClosestPoints,
    Faces,
    SurfaceAtSites,
    WeightedPoints,
    closest_many,
    largest_entities,
    mean_thickness,
    quadrature,
)
from antiosc.fem.platform import compat, warn
from antiosc.fem.structure import (
    Dissipation,
    DofPlaces,
    Placement,
    Plausibility,
    StructureMatrices,
    support,
)
from antiosc.fem.structure.attachments import (
    Attachment,
    Stiffener,
    add_projected,
    attachment_motions,
    attachments_of,
    beams_on,
    terms_of,
)
from antiosc.fem.structure.loads import UNIT_MOTIONS
from antiosc.fem.structure.support import (
    NO_DOFS,
    NumberedNodes,
    Support,
    dofs_of_entities,
    fixed_dofs,
)
from antiosc.models.motion import Inertia

T = TypeVar("T")

#: Largest distance of a point on a surface from it, over the size of the part.
SURFACE_TOLERANCE = 1e-6


@dataclass(frozen=True, eq=False)
class Member:
    """A part of an assembly at its placement."""

    name: str  # of the part in the assembly
    part: MeshedStructure  # the structure
    at: Placement  # its placement
    first: int  # index of its first dof in u, the dofs of all parts on this rank

    @property
    def size(self) -> int:
        """Number of dofs on this rank."""
        return self.part.rows

    @property
    def rows(self) -> slice:
        """Slice of the part's dofs among those of all parts."""
        return slice(self.first, self.first + self.size)

    @property
    def block(self) -> int:
        """Number of dofs of a node."""
        return self.part.block

    @property
    def has_rotations(self) -> bool:
        """Whether nodes have rotations."""
        return "rz" in self.part.form.components

    @cached_property
    def nodes(self) -> Array:
        """Coordinates (nodes, 3) of the nodes of the displacements in the assembly [m]."""
        return self.places.nodes

    @cached_property
    def places(self) -> DofPlaces:
        """Node, direction and kind of its dofs on this rank, in the assembly."""
        return self.part.places.placed(self.at)

    @cached_property
    def vertices(self) -> Array:
        """Coordinates (n, 3) of the geometry nodes in the assembly [m]."""
        return self.at.placed(self.part.mesh.dolfinx.geometry.x)

    @cached_property
    def connected(self) -> IntArray:
        """Number (nodes,), from 0 on, of the connected piece to which each node belongs."""
        space = self.part.form.space
        count_cells = compat.cell_index_map(self.part.mesh.dolfinx).size_local
        (path, *_) = self.part.form.components.values()
        nodes = compat.cell_dofs(space, path, np.arange(count_cells)) // self.block
        first = np.repeat(nodes[:, 0], nodes.shape[1] - 1)
        count = len(self.nodes)
        graph = scipy.sparse.coo_matrix(
            (np.ones(len(first)), (first, nodes[:, 1:].ravel())), shape=(count, count)
        )

        return np.asarray(scipy.sparse.csgraph.connected_components(graph, directed=False)[1])

    def closest(self, points: Array) -> ClosestPoints:
        """The closest points of the part, in its own axes, to points (n, 3) of the assembly."""
        return closest_many(self.part.mesh, self.at.own(points))

    def nodes_of(self, where: str | NumberedNodes) -> IntArray:
        """Numbers (rows of `nodes`) of the nodes in a group, or with given numbers in the file."""
        form = self.part.form
        mesh = self.part.mesh
        parts = mesh.group(where) if isinstance(where, str) else where.entities(mesh)
        dofs = dofs_of_entities(mesh, form, parts, form.components["x"])
        return np.unique(np.asarray(dofs) // self.block)

    def points_of(self, group: str) -> WeightedPoints:
        """Quadrature points on the highest-dimensional entities of a group; `x` in the axes of the
        assembly."""
        mesh = self.part.mesh
        points = quadrature(mesh, *largest_entities(mesh, group), GROUP_DEGREE)
        return replace(points, x=self.at.placed(points.x))


@dataclass(eq=False)
class PartsMatrices(StructureMatrices):
    """K = Tᵀ K_b T, M = Tᵀ M_b T of parts with motions u = T q; K_b, M_b: blocks of the parts."""

    meshed: ClassVar[bool] = True

    def members(self, name: str | None = None) -> list[Member]:
        """All parts, or only the part `name`; InputError if there is none."""
        raise NotImplementedError

    @property
    def places(self) -> DofPlaces:
        """Node, direction and kind of each dof of all parts on this rank."""
        raise NotImplementedError

    def expanded(self, q: Array) -> Array:
        """Motions u = T q of all parts for motions q (rows of this rank, k) of the structure."""
        return q

    def joined(self, loads: T, rows: slice = slice(None)) -> T:
        """Tᵀ `loads`: loads on q (0 on fixed dofs) equivalent to `loads` on `rows` of u = T q."""
        free = np.ones(algebra.rows(self.K))
        free[self.fixed[self.fixed < len(free)]] = 0.0
        return cast(T, scipy.sparse.diags(free) @ loads)

    def fields(self, shapes: Array, name: str | None = None) -> list[tuple[Member, Array]]:
        """[(part, its motions (rows, k))] for `shapes`, of all parts or of the part `name`."""
        members = self.members(name)
        u = self.expanded(shapes)
        return [(member, u[member.rows]) for member in members]

    def dashpots(self) -> list[Dissipation]:
        """Damping terms on q of dashpots and Maxwell branches."""
        raise NotImplementedError

    def on_q(self, member: Member, matrix: PETSc.Mat) -> PETSc.Mat:
        """Tᵀ A T on the structure's dofs q; `matrix` A is on the dofs T q of one part."""
        return matrix

    def dissipation(self) -> list[Dissipation]:
        return [*self.dashpots(), *self._relaxing_terms]

    @cached_property
    def _relaxing_terms(self) -> list[Dissipation]:
        """Damping terms of the relaxing materials of all parts."""
        terms = []
        for member in self.members():
            for owner, material, stiffness in member.part.stiffnesses("prony"):
                K, name = self.on_q(member, stiffness), (member.name, owner)
                terms += [
                    Dissipation(matrix=K, factor=ratio, tau=tau, owner=name)
                    for ratio, tau in material.prony
                ]

        return terms

    def loss_stiffness(self, V: Array) -> Array | None:
        if not self.has_loss_factor:
            return None

        terms = (
            material.loss * dot(self.comm, u, multiply(K, u))
            for member, u in self.fields(V)
            for _, material, K in member.part.losses
        )
        return np.asarray(sum(terms))


@dataclass(eq=False)
class MeshedStructure(PartsMatrices):
    """K and M of one part with its mesh, weak form and materials."""

    _: KW_ONLY
    mesh: Mesh
    form: WeakForm  # that was assembled on it
    parts: Parts  # (material, its cells of this rank, ghosts included), …
    total_mass: float  # with attachments and stiffeners [kg]
    #: M e for unit accelerations e along x, y, z, of the attachments alone (rows of this rank, 3)
    attached_inertia: Array
    #: function (mesh[, supports]) that assembles the same part on another mesh or other supports
    reassembled: Callable[..., MeshedStructure]
    supports: Sequence[Support] = ()
    #: the beams on the edges of a sheet, by group
    stiffeners: Mapping[str, Stiffener] = field(default_factory=dict)
    #: sentences that say why its size or its materials are implausible
    doubts: tuple[str, ...] = ()
    #: least of a sheet, mean of a thin solid [m]; None: other parts, or supports on one line
    thickness: float | None = None
    dampers: Sequence[Dissipation] = ()  # of its attachments
    #: `fixed` by component (its path of sub-space numbers in `form.space`), for assembly of forms
    conditions: Mapping[tuple[int, ...], IntArray] = field(default_factory=dict)
    #: the same part without its prestress
    unloaded: MeshedStructure | None = None
    #: stress-free strains (cells of this rank, with ghosts), for second-order strains; None: linear
    initial: Array | None = None

    @property
    def rows(self) -> int:
        """Number of dofs of this rank, fixed ones included."""
        return compat.local_size(self.form.space)

    @property
    def block(self) -> int:
        """Number of dofs of a node."""
        return int(self.form.space.dofmap.index_map_bs)

    def members(self, name: str | None = None) -> list[Member]:
        if name is not None:
            raise InputError(f"part={shown(name)} names a part; {self.mesh.name} is no assembly.")
        return [Member("", self, Placement(), 0)]

    @property
    def places(self) -> DofPlaces:
        return support.places_of(self.form)

    @property
    def kind(self) -> Kind:
        """The properties of the element family, which all materials share."""
        return self._material.kind

    @property
    def _material(self) -> Family:
        """The first material."""
        material: Family = self.parts[0][0]
        return material

    @cached_property
    def faces(self) -> Faces:
        """The faces of this rank that can be struck."""
        return Faces(self.mesh, not self.kind.outside)

    @property
    def rigid_motions(self) -> Array:
        return support.rigid_motions(self.form, self.K)

    def prolongation(self) -> PETSc.Mat | None:
        """Interpolation from linear to quadratic solids, zero at fixed dofs; None for others."""
        if self.kind.name != "solid" or self.form.degree != 2:
            return None
        rows = compat.local_size(self.form.space)
        fixed = np.isin(np.arange(rows), self.fixed)
        linear = self.K.getAttr(CELLS_KEY).cells.linear.space if uses_cells(self.K) else None
        return without_fixed(compat.interpolation_from_linear(self.form.space, linear), fixed)

    @property
    def mass(self) -> float:
        return self.total_mass

    @property
    def plausibility(self) -> Plausibility:
        speed = max(material.bar_speed() for material, _ in self.parts)
        result: Plausibility = {"wave_speed": speed}
        if self.thickness is not None:
            result["thickness"] = self.thickness
        if self.doubts:
            return {**result, "doubts": list(self.doubts)}
        return result

    @property
    def dimensions(self) -> Box:
        low, high = self.mesh.box
        length, width, thickness = sorted((float(e) for e in high - low), reverse=True)
        materials = [material for material, _ in self.parts]
        return self._material.dimensions((length, width, thickness), materials)

    def constants(self) -> tuple[float, float, float]:
        return self._material.constants()

    def uniform_inertia(self, direction: Array) -> Array:
        direction = floats("direction", direction, (3,))
        unit_direction = compat.constant(self.mesh.dolfinx, direction)
        load = self.form.momentum(unit_direction) * measure(self.mesh, 5)
        forces = compat.assemble_functional(load, self.form.space)
        return np.asarray(forces[: len(self.attached_inertia)] + self.attached_inertia @ direction)

    @cached_property
    def rigid_inertia(self) -> tuple[Inertia, Array] | None:
        if not self.rigid_modes.shape[1]:
            return None
        low, high = self.mesh.box
        point = (low + high) / 2
        motions = self.places.rigid_motions(point)
        loads = self.inertial_loads(motions)
        S = dot(self.comm, motions, loads)
        return Inertia(point, (S + S.T) / 2, np.zeros((0, 6))), loads

    def inertial_loads(self, motions: Array) -> Array:
        """M times `motions` (rows of this rank, k), with the mass at fixed dofs included."""
        loads = multiply(self.M, motions)
        owned_fixed = self.fixed[self.fixed < len(motions)]
        if self.comm.allreduce(len(owned_fixed)):
            # M has no entries on the held dofs
            mass = compat.assemble(self.form.mass, self.form.space, {}, 0.0)
            free = motions.copy()
            free[owned_fixed] = 0.0
            free_loads = multiply(mass, free)
            free_loads[owned_fixed] = 0.0
            loads += multiply(mass, motions) - free_loads

        return loads

    def surface_below(self, points: Array, directions: Array, radii: Array) -> SurfaceAtSites:
        """Surface at points (P, 3) struck along `directions` (P, 3); `radii` (P,) [m] of patches,
        NaN for sites that are points."""
        reach = np.where(np.isfinite(radii), radii, SURFACE_TOLERANCE * self.mesh.extent())
        return self.faces.contact(points, directions, reach, np.zeros(len(self.faces), dtype=int))

    def unsupported(self) -> MeshedStructure:
        """The same structure without its supports."""
        with without_warnings():  # it was warned of when the structure was made
            return self.reassembled(self.mesh, ())

    def part_of_cells(self) -> IntArray:
        """Index (cells,) in `parts` of the material of each cell of this rank, ghosts included."""
        imap = compat.cell_index_map(self.mesh.dolfinx)
        part = np.zeros(imap.size_local + imap.num_ghosts, dtype=int)
        for number, (_, cells) in enumerate(self.parts):
            part[cells] = number
        return part

    def material_at(self, nearest: ClosestPoint) -> Any:
        """The material of the cell that holds a point, on all ranks."""
        if len(self.parts) == 1:
            return self.parts[0][0]
        comm = self.mesh.comm
        label = int(self.part_of_cells()[nearest.cell]) if comm.rank == nearest.rank else 0
        return self.parts[comm.bcast(label, root=nearest.rank)][0]

    @cached_property
    def axes_and_sides(self) -> tuple[Array, Array]:
        """(0° directions (cells, 3), ±1 (cells,): normals point to top or bottom) of a sheet."""
        axis, side = axes_and_sides(self.mesh, self.parts)
        return axis.x.array.reshape(-1, 3), side.x.array

    @property
    def has_loss_factor(self) -> bool:
        beams = (lines.parts[0] for lines in self.stiffeners.values())
        return any(getattr(material, "loss", 0.0) for material, _ in (*self.parts, *beams))

    def dashpots(self) -> list[Dissipation]:
        return list(self.dampers)

    @cached_property
    def losses(self) -> list[tuple[int | str, Material, PETSc.Mat]]:
        """[(owner, material, K)], as by `stiffnesses`, of the materials with a loss factor."""
        return self.stiffnesses("loss")

    def stiffnesses(self, name: str) -> list[tuple[int | str, Material, PETSc.Mat]]:
        """[(owner, material, K)] of materials with the property `name`; owner: index in `parts`, or
        group of the stiffener; K: stiffness of the cells of the material, 0 at fixed dofs."""
        result: list[tuple[int | str, Material, PETSc.Mat]] = []
        for number, (material, cells) in enumerate(self.parts):
            if getattr(material, name, None):
                forms = restricted_forms(self.form.stiffness, self.mesh, cells)
                K = compat.assemble(forms, self.form.space, self.conditions, 0.0)
                result.append((number, material, K))

        for group, lines in self.stiffeners.items():
            beam = lines.parts[0][0]
            if getattr(beam, name, None):
                result.append((group, beam, lines.K.ptap(lines.sheet_to_beams)))

        return result

    def describe(self, dofs: int) -> str:
        family = " and ".join(sorted({type(material).__name__ for material, _ in self.parts}))
        return (
            f"{self.mesh.name}: {self.mesh.n_cells} {self.mesh.cell} cells, {family}, "
            f"{dofs} dofs, {self.rigid_modes.shape[1]} rigid-body modes{self.prestress_text}"
        )


def beams_alone(stiffener: Stiffener) -> MeshedStructure:
    """The beams of a stiffener as a separate structure, for results at its cells."""
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
        reassembled=lambda *_: beams_alone(stiffener),
    )


#: Thickness of a solid over its size up to which it deflects by half of it before it breaks.
THIN_SHARE = 0.1
#: Deviation from a line of points that lie on it, over the size of the part.
LINE_TOLERANCE = 1e-6


def cells_and_stiffeners(
    mesh: Mesh, material: object
) -> tuple[object, list[tuple[str, Beam, IntArray]]]:
    """(material of the cells, for `parts_of`; [(group, beam, local edges)] of beams on edges)."""
    if not isinstance(material, Mapping) or mesh.tdim != 2:
        return material, []

    beams = {name: item for name, item in material.items() if isinstance(item, Beam)}
    if not beams:
        return material, []

    cells = {name: item for name, item in material.items() if name not in beams}
    if not cells or not all(_family(item).kind.sheet for item in cells.values()):
        raise InputError(
            f"a Beam on edges (group {next(iter(beams))!r}) stiffens a shell: give the cells of "
            f"{mesh.name} a Shell or Laminate; a frame of beams alone needs a mesh of lines."
        )

    on_edges = []
    for name, beam in beams.items():
        edges = mesh.group(name).get(1)
        if edges is None:
            raise InputError(
                f"group {name!r} holds no edges of the sheet's cells: put its lines in the surface."
            )
        on_edges.append((name, beam, edges))

    return cells, on_edges


def parts_of(mesh: Mesh, material: object) -> Parts:
    """[(material, cells of this rank, ghosts included)]; InputError unless every cell has one."""
    imap = compat.cell_index_map(mesh.dolfinx)
    n_cells = imap.size_local + imap.num_ghosts
    if not isinstance(material, Mapping):
        return [(_family(material), np.arange(n_cells, dtype=np.int32))]
    if not material:
        raise InputError("material is an empty dict: give {group name: material}.")

    times = np.zeros(n_cells, dtype=int)
    parts: list[tuple[Family, IntArray]] = []
    for name, value in material.items():
        family = _family(value)
        cells = mesh.group(name).get(mesh.tdim)
        if cells is None:
            raise InputError(f"group {name!r} holds no cells (dimension {mesh.tdim}).")
        times[cells] += 1
        parts.append((family, cells))

    if len({family.kind for family, _ in parts}) > 1:
        raise InputError(
            "materials of a structure are of one family: Solid, Beam, Truss, or Shell and Laminate."
        )

    uncovered = mesh.comm.allreduce(int(np.sum(times[: imap.size_local] == 0)))
    repeated = mesh.comm.allreduce(int(np.sum(times[: imap.size_local] > 1)))
    if uncovered or repeated:
        raise InputError(
            f"every cell needs one material: of {mesh.n_cells} cells {uncovered} have none and "
            f"{repeated} more than one; the groups named are {', '.join(map(repr, material))}."
        )

    return parts


def _family(material: object) -> Family:
    """The `material` itself; InputError if it is not one."""
    if isinstance(material, type) or not isinstance(material, Family):
        raise InputError(
            "material must be a Solid, Shell, Laminate, Beam or Truss, or a dict of them; got "
            f"{type(material).__name__}."
        )
    return material


def assembled_part(
    mesh: Mesh,
    material: Family | Mapping[str, Family],
    supports: Sequence[Support],
    *,
    order: int,
    attached: Sequence[Attachment],
    solver: SolverChoice,
) -> MeshedStructure:
    """The matrices of a mesh; parameters and errors are those of `Structure`."""
    if not isinstance(mesh, Mesh):
        raise InputError(f"mesh must come from read_mesh; got {type(mesh).__name__}.")
    order = whole("order", order)
    if order not in (1, 2):
        raise InputError(f"order must be 1 or 2; got {order}.")
    checked_choice(solver)
    checked_supports = list_of("supports", supports, Support, "Support(where, fix)")
    attachments = attachments_of(attached)

    cells, beams = cells_and_stiffeners(mesh, material)
    parts = parts_of(mesh, cells)
    materials = [*(entry for entry, _ in parts), *(beam for _, beam, _ in beams)]
    doubts = plausible.warn_each(
        [
            plausible.size_doubt(mesh.extent(), mesh.stated, mesh.tdim == 1),
            *map(plausible.material_doubt, materials),
        ]
    )

    form = parts[0][0].weak_form(mesh, parts, order)
    conditions = fixed_dofs(mesh, form, checked_supports)
    rows = compat.local_size(form.space)
    fixed = np.unique(np.concatenate([NO_DOFS, *conditions.values()]))
    if mesh.comm.allreduce(rows - int((fixed < rows).sum())) == 0:
        raise InputError("the supports fix every dof of the structure: nothing can move.")

    with doing(f"assembly of {mesh.n_cells} cells"):
        by_cells = cellwise_tetrahedra(mesh, form, parts, conditions)
        if by_cells is not None:
            K = cell_matrix(by_cells, 1.0, 0.0)
            M = cell_matrix(by_cells, 0.0, 1.0)
        else:
            K = compat.assemble(form.stiffness, form.space, conditions, 1.0)
            M = compat.assemble(form.mass, form.space, conditions, 0.0)

    # what is added to K, apart where K is taken by its strains or its cells
    added_to_K, added_to_M = (K, M) if by_cells is None else by_cells.added
    if form.strains is not None:
        added_to_K = K.duplicate()
        added_to_K.zeroEntries()

    lines = {name: beams_on(mesh, form, fixed, name, beam, edges) for name, beam, edges in beams}
    kind = PETSc.Mat.Structure.SUBSET_NONZERO_PATTERN
    for beam in lines.values():
        added_to_K.axpy(1.0, beam.K.ptap(beam.sheet_to_beams), structure=kind)
        added_to_M.axpy(1.0, beam.M.ptap(beam.sheet_to_beams), structure=kind)

    places = partial(attachment_motions, mesh, form, fixed)
    plane = "z" not in form.components
    terms = [term for one in attachments for term in terms_of(one, plane, places)]
    for term in terms:
        add_projected(added_to_K, term.G, term.k.diagonal())
        add_projected(added_to_M, term.G, term.m.diagonal())

    if form.strains is not None:
        strains, degree = form.strains
        S = compat.strain_matrix(strains, degree, form.space, conditions)
        K.axpy(1.0, added_to_K, structure=PETSc.Mat.Structure.SAME_NONZERO_PATTERN)
        first, last = added_to_K.getOwnershipRange()
        for dof in fixed[fixed < last - first]:
            added_to_K.setValue(first + dof, first + dof, 1.0)
        added_to_K.assemble()
        use_strain_product(K, S, added_to_K)  # SᵀS + rest

    if by_cells is None:
        M = without_zeros(M)
    else:
        by_cells.carries = bool(attachments)

    mass = compat.integrate(form.density * measure(mesh, 5), mesh.dolfinx)
    mass += sum(term.mass for term in terms) + sum(beam.mass for beam in lines.values())
    inertia = sum((beam.inertia for beam in lines.values()), np.zeros((rows, 3)))
    for term in terms:
        inertia += term.G.T @ term.m @ [UNIT_MOTIONS[name][:3] for name in term.components]

    springs = [term.G.toarray().T for term in terms if term.k.any()]
    resisted = np.column_stack([np.zeros((rows, 0)), *springs])
    modes, shift = support.modes_and_shift(form, fixed, K, M, resisted)
    if conditions and modes.shape[1]:
        warn(
            mesh.comm,
            f"the supports leave the structure free to move as a rigid body ({modes.shape[1]} "
            "motions): hold that too unless it is intended.",
        )

    materials_by_group = dict(material) if isinstance(material, Mapping) else material

    def reassembled(copy: Mesh, supports: Sequence[Support] = checked_supports) -> MeshedStructure:
        return assembled_part(
            copy, materials_by_group, supports, order=order, attached=attachments, solver=solver
        )

    thickness, along_line = _thickness_and_line_support(
        mesh, form, fixed, [entry for entry, _ in parts]
    )

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
        attached_inertia=inertia,
        reassembled=reassembled,
        supports=checked_supports,
        stiffeners=lines,
        dampers=[damper for term in terms for damper in term.dampers(term.G)],
        conditions=conditions,
        doubts=doubts,
        thickness=None if along_line else thickness,
    )


def _thickness_and_line_support(
    mesh: Mesh, form: WeakForm, fixed: IntArray, materials: Sequence[Material]
) -> tuple[float | None, bool]:
    """(thickness [m] of a sheet or thin solid, else None; whether its supports lie on one line)."""
    sheet = materials[0].kind.sheet
    if sheet:
        thickness = float(min(material.section.thickness for material in materials))
        wide = LINE_TOLERANCE * mesh.extent()
    else:
        thickness = wide = mean_thickness(mesh) if mesh.tdim == 3 else 0.0
        if not 0 < thickness <= THIN_SHARE * mesh.extent():
            return None, False

    nodes = np.unique(fixed // form.space.dofmap.index_map_bs)
    x = np.vstack(mesh.comm.allgather(form.space.tabulate_dof_coordinates()[nodes]))
    extents = np.linalg.svd(x - x.mean(axis=0), compute_uv=False) if len(x) else np.ones(2)
    return thickness, bool(extents[1:].sum() <= wide * (1.0 if sheet else np.sqrt(len(x))))
