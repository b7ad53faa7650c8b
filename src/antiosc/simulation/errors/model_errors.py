"""The share "model" of an error budget: what Timoshenko's beam leaves out of a bar that is solid.

A point load on a solid bar deforms the section around it. Beyond the half-space that a contact law
holds, this changes three things, which were measured on solid bars of rectangular section against
closed forms (`benchmarks/beam_model.py`; lengths of 5 to 40 heights, widths of half to twice the
height; x is a frequency over that at which the section deforms):

    compliance of the site    by up to LOCAL/(E √A)
    values of modes there     by up to VALUES x   (stresses across the axis, as in von Kármán's and
                              Seewald's correction of the deflection under a point load)
    natural frequencies       by up to FREQUENCIES x, and CLAMP d/L for each clamped end (d the
                              larger side, L the length: the clamp hinders Poisson's contraction)

The same impact with all of these changes at once, to one side and to the other, differed by more
than that on the solid bar for 449 of 450 quantities, and by 0.97 times as much for one; `SAFETY` is
for other bars.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np

from antiosc.models.anti_oscillators import AntiOscillators
from antiosc.models.body import InModes
from antiosc.models.modal import ModalBody
from antiosc.models.model_info import BeamSection
from antiosc.simulation.errors.quantities import differences, floored
from antiosc.simulation.histories.error_bars import QUANTITIES
from antiosc.simulation.histories.history import History

LOCAL, VALUES, FREQUENCIES, CLAMP = 0.8, 0.6, 0.06, 0.05
SAFETY = 1.25


def model_errors(
    model: AntiOscillators, raw: History, again: Callable[[Any, float], History], tol: float
) -> tuple[dict[str, float], list[str]]:
    """(share of each quantity, what is to be said): `raw` is the run on the model.

    The model's info tells what is needed ("model"), or why there is no figure.
    """
    facts = model.info.model
    none = dict.fromkeys(QUANTITIES, 0.0)
    if isinstance(facts, str):
        return none, [facts]
    if facts is None:
        return none, []
    softer, stiffer = (differences(raw, again(each, tol)) for each in _changed(model, facts))
    return floored({name: SAFETY * max(softer[name], stiffer[name]) for name in softer}), []


def _changed(model: AntiOscillators, facts: BeamSection) -> tuple[InModes, InModes]:
    """The model with all changes that make it softer, and with all that make it stiffer.

    Contact laws with a half-space lose the local compliance of the second.
    """
    modes = model.modal()
    x = np.minimum(modes.omega / facts["omega"], 1.0)
    slower, local = FREQUENCIES * x + CLAMP * facts["clamps"], LOCAL * facts["compliance"]

    def moved(sign: float, r: float) -> ModalBody:
        omega, b = modes.omega * (1 - sign * slower), modes.b * (1 + sign * VALUES * x)
        return replace(modes, omega=omega, b=b, r=r)

    return InModes(moved(1.0, modes.r + local)), InModes(moved(-1.0, modes.r), local)
