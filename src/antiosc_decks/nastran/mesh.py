"""Nastran bulk data into nodes, elements and groups by property."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from antiosc.base.errors import MeshError
from antiosc.io.deck import Array, Block, Deck, IntArray, Numbering, Place
from antiosc.io.shapes import CORNERS
from antiosc_decks.account import Account
from antiosc_decks.nastran import parts
from antiosc_decks.nastran.cards import Bulk, Entry, bulk_data, through
from antiosc_decks.nastran.coordinates import Systems
from antiosc_decks.nastran.table import (
    CELLS,
    NEAREST,
    OLDER,
    OLDER_PROPERTIES,
    account_for,
    fate_of,
    is_other,
)
from antiosc_decks.sources import Sources

#: What the case control selects -> the entries of these sets, and the one that adds them.
SETS = {
    "SPC": (("SPC", "SPC1"), "SPCADD"),
    "MPC": (("MPC",), "MPCADD"),
    "NSM": (("NSM", "NSM1", "NSML", "NSML1"), "NSMADD"),
}
#: Elements between scalar motions, by the first letters of their names.
SCALARS = ("CELAS", "CDAMP", "CMASS")


@dataclass
class NastranDeck:
    """A deck, and the entries of its elements and nodes."""

    deck: Deck
    bulk: Bulk
    nodes: Numbering
    systems: Systems
    #: entry of each element that is a cell, in the order of the deck's elements
    elements: list[Entry] = field(default_factory=list)
    #: system of the displacements at each node: row -> number, where it is not the basic one
    systems_of: dict[int, int] = field(default_factory=dict)
    #: what is special about elements that are beams, by their number
    beams: dict[int, Any] = field(default_factory=dict)
    #: entries GRID in the order of the rows, and the rows of scalar points, which follow them
    grids: list[Entry] = field(default_factory=list)
    scalar: dict[int, int] = field(default_factory=dict)
    #: entries that are read as others, in the deck's terms
    converted: list[str] = field(default_factory=list)
    #: what becomes of each entry
    account: Account = field(default_factory=lambda: Account(""))

    def named(self, *names: str) -> list[Entry]:
        """All entries of these names."""
        return [entry for entry in self.bulk.entries if entry.name in names]

    def used_sets(self, what: str) -> set[int]:
        """Numbers of the sets of SPC, MPC or NSM that the first subcase selects.

        Without case control all of them are used. The choice is told; MeshError if there are no
        supports of the number that is selected.
        """
        names, adding = SETS[what]
        name, control = self.deck.name, self.bulk.control
        present = {entry.whole(0) for entry in self.named(*names)}
        if not control.given:
            if len(present) > 1:
                some = f"{name} has no case control: its {what} {_sets(present)} are all taken."
                self.deck.told.append(some)
            return present
        first = control.of_first(what)
        used = set() if first is None else {first}
        for entry in self.named(adding):
            if entry.whole(0) == first:
                parts = {entry.whole(k) for k in range(1, len(entry.fields)) if entry.text(k)}
                used = parts | used & present
        lost, others = used - present, present - used
        if lost == used and what == "SPC" and used:
            raise MeshError(
                f"the case control of {name} selects SPC = {first}, which is not there."
            )
        if lost:
            self.deck.told.append(f"{what} = {first} of {name} needs the {_sets(lost)}, not there.")
        if others:
            self.deck.told.append(
                f"not used of {name}: {what} {_sets(others)}, which the first subcase does not "
                "select."
            )
        return used & present

    def row(self, label: int, place: Place) -> int:
        """Row of the node `label`."""
        row = int(self.nodes.rows(np.array([label + place.scope]))[0])
        if row < 0:
            raise place.error(f"there is no GRID {label}.")
        return row

    def properties(self, name: str, width: int = 8) -> dict[int, tuple[Entry, int]]:
        """Number of a property -> (its entry, its first field); `width` fields make one of them."""
        return {
            entry.number(k): (entry, k)
            for entry in self.named(name)
            for k in range(0, min(len(entry.fields), 8), width)
            if entry.text(k)
        }

    def scalar_ends(self, entry: Entry) -> list[tuple[int, int]]:
        """(row, motion 0 to 5) of the ends of CELAS, CDAMP and CMASS; the ground is left out."""
        pairs = [(2, 3), (4, 5)] if entry.name[-1] in "12" else [(2, None), (3, None)]
        found = []
        for k, component in pairs:
            if not entry.whole(k, 0):
                continue
            row = self.row(entry.whole(k), entry.place)
            motion = entry.whole(component, 0) - 1 if component is not None else -1
            if row in self.scalar and motion in (-1, 0):
                motion = 0
            elif not 0 <= motion < 6 or row in self.scalar:
                raise entry.place.error(
                    f"{entry.name} acts on a component from 1 to 6 of a GRID, or on a scalar point."
                )
            found.append((row, motion))
        return found

    def frame(self, row: int, place: Place) -> Array:
        """Directions of the displacements at a node, as rows."""
        number = max(self.systems_of.get(row, 0), 0)
        place = self.grids[row].place if row < len(self.grids) else place
        return self.systems(number, place).frame(self.deck.points[row])

    def axes(self, entry: Entry, number: int) -> Array:
        """The axes of a rectangular system as rows."""
        system = self.systems(number, entry.place)
        if system.kind != "R":
            raise entry.place.error(
                f"{entry.name} is read in rectangular systems; give the coordinate system "
                f"{number} as CORD2R."
            )
        return system.axes


def read(
    path: Path,
    name: str,
    on_size: Callable[[int], None] = lambda size: None,
    root: str | None = None,
) -> NastranDeck:
    """The deck in a file; `on_size` is called with the number of bytes read.

    `root`: the folder of the files that it may include; None: its own, or the one above.
    """
    bulk = bulk_data(Sources(path, name, on_size, root))
    for entry in bulk.entries:
        if entry.fault and fate_of(entry.name).kind == "read":
            raise entry.fault
    _refuse_images(bulk)
    parts.scope(bulk.entries)
    found = _nodes(bulk, name)
    found.account = account_for(bulk.entries, name)
    found.deck.told += [*bulk.told, *found.account.unknown_cards()]
    for name, sentence in NEAREST.items():
        if count := len(found.named(name)):
            found.converted.append(sentence.format(count, name))
    _older(found)
    _defaults(found)
    _rods_of_bars(found)
    _elements(found)
    set_groups(found)
    return found


def _refuse_images(bulk: Bulk) -> None:
    """MeshError where superelements do not divide the deck, but repeat or mirror parts of it."""
    for entry in bulk.entries:
        if entry.name == "SEBULK" and entry.text(1).upper() not in ("", "PRIMARY"):
            raise entry.place.error(
                f"a superelement of the type {entry.text(1)} is not read; write its elements out."
            )


def _sets(numbers: set[int]) -> str:
    shown = ", ".join(map(str, sorted(numbers)[:8])) + ", …" * (len(numbers) > 8)
    return f"set{'s' * (len(numbers) > 1)} {shown}"


# --- Nodes ----------------------------------------------------------------------------------------


def _nodes(bulk: Bulk, name: str) -> NastranDeck:
    grids = [entry for entry in bulk.entries if entry.name == "GRID"]
    if not grids:
        raise MeshError(f"{name} defines no nodes (GRID).")
    default = grid_defaults(bulk.entries)
    grids = list(defined_once(grids, "GRID").values())
    labels = np.array([grid.number(0) for grid in grids], dtype=np.int64)
    scalar = _scalar_points(bulk)
    both = np.intersect1d(labels, scalar)
    if len(both):
        raise MeshError(f"{name} defines {both[0]} as a GRID and as an SPOINT.")
    nodes = Numbering(np.concatenate([labels, scalar]))
    placed: dict[int, Array] = {}

    def position(label: int, place: Place) -> Array:
        row = int(nodes.rows(np.array([label + place.scope]))[0])
        if not 0 <= row < len(grids):
            raise place.error(f"there is no GRID {label}.")
        if row not in placed:
            grid = grids[row]
            number = _given(grid, 1, default)
            c = np.array([grid.real(k) for k in (2, 3, 4)])
            placed[row] = systems(number, grid.place).point(c)
        return placed[row]

    systems = Systems(bulk.entries, position)
    moved = parts.moved(bulk.entries, position, systems)
    systems.move(moved)
    placed.clear()
    points = np.array([position(grid.whole(0), grid.place) for grid in grids])
    points = np.vstack([points, np.zeros((len(scalar), 3))])
    found = NastranDeck(Deck(name, points), bulk, nodes, systems, grids=grids)
    found.scalar = {len(grids) + k: int(label) for k, label in enumerate(scalar)}
    for row, grid in enumerate(grids):
        number = _given(grid, 5, default)
        if number or grid.place.scope in moved:
            found.systems_of[row] = number
    return found


def defined_once(entries: list[Entry], what: str) -> dict[int, Entry]:
    """Number -> its entry; MeshError for two that differ."""
    first: dict[int, Entry] = {}
    for entry in entries:
        known = first.setdefault(entry.number(0), entry)
        count = max(len(known.fields), len(entry.fields))
        if known.name != entry.name or any(known.text(k) != entry.text(k) for k in range(count)):
            raise entry.place.error(
                f"the deck defines the {what} {entry.whole(0)} more than once, "
                f"first otherwise in {known.place}."
            )
    return first


def _scalar_points(bulk: Bulk) -> IntArray:
    """Numbers of the scalar points: of SPOINT, and the ends of elements between such points."""
    numbers: set[int] = set()
    for entry in bulk.entries:
        if entry.name[:-1] in SCALARS and entry.name[-1] in "34":
            numbers.update(entry.number(k) for k in (2, 3) if entry.whole(k, 0))
        if entry.name == "SPOINT":
            for first, last in through(entry.fields, entry.place):
                if last - first > 10_000_000:
                    raise entry.place.error(f"SPOINT from {first} to {last}.")
                numbers.update(range(first + entry.place.scope, last + entry.place.scope + 1))
    return np.array(sorted(numbers), dtype=np.int64)


def grid_defaults(entries: list[Entry]) -> dict[int, Entry]:
    """GRDSET of each part of the deck, by its scope."""
    return {entry.place.scope: entry for entry in entries if entry.name == "GRDSET"}


def _given(grid: Entry, k: int, defaults: dict[int, Entry]) -> int:
    """The number of a coordinate system in field k, by default that of GRDSET."""
    given = grid if grid.text(k) else defaults.get(grid.place.scope, grid)
    return given.whole(k, 0)


# --- Elements -------------------------------------------------------------------------------------


def _defaults(found: NastranDeck) -> None:
    """Blank fields of CBAR and CBEAM are those of BAROR and BEAMOR."""
    for name, given in (("CBAR", "BAROR"), ("CBEAM", "BEAMOR")):
        default = next(iter(found.named(given)), None)
        if default is None:
            continue
        for entry in found.named(name):
            entry.fields += [""] * (8 - len(entry.fields))
            if not entry.text(1):
                entry.fields[1] = default.text(1)
            if not any(entry.text(k) for k in (4, 5, 6)):
                entry.fields[4:7] = [default.text(k) for k in (4, 5, 6)]
            entry.fields[7] = entry.text(7) or default.text(7)


def _older(found: NastranDeck) -> None:
    """Elements and properties of older versions as those that they are now."""
    made: dict[str, Entry] = {}
    more: list[Entry] = []
    for entry in found.bulk.entries:
        if entry.name in OLDER:
            entry.name, kind = OLDER[entry.name]
            if not kind:
                given = [entry.text(1), entry.text(1)]
                made.setdefault(entry.text(1), Entry("PSOLID", entry.place, given))
        elif entry.name in OLDER_PROPERTIES:
            order = OLDER_PROPERTIES[entry.name]
            first, second = (
                ["" if k is None else entry.text(start + k) for k in order] for start in (0, 4)
            )
            entry.name = "PSOLID" if entry.name == "PIHEX" else "PSHELL"
            if entry.name == "PSHELL" and second[0]:  # two of them in one entry
                more.append(Entry(entry.name, entry.place, second))
            entry.fields = first
        elif entry.name == "CRIGD1":
            entry.name = "RBE2"
            entry.fields[2:2] = ["123456"]
        elif entry.name == "CRIGD2":  # pairs of a node and its components
            words = [entry.text(k) for k in range(len(entry.fields)) if entry.text(k)]
            pairs = [[*words[:2], c, node] for node, c in zip(words[2::2], words[3::2])]  # noqa: B905
            more += [Entry("RBE2", entry.place, fields) for fields in pairs]
        elif entry.name in ("PQUAD1", "PTRIA1"):
            entry.name, entry.fields = "PSHELL", _plate(entry)
    known = {entry.text(0) for entry in found.named("PSOLID")}
    found.bulk.entries += [entry for number, entry in made.items() if number not in known] + more


def _plate(entry: Entry) -> list[str]:
    """Fields of the PSHELL that a PQUAD1 or PTRIA1 is: I for 12I/T³, T3 for TS/T."""
    second = entry.real(4)
    t = entry.real(2) or (12 * max(second, 0.0)) ** (1 / 3)
    if not t:
        raise entry.place.error(f"{entry.name} needs a thickness, or I, above 0.")
    shear = repr(entry.real(6) / t) if entry.real(6) else ""
    ratio = repr(12 * second / t**3) if second else ""
    words = [entry.text(k) for k in (0, 1, 3, 5, 7)]
    return [words[0], words[1], repr(t), words[2], ratio, words[3], shear, words[4]]


def _rods_of_bars(found: NastranDeck) -> None:
    """CBAR of a PBAR without second moments are CROD; the model tells it."""
    bare = {
        entry.text(0): entry
        for entry in found.named("PBAR")
        if not any(entry.text(k).strip("+-.0") for k in (3, 4))
    }
    for entry in found.named("CBAR"):
        if (entry.text(1) or entry.text(0)) in bare:
            entry.name, entry.fields = "CROD", entry.fields[:4]
    for number, entry in bare.items():
        area, torsion, extra = (entry.text(k) for k in (2, 5, 6))
        entry.name, entry.fields = "PROD", [*entry.fields[:2], area, torsion, "", extra]
        found.converted.append(f"bending, pins and offsets of PBAR {number} (no I1, I2): rods")


def _elements(found: NastranDeck) -> None:
    """Blocks by type and number of nodes; elements keep the order of their blocks."""
    sorted_out: dict[tuple[str, bool], list[tuple[Entry, list[int]]]] = {}
    seen: set[int] = set()
    for entry in found.bulk.entries:
        cell = CELLS.get(entry.name)
        if entry.name == "BEGIN SUPER":  # which numbers its elements anew
            seen = set()
        if cell is None:
            if is_other(entry.name):
                found.deck.leave(entry.name, 1)
            continue
        corners = CORNERS[cell.shape]
        every = range(cell.first, cell.first + corners + len(cell.middles))
        if cell.role in ("beam", "rod"):
            nodes = [entry.whole(k) for k in every]
        else:  # 0: left out
            nodes = [entry.whole(k, 0) for k in every]
        nodes = [n and n + entry.place.scope for n in nodes]
        label = entry.whole(0)
        if label in seen:
            raise entry.place.error(f"the element {label} is defined more than once.")
        seen.add(label)
        sorted_out.setdefault((entry.name, any(nodes[corners:])), []).append((entry, nodes))
    for (name, curved), some in sorted_out.items():
        cell = CELLS[name]
        corners = CORNERS[cell.shape]
        table = np.array([nodes for _, nodes in some], dtype=np.int64)
        rows = np.where(table > 0, found.nodes.rows(table), -1)
        lost = (rows < 0) & ((table != 0) | (np.arange(table.shape[1]) < corners))
        if lost.any():
            row, k = np.argwhere(lost)[0]
            entry = some[row][0]
            node = table[row, k] % parts.SCOPE
            raise entry.place.error(
                f"{name} {entry.whole(0)} has the node {node}, for which there is no GRID."
            )
        mids = rows[:, corners:][:, list(cell.middles) if curved else []]
        found.deck.blocks.append(Block(cell.shape, name, rows[:, :corners], mids, mids[:, :0]))
        found.elements += [entry for entry, _ in some]


def property_of(entry: Entry) -> int:
    """Number of an element's property; by default that of the element."""
    if entry.name == "CONROD":
        return 0
    return entry.whole(1, entry.whole(0)) + entry.place.scope


