"""Joints of Abaqus and CalculiX decks: equations, multi-point constraints, rigid bodies, ties."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field
from typing import NamedTuple

import numpy as np

from antiosc.io.conversion import Array, Block, IntArray
from antiosc.io.neutral import CORNERS, EDGES, MotionTerm
from antiosc_decks.abaqus_assembly import NO_ROWS, AbaqusDeck
from antiosc_decks.abaqus_cards import Card, Row
from antiosc_decks.abaqus_sections import Orientations
from antiosc_decks.constraints import DeckConstraints, Motions
from antiosc_decks.entries import DeckPlace, real_number, whole_number

#: Corners of the faces S1, S2, … of solids.
SOLID_FACES = {
    shape: tuple(tuple(map(int, face)) for face in faces.split())
    for shape, faces in (
        ("hexahedron", "0123 4765 0451 1562 2673 3740"), ("wedge", "012 354 0341 1452 2530"),
        ("tetra", "012 031 132 230"), ("pyramid", "0123 041 142 243 340"),
    )
}  # fmt: skip


@dataclass
class DeckFaces:
    """Faces as (corner nodes, mid-side nodes; -1: none), in order around each face."""

    faces: list[tuple[IntArray, IntArray]] = field(default_factory=list)
    #: arrays of rows of nodes; together all nodes of the surface
    node_tables: list[IntArray] = field(default_factory=list)

    @property
    def nodes(self) -> IntArray:
        """Rows of all nodes of the surface, each once."""
        nodes = np.unique(np.concatenate([NO_ROWS, *self.node_tables]))
        return nodes[nodes >= 0]

    @property
    def node_rows(self) -> list[IntArray]:
        """Nodes of each face: all, or the corners where a mid-side node is missing."""
        whole = ((c, m if (m >= 0).all() else m[:0]) for c, m in self.faces)
        return [np.concatenate(pair) for pair in whole]


def surfaces_of(assembly: AbaqusDeck, cards: Sequence[Card]) -> dict[str, DeckFaces]:
    """The surfaces of a deck by their names in upper case."""
    surfaces: dict[str, DeckFaces] = {}
    for card in cards:
        if card.keyword != "SURFACE" or not card.option("NAME"):
            continue
        name = (card.scope.prefix + card.option("NAME")).upper()
        surface = surfaces.setdefault(name, DeckFaces())
        for row in card.rows():
            if card.option("TYPE").upper().startswith("NODE"):
                surface.node_tables.append(row.nodes())
                continue
            elements = card.scope.elements(row.word(0), row.place)
            side = row.word(1).upper()
            for block, _ in assembly.deck.blocks_of(elements):
                faces = _faces(block, side, row.place)
                surface.faces += faces
                edge = _edge_index(block, side, row.place)
                if edge is None:
                    surface.node_tables += [nodes for face in faces for nodes in face]
                else:
                    ends = block.corners[:, list(EDGES[block.shape][edge])]
                    surface.node_tables += [ends.ravel(), block.mids[:, edge : edge + 1].ravel()]

    return surfaces


def _edge_index(block: Block, side: str, place: DeckPlace) -> int | None:
    """Index of the edge that `side` names (E1 …; S3 …, of plane elements S1 …); else None."""
    if block.shape not in ("triangle", "quad") or not side[1:].isdigit():
        return None
    edge = int(side[1:]) - (1 if side[0] == "E" or block.role.startswith("plane") else 3)
    place.require(edge < CORNERS[block.shape], f"{side!r} is no edge of a {block.shape}.")
    return edge if edge >= 0 else None


def _faces(block: Block, side: str, place: DeckPlace) -> list[tuple[IntArray, IntArray]]:
    """(corner nodes, mid-side nodes) of the named side of each element of a block."""
    corners = tuple(range(CORNERS[block.shape]))
    if block.shape not in ("triangle", "quad"):
        sides = SOLID_FACES.get(block.shape, ())
        number = int(side[1:]) if side[:1] == "S" and side[1:].isdigit() else 0
        remedy = f"it must be S1 to S{len(sides)}" if sides else "it has none"
        fault = f"{side!r} is no side of a {block.shape}; {remedy}."
        place.require(1 <= number <= len(sides), fault)
        corners = sides[number - 1]
    edges = [frozenset(edge) for edge in EDGES[block.shape]]
    ring = zip(corners, (*corners[1:], corners[0]), strict=True)
    edge_order = [edges.index(frozenset(pair)) for pair in ring] if block.mids.shape[1] else []
    return list(zip(block.corners[:, list(corners)], block.mids[:, edge_order], strict=True))


#: Default tolerance of a tie, as a share of the master's mean edge length (Abaqus).
TIE_REACH = 0.05
#: Largest distance of a point of a curved face from its centre, over that of its nodes.
FACE_BULGE_RATIO = 1.5
#: Nodes whose distances from a line are below this share of the size of a deck lie on it.
COLLINEAR_TOLERANCE = 1e-6
#: Most contact pairs that are listed.
MAX_LISTED_PAIRS = 6
#: Most terms of an equation: more are damage.
MAX_EQUATION_TERMS = 1_000_000
#: The degree of freedom that is the temperature.
TEMPERATURE_DOF = "11"
#: Number of nearest faces onto which each node is projected.
NEAREST_FACE_COUNT = 12
#: The projection of points onto 1000 random faces of each kind, bent by 2 % of their size, ended
#: within 5e-7 of the size after this many steps.
NEWTON_STEPS = 12


class TiedNode(NamedTuple):
    """A tied node, the nodes of the face at which it lies, and their shape functions there."""

    node: int
    leaders: IntArray
    weights: Array


def find_tied_nodes(
    joints: DeckConstraints, slave: DeckFaces, master: DeckFaces, tolerance: float | None
) -> tuple[list[TiedNode], float]:
    """(nodes of `slave` near a face of `master`, without nodes of `master`; the reach).

    `tolerance`: the reach in the deck's unit; None: a share of the mean edge of `master`.
    """
    faces = [(nodes, np.array([joints.place(int(n)) for n in nodes])) for nodes in master.node_rows]
    size = mean_edge_length(joints, master)
    centres = np.array([x.mean(axis=0) for _, x in faces])
    around = max(float(np.linalg.norm(x - x.mean(axis=0), axis=1).max()) for _, x in faces)
    reach = (TIE_REACH * size if tolerance is None else tolerance) + 1e-9 * size
    candidates = slave.nodes[~np.isin(slave.nodes, master.nodes)].tolist()
    tied = []
    for node in candidates:
        point = joints.place(node)
        away = np.linalg.norm(centres - point, axis=1)
        if away.min() > FACE_BULGE_RATIO * around + reach:
            continue
        order = np.argsort(away, kind="stable")[:NEAREST_FACE_COUNT]
        distance, leaders, weights = _nearest_face([faces[k] for k in order], point)
        if distance <= reach:
            tied.append(TiedNode(node, leaders, weights))
    return tied, reach


def mean_edge_length(joints: DeckConstraints, surface: DeckFaces) -> float:
    """Mean length of the edges of faces; `joints` knows the places of the nodes."""
    rings = [np.array([joints.place(int(n)) for n in corners]) for corners, _ in surface.faces]
    edges = [np.linalg.norm(x - np.roll(x, 1, axis=0), axis=1).mean() for x in rings]
    return float(np.mean(edges))


def tie_nodes(joints: DeckConstraints, tied: Sequence[TiedNode], place: DeckPlace) -> None:
    """Add constraints that make tied nodes follow their faces; also in rotation if both have it."""
    for node, leaders, weights in tied:
        with_rotations = bool(joints.has_rotations[node] and joints.has_rotations[leaders].all())
        followers = [(int(n), -float(w)) for n, w in zip(leaders, weights, strict=True)]
        for c in range(6 if with_rotations else 3):
            joints.add_equation([(node, c, 1.0), *((n, c, w) for n, w in followers)], place)


def _nearest_face(
    faces: Sequence[tuple[IntArray, Array]], point: Array
) -> tuple[float, IntArray, Array]:
    """(distance to the nearest of `faces`, its nodes, their shape functions at the projection)."""
    best: tuple[float, IntArray, Array] = np.inf, NO_ROWS, np.zeros(0)
    for nodes, x in faces:
        weights = _shape_functions_at_projection(x, point)
        distance = float(np.linalg.norm(weights @ x - point))
        if distance < best[0] * (1 - 1e-9) - 1e-15:
            best = distance, nodes, weights
    return best


def _shape_functions_at_projection(x: Array, point: Array) -> Array:
    """Shape functions of a face's nodes `x` at the point of the face nearest to `point`."""
    triangle = len(x) in (3, 6)
    xi = np.full(2, 1 / 3) if triangle else np.zeros(2)
    for _ in range(NEWTON_STEPS):
        values, slopes = _shape_functions(len(x), xi)
        step = np.linalg.lstsq((slopes.T @ x).T, point - values @ x, rcond=None)[0]
        new = np.clip(xi + step, 0.0 if triangle else -1.0, 1.0)
        if triangle:
            new /= max(float(new.sum()), 1.0)
        if np.abs(new - xi).max() < 1e-12:
            break
        xi = new
    return _shape_functions(len(x), xi)[0]


