"""Assembly of the parts and instances of an Abaqus deck; a flat deck is a single part."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass, field

import numpy as np

from antiosc.base.errors import MeshError
from antiosc.io.conversion import Deck, IntArray
from antiosc_decks.abaqus_cards import FIRST_NON_CELL_ROW, Card, Row, Scope, account_for, read_cards
from antiosc_decks.abaqus_mesh import NO_ROWS, AbaqusMesh, mesh_of
from antiosc_decks.constraints import lever_matrix
from antiosc_decks.entries import DeckPlace, Numbering
from antiosc_decks.sources import Account, Sources

#: Keyword of a set -> what its members are.
MEMBER_NOUNS = {"NSET": "node", "ELSET": "element"}


@dataclass
class Instance(Scope):
    """A part placed in the assembly; `first_…`: rows in the deck of its first node, cell, other."""

    assembly: AbaqusDeck
    cards: list[Card]
    mesh: AbaqusMesh
    first_node_row: int = 0
    first_element_row: int = 0
    first_non_cell_row: int = 0

    def deck_rows(self, keyword: str, rows: IntArray) -> IntArray:
        """Rows in the whole deck of nodes (NSET) or elements (ELSET) given by `rows` here."""
        if keyword == "NSET":
            return rows + self.first_node_row
        extra_rows = rows - self.mesh.cell_count
        return np.where(
            extra_rows < 0,
            rows + self.first_element_row,
            extra_rows + self.first_non_cell_row + FIRST_NON_CELL_ROW,
        )

    def original_name(self, name: str) -> str:
        """A set's name as it was first written; names are not case-sensitive."""
        name = self.prefix + name
        return self.assembly.set_spellings.setdefault(name.upper(), name)

    def rows(self, keyword: str, number_or_set: str, place: DeckPlace) -> IntArray:
        """Rows of the node (NSET) or element (ELSET) with this number, or of the set's members."""
        members = self.find(keyword, number_or_set)
        if members is None:
            noun = MEMBER_NOUNS[keyword]
            where = f" in {self.name}" if self.name else ""
            number = number_or_set.lstrip("-").isdigit()
            if number and len(self.assembly.instances) > 1 and not self.name:
                where = " outside the instances; name its instance (INSTANCE=)"
            noun = noun if number else f"set of {noun}s"
            raise place.error(f"there is no {noun} {number_or_set}{where}.")
        return members

    def find(self, keyword: str, number_or_set: str) -> IntArray | None:
        """As `rows`; None if no such number or set exists."""
        number_or_set = number_or_set.strip().strip('"')
        name, dot, inner = number_or_set.partition(".")
        owner = self
        if dot and name.upper() in self.assembly.instances:
            owner = self.assembly.instances[name.upper()]
            number_or_set = inner
        try:
            label = np.array([int(number_or_set)])
        except ValueError:
            return self.assembly.sets.get((keyword, (owner.prefix + number_or_set).upper()))
        rows = owner.rows_by_number(keyword, lambda known: known.rows(label))
        return rows if len(rows) else None

    def rows_by_number(self, keyword: str, rows_of: Callable[[Numbering], IntArray]) -> IntArray:
        """Deck rows that `rows_of` finds in this instance, or else in an assembly's only one."""
        instances = list(self.assembly.instances.values())
        for instance in (self, *instances[1:2] * (not self.name and len(instances) == 2)):
            rows = rows_of(instance.mesh.nodes if keyword == "NSET" else instance.mesh.elements)
            if (rows >= 0).any():
                return instance.deck_rows(keyword, rows)
        return NO_ROWS


