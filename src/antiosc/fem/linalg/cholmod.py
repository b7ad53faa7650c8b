"""CHOLMOD's supernodal Cholesky factor, called in the library that PETSc has loaded, or in the
library of the wheel sparsax if PETSc has none.

PETSc links CHOLMOD but does not give access to the factor. With direct access, a sparse load costs
only its own branch of the elimination tree (`antiosc.fem.linalg.deflections`), and the ordering is
computed on the graph of the nodes. If the library cannot be called directly (`refusal`), MUMPS
factorizes (`antiosc.fem.linalg.solver_choice.MumpsFactor`).

Maps of deflections are computed 1.6 times (43 263 dofs) and 2.6 times (119 523 dofs) as fast as
with MUMPS; one site takes 5 to 7 times less time.

Chen, Davis, Hager and Rajamanickam, *Algorithm 887: CHOLMOD*, ACM TOMS 35 (2008).

The C structures of `cholmod.h` are declared here as far as they are the same from CHOLMOD 3.0
(SuiteSparse 5) to 5.3 (SuiteSparse 7.10). `refusal` tries them on a small matrix.
"""

from __future__ import annotations

import ctypes
import os
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from ctypes import POINTER, byref, c_double, c_int, c_int64, c_size_t, c_void_p
from functools import cache, cached_property
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import scipy.sparse
from numpy.typing import NDArray
from petsc4py import PETSc

from antiosc.base._types import Array, IntArray
from antiosc.base.errors import AntioscError, MissingDependencyError, NotConvergedError
from antiosc.base.process import MEMORY_REMEDY, allocation_error, blas_threads, one_thread

#: Bytes for `cholmod_common`, of which the library uses less than a tenth.
COMMON_BYTES = 1 << 16
#: CHOLMOD's numbers: 64-bit integers, real numbers, the upper triangle, A x = b, supernodal only.
LONG_INTEGERS = 2
REAL_NUMBERS = 1
UPPER_TRIANGLE = 1
SUPERNODAL = 2
#: CHOLMOD's number for an ordering by the caller.
GIVEN_ORDERING = 1
#: `Common.status` after a lack of memory.
OUT_OF_MEMORY = -2
#: What `openblas_get_parallel` returns where OpenBLAS itself runs on OpenMP.
OPENMP_PARALLEL = 2


class _Method(ctypes.Structure):
    """`cholmod_method_struct`: settings of one ordering."""

    _fields_ = [
        *((name, c_double) for name in ("lnz", "fl", "prune_dense", "prune_dense2", "nd_oksep")),
        ("other_1", c_double * 4),
        ("nd_small", c_size_t),
        ("other_2", c_double * 4),
        *((name, c_int) for name in ("aggressive", "order_for_lu", "nd_compress", "nd_camd")),
        *((name, c_int) for name in ("nd_components", "ordering")),
        ("other_3", c_size_t * 4),
    ]


class Common(ctypes.Structure):
    """`cholmod_common`: settings, workspace and the status of the last call."""

    _fields_ = [
        *((name, c_double) for name in ("dbound", "grow0", "grow1")),
        *((name, c_size_t) for name in ("grow2", "maxrank")),
        ("supernodal_switch", c_double),
        ("supernodal", c_int),
        *((f"final_{k}", c_int) for k in ("asis", "super", "ll", "pack", "monotonic", "resymbol")),
        ("zrelax", c_double * 3),
        ("nrelax", c_size_t * 3),
        *((f"prefer_{k}", c_int) for k in ("zomplex", "upper")),
        *((name, c_int) for name in ("quick_return_if_not_posdef", "prefer_binary")),
        *((name, c_int) for name in ("print_level", "precise", "try_catch")),
        ("error_handler", c_void_p),
        *((name, c_int) for name in ("nmethods", "current", "selected")),
        ("method", _Method * 10),
        *((name, c_int) for name in ("postorder", "default_nesdis")),
        *((name, c_double) for name in ("metis_memory", "metis_dswitch")),
        *((name, c_size_t) for name in ("metis_nswitch", "nrow")),
        ("mark", c_int64),
        *((name, c_size_t) for name in ("iworksize", "xworksize")),
        *((name, c_void_p) for name in ("Flag", "Head", "Xwork", "Iwork")),
        *((name, c_int) for name in ("itype", "dtype", "no_workspace_reallocate", "status")),
        *((name, c_double) for name in ("fl", "lnz")),
        ("rest", ctypes.c_char * COMMON_BYTES),
    ]


