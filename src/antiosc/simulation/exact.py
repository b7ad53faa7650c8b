"""`method="exact"`: an impact of two bodies as the march of one contact."""

from __future__ import annotations

from collections.abc import Callable
from itertools import pairwise

import numpy as np

from antiosc._types import Array
from antiosc.simulation import march
from antiosc.simulation.contact_energy import simpson
from antiosc.simulation.convergence import converge, stopped
from antiosc.simulation.engine import Run, System, run
from antiosc.simulation.expected import stiffness_of
from antiosc.simulation.integrators import Contact, Problem, Segment, Trajectory, flight
from antiosc.simulation.laws import forget, packed
from antiosc.simulation.scene_states import node_states
from antiosc.simulation.stability import clear_step, margin

#: the share of a run with a given step: what it does not resolve is integrated with halvings of it
LOOSE = 0.05

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
    try:
        if step is not None:
            found = run(
                system,
                duration,
                LOOSE,
                step=step,
                fine=step / 4,
                max_contacts=max_contacts,
                max_steps=max_steps,
            )
        else:
            best = converge(system, (problem.law,), scale, duration, tol, max_contacts, max_steps)
            found, error = best.run, {"force": best.force, "peak": best.peak}
    finally:
        forget(int(system.kinds[0]), system.params[0])
    result = trajectory(problem, system, found, duration)
    t = float(found.time[-1])
    result.failure = stopped(found.answer, t, max_contacts, max_steps)
    if step is not None and (result.diverged or (found.refused and not result.failure)):
        _tell_unstable(problem, result, step, t)
    if step is None:
        spans = [last - first for first, last, _, _ in touches(found)]
        pressed = sum(contact.end - contact.start for contact in result.contacts)
        step = pressed / sum(spans) if spans else scale
    return result, step, error


def _tell_unstable(problem: Problem, result: Trajectory, step: float, t: float) -> None:
    """The failure of a run whose given step lies in a window of instability."""
    modes = problem.omega, problem.beta[None], np.array([[problem.r]])
    stiffness = np.array([stiffness_of(problem)])
    if not result.diverged and margin(*modes, stiffness, step) == np.inf:
        return  # the halvings resolve it
    clear = clear_step(*modes, stiffness, step)
    remedy = f"step={clear:.6g}" if clear < step else "a smaller step"
    result.failure = (
        f"exact gained energy by {t:g} s: at a step of {step:g} s the contact excites the modes"
        f" (unstable step); use {remedy} or no step, so that it is chosen automatically"
    )
    result.diverged = True


def of_problem(problem: Problem) -> System:
    """One impact as the march takes it."""
    p = problem
    kind, parameters = packed(p.law)
    return System(
        omega=p.omega,
        decay=p.decay,
        beta=p.beta[None],
        R=np.array([[p.r]]),
        breaks=np.zeros(1),
        loads=p.load[None],
        offsets=np.array([[p.gap]]),
        kinds=np.array([kind], dtype=np.int64),
        params=parameters[None],
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
    """The run as flights and contacts."""
    result = Trajectory(evaluations=found.attempts, diverged=found.answer == march.GREW)
    assert found.states is not None

    def load_at(t: Array) -> Array:
        return np.broadcast_to(problem.load, (t.size, problem.load.size))

    at = 0
    for first, last, speed, released in touches(found):
        if first > at:
            _fly(result, problem, found, at, first, duration)
        begin = len(result.segments)
        result.segments.append(_pressed(problem, system, found, load_at, first, last))
        start, end = float(found.time[2 * first]), float(found.time[2 * last])
        result.contacts.append(
            Contact(
                start=start,
                end=end,
                segments=(begin, begin + 1),
                speed=speed,
                released=released,
                closing=float(problem.rigid @ found.states[first, 1]),
                parting=float(problem.rigid @ found.states[last, 1]),
            )
        )
        at = last
    if len(found.states) - 1 > at or not result.segments:
        _fly(result, problem, found, at, len(found.states) - 1, duration)
    return result


def touches(found: Run) -> list[tuple[int, int, float, bool]]:
    """First and last step node, closing speed, and whether it ended, of each contact of a run."""
    starts = found.time[::2]
    nodes, events = np.searchsorted(starts, found.events[:, 0]).tolist(), found.events.tolist()
    marks = [
        (node, piece != march.APART, speed)
        for node, (_, _, piece, speed) in zip(nodes, events, strict=True)
    ]
    if marks and marks[-1][1]:
        marks.append((starts.size - 1, False, -1.0))
    return [
        (first, last, speed, released >= 0)
        for (first, touch, speed), (last, _, released) in pairwise(marks)
        if touch and last > first  # what a touch that is over at once leaves is no contact
    ]


def _fly(
    result: Trajectory, problem: Problem, found: Run, first: int, last: int, duration: float
) -> None:
    assert found.states is not None
    t, span = float(found.time[2 * first]), float(found.time[2 * last] - found.time[2 * first])
    q, v = found.states[first]
    result.segments.append(flight(problem, t, q, v, span, duration))


def _pressed(
    problem: Problem,
    system: System,
    found: Run,
    load_at: Callable[[Array], Array],
    first: int,
    last: int,
) -> Segment:
    nodes = slice(2 * first, 2 * last + 1)
    time, force = found.time[nodes], found.force[nodes, 0]
    bend = 4 * (force[:-2:2] - 2 * force[1:-1:2] + force[2::2]) / (time[2::2] - time[:-2:2]) ** 2

    return Segment(
        time=time,
        force=np.maximum(force, 0.0),
        indentation=lambda: found.depth[nodes, 0],
        impulse=_impulse(problem, found, first, last),
        states=lambda: node_states(found, system, load_at, first, last),
        contact=True,
        bend=np.repeat(bend, 2),
    )


def _impulse(problem: Problem, found: Run, first: int, last: int) -> float:
    """Impulse [N s] from step `first` to `last`: what a rigid mode has taken up, if there is one.

    A force that jumps to 0, as a damped one may, has two values at a node; the integral of the
    parabolas knows one of them.
    """
    assert found.states is not None
    nodes = slice(2 * first, 2 * last + 1)
    time = found.time[nodes]
    area = float(np.sum(simpson(time, found.force[nodes, 0])))
    beta = np.where(problem.decay == 0, problem.rigid, 0.0)
    if not beta.any():
        return area
    j = int(np.argmax(np.abs(beta)))
    start, end = found.states[[first, last], 1, j].tolist()
    given = float(problem.load[j]) * float(time[-1] - time[0])
    taken = given - (end - start)
    known = max(abs(start), abs(end), abs(given))
    return taken / float(beta[j]) if abs(taken) > ROUNDED * known else area
