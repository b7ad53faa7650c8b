"""`AssembledMatrices`: K and M of several parts whose dofs follow u = T q."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import KW_ONLY, dataclass, replace
from functools import cached_property
from typing import ClassVar, TypeVar

import numpy as np
import scipy.sparse
from mpi4py import MPI
from petsc4py import PETSc

from antiosc.base._types import Array, BoolArray, Box
from antiosc.base.checks import array
from antiosc.base.errors import InputError, known
from antiosc.fem.assembly.joint import Constraints, Eliminated, Stiffness
from antiosc.fem.assembly.layout import POINT_DOFS, Layout, Sparse, row_numbers
from antiosc.fem.assembly.motions import rigid_motions
from antiosc.fem.assembly.parts import Share
from antiosc.fem.assembly.wide import rounded
from antiosc.fem.linalg.algebra import by_strains, multiply
from antiosc.fem.linalg.petsc_algebra import PRODUCT, csr, from_csr
from antiosc.fem.platform.mpi import on_root
from antiosc.fem.structure.dissipation import Dissipation
from antiosc.fem.structure.matrices import Plausibility, StructureMatrices
from antiosc.fem.structure.meshed import Member
from antiosc.models.motion import Inertia

Found = TypeVar("Found")


class Added:
    """What joints and attachments add to the matrices of the parts.

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

    def dissipation(self) -> list[Dissipation]:
        """Dashpots and Maxwell branches, of q."""
        found = [Dissipation(G, one.c) for one, G in self._elastic if one.c is not None]
        return found + [Dissipation(G, k, t) for one, G in self._elastic for k, t in one.branches]

    def forces(self, motions: Array) -> Array:
        """Elastic forces in q (n, j) for motions of u (n, j)."""
        forces = np.zeros(motions.shape)
        for one, G in self._elastic:
            forces += G.T @ (one.k @ (one.G @ motions))
        return forces

    def inertial_loads(self, motions: Array) -> tuple[Array, Array]:
        """(M r in q (n, j), rᵀ M r (j, j)) of the masses for motions r of u (n, j)."""
        loads, energies = np.zeros(motions.shape), np.zeros((motions.shape[1],) * 2)
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
    share: Share
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
        return self.share.comm

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
        length, width, depth = sorted(self.layout.high - self.layout.low, reverse=True)
        return float(length), float(width), float(depth)

    def constants(self) -> tuple[float, float, float]:
        return next(iter(self.layout.members.values())).part.constants()

    def uniform_inertia(self, direction: Array) -> Array | None:
        direction = array("direction", direction, (3,))
        if self.layout.condensed:  # their sites do not tell all of their mass
            return None
        moving = rigid_motions(self.layout, np.zeros(3))[:, :3] @ direction

        def work() -> Array:  # by one rank: the form is compiled once
            own = np.zeros(self.layout.count)
            load = self.added.inertial_loads(moving[:, None])[0][:, 0]
            for member in self.layout.members.values():
                along = member.at.rotation.T @ direction
                own[member.rows] = member.part.uniform_inertia(along)
            return np.asarray(self.T.T @ own + load)

        return self.share.own(on_root(self.comm, work))

    @cached_property
    def rigid_inertia(self) -> tuple[Inertia, Array] | None:
        if not self.rigid_modes.shape[1] or self.layout.condensed:
            return None
        point = (self.layout.low + self.layout.high) / 2
        motions = rigid_motions(self.layout, point)
        added, S = self.added.inertial_loads(motions)
        loads = np.zeros(motions.shape)
        for member in self.layout.members.values():
            loads[member.rows] = member.part.inertial_loads(motions[member.rows])
            S += motions[member.rows].T @ loads[member.rows]
        loads = self.share.own(np.asarray(self.T.T @ loads + added))
        return Inertia(point, (S + S.T) / 2, np.zeros((0, 6))), loads

    @property
    def rigid_motions(self) -> Array:
        point = (self.layout.low + self.layout.high) / 2
        motions = self.eliminated.coordinates(rigid_motions(self.layout, point))
        return self.share.own(motions[:, np.abs(motions).max(axis=0) > 0])

    def describe(self, dofs: int) -> str:
        names = self.layout.names
        shown = ", ".join(names if len(names) < 7 else [*names[:5], f"{len(names) - 5} more"])
        return (
            f"assembly of {len(names)} parts ({shown}), {dofs} dofs, "
            f"{self.rigid_modes.shape[1]} rigid-body modes"
        )

    def dissipation(self) -> list[Dissipation]:
        """Dashpots, Maxwell branches and layers that relax, of joints and parts."""
        rows = self.share.rows
        found = [replace(one, G=one.G[:, rows]) for one in self.added.dissipation()]
        for member in self.layout.members.values():
            T = self.T[member.rows]
            dashpots = [one for one in member.part.dissipation() if one.matrix is None]
            found += [replace(one, G=(one.G @ T)[:, rows]) for one in dashpots]
        return found + self._layers

    @cached_property
    def _layers(self) -> list[Dissipation]:
        """The layers of all parts that relax, on q."""
        found, made = [], dict[int, PETSc.Mat]()
        for member in self.layout.members.values():
            T = self.T[member.rows]
            for one in member.part.dissipation():
                if one.matrix is None:
                    continue
                if id(one.matrix) not in made:
                    whole = (T.T @ csr(one.matrix) @ T).tocsr()
                    whole.sort_indices()
                    block = block_of(self.layout)
                    made[id(one.matrix)] = self.share.matrix(from_csr("K", whole), block)
                found.append(replace(one, matrix=made[id(one.matrix)]))
        return found

    @property
    def lossy(self) -> bool:
        return any(member.part.lossy for member in self.layout.members.values())

    def loss_stiffness(self, V: Array) -> Array | None:
        parts = [member for member in self.layout.members.values() if member.part.lossy]
        if not parts:
            return None
        q = self.share.whole(V)
        own = [member.part.loss_stiffness(self.T[member.rows] @ q) for member in parts]
        return np.asarray(np.sum([each for each in own if each is not None], axis=0))

    # -- from u to the parts

    def members(self, name: str | None = None) -> list[Member]:
        """All parts in their places, or the one that is named."""
        if name is None:
            return list(self.layout.members.values())
        if name in self.layout.condensed:
            raise InputError(
                f"the part {name!r} is a superelement without a mesh: its sites are struck by "
                "name, and its fields are those of its own structure."
            )
        if name not in self.layout.members:
            parts = known(name, self.layout.names, "its parts")
            raise InputError(f"the assembly has no part {name!r}; {parts}.")
        return [self.layout.members[name]]

    def fields(self, shapes: Array, name: str | None = None) -> list[tuple[Member, Array]]:
        """(part, its dofs (rows, k)) of all parts, or of the one named, for columns of q.

        `shapes` (rows of this rank, k); every rank has the parts whole. All ranks must call it.
        """
        members = self.members(name)
        q = self.share.whole(shapes)
        return [(member, np.asarray(self.T[member.rows] @ q)) for member in members]

    #: every rank has the parts whole and works alone
    workers: ClassVar[MPI.Comm] = MPI.COMM_SELF

    def decided(self, work: Callable[[], Found]) -> Found:
        """The result of `work()` by rank 0, since another may choose otherwise by rounding."""
        return on_root(self.comm, work)

    def own(self, rows: Array) -> Array:
        """The rows of this rank of what `decided` work has found whole."""
        return self.share.own(rows)

    def joined(self, member: Member, loads: Sparse) -> Sparse:
        """Loads (rows, …) on the dofs of a part as loads on q, whole."""
        return self.T[member.rows].T @ loads


