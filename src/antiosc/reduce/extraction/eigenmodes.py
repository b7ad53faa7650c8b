"""Constraint modes: Kφ = ω²Mφ in the space Bᵀφ = 0, by one factorization of the structure.

Let B be the loads of the sites, A = K + sM and Y = A⁻¹B. The solution of A x = r under Bᵀx = 0 is
A⁻¹r − Y (BᵀY)⁻¹BᵀA⁻¹r. Krylov eigensolvers (SLEPc's, or SciPy's ARPACK) use this operator as
their shift-and-invert transformation. No row is deleted and there is only one factorization.
Without the constraint the same solver computes the natural modes of the structure.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from contextlib import suppress
from dataclasses import dataclass
from functools import partial
from typing import TYPE_CHECKING, TypeAlias

import numpy as np
import scipy.linalg
from scipy.sparse.csgraph import connected_components
from scipy.sparse.linalg import ArpackError, LinearOperator, eigsh

from antiosc.base._types import Array, IntArray, Matrix
from antiosc.base.errors import NotConvergedError
from antiosc.base.progress import doing
from antiosc.fem.linalg.algebra import (
    diagonal,
    dot,
    gathered,
    is_scipy,
    multiply,
    norm,
    row_range,
    typical_eigenvalue,
    uses_strains,
)
from antiosc.fem.platform import on_root
from antiosc.fem.structure.structure import Structure
from antiosc.models.recurrence import Recurrence
from antiosc.reduce.extraction import SiteShapes

if TYPE_CHECKING:
    from petsc4py import PETSc

#: r -> A⁻¹r of vectors (rows,) or blocks (rows, k)
Inverse: TypeAlias = Callable[[Array], Array]

#: Tolerance on the eigenvalues 1/(ω² + s); the residuals are measured again afterwards.
EIGENVALUE_TOLERANCE = 1e-11
#: Modes computed and dropped: the search may find only one shape of a repeated frequency.
EXTRA_MODES = 4
#: Most restarts of SLEPc.
MOST_RESTARTS = 200
#: A search takes as many solves as the models of so many sites.
EQUIVALENT_SITES = 3.0


def _by_arpack(
    structure: Structure, known: Array, wanted: int, computed: int, start: Array, inverse: Inverse
) -> tuple[Array, Array]:
    """(ω² [rad²/s²] (k,), shapes (rows, k)), unsorted, of the `wanted` lowest modes M-orthogonal to
    `known` (rows, m). `start` (rows,) is a vector in the range of `inverse`."""
    known_loads = multiply(structure.M, known)

    def deflated(r: Array) -> Array:
        """A⁻¹r without the components along the known modes: the operator for ARPACK."""
        x = inverse(r)
        return np.asarray(x - known @ (known_loads.T @ x))

    shape = (structure.size, structure.size)

    try:
        values, shapes = eigsh(
            structure.K,
            computed,
            structure.M,
            sigma=-structure.shift,
            OPinv=LinearOperator(shape, deflated, dtype=float),
            v0=start,
            tol=EIGENVALUE_TOLERANCE,
        )
    except ArpackError as error:
        raise NotConvergedError(
            f"ARPACK did not find {wanted} modes ({error}): ask for fewer modes."
        ) from error

    return values, shapes


def _by_slepc(
    structure: Structure, known: Array, wanted: int, computed: int, start: Array, inverse: Inverse
) -> tuple[Array, Array]:
    """(ω², shapes) as from `_by_arpack`, by SLEPc's Krylov–Schur method over all ranks."""
    from petsc4py import PETSc
    from slepc4py import SLEPc

    from antiosc.fem.linalg.petsc_algebra import use_inverse  # needs PETSc

    eps = SLEPc.EPS().create(structure.K.getComm())
    eps.setOperators(structure.K, structure.M)
    eps.setProblemType(SLEPc.EPS.ProblemType.GHEP)
    eps.setType(SLEPc.EPS.Type.KRYLOVSCHUR)
    eps.setDimensions(computed)
    eps.setWhichEigenpairs(SLEPc.EPS.Which.TARGET_MAGNITUDE)
    eps.setTarget(-structure.shift)
    eps.setTolerances(EIGENVALUE_TOLERANCE, MOST_RESTARTS)
    eps.setPurify(False)  # below, of all shapes in one block
    st = eps.getST()
    st.setType(SLEPc.ST.Type.SINVERT)
    st.setMatMode(SLEPc.ST.MatMode.SHELL)  # the factor is ours: SLEPc needs no K + sM
    use_inverse(st.getKSP(), inverse)
    eps.setInitialSpace([_petsc_vector(structure.K, start)])
    if known.shape[1]:
        eps.setDeflationSpace([_petsc_vector(structure.K, shape) for shape in known.T])

    try:
        eps.solve()
    except (PETSc.Error, SystemError) as error:  # code 95: a vector with xᵀMx < 0, by rounding
        code = getattr(error, "ierr", None) or getattr(error.__cause__, "ierr", None)
        eps.incRef()  # SLEPc 3.25 cannot destroy what it broke off
        raise NotConvergedError(
            f"SLEPc broke off (PETSc's error {code}): of structures of equal parts whose "
            "motions have little mass the search finds no further shapes; ask for other modes, or "
            "give the parts slightly different sections."
        ) from None

    count = eps.getConverged()
    if count < wanted:
        raise NotConvergedError(
            f"SLEPc found {count} of {wanted} modes within {eps.getIterationNumber()} "
            f"restarts (reason {eps.getConvergedReason()}): ask for fewer modes."
        )
    x = structure.K.createVecRight()
    values = np.zeros(count)
    shapes = np.zeros((structure.rows, count))
    for k in range(count):
        values[k] = eps.getEigenpair(k, x).real
        shapes[:, k] = x.array_r
    eps.destroy()

    # a step of the operator removes what has no mass, which the search cannot see
    return values, inverse(multiply(structure.M, shapes))


