"""The error of what is seen at one point of a part: by the anti-oscillators, and of the force."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from functools import partial
from math import inf, isfinite
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike

from antiosc.base import checks
from antiosc.base._types import Array
from antiosc.base.errors import AccuracyWarning, InputError, warn
from antiosc.base.texts import percent
from antiosc.fem.platform import on_root
from antiosc.fem.structure.structure import Structure
from antiosc.fields.probe import MOTIONS, probe
from antiosc.impact.histories import History
from antiosc.impact.histories.factors import times_of
from antiosc.impact.law_error import by_other_laws
from antiosc.models.anti_oscillators import AntiOscillators
from antiosc.models.parameters import has_bars

if TYPE_CHECKING:
    from antiosc.impact.histories.bars import ErrorBudget


class ProbeError(float):
    """Relative error of the largest value of a probe: the sum of its shares, as a float.

    Infinite where the error of the force or of the mesh is not known: then the value has no bound.
    Printed, it is the bar with its shares.

    Attributes
    ----------
    truncation : float
        Its share by the number of anti-oscillators.
    force : float or None
        That of the force, which the value follows; None where the force has no error bar.
    mesh : float or None
        That of the motion on this mesh; None where it is not estimated.
    law_given : bool
        Whether the error of the force leaves out that of the contact's law.
    """

    truncation: float
    force: float | None
    mesh: float | None
    law_given: bool

    def __new__(
        cls,
        truncation: float,
        force: float | None,
        mesh: float | None = None,
        law_given: bool = False,
    ) -> ProbeError:
        """The sum of the shares."""
        total = inf if force is None or mesh is None else truncation + mesh + force
        error = super().__new__(cls, total)
        error.truncation, error.force = truncation, force
        error.mesh, error.law_given = mesh, law_given
        return error

    def __str__(self) -> str:
        force = "force" if self.law_given else "force and law"
        named = {"anti-oscillators": self.truncation, "mesh": self.mesh, force: self.force}
        known = {name: share for name, share in named.items() if share is not None}
        shares = ", ".join(f"{name} {percent(share)}" for name, share in known.items())
        if isfinite(self):
            return f"± {percent(self)} ({shares}{' with the law as given' * self.law_given})"
        missing = (
            "the force has none" if self.force is None else "that of the mesh is not estimated"
        )
        return f"(no error bar, as {missing}; {shares})"

    __repr__ = __str__

    def __reduce__(self) -> tuple[type[ProbeError], tuple[Any, ...]]:
        return ProbeError, (self.truncation, self.force, self.mesh, self.law_given)


def probe_error(
    structure: Structure,
    history: History,
    point: Sequence[float] | str | None = None,
    quantity: str = "displacement",
    times: ArrayLike | None = None,
    **options: Any,
) -> ProbeError:
    """Relative error of the largest value of a `probe`: by the number of anti-oscillators, and that
    of the force, which the values follow.

    `.truncation` is the largest difference of its signal to that of the same impact with half of
    the anti-oscillators, over the largest value: of motions the magnitude, of other quantities one
    component. From 0.1 on the peak has not converged, and the number is no bound, which a warning
    tells: extract more (n), see an acceleration through a `filter`, or judge it by its shock
    spectrum (`probe_srs`). `.force` is that of `hit.error_budget["peak_force"]` beside its
    truncation, with the change of the value itself by the error of the law where that is larger: a
    blow of another length excites other motions. Where the force has no bar, or the model none, it
    is None, and the error infinite: the probe has no bar either; extract with `error="estimate"`.
    `.mesh` is the change of the largest value on the model that is corrected for its mesh, times
    the factor of safety of the budget; where the mesh's error is not estimated the error is
    infinite. Of a part that stretches linear runs are compared.

    Parameters
    ----------
    structure, history, point, quantity, times, **options
        As for `probe`; the history is that of `simulate` or `strike`, whose impact is simulated
        once more.

    Raises
    ------
    InputError
        As `probe`; a history that cannot be repeated, as those of scenes, and a model with less
        than two anti-oscillators.
    """
    if isinstance(times, str) or not isinstance(quantity, str):
        raise InputError("probe_error takes the quantity before the times.")
    own = linear_run(history)
    at_times = times_of(history, times)
    values, of_fewer = (
        _by_component(probe(structure, hit, point, quantity, at_times, **options))
        for hit in (own, with_fewer(history))
    )
    is_motion = quantity in MOTIONS
    error = error_of_largest(values, of_fewer, is_motion) or 0.0
    by_law = [
        [
            _by_component(probe(structure, hit, point, quantity, at_times, **options))
            for hit in cause
        ]
        for cause in by_laws(history)
    ]
    if error >= NOT_CONVERGED:
        filtered = options.get("filter") is not None
        message = _not_converged(quantity, error, filtered)
        on_root(structure.comm, partial(warn, message, AccuracyWarning))
    share_of_law = share_by_law(values, by_law, is_motion)

    budget = budget_of(history)
    of_mesh = None
    if budget is not None and own.model.strain_error is not None:
        finer = repeated(history, linear(history).corrected())
        changed = _by_component(probe(structure, finer, point, quantity, at_times, **options))
        of_mesh = budget.safety * share_by_law(values, [[changed]], is_motion)
    return with_force(error, budget, of_mesh, share_of_law)


def with_force(
    truncation: float,
    budget: ErrorBudget | None,
    mesh: float | None = None,
    by_law: float = 0.0,
) -> ProbeError:
    """The error of a value that follows the force of an impact, which has this budget or none.

    `by_law`: how much the value itself changes by the error of the law, where that is more: a
    shorter or longer blow excites other motions.
    """
    if budget is None:
        return ProbeError(truncation, None, mesh)
    force = budget.rest_of_force
    if force is not None:
        force += max(by_law - (budget["peak_force"].law or 0.0), 0.0)
    return ProbeError(truncation, force, mesh, bool(budget.law))


def by_laws(history: History) -> list[list[History]]:
    """The same impact by the changed laws of each cause of the law's error; [] where the force has
    no bar.
    """
    budget = budget_of(history)
    if budget is None or budget.rest_of_force is None:
        return []
    return by_other_laws(history, DEFAULT_ERROR)


def share_by_law(values: Array, changed: Sequence[Sequence[Array]], magnitude: bool) -> float:
    """Relative change of the largest value (n, c) by the changed laws: the largest of each cause,
    added.
    """
    own = _largest(values, magnitude)
    if not own:
        return 0.0
    shares = ([abs(_largest(one, magnitude) / own - 1) for one in cause] for cause in changed)
    return sum(max(cause, default=0.0) for cause in shares)


def _largest(values: Array, magnitude: bool) -> float:
    """The largest magnitude, or component, of a signal (n, c)."""
    sizes = np.linalg.norm(values, axis=1) if magnitude else np.abs(values)
    return float(sizes.max(initial=0.0))


def linear_run(history: History) -> History:
    """A history that can be repeated, of a part that stretches that of its linear run."""
    checks.instance("history", history, History, "a History of simulate or strike")
    model = history.model
    if history.rerun is None or not isinstance(model, AntiOscillators) or model.n < 2:
        raise InputError(
            "only an impact of simulate or strike can be repeated with half the anti-oscillators,"
            " of which there must be two or more."
        )
    if model.stretch is None:
        return history
    return repeated(history, linear(history))  # with the motions of all anti-oscillators


def with_fewer(history: History) -> History:
    """The same impact with half of the anti-oscillators."""
    model = linear(history)
    return repeated(history, model.truncated(model.n // 2))


def linear(history: History) -> AntiOscillators:
    """The model of a history, without its second-order forces."""
    return replace(history.model, stretch=None)


def repeated(history: History, model: AntiOscillators) -> History:
    """The same impact on another model."""
    assert history.rerun is not None
    tol = min(max(history.error.get("force", DEFAULT_ERROR), LEAST_ERROR), DEFAULT_ERROR)
    return history.rerun(model, tol)


def budget_of(history: History) -> ErrorBudget | None:
    """The error budget of a history; None where its model has no bars."""
    return history.error_budget if has_bars(history.model) else None


#: Error by the number of anti-oscillators from which it is no bound: a peak acceleration of
#: 26 km/s² with 40 of them, and a number of 0.89, was 64 km/s² with 160.
NOT_CONVERGED = 0.1


def _not_converged(quantity: str, error: float, filtered: bool) -> str:
    """Sentence on a largest value that has not converged."""
    remedy = "extract more anti-oscillators (n)"
    if quantity == "acceleration":
        seen = "" if filtered else ", see it through a filter (CFC1000)"
        remedy += f"{seen}, or judge it by its shock spectrum (probe_srs)"
    return (
        f"The largest {quantity} has not converged: with half the anti-oscillators it changes by"
        f" {percent(error)}, and this number is no bound; {remedy}."
    )


#: Least and largest time integration error of the repeated impact.
LEAST_ERROR, DEFAULT_ERROR = 1e-6, 1e-4


def _by_component(values: Array) -> Array:
    """Values (n, …) of a probe as (n, c)."""
    return values.reshape(len(values), -1)


def error_of_largest(values: Array, fewer: Array, magnitude: bool) -> float | None:
    """Largest difference of two signals (n, c), over the largest value; None without values.

    `magnitude`: of the vectors that the components are; else of the component of the largest value.
    """
    apart = values - fewer
    if magnitude:
        values, apart = (np.linalg.norm(x, axis=1)[:, None] for x in (values, apart))
    row, k = np.unravel_index(int(np.argmax(np.abs(values))), values.shape)
    value = abs(values[row, k])
    return float(np.abs(apart[:, k]).max() / value) if value else None
