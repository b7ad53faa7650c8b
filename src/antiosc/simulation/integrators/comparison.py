"""Scenes by the methods that the march is compared with, refined to a tolerance."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from math import isfinite, log, log2

from antiosc.base import checks, march
from antiosc.base.errors import InputError
from antiosc.simulation.integrators.scene_ivp import IVP_METHODS, SceneIVP
from antiosc.simulation.integrators.scene_steps import SCENE_STEPS
from antiosc.simulation.march.convergence import Converged, difference
from antiosc.simulation.march.engine import Run
from antiosc.simulation.problem.assembly import Assembly

#: what runs a scene, by name
METHODS = ("exact", *SCENE_STEPS, *IVP_METHODS)

MAX_CONTACTS, MAX_STEPS = 10_000, 1_000_000
FIRST = 24  # steps in the shortest contact that is expected, at first
MOST_RUNS = 24
LONGEST = 1 / 10  # step of solve_ivp, of the shortest contact: none is stepped over
TIGHTER = 1e-2  # relative tolerance of solve_ivp, of that of the forces
SMALLEST = 3e-14  # one that rounding permits


@dataclass(frozen=True)
class Settings:
    """How a scene is integrated, as `Scene.run` takes it."""

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
        """Of the work: contacts and steps."""
        return self.max_contacts, self.max_steps


def compared(assembly: Assembly, duration: float, settings: Settings) -> Converged:
    """A run by a method with its estimated errors: none of `solve_ivp`, and of a given step.

    Of `solve_ivp` the step is the longest.
    """
    system, laws, scene = assembly.system, assembly.laws, assembly.scene
    method, tol, step, limits = settings.method, settings.tol, settings.step, settings.limits
    driven = bool(scene.loads) or scene.base is not None
    if method in IVP_METHODS:
        longest = step or LONGEST * assembly.lasting
        solver = SceneIVP(method, max(TIGHTER * tol, SMALLEST), system, laws, longest, driven)
        found = solver.run(duration, *limits)
        return Converged(found, longest, 0.0, 0.0, duration)
    if system.first is not None:
        raise InputError(
            f"{method} knows damping of each mode alone, not one that couples them (a "
            "DampingMatrix, dampers): use method='exact' or 'DOP853'."
        )
    kind = SCENE_STEPS[method]

    def one(h: float) -> Run:
        return kind(system, laws, h, driven).run(duration, *limits)

    if step is not None:
        return Converged(one(step), step, 0.0, 0.0, duration)
    longest = kind.longest(system)
    first = min(assembly.lasting / FIRST, longest)
    if assembly.lasting / first > settings.max_steps:
        raise InputError(
            f"{method} needs steps of {first:.3g} s, {assembly.lasting / first:.3g} of them in one"
            f" contact, more than max_steps = {settings.max_steps}; use method='exact'."
        )
    return _converged(one, first, longest, settings)


def _converged(
    one: Callable[[float], Run], step: float, longest: float, settings: Settings
) -> Converged:
    """Runs `one(step)` of ever smaller steps until their forces converge.

    A run that diverged is not used for the error of another.
    """
    tol = settings.tol
    coarse, control, certain = one(step), Refinement(tol), 0.0
    for _ in range(MOST_RUNS):
        share = 2**control.halvings
        if share * coarse.steps > settings.max_steps or coarse.touches >= settings.max_contacts:
            break
        finer = min(step / share, longest)
        fine = one(finer)
        control.halvings = log2(step / finer)
        diverged = coarse.answer == march.GREW
        if fine.answer == march.GREW and not diverged:
            control.halvings += 1
            continue
        if not diverged:
            force, peak, certain = difference(coarse, fine, tol)
            control.update(force, peak)
        coarse, step = fine, finer
        if control.reached and fine.answer == march.DONE:
            break
    return Converged(coarse, step, control.error["force"], control.error["peak"], certain)


# -- control of the error: that of the finer of two runs from their difference

# A halving of the step divides the error by 4 in the ideal case; less than 1.5 is not convergence.
_BEST, _WORST = 1 / 4, 2 / 3
_MOST_HALVINGS = 4.0
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
    taken below that of the force. tests/simulation/test_estimates.py measures how often the
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
        """Add the relative differences of the last two runs, `halvings` apart."""
        k = self.halvings
        before = self._before if force > 0 else None
        rate = _BEST if before is None else _rate(force / before[0], before[1], k)
        rho = max(rate, _BEST)
        likely = rho**k / (1 - rho**k)
        left = 1.0
        if before is not None:
            proven = abs(rate - self._rate) <= _AGREE * rho and rate >= (1 - _AGREE) * _BEST
            left, self._rate = (1.0 if proven else _SAFETY) * likely, rate
        self.error = {"force": force * left, "peak": max(force, peak) * left}
        self._before = (force, k) if force > 0 else None
        aim = max(force, peak) * likely / (_AIM * self.tol)
        if aim > 1 and isfinite(aim):
            self.halvings = min(max(log(aim) / log(1 / rho), 1.0), _MOST_HALVINGS)
        else:
            self.halvings = 1.0


def _rate(ratio: float, before: float, now: float) -> float:
    """rho from the ratio of two successive differences, over `before` and `now` halvings."""
    low, high = _LEAST, _WORST
    for _ in range(14):
        rho = 0.5 * (low + high)
        if rho**before * (1 - rho**now) / (1 - rho**before) < ratio:
            low = rho
        else:
            high = rho
    return high
