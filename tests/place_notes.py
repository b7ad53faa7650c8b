"""A pytest plugin that notes which tests run the places where `hit(number)` stands in the source.

What several tests share counts for each test that uses it: fixtures of a module, functools.cache
and cached_property keep the places that were run for a value, and note them again when it is used.
Processes that a test starts note for it.
"""

from __future__ import annotations

import functools
import os
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

FOLDER = Path(__file__).parent
#: Lines "number<tab>test", and the test that runs now.
NOTES, NOW = FOLDER / "place_notes.txt", FOLDER / "place_now.txt"

_process, _test = 0, ""
_noted: set[tuple[int, str]] = set()
_recorders: list[set[int]] = []


def hit(number: int) -> None:
    """Note a place once for each test; None."""
    global _process, _test
    if _process != os.getpid():  # one that a test started, or a fork
        _process, _test = os.getpid(), NOW.read_text(encoding="utf-8")
        _noted.clear()
    for recorder in _recorders:
        recorder.add(number)
    if (number, _test) not in _noted:
        _noted.add((number, _test))
        with NOTES.open("a", encoding="utf-8") as file:
            file.write(f"{number}\t{_test}\n")


def begin(test: str) -> None:
    """From now on this test runs; "": none."""
    global _process, _test
    _process, _test = os.getpid(), test
    _noted.clear()
    NOW.write_text(test, encoding="utf-8")


@contextmanager
def recorded() -> Iterator[set[int]]:
    """The places that are run in the body, by other processes too."""
    places: set[int] = set()
    start = NOTES.stat().st_size
    _recorders.append(places)
    try:
        yield places
    finally:
        _recorders.pop()
        with NOTES.open(encoding="utf-8") as file:
            file.seek(start)
            places.update(int(line.split("\t")[0]) for line in file)


def again(places: set[int]) -> None:
    """Note places that were run for a value that is used again."""
    for number in places:
        hit(number)


# -- values that are kept

_lru_cache = functools.lru_cache
_cached_property = functools.cached_property


def _noting_cache(maxsize: Any = 128, typed: bool = False) -> Any:
    if callable(maxsize):
        return _noting_cache()(maxsize)

    def of(function: Callable[..., Any]) -> Any:
        @_lru_cache(maxsize, typed)
        def kept(*args: Any, **keywords: Any) -> Any:
            with recorded() as places:
                value = function(*args, **keywords)
            return value, places

        @functools.wraps(function)
        def call(*args: Any, **keywords: Any) -> Any:
            value, places = kept(*args, **keywords)
            again(places)
            return value

        call.cache_info, call.cache_clear = kept.cache_info, kept.cache_clear  # type: ignore
        return call

    return of


class _NotingProperty(_cached_property):  # type: ignore[type-arg]
    """A cached_property that is asked at each use, because it can be set."""

    def __get__(self, instance: Any, owner: Any = None) -> Any:
        if instance is None:
            return self
        values, places = instance.__dict__, f"places of {self.attrname}"
        if self.attrname not in values:
            with recorded() as ran:
                values[self.attrname] = self.func(instance)
            values[places] = ran
        again(values.get(places, set()))
        return values[self.attrname]

    def __set__(self, instance: Any, value: Any) -> None:
        instance.__dict__[self.attrname] = value

    def __delete__(self, instance: Any) -> None:
        del instance.__dict__[self.attrname]


# -- pytest's hooks


def pytest_configure() -> None:
    NOTES.touch()
    begin("")
    functools.lru_cache = _noting_cache  # type: ignore[assignment]
    functools.cache = _noting_cache(None)
    functools.cached_property = _NotingProperty  # type: ignore[misc]


def pytest_runtest_logstart(nodeid: str) -> None:
    begin(nodeid)


def pytest_runtest_logfinish() -> None:
    begin("")


def _wrapper(function: Any) -> Any:
    import pytest

    return pytest.hookimpl(hookwrapper=True)(function)


@_wrapper
def pytest_fixture_setup(fixturedef: Any) -> Iterator[None]:
    with recorded() as places:
        yield
    fixturedef.places = places


@_wrapper
def pytest_runtest_call(item: Any) -> Iterator[None]:
    for definitions in item._fixtureinfo.name2fixturedefs.values():
        again(getattr(definitions[-1], "places", set()))
    yield
