"""Nastran bulk data into nodes, elements and groups by property, with its coordinate systems.

Coordinate systems are CORD1 and CORD2, rectangular, cylindrical and spherical.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field

import numpy as np

from antiosc.base.errors import MeshError
from antiosc.io.conversion import Array, Block, Deck, IntArray
from antiosc.io.neutral import CORNERS
from antiosc_decks import nastran_cards as cards, properties as geometry
from antiosc_decks.entries import DeckPlace, Numbering, whole_number
from antiosc_decks.nastran_cards import CELL_FORMATS, BulkData, Entry, thru_ranges
from antiosc_decks.sources import Account, Fate, Sources


@dataclass(frozen=True)
class CoordinateSystem:
    """A coordinate system: its origin, its axes as rows, and its kind."""

    origin: Array
    axes: Array
    #: "R", "C" (r, θ in degrees, z) or "S" (r, θ from z, φ in degrees)
    kind: str = "R"

    def point(self, c: Array) -> Array:
        """Position in the basic system of the point with coordinates `c`."""
        if self.kind != "R":
            radius, height = c[0], c[2]
            if self.kind == "S":
                theta = math.radians(c[1])
                radius, height = c[0] * math.sin(theta), c[0] * math.cos(theta)
            phi = math.radians(c[2 if self.kind == "S" else 1])
            c = np.array([radius * math.cos(phi), radius * math.sin(phi), height])
        return self.origin + c @ self.axes

    def frame(self, x: Array) -> Array:
        """Unit vectors of the system's directions at the point `x`, as rows (3, 3)."""
        if self.kind == "R":
            return self.axes
        a, b, c = self.axes @ (x - self.origin)
        phi = math.atan2(b, a)
        outward = np.array([math.cos(phi), math.sin(phi), 0.0])
        tangential = np.array([-outward[1], outward[0], 0.0])
        z = np.array([0.0, 0.0, 1.0])
        rows = [outward, tangential, z]
        if self.kind == "S":
            theta = math.atan2(math.hypot(a, b), c)
            sine, cosine = math.sin(theta), math.cos(theta)
            rows = [sine * outward + cosine * z, cosine * outward - sine * z, tangential]
        return np.stack(rows) @ self.axes


BASIC_SYSTEM = CoordinateSystem(np.zeros(3), np.eye(3))


def axes_of(points: list[Array], entry: Entry) -> Array:
    """Axes (3, 3), as rows, from the origin, a point on axis 1, a point on the side of axis 2."""
    x, arm = (point - points[0] for point in points[1:])
    sine = np.linalg.norm(np.cross(x, arm))
    independent = sine > 1e-12 * np.linalg.norm(x) * np.linalg.norm(arm)
    entry.needs(independent, f"the three points of {entry.name} lie on one line.")
    return geometry.axes_of(x, arm)


class CoordinateSystems:
    """The coordinate systems of a deck; each is computed on first use."""

    def __init__(self, entries: list[Entry], node: Callable[[int, DeckPlace], Array]) -> None:
        self._node = node
        self._placed: dict[int, CoordinateSystem] = {}
        self._open: set[int] = set()
        definitions = [entry for entry in entries if entry.name.startswith(("CORD1", "CORD2"))]
        self._given = defined_once(definitions, "coordinate system")

    def __call__(self, number: int, place: DeckPlace) -> CoordinateSystem:
        """The system `number`; MeshError if there is none, or it depends on itself."""
        if not number:
            return BASIC_SYSTEM
        if number not in self._placed:
            entry = place.look_up(self._given, number, f"there is no coordinate system {number}.")
            closed = number not in self._open and len(self._open) <= 200
            place.require(closed, f"the coordinate system {number} depends on itself.")
            self._open.add(number)
            self._placed[number] = self._compute_system(entry)
            self._open.discard(number)
        return self._placed[number]

    def _compute_system(self, entry: Entry) -> CoordinateSystem:
        """Compute the system of an entry."""
        if entry.name.startswith("CORD1"):
            points = [self._node(entry.integer(k), entry.place) for k in (1, 2, 3)]
        else:
            base = self(entry.integer(1, 0), entry.place)
            points = [base.point(np.array(entry.reals(k, k + 3))) for k in (2, 5, 8)]
        z, x, y = axes_of(points, entry)  # z to the second point, y across all
        return CoordinateSystem(points[0], np.stack([x, y, z]), entry.name[-1])


