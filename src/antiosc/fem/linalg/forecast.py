"""What a Cholesky factor over several ranks will need, and the ordering that needs least.

MUMPS tells how large a factor is when it has made it: it is asked for that of one displacement
component. On one rank CHOLMOD's own analysis tells it exactly (`antiosc.fem.linalg.cholmod`).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from petsc4py import PETSc

#: MUMPS's numbers of its orderings that Debian's build has and that serve here.
AMF, PORD = 2, 4
#: Rows from which it pays to forecast a factorization before it is made.
FORECAST = 30_000


@dataclass(frozen=True)
class Forecast:
    """What a Cholesky factor will need, from that of one displacement component."""

    #: MUMPS's number of the ordering
    ordering: int
    #: entries of the factor, and operations to make it
    entries: float
    operations: float


def forecasts(A: PETSc.Mat) -> list[Forecast]:
    """Forecasts for MUMPS's orderings; empty where A is not blocked by nodes.

    The graph of the nodes decides: of the rows every b-th is taken (one component of each node)
    and factored, at 1/b² of the entries and 1/b³ of the operations.
    """
    block = A.getBlockSize()
    if block == 1:
        return []
    first, last = A.getOwnershipRange()
    rows = PETSc.IS().createStride((last - first) // block, first, block, comm=A.getComm())
    part = A.createSubMatrix(rows, rows)
    part.setOption(PETSc.Mat.Option.SYMMETRIC, True)
    part.setOption(PETSc.Mat.Option.SPD, True)
    found = []
    for ordering in (AMF, PORD):
        ksp = PETSc.KSP().create(A.getComm())
        ksp.setOperators(part)
        ksp.setType(PETSc.KSP.Type.PREONLY)
        pc = ksp.getPC()
        pc.setType(PETSc.PC.Type.CHOLESKY)
        pc.setFactorSolverType("mumps")
        prefix = f"antiosc_forecast_{ordering}_"
        ksp.setOptionsPrefix(prefix)
        PETSc.Options()[prefix + "mat_mumps_icntl_7"] = ordering
        ksp.setFromOptions()
        ksp.setUp()
        factor = pc.getFactorMatrix()
        entries, operations = factor.getMumpsInfog(20), factor.getMumpsRinfog(1)
        found.append(Forecast(ordering, block**2 * count(entries), block**3 * operations))
        ksp.destroy()
    return found


def count(entries: int) -> float:
    """A number of entries as MUMPS gives it: large ones in millions, negative."""
    return float(entries) if entries >= 0 else -1e6 * entries


def best_ordering(A: PETSc.Mat, found: Sequence[Forecast] = ()) -> int:
    """MUMPS's ordering with fewer operations: AMF on thin bodies, PORD on compact ones.

    `found`: forecasts of A, where they were made before.
    """
    if not found and A.getSize()[0] >= FORECAST:
        found = forecasts(A)
    return min(found, key=lambda f: f.operations).ordering if found else AMF
