"""Attachments of a structure: masses, springs, dampers; beams along edges.

Attachments at points add no dofs, only terms such as m b bᵀ, where bᵀu is a displacement component
of the point.

Beams on edges of a shell have a mesh of these edges; their dofs T u are some of the shell's dofs u,
so that K becomes K + Tᵀ K_beam T.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
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
from antiosc.fem.elements.beam import Beam, line_weak_form
from antiosc.fem.elements.weak_form import Parts, WeakForm
from antiosc.fem.linalg.algebra import multiply
from antiosc.fem.mesh import Mesh
from antiosc.fem.mesh.surface import cells_at, closest, owned_entities
from antiosc.fem.platform import compat, raise_on_all
from antiosc.fem.structure import Dissipation, in_space
from antiosc.fem.structure.loads import SNAP_SHARE, PointMotion, Sparse, motion_at
from antiosc.fem.structure.support import places_of
from antiosc.io.matrices import COMPONENTS


def _checked_where(_: str, where: object) -> str | tuple[float, ...]:
    """A group's name, or coordinates."""
    if isinstance(where, str):
        return where
    return coordinates("where, if no group's name,", where)


#: The name that a user gives to an attachment or a joint.
NAME_CHECK = checked_by(text)


def _checked_inertia(name: str, value: object) -> float | tuple[float, ...]:
    """One or three moments of inertia >= 0 [kg m²], checked."""
    values = floats(name, value, None)
    if values.shape not in ((), (3,)) or (values < 0).any():
        raise InputError(f"inertia must be >= 0, one number or three [kg m²]; got {shown(value)}.")
    if values.ndim:
        return tuple(values.tolist())
    return float(values)


def checked_components(
    name: str, values: object, kind: str, allowed: Sequence[str] = COMPONENTS
) -> dict[str, float]:
    """Checked values > 0 by component; `kind`: class of the attachment, for messages."""
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
    """As `checked_components`; InputError for an empty dict."""
    by_component = checked_components(name, values, kind)
    if not by_component:
        raise InputError(f"a {kind} needs a {name}, as in {kind}(where, {{'z': 1e5}}).")
    return by_component


