"""The functions of `antiosc.fem.linalg.algebra` for PETSc matrices, distributed over ranks."""

from __future__ import annotations

import weakref
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, Protocol

import numpy as np
import scipy.sparse
from mpi4py import MPI
from petsc4py import PETSc

from antiosc.base._types import Array, IntArray
from antiosc.base.errors import InputError
from antiosc.fem.platform import same_ranks

#: Vectors from which a product of matrices is faster than one by one.
LEAST_BLOCK_COLUMNS = 4
#: PETSc attribute of a matrix: a product that is more accurate than its entries give (callable).
PRODUCT_KEY = "antiosc_product"
#: PETSc attribute of a matrix: its `CellProduct`.
CELLS_KEY = "antiosc_cells"


class Cells(Protocol):
    """Protocol of cells that compute matrix products themselves, as `Tetrahedra` do."""

    comm: MPI.Comm
    rows: int  # number of dofs that this rank owns

    def product(self, x: Array, k: float, m: float, linear: bool = False) -> Array: ...
    def blocks(self, k: float, m: float) -> Array: ...
    def entries(self, k: float, m: float) -> PETSc.Mat: ...
    def vector(self, dtype: type[np.floating[Any]]) -> Array: ...
    def add(self, k: float, m: float, u: Array, out: Array) -> None: ...
    def simplified(self) -> Cells: ...
    def coarse(self, P: PETSc.Mat, fixed: IntArray) -> Cells: ...


@dataclass
class CellProduct:
    """A matrix kK + mM without stored entries, multiplied cell by cell."""

    cells: Cells
    k: float
    m: float
    _diagonal: Array | None = None  # (rows of this rank,), once it is known

    def __call__(self, x: Array) -> Array:
        """The product with a vector or a block of vectors (rows of this rank, k)."""
        return self.cells.product(x, self.k, self.m)

    def with_entries(self) -> PETSc.Mat:
        """The assembled matrix; its diagonal is stored for `diagonal`."""
        result = self.cells.entries(self.k, self.m)
        if self._diagonal is None:
            self._diagonal = np.array(result.getDiagonal().array_r)
        return result

    @property
    def diagonal(self) -> Array:
        """The diagonal (rows of this rank,), from the stored entries if `with_entries` made any."""
        if self._diagonal is None:
            blocks = self.cells.blocks(self.k, self.m)
            rows = np.arange(len(blocks))
            self._diagonal = np.asarray(blocks[rows, rows % blocks.shape[1]])
        return self._diagonal

    def mult(self, _: PETSc.Mat, x: PETSc.Vec, y: PETSc.Vec) -> None:
        """Set y to the product with x (PETSc's interface of python matrices)."""
        y.setArray(self(x.array_r))

    def getDiagonal(self, _: PETSc.Mat, d: PETSc.Vec) -> None:
        """Set d to the diagonal (PETSc's interface of python matrices)."""
        d.setArray(self.diagonal)


#: Dofs of a node of a solid.
DOFS_OF_NODE = 3


def cell_matrix(cells: Cells, k: float, m: float) -> PETSc.Mat:
    """kK + mM as a PETSc matrix of type python."""
    product = CellProduct(cells, k, m)
    rows = (cells.rows, None)
    result = PETSc.Mat().create(cells.comm)
    result.setSizes((rows, rows), DOFS_OF_NODE)
    result.setType(PETSc.Mat.Type.PYTHON)
    result.setPythonContext(product)
    result.setUp()
    result.setAttr(CELLS_KEY, product)
    register_for_release(result)
    set_type_at_exit(result, PETSc.Mat.Type.AIJ)
    return result


def with_entries(matrix: PETSc.Mat) -> PETSc.Mat:
    """The matrix with stored entries: itself, or assembled if it is multiplied cell by cell."""
    if not uses_cells(matrix):
        return matrix
    result = matrix.getAttr(CELLS_KEY).with_entries()
    register_for_release(result)
    return result


