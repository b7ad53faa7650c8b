"""Scenes by the methods that the march is compared with, refined to a tolerance.

Newmark's method, the conserving midpoint rule and leapfrog have a fixed step. The first touch after
a flight and the last release before one are located exactly. If a contact touches or parts while
another is closed, its time and closing speed are interpolated within a step. The order is 2 for
forces without jumps.
"""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cached_property
from math import isfinite, log, log2
from typing import ClassVar, NamedTuple

import numpy as np

from antiosc.base import checks
from antiosc.base._types import Array
from antiosc.base.errors import InputError
from antiosc.engine import library
from antiosc.engine.contact import ContactLaw, State
from antiosc.engine.march import Converged, Run, difference
from antiosc.engine.system import System
from antiosc.impact.assembly import Assembly
from antiosc.impact.reference_ivp import IVP_METHODS, SAME_TIME, SceneIVP, SceneMethod, Segment

#: A run is unstable if its energy exceeds this multiple of the initial and supplied energy; a
#: smaller excess may be the error of a coarse step.
BLOW_UP = 2.0
#: rounding of a difference quotient of potentials, relative to the force
QUOTIENT = 1e-9


class Step(NamedTuple):
    """The end of a step; `mean` (m,): constant forces with the impulse of the step."""

    q: Array
    v: Array
    force: Array
    delta: Array
    rate: Array
    mean: Array


class StepLoads(NamedTuple):
    """Modal loads (J,) at the start and the end of a step, and gaps (m,) at its end."""

    load: Array
    load1: Array
    gap1: Array


class SceneStep(SceneMethod):
    """Base of one-step methods with a fixed `step` [s] after each first touch."""

    name: ClassVar[str]
    order: ClassVar[int] = 2

    @cached_property
    def square(self) -> Array:
        """omega^2 [rad^2/s^2]."""
        return self.system.omega**2

    @cached_property
    def moved_modes(self) -> Array:
        """1 for modes that contacts move, 0 for others, whose energy would hide an instability."""
        return np.any(self.system.beta != 0, axis=0).astype(float)

    @abstractmethod
    def advance(self, start: Step, acting: StepLoads, h: float) -> Step:
        """Advance the state by one step of length h [s]."""

    def acceleration(self, at: Step, load: Array) -> Array:
        """Accelerations (J,) of the modes in a state under modal loads (J,)."""
        s = self.system
        forced = load - at.force @ s.beta
        return np.asarray(forced - self.square * at.q - 2 * s.decay * at.v)

    @staticmethod
    def longest(system: System) -> float:
        """The longest stable step [s]."""
        return np.inf

    def integrate_contact(
        self, t: float, begin: Array, force: Array, end: float, max_contacts: int, max_steps: int
    ) -> tuple[Segment, int]:
        """Integrate while a contact is closed; see `SceneMethod`."""
        s = self.system
        contacts = self.contacts
        q, v = begin
        gap = self.loads_at(t)[1]
        node = Step(q, v, force, s.beta @ q - gap - s.R @ force, s.beta @ v, force)
        nodes = [node]
        times = [t]
        status = library.DONE
        work = 0.0
        start = self._energy(node) + (s.contact_energy if t == 0.0 else 0.0)
        with np.errstate(over="ignore", invalid="ignore"):
            while self.busy and end - t > SAME_TIME * end and status == library.DONE:
                if self.steps >= max_steps:
                    status = library.TOO_MANY_STEPS
                    break
                h, new, step_loads = self._step(node, t, min(self.step, end - t))
                work += float(
                    0.5 * (step_loads.load + step_loads.load1) * self.moved_modes @ (new.q - node.q)
                )
                kick = 0.5 * float((h * step_loads.load1) ** 2 @ self.moved_modes)
                self.highest = max(self.highest, start + work + kick)  # at rest, all that is given
                if not self._energy(new) <= BLOW_UP * self.highest:
                    status = library.GREW
                    break
                if contacts.touches > max_contacts:
                    status = library.TOO_MANY_CONTACTS
                self.steps += 1
                node = new
                t += h
                nodes.append(node)
                times.append(t)
        return _segment_of(np.array(times), nodes), status

    def move_anchors(self, start: Step, end: Step) -> None:
        """Move the anchors of friction by the sliding of a step."""
        self.contacts.move_anchors(end.delta, end.force)

    def _energy(self, node: Step) -> float:
        """Energy [J] of the modes that contacts move."""
        return 0.5 * float((node.v**2 + self.square * node.q**2) @ self.moved_modes)

    def _step_loads(self, t: float, h: float) -> StepLoads:
        """The loads of a step of length h from t."""
        load1, gap1, _ = self.loads_at(t + h)
        return StepLoads(self.loads_at(t)[0], load1, gap1)

    def _step(self, node: Step, t: float, h: float) -> tuple[float, Step, StepLoads]:
        """Take one step of at most h; it ends where the last contact parts."""
        contacts = self.contacts
        step_loads = self._step_loads(t, h)
        new = self.advance(node, step_loads, h)
        touching = [
            c for c in range(self.p) if not contacts.closed[c] and new.delta[c] > contacts.origin(c)
        ]
        for c in touching:
            fraction = _crossing(node.delta[c], new.delta[c], contacts.origin(c))
            speed = node.rate[c] + fraction * (new.rate[c] - node.rate[c])
            displacement = node.delta + fraction * (new.delta - node.delta)
            contacts.touch(c, t + fraction * h, float(speed), displacement)
        if touching:
            new = self.advance(node, step_loads, h)
        closed = contacts.active
        parted = [c for c in closed if new.force[c] == 0.0 and new.delta[c] <= contacts.origin(c)]
        if parted == closed and not self.driven:
            h, new, step_loads = self._release(node, t, h, new, closed)
        self.move_anchors(node, new)
        contacts.advance(new.delta, new.rate)
        for c in parted:
            fraction = _crossing(node.delta[c], new.delta[c], contacts.origin(c))
            contacts.part(c, t + fraction * h)
        return h, new, step_loads

    def _release(
        self, node: Step, t: float, h: float, last: Step, closed: list[int]
    ) -> tuple[float, Step, StepLoads]:
        """As `_step`, for a step shortened to the time at which the last closed contact reaches its
        origin.
        """
        from scipy.optimize import brentq  # loaded where it is used: it takes long

        def excess(delta: Array) -> float:
            """Largest indentation of the closed contacts above their origins."""
            return max(float(delta[c]) - self.contacts.origin(c) for c in closed)

        def excess_at(fraction: float) -> float:
            """Largest indentation of the closed contacts above their origins at a fraction of the
            step.
            """
            return excess(self.advance(node, self._step_loads(t, fraction), fraction).delta)

        if excess(node.delta) <= 0 or excess_at(1e-9 * h) <= 0:
            return h, last, self._step_loads(t, h)
        fraction = float(brentq(excess_at, 1e-9 * h, h, xtol=1e-18, rtol=1e-13, maxiter=500))
        step_loads = self._step_loads(t, fraction)
        new = self.advance(node, step_loads, fraction)
        return fraction, new._replace(force=np.zeros_like(new.force)), step_loads


