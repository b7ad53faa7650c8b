"""Matrix files: what is read, and what is written comes back."""

from __future__ import annotations

import contextlib
import tracemalloc

import numpy as np
import pytest

import antiosc as ao
from antiosc.io.matrices import read_pair
from matrix_writers import abaqus_labels, matrix_market, op4_binary, spring_frame

K, M, LABELS = spring_frame()


def same(pair, tol: float = 1e-14) -> None:
    assert abs(pair.K.toarray() - K).max() <= tol * abs(K).max()
    assert abs(pair.M.toarray() - M).max() <= tol * abs(M).max()


@pytest.mark.parametrize("half", [True, False])
def test_abaqus_files_name_their_dofs(half, tmp_path):
    mixed = np.random.default_rng(0).permutation(len(K))  # M's rows stand in another order
    abaqus_labels(tmp_path / "K.mtx", K, LABELS, half)
    abaqus_labels(tmp_path / "M.mtx", M[np.ix_(mixed, mixed)], LABELS[mixed], half)
    pair = read_pair(tmp_path / "K.mtx", tmp_path / "M.mtx")
    same(pair)
    np.testing.assert_array_equal(pair.labels, LABELS)


@pytest.mark.parametrize("wide", [False, True])
@pytest.mark.parametrize("order", ["<", ">"])
@pytest.mark.parametrize("style", ["dense", "sparse", "bigmat"])
def test_op4_binary(style, order, wide, tmp_path):
    op4_binary(tmp_path / "km.op4", {"KAA": K, "MAA": M}, style, order, wide)
    same(read_pair(tmp_path / "km.op4", tmp_path / "km.op4"))


def test_matrices_are_chosen_by_name(tmp_path):
    both = {"A1": K, "KGG": 2 * K, "KAA": K, "MAA": M}
    op4_binary(tmp_path / "km.op4", both, "bigmat")
    with pytest.raises(ao.InputError, match=r"km\.op4 holds A1, KGG, KAA, MAA"):
        read_pair(tmp_path / "km.op4", tmp_path / "km.op4")
    same(read_pair(tmp_path / "km.op4", tmp_path / "km.op4", names=("a1", "maa")))


MTX = "%%MatrixMarket matrix coordinate real symmetric\n"
HB = f"{'t':72}k\n{5:14d}{1:14d}{1:14d}{1:14d}{0:14d}\n"
BAD = {
    "1e12 entries": (MTX + "9 9 1000000000000\n1 1 1.0\n", "promises"),
    "1e12 rows": (MTX + "1000000000000 1000000000000 1\n1 1 1.0\n", r"1e\+12 rows, but"),
    "dense 1e12": ("%%MatrixMarket matrix array real general\n1000000 1000000\n1.0\n", "promises"),
    "nan": (MTX + "1 1 1\n1 1 nan\n", "holds nan at row 1, column 1"),
    "out of range": (MTX + "2 2 1\n3 1 1.0\n", "damaged: .*[rR]ow"),
    "complex": (MTX.replace("real", "complex") + "1 1 1\n1 1 1 0\n", "the matrix is complex"),
    "pattern": (MTX.replace("real", "pattern") + "1 1 1\n1 1\n", "the matrix is pattern"),
    "skew": (MTX.replace("symmetric", "skew-symmetric") + "1 1 0\n", "is skew-symmetric"),
    "header": ("%%MatrixMarket matrix\n", "bad, line 1: the header must be"),
    "empty": ("", "bad is empty"),
    "prose": ("stiffness of the part\n", "an Abaqus matrix has lines of node, dof"),
    "hb complex": (HB + "CSA" + 11 * " " + f"{1:14d}{1:14d}{1:14d}\n(1I8)\n1\n",
                   "bad, line 3: the matrix is complex"),
    "hb huge": (HB + "RSA" + 11 * " " + f"{10**12:14d}{10**12:14d}{10**12:14d}\n(1I8)\n1\n",
                "more than a file of"),
    "hb cut": (HB + "RSA" + 11 * " " + f"{1:14d}{1:14d}{1:14d}\n"
               + f"{'(2I8)':16}{'(1I8)':16}{'(1E20.12)':20}\n{1:8d}{2:8d}\n{1:8d}\n",
               "the file ends within a matrix, after 0 of 1 lines"),
    "op4 complex": (f"{1:8d}{1:8d}{6:8d}{4:8d}KAA     1P,3E24.16\n", "KAA is complex"),
    "op4 cut": (f"{1:8d}{1:8d}{6:8d}{2:8d}KAA     1P,3E24.16\n{1:8d}{1:8d}{1:8d}\n",
                "bad, line 2: the file ends within a matrix"),
    "op4 huge": (f"{1:8d}{1:8d}{6:8d}{2:8d}KAA     1P,3E24.16\n{1:8d}{1:8d}{99999999:8d}\n1.0\n",
                 "the file ends within a matrix"),
    "dmig complex": ("DMIG    KAA            0       6       4\n", "DMIG KAA is complex"),
    "dmig header": ("DMIG*   KAA                            1               1\n", "no header card"),
    "dmig form": ("DMIG    KAA            0       9       2\n", "has form 9"),
    "dmig nothing": ("DMIG,KAA,0,6,2\n", "have no entries"),
}  # fmt: skip


@pytest.mark.sample(-1)
@pytest.mark.parametrize("case", BAD)
def test_one_sentence_for_a_bad_file(case, tmp_path):
    text, says = BAD[case]
    bad = tmp_path / "bad"
    bad.write_text(text)
    with pytest.raises(ao.InputError, match=says) as caught:
        ao.Structure.from_files(bad, bad)
    assert "\n" not in str(caught.value)
    tracemalloc.start()  # what the first call has imported does not count
    try:
        with pytest.raises(ao.InputError):
            ao.Structure.from_files(bad, bad)
        assert tracemalloc.get_traced_memory()[1] < 1e7
    finally:
        tracemalloc.stop()