class Sparse(ctypes.Structure):
    """`cholmod_sparse`: a matrix by columns."""

    _fields_ = [
        *((name, c_size_t) for name in ("nrow", "ncol", "nzmax")),
        *((name, c_void_p) for name in ("p", "i", "nz", "x", "z")),
        *((name, c_int) for name in ("stype", "itype", "xtype", "dtype", "sorted", "packed")),
    ]


class Dense(ctypes.Structure):
    """`cholmod_dense`: a block of vectors, column by column."""

    _fields_ = [
        *((name, c_size_t) for name in ("nrow", "ncol", "nzmax", "d")),
        *((name, c_void_p) for name in ("x", "z")),
        *((name, c_int) for name in ("xtype", "dtype")),
    ]


class Factor(ctypes.Structure):
    """`cholmod_factor`: a symbolic or numeric factor."""

    _fields_ = [
        *((name, c_size_t) for name in ("n", "minor")),
        *((name, c_void_p) for name in ("Perm", "ColCount", "IPerm")),
        ("nzmax", c_size_t),
        *((name, c_void_p) for name in ("p", "i", "x", "z", "nz", "next", "prev")),
        *((name, c_size_t) for name in ("nsuper", "ssize", "xsize", "maxcsize", "maxesize")),
        *((name, c_void_p) for name in ("super", "pi", "px", "s")),
        *((name, c_int) for name in ("ordering", "is_ll", "is_super", "is_monotonic")),
        *((name, c_int) for name in ("itype", "xtype", "dtype", "useGPU")),
    ]


@cache
def loaded_cholmod() -> ctypes.CDLL:
    """The library with CHOLMOD's functions; MissingDependencyError without them."""
    # in the wheel of sparsax beside PyPI's PETSc, or in what PETSc links
    wheel = Path(PETSc.__file__).parents[2].glob("sparsax.libs/libcholmod-*.so*")
    lib = ctypes.CDLL(str(next(wheel, PETSc.__file__)))
    if not hasattr(lib, "cholmod_l_analyze_p"):
        raise MissingDependencyError(
            "this PETSc is built without CHOLMOD (SuiteSparse), as PyPI's is."
        )

    lib.cholmod_l_analyze_p.restype = POINTER(Factor)
    lib.cholmod_l_analyze_p.argtypes = [c_void_p, c_void_p, c_void_p, c_size_t, c_void_p]
    lib.cholmod_l_factorize.argtypes = [c_void_p, POINTER(Factor), c_void_p]
    lib.cholmod_l_solve2.argtypes = [c_int, POINTER(Factor), *([c_void_p] * 7)]
    return lib


def version(lib: ctypes.CDLL) -> str:
    """CHOLMOD's version: SuiteSparse 5.12 has 3.0.14, SuiteSparse 7.10 has 5.3.1."""
    numbers = (c_int * 3)()
    lib.cholmod_l_version(numbers)
    return ".".join(map(str, numbers))


def call_error(common: Common, what: str, size: float | None = None) -> AntioscError:
    """The error for a failed CHOLMOD call in the step `what`, which needs `size` bytes."""
    if common.status == OUT_OF_MEMORY:
        need = "" if size is None else f" of {size / 1e9:.3g} GB"
        return allocation_error(
            f"{what}{need}", remedy=f"use the solver 'iterative', {MEMORY_REMEDY[4:]}"
        )
    return NotConvergedError(f"CHOLMOD failed during {what} (status {common.status}).")


