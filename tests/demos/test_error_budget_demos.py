"""The demos of error budgets run, small, and find what they promise."""

from __future__ import annotations

import json

import numpy as np
import pytest

from paths import demo

pytestmark = [pytest.mark.fem, pytest.mark.slow]


def test_random_parts(tmp_path, capsys):
    out = tmp_path / "cases.jsonl"
    main = demo("error_budget").main
    assert len(main(parts=2, seed=4, dim=2, out=str(out))) == 2
    cases = main(parts=4, seed=4, dim=2, out=str(out))
    assert len(cases) == 4
    assert sum(case.holds for case in cases) >= 3
    assert 0.4 < np.median([case.k0 for case in cases]) < 2.5
    assert np.median([case.corrected for case in cases]) < 0.8
    rows = [json.loads(row) for row in out.read_text().splitlines()]
    assert [row["number"] for row in rows] == [0, 1, 2, 3]
    assert out.with_suffix(".png").exists()
    assert "| all | 4 |" in capsys.readouterr().out
