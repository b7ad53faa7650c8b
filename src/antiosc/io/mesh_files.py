"""Mesh files of other programs: universal files of I-DEAS (`.unv`), all others by meshio.

Where a file has several kinds of cells, or kinds that no mesh here carries, the elements go through
a `Deck`, as those of Abaqus and Nastran do: wedges, pyramids and mixed volumes are cut into
tetrahedra, triangles beside quadrilaterals into triangles, and cells of 8 and 20 nodes get the
nodes that they lack (`conversion`).
"""

from __future__ import annotations

import contextlib
import io
import warnings
from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from antiosc.base.errors import MeshError, MissingDependencyError
from antiosc.io import med
from antiosc.io.conversion import as_mesh
from antiosc.io.deck import Block, Deck, DeckPlace, Numbering, real_number, whole_number
from antiosc.io.neutral import (
    CELLS,
    CORNERS,
    DIMENSION,
    EDGES,
    KINDS,
    SERENDIPITY,
    FileMesh,
    IntArray,
    joined,
    rectangles,
)
from antiosc.io.request import Request

if TYPE_CHECKING:
    import meshio

#: Corners of the edges in the order of gmsh's middle nodes, where it is not that of VTK.
GMSH_EDGES = {
    "tetra": ((0, 1), (1, 2), (2, 0), (3, 0), (2, 3), (1, 3)),
    "pyramid": ((0, 1), (0, 3), (0, 4), (1, 2), (1, 4), (2, 3), (2, 4), (3, 4)),
    "wedge": ((0, 1), (0, 2), (0, 3), (1, 2), (1, 4), (2, 5), (3, 4), (3, 5), (4, 5)),
    "hexahedron": (
        *((0, 1), (0, 3), (0, 4), (1, 2), (1, 5), (2, 3), (2, 6), (3, 7)),
        *((4, 5), (4, 7), (5, 6), (6, 7)),
    ),
}
#: Corners of the faces in the order of gmsh's nodes within them, likewise.
GMSH_FACES = {
    "hexahedron": (
        *((0, 3, 2, 1), (0, 1, 5, 4), (0, 4, 7, 3)),
        *((1, 2, 6, 5), (2, 3, 7, 6), (4, 5, 6, 7)),
    ),
    "wedge": ((0, 1, 4, 3), (0, 2, 5, 3), (1, 2, 5, 4)),
}


def known(label: str, name: str) -> str:
    """`label` itself; MeshError for cells that can neither be used nor divided."""
    if label not in CELLS:
        raise MeshError(
            f"{name} holds {label} cells, which no element here can carry; it must be of lines, "
            "triangles, quadrilaterals, tetrahedra, hexahedra, wedges or pyramids of geometric "
            "order 1 or 2."
        )
    return label


def as_carried(mesh: FileMesh, name: str) -> FileMesh:
    """The mesh with one supported kind of cells for each dimension; other cells are divided."""
    if not _is_mixed(mesh):
        return mesh
    deck = Deck(name, mesh.points, labels=mesh.labels)
    labels = [label for label, block in mesh.cells.items() if len(block)]
    for label in labels:
        deck.blocks.append(_block(label, mesh.cells[label], mesh.convention))
    starts = dict(zip(labels, np.cumsum([0, *map(len, deck.blocks)]), strict=False))
    for group, parts in mesh.groups.items():
        rows = [
            starts[label] + block_rows for label, block_rows in parts.items() if label in starts
        ]
        deck.element_sets[group] = np.concatenate([np.zeros(0, dtype=np.int64), *rows])
    deck.node_sets = mesh.node_sets
    result = as_mesh(deck)
    result.aids = mesh.aids
    result.remarks = [*mesh.remarks, *result.remarks]
    return result


