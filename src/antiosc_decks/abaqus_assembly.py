"""Assembly of the parts and instances of an Abaqus deck; a flat deck is a single part."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass, field

import numpy as np

from antiosc.base.errors import MeshError
from antiosc.io.deck import Array, Deck, IntArray, Numbering, Place
from antiosc_decks.abaqus_cards import Card, Row, account_for, cards as read_cards
from antiosc_decks.abaqus_mesh import NONE, Mesh, mesh_of
from antiosc_decks.constraints import lever
from antiosc_decks.sources import Account, Sources

#: Numbers in the whole deck from which elements are not cells.
OTHER = 2**40
WHAT = {"NSET": "node", "ELSET": "element"}


@dataclass
class Instance:
    """A placed part: the first rows of its nodes and elements in the whole deck."""

    name: str
    cards: list[Card]
    mesh: Mesh = field(default_factory=Mesh)
    first_node: int = 0
    first_element: int = 0
    first_other: int = 0
    #: x in the whole deck: turn @ x in the part + shift
    turn: Array = field(default_factory=lambda: np.eye(3))
    shift: Array = field(default_factory=lambda: np.zeros(3))

    @property
    def prefix(self) -> str:
        """What stands before its names in the whole deck."""
        return f"{self.name}." if self.name else ""

    def placed(self, keyword: str, rows: IntArray) -> IntArray:
        """Rows of its nodes (NSET) or elements (ELSET) in the whole deck."""
        if keyword == "NSET":
            return rows + self.first_node
        beyond = rows - self.mesh.cells
        return np.where(beyond < 0, rows + self.first_element, beyond + self.first_other + OTHER)

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
    #: what becomes of each card
    account: Account
    #: by name in upper case; "" is the deck itself, or its assembly
    instances: dict[str, Instance] = field(default_factory=dict)
    #: cards outside steps, and the instance whose names they use
    cards: list[tuple[Card, Instance]] = field(default_factory=list)
    #: cards of each step
    steps: list[list[Card]] = field(default_factory=list)
    #: elements that are not cells: (type, its number and nodes, of which instance)
    others: list[tuple[str, Row, Instance]] = field(default_factory=list)
    #: (NSET or ELSET, name in upper case) -> rows
    sets: dict[tuple[str, str], IntArray] = field(default_factory=dict)
    #: names in upper case -> as first written
    spelling: dict[str, str] = field(default_factory=dict)

    def named(self, *keywords: str) -> list[tuple[Card, Instance]]:
        """The cards of the model of these keywords."""
        return [(card, within) for card, within in self.cards if card.keyword in keywords]

    def spelled(self, name: str, within: Instance) -> str:
        """A set's name as first written; upper and lower case are not distinguished."""
        name = within.prefix + name
        return self.spelling.setdefault(name.upper(), name)

    def nodes(self, word: str, place: Place, within: Instance) -> IntArray:
        """Rows of the node or of the set of nodes that `word` names."""
        return self._rows("NSET", word, place, within)

    def node(self, word: str, place: Place, within: Instance) -> int:
        """The node that a number or a set of one node names."""
        nodes = self.nodes(word, place, within)
        place.needs(len(nodes) == 1, f"{word!r} must be one node; it is {len(nodes)}.")
        return int(nodes[0])

    def elements(self, word: str, place: Place, within: Instance) -> IntArray:
        """Numbers of the cells that the number or the name of a set of elements stands for."""
        rows = self._rows("ELSET", word, place, within)
        return rows[rows < OTHER]

    def beside(self, card: Card, within: Instance) -> Iterator[tuple[str, list[int]]]:
        """(type, rows of nodes) of the elements in the set of a card that are not cells."""
        rows = self._rows("ELSET", card.needed("ELSET"), card.place, within)
        for k in rows[rows >= OTHER] - OTHER:
            kind, row, own = self.others[k]
            yield kind, [self.node(word, row.place, own) for word in row.fields[1:]]

    def find(self, keyword: str, word: str, within: Instance) -> IntArray | None:
        """Rows of a number, or of the set with this name; None if there is none."""
        word = word.strip().strip('"')
        name, dot, inner = word.partition(".")
        if dot and name.upper() in self.instances:
            within, word = self.instances[name.upper()], inner
        try:
            label = np.array([int(word)])
        except ValueError:
            return self.sets.get((keyword, (within.prefix + word).upper()))
        found = self._numbered(keyword, within, lambda known: known.rows(label))
        return found if len(found) else None

    def _numbered(
        self, keyword: str, within: Instance, rows_of: Callable[[Numbering], IntArray]
    ) -> IntArray:
        """Rows of numbers; those of the assembly may be of its only instance."""
        only = list(self.instances.values())[1:2] * (not within.name and len(self.instances) == 2)
        for one in (within, *only):
            rows = rows_of(one.mesh.nodes if keyword == "NSET" else one.mesh.elements)
            if (rows >= 0).any():
                return one.placed(keyword, rows)
        return NONE

    def _rows(self, keyword: str, word: str, place: Place, within: Instance) -> IntArray:
        found = self.find(keyword, word, within)
        if found is None:
            raise self._missing(keyword, word, place, within)
        return found

    def _missing(self, keyword: str, word: str, place: Place, within: Instance) -> MeshError:
        what = WHAT[keyword]
        where = f" in {within.name}" if within.name else ""
        number = word.lstrip("-").isdigit()
        if number and len(self.instances) > 1 and not within.name:
            where = " outside the instances; name its instance (INSTANCE=)"
        return place.error(f"there is no {what if number else f'set of {what}s'} {word}{where}.")

    def add(self, instance: Instance) -> None:
        """Add an instance's nodes, elements and sets."""
        deck, mesh, name = self.deck, instance.mesh, instance.name
        self.instances[name.upper()] = instance
        nodes = instance.first_node = len(deck.points)
        start = instance.first_element = deck.n_elements
        instance.first_other = len(self.others)
        deck.points = np.vstack([deck.points, mesh.points @ instance.turn.T + instance.shift])
        for block in mesh.blocks:
            deck.blocks.append(block.mapped(lambda table: np.where(table >= 0, table + nodes, -1)))
        for kind, row in mesh.others:
            deck.leave(kind)
            self.others.append((kind, row, instance))
        deck.told += [sentence for sentence in mesh.told if sentence not in deck.told]
        for keyword, label, rows in mesh.sets:
            self._extend(keyword, label, instance, [instance.placed(keyword, rows)])
        if name:
            top = self.instances[""]
            self._extend("ELSET", name, top, [np.arange(start, deck.n_elements)])
        self.cards += [(card, instance) for card in instance.cards]

    def _extend(self, keyword: str, name: str, within: Instance, rows: list[IntArray]) -> None:
        key = keyword, self.spelled(name, within).upper()
        self.sets[key] = np.unique(np.concatenate([self.sets.get(key, NONE), *rows]))

    def read_set(self, card: Card, within: Instance) -> None:
        """A card *NSET or *ELSET; one of the assembly may have members in instances."""
        keyword, name, of = card.keyword, card.needed(card.keyword), within
        if wanted := card.option("INSTANCE"):
            card.needs(wanted.upper() in self.instances, f"there is no instance {wanted!r}.")
            of = self.instances[wanted.upper()]
        found, lost, count = [NONE], [], 0
        if keyword == "NSET" and (elements := card.option("ELSET")):
            cells = self.find("ELSET", elements, of)
            if cells is not None:
                found.append(self.deck.nodes_of(cells))
            else:
                self.deck.told.append(
                    f"{card.place}: *NSET {name} is of the set of elements {elements}, "
                    "which does not exist before it."
                )
        strict = len(self.instances) > 1 and not within.name
        every = self._all_numbers(card, of)
        found += [] if every is None else [every]
        for row in card.rows() if every is None else ():
            if "GENERATE" in card.options:
                found.append(self._numbered(keyword, of, _ranged(row)))
                row.needs(not (strict and not len(found[-1])), f"*{keyword} in the assembly "
                          "selects nothing; name the instance of its numbers "
                          "(INSTANCE=).")  # fmt: skip
                continue
            for word in filter(None, row.fields):
                count += 1
                rows = self.find(keyword, word, of)
                if rows is not None:
                    found.append(rows)
                elif strict:
                    raise self._missing(keyword, word, row.place, of)
                else:
                    lost.append(word)
        if lost:
            self.deck.told.append(
                f"{card.place}: {len(lost)} of {count} members of *{keyword} {name} do not exist "
                f"({', '.join(lost[:4])}{', …' * (len(lost) > 4)})."
            )
        self._extend(keyword, name, within, found)

    def _all_numbers(self, card: Card, of: Instance) -> IntArray | None:
        """Rows of the members of a set that are all numbers in `of`, at once: there may be many."""
        every = (word.strip() for line in card.lines for word in line.split(","))
        words = [word for word in every if word]
        if "GENERATE" in card.options or not all(w.isdecimal() and len(w) < 19 for w in words):
            return None
        known = of.mesh.nodes if card.keyword == "NSET" else of.mesh.elements
        rows = known.rows(np.array(words, dtype=np.int64))
        return of.placed(card.keyword, rows) if (rows >= 0).all() else None

    def finish(self) -> None:
        """Give the deck the sets, without elements that are not cells."""
        sets = {"NSET": self.deck.node_sets, "ELSET": self.deck.element_sets}
        for (keyword, name), rows in self.sets.items():
            cells = rows[rows < OTHER]
            if len(cells) or not len(rows):
                sets[keyword][self.spelling[name]] = cells


