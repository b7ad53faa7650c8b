"""The errors antiosc raises: one sentence with the number, the rule and the remedy."""

from __future__ import annotations

import sys
import warnings


class AntioscError(Exception):
    """Base of all errors raised on purpose by antiosc."""


class InputError(AntioscError, ValueError):
    """The caller's data break a rule that the message states."""


class MeshError(InputError):
    """A mesh that cannot be read, or that no element family here can carry."""


class NotConvergedError(AntioscError, RuntimeError):
    """A linear solver, an eigensolver or an integrator gave up; the message says where it stood."""


class OutOfMemoryError(AntioscError, MemoryError):
    """There is no memory for what was asked; the message says how much it needs."""


class AccuracyError(AntioscError, ArithmeticError):
    """A result failed its own check, or left the range in which its theory holds."""


class MissingDependencyError(AntioscError, ImportError):
    """An optional package is not installed; the message says which and how to get it."""


class AntioscWarning(UserWarning):
    """Something the caller should know before trusting a number; the message names the remedy."""


class AccuracyWarning(AntioscWarning):
    """A usable result that did not reach what was asked, or is less accurate than usual."""


def warn(message: str, category: type[Warning] = AntioscWarning) -> None:
    """Warn at the line of the caller's own code, however deep in the library this is called."""
    warnings.warn(message, category, stacklevel=1 + _frames_to_caller())


#: Packages that stand between the caller's code and the place of a warning, beside Python's own.
_BETWEEN = {"antiosc", "dolfinx", "mpi4py", "numpy", "petsc4py", "scipy", "slepc4py"}


def _frames_to_caller() -> int:
    """How many frames above `warn` the first is that belongs to neither antiosc nor a library."""
    frame, count = sys._getframe(1), 0
    while frame.f_back is not None:
        package = str(frame.f_globals.get("__name__", "")).partition(".")[0]
        if package not in _BETWEEN and package not in sys.stdlib_module_names:
            return count
        frame, count = frame.f_back, count + 1
    return count