@contextmanager
def without_openmp() -> Iterator[None]:
    """Run CHOLMOD's OpenMP loops on one thread. Up to SuiteSparse 5, its four threads
    wait actively between short loops and slow down BLAS and other ranks by up to half."""
    openmp, blas = _loaded_library("libgomp.so.1"), _loaded_library("libopenblas.so.0")
    levels = 0
    if openmp and blas and blas.openblas_get_parallel() != OPENMP_PARALLEL:
        levels = openmp.omp_get_max_active_levels()

    if openmp is None or not levels:  # of 0, another thread has set it, and puts it back
        yield
        return

    openmp.omp_set_max_active_levels(0)
    try:
        yield
    finally:
        openmp.omp_set_max_active_levels(levels)


@cache
def _loaded_library(name: str) -> ctypes.CDLL | None:
    """A library that this process has already loaded, or None."""
    try:
        return ctypes.CDLL(name, mode=os.RTLD_NOW | getattr(os, "RTLD_NOLOAD", 0))
    except OSError:
        return None


#: of `cholmod_l_solve2`: A x = b
SYSTEM_A = 0


class NotPositiveDefiniteError(NotConvergedError):
    """A matrix that has no Cholesky factor."""


class Supernodes(NamedTuple):
    """L of P A Pᵀ = L Lᵀ. Supernode s has the columns start[s] … start[s+1] - 1, the rows
    rows[row[s]:row[s+1]] (its own columns first) and the entries values[value[s]:] by column; the
    upper triangle of its first rows is unused."""

    start: IntArray
    row: IntArray
    value: IntArray
    rows: IntArray
    values: Array


class _Memory:
    """Memory that CHOLMOD allocated for one factor, freed with the last array that refers to it."""

    def __init__(self) -> None:
        self.factor = POINTER(Factor)()  # null
        self.work: list[c_void_p] = []
        self.lib = loaded_cholmod()
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

    def array(self, pointer: int, count: int, kind: Any = c_int64) -> NDArray[Any]:
        """`count` numbers of a kind at `pointer`, read-only."""
        block = (kind * count).from_address(pointer)
        block.memory = self  # it lives as long as arrays of it
        return np.frombuffer(memoryview(block).toreadonly(), np.dtype(kind))


