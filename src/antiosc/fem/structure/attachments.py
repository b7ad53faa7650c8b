"""Attachments of a structure: masses, springs, dampers; beams along edges.

They have no dofs: they are sums of m b bᵀ, bᵀu being one displacement component of a point.

A beam along edges is assembled on a mesh of these, whose dofs are dofs of the sheet: K + Tᵀ K_beam
T.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import dolfinx
import numpy as np
import scipy.sparse
import scipy.spatial
from petsc4py import PETSc

from antiosc.base._types import Array, IntArray
from antiosc.base.checks import (
    Checked,
    checked_by,
    coordinates,
    floats,
    list_of,
    nonnegative,
    point_text,
    positive,
    shown,
    text,
)
from antiosc.base.errors import InputError
from antiosc.fem.elements.beam import Beam, on_lines
from antiosc.fem.elements.weak_form import Parts, WeakForm
from antiosc.fem.linalg.algebra import multiply
from antiosc.fem.mesh import Mesh
from antiosc.fem.mesh.closest import ClosestPoint, closest
from antiosc.fem.platform import agree, compat
from antiosc.fem.structure import Dissipation, in_space
from antiosc.io.matrices import COMPONENTS

#: A point this share of the size off the structure, as by a curved mesh, is moved onto it.
NEAR = 1e-3


def _checked_where(_: str, where: object) -> str | tuple[float, ...]:
    """A group's name, or coordinates."""
    if isinstance(where, str):
        return where
    return coordinates("where, if no group's name,", where)


#: The name that a user gives to an attachment.
NAME = checked_by(text)


def _checked_inertia(name: str, value: object) -> float | tuple[float, ...]:
    values = floats(name, value, None)
    if values.shape not in ((), (3,)) or (values < 0).any():
        raise InputError(
            f"inertia must be >= 0, one number or three (in kg m²); got {shown(value)}."
        )
    if values.ndim:
        return tuple(values.tolist())
    return float(values)


def by_components(
    name: str, values: object, kind: str, allowed: Sequence[str] = COMPONENTS
) -> dict[str, float]:
    """Checked values > 0 by component: the stiffness or damping of a `kind`."""
    if not isinstance(values, Mapping):
        raise InputError(f"the {name} of a {kind} is a dict, as {{'z': 1e6}}; got {shown(values)}.")
    for component in values:
        if component not in allowed:
            raise InputError(
                f"a {kind} acts on {', '.join(allowed)}; {shown(component)} is not one of them."
            )
    return {
        component: positive(f"the {name} along {component}", value)
        for component, value in values.items()
    }


def _some_components(name: str, values: object, kind: str) -> dict[str, float]:
    by_component = by_components(name, values, kind)
    if not by_component:
        raise InputError(f"a {kind} needs a {name}, as in {kind}(where, {{'z': 1e5}}).")
    return by_component


@dataclass(frozen=True)
class PointMass(Checked):
    """A rigid mass at a point, such as a motor on a panel.

    Parameters
    ----------
    where : str or sequence of floats
        A group of points of the mesh (each of them carries one such mass), or coordinates in m
        of any point of the structure.
    mass : float
        kg.
    inertia : float or sequence of 3 floats
        Moments of inertia about x, y and z, kg m²; on beams and shells.
    """

    where: str | Sequence[float] = field(metadata=checked_by(_checked_where))
    mass: float = field(metadata=checked_by(nonnegative, "kg"))
    inertia: float | Sequence[float] = field(default=0.0, metadata=checked_by(_checked_inertia))

    def __post_init__(self) -> None:
        super().__post_init__()
        if self.mass == 0 and not np.any(self.inertia):
            raise InputError("a PointMass needs a mass or an inertia; both are 0.")

    def values(self) -> dict[str, float]:
        """Component -> mass or inertia."""
        inertia = np.broadcast_to(self.inertia, (3,)).tolist()
        return dict(zip(COMPONENTS, [*[self.mass] * 3, *inertia], strict=True))


