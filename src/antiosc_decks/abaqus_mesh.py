"""Nodes and elements of a part of an Abaqus deck."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Literal, NamedTuple

import numpy as np

from antiosc.base.errors import MeshError
from antiosc.io.conversion import Array, Block, IntArray
from antiosc.io.neutral import CORNERS, EDGES
from antiosc_decks.abaqus_cards import GENERATOR_CARDS, Card, Row
from antiosc_decks.entries import MAX_LABEL, DeckPlace, Numbering, whole_number
from antiosc_decks.properties import axes_of

ElementRole = Literal[
    "solid", "shell", "beam", "plane stress", "plane strain", "axisymmetric", "rod", "other"
]

#: Nodes of an element -> its shape.
SURFACE_SHAPES = {3: "triangle", 4: "quad", 6: "triangle", 8: "quad", 9: "quad"}
SOLID_SHAPES = {4: "tetra", 5: "pyramid", 6: "wedge", 8: "hexahedron", 10: "tetra", 13: "pyramid"}
SOLID_SHAPES |= {15: "wedge", 18: "wedge", 20: "hexahedron", 27: "hexahedron"}
LINE_SHAPES = {2: "line", 3: "line"}
#: Pattern of a type's name (its group is the number of nodes), role, shapes by number of nodes.
#: Elements of heat transfer (DC3D, DS) are taken as stress elements of the same nodes. "other" are
#: cells that no family here carries: rigid, fluids, surfaces. Membranes are shells, which bend.
ELEMENT_TYPES: tuple[tuple[str, ElementRole, Mapping[int, str]], ...] = (
    (r"D?C3D(\d+)[A-Z]*", "solid", SOLID_SHAPES),
    (r"(?:AC|F)3D(\d+)[A-Z]*", "other", SOLID_SHAPES),
    (r"SC(6|8)[A-Z]*", "other", SOLID_SHAPES),
    (r"(?:D?S|STRI)([34689]|65)(?:R5|R?S?W?T?)", "shell", SURFACE_SHAPES),
    (r"CPS([3468])[A-Z]*", "plane stress", SURFACE_SHAPES),
    (r"CPE([3468])[A-Z]*", "plane strain", SURFACE_SHAPES),
    (r"(?:CAX|CGAX|DCAX)([3468])[A-Z]*", "axisymmetric", SURFACE_SHAPES),
    (r"(?:CPEG|DC2D|AC2D|ACAX)([3468])[A-Z]*", "other", SURFACE_SHAPES),
    (r"M3D([34689])R?", "shell", SURFACE_SHAPES),
    (r"(?:R3D|SFM3D)([3468])[A-Z]*", "other", SURFACE_SHAPES),
    (r"(?:B|PIPE)[23]([123])[A-Z]*", "beam", LINE_SHAPES),
    (r"T[23]D(2)[A-Z]*", "rod", LINE_SHAPES),
    (r"T[23]D(3)[A-Z]*", "other", LINE_SHAPES),
)
#: Number in the name of a type -> number of its nodes, where the two differ; the same of beams.
NODE_COUNTS = {"65": 6}
BEAM_NODE_COUNTS = {"1": 2, "2": 3, "3": 2}
#: Inner nodes of C3D27, reordered: Abaqus gives the centre, then bottom, top and the four sides.
C3D27_INNER_NODES = (26, 24, 23, 25, 21, 22, 20)
#: Types that are not cells -> their number of nodes.
NON_CELLS = {
    r"MASS|ROTARYI|SPRING1|DASHPOT1|DCOUP3D|DCOUP2D|HEATCAP": 1,
    r"SPRINGA|SPRING2|DASHPOTA|DASHPOT2|GAPUNI|GAPCYL|GAPSPHER|CONN[23]D2": 2,
    r"D": 3,
}


class ElementType(NamedTuple):
    """Rules for reading one element type."""

    #: a key of `CORNERS`
    shape: str
    role: ElementRole
    node_count: int
    #: places of the corners and of the middles of the edges in the deck's order
    corners: tuple[int, ...]
    mids: tuple[int, ...]
    inner: tuple[int, ...] = ()


def element_type(name: str) -> ElementType | None:
    """Rules for reading elements of the type `name` (upper case); None if they are not cells."""
    for pattern, role, shapes in ELEMENT_TYPES:
        match = re.fullmatch(pattern, name)
        if match is None:
            continue
        nodes = (BEAM_NODE_COUNTS if role == "beam" else NODE_COUNTS).get(match[1], int(match[1]))
        if nodes not in shapes:
            return None
        shape = shapes[nodes]
        if shape == "line":
            ends = (0, 1) if nodes == 2 else (0, 2)
            return ElementType(shape, role, nodes, ends, (1,) * (nodes - 2))
        corners = CORNERS[shape]
        stop = corners + len(EDGES[shape]) * (nodes > corners)
        inner = tuple(range(stop, nodes)) if shape == "quad" else ()
        inner = C3D27_INNER_NODES if nodes == 27 else inner
        mids = tuple(range(corners, stop))
        return ElementType(shape, role, nodes, tuple(range(corners)), mids, inner)
    return None


NO_ROWS = np.zeros(0, dtype=np.int64)


@dataclass
class AbaqusMesh:
    """Nodes and elements of a part, numbered as in the part."""

    points: Array = field(default_factory=lambda: np.zeros((0, 3)))
    nodes: Numbering = field(default_factory=lambda: Numbering(NO_ROWS))
    blocks: list[Block] = field(default_factory=list)
    #: of the cells of the blocks, then of `others`
    elements: Numbering = field(default_factory=lambda: Numbering(NO_ROWS))
    cell_count: int = 0
    #: elements that are not cells: (type, its number and nodes as written)
    non_cells: list[tuple[str, Row]] = field(default_factory=list)
    #: sets of the options NSET= and ELSET=: (which, name, rows)
    sets: list[tuple[str, str, IntArray]] = field(default_factory=list)
    remarks: list[str] = field(default_factory=list)


def mesh_of(cards: list[Card], name: str) -> AbaqusMesh:
    """The mesh that some cards define; `name` is the part's, for messages."""
    for card in cards:
        written_out = card.keyword not in GENERATOR_CARDS
        card.needs(written_out, f"{card.label} is not read: write the nodes and elements out.")
    mesh = AbaqusMesh()
    _read_nodes(mesh, cards)
    _read_elements(mesh, cards, name)
    return mesh


