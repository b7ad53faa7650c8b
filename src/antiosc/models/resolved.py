"""Frequencies up to which reduced models, and families of elements, hold."""

from __future__ import annotations

from math import pi, sqrt
from typing import Any

import numpy as np

from antiosc.base import checks
from antiosc.base.errors import InputError
from antiosc.models.model_info import info_of


def resolved_frequency(source: Any) -> float:
    """Frequency [Hz] up to which a model has the motion of points far from its site.

    The contact force sees the structure from its site, where few anti-oscillators tell all. A point
    elsewhere feels every natural mode. The model has those below its last anti-oscillator that has
    converged to an antiresonance: that frequency is returned. It grows with the number of
    anti-oscillators, which must exceed the number of natural modes below it.

    Parameters
    ----------
    source : AntiOscillators, NaturalModes, History or BodyHistory
        A model that `extract`, `superposition` or `full` made, or the result of an impact on it; of
        a scene `hit.bodies[name]`.

    Returns
    -------
    float
        0.0 if none has converged; inf for a model with all modes of the structure.

    Raises
    ------
    InputError
        For a model that does not tell: built by hand, or read from a file without its facts.
    """
    model = getattr(source, "model", source)
    placed = getattr(source, "placed", None)
    model = model if placed is None else placed.body
    info = info_of(model)
    if info.converged is None:
        raise InputError(
            "which frequencies a model resolves is known of models that extract, superposition or "
            f"full returned, and of histories of impacts on them; got {checks.shown(source)}."
        )
    if info.method == "full":
        return float("inf")
    omega = np.sort(np.asarray(model.omega, dtype=float))
    count = min(info.converged, omega.size)
    return float(omega[count - 1]) / (2 * np.pi) if count else 0.0


def strip(width: float, thickness: float, E: float, nu: float, rho: float) -> float:
    """Lowest bending frequency across a free strip of this width [Hz], where a beam fails."""
    wave = sqrt(E * thickness**2 / (12 * rho * (1 - nu**2)))
    return 22.373 / (2 * pi * width**2) * wave


def thickness_shear(thickness: float, E: float, nu: float, rho: float) -> float:
    """First thickness-shear frequency [Hz], where a shell fails."""
    return sqrt(E / (2 * (1 + nu)) / rho) / (2 * thickness)