def its_property(entry: Entry, name: str, known: dict[int, tuple[Entry, int]]) -> tuple[Entry, int]:
    """(entry, first field) of an element's property among `NastranDeck.properties`."""
    number = property_of(entry)
    if number not in known:
        raise entry.place.error(f"{entry.name} has no {name} {number}.")
    return known[number]


# --- Groups ---------------------------------------------------------------------------------------


def set_groups(found: NastranDeck) -> None:
    """Elements by property (its number, and its name if a comment gives one), nodes by SPC."""
    numbers = np.array([property_of(entry) for entry in found.elements], dtype=np.int64)
    for number in np.unique(numbers[numbers > 0]):
        elements = np.flatnonzero(numbers == number)
        found.deck.element_sets[parts.label(int(number))] = elements
        if found.bulk.names.get(int(number)):
            found.deck.element_sets[found.bulk.names[int(number)]] = elements
    for number in sorted({entry.whole(0) for entry in found.named("SPC", "SPC1")}):
        rows = [rows for rows, _, _ in constraints(found, number)]
        if rows:
            found.deck.node_sets[f"SPC {number}"] = np.unique(np.concatenate(rows))


def constraints(found: NastranDeck, number: int) -> list[tuple[IntArray, str, Entry]]:
    """(rows of nodes, components such as "123", entry) of one set of single-point constraints."""
    result = []
    for entry in found.named("SPC", "SPC1"):
        if entry.whole(0) != number:
            continue
        if entry.name == "SPC":
            for start in (1, 4):
                if entry.text(start):
                    row = found.row(entry.whole(start), entry.place)
                    result.append((np.array([row]), entry.text(start + 1), entry))
            continue
        for first, last in through(entry.fields[2:], entry.place):
            own = found.nodes.between(first + entry.place.scope, last + entry.place.scope)
            result.append((own, entry.text(1), entry))
    return result
