"""Archives of Ansys Mechanical APDL (`.cdb`): nodes, elements, components, materials, thickness.

Blocks NBLOCK, EBLOCK (SOLID) and CMBLOCK have a line with the widths of their columns; materials
are in MP and MPDATA, thickness in SECDATA, SECBLOCK, R and RLBLOCK, supports in D. Solids and
shells make a model, of isotropic materials at the first temperature; other elements are left out
of a mesh and refused in a model.
"""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from antiosc.base.errors import MeshError
from antiosc.io.conversion import as_mesh
from antiosc.io.deck import Block, Deck, DeckPlace, Numbering, real_number, whole_number
from antiosc.io.neutral import CORNERS, EDGES, FileMesh, UnitSystem
from antiosc.io.request import FileReader, Request
from antiosc_decks.builder import MOTIONS, POISSON, GroupSection, ModelBuilder, Unstated
from antiosc_decks.finished import finished
from antiosc_decks.properties import Material

SOLIDS = {45, 95, 92, 185, 186, 187, 285, 64, 72, 73}
SHELLS = {63, 93, 181, 281, 43}
#: Plane elements: cells of a mesh; a model of them is refused.
PLANES = {42, 82, 182, 183}
ROLES = {
    **dict.fromkeys(SOLIDS, "solid"),
    **dict.fromkeys(SHELLS, "shell"),
    **dict.fromkeys(PLANES, "plane"),
}
#: Surface-effect elements, without mass and stiffness.
BESIDE = {151, 152, 153, 154, 156, 200}
#: (role, nodes) -> shape
SHAPES = {
    **{("solid", n): "tetra" for n in (4, 10)},
    **{("solid", n): "hexahedron" for n in (8, 20)},
    **{(role, n): "quad" for n in (4, 8) for role in ("shell", "plane")},
    **{(role, n): "triangle" for n in (3, 6) for role in ("shell", "plane")},
}
#: Number of columns before an element's nodes; number of nodes in its first line.
HEAD = 11
FIRST = 8
MOTION_LABELS = dict(zip(("UX", "UY", "UZ", "ROTX", "ROTY", "ROTZ"), range(6), strict=True))
Line = tuple[str, DeckPlace]


@dataclass
class Archive:
    """The contents of an archive."""

    name: str
    labels: list[int] = field(default_factory=list)
    points: list[list[float]] = field(default_factory=list)
    #: number of a type -> element of Ansys
    types: dict[int, int] = field(default_factory=dict)
    #: (material, type, real, section, number, nodes), place
    elements: list[tuple[tuple[int, int, int, int, int, list[int]], DeckPlace]] = field(
        default_factory=list
    )
    #: name -> (whether of nodes, numbers)
    components: dict[str, tuple[bool, list[int]]] = field(default_factory=dict)
    materials: dict[int, dict[str, float]] = field(default_factory=dict)
    #: thickness by ("section" or "real", number)
    thickness: dict[tuple[str, int], float] = field(default_factory=dict)
    #: (node, label)
    supports: list[tuple[int, str]] = field(default_factory=list)
    section: int = 0


def read(ask: Request) -> FileMesh:
    """The mesh of an archive, with its model if one is asked for."""
    path = Path(ask.path)
    ask.allow(30 + 3e-5 * path.stat().st_size)
    lines = path.read_text(encoding="latin-1").splitlines()
    archive = Archive(ask.name)
    rows = iter((line, DeckPlace(ask.name, k + 1)) for k, line in enumerate(lines))
    for text, place in rows:
        _take(archive, [word.strip() for word in text.split("!")[0].split(",")], place, rows)
    deck, owners = _deck(archive, ask.elements)
    if ask.model is not None:
        deck.wanted = ask.model.get("parts")
        deck.piece = ask.model.get("piece")
        deck.free = ask.model.get("free", False)
        builder = ModelBuilder(deck, UnitSystem(*ask.unit), Unstated(*ask.model["unstated"]))
        _model(archive, deck, owners, builder)
        deck.model = finished(builder)
    return as_mesh(deck)


