"""Rods of decks (CROD, CONROD, CTUBE, T3D2): springs along their lines, masses at their ends."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from antiosc._types import BoolArray
from antiosc.errors import MeshError
from antiosc.fem.readers.decks.constraints import Term
from antiosc.fem.readers.decks.deck import Deck, IntArray, Place

if TYPE_CHECKING:
    from antiosc.fem.readers.decks.model import ModelBuilder


class Rods:
    """The rods of a deck in its units; they leave the mesh."""

    def __init__(self, deck: Deck) -> None:
        self.deck = deck
        #: element -> (EA, GJ, mass per length, place)
        self.known: dict[int, tuple[float, float, float, Place]] = {}

    def add(
        self, elements: IntArray, EA: float, GJ: float, per_length: float, place: Place
    ) -> None:
        """Set the section of elements."""
        self.known.update(dict.fromkeys(map(int, elements), (EA, GJ, per_length, place)))

    def join(self, builder: ModelBuilder, roles: list[str], kept: BoolArray) -> BoolArray:
        """Springs and masses in place of the rods that are kept; which elements are rods."""
        start, rods = 0, np.zeros(self.deck.n_elements, dtype=bool)
        masses: dict[int, float] = {}
        first: Place | None = None
        for role, block in zip(roles, self.deck.blocks, strict=True):
            some = np.arange(start, start + len(block))
            start += len(block)
            if role != "rod":
                continue
            rods[some] = True
            for k in np.flatnonzero(kept[some]):
                a, b = map(int, block.corners[k])
                if some[k] not in self.known:
                    raise MeshError(
                        f"{self.deck.name} has {block.type} elements without a section, so that "
                        "their material is not known."
                    )
                EA, GJ, per_length, place = self.known[int(some[k])]
                first = first or place
                length = self._spring(builder, a, b, EA, GJ, place)
                for node in (a, b):
                    masses[node] = masses.get(node, 0.0) + per_length * length / 2
            self.deck.told.append(
                f"the {int(kept[some].sum())} {block.type} of {self.deck.name} are springs, with "
                "their mass at their ends."
            )
        for node, mass in masses.items():
            if mass and first:
                builder.mass(node, mass, [0.0] * 3, first)
        return rods

    def _spring(
        self, builder: ModelBuilder, a: int, b: int, EA: float, GJ: float, place: Place
    ) -> float:
        """The length of a rod."""
        along = self.deck.points[b] - self.deck.points[a]
        length = float(np.linalg.norm(along))
        if length == 0:
            raise MeshError(f"{place}: the ends of a rod coincide, so that it has no direction.")
        unit = along / length

        def apart(motion: int) -> list[Term]:
            return [
                (node, motion + c, sign * float(unit[c]))
                for node, sign in ((a, -1.0), (b, 1.0))
                for c in range(3)
            ]

        builder.sprung(apart(0), EA / length, place)
        if GJ and builder.turning[[a, b]].all():
            builder.sprung(apart(3), GJ / length, place)
        return length
