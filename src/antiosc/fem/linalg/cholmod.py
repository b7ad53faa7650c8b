"""CHOLMOD's supernodal Cholesky factor, called directly.

PETSc links CHOLMOD but does not give access to the factor. With direct access, the cost of a sparse
load is that of its own branch of the elimination tree (`antiosc.fem.linalg.compliance`), and the
ordering is computed on the graph of the nodes. If the library cannot be called directly
(`refusal`), PETSc's interface to it is used (`antiosc.fem.linalg.solver_choice.ByPetsc`).

The table in benchmarks/speed/cholmod_or_mumps.md shows what this wins over MUMPS: whole maps 1.6
times (43 263 dofs) and 2.6 times (119 523) as fast, with 5 to 7 times less for each site.

Chen, Davis, Hager and Rajamanickam, *Algorithm 887: CHOLMOD*, ACM TOMS 35 (2008).
"""

from __future__ import annotations

import ctypes
from ctypes import POINTER, byref, c_double, c_int64, c_void_p
from functools import cache, cached_property
from typing import Any, NamedTuple

import numpy as np
import scipy.sparse
from numpy.typing import NDArray

from antiosc.base._types import Array, IntArray
from antiosc.base.errors import AntioscError, NotConvergedError
from antiosc.base.process import as_many_as_pay, one_thread
from antiosc.fem.linalg.cholmod_library import (
    LONG,
    REAL,
    SUPERNODAL,
    UPPER,
    Common,
    Dense,
    Sparse,
    failure,
    library,
    version,
    without_openmp,
)

#: of `cholmod_l_solve2`: A x = b, L y = b and Lᵀx = y
SOLVE, FORWARD, BACKWARD = 0, 4, 5
#: Nodes of at least so many rows are ordered as nodes.
NODE_ROWS = 2


class NotPositiveDefiniteError(NotConvergedError):
    """A matrix that has no Cholesky factor."""


class Supernodes(NamedTuple):
    """L of P A Pᵀ = L Lᵀ: dense blocks of columns with the same rows.

    Supernode s has the columns start[s] … start[s+1] - 1 of L and the rows
    rows[row[s]:row[s+1]], its own columns first; its entries stand in values[value[s]:], column by
    column (the upper triangle of the first square holds nothing of use).
    """

    start: IntArray
    row: IntArray
    rows: IntArray
    value: IntArray
    values: Array


class _Memory:
    """Memory of CHOLMOD for one factor, freed when the last array that refers to it is gone."""

    def __init__(self) -> None:
        self.factor: Any = None
        self.work: list[Any] = []
        self.lib = library()
        self.common = Common()
        self.lib.cholmod_l_start(byref(self.common))
        self.work = [c_void_p() for _ in range(3)]  # X, Y and E of cholmod_l_solve2

    def __del__(self) -> None:
        if not self.work or byref is None:  # it was not started, or Python ends
            return
        for work in self.work:
            self.lib.cholmod_l_free_dense(byref(work), byref(self.common))
        if self.factor:
            self.lib.cholmod_l_free_factor(byref(self.factor), byref(self.common))
        self.lib.cholmod_l_finish(byref(self.common))

    def make_room(self, rows: int, columns: int) -> bool:
        """Allocate workspace for this many vectors; whether that succeeded.

        `cholmod_l_solve2` makes its own, but looks at the last of three alone and then writes to
        those that it has not.
        """
        deepest = self.factor.contents.maxesize
        shapes = [(rows, columns, rows), (rows, columns, rows), (columns, deepest, columns)]
        return all(
            self.lib.cholmod_l_ensure_dense(byref(work), *shape, REAL, byref(self.common))
            for work, shape in zip(self.work, shapes, strict=True)
        )

    def array(self, pointer: Any, count: int, kind: Any) -> NDArray[Any]:
        """`count` numbers at `pointer`, not to be written to."""
        block = (kind * count).from_address(pointer)
        block.memory = self
        found = np.frombuffer(block, dtype=np.dtype(kind))
        found.flags.writeable = False
        return found


