"""`AssembledMatrices`: K and M of several parts whose dofs follow u = T q; free motions.

The rigid motions of all connected pieces of the parts span the motions without strain before the
parts are joined. Those that satisfy all constraints and stretch no spring are the null vectors of
K: the rigid motions of the whole, and the mechanisms that the joints leave.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import KW_ONLY, dataclass, replace
from functools import cached_property, partial
from typing import ClassVar, TypeVar

import numpy as np
import scipy.linalg
import scipy.sparse
from mpi4py import MPI
from petsc4py import PETSc

from antiosc.base._types import Array, BoolArray, Box, IntArray, Matrix
from antiosc.base.checks import floats
from antiosc.base.errors import AccuracyError, InputError, name_list, warn
from antiosc.fem.assembly.joint import Constraints, Eliminated, Stiffness
from antiosc.fem.assembly.layout import POINT_DOFS, Layout, Sparse, rounded, row_numbers
from antiosc.fem.assembly.shares import Share, Shares
from antiosc.fem.linalg.algebra import by_strains, dot, force_ratios, multiply
from antiosc.fem.linalg.petsc_algebra import PRODUCT
from antiosc.fem.platform import on_root
from antiosc.fem.structure import (
    SHIFT,
    Dissipation,
    DofPlaces,
    Plausibility,
    StructureMatrices,
    orthonormal,
    support,
)
from antiosc.fem.structure.meshed import Member, MeshedStructure
from antiosc.fem.structure.support import polynomials
from antiosc.models.motion import Inertia

#: A motion satisfies the constraints if their residual over the sizes of their terms is below this.
SATISFIES = 1e-9
#: Entries of a dense matrix that are processed at once.
ENTRIES_AT_ONCE = 10_000_000
#: Components of a motion below this fraction of it are rounding.
STILL = 1e-7


@dataclass(frozen=True, eq=False)
class RigidDofs:
    """Dofs with their rigid motions: of a body before joining, or of the assembly."""

    name: str  # of the part or of the reference point, for messages
    rows: IntArray  # its dofs in u
    centre: Array  # (3,) [m]
    size: float  # half of its extent [m]
    motions: Array  # (rows, 6) unit translations and rotations (about the centre, by 1/size)


def unjoined_bodies(layout: Layout) -> list[RigidDofs]:
    """The connected bodies of parts, superelements and points, before they are joined."""
    found: list[tuple[str, IntArray, Array, float]] = []
    for member in layout.members.values():
        labels = member.connected
        for label in range(int(labels.max()) + 1):
            nodes = np.flatnonzero(labels == label)
            rows = (member.block * nodes[:, None] + np.arange(member.block)).ravel()
            found.append((member.name, member.first + rows, *_around(member.nodes[nodes], layout)))
    for one in layout.condensed.values():
        rows = np.arange(one.first, one.first + one.size)
        found.append((one.name, rows, *_around(one.points, layout)))
    for name, x in layout.points.items():
        found.append((name, layout.of_point(name), x, layout.size / 2))
    places = layout.places
    return [_rigid_body(places, *one) for one in found]


def _around(x: Array, layout: Layout) -> tuple[Array, float]:
    """Centre (3,) and half the diagonal of the box of points x (n, 3) [m]."""
    size = float(np.linalg.norm(np.ptp(x, axis=0))) / 2
    return (x.min(axis=0) + x.max(axis=0)) / 2, max(size, 1e-9 * layout.size)


def whole_body(layout: Layout) -> RigidDofs:
    """The assembly as one body, with rotations about its middle."""
    return _rigid_body(
        layout.places, "all", np.arange(layout.count), layout.middle, layout.size / 2
    )


def _rigid_body(
    places: DofPlaces, name: str, rows: IntArray, centre: Array, size: float
) -> RigidDofs:
    """The rigid motions of these rows."""
    motions = places.rigid_motions(centre, rows)
    motions[:, 3:] /= size
    return RigidDofs(name, rows, centre, size, motions)


def free_motions(
    layout: Layout, constraints: Sparse, fixed: BoolArray, scale: Array
) -> tuple[Array, Array, list[RigidDofs]]:
    """Strain-free motions that satisfy the constraints and vanish at fixed dofs.

    Returns (rigid motions of the whole (n, r), mechanisms (n, m), the bodies that move in them).
    """
    together = whole_body(layout).motions
    together = together[:, np.abs(together).max(axis=0) > 0]
    rows = _rows(constraints, fixed, scale)
    rigid = together @ _null_space(rows @ together)
    bodies = unjoined_bodies(layout)
    if len(bodies) == 1:
        return rigid, np.zeros((layout.count, 0)), []
    N = _motions_of(bodies, layout.count)
    mechanisms = _excluding_rigid(N @ _null_space(rows @ N), rigid)
    moving = [
        body
        for body in bodies
        if mechanisms.shape[1] and np.abs(mechanisms[body.rows]).max() > STILL
    ]
    return rigid, mechanisms, moving


def _motions_of(bodies: Sequence[RigidDofs], size: int) -> Sparse:
    """The motions of all bodies as columns (size, k) of u."""
    rows = []
    columns = []
    values = []
    count = 0
    for body in bodies:
        own = body.motions[:, np.abs(body.motions).max(axis=0) > 0]
        rows.append(np.repeat(body.rows, own.shape[1]))
        columns.append(np.tile(count + np.arange(own.shape[1]), len(own)))
        values.append(own.ravel())
        count += own.shape[1]
    where = np.concatenate(rows), np.concatenate(columns)
    return scipy.sparse.csr_matrix((np.concatenate(values), where), shape=(size, count))


def _rows(constraints: Sparse, fixed: BoolArray, scale: Array) -> Sparse:
    """Constraints scaled to unit size, and one row for each fixed dof."""
    size = np.asarray(abs(constraints) @ scale).ravel()
    keep = size > 0
    units = scipy.sparse.identity(len(fixed), format="csr")[np.flatnonzero(fixed)]
    units = scipy.sparse.diags(1 / scale[fixed]) @ units
    return scipy.sparse.vstack(
        [scipy.sparse.diags(1 / size[keep]) @ constraints[keep], units]
    ).tocsr()


def _null_space(E: Array | Sparse) -> Array:
    """Orthonormal basis (k, r) of the null space of E (m, k)."""
    k = E.shape[1]
    if not E.shape[0]:
        return np.eye(k)
    R = np.zeros((0, k))
    for some in np.array_split(np.arange(E.shape[0]), 1 + E.shape[0] * k // ENTRIES_AT_ONCE):
        own = E[some].toarray() if scipy.sparse.issparse(E) else E[some]
        R = scipy.linalg.qr(np.vstack([R, own]), mode="r")[0][:k]
    _, values, right = np.linalg.svd(R)
    values = np.concatenate([values, np.zeros(k - len(values))])
    return np.asarray(right[values <= SATISFIES * max(1.0, values[0])].T)


def _excluding_rigid(found: Array, rigid: Array) -> Array:
    """Orthonormal basis of the motions `found` orthogonal to `rigid`."""
    if not found.shape[1]:
        return found
    basis = np.linalg.qr(rigid)[0] if rigid.shape[1] else rigid
    left = found - basis @ (basis.T @ found)
    left -= basis @ (basis.T @ left)
    U, values, _ = np.linalg.svd(left, full_matrices=False)
    count = found.shape[1] - rigid.shape[1]
    return np.asarray(U[:, :count] * values[:count])


def described(one: RigidDofs, motions: Array) -> str:
    """The motions (rows of u, m) of a body as text, such as "translation along x"."""
    coefficients = np.linalg.lstsq(one.motions, motions[one.rows], rcond=1e-9)[0]
    size = np.linalg.norm(coefficients, axis=0)
    return support.of_body(coefficients[:, size > STILL] / size[size > STILL], one.centre, one.size)


#: A part is at rest if its motion is below this fraction of the largest.
AT_REST = 1e-6
#: A motion has no mass if its mass is below this fraction of the largest.
IDLE_MASS = 1e-12
#: Force of a motion without strain over that of the entries of K; rounding leaves about 1e-15.
MECHANISM_FORCE = 1e-9


def modes_of(
    layout: Layout,
    local: Shares,
    K: Matrix,
    M: Matrix,
    eliminated: Eliminated,
    rigid: Array,
    mechanisms: Array,
    moving: Sequence[RigidDofs],
) -> tuple[Array, float]:
    """(M-orthonormal strain-free motions (rows of this rank, r), first shift)."""
    found = local.own(eliminated.coordinates(np.hstack([rigid, mechanisms])))
    comm = local.comm
    modes = orthonormal(comm, M, found)
    if modes.shape[1] < found.shape[1]:
        values, turn = np.linalg.eigh(dot(comm, found, multiply(M, found)))
        idle = eliminated.T @ local.whole(found @ turn[:, values <= IDLE_MASS * values[-1]])
        points = [one for one in moving if np.abs(idle[one.rows]).max() > STILL]
        raise InputError(
            "a reference point moves without resistance and without mass: "
            f"{_in_words(idle, points)}; join it, support it, or give it a mass."
        )
    if not modes.shape[1]:
        return modes, 0.0
    u = eliminated.T @ local.whole(modes)
    least = AT_REST * np.abs(u).max()
    left = max(_force_ratio(local.of[m.name], u, u[m.rows], least) for m in layout.members.values())
    if left > MECHANISM_FORCE:
        raise AccuracyError(
            f"a motion that no joint resists strains the assembly (‖K r‖/(‖K‖‖r‖) = {left:.1e}, "
            f"limit {MECHANISM_FORCE:.0e}): parts or their distances differ too much in size for "
            "double precision."
        )
    if modes.shape[1] == np.count_nonzero(~eliminated.dependent):
        return modes, 1.0  # any will do
    size = float((layout.high - layout.low).max())
    places = layout.places
    polynomial = np.column_stack(
        [
            local.own(eliminated.coordinates(places.values(field, layout.middle, size)))
            for _, field in polynomials(2 if layout.plane else 3)
        ]
    )
    return modes, SHIFT * support.first_elastic(comm, K, M, polynomial, modes)


def _force_ratio(share: Share, u: Array, motions: Array, least: float) -> float:
    """Largest force of motions u (n, k) in a part, relative to the absolute values of K's entries.

    Those whose `motions` of the part (rows, k) are below `least` count as rounding.
    """
    moves = np.abs(motions).max(axis=0) > least
    if not moves.any():
        return 0.0
    moving = u[share.rows][:, moves]
    K = share.part.K
    return float(force_ratios(K, moving, multiply(K, moving)).max())


def warn_of_motions(
    layout: Layout,
    rigid: Array,
    mechanisms: Array,
    moving: Sequence[RigidDofs],
    *,
    supported: bool,
) -> None:
    """Warn of mechanisms, and of rigid motions that the supports permit."""
    if mechanisms.shape[1]:
        warn(
            "the joints leave parts free to move without strain: "
            f"{_in_words(mechanisms, moving)}; join or hold them unless it is intended.",
        )
    if supported and rigid.shape[1]:
        warn(
            "the supports leave the assembly free to move as a rigid body: "
            f"{described(whole_body(layout), rigid)}; hold that too unless it is intended.",
        )


def _in_words(mechanisms: Array, moving: Sequence[RigidDofs]) -> str:
    """The mechanisms as text, body by body."""
    names: dict[str, str] = {}
    for one in moving:
        names.setdefault(one.name, described(one, mechanisms))
    return "; ".join(f"{name!r}: {words}" for name, words in names.items())


Found = TypeVar("Found")
Loads = TypeVar("Loads", Array, Sparse)


class Added:
    """Contributions of joints and attachments to the matrices of the parts.

    Attributes
    ----------
    K, M : (n, n) in q.
    mass : total mass, kg.
    """

    def __init__(self, elastic: Sequence[Stiffness], T: Sparse) -> None:
        self._elastic = [(one, rounded(one.G @ T)) for one in elastic]
        self.mass = float(sum(one.mass for one in elastic))
        every = stacked([G for _, G in self._elastic], T.shape[1])

        def whole(blocks: Sequence[Array]) -> Sparse:
            return (every.T @ scipy.sparse.block_diag([np.zeros((0, 0)), *blocks]) @ every).tocsr()

        self.K, self.M = whole([one.k for one in elastic]), whole([one.m for one in elastic])

    def dissipation(self, *, on_u: bool = False) -> list[Dissipation]:
        """Dashpots and Maxwell branches on q, or on u before the parts are joined."""
        both = [(one, one.G if on_u else G) for one, G in self._elastic]
        named = [(one, partial(Dissipation, G, name=one.name, point=one.point)) for one, G in both]
        found = [term(one.c) for one, term in named if one.c is not None]
        return found + [term(k, t) for one, term in named for k, t in one.branches]

    def springs(self) -> list[Dissipation]:
        """The springs as functionals of u, with their stiffnesses."""
        every = [one for one, _ in self._elastic]
        return [Dissipation(one.G, one.k, name=one.name, point=one.point) for one in every]

    def mass_on_u(self, count: int) -> Sparse:
        """Mass matrix (n, n) of the point masses on the `count` dofs u."""
        own = [one.G.T @ scipy.sparse.csr_matrix(one.m) @ one.G for one, _ in self._elastic]
        return sum(own, Sparse((count, count))).tocsr()

    def forces(self, motions: Array) -> Array:
        """Elastic forces in q (n, j) for motions of u (n, j)."""
        forces = np.zeros(motions.shape)
        for one, G in self._elastic:
            forces += G.T @ (one.k @ (one.G @ motions))
        return forces

    def inertial_loads(self, motions: Array) -> tuple[Array, Array]:
        """For motions r of u (n, j): M r on the coordinates q (n, j), and rᵀ M r (j, j), of the
        masses.
        """
        loads = np.zeros(motions.shape)
        energies = np.zeros((motions.shape[1],) * 2)
        for one, G in self._elastic:
            moved = one.G @ motions
            loads += G.T @ (one.m @ moved)
            energies += moved.T @ one.m @ moved
        return loads, energies


@dataclass(eq=False)
class AssembledMatrices(StructureMatrices):
    """K = Tᵀ K_b T and M = Tᵀ M_b T of parts with the block-diagonal matrices K_b and M_b.

    Dependent dofs keep their rows, as fixed ones do: 1 on K's diagonal, 0 in M.
    """

    _: KW_ONLY
    layout: Layout  # the parts in their places
    eliminated: Eliminated  # T and the dofs that depend on others
    added: Added  # what joints and attachments add
    #: the rows of this rank; what is said of all dofs (layout, T) every rank has whole
    local: Shares
    #: from which T was made, the supports of the assembly first; on rank 0 alone
    constraints: Constraints | None

    assembled: ClassVar[bool] = True

    @property
    def T(self) -> Sparse:
        """(n, n), u = T q; the columns of dependent dofs are empty."""
        return self.eliminated.T

    @property
    def comm(self) -> MPI.Comm:
        """The MPI communicator that shares the matrices."""
        return self.local.comm

    @property
    def mass(self) -> float:
        for name in self.layout.condensed:
            raise InputError(f"the mass of the part {name!r} is not known: it is a superelement.")
        own = sum(member.part.mass for member in self.layout.members.values())
        return float(own + self.added.mass)

    @property
    def plausibility(self) -> Plausibility:
        known = [member.part.plausibility for member in self.layout.members.values()]
        doubts = list(dict.fromkeys(text for one in known for text in one.get("doubts", ())))
        found: Plausibility = {"doubts": doubts} if doubts else {}
        if known and not self.layout.condensed:
            found["wave_speed"] = max(one["wave_speed"] for one in known)
        if sheets := [one["thickness"] for one in known if "thickness" in one]:
            found["thickness"] = min(sheets)
        return found

    @property
    def dimensions(self) -> Box:
        box = sorted((self.layout.high - self.layout.low).tolist(), reverse=True)
        # sheets in one plane and beams on one line have a box without a thickness
        members = [member.part.dimensions for member in self.layout.members.values()]
        least = np.min(members or [(0.0, 0.0, 0.0)], axis=0)
        length, width, depth = np.maximum(box, least).tolist()
        return length, width, depth

    def constants(self) -> tuple[float, float, float]:
        return next(iter(self.layout.members.values())).part.constants()

    def uniform_inertia(self, direction: Array) -> Array | None:
        direction = floats("direction", direction, (3,))
        if self.layout.condensed:  # their sites do not tell all of their mass
            return None
        moving = self.places.rigid_motions(np.zeros(3))[:, :3] @ direction

        def work() -> Array:  # by one rank: the form is compiled once
            own = np.zeros(self.layout.count)
            load = self.added.inertial_loads(moving[:, None])[0][:, 0]
            for member in self.layout.members.values():
                along = member.at.rotation.T @ direction
                own[member.rows] = member.part.uniform_inertia(along)
            return np.asarray(self.T.T @ own + load)

        return self.local.own(on_root(self.comm, work))

    @cached_property
    def rigid_inertia(self) -> tuple[Inertia, Array] | None:
        if not self.rigid_modes.shape[1] or self.layout.condensed:
            return None
        point = self.layout.middle
        motions = self.places.rigid_motions(point)
        added, S = self.added.inertial_loads(motions)
        loads = self.local.of_parts(MeshedStructure.inertial_loads, motions)
        S += self.comm.allreduce(motions.T @ loads)
        loads = self.local.summed(np.asarray(self.T.T @ loads)) + self.local.own(added)
        return Inertia(point, (S + S.T) / 2, np.zeros((0, 6))), loads

    @property
    def rigid_motions(self) -> Array:
        motions = self.eliminated.coordinates(self.layout.places.rigid_motions(self.layout.middle))
        return self.local.own(motions[:, np.abs(motions).max(axis=0) > 0])

    def describe(self, dofs: int) -> str:
        names = self.layout.names
        shown = ", ".join(names if len(names) < 7 else [*names[:5], f"{len(names) - 5} more"])
        return (
            f"assembly of {len(names)} parts ({shown}), {dofs} dofs, "
            f"{self.rigid_modes.shape[1]} rigid-body modes{self.loads_told}"
        )

    def dissipation(self) -> list[Dissipation]:
        """Dashpots, Maxwell branches, layers that relax, damping of superelements."""
        rows = self.local.rows
        found = [replace(one, G=one.G[:, rows]) for one in self.added.dissipation()]
        for member in self.layout.members.values():
            T = self.T[member.rows]
            dashpots = [one for one in member.part.dissipation() if one.matrix is None]
            found += [replace(one, G=(one.G @ T)[:, rows]) for one in dashpots]
        return found + self._layers

    @cached_property
    def _layers(self) -> list[Dissipation]:
        """Relaxing layers of all parts, and the damping of superelements, as terms on q."""
        found = []
        made = dict[tuple[str, int], PETSc.Mat]()
        for part in self.layout.condensed.values():
            if part.part.C is not None:
                T = self.T[part.rows]
                C = (T.T @ scipy.sparse.csr_matrix(part.part.C) @ T).tocsr()[self.local.rows]
                C.sort_indices()
                found.append(Dissipation(matrix=self.local.matrix("C", C)))
        for name, share in self.local.of.items():
            for one in share.part.dissipation():
                if one.matrix is None:
                    continue
                key = name, id(one.matrix)
                if key not in made:
                    made[key] = self._on_q({name: one.matrix})
                owner = (name, one.owner[1]) if one.owner else None
                found.append(replace(one, matrix=made[key], owner=owner))
        return found

    def _on_q(self, matrices: Mapping[str, PETSc.Mat]) -> PETSc.Mat:
        """Matrices of some parts, projected on q."""
        nothing = Sparse((self.layout.count,) * 2)
        K = _projected(self.local, self.eliminated, self.local.rows_of(matrices), nothing)
        return self.local.matrix("K", K)

    @property
    def lossy(self) -> bool:
        return any(member.part.lossy for member in self.layout.members.values())

    def loss_stiffness(self, V: Array) -> Array | None:
        parts = [share for share in self.local.of.values() if share.part.lossy]
        if not parts:
            return None
        u = self.expanded(V)
        own = [share.part.loss_stiffness(u[share.rows]) for share in parts]
        return np.asarray(np.sum([each for each in own if each is not None], axis=0))

    # -- from u to the parts

    def members(self, name: str | None = None) -> list[Member]:
        if name is None:
            return list(self.layout.members.values())
        if name in self.layout.condensed:
            raise InputError(
                f"the part {name!r} is a superelement without a mesh: its sites are struck by "
                "name, and its fields are those of its own structure."
            )
        if name not in self.layout.members:
            parts = name_list(name, self.layout.names, "its parts")
            raise InputError(f"the assembly has no part {name!r}; {parts}.")
        return [self.layout.members[name]]

    #: every rank has u whole and works alone
    workers: ClassVar[MPI.Comm] = MPI.COMM_SELF

    @property
    def places(self) -> DofPlaces:
        """Node, direction and kind of each dof of u."""
        return self.layout.places

    def expanded(self, q: Array) -> Array:
        """Motions u of the whole assembly for columns q (rows of this rank, k)."""
        return np.asarray(self.T @ self.local.whole(q))

    def joined(self, loads: Loads, rows: slice = slice(None)) -> Loads:
        """Project loads on some rows of u on the whole vector q."""
        return self.T[rows].T @ loads

    def fields(self, shapes: Array, name: str | None = None) -> list[tuple[Member, Array]]:
        """(part, shapes on its dofs (rows, k)) of all parts, or of part `name`, for columns of q.

        All ranks must call it.
        """
        members = self.members(name)
        u = self.expanded(shapes)
        return [(member, u[member.rows]) for member in members]

    def decided(self, work: Callable[[], Found]) -> Found:
        """The result of `work()` on rank 0, used on all ranks, since rounding could decide
        otherwise elsewhere.
        """
        return on_root(self.comm, work)

    def own(self, rows: Array) -> Array:
        """The rows of this rank of a complete vector that `decided` work returned."""
        return self.local.own(rows)


def stacked(functionals: Sequence[Sparse], count: int) -> Sparse:
    """Functionals stacked as rows of one matrix."""
    return scipy.sparse.vstack([Sparse((0, count)), *functionals]).tocsr()


def block_of(layout: Layout) -> int:
    """Number of dofs of a node; 1 if it differs between the parts.

    The factor is ordered by the coupling of the first dof of each node. With blocks of half a node,
    that of the rotations of a flat sheet would be coupled to no displacement, and the ordering
    would be useless.
    """
    blocks = {m.block for m in layout.members.values()}
    if len(blocks) > 1:
        return 1
    others = layout.points or layout.condensed
    return int(np.gcd(blocks.pop(), POINT_DOFS if others else 0))


def reduced(local: Shares, eliminated: Eliminated, added: Added) -> tuple[PETSc.Mat, PETSc.Mat]:
    """(K, M) of joined parts."""
    parts = {name: share.part for name, share in local.of.items()}
    diagonal = scipy.sparse.diags(eliminated.dependent.astype(float)).tocsr()
    own = local.rows_of({name: part.K for name, part in parts.items()})
    K = local.matrix("K", _projected(local, eliminated, own, added.K + diagonal))
    own = local.rows_of({name: part.M for name, part in parts.items()})
    M = local.matrix("M", _projected(local, eliminated, own, added.M))
    if any(by_strains(part.K) for part in parts.values()):
        K.setAttr(PRODUCT, _product(local, eliminated, added))
    return K, M


def _projected(local: Shares, eliminated: Eliminated, K: Sparse, added: Sparse) -> Sparse:
    """The rows of this rank of Tᵀ K T + added; `K` (m, n): its rows of K, which is overwritten.

    With E the identity on the dofs that stay and D the rows of T of the others, the first term is
    E K E + E K D + Dᵀ K E + Dᵀ K D, in which all products except E K E are small: every rank has
    them whole.
    """
    same = _unchanged(eliminated.T)
    which = np.flatnonzero(~same)
    own = np.flatnonzero(~same[local.rows])
    forces = local.added((K[own].T @ eliminated.T[local.rows][own]).tocsr())  # K symmetric
    across = (scipy.sparse.diags(same.astype(float)) @ forces).tocsr()
    inside = (eliminated.T[which].T @ forces[which]).tocsr()
    small = (across + across.T + (inside + inside.T) / 2 + added).tocsr()
    small.sum_duplicates()
    for row in own:
        K.data[K.indptr[row] : K.indptr[row + 1]] = 0.0
    K.data[~same[K.indices]] = 0.0
    result = (K + local.own(small)).tocsr()
    result.eliminate_zeros()
    result.sort_indices()
    return result


def _unchanged(T: Sparse) -> BoolArray:
    """Mask (n,): dofs of u that are dofs of q."""
    row = row_numbers(T)
    own = (np.diff(T.indptr)[row] == 1) & (T.indices == row) & (T.data == 1.0)
    same = np.zeros(T.shape[0], dtype=bool)
    same[row[own]] = True
    return same


def _product(local: Shares, eliminated: Eliminated, added: Added) -> Callable[[Array], Array]:
    """Product with K through the accurate products of the parts."""
    T = eliminated.T
    back = T.T.tocsr()
    small = (added.K + scipy.sparse.diags(eliminated.dependent.astype(float))).tocsr()[local.rows]

    def force(part: MeshedStructure, u: Array) -> Array:
        return multiply(part.K, u)

    def product(own: Array) -> Array:
        x = local.whole(own)
        forces = local.of_parts(force, T @ x)
        return local.summed(np.asarray(back @ forces)) + np.asarray(small @ x)

    return product