#: Selection of the case control -> entries with such sets; the name of their sum ends with ADD.
SET_ENTRIES = {"SPC": ("SPC", "SPC1"), "MPC": ("MPC",)}
#: Elements between scalar motions, by the first letters of their names.
SCALAR_ELEMENTS = ("CELAS", "CDAMP", "CMASS")


@dataclass
class NastranDeck:
    """A deck, and the entries of its elements and nodes."""

    deck: Deck
    bulk: BulkData
    nodes: Numbering
    systems: CoordinateSystems
    #: GRID entries in the order of rows; row -> number of scalar points, which follow them
    grids: list[Entry]
    scalar_points: dict[int, int]
    #: what becomes of each entry
    account: Account
    #: entry of each element that is a cell, in the order of the deck's elements
    elements: list[Entry] = field(default_factory=list)
    #: system of the displacements at each node: row -> number, where it is not the basic one
    systems_of: dict[int, int] = field(default_factory=dict)
    #: beams with end nodes of their own
    beams_with_own_ends: set[int] = field(default_factory=set)

    def entries_named(self, *names: str) -> list[Entry]:
        """All entries with one of these names."""
        return [entry for entry in self.bulk.entries if entry.name in names]

    def parameter(self, name: str) -> Entry | None:
        """The PARAM entry of this name; None if there is none."""
        return next((e for e in self.entries_named("PARAM") if e.text(0).upper() == name), None)

    def used_sets(self, set_kind: str) -> set[int]:
        """Numbers of the SPC or MPC sets that the first subcase selects, else of all sets."""
        name = self.deck.name
        tell = self.deck.remarks.append
        numbers = {entry.integer(0) for entry in self.entries_named(*SET_ENTRIES[set_kind])}
        if self.bulk.selected is None:
            if len(numbers) > 1:
                sets = f"its {set_kind} {_sets_text(numbers)}"
                tell(f"{name} has no case control: {sets} are all taken.")
            return numbers
        first = self.bulk.selected.get((set_kind, 1), self.bulk.selected.get((set_kind, 0)))
        sums = {entry.integer(0): entry for entry in self.entries_named(f"{set_kind}ADD")}

        selected = set() if first is None else {first}
        if first in sums:
            place = sums[first].place
            added = {whole_number(word, place) for word in sums[first].words(1)}
            selected = added | selected & numbers
        missing = selected - numbers
        unselected = (numbers | set(sums)) - selected - {first}

        if missing and missing == selected and set_kind == "SPC":
            raise MeshError(f"the case control of {name} selects SPC = {first}, not there.")
        if missing:
            tell(f"{set_kind} = {first} of {name} needs the {_sets_text(missing)}, not there.")
        if unselected:
            told = f"not used of {name}: {set_kind} {_sets_text(unselected)}"
            tell(f"{told}, which the first subcase does not select.")
        return selected & numbers

    def row(self, label: int, place: DeckPlace) -> int:
        """Row of the node numbered `label`."""
        row = int(self.nodes.rows(np.array([label]))[0])
        place.require(row >= 0, f"there is no GRID {label}.")
        return row

    def node_in(self, entry: Entry, k: int) -> int:
        """Row of the node in field `k` of an entry."""
        return self.row(entry.integer(k), entry.place)

    def properties(self, name: str) -> dict[int, Entry]:
        """Entries of properties by number."""
        return {entry.integer(0): entry for entry in self.entries_named(name) if entry.text(0)}

    def property_numbers(self) -> IntArray:
        """Number of the property of each element."""
        return np.array([entry.property_number() for entry in self.elements], dtype=np.int64)

    def set_groups(self) -> None:
        """Set element sets by property number (and name), and node sets by SPC."""
        numbers = self.property_numbers()
        for number in map(int, np.unique(numbers[numbers > 0])):
            for name in filter(None, (str(number), self.bulk.names.get(number))):
                self.deck.element_sets[name] = np.flatnonzero(numbers == number)
        for number in sorted({entry.integer(0) for entry in self.entries_named("SPC", "SPC1")}):
            if rows := [rows for rows, _, _ in self.spc_constraints(number)]:
                self.deck.node_sets[f"SPC {number}"] = np.unique(np.concatenate(rows))

    def spc_constraints(self, number: int) -> Iterator[tuple[IntArray, str, Entry]]:
        """Yields (rows of nodes, components such as "123", entry) of one SPC set."""
        for entry in self.entries_named("SPC", "SPC1"):
            if entry.integer(0) != number:
                continue
            for k in (1, 4) if entry.name == "SPC" else ():
                if entry.text(k):
                    yield np.array([self.node_in(entry, k)]), entry.text(k + 1), entry
            fields = entry.fields[2:] if entry.name == "SPC1" else []
            for first, last in thru_ranges(fields, entry.place):
                yield self.nodes.rows_between(first, last), entry.text(1), entry

    def scalar_ends(self, entry: Entry) -> list[tuple[int, int]]:
        """[(row, motion 0 to 5)] of the ends of CELAS, CDAMP or CMASS, without the ground."""
        has_components = entry.name[-1] in "12"
        ends = []
        for k in (2, 4) if has_components else (2, 3):
            if entry.integer(k, 0):
                row = self.node_in(entry, k)
                motion = entry.integer(k + 1, 0) - 1 if has_components else -1
                exists = motion in (-1, 0) if row in self.scalar_points else 0 <= motion < 6
                entry.needs(exists, f"{entry.name} acts on a component from 1 to 6, or an SPOINT.")
                ends.append((row, max(motion, 0)))
        entry.needs(ends, f"{entry.name} acts on no node.")
        return ends

    def frame(self, row: int, place: DeckPlace) -> Array:
        """Directions of the displacements at a node, as rows (3, 3)."""
        number = max(self.systems_of.get(row, 0), 0)
        place = self.grids[row].place if row < len(self.grids) else place
        return self.systems(number, place).frame(self.deck.points[row])

    def axes(self, entry: Entry, number: int) -> Array:
        """Axes of a rectangular system, as rows."""
        system = self.systems(number, entry.place)
        straight = system.kind == "R"
        entry.needs(straight, f"{entry.name}: give the coordinate system {number} as CORD2R.")
        return system.axes


