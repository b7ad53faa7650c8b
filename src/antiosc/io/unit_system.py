"""Consistent unit systems of decks and meshes: a length, a force, and seconds."""

from __future__ import annotations

from dataclasses import dataclass

from antiosc.base.checks import positive, shown
from antiosc.base.errors import InputError

#: Name -> (m, N). "mm" is mm, N, t, MPa; "in" is inch, pound-force, psi, lbf s²/in.
SYSTEMS = {"m": (1.0, 1.0), "mm": (1e-3, 1.0), "cm": (1e-2, 1.0), "in": (0.0254, 4.4482216152605)}


@dataclass(frozen=True)
class UnitSystem:
    """SI values of the units; the unit of mass follows from force = mass × length / s²."""

    #: m
    length: float = 1.0
    #: N
    force: float = 1.0

    @classmethod
    def of(cls, unit: str | float) -> UnitSystem:
        """By name, or by the metres per unit of length, with forces in N."""
        if isinstance(unit, str):
            if unit not in SYSTEMS:
                raise InputError(
                    f"unit must be one of {', '.join(map(repr, SYSTEMS))}, or a number: metres per "
                    f"unit of length; got {shown(unit)}."
                )
            return cls(*SYSTEMS[unit])
        return cls(positive("unit", unit, "m"))

    @property
    def mass(self) -> float:
        """kg."""
        return self.force / self.length

    @property
    def stress(self) -> float:
        """Pa."""
        return self.force / self.length**2

    @property
    def density(self) -> float:
        """kg/m³."""
        return self.mass / self.length**3
