"""Products with K and M of straight quadratic tetrahedra of isotropic materials, cell by cell.

The strains of a straight quadratic tetrahedron are linear, so that its energy follows from the
strains at its corners (csrc/fem/elastic.c).
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from ctypes import byref
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from antiosc.base._types import Array, IntArray
from antiosc.engine import library
from antiosc.fem.elements.cell_by_cell import CellByCell
from antiosc.fem.elements.solid import Solid
from antiosc.fem.linalg.forecast import TETRAHEDRA
from antiosc.fem.platform import compat, kernels

#: `AFE_LANES` and `AFE_TETRA_DATA` of the C library
LANES = 8
DATA = 12
#: For each node of a cell in dolfinx's order: the corner, or the two corners it lies between.
ENDS = ((0,), (1,), (2,), (3,), (2, 3), (1, 3), (1, 2), (0, 3), (0, 2), (0, 1))


class Tetrahedra(CellByCell):
    """Straight quadratic tetrahedra, all isotropic."""

    lanes = LANES
    products = TETRAHEDRA

    def _take(self, nodes: IntArray, order: IntArray) -> None:
        mesh = self._mesh.dolfinx
        count = len(nodes)
        x = mesh.geometry.x[compat.geometry_nodes(mesh)[:count]]
        edges = x[:, 1:] - x[:, :1]
        volume = np.abs(np.linalg.det(edges)) / 6
        data = np.empty((count, DATA))
        # x = x0 + Σ λ_i (x_i - x_0): the gradients are the columns of the inverse
        data[:, :9] = np.linalg.inv(edges).transpose(0, 2, 1).reshape(count, 9)
        for material, cells in self._parts:
            data[cells[cells < count], 9:] = _constants(material)
        data[:, 9:] *= volume[:, None]
        self._nodes = _in_lanes(nodes[order].astype(np.int32))
        self._data = _in_lanes(data[order])

    def _add(self, group: int, k: float, m: float, u: Array, out: Array) -> None:
        product, groups = self._in_single if u.dtype == np.float32 else self._in_double
        product(byref(groups[group]), k, m, library.address(u), library.address(out))

    @cached_property
    def _in_double(self) -> tuple[Callable[..., None], list[kernels.Tetra]]:
        """(product function of the C library, groups of cells) in double precision."""
        return kernels.functions.afe_tetra_product_double, self._given(self._data)

    @cached_property
    def _in_single(self) -> tuple[Callable[..., None], list[kernels.Tetra]]:
        """(product function of the C library, groups of cells) in single precision."""
        self._single = self._data.astype(np.float32)
        return kernels.functions.afe_tetra_product_float, self._given(self._single)

    def _given(self, data: NDArray[Any]) -> list[kernels.Tetra]:
        """The groups of cells for the C library, with `data` in single or double precision."""
        return [
            kernels.Tetra(
                end - start, *(library.address(array[start:end]) for array in (self._nodes, data))
            )
            for start, end in self._groups
        ]

    def _node_blocks(self, k: float, m: float) -> Array:
        data = self._data.transpose(0, 2, 1).reshape(-1, DATA)
        nodes = self._nodes.transpose(0, 2, 1).reshape(len(data), -1)
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


def _squares(slopes: Array, ends: Sequence[int]) -> Array:
    """Integral (n, 3, 3) of grad N ⊗ grad N over a cell, per volume; `slopes` are the gradients of
    λ.
    """
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
    return np.ascontiguousarray(full.reshape(groups, LANES, -1).transpose(0, 2, 1))
