"""Where the repository keeps what tests read, and its demos as modules."""

from __future__ import annotations

import importlib.util
import sys
from pathlib import Path
from types import ModuleType

TESTS = Path(__file__).resolve().parent
ROOT = TESTS.parent
MESHES = ROOT / "meshes"
DEMOS = ROOT / "demos"


def demo(name: str) -> ModuleType:
    """The demo of that name as a module; demos import each other by name."""
    if str(DEMOS) not in sys.path:
        sys.path.insert(0, str(DEMOS))
    spec = importlib.util.spec_from_file_location(name, DEMOS / f"{name}.py")
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    sys.modules[name] = module  # dataclasses look their module up
    spec.loader.exec_module(module)
    return module


DECKS = Path(__file__).parent / "decks"
