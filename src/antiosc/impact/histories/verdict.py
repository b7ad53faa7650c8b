"""Sentences on yielding and permanent indentation of a contact."""

from __future__ import annotations

from collections.abc import Iterable
from math import sqrt
from typing import Any, NamedTuple

import numpy as np

from antiosc.base._types import Array
from antiosc.base.errors import InputError
from antiosc.base.texts import engineering, percent, restitution_text
from antiosc.engine.contact.choice import Choice, elastic_pressure, lacks_strength
from antiosc.engine.contact.dent import rim_radius
from antiosc.engine.contact.geometry import hertz_stresses, von_mises
from antiosc.engine.contact.laws import ElasticPlastic, Hertz
from antiosc.engine.contact.peak_error import error_of_peak
from antiosc.engine.contact.surfaces import Matter, crack_note
from antiosc.impact.histories.parts import OneContact
from antiosc.impact.scene_parts import find_site
from antiosc.models.body import choice_at_sites, site_points

#: Radius excluded from the margin of a solid, in contact radii. There Hertz's von Mises stress
#: is 4 % of its largest on the surface and 17 % below the contact (nu = 0.3; Johnson, *Contact
#: Mechanics*, 3.4), and the plastic zone of a full dent has 2 to 3 radii (6.3).
PLASTIC_ZONE_RADII = 3.0
#: Directions from a contact, and distances over the radius of a patch, at which Hertz's stress is
#: evaluated: beyond the farthest the size of the patch changes 2e-4 of its pressure.
ANGLE_COUNT, DISTANCE_COUNT = 19, 40
MIN_DISTANCE_RATIO, MAX_DISTANCE_RATIO = 0.02, 20.0
#: Radius over the thickness of a sheet of the circle on which a point force acts (Westergaard).
POINT_CIRCLE_RATIO = 0.325


def law_choice(contact: OneContact) -> Choice | None:
    """The law chosen by the surfaces of a contact; None if a surface is unknown."""
    try:
        (_, first, one), (_, second, other) = _contact_sides(contact)
        return choice_at_sites(first, second, (one, other))
    except InputError:
        return None


def _contact_sides(contact: OneContact) -> list[tuple[str, Any, str]]:
    """(name, body, site) of both sides of a contact."""
    scene = contact._record.assembly.scene
    parts = scene.contacts[contact._row]
    ends = [end.partition(":") for end in (parts.a, parts.b)]
    return [(name, scene.bodies[name], site) for name, _, site in ends]


def yield_share(contact: OneContact) -> float | None:
    """Peak force divided by the force at first yield of the contact; None if unknown."""
    law = _law_with_yield(contact)
    return None if law is None else contact.peak_force / law.yield_force


def _law_with_yield(contact: OneContact) -> ElasticPlastic | None:
    """Elastic-plastic law of a contact, or the one chosen from its surfaces; None if none."""
    law = contact.law
    if not isinstance(law, ElasticPlastic):
        choice = law_choice(contact) if isinstance(law, Hertz) else None
        law = law if choice is None else choice.law
    return law if isinstance(law, ElasticPlastic) else None


class ContactZone(NamedTuple):
    """Place, size and force of a contact on one body."""

    point: Array  # (3,) [m]
    radius: float  # of the contact [m]
    #: radius [m] over which the model spreads the force; inf: over modes of the whole body
    patch: float
    force: float  # the largest [N]
    nu: float  # Poisson's ratio of the softer side, or of the one that yields
    thickness: float = 0.0  # of a sheet [m], 0 of a solid

    @property
    def ball(self) -> Array:
        """Ball (x, y, z, radius) [m] around a contact, excluded from a solid's strength margin."""
        return np.append(self.point, PLASTIC_ZONE_RADII * self.radius)

    def spread(self, patch: float, distance: Array) -> Array:
        """Effect of spreading the force over a larger circle of radius `patch` [m].

        Returns the largest von Mises stress [Pa] of the stress change at distances (n,) [m] from
        the contact: by Hertz's pressure on a half-space, or by bending of a sheet, where a point
        load acts like a circle of radius 0.325 thicknesses (Westergaard).
        """
        if self.thickness:
            least = max(self.radius, POINT_CIRCLE_RATIO * self.thickness)
            bending = 1.5 * self.force * (1 + self.nu) / (np.pi * self.thickness**2)
            return bending * np.log(np.maximum(patch / np.maximum(distance, least), 1.0))
        if patch <= self.radius:
            return np.zeros(len(distance))

        angles = np.linspace(0.0, np.pi / 2, ANGLE_COUNT)
        rho = patch * np.geomspace(MIN_DISTANCE_RATIO, MAX_DISTANCE_RATIO, DISTANCE_COUNT)[:, None]
        r, z = rho * np.sin(angles), rho * np.cos(angles)
        contact, circle = (
            hertz_stresses(self.force, radius, self.nu, r, z) for radius in (self.radius, patch)
        )
        largest = von_mises(contact - circle).max(axis=1)
        return np.interp(distance, rho[:, 0], largest, right=0.0)


def contact_zones(contacts: Iterable[OneContact], body: str) -> list[ContactZone]:
    """The `ContactZone`s of a body's contacts, without contacts of unknown radius."""
    zones = []
    for contact in contacts:
        size = _contact_size(contact)
        scene = contact._record.assembly
        parts = scene.scene.contacts[contact._row]

        for struck, site in (find_site(end, scene.bodies) for end in (parts.a, parts.b)):
            point = site_points(struck.body).get(site)
            if size is not None and struck.name == body and point is not None:
                radius, nu = size
                patch = struck.patch_radius or 0.0
                zones.append(ContactZone(np.array(point), radius, patch, contact.peak_force, nu))

    return zones