class _InverseContext:
    """Context of a PETSc preconditioner that applies a function r -> A⁻¹r of arrays (rows,)."""

    def __init__(self, inverse: Callable[[Array], Array]) -> None:
        self._inverse = inverse

    def apply(self, pc: PETSc.PC, r: PETSc.Vec, x: PETSc.Vec) -> None:
        x.setArray(self._inverse(np.array(r.array_r)))


def use_inverse(ksp: PETSc.KSP, inverse: Callable[[Array], Array]) -> None:
    """Make `ksp` apply the function `inverse`, r -> A⁻¹r of arrays (rows,)."""
    ksp.setType(PETSc.KSP.Type.PREONLY)
    pc = ksp.getPC()
    pc.setType(PETSc.PC.Type.PYTHON)
    pc.setPythonContext(_InverseContext(inverse))


def empty_matrix(rows: int, comm: MPI.Comm) -> PETSc.Mat:
    """A square PETSc matrix without entries, to which entries can be added; `rows` on this rank."""
    result = PETSc.Mat().createAIJ(((rows, None), (rows, None)), nnz=0, comm=comm)
    result.setOption(PETSc.Mat.Option.NEW_NONZERO_ALLOCATION_ERR, False)
    result.assemble()
    register_for_release(result)
    return result


def from_csr(name: str, matrix: scipy.sparse.csr_matrix) -> PETSc.Mat:
    """A one-rank PETSc matrix from a SciPy matrix with sorted entries. InputError, which calls the
    matrix `name`, if PETSc's integers cannot count its entries."""
    if max(matrix.shape[0], matrix.nnz) > np.iinfo(PETSc.IntType).max:
        raise InputError(f"{name} has {matrix.nnz} entries, more than this PETSc's integers count.")

    pointers, columns = (part.astype(PETSc.IntType) for part in (matrix.indptr, matrix.indices))
    arrays = pointers, columns, matrix.data
    result = PETSc.Mat().createAIJ(matrix.shape, csr=arrays, comm=PETSc.COMM_SELF)
    result.assemble()
    return result


def without_zeros(matrix: PETSc.Mat) -> PETSc.Mat:
    """The matrix without its stored zeros; M has them between different directions of nodes."""
    pointers, columns, values = matrix.getValuesCSR()
    stored = values != 0
    count = np.append(0, np.cumsum(stored))
    csr = count[pointers].astype(PETSc.IntType), columns[stored], values[stored]
    block = matrix.getBlockSize()
    result = PETSc.Mat().createAIJ(matrix.getSizes(), block, csr=csr, comm=matrix.getComm())
    register_for_release(matrix)
    return result


def copied_matrix(name: str, matrix: PETSc.Mat) -> PETSc.Mat:
    """A copy, of type aij, of any PETSc matrix with accessible entries; otherwise InputError, which
    calls the matrix `name`."""
    if not matrix:
        raise InputError(f"{name} is an empty PETSc matrix, or one that was destroyed.")
    if not matrix.assembled:
        raise InputError(f"{name} is not assembled: call {name}.assemble() first.")

    try:
        copy = matrix.convert(PETSc.Mat.Type.AIJ, PETSc.Mat())
    except PETSc.Error as error:
        raise InputError(
            f"{name}, of PETSc's type {matrix.getType()}, has no entries: give one of type aij."
        ) from error

    copy.setAttr(PRODUCT_KEY, matrix.getAttr(PRODUCT_KEY))
    return copy


def declare_definite(matrix: PETSc.Mat) -> None:
    """Mark the matrix for PETSc as symmetric and positive definite."""
    matrix.setOption(PETSc.Mat.Option.SYMMETRIC, True)
    matrix.setOption(PETSc.Mat.Option.SPD, True)


def skew(matrix: PETSc.Mat) -> PETSc.Mat:
    """matrixᵀ - matrix."""
    # PETSc's own isSymmetric rejects a rounding error whose mirror entry is not stored.
    result = matrix.copy()
    result.transpose()
    result.axpy(-1.0, matrix, structure=PETSc.Mat.Structure.UNKNOWN_NONZERO_PATTERN)
    return result


