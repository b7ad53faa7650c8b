"""The measured part is struck as the part itself, and the benchmark's parts are sound."""

from __future__ import annotations

import numpy as np
import pytest

pytest.importorskip("matplotlib")

from paths import demo


@pytest.mark.slow
def test_measured_part(tmp_path):
    found = demo("measured_part").main(top=6e3, lines=500, out=tmp_path)
    assert abs(found["peak error"]) < 0.02
    assert found["L2"] < 0.03
    assert (tmp_path / "measured_part.png").stat().st_size > 0


@pytest.mark.slow
@pytest.mark.parametrize("kind", ["bar", "plate", "solid"])
def test_parts_of_the_benchmark(kind):
    omega, b, mass = demo("measured_frf").KINDS[kind](np.random.default_rng(0))
    assert np.all(np.diff(omega) >= 0)
    free = omega == 0
    # a free body is not easier to move than its half
    assert np.sum(b[free] ** 2) < 8 / mass
    assert np.mean(b[~free][:40] ** 2) == pytest.approx(1 / mass, rel=0.9)


@pytest.mark.slow
def test_measured_frf(tmp_path):
    (case,) = demo("measured_frf").main(parts=1, kinds=("bar",), page=str(tmp_path / "page.md"))[:1]
    assert case["passive"]
    assert case["L2"] < 0.01
    assert "| bar, 1% |" in (tmp_path / "page.md").read_text()


# --- The demo of dashpots keeps the accuracy that its page states ---------------------------------


@pytest.mark.slow
def test_tip_damper(tmp_path):
    found = demo("tip_damper").main(modes=12, n=10, out=tmp_path)
    assert found["error"] < 1e-3
    assert found["with ratios"] > 1e-2
    assert (tmp_path / "tip_damper.png").stat().st_size > 0
