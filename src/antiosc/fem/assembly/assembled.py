"""K and M of joined parts with dofs u = T q, strain-free motions, and points named by users.

The rigid motions of all connected pieces of the parts span the strain-free motions before the parts
are joined. The null vectors of K are the strain-free motions that satisfy all constraints and
stretch no spring: rigid motions of the assembly, and mechanisms that the joints leave.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import KW_ONLY, dataclass, replace
from functools import cached_property
from typing import ClassVar, TypeVar, cast

import numpy as np
import scipy.linalg
import scipy.sparse
from mpi4py import MPI
from petsc4py import PETSc

from antiosc.base._types import Array, BoolArray, Box, IntArray, Matrix
from antiosc.base.checks import floats
from antiosc.base.errors import AccuracyError, InputError
from antiosc.fem.assembly.joint import Constraints, Eliminated
from antiosc.fem.assembly.layout import POINT_DOFS, Layout, Sparse, without_rounding
from antiosc.fem.linalg.algebra import dot, force_ratios, multiply, uses_strains
from antiosc.fem.linalg.petsc_algebra import PRODUCT_KEY, from_csr, with_entries
from antiosc.fem.mesh.surface import group_centre
from antiosc.fem.structure import (
    SHIFT_RATIO,
    Dissipation,
    DofPlaces,
    Plausibility,
    in_space,
    orthonormal_basis,
    support,
)
from antiosc.fem.structure.attachments import ElasticTerm
from antiosc.fem.structure.loads import PointMotion
from antiosc.fem.structure.meshed import Member, MeshedStructure, PartsMatrices
from antiosc.models.motion import Inertia

#: A motion satisfies the constraints if their residual over the sizes of their terms is below this.
CONSTRAINT_RESIDUAL = 1e-9
#: Entries of a dense matrix that are processed at once: 80 MB.
ENTRIES_AT_ONCE = 10_000_000
#: Components of a motion below this fraction of it are rounding.
ROUNDED_MOTION = 1e-7


@dataclass(frozen=True, eq=False)
class RigidDofs:
    """The dofs and rigid motions of one body before joining, or of the whole assembly."""

    name: str  # of the part or of the reference point, for messages; "all" of the assembly
    rows: IntArray  # indices of its dofs in u
    centre: Array  # (3,) [m] about which it rotates: the middle of its bounding box
    motions: Array  # (rows, k) unit translations, and rotations that move its ends by 1


def unjoined_bodies(layout: Layout) -> list[RigidDofs]:
    """Bodies before joining: connected pieces of parts; superelements; reference points."""
    bodies: list[tuple[str, IntArray, Array, float]] = []
    for member in layout.members.values():
        labels = member.connected
        for label in range(int(labels.max()) + 1):
            nodes = np.flatnonzero(labels == label)
            rows = (member.block * nodes[:, None] + np.arange(member.block)).ravel()
            bodies.append((member.name, member.first + rows, *_box_of(member.nodes[nodes], layout)))

    for name, part in layout.condensed.items():
        rows = np.arange(part.rows.start, part.rows.stop)
        bodies.append((name, rows, *_box_of(part.points, layout)))

    for name, x in layout.points.items():
        bodies.append((name, layout.point_dofs(name), x, layout.size / 2))
    places = layout.places
    return [_rigid_body(places, *part) for part in bodies]


def _box_of(x: Array, layout: Layout) -> tuple[Array, float]:
    """Centre (3,) and half the diagonal of the bounding box of points x (n, 3) [m]."""
    size = float(np.linalg.norm(np.ptp(x, axis=0))) / 2
    return (x.min(axis=0) + x.max(axis=0)) / 2, max(size, 1e-9 * layout.size)


def _rigid_body(
    places: DofPlaces, name: str, rows: IntArray, centre: Array, size: float
) -> RigidDofs:
    """Rigid motions of dofs `rows` about `centre` (3,) [m]; rotations are divided by `size`."""
    motions = places.rigid_motions(centre, rows)
    motions[:, 3:] /= size
    return RigidDofs(name, rows, centre, motions[:, np.abs(motions).max(axis=0) > 0])


def free_motions(
    layout: Layout, bodies: Sequence[RigidDofs], constraints: Sparse, fixed: BoolArray, scale: Array
) -> tuple[Array, int]:
    """(strain-free motions (n, k) of u that satisfy all constraints, number of rigid motions of the
    assembly among them). `constraints` (m, n): functionals of u that are zero, strains of springs
    included; `fixed` (n,) and `scale` (n,): as of `Constraints`."""
    size = np.asarray(abs(constraints) @ scale).ravel()
    scaled = scipy.sparse.diags(1 / size[size > 0]) @ constraints[size > 0]
    units = scipy.sparse.diags(1 / scale[fixed]) @ scipy.sparse.identity(len(fixed)).tocsr()[fixed]
    rows = scipy.sparse.vstack([scaled, units]).tocsr()

    whole = [_rigid_body(layout.places, "all", np.arange(layout.count), layout.middle, layout.size)]
    N, R = (_motions_of(of, layout.count) for of in (bodies, whole))
    return np.asarray(N @ _null_space(rows @ N)), _null_space(rows @ R).shape[1]


def moving_bodies(bodies: Sequence[RigidDofs], motions: Array) -> list[RigidDofs]:
    """The bodies that `motions` (n, k) of u move."""
    least = ROUNDED_MOTION * np.abs(motions).max(initial=0.0)
    return [body for body in bodies if np.abs(motions[body.rows]).max(initial=0.0) > least]


def _motions_of(bodies: Sequence[RigidDofs], size: int) -> Sparse:
    """The motions of all bodies as columns (size, k) of u."""
    blocks = scipy.sparse.block_diag([Sparse(body.motions) for body in bodies])
    rows = np.concatenate([body.rows for body in bodies])
    indices = rows[blocks.row], blocks.col
    return scipy.sparse.csr_matrix((blocks.data, indices), shape=(size, blocks.shape[1]))


def _null_space(E: Array | Sparse) -> Array:
    """Orthonormal basis (k, r) of the null space of E (m, k)."""
    k = E.shape[1]
    if not E.shape[0]:
        return np.eye(k)
    R = np.zeros((0, k))
    for block in np.array_split(np.arange(E.shape[0]), 1 + E.shape[0] * k // ENTRIES_AT_ONCE):
        dense = E[block].toarray() if scipy.sparse.issparse(E) else E[block]
        R = scipy.linalg.qr(np.vstack([R, dense]), mode="r")[0][:k]
    _, values, right = np.linalg.svd(R)
    values = np.concatenate([values, np.zeros(k - len(values))])
    return np.asarray(right[values <= CONSTRAINT_RESIDUAL * max(1.0, values[0])].T)


#: A part is at rest if its motion is below this fraction of the largest.
REST_SHARE = 1e-6
#: A motion has no mass if its mass is below this fraction of the largest.
MASSLESS_SHARE = 1e-12
#: Force of a motion without strain over that of the entries of K; rounding leaves about 1e-15.
MECHANISM_FORCE = 1e-9


def modes_and_shift(
    layout: Layout,
    K: Matrix,
    M: Matrix,
    eliminated: Eliminated,
    motions: Array,
    bodies: Sequence[RigidDofs],
) -> tuple[Array, float]:
    """(M-orthonormal strain-free motions (n, r) in q, shift [rad²/s²] of K + shift M) from the
    strain-free `motions` (n, k) in u; shift 0 if there are none. InputError for a point without
    mass or resistance; AccuracyError if a motion strains a part."""
    comm = MPI.COMM_SELF
    motions = eliminated.coordinates(motions)

    modes = orthonormal_basis(comm, M, motions)
    if modes.shape[1] < motions.shape[1]:
        values, rotation = np.linalg.eigh(dot(comm, motions, multiply(M, motions)))
        massless = motions @ rotation[:, values <= MASSLESS_SHARE * values[-1]]
        raise InputError(
            f"the reference point {body_names(moving_bodies(bodies, eliminated.T @ massless))} "
            "moves without resistance and without mass: join it, support it, or give it a mass."
        )

    if not modes.shape[1]:
        return modes, 0.0

    u = eliminated.T @ modes
    least = REST_SHARE * np.abs(u).max()
    for member in layout.members.values():
        r = u[member.rows][:, np.abs(u[member.rows]).max(axis=0) > least]
        ratios = force_ratios(member.part.K, r) if r.size else r
        if ratios.max(initial=0.0) > MECHANISM_FORCE:
            raise AccuracyError(
                "a motion that no joint resists strains the assembly (‖K r‖/(‖K‖‖r‖) = "
                f"{ratios.max():.1e}, limit {MECHANISM_FORCE:.0e}): parts or their distances "
                "differ too much in size for double precision."
            )

    if modes.shape[1] == np.count_nonzero(~eliminated.dependent):
        return modes, 1.0  # any will do
    size = float((layout.high - layout.low).max())
    fields = eliminated.coordinates(layout.places.polynomials(comm, layout.middle, size))
    return modes, SHIFT_RATIO * support.first_elastic_estimate(comm, K, M, fields, modes)


def body_names(bodies: Sequence[RigidDofs]) -> str:
    """The names of the parts and points to which bodies belong."""
    return ", ".join(dict.fromkeys(repr(body.name) for body in bodies))


Loads = TypeVar("Loads")


class AddedTerms:
    """Terms of joints, attachments and superelements in K and M (n, n) on q, and in `mass` [kg]."""

    def __init__(self, elastic: Sequence[ElasticTerm], T: Sparse) -> None:
        self._terms = elastic
        self.mass = float(sum(term.mass for term in elastic))
        self._G = stacked([term.G for term in elastic], len(T.indptr) - 1)
        self._on_q = [without_rounding(term.G @ T) for term in elastic]
        self._G_on_q = stacked(self._on_q, T.shape[1])

        empty = Sparse((0, 0))
        self._k = scipy.sparse.block_diag([empty, *(term.k for term in elastic)], "csr")
        self._m = scipy.sparse.block_diag([empty, *(term.m for term in elastic)], "csr")
        self.K = (self._G_on_q.T @ self._k @ self._G_on_q).tocsr()
        self.M = (self._G_on_q.T @ self._m @ self._G_on_q).tocsr()

    def dissipation(self, *, on_u: bool = False) -> list[Dissipation]:
        """Dashpots, then Maxwell branches, on q; `on_u`: on the dofs u of the unjoined parts."""
        functionals = [term.G for term in self._terms] if on_u else self._on_q
        pairs = zip(self._terms, functionals, strict=True)
        terms = [damper for term, G in pairs for damper in term.dampers(G)]
        return sorted(terms, key=lambda term: term.tau is not None)

    def forces(self, motions: Array) -> Array:
        """Elastic forces (n, j) on q for `motions` (n, j) of u."""
        return np.asarray(self._G_on_q.T @ (self._k @ (self._G @ motions)))

    def inertial_loads(self, motions: Array) -> tuple[Array, Array]:
        """(M r (n, j) on q, rᵀ M r (j, j)) of the attached masses, for motions r of u (n, j)."""
        moved = self._G @ motions
        impulse = self._m @ moved
        return np.asarray(self._G_on_q.T @ impulse), moved.T @ impulse


@dataclass(eq=False)
class AssembledMatrices(PartsMatrices):
    """K and M of joined parts; dependent dofs keep their rows: 1 on K's diagonal, 0 in M."""

    _: KW_ONLY
    layout: Layout  # the parts in their places
    eliminated: Eliminated  # T and the dofs that depend on others
    added: AddedTerms  # terms of joints, attachments and superelements
    constraints: Constraints  # from which T was made, the supports of the assembly first

    assembled: ClassVar[bool] = True

    @property
    def T(self) -> Sparse:
        """(n, n), u = T q; the columns of dependent dofs are empty."""
        return self.eliminated.T

    @property
    def mass(self) -> float:
        for name in self.layout.condensed:
            raise InputError(f"the mass of the part {name!r} is not known: it is a superelement.")
        of_parts = sum(member.part.mass for member in self.layout.members.values())
        return float(of_parts + self.added.mass)

    @property
    def plausibility(self) -> Plausibility:
        of_parts = [member.part.plausibility for member in self.layout.members.values()]
        doubts = list(dict.fromkeys(text for data in of_parts for text in data.get("doubts", ())))
        result: Plausibility = {"doubts": doubts} if doubts else {}
        if of_parts and not self.layout.condensed:
            result["wave_speed"] = max(data["wave_speed"] for data in of_parts)
        if sheets := [data["thickness"] for data in of_parts if "thickness" in data]:
            result["thickness"] = min(sheets)
        return result

    @property
    def dimensions(self) -> Box:
        box = sorted((self.layout.high - self.layout.low).tolist(), reverse=True)
        # sheets in one plane and beams on one line have a box without a thickness
        members = [member.part.dimensions for member in self.layout.members.values()]
        smallest = np.min(members or [(0.0, 0.0, 0.0)], axis=0)
        length, width, depth = np.maximum(box, smallest).tolist()
        return length, width, depth

    def constants(self) -> tuple[float, float, float]:
        return next(iter(self.layout.members.values())).part.constants()

    def uniform_inertia(self, direction: Array) -> Array | None:
        direction = floats("direction", direction, (3,))
        if self.layout.condensed:  # their sites do not tell all of their mass
            return None
        translation = self.places.rigid_motions(np.zeros(3))[:, :3] @ direction
        attached_loads, _ = self.added.inertial_loads(translation[:, None])

        of_parts = np.zeros(self.layout.count)
        for member in self.layout.members.values():
            local_direction = member.at.rotation.T @ direction
            of_parts[member.rows] = member.part.uniform_inertia(local_direction)
        return np.asarray(self.T.T @ of_parts + attached_loads[:, 0])

    @cached_property
    def rigid_inertia(self) -> tuple[Inertia, Array] | None:
        if not self.rigid_modes.shape[1] or self.layout.condensed:
            return None
        point = self.layout.middle
        motions = self.places.rigid_motions(point)
        attached_loads, S = self.added.inertial_loads(motions)
        loads = product_by_parts(self.layout, MeshedStructure.inertial_loads, motions)
        S += motions.T @ loads
        loads = np.asarray(self.T.T @ loads) + attached_loads
        return Inertia(point, (S + S.T) / 2, np.zeros((0, 6))), loads

    @property
    def rigid_motions(self) -> Array:
        motions = self.eliminated.coordinates(self.layout.places.rigid_motions(self.layout.middle))
        return motions[:, np.abs(motions).max(axis=0) > 0]

    def describe(self, dofs: int) -> str:
        names = self.layout.names
        names_text = ", ".join(names if len(names) < 7 else [*names[:5], f"{len(names) - 5} more"])
        parts = "1 part" if len(names) == 1 else f"{len(names)} parts"
        return (
            f"assembly of {parts} ({names_text}), {dofs} dofs, "
            f"{self.rigid_modes.shape[1]} rigid-body modes{self.prestress_text}"
        )

    def dashpots(self) -> list[Dissipation]:
        terms = self.added.dissipation()
        for member in self.members():
            T = self.T[member.rows]
            terms += [replace(term, G=term.G @ T) for term in member.part.dampers]
        return terms

    def on_q(self, member: Member, matrix: PETSc.Mat) -> PETSc.Mat:
        zero_matrix = Sparse((self.layout.count,) * 2)
        blocks = block_diagonal(self.layout, {member.name: matrix})
        return as_petsc("K", _projected(self.T, blocks, zero_matrix), self.layout)

    @property
    def has_loss_factor(self) -> bool:
        return any(member.part.has_loss_factor for member in self.layout.members.values())

    # -- from u to the parts

    def members(self, name: str | None = None) -> list[Member]:
        return list(self.layout.members.values()) if name is None else [self.layout.member(name)]

    @property
    def places(self) -> DofPlaces:
        return self.layout.places

    def expanded(self, q: Array) -> Array:
        return np.asarray(self.T @ q)

    def joined(self, loads: Loads, rows: slice = slice(None)) -> Loads:
        return cast(Loads, self.T[rows].T @ loads)


