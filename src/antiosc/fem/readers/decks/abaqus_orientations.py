"""Directions of materials in Abaqus and CalculiX decks: *ORIENTATION."""

from __future__ import annotations

import math
from collections.abc import Iterable

import numpy as np

from antiosc.errors import MeshError
from antiosc.fem.readers.decks.abaqus_cards import Card
from antiosc.fem.readers.decks.deck import Array, Place, real_number


class Orientations:
    """The *ORIENTATION cards among some cards, by their names."""

    def __init__(self, cards: Iterable[Card]) -> None:
        self._cards = {c.needed("NAME").upper(): c for c in cards if c.keyword == "ORIENTATION"}

    def __contains__(self, name: str) -> bool:
        return name.upper() in self._cards

    def axis(self, name: str, place: Place) -> Array:
        """Direction 1 of an *ORIENTATION."""
        return self.frame(name, place)[0]

    def frame(self, name: str, place: Place) -> tuple[Array, Array]:
        """Directions 1 and 3 of an *ORIENTATION."""
        card = self._cards.get(name.upper())
        if card is None:
            raise MeshError(f"{place}: there is no orientation {name!r} (*ORIENTATION, NAME=).")
        system = card.option("SYSTEM", "RECTANGULAR").upper()
        rows = [(f, p) for f, p in card.rows() if f]
        if not system.startswith("R") or not rows or "DEFINITION" in card.options:
            raise MeshError(
                f"{card.place}: *ORIENTATION is read as RECTANGULAR, by two points, only."
            )
        values = [real_number(f, rows[0][1]) if f else 0.0 for f in (*rows[0][0], *"000000")][:6]
        a, b = np.array(values[:3]), np.array(values[3:])
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
