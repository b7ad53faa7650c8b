"""Materials, their directions, and cross-sections of beams in Abaqus and CalculiX decks."""

from __future__ import annotations

import math
from collections.abc import Iterable

import numpy as np

from antiosc.io.deck import Array, Place, real_number
from antiosc_decks.abaqus.assembly import Instance
from antiosc_decks.abaqus.cards import Card
from antiosc_decks.model import properties as profiles
from antiosc_decks.model.properties import Material, isotropic, of_stiffness

#: Kinds of *ELASTIC without their last letters, and how many constants each has.
ELASTIC_CONSTANTS = {"ISO": 2, "ENGINEERINGCONSTANTS": 9, "LAMINA": 6, "ORTHO": 9}


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
        elif current is None:
            continue
        elif card.keyword == "ELASTIC":
            if _kind(card).startswith("ANISO"):
                current.stiffness = _anisotropic(card)
            else:
                current.constants = _elastic(card)
            current.place = card.place
            if _kind(card) == "ISO" and len(card.lines) > 1:
                ignored.append(f"*ELASTIC of other temperatures ({card.place})")
        elif card.keyword == "DENSITY":
            values = card.first_numbers()
            current.density = values[0] if values else None
    return found, ignored


def _kind(card: Card) -> str:
    kind = "".join(card.option("TYPE", "ISO").split()).upper()
    return "ISO" if kind.startswith("ISO") else "ORTHO" if kind.startswith("ORTHO") else kind


def _anisotropic(card: Card) -> Array:
    """21 constants: the upper triangle, column by column, in the order 11, 22, 33, 12, 13, 23."""
    values = card.numbers()
    if len(values) < 21:
        raise card.place.error(f"*ELASTIC needs 21 constants; it has {len(values)}.")
    C = np.zeros((6, 6))
    places = [(row, column) for column in range(6) for row in range(column + 1)]
    for (row, column), value in zip(places, values, strict=False):
        C[row, column] = C[column, row] = value
    order = [0, 1, 2, 5, 4, 3]
    return C[np.ix_(order, order)]


def _elastic(card: Card) -> Array:
    kind = _kind(card)
    if kind not in ELASTIC_CONSTANTS:
        raise card.place.error(
            f"*ELASTIC, TYPE={card.option('TYPE')} is not supported; write it as "
            "isotropic, ENGINEERING CONSTANTS, LAMINA, ORTHO or ANISOTROPIC."
        )
    values = card.numbers() if kind != "ISO" else card.first_numbers()
    count = ELASTIC_CONSTANTS[kind]
    if len(values) < count:
        raise card.place.error(f"*ELASTIC needs {count} constants; it has {len(values)}.")
    v = np.array(values[:count])
    if kind == "ISO":
        return isotropic(v[0], v[1])
    if kind == "LAMINA":  # E1, E2, nu12, G12, G13, G23
        return np.array([v[0], v[1], np.nan, v[2], np.nan, np.nan, *v[3:]])
    if kind == "ENGINEERINGCONSTANTS":
        return v
    D = np.zeros((6, 6))
    D[0, 0], D[0, 1], D[1, 1], D[0, 2], D[1, 2], D[2, 2] = v[:6]
    D += np.triu(D, 1).T
    D[range(3, 6), range(3, 6)] = v[6:]
    try:
        return of_stiffness(D)
    except np.linalg.LinAlgError:
        raise card.place.error("the stiffness of *ELASTIC is singular.") from None


