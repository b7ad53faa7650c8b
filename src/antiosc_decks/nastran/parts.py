"""Parts of a deck (BEGIN SUPER) that number their nodes, materials and properties anew.

Where parts give one number to different things, or SELOC moves a part, each part has a scope of its
own: what is added to its numbers. Nodes of two such parts that coincide are one node, but for parts
that SEBULK joins by SECONCT alone (MANUAL).
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import replace

import numpy as np

from antiosc.io.deck import Array, Place
from antiosc_decks.nastran.cards import Entry
from antiosc_decks.nastran.coordinates import System, Systems, axes_of

#: Above all numbers of a part.
SCOPE = 10**10
#: Beginnings of the names of entries that define what others name.
DEFINED = ("GRID", "P", "MAT", "CORD")
#: Nodes of two parts that are nearer are one, in the deck's unit.
NEAR = 1e-5


def scope(entries: list[Entry]) -> None:
    """Set the scopes of the entries, where the parts need them."""
    part, found = 0, []
    known: dict[tuple[str, str], tuple[int, list[str]]] = {}
    clash = any(entry.name == "SELOC" for entry in entries)
    for entry in entries:
        part = entry.whole(0) if entry.name == "BEGIN SUPER" else part
        found.append(part)
        if entry.name.startswith(DEFINED) and entry.name not in ("PARAM", "PLOTEL"):
            other, fields = known.setdefault((entry.name, entry.text(0)), (part, entry.fields))
            clash = clash or (other != part and fields != entry.fields)
    for entry, part in zip(entries, found, strict=True):
        if clash and part:
            entry.place = replace(entry.place, scope=part * SCOPE)


def label(number: int) -> str:
    """The name of a property of a part."""
    part, own = divmod(number, SCOPE)
    return f"{own}" + (f" of part {part}" if part else "")


def place_in(entries: list[Entry], entry: Entry, k: int) -> Place:
    """The place of an entry as if it stood in the part that its field k names."""
    scoped = any(one.place.scope for one in entries)
    return replace(entry.place, scope=entry.whole(k, 0) * SCOPE * scoped)


def moved(
    entries: list[Entry], node: Callable[[int, Place], Array], systems: Systems
) -> dict[int, System]:
    """Scope of a part -> where SELOC moves its basic system: three of its nodes to three others."""
    points = {entry.whole(0): entry for entry in entries if entry.name == "POINT"}
    found = {}

    def aim(number: int, place: Place) -> Array:
        if number not in points:
            return node(number, place)
        at = points[number]
        return systems(at.whole(1, 0), at.place).point(np.array(at.reals(2, 5)))

    for entry in entries:
        if entry.name == "SELOC":
            own = place_in(entries, entry, 0)
            a = axes_of([node(entry.whole(k), own) for k in (1, 2, 3)], entry)
            b = axes_of([aim(entry.whole(k), entry.place) for k in (4, 5, 6)], entry)
            turn = a.axes.T @ b.axes
            found[own.scope] = System(b.origin - a.origin @ turn, turn)
    return found


def coincident(
    grids: list[Entry], points: Array, entries: list[Entry]
) -> Iterator[tuple[int, int]]:
    """Pairs (row, row of an earlier node) of nodes of two parts in one place."""
    scopes = np.array([grid.place.scope for grid in grids])
    manual = {one.whole(0) * SCOPE for one in entries if one.name == "SEBULK"
              and one.text(3).upper() == "MANUAL"}  # fmt: skip
    if not scopes.any():
        return
    from scipy.spatial import cKDTree  # few decks need it, and it loads slowly

    done: set[int] = set()
    for first, second in sorted(cKDTree(points[: len(grids)]).query_pairs(NEAR)):
        apart = scopes[first] != scopes[second]
        if apart and second not in done and not {scopes[first], scopes[second]} & manual:
            done.add(second)
            yield second, first
