"""The skin of cells: outer faces; sharp inner edges of a solid, where an elastic stress has no
limit.

In a corner of more than 180° the stress grows as r^-0.46 at 270° (M. L. Williams, J. Appl. Mech. 19
(1952) 526); the value on a mesh grows with every refinement. A fillet has a limit: its curved faces
are tangent, and are told from an edge by the directions of the quadratic faces.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from antiosc.base._types import Array, IntArray

#: Interior angle in degrees from which an edge is sharp; straight fillets of three cells have 210.
SHARP = 215.0
#: Corners of the outward faces of cells in VTK's order of nodes; of sheets the cells themselves.
FACES: dict[str, list[list[int]]] = {
    "triangle": [[0, 1, 2]],
    "quad": [[0, 1, 2, 3]],
    "tetra": [[0, 2, 1], [0, 1, 3], [1, 2, 3], [0, 3, 2]],
    "hexahedron": [
        *([0, 3, 2, 1], [4, 5, 6, 7], [0, 1, 5, 4]),
        *([1, 2, 6, 5], [2, 3, 7, 6], [3, 0, 4, 7]),
    ],
}
SOLIDS = ("tetra", "hexahedron")
#: Middle nodes of the edges of a quadratic tetrahedron, in VTK's order.
MIDDLES = {(0, 1): 4, (1, 2): 5, (0, 2): 6, (0, 3): 7, (1, 3): 8, (2, 3): 9}


def without_unused(
    blocks: Sequence[tuple[str, IntArray]],
) -> tuple[IntArray, list[tuple[str, IntArray]]]:
    """(numbers of the nodes that cells have, these cells with nodes numbered among them)."""
    used = np.unique(np.concatenate([cells.ravel() for _, cells in blocks]))
    return used, [(kind, np.searchsorted(used, cells)) for kind, cells in blocks]


def outer_faces(blocks: Sequence[tuple[str, IntArray]]) -> IntArray:
    """(F, 3 or 4) corners of the outer faces; (F, 2) of lines, (F, 1) of nodes alone."""
    faces = [_outer(kind.rstrip("0123456789"), cells) for kind, cells in blocks]
    most = max(f.shape[1] for f in faces)
    visible = [f for f in faces if f.shape[1] >= min(most, 3)]
    if len({f.shape[1] for f in visible}) > 1:  # quadrilaterals as triangles
        visible = [
            np.vstack([f[:, [0, 1, 2]], f[:, [0, 2, 3]]]) if f.shape[1] == 4 else f for f in visible
        ]
    return np.vstack(visible)


def _outer(kind: str, cells: IntArray) -> IntArray:
    """Corners of the faces that belong to only one cell, for cells of one kind."""
    if kind not in FACES:
        return cells[:, : 2 if kind == "line" else 1]
    faces = np.vstack([cells[:, face] for face in FACES[kind]])
    return faces[_once(faces)] if kind in SOLIDS else faces


def _once(faces: IntArray) -> IntArray:
    """Numbers of the faces that no other has the corners of."""
    _, first, count = np.unique(
        np.sort(faces, axis=1), axis=0, return_index=True, return_counts=True
    )
    return np.asarray(first[count == 1])


class Skin(NamedTuple):
    """The outer faces of a solid by their edges (E,); an edge between two faces has two rows.

    `ends` (E, 2): nodes; `across` (E, 3): direction from the middle of the edge into the face;
    `inward` (E, 3): from there to the middle of the cell.
    """

    ends: IntArray
    across: Array
    inward: Array


def sharp_points(points: Array, cells: Sequence[tuple[str, IntArray]], spacing: float) -> Array:
    """Points (n, 3) along the sharp inner edges of solids, at most `spacing` [m] apart."""
    # each rank has its own copy of the nodes that it shares
    points, number = np.unique(points, axis=0, return_inverse=True)
    found = [np.zeros((0, 3))]
    for kind, nodes in cells:
        name = kind.rstrip("0123456789")
        if name not in SOLIDS:
            continue
        sharp = _sharp(points, _skin(points, name, number.ravel()[nodes]))
        start, end = np.moveaxis(points[sharp], 1, 0)
        longest = np.linalg.norm(end - start, axis=1).max(initial=0.0)
        share = np.linspace(0.0, 1.0, 2 + int(longest / spacing))[:, None, None]
        found.append(np.unique((start + (end - start) * share).reshape(-1, 3), axis=0))
    return np.concatenate(found)


def _skin(points: Array, kind: str, cells: IntArray) -> Skin:
    """The outer faces of cells of one kind."""
    faces = np.concatenate([cells[:, face] for face in FACES[kind]])
    outer = _once(faces)
    number, cell = np.divmod(outer, len(cells))
    centres = points[cells[cell]].mean(axis=1)

    ends, across, inward = [], [], []
    size = faces.shape[1]
    for k, local in enumerate(FACES[kind]):
        rows = np.flatnonzero(number == k)
        nodes = cells[cell[rows]]
        for i in range(size):
            edge = local[i], local[(i + 1) % size]
            others = [c for c in local if c not in edge]
            start = _middle(points, nodes, edge)
            ends.append(np.sort(nodes[:, list(edge)], axis=1))
            across.append(_across(points, nodes, edge, others))
            inward.append(centres[rows] - start)
    return Skin(np.concatenate(ends), np.concatenate(across), np.concatenate(inward))


def _middle(points: Array, nodes: IntArray, edge: tuple[int, int]) -> Array:
    """Middles (n, 3) of an edge of cells: their middle nodes if they have them."""
    pair = (min(edge), max(edge))
    if nodes.shape[1] == 10:
        return points[nodes[:, MIDDLES[pair]]]
    return points[nodes[:, list(pair)]].mean(axis=1)


def _across(points: Array, nodes: IntArray, edge: tuple[int, int], others: list[int]) -> Array:
    """Derivatives (n, 3) of the place in a face, from the middle of an edge away from it."""
    a, b = (points[nodes[:, end]] for end in edge)
    if len(others) == 2:
        return points[nodes[:, others]].mean(axis=1) - (a + b) / 2

    c = points[nodes[:, others[0]]]
    ab, bc, ca = (
        _middle(points, nodes, pair) for pair in (edge, (edge[1], others[0]), (others[0], edge[0]))
    )
    return 2 * (bc + ca - ab) - c - (a + b) / 2


def _sharp(points: Array, skin: Skin) -> IntArray:
    """Nodes (E, 2) of the edges whose two faces stand at more than `SHARP` inside the solid."""
    order = np.lexsort(skin.ends.T)
    ends = skin.ends[order]
    starts = np.flatnonzero(np.append(True, (np.diff(ends, axis=0) != 0).any(axis=1)))
    starts = starts[np.diff(np.append(starts, len(ends))) == 2]
    one, other = order[starts], order[starts + 1]

    along = points[skin.ends[one, 1]] - points[skin.ends[one, 0]]
    along /= np.linalg.norm(along, axis=1, keepdims=True)
    first, second, inner = (
        rows - np.einsum("ei,ei->e", rows, along)[:, None] * along
        for rows in (skin.across[one], skin.across[other], skin.inward[one])
    )
    first /= np.linalg.norm(first, axis=1, keepdims=True)
    inner -= np.einsum("ei,ei->e", inner, first)[:, None] * first
    inner /= np.linalg.norm(inner, axis=1, keepdims=True)

    sine, cosine = np.einsum("ei,ei->e", second, inner), np.einsum("ei,ei->e", second, first)
    angle = np.degrees(np.arctan2(sine, cosine)) % 360.0
    return skin.ends[one[angle > SHARP]]
