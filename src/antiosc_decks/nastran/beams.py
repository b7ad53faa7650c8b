"""Ends of Nastran's beams: orientation, offsets, pin flags; tapered beams in pieces.

A beam whose ends lie beside its nodes, or are released, gets ends of its own, which follow its
nodes as rigid bodies but for the released motions.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from antiosc.io.deck import Array, Block, IntArray
from antiosc_decks.model.builder import ModelBuilder
from antiosc_decks.nastran.bends import arc
from antiosc_decks.nastran.cards import Entry, motions_of
from antiosc_decks.nastran.mesh import NastranDeck, property_of
from antiosc_decks.nastran.profiles import BeamProfiles
from antiosc_decks.nastran.table import BEAMS, CELLS

#: Pieces of a tapered or curved beam; the error of its stiffness falls with their number squared.
PIECES = 16


@dataclass(frozen=True)
class Beam:
    """A beam, or a piece of one."""

    #: place of its middle, from 0 to 1
    middle: float = 0.0
    #: whether its ends are its own
    moved: bool = False
    #: direction of plane 1, of a piece of a curved beam
    height: Array | None = None


PLAIN = Beam()


@dataclass(frozen=True)
class End:
    """An end that is not its node: rows of both, what holds them together, along which axes."""

    row: int
    node: int
    held: tuple[int, ...]
    axes: Array
    entry: Entry
    #: from the shear centre, about which the beam twists, to the end
    beside: Array


def divide(found: NastranDeck) -> list[End]:
    """Give beams their own ends and tapered beams their pieces; the ends to be joined."""
    along = {entry.number(0): BeamProfiles(entry) for entry in found.named(*BEAMS)}
    tapered = {number for number, one in along.items() if one.tapered}
    ends: list[End] = []
    more: list[Array] = []
    elements: list[Entry] = []
    start = 0
    for k, block in enumerate(found.deck.blocks):
        entries = found.elements[start : start + len(block)]
        start += len(block)
        if CELLS[block.type].role != "beam":
            elements += entries
            continue
        lines: list[tuple[int, int]] = []
        for entry, (a, b) in zip(entries, block.corners.tolist(), strict=True):
            x = found.deck.points[[a, b]]
            known = along.get(property_of(entry))
            neutral = known.neutral if known else np.zeros((2, 2))
            own = _own_ends(found, entry, x, (a, b), neutral)
            nodes = [a, b]
            for end, (place, held, axes) in own.items():
                more.append(place)
                nodes[end] = len(found.deck.points) + len(more) - 1
                beside = neutral[end] @ axes[1:]
                ends.append(End(nodes[end], (a, b)[end], held, axes, entry, beside))
            places = [more[n - len(x0)] if n >= len(x0) else x0[n]
                      for x0 in (found.deck.points,) for n in nodes]  # fmt: skip
            bend = known.entry if known and entry.name == "CBEND" else None
            pieces = PIECES if bend or property_of(entry) in tapered else 1
            heights: Any = [None] * pieces
            if bend:
                v = _vector(found, entry)
                inside, heights = arc(entry, bend, np.array(places), v, pieces)
                inner = list(inside)
            else:
                shares = np.linspace(0, 1, pieces + 1)[1:-1, None]
                inner = list((1 - shares) * places[0] + shares * places[1])
            first = len(found.deck.points) + len(more)
            more += inner
            chain = [nodes[0], *range(first, first + len(inner)), nodes[1]]
            for piece in range(pieces):
                middle = (piece + 0.5) / pieces if pieces > 1 else 0.0
                found.beams[len(elements)] = Beam(middle, bool(own), heights[piece])
                lines.append((chain[piece], chain[piece + 1]))
                elements.append(entry)
        none = np.zeros((len(lines), 0), dtype=np.int64)
        table: IntArray = np.array(lines, dtype=np.int64).reshape(-1, 2)
        found.deck.blocks[k] = Block(block.shape, block.type, table, none, none)
    found.elements = elements
    if more:
        found.deck.points = np.vstack([found.deck.points, *more])
    return ends


def join(builder: ModelBuilder, ends: list[End]) -> None:
    """Let the beams' own ends follow their nodes."""
    for end in ends:
        builder.apart.append(end.row)
        leader = builder.joints.leader(end.node)
        builder.joints.frames[end.row] = end.axes
        follower = np.array([end.row])
        if end.beside.any():
            builder.tell_once("how mass off the shear centre (N1, N2) couples twist with sway")
        twisted = (end.axes[0], end.beside)
        builder.joints.rigid(follower, leader, end.held, end.entry.place, True, twisted)
        del builder.joints.frames[end.row]


