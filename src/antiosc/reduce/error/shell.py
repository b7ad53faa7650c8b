"""Errors of the strains of shells, by recovery.

The strains of each shape, the interpolated shear strains among them, are projected (L2, consistent
mass matrix) to continuous functions of degree two, their own degree, on each smooth piece of the
surface. The difference e_j of the recovered and the discontinuous strain estimates the error; the
layers along free edges, which neither of them shows, are added.

This is only a part of the error of a flexibility. With the exact section forces σ and the strains
s_h = ε(u_h) + d_h of the element, where d_h is the change of the shear strains by interpolation,

    σ:C⁻¹:σ - σ_h:C⁻¹:σ_h = |σ - σ_h|² + 2 ∫ (σ:s_h - σ_h:s_h) = |σ - σ_h|² + 2 ∫ Q·d_h,

for σ and σ_h are in equilibrium with one load: with the displacements ε(u_h) and with the strains
s_h. The first term is the energy of the error; the second one, which vanishes in elements without
interpolation, may have either sign, and can make a coarse mesh softer than the part. The recovered
shear forces approximate Q. Likewise E_ij = ∫ e_i:C:e_j and the misfit ∫ Q_i·d_j + Q_j·d_i for the
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

The strains are those of the stiffness matrix, with the interpolated shear strain
(`antiosc.fem.elements.shell`); its change by the interpolation is stored too.

A piece ends at folds, where three cells or more meet, at stiffeners, and where the section of the
sheet changes: there the section forces jump, so that no continuous function fits them. Strains are
compared in axes that turn with the surface: over a piece they follow one coordinate axis, or those
of the layers.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
import scipy.sparse
import scipy.sparse.linalg
from scipy.sparse.csgraph import connected_components

from antiosc.base._types import Array, BoolArray, IntArray
from antiosc.base.errors import InputError
from antiosc.fem.elements.weak_form import CORNERS_IN_TURN
from antiosc.fem.platform import compat
from antiosc.fem.structure.meshed import MeshedStructure
from antiosc.fem.structure.structure import Structure
from antiosc.models.anti_oscillators import AntiOscillators
from antiosc.recovery.tensors import PointsInCells, SheetAxes, gauss_points
from antiosc.reduce.error.scheme import Estimate, StrainErrors, shapes_of
from antiosc.reduce.site import Functional

#: Angle in degrees between neighbouring cells from which on there is a fold.
FOLD = 20.0
#: Angle in degrees above which the cells approximate a curved surface.
FLAT = 0.2
#: Edges of a triangle, and their corners.
EDGES = 3
ENDS = [[1, 2], [0, 2], [0, 1]]
#: Cosine between an axis and a normal from which they are near one another.
NEAR = 0.95


@dataclass(frozen=True)
class SmoothPieces:
    """Smooth pieces of the surface of a structure, on one rank.

    Attributes
    ----------
    number : (cells,) number of the piece of each cell.
    axes : axes and normals of the cells, which turn continuously over each piece.
    bent : largest angle between neighbouring cells of a piece [degree].
    """

    number: IntArray
    axes: SheetAxes
    bent: float


def smooth_pieces(part: MeshedStructure) -> SmoothPieces:
    """Division of the cells into smooth pieces of the surface; InputError for a one-sided
    surface.
    """
    mesh = part.mesh
    count = compat.cell_map(mesh.dolfinx).size_local
    corners = compat.geometry_nodes(mesh.dolfinx)[:, CORNERS_IN_TURN[mesh.cell]]
    cell_edges = compat.cell_entities(mesh.dolfinx, 1)
    edge_ends = compat.entity_vertices(mesh.dolfinx, 1)
    material_number = part.part_of_cells()
    axes = SheetAxes(part)
    normals = edge_normals(part)
    edges, places, cells = neighbours(cell_edges)
    edges = edges[cells == 2]
    places = places[:, cells == 2]
    pairs = places // EDGES
    angle = angles(normals, places)
    smooth = (material_number[pairs[0]] == material_number[pairs[1]]) & (angle < FOLD)
    fold_angles = angles(_tangents(np.repeat(axes.axis, EDGES, axis=0), normals), places)
    smooth &= ~axes.given[pairs[0]] | (fold_angles < FOLD)
    for name in part.stiffeners:
        smooth &= ~np.isin(edges, mesh.groups[name][1])
    ends = edge_ends[edges[smooth]]
    a, b = pairs[:, smooth]
    opposite = _is_forward(corners[a], ends) == _is_forward(corners[b], ends)
    number = _connected(count, a, b)
    side = _sides(number, a, b, opposite, mesh.name)
    # layers have a side of their own, which turns with the surface, or the piece ends there
    layered = np.array([material.section.has_sides for material, _ in part.parts])[material_number]
    number = 2 * number + (layered & (side != axes.side))
    axes.side = np.where(layered, axes.side, side)
    best, no_axis = _axis_of_pieces(number, np.abs(normals).reshape(count, EDGES, 3).max(axis=1))
    free = ~axes.given
    axes.axis = np.where(free[:, None], np.eye(3)[best], axes.axis)
    axes.given[:] = True
    return SmoothPieces(
        3 * number + np.where(free & no_axis, best, 0), axes, _largest(angle[smooth])
    )


def edge_normals(part: MeshedStructure) -> Array:
    """Unit normals (cells · 3, 3) at the middles of the edges of all triangles."""
    geometry = part.mesh.geometry
    slopes = geometry.slopes(geometry.corners[ENDS].mean(axis=1))
    J = np.swapaxes(geometry.nodes, 1, 2)[:, None] @ slopes
    normals = np.cross(J[..., 0], J[..., 1]).reshape(-1, 3)
    return np.asarray(normals / np.linalg.norm(normals, axis=1, keepdims=True))


def neighbours(cell_edges: IntArray) -> tuple[IntArray, IntArray, IntArray]:
    """(edge (n,), indices (2, n) of two uses of each edge by cells, number (n,) of cells at the
    edge).

    The indices are those in the flattened `cell_edges`; an edge of a single cell has its index
    twice.
    """
    edge = cell_edges.ravel()
    order = np.argsort(edge, kind="stable")
    edges, first, count = np.unique(edge[order], return_index=True, return_counts=True)
    return edges, order[np.stack([first, first + (count > 1)])], count


def _tangents(axis: Array, normals: Array) -> Array:
    """Unit vectors (n, 3) along axes projected on the surface."""
    projected = axis - np.einsum("ni,ni->n", axis, normals)[:, None] * normals
    return np.asarray(projected / np.linalg.norm(projected, axis=1, keepdims=True))


def angles(vectors: Array, places: IntArray) -> Array:
    """Angles (edges,) in degrees, up to 90, between unit vectors (n, 3) with indices (2, edges)."""
    first, second = vectors[places]
    cosine = np.abs(np.einsum("ec,ec->e", first, second))
    sine = np.linalg.norm(np.cross(first, second), axis=1)
    return np.asarray(np.degrees(np.arctan2(sine, cosine)))


def _largest(values: Array) -> float:
    """The largest value; 0 if there is none."""
    return float(values.max(initial=0.0))


def _is_forward(corners: IntArray, ends: IntArray) -> BoolArray:
    """Mask (cells,): whether a cell traverses an edge from its first end to its second."""
    corner = np.argmax(corners == ends[:, :1], axis=1)
    next_corner = (corner + 1) % corners.shape[1]
    return np.asarray(corners[np.arange(len(corner)), next_corner] == ends[:, 1])


def _sides(number: IntArray, a: IntArray, b: IntArray, turned: BoolArray, name: str) -> Array:
    """±1 (cells,): the sign by which a cell's normal points to the same side of its piece.

    `turned`: mask of the neighbours a and b whose normals are opposite.
    """
    count = len(number)
    # each cell twice: with its normal, and with the opposite one
    same_sign = np.where(turned, b + count, b)
    opposite_sign = np.where(turned, b, b + count)
    sides = _connected(2 * count, np.append(a, a + count), np.append(same_sign, opposite_sign))
    if np.any(sides[:count] == sides[count:]):
        raise InputError(
            f"the error 'estimate' needs surfaces with two sides, and {name} has one that turns "
            "over (a Moebius strip)."
        )
    first = np.unique(number, return_index=True)[1]
    return np.where(sides[:count] == sides[first][number], 1.0, -1.0)


def _connected(count: int, a: IntArray, b: IntArray) -> IntArray:
    """Number of the connected component of each of `count` nodes; edges run from a to b."""
    graph = scipy.sparse.coo_matrix((np.ones(len(a)), (a, b)), shape=(count, count))
    return np.asarray(connected_components(graph, directed=False)[1])


def _axis_of_pieces(number: IntArray, along: Array) -> tuple[IntArray, BoolArray]:
    """(coordinate axis (cells,) from which a cell's directions are measured, mask of cells without
    one).

    It is the axis at the largest angle to all normals of the cell's piece. If every axis is near to
    some normal of the piece, the cells have no common one: each gets the axis farthest from its own
    normal. `along` (cells, 3): cosines between the axes and the normals of a cell.
    """
    axis_cosines = np.zeros((int(number.max()) + 1, 3))
    np.maximum.at(axis_cosines, number, along)
    best = np.argmin(axis_cosines, axis=1)
    no_axis = (axis_cosines.min(axis=1) > NEAR)[number]
    return np.where(no_axis, np.argmin(along, axis=1), best[number]), no_axis


#: Quadrature degree of the squares of strains, which are quadratic.
RULE_DEGREE = 4
#: Number of strains: (ε1, ε2, γ12), (κ1, κ2, 2κ12), (γ13, γ23), drilling.
STRAINS = 9
MEMBRANE = slice(0, 3)
BENDING = slice(3, 6)
SHEAR = slice(6, 8)
DRILLING = 8


class SheetStrains(NamedTuple):
    """Strains of some cells at all quadrature points (P,), in the axes of the cell's plane."""

    #: (P, 9, k)
    own: Array
    #: interpolated shear strains minus those of the displacements and rotations (P, 2, k)
    gap: Array
    #: (P,) m²
    weights: Array


