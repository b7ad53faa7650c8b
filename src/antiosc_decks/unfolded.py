"""Cyclically symmetric decks of Abaqus and CalculiX, whose sector is unfolded into the whole ring.

*CYCLIC SYMMETRY MODEL gives the number of sectors and the axis, *TIE, CYCLIC SYMMETRY the two sides
of the sector. The nodes of one side, turned by one sector, are those of the other side: they become
one. The nodes and elements of the file are those of sector 0.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from antiosc.base.errors import MeshError
from antiosc.io.deck import Array, Block, Deck, IntArray
from antiosc.io.neutral import connected
from antiosc_decks.abaqus_assembly import Whole
from antiosc_decks.abaqus_cards import Card
from antiosc_decks.abaqus_joints import READERS, surfaces_of
from antiosc_decks.builder import ModelBuilder

#: Distance over that of neighbouring nodes of a side within which a turned node is one of them.
SAME_NODE = 0.05
#: Largest number of nodes of a whole ring; 200 000 nodes of solids are 600 000 dofs.
MOST_NODES = 200_000
#: Cards of single nodes or of directions, which would have to be turned with each sector.
REFUSED = (*(name for name in READERS if name != "TIE"), "ORIENTATION", "NONSTRUCTURALMASS")


@dataclass(frozen=True)
class Ring:
    """The sectors of an unfolded deck.

    Attributes
    ----------
    nodes_at : (nodes of the file, sectors) rows of the copies of each node.
    turns : (sectors, 3, 3) rotations of the sectors.
    """

    nodes_at: IntArray
    turns: Array

    def hold(self, builder: ModelBuilder) -> None:
        """Give the motions that are fixed in sector 0, and their axes, to the other sectors."""
        count = len(self.nodes_at)
        held = np.flatnonzero(builder.fixed[:count].any(axis=1))
        fixed = builder.fixed[held]
        frames = [builder.joints.frames.get(int(node), np.eye(3)) for node in held]
        builder.fixed[:] = False
        for copies, turn in zip(self.nodes_at[held].T, self.turns, strict=True):
            builder.fixed[copies] |= fixed
            turned = zip(copies.tolist(), (frame @ turn.T for frame in frames), strict=True)
            builder.joints.frames.update(turned)


def unfolded(whole: Whole, first: Sequence[Card]) -> Ring | None:
    """Unfold the sector of a cyclically symmetric deck, with its sets; None for other decks.

    `first`: cards of the first step.

    Raises
    ------
    MeshError
        Sides whose nodes do not match; joints, axes and elements that have a direction.
    """
    from scipy.spatial.transform import Rotation  # few decks need it, and it loads slowly

    models = whole.named("CYCLICSYMMETRYMODEL")
    ties = [card for card in whole.named("TIE") if "CYCLICSYMMETRY" in card.options]
    if not models and not ties:
        return None
    if not models or len(models) + len(ties) != 2:
        place = (models or ties)[0].place
        raise place.error(
            "cyclic symmetry is read with one *CYCLIC SYMMETRY MODEL and one *TIE, CYCLIC SYMMETRY"
            " of the two sides of the sector: give these, or the whole ring."
        )
    card, tie = models[0], ties[0]
    deck = whole.deck
    _check(whole, card, first)
    sectors = round(float(card.option("N") or 0))
    card.needs(sectors > 1, "*CYCLIC SYMMETRY MODEL needs a number of sectors, N=.")
    most = f"{sectors} sectors of {len(deck.points)} nodes are more than {MOST_NODES} nodes."
    card.needs(sectors * len(deck.points) <= MOST_NODES, most)
    a, b = np.reshape(card.first().reals(6), (2, 3))
    card.needs((a != b).any(), "*CYCLIC SYMMETRY MODEL needs two points on its axis.")
    axis = (b - a) / np.linalg.norm(b - a)
    angles = 2 * np.pi * np.arange(sectors) / sectors
    turns = Rotation.from_rotvec(np.outer(angles, axis)).as_matrix()
    sides = [_side(whole, tie, k) for k in (0, 1)]
    nodes_at = _joined_nodes(deck, turns, a, sides, tie)
    elements = deck.n_elements
    blocks = deck.blocks
    deck.blocks = [_turned(block, nodes_at[:, k]) for k in range(sectors) for block in blocks]
    whole.spread(nodes_at, elements, sectors)
    deck.remarks.append(f"the sector of {deck.name} is unfolded: {sectors} of them are a ring.")
    return Ring(nodes_at, turns)


def _check(whole: Whole, model: Card, first: Sequence[Card]) -> None:
    """Raise MeshError for what cannot be turned with the sectors."""
    deck = whole.deck
    directed = {block.type for block in deck.blocks if block.role not in ("solid", "shell")}
    kinds = ", ".join(sorted([*directed, *deck.left]))
    model.needs(not kinds, f"{kinds} elements of a sector are not turned: give the whole ring.")
    if model.option("ELSET"):
        everything = len(model.elements()) == deck.n_elements
        model.needs(everything, "a sector of some elements alone: give the whole ring.")
    for card in [*whole.cards, *first]:
        turned = card.keyword not in REFUSED
        card.needs(turned, f"{card.label} of a sector is not turned: give the whole ring.")


def _side(whole: Whole, tie: Card, k: int) -> IntArray:
    """Nodes of side `k` (0 or 1) of the sector."""
    name = tie.first().word(k)
    surfaces = surfaces_of(whole, whole.cards)
    message = f"there is no surface {name!r} (*SURFACE, NAME=)."
    return tie.place.found(surfaces, name.upper(), message).nodes


def _joined_nodes(
    deck: Deck, turns: Array, origin: Array, sides: Sequence[IntArray], tie: Card
) -> IntArray:
    """Add the nodes of all sectors to the deck; rows (nodes, sectors) of each."""
    from scipy.spatial import cKDTree

    count, sectors = len(deck.points), len(turns)
    arms = deck.points - origin
    side, other = sides
    tree = cKDTree(arms[other])
    spacing = tree.query(arms[other], k=2)[0][:, -1].min()
    best = None
    for step in (1, -1):
        distance, partner = tree.query(arms[side] @ turns[step].T)
        if distance.max() <= SAME_NODE * spacing and len(side) == len(other):
            best = step, other[partner]
            break
    if best is None:
        raise tie.place.error(
            "the nodes of the two sides of the sector do not match, when one is turned by"
            f" 1/{sectors} of a full turn: mesh them alike, or give the whole ring."
        )
    step, partners = best
    numbers = np.arange(count * sectors).reshape(sectors, count).T
    pairs = [
        np.stack([numbers[side, (k + step) % sectors], numbers[partners, k]], axis=1)
        for k in range(sectors)
    ]
    on_axis = np.linalg.norm(arms @ turns[1].T - arms, axis=1) <= SAME_NODE * spacing
    group = connected([*pairs, numbers[on_axis]], count * sectors)
    _, rows, group = np.unique(group, return_index=True, return_inverse=True)
    order = np.argsort(rows)
    place = np.empty(len(order), dtype=np.int64)
    place[order] = np.arange(len(order))
    everywhere = np.vstack([arms @ turn.T for turn in turns]) + origin
    deck.points = everywhere[rows[order]]
    if len(np.unique(place[group.ravel()][:count])) != count:
        raise MeshError(f"{deck.name}: two nodes of one sector become one: check its sides.")
    return place[group.ravel()].reshape(sectors, count).T


def _turned(block: Block, node_of: IntArray) -> Block:
    """A block whose node n is `node_of[n]`."""
    return block.mapped(lambda table: np.where(table >= 0, node_of[table], -1))
