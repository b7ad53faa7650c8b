"""The dofs of an assembly by rank.

Of u, and of q, a rank owns a contiguous range: parts that stand one after the other meet in few
dofs, as the ranges do. The matrices of a part are made on the ranks that share its mesh, and their
rows go to the ranks that own them. What is said of all dofs (layout, T) every rank has whole.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import TypeVar

import numpy as np
import scipy.sparse
from mpi4py import MPI
from numpy.typing import NDArray
from petsc4py import PETSc

from antiosc.base import process
from antiosc.base._types import Array, IntArray
from antiosc.fem.assembly.layout import Layout, Sparse
from antiosc.fem.assembly.parts import Superelement
from antiosc.fem.linalg.petsc_algebra import free, from_csr, with_entries
from antiosc.fem.platform import compat
from antiosc.fem.structure.meshed import Member, MeshedStructure

Scalar = TypeVar("Scalar", bound=np.generic)


@dataclass(frozen=True, eq=False)
class Share:
    """What a rank has of a part, as it was given.

    rows : number in u of each of its rows.
    counted : which of them no other rank has: all, but of a part that every rank has for itself.
    places : (rows of all ranks,) number in u of each column of its matrices.
    """

    part: MeshedStructure
    rows: IntArray
    counted: slice
    places: IntArray

    @classmethod
    def of(cls, comm: MPI.Comm, member: Member, given: MeshedStructure | Superelement) -> Share:
        """This rank's share of `given`; `member`: the assembly's copy of the whole part."""
        assert isinstance(given, MeshedStructure)
        if given.comm.size == 1:  # this rank has all of it
            rows = np.arange(member.first, member.first + given.rows, dtype=PETSc.IntType)
            first, last = (given.rows * rank // comm.size for rank in (comm.rank, comm.rank + 1))
            return cls(given, rows, slice(first, last), rows)
        nodes = _nodes_in_copy(given, member.part)
        rows = member.first + (member.block * nodes[:, None] + np.arange(member.block)).ravel()
        rows = rows.astype(PETSc.IntType)
        return cls(given, rows, slice(None), np.concatenate(comm.allgather(rows)))

    def entries(self, matrix: PETSc.Mat, count: int) -> tuple[IntArray, Sparse]:
        """The counted rows of a matrix of the part: (their m numbers in u, the rows (m, count)).

        `count`: number of entries of u.
        """
        pointers, columns, values = with_entries(matrix).getValuesCSR()
        own = Sparse((values, self.places[columns], pointers), (len(pointers) - 1, count))
        rows = self.rows[self.counted]
        return rows, own if len(rows) == len(self.rows) else own[self.counted]


class Shares:
    """The rows of an assembly that a rank of `comm` owns, and its shares of the parts, by name."""

    def __init__(
        self,
        comm: MPI.Comm,
        layout: Layout,
        block: int,
        given: Mapping[str, MeshedStructure | Superelement],
    ) -> None:
        self.comm, self.count, self._block = comm, layout.count, block
        nodes = self.count // block
        self._starts = np.array([block * (nodes * rank // comm.size) for rank in range(comm.size)])
        ends = [*self._starts[1:], self.count]
        #: slice of the rows of this rank
        self.rows = slice(int(self._starts[comm.rank]), int(ends[comm.rank]))
        self.of = {name: Share.of(comm, m, given[name]) for name, m in layout.members.items()}

    def own(self, q: NDArray[Scalar]) -> NDArray[Scalar]:
        """The rows of this rank of vectors that every rank holds whole."""
        return q if self.comm.size == 1 else q[self.rows]

    def whole(self, q: Array) -> Array:
        """Whole vectors, gathered from the rows of each rank; all ranks must call it."""
        return q if self.comm.size == 1 else np.concatenate(self.comm.allgather(q))

    def summed(self, forces: Array) -> Array:
        """The rows of this rank of the sum over all ranks of whole vectors."""
        return self.own(self.comm.allreduce(forces))

    def of_parts(self, work: Callable[[MeshedStructure, Array], Array], u: Array) -> Array:
        """work(part, its rows of u (n, k)), one rank's share of the sum over all ranks (n, k)."""
        result = np.zeros(u.shape)
        for one in self.of.values():
            result[one.rows[one.counted]] = work(one.part, u[one.rows])[one.counted]
        return result

    def rows_of(self, matrices: Mapping[str, PETSc.Mat]) -> Sparse:
        """The rows of this rank (m, n) of matrices of some parts, on the diagonal of u."""
        found = [self.of[name].entries(matrix, self.count) for name, matrix in matrices.items()]
        free(self.comm)
        if self.comm.size > 1:
            found = self._exchanged(found)
        numbers = np.concatenate([np.zeros(0, PETSc.IntType), *(rows for rows, _ in found)])
        numbers -= self.rows.start
        stacked = scipy.sparse.vstack([Sparse((0, self.count)), *(own for _, own in found)])
        found.clear()
        if (np.diff(numbers) < 0).any():
            order = np.argsort(numbers)
            stacked, numbers = stacked.tocsr()[order], numbers[order]
        counts = np.zeros(self.rows.stop - self.rows.start, dtype=PETSc.IntType)
        counts[numbers] = np.diff(stacked.indptr)
        arrays = stacked.data, stacked.indices, np.append(0, np.cumsum(counts))
        result = Sparse(arrays, shape=(len(counts), self.count))
        result.sort_indices()
        result.has_canonical_format = True  # as those of PETSc have: no search for duplicates
        process.trim_heap()
        return result

    def _exchanged(self, found: list[tuple[IntArray, Sparse]]) -> list[tuple[IntArray, Sparse]]:
        """All ranks' entries of the rows of this rank; `found` is emptied."""
        kept: list[tuple[IntArray, Sparse]] = []
        sent: list[list[tuple[IntArray, Sparse]]] = [[] for _ in range(self.comm.size)]
        while found:
            rows, own = found.pop()
            owner = np.searchsorted(self._starts, rows, side="right") - 1
            for rank in np.unique(owner):
                to = kept if rank == self.comm.rank else sent[rank]
                to.append((rows[owner == rank], own[owner == rank]))
        received = self.comm.alltoall(sent)
        return kept + [one for several in received for one in several]

    def added(self, matrix: Sparse) -> Sparse:
        """The sum over all ranks of matrices that have few entries."""
        if self.comm.size == 1:
            return matrix
        return sum(self.comm.allgather(matrix), Sparse(matrix.shape)).tocsr()

    def matrix(self, name: str, own: Sparse) -> PETSc.Mat:
        """The distributed matrix of which this rank has the rows `own` (m, n)."""
        if self.comm.size == 1:
            result = from_csr(name, own)
        else:
            integer = PETSc.IntType
            arrays = own.indptr.astype(integer), own.indices.astype(integer), own.data
            size = own.shape
            result = PETSc.Mat().createAIJ((size, size), csr=arrays, comm=self.comm)
            result.assemble()
        result.setBlockSizes(self._block, self._block)
        return result

    def spread(self, name: str, whole: Sparse | None) -> PETSc.Mat:
        """A distributed matrix from one that rank 0 holds whole; all ranks must call it."""
        spans = self.comm.gather(self.rows)
        parts = [] if whole is None or spans is None else [whole[rows] for rows in spans]
        return self.matrix(name, self.comm.scatter(parts))


def _nodes_in_copy(part: MeshedStructure, copy: MeshedStructure) -> IntArray:
    """The node in a copy on this rank alone of each node that this rank owns of a part."""
    cells = np.asarray(part.mesh.dolfinx.topology.original_cell_index)
    where = np.argsort(copy.mesh.dolfinx.topology.original_cell_index)
    here = _nodes_of_cells(part, np.arange(len(cells)))
    there = _nodes_of_cells(copy, where[cells])
    found = np.full(1 + int(here.max(initial=part.rows)), -1)
    found[here] = there
    found = found[: part.rows // part.block]
    assert (found >= 0).all()
    return found


def _nodes_of_cells(part: MeshedStructure, cells: IntArray) -> IntArray:
    (path, *_) = part.form.components.values()
    return compat.cell_dofs(part.form.space, path, cells) // part.block
