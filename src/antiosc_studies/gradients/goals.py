"""Goals of gradients: their values, and their derivatives by the recorded steps of a run."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field, fields
from typing import Any

import numpy as np
from numpy.typing import NDArray

from antiosc import AntiOscillators, History
from antiosc.base import checks
from antiosc.base._types import Array
from antiosc.base.errors import InputError, NotDifferentiableError
from antiosc.engine import library
from antiosc.engine.march import Run
from antiosc.impact.assembly import Assembly
from antiosc.impact.states import (
    forces,
    integrated_starts,
    locate,
    main_contact_time,
    starts,
    states,
)

TINY = float(np.finfo(float).tiny)
EXACT = 'a History that simulate or Scene.run returned with method="exact"'
#: Two peaks that differ by less than this share are equal: their maximum has no gradient.
EQUAL = 1e-9
#: A second peak within this share of the largest limits the range of the largest's gradient.
NEAR = 0.1
#: Number of times, besides the step ends, at which the largest displacement is sought.
TIMES = 1024
#: Step of a sample in the differences of a goal function, over the largest of its array.
SAMPLE_CHANGE = 1e-6
#: Refinements of the time of the largest displacement; each divides the interval by 16.
REFINED = 6


@dataclass(eq=False)
class Recorded(Assembly):
    """The bodies and contacts of a run together with its recorded steps."""

    run: Run

    @property
    def edges(self) -> Array:
        """Times (n + 1,) [s] of the ends of steps."""
        return self.run.time[::2]

    @property
    def places(self) -> dict[str, slice]:
        """Name of a body -> slice of its modes among the integrated modes."""
        first = self.system.first
        if first is None:
            return self.spans
        return dict(zip(self.bodies, first.spans, strict=True))

    @property
    def driven(self) -> bool:
        """Whether time-dependent loads or ground motion act."""
        return bool(self.scene.loads) or self.scene.base is not None

    def model(self, name: str) -> AntiOscillators:
        """The extracted model of this body."""
        body = self.bodies[name].body
        assert isinstance(body, AntiOscillators)
        return body

    def coupled(self, name: str) -> bool:
        """Whether damping couples the modes of this body."""
        first = self.system.first
        return first is not None and first.parts[list(self.bodies).index(name)][2] is not None

    def states(self) -> Array:
        """States (n + 1, 2, I) of the integrated modes at the ends of steps."""
        if self.run.every == 1 and self.run.states is not None:
            return self.run.states
        steps = np.arange(self.edges.size)
        return np.stack(integrated_starts(self.run, self.system, steps), axis=1)

    def velocities(self) -> Array:
        """Velocities (n + 1, J) of the free modes at the ends of steps."""
        return starts(self.run, self.system, np.arange(self.edges.size))[1]


def recorded(hit: object) -> Recorded:
    """The recorded run of a history; InputError if it lacks data that gradients need."""
    run = hit.run if isinstance(hit, History) else None
    if not isinstance(hit, History) or run is None or run.exits is None or run.states is None:
        raise InputError(f"hit must be {EXACT}; got {checks.shown(hit)}.")
    a = hit.assembly
    if a.stretched:
        raise InputError(
            f"{next(iter(a.stretched))!r} stretched in this impact: gradients are of linear bodies;"
            " extract it with stretch=False."
        )
    attributes = {item.name: getattr(a, item.name) for item in fields(a)}
    return Recorded(**attributes | {"parts": lambda: (a.scene, a.bodies)}, run=run)


@dataclass(eq=False)
class Seeds:
    """A goal's value and its derivatives, with which the backward run starts.

    Attributes
    ----------
    value : the goal.
    force, time : its derivatives by the forces at the nodes, and by the times of step ends.
    B, r : its derivatives by the sites' mode shapes and compliances, at a fixed motion.
    readings : values of the motion that the goal contains, each with (step, position in the step,
        whether that position is fixed), weights (2 J + m,) of q, v and the forces, and derivatives
        (3, P) by displacement, velocity and rigid-body velocity of the columns.
    """

    value: float
    force: Array
    time: Array
    B: Array
    r: Array
    readings: list[tuple[tuple[int, float, int], Array, Array]] = field(default_factory=list)

    def arrays(self, width: int) -> tuple[NDArray[np.void], Array]:
        """The readings as arrays for the C library, ordered by step."""
        ordered = sorted(self.readings, key=lambda reading: reading[0][0])
        places = np.array([place for place, _, _ in ordered], dtype=library.READING)
        weights = [weight for _, weight, _ in ordered]
        return places, np.reshape(weights, (len(ordered), width)).astype(float)


def seeds(
    record: Recorded, goal: str | Callable[[Sampled], float], contact: int, time: float | None
) -> Seeds:
    """Value and derivatives of a goal, given by name or as a function of a run."""
    if not callable(goal) or isinstance(goal, type):
        checks.choice("goal", goal, (*GOALS, *TIMED))
    if (goal in TIMED) != (time is not None):
        raise InputError(
            f"give time= [s] with the goals {' and '.join(TIMED)}, and with no other; the goal is"
            f" {checks.shown(goal)}, time = {checks.shown(time)}."
        )
    result = _empty_seeds(record)
    if time is None:
        if callable(goal):
            _goal_function(record, contact, result, goal)
        else:
            GOALS[goal](record, contact, result)
        return result
    end = float(record.run.time[-1])
    instant = checks.number("time", time, "s")
    if not 0 <= instant <= end:
        raise InputError(
            f"time must lie within the run, 0 <= time <= {end:g} s; got {instant:g} s."
        )
    step, time_in_step = locate(record.run, np.array([instant]))
    TIMED[str(goal)](record, contact, result, int(step[0]), float(time_in_step[0]))
    return result


def _empty_seeds(record: Recorded) -> Seeds:
    """Seeds with all derivatives zero."""
    return Seeds(
        value=0.0,
        force=np.zeros(record.run.force.shape),
        time=np.zeros(record.edges.size),
        B=np.zeros(record.B.shape),
        r=np.zeros(record.r.shape),
    )


def _read_force(
    record: Recorded, c: int, goal_seeds: Seeds, step: int, time_in_step: float
) -> None:
    """Fill `goal_seeds` for the goal "force": the contact force at a time."""
    goal_seeds.value = float(forces(record.run, np.array([step]), np.array([time_in_step]))[0, c])
    u = time_in_step / float(record.edges[step + 1] - record.edges[step])
    _add_force_reading(record, c, goal_seeds, step, u, stays=False)


def _add_force_reading(
    record: Recorded, c: int, goal_seeds: Seeds, step: int, u: float, stays: bool
) -> None:
    """Record a reading of a contact's force at position u (0 to 1) in a step."""
    weight = np.zeros(2 * record.system.omega.size + len(record.system.beta))
    weight[2 * record.system.omega.size + c] = 1.0
    goal_seeds.readings.append(((step, u, int(stays)), weight, np.zeros((3, len(goal_seeds.r)))))


