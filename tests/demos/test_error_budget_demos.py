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


def test_strike_beside_fixed_choices(tmp_path, capsys):
    out = tmp_path / "runs.json"
    script = demo("strike_or_uniform")
    found = script.main(scenes=("plane part",), tols=(0.01,), dofs=15_000, out=str(out))
    rows = found["plane part"]["runs"]
    (own,) = (row for row in rows if row["run"] == "strike")
    assert own["true"] <= own["promised"] <= own["asked"]
    best = [min(r["true"] for r in rows if r["run"] == run) for run in ("fixed", "corrected")]
    assert best[1] < 0.01
    assert json.loads(out.read_text())["plane part"]["runs"] == rows
    assert out.with_suffix(".png").exists()
    assert "over the cheapest fixed choice within 0.01" in capsys.readouterr().out


def test_the_page_is_written_from_both_files(tmp_path):
    parts, runs = tmp_path / "parts.jsonl", tmp_path / "runs.json"
    demo("error_budget").main(parts=2, seed=4, dim=2, out=str(parts))
    demo("strike_or_uniform").main(scenes=("plane part",), tols=(0.01,), dofs=9000, out=str(runs))
    script = demo("error_budget_tables")
    script.structured_blocks.table = lambda: "| blocks |"
    text = script.main(str(parts), str(runs), str(tmp_path / "page.md"))
    assert (tmp_path / "page.md").read_text() == text
    assert "| all | 2 |" in text
    assert "plane part" in text
    assert (tmp_path / "strike_or_uniform.png").exists()


def test_values_are_extrapolated_with_their_order():
    sizes = [1.0, 0.5, 0.3]
    limit, order = demo("structured_blocks").extrapolated([3 + 2 * h**2.5 for h in sizes], sizes)
    assert limit == pytest.approx(3)
    assert order == pytest.approx(2.5)


def test_adapted_meshes_beside_uniform_ones(tmp_path, capsys):
    script, scene = demo("strike_or_uniform"), demo("strike_scenes").SCENES["plane part"]
    path = scene.path(tmp_path)
    _, true = script.truth(scene, path, 15_000)
    found = script.compared(scene, path, true, 1)
    assert [len(found[way]) for way in ("uniform", "adapted")] == [3, 4]
    assert found["adapted"][-1]["corrected"] < found["adapted"][0]["raw"]


def test_strike_over_lines(tmp_path):
    page = tmp_path / "beams.md"
    rows = demo("strike_beams").main(cases=3, seed=1, tols=(0.01,), page=str(page))
    assert len(rows) == 3
    for row in rows:
        assert row["true"] <= row["promised"] <= row["asked"]
        assert row["ratio"] <= 1
    assert "| 1.0% | 3 | 100% | 100% | 100% |" in page.read_text()


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
