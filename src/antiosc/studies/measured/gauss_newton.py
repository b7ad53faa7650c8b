"""Gauss-Newton (Levenberg-Marquardt) for the most probable body, and the noise of a measurement."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from antiosc.base._types import Array, ComplexArray
from antiosc.studies.measured.modes import BEYOND, Modes, Pairs

#: Steps of Gauss-Newton: in a round, at the end, and for a body of other noise; the decrease of
#: chi^2 that ends them.
STEPS, LAST_STEPS, FEW_STEPS, CONVERGED = 8, 40, 8, 0.1
#: Largest steps in ln(omega) over the damping ratio and at all, and in ln(zeta).
LONGEST = (3.0, 0.1, 1.0)
#: Slope, squared and over the largest, of a parameter that the measurement does not see.
FLAT = 1e-28
#: Eigenvalue of a normal matrix of unit diagonal, over the largest, that rounding makes.
UNSEEN = 1e-13
#: Least residual terms at the start of Gauss-Newton over the receptance.
LIFTED = 1e-3
#: Least standard deviation over the value that is taken for that of a measurement.
LEAST_NOISE = 1e-4
#: Relative variance of a fit without any residual.
EXACT = 1e-30
#: Steps of the search for the noise: how many, and their longest and least, in logarithms.
MOST_SCORES, LONGEST_SCORE, LEAST_SCORE = 40, 1.0, 1e-3
#: Largest damping ratio of a mode.
MOST_DAMPED = 0.4


@dataclass(frozen=True, eq=False)
class Measured:
    """Receptances H (W, M) [m/N] of pairs of sites at w (W,) [rad/s], and what is known of noise.

    sigma (W, M): standard deviation of the complex values; None: unknown. power: H w^power is what
    was measured, so that its noise may be equal at all frequencies.
    """

    w: Array
    H: ComplexArray
    pairs: Pairs
    sites: int
    sigma: Array | None
    power: int


def refined(
    data: Measured, weight: Array, modes: Modes, steps: int, shift: Array | float = 0.0
) -> tuple[Modes, Array, float]:
    """The most probable body near `modes`, its normal matrix, and chi^2 over the freedom.

    `shift`: added to all residuals, which are those of another measurement then.
    """
    damping, residual = 1e-6, residuals(data, weight, modes) + shift
    cost = float(residual @ residual)
    for _ in range(steps):
        J = _jacobian(data, weight, modes)
        normal, gradient = J.T @ J, J.T @ residual
        diagonal = np.diag(normal)
        size = np.sqrt(np.where(diagonal > FLAT * diagonal.max(), diagonal, np.inf))
        unit, slope = normal / size / size[:, None], -gradient / size
        new = np.inf
        while damping < 1e8 and not new < cost:
            step = np.linalg.solve(unit + damping * np.eye(len(unit)), slope) / size
            trial = modes.at(modes.values + _within(modes, step, float(data.w[-1]), LONGEST[0]))
            residual = residuals(data, weight, trial) + shift
            new = float(residual @ residual)
            damping *= 1 / 80 if new < cost else 8
        if not new < cost:
            break
        gain, cost, modes, damping = cost - new, new, trial, max(8 * damping, 1e-9)
        if gain < CONVERGED:
            break
    J = _jacobian(data, weight, modes)
    lines = 2 * data.H.size
    residual = residuals(data, weight, modes)[:lines]
    return modes, J.T @ J, float(residual @ residual) / max(lines - sum(modes.sizes), 1)


def _within(modes: Modes, step: Array, top: float, widths: float = np.inf) -> Array:
    """The step, shortened where a mode leaves its neighbourhood, of so many widths of its peak."""
    seen, count = modes.seen, len(modes.omega)
    own = modes.zeta[:seen]
    longest = np.minimum(widths * np.maximum(own, 1e-4), LONGEST[1])
    step = step.copy()
    step[:seen] = np.clip(step[:seen], -longest, longest)
    lowest = np.minimum(np.log((1 + BEYOND) * top / modes.omega[seen:]), 0.0)
    step[seen:count] = np.clip(step[seen:count], lowest, 2 * LONGEST[1])
    more = np.minimum(LONGEST[2], np.log(MOST_DAMPED / own))
    step[count : count + seen] = np.clip(step[count : count + seen], -LONGEST[2], more)
    return step


def residuals(data: Measured, weight: Array, modes: Modes) -> Array:
    """Weighted residuals: real parts, imaginary parts, then the tail's."""
    off = weight * (modes.receptance(data.w, data.pairs) - data.H)
    return np.append(whitened(off.reshape(-1)), modes.expected())


