"""Calls that an executor makes: each returns its result or its error, and none costs another."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import Executor, Future, as_completed
from typing import Any

from antiosc.base.errors import AntioscError, InputError

EXECUTOR = "a concurrent.futures.Executor, such as ProcessPoolExecutor()"


def check_executor(executor: Any) -> None:
    """InputError unless `executor` is None or has a `submit`."""
    if executor is not None and not callable(getattr(executor, "submit", None)):
        raise InputError(f"executor must be {EXECUTOR}; got {type(executor).__name__}.")


def returned(
    executor: Executor, function: Callable[..., Any], calls: Sequence[tuple[Any, dict[str, Any]]]
) -> Iterator[Any]:
    """What each call (positional arguments, keywords) returns, in order; its error if it failed."""
    for _, future in _submitted(executor, function, calls):
        yield _result(future)


def as_they_come(
    executor: Executor, function: Callable[..., Any], calls: Sequence[tuple[Any, dict[str, Any]]]
) -> Iterator[tuple[int, Any]]:
    """The same with the numbers of the calls, those first that are finished first."""
    waiting = {}
    for k, future in _submitted(executor, function, calls):
        if isinstance(future, Future):
            waiting[future] = k
        else:  # lost, or of a package that has futures of its own
            yield k, _result(future)
    for future in as_completed(waiting):
        yield waiting.pop(future), _result(future)


def _submitted(
    executor: Executor, function: Callable[..., Any], calls: Sequence[tuple[Any, dict[str, Any]]]
) -> list[tuple[int, Any]]:
    """The future of each call with its number, or the error of one that was not accepted."""
    futures: list[tuple[int, Any]] = []
    for k, (given, keywords) in enumerate(calls):
        try:
            futures.append((k, executor.submit(function, *given, **keywords)))
        except Exception as error:  # executors of any package
            futures.append((k, _lost(error)))
    return futures


def _result(future: Any) -> Any:
    try:
        return future if isinstance(future, AntioscError) else future.result()
    except AntioscError as error:
        return error
    except Exception as error:
        return _lost(error)


def _lost(error: Exception) -> AntioscError:
    """The error for a call that the executor did not finish."""
    said = " ".join(f"{type(error).__name__}: {error}".split())
    found = AntioscError(
        f"the executor returned no result ({said}): arguments must be such that they can be"
        " pickled, and workers must live; what is finished can be passed as `earlier`."
    )
    found.__cause__ = error
    return found
