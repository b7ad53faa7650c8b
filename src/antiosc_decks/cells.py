"""Cells of a deck, with the entities that its supports fix and the nodes of its joints."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from antiosc.io.conversion import (
    HEXAHEDRON_DIAGONALS,
    Block,
    Deck,
    IntArray,
    NodeTable,
    PairTable,
    counts_text,
    mesh_of_deck,
)
from antiosc.io.neutral import (
    CORNERS,
    DIMENSION,
    EDGES,
    FACES,
    FileMesh,
    fixed_group_name,
    quadrilateral_faces,
)


def file_mesh_of(deck: Deck) -> FileMesh:
    """The elements of a deck as cells, its sets as groups, with its model."""
    model = deck.model
    if model is None:
        mesh, nodes, kinds = mesh_of_deck(deck)
    else:
        mixed = bool(model.get("mixed"))
        mesh, nodes, kinds = mesh_of_deck(deck, halve_lines=bool(model["halve"]), mixed=mixed)
    mesh.model = model

    # supports; but in an assembly cells of lower dimension are sides of the first
    is_assembly = bool(model and model["joined"])
    for label, shape, blocks in kinds[: None if is_assembly else 1] if deck.fixed else ():
        entities = FixedEntities(shape, mesh.cells[label], blocks, nodes)
        mark = fixed_group_name("", label) if is_assembly else ""
        mesh.fixed |= {name + mark: entities.fixed_by(rows) for name, rows in deck.fixed.items()}

    # new nodes beside those that joints hold
    if is_assembly and model:
        joints = model["joints"]
        dependent = {terms[0][0] for terms in joints["equations"] if terms[0][0] >= 0}
        joints["among"] = _means_among(nodes, np.array(sorted(dependent), dtype=np.int64))

    if deck.skipped:
        gone = sum(deck.skipped.values())
        mesh.remarks.append(
            f"{deck.name} holds {deck.n_elements + gone} elements; {deck.n_elements} of them are "
            f"cells of the mesh, which leaves out {counts_text(deck.skipped)}."
        )
    return mesh


class FixedEntities:
    """The entities that a support on some nodes fixes.

    An edge is fixed if both ends (and its middle node) are fixed, a face if all its edges are. A
    diagonal along which a rectangle or a hexahedron is divided is not an edge of the deck: it is
    fixed if all nodes of the rectangle, or of the cell, are fixed.
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
            self._around = _nodes_around_diagonals(blocks, self.edges, len(nodes.points))

    def fixed_by(self, rows: IntArray) -> dict[int, IntArray]:
        """Entities by dimension, as vertices, that are fixed where the nodes `rows` are fixed."""
        by_dimension = {0: np.intersect1d(rows, self.corners)[:, None]}
        is_fixed = np.zeros(self.nodes.count + 1, dtype=bool)
        others = np.ones(len(self.nodes.points))
        others[rows] = 0.0
        is_fixed[:-1] = abs(self.nodes.weights) @ others == 0  # also new nodes that are means
        edges = is_fixed[self.edges].all(axis=2)
        if self.mids is not None:
            edges &= is_fixed[self.mids]
        else:
            is_fixed[-1] = True  # the entry of index -1, which stands for no node
            edges &= is_fixed[self._around].all(axis=2)
        dim = DIMENSION[self.shape]
        by_dimension[1] = self.edges[edges]
        if dim == 3:
            faces = [self._fixed_faces(face, edges) for face in FACES[self.shape]]
            by_dimension[2] = np.vstack(faces)
        if dim > 1:
            by_dimension[dim] = self.corners[edges.all(axis=1)]
        return {d: entities for d, entities in by_dimension.items() if len(entities)}

    def _fixed_faces(self, face: tuple[int, ...], edges: np.ndarray) -> IntArray:
        """Vertices of the faces at corners `face` of cells whose `edges` (a mask) are all fixed."""
        of_face = [k for k, edge in enumerate(EDGES[self.shape]) if set(edge) <= set(face)]
        return self.corners[edges[:, of_face].all(axis=1)][:, list(face)]


def _nodes_around_diagonals(blocks: Sequence[Block], edges: IntArray, n: int) -> IntArray:
    """Nodes (cells, edges, 8) that must all be fixed to fix a diagonal; -1: none.

    Edges of the deck have none. `edges`: pairs of nodes (cells, edges, 2); `n`: number of nodes.
    """
    deck_edges = PairTable(n)
    diagonals = PairTable(n)
    node_rows = [np.full((1, 8), -1, dtype=np.int64)]
    for block in blocks:
        ends = block.corners[:, np.array(EDGES[block.shape])].reshape(-1, 2)
        deck_edges.add(ends, np.ones(len(ends), dtype=np.int64))
        needs = [((f[k], f[k + 2]), f) for f in quadrilateral_faces(block.shape) for k in (0, 1)]
        if block.shape == "hexahedron":
            needs += [(pair, tuple(range(8))) for pair in HEXAHEDRON_DIAGONALS]
        for pair, required in needs:
            table = np.full((len(block), 8), -1, dtype=np.int64)
            table[:, : len(required)] = block.corners[:, list(required)]
            start = sum(map(len, node_rows))
            diagonals.add(block.corners[:, list(pair)], np.arange(start, start + len(block)))
            node_rows.append(table)
    flat = edges.reshape(-1, 2)
    row = np.where(deck_edges.find(flat) >= 0, 0, np.maximum(diagonals.find(flat), 0))
    return np.vstack(node_rows)[row].reshape(*edges.shape[:2], 8)


def _means_among(table: NodeTable, nodes: IntArray) -> list[tuple[int, list[tuple[int, float]]]]:
    """[(new node, [(node of the file, weight)])] of the nodes that the reader added as weighted
    means of nodes of the file, one of `nodes` at least among them."""
    count = len(table.points)
    held = np.isin(np.arange(count), nodes).astype(float)
    between = np.flatnonzero(abs(table.weights) @ held)
    between = between[between >= count]
    rows = table.weights[between]
    rows.eliminate_zeros()
    rows.sort_indices()
    parts = [slice(*ends) for ends in zip(rows.indptr[:-1], rows.indptr[1:], strict=True)]
    weighted = list(zip(rows.indices.tolist(), rows.data.tolist(), strict=True))
    return list(zip(between.tolist(), [weighted[part] for part in parts], strict=True))
