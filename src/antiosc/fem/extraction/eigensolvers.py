"""The lowest modes by the Krylov eigensolver of a library, with the structure's own factor."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
from scipy.sparse.linalg import ArpackError, LinearOperator, eigsh

from antiosc.base._types import Array
from antiosc.base.errors import NotConvergedError
from antiosc.fem.extraction.site_shapes import SiteShapes
from antiosc.fem.linalg.algebra import by_scipy, multiply
from antiosc.fem.structure.structure import Structure

if TYPE_CHECKING:
    from petsc4py import PETSc

#: Tolerance on the eigenvalues 1/(ω² + s); the residuals are measured again afterwards.
RESIDUAL = 1e-11
#: Number of additional modes that are computed and dropped: of a repeated frequency the search may
#: have found only one of the shapes.
GUARD = 4
#: Most restarts of SLEPc.
RESTARTS = 200


@dataclass(frozen=True)
class Search:
    """The lowest modes of a structure beside those that are known."""

    structure: Structure
    #: the sites that are constrained; None for natural modes
    held: SiteShapes | None
    #: M-orthonormal shapes that are deflated (rows of this rank, k)
    known: Array
    #: number of modes to find, and the number that there is
    wanted: int
    limit: int

    @property
    def computed(self) -> int:
        """Number of modes to compute."""
        return min(self.wanted + GUARD, self.limit)

    def inverse(self, r: Array) -> Array:
        """A⁻¹r − Y (BᵀY)⁻¹BᵀA⁻¹r; A⁻¹r for natural modes."""
        x = self.structure.factorize().solve(r)
        return x if self.held is None else self.held.constrained(self.structure.comm, x)

    def start(self) -> Array:
        """A random vector in the range of A⁻¹M."""
        structure = self.structure
        random = np.random.default_rng(structure.comm.rank).standard_normal(structure.rows)
        return structure.factorize().solve(multiply(structure.M, random))


def lowest(search: Search) -> tuple[Array, Array]:
    """(ω² [rad²/s²], shapes (rows of this rank, k)) of at least the modes wanted, in any order."""
    return _by_arpack(search) if by_scipy(search.structure.K) else _by_slepc(search)


def _by_arpack(search: Search) -> tuple[Array, Array]:
    """By ARPACK, for SciPy matrices."""
    structure, known = search.structure, search.known
    known_loads = multiply(structure.M, known)

    def inverse(r: Array) -> Array:
        x = search.inverse(r)
        return np.asarray(x - known @ (known_loads.T @ x))

    shape = (structure.size, structure.size)
    try:
        values, shapes = eigsh(
            structure.K,
            search.computed,
            structure.M,
            sigma=-structure.shift,
            OPinv=LinearOperator(shape, inverse, dtype=float),
            v0=search.start(),
            tol=RESIDUAL,
        )
    except ArpackError as error:
        raise NotConvergedError(
            f"ARPACK did not find {search.wanted} modes ({error}): ask for fewer modes."
        ) from error
    return values, shapes


def _by_slepc(search: Search) -> tuple[Array, Array]:
    """By SLEPc's Krylov–Schur method."""
    from petsc4py import PETSc
    from slepc4py import SLEPc

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
    eps.solve()
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