def _crossing(before: float, after: float, origin: float) -> float:
    """Fraction of a step after which a straight line between two values reaches `origin`."""
    if before == after:
        return 0.0
    return min(max((before - origin) / (before - after), 0.0), 1.0)


class NewmarkScene(SceneStep):
    """Newmark's average acceleration; all forces at the end of the step are found implicitly."""

    name = "newmark"

    def advance(self, start: Step, acting: StepLoads, h: float) -> Step:
        s = self.system
        x = self.square
        q = start.q
        v = start.v
        F = start.force
        scale = 1 + h * s.decay + h * h * x / 4
        a = self.acceleration(start, acting.load)
        v1 = (v + h / 2 * (a + acting.load1 - x * (q + h / 2 * v))) / scale
        q1 = q + h / 2 * (v + v1)
        response = h / 2 * s.beta / scale  # how unit forces at the end slow the modes
        gain = response @ s.beta.T
        A = s.R + h / 2 * gain
        A_rate = gain + s.R / h
        free = s.beta @ q1 - acting.gap1
        rate = s.beta @ v1 + s.R @ F / h
        F1 = self.contacts.forces(free, A, rate, A_rate, F)
        return Step(
            q1 - h / 2 * F1 @ response,
            v1 - F1 @ response,
            F1,
            free - A @ F1,
            rate - A_rate @ F1,
            (F + F1) / 2,
        )


