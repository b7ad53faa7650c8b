"""Middle nodes that a deck holds without the ends of their edges.

A support on an edge holds all of it; a middle node alone is held by a constraint.
"""

from __future__ import annotations

import numpy as np

from antiosc.fem.readers.shapes import EDGES
from antiosc_decks.model.builder import ModelBuilder


def hold_middles(builder: ModelBuilder) -> None:
    """Constraints for middle nodes whose edges have an end that is free."""
    fixed = builder.fixed
    held: set[tuple[int, int]] = set()
    for block in builder.deck.blocks:
        if not block.mids.shape[1] or block.shape == "line":
            continue
        ends = block.corners[:, np.array(EDGES[block.shape])]  # (n, edges, 2)
        for motion in range(6):
            alone = (block.mids >= 0) & fixed[block.mids, motion]
            alone &= ~fixed[ends, motion].all(axis=2)
            held.update((int(node), motion) for node in np.unique(block.mids[alone]))
    for node, motion in sorted(held):
        if motion < 3 or builder.has_rotations[node]:
            builder.joints.equations.append([(node, motion, 1.0)])
