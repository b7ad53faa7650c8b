"""Laws with a permanent indentation: loading, unloading and reloading follow different curves.

All have one form. Virgin loading follows F_l(delta). Unloading from a turning point (delta_t, F_t)
falls to the permanent indentation delta_p of the deepest indentation delta_m so far,

    F = F_t U((delta - delta_p)/(delta_t - delta_p)),

and reloading, up to (delta_m, F_m), climbs F = F_m V((delta - delta_p)/(delta_m - delta_p)). Where
U = V reloading goes back along the unloading curve. Once the bodies have parted, the next contact
reloads from delta_p.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from math import pi, sqrt
from typing import Any, ClassVar

from antiosc.base import checks, march
from antiosc.base.declared import checked_by
from antiosc.base.errors import InputError
from antiosc.contact.compiled import Compiled


class Hysteretic(Compiled):
    """Base of the laws of this module.

    The state is (delta_m, delta_t, lost): deepest indentation [m], turning point [m] from which
    unloading starts, and the energy lost so far [J].
    """

    has_memory: ClassVar[bool] = True
    size: ClassVar[int] = 3

    def permanent(self, deepest: float) -> float:
        """Permanent indentation delta_p [m] after a deepest one, 0 <= delta_p < deepest."""
        return self.origin((deepest, 0.0, 0.0))


@dataclass(frozen=True)
class Thornton(Hysteretic):
    """Elastic, perfectly plastic sphere. C. Thornton, J. Appl. Mech. 64 (1997) 383-386.

    Hertz's law up to the yield indentation; beyond, the pressure is cut off and the force goes on
    along the tangent; unloading is Hertzian with the flattened radius R F_e/F_m, F_e being Hertz's
    force at the deepest indentation, so that delta_p = delta_m (1 - F_m/F_e).

    Parameters
    ----------
    stiffness : float
        Hertz's k_H [N m^-3/2].
    yield_indentation : float
        delta_y [m] at first yield.
    """

    stiffness: float = field(metadata=checked_by(checks.positive, "N m^-3/2"))
    yield_indentation: float = field(metadata=checked_by(checks.positive, "m"))

    kind: ClassVar[int] = march.THORNTON

    @classmethod
    @checks.within_range
    def from_material(cls, E_star: float, radius: float, yield_pressure: float) -> Thornton:
        """From E* [Pa], relative radius [m] and contact pressure at yield p_y [Pa] (1.6 Y).

        delta_y = R (pi p_y/(2 E*))^2.
        """
        E = checks.positive("E_star", E_star, "Pa")
        R = checks.positive("radius", radius, "m")
        p = checks.positive("yield_pressure", yield_pressure, "Pa")
        return cls(4 / 3 * E * sqrt(R), R * (pi * p / (2 * E)) ** 2)


@dataclass(frozen=True)
class Stronge(Hysteretic):
    """Elastic-plastic sphere. W. J. Stronge, Impact Mechanics, Cambridge 2000, ch. 6.

    Hertz up to yield at delta_y; then F/F_y = (2 x - 1)(1 + ln(2 x - 1)/3.3) with
    x = delta/delta_y, and the mean pressure stays 2.55 times that at yield from x = 84 on.
    Unloading is Hertzian from delta_m to delta_p = delta_m - delta_y sqrt(2 x_m - 1). Taken as
    printed, that would give back more than was put in for x_m < 1.9; there delta_p is the one
    without loss.

    Parameters
    ----------
    stiffness : float
        Hertz's k_H [N m^-3/2].
    yield_indentation : float
        delta_y [m] at first yield.
    """

    stiffness: float = field(metadata=checked_by(checks.positive, "N m^-3/2"))
    yield_indentation: float = field(metadata=checked_by(checks.positive, "m"))

    kind: ClassVar[int] = march.STRONGE


@dataclass(frozen=True)
class _Laminate(Hysteretic):
    """F = k delta^1.5 on loading and reloading, unloading with the power 2.5."""

    stiffness: float = field(metadata=checked_by(checks.positive, "N m^-3/2"))
    critical: float = field(metadata=checked_by(checks.positive, "m"))


@dataclass(frozen=True)
class YangSun(_Laminate):
    """Indentation of laminates. S. H. Yang, C. T. Sun, ASTM STP 787 (1982) 425-449.

    delta_p = delta_m [1 - (critical/delta_m)^(2/5)] beyond the critical indentation [m], else 0.
    `stiffness` in N m^-3/2.
    """

    kind: ClassVar[int] = march.YANG_SUN


def _checked_slope(name: str, value: Any) -> float:
    slope = checks.number(name, value)
    if not 0 < slope < 1:
        raise InputError(f"slope must lie in 0 < slope < 1; got {slope:g}.")
    return slope


@dataclass(frozen=True)
class TanSun(_Laminate):
    """Indentation of laminates. T. M. Tan, C. T. Sun, J. Appl. Mech. 52 (1985) 6-12.

    delta_p = slope * (delta_m - critical) beyond the critical indentation [m], else 0, with
    0 < slope < 1. `stiffness` in N m^-3/2.
    """

    slope: float = field(default=0.5, metadata=checked_by(_checked_slope))

    kind: ClassVar[int] = march.TAN_SUN
