"""One answer on all MPI ranks: work done on rank 0, and errors that every rank raises."""

from __future__ import annotations

from collections.abc import Callable
from typing import TypeVar

import numpy as np
from mpi4py import MPI
from numpy.typing import NDArray

T = TypeVar("T")


def on_root(comm: MPI.Comm, work: Callable[[], T]) -> T:
    """The result of `work()` done on rank 0 alone; its error, if any, is raised on all ranks."""
    result: T | None = None
    error: Exception | None = None
    if comm.rank == 0:
        try:
            result = work()
        except Exception as caught:
            error = caught
    result, error = comm.bcast((result, error), root=0)
    if error is not None:
        raise error
    return result  # type: ignore[return-value]


def agree(comm: MPI.Comm, error: Exception | None) -> None:
    """Raise the first error that any rank has, on every rank; return if none has one."""
    found = [e for e in comm.allgather(error) if e is not None]
    if found:
        raise found[0]


def bounds(
    comm: MPI.Comm, x: NDArray[np.float64]
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """(lowest, highest) coordinates over all ranks of points x (n, dim)."""
    dim = x.shape[1]
    low = x.min(axis=0) if len(x) else np.full(dim, np.inf)
    high = x.max(axis=0) if len(x) else np.full(dim, -np.inf)
    return np.min(comm.allgather(low), axis=0), np.max(comm.allgather(high), axis=0)