def _contact_size(contact: OneContact) -> tuple[float, float] | None:
    """(largest radius [m] of a contact, Poisson's ratio of its softer side); None if unknown."""
    law = _law_with_yield(contact)
    if law is not None and contact.peak_force > law.yield_force:
        return rim_radius(law, contact.deepest), law.nu

    choice = law_choice(contact)
    if choice is None or not choice.curvature or not contact.peak_force > 0:
        return None
    if not isinstance(choice.law, Hertz | ElasticPlastic):
        return None

    depth = (contact.peak_force / choice.law.stiffness) ** (2 / 3)
    softer = min(
        (side for side in _contact_materials(contact) if not side.rigid), key=lambda side: side.E
    )
    return sqrt(depth / choice.curvature), softer.nu


def unknown_dent(contact: OneContact) -> str:
    """Text on why a contact may have left a dent that its law does not give; "" if not."""
    choice = law_choice(contact)
    if choice is None or not choice.unknown:
        return ""
    return "unknown (give the yield strength)" if lacks_strength(choice) else "unknown"


def yield_sentence(contact: OneContact) -> str:
    """Sentences on yielding, dent and cracks of the contact; "" if nothing is known."""
    return " ".join(
        filter(None, [_yields_sentence(contact), crack_note(_contact_materials(contact))])
    )


def _contact_materials(contact: OneContact) -> list[Matter]:
    """The materials of both sides of a contact; empty if they are not known."""
    if law_choice(contact) is None:
        return []
    surfaces = [body.surface(site) for _, body, site in _contact_sides(contact)]
    return [] if None in surfaces else [surface.matter for surface in surfaces]


def _yields_sentence(contact: OneContact) -> str:
    """Sentence on whether the contact yields; empty if unknown."""
    if not contact.peak_force > 0:
        return ""

    choice = law_choice(contact)
    law = contact.law
    unknown = choice is not None and lacks_strength(choice)
    if isinstance(law, ElasticPlastic) and not (unknown and contact.peak_force <= law.yield_force):
        return _law_sentence(contact, law)
    if choice is None or not isinstance(law, Hertz | ElasticPlastic):
        return ""
    if isinstance(choice.law, ElasticPlastic) and contact.peak_force > choice.law.yield_force:
        return (
            f"The contact yields from {engineering(choice.law.yield_force, 'N')} on, where "
            'Hertz\'s law ends: the contact "auto" goes on beyond.'
        )
    if unknown:
        return "Whether the contact yields is not known: give the yield strength or a material."

    return ""


def law_text(contact: OneContact) -> str:
    """The law of a contact in words, with the reason for its choice."""
    choice = law_choice(contact)
    law = contact.law
    name = type(law).__name__
    if choice is None or choice.law != law:
        return f"{name}, from the input"
    return f"{name}: {choice.reason}"


def law_error_text(contact: OneContact) -> str:
    """Text: error of the peak force due to a law chosen by "auto"; "" for the user's law."""
    choice = law_choice(contact)
    if choice is None or choice.law != contact.law or not contact.peak_force > 0:
        return ""
    start, end = contact.contacts[0]
    share = error_of_peak(choice, contact.peak_force, end - start)
    return "law not known" if share is None else f"law {percent(share)}"


def _law_sentence(contact: OneContact, law: ElasticPlastic) -> str:
    """The sentence on a contact with an elastic-plastic law."""
    pressure = elastic_pressure(law, contact.deepest)
    pressure_text = engineering(pressure, "Pa")
    strength = engineering(law.yield_strength, "Pa")
    side = weaker_side(contact)

    if contact.peak_force <= law.yield_force or contact.dent is None:
        share = pressure / elastic_pressure(law, law.yield_indentation)
        of_side = f" of {side}" if side else ""
        return (
            f"The contact stays elastic: its pressure is {pressure_text}, {share:.3g} times that of"
            f" first yield (yield strength {strength}{of_side})."
        )

    # a material with a name is the part's, and is told with the dent
    of_side = f" of {side}" if side.startswith("the ") else ""
    side_text = f", in {side}" if side else ""
    e = contact.restitution
    rebound = "" if e is None else f"; restitution {restitution_text(e, 2)}"

    return (
        f"The contact yields: {contact.dent.text}{side_text}{rebound}. It yields from"
        f" {engineering(law.yield_force, 'N')} on; Hertz's pressure would be {pressure_text},"
        f" {pressure / law.yield_strength:.3g} times the yield strength {strength}{of_side}."
    )


#: Names of the bodies of `simulate` -> words for them in a sentence.
BODY_WORDS = {"structure": "the part", "impactor": "the striker"}


def weaker_side(contact: OneContact) -> str:
    """Name of the material (or body) that yields first; "" if the user gave the law."""
    choice = law_choice(contact)
    if choice is None or choice.law != contact.law or choice.soft is None:
        return ""

    owners = [
        name
        for name, body, site in _contact_sides(contact)
        if body.surface(site).matter == choice.soft
    ]
    material = choice.soft.name
    if len(owners) != 1:
        return material

    owner = BODY_WORDS.get(owners[0], owners[0])
    if not material:
        return owner

    return f"{owner}'s {material}" if owners[0] == "impactor" else material
