"""The content of a deck, independent of its program."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from antiosc.base._types import Array, BoolArray
from antiosc.io.neutral import Model, Piece

IntArray = NDArray[np.int64]


@dataclass
class Block:
    """Elements of one type."""

    shape: str  # a key of `antiosc.io.neutral.EDGES`
    type: str  # the deck's own name of the type
    corners: IntArray  # (n, corners) rows of `Deck.points`
    #: (n, edges) rows of `Deck.points`, -1 where there is none; (n, 0) for straight elements
    mids: IntArray
    #: (n, k) nodes inside faces and inside the cell, in VTK's order; (n, 0) for most
    inner: IntArray
    role: str = ""  # what the elements are in a model: "solid", "shell", "beam", "rod", …

    def __len__(self) -> int:
        return len(self.corners)

    def __getitem__(self, selection: BoolArray | IntArray) -> Block:
        """The block with some of its elements."""
        return self.mapped(lambda table: table[selection])

    def mapped(self, new: Callable[[IntArray], IntArray]) -> Block:
        """The block with its node tables transformed by `new`."""
        corners, mids, inner = map(new, (self.corners, self.mids, self.inner))
        return Block(self.shape, self.type, corners, mids, inner, self.role)

    @property
    def nodes(self) -> IntArray:
        """All nodes of its elements, ascending."""
        tables = (self.corners, self.mids, self.inner)
        nodes = np.unique(np.concatenate([table.ravel() for table in tables]))
        return nodes[nodes >= 0]


@dataclass
class Deck:
    """Nodes, elements and sets of a deck.

    Elements are numbered consecutively through all blocks.
    """

    name: str
    points: Array = field(default_factory=lambda: np.zeros((0, 3)))
    blocks: list[Block] = field(default_factory=list)
    node_sets: dict[str, IntArray] = field(default_factory=dict)  # name -> rows of `points`
    element_sets: dict[str, IntArray] = field(default_factory=dict)  # name -> numbers of elements
    #: nodes fixed by supports: name of the group for them -> rows of `points`
    fixed: dict[str, IntArray] = field(default_factory=dict)
    #: type of elements that are not cells of a mesh -> their number
    left: Counter[str] = field(default_factory=Counter)
    #: warnings about the deck for the caller, one sentence each
    remarks: list[str] = field(default_factory=list)
    #: names of the parts (sets of elements) that a model is made of; None: of all elements
    wanted: list[str] | None = None
    pieces: list[Piece] = field(default_factory=list)  # these, if one of several is read
    #: which of the pieces that share no node a model is made of, 1: the largest; None: of all
    piece: int | None = None
    free: bool = False  # whether the supports are left out of a model
    apart: bool = False  # whether contact is left out; else the pairs that touch are tied
    #: materials, sections, supports, masses in SI units, if they were requested
    model: Model | None = None
    #: numbers of the first nodes in the file
    labels: IntArray = field(default_factory=lambda: np.zeros(0, dtype=np.int64))

    @property
    def n_elements(self) -> int:
        """Number of elements that are cells."""
        return sum(len(block) for block in self.blocks)

    def numbered(self) -> Iterator[tuple[Block, IntArray]]:
        """Each block, with the numbers of its elements."""
        start = 0
        for block in self.blocks:
            yield block, np.arange(start, start + len(block))
            start += len(block)

    def blocks_of(self, elements: IntArray) -> Iterator[tuple[Block, BoolArray]]:
        """Each block restricted to some elements, with the mask of `elements` that it contains."""
        start = 0
        for block in self.blocks:
            in_block = (elements >= start) & (elements < start + len(block))
            if in_block.any():
                yield block[elements[in_block] - start], in_block
            start += len(block)

    def nodes_of(self, elements: IntArray) -> IntArray:
        """All nodes of some elements, ascending."""
        tables = [block.nodes for block, _ in self.blocks_of(elements)]
        return np.unique(np.concatenate([np.zeros(0, dtype=np.int64), *tables]))


def listed(counts: dict[str, int]) -> str:
    """Counts by element type as text."""
    words = [f"{count} {kind}" for kind, count in sorted(counts.items())]
    more_text = f" and {len(words) - 8} more" if len(words) > 8 else ""
    return ", ".join(words[:8]) + more_text
