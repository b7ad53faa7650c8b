"""Conformity of a mesh: no overlapping cells, and no adjacent cells without common nodes.

A nonconforming mesh runs and represents another part: overlapping cells double the mass, and cells
that touch without common nodes form a crack. Only vertices are checked, not curved sides.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np
from scipy.sparse import csr_matrix
from scipy.spatial import cKDTree

from antiosc.base._types import Array
from antiosc.io.neutral import FACETS, CellKind, IntArray
from antiosc.io.reading import keys

#: A point this close to a face, over the size of the face, lies on it.
ON = 1e-3
#: Barycentric coordinates above this are inside.
INSIDE_FACE = 1e-3
#: Gram determinant of a simplex over that of its edges at right angles, below which it is flat.
FLAT = 1e-12
#: Weights of the vertices of a cell or a face that give a point on no line of symmetry.
_ASKEW = {2: (0.59, 0.41), 3: (0.46, 0.31, 0.23), 4: (0.37, 0.29, 0.21, 0.13)}
#: Simplices that make up a cell or a face.
_SIMPLICES: dict[str, list[tuple[int, ...]]] = {
    "quadrilateral": [(0, 1, 2), (0, 2, 3)],
    "hexahedron": [
        *((0, 1, 2, 6), (0, 2, 3, 6), (0, 3, 7, 6)),
        *((0, 7, 4, 6), (0, 4, 5, 6), (0, 5, 1, 6)),
    ],
}
_PAIRS = 200_000


def repeated(cells: IntArray) -> IntArray:
    """Cells (n, vertices) that have the same vertices as one before them."""
    order = np.argsort(keys(cells), kind="stable")
    alike = np.sort(cells[order], axis=1)
    return np.sort(order[1:][(alike[1:] == alike[:-1]).all(axis=1)])


def crowded(cells: IntArray, kind: CellKind) -> IntArray:
    """Cells (n, vertices) that fill their space and share a facet with more than one other."""
    facets, owner = _facets(cells, kind)
    _, label, count = np.unique(keys(facets), return_inverse=True, return_counts=True)
    return np.unique(owner[count[label.reshape(-1)] > 2])


def doublets(cells: IntArray, kind: CellKind) -> IntArray:
    """Cells (n, vertices) that have more than one facet in common with another cell."""
    facets, owner = _facets(cells, kind)
    _, label = np.unique(keys(facets), return_inverse=True)
    shape = len(cells), int(label.max(initial=-1)) + 1
    has = csr_matrix((np.ones(len(owner), dtype=np.int32), (owner, label.reshape(-1))), shape=shape)
    common = (has @ has.T).tocoo()
    return np.unique(common.row[(common.data > 1) & (common.row != common.col)])


def unlike_middles(cells: IntArray, between: Sequence[tuple[list[int], int]]) -> IntArray:
    """Cells (n, nodes) with a node inside a side that is not the one that other cells have there.

    It may be a corner of another cell, lie in another side too, or have a copy in its place.
    `between`: (vertices of an edge, face or cell, node inside it).
    """
    if not len(cells):
        return np.zeros(0, dtype=np.int64)
    side = np.concatenate([keys(cells[:, vertices]) for vertices, _ in between])
    node = np.concatenate([cells[:, inside] for _, inside in between])
    corners = np.unique(cells[:, sorted({v for vertices, _ in between for v in vertices})])
    wrong = np.isin(node, corners)
    for one, other in ((side, node), (node, side)):
        order = np.lexsort((other, one))
        apart = (one[order][1:] == one[order][:-1]) & (other[order][1:] != other[order][:-1])
        wrong[order[1:][apart]] = True
    return np.unique(np.flatnonzero(wrong) % len(cells))


def overlapping(points: Array, cells: IntArray, kind: CellKind) -> IntArray:
    """Cells (n, vertices) that overlap, at least one of each two.

    In their space: facets whose two cells lie on one side of it, and outer facets inside a cell.
    On a sheet or a line in space: cells on which another lies.
    """
    if kind.dim < points.shape[1]:
        askew = _askew(points, cells)
        on, cell = _on_sides(points, cells, kind.shape, askew)
        return np.unique(on[on != cell])
    facets, owner = _facets(cells, kind)
    first, second, outer = _matched(facets)
    a, b = (_beyond(points, facets[first], cells[owner[k]]) for k in (first, second))
    folded = owner[first][a * b > 0]
    askew = _askew(points, facets[outer])
    found = [folded]
    for simplex in _SIMPLICES.get(kind.shape, [tuple(range(kind.vertices))]):
        corners = points[cells[:, list(simplex)]]
        for at, cell in _near(askew, corners):
            other = owner[outer[at]] != cell
            at, cell = at[other], cell[other]
            inside = _barycentric(corners[cell], askew[at])[0].min(axis=1) > INSIDE_FACE
            found.append(owner[outer[at[inside]]])
    return np.unique(np.concatenate(found))


def unjoined(points: Array, cells: IntArray, kind: CellKind) -> IntArray:
    """Nodes on a side of which they are not a vertex: cracks and hanging nodes.

    Of cells (n, vertices) that fill their space: outer nodes on outer facets; of sheets and lines:
    nodes at free edges and ends on cells.
    """
    facets, _ = _facets(cells, kind)
    _, _, outer = _matched(facets)
    nodes = np.unique(facets[outer])
    shape = kind.shape
    sides = cells
    if kind.dim == points.shape[1]:
        sides = facets[outer]
        shape = {2: "interval", 3: "triangle", 4: "quadrilateral"}[sides.shape[1]]
    at, side = _on_sides(points, sides, shape, points[nodes])
    foreign = (sides[side] != nodes[at][:, None]).all(axis=1)
    return np.unique(nodes[at[foreign]])


# --- Facets ---------------------------------------------------------------------------------------


def _facets(cells: IntArray, kind: CellKind) -> tuple[IntArray, IntArray]:
    """All facets (n, vertices) of all cells, and the cell of each."""
    sides = FACETS[kind.shape]
    facets = np.stack([cells[:, list(s)] for s in sides], axis=1)
    return facets.reshape(-1, facets.shape[2]), np.repeat(np.arange(len(cells)), len(sides))


def _matched(facets: IntArray) -> tuple[IntArray, IntArray, IntArray]:
    """(one, the other) of two facets that are the same, and those that no other is the same as."""
    code = keys(facets)
    order = np.argsort(code, kind="stable")
    same = code[order][1:] == code[order][:-1]
    alone = np.ones(len(facets), dtype=bool)
    alone[order[1:][same]] = alone[order[:-1][same]] = False
    return order[:-1][same], order[1:][same], np.flatnonzero(alone)


def _beyond(points: Array, facets: IntArray, cells: IntArray) -> Array:
    """On which side of each facet its cell lies: a number with that sign."""
    x = points[facets]
    if points.shape[1] == 2:
        along = x[:, 1] - x[:, 0]
        normal = np.column_stack([along[:, 1], -along[:, 0]])
    else:  # of a quadrilateral by its diagonals
        normal = np.cross(x[:, 2] - x[:, 0], x[:, -1] - x[:, 1])
    return np.einsum("ni,ni->n", points[cells].mean(axis=1) - x.mean(axis=1), normal)


def _askew(points: Array, rows: IntArray) -> Array:
    """A point inside each cell or face that is not on a line of symmetry."""
    weights = np.array(_ASKEW[rows.shape[1]])
    return np.einsum("k,nki->ni", weights, points[rows])


# --- Points on and in simplices -------------------------------------------------------------------


def _on_sides(points: Array, sides: IntArray, shape: str, x: Array) -> tuple[IntArray, IntArray]:
    """Pairs (point of x, side) where the point lies on the side."""
    found = []
    for simplex in _SIMPLICES.get(shape, [tuple(range(sides.shape[1]))]):
        corners = points[sides[:, list(simplex)]]
        for at, side in _near(x, corners):
            b, off = _barycentric(corners[side], x[at])
            size = np.linalg.norm(np.ptp(corners[side], axis=1), axis=1)
            on = (b.min(axis=1) > -ON) & (off <= ON * size)
            found.append(np.stack([at[on], side[on]]))
    pairs = np.unique(np.concatenate([np.zeros((2, 0), dtype=np.int64), *found], axis=1), axis=1)
    return pairs[0], pairs[1]


def _near(x: Array, corners: Array) -> Iterator[tuple[IntArray, IntArray]]:
    """Blocks of pairs (point, simplex) such that the point is in the ball around the simplex."""
    centres = corners.mean(axis=1)
    radii = np.linalg.norm(corners - centres[:, None], axis=2).max(axis=1) * (1 + ON)
    if not len(x) or not len(radii):
        return
    tree = cKDTree(x)
    octave = np.floor(np.log2(radii)).astype(int)
    for o in np.unique(octave):
        members = np.flatnonzero(octave == o)
        for start in range(0, len(members), _PAIRS):
            some = members[start : start + _PAIRS]
            pairs = tree.sparse_distance_matrix(
                cKDTree(centres[some]), float(radii[some].max()), output_type="ndarray"
            )
            close = pairs["v"] <= radii[some[pairs["j"]]]
            at, simplex = pairs["i"][close], some[pairs["j"][close]]
            for block in range(0, len(at), _PAIRS):
                yield at[block : block + _PAIRS], simplex[block : block + _PAIRS]


def _barycentric(corners: Array, x: Array) -> tuple[Array, Array]:
    """Barycentric coordinates (n, d + 1) of the points' feet on simplices, and distances off.

    Simplices without measure, as halves of quadrilaterals with an angle of 180°, hold no point.
    """
    edges = corners[:, 1:] - corners[:, :1]
    gram = edges @ edges.swapaxes(1, 2)
    sides = np.prod(np.einsum("ndd->nd", gram), axis=1)
    flat = np.linalg.det(gram) <= FLAT * sides
    gram[flat] = np.eye(gram.shape[1])
    to = x - corners[:, 0]
    rest = np.linalg.solve(gram, np.einsum("ndi,ni->nd", edges, to)[:, :, None])[:, :, 0]
    off = np.linalg.norm(to - np.einsum("nd,ndi->ni", rest, edges), axis=1)
    off[flat] = np.inf
    rest[flat] = -1.0
    return np.column_stack([1 - rest.sum(axis=1), rest]), off
