"""The demo of dashpots keeps the accuracy that its page states."""

from __future__ import annotations

import pytest

from paths import demo

pytest.importorskip("matplotlib")


@pytest.mark.slow
def test_tip_damper(tmp_path):
    found = demo("tip_damper").main(modes=12, n=10, out=tmp_path)
    assert found["error"] < 1e-3
    assert found["with ratios"] > 1e-2
    assert (tmp_path / "tip_damper.png").stat().st_size > 0
