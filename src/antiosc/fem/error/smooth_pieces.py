"""The smooth pieces of a surface of cells, and one side of each.

A piece ends at folds, where three cells or more meet, at stiffeners, and where the section of the
sheet changes: there section forces jump, and no continuous function stands for them. Strains are
compared in axes that turn with the surface: over a piece they follow one coordinate axis, or those
of the layers.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import scipy.sparse
from scipy.sparse.csgraph import connected_components

from antiosc.base._types import Array, BoolArray, IntArray
from antiosc.base.errors import InputError
from antiosc.fem.elements.material_axes import CORNERS_IN_TURN
from antiosc.fem.platform import compat
from antiosc.fem.recovery.sheet import SheetAxes
from antiosc.fem.structure.meshed import MeshedStructure

#: Angles in degrees between neighbouring cells: from FOLD on the surface has a fold there; above
#: FLAT the cells stand for a curved surface.
FOLD, FLAT = 20.0, 0.2
#: Edges of a triangle, and their corners.
EDGES, ENDS = 3, [[1, 2], [0, 2], [0, 1]]
#: Cosine between an axis and a normal from which they are near one another.
NEAR = 0.95


@dataclass(frozen=True)
class SmoothPieces:
    """Pieces of the surface of a structure on one rank.

    Attributes
    ----------
    number : (cells,) of the piece that a cell belongs to.
    axes : axes and normals of the cells, which turn continuously over each piece.
    bent : largest angle between neighbouring cells of one piece [degree].
    """

    number: IntArray
    axes: SheetAxes
    bent: float


def smooth_pieces(part: MeshedStructure) -> SmoothPieces:
    """The pieces; InputError for a surface with one side only."""
    mesh = part.mesh
    count = compat.cell_map(mesh.dolfinx).size_local
    corners = compat.geometry_nodes(mesh.dolfinx)[:, CORNERS_IN_TURN[mesh.cell]]
    normals = edge_normals(part)
    edges, places, cells = neighbours(compat.cell_entities(mesh.dolfinx, 1))
    edges, places = edges[cells == 2], places[:, cells == 2]
    pairs = places // EDGES
    angle = angles(normals, places)
    own = part.part_of_cells()
    axes = SheetAxes(part)
    smooth = (own[pairs[0]] == own[pairs[1]]) & (angle < FOLD)
    turn = angles(_tangents(np.repeat(axes.axis, EDGES, axis=0), normals), places)
    smooth &= ~axes.given[pairs[0]] | (turn < FOLD)
    for name in part.stiffeners:
        smooth &= ~np.isin(edges, mesh.groups[name][1])
    ends = compat.entity_vertices(mesh.dolfinx, 1)[edges[smooth]]
    a, b = pairs[:, smooth]
    turned = _ahead(corners[a], ends) == _ahead(corners[b], ends)
    number = _connected(count, a, b)
    side = _sides(number, a, b, turned, mesh.name)
    # layers have a side of their own, which turns with the surface, or the piece ends there
    layered = np.array([material.section.has_sides for material, _ in part.parts])[own]
    number = 2 * number + (layered & (side != axes.side))
    axes.side[:] = np.where(layered, axes.side, side)
    best, cut = _axis_of_pieces(number, np.abs(normals).reshape(count, EDGES, 3).max(axis=1))
    free = ~axes.given
    axes.axis[free], axes.given[:] = np.eye(3)[best[free]], True
    return SmoothPieces(3 * number + np.where(free & cut, best, 0), axes, _largest(angle[smooth]))


def edge_normals(part: MeshedStructure) -> Array:
    """Unit normals (cells · 3, 3) at the middles of the edges of all triangles."""
    geometry = part.mesh.geometry
    slopes = geometry.slopes(geometry.corners[ENDS].mean(axis=1))
    J = np.swapaxes(geometry.nodes, 1, 2)[:, None] @ slopes
    normals = np.cross(J[..., 0], J[..., 1]).reshape(-1, 3)
    return np.asarray(normals / np.linalg.norm(normals, axis=1, keepdims=True))


def neighbours(cell_edges: IntArray) -> tuple[IntArray, IntArray, IntArray]:
    """(edges (n,), the places of two of their cells (2, n), number of all of them (n,)).

    Places are among the edges of all cells in turn, those of an edge of one cell twice.
    """
    edge = cell_edges.ravel()
    order = np.argsort(edge, kind="stable")
    edges, first, count = np.unique(edge[order], return_index=True, return_counts=True)
    return edges, order[np.stack([first, first + (count > 1)])], count


def _tangents(axis: Array, normals: Array) -> Array:
    """Unit vectors (n, 3): the axes along the surface."""
    along = axis - np.einsum("ni,ni->n", axis, normals)[:, None] * normals
    return np.asarray(along / np.linalg.norm(along, axis=1, keepdims=True))


def angles(vectors: Array, places: IntArray) -> Array:
    """Angles in degrees (edges,), up to 90, between unit vectors (n, 3) at places (2, edges)."""
    one, other = vectors[places]
    cosine = np.abs(np.einsum("ec,ec->e", one, other))
    sine = np.linalg.norm(np.cross(one, other), axis=1)
    return np.asarray(np.degrees(np.arctan2(sine, cosine)))


def _largest(values: Array) -> float:
    return float(values.max(initial=0.0))


def _ahead(corners: IntArray, ends: IntArray) -> BoolArray:
    """Whether cells with these corners around them go along an edge from its first end."""
    at = np.argmax(corners == ends[:, :1], axis=1)
    after = (at + 1) % corners.shape[1]
    return np.asarray(corners[np.arange(len(at)), after] == ends[:, 1])


def _sides(number: IntArray, a: IntArray, b: IntArray, turned: BoolArray, name: str) -> Array:
    """±1 (cells,): the sign with which a cell's normal points to the same side of its piece.

    `turned` says of neighbours a and b whether their normals are opposite.
    """
    count = len(number)
    # each cell twice: with its normal, and with the opposite one
    ahead, back = np.where(turned, b + count, b), np.where(turned, b, b + count)
    sides = _connected(2 * count, np.append(a, a + count), np.append(ahead, back))
    if np.any(sides[:count] == sides[count:]):
        raise InputError(
            f"error='estimate' needs surfaces with two sides, and {name} has one that turns over "
            "(a Moebius strip): leave error=None."
        )
    first = np.unique(number, return_index=True)[1]
    return np.where(sides[:count] == sides[first][number], 1.0, -1.0)


def _connected(count: int, a: IntArray, b: IntArray) -> IntArray:
    """Number of the connected part of each of `count` nodes, which edges from a to b connect."""
    graph = scipy.sparse.coo_matrix((np.ones(len(a)), (a, b)), shape=(count, count))
    return np.asarray(connected_components(graph, directed=False)[1])


def _axis_of_pieces(number: IntArray, along: Array) -> tuple[IntArray, BoolArray]:
    """(the coordinate axis (cells,) farthest from all normals of the piece, cells where none is).

    Where each axis comes near to a normal of the piece, cells get the one farthest from their own.
    `along` (cells, 3): cosines between the axes and the normals of a cell.
    """
    near = np.zeros((int(number.max()) + 1, 3))
    np.maximum.at(near, number, along)
    best = np.argmin(near, axis=1)
    cut = (near.min(axis=1) > NEAR)[number]
    return np.where(cut, np.argmin(along, axis=1), best[number]), cut
