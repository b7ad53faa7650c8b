"""Element types of Abaqus and CalculiX; nodes and elements made by *NGEN, *NFILL, *ELGEN."""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np

from antiosc.io.deck import Block, IntArray, Numbering, Place, whole_number
from antiosc.io.shapes import CORNERS, EDGES
from antiosc_decks.abaqus.cards import Card

Role = Literal["solid", "shell", "beam", "plane stress", "plane strain", "rod", "other"]

#: Nodes of a solid -> its shape.
VOLUMES = {
    4: "tetra",
    5: "pyramid",
    6: "wedge",
    8: "hexahedron",
    10: "tetra",
    13: "pyramid",
    15: "wedge",
    18: "wedge",
    20: "hexahedron",
    27: "hexahedron",
}
SHEET_SHAPES = {3: "triangle", 4: "quad", 6: "triangle", 8: "quad", 9: "quad"}
#: Places of the nodes of a type where they are not corners, then middles of edges in VTK's order.
MIDDLE_SECOND = (0, 2, 1)
#: Inner nodes of C3D27: Abaqus gives the centre, then bottom, top and the four sides.
INNER_27 = (26, 24, 23, 25, 21, 22, 20)

_SOLID = re.compile(r"(?:C|DC|AC|F)3D(\d+)[A-Z]*$")
_SHELL = re.compile(r"(?:S|DS|STRI)(65|[34689])(?:R5|R?S?W?T?)$")
_PLANE = re.compile(r"(CPS|CPE|CPEG|CAX|CGAX|DC2D|DCAX|AC2D|ACAX)([3468])[A-Z]*$")
_BEAM = re.compile(r"(?:B|PIPE)([23])([123])[A-Z]*$")
#: Types with the shape of a cell but without a family here: rigid, membranes, trusses, surfaces.
_OTHERS = (
    (re.compile(r"(?:R3D|M3D|SFM3D)(3|4|6|8)[A-Z]*$"), "face"),
    (re.compile(r"SC(6|8)[A-Z]*$"), "volume"),
    (re.compile(r"T[23]D(2|3)[A-Z]*$"), "line"),
)


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
    if match := _SOLID.match(name):
        nodes = int(match[1])
        if nodes not in VOLUMES:
            return None
        role: Role = "solid" if name.startswith("C3D") else "other"
        return _plain(VOLUMES[nodes], role, nodes)
    if match := _SHELL.match(name):
        nodes = 6 if match[1] == "65" else int(match[1])
        return _plain(SHEET_SHAPES[nodes], "other" if name.startswith("DS") else "shell", nodes)
    if match := _PLANE.match(name):
        roles: dict[str, Role] = {"CPS": "plane stress", "CPE": "plane strain"}
        return _plain(SHEET_SHAPES[int(match[2])], roles.get(match[1], "other"), int(match[2]))
    if match := _BEAM.match(name):
        return _line(3 if match[2] == "2" else 2, "beam")
    for pattern, kind in _OTHERS:
        if match := pattern.match(name):
            nodes = int(match[1])
            if kind == "line":
                return _line(nodes, "rod" if name.startswith(("T2D2", "T3D2")) else "other")
            return _plain((SHEET_SHAPES if kind == "face" else VOLUMES)[nodes], "other", nodes)
    return None


def _plain(shape: str, role: Role, nodes: int) -> ElementType:
    corners = CORNERS[shape]
    mids = range(corners, corners + len(EDGES[shape])) if nodes > corners else range(0)
    inner = tuple(range(corners + len(mids), nodes))
    if shape == "hexahedron" and nodes == 27:
        inner = INNER_27
    elif shape != "quad":
        inner = ()
    return ElementType(shape, role, nodes, tuple(range(corners)), tuple(mids), inner)


def _line(nodes: int, role: Role) -> ElementType:
    if nodes == 2:
        return ElementType("line", role, 2, (0, 1), ())
    return ElementType("line", role, 3, MIDDLE_SECOND[:2], MIDDLE_SECOND[2:])


#: Numbers of nodes of types that are not cells, to separate their elements.
ONE_NODE = re.compile(r"(?:MASS|ROTARYI|SPRING1|DASHPOT1|DCOUP3D|DCOUP2D|HEATCAP)$")
TWO_NODES = re.compile(r"(?:SPRINGA|SPRING2|DASHPOTA|DASHPOT2|GAPUNI|GAPCYL|GAPSPHER|CONN[23]D2)$")


def nodes_of_other(name: str) -> int | None:
    """Number of nodes of an element that is not a cell; None if it is not known."""
    if ONE_NODE.match(name):
        return 1
    if TWO_NODES.match(name):
        return 2
    return 3 if name == "D" else None


#: Most nodes or elements from one card; more indicate a damaged file.
MOST_GENERATED = 5_000_000

