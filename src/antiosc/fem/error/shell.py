"""Errors of the strains of shells, by recovery.

The strains of each shape, the interpolated shear strains among them, are projected (L2, consistent
mass matrix) to continuous functions of degree two, their own degree, on each smooth piece of the
surface. What is left, recovered minus discontinuous strain e_j, stands for the error; the layers
along free edges, which neither of them shows, are added.

It is not all of the error of a flexibility. With the exact section forces σ and the strains s_h of
the element, which are ε(u_h) + d_h, d_h being what the interpolation changes in the shear strains,

    σ:C⁻¹:σ - σ_h:C⁻¹:σ_h = |σ - σ_h|² + 2 ∫ (σ:s_h - σ_h:s_h) = |σ - σ_h|² + 2 ∫ Q·d_h,

for σ and σ_h are in equilibrium with one load: with the displacements ε(u_h) and with the strains
s_h. The first term is the energy of the error; the second one, which vanishes in elements without
interpolation, may have either sign, and can make a coarse mesh softer than the part. The recovered
shear forces stand for Q. Likewise E_ij = ∫ e_i:C:e_j and the misfit ∫ Q_i·d_j + Q_j·d_i for the
products of all shapes.

Layers: where an edge is free to turn about its normal, its twisting moment m vanishes, but over a
length of the order of the thickness only: farther inside, and in a mesh of larger cells, it is
that of a plate without shear deformation. The layer decays as exp(-s/ℓ), with ℓ² = D66/S of the
twisting and the shear stiffness along the edge (t²/10 if isotropic), and holds the energy m² ℓ/D66
per length: half in the twisting moment that it takes away, half in the shear force m/ℓ that is in
equilibrium with it (D. N. Arnold, R. S. Falk, SIAM J. Numer. Anal. 26 (1989) 1276-1312).

Where the section changes, m jumps likewise in such a mesh, and both sides have a layer: with c =
ℓ/D66 of each, their moments are in the ratio that gives them one rotation, and their energy is that
of the jump with c1 c2/(c1 + c2). At folds and ribs the other sheet, or the rib, holds the rotation.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from antiosc.base._types import Array, BoolArray, IntArray
from antiosc.base.errors import InputError
from antiosc.fem.error.sheet_strains import (
    BENDING,
    EDGES,
    ENDS,
    FLAT,
    FOLD,
    MEMBRANE,
    SHEAR,
    SheetRecovery,
    SmoothPieces,
    angles,
    edge_normals,
    neighbours,
    smooth_pieces,
)
from antiosc.fem.platform import compat
from antiosc.fem.recovery.points import PointsInCells, gauss_points
from antiosc.fem.structure.meshed import MeshedStructure

#: Gauss points of an edge, and their weights.
POINTS = gauss_points(3)
WEIGHTS = np.polynomial.legendre.leggauss(3)[1] / 2
#: Component of the normal of an edge below which it is taken for 0.
ALONG = 1e-6


class _Side(NamedTuple):
    """Points of edges as one of their cells sees them."""

    #: normals of the sheet (P, 3), and of the edges (P, 3)
    n: Array
    outward: Array
    #: twisting moments (P, k) and flexibility ℓ/D66 (P,)
    m: Array
    c: Array
    #: (P,) m
    weights: Array


class Layers(NamedTuple):
    """Layers along edges, at Gauss's points of these."""

    #: moments that vanish in the layers (P, k)
    m: Array
    #: their flexibility times length, 1/N
    weights: Array
    #: (P,) in which they lie
    cells: IntArray

    def energies(self) -> Array:
        """∮ m_i m_j ℓ/D66 (k, k)."""
        return np.asarray(self.m.T @ (self.weights[:, None] * self.m))


