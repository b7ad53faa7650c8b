"""Pieces of a deck that nothing joins, and elements that repeat others node by node.

Of the pieces one is taken alone, or all where each is held. Copies, such as the skin and the
doubler of a shell, get nodes of their own, because a mesh holds every cell once; these nodes follow
those of the first: stiffness and mass add.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence

import numpy as np

from antiosc.base._types import Array, BoolArray
from antiosc.base.errors import MeshError
from antiosc.io.deck import Block, Deck, IntArray, listed

#: Roles of elements that are springs between other elements; rods alone are a truss.
SPRINGS = {"rod", "panel"}
#: Share of the largest eigenvalue below which no support resists a rigid motion; rounding: 1e-16.
UNHELD = 1e-10


def one_piece(deck: Deck, chosen: BoolArray) -> BoolArray:
    """Those of the chosen elements that nodes in common join to the piece `deck.piece` by size."""
    tables = [block.corners[chosen[own]] for block, own in deck.numbered()]
    label = connected(tables, len(deck.points))
    label = label[np.concatenate([block.corners[:, 0] for block in deck.blocks])]
    pieces, count = np.unique(label[chosen], return_counts=True)
    if not 1 <= (deck.piece or 0) <= len(pieces):
        raise MeshError(
            f"{deck.name} has {len(pieces)} pieces that share no node; there is no piece "
            f"{deck.piece}."
        )
    wanted = pieces[np.argsort(-count, kind="stable")][(deck.piece or 1) - 1]
    return np.asarray(chosen & (label == wanted))


def held_apart(
    deck: Deck,
    x: Array,
    moves: BoolArray,
    fixed: BoolArray,
    rows: Sequence[Sequence[tuple[int, int, float]]],
) -> tuple[int, bool]:
    """(pieces of the deck that nothing joins, whether they are several and each is held).

    `x` (n, 3): nodes of the deck and further points; `moves`, `fixed` (n, 6): the motions that they
    have, and those that supports hold; `rows`: sums of motions that constraints and springs resist.
    """
    tables = [np.hstack([block.corners, block.mids]) for block in deck.blocks]
    tables += [np.array([[node for node, _, _ in terms]]) for terms in rows if terms]
    acting = np.unique(np.concatenate([np.zeros(0, dtype=np.int64), *(t.ravel() for t in tables)]))
    acting = acting[acting >= 0]
    pieces = np.unique(connected(tables, len(x))[acting], return_inverse=True)[1]
    count = int(pieces.max(initial=0)) + 1
    if count < 2:
        return count, False
    piece = np.zeros(len(x), dtype=np.int64)
    piece[acting] = pieces
    centre = np.zeros((count, 3))
    np.add.at(centre, pieces, x[acting])
    r = x - (centre / np.bincount(pieces)[:, None])[piece]
    r /= max(float(np.ptp(x[acting], axis=0).max()), np.finfo(float).tiny)
    there = np.zeros(len(x), dtype=bool)
    there[acting] = True
    own = moves & there[:, None]
    moved, resisted = (_gram(one, r, piece, count) for one in (own, own & fixed))
    for terms in filter(None, rows):
        nodes, motions, c = (np.array(column) for column in zip(*terms, strict=True))
        row = (c / np.abs(c).max()) @ _motion(r[nodes], motions)
        resisted[piece[nodes[0]]] += np.outer(row, row)
    for against, motion in zip(resisted, moved, strict=True):
        values, vectors = np.linalg.eigh(against)
        free = vectors[:, values <= UNHELD * max(values[-1], 1.0)]
        if np.trace(free.T @ motion @ free) > UNHELD * np.trace(motion):
            return count, False
    return count, True


def _gram(which: BoolArray, r: Array, piece: IntArray, count: int) -> Array:
    """Sums of the squares of some motions (n, 6) in the rigid ones of each piece (count, 6, 6)."""
    nodes, motions = np.nonzero(which)
    result = np.zeros((count, 6, 6))
    rows = _motion(r[nodes], motions)
    np.add.at(result, piece[nodes], rows[:, :, None] * rows[:, None, :])
    return result


def _motion(r: Array, motions: IntArray) -> Array:
    """Motions (0 to 5) of nodes at r (n, 3) in six rigid motions (n, 6): θ × r beside shifts."""
    rows = np.eye(6)[motions]
    x, y, z = r.T
    none = np.zeros(len(r))
    turns = np.stack([[none, z, -y], [-z, none, x], [y, -x, none], *np.zeros((3, 3, len(r)))])
    rows[:, 3:] += turns[motions, :, np.arange(len(r))]
    return rows


def connected(tables: Iterable[IntArray], count: int) -> IntArray:
    """The number of the piece of each of `count` nodes; rows of tables (n, k) hold nodes together.

    Numbers below 0 are no nodes.
    """
    from scipy.sparse import coo_matrix  # few files need it, and it loads slowly
    from scipy.sparse.csgraph import connected_components

    some = [np.stack([np.repeat(t[:, 0], t.shape[1]), t.ravel()]) for t in tables]
    ends = np.hstack([np.zeros((2, 0), dtype=np.int64), *some])
    ends = ends[:, ends[1] >= 0]
    graph = coo_matrix((np.ones(ends.shape[1], dtype=np.int8), tuple(ends)), shape=(count, count))
    return np.asarray(connected_components(graph, directed=False)[1])


# --- Copies ---------------------------------------------------------------------------------------


def separate_copies(deck: Deck) -> list[tuple[int, int]]:
    """Give copies nodes of their own: (own node, node that it follows); they are told."""
    some = [block for block in deck.blocks if block.role not in SPRINGS] or deck.blocks
    made: dict[tuple[int, int], int] = {}
    copies: dict[str, int] = {}
    for block, ranks in zip(some, _ranks(some), strict=True):
        for element in np.flatnonzero(ranks):
            copies[block.type] = copies.get(block.type, 0) + 1
            for table in (block.corners, block.mids, block.inner):
                for k in np.flatnonzero(table[element] >= 0):
                    own = (int(table[element, k]), int(ranks[element]))
                    table[element, k] = made.setdefault(own, len(deck.points) + len(made))
    if made:
        deck.points = np.vstack([deck.points, deck.points[[node for node, _ in made]]])
        deck.told.append(
            f"{listed(copies)} of {deck.name} repeat other elements node by node: their "
            "stiffness and mass add to those of these."
        )
    return [(own, node) for (node, _), own in made.items()]


def _ranks(blocks: list[Block]) -> list[IntArray]:
    """How many elements before it each element of some blocks repeats.

    A triangle repeats the halves of a quadrilateral.
    """
    ranks = [np.zeros(len(block), dtype=np.int64) for block in blocks]
    for shape in {block.shape for block in blocks}:
        own = [k for k, block in enumerate(blocks) if block.shape == shape]
        tables = [blocks[k].corners for k in own]
        if shape == "triangle":
            quads = [block.corners for block in blocks if block.shape == "quad"]
            tables = [np.delete(quad, k, axis=1) for quad in quads for k in range(4)] + tables
        rows = np.sort(np.vstack(tables), axis=1)
        label = np.unique(rows, axis=0, return_inverse=True)[1].reshape(-1)
        order = np.argsort(label, kind="stable")
        rank = np.empty(len(rows), dtype=np.int64)
        rank[order] = np.arange(len(rows)) - np.searchsorted(label[order], label[order])
        ends = np.cumsum([len(table) for table in tables])
        for k, part in zip(own[::-1], np.split(rank, ends[:-1])[::-1], strict=False):
            ranks[k] = part
    return ranks
