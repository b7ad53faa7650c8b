"""The chart of local quantities: the unreduced model is met in the limit."""

from __future__ import annotations

import pytest

from paths import demo


@pytest.mark.fem
@pytest.mark.slow
def test_all_quantities_converge_to_the_unreduced_model(tmp_path):
    found = demo("local_quantities").main(
        cases=("frame",), counts=(40, 400), duration=6e-4, points=4, out=tmp_path
    )
    for name in ("force", "displacement", "section_forces", "acceleration", "srs"):
        assert found["frame 400"][name] < 0.5 * found["frame 40"][name]
        assert found["frame reference"][name] < 0.02 * found["frame 40"][name]
    assert found["frame 400"]["section_forces"] < 5e-3
    assert found["frame 400"]["acceleration"] < 5e-2
    assert found["frame 400"]["resolved"] > 2 * found["frame 40"]["resolved"]
    assert (tmp_path / "local_quantities.png").stat().st_size > 0
    assert "## frame" in (tmp_path / "local_quantities.md").read_text(encoding="utf-8")
