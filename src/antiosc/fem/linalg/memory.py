"""The free memory, and how much of it a factor or a basis may take."""

from __future__ import annotations

from pathlib import Path

import numpy as np

#: Share of the free memory that a factor may fill.
MEMORY_SHARE = 0.9


def free_memory() -> float:
    """Free memory of this machine, or of its container, in bytes."""
    free = np.inf
    for line in _lines("/proc/meminfo"):
        if line.startswith("MemAvailable:"):
            free = 1024 * float(line.split()[1])
    group = "/sys/fs/cgroup/memory."
    most, used = (_lines(group + name) for name in ("max", "current"))
    if most and used and most[0].isdigit():
        free = min(free, float(most[0]) - float(used[0]))
    return free


def _lines(path: str) -> list[str]:
    try:
        return Path(path).read_text().splitlines()
    except OSError:
        return []
