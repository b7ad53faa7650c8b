"""Mesh files of other programs, by meshio.

Where a file has several kinds of cells, or kinds that no mesh here carries, the elements go through
a `Deck`, as those of Abaqus and Nastran do: wedges, pyramids and mixed volumes are cut into
tetrahedra, triangles beside quadrilaterals into triangles, and cells of 8 and 20 nodes get the
nodes that they lack (`conversion`).
"""

from __future__ import annotations

import contextlib
import io
import warnings
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from antiosc.base.errors import MeshError, MissingDependencyError
from antiosc.io.conversion import as_mesh
from antiosc.io.deck import Block, Deck
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
    result.of_gmsh, result.aids = mesh.of_gmsh, mesh.aids
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


def read_by_meshio(ask: Request) -> FileMesh:
    """The content of a file in any format that meshio recognizes by its extension."""
    mesh = _content(Path(ask.path), ask.name)
    points = np.zeros((len(mesh.points), 3))
    if len(points):
        points[:, : mesh.points.shape[1]] = mesh.points

    cells: dict[str, list[IntArray]] = {}
    starts: list[int] = []
    count: dict[str, int] = {}
    for block in mesh.cells:
        data = np.asarray(block.data, dtype=np.int64)
        starts.append(count.get(block.type, 0))
        cells.setdefault(known(block.type, ask.name), []).append(data)
        count[block.type] = starts[-1] + len(data)

    result = FileMesh(points, {k: np.vstack(parts) for k, parts in cells.items()}, "vtk")
    sets = _cell_sets(mesh)
    result.groups = joined((name, mesh.cells[k].type, starts[k] + rows) for name, k, rows in sets)
    result.node_sets = dict(_node_sets(mesh))
    return as_carried(result, ask.name)


def _content(path: Path, name: str) -> meshio.Mesh:
    """The content of a file, read by meshio."""
    if path.suffix.lower() == ".unv":
        raise MeshError(
            f"{name}: universal files are not read; convert it by gmsh or Salome to .msh or .med."
        )
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
    except MemoryError:
        raise
    except ModuleNotFoundError as error:
        raise MissingDependencyError(
            f"{name} needs {error.name}, which is not installed: sudo apt install "
            f"python3-{str(error.name).lower()}"
        ) from error
    except (Exception, SystemExit) as error:  # meshio prints its errors and calls sys.exit
        reason = " ".join(f"{output.getvalue()} {error}".replace(str(path), name).split())[:150]
        raise MeshError(
            f"{name} cannot be read by meshio ({reason.rstrip('. ') or 'no reason given'}): write "
            "the mesh as .msh, .inp, .bdf, .med or .vtu, or the geometry as STEP."
        ) from error


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
