"""The passive modal body that fits measured receptances best, and other possible bodies.

1. Poles by vector fitting; residues by least squares, their semidefinite part of rank one.
2. Gauss-Newton (Levenberg-Marquardt) in the logarithms of frequencies and damping ratios and in
   the displacements of the modes. Modes that do not rise above the noise are dropped; a mode is
   added where the residual has a peak above the noise.
3. The modes above the band are expected to continue those in it, with an uncertainty
   (`expected_tail`): the fit is the most probable body. Fits to other noise, and with other equally
   probable tails, show the properties that the measurement does not determine.

Vector fitting: the poles of measured receptances (Gustavsen and Semlyen 1999, relaxed 2006).

With s = iw and poles a_j in conjugate pairs, sigma(s) H_m(s) = N_m(s); both are partial fractions
with these poles, and the zeros of sigma are better poles. N also has a constant and a term 1/s^2,
for modes above the band and rigid-body motion.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from operator import attrgetter
from typing import TypeVar

import numpy as np
from scipy.signal import find_peaks, savgol_filter

from antiosc.base._types import Array, BoolArray, ComplexArray
from antiosc_studies.measured.frf import (
    TAIL_DAMPING,
    TAIL_GAP,
    FittedModes,
    Pairs,
    Tail,
    expected_tail,
    factors,
    random_tail,
    with_tail,
)

T = TypeVar("T")
# Measured for the constants of this module: models from 500 values of a supported part with four
# modes in the band and of a free one, with 2 % noise. Factors of 2 change |Z| at six frequencies of
# the band by the figures below; constants without a figure change nothing. The seconds stay within
# 25 %.
#: Number of relocations of the poles (4e-6 with half as many, 7e-8 with twice as many).
RELOCATED = 8
#: Least height of a peak of the level over its surroundings [nepers].
PROMINENCE = 0.3
#: Least height of a peak over the noise.
OVER_NOISE = 4.0
#: Additional poles as a share of the number of peaks.
SPARE = 0.4
#: Least number of additional poles (5e-5).
LEAST_SPARE = 4
#: Number of frequencies whose derivatives are computed at once.
ROWS = 1024
#: Damping ratio of the initial poles (2e-7).
FIRST_DAMPING = 0.005


def starting_poles(w: Array, H: ComplexArray) -> ComplexArray:
    """Initial poles (n,) in the upper half-plane: at peaks of the mobility and in between."""
    level = np.log(np.sum(np.abs(H) ** 2, axis=1)) / 2 + np.log(w)
    noise = float(np.median(np.abs(np.diff(level, 2)))) / 1.65 if len(w) > 5 else 0.0
    if len(w) > 11:
        level = savgol_filter(level, 5, 2)
    peaks, _ = find_peaks(level, prominence=max(PROMINENCE, OVER_NOISE * noise))
    spare_count = max(LEAST_SPARE, int(SPARE * len(peaks)))
    positions = np.append(w[peaks], np.linspace(w[0], w[-1], spare_count + 2)[1:-1])
    return np.sort(positions) * (1j - FIRST_DAMPING)


def poles(w: Array, H: ComplexArray, weight: Array) -> tuple[Array, Array]:
    """Frequencies [rad/s] and damping ratios of the poles of H (W, M), by vector fitting.

    w : (W,) circular frequencies; weight : (W, M).
    """
    top = float(w[-1])
    starts = starting_poles(w, H) / top
    for _ in range(RELOCATED):
        starts = _relocated(1j * w / top, H, weight, starts)
    starts = starts[starts.imag > 0] * top
    omega = np.abs(starts)
    order = np.argsort(omega)
    return omega[order], (-starts.real / omega)[order]


def _relocated(s: ComplexArray, H: ComplexArray, weight: Array, a: ComplexArray) -> ComplexArray:
    """Better poles from poles `a`: the zeros of sigma in the left half-plane, one of a pair."""
    is_real = a.imag == 0
    first = 1 / (s[:, None] - a)
    second = 1 / (s[:, None] - a.conj())
    basis = np.hstack(
        [np.where(is_real, first, first + second), (1j * (first - second))[:, ~is_real]]
    )
    ones = np.ones((len(s), 1))
    with_rest = np.hstack([basis, ones, 1 / s[:, None] ** 2])
    sigma = np.hstack([basis, ones])

    rows: list[Array] = []
    for h, v in zip(H.T, weight.T, strict=True):
        A = np.hstack([v[:, None] * with_rest, -(v * h)[:, None] * sigma])
        R = np.asarray(np.linalg.qr(np.vstack([A.real, A.imag]), mode="r"))
        rows.append(R[with_rest.shape[1] :, with_rest.shape[1] :])

    scale = float(np.linalg.norm(np.abs(H) * weight)) / len(s)
    A = np.vstack([*rows, scale * np.sum(sigma, axis=0).real[None, :]])
    right = np.append(np.zeros(len(A) - 1), scale * len(s))
    size = np.linalg.norm(A, axis=0)
    size[size == 0] = 1.0
    c = np.linalg.lstsq(A / size, right, rcond=None)[0] / size
    if abs(c[-1]) < 1e-8:
        c[-1] = 1e-8 if c[-1] >= 0 else -1e-8
    n = len(a)
    pairs = np.flatnonzero(~is_real)

    # real form of diag(a) - b c': a pair holds the real and imaginary parts of its state
    state = np.zeros((n + len(pairs), n + len(pairs)))
    state[np.arange(n), np.arange(n)] = a.real
    low = n + np.arange(len(pairs))
    state[low, low] = a.real[pairs]
    state[pairs, low] = a.imag[pairs]
    state[low, pairs] = -a.imag[pairs]
    drive = np.append(np.where(is_real, 1.0, 2.0), np.zeros(len(pairs)))
    zeros = np.linalg.eigvals(state - np.outer(drive, c[:-1]) / c[-1])
    zeros = -np.abs(zeros.real) + 1j * zeros.imag
    flat = np.abs(zeros.imag) < 1e-12 * np.abs(zeros)
    return np.append(zeros[flat].real + 0j, zeros[~flat & (zeros.imag > 0)])


#: Largest number of Gauss-Newton steps in a round (1e-6 with half as many), …
STEPS = 8
#: … at the end, …
LAST_STEPS = 40
#: … and in a fit to other noise.
FEW_STEPS = 8
#: Decrease of chi^2 below which the steps end (6e-5): far below the 1 of a standard deviation.
CONVERGED = 0.1
#: Largest steps in ln(omega) over the damping ratio and at all, and in ln(zeta).
LONGEST = (3.0, 0.1, 1.0)
#: Largest change of a displacement, of a and of l in one step, over its size. At zero the cost has
#: no slope and the search ends: of the 796 values of docs/tutorials/measured.md it left a chi^2 of
#: 2.6e6 without this limit, and leaves 795 with it.
LARGEST_CHANGE = 0.8
#: Limits of steps that have none.
UNLIMITED = (np.array(-np.inf), np.array(np.inf))
#: Squared slope over the largest below which the measurement does not depend on a parameter.
FLAT = 1e-28
#: Levenberg-Marquardt damping at which the search ends.
MOST_DAMPING = 1e8
#: Eigenvalues of a scaled normal matrix below this share of the largest are rounding errors.
UNSEEN = 1e-13
#: Initial size of vanishing residual terms in Gauss-Newton, over the receptance (7e-5).
LIFTED = 1e-3
#: Least relative standard deviation of a measured value.
LEAST_NOISE = 1e-4
#: Relative variance of a fit without any residual.
EXACT = 1e-30
#: Most steps of the search for the noise level.
MOST_SCORES = 40
#: Longest of these steps, in the logarithm of the level.
LONGEST_SCORE = 1.0
#: Step at which the search ends, in the logarithm of the level.
LEAST_SCORE = 1e-3
#: Largest damping ratio of a mode.
MOST_DAMPED = 0.4


@dataclass(frozen=True, eq=False)
class Measured:
    """Receptances of pairs of sites, with their noise."""

    w: Array  # (W,) [rad/s]
    H: ComplexArray  # (W, M) [m/N]
    pairs: Pairs
    sites: int
    sigma: Array | None  # (W, M) standard deviation of the complex values
    power: int  # H w^power was measured, with noise that may not depend on w


def refined(
    data: Measured, weight: Array, modes: FittedModes, steps: int, shift: Array | float = 0.0
) -> tuple[FittedModes, Array, float]:
    """(most probable body near `modes`, its normal matrix, chi^2 over the degrees of freedom)."""
    damping = 1e-6
    residual = residuals(data, weight, modes) + shift
    top = float(data.w[-1])

    def trial_step(step: Array) -> tuple[FittedModes, Array]:
        trial = modes.at(modes.values + step)
        return trial, residuals(data, weight, trial) + shift

    for _ in range(steps):
        equations = _equations(data, weight, modes, residual)
        limits = _limits(modes, top)
        lowered_step, damping = lowered(*equations, residual, damping, trial_step, limits)
        if lowered_step is None:
            break
        gain = float(residual @ residual - lowered_step[1] @ lowered_step[1])
        modes, residual = lowered_step
        if gain < CONVERGED:
            break

    lines = 2 * data.H.size
    residual = residuals(data, weight, modes)
    normal, _ = _equations(data, weight, modes, residual)
    freedom = max(lines - sum(modes.sizes), 1)
    return modes, normal, float(residual[:lines] @ residual[:lines]) / freedom


def lowered(
    normal: Array,
    slope: Array,
    residual: Array,
    damping: float,
    moved: Callable[[Array], tuple[T, Array]],
    limits: tuple[Array, Array] = UNLIMITED,
) -> tuple[tuple[T, Array] | None, float]:
    """One Gauss-Newton step to a lower cost, with as much damping as it takes.

    normal, slope : J'J and J' residual; moved : (body, residual) after a step; limits : lowest and
    highest step. Returns `moved` of the step, or None if no step lowers the cost, and the damping
    to begin the next one with.
    """
    cost = float(residual @ residual)
    diagonal = np.diag(normal)
    size = np.sqrt(np.where(diagonal > FLAT * diagonal.max(), diagonal, np.inf))
    unit = normal / size / size[:, None]
    slope = -slope / size
    finite = np.where(np.isfinite(size), size, 1.0)

    scaled = (limits[0] * finite, limits[1] * finite)
    while damping < MOST_DAMPING:
        damped = unit + damping * np.eye(len(unit))
        trial, trial_residual = moved(_bounded(damped, slope, scaled) / size)
        if float(trial_residual @ trial_residual) < cost:
            return (trial, trial_residual), max(damping / 10, 1e-9)
        damping *= 8

    return None, damping


def _limits(modes: FittedModes, top: float) -> tuple[Array, Array]:
    """Lowest and highest step of each of `values`; frequencies move by a few widths of peaks."""
    in_band = modes.n_band
    count = len(modes.omega)
    damping = modes.zeta[:in_band]
    peaks = np.minimum(LONGEST[0] * np.maximum(damping, 1e-4), LONGEST[1])
    lowest_tail = np.minimum(np.log((1 + TAIL_GAP) * top / modes.omega[in_band:]), 0.0)
    highest_tail = np.full(count - in_band, 2 * LONGEST[1])
    most_damping = np.minimum(LONGEST[2], np.log(MOST_DAMPED / damping))
    least_damping = np.full(in_band, -LONGEST[2])
    sizes = LARGEST_CHANGE * _parameter_scales(modes)
    low = np.concatenate((-peaks, lowest_tail, least_damping, -sizes))
    high = np.concatenate((peaks, highest_tail, most_damping, sizes))
    return low, high


def _parameter_scales(modes: FittedModes) -> Array:
    """The scale of each parameter: the norm of its mode's displacements, of a, or of l."""
    of_modes = np.linalg.norm(modes.b, axis=1)
    sizes = [np.repeat(of_modes, modes.b.shape[1])]
    roots = zip((modes.rigid, modes.root), modes.sizes[3:], strict=True)
    sizes += [np.full(size, np.linalg.norm(L)) for L, size in roots if L is not None]
    return np.concatenate(sizes)


