"""A Cholesky factor in single precision or in 16 bits, which approximates A⁻¹ for a preconditioner.

It takes half the memory and half the time of one in double precision, or a fourth; CHOLMOD has
single precision from SuiteSparse 7.4 on only (Debian 12 has 5.12). The order and the pattern of L
are CHOLMOD's, the dense products those of the BLAS that SciPy uses.
"""

from __future__ import annotations

import ctypes
from collections.abc import Callable
from functools import cache
from typing import Any

import numpy as np
import scipy.sparse
from numpy.typing import NDArray
from scipy.linalg import cython_blas, cython_lapack

from antiosc.base._types import Array, IntArray
from antiosc.base.process import blas_threads
from antiosc.engine import library
from antiosc.fem.linalg.cholmod import (
    Analysis,
    NotPositiveDefiniteError,
    Supernodes,
    without_openmp,
)
from antiosc.fem.platform import kernels


class RoundedFactor:
    """Solves with L of P A Pᵀ = L Lᵀ in single precision.

    The error of a solution may be as large as 1e-7 times the condition number of A.

    Parameters
    ----------
    analysis : of A, which serves no second factor.

    NotPositiveDefiniteError where rounding leaves A no factor.
    """

    def __init__(self, analysis: Analysis) -> None:
        memory, factor = analysis.memory, analysis.memory.factor.contents
        self.permutation = memory.integers(factor.Perm, factor.n).copy()
        start, row, rows, value = (array.copy() for array in memory.pattern())
        A = _ordered(*analysis.matrix_taken(), self.permutation)
        values = np.empty(factor.xsize, np.float32)
        self._take(Supernodes(start, row, rows, value, values), np.ones(factor.n, np.float32))
        work = np.empty(2 * factor.n + 3 * factor.nsuper, np.int64)
        update = np.empty(max(factor.maxcsize, 1), np.float32)
        lower = kernels.Lower(*(library.address(array) for array in A))
        with without_openmp(), blas_threads(analysis.fronts()):
            succeeded = kernels.functions.afe_supernodes_factor(
                ctypes.byref(self._factor),
                *(ctypes.byref(lower), ctypes.byref(_blas())),
                *(library.address(work), library.address(update)),
            )
        if not succeeded:
            raise NotPositiveDefiniteError(
                "the matrix is not positive definite to single precision"
            )

    def _take(self, L: Supernodes, scale: NDArray[np.float32]) -> None:
        """Take L, whose values stand over the scale of their column."""
        self.supernodes, self._scale = L, scale
        self._own = np.empty(np.diff(L.row).max(initial=1), dtype=np.float32)
        self._factor = kernels.Supernodes(len(L.start) - 1, *map(library.address, (*L, scale)))
        kind = "float" if L.values.dtype == np.float32 else "int16_t"
        self._forward, self._backward = (
            getattr(kernels.functions, f"afe_supernodes_{half}_{kind}")
            for half in ("forward", "backward")
        )

    def round_to_16_bits(self) -> None:
        """Take half the time and memory again; the error of a solution may then be 1e-4 times the
        condition number of A.
        """
        values, scale = self.supernodes.values, np.empty(len(self.permutation), np.float32)
        kernels.functions.afe_supernodes_to_16_bits(
            ctypes.byref(self._factor), library.address(scale)
        )
        count = values.size
        values.resize((count + 1) // 2, refcheck=False)
        self._take(self.supernodes._replace(values=values.view(np.int16)[:count]), scale)

    def corner(self, last: int) -> tuple[IntArray, Array]:
        """As `Supernodes.corner`."""
        return self.supernodes.corner(self.permutation, last)

    def solve(self, b: Array) -> Array:
        """A⁻¹b of a vector (n,)."""
        result = np.empty(len(b))
        result[self.permutation] = self.backward(self.forward(b[self.permutation]))
        return result

    def forward(self, b: Array) -> Array:
        """L⁻¹b of a vector (n,) or (n, 1), rows in the order of L."""
        return self._solved(self._forward, b)

    def backward(self, y: Array) -> Array:
        """L⁻ᵀy of a vector (n,) or (n, 1), rows in the order of L."""
        return self._solved(self._backward, y)

    def _solved(self, half: Callable[..., None], b: Array) -> Array:
        x: NDArray[Any] = b.astype(np.float32)
        half(ctypes.byref(self._factor), library.address(x), library.address(self._own))
        return x


def _ordered(
    pointers: IntArray, columns: IntArray, values: Array, permutation: IntArray
) -> tuple[NDArray[np.int64], NDArray[np.int32], NDArray[np.float32]]:
    """The lower triangle of P A Pᵀ by columns, from at least the lower triangle of A by rows."""
    n = len(permutation)
    place = np.empty(n, np.int32)
    place[permutation] = np.arange(n, dtype=np.int32)
    rows = np.repeat(np.arange(n, dtype=np.int32), np.diff(pointers))
    is_lower = columns <= rows
    row, column = place[rows[is_lower]], place[columns[is_lower]]
    ends = np.minimum(row, column), np.maximum(row, column)
    ordered = scipy.sparse.csr_matrix((values[is_lower].astype(np.float32), ends), shape=(n, n))
    return ordered.indptr.astype(np.int64), ordered.indices.astype(np.int32), ordered.data


@cache
def _blas() -> kernels.Blas:
    """The functions of the BLAS and LAPACK that SciPy uses."""
    name_of, pointer_of = ctypes.pythonapi.PyCapsule_GetName, ctypes.pythonapi.PyCapsule_GetPointer
    name_of.restype, name_of.argtypes = ctypes.c_char_p, [ctypes.py_object]
    pointer_of.restype = ctypes.c_void_p
    pointer_of.argtypes = [ctypes.py_object, ctypes.c_char_p]
    names = {cython_lapack: ("spotrf",), cython_blas: ("strsm", "ssyrk", "sgemm")}
    capsules = [m.__pyx_capi__[name] for m, group in names.items() for name in group]
    pointers = [pointer_of(capsule, name_of(capsule)) for capsule in capsules]
    return kernels.Blas(*pointers)
