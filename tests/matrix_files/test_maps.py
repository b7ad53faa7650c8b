"""Maps of the rows of matrices: their forms in files, and whole messages."""

from __future__ import annotations

import numpy as np
import pytest

import antiosc as ao
from antiosc.io.dof_map import dof_map, rows_of
from refusals import refused

TABLE = [[1, 10, 1], [2, 10, 2], [3, 20, 1]]
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
    assert rows_of({20: "all", 10: ["uy"]}, found).tolist() == [1, 2]


def test_columns_of_four_rows():
    found = dof_map(([10, 10, 20, 20], ["x", 2, "UX", "t2"]), None, 4)
    assert (found.node.tolist(), found.component.tolist()) == ([10, 10, 20, 20], [1, 2, 1, 2])


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


def test_supports_are_a_dict_of_nodes():
    rows = dof_map(np.array(TABLE)[:, 1:], None, 3)
    with pytest.raises(ao.InputError, match="supports must be a dict of node"):
        rows_of([10], rows)
