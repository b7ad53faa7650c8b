"""Frequencies at which element families fail: the section, or the thickness, begins to deform."""

from __future__ import annotations

from math import pi, sqrt


def strip(width: float, thickness: float, E: float, nu: float, rho: float) -> float:
    """Lowest bending frequency across a free strip of this width [Hz], where a beam fails."""
    wave = sqrt(E * thickness**2 / (12 * rho * (1 - nu**2)))
    return 22.373 / (2 * pi * width**2) * wave


def thickness_shear(thickness: float, E: float, nu: float, rho: float) -> float:
    """First thickness-shear frequency [Hz], where a shell fails."""
    return sqrt(E / (2 * (1 + nu)) / rho) / (2 * thickness)
