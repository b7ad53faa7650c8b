"""Element types of Abaqus and CalculiX; nodes and elements made by *NGEN, *NFILL, *ELGEN."""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np

from antiosc.io.deck import Block, IntArray, Numbering, Place
from antiosc.io.shapes import CORNERS, EDGES
from antiosc_decks.abaqus.cards import Card

Role = Literal["solid", "shell", "beam", "plane stress", "plane strain", "rod", "other"]

#: Nodes of an element -> its shape.
SHEETS = {3: "triangle", 4: "quad", 6: "triangle", 8: "quad", 9: "quad"}
VOLUMES = {4: "tetra", 5: "pyramid", 6: "wedge", 8: "hexahedron", 10: "tetra", 13: "pyramid"}
VOLUMES |= {15: "wedge", 18: "wedge", 20: "hexahedron", 27: "hexahedron"}
LINES = {2: "line", 3: "line"}
#: Names of types, the number of nodes in brackets; what they are; their shapes. "other": cells
#: without a family here: rigid, membranes, heat, surfaces.
TYPES: tuple[tuple[str, Role, Mapping[int, str]], ...] = (
    (r"C3D(\d+)[A-Z]*", "solid", VOLUMES),
    (r"(?:DC|AC|F)3D(\d+)[A-Z]*", "other", VOLUMES),
    (r"SC(6|8)[A-Z]*", "other", VOLUMES),
    (r"(?:S|STRI)([34689]|65)(?:R5|R?S?W?T?)", "shell", SHEETS),
    (r"DS([34689]|65)(?:R5|R?S?W?T?)", "other", SHEETS),
    (r"CPS([3468])[A-Z]*", "plane stress", SHEETS),
    (r"CPE([3468])[A-Z]*", "plane strain", SHEETS),
    (r"(?:CPEG|CAX|CGAX|DC2D|DCAX|AC2D|ACAX)([3468])[A-Z]*", "other", SHEETS),
    (r"(?:R3D|M3D|SFM3D)([3468])[A-Z]*", "other", SHEETS),
    (r"(?:B|PIPE)[23]([123])[A-Z]*", "beam", LINES),
    (r"T[23]D(2)[A-Z]*", "rod", LINES),
    (r"T[23]D(3)[A-Z]*", "other", LINES),
)
#: Number in the name of a type -> its nodes, where these differ.
NODES = {"65": 6}
BEAM_NODES = {"1": 2, "2": 3, "3": 2}
#: Inner nodes of C3D27: Abaqus gives the centre, then bottom, top and the four sides.
INNER_27 = (26, 24, 23, 25, 21, 22, 20)
#: Types that are not cells -> their number of nodes.
POINTS = {
    r"MASS|ROTARYI|SPRING1|DASHPOT1|DCOUP3D|DCOUP2D|HEATCAP": 1,
    r"SPRINGA|SPRING2|DASHPOTA|DASHPOT2|GAPUNI|GAPCYL|GAPSPHER|CONN[23]D2": 2,
    r"D": 3,
}


@dataclass(frozen=True)
class ElementType:
    """How one element type is read."""

    #: a key of `CORNERS`
    shape: str
    role: Role
    nodes: int
    #: places of the corners and of the middles of the edges in the deck's order
    corners: tuple[int, ...]
    mids: tuple[int, ...]
    inner: tuple[int, ...] = ()


def element_type(name: str) -> ElementType | None:
    """The type named `name` (upper case); None if it is not a cell of a mesh."""
    for pattern, role, shapes in TYPES:
        match = re.fullmatch(pattern, name)
        if match is None:
            continue
        nodes = (BEAM_NODES if role == "beam" else NODES).get(match[1], int(match[1]))
        if nodes not in shapes:
            return None
        shape = shapes[nodes]
        if shape == "line":
            ends = (0, 1) if nodes == 2 else (0, 2)
            return ElementType(shape, role, nodes, ends, (1,) * (nodes - 2))
        corners = CORNERS[shape]
        mids = range(corners, corners + len(EDGES[shape])) if nodes > corners else range(0)
        inner: Sequence[int] = ()
        if shape == "quad":
            inner = range(corners + len(mids), nodes)
        elif nodes == 27:
            inner = INNER_27
        return ElementType(shape, role, nodes, tuple(range(corners)), tuple(mids), tuple(inner))
    return None


