"""Formats of matrix files that packages register as entry points of `antiosc.matrices`."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any, NamedTuple

from antiosc.io.matrices.entries import Entries, Labels
from antiosc.io.matrices.source import Source
from antiosc.io.registered import loaded, registered


class MatrixFormat(NamedTuple):
    """How matrices of one format are recognised, read and written."""

    #: whether a file with this content is of the format
    matches: Callable[[bytes], bool]
    #: the matrix of a file, or several by their names
    read: Callable[[Source], Entries | dict[str, Entries]]
    #: writes symmetric matrices by their names, with node and dof of each row
    write: Callable[[Path, dict[str, Any], Labels], None] | None = None
    #: of the files that are written
    endings: tuple[str, ...] = ()
    #: whether the files hold node and dof of each row
    labelled: bool = False


def formats() -> list[MatrixFormat]:
    """The registered formats."""
    return [loaded(entry, MatrixFormat) for entry in registered("antiosc.matrices")]
