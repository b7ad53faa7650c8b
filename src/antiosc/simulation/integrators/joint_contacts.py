"""Forces of several contacts by their laws' own methods, swept by Gauss and Seidel's method.

The methods that the march is compared with use it: it shares no code with the march.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np

from antiosc.base._types import Array
from antiosc.base.errors import NotConvergedError
from antiosc.contact import ContactLaw, State
from antiosc.simulation.march.system import System

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
        self.states: list[State | None] = [
            law.touch(0.0 if system.closing is None else float(system.closing[c]))
            if closed
            else None
            for c, (law, closed) in enumerate(zip(laws, self.closed, strict=True))
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