def stacked(functionals: Sequence[Sparse], count: int) -> Sparse:
    """Functionals one under the other."""
    return scipy.sparse.vstack([Sparse((0, count)), *functionals]).tocsr()


def block_of(layout: Layout) -> int:
    """Dofs of a node; 1 where those of the parts differ.

    The factor is ordered by the first dof of each node. In half a node of a flat sheet, a rotation,
    that dof is coupled to none of the other half, and the order would be of no use.
    """
    blocks = {m.block for m in layout.members.values()}
    if len(blocks) > 1:
        return 1
    others = layout.points or layout.condensed
    return int(np.gcd(blocks.pop(), POINT_DOFS if others else 0))


def reduced(layout: Layout, eliminated: Eliminated, added: Added) -> tuple[PETSc.Mat, PETSc.Mat]:
    """(K, M) of joined parts, on this rank alone."""
    block = block_of(layout)
    parts = [m.part for m in layout.members.values()]
    diagonal = scipy.sparse.diags(eliminated.dependent.astype(float)).tocsr()
    K = _projected(layout, eliminated, [csr(p.K) for p in parts], added.K + diagonal)
    M = _projected(layout, eliminated, [csr(p.M) for p in parts], added.M)
    K, M = (from_csr(name, matrix) for name, matrix in (("K", K), ("M", M)))
    for matrix in (K, M):
        matrix.setBlockSizes(block, block)
    alone = Share(MPI.COMM_SELF, 0, layout.count)
    take_by_strains(K, layout, eliminated, added, alone)
    return K, M


