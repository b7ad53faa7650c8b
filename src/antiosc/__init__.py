"""antiosc: impacts on structures by anti-oscillators, from a mesh to a force history.

Everything public is importable from here. Models, contact laws, `simulate` and the extraction of
models from given matrices need only NumPy and SciPy; meshes and their structures need the
finite-element packages. Each module is loaded when one of its names is first used; the stub
`__init__.pyi` lists the names.
"""

import ast
from importlib import import_module
from pathlib import Path
from typing import Any

__version__ = "0.1.0"


def _listed() -> dict[str, str]:
    """Public name -> module that holds it, from the stub beside this file."""
    stub = ast.parse(Path(__file__).with_suffix(".pyi").read_text(encoding="utf-8"))
    imports = [node for node in stub.body if isinstance(node, ast.ImportFrom)]
    return {alias.name: str(node.module) for node in imports for alias in node.names}


_MODULES = _listed()
#: Modules that need the finite-element packages, or whose functions do.
_MESHED = ("antiosc.fem", "antiosc.maps", "antiosc.results", "antiosc.striking", "antiosc_studies")
__all__ = sorted(_MODULES)


def __getattr__(name: str) -> Any:
    if name not in _MODULES:
        raise AttributeError(f"module 'antiosc' has no attribute {name!r}")
    if _MODULES[name].startswith(_MESHED):
        from antiosc.base.errors import finite_element_packages

        with finite_element_packages():
            value = getattr(import_module(_MODULES[name]), name)
    else:
        value = getattr(import_module(_MODULES[name]), name)
    from antiosc.base.errors import with_call_errors

    globals()[name] = value = with_call_errors(value)
    return value


def __dir__() -> list[str]:
    return [*__all__, "__version__"]
