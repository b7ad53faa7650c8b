"""A series of displacement fields for ParaView: `.pvd` with `.vtu` files, or one `.bp` folder.

VTK's XML format for unstructured grids, version 0.1: the mesh is encoded once, a field in each
frame. Arrays are in base64, each a row of blocks of zlib with their sizes before them. The mesh is
compressed; the digits of a field hardly shrink, so that its blocks are stored as they are.
"""

from __future__ import annotations

import base64
import os
import re
import shutil
import stat
import sys
import zlib
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from xml.sax.saxutils import escape, quoteattr, unescape

import numpy as np
from numpy.typing import NDArray

from antiosc import fem
from antiosc.base import checks, files
from antiosc.base._types import Array, IntArray
from antiosc.base.errors import InputError, MissingDependencyError
from antiosc.fem.platform import on_root
from antiosc.fem.structure.structure import Structure, on_mesh

#: Bytes of an array that are compressed at once.
BYTES_AT_ONCE = 1 << 15
#: VTK's numbers of the kinds of cells, by meshio's names.
TYPES = {
    **{"vertex": 1, "line": 3, "triangle": 5, "quad": 9, "tetra": 10, "hexahedron": 12},
    **{"line3": 21, "triangle6": 22, "tetra10": 24, "quad9": 28, "hexahedron27": 29},
}
#: VTK's names of the types of numbers.
NUMBERS = {"float64": "Float64", "int64": "Int64", "uint8": "UInt8"}


class Frames:
    """The mesh of a series of files with fields: points (n, 3) [m], cells in VTK's node order.

    `cells`: (kind, (m, nodes)) of each kind.
    """

    def __init__(self, points: Array, cells: Sequence[tuple[str, IntArray]]) -> None:
        order = "LittleEndian" if sys.byteorder == "little" else "BigEndian"
        nodes = np.concatenate([np.full(len(c), c.shape[1], dtype=np.int64) for _, c in cells])
        types = [np.full(len(c), TYPES[kind], dtype=np.uint8) for kind, c in cells]
        corners = np.concatenate([c.astype(np.int64).ravel() for _, c in cells])
        parts = [
            '<?xml version="1.0"?>\n'
            f'<VTKFile type="UnstructuredGrid" version="0.1" byte_order="{order}" '
            'compressor="vtkZLibDataCompressor">\n<UnstructuredGrid>\n'
            f'<Piece NumberOfPoints="{len(points)}" NumberOfCells="{len(nodes)}">\n<Points>\n',
            _element("Points", np.asarray(points, dtype=float)),
            "</Points>\n<Cells>\n",
            _element("connectivity", corners),
            _element("offsets", np.cumsum(nodes)),
            _element("types", np.concatenate(types)),
            "</Cells>\n<PointData>\n",
        ]
        self._before = "".join(parts).encode()

    def content(self, fields: Mapping[str, Array]) -> bytes:
        """Content of a `.vtu` file with fields, numbers (n,) or vectors (n, 3), at the points."""
        lines = "".join(
            _element(escape(name, {'"': "&quot;"}), np.asarray(field, dtype=float), level=0)
            for name, field in fields.items()
        )
        end = "</PointData>\n</Piece>\n</UnstructuredGrid>\n</VTKFile>\n"
        return b"".join([self._before, lines.encode(), end.encode()])


def _element(name: str, values: NDArray[np.generic], level: int = -1) -> str:
    """A `DataArray` element of numbers or vectors, compressed at a zlib level."""
    content = values.tobytes()
    blocks = [
        zlib.compress(content[start : start + BYTES_AT_ONCE], level)
        for start in range(0, len(content), BYTES_AT_ONCE)
    ]
    last = len(content) - BYTES_AT_ONCE * (len(blocks) - 1)
    header = np.array([len(blocks), BYTES_AT_ONCE, last, *map(len, blocks)], dtype=np.uint32)
    text = base64.b64encode(header.tobytes()) + base64.b64encode(b"".join(blocks))
    components = f' NumberOfComponents="{values.shape[1]}"' if values.ndim > 1 else ""
    return (
        f'<DataArray type="{NUMBERS[values.dtype.name]}" Name="{name}"{components} '
        f'format="binary">\n{text.decode()}\n</DataArray>\n'
    )


def listing(path: str | os.PathLike[str]) -> Path:
    """Path of the `.pvd` file of a series: `path`, with the suffix `.pvd` added where it is
    missing.

    The part after a point belongs to the name: `run_v=1.5` and `run_v=1.7` are two series.
    """
    path = checks.new_file("path", path)
    target = path if path.suffix.lower() == ".pvd" else path.with_name(f"{path.name}.pvd")
    if not target.stem.isprintable():
        raise InputError(
            f"a series cannot be named {checks.shown(target.stem)}: XML has no word for one of its "
            "characters."
        )
    return target


def write_frames(
    target: Path,
    frames: Frames,
    times: Array,
    fields: Iterable[Array],
) -> None:
    """Write a frame for each time, and finally the list of frames `target` (see `listing`).

    `fields`: displacements (points, 3) in m for each time.

    At every moment the list names the frames of one series, all of them whole, even if the process
    is killed: the new frames are written to a temporary folder, from which the list names them
    until they stand beside it. Only the frames in the previous list of this name are removed; its
    permissions are kept.

    Raises
    ------
    InputError
        The system refuses to write there.
    """
    try:
        target.parent.mkdir(parents=True, exist_ok=True)
        staging = files.part_name(target)
        staging.mkdir(mode=0o700)
        with files.claimed(staging):
            old_frames = _write_and_list(target, staging, frames, times, fields)
    except OSError as error:
        raise files.cannot_write("the series", target, error) from error
    for folder in {(target.parent / name).parent for name in old_frames} - {target.parent}:
        shutil.rmtree(folder, ignore_errors=True)


