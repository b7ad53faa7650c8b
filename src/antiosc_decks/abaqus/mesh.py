"""Nodes and elements of a part of an Abaqus or CalculiX deck, or of a flat deck."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from antiosc.base.errors import MeshError
from antiosc.io.deck import (
    LARGEST_NUMBER,
    Array,
    Block,
    IntArray,
    Numbering,
    Place,
    unique_last,
    whole_number,
)
from antiosc_decks.abaqus.cards import Card, Row
from antiosc_decks.abaqus.elements import (
    element_copies,
    element_type,
    filled,
    generated,
    nodes_of_other,
)
from antiosc_decks.abaqus.table import GENERATORS

NONE = np.zeros(0, dtype=np.int64)


@dataclass
class Mesh:
    """Nodes and elements with their own numbers."""

    points: Array = field(default_factory=lambda: np.zeros((0, 3)))
    nodes: Numbering = field(default_factory=lambda: Numbering(NONE))
    blocks: list[Block] = field(default_factory=list)
    #: of the cells of the blocks, then of `others`
    elements: Numbering = field(default_factory=lambda: Numbering(NONE))
    cells: int = 0
    #: elements that are not cells: (type, its number and nodes as written)
    others: list[tuple[str, Row]] = field(default_factory=list)
    #: sets of the options NSET= and ELSET=: (which, name, rows)
    sets: list[tuple[str, str, IntArray]] = field(default_factory=list)
    told: list[str] = field(default_factory=list)


def mesh_of(cards: list[Card], name: str) -> Mesh:
    """What some cards define; `name`: of the part, in messages."""
    for card in cards:
        if card.keyword in GENERATORS:
            raise card.place.error(
                f"*{card.keyword} is not read here; write the nodes and elements "
                "that it makes into the deck."
            )
    mesh = Mesh()
    _read_nodes(mesh, cards)
    _read_elements(mesh, cards, name)
    return mesh


# --- Nodes ----------------------------------------------------------------------------------------


def _read_nodes(mesh: Mesh, cards: list[Card]) -> None:
    labels: list[int] = []
    points: list[list[float]] = []
    made: dict[str, list[int]] = {}
    makers = {"NGEN": generated, "NFILL": filled}
    for card in cards:
        start, name = len(labels), card.option("NSET")
        if card.keyword in makers:
            known = dict(zip(labels, points, strict=True))
            for label, x in makers[card.keyword](card, known, made):
                labels.append(label)
                points.append(x)
        elif card.keyword == "NODE" and "PRINT" not in card.options:
            if card.option("SYSTEM", "R").upper() not in ("R", ""):
                raise card.place.error(
                    f"*NODE, SYSTEM={card.option('SYSTEM')} is not read here; give "
                    "rectangular coordinates."
                )
            for row in card.rows():
                labels.append(whole_number(row.word(0), row.place))
                points.append([row.real(1), row.real(2), row.real(3)])
        else:
            continue
        if name:
            made.setdefault(name.upper(), []).extend(labels[start:])
            mesh.sets.append(("NSET", name, np.array(labels[start:], dtype=np.int64)))
    every = np.array(labels, dtype=np.int64)
    last = unique_last(every)
    x = np.array(points, dtype=float).reshape(-1, 3)
    mesh.points = x[last]
    mesh.nodes = Numbering(every[last])
    apart = np.abs(mesh.points[mesh.nodes.rows(every)] - x).max(axis=1)
    moved = apart > 1e-9 * np.abs(x).max(initial=0.0)
    if moved.any():
        mesh.told.append(
            f"the node {every[moved][0]} is defined at several places ({int(moved.sum())} such "
            "lines): the last one is taken."
        )
    mesh.sets = [(which, name, mesh.nodes.rows(own)) for which, name, own in mesh.sets]


# --- Elements -------------------------------------------------------------------------------------


def _read_elements(mesh: Mesh, cards: list[Card], name: str) -> None:
    cells: list[IntArray] = []
    others: list[int] = []
    sets: list[tuple[str, IntArray]] = []
    for card in cards:
        made = [NONE]
        if card.keyword == "ELGEN":
            for block, labels, master in element_copies(card, mesh.blocks, cells, mesh.nodes):
                mesh.blocks.append(block)
                cells.append(labels)
                made += [labels, np.array([master])]
        elif card.keyword == "ELEMENT" and "OUTPUT" not in card.options:
            kind = card.needed("TYPE").upper().replace(" ", "")
            if element_type(kind) is None:
                made.append(np.array(_others(mesh, card, kind), dtype=np.int64))
                others += made[-1].tolist()
            else:
                made.append(_cells(mesh, card, kind))
                cells.append(made[-1])
        if card.option("ELSET") and len(every := np.concatenate(made)):
            sets.append((card.option("ELSET"), every))
    mesh.cells = sum(map(len, cells))
    every = np.concatenate([NONE, *cells, np.array(others, dtype=np.int64)])
    numbers, count = np.unique(every, return_counts=True)
    if (count > 1).any():
        raise MeshError(
            f"{name} defines {int((count > 1).sum())} elements twice, one of them "
            f"{numbers[count > 1][0]}; every element needs a number of its own."
        )
    mesh.elements = Numbering(every)
    mesh.sets += [("ELSET", label, mesh.elements.rows(own)) for label, own in sets]


def _others(mesh: Mesh, card: Card, kind: str) -> list[int]:
    """Read one card's elements that are not cells; returns their numbers."""
    width = nodes_of_other(kind) or 0
    rows = [row for row in card.rows() if row.word(0)]
    for row in rows:
        if len(row.fields) <= width:
            raise _short(row.place, row.word(0), kind, len(row.fields) - 1, width)
        row.fields = row.fields[: 1 + width]
    mesh.others += [(kind, row) for row in rows]
    return [row.whole(0) for row in rows]


