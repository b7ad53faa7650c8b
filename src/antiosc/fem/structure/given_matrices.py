"""K and M of another code: checks of their entries, and penalties that act as supports.

The scale of an entry K_ij is √(K_ii K_jj), which it cannot exceed in a positive semidefinite
matrix. A norm of the whole matrix is no scale: if supports are penalties, such as FreeFEM's 1e30 on
the diagonal, all other entries are below its rounding.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Literal, get_args

import numpy as np
import scipy.sparse
from numpy.typing import ArrayLike

from antiosc import fem
from antiosc.base._types import Array, BoolArray, IntArray, Matrix
from antiosc.base.checks import LARGEST, SMALLEST, floats
from antiosc.base.errors import InputError, finite_element_packages
from antiosc.fem.linalg import algebra
from antiosc.fem.linalg.algebra import communicator
from antiosc.fem.linalg.solver import Solver
from antiosc.fem.platform import agree, agreed, alike, of_petsc
from antiosc.fem.structure import NodalMatrices, StructureMatrices, modes_and_shift
from antiosc.io.matrices import DofMap, rows_of

if TYPE_CHECKING:
    from mpi4py import MPI
    from petsc4py import PETSc

#: Of the algebra: "auto" is PETSc where it is installed.
Backend = Literal["auto", "petsc", "scipy"]
BACKENDS = get_args(Backend)

#: Difference of mirrored entries over √(a_ii a_jj) that the other program may leave by rounding.
MIRRORED = 1e-9
#: Share of the typical diagonal entry below which an entry is rounding.
ENTRY_ROUNDING = 1e-15
#: A diagonal entry that holds a dof, over the sum of the row's other entries: the dof moves 1e-14
#: of what its neighbours do.
PENALTY_OVER_ROW = 1e14
#: The same entry over the typical one of all rows.
PENALTY_OVER_TYPICAL = 1e12
#: A coupling that leaves less than four digits of what is coupled.
DOMINATES = 1e12


# -- one matrix


def copied(name: str, matrix: Matrix, backend: Backend) -> Matrix:
    """A checked copy of a square matrix (SciPy, dense or PETSc) in the chosen library."""
    is_petsc = of_petsc(matrix)
    if backend == "petsc" or (backend == "auto" and (is_petsc or fem.missing is None)):
        copy = as_petsc(name, matrix)
    else:
        copy = _csr_of_petsc(name, matrix) if is_petsc else _csr_of_arrays(name, matrix)
        _check_square(name, copy.shape)
        _check_values(name, copy.data)
    return copy


def as_petsc(name: str, matrix: Matrix) -> PETSc.Mat:
    """A square, finite PETSc matrix from a SciPy, dense or PETSc one; always a copy."""
    with finite_element_packages():
        from antiosc.fem.linalg import petsc_algebra
    if of_petsc(matrix):
        copy = petsc_algebra.copied(name, matrix)
    else:
        copy = petsc_algebra.from_csr(name, _csr_of_arrays(name, matrix))
    _check_square(name, copy.getSize())
    agreed(communicator(copy), lambda: _check_values(name, algebra.entries(copy)[2]))
    return copy


def _csr_of_petsc(name: str, matrix: PETSc.Mat) -> scipy.sparse.csr_matrix:
    from antiosc.fem.linalg import petsc_algebra

    copy = petsc_algebra.copied(name, matrix)
    if communicator(copy).size > 1:
        raise InputError(f"{name} is spread over MPI ranks: SciPy's back-end works on one rank.")
    return petsc_algebra.csr(copy)


def _check_square(name: str, shape: tuple[int, int]) -> None:
    if shape[0] != shape[1] or not shape[0]:
        raise InputError(f"{name} must be square; got {shape[0]} rows and {shape[1]} columns.")


def _csr_of_arrays(name: str, matrix: Matrix) -> scipy.sparse.csr_matrix:
    """A sorted copy of a SciPy or dense matrix of real numbers; InputError for anything else."""
    sparse = scipy.sparse.issparse(matrix)
    try:
        entries: Matrix = matrix if sparse else np.asarray(matrix)
    except Exception:  # rows of different lengths, or objects that are no arrays at all
        entries = np.zeros(())

    if not sparse and entries.ndim == 0:
        raise InputError(
            f"{name} must be a SciPy sparse, dense or PETSc matrix; got {type(matrix).__name__}."
        )
    if entries.ndim != 2:
        raise InputError(f"{name} must be square; got an array of shape {entries.shape}.")
    if isinstance(matrix, np.ma.MaskedArray) and np.ma.is_masked(matrix):
        raise InputError(f"{name} must be given without masked entries.")
    if entries.dtype.kind not in "iuf":
        raise InputError(
            f"{name} must hold real numbers; got entries of type {entries.dtype} (of complex ones "
            f"give {name}.real: damping is added later)."
        )

    with np.errstate(over="ignore"):  # a long double above 1e308 becomes inf, refused later
        result = scipy.sparse.csr_matrix(entries, dtype=float, copy=True)
    result.sum_duplicates()
    result.sort_indices()
    return result


def _check_values(name: str, values: Array) -> None:
    if not np.isfinite(values).all():
        raise InputError(f"{name} holds NaN or infinite entries; antiosc needs finite matrices.")
    largest = np.abs(values).max(initial=0.0)
    if largest > LARGEST:
        raise InputError(
            f"{name} has an entry of {largest:g}; entries must not exceed {LARGEST:g} in magnitude "
            "(a penalty of 1e30 is sufficient)."
        )
    if 0.0 < largest < SMALLEST:
        raise InputError(
            f"{name} has no entry above {largest:g} in magnitude; the largest must be at least "
            f"{SMALLEST:g}: check the units, which are SI."
        )


# -- K and M together


def matrices_of_pair(
    K: Matrix,
    M: Matrix,
    rows: DofMap | None,
    supports: Mapping[int, str | Sequence[str]] | None,
    rigid_modes: ArrayLike | None,
    C: Matrix | None = None,
) -> tuple[StructureMatrices, Solver | None]:
    """Checked matrices with their supports and null vectors, and the solver of a regular K.

    C is the damping matrix; `rows` is the `map`, and `supports` and `rigid_modes` are those of
    `Structure.from_matrices`.
    """
    K, M, fixed = supported(K, M)
    if supports is not None:
        fixed_rows = rows_of(supports, rows)
        K = algebra.hold(K, fixed_rows, 1.0)
        M = algebra.hold(M, fixed_rows, 0.0)
        fixed = np.union1d(fixed, fixed_rows)
    null_vectors = None
    if rigid_modes is not None:
        null_vectors = floats("rigid_modes", rigid_modes, (algebra.rows(K), None))
    modes, shift, factor = modes_and_shift(K, M, null_vectors)
    parts = K, M, fixed, modes, shift
    if C is not None:
        C = _damping(C, K, fixed)
    if rows is None:
        return StructureMatrices(*parts, C=C), factor
    return NodalMatrices(*parts, C=C, map=rows), factor


def _damping(C: Matrix, K: Matrix, fixed: IntArray) -> Matrix:
    """C without the rows of fixed dofs; InputError if it is not a damping matrix."""
    if algebra.size(C) != algebra.size(K) or algebra.row_range(C) != algebra.row_range(K):
        raise InputError(
            f"C must be of the size and distribution of K; got {algebra.size(C)} rows for "
            f"{algebra.size(K)}."
        )
    _checked_entries("C", C)
    first, _ = algebra.row_range(C)
    return algebra.hold(C, fixed[fixed < algebra.rows(C)] + first, 0.0)


@dataclass(frozen=True)
class _Entries:
    """Off-diagonal entries of a matrix on this rank, and its whole diagonal."""

    row: IntArray
    column: IntArray
    value: Array
    #: (n,) on every rank
    diagonal: Array
    #: √(a_ii a_jj) of each entry, and what of it is rounding
    scale: Array
    noise: float


def supported(K: Matrix, M: Matrix) -> tuple[Matrix, Matrix, IntArray]:
    """Check K and M, and turn penalties into supports: rows and columns zero, 1 on K's diagonal.

    Returns both, and the dofs of this rank that are fixed by penalties.

    Raises
    ------
    InputError
        Matrices that are not a stiffness and a mass matrix, and penalties that couple dofs and hide
        their stiffness by rounding.
    """
    sizes = [(algebra.size(matrix),) * 2 for matrix in (K, M)]
    if sizes[0] != sizes[1]:
        raise InputError(f"K and M must be of one size; got {sizes[0]} and {sizes[1]}.")
    comm = communicator(K)
    same_ranks = alike(comm, communicator(M))
    if not same_ranks or not all(comm.allgather(algebra.row_range(K) == algebra.row_range(M))):
        raise InputError("K and M must have the same distribution over the MPI ranks.")
    of_K, of_M = (_checked_entries(name, matrix) for name, matrix in (("K", K), ("M", M)))
    empty = np.flatnonzero((of_K.diagonal == 0) & (of_M.diagonal == 0))
    if len(empty):
        raise InputError(
            f"{len(empty)} dofs have neither stiffness nor mass, the first is {empty[0]}: leave "
            "their rows and columns out."
        )
    constrained = _penalised(comm, of_K)
    stray = np.setdiff1d(_penalised(comm, of_M), constrained)
    if len(stray):
        raise InputError(
            f"M has a penalty on its diagonal ({of_M.diagonal[stray[0]]:g} in row {stray[0]}) and "
            "K has none there: apply supports to K."
        )
    _check_couplings(comm, of_K, constrained)
    first, last = algebra.row_range(K)
    of_rank = constrained[(constrained >= first) & (constrained < last)]
    if len(constrained):
        K = algebra.hold(K, of_rank, 1.0)
        M = algebra.hold(M, of_rank, 0.0)
    return K, M, of_rank - first


def _checked_entries(name: str, matrix: Matrix) -> _Entries:
    """The entries of a matrix, checked for signs of asymmetry and indefiniteness."""
    comm = communicator(matrix)
    diagonal = np.concatenate(comm.allgather(algebra.diagonal(matrix)))
    if not diagonal.any() and not any(comm.allgather(algebra.entries(matrix)[2].any())):
        raise InputError(f"{name} is zero: a structure needs stiffness and mass.")
    typical = np.median(np.abs(diagonal[diagonal != 0])) if diagonal.any() else 0.0
    smallest = int(np.argmin(diagonal))
    if diagonal[smallest] < -ENTRY_ROUNDING * typical:
        raise InputError(
            f"{name} must be positive semidefinite; its diagonal has {diagonal[smallest]:g} in row "
            f"{smallest}."
        )
    noise = ENTRY_ROUNDING * typical
    asymmetry, entries = (_entries(A, diagonal, noise) for A in (algebra.skew(matrix), matrix))
    _forbid(
        comm,
        asymmetry,
        np.abs(asymmetry.value) > MIRRORED * asymmetry.scale + asymmetry.noise,
        f"{name} must be symmetric (to {MIRRORED:g} of √(a_ii a_jj)); its entries ({{0}}, {{1}}) "
        "and ({1}, {0}) differ by {2:g}.",
    )
    _forbid(
        comm,
        entries,
        np.abs(entries.value) > (1 + MIRRORED) * entries.scale + entries.noise,
        f"{name} must be positive semidefinite; its entry ({{0}}, {{1}}) = {{2:g}} exceeds "
        "√(a_ii a_jj) = {3:g}.",
    )
    return entries


def _entries(matrix: Matrix, diagonal: Array, noise: float) -> _Entries:
    pointers, column, value = algebra.entries(matrix)
    row = algebra.row_range(matrix)[0] + np.repeat(np.arange(len(pointers) - 1), np.diff(pointers))
    off_diagonal = (row != column) & (value != 0)
    row = row[off_diagonal]
    column = column[off_diagonal]
    value = value[off_diagonal]
    roots = np.sqrt(np.maximum(diagonal, 0.0))
    return _Entries(row, column, value, diagonal, roots[row] * roots[column], noise)


def _forbid(comm: MPI.Comm, entries: _Entries, bad: BoolArray, text: str) -> None:
    """InputError on all ranks if entries are `bad`; `text` formats row, column, value, scale."""
    error = None
    if bad.any():
        k = int(np.argmax(bad))
        numbers = entries.row[k], entries.column[k], abs(entries.value[k]), entries.scale[k]
        error = InputError(text.format(*numbers))
    agree(comm, error)


def _typical(comm: MPI.Comm, entries: _Entries) -> float:
    """Median size of the off-diagonal entries, which a few penalties do not change; 0 of none."""
    size = np.abs(entries.value)
    smaller_diagonal = np.minimum(entries.diagonal[entries.row], entries.diagonal[entries.column])
    sizes = np.concatenate(comm.allgather(size[size > ENTRY_ROUNDING * smaller_diagonal]))
    if len(sizes):
        return float(np.median(sizes))
    return 0.0


def _penalised(comm: MPI.Comm, entries: _Entries) -> IntArray:
    """Numbers, on every rank, of the dofs that a penalty on the diagonal fixes."""
    typical = _typical(comm, entries)
    if not typical:
        return np.zeros(0, dtype=int)
    row_sums = np.bincount(entries.row, np.abs(entries.value), len(entries.diagonal))
    row_sums = comm.allreduce(row_sums)
    return np.flatnonzero(
        (entries.diagonal > PENALTY_OVER_ROW * row_sums)
        & (entries.diagonal > PENALTY_OVER_TYPICAL * typical)
    )


def _check_couplings(comm: MPI.Comm, entries: _Entries, constrained: IntArray) -> None:
    """InputError for a penalty between two dofs that drowns their own stiffness in rounding."""
    typical = _typical(comm, entries)
    large = np.abs(entries.value) > DOMINATES * (typical or np.inf)
    large &= ~np.isin(entries.row, constrained) & ~np.isin(entries.column, constrained)
    small = np.zeros(len(entries.diagonal))
    np.maximum.at(small, entries.row[~large], np.abs(entries.value[~large]))
    small = np.max(comm.allgather(small), axis=0)
    neighbours = np.maximum(small[entries.row], small[entries.column])
    _forbid(
        comm,
        entries,
        large & (DOMINATES * neighbours < np.abs(entries.value)),
        "K couples dofs {0} and {1} by a penalty of {2:g}, which leaves less than four digits of "
        "their own stiffness: take a penalty of at most 1e8 times the usual entries.",
    )
