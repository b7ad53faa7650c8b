"""Products with K and M of solids cell by cell, without assembled matrices.

A product with an assembled matrix reads 80 entries per row from memory on quadratic tetrahedra and
180 on hexahedra; one from the cells reads a tenth of that and computes the rest
(measured). Straight isotropic tetrahedra have a kernel of their own (`tetrahedra`),
other cells the compiled action of their form (`compiled_cells`); `products` chooses. The two-level
solver also needs the diagonal blocks of the nodes and the assembled matrix of the linear elements.
A factorization needs all entries and assembles them (`with_entries`).
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Mapping, Sequence
from functools import cached_property
from typing import ClassVar

import numpy as np
from petsc4py import PETSc

from antiosc.base._types import Array, IntArray
from antiosc.fem.elements.weak_form import Parts, WeakForm
from antiosc.fem.linalg.forecast import Products
from antiosc.fem.linalg.petsc_algebra import empty, multiply
from antiosc.fem.mesh import Mesh
from antiosc.fem.platform import compat

NO_DOFS = np.zeros(0, dtype=np.int32)
#: `AFE_BEYOND` of the C library: numbers behind a vector that a kernel may read
BEYOND = 5


class CellByCell(ABC):
    """The cells of this rank of a part, for products with K and M.

    Parameters
    ----------
    conditions : path of a component -> its dofs of this rank, ghosts included, whose rows and
        columns are 1 in K, 0 in M
    """

    #: cells that a kernel takes at once
    lanes: ClassVar[int] = 1
    #: what the forecasts take from the kernel
    products: Products

    def __init__(
        self,
        mesh: Mesh,
        form: WeakForm,
        parts: Parts,
        conditions: Mapping[tuple[int, ...], IntArray],
    ) -> None:
        self._mesh = mesh
        self._form = form
        self._parts = parts
        self._conditions = conditions
        self.comm = mesh.comm
        self._exchange = compat.Exchange(form.space)
        self.rows = compat.local_size(form.space)
        #: dofs of this rank, ghosts included
        self._dofs = self.rows + 3 * form.space.dofmap.index_map.num_ghosts
        self._fixed = np.unique(np.concatenate([NO_DOFS, *conditions.values()]))
        self._held = self._fixed[self._fixed < self.rows]
        #: matrices added to K and M at points, and whether they have entries
        self.added = empty(self.rows, self.comm), empty(self.rows, self.comm)
        self.carries = False
        cells = np.arange(compat.cell_map(mesh.dolfinx).size_local)
        nodes = compat.cell_dofs(form.space, (0,), cells) // 3
        # first the cells that meet ghosts: what the others give is computed while these travel
        has_ghosts = (nodes >= self.rows // 3).any(axis=1)
        self._take(nodes, np.argsort(~has_ghosts, kind="stable"))
        count, ghost_groups = (-(-int(n) // self.lanes) for n in (len(cells), has_ghosts.sum()))
        middle = (ghost_groups + count) // 2
        #: groups of cells: half of those of this rank alone, those that meet ghosts, the other half
        self._groups = [(ghost_groups, middle), (0, ghost_groups), (middle, count)]

    @abstractmethod
    def _take(self, nodes: IntArray, order: IntArray) -> None:
        """Prepare the cells, in this order; `nodes` (cells, n) are numbers of this rank."""

    @abstractmethod
    def _add(self, group: int, k: float, m: float, u: Array, out: Array) -> None:
        """Add (k K + m M) u of a group of cells to `out`, both on all dofs of this rank."""

    @abstractmethod
    def _node_blocks(self, k: float, m: float) -> Array:
        """The diagonal 3×3 blocks of k K + m M summed over the cells of this rank: (dofs, 3)."""

    def product(self, x: Array, k: float, m: float) -> Array:
        """(k K + m M) x for a vector or a block of vectors (rows of this rank, columns).

        The result has the precision of x, single or double.
        """
        if x.ndim == 1:
            return self._of_vector(x, k, m)
        result = np.empty(x.shape, x.dtype, order="F")
        for j, column in enumerate(x.T):
            result[:, j] = self._of_vector(column, k, m)
        return result

    def _of_vector(self, x: Array, k: float, m: float) -> Array:
        """(k K + m M) x for one vector."""
        u = np.empty(self._dofs + BEYOND, x.dtype)[: self._dofs]
        u[: self.rows] = x
        u[self._held] = 0.0
        product = np.zeros(self._dofs + BEYOND, x.dtype)[: self._dofs]
        arrived = self._exchange.fetch(u)
        self._add(0, k, m, u, product)
        arrived()
        self._add(1, k, m, u, product)
        arrived = self._exchange.add(product)
        self._add(2, k, m, u, product)
        arrived()
        result = product[: self.rows]
        for factor, matrix in zip((k, m), self.added, strict=True):
            if factor and self.carries:
                result += factor * multiply(matrix, x)
        result[self._held] = k * x[self._held]
        return result

    def blocks(self, k: float, m: float) -> Array:
        """The diagonal 3×3 blocks of k K + m M, (rows of this rank, 3)."""
        result = np.array(self._exchange.ghosts_added(self._node_blocks(k, m)))
        for factor, matrix in zip((k, m), self.added, strict=True):
            _add_blocks(result, factor, matrix)
        blocks = result.reshape(-1, 3, 3)
        blocks[self._held // 3, self._held % 3, :] = 0.0
        blocks[self._held // 3, :, self._held % 3] = 0.0
        result[self._held, self._held % 3] = k
        return result

    def entries(self, k: float, m: float) -> PETSc.Mat:
        """The assembled matrix k K + m M."""
        return self._assembled(self._form, self._conditions, k, m, self.added)

    def coarse(self, k: float, m: float, P: PETSc.Mat) -> PETSc.Mat:
        """k K + m M of linear elements on these cells, with the matrices added at points projected
        by P.
        """
        added = [matrix.ptap(P) if self.carries else matrix for matrix in self.added]
        return self._assembled(self.linear, {}, k, m, added)

    @cached_property
    def linear(self) -> WeakForm:
        """The weak form of linear elements on these cells."""
        material, _ = self._parts[0]
        return material.weak_form(self._mesh, self._parts, 1)

    def _assembled(
        self,
        form: WeakForm,
        conditions: Mapping[tuple[int, ...], IntArray],
        k: float,
        m: float,
        added: Sequence[PETSc.Mat],
    ) -> PETSc.Mat:
        """k K + m M of a form, with boundary conditions and added matrices."""
        total: PETSc.Mat | None = None
        for factor, forms, added_matrix, diagonal in zip(
            (k, m), (form.stiffness, form.mass), added, (1.0, 0.0), strict=True
        ):
            if not factor:
                continue
            matrix = compat.assemble(forms, form.space, conditions, diagonal)
            if self.carries:
                # an interpolation stores zeros, by which points meet cells beside their own
                matrix.axpy(
                    1.0, added_matrix, structure=PETSc.Mat.Structure.UNKNOWN_NONZERO_PATTERN
                )
            if factor != 1.0:
                matrix.scale(factor)
            if total is None:
                total = matrix
            else:
                total.axpy(1.0, matrix, structure=PETSc.Mat.Structure.UNKNOWN_NONZERO_PATTERN)
        return total


def _add_blocks(blocks: Array, factor: float, matrix: PETSc.Mat) -> None:
    """Add `factor` times the diagonal 3×3 blocks of a sparse matrix to `blocks`."""
    pointers, columns, values = matrix.getValuesCSR()
    rows = np.repeat(np.arange(len(blocks)), np.diff(pointers))
    columns = columns - matrix.getOwnershipRange()[0]
    same_node = rows // 3 == columns // 3
    np.add.at(blocks, (rows[same_node], columns[same_node] % 3), factor * values[same_node])
