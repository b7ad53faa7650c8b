"""Joints of Abaqus and CalculiX decks: equations, multi-point constraints, rigid bodies, ties."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from itertools import combinations

import numpy as np

from antiosc.io.deck import Array, IntArray, Place, real_number, whole_number
from antiosc.io.neutral import Term
from antiosc_decks.abaqus.assembly import NONE, Instance, Whole
from antiosc_decks.abaqus.cards import Card, Row
from antiosc_decks.abaqus.properties import Orientations
from antiosc_decks.abaqus.ties import Surface, surfaces_of, tie
from antiosc_decks.model.constraints import Constraints

#: Most terms of an equation: more are damage.
LONGEST_EQUATION = 1_000_000
#: The degree of freedom that is the temperature.
TEMPERATURE = "11"


def read_joints(whole: Whole, joints: Constraints, cards: Sequence[tuple[Card, Instance]]) -> None:
    """Give `joints` what the cards say."""
    reader = _Joints(whole, joints, surfaces_of(whole, cards))
    readers: dict[str, Callable[[Card, Instance], None]] = {
        "EQUATION": reader.equations,
        "MPC": reader.mpc,
        "RIGIDBODY": reader.rigid_body,
        "TIE": reader.tie,
        "COUPLING": reader.coupling,
        "KINEMATIC": reader.coupled,
        "DISTRIBUTING": reader.coupled,
        "KINEMATICCOUPLING": reader.kinematic_coupling,
        "DISTRIBUTINGCOUPLING": reader.distributing_coupling,
    }
    for card, within in cards:
        if card.keyword in readers:
            readers[card.keyword](card, within)
    whole.deck.left = {kind: n for kind, n in whole.deck.left.items() if n}


class _Joints:
    """One method a card."""

    def __init__(self, whole: Whole, joints: Constraints, surfaces: dict[str, Surface]) -> None:
        self.whole, self.joints, self.surfaces = whole, joints, surfaces
        self.orientations = Orientations(whole.cards)
        #: reference node and nodes of the last *COUPLING, and that
        self.current: tuple[int, IntArray, Card] | None = None

    def _surface(self, name: str, place: Place) -> Surface:
        if name.upper() not in self.surfaces:
            raise place.error(f"there is no surface {name!r} (*SURFACE, NAME=).")
        return self.surfaces[name.upper()]

    def tie(self, card: Card, within: Instance) -> None:
        given = card.option("POSITIONTOLERANCE")
        reach = real_number(given, card.place) if given else None
        for row in card.rows():
            if len(row.fields) > 1:
                slave, master = (self._surface(word, row.place) for word in row.fields[:2])
                self.whole.deck.told += tie(self.joints, slave, master, reach, row.place)

    def equations(self, card: Card, within: Instance) -> None:
        """*EQUATION, whose terms may take several lines."""
        within.refuse_turned(card)
        rows = iter(card.rows())
        for row in rows:
            count = whole_number(row.word(0), row.place)
            row.needs(0 < count <= LONGEST_EQUATION, f"an *EQUATION of {count} terms.")
            words: list[str] = []
            while len(words) < 3 * count:
                place, more = row.place, next(rows, None)
                if more is None:
                    found = len(words) // 3
                    raise place.error(f"the *EQUATION ends after {found} of {count} terms.")
                row = more
                words += row.fields + [""] * (-len(row.fields) % 3)
            if set(words[1 : 3 * count : 3]) == {TEMPERATURE}:  # moves nothing
                continue
            for terms in self._of_sets(words[: 3 * count], row.place, within):
                self.joints.equation(terms, row.place)

    def _of_sets(self, words: list[str], place: Place, within: Instance) -> Iterator[list[Term]]:
        """One equation, or one for each node of the sets that stand first."""
        triples = [words[k : k + 3] for k in range(0, len(words), 3)]
        nodes = [self.whole.nodes(word, place, within) for word, _, _ in triples]
        for (word, _, _), some in zip(triples, nodes, strict=True):
            place.needs(len(some), f"*EQUATION names {word!r}, a set without nodes.")
        count = len(nodes[0])
        if count > 1 and sum(len(some) > 1 for some in nodes) > 1:
            raise place.error(
                "*EQUATION between several sets of nodes pairs them by their order, "
                "which is not kept here; write one equation for each pair."
            )
        for k in range(count):
            terms = []
            for (_, dof, factor), some in zip(triples, nodes, strict=True):
                motion = whole_number(dof, place) - 1
                place.needs(0 <= motion < 6, f"*EQUATION acts on motions from 1 to 6; got {dof}.")
                node = int(some[k if len(some) > 1 else 0])
                terms.append((node, motion, real_number(factor, place)))
            place.needs(terms[0][2], "the first term of *EQUATION has the coefficient 0.")
            yield terms

    def mpc(self, card: Card, within: Instance) -> None:
        """*MPC, whose lists of nodes may take several lines."""
        lists: list[tuple[str, list[str], Place]] = []
        for row in card.rows():
            words = [word for word in row.fields if word]
            if not (words[0].isdigit() and lists):
                lists.append((words[0].upper(), words[1:], row.place))
            else:  # a continued list
                lists[-1][1].extend(word for word in words if word != "0")
        for kind, words, place in lists:
            nodes = [int(n) for w in words for n in self.whole.nodes(w, place, within)]
            if kind == "1" and "USER" in card.options:  # as cgx writes it
                kind = "MEANROT"
            if kind in GEOMETRIC:
                least, read = GEOMETRIC[kind]
                nodes = list(dict.fromkeys(nodes))
                if len(nodes) < least:
                    raise place.error(f"the *MPC of type {kind} needs {least} nodes or more.")
                x = np.array([self.joints.place(node) for node in nodes])
                equations = list(read(nodes, x, place))
                for terms in equations:
                    self.joints.equation(terms, place)
                left = set(nodes) - {node for terms in equations for node, _, _ in terms}
                if left:
                    self.whole.deck.told.append(f"{place}: {len(left)} nodes of the *MPC of type "
                                                f"{kind} lie on its axis: left out.")  # fmt: skip
            elif len(nodes) != 2 or not self._of_two(kind, nodes, place):
                raise place.error(
                    f"the *MPC of type {kind} with {len(nodes)} nodes is not supported here "
                    "and would change the result; write it as *EQUATION, or remove it."
                )

    def _of_two(self, kind: str, nodes: list[int], place: Place) -> bool:
        """TIE, PIN, LINK and BEAM of two nodes; whether it is one of these."""
        joints, (a, b) = self.joints, nodes
        if kind in ("TIE", "PIN"):
            turn = all(not joints.used[n] or joints.has_rotations[n] for n in nodes)
            for c in range(6 if kind == "TIE" and turn else 3):
                joints.equation([(a, c, 1.0), (b, c, -1.0)], place)
        elif kind == "LINK":
            along = (joints.place(b) - joints.place(a)).tolist()
            joints.equation([(n, c, s * along[c]) for n, s in ((a, 1.0), (b, -1.0))
                             for c in range(3)], place)  # fmt: skip
        elif kind == "BEAM" and joints.has_rotations[b]:
            joints.rigid(np.array([a]), b, range(6), place)
        else:
            return False
        return True

    def rigid_body(self, card: Card, within: Instance) -> None:
        whole, joints, place = self.whole, self.joints, card.place
        every = [whole.nodes(word, place, within)
                 for option in ("NSET", "TIENSET") if (word := card.option(option))]  # fmt: skip
        if card.option("ELSET"):
            every.append(whole.deck.nodes_of(whole.elements(card.option("ELSET"), place, within)))
        nodes = np.unique(np.concatenate([NONE, *every]))
        if not len(nodes) and not card.option("PINNSET"):
            raise place.error(f"*{card.keyword} names no nodes (NSET= or ELSET=).")
        words = card.option("REFNODE"), card.option("ROTNODE")
        reference, rotation = (whole.node(w, place, within) if w else None for w in words)
        if reference is None:  # a body that nothing else acts on: its nodes lead themselves
            reference = joints.point(joints.deck.points[nodes].mean(axis=0))
        leader = joints.leader(reference, rotation)
        own = [n for n in (reference, rotation) if n is not None]
        joints.rigid(nodes[~np.isin(nodes, own)], leader, range(6), place)
        if card.option("PINNSET"):
            pinned = whole.nodes(card.option("PINNSET"), place, within)
            joints.rigid(pinned[~np.isin(pinned, [*own, *nodes])], leader, range(3), place)

    def coupling(self, card: Card, within: Instance) -> None:
        """*COUPLING, before *KINEMATIC or *DISTRIBUTING."""
        surface = self._surface(card.needed("SURFACE"), card.place)
        node = self.whole.node(card.needed("REFNODE"), card.place, within)
        self.current = node, surface.nodes, card

    def coupled(self, card: Card, within: Instance) -> None:
        if self.current is None:
            raise card.place.error(f"*{card.keyword} without *COUPLING before it.")
        rows = card.rows()
        if rows:
            within.refuse_turned(card)
        motions = sorted({m for row in rows for m in _range(row, 0)}) or range(6)
        node, nodes, given = self.current
        if card.keyword == "KINEMATIC":
            self._rigid(node, nodes, motions, given, within)
        elif given.option("ORIENTATION") and len(motions) < 6:
            raise card.place.error("*DISTRIBUTING of some motions is read along the deck's axes.")
        else:
            self._mean(card, node, motions, nodes, np.ones(len(nodes)))

    def kinematic_coupling(self, card: Card, within: Instance) -> None:
        within.refuse_turned(card)
        node = self.whole.node(card.needed("REFNODE"), card.place, within)
        for row in card.rows():
            nodes = self.whole.nodes(row.word(0), row.place, within)
            self._rigid(node, nodes, _range(row, 1), card, within)

    def distributing_coupling(self, card: Card, within: Instance) -> None:
        """*DISTRIBUTING COUPLING: the node of an element DCOUP3D follows the mean of others."""
        groups = [self.whole.nodes(row.word(0), row.place, within) for row in card.rows()]
        weights = [row.real(1, 1.0) for row in card.rows()]
        nodes = np.concatenate([NONE, *groups])
        every = np.repeat(weights, [len(some) for some in groups])
        if not len(nodes) or every.sum() <= 0:
            raise card.place.error("*DISTRIBUTING COUPLING names no nodes with weights.")
        for kind, (reference, *_) in self.whole.beside(card, within):
            self._mean(card, reference, range(6), nodes, every)
            self.whole.deck.left[kind] -= 1

    def _rigid(
        self, node: int, nodes: IntArray, motions: Sequence[int], card: Card, within: Instance
    ) -> None:
        """Motions of nodes, along the axes of the card's ORIENTATION=, follow those of one."""
        leader, joints, name = self.joints.leader(node), self.joints, card.option("ORIENTATION")
        nodes = nodes[nodes != node]
        if not name:
            joints.rigid(nodes, leader, motions, card.place)
            return
        frames = self.orientations.at(name, card.place, within, joints.deck.points[nodes])
        of_supports = joints.frames
        joints.frames = dict(zip(nodes.tolist(), frames, strict=True))
        joints.rigid(nodes, leader, motions, card.place, own=True)
        joints.frames = of_supports

    def _mean(
        self, card: Card, node: int, motions: Sequence[int], nodes: IntArray, weights: Array
    ) -> None:
        card.needs(node not in nodes, f"the reference node of *{card.keyword} is one of the nodes "
                   "whose mean motion it follows; give the coupling a node of its "
                   "own.")  # fmt: skip
        self.joints.mean(self.joints.leader(node), motions, nodes, weights, card.place)


