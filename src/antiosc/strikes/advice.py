"""The element family that is sufficient for a part and an impact, and its element size.

Everything is estimated from the dimensions, without a mesh. The contact time on the part cannot be
shorter than on a half-space of its material; above twice the inverse of this time the spectrum of
the force is small. An element family is sufficient if it is valid up to this frequency,

    beam    half of the lowest frequency of a free strip of its width (the section deforms)
    shell   half of the first thickness-shear frequency, c_s/(2h) (the thickness deforms)
    solid   no limit

and if the contact is small compared with the dimension that the family assumes rigid, and the part
is slender. The contact of a light impactor ends before the part moves appreciably: if Zener's
inelasticity λ is small, the force is as on a half-space (Hertz), and the frequency limit does not
matter.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from math import pi, sqrt

import numpy as np

from antiosc.base import checks
from antiosc.base.errors import InputError
from antiosc.base.texts import FieldsRepr, engineering, percent
from antiosc.engine.contact.geometry import effective_modulus
from antiosc.fem.structure.structure import Structure
from antiosc.impact.bodies import RigidMass, Sphere

#: Highest relevant frequency times the contact time: above it the spectrum of a Hertz pulse is
#: below a twentieth of its value at 0.
BAND_TIME_PRODUCT = 2.0
#: A family is used up to this share of the frequency at which it fails.
TRUSTED_FREQUENCY_SHARE = 0.5
#: Inelasticity up to which the motion of the part does not change the force (at 0.02 the impactor
#: keeps 97 % of its velocity on an infinite plate).
SMALL_INELASTICITY = 0.02
#: Smallest length over width of a slender beam, and side over thickness of a thin shell.
MIN_SLENDERNESS = 5.0
#: Largest contact radius over thickness for a family whose thickness is rigid.
MAX_CONTACT_RADIUS_RATIO = 0.25
#: Least share of its bounding box that a block, a plate or a bar of solids fills.
MIN_FILL = 0.8
#: Elements per wavelength (cubic or quadratic ones).
ELEMENTS_PER_WAVE = 4.0
#: Factor of Hertz's contact time, 2.943 δ/v with a rigid partner.
HERTZ_TIME_FACTOR = 2.9432


@dataclass(frozen=True)
class Advice(FieldsRepr):
    """Recommended element family and element size for one part and one impact.

    Attributes
    ----------
    family : "beam", "shell" or "solid", the simplest that is sufficient.
    contact_time : contact time of the impactor on a half-space [s]; it is longer on the part.
    frequency : highest frequency that the model must represent [Hz].
    element_size : largest sufficient element size for this family [m].
    contact_radius : radius of Hertz's contact at its peak [m].
    inelasticity : Zener's λ of the impactor on an infinite plate of this thickness.
    limits : family -> highest frequency [Hz] at which it is valid.
    reasons : sentences on why simpler families are not sufficient, and on the element size.
    """

    family: str
    contact_time: float
    frequency: float
    element_size: float
    contact_radius: float
    inelasticity: float
    limits: dict[str, float]
    reasons: tuple[str, ...]

    def __str__(self) -> str:
        return (
            f"{self.family}, elements of at most {1e3 * self.element_size:.3g} mm, for "
            f"{1e-3 * self.frequency:.3g} kHz ({'; '.join(self.reasons)})"
        )


@checks.within_range
def advise(
    part: Sequence[float] | Structure,
    impactor: RigidMass | Sphere,
    *,
    E: float | None = None,
    nu: float = 0.3,
    rho: float | None = None,
) -> Advice:
    """The simplest sufficient element family for `impactor` on `part`, and its element size.

    Parameters
    ----------
    part : sequence of 3 floats, or Structure
        Length, width and thickness of the bounding box, m, with the impact along the thickness; or
        a structure, from which the dimensions and the material are taken.
    impactor : Sphere, or RigidMass with a tip
        Any other object with a mass, a velocity and a method `hertz(E, nu)` is accepted too.
    E, nu, rho : float
        Young's modulus [Pa], Poisson's ratio and density [kg/m^3] of the part, if `part` gives
        only dimensions.

    Raises
    ------
    InputError
        Dimensions that are not positive or not in descending order, no material, an impactor at
        rest or without Hertz's law; a structure of solids that is not a block.
    """
    length, width, thickness, material = _dimensions_and_material(part, E, nu, rho)
    E, nu, rho = material
    radius = getattr(impactor, "radius", None) or getattr(impactor, "tip_radius", None)
    if not hasattr(impactor, "hertz") or radius is None:
        raise InputError(
            "advise needs an impactor with its own contact law, such as a Sphere; got "
            f"{checks.shown(impactor)}."
        )

    speed = checks.positive("the impactor's velocity", impactor.velocity, "m/s")
    stiffness = impactor.hertz(E, nu).stiffness
    depth = (1.25 * impactor.mass * speed**2 / stiffness) ** 0.4
    time = HERTZ_TIME_FACTOR * depth / speed
    reduced = effective_modulus(E, nu, impactor.E, impactor.nu)
    contact = (0.75 * stiffness * depth**1.5 * radius / reduced) ** (1 / 3)
    frequency = BAND_TIME_PRODUCT / time
    bending = E * thickness**3 / (12 * (1 - nu**2))

    # the inelasticity of an infinite plate: C. Zener, Phys. Rev. 59 (1941) 669
    unit = (impactor.mass * speed**2 / stiffness) ** 0.4 / speed
    lam = impactor.mass / (8 * sqrt(bending * rho * thickness) * unit)

    # a beam holds below the bending of a free strip across it, a shell below its thickness shear
    across = 22.373 / (2 * pi * width**2) * sqrt(bending / (rho * thickness))
    shear = sqrt(E / (2 * (1 + nu)) / rho) / (2 * thickness)
    limits = {
        "beam": TRUSTED_FREQUENCY_SHARE * across,
        "shell": TRUSTED_FREQUENCY_SHARE * shear,
        "solid": np.inf,
    }
    slender = {"beam": length / width, "shell": sqrt(length * width) / thickness, "solid": np.inf}

    reasons = []
    for family, limit in limits.items():
        missing_names = []
        if frequency > limit and lam > SMALL_INELASTICITY:
            missing_names.append(f"holds up to {1e-3 * limit:.3g} kHz")
        if slender[family] < MIN_SLENDERNESS:
            missing_names.append(f"slenderness {slender[family]:.2g} ≤ {MIN_SLENDERNESS:g}")
        if family != "solid" and contact > MAX_CONTACT_RADIUS_RATIO * thickness:
            largest = f"{MAX_CONTACT_RADIUS_RATIO:g} of the thickness"
            share = f"{contact / thickness:.2g} ≥ {largest}"  # as rounded
            missing_names.append(f"contact radius {engineering(contact, 'm')}, {share}")
        if not missing_names:
            break
        reasons.append(f"{family} {' and '.join(missing_names)}")

    if lam <= SMALL_INELASTICITY:
        reasons.append(f"the part hardly moves during the contact (Zener's λ = {lam:.2g})")
    size, bound = _element_size(family, frequency, length, thickness, E, nu, rho)
    return Advice(
        family, time, frequency, size, contact, lam, limits, (*reasons, f"elements: {bound}")
    )


def _dimensions_and_material(
    part: Sequence[float] | Structure, E: float | None, nu: float, rho: float | None
) -> tuple[float, float, float, tuple[float, float, float]]:
    """(length, width, thickness, (E, nu, rho)) of a part; its length is at least its width."""
    if isinstance(part, Structure):
        size = np.array(part.dimensions)
        E, nu, rho = part.constants()
        filled = part.mass / (rho * size.prod())
        kind = getattr(part.matrices, "kind", None)
        solid = kind is None or bool(kind.outside)  # an assembly may have some
        if solid and filled < MIN_FILL:
            raise InputError(
                f"the part fills {percent(filled)} of its bounding box, whose sides do not tell "
                "its thickness: give advise the length, width and thickness at the site."
            )
    else:
        size = checks.floats("part's dimensions", part, (3,))

    if E is None or rho is None:
        raise InputError("the material of the part is missing: give advise(..., E=…, nu=…, rho=…).")
    length, width, thickness = (
        checks.positive(name, value, "m")
        for name, value in zip(("length", "width", "thickness"), size, strict=True)
    )
    if width > length:
        raise InputError(f"length must be >= width; got {length:g} and {width:g} m.")
    material = (checks.positive("E", E, "Pa"), checks.poisson(nu), checks.positive("rho", rho))
    return length, width, thickness, material


def _element_size(
    family: str, frequency: float, length: float, thickness: float, E: float, nu: float, rho: float
) -> tuple[float, str]:
    """(largest element size, the criterion that limits it)."""
    omega = 2 * pi * frequency
    shear = sqrt(E / (2 * (1 + nu)) / rho)
    bending = 2 * pi / sqrt(omega) * (E * thickness**2 / (12 * rho * (1 - nu**2))) ** 0.25

    # the wavelength in a thick plate lies between those of bending alone and of shear
    wave = min(bending, max(2 * pi * shear / omega, thickness))
    bounds = {f"{ELEMENTS_PER_WAVE:g} to the wave of {1e3 * wave:.3g} mm": wave / ELEMENTS_PER_WAVE}
    bounds["8 to the length"] = length / 8
    if family == "solid":
        bounds["2 through the thickness"] = thickness / 2
    bound = min(bounds, key=lambda key: bounds[key])
    if family == "solid":
        return bounds[bound], f"{bound}; no larger than the patch around the site"
    return bounds[bound], bound
