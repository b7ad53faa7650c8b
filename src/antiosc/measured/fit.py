"""The passive body in modes that fits measured receptances best, and what is left open.

1. Poles by vector fitting; residues by least squares, their semidefinite part of rank one.
2. Gauss-Newton (Levenberg-Marquardt) in the logarithms of frequencies and damping ratios and in
   the displacements of the modes. Modes that do not stand above the noise go; where the residual
   has peaks above the noise, a mode is added.
3. The modes above the band go on as those in it, with the spread of such modes (`expected_tail`):
   the fit is the most probable body. The fits to other noise, and with other tails as probable,
   show what the measurement leaves open.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from scipy.optimize import minimize

from antiosc.base._types import Array, BoolArray, ComplexArray
from antiosc.measured.modes import Modes, Pairs, Tail, factors
from antiosc.measured.poles import poles

#: A mode stands above the noise if its displacement is this many standard deviations from 0, and
#: is added if its part in the residual is.
STANDS, ADDED = 6.0, 5.5
#: Rounds of adding and dropping modes; modes that are added in one.
ROUNDS, AT_ONCE = 10, 12
#: Modes are sought up to this share beyond the ends of the band.
BEYOND = 0.02
#: Largest and least damping ratio of a pole that is taken for a mode; ratio where none is seen.
MOST_DAMPED, LEAST_DAMPED, TYPICAL = 0.4, 1e-6, 0.01
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
#: Peaks of the residual where a mode is sought, and its damping over the median.
PLACES, WIDTHS = 40, (0.4, 1.0, 2.5)
#: Modes above the band: the highest over its top, the least distance over the frequency, and the
#: modes in the band whose mean distance and mean square go on.
TAIL_END, TAIL_STEP, GOING_ON = 5.0, 0.15, 6
#: Bodies of other noise; other tails that are tried, twice; loss of twice the logarithm of the
#: probability up to which a body counts, and bodies that always do.
DRAWS, STARTS, PROBABLE, FEW_BODIES = 8, 4, 20.0, 3
#: Standard deviations: of a frequency over the distance, of a square over the mean.
SPREAD, DOUBT = 0.5, 1.0
#: Variance of the relative mean square times the number of modes that it is taken of.
FEW = 2.0


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


@dataclass(frozen=True, eq=False)
class Fit:
    """The most probable body.

    weight : 1/sigma (W, M); chi2 : over the degrees of freedom; cost : minus twice the logarithm of
    its probability; tails : bodies with other tails that are hardly less probable.
    """

    modes: Modes
    weight: Array
    chi2: float
    cost: float
    tails: tuple[Modes, ...] = ()


def fitted(data: Measured, free: bool | None, hysteretic: bool | None, given: Tail | None) -> Fit:
    """The most probable body.

    `free`: with rigid-body motion, None: if seen; `hysteretic`: the form of damping, None: the more
    probable one; `given`: the modes above the band.
    """
    weight = 1 / (np.abs(data.H) if data.sigma is None else data.sigma)
    modes = _first(data, weight, free, bool(hysteretic), given)
    for _ in range(ROUNDS):
        modes, normal, _ = refined(data, weight, lifted(data, modes), STEPS)
        if data.sigma is None:
            weight = 1 / noise(data, modes)
        kept = _standing(modes, covariance(normal))
        modes = modes.with_seen(*(each[: modes.seen][kept] for each in _of_modes(modes)))
        more = _missing(data, weight, modes)
        if more is None and kept.all():
            break
        modes = modes if more is None else more
        if given is None:
            modes = with_tail(modes, expected_tail(modes, float(data.w[-1])))
    if free is None and modes.rigid is not None and not _rigid(modes, covariance(normal)):
        modes = replace(modes, rigid=None)
    best = _finished(data, weight, modes)
    bodies = [best.modes, *_other_tails(data, best)]
    best = min((_finished(data, best.weight, one) for one in _best(data, best, bodies)[:2]), key=_cost)
    if hysteretic is None:
        other = _finished(data, best.weight, replace(best.modes, hysteretic=True))
        best = min(best, other, key=_cost)
    return replace(best, tails=tuple(_best(data, best, [*bodies[1:], *_other_tails(data, best)])))


def _cost(fit: Fit) -> float:
    return fit.cost


def _finished(data: Measured, weight: Array, modes: Modes) -> Fit:
    """The fit with the modes that were found."""
    for _ in range(2):  # a term that was lifted finds its way
        modes, _, chi2 = refined(data, weight, lifted(data, modes), LAST_STEPS)
        if data.sigma is None:
            weight = 1 / noise(data, modes)
    return Fit(modes, weight, chi2, _unlikely(data, weight, modes))


def _unlikely(data: Measured, weight: Array, modes: Modes) -> float:
    """Minus twice the logarithm of the probability of a body."""
    residual = _residual(data, weight, modes)
    return float(residual @ residual - 4 * np.sum(np.log(weight)))


def _best(data: Measured, fit: Fit, bodies: list[Modes]) -> list[Modes]:
    """The bodies that are not much less probable than the best, in order; some always."""
    costs = [_unlikely(data, fit.weight, one) for one in bodies]
    order = np.argsort(costs)
    least = min(costs)
    return [bodies[i] for k, i in enumerate(order) if k < FEW_BODIES or costs[i] < least + PROBABLE]


# -- the first body


def _first(
    data: Measured, weight: Array, free: bool | None, hysteretic: bool, given: Tail | None
) -> Modes:
    """Modes at the poles of vector fitting, with the residues of least squares."""
    omega, zeta = poles(data.w, data.H, weight)
    low, top = data.w[0] * (1 - BEYOND), data.w[-1] * (1 + BEYOND)
    real = (omega > low) & (omega < top) & (zeta < MOST_DAMPED) & (zeta > LEAST_DAMPED)
    omega, zeta = omega[real], zeta[real]
    beyond = data.w[-1] * np.array([1.2, 1.6, 2.5])
    D = factors(data.w, np.append(omega, beyond), np.append(zeta, np.full(3, TYPICAL)), hysteretic)
    basis = np.hstack([D, np.ones((len(D), 1)), -1 / data.w[:, None] ** 2])
    basis = basis[:, : -1 if free is False else None]
    residues = np.zeros((len(omega) + 5, data.sites, data.sites))
    for column, (m, n) in enumerate(data.pairs):
        A = weight[:, column, None] * basis
        size = np.linalg.norm(A, axis=0)
        right = _real(weight[:, column] * data.H[:, column])
        found = np.linalg.lstsq(_real(A) / size, right, rcond=None)[0] / size
        residues[: len(found), m, n] = residues[: len(found), n, m] = found
    residues = _completed(residues, data.pairs)
    b = np.array([rank_one(each) for each in residues[: len(omega)]]).reshape(-1, data.sites)
    nothing = Tail(np.zeros(0), np.zeros(0), np.zeros((0, data.sites)), np.zeros(0))
    rigid = None if free is False else _root(residues[-1])
    modes = Modes(omega, zeta, b, nothing, _root(residues[-2]), rigid, hysteretic)
    modes = modes.with_seen(*_of_modes(modes))
    return with_tail(modes, given or expected_tail(modes, float(data.w[-1])))


def _completed(residues: Array, pairs: Pairs) -> Array:
    """Residues (n, p, p) whose sites without a driving point have the value of rank one."""
    own = sorted({m for m, n in pairs if m == n})
    for residue in residues:
        r = max(own, key=lambda site: residue[site, site])
        for m in range(len(residue)):
            if m not in own and residue[r, r] > 0:
                residue[m] = residue[:, m] = residue[m, r] / residue[r, r] * residue[:, r]
                residue[m, m] = residue[m, r] ** 2 / residue[r, r]
    return residues


def rank_one(residue: Array) -> Array:
    """b (p,) of the positive semidefinite matrix b b' that is nearest."""
    values, vectors = np.linalg.eigh(residue)
    return np.asarray(np.sqrt(max(values[-1], 0.0)) * vectors[:, -1])