def _range(row: Row, start: int) -> list[int]:
    """Motions (0 to 5) from a first to a last one; all of them where none is given."""
    given = [whole_number(word, row.place) for word in row.fields[start:] if word] or [1, 6]
    first, last = given[0], given[-1]
    if not 1 <= first <= last <= 6:
        raise row.place.error(f"motions from {first} to {last}; they are counted from 1 to 6.")
    return list(range(first - 1, last))


def _along(unit: Array, terms: Sequence[tuple[int, float]]) -> list[Term]:
    """Terms (node, factor) of motions in one direction; its largest component comes first."""
    order = [int(c) for c in np.argsort(-np.abs(unit), kind="stable")]
    return [(node, c, factor * float(unit[c])) for node, factor in terms for c in order]


def _plane(nodes: list[int], x: Array, place: Place) -> Iterator[list[Term]]:
    """Nodes that stay in one plane, for small motions."""

    def normal(c: Sequence[int]) -> Array:
        return np.asarray(np.cross(x[c[1]] - x[c[0]], x[c[2]] - x[c[0]]))

    some = combinations(range(min(len(nodes), 12)), 3)
    first = max(some, key=lambda c: float(np.linalg.norm(normal(c))))
    area = float(np.linalg.norm(normal(first)))
    if area <= 1e-9 * float(np.ptp(x, axis=0).max()) ** 2:
        raise place.error("the nodes of the *MPC of type PLANE lie on one line.")
    a, b, c = x[list(first)]
    basis = np.column_stack([b - a, c - a])
    for k, node in enumerate(nodes):
        if k not in first:
            s, t = np.linalg.lstsq(basis, x[k] - a, rcond=None)[0]
            others = [(nodes[i], -w) for i, w in zip(first, (1 - s - t, s, t), strict=True)]
            yield _along(normal(first) / area, [(node, 1.0), *others])


