"""Names of a package that are imported at their first use."""

from __future__ import annotations

import re
from collections.abc import Callable
from contextlib import nullcontext
from functools import cache
from importlib import import_module
from pathlib import Path
from typing import Any

from antiosc.base.errors import finite_element_packages

#: Import statement of a stub: the module, and "name as name" (one or several) or "*".
_IMPORT = r"(?m)^from (\S+) import (\([^)]*\)|.*)$"
_NAME = r"(\w+) as \w+"
#: Modules that need the finite-element packages, or whose functions do.
MESHED = (
    "antiosc.fem",
    "antiosc.recovery",
    "antiosc.reduce",
    "antiosc.fields",
    "antiosc.strikes",
    "antiosc_decks",
    "antiosc_studies",
)


@cache
def names_in_stub(module: str) -> dict[str, str]:
    """name -> module that defines it, read from a module's file or its stub (.pyi)."""
    stub = Path(module).with_suffix(".pyi")
    stub = stub if stub.exists() else stub.with_suffix(".py")
    names: dict[str, str] = {}
    for source, imported in re.findall(_IMPORT, stub.read_text(encoding="utf-8")):
        if source == "antiosc":  # its namespaces
            continue

        if imported == "*":
            names |= names_in_stub(str(stub.with_name(source.rpartition(".")[2])))
        else:
            names |= dict.fromkeys(re.findall(_NAME, imported), source)
    return names


def load(module: str, name: str) -> Any:
    """The object `name` of a module, or the submodule `name` of a package."""
    with finite_element_packages() if module.startswith(MESHED) else nullcontext():
        loaded = import_module(module)
        if hasattr(loaded, name):
            return getattr(loaded, name)
        return import_module(f"{module}.{name}")


def lazy_exports(module: str) -> tuple[list[str], Callable[[str], Any], Callable[[], list[str]]]:
    """(`__all__`, `__getattr__`, `__dir__`) for the file `module`, with names of its stub."""
    modules = names_in_stub(module)

    def getattr_(name: str) -> Any:
        if name not in modules:
            raise AttributeError(f"{Path(module).stem} has no name {name!r}")
        return load(modules[name], name)

    return sorted(modules), getattr_, lambda: sorted(modules)
