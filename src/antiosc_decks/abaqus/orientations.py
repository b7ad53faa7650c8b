"""Directions of materials in Abaqus and CalculiX decks: *ORIENTATION."""

from __future__ import annotations

import math
from collections.abc import Iterable

import numpy as np

from antiosc.errors import MeshError
from antiosc.fem.readers.deck import Array, Place, real_number
from antiosc_decks.abaqus.assembly import Instance
from antiosc_decks.abaqus.cards import Card


class Orientations:
    """The *ORIENTATION cards among some cards, by their names and the instances they are in.

    Those of a part turn with each of its instances.
    """

    def __init__(self, cards: Iterable[tuple[Card, Instance]]) -> None:
        self._cards = {
            f"{within.name}.{card.needed('NAME')}".upper().removeprefix("."): (card, within.turn)
            for card, within in cards
            if card.keyword == "ORIENTATION"
        }

    def find(self, name: str, within: Instance) -> tuple[Card, Array] | None:
        """The card of a name in an instance, or else in the assembly, and how it is turned."""
        own = self._cards.get(f"{within.name}.{name}".upper())
        return own or self._cards.get(name.upper())

    def axis(self, name: str, place: Place, within: Instance) -> Array:
        """Direction 1 of an *ORIENTATION."""
        return self.frame(name, place, within)[0]

    def frame(self, name: str, place: Place, within: Instance) -> tuple[Array, Array]:
        """Directions 1 and 3 of an *ORIENTATION."""
        found = self.find(name, within)
        if found is None:
            raise MeshError(f"{place}: there is no orientation {name!r} (*ORIENTATION, NAME=).")
        card, turn = found
        system = card.option("SYSTEM", "RECTANGULAR").upper()
        rows = [(f, p) for f, p in card.rows() if f]
        if not system.startswith("R") or not rows or "DEFINITION" in card.options:
            raise MeshError(
                f"{card.place}: *ORIENTATION is read as RECTANGULAR, by two points, only."
            )
        values = [real_number(f, rows[0][1]) if f else 0.0 for f in (*rows[0][0], *"000000000")]
        a, b, origin = np.reshape(values[:9], (3, 3))
        a, b = turn @ (a - origin), turn @ (b - origin)
        normal = np.cross(a, b)
        if not normal.any():
            raise MeshError(f"{card.place}: the two points of *ORIENTATION give no plane.")
        if len(rows) > 1:
            about, angle, *_ = [*rows[1][0], "0", "0"]
            degrees = real_number(angle or "0", rows[1][1])
            if degrees and about.strip() != "3":
                raise MeshError(f"{rows[1][1]}: *ORIENTATION is read with a rotation about 3 only.")
            across = np.cross(normal / np.linalg.norm(normal), a)
            a = math.cos(math.radians(degrees)) * a + math.sin(math.radians(degrees)) * across
        return np.asarray(a / np.linalg.norm(a)), np.asarray(normal / np.linalg.norm(normal))
