"""Abaqus and CalculiX decks into nodes, elements and sets."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from antiosc.base.errors import MeshError
from antiosc.io.deck import (
    LARGEST_NUMBER,
    Block,
    Deck,
    IntArray,
    Numbering,
    Place,
    real_number,
    unique_last,
    whole_number,
)
from antiosc_decks.abaqus.cards import Card
from antiosc_decks.abaqus.elements import (
    element_copies,
    element_type,
    filled,
    generated,
    nodes_of_other,
)
from antiosc_decks.abaqus.table import GENERATORS


@dataclass
class Scope:
    """Nodes, elements and sets with their own numbers and names: a part, or a flat deck."""

    name: str
    cards: list[Card] = field(default_factory=list)
    deck: Deck = field(default_factory=lambda: Deck(""))
    nodes: Numbering = field(default_factory=lambda: Numbering(np.zeros(0, dtype=np.int64)))
    elements: Numbering = field(default_factory=lambda: Numbering(np.zeros(0, dtype=np.int64)))
    #: elements that are not cells: (type, label, rows of nodes, set)
    others: list[tuple[str, int, list[int]]] = field(default_factory=list)
    other_numbers: set[int] = field(default_factory=set)
    #: names in upper case -> as first written
    spelling: dict[str, str] = field(default_factory=dict)
    #: set names in upper case -> labels of `others` in it
    other_sets: dict[str, list[int]] = field(default_factory=dict)

    def other_labels(self, word: str) -> list[int]:
        """Labels of `others` that a number or the name of a set stands for."""
        if not word.isdigit():
            return self.other_sets.get(word.strip('"').upper(), [])
        return [int(word)] if int(word) in self.other_numbers else []

    def spelled(self, name: str) -> str:
        """A set's name as first written; upper and lower case are not distinguished."""
        return self.spelling.setdefault(name.upper(), name)


def meshed(scope: Scope, with_sets: bool = True) -> Scope:
    """Fill the scope's nodes, elements and sets from its cards."""
    for card in scope.cards:
        if card.keyword in GENERATORS:
            raise card.place.error(
                f"*{card.keyword} is not read here; write the nodes and elements "
                "that it makes into the deck."
            )
    _read_nodes(scope)
    _read_elements(scope)
    for card in scope.cards if with_sets else ():
        if card.keyword in ("NSET", "ELSET"):
            _read_set(scope, card)
    return scope


# --- Nodes ----------------------------------------------------------------------------------------


def _read_nodes(scope: Scope) -> None:
    labels: list[int] = []
    points: list[list[float]] = []
    sets: dict[str, list[int]] = {}
    for card in scope.cards:
        made: list[int] = []
        if card.keyword == "NODE" and "PRINT" not in card.options:
            if card.option("SYSTEM", "R").upper() not in ("R", ""):
                raise card.place.error(
                    f"*NODE, SYSTEM={card.option('SYSTEM')} is not read here; give "
                    "rectangular coordinates."
                )
            for fields, place in card.rows():
                if not fields:
                    continue
                made.append(whole_number(fields[0], place))
                xyz = [real_number(f, place) if f else 0.0 for f in fields[1:4]]
                points.append(xyz + [0.0] * (3 - len(xyz)))
            labels += made
        elif card.keyword in ("NGEN", "NFILL"):
            known = dict(zip(labels, points, strict=True))
            make = generated if card.keyword == "NGEN" else filled
            for label, xyz in make(card, known, sets):
                made.append(label)
                labels.append(label)
                points.append(xyz)
        else:
            continue
        if card.option("NSET"):
            sets.setdefault(scope.spelled(card.option("NSET")).upper(), []).extend(made)
    rows = np.array(labels, dtype=np.int64)
    last = unique_last(rows)
    scope.deck.points = np.array(points, dtype=float).reshape(-1, 3)[last]
    scope.nodes = Numbering(rows[last])
    for name, some in sets.items():
        extend(scope.deck.node_sets, scope.spelled(name), scope.nodes.rows(np.array(some)))


