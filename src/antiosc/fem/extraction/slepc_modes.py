"""The lowest modes by SLEPc's Krylov–Schur method, with the structure's own factor."""

from __future__ import annotations

from typing import Any

import numpy as np
from petsc4py import PETSc
from slepc4py import SLEPc

from antiosc.base._types import Array
from antiosc.base.errors import NotConvergedError
from antiosc.fem.extraction.mode_search import RESIDUAL, Search

#: Most restarts.
RESTARTS = 200


def lowest(search: Search) -> tuple[Array, Array]:
    """(ω² [rad²/s²], shapes (rows of this rank, k)) of at least the modes wanted, in any order."""
    structure = search.structure
    eps = SLEPc.EPS().create(structure.K.getComm())
    eps.setOperators(structure.K, structure.M)
    eps.setProblemType(SLEPc.EPS.ProblemType.GHEP)
    eps.setType(SLEPc.EPS.Type.KRYLOVSCHUR)
    eps.setDimensions(search.computed)
    eps.setWhichEigenpairs(SLEPc.EPS.Which.TARGET_MAGNITUDE)
    eps.setTarget(-structure.shift)
    eps.setTolerances(RESIDUAL, RESTARTS)
    st = eps.getST()
    st.setType(SLEPc.ST.Type.SINVERT)
    st.setMatMode(SLEPc.ST.MatMode.SHELL)  # the factor is ours: SLEPc needs no K + sM
    ksp = st.getKSP()
    ksp.setType(PETSc.KSP.Type.PREONLY)
    pc = ksp.getPC()
    pc.setType(PETSc.PC.Type.PYTHON)
    pc.setPythonContext(_Inverse(search))
    eps.setInitialSpace([_vector(structure.K, search.start())])
    if search.known.shape[1]:
        eps.setDeflationSpace([_vector(structure.K, shape) for shape in search.known.T])
    try:
        eps.solve()
    except PETSc.Error as error:  # code 95: a vector with xᵀMx < 0, which is rounding
        raise NotConvergedError(
            f"SLEPc broke off (PETSc's error {error.ierr}): of structures of equal parts whose "
            "motions have little mass the search finds no further shapes; ask for other modes, or "
            "give the parts slightly different sections."
        ) from None
    found = eps.getConverged()
    if found < search.wanted:
        raise NotConvergedError(
            f"SLEPc found {found} of {search.wanted} modes within {eps.getIterationNumber()} "
            f"restarts (reason {eps.getConvergedReason()}): ask for fewer modes."
        )
    x = structure.K.createVecRight()
    values, shapes = np.zeros(found), np.zeros((structure.rows, found))
    for k in range(found):
        values[k] = eps.getEigenpair(k, x).real
        shapes[:, k] = x.array_r
    eps.destroy()
    return values, shapes


def _vector(K: PETSc.Mat, values: Array) -> PETSc.Vec:
    x = K.createVecRight()
    x.setArray(values)
    return x


class _Inverse:
    """PETSc's Python preconditioner: the inverse of the search."""

    def __init__(self, search: Search) -> None:
        self._search = search

    def apply(self, pc: Any, r: PETSc.Vec, x: PETSc.Vec) -> None:
        x.setArray(self._search.inverse(r.array_r))