@dataclass(frozen=True)
class Spring(Checked):
    """A spring from a point of the structure to the ground.

    Parameters
    ----------
    where : str or sequence of floats
        As for `PointMass`.
    stiffness : dict
        Component -> stiffness: of "x", "y", "z" (N/m), "rx", "ry", "rz" (N m/rad).
    name : str, optional
        Name of its force in `reactions`; default: "spring 1" and on.
    """

    where: str | Sequence[float] = field(metadata=checked_by(_checked_where))
    stiffness: Mapping[str, float] = field(metadata=checked_by(_some_components, "Spring"))
    name: str | None = field(default=None, kw_only=True, metadata=NAME)


@dataclass(frozen=True)
class Damper(Checked):
    """A damper from a point of the structure to the ground, or to another point of it.

    Models have it exactly, however strong it is: their damping is a `DampingMatrix`.

    Parameters
    ----------
    where : str or sequence of floats
        As for `PointMass`.
    damping : dict
        Component -> damping: of "x", "y", "z" (N s/m), "rx", "ry", "rz" (N m s/rad).
    to : sequence of floats, optional
        The other end, m; None: the ground.
    tau : float, optional
        The damper is in series with a spring of stiffness damping/tau (N/m), so that it relaxes in
        this time, s (Maxwell).
    name : str, optional
        Name of its force in `reactions`, where it acts on the ground; default: "damper 1" and on.
    """

    where: str | Sequence[float] = field(metadata=checked_by(_checked_where))
    damping: Mapping[str, float] = field(metadata=checked_by(_some_components, "Damper"))
    to: Sequence[float] | None = field(default=None, metadata=checked_by(coordinates))
    tau: float | None = field(default=None, metadata=checked_by(positive, "s"))
    name: str | None = field(default=None, kw_only=True, metadata=NAME)

    @property
    def values(self) -> dict[str, float]:
        """Component -> damping; for a relaxing damper, stiffness."""
        return {name: c / (self.tau or 1.0) for name, c in self.damping.items()}


#: What a structure carries at points.
Attachment = PointMass | Spring | Damper


def attachments_of(attached: object) -> list[Attachment]:
    """Checked attachments; names for springs and dampers."""
    expected = "PointMass, Spring and Damper objects"
    attachments: list[Any] = list(
        list_of("attached", attached, (PointMass, Spring, Damper), expected)
    )

    for kind in (Spring, Damper):
        of_kind = np.flatnonzero([type(attachment) is kind for attachment in attachments])
        for number, k in enumerate(of_kind, start=1):
            if attachments[k].name is None:
                attachments[k] = replace(attachments[k], name=f"{kind.__name__.lower()} {number}")
    return attachments


def damper_to_itself(damper: Damper) -> str:
    """Message for a damper between two coincident points."""
    return (
        f"the Damper at {shown(damper.where)} ends at the point where it begins,"
        f" {shown(damper.to)}: it brakes nothing; name another point, or leave to= out for the"
        " ground."
    )


def values_of(attachment: PointMass | Spring | Damper, plane: bool) -> dict[str, float]:
    """Component -> mass, stiffness or damping; stiffness for a damper that relaxes.

    A mass on a `plane` structure has none along z, nor about x and y.
    """
    if isinstance(attachment, Spring):
        return dict(attachment.stiffness)
    if isinstance(attachment, Damper):
        return attachment.values
    names = ("x", "y", "rz") if plane else COMPONENTS
    return {name: value for name, value in attachment.values().items() if value and name in names}


@dataclass(frozen=True)
class Matrices:
    """The matrices of a structure, and the data that attachments need to change them in place."""

    mesh: Mesh
    form: WeakForm
    K: PETSc.Mat
    M: PETSc.Mat
    #: dofs of this rank, ghosts included, that the supports hold
    fixed: IntArray