def _root(matrix: Array) -> Array:
    """A lower triangle L with L L' near the semidefinite part of the matrix."""
    values, vectors = np.linalg.eigh(matrix)
    least = 1e-9 * float(np.abs(values).max()) + np.finfo(float).tiny
    return np.linalg.cholesky((vectors * np.maximum(values, least)) @ vectors.T)


def _of_modes(modes: Modes) -> tuple[Array, Array, Array]:
    return modes.omega, modes.zeta, modes.b


# -- the modes above the band


def expected_tail(modes: Modes, top: float) -> Tail:
    """Modes that go on above `top` [rad/s] as the last ones in the band, in growing distances.

    Where the distances grow beyond those of the part, each stands for several modes.
    """
    seen = modes.seen
    omega, last = modes.omega[:seen], slice(max(seen - GOING_ON, 0), seen)
    own = np.append(0.0, omega)[-GOING_ON - 1 :]
    gap = max(float(own[-1] - own[0]) / max(len(own) - 1, 1), 0.01 * top) if seen else top
    rigid = modes.root if modes.rigid is None else modes.rigid
    least = np.sum(rigid**2, axis=1) * (top**2 if modes.rigid is None else 0.5)
    mean = np.sum(modes.b[last] ** 2, axis=0) / max(min(seen, GOING_ON), 1)
    b2 = np.maximum(mean, least) + np.finfo(float).tiny
    at = [max((float(omega[-1]) if seen else 0.0) + gap, (1 + 2 * BEYOND) * top)]
    steps = []
    while at[-1] < TAIL_END * top or len(at) < 3:
        steps.append(max(gap, TAIL_STEP * at[-1]))
        at.append(at[-1] + steps[-1])
    step = np.array([*steps, steps[-1]])
    many = np.maximum(step / gap, 1.0)
    doubt = np.sqrt(DOUBT**2 / many + FEW / max(seen, 0.5))
    return Tail(np.array(at), SPREAD * step / np.array(at), many[:, None] * b2, doubt)


