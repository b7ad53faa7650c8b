"""The process: its BLAS threads, and the free memory of its machine.

**Threads.** There is one BLAS thread, and for large factorizations one fewer than there are cores,
so that a repeated run gives the same digits. OpenBLAS threads synchronise in busy loops: if another
program uses one of their cores, two take up to nine times as long as one. A number of threads set
in the environment is respected; other libraries are not changed.

**Memory.** The free memory, the share of it that a run may use, and the message if it is too small.
"""

from __future__ import annotations

import ctypes
import os
from collections import Counter
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from functools import cache, wraps
from pathlib import Path
from threading import Lock, get_ident
from typing import TYPE_CHECKING, Any, ParamSpec, TypeAlias, TypeVar

import numpy as np

from antiosc.base._types import Array
from antiosc.base.errors import OutOfMemoryError

if TYPE_CHECKING:
    from threadpoolctl import ThreadpoolController

#: Environment variables by which users set the number of threads.
THREAD_VARIABLES = (
    *("OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS", "BLIS_NUM_THREADS", "GOTO_NUM_THREADS"),
    "OMP_NUM_THREADS",
)
#: Operations of a front for each thread: with fewer, threads spend their time on waiting.
WORK_PER_THREAD = 5e8
#: The number of threads is doubled if this reduces the time to less than this share.
WORTHWHILE_RATIO = 0.8


def return_free_memory() -> None:
    """Give freed memory, which glibc retains, back to the system."""
    trim = getattr(ctypes.CDLL(None), "malloc_trim", None) if os.name == "posix" else None
    if trim:
        trim(0)


def user_sets_threads() -> bool:
    """Whether the user has set a number of threads in the environment."""
    return any(os.environ.get(name) for name in THREAD_VARIABLES)


