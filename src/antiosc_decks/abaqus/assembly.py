"""Assembly of the parts and instances of an Abaqus deck; a flat deck is a single part."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from antiosc.base.errors import MeshError
from antiosc.io.deck import Array, Block, Deck, IntArray, Place, real_number
from antiosc_decks.abaqus.cards import Card, cards as read_cards
from antiosc_decks.abaqus.mesh import Scope, extend, members, meshed, ranged
from antiosc_decks.abaqus.table import account_for
from antiosc_decks.account import Account
from antiosc_decks.sources import Sources

Rows = IntArray


@dataclass
class Instance:
    """A placed part: the first rows of its nodes and elements in the whole deck."""

    name: str
    scope: Scope
    first_node: int
    first_element: int
    #: x in the whole deck: turn @ x in the part + shift
    turn: Array
    shift: Array

    def refuse_turned(self, card: Card) -> None:
        """MeshError if the instance is rotated: the card gives motions or axes by their numbers."""
        if not np.allclose(self.turn, np.eye(3), rtol=0, atol=1e-9):
            raise card.place.error(
                f"the instance {self.name!r} is rotated, and the axes of this "
                f"*{card.keyword} in its part may be those before or after; give it outside the "
                "part, or by vectors (n1, *ORIENTATION)."
            )


@dataclass
class Whole:
    """An assembled deck, with the cards that do not define the mesh."""

    deck: Deck
    #: by name in upper case; "" is the deck itself, or its assembly
    instances: dict[str, Instance]
    #: cards outside steps, and the instance whose names they use
    cards: list[tuple[Card, Instance]] = field(default_factory=list)
    #: cards of each step
    steps: list[list[Card]] = field(default_factory=list)
    #: what becomes of each card
    account: Account = field(default_factory=lambda: Account(""))

    def named(self, *keywords: str) -> list[tuple[Card, Instance]]:
        """The cards of the model of these keywords."""
        return [(card, within) for card, within in self.cards if card.keyword in keywords]

    def nodes(self, word: str, place: Place, within: Instance) -> Rows:
        """Rows of the node or of the set of nodes that `word` names."""
        return self._rows("NSET", word, place, within)

    def elements(self, word: str, place: Place, within: Instance) -> Rows:
        """Numbers of the element or of the set of elements that `word` names."""
        return self._rows("ELSET", word, place, within)

    def _rows(self, keyword: str, word: str, place: Place, within: Instance) -> Rows:
        word = word.strip().strip('"')
        name, dot, inner = word.partition(".")
        if dot and name.upper() in self.instances:
            within, word = self.instances[name.upper()], inner
        first = within.first_node if keyword == "NSET" else within.first_element
        found = members(within.scope, keyword, word)
        if not within.name:  # sets of the assembly may have members in instances
            sets = self.deck.node_sets if keyword == "NSET" else self.deck.element_sets
            found = sets.get(within.scope.spelling.get(word.upper(), word), found)
        if found is not None:
            return found + first
        if keyword == "ELSET" and within.scope.other_labels(word):
            return np.zeros(0, dtype=np.int64)
        what = "node" if keyword == "NSET" else "element"
        where = f" in {within.name}" if within.name else ""
        if word.lstrip("-").isdigit() and len(self.instances) > 1 and not within.name:
            where = " outside the instances; name its instance (INSTANCE=)"
        kind = what if word.lstrip("-").isdigit() else f"set of {what}s"
        raise place.error(f"there is no {kind} {word}{where}.")


def read(
    path: Path,
    name: str,
    on_size: Callable[[int], None] = lambda size: None,
    root: str | None = None,
) -> Whole:
    """The deck in a file; `on_size` is called with the number of bytes read.

    `root`: the folder of the files that it may include; None: its own, or the one above.
    """
    cards = read_cards(Sources(path, name, on_size, root))
    top, parts, placed, steps = _divided(cards, name)
    assembled = bool(placed)
    meshed(top, with_sets=not assembled)
    whole = Whole(Deck(name), {}, [], steps, account_for(cards, name))
    whole.deck.told += whole.account.unknown_cards()
    whole.instances[""] = _add(whole.deck, "", top, np.eye(3), np.zeros(3))
    for part in parts.values():
        if not any(card.option("PART").upper() == part.name.upper() for card, _ in placed):
            whole.deck.told.append(f"the part {part.name!r} of {name} has no instance: left out.")
            continue
        meshed(part)
    for card, own in placed:
        whole.instances[card.needed("NAME").upper()] = _placed(whole.deck, card, own, parts)
    for instance in whole.instances.values():
        whole.cards += [(card, instance) for card in instance.scope.cards]
    if assembled:
        _name_sets(whole, top)
    if not len(whole.deck.points):
        raise MeshError(f"{name} defines no nodes (*NODE).")
    return whole


def _divided(
    cards: list[Card], name: str
) -> tuple[Scope, dict[str, Scope], list[tuple[Card, Scope]], list[list[Card]]]:
    """(cards outside parts, parts, instances with their cards, steps)."""
    top = Scope(name)
    parts: dict[str, Scope] = {}
    placed: list[tuple[Card, Scope]] = []
    steps: list[list[Card]] = []
    current, in_step = top, False
    for card in cards:
        match card.keyword:
            case "PART":
                current = parts[card.needed("NAME").upper()] = Scope(card.needed("NAME"))
            case "INSTANCE":
                current = Scope(card.needed("NAME"))
                placed.append((card, current))
            case "ENDPART" | "ENDINSTANCE":
                current = top
            case "STEP":
                in_step = True
                steps.append([])
            case "ENDSTEP":
                in_step = False
            case "NSET" | "ELSET":
                current.cards.append(card)
            case _ if in_step:
                steps[-1].append(card)
            case _:
                current.cards.append(card)
    return top, parts, placed, steps


def _placed(deck: Deck, card: Card, own: Scope, parts: dict[str, Scope]) -> Instance:
    name = card.needed("NAME")
    wanted = card.option("PART")
    if wanted.upper() not in parts:
        raise card.place.error(
            f"the instance {name!r} is of the part {wanted!r}, which the deck does not define."
        )
    part = parts[wanted.upper()]
    if any(c.keyword in ("NODE", "ELEMENT") for c in own.cards):
        own.cards = [*part.cards, *own.cards]
        part = meshed(own)
    turn, shift = np.eye(3), np.zeros(3)
    rows = [(fields, place) for fields, place in card.rows() if fields]
    if rows:
        fields, place = rows[0]
        shift = np.array([real_number(f, place) if f else 0.0 for f in (*fields, "", "")[:3]])
    if len(rows) > 1:
        fields, place = rows[1]
        numbers = [real_number(f, place) if f else 0.0 for f in fields]
        if len(numbers) < 7:
            raise place.error("the rotation of an instance is two points and an angle.")
        a, b = np.array(numbers[:3]), np.array(numbers[3:6])
        turn = _rotation(b - a, numbers[6], place)
        shift = a + turn @ (shift - a)
    return _add(deck, name, part, turn, shift)


def _rotation(axis: Array, degrees: float, place: Place) -> Array:
    """Rodrigues' matrix of a rotation about an axis."""
    length = float(np.linalg.norm(axis))
    if length == 0:
        raise place.error("the two points of a rotation coincide.")
    x, y, z = axis / length
    K = np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]])
    angle = np.deg2rad(degrees)
    return np.asarray(np.eye(3) + np.sin(angle) * K + (1 - np.cos(angle)) * (K @ K))


