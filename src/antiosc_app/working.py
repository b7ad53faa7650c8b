"""One thread computes for a page, and drops work that a later set-up has made needless."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable
from concurrent.futures import CancelledError, ThreadPoolExecutor
from typing import Any

from antiosc.base import progress

#: What a page is told whose work was overtaken.
STALE_ANSWER: dict[str, Any] = {"stale": True}


class WorkOvertaken(BaseException):
    """Stops work for which the page no longer waits.

    It is not an Exception, so that no computation catches it as an error.
    """


class PageWorker:
    """Computes tasks in turn on one thread; a task of an earlier turn stops at its next step."""

    def __init__(self) -> None:
        self.turn = 0
        self._thread = ThreadPoolExecutor(max_workers=1, thread_name_prefix="antiosc")
        self._lock = threading.Lock()
        self._closed = False
        self._doing = ""
        self._began = time.monotonic()

    def next_turn(self) -> int:
        """Begin a turn, which makes tasks of earlier turns stale; returns its number."""
        with self._lock:
            self.turn += 1
        return self.turn

    def close(self) -> None:
        """Accept no further work; a running computation ends at its next step."""
        self._closed = True
        self._thread.shutdown(wait=False, cancel_futures=True)

    def progress(self) -> dict[str, Any]:
        """`doing`: text of the present step; `lasted`: time [s] since the task began."""
        return {"doing": self._doing, "lasted": time.monotonic() - self._began}

    def compute(self, work: Callable[[], dict[str, Any]], turn: int | None = None) -> Any:
        """The result of `work`; STALE if a turn after `turn` begins before it ends.

        Work without a turn never becomes stale.
        """

        def stop_if_asked(doing: str) -> None:
            self._doing = doing
            if doing and (self._closed or turn not in (None, self.turn)):
                raise WorkOvertaken

        def run_work() -> dict[str, Any]:
            if turn not in (None, self.turn):
                return STALE_ANSWER
            self._began = time.monotonic()
            try:
                with progress.following_progress(stop_if_asked):
                    return work()
            except WorkOvertaken:
                return STALE_ANSWER

        try:
            return self._thread.submit(run_work).result()
        except CancelledError:  # the program ends
            return STALE_ANSWER
