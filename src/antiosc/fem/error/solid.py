"""Errors of the strains of solids, by recovery.

The strain of each shape is projected (L2, consistent mass matrix) to continuous functions of degree
one, separately on the cells of each stiffness (material and thickness), across which strains jump.
What is left, recovered minus discontinuous strain, stands for the error (Zienkiewicz and Zhu, Int.
J. Numer. Meth. Engng 24 (1987) 337). Its energies and products for all shapes of a model are the
matrix by which the model is softened (`antiosc.models.softened`).
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np

from antiosc._types import Array, IntArray
from antiosc.fem import compat
from antiosc.fem.error.cell_strains import CellStrains
from antiosc.fem.error.projection import Projection
from antiosc.fem.structure.meshed import MeshedStructure


@dataclass(frozen=True)
class SolidErrors:
    """The estimator of 2-D and 3-D solids; see `antiosc.fem.error.estimator`."""

    structure: MeshedStructure

    def gram(self, shapes: Array) -> Array:
        """E_ij = ∫ e_i:C:e_j, (k, k).

        What the projection ε* leaves of ε is orthogonal to ε*, so E = ∫ ε:C:ε - ∫ ε:C:ε*, and one
        pass over the cells suffices.
        """
        strains = self._strains(shapes)
        count = strains.count
        total = np.zeros((count, count))
        for root, cells in self._regions():
            projection = Projection(strains.quadrature, cells)
            loads = np.zeros((projection.size, strains.components * count))
            for some, own, weights in _scaled(strains, root, cells):
                flat = (own * np.sqrt(weights)[:, :, None]).reshape(-1, count)
                total += flat.T @ flat
                loads += projection.loads(some, own * weights[:, :, None])
            loads = projection.owned(loads)
            recovered = projection.solve(loads)
            total -= loads.reshape(-1, count).T @ recovered.reshape(-1, count)
        total = self.structure.comm.allreduce(total)
        return np.asarray((total + total.T) / 2)

    def of_cells(self, shapes: Array) -> Array:
        """Σ_j ∫ e_j:C:e_j over each cell that this rank owns, (cells,)."""
        strains = self._strains(shapes)
        energies = np.zeros(compat.cell_map(self.structure.mesh.dolfinx).size_local)
        for root, cells in self._regions():
            projection = Projection(strains.quadrature, cells)
            loads = np.zeros((projection.size, strains.components * strains.count))
            for some, own, weights in _scaled(strains, root, cells):
                loads += projection.loads(some, own * weights[:, :, None])
            recovered = projection.with_ghosts(projection.solve(projection.owned(loads)))
            for some, own, weights in _scaled(strains, root, cells):
                left = projection.at_points(some, recovered) - own
                energies[cells[some]] = np.einsum("cqf,cqf,cq->c", left, left, weights)
        return energies

    def _strains(self, shapes: Array) -> CellStrains:
        return CellStrains(self.structure.mesh, self.structure.form, shapes)

    def _regions(self) -> Iterator[tuple[Array, IntArray]]:
        """(root R of the stiffness RᵀR of the strains, cells of this rank) of every stiffness."""
        mesh = self.structure.mesh
        owned = compat.cell_map(mesh.dolfinx).size_local
        found: dict[bytes, tuple[Array, list[IntArray]]] = {}
        for material, cells in self.structure.parts:
            root = np.linalg.cholesky(stiffness(material, mesh.gdim)).T
            found.setdefault(root.tobytes(), (root, []))[1].append(cells)
        for root, groups in found.values():
            cells = np.concatenate(groups)
            yield root, cells[cells < owned]


def _scaled(
    strains: CellStrains, root: Array, cells: IntArray
) -> Iterator[tuple[slice, Array, Array]]:
    """(some of the cells, strains times √stiffness (cells, points, components · k), weights)."""
    for some in strains.quadrature.slices(cells):
        own, weights = strains.at(cells[some])
        yield some, (root @ own).reshape(*weights.shape, -1), weights


def stiffness(material: Any, dim: int) -> Array:
    """Stresses, in the plane times the thickness, of unit strains as `CellStrains` orders them."""
    C = np.asarray(material.voigt)
    if dim == 3:
        return C
    kept = [0, 1, 5]
    plane = C[np.ix_(kept, kept)]
    if material.plane == "stress":  # the normal stress across the plane is zero
        plane = plane - np.outer(C[kept, 2], C[2, kept]) / C[2, 2]
    return np.asarray(material.thickness * plane)
