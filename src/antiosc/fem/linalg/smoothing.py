"""Smoothing for multigrid: Chebyshev's iteration with the diagonal blocks D of the nodes.

It acts on the eigenvectors of D⁻¹A from the largest eigenvalue down to a tenth of it. Where
products are computed from the cells, it is in single precision.
"""

from __future__ import annotations

import ctypes
from ctypes import c_double, c_float, c_int64, c_void_p
from typing import Any

import numpy as np
from mpi4py import MPI
from petsc4py import PETSc

from antiosc.base._types import Array
from antiosc.engine import library
from antiosc.fem.linalg.petsc_algebra import CELLS_KEY, CellProduct, multiply

#: Steps before and after the coarse level, and the least share of the largest eigenvalue smoothed.
CHEBYSHEV_STEPS, LOWEST_SMOOTHED = 2, 0.1
#: Steps of the power method for that eigenvalue, and the factor on what they give.
POWER_STEPS, EIGENVALUE_MARGIN = 15, 1.1

#: The functions of the library, which `antiosc.engine.library` has checked, by precision.
_library = ctypes.CDLL(str(library.LIBRARY_FILE))
kernels: dict[Any, Any] = {
    np.float64: _library.afe_smooth_double,
    np.float32: _library.afe_smooth_float,
}
for _kernel, _real in zip(kernels.values(), (c_double, c_float), strict=True):
    _kernel.restype = None
    _kernel.argtypes = c_int64, c_int64, c_void_p, c_void_p, _real, _real, c_void_p, c_void_p


class Smoother:
    """Chebyshev's iteration for a matrix A."""

    def __init__(self, A: PETSc.Mat) -> None:
        self._A = A
        self._product: CellProduct | None = A.getAttr(CELLS_KEY)
        self._real: Any = np.float32 if self._product else np.float64
        b = A.getBlockSize()
        if self._product:
            blocks = self._product.cells.blocks(self._product.k, self._product.m)
            inverse = np.linalg.inv(blocks.reshape(-1, b, b))
        else:
            inverse = np.ascontiguousarray(A.invertBlockDiagonal()).reshape(-1, b, b)
        self._inverse = inverse.astype(self._real)
        self._rows = A.getLocalSize()[0]
        self._residual, self._step, self._total = (self._vector() for _ in range(3))

        largest = EIGENVALUE_MARGIN * self._largest(A.getComm().tompi4py())
        middle, half = ((1 + sign * LOWEST_SMOOTHED) / 2 * largest for sign in (1, -1))

        #: factors of the last step and of D⁻¹ times the residual in each step
        self._factors = [(0.0, 1 / middle)]
        rho = half / middle
        for _ in range(CHEBYSHEV_STEPS - 1):
            next_rho = 1 / (2 * middle / half - rho)
            self._factors.append((next_rho * rho, 2 * next_rho / half))
            rho = next_rho

    def __call__(self, load: Array, last: bool = False) -> tuple[Array, Array]:
        """(x ≈ A⁻¹ load, load - A x: not up to date if `last`), which the next call overwrites."""
        self._residual[: self._rows] = load
        for keep, gain in self._factors:
            if keep:
                self._subtract_product()
            self._advance(keep, gain)
        if not last:
            self._subtract_product()

        return self._total[: self._rows], self._residual[: self._rows]

    def _vector(self) -> Array:
        if self._product:
            return self._product.cells.vector(self._real)
        return np.zeros(self._rows)

    def _subtract_product(self) -> None:
        """Subtract A times the step from the residual."""
        if self._product:
            k, m = -self._product.k, -self._product.m
            self._product.cells.add(k, m, self._step, self._residual)
        else:
            self._residual -= multiply(self._A, self._step)

    def _advance(self, keep: float, gain: float) -> None:
        """Set the step to `keep` times the last one and `gain` times D⁻¹ residual; add it."""
        count, size, _ = self._inverse.shape
        inverse, residual, step, total = (
            library.address(array)
            for array in (self._inverse, self._residual, self._step, self._total)
        )
        kernels[self._real](count, size, inverse, residual, keep, gain, step, total)

    def _largest(self, comm: MPI.Comm) -> float:
        """Estimate of the largest eigenvalue of D⁻¹A."""
        self._step[: self._rows] = np.random.default_rng(0).standard_normal(self._rows)
        for _ in range(POWER_STEPS):
            self._residual[:] = 0.0
            self._subtract_product()
            self._advance(0.0, -1.0)
            x = self._step[: self._rows]
            size = float(np.sqrt(comm.allreduce(float(x @ x))))
            x /= size

        return size