@pytest.mark.parametrize("count", [15, pytest.param(300, marks=pytest.mark.slow)])
def test_bad_binary_files_are_refused(count, tmp_path):
    good = tmp_path / "good.op4"
    op4_binary(good, {"KAA": K, "MAA": M}, "bigmat")
    content = good.read_bytes()
    bad = tmp_path / "bad.op4"
    for size in range(1, len(content), len(content) // count):  # cut anywhere
        bad.write_bytes(content[:size])
        with pytest.raises(ao.AntioscError):
            ao.Structure.from_files(bad, bad)
    rng = np.random.default_rng(0)
    for _ in range(count):  # any byte wrong: an error of ours, or matrices that are checked
        wrong = bytearray(content)
        wrong[rng.integers(len(content))] = int(rng.integers(256))
        bad.write_bytes(bytes(wrong))
        with contextlib.suppress(ao.AntioscError):
            ao.Structure.from_files(bad, bad)


def test_k_and_m_of_different_models(tmp_path):
    matrix_market(tmp_path / "K.mtx", K)
    matrix_market(tmp_path / "M.mtx", M[:-1, :-1])
    with pytest.raises(ao.InputError, match=r"K\.mtx 15 rows, M\.mtx 14"):
        ao.Structure.from_files(tmp_path / "K.mtx", tmp_path / "M.mtx")
    abaqus_labels(tmp_path / "K.mtx", K[:-1, :-1], LABELS[:-1])
    abaqus_labels(tmp_path / "M.mtx", M, LABELS)
    with pytest.raises(ao.InputError, match=r"M\.mtx has dof 3 of node 50, which K\.mtx has not"):
        ao.Structure.from_files(tmp_path / "K.mtx", tmp_path / "M.mtx")
    for bad in ("nowhere", tmp_path):
        with pytest.raises(ao.InputError, match="there is no matrix file"):
            ao.Structure.from_files(bad, bad)


ONE = ao.AntiOscillators(m0=0.02, k0=3e5, m=[0.3, 0.05, 0.2], omega=[900.0, 2500.0, 7000.0])
TWO = ao.AntiOscillators(
    m0=[[0.2, 0.01], [0.01, 0.1]],
    k0=[[3e5, -1e5], [-1e5, 2e5]],
    P=[[0.3, -0.1, 0.2], [0.1, 0.4, 0.05]],
    omega=[900.0, 2500.0, 7000.0],
    sites=("a", "b"),
)
OMEGA = np.array([10.0, 500.0, 1500.0, 3000.0, 9000.0])


def condensed(K, M, sites: int) -> np.ndarray:
    """Z(ω) of matrices by elimination of all dofs but the first `sites`."""
    found = []
    for omega in OMEGA:
        D = K - omega**2 * M
        inner = np.linalg.solve(D[sites:, sites:], D[sites:, :sites])
        found.append(D[:sites, :sites] - D[:sites, sites:] @ inner)
    return np.array(found)


@pytest.mark.parametrize("model", [ONE, TWO], ids=["one site", "two sites"])
def test_the_matrices_have_the_driving_point_of_the_model(model):
    own = model.to_matrices()
    p = len(model.sites) or 1
    Z = np.asarray(model.dynamic_stiffness(OMEGA)).reshape(-1, p, p)
    np.testing.assert_allclose(condensed(own.K, own.M, p), Z, rtol=1e-12, atol=1e-12 * abs(Z).max())
    assert own.labels.tolist() == [[k + 1, 0] for k in range(p + 3)]
    assert np.linalg.eigvalsh(own.M).min() > 0


@pytest.mark.parametrize("model", [ONE, TWO], ids=["one site", "two sites"])
def test_written_matrices_read_again(model, tmp_path):
    p = len(model.sites) or 1
    dofs = ["z", "x"][:p]
    written = model.to_matrices([70, 71][:p], dofs).save(tmp_path / "x.mtx")
    assert all(path.is_file() for path in written)
    pair = read_pair(*written[:2])
    assert abs(pair.K - pair.K.T).max() == 0
    K, M = (A.toarray() for A in (pair.K, pair.M))
    Z = np.asarray(model.dynamic_stiffness(OMEGA)).reshape(-1, p, p)
    np.testing.assert_allclose(condensed(K, M, p), Z, rtol=1e-12, atol=1e-12 * abs(Z).max())
    part = ao.Structure.from_files(*written[:2], map=written[-1])
    again = ao.extract(part, ao.Site(node=70, dof="z"), n=3, tol=1e-14)
    if p == 1:
        assert again.k0 == pytest.approx(model.k0, rel=1e-9)
        np.testing.assert_allclose(again.omega, model.omega, rtol=1e-8)


@pytest.mark.parametrize(
    ("arguments", "says"),
    [
        ({"nodes": [1, 2]}, "must name 1 site dofs"),
        ({"nodes": 0}, "nodes must be"),
        ({"dofs": "w"}, "dof must be one of"),
    ],
)
def test_numbers_that_do_not_fit(arguments, says):
    with pytest.raises(ao.InputError, match=says):
        ONE.to_matrices(**arguments)


def test_a_free_model_and_a_massless_site():
    free = ao.AntiOscillators(m0=0.0, k0=0.0, m=[2.0, 1.0], omega=[100.0, 200.0])
    own = free.to_matrices()
    np.testing.assert_allclose(
        condensed(own.K, own.M, 1).ravel(), free.dynamic_stiffness(OMEGA), rtol=1e-12
    )
