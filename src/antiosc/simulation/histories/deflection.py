"""Deflections of sheets beyond linear theory."""

from __future__ import annotations

import numpy as np

from antiosc.base._types import Array
from antiosc.models.model_info import info_of
from antiosc.simulation.histories.history import History
from antiosc.simulation.problem.scene_states import free_steps

#: Deflection over the thickness up to which a sheet that is held hardly stretches: at a clamped
#: circle's half thickness the stretching adds 11 % to the force (1 + 0.443 (w/h)²).
SMALL_DEFLECTION = 0.5
#: Looks at a run in a period of the lowest mode, as a flight is one step, and at most in all.
LOOKS, MOST_LOOKS = 32, 4096


def too_far(history: History) -> str:
    """What is wrong with the deflection of a sheet that is held, the worst; "" for nothing."""
    a, worst, told = history.assembly, SMALL_DEFLECTION, ""
    for name, body in a.bodies.items():
        h = info_of(body.body).thickness
        if h is None or not body.omega.all():
            continue
        own, columns = a.spans[name], a.columns[name]
        sites = a.B[own, columns] @ a.G[: len(a.laws), columns].T
        w = float(abs(_seen(history, body.omega)[:, own] @ sites).max(initial=0.0))
        if w > worst * h:
            worst = w / h
            told = (
                f"{name!r} deflects by {1e3 * w:.3g} mm, {worst:.3g} times the thickness"
                f" {1e3 * h:.3g} mm of its sheet, more than {SMALL_DEFLECTION:g}, up to which"
                f" linear theory holds: where its edges are held it stretches and is stiffer,"
                f" forces are larger and deflections smaller than these (a cantilever, or a sheet"
                f" on soft springs, hardly stretches); make the sheet thicker, or analyse it by a"
                f" nonlinear program."
            )
    return told


def _seen(history: History, omega: Array) -> Array:
    """Modal displacements (n, J) at the ends of steps and at even times in between."""
    end = float(history.run.time[-1])
    periods = end * float(omega.min()) / (2 * np.pi) if omega.size else 0.0
    t = np.linspace(0.0, end, int(min(MOST_LOOKS, LOOKS * (1 + periods))))
    return np.vstack([free_steps(history.run, history.assembly.system), history.states(t)[0]])
