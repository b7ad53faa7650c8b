"""Constraints of Abaqus decks as equations: rigid bodies fulfil them, and what each forbids."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from antiosc.io.deck import Deck, Place
from antiosc_decks import abaqus_assembly, abaqus_joints as ties
from antiosc_decks.abaqus_joints import read_joints
from antiosc_decks.constraints import Constraints
from antiosc_decks.sources import Sources

RNG = np.random.default_rng(17)
ANY = RNG.normal(size=(6, 3))
#: Points of an oblique plane, and of a line in space, no two alike.
IN_PLANE = ANY[0] + RNG.normal(size=(6, 2)) @ ANY[1:3]
ON_LINE = ANY[0] + np.array([[0.0], [0.4], [2.0], [1.1], [-0.3], [0.9]]) * ANY[3]


def equations(folder: Path, x: np.ndarray, text: str, turning: bool = True) -> np.ndarray:
    """The coefficients (rows, nodes, 6) of what the cards ask of the nodes at `x`."""
    path = folder / "a.inp"
    nodes = "".join(f"{k + 1}, {', '.join(map(repr, map(float, p)))}\n" for k, p in enumerate(x))
    path.write_text(f"*NODE\n{nodes}{text}")
    whole = abaqus_assembly.read(Sources(path, "a.inp"))
    n = len(x)
    joints = Constraints(whole.deck, np.ones(n, dtype=bool), np.full(n, turning))
    read_joints(whole, joints, [card for card in whole.cards if card.keyword != "NODE"])
    C = np.zeros((len(joints.equations), n, 6))
    for row, terms in zip(C, joints.equations, strict=True):
        for node, motion, value in terms:
            row[node, motion] += value
    return C


def rigid(x: np.ndarray) -> np.ndarray:
    """Motions (nodes, 6, 6) of the nodes in the six of a rigid body."""
    motions = np.zeros((len(x), 6, 6))
    motions[:, :3, :3] = motions[:, 3:, 3:] = np.eye(3)
    for k in range(3):
        motions[:, :3, 3 + k] = np.cross(np.eye(3)[k], x)
    return motions


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
    "PLANE": ("*MPC\nPLANE,1,2,3,4,5,6\n", IN_PLANE, 3, 3),
    "PLANE in two lines": ("*MPC\nPLANE,1,2,3,4\n0,5,6\n", IN_PLANE, 3, 3),
    "STRAIGHT": ("*MPC\nSTRAIGHT,1,2,3,4,5,6\n", ON_LINE, 8, 8),
    "LINK": ("*MPC\nLINK,2,5\n", ANY, 1, 1),
    "BEAM": ("*MPC\nBEAM,2,5\n", ANY, 6, None),
    "RIGID BODY": ("*NSET,NSET=N\n1,2,3\n*RIGID BODY,NSET=N,REF NODE=5\n", ANY, 18, None),
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


@pytest.mark.parametrize(("kind", "motions"), [("TIE", 6), ("PIN", 3)])
def test_two_nodes_at_one_place_move_alike(tmp_path, kind, motions):
    x = np.vstack([ANY[:2], ANY[0]])
    for turning, count in ((True, motions), (False, 3)):
        C = equations(tmp_path, x, f"*MPC\n{kind},1,3\n", turning)
        assert not C[:, 1].any()
        np.testing.assert_array_equal(C[:, 0], np.eye(6)[:count])
        np.testing.assert_array_equal(C[:, 2], -np.eye(6)[:count])


def test_nodes_of_a_plane_move_freely_in_it_and_not_out_of_it(tmp_path):
    C = equations(tmp_path, IN_PLANE, CASES["PLANE"][0])[:, :, :3]
    normal = np.cross(ANY[1], ANY[2])
    within = RNG.normal(size=(6, 2)) @ ANY[1:3]
    assert np.abs(np.einsum("enc,nc->e", C, within)).max() < 1e-12
    for node in range(6):
        assert np.abs(C[:, node] @ normal).max() > 1e-3


@pytest.mark.parametrize("count", [2, 5])
def test_the_mean_rotation_of_a_rigid_body_is_its_own(tmp_path, count):
    """Motion 1 of the last node, whose coordinates are the axis."""
    axis = np.array([0.6, 0.0, 0.8])
    x = np.vstack([ANY[:count], 2.5 * axis])
    nodes = ",".join(str(k + 1) for k in range(count + 1))
    (row,) = equations(tmp_path, x, f"*MPC\nMEANROT,{nodes}\n", turning=False)
    motions = rigid(x)
    motions[count] = 0.0
    motions[count, 0, 3:] = axis
    assert row[count].tolist() == [1.0, 0, 0, 0, 0, 0]
    about = motions @ np.concatenate((np.zeros(3), axis))
    assert np.einsum("nc,nc->", row, about) == pytest.approx(0.0, abs=1e-12)
    for shift in motions[:, :, :3].transpose(2, 0, 1):
        assert np.einsum("nc,nc->", row, shift) == pytest.approx(0.0, abs=1e-12)


def test_a_node_on_the_axis_has_no_part_in_the_mean_rotation(tmp_path):
    """CalculiX: "This node is not taken into account in the MPC"; the others' mean is the same."""
    ring = np.array([(1.0, 0, 0), (0, 1, 0), (-1, 0, 0), (0, -1, 0)])
    x = np.vstack([ring, (0, 0, 0.5), (0, 0, 2)])
    row, alone = (
        equations(tmp_path, x, f"*MPC\nMEANROT,{nodes}\n", turning=False)[0]
        for nodes in ("1,2,3,4,5,6", "1,2,3,4,6")
    )
    np.testing.assert_allclose(row, alone, rtol=0, atol=1e-15)


