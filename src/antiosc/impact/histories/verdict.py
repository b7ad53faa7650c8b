"""Sentences on a contact: whether it yields, and its permanent indentation."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from math import sqrt
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from antiosc.base._types import Array
from antiosc.base.errors import InputError
from antiosc.base.texts import engineering, percent, restitution_text, rounded_up
from antiosc.engine.contact.choice import Choice, elastic_pressure, lacks_strength
from antiosc.engine.contact.dent import rim_radius
from antiosc.engine.contact.half_space import (
    bending_difference,
    disc_bending,
    hertz_stresses,
    spread_difference,
    von_mises,
)
from antiosc.engine.contact.laws import ElasticPlastic, Hertz
from antiosc.engine.contact.peak_error import error_of_peak
from antiosc.engine.contact.surfaces import Matter, crack_note
from antiosc.impact.histories.parts import OneContact
from antiosc.impact.scene_parts import find_site
from antiosc.models.auto_contact import choice_at_sites
from antiosc.models.body import site_points

#: Radii of a contact that yields which the margin of a solid leaves out about it. There Hertz's
#: von Mises stress is 4 % of its largest on the surface and 17 % below the contact (nu = 0.3;
#: Johnson, *Contact Mechanics*, 3.4), and the plastic zone of a full dent has 2 to 3 radii (6.3).
CONTACT_RADII = 3.0
#: Radius of the smallest patch over that of its contact: laws hold up to 1/0.58, and a little more.
OVER_CONTACT = 1.8
#: Least thickness of a part over the radius of a contact with which the largest stress at that
#: distance is within `EDGE_ERROR` of the half-space's, on a rigid base or held at its rim: of
#: thinner plates it is 0.07 to 31 times that (measured).
HALF_SPACE = 6.0
EDGE_ERROR = 0.1
#: Thickness under a point of a patch over that of the part there, below which a hollow lies there;
#: plates had one by rounding.
HOLLOW = 0.8
#: Directions from a contact into the part in which a stress of unknown direction is evaluated.
ANGLES = 19


def choice_at(contact: OneContact) -> Choice | None:
    """The choice of law that the surfaces of a contact require; None if they are unknown."""
    try:
        (_, first, one), (_, second, other) = _ends(contact)
        return choice_at_sites(first, second, (one, other))
    except InputError:
        return None


def _ends(contact: OneContact) -> list[tuple[str, Any, str]]:
    """(name, body, site) of both sides of a contact."""
    scene = contact._record.assembly.scene
    parts = scene.contacts[contact._row]
    ends = [end.partition(":") for end in (parts.a, parts.b)]
    return [(name, scene.bodies[name], site) for name, _, site in ends]


def yields(contact: OneContact) -> bool:
    """Whether a contact yields, by its law or by the law that its surfaces require."""
    return yielding_law(contact) is not None


def yielding_law(contact: OneContact) -> ElasticPlastic | None:
    """The law by which a contact yields, the given or that of its surfaces; None if it does not."""
    law = _law_with_yield(contact)
    return law if law is not None and contact.peak_force > law.yield_force else None


def yield_share(contact: OneContact) -> float | None:
    """Peak force over the force from which the contact yields; None if that is unknown."""
    law = _law_with_yield(contact)
    return None if law is None else contact.peak_force / law.yield_force


def _law_with_yield(contact: OneContact) -> ElasticPlastic | None:
    """The elastic-plastic law of a contact, given or from its surfaces; None if there is none."""
    law = contact.law
    if not isinstance(law, ElasticPlastic):
        choice = choice_at(contact) if isinstance(law, Hertz) else None
        law = law if choice is None else choice.law
    return law if isinstance(law, ElasticPlastic) else None


class YieldingZone(NamedTuple):
    """The zone about a contact that yields, on one body.

    `point` (3,) [m]; `push` (3,): direction of the force, None if unknown; `radii` [m] of the
    contact and of the patch that carries its force in the model; `force` [N]: the largest;
    `depth`, `hollow`, `faces` [m]: thickness of the part under the patch, the least of it, size of
    its faces there; `span`: number of the span of the run to which it belongs
    (`BodyHistory.spans`).
    """

    point: Array
    push: Array | None
    radii: tuple[float, float]
    force: float
    nu: float
    depth: float = np.inf
    hollow: float = np.inf
    faces: float = np.inf
    span: int = 0

    @property
    def is_thin(self) -> bool:
        """Whether the part is too thin under the contact for the stresses of a half-space."""
        return self.depth < HALF_SPACE * self.radii[0]

    @property
    def unresolved_depth(self) -> float:
        """Thickness over the contact's radius, of a thin part on coarse faces; else inf."""
        is_coarse = self.faces > self.radii[0]
        return self.depth / self.radii[0] if self.is_thin and is_coarse else np.inf

    @property
    def ball(self) -> Array:
        """Row x, y, z, radius [m] of what the margin of a solid leaves out."""
        return contact_zone(self.point, self.radii[0])

    @property
    def edge_stress(self) -> float:
        """Largest von Mises stress [Pa] on the surface of the ball, by Hertz's pressure on a
        half-space; 0 for a part that is too thin for it.
        """
        return 0.0 if self.is_thin else self._half_space_stress

    @property
    def thin_stress(self) -> float:
        """The same stress within the thickness of a part that is too thin; 0 of others."""
        return self._half_space_stress if self.is_thin else 0.0

    @property
    def hollow_stress(self) -> float:
        """Most that the contact loads the part beside a hollow under its patch, beyond what the
        patch does [Pa]: on a column that does not spread the force; 0 without a hollow.

        A rib of 6.4 x 1.75 mm between slits, 1 mm under a patch of 4 mm radius, has 75 MPa under a
        contact of 1.5 mm and 36 MPa under the patch (finite elements); this bound is 89 MPa.
        """
        contact, patch = self.radii
        if not (contact < patch and self.hollow < min(patch, HOLLOW * self.depth)):
            return 0.0
        return self.force / np.pi * (contact**-2 - patch**-2)

    @property
    def smallest_patch(self) -> float:
        """Radius [m] of the smallest patch that the contact allows; 0 if the present one is not
        larger.
        """
        contact, patch = self.radii
        least = rounded_up(OVER_CONTACT * contact)
        return least if least < patch else 0.0

    @property
    def _half_space_stress(self) -> float:
        """Largest von Mises stress [Pa] on the surface of the ball in a half-space, within the
        thickness.
        """
        distance = CONTACT_RADII * self.radii[0]
        steepest = np.arccos(min(self.depth / distance, 1.0))
        angles = np.linspace(steepest, np.pi / 2, ANGLES)
        r, z = distance * np.sin(angles), distance * np.cos(angles)
        stresses = hertz_stresses(self.force, self.radii[0], self.nu, r, z)
        return float(von_mises(stresses).max())

    def spread_error(self, points: Array) -> Array:
        """Errors (P,) [Pa] of the von Mises stress at points (P, 3): the patch spreads the force.

        The larger of those on a half-space and of a plate of this thickness: the largest stress of
        plates held at the rim becomes 0.98 to 1.65 times the right one, with the half-space alone
        0.35 to 1.14 times (measured). Where a point lies deeper than the
        plate is thick, the part is no thinner than that depth. Of an unknown direction the largest
        error counts.
        """
        if self.radii[1] in (0.0, self.radii[0]):
            return np.zeros(len(points))
        from_contact = points - self.point
        distance = np.linalg.norm(from_contact, axis=1)
        if self.push is None:
            depths = np.outer(np.linspace(0, 1, ANGLES), distance)
        else:
            depths = np.abs(from_contact @ self.push)[None] / np.linalg.norm(self.push)
        r = np.sqrt(np.maximum(distance**2 - depths**2, 0.0))
        error = spread_difference(self.force, self.radii, self.nu, r, depths)
        if np.isfinite(self.depth):
            plate = bending_difference(
                self.force, self.radii, self.nu, r, np.maximum(self.depth, depths)
            )
            error = np.maximum(error, plate)
        return np.asarray(error.max(axis=0))


