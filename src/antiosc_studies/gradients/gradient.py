"""`gradient`: the derivatives of a result by all parameters of an impact."""

from __future__ import annotations

import os
from collections.abc import Callable
from dataclasses import dataclass, fields, replace
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike

from antiosc import ContactLaw
from antiosc.base import checks
from antiosc.base._types import Array
from antiosc.base.errors import InputError
from antiosc.base.texts import Completed, value_text
from antiosc.engine import adjoint, library
from antiosc.plot.charts import figure_or_path, panels
from antiosc_studies.gradients.changes import (
    Taken,
    Values,
    bar,
    by_body,
    by_coupled,
    by_springs,
    changed_model,
    compared_runs,
    leading,
)
from antiosc_studies.gradients.goals import Recorded, Sampled, Seeds
from antiosc_studies.gradients.of_run import (
    by_modes,
    contact_ends,
    derived,
    model_name,
    second_peak,
    settled,
    shown_goal,
)

if TYPE_CHECKING:
    from matplotlib.figure import Figure

#: Relative step of a law's field in differences of its parameters.
CHANGE = 1e-6
#: Attributes of a gradient that hold derivatives.
_PARTS = ("bodies", "contacts")


@dataclass(frozen=True, eq=False, repr=False)
class Gradient(Completed):
    """Derivatives of a result; those of a single body or contact are attributes too.

    Attributes
    ----------
    goal : str
        The result, and its `value`.
    bodies : dict
        Name of a body -> {parameter: derivative}, arrays (N,) for `m` and `omega`.
    contacts : dict
        Ends (a, b) of a contact -> {parameter of its law, or gap: derivative}.
    error : Gradient or None
        The error bars of all these numbers, >= 0; None: not requested, or unknown.
    reach : Gradient or None
        For "peak_force", if there is a second peak (`reach.value`) less than 10 % smaller: under
        the same names, for each parameter the change (signed) at which the second peak becomes the
        largest, to first order and if only this parameter changes. Beyond this change the
        derivative is that of the second peak.

    A derivative has the unit of the goal over that of the parameter; None if it does not exist, as
    by m0 if the site has no mass.
    """

    goal: str
    value: float
    bodies: dict[str, Values]
    contacts: dict[tuple[str, str], Values]
    error: Gradient | None = None
    reach: Gradient | None = None

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
            f"the gradient has no {name}: {reason}; take it from bodies[name] or contacts[a, "
            "b], which"
            f" have {', '.join(parameter_names)}."
        )

    def numbers(self) -> dict[str, object]:
        """The value and its derivatives: name -> JSON value."""
        parts = {
            **self.bodies,
            **{" - ".join(ends): values for ends, values in self.contacts.items()},
        }
        slopes = {
            name: {key: None if v is None else np.asarray(v).tolist() for key, v in values.items()}
            for name, values in parts.items()
        }
        return {**super().numbers(), "derivatives": slopes}

    def plot(self, path: str | os.PathLike[str] | None = None) -> Figure | Path:
        """The derivatives by single numbers as bars; with `path` the picture is written.

        A bar has the unit of the goal over that of its parameter; the scale is logarithmic on both
        sides of zero.
        """
        parts = [*self.contacts.values(), *self.bodies.values()]
        single = [
            (n, v)
            for values_of_part in parts
            for n, v in values_of_part.items()
            if v is not None and not np.ndim(v)
        ]
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
        if self.reach is not None:
            reach_text = (
                f"of {self.reach.value:.6g} becomes the largest at a change of one parameter by"
            )
            facts += [("another peak", reach_text), *self.reach._lines("change")]
        return [*facts, *self._lines("d/d")]

    def _lines(self, label: str) -> list[tuple[str, str]]:
        """The derivatives by parameters of each contact and each body."""
        return [
            (label, ", ".join(f"{n} {value_text(v)}" for n, v in slopes.items() if value_text(v)))
            for slopes in (*self.contacts.values(), *self.bodies.values())
            if slopes
        ]


class GradientNameError(InputError, AttributeError):
    """A gradient has no parameter of this name, or several."""