def _write_and_list(
    target: Path, staging: Path, frames: Frames, times: Array, fields: Iterable[Array]
) -> list[str]:
    """Write the frames and their list; return the names of the frames of the previous list."""
    is_listed = False
    try:
        names = []
        for number, field in enumerate(fields):
            names.append(f"{target.stem}_{number:04d}.vtu")
            files.write_through(staging / names[-1], frames.content({"displacement": field}))
        old_frames = _listed_frames(target)
        staged = [f"{staging.name}/{name}" for name in names]
        files.write_text(target, _collection(times, staged), "the series")
        is_listed = True
        for name in old_frames:
            (target.parent / name).unlink(missing_ok=True)
        for name in names:
            (staging / name).chmod(stat.S_IMODE(target.stat().st_mode))
            _second_name(staging / name, target.parent / name)
        files.write_text(target, _collection(times, names), "the series")
        is_listed = False
    finally:
        if not is_listed:
            shutil.rmtree(staging, ignore_errors=True)
    return old_frames


def _second_name(frame: Path, name: Path) -> None:
    """Hard-link a file under a second name, or copy it where the file system has no links."""
    name.unlink(missing_ok=True)
    try:
        os.link(frame, name)
    except OSError:
        files.write_through(name, frame.read_bytes())


def _collection(times: Array, names: list[str]) -> str:
    entries = [
        f'    <DataSet timestep="{time:.9e}" file={quoteattr(name)}/>\n'
        for time, name in zip(times, names, strict=True)
    ]
    return (
        '<?xml version="1.0" encoding="utf-8"?>\n<VTKFile type="Collection" version="0.1">\n'
        "  <Collection>\n" + "".join(entries) + "  </Collection>\n</VTKFile>\n"
    )


def _listed_frames(target: Path) -> list[str]:
    """Names of the frames that the list `target` contains, those with its own name as prefix."""
    try:
        text = target.read_text(encoding="utf-8") if target.is_file() else ""
    except UnicodeDecodeError:
        return []
    pattern = re.compile(
        f"({re.escape(files.PART)}[^/]+/)?{re.escape(target.stem)}_\\d{{4,}}\\.vtu"
    )
    quoted = re.findall(r"""file=(?:"([^"]*)"|'([^']*)')""", text)
    names = (unescape(a or b, {"&quot;": '"', "&apos;": "'"}) for a, b in quoted)
    return [name for name in names if pattern.fullmatch(name)]


#: What a folder of ADIOS2 holds.
INDEX = "md.idx"


def write_vtx(
    target: Path, structure: Structure, shapes: Array, times: Array, factors: Array
) -> None:
    """Write displacements, the sums of `shapes` (rows, k) with factors (n, k), at times (n,).

    Every rank writes its part of the mesh. The folder is complete or absent; one that is no series
    of ADIOS2 is left alone.

    Raises
    ------
    MissingDependencyError
        dolfinx is absent, or was built without ADIOS2.
    InputError
        An assembly, given matrices; the system refuses to write there.
    """
    if fem.missing:
        raise MissingDependencyError("a .bp series needs dolfinx: write a .pvd.")
    from antiosc.fem.platform import compat
    from antiosc.recovery.mesh_fields import displacements_of_rank  # needs dolfinx

    if structure.matrices.assembled:
        raise InputError("a .bp series holds one mesh: write the series of an assembly as .pvd.")
    part = on_mesh(structure, "given matrices have no mesh for a .bp series: write a .pvd.")
    if not compat.writes_vtx():
        raise MissingDependencyError(
            "a .bp series needs dolfinx with ADIOS2, which Debian has from 13 on: write a .pvd."
        )
    comm = part.comm
    staged = Path(on_root(comm, lambda: str(_staged(target))))
    try:
        fields = displacements_of_rank(part, shapes)
        mesh = part.mesh.dolfinx
        compat.write_vtx(mesh, staged, "displacement", times, (fields @ a for a in factors))
        on_root(comm, lambda: _move_series(staged, target))
    finally:
        on_root(comm, lambda: shutil.rmtree(staged, ignore_errors=True))


def _staged(target: Path) -> Path:
    """Path of the temporary folder into which the series is written first."""
    try:
        target.parent.mkdir(parents=True, exist_ok=True)
        if os.path.lexists(target) and not (target / INDEX).is_file():
            raise InputError(
                f"cannot write the series to {str(target)!r}: what is there is no series of "
                "ADIOS2; choose another name."
            )
        if not os.access(target.parent, os.W_OK):
            raise PermissionError(13, "Permission denied")
    except OSError as error:
        raise files.cannot_write("the series", target, error) from error
    return files.part_name(target, ".bp")


def _move_series(staged: Path, target: Path) -> None:
    try:
        files.replace_folder(staged, target)
        files.clear_parts(target)
    except OSError as error:
        raise files.cannot_write("the series", target, error) from error
