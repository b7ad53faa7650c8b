"""Ends of Nastran's beams: orientation, offsets, pin flags; tapered and curved beams in pieces.

A beam whose ends lie beside its nodes, or are released, gets ends of its own, which follow its
nodes as rigid bodies but for the released motions.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from antiosc.io.deck import Array, Block, IntArray
from antiosc_decks.model.builder import ModelBuilder
from antiosc_decks.nastran.cards import Entry, motions_of
from antiosc_decks.nastran.mesh import Beam, NastranDeck, property_of
from antiosc_decks.nastran.profiles import BeamProfiles
from antiosc_decks.nastran.table import BEAMS

#: Pieces of a tapered or curved beam; the error of its stiffness falls with their number squared.
PIECES = 16
#: Sine below which a direction lies along the chord of a curved beam.
ALONG = 1e-9


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
    points: list[Array] = list(found.deck.points)
    elements: list[Entry] = []
    for k, (block, numbers) in enumerate(found.deck.numbered()):
        entries = [found.elements[number] for number in numbers]
        if block.role != "beam":
            elements += entries
            continue
        lines: list[tuple[int, int]] = []
        for entry, nodes in zip(entries, block.corners.tolist(), strict=True):
            known = along.get(property_of(entry))
            neutral = known.neutral if known else np.zeros((2, 2))
            own = _own_ends(found, entry, nodes, neutral)
            rows = list(nodes)
            for end, (place, held, axes) in own.items():
                rows[end] = len(points)
                points.append(place)
                ends.append(End(rows[end], nodes[end], held, axes, entry, neutral[end] @ axes[1:]))
            bend = known.entry if known and entry.name == "CBEND" else None
            pieces = PIECES if bend or property_of(entry) in tapered else 1
            heights: list[Array | None] = [None] * pieces
            x = np.array([points[row] for row in rows])
            shares = np.linspace(0, 1, pieces + 1)[1:-1, None]
            inner = (1 - shares) * x[0] + shares * x[1]
            if bend:
                inner, directions = arc(entry, bend, x, _vector(found, entry), pieces)
                heights = list(directions)
            chain = [rows[0], *range(len(points), len(points) + len(inner)), rows[1]]
            points += list(inner)
            for piece in range(pieces):
                middle = (piece + 0.5) / pieces if pieces > 1 else 0.0
                found.beams[len(elements)] = Beam(middle, bool(own), heights[piece])
                lines.append((chain[piece], chain[piece + 1]))
                elements.append(entry)
        none = np.zeros((len(lines), 0), dtype=np.int64)
        table: IntArray = np.array(lines, dtype=np.int64).reshape(-1, 2)
        found.deck.blocks[k] = Block(block.shape, block.type, table, none, none, block.role)
    found.elements = elements
    found.deck.points = np.array(points)
    return ends


def join(builder: ModelBuilder, ends: list[End]) -> None:
    """Let the beams' own ends follow their nodes."""
    for end in ends:
        builder.apart.append(end.row)
        leader = builder.joints.leader(end.node)
        builder.joints.frames[end.row] = end.axes
        if end.beside.any():
            builder.tell_once("how mass off the shear centre (N1, N2) couples twist with sway")
        builder.joints.rigid(np.array([end.row]), leader, end.held, end.entry.place, own=True,
                             twisted=(end.axes[0], end.beside))  # fmt: skip
        del builder.joints.frames[end.row]


def _own_ends(
    found: NastranDeck, entry: Entry, nodes: list[int], neutral: Array
) -> dict[int, tuple[Array, tuple[int, ...], Array]]:
    """End 0 or 1 -> (place, motions that follow the node, axes of the beam)."""
    pins = [motions_of(entry.text(k), entry.place) for k in (8, 9)]
    offsets = _offsets(found, entry)
    if not any(pins) and not offsets.any() and not neutral.any():
        return {}
    x = found.deck.points[nodes]
    line = x[1] + offsets[1] - x[0] - offsets[0]
    length = float(np.linalg.norm(line))
    long = length > 1e-12 * max(float(np.abs(x).max()), 1e-300)
    entry.needs(long, f"{entry.name} {entry.text(0)} has no length.")
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