def _add(deck: Deck, name: str, scope: Scope, turn: Array, shift: Array) -> Instance:
    """Add a scope's nodes, elements and sets to the whole deck."""
    own = scope.deck
    nodes, elements = len(deck.points), deck.n_elements
    deck.points = np.vstack([deck.points, own.points @ turn.T + shift])
    for block in own.blocks:
        tables = (block.corners, block.mids, block.inner)
        moved = [np.where(table >= 0, table + nodes, -1) for table in tables]
        deck.blocks.append(Block(block.shape, block.type, *moved))
    for kind, count in own.left.items():
        deck.leave(kind, count)
    deck.told += [sentence for sentence in own.told if sentence not in deck.told]
    prefix = f"{name}." if name else ""
    for label, rows in own.node_sets.items():
        extend(deck.node_sets, prefix + label, rows + nodes)
    for label, rows in own.element_sets.items():
        extend(deck.element_sets, prefix + label, rows + elements)
    if name:
        extend(deck.element_sets, name, np.arange(elements, deck.n_elements))
    return Instance(name, scope, nodes, elements, turn, shift)


def _name_sets(whole: Whole, top: Scope) -> None:
    """Add the sets of the assembly, whose members belong to instances."""
    for card in top.cards:
        if card.keyword not in ("NSET", "ELSET"):
            continue
        name = top.spelled(card.needed(card.keyword))
        sets = whole.deck.node_sets if card.keyword == "NSET" else whole.deck.element_sets
        extend(sets, name, np.concatenate([np.zeros(0, dtype=np.int64), *_members(whole, card)]))


def _members(whole: Whole, card: Card) -> Iterator[Rows]:
    within = whole.instances[""]
    if card.option("INSTANCE"):
        wanted = card.option("INSTANCE").upper()
        if wanted not in whole.instances:
            raise card.place.error(f"there is no instance {card.option('INSTANCE')!r}.")
        within = whole.instances[wanted]
    of_nodes = card.keyword == "NSET"
    numbering = within.scope.nodes if of_nodes else within.scope.elements
    first = within.first_node if of_nodes else within.first_element
    for fields, place in card.rows():
        if "GENERATE" in card.options:
            some = ranged(fields, place, numbering)
            if not len(some):
                raise place.error(
                    f"*{card.keyword} in the assembly selects nothing; name the instance "
                    "of its numbers (INSTANCE=)."
                )
            yield some + first
            continue
        look_up = whole.nodes if of_nodes else whole.elements
        for word in fields:
            if word:
                yield look_up(word, place, within)