def _bounded(matrix: Array, right: Array, limits: tuple[Array, Array]) -> Array:
    """Solve `matrix` x = `right` within limits: components beyond one are fixed at it, and the
    others solved again.

    Clipping alone would not adapt the other components: in its narrow valleys the cost would then
    rise, and the search would end far from the minimum.
    """
    x = np.zeros_like(right)
    free = np.ones(len(x), dtype=bool)
    while free.any():
        right_side = right[free] - matrix[np.ix_(free, ~free)] @ x[~free]
        x[free] = np.linalg.solve(matrix[np.ix_(free, free)], right_side)
        clipped = np.clip(x, *limits)
        at_limit = x != clipped
        x = clipped
        free &= ~at_limit
        if not at_limit.any():
            break

    return x


def residuals(data: Measured, weight: Array, modes: FittedModes) -> Array:
    """Weighted residuals: real parts, imaginary parts, then those of the tail."""
    misfit = weight * (modes.receptance(data.w, data.pairs) - data.H)
    return np.append(whitened(misfit.reshape(-1)), modes.expected())


def _equations(
    data: Measured, weight: Array, modes: FittedModes, residual: Array
) -> tuple[Array, Array]:
    """J'J (n, n) and J' residual (n,), J being the derivatives of `residuals` by `values`."""
    lines = 2 * data.H.size
    misfit = residual[:lines].reshape(2, *data.H.shape)
    J = modes.expected_jacobian()
    normal = J.T @ J

    slope = J.T @ residual[lines:]
    for rows in _blocks(len(data.w)):
        complex_J = _derivatives(data, weight, modes, rows)
        J = whitened(complex_J.reshape(-1, complex_J.shape[2]))
        normal += J.T @ J
        slope += J.T @ misfit[:, rows].ravel()

    return normal, slope


