"""Error of the dynamic stiffness Z (driving point) of a model over a band of frequencies.

Z of an undamped model is infinite at its poles and zero at its zeros, where relative errors are
meaningless. Z is therefore compared at complex frequencies with 1 % damping, ω(1 + 0.01 i).
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import ArrayLike

from antiosc.base import checks
from antiosc.base._types import Array, ComplexArray, Numbers

#: damping ratio at which Z is evaluated
DAMPING = 0.01
#: lower end of the sampled band, over the lowest frequency of the model
START = 0.25
#: an anti-oscillator is unobservable if its share in |Z| at its own frequency, where it is largest,
#: is below this
UNOBSERVABLE = 1e-8
#: number of frequencies at which Z is computed at once, to limit the memory
AT_ONCE = 500
#: a stiffness of several sites, per unit mass, is rounding below this share of the largest
UNSTRAINED = 1e-10


Stiffness = Callable[[ComplexArray], Numbers]


def samples(top: float, lowest: float, step: float = DAMPING) -> ComplexArray:
    """Damped circular frequencies up to `top` [rad/s], dense enough to meet every peak of Z.

    `lowest`: the first frequency [rad/s] at which Z varies; below it Z is quasi-static. `step`:
    relative distance of neighbouring samples; a peak has the width of the damping.
    """
    start = START * min(top, lowest)
    count = int(np.ceil(np.log(top / start) / step)) + 2
    return np.geomspace(start, top, count) * (1 + 1j * DAMPING)


def shares(k0: ArrayLike, m0: ArrayLike, m: ArrayLike, poles: ArrayLike) -> Array:
    """|change of Z| over |Z| (..., N) at each damped pole if its mass is added to m0 instead.

    For models of one site: k0, m0 (...,) and m, poles = omega_i^2 (..., N), m = 0 for no pole. Z is
    written with m0, not with m_st = m0 + sum(m_i), since -x m_st would cancel the term of a large
    m_i.
    """
    k0, m0, m, poles = (np.asarray(a, dtype=float) for a in (k0, m0, m, poles))
    weight = np.where(m > 0, m * poles, 0.0)
    poles = np.where(m > 0, poles, -1.0)
    share = np.zeros(m.shape)
    for i in range(m.shape[-1]):  # one after the other: all at once take N times the memory
        pole = np.where(m[..., i] > 0, poles[..., i], 1.0)
        x = pole * (1 + 1j * DAMPING) ** 2
        Z = k0 - x * (m0 + np.sum(weight / (poles - x[..., None]), axis=-1))
        share[..., i] = m[..., i] * np.abs(x**2 / (pole - x) / Z)
    return share


def shares_of_receptance(b: ArrayLike, poles: ArrayLike) -> Array:
    """|change of H| over |H| (J,) at each damped pole without its mode; H = sum b^2/(poles - x)."""
    weight = np.asarray(b, dtype=float) ** 2
    poles = np.asarray(poles, dtype=float)
    share = np.ones(poles.shape)  # of a rigid-body mode at its own frequency, 0
    for i in np.flatnonzero(poles > 0):
        parts = weight / (poles - poles[i] * (1 + 1j * DAMPING) ** 2)
        share[i] = np.abs(parts[i]) / max(float(np.abs(np.sum(parts))), np.finfo(float).tiny)
    return share


# -- p >= 1 sites: Z, K0, M0 are (p, p), and mode i has P_i (p,), its inertia at the sites


def stiffness_at_sites(x: Numbers, k0: Array, m0: Array, P: Array, poles: Array) -> Numbers:
    """Z (..., p, p) = k0 - x m0 - sum_i P_i P_i' x poles_i/(poles_i - x) [N/m] at x = omega^2.

    k0, m0 : (p, p) [N/m], [kg]. P : (N, p) [kg^1/2]. poles : (N,) omega_i^2 [rad^2/s^2].
    """
    with np.errstate(divide="ignore", invalid="ignore"):
        weight = poles / (poles - x[..., None])
    outer = P[:, :, None] * P[:, None, :]
    return np.asarray(k0 - x[..., None, None] * (m0 + np.tensordot(weight, outer, axes=1)))


def with_rigid_slide(Z: Numbers, x: Numbers, slide: Array) -> Numbers:
    """Z (..., p, p) at x = omega^2 of sites that also move rigidly by a = `slide` (p, h).

    That is the inverse of Z^-1 - a a'/x; x has the shape (..., 1, 1).
    """
    if not slide.any():
        return Z
    moving = slide[:, slide.any(axis=0)]
    pushed = Z @ moving
    small = x * np.eye(moving.shape[1]) - moving.T @ pushed
    return np.asarray(Z + pushed @ np.linalg.solve(small, np.swapaxes(pushed, -1, -2)))


def shares_at_sites(k0: Array, m0: Array, P: Array, poles: Array) -> Array:
    """Spectral radius (N,) of Z^-1 times the change of Z at each damped pole if its mass is added
    to m0.

    Arguments as for `stiffness_at_sites`; 0 for a pole <= 0. The result does not depend on units
    and combinations of the sites.
    """
    share = np.zeros(len(poles))
    real = np.flatnonzero(poles > 0)
    for i in np.split(real, range(AT_ONCE, len(real), AT_ONCE)):
        x = poles[i] * (1 + 1j * DAMPING) ** 2
        Z = stiffness_at_sites(x, k0, m0, P[real], poles[real])
        shares = np.einsum("ip,ip->i", P[i], np.linalg.solve(Z, P[i, :, None])[:, :, 0])
        share[i] = np.abs(x**2 / (poles[i] - x) * shares)
    return share


def lowest_frequency_at_sites(k0: Array, m_st: Array, poles: Array) -> float:
    """Frequency [rad/s] at which Z begins to vary: the lowest of k0 on m_st, or the first pole.

    inf for a rigid mass, whose Z has no such frequency.
    """
    lowest = [float(x) for x in poles[:1]]
    scale = 1 / np.sqrt(np.maximum(m_st.diagonal(), np.finfo(float).tiny))
    values = np.linalg.eigvalsh(k0 * scale[:, None] * scale)
    lowest += [float(x) for x in values[values > UNSTRAINED * values.max(initial=0.0)][:1]]
    return float(np.sqrt(min(lowest, default=np.inf)))


def spectral_norms(matrices: Numbers) -> Array:
    """2-norms (W,) of matrices (W, m, n); 0 of empty ones."""
    if 0 in matrices.shape:
        return np.zeros(len(matrices))
    if 1 in matrices.shape[1:]:
        return np.sqrt(np.sum(np.abs(matrices) ** 2, axis=(1, 2)))
    return np.asarray(np.linalg.norm(matrices, 2, axis=(1, 2)))


def semidefinite(matrix: Array) -> Array:
    """The symmetric matrix (p, p) without negative eigenvalues due to rounding."""
    scale = np.sqrt(np.maximum(matrix.diagonal(), 0.0))
    unit = matrix / np.where(scale > 0, scale, 1.0)[:, None] / np.where(scale > 0, scale, 1.0)
    unit[scale == 0] = 0.0
    unit[:, scale == 0] = 0.0
    values, vectors = np.linalg.eigh((unit + unit.T) / 2)
    if values.size and values[0] < 0:
        unit = (vectors * np.maximum(values, 0.0)) @ vectors.T
    return np.asarray((unit + unit.T) / 2 * scale[:, None] * scale)


def stiffness_error(Z: Stiffness, reference: Stiffness, band: float, lowest: float) -> float:
    """Largest |Z - Z_ref|/|Z_ref| over the band up to `band` [rad/s], with one per cent damping.

    Z, reference : dynamic stiffness [N/m] of complex circular frequencies. The band is sampled down
    to a quarter of `lowest` [rad/s].
    """
    at = samples(checks.positive("band", band, "rad/s"), checks.positive("lowest", lowest, "rad/s"))
    exact = reference(at)
    return float(np.max(np.abs(Z(at) - exact) / np.abs(exact)))