def with_tail(modes: Modes, tail: Tail) -> Modes:
    """The body with a tail as it is expected; the signs of its displacements are drawn."""
    seen, U = modes.seen, len(tail.omega)
    typical = float(np.median(modes.zeta[:seen])) if seen else TYPICAL
    signs = np.random.default_rng(0).choice((-1.0, 1.0), tail.b2.shape)
    signs[:, 0] = 1.0
    return replace(
        modes,
        omega=np.append(modes.omega[:seen], tail.omega),
        zeta=np.append(modes.zeta[:seen], np.full(U, typical)),
        b=np.vstack((modes.b[:seen], signs * np.sqrt(tail.b2))),
        tail=tail,
    )


# -- Gauss-Newton


def refined(
    data: Measured, weight: Array, modes: Modes, steps: int, shift: Array | float = 0.0
) -> tuple[Modes, Array, float]:
    """The most probable body near `modes`, its normal matrix, and chi^2 over the freedom.

    `shift`: added to all residuals, which are those of another measurement then.
    """
    damping, residual = 1e-6, _residual(data, weight, modes) + shift
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
            residual = _residual(data, weight, trial) + shift
            new = float(residual @ residual)
            damping *= 1 / 80 if new < cost else 8
        if not new < cost:
            break
        gain, cost, modes, damping = cost - new, new, trial, max(8 * damping, 1e-9)
        if gain < CONVERGED:
            break
    J = _jacobian(data, weight, modes)
    lines = 2 * data.H.size
    residual = _residual(data, weight, modes)[:lines]
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


def _residual(data: Measured, weight: Array, modes: Modes) -> Array:
    """Weighted residuals: real parts, imaginary parts, then the tail's."""
    off = weight * (modes.receptance(data.w, data.pairs) - data.H)
    return np.append(_real(off.reshape(-1)), modes.expected()[0])


def _jacobian(data: Measured, weight: Array, modes: Modes) -> Array:
    """Derivatives of the residuals by `values`."""
    J = modes.jacobian(data.w, data.pairs)
    J *= weight[:, :, None]
    return np.vstack((_real(J.reshape(-1, J.shape[2])), modes.expected()[1]))


def _real(values: ComplexArray) -> Array:
    """Real above imaginary parts; the variance of either is half that of the complex value."""
    return np.sqrt(2) * np.concatenate((values.real, values.imag))


def covariance(normal: Array) -> Array:
    """The inverse of a normal matrix; what the measurement does not see has no variance."""
    size = np.sqrt(np.maximum(np.diag(normal), np.finfo(float).tiny))
    values, vectors = np.linalg.eigh(normal / size / size[:, None])
    seen = values > UNSEEN * values[-1]
    half = vectors[:, seen] / np.sqrt(values[seen])
    return np.asarray(half @ half.T / size / size[:, None])


# -- noise, and which modes there are


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
    scales = np.log([np.mean(off / size), np.mean(off / floor)])

    def unlikely(x: Array) -> float:
        variance = np.exp(x[0]) * size + np.exp(x[1]) * floor
        return float(np.mean(np.log(variance) + off / variance))

    starts = [scales + np.log([a, b]) for a, b in ((0.9, 0.01), (0.01, 0.9))]
    runs = [minimize(unlikely, x, method="Nelder-Mead", options={"maxiter": 200}) for x in starts]
    x = min(runs, key=lambda run: float(run.fun)).x
    return np.asarray(np.sqrt(np.exp(x[0]) * size + np.exp(x[1]) * floor))


