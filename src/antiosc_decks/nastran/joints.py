"""Joints of Nastran decks: MPC, RBE2, RBE3, RBAR; CELAS1 to 4, CDAMP1 to 4, CVISC, CBUSH
and CGAP.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from antiosc.io.deck import Array, whole_number
from antiosc_decks.model.builder import ModelBuilder
from antiosc_decks.model.constraints import Term
from antiosc_decks.nastran import parts
from antiosc_decks.nastran.beams import orientation
from antiosc_decks.nastran.cards import Entry, motions_of
from antiosc_decks.nastran.mesh import NastranDeck, its_property

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
    for entry in found.named("SECONCT"):
        _same_nodes(found, builder, entry)
    for follower, node in parts.coincident(found.grids, found.deck.points, found.bulk.entries):
        leader = builder.joints.leader(node)
        builder.joints.rigid(np.array([follower]), leader, ALL, found.grids[follower].place)
    used = found.used_sets("MPC")
    for entry in found.named("MPC"):
        if entry.whole(0) in used:
            _mpc(found, builder, entry)


def _motions(entry: Entry, text: str) -> list[int]:
    found = motions_of(text, entry.place)
    if not found or "0" in text:
        raise entry.place.error(f"{text!r} are not components from 1 to 6.")
    return found


def _nodes(found: NastranDeck, entry: Entry, words: list[str]) -> list[int]:
    """Rows of a list of GRIDs, with THRU."""
    rows: list[int] = []
    k = 0
    while k < len(words):
        if words[k].upper() == "THRU" and rows and k + 1 < len(words):
            one = Entry(entry.name, entry.place, [words[k - 1], words[k + 1]])
            rows += [int(n) for n in found.nodes.between(one.number(0), one.number(1))][1:]
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
        raise entry.place.error(f"the GRID {entry.whole(1)} of RBE2 cannot follow itself.")
    leader = builder.joints.leader(reference)
    followers = np.array(rows, dtype=np.int64)
    builder.joints.rigid(followers, leader, motions, entry.place, own=True)


def _same_nodes(found: NastranDeck, builder: ModelBuilder, entry: Entry) -> None:
    """SECONCT: pairs of a node of one superelement and one of another, which are one node."""
    words = [entry.text(k) for k in range(8, len(entry.fields)) if entry.text(k)]
    if "THRU" in map(str.upper, words) or len(words) % 2:
        raise entry.place.error("SECONCT is read as pairs of nodes.")
    for pair in zip(words[::2], words[1::2], strict=True):
        places = [parts.place_in(found.bulk.entries, entry, k) for k in (0, 1)]
        follower, leader = (
            found.row(whole_number(word, at), at) for word, at in zip(pair, places, strict=True)
        )
        if follower != leader:
            builder.joints.rigid(
                np.array([follower]), builder.joints.leader(leader), ALL, entry.place
            )


def _rbar(found: NastranDeck, builder: ModelBuilder, entry: Entry) -> None:
    first, second = (found.row(entry.whole(k), entry.place) for k in (1, 2))
    if first == second:
        raise entry.place.error(f"the GRID {entry.whole(1)} of RBAR cannot follow itself.")
    leads, follows = entry.text(3), entry.text(4)
    dependent = entry.text(6)
    if not leads and follows:
        first, second, leads, follows = second, first, follows, leads
        dependent = entry.text(5)
    if set(leads) - {" "} != set("123456") or follows:
        raise entry.place.error("RBAR is read with CNA or CNB = 123456 only.")
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
        if k + 1 >= len(words) or set(words[k + 1]) - set("456 ") != set("123"):
            raise entry.place.error(
                "RBE3 is read where the independent nodes move by 123; got "
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
        raise entry.place.error("RBE3 names no nodes with weights.")
    if reference in rows:
        raise entry.place.error(f"the GRID {entry.whole(2)} of RBE3 cannot follow itself.")
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
                    raise entry.place.error("MPC acts on components from 1 to 6.")
                terms.append((row, motion, entry.real(k + 2)))
    if not terms or not terms[0][2]:
        raise entry.place.error("the first term of MPC needs a coefficient.")
    builder.joints.equation(terms, entry.place)


#: Share of an arm below which it lies along the spring.
ROUNDING_ARM = 1e-9
#: Element -> (its property, number of fields of one of these, what it gives).
SCALAR = {"CELAS": ("PELAS", 4, "stiffness"), "CDAMP": ("PDAMP", 2, "damping")}

#: Motion of one end: row of the node, direction, first motion (0 or 3), sign.
End = tuple[int, Array, int, float]


def read_springs(found: NastranDeck, builder: ModelBuilder) -> None:
    """Give the builder the springs and the dampers."""
    for kind, (name, width, what) in SCALAR.items():
        known = found.properties(name, width)
        for entry in found.named(*(f"{kind}{k}" for k in (1, 2, 3, 4))):
            if entry.name[-1] in "24":
                value = entry.real(1, None)
            else:
                own, k = its_property(entry, name, known)
                value = own.real(k + 1, None)
                if name == "PELAS" and own.real(k + 2):
                    builder.tell_once(f"GE of PELAS {own.text(k)}")
            _scalar(found, builder, entry, what, value)
    viscous = found.properties("PVISC", 4)
    for entry in found.named("CVISC"):
        _viscous(found, builder, entry, *its_property(entry, "PVISC", viscous))
    lines = found.properties("PBUSH1D", 32)
    for entry in found.named("CBUSH1D"):
        _bush_on_a_line(found, builder, entry, its_property(entry, "PBUSH1D", lines)[0])
    bushes = found.properties("PBUSH")
    for entry in found.named("CBUSH"):
        own, _ = its_property(entry, "PBUSH", bushes)
        _bush(found, builder, entry, own)
    gaps = found.properties("PGAP")
    for entry in found.named("CGAP"):
        own, _ = its_property(entry, "PGAP", gaps)
        _gap(found, builder, entry, own)


def _scalar(
    found: NastranDeck, builder: ModelBuilder, entry: Entry, what: str, value: float
) -> None:
    """A spring or a damper between two motions, or of one against the ground."""
    ends: list[End] = []
    for (row, motion), sign in zip(found.scalar_ends(entry), (1.0, -1.0), strict=False):
        frame = found.frame(row, entry.place)
        ends.append((row, frame[motion % 3], 3 * (motion // 3), sign))
    if not ends:
        raise entry.place.error(f"{entry.name} acts on no node.")
    _add(builder, entry, ends, what, value)


def _viscous(found: NastranDeck, builder: ModelBuilder, entry: Entry, own: Entry, k: int) -> None:
    """CVISC: a damper along the line between two nodes, and one against the twist about it."""
    rows = [found.row(entry.whole(k), entry.place) for k in (2, 3)]
    for first, value in ((0, own.real(k + 1)), (3, own.real(k + 2))):
        terms, _ = builder.joints.elongation(rows[0], rows[1], entry.place, first)
        if value < 0:
            raise entry.place.error("CVISC has a negative damping.")
        builder.damped(terms, value)


def _bush_on_a_line(found: NastranDeck, builder: ModelBuilder, entry: Entry, own: Entry) -> None:
    """CBUSH1D: a spring and a damper along the line between two nodes, or along x of its system."""
    if any(own.text(k) for k in range(3, len(own.fields))):
        builder.tell_once(f"what of PBUSH1D {own.text(0)} is not K or C")
    rows = [found.row(entry.whole(k), entry.place) for k in (2, 3) if entry.text(k)]
    if entry.text(4) or len(rows) < 2:
        axis = found.systems(entry.whole(4, 0), entry.place).axes[0]
    else:
        line = np.diff(found.deck.points[rows], axis=0)[0]
        if not line.any():
            raise entry.place.error("CBUSH1D at coincident nodes needs the system CID.")
        axis = line / np.linalg.norm(line)
    ends: list[End] = [(row, axis, 0, sign) for row, sign in zip(rows, (1.0, -1.0), strict=False)]
    for k, what in ((1, "stiffness"), (2, "damping")):
        if own.real(k):
            _add(builder, entry, ends, what, own.real(k))


def _gap(found: NastranDeck, builder: ModelBuilder, entry: Entry, own: Entry) -> None:
    """CGAP as linear solutions take it: a spring, closed or open as it is at first."""
    is_open = own.real(1) > 0
    along = own.real(4) if is_open else own.real(3, 1e8)
    across = 0.0 if is_open else own.real(5, own.real(6) * along)
    spring = Entry("PBUSH", own.place, ["", "K", *(repr(k) for k in (along, across, across))])
    builder.tell_once(f"the contact in CGAP of PGAP {own.text(0)}, which stay "
                      f"{'open' if is_open else 'closed'}, as at first")  # fmt: skip
    if along or across:
        _bush(found, builder, Entry(entry.name, entry.place, entry.fields[:8]), spring)


def _bush(found: NastranDeck, builder: ModelBuilder, entry: Entry, own: Entry) -> None:
    """CBUSH with the PBUSH `own`: springs and dampers at its place, on rigid arms."""
    stiffness, damping = _constants(builder, own)
    acts = [bool(k or c) for k, c in zip(stiffness, damping, strict=True)]
    rows = [found.row(entry.whole(k), entry.place) for k in (2, 3) if entry.text(k)]
    x = found.deck.points[rows]
    apart = len(rows) == 2 and np.linalg.norm(x[1] - x[0]) > 0
    share = entry.real(8, 0.5)
    place = x[0] + share * (x[1] - x[0]) if apart else x[0]
    if entry.whole(9, -1) >= 0:
        offset = np.array([entry.real(k) for k in (10, 11, 12)])
        place = found.systems(entry.whole(9), entry.place).point(offset)
    axes = _bush_axes(found, entry, acts, x if apart else x[:1], place)
    for k in np.flatnonzero(acts):
        axis, first = axes[k % 3], 3 * (int(k) // 3)
        ends: list[End] = []
        for row, at, sign in zip(rows, x, (1.0, -1.0), strict=False):
            arm = np.cross(place - at, axis) if not first else np.zeros(3)
            if np.linalg.norm(arm) > ROUNDING_ARM * np.linalg.norm(place - at):
                row = builder.joints.leader(row)
                ends.append((row, arm, 3, sign))
            ends.append((row, axis, first, sign))
        for what, value in (("stiffness", stiffness[k]), ("damping", damping[k])):
            if value:
                _add(builder, entry, ends, what, value)


def _constants(builder: ModelBuilder, own: Entry) -> tuple[list[float], list[float]]:
    """(K1 to K6, B1 to B6) of a PBUSH; its damping by GE is told."""
    values = {"K": [0.0] * 6, "B": [0.0] * 6}
    for start in range(0, len(own.fields), 8):
        kind = own.text(start + 1).upper()
        given = [own.text(start + k) for k in range(2, 8)]
        if kind in values:
            values[kind] = [own.real(start + k) for k in range(2, 8)]
        elif kind == "GE":
            builder.tell_once(f"GE of PBUSH {own.text(0)}")
        elif kind not in ("", "RCV") or (not kind and any(given)):
            raise own.place.error(
                "PBUSH is read with stiffnesses (K) and dampers (B) alone; its line "
                f"{kind or '(?)'} would change the result."
            )
    return values["K"], values["B"]


def _bush_axes(
    found: NastranDeck, entry: Entry, acts: Sequence[bool], x: Array, place: Array
) -> Array:
    """Axes of a CBUSH as rows: of its system, by its line and a vector, or of the deck.

    `acts`: which of the six motions have a constant.
    """
    if entry.text(7):
        return found.systems(entry.whole(7), entry.place).frame(place)
    across = any(acts[k] for k in (1, 2, 4, 5))
    given = any(entry.text(k) for k in (4, 5, 6))
    if len(x) == 1 and not given:
        return np.eye(3)
    if len(x) == 1 or (across and not given):
        raise entry.place.error(
            "CBUSH needs the system CID at coincident nodes or to the ground, and "
            "CID or an orientation between nodes apart, unless it acts along their line alone."
        )
    line = (x[1] - x[0]) / np.linalg.norm(x[1] - x[0])
    v = np.eye(3)[int(np.argmin(np.abs(line)))]
    if given:
        v = orientation(found, entry, line)
    y = v - (v @ line) * line
    y /= np.linalg.norm(y)
    return np.stack([line, y, np.cross(line, y)])


def _add(builder: ModelBuilder, entry: Entry, ends: Sequence[End], what: str, value: float) -> None:
    """A spring ("stiffness") or a damper ("damping") against the sum of motions."""
    if value < 0:
        raise entry.place.error(f"{entry.name} has a negative {what}.")
    terms = [
        (row, first + c, sign * float(direction[c]))
        for row, direction, first, sign in ends
        for c in range(3)
    ]
    if what == "stiffness":
        builder.sprung(terms, value, entry.place)
    else:
        builder.damped(terms, value)
