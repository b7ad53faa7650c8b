"""Products with K and M of straight quadratic tetrahedra, cell by cell, without assembled matrices.

A product with an assembled matrix reads 80 entries per row from memory; one from the cells reads a
tenth of that and computes the rest (benchmarks/products.py). The strains of a straight quadratic
tetrahedron are linear, so that its energy follows from the strains at its corners (csrc/elastic.c).
The two-level solver also needs the diagonal blocks of the nodes and the assembled matrix of the
linear elements. A factorization needs all entries and assembles them (`with_entries`).
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from ctypes import byref
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray
from petsc4py import PETSc

from antiosc.base._types import Array, IntArray
from antiosc.engine import library
from antiosc.fem.elements.solid import Solid
from antiosc.fem.elements.weak_form import Parts, WeakForm
from antiosc.fem.linalg.petsc_algebra import multiply, watch
from antiosc.fem.mesh import Mesh
from antiosc.fem.platform import compat

NO_DOFS = np.zeros(0, dtype=np.int32)

#: `AOM_LANES` and `AOM_TETRA_DATA` of the C library
LANES = 8
DATA = 12
#: Least number of dofs for products cell by cell.
FEWEST_DOFS = 20_000


#: For each node of a cell in dolfinx's order: the corner, or the two corners it lies between.
ENDS = ((0,), (1,), (2,), (3,), (2, 3), (1, 3), (1, 2), (0, 3), (0, 2), (0, 1))


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
        self._space = form.space
        self.comm = mesh.comm
        self._exchange = compat.Exchange(form.space)
        self._ghosts = form.space.dofmap.index_map.num_ghosts
        count = compat.cell_map(mesh.dolfinx).size_local
        cells = np.arange(count)
        nodes = compat.cell_dofs(form.space, (0,), cells) // 3
        x = mesh.dolfinx.geometry.x[compat.geometry_nodes(mesh.dolfinx)[:count]]
        edges = x[:, 1:] - x[:, :1]
        volume = np.abs(np.linalg.det(edges)) / 6
        data = np.empty((count, DATA))
        # x = x0 + Σ λ_i (x_i - x_0): the gradients are the columns of the inverse
        data[:, :9] = np.linalg.inv(edges).transpose(0, 2, 1).reshape(count, 9)
        for material, own in parts:
            data[own[own < count], 9:] = _constants(material)
        data[:, 9:] *= volume[:, None]
        # first the cells that meet ghosts: what the others give is computed while these travel
        shared = (nodes >= compat.local_size(self._space) // 3).any(axis=1)
        order = np.argsort(~shared, kind="stable")
        self._shared = -(-int(shared.sum()) // LANES)
        self._nodes = _in_lanes(nodes[order].astype(np.int32))
        self._data = _in_lanes(data[order])
        self._fixed = np.unique(np.concatenate([NO_DOFS, *conditions.values()]))
        self.rows = compat.local_size(form.space)
        self._held = self._fixed[self._fixed < self.rows]
        #: matrices added to K and M at points, and whether they have entries
        self.added = (self._empty(), self._empty())
        self.carries = False

    def _empty(self) -> PETSc.Mat:
        """A matrix without entries, with the rows of this part."""
        rows = (self.rows, None)
        result = PETSc.Mat().createAIJ((rows, rows), nnz=0, comm=self.comm)
        result.setOption(PETSc.Mat.Option.NEW_NONZERO_ALLOCATION_ERR, False)
        result.assemble()
        watch(result)
        return result

    def product(self, x: Array, stiffness: float, mass: float) -> Array:
        """(stiffness K + mass M) x for a vector or a block of vectors (rows of this rank, k).

        In the precision of x, single or double.
        """
        if x.ndim == 1:
            return self._of_vector(x, stiffness, mass)
        result = np.empty(x.shape, x.dtype, order="F")
        for k, column in enumerate(x.T):
            result[:, k] = self._of_vector(column, stiffness, mass)
        return result

    def _of_vector(self, x: Array, stiffness: float, mass: float) -> Array:
        """(stiffness K + mass M) x for one vector."""
        u = np.empty(self.rows + 3 * self._ghosts, x.dtype)
        u[: self.rows] = x
        u[self._held] = 0.0
        out = np.zeros_like(u)
        places = library.address(u), library.address(out)
        product, (first, shared, second) = self._in_double
        if x.dtype == np.float32:
            product, (first, shared, second) = self._in_single
        arrived = self._exchange.fetch(u)
        product(byref(first), stiffness, mass, *places)
        arrived()
        product(byref(shared), stiffness, mass, *places)
        arrived = self._exchange.add(out)
        product(byref(second), stiffness, mass, *places)
        arrived()
        result = out[: self.rows]
        for factor, matrix in zip((stiffness, mass), self.added, strict=True):
            if factor and self.carries:
                result += factor * multiply(matrix, x)
        result[self._held] = stiffness * x[self._held]
        return result

    @cached_property
    def _in_double(self) -> tuple[Callable[..., None], list[library.Tetra]]:
        """(product function of the C library, groups of cells) in double precision."""
        return library.library.aom_tetra_product_double, self._groups(self._data)

    @cached_property
    def _in_single(self) -> tuple[Callable[..., None], list[library.Tetra]]:
        """(product function of the C library, groups of cells) in single precision."""
        self._single = self._data.astype(np.float32)
        return library.library.aom_tetra_product_float, self._groups(self._single)

    def _groups(self, data: NDArray[Any]) -> list[library.Tetra]:
        """A half of the cells of this rank alone, those that meet ghosts, the other half."""
        count = len(data)
        middle = (self._shared + count) // 2
        return [
            library.Tetra(
                end - begin, *(library.address(one[begin:end]) for one in (self._nodes, data))
            )
            for begin, end in ((self._shared, middle), (0, self._shared), (middle, count))
        ]

    def blocks(self, k: float, m: float) -> Array:
        """The diagonal 3×3 blocks of k K + m M, (rows of this rank, 3)."""
        data = self._data.transpose(0, 2, 1).reshape(-1, DATA)
        nodes = self._nodes.transpose(0, 2, 1).reshape(len(data), -1)
        slopes = data[:, :9].reshape(-1, 3, 3)
        slopes = np.concatenate([-slopes.sum(axis=1, keepdims=True), slopes], axis=1)
        lame = k * data[:, 9] * 20
        shear = k * data[:, 10] * 20
        density = m * data[:, 11]
        size = compat.local_size(self._space) + 3 * self._ghosts
        found = np.zeros((size // 3, 3, 3))
        for node, ends in enumerate(ENDS):
            G = _squares(slopes, ends)
            own = (lame + shear)[:, None, None] * G
            inertia = (6 if len(ends) == 1 else 32) * density
            spread = shear * np.trace(G, axis1=1, axis2=2) + inertia
            for a in range(3):
                own[:, a, a] += spread
                for b in range(3):
                    found[:, a, b] += np.bincount(nodes[:, node], own[:, a, b], len(found))
        result = np.array(self._exchange.ghosts_added(found.reshape(-1, 3)))
        for factor, matrix in zip((k, m), self.added, strict=True):
            _add_blocks(result, factor, matrix)
        own = result.reshape(-1, 3, 3)
        own[self._held // 3, self._held % 3, :] = 0.0
        own[self._held // 3, :, self._held % 3] = 0.0
        result[self._held, self._held % 3] = k
        return result

    def entries(self, k: float, m: float) -> PETSc.Mat:
        """The assembled matrix k K + m M."""
        return self._assembled(self._form, self._conditions, k, m, self.added)

    def coarse(self, k: float, m: float, P: PETSc.Mat) -> PETSc.Mat:
        """k K + m M of linear elements on these cells, with the matrices added at points; P:
        prolongation.
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


