"""The demo and the campaign of blows that are found."""

from __future__ import annotations

import shutil

import pytest

from paths import demo

pytest.importorskip("dolfinx")
pytest.importorskip("gmsh")
pytest.importorskip("matplotlib")
pytestmark = [pytest.mark.fem, pytest.mark.slow]


def test_find_blow(tmp_path):
    errors = demo("find_blow").main(out=tmp_path)
    assert errors["place"] < 2e-3
    assert abs(errors["peak force"]) < 0.05
    assert (tmp_path / "find_blow.png").stat().st_size > 0


def test_the_campaign(tmp_path):
    cases = demo("find_impact").main(blows=1, page=str(tmp_path / "page.md"))
    assert {case["kind"] for case in cases} == {"plate", "shell"}
    assert all(case["place"] < 0.02 and abs(case["peak_force"]) < 0.05 for case in cases)
    assert "| plate, 3% |" in (tmp_path / "page.md").read_text()


@pytest.mark.skipif(shutil.which("ccx") is None, reason="needs CalculiX")
@pytest.mark.filterwarnings("ignore:the signals determine")  # a half-sine has no Hertz contact
def test_signals_of_calculix():
    errors = demo("find_impact_calculix").main()
    assert errors["place over the side"] < 0.02
    assert abs(errors["peak force"]) < 0.05
    assert abs(errors["impulse"]) < 0.03