def read_deck(sources: Sources) -> NastranDeck:
    """Read a deck from its files."""
    bulk = BulkData(sources)
    for entry in bulk.entries:
        if entry.fault and cards.fate_of(entry.name).kind == "read":
            raise entry.fault
    bulk.entries = cards.split_items(bulk.entries)
    cards.fill_defaults(bulk.entries)
    deck = _read_nodes(bulk, sources.name)
    deck.deck.remarks += bulk.remarks
    _convert_bars(deck)
    for solid in deck.entries_named("PSOLID"):
        solid.needs(solid.text(6) in ("", "SMECH"), "PSOLID of a fluid: leave its elements out.")
    _read_elements(deck)
    deck.set_groups()
    return deck


def _sets_text(numbers: set[int]) -> str:
    """Text that names sets by their numbers."""
    numbers_text = ", ".join(map(str, sorted(numbers)[:8])) + ", …" * (len(numbers) > 8)
    return f"set{'s' * (len(numbers) > 1)} {numbers_text}"


def _read_nodes(bulk: BulkData, name: str) -> NastranDeck:
    """The deck with its nodes."""
    entries = [entry for entry in bulk.entries if entry.name == "GRID"]
    if not entries:
        raise MeshError(f"{name} defines no nodes (GRID): give the deck that includes this file.")
    grids = list(defined_once(entries, "GRID").values())
    labels = np.array([grid.integer(0) for grid in grids], dtype=np.int64)
    scalar = _scalar_points(bulk)
    repeated = np.intersect1d(labels, scalar)
    if len(repeated):
        raise MeshError(f"{name} defines {repeated[0]} as a GRID and as an SPOINT.")
    nodes = Numbering(np.concatenate([labels, scalar]))
    positions: dict[int, Array] = {}

    def position(label: int, place: DeckPlace) -> Array:
        row = int(nodes.rows(np.array([label]))[0])
        place.require(0 <= row < len(grids), f"there is no GRID {label}.")
        if row not in positions:
            system = systems(grids[row].integer(1, 0), grids[row].place)
            positions[row] = system.point(np.array(grids[row].reals(2, 5)))
        return positions[row]

    systems = CoordinateSystems(bulk.entries, position)
    points = [position(grid.integer(0), grid.place) for grid in grids]
    deck = Deck(name, np.vstack([points, np.zeros((len(scalar), 3))]), labels=labels)
    rows = {len(grids) + k: int(label) for k, label in enumerate(scalar)}
    account = cards.account_for(bulk.entries, name)
    systems_of = {row: n for row, grid in enumerate(grids) if (n := grid.integer(5, 0))}
    return NastranDeck(deck, bulk, nodes, systems, grids, rows, account, systems_of=systems_of)


