"""The elements of a deck that a model is made of."""

from __future__ import annotations

import numpy as np

from antiosc._types import BoolArray
from antiosc.errors import MeshError
from antiosc.fem.readers.deck import Block, Deck, IntArray


def chosen_elements(deck: Deck) -> BoolArray:
    """The elements of the parts that the caller chooses."""
    chosen = np.full(deck.n_elements, deck.wanted is None)
    for name in deck.wanted or ():
        own = deck.element_sets.get(name, np.zeros(0, dtype=np.int64))
        if not len(own):
            known = sorted(n for n, some in deck.element_sets.items() if len(some))
            shown = ", ".join(map(repr, known[:20])) or "none"
            raise MeshError(f"{deck.name} has no elements of a part {name!r}; it has: {shown}.")
        chosen[own] = True
    return chosen


def some_rows(block: Block, some: BoolArray) -> Block:
    """Some elements of a block."""
    tables = (block.corners[some], block.mids[some], block.inner[some])
    return Block(block.shape, block.type, *tables)


def nodes_of_block(block: Block) -> IntArray:
    """All nodes of a block's elements."""
    every = [table.ravel() for table in (block.corners, block.mids, block.inner)]
    nodes = np.unique(np.concatenate(every))
    return nodes[nodes >= 0]
