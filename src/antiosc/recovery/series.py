"""Files for ParaView by meshio: fields in a `.vtu`, a series of displacements in a `.pvd`."""

from __future__ import annotations

import os
from collections.abc import Iterable, Mapping, Sequence
from html import escape
from pathlib import Path

from antiosc.base import checks, files
from antiosc.base._types import Array, IntArray
from antiosc.base.errors import InputError, MissingDependencyError


def write_vtu(
    path: Path, points: Array, cells: Sequence[tuple[str, IntArray]], fields: Mapping[str, Array]
) -> None:
    """Write fields (n,) or (n, 3) at `points` (n, 3) [m] to one file; cells have VTK's order."""
    try:
        import meshio  # takes a while to load
    except ImportError as error:
        raise MissingDependencyError(
            "meshio is not installed: sudo apt install python3-meshio"
        ) from error

    blocks = [(kind, numbers) for kind, numbers in cells if len(numbers)]
    data = {name: values.astype(float) for name, values in fields.items()}
    meshio.Mesh(points, blocks, point_data=data).write(path, file_format="vtu")


def write_vtu_file(
    path: str | os.PathLike[str],
    points: Array,
    cells: Sequence[tuple[str, IntArray]],
    fields: Mapping[str, Array],
) -> Path:
    """Write a `.vtu` file, replacing an old file only when complete; returns its path."""
    target = checks.new_file("path", path)
    if target.suffix.lower() != ".vtu":
        target = target.with_name(f"{target.name}.vtu")
    with files.atomic_file(target, "the fields") as part:
        write_vtu(part, points, cells, fields)
    return target


def with_pvd(path: str | os.PathLike[str]) -> Path:
    """The path with the ending `.pvd`; other dots, as in `run_v=1.5`, belong to the name."""
    path = checks.new_file("path", path)
    target = path if path.suffix.lower() == ".pvd" else path.with_name(f"{path.name}.pvd")
    if not target.stem.isprintable():
        raise InputError(
            f"the name of a series, {checks.shown(target.stem)}, has a character that XML lacks."
        )

    return target


def write_frames(
    target: Path,
    points: Array,
    cells: Sequence[tuple[str, IntArray]],
    times: Array,
    fields: Iterable[Array],
) -> None:
    """Write one file of displacements (points, 3) [m] for each time, then their list `target`."""
    try:
        target.parent.mkdir(parents=True, exist_ok=True)
        target.unlink(missing_ok=True)
        names = []
        for number, field in enumerate(fields):
            names.append(f"{target.stem}_{number:04d}.vtu")
            write_vtu(target.with_name(names[-1]), points, cells, {"displacement": field})
        files.write_text(target, _collection(times, names), "the series")
    except OSError as error:
        raise files.write_error("the series", target, error) from error


def _collection(times: Array, names: list[str]) -> str:
    """Text of the `.pvd` file that lists `names` with their times."""
    entries = [
        f'    <DataSet timestep="{time:.9e}" file="{escape(name)}"/>\n'
        for time, name in zip(times, names, strict=True)
    ]
    return (
        '<?xml version="1.0" encoding="utf-8"?>\n<VTKFile type="Collection" version="0.1">\n'
        "  <Collection>\n" + "".join(entries) + "  </Collection>\n</VTKFile>\n"
    )
