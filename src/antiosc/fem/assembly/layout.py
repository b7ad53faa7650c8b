"""The dofs of all parts of an assembly in one vector, before they are joined.

The vector u holds the dofs of parts with meshes, then of superelements (both in the axes of the
part), then six dofs (in the axes of the assembly) for each reference point. A linear functional of
u is a row of a sparse matrix with one column for each dof of u.

Superelements are models of several sites (the form of Craig and Bampton), or given matrices whose
nodes have coordinates. Joints act on the sites or nodes; other dofs are amplitudes of modes.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import TypeAlias

import numpy as np
import scipy.linalg
import scipy.sparse
import scipy.sparse.csgraph

from antiosc.base import checks
from antiosc.base._types import Array, BoolArray, IntArray
from antiosc.base.checks import coordinates, point_text, shown
from antiosc.base.errors import InputError, name_list
from antiosc.fem.linalg import algebra
from antiosc.fem.platform import compat
from antiosc.fem.structure import (
    AMPLITUDE,
    MOVE,
    TURN,
    DofPlaces,
    NodalMatrices,
    Placement,
    checked_placement,
    in_space,
)
from antiosc.fem.structure.loads import ROUNDED_VALUE, SNAP_SHARE, PointMotion, Sparse
from antiosc.fem.structure.meshed import Member, MeshedStructure
from antiosc.fem.structure.structure import Structure, on_mesh, refuse_prestress
from antiosc.io.matrices import DISPLACEMENTS
from antiosc.models.anti_oscillators import AntiOscillators, reduced_matrices

#: Most dofs: the matrices are dense, 32 MB each.
MOST_DENSE_DOFS = 2000
#: Fraction of the largest stiffness below which rounding, or the digits of coordinates, made it.
STIFFNESS_ROUNDING = 1e-7


@dataclass(frozen=True, eq=False)
class Superelement:
    """K and M (n, n) of a part, the meaning of each dof, and the motions of its points."""

    K: Array
    M: Array
    places: DofPlaces  # where and what its n dofs are
    #: of its sites by name, or of its nodes by number: motion, as functionals of its n dofs
    ends: Mapping[str, PointMotion]
    fixed: BoolArray  # (n,) dofs that are zero
    #: of each of its `ends`: patch radius [m] (None: a point), local compliance there [m/N]
    patches: Mapping[str, tuple[float | None, float]]
    rigid: Array | None = None  # (n, r) orthonormal rigid motions, on which K is exactly zero
    first: int = 0  # index of its first dof in u

    @property
    def rows(self) -> slice:
        """The superelement's dofs in the assembly's vector u."""
        return slice(self.first, self.first + len(self.K))

    @property
    def points(self) -> Array:
        """Coordinates (points, 3) [m] of the sites or nodes."""
        return np.array([end.point for end in self.ends.values()])

    def placed(self, at: Placement, first: int) -> Superelement:
        """This superelement at its place in an assembly; `first`: its first dof in u."""
        ends = {name: end.placed(at) for name, end in self.ends.items()}
        return replace(self, places=self.places.placed(at), ends=ends, first=first)


def model_superelement(name: str, model: AntiOscillators) -> Superelement:
    """The superelement of a model; InputError unless it has named sites and no damping."""
    points = model.info.points or {}
    direction = model.direction
    named = bool(model.sites) and set(points) == set(model.sites)
    if not named or direction is None or model.damping is not None:
        raise InputError(
            f"the part {name!r} must be a model of named sites in space without damping: extract "
            "it with extract(structure, {name: Site(point, direction), ...}), and damp the model "
            "of the assembly (damping=)."
        )

    reduced = reduced_matrices(model.k0, model.m_st, np.asarray(model.P), model.omega)
    size, count = len(reduced.K), len(model.k0)
    dependence = np.eye(count) if model.dependence is None else np.asarray(model.dependence)
    is_dof = (dependence == 1.0).any(axis=1) & (np.count_nonzero(dependence, axis=1) == 1)

    ends, patches = {}, {}
    positions, axes = np.zeros((2, size, 3))
    for k, (site, columns) in enumerate(model.columns.items()):
        own = np.array(columns)
        d = direction[own]
        six, space = np.zeros((6, size)), np.zeros((6, 6))
        six[:3, :count], space[:3, :3] = d.T @ dependence[own], d.T @ d
        ends[site] = PointMotion(Sparse(six), space, np.array(points[site]))
        patches[site] = model.radius[k], float(model.local_compliance[k])

        dofs = dependence[own[is_dof[own]]].argmax(axis=1)
        positions[dofs], axes[dofs] = points[site], d[is_dof[own]]

    kind = np.where(np.arange(size) < count, MOVE, AMPLITUDE)
    places = DofPlaces(positions, np.arange(size), axes, kind)
    fixed = np.zeros(size, dtype=bool)
    return _without_rigid_strain(Superelement(reduced.K, reduced.M, places, ends, fixed, patches))


def matrix_superelement(name: str, matrices: NodalMatrices) -> Superelement:
    """The superelement of matrices; InputError without coordinates, with a C, or if too large."""
    size = algebra.size(matrices.K)
    if not matrices.located or size > MOST_DENSE_DOFS or matrices.C is not None:
        raise InputError(
            f"the part {name!r} has no mesh: its matrices, of {size} dofs, need coordinates (map= "
            f"with node, dof, x, y, z of each row), at most {MOST_DENSE_DOFS} dofs, and no C (damp "
            "the model of the assembly)."
        )

    node, places, ends = matrices.map.node, matrices.places, {}
    for number in np.unique(node[places.kind != AMPLITUDE]):
        kinds = [(node == number) & (places.kind == kind) for kind in (MOVE, TURN)]
        six = np.vstack([np.where(at_node, places.axes.T, 0.0) for at_node in kinds])
        space = np.diag(six.any(axis=1).astype(float))
        ends[str(number)] = PointMotion(Sparse(six), space, matrices.map.points[node == number][0])

    fixed = np.zeros(size, dtype=bool)
    fixed[matrices.fixed] = True
    whole = (algebra.gathered(matrix, 0) for matrix in (matrices.K, matrices.M))
    K, M = (np.asarray(scipy.sparse.csr_matrix(matrix).toarray()) for matrix in whole)
    patches = dict.fromkeys(ends, (None, 0.0))
    return _without_rigid_strain(Superelement(K, M, places, ends, fixed, patches))


def _without_rigid_strain(part: Superelement) -> Superelement:
    """The superelement with K exactly zero on the rigid motions that its supports permit."""
    motions = part.places.rigid_motions(part.places.points.mean(axis=0))
    motions[part.fixed] = 0.0
    motions /= np.maximum(np.linalg.norm(motions, axis=0), np.finfo(float).tiny)
    basis, values, _ = np.linalg.svd(motions, full_matrices=False)
    basis = basis[:, values > STIFFNESS_ROUNDING]

    # in units in which the entries of K are alike: rotations, displacements and amplitudes are not
    K = (part.K + part.K.T) / 2
    scale = np.sqrt(np.maximum(K.diagonal(), np.finfo(float).tiny))[:, None]
    forces = np.where(part.fixed[:, None], 0.0, K @ basis / scale)
    _, strain, rotation = np.linalg.svd(forces, full_matrices=False)
    largest = np.linalg.norm(basis * scale, axis=0).max(initial=1.0)
    rigid = np.linalg.qr(basis @ rotation[strain <= STIFFNESS_ROUNDING * largest].T)[0]

    K = K - rigid @ (rigid.T @ K)
    return replace(part, K=K - (K @ rigid) @ rigid.T, rigid=rigid)


def row_numbers(matrix: Sparse) -> IntArray:
    """The row of each stored entry of a sparse matrix."""
    return np.repeat(np.arange(matrix.shape[0]), np.diff(matrix.indptr))


def row_maxima(size: Array, row: IntArray, count: int) -> Array:
    """Largest `size` of the entries in each row (count,), or 0; `row`: row of each entry."""
    result = np.zeros(count)
    np.maximum.at(result, row, size)
    return result


#: "part:group" or the name of a reference point, ("part", point) or ("part", point, radius) [m]
End: TypeAlias = str | tuple[str, tuple[float, ...]] | tuple[str, tuple[float, ...], float]


def end_text(end: End) -> str:
    """An end as text for messages."""
    if isinstance(end, str):
        return repr(end)
    return f"{end[0]!r} {f'within {end[2]:g} m of' if len(end) == 3 else 'at'} {point_text(end[1])}"


#: Dofs of a reference point.
POINT_DOFS = 6


class Layout:
    """The n dofs u of an assembly: of its meshed parts `members`, superelements `condensed`, and
    reference `points`, name -> coordinates (3,) [m]. `at`: placement of each part."""

    def __init__(
        self,
        parts: Mapping[str, MeshedStructure | Superelement],
        at: Mapping[str, Placement],
        points: Mapping[str, Array],
    ) -> None:
        self.members: dict[str, Member] = {}
        self.condensed: dict[str, Superelement] = {}
        first = 0
        for name, part in parts.items():
            if not isinstance(part, Superelement):
                self.members[name] = Member(name, part, at[name], first)
                first += self.members[name].size

        for name, part in parts.items():
            if isinstance(part, Superelement):
                self.condensed[name] = part.placed(at[name], first)
                first += len(part.K)
        self.points = dict(points)
        self._first_point = first
        #: whether all parts are plane
        self.plane = _are_plane(self.members, self.condensed)
        for name, x in self.points.items() if self.plane else ():
            if x[2]:
                raise InputError(f"points[{name!r}] lies {x[2]:g} m out of the plane of the parts.")
        all_points = [m.vertices for m in self.members.values()]
        all_points += [c.points for c in self.condensed.values()]
        x = np.vstack([*all_points, *self.points.values()])
        #: low, high: corners (3,) [m] of the bounding box of all parts and points
        self.low = x.min(axis=0)
        self.high = x.max(axis=0)

    @property
    def names(self) -> list[str]:
        """Names of all parts."""
        return [*self.members, *self.condensed]

    @property
    def count(self) -> int:
        """Number of dofs of u."""
        return self._first_point + POINT_DOFS * len(self.points)

    @property
    def middle(self) -> Array:
        """Middle (3,) [m] of the bounding box of all parts and points."""
        return np.asarray((self.low + self.high) / 2)

    @property
    def size(self) -> float:
        """Diagonal [m] of the bounding box of all parts and points."""
        return float(np.linalg.norm(self.high - self.low))

    @property
    def rotations(self) -> Array:
        """Projection (3, 3) onto the rotations that nodes have: about z alone for plane parts."""
        if self.plane:
            return np.diag([0.0, 0.0, 1.0])
        return np.eye(3)

    def member(self, name: str, prefix: str = "") -> Member:
        """The part `name`, which must have a mesh; `prefix` begins the text of the InputError."""
        if name in self.condensed:
            raise InputError(
                f"{prefix}{name!r} is a superelement, whose sites and nodes are struck by name."
            )
        if name not in self.members:
            parts = name_list(name, self.names, "its parts")
            raise InputError(f"{prefix}the assembly has no part {name!r}; {parts}.")
        return self.members[name]

    def group_end(self, name: str, end: End) -> tuple[Member, str]:
        """(part, group) of an end "part:group"; otherwise InputError, which calls it `name`."""
        if not isinstance(end, str) or ":" not in end:
            raise InputError(f'{name} must be a group, "part:group"; got {end_text(end)}.')
        part, group = end.split(":", 1)
        return self.member(part, f"{end_text(end)}: "), group

    def motion_without_mesh(self, end: End) -> PointMotion | None:
        """Motion of an end that is a reference point or on a superelement; None for other ends.
        InputError if the superelement has no such site or node."""
        part = end.split(":", 1)[0] if isinstance(end, str) and ":" in end else end[0]
        if part in self.condensed:
            return self._superelement_motion(part, end)
        if not isinstance(end, str) or end not in self.points:
            return None
        space = scipy.linalg.block_diag(np.eye(3), self.rotations)
        return PointMotion(self.units(self.point_dofs(end)), space, self.points[end])

    def _superelement_motion(self, part: str, end: End) -> PointMotion:
        """Motion of a superelement's site or node, which `end` gives by name or coordinates."""
        member = self.condensed[part]

        if isinstance(end, str):
            name = end.split(":", 1)[1]
        else:
            distances = np.linalg.norm(member.points - in_space(end[1]), axis=1)
            nearest = int(np.argmin(distances))
            is_near = distances[nearest] <= SNAP_SHARE * self.size
            name = list(member.ends)[nearest] if is_near else ""

        if name in member.ends:
            return self.on_u(member.ends[name], member.first)

        names = [f"{part}:{site}" for site in member.ends]
        sites = name_list(end_text(end), names, "its sites and nodes")
        raise InputError(f"the part {part!r} has no site or node {end_text(end)}; {sites}.")

    def on_u(self, motion: PointMotion, first: int) -> PointMotion:
        """The motion of a part as functionals of u; `first`: the part's first dof in u."""
        six = motion.functionals.tocoo()
        return replace(motion, functionals=self.matrix(six.row, six.col + first, six.data, 6))

    def point_dofs(self, name: str) -> IntArray:
        """Dofs (6,) in u of the reference point `name`."""
        start = self._first_point + POINT_DOFS * list(self.points).index(name)
        return np.arange(start, start + POINT_DOFS)

    def matrix(self, row: IntArray, column: IntArray, value: Array, count: int) -> Sparse:
        """Sparse matrix (count, n) of functionals of u from entries; repeated entries add up."""
        entries = (np.ravel(value), (np.ravel(row), np.ravel(column)))
        return scipy.sparse.csr_matrix(entries, shape=(count, self.count))

    def zeros(self, count: int) -> Sparse:
        """A zero matrix (count, n) of functionals of u."""
        return scipy.sparse.csr_matrix((count, self.count))

    @property
    def places(self) -> DofPlaces:
        """Node, direction and kind of each dof of u; out-of-plane dofs have no direction."""
        x = np.array(list(self.points.values())).reshape(-1, 3)
        axes = np.vstack([np.eye(3), np.eye(3)])
        if self.plane:
            axes[[2, 3, 4]] = 0.0

        point_places = DofPlaces(
            x,
            np.repeat(np.arange(len(x)), POINT_DOFS),
            np.tile(axes, (len(x), 1)),
            np.tile(np.repeat([MOVE, TURN], 3), len(x)),
        )
        members = self.members.values()
        condensed = self.condensed.values()
        of_parts = [*(part.places for part in members), *(part.places for part in condensed)]
        return DofPlaces.joined([*of_parts, point_places])

    # -- motions as functionals: row 3 p + c is component c of point p, in the assembly's axes

    def at_points(self, member: Member, cell: IntArray, X: Array, names: tuple[str, ...]) -> Sparse:
        """Functionals (3P, n): displacements or rotations (`names`) at reference points X (P, tdim)
        in cells (P,); zero for components that the part does not have."""
        space = member.part.form.space
        entries = []
        for axis, name in enumerate(names):
            path = member.part.form.components.get(name)
            if path is not None and len(cell):
                weights = compat.tabulate(space, path, X)
                weights = np.where(np.abs(weights) > ROUNDED_VALUE, weights, 0.0)
                dofs = member.first + compat.cell_dofs(space, path, cell)
                entries.append((dofs, weights[..., None] * member.at.rotation[:, axis]))

        return self._summed_functionals(entries, len(cell))

    def at_nodes(self, member: Member, nodes: IntArray, names: tuple[str, ...]) -> Sparse:
        """Functionals (3P, n): displacements of nodes (P,); rotations if `names` is ROTATIONS."""
        entries = []
        for axis, name in enumerate(names):
            if name in member.part.form.components:
                values = np.tile(member.at.rotation[:, axis], (len(nodes), 1, 1))
                entries.append((self.dofs(member, nodes, name)[:, None], values))
        return self._summed_functionals(entries, len(nodes))

    def half_curl(self, member: Member, cell: IntArray, X: Array) -> Sparse:
        """Functionals (3P, n): ½ ∇ × u at reference points X (P, tdim) in cells (P,) of a solid."""
        form = member.part.form
        _, J = member.part.mesh.geometry.at(cell, X)
        slopes = compat.tabulate_derivatives(form.space, form.components["x"], X)
        gradient = np.einsum("pft,ptx->pfx", slopes, np.linalg.pinv(J))

        entries = []
        for axis, name in enumerate(DISPLACEMENTS):
            path = form.components.get(name)
            if path is not None:
                dofs = member.first + compat.cell_dofs(form.space, path, cell)
                of_axis = 0.5 * np.cross(gradient, np.eye(3)[axis])  # ½ ∇φ × e
                entries.append((dofs, of_axis @ member.at.rotation.T))

        return self._summed_functionals(entries, len(cell))

    def _summed_functionals(self, entries: Sequence[tuple[IntArray, Array]], count: int) -> Sparse:
        """Functionals (3P, n) of P vectors: sums over pairs (dofs (P, k), vectors (P, k, 3))."""
        total = self.zeros(3 * count)

        if entries:
            rows = (3 * np.arange(count)[:, None] + np.arange(3))[:, None]
            indices = [np.broadcast_arrays(rows, dofs[..., None]) for dofs, _ in entries]
            row, column = (np.concatenate([w[k].ravel() for w in indices]) for k in (0, 1))
            value = np.concatenate([values.ravel() for _, values in entries])
            total = self.matrix(row, column, value, 3 * count)
            total.eliminate_zeros()

        return total

    def of_components(
        self, member: Member, names: tuple[str, ...], motions: Sparse
    ) -> Iterator[tuple[str, Sparse]]:
        """Yield (name, rows (P, n)) for each component among `names` that the part has: `motions`
        (3P, n) along the part's axis of this component."""
        for axis, name in enumerate(names):
            if name in member.part.form.components:
                local_axis = member.at.rotation[:, axis]
                yield name, sum(local_axis[c] * motions[c::3] for c in range(3) if local_axis[c])

    def dofs(self, member: Member, nodes: IntArray, name: str) -> IntArray:
        """Dofs (P,) in u of one component (in the axes of the part) of nodes (P,)."""
        (component,) = member.part.form.components[name]
        return np.asarray(member.first + member.block * np.asarray(nodes) + component)

    def units(self, columns: IntArray) -> Sparse:
        """Functionals (columns, n) that each select one dof of u."""
        return self.matrix(np.arange(len(columns)), columns, np.ones(len(columns)), len(columns))


