"""Products with K and M of quadratic tetrahedra of isotropic materials, cell by cell.

A product with an assembled matrix reads 80 entries per row from memory. A product from the cells,
in the C library (`csrc/fem/antiosc_fem.h`), reads a tenth of that (measured) and computes the rest.
The strains of a straight cell are linear, so that their values at its corners give its energy. A
curved cell is integrated at the quadrature points of the weak form. The two-level solver also needs
the diagonal blocks of the nodes and the assembled matrix of the linear elements. A factorization
needs all entries and assembles them (`with_entries`).
"""

from __future__ import annotations

import ctypes
from abc import ABC, abstractmethod
from collections.abc import Iterator, Mapping, Sequence
from copy import copy
from ctypes import Structure, byref, c_double, c_float, c_int64, c_void_p
from dataclasses import replace
from functools import cached_property
from typing import Any, Literal

import numpy as np
from petsc4py import PETSc

from antiosc.base._types import Array, IntArray
from antiosc.engine import library
from antiosc.fem.elements.solid import Solid, quadrature_degrees, weak_form_of
from antiosc.fem.elements.weak_form import Parts, WeakForm
from antiosc.fem.linalg.petsc_algebra import empty_matrix, multiply
from antiosc.fem.linalg.solver import CURVED_PRODUCTS, STRAIGHT_PRODUCTS, ProductCost
from antiosc.fem.mesh import Mesh
from antiosc.fem.platform import compat

NO_DOFS = np.zeros(0, dtype=np.int32)
#: Least number of dofs for products cell by cell.
LEAST_CELLWISE_DOFS = 20_000
#: `AFE_BEYOND` of the C library: numbers behind a vector that a kernel may read
VECTOR_PADDING = 5
#: `AFE_LANES` of the C library
SIMD_LANES = 8
#: Degree of the quadrature of curved cells in the smoothing of multigrid: solves take as many
#: iterations as with the weak form's, and a product 31 ns a cell in place of 70. As straight cells
#: they take 30, 17, 16 iterations for 21, 14, 14 (a third, a sixth and an eighth of all curved).
SMOOTHING_DEGREE = 2
#: For each node of a cell in dolfinx's order: its corner, or the two corners that it lies between.
NODE_CORNERS = ((0,), (1,), (2,), (3,), (2, 3), (1, 3), (1, 2), (0, 3), (0, 2), (0, 1))
#: Barycentric coordinates (10, 4) of these nodes.
BARYCENTRIC = np.array([[(v in ends) / len(ends) for v in range(4)] for ends in NODE_CORNERS])
#: A quadrature rule: shape functions (points, 10), their gradients (points, 10, 3), weights.
QuadratureRule = tuple[Array, Array, Array]


class Cells(ABC):
    """Cells of one kind on this rank, and products by a C kernel. `nodes` (n, 10), of linear
    elements (n, 4): local numbers of the cells' nodes."""

    #: names of C functions without their precision: for any u, and for u linear in each cell
    function: str
    function_of_linear: str

    def __init__(self, nodes: IntArray) -> None:
        self.nodes = nodes
        self._in_lanes = padded_lanes(nodes.astype(np.int32), "edge")
        self._arguments: dict[np.dtype[Any], tuple[Structure, list[Array]]] = {}

    @abstractmethod
    def blocks(self, k: float, m: float) -> Iterator[Array]:
        """Yield, node by node, the diagonal blocks (n, 3, 3) of k K + m M of the n cells."""

    @abstractmethod
    def _argument(self, nodes: int, arrays: Sequence[int]) -> Structure:
        """The argument of the C kernel; `nodes`, `arrays`: addresses of the arrays."""

    @property
    @abstractmethod
    def _arrays(self) -> Sequence[Array]:
        """The arrays that the argument of the C kernel points to, in double precision."""

    def add(self, k: float, m: float, u: Array, out: Array, linear: bool = False) -> None:
        """Add (k K + m M) u to `out`, both made by `Tetrahedra.vector`, with ghosts; `linear`: u is
        linear in each cell."""
        if u.dtype not in self._arguments:
            arrays = [array.astype(u.dtype, copy=False) for array in self._arrays]
            addresses = [library.address(array) for array in arrays]
            argument = self._argument(library.address(self._in_lanes), addresses)
            self._arguments[u.dtype] = argument, arrays

        function = self.function_of_linear if linear else self.function
        product = getattr(kernels, f"{function}_{'float' if u.dtype == np.float32 else 'double'}")
        argument, _ = self._arguments[u.dtype]
        product(byref(argument), k, m, library.address(u), library.address(out))


