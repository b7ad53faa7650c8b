"""Detection of numbers that are not in SI units: meshes and decks are often in mm and MPa."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Protocol

from antiosc.errors import warn

#: Speeds √(E/ρ) of waves in bars, m/s: rubber has some 50, diamond 18 000.
SLOWEST_WAVE, FASTEST_WAVE = 50.0, 20_000.0
#: Parts are shorter than this, m.
LONGEST_PART = 100.0


class Material(Protocol):
    """What is asked of a material here."""

    def bar_speed(self) -> float:
        """Speed √(E/ρ) of waves in a bar, m/s."""
        ...


def tell_of_units(extent: float, materials: Iterable[Material]) -> None:
    """Warn if the extent (m) of a part or one of its materials is implausible in SI units.

    Parameters
    ----------
    extent : float
        Diagonal of the box around the part, m.
    materials : Solid, Beam, Truss, Shell or Laminate
    """
    if extent > LONGEST_PART:
        warn(
            f"the part is {extent:.4g} m long, more than {LONGEST_PART:g} m: units are SI; a mesh "
            "in millimetres must be scaled by 1e-3."
        )
    speeds = [(type(one).__name__, one.bar_speed()) for one in materials]
    implausible = [one for one in speeds if not SLOWEST_WAVE <= one[1] <= FASTEST_WAVE]
    for name, speed in dict.fromkeys((name, f"{speed:.3g}") for name, speed in implausible):
        warn(
            f"the wave speed in a {name} of this part is √(E/ρ) = {speed} m/s, outside "
            f"{SLOWEST_WAVE:g} to {FASTEST_WAVE:g}: units are SI, E in Pa and rho in kg/m³ (steel: "
            "210e9 and 7850)."
        )
