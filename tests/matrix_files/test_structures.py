"""Structures of matrix files: supports, sites of nodes, refusals."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
import scipy.sparse
from scipy.integrate import solve_ivp

import antiosc as ao
from antiosc.fem import structure
from antiosc.io.matrices import dof_map, supported_rows
from matrix_writers import dmig, matrix_market, sierra, sierra_map, spring_frame
from refusals import refused

K, M, LABELS = spring_frame()


def frame_files(tmp_path):
    matrix_market(tmp_path / "K.mtx", K)
    matrix_market(tmp_path / "M.mtx", M)
    return tmp_path / "K.mtx", tmp_path / "M.mtx"


def stiffness(b):
    return 1 / (b @ np.linalg.solve(K, b))


def unit(row):
    return np.eye(len(K))[row]


def halves(tmp_path):
    """Files of Sierra/SD of the nodes 10, 20, 30 and 30, 40, 50, whose sum is the frame."""
    files = {"K": [], "M": [], "map": []}
    for name, rows in (("a", slice(0, 9)), ("b", slice(6, 15))):
        for kind, matrix in (("K", K), ("M", M)):
            part = matrix[rows, rows].copy()
            common = slice(6, 9) if name == "a" else slice(0, 3)
            part[common, common] /= 2
            files[kind].append(tmp_path / f"{kind}{name}.m")
            sierra(files[kind][-1], part, f"{kind}aa", half=name == "a")
        files["map"].append((tmp_path / f"gid_{name}.m", tmp_path / f"ASetMap_{name}.m"))
        sierra_map(*files["map"][-1], LABELS[rows])
    return files


def test_bodies_are_tied_at_nodes_of_the_same_number(tmp_path):
    part = ao.Structure.from_files(**halves(tmp_path))
    assert part.describe() == "given matrices, 5 nodes, 15 dofs"
    for node, row in ((10, 2), (30, 8), (50, 14)):
        model = ao.extract(part, ao.Site(node=node, dof="z"), n=4)
        assert model.k0 == pytest.approx(stiffness(unit(row)), rel=1e-11)


def test_bodies_that_do_not_fit_together_are_refused(tmp_path):
    files = halves(tmp_path)
    for change, says in (
        ({"M": files["M"][0]}, "lists as long"),
        ({"map": None}, "give the map of each"),
        ({"map": [LABELS[:9], LABELS[:9] + np.array([100, 0])]}, "no node with the same number"),
        ({"map": [np.column_stack([LABELS[:9], np.full((9, 3), x)]) for x in (0, 1)]}, "one place"),
        ({"map": [files["map"][0], files["map"][0][::-1]]}, "dofs of"),
    ):
        with pytest.raises(ao.InputError, match=says):
            ao.Structure.from_files(**{**files, **change})
    text = files["K"][0].read_text()
    for cut, says in ((text[:200], "cut off"), (text.replace("1 1", "1.5 1"), "whole numbers")):
        files["K"][0].write_text(cut)
        with pytest.raises(ao.InputError, match=says):
            ao.Structure.from_files(**files)


@pytest.mark.parametrize("form", ["array", "text", "ansys", "five", "columns", "names"])
def test_a_site_is_a_node_and_its_dof(form, tmp_path):
    files = frame_files(tmp_path)
    given = {
        "array": LABELS,
        "text": "# node, dof\n" + "".join(f"{a}, {b}\n" for a, b in LABELS),
        "ansys": "      Matrix Eqn     Node      DOF\n"
        + "".join(f"{k + 1:15d}{a:9d}     {['UX', 'UY', 'UZ'][b - 1]}\n"
                  for k, (a, b) in enumerate(LABELS)),
        "columns": (LABELS[:, 0], LABELS[:, 1], np.zeros((len(K), 3))),
        "names": (LABELS[:, 0].tolist(), np.array(["x", "uy", "T3"])[LABELS[:, 1] - 1]),
        "five": np.column_stack([LABELS, np.zeros((len(K), 3))]),
    }[form]  # fmt: skip
    if isinstance(given, str):
        (tmp_path / "map.txt").write_text(given)
        given = tmp_path / "map.txt"
    part = ao.Structure.from_files(*files, map=given)
    assert part.describe() == "given matrices, 5 nodes, 15 dofs"
    for dof in ("z", "UZ", 3, "t3", "3"):
        model = ao.extract(part, ao.Site(node=20, dof=dof), n=4)
        assert model.k0 == pytest.approx(stiffness(unit(5)), rel=1e-11)
    slanted = ao.extract(part, ao.Site(node=20, direction=(3, 0, -4)), n=4)
    assert slanted.k0 == pytest.approx(stiffness(0.6 * unit(3) - 0.8 * unit(5)), rel=1e-11)
    by_row = ao.extract(part, ao.Site(dof=5), n=4)
    assert by_row.k0 == pytest.approx(stiffness(unit(5)), rel=1e-11)
    with pytest.raises(ao.InputError, match=r"node 21 is not in the matrices' map"):
        ao.extract(part, ao.Site(node=21, dof="z"))
    with pytest.raises(ao.InputError, match=r"node 20 has no dof rx in the matrices: it has x, y"):
        ao.extract(part, ao.Site(node=20, dof="rx"))


def test_supports_by_nodes_are_rows_left_out(tmp_path):
    part = ao.Structure.from_files(
        *frame_files(tmp_path), map=LABELS, supports={10: "all", 30: ["x", "z"], 40: "y"}
    )
    left = np.setdiff1d(np.arange(15), [0, 1, 2, 6, 8, 10])
    assert part.dofs == len(left)
    k, b = K[np.ix_(left, left)], unit(5)[left]
    model = ao.extract(part, ao.Site(node=20, dof="z"), n=4)
    assert model.k0 == pytest.approx(1 / (b @ np.linalg.solve(k, b)), rel=1e-11)
    moving = k - 250.0**2 * M[np.ix_(left, left)]
    model = ao.extract(part, ao.Site(node=20, dof="z"), n=8, tol=1e-14)
    stiff = 1 / (b @ np.linalg.solve(moving, b))
    assert model.dynamic_stiffness(250.0) == pytest.approx(stiff, rel=1e-9)
    with pytest.raises(ao.InputError, match="node 10 is fixed by supports"):
        ao.extract(part, ao.Site(node=10, dof="x"))
    for bad, says in (({11: "all"}, "node 11 is not"), ({10: "w"}, "dof must be one of")):
        with pytest.raises(ao.InputError, match=says):
            ao.Structure.from_files(*frame_files(tmp_path), map=LABELS, supports=bad)
    with pytest.raises(ao.InputError, match="supports by nodes need a map"):
        ao.Structure.from_files(*frame_files(tmp_path), supports={10: "all"})


def test_coordinates_of_nodes_beside_labels(tmp_path):
    """Files that name their dofs need coordinates by node alone."""
    dmig(tmp_path / "km.pch", {"KAAX": K, "MAAX": M}, LABELS)
    nodes = np.array([[10 * k, 0.1 * k, 0.0, 0.0] for k in range(1, 8)])
    one = tmp_path / "km.pch"
    part = ao.Structure.from_files(one, one, map=nodes[::-1])
    model = ao.extract(part, ao.Site(node=20, direction=(0, 0, 1)), n=4)
    assert model.k0 == pytest.approx(stiffness(unit(5)), rel=1e-9)
    assert ao.extract(part, ao.Site((0.2, 0, 0), (0, 0, 1)), n=4).k0 == model.k0
    with pytest.raises(ao.InputError, match=r"the point is no node: take node 20, 0\.03"):
        ao.extract(part, ao.Site((0.23, 0, 0), (0, 0, 1)))
    hit = ao.simulate(model, ao.RigidMass(0.1, 1.0), ao.Hertz(1e8), 5e-3)
    with pytest.raises(ao.InputError, match=r"\(20, 0, 0\) m is 19.5 m off .* \(0.5, 0, 0\) m"):
        ao.probe(part, hit, (20, 0, 0))
    moved = ao.probe(part, hit, (0.2, 0, 0))
    assert moved.shape == (len(hit.time), 3)
    np.testing.assert_allclose(moved[:, 2], hit.displacement, atol=1e-12)
    path = ao.write_series(part, hit, tmp_path / "run", times=[0.0, 1e-3])
    assert path.read_text().count("DataSet") == 2
    with pytest.raises(ao.InputError, match="rows of node, dof, x, y, z: the files do not"):
        ao.Structure.from_files(*frame_files(tmp_path), map=nodes)


def test_a_map_that_does_not_fit_is_refused(tmp_path):
    files = frame_files(tmp_path)
    for bad, says in (
        (LABELS[:-1], "must have a row of node, dof"),
        (np.vstack([LABELS[:-1], LABELS[:1]]), "names one dof of a node twice"),
        (LABELS + 0.5, "as whole numbers"),
        ((LABELS[:, 0], LABELS[:-1, 1]), "map needs a dof for each of the 15 rows; got 14"),
        ((LABELS[:, 0], "x"), "map needs a dof for each"),
        ((LABELS[:-1, 0], LABELS[:, 1]), "the nodes of map"),
        (np.column_stack([np.zeros(15), LABELS]), "must number the rows from 1 to 15"),
        (np.full((15, 2), np.nan), "map"),
        ("nowhere.txt", "there is no matrix file"),
    ):
        with pytest.raises(ao.InputError, match=says):
            ao.Structure.from_files(*files, map=bad)
    (tmp_path / "map.txt").write_text("1 UX\n2 WARP\n")
    with pytest.raises(ao.InputError, match=r"map\.txt, line 2: 'WARP' is not the name of a dof"):
        ao.Structure.from_files(*files, map=tmp_path / "map.txt")


def plate(n: int = 12):
    """A plate of masses on springs of its own: (K, M, map) with points on a square of 1 m."""
    x, y = (c.ravel() for c in np.meshgrid(*2 * [np.linspace(0, 1, n)]))
    K = 1e5 * scipy.sparse.identity(n * n) + 1e6 * scipy.sparse.diags(
        [np.full(n * n - 1, -0.1)] * 2, [-1, 1]
    )
    K = K + 1e6 * 0.2 * scipy.sparse.identity(n * n)
    table = np.column_stack([1 + np.arange(n * n), np.full(n * n, 3), x, y, 0 * x])
    return K, scipy.sparse.identity(n * n), table


def test_a_patch_on_matrices_is_refused():
    K, M, table = plate(4)
    part = ao.Structure.from_matrices(K, M, map=table)
    for where in (ao.Site((0, 0, 0), (0, 0, -1), radius=0.1), ao.Site(dof=3, radius=0.1)):
        with pytest.raises(ao.InputError, match="no surface"):
            ao.extract(part, where)


def test_a_free_body_with_coordinates_has_mass_and_inertia():
    """Four masses at the corners of a square, joined by springs along the edges and diagonals."""
    points = np.array([[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0.0]])
    K = np.zeros((8, 8))
    for i in range(4):
        for j in range(i):
            d = points[i] - points[j]
            d = d[:2] / np.linalg.norm(d)
            B = np.zeros(8)
            B[2 * i : 2 * i + 2], B[2 * j : 2 * j + 2] = d, -d
            K += 1e6 * np.outer(B, B)
    m = np.array([1.0, 2.0, 3.0, 4.0])
    rows = [(i + 1, c + 1, *points[i]) for i in range(4) for c in range(2)]
    part = ao.Structure.from_matrices(K, np.diag(np.repeat(m, 2)), map=rows)
    assert part.rigid_modes.shape[1] == 3
    assert part.mass == pytest.approx(10.0)
    model = ao.extract(part, ao.Site(node=3, direction=(1, 1, 0)), n=4)
    np.testing.assert_allclose(model.inertia.centre[:2], (m @ points[:, :2]) / 10)
    # φ_CRᵀM e of the unit translation e along the direction is m_CR
    assert model.participation.sum() == pytest.approx(model.m_st, rel=1e-9)
    both = ao.extract(
        part,
        {"low": ao.Site(node=1, direction=(0, 1, 0)),
         "high": ao.Site(node=3, direction=(3, 4, 0), tangential=True)},
        n=5,
    )  # fmt: skip
    assert both.columns == {"low": (0,), "high": (1, 2)}
    B = np.zeros((8, 3))
    B[1, 0], B[4:6, 1:] = 1.0, [[0.6, -0.8], [0.8, 0.6]]
    np.testing.assert_allclose(both.direction[:, :2], [[0, 1], [0.6, 0.8], [-0.8, 0.6]])
    exact = np.linalg.inv(B.T @ np.linalg.solve(K - 1e5 * np.diag(np.repeat(m, 2)), B))
    np.testing.assert_allclose(both.dynamic_stiffness(np.sqrt(1e5)), exact, rtol=1e-9)
    np.testing.assert_allclose(both.inertia.centre[:2], (m @ points[:, :2]) / 10)
    held = ao.Structure.from_matrices(
        K, np.diag(np.repeat(m, 2)), map=rows, supports={1: "all", 2: "y"}
    )
    with pytest.raises(ao.InputError, match="the total mass is known only of free bodies"):
        _ = held.mass


@pytest.mark.parametrize(("ratio", "rigid"), [(0.9e-4, True), (1.05e-4, False)])
def test_rotations_are_rigid_up_to_the_digits_of_coordinates(monkeypatch, ratio, rigid):
    """Forces of the six motions over those of the stiffness: four digits of a file are enough."""
    corners = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1.0]])
    nodes, axes = np.repeat(np.arange(4), 3), np.tile([1, 2, 3], 4)
    rows = np.column_stack([1 + nodes, axes, corners[nodes]])
    K = np.zeros((12, 12))
    for i in range(4):
        for j in range(i):
            along = corners[i] - corners[j]
            row = np.zeros(12)
            row[3 * i : 3 * i + 3], row[3 * j : 3 * j + 3] = along, -along
            K += np.outer(row, row)
    body = ao.Structure.from_matrices(K, np.eye(12), map=rows)
    turning = np.arange(6) >= 3
    monkeypatch.setattr(structure, "force_ratios", lambda *_: np.where(turning, ratio, 0.0))
    assert (body.rigid_inertia is not None) == rigid


# --- Maps of the rows of matrices: their forms in files, and whole messages -----------------------


MAPS = {
    "rows": "Row Node DOF\n1 10 UX\n2 10 UY\n3 20 UX\n",
    "mixed rows": "2, 10, uy # second\n! a comment\n3 20 x\n1 10 T1\n",
    "comments": "*\n10 1\n* * \n10 2\n$\n+20 1\n%\n",
    "points": "10,1,.5,0,0\n10,2,.5,0,0\n20,1,1.,2.,3.\n",
}


@pytest.mark.parametrize("case", MAPS)
def test_the_rows_of_a_map(case, tmp_path):
    path = tmp_path / "map.txt"
    path.write_text(MAPS[case])
    found = dof_map(path, None, 3)
    assert found.node.tolist() == [10, 10, 20]
    assert found.component.tolist() == [1, 2, 1]
    assert found.points.shape == (3, 3)
    assert found.located == (case == "points")
    expected = [[0.5, 0, 0], [0.5, 0, 0], [1, 2, 3]] if found.located else np.full((3, 3), np.nan)
    np.testing.assert_array_equal(found.points, expected)
    assert found.row(10, 2) == 1
    assert supported_rows({20: "all", 10: ["uy"]}, found).tolist() == [1, 2]


WRONG_MAPS = {
    "word": ("10 1\n\nnode\n", 3, "node"),
    "dof": ("# a\n10 1\n10 2 a\n", 3, "name"),
    "long": ("10 1\n" + 70 * "n", 2, "expected"),
    "empty": ("# a\n", 1, "map"),
    "fields": ("\n10 1\n10 2 3\n20 1\n", 3, "are"),
    "nan": ("10 1\n10 2\n20 1e999\n", None, "finite"),
    "rows": ("10 1\n10 2\n", None, "rows"),
    "strange dof": ("10 1\n10 99\n20 1\n", None, "99"),
    "no nodes": ("5 0 0 0\n", None, "nodes"),
}  # fmt: skip


@pytest.mark.parametrize("case", WRONG_MAPS)
def test_what_is_wrong_with_a_map_is_told(case, tmp_path):
    text, line, word = WRONG_MAPS[case]
    path = tmp_path / "map.txt"
    path.write_text(text)
    with refused(line, word, ao.InputError):
        dof_map(path, np.array([[10, 1], [10, 2], [20, 1]]), 3)


# --- The program of docs/howto/matrices.md runs as it stands there ---------------------------


@pytest.mark.parametrize("coordinates", [False, True])
def test_several_sites_at_nodes(coordinates):
    """k0 and Z of two sites, a node's dof and a slanted direction, are those of the matrices."""
    given = LABELS
    if coordinates:
        given = np.column_stack([LABELS, 0.01 * LABELS[:, :1], 0 * LABELS])
    part = ao.Structure.from_matrices(K, M, map=given, backend="scipy")
    sites = {"a": ao.Site(node=20, dof="z"), "b": ao.Site(node=40, direction=(1, 1, 0))}
    model = ao.extract(part, sites, n=12, tol=1e-14)
    B = np.column_stack([unit(5), (unit(9) + unit(10)) / np.sqrt(2)])
    np.testing.assert_allclose(model.k0, np.linalg.inv(B.T @ np.linalg.solve(K, B)), rtol=1e-9)
    Z = np.linalg.inv(B.T @ np.linalg.solve(K - 250.0**2 * M, B))
    np.testing.assert_allclose(model.dynamic_stiffness(250.0), Z, rtol=1e-7)
    assert bool(model.info["points"]) == coordinates


