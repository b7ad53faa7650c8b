"""Choice of the contact law for two surfaces.

| surfaces | law | source |
|---|---|---|
| a laminate | `YangSun` | S. H. Yang, C. T. Sun, ASTM STP 787 (1982) |
| both flat, smaller radius a | `Punch`, 2 E* a | Johnson, (3.36) |
| curved, a known loss | `Gonthier`, Hertz's stiffness | Multibody Syst. Dyn. 11 (2004) |
| curved, a yield strength | `ElasticPlastic`, Hertz up to yield | that law's docstring |
| curved, none | `Hertz`, elliptic where curvatures differ | Johnson, 4.1-4.2 |

K. L. Johnson, Contact Mechanics, Cambridge 1985. The choice does not depend on the speed: the law
is valid below and above yield. If both materials yield, the law has the strength of the weaker one;
the stronger one counts as elastic, with a share that decreases as the strengths become similar
(`_elastic_share`). An elliptic contact yields as its `equivalent_circle`. The radius of an edge or
a corner is assumed; no error bar covers this error.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache, partial
from math import acos, degrees, exp, inf, pi, sqrt

from antiosc.base.errors import InputError, SiteError
from antiosc.base.texts import engineering
from antiosc.engine.contact.base import ContactLaw
from antiosc.engine.contact.curvature import PLANE, SHARP_KINDS
from antiosc.engine.contact.geometry import (
    effective_modulus,
    equivalent_circle,
    hertz_stiffness,
    relative_from_principal,
)
from antiosc.engine.contact.laws import ElasticPlastic, Gonthier, Hertz, Punch, YangSun
from antiosc.engine.contact.surfaces import RIGID_MATTER, RUBBER_E, RUBBER_NU, Matter, Surface

#: Loss factor from which a contact of a material that does not yield is damped: below it the
#: restitution exp(-pi loss/2) is above 0.97.
LOSSY_FACTOR = 0.02
#: A relative curvature below this share of the other one counts as 0: the contact is a line.
NO_CURVATURE = 1e-9
#: Ratio of strengths from which the stronger side stays elastic: the mean pressure grows to 2.8 of
#: the weaker strength, and a side yields at 1.07 of its own (benchmarks/elastoplastic).
ELASTIC_STRENGTH_RATIO = 2.6
#: The same up to about 100 yield indentations. Between 1 and this ratio the share grows as the
#: square root: the force is within 1.5 % of finite elements at 1.2 and 1.5 (unlike.csv; within 3
#: and 5 % for a linear growth up to `ELASTIC_STRENGTH_RATIO`).
STRENGTH_RATIO = 1.6

#: Unknown property (`Choice.unknown`) of contacts without a yield strength.
UNKNOWN_STRENGTH = "whether one side yields (give the yield strength or a material)"
#: The peak force of Hertz's law grows with each relative radius to this power, at equal work.
RADIUS_POWER = 0.1


@dataclass(frozen=True)
class Choice:
    """A contact law, and the reason for its choice."""

    law: ContactLaw
    kind: str  # of contact, in words
    soft: Matter | None = None  # the material that yields first; None if neither yields
    unknown: str = ""  # the unknown property on which the error of the law depends, in words
    error: float = 0.0  # of the force, relative, due to the circle in place of an ellipse
    curvature_error: float = 0.0  # of the peak force, relative, by both curvatures on a mesh
    curvature: float = 0.0  # the larger relative one of a contact at a point [1/m]
    soft_ball: bool = False  # whether the rounder side is softer, as a rubber tip on steel

    @property
    def reason(self) -> str:
        """The reason for this law, without a full stop."""
        if self.soft is None or self.soft.yield_strength is None:
            return self.kind
        name = self.soft.name or "the weaker side"
        strength = self.soft.yield_strength
        return f"{self.kind}: {name} has a yield strength of {engineering(strength, 'Pa')}"


@lru_cache(maxsize=4096)
def choose_law(one: Surface, other: Surface, restitution: float | None = None) -> Choice:
    """The contact law for two surfaces; `restitution` if it is known. InputError if none fits."""
    materials = one.matter, other.matter
    elastic = sorted((m for m in materials if not m.rigid), key=lambda m: m.E)
    if not elastic:
        raise InputError(
            "two rigid surfaces have no law of contact: give one of them a material, or the law."
        )

    first, *other_elastic = elastic
    second = other_elastic[0] if other_elastic else RIGID_MATTER
    modulus = effective_modulus(first.E, first.nu, second.E, second.nu)
    A, B = relative_from_principal(one.curvatures, other.curvatures, _axes_angle(one, other))
    uncertain = sum(surface.error for surface in (one, other) if any(surface.curvatures))
    doubt = _unknown_property(one, other)
    straight = all(0.0 in surface.curvatures for surface in (one, other))
    if B <= 0 or A < -NO_CURVATURE * B or (A <= NO_CURVATURE * B and not straight):
        if one.kind == other.kind == PLANE:
            return _punch_choice(one, other, modulus)
        raise SiteError(_hollow_reason(one, other))
    if A <= NO_CURVATURE * B:
        raise InputError(
            "the surfaces touch along a line: give the law of the contact, such as Tabulated."
        )

    shape = "" if A == B else ", elliptic"
    if any(m.rubbery and not m.brittle for m in materials):
        softest = engineering(RUBBER_E, "Pa")
        shape += f", with a rubber (E up to {softest}, nu from {RUBBER_NU:g}), which does not yield"

    rounder, flatter = sorted((one, other), key=lambda surface: -surface.curvatures[1])
    is_soft = rounder.matter.E <= flatter.matter.E
    if uncertain >= 2 * A and not doubt:  # one surface may fit into the other
        doubt = "the curvature at the site is too uncertain (smaller elements around the site)"
    by_curvature = RADIUS_POWER * (uncertain / (2 * A) + uncertain / (2 * B))
    at_point = partial(Choice, curvature_error=by_curvature, curvature=2 * B, soft_ball=is_soft)
    soft = min(materials, key=_strength)
    laminate = next((m for m in materials if m.critical is not None), None)
    if laminate is not None and laminate.critical is not None:
        stiffness = hertz_stiffness(modulus, A, B)
        doubt = "the indentation from which this laminate is damaged"
        law: ContactLaw = YangSun(stiffness, laminate.critical)
        return Choice(law, f"a laminate{shape}", None, doubt)

    if restitution is None and first.brittle and first.loss >= LOSSY_FACTOR:
        restitution = exp(-pi * first.loss / 2)

    if restitution is not None and restitution < 1:
        kind = f"elastic{shape}, with the restitution {restitution:.3g}"
        damped = Gonthier(hertz_stiffness(modulus, A, B), restitution)
        return at_point(damped, kind, None, doubt)
    if soft.yield_strength is None:
        hertz = Hertz(hertz_stiffness(modulus, A, B))
        return at_point(hertz, f"elastic{shape}", None, doubt)
    circle = equivalent_circle(modulus, A, B)
    share = _elastic_share(soft, materials[soft is materials[0]], modulus)
    law = ElasticPlastic(circle.modulus, circle.radius, soft.yield_strength, soft.nu, share)
    return at_point(law, f"elastoplastic{shape}", soft, doubt, circle.error)


def _hollow_reason(one: Surface, other: Surface) -> str:
    """Reason why two surfaces that fit into each other have no law, with the remedy."""
    deepest = min(surface.curvatures[0] for surface in (one, other))
    remedy = "give the law of the contact (its kind and stiffness)"

    if deepest < 0:
        radius = engineering(-1 / deepest, "m")
        smaller = engineering(-0.9 / deepest, "m")
        remedy = (
            f"the site lies in a hole or groove of radius {radius}. Move it (in the page: click"
            f" beside it), strike with a ball of a radius below {smaller}, or {remedy}"
        )

    return f"the surfaces fit into each other, which is no contact at a point: {remedy}."


def _strength(matter: Matter) -> float:
    if matter.yield_strength is None:
        return inf
    return matter.yield_strength


def _elastic_share(soft: Matter, other: Matter, modulus: float) -> float:
    """`elastic_share` of the law; `modulus`: E* [Pa]."""
    largest_share = 0.0 if other.rigid else (1 - other.nu**2) / other.E * modulus
    ratio = _strength(other) / _strength(soft)
    if largest_share == 0.0 or ratio >= ELASTIC_STRENGTH_RATIO:
        return largest_share
    return largest_share * min(sqrt((ratio - 1) / (STRENGTH_RATIO - 1)), 1.0)


def _axes_angle(first: Surface, second: Surface) -> float:
    """Angle in degrees between the first principal directions of both surfaces; 0 if unknown."""
    if first.along is None or second.along is None:
        return 0.0
    cosine = abs(sum(a * b for a, b in zip(first.along, second.along, strict=True)))
    return degrees(acos(min(cosine, 1.0)))


def _unknown_property(first: Surface, second: Surface) -> str:
    """Text: the unknown property on which the error of a law depends; "" if all are known."""
    for surface in (first, second):
        if surface.kind in SHARP_KINDS:
            radius = 1e3 / surface.curvatures[1]
            return f"the radius of the {surface.kind}, taken as {radius:.3g} mm (give a radius)"

    if not (first.matter.known and second.matter.known):
        return UNKNOWN_STRENGTH
    return ""


def lacks_strength(choice: Choice) -> bool:
    """Whether the law depends on a yield strength that is not known."""
    return choice.unknown == UNKNOWN_STRENGTH


def _punch_choice(first: Surface, second: Surface, modulus: float) -> Choice:
    """Choice for two flat faces of modulus E* [Pa]: a rigid punch of the smaller radius."""
    sizes = [s.radius for s in (first, second) if s.radius is not None]
    if not sizes:
        raise InputError(
            "two flat surfaces, and neither has a radius: give that of the site's patch, the "
            "tip_radius of what strikes, or the law of the contact."
        )

    reason = f"flat faces over a radius of {engineering(min(sizes), 'm')}"
    doubt = "the pressure of flat faces, which are never quite parallel"
    return Choice(Punch(2 * modulus * min(sizes)), reason, None, doubt)


def elastic_pressure(law: ElasticPlastic, depth: float) -> float:
    """Largest pressure [Pa] of a Hertz contact with the loading work of `law` at a depth [m]."""
    elastic = (2.5 * law.loading_work(depth) / law.stiffness) ** 0.4
    return 2 * law.modulus / pi * sqrt(elastic / law.radius)
