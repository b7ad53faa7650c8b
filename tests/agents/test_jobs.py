"""Ten jobs of an engineer by calls of tools alone, each beside a figure of its own."""

from __future__ import annotations

import pytest

from paths import demo

pytest.importorskip("mcp")
pytestmark = [pytest.mark.fem, pytest.mark.slow]


def test_ten_jobs_are_right():
    rows = demo("agents").main()
    assert len(rows) == 10
    for question, found, figure in rows:
        assert found == pytest.approx(figure, rel=0.03), question
