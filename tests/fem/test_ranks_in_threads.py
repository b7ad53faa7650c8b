"""What the ranks agree on, with two threads in place of two processes."""

from __future__ import annotations

import threading
from types import SimpleNamespace

import numpy as np
import pytest

import antiosc as ao
from antiosc.fem import platform
from antiosc.recovery import mesh_fields


class Ranks:
    """The common part of the communicators of `size` threads."""

    def __init__(self, size: int = 2) -> None:
        self.size = size
        self.barrier = threading.Barrier(size, timeout=20)
        self.slots = [None] * size


class Comm:
    """What antiosc calls of a communicator, for one thread."""

    def __init__(self, ranks: Ranks, rank: int) -> None:
        self.ranks, self.rank, self.size = ranks, rank, ranks.size

    def allgather(self, value):
        self.ranks.slots[self.rank] = value
        self.ranks.barrier.wait()
        found = list(self.ranks.slots)
        self.ranks.barrier.wait()
        return found

    def bcast(self, value, root=0):
        return self.allgather(value)[root]


def on_ranks(call, size: int = 2) -> list:
    """What `call(comm)` returns or raises on every rank."""
    ranks, found = Ranks(size), [None] * size

    def work(rank):
        try:
            found[rank] = call(Comm(ranks, rank))
        except Exception as error:
            found[rank] = error

    threads = [threading.Thread(target=work, args=(rank,)) for rank in range(size)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    return found


class Thing:
    def __init__(self, comm) -> None:
        self.comm = comm


@pytest.fixture
def guarded(monkeypatch):
    """A collective function whose communicator is the one of the thread."""
    monkeypatch.setattr(
        platform,
        "_communicator",
        lambda values, default: next(one.comm for one in values if isinstance(one, Thing)),
    )

    @platform.collective()
    def divide(thing, a, b=1.0):
        if a < 0:
            raise ao.InputError(f"a must be >= 0; got {a}.")
        if a == 13:
            raise MemoryError
        return a / b

    return divide


def test_memory_that_is_short_is_told_on_all_ranks(guarded):
    found = on_ranks(lambda comm: guarded(Thing(comm), 13))
    assert all(isinstance(one, ao.OutOfMemoryError) for one in found)
    assert "divide ran out of memory (Python itself)" in str(found[0])


def test_work_on_the_root():
    done = []

    def call(comm):
        return platform.on_root(comm, lambda: done.append(comm.rank) or 7)

    assert on_ranks(call, 3) == [7] * 3
    assert done == [0]

    def fails(comm):
        return platform.on_root(comm, lambda: 1 / 0)

    assert all(isinstance(one, ZeroDivisionError) for one in on_ranks(fails, 3))


def test_cells_of_several_ranks_share_their_nodes():
    """Sums over the cells of a node: every rank gets those of the others, its own counted once."""
    numbers = [np.array([10, 11, 12]), np.array([12, 13, 11])]
    sums = [np.array([[1.0], [2.0], [3.0]]), np.array([[40.0], [50.0], [60.0]])]

    def call(comm):
        geometry = SimpleNamespace(input_global_indices=numbers[comm.rank])
        mesh = SimpleNamespace(comm=comm, dolfinx=SimpleNamespace(geometry=geometry))
        total, count = sums[comm.rank].copy(), np.ones(3)
        part = SimpleNamespace(mesh=mesh, parts=["one"])
        mesh_fields._join_ranks(part, np.arange(3), total, count)
        return total[:, 0].tolist(), count.tolist()

    assert on_ranks(call) == [
        ([1.0, 62.0, 43.0], [1.0, 2.0, 2.0]),
        ([43.0, 50.0, 62.0], [2.0, 1.0, 2.0]),
    ]


def test_memory_that_is_not_there_is_told():
    @platform.collective()
    def work(error):
        raise error

    with pytest.raises(ao.OutOfMemoryError, match="work"):
        work(MemoryError())
    with pytest.raises(ao.OutOfMemoryError, match=r"Unable to allocate"):
        work(MemoryError("Unable to allocate 7.3 TiB"))
    with pytest.raises(ao.OutOfMemoryError, match=r"^as it was$"):
        work(ao.OutOfMemoryError("as it was"))