def _read_nodes(mesh: AbaqusMesh, cards: list[Card]) -> None:
    """Fill `mesh` with the nodes of *NODE, in the coordinates of the *SYSTEM before them."""
    labels: list[int] = []
    points: list[list[float]] = []
    origin = np.zeros(3)
    axes = np.eye(3)
    for card in cards:
        start = len(labels)
        name = card.option("NSET")
        if card.keyword == "NODE" and "PRINT" not in card.options:
            rows = card.rows()
            labels += [whole_number(row.word(0), row.place) for row in rows]
            points += (origin + _rectangular_coordinates(card, rows) @ axes).tolist()
        elif card.keyword == "SYSTEM":
            origin, axes = _local_system(card)
        else:
            continue
        if name:
            mesh.sets.append(("NSET", name, np.array(labels[start:], dtype=np.int64)))

    numbers = np.array(labels, dtype=np.int64)
    # later definitions replace earlier ones
    last = np.sort(len(numbers) - 1 - np.unique(numbers[::-1], return_index=True)[1])
    coordinates = np.array(points, dtype=float).reshape(-1, 3)
    mesh.points = coordinates[last]
    mesh.nodes = Numbering(numbers[last])
    distances = np.abs(mesh.points[mesh.nodes.rows(numbers)] - coordinates).max(axis=1)
    redefined = distances > 1e-9 * np.abs(coordinates).max(initial=0.0)

    if redefined.any():
        told = f"the node {numbers[redefined][0]} is defined at several places"
        mesh.remarks.append(f"{told} ({int(redefined.sum())} such lines): the last one is taken.")
    mesh.sets = [(kind, name, mesh.nodes.rows(members)) for kind, name, members in mesh.sets]


def _rectangular_coordinates(card: Card, rows: Sequence[Row]) -> Array:
    """Rectangular coordinates (n, 3) of *NODE; cylindrical ones are (r, θ in degrees, z)."""
    system = card.option("SYSTEM", "R").upper()
    known = "give rectangular or cylindrical coordinates."
    card.needs(system in ("R", "C"), f"*NODE, SYSTEM={system}: {known}")
    x = np.array([[row.real(k) for k in (1, 2, 3)] for row in rows]).reshape(-1, 3)
    if system == "C":
        angle = np.radians(x[:, 1])
        x[:, :2] = x[:, :1] * np.stack([np.cos(angle), np.sin(angle)], axis=1)
    return x


def _local_system(card: Card) -> tuple[Array, Array]:
    """(origin, axes as rows) of *SYSTEM: the origin, a point on x, a point on the side of y.

    Without the third point, z is the part's z axis; without the second, all axes are the part's.
    """
    origin, x = np.reshape(card.first().reals(6), (2, 3))
    if len(card.first().fields) < 4:
        return origin, np.eye(3)
    rows = card.rows()[1:]
    second = rows[0].reals(3) - origin if rows else np.cross([0.0, 0.0, 1.0], x - origin)
    axes = axes_of(x - origin, second)
    card.needs(axes.any(axis=1).all(), "the points of *SYSTEM give no axes.")
    flat = rows or x[2] == origin[2]
    card.needs(flat, "*SYSTEM out of the plane x, y needs a third point.")
    return origin, axes


