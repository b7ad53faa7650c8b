"""Errors and warnings, such as `antiosc.errors.InputError`."""

from antiosc.base.errors import (
    AccuracyError as AccuracyError,
    AccuracyWarning as AccuracyWarning,
    AntioscError as AntioscError,
    AntioscWarning as AntioscWarning,
    InputError as InputError,
    MeshError as MeshError,
    MissingDependencyError as MissingDependencyError,
    NotConvergedError as NotConvergedError,
    NotDifferentiableError as NotDifferentiableError,
    OutOfMemoryError as OutOfMemoryError,
)