def _is_mixed(mesh: FileMesh) -> bool:
    """Whether some cells of a dimension differ in kind from the rest, or are not supported."""
    labels = {label for label, block in mesh.cells.items() if len(block)}
    top = max((DIMENSION[CELLS[label][0]] for label in labels), default=0)
    if mesh.aids:  # where some cells are in groups, those in none are construction aids
        grouped = {
            label
            for parts in mesh.groups.values()
            for label, rows in parts.items()
            if len(rows) and DIMENSION[CELLS[label][0]] == top
        }
        lower = {label for label in labels if DIMENSION[CELLS[label][0]] < top}
        labels = grouped | lower if grouped else labels
    if any(label not in KINDS and label not in SERENDIPITY for label in labels):
        return True
    tops = {label for label in labels if DIMENSION[CELLS[label][0]] == top}
    return len(tops) > 1 or any(label in SERENDIPITY for label in tops)


def _block(label: str, cells: IntArray, convention: str) -> Block:
    shape, nodes, _ = CELLS[label]
    corners = CORNERS[shape]
    edges = len(EDGES[shape])
    has_mids = nodes > corners
    mids = np.arange(corners, corners + edges * has_mids)
    inner = np.arange(corners, corners)
    if nodes > corners + edges:
        inner = np.arange(corners + edges, nodes)
    if convention == "gmsh" and has_mids:
        mids = corners + _places(EDGES[shape], GMSH_EDGES.get(shape, EDGES[shape]))
        if len(inner) and shape in GMSH_FACES:
            first = corners + edges
            inner = first + _places(rectangles(shape), GMSH_FACES[shape])
            if nodes > first + len(inner):
                inner = np.append(inner, nodes - 1)
    return Block(shape, label, cells[:, :corners], cells[:, mids], cells[:, inner])


def _places(wanted: Sequence[Sequence[int]], table: Sequence[Sequence[int]]) -> IntArray:
    """For each of `wanted` (edges or faces), its index in `table`."""
    node_sets = [frozenset(entity) for entity in table]
    return np.array([node_sets.index(frozenset(entity)) for entity in wanted])


#: Formats that meshio reads, by extension.
FORMATS = {
    ".avs": "AVS-UCD",
    ".cgns": "CGNS",
    ".dat": "Tecplot",
    ".f3grid": "FLAC3D",
    ".h5m": "H5M",
    ".med": "MED",
    ".mdpa": "MDPA",
    ".mesh": "Medit",
    ".meshb": "Medit",
    ".node": "TetGen",
    ".ele": "TetGen",
    ".obj": "OBJ",
    ".off": "OFF",
    ".ply": "PLY",
    ".post": "PERMAS",
    ".stl": "STL",
    ".su2": "SU2",
    ".tec": "Tecplot",
    ".ugrid": "UGRID",
    ".vol": "Netgen",
    ".vtk": "VTK",
    ".vtu": "VTU",
    ".wkt": "WKT",
    ".xdmf": "XDMF",
    ".xmf": "XDMF",
    ".xml": "DOLFIN XML",
}


def read_by_meshio(ask: Request) -> FileMesh:
    """The content of a file in any format that meshio recognizes by its extension."""
    name = ask.name
    path = Path(ask.path)
    notes = list[str]()
    numbers: IntArray = np.zeros(0, dtype=np.int64)
    if path.suffix.lower() == ".med":
        path, notes, numbers = med.of_one_mesh(path, name)
    mesh = content(path, name)
    points = np.zeros((len(mesh.points), 3))
    if len(points):
        points[:, : mesh.points.shape[1]] = mesh.points
    cells: dict[str, list[IntArray]] = {}
    starts: list[int] = []
    count: dict[str, int] = {}
    for block in mesh.cells:
        data = np.asarray(block.data, dtype=np.int64)
        starts.append(count.get(block.type, 0))
        cells.setdefault(known(block.type, name), []).append(data)
        count[block.type] = starts[-1] + len(data)
    result = FileMesh(points, {k: np.vstack(parts) for k, parts in cells.items()}, "vtk")
    sets = _cell_sets(mesh)
    result.groups = joined((name, mesh.cells[k].type, starts[k] + rows) for name, k, rows in sets)
    result.node_sets = dict(_node_sets(mesh))
    result.remarks = notes
    result.labels = numbers
    return as_carried(result, name)


