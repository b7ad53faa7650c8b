"""Fixtures and rules for all tests."""

from __future__ import annotations

import importlib.util

import numpy as np
import pytest


@pytest.fixture
def rng() -> np.random.Generator:
    """Random numbers, the same ones in every run."""
    return np.random.default_rng(20250)


def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """Skip what needs the finite-element packages where they are not installed."""
    missing = [name for name in ("dolfinx", "gmsh") if importlib.util.find_spec(name) is None]
    if not missing:
        return
    skip = pytest.mark.skip(reason=f"not installed: {', '.join(missing)}")
    for item in items:
        if item.get_closest_marker("fem") or item.get_closest_marker("mpi"):
            item.add_marker(skip)
