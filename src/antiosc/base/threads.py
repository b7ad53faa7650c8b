"""Number of BLAS threads: one, unless a factorization is large and cores are free.

OpenBLAS threads synchronise in busy loops, thousands of times in one sparse factorization. If
another program uses one of the cores, they wait for it as well, and two threads take up to nine
times as long as one. If all cores are free, only large fronts become faster. A number of threads
that the user has set in the environment is respected; other libraries are not changed.
`benchmarks/blas_threads.py` measures it.
"""

from __future__ import annotations

import os
import time
from collections import Counter
from collections.abc import Iterator
from contextlib import contextmanager
from functools import cache
from pathlib import Path
from threading import Lock, get_ident
from typing import TYPE_CHECKING, Any

import numpy as np

from antiosc.base._types import Array
from antiosc.base.isolation import restored

if TYPE_CHECKING:
    from threadpoolctl import ThreadpoolController

#: Variables by which users choose a number of threads; the first one that is set counts.
VARIABLES = (
    *("OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS", "BLIS_NUM_THREADS", "GOTO_NUM_THREADS"),
    "OMP_NUM_THREADS",
)
#: Operations of a front for each thread: with fewer, threads spend their time on waiting.
WORK_PER_THREAD = 5e8
#: Twice as many threads pay where they leave at most this share of the time.
PAYS = 0.8
#: Looks at what runs on this machine, of which the median counts, and seconds between them.
LOOKS, LOOK_PAUSE = 5, 0.004


def chosen() -> tuple[str, str] | None:
    """(variable, number of threads) set by the user in the environment, or None."""
    return next(((name, os.environ[name]) for name in VARIABLES if os.environ.get(name)), None)


def cores() -> int:
    """Number of cores that this process may use (affinity and quota of the container)."""
    affinity = getattr(os, "sched_getaffinity", None)  # of Linux
    allowed = len(affinity(0)) if affinity else os.cpu_count() or 1
    quota = _text("/sys/fs/cgroup/cpu.max").split()
    if len(quota) == 2 and quota[0].isdigit():
        allowed = min(allowed, max(1, int(quota[0]) // int(quota[1])))
    return allowed


def free_cores() -> int:
    """Number of them that are idle, at least 1; 1 if this is unknown."""
    allowed = cores()
    if allowed == 1:
        return 1
    looks = []
    for _ in range(LOOKS):
        others = _running_elsewhere()
        if others is None:
            return 1
        looks.append(others)
        time.sleep(LOOK_PAUSE)
    idle = (os.cpu_count() or 1) - int(np.median(looks))
    return max(1, min(allowed, idle))


def _running_elsewhere() -> int | None:
    """Threads of other processes that run or wait for a core; None where /proc is missing."""
    load = _text("/proc/loadavg").split()
    if len(load) < 4:
        return None
    own = sum(
        _text(path).rpartition(")")[2].split()[:1] == ["R"]
        for path in Path("/proc/self/task").glob("*/stat")
    )
    return max(0, int(load[3].partition("/")[0]) - max(1, own))


def _text(path: str | Path) -> str:
    try:
        return Path(path).read_text()
    except OSError:
        return ""


def worth(fronts: Array, free: int) -> int:
    """Useful number of threads, at most `free`, for dense fronts of these operation counts."""

    def cost(threads: int) -> float:
        return float(np.sum(fronts / np.clip(fronts / WORK_PER_THREAD, 1, threads)))

    threads = 1
    while threads < free and cost(min(2 * threads, free)) < PAYS * cost(threads):
        threads = min(2 * threads, free)
    return threads


class _Blas:
    """The thread pools of the BLAS libraries that are loaded, kept at one thread while in use."""

    def __init__(self, controller: ThreadpoolController) -> None:
        self.controller = controller
        self.lock = Lock()
        self.users: Counter[int] = Counter()  # calls under way, by the Python thread
        self.limit: Any = None
        self.before = 1

    def pools(self) -> list[dict[str, Any]]:
        """The data of threadpoolctl on each BLAS."""
        return [pool for pool in self.controller.info() if pool["user_api"] == "blas"]

    def enter(self) -> None:
        with self.lock:
            if not self.users:
                self.before = max((pool["num_threads"] for pool in self.pools()), default=1)
                self.limit = self.controller.limit(limits=1, user_api="blas")
            self.users[get_ident()] += 1

    def leave(self) -> None:
        with self.lock:
            self.users[get_ident()] -= 1
            self.users += Counter()  # drops the zeros
            if not self.users:
                self.limit.restore_original_limits()


def _blas() -> _Blas | None:
    """The same for all Python threads; None where threadpoolctl is not installed."""
    with _making:
        return _made()


_making = Lock()


@cache
def _made() -> _Blas | None:
    try:
        with restored():
            from threadpoolctl import ThreadpoolController
    except ImportError:
        return None
    import scipy.linalg  # noqa: F401  (loads the BLAS)

    return _Blas(ThreadpoolController())


def pools() -> list[dict[str, Any]] | None:
    """The data of threadpoolctl on each loaded BLAS; None if it is not installed."""
    blas = _blas()
    return None if blas is None else blas.pools()


@contextmanager
def one_thread() -> Iterator[None]:
    """Use one BLAS thread inside the block or the decorated function."""
    blas = None if chosen() else _blas()
    if blas is None:
        yield
        return
    blas.enter()
    try:
        yield
    finally:
        blas.leave()


@contextmanager
def as_many_as_pay(fronts: Array) -> Iterator[int | None]:
    """Use the useful number of threads for dense fronts with these numbers of operations.

    Never more than at the start of the process, and one if another calculation of this process is
    running. Yields the number, or None if the user has chosen it.
    """
    blas = None if chosen() else _blas()
    if blas is None:
        yield None
        return
    with one_thread():
        most = min(blas.before, cores()) if len(blas.users) == 1 else 1
        threads = worth(fronts, most)
        if threads > 1:
            threads = worth(fronts, min(most, free_cores()))
        with blas.controller.limit(limits=threads, user_api="blas"):
            yield threads
