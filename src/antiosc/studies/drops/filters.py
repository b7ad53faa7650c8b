"""Channel frequency classes of SAE J211-1 and ISO 6487: filters without phase for shock signals.

A two-pole Butterworth low pass of 2.0775 times the class, run forward and backward, with the
coefficients of SAE J211-1, appendix C; together -3 dB at 5/3 of the class. ISO 6487:2000, whose
coefficients differ slightly, has the same kind of filter with -3 dB at 100, 300, 1000 and 1650 Hz
(weisang.com/en/cfcfilter_en).
"""

from __future__ import annotations

from math import pi, sqrt, tan

import numpy as np
from numpy.typing import ArrayLike

from antiosc.base import checks
from antiosc.base._types import Array
from antiosc.base.errors import InputError

#: Name -> class [Hz].
CLASSES = {"CFC60": 60.0, "CFC180": 180.0, "CFC600": 600.0, "CFC1000": 1000.0}
#: Corner of one pass over the class, and least sampling rate over the class (SAE J211-1).
CORNER, LEAST_RATE = 2.0775, 10.0
#: What a filter remembers is over after this many periods of its class.
MEMORY = 2.0


def cfc_filter(step: float, signal: ArrayLike, name: str) -> Array:
    """The signal (n,) or (n, k), sampled at equal steps [s], through a channel frequency class.

    Raises
    ------
    InputError
        An unknown class, or a rate below ten times the class.
    """
    step = checks.positive("step", step, "s")
    checks.choice("filter", name, tuple(CLASSES))
    x, cfc = checks.array("signal", signal, None), CLASSES[name]
    if x.ndim not in (1, 2):
        raise InputError(f"signal must have shape (n,) or (n, k); got {x.shape}.")
    if step * cfc * LEAST_RATE > 1:
        raise InputError(
            f"{name} needs at least {LEAST_RATE * cfc:g} samples a second; got {1 / step:.4g}."
        )
    from scipy.signal import lfilter  # which takes long to load

    wa = tan(pi * CORNER * cfc * step)
    whole = 1 + sqrt(2) * wa + wa * wa
    b = np.array([1.0, 2.0, 1.0]) * wa * wa / whole
    a = np.array([1.0, 2 * (wa * wa - 1) / whole, (1 - sqrt(2) * wa + wa * wa) / whole])
    forward = lfilter(b, a, x, axis=0)
    return np.asarray(lfilter(b, a, forward[::-1], axis=0)[::-1])
