"""Plausibility of numbers in SI units: the first check of a part, a site and an impact.

Meshes and decks are often in mm and MPa. An unlikely value gives a warning before anything is
computed, and a resulting error repeats the warning; an impossible value is refused. Each sentence
has the number, the rule, and the unit that is probably meant.
"""

from __future__ import annotations

from collections.abc import Iterable
from math import inf, isfinite
from typing import NamedTuple, Protocol, runtime_checkable

import numpy as np

from antiosc.base._types import ArrayLike
from antiosc.base.errors import InputError, MeshError, warn

#: Standard gravity, m/s².
GRAVITY = 9.80665
#: Young's moduli from rubber to diamond, Pa, and densities from foams to osmium, kg/m³.
MODULUS_RANGE = 1e6, 1.3e12
DENSITY_RANGE = 10.0, 25_000.0
#: Waves in a bar, √(E/ρ), from soft rubber to diamond, m/s, …
SLOWEST_WAVE, FASTEST_WAVE = 40.0, 20_000.0
#: … and in solids as dense as this, kg/m³; none is as fast as light.
DENSE_SOLID, SLOWEST_OF_DENSE, LIGHT_SPEED = 2000.0, 10.0, 3e8
#: √(E/ρ) that readers of decks give a material without mass, m/s.
MASSLESS_WAVE = 1e8
#: Largest diagonal of frames and trusses, m.
MAX_FRAME_SIZE = 100.0
#: Patches have at least this share of the size of the part as radius.
MIN_PATCH_RATIO = 1e-4
#: Stress of a blow over Young's modulus, v/√(E/ρ), up to which a solid is linear.
LINEAR_STRAIN = 0.1
#: Relative difference of two lengths or speeds below which they are equal.
RELATIVE_ROUNDING = 1e-9


class Range(NamedTuple):
    """Usual range of a quantity in `unit`, and (factor to it, name) of units that may be meant."""

    low: float
    high: float
    unit: str
    other_units: tuple[tuple[float, str], ...]


MILLIMETRES = ((1e-3, "mm"),)
USUAL_RANGES = {
    "modulus": Range(*MODULUS_RANGE, "Pa", ((1e9, "GPa"), (1e6, "MPa"))),
    "strength": Range(1e4, inf, "Pa", ((1e6, "MPa"),)),
    "density": Range(*DENSITY_RANGE, "kg/m³", ((1e3, "g/cm³"), (1e12, "t/mm³"))),
    "length": Range(1e-3, 20.0, "m", MILLIMETRES),
    "radius": Range(0.0, 5.0, "m", MILLIMETRES),
    "speed": Range(0.0, 100.0, "m/s", ((1e-3, "mm/s"),)),
}


def range_doubt(quantity: str, value: float, what: str, low: float = 0.0, high: float = inf) -> str:
    """Sentence if a value is outside its usual range, narrowed by `low` and `high`; else ""."""
    usual = USUAL_RANGES[quantity]
    low, high = max(low, usual.low), min(high, usual.high)
    if low <= value <= high:
        return ""

    bound = f"less than {low:.3g}" if value < low else f"more than {high:.3g}"
    scaled = [(factor * value, unit) for factor, unit in usual.other_units]
    likely = [(number, unit) for number, unit in scaled if low <= number <= high] or scaled
    meant = " or ".join(f"{number:g} ({value:g} {unit})" for number, unit in likely)
    return f"{what} is {value:g} {usual.unit}, {bound}: units are SI; {meant} is probably meant."


@runtime_checkable
class ExaminedMaterial(Protocol):
    """The properties of a material whose plausibility is checked."""

    def bar_speed(self) -> float:
        """Speed √(E/ρ) of waves in a bar, m/s."""
        ...


def material_doubt(material: ExaminedMaterial) -> str:
    """Reason why a material is implausible, or ""; InputError for impossible values."""
    speed = material.bar_speed()
    name = f"a {type(material).__name__} of this part"
    rho, strength = (getattr(material, key, None) for key in ("rho", "yield_strength"))
    massless = abs(speed / MASSLESS_WAVE - 1) < RELATIVE_ROUNDING

    if massless or SLOWEST_WAVE <= speed <= FASTEST_WAVE:
        sentence = "" if rho is None else range_doubt("density", rho, f"the density of {name}")
        if strength is not None and not sentence:
            sentence = range_doubt("strength", strength, f"the yield_strength of {name}")
        return sentence

    sentence = (
        f"the wave speed in {name} is √(E/ρ) = {speed:.3g} m/s, outside {SLOWEST_WAVE:g} to"
        f" {FASTEST_WAVE:g}: units are SI, E in Pa and rho in kg/m³ (steel: 210e9 and 7850)."
    )
    if speed > LIGHT_SPEED or (rho is not None and rho > DENSE_SOLID and speed < SLOWEST_OF_DENSE):
        raise InputError(sentence)
    return sentence


