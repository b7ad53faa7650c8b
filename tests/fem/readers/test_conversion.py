"""Elements of decks as cells: where new nodes lie, their weights, and what is fixed with them."""

from __future__ import annotations

import numpy as np
import pytest

from antiosc.io.conversion import Block, Deck
from antiosc.io.neutral import CORNERS, DIMENSION, EDGES, FACES, quadrilateral_faces
from antiosc_decks.cells import file_mesh_of

TRIANGLE = [(0, 0, 0), (1, 0, 0), (0, 1, 0)]
SQUARE = [(0, 0, 0), (1, 0, 0), (1, 1, 0), (0, 1, 0)]
CORNER = {
    "line": [(0, 0, 0), (1, 0, 0)],
    "triangle": TRIANGLE,
    "quad": SQUARE,
    "tetra": [*TRIANGLE, (0, 0, 1)],
    "pyramid": [*SQUARE, (0, 0, 1)],
    "wedge": [*TRIANGLE, *((x, y, 1) for x, y, _ in TRIANGLE)],
    "hexahedron": [*SQUARE, *((x, y, 1) for x, y, _ in SQUARE)],
}
KINDS = [["hexahedron"], ["wedge"], ["pyramid"], ["tetra"], ["hexahedron", "tetra"],
         ["quad"], ["quad", "triangle"], ["triangle"]]  # fmt: skip


def deck_of(shapes: list[str], order: int, seed: int = 0) -> Deck:
    """Elements apart, with numbers of their nodes in any order, and curved edges."""
    rng = np.random.default_rng(seed)
    points, blocks, start = [], [], 0
    for k, shape in enumerate(shapes):
        corners = np.array(CORNER[shape]) + np.array([3.0 * k, 0, 0])
        middles = np.array([corners[list(edge)].mean(axis=0) for edge in EDGES[shape]])
        x = np.vstack([corners, middles]) if order == 2 else corners
        own = start + rng.permutation(len(x))
        start += len(x)
        points.append(np.zeros_like(x))
        points[-1][own - own.min()] = x + 0.05 * rng.normal(size=x.shape) * (order - 1)
        none = np.zeros((1, 0), dtype=np.int64)
        mids = own[None, CORNERS[shape] :] if order == 2 else none
        blocks.append(Block(shape, shape, own[None, : CORNERS[shape]], mids, none))
    return Deck("a deck", np.vstack(points), blocks)


def serendipity(block: Block, x: np.ndarray, corners: set[int]) -> np.ndarray:
    """The place in the middle of an edge, a face or a cell of a curved element."""
    own = block.corners[0].tolist()
    ends = {frozenset((own[a], own[b])): int(block.mids[0, k])
            for k, (a, b) in enumerate(EDGES[block.shape])}  # fmt: skip
    inside = [mid for edge, mid in ends.items() if edge <= corners]
    if len(corners) == 2:
        return x[inside[0]]
    weight = 0.5 if len(corners) == 4 else 0.25
    return weight * x[inside].sum(axis=0) - 0.25 * x[list(corners)].sum(axis=0)


@pytest.mark.parametrize("shapes", KINDS)
def test_new_nodes_lie_where_the_element_places_them(shapes):
    """In the middle of a diagonal: that of its rectangle, or of the hexahedron."""
    deck = deck_of(shapes, 2)
    count = len(deck.points)
    equations = [[[n, 0, 1.0]] for n in range(count)]
    deck.model = {"joined": True, "joints": {"equations": equations}, "halve": False}
    mesh = file_mesh_of(deck)
    np.testing.assert_array_equal(mesh.points[:count], deck.points)
    among = {node: dict(others) for node, others in deck.model["joints"]["among"]}
    assert sorted(among) == list(range(count, len(mesh.points)))
    for node, weights in among.items():
        assert all(n < count for n in weights)
        assert sum(weights.values()) == pytest.approx(1.0)
        place = sum(w * deck.points[n] for n, w in weights.items())
        np.testing.assert_allclose(place, mesh.points[node], atol=1e-12)
    ((label, cells),) = mesh.cells.items()
    dim = DIMENSION[shapes[0]]
    simplex = {2: "triangle", 3: "tetra"}[dim]
    if label not in ("triangle6", "tetra10"):
        return
    vertices, pairs = CORNERS[simplex], EDGES[simplex]
    expected = {"triangle": 1, "quad": 2, "tetra": 1, "pyramid": 2, "wedge": 3}
    split = len(shapes) > 1 or shapes[0] in ("pyramid", "wedge")
    assert split or shapes[0] == simplex
    sizes = sum(expected.get(shape, 6) for shape in shapes)
    assert len(cells) == sizes or "hexahedron" in shapes
    for cell in cells:
        for (a, b), mid in zip(pairs, cell[vertices:], strict=True):
            ends = {int(cell[a]), int(cell[b])}
            (block,) = (one for one in deck.blocks if ends <= set(one.corners[0].tolist()))
            own = block.corners[0]
            edges = [{int(own[i]), int(own[j])} for i, j in EDGES[block.shape]]
            faces = [{int(own[i]) for i in face} for face in quadrilateral_faces(block.shape)]
            around = next((some for some in (*edges, *faces) if ends <= some), set(own.tolist()))
            place = serendipity(block, deck.points, set(map(int, around)))
            np.testing.assert_allclose(mesh.points[mid], place, atol=1e-12)