def stacked(functionals: Sequence[Sparse], count: int) -> Sparse:
    """Functionals (m_i, count) stacked as the rows of one matrix (Σ m_i, count)."""
    return scipy.sparse.vstack([Sparse((0, count)), *functionals]).tocsr()


def reduced_matrices(
    layout: Layout, eliminated: Eliminated, added: AddedTerms
) -> tuple[PETSc.Mat, PETSc.Mat]:
    """(K, M) of the joined parts, Tᵀ K T and Tᵀ M T; 1 on K's diagonal at dependent dofs."""
    T = eliminated.T
    parts = {name: member.part for name, member in layout.members.items()}
    small = added.K + scipy.sparse.diags(eliminated.dependent.astype(float))

    blocks = block_diagonal(layout, {name: part.K for name, part in parts.items()})
    K = as_petsc("K", _projected(T, blocks, small), layout)

    blocks = block_diagonal(layout, {name: part.M for name, part in parts.items()})
    M = as_petsc("M", _projected(T, blocks, added.M), layout)

    if any(uses_strains(part.K) for part in parts.values()):
        transposed, added_K = T.T.tocsr(), small.tocsr()

        def product(q: Array) -> Array:
            forces = product_by_parts(layout, lambda part, u: multiply(part.K, u), T @ q)
            return np.asarray(transposed @ forces + added_K @ q)

        K.setAttr(PRODUCT_KEY, product)
    return K, M


