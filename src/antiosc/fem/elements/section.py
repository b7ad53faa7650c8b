"""`Section`: the cross-section of a beam."""

from __future__ import annotations

import math
from dataclasses import dataclass, field

import numpy as np

from antiosc.base.checks import positive, within_range
from antiosc.base.declared import Checked, checked_by
from antiosc.base.errors import InputError


@dataclass(frozen=True)
class Section(Checked):
    """A cross-section in its principal axes y (the "height") and z, SI units.

    `I` is the second moment of area for bending in the plane of the height (sufficient for a plane
    frame), `I_side` for bending in the other plane (default: `I`), `J` Saint-Venant's torsion
    constant (default: the polar moment `I + I_side`, correct for circular sections only), `shear`
    Timoshenko's shear coefficient κ.
    """

    A: float = field(metadata=checked_by(positive, "m²"))
    I: float = field(metadata=checked_by(positive, "m⁴"))  # noqa: E741  (the field's own name for it)
    I_side: float | None = field(default=None, metadata=checked_by(positive, "m⁴"))
    J: float | None = field(default=None, metadata=checked_by(positive, "m⁴"))
    shear: float = field(default=5 / 6, metadata=checked_by(positive))

    @property
    def side(self) -> float:
        """Second moment of area across the height, m⁴."""
        return self.I if self.I_side is None else self.I_side

    @property
    def torsion(self) -> float:
        """Torsion constant, m⁴."""
        return self.I + self.side if self.J is None else self.J

    @property
    def isotropic(self) -> bool:
        """Whether every axis is a principal one, so that no orientation is needed."""
        return math.isclose(self.I, self.side, rel_tol=1e-9)

    @classmethod
    @within_range
    def rectangle(cls, width: float, height: float, shear: float = 5 / 6) -> Section:
        """A full rectangle, sides in m; κ = 5/6 (Reissner)."""
        width, height = positive("width", width, "m"), positive("height", height, "m")
        return cls(
            A=width * height,
            I=width * height**3 / 12,
            I_side=height * width**3 / 12,
            J=_rectangle_torsion(width, height),
            shear=shear,
        )

    @classmethod
    def circle(cls, d: float, shear: float = 0.9) -> Section:
        """A full circle of diameter `d` in m; κ = 9/10."""
        d = positive("d", d, "m")
        return cls(A=math.pi * d**2 / 4, I=math.pi * d**4 / 64, shear=shear)

    @classmethod
    def tube(cls, d: float, t: float, shear: float = 0.5) -> Section:
        """A round tube of outer diameter `d` and wall `t` in m; κ = 1/2 (thin wall)."""
        d, t = positive("d", d, "m"), positive("t", t, "m")
        if t >= d / 2:
            raise InputError(f"the wall t must be thinner than d/2 = {d / 2:g} m; got {t:g}.")
        inner = d - 2 * t
        return cls(
            A=math.pi * (d**2 - inner**2) / 4, I=math.pi * (d**4 - inner**4) / 64, shear=shear
        )


def _rectangle_torsion(width: float, height: float) -> float:
    """Saint-Venant's series (Timoshenko & Goodier, *Theory of Elasticity*, §109)."""
    a, b = max(width, height), min(width, height)
    n = np.arange(1, 40, 2)
    series = np.sum(np.tanh(n * np.pi * a / (2 * b)) / n**5)
    return float(a * b**3 / 3 * (1 - 192 / np.pi**5 * b / a * series))
