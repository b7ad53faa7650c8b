"""What long work does, on one line of the terminal, which is gone when the work ends.

Nothing is written where there is no terminal (files, pipes, notebooks), and on MPI ranks other than
the first.
"""

from __future__ import annotations

import os
import shutil
import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager

#: Carriage return, and the sequence that clears the line.
CLEAR = "\r\x1b[2K"

#: what is being done, the outermost first
_lines: list[str] = []


@contextmanager
def doing(text: str, rank: int = 0) -> Iterator[Callable[[str], None]]:
    """Show `text` while the block runs; call the function it gives to add how far it is."""
    _lines.append(text)
    place = len(_lines) - 1

    def further(more: str) -> None:
        _lines[place] = f"{text}: {more}"
        _write(rank)

    _write(rank)
    try:
        yield further
    finally:
        del _lines[place:]
        _write(rank)


def _write(rank: int) -> None:
    """The innermost work on the line; nothing if there is none."""
    stream = sys.stderr
    try:
        if rank or stream is None or not stream.isatty() or os.environ.get("TERM") == "dumb":
            return
        width = shutil.get_terminal_size().columns - 1
        line = f"antiosc: {_lines[-1]} …"[:width] if _lines else ""
        stream.write(CLEAR + line)
        stream.flush()
    except (OSError, ValueError):  # a terminal that was closed
        return
