"""Truncation error: how many anti-oscillators an impact needs, and whether those of a model do.

A truncated model adds the mass of the truncated modes to m0, at the site. This is exact if these
modes are infinitely stiff. In the other extreme this mass is attached by one spring with the first
truncated frequency, which is the softest that is possible. The truth lies between the two, and the
difference of the two impacts measures the truncation error. The error of each of the three
quantities (peak force, impulse, contact time) may change its sign; the estimate of each is
therefore at least half the largest of them. With the factor `TRUNCATION_SAFETY` at least nine of
ten true errors are below the estimate; the median overestimation is 4 to 8, of models of the Krylov
method, whose softest extreme is a Gauss rule, 6 to 18 (tests/simulation/test_truncation.py).

Without a further run (`truncation_share`): the part of Z that the anti-oscillators of the Krylov
method omit lies between two extremes. With λ_i = 1/ω_i² and λ_0 = 0 of the residual mass they are
the Gauss–Radau rule of the measure of all masses over λ; the Gauss rule with the same moments,
without a mass at λ = 0, is the other extreme (Golub and Meurant, *Matrices, Moments and
Quadrature*, 2010, ch. 6). With σ = 1/s² its Z lacks

    D(s) = 1/Σ_i [(λ_i + σ)/m_i Π_(j≠i) ((λ_j + σ)/(λ_i - λ_j))²].

At a complex s the force of a blow is v/(s C), C the compliance of both bodies and of the contact in
series. The difference of the two forces over the force, on a ray of s whose |s| are those of the
contact, shows how well the force is known. About an expansion point p the rules are those over
θ_i = 1/(ω_i² + p²), in which Z lacks D(σ', θ)/(1 - p²σ)² with σ' = σ/(1 - p²σ). On thin and thick
plates and a bracket with 3 to 120 anti-oscillators, peak forces were wrong by less than the share
where it was above `WARN_SHARE`, and by less than 8 % below. For several sites both are block
rules: the difference of the compliances along the contact replaces that by D.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from math import ceil, inf, log
from weakref import WeakKeyDictionary

import numpy as np

from antiosc.base import checks
from antiosc.base._types import Array, ComplexArray
from antiosc.base.errors import InputError
from antiosc.base.texts import percent
from antiosc.engine.damping import DampingMatrix, in_coordinates
from antiosc.impact.assembly import Assembly, stiffness_at
from antiosc.impact.histories import History
from antiosc.impact.histories.bars import all_changes, with_floor
from antiosc.models.anti_oscillators import AntiOscillators
from antiosc.models.body import checked_body

#: Points s of the ray over π/T, T the expected contact time.
RAY = np.geomspace(0.5, 30.0, 8) * np.exp(1j * np.radians(75))
#: Directions of a block that are smaller than this share of its largest depend on those before.
DEFLATED = 1e-10
#: Share of the force from which a warning is given.
WARN_SHARE = 0.3


def truncation_share(
    model: AntiOscillators, assembly: Assembly, contact: int = 0, begin: int = 0
) -> float:
    """Share of the force in which the stiffest and the softest possible model differ, 0 to about 1.

    begin : the first mode of the model among those of all bodies. 0 for models whose anti-
    oscillators have all converged, such as those of method="modes", whose error is not bounded as
    closely.
    """
    info = model.info
    if info.method != "krylov" or info.converged is None or info.converged >= model.n:
        return 0.0
    if not model.sites and model.m0 == 0:
        return 0.0
    system = assembly.system
    law = assembly.laws[contact]
    s = np.pi / assembly.contact_time_estimate * RAY
    depth = float(system.depth[contact])
    speed = float(system.speed[contact])
    stiffness = stiffness_at(law, depth, law.touch(speed))
    if not stiffness > 0:
        return 0.0
    squares = system.beta[contact] ** 2 / (s[:, None] ** 2 + system.omega**2)
    C = squares.sum(axis=1) + system.R[contact, contact] + 1 / stiffness
    if model.sites:
        deficit = _compliance_deficit(model, s, assembly.row(contact, begin))
    else:
        modes = model.modal()
        site = squares[:, begin : begin + modes.omega.size].sum(axis=1) + modes.r
        D = _stiffness_deficit(model, s)
        deficit = D * site**2 / (1 - D * site)
    weight = 1 / abs(s)
    shares = abs(deficit / (C * (C + deficit))) ** 2
    force = abs(C) ** -2.0
    return float(np.sqrt((shares @ weight) / (force @ weight)))


def _compliance_deficit(model: AntiOscillators, s: ComplexArray, row: Array) -> ComplexArray:
    """Compliance along a row of sites minus that of the softest model, at complex s."""
    assert model.P is not None
    assert model.dependence is not None
    row = row @ model.dependence
    block_rule = _blocks.get(model)
    if block_rule is None:
        point = _expansion(model)
        nodes = 1 / (model.omega**2 + point)
        lam, P = _block_gauss(np.asarray(model.m0), nodes, model.P)
        block_rule = _blocks[model] = lam / (1 - point * lam), P
    square = s[:, None, None] ** 2
    zero = np.zeros_like(model.m0)
    site = []
    for lam, P, m0 in ((model.omega**-2.0, model.P, model.m0), (*block_rule, zero)):
        compliances = (P[None] / (1 + lam * square)) @ P.T
        site.append(np.linalg.inv(model.k0 + square * (m0 + compliances)))
    return np.asarray(row @ (site[1] - site[0]) @ row)


def _expansion(model: AntiOscillators) -> float:
    """The square [rad²/s²] of the expansion point of a model."""
    return (2 * np.pi * (model.info.expansion or 0.0)) ** 2


def _block_gauss(m0: Array, lam: Array, P: Array) -> tuple[Array, Array]:
    """Nodes and participations (p, .) of the block Gauss rule of several sites.

    A model is a block Gauss-Radau rule: the node 0 has the weight m0 (p, p), and each
    anti-oscillator is a node lam = 1/(omega^2 + p^2) (n,) with its column of P (p, n). The block
    Lanczos recurrence of these nodes without its last block gives the Gauss rule.
    """
    values, vectors = np.linalg.eigh(m0)
    start = np.vstack((np.sqrt(np.maximum(values, 0.0))[:, None] * vectors.T, P.T))
    nodes = np.append(np.zeros(len(m0)), lam / lam[0])
    basis = np.zeros((len(start), 0))
    block = start
    while True:
        size = np.linalg.norm(block)
        for _ in range(2):
            block = block - basis @ (basis.T @ block)
        left_vectors, sizes, _ = np.linalg.svd(block, full_matrices=False)
        new = left_vectors[:, sizes > DEFLATED * size]
        if not new.size or basis.shape[1] + new.shape[1] > lam.size:
            break
        basis = np.column_stack((basis, new))
        block = nodes[:, None] * new
    eigenvalues, turn = np.linalg.eigh(basis.T * nodes @ basis)
    eigenvalues = np.maximum(eigenvalues, SMALL_GAUSS_SHARE * eigenvalues[-1])
    return lam[0] * eigenvalues, start.T @ basis @ turn


_blocks: WeakKeyDictionary[AntiOscillators, tuple[Array, Array]] = WeakKeyDictionary()


def _stiffness_deficit(model: AntiOscillators, s: ComplexArray) -> ComplexArray:
    """Z of the model minus Z of its softest model, at complex s."""
    rule = _rules.get(model)
    if rule is None:
        rule = _rules[model] = _rule(model)
    lam, log_weights = rule
    sigma = s.astype(complex) ** -2.0
    scale = 1 - _expansion(model) * sigma
    logs = np.log(lam + (sigma / scale)[:, None])
    terms = 2 * logs.sum(axis=1, keepdims=True) - logs - log_weights
    largest = terms.real.max(axis=1, keepdims=True)
    deficit = np.exp(-largest[:, 0]) / np.exp(terms - largest).sum(axis=1)
    return np.asarray(deficit / scale**2)


def _rule(model: AntiOscillators) -> tuple[Array, Array]:
    """Nodes λ_i of the Gauss–Radau rule, and the logarithms of m_i Π_(j≠i) (λ_i - λ_j)²."""
    lam = np.append(0.0, 1 / (model.omega**2 + _expansion(model)))
    masses = np.append(model.m0, model.m)
    distances = abs(lam[:, None] - lam)
    distances.flat[:: lam.size + 1] = 1.0
    return lam, 2 * np.log(np.maximum(distances, np.finfo(float).tiny)).sum(axis=1) + np.log(masses)


_rules: WeakKeyDictionary[AntiOscillators, tuple[Array, Array]] = WeakKeyDictionary()


def truncation_warning(model: object, assembly: Assembly, contact: int = 0, begin: int = 0) -> str:
    """Warning that a Krylov model has too few anti-oscillators for a contact; "" if it has enough.

    begin : the first mode of the model among those of all bodies.
    """
    if not isinstance(model, AntiOscillators):
        return ""
    share = truncation_share(model, assembly, contact, begin)
    if share <= WARN_SHARE:
        return ""
    return (
        f"The model's {model.n} anti-oscillators are too few for this contact: what they leave out"
        f" may change the force by {percent(share)} (above {percent(WARN_SHARE)} neither peak force"
        " nor contact time is known); extract more (n)."
    )


#: simulates the impact on a model with a given time integration error
Run = Callable[[AntiOscillators, float], History]

#: Factor of safety of the estimate.
TRUNCATION_SAFETY = 2.0
#: Factor of safety of the estimate between the two extremes of the Krylov method.
TRUNCATION_SAFETY_RITZ = 4.0
#: The lowest 1/omega^2 of a Gauss rule lies above this share of the one above it, but for rounding.
SMALL_GAUSS_SHARE = 1e-6


@dataclass(frozen=True)
class TruncationError:
    """Estimated relative errors of a model with n anti-oscillators."""

    n: int
    peak_force: float
    impulse: float
    contact_time: float
    deflection: float = 0.0

    @property
    def worst(self) -> float:
        """Largest of the three errors."""
        return max(self.peak_force, self.impulse, self.contact_time)


@dataclass(frozen=True)
class CountChoice:
    """The number of anti-oscillators for a scene.

    Attributes
    ----------
    n : smallest number found that meets the tolerance, otherwise all of the model.
    error : the estimate for that number.
    missing : how many more anti-oscillators are needed, 0 if none; extrapolated from the decay of
        the estimate, without guarantee.
    """

    n: int
    error: TruncationError
    missing: int


def truncation_error(
    model: AntiOscillators, run: Run, *, next_omega: float | None = None, tol: float = 1e-4
) -> TruncationError:
    """Estimate the effect of the truncated modes of `model` on an impact; that of a part that
    stretches, by runs without its stretching.

    Parameters
    ----------
    model : AntiOscillators
    run : callable
        The impact: `run(model, tol)` returns its `History`, for instance
        `lambda m, tol: simulate(m, impactor, law, duration, tol=tol)`.
    next_omega : float, optional
        First truncated frequency [rad/s]; by default extrapolated from the last two.
    tol : float
        Time integration error of the two impacts.
    """
    _check(model, run)
    tol = checks.tolerance(tol)
    if next_omega is not None:
        next_omega = checks.positive("next_omega", next_omega, "rad/s")
    if model.n == 0:
        return TruncationError(0, inf, inf, inf, inf)
    if model.stretch is not None:
        model = replace(model, stretch=None)
    raw = _checked_run(run(model, tol))
    change = all_changes(raw, _checked_run(run(softest_model(model, next_omega), tol)))
    ritz = next_omega is None and _unconverged(model)
    safety = TRUNCATION_SAFETY_RITZ if ritz else TRUNCATION_SAFETY
    errors = {name: safety * max(change - tol, 0.0) for name, change in change.items()}
    if ritz:  # both runs may agree by chance
        errors["peak_force"] = max(errors["peak_force"], truncation_share(model, raw.assembly))
    return TruncationError(model.n, **with_floor(errors))


def choose_n(model: AntiOscillators, run: Run, tol: float = 1e-2) -> CountChoice:
    """Smallest truncation of `model` with an estimated error <= `tol`, or the missing number.

    `run(model, tol)` is the impact, as for `truncation_error`. To extract as many anti-oscillators
    as a scene needs: extract some, call this, and extract `choice.missing` more until that is 0.

    Raises
    ------
    InputError
        For a tolerance that is not in (0, 1), or a model that is not `AntiOscillators`.
    """
    _check(model, run)
    tol = checks.tolerance(tol)
    errors: dict[int, TruncationError] = {}

    def error(n: int) -> TruncationError:
        if n not in errors:
            next_omega = float(model.omega[n]) if n < model.n else None
            errors[n] = truncation_error(
                model.truncated(n), run, next_omega=next_omega, tol=min(0.1 * tol, 1e-3)
            )
        return errors[n]

    # double until it is enough, then bisect between the last two
    low = 0
    high = min(1, model.n)
    while error(high).worst > tol and high < model.n:
        low = high
        high = min(2 * high, model.n)
    if error(high).worst > tol:
        return CountChoice(model.n, error(high), _missing_count(errors, tol))
    while high - low > 1:
        middle = (low + high) // 2
        low, high = (low, middle) if error(middle).worst <= tol else (middle, high)
    return CountChoice(high, error(high), 0)


def softest_model(model: AntiOscillators, next_omega: float | None = None) -> AntiOscillators:
    """The model whose residual mass has the softest springs that the moments of the model permit.

    If Krylov anti-oscillators have not converged, it is the Gauss rule of the same moments
    (module); otherwise one spring with the first truncated frequency carries m0.
    """
    if model.m0 == 0:  # nothing is left out but what the last anti-oscillator stands for
        return model.truncated(model.n - 1)
    n = model.n
    psi = np.eye(n + 1)  # shares of psi_0 ... psi_n in the new shapes
    if next_omega is None and _unconverged(model):
        masses, omega, psi = _gauss(np.append(model.m0, model.m), model.omega, _expansion(model))
    else:
        if next_omega is None:
            spacing = model.omega[-1] - model.omega[-2] if n > 1 else model.omega[-1]
            next_omega = float(model.omega[-1] + spacing)
        masses = np.append(model.m, model.m0)
        omega = np.append(model.omega, next_omega)
        psi = np.roll(psi, -1, axis=0)
    p = model.participation
    inertia = model.inertia
    damping = model.damping
    if isinstance(damping, DampingMatrix):
        damping = in_coordinates(damping, _softest_coordinates(model, masses, psi))
    if inertia is not None:
        momentum = inertia.momentum
        residual_momentum = momentum[0] - momentum[1 : n + 1].sum(axis=0)  # of psi_0
        momenta = psi @ np.vstack((residual_momentum, momentum[1 : n + 1]))
        inertia = inertia.along(np.vstack((momentum[:1], momenta, momentum[n + 1 :])))
    if p is not None:
        p = np.concatenate(([0.0], psi @ p[: n + 1], p[n + 1 :]))
    return replace(
        model,
        m0=0.0,
        m=masses,
        omega=omega,
        damping=damping,
        participation=p,
        shapes=None,
        inertia=inertia,
        hidden=None,
        strain_error=None,
        strain_misfit=None,
    )


def _softest_coordinates(model: AntiOscillators, masses: Array, psi: Array) -> Array:
    """Matrix from coordinates of the softest model (site, n modes, hidden) to the model's.

    In the softest model psi_0 moves against the site: no damper is known to act on that motion.
    """
    from scipy.linalg import block_diag  # takes as long to load as some impacts

    modes = np.sqrt(model.m)[:, None] * psi[:, 1:].T / np.sqrt(masses)
    return np.asarray(block_diag(1.0, modes, np.eye(model.hidden_count)))


def _unconverged(model: AntiOscillators) -> bool:
    """Whether the highest anti-oscillators have not converged, but represent the truncated
    modes.
    """
    return model.info.method == "krylov" and (model.info.converged or 0) < model.n


def _gauss(m: Array, omega: Array, point: float = 0.0) -> tuple[Array, Array, Array]:
    """Masses and frequencies (n,) of the Gauss rule that has the moments of m (n + 1,) over
    1/(omega^2 + point).

    m[0] lies at zero. Third result: the share (n, n + 1) of each psi_i in the new shapes. The rule
    is that of the space orthogonal to the last Lanczos vector, 1/(sqrt(m_i) prod(lam_i - lam_j)).
    """
    lowest = omega[0] ** 2 + point
    lam = np.append(0.0, lowest / (omega**2 + point))
    gaps = lam[:, None] - lam
    np.fill_diagonal(gaps, 1.0)
    logs = -np.log(np.maximum(abs(gaps), np.finfo(float).tiny)).sum(axis=1) - 0.5 * np.log(m)
    last = np.sign(gaps).prod(axis=1) * np.exp(logs - logs.max())
    basis = np.linalg.qr(last[:, None], mode="complete")[0][:, 1:]
    eigenvalues, turn = np.linalg.eigh(basis.T * lam @ basis)
    eigenvalues = np.clip(
        eigenvalues, np.append(SMALL_GAUSS_SHARE * lam[-1], lam[:1:-1]), lam[:0:-1]
    )  # they interlace
    vectors = (basis @ turn).T[::-1]
    shares = vectors @ np.sqrt(m)
    psi = shares[:, None] * vectors / np.sqrt(m)
    return shares**2, np.sqrt(lowest / eigenvalues[::-1] - point), psi


def _check(model: AntiOscillators, run: Run) -> None:
    if not isinstance(model, AntiOscillators):
        raise InputError(f"only AntiOscillators can be truncated; model is {checks.shown(model)}.")
    checked_body("model", model)  # of one site
    checks.function("run", run, "a function run(model, tol) that returns a History", 2)


def _checked_run(hit: History) -> History:
    return checks.instance("what run returns", hit, History, "a History")


def _missing_count(known: dict[int, TruncationError], tol: float) -> int:
    """Estimated number of missing anti-oscillators, if the error decreases as a power of n."""
    n = max(known)
    worst = known[n].worst
    rates = [
        log(known[k].worst / worst) / log(n / k)
        for k in known
        if 0 < k <= n / 2 and np.isfinite(known[k].worst) and known[k].worst > worst > 0
    ]
    rate = min(max(min(rates, default=1.0), 0.5), 2.0)
    if not np.isfinite(worst):
        return max(2 * n, 4)
    return max(ceil(n * ((worst / tol) ** (1 / rate) - 1)), 1)