def _jacobian(data: Measured, weight: Array, modes: Modes) -> Array:
    """Derivatives of the residuals by `values`."""
    J = modes.jacobian(data.w, data.pairs)
    J *= weight[:, :, None]
    return np.vstack((whitened(J.reshape(-1, J.shape[2])), modes.expected_jacobian()))


def whitened(values: ComplexArray) -> Array:
    """Real above imaginary parts; the variance of either is half that of the complex value."""
    return np.sqrt(2) * np.concatenate((values.real, values.imag))


def covariance(normal: Array) -> Array:
    """The inverse of a normal matrix; what the measurement does not see has no variance."""
    size = np.sqrt(np.maximum(np.diag(normal), np.finfo(float).tiny))
    values, vectors = np.linalg.eigh(normal / size / size[:, None])
    seen = values > UNSEEN * values[-1]
    half = vectors[:, seen] / np.sqrt(values[seen])
    return np.asarray(half @ half.T / size / size[:, None])


def lifted(data: Measured, modes: Modes) -> Modes:
    """The body whose residual terms are not zero, where the sum of squares has no slope."""
    low = slice(len(data.w) // 8 + 1)
    size = LIFTED * float(np.median(np.abs(data.H)))
    mass = LIFTED * float(np.median(np.abs(data.H[low]) * data.w[low, None] ** 2))
    rigid, seen, b = modes.rigid, modes.seen, modes.b.copy()
    least = np.sqrt(LIFTED * modes.tail.b2)
    b[seen:] = np.where(np.abs(b[seen:]) < least, least, b[seen:])
    return replace(
        modes,
        b=b,
        rigid=None if rigid is None else _not_zero(rigid, mass),
        root=_not_zero(modes.root, size),
    )


def _not_zero(root: Array, least: float) -> Array:
    diagonal = np.diag(root)
    small = diagonal**2 < least
    return np.asarray(root + np.diag(np.where(small, np.sqrt(least) - diagonal, 0.0)))


def noise(data: Measured, modes: Modes) -> Array:
    """Standard deviations (W, M): a share of |H| and a floor of what was measured, most likely."""
    fit = modes.receptance(data.w, data.pairs)
    off = np.abs(data.H - fit) ** 2
    size = np.abs(fit) ** 2
    floor = np.broadcast_to(data.w[:, None] ** (-2.0 * data.power), off.shape)
    scales = np.array([[np.mean(off / size) + EXACT], [np.mean(off / floor)]])
    kinds = scales * np.array([size.ravel(), floor.ravel()])
    runs = [_variances(off.ravel(), kinds, start) for start in ((0.9, 0.01), (0.01, 0.9))]
    variance = min(runs, key=lambda one: float(np.sum(np.log(one) + off.ravel() / one)))
    return np.asarray(np.sqrt(np.maximum(variance.reshape(off.shape), LEAST_NOISE**2 * size)))


def _variances(off: Array, kinds: Array, start: tuple[float, float]) -> Array:
    """Most likely variances, sums of `kinds` (2, N), of squares `off` (N,): Fisher's scoring."""
    x = np.log(start)
    for _ in range(MOST_SCORES):
        parts = np.exp(x)[:, None] * kinds
        variance = np.sum(parts, axis=0)
        share = parts / variance
        slope = share @ (off / variance - 1)
        change = np.linalg.solve(share @ share.T + off.size * 1e-9 * np.eye(2), slope)
        x = x + np.clip(change, -LONGEST_SCORE, LONGEST_SCORE)
        if np.all(np.abs(change) < LEAST_SCORE):
            break
    return np.asarray(np.exp(x) @ kinds)