#: Radius over the size of the cells to which these spread the force of a smaller patch: on plates
#: of 4 mm cells of 20 and 30 mm had the stress of a disc of 0.39 and 0.17 of their size.
SPREAD_BY_CELLS = 0.4


class SheetPatch(NamedTuple):
    """The patch of a contact on an isotropic sheet, whose cells may be larger.

    `point` (3,) [m]; `radii` [m] of the contact and of the patch; `force` [N]: the largest; `nu`,
    `thickness` [m], `cell` [m]: of the sheet there, and the size of its cells. The nodes within the
    size of the cells stand for the middle of the contact.
    """

    point: Array
    radii: tuple[float, float]
    force: float
    nu: float = 0.0
    thickness: float = 0.0
    cell: float = 0.0

    def spread_error(self, points: Array) -> Array:
        """Bending stresses (P,) [Pa] that the contact has at points (P, 3) beyond the patch."""
        contact, patch = self.radii
        radii = min(contact, patch), patch
        _, r = self._distances(points)
        return bending_difference(self.force, radii, self.nu, r, self.thickness)

    def mesh_error(self, points: Array) -> Array:
        """Errors (P,) [Pa] of the bending stresses of the patch at points (P, 3): cells spread the
        force, and no node may lie in the middle.
        """
        patch = self.radii[1]
        r, middle = self._distances(points)
        right = disc_bending(self.force, patch, self.nu, middle, self.thickness)
        cells = max(patch, SPREAD_BY_CELLS * self.cell)
        found = disc_bending(self.force, cells, self.nu, r, self.thickness)
        return np.maximum(right - found, 0.0)

    def _distances(self, points: Array) -> tuple[Array, Array]:
        """Distances (P,) [m] of points from the middle, and those that they stand for."""
        r = np.linalg.norm(points - self.point, axis=1)
        return r, np.where(r <= self.cell, 0.0, r)


