"""`gradient`: the derivatives of a result by all parameters of an impact.

Each derivative is a central difference of two runs; its difference from the central difference with
a larger step is its error.
"""

from __future__ import annotations

import os
from collections.abc import Callable
from dataclasses import dataclass
from operator import attrgetter
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from antiosc import AntiOscillators, History
from antiosc.base import checks
from antiosc.base._types import Figure
from antiosc.base.errors import InputError, NotDifferentiableError
from antiosc.base.texts import CompletedResult, value_text
from antiosc.impact.assembly import Assembly
from antiosc.impact.error_budget import SAFETY
from antiosc.impact.truncation import TRUNCATION_SAFETY, softest_model
from antiosc.plot.charts import figure_or_path, panels
from antiosc_studies.gradients.goals import DIFFERENCE_TOL, Goal, GoalValues, goal_of, run_for_goal
from antiosc_studies.gradients.numbers import (
    ModelChange,
    VariableImpact,
    VariableNumber,
    mapped_leaves,
    numbers_of_body,
    numbers_of_contact,
)

#: Relative step of a number, and what it becomes where a touch appears or vanishes within it.
RELATIVE_STEPS = (1e-4, 1e-5)
#: Of the second difference, whose distance is the error: its step and tolerance over those of the
#: first. Without changes of the order of steps runs are smooth to 1e-14; to 1e-7 their derivatives
#: are within some 1e-5, to 1e-9 within some 1e-6 of the goal over the number.
COARSE_STEP_FACTOR, COARSE_TOL_FACTOR = 2.0, 100.0
#: Steps of a difference, and its weights there and in the given run; on one side where the other is
#: out of range.
DIFFERENCE_SCHEMES = ((-1, 1), (-0.5, 0.5, 0.0)), ((1, 2), (2.0, -0.5, -1.5))
#: Least error of a derivative, over the goal by the number.
MIN_RELATIVE_ERROR = 2e-6
#: Share of the anti-oscillators that the comparison run for the truncation error omits.
OMITTED_SHARE = 0.25

ParameterTree = dict[str, Any]


@dataclass(frozen=True, eq=False, repr=False)
class Gradient(CompletedResult):
    """Derivatives of a result; derivatives of a single body or contact are attributes too.

    Attributes
    ----------
    goal : str
        The result, and its `value`.
    bodies : dict
        Name of a body -> {parameter: derivative}, arrays (N,) for `m` and `omega`.
    contacts : dict
        Ends (a, b) of a contact -> {parameter of its law, or gap: derivative}.
    error : Gradient
        The error bars >= 0 of all these numbers: errors of the differences, with `error="estimate"`
        also errors of the model. None: unknown.

    A derivative has the unit of the goal over the unit of the parameter; it is None if it does not
    exist, as by m0 if the site has no mass.
    """

    goal: str
    value: float
    bodies: dict[str, ParameterTree]
    contacts: dict[tuple[str, str], ParameterTree]
    error: Gradient | None = None

    def __getattr__(self, name: str) -> Any:
        if name.startswith("_"):
            raise AttributeError(name)
        parts = (*self.bodies.values(), *self.contacts.values())
        holders = [part for part in parts if name in part]
        if len(holders) == 1:
            return holders[0][name]
        parameter_names = sorted({n for part in parts for n in part})
        reason = "several bodies or contacts have it" if holders else "there is no such parameter"
        raise GradientNameError(
            f"the gradient has no {name}: {reason}; take it from bodies[name] or contacts[a, b],"
            f" which have {', '.join(parameter_names)}."
        )

    def numbers(self) -> dict[str, object]:
        """The value and its derivatives, as JSON values by name."""
        contacts = {" - ".join(ends): tree for ends, tree in self.contacts.items()}
        trees = {**self.bodies, **contacts}
        slopes = mapped_leaves(lambda v: np.asarray(v).tolist(), trees)
        return {**super().numbers(), "derivatives": slopes}

    def plot(self, path: str | os.PathLike[str] | None = None) -> Figure | Path:
        """The derivatives by single numbers as bars; with `path` the picture is written.

        A bar has the unit of the goal over that of its parameter; the scale is logarithmic on both
        sides of zero.
        """
        trees = [*self.contacts.values(), *self.bodies.values()]
        single = [pair for tree in trees for pair in tree.items() if isinstance(pair[1], float)]
        if not single:
            raise InputError("the gradient has no derivative by a single number to be drawn.")
        figure, ((axes,),) = panels(1, 1, (6.4, 1.2 + 0.3 * len(single)), shown=path is None)
        values = np.array([v for _, v in single], dtype=float)
        axes.barh(range(len(single)), values, tick_label=[n for n, _ in single])
        smallest = np.abs(values[values != 0]).min(initial=np.inf)
        axes.set_xscale("symlog", linthresh=smallest if smallest < np.inf else 1.0)
        axes.set_xlabel(f"derivative of {self.goal.replace('_', ' ')} (SI units)")
        return figure_or_path(figure, path)

    def _facts(self) -> list[tuple[str, str]]:
        facts = [(self.goal, f"{self.value:.6g}")]
        for slopes in (*self.contacts.values(), *self.bodies.values()):
            texts = {name: value_text(slope) for name, slope in slopes.items()}
            told = [f"{name} {text}" for name, text in texts.items() if text]
            facts.append(("d/d", ", ".join(told)))
        return facts