def gradient(
    hit: Any,
    goal: str | Callable[[Sampled], float],
    *,
    contact: tuple[str, str] | None = None,
    time: float | None = None,
    part: Any = None,
    x: ArrayLike | None = None,
    error: str | None = None,
) -> Gradient:
    """Derivatives of a result by masses, speeds, stiffnesses, gaps and the model's parameters.

    They are the exact derivatives of the run's steps (a discrete adjoint: one backward pass gives
    all of them), through touches, releases and the turning points of laws with memory. They
    converge with `tol` like the result.

    Parameters
    ----------
    hit : History or SceneHistory
        The history of `simulate` or `Scene.run` with method="exact".
    goal : str or callable
        "peak_force" [N], "impulse" [N s], "contact_time" [s], "restitution", "peak_displacement"
        [m] of the first end of the contact (the structure of `simulate`); "force" [N] and
        "displacement" [m] of that end at a `time`. Or a function that returns a number from the
        run's values at its nodes, the arrays `time`, `force`, `displacement`, `velocity`,
        `impactor_displacement` and `impactor_velocity` of a `Sampled`; it is called some 1e4 times.
    contact : (str, str), optional
        Ends of the contact, if a scene has several.
    time : float, optional
        Time [s] of the goals "force" and "displacement".
    part : Structure or callable, optional
        A structure from which the model was extracted: adds `g.E`, `g.nu`, `g.rho`, `g.thickness`
        and derivatives by the other numbers of its material and of a beam's section; for a
        laminate's layers arrays `thickness` and `angle` [1/degree]; for several materials {group:
        derivative}. For a part on supports the Krylov recurrence is repeated with twice as many
        vectors (one more extraction); otherwise the shapes of the model are kept. Or a function of
        `x` (n,) that builds the structure or its model: adds `g.x` (n,), by anything that x
        changes, including nodes, with two extractions for each entry of x. The contact law is kept,
        and so are a structure's site and patch radius.
    x : array_like, shape (n,), optional
        The argument of `part`, if that is a function.
    error : "estimate", optional
        Adds `g.error`, the error bars of all derivatives by the same names and in their units. A
        bar is the sum of the change by finer steps; twice the change by a quarter fewer
        anti-oscillators, or by the residual mass on a spring; and, for a model extracted with
        error="estimate", twice the change by its `corrected()`. It takes three or four more runs,
        and works for runs of `simulate` only.

    Returns
    -------
    Gradient
        `g.mass`, `g.velocity` of the impactor, `g.m0`, `g.k0`, `g.m`, `g.omega` of the model,
        `g.stiffness` and the other parameters of the contact law by their names, `g.gap`.

    Raises
    ------
    InputError
        For a history without its run, an unknown goal, a user-defined law, and a part that the
        model does not come from.
    NotDifferentiableError
        If the result has no derivative: two equal peaks, a grazing contact, or no contact.
    """
    if error is not None:
        checks.choice("error", error, ("estimate",))
    if x is not None and (part is None or not callable(part)):
        raise InputError("x is for a part that is a function of x: give part=, or leave out x.")
    runs = [(hit, lambda run_of: run_of), *(compared_runs(hit) if error is not None else ())]
    derivatives = [derived(run, goal, contact, time) for run, _ in runs]
    second = second_peak(derivatives[0][0], contact) if goal == "peak_force" else None
    if second is not None:
        derivatives = [*derivatives, second]
        runs = [*runs, runs[0]]
    bodies = [_bodies(run_of, *run) for (run_of, _), run in zip(runs, derivatives, strict=True)]
    if part is not None:
        body = model_name(derivatives[0][0])
        models = [model_of_run for _, model_of_run in runs]
        for body_values, values in zip(
            bodies, _part_derivatives(hit, derivatives, models, body, part, x), strict=True
        ):
            body_values[body] = body_values.get(body, {}) | values
    group_values = []
    for (run_of, _), body_values, (record, seeds_of_goal, slopes) in zip(
        runs, bodies, derivatives, strict=True
    ):
        contacts = _contacts(record, settled(record, slopes))
        by_springs(run_of, slopes, body_values, contacts)
        group_values.append(Gradient(shown_goal(goal), seeds_of_goal.value, body_values, contacts))
    reach = None if second is None else overtaken(group_values[0], group_values.pop())
    return replace(
        group_values[0], error=None if error is None else bars(group_values), reach=reach
    )


def overtaken(largest: Gradient, second: Gradient) -> Gradient:
    """The changes of parameters at which the second peak exceeds the largest."""
    margin = largest.value - second.value

    def change(a: Any, b: Any) -> Any:
        if isinstance(a, dict):
            return {name: change(a[name], b[name]) for name in a}
        if a is None or b is None:
            return None
        faster = np.asarray(b) - np.asarray(a)
        ratio = np.divide(margin, faster, out=np.full(faster.shape, np.inf), where=faster != 0)
        if ratio.ndim:
            return ratio
        return float(ratio)

    bodies, contacts = (change(getattr(largest, n), getattr(second, n)) for n in _PARTS)
    return Gradient(second.goal, second.value, bodies, contacts)


def bars(gradients: list[Gradient]) -> Gradient:
    """The error bars of the first gradient; the others are those of `compared_runs`."""
    value, bodies, contacts = (
        bar([getattr(gradient, name) for gradient in gradients]) for name in ("value", *_PARTS)
    )
    return Gradient(gradients[0].goal, value, bodies, contacts)


