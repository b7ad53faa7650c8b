"""Columns of the files of results: their names, units and order."""

from __future__ import annotations

import json
import math
from types import SimpleNamespace

import numpy as np
import pytest

from antiosc.app.scene_file import output, result_tables

RNG = np.random.default_rng(5)


@pytest.mark.parametrize(
    ("quantity", "shape", "names"),
    [
        ("von_mises", (), [" (Pa)"]),
        ("velocity", (2,), [" x (m/s)", " y (m/s)"]),
        ("acceleration", (3,), [" x (m/s²)", " y (m/s²)", " z (m/s²)"]),
        ("rotation", (1,), [" z (rad)"]),
        ("section_forces", (3,), [" N (N)", " V (N)", " M (N m)"]),
        ("strain", (3, 3), [" xx", " xy", " xz", " yy", " yz", " zz"]),
    ],
)
def test_every_component_of_a_probe_is_a_column_and_the_largest_is_told(quantity, shape, names):
    values = RNG.normal(size=(7, *shape))
    if len(shape) == 2:
        values = values + values.swapaxes(1, 2)
    call = SimpleNamespace(arguments={"quantity": quantity, "times": np.arange(7.0)})
    compiled, hit = SimpleNamespace(probes={"eye": call}), SimpleNamespace(time=np.arange(7.0))
    results = SimpleNamespace(probes={"eye": values}, compiled=compiled, history=hit)
    found = output._components(results, "eye")
    assert list(found) == [f"eye{name}" for name in names]
    components = values[:, *np.triu_indices(3)] if len(shape) == 2 else values.reshape(7, -1)
    np.testing.assert_array_equal(np.column_stack(list(found.values())), components)
    peak = result_tables.probe_peak(results, "eye")
    size = np.linalg.norm(values, axis=1) if quantity in ("velocity", "acceleration") else values
    assert abs(peak["value"]) == np.abs(size).max()
    assert f" {peak['component']}" in (" magnitude", " ", *(n.partition(" (")[0] for n in names))
    assert peak.get("g", 0) == pytest.approx(
        peak["value"] / 9.80665 if quantity == "acceleration" else 0
    )


def test_files_have_no_nan(tmp_path):
    content = {"a": math.nan, "b": np.array([1.0, math.inf]), "c": np.float64(math.nan), 5: (1,)}
    output.write_numbers(tmp_path / "n.json", content)
    read = json.loads((tmp_path / "n.json").read_text())
    assert [read[key] for key in "abc5"] == [None, [1.0, None], None, [1]]
    output.write_table(tmp_path / "t.csv", {"x, y": [0.1, math.nan], "n": np.array([1, 2])})
    assert (tmp_path / "t.csv").read_text() == '"x, y",n\n0.1,1\n,2\n'
