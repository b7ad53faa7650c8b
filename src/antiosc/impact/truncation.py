"""Truncation error: how many anti-oscillators an impact needs, and whether those of a model do.

A truncated model adds the mass of the truncated modes to m0, at the site. This is exact if these
modes are infinitely stiff. In the other extreme this mass is attached by one spring with the first
truncated frequency, which is the softest that is possible. The truth lies between the two, and the
difference of the two impacts measures the truncation error. The error of each of the three
quantities (peak force, impulse, contact time) may change its sign; the estimate of each is
therefore at least half the largest of them. With the factor `TRUNCATION_SAFETY` at least nine of
ten true errors are below the estimate; the median overestimation is 4 to 8
(tests/simulation/test_truncation.py).

A model of the Krylov method is a rule of Gauss and Radau (Golub and Meurant, *Matrices, Moments and
Quadrature*, 2010, ch. 6): m0 and the m_i are weights at 0 and at 1/(omega_i^2 + p^2), p the
expansion point. Its softest extreme is the Gauss rule of the same moments. A spike of force that
belongs to the mass at the site may show in neither extreme: the impact is repeated with half as
many anti-oscillators, those of half of the Krylov space by Lanczos' recurrence on these nodes, and
with as much less m0 as left it between the half and the whole. Where the error at least halves with
twice as many, it is below the change by the former, and m0 is at least the mass of the latter. The
largest change counts, that of the softest and of the lightest model with the factor
`TRUNCATION_SAFETY_RITZ`.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from math import ceil, inf, log
from typing import TypeGuard

import numpy as np

from antiosc.base import checks
from antiosc.base._types import Array
from antiosc.base.errors import InputError, without_warnings
from antiosc.base.texts import percent
from antiosc.engine.damping import DampingMatrix, in_coordinates
from antiosc.impact.histories import History
from antiosc.impact.histories.bars import all_changes, with_floor
from antiosc.models.anti_oscillators import AntiOscillators
from antiosc.models.body import checked_body

#: Share of the force from which a warning is given.
WARN_SHARE = 0.3


def is_reduced(model: object) -> TypeGuard[AntiOscillators]:
    """Whether a model is one of the Krylov method whose anti-oscillators have not converged."""
    if not isinstance(model, AntiOscillators) or model.info.method != "krylov":
        return False
    return model.info.converged is not None and model.info.converged < model.n


def too_few(n: int, error: float) -> str:
    """Warning that `n` anti-oscillators are too few for a contact, by the relative error of its
    force; "" if they are enough.
    """
    if error <= WARN_SHARE:
        return ""
    return (
        f"The model's {n} anti-oscillators are too few for this contact: what they leave out"
        f" may change the force by {percent(error)} (above {percent(WARN_SHARE)} neither peak force"
        " nor contact time is known); extract more (n)."
    )


#: simulates the impact on a model with a given time integration error
Run = Callable[[AntiOscillators, float], History]

#: Factor of safety of the estimate.
TRUNCATION_SAFETY = 2.5
#: Factor of safety of the changes on the softest and on the lightest model of the Krylov method.
TRUNCATION_SAFETY_RITZ = 4.0
#: Least share of a value that is left on the model with half as many anti-oscillators.
SMALL = 1e-3
#: The lowest 1/omega^2 of a Gauss rule lies above this share of the one above it, but for rounding.
SMALL_GAUSS_SHARE = 1e-6
#: Directions of a block that are smaller than this share of its largest depend on those before.
DEFLATED = 1e-10


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
        Time integration error of the impacts.
    """
    _check(model, run)
    tol = checks.tolerance(tol)
    if next_omega is not None:
        next_omega = checks.positive("next_omega", next_omega, "rad/s")
    if model.n == 0:
        return TruncationError(0, inf, inf, inf, inf)
    if model.stretch is not None:
        model = replace(model, stretch=None)

    def impact_on(body: AntiOscillators) -> History:
        """The impact on a model; its warnings are those of a run that nobody sees."""
        with without_warnings():
            return _checked_run(run(body, tol))

    raw = impact_on(model)

    def change(other: AntiOscillators) -> dict[str, float]:
        """Relative changes of the quantities on another model, beyond the errors in time."""
        changes = all_changes(raw, impact_on(other))
        return {name: max(share - tol, 0.0) for name, share in changes.items()}

    softer = change(softest_model(model, next_omega))
    if next_omega is not None or not _unconverged(model):
        errors = {name: TRUNCATION_SAFETY * share for name, share in softer.items()}
        return TruncationError(model.n, **with_floor(errors))

    half = halved(model)
    heavier = change(half)
    m0 = max(2 * model.m0 - half.m0, 0.0)
    m = np.array(model.m)
    if model.inertia is not None:  # a free body keeps its mass
        m[-1] += model.m0 - m0
    lighter = change(replace(model, m0=m0, m=m))
    errors = {}
    for name, share in heavier.items():
        spike = share / max(1 - share, SMALL)  # over the smaller value
        errors[name] = max(TRUNCATION_SAFETY_RITZ * max(softer[name], lighter[name]), spike)
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


