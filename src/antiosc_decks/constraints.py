"""Connections between nodes of a deck: constraints, springs, dampers; and unconnected pieces.

A constraint is a list of terms (node, motion 0 to 5, coefficient) whose sum is zero; the first term
is the dependent one. Nodes of no element become points with six motions. A mesh holds every cell
once; elements that repeat others node by node, such as a doubler on a skin, therefore get nodes of
their own, which follow the original nodes: stiffness and mass add.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from itertools import chain

import numpy as np

from antiosc.base._types import Array, BoolArray
from antiosc.base.errors import MeshError
from antiosc.base.texts import piece_text
from antiosc.io.conversion import Block, Deck, IntArray, counts_text
from antiosc.io.neutral import Joints, MotionTerm, Piece, UnitSystem, connected_pieces
from antiosc_decks.entries import DeckPlace
from antiosc_decks.properties import AXIS_COSINE, fixed_along_axes

NO_NODES = np.zeros(0, dtype=np.int64)
ZERO_VECTOR = np.zeros(3)
#: Node -> directions of its motions, as rows.
Frames = Mapping[int, Array]
#: Indices of motions from 0 to 5.
Motions = Sequence[int]
#: Coefficients below this share of a constraint's largest are rounding errors.
NEGLIGIBLE_TERM = 1e-14


def lever_matrix(r: Array) -> Array:
    """The matrix (3, 3) with θ × r = lever(r) θ."""
    return np.array([[0, r[2], -r[1]], [-r[2], 0, r[0]], [r[1], -r[0], 0]])


def axis_terms(node: int, axis: Array, first: int, factor: float) -> list[MotionTerm]:
    """Terms of `factor` × displacement (`first` = 0) or rotation (3) of a node along an axis."""
    return [(node, first + c, factor * float(axis[c])) for c in range(3) if axis[c]]


@dataclass
class DeckConstraints:
    """Collects constraints, springs, dampers and masses of nodes, in the deck's units."""

    deck: Deck
    #: nodes of elements, and those of elements with rotations
    used_nodes: BoolArray
    has_rotations: BoolArray
    equations: list[list[MotionTerm]] = field(default_factory=list)
    #: (terms, stiffness): springs between motions
    springs: list[tuple[list[MotionTerm], float]] = field(default_factory=list)
    #: (terms, damping): dampers between motions
    dampers: list[tuple[list[MotionTerm], float]] = field(default_factory=list)
    #: masses on motions: (each motion as a list of terms, their mass matrix, total mass)
    masses: list[tuple[list[list[MotionTerm]], Array, float]] = field(default_factory=list)
    #: (node, motion) -> (node, motion) it stands for: a rotation node moves as another node turns
    motion_alias: dict[tuple[int, int], tuple[int, int]] = field(default_factory=dict)
    #: coordinates of points beyond the nodes of the deck
    added_points: list[Array] = field(default_factory=list)
    #: node of solids -> the point with six motions that was added there
    leader_points: dict[int, int] = field(default_factory=dict)
    #: node -> its local axes, as rows
    motion_axes: dict[int, Array] = field(default_factory=dict)

    def place(self, node: int) -> Array:
        """Coordinates of a node or a further point."""
        count = len(self.deck.points)
        return self.deck.points[node] if node < count else self.added_points[node - count]

    def actual(self, node: int, motion: int) -> tuple[int, int]:
        """The (node, motion) that a motion is an alias of; the motion itself if it is no alias."""
        return self.motion_alias.get((node, motion), (node, motion))

    def add_equation(self, terms: Iterable[MotionTerm], place: DeckPlace) -> None:
        """Add Σ coefficient × motion = 0; motions of nodes with local axes are along the local
        axes."""
        parts = ((c, *part) for n, m, c in terms for part in self._global_terms(n, m))
        self._add_global_equation([(*motion, c * value) for c, motion, value in parts], place)

    def _add_global_equation(self, terms: Iterable[MotionTerm], place: DeckPlace) -> None:
        """Add Σ coefficient × motion = 0, all motions along x, y, z."""
        total: dict[tuple[int, int], float] = {}
        for node, motion, coefficient in terms:
            key = self.actual(node, motion)
            total[key] = total.get(key, 0.0) + coefficient
        largest = max(map(abs, total.values()), default=0.0)
        significant = [(*key, c) for key, c in total.items() if abs(c) > NEGLIGIBLE_TERM * largest]
        for node, motion, _ in significant:
            has_motion = motion < 3 or not self._is_used(node) or self.has_rotations[node]
            place.require(has_motion, "nodes of solids do not rotate; constrain displacements.")
        if significant:
            self.equations.append(significant)

    def fix_along(self, node: int, fixed: BoolArray, frame: Array) -> BoolArray:
        """Fix motions (6,) along the rows of `frame`; return those that supports must fix.

        Motions along an inclined row become equations. The mask returned (6,) is of motions along
        x, y, z.
        """
        result = np.zeros(6, dtype=bool)
        for first in (0, 3):
            axes = fixed[first : first + 3]
            along = fixed_along_axes(axes, frame)
            if along is not None:
                result[first : first + 3] = along
                continue
            for direction in frame[axes]:
                order = np.argsort(-np.abs(direction), kind="stable")
                if abs(direction[order[0]]) > AXIS_COSINE:
                    result[first + order[0]] = True
                    continue
                terms = [(node, first + int(k), float(direction[k])) for k in order]
                self.equations.append([t for t in terms if abs(t[2]) > NEGLIGIBLE_TERM])
        return result

    def elongation_terms(
        self, a: int, b: int, place: DeckPlace, first: int = 0
    ) -> tuple[list[MotionTerm], float]:
        """(terms of a line's elongation, or of its twist if `first` is 3; its length)."""
        line = self.place(b) - self.place(a)
        length = float(np.linalg.norm(line))
        place.require(length != 0, "the ends of an element coincide, so that it has no direction.")
        unit = (line / length).tolist()
        ends = ((a, -1.0), (b, 1.0))
        return [(n, first + c, s * unit[c]) for n, s in ends for c in range(3)], length

    def _global_terms(self, node: int, motion: int) -> list[tuple[tuple[int, int], float]]:
        """A motion as the sum [((node, motion along x, y or z), coefficient)]."""
        if (node, motion) in self.motion_alias:
            return [(self.motion_alias[node, motion], 1.0)]
        frame = self.motion_axes.get(node)
        if frame is None:
            return [((node, motion), 1.0)]
        first = 3 * (motion // 3)
        row = frame[motion - first]
        order = np.argsort(-np.abs(row), kind="stable")
        return [((node, first + int(k)), float(row[k])) for k in order if row[k]]

    def _is_used(self, node: int) -> bool:
        """Whether a node belongs to an element."""
        return node < len(self.deck.points) and bool(self.used_nodes[node])

    def add_point(self, x: Array) -> int:
        """Add a point with six motions at `x` (3,); return its number."""
        self.added_points.append(np.asarray(x, dtype=float))
        return len(self.deck.points) + len(self.added_points) - 1

    def leader_point(self, node: int, rotation_node: int | None = None) -> int:
        """Number of a point with six motions at a node.

        The displacements of `rotation_node` represent the rotations of this point.
        """
        point = self.leader_points.get(node, node)
        if point == node and self._is_used(node) and not self.has_rotations[node]:
            self.leader_points[node] = point = self.add_point(self.place(node))
            for c in range(3):
                self.equations.append([(node, c, 1.0), (point, c, -1.0)])
        if rotation_node is not None and rotation_node != node:
            for c in range(3):
                alias = self.motion_alias.setdefault((rotation_node, c), (point, 3 + c))
                if alias != (point, 3 + c):  # bodies that turn alike
                    self.equations.append([(point, 3 + c, 1.0), (*alias, -1.0)])
        return point

    def add_rigid(
        self,
        nodes: IntArray,
        leader: int,
        motions: Motions,
        frames: Frames,
        eccentricity: Array = ZERO_VECTOR,
    ) -> None:
        """Let motions of nodes follow a point as a rigid body.

        `motions` are among 0 to 5, along the axes of each node in `frames`. `eccentricity` (3,) is
        the part of the arm that ends at the node; rotations of the point about the first of these
        axes do not act on it.
        """
        x = self.place(leader)
        for node in map(int, nodes[nodes != leader]):
            arm = lever_matrix(self.place(node) - x - eccentricity)
            if eccentricity.any():
                axis = frames[node][0]
                arm = arm + np.outer(axis, axis) @ lever_matrix(eccentricity)
            for first in (0, 3):
                if first and self._is_used(node) and not self.has_rotations[node]:
                    continue
                for pivot, normal in _directions(frames.get(node), motions, first):
                    axes = sorted(np.flatnonzero(normal).tolist(), key=lambda k: k != pivot)
                    terms = [(node, first + k, float(normal[k])) for k in axes]
                    terms += axis_terms(leader, normal, first, -1.0)
                    terms += [] if first else axis_terms(leader, normal @ arm, 3, -1.0)
                    self.equations.append(terms)

    def mean(
        self,
        follower: int,
        motions: Motions,
        nodes: IntArray,
        weights: Array,
        place: DeckPlace,
        turning: BoolArray | None = None,
        axes: Array | None = None,
    ) -> None:
        """Let motions of a node follow the weighted mean motion of others (RBE3).

        The motions are along the rows of `axes`; by default along the node's own axes.

        `turning` marks nodes whose rotations count too, with weight × (mean distance)², as in MSC
        Nastran (Linear Static Analysis User's Guide).
        """
        x = np.array([self.place(int(node)) for node in nodes])
        w = weights / weights.sum()
        centre = w @ x
        r = x - centre
        J = np.einsum("p,pi,pj->ij", w, r, r)
        J = np.trace(J) * np.eye(3) - J
        spins = np.zeros(len(nodes))

        if turning is not None:
            mean_distance = np.linalg.norm(x - self.place(follower), axis=1).mean()
            spins = w * np.where(turning, mean_distance**2 or 1.0, 0.0)
            J += spins.sum() * np.eye(3)
        values, principal = np.linalg.eigh(J)
        resisted = values > 1e-12 * max(values[-1], np.finfo(float).tiny)
        turned = principal[:, resisted]
        inverse = (turned / values[resisted]) @ turned.T
        # θ = J⁻¹ Σ (w r × u + s θ)
        skew = -np.array([lever_matrix(arm) for arm in r])
        rotations = np.einsum("ij,p,pjk->ipk", inverse, w, skew)
        by_rotation = np.einsum("ik,p->ipk", inverse, spins)
        cross = lever_matrix(self.place(follower) - centre)
        levers = (np.einsum("ij,jpk->ipk", cross, table) for table in (rotations, by_rotation))
        by_lever, lever_of_rotation = levers
        displacements = w[None, :, None] * np.eye(3)[:, None, :] + by_lever
        # a rotation about the line of the nodes does not displace a point on that line
        unknown = np.abs(cross @ principal[:, ~resisted]).max(initial=0.0) > 1e-9 * np.abs(r).max()
        known = resisted.all() or not any(c >= 3 or unknown for c in motions)
        place.require(known, "a mean rotation of nodes on one line is not known; take more nodes.")
        pairs = [(p, k) for p in range(len(nodes)) for k in range(3)]
        frame = self.motion_axes.get(follower) if axes is None else axes
        tables = (0, displacements, lever_of_rotation), (3, rotations, by_rotation)

        for first, table, rotation_table in tables:
            for pivot, axis in _directions(frame, motions, first):
                components = sorted(np.flatnonzero(axis), key=lambda k: k != pivot)
                mean = np.einsum("i,ipk->pk", axis, table)
                terms = [(follower, first + int(k), float(axis[k])) for k in components]
                terms += [(int(nodes[p]), k, -float(mean[p, k])) for p, k in pairs]
                spin = np.einsum("i,ipk->pk", axis, rotation_table)
                terms += [(int(nodes[p]), 3 + k, -float(spin[p, k])) for p, k in pairs if spins[p]]
                self._add_global_equation(terms, place)

    def keep_terms(self, stays: Callable[[list[MotionTerm]], bool]) -> int:
        """Remove constraints, springs, dampers and masses whose terms fail `stays`; return their
        number."""
        count_before = len(self.all_terms())
        self.equations = [terms for terms in self.equations if stays(terms)]
        self.springs = [element for element in self.springs if stays(element[0])]
        self.dampers = [element for element in self.dampers if stays(element[0])]
        self.masses = [element for element in self.masses if stays([*chain(*element[0])])]
        return count_before - len(self.all_terms())

    def loose_nodes(self) -> list[int]:
        """The nodes without elements and the added points on which constraints or springs act."""
        nodes = {n for terms in self.all_terms() for n, _, _ in terms}
        return sorted(n for n in nodes if not self._is_used(n))

    def all_terms(self, dampers: bool = True) -> list[list[MotionTerm]]:
        """The terms of all constraints, springs, masses, and (if `dampers`) dampers."""
        masses = [terms for rows, _, _ in self.masses for terms in rows]
        sprung = [*self.springs, *(self.dampers if dampers else ())]
        return [*self.equations, *(terms for terms, _ in sprung), *masses]

    def joints_in_si(self, units: UnitSystem) -> Joints:
        """The joints in SI units as JSON; nodes of no element have the numbers −1, −2, …."""
        length = units.length
        loose_nodes = self.loose_nodes()
        number = {node: -1 - k for k, node in enumerate(loose_nodes)}

        def scaled(terms: list[MotionTerm]) -> list[MotionTerm]:
            return [(number.get(n, n), m, c * (length if m >= 3 else 1.0)) for n, m, c in terms]

        return {
            "equations": [scaled(terms) for terms in self.equations],
            "springs": [(scaled(terms), k * units.force / length) for terms, k in self.springs],
            "dampers": [(scaled(terms), c * units.force / length) for terms, c in self.dampers],
            "masses": [
                ([[(number.get(n, n), m, c) for n, m, c in terms] for terms in rows], M.tolist(), m)
                for rows, M, m in self.masses
            ],
            "points": [[float(c) * length for c in self.place(node)] for node in loose_nodes],
        }


def _directions(frame: Array | None, motions: Motions, first: int) -> list[tuple[int, Array]]:
    """[(dependent axis, direction (3,))] of `motions`, whose dependent axes differ.

    Displacements if `first` is 0, rotations if it is 3, along the rows of `frame`.
    """
    axes = [c - first for c in motions if first <= c < first + 3]
    if frame is None or len(axes) == 3:
        return [(k, np.eye(3)[k]) for k in axes]
    rows = frame[axes].copy()
    pivots: list[int] = []
    for i in range(len(rows)):
        # Gaussian elimination: the rows span the same space, each has a pivot axis of its own
        remaining = np.abs(rows[i:])
        remaining[:, pivots] = 0.0
        j, pivot = np.unravel_index(int(np.argmax(remaining)), remaining.shape)
        rows[[i, i + int(j)]] = rows[[i + int(j), i]]
        rows[i] /= rows[i, pivot]
        others = np.arange(len(rows)) != i
        rows[others] -= rows[others, pivot, None] * rows[i]
        pivots.append(int(pivot))
    rows[np.abs(rows) < NEGLIGIBLE_TERM] = 0.0
    return list(zip(pivots, rows, strict=True))


#: Share of the largest eigenvalue below which a rigid motion counts as free; rounding is 1e-16.
FREE_MOTION_TOLERANCE = 1e-10
#: Pieces of a deck that are listed, that are told, and sets of each.
MAX_LISTED_PIECES, MAX_NAMED_PIECES, MAX_PIECE_SETS = 40, 6, 3


def piece_mask(deck: Deck, chosen: BoolArray, length: float) -> BoolArray:
    """Mask of the `chosen` elements in the piece `deck.piece`; `length`: metres per unit."""
    from antiosc.io.reading import described_pieces  # with scipy, for pieces alone

    tables = [block.corners[chosen[rows]] for block, rows in deck.numbered()]
    label = connected_pieces(tables, len(deck.points))
    label = label[np.concatenate([NO_NODES, *(block.corners[:, 0] for block in deck.blocks)])]
    pieces, count = np.unique(label[chosen], return_counts=True)
    rank = deck.piece or 1
    if not 1 <= rank <= len(pieces):
        count_text = f"{len(pieces)} pieces that share no node"
        raise MeshError(f"{deck.name} has {count_text}; there is no piece {rank}.")
    pieces = pieces[np.argsort(-count, kind="stable")]
    if len(pieces) > 1:
        of_piece = (chosen & (label == piece) for piece in pieces[:MAX_LISTED_PIECES])
        deck.pieces = [_piece_record(deck, chosen, members) for members in of_piece]
        text = described_pieces([piece.scaled(length) for piece in deck.pieces], MAX_NAMED_PIECES)
        deck.remarks.append(piece_text(deck.name, rank, len(pieces), text))
    return chosen & (label == pieces[rank - 1])


def _piece_record(deck: Deck, chosen: BoolArray, members: BoolArray) -> Piece:
    """One piece of the chosen elements, with the largest sets that are within it."""
    rows = np.concatenate([block.corners[members[k]].ravel() for block, k in deck.numbered()])
    x = deck.points[rows]
    remaining = members.copy()
    names = []
    for name, elements in sorted(deck.element_sets.items(), key=lambda entry: -len(entry[1])):
        is_within = bool((members | ~chosen)[elements].all())
        if is_within and remaining[elements].any():
            names.append(name)
            remaining[elements] = False
    return Piece(", ".join(names[:MAX_PIECE_SETS]), x.min(axis=0), x.max(axis=0))


def count_pieces(
    deck: Deck, x: Array, exists: BoolArray, fixed: BoolArray, constraints: list[list[MotionTerm]]
) -> tuple[int, bool]:
    """(number of pieces that nothing joins, whether there are several and each is supported).

    `x` (n, 3): coordinates of nodes and points; `exists`, `fixed` (n, 6): existing and fixed
    motions; `constraints`: terms of each constraint and spring.
    """
    tables = [np.hstack([block.corners, block.mids]) for block in deck.blocks]
    tables += [np.array([[node for node, _, _ in terms]]) for terms in constraints if terms]
    nodes = np.unique(np.concatenate([NO_NODES, *(t.ravel() for t in tables)]))
    nodes = nodes[nodes >= 0]
    pieces = np.unique(connected_pieces(tables, len(x))[nodes], return_inverse=True)[1]
    count = int(pieces.max(initial=0)) + 1
    if count < 2:
        return count, False

    piece = np.zeros(len(x), dtype=np.int64)
    piece[nodes] = pieces
    centre = np.zeros((count, 3))
    np.add.at(centre, pieces, x[nodes])
    r = x - (centre / np.bincount(pieces)[:, None])[piece]
    r /= max(float(np.ptp(x[nodes], axis=0).max()), np.finfo(float).tiny)

    # Gram matrices of the rigid motions of each piece: at all nodes, and as they are resisted
    acting = np.zeros_like(exists)
    acting[nodes] = exists[nodes]
    all_motions, resisted = np.zeros((2, count, 6, 6))
    for gram, mask in ((all_motions, acting), (resisted, acting & fixed)):
        at, motions = np.nonzero(mask)
        motion = _rigid_motion(r[at], motions)
        np.add.at(gram, piece[at], motion[:, :, None] * motion[:, None, :])
    for terms in filter(None, constraints):
        at, motions, c = (np.array(column) for column in zip(*terms, strict=True))
        row = (c / np.abs(c).max()) @ _rigid_motion(r[at], motions)
        resisted[piece[at[0]]] += np.outer(row, row)

    for against, gram in zip(resisted, all_motions, strict=True):
        values, vectors = np.linalg.eigh(against)
        free = vectors[:, values <= FREE_MOTION_TOLERANCE * max(values[-1], 1.0)]
        if np.trace(free.T @ gram @ free) > FREE_MOTION_TOLERANCE * np.trace(gram):
            return count, False
    return count, True


def _rigid_motion(r: Array, motions: IntArray) -> Array:
    """Each motion (0 to 5) of the node at its row of r (n, 3), in six rigid motions: (n, 6)."""
    rows = np.eye(6)[motions]
    by_rotation = np.cross(np.eye(3)[:, None], r)  # (axis, node, direction)
    by_rotation = np.concatenate([by_rotation, np.zeros_like(by_rotation)], axis=2)
    rows[:, 3:] += by_rotation[:, np.arange(len(r)), motions].T
    return rows


# --- Copies ---------------------------------------------------------------------------------------


def separate_copies(deck: Deck) -> list[tuple[int, int]]:
    """Give repeated elements new nodes: [(new node, original node)]."""
    blocks = [block for block in deck.blocks if block.role != "rod"] or deck.blocks
    new: dict[tuple[int, int], int] = {}
    copies: Counter[str] = Counter()
    for block, ranks in zip(blocks, _repeat_counts(blocks), strict=True):
        copies[block.type] += int((ranks > 0).sum())
        for element in np.flatnonzero(ranks):
            for table in (block.corners, block.mids, block.inner):
                for k in np.flatnonzero(table[element] >= 0):
                    key = int(table[element, k]), int(ranks[element])
                    table[element, k] = new.setdefault(key, len(deck.points) + len(new))
    if new:
        deck.points = np.vstack([deck.points, deck.points[[node for node, _ in new]]])
        repeated = counts_text({kind: count for kind, count in copies.items() if count})
        message = f"{repeated} of {deck.name} repeat other elements node by node"
        deck.remarks.append(f"{message}: their stiffness and mass add to those of these.")
    return [(copy, node) for (node, _), copy in new.items()]


def _repeat_counts(blocks: list[Block]) -> list[IntArray]:
    """By block and element: number of earlier elements with the same corners."""
    ranks = [np.zeros(len(block), dtype=np.int64) for block in blocks]
    for shape in {block.shape for block in blocks}:
        members = [k for k, block in enumerate(blocks) if block.shape == shape]
        tables = [blocks[k].corners for k in members]
        if shape == "triangle":
            quads = [block.corners for block in blocks if block.shape == "quad"]
            tables = [np.delete(quad, k, axis=1) for quad in quads for k in range(4)] + tables
        rows = np.sort(np.vstack(tables), axis=1)
        label = np.unique(rows, axis=0, return_inverse=True)[1].reshape(-1)
        order = np.argsort(label, kind="stable")
        rank = np.empty(len(rows), dtype=np.int64)
        rank[order] = np.arange(len(rows)) - np.searchsorted(label[order], label[order])
        ends = np.cumsum([len(table) for table in tables])
        for k, piece in zip(members[::-1], np.split(rank, ends[:-1])[::-1], strict=False):
            ranks[k] = piece
    return ranks
