"""Fixtures and rules for all tests."""

from __future__ import annotations

import importlib.util
import os

import numpy as np
import pytest


@pytest.fixture
def rng() -> np.random.Generator:
    """Random numbers, the same ones in every run."""
    return np.random.default_rng(20250)


def pytest_report_header() -> str:
    """Whose kernels OpenBLAS takes: rounding differs from one to another."""
    try:
        from threadpoolctl import threadpool_info
    except ImportError:
        return "OpenBLAS: threadpoolctl, which would tell its core type, is not installed"
    cores = {one["architecture"] for one in threadpool_info() if one["internal_api"] == "openblas"}
    wanted = os.environ.get("OPENBLAS_CORETYPE")
    if wanted and {core.lower() for core in cores} != {wanted.lower()}:
        raise pytest.UsageError(f"OPENBLAS_CORETYPE={wanted} did not take effect: {cores or None}")
    return f"OpenBLAS: core type {', '.join(sorted(cores)) or 'none'}"


def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """Skip what needs the finite-element packages where they are not installed."""
    missing = [name for name in ("dolfinx", "gmsh") if importlib.util.find_spec(name) is None]
    if not missing:
        return
    skip = pytest.mark.skip(reason=f"not installed: {', '.join(missing)}")
    for item in items:
        if item.get_closest_marker("fem") or item.get_closest_marker("mpi"):
            item.add_marker(skip)