def _are_plane(members: Mapping[str, Member], condensed: Mapping[str, Superelement]) -> bool:
    """Whether the parts are plane; InputError if some are plane and others are not."""
    plane = {name: "z" not in m.part.form.components for name, m in members.items()}
    if len(set(plane.values())) > 1:
        sheet = next(name for name, flat_part in plane.items() if flat_part)
        other = next(name for name, flat_part in plane.items() if not flat_part)
        raise InputError(f"{sheet!r} is plane, {other!r} is not: give parts of one sort (gdim=3).")

    flat = any(plane.values())
    for name, part in condensed.items():
        along_z = part.places.axes[part.places.kind == MOVE, 2]
        if flat and (np.abs(along_z).max(initial=0.0) > 1e-12 or part.points[:, 2].any()):
            raise InputError(f"{name!r} moves in space, others in a plane: give parts of one sort.")

    for name, m in members.items():
        R = m.at.rotation
        if flat and (abs(R[2, 2] - 1) > 1e-12 or m.at.shift[2]):
            raise InputError(
                f"at[{name!r}] of a plane part may rotate about z and shift along x and y only."
            )

    return flat


#: Fraction of the largest coefficient below which one is rounding.
ROUNDED_COEFFICIENT = 1e-13


def without_rounding(matrix: Sparse) -> Sparse:
    """The matrix without entries below the rounding error of the largest entry in the row; one of
    CSR format is changed in place."""
    matrix = matrix.tocsr()
    size = np.abs(matrix.data)
    row = row_numbers(matrix)
    matrix.data[size < ROUNDED_COEFFICIENT * row_maxima(size, row, matrix.shape[0])[row]] = 0.0
    matrix.eliminate_zeros()
    return matrix


