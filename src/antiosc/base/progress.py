"""The progress of long work on one line of the terminal, which is erased at the end.

If the amount of work is known, the line shows the remaining share. The command tells how long it
lasts too, in files and pipes by a line after half a minute and then ever fewer ones.

A notebook shows the line below the cell, and in the end how long the work took. Otherwise nothing
is written to files and pipes, and on MPI ranks other than the first.
"""

from __future__ import annotations

import importlib
import os
import re
import shutil
import sys
import threading
import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager, suppress
from typing import Any, TextIO

#: Carriage return, and the sequence that clears the line.
CLEAR = "\r\x1b[2K"

#: How much of a work is done, in its text.
COUNTED = re.compile(r"\b\d+ of \d+\b")
#: Seconds between two changes of a count.
REFRESH = 0.1
#: Seconds between two looks at the clock of lasting work, from which on a terminal shows it, and
#: after which a line is printed elsewhere.
TICK, LASTS, FIRST_LINE = 1.0, 5.0, 30.0
#: Seconds of work from which a notebook keeps the line that tells them.
KEPT_FROM = 1.0

#: Variables in which mpirun tells a process its rank: of Open MPI, and of MPICH and its kin.
RANK = ("OMPI_COMM_WORLD_RANK", "PMI_RANK", "PMIX_RANK")


class _Lines(threading.local):
    """The texts of the current work of this thread, the outermost first."""

    def __init__(self) -> None:
        self.texts: list[str] = []
        #: what is told of each change besides
        self.told: Callable[[str], None] | None = None
        #: the line in a notebook, when it began, and when it was written last
        self.shown: Any = None
        self.work = ""
        self.began = self.written = 0.0

    @property
    def innermost(self) -> str:
        """The innermost work, behind the last work around it that is counted; "" without any."""
        return _innermost(self.texts)


def _innermost(texts: list[str]) -> str:
    """The last text, behind the last one before it that is counted; "" without any."""
    counted = [text for text in texts[:-1] if COUNTED.search(text)]
    return " – ".join([*counted[-1:], *texts[-1:]])


_lines = _Lines()


@contextmanager
def doing(text: str, rank: int = 0) -> Iterator[Callable[[str], None]]:
    """Show `text` while the block runs; yields a function that appends text to it."""
    lines = _lines.texts
    index = len(lines)
    lines.append(text)

    def append_text(further_text: str) -> None:
        lines[index] = f"{text}: {further_text}"
        _write(rank)

    try:
        _write(rank)
        yield append_text
    finally:
        del lines[index:]
        _write(rank)


@contextmanager
def following(tell: Callable[[str], None]) -> Iterator[None]:
    """Call `tell` with the text of this thread's work when it changes, and with "" at the end.

    What `tell` raises ends the work.
    """
    _lines.told = tell
    try:
        yield
    finally:
        _lines.told = None


@contextmanager
def with_time(stream: TextIO | None = None) -> Iterator[None]:
    """Tell beside the work of this thread how long the block has run.

    On the line of a terminal from `LASTS` on; elsewhere a line is printed after `FIRST_LINE`, then
    each time after twice as long, so that a log shows that it goes on.
    """
    target = sys.stderr if stream is None else stream
    if world_rank() or target is None:
        yield
        return
    ended = threading.Event()
    clock = threading.Thread(target=_tell_time, args=(_lines.texts, target, ended), daemon=True)
    clock.start()
    try:
        yield
    finally:
        ended.set()
        clock.join()
        if _is_terminal(target):
            _show(target, "")


def _tell_time(texts: list[str], stream: TextIO, ended: threading.Event) -> None:
    """Tell how long the work lasts whose texts another thread keeps, until it ends."""
    began, told = time.monotonic(), FIRST_LINE
    while not ended.wait(TICK):
        text = _innermost(texts)
        seconds = time.monotonic() - began
        if not text:
            continue
        with suppress(OSError, ValueError):  # a stream that was closed
            if _is_terminal(stream) and seconds >= LASTS:
                _show(stream, f"{seconds_text(seconds)}: {text}")
            elif not _is_terminal(stream) and seconds >= told:
                told *= 2
                print_text(f"antiosc: {text} … ({seconds_text(seconds)} so far)", stream)


