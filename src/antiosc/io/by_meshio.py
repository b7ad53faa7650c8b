"""All other mesh files, by meshio."""

from __future__ import annotations

import contextlib
import io
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np

from antiosc.base.errors import MeshError, MissingDependencyError
from antiosc.io.mixed import as_carried, known
from antiosc.io.neutral import FileMesh, IntArray, joined
from antiosc.io.request import Request
from antiosc.io.shapes import CELLS, DIMENSION

#: Formats that meshio reads, by extension.
FORMATS = {
    ".avs": "AVS-UCD",
    ".cgns": "CGNS",
    ".dat": "Tecplot",
    ".e": "Exodus",
    ".ex2": "Exodus",
    ".exo": "Exodus",
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


def read(ask: Request) -> FileMesh:
    """The content of a file in any format that meshio recognizes by its extension."""
    name = ask.name
    mesh = _read(Path(ask.path), name)
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
    return as_carried(result, name)


def _read(path: Path, name: str) -> Any:
    try:
        import meshio
    except ImportError as error:
        raise MissingDependencyError(
            "meshio is not installed: sudo apt install python3-meshio"
        ) from error
    said = io.StringIO()
    try:
        with contextlib.redirect_stdout(said), contextlib.redirect_stderr(said):
            return meshio.read(path)
    except (Exception, SystemExit) as error:
        # meshio prints its errors and calls sys.exit
        if isinstance(error, MemoryError):
            raise
        raise _failure(path, name, f"{said.getvalue()} {error}") from error


def _failure(path: Path, name: str, text: str) -> MeshError | MissingDependencyError:
    """A sentence on a file that meshio does not read."""
    suffix = path.suffix.lower()
    if "h5py" in text and suffix not in (".h5py",):
        return MissingDependencyError(
            f"{name} needs h5py, which is not installed: sudo apt install python3-h5py"
        )
    if suffix not in FORMATS:
        return MeshError(
            f"{name}: files of the type {suffix or '(none)'} are not read; write the mesh as .msh, "
            ".inp, .bdf, .unv, .med, .vtu or .xdmf."
        )
    return MeshError(
        f"{name} cannot be read as {FORMATS[suffix]}: it is damaged, or a variant of the format "
        "that is not supported; write the mesh as .msh, .inp, .bdf, .unv or .vtu."
    )


def _cell_sets(mesh: Any) -> Iterator[tuple[str, int, IntArray]]:
    """(group name, block, rows) from every way in which meshio's formats carry cell groups."""
    physical = dict(_named(mesh))
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


def _named(mesh: Any) -> Iterator[tuple[tuple[int, int], str]]:
    """((tag, dimension), name) of groups; fields of other formats (MED, VTK) have other values."""
    for name, value in mesh.field_data.items():
        pair = np.asarray(value)
        if pair.shape == (2,) and np.issubdtype(pair.dtype, np.integer):
            yield (int(pair[0]), int(pair[1])), name


def _by_value(values: IntArray) -> Iterator[tuple[int, IntArray]]:
    """(value, rows that have it), ascending; one sort for all of them."""
    order = np.argsort(values, kind="stable")
    found, first = np.unique(values[order], return_index=True)
    for value, rows in zip(found, np.split(order, first[1:]), strict=True):
        yield int(value), rows.astype(np.int64)


def _node_sets(mesh: Any) -> Iterator[tuple[str, IntArray]]:
    for name, nodes in getattr(mesh, "point_sets", {}).items():
        yield str(name), np.asarray(nodes, dtype=np.int64)
    tags = mesh.point_data.get("point_tags")  # MED: tag -> names
    if tags is not None:
        for value, labels in getattr(mesh, "point_tags", {}).items():
            for name in labels:
                yield name, np.flatnonzero(np.asarray(tags) == value)