def _read_elements(mesh: AbaqusMesh, cards: list[Card], name: str) -> None:
    """Fill `mesh` with the elements of *ELEMENT."""
    cells: list[IntArray] = []
    other_numbers: list[int] = []
    sets: list[tuple[str, IntArray]] = []
    for card in cards:
        if card.keyword != "ELEMENT" or "OUTPUT" in card.options:
            continue
        kind = card.required_option("TYPE").upper().replace(" ", "")
        if element_type(kind) is None:
            numbers_read = np.array(_read_non_cells(mesh, card, kind), dtype=np.int64)
            other_numbers += numbers_read.tolist()
        else:
            numbers_read = _read_cells(mesh, card, kind)
            cells.append(numbers_read)

        if card.option("ELSET") and len(numbers_read):
            sets.append((card.option("ELSET"), numbers_read))

    mesh.cell_count = sum(map(len, cells))
    all_numbers = np.concatenate([NO_ROWS, *cells, np.array(other_numbers, dtype=np.int64)])
    numbers, count = np.unique(all_numbers, return_counts=True)
    if (count > 1).any():
        twice = f"{int((count > 1).sum())} elements twice, one of them {numbers[count > 1][0]}"
        raise MeshError(f"{name} defines {twice}; every element needs a number of its own.")
    mesh.elements = Numbering(all_numbers)
    mesh.sets += [("ELSET", label, mesh.elements.rows(members)) for label, members in sets]


def _read_non_cells(mesh: AbaqusMesh, card: Card, type_name: str) -> list[int]:
    """Read one card's elements that are not cells; return their numbers."""
    widths = [count for pattern, count in NON_CELLS.items() if re.fullmatch(pattern, type_name)]
    width = max(widths, default=0)
    rows = [row for row in card.rows() if row.word(0)]
    for row in rows:
        if len(row.fields) <= width:
            raise _too_few_nodes(row.place, row.word(0), type_name, len(row.fields) - 1, width)
        row.fields = row.fields[: 1 + width]
    mesh.non_cells += [(type_name, row) for row in rows]
    return [row.integer(0) for row in rows]


def _read_cells(mesh: AbaqusMesh, card: Card, type_name: str) -> IntArray:
    """Read one card's cells; return their numbers."""
    kind = element_type(type_name)
    assert kind is not None
    rows, places = _element_rows(mesh, card, kind.node_count, type_name)
    table = np.array(rows, dtype=np.int64).reshape(-1, 1 + kind.node_count)
    nodes = mesh.nodes.rows(table[:, 1:])
    bad = np.flatnonzero(((nodes < 0) & (table[:, 1:] != 0)).any(axis=1))
    if not len(bad):  # a middle node may be left out
        bad = np.flatnonzero((nodes[:, list(kind.corners)] < 0).any(axis=1))
    if len(bad):
        row = int(bad[0])
        missing_node = int(table[row, 1:][nodes[row] < 0][0])
        fault = f"element {table[row, 0]} ({type_name}) has the node {missing_node}, which"
        raise places[row].error(f"{fault} the deck does not define ({len(bad)} such elements).")
    if len(table):
        corners, mids, inner = (nodes[:, list(columns)] for columns in kind[3:])
        mesh.blocks.append(Block(kind.shape, type_name, corners, mids, inner, kind.role))
    return table[:, 0]


def _element_rows(
    mesh: AbaqusMesh, card: Card, count: int, type_name: str
) -> tuple[list[list[int]], list[DeckPlace]]:
    """(lists of [number, nodes …], their places) of a card's elements, of one or more lines each.

    `count`: nodes of an element; `type_name`: its type, for messages.
    """
    fewest = 1 + count
    rows: list[list[int]] = []
    places: list[DeckPlace] = []
    current: list[int] = []
    start = card.place
    longer = 0
    for line, place in zip(card.lines, card.places, strict=True):
        if not current:
            start = place
        words = line.split(",")
        try:
            numbers = [int(word) for word in words if word and not word.isspace()]
        except ValueError:
            numbers = [whole_number(word, place) for word in words if word.strip()]
        small = max(map(abs, numbers), default=0) <= MAX_LABEL
        place.require(small, "a number of a node or element is too large.")
        current += numbers
        if len(current) >= fewest:
            longer += len(current) > fewest
            rows.append(current[:fewest])
            places.append(start)
            current = []

    if current:
        raise _too_few_nodes(start, current[0], type_name, len(current) - 1, count)
    if longer:
        told = f"{card.place}: {longer} {type_name} elements list more than their {count} nodes"
        mesh.remarks.append(f"{told}; the first {count} are taken, as CalculiX does.")
    return rows, places


def _too_few_nodes(
    place: DeckPlace, element_label: object, type_name: str, node_count: int, needed_count: int
) -> MeshError:
    """The error of an element of `node_count` nodes, whose type needs `needed_count`."""
    counts = f"has {node_count} nodes; it must have {needed_count}"
    message = f"element {element_label} of type {type_name} {counts}"
    return place.error(f"{message}: the deck is cut off, or of another program.")
