"""Nodes in the middle of edges, diagonals and faces: those of the file, and new ones where needed.

Cells that share an edge, a diagonal or a face share the node in its middle. The elements here can
have more degrees of freedom than those of a deck: a support on some nodes therefore also fixes the
entities between them (`FixedEntities`).
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from antiosc.base._types import Array
from antiosc.io.deck import Block
from antiosc.io.neutral import IntArray
from antiosc.io.shapes import CORNERS, DIMENSION, EDGES, FACES, rectangles

#: Most nodes between which a new one lies: those of a hexahedron.
MOST_AROUND = 20
#: Nodes around a middle -> (corners of them, weight of a corner, weight of the middle of an edge):
#: those of an edge, of a face and of a hexahedron.
WEIGHTS = {2: (2, 0.5, 0.0), 8: (4, -0.25, 0.5), 20: (8, -0.25, 0.25)}


class NodeTable:
    """The points of a mesh, and which of them are middle nodes of which pairs."""

    def __init__(self, points: Array) -> None:
        self.points = points
        self._more: list[Array] = []
        self.count = len(points)
        #: sorted keys of pairs, and the node between each
        self._pairs = PairTable(len(points))
        #: sorted keys of pairs, and the row in `_placed` of their middle nodes
        self._places = PairTable(len(points))
        self._placed: list[Array] = []
        #: nodes between which each place and each new node lies, -1 where there are fewer
        self._around: list[IntArray] = []
        self._parents: list[IntArray] = []
        self._n_placed = 0
        self._faces: dict[bytes, int] = {}

    def all_points(self) -> Array:
        """Coordinates of all nodes, the new ones after those of the file."""
        return np.vstack([self.points, *self._more])

    def new(self, points: Array, parents: IntArray) -> IntArray:
        """New nodes at these points, between their `parents` (n, k)."""
        self._more.append(points)
        self._parents.append(parents)
        self.count += len(points)
        return np.arange(self.count - len(points), self.count)

    def give(self, ends: IntArray, nodes: IntArray) -> None:
        """`nodes` (n,) of the file lie between `ends` (n, 2)."""
        self._pairs.add(ends, nodes)

    def place(self, ends: IntArray, points: Array, around: IntArray) -> None:
        """Nodes between `ends` (n, 2), if needed, lie at `points`, among the nodes `around`."""
        self._placed.append(points)
        self._around.append(_padded(around))
        self._places.add(ends, np.arange(self._n_placed, self._n_placed + len(points)))
        self._n_placed += len(points)

    def points_between(self, ends: IntArray) -> Array:
        """Coordinates (…, 3) of the middle nodes of `ends` (…, 2)."""
        flat = ends.reshape(-1, 2)
        x = self.points[flat].mean(axis=1)
        row = self._places.find(flat)
        if (row >= 0).any():
            x[row >= 0] = np.vstack(self._placed)[row[row >= 0]]
        node = self._pairs.find(flat)
        # a new node lies at its given place, otherwise halfway
        known = (node >= 0) & (node < len(self.points))
        x[known] = self.points[node[known]]
        return x.reshape(*ends.shape[:-1], 3)

    def between(self, ends: IntArray) -> IntArray:
        """Nodes (…,) between `ends` (…, 2), which are created where they do not exist."""
        flat = ends.reshape(-1, 2)
        missing = flat[self._pairs.find(flat) < 0]
        if len(missing):
            once = np.unique(np.sort(missing, axis=1), axis=0)
            self._pairs.add(once, self.new(self.points_between(once), self._among(once)))
        return self._pairs.find(flat).reshape(ends.shape[:-1])

    def _among(self, ends: IntArray) -> IntArray:
        around, row = _padded(ends), self._places.find(ends)
        if (row >= 0).any():
            around[row >= 0] = np.vstack(self._around)[row[row >= 0]]
        return around

    def of_face(self, corners: IntArray, points: Array, around: IntArray) -> IntArray:
        """Nodes (n,) inside faces with these corners (n, 4), at `points` if they are new."""
        ordered = np.ascontiguousarray(np.sort(corners, axis=1))
        _, first, which = np.unique(ordered, axis=0, return_index=True, return_inverse=True)
        keys = [ordered[k].tobytes() for k in first]
        missing = np.array([key not in self._faces for key in keys], dtype=bool)
        made = self.new(points[first[missing]], _padded(around[first[missing]]))
        for k, node in zip(np.flatnonzero(missing), made, strict=True):
            self._faces[keys[k]] = int(node)
        nodes = np.array([self._faces[key] for key in keys], dtype=np.int64)
        return nodes[np.ravel(which)]

    def grown(self, nodes: IntArray) -> IntArray:
        """`nodes` of the file, and the new nodes that lie only between these."""
        inside = np.zeros(self.count + 1, dtype=bool)
        inside[nodes] = True
        inside[-1] = True  # the entry of index -1, which stands for no node
        start = len(self.points)
        for parents in self._parents:
            inside[start : start + len(parents)] = inside[parents].all(axis=1)
            start += len(parents)
        return np.flatnonzero(inside[:-1])

    def near(self, nodes: IntArray) -> list[tuple[int, list[tuple[int, float]]]]:
        """New nodes among some of the file, each with the nodes of the file and their weights.

        Weights are those of the serendipity functions in the middle of an edge, a face or a cell.
        """
        some = np.zeros(self.count + 1, dtype=bool)
        some[nodes] = True
        some[-1] = False  # the entry of index -1, which stands for no node
        if not self._parents:
            return []
        parents = np.vstack([_padded(block) for block in self._parents])
        start = len(self.points)
        return [
            (start + int(k), sorted(self._weights(parents, start + int(k)).items()))
            for k in np.flatnonzero(some[parents].any(axis=1))
        ]

    def _weights(self, parents: IntArray, node: int) -> dict[int, float]:
        """Weights of the nodes of the file; its ends replace a new middle node."""
        start = len(self.points)
        if node < start:
            return {node: 1.0}
        row = parents[node - start]
        row = row[row >= 0]
        corners, of_corner, of_middle = WEIGHTS[len(row)]
        result: dict[int, float] = {}
        for k, parent in enumerate(row):
            weight = of_corner if k < corners else of_middle
            for one, share in self._weights(parents, int(parent)).items():
                result[one] = result.get(one, 0.0) + weight * share
        return {one: weight for one, weight in result.items() if weight}


def _padded(nodes: IntArray) -> IntArray:
    """Rows of equal width."""
    result = np.full((len(nodes), MOST_AROUND), -1, dtype=np.int64)
    result[:, : nodes.shape[1]] = nodes
    return result


class PairTable:
    """Numbers by unordered pairs of nodes; a pair keeps the first number that it gets."""

    def __init__(self, n: int) -> None:
        self._n = max(n, 1)
        self._keys = np.zeros(0, dtype=np.int64)
        self._values = np.zeros(0, dtype=np.int64)

    def _key(self, ends: IntArray) -> IntArray:
        low, high = ends.min(axis=1), ends.max(axis=1)
        return np.asarray(low * self._n + high)

    def add(self, ends: IntArray, values: IntArray) -> None:
        """Set the numbers of pairs (n, 2)."""
        keys = np.concatenate([self._keys, self._key(ends)])
        self._keys, first = np.unique(keys, return_index=True)
        self._values = np.concatenate([self._values, values])[first]

    def find(self, ends: IntArray) -> IntArray:
        """Numbers of pairs (n, 2), -1 where there is none."""
        if not len(self._keys) or not len(ends):
            return np.full(len(ends), -1, dtype=np.int64)
        key = self._key(ends)
        place = np.minimum(np.searchsorted(self._keys, key), len(self._keys) - 1)
        return np.where(self._keys[place] == key, self._values[place], -1)


# --- Supports -------------------------------------------------------------------------------------


#: Corners at the ends of the diagonals of a hexahedron.
DIAGONALS = ((0, 6), (1, 7), (2, 4), (3, 5))


class FixedEntities:
    """The entities that a support on some nodes fixes.

    An edge if both ends (and its middle node) are fixed, a face if all its edges are. A diagonal
    along which a rectangle or a hexahedron is divided is not an edge of the deck: it is fixed if
    all nodes of the rectangle, or of the cell, are fixed.
    """

    def __init__(
        self, shape: str, cells: IntArray, blocks: Sequence[Block], nodes: NodeTable
    ) -> None:
        self.shape = shape
        self.corners = cells[:, : CORNERS[shape]]
        self.nodes = nodes
        count = len(EDGES[shape])
        mids = cells[:, CORNERS[shape] : CORNERS[shape] + count]
        self.mids = mids if mids.shape[1] == count else None
        self.edges = self.corners[:, np.array(EDGES[shape])]
        if self.mids is None:
            self._around = _around_diagonals(blocks, self.edges, len(nodes.points))

    def of(self, rows: IntArray) -> dict[int, IntArray]:
        """{dimension: entities by their vertices} that are fixed if the nodes `rows` are."""
        found = {0: np.intersect1d(rows, self.corners)[:, None]}
        marked = np.zeros(self.nodes.count + 1, dtype=bool)
        marked[self.nodes.grown(rows)] = True
        edges = marked[self.edges].all(axis=2)
        if self.mids is not None:
            edges &= marked[self.mids]
        else:
            marked[-1] = True  # the entry of index -1, which stands for no node
            edges &= marked[self._around].all(axis=2)
        dim = DIMENSION[self.shape]
        found[1] = self.edges[edges]
        if dim == 3:
            found[2] = np.vstack([self._faces(face, edges) for face in FACES[self.shape]])
        if dim > 1:
            found[dim] = self.corners[edges.all(axis=1)]
        return {d: entities for d, entities in found.items() if len(entities)}

    def _faces(self, face: tuple[int, ...], edges: np.ndarray) -> IntArray:
        own = [k for k, edge in enumerate(EDGES[self.shape]) if set(edge) <= set(face)]
        return self.corners[edges[:, own].all(axis=1)][:, list(face)]


def _around_diagonals(blocks: Sequence[Block], edges: IntArray, n: int) -> IntArray:
    """Nodes (cells, edges, 8) that must be fixed for a diagonal; -1 for edges of the deck."""
    real, diagonals = PairTable(n), PairTable(n)
    around = [np.full((1, 8), -1, dtype=np.int64)]
    for block in blocks:
        ends = block.corners[:, np.array(EDGES[block.shape])].reshape(-1, 2)
        real.add(ends, np.ones(len(ends), dtype=np.int64))
        needs = [((f[k], f[k + 2]), f) for f in rectangles(block.shape) for k in (0, 1)]
        if block.shape == "hexahedron":
            needs += [(pair, tuple(range(8))) for pair in DIAGONALS]
        for pair, among in needs:
            table = np.full((len(block), 8), -1, dtype=np.int64)
            table[:, : len(among)] = block.corners[:, list(among)]
            start = sum(map(len, around))
            diagonals.add(block.corners[:, list(pair)], np.arange(start, start + len(block)))
            around.append(table)
    flat = edges.reshape(-1, 2)
    row = np.where(real.find(flat) >= 0, 0, np.maximum(diagonals.find(flat), 0))
    return np.vstack(around)[row].reshape(*edges.shape[:2], 8)
