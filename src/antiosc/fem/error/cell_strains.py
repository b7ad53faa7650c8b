"""Strains of shapes at quadrature points of many cells at once."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from antiosc._types import Array, IntArray
from antiosc.fem import compat
from antiosc.fem.elements.weak_form import WeakForm
from antiosc.fem.mesh.mesh import Mesh

#: Quadrature degree of all integrals of strains, and of elements of degree two on products of
#: intervals: their strains hold terms of degree two in one direction, which are errors too and
#: vanish at the points of the lower rule (effectivities of 0.2 to 0.5 in place of 0.6 to 1.2).
RULE_DEGREE, PRODUCT_DEGREE = 2, 4
#: Numbers of a block of arrays that are held at once, which stay in a cache; most blocks.
BLOCK_NUMBERS, MOST_BLOCKS = 250_000, 32
#: Places of the strains (ε11, ε22, ε33, γ23, γ13, γ12), or in the plane (ε11, ε22, γ12).
STRAIN_PLACES = {2: [(0, 0), (1, 1), (0, 1)], 3: [(0, 0), (1, 1), (2, 2), (1, 2), (0, 2), (0, 1)]}


class Quadrature:
    """Points and weights of a quadrature of the cells of a mesh, in slices of cells.

    Attributes
    ----------
    X : (points, tdim) reference coordinates.
    inverse : dX/dx (cells, points or 1, tdim, gdim); one serves all points of a cell with a linear
        map.
    weights : (cells, points), volumes included.
    """

    def __init__(self, mesh: Mesh, numbers_per_cell: int, degree: int) -> None:
        self.mesh = mesh
        self.X, weights = compat.quadrature(mesh.cell, degree)
        slopes = mesh.geometry.slopes(self.X)
        owned = compat.cell_map(mesh.dolfinx).size_local
        nodes = mesh.geometry.nodes[:owned, :, : mesh.gdim]
        if mesh.geometry.affine:
            slopes = slopes[:1]
        self.inverse, volume = inverted(np.swapaxes(nodes, 1, 2)[:, None] @ slopes)
        self.weights = np.abs(volume) * weights
        self._width = max(1, BLOCK_NUMBERS // (numbers_per_cell * len(self.X)))

    def slices(self, cells: IntArray) -> Iterator[slice]:
        """Slices of `cells` that are processed at once."""
        width = max(self._width, -(-len(cells) // MOST_BLOCKS))
        return (slice(k, min(k + width, len(cells))) for k in range(0, len(cells), width))


def inverted(J: Array) -> tuple[Array, Array]:
    """(inverses, determinants) of matrices (…, d, d) of d = 2 or 3, by their minors."""
    if J.shape[-1] == 2:
        a, b, c, d = J[..., 0, 0], J[..., 0, 1], J[..., 1, 0], J[..., 1, 1]
        minors = np.stack([np.stack([d, -b], axis=-1), np.stack([-c, a], axis=-1)], axis=-2)
        volume = a * d - b * c
    else:
        u, v, w = (J[..., k] for k in range(3))
        minors = np.stack([np.cross(v, w), np.cross(w, u), np.cross(u, v)], axis=-2)
        volume = np.einsum("...i,...i->...", u, minors[..., 0, :])
    return minors / volume[..., None, None], volume


class CellStrains:
    """Strains of blocks of shapes (rows of this rank, k) of a solid's displacements."""

    def __init__(self, mesh: Mesh, form: WeakForm, shapes: Array) -> None:
        self.mesh, self._space = mesh, form.space
        self.count = shapes.shape[1]
        self.components = len(STRAIN_PLACES[mesh.gdim])
        self._values = compat.with_ghosts(form.space, shapes)
        self._paths = list(form.components.values())
        functions = compat.cell_dofs(form.space, self._paths[0], np.zeros(0, dtype=int)).shape[1]
        quadratic = functions > len(mesh.geometry.corners)
        degree = PRODUCT_DEGREE if quadratic and not mesh.geometry.simplex else RULE_DEGREE
        self.quadrature = Quadrature(mesh, self.count * mesh.gdim**2, degree)
        self._slopes = compat.tabulate_slopes(form.space, self._paths[0], self.quadrature.X)

    def at(self, cells: IntArray) -> tuple[Array, Array]:
        """(strains (components, points, k), weights (points,)) at all points of the cells, which
        are owned."""
        dim, inverse = self.mesh.gdim, self.quadrature.inverse[cells]
        # derivatives of the functions along x (cells, points · gdim, functions)
        slopes = np.swapaxes(inverse, -1, -2) @ np.swapaxes(self._slopes, -1, -2)
        count, points, _, functions = slopes.shape
        slopes = slopes.reshape(count, points * dim, functions)
        gradients = []
        for path in self._paths:
            values = self._values[compat.cell_dofs(self._space, path, cells)]
            gradients.append((slopes @ values).reshape(count * points, dim, self.count))
        strains = np.empty((self.components, count * points, self.count))
        for k, (i, j) in enumerate(STRAIN_PLACES[dim]):
            strains[k] = gradients[i][:, j]
            if i != j:
                strains[k] += gradients[j][:, i]
        return strains, self.quadrature.weights[cells].ravel()
