"""The sequence of events, common to all integrators: flight, touch, contact, release, flight ..."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any

import numpy as np

from antiosc.base._types import Array
from antiosc.contact import State
from antiosc.simulation.integrators.problem import Integrator, Problem, Segment
from antiosc.simulation.integrators.touch import next_touch
from antiosc.simulation.main_impact import contact_time

_FLIGHT_NODES = 200


@dataclass(eq=False)
class Contact:
    """One contact.

    Attributes
    ----------
    start, end : [s].
    segments : first of its segments, and the one behind its last.
    speed : closing speed [m/s].
    released : whether it ended.
    closing, parting : speeds [m/s] at which the rigid-body motions close the gap at start and end.
    impulse, peak : time integral [N s] of the force as the integrator took it, and the largest
        force [N], also between the nodes.
    time, force : (n,) at the nodes [s], [N].
    """

    start: float
    end: float
    segments: tuple[int, int]
    speed: float
    released: bool
    closing: float
    parting: float
    impulse: float
    peak: float
    time: Array
    force: Array


@dataclass(eq=False)
class Trajectory:
    """The whole run: contacts, consecutive segments, and why it stopped early, if it did.

    `pieces` makes the segments when they are first asked for. `diverged`: it stopped because the
    energy grew; its results are meaningless.
    """

    pieces: Callable[[], list[Segment]]
    contacts: list[Contact] = field(default_factory=list)
    evaluations: int = 0
    failure: str = ""
    diverged: bool = False
    #: the System and Run of the exact method
    march: Any = None

    @cached_property
    def segments(self) -> list[Segment]:
        """Flights and contacts in their order."""
        return self.pieces()

    @property
    def peak_force(self) -> float:
        """Largest contact force [N]."""
        return max((contact.peak for contact in self.contacts), default=0.0)

    @cached_property
    def nodes(self) -> tuple[Array, Array, Array]:
        """Times [s], forces [N], and the second derivative of the force behind each node."""
        return (
            np.concatenate([s.time for s in self.segments]),
            np.concatenate([s.force for s in self.segments]),
            np.concatenate([np.append(s.bends, 0.0) for s in self.segments]),
        )

    def force_at(self, t: Array) -> Array:
        """Contact force [N] at times (n,)."""
        time, force, bend = self.nodes
        i = np.clip(np.searchsorted(time, t, side="right") - 1, 0, time.size - 1)
        end = time[np.minimum(i + 1, time.size - 1)]
        return np.asarray(np.interp(t, time, force) - 0.5 * bend[i] * (t - time[i]) * (end - t))

    @property
    def impulse(self) -> float:
        """Time integral of the contact force [N s]."""
        return float(sum(contact.impulse for contact in self.contacts))

    @property
    def contact_time(self) -> float:
        """Length [s] of the main impact: see `History.contact_time`."""
        return contact_time((c.start, c.end, c.impulse) for c in self.contacts)

    @property
    def restitution(self) -> float | None:
        """Newton's coefficient: see `History.restitution`."""
        if not self.contacts or not self.contacts[-1].released or self.contacts[0].closing <= 0:
            return None
        return -self.contacts[-1].parting / self.contacts[0].closing


def run(
    problem: Problem, integrator: Integrator, duration: float, fine: float, max_contacts: int
) -> Trajectory:
    """Integrate over [0, duration] [s]; touches closer than `fine` [s] count as one."""
    segments: list[Segment] = []
    result = Trajectory(lambda: segments)
    t, q, v = 0.0, problem.q, problem.v
    state: State | None = None
    origin = 0.0
    while t < duration:
        wait = next_touch(problem, q, v, origin, duration - t, fine)
        span = duration - t if wait is None else wait
        if span > 0.0:
            segments.append(flight(problem, t, q, v, span, duration))
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
        speed = max(float(problem.beta @ v), 0.0)
        state = problem.law.touch(speed, state)
        closing = float(problem.rigid @ v)
        phase = integrator.contact(problem, t, q, v, state, duration)
        if not phase.segments:  # gave up before its first step
            phase.segments.append(_moment(t, q, v))
        first = len(segments)
        segments.extend(phase.segments)
        result.contacts.append(
            Contact(
                start=t,
                end=phase.time,
                segments=(first, len(segments)),
                speed=speed,
                released=phase.released,
                closing=closing,
                parting=float(problem.rigid @ phase.v),
                impulse=phase.impulse,
                peak=max(s.peak for s in phase.segments),
                time=np.concatenate([s.time for s in phase.segments]),
                force=np.concatenate([s.force for s in phase.segments]),
            )
        )
        result.evaluations += phase.evaluations
        t, q, v, state = phase.time, phase.q, phase.v, phase.state
        origin = problem.law.origin(state)
        if phase.failure:
            result.failure, result.diverged = phase.failure, phase.diverged
            break
    return result


def _moment(t: float, q: Array, v: Array) -> Segment:
    """One node without force."""
    zero = np.zeros(1)
    return Segment(np.array([t]), zero, lambda: zero, lambda: (q[None], v[None]))


def flight(problem: Problem, t: float, q: Array, v: Array, span: float, duration: float) -> Segment:
    """Free motion over `span` [s] from the state (q, v) at t, with nodes for a plot."""
    times = np.linspace(0.0, span, 2 + int(_FLIGHT_NODES * span / duration))
    zero = np.zeros(times.size)

    def indentation() -> Array:
        return states()[0] @ problem.beta - problem.gap

    def states() -> tuple[Array, Array]:
        return problem.free(q, v, times)

    return Segment(t + times, zero, indentation, states)
