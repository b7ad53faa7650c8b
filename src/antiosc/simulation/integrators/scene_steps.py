"""Newmark's method, the conserving midpoint rule and leapfrog on scenes, with a fixed step.

They know no events: a contact touches and parts somewhere within a step, so that what is said of
its time and closing speed is interpolated. Order 2 for forces without jumps.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Sequence
from typing import ClassVar, NamedTuple

import numpy as np

from antiosc.base import march
from antiosc.base._types import Array
from antiosc.base.errors import InputError
from antiosc.contact import ContactLaw
from antiosc.simulation.engine import Run
from antiosc.simulation.integrators.conserving import Quotient
from antiosc.simulation.integrators.joint_contacts import JointContacts
from antiosc.simulation.system import System

#: times the energy that was there or given, beyond which a run counts as unstable
BLOW_UP = 10.0
#: rounding of a difference quotient of potentials, relative to the force
QUOTIENT = 1e-9


class Step(NamedTuple):
    """The end of a step; `mean` (m,) are the forces that made its impulse."""

    q: Array
    v: Array
    force: Array
    delta: Array
    rate: Array
    mean: Array


class Acting(NamedTuple):
    """Modal loads (J,) and gaps (m,) at the start and the end of a step."""

    load: Array
    load1: Array
    gap1: Array


class SceneStep(ABC):
    """A one-step method on a system of several contacts; subclasses give one step."""

    name: ClassVar[str]
    order: ClassVar[int] = 2

    def __init__(self, system: System, laws: Sequence[ContactLaw]) -> None:
        self.system, self.laws = system, laws
        self.square = system.omega**2
        self.contacts = JointContacts(system, laws)

    @abstractmethod
    def advance(self, start: Step, acting: Acting, h: float) -> Step:
        """One step of length h."""

    @staticmethod
    def longest(system: System) -> float:
        """The longest step [s] that is stable."""
        return np.inf

    def run(self, duration: float, step: float, max_contacts: int, max_steps: int) -> Run:
        """All of the scene in steps of `step` [s], as the march writes it down."""
        system, contacts = self.system, self.contacts
        count = max(1, int(np.ceil(duration / step - 1e-9)))
        times = np.linspace(0.0, duration, count + 1)
        loads, gaps = (
            np.array([np.interp(times, system.breaks, row) for row in values.T]).T.reshape(
                times.size, -1
            )
            for values in (system.loads, system.offsets)
        )
        delta = system.beta @ system.q - gaps[0] - system.R @ self._pressed()
        node = Step(
            system.q, system.v, self._pressed(), delta, system.beta @ system.v, self._pressed()
        )
        for c in np.flatnonzero(contacts.closed):
            contacts.anchor[contacts.tangents(c)] = delta[contacts.tangents(c)]
        nodes, answer = [node], march.DONE
        start = system.given + march.mechanical(np.stack((node.q, node.v)), system.omega)
        work, highest = 0.0, start
        for i in range(count):
            if i >= max_steps:
                answer = march.TOO_MANY_STEPS
                break
            if contacts.touches > max_contacts:
                answer = march.TOO_MANY_CONTACTS
                break
            h = times[i + 1] - times[i]
            with np.errstate(over="ignore", invalid="ignore"):
                new = self._step(node, Acting(loads[i], loads[i + 1], gaps[i + 1]), times[i], h)
                work += float(0.5 * (loads[i] + loads[i + 1]) @ (new.q - node.q))
                energy = march.mechanical(np.stack((new.q, new.v)), system.omega)
            kick = 0.5 * float(np.sum((h * loads[i + 1]) ** 2))  # at rest, all that was given
            highest = max(highest, start + work + kick)
            if not energy <= BLOW_UP * highest:
                answer = march.GREW
                break
            node = new
            nodes.append(node)
        return _written(times[: len(nodes)], nodes, contacts, answer, highest)

    def slide(self, start: Step, end: Step) -> None:
        """Remember how far friction slid in a step."""
        self.contacts.slide(end.delta, end.force)

    def _pressed(self) -> Array:
        force = np.zeros(len(self.system.beta))
        force[: len(self.laws)] = self.system.pressed
        return force

    def _step(self, node: Step, acting: Acting, t: float, h: float) -> Step:
        """One step; what touches in it is found first, without its own force."""
        contacts = self.contacts
        new = self.advance(node, acting, h)
        touching = [
            c
            for c in range(len(self.laws))
            if not contacts.closed[c] and new.delta[c] > contacts.origin(c)
        ]
        for c in touching:
            part = _crossed(node.delta[c], new.delta[c], contacts.origin(c))
            speed = node.rate[c] + part * (new.rate[c] - node.rate[c])
            way = node.delta + part * (new.delta - node.delta)
            contacts.touch(c, t + part * h, float(speed), way)
        if touching:
            new = self.advance(node, acting, h)
        self.slide(node, new)
        contacts.advance(new.delta, new.rate)
        for c in range(len(self.laws)):
            if contacts.closed[c] and new.force[c] == 0.0 and new.delta[c] <= contacts.origin(c):
                part = _crossed(node.delta[c], new.delta[c], contacts.origin(c))
                contacts.part(c, t + part * h)
        return new


def _crossed(before: float, after: float, origin: float) -> float:
    """The part of a step after which a straight line from one value to the other is at `origin`."""
    if before == after:
        return 0.0
    return min(max((before - origin) / (before - after), 0.0), 1.0)


class NewmarkScene(SceneStep):
    """Average acceleration: all forces at the end of the step are found implicitly."""

    name = "newmark"

    def advance(self, start: Step, acting: Acting, h: float) -> Step:
        s, x, d = self.system, self.square, self.system.decay
        q, v, F = start.q, start.v, start.force
        scale = 1 + h * d + h * h * x / 4
        a = acting.load - F @ s.beta - x * q - 2 * d * v
        v1 = (v + h / 2 * (a + acting.load1 - x * (q + h / 2 * v))) / scale
        q1 = q + h / 2 * (v + v1)
        pull = h / 2 * s.beta / scale  # how unit forces at the end slow the modes
        gain = pull @ s.beta.T
        A, A_rate = s.R + h / 2 * gain, gain + s.R / h
        free, rate = s.beta @ q1 - acting.gap1, s.beta @ v1 + s.R @ F / h
        F1 = self.contacts.forces(free, A, rate, A_rate, F)
        return Step(
            q1 - h / 2 * F1 @ pull,
            v1 - F1 @ pull,
            F1,
            free - A @ F1,
            rate - A_rate @ F1,
            (F + F1) / 2,
        )


class LeapfrogScene(SceneStep):
    """Central differences, explicit but for what has no mass."""

    name = "leapfrog"
    #: share of the limit h omega_max = 2
    SAFETY: ClassVar[float] = 0.9

    @staticmethod
    def longest(system: System) -> float:
        top = float(system.omega.max(initial=0.0))
        return LeapfrogScene.SAFETY * 2 / top if top > 0 else np.inf

    def advance(self, start: Step, acting: Acting, h: float) -> Step:
        s, x, d = self.system, self.square, self.system.decay
        q, v, F = start.q, start.v, start.force
        half = v + h / 2 * (acting.load - F @ s.beta - x * q - 2 * d * v)
        q1 = q + h * half
        scale = 1 + h * d
        v1 = (half + h / 2 * (acting.load1 - x * q1)) / scale
        pull = h / 2 * s.beta / scale
        A_rate = pull @ s.beta.T + s.R / h
        free, rate = s.beta @ q1 - acting.gap1, s.beta @ v1 + s.R @ F / h
        F1 = self.contacts.forces(free, s.R, rate, A_rate, F)
        return Step(q1, v1 - F1 @ pull, F1, free - s.R @ F1, rate - A_rate @ F1, (F + F1) / 2)


class ConservingScene(SceneStep):
    """Midpoint rule with the difference quotient of each contact's potential."""

    name = "conserving"

    def __init__(self, system: System, laws: Sequence[ContactLaw]) -> None:
        super().__init__(system, laws)
        p = len(laws)
        R = system.R
        if np.any(R - np.diag(R.diagonal())) or np.any(R[p:, p:]):
            raise InputError(
                "method='conserving' does not support a residual compliance that couples contacts,"
                " whose potential is no sum over them; use method='exact' or 'newmark'."
            )
        if any(law.rate_dependent and R[c, c] > 0 for c, law in enumerate(laws)):
            raise InputError(
                "method='conserving' does not support a rate-dependent law at a massless contact"
                " point (m0 = 0), which has no potential; use method='exact'."
            )

    def advance(self, start: Step, acting: Acting, h: float) -> Step:
        s, x, d = self.system, self.square, self.system.decay
        q, v = start.q, start.v
        stiff = h * d + h * h * x / 4
        load = (acting.load + acting.load1) / 2
        v1 = (v * (1 - stiff) + h * (load - x * q)) / (1 + stiff)
        q1 = q + h / 2 * (v + v1)
        pull = h * s.beta / (1 + stiff)
        A = h / 2 * pull @ s.beta.T
        before = start.delta + s.R @ start.force
        free = s.beta @ q1 - acting.gap1
        mean = self._means(before, free, A, start.mean, h)
        q1, v1 = q1 - h / 2 * mean @ pull, v1 - mean @ pull
        after = free - A @ mean
        force = self._nodal(after, s.beta @ v1, mean)
        return Step(q1, v1, force, after - s.R @ force, (after - before) / h, mean)

    def _means(self, before: Array, free: Array, A: Array, guess: Array, h: float) -> Array:
        """Mean forces (m,) over the step, by sweeps over the contacts."""
        contacts = self.contacts
        F = np.zeros_like(guess)
        active = np.flatnonzero(contacts.closed)
        quotients = {}
        for c in active:
            state = contacts.states[c]
            assert state is not None
            F[c] = max(guess[c], 0.0)
            quotients[c] = Quotient(
                self.laws[c], float(self.system.R[c, c]), state, float(before[c]), h
            )

        def sweep(c: int) -> None:
            rest = float(free[c] - A[c] @ F + A[c, c] * F[c])
            F[c] = quotients[c].solve(rest, float(A[c, c]))
            self._rub(c, before, free, A, F)

        return contacts.settled(sweep, F, QUOTIENT)

    def _rub(self, c: int, before: Array, free: Array, A: Array, F: Array) -> None:
        """Mean friction of a contact: the spring at the middle of the step, within the cone."""
        rows = self.contacts.tangents(c)
        if rows.start == rows.stop:
            return
        stiffness = self.system.slip[c, 1]
        for i in range(rows.start, rows.stop):
            middle = (before[i] + free[i] - A[i] @ F + A[i, i] * F[i]) / 2
            held = A[i, i] / 2
            F[i] = stiffness * (middle - self.contacts.anchor[i]) / (1.0 + stiffness * held)
        F[rows] = self.contacts.within_cone(c, F[rows], F[c])

    def slide(self, start: Step, end: Step) -> None:
        self.contacts.slide((start.delta + end.delta) / 2, end.mean)

    def _nodal(self, after: Array, rate: Array, mean: Array) -> Array:
        """Forces (m,) at the end of the step, by the laws."""
        force = np.zeros_like(mean)
        for c in np.flatnonzero(self.contacts.closed):
            state = self.contacts.states[c]
            assert state is not None
            r = float(self.system.R[c, c])
            force[c] = self.laws[c].implicit(float(after[c]), r, float(rate[c]), 0.0, state)
            rows = self.contacts.tangents(c)
            force[rows] = self.contacts.within_cone(c, mean[rows], force[c])
        return force


