"""Public names that are called with arguments which they do not take: one sentence instead.

Python's own TypeError names no argument that is meant. The arguments are compared with the
signature after a call has failed only, so that sound calls cost nothing.
"""

from __future__ import annotations

import inspect
import sys
from collections.abc import Callable, Iterable
from functools import wraps
from types import FunctionType
from typing import Any

from antiosc.base.errors import InputError, known


class CallError(InputError, TypeError):
    """Arguments that a constructor or a function does not take, or lacks."""


def checked(value: object) -> Any:
    """A public class or function whose wrong calls raise a CallError; other objects as they are."""
    if isinstance(value, FunctionType) and not hasattr(value, "checks_calls"):
        wrapped = _guarded(value, value.__name__, 0)
        # pickle finds a function by its name in its module
        setattr(sys.modules[value.__module__], value.__name__, wrapped)
        return wrapped
    if isinstance(value, type) and not issubclass(value, BaseException):
        _check_class(value)
    return value


def _check_class(kind: Any) -> None:
    """Guard the constructors of a class, its class methods and its public methods."""
    init = kind.__init__
    if isinstance(init, FunctionType) and getattr(init, "checks_calls", None) != kind.__name__:
        kind.__init__ = _guarded(init, kind.__name__, 1)
    for name, member in list(vars(kind).items()):
        inner = getattr(member, "__func__", member)
        if name.startswith("_") or hasattr(inner, "checks_calls"):
            continue
        if isinstance(member, classmethod):
            setattr(kind, name, classmethod(_guarded(inner, f"{kind.__name__}.{name}", 1)))
        elif isinstance(member, FunctionType):
            setattr(kind, name, _guarded(member, f"{kind.__name__}.{name}", 1))


def _guarded(function: Any, name: str, own: int) -> Callable[..., Any]:
    """`function` with its wrong calls told; the first `own` arguments are not the caller's."""
    # that of a base class tells the name of the base
    inner = function.__wrapped__ if hasattr(function, "checks_calls") else function

    @wraps(inner)
    def called(*args: Any, **kwargs: Any) -> Any:
        try:
            try:
                return inner(*args, **kwargs)
            except TypeError:
                said = misfit(inner, name, own, args, kwargs)
                if said is None:
                    raise
                raise CallError(said) from None
        except Exception as error:  # the traceback leads from the call into the function itself
            error.__traceback__ = error.__traceback__ and error.__traceback__.tb_next
            raise

    called.checks_calls = name  # type: ignore[attr-defined]
    return called


def misfit(
    function: Any, name: str, own: int, args: tuple[Any, ...], kwargs: dict[str, Any]
) -> str | None:
    """Why the arguments do not fit the signature; None if they do."""
    signature = inspect.signature(function)
    try:
        signature.bind(*args, **kwargs)
    except TypeError as error:
        names = list(signature.parameters)[own:]
        unknown = sorted(kwargs.keys() - set(names))
        what = f" takes no argument {unknown[0]!r}" if unknown else f": {error}"
        return f"{name}{what}; {known((unknown or [''])[0], names, 'its arguments')}."
    return None


def takes(name: str, function: Callable[..., Any], names: Iterable[str]) -> None:
    """InputError if a function of the caller's cannot be called with arguments of these names."""
    try:
        said = misfit(function, name, 0, (), dict.fromkeys(names))
    except (TypeError, ValueError):  # its signature is not known
        return
    if said is not None:
        raise InputError(said)
