"""A distributed Cholesky factor: each rank condenses its part of the body onto the interface.

The interface Γ is the smallest set of nodes that separates the parts of the ranks. Each rank
factors its interior and Γ by CHOLMOD, Γ last: with L_Γ the block of Γ in the factor of

    [A_II  A_IΓ]
    [A_ΓI  A_ΓΓ]    L_Γ L_Γᵀ = A_ΓΓ - A_ΓI A_II⁻¹ A_IΓ,

and the Schur complement of the whole is S = A_ΓΓ + Σ (L_Γ L_Γᵀ - A_ΓΓ) over the ranks: a small
dense matrix on every rank. A solve consists of a forward substitution on each rank, one sum over
the ranks, a dense solve, and a backward substitution (Przemieniecki, AIAA J. 1 (1963) 138).

On two ranks MUMPS takes 1.8 to 3 times as long for the factor of a bracket, 4 to 10 times as long
for a solve and 4 to 7 times as long for 16, in half of the memory
(benchmarks/speed/cholmod_or_mumps.md).
"""

from __future__ import annotations

import numpy as np
import scipy.linalg
import scipy.sparse
from mpi4py import MPI
from petsc4py import PETSc
from scipy.sparse.csgraph import breadth_first_order, maximum_bipartite_matching

from antiosc.base._types import Array, IntArray
from antiosc.base.errors import NotConvergedError
from antiosc.fem.linalg.cholmod import Cholesky, NotPositiveDefiniteError
from antiosc.fem.linalg.solver import SINGULAR, Factorization
from antiosc.fem.platform.mpi import agree, on_root


class Substructures(Factorization):
    """Cholesky factor of a matrix whose rows are spread over the ranks.

    Parameters
    ----------
    interface : global rows of Γ, ascending, from `interface`
    """

    def __init__(self, A: PETSc.Mat, interface: IntArray) -> None:
        self._interface = interface
        super().__init__(A)

    def _set_up(self) -> None:
        A, comm = self.A, self.comm
        first, last = A.getOwnershipRange()
        pointers, columns, values = A.getValuesCSR()
        own = scipy.sparse.csr_matrix(
            (values, columns, pointers), shape=(last - first, A.getSize()[0])
        )
        # places in Γ of the rows of this rank in it, and those rows
        self._at = np.flatnonzero((self._interface >= first) & (self._interface < last))
        self._mine = self._interface[self._at] - first
        within = np.ones(last - first, dtype=bool)
        within[self._mine] = False
        self._inner = np.flatnonzero(within)
        whole = self._between(own[self._mine])
        # Γ as far as this rank's interior meets it stands in front: CHOLMOD reads columns that
        # come before the diagonal.
        rows = own[self._inner]
        position = np.full(A.getSize()[0], -1, dtype=np.int32)
        position[self._interface] = np.arange(len(self._interface))
        met = position[rows.indices]
        self._met = np.unique(met[met >= 0])
        count = len(self._met)
        position[self._interface[self._met]] = np.arange(count)
        position[first + self._inner] = count + np.arange(len(self._inner))
        n = count + len(self._inner)
        rows = scipy.sparse.csr_matrix(
            (rows.data, position[rows.indices], rows.indptr), shape=(len(self._inner), n)
        )
        corner = whole[self._met][:, self._met]
        S = whole.toarray() if comm.rank == 0 else np.zeros(whole.shape)
        error: Exception | None = None
        try:
            if len(self._inner):
                corner.resize((count, n))
                local = scipy.sparse.vstack([corner, rows], format="csr")
                self._factor = Cholesky(local, A.getBlockSize(), last=count)
                del local, rows, own
                self._to = np.argsort(self._factor.permutation)  # where a row stands in L
                order, self._L = self._factor.corner(count)
                self._positions = self._to[order]
                self._met = self._met[order]
                S[np.ix_(self._met, self._met)] += _square(self._L)
                S[np.ix_(self._met, self._met)] -= whole[self._met][:, self._met].toarray()
        except NotPositiveDefiniteError as caught:
            error = NotConvergedError(SINGULAR.format(caught))
        except Exception as caught:  # the other ranks must not wait for this one
            error = caught
        agree(comm, error)
        comm.Allreduce(MPI.IN_PLACE, S)
        try:
            self._S = scipy.linalg.cho_factor(S, lower=True, overwrite_a=True) if len(S) else None
        except scipy.linalg.LinAlgError as caught:
            raise NotConvergedError(SINGULAR.format(caught)) from caught

    def _between(self, rows: scipy.sparse.csr_matrix) -> scipy.sparse.csr_matrix:
        """A_ΓΓ on all ranks, from the rows of Γ that each has."""
        part = rows[:, self._interface].tocoo()
        found = self.comm.allgather((self._at[part.row], part.col, part.data))
        row, column, value = (np.concatenate(parts) for parts in zip(*found, strict=True))
        n = len(self._interface)
        return scipy.sparse.csr_matrix((value, (row, column)), shape=(n, n))

    @property
    def entries(self) -> float:
        """Entries of the factors of all ranks, and of the interface's."""
        own = self._factor.supernodes.values.size if len(self._inner) else 0
        return float(self.comm.allreduce(own) + len(self._interface) ** 2)

    def solve_block(self, R: Array) -> Array:
        """A⁻¹R for a block of vectors (rows of this rank, k)."""
        load = np.zeros((len(self._interface), R.shape[1]))
        load[self._at] = R[self._mine]
        if len(self._inner):
            B = np.zeros((len(self._to), R.shape[1]), order="F")
            B[self._to[-len(self._inner) :]] = R[self._inner]
            Y = self._factor.forward(B)
            load[self._met] += self._L @ Y[self._positions]
        self.comm.Allreduce(MPI.IN_PLACE, load)
        U = scipy.linalg.cho_solve(self._S, load) if self._S else load
        X = np.empty(R.shape, order="F")
        X[self._mine] = U[self._at]
        if len(self._inner):
            Y[self._positions] = self._L.T @ U[self._met]
            X[self._inner] = self._factor.backward(Y)[self._to[-len(self._inner) :]]
        return X


