"""What thin layers along edges of plates and shells hold that a mesh does not resolve.

Where an edge is free to turn about its normal, its twisting moment m vanishes, but it does so over
a length of the order of the thickness only: farther inside, and in a mesh of larger cells, it is
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
from antiosc.fem.error.sheet_strains import BENDING, MEMBRANE, SHEAR, SheetRecovery
from antiosc.fem.error.smooth_pieces import (
    EDGES,
    ENDS,
    FOLD,
    SmoothPieces,
    angles,
    edge_normals,
    neighbours,
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
