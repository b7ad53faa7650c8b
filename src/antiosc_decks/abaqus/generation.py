"""Nodes and elements that a deck has made from others: *NGEN, *NFILL, *ELGEN."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence

import numpy as np

from antiosc.fem.readers.deck import Block, IntArray, Numbering, Place, whole_number
from antiosc_decks.abaqus.cards import Card

#: Most nodes or elements from one card; more indicate a damaged file.
MOST_GENERATED = 5_000_000

Points = Mapping[int, list[float]]


def generated(
    card: Card, known: Points, sets: Mapping[str, list[int]]
) -> Iterator[tuple[int, list[float]]]:
    """Nodes on straight lines between two others (*NGEN)."""
    if card.option("LINE"):
        raise card.place.error("*NGEN makes straight lines only here (LINE=).")
    for fields, place in card.rows():
        first, last, *rest = _whole(fields, place, 2)
        step = rest[0] if rest else 1
        ends = [known.get(first), known.get(last)]
        if ends[0] is None or ends[1] is None:
            raise place.error(f"*NGEN from {first} to {last}: both nodes must exist.")
        if step < 1 or (last - first) % step or not 0 < (last - first) // step <= MOST_GENERATED:
            raise place.error(f"*NGEN from {first} to {last} by {step} does not fit.")
        a, b = np.array(ends[0]), np.array(ends[1])
        count = (last - first) // step
        for k in range(count + 1):
            yield first + k * step, list(a + (b - a) * (k / count))


def filled(
    card: Card, known: Points, sets: Mapping[str, list[int]]
) -> Iterator[tuple[int, list[float]]]:
    """Nodes on lines between those of two sets (*NFILL)."""
    if card.option("BIAS", "1") not in ("1", "1.", "1.0") or "SINGULAR" in card.options:
        raise card.place.error("*NFILL is read with equal distances only.")
    for fields, place in card.rows():
        if len(fields) < 4:
            raise place.error("*NFILL needs two sets, a number of lines and a step.")
        pair = [sets.get(name.upper(), []) for name in fields[:2]]
        lines, step = _whole(fields[2:4], place, 2)
        if len(pair[0]) != len(pair[1]) or not pair[0]:
            raise place.error(
                f"*NFILL between {fields[0]!r} ({len(pair[0])} nodes) and {fields[1]!r} "
                f"({len(pair[1])}): both sets must be made by *NODE or *NGEN and be equally long."
            )
        if not 0 < lines * len(pair[0]) <= MOST_GENERATED:
            raise place.error(f"*NFILL over {lines} lines does not fit.")
        for one, other in zip(*pair, strict=True):
            a, b = np.array(known[one]), np.array(known[other])
            for k in range(1, lines):
                yield one + k * step, list(a + (b - a) * (k / lines))


def element_copies(
    card: Card, blocks: Sequence[Block], labels: Sequence[IntArray], nodes: Numbering
) -> list[tuple[Block, IntArray, int]]:
    """Elements in rows, layers and blocks of one (*ELGEN), with the number of that one.

    Each is numbered and has its nodes numbered by steps from the master element's.
    """
    found = []
    for fields, place in card.rows():
        master, *rest = _whole(fields, place, 2)
        counts = np.array([*rest, *[1] * (9 - len(rest))][:9]).reshape(3, 3)
        counts[counts[:, 0] < 1, 0] = 1
        total = int(np.prod(counts[:, 0].astype(object)))
        if not 0 < total <= MOST_GENERATED:
            raise place.error(f"*ELGEN would make {total} elements.")
        block, row = _of_label(master, blocks, labels, place)
        steps = [np.arange(n) for n in counts[:, 0]]
        i = np.stack([one.ravel() for one in np.meshgrid(*steps, indexing="ij")], axis=1)
        own = i @ counts[:, 2]
        shift = i @ counts[:, 1]
        more = own[1:] if total > 1 else own[:0]
        moved = Block(
            block.shape,
            block.type,
            *(
                _shifted(table[row], shift[1:], nodes, place)
                for table in (block.corners, block.mids, block.inner)
            ),
        )
        found.append((moved, master + more, master))
    return found


def _shifted(rows: IntArray, shift: IntArray, nodes: Numbering, place: Place) -> IntArray:
    label = np.empty(len(nodes.labels), dtype=np.int64)
    label[nodes.order] = nodes.labels
    wanted = label[rows][None, :] + shift[:, None]
    found = nodes.rows(wanted)
    if found.size and (found < 0).any():
        raise place.error(
            f"*ELGEN needs the node {wanted[found < 0][0]}, which the deck does not define."
        )
    return found


def _of_label(
    label: int, blocks: Sequence[Block], labels: Sequence[IntArray], place: Place
) -> tuple[Block, int]:
    for block, own in zip(blocks, labels, strict=True):
        rows = np.flatnonzero(own == label)
        if len(rows):
            return block, int(rows[0])
    raise place.error(f"*ELGEN copies the element {label}, which is not defined before.")


def _whole(fields: Sequence[str], place: Place, least: int) -> list[int]:
    numbers = [whole_number(field, place) for field in fields if field]
    if len(numbers) < least:
        raise place.error(f"{least} numbers are needed at least.")
    return numbers