def _blocks(count: int) -> list[slice]:
    """Slices that divide `count` rows into blocks."""
    return [slice(first, first + ROWS) for first in range(0, count, ROWS)]


def _derivatives(data: Measured, weight: Array, modes: FittedModes, rows: slice) -> ComplexArray:
    """Weighted derivatives (rows, M, n) of the receptances by `values`."""
    return modes.jacobian(data.w[rows], data.pairs) * weight[rows, :, None]


def whitened(values: ComplexArray) -> Array:
    """Real parts above imaginary parts; each has half the variance of the complex value."""
    return np.sqrt(2) * np.concatenate((values.real, values.imag))


def covariance(normal: Array) -> Array:
    """The inverse of a normal matrix; directions that are not observed get no variance."""
    size = np.sqrt(np.maximum(np.diag(normal), np.finfo(float).tiny))
    values, vectors = np.linalg.eigh(normal / size / size[:, None])
    observed = values > UNSEEN * values[-1]
    half = vectors[:, observed] / np.sqrt(values[observed])
    return np.asarray(half @ half.T / size / size[:, None])


def without_zeros(data: Measured, modes: FittedModes) -> FittedModes:
    """The body with small values in place of vanishing terms, where the cost has no gradient."""
    low = slice(len(data.w) // 8 + 1)
    size = LIFTED * float(np.median(np.abs(data.H)))
    mass = LIFTED * float(np.median(np.abs(data.H[low]) * data.w[low, None] ** 2))
    rigid = modes.rigid
    in_band = modes.n_band
    b = modes.b.copy()
    smallest = np.sqrt(LIFTED * modes.tail.b2)
    b[in_band:] = np.where(np.abs(b[in_band:]) < smallest, smallest, b[in_band:])

    return replace(
        modes,
        b=b,
        rigid=None if rigid is None else _with_least_diagonal(rigid, mass),
        root=_with_least_diagonal(modes.root, size),
    )


def _with_least_diagonal(root: Array, least: float) -> Array:
    """The triangular matrix with diagonal entries of at least sqrt(least)."""
    diagonal = np.diag(root)
    small = diagonal**2 < least
    return np.asarray(root + np.diag(np.where(small, np.sqrt(least) - diagonal, 0.0)))


def noise(data: Measured, modes: FittedModes) -> Array:
    """Most likely standard deviations (W, M): a share of |H| plus a floor."""
    fit = modes.receptance(data.w, data.pairs)
    squares = np.abs(data.H - fit) ** 2
    size = np.abs(fit) ** 2
    floor = np.broadcast_to(data.w[:, None] ** (-2.0 * data.power), squares.shape)
    scales = np.array([[np.mean(squares / size) + EXACT], [np.mean(squares / floor)]])
    kinds = scales * np.array([size.ravel(), floor.ravel()])
    fits = [_variances(squares.ravel(), kinds, start) for start in ((0.9, 0.01), (0.01, 0.9))]
    variance = min(
        fits, key=lambda variances: float(np.sum(np.log(variances) + squares.ravel() / variances))
    )
    return np.asarray(np.sqrt(np.maximum(variance.reshape(squares.shape), LEAST_NOISE**2 * size)))


def _variances(squares: Array, kinds: Array, start: tuple[float, float]) -> Array:
    """Most likely variances of two kinds of noise by Fisher's scoring, from squares (N,)."""
    x = np.log(start)
    for _ in range(MOST_SCORES):
        parts = np.exp(x)[:, None] * kinds
        variance = np.sum(parts, axis=0)
        share = parts / variance
        slope = share @ (squares / variance - 1)
        change = np.linalg.solve(share @ share.T + squares.size * 1e-9 * np.eye(2), slope)
        x = x + np.clip(change, -LONGEST_SCORE, LONGEST_SCORE)
        if np.all(np.abs(change) < LEAST_SCORE):
            break

    return np.asarray(np.exp(x) @ kinds)


#: Standard deviations by which a mode's displacement must exceed 0 for the mode to be kept.
SIGNIFICANCE = 6.0
#: Standard deviations by which a mode's part in the residual must exceed 0 for it to be added.
ADD_SIGNIFICANCE = 5.5
#: Rounds of adding and dropping modes.
ROUNDS = 10
#: Largest number of modes added in one round.
AT_ONCE = 12
#: Least damping ratio of a pole that becomes a mode.
LEAST_DAMPED = 1e-6
#: Number of residual peaks where a mode is sought.
PLACES = 40
#: Trial damping ratios of a sought mode, over the typical one of the modes found so far.
WIDTHS = (0.4, 1.0, 2.5)
#: Number of bodies fitted with other noise.
DRAWS = 8
#: Number of other tails from which the fit starts again, each tried twice.
STARTS = 4
#: Increase of the cost up to which a body counts as probable.
PROBABLE = 20.0
#: Number of bodies that always count.
FEW_BODIES = 3
#: Least squared rigid-body motion over the modes' mean, if the lowest line shows none: without
#: noise spurious motions of 1e-11 to 1e-3 appear in the fit (measured).
LEAST_MOTION = 0.01
#: Share of the lowest line that may be neither mass nor spring if the line shows which of the two.
AMBIGUOUS_SHARE = 0.5
#: Number of the lowest lines that tell a free body from a supported one: at higher lines a
#: rigid-body motion may merely compensate a poor tail.
LOWEST = 5
#: Largest misfit at the lowest lines of a free body over that of a supported one.
MISFIT_RATIO = 2.0
#: Ratio of the weights after and before a round below which the noise level has converged.
SETTLED = 1.05


@dataclass(frozen=True, eq=False)
class Fit:
    """The most probable body of a fit."""

    modes: FittedModes
    weight: Array  # 1/sigma of the measured values (W frequencies, M responses)
    chi2: float  # chi-squared divided by the degrees of freedom
    cost: float  # minus twice the logarithm of its probability
    #: bodies that are hardly less probable, with other modes above the band
    tails: tuple[FittedModes, ...] = ()


def fitted(data: Measured, free: bool | None, hysteretic: bool | None) -> Fit:
    """The most probable body among forms of damping and of support."""
    weight = 1 / (np.abs(data.H) if data.sigma is None else data.sigma)
    modes = _initial(data, weight, free, bool(hysteretic))
    best_round = (modes, weight, np.zeros(0))
    lowest = np.inf

    count = AT_ONCE
    for _ in range(ROUNDS):
        modes, normal, _ = refined(data, weight, without_zeros(data, modes), STEPS)
        if data.sigma is None:
            weight = 1 / noise(data, modes)
        score = _cost(data, weight, modes) + SIGNIFICANCE**2 * modes.n_band
        if score < lowest:
            best_round = (modes, weight, normal)
            lowest = score
        elif count > 1:  # so many modes at once have led the search astray
            modes, weight, normal = best_round
            count //= 4
        significant = _significant(modes, covariance(normal))
        modes = modes.with_band_modes(
            *(values[: modes.n_band][significant] for values in _mode_parameters(modes))
        )
        extended = _with_more(data, weight, modes, count)
        if extended is None and significant.all():
            break
        modes = modes if extended is None else extended
        modes = with_tail(modes, expected_tail(modes, float(data.w[-1])))

    modes, weight, _ = best_round
    best = _finished(data, weight, modes)

    if free is None:  # rigid-body motion must stand above the misfit
        supported = _finished(data, weight, replace(modes, rigid=None))
        clear = supported.cost - best.cost >= SIGNIFICANCE**2 * max(best.chi2, 1.0)
        has_rigid_motion = _low_misfit(data, best.modes) < MISFIT_RATIO * _low_misfit(
            data, supported.modes
        )
        if _rigid_is_small(data, best.modes) or not (clear and has_rigid_motion):
            best = supported

    bodies = [best.modes, *_other_tails(data, best)]
    fits = [_finished(data, best.weight, body) for body in _ranked(data, best, bodies)[:2]]
    best = min(fits, key=attrgetter("cost"))
    if hysteretic is None:
        hysteretic_fit = _finished(data, best.weight, replace(best.modes, hysteretic=True))
        best = min(best, hysteretic_fit, key=attrgetter("cost"))
    return replace(best, tails=tuple(_ranked(data, best, [*bodies[1:], *_other_tails(data, best)])))


def _low_misfit(data: Measured, modes: FittedModes) -> float:
    """Mean relative misfit of the lowest frequencies, which depend most on rigid-body motion."""
    low = slice(LOWEST)
    fit = modes.receptance(data.w[low], data.pairs)
    return float(np.mean(np.abs(fit / data.H[low] - 1)))


def _rigid_is_small(data: Measured, modes: FittedModes) -> bool:
    """Whether the fitted rigid-body motion is too small to be that of a free part."""
    if modes.rigid is None:
        return True
    mean = np.mean(modes.b[: modes.n_band] ** 2, axis=0) if modes.n_band else 0.0
    small = np.all(np.sum(modes.rigid**2, axis=1) < LEAST_MOTION * mean)
    return bool(small) and support_is_unclear(data, modes)


def support_is_unclear(data: Measured, modes: FittedModes) -> bool:
    """Whether the lowest frequency shows neither mass nor stiffness at the most mobile point."""
    driving = [column for column, (m, n) in enumerate(data.pairs) if m == n]
    H = modes.receptance(data.w[:1], data.pairs)[0]
    column = max(driving, key=lambda pair_column: abs(H[pair_column]))
    m = data.pairs[column][0]

    if modes.rigid is None:
        dominant = np.sum((modes.b[:, m] / modes.omega) ** 2) + np.sum(modes.root[m] ** 2)
    else:
        dominant = -np.sum(modes.rigid[m] ** 2) / data.w[0] ** 2

    return bool(abs(H[column] - dominant) > AMBIGUOUS_SHARE * abs(H[column]))


def _finished(data: Measured, weight: Array, modes: FittedModes) -> Fit:
    """The converged fit that starts from these modes."""
    for _ in range(ROUNDS):
        modes, _, chi2 = refined(data, weight, without_zeros(data, modes), LAST_STEPS)
        if data.sigma is not None:
            break
        old_weight = weight
        weight = 1 / noise(data, modes)
        if np.median(weight / old_weight) < SETTLED:
            break

    return Fit(modes, weight, chi2, _cost(data, weight, modes))


def _cost(data: Measured, weight: Array, modes: FittedModes) -> float:
    """Minus twice the logarithm of a body's probability."""
    residual = residuals(data, weight, modes)
    return float(residual @ residual - 4 * np.sum(np.log(weight)))


def _ranked(data: Measured, fit: Fit, bodies: list[FittedModes]) -> list[FittedModes]:
    """Those of `bodies` that are nearly as probable as the fit, in order; at least FEW_BODIES."""
    costs = [_cost(data, fit.weight, body) for body in bodies]
    order = np.argsort(costs)
    lowest = min(costs)
    return [
        bodies[i] for k, i in enumerate(order) if k < FEW_BODIES or costs[i] < lowest + PROBABLE
    ]


# -- the initial body


def _initial(data: Measured, weight: Array, free: bool | None, hysteretic: bool) -> FittedModes:
    """Initial modes: poles of vector fitting with residues by least squares."""
    omega, zeta = poles(data.w, data.H, weight)
    low = data.w[0] * (1 - TAIL_GAP)
    top = data.w[-1] * (1 + TAIL_GAP)
    in_band = (omega > low) & (omega < top) & (zeta < MOST_DAMPED) & (zeta > LEAST_DAMPED)
    omega = omega[in_band]
    zeta = zeta[in_band]
    high_poles = data.w[-1] * np.array([1.2, 1.6, 2.5])
    D = factors(
        data.w, np.append(omega, high_poles), np.append(zeta, np.full(3, TAIL_DAMPING)), hysteretic
    )
    basis: ComplexArray = np.hstack([D, np.ones((len(D), 1)), -1 / data.w[:, None] ** 2])
    basis = basis[:, : -1 if free is False else None]

    residues = np.zeros((len(omega) + 5, data.sites, data.sites))
    for column, (m, n) in enumerate(data.pairs):
        A: ComplexArray = weight[:, column, None] * basis
        size = np.linalg.norm(A, axis=0)
        right = whitened(weight[:, column] * data.H[:, column])
        solution = np.linalg.lstsq(whitened(A) / size, right, rcond=None)[0] / size
        residues[: len(solution), m, n] = residues[: len(solution), n, m] = solution

    residues = _completed(residues, data.pairs)
    b = np.array([rank_one(residue) for residue in residues[: len(omega)]]).reshape(-1, data.sites)
    no_tail = Tail(np.zeros(0), np.zeros(0), np.zeros((0, data.sites)), np.zeros(0))
    rigid = None if free is False else _root(residues[-1])
    modes = FittedModes(omega, zeta, b, no_tail, _root(residues[-2]), rigid, hysteretic)
    modes = modes.with_band_modes(*_mode_parameters(modes))
    return with_tail(modes, expected_tail(modes, float(data.w[-1])))


def _completed(residues: Array, pairs: Pairs) -> Array:
    """Residues (n, p, p) with missing driving points completed as for rank one."""
    driven = sorted({m for m, n in pairs if m == n})
    for residue in residues:
        r = max(driven, key=lambda site: residue[site, site])
        for m in range(len(residue)):
            if m not in driven and residue[r, r] > 0:
                residue[m] = residue[:, m] = residue[m, r] / residue[r, r] * residue[:, r]
                residue[m, m] = residue[m, r] ** 2 / residue[r, r]

    return residues


def rank_one(residue: Array) -> Array:
    """b (p,) of the rank-one matrix b b' nearest to a residue."""
    values, vectors = np.linalg.eigh(residue)
    return np.asarray(np.sqrt(max(values[-1], 0.0)) * vectors[:, -1])


def _root(matrix: Array) -> Array:
    """A lower triangle L with L L' near the positive semidefinite part of the matrix."""
    values, vectors = np.linalg.eigh(matrix)
    floor = 1e-9 * float(np.abs(values).max()) + np.finfo(float).tiny
    return np.linalg.cholesky((vectors * np.maximum(values, floor)) @ vectors.T)


def _mode_parameters(modes: FittedModes) -> tuple[Array, Array, Array]:
    """Frequencies, damping ratios and displacements of the modes."""
    return modes.omega, modes.zeta, modes.b


# -- adding and dropping modes


def _significant(modes: FittedModes, spreads: Array) -> BoolArray:
    """Mask of the modes in the band that move some site significantly."""
    displacement = modes.b[: modes.n_band]
    first = len(modes.omega) + modes.n_band
    sigma = np.sqrt(np.diag(spreads)[first : first + displacement.size]).reshape(displacement.shape)
    return np.asarray(np.any(np.abs(displacement) > SIGNIFICANCE * sigma, axis=1))


def _with_more(data: Measured, weight: Array, modes: FittedModes, most: int) -> FittedModes | None:
    """The body with at most `most` further modes at peaks of the residual; None without any."""
    misfit = weight * (data.H - modes.receptance(data.w, data.pairs))
    J = np.empty((*data.H.shape, sum(modes.sizes)), dtype=complex)
    for rows in _blocks(len(data.w)):
        J[rows] = _derivatives(data, weight, modes, rows)
    typical = float(np.median(modes.zeta[: modes.n_band])) if modes.n_band else TAIL_DAMPING
    smooth = np.convolve(np.sum(np.abs(misfit) ** 2, axis=1), np.ones(5) / 5, mode="same")
    peaks = np.flatnonzero((smooth[1:-1] >= smooth[:-2]) & (smooth[1:-1] >= smooth[2:])) + 1
    peaks = peaks[np.argsort(-smooth[peaks])][:PLACES]
    omega = np.repeat(data.w[peaks], len(WIDTHS))
    zeta = np.tile(typical * np.array(WIDTHS), len(peaks))
    D = factors(data.w, omega, zeta, modes.hysteretic)
    score = np.full(len(omega), -np.inf)

    compliance = np.zeros((len(omega), data.sites, data.sites))
    for column, (m, n) in enumerate(data.pairs):
        A = whitened(J[:, column])
        A = A[:, A.any(axis=0)]
        G = whitened(weight[:, column, None] * D)
        G = G - A @ (covariance(A.T @ A) @ (A.T @ G))  # what the body can take up
        size = np.maximum(np.linalg.norm(G, axis=0), np.finfo(float).tiny)
        projection = G.T @ whitened(misfit[:, column])
        compliance[:, m, n] = compliance[:, n, m] = projection / size**2
        if m == n:
            score = np.maximum(score, projection / size)

    peak_lines: list[int] = []
    for i in np.argsort(-score):
        if score[i] < ADD_SIGNIFICANCE or len(peak_lines) == most:
            break
        if all(abs(omega[i] - omega[k]) > 3 * typical * omega[i] for k in peak_lines):
            peak_lines.append(int(i))

    if not peak_lines:
        return None
    parts = _completed(compliance[peak_lines], data.pairs)
    in_band = modes.n_band
    b = np.array([rank_one(part) for part in parts])

    return modes.with_band_modes(
        np.append(modes.omega[:in_band], omega[peak_lines]),
        np.append(modes.zeta[:in_band], zeta[peak_lines]),
        np.vstack((modes.b[:in_band], b)),
    )


# -- other possible bodies


def with_other_noise(data: Measured, fit: Fit) -> list[FittedModes]:
    """Bodies fitted to the measurement with other random noise (seeded)."""
    random = np.random.default_rng(0)
    lines = 2 * data.H.size

    models = []
    for _ in range(DRAWS):
        shift = np.zeros(lines + len(fit.modes.expected()))
        shift[:lines] = random.standard_normal(lines) * max(fit.chi2, 1.0) ** 0.5
        start = without_zeros(data, fit.modes)
        models.append(refined(data, fit.weight, start, FEW_STEPS, shift)[0])

    return models


def _other_tails(data: Measured, fit: Fit) -> list[FittedModes]:
    """Bodies with other, equally probable tails (seeded by the number of modes)."""
    random = np.random.default_rng(fit.modes.n_band)
    models = []
    for _ in range(max(STARTS // data.sites, 1)):
        tail = random_tail(fit.modes.tail, float(data.w[-1]), random)
        start = without_zeros(data, with_tail(fit.modes, tail))
        models.append(refined(data, fit.weight, start, LAST_STEPS)[0])

    return models