@pytest.mark.parametrize("order", [1, 2])
@pytest.mark.parametrize("shapes", [["hexahedron"], ["wedge"], ["pyramid"], ["hexahedron", "wedge"],
                                    ["quad", "triangle"], ["quad"]])  # fmt: skip
def test_entities_are_fixed_with_all_their_nodes(shapes, order):
    """An edge with its ends and its middle; a diagonal with all nodes of its rectangle or cell."""
    deck = deck_of(shapes, order, seed=1)
    rng = np.random.default_rng(2)
    count = len(deck.points)
    shares = (0.6, 0.8, 0.9, 1.0)
    sets = {f"{share}": np.flatnonzero(rng.random(count) < share) for share in shares}
    for block in deck.blocks:
        for face in FACES.get(block.shape, ()):
            own = [int(block.corners[0, k]) for k in face]
            ends = [k for k, edge in enumerate(EDGES[block.shape]) if set(edge) <= set(face)]
            more = block.mids[0, ends].tolist() if order == 2 else []
            sets[f"{block.shape} {face}"] = np.array(sorted([*own, *more]))
    deck.fixed = sets
    mesh = file_mesh_of(deck)
    (cells,) = mesh.cells.values()
    dim = DIMENSION[shapes[0]]
    split = len(shapes) > 1 or shapes[0] in ("wedge", "pyramid")
    shape = {2: "triangle", 3: "tetra"}[dim] if split else shapes[0]
    corners = cells[:, : CORNERS[shape]]
    for name, nodes in sets.items():
        fixed = set(nodes.tolist())
        edges = {frozenset(map(int, cell[list(e)])) for cell in corners for e in EDGES[shape]}
        held = {edge for edge in edges if needed(deck, edge) <= fixed}
        found = {d: {frozenset(e) for e in some.tolist()} for d, some in mesh.fixed[name].items()}
        there = fixed & set(corners.ravel().tolist())
        assert found.get(0, set()) == {frozenset({n}) for n in there}
        assert found.get(1, set()) == held
        for d in range(2, dim + 1):
            sides = FACES[shape] if d < dim else (tuple(range(CORNERS[shape])),)
            every = {frozenset(map(int, cell[list(s)])): cell for cell in corners for s in sides}
            whole = {
                side for side, cell in every.items()
                if all(e in held for e in edges_of(shape, cell) if e <= side)
            }  # fmt: skip
            assert found.get(d, set()) == whole


def edges_of(shape: str, cell: np.ndarray) -> list[frozenset]:
    return [frozenset(map(int, cell[list(edge)])) for edge in EDGES[shape]]


def needed(deck: Deck, edge: frozenset) -> set[int]:
    """The nodes of the deck that fix the edge of a cell."""
    for block in deck.blocks:
        own = block.corners[0].tolist()
        mids = block.mids[0].tolist()
        if not edge <= set(own):
            continue
        ends = [frozenset((own[a], own[b])) for a, b in EDGES[block.shape]]
        if edge in ends:
            return set(edge) | set(mids[k] for k in [ends.index(edge)] if mids)
        faces = [{own[k] for k in face} for face in quadrilateral_faces(block.shape)]
        around = next((face for face in faces if edge <= face), set(own))
        return around | {mid for mid, one in zip(mids, ends, strict=bool(mids)) if one <= around}
    raise AssertionError(edge)


def test_cells_of_several_dimensions_have_their_groups():
    deck = deck_of(["wedge", "quad", "line"], 1)
    deck.element_sets = {"a": np.array([0, 1]), "b": np.array([2]), "none": np.zeros(0, dtype=int)}
    deck.skipped = {"MASS": 2, "SPRINGA": 1}
    deck.remarks = ["before"]
    mesh = file_mesh_of(deck)
    assert {label: len(cells) for label, cells in mesh.cells.items()} == {
        "tetra": 3, "triangle": 2, "line": 1,
    }  # fmt: skip
    found = {n: {k: r.tolist() for k, r in parts.items()} for n, parts in mesh.groups.items()}
    assert found == {
        "a": {"tetra": [0, 1, 2], "triangle": [0, 1]}, "b": {"line": [0]}, "none": {},
    }  # fmt: skip
    assert mesh.remarks[0] == "before"
    assert "2 MASS, 1 SPRINGA" in mesh.remarks[1]
