"""Joints of Abaqus decks: the equations of nodes, written by hand; rigid bodies fulfil them."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from antiosc.base.errors import MeshError
from antiosc_decks import abaqus_assembly, abaqus_joints as ties
from antiosc_decks.abaqus_joints import read_joints, surfaces_of
from antiosc_decks.constraints import DeckConstraints
from antiosc_decks.sources import Sources
from motions import rigid, row_of
from refusals import refused

RNG = np.random.default_rng(37)


def deck_of(folder, x: np.ndarray, text: str):
    path = folder / "a.inp"
    nodes = "".join(f"{k},{','.join(map(repr, map(float, p)))}\n" for k, p in enumerate(x, 1))
    path.write_text(f"*NODE\n{nodes}{text}")
    whole = abaqus_assembly.read_deck(Sources(path, "a.inp"))
    return whole, [card for card in whole.cards if card.keyword != "NODE"]


def joints_of(folder, x: np.ndarray, text: str, turning: bool = False):
    """(the constraints that the cards make, what is told)."""
    whole, cards = deck_of(folder, x, text)
    joints = DeckConstraints(whole.deck, np.ones(len(x), dtype=bool), np.full(len(x), turning))
    read_joints(whole, joints, cards)
    return joints, whole.deck.remarks


#: Places of the nodes of a face in its own coordinates.
TRIANGLE = np.array([(0, 0), (1, 0), (0, 1), (0.5, 0), (0.5, 0.5), (0, 0.5)])
SQUARE = np.array([(-1, -1), (1, -1), (1, 1), (-1, 1), (0, -1), (1, 0), (0, 1), (-1, 0.0)])


def functions(count: int, r: float, s: float) -> np.ndarray:
    """Shape functions of a face: polynomials that are 1 at one node and 0 at the others."""
    nodes = (TRIANGLE if count in (3, 6) else SQUARE)[:count]
    powers = {
        3: [(0, 0), (1, 0), (0, 1)],
        4: [(0, 0), (1, 0), (0, 1), (1, 1)],
        6: [(0, 0), (1, 0), (0, 1), (2, 0), (1, 1), (0, 2)],
        8: [(0, 0), (1, 0), (0, 1), (1, 1), (2, 0), (0, 2), (2, 1), (1, 2)],
    }[count]
    table = np.array([[a**i * b**j for i, j in powers] for a, b in nodes])
    return np.linalg.solve(table.T, np.array([r**i * s**j for i, j in powers]))


def faces(count: int) -> tuple[np.ndarray, list[list[int]]]:
    """Nodes of two curved faces apart, and which are those of each."""
    own = TRIANGLE if count in (3, 6) else (SQUARE + 1) / 2
    flat = np.array([[*p, 0.0] for p in own[:count]])
    x = np.vstack([flat, flat + np.array([2.0, 0.3, 0.0])]) + 0.04 * RNG.normal(size=(2 * count, 3))
    return x, [list(range(count)), list(range(count, 2 * count))]


KINDS = {"S3": 3, "S4": 4, "STRI65": 6, "S8R": 8}


@pytest.mark.parametrize("turning", [False, True])
@pytest.mark.parametrize("kind", KINDS)
def test_tied_nodes_follow_the_shape_functions_of_their_face(tmp_path, kind, turning):
    count = KINDS[kind]
    x, cells = faces(count)
    places = [(0.2, 0.3), (0.6, 0.1), (1 / 3, 1 / 3)]
    if count in (4, 8):
        places = [(-0.7, 0.4), (0.9, -0.2), (0.0, 0.0)]
    weights = [functions(count, *p) for p in places]
    slaves = np.array([w @ x[cell] for cell in cells for w in weights])
    every = np.vstack([x, slaves])
    first = len(x) + 1
    text = f"*ELEMENT,TYPE={kind},ELSET=E\n"
    for k, cell in enumerate(cells, 1):
        text += f"{k},{','.join(str(n + 1) for n in cell)}\n"
    text += f"*NSET,NSET=N,GENERATE\n{first},{len(every)}\n*NSET,NSET=N\n1\n"
    text += "*SURFACE,NAME=M\nE,SPOS\n*SURFACE,NAME=S,TYPE=NODE\nN,\n*TIE,NAME=T\nS,M\n"
    joints, told = joints_of(tmp_path, every, text, turning)
    assert told == []
    motions = 6 if turning else 3
    rows = np.array([row_of(terms, len(every)) for terms in joints.equations])
    expected = np.zeros((len(slaves) * motions, len(every), 6))
    for k in range(len(slaves)):
        for c in range(motions):
            row = expected[k * motions + c]
            row[len(x) + k, c] = 1.0
            row[cells[k // 3], c] = -weights[k % 3]
    np.testing.assert_allclose(rows, expected, atol=1e-9)


UNIT = np.array([(0, 0, 0), (1, 0, 0), (1, 1, 0), (0, 1, 0.0)])
PLATE = "*ELEMENT,TYPE=S4,ELSET=E\n1,1,2,3,4\n*SURFACE,NAME=M\nE,SPOS\n"


def tie_at(folder, heights, option: str = "", at=(0.4, 0.7)):
    """The nodes that are tied of some at heights above a square, and what is told."""
    x = np.vstack([UNIT, [(*at, h) for h in heights]])
    text = PLATE + f"*NSET,NSET=N,GENERATE\n5,{len(x)}\n*SURFACE,NAME=S,TYPE=NODE\nN,\n"
    joints, told = joints_of(folder, x, f"{text}*TIE{option}\nS,M\n")
    return sorted({terms[0][0] - 4 for terms in joints.equations}), told, text.count("\n") + len(x)


@pytest.mark.parametrize(("option", "reach"), [("", 0.05), (",POSITION TOLERANCE=0.2", 0.2)])
def test_nodes_within_reach_of_a_face_are_tied(tmp_path, option, reach):
    """By default 0.05 of the mean edge of the master, as Abaqus has it."""
    tied, told, lines = tie_at(tmp_path, [0.99 * reach, 1.01 * reach, -0.99 * reach], option)
    assert tied == [0, 2]
    assert told[0].startswith(f"line {lines + 3} of a.inp: 1 of 3 slave nodes")
    with refused(lines + 2, "nothing", MeshError):
        tie_at(tmp_path, [1.01 * reach, 2.0], option)


@pytest.mark.parametrize(
    ("at", "corner"), [((1.03, 0.5), (0, 0.5, 0.5, 0)), ((-0.03, -0.03), (1, 0, 0, 0))]
)
def test_a_node_beside_a_face_follows_its_nearest_point(tmp_path, at, corner):
    x = np.vstack([UNIT, [(*at, 0.0)]])
    text = PLATE + "*NSET,NSET=N\n5\n*SURFACE,NAME=S,TYPE=NODE\nN,\n*TIE\nS,M\n"
    joints, _ = joints_of(tmp_path, x, text)
    rows = np.array([row_of(terms, 5) for terms in joints.equations])
    for c in range(3):
        np.testing.assert_allclose(rows[c, :4, c], -np.array(corner), atol=1e-12)


#: Nodes of the sides S1, S2, … of elements, by Abaqus' manual.
SIDES = {
    "C3D8": "1234 5876 1562 2673 3784 4851",
    "C3D6": "123 465 1452 2563 3641",
    "C3D4": "123 142 243 341",
    "C3D5": "1234 152 253 354 451",
}


@pytest.mark.parametrize("kind", SIDES)
def test_sides_of_solids(tmp_path, kind):
    count = int(kind[3:])
    text = f"*ELEMENT,TYPE={kind},ELSET=E\n7,{','.join(map(str, range(1, count + 1)))}\n"
    sides = SIDES[kind].split()
    for k in range(1, len(sides) + 1):
        text += f"*SURFACE,NAME=s{k},TYPE=ELEMENT\n\nE,s{k}\n*SURFACE,NAME=BOTH\n7,S{k}\n"
    whole, cards = deck_of(tmp_path, RNG.normal(size=(count, 3)), text)
    found = surfaces_of(whole, cards)
    for k, side in enumerate(sides, 1):
        ((corners, mids),) = found[f"S{k}"].faces
        assert "".join(str(n + 1) for n in corners) == side
        assert len(mids) == 0
        assert (found[f"S{k}"].nodes + 1).tolist() == sorted(map(int, side))
    assert len(found["BOTH"].faces) == len(sides)
    for wrong in ("", ",S0", f",S{len(sides) + 1}", ",SPOS", ",X1"):
        at = text.count("\n") + count + 3
        with pytest.raises(MeshError, match=f"line {at} of a.inp: .* must be S1 to S{len(sides)}"):
            surfaces_of(*deck_of(tmp_path, RNG.normal(size=(count, 3)),
                                 f"{text}*SURFACE,NAME=W\nE{wrong}\n"))  # fmt: skip


def test_surfaces_of_several_kinds_and_of_nodes(tmp_path):
    """A curved tetrahedron beside a shell: middle nodes of the side between its corners."""
    text = "*ELEMENT,TYPE=S3,ELSET=E\n1,1,2,3\n*ELEMENT,TYPE=C3D10,ELSET=E\n"
    text += "2,4,5,6,7,8,9,10,11,12,13\n*SURFACE,NAME=A\nE,S2\n*SURFACE,NAME=B,TYPE=NODE\n3,\n2\n"
    whole, cards = deck_of(tmp_path, RNG.normal(size=(13, 3)), text)
    found = surfaces_of(whole, cards)
    (shell, none), (corners, mids) = found["A"].faces
    assert (shell + 1).tolist() == [1, 2, 3]
    assert len(none) == 0
    # side 2 is 1-4-2: nodes 4, 7, 5 with 11 (1-4), 12 (2-4) and 8 (1-2) between them
    assert (corners + 1).tolist() == [4, 7, 5]
    assert (mids + 1).tolist() == [11, 12, 8]
    assert (found["A"].nodes + 1).tolist() == [1, 2, 3, 4, 5, 7, 8, 11, 12]
    assert (found["B"].nodes + 1).tolist() == [2, 3]


ANY = np.round(RNG.normal(size=(6, 3)), 3)
SET = "*NSET,NSET=N\n1,2,3\n*SURFACE,NAME=S,TYPE=NODE\nN,\n*SURFACE,NAME=L,TYPE=NODE\nN,\n6,\n"
COUPLING = "*COUPLING,REF NODE=6,SURFACE=S,CONSTRAINT NAME=C\n"
COUPLINGS = {
    # cards, the motions (1 to 6) of nodes 1 to 3 that follow node 6
    "all": (COUPLING + "*KINEMATIC\n", "123456"),
    "some": (COUPLING + "*KINEMATIC\n1,2\n5\n", "125"),
    "a range": (COUPLING + "*KINEMATIC\n2,4\n", "234"),
    "older": ("*KINEMATIC COUPLING,REF NODE=6\nN\n", "123456"),
    "older, some": ("*KINEMATIC COUPLING,REF NODE=6\nN,3,\n", "3"),
    "older, a range": ("*KINEMATIC COUPLING,REF NODE=6\nN,1,3\n", "123"),
    "older, each": ("*KINEMATIC COUPLING,REF NODE=6\n1,2,2\n2,2,2\n3,2,2\n", "2"),
}


@pytest.mark.parametrize("case", COUPLINGS)
def test_coupled_motions_are_those_of_the_rigid_body(tmp_path, case):
    """u = U + Θ × r, θ = Θ, of the motions that are named."""
    cards, motions = COUPLINGS[case]
    joints, _ = joints_of(tmp_path, ANY, SET + cards, turning=True)
    rows = [row_of(terms, 6) for terms in joints.equations]
    assert len(rows) == 3 * len(motions)
    U, turn = RNG.normal(size=(2, 3))
    u = np.zeros((6, 6))
    u[:, :3], u[:, 3:] = U + np.cross(turn, ANY - ANY[5]), turn
    seen = set()
    for row in rows:
        assert np.abs((row * u).sum()) < 1e-12
        (node,), (motion,) = np.nonzero(row[:5])
        seen.add((int(node), int(motion) + 1))
        assert row[node, motion] == 1
    assert seen == {(n, int(m)) for n in range(3) for m in motions}


PAIR = "*NSET,NSET=P\n1,2\n*NSET,NSET=Q\n3,4\n"
WRONG = {
    "*EQUATION\n2\n1,1,1.\n": (2, "ends"),
    "*EQUATION\n2\n1,1,1.,2,7,1.\n": (2, "got"),
    "*EQUATION\n2\n1,1,0.,2,1,1.\n": (2, "coefficient"),
    "*MPC\nPLANE,1,2,3\n": (1, "PLANE"),
    "*MPC\nBEAM,1,2\n": (1, "BEAM"),
    "*RIGID BODY,REF NODE=1\n": (0, "ELSET="),
    f"{PAIR}*RIGID BODY,REF NODE=P,NSET=P\n": (4, "node"),
    "*TIE\nA,B\n": (1, "*SURFACE"),
    f"{SET}*TIE\nS,S\n": (8, "elements"),
    "*COUPLING,REF NODE=1,SURFACE=A\n": (0, "*SURFACE"),
    "*KINEMATIC\n": (0, "*KINEMATIC"),
    f"{SET}{COUPLING}*KINEMATIC\n0,2\n": (9, "counted"),
    "*EQUATION\n2\n1,4,1.,2,4,-1.\n": (2, "displacements"),
}  # fmt: skip


@pytest.mark.parametrize("cards", WRONG)
def test_what_is_wrong_is_told_with_its_line(tmp_path, cards):
    beyond, word = WRONG[cards]
    with refused(8 + beyond, word, MeshError):
        joints_of(tmp_path, ANY, cards)


RANDOM = np.random.default_rng(17)
POINTS = RANDOM.normal(size=(6, 3))


def equations(folder: Path, x: np.ndarray, text: str, turning: bool = True) -> np.ndarray:
    """The coefficients (rows, nodes, 6) of what the cards ask of the nodes at `x`."""
    terms = joints_of(folder, x, text, turning)[0].equations
    return np.array([row_of(one, len(x)) for one in terms]).reshape(-1, len(x), 6)


ALONG = [
    "*COUPLING,REF NODE=1,SURFACE=S,ORIENTATION=O\n*KINEMATIC\n2,3\n",
    "*KINEMATIC COUPLING,REF NODE=1,ORIENTATION=O\nS,2,3\n",
]


@pytest.mark.parametrize("card", ALONG)
def test_a_coupling_in_cylindrical_axes_leaves_the_radius_free(tmp_path, card):
    """Along the axis and around it the nodes follow a rigid body; away from it they move alone."""
    angle = np.array([0.3, 1.9, 4.0])
    ring = np.column_stack([np.full(3, 2.0), 3 * np.cos(angle), 3 * np.sin(angle)])
    text = "*NSET,NSET=S\n2,3,4\n*SURFACE,NAME=S,TYPE=NODE\nS\n" + card
    text += "*ORIENTATION,NAME=O,SYSTEM=CYLINDRICAL\n0,0,0,6,0,0\n"
    x = np.vstack([[0.5, 0.1, 0.2], ring])
    C = equations(tmp_path, x, text)
    assert len(C) == 6
    np.testing.assert_allclose(np.einsum("rnk,nkm->rm", C, rigid(x)), 0, atol=1e-12)
    for k, (c, s) in enumerate(zip(np.cos(angle), np.sin(angle), strict=True)):
        np.testing.assert_allclose(C[:, 1 + k, :3] @ [0, c, s], 0, atol=1e-12)
        assert np.abs(C[:, 1 + k, :3] @ [0, -s, c]).max() > 0.1


CASES = {
    # card, points, number of equations, of nodes without rotations
    "LINK": ("*MPC\nLINK,2,5\n", POINTS, 1, 1),
    "BEAM": ("*MPC\nBEAM,2,5\n", POINTS, 6, None),
    "BEAM of a set": ("*NSET,NSET=N\n1,2,3\n*MPC\nBEAM,N,5\n", POINTS, 18, None),
    "RIGID BODY": ("*NSET,NSET=N\n1,2,3\n*RIGID BODY,NSET=N,REF NODE=5\n", POINTS, 18, None),
}


@pytest.mark.parametrize("turning", [True, False])
@pytest.mark.parametrize("case", CASES)
def test_a_rigid_body_fulfils_what_joins_its_nodes(tmp_path, case, turning):
    text, x, *counts = CASES[case]
    count = counts[0 if turning else 1]
    if count is None:
        return
    C = equations(tmp_path, x, text, turning)
    assert len(C) == count
    flat = C.reshape(count, -1)
    assert np.linalg.matrix_rank(flat) == count
    size = np.abs(flat).sum(axis=1).max() * np.abs(x).max()
    assert np.abs(flat @ rigid(x).reshape(6 * len(x), 6)).max() < 1e-12 * size


@pytest.mark.parametrize("count", [3, 4, 6, 8])
def test_shapes_of_faces_are_one_at_their_node_and_have_their_slopes(count):
    corners = np.array([(0, 0), (1, 0), (0, 1)], dtype=float)
    if count in (4, 8):
        corners = np.array([(-1, -1), (1, -1), (1, 1), (-1, 1)], dtype=float)
    nodes = corners
    if count > 4:
        nodes = np.vstack([corners, (corners + np.roll(corners, -1, axis=0)) / 2])
    values = np.array([ties._shape_functions(count, xi)[0] for xi in nodes])
    np.testing.assert_allclose(values, np.eye(count), atol=1e-15)
    xi, h = np.array([0.21, 0.34]), 1e-6
    slopes = ties._shape_functions(count, xi)[1]
    for k, step in enumerate(h * np.eye(2)):
        rise = (
            ties._shape_functions(count, xi + step)[0] - ties._shape_functions(count, xi - step)[0]
        )
        np.testing.assert_allclose(slopes[:, k], rise / (2 * h), atol=1e-9)
