"""The reader of each file type; mesh files of other programs, by meshio.

If a file has several kinds of cells, or unsupported kinds, its elements are converted through a
`Deck`, as for Abaqus and Nastran: wedges, pyramids and mixed volumes are cut into tetrahedra,
quadrilaterals of a mesh with triangles into triangles, and cells of 8 and 20 nodes get the missing
nodes (`conversion`).
"""

from __future__ import annotations

import contextlib
import io
import warnings
from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from antiosc.base.errors import MeshError, MissingDependencyError
from antiosc.io import by_gmsh, facets
from antiosc.io.conversion import checked_kind, with_supported_kinds
from antiosc.io.isolation import FileReader, Request, entry_points_of, load_entry_point
from antiosc.io.neutral import CELL_TYPES, DIMENSION, FileMesh, IntArray, joined_groups

if TYPE_CHECKING:
    import meshio


def read_by_meshio(request: Request) -> FileMesh:
    """The content of a file in any format that meshio recognizes by its extension."""
    mesh = _content(Path(request.path), request.name)
    points = np.zeros((len(mesh.points), 3))
    if len(points):
        points[:, : mesh.points.shape[1]] = mesh.points

    cells: dict[str, list[IntArray]] = {}
    starts: list[int] = []
    for block in mesh.cells:
        blocks = cells.setdefault(checked_kind(block.type, request.name), [])
        starts.append(sum(map(len, blocks)))
        blocks.append(np.asarray(block.data, dtype=np.int64))

    result = FileMesh(points, {k: np.vstack(parts) for k, parts in cells.items()})
    sets = _cell_sets(mesh)
    result.groups = joined_groups(
        (name, mesh.cells[k].type, starts[k] + rows) for name, k, rows in sets
    )
    result.node_sets = dict(_node_sets(mesh))

    return with_supported_kinds(result, request.name)


def _content(path: Path, name: str) -> meshio.Mesh:
    """The content of a file, read by meshio."""
    try:
        import meshio
    except ImportError as error:
        raise MissingDependencyError("meshio is not installed: pip install meshio") from error

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
            "the mesh as .msh, .inp, .bdf, .med or .vtu (gmsh and Salome do)."
        ) from error


def _cell_sets(mesh: meshio.Mesh) -> Iterator[tuple[str, int, IntArray]]:
    """Yield (group name, index of a block of cells, rows in it) of all sets."""
    pairs = {name: np.asarray(pair) for name, pair in mesh.field_data.items()}
    physical = {  # (tag, dimension) -> name
        (int(pair[0]), int(pair[1])): name
        for name, pair in pairs.items()
        if pair.shape == (2,) and np.issubdtype(pair.dtype, np.integer)
    }
    families = getattr(mesh, "cell_tags", {})  # MED: tag -> names
    for key, blocks in mesh.cell_data.items():
        for index, values in enumerate(blocks):
            values = np.asarray(values)
            if values.ndim != 1 or not np.issubdtype(values.dtype, np.integer):
                continue
            for value, rows in _rows_by_value(values):
                names = [f"{key}={value}"]
                if key in ("gmsh:physical", "medit:ref"):
                    dim = DIMENSION[CELL_TYPES[mesh.cells[index].type][0]]
                    names = [physical.get((value, dim), str(value))]
                elif key in ("cell_tags", "gmsh:geometrical"):
                    names = families.get(value, [])
                for name in names:
                    yield name, index, rows

    for name, blocks in mesh.cell_sets.items():
        for index, rows in enumerate(blocks):
            if rows is not None and len(rows) and name not in mesh.cell_data:
                yield str(name), index, np.asarray(rows, dtype=np.int64)


def _rows_by_value(values: IntArray) -> Iterator[tuple[int, IntArray]]:
    """Yield (value, rows that have it) for each different value, ascending."""
    order = np.argsort(values, kind="stable")
    distinct, first = np.unique(values[order], return_index=True)
    for value, rows in zip(distinct, np.split(order, first[1:]), strict=True):
        yield int(value), rows.astype(np.int64)


def _node_sets(mesh: meshio.Mesh) -> Iterator[tuple[str, IntArray]]:
    """Yield (name, rows of points) of the sets of nodes."""
    for name, nodes in getattr(mesh, "point_sets", {}).items():
        yield str(name), np.asarray(nodes, dtype=np.int64)

    tags = mesh.point_data.get("point_tags")  # MED: tag -> names
    if tags is not None:
        for value, labels in getattr(mesh, "point_tags", {}).items():
            for name in labels:
                yield name, np.flatnonzero(np.asarray(tags) == value)


# --- The reader of each file type ---
#
# A reader gets a `Request`, reads `ask.path` and returns a `FileMesh`, or raises MeshError with one
# sentence that names the file `ask.name`. It runs in a separate process with limits on time and
# memory (`child`), which can import only those modules of antiosc that do not need dolfinx:
# `antiosc.base` and this package. Packages register further readers, each for one ending, as entry
# points of the group `antiosc.readers`; all other types go to meshio.

#: Name is the ending of the files without its dot, value a `FileReader`.
ENTRY_POINT_GROUP = "antiosc.readers"
GMSH_READER = FileReader(by_gmsh.read)
BUILT_IN_READERS = {
    **dict.fromkeys((".msh", *by_gmsh.GEOMETRY_ENDINGS), GMSH_READER),
    **dict.fromkeys(facets.SURFACE_ENDINGS, FileReader(facets.read)),
}
MESHIO_READER = FileReader(read_by_meshio)
#: Bytes from its begin by which the type of a file is recognized.
RECOGNITION_BYTES = 2**20


def reader_of(path: str | Path, solid: bool = False) -> FileReader:
    """The reader of a file, found by ending and content; `solid`: the file is a surface to fill."""
    if solid:
        return GMSH_READER

    ending = Path(path).suffix.lower()
    for entry in entry_points_of(ENTRY_POINT_GROUP):
        if f".{entry.name.lower()}" != ending:
            continue
        reader = load_entry_point(entry, FileReader)
        if reader.matches is None or reader.matches(_first_bytes(path)):
            return reader

    return BUILT_IN_READERS.get(ending, MESHIO_READER)


def _first_bytes(path: str | Path) -> bytes:
    """The first bytes of a file; b"" if it cannot be read."""
    with contextlib.suppress(OSError), Path(path).open("rb") as file:
        return file.read(RECOGNITION_BYTES)
    return b""


def is_deck(path: str | Path) -> bool:
    """Whether the reader of this file can return a whole model with materials and supports."""
    return reader_of(path).model


def deck_endings() -> list[str]:
    """Endings of the files that `read_model` reads."""
    readers = {
        f".{entry.name.lower()}": load_entry_point(entry, FileReader)
        for entry in entry_points_of(ENTRY_POINT_GROUP)
    }
    return sorted(
        ending for ending, reader in readers.items() if reader.model and not reader.matches
    )