class StrainsOfSheets:
    """Evaluates strains of blocks of shapes (rows of this rank, k), on one rank."""

    def __init__(self, part: MeshedStructure, shapes: Array, pieces: SmoothPieces) -> None:
        self._part = part
        self._axes = pieces.axes
        self._shapes = compat.with_ghosts(part.form.space, shapes)
        self.X, self._weights = compat.quadrature(part.mesh.cell, RULE_DEGREE)
        space = part.form.space
        path = part.form.components["rx"]
        self._values = compat.tabulate(space, path, self.X)
        slopes = compat.tabulate_slopes(space, path, self.X)
        self._slopes = np.swapaxes(slopes, 1, 2).reshape(2 * len(self.X), -1)
        # the field whose components along two reference directions b are interpolated, as values of
        # its interpolant along a: (points, a, b) from the functions
        on_edges = compat.tabulate(space, path, compat.edge_points())
        interpolation = compat.edge_interpolation(self.X) @ on_edges
        self._interpolation = interpolation.reshape(4 * len(self.X), -1)
        middles = [material.section.middle for material, _ in part.parts]
        self._middle = np.array(middles)[part.part_of_cells()]

    def at(self, cells: IntArray) -> SheetStrains:
        """The strains at all points of `cells`."""
        points = len(self.X)
        k = self._shapes.shape[1]
        cell_of_point = np.repeat(cells, points)
        located = PointsInCells(
            self._part, self._shapes, cell_of_point, np.tile(self.X, (len(cells), 1))
        )
        frame = self._axes.frame(located)
        axes = np.stack(frame, axis=1)
        metric = np.linalg.inv(np.swapaxes(located.J, 1, 2) @ located.J)
        gradients = (
            metric @ np.swapaxes(located.J, 1, 2) @ np.swapaxes(axes[:, :2], 1, 2)
        )  # (P, d, axis)
        u = self._dofs(cells, "xyz")
        rotations = self._dofs(cells, ("rx", "ry", "rz"))

        def slopes(dofs: Array, axes: Array) -> Array:
            """Derivatives (P, axes, 2, k), along e1 and e2, of the components along the axes."""
            derivatives = (self._slopes @ dofs).reshape(len(cell_of_point), 2, 3 * k)
            derivatives = (np.swapaxes(gradients, 1, 2) @ derivatives).reshape(
                len(cell_of_point), 2, 3, k
            )
            derivatives = axes @ np.swapaxes(derivatives, 1, 2).reshape(
                len(cell_of_point), 3, 2 * k
            )
            return np.asarray(derivatives.reshape(len(cell_of_point), -1, 2, k))

        du = slopes(u, axes)
        dr = slopes(rotations, axes[:, :2])
        theta = axes @ (self._values @ rotations).reshape(len(cell_of_point), 3, k)
        # (θ×n) along e1 and e2, and interpolated: θ×n along a reference direction is θ·(n × J)
        leaning = np.stack([theta[:, 1], -theta[:, 0]], axis=1)
        rotated_tangents = np.cross(frame.n[:, None], np.swapaxes(located.J, 1, 2))
        interpolated = (self._interpolation @ rotations).reshape(len(cell_of_point), 2, 6, k)
        interpolated = (rotated_tangents.reshape(-1, 1, 1, 6) @ interpolated)[:, :, 0]
        gap = np.swapaxes(gradients, 1, 2) @ interpolated - leaning
        strains = np.empty((len(cell_of_point), STRAINS, k))
        strains[:, 0] = du[:, 0, 0]
        strains[:, 1] = du[:, 1, 1]
        strains[:, 2] = du[:, 0, 1] + du[:, 1, 0]
        strains[:, 3] = dr[:, 1, 0]
        strains[:, 4] = -dr[:, 0, 1]
        strains[:, 5] = dr[:, 1, 1] - dr[:, 0, 0]
        strains[:, SHEAR] = du[:, 2] + leaning + gap
        strains[:, DRILLING] = (du[:, 1, 0] - du[:, 0, 1]) / 2 - theta[:, 2]
        strains[:, DRILLING] -= self._middle[cell_of_point, None] * (dr[:, 0, 0] + dr[:, 1, 1]) / 2
        area = np.linalg.norm(np.cross(located.J[:, :, 0], located.J[:, :, 1]), axis=1)
        return SheetStrains(strains, gap, area * np.tile(self._weights, len(cells)))

    def _dofs(self, cells: IntArray, names: str | tuple[str, ...]) -> Array:
        """Values (cells, functions, components · k) of the named dofs of the shapes."""
        form = self._part.form
        numbers = [compat.cell_dofs(form.space, form.components[name], cells) for name in names]
        dofs = np.stack([self._shapes[of_component] for of_component in numbers], axis=2)
        return dofs.reshape(*dofs.shape[:2], -1)