def content(path: Path, name: str) -> meshio.Mesh:
    """The content of a file, read by meshio."""
    try:
        import meshio
    except ImportError as error:
        raise MissingDependencyError(
            "meshio is not installed: sudo apt install python3-meshio"
        ) from error
    output = io.StringIO()
    try:
        with (
            contextlib.redirect_stdout(output),
            contextlib.redirect_stderr(output),
            warnings.catch_warnings(action="ignore"),
        ):
            return meshio.read(path)
    except (Exception, SystemExit) as error:
        # meshio prints its errors and calls sys.exit
        if isinstance(error, MemoryError):
            raise
        raise _failure(path, name, f"{output.getvalue()} {error}") from error


def _failure(path: Path, name: str, text: str) -> MeshError | MissingDependencyError:
    """The sentence on a file that meshio cannot read."""
    suffix = path.suffix.lower()
    if "h5py" in text and suffix not in (".h5py",):
        return MissingDependencyError(
            f"{name} needs h5py, which is not installed: sudo apt install python3-h5py"
        )
    if suffix in CONVERTERS:
        return MeshError(f"{name}: {CONVERTERS[suffix]}.")
    if suffix not in FORMATS:
        return MeshError(
            f"{name}: files of the type {suffix or '(none)'} are not read; write the mesh as .msh, "
            ".inp, .bdf, .unv, .med, .vtu or .xdmf."
        )
    reason = " ".join(text.replace(str(path), name).split())[:150].rstrip(". ")
    return MeshError(
        f"{name} cannot be read as {FORMATS[suffix]} ({reason or 'no reason given'}): write the "
        "mesh as .msh, .inp, .bdf, .unv or .vtu."
    )


#: Files of programs whose own exports, or free converters, antiosc reads.
CONVERTERS = {
    ".k": "LS-DYNA's keywords are not read; write a Nastran deck in LS-PrePost (File, Save as, "
    "Nastran), or convert by `meshio-convert` of a .msh from gmsh",
    ".rad": "Radioss' decks are not read; write a Nastran or Abaqus deck in HyperMesh, or convert "
    "it by OpenRadioss' tools to .vtk",
    ".mphtxt": "COMSOL's meshes are not read; export the mesh as Nastran (.nas) in COMSOL, or "
    "convert it by FEconv to .unv",
    ".sldprt": "parts of SolidWorks are not read; save as STEP (.step) there",
    ".sldasm": "assemblies of SolidWorks are not read; save as STEP (.step) there",
    ".ipt": "parts of Inventor are not read; save as STEP (.step) there",
    ".catpart": "parts of CATIA are not read; save as STEP (.step) there",
    ".prt": "parts of Creo and NX are not read; save as STEP (.step) there",
    ".f3d": "designs of Fusion are not read; export as STEP (.step) there",
    ".fcstd": "documents of FreeCAD are not read; export the body as STEP (.step) or BREP there",
}


def _cell_sets(mesh: meshio.Mesh) -> Iterator[tuple[str, int, IntArray]]:
    """Yield (group name, block, rows) from every way in which meshio's formats store cell
    groups.
    """
    physical = dict(_group_names(mesh))
    families = getattr(mesh, "cell_tags", {})  # MED: tag -> names
    for key, blocks in mesh.cell_data.items():
        for index, values in enumerate(blocks):
            values = np.asarray(values)
            if values.ndim != 1 or not np.issubdtype(values.dtype, np.integer):
                continue
            dim = DIMENSION[CELLS[mesh.cells[index].type][0]]
            for value, rows in _by_value(values):
                if key == "gmsh:physical":
                    yield physical.get((value, dim), str(value)), index, rows
                elif key == "cell_tags":
                    for name in families.get(value, []):
                        yield name, index, rows
                elif key in ("nastran:ref", "medit:ref"):
                    yield str(value), index, rows
                elif key != "gmsh:geometrical":
                    yield f"{key}={value}", index, rows
    for name, blocks in mesh.cell_sets.items():
        for index, rows in enumerate(blocks):
            if rows is not None and len(rows) and name not in mesh.cell_data:
                yield str(name), index, np.asarray(rows, dtype=np.int64)


