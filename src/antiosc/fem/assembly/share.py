"""The rows of an assembly that each rank has, and its parts whole on every rank.

The constraints of an assembly couple points of different parts, wherever these are. Every rank
therefore has all parts whole; rank 0 alone makes the joints and the matrices, so that no decision
depends on the rounding of another rank, and K and M are then divided by rows: factorization and
solves, which take nearly all of the time, are shared.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
import scipy.sparse
from mpi4py import MPI
from numpy.typing import NDArray
from petsc4py import PETSc

from antiosc._types import Array
from antiosc.errors import InputError, without_warnings
from antiosc.fem.assembly.superelement import Superelement
from antiosc.fem.linalg.petsc_algebra import csr
from antiosc.fem.mesh.whole import whole
from antiosc.fem.mpi import agree, alike
from antiosc.fem.structure.meshed import MeshedStructure


@dataclass(frozen=True)
class Share:
    """Rows `first` to `last` of an assembly, which this rank of `comm` has."""

    comm: MPI.Comm
    first: int
    last: int

    @classmethod
    def of(cls, comm: MPI.Comm, count: int, block: int) -> Share:
        """An equal share of `count` rows, in whole blocks of rows."""
        ends = [block * (count // block * rank // comm.size) for rank in range(comm.size)]
        return cls(comm, ends[comm.rank], [*ends, count][comm.rank + 1])

    @property
    def rows(self) -> slice:
        """The rows of this rank."""
        return slice(self.first, self.last)

    def own(self, q: NDArray[Any]) -> NDArray[Any]:
        """The rows of this rank of vectors that every rank has whole."""
        return q if self.comm.size == 1 else q[self.first : self.last]

    def whole(self, q: Array) -> Array:
        """Vectors whole, from the rows of each rank; all ranks must call it."""
        return q if self.comm.size == 1 else np.concatenate(self.comm.allgather(q))

    def matrix(self, whole: PETSc.Mat | None, block: int) -> PETSc.Mat:
        """The distributed matrix of one that rank 0 has whole; all ranks must call it."""
        if self.comm.size == 1:
            return whole
        spans = self.comm.gather((self.first, self.last))
        parts: list[scipy.sparse.csr_matrix] = []
        if whole is not None and spans is not None:
            rows = csr(whole)
            parts = [rows[first:last] for first, last in spans]
        own: scipy.sparse.csr_matrix = self.comm.scatter(parts)
        count = (self.last - self.first, own.shape[1])
        arrays = (own.indptr.astype(PETSc.IntType), own.indices.astype(PETSc.IntType), own.data)
        size = ((count[0], count[1]), (count[0], count[1]))
        result = PETSc.Mat().createAIJ(size, csr=arrays, comm=self.comm)
        result.assemble()
        result.setBlockSizes(block, block)
        return result


def communicator(parts: Mapping[str, MeshedStructure | Superelement]) -> MPI.Comm:
    """The communicator of the ranks that share an assembly; InputError where it is not one.

    Parts that every rank has for itself fit any.
    """
    meshed = {n: part.comm for n, part in parts.items() if isinstance(part, MeshedStructure)}
    shared = {name: comm for name, comm in meshed.items() if comm.size > 1}
    for name, comm in shared.items():
        first, other = next(iter(shared.items()))
        if not alike(comm, other):
            raise InputError(
                f"the parts {first!r} and {name!r} are shared by different MPI ranks: read their "
                "meshes with the same comm."
            )
    return next(iter({**shared, **meshed}.values()))


def on_every_rank(
    parts: Mapping[str, MeshedStructure | Superelement], comm: MPI.Comm
) -> dict[str, MeshedStructure | Superelement]:
    """The parts, whole on every rank; all ranks must call it."""
    if comm.size == 1:
        return dict(parts)
    made: dict[int, MeshedStructure] = {}  # one Structure may have several names
    error: Exception | None = None
    for part in parts.values():
        if isinstance(part, Superelement) or part.comm.size == 1:
            continue
        if id(part) not in made:
            mesh = whole(part.mesh)
            try:
                with without_warnings():  # they were told of the part
                    made[id(part)] = part.again(mesh)
            except Exception as caught:
                error = caught
    agree(comm, error)
    return {name: made.get(id(part), part) for name, part in parts.items()}
