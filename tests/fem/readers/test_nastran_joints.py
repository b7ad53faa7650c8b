"""Constraints, springs and masses of Nastran decks against what they mean for a frame of bars.

Rigid bodies fulfil each constraint and stretch no spring between nodes; springs and masses are
those of the energy that is written out here.
"""

from __future__ import annotations

import numpy as np
import pytest

import nastran_decks as bdf
from antiosc.base.errors import MeshError
from motions import matrix, node_at, rigid, row_of, stiffness

RNG = np.random.default_rng(23)
X = np.round(RNG.uniform(-1, 1, (7, 3)), 3)
COUNT = len(X)
#: An oblique rectangular system, number 5, by three points.
A, B, C = np.round(RNG.uniform(-1, 1, (3, 3)), 3)
SYSTEM = "CORD2R,5,," + ",".join(map(str, (*A, *B))) + "\n," + ",".join(map(str, C)) + "\n"


def axes() -> np.ndarray:
    """Those of the system as rows: z from A to B, x in the plane of C."""
    z = (B - A) / np.linalg.norm(B - A)
    x = (C - A) - ((C - A) @ z) * z
    x /= np.linalg.norm(x)
    return np.stack([x, np.cross(z, x), z])


def frame_of_bars(turned: int | None = None) -> str:
    """Bars from each node to the next; the motions of one node are along the system's axes."""
    text = SYSTEM + "MAT1,1,2.+11,,.3,7800.\nPBAR,1,1,1.-4,1.-9,1.-9,2.-9\n"
    for k, x in enumerate(X, 1):
        text += f"GRID,{k},,{','.join(map(str, x))}{',5' if k == turned else ''}\n"
    for k in range(1, COUNT):
        text += f"CBAR,{k},1,{k},{k + 1},.1,.2,.9\n"
    return text


@pytest.fixture
def joints(tmp_path):
    def of(cards: str, turned: int | None = None, control: str = "") -> dict:
        return bdf.read(tmp_path, control + frame_of_bars(turned) + cards, unit="m")[0]

    return of


def depends(rows: np.ndarray, node: int) -> set[int]:
    """Motions of a node that the equations hold when all other nodes are at rest."""
    own = rows.reshape(len(rows), COUNT, 6)[:, node]
    return {k for k in range(6) if np.abs(own[:, k]).max() > 1e-12}


CONSTRAINTS = {
    # card, equations, {node: its dependent motions}
    "RBE2": ("RBE2,9,1,123456,2,3\n", 12, {1: set(range(6)), 2: set(range(6)), 3: set()}),
    "RBE2 THRU": ("RBE2,9,1,13,2,THRU,4,1.-5\n", 6, {1: {0, 2}, 2: {0, 2}, 3: {0, 2}, 4: set()}),
    "RBE2 rotations": ("RBE2,9,1,46,2\n", 2, {1: {3, 5}}),
    "RBAR": ("RBAR,9,2,5,123456\n", 6, {4: set(range(6))}),
    "RBAR, second end": ("RBAR,9,2,5,,123456,345\n", 3, {1: {2, 3, 4}}),
    "RBAR, some": ("RBAR,9,2,5,123456,,,16\n", 2, {4: {0, 5}}),
    "RBE3": ("RBE3,9,,7,123456,1.,123,1,2\n,3,2.5,123,4,THRU,5\n", 6, {6: set(range(6))}),
    "RBE3, some": ("RBE3,9,,7,15,.5,123,1,2\n,3,UM,1,1\n", 2, {6: {0, 4}}),
    "RBE3, rotations": ("RBE3,9,,7,4,.5,123,1,2\n,3,4,2.,1234,5\n", 1, {6: {3}}),
}


@pytest.mark.parametrize("turned", [None, 2, 7])
@pytest.mark.parametrize("case", CONSTRAINTS)
def test_rigid_bodies_fulfil_constraints(joints, case, turned):
    card, count, dependent = CONSTRAINTS[case]
    rows = np.array(
        [row_of(terms, COUNT).ravel() for terms in joints(card, turned)["joints"]["equations"]]
    )
    assert np.linalg.matrix_rank(rows, tol=1e-9) == len(rows) == count
    assert np.abs(rows @ rigid(X).reshape(-1, 6)).max() < 1e-12 * np.abs(rows).sum()
    for node, motions in dependent.items():
        if turned != node + 1:
            leading = depends(rows, node)
            assert motions <= leading


def test_the_weighted_mean_of_translations_and_of_rotation(joints):
    """RBE3: the mean of displacements at the centre of the weights; θ = J⁻¹ Σ w r × u there."""
    card = "RBE3,9,,7,456,1.,123,1,2\n,3,2.5,123,4,5\n"
    rows = np.array([row_of(terms, COUNT).ravel() for terms in joints(card)["joints"]["equations"]])
    w = np.array([1, 1, 1, 2.5, 2.5]) / 8
    r = X[:5] - w @ X[:5]
    inertia = np.einsum("p,pi,pi", w, r, r) * np.eye(3) - np.einsum("p,pi,pj->ij", w, r, r)
    u = RNG.normal(size=(COUNT, 6))
    momentum = sum(wi * np.cross(ri, ui) for wi, ri, ui in zip(w, r, u[:5, :3], strict=True))
    u[6, 3:] = np.linalg.solve(inertia, momentum)
    assert np.abs(rows @ u.ravel()).max() < 1e-11