class StraightCells(Cells):
    """Straight cells with nodes `x` (n, 4 or 10, 3) [m]. `constants` (n, 3): λ, μ [Pa], ρ
    [kg/m³]."""

    function, function_of_linear = "afe_tetra_product", "afe_tetra_of_linear"

    def __init__(self, nodes: IntArray, x: Array, constants: Array) -> None:
        super().__init__(nodes)
        edges = x[:, 1:4] - x[:, :1]
        volume = np.abs(np.linalg.det(edges)) / 6

        # x = x0 + Σ λ_i (x_i - x_0): the gradients are the columns of the inverse
        gradients = np.linalg.inv(edges).transpose(0, 2, 1).reshape(len(x), 9)
        scaled = constants * volume[:, None] / [20, 20, 420]
        self._data = padded_lanes(np.hstack([gradients, scaled]))

    @property
    def _arrays(self) -> Sequence[Array]:
        return [self._data]

    def _argument(self, nodes: int, arrays: Sequence[int]) -> Structure:
        return CTetra(len(self._in_lanes), nodes, *arrays)

    def _constants(self, k: float, m: float) -> tuple[Array, Array, Array, Array]:
        """Gradients (n, 4, 3) of the barycentric coordinates; kλV, kμV (n, 1, 1), mρV/420 (n,)."""
        data = self._data.transpose(0, 2, 1).reshape(-1, self._data.shape[1])[: len(self.nodes)]
        slopes = data[:, :9].reshape(-1, 3, 3)
        slopes = np.concatenate([-slopes.sum(axis=1, keepdims=True), slopes], axis=1)
        lame, shear = (20 * k * data[:, i, None, None] for i in (9, 10))
        return slopes, lame, shear, m * data[:, 11]

    def blocks(self, k: float, m: float) -> Iterator[Array]:
        slopes, lame, shear, density = self._constants(k, m)

        for ends in NODE_CORNERS:
            squares = _mean_gradient_products(slopes, ends)
            inertia = (6 if len(ends) == 1 else 32) * density
            yield _diagonal_blocks(lame * squares, shear * squares, inertia)


class LinearCells(StraightCells):
    """Linear elements on straight cells; their nodes (n, 4) are the corners."""

    function = function_of_linear = "afe_linear_product"

    def blocks(self, k: float, m: float) -> Iterator[Array]:
        slopes, lame, shear, density = self._constants(k, m)

        for g in slopes.transpose(1, 0, 2):
            squares = g[:, :, None] * g[:, None]
            yield _diagonal_blocks(lame * squares, shear * squares, 42 * density)


class CurvedCells(Cells):
    """Curved cells with nodes `x` (n, 10, 3) [m], `constants` as for `StraightCells`, and
    quadrature rules for K and M."""

    function = function_of_linear = "afe_curved_product"

    def __init__(
        self,
        nodes: IntArray,
        x: Array,
        constants: Array,
        for_k: QuadratureRule,
        for_m: QuadratureRule,
    ) -> None:
        super().__init__(nodes)
        self._rules = for_k, for_m
        self._constants = constants
        centre = x.mean(axis=(0, 1)) if len(x) else 0.0  # for single precision
        positions = np.zeros((nodes.max(initial=0) + 1, 3))
        positions[nodes] = x - centre
        self._positions = np.append(positions, np.zeros(VECTOR_PADDING))

    @property
    def _arrays(self) -> Sequence[Array]:
        points = [np.column_stack([rule[0] @ BARYCENTRIC, rule[2]]) for rule in self._rules]
        values = np.ascontiguousarray(self._rules[1][0])
        return [padded_lanes(self._constants), self._positions, *points, values]

    def _argument(self, nodes: int, arrays: Sequence[int]) -> Structure:
        counts = [len(rule[2]) for rule in self._rules]
        return CCurved(len(self._in_lanes), nodes, *arrays[:2], *counts, *arrays[2:])

    def by_rule(self, rule: QuadratureRule) -> CurvedCells:
        """The same cells with this rule for K and M."""
        result = copy(self)
        result._rules = rule, rule
        result._arguments = {}
        return result

    def blocks(self, k: float, m: float) -> Iterator[Array]:
        x = self._positions[:-VECTOR_PADDING].reshape(-1, 3)[self.nodes]
        constants = self._constants
        (_, gradients, weights), (values, mass_gradients, mass_weights) = self._rules

        # J = dx/dX: the gradients of X are the rows of the inverse
        J = np.einsum("cni,qna->cqia", x, gradients, optimize=True)
        volumes = k * weights * np.abs(np.linalg.det(J))
        inverse = np.linalg.inv(J)
        J = np.einsum("cni,qna->cqia", x, mass_gradients, optimize=True)
        masses = m * mass_weights * np.abs(np.linalg.det(J)) * constants[:, 2:]

        for node in range(len(NODE_CORNERS)):
            slopes = np.einsum("qa,cqai->cqi", gradients[:, node], inverse)
            squares = (volumes[:, :, None] * slopes).transpose(0, 2, 1) @ slopes
            lame, shear = (constants[:, i, None, None] * squares for i in (0, 1))
            yield _diagonal_blocks(lame, shear, masses @ values[:, node] ** 2)