def take_by_strains(
    K: PETSc.Mat, layout: Layout, eliminated: Eliminated, added: Added, share: Share
) -> None:
    """Let products with K be taken by the strains of the parts, where some part has them."""
    if any(by_strains(m.part.K) for m in layout.members.values()):
        K.setAttr(PRODUCT, _product(layout, eliminated, added, share))


def _projected(
    layout: Layout, eliminated: Eliminated, blocks: Sequence[Sparse], added: Sparse
) -> Sparse:
    """Tᵀ (blocks) T + added.

    With E, the identity on the dofs that stay, and D, the rows of T of those that do not, the first
    is E K E + E K D + Dᵀ K E + Dᵀ K D: but for E K E the products are small.
    """
    K = _side_by_side(blocks, layout.count)
    same = _unchanged(eliminated.T)
    which = np.flatnonzero(~same)
    D = eliminated.T[which]
    forces = (K[which].T @ D).tocsr()  # K symmetric
    across = (scipy.sparse.diags(same.astype(float)) @ forces).tocsr()
    inside = (D.T @ forces[which]).tocsr()
    small = (across + across.T + (inside + inside.T) / 2 + added).tocsr()
    small.sum_duplicates()
    for row in which:
        K.data[K.indptr[row] : K.indptr[row + 1]] = 0.0
    K.data[~same[K.indices]] = 0.0
    result = (K + small).tocsr()
    result.eliminate_zeros()
    result.sort_indices()
    return result


def _unchanged(T: Sparse) -> BoolArray:
    """Which dofs of u are dofs of q (n,)."""
    row = row_numbers(T)
    own = (np.diff(T.indptr)[row] == 1) & (T.indices == row) & (T.data == 1.0)
    same = np.zeros(T.shape[0], dtype=bool)
    same[row[own]] = True
    return same


def _side_by_side(blocks: Sequence[Sparse], count: int) -> Sparse:
    """A block-diagonal matrix; the dofs after the last block have empty rows."""
    starts = np.cumsum([0, *(b.shape[0] for b in blocks)])
    ends = np.cumsum([0, *(b.nnz for b in blocks)])
    pointers = [b.indptr[:-1] + end for b, end in zip(blocks, ends[:-1], strict=True)]
    rest = np.full(count - starts[-1] + 1, ends[-1])
    indices = [b.indices + start for b, start in zip(blocks, starts[:-1], strict=True)]
    parts = (
        np.concatenate([b.data for b in blocks]),
        np.concatenate(indices),
        np.concatenate([*pointers, rest]),
    )
    result = scipy.sparse.csr_matrix(parts, shape=(count, count))
    result.has_canonical_format = True  # as those of PETSc have: no search for duplicates
    return result


def _product(
    layout: Layout, eliminated: Eliminated, added: Added, share: Share
) -> Callable[[Array], Array]:
    """Products with K by the accurate products of the parts."""
    T, back = eliminated.T, eliminated.T.T.tocsr()
    kept = scipy.sparse.diags(eliminated.dependent.astype(float))

    def product(own: Array) -> Array:
        x = share.whole(own)
        u = T @ x
        force = np.zeros(u.shape)
        for member in layout.members.values():
            force[member.rows] += multiply(member.part.K, u[member.rows])
        return share.own(np.asarray(back @ force + added.K @ x + kept @ x))

    return product
