"""The progress of long work on one line of the terminal, which is erased at the end.

If the amount of work is known, the line shows how much is done. Nothing is written to files and
pipes, to notebooks, and on MPI ranks other than the first.
"""

from __future__ import annotations

import os
import re
import shutil
import sys
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import TextIO

#: Carriage return, and the sequence that clears the line.
CLEAR_LINE = "\r\x1b[2K"

#: Pattern of the progress count in a text.
COUNT_PATTERN = re.compile(r"\b\d+ of \d+\b")
#: Seconds between two changes of a count.
REFRESH_INTERVAL = 0.1

#: Environment variables with the MPI rank, set by the launchers of Open MPI, MPICH and others.
RANK_VARIABLES = ("OMPI_COMM_WORLD_RANK", "PMI_RANK", "PMIX_RANK")


class _WorkTexts(threading.local):
    """The texts of the current work of this thread, the outermost first."""

    def __init__(self) -> None:
        self.texts: list[str] = []
        #: function that is also called with the text of each change
        self.told: Callable[[str], None] | None = None

    @property
    def innermost(self) -> str:
        """Text of the innermost work, preceded by the text of counted work around it; or ""."""
        counted = [text for text in self.texts[:-1] if COUNT_PATTERN.search(text)]
        return " – ".join([*counted[-1:], *self.texts[-1:]])


_work_texts = _WorkTexts()


@contextmanager
def doing(text: str) -> Iterator[Callable[[str], None]]:
    """Show `text` while the block runs; yields a function that appends a text to it."""
    lines = _work_texts.texts
    index = len(lines)
    lines.append(text)

    def append_text(further_text: str) -> None:
        lines[index] = f"{text}: {further_text}"
        _write()

    try:
        _write()
        yield append_text
    finally:
        del lines[index:]
        _write()


@contextmanager
def following_progress(receiver: Callable[[str], None]) -> Iterator[None]:
    """Call `receiver` with the text of this thread's work when it changes; at the end with ""."""
    _work_texts.told = receiver
    try:
        yield
    finally:
        _work_texts.told = None


@contextmanager
def counting(text: str, total: int) -> Iterator[Callable[[int], None]]:
    """Show how many of `total` are done; yields a function that takes the number done."""
    shown_time = time.monotonic()

    with doing(text) as report:

        def set_count(count: int) -> None:
            nonlocal shown_time
            now = time.monotonic()
            if now - shown_time >= REFRESH_INTERVAL or count >= total:
                shown_time = now
                report(f"{min(count, total)} of {total}")

        yield set_count


def _write() -> None:
    """Write the innermost work on the line, or clear the line if there is none."""
    if _work_texts.told is not None:
        _work_texts.told(_work_texts.innermost)
    stream = sys.stderr
    if world_rank() or stream is None or os.environ.get("TERM") == "dumb":
        return

    text = _work_texts.innermost
    try:
        if stream.isatty():
            width = shutil.get_terminal_size().columns - 1
            stream.write(CLEAR_LINE + (f"antiosc: {text} …"[:width] if text else ""))
            stream.flush()
    except (OSError, ValueError):  # a terminal that was closed
        return


def world_rank() -> int:
    """Rank of this process as given by its MPI launcher, without loading mpi4py."""
    mpi = sys.modules.get("mpi4py.MPI")
    if mpi is not None:
        return int(mpi.COMM_WORLD.rank)

    rank_text = next((os.environ[name] for name in RANK_VARIABLES if name in os.environ), "0")
    if rank_text.isdigit():
        return int(rank_text)
    return 0


def print_text(text: str, stream: TextIO | None = None) -> None:
    """Print a text on rank 0; characters that the terminal cannot encode become "?"."""
    if world_rank():
        return
    target = sys.stdout if stream is None else stream
    try:
        print(text, file=target, flush=True)
    except UnicodeEncodeError:
        encoding = getattr(target, "encoding", None) or "ascii"
        print(text.encode(encoding, "replace").decode(encoding), file=target, flush=True)