def _group_names(mesh: meshio.Mesh) -> Iterator[tuple[tuple[int, int], str]]:
    """Yield ((tag, dimension), name) of groups; fields of MED and VTK with other values are
    skipped.
    """
    for name, value in mesh.field_data.items():
        pair = np.asarray(value)
        if pair.shape == (2,) and np.issubdtype(pair.dtype, np.integer):
            yield (int(pair[0]), int(pair[1])), name


def _by_value(values: IntArray) -> Iterator[tuple[int, IntArray]]:
    """Yield (value, rows with this value), ascending, by one sort."""
    order = np.argsort(values, kind="stable")
    distinct, first = np.unique(values[order], return_index=True)
    for value, rows in zip(distinct, np.split(order, first[1:]), strict=True):
        yield int(value), rows.astype(np.int64)


def _node_sets(mesh: meshio.Mesh) -> Iterator[tuple[str, IntArray]]:
    for name, nodes in getattr(mesh, "point_sets", {}).items():
        yield str(name), np.asarray(nodes, dtype=np.int64)
    tags = mesh.point_data.get("point_tags")  # MED: tag -> names
    if tags is not None:
        for value, labels in getattr(mesh, "point_tags", {}).items():
            for name in labels:
                yield name, np.flatnonzero(np.asarray(tags) == value)


