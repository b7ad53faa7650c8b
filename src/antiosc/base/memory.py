"""The free memory, how much of it a run may take, and the one sentence for too little of it."""

from __future__ import annotations

import ctypes
import os
from collections.abc import Callable
from functools import wraps
from pathlib import Path
from typing import ParamSpec, TypeVar

import numpy as np

from antiosc.base.errors import OutOfMemoryError

P = ParamSpec("P")
T = TypeVar("T")

#: Share of the free memory that a factor, a basis or a run may fill.
MEMORY_SHARE = 0.9
#: Files of a container's limit, of what it uses, and of the cached files among that, which the
#: kernel gives up first: cgroup 2, and cgroup 1.
CONTAINERS = (
    ("/sys/fs/cgroup/memory.max", "/sys/fs/cgroup/memory.current", "/sys/fs/cgroup/memory.stat"),
    tuple(
        f"/sys/fs/cgroup/memory/memory.{x}" for x in ("limit_in_bytes", "usage_in_bytes", "stat")
    ),
)
#: Bytes below which the free memory is not looked up: that takes longer than a short run.
UNNOTICED = 1 << 26
#: Remedy where a run needs too much.
SMALLER = "use a coarser mesh or order=1, or free some memory"


def free_memory() -> float:
    """Free memory of this machine, or of its container or process limit, in bytes."""
    free = np.inf
    for line in _lines("/proc/meminfo"):
        if line.startswith("MemAvailable:"):
            free = 1024 * float(line.split()[1])
    for limit, usage, stat in CONTAINERS:
        most, used = _lines(limit), _lines(usage)
        if most and used and most[0].isdigit():
            cached = [line.split()[1] for line in _lines(stat) if line.startswith("inactive_file ")]
            free = min(free, float(most[0]) - float(used[0]) + float((cached or ["0"])[0]))
    return min(free, _left_of_process())


def give_back() -> None:
    """Return freed memory to the system, which glibc keeps for itself, so that it counts as free."""
    trim = getattr(ctypes.CDLL(None) if os.name == "posix" else None, "malloc_trim", None)
    if trim is not None:
        trim(0)


def _left_of_process() -> float:
    """What the limit of this process (ulimit -v) leaves it, in bytes."""
    try:
        import resource
    except ImportError:  # no Unix
        return np.inf
    limit = resource.getrlimit(resource.RLIMIT_AS)[0]
    pages = _lines("/proc/self/statm")
    if limit == resource.RLIM_INFINITY or not pages:
        return np.inf
    return float(limit - int(pages[0].split()[0]) * resource.getpagesize())


def require(need: float, what: str, remedy: str, free: float | None = None) -> None:
    """OutOfMemoryError unless `need` bytes fit in the free memory.

    Parameters
    ----------
    what, remedy : parts of the sentence "`what` needs 3 GB and 2 GB are free: `remedy`."
    free : bytes, where they are known from before.

    Less than `UNNOTICED` passes.
    """
    if free is None and need < UNNOTICED:
        return
    free = free_memory() if free is None else free
    if need > MEMORY_SHARE * free:
        raise OutOfMemoryError(f"{shortage(what, need, free)}: {remedy}.")


def shortage(what: str, need: float, free: float) -> str:
    """That something needs more memory than is free, without a remedy."""
    return f"{what} needs about {need / 1e9:.3g} GB and {free / 1e9:.3g} GB are free"


def ran_out(
    what: str, error: BaseException | None = None, remedy: str = SMALLER
) -> OutOfMemoryError:
    """The error for an allocation that failed in `what`."""
    said = "" if error is None else f" ({str(error) or 'Python itself'})"
    return OutOfMemoryError(f"{what} ran out of memory{said}: {remedy}.")


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
            raise ran_out(name, error) from error

    return guarded


def _lines(path: str) -> list[str]:
    try:
        return Path(path).read_text().splitlines()
    except OSError:
        return []
