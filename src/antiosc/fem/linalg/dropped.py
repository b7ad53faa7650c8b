"""The memory of PETSc's objects that Python has dropped.

petsc4py hands a dropped object over to PETSc, which keeps it until all ranks of its communicator
ask for its end together (PETSc's manual page of PetscGarbageCleanup); before PETSc 3.19 on one rank
too. A communicator belongs to one mesh, so nobody would ever ask. Here it is asked for on one rank
as soon as an object is dropped, and on several at the next structure, where they meet.
"""

from __future__ import annotations

import weakref

from mpi4py import MPI
from petsc4py import PETSc

from antiosc.fem.mpi import alike

#: Objects on several ranks, with what holds their communicator, in the order of creation.
_shared: list[tuple[weakref.ref[PETSc.Object], PETSc.IS]] = []


def watch(made: PETSc.Object) -> None:
    """Have the memory of `made`, and of all dropped before it, freed when it is dropped."""
    holder = PETSc.IS().createGeneral([], comm=made.getComm())
    if holder.getComm().getSize() == 1:
        weakref.finalize(made, _free, holder).atexit = False
    else:
        _shared.append((weakref.ref(made), holder))


def free(comm: MPI.Comm) -> None:
    """Free what all ranks of `comm` have dropped. Collective."""
    if comm.size == 1:
        return
    entries = [entry for entry in _shared if alike(entry[1].getComm().tompi4py(), comm)]
    dropped = comm.allgather([made() is None for made, _ in entries])
    for entry, *everywhere in zip(entries, *dropped, strict=True):
        if all(everywhere):
            _shared.remove(entry)
            _free(entry[1])


def _free(holder: PETSc.IS) -> None:
    if PETSc.Sys.isInitialized() and not PETSc.Sys.isFinalized():
        PETSc.garbage_cleanup(holder.getComm())
        holder.destroy()
