"""Small files of every text format, written out here: their matrices, and whole messages."""

from __future__ import annotations

import contextlib
import struct

import numpy as np
import pytest

import antiosc as ao
from antiosc.io.matrices import read_pair
from refusals import refused

#: One matrix in all files of `GOOD`, by rows of the nodes 4 and 7.
A = [[2.0, -1.0], [-1.0, 3.5]]
LABELS = [[4, 1], [7, 3]]
MTX = "%%MatrixMarket matrix coordinate real symmetric\n"
HEAD = "DMIG,KAA,0,6,2\n"


def op4(layout: str = "1P,3E24.16", *, rows: int = 2, columns: int = 2, form: int = 6,
        kind: int = 2, name: str = "KAA") -> str:  # fmt: skip
    return f"{columns:8d}{rows:8d}{form:8d}{kind:8d}{name:8}{layout}\n"


def row(*values: int) -> str:
    return "".join(f"{v:8d}" for v in values) + "\n"


E24 = [f"{v:24.16E}" for v in (2.0, -1.0, 3.5)]
COLUMNS = row(1, 1, 2) + E24[0] + E24[1] + "\n" + row(2, 1, 2) + E24[1] + E24[2] + "\n"
END = row(3, 1, 1) + f"{1.0:24.16E}\n"
#: Strings of a sparse matrix: length and row in one word.
STRING = row((3 << 16) + 1)
HB = [f"{'t':72}k", f"{4:14d}{1:14d}{1:14d}{1:14d}{0:14d}",
      f"RUA{'':11}{2:14d}{2:14d}{4:14d}{0:14d}",
      f"{'(3I4)':16}{'(4I4)':16}{'(4E6.1)':20}", "   1   3   5", "   1   2   1   2",
      "   2.0  -1.0  -1.0   3.5"]  # fmt: skip

