"""Names of a package that are found when they are first used."""

from __future__ import annotations

import re
from collections.abc import Callable
from functools import cache
from importlib import import_module
from pathlib import Path
from typing import Any

#: Imports of a stub, from a module as (several or) one of "name as name" or "*".
_IMPORT = r"(?m)^from (\S+) import (\([^)]*\)|.*)$"
_NAME = r"(\w+) as \w+"


@cache
def names_in_stub(module: str) -> dict[str, str]:
    """Name -> module that defines it, read from the stub (.pyi) beside a module's file."""
    stub = Path(module).with_suffix(".pyi")
    names: dict[str, str] = {}
    for source, imported in re.findall(_IMPORT, stub.read_text(encoding="utf-8")):
        if source == "antiosc":  # its namespaces
            continue

        if imported == "*":
            names |= names_in_stub(str(stub.with_name(source.rpartition(".")[2])))
        else:
            names |= dict.fromkeys(re.findall(_NAME, imported), source)
    return names


def namespace(module: str) -> tuple[list[str], Callable[[str], Any], Callable[[], list[str]]]:
    """(`__all__`, `__getattr__`, `__dir__`) of a module whose names its stub (.pyi) lists."""
    names = sorted(names_in_stub(module))

    def getattr_(name: str) -> Any:
        if name not in names:
            raise AttributeError(f"{Path(module).stem} has no name {name!r}")
        return getattr(import_module("antiosc"), name)

    return names, getattr_, lambda: names


def _load_name(module: str, name: str) -> Any:
    """A name of a module, or the module of that name in a package."""
    try:
        return getattr(import_module(module), name)
    except AttributeError:
        return import_module(f"{module}.{name}")


def door(module: str) -> tuple[list[str], Callable[[str], Any]]:
    """(`__all__`, `__getattr__`) of a module that imports the names of its stub on first use."""
    modules = names_in_stub(module)
    values: dict[str, Any] = {}

    def getattr_(name: str) -> Any:
        if name not in modules:
            raise AttributeError(f"{Path(module).stem} has no name {name!r}")
        if name not in values:
            values[name] = _load_name(modules[name], name)
        return values[name]

    return sorted(modules), getattr_