def _squares(slopes: Array, ends: Sequence[int]) -> Array:
    """∫ grad N ⊗ grad N / V (n, 3, 3) of one node's shape function N, from `slopes`, grad λ."""
    g = slopes[:, ends[0]]
    if len(ends) == 1:
        return np.asarray(0.6 * g[:, :, None] * g[:, None])
    h = slopes[:, ends[1]]
    both = g + h  # 2 gg + 2 hh + gh + hg = gg + hh + (g + h)(g + h)
    return np.asarray(0.8 * sum(vector[:, :, None] * vector[:, None] for vector in (g, h, both)))


def _add_blocks(blocks: Array, factor: float, matrix: PETSc.Mat) -> None:
    """Add `factor` times the diagonal 3×3 blocks of a sparse matrix to `blocks`."""
    pointers, columns, values = matrix.getValuesCSR()
    rows = np.repeat(np.arange(len(blocks)), np.diff(pointers))
    columns = columns - matrix.getOwnershipRange()[0]
    near = rows // 3 == columns // 3
    np.add.at(blocks, (rows[near], columns[near] % 3), factor * values[near])


def serve(mesh: Mesh, form: WeakForm, parts: Parts) -> bool:
    """Whether products are taken cell by cell: many straight quadratic tetrahedra, all
    isotropic.
    """
    imap = form.space.dofmap.index_map
    if imap.size_global * form.space.dofmap.index_map_bs < FEWEST_DOFS:
        return False
    straight = mesh.cell == "tetrahedron" and mesh.order == 1 and form.degree == 2
    return (
        straight
        and form.strains is None
        and all(isinstance(material, Solid) for material, _ in parts)
    )


def _constants(material: Solid) -> tuple[float, float, float]:
    """(λ/20, μ/20, ρ/420): Lamé's constants and the density as csrc/elastic.c takes them."""
    lame = material.E * material.nu / ((1 + material.nu) * (1 - 2 * material.nu))
    return lame / 20, material.G / 20, material.rho / 420


def _in_lanes(values: Array) -> Array:
    """Values of cells (n, k) padded with zeros, as (groups, k, lanes) for SIMD."""
    groups = -(-len(values) // LANES)
    full = np.zeros((groups * LANES, values.shape[1]), values.dtype)
    full[: len(values)] = values
    return np.ascontiguousarray(full.reshape(groups, LANES, -1).transpose(0, 2, 1))
