"""What the methods that the march is compared with share: contacts, flights, what they write.

They share no code with the march but its flights, which are exact: it finds the next touch. A
method integrates from there until all contacts have parted, and all of a scene with loads or a
moving ground, which are part of the comparison. Forces of several contacts are found by their laws'
own methods, swept by Gauss and Seidel's method.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from antiosc.base import march
from antiosc.base._types import Array
from antiosc.base.errors import NotConvergedError
from antiosc.contact import ContactLaw, Linear, State
from antiosc.simulation.march.engine import Run, run
from antiosc.simulation.march.system import System
from antiosc.simulation.problem.scene_states import starts

MOST_SWEEPS = 500
SETTLED = 1e-13  # change of a force in a sweep, relative to the largest


class JointContacts:
    """The contacts of a scene, and what they remember of the time before.

    Attributes
    ----------
    closed : whether each contact touches.
    states : of the laws; None before the first touch.
    anchor : (m,) where the springs of friction hang [m]; only tangential rows have one.
    events : [time, contact, 0 parts or 1 touches, closing speed] of all touches and partings.
    """

    def __init__(self, system: System, laws: Sequence[ContactLaw]) -> None:
        self.system, self.laws = system, laws
        self.closed = system.closed.tolist()
        self._tangents = [slice(i, i + count) for i, count in system.tangents.tolist()]
        kept = system.kept or [None] * len(laws)
        self.states: list[State | None] = [
            state if closed or one is not None else None
            for one, state, closed in zip(kept, system.begun(), self.closed, strict=True)
        ]
        self.anchor = np.zeros(len(system.beta))
        self.events: list[tuple[float, int, int, float]] = []

    @property
    def touches(self) -> int:
        """How often a contact has closed."""
        return sum(piece for _, _, piece, _ in self.events)

    @property
    def active(self) -> list[int]:
        """The closed contacts."""
        return [c for c, closed in enumerate(self.closed) if closed]

    def tangents(self, c: int) -> slice:
        """The tangential rows of a contact."""
        return self._tangents[c]

    def origin(self, c: int) -> float:
        """Indentation [m] at which a contact touches and parts."""
        state = self.states[c]
        return 0.0 if state is None else self.laws[c].origin(state)

    def touch(self, c: int, t: float, speed: float, way: Array) -> None:
        """The contact touches at the closing `speed`; `way` (m,) are the displacements there."""
        speed = max(speed, float(self.system.slowest[c]))
        self.states[c] = self.laws[c].touch(speed, self.states[c])
        self.closed[c] = True
        self.anchor[self.tangents(c)] = way[self.tangents(c)]
        self.events.append((t, c, 1, speed))

    def part(self, c: int, t: float) -> None:
        self.closed[c] = False
        self.events.append((t, c, 0, 0.0))

    def advance(self, delta: Array, rate: Array) -> None:
        """Remember the end of a step: indentations and their rates (m,)."""
        for c, law in enumerate(self.laws):
            state = self.states[c]
            if self.closed[c] and state is not None:
                self.states[c] = law.advance(float(delta[c]), float(rate[c]), state)

    def slide(self, way: Array, force: Array) -> None:
        """Let the springs of friction hang where `force` (m,) acts at the displacements `way`."""
        for c in self.active:
            rows = self.tangents(c)
            if rows.start < rows.stop:
                self.anchor[rows] = way[rows] - force[rows] / self.system.slip[c, 1]

    def forces(self, free: Array, A: Array, rate: Array, A_rate: Array, guess: Array) -> Array:
        """F (m,) with F = law(free - A F, rate - A_rate F) of all closed contacts, 0 else.

        A and A_rate (m, m): decrease of indentations [m/N] and their rates [m/(N s)] per force.
        """
        F = guess.copy()
        for c, closed in enumerate(self.closed):
            if not closed:
                F[c] = 0.0
                F[self.tangents(c)] = 0.0

        def sweep(c: int) -> None:
            F[c] = self._normal(c, free, A, rate, A_rate, F)
            self._rub(c, free, A, F)

        return self.settled(sweep, F)

    def normal_forces(self, free: Array, A: Array, rate: Array, guess: Array) -> Array:
        """The same for the normal forces (p,) alone, at the rates that are there already."""
        F = np.where(self.closed, guess, 0.0)
        none = 0.0 * A

        def sweep(c: int) -> None:
            F[c] = self._normal(c, free, A, rate, none, F)

        return self.settled(sweep, F)

    def settled(self, sweep: Callable[[int], None], F: Array, share: float = SETTLED) -> Array:
        """F once sweeps over the closed contacts, which change it, change less than a share."""
        active = self.active
        if len(active) == 1 and len(F) <= len(self.laws):  # nothing that its force has to suit
            sweep(active[0])
            return F
        for _ in range(MOST_SWEEPS):
            before = F.copy()
            for c in active:
                sweep(c)
            change = float(np.abs(F - before).max())
            if change <= share * float(np.abs(F).max()) or not np.isfinite(change):
                return F
        raise NotConvergedError(
            f"the forces of {len(active)} contacts have not converged after {MOST_SWEEPS} sweeps;"
            f" use method='exact' or a smaller step."
        )

    def _normal(self, c: int, free: Array, A: Array, rate: Array, A_rate: Array, F: Array) -> float:
        """The normal force of one contact, with the other forces as they are."""
        law, state = self.laws[c], self.states[c]
        assert state is not None
        free_rate, slowed = 0.0, 0.0
        if law.rate_dependent:
            slowed = float(A_rate[c, c])
            free_rate = float(rate[c] - A_rate[c] @ F) + slowed * float(F[c])
        held = float(A[c, c])
        way = float(free[c] - A[c] @ F) + held * float(F[c])
        return law.implicit(way, held, free_rate, slowed, state, float(F[c]))

    def _rub(self, c: int, free: Array, A: Array, F: Array) -> None:
        """Friction of one contact: its spring, within the cone."""
        rows = self.tangents(c)
        if rows.start == rows.stop:
            return
        stiffness = self.system.slip[c, 1]
        for i in range(rows.start, rows.stop):
            way = free[i] - A[i] @ F + A[i, i] * F[i]
            F[i] = stiffness * (way - self.anchor[i]) / (1.0 + stiffness * A[i, i])
        F[rows] = self.within_cone(c, F[rows], F[c])

    def within_cone(self, c: int, friction: Array, normal: float) -> Array:
        """Friction (k,) of a contact, shortened to mu times the normal force."""
        size, most = float(np.linalg.norm(friction)), self.system.slip[c, 0] * normal
        return friction * (most / size) if size > most else friction


#: A time this short, relative to the run, is rounding; so is such a share of a distance.
ROUNDING = 1e-13
FINE = 1 / 4  # of a step: touches closer than this to a release belong to it


class Piece(NamedTuple):
    """A flight, or all from a touch until nothing touches, as a `Run` has it.

    time : (2 n + 1,); force, depth : (2 n + 1, m); states : (n + 1, 2, J).
    """

    time: Array
    force: Array
    depth: Array
    states: Array


def joined(pieces: Sequence[Piece]) -> Piece:
    """Pieces one after the other, each without its first node, which is the last of the one
    before."""
    parts = zip(*pieces, strict=True)
    return Piece(*(np.concatenate([part[0], *(p[1:] for p in part[1:])]) for part in parts))


class SceneMethod(ABC):
    """A method on a system of several contacts; subclasses integrate while one is closed.

    `step` [s] is the longest, or all. A `driven` scene is integrated in flights too.
    """

    def __init__(
        self, system: System, laws: Sequence[ContactLaw], step: float, driven: bool = False
    ) -> None:
        system = system.marched
        self.system, self.laws, self.step, self.driven = system, laws, step, driven
        self.contacts = JointContacts(system, laws)
        self.p, self.still = len(laws), np.zeros(len(system.beta))
        self.steps, self.highest = 0, 0.0

    @abstractmethod
    def press(
        self, t: float, begin: Array, force: Array, end: float, max_contacts: int, max_steps: int
    ) -> tuple[Piece, int]:
        """From the states `begin` (2, J) at t, under `force` (m,), while it is `busy`, or to the
        `end`; with it why it stopped."""

    @property
    def busy(self) -> bool:
        """Whether the motion is the method's: otherwise it is a flight."""
        return self.driven or bool(self.contacts.active)

    def run(self, duration: float, max_contacts: int, max_steps: int) -> Run:
        """All of the scene."""
        s, contacts = self.system, self.contacts
        force = np.zeros((1, len(s.beta)))
        force[0, : self.p] = s.pressed
        depth = s.free_rows(s.q, s.v)[0] - s.offsets[0] - force @ s.R
        pieces = [Piece(np.zeros(1), force, depth, np.stack((s.q, s.v))[None])]
        for c in contacts.active:
            contacts.anchor[contacts.tangents(c)] = depth[0, contacts.tangents(c)]
        answer = march.DONE
        while answer == march.DONE and duration - pieces[-1].time[-1] > ROUNDING * duration:
            t, force, begin = float(pieces[-1].time[-1]), pieces[-1].force, pieces[-1].states[-1]
            if self.busy:
                piece, answer = self.press(t, begin, force[-1], duration, max_contacts, max_steps)
            else:
                piece, answer = self._flight(t, begin, duration, max_contacts)
            pieces.append(piece)
        whole = joined(pieces)
        return Run(
            *whole,
            events=np.array(contacts.events, dtype=float).reshape(-1, 4),
            answer=answer,
            steps=self.steps,
            attempts=self.steps,
            touches=contacts.touches,
            highest=max(self.highest, s.given + march.mechanical(whole.states[0], s.omega)),
        )

    def acting(self, t: float) -> tuple[Array, Array, Array]:
        """Modal loads (J,), gaps and their rates (m,) at time t."""
        s = self.system
        k = 0 if s.breaks.size == 1 else max(int(np.searchsorted(s.breaks, t, side="right")) - 1, 0)
        if k + 1 == s.breaks.size:
            return s.loads[k], s.offsets[k], self.still
        part = (t - s.breaks[k]) / (s.breaks[k + 1] - s.breaks[k])
        drift = (s.offsets[k + 1] - s.offsets[k]) / (s.breaks[k + 1] - s.breaks[k])
        return (
            s.loads[k] + part * (s.loads[k + 1] - s.loads[k]),
            s.offsets[k] + part * (s.offsets[k + 1] - s.offsets[k]),
            drift,
        )

    def touched(self, c: int, free: Array, rate: Array, force: Array) -> None:  # noqa: B027
        """What a method remembers of contact c, which has touched: displacements without forces,
        speeds and forces (m,) there."""

    def _flight(
        self, t: float, begin: Array, duration: float, max_contacts: int
    ) -> tuple[Piece, int]:
        """The motion until the next touch, of which the contacts then know."""
        s = self.system
        origins = np.zeros(len(s.beta))
        origins[: self.p] = [self.contacts.origin(c) for c in range(self.p)]
        later = s.breaks > t
        load, gap, _ = self.acting(t)
        ahead = replace(
            s,
            R=np.zeros_like(s.R),
            breaks=np.append(0.0, s.breaks[later] - t),
            loads=np.vstack((load, s.loads[later])),
            offsets=np.vstack((gap, s.offsets[later])) + origins,
            laws=[Linear(1.0)] * self.p,
            q=begin[0],
            v=begin[1],
            pressed=np.zeros(self.p),
            kept=None,
        )
        found = run(ahead, duration - t, 1.0, fine=FINE * self.step, max_contacts=0)
        ends = np.arange(found.time.size // 2 + 1)
        moved = starts(found, ahead, ends)
        depth = found.depth + origins
        piece = Piece(t + found.time, found.force, depth, np.stack(moved, axis=1))
        if found.answer != march.TOO_MANY_CONTACTS:
            return piece, found.answer
        if self.contacts.touches >= max_contacts:
            return piece, march.TOO_MANY_CONTACTS
        q, v = piece.states[-1]
        self._touch(float(piece.time[-1]), q, v, origins)
        return piece, march.DONE

    def _touch(self, t: float, q: Array, v: Array, origins: Array) -> None:
        """Close the contacts that touch at t: those that reach it first, within rounding."""
        s, p = self.system, self.p
        _, gap, drift = self.acting(t)
        free, rate = s.free_rows(q, v)
        free, rate = free - gap, rate - drift
        beyond, coming = (free - origins)[:p], rate[:p] > 0
        if not coming.any():
            coming[:] = True
        size = abs(s.beta[:p]) @ abs(q) + abs(gap[:p])
        reached = beyond >= beyond[coming].max() - ROUNDING * size
        for c in np.flatnonzero(coming & reached).tolist():
            self.contacts.touch(c, t, float(rate[c]), free)
            self.touched(c, free, rate, self.still)
