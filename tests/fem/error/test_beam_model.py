"""The share "model" of the budgets of beams: where there is a figure, and what it does."""

from __future__ import annotations

import numpy as np
import pytest

import antiosc as ao
from antiosc.simulation import error_budget
from antiosc.simulation.histories.parts import QUANTITIES
from parts import frame, line, named

STEEL = {"E": 210e9, "nu": 0.3, "rho": 7850.0}
BAR = ao.Section.rectangle(width=0.02, height=0.01)
BALL = ao.Sphere(0.01, **STEEL, velocity=1.0)
IMPACT = BALL, BALL.hertz(STEEL["E"], STEEL["nu"]), 2e-4
HELD = [ao.Support("left"), ao.Support("right")]


def budget(mesh, material, site, supports=HELD):  # type: ignore[no-untyped-def]
    part = ao.Structure(mesh, material, supports)
    return ao.simulate(ao.extract(part, site, n=10, error="estimate"), *IMPACT).error_budget


def straight(section: ao.Section = BAR, length: float = 0.3, x: float = 0.5, **options):  # type: ignore[no-untyped-def]
    site = ao.Site((x * length, 0), (0, -1))
    return budget(line(length, 20), ao.Beam(**{**STEEL, **options}, section=section), site)


def test_bars_hold_the_share_of_the_model():
    found = straight()
    shares = [found[name].model for name in QUANTITIES]
    assert 0.005 < max(shares) < 0.1
    assert min(shares) >= 0.5 * max(shares)
    for name in QUANTITIES:
        assert found[name].total == pytest.approx(found[name].numerical + found[name].model)
    assert not any("Not included: the error of the beam model" in note for note in found.notes)
    assert "model" in str(found)


def test_all_changes_widen_the_share(monkeypatch):
    """A heavy mass on a short bar: compliance, values, frequencies and clamps all count."""
    part = ao.Structure(line(0.15, 20), ao.Beam(**STEEL, section=BAR), HELD)
    model = ao.extract(part, ao.Site((0.075, 0), (0, -1)), n=10, error="estimate")
    facts = model.info["model"]
    assert facts["clamps"] == pytest.approx(2 * 0.02 / 0.15)
    assert facts["compliance"] == pytest.approx(1 / (210e9 * np.sqrt(0.02 * 0.01)))
    impact = ao.RigidMass(2 * part.mass, 0.1), ao.Hertz(1e10), 2e-3

    def share() -> float:
        return max(bar.model for bar in ao.simulate(model, *impact).error_budget.values())

    whole = share()
    for name in ("LOCAL", "VALUES", "FREQUENCIES", "CLAMP"):
        with monkeypatch.context() as patch:
            patch.setattr(error_budget, name, 0.0)
            assert share() < 0.99 * whole, name
    free = ao.Structure(line(0.15, 20), ao.Beam(**STEEL, section=BAR))
    model = ao.extract(free, ao.Site((0.075, 0), (0, -1)), n=10, error="estimate")
    assert model.info["model"]["clamps"] == 0


REASONS = {
    "full rectangular": lambda: straight(ao.Section.circle(0.01)),
    "shorter than 5": lambda: straight(length=0.09),
    "nearer to an end": lambda: straight(x=0.1),
    "times the other": lambda: straight(ao.Section.rectangle(width=0.03, height=0.01)),
    "Poisson": lambda: straight(nu=0.1),
    "Timoshenko": lambda: straight(shear=False),
}


@pytest.mark.sample
@pytest.mark.parametrize("reason", list(REASONS))
def test_there_is_no_figure_where_none_was_measured(reason):
    found = REASONS[reason]()
    assert all(bar.model == 0 for bar in found.values())
    (note,) = (each for each in found.notes if "the beam model itself" in each)
    assert reason in note


def test_frames_and_changes_of_section_have_no_figure():
    beam = ao.Beam(**STEEL, section=BAR)
    corner = frame([(0, 0), (0.3, 0), (0.3, 0.3)], [(0, 1), (1, 2)], 10)
    held = [ao.Support(lambda x: np.isclose(x[0], 0))]
    found = budget(corner, beam, ao.Site((0.15, 0), (0, -1)), held)
    assert any("one straight line" in note for note in found.notes)
    mesh = line(0.3, 20).dolfinx
    halves = {"thin": (1, lambda x: x[0] < 0.1501), "thick": (1, lambda x: x[0] > 0.1499)}
    thick = ao.Beam(**STEEL, section=ao.Section.rectangle(0.02, 0.02))
    site = ao.Site((0.09, 0), (0, -1))
    found = budget(named(mesh, halves), {"thin": beam, "thick": thick}, site, held)
    assert any("several sections" in note for note in found.notes)


@pytest.mark.slow
def test_height_and_width_are_those_along_and_across_the_impact():
    """A beam in space lying on its side is the plane beam with its sides exchanged."""
    facts = []
    upright = ao.Section.rectangle(width=0.01, height=0.02)
    for section, orientation in ((BAR, (0, 1, 0)), (upright, (0, 0, 1))):
        material = ao.Beam(**STEEL, section=section, orientation=orientation)
        mesh = line(0.3, 20, (1.0, 0.0, 0.0))
        part = ao.Structure(mesh, material, HELD)
        site = ao.Site((0.15, 0, 0), (0, -1, 0))
        facts.append(ao.extract(part, site, n=10, error="estimate").info["model"])
    plane = ao.Structure(line(0.3, 20), ao.Beam(**STEEL, section=BAR), HELD)
    site = ao.Site((0.15, 0), (0, -1))
    facts.append(ao.extract(plane, site, n=10, error="estimate").info["model"])
    assert facts[0] == pytest.approx(facts[2], rel=1e-9)
    assert facts[1] == pytest.approx(facts[2], rel=1e-9)
    skew = ao.Site((0.15, 0, 0), (0, -0.6, 0.8))
    part = ao.Structure(
        line(0.3, 20, (1.0, 0.0, 0.0)),
        ao.Beam(**STEEL, section=BAR, orientation=(0, 1, 0)),
        HELD,
    )
    assert "not along a side" in ao.extract(part, skew, n=10, error="estimate").info["model"]