def _shape_functions(count: int, xi: Array) -> tuple[Array, Array]:
    """Values (n,) and derivatives (n, 2) of the functions of a face of n nodes at `xi`."""
    r, s = xi
    if count in (3, 6):
        L = np.array([1 - r - s, r, s])
        dL = np.array([[-1.0, -1], [1, 0], [0, 1]])
        if count == 3:
            return L, dL
        a, b = [0, 1, 2], [1, 2, 0]
        edges = 4 * (L[a, None] * dL[b] + L[b, None] * dL[a])
        values = np.concatenate([L * (2 * L - 1), 4 * L[a] * L[b]])
        return values, np.vstack([(4 * L - 1)[:, None] * dL, edges])
    c = np.array([[-1.0, -1], [1, -1], [1, 1], [-1, 1]])
    a, b = (1 + c * xi).T
    values = a * b / 4
    slopes = c * np.stack([b, a], axis=1) / 4
    if count == 4:
        return values, slopes
    p, q = 1 - xi**2
    mids = np.array([p * (1 - s), (1 + r) * q, p * (1 + s), (1 - r) * q]) / 2
    by_r = [-r * (1 - s), q / 2, -r * (1 + s), -q / 2]
    by_s = [-p / 2, -s * (1 + r), p / 2, -s * (1 - r)]
    dmids = np.stack([by_r, by_s], axis=1)
    values -= (mids + np.roll(mids, 1)) / 2
    slopes -= (dmids + np.roll(dmids, 1, axis=0)) / 2

    return np.concatenate([values, mids]), np.vstack([slopes, dmids])


