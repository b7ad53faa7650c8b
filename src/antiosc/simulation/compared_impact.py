"""Impacts by the integrators that the exact method is compared with, to a tolerance."""

from __future__ import annotations

from collections.abc import Callable
from math import log2

import numpy as np

from antiosc.base._types import Array
from antiosc.base.errors import InputError
from antiosc.simulation.contact_energy import simpson
from antiosc.simulation.integrators import (
    FIXED_STEP,
    IVP_METHODS,
    Integrator,
    Problem,
    SolveIVP,
    Trajectory,
    run,
)
from antiosc.simulation.step_control import Refinement

COARSEST = 24  # steps per estimated contact time, on the coarsest level
MAX_LEVELS = 24


def compared(
    method: str,
    problem: Problem,
    duration: float,
    scale: float,
    step: float | None,
    accuracy: float,
    max_contacts: int,
    max_steps: int,
) -> tuple[Trajectory, float, dict[str, float]]:
    """The run by the named method, its step, and its estimated errors if the step is automatic.

    `scale` is the estimated contact time [s], from which the choice of the step starts.
    """

    def go(integrator: Integrator, fine: float) -> Trajectory:
        return run(problem, integrator, duration, fine, max_contacts)

    error: dict[str, float] = {}
    if method in IVP_METHODS:
        limit = scale / 10 if step is None else step
        trajectory = go(
            SolveIVP(method, max(1e-2 * accuracy, 3e-14), limit, 5 * max_steps), limit / 4
        )
        step = limit
    else:
        make = FIXED_STEP[method]
        if step is None:

            def stable(h: float) -> float:
                return make.stable_step(problem, h, scale / max_steps)

            first = stable(scale / COARSEST)
            if scale / first > max_steps:
                raise InputError(
                    f"{method} needs steps of {first:.3g} s, {scale / first:.3g} of them in one"
                    f" contact, more than max_steps = {max_steps}; use method='exact'."
                )
            trajectory, step, error = _converge(
                lambda h: go(make(h, max_steps), h / 4),
                stable,
                first,
                accuracy,
                max_steps,
                max_contacts,
            )
        else:
            trajectory = go(make(step, max_steps), step / 4)
    return trajectory, step, error


def _converge(
    go: Callable[[float], Trajectory],
    stable: Callable[[float], float],
    step: float,
    tol: float,
    max_steps: int,
    max_contacts: int,
) -> tuple[Trajectory, float, dict[str, float]]:
    """Refine the step until the force has converged; the finest run and its estimated error.

    A run that diverged is not used for the error of another.
    """
    coarse = go(step)
    control = Refinement(tol)
    for _ in range(MAX_LEVELS):
        share = 2**control.halvings
        if share * coarse.evaluations > max_steps or len(coarse.contacts) >= max_contacts:
            break
        finer = stable(step / share)
        fine = go(finer)
        control.halvings = log2(step / finer)
        if fine.diverged and not coarse.diverged:
            control.halvings += 1
            continue
        if not coarse.diverged:
            control.update(*force_difference(coarse, fine))
        coarse, step = fine, finer
        if control.reached and not fine.failure:
            break
    return coarse, step, control.error


def force_difference(coarse: Trajectory, fine: Trajectory) -> tuple[float, float]:
    """Relative difference of two force histories: in the L2 norm and of the peak."""
    nodes = np.union1d(coarse.nodes[0], fine.nodes[0])
    time = np.empty(2 * nodes.size - 1)  # with the middles in between
    time[::2], time[1::2] = nodes, 0.5 * (nodes[1:] + nodes[:-1])
    fa, fb = coarse.force_at(time), fine.force_at(time)
    size = _l2(time, fb)
    if size == 0.0:
        return (0.0, 0.0) if _l2(time, fa) == 0.0 else (1.0, 1.0)
    top = fine.peak_force
    return _l2(time, fa - fb) / size, abs(coarse.peak_force - top) / top


def _l2(time: Array, value: Array) -> float:
    """L2 norm of values at nodes and middles by Simpson's rule, exact for piecewise linear ones."""
    return float(np.sqrt(np.sum(simpson(time, value**2))))
