"""Products of quadratic tetrahedra in the C library (`csrc/fem/antiosc_fem.h`), and their blocks.

The strains of a straight cell are linear, so that its energy follows from those at its corners.
A curved cell is integrated at the quadrature points of the weak form.
"""

from __future__ import annotations

import ctypes
from abc import ABC, abstractmethod
from collections.abc import Sequence
from ctypes import Structure, byref, c_double, c_float, c_int64, c_void_p
from typing import Any

import numpy as np

from antiosc.base._types import Array, IntArray
from antiosc.engine import library
from antiosc.fem.elements.weak_form import Parts

#: `AFE_LANES` and `AFE_POINT_DATA` of the C library
LANES, POINT = 8, 11
#: For each node of a cell in dolfinx's order: the corner, or the two corners it lies between.
ENDS = ((0,), (1,), (2,), (3,), (2, 3), (1, 3), (1, 2), (0, 3), (0, 2), (0, 1))
#: A quadrature rule: shape functions (points, 10), their gradients (points, 10, 3), weights.
Rule = tuple[Array, Array, Array]


class Cells(ABC):
    """Cells of one kind.

    Parameters
    ----------
    nodes : IntArray (n, 10)
        Numbers of their nodes on this rank.
    """

    #: the C function without its precision
    function: str

    def __init__(self, nodes: IntArray) -> None:
        self.nodes = nodes
        self._in_lanes = in_lanes(nodes.astype(np.int32))
        self._arguments: dict[np.dtype[Any], tuple[Structure, list[Array]]] = {}

    @abstractmethod
    def blocks(self, k: float, m: float) -> Array:
        """The diagonal 3×3 blocks of k K + m M of each cell at its nodes: (n, 10, 3, 3)."""

    @abstractmethod
    def _argument(self, nodes: int, arrays: Sequence[int]) -> Structure:
        """The C structure of nodes and arrays at these addresses."""

    @property
    @abstractmethod
    def _arrays(self) -> Sequence[Array]:
        """The arrays of the C structure in double precision."""

    def add(self, k: float, m: float, u: Array, out: Array) -> None:
        """Add (k K + m M) u to `out`, both on all dofs of this rank, single or double."""
        if u.dtype not in self._arguments:
            arrays = [array.astype(u.dtype, copy=False) for array in self._arrays]
            addresses = [library.address(array) for array in arrays]
            argument = self._argument(library.address(self._in_lanes), addresses)
            self._arguments[u.dtype] = argument, arrays

        precision = "float" if u.dtype == np.float32 else "double"
        product = getattr(functions, f"{self.function}_{precision}")
        argument, _ = self._arguments[u.dtype]
        product(byref(argument), k, m, library.address(u), library.address(out))


class StraightCells(Cells):
    """Straight cells.

    Parameters
    ----------
    x : (n, 4 or 10, 3)
        Their corners first [m].
    constants : (n, 3)
        Lamé's constants [Pa] and the density [kg/m³].
    """

    function = "afe_tetra_product"

    def __init__(self, nodes: IntArray, x: Array, constants: Array) -> None:
        super().__init__(nodes)
        edges = x[:, 1:4] - x[:, :1]
        volume = np.abs(np.linalg.det(edges)) / 6

        # x = x0 + Σ λ_i (x_i - x_0): the gradients are the columns of the inverse
        gradients = np.linalg.inv(edges).transpose(0, 2, 1).reshape(len(x), 9)
        scaled = constants * volume[:, None] / [20, 20, 420]
        self._data = in_lanes(np.hstack([gradients, scaled]))

    @property
    def _arrays(self) -> Sequence[Array]:
        return [self._data]

    def _argument(self, nodes: int, arrays: Sequence[int]) -> Structure:
        return Tetra(len(self._in_lanes), nodes, *arrays)

    def blocks(self, k: float, m: float) -> Array:
        data = self._data.transpose(0, 2, 1).reshape(-1, self._data.shape[1])[: len(self.nodes)]
        slopes = data[:, :9].reshape(-1, 3, 3)
        slopes = np.concatenate([-slopes.sum(axis=1, keepdims=True), slopes], axis=1)
        lame = 20 * k * data[:, 9, None, None]
        shear = 20 * k * data[:, 10, None, None]
        density = m * data[:, 11]

        result = np.empty((len(data), len(ENDS), 3, 3))
        for node, ends in enumerate(ENDS):
            squares = _squares(slopes, ends)
            inertia = (6 if len(ends) == 1 else 32) * density
            result[:, node] = _blocks(lame * squares, shear * squares, inertia)

        return result