def fix_rows(matrix: PETSc.Mat, rows: IntArray, value: float) -> PETSc.Mat:
    """The matrix, changed in place: these global rows and columns zero, `value` on the diagonal."""
    matrix.setAttr(PRODUCT_KEY, None)
    matrix.zeroRowsColumns(rows.astype(PETSc.IntType), diag=value)
    return matrix


def multiply(matrix: PETSc.Mat, x: Array) -> Array:
    """matrix · x for a vector or a block of vectors."""
    accurate = matrix.getAttr(PRODUCT_KEY)
    if accurate is not None:
        return np.asarray(accurate(x))
    if uses_cells(matrix):
        return np.asarray(matrix.getAttr(CELLS_KEY)(x))

    if x.ndim == 2 and x.shape[1] >= LEAST_BLOCK_COLUMNS:
        block = dense_block(matrix, x)
        product = matrix.matMult(block)
        result = np.array(product.getDenseArray())
        product.destroy()
        block.destroy()
        return result

    source, target = matrix.createVecs()
    result = np.empty((target.getLocalSize(), *x.shape[1:]))
    columns, out = (part[:, None] if x.ndim == 1 else part for part in (x, result))

    for k in range(columns.shape[1]):
        source.setArray(columns[:, k])
        matrix.mult(source, target)
        out[:, k] = target.array_r

    source.destroy()
    target.destroy()
    return result


def multiply_linear(matrix: PETSc.Mat, x: Array) -> Array:
    """matrix · x for a vector that is linear in each cell, which takes fewer memory accesses."""
    if not uses_cells(matrix):
        return multiply(matrix, x)
    product: CellProduct = matrix.getAttr(CELLS_KEY)
    return product.cells.product(x, product.k, product.m, linear=True)


def uses_strains(matrix: PETSc.Mat) -> bool:
    """Whether the matrix is multiplied through its strains (`solver_choice`)."""
    return matrix.getAttr(PRODUCT_KEY) is not None


def uses_cells(matrix: PETSc.Mat) -> bool:
    """Whether the matrix is multiplied cell by cell (`CellProduct`)."""
    return matrix.getAttr(CELLS_KEY) is not None


def dense_block(matrix: PETSc.Mat, x: Array) -> PETSc.Mat:
    """A block of vectors (rows of this rank, k) as a dense PETSc matrix that fits `matrix`."""
    size = ((x.shape[0], matrix.getSize()[1]), (None, x.shape[1]))
    block = PETSc.Mat().createDense(size, array=np.asfortranarray(x), comm=matrix.getComm())
    block.setUp()
    block.assemble()
    return block


def csr(matrix: PETSc.Mat) -> scipy.sparse.csr_matrix:
    """The matrix of a one-rank communicator as a SciPy matrix."""
    pointers, indices, values = with_entries(matrix).getValuesCSR()
    return scipy.sparse.csr_matrix((values, indices, pointers), shape=matrix.getSize())


def lower_triangle(A: scipy.sparse.csr_matrix) -> scipy.sparse.csr_matrix:
    """The lower triangle with the diagonal, which needs half of the memory."""
    rows = np.repeat(np.arange(A.shape[0], dtype=A.indices.dtype), np.diff(A.indptr))
    is_lower = A.indices <= rows
    counts = np.bincount(rows[is_lower], minlength=A.shape[0])
    pointers = np.append(0, np.cumsum(counts)).astype(A.indptr.dtype)
    return scipy.sparse.csr_matrix((A.data[is_lower], A.indices[is_lower], pointers), shape=A.shape)


