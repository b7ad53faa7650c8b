"""`Section`: the cross-section of a beam."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from antiosc.base.checks import array, positive, within_range
from antiosc.base.declared import Checked, checked_by
from antiosc.base.errors import InputError

#: Points of the outline of a circle: the largest stress between two of them is 0.5 % larger.
ON_CIRCLE = 32


def _points(name: str, value: Any) -> tuple[tuple[float, float], ...]:
    """Points (y, z), or InputError."""
    if isinstance(value, Sequence) and not len(value):
        return ()
    rows = array(name, value, (None, 2))
    return tuple((float(y), float(z)) for y, z in rows)


def _circle(d: float) -> list[tuple[float, float]]:
    """Points of the outline of a circle."""
    angles = 2 * math.pi * np.arange(ON_CIRCLE) / ON_CIRCLE
    return [(d / 2 * math.cos(a), d / 2 * math.sin(a)) for a in angles]


@dataclass(frozen=True)
class Section(Checked):
    """A cross-section in its principal axes y (the "height") and z, SI units.

    `I` is the second moment of area for bending in the plane of the height (sufficient for a plane
    frame), `I_side` for bending in the other plane (default: `I`), `J` Saint-Venant's torsion
    constant (default: the polar moment `I + I_side`, correct for circular sections only), `shear`
    Timoshenko's shear coefficient κ. `outline` has points (y, z) on the edge of the section, m,
    along the height and across it, at which `peak_field` takes stresses; the shapes below know it.
    """

    A: float = field(metadata=checked_by(positive, "m²"))
    I: float = field(metadata=checked_by(positive, "m⁴"))  # noqa: E741  (the field's own name for it)
    I_side: float | None = field(default=None, metadata=checked_by(positive, "m⁴"))
    J: float | None = field(default=None, metadata=checked_by(positive, "m⁴"))
    shear: float = field(default=5 / 6, metadata=checked_by(positive))
    outline: Sequence[tuple[float, float]] = field(
        default=(), kw_only=True, metadata=checked_by(_points)
    )

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
            outline=[(a * height / 2, b * width / 2) for a in (1, -1) for b in (1, -1)],
        )

    @classmethod
    def circle(cls, d: float, shear: float = 0.9) -> Section:
        """A full circle of diameter `d` in m; κ = 9/10."""
        d = positive("d", d, "m")
        A, I = math.pi * d**2 / 4, math.pi * d**4 / 64  # noqa: E741
        return cls(A=A, I=I, shear=shear, outline=_circle(d))

    @classmethod
    def tube(cls, d: float, t: float, shear: float = 0.5) -> Section:
        """A round tube of outer diameter `d` and wall `t` in m; κ = 1/2 (thin wall)."""
        d, t = positive("d", d, "m"), positive("t", t, "m")
        if t >= d / 2:
            raise InputError(f"the wall t must be thinner than d/2 = {d / 2:g} m; got {t:g}.")
        inner = d - 2 * t
        A, I = math.pi * (d**2 - inner**2) / 4, math.pi * (d**4 - inner**4) / 64  # noqa: E741
        return cls(A=A, I=I, shear=shear, outline=_circle(d))


def _rectangle_torsion(width: float, height: float) -> float:
    """Saint-Venant's series (Timoshenko & Goodier, *Theory of Elasticity*, §109)."""
    a, b = max(width, height), min(width, height)
    n = np.arange(1, 40, 2)
    series = np.sum(np.tanh(n * np.pi * a / (2 * b)) / n**5)
    return float(a * b**3 / 3 * (1 - 192 / np.pi**5 * b / a * series))
