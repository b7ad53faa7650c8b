"""Tests below this folder need dolfinx and gmsh, but for those of decks and given matrices."""

from __future__ import annotations

import importlib.util
from pathlib import Path

import pytest

ALONE = {"structure/test_scipy_alone", "fem/test_saved_fields", "extraction/test_dampers"}
#: Of the readers of files and decks the others need none.
READERS = {"file_cells", "meshing", "nastran", "table", "trust"}


def needs_packages(path: Path) -> bool:
    if path.parent.name == "readers":
        return path.stem.removeprefix("test_") in READERS
    return path.stem.startswith("test_") and f"{path.parent.name}/{path.stem}" not in ALONE


def pytest_ignore_collect(collection_path: Path) -> bool | None:
    missing = any(importlib.util.find_spec(name) is None for name in ("dolfinx", "gmsh"))
    return True if missing and needs_packages(collection_path) else None


def pytest_itemcollected(item: pytest.Item) -> None:
    if needs_packages(item.path):
        item.add_marker(pytest.mark.fem)
