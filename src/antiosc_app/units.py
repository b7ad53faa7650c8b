"""The unit of a deck, which no deck states: that of the most likely materials; else of its size."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from functools import cache
from math import isclose, log10
from typing import Any

import numpy as np

from antiosc.base._types import Array
from antiosc.base.materials import names, record
from antiosc.base.plausible import GRAVITY, MASSLESS_WAVE
from antiosc.io.neutral import UnitSystem

#: The units that are tried, the most frequent first.
UNITS = ("mm", "m", "in", "mm-kg", "ft")
#: Unit of a file that states none -> its least length in this unit. A mesh is nearest to 0.1 m, in
#: decades. Of 429 printed parts in mm of four projects 29 are shorter than 20 mm, none than 5.5 mm;
#: CAD programs write surfaces in inches too (parts of 2.95 and 1.35 inches were taken as metres).
UNITS_OF_MESHES = {"mm": 3.2, "m": 0.0}
UNITS_OF_SURFACES = {"mm": 5.5, "in": 0.63, "m": 0.0}
#: Those in which densities are often stated as weights, lbf/in³ or lbf/ft³.
OF_POUNDS = ("in", "ft")
#: Lengths [m] of parts of machines and buildings.
LENGTHS = (1e-3, 100.0)
#: Moduli [Pa] and densities [kg/m³] of laminates of carbon and glass fibres, of foams and balsa,
#: besides those of the table of materials.
OF_SANDWICHES = (
    *((135e9, 1550.0), (55e9, 1550.0), (40e9, 1900.0)),
    *((7e7, 52.0), (1.6e8, 110.0), (3e9, 150.0)),
)
#: A decade of a modulus counts as this many of a density.
DECADES_OF_MODULUS = 5.0
#: A density that is further off than this many decades is no real one (of 87 decks by others 5
#: state 1.0, or 1e-4, as a density), and neither is this number: with it steel in inches (3e7)
#: was a plastic in feet.
DUMMY, PLACEHOLDER = 2.0, 1.0
#: The unit of decks with moduli in kgf/mm². It is taken where their materials are real ones in it
#: up to the first difference, decades, and in no other unit up to the second: they were 0.01 and
#: 1.0 of a wing of aluminium, 0 and 0.29 of steel (a foam in inches), 0.36 and 1.5 of lead in MPa.
OF_KILOGRAMS_FORCE, REAL, UNREAL = "mm-kgf", 0.1, 0.25
#: Up to this difference, decades, units are equally likely; densities are taken as weights where
#: that is nearer to real ones by more.
EQUAL = 0.5


def unit_of_length(length: float, units: Mapping[str, float]) -> str:
    """The unit of a file that states none, by the length of its part in this unit.

    `units`: unit -> least length of a part in it, the largest first.
    """
    return next((unit for unit, least in units.items() if length >= least), [*units][-1])


def unit_of(
    families: Sequence[Any],
    extent: float,
    unit: str,
    units: Sequence[str],
    guessed: Mapping[str, float],
) -> tuple[str, float | None, float]:
    """(the likeliest of some units of a deck that was read in `unit`, its median modulus there, and
    the decades between its materials and size there and the nearest real ones).

    `families`, `extent` [m]: of its elements; `guessed`: "density" and "modulus" of materials that
    state none. The median is None if all moduli are guessed.
    """
    materials = np.array([_modulus_and_density(family) for family in families])
    for values, key in zip(materials.T, ("modulus", "density"), strict=True):
        values[np.isclose(values, guessed.get(key, np.nan))] = np.nan
    materials = materials[np.isfinite(materials).any(axis=1)]
    read = UnitSystem.of(unit)
    length = extent / read.length
    if not len(materials):
        known = {name: UNITS_OF_MESHES[name] for name in UNITS_OF_MESHES if name in units}
        return unit_of_length(length, known or dict.fromkeys(units, 0.0)), None, 0.0
    materials /= [read.stress, read.density]
    moduli = materials[np.isfinite(materials[:, 0]), 0]
    median = float(np.quantile(moduli, 0.5, method="lower")) if len(moduli) else None
    best = likeliest(materials, length, units)
    return best, median, _decades_of_unit(materials, length, best)


def are_real(families: Sequence[Any]) -> bool:
    """Whether the materials of a deck are real ones; False where none states a density."""
    materials = np.array([_modulus_and_density(family) for family in families])
    known = materials[np.isfinite(materials).all(axis=1)]
    return bool(len(known)) and _decades_off(known) <= REAL


def likeliest(materials: Array, extent: float, units: Sequence[str] = UNITS) -> str:
    """The unit in which materials and size are nearest to real ones, of equally likely the first.

    `materials` : (n, 2) Young's moduli and densities as the deck has them; NaN: not known.
    """
    E, rho = np.transpose(materials)
    materials = np.stack([E, np.where(np.isclose(rho, PLACEHOLDER), np.nan, rho)], axis=1)
    decades = {name: _decades_of_unit(materials, extent, name) for name in units}
    smallest = min(decades.values())
    return next(name for name in units if decades[name] <= smallest + EQUAL)


def _decades_of_unit(materials: Array, extent: float, name: str) -> float:
    """Decades between materials and size in a unit and the nearest real ones."""
    unit = UnitSystem.of(name)
    factors = np.array([unit.stress, unit.density])
    decades = _decades_off(materials * factors)
    if name in OF_POUNDS:
        factors[1] /= GRAVITY / unit.length
        decades = min(decades, _decades_off(materials * factors) + EQUAL)
    length = extent * unit.length
    low, high = LENGTHS
    return decades + abs(log10(length / min(max(length, low), high)))


def _decades_off(materials: Array) -> float:
    """Median distance in decades of materials from the nearest real ones, as some may be rigid.

    `materials` : (n, 2) Young's moduli [Pa] and densities [kg/m³]; NaN: not known.
    """
    decades = np.nan_to_num(np.abs(np.log10(materials[:, None] / _real_materials())))
    decades_off = DECADES_OF_MODULUS * decades[:, :, 0] + np.minimum(decades[:, :, 1], DUMMY)
    return float(np.quantile(decades_off.min(axis=1), 0.5, method="lower"))


@cache
def _real_materials() -> Array:
    """(n, 2) Young's moduli [Pa], the largest of wood, and densities [kg/m³] of known materials."""
    table = [record(name) for name in names()]
    return np.array([*((np.max(material.E), material.rho) for material in table), *OF_SANDWICHES])


def _modulus_and_density(material: Any) -> tuple[float, float]:
    """Young's modulus along the stiffest direction [Pa] and density [kg/m³]; NaN: not known."""
    rho = getattr(material, "rho", np.nan)
    if layers := getattr(material, "layers", ()):
        thickness = [layer.thickness for layer in layers]
        rho = np.average([layer.rho for layer in layers], weights=thickness)
    speed = material.bar_speed()
    massless = isclose(speed, MASSLESS_WAVE, rel_tol=1e-3)
    return rho * speed**2, np.nan if massless else rho
