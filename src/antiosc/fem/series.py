"""A series of displacement fields for ParaView: a `.pvd` file that lists `.vtu` files."""

from __future__ import annotations

import os
import re
import shutil
import stat
import tempfile
from collections.abc import Iterable
from pathlib import Path
from xml.sax.saxutils import quoteattr, unescape

from antiosc import checks, files
from antiosc._types import Array
from antiosc.errors import InputError
from antiosc.fem.vtu import Frames

#: With what the name of a temporary folder begins.
PREFIX = ".antiosc-"


def listing(path: str | os.PathLike[str]) -> Path:
    """The `.pvd` file of a series: `path` with the suffix `.pvd`.

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
    """Write one frame for each time, and at last their list to `target` (from `listing`).

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
        staging = Path(tempfile.mkdtemp(prefix=PREFIX, dir=target.parent))
        listed = False
        try:
            names = []
            for number, field in enumerate(fields):
                names.append(f"{target.stem}_{number:04d}.vtu")
                files.write_through(staging / names[-1], frames.content({"displacement": field}))
            old = _listed(target)
            staged = [f"{staging.name}/{name}" for name in names]
            files.write_text(target, _collection(times, staged), "the series")
            listed = True
            for name in old:
                (target.parent / name).unlink(missing_ok=True)
            for name in names:
                (staging / name).chmod(stat.S_IMODE(target.stat().st_mode))
                _second_name(staging / name, target.parent / name)
            files.write_text(target, _collection(times, names), "the series")
            listed = False
        finally:
            if not listed:
                shutil.rmtree(staging, ignore_errors=True)
    except OSError as error:
        raise files.cannot_write("the series", target, error) from error
    for folder in {(target.parent / name).parent for name in old} - {target.parent}:
        shutil.rmtree(folder, ignore_errors=True)


def _second_name(frame: Path, name: Path) -> None:
    """A further name for a file; a copy where the file system knows one name only."""
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


def _listed(target: Path) -> list[str]:
    """The frames beside `target` that it lists: those of its own name, whatever else it says."""
    try:
        text = target.read_text(encoding="utf-8") if target.is_file() else ""
    except UnicodeDecodeError:
        return []
    own = re.compile(f"({re.escape(PREFIX)}[^/]+/)?{re.escape(target.stem)}_\\d{{4,}}\\.vtu")
    quoted = re.findall(r"""file=(?:"([^"]*)"|'([^']*)')""", text)
    names = (unescape(a or b, {"&quot;": '"', "&apos;": "'"}) for a, b in quoted)
    return [name for name in names if own.fullmatch(name)]
