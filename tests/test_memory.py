"""The free memory by the files of the kernel, of a machine and of a container."""

from __future__ import annotations

import numpy as np
import pytest

from antiosc.base import process

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
