"""Sentence on a contact of a material that cracks before it yields.

Beside a contact the surface is stretched: at the rim of radius a, under any pressure that is
symmetric about the axis, by (1 - 2 nu) F / (2 pi a^2), which is (1 - 2 nu)/3 of Hertz's largest
pressure (K. L. Johnson, Contact Mechanics, 1985, 3.4). A ring crack begins there. It needs more
than the strength of bending tests where the contact is small, since the tension falls within a
fraction of a: the load is proportional to the radius of the ball (F. Auerbach, Ann. Phys. Chem. 43
(1891) 61; F. C. Frank, B. R. Lawn, Proc. R. Soc. A 299 (1967) 291).
"""

from __future__ import annotations

from collections.abc import Sequence
from math import pi
from typing import Any

from antiosc.base.texts import engineering
from antiosc.engine.contact.choice import elastic_pressure
from antiosc.engine.contact.dent import rim_radius
from antiosc.engine.contact.geometry import effective_modulus, hertz_pressure
from antiosc.engine.contact.laws import ElasticPlastic, Gonthier, Hertz
from antiosc.engine.contact.surfaces import Matter

#: What a bending test and a contact do not share.
SMALL = (
    "cracks are not computed; flaws decide, and a small contact bears more than bending tests"
    " (Auerbach's law)"
)


def sentence(contact: Any, sides: Sequence[Matter]) -> str:
    """Sentence on the tension at the rim of a contact on each side that cracks; "" if none does."""
    if not contact.peak_force > 0 or all(matter.tensile is None for matter in sides):
        return ""
    pressure = mean_pressure(contact, sides)
    return "" if pressure is None else cracks(sides, pressure)


def cracks(sides: Sequence[Matter], pressure: float) -> str:
    """The sentences on the sides that crack, under this mean pressure [Pa] of the contact."""
    return " ".join(_of_side(matter, pressure) for matter in brittle(sides))


def brittle(sides: Sequence[Matter]) -> list[Matter]:
    """The materials that crack, each once."""
    return [matter for matter in dict.fromkeys(sides) if matter.tensile is not None]


def name_of(matter: Matter) -> str:
    """A material that cracks, in words."""
    return matter.name or "the brittle side"


def mean_pressure(contact: Any, sides: Sequence[Matter]) -> float | None:
    """Largest force over the area of the contact [Pa]; None for laws without an area."""
    law = contact.law
    if isinstance(law, ElasticPlastic):
        if contact.peak_force > law.yield_force:
            return contact.peak_force / (pi * rim_radius(law, contact.deepest) ** 2)
        return 2 / 3 * elastic_pressure(law, contact.deepest)
    if not isinstance(law, Hertz | Gonthier):
        return None
    return 2 / 3 * hertz_pressure(law.stiffness, modulus_of(sides), contact.peak_force)


def modulus_of(sides: Sequence[Matter]) -> float:
    """E* [Pa] of two sides."""
    return effective_modulus(*(value for matter in sides for value in (matter.E, matter.nu)))


def _of_side(matter: Matter, pressure: float) -> str:
    """The sentence on one side under this mean pressure [Pa]."""
    assert matter.tensile is not None
    low, high = matter.tensile
    tension = (1 - 2 * matter.nu) / 2 * pressure
    rounded = (float(f"{tension / bound:.2g}") for bound in (high, low))
    shares = " to ".join(dict.fromkeys(f"{share:.12g}" for share in rounded))
    strengths = " to ".join(dict.fromkeys(engineering(bound, "Pa") for bound in (low, high)))
    verdict = "it may crack there" if tension >= low else "no crack is expected there"
    return (
        f"In {name_of(matter)} the tension at the rim of the contact is"
        f" {engineering(tension, 'Pa')}, {shares} times its strength in bending tests"
        f" ({strengths}): {verdict}; {SMALL}."
    )
