"""The passive modal body that fits measured receptances best, and other possible bodies.

1. Poles by vector fitting; residues by least squares, of which the semidefinite part of rank one is
   taken.
2. Gauss-Newton (Levenberg-Marquardt) in the logarithms of frequencies and damping ratios and in
   the displacements of the modes. Modes that do not exceed the noise are dropped; a mode is added
   where the residual has a peak above the noise.
3. Modes above the band are expected to continue the modes in it, with an uncertainty
   (`expected_tail`): the fit is the most probable body. Fits to other noise, and with other equally
   probable tails, show which properties the measurement does not determine.

Vector fitting: the poles of measured receptances (Gustavsen and Semlyen 1999, relaxed 2006).

With s = iw and poles a_j in conjugate pairs, sigma(s) H_m(s) = N_m(s); both are partial fractions
with these poles, and the zeros of sigma are better poles. N also has a constant and a term 1/s^2,
for modes above the band and rigid-body motion.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from operator import attrgetter
from sys import float_info
from typing import TypeVar

import numpy as np
from scipy.signal import find_peaks, savgol_filter

from antiosc.base._types import Array, BoolArray, ComplexArray
from antiosc_studies.measured.frf import (
    TAIL_DAMPING,
    TAIL_GAP,
    FittedModes,
    SitePairs,
    TailModes,
    dynamic_factors,
    expected_tail,
    random_tail,
    with_tail,
)

T = TypeVar("T")
# Measured for the constants of this module: models from 500 values of a supported part with four
# modes in the band and of a free one, with 2 % noise. Factors of 2 change |Z| at six frequencies of
# the band by the figures below; constants without a figure change nothing. The seconds stay within
# 25 %.
#: Number of relocations of the poles (4e-6 with half as many, 7e-8 with twice as many).
POLE_RELOCATIONS = 8
#: Least height of a peak of the level over its surroundings [nepers].
MIN_PEAK_PROMINENCE = 0.3
#: Least height of a peak over the noise.
MIN_PEAK_OVER_NOISE = 4.0
#: Additional poles as a share of the number of peaks.
SPARE_POLE_SHARE = 0.4
#: Least number of additional poles (5e-5).
MIN_SPARE_POLES = 4
#: Number of frequencies whose derivatives are computed at once.
FREQUENCIES_AT_ONCE = 1024
#: Damping ratio of the initial poles (2e-7).
INITIAL_DAMPING_RATIO = 0.005


def starting_poles(w: Array, H: ComplexArray) -> ComplexArray:
    """Initial poles (n,) in the upper half-plane: at peaks of the mobility and in between."""
    level = np.log(np.sum(np.abs(H) ** 2, axis=1)) / 2 + np.log(w)
    noise = np.median(np.abs(np.diff(level, 2))) / 1.65 if len(w) > 5 else 0.0
    if len(w) > 11:
        level = savgol_filter(level, 5, 2)
    peaks, _ = find_peaks(level, prominence=max(MIN_PEAK_PROMINENCE, MIN_PEAK_OVER_NOISE * noise))
    spare_count = max(MIN_SPARE_POLES, int(SPARE_POLE_SHARE * len(peaks)))
    between = np.linspace(w[0], w[-1], spare_count + 2)[1:-1]
    positions = np.append(w[peaks], between)
    return np.sort(positions) * (1j - INITIAL_DAMPING_RATIO)


def fitted_poles(w: Array, H: ComplexArray, weight: Array) -> tuple[Array, Array]:
    """Frequencies [rad/s] and damping ratios of the poles of H (W, M), by vector fitting.

    w : (W,) circular frequencies; weight : (W, M).
    """
    top = w[-1]
    starts = starting_poles(w, H) / top
    for _ in range(POLE_RELOCATIONS):
        starts = _relocated_poles(1j * w / top, H, weight, starts)
    starts = starts[starts.imag > 0] * top
    omega = np.abs(starts)
    order = np.argsort(omega)
    return omega[order], (-starts.real / omega)[order]


def _relocated_poles(
    s: ComplexArray, H: ComplexArray, weight: Array, a: ComplexArray
) -> ComplexArray:
    """Better poles from poles `a`: zeros of sigma in the left half-plane, one of each pair."""
    is_real = a.imag == 0
    first = 1 / (s[:, None] - a)
    second = 1 / (s[:, None] - a.conj())
    even = np.where(is_real, first, first + second)
    basis = np.hstack([even, (1j * (first - second))[:, ~is_real]])
    ones = np.ones((len(s), 1))
    with_rest = np.hstack([basis, ones, 1 / s[:, None] ** 2])
    sigma = np.hstack([basis, ones])

    rows: list[Array] = []
    for h, v in zip(H.T, weight.T, strict=True):
        A = np.hstack([v[:, None] * with_rest, -(v * h)[:, None] * sigma])
        R = np.asarray(np.linalg.qr(np.vstack([A.real, A.imag]), mode="r"))
        rows.append(R[with_rest.shape[1] :, with_rest.shape[1] :])

    scale = np.linalg.norm(np.abs(H) * weight) / len(s)
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
MAX_ROUND_STEPS = 8
#: … at the end, …
MAX_FINAL_STEPS = 40
#: … and in a fit to other noise.
MAX_NOISE_FIT_STEPS = 8
#: Decrease of chi^2 below which the steps end (6e-5): far below the 1 of a standard deviation.
CONVERGED_CHI2_DECREASE = 0.1
#: Largest steps in ln(omega) over the damping ratio and at all, and in ln(zeta).
MAX_STEPS = (3.0, 0.1, 1.0)
#: Largest change of a displacement, of a and of l in one step, over its size. At zero the cost has
#: no slope and the search ends: of the 796 values of docs/tutorials/measured.md it left a chi^2 of
#: 2.6e6 without this limit, and leaves 795 with it.
MAX_RELATIVE_CHANGE = 0.8
#: Limits of steps that have none.
NO_STEP_LIMITS = (np.array(-np.inf), np.array(np.inf))
#: Squared slope over the largest below which the measurement does not depend on a parameter.
FLAT_SLOPE_RATIO = 1e-28
#: Levenberg-Marquardt damping at which the search ends.
MAX_LEVENBERG_DAMPING = 1e8
#: Eigenvalues of a scaled normal matrix below this share of the largest are rounding errors.
EIGENVALUE_ROUNDING = 1e-13
#: Initial size of vanishing residual terms in Gauss-Newton, over the receptance (7e-5).
INITIAL_RESIDUAL_RATIO = 1e-3
#: Least relative standard deviation of a measured value.
MIN_RELATIVE_NOISE = 1e-4
#: Relative variance of a fit without any residual.
EXACT_FIT_VARIANCE = 1e-30
#: Most steps of the search for the noise level.
MAX_SCORING_STEPS = 40
#: Longest of these steps, in the logarithm of the level.
MAX_SCORING_STEP = 1.0
#: Step at which the search ends, in the logarithm of the level.
CONVERGED_SCORING_STEP = 1e-3
#: Largest damping ratio of a mode.
MAX_MODE_DAMPING = 0.4


@dataclass(frozen=True, eq=False)
class MeasuredReceptances:
    """Receptances of pairs of sites, with their noise."""

    w: Array  # (W,) [rad/s]
    H: ComplexArray  # (W, M) [m/N]
    pairs: SitePairs
    sites: int
    sigma: Array | None  # (W, M) standard deviation of the complex values
    derivative_order: int  # H w^power was measured, with noise that may not depend on w


def gauss_newton(
    data: MeasuredReceptances,
    weight: Array,
    modes: FittedModes,
    steps: int,
    shift: Array | float = 0.0,
) -> tuple[FittedModes, Array, float]:
    """(most probable body near `modes`, its normal matrix, chi^2 over the degrees of freedom)."""
    damping = 1e-6
    modes = with_nonzero_terms(data, modes)
    residual = weighted_residuals(data, weight, modes) + shift
    top = data.w[-1]

    def trial_step(step: Array) -> tuple[FittedModes, Array]:
        trial = modes.with_values(modes.values + step)
        return trial, weighted_residuals(data, weight, trial) + shift

    for _ in range(steps):
        equations = _normal_equations(data, weight, modes, residual)
        limits = _step_limits(modes, top)
        lowered_step, damping = damped_step(*equations, residual, damping, trial_step, limits)
        if lowered_step is None:
            break
        gain = residual @ residual - lowered_step[1] @ lowered_step[1]
        modes, residual = lowered_step
        if gain < CONVERGED_CHI2_DECREASE:
            break

    lines = 2 * data.H.size
    residual = weighted_residuals(data, weight, modes)
    normal, _ = _normal_equations(data, weight, modes, residual)
    freedom = max(lines - sum(modes.value_sizes), 1)
    return modes, normal, float(residual[:lines] @ residual[:lines]) / freedom


def damped_step(
    normal: Array,
    slope: Array,
    residual: Array,
    damping: float,
    moved: Callable[[Array], tuple[T, Array]],
    limits: tuple[Array, Array] = NO_STEP_LIMITS,
) -> tuple[tuple[T, Array] | None, float]:
    """One Gauss-Newton step to a lower cost, with as much damping as it takes.

    normal, slope : J'J and J' residual; moved : (body, residual) after a step; limits : lowest and
    highest step. Returns (`moved` of the step, or None if no step lowers the cost; damping for the
    next step).
    """
    cost = residual @ residual
    diagonal = np.diag(normal)
    size = np.sqrt(np.where(diagonal > FLAT_SLOPE_RATIO * diagonal.max(), diagonal, np.inf))
    unit = normal / size / size[:, None]
    slope = -slope / size
    finite = np.where(np.isfinite(size), size, 1.0)

    scaled = (limits[0] * finite, limits[1] * finite)
    while damping < MAX_LEVENBERG_DAMPING:
        damped = unit + damping * np.eye(len(unit))
        trial, trial_residual = moved(_bounded_solution(damped, slope, scaled) / size)
        if trial_residual @ trial_residual < cost:
            return (trial, trial_residual), max(damping / 10, 1e-9)
        damping *= 8

    return None, damping


def _step_limits(modes: FittedModes, top: float) -> tuple[Array, Array]:
    """(lowest, highest) step of each of `values`; frequencies move by a few widths of peaks."""
    in_band = modes.n_band
    count = len(modes.omega)
    damping = modes.zeta[:in_band]
    peaks = np.minimum(MAX_STEPS[0] * np.maximum(damping, 1e-4), MAX_STEPS[1])
    lowest_tail = np.minimum(np.log((1 + TAIL_GAP) * top / modes.omega[in_band:]), 0.0)
    highest_tail = np.full(count - in_band, 2 * MAX_STEPS[1])
    most_damping = np.minimum(MAX_STEPS[2], np.log(MAX_MODE_DAMPING / damping))
    least_damping = np.full(in_band, -MAX_STEPS[2])
    sizes = MAX_RELATIVE_CHANGE * _parameter_scales(modes)
    low = np.concatenate((-peaks, lowest_tail, least_damping, -sizes))
    high = np.concatenate((peaks, highest_tail, most_damping, sizes))
    return low, high


def _parameter_scales(modes: FittedModes) -> Array:
    """The scale of each parameter: the norm of its mode's displacements, of `a`, or of `l`."""
    of_modes = np.linalg.norm(modes.b, axis=1)
    sizes = [np.repeat(of_modes, modes.b.shape[1])]
    roots = zip((modes.rigid, modes.residual_root), modes.value_sizes[3:], strict=True)
    sizes += [np.full(size, np.linalg.norm(L)) for L, size in roots if L is not None]
    return np.concatenate(sizes)


