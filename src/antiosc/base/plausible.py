"""Plausibility of numbers in SI units: the first check of a part, a site and a blow.

Meshes and decks are often in mm and MPa. An unlikely value gives a warning before anything is
computed, which is repeated in an error that follows from it; an impossible value is refused. Each
sentence has the number, the rule, and the unit that is probably meant.
"""

from __future__ import annotations

from collections.abc import Iterable
from math import isfinite, sqrt
from typing import Protocol, runtime_checkable

import numpy as np
from numpy.typing import ArrayLike

from antiosc.base.errors import InputError, MeshError, warn

#: Standard gravity, m/s².
GRAVITY = 9.80665
#: Slowest wave in a bar, √(E/ρ), m/s: soft rubber has some 45, …
SLOWEST_WAVE = 40.0
#: … and fastest one: diamond has 18 000.
FASTEST_WAVE = 20_000.0
#: Speed of waves, √(E/ρ), that readers of decks give a material without mass, m/s: its mass is
#: some 1e-9 of that of a real one.
MASSLESS_WAVE = 1e8
#: No solid as dense as this, kg/m³, …
DENSE = 2000.0
#: … has slower waves than this, m/s.
SLOWEST_OF_DENSE = 10.0
#: Speed of light, m/s, which no wave in a solid exceeds.
LIGHT = 3e8
#: Least diagonal of a part, m, …
SHORTEST_PART = 1e-3
#: … and largest one; a larger number is usually in mm.
LONGEST_PART = 20.0
#: Largest diagonal of parts of lines, m: frames and trusses.
LONGEST_OF_LINES = 100.0
#: Rounding of lengths.
LENGTH_ROUNDING = 1e-9
#: Patches have at least this share of the size of the part as radius.
SMALLEST_PATCH = 1e-4
#: Blows on structures are slower than this, m/s.
FASTEST_BLOW = 100.0
#: Stress of a blow over Young's modulus, v/√(E/ρ), up to which a solid is linear.
LINEAR = 0.1
#: Young's moduli of what touches: rubber has some 1e6 Pa.
SOFTEST = 1e6
#: Least yield strength of a solid, Pa.
WEAKEST = 1e4
#: Least density of a striker, kg/m³: foams have some 20.
LIGHTEST = 10.0
#: Largest radius of a striking sphere, m.
LARGEST_SPHERE = 5.0
#: Young's moduli of real materials, Pa: from rubber to diamond.
MODULI = (1e6, 1.3e12)
#: Densities of real materials, kg/m³: from foams to osmium.
DENSITIES = (5.0, 25_000.0)
#: (factor of E, factor of ρ) to SI units, and the units in words.
UNITS = (
    (1e6, 1.0, "E in MPa"),
    (1e9, 1.0, "E in GPa"),
    (1.0, 1e3, "rho in g/cm³"),
    (1.0, 1e12, "rho in t/mm³"),
    (1e6, 1e12, "E in MPa and rho in t/mm³"),
    (1e9, 1e3, "E in GPa and rho in g/cm³"),
)


@runtime_checkable
class ExaminedMaterial(Protocol):
    """The properties of a material that are examined here."""

    def bar_speed(self) -> float:
        """Speed √(E/ρ) of waves in a bar, m/s."""
        ...


def material_doubt(material: ExaminedMaterial) -> str:
    """Why a material is implausible, "" if it is not; InputError for impossible values."""
    speed = material.bar_speed()
    name = type(material).__name__
    massless = abs(speed / MASSLESS_WAVE - 1) < LENGTH_ROUNDING
    E = getattr(material, "E", None)
    rho = getattr(material, "rho", None)
    if massless or SLOWEST_WAVE <= speed <= FASTEST_WAVE:
        return _density_doubt(name, rho) or _strength_doubt(
            getattr(material, "yield_strength", None)
        )
    sentence = (
        f"the wave speed in a {name} of this part is √(E/ρ) = {speed:.3g} m/s, outside "
        f"{SLOWEST_WAVE:g} to {FASTEST_WAVE:g}: units are SI, E in Pa and rho in kg/m³ (steel: "
        f"210e9 and 7850){_likely_units(E, rho)}."
    )
    if speed > LIGHT or (rho is not None and rho > DENSE and speed < SLOWEST_OF_DENSE):
        raise InputError(sentence)
    return sentence