# --- Elements -------------------------------------------------------------------------------------


def _read_elements(scope: Scope) -> None:
    labels: list[IntArray] = []
    sets: dict[str, list[IntArray]] = {}
    for card in scope.cards:
        if card.keyword == "ELGEN":
            found = element_copies(card, scope.deck.blocks, labels, scope.nodes)
            for block, made, master in found:
                scope.deck.blocks.append(block)
                labels.append(made)
                if card.option("ELSET"):
                    name = scope.spelled(card.option("ELSET"))
                    sets.setdefault(name, []).append(np.append(made, master))
            continue
        if card.keyword != "ELEMENT" or "OUTPUT" in card.options:
            continue
        kind = card.needed("TYPE").upper().replace(" ", "")
        made = _cells(scope, card, kind, labels)
        if card.option("ELSET") and len(made):
            sets.setdefault(scope.spelled(card.option("ELSET")), []).append(made)
    every = np.concatenate([np.zeros(0, dtype=np.int64), *labels])
    _refuse_repeated(scope, every)
    scope.elements = Numbering(every)
    for name, some in sets.items():
        rows = scope.elements.rows(np.concatenate(some))
        extend(scope.deck.element_sets, name, rows[rows >= 0])


def _cells(scope: Scope, card: Card, kind: str, labels: list[IntArray]) -> IntArray:
    """Read one card's elements; returns the labels of those that are cells."""
    none = np.zeros(0, dtype=np.int64)
    known = element_type(kind)
    if known is None:
        width = nodes_of_other(kind)
        rows = (
            _numbers(scope, card, width, kind)
            if width
            else [([whole_number(f[0], p)], p) for f, p in card.rows() if f and f[0]]
        )
        scope.deck.leave(kind, len(rows))
        for numbers, _ in rows:
            scope.others.append((kind, numbers[0], numbers[1:]))
            scope.other_numbers.add(numbers[0])
            if card.option("ELSET"):
                name = scope.spelled(card.option("ELSET")).upper()
                scope.other_sets.setdefault(name, []).append(numbers[0])
        return none
    rows = _numbers(scope, card, known.nodes, kind)
    if not rows:
        return none
    table = np.array([numbers for numbers, _ in rows], dtype=np.int64)
    nodes = scope.nodes.rows(table[:, 1:])
    wrong = np.flatnonzero(((nodes < 0) & (table[:, 1:] != 0)).any(axis=1))
    needed = nodes[:, list(known.corners)] < 0
    if not len(wrong):
        wrong = np.flatnonzero(needed.any(axis=1))
    if len(wrong):
        row = int(wrong[0])
        missing = int(table[row, 1:][nodes[row] < 0][0])
        raise rows[row][1].error(
            f"element {table[row, 0]} ({kind}) has the node {missing}, which "
            f"the deck does not define ({len(wrong)} such elements)."
        )
    pick = [nodes[:, list(some)] for some in (known.corners, known.mids, known.inner)]
    scope.deck.blocks.append(Block(known.shape, kind, *pick))
    labels.append(table[:, 0])
    return table[:, 0]


def _numbers(scope: Scope, card: Card, width: int, kind: str) -> list[tuple[list[int], Place]]:
    """(label and nodes, place) of every element, which may take several lines."""
    least = 1 + width
    found: list[tuple[list[int], Place]] = []
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
            found.append((current[:least], start))
            current = []
    if current:
        raise start.error(
            f"element {current[0]} of type {kind} has {len(current) - 1} nodes; it must "
            f"have {width}: the deck is cut off, or of another program."
        )
    if longer:
        scope.deck.told.append(
            f"{card.place}: {longer} {kind} elements list more than their {width} nodes; the "
            f"first {width} are taken, as CalculiX does."
        )
    return found