@dataclass(frozen=True)
class AttachedTerms:
    """Contributions of attachments other than K and M, which the structure sums."""

    #: kg
    mass: float
    #: M e for unit accelerations e along x, y, z, of the attachment alone (rows of this rank, 3)
    inertia: Array
    springs: Sequence[Dissipation] = ()
    dampers: Sequence[Dissipation] = ()


def add_at_points(structure: Matrices, attachment: PointMass | Spring | Damper) -> AttachedTerms:
    """Add a mass or a spring at its points to K and M, or a damper to the damping terms."""
    values = values_of(attachment, plane="z" not in structure.form.components)
    foreign = [component for component in values if component not in structure.form.components]
    if foreign:
        raise InputError(
            f"{type(attachment).__name__} at {attachment.where!r} acts on {', '.join(foreign)}, but"
            f" the components of this structure are {', '.join(structure.form.components)}."
        )
    matrix = None
    if isinstance(attachment, PointMass):
        matrix = structure.M
    elif isinstance(attachment, Spring):
        matrix = structure.K
    points = _attachment_points(structure.mesh, attachment.where)
    rows = compat.local_size(structure.form.space)
    mass = 0.0
    inertia = np.zeros((rows, 3))
    centre = np.mean([nearest.x for nearest in points], axis=0)
    terms = [
        (component, value, _add_component(structure, matrix, component, nearest, value))
        for nearest in points
        for component, value in values.items()
    ]
    if matrix is not None:
        matrix.assemble()
    diagonal = np.diag([value for _, value, _ in terms])
    if isinstance(attachment, Damper):
        ground = [] if attachment.to is None else _attachment_points(structure.mesh, attachment.to)
        if ground and any(np.allclose(ground[0].x, nearest.x) for nearest in points):
            raise InputError(damper_to_itself(attachment))
        ends = {c: _add_component(structure, None, c, end, 0.0) for end in ground for c in values}
        G = [b - ends[c] if ends else b for c, _, b in terms]
        name = "" if ends else str(attachment.name)
        damper = Dissipation(
            _functionals(G, rows), diagonal, attachment.tau, name=name, point=centre
        )
        return AttachedTerms(mass, inertia, dampers=[damper])
    if isinstance(attachment, Spring):
        G = [b for _, _, b in terms]
        name = str(attachment.name)
        spring = Dissipation(_functionals(G, rows), diagonal, name=name, point=centre)
        return AttachedTerms(mass, inertia, [spring])
    for component, value, b in terms:
        if component in "xyz":
            inertia[:, "xyz".index(component)] += value * b
    return AttachedTerms(attachment.mass * len(points), inertia)


def _functionals(b: Sequence[Array], rows: int) -> scipy.sparse.csr_matrix:
    return scipy.sparse.csr_matrix(np.array(b).reshape(len(b), rows))


def _add_component(
    structure: Matrices,
    matrix: PETSc.Mat | None,
    component: str,
    nearest: ClosestPoint,
    value: float,
) -> Array:
    """Add value·b bᵀ to `matrix`, where bᵀu is a displacement component of a point.

    Returns b (rows of this rank).
    """
    path = structure.form.components[component]
    vector = structure.K.createVecRight()
    if structure.mesh.comm.rank == nearest.rank:
        dofs = compat.subspace(structure.form.space, path).dofmap.cell_dofs(nearest.cell)
        weights = compat.tabulate(structure.form.space, path, nearest.X.reshape(1, -1))[0]
        weights = np.where(np.isin(dofs, structure.fixed), 0.0, weights)
        rows = compat.global_dofs(structure.form.space, dofs)
        add = PETSc.InsertMode.ADD_VALUES
        if matrix is not None:
            matrix.setValues(rows, rows, value * np.outer(weights, weights), addv=add)
        vector.setValues(rows, weights, addv=add)
    vector.assemble()
    b = np.array(vector.array_r)
    vector.destroy()
    return b


