"""The ranks of MPI: work on rank 0, errors raised on all ranks.

Without mpi4py there is one process, whose communicator is `SERIAL`. The caller must pass equal
arguments on all ranks.
"""

from __future__ import annotations

import functools
import pickle
import sys
import threading
from collections.abc import Callable, Iterable, Mapping
from contextlib import nullcontext
from operator import attrgetter
from types import TracebackType
from typing import Any, ParamSpec, TypeVar

import numpy as np

from antiosc.base import errors
from antiosc.base._types import Array
from antiosc.base.errors import AntioscWarning, InputError
from antiosc.base.process import within_memory


def is_petsc(value: object) -> bool:
    """Whether `value` is a PETSc object; petsc4py need not be installed."""
    return any(kind.__module__ == "petsc4py.PETSc" for kind in type(value).__mro__)


P = ParamSpec("P")
T = TypeVar("T")


class Serial:
    """The methods of an MPI communicator that antiosc uses, for one rank."""

    rank = 0
    size = 1

    def allreduce(self, value: T) -> T:
        """The value itself: the sum over one rank."""
        return value

    def allgather(self, value: T) -> list[T]:
        """The values of all ranks."""
        return [value]

    def gather(self, value: T, root: int = 0) -> list[T]:
        """The values of all ranks, on `root`."""
        return [value]

    def bcast(self, value: T, root: int = 0) -> T:
        """The value of rank `root`."""
        return value


SERIAL = Serial()


MPI: Any
try:
    from mpi4py import MPI
except ImportError:  # given matrices need none
    MPI = None

#: Communicators of all processes, and of this process.
WORLD, ALONE = (SERIAL, SERIAL) if MPI is None else (MPI.COMM_WORLD, MPI.COMM_SELF)


def end_all_ranks(
    kind: type[BaseException], error: BaseException, trace: TracebackType | None
) -> None:
    """Print an uncaught error and end all ranks, which would otherwise wait for this one."""
    sys.__excepthook__(kind, error, trace)
    sys.stderr.flush()
    MPI.COMM_WORLD.Abort(1)


if WORLD.size > 1 and sys.excepthook is sys.__excepthook__:
    sys.excepthook = end_all_ranks

#: Lock for PETSc, SLEPc and dolfinx, which only one thread may use; SciPy's matrices need none.
_packages = threading.RLock()


def collective(default: MPI.Comm = WORLD) -> Callable[[Callable[P, T]], Callable[P, T]]:
    """Decorator of functions that all ranks call: an error on one rank is raised on all ranks. They
    are those of the largest communicator of the arguments; of `default` if these have none."""

    def guard(function: Callable[P, T]) -> Callable[P, T]:
        guarded_call = within_memory(function)

        @functools.wraps(function)
        def guarded(*args: P.args, **kwargs: P.kwargs) -> T:
            comm = _communicator([*args, *kwargs.values()], default)
            if comm.size == 1:
                with nullcontext() if isinstance(comm, Serial) else _packages:
                    return guarded_call(*args, **kwargs)
            return done_on_all(comm, lambda: guarded_call(*args, **kwargs))

        return guarded

    return guard


def _communicator(values: Iterable[object], default: MPI.Comm) -> MPI.Comm:
    """The largest communicator of the values and of values in mappings; else `default`."""
    found = []
    for value in values:
        for item in value.values() if isinstance(value, Mapping) else [value]:
            if is_petsc(item) and not item:  # a call of an empty or destroyed one ends the process
                default = WORLD  # it may be a real one on other ranks
            elif (comm := _comm_of(item)) is not None:
                found.append(comm)

    comm = max(found, key=attrgetter("size"), default=default)
    return WORLD if same_ranks(comm, WORLD) else comm


def _comm_of(value: object) -> MPI.Comm | None:
    """The communicator of a value; None without one."""
    if MPI is not None and isinstance(value, MPI.Comm):
        if value == MPI.COMM_NULL:
            raise InputError("comm is MPI.COMM_NULL: call this only on its member ranks.")
        return value

    try:
        comm = getattr(value, "comm", None)
        if comm is None or isinstance(comm, Serial):
            return comm
        comm = comm if isinstance(comm, MPI.Comm) else comm.tompi4py()  # one of PETSc's
    except Exception:
        return None

    return None if comm == MPI.COMM_NULL else comm


def same_ranks(first: MPI.Comm, second: MPI.Comm) -> bool:
    """Whether two communicators have the same ranks in the same order."""
    if isinstance(first, Serial) or isinstance(second, Serial):
        return first is second
    return MPI.Comm.Compare(first, second) in (MPI.IDENT, MPI.CONGRUENT)


def on_root(comm: MPI.Comm, work: Callable[[], T]) -> T:
    """Do `work()` on rank 0 and return its result, or raise its error, on all ranks."""
    if comm.size == 1:
        return work()
    result, error = _tried(work) if comm.rank == 0 else (None, None)
    result, problem = comm.bcast((result, _portable(error)), root=0)
    _raise_first([problem], error)
    return result  # type: ignore[return-value]


def raise_on_all(comm: MPI.Comm, error: Exception | None) -> None:
    """Raise the first error of any rank on every rank; return if there is none."""
    _raise_first(comm.allgather(_portable(error)), error)


def done_on_all(comm: MPI.Comm, work: Callable[[], T]) -> T:
    """Do `work()` on each rank and return its result; the first error is raised on all ranks."""
    result, error = _tried(work)
    raise_on_all(comm, error)
    return result  # type: ignore[return-value]


def _tried(work: Callable[[], T]) -> tuple[T | None, Exception | None]:
    """(result of `work()`, None), or (None, the exception that it raised)."""
    try:
        return work(), None
    except Exception as error:
        return None, error


def warn(comm: MPI.Comm, message: str, category: type[Warning] = AntioscWarning) -> None:
    """Warn once, on rank 0; if filters turn the warning into an error, raise it on all ranks."""
    on_root(comm, lambda: errors.warn(message, category))


def _portable(error: Exception | None) -> Exception | None:
    """The error, or a substitute that can be pickled for the other ranks."""
    if error is None:
        return None

    try:
        pickle.loads(pickle.dumps(error))
    except Exception:
        return RuntimeError(f"{type(error).__name__}: {error}")
    return error


def _raise_first(errors: list[Exception | None], local_error: Exception | None) -> None:
    """Raise the first error of all ranks, if any; `local_error`: error of this rank or None."""
    first = next((error for error in errors if error is not None), None)
    if first is None:
        return
    if local_error is not None and str(_portable(local_error)) == str(first):
        raise local_error  # the same, with its traceback
    raise first


def bounds(comm: MPI.Comm, x: Array) -> tuple[Array, Array]:
    """(lowest, highest) coordinates (dim,) of points x (n, dim) over all ranks; n may be 0."""
    low, high = x.min(axis=0, initial=np.inf), x.max(axis=0, initial=-np.inf)
    return np.min(comm.allgather(low), axis=0), np.max(comm.allgather(high), axis=0)
