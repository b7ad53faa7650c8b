"""The free memory by the files of the kernel, of a machine and of a container."""

from __future__ import annotations

import numpy as np
import pytest

from antiosc.fem.linalg import memory

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
        ({}, np.inf),
    ],
)
def test_the_smaller_of_machine_and_container(files, free, monkeypatch):
    def lines(path: str) -> list[str]:
        return files.get(path) or files.get(path.removeprefix("/sys/fs/cgroup/memory."), [])

    monkeypatch.setattr(memory, "_lines", lines)
    assert memory.free_memory() == free