def _take(archive: Archive, words: list[str], place: DeckPlace, rows: Iterator[Line]) -> None:
    """Read one command, with the lines of its block."""
    name = words[0].upper()
    if name == "NBLOCK":
        _nodes(archive, rows)
    elif name == "EBLOCK":
        solid = len(words) > 2 and words[2].upper() == "SOLID"
        place.needs(solid, "EBLOCK needs the key SOLID: write the archive by CDWRITE.")
        _elements(archive, rows)
    elif name == "CMBLOCK" and len(words) > 3:
        numbers = _component(int(whole_number(words[3], place)), rows)
        archive.components[words[1]] = (words[2].upper().startswith("NODE"), numbers)
    elif name == "ET" and len(words) > 2:
        number = re.sub(r"\D", "", words[2])
        place.needs(number, f"the element type {words[2]!r} has no number.")
        archive.types[whole_number(words[1], place)] = int(number)
    elif name == "MP" and len(words) > 3:
        _property(archive, words[1], words[2], words[3], place)
    elif name == "MPDATA" and len(words) > 6:
        first = 3 if words[1].upper().startswith("R") else 1
        if words[first + 2] == "1":  # the first temperature
            _property(archive, words[first], words[first + 1], words[first + 3], place)
    elif name == "SECTYPE" and len(words) > 1:
        archive.section = whole_number(words[1], place)
    elif name == "SECDATA" and words[1:2] and words[1]:
        archive.thickness["section", archive.section] = real_number(words[1], place)
    elif name == "SECBLOCK" and len(words) > 1:
        layers = [next(rows) for _ in range(whole_number(words[1], place))]
        total = sum(real_number(text.split(",")[0], row_place) for text, row_place in layers)
        archive.thickness["section", archive.section] = total
    elif name == "R" and len(words) > 2 and words[2]:
        archive.thickness["real", whole_number(words[1], place)] = real_number(words[2], place)
    elif name == "RLBLOCK":
        _reals(archive, whole_number(words[1], place), rows)
    elif name == "D" and len(words) > 2:
        archive.supports.append((whole_number(words[1], place), words[2].upper()))


def _property(archive: Archive, label: str, number: str, value: str, place: DeckPlace) -> None:
    """Set one constant of a material."""
    constants = archive.materials.setdefault(whole_number(number, place), {})
    constants[label.upper()] = real_number(value, place)


def _widths(rows: Iterator[Line]) -> tuple[int, int, int]:
    """(start of the reals, width of an integer, width of a real) in a format as (3i9,6e21.13e3)."""
    text, place = next(rows)
    integers = [(int(n), int(width)) for n, width in re.findall(r"(\d+)i(\d+)", text.lower())]
    place.needs(
        integers, f"the format of a block is as (3i9,6e21.13e3); got {text.strip()[:40]!r}."
    )
    real_width = re.search(r"e(\d+)\.", text.lower())
    return (
        sum(n * width for n, width in integers),
        integers[0][1],
        int(real_width[1]) if real_width else 1,
    )


def _cut(text: str, width: int, start: int = 0) -> list[str]:
    """The non-blank columns of a line."""
    columns = [text[k : k + width] for k in range(start, len(text.rstrip()), width)]
    return [column for column in columns if column.strip()]


def _nodes(archive: Archive, rows: Iterator[Line]) -> None:
    """Read the lines of NBLOCK."""
    start, width, real_width = _widths(rows)
    for text, place in rows:
        if text.startswith(("N,", "-1")) or not text[:width].strip():
            return
        archive.labels.append(whole_number(text[:width], place))
        x = [real_number(column, place) for column in _cut(text, real_width, start)[:3]]
        archive.points.append([*x, 0.0, 0.0, 0.0][:3])


def _elements(archive: Archive, rows: Iterator[Line]) -> None:
    """Read the lines of EBLOCK."""
    _, width, _ = _widths(rows)
    for text, place in rows:
        numbers = [whole_number(column, place) for column in _cut(text, width)]
        if not numbers or numbers[0] == -1:
            return
        place.needs(len(numbers) > HEAD, f"an element has {HEAD} numbers and its nodes.")
        count = numbers[8]
        nodes = numbers[HEAD:]
        while len(nodes) < count:
            nodes += [whole_number(column, place) for column in _cut(next(rows)[0], width)]
        element = (numbers[0], numbers[1], numbers[2], numbers[3], numbers[10], nodes[:count])
        archive.elements.append((element, place))


def _component(count: int, rows: Iterator[Line]) -> list[int]:
    """Numbers of a component (CMBLOCK); a negative one ends a range."""
    _, width, _ = _widths(rows)
    entries: list[int] = []
    while len(entries) < count:
        text, place = next(rows)
        entries += [whole_number(number, place) for number in _cut(text, width)]
    numbers: list[int] = []
    for number in entries:
        numbers += range(numbers[-1] + 1, -number + 1) if number < 0 and numbers else [number]
    return numbers


