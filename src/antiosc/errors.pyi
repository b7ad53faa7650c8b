# Names of this module, for type checkers and for the module itself.

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
