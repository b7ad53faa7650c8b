"""Materials, their directions, and cross-sections of beams in Abaqus and CalculiX decks."""

from __future__ import annotations

import math
from collections.abc import Iterable

import numpy as np

from antiosc.io.deck import Array, Place
from antiosc_decks.abaqus.assembly import Instance
from antiosc_decks.abaqus.cards import Card
from antiosc_decks.model import properties as profiles
from antiosc_decks.model.properties import Material, isotropic, of_stiffness, symmetric

#: Kinds of *ELASTIC by their first letters -> how many constants each has.
ELASTIC_CONSTANTS = {"ISO": 2, "ENGINEERINGCONSTANTS": 9, "LAMINA": 6, "ORTHO": 9, "ANISO": 21}
#: 11, 22, 33, 12, 13, 23 of Abaqus in the order 11, 22, 33, 23, 13, 12.
VOIGT = [0, 1, 2, 5, 4, 3]


def materials_of(cards: list[Card]) -> tuple[dict[str, Material], list[str]]:
    """(materials by name in upper case, what is ignored of them)."""
    found: dict[str, Material] = {}
    ignored: list[str] = []
    current: Material | None = None
    for card in cards:
        if card.keyword == "MATERIAL":
            name = card.needed("NAME")
            if name.upper() in found:
                raise card.place.error(
                    f"the material {name!r} is defined more than once, first in "
                    f"{found[name.upper()].place}."
                )
            current = found[name.upper()] = Material(name, card.place)
        elif current is not None and card.keyword == "ELASTIC":
            kind = _elastic(current, card)
            if kind == "ISO" and len(card.lines) > 1:
                ignored.append(f"*ELASTIC of other temperatures ({card.place})")
        elif current is not None and card.keyword == "DENSITY":
            current.density = card.first().real(0)
    return found, ignored


def _elastic(material: Material, card: Card) -> str:
    """Give a material what *ELASTIC says; its kind."""
    word = "".join(card.option("TYPE", "ISO").split()).upper()
    kind = next((one for one in ELASTIC_CONSTANTS if word.startswith(one)), "")
    card.needs(kind, f"*ELASTIC, TYPE={card.option('TYPE')} is not supported; write it as "
               "isotropic, ENGINEERING CONSTANTS, LAMINA, ORTHO or ANISOTROPIC.")  # fmt: skip
    values = card.first().reals() if kind == "ISO" else card.numbers()
    count = ELASTIC_CONSTANTS[kind]
    card.needs(len(values) >= count, f"*ELASTIC needs {count} constants; it has {len(values)}.")
    v = np.array(values[:count])
    material.place = card.place
    if kind == "ISO":
        material.constants = isotropic(v[0], v[1])
    elif kind == "LAMINA":  # E1, E2, nu12, G12, G13, G23
        material.constants = np.array([v[0], v[1], np.nan, v[2], np.nan, np.nan, *v[3:]])
    elif kind == "ENGINEERINGCONSTANTS":
        material.constants = v
    elif kind == "ANISO":  # the upper triangle by columns: the lower one by rows
        material.stiffness = symmetric(v)[np.ix_(VOIGT, VOIGT)]
    else:
        D = np.diag([0.0, 0.0, 0.0, *v[6:]])
        D[:3, :3] = symmetric(v[:6])
        try:
            material.constants = of_stiffness(D)
        except np.linalg.LinAlgError:
            raise card.place.error("the stiffness of *ELASTIC is singular.") from None
    return kind


