"""Several threads of one process, and the free memory that it has."""

from __future__ import annotations

import os
import sys
import threading
import warnings
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from contextlib import AbstractContextManager
from types import SimpleNamespace

import numpy as np
import pytest
import scipy.sparse

import antiosc as ao
from antiosc.base import errors, process
from antiosc.fem.structure.structure import Structure


def chain(n: int, backend: str) -> Structure:
    K = scipy.sparse.diags([-1e5, 2e5, -1e5], [-1, 0, 1], shape=(n, n)).tocsr()
    M = scipy.sparse.diags([np.linspace(0.1, 0.3, n)], [0]).tocsr()
    return Structure.from_matrices(K, M, backend=backend)


def peaks(seed: int, backend: str) -> np.ndarray:
    """Extraction and a batch of impacts, of a chain of its own."""
    model = ao.extract(chain(40 + seed, backend), ao.Site(dof=20), n=6)
    balls = ao.sweep(ao.RigidMass, mass=[0.1, 0.2, 0.4], velocity=1.0 + seed)
    return ao.simulate_many(model, balls, ao.Linear(1e5), 5e-3, tol=1e-2).peak_force


@pytest.mark.parametrize("backend", ["scipy", pytest.param("petsc", marks=pytest.mark.fem)])
def test_eight_threads_give_what_one_gives(backend):
    if backend == "petsc":
        pytest.importorskip("dolfinx")
    alone = [peaks(seed, backend) for seed in range(8)]
    before, switch = list(warnings.filters), sys.getswitchinterval()
    sys.setswitchinterval(1e-5)
    try:
        with ThreadPoolExecutor(8) as pool:
            together = list(pool.map(peaks, range(8), [backend] * 8))
    finally:
        sys.setswitchinterval(switch)
    np.testing.assert_array_equal(together, alone)
    assert warnings.filters == before


def overlapping(first: AbstractContextManager, second: AbstractContextManager) -> None:
    """Two threads enter a block each, and leave them in the order in which they entered."""
    steps = [threading.Event() for _ in range(2)]

    def one() -> None:
        with first:
            steps[0].set()
            assert steps[1].wait(10)

    thread = threading.Thread(target=one)
    thread.start()
    assert steps[0].wait(10)
    with second as further:
        steps[1].set()
        thread.join()
        if further is not None:
            further("after the other")


def test_warnings_that_a_thread_drops_are_heard_in_others_and_afterwards():
    before = list(warnings.filters)
    overlapping(errors.without_warnings(), errors.without_warnings())
    assert warnings.filters == before
    with errors.without_warnings(), ThreadPoolExecutor(1) as pool:
        errors.warn("it was told before")
        with pytest.warns(ao.AntioscWarning, match="news"):
            pool.submit(errors.warn, "news").result()
    with pytest.warns(ao.AntioscWarning, match="again"):
        errors.warn("again")


def test_what_another_thread_sets_while_something_compiles_stays(monkeypatch):
    monkeypatch.setenv("ANTIOSC_TEST_GONE", "1")
    path = list(sys.path)

    def application() -> None:
        os.environ["ANTIOSC_TEST_SET"] = "1"
        del os.environ["ANTIOSC_TEST_GONE"]
        sys.path.append("/application")

    try:
        with process.restored(), ThreadPoolExecutor(1) as pool:
            pool.submit(application).result()
        assert os.environ.get("ANTIOSC_TEST_SET") == "1"
        assert "ANTIOSC_TEST_GONE" not in os.environ
        assert "/application" in sys.path
    finally:
        os.environ.pop("ANTIOSC_TEST_SET", None)
        sys.path[:] = path


@pytest.mark.fem
def test_openmp_is_as_before_after_factors_of_two_threads(monkeypatch):
    pytest.importorskip("dolfinx")
    from antiosc.fem.linalg import cholmod

    levels = [3]
    openmp = SimpleNamespace(
        omp_get_max_active_levels=lambda: levels[-1], omp_set_max_active_levels=levels.append
    )
    there: dict[str, Callable | SimpleNamespace] = {
        "libgomp.so.1": openmp,
        "libopenblas.so.0": SimpleNamespace(openblas_get_parallel=lambda: 1),
    }
    monkeypatch.setattr(cholmod, "_loaded", there.get)
    overlapping(cholmod.without_openmp(), cholmod.without_openmp())
    assert levels[-1] == 3


V1 = "/sys/fs/cgroup/memory/memory."
MACHINE = ["MemTotal:   100 kB", "MemAvailable:   64 kB", "SwapTotal:   9 kB"]


@pytest.mark.parametrize(
    ("files", "free"),
    [
        ({"/proc/meminfo": MACHINE}, 65536.0),
        ({"/proc/meminfo": MACHINE, "max": ["50000"], "current": ["20000"]}, 30000.0),
        ({"/proc/meminfo": MACHINE, "max": ["900000"], "current": ["20000"]}, 65536.0),
        ({"/proc/meminfo": MACHINE, "max": ["max"], "current": ["20000"]}, 65536.0),
        ({"/proc/meminfo": MACHINE, "max": ["50000"]}, 65536.0),
        ({"max": ["50000"], "current": ["20000"]}, 30000.0),
        ({"max": ["50000"], "current": ["20000"], "stat": ["inactive_file 5000"]}, 35000.0),
        ({V1 + "limit_in_bytes": ["50000"], V1 + "usage_in_bytes": ["20000"]}, 30000.0),
        ({}, np.inf),
    ],
)
def test_the_smaller_of_machine_and_container(files, free, monkeypatch):
    def lines(path: str) -> list[str]:
        return files.get(path) or files.get(path.removeprefix("/sys/fs/cgroup/memory."), [])

    monkeypatch.setattr(process, "_lines", lines)
    assert process.free_memory() == free


def test_the_limit_of_the_process_counts(monkeypatch):
    """What `ulimit -v` leaves, of 3 pages that are used."""
    resource = pytest.importorskip("resource")
    limit = 10 * resource.getpagesize()
    monkeypatch.setattr(resource, "getrlimit", lambda kind: (limit, limit))
    monkeypatch.setattr(process, "_lines", lambda path: ["3 2 1"] if "statm" in path else [])
    assert process.free_memory() == 7 * resource.getpagesize()


def test_what_does_not_fit_is_one_sentence(monkeypatch):
    monkeypatch.setattr(process, "free_memory", lambda: 2e9)
    process.require(1.7e9, "a run", "do less")
    with pytest.raises(process.OutOfMemoryError, match=r"^a run needs .* 1.9 GB .* 2 GB"):
        process.require(1.9e9, "a run", "do less")