def _square(L: Array) -> Array:
    """L Lᵀ of a lower triangle, with a third of the operations of a product."""
    if not L.size:  # this part meets no other
        return np.zeros(L.shape)
    reversed_L = np.array(L[::-1, ::-1], order="F")  # a copy: LAPACK writes over it
    upper, _ = scipy.linalg.lapack.dlauum(reversed_L, overwrite_c=1)
    square = np.triu(upper)[::-1, ::-1]
    return np.asarray(square + np.tril(square, -1).T)


def interface(A: PETSc.Mat) -> IntArray:
    """Global rows of whole nodes that separate the rows of different ranks."""
    comm = A.getComm().tompi4py()
    block = A.getBlockSize()
    first, last = A.getOwnershipRange()
    pointers, columns, _ = A.getValuesCSR()
    away = np.flatnonzero((columns < first) | (columns >= last))
    rows = first + np.searchsorted(pointers, away, side="right") - 1
    pairs = np.unique(np.column_stack([rows, columns[away]]) // block, axis=0)
    found = comm.gather(pairs)
    starts = np.array(comm.allgather(first)) // block

    def cut() -> IntArray:
        both = np.vstack(found)
        return _cut(both[both[:, 0] < both[:, 1]], starts)

    nodes = on_root(comm, cut)
    return np.asarray(block * nodes[:, None] + np.arange(block)).ravel()


def _cut(pairs: IntArray, starts: IntArray) -> IntArray:
    """Nodes that cover every pair of coupled nodes of two ranks, the smallest number for each two
    ranks."""
    owners = np.searchsorted(starts, pairs, side="right") - 1
    taken = np.zeros(0, dtype=int)
    for ranks in np.unique(owners, axis=0):
        some = pairs[(owners == ranks).all(axis=1)]
        some = some[~np.isin(some, taken).any(axis=1)]
        if len(some):
            taken = np.union1d(taken, _cover(some))
    return taken


def _cover(pairs: IntArray) -> IntArray:
    """The least vertex cover of a bipartite graph, by its largest matching (Kőnig's theorem)."""
    left, i = np.unique(pairs[:, 0], return_inverse=True)
    right, j = np.unique(pairs[:, 1], return_inverse=True)
    n, m = len(left), len(right)
    graph = scipy.sparse.csr_matrix((np.ones(len(pairs)), (i, j)), shape=(n, m))
    mate = maximum_bipartite_matching(graph, perm_type="column")
    matched = np.flatnonzero(mate >= 0)
    # reached from single nodes on the left, to the right by any pair and back by matched ones
    source = n + m
    single = np.flatnonzero(mate < 0)
    tails = np.concatenate([i, n + mate[matched], np.full(len(single), source)])
    heads = np.concatenate([n + j, matched, single])
    paths = scipy.sparse.csr_matrix(
        (np.ones(len(tails)), (tails, heads)), shape=(source + 1, source + 1)
    )
    reached = np.zeros(source + 1, dtype=bool)
    reached[breadth_first_order(paths, source, return_predecessors=False)] = True
    return np.concatenate([left[~reached[:n]], right[reached[n:source]]])
