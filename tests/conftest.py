"""Fixtures and rules for all tests."""

from __future__ import annotations

import gc
import importlib.util
import os
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest

import pictures
import readers
from antiosc.io import isolation
from antiosc.plot import charts

# Forms are compiled with little optimisation, here and in all processes of tests: small meshes, and
# hundreds of forms in a new cache. FFCx holds such libraries apart from those of a user's own runs.
os.environ.setdefault("CFLAGS", "-O1")


@pytest.fixture
def rng() -> np.random.Generator:
    """Random numbers, the same ones in every run."""
    return np.random.default_rng(20250)


def pytest_configure(config: pytest.Config) -> None:
    """Load MPI before tests import dolfinx or PETSc; collect tests without searches for garbage.

    Not where pytest only hands out tests: Open MPI changes the environment for child processes, of
    which the mpirun of their tests ends with code 1.
    """
    if config.getoption("dist", "no") == "no":
        import antiosc.fem  # noqa: F401

        gc.disable()


def pytest_report_header() -> str:
    """Whose kernels OpenBLAS takes: rounding differs from one to another."""
    try:
        from threadpoolctl import threadpool_info
    except ImportError:
        return "OpenBLAS: threadpoolctl, which would tell its core type, is not installed"
    cores = {one["architecture"] for one in threadpool_info() if one["internal_api"] == "openblas"}
    wanted = os.environ.get("OPENBLAS_CORETYPE")
    if wanted and cores and {core.lower() for core in cores} != {wanted.lower()}:
        raise pytest.UsageError(f"OPENBLAS_CORETYPE={wanted} did not take effect: {cores}")
    return f"OpenBLAS: core type {', '.join(sorted(cores)) or 'none'}"


def pytest_terminal_summary(terminalreporter: pytest.TerminalReporter) -> None:
    """Where the tests run that were skipped here."""
    skipped = len(terminalreporter.stats.get("skipped", []))
    if skipped:
        terminalreporter.write_line(
            f"{skipped} skipped: `.ci/more` installs what they need, as CI does before `.ci/run`"
            " on Debian 12, 13 and sid (.github/workflows/ci.yml)."
        )


def pytest_collection_finish() -> None:
    gc.enable()
    gc.set_threshold(700, 10, 100)  # a whole search goes through thousands of tests
    isolation._run_reader = readers.ask
    charts.render = pictures.rough


@pytest.hookimpl(tryfirst=True)  # before pytest selects by marks
def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """Make all but one case of each test slow; skip what needs packages that are not installed."""
    tests: dict[str, list[pytest.Item]] = {}
    for item in items:
        if not item.get_closest_marker("slow"):
            tests.setdefault(item.nodeid.partition("[")[0], []).append(item)
    for cases in tests.values():
        sample = cases[0].get_closest_marker("sample")
        chosen = sample.args[0] if sample and sample.args else 0
        for item in cases:
            if item is not cases[chosen]:
                item.add_marker(pytest.mark.slow)
    missing = [name for name in ("dolfinx", "gmsh") if importlib.util.find_spec(name) is None]
    if not missing:
        return
    skip = pytest.mark.skip(reason=f"not installed: {', '.join(missing)}")
    for item in items:
        if item.get_closest_marker("fem") or item.get_closest_marker("mpi"):
            item.add_marker(skip)


@pytest.fixture
def pictured(tmp_path: Path) -> Iterator[Path]:
    """A folder in which the test has a picture drawn."""
    yield tmp_path
    assert min((path.stat().st_size for path in tmp_path.glob("*.png")), default=0) > 0