@dataclass(frozen=True)
class PointMass(Checked):
    """A rigid mass at a point, such as a motor on a panel.

    Parameters
    ----------
    where : str or sequence of floats
        A group of points of the mesh (each point gets this mass), or coordinates in m of any point
        of the structure.
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


@dataclass(frozen=True)
class Spring(Checked):
    """A spring from a point of the structure to the ground.

    Parameters
    ----------
    where : str or sequence of floats
        As for `PointMass`.
    stiffness : dict
        Component -> stiffness; components are "x", "y", "z" (N/m), "rx", "ry", "rz" (N m/rad).
    name : str, optional
        Name of the spring; default: "spring 1", "spring 2", ….
    """

    where: str | Sequence[float] = field(metadata=checked_by(_checked_where))
    stiffness: Mapping[str, float] = field(metadata=checked_by(_some_components, "Spring"))
    name: str | None = field(default=None, kw_only=True, metadata=NAME_CHECK)


@dataclass(frozen=True)
class Damper(Checked):
    """A damper from a point of the structure to the ground, or to another point of it.

    Models contain it exactly, however strong it is, in a `DampingMatrix`.

    Parameters
    ----------
    where : str or sequence of floats
        As for `PointMass`.
    damping : dict
        Component -> damping; components are "x", "y", "z" (N s/m), "rx", "ry", "rz" (N m s/rad).
    to : sequence of floats, optional
        The other end, m; None: the ground.
    tau : float, optional
        Relaxation time, s: the damper is in series with a spring of stiffness damping/tau
        (Maxwell element).
    name : str, optional
        Name of the damper; default: "damper 1", "damper 2", ….
    """

    where: str | Sequence[float] = field(metadata=checked_by(_checked_where))
    damping: Mapping[str, float] = field(metadata=checked_by(_some_components, "Damper"))
    to: Sequence[float] | None = field(default=None, metadata=checked_by(coordinates))
    tau: float | None = field(default=None, metadata=checked_by(positive, "s"))
    name: str | None = field(default=None, kw_only=True, metadata=NAME_CHECK)


#: What a structure carries at points.
Attachment = PointMass | Spring | Damper


def attachments_of(attached: object) -> list[Attachment]:
    """Checked attachments; unnamed springs and dampers get a name."""
    expected = "PointMass, Spring and Damper objects"
    attachments: list[Any] = list_of("attached", attached, (PointMass, Spring, Damper), expected)

    for kind in (Spring, Damper):
        of_kind = np.flatnonzero([type(attachment) is kind for attachment in attachments])
        for number, k in enumerate(of_kind, start=1):
            if attachments[k].name is None:
                attachments[k] = replace(attachments[k], name=f"{kind.__name__.lower()} {number}")

    return attachments


@dataclass(frozen=True, eq=False)
class ElasticTerm:
    """Stiffness k, damping c and mass m on functionals G: Gᵀ k G is a term of K, Gᵀ m G of M."""

    G: Sparse  # (j, n) functionals of u, the n dofs of this rank
    #: k, m: (j, j) stiffness and mass for the j functionals
    k: Array
    m: Array
    mass: float = 0.0  # what it adds to the total mass [kg]
    c: Array | None = None  # (j, j) damping
    #: (j, r) orthonormal values of the functionals in strain-free motions; None: not known
    rigid: Array | None = None
    #: stiffnesses (j, j) and relaxation times [s] of Maxwell branches
    branches: Sequence[tuple[Array, float]] = ()
    name: str = ""  # of the joint or attachment
    components: Sequence[str] = ()  # of an attachment, "x" to "rz", one for each functional

    @property
    def strains(self) -> Array:
        """Orthonormal combinations (r, functionals) of G u that vanish in strain-free motions."""
        if self.rigid is not None:
            basis, _ = np.linalg.qr(self.rigid, mode="complete")
            return np.asarray(basis[:, self.rigid.shape[1] :].T)

        nonzero_rows = np.flatnonzero(np.diff(self.G.indptr))
        values, vectors = np.linalg.eigh(self.k[np.ix_(nonzero_rows, nonzero_rows)])
        vectors = vectors[:, values > 1e-12 * max(values[-1], np.finfo(float).tiny)]
        strains = np.zeros((vectors.shape[1], len(self.k)))
        strains[:, nonzero_rows] = vectors.T
        return strains

    def dampers(self, G: Sparse) -> list[Dissipation]:
        """Dashpots and Maxwell branches of this term, acting on the functionals `G`."""
        constants = [] if self.c is None else [(self.c, None)]
        return [Dissipation(G, c, tau) for c, tau in [*constants, *self.branches]]


def terms_of(
    attached: Attachment,
    plane: bool,
    places: Callable[[str | Sequence[float]], Sequence[PointMotion]],
) -> list[ElasticTerm]:
    """Terms of an attachment, one for each point where it acts. `places(where)`: motions of these
    points; `plane`: masses act in x, y, rz alone. InputError for components that a point lacks."""
    if isinstance(attached, PointMass):
        inertia = np.broadcast_to(attached.inertia, (3,)).tolist()
        values = dict(zip(COMPONENTS, [*[attached.mass] * 3, *inertia], strict=True))
        names = [name for name in (("x", "y", "rz") if plane else COMPONENTS) if values[name]]
    else:
        values = dict(attached.stiffness if isinstance(attached, Spring) else attached.damping)
        names = list(values)
    diagonal = np.diag([values[name] for name in names])
    zero = np.zeros_like(diagonal)
    kind = type(attached).__name__
    other = None
    if isinstance(attached, Damper) and attached.to is not None:
        other = places(attached.to)[0]

    terms = []
    for end in places(attached.where):
        if lacking := end.lacking(names):
            raise InputError(
                f"{kind} at {attached.where!r} acts on {', '.join(lacking)}, which this point does "
                "not have: act on a group, or on a reference point of an assembly."
            )
        G = end.components(names)
        if other is not None:
            if np.allclose(other.point, end.point):
                raise InputError(
                    f"the Damper at {shown(attached.where)} ends at the point where it begins: "
                    "name another point, or leave to= out for the ground."
                )
            G = G - other.components(names)
        name = "" if other is not None else getattr(attached, "name", None) or ""
        term = ElasticTerm(G, zero, zero, name=name, components=names)
        if isinstance(attached, PointMass):
            term = replace(term, m=diagonal, mass=attached.mass)
        elif isinstance(attached, Spring):
            term = replace(term, k=diagonal)
        elif attached.tau is None:
            term = replace(term, c=diagonal)
        else:
            term = replace(term, branches=[(diagonal / attached.tau, attached.tau)])
        terms.append(term)

    return terms


def add_projected(matrix: PETSc.Mat, G: Sparse, values: Array) -> None:
    """Add Gᵀ diag(values) G to the entries of a distributed matrix; `G` (j, rows of this rank),
    `values` (j,). Collective."""
    if not values.any():
        return
    comm = matrix.getComm().tompi4py()
    first, _ = matrix.getOwnershipRange()
    for row, value in zip(G, values, strict=True):
        everywhere = comm.allgather((first + row.indices, row.data))
        dofs, weights = map(np.concatenate, zip(*everywhere, strict=True))
        if comm.rank == 0:
            dofs = dofs.astype(PETSc.IntType)
            entries = value * np.outer(weights, weights)
            matrix.setValues(dofs, dofs, entries, addv=PETSc.InsertMode.ADD_VALUES)

    matrix.assemble()


def attachment_motions(
    mesh: Mesh, form: WeakForm, fixed: IntArray, where: str | Sequence[float]
) -> list[PointMotion]:
    """The motions of the points of a mesh at which an attachment acts, without `fixed` dofs (local
    numbers). InputError for a group of other entities, and points off the structure."""
    if isinstance(where, str):
        group = mesh.group(where)
        if set(group) != {0}:
            raise InputError(
                f"group {where!r} must hold points alone to carry masses or springs; it holds "
                f"entities of dimension {', '.join(str(dim) for dim in sorted(group))}."
            )
        owned_nodes = owned_entities(mesh, 0, group[0])
        x = mesh.dolfinx.geometry.x[compat.vertex_nodes(mesh.dolfinx, 0)[owned_nodes, 0]]
        points = np.vstack(mesh.comm.allgather(x))
    elif len(where) < mesh.gdim:
        raise InputError(
            f"the point {point_text(np.array(where))} of a mass, spring or damper has"
            f" {len(where)} coordinates, and {mesh.name} lives in space: give x, y and z."
        )
    else:
        points = in_space(where)[None]

    nearest = [closest(mesh, point) for point in points]
    for point, place in zip(points, nearest, strict=True):
        if place.distance > SNAP_SHARE * mesh.extent():
            raise InputError(
                f"the point {point_text(point)} of an attachment is {place.distance:.3g} m off the "
                f"structure; its nearest point is {point_text(place.x)}."
            )

    free = np.ones(compat.local_size(form.space))
    free[fixed[fixed < len(free)]] = 0.0
    motions = [motion_at(mesh.comm, form, place) for place in nearest]
    return [replace(one, functionals=one.functionals @ scipy.sparse.diags(free)) for one in motions]


#: Dofs of a beam and of the sheet are the same within this share of the beam's extent.
SAME_DOF_DISTANCE = 1e-7


@dataclass(frozen=True)
class Stiffener:
    """Beams on edges of a sheet: a mesh with dofs that depend linearly on the sheet's dofs."""

    mesh: Mesh
    form: WeakForm
    #: the beam and its cells of this rank, ghosts included
    parts: Parts
    #: K, M: stiffness and mass on the dofs of the beams
    K: PETSc.Mat
    M: PETSc.Mat
    #: T of beam dofs = T · sheet dofs
    sheet_to_beams: PETSc.Mat
    mass: float  # of the beams [kg]
    #: Tᵀ M e for unit accelerations e along x, y, z (rows of the sheet on this rank, 3)
    inertia: Array

    def rows_of(self, columns: Array) -> Array:
        """Motions (rows of the beams, k) of the beams when the sheet has the motions `columns`."""
        return multiply(self.sheet_to_beams, columns)