def gathered(matrix: PETSc.Mat, root: int) -> scipy.sparse.csr_matrix | None:
    """The whole of a distributed matrix as a SciPy matrix on rank `root`; None elsewhere."""
    comm = matrix.getComm().tompi4py()
    arrays = [np.ascontiguousarray(part) for part in with_entries(matrix).getValuesCSR()]
    arrays[0] = np.diff(arrays[0])  # entries of each row

    parts = []
    for part in arrays:
        counts = comm.gather(len(part), root=root)
        total = np.empty(sum(counts or ()), part.dtype)
        comm.Gatherv(part, (total, counts), root=root)
        parts.append(total)

    if comm.rank != root:
        return None

    sizes, columns, values = parts
    pointers = np.append(0, np.cumsum(sizes))

    return scipy.sparse.csr_matrix((values, columns, pointers), shape=matrix.getSize())


def sum_of(K: PETSc.Mat, shift: float, M: PETSc.Mat) -> PETSc.Mat:
    """K + shift·M; K itself where the shift is zero."""
    if shift == 0.0:
        return K
    if uses_cells(K) and uses_cells(M):
        return cell_matrix(K.getAttr(CELLS_KEY).cells, 1.0, shift)

    A = with_entries(K).copy()
    pattern = PETSc.Mat.Structure.UNKNOWN_NONZERO_PATTERN
    A.axpy(shift, with_entries(M), structure=pattern)
    accurate = K.getAttr(PRODUCT_KEY)
    if accurate is not None:
        A.setAttr(PRODUCT_KEY, lambda x: accurate(x) + shift * multiply(M, x))

    return A


def free_when_dropped(*matrices: PETSc.Mat) -> None:
    """Free the memory of the matrices once no rank uses them. Collective."""
    release_dropped(matrices[0].getComm().tompi4py())
    for matrix in matrices:
        register_for_release(matrix)


# -- The memory of PETSc's objects that Python has dropped.
#
# petsc4py hands a dropped object over to PETSc, which keeps it until all ranks of its communicator
# ask for its end together (PETSc's manual page of PetscGarbageCleanup); before PETSc 3.19 on one
# rank too. A communicator belongs to one mesh, so nobody would ever ask. Here it is asked for on
# one rank as soon as an object is dropped, and on several at the next structure, where they meet.


#: Objects on several ranks, with what holds their communicator, in the order of creation.
_shared: list[tuple[weakref.ref[PETSc.Object], PETSc.IS]] = []


def register_for_release(handle: PETSc.Object) -> None:
    """Register a PETSc object, so that `release_dropped` frees its memory after its last use."""
    holder = PETSc.IS().createGeneral([], comm=handle.getComm())
    if holder.getComm().getSize() == 1:
        weakref.finalize(handle, _release, holder).atexit = False
    else:
        _shared.append((weakref.ref(handle), holder))


def release_dropped(comm: MPI.Comm) -> None:
    """Free the objects that all ranks of `comm` have dropped. Collective."""
    if comm.size == 1:
        return
    entries = [entry for entry in _shared if same_ranks(entry[1].getComm().tompi4py(), comm)]
    is_dropped = comm.allgather([reference() is None for reference, _ in entries])
    for entry, *everywhere in zip(entries, *is_dropped, strict=True):
        if all(everywhere):
            _shared.remove(entry)
            _release(entry[1])


def set_type_at_exit(handle: PETSc.Mat | PETSc.PC, type_name: str) -> None:
    """Change the type of a PETSc object of type python at exit, as PETSc ends after Python."""
    weakref.finalize(handle, _set_type, weakref.ref(handle), type_name)


def _set_type(handle: weakref.ref[PETSc.Mat | PETSc.PC], type_name: str) -> None:
    """Change the type of an object that still exists."""
    alive = handle()
    if alive is not None:
        alive.setType(type_name)


def _release(holder: PETSc.IS) -> None:
    """Free the dropped objects on the communicator of `holder`, and `holder`. Collective."""
    if PETSc.Sys.isInitialized() and not PETSc.Sys.isFinalized():
        PETSc.garbage_cleanup(holder.getComm())
        holder.destroy()
