"""The disc over which a blow on a shell must be spread so that it answers as a solid plate does.

A pressure of wave number k on one face of an elastic layer of thickness h moves that face, at rest
and without what it would move a half-space, by G(k); a Reissner-Mindlin plate whose load and
displacement are spread over a disc with Hertz's pressure P(k) moves by P²/(Dk⁴) + P²/(κGh k²):

    G = (1 − ν)/(Gk) [cosh²x/(sinh 2x − 2x) + sinh²x/(sinh 2x + 2x) − 1],   x = kh/2,
    P = 3 (sin z − z cos z)/z³,   z = ka.

The terms in 1/k⁴ agree. Those in 1/k² are h²/5D and 1/κGh − a²/5D: they agree for
a = h √(ν/(1 − ν)) with κ = 5/6. What is left of the difference has a finite integral, a compliance
of the contact. A wider disc radiates too little into the plate, so that the impactor rebounds too
fast: the share that is lost is (kh)² (1 − 2ν)/(5(1 − ν)) for a disc of radius h.

Static layer: I. N. Sneddon, *Fourier Transforms* (1951), article 46, from Love's solution.
"""

from __future__ import annotations

from functools import lru_cache
from math import cos, cosh, exp, log, pi, sin, sinh, sqrt
from typing import NamedTuple

from scipy.integrate import quad

from antiosc.base import checks
from antiosc.base.errors import InputError

#: Wave numbers times the thickness below which the integrand is a straight line (its terms cancel
#: there), and beyond which a layer is a half-space.
LONG, HALF_SPACE = 0.05, 40.0
#: Wave numbers times the radius of the disc below which its spread is a parabola, and beyond which
#: it carries nothing.
NARROW, SMOOTH = 0.01, 300.0
#: Poisson's ratios below it ask for a disc too small for a mesh.
LEAST_NU = 0.01


class PlatePatch(NamedTuple):
    """The patch of a site on a shell.

    Attributes
    ----------
    radius : of the disc, m.
    local_compliance : what the shell's own compliance under it has too much, m/N.
    """

    radius: float
    local_compliance: float


@checks.within_range
def plate_patch(E: float, nu: float, thickness: float) -> PlatePatch:
    """The patch that makes an isotropic shell answer a blow as a solid plate does.

    Take `Site(…, radius=patch.radius)` and, as the compliance holds for the contact and not for
    the shell, `dataclasses.replace(model, local_compliance=patch.local_compliance)`: Hertz's law
    takes it out again. Smaller contacts than the thickness, away from edges.

    Parameters
    ----------
    E, nu, thickness : float
        Young's modulus [Pa], Poisson's ratio, thickness [m].

    Raises
    ------
    InputError
        Data outside their range; Poisson's ratio below 0.01.

    Source: the integral above, of Love's solution for a layer and of Reissner's plate.
    """
    E, thickness = checks.positive("E", E, "Pa"), checks.positive("thickness", thickness, "m")
    nu = checks.poisson(nu)
    if nu < LEAST_NU:
        raise InputError(
            f"nu = {nu:g}: the disc of a plate patch has the radius h sqrt(nu/(1 - nu)), which no "
            f"mesh resolves below nu = {LEAST_NU:g}; give the site a radius of its own."
        )
    return PlatePatch(thickness * sqrt(nu / (1 - nu)), _compliance(nu) / (E * thickness))


@lru_cache(maxsize=64)
def _compliance(nu: float) -> float:
    """The integral for E = h = 1: what the plate moves more than the layer."""
    G, D, a = 1 / (2 * (1 + nu)), 1 / (12 * (1 - nu**2)), sqrt(nu / (1 - nu))

    def difference(k: float) -> float:
        """k times (plate minus layer)/2π."""
        z, x = k * a, k / 2
        P = 3 * (sin(z) - z * cos(z)) / z**3 if z > NARROW else 1 - z**2 / 10
        plate = P**2 * (1 / (D * k**4) + 6 / (5 * G * k**2))
        layer = 0.0
        if k < HALF_SPACE:
            bent, squeezed = sinh(2 * x) - 2 * x, sinh(2 * x) + 2 * x
            layer = (1 - nu) / (G * k) * (cosh(x) ** 2 / bent + sinh(x) ** 2 / squeezed - 1)
        return k * (plate - layer) / (2 * pi)

    def in_logarithm(t: float) -> float:
        return exp(t) * difference(exp(t))

    below = LONG * (1.5 * difference(LONG) - 0.5 * difference(2 * LONG))
    above = quad(in_logarithm, log(LONG), log(SMOOTH / a), limit=1000, epsrel=1e-6)[0]
    return float(below + above)
