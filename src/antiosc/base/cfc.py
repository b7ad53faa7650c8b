"""Filters of channel frequency classes (SAE J211-1, ISO 6487): low-pass, without phase shift."""

from __future__ import annotations

from math import pi, sqrt, tan

import numpy as np

from antiosc.base import checks
from antiosc.base._types import Array, ArrayLike
from antiosc.base.errors import InputError

#: Name of a channel frequency class -> its frequency [Hz].
CLASS_FREQUENCIES = {"CFC60": 60.0, "CFC180": 180.0, "CFC600": 600.0, "CFC1000": 1000.0}
#: Filter class used for the largest acceleration in results of a fall.
SHOCK_FILTER = "CFC1000"
#: Corner frequency of one pass of a filter over its class (SAE J211-1).
CORNER_RATIO = 2.0775
#: Frequency at which a filter leaves 0.707 of a sine, over its class: CORNER_RATIO (√2 − 1)^(1/4).
HALF_POWER_RATIO = 5 / 3
#: Least sampling rate over the class (SAE J211-1).
MIN_SAMPLING_RATIO = 10.0
#: Memory of a filter in periods of its class: its response falls to
#: exp(−√2 π CORNER_RATIO MEMORY_PERIODS), 1e-8.
MEMORY_PERIODS = 2.0


def filter_memory(name: str) -> float:
    """Time [s] before and after an instant in which the signal affects the filtered value."""
    checks.choice("filter", name, tuple(CLASS_FREQUENCIES))
    return MEMORY_PERIODS / CLASS_FREQUENCIES[name]


def sampling_step(name: str) -> float:
    """Sampling step [s] for the filter `name`: half of its largest permitted step."""
    return 1 / (2 * MIN_SAMPLING_RATIO * CLASS_FREQUENCIES[name])


def cfc_filter(step: float, signal: ArrayLike, name: str) -> Array:
    """A signal (n,) or (n, k), sampled at equal steps [s], filtered by a channel frequency class.

    Raises
    ------
    InputError
        An unknown class, or a rate below ten times the class.
    """
    step = checks.positive("step", step, "s")
    checks.choice("filter", name, tuple(CLASS_FREQUENCIES))
    x = checks.floats("signal", signal, None)
    cfc = CLASS_FREQUENCIES[name]
    if x.ndim not in (1, 2):
        raise InputError(f"signal must have shape (n,) or (n, k); got {x.shape}.")
    if step * cfc * MIN_SAMPLING_RATIO > 1:
        raise InputError(
            f"{name} needs at least {MIN_SAMPLING_RATIO * cfc:g} samples a second; got "
            f"{1 / step:.4g}."
        )

    from scipy.signal import lfilter  # which takes long to load

    wa = tan(pi * CORNER_RATIO * cfc * step)
    denominator = 1 + sqrt(2) * wa + wa * wa
    b = np.array([1.0, 2.0, 1.0]) * wa * wa / denominator
    a = np.array([1.0, 2 * (wa * wa - 1) / denominator, (1 - sqrt(2) * wa + wa * wa) / denominator])
    forward = lfilter(b, a, x, axis=0)
    return np.asarray(lfilter(b, a, forward[::-1], axis=0)[::-1])
