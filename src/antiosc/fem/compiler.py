"""Settings of FFCx while something is compiled, restored afterwards."""

from __future__ import annotations

import threading
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import IO, Any

import ffcx

from antiosc.errors import InputError
from antiosc.fem.compiled_forms import checked_folder
from antiosc.isolation import quiet, restored

FFCX = tuple(int(part) for part in ffcx.__version__.split(".")[:2])
#: Loggers that report every step; from 0.6 on FFCx itself keeps the root logger quiet.
NOISY = ("UFL", "FFCx", "ffcx", *([""] if FFCX < (0, 6) else []))

_lock = threading.RLock()


@contextmanager
def compiler() -> Iterator[None]:
    """Context in which forms are compiled: without log output, and correctly on shells in space.

    InputError if the system refuses to write the compiled files.
    """
    try:
        with _lock, restored(), quiet(*NOISY), _mended(), checked_folder():
            yield
    except OSError as error:
        raise InputError(
            "compiled finite elements cannot be written to "
            f"{error.filename or 'their cache folder'} ({error.strerror or error}): set "
            "XDG_CACHE_HOME, or HOME, to a folder that can be written."
        ) from error


@contextmanager
def _mended() -> Iterator[None]:
    """FFCx 0.5 without two faults; newer ones do not have them.

    It numbers derivatives by x, y, z, where Basix takes the directions of the cell: on a shell in
    space those of second and higher order differ. And it never closes the empty C file by which it
    claims a compilation, so that Python warns of it.
    """
    if FFCX >= (0, 6):
        yield
        return
    import ffcx.codegeneration.jit as jit
    import ffcx.ir.elementtables as tables

    if hasattr(jit, "open"):  # inside another such context
        yield
        return
    values = tables.get_ffcx_table_values

    def in_the_cell(points: Any, cell: Any, *others: Any) -> Any:
        *head, counts, component = others
        counts = counts[: cell.topological_dimension()]
        return values(points, cell, *head, counts, component)

    def claimed(path: Path, mode: str) -> IO[Any]:
        file = open(path, mode)  # noqa: SIM115
        if path.suffix == ".c":
            file.close()
        return file

    tables.get_ffcx_table_values, jit.open = in_the_cell, claimed
    try:
        yield
    finally:
        tables.get_ffcx_table_values = values
        del jit.open