def beams_on(
    mesh: Mesh, sheet: WeakForm, fixed: IntArray, name: str, beam: Beam, edges: IntArray
) -> Stiffener:
    """The stiffener `beam` on `edges`, entities of this rank in the sheet's group `name`; `fixed`:
    local numbers of the sheet's fixed dofs."""
    if mesh.cell == "quadrilateral" and mesh.order > 1:
        raise InputError(f"beams on curved quadrilaterals (group {name!r}): use triangles.")
    if not beam.shear:
        raise InputError(
            f"stiffeners (group {name!r}) deform in shear with their shell: leave shear=False out."
        )

    line = _edge_mesh(mesh, edges, f"the edges of group {name!r}")
    cells = compat.cell_index_map(line.dolfinx)
    parts = [(beam, np.arange(cells.size_local + cells.num_ghosts, dtype=np.int32))]
    form = line_weak_form(line, parts, 3 if mesh.cell == "triangle" else 2, on_sheet=True)
    T = _shared_dofs(sheet, fixed, edges, form, line)
    K, M = (compat.assemble(forms, form.space, {}, 0.0) for forms in (form.stiffness, form.mass))
    directions = places_of(form).rigid_motions(np.zeros(3))[:, :3]
    loads = multiply(M, directions)
    mass = line.comm.allreduce(float(directions[:, 0] @ loads[:, 0]))
    inertia = multiply(T.transpose(PETSc.Mat()), loads)
    return Stiffener(line, form, parts, K, M, T, mass, inertia)