@pytest.mark.parametrize("selected", [None, 4, 8])
def test_the_sums_of_mpc_that_the_case_control_selects(joints, selected):
    """Four terms over two lines; sets by MPCADD; without case control all of them."""
    cards = "MPCADD,4,6,7\nMPC,6,1,1,2.,2,2,-3.\n,,3,5,.5,4,6,-.25\nMPC,7,2,4,1.,5,4,-1.\n"
    cards += "MPC,8,1,1,1.,2,1,-1.\n"
    expected = np.zeros((3, COUNT, 6))
    expected[0, [0, 1, 2, 3], [0, 1, 4, 5]] = 2.0, -3.0, 0.5, -0.25
    expected[1, [1, 4], [3, 3]] = 1.0, -1.0
    expected[2, [0, 1], [0, 0]] = 1.0, -1.0
    model = joints(cards, control=f"MPC={selected}\nBEGIN BULK\n" if selected else "")
    sums = np.array([row_of(terms, COUNT).ravel() for terms in model["joints"]["equations"]])
    taken = {None: [0, 1, 2], 4: [0, 1], 8: [2]}[selected]
    np.testing.assert_array_equal(sums, expected[taken].reshape(len(taken), -1))


def along(node: int, motion: int, direction=None) -> np.ndarray:
    """The motion of a node along a direction, as a row."""
    row = np.zeros((COUNT, 6))
    first = 3 * (motion // 3)
    row[node, first : first + 3] = np.eye(3)[motion % 3] if direction is None else direction
    return row.ravel()


SCALAR = {
    "CELAS1": "PELAS,3,40.\nCELAS1,9,3,1,2,4,6\n",
    "CELAS1 of its number": "PELAS,9,40.\nCELAS1,9,,1,2,4,6\n",
    "CELAS1, second of its PELAS": "PELAS,2,7.,,,3,40.\nCELAS1,9,3,1,2,4,6\n",
    "CELAS2": "CELAS2,9,40.,1,2,4,6\n",
    "CDAMP1": "PDAMP,3,40.\nCDAMP1,9,3,1,2,4,6\n",
    "CDAMP1, third of its PDAMP": "PDAMP,1,1.,2,2.,3,40.,4,4.\nCDAMP1,9,3,1,2,4,6\n",
    "CDAMP2": "CDAMP2,9,40.,1,2,4,6\n",
}


@pytest.mark.parametrize("case", SCALAR)
@pytest.mark.parametrize("turned", [None, 1, 4])
def test_springs_between_two_motions(joints, case, turned):
    rows = [along(node, motion, axes()[motion % 3] if turned == node + 1 else None)
            for node, motion in ((0, 1), (3, 5))]  # fmt: skip
    row = rows[0] - rows[1]
    model = joints(SCALAR[case], turned)
    both = stiffness(model, X), matrix(model["joints"]["dampers"], COUNT)
    expected = 40 * np.outer(row, row), np.zeros((6 * COUNT, 6 * COUNT))
    for found, known in zip(both, expected[:: -1 if "DAMP" in case else 1], strict=True):
        np.testing.assert_allclose(found, known, atol=1e-12)


@pytest.mark.parametrize("share", [None, 0.25, 1.0])
@pytest.mark.parametrize("oriented", ["vector", "node", "system"])
def test_a_bush_deforms_at_its_place(joints, share, oriented):
    """½ Σ k d²: d is the difference of the motions of both ends at the place, along its axes."""
    k = [10.0, 20.0, 30.0, 4.0, 5.0, 6.0]
    given = {"vector": "0.3,-.2,.8,", "node": "6,,,", "system": ",,,5"}[oriented]
    place = f"\n,{share}" if share is not None else ""
    cards = "PBUSH,3,K,10.,20.,30.,4.,5.,6.\n,,B,1.,2.,3.,.4,.5,.6\n"
    cards += f"CBUSH,9,3,2,5,{given}{place}\n"
    p = X[1] + (0.5 if share is None else share) * (X[4] - X[1])
    line = (X[4] - X[1]) / np.linalg.norm(X[4] - X[1])
    v = X[5] - X[1] if oriented == "node" else np.array([0.3, -0.2, 0.8])
    y = v - (v @ line) * line
    y /= np.linalg.norm(y)
    T = axes() if oriented == "system" else np.stack([line, y, np.cross(line, y)])
    u = RNG.normal(size=(COUNT, 6))
    d = [u[n, :3] + np.cross(u[n, 3:], p - X[n]) for n in (1, 4)]
    stretch, turn = T @ (d[0] - d[1]), T @ (u[1, 3:] - u[4, 3:])
    model = joints(cards)
    K, C = stiffness(model, X), matrix(model["joints"]["dampers"], COUNT)
    energy = np.array(k) @ np.concatenate([stretch, turn]) ** 2
    assert u.ravel() @ K @ u.ravel() == pytest.approx(energy, rel=1e-9)
    assert u.ravel() @ C @ u.ravel() == pytest.approx(0.1 * energy, rel=1e-9)


@pytest.mark.parametrize(("letter", "kind"), [("K", "springs"), ("B", "dampers")])
def test_bushes_without_orientation_act_along_their_line_and_about_it(joints, letter, kind):
    cards = f"PBUSH,3,{letter},10.,,,4.\nCBUSH,9,3,2,5\n"
    line = (X[4] - X[1]) / np.linalg.norm(X[4] - X[1])
    push = along(1, 0, line) - along(4, 0, line)
    twist = along(1, 3, line) - along(4, 3, line)
    expected = 10 * np.outer(push, push) + 4 * np.outer(twist, twist)
    found = matrix(joints(cards)["joints"][kind], COUNT)
    np.testing.assert_allclose(found, expected, atol=1e-12)


def mass_matrix(model: dict) -> tuple[np.ndarray, float]:
    """(matrix, mass) of all point masses."""
    M, total = np.zeros((6 * COUNT, 6 * COUNT)), 0.0
    for rows, own, mass in model["joints"]["masses"]:
        table = np.array([row_of(terms, COUNT).ravel() for terms in rows])
        M += table.T @ np.array(own) @ table
        total += mass
    for point, mass, inertia in model["masses"]:
        node = node_at(X, point)
        M[6 * node : 6 * node + 6, 6 * node : 6 * node + 6] += np.diag([mass] * 3 + inertia)
        total += mass
    return M, total


INERTIA = np.array([[3.0, -0.1, -0.3], [-0.1, 4.0, -0.2], [-0.3, -0.2, 5.0]])


@pytest.mark.parametrize("number", ["", "5", "-1"])
@pytest.mark.parametrize("factor", [1.0, 0.5])
def test_a_mass_beside_its_node(joints, number, factor):
    """Twice the kinetic energy: m |v + ω × r|² + ω·J ω; in the basic system or in another one."""
    r = np.array([0.2, -0.1, 0.4])
    given = X[2] + r if number == "-1" else r
    card = f"CONM2,9,3,{number},7.,{','.join(f'{x:.6g}' for x in given)}\n,3.,.1,4.,.3,.2,5.\n"
    M, total = mass_matrix(joints(card + f"PARAM,WTMASS,{factor}\n"))
    T = axes() if number == "5" else np.eye(3)
    v, omega = RNG.normal(size=(2, 3))
    moving = v + np.cross(omega, T.T @ r)
    expected = factor * (7 * moving @ moving + (T @ omega) @ INERTIA @ (T @ omega))
    motion = np.zeros((COUNT, 6))
    motion[2] = *v, *omega
    assert motion.ravel() @ M @ motion.ravel() == pytest.approx(expected, rel=1e-9)
    assert total == pytest.approx(7 * factor)
    motion[2] = 0
    assert not (M @ np.ones(6 * COUNT)).reshape(COUNT, 6)[[0, 1, 3, 4, 5, 6]].any()


WRONG = {
    "CMASS2,9,-6.,2,3\n": "CMASS2 has a negative mass",
    "CONM2,9,3,,7.,,,,\n,1.,2.,1.\n": "the mass or the inertia of CONM2 is negative",
    "CONM2,9,3,6,7.,1.\nCORD2C,6,,0.,0.,0.,0.,0.,1.\n,1.,0.,0.\n": "coordinate system 6 as CORD2R",
    "CELAS1,9,4,2,3\n": "CELAS1 has no PELAS 4",
    "CELAS2,9,4.,2,7\n": "a component from 1 to 6",
    "PBUSH,3,K,1.\nCBUSH,9,3,2,3,,,,\n,,4\n": "system",
    "PBUSH,3,M,1.\nCBUSH,9,3,2,3\n": "its line M would change",
    "CBUSH,9,4,2\nPBUSH,4,K,-1.\n": "CBUSH has a negative stiffness",
    "CBUSH,9,4\nPBUSH,4,K,1.\n": "CBUSH acts on no node",
    "MAT1,5,1.,,-1.\n": "Poisson's ratio lies above -1",
    "RBAR,9,1,2,12345,6\n": "CNA or CNB",
    "RBE3,9,,7,123\n": "RBE3 names no nodes with weights",
    "MPC,1,1,7,1.,2,1,1.\n": "MPC acts on components from 1 to 6",
    "RBE2,9,1,123,99\n": "there is no GRID 99",
}


@pytest.mark.parametrize("card", WRONG)
def test_what_is_wrong_is_told_with_its_line(joints, card):
    line = frame_of_bars().count("\n") + 1 + card.startswith(("PBUSH,3,K", "PVISC"))
    with pytest.raises(MeshError, match=f"line {line} of .*{WRONG[card]}"):
        joints(card)
