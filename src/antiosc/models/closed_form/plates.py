"""The disc over which an impact on a shell must be distributed so that the shell responds as a
solid plate.

A pressure of wave number k on one face of an elastic layer of thickness h moves that face, at rest
and minus the motion of a half-space, by G(k); a Reissner-Mindlin plate whose load and displacement
are spread over a disc with Hertz's pressure P(k) moves by P²/(Dk⁴) + P²/(κGh k²):

    G = (1 − ν)/(Gk) [cosh²x/(sinh 2x − 2x) + sinh²x/(sinh 2x + 2x) − 1],   x = kh/2,
    P = 3 (sin z − z cos z)/z³,   z = ka.

The terms in 1/k⁴ agree. Those in 1/k² are h²/5D and 1/κGh − a²/5D: they agree for
a = h √(ν/(1 − ν)) with κ = 5/6. The rest of the difference has a finite integral, a compliance
of the contact. A wider disc radiates too little into the plate, so that the impactor rebounds too
fast: the share that is lost is (kh)² (1 − 2ν)/(5(1 − ν)) for a disc of radius h.

Static layer: I. N. Sneddon, *Fourier Transforms* (1951), article 46, from Love's solution.
"""

from __future__ import annotations

from math import cos, cosh, exp, log, pi, sin, sinh, sqrt
from typing import NamedTuple

from antiosc.base import checks
from antiosc.base.errors import InputError

#: Mindlin's shear coefficient for the static and dynamic plate alike (Reissner's).
SHEAR = 5 / 6
#: Wave numbers times the thickness below which the integrand is a straight line, and beyond which a
#: layer is a half-space (8e-6, 4e-15 of the compliance).
LONG, HALF_SPACE = 0.05, 40.0
#: Wave numbers times the radius of the disc below which its spread is a parabola, and beyond which
#: it carries nothing (2e-8, 2e-7).
NARROW, SMOOTH = 0.01, 300.0
#: Poisson's ratios below it ask for a disc too small for a mesh.
LEAST_NU = 0.01


class PlatePatch(NamedTuple):
    """The patch of a site on a shell: a disc, and the shell's excess of compliance under it."""

    radius: float  # m
    local_compliance: float  # m/N


@checks.within_range
def plate_patch(E: float, nu: float, thickness: float) -> PlatePatch:
    """The patch with which an isotropic shell responds to an impact as a solid plate does.

    Use `Site(…, radius=patch.radius)`, and for the model `dataclasses.replace(model,
    local_compliance=patch.local_compliance)`: this compliance is then subtracted from Hertz's law.
    Valid for contacts smaller than the thickness, away from edges. `E` in Pa, `thickness` in m;
    InputError for data outside their range, and for Poisson's ratios below 0.01.
    """
    E = checks.positive("E", E, "Pa")
    thickness = checks.positive("thickness", thickness, "m")
    nu = checks.poisson(nu)
    if nu < LEAST_NU:
        raise InputError(
            f"nu = {nu:g}: the disc of a plate patch has the radius h sqrt(nu/(1 - nu)), which no "
            f"mesh resolves below nu = {LEAST_NU:g}; give the site a radius of its own."
        )
    disc = sqrt(nu / (1 - nu))
    return PlatePatch(thickness * disc, excess_compliance(nu, disc) / (E * thickness))


def excess_compliance(nu: float, disc: float) -> float:
    """Compliance under the disc of a `plate_patch` that the plate has more than the layer, for
    E = h = 1.
    """
    from scipy.integrate import quad  # loaded where it is used: it takes long

    G = 1 / (2 * (1 + nu))
    D = 1 / (12 * (1 - nu**2))

    def difference(k: float) -> float:
        """k times (plate minus layer)/2π."""
        z = k * disc
        x = k / 2
        P = 3 * (sin(z) - z * cos(z)) / z**3 if z > NARROW else 1 - z**2 / 10
        plate = P**2 * (1 / (D * k**4) + 6 / (5 * G * k**2))
        layer = 0.0
        if k < HALF_SPACE:
            bent = sinh(2 * x) - 2 * x
            denominator = sinh(2 * x) + 2 * x
            layer = (1 - nu) / (G * k) * (cosh(x) ** 2 / bent + sinh(x) ** 2 / denominator - 1)
        return k * (plate - layer) / (2 * pi)

    def in_logarithm(t: float) -> float:
        return exp(t) * difference(exp(t))

    long_waves = LONG * (1.5 * difference(LONG) - 0.5 * difference(2 * LONG))
    ends = log(LONG), log(SMOOTH / disc)
    short_waves = quad(in_logarithm, *ends, limit=1000, epsrel=1e-6)[0]
    return float(long_waves + short_waves)
