"""*SURFACE and *TIE of Abaqus and CalculiX decks: faces of elements or nodes.

Nodes of one surface are tied to faces of another by the shape functions of these.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field

import numpy as np

from antiosc.io.deck import Array, Block, IntArray, Place
from antiosc.io.neutral import CORNERS, EDGES
from antiosc_decks.abaqus.assembly import Instance, Whole
from antiosc_decks.abaqus.cards import Card
from antiosc_decks.model.constraints import Constraints

#: Corners of the faces S1, S2, … of solids.
SOLID_FACES = {
    "hexahedron": (
        *((0, 1, 2, 3), (4, 7, 6, 5), (0, 4, 5, 1)),
        *((1, 5, 6, 2), (2, 6, 7, 3), (3, 7, 4, 0)),
    ),
    "wedge": ((0, 1, 2), (3, 5, 4), (0, 3, 4, 1), (1, 4, 5, 2), (2, 5, 3, 0)),
    "tetra": ((0, 1, 2), (0, 3, 1), (1, 3, 2), (2, 3, 0)),
    "pyramid": ((0, 1, 2, 3), (0, 4, 1), (1, 4, 2), (2, 4, 3), (3, 4, 0)),
}


@dataclass
class Surface:
    """Faces, by (corners, middles of edges; -1: none) in order around each; its nodes.

    An edge of a shell has nodes of its own, and the face that it belongs to.
    """

    faces: list[tuple[IntArray, IntArray]] = field(default_factory=list)
    of: list[IntArray] = field(default_factory=list)

    @property
    def nodes(self) -> IntArray:
        """All of its nodes."""
        nodes = np.unique(np.concatenate([np.zeros(0, dtype=np.int64), *self.of]))
        return nodes[nodes >= 0]


def surfaces_of(whole: Whole, cards: Sequence[tuple[Card, Instance]]) -> dict[str, Surface]:
    """The surfaces of a deck by name in upper case."""
    found: dict[str, Surface] = {}
    for card, within in cards:
        if card.keyword != "SURFACE" or not card.option("NAME"):
            continue
        surface = found.setdefault((within.prefix + card.option("NAME")).upper(), Surface())
        of_nodes = card.option("TYPE").upper().startswith("NODE")
        for row in card.rows():
            if of_nodes:
                surface.of.append(whole.nodes(row.word(0), row.place, within))
                continue
            elements, side = whole.elements(row.word(0), row.place, within), row.word(1).upper()
            for block, _ in whole.deck.blocks_of(elements):
                faces = list(_faces(block, side, row.place))
                surface.faces += faces
                edge = _edge(block, side, row.place)
                if edge is None:
                    surface.of += [nodes for face in faces for nodes in face]
                else:
                    ends = block.corners[:, list(EDGES[block.shape][edge])]
                    surface.of += [ends.ravel(), block.mids[:, edge : edge + 1].ravel()]
    return found


def _edge(block: Block, side: str, place: Place) -> int | None:
    """The number of an edge of flat elements: S3, … of shells, S1, … of plane ones, E1, …"""
    if block.shape not in ("triangle", "quad") or not side[1:].isdigit():
        return None
    edge = int(side[1:]) - (1 if side[0] == "E" or block.role.startswith("plane") else 3)
    place.needs(edge < CORNERS[block.shape], f"{side!r} is no edge of a {block.shape}.")
    return edge if edge >= 0 else None


def _faces(block: Block, side: str, place: Place) -> Iterator[tuple[IntArray, IntArray]]:
    corners = _corners(block.shape, side, place)
    edges = [frozenset(edge) for edge in EDGES[block.shape]]
    ring = zip(corners, (*corners[1:], corners[0]), strict=True)
    around = [edges.index(frozenset(pair)) for pair in ring] if block.mids.shape[1] else []
    yield from zip(block.corners[:, list(corners)], block.mids[:, around], strict=True)


def _corners(shape: str, side: str, place: Place) -> tuple[int, ...]:
    if shape in ("triangle", "quad"):
        return tuple(range(CORNERS[shape]))
    sides = SOLID_FACES.get(shape, ())
    number = int(side[1:]) if side[:1] == "S" and side[1:].isdigit() else 0
    place.needs(1 <= number <= len(sides), f"{side or 'no side'!r} is no side of a {shape}; it "
                f"must be S1 to S{len(sides)}.")  # fmt: skip
    return sides[number - 1]


#: Share of the mean length of the master's edges within which nodes are tied by default (Abaqus).
TIE_REACH = 0.05
#: Faces that are tried for each node, the nearest first.
TRIED = 12
NEWTON_STEPS = 12


def tie(
    joints: Constraints, slave: Surface, master: Surface, tolerance: float | None, place: Place
) -> list[str]:
    """Tie the slave's nodes; a sentence where some are too far away.

    `tolerance` is in the deck's unit of length.
    """
    place.needs(master.faces, "the master surface of *TIE must be of faces of elements.")
    faces, edges = [], []
    for corners, mids in master.faces:
        there = len(mids) and (mids >= 0).all()
        nodes = np.concatenate([corners, mids]) if there else corners
        x = np.array([joints.place(int(node)) for node in nodes])
        faces.append((nodes, x))
        ring = x[: len(corners)]
        edges.append(np.linalg.norm(ring - np.roll(ring, 1, axis=0), axis=1).mean())
    size = float(np.mean(edges))
    centres = np.array([x.mean(axis=0) for _, x in faces])
    reach = (TIE_REACH * size if tolerance is None else tolerance) + 1e-9 * size
    far = 0
    nodes = slave.nodes
    for node in nodes[~np.isin(nodes, master.nodes)].tolist():
        point = joints.place(node)
        order = np.argsort(np.linalg.norm(centres - point, axis=1), kind="stable")[:TRIED]
        distance, leaders, weights = _nearest([faces[k] for k in order], point)
        if distance > reach:
            far += 1
            continue
        both = bool(joints.has_rotations[node] and joints.has_rotations[leaders].all())
        followed = [(int(n), -float(w)) for n, w in zip(leaders, weights, strict=True)]
        for c in range(6 if both else 3):
            joints.equation([(node, c, 1.0), *((n, c, w) for n, w in followed)], place)
    place.needs(far != len(nodes), "*TIE joins nothing: no node of the slave surface lies within "
                f"{reach:.3g} of the master surface (POSITION TOLERANCE=).")  # fmt: skip
    if not far:
        return []
    return [
        f"{place}: {far} of {len(nodes)} slave nodes of *TIE lie further than {reach:.3g} from "
        "the master surface and are not tied (POSITION TOLERANCE=)."
    ]


def _nearest(
    faces: Sequence[tuple[IntArray, Array]], point: Array
) -> tuple[float, IntArray, Array]:
    """(distance from the nearest of some faces, its nodes, their weights)."""
    best: tuple[float, IntArray, Array] | None = None
    for nodes, x in faces:
        weights = _projected(x, point)
        distance = float(np.linalg.norm(weights @ x - point))
        if best is None or distance < best[0] * (1 - 1e-9) - 1e-15:
            best = distance, nodes, weights
    assert best is not None
    return best


def _projected(x: Array, point: Array) -> Array:
    """Shape functions of the face at its place nearest to the point."""
    triangle = len(x) in (3, 6)
    xi = np.full(2, 1 / 3) if triangle else np.zeros(2)
    for _ in range(NEWTON_STEPS):
        values, slopes = _shapes(len(x), xi)
        step = np.linalg.lstsq((slopes.T @ x).T, point - values @ x, rcond=None)[0]
        new = np.clip(xi + step, 0.0 if triangle else -1.0, 1.0)
        if triangle:
            new /= max(float(new.sum()), 1.0)
        if np.abs(new - xi).max() < 1e-12:
            break
        xi = new
    return _shapes(len(x), xi)[0]


def _shapes(count: int, xi: Array) -> tuple[Array, Array]:
    """Values (count,) and slopes (count, 2) of a triangle's or a serendipity quadrilateral's."""
    r, s = xi
    if count in (3, 6):
        L = np.array([1 - r - s, r, s])
        dL = np.array([[-1.0, -1], [1, 0], [0, 1]])
        if count == 3:
            return L, dL
        pairs = ((0, 1), (1, 2), (2, 0))
        values = [*(L * (2 * L - 1)), *(4 * L[a] * L[b] for a, b in pairs)]
        between = [4 * (L[a] * dL[b] + L[b] * dL[a]) for a, b in pairs]
        return np.array(values), np.vstack([(4 * L - 1)[:, None] * dL, between])
    c = np.array([[-1.0, -1], [1, -1], [1, 1], [-1, 1]])
    a, b = 1 + c[:, 0] * r, 1 + c[:, 1] * s
    values = a * b / 4
    slopes = np.stack([c[:, 0] * b, a * c[:, 1]], axis=1) / 4
    if count == 4:
        return values, slopes
    p, q = 1 - r * r, 1 - s * s
    mids = np.array([p * (1 - s), (1 + r) * q, p * (1 + s), (1 - r) * q]) / 2
    by_r = [-r * (1 - s), q / 2, -r * (1 + s), -q / 2]
    by_s = [-p / 2, -s * (1 + r), p / 2, -s * (1 - r)]
    dmids = np.stack([by_r, by_s], axis=1)
    values -= (mids + np.roll(mids, 1)) / 2
    slopes -= (dmids + np.roll(dmids, 1, axis=0)) / 2
    return np.concatenate([values, mids]), np.vstack([slopes, dmids])
