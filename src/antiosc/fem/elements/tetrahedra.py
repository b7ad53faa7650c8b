"""Products with K and M of straight quadratic tetrahedra from their cells, without the matrices.

A product with the assembled matrix reads its 80 entries a row from memory; one from the cells reads
a tenth of that and computes the rest (benchmarks/products.py). The strains of a straight quadratic
tetrahedron are linear, so that their values at its corners tell its energy (csrc/elastic.c).
"""

from __future__ import annotations

from ctypes import byref

import numpy as np
from petsc4py import PETSc

from antiosc.base import march
from antiosc.base._types import Array, IntArray
from antiosc.fem.elements.solid import Solid
from antiosc.fem.elements.weak_form import Parts, WeakForm
from antiosc.fem.linalg.petsc_algebra import CELLS, CellProduct
from antiosc.fem.mesh import Mesh
from antiosc.fem.platform import compat

#: `AOM_LANES` and `AOM_TETRA_DATA`
LANES, DATA = 8, 12
#: Dofs of a part from which its products are taken from the cells.
FEWEST_DOFS = 20_000


class Tetrahedra:
    """The cells of this rank of a part, for products with K and M.

    Parameters
    ----------
    fixed : dofs of this rank, ghosts included, whose rows and columns are 1 in K, 0 in M
    """

    def __init__(self, mesh: Mesh, form: WeakForm, parts: Parts, fixed: IntArray) -> None:
        self._space = form.space
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
        self._nodes = _in_lanes(nodes.astype(np.int32))
        self._data = _in_lanes(data)
        addresses = map(march.address, (self._nodes, self._data))
        self._cells = march.Tetra(len(self._nodes), *addresses)
        self._fixed = fixed
        self._rows = compat.local_size(form.space)
        self._held = fixed[fixed < self._rows]

    def product(self, x: Array, stiffness: float, mass: float) -> Array:
        """(stiffness K + mass M) x for a vector or a block of vectors (rows of this rank, k)."""
        columns = x[:, None] if x.ndim == 1 else x
        result = np.empty(columns.shape, order="F")
        for k, column in enumerate(columns.T):
            result[:, k] = self._of_vector(column[:, None], stiffness, mass)
        return result[:, 0] if x.ndim == 1 else result

    def _of_vector(self, x: Array, stiffness: float, mass: float) -> Array:
        u = np.array(compat.with_ghosts(self._space, x)[:, 0], dtype=float)
        u[self._fixed] = 0.0
        out = np.zeros(len(u))
        places = march.address(u), march.address(out)
        march.library.aom_tetra_product(byref(self._cells), stiffness, mass, *places)
        result = compat.ghosts_added(self._space, out[:, None])[:, 0]
        result[self._held] = stiffness * x[self._held, 0]
        return np.asarray(result)


def take_products(
    K: PETSc.Mat, M: PETSc.Mat, mesh: Mesh, form: WeakForm, parts: Parts, fixed: IntArray
) -> None:
    """Have `multiply` take the products with K and M from the cells, where that is worth it."""
    if K.getSize()[0] >= FEWEST_DOFS and _fit(mesh, form, parts):
        take = Tetrahedra(mesh, form, parts, fixed).product
        K.setAttr(CELLS, CellProduct(take, 1.0, 0.0))
        M.setAttr(CELLS, CellProduct(take, 0.0, 1.0))


def _fit(mesh: Mesh, form: WeakForm, parts: Parts) -> bool:
    """Whether products can be taken so: straight quadratic tetrahedra of isotropic materials."""
    straight = mesh.cell == "tetrahedron" and mesh.order == 1 and form.degree == 2
    return straight and form.strains is None and all(isinstance(one, Solid) for one, _ in parts)


def _constants(material: Solid) -> tuple[float, float, float]:
    """Lamé's constants over 20 and the density over 420."""
    lame = material.E * material.nu / ((1 + material.nu) * (1 - 2 * material.nu))
    return lame / 20, material.G / 20, material.rho / 420


def _in_lanes(values: Array) -> Array:
    """Numbers of cells (n, k) as (groups, k, lanes), zeros behind the last one."""
    groups = -(-len(values) // LANES)
    full = np.zeros((groups * LANES, values.shape[1]), values.dtype)
    full[: len(values)] = values
    return np.ascontiguousarray(full.reshape(groups, LANES, -1).transpose(0, 2, 1))
