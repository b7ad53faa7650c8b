"""The sequence of events, common to all integrators: flight, touch, contact, release, flight ..."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from antiosc._types import Array
from antiosc.contact import State
from antiosc.simulation.integrators.flight import next_touch
from antiosc.simulation.integrators.problem import Integrator, Phase, Problem, Segment

_FLIGHT_NODES = 200


@dataclass(eq=False)
class Contact:
    """One contact: its interval of time [s], its segments' range and the law's state at touch."""

    start: float
    end: float
    segments: tuple[int, int]
    state: State
    released: bool


@dataclass(eq=False)
class Trajectory:
    """The whole run: consecutive segments, contacts, and why it stopped early, if it did.

    `diverged`: it stopped because the energy grew; its results are meaningless.
    """

    segments: list[Segment] = field(default_factory=list)
    contacts: list[Contact] = field(default_factory=list)
    evaluations: int = 0
    failure: str = ""
    diverged: bool = False


def run(
    problem: Problem, integrator: Integrator, duration: float, fine: float, max_contacts: int
) -> Trajectory:
    """Integrate over [0, duration] [s]; touches closer than `fine` [s] count as one."""
    result = Trajectory()
    t, q, v = 0.0, problem.q, problem.v
    state: State | None = None
    origin = 0.0
    while t < duration:
        wait = next_touch(problem, q, v, origin, duration - t, fine)
        span = duration - t if wait is None else wait
        if span > 0.0:
            result.segments.append(_flight(problem, t, q, v, span, duration))
            q, v = problem.free(q, v, span)
            t += span
        if wait is None or t >= duration:
            break
        if len(result.contacts) >= max_contacts:
            result.failure = (
                f"stopped at {t:g} s: more than {max_contacts} contacts (chatter);"
                f" shorten the duration or raise max_contacts"
            )
            break
        state = problem.law.touch(max(float(problem.beta @ v), 0.0), state)
        phase = integrator.contact(problem, t, q, v, state, duration)
        if not phase.segments:  # gave up before its first step
            phase.segments.append(_moment(t, q, v))
        _append(result, t, state, phase)
        t, q, v, state = phase.time, phase.q, phase.v, phase.state
        origin = problem.law.origin(state)
        if phase.failure:
            result.failure, result.diverged = phase.failure, phase.diverged
            break
    return result


def _append(result: Trajectory, t: float, state: State, phase: Phase) -> None:
    first = len(result.segments)
    result.segments.extend(phase.segments)
    span = (first, len(result.segments))
    result.contacts.append(Contact(t, phase.time, span, state, phase.released))
    result.evaluations += phase.evaluations


def _moment(t: float, q: Array, v: Array) -> Segment:
    """One node without force."""
    zero = np.zeros(1)
    return Segment(np.array([t]), zero, lambda: zero, 0.0, lambda: (q[None], v[None]), True)


def _flight(
    problem: Problem, t: float, q: Array, v: Array, span: float, duration: float
) -> Segment:
    times = np.linspace(0.0, span, 2 + int(_FLIGHT_NODES * span / duration))
    zero = np.zeros(times.size)

    def indentation() -> Array:
        return problem.indentation(q, v, times)

    def states() -> tuple[Array, Array]:
        return problem.free(q, v, times)

    return Segment(t + times, zero, indentation, 0.0, states, False)