def _standing(modes: Modes, spreads: Array) -> BoolArray:
    """Which modes in the band stand above the noise at one site or more."""
    own = modes.b[: modes.seen]
    first = len(modes.omega) + modes.seen
    spread = np.sqrt(np.diag(spreads)[first : first + own.size]).reshape(own.shape)
    return np.asarray(np.any(np.abs(own) > STANDS * spread, axis=1))


def _rigid(modes: Modes, spreads: Array) -> bool:
    """Whether a rigid-body motion stands above the noise."""
    first = sum(modes.sizes[:3])
    part = slice(first, first + modes.sizes[3])
    return bool(np.any(np.abs(modes.values[part]) > STANDS * np.sqrt(np.diag(spreads)[part])))


def _missing(data: Measured, weight: Array, modes: Modes) -> Modes | None:
    """The body with the modes that the residual shows at driving points; None for no such mode."""
    off = weight * (data.H - modes.receptance(data.w, data.pairs))
    J = modes.jacobian(data.w, data.pairs) * weight[:, :, None]
    typical = float(np.median(modes.zeta[: modes.seen])) if modes.seen else TYPICAL
    smooth = np.convolve(np.sum(np.abs(off) ** 2, axis=1), np.ones(5) / 5, mode="same")
    at = np.flatnonzero((smooth[1:-1] >= smooth[:-2]) & (smooth[1:-1] >= smooth[2:])) + 1
    at = at[np.argsort(-smooth[at])][:PLACES]
    omega, zeta = np.repeat(data.w[at], len(WIDTHS)), np.tile(typical * np.array(WIDTHS), len(at))
    D = factors(data.w, omega, zeta, modes.hysteretic)
    score = np.full(len(omega), -np.inf)
    found = np.zeros((len(omega), data.sites, data.sites))
    for column, (m, n) in enumerate(data.pairs):
        A = _real(J[:, column])
        A = A[:, A.any(axis=0)]
        G = _real(weight[:, column, None] * D)
        G = G - A @ (covariance(A.T @ A) @ (A.T @ G))  # what the body can take up
        size = np.maximum(np.linalg.norm(G, axis=0), np.finfo(float).tiny)
        along = G.T @ _real(off[:, column])
        found[:, m, n] = found[:, n, m] = along / size**2
        if m == n:
            score = np.maximum(score, along / size)
    chosen: list[int] = []
    for i in np.argsort(-score):
        if score[i] < ADDED or len(chosen) == AT_ONCE:
            break
        if all(abs(omega[i] - omega[k]) > 3 * typical * omega[i] for k in chosen):
            chosen.append(int(i))
    if not chosen:
        return None
    parts = _completed(found[chosen], data.pairs)
    seen, b = modes.seen, np.array([rank_one(each) for each in parts])
    return modes.with_seen(
        np.append(modes.omega[:seen], omega[chosen]),
        np.append(modes.zeta[:seen], zeta[chosen]),
        np.vstack((modes.b[:seen], b)),
    )


# -- what is left open


def with_other_noise(data: Measured, fit: Fit) -> list[Modes]:
    """Bodies that other noise would have given; seeded."""
    random, lines = np.random.default_rng(0), 2 * data.H.size
    found = []
    for _ in range(DRAWS):
        shift = np.zeros(lines + len(fit.modes.expected()[0]))
        shift[:lines] = random.standard_normal(lines) * max(fit.chi2, 1.0) ** 0.5
        start = lifted(data, fit.modes)
        found.append(refined(data, fit.weight, start, FEW_STEPS, shift)[0])
    return found


def _other_tails(data: Measured, fit: Fit) -> list[Modes]:
    """Bodies with other tails among those expected; seeded by the number of modes."""
    random = np.random.default_rng(fit.modes.seen + len(fit.tails))
    found = []
    for _ in range(max(STARTS // data.sites, 1)):
        tail = _drawn(fit.modes.tail, float(data.w[-1]), random)
        start = lifted(data, with_tail(fit.modes, tail))
        found.append(refined(data, fit.weight, start, LAST_STEPS)[0])
    return found


def _drawn(tail: Tail, top: float, random: np.random.Generator) -> Tail:
    """Another tail as probable: all its modes nearer or farther, then each."""
    U = len(tail.omega)
    stretch = np.exp(0.3 * random.standard_normal())
    omega = top + stretch * (tail.omega - top)
    omega = omega * np.exp(tail.spread * random.standard_normal(U))
    b2 = stretch * tail.b2 * np.abs(1 + tail.doubt[:, None] * random.standard_normal(tail.b2.shape))
    omega = np.maximum(np.sort(omega), (1 + BEYOND) * top)
    return replace(tail, omega=omega, b2=np.maximum(b2, LIFTED * tail.b2))