def _refuse_repeated(scope: Scope, labels: IntArray) -> None:
    numbers, count = np.unique(labels, return_counts=True)
    if (count > 1).any():
        raise MeshError(
            f"{scope.name} defines {int((count > 1).sum())} elements twice, one of them "
            f"{numbers[count > 1][0]}; every element needs a number of its own."
        )


# --- Sets -----------------------------------------------------------------------------------------


def _read_set(scope: Scope, card: Card) -> None:
    of_nodes = card.keyword == "NSET"
    name = scope.spelled(card.needed(card.keyword))
    numbering = scope.nodes if of_nodes else scope.elements
    sets = scope.deck.node_sets if of_nodes else scope.deck.element_sets
    found: list[IntArray] = []
    if of_nodes and card.option("ELSET"):
        elements = members(scope, "ELSET", card.option("ELSET"))
        if elements is not None:
            found.append(nodes_of(scope.deck, elements))
        elif not scope.other_labels(card.option("ELSET")):
            scope.deck.told.append(
                f"{card.place}: *NSET {name} is of the set of elements {card.option('ELSET')}, "
                "which does not exist before it."
            )
    lost: list[str] = []
    count = 0
    for fields, place in card.rows():
        if "GENERATE" in card.options:
            found.append(ranged(fields, place, numbering))
            continue
        some = [f for f in fields if f]
        count += len(some)
        for word in some:
            rows = members(scope, card.keyword, word)
            own = [] if of_nodes else scope.other_labels(word)
            if rows is None and not own:
                lost.append(word)
            if rows is not None:
                found.append(rows)
            if own:
                scope.other_sets.setdefault(name.upper(), []).extend(own)
    if lost:
        scope.deck.told.append(
            f"{card.place}: {len(lost)} of {count} members of *{card.keyword} {name} do not exist "
            f"({', '.join(lost[:4])}{', …' * (len(lost) > 4)})."
        )
    extend(sets, name, np.concatenate([np.zeros(0, dtype=np.int64), *found]))


def ranged(fields: list[str], place: Place, numbering: Numbering) -> IntArray:
    """Rows of the existing numbers in a range, which may be wide."""
    if len(fields) < 2:
        raise place.error("GENERATE needs a first and a last number.")
    first, last = (whole_number(field, place) for field in fields[:2])
    step = whole_number(fields[2], place) if len(fields) > 2 and fields[2] else 1
    if step == 0 and first == last:
        step = 1
    if step < 1 or last < first:
        raise place.error(f"GENERATE from {first} to {last} by {step} selects nothing.")
    return numbering.between(first, last, step)


def members(scope: Scope, keyword: str, word: str) -> IntArray | None:
    """Rows of a number, or of the set with this name; None if there is none."""
    word = word.strip().strip('"')
    numbering, sets = (
        (scope.nodes, scope.deck.node_sets)
        if keyword == "NSET"
        else (scope.elements, scope.deck.element_sets)
    )
    try:
        label = int(word)
    except ValueError:
        return sets.get(scope.spelling.get(word.upper(), word))
    rows = numbering.rows(np.array([label]))
    return rows if rows[0] >= 0 else None


def nodes_of(deck: Deck, elements: IntArray) -> IntArray:
    """All nodes of elements."""
    found, start = [np.zeros(0, dtype=np.int64)], 0
    for block in deck.blocks:
        own = elements[(elements >= start) & (elements < start + len(block))] - start
        found += [table[own].ravel() for table in (block.corners, block.mids, block.inner)]
        start += len(block)
    every = np.unique(np.concatenate(found))
    return every[every >= 0]


def extend(sets: dict[str, IntArray], name: str, rows: IntArray) -> None:
    """Add rows to a new or existing set; -1 is ignored."""
    sets[name] = np.unique(np.concatenate([sets.get(name, rows[:0]), rows[rows >= 0]]))