def _petsc_vector(K: PETSc.Mat, values: Array) -> PETSc.Vec:
    """A PETSc vector with the parallel layout of K and `values` on this rank."""
    x = K.createVecRight()
    x.setArray(values)
    return x


#: LAPACK computes all modes of structures with at most this many rows, on one rank, if more than a
#: fifth of all modes is wanted: Krylov methods are efficient only at the ends of a spectrum.
MOST_DENSE_ROWS = 5000
#: Fewest additional modes of the next search if one has not reached its frequency.
LEAST_EXTRA_MODES = 8
#: A shape has no mass if φᵀMφ over the sum of the absolute values of its terms is below this.
MASSLESS_SHARE = 1e-12
#: A step of `polish` leaves the square of what it mixes: modes that it would mix by more are close.
CLOSE_MIXING = 1e-4
#: Relative residual of forces above which natural modes are searched again, unless rounding of K
#: leaves more: 1.0 to 1.4 times the estimate in clamped and free rulers; the error of ω² is its
#: square.
NATURAL_RESIDUAL, ROUNDING_FACTOR, LARGEST_ROUNDING = 1e-6, 30.0, 1e-3
#: Relative residual of forces above which constraint modes are searched again.
CONSTRAINT_RESIDUAL = 1e-3


@dataclass(frozen=True)
class Modes:
    """The lowest modes found, in ascending order of frequency."""

    #: circular frequencies (k,), rad/s: antiresonances of the site if it is constrained
    omega: Array
    #: M-orthonormal shapes on the rows of this rank (rows, k)
    phi: Array
    #: whether these are all modes that the structure has
    complete: bool
    #: data that bound the motion outside the Krylov space; None for another method
    recurrence: Recurrence | None = None


