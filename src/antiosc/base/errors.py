"""The errors antiosc raises: one sentence with the number, the rule and the remedy."""

from __future__ import annotations

import difflib
import sys
import warnings
from collections.abc import Callable, Iterable, Iterator
from contextlib import AbstractContextManager, contextmanager
from contextvars import ContextVar


class AntioscError(Exception):
    """Base of all errors raised on purpose by antiosc."""


class InputError(AntioscError, ValueError):
    """The arguments break a rule that the message states."""


class MeshError(InputError):
    """A mesh that cannot be read, or that no element family supports."""


class NotConvergedError(AntioscError, RuntimeError):
    """A linear solver, an eigensolver or an integrator did not converge."""


class OutOfMemoryError(AntioscError, MemoryError):
    """There is not enough memory; the message states how much is needed."""


class AccuracyError(AntioscError, ArithmeticError):
    """A result failed its check, or lies outside the range of validity of its theory."""


class NotDifferentiableError(AccuracyError):
    """A result has no derivative where it was asked for; the message states why."""


class MissingDependencyError(AntioscError, ImportError):
    """An optional package is not installed; the message states which one and how to install it."""


class AntioscWarning(UserWarning):
    """A result may be misleading; the message states why and names the remedy."""


class AccuracyWarning(AntioscWarning):
    """A usable result that is less accurate than requested, or than usual."""


#: what takes antiosc's warnings of this thread; None: Python's own filters
_taker: ContextVar[Callable[[str], None] | None] = ContextVar("antiosc_warnings", default=None)


def warn(message: str, category: type[Warning] = AntioscWarning) -> None:
    """Warn at the line of the caller's own code, however deep in the library this is called."""
    taker = _taker.get()
    if taker is not None:
        taker(message)
        return
    warnings.warn(message, category, stacklevel=1 + _frames_to_caller())


#: Packages whose frames may lie between the caller's code and `warn`, besides Python's own.
_BETWEEN = {"antiosc", "dolfinx", "mpi4py", "numpy", "petsc4py", "scipy", "slepc4py"}


def _frames_to_caller() -> int:
    """Number of frames from `warn` up to the first one of the caller's own code."""
    frame, count = sys._getframe(1), 0
    while frame.f_back is not None:
        package = str(frame.f_globals.get("__name__", "")).partition(".")[0]
        if package not in _BETWEEN and package not in sys.stdlib_module_names:
            return count
        frame, count = frame.f_back, count + 1
    return count


@contextmanager
def warnings_to(take: Callable[[str], None]) -> Iterator[None]:
    """Give antiosc's warnings of this thread to `take`.

    `warnings.catch_warnings` changes the filters of all threads, and leaves those of another thread
    if two blocks overlap.
    """
    token = _taker.set(take)
    try:
        yield
    finally:
        _taker.reset(token)


def without_warnings() -> AbstractContextManager[None]:
    """Drop antiosc's warnings of this thread, which were given before."""
    return warnings_to(lambda message: None)


@contextmanager
def finite_element_packages() -> Iterator[None]:
    """Around imports that need these packages: MissingDependencyError says which is missing."""
    try:
        yield
    except MissingDependencyError:
        raise
    except ImportError as error:
        raise MissingDependencyError(
            f"{error.name or error} is not installed: meshes and their structures need dolfinx, "
            "petsc4py, slepc4py and gmsh (Debian's python3-dolfinx-real, …; `antiosc info` has the "
            "command for this installation); Structure.from_matrices, extract, models, contact "
            "laws and simulate work without them."
        ) from error


#: Most names that are all listed.
FEW = 12
#: Of more, so many of the nearest.
NEAREST = 5


def known(asked: object, names: Iterable[str], what: str) -> str:
    """ "its groups are: 'a', 'b'", or of many "the nearest of its groups (90) are: 'a', 'b'".

    `what` : the noun, as "its groups".
    """
    listed = sorted(names)
    if len(listed) <= FEW:
        return f"{what} are: {', '.join(map(repr, listed)) or 'none'}"
    lowered = {name.lower(): name for name in listed}
    alike = difflib.get_close_matches(str(asked).lower(), lowered, NEAREST, cutoff=0.0)
    nearest = ", ".join(repr(lowered[name]) for name in alike)
    return f"the nearest of {what} ({len(listed)}) are: {nearest}"