def _diagonal_blocks(lame: Array, shear: Array, inertia: Array) -> Array:
    """The diagonal block of k K + m M at one node of each cell (n, 3, 3), from `lame` = k ∫ λ grad
    N ⊗ grad N, `shear` = k ∫ μ grad N ⊗ grad N and `inertia` = m ∫ ρ N²."""
    result = lame + shear
    diagonal = np.trace(shear, axis1=1, axis2=2) + inertia
    for a in range(3):
        result[:, a, a] += diagonal

    return np.asarray(result)


def _mean_gradient_products(slopes: Array, ends: Sequence[int]) -> Array:
    """Mean over the cell (n, 3, 3) of grad N ⊗ grad N, N the quadratic shape function of the node
    at or between the corners `ends`; `slopes` (n, 4, 3): barycentric coordinates' gradients."""
    g = slopes[:, ends[0]]
    if len(ends) == 1:
        return np.asarray(0.6 * g[:, :, None] * g[:, None])

    h = slopes[:, ends[1]]

    # 2 gg + 2 hh + gh + hg = gg + hh + (g + h)(g + h)
    squares = [vector[:, :, None] * vector[:, None] for vector in (g, h, g + h)]
    return np.asarray(0.8 * sum(squares))


def padded_lanes(values: Array, mode: Literal["constant", "edge"] = "constant") -> Array:
    """Values of cells (n, k), padded by zeros or by the last cell, as (groups, k, `SIMD_LANES`)."""
    full = np.pad(values, ((0, -len(values) % SIMD_LANES), (0, 0)), mode)
    lanes = full.reshape(-1, SIMD_LANES, values.shape[1])
    return np.ascontiguousarray(lanes.transpose(0, 2, 1))


class CTetra(Structure):
    """The C structure `afe_tetra`."""

    _fields_ = [("n_groups", c_int64), ("nodes", c_void_p), ("data", c_void_p)]


class CCurved(Structure):
    """The C structure `afe_curved`."""

    _fields_ = [
        *(("n_groups", c_int64), ("nodes", c_void_p)),
        *((name, c_void_p) for name in ("constants", "x")),
        *((name, c_int64) for name in ("n_points", "n_masses")),
        *((name, c_void_p) for name in ("points", "mass_points", "values")),
    ]


#: The functions of the library, which `antiosc.engine.library` has checked.
kernels = ctypes.CDLL(str(library.LIBRARY_FILE))

for _name in ("tetra_product", "tetra_of_linear", "linear_product", "curved_product"):
    for _precision, _real in (("double", c_double), ("float", c_float)):
        _function = getattr(kernels, f"afe_{_name}_{_precision}")
        _function.restype = None
        _function.argtypes = c_void_p, _real, _real, c_void_p, c_void_p


