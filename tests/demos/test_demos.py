"""Every demo runs, small, and returns numbers that mechanics checks."""

from __future__ import annotations

import warnings
from functools import partial

import numpy as np
import pytest

import antiosc as ao
from paths import demo


class Linear:
    """`antiosc` with linear cells: those at the bracket's holes are small at any size."""

    read_mesh, Structure = (partial(each, order=1) for each in (ao.read_mesh, ao.Structure))

    def __getattr__(self, name):
        return getattr(ao, name)


@pytest.fixture
def linear(monkeypatch):
    """A demo by its name, with linear cells."""

    def linear_demo(name):
        module = demo(name)
        monkeypatch.setattr(module, "ao", Linear())
        return module

    return linear_demo


def test_impact_on_bracket(linear, tmp_path, capsys):
    result = linear("impact_on_bracket").main(size=8e-3, radius=3e-3, n=12, out=tmp_path)
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


def test_impact_map(linear, tmp_path):
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # of sites on supports and edges
        found, worst = linear("impact_map").main(size=24e-3, check=1, most_sites=20, out=tmp_path)
    assert worst < 0.02
    sphere = ao.Sphere(radius=0.010, E=210e9, nu=0.3, rho=7850.0, velocity=1.0)
    k = sphere.hertz(E=70e9, nu=0.33).stiffness
    rigid = k**0.4 * (1.25 * sphere.mass * sphere.velocity**2) ** 0.6
    # around the bolts supports hold a part of the patch, and the correction for it is too much
    near = np.linalg.norm(found.points[:, None, :2] - [[0.062, 0.014], [0.062, 0.046]], axis=2)
    flat = np.abs(found.directions).max(axis=1) > 1 - 1e-9  # in hollows the contact is stiffer
    away = flat & (near.min(axis=1) > 0.02)
    assert found.peak_force[away].max() < 1.02 * rigid
    assert np.nanmin(found.peak_force) < 0.7 * rigid  # none where the patch is too small
    for name in ("bracket_map.vtu", "bracket_map.png"):
        assert (tmp_path / name).stat().st_size > 0


def test_drop_chance(linear, pictured):
    """The higher, the harder."""
    found = linear("drop_chance").main(falls=16, size=24e-3, out=pictured)
    assert found["low"] < found["quantile"] < found["high"]
    assert found["height"] > 0.0


pytestmark = [pytest.mark.fem, pytest.mark.slow]
errors = demo("scene_errors")


def test_forces_are_within_the_tolerance_in_49_of_50_scenes() -> None:
    result = errors.main(scenes=50)
    assert len(result["laws"]) == 10
    assert len(result["errors"]) >= 47
    assert np.mean(np.array(result["errors"]) <= 1) >= 0.98
    assert min(result["errors"]) > 1e-4  # the truth is another run


@pytest.mark.filterwarnings("ignore:.*deflects by")  # half its thickness
def test_stiffened_panel(pictured):
    """Stiffeners as beams or as shells: two models of one panel."""
    numbers = demo("stiffened_panel").main(n=9, duration=4e-4, out=pictured)
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
    assert len(list(pictured.glob("*.vtu"))) == 30


def test_guard_thickness(pictured):
    """At equal mass a third less force and more, within 20 runs; bars beside the gradients."""
    numbers = demo("guard_thickness").main(size=0.15, n=4, out=pictured)
    assert numbers["best"] < 0.7 * numbers["uniform"]
    assert numbers["runs"] <= 20
    assert numbers["mass"] == pytest.approx(1.0, rel=1e-6)


def test_roof_hail(pictured):
    """Sheets that stretch deflect less, the thin one by more, and more of its force is left."""
    numbers = demo("roof_hail").main(thicknesses=(0.8e-3, 1.25e-3), size=0.03, n=12, out=pictured)
    thin, thick = numbers.values()
    for row in (thin, thick):
        assert row["deflection"] < row["linear"]
        assert row["dent"] > 0
    assert thin["linear"] / thin["deflection"] > thick["linear"] / thick["deflection"]
    assert thin["left"] > thick["left"]
    assert thick["told"] == 0


def test_measured_part(pictured):
    found = demo("measured_part").main(top=6e3, lines=500, out=pictured)
    assert abs(found["peak error"]) < 0.02
    assert found["L2"] < 0.03


def test_moving_model(tmp_path):
    """The forces stop the mass and bend the beam; the picture has all its frames."""
    found = demo("moving_model").main(frames=3, out=tmp_path)
    assert found["impulse"] == pytest.approx(0.1 * (1 + found["rebound"]), rel=1e-3)
    picture = (tmp_path / "moving_model.gif").read_bytes()
    assert picture[:6] == b"GIF89a"
    assert picture.count(b"\x21\xf9\x04") == 3


def test_flow(pictured):
    assert demo("flow").main(out=pictured)["steps"] == 4


def test_tip_damper(pictured):
    found = demo("tip_damper").main(modes=12, n=10, out=pictured)
    assert found["error"] < 1e-3
    assert found["with ratios"] > 1e-2


def test_find_blow(pictured):
    errors = demo("find_blow").main(size=0.06, out=pictured)
    assert errors["place"] < 2e-3
    assert abs(errors["peak force"]) < 0.05