def _part_derivatives(
    hit: Any, derivatives: list[Taken], models: list[Any], name: str, part: Any, x: Any
) -> list[Values]:
    """Derivatives by the parameters of a part, or by the argument x of a function that builds
    it.
    """
    from antiosc.extension import checked_shapes  # loads dolfinx
    from antiosc_studies.gradients.of_part import (
        SAME_PART,
        SHRUNK,
        Structure,
        by_part,
        by_shape,
        held,
        part_chain,
        recurrence,
    )

    bodies = [record.model(name) for record, _, _ in derivatives]
    if isinstance(part, Structure):
        checked_shapes(part, hit, name, SAME_PART)
        chains = {
            k: None if derivatives[k][0].coupled(name) else part_chain(*derivatives[k], name=name)
            for k, body in enumerate(bodies)
            if body.shapes is not None
        }
        kept_shapes = chains and not any(end and end.motions for end in chains.values())
        nearby_models = recurrence(bodies[0], part) if kept_shapes else None

        def change(which: int, *ends: Structure) -> float:
            chain_of = chains[which]
            body = bodies[which]
            if chain_of is None:
                models_held = [held(body, end) for end in ends]
            elif nearby_models is None:
                return chain_of.change(*ends)
            else:
                models_held = [models[which](end) for end in nearby_models(*ends)]
            share = 1.0 if chain_of is None else SHRUNK
            return changed_model(hit, derivatives[which], name, *models_held) / share

        change_by = {name: partial(change, name) for name in chains}
        of_body = dict(zip(change_by, by_part(list(change_by.values()), part), strict=True))
        return [of_body.get(k, {}) for k in range(len(derivatives))]
    checks.function("part", part, "a Structure, or a function of x that builds one", 1)
    if x is None:
        raise InputError("part is a function of x: give the x at which the run was made.")
    changes = [
        lambda *ends, of_body=of_body, turned=model_of_run: changed_model(
            hit, of_body, name, *map(turned, ends)
        )
        for of_body, model_of_run in zip(derivatives, models, strict=True)
    ]
    return by_shape(part, checks.column("x", x), bodies[0], changes)


def _bodies(hit: Any, record: Recorded, seeds: Seeds, slopes: adjoint.Slopes) -> dict[str, Values]:
    """Derivatives by the parameters of bodies with one site; empty under loads or ground motion."""
    result: dict[str, Values] = {}
    for name, body in record.bodies.items():
        if record.coupled(name):
            closing = _closing(record, name)
            change = partial(changed_model, hit, (record, seeds, slopes), name)
            values = by_coupled(record, slopes, name, closing, change)
            if values:
                result[name] = values
            continue
        mode_derivatives = by_modes(record, seeds, settled(record, slopes), name)
        if mode_derivatives is not None:
            result[name] = by_body(body.body, mode_derivatives, _closing(record, name))
    return result


def _closing(record: Recorded, name: str) -> float:
    """Initial closing speed [m/s] of a body with one site."""
    span = record.spans[name]
    touching = record.G[:, record.columns[name].start] != 0
    rows = record.system.beta[touching][:, span]
    if len(rows):
        return float(rows[0] @ record.system.v[span])
    return 0.0


def _contacts(record: Recorded, slopes: adjoint.Slopes) -> dict[tuple[str, str], Values]:
    """Derivatives by the parameters of each contact."""
    result: dict[tuple[str, str], Values] = {}
    for c, (pair, law) in enumerate(zip(contact_ends(record), record.laws, strict=True)):
        values = _law_derivatives(law, slopes.laws[c])
        values["gap"] = float(slopes.offsets[:, c].sum())
        if record.system.tangents[c, 1] > 0:
            values["friction"] = float(slopes.friction[c, 0])
        result[pair] = values
    return result


def _law_derivatives(law: ContactLaw, by: Array) -> Values:
    """Derivatives by the parameters of a law, by name; a table has none."""
    if law.kernel[0].kind == library.TABLE:  # type: ignore[attr-defined]
        return {}
    names = [parameter.name for parameter in fields(law) if parameter.init]  # type: ignore[arg-type]
    values = {name: float(by @ _by_field(law, name)) for name in names if name != "compliance"}
    return {**values, "compliance": float(by[-1])}


def _by_field(law: ContactLaw, name: str) -> Array:
    """Derivatives of a law's leading parameters by one of its fields."""
    value = getattr(law, name)
    margin = {"restitution": min(value, 1 - value), "exponent": value - 1}.get(name, value)
    # at the end of its range a parameter changes to one side
    change = CHANGE * margin or (-CHANGE if name == "restitution" and value else CHANGE)
    low = value - change if margin > 0 else value
    high = value + change
    ends = [leading(replace(law, **{name: end})) for end in (low, high)]  # type: ignore[type-var]
    return (ends[1] - ends[0]) / (high - low)