class Orientations:
    """The *ORIENTATION cards among some cards, by their names and the instances they are in.

    Those of a part turn with each of its instances.
    """

    def __init__(self, cards: Iterable[tuple[Card, Instance]]) -> None:
        self._cards = {
            f"{within.name}.{card.needed('NAME')}".upper().removeprefix("."): (card, within)
            for card, within in cards
            if card.keyword == "ORIENTATION"
        }

    def find(self, name: str, within: Instance) -> tuple[Card, Instance] | None:
        """The card of a name in an instance, or else in the assembly, and the instance it is of."""
        own = self._cards.get(f"{within.name}.{name}".upper())
        return own or self._cards.get(name.upper())

    def axis(self, name: str, place: Place, within: Instance) -> Array:
        """Direction 1 of an *ORIENTATION."""
        return self.frame(name, place, within)[0]

    def _rows(
        self, name: str, place: Place, within: Instance
    ) -> tuple[Card, Instance, str, list[tuple[list[str], Place]]]:
        """(card, its instance, R or C, its lines)."""
        found = self.find(name, within)
        if found is None:
            raise place.error(f"there is no orientation {name!r} (*ORIENTATION, NAME=).")
        card, of = found
        rows = [(f, p) for f, p in card.rows() if f]
        return card, of, card.option("SYSTEM", "RECTANGULAR").upper()[:1], rows

    def cylinder(
        self, name: str, place: Place, within: Instance
    ) -> tuple[Array, Array, float] | None:
        """(a point of the axis, its direction, degrees about the normal); None of a rectangular."""
        card, of, system, rows = self._rows(name, place, within)
        if system != "C":
            return None
        points = [[real_number(f, p) if f else 0.0 for f in fields] for fields, p in rows[:1]]
        if not points or len(points[0]) < 6 or points[0][:3] == points[0][3:6]:
            raise card.place.error("a cylindrical *ORIENTATION needs two points on its axis.")
        a, b = np.reshape(points[0][:6], (2, 3))
        along = of.turn @ (b - a) / np.linalg.norm(b - a)
        degrees = [real_number(f[1], p) for f, p in rows[1:2] if len(f) > 1 and f[1]]
        return of.turn @ a + of.shift, along, degrees[0] if degrees else 0.0

    def frame(self, name: str, place: Place, within: Instance) -> tuple[Array, Array]:
        """Directions 1 and 3 of an *ORIENTATION."""
        card, of, system, rows = self._rows(name, place, within)
        if system != "R" or not rows or "DEFINITION" in card.options:
            raise card.place.error(
                "*ORIENTATION is read as RECTANGULAR, by two points, and of shells as CYLINDRICAL."
            )
        values = [real_number(f, rows[0][1]) if f else 0.0 for f in (*rows[0][0], *"000000000")]
        a, b, origin = np.reshape(values[:9], (3, 3))
        a, b = of.turn @ (a - origin), of.turn @ (b - origin)
        normal = np.cross(a, b)
        if not normal.any():
            raise card.place.error("the two points of *ORIENTATION give no plane.")
        if len(rows) > 1:
            about, angle, *_ = [*rows[1][0], "0", "0"]
            degrees = real_number(angle or "0", rows[1][1])
            if degrees and about.strip() != "3":
                raise rows[1][1].error("*ORIENTATION is read with a rotation about 3 only.")
            across = np.cross(normal / np.linalg.norm(normal), a)
            a = math.cos(math.radians(degrees)) * a + math.sin(math.radians(degrees)) * across
        return np.asarray(a / np.linalg.norm(a)), np.asarray(normal / np.linalg.norm(normal))


def profile_of(card: Card) -> profiles.Profile:
    """The cross-section of *BEAM SECTION or *BEAM GENERAL SECTION, in the deck's units."""
    kind = card.option("SECTION", "RECT").upper()
    d = card.first_numbers()
    needed = {"RECT": 1, "CIRC": 1, "PIPE": 2, "BOX": 6, "GENERAL": 5}
    short = next((name for name in needed if kind.startswith(name)), "")
    if not short:
        raise card.place.error(
            f"SECTION={kind} is not supported; it must be RECT, CIRC, PIPE, BOX or GENERAL."
        )
    if len(d) < needed[short] or min(d[: 2 if short == "GENERAL" else needed[short]]) <= 0:
        raise card.place.error(
            f"SECTION={kind} needs {needed[short]} positive dimensions; got {d}."
        )
    if short == "RECT":
        return profiles.rectangle(d[0], d[1] if len(d) > 1 else d[0])
    if short == "CIRC":  # CalculiX gives two diameters, Abaqus one radius
        return profiles.ellipse(d[0], d[1]) if len(d) > 1 else profiles.ellipse(2 * d[0], 2 * d[0])
    if short == "PIPE":
        return profiles.tube(d[0], d[1])
    if short == "BOX":
        found = profiles.box(d[0], d[1], (d[2], d[3], d[4], d[5]))
        if found is None:
            raise card.place.error("a BOX with unequal opposite walls is not supported.")
        return found
    area, about_1, mixed, about_2, torsion = d[:5]
    if mixed:
        raise card.place.error("I12 must be 0: rotate the section to its principal axes.")
    return profiles.Profile(area, about_2, about_1, torsion, profiles.RECTANGLE)
