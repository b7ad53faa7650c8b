"""The errors antiosc raises: one sentence with the number, the rule and the remedy."""


class AntioscError(Exception):
    """Base of all errors raised on purpose by antiosc."""


class InputError(AntioscError, ValueError):
    """The caller's data break a rule that the message states."""


class MeshError(InputError):
    """A mesh that cannot be read, or that no element family here can carry."""


class NotConvergedError(AntioscError, RuntimeError):
    """A linear solver, an eigensolver or an integrator gave up; the message says where it stood."""


class AccuracyError(AntioscError, ArithmeticError):
    """A result failed its own check, or left the range in which its theory holds."""


class MissingDependencyError(AntioscError, ImportError):
    """An optional package is not installed; the message says which and how to get it."""


class AntioscWarning(UserWarning):
    """Something the caller should know before trusting a number; the message names the remedy."""


class AccuracyWarning(UserWarning):
    """A usable result that did not reach what was asked; the message says how far it came."""