def _reals(archive: Archive, sets: int, rows: Iterator[Line]) -> None:
    """Read the thickness from the first constant of each set of RLBLOCK."""
    next(rows), next(rows)  # the formats (2i8,6g16.9) and (7g16.9)
    for _ in range(sets):
        text, place = next(rows)
        number = whole_number(text[:8], place)
        count = whole_number(text[8:16], place)
        archive.thickness["real", number] = real_number(text[16:32], place)
        for _ in range(-(-max(count - 6, 0) // 7)):
            next(rows)


def _deck(
    archive: Archive, groups: Mapping[str, Sequence[int]]
) -> tuple[Deck, list[tuple[int, int, int, DeckPlace]]]:
    """(deck, owner of each element: its material, real constants, section and place).
    `groups` names elements by their numbers.
    """
    if not archive.points:
        raise MeshError(f"{archive.name} has no nodes (NBLOCK).")
    node_numbers = np.array(archive.labels, dtype=np.int64)
    nodes = Numbering(node_numbers)
    deck = Deck(archive.name, np.array(archive.points), labels=node_numbers)
    tables: dict[tuple[str, str, str], list[list[int]]] = {}
    owners: dict[tuple[str, str, str], list[tuple[int, tuple[int, int, int, DeckPlace]]]] = {}
    for (material, kind, real, section, number, labels), place in archive.elements:
        element = archive.types.get(kind, 0)
        role = ROLES.get(element, "")
        shape = SHAPES.get((role, len(labels)), "")
        if not shape:
            deck.left[str(element)] += 1
            continue
        key = role, shape, str(element)
        tables.setdefault(key, []).append([len(labels), *labels])
        owners.setdefault(key, []).append((number, (material, real, section, place)))
    numbers: list[int] = []
    belongs: list[tuple[int, int, int, DeckPlace]] = []
    for (role, shape, kind_name), rows in tables.items():
        for width in sorted({row[0] for row in rows}):
            positions = [k for k, row in enumerate(rows) if row[0] == width]
            table = nodes.rows(np.array([rows[k][1:] for k in positions], dtype=np.int64))
            corners = table[:, : CORNERS[shape]]
            if (corners < 0).any():
                raise MeshError(
                    f"elements {kind_name} of {archive.name} have nodes that are not there."
                )
            mids = table[:, CORNERS[shape] :]
            assert mids.shape[1] in (0, len(EDGES[shape]))
            owner_numbers = [owners[role, shape, kind_name][k] for k in positions]
            deck.blocks.append(Block(shape, kind_name, corners, mids, table[:, :0], role))
            numbers += [number for number, _ in owner_numbers]
            belongs += [owner for _, owner in owner_numbers]
    if not belongs:
        raise MeshError(
            f"{archive.name} has no elements that are cells of a mesh: write it with the elements "
            "of its solids or shells (CDWRITE, DB)."
        )
    numbering = Numbering(np.array(numbers, dtype=np.int64))
    deck.name_elements(groups, np.array(numbers))
    for name, (of_nodes, members) in archive.components.items():
        rows_of = (nodes if of_nodes else numbering).rows(np.array(members, dtype=np.int64))
        if (rows_of >= 0).any():
            sets = deck.node_sets if of_nodes else deck.element_sets
            sets[name] = np.unique(rows_of[rows_of >= 0])
    return deck, belongs


def _model(
    archive: Archive,
    deck: Deck,
    owners: list[tuple[int, int, int, DeckPlace]],
    builder: ModelBuilder,
) -> None:
    """Add the sections of the elements and the supports to the builder."""
    planes = {int(block.type): len(block) for block in deck.blocks if block.role == "plane"}
    refused = {int(k): n for k, n in deck.left.items() if int(k) not in BESIDE} | planes
    if refused:
        kinds = ", ".join(f"{count} of type {kind}" for kind, count in refused.items())
        raise MeshError(
            f"{deck.name} holds elements that no family here carries ({kinds}): read_mesh reads "
            "its solids and shells, without them."
        )
    groups: dict[tuple[str, int, float], list[int]] = {}
    for block, rows in deck.numbered():
        for row in rows.tolist():
            material, constants, section, place = owners[row]
            t = 0.0
            if block.role == "shell":
                t = archive.thickness.get(("section", section)) or archive.thickness.get(
                    ("real", constants), 0.0
                )
                place.needs(
                    t > 0, f"the shell has no thickness (SECDATA {section}, R {constants})."
                )
            groups.setdefault((block.role, material, t), []).append(row)
    for (role, number, t), members in groups.items():
        place = owners[members[0]][3]
        material = _material(archive, number, place)
        builder.complete(material)
        values = builder.isotropic(material, f"{role}s")
        if role == "shell":
            values["thickness"] = t * builder.units.length
        family = GroupSection("Shell" if role == "shell" else "Solid", values, place)
        builder.add(f"{role}s of material {number}", np.array(members, dtype=np.int64), family)
    builder.find_nodes()
    nodes = Numbering(deck.labels)
    for label, motion in archive.supports:
        row = nodes.rows(np.array([label], dtype=np.int64))
        motions = (
            list(range(len(MOTIONS)))
            if motion == "ALL"
            else [MOTION_LABELS[motion]] * (motion in MOTION_LABELS)
        )
        if row[0] >= 0 and motions:
            builder.fix(row, motions)
    builder.hold()


def _material(archive: Archive, number: int, place: DeckPlace) -> Material:
    """The isotropic material of this number; MeshError if it is orthotropic."""
    constants = archive.materials.get(number, {})
    directional = {"EY", "EZ", "GXY"} & constants.keys()
    isotropic = all(constants[key] == constants.get("EX") for key in directional - {"GXY"})
    place.needs(
        isotropic, f"the material {number} is orthotropic ({', '.join(sorted(directional))})."
    )
    material = Material(str(number), place)
    if "EX" in constants:
        nu = constants.get("PRXY", constants.get("NUXY", POISSON))
        material.set_isotropic(constants["EX"], nu)
    material.density = constants.get("DENS")
    return material


ANSYS = FileReader(read, model=True)