@dataclass
class AbaqusDeck:
    """An assembled deck, with the cards that do not define the mesh."""

    deck: Deck
    #: what becomes of each card
    account: Account
    #: by name in upper case; "" is the deck itself, or its assembly
    instances: dict[str, Instance] = field(default_factory=dict)
    #: cards outside steps, each with the instance whose names it uses
    cards: list[Card] = field(default_factory=list)
    #: cards of each step
    steps: list[list[Card]] = field(default_factory=list)
    #: elements that are not cells: (type, its number and nodes, of which instance)
    non_cells: list[tuple[str, Row, Instance]] = field(default_factory=list)
    #: (NSET or ELSET, name in upper case) -> rows
    sets: dict[tuple[str, str], IntArray] = field(default_factory=dict)
    #: names in upper case -> as first written
    set_spellings: dict[str, str] = field(default_factory=dict)

    def cards_named(self, *keywords: str) -> list[Card]:
        """The model's cards with one of the given keywords."""
        return [card for card in self.cards if card.keyword in keywords]

    def non_cells_of(self, card: Card) -> Iterator[tuple[str, list[int]]]:
        """Yield (type, rows of nodes) of each element in a card's set that is not a cell."""
        rows = card.scope.rows("ELSET", card.required_option("ELSET"), card.place)
        for k in rows[rows >= FIRST_NON_CELL_ROW] - FIRST_NON_CELL_ROW:
            kind, row, members = self.non_cells[k]
            yield kind, [members.node(word, row.place) for word in row.fields[1:]]

    def add(self, instance: Instance) -> None:
        """Add an instance's nodes, elements and sets."""
        deck = self.deck
        mesh = instance.mesh
        name = instance.name
        self.instances[name.upper()] = instance
        nodes = instance.first_node_row = len(deck.points)
        start = instance.first_element_row = deck.n_elements
        instance.first_non_cell_row = len(self.non_cells)
        labels = np.empty(len(mesh.points), dtype=np.int64)
        labels[mesh.nodes.order] = mesh.nodes.labels
        deck.labels = np.concatenate([deck.labels, labels])
        points = mesh.points @ instance.rotation.T + instance.translation
        deck.points = np.vstack([deck.points, points])
        for block in mesh.blocks:
            deck.blocks.append(block.mapped(lambda table: np.where(table >= 0, table + nodes, -1)))

        for kind, row in mesh.non_cells:
            deck.skipped[kind] += 1
            self.non_cells.append((kind, row, instance))
        deck.remarks += [sentence for sentence in mesh.remarks if sentence not in deck.remarks]
        for keyword, label, rows in mesh.sets:
            self._extend_set(keyword, label, instance, [instance.deck_rows(keyword, rows)])

        if name:
            top = self.instances[""]
            self._extend_set("ELSET", name, top, [np.arange(start, deck.n_elements)])
        self.cards += [card.in_scope(instance) for card in instance.cards]

    def _extend_set(self, keyword: str, name: str, scope: Scope, rows: list[IntArray]) -> None:
        """Add rows of nodes (NSET) or elements (ELSET) to the set `name`, new or old."""
        key = keyword, scope.original_name(name).upper()
        self.sets[key] = np.unique(np.concatenate([self.sets.get(key, NO_ROWS), *rows]))

    def read_set(self, card: Card) -> None:
        """Read a card *NSET or *ELSET; at assembly level its members may belong to instances."""
        keyword = card.keyword
        name = card.required_option(keyword)
        scope = card.scope
        instance = self.instances[scope.name.upper()]
        if of := card.option("INSTANCE"):
            none = f"there is no instance {of!r}."
            instance = card.place.look_up(self.instances, of.upper(), none)
        members: list[IntArray] = []
        if keyword == "NSET" and (elements := card.option("ELSET")):
            cells = instance.find("ELSET", elements)
            members += [] if cells is None else [self.deck.nodes_of(cells)]
            if cells is None:
                told = f"{card.place}: *NSET {name} is of the set of elements {elements}"
                self.deck.remarks.append(f"{told}, which does not exist before it.")

        strict = len(self.instances) > 1 and not scope.name
        numbers = self._rows_if_numbers(card, instance)
        members += [] if numbers is None else [numbers]
        absent = []
        count = 0
        for row in card.rows() if numbers is None else ():
            if "GENERATE" in card.options:
                members.append(instance.rows_by_number(keyword, _range_selector(row)))
                some = not strict or len(members[-1])
                row.needs(some, f"this *{keyword} selects nothing; name its INSTANCE=.")
                continue
            for word in filter(None, row.fields):
                count += 1
                rows = instance.find(keyword, word)
                if rows is None and strict:
                    rows = instance.rows(keyword, word, row.place)  # raises
                members += [] if rows is None else [rows]
                absent += [word] * (rows is None)

        if absent:
            told = f"{card.place}: {len(absent)} of {count} members of *{keyword} {name}"
            some_text = f"{', '.join(absent[:4])}{', …' * (len(absent) > 4)}"
            self.deck.remarks.append(f"{told} do not exist ({some_text}).")
        self._extend_set(keyword, name, scope, members)

    def _rows_if_numbers(self, card: Card, instance: Instance) -> IntArray | None:
        """Deck rows of a set's members if all are numbers in `instance`; else None."""
        every = (word.strip() for line in card.lines for word in line.split(","))
        words = [word for word in every if word]
        if "GENERATE" in card.options or not all(w.isdecimal() and len(w) < 19 for w in words):
            return None
        numbering = instance.mesh.nodes if card.keyword == "NSET" else instance.mesh.elements
        rows = numbering.rows(np.array(words, dtype=np.int64))
        return instance.deck_rows(card.keyword, rows) if (rows >= 0).all() else None


def _range_selector(row: Row) -> Callable[[Numbering], IntArray]:
    """A function from a numbering to the rows of a GENERATE range (first, last, step)."""
    row.needs(len(row.fields) >= 2, "GENERATE needs a first and a last number.")
    first, last = row.integer(0), row.integer(1)
    step = row.integer(2, 1) or int(first == last)
    some = step >= 1 and last >= first
    row.needs(some, f"GENERATE from {first} to {last} by {step} selects nothing.")
    return lambda known: known.rows_between(first, last, step)