class GradientNameError(InputError, AttributeError):
    """A gradient has no parameter of this name, or several."""


def gradient(
    hit: Any,
    goal: str | Callable[[Any], float],
    *,
    contact: tuple[str, str] | None = None,
    time: float | None = None,
    part: Any = None,
    x: ArrayLike | None = None,
    error: str | None = None,
) -> Gradient:
    """Derivatives of a result by masses, speeds, stiffnesses, gaps and the model's parameters.

    They are differences of further runs, four for each number, and do not depend on the tolerance
    of `hit`.

    Parameters
    ----------
    hit : History or SceneHistory
        The history of `simulate` or `Scene.run`.
    goal : str or callable
        "peak_force" [N], "impulse" [N s], "contact_time" [s], "restitution", "peak_displacement"
        [m] of the first end of the contact (the structure of `simulate`); "force" [N], or
        "displacement" [m] of this end, at a `time`. Or a function of a `History` that returns a
        number.
    contact : (str, str), optional
        Ends of the contact, if a scene has several.
    time : float, optional
        Time [s] of the goals "force" and "displacement".
    part : Structure or callable, optional
        The structure from which the model was extracted: adds `g.E`, `g.nu`, `g.rho`, `g.thickness`
        and derivatives by other numbers of its material; for several materials {group: derivative}.
        Or a function of `x` (n,) that builds the structure or its model: adds `g.x` (n,), by
        anything that x changes, such as sections, layers or nodes. The model is extracted once, and
        four more times for each number. The contact law, and a structure's site and patch radius,
        do not change.
    x : array_like, shape (n,), optional
        The argument of `part`, if `part` is a function.
    error : "estimate", optional
        `g.error` also has the errors of the model: twice the change with a quarter fewer
        anti-oscillators, or with the residual mass on a spring; and, for a model extracted with
        error="estimate", twice the change with its `corrected()`. Each of these takes as many runs
        again. Only for runs of `simulate`.

    Returns
    -------
    Gradient
        `g.mass`, `g.velocity` of the impactor, `g.m0`, `g.k0`, `g.m`, `g.omega` of the model,
        `g.stiffness` and the other parameters of the contact law by their names, `g.gap`;
        `g.error` has their errors.

    Raises
    ------
    InputError
        A part of a fall, a body that stretched, an unknown goal, a part from which the model was
        not extracted.
    NotDifferentiableError
        The result has no derivative: two peaks differ by less than 0.1 %, there is no contact, or a
        touch appears or vanishes within the step of a number.
    """
    if error is not None:
        checks.choice("error", error, ("estimate",))
    if x is not None and (part is None or not callable(part)):
        raise InputError("x is for a part that is a function of x: give part=, or leave out x.")

    changes = [None, *(_model_changes(hit) if error is not None else [])]
    impacts = [VariableImpact(hit, change) for change in changes]
    models = None
    if part is not None:
        from antiosc_studies.gradients.of_part import PartModels  # loads dolfinx

        models = PartModels(part, x, hit)

    goals = [goal_of(goal, hit, impact.base, contact, time) for impact in impacts]
    slopes = [_slopes_of_goal(*pair, models) for pair in zip(impacts, goals, strict=True)]
    all_slopes = list(zip(*slopes, strict=True))  # of bodies, and of contacts

    asked = goals[0]
    value = asked.value_of(hit)
    fine = run_for_goal(asked, impacts[0].base, DIFFERENCE_TOL).goal
    off = abs(fine - value) + DIFFERENCE_TOL * abs(value)
    bodies, contacts = (mapped_leaves(attrgetter("value"), trees[0]) for trees in all_slopes)
    bars = (mapped_leaves(_derivative_bar, *trees) for trees in all_slopes)
    return Gradient(asked.name, value, bodies, contacts, Gradient(asked.name, off, *bars))


