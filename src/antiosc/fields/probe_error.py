"""The error of what is seen at one point: by the anti-oscillators, the mesh and the force."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from functools import partial
from math import inf, isfinite
from typing import Any

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
from antiosc.models.anti_oscillators import AntiOscillators
from antiosc.models.parameters import has_bars

#: Share of the anti-oscillators from which it is no bound: a peak acceleration of 26 km/s² with 40
#: of them, and a share of 0.89, was 64 km/s² with 160.
NOT_CONVERGED = 0.1
#: Least and largest time integration error of the repeated impact.
LEAST_ERROR, DEFAULT_ERROR = 1e-6, 1e-4


class ProbeError(float):
    """Relative error of the largest value of a probe, the sum of its shares; inf without a bar.

    Attributes
    ----------
    truncation : share by the number of anti-oscillators.
    force : that of the force, which the value follows; None where it has no bar.
    mesh : that of the motion on this mesh; None where it is not estimated.
    """

    truncation: float
    force: float | None
    mesh: float | None

    def __new__(cls, truncation: float, force: float | None, mesh: float | None) -> ProbeError:
        """The sum of the shares."""
        total = inf if force is None or mesh is None else truncation + mesh + force
        error = super().__new__(cls, total)
        error.truncation, error.force, error.mesh = truncation, force, mesh
        return error

    def __str__(self) -> str:
        named = {"anti-oscillators": self.truncation, "mesh": self.mesh, "force": self.force}
        shares = [f"{name} {percent(x)}" for name, x in named.items() if x is not None]
        told = f"± {percent(self)}" if isfinite(self) else "no error bar"
        return f"{told} ({', '.join(shares)})"

    __repr__ = __str__

    def __reduce__(self) -> tuple[type[ProbeError], tuple[Any, ...]]:
        return ProbeError, (self.truncation, self.force, self.mesh)


def probe_error(
    structure: Structure,
    history: History,
    point: Sequence[float] | str | None = None,
    quantity: str = "displacement",
    times: ArrayLike | None = None,
    **options: Any,
) -> ProbeError:
    """Relative error of the largest value of a `probe`.

    It is the sum of three: `.truncation`, the largest difference to the same impact with half of
    the anti-oscillators; `.mesh`, the change of the largest value on the model that is corrected
    for its mesh, times the safety of the budget; `.force`, that of
    `hit.error_budget["peak_force"]` beside its truncation. Without the last two it is infinite:
    extract with `error="estimate"`. A blow of another length, as by another law, excites other
    motions, which is in none of them. Of a part that stretches linear runs are compared.

    Parameters
    ----------
    structure, history, point, quantity, times, **options
        As for `probe`; the history is that of `simulate` or `strike`, which is simulated twice
        more.

    Raises
    ------
    InputError
        As `probe`; a history that cannot be repeated, as those of scenes, and a model with less
        than two anti-oscillators.

    Warns
    -----
    AccuracyWarning
        `.truncation` is a tenth or more: the value has not converged.
    """
    if isinstance(times, str) or not isinstance(quantity, str):
        raise InputError("probe_error takes the quantity before the times.")
    checks.instance("history", history, History, "a History of simulate or strike")
    model = history.model
    if history.rerun is None or not isinstance(model, AntiOscillators) or model.n < 2:
        raise InputError(
            "only an impact of simulate or strike can be repeated with half the anti-oscillators,"
            " of which there must be two or more."
        )
    linear = replace(model, stretch=None)
    at = times_of(history, times)

    def values(run: History) -> Array:
        """Magnitudes (n, 1) of motions, components (n, c) of other quantities, signed."""
        return probe(structure, run, point, quantity, at, **options).reshape(len(at), -1)

    tol = min(max(history.error.get("force", DEFAULT_ERROR), LEAST_ERROR), DEFAULT_ERROR)
    own = values(history if model.stretch is None else history.rerun(linear, tol))
    difference = own - values(history.rerun(linear.truncated(model.n // 2), tol))
    is_motion = quantity in MOTIONS
    largest, k = _largest(own, is_motion)
    change = difference if is_motion else difference[:, [k]]
    truncation = _largest(change, is_motion)[0] / largest if largest else 0.0
    if truncation >= NOT_CONVERGED:
        message = (
            f"The largest {quantity} has not converged: with half the anti-oscillators it changes"
            f" by {percent(truncation)}, which is no bound; extract more of them (n), or see an"
            " acceleration through a filter or by its shock spectrum (srs)."
        )
        on_root(structure.comm, partial(warn, message, AccuracyWarning))

    budget = history.error_budget if has_bars(model) else None
    mesh = None
    if budget is not None and model.strain_error is not None:
        finer = _largest(values(history.rerun(linear.corrected(), tol)), is_motion)[0]
        mesh = budget.safety * abs(finer / largest - 1) if largest else 0.0
    return ProbeError(truncation, None if budget is None else budget.rest_of_force, mesh)


def _largest(values: Array, magnitude: bool) -> tuple[float, int]:
    """(largest magnitude, or size of a component, of a signal (n, c); number of the component)."""
    sizes = np.linalg.norm(values, axis=1)[:, None] if magnitude else np.abs(values)
    return float(sizes.max(initial=0.0)), int(sizes.max(axis=0).argmax())
