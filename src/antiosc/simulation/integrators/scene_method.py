"""What the methods that the march is compared with share: flights, touches, and what they write.

Flights are exact: the march finds the next touch. A method integrates from there until all
contacts have parted. What loads and a moving ground do is part of the comparison: a method
integrates all of a scene that has them.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from antiosc.base import march
from antiosc.base._types import Array
from antiosc.contact import ContactLaw, Linear
from antiosc.simulation.integrators.joint_contacts import JointContacts
from antiosc.simulation.march.engine import Run, run
from antiosc.simulation.march.system import System
from antiosc.simulation.problem.scene_states import between, starts

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
        )
        found = run(ahead, duration - t, 1.0, fine=FINE * self.step, max_contacts=0)
        ends = np.arange(found.time.size // 2 + 1)
        moved = starts(found, ahead, lambda at: between(at, ahead.breaks, ahead.loads), ends)
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