def yielding_zones(
    contacts: Iterable[OneContact], body: str, *, unknown: bool = False
) -> list[YieldingZone]:
    """The zones about the contacts of a body that yield; `unknown`: and about those of which it is
    not known, for want of a strength.
    """
    return [
        zone
        for contact in contacts
        if yields(contact) or (unknown and _strength_is_unknown(contact))
        for zone in _zones_at(contact, body)
    ]


def patches_of(contacts: Iterable[OneContact], body: str) -> list[SheetPatch]:
    """The patches of the contacts on a body, as on a sheet that is not known yet."""
    patches = []
    for contact in contacts:
        radius, _ = _yielding_size(contact) or _elastic_size(contact) or (np.inf, 0.0)
        patches += [
            SheetPatch(point, (radius, patch), contact.peak_force)
            for point, _, patch in _places(contact, body)
            if patch
        ]
    return patches


def _zones_at(contact: OneContact, body: str) -> list[YieldingZone]:
    """The zones of a contact on a body: none if its radius or point is unknown."""
    size = _yielding_size(contact) or _elastic_size(contact)
    if size is None:
        return []
    radius, nu = size
    return [
        YieldingZone(point, direction, (radius, patch), contact.peak_force, nu)
        for point, direction, patch in _places(contact, body)
    ]


def _places(contact: OneContact, body: str) -> Iterator[tuple[Array, Any, float]]:
    """(point, direction of the force, radius of the patch) of a contact on a body, if known."""
    scene = contact._record.assembly
    parts = scene.scene.contacts[contact._row]
    for scene_body, site in (find_site(end, scene.bodies) for end in (parts.a, parts.b)):
        point = site_points(scene_body.body).get(site)
        if scene_body.name == body and point is not None:
            yield np.array(point), scene_body.pushes.get(site), scene_body.patch_radius or 0.0


