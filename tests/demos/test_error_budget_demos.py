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


def test_strike_over_lines(tmp_path):
    page = tmp_path / "beams.md"
    rows = demo("strike_beams").main(cases=2, seed=1, tols=(0.01,), page=str(page))
    assert len(rows) == 2
    for row in rows:
        assert row["true"] <= row["promised"] <= row["asked"]
        assert row["ratio"] <= 1
    assert "| 1.0% | 2 | 100% | 100% | 100% |" in page.read_text()


def test_random_shells(tmp_path, capsys):
    script = demo("shell_error_bars")
    script.HALVINGS, script.COSTLY, script.ROUNDS = 1, {"plate": 0.3}, 1
    out, page = tmp_path / "shells.jsonl", tmp_path / "page.md"
    (first,) = script.main(shells=1, seed=3, out=str(out))
    cases = script.main(shells=2, seed=3, out=str(out), page=str(page))
    assert [case.number for case in cases] == [0, 1]
    assert cases[0] == first
    assert all(case.holds and not case.refused for case in cases)
    told = capsys.readouterr().out
    assert "| all | 2 | 100% |" in told
    assert "| all | 2 | 100% |" in page.read_text()
    assert "| plate |" in page.read_text()


@pytest.mark.filterwarnings("ignore:the facets at the site")  # of a coarse mesh
def test_beams_beside_solid_bars(tmp_path):
    page = tmp_path / "model.md"
    (found,) = demo("beam_model").main(bars=1, fine=0.6, page=str(page))
    pairs = [pair for blow in found["blows"] for pair in blow.values()]
    assert max(true / share for true, share in pairs) <= 1
    assert max(true for true, _ in pairs) > 0.03
    assert found["compliance"] < -0.5
    assert "30 of 30" in page.read_text()
