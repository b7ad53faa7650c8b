"""Errors of the strains of shells, by recovery.

The strains of each shape, the interpolated shear strains among them, are projected (L2, consistent
mass matrix) to continuous functions of degree two, their own degree, on each smooth piece of the
surface. What is left, recovered minus discontinuous strain e_j, stands for the error; the layers
along free edges, which neither of them shows, are added (`antiosc.fem.error.free_edges`).

It is not all of the error of a flexibility. With the exact section forces σ and the strains s_h of
the element, which are ε(u_h) + d_h, d_h being what the interpolation changes in the shear strains,

    σ:C⁻¹:σ - σ_h:C⁻¹:σ_h = |σ - σ_h|² + 2 ∫ (σ:s_h - σ_h:s_h) = |σ - σ_h|² + 2 ∫ Q·d_h,

for σ and σ_h are in equilibrium with one load: with the displacements ε(u_h) and with the strains
s_h. The first term is the energy of the error; the second one, which vanishes in elements without
interpolation, may have either sign, and can make a coarse mesh softer than the part. The recovered
shear forces stand for Q. Likewise E_ij = ∫ e_i:C:e_j and the misfit ∫ Q_i·d_j + Q_j·d_i for the
products of all shapes.
"""

from __future__ import annotations

import numpy as np

from antiosc.base._types import Array
from antiosc.base.errors import InputError
from antiosc.fem.error.free_edges import layers_of
from antiosc.fem.error.sheet_strains import SHEAR, SheetRecovery
from antiosc.fem.error.smooth_pieces import FLAT, smooth_pieces
from antiosc.fem.platform import compat
from antiosc.fem.structure.meshed import MeshedStructure


class ShellErrors:
    """The estimator of shells of triangles, on one rank."""

    def __init__(self, part: MeshedStructure) -> None:
        if part.comm.size > 1:
            raise InputError("error='estimate' of shells runs on one rank; leave error=None here.")
        if part.mesh.cell != "triangle":
            raise InputError(
                "error='estimate' of shells takes triangles: the strains of quadrilaterals are "
                f"most accurate where {part.mesh.name} takes them, and their recovery finds a half "
                "to a fifth of the error. Mesh with triangles, or leave error=None and compare two "
                "element sizes."
            )
        self._part = part
        self._pieces = smooth_pieces(part)

    @property
    def faceted(self) -> str:
        """A sentence if flat cells stand for a curved surface."""
        if self._part.mesh.order > 1 or self._pieces.bent < FLAT:
            return ""
        return (
            f"Not included: the flat cells of {self._part.mesh.name}, which meet at angles of up "
            f"to {self._pieces.bent:.2g}°, for a curved surface; read its geometry with order=2."
        )

    def gram_and_misfit(self, shapes: Array) -> tuple[Array, Array]:
        """(E_ij = ∫ e_i:C:e_j, ∫ Q_i·d_j + Q_j·d_i), (k, k) each."""
        found = SheetRecovery(self._part, shapes, self._pieces)
        E = layers_of(self._part, self._pieces, found).energies()
        work = np.zeros_like(E)
        for block in found.blocks():
            strains, recovered = block.strains, block.recovered
            left = recovered - strains.own
            E += _products(left, block.D, left, strains.weights)
            S = block.D[:, SHEAR, SHEAR]
            work += _products(recovered[:, SHEAR], S, strains.gap, strains.weights)
        return (E + E.T) / 2, work + work.T

    def gram(self, shapes: Array) -> Array:
        """E_ij = ∫ e_i:C:e_j, (k, k)."""
        return self.gram_and_misfit(shapes)[0]

    def of_cells(self, shapes: Array) -> Array:
        """Σ_j ∫ e_j:C:e_j over each cell, (cells,)."""
        found = SheetRecovery(self._part, shapes, self._pieces)
        layers = layers_of(self._part, self._pieces, found)
        along = layers.weights * (layers.m**2).sum(axis=1)
        count = compat.cell_map(self._part.mesh.dolfinx).size_local
        energies = np.asarray(np.bincount(layers.cells, along, minlength=count), dtype=float)
        for block in found.blocks():
            left = block.recovered - block.strains.own
            at_points = np.einsum("pik,pik->p", left, block.D @ left) * block.strains.weights
            own = energies[block.cells]
            own += at_points.reshape(len(own), -1).sum(axis=1)
        return energies


def _products(a: Array, D: Array, b: Array, weights: Array) -> Array:
    """∫ a_i:D:b_j (k, k) of fields (P, m, k)."""
    forces = (D * weights[:, None, None]) @ b
    return np.asarray(a.reshape(-1, a.shape[2]).T @ forces.reshape(-1, b.shape[2]))
