"""Constraints of Nastran decks: MPC, RBE2, RBE3, RBAR."""

from __future__ import annotations

import numpy as np

from antiosc.errors import MeshError
from antiosc_decks.model.builder import ModelBuilder
from antiosc_decks.model.constraints import Term
from antiosc_decks.nastran.cards import Entry
from antiosc_decks.nastran.mesh import NastranDeck

ALL = (0, 1, 2, 3, 4, 5)


def read_joints(found: NastranDeck, builder: ModelBuilder) -> None:
    """Give the builder what the entries join."""
    for row in found.systems_of:
        builder.joints.frames[row] = found.frame(row, found.bulk.entries[0].place)
    for entry in found.named("RBE2"):
        _rbe2(found, builder, entry)
    for entry in found.named("RBAR"):
        _rbar(found, builder, entry)
    for entry in found.named("RBE3"):
        _rbe3(found, builder, entry)
    used = found.used_sets("MPC")
    for entry in found.named("MPC"):
        if entry.whole(0) in used:
            _mpc(found, builder, entry)


def _motions(entry: Entry, text: str) -> list[int]:
    if not text.isdigit() or not set(text) <= set("123456"):
        raise MeshError(f"{entry.place}: {text!r} are not components from 1 to 6.")
    return sorted(int(c) - 1 for c in set(text))


def _nodes(found: NastranDeck, entry: Entry, words: list[str]) -> list[int]:
    """Rows of a list of GRIDs, with THRU."""
    rows: list[int] = []
    k = 0
    while k < len(words):
        if words[k].upper() == "THRU" and rows and k + 1 < len(words):
            one = Entry(entry.name, entry.place, [words[k - 1], words[k + 1]])
            rows += [int(n) for n in found.nodes.between(one.whole(0), one.whole(1))][1:]
            k += 2
            continue
        rows.append(found.row(Entry(entry.name, entry.place, [words[k]]).whole(0), entry.place))
        k += 1
    return rows


def _rbe2(found: NastranDeck, builder: ModelBuilder, entry: Entry) -> None:
    motions = _motions(entry, entry.text(2))
    words = [entry.text(k) for k in range(3, len(entry.fields)) if entry.text(k)]
    if words and "." in words[-1]:
        words.pop()  # the coefficient of thermal expansion
    rows = _nodes(found, entry, words)
    reference = found.row(entry.whole(1), entry.place)
    if reference in rows:
        raise MeshError(f"{entry.place}: the GRID {entry.whole(1)} of RBE2 cannot follow itself.")
    leader = builder.joints.leader(reference)
    followers = np.array(rows, dtype=np.int64)
    builder.joints.rigid(followers, leader, motions, entry.place, own=True)


def _rbar(found: NastranDeck, builder: ModelBuilder, entry: Entry) -> None:
    first, second = (found.row(entry.whole(k), entry.place) for k in (1, 2))
    if first == second:
        raise MeshError(f"{entry.place}: the GRID {entry.whole(1)} of RBAR cannot follow itself.")
    leads, follows = entry.text(3), entry.text(4)
    dependent = entry.text(6)
    if not leads and follows:
        first, second, leads, follows = second, first, follows, leads
        dependent = entry.text(5)
    if set(leads) != set("123456") or follows:
        raise MeshError(f"{entry.place}: RBAR is read with CNA or CNB = 123456 only.")
    motions = _motions(entry, dependent) if dependent else list(ALL)
    leader = builder.joints.leader(first)
    builder.joints.rigid(np.array([second]), leader, motions, entry.place, own=True)


def _rbe3(found: NastranDeck, builder: ModelBuilder, entry: Entry) -> None:
    reference = found.row(entry.whole(2), entry.place)
    motions = _motions(entry, entry.text(3))
    rows: list[int] = []
    weights: list[float] = []
    words = [entry.text(k) for k in range(4, len(entry.fields)) if entry.text(k)]
    k = 0
    while k < len(words):
        if words[k].upper() in ("UM", "ALPHA"):
            break
        weight = Entry(entry.name, entry.place, [words[k]]).real(0)
        if k + 1 < len(words) and set(words[k + 1]) & set("456"):
            builder.tell_once(f"the weight of rotations (components 456) of RBE3 {entry.text(0)}")
        if k + 1 >= len(words) or set(words[k + 1]) - set("456") != set("123"):
            raise MeshError(
                f"{entry.place}: RBE3 is read where the independent nodes move by 123; got "
                f"{words[k + 1] if k + 1 < len(words) else 'nothing'!r}."
            )
        end = k + 2
        while end < len(words) and "." not in words[end] and words[end][:1].isdigit():
            end += 1
            if end < len(words) and words[end].upper() == "THRU":
                end += 1
        own = _nodes(found, entry, words[k + 2 : end])
        rows += own
        weights += [weight] * len(own)
        k = end
    if not rows or sum(weights) <= 0:
        raise MeshError(f"{entry.place}: RBE3 names no nodes with weights.")
    if reference in rows:
        raise MeshError(f"{entry.place}: the GRID {entry.whole(2)} of RBE3 cannot follow itself.")
    follower = builder.joints.leader(reference)
    table = np.array(rows, dtype=np.int64)
    builder.joints.mean(follower, motions, table, np.array(weights), entry.place)


def _mpc(found: NastranDeck, builder: ModelBuilder, entry: Entry) -> None:
    terms: list[Term] = []
    for start in range(1, len(entry.fields), 8):
        for k in (start, start + 3):
            if entry.text(k):
                row = found.row(entry.whole(k), entry.place)
                motion = 0 if row in found.scalar else entry.whole(k + 1, 1) - 1
                if not 0 <= motion < 6:
                    raise MeshError(f"{entry.place}: MPC acts on components from 1 to 6.")
                terms.append((row, motion, entry.real(k + 2)))
    if not terms or not terms[0][2]:
        raise MeshError(f"{entry.place}: the first term of MPC needs a coefficient.")
    builder.joints.equation(terms, entry.place)