def read_joints(assembly: AbaqusDeck, joints: DeckConstraints, cards: Sequence[Card]) -> None:
    """Add the constraints of the cards to `joints`; contact pairs come last."""
    reader = _JointReader(assembly, joints, surfaces_of(assembly, cards))
    for card in cards:
        if card.keyword in JOINT_READERS:
            JOINT_READERS[card.keyword](reader, card)

    for card in cards:
        if card.keyword == "CONTACTPAIR" and not assembly.deck.without_contact:
            reader.contact_pair(card)
    reader.report_contact()

    assembly.deck.skipped = Counter({kind: n for kind, n in assembly.deck.skipped.items() if n})


class _JointReader:
    """Reads cards that join nodes: one method for each card."""

    def __init__(
        self, assembly: AbaqusDeck, joints: DeckConstraints, surfaces: dict[str, DeckFaces]
    ) -> None:
        self.assembled = assembly
        self.joints = joints
        self.surfaces = surfaces
        self.orientations = Orientations(assembly.cards)
        #: of the last *COUPLING: reference node, nodes, card
        self.current: tuple[int, IntArray, Card] | None = None
        #: names of the contact pairs that are tied, with their numbers of nodes, and of open ones
        self.tied: list[str] = []
        self.open: list[str] = []

    def _surface(self, name: str, place: DeckPlace) -> DeckFaces:
        """The surface with this name."""
        message = f"there is no surface {name!r} (*SURFACE, NAME=)."
        return place.look_up(self.surfaces, name.upper(), message)

    def tie(self, card: Card) -> None:
        """*TIE: slave nodes follow master faces by shape functions; reports nodes out of reach."""
        word = card.option("POSITIONTOLERANCE")
        tolerance = real_number(word, card.place) if word else None
        for row in card.rows():
            if len(row.fields) < 2:
                continue
            slave, master = (self._surface(name, row.place) for name in row.fields[:2])
            row.needs(master.faces, "the master surface of *TIE must be of faces of elements.")
            tied, reach = find_tied_nodes(self.joints, slave, master, tolerance)
            tie_nodes(self.joints, tied, row.place)

            nodes = slave.nodes
            untied = int((~np.isin(nodes, master.nodes)).sum()) - len(tied)
            far = f"further than {reach:.3g} from the master surface (POSITION TOLERANCE=)"
            row.needs(untied != len(nodes), f"*TIE joins nothing: all slave nodes lie {far}.")
            if untied:
                count = f"{untied} of {len(nodes)} slave nodes of *TIE are not tied"
                self.assembled.deck.remarks.append(f"{row.place}: {count}: they lie {far}.")

    def contact_pair(self, card: Card) -> None:
        """*CONTACT PAIR: surfaces that touch are tied, as in a joint that stays pressed."""
        for row in card.rows():
            names = row.fields[:2]
            sides = [self.surfaces.get(name.upper()) for name in names]
            first, second = sides if len(sides) == 2 else (None, None)
            if first is None or second is None or first is second:  # rigid, or touches itself
                continue
            if all(self.joints.used_nodes[side.nodes].any() for side in (first, second)):
                count = self._tie_touching(first, second, row.place)
                text = f"{' and '.join(names)}" + f" at {count} nodes" * bool(count)
                (self.tied if count else self.open).append(text)

    def _tie_touching(self, first: DeckFaces, second: DeckFaces, place: DeckPlace) -> int:
        """Tie two surfaces where they touch; return the number of tied nodes, 0 for a hinge.

        The slave is the surface with more nodes on the other, usually the finer one. Nodes on one
        line would make a hinge and are not tied.
        """
        joints = self.joints
        reach = TIE_REACH * min(
            mean_edge_length(joints, side) for side in (first, second) if side.faces
        )
        orders = [(a, b) for a, b in ((first, second), (second, first)) if b.faces]
        tied = max((find_tied_nodes(joints, a, b, reach)[0] for a, b in orders), key=len)

        points = self.assembled.deck.points
        x = np.array([points[one.node] for one in tied]).reshape(-1, 3)
        plane = not np.ptp(points[:, 2])
        size = float(np.ptp(points, axis=0).max())
        arms = x - x[:1]
        if not len(x) or np.linalg.matrix_rank(arms, tol=COLLINEAR_TOLERANCE * size) < 2 - plane:
            return 0

        led = {terms[0][0] for terms in joints.equations}
        tied = [one for one in tied if one.node not in led]
        for one in tied:  # onto the face: at a distance from it no rotation would be free
            points[one.node] = one.weights @ points[one.leaders]
        tie_nodes(joints, tied, place)
        return len(tied)

    def report_contact(self) -> None:
        """Report which contact pairs are tied, and which are open."""
        remarks = self.assembled.deck.remarks
        if self.tied:
            pairs = f"contact pairs that touch are tied: {_shortened_list(self.tied)}. They"
            remarks.append(f'{pairs} neither open nor slide; contact "apart" leaves them out.')
        if self.open:
            pairs = _shortened_list(self.open)
            remarks.append(f"contact that is open at first is left out: {pairs}.")

    def equations(self, card: Card) -> None:
        """*EQUATION; the terms of one equation may continue on the following lines."""
        card.refuse_rotated()
        rows = iter(card.rows())
        for row in rows:
            count = whole_number(row.word(0), row.place)
            row.needs(0 < count <= MAX_EQUATION_TERMS, f"an *EQUATION of {count} terms.")
            words: list[str] = []
            while len(words) < 3 * count:
                further = next(rows, None)
                if further is None:
                    ended = f"the *EQUATION ends after {len(words) // 3} of {count} terms."
                    raise row.place.error(ended)
                row = further
                words += row.fields + [""] * (-len(row.fields) % 3)
            if set(words[1 : 3 * count : 3]) == {TEMPERATURE_DOF}:  # moves nothing
                continue
            for terms in self._expanded_equations(words[: 3 * count], row):
                self.joints.add_equation(terms, row.place)

    def _expanded_equations(self, term_words: list[str], row: Row) -> Iterator[list[MotionTerm]]:
        """Yield the equation, or one for each node of the set that a term names."""
        place = row.place
        triples = [term_words[k : k + 3] for k in range(0, len(term_words), 3)]
        nodes = [row.card.scope.nodes(word, place) for word, _, _ in triples]
        for (word, _, _), members in zip(triples, nodes, strict=True):
            place.require(len(members), f"*EQUATION names {word!r}, a set without nodes.")
        single = len(nodes[0]) == 1 or sum(len(members) > 1 for members in nodes) == 1
        place.require(single, "*EQUATION pairs them by their order, which is lost: write one each.")
        for k in range(len(nodes[0])):
            terms = []
            for (_, dof, factor), members in zip(triples, nodes, strict=True):
                motion = whole_number(dof, place) - 1
                place.require(0 <= motion < 6, f"*EQUATION acts on motions from 1 to 6; got {dof}.")
                node = int(members[k if len(members) > 1 else 0])
                terms.append((node, motion, real_number(factor, place)))
            place.require(terms[0][2], "the first term of *EQUATION has the coefficient 0.")
            yield terms

    def mpc(self, card: Card) -> None:
        """*MPC; a list of nodes may continue on the following lines."""
        lists: list[tuple[str, list[str], DeckPlace]] = []
        for row in card.rows():
            words = [word for word in row.fields if word]
            if not (words[0].isdigit() and lists):
                lists.append((words[0].upper(), words[1:], row.place))
            else:  # a continued list
                lists[-1][1].extend(word for word in words if word != "0")
        for kind, words, place in lists:
            nodes = [int(n) for w in words for n in card.scope.nodes(w, place)]
            pairs = [[node, nodes[-1]] for node in nodes[:-1]]  # a set, and the node it follows
            is_single = len(nodes) == 2 or (len(words) == 2 and words[1].isdigit())
            read = is_single and all([self._join_pair(kind, pair, place) for pair in pairs])
            label = f"the *MPC of type {kind} with {len(nodes)} nodes"
            place.require(read, f"{label} is not supported here; write it as *EQUATION.")

    def _join_pair(self, kind: str, nodes: list[int], place: DeckPlace) -> bool:
        """Apply a TIE, PIN, LINK or BEAM between two nodes; False if `kind` is none of these."""
        joints = self.joints
        a, b = nodes
        place.require(a != b, f"the *MPC of type {kind} joins a node with itself.")
        if kind in ("TIE", "PIN"):
            with_rotations = all(not joints.used_nodes[n] or joints.has_rotations[n] for n in nodes)
            for c in range(6 if kind == "TIE" and with_rotations else 3):
                joints.add_equation([(a, c, 1.0), (b, c, -1.0)], place)
        elif kind == "LINK":
            terms, _ = joints.elongation_terms(a, b, place)
            joints.add_equation(terms, place)
        elif kind == "BEAM" and (joints.has_rotations[b] or not joints.used_nodes[b]):
            joints.add_rigid(np.array([a]), joints.leader_point(b), range(6), {})
        else:
            return False
        return True

    def rigid_body(self, card: Card) -> None:
        """*RIGID BODY: nodes that follow a reference node; nodes of PINNSET= without rotation."""
        joints = self.joints
        place = card.place
        groups = [card.nodes(option) for option in ("NSET", "TIENSET") if card.option(option)]
        if card.option("ELSET"):
            groups.append(joints.deck.nodes_of(card.elements()))
        nodes = np.unique(np.concatenate([NO_ROWS, *groups]))
        has_nodes = len(nodes) or card.option("PINNSET")
        card.needs(has_nodes, f"{card.label} names no nodes (NSET= or ELSET=).")
        words = card.option("REFNODE"), card.option("ROTNODE")
        reference, rotation = (card.scope.node(w, place) if w else None for w in words)
        if reference is None:  # a body that nothing else acts on: its nodes lead themselves
            reference = joints.add_point(joints.deck.points[nodes].mean(axis=0))
        leader = joints.leader_point(reference, rotation)
        references = [n for n in (reference, rotation) if n is not None]
        joints.add_rigid(nodes[~np.isin(nodes, references)], leader, range(6), {})
        if card.option("PINNSET"):
            pinned = card.nodes("PINNSET")
            joints.add_rigid(pinned[~np.isin(pinned, [*references, *nodes])], leader, range(3), {})

    def coupling(self, card: Card) -> None:
        """*COUPLING: store its surface for the *KINEMATIC or *DISTRIBUTING card that follows."""
        surface = self._surface(card.required_option("SURFACE"), card.place)
        node = card.scope.node(card.required_option("REF NODE"), card.place)
        self.current = node, surface.nodes, card

    def couple_surface(self, card: Card) -> None:
        """*KINEMATIC or *DISTRIBUTING: couple the surface of the last *COUPLING."""
        if self.current is None:
            raise card.place.error(f"{card.label} without *COUPLING before it.")
        if rows := card.rows():
            card.refuse_rotated()
        motions = sorted({m for row in rows for m in _motion_range(row, 0)}) or range(6)
        node, nodes, of = self.current
        if card.keyword == "KINEMATIC":
            self._add_rigid(node, nodes, motions, of)
            return
        axes = None
        if name := of.option("ORIENTATION"):
            (axes,) = self.orientations.directions_at(name, of, self.joints.place(node)[None])
        self._add_mean(card, node, motions, nodes, np.ones(len(nodes)), axes)

    def kinematic_coupling(self, card: Card) -> None:
        """*KINEMATIC COUPLING: nodes that follow the reference node in some motions."""
        card.refuse_rotated()
        node = card.scope.node(card.required_option("REF NODE"), card.place)
        for row in card.rows():
            self._add_rigid(node, row.nodes(), _motion_range(row, 1), card)

    def distributing_coupling(self, card: Card) -> None:
        """*DISTRIBUTING COUPLING: a DCOUP3D node follows the weighted mean of others."""
        groups = [row.nodes() for row in card.rows()]
        weights = [row.real(1, 1.0) for row in card.rows()]
        nodes = np.concatenate([NO_ROWS, *groups])
        node_weights = np.repeat(weights, [len(members) for members in groups])
        weighted = len(nodes) and node_weights.sum() > 0
        card.needs(weighted, "*DISTRIBUTING COUPLING names no nodes with weights.")
        for kind, (reference, *_) in self.assembled.non_cells_of(card):
            self._add_mean(card, reference, range(6), nodes, node_weights)
            self.assembled.deck.skipped[kind] -= 1

    def _add_rigid(self, node: int, nodes: IntArray, motions: Motions, card: Card) -> None:
        """Let nodes follow a reference node in motions along the axes of ORIENTATION=."""
        leader = self.joints.leader_point(node)
        frames = {}
        nodes = nodes[nodes != node]
        if name := card.option("ORIENTATION"):
            axes = self.orientations.directions_at(name, card, self.joints.deck.points[nodes])
            frames = dict(zip(nodes.tolist(), axes, strict=True))
        self.joints.add_rigid(nodes, leader, motions, frames)

    def _add_mean(
        self,
        card: Card,
        node: int,
        motions: Motions,
        nodes: IntArray,
        weights: Array,
        axes: Array | None = None,
    ) -> None:
        """Let a reference node follow the weighted mean motion of nodes, along `axes`."""
        own = f"{card.label} follows its reference node; give it a node of its own."
        card.needs(node not in nodes, own)
        leader = self.joints.leader_point(node)
        self.joints.mean(leader, motions, nodes, weights, card.place, axes=axes)


