"""The demo of a blow that is found, and signals of another program."""

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


@pytest.mark.skipif(shutil.which("ccx") is None, reason="needs CalculiX")
@pytest.mark.filterwarnings("ignore:the signals determine")  # a half-sine has no Hertz contact
def test_signals_of_calculix():
    errors = demo("find_impact_calculix").main()
    assert errors["place over the side"] < 0.02
    assert abs(errors["peak force"]) < 0.05
    assert abs(errors["impulse"]) < 0.03