GOOD = {
    "abaqus, coordinates": ("1 1 2.\n2 1 -1.\n2 2 3.5D+00\n", None),
    "abaqus, unsymmetric": ("*MATRIX, TYPE=UN SYMMETRIC\n1,1,2.\n2,1,-1.\n1,2,-1.\n"
                            "2,2,3.5,\n", None),
    "abaqus, labels": ("4,1,4,1,2.\n** no entry\n\n4,1,7,3,-1.\n7,3,7,3,3.5\n", LABELS),
    "mtx, words": (MTX.replace("real", "DOUBLE") + "%\n2 2 3\n\n1 1 2\n2 1 -1\n2 2 3.5\n", None),
    "mtx, repeated": (MTX + "2 2 4\n1 1 1.5\n1 1 0.5\n2 1 -1\n2 2 3.5\n", None),
    "mtx, general": (MTX.replace("symmetric", "general")
                     + "2 2 4\n1 1 2\n1 2 -1\n2 1 -1\n2 2 3.5\n", None),
    "mtx, zeros": ("%%MatrixMarket matrix array real general\n2 2\n2\n-1\n-1\n3.5\n", None),
    "hb": ("\n".join(HB) + "\n", None),
    "hb, symmetric, with a right-hand side": ("\n".join(
        [HB[0], f"{5:14d}{1:14d}{1:14d}{1:14d}{1:14d}", f"RSA{'':11}{2:14d}{2:14d}{3:14d}{0:14d}",
         HB[3], f"{'F':14}{1:14d}{2:14d}", "   1   3   4", "   1   2   2", "   2.0  -1.0   3.5",
         "   0.0   0.0"]), None),
    "hb, a line fewer": ("\n".join(HB).replace("(3I4)", "(8I4)"), None),
    "hb, no counts": ("\n".join([*HB[:3], HB[3].replace("(3I4)", "(I8) "), *"135", *HB[5:]]), None),
    "dmig, scalar points": (HEAD + "DMIG,KAA,4,,,4,,2.\n+,7,0,-1.\nDMIG,KAA,7,0,,7,,3.5\n",
                            [[4, 0], [7, 0]]),
    "dmig, free": (HEAD + "DMIG,KAA,4,1,,4,1,2.\n+,7,3,-1.\nDMIG,KAA,7,3,,7,3,3.5\n", LABELS),
    "dmig, two in a line": (HEAD + "DMIG,KAA,4,1,,4,1,2.,,+A\n+A,7,3,-1.\n"
                            "GRID,4\n,7,3,9.\nDMIG,KAA,7,3,,7,3,3.5\n", LABELS),
    "dmig, both in the second": (HEAD + "DMIG,KAA,4,1,,,,,,+A\n+A,4,1,2.,,7,3,-1.$\n"
                                 "$\n\ndmig,kaa,7,3,,7,3,3.5\n", LABELS),
    "dmig, large free": (HEAD + "DMIG*,KAA,4,1,,9,9,9\n*,4,1,2.D0,,9,9,9\n*,7,3,-1.\n"
                         "DMIG*,KAA,7,3\n*,7,3,3.5\n", LABELS),
    "dmig, large": ("DMIG    KAA            0       6       1\n"
                    "DMIG*   KAA                            4               1\n"
                    "*BC                    4               1           2.0+0\n"
                    "*                      7               3              -1.\n"
                    "DMIG*   KAA                            7               3        \n"
                    "*                      7               3             3.5\n", LABELS),
    "dmig, tabs": ("DMIG\tKAA\t0\t1\t2\nDMIG\tKAA\t4\t1\t\t4\t1\t2.\n\t7\t3\t-1.\n"
                   "DMIG\tKAA\t7\t3\t\t4\t1\t-1.\n\t7\t3\t3.5\n", LABELS),
    "op4, dense": (op4() + COLUMNS + END, None),
    "op4, long name": (op4(name="STIFFNES", form=1) + COLUMNS + END + "\n \n", None),
    "op4, one a line": (op4("1P,1E24.16", form=19) + row(1, 1, 2) + E24[0] + "\n" + E24[1] + "\n"
                        + row(2, 1, 2) + E24[1] + "\n" + E24[2] + "\n" + END, None),
    "op4, sixteen digits": (op4("") + row(1, 1, 2) + f"{2.0:16.9E}{-1.0:16.9E}\n" + row(2, 1, 2)
                            + f"{-1.0:16.9E}{3.5:16.9E}\n" + END, None),
    "op4, single": (op4(kind=1) + row(1, 0, 3) + STRING + E24[0] + E24[1] + "\n" + row(2, 0, 4)
                    + row((2 << 16) + 1) + E24[1] + "\n" + row((2 << 16) + 2) + E24[2] + "\n"
                    + END, None),
    "op4, an empty string": (op4() + row(1, 0, 6) + row((1 << 16) + 1) + row((5 << 16) + 1) + E24[0]
                             + E24[1] + "\n" + row(2, 1, 2) + E24[1] + E24[2] + "\n" + END, None),
    "op4, large": (op4(rows=-2) + row(1, 0, 6) + row(5, 1) + E24[0] + E24[1] + "\n" + row(2, 0, 6)
                   + row(5, 1) + E24[1] + E24[2] + "\n" + END, None),
    "op4, wide": (f"{2:16d}{2:16d}{6:8d}{2:8d}KAA     1P,3E24.16|I16\n"
                  + COLUMNS.replace("       ", f"{'':15}").replace(f"{'':15} ", f"{'':8} ")
                  + f"{3:16d}{1:16d}{1:16d}\n" + E24[0] + "\n", None),
    "op4, blanks": (op4() + f"{1:9d}{1:8d}{2:8d}\n" + COLUMNS.partition("\n")[2] + END, None),
}  # fmt: skip


@pytest.mark.parametrize("case", GOOD)
def test_every_form_of_one_matrix(case, tmp_path):
    text, labels = GOOD[case]
    path = tmp_path / "a"
    path.write_text(text)
    pair = read_pair(path, path)
    for found in (pair.K, pair.M):
        np.testing.assert_array_equal(found.toarray(), A)
    assert (pair.labels if labels is None else pair.labels.tolist()) == labels


def wrong_hb(**lines: str) -> str:
    own = dict(enumerate(HB, 1)) | {int(k[1:]): text for k, text in lines.items()}
    return "\n".join(own.values()) + "\n"


