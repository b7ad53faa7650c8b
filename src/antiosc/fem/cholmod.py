"""CHOLMOD's supernodal Cholesky factor, called directly.

PETSc links CHOLMOD but keeps the factor to itself. Here it is in reach: sparse loads then cost what
their own branches of the elimination tree cost (`antiosc.fem.compliance`), and the ordering is
found on the graph of the nodes. The functions and the structures below are CHOLMOD's own,
`cholmod.h` of SuiteSparse 5.12 and 7.10; the library is the one that PETSc has loaded.

Chen, Davis, Hager and Rajamanickam, *Algorithm 887: CHOLMOD*, ACM TOMS 35 (2008).
"""

from __future__ import annotations

import ctypes
import os
from collections.abc import Iterator
from contextlib import contextmanager
from ctypes import POINTER, Structure, byref, c_double, c_int, c_int64, c_size_t, c_void_p
from functools import cache, cached_property
from typing import Any, NamedTuple

import numpy as np
import scipy.sparse
from numpy.typing import NDArray
from petsc4py import PETSc

from antiosc.errors import MissingDependencyError, NotConvergedError

Array = NDArray[np.float64]
IntArray = NDArray[np.int64]

#: Bytes for `cholmod_common`, of which the library uses less than a tenth.
COMMON = 1 << 16
#: CHOLMOD's numbers: 64-bit integers, real numbers, the upper triangle, A x = b, supernodal only.
LONG, REAL, UPPER, SUPERNODAL = 2, 1, 1, 2
#: of `cholmod_l_solve2`: A x = b, L y = b and Lᵀx = y
SOLVE, FORWARD, BACKWARD = 0, 4, 5
#: What `openblas_get_parallel` returns where OpenBLAS itself runs on OpenMP.
ON_OPENMP = 2
#: Nodes of at least so many rows are ordered as nodes.
BLOCK = 2


class _Head(Structure):
    """The first entries of `cholmod_common`."""

    _fields_ = [
        *((name, c_double) for name in ("dbound", "grow0", "grow1")),
        *((name, c_size_t) for name in ("grow2", "maxrank")),
        ("supernodal_switch", c_double),
        ("supernodal", c_int),
        *((f"final_{k}", c_int) for k in ("asis", "super", "ll", "pack", "monotonic", "resymbol")),
        ("zrelax", c_double * 3),
        ("nrelax", c_size_t * 3),
        ("prefer_zomplex", c_int),
        ("prefer_upper", c_int),
        ("quick_return_if_not_posdef", c_int),
        ("prefer_binary", c_int),
        ("print_level", c_int),
        ("precise", c_int),
        ("try_catch", c_int),
        ("error_handler", c_void_p),
        ("nmethods", c_int),
    ]


class _Sparse(Structure):
    _fields_ = [
        *((name, c_size_t) for name in ("nrow", "ncol", "nzmax")),
        *((name, c_void_p) for name in ("p", "i", "nz", "x", "z")),
        *((name, c_int) for name in ("stype", "itype", "xtype", "dtype", "sorted", "packed")),
    ]


class _Dense(Structure):
    _fields_ = [
        *((name, c_size_t) for name in ("nrow", "ncol", "nzmax", "d")),
        *((name, c_void_p) for name in ("x", "z")),
        *((name, c_int) for name in ("xtype", "dtype")),
    ]


class _Factor(Structure):
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
def _library() -> Any:
    lib = ctypes.CDLL(PETSc.__file__)  # symbols are looked up in what it links, too
    if not hasattr(lib, "cholmod_l_analyze_p"):
        raise MissingDependencyError(
            "this PETSc is built without CHOLMOD (SuiteSparse), which antiosc factors with: "
            "install one with it, such as Debian's."
        )
    lib.cholmod_l_analyze_p.restype = POINTER(_Factor)
    lib.cholmod_l_analyze_p.argtypes = [c_void_p, c_void_p, c_void_p, c_size_t, c_void_p]
    lib.cholmod_l_factorize.argtypes = [c_void_p, POINTER(_Factor), c_void_p]
    lib.cholmod_l_solve2.argtypes = [c_int, POINTER(_Factor), *([c_void_p] * 7)]
    return lib


