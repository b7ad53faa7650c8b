"""Files of stiffness and mass matrices: every format, and files that are no such thing."""

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
    with pytest.raises(ao.InputError, match=r"km\.op4 holds the matrices A1, KGG, KAA, MAA"):
        read_pair(tmp_path / "km.op4", tmp_path / "km.op4")
    same(read_pair(tmp_path / "km.op4", tmp_path / "km.op4", names=("a1", "maa")))


MTX = "%%MatrixMarket matrix coordinate real symmetric\n"
HB = f"{'t':72}k\n{5:14d}{1:14d}{1:14d}{1:14d}{0:14d}\n"
BAD = {
    "1e12 entries": (MTX + "9 9 1000000000000\n1 1 1.0\n", r"promises 1e\+12 entries"),
    "1e12 rows": (MTX + "1000000000000 1000000000000 1\n1 1 1.0\n", r"1e\+12 rows, but K and M"),
    "dense 1e12": ("%%MatrixMarket matrix array real general\n1000000 1000000\n1.0\n", "promises"),
    "nan": (MTX + "1 1 1\n1 1 nan\n", "holds nan at row 1, column 1"),
    "out of range": (MTX + "2 2 1\n3 1 1.0\n", "bad, line 3: rows and columns are 1 to 2"),
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
    with pytest.raises(ao.InputError, match=r"K\.mtx has 15 rows, M\.mtx 14"):
        ao.Structure.from_files(tmp_path / "K.mtx", tmp_path / "M.mtx")
    abaqus_labels(tmp_path / "K.mtx", K[:-1, :-1], LABELS[:-1])
    abaqus_labels(tmp_path / "M.mtx", M, LABELS)
    with pytest.raises(ao.InputError, match=r"M\.mtx has dof 3 of node 50, which K\.mtx has not"):
        ao.Structure.from_files(tmp_path / "K.mtx", tmp_path / "M.mtx")
    for bad, says in (("nowhere", "does not exist"), (tmp_path, "is a folder")):
        with pytest.raises(ao.InputError, match=says):
            ao.Structure.from_files(bad, bad)
