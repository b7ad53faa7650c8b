"""Vector fitting: the poles of measured receptances (Gustavsen and Semlyen 1999, relaxed 2006).

With s = iw and poles a_j in conjugate pairs, sigma(s) H_m(s) = N_m(s), both of partial fractions
with these poles; the zeros of sigma are better poles. N has a constant and a term 1/s^2 besides:
modes above the band, and rigid-body motion.
"""

from __future__ import annotations

import numpy as np
from scipy.signal import find_peaks, savgol_filter

from antiosc.base._types import Array, ComplexArray

#: Rounds of relocation.
ROUNDS = 8
#: Height of a peak of the level over its surroundings [nepers] and over the noise.
PROMINENCE, OVER_NOISE = 0.3, 4.0
#: Further poles, a share of the number of peaks and at least this many.
SPARE, LEAST_SPARE = 0.4, 4
#: Damping ratio of the first poles.
FIRST_DAMPING = 0.005


def starting_poles(w: Array, H: ComplexArray) -> ComplexArray:
    """Poles (n,) above the real axis at the peaks of the mobility, and some between them."""
    level = np.log(np.sum(np.abs(H) ** 2, axis=1)) / 2 + np.log(w)
    noise = float(np.median(np.abs(np.diff(level, 2)))) / 1.65 if len(w) > 5 else 0.0
    if len(w) > 11:
        level = savgol_filter(level, 5, 2)
    peaks, _ = find_peaks(level, prominence=max(PROMINENCE, OVER_NOISE * noise))
    spare = max(LEAST_SPARE, int(SPARE * len(peaks)))
    at = np.append(w[peaks], np.linspace(w[0], w[-1], spare + 2)[1:-1])
    return np.sort(at) * (1j - FIRST_DAMPING)


def poles(w: Array, H: ComplexArray, weight: Array) -> tuple[Array, Array]:
    """Frequencies [rad/s] and damping ratios of the complex poles of H (W, M).

    `weight` (W, M): one over the standard deviation of each value.
    """
    top = float(w[-1])
    found = starting_poles(w, H) / top
    for _ in range(ROUNDS):
        found = _relocated(1j * w / top, H, weight, found)
    found = found[found.imag > 0] * top
    omega = np.abs(found)
    order = np.argsort(omega)
    return omega[order], (-found.real / omega)[order]


def _relocated(s: ComplexArray, H: ComplexArray, weight: Array, a: ComplexArray) -> ComplexArray:
    """The zeros of sigma, in the left half-plane; those off the real axis by their upper one."""
    real = a.imag == 0
    first, second = 1 / (s[:, None] - a), 1 / (s[:, None] - a.conj())
    basis = np.hstack([np.where(real, first, first + second), (1j * (first - second))[:, ~real]])
    ones = np.ones((len(s), 1))
    own = np.hstack([basis, ones, 1 / s[:, None] ** 2])
    sigma = np.hstack([basis, ones])
    rows: list[Array] = []
    for h, v in zip(H.T, weight.T, strict=True):
        A = np.hstack([v[:, None] * own, -(v * h)[:, None] * sigma])
        R: Array = np.asarray(np.linalg.qr(np.vstack([A.real, A.imag]), mode="r"))
        rows.append(R[own.shape[1] :, own.shape[1] :])
    scale = float(np.linalg.norm(np.abs(H) * weight)) / len(s)
    A = np.vstack([*rows, scale * np.sum(sigma, axis=0).real[None, :]])
    right = np.append(np.zeros(len(A) - 1), scale * len(s))
    size = np.linalg.norm(A, axis=0)
    size[size == 0] = 1.0
    c = np.linalg.lstsq(A / size, right, rcond=None)[0] / size
    if abs(c[-1]) < 1e-8:
        c[-1] = 1e-8 if c[-1] >= 0 else -1e-8
    n, pairs = len(a), np.flatnonzero(~real)
    # real form of diag(a) - b c': a pair holds the real and imaginary parts of its state
    state = np.zeros((n + len(pairs), n + len(pairs)))
    state[np.arange(n), np.arange(n)] = a.real
    low = n + np.arange(len(pairs))
    state[low, low] = a.real[pairs]
    state[pairs, low], state[low, pairs] = a.imag[pairs], -a.imag[pairs]
    drive = np.append(np.where(real, 1.0, 2.0), np.zeros(len(pairs)))
    zeros = np.linalg.eigvals(state - np.outer(drive, c[:-1]) / c[-1])
    zeros = -np.abs(zeros.real) + 1j * zeros.imag
    flat = np.abs(zeros.imag) < 1e-12 * np.abs(zeros)
    return np.append(zeros[flat].real + 0j, zeros[~flat & (zeros.imag > 0)])
