"""Edges, faces and cells that a support on some nodes of a deck also fixes.

The elements here can have more degrees of freedom than those of the deck. A support must therefore
fix the entities between its nodes too: an edge if both ends (and its middle node) are fixed, a face
if all its edges are. A diagonal along which a rectangle or a hexahedron is divided is not an edge
of the deck: it is fixed if all nodes of the rectangle, or of the cell, are fixed.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from antiosc.io.deck import Block
from antiosc.io.neutral import IntArray
from antiosc.io.node_table import NodeTable, PairTable
from antiosc.io.shapes import CORNERS, DIMENSION, EDGES, FACES, rectangles

#: Corners at the ends of the diagonals of a hexahedron.
DIAGONALS = ((0, 6), (1, 7), (2, 4), (3, 5))


class FixedEntities:
    """The cells of highest dimension, their faces and edges, as sets of nodes."""

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


def fixed_with(
    entities: FixedEntities, sets: Mapping[str, IntArray]
) -> dict[str, dict[int, IntArray]]:
    """The entities that are fixed with each of some sets of nodes."""
    return {name: entities.of(rows) for name, rows in sets.items()}