def _ranged(row: Row) -> Callable[[Numbering], IntArray]:
    """What selects the existing numbers in a range, which may be wide."""
    row.needs(len(row.fields) >= 2, "GENERATE needs a first and a last number.")
    first, last, step = row.whole(0), row.whole(1), row.whole(2, 1)
    if step == 0 and first == last:
        step = 1
    if step < 1 or last < first:
        raise row.place.error(f"GENERATE from {first} to {last} by {step} selects nothing.")
    return lambda known: known.between(first, last, step)


def read(sources: Sources) -> Whole:
    """The deck in some files."""
    cards, name = read_cards(sources), sources.name
    whole = Whole(Deck(name), account_for(cards, name))
    whole.deck.told += whole.account.unknown_cards()
    top, parts, placed = _divided(cards, whole.steps)
    whole.add(Instance("", top, mesh_of(top, name)))
    meshes: dict[str, Mesh] = {}
    used = {card.option("PART").upper() for card, _ in placed}
    for part, (spelled, _) in parts.items():
        if part not in used:
            whole.deck.told.append(f"the part {spelled!r} of {name} has no instance: left out.")
    for card, own in placed:
        whole.add(_placed(card, own, parts, meshes))
    instances = list(whole.instances.values())
    for instance in (*instances[1:], instances[0]):
        for card in instance.cards:
            if card.keyword in WHAT:
                whole.read_set(card, instance)
    whole.finish()
    if not len(whole.deck.points):
        raise MeshError(f"{name} defines no nodes (*NODE).")
    return whole


