"""Stresses under the contact of a spherical surface, after Hertz: what no mesh resolves."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from antiosc.base import checks
from antiosc.base._types import Array
from antiosc.base.brief import Brief
from antiosc.base.errors import InputError
from antiosc.contact.geometry import effective_modulus

#: Depths over the contact radius at which the shear stress is looked at.
DEPTHS = np.linspace(0.01, 2.0, 4000)


@dataclass(frozen=True, eq=False, repr=False)
class ContactStress(Brief):
    """Elastic stresses in the struck surface under a spherical contact.

    Attributes
    ----------
    radius : radius a of the contact, m.
    pressure : largest pressure p0, in the middle, Pa.
    shear : largest shear stress, on the axis, Pa.
    depth : below the surface at which it acts, m.
    tension : radial tensile stress at the edge of the contact, (1 − 2ν) p0/3, Pa.
    """

    radius: float
    pressure: float
    shear: float
    depth: float
    tension: float


@checks.within_range
def contact_stress(
    impactor: Any, force: float, E: float, nu: float, radius: float = np.inf
) -> ContactStress:
    """Hertz's stresses where a sphere or a spherical tip presses on an elastic surface.

    p0 = 3F/(2πa²) with a³ = 3FR/(4E*); the stresses on the axis: K. L. Johnson, *Contact
    Mechanics* (1985), (3.45). They hold as long as nothing yields and a is small against both
    radii.

    Parameters
    ----------
    impactor : Sphere or RigidMass with tip_radius, E and nu
    force : float
        [N], for instance `hit.peak_force`.
    E, nu : float
        Young's modulus [Pa] and Poisson's ratio of the struck surface.
    radius : float
        Of the struck surface [m]; default: flat; negative: hollow.

    Raises
    ------
    InputError
        An impactor without a radius and constants; a hollow that fits the impactor.
    """
    own = getattr(impactor, "radius", None) or getattr(impactor, "tip_radius", None)
    own_E, own_nu = getattr(impactor, "E", None), getattr(impactor, "nu", None)
    if isinstance(impactor, type) or own is None or own_E is None or own_nu is None:
        raise InputError(
            "contact_stress needs a Sphere, or RigidMass(mass, tip_radius=…, E=…, nu=…); got "
            f"{checks.shown(impactor)}."
        )
    force = checks.positive("force", force, "N")
    modulus = effective_modulus(own_E, own_nu, E, nu)
    nu = checks.poisson(nu)
    curvature = 1 / checks.positive("the radius of the impactor", own, "m")
    if not checks.endless(radius):
        radius = checks.number("radius", radius, "m")
        if radius == 0:
            raise InputError("radius must not be 0; inf is a flat surface.")
        curvature += 1 / radius
    if curvature <= 0:
        raise InputError(
            f"the hollow of radius {radius:g} m does not let the impactor of radius {own:g} m "
            "touch at a point."
        )
    a = (0.75 * force / (curvature * modulus)) ** (1 / 3)
    pressure = 1.5 * force / (np.pi * a**2)
    shear = _shear_on_axis(nu)
    k = int(np.argmax(shear))
    return ContactStress(
        radius=float(a),
        pressure=float(pressure),
        shear=float(shear[k] * pressure),
        depth=float(DEPTHS[k] * a),
        tension=float((1 - 2 * nu) / 3 * pressure),
    )


def hertz_pressure(stiffness: float, modulus: float, force: float) -> float:
    """Largest pressure [Pa] of Hertz's law k_H [N m^-3/2] and E* [Pa] at a force [N].

    Of an elliptic contact that of the circular one with the same k_H. Johnson, (4.24).
    """
    radius = (0.75 * stiffness / modulus) ** 2
    return float((6 * force * modulus**2 / (np.pi**3 * radius**2)) ** (1 / 3))


def _shear_on_axis(nu: float) -> Array:
    """|σz − σr|/2 over p0 at `DEPTHS`."""
    z = DEPTHS
    normal = -1 / (1 + z**2)
    radial = -(1 + nu) * (1 - z * np.arctan(1 / z)) - normal / 2
    return np.asarray(np.abs(normal - radial) / 2)