def _yielding_size(contact: OneContact) -> tuple[float, float] | None:
    """Radius [m] of a contact, and Poisson's ratio of what yields; None: it does not yield."""
    law = yielding_law(contact)
    return None if law is None else (rim_radius(law, contact.deepest), law.nu)


def _strength_is_unknown(contact: OneContact) -> bool:
    """Whether it is not known if a contact yields, for want of a strength."""
    choice = choice_at(contact)
    return choice is not None and lacks_strength(choice)


def _elastic_size(contact: OneContact) -> tuple[float, float] | None:
    """Largest radius [m] of a contact by Hertz's law, and Poisson's ratio of its softer side; None:
    the surfaces are not known.
    """
    choice = choice_at(contact)
    if choice is None or not choice.curvature:
        return None
    law = choice.law
    if not isinstance(law, Hertz | ElasticPlastic) or not contact.peak_force > 0:
        return None
    depth = (contact.peak_force / law.stiffness) ** (2 / 3)
    softer = min((side for side in _sides(contact) if not side.rigid), key=lambda side: side.E)
    return sqrt(depth / choice.curvature), softer.nu


def contact_zone(point: ArrayLike, radius: float) -> Array:
    """Row x, y, z, radius [m] of the zone about a contact that the margin of a solid leaves out.

    `radius` [m] of the contact.
    """
    return np.append(point, CONTACT_RADII * radius)


def unknown_dent(contact: OneContact) -> str:
    """Why it is unknown that a contact without a dent has none, in words; "" if it is known."""
    choice = choice_at(contact)
    if choice is None or not choice.unknown:
        return ""
    return "unknown (give the yield strength)" if lacks_strength(choice) else "unknown"


def sentence(contact: OneContact) -> str:
    """Sentence on whether the contact yields, with its permanent indentation, and that cracks are
    not computed; empty if nothing is known.
    """
    return " ".join(filter(None, [_yielding(contact), crack_note(_sides(contact))]))


def _sides(contact: OneContact) -> list[Matter]:
    """The materials of both sides of a contact; empty if they are not known."""
    if choice_at(contact) is None:
        return []
    surfaces = [body.surface(site) for _, body, site in _ends(contact)]
    return [] if None in surfaces else [surface.matter for surface in surfaces]


def _yielding(contact: OneContact) -> str:
    """Sentence on whether the contact yields; empty if unknown."""
    if not contact.peak_force > 0:
        return ""
    choice = choice_at(contact)
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
    choice = choice_at(contact)
    law = contact.law
    name = type(law).__name__
    if choice is None or choice.law != law:
        return f"{name}, from the input"
    return f"{name}: {choice.reason}"


def law_error_text(contact: OneContact) -> str:
    """Text: error of the peak force due to a law chosen by "auto"; "" for a law that was given."""
    choice = choice_at(contact)
    if choice is None or choice.law != contact.law or not contact.peak_force > 0:
        return ""
    share = error_of_peak(choice, contact.peak_force, contact.contact_time)
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


#: Bodies of an impact of two -> their words in a sentence.
WORDS = {"structure": "the part", "impactor": "the striker"}


def weaker_side(contact: OneContact) -> str:
    """The material that yields first: "steel S235" of a part, "the striker's POM", "the part" of a
    material without a name; "" if the user gave the law.
    """
    choice = choice_at(contact)
    if choice is None or choice.law != contact.law or choice.soft is None:
        return ""
    owners = [
        name for name, body, site in _ends(contact) if body.surface(site).matter == choice.soft
    ]
    material = choice.soft.name
    if len(owners) != 1:
        return material
    owner = WORDS.get(owners[0], owners[0])
    if not material:
        return owner
    return f"{owner}'s {material}" if owners[0] == "impactor" else material