class Cholesky:
    """Factor P A Pᵀ = L Lᵀ of a matrix with lower triangle A, ordered by nodes of `block` rows or
    by a given `permutation` (n,). It is symbolic, without L, until `factorized` is called."""

    def __init__(
        self, A: scipy.sparse.csr_matrix, block: int = 1, permutation: IntArray | None = None
    ) -> None:
        self._memory = _Memory()
        common = self._memory.common
        common.supernodal = SUPERNODAL
        common.quick_return_if_not_posdef = 1
        common.print_level = 0

        if permutation is None and block > 1:  # of the nodes, whose graph is far smaller
            nodes = Cholesky(A[::block, ::block]).permutation
            permutation = np.asarray(block * nodes[:, None] + np.arange(block)).ravel()
        matrix, self._arrays = _sparse(A)
        self._memory.factor = self._analysed(matrix, permutation)
        self._matrix: Sparse | None = matrix

    def _analysed(self, matrix: Sparse, permutation: IntArray | None) -> ctypes._Pointer[Factor]:
        """Symbolic factor for a given permutation, or by the better of AMD and METIS."""
        common = self._memory.common
        common.nmethods = int(permutation is not None)
        common.method[0].ordering = GIVEN_ORDERING
        pointer = None
        if permutation is not None:
            ordering = np.ascontiguousarray(permutation, dtype=np.int64)
            pointer = ordering.ctypes.data

        analyse = self._memory.lib.cholmod_l_analyze_p
        factor = analyse(byref(matrix), pointer, None, 0, byref(common))
        if not factor:
            raise call_error(common, f"the ordering of {matrix.nrow} rows")
        return factor

    @property
    def entries(self) -> int:
        """Number of entries of the factor, known before `factorized`."""
        return int(self._memory.factor.contents.xsize)

    def factorized(self) -> Cholesky:
        """This object with the numeric factor L and without A; NotPositiveDefiniteError if A is
        not positive definite."""
        memory, common = self._memory, self._memory.common
        assert self._matrix is not None

        # operations of each supernode: Σ c² of its columns' entries c
        factor = memory.factor.contents
        starts = (memory.array(p, factor.nsuper + 1) for p in (factor.super, factor.pi))
        width, height = (np.diff(start).astype(float) for start in starts)
        squares = (width - 1) * width * (2 * width - 1) / 6
        fronts = width * height**2 - height * width * (width - 1) + squares

        with without_openmp(), blas_threads(fronts):
            arguments = byref(self._matrix), memory.factor, byref(common)
            succeeded = memory.lib.cholmod_l_factorize(*arguments)

        if not succeeded or not factor.is_super or not factor.x:
            what = f"the Cholesky factor of {factor.n} rows"
            raise call_error(common, what, 8.0 * factor.xsize)
        if factor.minor < factor.n:
            column = f"column {factor.minor} of {factor.n}"
            raise NotPositiveDefiniteError(f"{column} is not positive definite")

        self._matrix, self._arrays = None, ()
        return self

    def solve(self, B: Array) -> Array:
        """A⁻¹B for a vector (n,) or a block of vectors (n, k)."""
        B = np.asfortranarray(B, dtype=float)
        if not B.size:
            return np.empty(B.shape, order="F")
        rows = len(B)
        columns = B.size // len(B)
        right = Dense(rows, columns, B.size, rows, B.ctypes.data, None, REAL_NUMBERS, 0)
        memory = self._memory
        x, *work = memory.work

        with without_openmp(), one_thread():
            succeeded = memory.lib.cholmod_l_solve2(
                *(SYSTEM_A, memory.factor, byref(right), None, byref(x), None),
                *(*map(byref, work), byref(memory.common)),
            )

        if not succeeded:
            raise call_error(memory.common, f"a solve for {columns} vectors of {rows} rows")
        X = memory.array(ctypes.cast(x, POINTER(Dense)).contents.x, B.size, c_double)
        return np.array(X.reshape(B.shape, order="F"), order="F")

    @cached_property
    def permutation(self) -> IntArray:
        """Permutation (n,): row i of P A Pᵀ is row permutation[i] of A."""
        factor = self._memory.factor.contents
        return self._memory.array(factor.Perm, factor.n)

    @cached_property
    def supernodes(self) -> Supernodes:
        """L as arrays in CHOLMOD's memory, which is freed with the last of the arrays."""
        memory = self._memory
        factor = memory.factor.contents
        count = factor.nsuper + 1
        start, row, value = (memory.array(p, count) for p in (factor.super, factor.pi, factor.px))
        rows = memory.array(factor.s, factor.ssize)
        values = memory.array(factor.x, factor.xsize, c_double)
        return Supernodes(start, row, value, rows, values)


def _sparse(A: scipy.sparse.csr_matrix) -> tuple[Sparse, Sequence[Array]]:
    """(A as CHOLMOD's upper triangle by columns, the arrays to which it points)."""
    if not A.has_sorted_indices:  # A itself stays: another matrix may share its pattern
        A = A.sorted_indices()
    arrays = A.indptr.astype(np.int64), A.indices.astype(np.int64), np.ascontiguousarray(A.data)
    p, i, x = (part.ctypes.data for part in arrays)
    return Sparse(
        *A.shape, A.nnz, p, i, None, x, None, UPPER_TRIANGLE, LONG_INTEGERS, REAL_NUMBERS, 0, 1, 1
    ), arrays


@cache
def refusal() -> str:
    """The reason why CHOLMOD cannot be called, by a trial on a small matrix; empty if it can."""
    A = np.array([[4.0, 1.0, 0.5, 0.2], [1.0, 5.0, 0.3, 2.0], [0.5, 0.3, 3.0, 1.0], [0.2, 2, 1, 6]])

    try:
        factor = Cholesky(scipy.sparse.csr_matrix(A)).factorized()
        L = np.tril(factor.supernodes.values.reshape(A.shape).T)
        product = A @ factor.solve(np.eye(4))
    except AntioscError as error:
        return str(error)

    permuted = A[np.ix_(factor.permutation, factor.permutation)]
    right = np.allclose(L @ L.T, permuted) and np.allclose(product, np.eye(4), atol=1e-12)
    return "" if right else f"CHOLMOD {version(loaded_cholmod())} factors wrongly."