class LeapfrogScene(SceneStep):
    """Central differences: explicit, except for rows with a residual compliance."""

    name = "leapfrog"
    #: step over the stability limit, h omega_max = 2
    SAFETY: ClassVar[float] = 0.9

    @staticmethod
    def longest(system: System) -> float:
        top = float(system.omega.max(initial=0.0))
        if top > 0:
            return LeapfrogScene.SAFETY * 2 / top
        return np.inf

    def advance(self, start: Step, acting: StepLoads, h: float) -> Step:
        s = self.system
        F = start.force
        half = start.v + h / 2 * self.acceleration(start, acting.load)
        q1 = start.q + h * half
        scale = 1 + h * s.decay
        v1 = (half + h / 2 * (acting.load1 - self.square * q1)) / scale
        response = h / 2 * s.beta / scale
        A_rate = response @ s.beta.T + s.R / h
        free = s.beta @ q1 - acting.gap1
        rate = s.beta @ v1 + s.R @ F / h
        F1 = self.contacts.forces(free, s.R, rate, A_rate, F)
        return Step(q1, v1 - F1 @ response, F1, free - s.R @ F1, rate - A_rate @ F1, (F + F1) / 2)


class Quotient:
    """Mean contact force over a step h from the change of the unloaded indentation since `before`.

    The unloaded indentation is delta + r F, with r the residual compliance in series.
    """

    def __init__(self, law: ContactLaw, r: float, state: State, before: float, h: float) -> None:
        self.law = law
        self.r = r
        self.state = state
        self.before = before
        self.h = h
        self.start = self._potential(before)

    def solve(self, free: float, alpha: float) -> float:
        """Solve F = mean(free - alpha F), whose right-hand side does not rise with F."""
        high = self.mean(free)
        if high <= 0.0:
            return 0.0

        from scipy.optimize import brentq  # loaded where it is used: it takes long

        def excess(F: float) -> float:
            return F - self.mean(free - alpha * F)

        if excess(high) <= 0.0:  # by rounding, when alpha F is nothing beside the indentation
            return high
        return float(brentq(excess, 0.0, high, xtol=1e-300, rtol=1e-15, maxiter=2000))

    def mean(self, after: float) -> float:
        law = self.law
        change = after - self.before
        energy, force = self._potential(after)
        energy0, force0 = self.start
        if abs(change) > 1e-5 * max(abs(after), abs(self.before)):
            F = (energy - energy0) / change
        else:
            F = 0.5 * (force + force0)
        if law.rate_dependent:
            middle = 0.5 * (after + self.before)
            F = max(F + law.damping(middle, change / self.h, self.state), 0.0)
        return F

    def _potential(self, free: float) -> tuple[float, float]:
        """Energy of a contact in series with its residual compliance, and its force."""
        F = self.law.implicit(free, self.r, 0.0, 0.0, self.state)
        delta = free - self.r * F
        return self.law.potential(delta, self.state) + 0.5 * self.r * F * F, F


class ConservingScene(SceneStep):
    """Midpoint rule that takes the difference quotient of each contact's potential as its force."""

    name = "conserving"

    def __init__(
        self, system: System, laws: Sequence[ContactLaw], step: float, driven: bool = False
    ) -> None:
        super().__init__(system, laws, step, driven)
        p = self.p
        R = system.R
        if np.any(R - np.diag(R.diagonal())) or np.any(R[p:, p:]):
            raise InputError(
                "the method 'conserving' does not support a residual compliance that couples "
                "contacts,"
                " whose potential is no sum over them; use the method 'exact' or 'newmark'."
            )
        if any(law.rate_dependent and R[c, c] > 0 for c, law in enumerate(laws)):
            raise InputError(
                "the method 'conserving' does not support a rate-dependent law at a massless "
                "contact point (m0 = 0), which has no potential; use the method 'exact'."
            )

    def advance(self, start: Step, acting: StepLoads, h: float) -> Step:
        s = self.system
        x = self.square
        d = self.system.decay
        q = start.q
        v = start.v
        stiff = h * d + h * h * x / 4
        load = (acting.load + acting.load1) / 2
        v1 = (v * (1 - stiff) + h * (load - x * q)) / (1 + stiff)
        q1 = q + h / 2 * (v + v1)
        response = h * s.beta / (1 + stiff)
        A = h / 2 * response @ s.beta.T
        free_before = start.delta + s.R @ start.force
        free = s.beta @ q1 - acting.gap1
        mean = self._means(free_before, free, A, start.mean, h)
        q1 = q1 - h / 2 * mean @ response
        v1 = v1 - mean @ response
        delta_end = free - A @ mean
        force = self._nodal(delta_end, s.beta @ v1, mean)
        return Step(q1, v1, force, delta_end - s.R @ force, (delta_end - free_before) / h, mean)

    def _means(self, before: Array, free: Array, A: Array, guess: Array, h: float) -> Array:
        """Mean forces (m,) over the step, by sweeps over the contacts."""
        contacts = self.contacts
        R = self.system.R.diagonal().tolist()
        F = np.zeros_like(guess)
        quotients = {}
        for c in contacts.active:
            F[c] = max(guess[c], 0.0)
            quotients[c] = Quotient(self.laws[c], R[c], contacts.state(c), float(before[c]), h)

        def sweep(c: int) -> None:
            unloaded = float(free[c] - A[c] @ F + A[c, c] * F[c])
            F[c] = quotients[c].solve(unloaded, float(A[c, c]))
            contacts.friction(c, (before + free) / 2, A / 2, F)  # the spring at mid-step

        return contacts.settled(sweep, F, QUOTIENT)

    def move_anchors(self, start: Step, end: Step) -> None:
        self.contacts.move_anchors((start.delta + end.delta) / 2, end.mean)

    def _nodal(self, after: Array, rate: Array, mean: Array) -> Array:
        """Forces (m,) by the laws at the end of the step."""
        force = np.zeros_like(mean)
        for c in self.contacts.active:
            r = float(self.system.R[c, c])
            state = self.contacts.state(c)
            force[c] = self.laws[c].implicit(float(after[c]), r, float(rate[c]), 0.0, state)
            rows = self.contacts.tangents(c)
            force[rows] = self.contacts.within_cone(c, mean[rows], force[c])
        return force