def cellwise_tetrahedra(
    mesh: Mesh, form: WeakForm, parts: Parts, conditions: Mapping[tuple[int, ...], IntArray]
) -> Tetrahedra | None:
    """`Tetrahedra` for a large part of quadratic isotropic tetrahedra; None for other parts."""
    imap = form.space.dofmap.index_map
    is_large = imap.size_global * form.space.dofmap.index_map_bs >= LEAST_CELLWISE_DOFS
    tetrahedra = mesh.cell == "tetrahedron" and mesh.order <= 2
    isotropic = all(isinstance(material, Solid) for material, _ in parts)
    if not (is_large and tetrahedra and isotropic) or form.degree != 2 or form.strains is not None:
        return None

    return Tetrahedra(mesh, form, parts, conditions)


class Tetrahedra:
    """This rank's cells of a part, for products with K and M. `conditions`: fixed dofs (with
    ghosts) by path of the component; their rows and columns are zero but for 1 on K's diagonal."""

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
        #: number of dofs that this rank owns
        self.rows = compat.local_size(form.space)

        #: number of dofs of this rank, ghosts included
        self._dofs = self.rows + 3 * form.space.dofmap.index_map.num_ghosts
        self._fixed = np.unique(np.concatenate([NO_DOFS, *conditions.values()]))
        self._held = self._fixed[self._fixed < self.rows]

        #: matrices of attachments, added to K and M, and whether there are attachments
        self.added = empty_matrix(self.rows, self.comm), empty_matrix(self.rows, self.comm)
        self.carries = False

    @cached_property
    def _kinds(self) -> list[Cells]:
        """The straight cells, or linear elements; after them the curved cells, if any."""
        return _cells_by_kind(self._mesh, self._form, self._parts)

    @cached_property
    def products(self) -> ProductCost:
        """Forecast cost of products, which depends on the share of curved cells."""
        of_rank = sum(len(cells.nodes) for cells in self._kinds[1:])
        curved = self.comm.allreduce(of_rank) / self._mesh.n_cells

        return replace(
            STRAIGHT_PRODUCTS,
            bytes=STRAIGHT_PRODUCTS.bytes + curved * CURVED_PRODUCTS.bytes,
            aggregated=STRAIGHT_PRODUCTS.aggregated + curved * CURVED_PRODUCTS.aggregated,
            seconds=STRAIGHT_PRODUCTS.seconds + curved * CURVED_PRODUCTS.seconds,
        )

    def product(self, x: Array, k: float, m: float, linear: bool = False) -> Array:
        """(k K + m M) x (rows of this rank[, columns]); `linear`: x is linear in each cell."""
        columns = x if x.ndim > 1 else x[:, None]
        result = np.empty(columns.shape, x.dtype, order="F")
        for j, column in enumerate(columns.T):
            u, out = self.vector(x.dtype), self.vector(x.dtype)
            u[: self.rows] = column
            self.add(k, m, u, out, linear)
            result[:, j] = out[: self.rows]

        return result.reshape(x.shape)

    def vector(self, dtype: np.dtype[Any] | type[np.floating[Any]]) -> Array:
        """A zero vector on the dofs of this rank, ghosts included."""
        return np.zeros(self._dofs + VECTOR_PADDING, dtype)[: self._dofs]

    def add(self, k: float, m: float, u: Array, out: Array, linear: bool = False) -> None:
        """Add (k K + m M) u to `out`, both made by `vector`; ghost values are not read."""
        fixed, fixed_out = u[self._held], out[self._held]
        u[self._held] = 0.0
        out[self.rows :] = 0.0

        self._exchange.fetch(u)
        for cells in self._kinds:
            cells.add(k, m, u, out, linear)
        self._exchange.add(out)
        for factor, matrix in self._matrices(k, m):
            out[: self.rows] += factor * multiply(matrix, u[: self.rows])

        u[self._held] = fixed
        out[self._held] = fixed_out + k * fixed

    def _matrices(self, k: float, m: float) -> Iterator[tuple[float, PETSc.Mat]]:
        """(factor, matrix) of the attachments' terms in k K + m M."""
        if self.carries:
            yield from ((x, A) for x, A in zip((k, m), self.added, strict=True) if x)

    def blocks(self, k: float, m: float) -> Array:
        """The diagonal 3×3 blocks of k K + m M, (rows of this rank, 3)."""
        of_cells = np.zeros((self._dofs // 3, 3, 3))
        for cells in self._kinds:
            for nodes, blocks in zip(cells.nodes.T, cells.blocks(k, m), strict=True):
                for a, b in np.ndindex(3, 3):
                    of_cells[:, a, b] += np.bincount(nodes, blocks[:, a, b], len(of_cells))

        result = compat.ghosts_added(self._form.space, of_cells.reshape(-1, 3))
        for factor, matrix in self._matrices(k, m):
            pointers, columns, values = matrix.getValuesCSR()
            rows = np.repeat(np.arange(len(result)), np.diff(pointers))
            columns = columns - matrix.getOwnershipRange()[0]
            same_node = rows // 3 == columns // 3
            np.add.at(result, (rows[same_node], columns[same_node] % 3), factor * values[same_node])

        blocks = result.reshape(-1, 3, 3)
        blocks[self._held // 3, self._held % 3, :] = 0.0
        blocks[self._held // 3, :, self._held % 3] = 0.0
        result[self._held, self._held % 3] = k
        return result

    def coarse(self, P: PETSc.Mat, fixed: IntArray) -> Tetrahedra:
        """`Tetrahedra` of linear elements on the same cells; attached matrices A become PᵀAP. `P`
        interpolates from the linear elements; `fixed`: local numbers of their fixed dofs."""
        result = Tetrahedra(self._mesh, self.linear, self._parts, {})
        result._held = fixed
        result.added = tuple(matrix.ptap(P) if self.carries else matrix for matrix in self.added)
        result.carries = self.carries
        return result

    def simplified(self) -> Tetrahedra:
        """A spectrally equivalent copy for smoothing: fewer quadrature points in curved cells."""
        kinds = self._kinds
        result = copy(self)
        rule = _quadrature(self._mesh, self._form, SMOOTHING_DEGREE)
        result._kinds = [
            cells.by_rule(rule) if isinstance(cells, CurvedCells) else cells for cells in kinds
        ]
        return result

    @cached_property
    def linear(self) -> WeakForm:
        """The weak form of linear elements on these cells."""
        return weak_form_of(self._mesh, self._parts, 1)

    def entries(self, k: float, m: float) -> PETSc.Mat:
        """The assembled matrix k K + m M."""
        form = self._form
        total: PETSc.Mat | None = None
        pattern = PETSc.Mat.Structure.UNKNOWN_NONZERO_PATTERN
        for factor, forms, added_matrix, diagonal in zip(
            (k, m), (form.stiffness, form.mass), self.added, (1.0, 0.0), strict=True
        ):
            if not factor:
                continue
            matrix = compat.assemble(forms, form.space, self._conditions, diagonal)
            if self.carries:
                # an interpolation stores zeros, by which points meet cells beside their own
                matrix.axpy(1.0, added_matrix, structure=pattern)
            if factor != 1.0:
                matrix.scale(factor)
            if total is None:
                total = matrix
            else:
                total.axpy(1.0, matrix, structure=pattern)

        return total


def _cells_by_kind(mesh: Mesh, form: WeakForm, parts: Parts) -> list[Cells]:
    """The straight cells that this rank owns and, after them, the curved ones if there are any."""
    count = compat.cell_index_map(mesh.dolfinx).size_local
    x = mesh.geometry.nodes[:count]
    nodes = compat.cell_dofs(form.space, (0,), np.arange(count)) // 3
    materials = np.empty((count, 3))  # (λ [Pa], μ [Pa], ρ [kg/m³])
    for material, cells in parts:
        lame = material.E * material.nu / ((1 + material.nu) * (1 - 2 * material.nu))
        materials[cells[cells < count]] = lame, material.G, material.rho

    if form.degree == 1:
        return [LinearCells(nodes, x, materials)]
    is_straight = mesh.geometry.straight[:count]
    kinds: list[Cells] = [StraightCells(nodes[is_straight], x[is_straight], materials[is_straight])]
    if is_straight.all():
        return kinds

    rules = [_quadrature(mesh, form, degree) for degree in quadrature_degrees(mesh, 2)]
    curved = ~is_straight
    return [*kinds, CurvedCells(nodes[curved], x[curved], materials[curved], *rules)]


def _quadrature(mesh: Mesh, form: WeakForm, degree: int) -> QuadratureRule:
    """The quadrature rule of this degree, with the shape functions of `form`."""
    X, weights = compat.quadrature(mesh.cell, degree)
    values = compat.tabulate(form.space, (0,), X)
    gradients = compat.tabulate_derivatives(form.space, (0,), X)
    return values, np.ascontiguousarray(gradients), weights
