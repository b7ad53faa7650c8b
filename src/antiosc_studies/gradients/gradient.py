"""`gradient`: the derivatives of a result by everything that an impact is made of."""

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

#: Relative change of a law's field by which its parameters are derived.
CHANGE = 1e-6
#: What a gradient has derivatives by.
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
        The bars of all these numbers, >= 0; None: not asked for, or not known.
    reach : Gradient or None
        Of "peak_force" with a second peak that is less than 10 % smaller, `reach.value`: by the
        same names the change of each parameter alone, with its sign, at which the second peak
        becomes the largest, to first order. Beyond it the derivative is that of the second peak.
        None: there is no such peak.

    A derivative has the unit of the goal over that of the parameter. None: there is none, as by m0
    where the site has no mass.
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
        holders = [each for each in parts if name in each]
        if len(holders) == 1:
            return holders[0][name]
        known = sorted({n for each in parts for n in each})
        why = "several bodies or contacts have it" if holders else "there is no such parameter"
        raise GradientNameError(
            f"the gradient has no {name}: {why}; take it from bodies[name] or contacts[a, b], which"
            f" have {', '.join(known)}."
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

        Each bar is in the unit of the goal over that of its parameter, on a scale that is
        logarithmic on both sides of zero.
        """
        parts = [*self.contacts.values(), *self.bodies.values()]
        single = [
            (n, v) for own in parts for n, v in own.items() if v is not None and not np.ndim(v)
        ]
        if not single:
            raise InputError("the gradient has no derivative by a single number to be drawn.")
        figure, ((axes,),) = panels(1, 1, (6.4, 1.2 + 0.3 * len(single)), shown=path is None)
        values = np.array([v for _, v in single], dtype=float)
        axes.barh(range(len(single)), values, tick_label=[n for n, _ in single])
        least = np.abs(values[values != 0]).min(initial=np.inf)
        axes.set_xscale("symlog", linthresh=least if least < np.inf else 1.0)
        axes.set_xlabel(f"derivative of {self.goal.replace('_', ' ')} (SI units)")
        return figure_or_path(figure, path)

    def _facts(self) -> list[tuple[str, str]]:
        facts = [(self.goal, f"{self.value:.6g}")]
        if self.reach is not None:
            near = f"of {self.reach.value:.6g} becomes the largest at a change of one parameter by"
            facts += [("another peak", near), *self.reach._lines("change")]
        return [*facts, *self._lines("d/d")]

    def _lines(self, label: str) -> list[tuple[str, str]]:
        """The derivatives by parameters of each contact and each body."""
        return [
            (label, ", ".join(f"{n} {value_text(v)}" for n, v in each.items() if value_text(v)))
            for each in (*self.contacts.values(), *self.bodies.values())
            if each
        ]


class GradientNameError(InputError, AttributeError):
    """A gradient has no such parameter, or several of this name."""


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

    They are those of the steps that the run took (a discrete adjoint: one pass back over the run
    gives all of them), through touches, releases and the turning points of laws with memory. They
    converge with `tol` as the result does.

    Parameters
    ----------
    hit : History or SceneHistory
        Of `simulate` or `Scene.run` with method="exact".
    goal : str or callable
        "peak_force" [N], "impulse" [N s], "contact_time" [s], "restitution", "peak_displacement"
        [m] of the first end of the contact (the structure of `simulate`); "force" [N] and
        "displacement" [m] of that end at a `time`. Or a function of what the run has at its nodes,
        arrays `time`, `force`, `displacement`, `velocity`, `impactor_displacement` and
        `impactor_velocity` (`Sampled`), that returns a number: it is called some 1e4 times.
    contact : (str, str), optional
        Ends of the contact, where a scene has several.
    time : float, optional
        [s], of the goals "force" and "displacement".
    part : Structure or callable, optional
        From which the model was extracted: `g.E`, `g.nu`, `g.rho`, `g.thickness` and the other
        numbers of its material and of a beam's section; of a laminate's layers arrays `thickness`
        and `angle` [1/degree]. Of several materials they are {group: derivative}. The Krylov
        recurrence of a part on supports runs again in twice as many vectors, which one further
        extraction finds; otherwise the shapes of the model are held. Or a function of `x` (n,)
        that builds the structure, or its model: `g.x` (n,), by whatever x changes, nodes included,
        with two extractions for each of its entries. The law of the contact stays, and of a
        structure the place of the site and the radius of its patch.
    x : array_like, shape (n,), optional
        Where `part` is a function.
    error : "estimate", optional
        `g.error` has the bars of all derivatives by the same names, in their units: what changes
        with finer steps; twice what changes with a quarter of the anti-oscillators less, or with
        the residual mass on a spring; and, of a model extracted with error="estimate", twice what
        changes with its `corrected()`. Three or four more runs, of `simulate` alone.

    Returns
    -------
    Gradient
        `g.mass`, `g.velocity` of the impactor, `g.m0`, `g.k0`, `g.m`, `g.omega` of the model,
        `g.stiffness` and the other parameters of the contact law by their names, `g.gap`.

    Raises
    ------
    InputError
        For a history without its run, an unknown goal, laws made elsewhere, and a part that is not
        that of the model.
    NotDifferentiableError
        Where the result has no derivative: two equal peaks, a contact that grazes, or none.
    """
    if error is not None:
        checks.choice("error", error, ("estimate",))
    if x is not None and (part is None or not callable(part)):
        raise InputError("x is for a part that is a function of x: give part=, or leave out x.")
    runs = [(hit, lambda one: one), *(compared_runs(hit) if error is not None else ())]
    taken = [derived(each, goal, contact, time) for each, _ in runs]
    second = second_peak(taken[0][0], contact) if goal == "peak_force" else None
    if second is not None:
        taken = [*taken, second]
        runs = [*runs, runs[0]]
    bodies = [_bodies(one, *each) for (one, _), each in zip(runs, taken, strict=True)]
    if part is not None:
        body = model_name(taken[0][0])
        models = [turned for _, turned in runs]
        for own, values in zip(bodies, _of_part(hit, taken, models, body, part, x), strict=True):
            own[body] = own.get(body, {}) | values
    all_of = []
    for (one, _), own, (found, wanted, slopes) in zip(runs, bodies, taken, strict=True):
        contacts = _contacts(found, settled(found, slopes))
        by_springs(one, slopes, own, contacts)
        all_of.append(Gradient(shown_goal(goal), wanted.value, own, contacts))
    reach = None if second is None else overtaken(all_of[0], all_of.pop())
    return replace(all_of[0], error=None if error is None else bars(all_of), reach=reach)


def overtaken(largest: Gradient, second: Gradient) -> Gradient:
    """The changes of parameters at which the second peak exceeds the largest."""
    lead = largest.value - second.value

    def change(a: Any, b: Any) -> Any:
        if isinstance(a, dict):
            return {name: change(a[name], b[name]) for name in a}
        if a is None or b is None:
            return None
        faster = np.asarray(b) - np.asarray(a)
        ratio = np.divide(lead, faster, out=np.full(faster.shape, np.inf), where=faster != 0)
        if ratio.ndim:
            return ratio
        return float(ratio)

    bodies, contacts = (change(getattr(largest, n), getattr(second, n)) for n in _PARTS)
    return Gradient(second.goal, second.value, bodies, contacts)


def bars(found: list[Gradient]) -> Gradient:
    """The error bars of the first derivatives; the others are those of `compared_runs`."""
    value, bodies, contacts = (
        bar([getattr(each, name) for each in found]) for name in ("value", *_PARTS)
    )
    return Gradient(found[0].goal, value, bodies, contacts)


def _of_part(
    hit: Any, taken: list[Taken], models: list[Any], name: str, part: Any, x: Any
) -> list[Values]:
    """Derivatives by the parameters of a part, or by arguments x of a function that builds it."""
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

    bodies = [found.model(name) for found, _, _ in taken]
    if isinstance(part, Structure):
        checked_shapes(part, hit, name, SAME_PART)
        chains = {
            k: None if taken[k][0].coupled(name) else part_chain(*taken[k], name=name)
            for k, body in enumerate(bodies)
            if body.shapes is not None
        }
        still = chains and not any(each and each.motions for each in chains.values())
        near = recurrence(bodies[0], part) if still else None

        def change(which: int, *ends: Structure) -> float:
            one = chains[which]
            body = bodies[which]
            if one is None:
                made = [held(body, each) for each in ends]
            elif near is None:
                return one.change(*ends)
            else:
                made = [models[which](each) for each in near(*ends)]
            share = 1.0 if one is None else SHRUNK
            return changed_model(hit, taken[which], name, *made) / share

        to = {which: partial(change, which) for which in chains}
        own = dict(zip(to, by_part(list(to.values()), part), strict=True))
        return [own.get(which, {}) for which in range(len(taken))]
    checks.function("part", part, "a Structure, or a function of x that builds one", 1)
    if x is None:
        raise InputError("part is a function of x: give the x at which the run was made.")
    changes = [
        lambda *ends, own=own, turned=turned: changed_model(hit, own, name, *map(turned, ends))
        for own, turned in zip(taken, models, strict=True)
    ]
    return by_shape(part, checks.column("x", x), bodies[0], changes)


def _bodies(hit: Any, found: Recorded, wanted: Seeds, slopes: adjoint.Slopes) -> dict[str, Values]:
    """Derivatives by the parameters of bodies of one site; none if loads or ground motion act."""
    result: dict[str, Values] = {}
    for name, body in found.bodies.items():
        if found.coupled(name):
            closing = _closing(found, name)
            change = partial(changed_model, hit, (found, wanted, slopes), name)
            own = by_coupled(found, slopes, name, closing, change)
            if own:
                result[name] = own
            continue
        by = by_modes(found, wanted, settled(found, slopes), name)
        if by is not None:
            result[name] = by_body(body.body, by, _closing(found, name))
    return result


def _closing(found: Recorded, name: str) -> float:
    """Closing speed [m/s] of a body of one site at the start."""
    span = found.spans[name]
    touching = found.G[:, found.columns[name].start] != 0
    rows = found.system.beta[touching][:, span]
    if len(rows):
        return float(rows[0] @ found.system.v[span])
    return 0.0


def _contacts(found: Recorded, slopes: adjoint.Slopes) -> dict[tuple[str, str], Values]:
    result: dict[tuple[str, str], Values] = {}
    for c, (pair, law) in enumerate(zip(contact_ends(found), found.laws, strict=True)):
        values = _by_law(law, slopes.laws[c])
        values["gap"] = float(slopes.offsets[:, c].sum())
        if found.system.tangents[c, 1] > 0:
            values["friction"] = float(slopes.friction[c, 0])
        result[pair] = values
    return result


def _by_law(law: ContactLaw, by: Array) -> Values:
    """Derivatives by the parameters of a law, by name; a table has none."""
    if law.kernel[0].kind == library.TABLE:  # type: ignore[attr-defined]
        return {}
    names = [each.name for each in fields(law) if each.init]  # type: ignore[arg-type]
    values = {name: float(by @ _by_field(law, name)) for name in names if name != "compliance"}
    return {**values, "compliance": float(by[-1])}


def _by_field(law: ContactLaw, name: str) -> Array:
    """Derivatives of a law's leading parameters by one of its fields."""
    value = getattr(law, name)
    room = {"restitution": min(value, 1 - value), "exponent": value - 1}.get(name, value)
    # at the end of its range a parameter changes to one side
    change = CHANGE * room or (-CHANGE if name == "restitution" and value else CHANGE)
    low = value - change if room > 0 else value
    high = value + change
    ends = [leading(replace(law, **{name: end})) for end in (low, high)]  # type: ignore[type-var]
    return (ends[1] - ends[0]) / (high - low)