def _segment_of(times: Array, nodes: list[Step]) -> Segment:
    """Segment of parabolas with the impulses of the steps; their work is that of a straight
    path.
    """
    n = len(nodes) - 1
    m = len(nodes[0].force)
    time = np.empty(2 * n + 1)
    force = np.empty((2 * n + 1, m))
    depth = np.empty((2 * n + 1, m))
    time[::2] = times
    force[::2] = [node.force for node in nodes]
    depth[::2] = [node.delta for node in nodes]
    if n:
        time[1::2] = (times[:-1] + times[1:]) / 2
        mean = np.array([node.mean for node in nodes[1:]])
        force[1::2] = (6 * mean - force[:-1:2] - force[2::2]) / 4
        depth[1::2] = (depth[:-1:2] + depth[2::2]) / 2
    return Segment(time, force, depth, np.array([(node.q, node.v) for node in nodes]))


#: the methods by name
SCENE_STEPS: dict[str, type[SceneStep]] = {
    method.name: method for method in (NewmarkScene, ConservingScene, LeapfrogScene)
}


#: names of all methods
METHODS = ("exact", *SCENE_STEPS, *IVP_METHODS)

#: Default bounds of a run; a million steps with two anti-oscillators take 6 s.
MAX_CONTACTS = 10_000
MAX_STEPS = 1_000_000
FIRST_STEPS = 24  # steps in the shortest contact that is expected, at first
MOST_RUNS = 24  # each has at least twice the steps of the one before: 20 reach MAX_STEPS
IVP_STEP = 1 / 10  # step of solve_ivp, of the shortest contact: none is stepped over
IVP_TOL = 1e-2  # relative tolerance of solve_ivp, of that of the forces
LEAST_IVP_TOL = 3e-14  # one that rounding permits


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
    """A run by a method, with its estimated errors; there is no estimate for `solve_ivp`.

    For `solve_ivp` the step is the longest.
    """
    system = assembly.system
    laws = assembly.laws
    scene = assembly.scene
    method = settings.method
    tol = settings.tol
    step = settings.step
    limits = settings.limits
    driven = bool(scene.loads) or scene.base is not None
    if method in IVP_METHODS:
        longest = step or IVP_STEP * assembly.contact_time_estimate
        solver = SceneIVP(method, max(IVP_TOL * tol, LEAST_IVP_TOL), system, laws, longest, driven)
        marched = solver.run(duration, *limits)
        return Converged(marched, longest, 0.0, 0.0, duration)
    if system.first is not None:
        raise InputError(
            f"{method} knows damping of each mode alone, not one that couples them (a "
            "DampingMatrix, dampers): use the method 'exact' or 'DOP853'."
        )
    kind = SCENE_STEPS[method]

    def run_with(h: float) -> Run:
        return kind(system, laws, h, driven).run(duration, *limits)

    longest = kind.longest(system)
    first = step or min(assembly.contact_time_estimate / FIRST_STEPS, longest)
    # a given step may stop at a lower max_steps, soon
    step_limit = max(settings.max_steps, MAX_STEPS) if step else settings.max_steps
    if (count := assembly.contact_time_estimate / first) > step_limit:
        raise InputError(
            f"{method} {'has' if step else 'needs'} steps of {first:.3g} s, {count:.3g} of them in "
            f"one contact, more than max_steps = {step_limit}; "
            f"{'take a longer step, or ' if step else ''}use the method 'exact'."
        )
    if step is not None:
        return Converged(run_with(step), step, 0.0, 0.0, duration)
    return _converged(run_with, first, longest, settings)


