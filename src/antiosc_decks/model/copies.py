"""Elements that repeat others node by node, such as the skin and the doubler of a shell.

A mesh holds every cell once. Copies therefore get nodes of their own, which follow those of the
first: stiffness and mass add.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from antiosc.io.deck import Block, Deck, IntArray, listed
from antiosc_decks.model.builder import SPRINGS, ModelBuilder


def separate(deck: Deck, roles: Sequence[str]) -> list[tuple[int, int]]:
    """Give copies nodes of their own: (own node, node that it follows); they are told."""
    whole = set(roles) - SPRINGS
    some = [
        block
        for role, block in zip(roles, deck.blocks, strict=True)
        if role not in SPRINGS or not whole
    ]
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


def join(builder: ModelBuilder, copies: list[tuple[int, int]]) -> None:
    """Let the nodes of copies follow."""
    for own, node in copies:
        builder.apart.append(own)
        for motion in range(6 if builder.has_rotations[own] else 3):
            builder.joints.equations.append([(own, motion, 1.0), (node, motion, -1.0)])


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