def nodes_of_other(name: str) -> int | None:
    """Number of nodes of an element that is not a cell; None if it is not known."""
    found = (count for pattern, count in POINTS.items() if re.fullmatch(pattern, name))
    return next(found, None)


#: Most nodes or elements from one card; more indicate a damaged file.
MOST_GENERATED = 5_000_000

Points = Mapping[int, list[float]]
Made = Iterator[tuple[int, list[float]]]


def generated(card: Card, known: Points, sets: Mapping[str, list[int]]) -> Made:
    """Nodes on straight lines between two others (*NGEN)."""
    card.needs(not card.option("LINE"), "*NGEN makes straight lines only here (LINE=).")
    for row in card.rows():
        row.needs(len(row.fields) >= 2, "*NGEN needs the numbers of two nodes on a line.")
        first, last, step = row.whole(0), row.whole(1), row.whole(2, 1)
        count = (last - first) // step if step > 0 else 0
        if first not in known or last not in known:
            raise row.place.error(f"*NGEN from {first} to {last}: both nodes must exist.")
        if not 0 < count <= MOST_GENERATED or (last - first) % step:
            raise row.place.error(f"*NGEN from {first} to {last} by {step} does not fit.")
        yield first, known[first]
        yield from _between(known, first, last, count, step)
        yield last, known[last]


def filled(card: Card, known: Points, sets: Mapping[str, list[int]]) -> Made:
    """Nodes on lines between those of two sets (*NFILL)."""
    if card.option("BIAS", "1") not in ("1", "1.", "1.0") or "SINGULAR" in card.options:
        raise card.place.error("*NFILL is read with equal distances only.")
    for row in card.rows():
        row.needs(len(row.fields) >= 4, "*NFILL needs two sets, a number of lines and a step.")
        names, lines, step = row.fields[:2], row.whole(2), row.whole(3)
        one, other = (sets.get(name.upper(), []) for name in names)
        if len(one) != len(other) or not one:
            raise row.place.error(
                f"*NFILL between {names[0]!r} ({len(one)} nodes) and {names[1]!r} "
                f"({len(other)}): both sets must be made by *NODE or *NGEN and be equally long."
            )
        if not 0 < lines * len(one) <= MOST_GENERATED:
            raise row.place.error(f"*NFILL over {lines} lines does not fit.")
        for first, last in zip(one, other, strict=True):
            yield from _between(known, first, last, lines, step)


def _between(known: Points, first: int, last: int, count: int, step: int) -> Made:
    a, b = np.array(known[first]), np.array(known[last])
    for k in range(1, count):
        yield first + k * step, list(a + (b - a) * (k / count))


def element_copies(
    card: Card, blocks: Sequence[Block], labels: Sequence[IntArray], nodes: Numbering
) -> Iterator[tuple[Block, IntArray, int]]:
    """Elements in rows, layers and blocks of one (*ELGEN), with the number of that one.

    Each is numbered and has its nodes numbered by steps from the master element's.
    """
    for row in card.rows():
        master, *rest = row.integers()
        row.needs(rest, "2 numbers are needed at least.")
        counts, shifts, steps = np.array([*rest, *[1] * (9 - len(rest))][:9]).reshape(3, 3).T
        counts = np.maximum(counts, 1)
        total = int(np.prod(counts.astype(object)))
        row.needs(0 < total <= MOST_GENERATED, f"*ELGEN would make {total} elements.")
        i = np.indices(counts).reshape(3, -1).T[1:]
        at = [(b, int(k)) for b, own in zip(blocks, labels, strict=True)
              for k in np.flatnonzero(own == master)]  # fmt: skip
        row.needs(at, f"*ELGEN copies the element {master}, which is not defined before.")
        block, k = at[0]
        copies = _shifted(block[np.full(len(i), k)], i @ shifts, nodes, row.place)
        yield copies, master + i @ steps, master


def _shifted(block: Block, shift: IntArray, nodes: Numbering, place: Place) -> Block:
    """Elements on nodes with other numbers."""
    label = np.empty(len(nodes.labels), dtype=np.int64)
    label[nodes.order] = nodes.labels

    def moved(rows: IntArray) -> IntArray:
        wanted = label[rows] + shift[:, None]
        found = nodes.rows(wanted)
        lost = wanted[found < 0]
        if len(lost):
            raise place.error(f"*ELGEN needs the node {lost[0]}, which the deck does not define.")
        return found

    return block.mapped(moved)
