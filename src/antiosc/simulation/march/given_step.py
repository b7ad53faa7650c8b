"""The march with a step that is given, and what is said of its windows of instability."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from antiosc.base import checks, march
from antiosc.base._types import Array
from antiosc.base.errors import InputError
from antiosc.simulation.march.convergence import stopped
from antiosc.simulation.march.engine import Run, run
from antiosc.simulation.march.stability import clear_step, margin
from antiosc.simulation.march.system import System

#: the share of such a run: what the step does not resolve is integrated with halvings of it
LOOSE = 0.05


def checked_step(step: float, duration: float) -> float:
    """A step [s] of at most the duration, or InputError."""
    step = checks.positive("step", step, "s")
    if step > duration:
        raise InputError(f"step must be <= the duration {duration:g} s; got {step:g} s.")
    return step


def stepped(
    system: System,
    stiffness: Callable[[], Array],
    duration: float,
    step: float,
    max_contacts: int,
    max_steps: int,
) -> tuple[Run, str]:
    """A run with steps of `step` [s] under contact, and why it failed; empty if it did not.

    `stiffness` gives the largest stiffnesses (p,) [N/m] that are expected of the contacts. A step
    in a window of instability counts as a gain of energy where vibrations that it does not resolve
    disturbed the forces, also if halvings kept them in bounds.
    """
    found = run(
        system,
        duration,
        LOOSE,
        step=step,
        fine=step / 4,
        max_contacts=max_contacts,
        max_steps=max_steps,
    )
    t = float(found.time[-1])
    failure = stopped(found.answer, t, max_contacts, max_steps)
    grew = found.answer == march.GREW
    if grew or (found.refused and not failure):
        unstable = _unstable(system, stiffness(), step, t, grew)
        if unstable:
            found.answer, failure = march.GREW, unstable
    return found, failure


def _unstable(system: System, stiffness: Array, step: float, t: float, grew: bool) -> str:
    """That the step lies in a window of instability, if it does or the energy grew."""
    p = len(system.laws)
    modes = system.omega, system.beta[:p], system.R[:p, :p]
    if not grew and margin(*modes, stiffness, step) == np.inf:
        return ""  # the halvings resolve it
    clear = clear_step(*modes, stiffness, step)
    remedy = f"step={clear:.6g}" if clear < step else "a smaller step"
    excites = "contact excites" if p == 1 else "contacts excite"
    return (
        f"exact gained energy by {t:g} s: at a step of {step:g} s the {excites} the modes"
        f" (unstable step); use {remedy} or no step, so that it is chosen automatically"
    )
