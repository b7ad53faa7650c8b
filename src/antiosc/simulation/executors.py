"""Calls that an executor makes: each returns its result or its error, and none costs another."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import Executor
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
    futures: list[Any] = []
    for given, keywords in calls:
        try:
            futures.append(executor.submit(function, *given, **keywords))
        except Exception as error:  # executors of any package
            futures.append(_lost(error))
    for future in futures:
        try:
            yield future if isinstance(future, AntioscError) else future.result()
        except AntioscError as error:
            yield error
        except Exception as error:
            yield _lost(error)


def _lost(error: Exception) -> AntioscError:
    """The error for a call that the executor did not finish."""
    said = " ".join(f"{type(error).__name__}: {error}".split())
    found = AntioscError(
        f"the executor returned no result ({said}): arguments must be such that they can be"
        " pickled, and workers must live; what is finished can be passed as `earlier`."
    )
    found.__cause__ = error
    return found