def layers_of(part: MeshedStructure, pieces: SmoothPieces, found: SheetRecovery) -> Layers:
    """The layers along all free edges, and where sections change."""
    exterior, changes = _edges(part, pieces)
    m, weights = [np.zeros((0, found.count))], [np.zeros(0)]
    if exterior.size:
        one = _side(part, pieces, found, exterior)
        free = np.repeat(_free(part, exterior, one.outward[:: len(POINTS)]), len(POINTS))
        m.append(one.m)
        weights.append(free * one.weights * one.c)
    if changes.size:
        one, other = (_side(part, pieces, found, places) for places in changes)
        same = np.sign(np.einsum("pc,pc->p", one.n, other.n))
        m.append(one.m - same[:, None] * other.m)
        weights.append(one.weights * one.c * other.c / (one.c + other.c))
    cells = np.append(exterior, changes[:1]) // EDGES
    return Layers(np.vstack(m), np.concatenate(weights), np.repeat(cells, len(POINTS)))


def _edges(part: MeshedStructure, pieces: SmoothPieces) -> tuple[IntArray, IntArray]:
    """Places among the edges of all cells in turn: (of exterior ones (n,), of two cells (2, n)).

    The latter are edges of different pieces that meet at an angle of no fold. No beams stiffen
    either.
    """
    edges, first, count = neighbours(compat.cell_entities(part.mesh.dolfinx, 1))
    for name in part.stiffeners:
        count[np.isin(edges, part.mesh.groups[name][1])] = 0
    pairs = first[:, count == 2]
    number = pieces.number[pairs // EDGES]
    flat = angles(edge_normals(part), pairs) < FOLD
    return first[0, count == 1], pairs[:, (number[0] != number[1]) & flat]


def _side(
    part: MeshedStructure, pieces: SmoothPieces, found: SheetRecovery, places: IntArray
) -> _Side:
    """Gauss's points of edges, in the order of the numbers of the corners."""
    cells, edges = places // EDGES, places % EDGES
    ends = np.array(ENDS)[edges]
    nodes = compat.geometry_nodes(part.mesh.dolfinx)[cells[:, None], ends]
    ends = np.take_along_axis(ends, np.argsort(nodes, axis=1), axis=1)
    corners = part.mesh.geometry.corners[ends]  # (edges, ends, 2)
    along = np.repeat(corners[:, 1] - corners[:, 0], len(POINTS), axis=0)
    X = np.repeat(corners[:, 0], len(POINTS), axis=0) + np.tile(POINTS, len(cells))[:, None] * along
    where = np.repeat(cells, len(POINTS))
    at = PointsInCells(part, np.zeros((0, 0)), where, X)
    tangent = np.einsum("pcd,pd->pc", at.J, along)
    length = np.linalg.norm(tangent, axis=1)
    tangent /= length[:, None]
    frame = pieces.axes.frame(at)
    c, s = (np.einsum("pc,pc->p", tangent, axis) for axis in (frame.e1, frame.e2))
    strains, D = found.at(where, X)
    moments = D[:, BENDING, MEMBRANE] @ strains[:, MEMBRANE]
    moments += D[:, BENDING, BENDING] @ strains[:, BENDING]
    # M_ns of M1, M2, M12, the normal being (s, -c)
    twist = np.stack([s * c, -s * c, s * s - c * c], axis=1)
    D66 = np.einsum("pa,pab,pb->p", twist, D[:, BENDING, BENDING], twist)
    t = np.stack([c, s], axis=1)
    S = np.einsum("pa,pab,pb->p", t, D[:, SHEAR, SHEAR], t)
    return _Side(
        n=frame.n,
        outward=np.cross(tangent, frame.n),
        m=np.einsum("pa,pak->pk", twist, moments),
        c=1 / np.sqrt(D66 * S),
        weights=np.tile(WEIGHTS, len(cells)) * length,
    )


def _free(part: MeshedStructure, places: IntArray, normal: Array) -> BoolArray:
    """Whether edges at these places may turn about their normals (n, 3)."""
    form, cells = part.form, places // EDGES
    held = np.zeros(normal.shape, dtype=bool)
    for axis, name in enumerate(("rx", "ry", "rz")):
        dofs = compat.cell_dofs(form.space, form.components[name], cells)
        # two nodes of a cubic triangle lie on each edge between its corners, in the edges' order
        inside = 3 + 2 * (places % EDGES)
        held[:, axis] = np.isin(dofs[np.arange(len(cells)), inside], part.fixed)
    return np.asarray(np.any(~held & (np.abs(normal) > ALONG), axis=1))


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
