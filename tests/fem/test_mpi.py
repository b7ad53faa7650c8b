"""The helper that runs scripts on several ranks: what it returns, and that failures are seen."""

import time

import pytest

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


def test_a_hang_is_ended():
    script = """
        from mpi4py import MPI
        if MPI.COMM_WORLD.rank == 0:
            MPI.COMM_WORLD.recv(source=1)
    """
    start = time.monotonic()
    with pytest.raises(AssertionError, match="not done after 3 s"):
        run_ranks(2, script, timeout=3)
    assert time.monotonic() - start < 300