class ModeSolver:
    """Finds the lowest elastic modes in rounds: natural modes, or constraint modes.

    `held` gives the sites at which constraint modes vanish; with None it finds natural modes.
    """

    def __init__(self, structure: Structure, held: SiteShapes | None = None) -> None:
        self._structure = structure
        self._rows = structure.rows
        self._held = held

        #: rigid-body modes to which all modes found are orthogonal
        self._rigid = structure.rigid_modes if held is None else held.nodal
        sites = 0 if held is None else held.load.shape[1]
        self.limit = structure.dofs - sites - self._rigid.shape[1]
        self._found = Modes(np.zeros(0), np.zeros((self._rows, 0)), False)

    def lowest(
        self,
        count: int,
        enough: Callable[[Modes], bool] = lambda modes: True,
        most: float = math.inf,
    ) -> Modes:
        """At least `count` lowest modes, and more until `enough(modes)` or `most` is reached."""
        modes = self._at_least(count)
        while not (modes.complete or len(modes.omega) >= most or enough(modes)):
            known = len(modes.omega)
            modes = self._at_least(int(min(known + max(LEAST_EXTRA_MODES, known // 2), most)))
        return modes

    def _at_least(self, count: int) -> Modes:
        """At least `count` lowest modes; modes found in earlier rounds are not computed again."""
        count = min(count, self.limit)
        if self._found.complete or len(self._found.omega) >= count:
            return self._found
        rows = self._structure.size
        if rows <= MOST_DENSE_ROWS and count > rows / 5:
            self._found = self._by_lapack()
        else:
            try:
                self._found = self._by_krylov(count)
            except NotConvergedError:
                if rows > MOST_DENSE_ROWS:
                    raise
                self._found = self._by_lapack()

        return self._found

    def _by_krylov(self, count: int) -> Modes:
        """The `count` lowest modes, known ones and those of another search. Repeated parts may end
        the Krylov space early: shapes with large residuals are then rejected, and the modes are
        found by LAPACK or one more search."""
        structure = self._structure
        found_modes = self._found
        known_count = len(found_modes.omega)
        shapes = np.column_stack([self._rigid, found_modes.phi])
        wanted = count - known_count
        computed = min(wanted + EXTRA_MODES, self.limit - known_count)
        solver = structure.factorize(EQUIVALENT_SITES)
        method = _by_arpack if is_scipy(structure.K) else _by_slepc
        with doing(f"search of {computed} modes of {structure.dofs} dofs"), solver.accurately():
            random = np.random.default_rng(structure.comm.rank).standard_normal(self._rows)
            start = solver.solve(multiply(structure.M, random))
            values, vectors = method(structure, shapes, wanted, computed, start, self._inverse)

        # a displacement without mass has θ = 1/(ω² + s) = 0, in rounding of either sign
        massive = values > -structure.shift
        values = values[massive]
        vectors = vectors[:, massive]
        omega = np.concatenate([found_modes.omega, np.sqrt(np.maximum(values, 0.0))])

        # the solve amplifies the rigid-body modes in their rounding
        rigid_shares = dot(structure.comm, multiply(structure.M, self._rigid), vectors)
        vectors = vectors - self._rigid @ rigid_shares
        phi = _normalised(structure, np.column_stack([found_modes.phi, vectors]))
        order = np.argsort(omega, kind="stable")[:count]
        complete = len(omega) >= self.limit or not massive.all()
        modes = Modes(omega[order], phi[:, order], complete)

        # those of slender beams span so many decades of ω² that the first show in the last
        modes = _polished(structure, modes) if uses_strains(structure.K) else modes
        limit = rounding_residuals(structure, modes) if self._held is None else CONSTRAINT_RESIDUAL
        right = residuals(structure, modes, self._held) <= limit
        if not right.all() and structure.size <= MOST_DENSE_ROWS:
            raise NotConvergedError("shapes are not what the search takes them for")  # to LAPACK
        if right.all() or right.sum() <= known_count:
            return modes
        self._found = Modes(modes.omega[right], modes.phi[:, right], False)
        return self._by_krylov(count)

    def _inverse(self, r: Array) -> Array:
        """A⁻¹r for loads r (rows,) or (rows, k); constrained sites are kept at rest."""
        block = r[:, None] if r.ndim == 1 else r
        x = self._structure.factorize().solve_block(block).reshape(r.shape)
        return x if self._held is None else self._held.constrained(self._structure.comm, x)

    def _by_lapack(self) -> Modes:
        """All modes of a small structure, from (M, K + σM) with σ within the spectrum."""
        structure = self._structure
        comm = self._structure.comm
        conditions = multiply(structure.M, self._rigid)
        if self._held is not None:
            conditions = np.column_stack([self._held.load, conditions])
        first = row_range(structure.K)[0]
        free_rows = np.setdiff1d(np.arange(self._rows), structure.fixed)
        parts = comm.gather((first + free_rows, conditions[free_rows])) or []
        K, M = (gathered(matrix, 0) for matrix in (structure.K, structure.M))
        sigma = float(np.sqrt(self._lowest() * typical_eigenvalue(structure.K, structure.M)))

        omega, phi = on_root(comm, partial(_dense_modes, K, M, parts, sigma))
        phi = phi[first : first + self._rows]
        return _polished(structure, Modes(omega, _normalised(structure, phi), True))

    def _lowest(self) -> float:
        """Estimate of the lowest ω² + shift [rad²/s²], by inverse iteration."""
        structure = self._structure
        x = np.random.default_rng(structure.comm.rank).standard_normal(self._rows)
        for _ in range(4):
            x = structure.factorize().solve(multiply(structure.M, x / norm(structure.comm, x)))
        K, M = structure.K, structure.M
        strain, mass = (float(dot(structure.comm, x, multiply(matrix, x))) for matrix in (K, M))
        return strain / mass + structure.shift


def _dense_modes(
    K: Matrix, M: Matrix, parts: list[tuple[IntArray, Array]], sigma: float
) -> tuple[Array, Array]:
    """(ω ascending, shapes) of all modes; `parts`: (free rows, constraints on them) by rank."""
    free, conditions = (np.concatenate(arrays) for arrays in zip(*parts, strict=True))
    stiffness, mass = (matrix[free][:, free].toarray() for matrix in (K, M))
    conditions = conditions / np.linalg.norm(conditions, axis=0)
    basis = scipy.linalg.qr(conditions)[0][:, conditions.shape[1] :]
    A = basis.T @ (stiffness + sigma * mass) @ basis
    theta, vectors = scipy.linalg.eigh(basis.T @ mass @ basis, (A + A.T) / 2)
    shapes = basis @ vectors

    # displacements without mass have no frequency: what they seem to have is rounding of M's terms
    terms = np.einsum("ij,ij->j", np.abs(shapes), np.abs(mass) @ np.abs(shapes))
    is_elastic = (theta > 1e-14 * theta.max(initial=0.0)) & (theta > MASSLESS_SHARE * terms)
    omega = np.sqrt(np.maximum(1 / theta[is_elastic] - sigma, 0.0))[::-1]
    phi = np.zeros((K.shape[0], int(is_elastic.sum())))
    phi[free] = shapes[:, is_elastic][:, ::-1]
    return omega, phi


def residuals(structure: Structure, modes: Modes, sites: SiteShapes | None = None) -> Array:
    """Relative residuals (k,) ‖Kφ - ω²Mφ − reactions at `sites`‖ / ‖Kφ‖ of the modes."""
    forces = multiply(structure.K, modes.phi)
    residual_forces = forces - multiply(structure.M, modes.phi) * modes.omega**2
    if sites is not None:  # loadᵀΦ = 1 gives the reactions
        reactions = dot(structure.comm, sites.phi, residual_forces)
        residual_forces = residual_forces - sites.load @ reactions

    sizes = structure.factorize().force_sizes(np.hstack([residual_forces, forces]))
    size_of_residual, size = np.split(sizes, 2)
    return np.asarray(size_of_residual / np.maximum(size, np.finfo(float).tiny))


def rounding_residuals(structure: Structure, modes: Modes) -> Array:
    """Relative residuals (k,) caused by rounding of K alone; they are large for slender parts."""
    entries = diagonal(structure.K)[:, None]
    signs = np.random.default_rng(0).choice([-1.0, 1.0], modes.phi.shape)
    rounded = float(np.finfo(float).eps) * signs * entries * modes.phi

    forces = multiply(structure.K, modes.phi)
    sizes = structure.factorize().force_sizes(np.hstack([rounded, forces]))
    size_of_rounded, size = np.split(sizes, 2)
    share = size_of_rounded / np.maximum(size, np.finfo(float).tiny)
    return np.clip(ROUNDING_FACTOR * share, NATURAL_RESIDUAL, LARGEST_ROUNDING)


def _polished(structure: Structure, modes: Modes) -> Modes:
    """The modes, refined once by `polish`."""

    def gram(matrix: Matrix, phi: Array) -> Array:
        """Products φᵀ matrix φ (k, k)."""
        return np.asarray(dot(structure.comm, phi, multiply(matrix, phi)))

    poles, phi = polish(modes.phi, lambda x: gram(structure.K, x), lambda x: gram(structure.M, x))
    omega = np.sqrt(np.maximum(poles, 0.0))
    order = np.argsort(omega, kind="stable")
    return Modes(omega[order], phi[:, order], modes.complete)


def polish(
    phi: Array, strains: Callable[[Array], Array], masses: Callable[[Array], Array]
) -> tuple[Array, Array]:
    """(ω², φ) improved by two steps of Ogita and Aishima (Japan J. Indust. Appl. Math. 35 (2018)
    1007): a dense eigensolver errs in ω² by ε times the highest ω². `strains` and `masses` are the
    functions φ -> φᵀKφ and φ -> φᵀMφ."""
    poles = np.zeros(phi.shape[1])
    for _ in range(2):
        strain, mass = (_symmetric(products(phi)) for products in (strains, masses))
        turned = _close_separated(strain, mass)
        strain, mass = (_symmetric(turned.T @ one @ turned) for one in (strain, mass))
        poles, mixing, _ = _polish_step(strain, mass)
        phi = phi @ (turned + turned @ mixing)

    return poles, phi


def _symmetric(products: Array) -> Array:
    """Symmetric part: the skew part is rounding, which closely spaced ω² would amplify."""
    return (products + products.T) / 2


def _polish_step(strain: Array, mass: Array) -> tuple[Array, Array, Array]:
    """(ω² (k,), correction T (k, k) with φ + φT improved, mask (k, k) of pairs of close modes)."""
    mass_error = mass - np.eye(len(mass))
    poles = np.diag(strain) / np.diag(mass)
    gap = poles[:, None] - poles
    wanted = poles * mass_error - strain
    close = np.abs(wanted) >= CLOSE_MIXING * np.abs(gap)
    close = close | close.T
    return poles, np.where(close, -mass_error / 2, wanted / np.where(close, 1.0, gap)), close


def _close_separated(strain: Array, mass: Array) -> Array:
    """Matrix (k, k) that diagonalises φᵀKφ and φᵀMφ within each group of close modes."""
    turned = np.eye(len(mass))
    groups, group_of = connected_components(_polish_step(strain, mass)[2], directed=False)
    for group in range(groups):
        members = np.flatnonzero(group_of == group)
        if len(members) > 1:
            block = np.ix_(members, members)
            with suppress(np.linalg.LinAlgError):  # modes of no mass: the check refuses them
                turned[block] = scipy.linalg.eigh(strain[block], mass[block])[1]

    return turned


def _normalised(structure: Structure, phi: Array) -> Array:
    """Shapes scaled to unit modal mass φᵀMφ."""
    masses = structure.comm.allreduce(np.einsum("ij,ij->j", phi, multiply(structure.M, phi)))
    return phi / np.sqrt(masses)