def size_doubt(extent: float, unit_stated: bool = False, is_frame: bool = False) -> str:
    """Why the diagonal [m] of a part is implausible, or ""; frames and stated units allow more."""
    long = USUAL_RANGES["length"].high < extent
    if long and (unit_stated or (is_frame and extent <= MAX_FRAME_SIZE)):
        return ""
    sentence = range_doubt("length", extent, "the part's diagonal")
    return sentence and f'{sentence} A mesh in millimetres is read with the unit "mm".'


def refuse_size(size: float, points: ArrayLike, name: str) -> None:
    """MeshError if a cell size [m] exceeds the longest side of the bounding box of points."""
    longest = float(np.ptp(points, axis=0).max())
    if size > longest * (1 + RELATIVE_ROUNDING):
        raise MeshError(
            f"the size {size:g} m is larger than {name}, which measures {longest:.3g} m: lengths "
            f"are in metres; {1e-3 * size:g} m is probably meant ({size:g} mm)."
        )


def patch_doubt(radius: float, extent: float) -> str:
    """Reason why a patch radius [m] is implausible for a part of this extent [m], or "";
    InputError if the patch is larger than the part."""
    if radius > extent:
        raise InputError(
            f"the radius {radius:g} m of the site is larger than the part, which measures "
            f"{extent:.3g} m: lengths are in metres; {1e-3 * radius:g} m is probably meant."
        )
    if radius >= MIN_PATCH_RATIO * extent:
        return ""

    return (
        f"the radius {radius:g} m of the site is less than {MIN_PATCH_RATIO:g} of the part, which"
        f' measures {extent:.3g} m: a mesh in millimetres is read with the unit "mm".'
    )


def impact_doubts(
    models: Iterable[object], movers: Iterable[object], *velocities: object
) -> list[str]:
    """For each model, why the largest speed is implausible, or ""; InputError if impossible."""
    all_velocities = [*velocities, *[getattr(mover, "velocity", 0.0) for mover in movers]]
    speed = max(map(_max_speed, all_velocities), default=0.0)
    return [_impact_doubt(model, speed) for model in models]


def _impact_doubt(model: object, speed: float) -> str:
    """Why an impact speed [m/s] on a model is implausible, or ""; InputError if impossible."""
    notes = getattr(getattr(model, "info", None), "notes", {})
    wave = float(notes.get("wave_speed") or 0.0)

    sentence = range_doubt("speed", speed, "the speed of the blow, at which every metal yields,")
    if not sentence and 0 < wave < speed / LINEAR_STRAIN:
        sentence = (
            f"the blow of {speed:g} m/s on a material with √(E/ρ) = {wave:.3g} m/s makes stresses "
            f"of about {speed / wave:.2g} E, more than {LINEAR_STRAIN:g} E, up to which a solid is "
            "linear: E is in Pa, rho in kg/m³, velocities in m/s."
        )

    if speed > FASTEST_WAVE:
        raise InputError(sentence)
    return sentence


def _max_speed(velocity: object) -> float:
    """The largest speed [m/s] of a number, an array or a `Motion`; 0 for anything else."""
    value = getattr(velocity, "velocity", velocity)
    if type(value) is float:  # of most impacts, which take 0.2 ms
        return abs(value) if isfinite(value) else 0.0

    try:
        values = np.asarray(value)
    except ValueError:  # a list of unlike rows
        return 0.0
    if values.dtype.kind not in "iuf":
        return 0.0
    return float(np.abs(values[np.isfinite(values)]).max(initial=0.0))


def warn_each(sentences: Iterable[str]) -> tuple[str, ...]:
    """Warn of each distinct non-empty sentence; returns these sentences."""
    distinct = tuple(dict.fromkeys(filter(None, sentences)))
    for sentence in distinct:
        warn(sentence)
    return distinct