class Analysis:
    """The symbolic factor of a sparse symmetric matrix: its ordering, and the size of L.

    Parameters
    ----------
    A : csr_matrix (n, n)
        At least its lower triangle.
    block : rows of a node, one after the other; A is ordered by its nodes.
    permutation : of another matrix with the same pattern, to order this one alike.
    last : first rows of A that are eliminated after all others.

    Raises
    ------
    OutOfMemoryError
        There is no memory for it.
    NotConvergedError
        CHOLMOD failed; the message has its reason.
    MissingDependencyError
        This CHOLMOD is not one that can be called directly (`refusal`).
    """

    def __init__(
        self,
        A: scipy.sparse.csr_matrix,
        block: int = 1,
        permutation: IntArray | None = None,
        last: int = 0,
    ) -> None:
        self.memory = _Memory()
        common = self.memory.common
        common.supernodal, common.quick_return_if_not_posdef = SUPERNODAL, 1
        common.print_level = 0
        if permutation is None and (block >= NODE_ROWS or last):
            inner = self._of_nodes(A[last:, last:] if last else A, block)
            permutation = np.concatenate([last + inner, np.arange(last)])
        self.matrix, self._kept = _sparse(A)
        self.memory.factor = self._analysed(self.matrix, permutation)

    @property
    def entries(self) -> int:
        """Numbers that the factor holds."""
        return int(self.memory.factor.contents.xsize)

    def fronts(self) -> Array:
        """Operations for each supernode: c² for a column of c entries."""
        found = self.memory.factor.contents
        starts = (self.memory.array(p, found.nsuper + 1, c_int64) for p in (found.super, found.pi))
        width, height = (np.diff(start).astype(float) for start in starts)
        squares = (width - 1) * width * (2 * width - 1) / 6
        return np.asarray(width * height**2 - height * width * (width - 1) + squares)

    def _of_nodes(self, A: scipy.sparse.csr_matrix, block: int) -> IntArray:
        """An ordering of A's rows from that of its nodes, whose graph is block² times smaller."""
        matrix, _kept = _sparse(A[::block, ::block])
        nodes = self._analysed(matrix, None)
        order = np.array(self.memory.array(nodes.contents.Perm, nodes.contents.n, c_int64))
        self.memory.lib.cholmod_l_free_factor(byref(nodes), byref(self.memory.common))
        return np.asarray(block * order[:, None] + np.arange(block)).ravel()

    def _analysed(self, matrix: Sparse, permutation: IntArray | None) -> Any:
        """Symbolic factor; CHOLMOD tries AMD and METIS if no permutation is given."""
        lib, common = self.memory.lib, self.memory.common
        common.nmethods = int(permutation is not None)
        given = None
        if permutation is not None:
            given = np.ascontiguousarray(permutation, dtype=np.int64).ctypes
        pointer = None if given is None else given.data
        factor = lib.cholmod_l_analyze_p(byref(matrix), pointer, None, 0, byref(common))
        if not factor:
            raise failure(common, f"the ordering of {matrix.nrow} rows")
        return factor


