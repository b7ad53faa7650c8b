"""Any method of scipy.integrate.solve_ivp on scenes, with events at touch, parting and turns.

It integrates the modal equations and evaluates the contact laws at every call of the right-hand
side. Friction has the elongation z of its spring as a state: z' is the speed of the point while it
sticks; while it slides the force is mu F along z, and z turns and grows with it.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

import numpy as np

from antiosc.base import march
from antiosc.base._types import Array
from antiosc.base.errors import InputError
from antiosc.contact import ContactLaw
from antiosc.simulation.integrators.method import ROUNDING, Piece, SceneMethod, joined
from antiosc.simulation.march.system import System

IVP_METHODS = ("RK45", "RK23", "DOP853", "Radau", "BDF", "LSODA")
#: of the right-hand side, for each step that is allowed
EVALUATIONS = 5
#: events one after the other without any time in between
IDLE = 200
#: parabolas of the forces for each step of the solver
NODES_A_STEP = 4


class SceneIVP(SceneMethod):
    """`solve_ivp` with relative tolerance `rtol` on a system of several contacts.

    `max_step` [s] bounds its steps, so that no touch is stepped over.
    """

    def __init__(
        self,
        method: str,
        rtol: float,
        system: System,
        laws: Sequence[ContactLaw],
        max_step: float,
        driven: bool = False,
    ) -> None:
        rubs = system.tangents[:, 1] > 0
        if any(law.rate_dependent and rubs[c] for c, law in enumerate(laws)):
            raise InputError(
                f"{method} does not support friction beside a rate-dependent law; use"
                " method='newmark' or 'exact'."
            )
        if any(law.rate_dependent and system.R[c, c] > 0 for c, law in enumerate(laws)):
            raise InputError(
                f"{method} does not support a rate-dependent law at a massless contact point"
                " (m0 = 0), where the force depends on its own derivative; use method='exact'."
            )
        super().__init__(system, laws, max_step, driven)
        self.name, self.rtol = method, rtol
        self.size = self.system.omega.size
        self.sliding = np.zeros(self.p, dtype=bool)
        self.turning = np.full(self.p, -1.0)  # the way in which the indentation turns next
        self.evaluations, self.most = 0, 0

    def press(
        self, t: float, begin: Array, force: Array, end: float, max_contacts: int, max_steps: int
    ) -> tuple[Piece, int]:
        from scipy.integrate import solve_ivp  # loaded where it is used: it takes long

        s, contacts = self.system, self.contacts
        y = np.concatenate((*begin, np.zeros(len(s.beta) - self.p)))
        answer, idle = march.DONE, 0
        self.most = EVALUATIONS * max_steps
        depth = s.free_rows(*begin)[0] - self.acting(t)[1] - s.R @ force
        pieces = [Piece(np.array([t]), force[None], depth[None], begin[None])]
        breaks = [b for b in s.breaks[1:] if b < end] + [end]
        atol = self._absolute()
        while answer == march.DONE and self.busy and end - t > ROUNDING * end:
            until = next(b for b in breaks if b > t)
            try:
                with np.errstate(all="ignore"):
                    solution: Any = solve_ivp(
                        self._slope,
                        (t, until),
                        y,
                        method=self.name,
                        rtol=self.rtol,
                        atol=atol,
                        max_step=self.step,
                        events=[event for c in range(self.p) for event in self._events(c)],
                        dense_output=True,
                    )
            except _GaveUp:
                answer = march.TOO_MANY_STEPS
                break
            if solution.t.size > 1:
                pieces.append(self._recorded(solution))
                self.steps += solution.t.size - 1
            moved = float(solution.t[-1])
            y = self._clipped(moved, solution.y[:, -1].copy())
            free, rate, felt = self._felt(moved, y)
            contacts.advance(free - s.R @ felt, rate)
            if solution.status == 1:
                self._change(moved, y, solution.t_events)
            elif solution.status < 0:
                answer = march.STUCK
            if self.steps > max_steps:
                answer = march.TOO_MANY_STEPS
            elif contacts.touches > max_contacts:
                answer = march.TOO_MANY_CONTACTS
            idle = 0 if moved - t > ROUNDING * end else idle + 1
            if idle > IDLE:
                answer = march.STUCK
            t = until if solution.status == 0 else moved
        return joined(pieces), answer

    def touched(self, c: int, free: Array, rate: Array, force: Array) -> None:
        z = np.zeros(self.system.tangents[c, 1])
        self.turning[c] = -1.0
        self.sliding[c] = z.size > 0 and self._slip(c, free, z, rate, force) > 0.0

    # -- motion

    def _felt(self, t: float, y: Array) -> tuple[Array, Array, Array]:
        """Indentations without contact forces, their rates, and the forces, (m,) each."""
        s, n, p = self.system, self.size, self.p
        _, gap, drift = self.acting(t)
        free, rate = s.free_rows(y[:n], y[n : 2 * n])
        free, rate = free - gap, rate - drift
        force = np.zeros(len(free))
        if not self.contacts.active:
            return free, rate, force
        force[:p] = self.contacts.normal_forces(free[:p], s.R[:p, :p], rate[:p], force[:p])
        for c in self.contacts.active:
            z = self._elongation(c, y)
            if z.size and self.sliding[c]:
                force[self.contacts.tangents(c)] = s.slip[c, 0] * force[c] * self._way(c, z, rate)
            elif z.size:
                force[self.contacts.tangents(c)] = s.slip[c, 1] * z
        return free, rate, force

    def _elongation(self, c: int, y: Array) -> Array:
        """The part z (k,) of y that belongs to a contact, as a view."""
        rows = self.contacts.tangents(c)
        return y[2 * self.size :][rows.start - self.p : rows.stop - self.p]

    def _way(self, c: int, z: Array, rate: Array) -> Array:
        """Unit vector (k,) along z, which begins along the speed."""
        along = z if np.any(z) else rate[self.contacts.tangents(c)]
        length = float(np.linalg.norm(along))
        return along / length if length > 0 else along

    def _slope(self, t: float, y: Array) -> Array:
        s, n = self.system, self.size
        self.evaluations += 1
        if self.evaluations > self.most:
            raise _GaveUp
        load, _, _ = self.acting(t)
        free, rate, force = self._felt(t, y)
        change = np.zeros(y.size)
        for c in self.contacts.active:
            z = self._elongation(c, y)
            if z.size:
                speed = rate[self.contacts.tangents(c)]
                slip = self._slip(c, free, z, rate, force) if self.sliding[c] else 0.0
                self._elongation(c, change)[:] = speed - slip * self._way(c, z, rate)
        v = y[n : 2 * n]
        change[:n] = v
        change[n : 2 * n] = load[:n] - force @ s.beta - s.omega**2 * y[:n] - 2 * s.decay * v
        if s.gamma is not None:  # first-order modes (csrc/antiosc_march.h)
            drive = load[n:] - force @ s.gamma
            change[:n] += drive
            change[n : 2 * n] -= 2 * s.decay * drive
        return change

    def _slip(self, c: int, free: Array, z: Array, rate: Array, force: Array) -> float:
        """Speed [m/s] at which the slider gives way, if it slides: that of the point beyond z."""
        p = self.p
        R = self.system.R[:p, :p]
        depth = free[:p] - R @ force[:p]
        stiff = np.zeros(p)
        for other in self.contacts.active:
            state = self.contacts.states[other]
            assert state is not None
            stiff[other] = self.laws[other].tangent(float(depth[other]), 0.0, state)[0]
        # F' = k (delta' - R F') of all contacts
        rising = np.linalg.solve(np.eye(p) + stiff[:, None] * R, stiff * rate[:p])
        mu, stiffness = self.system.slip[c]
        speed = float(rate[self.contacts.tangents(c)] @ self._way(c, z, rate))
        return speed - mu / stiffness * float(rising[c])

    def _clipped(self, t: float, y: Array) -> Array:
        """The state with the springs of what slides on their cones, and free ones at rest."""
        _, rate, force = self._felt(t, y)
        for c in range(self.p):
            z, (mu, stiffness) = self._elongation(c, y), self.system.slip[c]
            if not self.contacts.closed[c]:
                z[:] = 0.0
            elif z.size and self.sliding[c]:
                z[:] = self._way(c, z, rate) * (mu * force[c] / stiffness)
        return y

    # -- events

    def _events(self, c: int) -> list[Callable[[float, Array], float]]:
        """Touch or parting, turn of a law with memory, and change of stick and slip."""
        closed, rubs = bool(self.contacts.closed[c]), self.system.tangents[c, 1] > 0

        def beyond(t: float, y: Array) -> float:
            free, _, force = self._felt(t, y)
            others = self.system.R[c] @ force - self.system.R[c, c] * force[c]
            found = float(free[c] - others - self.contacts.origin(c))
            return found or (1e-300 if closed else -1e-300)  # at rest it neither touches nor parts

        def turn(t: float, y: Array) -> float:
            return float(self._felt(t, y)[1][c])

        def switch(t: float, y: Array) -> float:
            free, rate, force = self._felt(t, y)
            z, (mu, stiffness) = self._elongation(c, y), self.system.slip[c]
            if self.sliding[c]:
                return -self._slip(c, free, z, rate, force)
            return float(stiffness * np.linalg.norm(z) - mu * force[c])

        found: list[Any] = []
        for event, direction, wanted in (
            (beyond, -1.0 if closed else 1.0, True),
            (turn, self.turning[c], closed and self.laws[c].has_memory),
            (switch, 1.0, closed and rubs),
        ):
            event.terminal, event.direction = True, direction  # type: ignore[attr-defined]
            found.append(event if wanted else _never)
        return found

    def _change(self, t: float, y: Array, found: list[Array]) -> None:
        """What the events at t change: the contacts, and which of them slide."""
        free, rate, force = self._felt(t, y)
        for c in range(self.p):
            own = found[3 * c : 3 * c + 3]
            touch, turn, switch = (each.size > 0 and each[-1] == t for each in own)
            z = self._elongation(c, y)
            if touch and self.contacts.closed[c]:
                self.contacts.part(c, t)
                z[:] = 0.0
            elif touch:
                self.contacts.touch(c, t, float(rate[c]), free)
                self.touched(c, free, rate, force)
            elif turn:
                self.turning[c] *= -1.0
            elif switch:
                if self.sliding[c]:
                    z *= 1 - 1e-12  # it sticks, just within its cone
                self.sliding[c] = not self.sliding[c]

    # -- results

    def _absolute(self) -> Array:
        """Absolute tolerances (2 J + m - p,): what is small beside the contacts' own motion."""
        s = self.system
        reach = np.abs(s.beta[: self.p]).max(axis=1)
        reach = np.where(reach > 0, reach, 1.0)
        q, v = float(np.max(s.depth / reach)), float(np.max(s.speed / reach))
        parts = (
            np.full(self.size, q),
            np.full(self.size, v),
            np.full(len(s.beta) - self.p, float(s.depth.max())),
        )
        return np.asarray(np.maximum(1e-3 * self.rtol * np.concatenate(parts), 1e-300))

    def _recorded(self, solution: Any) -> Piece:
        """Times, forces and indentations at 0, h/2, h of parts of steps; states at their ends."""
        part = np.arange(2 * NODES_A_STEP) / (2 * NODES_A_STEP)
        t = (solution.t[:-1, None] + np.diff(solution.t)[:, None] * part).ravel()
        t = np.append(t, solution.t[-1])
        y = solution.sol(t).T
        felt = [self._felt(float(at), row) for at, row in zip(t, y, strict=True)]
        force = np.array([f for _, _, f in felt])
        depth = np.array([free - self.system.R @ f for free, _, f in felt])
        states = y[::2, : 2 * self.size].reshape(-1, 2, self.size)
        return Piece(t, force, depth, states)


class _GaveUp(Exception):
    """The limit of evaluations is reached."""


def _never(t: float, y: Array) -> float:
    return 1.0