# -- the parts by name, their placements and the reference points, checked


def checked_parts(parts: object) -> dict[str, MeshedStructure | Superelement]:
    """The parts by name, checked; models and given matrices become superelements."""
    if not isinstance(parts, Mapping) or not parts:
        raise InputError(f"parts must be a dict: name -> Structure; got {shown(parts)}.")
    for name in parts:
        _check_name("part", name)
    result = {name: _checked_part(name, part) for name, part in parts.items()}
    if all(isinstance(part, Superelement) for part in result.values()):
        raise InputError("an assembly needs a part with a mesh; all parts are superelements.")
    return result


def _check_name(what: str, name: object) -> None:
    """InputError for a name that joints cannot refer to."""
    text = checks.name(f"a {what}'s name", name)
    if not text.strip() or ":" in text:
        raise InputError(f"a {what}'s name must be a text without a colon; got {shown(name)}.")


def _checked_part(name: str, part: object) -> MeshedStructure | Superelement:
    """The matrices of a part with a mesh, or a superelement; InputError for other parts."""
    if isinstance(part, AntiOscillators):
        return model_superelement(name, part)
    if not isinstance(part, Structure):
        raise InputError(
            f"the part {name!r} must be a Structure or a model of several sites; got {shown(part)}."
        )

    refuse_prestress(part, f"assemble, of its parts ({name!r}),")
    if part.matrices.assembled:
        raise InputError(
            f"the part {name!r} is an assembly: give its parts and joints, or a model of its sites."
        )
    if isinstance(part.matrices, NodalMatrices):
        return matrix_superelement(name, part.matrices)
    text = "the part {!r} has no mesh, and its matrices no map= of nodes, dofs and coordinates."
    meshed = on_mesh(part, text.format(name))
    if meshed.comm.size > 1:
        raise InputError(
            f"an assembly works on one rank, and the part {name!r} is spread over "
            f"{meshed.comm.size}: read its mesh with comm=MPI.COMM_SELF, or start one process."
        )

    return meshed


def checked_places(members: Mapping[str, object], at: object) -> dict[str, Placement]:
    """The placement of each part by name, checked; parts that `at` does not name stay in place."""
    placements = {} if at is None else at
    if not isinstance(placements, Mapping):
        raise InputError(f"at must be a dict: name -> Placement or (x, y, z); got {shown(at)}.")

    for name in placements:
        if not isinstance(name, str) or name not in members:
            parts = name_list(name, members, "the parts")
            raise InputError(f"at names {shown(name)}, which is no part; {parts}.")
    return {name: checked_placement(name, placements.get(name)) for name in members}


def checked_points(members: Mapping[str, object], points: object) -> dict[str, Array]:
    """The coordinates (3,) [m] of each reference point by name, checked."""
    point_by_name = {} if points is None else points
    if not isinstance(point_by_name, Mapping):
        raise InputError(f"points must be a dict: name -> coordinates; got {shown(points)}.")
    result = {}
    for name, x in point_by_name.items():
        _check_name("point", name)
        if name in members:
            raise InputError(f"{name!r} names both a part and a reference point.")
        result[name] = in_space(coordinates(f"points[{name!r}]", x))

    return result
