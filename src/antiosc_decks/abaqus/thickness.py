"""Thicknesses of shells at the nodes of Abaqus and CalculiX decks: *NODAL THICKNESS."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from antiosc.errors import MeshError
from antiosc.fem.readers.deck import Array, IntArray, Place, real_number
from antiosc_decks.abaqus.assembly import Whole
from antiosc_decks.abaqus.cards import Card
from antiosc_decks.model.builder import Family, ModelBuilder


def vary_thickness(whole: Whole, builder: ModelBuilder, roles: Sequence[str]) -> str:
    """Thicknesses by *NODAL THICKNESS, the mean of each element; a sentence if they vary.

    CalculiX takes them whether or not the section says so.
    """
    count = len(whole.deck.points)
    at_node = np.full(count, np.nan)
    first: Card | None = None
    for card, within in whole.cards:
        if card.keyword != "NODALTHICKNESS":
            continue
        first = first or card
        for fields, place in card.rows():
            if len(fields) > 1:
                nodes = whole.nodes(fields[0], place, within)
                at_node[nodes] = real_number(fields[1], place)
    if first is None:
        return ""
    varying, start = 0, 0
    for block, role in zip(whole.deck.blocks, roles, strict=True):
        own = np.arange(start, start + len(block))
        start += len(block)
        if role != "shell":
            continue
        values = at_node[np.hstack([block.corners, np.maximum(block.mids, 0)])]
        values = np.where(
            np.hstack([block.corners >= 0, block.mids >= 0]) & np.isfinite(values),
            values,
            _own_thickness(builder, own)[:, None],
        )
        varying += int((np.ptp(values, axis=1) > 1e-9 * values.max(axis=1)).sum())
        _thin(builder, own, values[:, : block.corners.shape[1]].mean(axis=1), first.place)
    if not varying:
        return ""
    return (
        f"the variation of the thickness within {varying} elements (*NODAL THICKNESS, "
        f"{first.place}), the mean of the corners is taken in each"
    )


def _own_thickness(builder: ModelBuilder, elements: IntArray) -> Array:
    """That of the sections, in the deck's units."""
    length = builder.units.length
    families = [one.arguments.get("thickness", np.nan) / length for one in builder.families]
    number = builder.of_element[elements]
    return np.where(number >= 0, np.array([*families, np.nan])[number], np.nan)


def _thin(builder: ModelBuilder, elements: IntArray, thickness: Array, place: Place) -> None:
    """Give elements thicknesses of their own."""
    numbers = builder.of_element[elements]
    for number in np.unique(numbers[numbers >= 0]):
        family, name = builder.families[number], builder.names[number]
        if family.kind != "Shell":
            raise MeshError(f"{place}: *NODAL THICKNESS is read for isotropic shells only.")
        mine = numbers == number
        for value in np.unique(np.round(thickness[mine], 12)):
            some = elements[mine & (np.round(thickness, 12) == value)]
            own = {**family.arguments, "thickness": float(value) * builder.units.length}
            if "offset" in own:
                own["offset"] *= own["thickness"] / family.arguments["thickness"]
            label = f"{name} of thickness {value:g}"
            builder.add(label, some, Family("Shell", own, family.place))
