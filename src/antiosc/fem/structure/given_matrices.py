"""K and M of another code: checks of their entries, and penalties that act as supports.

The scale of an entry K_ij is √(K_ii K_jj), which it cannot exceed in a positive semidefinite
matrix. A norm of the whole matrix is no scale: if supports are penalties, such as FreeFEM's 1e30 on
the diagonal, all other entries are below its rounding.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Literal, TypeAlias, get_args

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

#: Of the algebra: "auto" is PETSc where it is installed.
Backend = Literal["auto", "petsc", "scipy"]
BACKENDS = get_args(Backend)
#: (row, column, value) of entries of a matrix
Entries: TypeAlias = tuple[IntArray, IntArray, Array]

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
    copy: Matrix
    if of_petsc(matrix) or backend == "petsc" or (backend == "auto" and fem.missing is None):
        with finite_element_packages():
            from antiosc.fem.linalg import petsc_algebra
        if of_petsc(matrix):
            copy = petsc_algebra.copied(name, matrix)
        else:
            copy = petsc_algebra.from_csr(name, _csr_of_arrays(name, matrix))
        if backend == "scipy":
            if communicator(copy).size > 1:
                raise InputError(f"{name} is spread over MPI ranks, SciPy's back-end needs one.")
            copy = petsc_algebra.csr(copy)
    else:
        copy = _csr_of_arrays(name, matrix)

    rows, columns = copy.shape if algebra.by_scipy(copy) else copy.getSize()
    if rows != columns or not rows:
        raise InputError(f"{name} must be square; got {rows} rows and {columns} columns.")
    agreed(communicator(copy), lambda: _check_values(name, algebra.entries(copy)[2]))
    return copy


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
        raise InputError(f"{name} must hold real numbers; got entries of type {entries.dtype}.")

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
    _checked_diagonal("C", C)
    first, _ = algebra.row_range(C)
    return algebra.hold(C, fixed[fixed < algebra.rows(C)] + first, 0.0)


def supported(K: Matrix, M: Matrix) -> tuple[Matrix, Matrix, IntArray]:
    """Check K and M, and turn penalties into supports: rows and columns zero, 1 on K's diagonal.

    Returns both, and the dofs of this rank that are fixed by penalties.

    Raises
    ------
    InputError
        Matrices that are not a stiffness and a mass matrix, and penalties that couple dofs and hide
        their stiffness by rounding.
    """
    comm = communicator(K)
    same_rows = algebra.size(K) == algebra.size(M) and alike(comm, communicator(M))
    if not same_rows or not all(comm.allgather(algebra.row_range(K) == algebra.row_range(M))):
        raise InputError(
            "K and M must have the same distribution over the MPI ranks, and one size; got "
            f"{algebra.size(K)} and {algebra.size(M)} rows."
        )

    of_K, of_M = (_checked_diagonal(name, matrix) for name, matrix in (("K", K), ("M", M)))
    empty = np.flatnonzero((of_K == 0) & (of_M == 0))
    if len(empty):
        raise InputError(
            f"{len(empty)} dofs have neither stiffness nor mass, the first is {empty[0]}: leave "
            "their rows and columns out."
        )

    constrained = _penalised(K, of_K)
    first, last = algebra.row_range(K)
    of_rank = constrained[(constrained >= first) & (constrained < last)]
    if len(constrained):
        K = algebra.hold(K, of_rank, 1.0)
        M = algebra.hold(M, of_rank, 0.0)
    return K, M, of_rank - first


def _checked_diagonal(name: str, matrix: Matrix) -> Array:
    """The diagonal (n,) on every rank of a matrix that is symmetric and not zero."""
    comm = communicator(matrix)
    diagonal = np.concatenate(comm.allgather(algebra.diagonal(matrix)))
    if not diagonal.any():
        raise InputError(f"{name} is zero on its diagonal: a structure needs stiffness and mass.")
    noise = ENTRY_ROUNDING * np.median(np.abs(diagonal[diagonal != 0]))
    if diagonal.min() < -noise:
        k = int(np.argmin(diagonal))
        raise InputError(
            f"{name} must be positive semidefinite; its diagonal has {diagonal[k]:g} in row {k}."
        )

    row, column, value = _entries(algebra.skew(matrix))
    root = np.sqrt(np.maximum(diagonal, 0.0))
    bad = np.abs(value) > MIRRORED * root[row] * root[column] + noise
    text = (
        f"{name} must be symmetric (to {MIRRORED:g} of √(a_ii a_jj)); its entries ({{0}}, {{1}}) "
        "and ({1}, {0}) differ by {2:g}."
    )
    _forbid(comm, bad, (row, column, value), text)
    return diagonal


def _entries(matrix: Matrix) -> Entries:
    """(row, column, value) of the off-diagonal entries on this rank."""
    pointers, column, value = algebra.entries(matrix)
    row = algebra.row_range(matrix)[0] + np.repeat(np.arange(len(pointers) - 1), np.diff(pointers))
    off_diagonal = (row != column) & (value != 0)
    return row[off_diagonal], column[off_diagonal], value[off_diagonal]


def _forbid(comm: MPI.Comm, bad: BoolArray, entries: Entries, text: str) -> None:
    """InputError on all ranks if entries are `bad`; `text` formats row, column and size."""
    error = None
    if bad.any():
        row, column, value = (part[bad][0] for part in entries)
        error = InputError(text.format(row, column, abs(value)))
    agree(comm, error)


def _penalised(K: Matrix, diagonal: Array) -> IntArray:
    """Numbers, on every rank, of the dofs that a penalty on the diagonal fixes.

    InputError for a penalty between two dofs that drowns their own stiffness in rounding.
    """
    comm = communicator(K)
    row, column, value = _entries(K)
    size = np.abs(value)
    sums = comm.allreduce(np.bincount(row, size, len(diagonal)))
    told = size > ENTRY_ROUNDING * np.minimum(diagonal[row], diagonal[column])
    sizes = np.concatenate(comm.allgather(size[told]))
    if not len(sizes):
        return np.zeros(0, dtype=int)

    # a few penalties do not change the median
    typical = np.median(sizes)
    is_fixed = (diagonal > PENALTY_OVER_ROW * sums) & (diagonal > PENALTY_OVER_TYPICAL * typical)
    drowns = (size > DOMINATES * typical) & ~is_fixed[row] & ~is_fixed[column]
    text = (
        "K couples dofs {0} and {1} by a penalty of {2:g}, which leaves less than four digits of "
        "their own stiffness: take a penalty of at most 1e8 times the usual entries."
    )
    _forbid(comm, drowns, (row, column, value), text)
    return np.flatnonzero(is_fixed)
