"""Tests below this folder need dolfinx, but for those of decks, of given matrices and of files."""

from __future__ import annotations

import importlib.util
from pathlib import Path

import pytest

HERE = Path(__file__).parent
ALONE = [HERE / "readers", HERE / "structure/test_scipy_alone.py", HERE / "test_saved_fields.py",
         HERE / "extraction/test_bounds.py", HERE / "extraction/test_dampers.py",
         HERE / "test_series.py", HERE / "test_mpi.py"]  # fmt: skip


def needs_dolfinx(path: Path) -> bool:
    return path.name.startswith("test_") and not any(path.is_relative_to(one) for one in ALONE)


def pytest_ignore_collect(collection_path: Path) -> bool | None:
    missing = importlib.util.find_spec("dolfinx") is None
    return True if missing and needs_dolfinx(collection_path) else None


def pytest_itemcollected(item: pytest.Item) -> None:
    if needs_dolfinx(item.path):
        item.add_marker(pytest.mark.fem)