@pytest.mark.slow
def test_matrices_on_a_shaken_ground():
    """With its participation in the motion of the ground the tip moves as all 50 dofs by DOP853."""
    K = scipy.sparse.diags([-1e6, 2e6, -1e6], [-1, 0, 1], shape=(50, 50)).tolil()
    K[49, 49] = 1e6
    M = scipy.sparse.diags(np.full(50, 0.02)).tocsr()
    chain = ao.extract(ao.Structure.from_matrices(K.tocsr(), M), ao.Site(dof=49), n=30)
    along = chain.shapes.T @ (M @ np.ones(50))
    chain = replace(chain, participation=[along[0] - along[1:].sum(), *along[1:]])
    t = np.linspace(0, 0.1, 1001)
    ground = 10.0 * np.sin(300.0 * t)
    stop = ao.Contact("chain", "stop", ao.Hertz(1e8), gap=1.0)
    scene = ao.Scene({"chain": chain, "stop": ao.Obstacle()}, [stop], base=ao.Base(t, ground))
    found = scene.run(0.1).at(t)["chain"].displacement()
    squares, V = np.linalg.eigh(K.toarray() / 0.02)

    def rate(time, y):
        return np.append(y[50:], -squares * y[:50] - V.sum(axis=0) * np.interp(time, t, ground))

    exact = solve_ivp(rate, (0, 0.1), np.zeros(100), "DOP853", t, rtol=1e-9, atol=1e-12)
    tip = V[49] @ exact.y[:50]
    assert np.abs(found - tip).max() < 1e-5 * np.abs(tip).max()
