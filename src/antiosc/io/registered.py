"""Readers and formats that packages register by entry points, antiosc's own decks among them."""

from __future__ import annotations

import functools
import sys
import tomllib
from importlib import metadata
from pathlib import Path
from typing import TypeVar

from antiosc.base.errors import AntioscError, MissingDependencyError

Kind = TypeVar("Kind")
#: The package of decks in this distribution; registrations of other packages precede its own.
OWN = "antiosc_decks."


def registered(group: str) -> tuple[metadata.EntryPoint, ...]:
    """The entry points of a group, not loaded; those of other packages first.

    "" in `sys.path` stands for the working folder, where nobody installs packages.
    """
    return _found(group, tuple(filter(None, sys.path)))


@functools.lru_cache
def _found(group: str, path: tuple[str, ...]) -> tuple[metadata.EntryPoint, ...]:
    installed = [e for d in metadata.distributions(path=list(path)) for e in d.entry_points]
    every = dict.fromkeys(e for e in [*installed, *_of_source_tree(group)] if e.group == group)
    return tuple(sorted(every, key=lambda one: one.value.startswith(OWN)))


def _of_source_tree(group: str) -> list[metadata.EntryPoint]:
    """Those of pyproject.toml, where antiosc is used from its sources, installed or not."""
    try:
        text = Path(__file__).resolve().parents[3].joinpath("pyproject.toml").read_text("utf-8")
        project = tomllib.loads(text).get("project", {})
    except (OSError, ValueError):
        return []
    given = project.get("entry-points", {}) if project.get("name") == "antiosc" else {}
    return [metadata.EntryPoint(name, to, group) for name, to in given.get(group, {}).items()]


def loaded(entry: metadata.EntryPoint, kind: type[Kind]) -> Kind:
    """The object that an entry point names; MissingDependencyError if it is not of this kind."""
    try:
        found = entry.load()
    except AntioscError:
        raise
    except Exception as error:
        said = f"{type(error).__name__}: {error}"
    else:
        if isinstance(found, kind):
            return found
        said = f"it is a {type(found).__name__}, not a {kind.__name__}"
    raise MissingDependencyError(
        f"{entry.value}, which a package registers as {entry.name!r} of {entry.group}, cannot be "
        f"used ({said}): repair or uninstall the package."
    )
