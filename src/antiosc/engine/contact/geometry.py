"""Hertz's contact: its stiffness, and the stresses under it, which meshes do not resolve.

K. L. Johnson, Contact Mechanics, Cambridge University Press 1985, sections 3.4 and 4.1-4.2. The
stresses in the half-space: M. T. Huber, Annalen der Physik 319 (1904) 153; A. C. Fischer-Cripps,
*Introduction to Contact Mechanics*, Springer 2007, (5.4.2).
"""

from __future__ import annotations

from dataclasses import dataclass
from math import cos, exp, log, pi, radians, sqrt
from typing import NamedTuple

import numpy as np

from antiosc.base import checks, plausible
from antiosc.base._types import Array
from antiosc.base.errors import InputError
from antiosc.base.texts import ReprMixin

Radii = float | tuple[float, float]
#: Plastic pressure of a line contact over that of a ball, minus 1.
LINE_PRESSURE = 0.06


def effective_modulus(E1: float, nu1: float, E2: float | None, nu2: float | None) -> float:
    """E* [Pa] with 1/E* = (1 - nu1^2)/E1 + (1 - nu2^2)/E2; E2 None or infinite: rigid body 2."""
    moduli = [checks.positive("E1", E1, "Pa")]
    compliance = (1 - checks.poisson(nu1) ** 2) / moduli[0]
    if E2 is not None and not checks.is_rigid(E2):
        moduli.append(checks.positive("E2", E2, "Pa"))
        compliance += (1 - checks.poisson(nu1 if nu2 is None else nu2) ** 2) / moduli[1]

    softest = min(moduli)
    if softest < plausible.MODULUS_RANGE[0]:
        plausible.warn_each(
            [plausible.range_doubt("modulus", softest, "E of a surface in contact")]
        )
    return 1 / compliance


def relative_curvatures(radii1: Radii, radii2: Radii, angle: float) -> tuple[float, float]:
    """A <= B [1/m] of the gap A x^2 + B y^2; `angle` in degrees (Johnson, (4.3)-(4.5))."""
    first = _curvatures("radii1", radii1)
    second = _curvatures("radii2", radii2)
    A, B = relative_from_principal(first, second, angle)
    if A <= 1e-12 * B or B <= 0:
        raise InputError(
            f"the surfaces must part in every direction from their point of contact; the relative"
            f" curvatures are {2 * A:g} and {2 * B:g} 1/m."
        )

    return A, B


def relative_from_principal(
    first: tuple[float, float], second: tuple[float, float], angle: float
) -> tuple[float, float]:
    """As `relative_curvatures`, from principal curvatures [1/m]; A may be 0 or less."""
    total = sum(first) + sum(second)
    c1 = first[0] - first[1]
    c2 = second[0] - second[1]
    difference = sqrt(max(c1 * c1 + c2 * c2 + 2 * c1 * c2 * cos(2 * radians(angle)), 0.0))
    return (total - difference) / 4, (total + difference) / 4


def hertz_stiffness(E_star: float, A: float, B: float) -> float:
    """k_H [N m^-3/2] of F = k_H delta^(3/2) for an elliptic contact. Johnson eq. (4.24)-(4.26)."""
    _, D, K = _ellipse(B / A)
    return float(2 * pi * E_star / 3 * sqrt(D / A) / K**1.5)


class EquivalentCircle(NamedTuple):
    """The circular contact that replaces an elliptic one; `error`: relative error of the force."""

    modulus: float  # contact modulus E* [Pa]
    radius: float  # relative radius of curvature [m]
    error: float


