"""Scenes by textbook methods, which the exact method is compared with: without friction.

`solve_ivp` of SciPy integrates the modal equations from one touch or release to the next, with the
laws at every call of their right-hand side. Newmark's method (average acceleration) and the
leapfrog (central differences) go through the whole run in equal steps; a touch and a release are
interpolated within a step. Their order is 2, for forces without jumps.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from math import ceil, log2
from typing import Any, NamedTuple

import numpy as np

from antiosc.base import checks
from antiosc.base._types import Array
from antiosc.base.errors import InputError, NotConvergedError
from antiosc.engine import library
from antiosc.engine.contact import ContactLaw
from antiosc.engine.march import Converged, Run, difference
from antiosc.engine.system import System
from antiosc.impact.assembly import Assembly
from antiosc.impact.states import interpolated

IVP_METHODS = ("RK45", "RK23", "DOP853", "Radau", "BDF", "LSODA")
METHODS = ("exact", "newmark", "leapfrog", *IVP_METHODS)

#: Default bounds of a run; a million steps with two anti-oscillators take 6 s.
MAX_CONTACTS = 10_000
MAX_STEPS = 1_000_000


@dataclass(frozen=True)
class Settings:
    """Options of the integration of a scene, as for `Scene.run`."""

    tol: float = 1e-3
    method: str = "exact"
    step: float | None = None
    max_contacts: int = MAX_CONTACTS
    max_steps: int = MAX_STEPS

    def __post_init__(self) -> None:
        checks.choice("method", self.method, METHODS)
        checks.store(
            self,
            tol=checks.tolerance(self.tol),
            max_contacts=checks.whole("max_contacts", self.max_contacts),
            max_steps=checks.whole("max_steps", self.max_steps),
        )

    @property
    def limits(self) -> tuple[int, int]:
        """Largest numbers of contacts and of steps."""
        return self.max_contacts, self.max_steps


def integrate_reference(assembly: Assembly, duration: float, settings: Settings) -> Converged:
    """A run by a method, with its estimated errors; `solve_ivp` has none."""
    if any(contact.friction > 0 for contact in assembly.scene.contacts):
        raise InputError(
            f"the method {settings.method!r} does not take friction: use the method 'exact'."
        )
    if assembly.system.first is not None:
        raise InputError(
            f"{settings.method} knows damping of each mode alone, not one that couples them (a"
            " DampingMatrix, dampers): use the method 'exact'."
        )
    if settings.method in IVP_METHODS:
        return _by_solve_ivp(assembly, duration, settings)

    return _by_fixed_steps(assembly, duration, settings)


SWEEP_TOL = 1e-13  # change of a force in a sweep, relative to the largest
MOST_SWEEPS = 500


class Ends(NamedTuple):
    """Forces, indentations and their rates (m,) at the end of a step."""

    force: Array
    delta: Array
    rate: Array


class Contacts:
    """The contacts of a run: whether each is closed, the state of its law, and the events.

    events : rows [time, contact, 0 parts or 1 touches, closing speed]. R : (m, m) [m/N] compliance
    without inertia. slowest : least speeds (m,) [m/s] of a touch.
    """

    def __init__(
        self,
        laws: Sequence[ContactLaw],
        R: Array,
        closed: Sequence[bool],
        slowest: Sequence[float] | Array,
    ) -> None:
        self.laws = laws
        self.R = R
        self.closed = list(closed)
        self.slowest = slowest
        # none before the first touch
        self.states: list[Any] = [
            laws[c].touch(0.0) if closed else None for c, closed in enumerate(self.closed)
        ]
        self.events: list[tuple[float, int, int, float]] = []
        self.touches = 0

    @property
    def active(self) -> list[int]:
        """The closed contacts."""
        return [c for c, closed in enumerate(self.closed) if closed]

    def origin(self, c: int) -> float:
        """Indentation [m] at which a contact touches and parts."""
        state = self.states[c]
        return 0.0 if state is None else self.laws[c].origin(state)

    def touch(self, c: int, t: float, speed: float) -> None:
        """Close a contact at its closing speed [m/s]."""
        speed = max(speed, float(self.slowest[c]))
        self.states[c] = self.laws[c].touch(speed, self.states[c])
        self.closed[c] = True
        self.touches += 1
        self.events.append((t, c, 1, speed))

    def part(self, c: int, t: float) -> None:
        """Open a contact."""
        self.closed[c] = False
        self.events.append((t, c, 0, 0.0))

    def end_of_step(
        self, t: float, h: float, last: Ends, free: Array, speed: Array, A: Array, A_rate: Array
    ) -> Ends:
        """The end of a step of length h from t, of which `last` is the start.

        free, speed : indentations and rates there without its forces; A, A_rate : what a force
        takes from them, and from rates also by the change of the force.
        """
        for c, closed in enumerate(self.closed):
            origin = self.origin(c)
            if not closed and free[c] > origin:
                share = _crossing(last.delta[c], free[c], origin)
                closing = last.rate[c] + share * (speed[c] - last.rate[c])
                self.touch(c, t + share * h, float(closing))

        rate = speed + self.R @ last.force / h
        F = self.forces(free, A, rate, A_rate)
        end = Ends(F, free - A @ F, rate - A_rate @ F)

        for c in self.active:
            moved = float(end.delta[c]), float(end.rate[c])
            self.states[c] = self.laws[c].advance(*moved, self.states[c])
            if F[c] == 0.0 and end.delta[c] <= (origin := self.origin(c)):
                self.part(c, t + _crossing(last.delta[c], end.delta[c], origin) * h)
        return end

    def forces(self, free: Array, A: Array, rate: Array, A_rate: Array) -> Array:
        """F (m,) with F = law(free - A F, rate - A_rate F) of the closed contacts, by sweeps."""
        F = np.zeros(len(free))
        active = self.active

        for _ in range(MOST_SWEEPS if len(active) > 1 else 1):
            before = F.copy()
            for c in active:
                unloaded = float(free[c] - A[c] @ F + A[c, c] * F[c])
                slope = float(rate[c] - A_rate[c] @ F + A_rate[c, c] * F[c])
                slopes = float(A[c, c]), slope, float(A_rate[c, c])
                F[c] = self.laws[c].implicit(unloaded, *slopes, self.states[c], float(F[c]))
            change = np.abs(F - before).max(initial=0.0)
            if len(active) < 2 or not change > SWEEP_TOL * np.abs(F).max():
                return F

        raise NotConvergedError(
            f"the forces of {len(active)} contacts have not converged after {MOST_SWEEPS} sweeps;"
            " use the method 'exact' or a smaller step."
        )


def contacts_of(s: System) -> Contacts:
    """The contacts of a system at its start."""
    return Contacts(s.laws, s.R, s.closed.tolist(), s.slowest)


def _run(s: System, contacts: Contacts, nodes: tuple[Array, ...], answer: int, steps: int) -> Run:
    """The run with these nodes (time, force, depth, states)."""
    events = np.array(contacts.events, dtype=float).reshape(-1, 4)
    start = s.contact_energy + float(library.energies(nodes[3][:1], s.omega)[0])
    time, force, depth, states = nodes
    ended = {"answer": answer, "steps": steps, "attempts": steps, "touches": contacts.touches}
    return Run(time, force, depth, states, events, highest=start, **ended)


# -- fixed steps

FIRST_STEPS = 24  # steps in the shortest contact that is expected, at first
MOST_RUNS = 24
SAFETY_STEP = 0.9  # of the leapfrog's limit of stability, h omega = 2
#: Displacements and velocities at the end of a step without the force there, from those at its
#: start, the modal forces there and the loads at its end.
Predict = Callable[[Array, Array, Array, Array], tuple[Array, Array]]


def newmark(s: System, h: float) -> tuple[Array, Array, Predict]:
    """Average acceleration: what a force at the end of a step takes from displacements (m, J) and
    velocities, and the motion without it.
    """
    x = s.omega**2
    scale = 1 + h * s.decay + h * h * x / 4
    slower = h / 2 * s.beta / scale

    def predict(q: Array, v: Array, pull: Array, load: Array) -> tuple[Array, Array]:
        a = pull - x * q - 2 * s.decay * v
        v1 = (v + h / 2 * (a + load - x * (q + h / 2 * v))) / scale
        return q + h / 2 * (v + v1), v1

    return h / 2 * slower, slower, predict


def leapfrog(s: System, h: float) -> tuple[Array, Array, Predict]:
    """Central differences, as `newmark`: the force at the end changes velocities alone."""
    x = s.omega**2
    scale = 1 + h * s.decay

    def predict(q: Array, v: Array, pull: Array, load: Array) -> tuple[Array, Array]:
        half = v + h / 2 * (pull - x * q - 2 * s.decay * v)
        q1 = q + h * half
        return q1, (half + h / 2 * (load - x * q1)) / scale

    return np.zeros_like(s.beta), h / 2 * s.beta / scale, predict


FIXED_STEPS = {"newmark": newmark, "leapfrog": leapfrog}


def fixed_steps(
    method: str, s: System, step: float, duration: float, limits: tuple[int, int]
) -> Run:
    """A run in equal steps of at most `step` [s]."""
    count = ceil(duration / step * (1 - 1e-12))
    h = duration / count
    times = np.linspace(0.0, duration, count + 1)
    loads, gaps = (interpolated(times, s.breaks, values) for values in (s.loads, s.offsets))

    less, slower, predict = FIXED_STEPS[method](s, h)
    A = s.R + less @ s.beta.T
    A_rate = slower @ s.beta.T + s.R / h

    contacts = contacts_of(s)
    q, v = s.q, s.v
    force = np.asarray(s.pressed, dtype=float)
    end = Ends(force, s.beta @ q - gaps[0] - s.R @ force, s.beta @ v)
    states, ends = [(q, v)], [end]
    status = library.DONE
    for k in range(count):
        if k >= limits[1]:
            status = library.TOO_MANY_STEPS
        if status != library.DONE:
            break

        q, v = predict(q, v, loads[k] - end.force @ s.beta, loads[k + 1])
        free = s.beta @ q - gaps[k + 1]
        end = contacts.end_of_step(times[k], h, end, free, s.beta @ v, A, A_rate)
        q, v = q - end.force @ less, v - end.force @ slower

        if not np.isfinite(end.force).all():
            status = library.GREW
        elif contacts.touches > limits[0]:
            status = library.TOO_MANY_CONTACTS
        states.append((q, v))
        ends.append(end)

    arrays = _with_middles(times[: len(ends)], ends)
    return _run(s, contacts, (*arrays, np.array(states)), status, len(ends) - 1)


def _crossing(before: float, after: float, origin: float) -> float:
    """Share of a step after which a straight line between two values reaches `origin`."""
    if before == after:
        return 0.0
    return min(max((before - origin) / (before - after), 0.0), 1.0)


def _with_middles(times: Array, nodes: Sequence[Ends]) -> list[Array]:
    """Time, force and depth of a run; a parabola has the mean of the forces of its ends."""
    columns = [times, [n.force for n in nodes], [n.delta for n in nodes]]
    arrays = []
    for ends in map(np.asarray, columns):
        values = np.empty((2 * len(ends) - 1, *ends.shape[1:]))
        values[::2] = ends
        values[1::2] = (ends[:-1] + ends[1:]) / 2
        arrays.append(values)

    return arrays


def _by_fixed_steps(assembly: Assembly, duration: float, settings: Settings) -> Converged:
    """A run in the given step, or in one that meets the tolerance."""
    s = assembly.system
    method = settings.method
    top = float(s.omega.max(initial=0.0))
    longest = SAFETY_STEP * 2 / top if method == "leapfrog" and top > 0 else np.inf
    step = settings.step or min(assembly.contact_time_estimate / FIRST_STEPS, longest, duration / 2)
    if step > longest / SAFETY_STEP:
        raise InputError(
            f"leapfrog is unstable with steps above {longest / SAFETY_STEP:.3g} s, 2 over the"
            " highest frequency: take a shorter step, or the method 'exact'."
        )
    most = max(settings.max_steps, MAX_STEPS) if settings.step else settings.max_steps
    if (count := duration / step) > most:
        raise InputError(
            f"{method} needs steps of {step:.3g} s, {count:.3g} of them, more than max_steps ="
            f" {most}: take a longer step, or use the method 'exact'."
        )

    def run_with(h: float) -> Run:
        return fixed_steps(method, s, h, duration, settings.limits)

    if settings.step is not None:
        return Converged(run_with(step), step, 0.0, 0.0, duration)
    return _converged(run_with, step, settings)


def _converged(run_with: Callable[[float], Run], step: float, settings: Settings) -> Converged:
    """Runs with shorter and shorter steps until two agree: the error is their difference."""
    tol = settings.tol
    coarse = run_with(step)
    force = peak = np.inf
    certain = 0.0
    halvings = 1.0

    for _ in range(MOST_RUNS):
        stopped = coarse.touches >= settings.max_contacts
        if stopped or 2**halvings * coarse.steps > settings.max_steps:
            break
        step /= 2**halvings
        finer = run_with(step)
        if coarse.answer != library.GREW and finer.answer != library.GREW:
            force, peak, certain = difference(coarse, finer, tol)
        coarse, worst = finer, max(force, peak)
        if worst <= tol:
            break
        halvings = min(max(log2(worst / tol) / 2, 1.0), 2.0)  # of order 2

    return Converged(coarse, step, force, max(force, peak), certain)


# -- solve_ivp

IVP_STEP = 1 / 10  # of the shortest contact: none is stepped over
IVP_TOL = 1e-2  # relative tolerance, of that of the forces
LEAST_IVP_TOL = 3e-14  # one that rounding permits
NODES_A_STEP = 4  # parabolas of the forces for each step of the solver
EVALUATIONS = 20  # most evaluations of the right-hand side per allowed step
SAME_TIME = 1e-13  # of the duration
MOST_IDLE = 200  # events at the same time


def _by_solve_ivp(assembly: Assembly, duration: float, settings: Settings) -> Converged:
    """One run by a method of SciPy, to `IVP_TOL` times the tolerance."""
    method = settings.method
    R = assembly.system.R
    for c, law in enumerate(assembly.laws):
        if law.has_memory:
            raise InputError(
                f"{method} does not take {type(law).__name__}, a law that remembers how deep it"
                " was: use the method 'exact' or 'newmark'."
            )
        if law.rate_dependent and R[c, c] > 0:
            raise InputError(
                f"{method} does not support a rate-dependent law at a massless contact point"
                " (m0 = 0), where the force depends on its own derivative; use the method 'exact'."
            )

    longest = settings.step or IVP_STEP * assembly.contact_time_estimate
    solver = Solver(assembly.system, settings, longest)
    return Converged(solver.run(duration), longest, 0.0, 0.0, duration)


class Solver:
    """`solve_ivp` from event to event: a contact touches or parts, a load has a corner."""

    def __init__(self, system: System, settings: Settings, longest: float) -> None:
        self.system = system
        self.contacts = contacts_of(system)
        self.settings = settings
        self.longest = longest
        self.evaluations = 0

    def run(self, duration: float) -> Run:
        """The whole run."""
        s = self.system
        y = np.concatenate((s.q, s.v))
        pieces = [self._recorded(np.zeros(1), lambda _: y[:, None])]
        status = library.DONE
        t, steps, idle = 0.0, 0, 0

        while status == library.DONE and duration - t > SAME_TIME * duration:
            piece, end, y, events = self._solved(t, y, duration)
            pieces.append(piece)
            steps += len(piece[3]) // NODES_A_STEP
            idle = idle + 1 if end - t <= SAME_TIME * duration else 0
            t = end

            rate = self.at(t, y)[1]
            for c in events:
                if self.contacts.closed[c]:
                    self.contacts.part(c, t)
                else:
                    self.contacts.touch(c, t, float(rate[c]))
            if self.contacts.touches > self.settings.max_contacts:
                status = library.TOO_MANY_CONTACTS
            elif steps > self.settings.max_steps:
                status = library.TOO_MANY_STEPS
            elif idle > MOST_IDLE:
                status = library.STUCK

        columns = zip(*pieces, strict=True)
        nodes = [np.concatenate([first, *(more[1:] for more in rest)]) for first, *rest in columns]
        return _run(s, self.contacts, tuple(nodes), status, steps)

    def at(self, t: float, y: Array) -> tuple[Array, Array, Array, Array]:
        """Indentations without contact forces, their rates, the forces and the loads at time t."""
        s = self.system
        n = s.omega.size
        free, rate = s.beta @ y[:n], s.beta @ y[n:]
        gap, drift, load = s.offsets[0], 0.0, s.loads[0]
        if s.breaks.size > 1:
            k = min(max(int(np.searchsorted(s.breaks, t, side="right")) - 1, 0), s.breaks.size - 2)
            span = s.breaks[k + 1] - s.breaks[k]
            share = min((t - s.breaks[k]) / span, 1.0)
            gap = s.offsets[k] + share * (s.offsets[k + 1] - s.offsets[k])
            drift = (share < 1) * (s.offsets[k + 1] - s.offsets[k]) / span
            load = s.loads[k] + share * (s.loads[k + 1] - s.loads[k])

        free = free - gap
        rate = rate - drift
        return free, rate, self.contacts.forces(free, s.R, rate, 0.0 * s.R), load

    def _slope(self, t: float, y: Array) -> Array:
        """Right-hand side of the equations."""
        s = self.system
        self.evaluations += 1
        if self.evaluations > EVALUATIONS * self.settings.max_steps:
            raise NotConvergedError(
                f"{self.settings.method} takes more than max_steps = {self.settings.max_steps}:"
                " use the method 'exact'."
            )

        n = s.omega.size
        _, _, force, load = self.at(t, y)
        q, v = y[:n], y[n:]
        return np.concatenate((v, load - force @ s.beta - s.omega**2 * q - 2 * s.decay * v))

    def _solved(self, t: float, y: Array, duration: float) -> tuple[Any, float, Array, list[int]]:
        """The nodes, end, state and the contacts that touch or part, up to the next event or corner
        of a load.
        """
        from scipy.integrate import solve_ivp  # loaded where it is used: it takes long

        s = self.system
        until = min(duration, *s.breaks[s.breaks > t * (1 + SAME_TIME)].tolist(), np.inf)
        reach = np.abs(s.beta).max(axis=1)
        reach = np.where(reach > 0, reach, 1.0)
        sizes = [np.full(s.omega.size, np.max(motion / reach)) for motion in (s.depth, s.speed)]
        rtol = max(IVP_TOL * self.settings.tol, LEAST_IVP_TOL)
        with np.errstate(all="ignore"):
            found = solve_ivp(
                self._slope,
                (t, until),
                y,
                method=self.settings.method,
                rtol=rtol,
                atol=np.maximum(1e-3 * rtol * np.concatenate(sizes), 1e-300),
                max_step=self.longest,
                events=[self._event(c) for c in range(len(self.contacts.closed))],
                dense_output=True,
            )
        if found.status < 0:
            raise NotConvergedError(f"{found.message} Use the method 'exact'.")

        end = float(found.t[-1])
        events = [c for c, times in enumerate(found.t_events) if times.size and times[-1] == end]
        return self._recorded(found.t, found.sol), end, found.y[:, -1], events

    def _event(self, c: int) -> Callable[[float, Array], float]:
        """A contact touches, or a closed one parts."""
        closed = self.contacts.closed[c]
        rest = 1e-300 if closed else -1e-300  # at its origin it neither touches nor parts

        def excess(t: float, y: Array) -> float:
            free, _, force, _ = self.at(t, y)
            others = self.system.R[c] @ force - self.system.R[c, c] * force[c]
            return float(free[c] - others) or rest

        excess.terminal = True  # type: ignore[attr-defined]
        excess.direction = -1.0 if closed else 1.0  # type: ignore[attr-defined]
        return excess

    def _recorded(self, ends: Array, at: Callable[[Array], Array]) -> tuple[Array, ...]:
        """Time, force, depth, states of the steps with these ends, each in `NODES_A_STEP`."""
        share = np.arange(2 * NODES_A_STEP) / (2 * NODES_A_STEP)
        t = np.append((ends[:-1, None] + np.diff(ends)[:, None] * share).ravel(), ends[-1])
        y = at(t).T
        found = [self.at(float(time), row) for time, row in zip(t, y, strict=True)]
        force = np.array([F for _, _, F, _ in found])
        depth = np.array([free for free, *_ in found]) - force @ self.system.R
        return t, force, depth, y[::2].reshape(-1, 2, self.system.omega.size)