def core_count() -> int:
    """Number of cores that this process may use (affinity and quota of the container)."""
    affinity = getattr(os, "sched_getaffinity", None)  # of Linux
    allowed = len(affinity(0)) if affinity else os.cpu_count() or 1
    quota = " ".join(_lines(f"{CGROUP_FOLDER}/cpu.max")).split()
    if len(quota) == 2 and quota[0].isdigit():
        allowed = min(allowed, max(1, int(quota[0]) // int(quota[1])))
    return allowed


def free_threads() -> int:
    """Number of threads for independent work: all cores, or one if BLAS cannot be limited."""
    return 1 if user_sets_threads() or _blas() is None else core_count()


def useful_threads(front_operations: Array, most_threads: int) -> int:
    """Useful number of threads, at most `most_threads`, for dense fronts of `front_operations`."""

    def cost(threads: int) -> float:
        return float(
            np.sum(front_operations / np.clip(front_operations / WORK_PER_THREAD, 1, threads))
        )

    threads = 1
    while threads < most_threads and cost(min(2 * threads, most_threads)) < WORTHWHILE_RATIO * cost(
        threads
    ):
        threads = min(2 * threads, most_threads)
    return threads


#: data of threadpoolctl on a BLAS library
BlasPool: TypeAlias = dict[str, Any]


class _Blas:
    """The thread pools of the loaded BLAS libraries, kept at one thread while in use."""

    def __init__(self, controller: ThreadpoolController) -> None:
        self.controller = controller
        self.lock = Lock()
        self.users: Counter[int] = Counter()  # calls under way, by the Python thread
        self.limit: Any = None  # threadpoolctl's, while in use
        self.before = 1  # number of threads before

    def pools(self) -> list[BlasPool]:
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


@cache
def _blas() -> _Blas | None:
    """The BLAS libraries of this process, for all Python threads; None without threadpoolctl."""
    from antiosc.base.packages import restored  # loaded where it is used

    try:
        with restored():
            from threadpoolctl import ThreadpoolController
    except ImportError:
        return None

    import scipy.linalg  # noqa: F401  (loads the BLAS)

    return _Blas(ThreadpoolController())


def blas_pools() -> list[BlasPool] | None:
    """The data of threadpoolctl on each loaded BLAS; None if it is not installed."""
    blas = _blas()
    if blas is None:
        return None
    return blas.pools()


@contextmanager
def one_thread() -> Iterator[None]:
    """Use one BLAS thread inside the block or the decorated function."""
    blas = None if user_sets_threads() else _blas()
    if blas is None:
        yield
        return

    blas.enter()
    try:
        yield
    finally:
        blas.leave()


@contextmanager
def blas_threads(front_operations: Array) -> Iterator[int | None]:
    """Context with the useful number of BLAS threads for `front_operations`; yields this number."""
    blas = None if user_sets_threads() else _blas()
    if blas is None:
        yield None
        return

    with one_thread():
        limit = min(blas.before, core_count() - 1) if len(blas.users) == 1 else 1
        threads = useful_threads(front_operations, limit)
        with blas.controller.limit(limits=threads, user_api="blas"):
            yield threads


P = ParamSpec("P")
T = TypeVar("T")

#: Share of the free memory that a factor, a basis or a run may fill.
MEMORY_SHARE = 0.9
#: Folder of a container's limits.
CGROUP_FOLDER = "/sys/fs/cgroup"
#: Bytes below which the free memory is not looked up: that takes longer than a short run.
NEGLIGIBLE_BYTES = 1 << 26
#: Remedy where a run needs too much.
MEMORY_REMEDY = "use a coarser mesh or elements of order 1, or free some memory"


def free_memory() -> float:
    """Free memory of this machine, or of its container or process limit, in bytes."""
    free = np.inf
    for line in _lines("/proc/meminfo"):
        if line.startswith("MemAvailable:"):
            free = 1024 * float(line.split()[1])

    limit, used, stat = (_lines(f"{CGROUP_FOLDER}/memory.{x}") for x in ("max", "current", "stat"))
    if limit and used and limit[0].isdigit():
        # the kernel gives up cached files first
        cached = [line.split()[1] for line in stat if line.startswith("inactive_file ")]
        free = min(free, float(limit[0]) - float(used[0]) + float((cached or ["0"])[0]))

    return min(free, _process_limit())


def _process_limit() -> float:
    """Bytes that the memory limit of this process (ulimit -v) leaves free."""
    try:
        import resource
    except ImportError:  # no Unix
        return np.inf

    limit = resource.getrlimit(resource.RLIMIT_AS)[0]
    pages = _lines("/proc/self/statm")
    if limit == resource.RLIM_INFINITY or not pages:
        return np.inf
    return float(limit - int(pages[0].split()[0]) * resource.getpagesize())


def require_memory(
    needed_bytes: float, what: str, remedy: str, free_bytes: float | None = None
) -> None:
    """OutOfMemoryError "`what` needs 3 GB and 2 GB are free: `remedy`." if memory is too small."""
    if free_bytes is None and needed_bytes < NEGLIGIBLE_BYTES:
        return
    free_bytes = free_memory() if free_bytes is None else free_bytes
    if needed_bytes > MEMORY_SHARE * free_bytes:
        raise OutOfMemoryError(f"{shortage_text(what, needed_bytes, free_bytes)}: {remedy}.")


def shortage_text(what: str, needed_bytes: float, free_bytes: float) -> str:
    """The sentence that something needs more memory than is free, without the remedy."""
    return f"{what} needs about {needed_bytes / 1e9:.3g} GB and {free_bytes / 1e9:.3g} GB are free"


def allocation_error(
    what: str, error: BaseException | None = None, remedy: str = MEMORY_REMEDY
) -> OutOfMemoryError:
    """The error for an allocation that failed in the step `what`."""
    reason = "" if error is None else f" ({str(error) or 'Python itself'})"
    return OutOfMemoryError(f"{what} ran out of memory{reason}: {remedy}.")


def within_memory(function: Callable[P, T]) -> Callable[P, T]:
    """Decorate `function`: a MemoryError in it becomes an OutOfMemoryError."""
    name = function.__qualname__.removesuffix(".__init__").removesuffix(".__new__")

    @wraps(function)
    def guarded(*args: P.args, **kwargs: P.kwargs) -> T:
        try:
            return function(*args, **kwargs)
        except OutOfMemoryError:
            raise
        except MemoryError as error:
            raise allocation_error(name, error) from error

    return guarded


def _lines(path: str) -> list[str]:
    try:
        return Path(path).read_text().splitlines()
    except OSError:
        return []
