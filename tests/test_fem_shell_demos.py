"""The demos of plates and shells run, small, and return what mechanics asks for."""

from __future__ import annotations

import pytest

from test_demos import load

pytestmark = pytest.mark.fem


def test_plate_impact(tmp_path, capsys):
    """No reflection returns on the large plate: Zener's restitution, within 1 %."""
    numbers = load("plate_impact").main(
        inelasticities=(0.1, 0.3, 0.5), sizes=(3.0, 8.0), elements=20, n=40, out=tmp_path
    )
    for lam in ("0.1", "0.3", "0.5"):
        assert numbers[f"{lam} 8"] == pytest.approx(numbers[f"{lam} zener"], rel=1e-2)
    # on the small one waves return within the contact
    assert abs(numbers["0.5 3"] / numbers["0.5 zener"] - 1) > 0.05
    assert 0 < numbers["off-centre"] < 1
    assert (tmp_path / "plate_impact.png").stat().st_size > 0
    assert "Zener" in capsys.readouterr().out
