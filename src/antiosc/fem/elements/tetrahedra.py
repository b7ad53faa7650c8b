"""Products with K and M of quadratic tetrahedra of isotropic materials, cell by cell.

A product with an assembled matrix reads 80 entries per row from memory; one from the cells reads a
tenth of that and computes the rest (measured). The strains of a straight quadratic tetrahedron are
linear, so that its energy follows from the strains at its corners (csrc/fem/elastic.c). Curved
cells, which lie at curved faces alone, have assembled matrices. The
two-level solver also needs the diagonal blocks of the nodes and the assembled matrix of the linear
elements. A factorization needs all entries and assembles them (`with_entries`).

The loops are in C (`csrc/fem/antiosc_fem.h`); other threads run during a call.
"""

from __future__ import annotations

import ctypes
from collections.abc import Iterator, Mapping, Sequence
from ctypes import Structure, byref, c_double, c_float, c_int64, c_void_p
from dataclasses import replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray
from petsc4py import PETSc

from antiosc.base._types import Array, BoolArray, IntArray
from antiosc.engine import library
from antiosc.fem.elements.solid import Solid, weak_form_of
from antiosc.fem.elements.weak_form import Parts, WeakForm, restricted
from antiosc.fem.linalg.petsc_algebra import empty, multiply
from antiosc.fem.linalg.solver import ENTRIES, TETRAHEDRA, Products
from antiosc.fem.mesh import Mesh
from antiosc.fem.platform import compat