def halved(model: AntiOscillators) -> AntiOscillators:
    """A model of the Krylov method, of one site or of several, with half of its Krylov space."""
    if model.n < 2:
        return model.truncated(0)

    P = np.sqrt(model.m)[None] if model.P is None else model.P
    modes, omega = _krylov(P, model.omega, _expansion(model), model.n // 2)
    p = model.n_sites
    rows = slice(p, p + model.n)
    if not model.sites:
        masses = (P @ modes)[0] ** 2
        psi = np.sqrt(masses)[:, None] * modes.T / np.sqrt(model.m)
        given = {"m0": model.m0 + float(model.m.sum() - masses.sum()), "m": masses}
    else:
        psi = modes.T
        left_out = P - (P @ modes) @ modes.T  # of orthonormal modes
        given = {"m0": model.m0 + left_out @ left_out.T, "P": P @ modes}

    damping = model.damping
    if isinstance(damping, DampingMatrix):
        from scipy.linalg import block_diag  # takes as long to load as some impacts

        damping = in_coordinates(damping, block_diag(np.eye(p), modes, np.eye(model.hidden_count)))

    def fewer(values: Array) -> Array:
        """Values of the motions in the new ones."""
        return np.concatenate([values[:p], psi @ values[rows], values[rows.stop :]])

    participation = model.participation
    if participation is not None:
        lumped = 0.0 if model.sites else participation[rows].sum()
        participation = fewer(participation)
        if not model.sites:
            participation[0] += lumped - participation[p : p + len(psi)].sum()
    return replace(
        model,
        **given,
        omega=omega,
        damping=damping,
        participation=participation,
        shapes=None,
        inertia=model.inertia and model.inertia.along(fewer(model.inertia.momentum)),
        strain_error=None,
        strain_misfit=None,
    )


def _krylov(P: Array, omega: Array, point: float, count: int) -> tuple[Array, Array]:
    """(modes (n, k) of a Krylov space in those of a model, their frequencies), k <= count.

    Lanczos' recurrence of 1/(omega^2 + point) in motions of unit stiffness.
    """
    highest = 1 / (omega[0] ** 2 + point)
    lam = (omega[0] ** 2 + point) / (omega**2 + point)
    basis = np.zeros((omega.size, 0))
    block = np.sqrt(lam)[:, None] * P.T

    while basis.shape[1] < count:
        size = np.linalg.norm(block)
        for _ in range(2):
            block = block - basis @ (basis.T @ block)
        directions, sizes, _ = np.linalg.svd(block, full_matrices=False)
        new = directions[:, sizes > DEFLATED * size][:, : count - basis.shape[1]]
        if not new.size:
            break
        basis = np.column_stack((basis, new))
        block = lam[:, None] * new

    values, turn = np.linalg.eigh(basis.T * lam @ basis)
    values, turn = values[::-1], turn[:, ::-1]
    modes = np.sqrt(lam)[:, None] * (basis @ turn) / np.sqrt(values)  # of unit mass
    return modes, np.sqrt(1 / (highest * values) - point)


def too_few_in(hit: History, rerun: Run | None, tol: float) -> str:
    """Warning that the anti-oscillators of the model of a run are too few for it, or ""."""
    model = hit.model
    if not is_reduced(model) or rerun is None:
        return ""

    def known(other: AntiOscillators, tol: float) -> History:
        """The history on a model, without a new run for the model itself."""
        return hit if other is model else rerun(other, tol)

    return too_few(model.n, truncation_error(model, known, tol=tol).peak_force)


def _unconverged(model: AntiOscillators) -> bool:
    """Whether the highest anti-oscillators have not converged, but represent the truncated
    modes.
    """
    return model.info.method == "krylov" and (model.info.converged or 0) < model.n


def _expansion(model: AntiOscillators) -> float:
    """The square [rad²/s²] of the expansion point of a model."""
    point = model.info.get("expansion", 0.0)
    return (2 * np.pi * point) ** 2


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
    checks.function("run", run, "a function run(model, tol) that returns a History")


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