#: Numbers of the strains of a block of cells.
BLOCK_NUMBERS = 1_000_000
#: Degree of the recovered strains.
DEGREE = 2


class StrainBlock(NamedTuple):
    """A block of cells: their strains, and recovered strains (P, 9, k), at all quadrature
    points.
    """

    cells: slice
    strains: SheetStrains
    recovered: Array
    #: section forces of unit strains (P, 9, 9)
    D: Array


class SheetRecovery:
    """The L2 projection (consistent mass) of the strains of shapes (rows, k), piece by piece."""

    def __init__(self, part: MeshedStructure, shapes: Array, pieces: SmoothPieces) -> None:
        self._part = part
        self.count = shapes.shape[1]
        self._strains = strains = StrainsOfSheets(part, shapes, pieces)
        self._space = compat.lagrange(part.mesh.dolfinx, DEGREE, 0)
        all_cells = np.arange(compat.cell_map(part.mesh.dolfinx).size_local)
        dofs = compat.cell_dofs(self._space, (0,), all_cells).astype(np.int64)
        # a function of its own for each piece
        corner_nodes, dofs = np.unique(
            pieces.number[:, None] * (dofs.max() + 1) + dofs, return_inverse=True
        )
        self._dofs = dofs.reshape(len(all_cells), -1)
        table = compat.tabulate(self._space, (), strains.X)
        self._points = len(strains.X)
        width = max(1, BLOCK_NUMBERS // (STRAINS * self._points * self.count))
        # the strains of all blocks may not fit the memory: they are taken anew
        self._blocks: list[tuple[slice, scipy.sparse.csr_matrix]] = []
        mass = scipy.sparse.csc_matrix((len(corner_nodes), len(corner_nodes)))
        loads = np.zeros((len(corner_nodes), STRAINS * self.count))
        for first in range(0, len(all_cells), width):
            block = slice(first, min(first + width, len(all_cells)))
            strains_here = strains.at(all_cells[block])
            rows = len(strains_here.weights)
            columns = np.repeat(self._dofs[block], self._points, axis=0)
            values = np.tile(table, (rows // self._points, 1))
            starts = np.arange(rows + 1) * columns.shape[1]
            incidence = scipy.sparse.csr_matrix(
                (values.ravel(), columns.ravel(), starts), shape=(rows, len(corner_nodes))
            )
            self._blocks.append((block, incidence))
            weighted = incidence.T @ scipy.sparse.diags(strains_here.weights)
            mass = mass + weighted @ incidence
            loads += weighted @ strains_here.own.reshape(rows, -1)
        options = {"permc_spec": "MMD_AT_PLUS_A", "options": {"SymmetricMode": True}}
        solver = scipy.sparse.linalg.splu(scipy.sparse.csc_matrix(mass), **options)
        loaded_columns = np.flatnonzero(loads.any(axis=0))  # a plate that bends is not stretched
        self._values = np.zeros_like(loads)
        self._values[:, loaded_columns] = solver.solve(loads[:, loaded_columns])
        self._D = section_forces(part)

    def blocks(self) -> Iterator[StrainBlock]:
        """All cells, in blocks."""
        number = self._part.part_of_cells()
        positions = np.arange(len(number))
        for block, block_points in self._blocks:
            strains = self._strains.at(positions[block])
            recovered = (block_points @ self._values).reshape(strains.own.shape)
            yield StrainBlock(
                block, strains, recovered, self._D[np.repeat(number[block], self._points)]
            )

    def at(self, cells: IntArray, X: Array) -> tuple[Array, Array]:
        """(recovered strains (P, 9, k), D (P, 9, 9)) at X (P, 2) in cells (P,)."""
        table = compat.tabulate(self._space, (), X)
        values = self._values[self._dofs[cells]]
        values_at = np.einsum("pf,pfc->pc", table, values).reshape(len(cells), STRAINS, self.count)
        return values_at, self._D[self._part.part_of_cells()[cells]]


def section_forces(part: MeshedStructure) -> Array:
    """Section forces of unit strains (parts, 9, 9), in the axes of each sheet."""
    D = np.zeros((len(part.parts), STRAINS, STRAINS))
    for stiffness, (material, _) in zip(D, part.parts, strict=True):
        s = material.section
        stiffness[MEMBRANE, MEMBRANE] = s.A
        stiffness[SHEAR, SHEAR] = s.S
        stiffness[MEMBRANE, BENDING] = s.B
        stiffness[BENDING, MEMBRANE] = s.B.T
        stiffness[BENDING, BENDING] = s.bending + s.B.T @ np.linalg.solve(s.A, s.B)
        stiffness[DRILLING, DRILLING] = s.drilling
    return D


#: Gauss points of an edge, and their weights.
POINTS = gauss_points(3)
WEIGHTS = np.polynomial.legendre.leggauss(3)[1] / 2  # of these points
#: Component of the normal of an edge below which it is taken for 0.
ALONG = 1e-6


class _Side(NamedTuple):
    """Gauss points on edges, as points of one of the two cells at each edge."""

    #: normals of the sheet (P, 3), and of the edges (P, 3)
    n: Array
    outward: Array
    #: twisting moments (P, k) and flexibility ℓ/D66 (P,)
    m: Array
    c: Array
    #: (P,) m
    weights: Array


class Layers(NamedTuple):
    """Boundary layers along edges of a sheet, at Gauss points of the edges."""

    #: moments that vanish in the layers (P, k)
    m: Array
    #: their flexibility times length, 1/N
    weights: Array
    #: (P,) in which they lie
    cells: IntArray

    def energies(self) -> Array:
        """∮ m_i m_j ℓ/D66 (k, k)."""
        return np.asarray(self.m.T @ (self.weights[:, None] * self.m))


def layers_of(part: MeshedStructure, pieces: SmoothPieces, recovery: SheetRecovery) -> Layers:
    """The layers along all free edges, and along changes of section."""
    exterior, changes = _edges(part, pieces)
    m = [np.zeros((0, recovery.count))]
    weights = [np.zeros(0)]
    if exterior.size:
        side = _side(part, pieces, recovery, exterior)
        free = np.repeat(_free(part, exterior, side.outward[:: len(POINTS)]), len(POINTS))
        m.append(side.m)
        weights.append(free * side.weights * side.c)
    if changes.size:
        side, other_side = (_side(part, pieces, recovery, places) for places in changes)
        same_side = np.sign(np.einsum("pc,pc->p", side.n, other_side.n))
        m.append(side.m - same_side[:, None] * other_side.m)
        weights.append(side.weights * side.c * other_side.c / (side.c + other_side.c))
    cells = np.append(exterior, changes[:1]) // EDGES
    return Layers(np.vstack(m), np.concatenate(weights), np.repeat(cells, len(POINTS)))


def _edges(part: MeshedStructure, pieces: SmoothPieces) -> tuple[IntArray, IntArray]:
    """(uses of exterior edges (n,), pairs of uses (2, n) of edges between two smooth pieces).

    The latter are edges at which two pieces meet without a fold. Edges that beams stiffen are in
    neither.
    """
    edges, first, count = neighbours(compat.cell_entities(part.mesh.dolfinx, 1))
    for name in part.stiffeners:
        count[np.isin(edges, part.mesh.groups[name][1])] = 0
    pairs = first[:, count == 2]
    number = pieces.number[pairs // EDGES]
    flat = angles(edge_normals(part), pairs) < FOLD
    return first[0, count == 1], pairs[:, (number[0] != number[1]) & flat]


def _side(
    part: MeshedStructure, pieces: SmoothPieces, recovery: SheetRecovery, places: IntArray
) -> _Side:
    """Gauss points of edges, in the order of the numbers of their corners."""
    cells = places // EDGES
    edges = places % EDGES
    ends = np.array(ENDS)[edges]
    nodes = compat.geometry_nodes(part.mesh.dolfinx)[cells[:, None], ends]
    ends = np.take_along_axis(ends, np.argsort(nodes, axis=1), axis=1)
    corners = part.mesh.geometry.corners[ends]  # (edges, ends, 2)
    edge = np.repeat(corners[:, 1] - corners[:, 0], len(POINTS), axis=0)
    X = np.repeat(corners[:, 0], len(POINTS), axis=0) + np.tile(POINTS, len(cells))[:, None] * edge
    cell_of_point = np.repeat(cells, len(POINTS))
    points = PointsInCells(part, np.zeros((0, 0)), cell_of_point, X)
    tangent = np.einsum("pcd,pd->pc", points.J, edge)
    length = np.linalg.norm(tangent, axis=1)
    tangent /= length[:, None]
    frame = pieces.axes.frame(points)
    c, s = (np.einsum("pc,pc->p", tangent, axis) for axis in (frame.e1, frame.e2))
    strains, D = recovery.at(cell_of_point, X)
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
    """Mask of edges that may rotate about their normals (n, 3)."""
    form = part.form
    cells = places // EDGES
    fixed = np.zeros(normal.shape, dtype=bool)
    for axis, name in enumerate(("rx", "ry", "rz")):
        dofs = compat.cell_dofs(form.space, form.components[name], cells)
        # two nodes of a cubic triangle lie on each edge between its corners, in the edges' order
        inner_dofs = 3 + 2 * (places % EDGES)
        fixed[:, axis] = np.isin(dofs[np.arange(len(cells)), inner_dofs], part.fixed)
    return np.asarray(np.any(~fixed & (np.abs(normal) > ALONG), axis=1))


#: Message of what looks for the cells with the largest errors.
TRIANGLES = (
    "the errors of single cells are recovered of shells of triangles: the strains of quadrilaterals"
    " are most accurate where {} takes them, and their recovery finds a half to a fifth of the"
    " error."
)


class ShellErrors(StrainErrors):
    """Estimator for shells of triangles, on one rank."""

    def __init__(self, part: MeshedStructure) -> None:
        if part.comm.size > 1:
            raise InputError("the error 'estimate' of shells runs on one rank.")
        if part.mesh.cell != "triangle":
            raise InputError(TRIANGLES.format(part.mesh.name))
        super().__init__(part)
        self._pieces = smooth_pieces(part)

    def prepare(self) -> None:
        self.not_included = self.faceted

    def estimate(self, structure: Structure, model: AntiOscillators, site: Functional) -> Estimate:
        shapes = shapes_of(model)
        energies, misfit = self.gram_and_misfit(shapes)
        return Estimate(energies + self.of_state(structure, shapes, energies), misfit)

    @property
    def faceted(self) -> str:
        """A warning if flat cells approximate a curved surface; otherwise empty."""
        if self.part.mesh.order > 1 or self._pieces.bent < FLAT:
            return ""
        return (
            f"Not included: the flat cells of {self.part.mesh.name}, which meet at angles of up "
            f"to {self._pieces.bent:.2g}°, for a curved surface; cells of order 2 have it curved."
        )

    def gram_and_misfit(self, shapes: Array) -> tuple[Array, Array]:
        """(E_ij = ∫ e_i:C:e_j, F_ij = ∫ Q_i·d_j + Q_j·d_i), both (k, k), of errors e and shear
        misfits d.
        """
        recovery = SheetRecovery(self.part, shapes, self._pieces)
        E = layers_of(self.part, self._pieces, recovery).energies()
        work = np.zeros_like(E)
        for block in recovery.blocks():
            strains = block.strains
            recovered = block.recovered
            gap = recovered - strains.own
            E += _products(gap, block.D, gap, strains.weights)
            S = block.D[:, SHEAR, SHEAR]
            work += _products(recovered[:, SHEAR], S, strains.gap, strains.weights)
        return (E + E.T) / 2, work + work.T

    def gram(self, shapes: Array) -> Array:
        """E_ij = ∫ e_i:C:e_j (k, k)."""
        return self.gram_and_misfit(shapes)[0]

    def of_cells(self, shapes: Array) -> Array:
        """Σ_j ∫ e_j:C:e_j over each cell (cells,)."""
        recovery = SheetRecovery(self.part, shapes, self._pieces)
        layers = layers_of(self.part, self._pieces, recovery)
        line_weights = layers.weights * (layers.m**2).sum(axis=1)
        count = compat.cell_map(self.part.mesh.dolfinx).size_local
        energies = np.asarray(np.bincount(layers.cells, line_weights, minlength=count), dtype=float)
        for block in recovery.blocks():
            gap = block.recovered - block.strains.own
            at_points = np.einsum("pik,pik->p", gap, block.D @ gap) * block.strains.weights
            energies_here = energies[block.cells]
            energies_here += at_points.reshape(len(energies_here), -1).sum(axis=1)
        return energies


def _products(a: Array, D: Array, b: Array, weights: Array) -> Array:
    """∫ a_i:D:b_j (k, k) of fields (P, m, k)."""
    forces = (D * weights[:, None, None]) @ b
    return np.asarray(a.reshape(-1, a.shape[2]).T @ forces.reshape(-1, b.shape[2]))
