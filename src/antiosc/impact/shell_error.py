"""The error of Reissner–Mindlin theory for a blow on an isotropic shell.

A blow on one face of an elastic layer (thickness h, wave number k) excites its lowest bending wave
with a displacement of that face and a frequency that differ from those of a shell whose load is
spread over a disc of radius a (`antiosc.models.closed_form.plates`):

    b² of the layer / b² of the shell = 1 + (kh)² (((a/h)² − ν/(1 − ν))/5 + 2γ) + …
    ω of the layer / ω of the shell   = 1 + (kh)² γ + …,      γ = ν/(60 (1 − ν))

The first bracket is the spread of the disc; γ is that of the shear coefficient 5/6, as 5/(6 − ν)
holds for long waves (N. G. Stephen, J. Sound Vib. 202 (1997) 539). Terms in (kh)⁴ follow. The modes
of the model, of which ω tells k, are changed so, and what their static compliance gains or loses by
the waves that are shorter is a residual. A body whose error is that of the shell, with either sign,
results: the change of the impact is the error of the shell, to its first order.

`tests/simulation/test_shell_theory.py` compares the bars with exact plates (three-dimensional
elasticity, an elastic layer for each wave number) of random thickness, material and striker. Of
force, impulse and contact time of 60 plates, with kh to 1.1 (k of a wave of two contact times), the
bars with `SAFETY_SHELL` held 180 of 180, and the widest of a plate was 2.0 times its largest error
(median; 2.5 at 95 %). With the disc of a `plate_patch`, under which the terms in (kh)² nearly
vanish, they held 176 of 180 errors of up to 1.3 %; two of the others are of kh > 1.
"""

from __future__ import annotations

from dataclasses import replace
from functools import lru_cache

import numpy as np
from numpy.polynomial.polynomial import polyval

from antiosc.base._types import Array
from antiosc.models.body import ModalModel, ShellDisc
from antiosc.models.closed_form.plates import SHEAR, excess_compliance
from antiosc.models.modal import ModalBody

SAFETY_SHELL = 2.0
#: Coefficients of (kh)⁴, by powers of ν/(1 − ν): of ln b² beside the disc's, and of the frequency.
#: Fitted to the waves of a layer with kh of 0.3 to 1 and ν of 0.02 to 0.48, within 5 %.
FLEXIBLE = (0.0027, 0.0304, 0.0188)
FASTER = (0.0, -0.0047, -0.0033)
#: kh, or ka of a wider disc, from which the change no longer grows.
SHORT = 2.0
#: Share of the frequency where shear waves across the shell begin, from which modes count alike.
BENDING = 0.999


def inexact_shell(modes: ModalBody, local: float, facts: ShellDisc) -> ModalModel:
    """The body whose difference to a shell is the error of the shell.

    `modes` of the shell; `local`: compliance that its contact subtracts [m/N].
    """
    nu, disc = facts["nu"], facts["disc"]
    kh = wave_numbers(facts["wave"] * modes.omega, nu)
    faster, flexible = _changes(kh, nu, disc)
    residual = local - facts["compliance"] * _excess(nu, disc)
    sign = 1.0 if residual > 0 else -1.0  # a residual is no negative compliance
    factor = 1 + sign * (faster - 1)
    b = modes.b * factor * np.sqrt(1 + sign * (flexible - 1))
    changed = replace(modes, omega=modes.omega * factor, b=b, r=modes.r + abs(residual))
    return ModalModel(changed, local)


def wave_numbers(omega: Array, nu: float) -> Array:
    """kh of the bending waves of Mindlin's plate at the frequencies ω h √(ρ/E)."""
    D = 1 / (12 * (1 - nu**2))
    shear = SHEAR / (2 * (1 + nu))
    inertia = 1 / 12
    squares = np.minimum(np.square(omega), BENDING * shear / inertia)
    half = squares * (inertia / D + 1 / shear) / 2
    return np.asarray(
        np.sqrt(half + np.sqrt(half**2 + squares / D - squares**2 * inertia / (shear * D)))
    )


def _changes(kh: Array, nu: float, disc: float) -> tuple[Array, Array]:
    """Factors of the frequencies and of b²/ω² that a layer has over a shell."""
    x = nu / (1 - nu)
    spread = (disc**2 - x) / 5 + x / 30
    squares = kh**2 / (1 + (kh * max(disc, 1.0) / SHORT) ** 4)
    faster = 1 + x / 60 * squares + polyval(x, FASTER) * squares**2
    more = spread * squares + (disc**4 / 350 + polyval(x, FLEXIBLE)) * squares**2
    return faster, np.exp(more) / faster**2


@lru_cache(maxsize=64)
def _excess(nu: float, disc: float) -> float:
    """Compliance of the short waves that the shell has more than the layer, for E = h = 1."""

    def weight(kh: float) -> float:
        return float(_changes(np.array(kh), nu, disc)[1])

    return excess_compliance(nu, disc, weight)