def _straight(nodes: list[int], x: Array, place: Place) -> Iterator[list[Term]]:
    """Nodes that stay on one straight line, for small motions."""
    far = int(np.argmax(np.linalg.norm(x - x[0], axis=1)))
    axis = x[far] - x[0]
    length = float(np.linalg.norm(axis))
    place.needs(length != 0, "the nodes of the *MPC of type STRAIGHT coincide.")
    across = np.linalg.svd(axis[None] / length)[2][1:]
    for k, node in enumerate(nodes):
        if k not in (0, far):
            s = float((x[k] - x[0]) @ axis) / length**2
            for t in across:
                yield _along(t, [(node, 1.0), (nodes[0], s - 1), (nodes[far], -s)])


def _mean_rotation(nodes: list[int], x: Array, place: Place) -> Iterator[list[Term]]:
    """CalculiX: motion 1 of the last node is the mean rotation of the others about its direction.

    Its coordinates are the direction of the axis, which goes through the mean of the others.
    """
    axis = x[-1]
    length = float(np.linalg.norm(axis))
    place.needs(length != 0, "the *MPC of type MEANROT needs an axis.")
    axis = axis / length
    r = x[:-1] - x[:-1].mean(axis=0)
    r = r - np.outer(r @ axis, axis)
    size = np.einsum("pi,pi->p", r, r)
    off = size > 1e-18 * size.max()
    if not off.any():
        raise place.error("the nodes of the *MPC of type MEANROT lie on its axis.")
    if not off.all():  # as CalculiX leaves them out
        kept = np.append(np.flatnonzero(off), len(off))
        yield from _mean_rotation([nodes[k] for k in kept], x[kept], place)
        return
    turn = np.cross(axis, r) / size[:, None] / len(r)  # a·(r × u)/r²
    turn = turn - turn.mean(axis=0)  # of motions from their mean
    terms = [(n, c, -float(turn[p, c])) for p, n in enumerate(nodes[:-1]) for c in range(3)]
    yield [(nodes[-1], 0, 1.0), *terms]


#: Types of *MPC -> least number of nodes, its equations.
GEOMETRIC = {"PLANE": (4, _plane), "STRAIGHT": (3, _straight), "MEANROT": (3, _mean_rotation)}