def defined_once(entries: list[Entry], noun: str) -> dict[int, Entry]:
    """Entries by number; MeshError if two entries of one number differ."""
    first: dict[int, Entry] = {}
    for entry in entries:
        earlier = first.setdefault(entry.integer(0), entry)
        fields = range(max(len(earlier.fields), len(entry.fields)))
        equal = all(earlier.text(k) == entry.text(k) for k in fields)
        message = f"the deck defines the {noun} {entry.integer(0)} more than once"
        alike = equal and earlier.name == entry.name
        entry.needs(alike, f"{message}, first otherwise in {earlier.place}.")
    return first


def _scalar_points(bulk: BulkData) -> IntArray:
    """Numbers of the scalar points: of SPOINT, and ends of scalar elements."""
    numbers: set[int] = set()
    for entry in bulk.entries:
        if entry.name[:-1] in SCALAR_ELEMENTS and entry.name[-1] in "34":
            numbers.update(entry.integer(k) for k in (2, 3) if entry.integer(k, 0))
        if entry.name == "SPOINT":
            for first, last in thru_ranges(entry.fields, entry.place):
                entry.needs(last - first <= 10_000_000, f"SPOINT from {first} to {last}.")
                numbers.update(range(first, last + 1))
    return np.array(sorted(numbers), dtype=np.int64)


def _convert_bars(deck: NastranDeck) -> None:
    """Turn CBAR whose PBAR has no second moments into CROD, and report it."""
    bars = deck.entries_named("PBAR")
    without_bending = [bar for bar in bars if not any(bar.text(k).strip("+-.0") for k in (3, 4))]
    rods = {entry.text(0): entry for entry in without_bending}
    for entry in deck.entries_named("CBAR"):
        if (entry.text(1) or entry.text(0)) in rods:
            entry.name = "CROD"
            entry.fields = entry.fields[:4]
    for entry in rods.values():
        area, torsion, extra = (entry.text(k) for k in (2, 5, 6))
        entry.name = "PROD"
        entry.fields = [*entry.fields[:2], area, torsion, "", extra]
        message = "PBAR without I1 and I2, read as rods: bending, pins and offsets"
        deck.account.options.append((message, entry.place, Fate("ignored")))


def _read_elements(deck: NastranDeck) -> None:
    """Add blocks by type and number of nodes; elements keep the order of the blocks."""
    groups: dict[tuple[str, bool], list[tuple[Entry, list[int]]]] = {}
    used_numbers: set[int] = set()
    for entry in deck.bulk.entries:
        cell = CELL_FORMATS.get(entry.name)
        if cell is None:
            if cards.is_non_cell(entry.name):
                deck.deck.skipped[entry.name] += 1
            continue
        corners = CORNERS[cell.shape]
        blank = None if cell.role in ("beam", "rod") else 0  # 0: left out
        places = range(cell.first, cell.first + corners + len(cell.middles))
        nodes = [entry.integer(k, blank) for k in places]
        label = entry.integer(0)
        entry.needs(label not in used_numbers, f"the element {label} is defined more than once.")
        used_numbers.add(label)
        groups.setdefault((entry.name, any(nodes[corners:])), []).append((entry, nodes))

    for (name, curved), members in groups.items():
        cell = CELL_FORMATS[name]
        corners = CORNERS[cell.shape]
        table = np.array([nodes for _, nodes in members], dtype=np.int64)
        rows = np.where(table > 0, deck.nodes.rows(table), -1)
        is_missing = (rows < 0) & ((table != 0) | (np.arange(table.shape[1]) < corners))
        for row, k in np.argwhere(is_missing):
            message = f"{name} {members[row][0].integer(0)} has the node {table[row, k]}"
            raise members[row][0].place.error(f"{message}, for which there is no GRID.")
        mids = rows[:, corners:][:, list(cell.middles) if curved else []]
        tables = rows[:, :corners], mids, mids[:, :0]
        deck.deck.blocks.append(Block(cell.shape, name, *tables, cell.role))
        deck.elements += [entry for entry, _ in members]