def _attachment_points(mesh: Mesh, where: str | Sequence[float]) -> list[ClosestPoint]:
    if not isinstance(where, str):
        if len(where) < mesh.gdim:
            raise InputError(
                f"the point {point_text(np.array(where))} of a mass, spring or damper has"
                f" {len(where)} coordinates, and {mesh.name} lives in space: give x, y and z."
            )
        nearest = closest(mesh, in_space(where))
        if nearest.distance > NEAR * mesh.extent():
            raise InputError(
                f"the point {point_text(where)} of a mass, spring or damper is "
                f"{nearest.distance:.3g} m off the structure; its nearest point is "
                f"{point_text(nearest.x)}."
            )
        return [nearest]
    group = mesh.group(where)
    if set(group) != {0}:
        raise InputError(
            f"group {where!r} must hold points alone to carry masses or springs; it holds "
            f"entities of dimension {', '.join(str(dim) for dim in sorted(group))}."
        )
    owned = mesh.dolfinx.topology.index_map(0).size_local
    owned_nodes = group[0][group[0] < owned]
    x = mesh.dolfinx.geometry.x[compat.entity_vertices(mesh.dolfinx, 0)[owned_nodes, 0]]
    points = np.vstack(mesh.comm.allgather(x))
    return [closest(mesh, point) for point in points]


#: Dofs of a beam and of the sheet are the same within this share of the beam's extent.
SAME_DOF = 1e-7


@dataclass(frozen=True)
class Stiffener:
    """Beams on edges of a sheet, as a part with dofs besides those of the sheet."""

    mesh: Mesh
    form: WeakForm
    #: the beam and its cells of this rank, ghosts included
    parts: Parts
    K: PETSc.Mat
    M: PETSc.Mat
    #: T of beam dofs = T · sheet dofs
    shared: PETSc.Mat

    def rows_of(self, columns: Array) -> Array:
        """Motions (beam rows of this rank, k) of the beams' dofs, for those of the sheet."""
        return multiply(self.shared, columns)


def add_beams(
    structure: Matrices, name: str, beam: Beam, edges: IntArray
) -> tuple[AttachedTerms, Stiffener]:
    """Add `beam` on the `edges` of a sheet, entities of this rank in the group `name`."""
    if structure.mesh.cell == "quadrilateral" and structure.mesh.order > 1:
        raise InputError(
            f"beams on curved quadrilaterals (group {name!r}): these are too soft under the pull "
            "of a stiffener if they are thinner than their rise; mesh the surface with triangles."
        )
    if not beam.shear:
        raise InputError(
            f"stiffeners (group {name!r}) deform in shear with their shell: shear=False is for "
            "beams without a shell only."
        )
    line = _edge_mesh(structure.mesh, edges, f"the edges of group {name!r}")
    cells = compat.cell_map(line.dolfinx)
    parts = [(beam, np.arange(cells.size_local + cells.num_ghosts, dtype=np.int32))]
    form = on_lines(line, parts, 3 if structure.mesh.cell == "triangle" else 2, on_sheet=True)
    T = _shared_dofs(structure, edges, form, line)
    matrices = [
        compat.assemble(forms, form.space, {}, 0.0) for forms in (form.stiffness, form.mass)
    ]
    kind = PETSc.Mat.Structure.SUBSET_NONZERO_PATTERN
    for matrix, beam_matrix in zip((structure.K, structure.M), matrices, strict=True):
        matrix.axpy(1.0, beam_matrix.ptap(T), structure=kind)
    directions = np.zeros((compat.local_size(form.space), 3))
    for axis, component in enumerate("xyz"):
        dofs, _ = compat.dof_coordinates(form.space, form.components[component])
        directions[dofs[dofs < len(directions)], axis] = 1.0
    inertia = multiply(matrices[1], directions)
    mass = line.comm.allreduce(float(directions[:, 0] @ inertia[:, 0]))
    on_sheet = multiply(T.transpose(PETSc.Mat()), inertia)
    return AttachedTerms(mass, on_sheet), Stiffener(line, form, parts, matrices[0], matrices[1], T)


