"""Structures that nobody uses any more leave no memory behind."""

from __future__ import annotations

import json

import pytest

from mpi import run_ranks

#: Memory after each of some structures, which are dropped, in units of one's K and M.
GROWTH = """
import json, resource
import antiosc as ao
import parts
from mpi4py import MPI

peaks = []
for _ in range(8):
    part = ao.Structure(parts.box((6, 5, 4)), ao.Solid(**parts.STEEL), [ao.Support("left")])
    ao.extract(part, ao.Site((0.1, 0.03, 0.03), (0, 0, -1), radius=0.03), n=2)
    size = 2 * 12 * part.K.getInfo(part.K.InfoType.LOCAL)["nz_used"]
    del part
    peaks.append(1024 * resource.getrusage(resource.RUSAGE_SELF).ru_maxrss)
print(json.dumps((peaks[-1] - peaks[2]) / size))
"""


@pytest.mark.fem
@pytest.mark.slow
@pytest.mark.mpi
def test_memory_does_not_grow():
    for text in run_ranks(2, GROWTH, alone=True):
        assert json.loads(text) < 1.5