def test_the_weighted_mean_of_a_rigid_body_is_its_motion(tmp_path):
    """The six motions of a point beside it, by the mean ones of five nodes of unequal weights."""
    surface = "*NSET,NSET=N\n1,2,3,4,5\n*SURFACE,TYPE=NODE,NAME=S\nN,\n"
    coupling = "*COUPLING,REF NODE=6,SURFACE=S,CONSTRAINT NAME=C\n*DISTRIBUTING\n"
    C = equations(tmp_path, ANY, surface + coupling)
    assert len(C) == 6
    np.testing.assert_allclose(C[:, 5], np.eye(6), atol=1e-15)
    assert np.abs(C.reshape(6, -1) @ rigid(ANY).reshape(36, 6)).max() < 1e-12
    deck, nodes = Deck("a", points=ANY), np.arange(5)
    joints = Constraints(deck, np.ones(6, dtype=bool), np.ones(6, dtype=bool))
    joints.mean(5, range(6), nodes, RNG.uniform(0.2, 1.0, 5), Place(tmp_path, 1))
    for terms in joints.equations:
        moved = sum(value * rigid(ANY)[node, motion] for node, motion, value in terms)
        assert np.abs(moved).max() < 1e-12


def test_nodes_of_a_line_move_freely_along_it_and_not_across(tmp_path):
    C = equations(tmp_path, ON_LINE, CASES["STRAIGHT"][0])[:, :, :3]
    along = RNG.normal(size=(6, 1)) * ANY[3]
    assert np.abs(np.einsum("enc,nc->e", C, along)).max() < 1e-12
    for node in range(6):
        assert np.linalg.matrix_rank(C[:, node]) == 2


@pytest.mark.parametrize("count", [3, 4, 6, 8])
def test_shapes_of_faces_are_one_at_their_node_and_have_their_slopes(count):
    corners = np.array([(0, 0), (1, 0), (0, 1)], dtype=float)
    if count in (4, 8):
        corners = np.array([(-1, -1), (1, -1), (1, 1), (-1, 1)], dtype=float)
    nodes = corners
    if count > 4:
        nodes = np.vstack([corners, (corners + np.roll(corners, -1, axis=0)) / 2])
    values = np.array([ties._shapes(count, xi)[0] for xi in nodes])
    np.testing.assert_allclose(values, np.eye(count), atol=1e-15)
    xi, h = np.array([0.21, 0.34]), 1e-6
    slopes = ties._shapes(count, xi)[1]
    for k, step in enumerate(h * np.eye(2)):
        rise = ties._shapes(count, xi + step)[0] - ties._shapes(count, xi - step)[0]
        np.testing.assert_allclose(slopes[:, k], rise / (2 * h), atol=1e-9)
