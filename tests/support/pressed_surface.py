"""A rigid floor on an elastic half-space whose pressure has a limit: forces of a surface on it.

The displacement of a uniform pressure on a rectangle is Love's (Johnson, *Contact Mechanics*,
(3.25)); the pressures that minimise the complementary energy between 0 and the limit follow by
conjugate gradients over the cells that are free (Polonsky and Keer 1999; Almqvist et al. 2007).
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.fft import irfft2, rfft2
from scipy.integrate import cumulative_trapezoid

Array = NDArray[np.float64]


def force_at(
    work: float,
    heights: Array,
    cell: tuple[float, float],
    modulus: float,
    limit: float,
    deep: Array,
) -> float:
    """Force [N] after a work [J] on a surface of heights (n, m) [m], pressed to depths `deep`."""
    response = _response(heights.shape, cell, modulus)
    pressure = np.zeros_like(heights)
    forces = [0.0]
    for depth in deep.tolist():
        pressure = _pressures(depth - heights, response, limit, pressure)
        forces.append(float(pressure.sum() * cell[0] * cell[1]))
    works = cumulative_trapezoid(forces, np.append(0.0, deep), initial=0.0)
    assert work < works[-1]
    return float(np.interp(work, works, forces))


def _response(shape: tuple[int, ...], cell: tuple[float, float], modulus: float) -> Array:
    """Transform of the displacements that a unit pressure on one cell makes."""
    half = np.array(cell) / 2
    x, y = (np.arange(-n, n) * size for n, size in zip(shape, cell, strict=True))
    ends = [(a * half[0], b * half[1], a * b) for a in (1, -1) for b in (1, -1)]
    total = np.zeros((2 * shape[0], 2 * shape[1]))
    for a, b, sign in ends:
        X, Y = np.meshgrid(x + a, y + b, indexing="ij")
        total += sign * (X * np.arcsinh(Y / np.abs(X)) + Y * np.arcsinh(X / np.abs(Y)))
    return rfft2(np.fft.ifftshift(total / (np.pi * modulus)))


def _pressures(overlap: Array, response: Array, limit: float, p: Array) -> Array:
    """Pressures (n, m) [Pa] from a first guess: displacement = overlap where they are free."""
    n, m = overlap.shape

    def displaced(q: Array) -> Array:
        return irfft2(rfft2(q, s=(2 * n, 2 * m)) * response, s=(2 * n, 2 * m))[:n, :m]

    way, last = np.zeros_like(p), np.inf
    residual = displaced(p) - overlap
    for _ in range(500):
        held = ((p <= 0) & (residual >= 0)) | ((p >= limit) & (residual <= 0))
        size = float((residual[~held] ** 2).sum())
        if size <= 1e-8 * overlap.max() ** 2 * (~held).sum():
            return p
        way = np.where(held, 0.0, -residual + size / last * way)
        step = -float((residual * way).sum() / (way * displaced(way)).sum())
        ahead = p + step * way
        p = np.clip(ahead, 0.0, limit)
        last = np.inf if (p != ahead).any() else size
        residual = displaced(p) - overlap
    raise AssertionError("no pressures")
