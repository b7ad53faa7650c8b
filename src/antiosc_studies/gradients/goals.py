"""Goals of gradients: the result that is read from a run and from runs with a changed number."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np

from antiosc import History, SceneHistory
from antiosc.base import checks
from antiosc.base._types import Array
from antiosc.base.errors import InputError, NotDifferentiableError
from antiosc.engine import library
from antiosc.engine.march import TOUCH_RESOLUTION, solve
from antiosc.impact.assembly import Assembly
from antiosc.impact.states import contact_forces, steps_at

#: Relative error of the forces in a step of the runs that are differenced.
DIFFERENCE_TOL = 1e-9
#: Two peaks that differ by less than this share may change places within a step.
EQUAL_PEAKS = 1e-3
#: Times at which the largest displacement is sought, and the refinements of its time, by 8 each.
DISPLACEMENT_TIME_COUNT, TIME_REFINEMENTS = 1025, 4
CONTACT_GOALS = ("peak_force", "impulse", "contact_time", "restitution")
#: Goals at a given time.
TIMED_GOALS = ("force", "displacement")
GOAL_NAMES = (*CONTACT_GOALS, "peak_displacement", *TIMED_GOALS)


class Goal(NamedTuple):
    """A goal: its name, the end time [s] of runs, and the function that reads it from a run."""

    name: str
    end_time: float
    value_of: Callable[[History], float]


class GoalValues(NamedTuple):
    """The value of the goal in a run, and the number of touches of each contact."""

    goal: float
    touches: tuple[int, ...]


def run_for_goal(goal: Goal, assembly: Assembly, tol: float) -> GoalValues:
    """Run an assembly once, with a relative error `tol` of the forces, and read the goal."""
    hit = _history_of(assembly, goal.end_time, tol)
    events = hit.run.events
    touched = events[events[:, 2] != library.APART, 1].astype(int)
    return GoalValues(goal.value_of(hit), tuple(np.bincount(touched, minlength=1).tolist()))


def _history_of(assembly: Assembly, until: float, tol: float) -> History:
    fine = assembly.contact_time_estimate / TOUCH_RESOLUTION
    options = library.COptions(until, tol, 0.0, 0.0, fine, 10_000, 1_000_000, 1)
    run, solution = solve(assembly.system, options)

    if solution.answer != library.DONE:
        raise NotDifferentiableError(
            f"a run that the gradient needs stopped at {run.time[-1]:g} s: shorten the duration."
        )
    return SceneHistory(assembly, run, {}, 0, "")


def goal_of(
    goal: str | Callable[[Any], float],
    hit: History,
    base: Assembly,
    contact: tuple[str, str] | None,
    time: float | None,
) -> Goal:
    """The goal of this name, or of this function of a history.

    base : assembly (of `hit` or of a changed model) whose run shows when the peak ends; contact,
    time : as for `gradient`.
    """
    until = hit.run.time[-1]
    if callable(goal) and not isinstance(goal, type):
        name = str(getattr(goal, "__name__", "goal"))
        return Goal(name, until, lambda run: checks.number("the goal", goal(run)))

    name = checks.choice("goal", goal, GOAL_NAMES)
    if (name in TIMED_GOALS) != (time is not None):
        raise InputError(
            f"give time= [s] with the goals {' and '.join(TIMED_GOALS)}, and with no other; the"
            f" goal is {name}, time = {checks.shown(time)}."
        )

    c = _contact_number(hit, contact)
    end = hit.assembly.scene.contacts[c].a
    if name in CONTACT_GOALS and not hit.contact_histories[c].contacts:
        raise NotDifferentiableError("the contact did not touch: this goal has no gradient.")

    if name == "peak_force":
        until = _release_after_peak(_history_of(base, until, DIFFERENCE_TOL), c)
    if name in CONTACT_GOALS:
        return Goal(name, until, lambda run: _contact_goal(run, c, name))
    if name == "peak_displacement":
        return Goal(name, until, lambda run: _largest_displacement(run, end))

    t = np.array([checks.number("time", time, "s")])
    if not 0 <= t[0] <= until:
        raise InputError(f"time must lie within the run, 0 <= time <= {until:g} s; got {t[0]:g}.")
    until = min(max(t[0], 1e-3 * until), until)

    def force(run: History) -> float:
        return float(contact_forces(run.run, *steps_at(run.run, t))[0, c])

    def displacement(run: History) -> float:
        return float(_end_displacement(run, end, t)[0])

    return Goal(name, until, force if name == "force" else displacement)


def _contact_number(hit: History, contact: tuple[str, str] | None) -> int:
    """Number of the contact; it may be omitted if there is only one."""
    ends = [one.ends for one in hit.contact_histories]
    if contact is None and len(ends) == 1:
        return 0
    if isinstance(contact, tuple | list) and (pair := (*contact,)) in ends:
        return ends.index(pair)
    contact_names = ", ".join(map(str, ends))
    raise InputError(f"contact must be one of {contact_names}; got {checks.shown(contact)}.")


def _contact_goal(hit: History, c: int, name: str) -> float:
    value = getattr(hit.contact_histories[c], name)
    if value is None:
        raise NotDifferentiableError(
            "this run has no restitution: the bodies are in contact at its end, or did not approach"
            " each other."
        )

    return float(value)


def _release_after_peak(hit: History, c: int) -> float:
    """Time [s] of the release after the largest force; NotDifferentiableError if two are equal."""
    run = hit.run
    steps = np.arange(run.time.size // 2)
    spans = np.stack([steps, steps + 1], axis=1)
    tops = library.pulses(run.time, run.force, c, spans)[:, 1]
    near = np.flatnonzero(tops >= (1 - EQUAL_PEAKS) * tops.max())

    if near[-1] - near[0] >= near.size:
        raise NotDifferentiableError(
            f"two peaks of some {tops.max():.6g} N are equal: their maximum has a gradient on"
            " either side alone; change an input slightly."
        )
    top = run.time[2 * near[0] + 1]
    return next(end for _, end in hit.contact_histories[c].contacts if end > top)


def _end_displacement(hit: History, end: str, t: Array) -> Array:
    """Displacement (n,) [m] of the end of a contact at times."""
    name, _, site = end.partition(":")
    return hit.at(t)[name].displacement(site)


def _largest_displacement(hit: History, end: str) -> float:
    """The largest displacement [m] of the end of a contact by magnitude."""
    t = np.linspace(0.0, hit.run.time[-1], DISPLACEMENT_TIME_COUNT)
    for _ in range(1 + TIME_REFINEMENTS):
        size = np.abs(_end_displacement(hit, end, t))
        best = np.argmax(size)
        near = t[max(best - 1, 0) : best + 2]
        t = np.linspace(near[0], near[-1], 17)
    return float(size[best])
