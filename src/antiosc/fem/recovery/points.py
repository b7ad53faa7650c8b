"""Points within cells at which strains are evaluated: shape functions, their slopes, frames."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

import numpy as np

from antiosc.base._types import Array, IntArray
from antiosc.fem.platform import compat
from antiosc.fem.structure.meshed import MeshedStructure


def in_frame(local: Array, frame: Sequence[Array]) -> Array:
    """Tensors (P, 3, 3, columns) whose axes are the three `frame` vectors (P, 3), in the mesh's."""
    axes = np.stack(list(frame), axis=1)
    return np.einsum("pai,pabk,pbj->pijk", axes, local, axes, optimize=True)


class PointsInCells:
    """Points of cells of this rank, and the dofs of their cells.

    Parameters
    ----------
    part : MeshedStructure
    shapes : (dofs of this rank, ghosts included; columns)
    cells, X : (P,), reference coordinates (P, tdim)
    """

    def __init__(self, part: MeshedStructure, shapes: Array, cells: IntArray, X: Array) -> None:
        self.part, self.cells, self.X = part, np.asarray(cells), np.asarray(X)
        self._shapes = shapes
        self._space = part.form.space
        self._first = next(iter(part.form.components.values()))
        _, self.J = part.mesh.geometry.at(self.cells, self.X)

    def moved(self, X: Array) -> PointsInCells:
        """Other points X (P, tdim) or (tdim,) of the same cells."""
        where = np.broadcast_to(X, self.X.shape)
        return PointsInCells(self.part, self._shapes, self.cells, where)

    def dofs(self, names: str | tuple[str, ...]) -> Array:
        """Components (P, functions, len(names), columns) of the dofs of the cells; 0 for absent."""
        components = self.part.form.components
        count = self._shapes.shape[1]
        found = []
        for name in names:
            if name in components:
                numbers = compat.cell_dofs(self._space, components[name], self.cells)
                found.append(self._shapes[numbers])
            else:
                found.append(np.zeros((len(self.cells), self.functions, count)))
        return np.stack(found, axis=2)

    @property
    def functions(self) -> int:
        """Number of basis functions of a cell."""
        return int(compat.cell_dofs(self._space, self._first, self.cells[:0]).shape[1])

    def each(self, value: Callable[[Any], list[float]]) -> Array:
        """Numbers (P, m) of the material at each point."""
        table = np.array([value(material) for material, _ in self.part.parts])
        return np.asarray(table[self.part.part_of_cells()[self.cells]])

    def values(self, dofs: Array) -> Array:
        """Values (P, components, columns) at the points."""
        if not len(self.X):
            return np.zeros((0, *dofs.shape[2:]))
        table = compat.tabulate(self._space, self._first, self.X)
        return np.einsum("pf,pfck->pck", table, dofs, optimize=True)

    def slopes(self, dofs: Array) -> Array:
        """Derivatives (P, components, tdim, columns) along the reference directions."""
        if not len(self.X):
            return np.zeros((0, dofs.shape[2], self.part.mesh.tdim, dofs.shape[3]))
        table = compat.tabulate_slopes(self._space, self._first, self.X)
        return np.einsum("pfd,pfck->pcdk", table, dofs, optimize=True)


def lagrange_1d(nodes: Array, x: Array) -> Array:
    """Lagrange's polynomials (points, nodes) through `nodes` (n,) at x (points,)."""
    table = np.ones((len(x), len(nodes)))
    for i, own in enumerate(nodes):
        for j, other in enumerate(nodes):
            if i != j:
                table[:, i] *= (x - other) / (own - other)
    return table


def gauss_points(count: int) -> Array:
    """Gauss's points (count,) of the interval from 0 to 1."""
    return np.asarray((np.polynomial.legendre.leggauss(count)[0] + 1) / 2)