#: Card -> what reads it.
JOINT_READERS: dict[str, Callable[[_JointReader, Card], None]] = {
    "EQUATION": _JointReader.equations,
    "MPC": _JointReader.mpc,
    "RIGIDBODY": _JointReader.rigid_body,
    "TIE": _JointReader.tie,
    "COUPLING": _JointReader.coupling,
    **dict.fromkeys(("KINEMATIC", "DISTRIBUTING"), _JointReader.couple_surface),
    "KINEMATICCOUPLING": _JointReader.kinematic_coupling,
    "DISTRIBUTINGCOUPLING": _JointReader.distributing_coupling,
}


def _motion_range(row: Row, first_field: int) -> list[int]:
    """Motions (0 to 5) from the first to the last number in the fields from `first_field` on.

    All motions if these fields are blank.
    """
    motions = [whole_number(word, row.place) for word in row.fields[first_field:] if word] or [1, 6]
    first, last = motions[0], motions[-1]
    message = f"motions from {first} to {last}; they are counted from 1 to 6."
    row.needs(1 <= first <= last <= 6, message)
    return list(range(first - 1, last))


def _shortened_list(items: Sequence[str]) -> str:
    """The first of the texts, and the number of further ones."""
    more = f", and {len(items) - MAX_LISTED_PAIRS} more" * (len(items) > MAX_LISTED_PAIRS)
    return f"{', '.join(items[:MAX_LISTED_PAIRS])}{more}"