def read_deck(sources: Sources) -> AbaqusDeck:
    """Read a deck from its files."""
    cards = read_cards(sources)
    name = sources.name
    assembled = AbaqusDeck(Deck(name), account_for(cards, name))
    top, parts, instances = _cards_by_owner(cards, assembled.steps)
    alone = [] if instances else list(parts.values())  # without instances each part is its own
    if len(alone) == 1:  # and a single one a flat deck
        top = alone.pop()[1] + top
    assembled.add(Instance("", np.eye(3), np.zeros(3), assembled, top, mesh_of(top, name)))
    meshes: dict[str, AbaqusMesh] = {}
    used_parts = {card.option("PART").upper() for card, _ in instances}

    for part, (spelled, _) in parts.items():
        if instances and part not in used_parts:
            told = f"the part {spelled!r} of {name} has no instance: left out."
            assembled.deck.remarks.append(told)
    for spelled, part_cards in alone:
        mesh = mesh_of(part_cards, spelled)
        assembled.add(Instance(spelled, np.eye(3), np.zeros(3), assembled, part_cards, mesh))

    for card, placement_rows in instances:
        assembled.add(_instance_of(assembled, card, placement_rows, parts, meshes))
    for card in sorted(assembled.cards_named(*MEMBER_NOUNS), key=lambda card: not card.scope.name):
        assembled.read_set(card)
    sets_by_keyword = {"NSET": assembled.deck.node_sets, "ELSET": assembled.deck.element_sets}
    for (keyword, label), rows in assembled.sets.items():  # without elements that are not cells
        cells = rows[rows < FIRST_NON_CELL_ROW]
        if len(cells) or not len(rows):
            sets_by_keyword[keyword][assembled.set_spellings[label]] = cells

    if not len(assembled.deck.points):
        raise MeshError(f"{name} defines no nodes (*NODE): give the deck that includes this file.")
    return assembled


PartCards = dict[str, tuple[str, list[Card]]]


def _cards_by_owner(
    cards: list[Card], steps: list[list[Card]]
) -> tuple[list[Card], PartCards, list[tuple[Card, list[Card]]]]:
    """Sort cards by owner: (assembly, parts, instances with their cards); fill `steps`."""
    top: list[Card] = []
    parts: PartCards = {}
    instances: list[tuple[Card, list[Card]]] = []
    current = top
    in_step = False
    names: set[tuple[str, str]] = set()
    for card in cards:
        if card.keyword in ("PART", "INSTANCE"):
            owner = card.keyword, card.required_option("NAME").upper()
            is_new = owner not in names
            card.needs(is_new, f"{card.label} {card.option('NAME')!r} is there twice.")
            names.add(owner)
            current = []
            if card.keyword == "PART":
                parts[owner[1]] = card.required_option("NAME"), current
            else:
                instances.append((card, current))
        elif card.keyword in ("ENDPART", "ENDINSTANCE"):
            current = top
        elif card.keyword in ("STEP", "ENDSTEP"):
            in_step = card.keyword == "STEP"
            steps += [[]] * in_step
        else:
            in_model = not in_step or card.keyword in MEMBER_NOUNS
            (current if in_model else steps[-1]).append(card)

    return top, parts, instances


def _instance_of(
    assembly: AbaqusDeck,
    card: Card,
    instance_cards: list[Card],
    parts: PartCards,
    meshes: dict[str, AbaqusMesh],
) -> Instance:
    """The instance of an *INSTANCE card: its mesh, rotation and translation."""
    name = card.required_option("NAME")
    part_name = card.option("PART")
    message = f"the instance {name!r} is of the part {part_name!r}, which the deck does not define."
    spelled, cards = card.place.look_up(parts, part_name.upper(), message)
    cards = [*cards, *instance_cards]
    if any(c.keyword in ("NODE", "ELEMENT") for c in instance_cards):
        mesh = mesh_of(cards, name)
    else:
        if part_name.upper() not in meshes:
            meshes[part_name.upper()] = mesh_of(cards, spelled)
        mesh = meshes[part_name.upper()]
    rotation = np.eye(3)
    shift = np.zeros(3)
    rows = card.rows()
    if rows:
        shift = np.array(rows[0].reals(3))

    for row in rows[1:2]:  # Rodrigues' matrix of a rotation about an axis
        row.needs(len(row.fields) >= 7, "the rotation of an instance is two points and an angle.")
        a, b = np.reshape(row.reals(6), (2, 3))
        length = float(np.linalg.norm(b - a))
        angle = np.deg2rad(row.real(6))
        row.needs(length != 0, "the two points of a rotation coincide.")
        K = -lever_matrix((b - a) / length)
        rotation = np.eye(3) + np.sin(angle) * K + (1 - np.cos(angle)) * (K @ K)
        shift = a + rotation @ (shift - a)

    return Instance(name, rotation, shift, assembly, cards, mesh)