def block_diagonal(layout: Layout, matrices: Mapping[str, PETSc.Mat]) -> Sparse:
    """The block-diagonal matrix (n, n) of the matrices of some parts."""
    counts = np.zeros(layout.count, dtype=PETSc.IntType)
    indices = [np.zeros(0, PETSc.IntType)]

    data = [np.zeros(0)]
    for name, matrix in matrices.items():  # in the order of their dofs
        rows = layout.members[name].rows
        pointers, columns, values = with_entries(matrix).getValuesCSR()
        counts[rows] = np.diff(pointers)
        indices.append(columns + rows.start)
        data.append(values)

    pointers = np.append(0, np.cumsum(counts))
    arrays = np.concatenate(data), np.concatenate(indices), pointers
    result = Sparse(arrays, shape=(layout.count, layout.count))
    result.has_canonical_format = True  # as those of PETSc have: no search for duplicates
    return result


def product_by_parts(
    layout: Layout, work: Callable[[MeshedStructure, Array], Array], u: Array
) -> Array:
    """Vectors (n, k): in the rows of each meshed part, `work(part, rows of u)`; else zero."""
    result = np.zeros(u.shape)
    for member in layout.members.values():
        result[member.rows] = work(member.part, u[member.rows])
    return result


def as_petsc(name: str, matrix: Sparse, layout: Layout) -> PETSc.Mat:
    """A PETSc matrix (n, n) on q; block size: dofs per node, if equal in all parts. `name`: for
    messages."""
    result = from_csr(name, matrix)
    blocks = {member.block for member in layout.members.values()}
    if len(blocks) == 1 and not layout.condensed:  # half a node orders badly
        block = int(np.gcd(blocks.pop(), POINT_DOFS if layout.points else 0))
        result.setBlockSizes(block, block)
    return result


