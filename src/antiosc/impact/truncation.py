"""Truncation error: how many anti-oscillators an impact needs, and whether those of a model do.

A truncated model adds the mass of the truncated modes to m0, at the site, as if they were
infinitely stiff. The impact is repeated on two other models: with half as many anti-oscillators,
and with m0 on the last one, which is softer than all that are left out. The error is
`TRUNCATION_SAFETY` times the larger change; that of each of the three quantities (peak force,
impulse, contact time) at least half the largest of them. At least nine of ten true errors are below
it; the median overestimation is 7 to 21 (tests/simulation/test_truncation.py).
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from math import ceil, inf
from typing import TypeGuard

import numpy as np

from antiosc.base import checks
from antiosc.base._types import Array
from antiosc.base.errors import InputError, without_warnings
from antiosc.base.texts import percent
from antiosc.engine.damping import DampingMatrix, in_coordinates
from antiosc.impact.histories import History
from antiosc.impact.histories.bars import UNITS, all_changes, with_floor
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

#: Factor of safety of the larger change.
TRUNCATION_SAFETY = 2.0
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
    missing : how many more anti-oscillators are needed, 0 if none; as if the error fell with their
        number, without guarantee.
    """

    n: int
    error: TruncationError
    missing: int


def truncation_error(model: AntiOscillators, run: Run, *, tol: float = 1e-4) -> TruncationError:
    """Estimate the effect of the truncated modes of `model` on an impact; that of a part that
    stretches, by runs without its stretching.

    Parameters
    ----------
    model : AntiOscillators
    run : callable
        The impact: `run(model, tol)` returns its `History`, for instance
        `lambda m, tol: simulate(m, impactor, law, duration, tol=tol)`.
    tol : float
        Time integration error of the impacts.
    """
    _check(model, run)
    tol = checks.tolerance(tol)
    if model.n == 0:
        return TruncationError(0, inf, inf, inf, inf)
    if model.stretch is not None:
        model = replace(model, stretch=None)

    raw = _impact(model, run, tol)
    half = _change(raw, _impact(halved(model), run, tol), tol)
    soft = _change(raw, _impact(softest_model(model), run, tol), tol)
    errors = {name: TRUNCATION_SAFETY * max(half[name], soft[name]) for name in UNITS}

    return TruncationError(model.n, **with_floor(errors))


def choose_n(model: AntiOscillators, run: Run, tol: float = 1e-2) -> CountChoice:
    """Smallest truncation of `model` with an estimated error <= `tol`, or the missing number.

    `run(model, tol)` is the impact, as for `truncation_error`. The error of a truncation is its
    difference to the whole model, and the error of that. To extract as many anti-oscillators as a
    scene needs: extract some, call this, and extract `choice.missing` more until that is 0.

    Raises
    ------
    InputError
        For a tolerance that is not in (0, 1), or a model that is not `AntiOscillators`.
    """
    _check(model, run)
    tol = checks.tolerance(tol)
    fine = min(0.1 * tol, 1e-3)
    found = truncation_error(model, run, tol=fine)

    if found.worst > tol:
        missing = ceil(model.n * (found.worst / tol - 1)) if model.n else 4
        return CountChoice(model.n, found, max(missing, 1))

    whole, of_whole = _impact(model, run, fine), found
    enough, too_small = model.n, 0

    while enough - too_small > 1:
        n = (too_small + enough) // 2
        change = _change(whole, _impact(model.truncated(n), run, fine), fine)
        errors = {name: change[name] + getattr(of_whole, name) for name in UNITS}
        tried = TruncationError(n, **errors)

        if tried.worst <= tol:
            enough, found = n, tried
        else:
            too_small = n

    return CountChoice(enough, found, 0)


def softest_model(model: AntiOscillators) -> AntiOscillators:
    """The model whose residual mass m0 moves with its last anti-oscillator; without m0 the model
    without its last one.
    """
    if model.m0 == 0:
        return model.truncated(model.n - 1)

    n = model.n
    m = np.array(model.m)
    m[-1] += model.m0
    participation = model.participation
    if participation is not None:
        participation = np.array(participation)
        participation[n] += participation[0]
        participation[0] = 0.0

    inertia = model.inertia
    if inertia is not None:
        momentum = np.array(inertia.momentum)
        momentum[n] = momentum[0] - momentum[1:n].sum(axis=0)
        inertia = inertia.along(momentum)

    return replace(model, m0=0.0, m=m, participation=participation, inertia=inertia)


def halved(model: AntiOscillators) -> AntiOscillators:
    """The model, of one site or of several, with half as many anti-oscillators; one of the Krylov
    method that has not converged with half of its Krylov space.
    """
    if not is_reduced(model) or model.n < 2:
        return model.truncated(model.n // 2)

    P = np.sqrt(model.m)[None] if model.P is None else model.P
    point = (2 * np.pi * model.info.get("expansion", 0.0)) ** 2
    modes, omega = _krylov(P, model.omega, point, model.n // 2)
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


def _impact(model: AntiOscillators, run: Run, tol: float) -> History:
    """The impact on a model; its warnings are those of a run that nobody sees."""
    with without_warnings():
        return _checked_run(run(model, tol))


def _change(first: History, second: History, tol: float) -> dict[str, float]:
    """Relative changes of the quantities between two runs, beyond their errors in time."""
    changes = all_changes(first, second)
    return {name: max(share - tol, 0.0) for name, share in changes.items()}


def _check(model: AntiOscillators, run: Run) -> None:
    if not isinstance(model, AntiOscillators):
        raise InputError(f"only AntiOscillators can be truncated; model is {checks.shown(model)}.")
    checked_body("model", model)  # of one site
    checks.function("run", run, "a function run(model, tol) that returns a History")


def _checked_run(hit: History) -> History:
    return checks.instance("what run returns", hit, History, "a History")
