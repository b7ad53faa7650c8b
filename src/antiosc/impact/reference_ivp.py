"""Scenes by scipy.integrate.solve_ivp, and the base of all methods other than the march.

These methods share with the march only its exact flights, which end at the next touch. From there
a method integrates until all contacts have parted. A scene with loads or a moving ground is
integrated as a whole, since the loads are part of the comparison. Forces of several contacts are
found from their laws by Gauss–Seidel sweeps.

`SceneIVP` integrates the modal equations and evaluates the laws at every call of the right-hand
side. The state of friction is the elongation z of its spring. While the point sticks, z' is its
speed; while it slides, the force is mu F along z, and z turns and grows with it.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import Any, NamedTuple

import numpy as np

from antiosc.base._types import Array
from antiosc.base.errors import InputError, NotConvergedError
from antiosc.engine import library
from antiosc.engine.contact import ContactLaw, Linear, State
from antiosc.engine.march import Run, run
from antiosc.engine.system import System
from antiosc.impact.states import starts

MOST_SWEEPS = 500  # the scenes of the quick tests need 10 at most
SWEEP_TOL = 1e-13  # change of a force in a sweep, relative to the largest


class JointContacts:
    """The contacts of a scene, with the states of their laws and friction.

    Attributes
    ----------
    closed : whether each contact touches.
    states : states of the laws; None before the first touch.
    anchor : (m,) positions of the fixed ends of the friction springs [m], for tangential rows.
    events : rows [time, contact, 0 parts or 1 touches, closing speed] of all touches and partings.
    """

    def __init__(self, system: System, laws: Sequence[ContactLaw]) -> None:
        self.system = system
        self.laws = laws
        self.closed = system.closed.tolist()
        self._tangents = system.sides
        earlier = system.contact_states or [None] * len(laws)
        self.states: list[State | None] = [
            contact.state if contact is not None else law.touch(0.0) if closed else None
            for law, contact, closed in zip(laws, earlier, self.closed, strict=True)
        ]
        self.anchor = np.zeros(len(system.beta))
        self.events: list[tuple[float, int, int, float]] = []

    @property
    def touches(self) -> int:
        """Number of times that contacts have closed so far."""
        return sum(piece for _, _, piece, _ in self.events)

    @property
    def active(self) -> list[int]:
        """The closed contacts."""
        return [c for c, closed in enumerate(self.closed) if closed]

    def tangents(self, c: int) -> slice:
        """The tangential rows of a contact."""
        return self._tangents[c]

    def state(self, c: int) -> State:
        """State of the law of a contact that has touched."""
        state = self.states[c]
        assert state is not None
        return state

    def origin(self, c: int) -> float:
        """Indentation [m] at which a contact touches and parts."""
        state = self.states[c]
        if state is None:
            return 0.0
        return self.laws[c].origin(state)

    def touch(self, c: int, t: float, speed: float, displacement: Array) -> None:
        """Close a contact at the closing `speed`; `displacement` (m,) is that of the rows."""
        speed = max(speed, float(self.system.slowest[c]))
        self.states[c] = self.laws[c].touch(speed, self.states[c])
        self.closed[c] = True
        self.anchor[self.tangents(c)] = displacement[self.tangents(c)]
        self.events.append((t, c, 1, speed))

    def part(self, c: int, t: float) -> None:
        """Open a contact at time t."""
        self.closed[c] = False
        self.events.append((t, c, 0, 0.0))

    def advance(self, delta: Array, rate: Array) -> None:
        """Update the states of the laws after a step, from indentations and rates (m,)."""
        for c, law in enumerate(self.laws):
            if self.closed[c]:
                self.states[c] = law.advance(float(delta[c]), float(rate[c]), self.state(c))

    def move_anchors(self, displacement: Array, force: Array) -> None:
        """Set the anchors of friction so that `force` (m,) acts at `displacement` (m,)."""
        for c in self.active:
            rows = self.tangents(c)
            if rows.start < rows.stop:
                self.anchor[rows] = displacement[rows] - force[rows] / self.system.slip[c, 1]

    def forces(self, free: Array, A: Array, rate: Array, A_rate: Array, guess: Array) -> Array:
        """F (m,) with F = law(free - A F, rate - A_rate F) for all closed contacts, 0 for others.

        A and A_rate (m, m): decrease of indentations [m/N] and of their rates [m/(N s)] per force.
        With arrays (p,) and (p, p) only the normal forces are found.
        """
        F = guess.copy()
        for c, closed in enumerate(self.closed):
            if not closed:
                F[c] = 0.0
                F[self.tangents(c)] = 0.0

        def sweep(c: int) -> None:
            F[c] = self._normal(c, free, A, rate, A_rate, F)
            self.friction(c, free, A, F)

        return self.settled(sweep, F)

    def settled(self, sweep: Callable[[int], None], F: Array, share: float = SWEEP_TOL) -> Array:
        """F after sweeps over the closed contacts, once they change it by less than a share."""
        active = self.active
        if len(active) == 1 and len(F) <= len(self.laws):  # nothing that its force has to suit
            sweep(active[0])
            return F
        for _ in range(MOST_SWEEPS):
            previous_forces = F.copy()
            for c in active:
                sweep(c)
            change = float(np.abs(F - previous_forces).max())
            if change <= share * float(np.abs(F).max()) or not np.isfinite(change):
                return F
        raise NotConvergedError(
            f"the forces of {len(active)} contacts have not converged after {MOST_SWEEPS} sweeps;"
            f" use the method 'exact' or a smaller step."
        )

    def _normal(self, c: int, free: Array, A: Array, rate: Array, A_rate: Array, F: Array) -> float:
        """Solve for the normal force [N] of contact c while the other forces keep their values."""
        law = self.laws[c]
        state = self.state(c)
        free_rate = 0.0
        rate_compliance = 0.0
        if law.rate_dependent:
            rate_compliance = float(A_rate[c, c])
            free_rate = float(rate[c] - A_rate[c] @ F) + rate_compliance * float(F[c])
        compliance = float(A[c, c])
        displacement = float(free[c] - A[c] @ F) + compliance * float(F[c])
        unloaded = displacement, compliance, free_rate, rate_compliance
        return law.implicit(*unloaded, state, float(F[c]))

    def friction(self, c: int, free: Array, A: Array, F: Array) -> None:
        """Set the friction of one contact in F: its spring force, limited by the friction cone."""
        rows = self.tangents(c)
        if rows.start == rows.stop or rows.stop > len(F):
            return
        stiffness = self.system.slip[c, 1]
        for i in range(rows.start, rows.stop):
            displacement = free[i] - A[i] @ F + A[i, i] * F[i]
            F[i] = stiffness * (displacement - self.anchor[i]) / (1.0 + stiffness * A[i, i])
        F[rows] = self.within_cone(c, F[rows], F[c])

    def within_cone(self, c: int, friction: Array, normal: float) -> Array:
        """Friction (k,) of a contact, limited to mu times the normal force."""
        size = float(np.linalg.norm(friction))
        friction_limit = self.system.slip[c, 0] * normal
        if size > friction_limit:
            return friction * (friction_limit / size)
        return friction


#: Times and distances below this, relative to the run, are rounding.
SAME_TIME = 1e-13
TOUCH_RESOLUTION = 1 / 4  # of a step: touches closer than this to a release belong to it


class Segment(NamedTuple):
    """A flight, or a period of contact, in the arrays of a `Run`.

    time : (2 n + 1,); force, depth : (2 n + 1, m); states : (n + 1, 2, J).
    """

    time: Array
    force: Array
    depth: Array
    states: Array


def joined_segments(pieces: Sequence[Segment]) -> Segment:
    """Join segments; each begins with the last node of the one before."""
    parts = zip(*pieces, strict=True)
    return Segment(*(np.concatenate([part[0], *(p[1:] for p in part[1:])]) for part in parts))


class SceneMethod(ABC):
    """A method for a system of several contacts; subclasses integrate while one is closed.

    `step` [s] is the longest, or the fixed one. A `driven` scene is integrated during flights too.
    """

    def __init__(
        self, system: System, laws: Sequence[ContactLaw], step: float, driven: bool = False
    ) -> None:
        system = system.marched
        self.system = system
        self.laws = laws
        self.step = step
        self.driven = driven
        self.contacts = JointContacts(system, laws)
        self.p = len(laws)
        self.still = np.zeros(len(system.beta))
        self.steps = 0
        self.highest = 0.0

    @abstractmethod
    def integrate_contact(
        self, t: float, begin: Array, force: Array, end: float, max_contacts: int, max_steps: int
    ) -> tuple[Segment, int]:
        """Integrate from the states `begin` (2, J) under `force` (m,) while `busy`, until `end`.

        Returns the segment and the status.
        """

    @property
    def busy(self) -> bool:
        """Whether the method must integrate: a contact is closed, or a drive acts; else the flight
        is exact.
        """
        return self.driven or bool(self.contacts.active)

    def run(self, duration: float, max_contacts: int, max_steps: int) -> Run:
        """Integrate the whole scene."""
        s = self.system
        contacts = self.contacts
        force = np.zeros((1, len(s.beta)))
        force[0, : self.p] = s.pressed
        depth = s.free_rows(s.q, s.v)[0] - s.offsets[0] - force @ s.R
        pieces = [Segment(np.zeros(1), force, depth, np.stack((s.q, s.v))[None])]
        for c in contacts.active:
            contacts.anchor[contacts.tangents(c)] = depth[0, contacts.tangents(c)]
        status = library.DONE
        while status == library.DONE and duration - pieces[-1].time[-1] > SAME_TIME * duration:
            t = float(pieces[-1].time[-1])
            force = pieces[-1].force
            start_states = pieces[-1].states[-1]
            if self.busy:
                piece, status = self.integrate_contact(
                    t, start_states, force[-1], duration, max_contacts, max_steps
                )
            else:
                piece, status = self._flight(t, start_states, duration, max_contacts)
            pieces.append(piece)
        segment = joined_segments(pieces)
        start_energy = s.contact_energy + float(library.energies(segment.states[:1], s.omega)[0])
        return Run(
            *segment,
            events=np.array(contacts.events, dtype=float).reshape(-1, 4),
            answer=status,
            steps=self.steps,
            attempts=self.steps,
            touches=contacts.touches,
            highest=max(self.highest, start_energy),
        )

    def loads_at(self, t: float) -> tuple[Array, Array, Array]:
        """Modal loads (J,), gaps and their rates (m,) at time t."""
        s = self.system
        k = 0 if s.breaks.size == 1 else max(int(np.searchsorted(s.breaks, t, side="right")) - 1, 0)
        if k + 1 == s.breaks.size:
            return s.loads[k], s.offsets[k], self.still
        fraction = (t - s.breaks[k]) / (s.breaks[k + 1] - s.breaks[k])
        drift = (s.offsets[k + 1] - s.offsets[k]) / (s.breaks[k + 1] - s.breaks[k])
        return (
            s.loads[k] + fraction * (s.loads[k + 1] - s.loads[k]),
            s.offsets[k] + fraction * (s.offsets[k + 1] - s.offsets[k]),
            drift,
        )

    def on_touch(self, c: int, free: Array, rate: Array, force: Array) -> None:  # noqa: B027
        """Called when contact c touches; methods override it.

        free, rate, force : (m,) displacements without contact forces, speeds and forces.
        """

    def _flight(
        self, t: float, begin: Array, duration: float, max_contacts: int
    ) -> tuple[Segment, int]:
        """Compute the motion until the next touch and close the contacts that touch there."""
        s = self.system
        origins = np.zeros(len(s.beta))
        origins[: self.p] = [self.contacts.origin(c) for c in range(self.p)]
        is_later = s.breaks > t
        load, gap, _ = self.loads_at(t)
        flight_system = replace(
            s,
            R=np.zeros_like(s.R),
            breaks=np.append(0.0, s.breaks[is_later] - t),
            loads=np.vstack((load, s.loads[is_later])),
            offsets=np.vstack((gap, s.offsets[is_later])) + origins,
            laws=[Linear(1.0)] * self.p,
            q=begin[0],
            v=begin[1],
            pressed=np.zeros(self.p),
            contact_states=None,
        )
        flight = run(
            flight_system, duration - t, 1.0, fine=TOUCH_RESOLUTION * self.step, max_contacts=0
        )
        ends = np.arange(flight.time.size // 2 + 1)
        end_states = starts(flight, flight_system, ends)
        depth = flight.depth + origins
        piece = Segment(t + flight.time, flight.force, depth, np.stack(end_states, axis=1))
        if flight.answer != library.TOO_MANY_CONTACTS:
            return piece, flight.answer
        if self.contacts.touches >= max_contacts:
            return piece, library.TOO_MANY_CONTACTS
        q, v = piece.states[-1]
        self._touch(float(piece.time[-1]), q, v, origins)
        return piece, library.DONE

    def _touch(self, t: float, q: Array, v: Array, origins: Array) -> None:
        """Close the contacts that touch at t: those that reach their origins first, within
        rounding.
        """
        s = self.system
        p = self.p
        _, gap, drift = self.loads_at(t)
        free, rate = s.free_rows(q, v)
        free = free - gap
        rate = rate - drift
        excess = (free - origins)[:p]
        approaching = rate[:p] > 0
        if not approaching.any():
            approaching[:] = True
        size = abs(s.beta[:p]) @ abs(q) + abs(gap[:p])
        touches_now = excess >= excess[approaching].max() - SAME_TIME * size
        for c in np.flatnonzero(approaching & touches_now).tolist():
            self.contacts.touch(c, t, float(rate[c]), free)
            self.on_touch(c, free, rate, self.still)


IVP_METHODS = ("RK45", "RK23", "DOP853", "Radau", "BDF", "LSODA")
#: Most evaluations of the right-hand side per allowed step.
EVALUATIONS = 5
#: Shares of the longest step that are tried if the end of a step is an event.
SHARES = (1.0, 0.7, 0.3)
FIRST = 1e-4  # of what is left, their first step
#: Most successive events at the same time.
MOST_IDLE = 200
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
                " the method 'newmark' or 'exact'."
            )
        if any(law.rate_dependent and system.R[c, c] > 0 for c, law in enumerate(laws)):
            raise InputError(
                f"{method} does not support a rate-dependent law at a massless contact point"
                " (m0 = 0), where the force depends on its own derivative; use the method 'exact'."
            )
        super().__init__(system, laws, max_step, driven)
        self.name = method
        self.rtol = rtol
        self.size = self.system.omega.size
        self.sliding = np.zeros(self.p, dtype=bool)
        self.turning = np.full(self.p, -1.0)  # the way in which the indentation turns next
        self.evaluations = 0
        self.most = 0

    def integrate_contact(
        self, t: float, begin: Array, force: Array, end: float, max_contacts: int, max_steps: int
    ) -> tuple[Segment, int]:
        s = self.system
        contacts = self.contacts
        y = np.concatenate((*begin, np.zeros(len(s.beta) - self.p)))
        status = library.DONE
        idle_steps = 0
        self.most = EVALUATIONS * max_steps
        depth = s.free_rows(*begin)[0] - self.loads_at(t)[1] - s.R @ force
        pieces = [Segment(np.array([t]), force[None], depth[None], begin[None])]
        breaks = [b for b in s.breaks[1:] if b < end] + [end]
        atol = self._absolute()
        while status == library.DONE and self.busy and end - t > SAME_TIME * end:
            until = next(b for b in breaks if b > t)
            try:
                with np.errstate(all="ignore"):
                    solution = self._solved((t, until), y, atol)
            except _TooManyEvaluations:
                status = library.TOO_MANY_STEPS
                break
            if solution.t.size > 1:
                pieces.append(self._recorded(solution.t, solution.sol))
                self.steps += solution.t.size - 1
            end_time = float(solution.t[-1])
            y = self._clipped(end_time, solution.y[:, -1].copy())
            free, rate, force = self._contact_state(end_time, y)
            contacts.advance(free - s.R @ force, rate)
            if solution.status == 1:
                self._apply_events(end_time, y, solution.t_events)
            elif solution.status < 0:
                status = library.STUCK
            if self.steps > max_steps:
                status = library.TOO_MANY_STEPS
            elif contacts.touches > max_contacts:
                status = library.TOO_MANY_CONTACTS
            idle_steps = 0 if end_time - t > SAME_TIME * end else idle_steps + 1
            if idle_steps > MOST_IDLE:
                status = library.STUCK
            t = until if solution.status == 0 else end_time
        return joined_segments(pieces), status

    def _solved(self, span: tuple[float, float], y: Array, atol: Array) -> Any:
        """The solution up to its first event.

        SciPy raises an error if an event at the end of a step has just been passed; other steps are
        then tried.
        """
        from scipy.integrate import solve_ivp  # loaded where it is used: it takes long

        events = [event for c in range(self.p) for event in self._events(c)]
        for share in SHARES:
            first = None if share == 1 else FIRST * share * (span[1] - span[0])
            try:
                return solve_ivp(
                    self._slope,
                    span,
                    y,
                    method=self.name,
                    rtol=self.rtol,
                    atol=atol,
                    max_step=share * self.step,
                    first_step=first,
                    events=events,
                    dense_output=True,
                )
            except ValueError as error:
                if "strictly" not in str(error):
                    raise
        raise NotConvergedError(
            f"{self.name} does not pass an event of a contact at {span[0]:.4g} s or later; use"
            " the method 'exact'."
        )

    def on_touch(self, c: int, free: Array, rate: Array, force: Array) -> None:
        z = np.zeros(self.system.tangents[c, 1])
        self.turning[c] = -1.0
        self.sliding[c] = z.size > 0 and self._slip(c, free, z, rate, force) > 0.0

    # -- motion

    def _contact_state(self, t: float, y: Array) -> tuple[Array, Array, Array]:
        """Indentations without contact forces, their rates, and the forces, (m,) each."""
        s = self.system
        n = self.size
        p = self.p
        _, gap, drift = self.loads_at(t)
        free, rate = s.free_rows(y[:n], y[n : 2 * n])
        free = free - gap
        rate = rate - drift
        force = np.zeros(len(free))
        if not self.contacts.active:
            return free, rate, force
        R = s.R[:p, :p]
        force[:p] = self.contacts.forces(free[:p], R, rate[:p], 0.0 * R, force[:p])
        for c in self.contacts.active:
            z = self._elongation(c, y)
            if z.size and self.sliding[c]:
                force[self.contacts.tangents(c)] = (
                    s.slip[c, 0] * force[c] * self._slip_direction(c, z, rate)
                )
            elif z.size:
                force[self.contacts.tangents(c)] = s.slip[c, 1] * z
        return free, rate, force

    def _elongation(self, c: int, y: Array) -> Array:
        """The part z (k,) of y that belongs to a contact, as a view."""
        rows = self.contacts.tangents(c)
        return y[2 * self.size :][rows.start - self.p : rows.stop - self.p]

    def _slip_direction(self, c: int, z: Array, rate: Array) -> Array:
        """Unit vector (k,) of sliding: along z, or along the velocity while z is zero."""
        sliding = z if np.any(z) else rate[self.contacts.tangents(c)]
        length = float(np.linalg.norm(sliding))
        return sliding / length if length > 0 else sliding

    def _slope(self, t: float, y: Array) -> Array:
        """Right-hand side of the equations."""
        s = self.system
        n = self.size
        self.evaluations += 1
        if self.evaluations > self.most:
            raise _TooManyEvaluations
        load, _, _ = self.loads_at(t)
        free, rate, force = self._contact_state(t, y)
        change = np.zeros(y.size)
        for c in self.contacts.active:
            z = self._elongation(c, y)
            if z.size:
                speed = rate[self.contacts.tangents(c)]
                slip = self._slip(c, free, z, rate, force) if self.sliding[c] else 0.0
                self._elongation(c, change)[:] = speed - slip * self._slip_direction(c, z, rate)
        v = y[n : 2 * n]
        change[:n] = v
        change[n : 2 * n] = load[:n] - force @ s.beta - s.omega**2 * y[:n] - 2 * s.decay * v
        if s.gamma is not None:  # first-order modes (csrc/antiosc_march.h)
            drive = load[n:] - force @ s.gamma
            change[:n] += drive
            change[n : 2 * n] -= 2 * s.decay * drive
        return change

    def _slip(self, c: int, free: Array, z: Array, rate: Array, force: Array) -> float:
        """Sliding speed [m/s] of a contact: that of its point minus that of its friction spring."""
        p = self.p
        R = self.system.R[:p, :p]
        depth = free[:p] - R @ force[:p]
        stiff = np.zeros(p)
        for active_contact in self.contacts.active:
            law = self.laws[active_contact]
            state = self.contacts.state(active_contact)
            stiff[active_contact] = law.tangent(float(depth[active_contact]), 0.0, state)[0]
        # F' = k (delta' - R F') of all contacts
        rising = np.linalg.solve(np.eye(p) + stiff[:, None] * R, stiff * rate[:p])
        mu, stiffness = self.system.slip[c]
        speed = float(rate[self.contacts.tangents(c)] @ self._slip_direction(c, z, rate))
        return speed - mu / stiffness * float(rising[c])

    def _clipped(self, t: float, y: Array) -> Array:
        """Put the springs of sliding contacts on their friction cones, and set those of open ones
        to 0.
        """
        _, rate, force = self._contact_state(t, y)
        for c in range(self.p):
            z = self._elongation(c, y)
            mu, stiffness = self.system.slip[c]
            if not self.contacts.closed[c]:
                z[:] = 0.0
            elif z.size and self.sliding[c]:
                z[:] = self._slip_direction(c, z, rate) * (mu * force[c] / stiffness)
        return y

    # -- events

    def _events(self, c: int) -> list[Callable[[float, Array], float]]:
        """Event functions: touch or parting, reversal of a law with memory, change of stick and
        slip.
        """
        closed = bool(self.contacts.closed[c])
        rubs = self.system.tangents[c, 1] > 0

        def deepening(t: float, y: Array) -> float:
            free, _, force = self._contact_state(t, y)
            other_forces = self.system.R[c] @ force - self.system.R[c, c] * force[c]
            events = float(free[c] - other_forces - self.contacts.origin(c))
            return events or (1e-300 if closed else -1e-300)  # at rest it neither touches nor parts

        def turn(t: float, y: Array) -> float:
            return float(self._contact_state(t, y)[1][c])

        def switch(t: float, y: Array) -> float:
            free, rate, force = self._contact_state(t, y)
            z = self._elongation(c, y)
            mu, stiffness = self.system.slip[c]
            if self.sliding[c]:
                return -self._slip(c, free, z, rate, force)
            return float(stiffness * np.linalg.norm(z) - mu * force[c])

        events: list[Callable[[float, Array], float]] = []
        for event, direction, is_relevant in (
            (deepening, -1.0 if closed else 1.0, True),
            (turn, self.turning[c], closed and self.laws[c].has_memory),
            (switch, 1.0, closed and rubs),
        ):
            event.terminal, event.direction = True, direction  # type: ignore[attr-defined]
            events.append(event if is_relevant else lambda t, y: 1.0)
        return events

    def _apply_events(self, t: float, y: Array, event_times: list[Array]) -> None:
        """Apply the events at t to the states of contacts and friction."""
        free, rate, force = self._contact_state(t, y)
        for c in range(self.p):
            events = event_times[3 * c : 3 * c + 3]
            touched, reversed_, switch = (times.size > 0 and times[-1] == t for times in events)
            z = self._elongation(c, y)
            if touched and self.contacts.closed[c]:
                self.contacts.part(c, t)
                z[:] = 0.0
            elif touched:
                self.contacts.touch(c, t, float(rate[c]), free)
                self.on_touch(c, free, rate, force)
            elif reversed_:
                self.turning[c] *= -1.0
            elif switch:
                if self.sliding[c]:
                    z *= 1 - 1e-12  # it sticks, just within its cone
                self.sliding[c] = not self.sliding[c]

    # -- results

    def _absolute(self) -> Array:
        """Absolute tolerances (2 J + m - p,), small relative to the motion of the contacts."""
        s = self.system
        reach = np.abs(s.beta[: self.p]).max(axis=1)
        reach = np.where(reach > 0, reach, 1.0)
        q = float(np.max(s.depth / reach))
        v = float(np.max(s.speed / reach))
        parts = (
            np.full(self.size, q),
            np.full(self.size, v),
            np.full(len(s.beta) - self.p, float(s.depth.max())),
        )
        return np.asarray(np.maximum(1e-3 * self.rtol * np.concatenate(parts), 1e-300))

    def _recorded(self, ends: Array, at: Callable[[Array], Array]) -> Segment:
        """Times, forces and indentations at 0, h/2, h of parts of steps; states at the ends."""
        fraction = np.arange(2 * NODES_A_STEP) / (2 * NODES_A_STEP)
        t = (ends[:-1, None] + np.diff(ends)[:, None] * fraction).ravel()
        t = np.append(t, ends[-1])
        y = at(t).T
        nodes = [self._contact_state(float(time), row) for time, row in zip(t, y, strict=True)]
        force = np.array([f for _, _, f in nodes])
        depth = np.array([free - self.system.R @ f for free, _, f in nodes])
        states = y[::2, : 2 * self.size].reshape(-1, 2, self.size)
        return Segment(t, force, depth, states)


class _TooManyEvaluations(Exception):
    """The limit of evaluations is reached."""
