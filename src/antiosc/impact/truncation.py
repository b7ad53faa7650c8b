"""Truncation error: the number of anti-oscillators an impact needs, and whether a model has it.

A truncated model adds the mass of the truncated modes to m0, at the site. This is exact if these
modes are infinitely stiff. In the other extreme this mass is attached by one spring with the first
truncated frequency, the softest possible. The truth lies between the two, and the difference of the
two impacts measures the truncation error; each quantity gets at least half of the largest error, as
an error may change its sign. With the factor `TRUNCATION_SAFETY` at least nine of ten true errors
are below the estimate (tests/simulation/test_truncation.py).

A model of the Krylov method is a Gauss–Radau rule (Golub and Meurant, *Matrices, Moments and
Quadrature*, 2010, ch. 6): m0 and the m_i are weights at 0 and at 1/(omega_i^2 + p^2), with the
expansion point p. Its softest extreme is the Gauss rule of the same moments. A spike of force due
to the mass at the site may show in neither extreme. The impact is therefore repeated with two more
models. The halved model has half as many anti-oscillators, from half of the Krylov space (Lanczos'
recurrence on these nodes). In the lighter model, m0 is smaller by as much as it is larger in the
halved model. If doubling the number at least halves the error, the error is below the change by the
halved model, and m0 is at least as large as in the lighter one. The largest change counts; changes
by the softest and the lightest model get the factor `TRUNCATION_SAFETY_RITZ`.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from math import inf
from typing import Any

import numpy as np

from antiosc.base import checks
from antiosc.base._types import Array
from antiosc.base.errors import AccuracyWarning, InputError, warn, without_warnings
from antiosc.base.texts import percent
from antiosc.engine.damping import DampingMatrix, in_coordinates
from antiosc.impact.histories import History
from antiosc.impact.histories.bars import relative_changes_with_site, with_floor
from antiosc.models.anti_oscillators import AntiOscillators, is_reduced
from antiosc.models.body import checked_body
from antiosc.models.motion import ModalState

#: Relative error of the force above which a warning is given.
WARNING_SHARE = 0.3


def too_few_text(n: int, error: float) -> str:
    """Warning if `n` anti-oscillators leave too large a relative `error` of the force; else ""."""
    if error <= WARNING_SHARE:
        return ""
    return (
        f"The model's {n} anti-oscillators are too few for this contact: what they leave out"
        f" may change the force by {percent(error)} (above {percent(WARNING_SHARE)} neither peak"
        " force nor contact time is known); extract more (n)."
    )


#: (model, time integration error) -> history of the impact on this model
RunOnModel = Callable[[AntiOscillators, float], History]

#: Factors of safety of the estimate, and of the changes on the softest and on the lightest model of
#: the Krylov method.
TRUNCATION_SAFETY, TRUNCATION_SAFETY_RITZ = 2.5, 4.0
#: Least ratio of a value on the halved model to the value on the model.
MIN_HALVED_SHARE = 1e-3
#: The lowest 1/omega^2 of a Gauss rule lies above this share of the one above it, but for rounding.
MIN_GAUSS_RATIO = 1e-6
#: Vectors of a block shorter than this share of its longest count as linearly dependent.
DEFLATION_RATIO = 1e-10


@dataclass(frozen=True)
class TruncationError:
    """Estimated relative errors of a model with n anti-oscillators."""

    n: int
    peak_force: float
    impulse: float
    contact_time: float
    deflection: float = 0.0  # largest displacement of a supported site

    @property
    def worst(self) -> float:
        """Largest error of peak force, impulse and contact time."""
        return max(self.peak_force, self.impulse, self.contact_time)


def truncation_error(
    model: AntiOscillators, run: RunOnModel, *, tol: float = 1e-4
) -> TruncationError:
    """Estimate the effect of the truncated modes of `model` on an impact, by runs without
    second-order forces.

    Parameters
    ----------
    model : AntiOscillators
    run : callable
        The impact: `run(model, tol)` returns its `History`, for instance
        `lambda m, tol: simulate(m, impactor, law, duration, tol=tol)`.
    tol : float
        Time integration error of the impacts.
    """
    _check_arguments(model, run)
    tol = checks.tolerance(tol)
    if model.n == 0:
        return TruncationError(0, inf, inf, inf, inf)
    if model.stretch is not None:
        model = replace(model, stretch=None)

    raw = _run_quietly(run, model, tol)

    def change(other: AntiOscillators) -> dict[str, float]:
        """Relative changes of the quantities on another model, minus time-step errors."""
        changes = relative_changes_with_site(raw, _run_quietly(run, other, tol))
        return {name: max(share - tol, 0.0) for name, share in changes.items()}

    softer = change(softest_model(model))
    if not _is_unconverged(model):
        errors = {name: TRUNCATION_SAFETY * share for name, share in softer.items()}
        return TruncationError(model.n, **with_floor(errors))

    half = halved_model(model)
    heavier = change(half)
    m0 = max(2 * model.m0 - half.m0, 0.0)
    m = np.array(model.m)
    if model.inertia is not None:  # a free body keeps its mass
        m[-1] += model.m0 - m0
    lighter = change(replace(model, m0=m0, m=m))
    errors = {}
    for name, share in heavier.items():
        spike = share / max(1 - share, MIN_HALVED_SHARE)  # over the smaller value
        errors[name] = max(TRUNCATION_SAFETY_RITZ * max(softer[name], lighter[name]), spike)
    return TruncationError(model.n, **with_floor(errors))


def choose_n(model: AntiOscillators, run: RunOnModel, tol: float = 1e-2) -> TruncationError:
    """Number and errors of the fewest anti-oscillators of `model` that meet `tol`, else of all;
    the errors are the change from the full model plus the full model's truncation error.

    `run(model, tol)` is the impact, as for `truncation_error`.

    Raises
    ------
    InputError
        A tolerance that is not in (0, 1); a model that is not `AntiOscillators`.
    """
    _check_arguments(model, run)
    tol = checks.tolerance(tol)
    accuracy = min(0.1 * tol, 1e-3)
    whole = truncation_error(model, run, tol=accuracy)
    if whole.worst > tol:
        return whole

    raw = _run_quietly(run, model, accuracy)
    errors = {model.n: whole}

    def error(n: int) -> TruncationError:
        if n not in errors:
            changes = relative_changes_with_site(
                raw, _run_quietly(run, model.truncated(n), accuracy)
            )
            added = {name: change + getattr(whole, name) for name, change in changes.items()}
            errors[n] = TruncationError(n, **with_floor(added))
        return errors[n]

    # double until it is enough, then bisect between the last two
    low = 0
    high = min(1, model.n)
    while error(high).worst > tol:
        low = high
        high = min(2 * high, model.n)
    while high - low > 1:
        middle = (low + high) // 2
        low, high = (low, middle) if error(middle).worst <= tol else (middle, high)

    return error(high)


def softest_model(model: AntiOscillators) -> AntiOscillators:
    """The model whose residual mass is on the softest springs that the model's moments permit.

    They follow from the Gauss rule of the moments (unconverged Krylov models, see the module);
    other models get one spring with the next frequency, which is extrapolated.
    """
    if model.m0 == 0:  # nothing is left out but what the last anti-oscillator stands for
        return model.truncated(model.n - 1)

    n = model.n
    if _is_unconverged(model):
        masses, omega, psi = _gauss_rule(
            np.append(model.m0, model.m), model.omega, _squared_expansion_point(model)
        )
    else:
        spacing = model.omega[-1] - model.omega[-2] if n > 1 else model.omega[-1]
        masses = np.append(model.m, model.m0)
        omega = np.append(model.omega, model.omega[-1] + spacing)
        psi = np.roll(np.eye(n + 1), -1, axis=0)

    # in the softest model psi_0 moves against the site: no damper is known to act on that motion
    modes = np.sqrt(model.m)[:, None] * psi[:, 1:].T / np.sqrt(masses)
    p = model.participation
    if p is not None:
        p = np.concatenate(([0.0], psi @ p[: n + 1], p[n + 1 :]))
    momentum = None
    if model.inertia is not None:
        momentum = np.array(model.inertia.momentum)
        residual = momentum[0] - momentum[1 : n + 1].sum(axis=0)  # of psi_0
        momenta = psi @ np.vstack((residual, momentum[1 : n + 1]))
        momentum = np.vstack((momentum[:1], momenta, momentum[n + 1 :]))

    given = {"m0": 0.0, "m": masses, "omega": omega, "participation": p, "hidden": None}
    return _combined_model(model, modes, momentum, given)


def _combined_model(
    model: AntiOscillators, modes: Array, momentum: Array | None, given: Mapping[str, Any]
) -> AntiOscillators:
    """The model with its n anti-oscillators replaced by k combinations of them.

    modes : (n, k) combinations of unit mass; momentum : (n', 6) momenta of all new coordinates;
    given : new values of other fields of the model.
    """
    damping = model.damping
    if isinstance(damping, DampingMatrix):
        from scipy.linalg import block_diag  # takes as long to load as some impacts

        sites, hidden = np.eye(model.n_sites), np.eye(model.hidden_count)
        damping = in_coordinates(damping, block_diag(sites, modes, hidden))
    inertia = model.inertia
    if inertia is not None and momentum is not None:
        inertia = inertia.along(momentum)
    return replace(
        model,
        **given,
        damping=damping,
        inertia=inertia,
        shapes=None,
        strain_error=None,
        strain_misfit=None,
    )


def halved_model(model: AntiOscillators) -> AntiOscillators:
    """The given Krylov model, of one or several sites, with half of its Krylov space."""
    P = np.sqrt(model.m)[None] if model.P is None else model.P
    modes, omega = _krylov_modes(P, model.omega, _squared_expansion_point(model), model.n // 2)
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

    def fewer(values: Array) -> Array:
        """Values (n', …) of the new coordinates from those of the old ones (n, …)."""
        return np.concatenate([values[:p], psi @ values[rows], values[rows.stop :]])

    participation = model.participation
    if participation is not None:
        lumped = 0.0 if model.sites else participation[rows].sum()
        participation = fewer(participation)
        if not model.sites:
            participation[0] += lumped - participation[p : p + len(psi)].sum()

    momentum = None if model.inertia is None else fewer(model.inertia.momentum)
    given |= {"omega": omega, "participation": participation}
    return _combined_model(model, modes, momentum, given)


def _krylov_modes(P: Array, omega: Array, point: float, count: int) -> tuple[Array, Array]:
    """A Krylov space by Lanczos' block recurrence.

    P : (p, n) inertial couplings of the modes to the sites; omega : (n,) frequencies [rad/s];
    point : `_squared_expansion_point`. Returns (modes (n, k), k <= count, frequencies (k,)).
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
        new = directions[:, sizes > DEFLATION_RATIO * size][:, : count - basis.shape[1]]
        if not new.size:
            break
        basis = np.column_stack((basis, new))
        block = lam[:, None] * new

    values, turn = np.linalg.eigh(basis.T * lam @ basis)
    values, turn = values[::-1], turn[:, ::-1]
    modes = np.sqrt(lam)[:, None] * (basis @ turn) / np.sqrt(values)  # of unit mass
    return modes, np.sqrt(1 / (highest * values) - point)


def too_few_text_of_run(hit: History, rerun: RunOnModel, tol: float) -> str:
    """Warning if the model of a run has too few anti-oscillators for it; else ""."""
    model = hit.model
    error = truncation_error(
        model, lambda other, tol: hit if other is model else rerun(other, tol), tol=tol
    )
    return too_few_text(model.n, error.peak_force)


def warn_too_few(hit: History, rerun: Callable[[dict[str, object]], History]) -> None:
    """Warn of each body whose peak forces change too much with half as many anti-oscillators."""
    scene = hit.assembly.scene
    touched = [contact for contact in hit.contact_histories if contact.contacts]
    struck = {end.partition(":")[0] for contact in touched for end in contact.ends}
    reduced: dict[str, AntiOscillators] = {}

    for name in struck:
        body = scene.bodies[name]
        given = isinstance(scene.motion.get(name), ModalState)  # in all modes of the body
        if is_reduced(body) and body.stretch is None and not given:
            reduced[name] = body

    if not reduced:
        return

    with without_warnings():
        other = rerun({**scene.bodies, **{n: halved_model(body) for n, body in reduced.items()}})

    for contact in touched:
        changed = sorted({end.partition(":")[0] for end in contact.ends} & reduced.keys())
        if not changed:
            continue
        force = contact.peak_force
        change = abs(other[contact.ends].peak_force - force) / force if force else 0.0
        if sentence := too_few_text(reduced[changed[0]].n, change):
            bodies, of = (" and ".join(map(repr, pair)) for pair in (changed, contact.ends))
            warn(f"{bodies} in the contact of {of}: {sentence}", AccuracyWarning)


def _is_unconverged(model: AntiOscillators) -> bool:
    """Whether the highest anti-oscillators represent the truncated modes."""
    return model.info.method == "krylov" and (model.info.converged or 0) < model.n


def _squared_expansion_point(model: AntiOscillators) -> float:
    """Square p² [rad²/s²] of the expansion point p of a model."""
    point = model.info.get("expansion", 0.0)
    return (2 * np.pi * point) ** 2


def _gauss_rule(m: Array, omega: Array, point: float = 0.0) -> tuple[Array, Array, Array]:
    """Gauss rule with the moments of the masses m (n + 1,) at lam = 0 and 1/(omega^2 + point).

    Returns its masses and frequencies (n,), and its shapes (n, n + 1) as combinations of those of
    m. It is the rule of the space orthogonal to the last Lanczos vector, whose components are
    1/(sqrt(m_i) prod(lam_i - lam_j)).
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
        eigenvalues, np.append(MIN_GAUSS_RATIO * lam[-1], lam[:1:-1]), lam[:0:-1]
    )  # they interlace
    vectors = (basis @ turn).T[::-1]
    shares = vectors @ np.sqrt(m)
    psi = shares[:, None] * vectors / np.sqrt(m)
    return shares**2, np.sqrt(lowest / eigenvalues[::-1] - point), psi


def _check_arguments(model: AntiOscillators, run: RunOnModel) -> None:
    if not isinstance(model, AntiOscillators):
        raise InputError(f"only AntiOscillators can be truncated; model is {checks.shown(model)}.")
    checked_body("model", model)  # of one site
    checks.function("run", run, "a function run(model, tol) that returns a History")


def _run_quietly(run: RunOnModel, model: AntiOscillators, tol: float) -> History:
    """`run(model, tol)` without its warnings; InputError unless it returns a History."""
    with without_warnings():
        hit = run(model, tol)
    return checks.instance("what run returns", hit, History, "a History")