def equivalent_circle(E_star: float, A: float, B: float) -> EquivalentCircle:
    """The circular contact with the stiffness and, at each indentation, the pressure of an ellipse.

    It therefore yields where the ellipse does, except for slender ellipses, and has the same area,
    pi R delta. In full plasticity the area of the ellipse is 2 pi delta/(2 sqrt(A B)), larger by 2,
    6, 13 % for B/A = 3, 10, 50; the pressure of a line contact is (2 + pi)/sqrt(3) Y, 6 % above
    2.8 Y of a ball (R. Hill, The Mathematical Theory of Plasticity, 1950). The error is the sum
    of both differences; by finite elements it is 1 and 4 % for B/A = 3 and 10 (measured).
    """
    if A == B:
        return EquivalentCircle(E_star, 1 / (2 * A), 0.0)
    m1, D, K = _ellipse(B / A)
    stiffness = 2 * pi * E_star / 3 * sqrt(D / A) / K**1.5
    pressure = E_star * sqrt(A / (K * D * m1))  # over the root of the indentation
    radius = 1.5 * stiffness / (pi * pressure)
    error = 1 - radius * 2 * sqrt(A * B) + LINE_PRESSURE * (1 - sqrt(m1))
    return EquivalentCircle(0.75 * stiffness / sqrt(radius), radius, error)


def _ellipse(ratio: float) -> tuple[float, float, float]:
    """(b/a)^2 and elliptic integrals D and K of the contact ellipse, from B/A >= 1."""
    if ratio - 1 <= 1e-12:
        return _integrals(1.0)

    from scipy.optimize import brentq  # loaded where it is used: it takes long

    def excess(y: float) -> float:
        """Logarithm of B/A for (b/a)^2 = exp(y), minus the logarithm of the required ratio."""
        m1, D, K = _integrals(exp(y))
        return log((K - D) / (m1 * D) / ratio)

    # (b/a)^2 is below A/B, and for slender ellipses nearly its power 4/3
    return _integrals(exp(brentq(excess, -1.5 * log(ratio), -log(ratio), xtol=1e-13, rtol=1e-14)))


def _integrals(m1: float) -> tuple[float, float, float]:
    """(m1 = (b/a)^2, D, K) by Carlson's elliptic integrals, DLMF 19.25.1; B/A = (K - D)/(m1 D)."""
    from scipy.special import elliprd, elliprf  # loaded where they are used

    return m1, float(elliprd(0.0, m1, 1.0)) / 3, float(elliprf(0.0, m1, 1.0))


def _curvatures(name: str, radii: Radii) -> tuple[float, float]:
    is_pair = isinstance(radii, list | tuple) or (isinstance(radii, np.ndarray) and radii.ndim)
    pair = tuple(radii) if is_pair else (radii, radii)  # type: ignore[arg-type]
    if len(pair) != 2:
        raise InputError(
            f"{name} must be one radius or a pair of principal radii; got {checks.shown(radii)}."
        )

    values = []
    for r in pair:
        if checks.is_infinite(r):
            values.append(0.0)
            continue
        radius = checks.number(name, r, "m")
        if radius == 0:
            raise InputError(
                f"{name} must be non-zero radii in m (inf: flat, negative: hollow); got "
                f"{checks.shown(radii)}."
            )
        values.append(1 / radius)

    return values[0], values[1]


#: Least distance from the axis over the contact radius: the formulas divide by this distance.
LEAST_AXIS_DISTANCE = 1e-4
#: Least depth over the radius: at the edge of the circle the formulas divide by 0 on the surface.
LEAST_DEPTH = 1e-8


def hertz_stresses(force: float, radius: float, nu: float, r: Array, z: Array) -> Array:
    """Stresses [Pa] rr, tt, zz, rz (4, …) at r and depths z [m] under a contact of `radius` [m]."""
    a = radius
    r, z = np.maximum(r, LEAST_AXIS_DISTANCE * a), np.maximum(z, LEAST_DEPTH * a)
    beyond = r**2 + z**2 - a**2
    root = np.hypot(beyond, 2 * a * z)
    inside = beyond < 0
    u = np.where(inside, 0.0, (beyond + root) / 2)
    np.divide(2 * (a * z) ** 2, root - beyond, out=u, where=inside)
    squared = np.where(inside, (root - beyond) / (2 * a**2), 0.0)  # z^2/u
    np.divide(2 * z**2, root + beyond, out=squared, where=~inside)
    share = np.sqrt(squared)
    of_angle = (1 + nu) * np.sqrt(u) / a * np.arctan2(a, np.sqrt(u))
    of_depth = u * (1 - nu) / (a**2 + u)
    lateral = (1 - 2 * nu) / 3 * (a / r) ** 2 * (1 - share**3)
    along = a**2 / (u + a**2 * squared)
    rr = lateral + share**3 * along + share * (of_depth + of_angle - 2)
    tt = -lateral - share * (2 * nu + of_depth - of_angle)
    rz = -r * squared / (u + a**2 * squared) * a**2 * np.sqrt(u) / (a**2 + u)
    return 1.5 * force / (pi * a**2) * np.stack([rr, tt, -(share**3) * along, rz])


