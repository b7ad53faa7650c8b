"""The demos of error budgets run, small, and find what they promise."""

from __future__ import annotations

import json

import numpy as np
import pytest

from paths import demo

pytestmark = [pytest.mark.fem, pytest.mark.slow]


def test_random_parts(tmp_path, capsys):
    cases = demo("error_budget").main(parts=4, seed=4, out=str(tmp_path / "cases.json"))
    assert len(cases) == 4
    assert sum(case.holds for case in cases) >= 3
    assert 0.4 < np.median([case.k0 for case in cases]) < 2.5
    assert np.median([case.corrected for case in cases]) < 0.8
    assert len(json.loads((tmp_path / "cases.json").read_text())) == 4
    assert "| all | 4 |" in capsys.readouterr().out
