"""Directions and sizes of a deck's elements."""

from __future__ import annotations

import numpy as np

from antiosc.base._types import BoolArray
from antiosc.io.deck import Array, Deck, IntArray

#: "places" and "directions" there, both (n, 3).
Everywhere = dict[str, list[list[float]]]
#: Cosine from which a direction is that of an axis.
AXIS_COSINE = 1 - 1e-9
#: Corners of a cell as those of a hexahedron or a quadrilateral, some of them twice or more.
FULL = {
    "triangle": (0, 1, 2, 2),
    "tetra": (0, 1, 2, 2, 3, 3, 3, 3),
    "pyramid": (0, 1, 2, 3, 4, 4, 4, 4),
    "wedge": (0, 1, 2, 2, 3, 4, 5, 5),
}


def corners_of(deck: Deck, elements: IntArray) -> list[Array]:
    """Coordinates (k, 3) of the corners of each element."""
    return [x for block, _ in deck.blocks_of(elements) for x in deck.points[block.corners]]


def _unit(v: Array) -> Array:
    length = np.linalg.norm(v, axis=1, keepdims=True)
    return np.asarray(v / np.where(length > 0, length, 1.0))


def tangents_of(deck: Deck, elements: IntArray) -> Array:
    """Unit vectors (n, 3) along lines, from their first node to their last."""
    return _unit(np.array([x[1] - x[0] for x in corners_of(deck, elements)]).reshape(-1, 3))


def normals_of(deck: Deck, elements: IntArray) -> Array:
    """Unit normals (n, 3) of triangles and quadrilaterals, by the order of their corners."""
    found = np.zeros((len(elements), 3))
    for block, mine in deck.blocks_of(elements):
        x = deck.points[block.corners]
        found[mine] = np.cross(x[:, 2] - x[:, 0], x[:, -1] - x[:, 1])
    return _unit(found)


def measures_of(deck: Deck, elements: IntArray) -> Array:
    """Lengths, areas or volumes of elements with straight edges."""
    found = np.zeros(len(elements))
    for block, mine in deck.blocks_of(elements):
        corners = FULL.get(block.shape, range(block.corners.shape[1]))
        found[mine] = _measure(deck.points[block.corners[:, list(corners)]])
    return found


def _measure(x: Array) -> Array:
    """Of lines, quadrilaterals or hexahedra x (n, corners, 3), by two Gauss points a direction."""
    dim = x.shape[1].bit_length() - 1
    total = np.zeros(len(x))
    signs = np.array([[-1, -1, -1], [1, -1, -1], [1, 1, -1], [-1, 1, -1]])
    signs = np.vstack([signs, signs * [1, 1, -1]])[: x.shape[1], :dim]
    for point in np.ndindex(*[2] * dim):
        values = (1 + signs * (2 * np.array(point) - 1) / np.sqrt(3)) / 2
        slopes = [
            np.prod(np.delete(values, k, axis=1), axis=1) * signs[:, k] / 2 for k in range(dim)
        ]
        J = np.einsum("kc,nci->nki", np.array(slopes), x)
        total += np.sqrt(np.linalg.det(J @ np.swapaxes(J, 1, 2)).clip(min=0.0))
    return total


def common_direction(vectors: Array, least: float = 0.3) -> Array | None:
    """The mean unit vector if every one has at least this cosine with it, else None."""
    mean = vectors.mean(axis=0)
    length = float(np.linalg.norm(mean))
    if length == 0 or (vectors @ (mean / length)).min() < least:
        return None
    return np.asarray(mean / length)


def curved(deck: Deck, elements: IntArray) -> bool:
    """Whether the normals of some shells differ."""
    return common_direction(normals_of(deck, elements), least=1 - 1e-6) is None


def everywhere(deck: Deck, elements: IntArray, vectors: Array, length: float) -> Everywhere:
    """Vectors at the middles of elements, and of the triangles into which they are cut, in m."""
    places, directions = [], []
    for x, vector in zip(corners_of(deck, elements), vectors.tolist(), strict=True):
        thirds = range(4) if len(x) == 4 else ()
        cut = [x.mean(axis=0), *(np.delete(x, k, axis=0).mean(axis=0) for k in thirds)]
        places += [(c * length).tolist() for c in cut]
        directions += [vector] * len(cut)
    return {"places": places, "directions": directions}


def top_of(deck: Deck, elements: IntArray, length: float) -> Everywhere | list[float]:
    """The side of the normals of shells: one direction, or one in each element."""
    normals = normals_of(deck, elements)
    top = common_direction(normals)
    return everywhere(deck, elements, normals, length) if top is None else top.tolist()


def side_of(deck: Deck, elements: IntArray, length: float) -> dict[str, Everywhere]:
    """The side of the normals, as an argument, of shells that no one direction is above."""
    top = top_of(deck, elements, length)
    return {"top": top} if isinstance(top, dict) else {}


def fixed_along_axes(fixed: BoolArray, frame: Array) -> BoolArray | None:
    """The motions along x, y and z (3,) that are fixed with those along the rows of `frame`.

    None where they are not a set of these: one or two directions askew to the axes.
    """
    if fixed.all() or not fixed.any():
        return fixed
    cosines = np.abs(frame)
    for some, value in ((fixed, True), (~fixed, False)):  # second: a plane between two axes
        if (cosines[some].max(axis=1) > AXIS_COSINE).all():
            result = np.full(3, not value)
            result[cosines[some].argmax(axis=1)] = value
            return result
    return None
