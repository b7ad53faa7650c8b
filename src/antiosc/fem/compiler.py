"""Settings of FFCx while something is compiled, restored afterwards."""

from __future__ import annotations

import threading
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

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
        with _lock, restored(), quiet(*NOISY), _derivatives_in_the_cell(), checked_folder():
            yield
    except OSError as error:
        raise InputError(
            "compiled finite elements cannot be written to "
            f"{error.filename or 'their cache folder'} ({error.strerror or error}): set "
            "XDG_CACHE_HOME, or HOME, to a folder that can be written."
        ) from error


@contextmanager
def _derivatives_in_the_cell() -> Iterator[None]:
    """Number derivatives by the directions of the cell, as Basix does; FFCx 0.5 uses x, y, z.

    On a shell in space the numbers of the first derivatives agree; those of higher ones do not.
    """
    if FFCX >= (0, 6):
        yield
        return
    import ffcx.ir.elementtables as tables

    values = tables.get_ffcx_table_values

    def in_the_cell(points: Any, cell: Any, *others: Any) -> Any:
        *head, counts, component = others
        counts = counts[: cell.topological_dimension()]
        return values(points, cell, *head, counts, component)

    tables.get_ffcx_table_values = in_the_cell
    try:
        yield
    finally:
        tables.get_ffcx_table_values = values
