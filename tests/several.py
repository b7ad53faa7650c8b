"""Structures with several sites, and their receptances by direct solves."""

from __future__ import annotations

import numpy as np
import scipy.linalg
from numpy.typing import NDArray

import antiosc as ao
from parts import STEEL, box

Array = NDArray[np.float64]
OMEGA = np.geomspace(20, 2e3, 25) * (1 + 0.01j)


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


def receptance(K: Array, M: Array, B: Array) -> NDArray[np.complex128]:
    """B'(K - omega^2 M)^-1 B (W, p, p) by direct solves, which know nothing of modes."""
    return np.array([B.T @ np.linalg.solve(K - w**2 * M, B) for w in OMEGA])


def sites_of(B: Array) -> dict[str, ao.Site]:
    """A named site for each column."""
    return {f"s{i}": ao.Site(vector=b) for i, b in enumerate(B.T)}


def block_with_corners() -> ao.Structure:
    """A block of steel, held at its left end."""
    return ao.Structure(box((6, 3, 2)), ao.Solid(**STEEL), [ao.Support("left")])


def _corner(x: float, y: float) -> ao.Site:
    return ao.Site((x, y, 0.04), (0.1, 0.2, -1), radius=0.03)


CORNERS = {"near": _corner(0.1, 0.02), "far": _corner(0.17, 0.03)}