@contextmanager
def _without_openmp() -> Iterator[None]:
    """Keep CHOLMOD's own OpenMP loops on one thread.

    Up to SuiteSparse 5 they take four threads whatever the environment says; they are short, and
    threads that wait for the next one hinder those of BLAS and the other ranks: up to half of the
    time of a factor on two cores was lost by it. BLAS keeps its threads, but for one built on
    OpenMP.
    """
    openmp, blas = _loaded("libgomp.so.1"), _loaded("libopenblas.so.0")
    if openmp is None or blas is None or blas.openblas_get_parallel() == ON_OPENMP:
        yield
        return
    levels = openmp.omp_get_max_active_levels()
    openmp.omp_set_max_active_levels(0)
    try:
        yield
    finally:
        openmp.omp_set_max_active_levels(levels)


@cache
def _loaded(name: str) -> Any:
    """A library that this process has loaded already, or None."""
    try:
        return ctypes.CDLL(name, mode=os.RTLD_NOW | getattr(os, "RTLD_NOLOAD", 0))
    except OSError:
        return None


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


class Cholesky:
    """P A Pᵀ = L Lᵀ of a sparse symmetric positive definite matrix.

    Parameters
    ----------
    A : csr_matrix (n, n)
        Its lower triangle at least.
    block : rows of a node, one after the other; A is ordered by its nodes.
    permutation : of another matrix with the same pattern, to order this one alike.
    last : first rows of A that are eliminated after all others.

    Raises
    ------
    NotConvergedError
        A is not positive definite, or there is no memory for the factor.
    """

    def __init__(
        self,
        A: scipy.sparse.csr_matrix,
        block: int = 1,
        permutation: IntArray | None = None,
        last: int = 0,
    ) -> None:
        self._work: list[Any] = []
        self._factor: Any = None
        self._lib = _library()
        self._common = ctypes.create_string_buffer(COMMON)
        self._lib.cholmod_l_start(self._common)
        self._work = [c_void_p() for _ in range(3)]  # X, Y and E of cholmod_l_solve2
        head = _Head.from_buffer(self._common)
        head.supernodal, head.quick_return_if_not_posdef, head.print_level = SUPERNODAL, 1, 0
        if permutation is None and (block >= BLOCK or last):
            inner = self._of_nodes(A[last:, last:] if last else A, block)
            permutation = np.concatenate([last + inner, np.arange(last)])
        matrix, _kept = _sparse(A)
        self._factor = self._analysed(matrix, permutation)
        with _without_openmp():
            done = self._lib.cholmod_l_factorize(byref(matrix), self._factor, self._common)
        found = self._factor.contents
        if not done or not found.is_super or not found.x:
            raise NotConvergedError("CHOLMOD found no memory for the factor")
        if found.minor < found.n:
            raise NotConvergedError(f"column {found.minor} of {found.n} is not positive definite")

    def __del__(self) -> None:
        if not self._work:  # it was not started
            return
        for work in self._work:
            self._lib.cholmod_l_free_dense(byref(work), self._common)
        if self._factor:
            self._lib.cholmod_l_free_factor(byref(self._factor), self._common)
        self._lib.cholmod_l_finish(self._common)

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
        rows, columns = len(B), B.size // len(B)
        right = _Dense(rows, columns, B.size, rows, B.ctypes.data, None, REAL, 0)
        x, *rest = self._work
        with _without_openmp():
            done = self._lib.cholmod_l_solve2(
                *(system, self._factor, byref(right), None, byref(x), None),
                *(*map(byref, rest), self._common),
            )
        if not done:
            raise NotConvergedError("CHOLMOD found no memory for a solve")
        X = _view(ctypes.cast(x, POINTER(_Dense)).contents.x, B.size, c_double)
        return np.array(X.reshape(B.shape, order="F"), order="F")

    @property
    def permutation(self) -> IntArray:
        """Row of A that is row i of P A Pᵀ (n,)."""
        found = self._factor.contents
        return np.array(_view(found.Perm, found.n, c_int64))

    @cached_property
    def supernodes(self) -> Supernodes:
        """L itself: views of CHOLMOD's memory, which last as long as this object."""
        found = self._factor.contents
        many = found.nsuper + 1
        return Supernodes(
            start=_view(found.super, many, c_int64),
            row=_view(found.pi, many, c_int64),
            rows=_view(found.s, found.ssize, c_int64),
            value=_view(found.px, many, c_int64),
            values=_view(found.x, found.xsize, c_double),
        )

    def corner(self, last: int) -> tuple[IntArray, Array]:
        """(Order of the first `last` rows of A in L, their dense block of L).

        With A's rows eliminated in that order the block is a factor of the Schur complement onto
        them, if they came last.
        """
        L, permutation = self.supernodes, self.permutation
        columns = np.flatnonzero(permutation < last)
        place = np.full(len(permutation), -1)
        place[columns] = np.arange(len(columns))
        block = np.zeros((len(columns), len(columns)), order="F")
        for s in np.unique(np.searchsorted(L.start, columns, side="right") - 1):
            rows = L.rows[L.row[s] : L.row[s + 1]]
            width = L.start[s + 1] - L.start[s]
            values = L.values[L.value[s] : L.value[s] + len(rows) * width]
            dense = values.reshape(len(rows), width, order="F")
            i = place[rows]
            for j, column in zip(place[L.start[s] : L.start[s + 1]], dense.T, strict=True):
                if j >= 0:
                    block[i[i >= j], j] = column[i >= j]
        return permutation[columns], block

    def _of_nodes(self, A: scipy.sparse.csr_matrix, block: int) -> IntArray:
        """An ordering of A's rows from that of its nodes, whose graph is block² times smaller."""
        matrix, _kept = _sparse(A[::block, ::block])
        nodes = self._analysed(matrix, None)
        order = np.array(_view(nodes.contents.Perm, nodes.contents.n, c_int64))
        self._lib.cholmod_l_free_factor(byref(nodes), self._common)
        return np.asarray(block * order[:, None] + np.arange(block)).ravel()

    def _analysed(self, matrix: _Sparse, permutation: IntArray | None) -> Any:
        """Symbolic factor; CHOLMOD tries AMD and METIS where no permutation is given."""
        _Head.from_buffer(self._common).nmethods = int(permutation is not None)
        given = None
        if permutation is not None:
            given = np.ascontiguousarray(permutation, dtype=np.int64).ctypes
        pointer = None if given is None else given.data
        factor = self._lib.cholmod_l_analyze_p(byref(matrix), pointer, None, 0, self._common)
        if not factor:
            raise NotConvergedError("CHOLMOD could not order the matrix: there is no memory")
        return factor


def _sparse(A: scipy.sparse.csr_matrix) -> tuple[_Sparse, tuple[Any, ...]]:
    """A as CHOLMOD's upper triangle, and the arrays it points to.

    Rows of the one are columns of the other: the lower triangle of A is what CHOLMOD reads.
    """
    A.sort_indices()
    kept = A.indptr.astype(np.int64), A.indices.astype(np.int64), np.ascontiguousarray(A.data)
    p, i, x = (array.ctypes.data for array in kept)
    return _Sparse(*A.shape, A.nnz, p, i, None, x, None, UPPER, LONG, REAL, 0, 1, 1), kept


def _view(pointer: Any, count: int, kind: Any) -> NDArray[Any]:
    return np.ctypeslib.as_array(ctypes.cast(pointer, POINTER(kind)), (count,))
