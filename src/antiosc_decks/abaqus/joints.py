"""Joints of Abaqus and CalculiX decks: equations, multi-point constraints, rigid bodies, ties."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from itertools import combinations

import numpy as np

from antiosc.io.deck import IntArray, Place, real_number, whole_number
from antiosc_decks.abaqus.assembly import Instance, Whole
from antiosc_decks.abaqus.cards import Card
from antiosc_decks.abaqus.mesh import nodes_of
from antiosc_decks.abaqus.ties import Surface, surfaces_of, tie
from antiosc_decks.model.constraints import Constraints, Term

#: Most terms of an equation: more are damage.
LONGEST_EQUATION = 1_000_000
Cards = Sequence[tuple[Card, Instance]]


def read_joints(whole: Whole, joints: Constraints, cards: Cards) -> None:
    """Give `joints` what the cards say."""
    surfaces = surfaces_of(whole, cards)

    def equation(card: Card, within: Instance) -> None:
        within.refuse_turned(card)
        for terms, place in _equations(whole, card, within):
            joints.equation(terms, place)

    def ties(card: Card, within: Instance) -> None:
        for fields, place in card.rows():
            if len(fields) < 2:
                continue
            slave, master = (_surface(surfaces, word, place) for word in fields[:2])
            tolerance = card.option("POSITIONTOLERANCE")
            reach = real_number(tolerance, place) if tolerance else None
            if told := tie(joints, slave, master, reach, place):
                whole.deck.told.append(told)

    readers: dict[str, Callable[[Card, Instance], None]] = {
        "EQUATION": equation,
        "MPC": lambda card, within: _mpc(whole, joints, card, within),
        "RIGIDBODY": lambda card, within: _rigid(whole, joints, card, within),
        "TIE": ties,
    }
    couplings = _Couplings(whole, joints, surfaces)
    for card, within in cards:
        if card.keyword in readers:
            readers[card.keyword](card, within)
        else:
            couplings.read(card, within)


def _surface(surfaces: dict[str, Surface], name: str, place: Place) -> Surface:
    if name.upper() not in surfaces:
        raise place.error(f"there is no surface {name!r} (*SURFACE, NAME=).")
    return surfaces[name.upper()]


def _one(whole: Whole, word: str, place: Place, within: Instance) -> int:
    """The node that a number or a set of one node names."""
    nodes = whole.nodes(word, place, within)
    if len(nodes) != 1:
        raise place.error(f"{word!r} must be one node; it is {len(nodes)}.")
    return int(nodes[0])


# --- Equations ------------------------------------------------------------------------------------


def _equations(whole: Whole, card: Card, within: Instance) -> Iterator[tuple[list[Term], Place]]:
    rows = iter([(fields, place) for fields, place in card.rows() if fields])
    for fields, place in rows:
        count = whole_number(fields[0], place)
        if not 0 < count <= LONGEST_EQUATION:
            raise place.error(f"an *EQUATION of {count} terms.")
        words: list[str] = []
        at = place
        while len(words) < 3 * count:
            more = next(rows, None)
            if more is None:
                found = len(words) // 3
                raise at.error(f"the *EQUATION ends after {found} of {count} terms.")
            words += more[0] + [""] * (-len(more[0]) % 3)
            at = more[1]
        yield from _of_sets(whole, words[: 3 * count], at, within)


def _of_sets(
    whole: Whole, words: list[str], place: Place, within: Instance
) -> Iterator[tuple[list[Term], Place]]:
    """One equation, or one for each node of the sets that stand first."""
    triples = [words[k : k + 3] for k in range(0, len(words), 3)]
    nodes = [whole.nodes(word, place, within) for word, _, _ in triples]
    lengths = {len(some) for some in nodes}
    if 0 in lengths:
        word = next(w for (w, _, _), some in zip(triples, nodes, strict=True) if not len(some))
        raise place.error(f"*EQUATION names {word!r}, a set without nodes.")
    if len(nodes[0]) > 1 and lengths - {1}:
        largest = [some for some in nodes if len(some) > 1]
        if len(largest) > 1:
            raise place.error(
                "*EQUATION between several sets of nodes pairs them by their order, "
                "which is not kept here; write one equation for each pair."
            )
    for k in range(len(nodes[0])):
        terms = []
        for (_, dof, factor), some in zip(triples, nodes, strict=True):
            motion = whole_number(dof, place) - 1
            if not 0 <= motion < 6:
                raise place.error(f"*EQUATION acts on motions from 1 to 6; got {dof}.")
            terms.append((int(some[k if len(some) > 1 else 0]), motion, real_number(factor, place)))
        if not terms[0][2]:
            raise place.error("the first term of *EQUATION has the coefficient 0.")
        yield terms, place


# --- Multi-point constraints ----------------------------------------------------------------------


def _mpc(whole: Whole, joints: Constraints, card: Card, within: Instance) -> None:
    lists: list[tuple[str, list[str], Place]] = []
    for fields, place in card.rows():
        words = [word for word in fields if word]
        if words and not (words[0].isdigit() and lists):
            lists.append((words[0].upper(), words[1:], place))
        elif words:  # a continued list
            lists[-1][1].extend(word for word in words if word != "0")
    for kind, words, place in lists:
        nodes = [int(n) for w in words for n in whole.nodes(w, place, within)]
        if kind == "PLANE":
            _plane(joints, list(dict.fromkeys(nodes)), place)
        elif kind == "STRAIGHT":
            _straight(joints, list(dict.fromkeys(nodes)), place)
        elif kind == "MEANROT" or (kind == "1" and "USER" in card.options):  # as cgx writes it
            _mean_rotation(joints, list(dict.fromkeys(nodes)), place)
        elif kind in ("TIE", "PIN") and len(nodes) == 2:
            for c in range(3):
                joints.equation([(nodes[0], c, 1.0), (nodes[1], c, -1.0)], place)
            for c in range(3, 6 if kind == "TIE" else 3):
                if all(not joints.used[n] or joints.has_rotations[n] for n in nodes):
                    joints.equation([(nodes[0], c, 1.0), (nodes[1], c, -1.0)], place)
        elif kind == "BEAM" and len(nodes) == 2 and joints.has_rotations[nodes[1]]:
            joints.rigid(np.array(nodes[:1]), nodes[1], range(6), place)
        elif kind == "LINK" and len(nodes) == 2:
            along = joints.place(nodes[1]) - joints.place(nodes[0])
            terms = [(nodes[0], c, float(along[c])) for c in range(3)]
            joints.equation([*terms, *((nodes[1], c, -a) for _, c, a in terms)], place)
        else:
            raise place.error(
                f"the *MPC of type {kind} with {len(nodes)} nodes is not supported here "
                "and would change the result; write it as *EQUATION, or remove it."
            )


def _plane(joints: Constraints, nodes: list[int], place: Place) -> None:
    """Nodes that stay in one plane, for small motions."""
    x = np.array([joints.place(node) for node in nodes])
    if len(nodes) < 4:
        raise place.error("the *MPC of type PLANE needs four nodes or more.")
    some = range(min(len(nodes), 12))
    area = {c: float(np.linalg.norm(_normal(x[list(c)]))) for c in combinations(some, 3)}
    first = max(area, key=lambda c: area[c])
    if area[first] <= 1e-9 * float(np.ptp(x, axis=0).max()) ** 2:
        raise place.error("the nodes of the *MPC of type PLANE lie on one line.")
    normal = _normal(x[list(first)]) / area[first]
    basis = np.column_stack([x[first[1]] - x[first[0]], x[first[2]] - x[first[0]]])
    along = [int(k) for k in np.argsort(-np.abs(normal), kind="stable")]
    for k, node in enumerate(nodes):
        if k in first:
            continue
        s, t = np.linalg.lstsq(basis, x[k] - x[first[0]], rcond=None)[0]
        weights = zip(first, (1 - s - t, s, t), strict=True)
        terms = [(node, c, float(normal[c])) for c in along]
        terms += [(nodes[i], c, -float(w * normal[c])) for i, w in weights for c in along]
        joints.equation(terms, place)


def _normal(x: np.ndarray) -> np.ndarray:
    return np.asarray(np.cross(x[1] - x[0], x[2] - x[0]))


def _straight(joints: Constraints, nodes: list[int], place: Place) -> None:
    """Nodes that stay on one straight line, for small motions."""
    x = np.array([joints.place(node) for node in nodes])
    if len(nodes) < 3:
        raise place.error("the *MPC of type STRAIGHT needs three nodes or more.")
    far = int(np.argmax(np.linalg.norm(x - x[0], axis=1)))
    axis = x[far] - x[0]
    length = float(np.linalg.norm(axis))
    if length == 0:
        raise place.error("the nodes of the *MPC of type STRAIGHT coincide.")
    unit = axis / length
    across = np.linalg.svd(unit[None])[2][1:]
    for k, node in enumerate(nodes):
        if k in (0, far):
            continue
        s = float((x[k] - x[0]) @ axis) / length**2
        for t in across:
            along = [int(c) for c in np.argsort(-np.abs(t), kind="stable")]
            terms = [(node, c, float(t[c])) for c in along]
            terms += [(nodes[0], c, -(1 - s) * float(t[c])) for c in along]
            terms += [(nodes[far], c, -s * float(t[c])) for c in along]
            joints.equation(terms, place)


def _mean_rotation(joints: Constraints, nodes: list[int], place: Place) -> None:
    """CalculiX: motion 1 of the last node is the mean rotation of the others about its direction.

    Its coordinates are the direction of the axis, which goes through the mean of the others.
    """
    *own, last = nodes
    axis = joints.place(last)
    length = float(np.linalg.norm(axis))
    if length == 0 or len(own) < 2:
        raise place.error("the *MPC of type MEANROT needs an axis and two nodes or more.")
    axis = axis / length
    x = np.array([joints.place(node) for node in own])
    r = x - x.mean(axis=0)
    r = r - np.outer(r @ axis, axis)
    size = np.einsum("pi,pi->p", r, r)
    if size.min() <= 1e-18 * max(size.max(), 1e-300):
        raise place.error("a node of the *MPC of type MEANROT lies on its axis.")
    turn = np.cross(axis, r) / size[:, None] / len(own)  # a·(r × u)/r²
    turn = turn - turn.mean(axis=0)  # of motions from their mean
    terms = [(node, c, -float(turn[p, c])) for p, node in enumerate(own) for c in range(3)]
    joints.equation([(last, 0, 1.0), *terms], place)


# --- Rigid bodies and couplings -------------------------------------------------------------------


def _rigid(whole: Whole, joints: Constraints, card: Card, within: Instance) -> None:
    nodes = _nodes_of_sets(whole, card, within)
    reference, rotation_node = (
        _one(whole, card.option(name), card.place, within) if card.option(name) else None
        for name in ("REFNODE", "ROTNODE")
    )
    if reference is None:  # a body that nothing else acts on: its nodes lead themselves
        reference = joints.point(joints.deck.points[nodes].mean(axis=0))
    leader = joints.leader(reference, rotation_node)
    own = [n for n in (reference, rotation_node) if n is not None]
    joints.rigid(nodes[~np.isin(nodes, own)], leader, range(6), card.place)
    if card.option("PINNSET"):
        pinned = whole.nodes(card.option("PINNSET"), card.place, within)
        joints.rigid(pinned[~np.isin(pinned, [*own, *nodes])], leader, range(3), card.place)


def _nodes_of_sets(whole: Whole, card: Card, within: Instance) -> IntArray:
    found = [np.zeros(0, dtype=np.int64)]
    for name in ("NSET", "TIENSET"):
        if card.option(name):
            found.append(whole.nodes(card.option(name), card.place, within))
    if card.option("ELSET"):
        elements = whole.elements(card.option("ELSET"), card.place, within)
        found.append(nodes_of(whole.deck, elements))
    nodes = np.unique(np.concatenate(found))
    if not len(nodes) and not card.option("PINNSET"):
        raise card.place.error(f"*{card.keyword} names no nodes (NSET= or ELSET=).")
    return nodes


class _Couplings:
    """*COUPLING with *KINEMATIC or *DISTRIBUTING, and Abaqus' older cards for the same."""

    def __init__(self, whole: Whole, joints: Constraints, surfaces: dict[str, Surface]) -> None:
        self.whole, self.joints, self.surfaces = whole, joints, surfaces
        self.current: tuple[int, IntArray, Card] | None = None

    def read(self, card: Card, within: Instance) -> None:
        """One card."""
        match card.keyword:
            case "COUPLING":
                name = card.needed("SURFACE")
                surface = _surface(self.surfaces, name, card.place)
                node = _one(self.whole, card.needed("REFNODE"), card.place, within)
                self.current = (node, surface.nodes, card)
            case "KINEMATIC" | "DISTRIBUTING":
                if self.current is None:
                    raise card.place.error(f"*{card.keyword} without *COUPLING before it.")
                if any(fields for fields, _ in card.rows()):
                    within.refuse_turned(card)
                node, nodes, _ = self.current
                self._couple(card, node, nodes, card.keyword == "KINEMATIC")
            case "KINEMATICCOUPLING":
                within.refuse_turned(card)
                node = _one(self.whole, card.needed("REFNODE"), card.place, within)
                for fields, place in card.rows():
                    if fields:
                        nodes = self.whole.nodes(fields[0], place, within)
                        motions = _range(fields[1:], place)
                        self._rigid(node, nodes, motions, place)

    def _couple(self, card: Card, node: int, nodes: IntArray, kinematic: bool) -> None:
        ranges = [(_range(f, p)) for f, p in card.rows() if f]
        motions = sorted({m for some in ranges for m in some}) or list(range(6))
        if kinematic:
            self._rigid(node, nodes, motions, card.place)
            return
        refuse_own_follower(node, nodes, card)
        self.joints.mean(self.joints.leader(node), motions, nodes, np.ones(len(nodes)), card.place)

    def _rigid(self, node: int, nodes: IntArray, motions: Sequence[int], place: Place) -> None:
        leader = self.joints.leader(node)
        self.joints.rigid(nodes[nodes != node], leader, motions, place)


def refuse_own_follower(node: int, nodes: Sequence[int] | IntArray, card: Card) -> None:
    """MeshError for a reference node that is one of the nodes whose mean motion it follows."""
    if node in nodes:
        raise card.place.error(
            f"the reference node of *{card.keyword} is one of the nodes whose mean "
            "motion it follows; give the coupling a node of its own."
        )


def _range(fields: Sequence[str], place: Place) -> list[int]:
    """Motions (0 to 5) from a first to a last one."""
    given = [whole_number(word, place) for word in fields if word]
    if not given:
        return list(range(6))
    first, last = given[0], given[-1]
    if not 1 <= first <= last <= 6:
        raise place.error(f"motions from {first} to {last}; they are counted from 1 to 6.")
    return list(range(first - 1, last))
