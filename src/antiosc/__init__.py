"""antiosc: impacts on structures by anti-oscillators, from a mesh to a force history.

Everything public is importable from here. Models, contact laws, `simulate` and the extraction of
models from given matrices need only NumPy and SciPy; meshes and their structures need the
finite-element packages. Each module is loaded when one of its names is first used; the stub
`__init__.pyi` lists the names.
"""

from importlib import import_module
from typing import Any

from antiosc.base import lazily

__version__ = "0.1.0"

_MODULES = lazily.names_in_stub(__file__)
#: Modules whose names `dir(antiosc)` leaves out, except the names in `_COMMON`.
_NAMESPACES = ("errors", "joints", "laws", "results")
_COMMON = {"Bolt", "ElasticPlastic", "Hertz", "Linear", "Tie"}
_GROUPED = set().union(*(lazily.names_in_stub(f"{__path__[0]}/{name}.py") for name in _NAMESPACES))
__all__ = sorted({*_MODULES} - (_GROUPED - _COMMON))


def __getattr__(name: str) -> Any:
    if name in _NAMESPACES:
        return import_module(f"antiosc.{name}")
    if name not in _MODULES:
        raise AttributeError(f"module 'antiosc' has no attribute {name!r}")
    value = globals()[name] = lazily.load(_MODULES[name], name)
    return value


def __dir__() -> list[str]:
    return sorted({*__all__, *_NAMESPACES, "__version__"})
