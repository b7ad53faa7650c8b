"""Columns of the files of results: their names, units and order."""

from __future__ import annotations

import json
import math

import numpy as np
import pytest

from antiosc.app.scene_file import output

RNG = np.random.default_rng(5)


@pytest.mark.parametrize(
    ("shape", "names"),
    [
        ((), [""]),
        ((2,), [" x", " y"]),
        ((3,), [" x", " y", " z"]),
        ((6,), [f" {k}" for k in range(1, 7)]),
        ((3, 3), [" xx", " xy", " xz", " yy", " yz", " zz"]),
    ],
)
@pytest.mark.parametrize("unit", ["", "Pa"])
def test_every_component_of_a_probe_is_a_column(shape, names, unit):
    values = RNG.normal(size=(7, *shape))
    if len(shape) == 2:
        values = values + values.swapaxes(1, 2)
    found = output._components("eye", values, unit)
    assert list(found) == [f"eye{name}{f' ({unit})' if unit else ''}" for name in names]
    components = values[:, *np.triu_indices(3)] if len(shape) == 2 else values.reshape(7, -1)
    np.testing.assert_array_equal(np.column_stack(list(found.values())), components)


def test_files_have_no_nan(tmp_path):
    content = {"a": math.nan, "b": np.array([1.0, math.inf]), "c": np.float64(math.nan), 5: (1,)}
    output.write_numbers(tmp_path / "n.json", content)
    read = json.loads((tmp_path / "n.json").read_text())
    assert [read[key] for key in "abc5"] == [None, [1.0, None], None, [1]]
    output.write_table(tmp_path / "t.csv", {"x, y": [0.1, math.nan], "n": np.array([1, 2])})
    assert (tmp_path / "t.csv").read_text() == '"x, y",n\n0.1,1\n,2\n'
