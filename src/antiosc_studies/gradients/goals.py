"""Goals of gradients: the number that is read of a run, and of the run with a number changed."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np

from antiosc import History
from antiosc.base import checks
from antiosc.base._types import Array
from antiosc.base.errors import InputError, NotDifferentiableError
from antiosc.engine import library
from antiosc.engine.march import FINE, Run, solve
from antiosc.impact.assembly import Assembly
from antiosc.impact.states import forces, locate, states

#: Relative error of the forces in a step of the runs that are differenced.
TOL = 1e-9
#: Two peaks that differ by less than this share are equal: their maximum has no gradient.
EQUAL = 1e-9
#: A second peak within this share of the largest limits the range of the largest's gradient.
NEAR = 0.1
#: Times at which the largest displacement is sought, and the refinements of its time, by 8 each.
TIMES, REFINED = 1024, 6
OF_CONTACT = ("impulse", "contact_time", "restitution")
#: Goals at a given time.
TIMED = ("force", "displacement")
GOALS = ("peak_force", *OF_CONTACT, "peak_displacement", *TIMED)


@dataclass(eq=False)
class Sampled:
    """The argument of a goal function: a contact at the nodes of a run, arrays (n,).

    Attributes
    ----------
    time : times [s]; force : contact force [N].
    displacement, velocity : motion of the first end along the contact [m], [m/s]; for `simulate`
        that is the site of the structure. The velocity is without the residual compliance.
    impactor_displacement, impactor_velocity : the same of the second end.
    """

    time: Array
    force: Array
    displacement: Array
    velocity: Array
    impactor_displacement: Array
    impactor_velocity: Array


class Goal(NamedTuple):
    """A goal: its name, its value in the given run, how long other runs go on, how it is read.

    read : function of an assembly and its run that returns (k,): the goal, and a second peak.
    """

    name: str
    value: float
    until: float
    read: Callable[[Assembly, Run], Array]


class Values(NamedTuple):
    """What was read of a run, and the number of touches of each contact in it."""

    goal: Array
    touches: tuple[int, ...]


def values_of(goal: Goal, assembly: Assembly, tol: float) -> Values:
    """Run an assembly once and read the goal of it."""
    run = _run(assembly, goal.until, tol)
    touched = run.events[run.events[:, 2] != library.APART, 1].astype(int)
    return Values(goal.read(assembly, run), tuple(np.bincount(touched, minlength=1).tolist()))


def _run(assembly: Assembly, until: float, tol: float = TOL) -> Run:
    fine = assembly.contact_time_estimate / FINE
    options = library.COptions(until, tol, 0.0, 0.0, fine, 10_000, 1_000_000, 1)
    run, solution = solve(assembly.system, options)

    if solution.answer != library.DONE:
        raise NotDifferentiableError(
            f"a run that the gradient needs stopped at {run.time[-1]:g} s: shorten the duration."
        )
    return run


def goal_of(
    goal: str | Callable[[Sampled], float],
    hit: History,
    base: Assembly,
    contact: tuple[str, str] | None,
    time: float | None,
) -> Goal:
    """The goal that is asked for; `base`: the given run's assembly, or another that is compared."""
    if not callable(goal) or isinstance(goal, type):
        checks.choice("goal", goal, GOALS)
    if (goal in TIMED) != (time is not None):
        raise InputError(
            f"give time= [s] with the goals {' and '.join(TIMED)}, and with no other; the goal is"
            f" {checks.shown(goal)}, time = {checks.shown(time)}."
        )
    c = _contact_number(hit, contact)
    history = hit.contact_histories[c]
    until = float(hit.run.time[-1])
    name = str(getattr(goal, "__name__", "goal")) if callable(goal) else goal
    if name in ("peak_force", *OF_CONTACT) and not history.contacts:
        raise NotDifferentiableError("the contact did not touch: this goal has no gradient.")

    if goal == "peak_force":
        return _peaks(history.peak_force, c, _run(base, until))
    if time is not None:
        t = checks.number("time", time, "s")
        if not 0 <= t <= until:
            raise InputError(f"time must lie within the run, 0 <= time <= {until:g} s; got {t:g}.")
        until = min(max(t, 1e-3 * until), until)

    def read(assembly: Assembly, run: Run) -> Array:
        if callable(goal):
            return np.array([_of_samples(goal, assembly, run, c)])
        if goal == "peak_displacement":
            return _largest_displacement(assembly, run, c)
        if time is None:
            return np.array([_of_contact(goal, assembly, run, c)])
        at = locate(run, np.array([time]))
        return forces(run, *at)[:, c] if goal == "force" else _motion(assembly, run, c, 0, *at)[0]

    return Goal(name, float(read(hit.assembly, hit.run)[0]), until, read)