#: Corners of the edges of a cell, in dolfinx's order; mid-side nodes follow the corners.
SHEET_EDGES = {
    "triangle": ((1, 2), (0, 2), (0, 1)),
    "quadrilateral": ((0, 1), (0, 2), (1, 3), (2, 3)),
}


def _edge_mesh(mesh: Mesh, edges: IntArray, name: str) -> Mesh:
    """A mesh in space of some edges, curved as they are in the sheet."""
    topology = mesh.dolfinx.topology
    topology.create_connectivity(1, 2)
    topology.create_connectivity(2, 1)
    owned_edges = edges[edges < topology.index_map(1).size_local]
    nodes = np.zeros((len(owned_edges), mesh.order + 1), dtype=np.int64)
    of_cell = compat.geometry_nodes(mesh.dolfinx)
    table = SHEET_EDGES[mesh.cell]
    for row, edge in enumerate(owned_edges):
        cell = topology.connectivity(1, 2).links(edge)[0]
        local = int(np.flatnonzero(topology.connectivity(2, 1).links(cell) == edge)[0])
        positions = [*table[local], len(table) + local][: mesh.order + 1]
        nodes[row] = of_cell[cell][positions]
    x = np.zeros((len(mesh.dolfinx.geometry.x), 3))
    x[:] = mesh.dolfinx.geometry.x
    numbers = np.asarray(mesh.dolfinx.geometry.input_global_indices)[nodes]
    everywhere = mesh.comm.allgather((numbers, x[nodes]))
    numbers = np.vstack([arrays for arrays, _ in everywhere])
    points = np.concatenate([arrays for _, arrays in everywhere])
    _, first, cells = np.unique(numbers.ravel(), return_index=True, return_inverse=True)
    cells = cells.reshape(numbers.shape)
    points = points.reshape(-1, 3)[first]
    if mesh.comm.rank:
        cells = cells[:0]
        points = points[:0]
    line = compat.create_mesh(mesh.comm, cells, points, "interval", mesh.order)
    return Mesh(line, {}, name)


def _shared_dofs(structure: Matrices, edges: IntArray, form: WeakForm, line: Mesh) -> PETSc.Mat:
    """Matrix T of beam dofs = T · shell dofs; the rows of fixed dofs are empty."""
    sheet = structure.form.space
    block = len(form.components)  # dofs of a node, of the beam and of the sheet
    components = np.arange(block)

    first = compat.subspace(sheet, structure.form.components["x"])
    nodes = np.asarray(dolfinx.fem.locate_dofs_topological(first, 1, edges)) // block
    dofs = block * nodes[:, None] + components
    numbers = compat.global_dofs(sheet, dofs.ravel()).reshape(dofs.shape)
    x = sheet.tabulate_dof_coordinates()[nodes]
    of_ranks = structure.mesh.comm.allgather((x, numbers, np.isin(dofs, structure.fixed)))
    x, numbers, fixed = map(np.concatenate, zip(*of_ranks, strict=True))

    rows = compat.local_size(form.space)
    points = form.space.tabulate_dof_coordinates()[: rows // block]
    distance, nearest = scipy.spatial.cKDTree(x).query(points)
    error = None
    if distance.max(initial=0.0) > SAME_DOF * line.extent():
        error = InputError(f"{line.name} do not carry the dofs of the sheet.")
    agree(structure.mesh.comm, error)

    T = PETSc.Mat().createAIJ(
        ((rows, None), (compat.local_size(sheet), None)), nnz=1, comm=structure.mesh.comm
    )
    first_row, _ = T.getOwnershipRange()
    for node, k in enumerate(nearest):
        for component in components[~fixed[k]]:
            T.setValue(first_row + block * node + component, numbers[k, component], 1.0)
    T.assemble()
    return T