def _cells(mesh: Mesh, card: Card, kind: str) -> IntArray:
    """Read one card's cells; returns their numbers."""
    known = element_type(kind)
    assert known is not None
    rows, places = _numbers(mesh, card, known.nodes, kind)
    table = np.array(rows, dtype=np.int64).reshape(-1, 1 + known.nodes)
    nodes = mesh.nodes.rows(table[:, 1:])
    wrong = np.flatnonzero(((nodes < 0) & (table[:, 1:] != 0)).any(axis=1))
    if not len(wrong):  # a middle node may be left out
        wrong = np.flatnonzero((nodes[:, list(known.corners)] < 0).any(axis=1))
    if len(wrong):
        row = int(wrong[0])
        missing = int(table[row, 1:][nodes[row] < 0][0])
        raise places[row].error(
            f"element {table[row, 0]} ({kind}) has the node {missing}, which "
            f"the deck does not define ({len(wrong)} such elements)."
        )
    pick = [nodes[:, list(some)] for some in (known.corners, known.mids, known.inner)]
    if len(table):
        mesh.blocks.append(Block(known.shape, kind, *pick))
    return table[:, 0]


def _numbers(mesh: Mesh, card: Card, width: int, kind: str) -> tuple[list[list[int]], list[Place]]:
    """(number and nodes of every element, which may take several lines; its place)."""
    least = 1 + width
    found: list[list[int]] = []
    places: list[Place] = []
    current: list[int] = []
    start, longer = card.place, 0
    for line, place in zip(card.lines, card.places, strict=True):
        if not current:
            start = place
        words = line.split(",")
        try:
            numbers = [int(word) for word in words if word and not word.isspace()]
        except ValueError:
            numbers = [whole_number(word, place) for word in words if word.strip()]
        if max(map(abs, numbers), default=0) > LARGEST_NUMBER:
            raise place.error("a number of a node or element is too large.")
        current += numbers
        if len(current) >= least:
            longer += len(current) > least
            found.append(current[:least])
            places.append(start)
            current = []
    if current:
        raise _short(start, current[0], kind, len(current) - 1, width)
    if longer:
        mesh.told.append(
            f"{card.place}: {longer} {kind} elements list more than their {width} nodes; the "
            f"first {width} are taken, as CalculiX does."
        )
    return found, places


def _short(place: Place, label: object, kind: str, nodes: int, width: int) -> MeshError:
    return place.error(
        f"element {label} of type {kind} has {nodes} nodes; it must "
        f"have {width}: the deck is cut off, or of another program."
    )
