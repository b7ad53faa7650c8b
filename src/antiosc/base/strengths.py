"""`Strengths` of a ply, and how much of them a stress uses: its exposure, 1 at failure.

The exposure is the inverse of the strength ratio R, the factor by which all stresses may grow until
failure: it is proportional to the load, so that 1/exposure − 1 is a margin of safety.
"""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import ArrayLike

from antiosc.base._types import Array
from antiosc.base.checks import positive, within_range
from antiosc.base.declared import Checked, checked_by
from antiosc.base.errors import InputError
from antiosc.base.stresses import components, hill_index

_PRESSURE = checked_by(positive, "Pa")


@dataclass(frozen=True)
class Strengths(Checked):
    """Strengths of a unidirectional layer in its axes (1 along the fibres), all positive, Pa.

    Parameters
    ----------
    X_t, X_c : float
        Along the fibres in tension and in compression, Pa.
    Y_t, Y_c : float
        Across the fibres in tension and in compression, Pa.
    S : float
        In-plane shear, Pa.
    interlaminar : float, optional
        Shear between layers (ILSS), Pa; delamination is assessed where it is given.
    """

    X_t: float = field(metadata=_PRESSURE)
    X_c: float = field(metadata=_PRESSURE)
    Y_t: float = field(metadata=_PRESSURE)
    Y_c: float = field(metadata=_PRESSURE)
    S: float = field(metadata=_PRESSURE)
    interlaminar: float | None = field(default=None, metadata=_PRESSURE)

    @within_range
    def tsai_hill(self, stress: ArrayLike) -> Array:
        """Exposure (...,) after Tsai and Hill: the root of `antiosc.tsai_hill`.

        `stress` (..., 3, 3) or (..., 6) in the axes of the layer, Pa; compressive strengths are
        taken for negative σ1 and σ2.
        """
        return exposure("tsai_hill", self, components("stress", stress))

    @within_range
    def tsai_wu(self, stress: ArrayLike) -> Array:
        """Exposure (...,) after Tsai and Wu, with F12 = −√(F11 F22)/2.

        1/R, R the positive root of (F11 σ1² + F22 σ2² + F66 τ12² + 2 F12 σ1 σ2) R² + (F1 σ1 +
        F2 σ2) R = 1; F1 = 1/X_t − 1/X_c, F11 = 1/(X_t X_c), F66 = 1/S². S. W. Tsai, E. M. Wu, J.
        Compos. Mater. 5 (1971) 58.
        """
        return exposure("tsai_wu", self, components("stress", stress))

    @within_range
    def delamination(self, stress: ArrayLike) -> Array:
        """Exposure (...,) of the interface: √(τ13² + τ23²) over the interlaminar strength.

        Raises
        ------
        InputError
            The interlaminar strength is not given.
        """
        return exposure("delamination", self, components("stress", stress))


def exposure(criterion: str, own: Strengths, s: Array) -> Array:
    """Exposure (...,) by a criterion, of components 11, 22, 33, 23, 13, 12 (..., 6)."""
    one, two, shear = s[..., 0], s[..., 1], s[..., 5]
    if criterion == "delamination":
        if own.interlaminar is None:
            raise InputError("delamination needs Strengths(…, interlaminar=…), in Pa.")
        return np.asarray(np.hypot(s[..., 4], s[..., 3]) / own.interlaminar)
    if criterion == "tsai_hill":
        X, Y = (own.X_t, own.X_c), (own.Y_t, own.Y_c)
        return np.asarray(np.sqrt(np.maximum(hill_index(s, X, Y, own.S), 0.0)))
    a, b = one / np.sqrt(own.X_t * own.X_c), two / np.sqrt(own.Y_t * own.Y_c)
    square = a**2 + b**2 - a * b + (shear / own.S) ** 2
    linear = one * (1 / own.X_t - 1 / own.X_c) + two * (1 / own.Y_t - 1 / own.Y_c)
    return np.asarray(linear / 2 + np.sqrt(linear**2 / 4 + square))
