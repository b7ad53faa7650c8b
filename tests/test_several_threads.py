"""Several threads of one process, and the free memory that it has."""

from __future__ import annotations

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
from antiosc.base import process
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
    monkeypatch.setattr(cholmod, "_loaded_library", there.get)
    overlapping(cholmod.without_openmp(), cholmod.without_openmp())
    assert levels[-1] == 3


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
        ({}, np.inf),
    ],
)
def test_the_smaller_of_machine_and_container(files, free, monkeypatch):
    def lines(path: str) -> list[str]:
        return files.get(path) or files.get(path.removeprefix("/sys/fs/cgroup/memory."), [])

    monkeypatch.setattr(process, "_lines", lines)
    assert process.free_memory() == free