def _converged(
    run_with: Callable[[float], Run], step: float, longest: float, settings: Settings
) -> Converged:
    """Repeat `run_with(step)` with smaller and smaller steps until the forces converge.

    A run that diverged is not compared with the next one.
    """
    tol = settings.tol
    coarse = run_with(step)
    control = Refinement(tol)
    certain = 0.0
    for _ in range(MOST_RUNS):
        factor = 2**control.halvings
        if factor * coarse.steps > settings.max_steps or coarse.touches >= settings.max_contacts:
            break
        finer = min(step / factor, longest)
        finer_run = run_with(finer)
        control.halvings = log2(step / finer)
        diverged = coarse.answer == library.GREW
        if finer_run.answer == library.GREW and not diverged:
            control.halvings += 1
            continue
        if not diverged:
            force, peak, certain = difference(coarse, finer_run, tol)
            control.update(force, peak)
        coarse = finer_run
        step = finer
        if control.reached and finer_run.answer == library.DONE:
            break
    return Converged(coarse, step, control.error["force"], control.error["peak"], certain)


# -- control of the error: that of the finer of two runs from their difference

# A halving of the step divides the error by 4 in the ideal case; less than 1.5 is not convergence.
_SECOND_ORDER = 1 / 4
_SLOWEST_RATE = 2 / 3
_MOST_HALVINGS = 4.0  # at once: over more of them the rate of convergence changes
_AIM = 0.7  # share of the tolerance that the next run is aimed at
_SAFETY = 1.5  # on an extrapolated error until two rates agree
_LEAST = 0.05  # rates below this are not told apart
_AGREE = 0.1  # relative difference of two rates that confirm each other


class Refinement:
    """Estimated errors of a sequence of successively finer runs, and the next refinement.

    If every halving of the step multiplies the error by rho, two runs k halvings apart differ by
    D = e (1 - rho^k)/rho^k, e being the error of the finer one. Two successive differences give
    rho; before that e = D is taken, while the next step is chosen as for second order.

    A single rate may be accidental, if a yield point or a release lies between two steps. An
    extrapolated error is therefore multiplied by 1.5 until two successive rates agree. The peak is
    one value of the force, and its differences change sign from step to step; its error is never
    taken below that of the force. tests/simulation/test_error_budget.py measures how often the
    estimates cover the true errors.
    """

    def __init__(self, tol: float) -> None:
        self.tol = tol
        self.halvings = 1.0  # between the last run and the next
        self.error = {"force": float("inf"), "peak": float("inf")}
        self._before: tuple[float, float] | None = None
        self._rate = 0.0  # the last one found

    @property
    def reached(self) -> bool:
        """Whether the last run meets the tolerance."""
        return max(self.error.values()) <= self.tol

    def update(self, force: float, peak: float) -> None:
        """Add the relative differences between the last two runs."""
        k = self.halvings
        before = self._before if force > 0 else None
        rate = _SECOND_ORDER if before is None else _rate(force / before[0], before[1], k)
        rho = max(rate, _SECOND_ORDER)
        ratio = rho**k / (1 - rho**k)
        remaining_share = 1.0
        if before is not None:
            proven = abs(rate - self._rate) <= _AGREE * rho and rate >= (1 - _AGREE) * _SECOND_ORDER
            remaining_share = (1.0 if proven else _SAFETY) * ratio
            self._rate = rate
        self.error = {"force": force * remaining_share, "peak": max(force, peak) * remaining_share}
        self._before = (force, k) if force > 0 else None
        aim = max(force, peak) * ratio / (_AIM * self.tol)
        if aim > 1 and isfinite(aim):
            self.halvings = min(max(log(aim) / log(1 / rho), 1.0), _MOST_HALVINGS)
        else:
            self.halvings = 1.0


def _rate(ratio: float, before: float, later: float) -> float:
    """Error ratio rho per halving, from the ratio of two successive differences over `before` and
    `later` halvings.
    """
    low = _LEAST
    high = _SLOWEST_RATE
    for _ in range(14):
        rho = 0.5 * (low + high)
        if rho**before * (1 - rho**later) / (1 - rho**before) < ratio:
            low = rho
        else:
            high = rho
    return high
