"""Every demo runs, small, and returns numbers that mechanics checks."""

from __future__ import annotations

import warnings

import numpy as np
import pytest

import antiosc as ao
from paths import demo


@pytest.mark.fem
@pytest.mark.slow
def test_impact_on_bracket(tmp_path, capsys):
    result = demo("impact_on_bracket").main(size=8e-3, radius=3e-3, n=12, out=tmp_path)
    assert result["impulse"] == pytest.approx(result["momentum"], rel=1e-6)
    assert 0 < result["restitution"] < 1
    assert abs(result["drift"]) < 1e-3
    # A bracket that moves is struck less hard than a half-space of its material that does not:
    # Hertz's peak force there is k^(2/5) (5 m v²/4)^(3/5).
    sphere = ao.Sphere(radius=0.010, E=210e9, nu=0.3, rho=7850.0, velocity=2.0)
    k = sphere.hertz(E=70e9, nu=0.33, radii=(0.018, float("inf"))).stiffness
    rigid = k**0.4 * (1.25 * sphere.mass * sphere.velocity**2) ** 0.6
    assert 0.3 * rigid < result["peak_force"] < rigid
    for name in ("bracket_force.png", "bracket.png", "bracket.npz", "bracket.pvd"):
        assert (tmp_path / name).stat().st_size > 0
    frames = sorted(tmp_path.glob("bracket_*.vtu"))
    assert len(frames) == 40
    table = capsys.readouterr().out
    for row in ("k0 ", "peak force", "contact time", "restitution", "seconds"):
        assert row in table
    assert np.isfinite(list(result.values())).all()


@pytest.mark.fem
@pytest.mark.slow
def test_impact_map(tmp_path):
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # of sites on supports and edges
        found, worst = demo("impact_map").main(size=16e-3, check=1, out=tmp_path)
    assert worst < 0.02
    sphere = ao.Sphere(radius=0.010, E=210e9, nu=0.3, rho=7850.0, velocity=1.0)
    k = sphere.hertz(E=70e9, nu=0.33).stiffness
    rigid = k**0.4 * (1.25 * sphere.mass * sphere.velocity**2) ** 0.6
    # around the bolts supports hold a part of the patch, and the correction for it is too much
    near = np.linalg.norm(found.points[:, None, :2] - [[0.062, 0.014], [0.062, 0.046]], axis=2)
    away = near.min(axis=1) > 0.016
    assert found.peak_force[away].max() < 1.02 * rigid
    assert found.peak_force.min() < 0.7 * rigid
    for name in ("bracket_map.vtu", "bracket_map.png"):
        assert (tmp_path / name).stat().st_size > 0


@pytest.mark.fem
@pytest.mark.slow
def test_drop_chance(tmp_path, capsys):
    """The tilts and the height explain most of it together; floors hardly differ."""
    found = demo("drop_chance").main(falls=60, size=15e-3, out=tmp_path)
    assert found["low"] < found["quantile"] < found["high"]
    shares = np.array([found[name] for name in ("height", "pitch", "roll", "concrete")])
    assert np.all(shares < 1.1)
    for name in ("drop_chance.png", "drop_chance_shares.png"):
        assert (tmp_path / name).stat().st_size > 0
    assert "0 of them failed" in capsys.readouterr().out


# --- Errors of random blows under all laws, by benchmarks/scene_errors.py -------------------------


errors = demo("scene_errors")


@pytest.mark.slow
def test_forces_are_within_the_tolerance_in_49_of_50_scenes() -> None:
    result = errors.main(scenes=50)
    assert len(result["laws"]) == 12
    assert len(result["errors"]) >= 47
    assert np.mean(np.array(result["errors"]) <= 1) >= 0.98
    assert min(result["errors"]) > 1e-4  # the truth is another run