def _own_ends(
    found: NastranDeck, entry: Entry, x: Array, nodes: tuple[int, int], neutral: Array
) -> dict[int, tuple[Array, tuple[int, ...], Array]]:
    """End 0 or 1 -> (place, motions that follow the node, axes of the beam)."""
    pins = [motions_of(entry.text(k), entry.place) for k in (8, 9)]
    offsets = _offsets(found, entry, nodes)
    if not any(pins) and not offsets.any() and not neutral.any():
        return {}
    line = x[1] + offsets[1] - x[0] - offsets[0]
    length = float(np.linalg.norm(line))
    if length <= 1e-12 * max(float(np.abs(x).max()), 1e-300):
        raise entry.place.error(f"{entry.name} {entry.whole(0)} has no length.")
    height = orientation(found, entry, line / length)
    if not any(pins) and not neutral.any() and _alike(offsets, height):
        return {}  # by the section
    axes = np.stack([line / length, height, np.cross(line / length, height)])
    places = x + offsets + neutral @ axes[1:]
    return {
        k: (places[k], tuple(c for c in range(6) if c not in pins[k]), axes)
        for k in (0, 1)
        if pins[k] or offsets[k].any() or neutral[k].any()
    }


def _offsets(found: NastranDeck, entry: Entry, nodes: tuple[int, int]) -> Array:
    """Offsets (2, 3) of the ends from their nodes along the axes of the deck."""
    given = np.array([entry.real(k) for k in range(10, 16)]).reshape(2, 3)
    if not given.any():
        return given
    kind = entry.text(7).upper()
    along = (kind if kind.isalpha() else "GGG").ljust(3, "G")
    if "O" in along[1:] or "E" in along[1:]:
        raise entry.place.error(
            f"{entry.name} with offsets in the element's system (OFFT = {kind}) is "
            "not supported; give them in the displacement system (GGG)."
        )
    return np.stack(
        [w @ found.frame(row, entry.place) for w, row in zip(given, nodes, strict=True)]
    )


def _alike(offsets: Array, height: Array) -> bool:
    """Whether both ends lie equally far off their nodes along the height."""
    along = float(offsets[0] @ height)
    rest = np.abs(np.vstack([offsets[0] - offsets[1], offsets[0] - along * height])).max()
    return bool(rest <= 1e-6 * abs(along))


def orientation(found: NastranDeck, entry: Entry, tangent: Array) -> Array:
    """Direction of plane 1 across the axis."""
    v = _vector(found, entry)
    long = float(np.linalg.norm(v))
    v = v - (v @ tangent) * tangent
    size = float(np.linalg.norm(v))
    if size <= 1e-9 * long or not long:
        raise entry.place.error(
            f"the orientation of {entry.name} {entry.whole(0)} is missing, or along its axis."
        )
    return np.asarray(v / size)


def _vector(found: NastranDeck, entry: Entry) -> Array:
    """The vector in fields 5 to 7 of an element, or from its first node to the node in field 5."""
    a = found.row(entry.whole(2), entry.place)
    if entry.text(4) and not entry.text(5) and not entry.text(6) and "." not in entry.text(4):
        other = found.row(entry.whole(4), entry.place)
        return np.asarray(found.deck.points[other] - found.deck.points[a])
    v = np.array([entry.real(k) for k in (4, 5, 6)])
    return v if entry.text(7).upper()[:1] == "B" else np.asarray(v @ found.frame(a, entry.place))


def offset_along(found: NastranDeck, entry: Entry, height: Array) -> float:
    """Equal offsets of both ends along the height."""
    nodes = (found.row(entry.whole(2), entry.place), found.row(entry.whole(3), entry.place))
    return float(_offsets(found, entry, nodes)[0] @ height)
