"""Rods of decks (CROD, CONROD, CTUBE, T3D2): springs along their lines, masses at their ends."""

from __future__ import annotations

import numpy as np

from antiosc._types import BoolArray
from antiosc.errors import MeshError
from antiosc.fem.readers.decks.builder import ModelBuilder, Rod
from antiosc.fem.readers.decks.constraints import Term
from antiosc.fem.readers.decks.deck import Place


def join_rods(builder: ModelBuilder, roles: list[str], kept: BoolArray) -> BoolArray:
    """Springs and masses in place of the rods that are kept; which elements are rods."""
    start, rods = 0, np.zeros(builder.deck.n_elements, dtype=bool)
    masses: dict[int, float] = {}
    first: Place | None = None
    for role, block in zip(roles, builder.deck.blocks, strict=True):
        some = np.arange(start, start + len(block))
        start += len(block)
        if role != "rod":
            continue
        rods[some] = True
        for k in np.flatnonzero(kept[some]):
            a, b = map(int, block.corners[k])
            if some[k] not in builder.rods:
                raise MeshError(
                    f"{builder.deck.name} has {block.type} elements without a section, so that "
                    "their material is not known."
                )
            rod = builder.rods[int(some[k])]
            first = first or rod.place
            length = _spring(builder, a, b, rod)
            for node in (a, b):
                masses[node] = masses.get(node, 0.0) + rod.mass * length / 2
        builder.deck.told.append(
            f"the {int(kept[some].sum())} {block.type} of {builder.deck.name} are springs, with "
            "their mass at their ends."
        )
    for node, mass in masses.items():
        if mass and first:
            builder.mass(node, mass, [0.0] * 3, first)
    return rods


def _spring(builder: ModelBuilder, a: int, b: int, rod: Rod) -> float:
    """Add the springs of a rod between two nodes; its length."""
    along = builder.deck.points[b] - builder.deck.points[a]
    length = float(np.linalg.norm(along))
    if length == 0:
        raise MeshError(f"{rod.place}: the ends of a rod coincide, so that it has no direction.")
    unit = along / length

    def apart(motion: int) -> list[Term]:
        return [
            (node, motion + c, sign * float(unit[c]))
            for node, sign in ((a, -1.0), (b, 1.0))
            for c in range(3)
        ]

    builder.sprung(apart(0), rod.EA / length, rod.place)
    if rod.GJ and builder.has_rotations[[a, b]].all():
        builder.sprung(apart(3), rod.GJ / length, rod.place)
    return length
