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

from antiosc.base._types import Array, IntArray
from antiosc.base.errors import AccuracyWarning, InputError
from antiosc.fem.error.projection import CellStrains, Projection
from antiosc.fem.platform import compat
from antiosc.fem.platform.mpi import warn
from antiosc.fem.structure.meshed import MeshedStructure

#: Poisson's ratio from which the bars of linear elements are too narrow at times, by up to a half,
#: and from which by a factor of 2 and more: they lock, and the strains that they lack are smooth in
#: their place, so that recovery sees nothing. Clamped bars of 16 to 64 elements, in plane strain
#: (true errors at 0.45, 0.49, 0.499, 0.4999: 2.6, 5.1, 9.9, 11 %; bars: 3.0, 4.4, 3.7, 2.2 %).
LOCKING, LOCKED = 0.4, 0.48


def refuse_locking(structure: MeshedStructure) -> None:
    """InputError for linear elements of a nearly incompressible solid; a warning where it begins.

    Plane stress and displacements of degree 2 do not lock. Of a material with directions counts
    the Poisson's ratio of its mean stiffnesses in volume and in shear.
    """
    form, mesh, none = structure.form, structure.mesh, np.zeros(0, dtype=int)
    linear = compat.lagrange(mesh.dolfinx, 1, 0)
    if (
        compat.cell_dofs(form.space, (0,), none).shape[1]
        > (compat.cell_dofs(linear, (0,), none).shape[1])
    ):
        return
    nu = max(
        (_poisson(m) for m, _ in structure.parts if getattr(m, "plane", None) != "stress"),
        default=0.0,
    )
    told = (
        f"Poisson's ratio is {nu:.4g} and the {mesh.cell} elements are linear (order=1): from "
        f"{LOCKING:g} on they lock, and the estimate of their error is too small; take order=2."
    )
    if nu >= LOCKED:
        raise InputError(told)
    if nu >= LOCKING:
        warn(structure.comm, told, AccuracyWarning)


def _poisson(material: Any) -> float:
    """nu of the mean bulk and shear moduli (Voigt's)."""
    C = np.asarray(material.voigt)
    bulk = float(C[:3, :3].sum()) / 9
    shear = float(np.trace(C[:3, :3]) - 3 * bulk + 2 * np.trace(C[3:, 3:])) / 10
    return (3 * bulk - 2 * shear) / (2 * (3 * bulk + shear))


@dataclass(frozen=True)
class SolidErrors:
    """The estimator of 2-D and 3-D solids; see `antiosc.fem.error.model_errors`."""

    structure: MeshedStructure

    def gram(self, shapes: Array) -> Array:
        """E_ij = ∫ e_i:C:e_j, (k, k)."""
        return self.gram_and_layers(shapes, np.zeros(0))[0]

    def gram_and_layers(self, shapes: Array, layers: Array) -> tuple[Array, Array]:
        """E_ij = ∫ e_i:C:e_j (k, k), and energies ∫ ε*:C:ε* (k,) of layers on the outer faces.

        `layers` (F,) are the volumes [m³] (areas in the plane) on the faces of this rank, or none.

        With the projections ε* = Σ x φ, their loads l and mass matrix M, E = ∫ ε:C:ε - lᵀx - xᵀl +
        xᵀMx: one pass over the cells suffices. The residual l - Mx of the solve matters to its
        square only; lᵀx alone would not be symmetric by as much as the residual itself.
        """
        strains = self._strains(shapes)
        count = strains.count
        total, outside = np.zeros((count, count)), np.zeros(count)
        for root, cells in self._regions():
            projection = Projection(strains.quadrature, cells)
            loads = np.zeros((projection.size, strains.components, count))
            for some, own, weights in _scaled(strains, root, cells):
                projection.add_loads(loads, some, own)
                own *= np.sqrt(weights)[:, None]
                flat = own.reshape(-1, count)
                total += flat.T @ flat
            flat = projection.owned(loads.reshape(len(loads), -1))
            recovered = projection.solve(flat)
            rest = flat + projection.residual(flat, recovered)
            half = rest.reshape(-1, count).T @ recovered.reshape(-1, count)
            total -= (half + half.T) / 2
            if self.structure.comm.allreduce(len(layers)):
                outside += self._outside(projection, cells, recovered, layers, count)
        return self.structure.comm.allreduce(total), self.structure.comm.allreduce(outside)

    def _outside(
        self, projection: Projection, cells: IntArray, recovered: Array, layers: Array, count: int
    ) -> Array:
        """Energies (count,) of layers on those faces that belong to `cells`."""
        faces = self.structure.faces
        here = np.flatnonzero(np.isin(faces.cells, cells))
        X = faces.reference(here, faces.middle[here])
        values = projection.within(faces.cells[here], X, projection.with_ghosts(recovered))
        values = values.reshape(len(here), -1, count)
        return np.asarray(np.einsum("fmk,fmk,f->k", values, values, layers[here]))

    def of_cells(self, shapes: Array) -> Array:
        """Σ_j ∫ e_j:C:e_j over each cell that this rank owns, (cells,)."""
        strains = self._strains(shapes)
        energies = np.zeros(compat.cell_map(self.structure.mesh.dolfinx).size_local)
        for root, cells in self._regions():
            projection = Projection(strains.quadrature, cells)
            loads = np.zeros((projection.size, strains.components, strains.count))
            for some, own, _ in _scaled(strains, root, cells):
                projection.add_loads(loads, some, own)
            flat = projection.owned(loads.reshape(len(loads), -1))
            recovered = projection.with_ghosts(projection.solve(flat))
            for some, own, weights in _scaled(strains, root, cells):
                found = projection.at_points(some, recovered)
                left = found.reshape(-1, *loads.shape[1:]) - np.swapaxes(own, 0, 1)
                at_points = np.einsum("pmk,pmk,p->p", left, left, weights)
                energies[cells[some]] = at_points.reshape(len(cells[some]), -1).sum(axis=1)
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
    """(some of the cells, strains times √stiffness (components, points, k), weights (points,))."""
    for some in strains.quadrature.slices(cells):
        own, weights = strains.at(cells[some])
        yield some, (root @ own.reshape(len(own), -1)).reshape(own.shape), weights


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
