"""Chains of masses and springs, and receptances by direct solves; NumPy and SciPy alone."""

from __future__ import annotations

import numpy as np
import scipy.linalg
from numpy.typing import NDArray

Array = NDArray[np.float64]


def loose_chains(
    sizes: tuple[int, ...], held: int, rng: np.random.Generator
) -> tuple[Array, Array]:
    """K and M of chains of uneven masses, a rigid-body mode each but the first `held`."""
    blocks = []
    for i, n in enumerate(sizes):
        k = rng.uniform(1e5, 3e5, n + 1)
        if i >= held:
            k[[0, -1]] = 0.0
        blocks.append(np.diag(k[:-1] + k[1:]) - np.diag(k[1:-1], 1) - np.diag(k[1:-1], -1))
    K = scipy.linalg.block_diag(*blocks)
    return K, np.diag(rng.uniform(0.5, 1.5, len(K)))


def receptance(
    K: Array, M: Array, B: Array, omega: NDArray[np.complex128]
) -> NDArray[np.complex128]:
    """B'(K - omega^2 M)^-1 B (W, p, p) by direct solves, which know nothing of modes."""
    return np.array([B.T @ np.linalg.solve(K - w**2 * M, B) for w in omega])
