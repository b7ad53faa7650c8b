"""The march as numba is given it, interpreted: its loops take the place of NumPy's operations."""

from __future__ import annotations

import importlib.util
import sys
from functools import cache
from types import ModuleType
from typing import Any
from unittest import mock

from antiosc.simulation import compilation


@cache
def written_out() -> ModuleType:
    """The package of the march with the branches of the compiled one, without compilation."""
    name = "antiosc.simulation.march_not_compiled"  # `COMPILED` goes by the end of the name
    source = compilation._SOURCE
    spec = importlib.util.spec_from_file_location(
        name, source / "__init__.py", submodule_search_locations=[str(source)]
    )
    assert spec is not None
    assert spec.loader is not None
    package = importlib.util.module_from_spec(spec)
    package.CACHE = False  # type: ignore[attr-defined]
    numba = ModuleType("numba")
    numba.njit = _as_it_is  # type: ignore[attr-defined]
    with mock.patch.dict(sys.modules, {name: package, "numba": numba}):
        spec.loader.exec_module(package)
    return package


def _as_it_is(*_: Any, **__: Any) -> Any:
    return lambda function: function
