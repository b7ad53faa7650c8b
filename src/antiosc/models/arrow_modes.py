"""The free modes of the anti-oscillator model of one site, whose mass matrix is an arrow."""

from __future__ import annotations

import numpy as np

from antiosc.base._types import Array, Index
from antiosc.base.errors import NotConvergedError

#: Most steps of the search for the free frequencies.
MOST_SWEEPS = 200


def arrow_modes(k0: float, m0: float, m: Array, poles: Array) -> tuple[Array, Array]:
    """Free modes of the anti-oscillator model, to full relative precision for any ratio of masses.

    Parameters
    ----------
    k0, m0 : stiffness [N/m] and mass [kg] of the residual system; m0 = 0 removes its mode.
    m, poles : (N,) masses > 0 [kg] and *distinct* ascending omega_i^2 > 0 [rad^2/s^2].

    Returns
    -------
    x : (J,) squared free frequencies, J = N + 1, or N if m0 = 0.
    shape : (N + 1, J) mass-normalised modes; row 0 is the site.

    Notes
    -----
    The x_j are the zeros of Z(x) = k0 - x m0 - sum_i m_i x p_i/(p_i - x), which falls from +inf
    to -inf between two neighbouring poles p_i. Each is sought as a shift from its nearest pole,
    so that p_i - x_j is never a difference of nearly equal numbers (the device of
    divide-and-conquer eigensolvers); a dense eigensolver would lose the low modes to the rounding
    of the highest as m0 -> 0.
    """
    n = poles.size
    if n == 0:
        if m0 == 0:
            return np.zeros(0), np.zeros((1, 0))
        return np.array([k0 / m0]), np.array([[1 / np.sqrt(m0)]])
    lower = np.concatenate(([0.0], poles))
    upper = poles
    if m0 > 0:
        top = (k0 + np.sum(m * poles)) / m0
        upper = np.append(poles, 2 * (max(top, poles[-1]) + np.sqrt(poles[-1] * top)))
    lower = lower[: upper.size]

    origin, shift = _zeros(k0, m0, m, poles, lower, upper)
    base = np.where(origin >= 0, poles[origin], 0.0)
    x = base + shift
    column = np.arange(x.size)
    at_pole = origin >= 0
    distance = (poles[:, None] - base) - shift
    own = np.zeros(distance.shape, dtype=bool)
    own[origin[at_pole], column[at_pole]] = True
    safe = np.where(own, 1.0, distance)
    rest = m0 + np.sum(np.where(own, 0.0, m[:, None] * (poles[:, None] / safe) ** 2), axis=0)
    heavy = np.where(at_pole, m[origin] * base**2, 0.0)
    # b^2 = -1/Z'(x), written so that a vanishing shift divides nothing
    root = np.sqrt(np.where(at_pole, shift**2 * rest + heavy, rest))
    b = np.where(at_pole, np.abs(shift), 1.0) / root
    shape = np.empty((n + 1, x.size))
    shape[0] = b
    shape[1:] = poles[:, None] * b / safe
    beside = column[at_pole]
    shape[1 + origin[beside], beside] = -np.sign(shift[beside]) * base[beside] / root[beside]
    return x, shape


def _zeros(
    k0: float, m0: float, m: Array, poles: Array, lower: Array, upper: Array
) -> tuple[Index, Array]:
    """Zeros of Z in each (lower, upper): index of the nearest pole (-1: zero) and shift from it."""
    n, size = poles.size, upper.size
    half = 0.5 * (upper - lower)
    middle = lower + half
    # lower + half itself may be rounded to a pole
    hung = (m * poles)[:, None] / ((poles[:, None] - lower) - half)
    right = k0 - middle * (m0 + np.sum(hung, axis=0)) > 0
    right[n:] = False  # no pole bounds the last interval
    origin = np.where(right, np.arange(size), np.arange(size) - 1)
    at_pole = origin >= 0
    base = np.where(at_pole, poles[origin], 0.0)
    low = np.where(right, -half, 0.0)
    high = np.where(right, 0.0, np.where(np.arange(size) < n, half, upper - lower))

    gap = poles[:, None] - base
    weight = (m * poles)[:, None] * np.ones(size)
    own = np.where(at_pole, weight[origin, np.arange(size)], 0.0)
    weight[origin[at_pole], np.arange(size)[at_pole]] = 0.0
    gap = np.where(weight == 0.0, np.inf, gap)  # the nearest pole is treated apart

    shift = 0.5 * (low + high)
    seed = np.zeros(size)
    for sweep in range(MOST_SWEEPS):
        trial = seed if sweep == 0 else shift
        x = base + trial
        distance = gap - trial
        ratio = weight / distance
        rest = k0 - x * m0 - x * ratio.sum(axis=0)
        slope = -m0 - np.sum(ratio / distance * poles[:, None], axis=0)
        # g = shift * Z has no pole at shift = 0; beside no pole (first interval) g = Z
        g = np.where(at_pole, trial * rest + own * x, rest)
        g_slope = np.where(at_pole, rest + trial * slope + own, slope)
        if sweep > 0:
            falling = np.where(at_pole & (trial < 0), -g, g)  # has the sign of Z
            low = np.where(falling > 0, trial, low)
            high = np.where(falling > 0, high, trial)
        with np.errstate(divide="ignore", invalid="ignore"):
            step = trial - g / g_slope
        inside = (step > low) & (step < high)
        new = np.where(inside, step, 0.5 * (low + high))
        done = np.abs(new - trial) <= 4e-16 * np.abs(new)
        done |= (sweep > 0) & (g == 0)
        done[0] |= k0 == 0  # that zero is x = 0 itself
        shift = np.where((sweep > 0) & (g == 0), trial, new)
        if np.all(done):
            break
    unsettled = ~done & (np.abs(new - trial) > 1e-12 * np.abs(new))
    if np.any(unsettled):
        raise NotConvergedError(
            f"{int(unsettled.sum())} of {size} free frequencies have not converged after "
            f"{MOST_SWEEPS} steps; masses or frequencies differ too much for double precision."
        )
    if k0 == 0:
        origin[0], shift[0] = -1, 0.0
    return origin, shift