Points = Mapping[int, list[float]]


def generated(
    card: Card, known: Points, sets: Mapping[str, list[int]]
) -> Iterator[tuple[int, list[float]]]:
    """Nodes on straight lines between two others (*NGEN)."""
    if card.option("LINE"):
        raise card.place.error("*NGEN makes straight lines only here (LINE=).")
    for fields, place in card.rows():
        first, last, *rest = _whole(fields, place, 2)
        step = rest[0] if rest else 1
        ends = [known.get(first), known.get(last)]
        if ends[0] is None or ends[1] is None:
            raise place.error(f"*NGEN from {first} to {last}: both nodes must exist.")
        if step < 1 or (last - first) % step or not 0 < (last - first) // step <= MOST_GENERATED:
            raise place.error(f"*NGEN from {first} to {last} by {step} does not fit.")
        a, b = np.array(ends[0]), np.array(ends[1])
        count = (last - first) // step
        for k in range(count + 1):
            yield first + k * step, list(a + (b - a) * (k / count))


def filled(
    card: Card, known: Points, sets: Mapping[str, list[int]]
) -> Iterator[tuple[int, list[float]]]:
    """Nodes on lines between those of two sets (*NFILL)."""
    if card.option("BIAS", "1") not in ("1", "1.", "1.0") or "SINGULAR" in card.options:
        raise card.place.error("*NFILL is read with equal distances only.")
    for fields, place in card.rows():
        if len(fields) < 4:
            raise place.error("*NFILL needs two sets, a number of lines and a step.")
        pair = [sets.get(name.upper(), []) for name in fields[:2]]
        lines, step = _whole(fields[2:4], place, 2)
        if len(pair[0]) != len(pair[1]) or not pair[0]:
            raise place.error(
                f"*NFILL between {fields[0]!r} ({len(pair[0])} nodes) and {fields[1]!r} "
                f"({len(pair[1])}): both sets must be made by *NODE or *NGEN and be equally long."
            )
        if not 0 < lines * len(pair[0]) <= MOST_GENERATED:
            raise place.error(f"*NFILL over {lines} lines does not fit.")
        for one, other in zip(*pair, strict=True):
            a, b = np.array(known[one]), np.array(known[other])
            for k in range(1, lines):
                yield one + k * step, list(a + (b - a) * (k / lines))


def element_copies(
    card: Card, blocks: Sequence[Block], labels: Sequence[IntArray], nodes: Numbering
) -> list[tuple[Block, IntArray, int]]:
    """Elements in rows, layers and blocks of one (*ELGEN), with the number of that one.

    Each is numbered and has its nodes numbered by steps from the master element's.
    """
    found = []
    for fields, place in card.rows():
        master, *rest = _whole(fields, place, 2)
        counts = np.array([*rest, *[1] * (9 - len(rest))][:9]).reshape(3, 3)
        counts[counts[:, 0] < 1, 0] = 1
        total = int(np.prod(counts[:, 0].astype(object)))
        if not 0 < total <= MOST_GENERATED:
            raise place.error(f"*ELGEN would make {total} elements.")
        block, row = _of_label(master, blocks, labels, place)
        steps = [np.arange(n) for n in counts[:, 0]]
        i = np.stack([one.ravel() for one in np.meshgrid(*steps, indexing="ij")], axis=1)
        own = i @ counts[:, 2]
        shift = i @ counts[:, 1]
        more = own[1:] if total > 1 else own[:0]
        moved = Block(
            block.shape,
            block.type,
            *(
                _shifted(table[row], shift[1:], nodes, place)
                for table in (block.corners, block.mids, block.inner)
            ),
        )
        found.append((moved, master + more, master))
    return found


def _shifted(rows: IntArray, shift: IntArray, nodes: Numbering, place: Place) -> IntArray:
    label = np.empty(len(nodes.labels), dtype=np.int64)
    label[nodes.order] = nodes.labels
    wanted = label[rows][None, :] + shift[:, None]
    found = nodes.rows(wanted)
    if found.size and (found < 0).any():
        raise place.error(
            f"*ELGEN needs the node {wanted[found < 0][0]}, which the deck does not define."
        )
    return found


def _of_label(
    label: int, blocks: Sequence[Block], labels: Sequence[IntArray], place: Place
) -> tuple[Block, int]:
    for block, own in zip(blocks, labels, strict=True):
        rows = np.flatnonzero(own == label)
        if len(rows):
            return block, int(rows[0])
    raise place.error(f"*ELGEN copies the element {label}, which is not defined before.")


def _whole(fields: Sequence[str], place: Place, least: int) -> list[int]:
    numbers = [whole_number(field, place) for field in fields if field]
    if len(numbers) < least:
        raise place.error(f"{least} numbers are needed at least.")
    return numbers
