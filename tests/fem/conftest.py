"""Tests below this folder need dolfinx and gmsh, but for those of decks and given matrices."""

from __future__ import annotations

import importlib.util
from pathlib import Path

import pytest

HERE = Path(__file__).parent
ALONE = [HERE / "readers", HERE / "structure/test_scipy_alone.py", HERE / "test_saved_fields.py",
         HERE / "extraction/test_dampers.py"]  # fmt: skip


def needs_packages(path: Path) -> bool:
    return path.name.startswith("test_") and not any(path.is_relative_to(one) for one in ALONE)


def pytest_ignore_collect(collection_path: Path) -> bool | None:
    missing = any(importlib.util.find_spec(name) is None for name in ("dolfinx", "gmsh"))
    return True if missing and needs_packages(collection_path) else None


def pytest_itemcollected(item: pytest.Item) -> None:
    if needs_packages(item.path):
        item.add_marker(pytest.mark.fem)
