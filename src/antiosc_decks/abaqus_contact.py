"""Contact pairs of Abaqus and CalculiX decks: tied where they are closed at first, or left apart.

A linear structure neither opens nor slides. The parts of a pair that touch at first therefore
either hold together, as in a joint that stays pressed (bolts, press fits), or do not act on each
other. The real joint is between these two bounds.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import NamedTuple

import numpy as np

from antiosc.base.errors import PiecesError
from antiosc.base.texts import where_to_change
from antiosc.io.deck import DeckPlace
from antiosc_decks.abaqus_assembly import Whole
from antiosc_decks.abaqus_cards import Card
from antiosc_decks.abaqus_joints import (
    TIE_REACH,
    DeckFaces,
    TiedNode,
    lead,
    mean_edge,
    surfaces_of,
    tied_nodes,
)
from antiosc_decks.builder import ModelBuilder

#: Share of the extent of nodes below which they lie on one line, or at one point.
ON_LINE = 1e-6
#: Most pairs that are listed.
MOST_PAIRS = 6
#: What ties the pairs or leaves them out.
CHOICE = where_to_change("contact of [deck]", "contact pairs")


class ContactPair(NamedTuple):
    """Two surfaces of a *CONTACT PAIR card, and their names."""

    names: list[str]
    surfaces: list[DeckFaces]
    place: DeckPlace


def read_contacts(
    assembled: Whole, builder: ModelBuilder, cards: Sequence[Card], left: Sequence[str]
) -> None:
    """Tie the contact pairs that are closed, if they shall be tied; a remark tells what they do.

    `left`: a sentence (in a list) on the contact that is left out. Raises PiecesError if no pair
    that shall be tied is closed.
    """
    pairs = [pair for pair in _pairs(assembled, cards) if _is_kept(builder, pair)]
    if builder.deck.contact == "tied":
        _tie(builder, pairs, any(card.keyword == "CONTACTPAIR" for card in cards))
        return
    _touch(builder, pairs)
    texts = _listed([_text(builder, pair) for pair in pairs])
    for sentence in left:
        told = f"{sentence.rstrip('.')}: {texts}. Those that touch can be tied ({CHOICE})."
        builder.deck.remarks.insert(0, told if pairs else sentence)


def _pairs(assembled: Whole, cards: Sequence[Card]) -> Iterator[ContactPair]:
    """The pairs of which both surfaces are known; a surface may touch itself."""
    contacts = [card for card in cards if card.keyword == "CONTACTPAIR"]
    surfaces = surfaces_of(assembled, cards) if contacts else {}
    for card in contacts:
        for row in card.rows():
            names = [word for word in row.fields[:2] if word.upper() in surfaces]
            if len(names) == 2 and names[0].upper() != names[1].upper():
                found = [surfaces[name.upper()] for name in names]
                yield ContactPair(names, found, row.place)


def _is_kept(builder: ModelBuilder, pair: ContactPair) -> bool:
    """Whether both surfaces are of elements that are read."""
    return all(builder.used[side.nodes].any() for side in pair.surfaces)


def _touch(builder: ModelBuilder, pairs: Sequence[ContactPair]) -> None:
    """Note the sections of the parts: where these meet is told here, not as a crack of the mesh."""
    for side in (side for pair in pairs for side in pair.surfaces):
        builder.touching |= set(builder.of_element[side.elements].tolist())


def _tie(builder: ModelBuilder, pairs: Sequence[ContactPair], needed: bool) -> None:
    """Tie the pairs that are closed; PiecesError if there are none, and one is `needed`."""
    tied = [_closed(builder, pair) for pair in pairs]
    closed = [(pair, nodes) for pair, nodes in zip(pairs, tied, strict=True) if nodes]
    if needed and not closed:
        raise PiecesError(
            f"no contact pair of {builder.deck.name} touches at three nodes or more that are not on"
            " a line, so that nothing can be tied: read one piece of the part (piece 1), or leave"
            ' the contact out (contact "apart").'
        )
    texts = []
    for pair, nodes in closed:
        texts.append(f"{_text(builder, pair)} and are tied at {len(nodes)} nodes")
        for one in nodes:  # onto the face: at a distance from it no rotation would be free
            builder.deck.points[one.node] = one.weights @ builder.deck.points[one.leaders]
        lead(builder.joints, nodes, pair.place)
    if texts:
        builder.deck.remarks.append(
            f"contact is tied where it is closed at first, as in a joint that stays pressed:"
            f" {_listed(texts)}. It neither opens nor slides; it can be left out ({CHOICE})."
        )
    _touch(builder, [pair for pair, _ in closed])
    is_open = [_text(builder, pair) for pair, nodes in zip(pairs, tied, strict=True) if not nodes]
    if is_open:
        builder.deck.remarks.append(
            f"contact that is open at first is left out: {_listed(is_open)}."
        )


def _closed(builder: ModelBuilder, pair: ContactPair) -> list[TiedNode]:
    """The nodes of one surface that lie on the other, if they hold two bodies together; else none.

    The follower is the surface of which more nodes lie on the other, mostly the finer one.
    """
    first, second = pair.surfaces
    ways = ((first, second), (second, first))
    sizes = [mean_edge(builder.joints, side) for side in pair.surfaces if side.faces]
    reach = TIE_REACH * min(sizes, default=0.0)
    each = [tied_nodes(builder.joints, a, b, reach)[0] for a, b in ways if b.faces]
    led = {terms[0][0] for terms in builder.joints.equations}
    best = max(each, key=len, default=[])
    x = np.array([builder.joints.place(one.node) for one in best]).reshape(-1, 3)
    plane = not np.ptp(builder.deck.points[:, 2]) if len(x) else False
    size = float(np.ptp(builder.deck.points, axis=0).max())
    rank = np.linalg.matrix_rank(x - x.mean(axis=0), tol=ON_LINE * size) if len(x) else 0
    return [one for one in best if one.node not in led] if rank >= 2 - plane else []


def _text(builder: ModelBuilder, pair: ContactPair) -> str:
    """ "BOLT and FLANGE (surfaces A, B) share 3 nodes"."""
    parts = [_part(builder, side) for side in pair.surfaces]
    first, second = (builder.deck.nodes_of(elements) for _, elements in parts)
    count = len(np.intersect1d(first, second)) if parts[0][0] != parts[1][0] else 0
    names = [name for name, _ in parts]
    surfaces = ", ".join(pair.names)
    named = f"{' and '.join(names)} ({surfaces})" if all(names) else " and ".join(pair.names)
    return f"{named} share {count or 'no'} node{'s' * (count != 1 and count > 0)}"


def _part(builder: ModelBuilder, side: DeckFaces) -> tuple[str, np.ndarray]:
    """(name of the section of the elements of a surface, its elements); "" if they have several."""
    sections = np.unique(builder.of_element[side.elements])
    name = builder.names[sections[0]] if len(sections) == 1 and sections[0] >= 0 else ""
    return name, np.flatnonzero(np.isin(builder.of_element, sections))


def _listed(texts: Sequence[str]) -> str:
    """Some of the texts, and how many more there are."""
    more = f", and {len(texts) - MOST_PAIRS} more" * (len(texts) > MOST_PAIRS)
    return f"{', '.join(texts[:MOST_PAIRS])}{more}"