def _projected(T: Sparse, K: Sparse, added: Sparse) -> Sparse:
    """Tᵀ K T + added, with sorted entries."""
    result = (T.T.tocsr() @ (K @ T) + added).tocsr()
    result.eliminate_zeros()
    result.sort_indices()
    return result


# -- places, from what a user gives


def group_of(matrices: PartsMatrices, name: str, what: str = "point") -> tuple[Member, str]:
    """(part, group) for "part:group" in an assembly, or for a group of the only mesh; `what`: the
    argument, for the InputError."""
    if isinstance(matrices, AssembledMatrices):
        return matrices.layout.group_end(what, name)
    return matrices.members()[0], name


def point_on_parts(
    matrices: PartsMatrices, point: Sequence[float] | str | None, part: str | None, node: int | None
) -> tuple[Array, str | None, PointMotion | None]:
    """(coordinates (3,) [m], part or None, motion if it has no mesh, else None) of a point given by
    coordinates, by name or by `node` number in the file. InputError if there is no such point."""
    if node is not None:
        for member in matrices.members(part):
            mesh = member.part.mesh
            x = mesh.node(node) if len(mesh.labels) or not matrices.assembled else None
            if x is not None:
                return member.at.placed(x[None])[0], member.name or None, None
        raise InputError(f"the structure has no node {node}, by its number in the file.")

    if not isinstance(point, str):
        return in_space(point or ()), part, None
    if part is not None:
        matrices.members(part)
        raise InputError(f"the point {point!r} names its part: leave the part {part!r} out.")

    if isinstance(matrices, AssembledMatrices):
        end = matrices.layout.motion_without_mesh(point)
        if end is not None:
            return end.point, None, end
        member, group = matrices.layout.group_end("point", point)
    else:
        (member,), group = matrices.members(), point

    x = group_centre(member.part.mesh, group)  # the point next to it is taken
    return member.at.placed(x[None])[0], member.name or None, None
