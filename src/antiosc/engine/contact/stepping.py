"""Contacts of bodies in fixed time steps: forces at the end of a step, by the contact laws."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np

from antiosc.base._types import Array
from antiosc.base.errors import NotConvergedError
from antiosc.engine.contact.base import ContactLaw

SWEEP_TOL = 1e-13  # change of a force in a sweep, relative to the largest
MOST_SWEEPS = 500


class StepEnd(NamedTuple):
    """Forces, indentations and their rates (m,) at the end of a step."""

    force: Array
    delta: Array
    rate: Array


class Contacts:
    """The contacts of a run: whether each is closed, the state of its law, and the events.

    R : (m, m) massless compliance [m/N]; least_speeds : (m,) least closing speeds [m/s].
    An event is (time [s], contact, 1 for a touch or 0 for a release, closing speed [m/s]).
    """

    def __init__(
        self,
        laws: Sequence[ContactLaw],
        R: Array,
        closed: Sequence[bool],
        least_speeds: Sequence[float] | Array,
    ) -> None:
        self.laws = laws
        self.R = R
        self.closed = list(closed)
        self.least_speeds = least_speeds
        # None before the first touch
        self.states: list[Any] = [
            law.touch(0.0) if closed else None for law, closed in zip(laws, closed, strict=True)
        ]
        self.events: list[tuple[float, int, int, float]] = []

    @property
    def touches(self) -> int:
        """Number of touches so far."""
        return sum(event[2] for event in self.events)

    def origin(self, c: int) -> float:
        """Indentation [m] at which a contact touches and opens."""
        state = self.states[c]
        return 0.0 if state is None else self.laws[c].origin(state)

    def touch(self, c: int, t: float, speed: float) -> None:
        """Close a contact at its closing speed [m/s]."""
        speed = max(speed, float(self.least_speeds[c]))
        self.states[c] = self.laws[c].touch(speed, self.states[c])
        self.closed[c] = True
        self.events.append((t, c, 1, speed))

    def part(self, c: int, t: float) -> None:
        """Open a contact."""
        self.closed[c] = False
        self.events.append((t, c, 0, 0.0))

    def closed_contacts(self) -> list[int]:
        """Numbers of the contacts that are closed."""
        return [c for c, closed in enumerate(self.closed) if closed]

    def end_of_step(
        self, t: float, h: float, last: StepEnd, free: Array, speed: Array, A: Array, A_rate: Array
    ) -> StepEnd:
        """Forces, indentations and rates at the end of a step of length h [s] from t [s].

        last : values at the start of the step; free, speed : (m,) indentations and rates at its end
        without forces there; A, A_rate : (m, m) their decreases per unit force.
        """
        for c, closed in enumerate(self.closed):
            if not closed and free[c] > self.origin(c):
                share = _crossing(last.delta[c], free[c], self.origin(c))
                closing = last.rate[c] + share * (speed[c] - last.rate[c])
                self.touch(c, t + share * h, float(closing))

        rate = speed + self.R @ last.force / h
        F = self.forces(free, A, rate, A_rate)
        end = StepEnd(F, free - A @ F, rate - A_rate @ F)

        for c in self.closed_contacts():
            moved = float(end.delta[c]), float(end.rate[c])
            self.states[c] = self.laws[c].advance(*moved, self.states[c])
            if F[c] == 0.0 and end.delta[c] <= (origin := self.origin(c)):
                self.part(c, t + _crossing(last.delta[c], end.delta[c], origin) * h)

        return end

    def forces(self, free: Array, A: Array, rate: Array, A_rate: Array) -> Array:
        """Forces (m,) [N] of closed contacts by iteration: F = law(free - A F, rate - A_rate F)."""
        F = np.zeros(len(free))
        active = self.closed_contacts()

        for _ in range(MOST_SWEEPS):
            before = F.copy()
            for c in active:
                unloaded = float(free[c] - A[c] @ F + A[c, c] * F[c])
                slope = float(rate[c] - A_rate[c] @ F + A_rate[c, c] * F[c])
                slopes = float(A[c, c]), slope, float(A_rate[c, c])
                F[c] = self.laws[c].implicit(unloaded, *slopes, self.states[c], float(F[c]))

            if len(active) < 2:
                return F
            change = np.abs(F - before).max()
            if not change > SWEEP_TOL * np.abs(F).max():
                return F

        raise NotConvergedError(
            f"the forces of {len(active)} contacts have not converged after {MOST_SWEEPS} sweeps;"
            " use the method 'exact' or a smaller step."
        )


def _crossing(before: float, after: float, origin: float) -> float:
    """Share of a step, 0 to 1, at which the line from `before` to `after` reaches `origin`."""
    if before == after:
        return 0.0
    return min(max((before - origin) / (before - after), 0.0), 1.0)
