"""Where the repository keeps what tests read, and its demos as modules."""

from __future__ import annotations

import importlib.util
import sys
from pathlib import Path
from types import ModuleType

SUPPORT = Path(__file__).resolve().parent
ROOT = SUPPORT.parents[1]
MESHES = ROOT / "meshes"
DEMOS = ROOT / "demos"
BENCHMARKS = ROOT / "benchmarks"


def demo(name: str) -> ModuleType:
    """The demo or the measurement of that name as a module; they import each other by name."""
    sys.path[:0] = [str(folder) for folder in (BENCHMARKS, DEMOS) if str(folder) not in sys.path]
    folder = next(one for one in (DEMOS, BENCHMARKS) if (one / f"{name}.py").is_file())
    spec = importlib.util.spec_from_file_location(name, folder / f"{name}.py")
    module = importlib.util.module_from_spec(spec)
    sys.modules[name] = module  # dataclasses look their module up
    spec.loader.exec_module(module)
    return module


DECKS = ROOT / "tests" / "decks"