WRONG = {
    "no entries": ("** nothing\n", 1, "file"),
    "abaqus row 0": ("1 1 1.\n0 1 1.\n", 2, "nodes"),
    "mtx fraction": (MTX + "2 2 2\n1 1 1\n% \n1.5 1 1\n", None, "damaged"),
    "mtx size": (MTX + "%\n2 2.5 1\n", None, "damaged"),
    "mtx no size": (MTX + "%\n%\n", 3, "ends"),
    "infinite": (MTX + "3 3 3\n1 1 1\n3 2 inf\n3 3 1\n", None, "finite"),
    "mixed": ("1 1 2.\n1 2 -1.\n2 1 -1.\n2 2 1.\n3 2 1.\n3 3 1\n", None, "triangles"),
    "hb ends": ("\n".join(HB[:4]), 4, "ends"),
    "hb pattern": (wrong_hb(_3=HB[2].replace("RUA", "PUA")), 3, "without"),
    "hb kind": (wrong_hb(_3=HB[2].replace("RUA", "rza")), 3, "RZA"),
    "hb pointers": (wrong_hb(_5="   1   5   3"), 5, "pointers"),
    "hb row 0": (wrong_hb(_6="   1   0   1   2"), 7, "indices"),
    "dmig point 0": (HEAD + "DMIG,KAA,1,1,,-3,1,1.\n", 2, "exist"),
    "op4 form 0": (op4(form=0), 1, "2KAA"),
    "op4 no layout": (op4("0E0"), 1, "2KAA"),
    "op4 second": (op4() + COLUMNS + END + "MAA\n", 8, "name"),
    "op4 full fields": (
        op4(rows=12345678, columns=12345678) + "1234567812345678       1\n" + E24[0]
                        + "\n" + row(12345679, 1, 1) + E24[0] + "\n", None, "entries"),
}  # fmt: skip


@pytest.mark.parametrize("case", WRONG)
def test_what_is_wrong_is_told_with_its_line(case, tmp_path):
    text, line, word = WRONG[case]
    path = tmp_path / "bad"
    path.write_text(text)
    with refused(line, word, ao.InputError):
        read_pair(path, path)


def record(content: bytes, order: str = "<") -> bytes:
    mark = struct.pack(order + "i", len(content))
    return mark + content + mark


NAME = struct.pack("<4i", 2, 2, 6, 2) + b"KAA     "


DAMAGED = {
    "short record": (record(NAME) + record(b"12345678"), None, "expected"),
    "column": (record(NAME) + record(struct.pack("<3i", 0, 1, 0)), None, "column 0"),
    "words": (record(NAME) + record(struct.pack("<3i", 2, 1, 1)), None, "column 2"),
    "marker": (record(NAME) + struct.pack("<i4si", 4, b"abcd", 5), None, "ends with 5"),
    "cut": (record(NAME) + struct.pack("<i4s", 4, b"abcd"), None, "ends within"),
    "string": (record(NAME) + record(struct.pack("<4i", 1, 0, 1, (2 << 16) + 1)), None, "string"),
    "second header": (
        record(NAME) + record(struct.pack("<3i", 3, 1, 1)) + record(b"abcd"), None, "header"),
}  # fmt: skip


@pytest.mark.parametrize("case", DAMAGED)
def test_damaged_records_are_told_with_their_byte(case, tmp_path):
    content, line, word = DAMAGED[case]
    path = tmp_path / "bad"
    path.write_bytes(content)
    with refused(line, word, ao.InputError):
        read_pair(path, path)


@pytest.mark.parametrize("count", [1, pytest.param(20, marks=pytest.mark.slow)])
@pytest.mark.parametrize("case", GOOD)
def test_changed_files_are_read_or_refused(case, count, tmp_path):
    rng = np.random.default_rng(1)
    content, path = GOOD[case][0].encode(), tmp_path / "a"
    for _ in range(count):
        wrong, at = bytearray(content), int(rng.integers(len(content)))
        wrong[at : at + int(rng.integers(1, 4))] = rng.choice([b"9", b" ", b"-", b"\n", b"x"])
        path.write_bytes(bytes(wrong))
        with contextlib.suppress(ao.InputError):
            read_pair(path, path)