#: Element descriptor -> (shape, nodes).
ELEMENTS = {
    **dict.fromkeys((11, 21), ("line", 2)),
    **dict.fromkeys((22, 23, 24), ("line", 3)),
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
ROD = 11
#: Places of corners and of middles of edges (in VTK's order) of second-order elements.
ORDER = {
    "line": ((0, 2), (1,)),
    "triangle": ((0, 2, 4), (1, 3, 5)),
    "quad": ((0, 2, 4, 6), (1, 3, 5, 7)),
    "tetra": ((0, 2, 4, 9), (1, 3, 5, 6, 7, 8)),
    "wedge": ((0, 2, 4, 9, 11, 13), (1, 3, 5, 10, 12, 14, 6, 7, 8)),
    "hexahedron": ((0, 2, 4, 6, 12, 14, 16, 18), (1, 3, 5, 7, 13, 15, 17, 19, 8, 9, 10, 11)),
}
#: Numbers of data sets (SDRC I-DEAS): units, nodes of three ages, elements.
UNITS_SET = 164
NODES_SET = 2411
OLD_NODES_SET = 781
SINGLE_NODES_SET = 15
ELEMENT_SETS = 2412, 780  # new and old
#: Groups: with four numbers for each member, and with two.
GROUPS = {**dict.fromkeys((2435, 2452, 2467, 2477), 4), **dict.fromkeys((2429, 2430, 2432), 2)}
OF_NODES, OF_ELEMENTS = 7, 8  # kinds of members


@dataclass
class _Content:
    """The data sets of a universal file."""

    name: str
    labels: list[int] = field(default_factory=list)
    points: list[list[float]] = field(default_factory=list)
    #: (descriptor, shape, nodes) -> rows of (label, its nodes)
    elements: dict[tuple[int, str, int], list[list[int]]] = field(default_factory=dict)
    #: name -> (nodes, elements) by label
    groups: dict[str, tuple[list[int], list[int]]] = field(default_factory=dict)
    others: Counter[str] = field(default_factory=Counter)
    #: units of length in a metre; None: the file does not say
    per_metre: float | None = None


def read_universal(ask: Request) -> FileMesh:
    """Read a universal file."""
    path = Path(ask.path)
    ask.allow(30 + 3e-5 * path.stat().st_size)
    data = path.read_bytes()
    if b"\0" in data:
        raise MeshError(f"{ask.name} holds zero bytes: it is binary, or it is damaged.")
    content = _Content(ask.name)
    for number, rows in _sets(data.decode("latin-1").splitlines(), ask.name):
        _take(content, number, rows)
    deck = _deck(content, ask.elements)
    if content.per_metre not in (None, 1.0) and ask.unit[0] == 1:
        deck.points /= content.per_metre
        deck.remarks.append(
            f"{ask.name} says that it has {content.per_metre:g} units of length in a metre (data"
            " set 164); its coordinates are converted."
        )
    return as_mesh(deck)


Lines = list[tuple[str, DeckPlace]]


def _sets(lines: list[str], name: str) -> Iterator[tuple[int, Lines]]:
    """Yield (number, lines) of the data sets, which are delimited by lines of -1."""
    rows: Lines | None = None
    is_data_set = False
    for k, line in enumerate(lines):
        if line.strip() != "-1":
            if rows is not None:
                rows.append((line, DeckPlace(name, k + 1)))
            continue
        if rows is None:
            rows = []
            continue
        if rows:
            header = rows[0][0].split()
            if header and header[0].rstrip("bB").isdigit():
                is_data_set = True
                yield int(header[0].rstrip("bB")[:9]), rows[1:]
        rows = None
    if rows:
        raise MeshError(f"{name} ends within a data set: it is cut off.")
    if not is_data_set:
        raise MeshError(f"{name} holds no data sets between lines of -1: it is no universal file.")


def _take(content: _Content, number: int, rows: Lines) -> None:
    if number == UNITS_SET and len(rows) > 1:
        text, place = rows[1]
        content.per_metre = real_number("".join(text.split()[:1]), place)
        place.needs(content.per_metre > 0, "the factor of length in data set 164 must be positive.")
    elif number in (NODES_SET, OLD_NODES_SET):
        for k in range(0, len(rows) - 1, 2):
            header, at = rows[k]
            text, place = rows[k + 1]
            _node(content, header.split()[:1], at, text.split()[:3], place)
    elif number == SINGLE_NODES_SET:
        for text, place in rows:
            words = text.split()
            _node(content, words[:1], place, words[4:7], place)
    elif number in ELEMENT_SETS:
        _elements(content, rows)
    elif number in GROUPS:
        _groups(content, rows, GROUPS[number])


def _node(
    content: _Content, label: list[str], at: DeckPlace, x: list[str], place: DeckPlace
) -> None:
    place.needs(label and len(x) == 3, "a node needs a number and three coordinates.")
    content.labels.append(whole_number(label[0], at))
    content.points.append([real_number(word, place) for word in x])


def _wholes(
    rows: Lines, k: int, least: int, message: str, place: DeckPlace
) -> tuple[list[int], int]:
    """(at least `least` integers from line k on, number of the following line)."""
    numbers: list[int] = []
    while len(numbers) < least:
        place.needs(k < len(rows), message)
        numbers += [whole_number(word, rows[k][1]) for word in rows[k][0].split()]
        k += 1
    return numbers, k


def _elements(content: _Content, rows: Lines) -> None:
    k = 0
    while k < len(rows):
        text, place = rows[k]
        header = [whole_number(word, place) for word in text.split()]
        place.needs(len(header) >= 6, f"the head of an element has six numbers; got {len(header)}.")
        label = header[0]
        descriptor = header[1]
        count = header[-1]
        next_words = rows[k + 1][0].split() if k + 1 < len(rows) else []
        # Salome gives rods an orientation too, others do not
        k += (
            2
            if descriptor in WITH_ORIENTATION or (descriptor == ROD and len(next_words) == 3)
            else 1
        )
        fault = f"element {label} ends before its {count} nodes."
        nodes, k = _wholes(rows, k, count, fault, place)
        shape, node_count = ELEMENTS.get(descriptor, ("", 0))
        if not shape:
            kind = f"element type {descriptor}"
            content.others[kind] += 1
            continue
        if shape == "line" and count in (2, 3):
            node_count = count
        complete = len(nodes) == count == node_count
        place.needs(
            complete,
            f"element {label} of type {descriptor} has {len(nodes)} nodes, of which "
            f"its head tells {count}; it must have {node_count}.",
        )
        content.elements.setdefault((descriptor, shape, node_count), []).append([label, *nodes])


def _groups(content: _Content, rows: Lines, width: int) -> None:
    k = 0
    while k + 1 < len(rows):
        text, place = rows[k]
        header = [whole_number(word, place) for word in text.split()]
        count = header[-1] if header else 0
        name = rows[k + 1][0].strip() or str(header[0] if header else "")
        fault = f"the group {name!r} ends before its {count} members."
        numbers, k = _wholes(rows, k + 2, width * count, fault, place)
        nodes, elements = content.groups.setdefault(name, ([], []))
        for m in range(count):
            kind, label = numbers[width * m : width * m + 2]
            if kind == OF_NODES:
                nodes.append(label)
            elif kind == OF_ELEMENTS:
                elements.append(label)


def _deck(content: _Content, groups: Mapping[str, Sequence[int]]) -> Deck:
    if not content.points:
        raise MeshError(f"{content.name} has no nodes (data sets 2411, 781 or 15).")
    nodes = Numbering(np.array(content.labels, dtype=np.int64))
    if (np.diff(nodes.labels) == 0).any():
        raise MeshError(f"{content.name} gives two nodes one number.")
    deck = Deck(content.name, np.array(content.points))
    deck.labels = np.array(content.labels, dtype=np.int64)
    labels = [np.zeros(0, dtype=np.int64)]
    for (descriptor, shape, count), rows in content.elements.items():
        table = np.array(rows, dtype=np.int64)
        of_cells = nodes.rows(table[:, 1:])
        if (of_cells < 0).any():
            row, k = np.argwhere(of_cells < 0)[0]
            raise MeshError(
                f"element {table[row, 0]} of {content.name} has the node {table[row, k + 1]},"
                " which the file does not define."
            )
        corners = list(range(CORNERS[shape]))
        mids = list[int]()
        if count > CORNERS[shape]:
            corners, mids = (list(places) for places in ORDER[shape])
            assert len(mids) == len(EDGES[shape])
        kind = f"element type {descriptor}"
        deck.blocks.append(
            Block(shape, kind, of_cells[:, corners], of_cells[:, mids], of_cells[:, :0])
        )
        labels.append(table[:, 0])
    numbers = np.concatenate(labels)
    if not len(numbers):
        ignored = ", ".join(f"{count} of {kind}" for kind, count in content.others.items())
        raise MeshError(
            f"{content.name} has no elements that are cells of a mesh: {ignored or 'none at all'}; "
            "write the file with its lines, faces or solids."
        )
    elements = Numbering(numbers)
    if (np.diff(elements.labels) == 0).any():
        raise MeshError(f"{content.name} gives two elements one number.")
    deck.left = content.others
    deck.name_elements(groups, numbers)
    for name, (of_nodes, of_elements) in content.groups.items():
        for entities, numbering, sets in (
            (of_nodes, nodes, deck.node_sets),
            (of_elements, elements, deck.element_sets),
        ):
            rows_of = numbering.rows(np.array(entities, dtype=np.int64))
            if len(rows_of[rows_of >= 0]):
                sets[name] = np.unique(rows_of[rows_of >= 0])
    return deck
