"""The communicator of a single process, for matrices without MPI (mpi4py is optional)."""

from __future__ import annotations

from typing import Any


class Serial:
    """What antiosc uses of an MPI communicator, on one rank."""

    rank, size = 0, 1

    def allreduce(self, value: Any) -> Any:
        """The sum over the one rank."""
        return value

    def allgather(self, value: Any) -> list[Any]:
        """The values of all ranks."""
        return [value]

    def gather(self, value: Any, root: int = 0) -> list[Any]:
        """The values of all ranks, on `root`."""
        return [value]

    def bcast(self, value: Any, root: int = 0) -> Any:
        """The value of rank `root`."""
        return value


SERIAL = Serial()