def _model_changes(hit: History) -> list[ModelChange]:
    """Functions that change the model; the effects of the changes estimate its errors."""
    model = hit.assembly.scene.bodies.get("structure") if hit.rerun is not None else None
    if not isinstance(model, AntiOscillators) or not model.n:
        raise InputError(
            "bars of a gradient need a run of simulate on anti-oscillators, one or more; leave"
            " error= out."
        )

    left_out = max(1, round(OMITTED_SHARE * model.n))
    turns: list[ModelChange] = [lambda one: one.truncated(one.n - left_out), softest_model]
    return turns + ([AntiOscillators.corrected] if model.strain_error is not None else [])


class SlopeWithError(NamedTuple):
    """The derivative of a goal by a number, and its error."""

    value: float
    error: float


def _slopes_of_goal(
    impact: VariableImpact, goal: Goal, models: Any
) -> tuple[ParameterTree, dict[Any, ParameterTree]]:
    """Slopes of a goal: (body -> {parameter: slope}, ends of a contact -> {parameter: slope}).

    models : the extracted models of `gradients.of_part`, or None.
    """
    derive = _slope_function(goal, impact.base)
    numbers = {name: numbers_of_body(impact, name) for name in impact.scene.bodies}
    bodies = mapped_leaves(derive, numbers)
    if models is not None:
        again = _slope_function(goal, models.assembly_again(impact))
        bodies[models.name] |= mapped_leaves(again, models.numbers_of_part(impact))

    contacts = {
        (contact.a, contact.b): numbers_of_contact(impact, i)
        for i, contact in enumerate(impact.scene.contacts)
    }
    bodies = {name: tree for name, tree in bodies.items() if tree}
    return bodies, mapped_leaves(derive, contacts)


def _slope_function(goal: Goal, base: Assembly) -> Callable[[VariableNumber], SlopeWithError]:
    """A function that returns the slope of the goal by a `VariableNumber`."""
    coarse_tol = COARSE_TOL_FACTOR * DIFFERENCE_TOL
    fine = run_for_goal(goal, base, DIFFERENCE_TOL)
    coarse = run_for_goal(goal, base, coarse_tol)

    def derive(number: VariableNumber) -> SlopeWithError:
        for step in RELATIVE_STEPS:
            h = step * number.step_scale
            slope = _difference_quotient(number, h, goal, fine, DIFFERENCE_TOL)
            other = _difference_quotient(number, COARSE_STEP_FACTOR * h, goal, coarse, coarse_tol)
            if slope is not None and other is not None:
                least = MIN_RELATIVE_ERROR * abs(fine.goal) / number.step_scale
                error = abs(slope - other) + least
                if number.extrapolates:  # Richardson
                    slope += (slope - other) / (COARSE_STEP_FACTOR**2 - 1)
                return SlopeWithError(slope, error)

        raise NotDifferentiableError(
            f"a touch appears or vanishes where the number {number.value:g} of the impact changes"
            f" by {RELATIVE_STEPS[-1]:g} of its value: the goal has no derivative; change an "
            "input slightly."
        )

    return derive


def _difference_quotient(
    number: VariableNumber, h: float, goal: Goal, base: GoalValues, tol: float
) -> float | None:
    """Difference quotient of a goal with the step `h`; None where a touch appears or vanishes.

    base : values of the unchanged run; tol : relative error of the forces in all runs.
    """
    refused: InputError | None = None
    for points, weights in DIFFERENCE_SCHEMES:
        for side in (h, -h):
            try:
                posed = [number.assembly_with(number.value + side * k) for k in points]
            except InputError as error:
                refused = refused or error
                continue
            values = [*(run_for_goal(goal, one, tol) for one in posed), base]
            if any(one.touches != base.touches for one in values):
                return None
            return float(np.dot(weights, [one.goal for one in values])) / side

    assert refused is not None
    raise refused


def _derivative_bar(slope: SlopeWithError, *others: SlopeWithError) -> float:
    """Error bar of a derivative, from its differences and from the changed models.

    others : slopes on the models of `_model_changes`; None where a slope does not exist.
    """
    changes = [abs(one.value - slope.value) for one in others if one is not None]
    truncation = TRUNCATION_SAFETY * max(changes[:2], default=0.0)
    return slope.error + truncation + SAFETY * sum(changes[2:])
