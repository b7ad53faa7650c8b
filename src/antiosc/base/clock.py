"""The clock of measured seconds. It stands still while finite elements are compiled or loaded."""

from __future__ import annotations

import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager

_uncounted = threading.local()


def clock() -> float:
    """Seconds of `time.perf_counter`, minus seconds of this thread within `uncounted`."""
    return time.perf_counter() - uncounted_seconds()


def uncounted_seconds() -> float:
    """Seconds of this thread within `uncounted` so far."""
    return getattr(_uncounted, "seconds", 0.0)


@contextmanager
def uncounted() -> Iterator[None]:
    """Context in which `clock` stands still; contexts may be nested."""
    start_time = clock()
    try:
        yield
    finally:
        _uncounted.seconds = uncounted_seconds() + clock() - start_time