def _density_doubt(name: str, rho: float | None) -> str:
    """Why a density [kg/m³] is implausible; "" if it is not."""
    if rho is None or rho <= DENSITIES[1]:
        return ""
    return (
        f"the density of a {name} of this part is {rho:.4g} kg/m³; osmium, the densest solid, has "
        "22 600: a deck may state weights for masses (Nastran, in inches: PARAM,WTMASS,0.00259)."
    )


def _likely_units(E: float | None, rho: float | None) -> str:
    """The system of units in which a modulus [Pa] and a density [kg/m³] would be plausible."""
    if E is None or rho is None:
        return ""
    for of_E, of_rho, words in UNITS:
        is_real = (
            MODULI[0] <= of_E * E <= MODULI[1] and DENSITIES[0] <= of_rho * rho <= DENSITIES[1]
        )
        if is_real and 10 * SLOWEST_WAVE <= sqrt(of_E * E / (of_rho * rho)) <= FASTEST_WAVE:
            return f"; {words} is probably meant: E {of_E * E:g}, rho {of_rho * rho:g}"
    return ""


def size_doubt(extent: float, stated: bool = False, lines: bool = False) -> str:
    """Why the diagonal [m] of the box around a part is implausible; "" if it is not.

    `stated`: whether its unit is known, so that it may be long. `lines`: whether it consists of
    lines.
    """
    longest = LONGEST_OF_LINES if lines else LONGEST_PART
    if extent > longest and not stated:
        return (
            f"the part is {extent:.4g} m long, more than {longest:g} m: units are SI; a mesh "
            'in millimetres is read with the unit "mm", a mesh that is so long with "m".'
        )
    if extent < SHORTEST_PART:
        return (
            f"the part is {extent:.4g} m long, less than {SHORTEST_PART:g} m: units are SI; a mesh "
            'in metres has the unit "m".'
        )
    return ""


def refuse_size(size: float, points: ArrayLike, name: str) -> None:
    """MeshError for cells of a size [m] larger than the longest side of the box of points."""
    longest = float(np.ptp(points, axis=0).max())
    if size > longest * (1 + LENGTH_ROUNDING):
        raise MeshError(
            f"the size {size:g} m is larger than {name}, which measures {longest:.3g} m: lengths "
            f"are in metres; {1e-3 * size:g} m is probably meant ({size:g} mm)."
        )


def patch_doubt(radius: float, extent: float) -> str:
    """Why a patch of this radius is implausible on a part this large [m]; InputError if larger."""
    if radius > extent:
        raise InputError(
            f"the radius {radius:g} m of the site is larger than the part, which measures "
            f"{extent:.3g} m: lengths are in metres; {1e-3 * radius:g} m is probably meant."
        )
    if radius < SMALLEST_PATCH * extent:
        return (
            f"the radius {radius:g} m of the site is less than {SMALLEST_PATCH:g} of the part, "
            f"which measures {extent:.3g} m: lengths are in metres; a mesh in millimetres is read "
            'with the unit "mm".'
        )
    return ""


def modulus_doubt(E: float) -> str:
    """Why the modulus [Pa] of a surface in contact is implausible; "" if it is not."""
    if E >= SOFTEST:
        return ""
    scales = ((1e9, "GPa"), (1e6, "MPa"))
    likely = [(s, unit) for s, unit in scales if MODULI[0] <= s * E <= MODULI[1]] or scales[1:]
    suggestions = " or ".join(f"{scale * E:g} ({E:g} {unit})" for scale, unit in likely)
    return (
        f"E = {E:g} Pa of a surface in contact is less than that of rubber, {SOFTEST:g}: E is in "
        f"Pa; {suggestions} is probably meant."
    )