def _written(
    times: Array, nodes: list[Step], contacts: JointContacts, answer: int, highest: float
) -> Run:
    """A run as the march writes it: between two nodes a parabola with the impulse of the step."""
    n, m = len(nodes) - 1, len(contacts.system.beta)
    time, force, depth = np.empty(2 * n + 1), np.empty((2 * n + 1, m)), np.empty((2 * n + 1, m))
    time[::2], force[::2] = times, [node.force for node in nodes]
    depth[::2] = [node.delta for node in nodes]
    if n:
        time[1::2] = (times[:-1] + times[1:]) / 2
        mean = np.array([node.mean for node in nodes[1:]])
        force[1::2] = (6 * mean - force[:-1:2] - force[2::2]) / 4
        depth[1::2] = (depth[:-1:2] + depth[2::2]) / 2
    return Run(
        time=time,
        force=force,
        depth=depth,
        states=np.array([(node.q, node.v) for node in nodes]),
        events=np.array(contacts.events, dtype=float).reshape(-1, 4),
        answer=answer,
        steps=n,
        attempts=n,
        touches=contacts.touches,
        highest=highest,
    )


#: the methods by name
SCENE_STEPS: dict[str, type[SceneStep]] = {
    each.name: each for each in (NewmarkScene, ConservingScene, LeapfrogScene)
}
