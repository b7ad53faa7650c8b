"""The benchmark on its smallest case: every method runs, errors fall with N, tables hold them."""

from __future__ import annotations

import sys

import pytest

from paths import BENCHMARKS

pytest.importorskip("dolfinx")

sys.path.insert(0, str(BENCHMARKS))

import speed_accuracy

pytestmark = pytest.mark.fem


@pytest.mark.slow
def test_chart_of_the_beam(tmp_path):
    found = speed_accuracy.chart("beam", None, quick=True)
    errors = {}
    for row in found["rows"]:
        errors.setdefault(row["method"], []).append((row["n"], row["error force"], row["error Z"]))
    methods = {*speed_accuracy.COUNTS, "unreduced, all modes", "unreduced, Newmark"}
    assert methods <= set(errors)
    for method in speed_accuracy.COUNTS:
        ascending = sorted(errors[method])
        assert ascending[-1][1] < 0.2 * ascending[0][1]
        assert ascending[-1][2] < 0.2 * ascending[0][2]
    assert errors["unreduced, all modes"][0][1] < 1e-4
    speed_accuracy.plot(found, tmp_path)
    assert [p.suffix for p in tmp_path.iterdir()] == [".png"]
    grown = {
        "dofs": 1,
        "ranks": 1,
        "over the floor": 1.5,
        "mesh over the floor": 0.5,
        "whole": 1.0,
        "memory": 1.0,
        "memory factored": 1.0,
        "seconds": {"mesh": 1.0, "assembly": 1.0, "factorization": 1.0, "20 anti-oscillators": 1.0},
    }
    text = speed_accuracy.tables(
        {
            "charts": [found],
            "growth": [grown],
            "ranks": [grown],
            "profile": {"dofs": 1, "solves": 2.5},
            "maps": [{"part": "bracket", "sites": 3, "seconds": {"models": 0.5}}],
        }
    )
    assert text.count("| Krylov |") == len(errors["Krylov"])