def _contact_number(hit: History, contact: tuple[str, str] | None) -> int:
    """Number of the contact; it may be omitted if there is only one."""
    ends = [(contact.a, contact.b) for contact in hit.assembly.scene.contacts]
    if contact is None and len(ends) == 1:
        return 0
    for i, pair in enumerate(ends):
        if isinstance(contact, tuple | list) and [*pair] == [str(end) for end in contact]:
            return i
    contact_names = ", ".join(map(str, ends))
    raise InputError(f"contact must be one of {contact_names}; got {checks.shown(contact)}.")


def _of_contact(goal: str, assembly: Assembly, run: Run, c: int) -> float:
    value = getattr(History(assembly, run, {}, 0, "").contact_histories[c], goal)
    if value is None:
        raise NotDifferentiableError(
            "this run has no restitution: the bodies are in contact at its end, or did not approach"
            " each other."
        )
    return float(value)


def _of_samples(goal: Callable[[Sampled], float], assembly: Assembly, run: Run, c: int) -> float:
    at = locate(run, run.time)
    first, second = (_motion(assembly, run, c, end, *at) for end in (0, 1))
    try:
        value = goal(Sampled(run.time, run.force[:, c], *first, *second))
    except (TypeError, AttributeError) as error:
        raise InputError(
            "the goal must be a function of a run that has time, force, displacement, velocity,"
            f" impactor_displacement and impactor_velocity: {error}."
        ) from error
    return checks.number("the goal", value)


def _motion(
    assembly: Assembly, run: Run, c: int, end: int, step: Any, since: Array
) -> tuple[Array, Array]:
    """Displacement and velocity (n,) of an end of a contact, along the force on it or against."""
    contact = assembly.scene.contacts[c]
    columns = assembly.columns[(contact.b if end else contact.a).partition(":")[0]]
    side = np.zeros(assembly.G.shape[1])
    side[columns] = (1 if end else -1) * assembly.G[c, columns]

    q, v = states(run, assembly.system, step, since)
    site_forces = -(forces(run, step, since) @ assembly.G)
    return q @ assembly.B @ side + site_forces @ (assembly.r @ side), v @ assembly.B @ side


def _largest_displacement(assembly: Assembly, run: Run, c: int) -> Array:
    """(1,) the largest displacement of the first end by magnitude."""
    t = np.union1d(run.time[::2], np.linspace(0.0, run.time[-1], TIMES))
    for _ in range(1 + REFINED):
        size = np.abs(_motion(assembly, run, c, 0, *locate(run, t))[0])
        best = int(np.argmax(size))
        t = np.linspace(t[max(best - 1, 0)], t[min(best + 1, t.size - 1)], 17)
    return size[best : best + 1]


def _peaks(value: float, c: int, run: Run) -> Goal:
    """The largest force, and the second peak if it is near, each between the minima beside it."""
    tops = _tops(run, c)
    k = int(np.argmax(tops))
    before, after = np.append(0.0, tops[:-1]), np.append(tops[1:], 0.0)
    near = np.flatnonzero((tops >= before) & (tops >= after) & (tops >= (1 - NEAR) * tops[k]))
    others = near[np.abs(near - k) > 1]
    second = others[np.argsort(-tops[others])][:1].tolist()

    if second and tops[second[0]] >= (1 - EQUAL) * tops[k]:
        raise NotDifferentiableError(
            f"two peaks of {tops[k]:.6g} N are equal: their maximum has a gradient on either side"
            " alone; change an input slightly."
        )
    windows = [_window(run, tops, i) for i in (k, *second)]

    def read(_: Assembly, other: Run) -> Array:
        middle, largest = other.time[1::2], _tops(other, c)
        inside = [largest[(middle > a) & (middle < b)] for a, b in windows]
        return np.array([part.max(initial=0.0) for part in inside])

    return Goal("peak_force", value, max(b for _, b in windows), read)


def _tops(run: Run, c: int) -> Array:
    """Largest force of a contact in each step."""
    steps = np.arange(run.time.size // 2)
    return library.pulses(run.time, run.force, c, np.stack([steps, steps + 1], axis=1))[:, 1]


def _window(run: Run, tops: Array, k: int) -> tuple[float, float]:
    """Times [s] of the minima, or of touch and release, on either side of the peak in step k."""
    first = last = k
    while first > 0 and 0 < tops[first - 1] <= tops[first]:
        first -= 1
    while last < tops.size - 1 and 0 < tops[last + 1] <= tops[last]:
        last += 1
    return float(run.time[2 * first]), float(run.time[2 * last + 2])