class CurvedCells(Cells):
    """Curved cells.

    Parameters
    ----------
    x : (n, 10, 3)
        Their nodes [m].
    constants : (n, 3)
        As of `StraightCells`.
    for_k, for_m : Rule
        The quadrature of K and of M.
    """

    function = "afe_curved_product"

    def __init__(
        self, nodes: IntArray, x: Array, constants: Array, for_k: Rule, for_m: Rule
    ) -> None:
        super().__init__(nodes)
        _, self._gradients, weights = for_k
        values, gradients, mass_weights = for_m
        self._values = np.ascontiguousarray(values)

        # J = dx/dX: the gradients of X are the rows of the inverse
        J = np.einsum("cni,qna->cqia", x, self._gradients, optimize=True)
        volumes = weights * np.abs(np.linalg.det(J))
        scaled = volumes[:, :, None] * constants[:, None, :2]
        points = np.concatenate([np.linalg.inv(J).reshape(*volumes.shape, 9), scaled], axis=2)
        self._points = in_lanes(points.reshape(len(x), -1))

        J = np.einsum("cni,qna->cqia", x, gradients, optimize=True)
        volumes = mass_weights * np.abs(np.linalg.det(J))
        self._masses = in_lanes(volumes * constants[:, 2:])

    @property
    def _arrays(self) -> Sequence[Array]:
        return [self._gradients, self._values, self._points, self._masses]

    def _argument(self, nodes: int, arrays: Sequence[int]) -> Structure:
        counts = len(self._gradients), len(self._values)
        return Curved(len(self._in_lanes), nodes, *counts, *arrays)

    def blocks(self, k: float, m: float) -> Array:
        count = len(self.nodes)
        points = self._points.transpose(0, 2, 1).reshape(-1, len(self._gradients), POINT)[:count]
        masses = self._masses.transpose(0, 2, 1).reshape(-1, len(self._values))[:count]
        inverse = points[:, :, :9].reshape(count, -1, 3, 3)

        result = np.empty((count, len(ENDS), 3, 3))
        for node in range(len(ENDS)):
            slopes = np.einsum("qa,cqai->cqi", self._gradients[:, node], inverse)
            lame, shear = (
                k * (constant[:, :, None] * slopes).transpose(0, 2, 1) @ slopes
                for constant in (points[:, :, 9], points[:, :, 10])
            )
            inertia = m * masses @ self._values[:, node] ** 2
            result[:, node] = _blocks(lame, shear, inertia)

        return result


def _blocks(lame: Array, shear: Array, inertia: Array) -> Array:
    """Blocks (n, 3, 3) of a node, from ∫ λ grad N ⊗ grad N, ∫ μ grad N ⊗ grad N and ∫ ρ N²."""
    result = lame + shear
    diagonal = np.trace(shear, axis1=1, axis2=2) + inertia
    for a in range(3):
        result[:, a, a] += diagonal

    return np.asarray(result)


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


def constants(parts: Parts, count: int) -> Array:
    """Lamé's constants and the density (count, 3) of the first cells of a part of `Solid`."""
    result = np.empty((count, 3))
    for material, cells in parts:
        lame = material.E * material.nu / ((1 + material.nu) * (1 - 2 * material.nu))
        result[cells[cells < count]] = lame, material.G, material.rho

    return result


def in_lanes(values: Array) -> Array:
    """Values of cells (n, k) padded with zeros, as (groups, k, lanes) for SIMD."""
    groups = -(-len(values) // LANES)
    full = np.zeros((groups * LANES, values.shape[1]), values.dtype)
    full[: len(values)] = values
    return np.ascontiguousarray(full.reshape(groups, LANES, values.shape[1]).transpose(0, 2, 1))


class Tetra(Structure):
    """The C structure `afe_tetra`."""

    _fields_ = [("n_groups", c_int64), ("nodes", c_void_p), ("data", c_void_p)]


class Curved(Structure):
    """The C structure `afe_curved`."""

    _fields_ = [
        *(("n_groups", c_int64), ("nodes", c_void_p)),
        *((name, c_int64) for name in ("n_points", "n_masses")),
        *((name, c_void_p) for name in ("gradients", "values", "points", "masses")),
    ]


#: The functions of the library, which `antiosc.engine.library` has checked.
functions = ctypes.CDLL(str(library.FILE))

for _cells in (StraightCells, CurvedCells):
    for _precision, _real in (("double", c_double), ("float", c_float)):
        _function = getattr(functions, f"{_cells.function}_{_precision}")
        _function.restype = None
        _function.argtypes = c_void_p, _real, _real, c_void_p, c_void_p
