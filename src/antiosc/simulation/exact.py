"""`method="exact"`: an impact of two bodies as the march of one contact."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from itertools import pairwise

import numpy as np

from antiosc.base import march
from antiosc.base._types import Array, Index
from antiosc.simulation.convergence import converge, stopped
from antiosc.simulation.engine import Run
from antiosc.simulation.expected import stiffness_of
from antiosc.simulation.given_step import stepped
from antiosc.simulation.integrators import Contact, Problem, Segment, Trajectory, flight
from antiosc.simulation.scene_states import AT_ONCE, node_states, starts
from antiosc.simulation.system import System

#: Change of a velocity, relative to it, below which it is rounding in part.
ROUNDED = 1e-6


def exact(
    problem: Problem,
    duration: float,
    scale: float,
    step: float | None,
    tol: float,
    max_contacts: int,
    max_steps: int,
) -> tuple[Trajectory, float, dict[str, float]]:
    """The run, its step (the mean one, if none is given), and its estimated errors.

    `scale` is the estimated contact time [s]; there are no errors for a given step.
    """
    system = of_problem(problem)
    error: dict[str, float] = {}
    if step is not None:
        found, failure = stepped(
            system,
            lambda: np.array([stiffness_of(problem)]),
            duration,
            step,
            max_contacts,
            max_steps,
        )
    else:
        best = converge(system, scale, duration, tol, max_contacts, max_steps)
        found, error = best.run, {"force": best.force, "peak": best.peak}
        failure = stopped(found.answer, float(found.time[-1]), max_contacts, max_steps)
    result = trajectory(problem, system, found, duration)
    result.failure = failure
    if step is None:
        pressed = sum(contact.end - contact.start for contact in result.contacts)
        steps = sum(contact.time.size // 2 for contact in result.contacts)
        step = pressed / steps if steps else scale
    return result, step, error


def of_problem(problem: Problem) -> System:
    """One impact as the march takes it."""
    p = problem
    return System(
        omega=p.omega,
        decay=p.decay,
        beta=p.beta[None],
        R=np.array([[p.r]]),
        breaks=np.zeros(1),
        loads=p.load[None],
        offsets=np.array([[p.gap]]),
        laws=(p.law,),
        slip=np.zeros((1, 2)),
        tangents=np.array([[1, 0]], dtype=np.int64),
        q=p.q,
        v=p.v,
        mass=np.array([p.mass]),
        depth=np.array([p.depth]),
        speed=np.array([p.speed]),
        pressed=np.zeros(1),
    )


def trajectory(problem: Problem, system: System, found: Run, duration: float) -> Trajectory:
    """The run as its contacts; flights and contacts as segments once they are asked for."""
    spans, speeds, released = touches(found)
    time, force = found.time, np.maximum(found.force[:, 0], 0.0)
    _, v = starts(found, system, partial(_load, problem), spans.ravel())
    moving = (v @ problem.rigid).reshape(spans.shape).tolist()
    taken = _taken(problem, found, v[:, problem.freest])
    pulses = march.pulses(time, found.force, 0, spans).tolist()
    contacts: list[Contact] = []
    segments, at = 0, 0
    for c, (first, last) in enumerate(spans.tolist()):
        segments += first > at  # the flight before it
        nodes = slice(2 * first, 2 * last + 1)
        area, peak = pulses[c]
        contacts.append(
            Contact(
                start=float(time[2 * first]),
                end=float(time[2 * last]),
                segments=(segments, segments + len(_pieces(problem, first, last))),
                speed=speeds[c],
                released=released[c],
                closing=moving[c][0],
                parting=moving[c][1],
                impulse=taken(c, first, last, area),
                peak=peak,
                time=time[nodes],
                force=force[nodes],
            )
        )
        segments, at = contacts[-1].segments[1], last
    return Trajectory(
        lambda: _segments(problem, system, found, spans, force, duration),
        contacts,
        evaluations=found.attempts,
        diverged=found.answer == march.GREW,
        march=(system, found),
    )


def touches(found: Run) -> tuple[Index, list[float], list[bool]]:
    """First and last step node (C, 2), closing speed, and whether it ended, of each contact."""
    starts = found.time[::2]
    nodes, events = np.searchsorted(starts, found.events[:, 0]).tolist(), found.events.tolist()
    marks = [
        (node, piece != march.APART, speed)
        for node, (_, _, piece, speed) in zip(nodes, events, strict=True)
    ]
    if marks and marks[-1][1]:
        marks.append((starts.size - 1, False, -1.0))
    kept = [
        ((first, last), speed, released >= 0)
        for (first, touch, speed), (last, _, released) in pairwise(marks)
        if touch and last > first  # what a touch that is over at once leaves is no contact
    ]
    spans = np.array([span for span, _, _ in kept], dtype=np.intp).reshape(-1, 2)
    return spans, [speed for _, speed, _ in kept], [released for _, _, released in kept]


def _segments(
    problem: Problem, system: System, found: Run, spans: Index, force: Array, duration: float
) -> list[Segment]:
    """Flights and contacts in their order."""
    at, end = 0, found.time.size // 2
    result: list[Segment] = []
    for first, last in [*spans.tolist(), (end, end)]:
        if first > at or (first == end and not result):
            t, span = float(found.time[2 * at]), float(found.time[2 * first] - found.time[2 * at])
            (q,), (v,) = starts(found, system, partial(_load, problem), np.array([at]))
            result.append(flight(problem, t, q, v, span, duration))
        pieces = _pieces(problem, first, last)
        result += [_pressed(problem, system, found, force, *piece) for piece in pieces]
        at = last
    return result


def _pieces(problem: Problem, first: int, last: int) -> list[tuple[int, int]]:
    """First and last steps of the segments of a contact: their states are found at once."""
    most = max(AT_ONCE // max(problem.omega.size, 1), 1)
    return [(k, min(k + most, last)) for k in range(first, last, most)]


def _load(problem: Problem, t: Array) -> Array:
    return np.broadcast_to(problem.load, (t.size, problem.load.size))


def _pressed(
    problem: Problem, system: System, found: Run, force: Array, first: int, last: int
) -> Segment:
    """A contact, or a part of it, from step `first` to `last`."""
    nodes = slice(2 * first, 2 * last + 1)
    time, raw = found.time[nodes], found.force[nodes, 0]
    step = time[2::2] - time[:-2:2]  # 0 where an event follows another within rounding
    curved = 4 * (raw[:-2:2] - 2 * raw[1:-1:2] + raw[2::2])
    bend = np.divide(curved, step**2, out=np.zeros_like(step), where=step > 0)

    return Segment(
        time=time,
        force=force[nodes],
        indentation=lambda: found.depth[nodes, 0],
        states=lambda: node_states(found, system, partial(_load, problem), first, last),
        bend=np.repeat(bend, 2),
    )


def _taken(problem: Problem, found: Run, ends: Array) -> Callable[[int, int, int, float], float]:
    """What gives the impulse [N s] of contact c, from one step to another, of the integral of the
    parabolas; `ends`: velocities of the freest mode where contacts begin and end.

    It is what a rigid mode has taken up, if there is one: a force that jumps to 0, as a damped one
    may, has two values at a node, and the integral knows one of them.
    """
    j = problem.freest
    along, load, speeds = float(problem.rigid[j]), float(problem.load[j]), ends.tolist()
    if along == 0.0 or problem.decay[j] != 0.0:
        return lambda c, first, last, area: area

    def taken(c: int, first: int, last: int, area: float) -> float:
        before, after = speeds[2 * c], speeds[2 * c + 1]
        given = load * float(found.time[2 * last] - found.time[2 * first])
        change = given - (after - before)
        known = max(abs(before), abs(after), abs(given))
        return change / along if abs(change) > ROUNDED * known else area

    return taken