def von_mises(stresses: Array) -> Array:
    """Von Mises stress [Pa] (…) of stresses rr, tt, zz, rz (4, …)."""
    rr, tt, zz, rz = stresses
    squares = (rr - tt) ** 2 + (tt - zz) ** 2 + (zz - rr) ** 2
    return np.sqrt(squares / 2 + 3 * rz**2)


#: Depths over the contact radius at which the shear stress is looked at.
SAMPLED_DEPTHS = np.linspace(0.01, 2.0, 4000)


@dataclass(frozen=True, eq=False, repr=False)
class ContactStress(ReprMixin):
    """Elastic stresses in the struck surface under a spherical contact.

    Attributes
    ----------
    radius : radius a of the contact, m.
    pressure : largest pressure p0, in the middle, Pa.
    shear : largest shear stress, on the axis, Pa.
    depth : depth of the largest shear stress below the surface, m.
    tension : radial tensile stress at the edge of the contact, (1 − 2ν) p0/3, Pa.
    """

    radius: float
    pressure: float
    shear: float
    depth: float
    tension: float


@checks.within_range
def contact_stress(
    impactor: object, force: float, E: float, nu: float, radius: float = np.inf
) -> ContactStress:
    """Hertz's stresses under a sphere or a spherical tip that presses on an elastic surface.

    p0 = 3F/(2πa²) with a³ = 3FR/(4E*); stresses on the axis are from K. L. Johnson, *Contact
    Mechanics* (1985), (3.45). They hold if nothing yields and a is small against both radii.

    Parameters
    ----------
    impactor : Sphere or RigidMass with tip_radius, E and nu
    force : float
        Force [N], for instance `hit.peak_force`.
    E, nu : float
        Young's modulus [Pa] and Poisson's ratio of the struck surface.
    radius : float
        Radius of the struck surface [m]; default: flat; negative: hollow.

    Raises
    ------
    InputError
        An impactor without a radius and constants; a hollow of the impactor's radius or less.
    """
    tip = getattr(impactor, "radius", None) or getattr(impactor, "tip_radius", None)
    own_E = getattr(impactor, "E", None)
    own_nu = getattr(impactor, "nu", None)
    if isinstance(impactor, type) or tip is None or own_E is None or own_nu is None:
        raise InputError(
            "contact_stress needs a Sphere, or RigidMass(mass, tip_radius=…, E=…, nu=…); got "
            f"{checks.shown(impactor)}."
        )

    force = checks.positive("force", force, "N")
    modulus = effective_modulus(own_E, own_nu, E, nu)
    nu = checks.poisson(nu)
    curvature = 1 / checks.positive("the radius of the impactor", tip, "m")

    if not checks.is_infinite(radius):
        radius = checks.number("radius", radius, "m")
        if radius == 0:
            raise InputError("radius must not be 0; inf is a flat surface.")
        curvature += 1 / radius

    if curvature <= 0:
        raise InputError(
            f"the hollow of radius {radius:g} m does not let the impactor of radius {tip:g} m "
            "touch at a point."
        )

    a = (0.75 * force / (curvature * modulus)) ** (1 / 3)
    pressure = 1.5 * force / (np.pi * a**2)
    rr, _, zz, _ = hertz_stresses(force, a, nu, np.zeros(SAMPLED_DEPTHS.size), a * SAMPLED_DEPTHS)
    shear = np.abs(zz - rr) / 2
    k = int(np.argmax(shear))

    return ContactStress(
        radius=float(a),
        pressure=float(pressure),
        shear=float(shear[k]),
        depth=float(SAMPLED_DEPTHS[k] * a),
        tension=float((1 - 2 * nu) / 3 * pressure),
    )
