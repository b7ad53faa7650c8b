"""The dofs of an assembly by rank.

Each rank owns a contiguous range of u and of q: successive parts share few dofs, and so do the
ranges. The matrices of a part are assembled on the ranks that share its mesh, and their rows are
sent to the ranks that own them. Data of all dofs (layout, T) are complete on every rank.
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

from antiosc.base._types import Array, IntArray
from antiosc.fem.assembly.layout import Layout, Sparse
from antiosc.fem.assembly.parts import Superelement
from antiosc.fem.linalg.petsc_algebra import free, from_csr, with_entries
from antiosc.fem.platform import compat
from antiosc.fem.structure.meshed import Member, MeshedStructure

Scalar = TypeVar("Scalar", bound=np.generic)


@dataclass(frozen=True, eq=False)
class Share:
    """The rows of one part that a rank holds.

    rows : number in u of each row of the part on this rank.
    counted : slice of the rows that only this rank counts: all of them, unless every rank holds the
        whole part.
    places : (rows of all ranks,) number in u of each column of the part's matrices.
    """

    part: MeshedStructure
    rows: IntArray
    counted: slice
    places: IntArray

    @classmethod
    def of(cls, comm: MPI.Comm, member: Member, part: MeshedStructure | Superelement) -> Share:
        """This rank's share of the part `part`; `member` is the assembly's copy of the whole
        part.
        """
        assert isinstance(part, MeshedStructure)
        if part.comm.size == 1:  # this rank has all of it
            rows = np.arange(member.first, member.first + part.rows, dtype=PETSc.IntType)
            first, last = (part.rows * rank // comm.size for rank in (comm.rank, comm.rank + 1))
            return cls(part, rows, slice(first, last), rows)
        nodes = _nodes_in_copy(part, member.part)
        rows = member.first + (member.block * nodes[:, None] + np.arange(member.block)).ravel()
        rows = rows.astype(PETSc.IntType)
        return cls(part, rows, slice(None), np.concatenate(comm.allgather(rows)))

    def entries(self, matrix: PETSc.Mat, count: int) -> tuple[IntArray, Sparse]:
        """(numbers in u (m,), rows (m, count)) of the counted rows of a matrix of the part.

        `count`: number of entries of u.
        """
        pointers, columns, values = with_entries(matrix).getValuesCSR()
        all_rows = Sparse((values, self.places[columns], pointers), (len(pointers) - 1, count))
        rows = self.rows[self.counted]
        return rows, all_rows if len(rows) == len(self.rows) else all_rows[self.counted]


class Shares:
    """Division of an assembly over the ranks of `comm`: the rows of this rank, its shares of the
    parts."""

    def __init__(
        self,
        comm: MPI.Comm,
        layout: Layout,
        block: int,
        parts: Mapping[str, MeshedStructure | Superelement],
    ) -> None:
        self.comm, self.count, self._block = comm, layout.count, block
        nodes = self.count // block
        self._starts = np.array([block * (nodes * rank // comm.size) for rank in range(comm.size)])
        ends = [*self._starts[1:], self.count]
        #: slice of the rows of this rank
        self.rows = slice(int(self._starts[comm.rank]), int(ends[comm.rank]))
        self.of = {name: Share.of(comm, m, parts[name]) for name, m in layout.members.items()}

    def own(self, q: NDArray[Scalar]) -> NDArray[Scalar]:
        """The rows of this rank of vectors that are complete on every rank."""
        return q if self.comm.size == 1 else q[self.rows]

    def whole(self, q: Array) -> Array:
        """Complete vectors, gathered from the rows of all ranks; all ranks must call it."""
        return q if self.comm.size == 1 else np.concatenate(self.comm.allgather(q))

    def summed(self, forces: Array) -> Array:
        """The rows of this rank of the sum of complete vectors over all ranks."""
        return self.own(self.comm.allreduce(forces))

    def of_parts(self, work: Callable[[MeshedStructure, Array], Array], u: Array) -> Array:
        """This rank's contribution (n, k) to the sum over all parts of work(part, its rows of u (n,
        k))."""
        result = np.zeros(u.shape)
        for share in self.of.values():
            result[share.rows[share.counted]] = work(share.part, u[share.rows])[share.counted]
        return result

    def rows_of(self, matrices: Mapping[str, PETSc.Mat]) -> Sparse:
        """The rows (m, n) of this rank of the block-diagonal matrix of the matrices of some
        parts.
        """
        shares = [self.of[name].entries(matrix, self.count) for name, matrix in matrices.items()]
        free(self.comm)
        if self.comm.size > 1:
            shares = self._exchanged(shares)
        numbers = np.concatenate([np.zeros(0, PETSc.IntType), *(rows for rows, _ in shares)])
        numbers -= self.rows.start
        stacked = scipy.sparse.vstack([Sparse((0, self.count)), *(block for _, block in shares)])
        shares.clear()
        if (np.diff(numbers) < 0).any():
            order = np.argsort(numbers)
            stacked, numbers = stacked.tocsr()[order], numbers[order]
        counts = np.zeros(self.rows.stop - self.rows.start, dtype=PETSc.IntType)
        counts[numbers] = np.diff(stacked.indptr)
        arrays = stacked.data, stacked.indices, np.append(0, np.cumsum(counts))
        result = Sparse(arrays, shape=(len(counts), self.count))
        result.sort_indices()
        result.has_canonical_format = True  # as those of PETSc have: no search for duplicates
        return result

    def _exchanged(self, pieces: list[tuple[IntArray, Sparse]]) -> list[tuple[IntArray, Sparse]]:
        """Entries of all ranks in the rows of this rank; the list `pieces` is emptied."""
        local: list[tuple[IntArray, Sparse]] = []
        sent: list[list[tuple[IntArray, Sparse]]] = [[] for _ in range(self.comm.size)]
        while pieces:
            rows, matrix_rows = pieces.pop()
            owner = np.searchsorted(self._starts, rows, side="right") - 1
            for rank in np.unique(owner):
                entries_of_rank = local if rank == self.comm.rank else sent[rank]
                entries_of_rank.append((rows[owner == rank], matrix_rows[owner == rank]))
        received = self.comm.alltoall(sent)
        return local + [piece for pieces_of_rank in received for piece in pieces_of_rank]

    def added(self, matrix: Sparse) -> Sparse:
        """The sum over all ranks of matrices that have few entries."""
        if self.comm.size == 1:
            return matrix
        return sum(self.comm.allgather(matrix), Sparse(matrix.shape)).tocsr()

    def matrix(self, name: str, rows: Sparse) -> PETSc.Mat:
        """The distributed matrix of which this rank has the rows `rows` (m, n)."""
        if self.comm.size == 1:
            result = from_csr(name, rows)
        else:
            integer = PETSc.IntType
            arrays = rows.indptr.astype(integer), rows.indices.astype(integer), rows.data
            size = rows.shape
            result = PETSc.Mat().createAIJ((size, size), csr=arrays, comm=self.comm)
            result.assemble()
        result.setBlockSizes(self._block, self._block)
        return result

    def spread(self, name: str, matrix: Sparse | None) -> PETSc.Mat:
        """A distributed matrix from one that rank 0 holds whole; all ranks must call it."""
        spans = self.comm.gather(self.rows)
        parts = [] if matrix is None or spans is None else [matrix[rows] for rows in spans]
        return self.matrix(name, self.comm.scatter(parts))


def _nodes_in_copy(part: MeshedStructure, copy: MeshedStructure) -> IntArray:
    """For each node of a part that this rank owns, its number in the complete copy on this rank."""
    cells = np.asarray(part.mesh.dolfinx.topology.original_cell_index)
    order = np.argsort(copy.mesh.dolfinx.topology.original_cell_index)
    nodes = _nodes_of_cells(part, np.arange(len(cells)))
    copied = _nodes_of_cells(copy, order[cells])
    result = np.full(1 + int(nodes.max(initial=part.rows)), -1)
    result[nodes] = copied
    result = result[: part.rows // part.block]
    assert (result >= 0).all()
    return result


def _nodes_of_cells(part: MeshedStructure, cells: IntArray) -> IntArray:
    (path, *_) = part.form.components.values()
    return compat.cell_dofs(part.form.space, path, cells) // part.block
