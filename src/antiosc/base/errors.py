"""Errors and warnings of antiosc; a message has the number, the rule and the remedy."""

from __future__ import annotations

import sys
import warnings
from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import AbstractContextManager, contextmanager
from contextvars import ContextVar
from typing import Any


class AntioscError(Exception):
    """Base of all errors raised on purpose by antiosc."""


class InputError(AntioscError, ValueError):
    """The arguments break a rule that the message states."""


class MeshError(InputError):
    """A mesh that cannot be read, or that no element family supports."""


class UnmeshableError(MeshError):
    """A geometry that can be read, but that this attempt could not mesh."""


class PiecesError(MeshError):
    """A mesh of pieces that share no node; `pieces`: those known (`Piece`), the largest first."""

    pieces: Sequence[Any] = ()


class SiteError(InputError):
    """A site that cannot be struck, since supports fix it or it lies in a hollow."""


class NotConvergedError(AntioscError, RuntimeError):
    """A linear solver, an eigensolver or an integrator did not converge."""


class OutOfMemoryError(AntioscError, MemoryError):
    """There is not enough memory; the message states how much is needed."""


class AccuracyError(AntioscError, ArithmeticError):
    """A result failed its check, or lies outside the range of validity of its theory."""


class RangeError(AccuracyError):
    """A force exceeds the range of its law; `radius`: radius [m] of a sufficient patch, or None."""

    radius: float | None = None


class NotDifferentiableError(AccuracyError):
    """A result has no derivative at this run; the message states why."""


class MissingDependencyError(AntioscError, ImportError):
    """An optional package is not installed; the message states which one and how to install it."""


class AntioscWarning(UserWarning):
    """A result may be misleading; the message states why and names the remedy."""


class AccuracyWarning(AntioscWarning):
    """A usable result that is less accurate than requested, or than usual."""


class NotTakenWarning(AntioscWarning):
    """Content of a file is ignored."""


class ChoiceWarning(AntioscWarning):
    """A choice that the user left to the program; it is shown as a note, not as a caution."""


class Message(str):
    """A collected warning: its text, with its category."""

    category: type[Warning]

    def __new__(cls, text: str, category: type[Warning]) -> Message:
        """A message of this category with its text on one line."""
        message = super().__new__(cls, " ".join(text.split()))
        message.category = category
        return message


#: Severities of warnings: on the accuracy of numbers, on the model, on the file, and notes of what
#: was chosen.
NUMBERS_WEIGHT, MODEL_WEIGHT, FILE_WEIGHT, NOTE_WEIGHT = range(4)


def message_weight(message: str) -> int:
    """Severity of a warning by its category: `NUMBERS_WEIGHT` (most severe) to `NOTE_WEIGHT`."""
    category = getattr(message, "category", AntioscWarning)
    if issubclass(category, AccuracyWarning):
        return NUMBERS_WEIGHT
    if issubclass(category, ChoiceWarning):
        return NOTE_WEIGHT
    return FILE_WEIGHT if issubclass(category, NotTakenWarning) else MODEL_WEIGHT


def labelled(message: str) -> str:
    """The message for a terminal, preceded by "note: " or "warning: "."""
    return f"{'note' if message_weight(message) == NOTE_WEIGHT else 'warning'}: {message}"


def sorted_by_weight(messages: Iterable[str]) -> list[str]:
    """The distinct warnings, the most severe first, by `message_weight`."""
    return sorted(dict.fromkeys(messages), key=message_weight)


#: function that receives antiosc's warnings of this thread; None: Python's own filters
_warning_receiver: ContextVar[Callable[[str], None] | None] = ContextVar(
    "antiosc_warnings", default=None
)


def warn(message: str, category: type[Warning] | None = None) -> None:
    """Warn at the line of the caller's own code; default category: that of a `Message`."""
    kind: type[Warning] = getattr(message, "category", AntioscWarning)
    kind = kind if category is None else category
    taker = _warning_receiver.get()
    if taker is not None:
        taker(Message(message, kind))
        return

    warnings.warn(str(message), kind, stacklevel=1 + _frames_to_caller())


#: Packages whose frames may lie between the caller's code and `warn`, besides Python's own.
_PACKAGES = {"antiosc", "antiosc_app", "antiosc_decks", "antiosc_studies"}
_LIBRARIES = {*_PACKAGES, "dolfinx", "mpi4py", "numpy", "petsc4py", "scipy", "slepc4py"}


def _frames_to_caller() -> int:
    """Number of frames from `warn` up to the first one of the caller's own code."""
    frame = sys._getframe(1)
    count = 0
    while frame.f_back is not None:
        package = str(frame.f_globals.get("__name__", "")).partition(".")[0]
        if package not in _LIBRARIES and package not in sys.stdlib_module_names:
            return count
        frame = frame.f_back
        count = count + 1

    return count


@contextmanager
def warnings_to(receiver: Callable[[str], None]) -> Iterator[None]:
    """Context in which this thread's antiosc warnings go to `receiver`, not to Python's filters."""
    token = _warning_receiver.set(receiver)
    try:
        yield
    finally:
        _warning_receiver.reset(token)


def without_warnings() -> AbstractContextManager[None]:
    """Context that drops antiosc's warnings of this thread, for work that repeats earlier ones."""
    return warnings_to(lambda message: None)


@contextmanager
def warnings_of_last() -> Iterator[Callable[[], None]]:
    """Context of several trials; it yields a function that drops the warnings of earlier trials."""
    messages: list[str] = []

    try:
        with warnings_to(messages.append):
            yield messages.clear
    finally:
        for message in messages:
            warn(message)


@contextmanager
def finite_element_packages() -> Iterator[None]:
    """Context for imports of dolfinx etc.; MissingDependencyError names a missing package."""
    try:
        yield
    except MissingDependencyError:
        raise
    except ModuleNotFoundError as error:
        raise MissingDependencyError(
            f"{error.name or error} is not installed: meshes and their structures need dolfinx, "
            "petsc4py, slepc4py and gmsh (`antiosc info` has the command for this installation); "
            "Structure.from_matrices, extract, models, contact laws and simulate work without them."
        ) from error
    except ImportError as error:
        reason = str(error).rstrip(".")
        raise MissingDependencyError(
            f"the finite-element packages do not fit together ({reason}): take dolfinx, petsc4py, "
            "slepc4py, mpi4py and its MPI from one source, in an environment of their own."
        ) from error


#: Up to this number of names, all are listed.
MAX_LISTED_NAMES = 12
#: Number of the most similar names that are listed otherwise.
NEAREST_NAME_COUNT = 5


def name_list(wanted: object, names: Iterable[str], what: str) -> str:
    """Text "`what` are: 'a', 'b'"; from many names it lists only those similar to `wanted`."""
    sorted_names = sorted(names)
    if len(sorted_names) <= MAX_LISTED_NAMES:
        return f"{what} are: {', '.join(map(repr, sorted_names)) or 'none'}"

    import difflib  # takes long to load

    lowered = {name.lower(): name for name in sorted_names}
    similar = difflib.get_close_matches(
        str(wanted).lower(), lowered, NEAREST_NAME_COUNT, cutoff=0.0
    )
    nearest = ", ".join(repr(lowered[name]) for name in similar)

    return f"the nearest of {what} ({len(sorted_names)}) are: {nearest}"
