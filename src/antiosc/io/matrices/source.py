"""A file of matrices as bytes and lines, with messages that name the file and the place."""

from __future__ import annotations

import os
import re
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from antiosc.base import checks
from antiosc.base._types import Array
from antiosc.base.errors import InputError

#: Numbers as Fortran writes them: 1.5D+03, 1.5+103 without a letter.
_FORTRAN = re.compile(rb"([0-9.])[dD]([+-]?[0-9])|([0-9.])([+-][0-9]{1,3})(?![0-9.])")


class Source:
    """The content of one file."""

    def __init__(self, path: str | os.PathLike[str]) -> None:
        checked = Path(checks.path("path", path))
        self.name = checked.name
        try:
            if not checked.is_file():
                what = "is a folder" if checked.is_dir() else "does not exist"
                raise InputError(f"the matrix file {os.fspath(path)!r} {what}.")
            self.content = checked.read_bytes()
        except OSError as error:
            reason = error.strerror or str(error)
            raise InputError(f"cannot read matrices from {os.fspath(path)!r}: {reason}.") from error
        if not self.content:
            raise InputError(f"{self.name} is empty.")

    def lines(self) -> list[bytes]:
        """Its lines without their ends."""
        return self.content.splitlines()

    def error(self, line: int, text: str) -> InputError:
        """The error for a line, counted from 1."""
        return InputError(f"{self.name}, line {line}: {text}")

    def needs(self, holds: object, line: int, text: str) -> None:
        """Raise the error for a line unless something holds."""
        if not holds:
            raise self.error(line, text)

    def at_byte(self, offset: int, text: str) -> InputError:
        """The error for a place in a binary file."""
        return InputError(f"{self.name}, byte {offset}: {text}")

    def table(self, lines: Sequence[bytes], numbers: Sequence[int], columns: int) -> Array:
        """Lines of `columns` numbers each: (lines, columns); `numbers` are those of the lines."""
        if not lines:
            return np.zeros((0, columns))
        rows = [line.replace(b",", b" ") for line in lines]
        found = _floats(b"\n".join(rows))
        if found is None or any(len(row.split()) != columns for row in rows):
            for row, line, number in zip(rows, lines, numbers, strict=True):
                self._check(row, line, number, columns)
        assert found is not None
        return found.reshape(-1, columns)

    def _check(self, row: bytes, line: bytes, number: int, columns: int) -> None:
        shown = line.decode("ascii", "replace").strip()[:60]
        if len(row.split()) != columns:
            raise self.error(number, f"{columns} numbers are expected; got {shown!r}.")
        if _floats(row) is None:
            raise self.error(number, f"{shown!r} is not {columns} numbers.")


def _floats(text: bytes) -> Array | None:
    """All numbers of a text; None if it contains anything else."""
    try:
        return np.array(text.split(), dtype=float)
    except ValueError:
        pass
    try:
        return np.array(fortran(text).split(), dtype=float)
    except ValueError:
        return None


def fortran(text: bytes) -> bytes:
    """The text with Fortran's exponents as others write them."""
    return _FORTRAN.sub(
        lambda m: m[1] + b"E" + m[2] if m[1] is not None else m[3] + b"E" + m[4], text
    )


def is_text(content: bytes) -> bool:
    """Whether the first bytes are those of a text."""
    head = content[:4096]
    return not any(byte < 9 or 13 < byte < 32 for byte in head)