def _offsets(found: NastranDeck, entry: Entry) -> Array:
    """Offsets (2, 3) of the ends from their nodes along the axes of the deck."""
    given = np.reshape(entry.reals(10, 16), (2, 3))
    if not given.any():
        return given
    kind = entry.text(7).upper()
    plain = not kind.isalpha() or not set(kind[1:]) & set("OE")
    entry.needs(plain, f"{entry.name} with offsets in the element's system (OFFT = {kind}) is "
                "not supported; give them in the displacement system (GGG).")  # fmt: skip
    frames = [found.frame(found.at(entry, k), entry.place) for k in (2, 3)]
    return np.stack([w @ frame for w, frame in zip(given, frames, strict=True)])


def _alike(offsets: Array, height: Array) -> bool:
    """Whether both ends lie equally far off their nodes along the height."""
    along = float(offsets[0] @ height)
    rest = np.abs(np.vstack([offsets[0] - offsets[1], offsets[0] - along * height])).max()
    return bool(rest <= 1e-6 * abs(along))


def orientation(found: NastranDeck, entry: Entry, tangent: Array) -> Array:
    """Direction of plane 1 across the axis."""
    v = _vector(found, entry)
    across = v - (v @ tangent) * tangent
    size = float(np.linalg.norm(across))
    told = f"the orientation of {entry.name} {entry.text(0)} is missing, or along its axis."
    entry.needs(size > 1e-9 * float(np.linalg.norm(v)), told)
    return np.asarray(across / size)


def _vector(found: NastranDeck, entry: Entry) -> Array:
    """The vector in fields 5 to 7 of an element, or from its first node to the node in field 5."""
    a = found.at(entry, 2)
    if entry.text(4) and not entry.text(5) and not entry.text(6) and "." not in entry.text(4):
        return np.asarray(found.deck.points[found.at(entry, 4)] - found.deck.points[a])
    v = np.array(entry.reals(4, 7))
    return v if entry.text(7).upper()[:1] == "B" else np.asarray(v @ found.frame(a, entry.place))


def offset_along(found: NastranDeck, entry: Entry, height: Array) -> float:
    """Equal offsets of both ends along the height."""
    return float(_offsets(found, entry)[0] @ height)


def arc(entry: Entry, bend: Entry, x: Array, v: Array, pieces: int) -> tuple[Array, Array]:
    """(points (pieces - 1, 3) between the ends, directions of plane 1 (pieces, 3)) of a CBEND.

    `bend`: its PBEND; `x` (2, 3): its ends; `v`: the vector, or the arm of the node, that it gives.
    """
    chord = x[1] - x[0]
    long = float(np.linalg.norm(chord))
    label = f"CBEND {entry.text(0)}"
    up = v - (v @ chord) * chord / long**2
    across = np.linalg.norm(up) > ALONG * np.linalg.norm(v)
    entry.needs(across, f"the plane of {label} is not known: its vector lies along its chord.")
    up /= np.linalg.norm(up)
    kind = entry.whole(7)
    entry.needs(kind in (1, 2, 3, 4), f"GEOM of CBEND is 1 to 4; got {kind}.")
    if kind in (3, 4):  # radius or angle; the centre lies across the chord from the point
        radius = bend.real(6)
        if kind == 4:
            radius = long / 2 / max(math.sin(math.radians(bend.real(7)) / 2), ALONG)
        told = f"the radius of {label} is {radius:.4g}, its chord {long:.4g}: give RB or THETAB "
        entry.needs(radius >= long / 2, told + "of its PBEND.")
        centre = x.mean(axis=0) - math.sqrt(radius**2 - long**2 / 4) * up
    else:  # the vector points to the centre, or along the arc
        w = v if kind == 1 else (v @ up) * chord - (v @ chord) * up
        curved = abs(w @ chord) > ALONG * long * np.linalg.norm(w)
        entry.needs(curved, f"{label} has no centre of curvature.")
        centre = x[0] + w * long**2 / (2 * (w @ chord))
    first, last = x - centre
    angle = math.atan2(float(np.linalg.norm(np.cross(first, last))), float(first @ last))
    ahead = last - first * math.cos(angle)
    ahead *= np.linalg.norm(first) / np.linalg.norm(ahead)
    at = np.arange(2 * pieces + 1)[1:-1, None] * angle / (2 * pieces)
    arms = np.cos(at) * first + np.sin(at) * ahead
    return centre + arms[1::2], -arms[::2] / np.linalg.norm(first)
