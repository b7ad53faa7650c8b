"""The demos of plates and shells run, small, and return what mechanics asks for."""

from __future__ import annotations

import pytest

from paths import demo

pytestmark = pytest.mark.fem


@pytest.mark.slow
def test_plate_impact(tmp_path, capsys):
    """No reflection returns on the large plate: Zener's restitution, within 1 %."""
    numbers = demo("plate_impact").main(
        inelasticities=(0.1, 0.3, 0.5), sizes=(3.0, 8.0), elements=20, n=40, out=tmp_path
    )
    for lam in ("0.1", "0.3", "0.5"):
        assert numbers[f"{lam} 8"] == pytest.approx(numbers[f"{lam} zener"], rel=1e-2)
    # on the small one waves return within the contact
    assert abs(numbers["0.5 3"] / numbers["0.5 zener"] - 1) > 0.05
    assert 0 < numbers["off-centre"] < 1
    assert (tmp_path / "plate_impact.png").stat().st_size > 0
    assert "Zener" in capsys.readouterr().out


@pytest.mark.slow
def test_stiffened_panel(tmp_path):
    """Stiffeners as beams or as shells: two models of one panel."""
    numbers = demo("stiffened_panel").main(n=20, duration=1e-3, out=tmp_path)
    for row in numbers.values():
        assert row["impulse"] == pytest.approx(row["momentum"], rel=1e-6)
    for place in ("between stringers", "over a stringer"):
        beams, shells = numbers[f"beams, {place}"], numbers[f"shells, {place}"]
        # the blades' own volume where they meet, and their modes, are all that differs
        assert beams["mass"] == pytest.approx(shells["mass"], rel=3e-3)
        assert beams["first"] == pytest.approx(shells["first"], rel=1e-2)
        assert beams["k0"] == pytest.approx(shells["k0"], rel=5e-2)
        assert beams["peak_force"] == pytest.approx(shells["peak_force"], rel=5e-2)
    # a stringer stiffens the place above it
    assert numbers["shells, over a stringer"]["k0"] > 3 * numbers["shells, between stringers"]["k0"]
    assert (tmp_path / "stiffened_panel.png").stat().st_size > 0
    assert len(list(tmp_path.glob("*.vtu"))) == 30


@pytest.mark.slow
def test_guard_thickness(tmp_path, capsys):
    """At equal mass a third less force and more, within 20 runs; bars beside the gradients."""
    numbers = demo("guard_thickness").main(size=0.1, n=12, out=tmp_path)
    assert numbers["best"] < 0.7 * numbers["uniform"]
    assert numbers["runs"] <= 20
    assert numbers["mass"] == pytest.approx(1.0, rel=1e-6)
    assert (tmp_path / "guard_thickness.png").stat().st_size > 0
    assert "bar" in capsys.readouterr().out