def _peak_force(record: Recorded, c: int, goal_seeds: Seeds) -> None:
    """Fill `goal_seeds` for the goal "peak_force"."""
    tops = _tops(record, c)
    if not tops.max(initial=0.0) > 0:
        raise NotDifferentiableError("the contact did not touch: its peak force has no gradient.")
    k = int(np.argmax(tops))
    if len(_other_peaks(tops, k, EQUAL)):
        raise NotDifferentiableError(
            f"two peaks of {tops[k]:.6g} N are equal: their maximum has a gradient on either side"
            f" alone; change an input slightly."
        )
    _add_peak_reading(record, c, goal_seeds, k, float(tops[k]))


def next_peak(record: Recorded, contact: int) -> Seeds | None:
    """The second largest peak of a contact as a goal; None if it is not near the largest."""
    tops = _tops(record, contact)
    other_peaks = _other_peaks(tops, int(np.argmax(tops)), NEAR)
    if not len(other_peaks):
        return None
    k = int(other_peaks[np.argmax(tops[other_peaks])])
    goal_seeds = _empty_seeds(record)
    _add_peak_reading(record, contact, goal_seeds, k, float(tops[k]))
    return goal_seeds


def _tops(record: Recorded, c: int) -> Array:
    """Largest force of a contact in each step."""
    run = record.run
    steps = np.arange(run.time.size // 2)
    return library.pulses(run.time, run.force, c, np.stack([steps, steps + 1], axis=1))[:, 1]


def _other_peaks(tops: Array, k: int, near: float) -> NDArray[np.intp]:
    """Steps of other peaks that are smaller than that in step k by at most the share `near`."""
    large = np.flatnonzero(tops >= (1 - near) * tops[k])
    return large[(np.abs(large - k) > 1) & _is_local_peak(tops, large)]


def _add_peak_reading(record: Recorded, c: int, goal_seeds: Seeds, k: int, value: float) -> None:
    """Record a reading of the largest force of a contact in step k."""
    f0, f1, f2 = record.run.force[2 * k : 2 * k + 3, c].tolist()
    a = f1 - f0
    b = f2 - f1
    u = (3 * a - b) / (4 * (a - b)) if 3 * a > b and 3 * b < a else float(f2 > f0)
    goal_seeds.value = value
    _add_force_reading(record, c, goal_seeds, k, u, stays=True)


def _is_local_peak(tops: Array, steps: NDArray[np.intp]) -> NDArray[np.bool_]:
    """Mask of steps whose largest value is not below those of both neighbours."""
    previous_tops = tops[np.maximum(steps - 1, 0)]
    next_tops = tops[np.minimum(steps + 1, tops.size - 1)]
    return np.asarray((tops[steps] >= previous_tops) & (tops[steps] >= next_tops))


def _impulse(record: Recorded, c: int, goal_seeds: Seeds) -> None:
    """Fill `goal_seeds` for the goal "impulse"."""
    f = record.run.force[:, c]
    h = np.diff(record.edges)
    means = (f[:-2:2] + 4 * f[1::2] + f[2::2]) / 6
    goal_seeds.value = float(h @ means)
    goal_seeds.force[:-2:2, c] += h / 6
    goal_seeds.force[1::2, c] += 4 * h / 6
    goal_seeds.force[2::2, c] += h / 6
    goal_seeds.time[1:] += means
    goal_seeds.time[:-1] -= means


def _touches(record: Recorded, c: int) -> tuple[list[tuple[int, int]], bool]:
    """(first, last) step ends of a contact's touches, and whether it has parted at the end."""
    assert record.run.exits is not None
    spans: list[tuple[int, int]] = []
    touch_step = 0 if record.system.pressed[c] > 0 else None  # closed at the start
    parted = touch_step is None
    for row in record.run.exits:
        step = int(row[0])
        contact = int(row[1])
        state_before = int(row[5])
        state_after = int(row[9])
        if contact != c:
            continue
        if state_before == library.APART:
            touch_step = step
            parted = False
        elif state_after == library.APART and touch_step is not None:
            if step > touch_step:
                spans.append((touch_step, step))
            touch_step = None
            parted = True
    if touch_step is not None:
        spans.append((touch_step, record.edges.size - 1))
    if not spans:
        raise NotDifferentiableError("the contact did not touch: this goal has no gradient.")
    return spans, parted


def _contact_time(record: Recorded, c: int, goal_seeds: Seeds) -> None:
    """Fill `goal_seeds` for the goal "contact_time"."""
    spans, _ = _touches(record, c)
    f = record.run.force[:, c]
    edges = record.edges
    h = np.diff(record.edges)
    area = np.append(0.0, np.cumsum(h * (f[:-2:2] + 4 * f[1::2] + f[2::2]) / 6))
    goal_seeds.value = main_contact_time(
        (float(edges[a]), float(edges[b]), float(area[b] - area[a])) for a, b in spans
    )
    first, last = min(
        ((a, b) for a, _ in spans for _, b in spans if b > a),
        key=lambda pair: abs(edges[pair[1]] - edges[pair[0]] - goal_seeds.value),
    )
    goal_seeds.time[last] += 1.0
    goal_seeds.time[first] -= 1.0


def _restitution(record: Recorded, c: int, goal_seeds: Seeds) -> None:
    """Fill `goal_seeds` for the goal "restitution"."""
    spans, parted = _touches(record, c)
    s = record.system
    rigid = np.where(s.omega == 0, s.beta[c], 0.0)
    states_at = record.velocities()
    first = spans[0][0]
    last = spans[-1][1]
    closing = float(rigid @ states_at[first])
    parting = float(rigid @ states_at[last])
    if not parted or not closing > 0:
        raise NotDifferentiableError(
            "this run has no restitution: the bodies are in contact at its end, or did not approach"
            " each other."
        )
    goal_seeds.value = -parting / closing
    n = record.edges.size - 1
    for edge, weight_of in ((first, parting / closing**2), (last, -1 / closing)):
        weight = np.zeros(2 * s.omega.size + len(s.beta))
        weight[s.omega.size : 2 * s.omega.size] = weight_of * rigid
        place = (edge, 0.0, 1) if edge < n else (n - 1, 1.0, 1)
        goal_seeds.readings.append((place, weight, weight_of * np.outer(np.eye(3)[2], record.G[c])))
        rigid_motion = np.where(s.omega == 0, weight_of * states_at[edge], 0.0)
        goal_seeds.B += np.outer(rigid_motion, record.G[c])


def _side(record: Recorded, c: int, end: int = 0) -> Array:
    """Weights (P,) of the columns for the displacement of an end along the force on the first
    end.
    """
    contact = record.scene.contacts[c]
    columns = record.columns[(contact.b if end else contact.a).partition(":")[0]]
    weights = np.zeros(record.G.shape[1])
    weights[columns] = (1 if end else -1) * record.G[c, columns]
    return weights


def _read_displacement(
    record: Recorded, c: int, goal_seeds: Seeds, step: int, time_in_step: float
) -> None:
    """Fill `goal_seeds` for the goal "displacement": that of the first end at a time."""
    s = record.system
    columns = _side(record, c)
    place = np.array([step]), np.array([time_in_step])
    q, _ = states(record.run, s, *place)
    site_forces = -(forces(record.run, *place)[0] @ record.G)
    u = time_in_step / float(record.edges[step + 1] - record.edges[step])
    goal_seeds.value = float(q[0] @ record.B @ columns + site_forces @ record.r @ columns)
    weight = np.concatenate(
        (record.B @ columns, np.zeros(s.omega.size), -(record.G @ record.r @ columns))
    )
    goal_seeds.readings.append(((step, u, 0), weight, np.outer(np.eye(3)[0], columns)))
    goal_seeds.B += np.outer(q[0], columns)
    goal_seeds.r += np.outer(site_forces, columns)


def _peak_displacement(record: Recorded, c: int, goal_seeds: Seeds) -> None:
    """Fill `goal_seeds` for the goal "peak_displacement"."""
    edges = record.edges
    columns = _side(record, c)
    t = np.union1d(edges, np.linspace(0.0, edges[-1], TIMES))
    for _ in range(REFINED):
        step, time_in_step = locate(record.run, t)
        q, _ = states(record.run, record.system, step, time_in_step)
        site_forces = -(forces(record.run, step, time_in_step) @ record.G)
        best = int(np.argmax(np.abs(q @ (record.B @ columns) + site_forces @ (record.r @ columns))))
        peak_place = int(step[best]), float(time_in_step[best])
        t = np.linspace(t[max(best - 1, 0)], t[min(best + 1, t.size - 1)], 33)
    _read_displacement(record, c, goal_seeds, *peak_place)
    if goal_seeds.value < 0:
        goal_seeds.value = -goal_seeds.value
        goal_seeds.B = -goal_seeds.B
        goal_seeds.r = -goal_seeds.r
        goal_seeds.readings = [
            (place, -weight, -columns) for place, weight, columns in goal_seeds.readings
        ]


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


def _goal_function(
    record: Recorded, c: int, goal_seeds: Seeds, goal: Callable[[Sampled], float]
) -> None:
    """Fill `goal_seeds` for a goal function, by finite differences of its samples."""
    s = record.system
    run = record.run
    J = record.system.omega.size
    n = record.edges.size - 1
    step = np.minimum(np.arange(2 * n + 1) // 2, n - 1)
    u = 0.5 * (np.arange(2 * n + 1) - 2 * step)
    time_in_step = u * np.diff(record.edges)[step]
    q, v = states(run, s, step, time_in_step)
    site_forces = -(forces(run, step, time_in_step) @ record.G)
    first = _side(record, c)
    second = _side(record, c, 1)
    arrays: dict[str, Array] = {"force": forces(run, step, time_in_step)[:, c]}
    for name, body in (("", first), ("impactor_", second)):
        arrays[f"{name}displacement"] = np.asarray(
            q @ (record.B @ body) + site_forces @ (record.r @ body)
        )
        arrays[f"{name}velocity"] = np.asarray(v @ (record.B @ body))
    goal_seeds.value = _number(goal, run.time, arrays)
    weights = np.zeros((2 * n + 1, 2 * J + len(s.beta)))
    sites = np.zeros((2 * n + 1, 3, record.G.shape[1]))
    for name in arrays:
        slope = _slopes(goal, run.time, arrays, name)
        if name == "force":
            weights[:, 2 * J + c] += slope
            continue
        body = second if name.startswith("impactor") else first
        if name.endswith("velocity"):
            weights[:, J : 2 * J] += np.outer(slope, record.B @ body)
            sites[:, 1] += np.outer(slope, body)
            goal_seeds.B += np.outer(slope @ v, body)
        else:
            weights[:, :J] += np.outer(slope, record.B @ body)
            sites[:, 0] += np.outer(slope, body)
            weights[:, 2 * J :] -= np.outer(slope, record.G @ record.r @ body)
            goal_seeds.B += np.outer(slope @ q, body)
            goal_seeds.r += np.outer(slope @ site_forces, body)
    assert run.exits is not None
    # where a contact changes, a sample's slopes before and after differ: it counts for both sides
    zero_forces = np.zeros(2 * n + 1)
    h = np.diff(record.edges)
    branch_steps = np.unique(run.exits[:, 0].astype(int))
    branch_steps = branch_steps[(branch_steps > 0) & (branch_steps < n)]
    zero_forces[2 * branch_steps] = h[branch_steps - 1] / np.maximum(
        h[branch_steps - 1] + h[branch_steps], TINY
    )
    for k in np.flatnonzero(weights.any(axis=1)).tolist():
        for place, share in (
            ((int(step[k]), float(u[k]), 0), 1 - zero_forces[k]),
            ((int(step[k]) - 1, 1.0, 0), zero_forces[k]),
        ):
            if share:
                goal_seeds.readings.append((place, share * weights[k], share * sites[k]))


def _number(goal: Callable[[Sampled], float], time: Array, arrays: dict[str, Array]) -> float:
    """The value of a goal function."""
    run = Sampled(time=time, **arrays)
    try:
        value = goal(run)
    except (TypeError, AttributeError) as error:
        raise InputError(
            f"the goal must be a function of a run that has time, {', '.join(arrays)}: {error}."
        ) from error
    return checks.number("the goal", value)


def _slopes(
    goal: Callable[[Sampled], float], time: Array, arrays: dict[str, Array], name: str
) -> Array:
    """Central differences (n,) of a goal by the samples of one array; 0 if it does not use it."""
    value = arrays[name]
    h = SAMPLE_CHANGE * float(np.abs(value).max(initial=0.0))
    slopes = np.zeros(value.size)
    if h == 0.0 or not _reads(goal, time, arrays, name):
        return slopes
    for k in range(value.size):
        ends = []
        for end in (value[k] - h, value[k] + h):
            shifted = value.copy()
            shifted[k] = end
            ends.append(_number(goal, time, {**arrays, name: shifted}))
        slopes[k] = (ends[1] - ends[0]) / (2 * h)
    return slopes


def _reads(
    goal: Callable[[Sampled], float], time: Array, arrays: dict[str, Array], name: str
) -> bool:
    """Whether the goal function uses the array `name`."""
    used: set[str] = set()

    class Watched(Sampled):
        def __getattribute__(self, asked: str) -> Any:
            used.add(asked)
            return super().__getattribute__(asked)

    goal(Watched(time=time, **arrays))
    return name in used or "__dict__" in used


GOALS: dict[str, Callable[[Recorded, int, Seeds], None]] = {
    "peak_force": _peak_force,
    "impulse": _impulse,
    "contact_time": _contact_time,
    "restitution": _restitution,
    "peak_displacement": _peak_displacement,
}
#: Goals at a given time.
TIMED = {"force": _read_force, "displacement": _read_displacement}