def _bounded_solution(matrix: Array, right: Array, limits: tuple[Array, Array]) -> Array:
    """Solve `matrix` x = `right` within limits: components beyond a limit are fixed there, and the
    others are solved again.

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


def weighted_residuals(data: MeasuredReceptances, weight: Array, modes: FittedModes) -> Array:
    """Weighted residuals: real parts, imaginary parts, then those of the tail."""
    misfit = weight * (modes.receptance(data.w, data.pairs) - data.H)
    return np.append(whitened(misfit.reshape(-1)), modes.tail_deviations())


def _normal_equations(
    data: MeasuredReceptances, weight: Array, modes: FittedModes, residual: Array
) -> tuple[Array, Array]:
    """J'J (n, n) and J' residual (n,), J the derivatives of `weighted_residuals` by `values`."""
    lines = 2 * data.H.size
    misfit = residual[:lines].reshape(2, *data.H.shape)
    J = modes.tail_jacobian()
    normal = J.T @ J

    slope = J.T @ residual[lines:]
    for rows in _row_blocks(len(data.w)):
        complex_J = _receptance_derivatives(data, weight, modes, rows)
        J = whitened(complex_J.reshape(-1, complex_J.shape[2]))
        normal += J.T @ J
        slope += J.T @ misfit[:, rows].ravel()

    return normal, slope


def _row_blocks(count: int) -> list[slice]:
    """Slices that divide `count` rows into blocks."""
    size = FREQUENCIES_AT_ONCE
    return [slice(first, first + size) for first in range(0, count, size)]


def _receptance_derivatives(
    data: MeasuredReceptances, weight: Array, modes: FittedModes, rows: slice
) -> ComplexArray:
    """Weighted derivatives (rows, M, n) of the receptances by `values`."""
    return modes.jacobian(data.w[rows], data.pairs) * weight[rows, :, None]


def whitened(values: ComplexArray) -> Array:
    """Real parts stacked on imaginary parts; each has half the variance of the complex value."""
    return np.sqrt(2) * np.concatenate((values.real, values.imag))


def covariance(normal: Array) -> Array:
    """The inverse of a normal matrix; unobserved directions get no variance."""
    size = np.sqrt(np.maximum(np.diag(normal), float_info.min))
    values, vectors = np.linalg.eigh(normal / size / size[:, None])
    observed = values > EIGENVALUE_ROUNDING * values[-1]
    half = vectors[:, observed] / np.sqrt(values[observed])
    return half @ half.T / size / size[:, None]


def with_nonzero_terms(data: MeasuredReceptances, modes: FittedModes) -> FittedModes:
    """The modes with small values in place of zero shapes and residuals, where the gradient of the
    fit's cost vanishes."""
    low = slice(len(data.w) // 8 + 1)
    size = INITIAL_RESIDUAL_RATIO * np.median(np.abs(data.H))
    mass = INITIAL_RESIDUAL_RATIO * np.median(np.abs(data.H[low]) * data.w[low, None] ** 2)
    rigid = modes.rigid
    in_band = modes.n_band
    b = modes.b.copy()
    smallest = np.sqrt(INITIAL_RESIDUAL_RATIO * modes.tail.squares)
    b[in_band:] = np.where(np.abs(b[in_band:]) < smallest, smallest, b[in_band:])
    if rigid is not None:
        rigid = _with_least_diagonal(rigid, mass)

    root = _with_least_diagonal(modes.residual_root, size)
    return replace(modes, b=b, rigid=rigid, residual_root=root)


def _with_least_diagonal(root: Array, least: float) -> Array:
    """The triangular matrix with diagonal entries of at least sqrt(least)."""
    diagonal = np.diag(root)
    small = diagonal**2 < least
    return root + np.diag(np.where(small, np.sqrt(least) - diagonal, 0.0))


def noise_sigma(data: MeasuredReceptances, modes: FittedModes) -> Array:
    """Most likely standard deviations (W, M): a share of |H| plus a floor."""
    fit = modes.receptance(data.w, data.pairs)
    squares = np.abs(data.H - fit) ** 2
    size = np.abs(fit) ** 2
    floor = np.broadcast_to(data.w[:, None] ** (-2.0 * data.derivative_order), squares.shape)
    scales = np.array([[np.mean(squares / size) + EXACT_FIT_VARIANCE], [np.mean(squares / floor)]])
    kinds = scales * np.array([size.ravel(), floor.ravel()])
    values = squares.ravel()
    fits = [_noise_variances(values, kinds, start) for start in ((0.9, 0.01), (0.01, 0.9))]
    variance = min(fits, key=lambda v: np.sum(np.log(v) + values / v))
    least = MIN_RELATIVE_NOISE**2 * size
    return np.sqrt(np.maximum(variance.reshape(squares.shape), least))


def _noise_variances(squares: Array, kinds: Array, start: tuple[float, float]) -> Array:
    """Most likely variances of two kinds of noise by Fisher's scoring, from squares (N,)."""
    x = np.log(start)
    for _ in range(MAX_SCORING_STEPS):
        parts = np.exp(x)[:, None] * kinds
        variance = np.sum(parts, axis=0)
        share = parts / variance
        slope = share @ (squares / variance - 1)
        change = np.linalg.solve(share @ share.T + squares.size * 1e-9 * np.eye(2), slope)
        x = x + np.clip(change, -MAX_SCORING_STEP, MAX_SCORING_STEP)
        if np.all(np.abs(change) < CONVERGED_SCORING_STEP):
            break

    return np.exp(x) @ kinds


#: Standard deviations by which a mode's displacement must exceed 0 for the mode to be kept.
KEEPING_SIGMAS = 6.0
#: Standard deviations by which a mode's part in the residual must exceed 0 for it to be added.
ADDING_SIGMAS = 5.5
#: Rounds of adding and dropping modes.
MAX_ROUNDS = 10
#: Largest number of modes added in one round.
MAX_MODES_PER_ROUND = 12
#: Least damping ratio of a pole that becomes a mode.
MIN_MODE_DAMPING = 1e-6
#: Number of residual peaks where a mode is sought.
RESIDUAL_PEAK_COUNT = 40
#: Trial damping ratios of a sought mode, over the typical one of the modes found so far.
TRIAL_DAMPING_FACTORS = (0.4, 1.0, 2.5)
#: Number of bodies fitted with other noise.
NOISE_DRAWS = 8
#: Number of other tails from which the fit starts again, each tried twice.
TAIL_DRAWS = 4
#: Increase of the cost up to which a body counts as probable.
PROBABLE_COST_INCREASE = 20.0
#: Number of bodies that always count.
MIN_BODIES = 3
#: Least squared rigid-body motion over the modes' mean, if the lowest line shows none: without
#: noise spurious motions of 1e-11 to 1e-3 appear in the fit (measured).
MIN_SENSED_MOTION = 0.01
#: Share of the lowest line that may be neither mass nor spring if the line shows which of the two.
AMBIGUOUS_SHARE = 0.5
#: Number of the lowest lines that tell a free body from a supported one: at higher lines a
#: rigid-body motion may merely compensate a poor tail.
LOWEST_LINE_COUNT = 5
#: Largest misfit at the lowest lines of a free body over that of a supported one.
MAX_FREE_MISFIT_RATIO = 2.0
#: Ratio of the weights after and before a round below which the noise level has converged.
SETTLED_WEIGHT_RATIO = 1.05


@dataclass(frozen=True, eq=False)
class BodyFit:
    """The most probable body of a fit."""

    modes: FittedModes
    weight: Array  # 1/sigma of the measured values (W frequencies, M responses)
    chi2: float  # chi-squared divided by the degrees of freedom
    cost: float  # minus twice the logarithm of its probability
    #: bodies that are hardly less probable, with other modes above the band
    other_tails: tuple[FittedModes, ...] = ()


def most_probable_fit(
    data: MeasuredReceptances, free: bool | None, hysteretic: bool | None
) -> BodyFit:
    """The most probable body among forms of damping and of support."""
    weight = 1 / (np.abs(data.H) if data.sigma is None else data.sigma)
    modes = _initial_modes(data, weight, free, bool(hysteretic))
    best_round = (modes, weight, np.zeros(0))
    lowest = np.inf

    count = MAX_MODES_PER_ROUND
    for _ in range(MAX_ROUNDS):
        modes, normal, _ = gauss_newton(data, weight, modes, MAX_ROUND_STEPS)
        if data.sigma is None:
            weight = 1 / noise_sigma(data, modes)
        score = _log_probability_cost(data, weight, modes) + KEEPING_SIGMAS**2 * modes.n_band
        if score < lowest:
            best_round = (modes, weight, normal)
            lowest = score
        elif count > 1:  # so many modes at once have led the search astray
            modes, weight, normal = best_round
            count //= 4
        significant = _significant_modes(modes, covariance(normal))
        kept = np.flatnonzero(significant)
        modes = modes.with_band_modes(modes.omega[kept], modes.zeta[kept], modes.b[kept])
        extended = _with_further_modes(data, weight, modes, count)
        if extended is None and significant.all():
            break
        modes = extended or modes
        modes = with_tail(modes, expected_tail(modes, data.w[-1]))

    modes, weight, _ = best_round
    best = _converged_fit(data, weight, modes)

    if free is None:  # rigid-body motion must stand above the misfit
        supported = _converged_fit(data, weight, replace(modes, rigid=None))
        clear = supported.cost - best.cost >= KEEPING_SIGMAS**2 * max(best.chi2, 1.0)
        misfit, other = (_low_frequency_misfit(data, fit.modes) for fit in (best, supported))
        moves = clear and misfit < MAX_FREE_MISFIT_RATIO * other
        if not moves or _is_rigid_motion_small(data, best.modes):
            best = supported

    bodies = [best.modes, *_other_tails(data, best)]
    probable = _probable_bodies(data, best, bodies)[:2]
    fits = [_converged_fit(data, best.weight, body) for body in probable]
    best = min(fits, key=attrgetter("cost"))
    if hysteretic is None:
        hysteretic_fit = _converged_fit(data, best.weight, replace(best.modes, hysteretic=True))
        best = min(best, hysteretic_fit, key=attrgetter("cost"))

    tails = _probable_bodies(data, best, [*bodies[1:], *_other_tails(data, best)])
    return replace(best, other_tails=tuple(tails))


def _low_frequency_misfit(data: MeasuredReceptances, modes: FittedModes) -> float:
    """Mean relative misfit of the lowest frequencies, which depend most on rigid-body motion."""
    low = slice(LOWEST_LINE_COUNT)
    fit = modes.receptance(data.w[low], data.pairs)
    return np.mean(np.abs(fit / data.H[low] - 1))


def _is_rigid_motion_small(data: MeasuredReceptances, modes: FittedModes) -> bool:
    """Whether the fitted rigid-body motion is too small to be that of a free part."""
    if modes.rigid is None:
        return True
    mean = np.mean(modes.b[: modes.n_band] ** 2, axis=0) if modes.n_band else 0.0
    small = np.all(np.sum(modes.rigid**2, axis=1) < MIN_SENSED_MOTION * mean)
    return bool(small) and is_support_unclear(data, modes)


def is_support_unclear(data: MeasuredReceptances, modes: FittedModes) -> bool:
    """Whether the lowest frequency shows neither mass nor stiffness at the most mobile point."""
    driving = [column for column, (m, n) in enumerate(data.pairs) if m == n]
    H = modes.receptance(data.w[:1], data.pairs)[0]
    column = max(driving, key=lambda pair_column: abs(H[pair_column]))
    m = data.pairs[column][0]

    if modes.rigid is None:
        dominant = np.sum((modes.b[:, m] / modes.omega) ** 2) + np.sum(modes.residual_root[m] ** 2)
    else:
        dominant = -np.sum(modes.rigid[m] ** 2) / data.w[0] ** 2

    return bool(abs(H[column] - dominant) > AMBIGUOUS_SHARE * abs(H[column]))


def _converged_fit(data: MeasuredReceptances, weight: Array, modes: FittedModes) -> BodyFit:
    """The converged fit that starts from these modes."""
    for _ in range(MAX_ROUNDS):
        modes, _, chi2 = gauss_newton(data, weight, modes, MAX_FINAL_STEPS)
        if data.sigma is not None:
            break
        old_weight = weight
        weight = 1 / noise_sigma(data, modes)
        if np.median(weight / old_weight) < SETTLED_WEIGHT_RATIO:
            break

    return BodyFit(modes, weight, chi2, _log_probability_cost(data, weight, modes))


def _log_probability_cost(data: MeasuredReceptances, weight: Array, modes: FittedModes) -> float:
    """Minus twice the logarithm of a body's probability."""
    residual = weighted_residuals(data, weight, modes)
    return residual @ residual - 4 * np.sum(np.log(weight))


def _probable_bodies(
    data: MeasuredReceptances, fit: BodyFit, bodies: list[FittedModes]
) -> list[FittedModes]:
    """The `bodies` that are nearly as probable as the fit, in order; at least MIN_BODIES."""
    costs = np.array([_log_probability_cost(data, fit.weight, body) for body in bodies])
    order = np.argsort(costs)
    count = max(MIN_BODIES, np.count_nonzero(costs < costs.min() + PROBABLE_COST_INCREASE))
    return [bodies[i] for i in order[:count]]


# -- the initial body


def _initial_modes(
    data: MeasuredReceptances, weight: Array, free: bool | None, hysteretic: bool
) -> FittedModes:
    """Initial modes: poles of vector fitting with residues by least squares."""
    omega, zeta = fitted_poles(data.w, data.H, weight)
    low = data.w[0] * (1 - TAIL_GAP)
    top = data.w[-1] * (1 + TAIL_GAP)
    in_band = (omega > low) & (omega < top) & (zeta < MAX_MODE_DAMPING) & (zeta > MIN_MODE_DAMPING)
    omega = omega[in_band]
    zeta = zeta[in_band]
    all_omega = np.append(omega, data.w[-1] * np.array([1.2, 1.6, 2.5]))
    all_zeta = np.append(zeta, np.full(3, TAIL_DAMPING))
    D = dynamic_factors(data.w, all_omega, all_zeta, hysteretic)
    basis: ComplexArray = np.hstack([D, np.ones((len(D), 1)), -1 / data.w[:, None] ** 2])
    basis = basis[:, : -1 if free is False else None]

    residues = np.zeros((len(omega) + 5, data.sites, data.sites))
    for column, (m, n) in enumerate(data.pairs):
        A: ComplexArray = weight[:, column, None] * basis
        size = np.linalg.norm(A, axis=0)
        right = whitened(weight[:, column] * data.H[:, column])
        solution = np.linalg.lstsq(whitened(A) / size, right, rcond=None)[0] / size
        residues[: len(solution), m, n] = residues[: len(solution), n, m] = solution

    residues = _completed_residues(residues, data.pairs)
    vectors = [rank_one_vector(residue) for residue in residues[: len(omega)]]
    b = np.array(vectors).reshape(-1, data.sites)
    none = np.zeros(0)
    no_tail = TailModes(none, none, np.zeros((0, data.sites)), none)
    rigid = None if free is False else _semidefinite_root(residues[-1])
    root = _semidefinite_root(residues[-2])
    modes = FittedModes(omega, zeta, b, no_tail, root, rigid, hysteretic)
    return with_tail(modes, expected_tail(modes, data.w[-1]))


def _completed_residues(residues: Array, pairs: SitePairs) -> Array:
    """Residues (n, p, p) with missing driving points completed as for rank one."""
    driven = sorted({m for m, n in pairs if m == n})
    for residue in residues:
        r = max(driven, key=lambda site: residue[site, site])
        for m in range(len(residue)):
            if m not in driven and residue[r, r] > 0:
                residue[m] = residue[:, m] = residue[m, r] / residue[r, r] * residue[:, r]
                residue[m, m] = residue[m, r] ** 2 / residue[r, r]

    return residues


def rank_one_vector(residue: Array) -> Array:
    """b (p,) of the rank-one matrix b b' nearest to a residue."""
    values, vectors = np.linalg.eigh(residue)
    return np.sqrt(max(values[-1], 0.0)) * vectors[:, -1]


def _semidefinite_root(matrix: Array) -> Array:
    """A lower triangle L with L L' near the positive semidefinite part of the matrix."""
    values, vectors = np.linalg.eigh(matrix)
    floor = 1e-9 * np.abs(values).max() + float_info.min
    return np.linalg.cholesky((vectors * np.maximum(values, floor)) @ vectors.T)


# -- adding and dropping modes


def _significant_modes(modes: FittedModes, spreads: Array) -> BoolArray:
    """Mask of the modes in the band that move some site significantly."""
    b = modes.b[: modes.n_band]
    first = len(modes.omega) + modes.n_band
    sigma = np.sqrt(np.diag(spreads)[first : first + b.size]).reshape(b.shape)
    return np.any(np.abs(b) > KEEPING_SIGMAS * sigma, axis=1)


def _with_further_modes(
    data: MeasuredReceptances, weight: Array, modes: FittedModes, max_modes: int
) -> FittedModes | None:
    """The body with at most `max_modes` further modes at peaks of the residual; None without."""
    misfit = weight * (data.H - modes.receptance(data.w, data.pairs))
    J = np.empty((*data.H.shape, sum(modes.value_sizes)), dtype=complex)
    for rows in _row_blocks(len(data.w)):
        J[rows] = _receptance_derivatives(data, weight, modes, rows)
    typical = np.median(modes.zeta[: modes.n_band]) if modes.n_band else TAIL_DAMPING
    power = np.sum(np.abs(misfit) ** 2, axis=1)
    smooth = np.convolve(power, np.ones(5) / 5, mode="same")
    inner = smooth[1:-1]
    peaks = np.flatnonzero((inner >= smooth[:-2]) & (inner >= smooth[2:])) + 1
    peaks = peaks[np.argsort(-smooth[peaks])][:RESIDUAL_PEAK_COUNT]
    omega = np.repeat(data.w[peaks], len(TRIAL_DAMPING_FACTORS))
    zeta = np.tile(typical * np.array(TRIAL_DAMPING_FACTORS), len(peaks))
    D = dynamic_factors(data.w, omega, zeta, modes.hysteretic)
    score = np.full(len(omega), -np.inf)

    compliance = np.zeros((len(omega), data.sites, data.sites))
    for column, (m, n) in enumerate(data.pairs):
        A = whitened(J[:, column])
        A = A[:, A.any(axis=0)]
        G = whitened(weight[:, column, None] * D)
        G = G - A @ (covariance(A.T @ A) @ (A.T @ G))  # what the body can take up
        size = np.maximum(np.linalg.norm(G, axis=0), float_info.min)
        projection = G.T @ whitened(misfit[:, column])
        compliance[:, m, n] = compliance[:, n, m] = projection / size**2
        if m == n:
            score = np.maximum(score, projection / size)

    peak_lines: list[int] = []
    for i in np.argsort(-score):
        if score[i] < ADDING_SIGMAS or len(peak_lines) == max_modes:
            break
        if all(abs(omega[i] - omega[k]) > 3 * typical * omega[i] for k in peak_lines):
            peak_lines.append(int(i))

    if not peak_lines:
        return None
    parts = _completed_residues(compliance[peak_lines], data.pairs)
    in_band = modes.n_band
    b = np.array([rank_one_vector(part) for part in parts])

    return modes.with_band_modes(
        np.append(modes.omega[:in_band], omega[peak_lines]),
        np.append(modes.zeta[:in_band], zeta[peak_lines]),
        np.vstack((modes.b[:in_band], b)),
    )


# -- other possible bodies


def with_other_noise(data: MeasuredReceptances, fit: BodyFit) -> list[FittedModes]:
    """Bodies fitted to the measurement with other random noise (seeded)."""
    random = np.random.default_rng(0)
    lines = 2 * data.H.size

    models = []
    for _ in range(NOISE_DRAWS):
        shift = np.zeros(lines + len(fit.modes.tail_deviations()))
        shift[:lines] = random.standard_normal(lines) * max(fit.chi2, 1.0) ** 0.5
        models.append(gauss_newton(data, fit.weight, fit.modes, MAX_NOISE_FIT_STEPS, shift)[0])

    return models


def _other_tails(data: MeasuredReceptances, fit: BodyFit) -> list[FittedModes]:
    """Bodies with other, equally probable tails (seeded by the number of modes)."""
    random = np.random.default_rng(fit.modes.n_band)
    models = []
    for _ in range(max(TAIL_DRAWS // data.sites, 1)):
        tail = random_tail(fit.modes.tail, data.w[-1], random)
        start = with_tail(fit.modes, tail)
        models.append(gauss_newton(data, fit.weight, start, MAX_FINAL_STEPS)[0])

    return models