NO_DOFS = np.zeros(0, dtype=np.int32)
#: Least number of dofs for products cell by cell.
FEWEST_DOFS = 20_000
#: `AFE_BEYOND` of the C library: numbers behind a vector that a kernel may read
BEYOND = 5
#: `AFE_LANES` and `AFE_TETRA_DATA` of the C library
LANES = 8
DATA = 12
#: Bytes of an entry of a sparse matrix with its column.
MATRIX = 12.0
#: Distance of a node from the middle of its edge up to which the edge is straight, over its length.
STRAIGHT = 1e-9
#: For each node of a cell in dolfinx's order: the corner, or the two corners it lies between.
ENDS = ((0,), (1,), (2,), (3,), (2, 3), (1, 3), (1, 2), (0, 3), (0, 2), (0, 1))


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
        count = compat.cell_map(mesh.dolfinx).size_local
        x = mesh.dolfinx.geometry.x[compat.geometry_nodes(mesh.dolfinx)[:count]]
        straight = _straight(x)
        nodes = compat.cell_dofs(form.space, (0,), np.flatnonzero(straight)) // 3
        self._nodes = _in_lanes(nodes.astype(np.int32))
        self._data = _in_lanes(_data_of(x, parts)[straight])
        self._curved = self._assembled_of(np.flatnonzero(~straight))

    def _assembled_of(self, cells: IntArray) -> tuple[PETSc.Mat, ...]:
        """K and M of some cells of this rank; nothing where no rank has such cells."""
        if not self.comm.allreduce(len(cells)):
            return ()

        forms = (self._form.stiffness, self._form.mass)
        return tuple(
            compat.assemble(
                restricted(one, self._mesh, cells), self._form.space, self._conditions, 0.0
            )
            for one in forms
        )

    @cached_property
    def products(self) -> Products:
        """What the forecasts take from the kernel, and from the matrices of curved cells."""
        stored = sum(A.getInfo(PETSc.Mat.InfoType.GLOBAL_SUM)["nz_used"] for A in self._curved)
        rows = self.comm.allreduce(self.rows)
        share = stored / 2 / (TETRAHEDRA.row * rows)
        more = 2 * MATRIX * share

        return replace(
            TETRAHEDRA,
            bytes=TETRAHEDRA.bytes + more,
            aggregated=TETRAHEDRA.aggregated + more,
            seconds=TETRAHEDRA.seconds + share * ENTRIES.seconds,
        )

    def _add(self, k: float, m: float, u: Array, out: Array) -> None:
        """Add (k K + m M) u of the cells to `out`, both on all dofs of this rank."""
        single = u.dtype == np.float32
        product = (
            functions.afe_tetra_product_float if single else functions.afe_tetra_product_double
        )
        data = self._single if single else self._data
        cells = Tetra(len(data), library.address(self._nodes), library.address(data))
        product(byref(cells), k, m, library.address(u), library.address(out))

    @cached_property
    def _single(self) -> NDArray[np.float32]:
        """The data of the cells in single precision."""
        return self._data.astype(np.float32)

    def _node_blocks(self, k: float, m: float) -> Array:
        """The diagonal 3×3 blocks of k K + m M summed over the cells of this rank: (dofs, 3)."""
        data = self._data.transpose(0, 2, 1).reshape(-1, DATA)
        nodes = self._nodes.transpose(0, 2, 1).reshape(-1, len(ENDS))
        slopes = data[:, :9].reshape(-1, 3, 3)
        slopes = np.concatenate([-slopes.sum(axis=1, keepdims=True), slopes], axis=1)
        lame = k * data[:, 9] * 20
        shear = k * data[:, 10] * 20
        density = m * data[:, 11]

        result = np.zeros((self._dofs // 3, 3, 3))
        for node, ends in enumerate(ENDS):
            G = _squares(slopes, ends)
            blocks = (lame + shear)[:, None, None] * G
            inertia = (6 if len(ends) == 1 else 32) * density
            diagonal = shear * np.trace(G, axis1=1, axis2=2) + inertia
            for a in range(3):
                blocks[:, a, a] += diagonal
                for b in range(3):
                    result[:, a, b] += np.bincount(nodes[:, node], blocks[:, a, b], len(result))

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
        self._add(k, m, u, product)
        self._exchange.add(product)
        result = product[: self.rows]
        for factor, matrix in self._matrices(k, m):
            result += factor * multiply(matrix, x)

        result[self._held] = k * x[self._held]
        return result

    def _matrices(self, k: float, m: float) -> Iterator[tuple[float, PETSc.Mat]]:
        """(factor, matrix) of curved cells and of what is added at points in k K + m M."""
        pairs = [self._curved] if self._curved else []
        for pair in [*pairs, self.added] if self.carries else pairs:
            yield from ((x, A) for x, A in zip((k, m), pair, strict=True) if x)

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


def _data_of(x: Array, parts: Parts) -> Array:
    """Gradients, and constants times volume, of straight cells with these corners: (n, DATA)."""
    edges = x[:, 1:4] - x[:, :1]
    data = np.empty((len(x), DATA))

    # x = x0 + Σ λ_i (x_i - x_0): the gradients are the columns of the inverse
    data[:, :9] = np.linalg.inv(edges).transpose(0, 2, 1).reshape(len(x), 9)
    for material, cells in parts:
        data[cells[cells < len(x)], 9:] = _constants(material)

    data[:, 9:] *= np.abs(np.linalg.det(edges))[:, None] / 6
    return data


def _straight(x: Array) -> BoolArray:
    """Mask of cells (n, nodes, 3) whose further nodes are the middles of their edges."""
    straight = np.ones(len(x), dtype=bool)
    for node, ends in enumerate(ENDS[: x.shape[1]]):
        if len(ends) == 1:
            continue
        a, b = x[:, ends[0]], x[:, ends[1]]
        off = np.linalg.norm(x[:, node] - (a + b) / 2, axis=1)
        straight &= off <= STRAIGHT * np.linalg.norm(b - a, axis=1)

    return straight


def _squares(slopes: Array, ends: Sequence[int]) -> Array:
    """Integral (n, 3, 3) of grad N ⊗ grad N per volume; `slopes` are the gradients of λ."""
    g = slopes[:, ends[0]]
    if len(ends) == 1:
        return np.asarray(0.6 * g[:, :, None] * g[:, None])

    h = slopes[:, ends[1]]
    gradient_sum = g + h  # 2 gg + 2 hh + gh + hg = gg + hh + (g + h)(g + h)

    return np.asarray(
        0.8 * sum(vector[:, :, None] * vector[:, None] for vector in (g, h, gradient_sum))
    )


def _constants(material: Solid) -> tuple[float, float, float]:
    """(λ/20, μ/20, ρ/420): Lamé's constants and the density as csrc/fem/elastic.c takes them."""
    lame = material.E * material.nu / ((1 + material.nu) * (1 - 2 * material.nu))
    return lame / 20, material.G / 20, material.rho / 420


def _in_lanes(values: Array) -> Array:
    """Values of cells (n, k) padded with zeros, as (groups, k, lanes) for SIMD."""
    groups = -(-len(values) // LANES)
    full = np.zeros((groups * LANES, values.shape[1]), values.dtype)
    full[: len(values)] = values
    return np.ascontiguousarray(full.reshape(groups, LANES, values.shape[1]).transpose(0, 2, 1))


def _add_blocks(blocks: Array, factor: float, matrix: PETSc.Mat) -> None:
    """Add `factor` times the diagonal 3×3 blocks of a sparse matrix to `blocks`."""
    pointers, columns, values = matrix.getValuesCSR()
    rows = np.repeat(np.arange(len(blocks)), np.diff(pointers))
    columns = columns - matrix.getOwnershipRange()[0]
    same_node = rows // 3 == columns // 3
    np.add.at(blocks, (rows[same_node], columns[same_node] % 3), factor * values[same_node])


class Tetra(Structure):
    """The C structure `afe_tetra`."""

    _fields_ = [("n_groups", c_int64), ("nodes", c_void_p), ("data", c_void_p)]


_SIGNATURES: dict[str, tuple[object, ...]] = {  # result, arguments
    "afe_tetra_product_double": (None, c_void_p, c_double, c_double, c_void_p, c_void_p),
    "afe_tetra_product_float": (None, c_void_p, c_float, c_float, c_void_p, c_void_p),
}

#: The functions of the library, which `antiosc.engine.library` has checked.
functions = ctypes.CDLL(str(library.FILE))

for _name, (_result, *_arguments) in _SIGNATURES.items():
    _function = getattr(functions, _name)
    _function.restype, _function.argtypes = _result, _arguments
