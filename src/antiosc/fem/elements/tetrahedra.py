"""Products with K and M of quadratic tetrahedra of isotropic materials, cell by cell.

A product with an assembled matrix reads 80 entries per row from memory; one from the cells reads a
tenth of that and computes the rest (measured). `cell_products` has the kernels of straight and of
curved cells. The two-level solver also needs the diagonal blocks of the nodes and the assembled
matrix of the linear elements. A factorization needs all entries and assembles them
(`with_entries`).
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from functools import cached_property

import numpy as np
from petsc4py import PETSc

from antiosc.base._types import Array, IntArray
from antiosc.fem.elements.cell_products import (
    Cells,
    CurvedCells,
    StraightCells,
    constants,
)
from antiosc.fem.elements.solid import Solid, degrees, weak_form_of
from antiosc.fem.elements.weak_form import Parts, WeakForm
from antiosc.fem.linalg.petsc_algebra import empty, multiply
from antiosc.fem.linalg.solver import CURVED, TETRAHEDRA, Products
from antiosc.fem.mesh import Mesh
from antiosc.fem.platform import compat

NO_DOFS = np.zeros(0, dtype=np.int32)
#: Least number of dofs for products cell by cell.
FEWEST_DOFS = 20_000
#: `AFE_BEYOND` of the C library: numbers behind a vector that a kernel may read
BEYOND = 5


def cell_by_cell(
    mesh: Mesh, form: WeakForm, parts: Parts, conditions: Mapping[tuple[int, ...], IntArray]
) -> Tetrahedra | None:
    """The cells of a large part of quadratic tetrahedra; None for other parts."""
    imap = form.space.dofmap.index_map
    is_large = imap.size_global * form.space.dofmap.index_map_bs >= FEWEST_DOFS
    tetrahedra = mesh.cell == "tetrahedron" and mesh.order <= 2
    isotropic = all(isinstance(material, Solid) for material, _ in parts)
    if not (is_large and tetrahedra and isotropic) or form.degree != 2 or form.strains is not None:
        return None

    return Tetrahedra(mesh, form, parts, conditions)


class Tetrahedra:
    """The cells of this rank of a part, for products with K and M.

    Parameters
    ----------
    conditions : path of a component -> its dofs of this rank, ghosts included, whose rows and
        columns are 1 in K, 0 in M
    """

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
        self._kinds = _kinds_of(mesh, form, parts)

    @cached_property
    def products(self) -> Products:
        """What the forecasts take from the kernels, by the share of curved cells."""
        of_rank = sum(len(cells.nodes) for cells in self._kinds[1:])
        curved = self.comm.allreduce(of_rank) / self._mesh.n_cells

        return replace(
            TETRAHEDRA,
            bytes=TETRAHEDRA.bytes + curved * CURVED.bytes,
            aggregated=TETRAHEDRA.aggregated + curved * CURVED.aggregated,
            seconds=TETRAHEDRA.seconds + curved * CURVED.seconds,
        )

    def _node_blocks(self, k: float, m: float) -> Array:
        """The diagonal 3×3 blocks of k K + m M summed over the cells of this rank: (dofs, 3)."""
        result = np.zeros((self._dofs // 3, 3, 3))
        for cells in self._kinds:
            blocks = cells.blocks(k, m).reshape(-1, 3, 3)
            nodes = cells.nodes.ravel()
            for a, b in np.ndindex(3, 3):
                result[:, a, b] += np.bincount(nodes, blocks[:, a, b], len(result))

        return result.reshape(-1, 3)

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
        self._exchange.fetch(u)
        for cells in self._kinds:
            cells.add(k, m, u, product)
        self._exchange.add(product)
        result = product[: self.rows]
        for factor, matrix in self._matrices(k, m):
            result += factor * multiply(matrix, x)

        result[self._held] = k * x[self._held]
        return result

    def _matrices(self, k: float, m: float) -> Iterator[tuple[float, PETSc.Mat]]:
        """(factor, matrix) of what is added at points in k K + m M."""
        if self.carries:
            yield from ((x, A) for x, A in zip((k, m), self.added, strict=True) if x)

    def blocks(self, k: float, m: float) -> Array:
        """The diagonal 3×3 blocks of k K + m M, (rows of this rank, 3)."""
        result = np.array(compat.ghosts_added(self._form.space, self._node_blocks(k, m)))
        for factor, matrix in self._matrices(k, m):
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
        """k K + m M of linear elements on these cells, with the added matrices projected by P."""
        added = [matrix.ptap(P) if self.carries else matrix for matrix in self.added]
        return self._assembled(self.linear, {}, k, m, added)

    @cached_property
    def linear(self) -> WeakForm:
        """The weak form of linear elements on these cells."""
        return weak_form_of(self._mesh, self._parts, 1)

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


def _kinds_of(mesh: Mesh, form: WeakForm, parts: Parts) -> list[Cells]:
    """The straight cells of this rank and, on a mesh of order 2, the curved ones."""
    count = compat.cell_map(mesh.dolfinx).size_local
    x = mesh.geometry.nodes[:count]
    nodes = compat.cell_dofs(form.space, (0,), np.arange(count)) // 3
    materials = constants(parts, count)
    is_straight = mesh.geometry.straight[:count]
    kinds: list[Cells] = [StraightCells(nodes[is_straight], x[is_straight], materials[is_straight])]
    if is_straight.all():
        return kinds

    rules = []
    for degree in degrees(mesh, 2):
        X, weights = compat.quadrature(mesh.cell, degree)
        values_at = compat.tabulate(form.space, (0,), X)
        gradients = compat.tabulate_slopes(form.space, (0,), X)
        rules.append((values_at, np.ascontiguousarray(gradients), weights))

    curved = ~is_straight
    return [*kinds, CurvedCells(nodes[curved], x[curved], materials[curved], *rules)]


def _add_blocks(blocks: Array, factor: float, matrix: PETSc.Mat) -> None:
    """Add `factor` times the diagonal 3×3 blocks of a sparse matrix to `blocks`."""
    pointers, columns, values = matrix.getValuesCSR()
    rows = np.repeat(np.arange(len(blocks)), np.diff(pointers))
    columns = columns - matrix.getOwnershipRange()[0]
    same_node = rows // 3 == columns // 3
    np.add.at(blocks, (rows[same_node], columns[same_node] % 3), factor * values[same_node])
