"""What a run prints: does the part break, how hard, how far, where; a few rows and cautions."""

from __future__ import annotations

import pytest

from antiosc_app import cli
from antiosc_app.cards import (
    BREAKS_QUESTION,
    DEFLECTION_QUESTION,
    FORCE_QUESTION,
    MAX_CAUTIONS,
    MAX_ROWS,
    STRESS_QUESTION,
)
from scene_files import BEAM, BRACKET, HIT, PROBE, written


def printed(capsys, path, *options):
    """The lines that a run prints, without those on its files."""
    assert cli.main(["run", str(path), *options]) == 0
    said = capsys.readouterr()
    lines = [line for line in said.out.splitlines() if not line.startswith("wrote")]
    return lines, said.err


@pytest.mark.parametrize(
    "scene",
    [
        BEAM + PROBE,
        pytest.param(
            f"{BRACKET}[extract]\nn = 4\n{HIT}", marks=[pytest.mark.fem, pytest.mark.slow]
        ),
    ],
)
def test_four_answers_stand_first_and_fifteen_lines_are_enough(tmp_path, capsys, scene):
    path = written(tmp_path, scene)
    lines, warned = printed(capsys, path)
    rows = lines[1:] if "title" in scene else lines
    for name, row in zip(
        (BREAKS_QUESTION, FORCE_QUESTION, DEFLECTION_QUESTION, STRESS_QUESTION), rows, strict=False
    ):
        assert row.startswith(f"{name} ")
    assert len(lines) <= 1 + 4 + MAX_ROWS + MAX_CAUTIONS - 1 == 15
    assert "warning" not in warned
    told, _ = printed(capsys, path, "--verbose")
    assert len(told) > len(lines)
    same = [" ".join(row.split()) for row in told]
    assert all(" ".join(row.split()) in same for row in rows[:4])
