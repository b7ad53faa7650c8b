"""Universal files of I-DEAS (`.unv`), which Salome and Gmsh write, with groups and units."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from antiosc.base.errors import MeshError
from antiosc.io.conversion import as_mesh
from antiosc.io.deck import Block, Deck, Numbering, Place, real_number, whole_number
from antiosc.io.neutral import FileMesh
from antiosc.io.request import Request
from antiosc.io.shapes import CORNERS, EDGES

#: Element descriptor -> (shape, nodes).
ELEMENTS = {
    **dict.fromkeys((11, 21, 22), ("line", 2)),
    **dict.fromkeys((23, 24), ("line", 3)),
    **dict.fromkeys((41, 51, 61, 71, 91), ("triangle", 3)),
    **dict.fromkeys((42, 52, 62, 72, 92), ("triangle", 6)),
    **dict.fromkeys((44, 54, 64, 74, 94), ("quad", 4)),
    **dict.fromkeys((45, 55, 65, 75, 95), ("quad", 8)),
    111: ("tetra", 4),
    118: ("tetra", 10),
    112: ("wedge", 6),
    113: ("wedge", 15),
    115: ("hexahedron", 8),
    116: ("hexahedron", 20),
}
#: Beams, which have a line more.
WITH_ORIENTATION = (21, 22, 23, 24)
#: Places of corners and of middles of edges (in VTK's order) of second-order elements.
ORDER = {
    "line": ((0, 2), (1,)),
    "triangle": ((0, 2, 4), (1, 3, 5)),
    "quad": ((0, 2, 4, 6), (1, 3, 5, 7)),
    "tetra": ((0, 2, 4, 9), (1, 3, 5, 6, 7, 8)),
    "wedge": ((0, 2, 4, 9, 11, 13), (1, 3, 5, 10, 12, 14, 6, 7, 8)),
    "hexahedron": ((0, 2, 4, 6, 12, 14, 16, 18), (1, 3, 5, 7, 13, 15, 17, 19, 8, 9, 10, 11)),
}
UNITS_SET, NODES_SET, OLD_NODES_SET, SINGLE_NODES_SET = 164, 2411, 781, 15
ELEMENT_SETS = 2412, 780
#: Groups: with four numbers for each member, and with two.
GROUPS = {**dict.fromkeys((2435, 2452, 2467, 2477), 4), **dict.fromkeys((2429, 2430, 2432), 2)}
OF_NODES, OF_ELEMENTS = 7, 8


@dataclass
class _Content:
    """What the data sets of a file hold."""

    name: str
    labels: list[int] = field(default_factory=list)
    points: list[list[float]] = field(default_factory=list)
    #: (descriptor, shape, nodes) -> rows of (label, its nodes)
    elements: dict[tuple[int, str, int], list[list[int]]] = field(default_factory=dict)
    #: name -> (nodes, elements) by label
    groups: dict[str, tuple[list[int], list[int]]] = field(default_factory=dict)
    others: dict[str, int] = field(default_factory=dict)
    #: units of length in a metre; None: the file does not say
    per_metre: float | None = None


def read(ask: Request) -> FileMesh:
    """A universal file."""
    path = Path(ask.path)
    ask.allow(30 + 3e-5 * path.stat().st_size)
    content = path.read_bytes()
    if b"\0" in content:
        raise MeshError(f"{ask.name} holds zero bytes: it is binary, or it is damaged.")
    found = _Content(ask.name)
    for number, rows in _sets(content.decode("latin-1").splitlines(), ask.name):
        _take(found, number, rows)
    deck = _deck(found)
    if found.per_metre not in (None, 1.0) and ask.unit[0] == 1:
        deck.points /= found.per_metre
        deck.told.append(
            f"{ask.name} says that it has {found.per_metre:g} units of length in a metre (data set "
            "164); its coordinates are converted."
        )
    return as_mesh(deck)


Lines = list[tuple[str, Place]]


def _sets(lines: list[str], name: str) -> Iterator[tuple[int, Lines]]:
    """(number, lines) of the data sets, which lie between lines of -1."""
    rows: Lines | None = None
    known = False
    for k, line in enumerate(lines):
        if line.strip() != "-1":
            if rows is not None:
                rows.append((line, Place(name, k + 1)))
            continue
        if rows is None:
            rows = []
            continue
        if rows:
            head = rows[0][0].split()
            if head and head[0].rstrip("bB").isdigit():
                known = True
                yield int(head[0].rstrip("bB")[:9]), rows[1:]
        rows = None
    if rows:
        raise MeshError(f"{name} ends within a data set: it is cut off.")
    if not known:
        raise MeshError(f"{name} holds no data sets between lines of -1: it is no universal file.")


def _take(found: _Content, number: int, rows: Lines) -> None:
    if number == UNITS_SET and len(rows) > 1:
        text, place = rows[1]
        found.per_metre = real_number("".join(text.split()[:1]), place)
        place.needs(found.per_metre > 0, "the factor of length in data set 164 must be positive.")
    elif number in (NODES_SET, OLD_NODES_SET):
        for k in range(0, len(rows) - 1, 2):
            (head, at), (text, place) = rows[k], rows[k + 1]
            _node(found, head.split()[:1], at, text.split()[:3], place)
    elif number == SINGLE_NODES_SET:
        for text, place in rows:
            words = text.split()
            _node(found, words[:1], place, words[4:7], place)
    elif number in ELEMENT_SETS:
        _elements(found, rows)
    elif number in GROUPS:
        _groups(found, rows, GROUPS[number])


def _node(found: _Content, label: list[str], at: Place, x: list[str], place: Place) -> None:
    place.needs(label and len(x) == 3, "a node needs a number and three coordinates.")
    found.labels.append(whole_number(label[0], at))
    found.points.append([real_number(word, place) for word in x])


def _wholes(rows: Lines, k: int, least: int, told: str, place: Place) -> tuple[list[int], int]:
    """(whole numbers of the lines from k on, `least` or more; the line after them)."""
    found: list[int] = []
    while len(found) < least:
        place.needs(k < len(rows), told)
        found += [whole_number(word, rows[k][1]) for word in rows[k][0].split()]
        k += 1
    return found, k


def _elements(found: _Content, rows: Lines) -> None:
    k = 0
    while k < len(rows):
        text, place = rows[k]
        head = [whole_number(word, place) for word in text.split()]
        place.needs(len(head) >= 6, f"the head of an element has six numbers; got {len(head)}.")
        label, descriptor, count = head[0], head[1], head[-1]
        k += 2 if descriptor in WITH_ORIENTATION else 1
        short = f"element {label} ends before its {count} nodes."
        nodes, k = _wholes(rows, k, count, short, place)
        shape, wanted = ELEMENTS.get(descriptor, ("", 0))
        if not shape:
            kind = f"element type {descriptor}"
            found.others[kind] = found.others.get(kind, 0) + 1
            continue
        alike = len(nodes) == count == wanted
        place.needs(alike, f"element {label} of type {descriptor} has {len(nodes)} nodes, of which "
                    f"its head tells {count}; it must have {wanted}.")  # fmt: skip
        found.elements.setdefault((descriptor, shape, wanted), []).append([label, *nodes])


def _groups(found: _Content, rows: Lines, width: int) -> None:
    k = 0
    while k + 1 < len(rows):
        text, place = rows[k]
        head = [whole_number(word, place) for word in text.split()]
        count = head[-1] if head else 0
        name = rows[k + 1][0].strip() or str(head[0] if head else "")
        short = f"the group {name!r} ends before its {count} members."
        numbers, k = _wholes(rows, k + 2, width * count, short, place)
        nodes, elements = found.groups.setdefault(name, ([], []))
        for m in range(count):
            kind, label = numbers[width * m : width * m + 2]
            if kind == OF_NODES:
                nodes.append(label)
            elif kind == OF_ELEMENTS:
                elements.append(label)


def _deck(found: _Content) -> Deck:
    if not found.points:
        raise MeshError(f"{found.name} has no nodes (data sets 2411, 781 or 15).")
    nodes = Numbering(np.array(found.labels, dtype=np.int64))
    if (np.diff(nodes.labels) == 0).any():
        raise MeshError(f"{found.name} gives two nodes one number.")
    deck = Deck(found.name, np.array(found.points))
    labels = [np.zeros(0, dtype=np.int64)]
    for (descriptor, shape, count), rows in found.elements.items():
        table = np.array(rows, dtype=np.int64)
        own = nodes.rows(table[:, 1:])
        if (own < 0).any():
            row, k = np.argwhere(own < 0)[0]
            raise MeshError(
                f"element {table[row, 0]} of {found.name} has the node {table[row, k + 1]}, which "
                "the file does not define."
            )
        corners, mids = list(range(CORNERS[shape])), list[int]()
        if count > CORNERS[shape]:
            corners, mids = (list(places) for places in ORDER[shape])
            assert len(mids) == len(EDGES[shape])
        kind = f"element type {descriptor}"
        deck.blocks.append(Block(shape, kind, own[:, corners], own[:, mids], own[:, :0]))
        labels.append(table[:, 0])
    every = np.concatenate(labels)
    if not len(every):
        raise MeshError(f"{found.name} has no elements that are cells of a mesh.")
    elements = Numbering(every)
    if (np.diff(elements.labels) == 0).any():
        raise MeshError(f"{found.name} gives two elements one number.")
    deck.left = dict(found.others)
    for name, (of_nodes, of_elements) in found.groups.items():
        for some, numbering, sets in (
            (of_nodes, nodes, deck.node_sets),
            (of_elements, elements, deck.element_sets),
        ):
            rows_of = numbering.rows(np.array(some, dtype=np.int64))
            if len(rows_of[rows_of >= 0]):
                sets[name] = np.unique(rows_of[rows_of >= 0])
    return deck