def _strength_doubt(strength: float | None) -> str:
    """Why a yield strength [Pa] is implausible; "" if it is not."""
    if strength is None or strength >= WEAKEST:
        return ""
    return (
        f"yield_strength = {strength:g} Pa is less than that of any solid, {WEAKEST:g}: it is in "
        f"Pa; {1e6 * strength:g} is probably meant ({strength:g} MPa)."
    )


def sphere_doubt(radius: float, rho: float) -> str:
    """Why a sphere of this radius [m] and density [kg/m³] is implausible; "" if it is not."""
    if radius > LARGEST_SPHERE:
        return (
            f"the sphere of radius {radius:g} m is larger than {LARGEST_SPHERE:g} m: lengths are "
            f"in metres; {1e-3 * radius:g} is probably meant ({radius:g} mm)."
        )
    if rho < LIGHTEST:
        return (
            f"the density {rho:g} kg/m³ of the sphere is less than that of a foam, {LIGHTEST:g}: "
            f"rho is in kg/m³; {1e3 * rho:g} is probably meant ({rho:g} g/cm³)."
        )
    return ""


def thickness_doubt(thickness: float, extent: float, what: str = "shell") -> str:
    """Why the thickness of a sheet or bar is implausible in a part of this size [m]; "" if not."""
    if thickness <= extent:
        return ""
    return (
        f"the thickness {thickness:g} m of the {what} is larger than the part, which measures "
        f"{extent:.3g} m: lengths are in metres; {1e-3 * thickness:g} is probably meant "
        f"({thickness:g} mm)."
    )


def impact_doubt(model: object, movers: Iterable[object], *velocities: object) -> str:
    """Why an impact on a model is implausible, "" if it is not; InputError for impossible values.

    `model` is struck; its `info` has √(E/ρ) of the material where it was extracted. `movers` have a
    velocity; `velocities` are further ones [m/s]: numbers, arrays or a `Motion`.
    """
    all_velocities = [*velocities, *(getattr(mover, "velocity", 0.0) for mover in movers)]
    speed = max(map(_fastest, all_velocities), default=0.0)
    wave = float(getattr(getattr(model, "info", None), "wave_speed", None) or 0.0)
    strained = 0 < wave < speed / LINEAR
    if not strained and speed <= FASTEST_BLOW:
        return ""
    if speed > FASTEST_BLOW:
        sentence = (
            f"the blow of {speed:g} m/s is faster than {FASTEST_BLOW:g} m/s, beyond which every "
            f"metal yields: velocities are in m/s; {1e-3 * speed:g} m/s is probably meant "
            f"({speed:g} mm/s)."
        )
    else:
        sentence = (
            f"the blow of {speed:g} m/s on a material with √(E/ρ) = {wave:.3g} m/s makes stresses "
            f"of about {speed / wave:.2g} E, more than {LINEAR:g} E, up to which a solid is "
            "linear: E is in Pa, rho in kg/m³, velocities in m/s."
        )
    if speed > FASTEST_WAVE:
        raise InputError(sentence)
    return sentence


def _fastest(velocity: object) -> float:
    """The largest speed [m/s] of a number, an array or a `Motion`; 0 for anything else."""
    value = getattr(velocity, "velocity", velocity)
    if type(value) is float:
        if isfinite(value):
            return abs(value)
        return 0.0
    if type(value) not in (int, float, list, tuple, np.ndarray) and not isinstance(
        value, np.number
    ):
        return 0.0
    try:
        values = np.asarray(value)
    except ValueError:  # a list of unlike rows
        return 0.0
    if values.dtype.kind not in "iuf":
        return 0.0
    finite = np.abs(values[np.isfinite(values)])
    return float(finite.max(initial=0.0))


def warn_each(sentences: Iterable[str]) -> tuple[str, ...]:
    """Warn once of each non-empty sentence; return all sentences."""
    distinct = tuple(dict.fromkeys(filter(None, sentences)))
    for sentence in distinct:
        warn(sentence)
    return distinct