class Cholesky:
    """P A Pᵀ = L Lᵀ of a sparse symmetric positive definite matrix.

    Parameters
    ----------
    A : csr_matrix (n, n) or Analysis
        The matrix, or its analysis, which becomes this factor and serves no second one.
    block, permutation, last
        Of a matrix: as for its `Analysis`.

    NotPositiveDefiniteError where A has no such factor; other errors as of `Analysis`.
    """

    def __init__(
        self,
        A: scipy.sparse.csr_matrix | Analysis,
        block: int = 1,
        permutation: IntArray | None = None,
        last: int = 0,
    ) -> None:
        analysis = A if isinstance(A, Analysis) else Analysis(A, block, permutation, last)
        memory = self._memory = analysis.memory
        common, factor = memory.common, memory.factor
        with without_openmp(), as_many_as_pay(analysis.fronts()):
            done = memory.lib.cholmod_l_factorize(byref(analysis.matrix), factor, byref(common))
        found = factor.contents
        if not done or not found.is_super or not found.x:
            raise failure(common, f"the Cholesky factor of {found.n} rows", 8.0 * found.xsize)
        if found.minor < found.n:
            raise NotPositiveDefiniteError(
                f"column {found.minor} of {found.n} is not positive definite"
            )

    def solve(self, B: Array) -> Array:
        """A⁻¹B for a vector (n,) or a block of vectors (n, k)."""
        return self._solved(SOLVE, B)

    def forward(self, B: Array) -> Array:
        """L⁻¹B, rows in the order of L."""
        return self._solved(FORWARD, B)

    def backward(self, Y: Array) -> Array:
        """L⁻ᵀY, rows in the order of L."""
        return self._solved(BACKWARD, Y)

    def _solved(self, system: int, B: Array) -> Array:
        B = np.asfortranarray(B, dtype=float)
        if not B.size:
            return np.empty(B.shape, order="F")
        rows, columns = len(B), B.size // len(B)
        right = Dense(rows, columns, B.size, rows, B.ctypes.data, None, REAL, 0)
        memory = self._memory
        x, *rest = memory.work
        if not memory.make_room(rows, columns):
            raise failure(memory.common, f"a solve for {columns} vectors of {rows} rows")
        with without_openmp(), one_thread():
            done = memory.lib.cholmod_l_solve2(
                *(system, memory.factor, byref(right), None, byref(x), None),
                *(*map(byref, rest), byref(memory.common)),
            )
        if not done:
            raise failure(memory.common, f"a solve for {columns} vectors of {rows} rows")
        X = memory.array(ctypes.cast(x, POINTER(Dense)).contents.x, B.size, c_double)
        return np.array(X.reshape(B.shape, order="F"), order="F")

    @cached_property
    def permutation(self) -> IntArray:
        """Row of A that is row i of P A Pᵀ (n,)."""
        found = self._memory.factor.contents
        return self._memory.array(found.Perm, found.n, c_int64)

    @cached_property
    def supernodes(self) -> Supernodes:
        """L as arrays in CHOLMOD's memory, which is kept as long as one of them is used."""
        array, found = self._memory.array, self._memory.factor.contents
        many = found.nsuper + 1
        return Supernodes(
            start=array(found.super, many, c_int64),
            row=array(found.pi, many, c_int64),
            rows=array(found.s, found.ssize, c_int64),
            value=array(found.px, many, c_int64),
            values=array(found.x, found.xsize, c_double),
        )

    def corner(self, last: int) -> tuple[IntArray, Array]:
        """(Order of the first `last` rows of A in L, their dense block of L).

        With A's rows eliminated in that order the block is a factor of the Schur complement onto
        them, if they came last.
        """
        L, permutation = self.supernodes, self.permutation
        columns = np.flatnonzero(permutation < last)
        position = np.full(len(permutation), -1)
        position[columns] = np.arange(len(columns))
        block = np.zeros((len(columns), len(columns)), order="F")
        for s in np.unique(np.searchsorted(L.start, columns, side="right") - 1):
            rows = L.rows[L.row[s] : L.row[s + 1]]
            width = L.start[s + 1] - L.start[s]
            values = L.values[L.value[s] : L.value[s] + len(rows) * width]
            dense = values.reshape(len(rows), width, order="F")
            i = position[rows]
            for j, column in zip(position[L.start[s] : L.start[s + 1]], dense.T, strict=True):
                if j >= 0:
                    block[i[i >= j], j] = column[i >= j]
        return permutation[columns], block


def _sparse(A: scipy.sparse.csr_matrix) -> tuple[Sparse, tuple[Any, ...]]:
    """A as CHOLMOD's upper triangle, and the arrays it points to.

    Rows of the one are columns of the other: the lower triangle of A is what CHOLMOD reads.
    """
    if not A.has_sorted_indices:  # A itself stays: another matrix may share its pattern
        A = A.sorted_indices()
    kept = A.indptr.astype(np.int64), A.indices.astype(np.int64), np.ascontiguousarray(A.data)
    p, i, x = (array.ctypes.data for array in kept)
    return Sparse(*A.shape, A.nnz, p, i, None, x, None, UPPER, LONG, REAL, 0, 1, 1), kept


@cache
def refusal() -> str:
    """Why CHOLMOD cannot be called directly here; empty if it can.

    The declared structures are tested on a small matrix: the factor must reproduce A, and a solve
    its inverse.
    """
    A = np.array([[4.0, 1.0, 0.5, 0.0], [1.0, 5.0, 0.0, 2.0], [0.5, 0.0, 3.0, 1.0], [0, 2, 1, 6]])
    try:
        factor = Cholesky(scipy.sparse.csr_matrix(A), last=len(A))
        order, L = factor.corner(len(A))
        right = np.allclose(L @ L.T, A[np.ix_(order, order)], rtol=1e-12)
        right &= np.allclose(factor.solve(A), np.eye(len(A)), rtol=1e-12, atol=1e-12)
    except AntioscError as error:
        return str(error)
    return "" if right else f"CHOLMOD {'.'.join(map(str, version(library())))} factors wrongly."
