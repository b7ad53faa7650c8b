"""Scenes by the methods that the march is compared with, to a tolerance."""

from __future__ import annotations

from collections.abc import Callable
from math import log2

from antiosc.base import march
from antiosc.base.errors import InputError
from antiosc.simulation.integrators.scene_ivp import IVP_METHODS, SceneIVP
from antiosc.simulation.integrators.scene_steps import SCENE_STEPS
from antiosc.simulation.march.convergence import Converged, difference
from antiosc.simulation.march.engine import Run
from antiosc.simulation.march.step_control import Refinement
from antiosc.simulation.problem.assembly import Assembly

#: what runs a scene, by name
METHODS = ("exact", *SCENE_STEPS, *IVP_METHODS)

FIRST = 24  # steps in the shortest contact that is expected, at first
MOST_RUNS = 24
LONGEST = 1 / 10  # step of solve_ivp, of the shortest contact: none is stepped over
TIGHTER = 1e-2  # relative tolerance of solve_ivp, of that of the forces
SMALLEST = 3e-14  # one that rounding permits


def compared(
    assembly: Assembly,
    duration: float,
    method: str,
    tol: float,
    step: float | None,
    max_contacts: int,
    max_steps: int,
) -> Converged:
    """A run by `method` with its estimated errors: none of `solve_ivp`, and of a `step` [s] given.

    Of `solve_ivp` the step is the longest.
    """
    system, laws, scene = assembly.system, assembly.laws, assembly.scene
    driven = bool(scene.loads) or scene.base is not None
    if method in IVP_METHODS:
        longest = step or LONGEST * assembly.lasting
        solver = SceneIVP(method, max(TIGHTER * tol, SMALLEST), system, laws, longest, driven)
        found = solver.run(duration, max_contacts, max_steps)
        return Converged(found, longest, 0.0, 0.0, duration)
    if system.first is not None:
        raise InputError(
            f"{method} knows damping of each mode alone, not one that couples them (a "
            "DampingMatrix, dampers): use method='exact' or 'DOP853'."
        )
    kind = SCENE_STEPS[method]

    def one(h: float) -> Run:
        return kind(system, laws, h, driven).run(duration, max_contacts, max_steps)

    if step is not None:
        return Converged(one(step), step, 0.0, 0.0, duration)
    longest = kind.longest(system)
    first = min(assembly.lasting / FIRST, longest)
    if assembly.lasting / first > max_steps:
        raise InputError(
            f"{method} needs steps of {first:.3g} s, {assembly.lasting / first:.3g} of them in one"
            f" contact, more than max_steps = {max_steps}; use method='exact'."
        )
    return _converged(one, first, longest, tol, max_contacts, max_steps)


def _converged(
    one: Callable[[float], Run],
    step: float,
    longest: float,
    tol: float,
    max_contacts: int,
    max_steps: int,
) -> Converged:
    """Runs `one(step)` of ever smaller steps until their forces converge.

    A run that diverged is not used for the error of another.
    """
    coarse, control, certain = one(step), Refinement(tol), 0.0
    for _ in range(MOST_RUNS):
        share = 2**control.halvings
        if share * coarse.steps > max_steps or coarse.touches >= max_contacts:
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