def _edge_mesh(mesh: Mesh, edges: IntArray, name: str) -> Mesh:
    """A mesh `name` in space of `edges`, local numbers, curved as they are in the sheet."""
    cell, number = cells_at(mesh, 1, owned_entities(mesh, 1, edges))
    between = [[*ends, middle] for ends, middle in compat.nodes_between(mesh.cell) if len(ends) < 3]
    places = np.array(between)[number, : mesh.order + 1]
    nodes = compat.geometry_nodes(mesh.dolfinx)[cell[:, None], places]

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


def _shared_dofs(
    form_of_sheet: WeakForm, fixed: IntArray, edges: IntArray, form: WeakForm, line: Mesh
) -> PETSc.Mat:
    """Matrix T of beam dofs = T · shell dofs; the rows of fixed dofs are empty."""
    sheet = form_of_sheet.space
    block = len(form.components)  # dofs of a node, of the beam and of the sheet
    components = np.arange(block)

    first = compat.subspace(sheet, form_of_sheet.components["x"])
    nodes = np.asarray(dolfinx.fem.locate_dofs_topological(first, 1, edges)) // block
    dofs = block * nodes[:, None] + components
    numbers = compat.global_dofs(sheet, dofs.ravel()).reshape(dofs.shape)
    x = sheet.tabulate_dof_coordinates()[nodes]
    of_ranks = line.comm.allgather((x, numbers, np.isin(dofs, fixed)))
    x, numbers, is_fixed = map(np.concatenate, zip(*of_ranks, strict=True))

    rows = compat.local_size(form.space)
    points = form.space.tabulate_dof_coordinates()[: rows // block]
    distance, nearest = scipy.spatial.cKDTree(x).query(points)
    error = None
    if distance.max(initial=0.0) > SAME_DOF_DISTANCE * line.extent():
        error = InputError(f"{line.name} do not carry the dofs of the sheet.")
    raise_on_all(line.comm, error)

    is_free = ~is_fixed[nearest]
    ends = np.append(0, np.cumsum(is_free)).astype(PETSc.IntType)
    columns = numbers[nearest][is_free].astype(PETSc.IntType)
    sizes = (rows, None), (compat.local_size(sheet), None)
    T = PETSc.Mat().createAIJ(sizes, csr=(ends, columns, np.ones(len(columns))), comm=line.comm)
    T.assemble()
    return T