@contextmanager
def counting(text: str, total: int, rank: int = 0) -> Iterator[Callable[[int], None]]:
    """Show how many of `total` are done and the remaining time; yields a function of the number
    done.
    """
    start_time = shown_time = time.monotonic()
    with doing(text, rank) as report:

        def done(count: int) -> None:
            nonlocal shown_time
            now = time.monotonic()
            if now - shown_time >= REFRESH or count >= total:
                shown_time = now
                report(progress_text(count, total, now - start_time))

        yield done


def progress_text(count: int, total: int, elapsed: float) -> str:
    """How many of `total` are done after `elapsed` seconds, and how long the others will take.

    Of a number that is estimated more may be done.
    """
    text = f"{min(count, total)} of {total}"
    if 0 < count < total:
        text += f", about {seconds_text(elapsed * (total - count) / count)} left"
    return text


def seconds_text(seconds: float) -> str:
    """A time in words: 12 s, 3 min, 2 h."""
    if seconds < 100:
        return f"{seconds:.0f} s"
    return f"{seconds / 60:.0f} min" if seconds < 6000 else f"{seconds / 3600:.0f} h"


def range_text(ends: Sequence[float]) -> str:
    """Times [s], the shortest first, as one: "12 s", "30 s to 4 min"."""
    texts = [seconds_text(max(end, 1.0)) for end in ends]
    return " to ".join(dict.fromkeys([texts[0], texts[-1]]))


def _write(rank: int) -> None:
    """Write the innermost work on the line, or clear the line if there is none."""
    if _lines.told is not None:
        _lines.told(_lines.innermost)
    stream = sys.stderr
    if not rank and not world_rank() and _in_notebook():
        _write_in_notebook()
        return
    if not (rank or world_rank() or stream is None) and _is_terminal(stream):
        _show(stream, _lines.innermost)


def _is_terminal(stream: TextIO) -> bool:
    """Whether a line of a stream can be replaced."""
    try:
        return stream.isatty() and os.environ.get("TERM") != "dumb"
    except ValueError:  # it was closed
        return False


def _show(stream: TextIO, text: str) -> None:
    """Replace the line of a terminal; "" clears it."""
    try:
        width = shutil.get_terminal_size().columns - 1
        stream.write(CLEAR + (f"antiosc: {text} …"[:width] if text else ""))
        stream.flush()
    except (OSError, ValueError):  # a terminal that was closed
        return


def _in_notebook() -> bool:
    """Whether this process is the kernel of a notebook."""
    ipython = sys.modules.get("IPython")
    current = getattr(ipython, "get_ipython", None)
    shell = current() if current is not None else None
    return hasattr(shell, "kernel") and threading.current_thread() is threading.main_thread()


def _write_in_notebook() -> None:
    """Show the innermost work below the cell, and at the end the work and its duration."""
    now = time.monotonic()
    if _lines.shown is None:
        if not _lines.texts:
            return
        _lines.began = now
        _lines.work = _lines.texts[0]
    elif _lines.texts and now - _lines.written < REFRESH:
        return
    elapsed = now - _lines.began
    text = (
        f"antiosc: {_lines.innermost} …"
        if _lines.texts
        else f"antiosc: {_lines.work}: {elapsed:.1f} s"
    )
    line = {"text/plain": text if _lines.texts or elapsed >= KEPT_FROM else ""}
    if _lines.shown is None:
        display = importlib.import_module("IPython.display").display
        _lines.shown = display(line, raw=True, display_id=True)
    else:
        _lines.shown.update(line, raw=True)
    _lines.written = now
    if not _lines.texts:
        _lines.shown = None


def world_rank() -> int:
    """Rank of this process as its MPI launcher states it, without loading mpi4py."""
    mpi = sys.modules.get("mpi4py.MPI")
    if mpi is not None:
        return int(mpi.COMM_WORLD.rank)
    rank_text = next((os.environ[name] for name in RANK if name in os.environ), "0")
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
