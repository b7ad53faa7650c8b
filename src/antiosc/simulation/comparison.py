"""Scenes by the methods that the march is compared with, until their forces converge."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from antiosc.base import checks, march
from antiosc.base.errors import InputError
from antiosc.simulation.assembly import Assembly
from antiosc.simulation.convergence import Converged, difference
from antiosc.simulation.engine import Run
from antiosc.simulation.integrators.ivp import METHODS as IVP_METHODS
from antiosc.simulation.integrators.scene_ivp import SceneIVP
from antiosc.simulation.integrators.scene_steps import SCENE_STEPS

#: what runs a scene, by name
METHODS = ("exact", *SCENE_STEPS, *IVP_METHODS)

FIRST = 32  # steps in the shortest contact that is expected, at first
HALVED = 1 / 3  # error left of order 2, of the difference to the run with twice the step
TIGHTER = 100.0  # of solve_ivp's relative tolerance
MOST_RUNS = 14  # runs


def compared(
    assembly: Assembly,
    duration: float,
    method: str,
    tol: float,
    step: float | None,
    max_contacts: int,
    max_steps: int,
) -> Converged:
    """A run by `method` with its estimated errors; with a `step` [s] given, of one run: none."""
    checks.choice("method", method, METHODS)
    if method in IVP_METHODS:
        if step is not None:
            raise InputError(f"{method} chooses its steps itself; give tol instead of step.")
        return _converged(
            lambda rtol, left: _ivp(assembly, method, rtol, duration, max_contacts, left),
            tol / 10,
            TIGHTER,
            1.0,
            tol,
            max_steps,
        )
    kind = SCENE_STEPS[method]
    longest = kind.longest(assembly.system)

    def one(h: float, left: int) -> Run:
        return kind(assembly.system, assembly.laws).run(duration, h, max_contacts, left)

    if step is not None:
        step = checks.positive("step", step, "s")
        found = one(step, max_steps)
        return Converged(found, step, 0.0, 0.0, duration)
    first = min(assembly.lasting / FIRST, duration / FIRST, longest)
    return _converged(one, first, 2.0, HALVED, tol, max_steps)


def _ivp(
    assembly: Assembly, method: str, rtol: float, duration: float, max_contacts: int, left: int
) -> Run:
    # a contact is met by some steps, also one that begins and ends in what was a long step
    longest = min(assembly.lasting / 4, duration / 4)
    solver = SceneIVP(method, max(rtol, 3e-14), assembly.system, assembly.laws, longest)
    return solver.run(duration, max_contacts, left)


def _converged(
    one: Callable[[float, int], Run],
    first: float,
    finer: float,
    left: float,
    tol: float,
    max_steps: int,
) -> Converged:
    """Runs `one(size, steps left)` of ever smaller sizes until the forces of two agree to `tol`."""
    size, used = first, 0
    before: Run | None = None
    best: Converged | None = None
    for _ in range(MOST_RUNS):
        now = one(size, max_steps - used)
        used += now.steps
        if now.answer == march.DONE and before is not None:
            force, peak, certain = difference(before, now, tol / left)
            best = Converged(now, size, left * force, left * peak, certain)
            if max(best.force, best.peak) <= tol:
                return best
        elif now.answer in (march.TOO_MANY_CONTACTS, march.TOO_MANY_STEPS):
            if best is None and before is not None:
                best = Converged(before, size * finer, np.inf, np.inf, 0.0)
            break
        before = now if now.answer == march.DONE else None
        size /= finer
        if finer * now.steps > max_steps - used:
            break
    return best or Converged(now, size, np.inf, np.inf, 0.0)