Parts = dict[str, tuple[str, list[Card]]]


def _divided(
    cards: list[Card], steps: list[list[Card]]
) -> tuple[list[Card], Parts, list[tuple[Card, list[Card]]]]:
    """(cards outside parts, those of parts, instances with their cards); adds those of `steps`."""
    top: list[Card] = []
    parts: Parts = {}
    placed: list[tuple[Card, list[Card]]] = []
    current, in_step = top, False
    names: set[tuple[str, str]] = set()
    for card in cards:
        if card.keyword in ("PART", "INSTANCE"):
            named = card.keyword, card.needed("NAME").upper()
            if named in names:
                raise card.place.error(f"*{card.keyword} {card.option('NAME')!r} is there twice.")
            names.add(named)
        match card.keyword:
            case "PART":
                current = []
                parts[card.needed("NAME").upper()] = card.needed("NAME"), current
            case "INSTANCE":
                current = []
                placed.append((card, current))
            case "ENDPART" | "ENDINSTANCE":
                current = top
            case "STEP":
                in_step = True
                steps.append([])
            case "ENDSTEP":
                in_step = False
            case _ if in_step and card.keyword not in WHAT:
                steps[-1].append(card)
            case _:
                current.append(card)
    return top, parts, placed


def _placed(card: Card, own: list[Card], parts: Parts, meshes: dict[str, Mesh]) -> Instance:
    name, wanted = card.needed("NAME"), card.option("PART")
    card.needs(wanted.upper() in parts, f"the instance {name!r} is of the part {wanted!r}, which "
               "the deck does not define.")  # fmt: skip
    spelled, cards = parts[wanted.upper()]
    cards = [*cards, *own]
    if any(c.keyword in ("NODE", "ELEMENT") for c in own):
        mesh = mesh_of(cards, name)
    else:
        if wanted.upper() not in meshes:
            meshes[wanted.upper()] = mesh_of(cards, spelled)
        mesh = meshes[wanted.upper()]
    turn, shift = np.eye(3), np.zeros(3)
    rows = card.rows()
    if rows:
        shift = np.array(rows[0].reals(3))
    if len(rows) > 1:
        if len(rows[1].fields) < 7:
            raise rows[1].place.error("the rotation of an instance is two points and an angle.")
        numbers = rows[1].reals(7)
        a, b = np.reshape(numbers[:6], (2, 3))
        turn = _rotation(b - a, numbers[6], rows[1].place)
        shift = a + turn @ (shift - a)
    return Instance(name, cards, mesh, turn=turn, shift=shift)


def _rotation(axis: Array, degrees: float, place: Place) -> Array:
    """Rodrigues' matrix of a rotation about an axis."""
    length = float(np.linalg.norm(axis))
    place.needs(length != 0, "the two points of a rotation coincide.")
    K = -lever(axis / length)
    angle = np.deg2rad(degrees)
    return np.asarray(np.eye(3) + np.sin(angle) * K + (1 - np.cos(angle)) * (K @ K))