class Orientations:
    """The *ORIENTATION cards among some cards, by their names and the instances they are in.

    Those of a part turn with each of its instances.
    """

    def __init__(self, cards: Iterable[tuple[Card, Instance]]) -> None:
        self._cards = {
            (within.prefix + card.needed("NAME")).upper(): (card, within)
            for card, within in cards
            if card.keyword == "ORIENTATION"
        }

    def find(self, name: str, within: Instance) -> tuple[Card, Instance] | None:
        """The card of a name in an instance, or else in the assembly, and the instance it is of."""
        own = self._cards.get((within.prefix + name).upper())
        return own or self._cards.get(name.upper())

    def cylindrical(self, name: str, within: Instance) -> bool:
        """Whether there is an orientation of this name about the axis of a cylinder."""
        found = self.find(name, within)
        return found is not None and found[0].option("SYSTEM").upper().startswith("C")

    def at(self, name: str, place: Place, within: Instance, x: Array) -> Array:
        """Directions 1, 2 and 3 of an *ORIENTATION (n, 3, 3) at points; those are rows."""
        found = self.find(name, within)
        if found is None:
            raise place.error(f"there is no orientation {name!r} (*ORIENTATION, NAME=).")
        card, of = found
        first, rows = card.first(), card.rows()
        if self.cylindrical(name, within):
            a, b = np.reshape(first.reals(6), (2, 3)) @ of.turn.T + of.shift
            if (a == b).all():
                raise card.place.error("a cylindrical *ORIENTATION needs two points on its axis.")
            return around_axis(a, b, x)
        system = card.option("SYSTEM", "R").upper()
        if not system.startswith("R") or not rows or "DEFINITION" in card.options:
            raise card.place.error("*ORIENTATION is read as RECTANGULAR or CYLINDRICAL, by points.")
        a, b, origin = np.reshape(first.reals(9), (3, 3)) @ of.turn.T
        normal = np.cross(a - origin, b - origin)
        card.needs(normal.any(), "the two points of *ORIENTATION give no plane.")
        one, z = (v / np.linalg.norm(v) for v in (a - origin, normal))
        if degrees := self.degrees(name, within):
            if rows[1].word(0) != "3":
                raise rows[1].place.error("*ORIENTATION is read with a rotation about 3 only.")
            angle = math.radians(degrees)
            one = math.cos(angle) * one + math.sin(angle) * np.cross(z, one)
        return np.broadcast_to(np.stack([one, np.cross(z, one), z]), (len(x), 3, 3))

    def degrees(self, name: str, within: Instance) -> float:
        """The angle in the second line: about 3, on shells about the normal."""
        found = self.find(name, within)
        rows = found[0].rows() if found else []
        return rows[1].real(1) if len(rows) > 1 else 0.0

    def frame(self, name: str, place: Place, within: Instance) -> Array:
        """Directions 1, 2 and 3, as rows, of an *ORIENTATION that is the same everywhere."""
        frame = self.at(name, place, within, np.zeros((1, 3)))[0]
        place.needs(not self.cylindrical(name, within), f"the orientation {name!r} is "
                    "CYLINDRICAL; here it must be RECTANGULAR.")  # fmt: skip
        return np.asarray(frame)


def around_axis(a: Array, b: Array, x: Array) -> Array:
    """Radial, circumferential and axial directions (n, 3, 3) at points; zero on the axis."""
    z = b - a
    out = x - a - ((x - a) @ z / (z @ z))[:, None] * z
    along = z / np.linalg.norm(z)
    out /= np.maximum(np.linalg.norm(out, axis=1, keepdims=True), np.finfo(float).tiny)
    return np.stack([out, np.cross(along, out), np.broadcast_to(along, out.shape)], axis=1)


#: SECTION= of beams by its first letters -> least number of dimensions, how many must be > 0.
BEAM_SECTIONS = {"RECT": (1, 1), "CIRC": (1, 1), "PIPE": (2, 2), "BOX": (6, 6), "GENERAL": (5, 2)}


def profile_of(card: Card) -> profiles.Profile:
    """The cross-section of *BEAM SECTION or *BEAM GENERAL SECTION, in the deck's units."""
    kind = card.option("SECTION", "RECT").upper()
    d = card.first().reals()
    short = next((name for name in BEAM_SECTIONS if kind.startswith(name)), "")
    card.needs(short, f"SECTION={kind} is not supported; it must be RECT, CIRC, PIPE, BOX or "
               "GENERAL.")  # fmt: skip
    needed, positive = BEAM_SECTIONS[short]
    if len(d) < needed or min(d[:positive]) <= 0:
        raise card.place.error(f"SECTION={kind} needs {needed} positive dimensions; got {d}.")
    if short == "RECT":
        return profiles.rectangle(d[0], d[1] if len(d) > 1 else d[0])
    if short == "CIRC":  # CalculiX gives two diameters, Abaqus one radius
        return profiles.ellipse(*(d[:2] if len(d) > 1 else (2 * d[0], 2 * d[0])))
    if short == "PIPE":
        return profiles.tube(d[0], d[1])
    if short == "BOX":
        found = profiles.box(d[0], d[1], (d[2], d[3], d[4], d[5]))
        if found is None:
            raise card.place.error("a BOX with unequal opposite walls is not supported.")
        return found
    area, about_1, mixed, about_2, torsion = d[:5]
    card.needs(not mixed, "I12 must be 0: rotate the section to its principal axes.")
    return profiles.Profile(area, about_2, about_1, torsion, profiles.RECTANGLE)
