"""The helper that runs scripts on several ranks: what it returns, and that failures are seen."""

import time

import pytest

import mpi
from mpi import run_ranks

pytestmark = pytest.mark.mpi


def test_one_rank_that_raises_fails_all():
    script = """
        from mpi4py import MPI
        if MPI.COMM_WORLD.rank == 1:
            raise ValueError("only here")
        MPI.COMM_WORLD.barrier()
    """
    with pytest.raises(AssertionError, match=r"(?s)ended with code .*only here"):
        run_ranks(2, script)


HANG = """
from mpi4py import MPI
if MPI.COMM_WORLD.rank == 0:
    MPI.COMM_WORLD.recv(source=1)
"""


def test_a_hang_is_ended():
    start = time.monotonic()
    with pytest.raises(AssertionError, match="not done after 3 s"):
        run_ranks(2, HANG, timeout=3)
    assert time.monotonic() - start < 300


@pytest.mark.parametrize("hangs", [False, True], ids=["at the start", "in a script"])
def test_ranks_end_whose_test_was_killed(hangs, monkeypatch):
    monkeypatch.setattr(mpi, "SPARE", 1)
    ranks = mpi.Ranks(2)
    if hangs:
        ranks.run("", (), 60)
        with pytest.raises(AssertionError, match="not done"):
            ranks.run(HANG, (), 1)
    ranks.close()
    try:
        ranks.process.wait(60)
    finally:
        ranks.end()
