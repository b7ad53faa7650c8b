"""Calls with many values: one after the other, or by an executor, where none costs another."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import Executor, Future, as_completed
from typing import Any, TypeGuard, TypeVar

import numpy as np

from antiosc.base import checks
from antiosc.base.errors import AccuracyWarning, AntioscError, InputError, warn

T = TypeVar("T")
#: Positional arguments and keywords of a call.
Call = tuple[tuple[object, ...], dict[str, object]]

EXECUTOR = "a concurrent.futures.Executor, such as ProcessPoolExecutor()"


def sweep(
    make: Callable[..., Any],
    *,
    executor: Executor | None = None,
    earlier: Sequence[Any] | None = None,
    **values: Any,
) -> list[Any]:
    """Objects made from arrays: `sweep(RigidMass, mass=masses, velocity=2.0)`.

    Parameters
    ----------
    make : callable
        A constructor, or any function of the keywords.
    executor : concurrent.futures.Executor, optional
        What calls `make`, for instance a pool of processes. A call that fails then leaves its
        error, an AntioscError, in its place and costs no other; a warning names it. So does a
        worker that dies. Without an executor the first error is raised.
    earlier : sequence, optional
        What an earlier call with the same values returned: only the calls that failed are made.
    values
        Every keyword is one value for all or a sequence; all sequences must have the same length.

    Returns
    -------
    list
        The results in the order of the values.

    Raises
    ------
    InputError
        For sequences of different lengths, those of `earlier` included.
    """
    checks.function("make", make, "a constructor, such as RigidMass")
    check_executor(executor)
    lengths = {k: len(v) for k, v in values.items() if is_many(v)}
    size = common_length(lengths)
    each = [{k: v[i] if k in lengths else v for k, v in values.items()} for i in range(size)]
    results: list[Any] = [AntioscError("not called yet")] * size
    if earlier is not None:
        results = list(checks.instance("earlier", earlier, Sequence, "the list of an earlier call"))
        check_earlier(len(results), size)
    todo = [i for i, result in enumerate(results) if isinstance(result, AntioscError)]
    if executor is None:
        for i in todo:
            results[i] = make(**each[i])
        return results
    calls: list[Call] = [((), each[i]) for i in todo]
    for i, result in zip(todo, returned(executor, make, calls), strict=True):
        results[i] = result
    failed = [i for i, result in enumerate(results) if isinstance(result, AntioscError)]
    if failed:
        warn(
            f"{len(failed)} of {size} calls failed, as call {failed[0]}: {results[failed[0]]}",
            AccuracyWarning,
        )
    return results


def check_executor(executor: object) -> None:
    """InputError unless `executor` is None or has a `submit`."""
    if executor is not None and not callable(getattr(executor, "submit", None)):
        raise InputError(f"executor must be {EXECUTOR}; got {type(executor).__name__}.")


def returned(
    executor: Executor, function: Callable[..., T], calls: Sequence[Call]
) -> Iterator[T | AntioscError]:
    """What each call returns, in order; its error if it failed."""
    return map(_result, _submitted(executor, function, calls))


def as_they_come(
    executor: Executor, function: Callable[..., T], calls: Sequence[Call]
) -> Iterator[tuple[int, T | AntioscError]]:
    """The same with the numbers of the calls, those first that are finished first."""
    waiting = {}
    for k, future in enumerate(_submitted(executor, function, calls)):
        if isinstance(future, Future):
            waiting[future] = k
        else:  # lost, or of a package that has futures of its own
            yield k, _result(future)
    for future in as_completed(waiting):
        result = _result(future)
        yield waiting.pop(future), result


def _submitted(
    executor: Executor, function: Callable[..., T], calls: Sequence[Call]
) -> list[Future[T] | AntioscError]:
    """The future of each call, or the error of one that was not accepted."""
    futures: list[Future[T] | AntioscError] = []
    for given, keywords in calls:
        try:
            futures.append(executor.submit(function, *given, **keywords))
        except Exception as error:  # executors of any package
            futures.append(_lost(error))
    return futures


def _result(future: Future[T] | AntioscError) -> T | AntioscError:
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


def check_earlier(length: int, size: int) -> None:
    if length != size:
        raise InputError(f"earlier must have one entry for each of {size} scenes; got {length}.")


def is_many(value: object) -> TypeGuard[Sequence[Any]]:
    if isinstance(value, np.ndarray):
        return value.ndim == 1
    return isinstance(value, Sequence) and not isinstance(value, str | bytes)


def common_length(lengths: dict[str, int]) -> int:
    sizes = set(lengths.values())
    if len(sizes) > 1:
        listed = ", ".join(f"{k}: {v}" for k, v in lengths.items())
        raise InputError(f"sequences of a batch must have one length; got {listed}.")
    if not sizes:
        return 1
    size = sizes.pop()
    if size == 0:
        raise InputError("a batch needs at least one scene; got empty sequences.")
    return size
