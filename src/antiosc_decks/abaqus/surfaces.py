"""*SURFACE of Abaqus and CalculiX decks: faces of elements, or nodes."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field

import numpy as np

from antiosc.errors import MeshError
from antiosc.fem.readers.deck import Block, IntArray, Place
from antiosc.fem.readers.shapes import EDGES
from antiosc_decks.abaqus.assembly import Instance, Whole
from antiosc_decks.abaqus.cards import Card

#: Corners of the faces S1, S2, … of solids.
SOLID_FACES = {
    "hexahedron": (
        *((0, 1, 2, 3), (4, 7, 6, 5), (0, 4, 5, 1)),
        *((1, 5, 6, 2), (2, 6, 7, 3), (3, 7, 4, 0)),
    ),
    "wedge": ((0, 1, 2), (3, 5, 4), (0, 3, 4, 1), (1, 4, 5, 2), (2, 5, 3, 0)),
    "tetra": ((0, 1, 2), (0, 3, 1), (1, 3, 2), (2, 3, 0)),
    "pyramid": ((0, 1, 2, 3), (0, 4, 1), (1, 4, 2), (2, 4, 3), (3, 4, 0)),
}


@dataclass
class Surface:
    """Faces, by (corners, middles of edges; -1: none) in order around each; or nodes alone."""

    faces: list[tuple[IntArray, IntArray]] = field(default_factory=list)
    alone: list[IntArray] = field(default_factory=list)

    @property
    def nodes(self) -> IntArray:
        """All of its nodes."""
        every = [np.zeros(0, dtype=np.int64), *self.alone]
        for corners, mids in self.faces:
            every += [corners, mids]
        nodes = np.unique(np.concatenate(every))
        return nodes[nodes >= 0]


def surfaces_of(whole: Whole, cards: Sequence[tuple[Card, Instance]]) -> dict[str, Surface]:
    """The surfaces of a deck by name in upper case."""
    found: dict[str, Surface] = {}
    for card, within in cards:
        if card.keyword != "SURFACE" or not card.option("NAME"):
            continue
        prefix = f"{within.name.upper()}." if within.name else ""
        surface = found.setdefault(prefix + card.option("NAME").upper(), Surface())
        of_nodes = card.option("TYPE").upper().startswith("NODE")
        for fields, place in card.rows():
            if not fields or not fields[0]:
                continue
            if of_nodes:
                surface.alone.append(whole.nodes(fields[0], place, within))
                continue
            elements = whole.elements(fields[0], place, within)
            side = fields[1].upper() if len(fields) > 1 else ""
            surface.faces += list(_faces(whole.deck.blocks, elements, side, place))
    return found


def _faces(
    blocks: Sequence[Block], elements: IntArray, side: str, place: Place
) -> Iterator[tuple[IntArray, IntArray]]:
    start = 0
    for block in blocks:
        own = elements[(elements >= start) & (elements < start + len(block))] - start
        start += len(block)
        if not len(own):
            continue
        corners = _corners(block.shape, side, place)
        edges = [frozenset(edge) for edge in EDGES[block.shape]]
        around = [
            edges.index(frozenset((a, b)))
            for a, b in zip(corners, (*corners[1:], corners[0]), strict=True)
        ]
        for row in own:
            mids = block.mids[row][around] if block.mids.shape[1] else np.zeros(0, dtype=np.int64)
            yield block.corners[row][list(corners)], mids


def _corners(shape: str, side: str, place: Place) -> tuple[int, ...]:
    if shape in ("triangle", "quad"):
        return tuple(range(3 if shape == "triangle" else 4))
    sides = SOLID_FACES.get(shape, ())
    number = int(side[1:]) if side[:1] == "S" and side[1:].isdigit() else 0
    if not 1 <= number <= len(sides):
        raise MeshError(
            f"{place}: {side or 'no side'!r} is no side of a {shape}; it must be S1 to "
            f"S{len(sides)}."
        )
    return sides[number - 1]
