"""Closed forms of plates: two series agree, the anti-oscillator identity, Zener's limits."""

from __future__ import annotations

import numpy as np
import pytest

from antiosc.base.errors import InputError
from antiosc.closed_form import zener
from antiosc.closed_form.plates import SupportedPlate

PLATE = SupportedPlate(E=70e9, nu=0.3, rho=2700.0, thickness=1e-3, a=1.0, b=0.8)
SQUARE = SupportedPlate(E=70e9, nu=0.3, rho=2700.0, thickness=1e-3, a=1.0, b=1.0)
POINTS = [(0.5, 0.4), (0.35, 0.3)]


@pytest.mark.sample
@pytest.mark.parametrize("point", POINTS)
def test_anti_oscillators_give_the_receptance_back(point):
    model = PLATE.anti_oscillators(*point, 60)
    omega = np.linspace(0.05, 0.95, 12) * model.omega[9]
    exact = np.array([1 / PLATE.receptance(*point, w**2).real for w in omega])

    def error(n):
        return np.abs(model.truncated(n).dynamic_stiffness(omega) - exact) / np.abs(exact).max()

    # what is left out: Σ m_i ω⁴/ω_i² over the masses that are left to m0
    assert error(60).max() < 2e-3
    assert error(60).max() < error(15).max() / 5
    assert model.m0 > 0
    assert PLATE.anti_oscillators(*point, 20).m == pytest.approx(model.m[:20], rel=1e-9)


def test_mindlin_tends_to_kirchhoff():
    assert SQUARE.mindlin(1, 2) == pytest.approx(SQUARE.kirchhoff(1, 2), rel=2e-5)
    # Liew, Xiang & Kitipornchai's table for t/a = 0.1, κ = 5/6: 1.9317, 4.6084 of π²√(D/ρh)/a²
    thick = SupportedPlate(70e9, 0.3, 2700.0, 0.1, 1.0, 1.0)
    unit = np.pi**2 * np.sqrt(thick.D / thick.surface_density)
    assert thick.mindlin(1, 1) / unit == pytest.approx(1.9317, abs=2e-4)
    assert thick.mindlin(1, 2) / unit == pytest.approx(4.6084, abs=2e-4)


@pytest.mark.parametrize("point", [(0.0, 0.4), (0.5, 0.9), (-1, 0.4)])
def test_a_point_off_the_plate_is_refused(point):
    with pytest.raises(InputError, match="inside the plate"):
        PLATE.compliance(*point)


def test_zeners_impedance_is_that_of_the_plate_without_reflections():
    """At ω² = -s² waves die out: beyond the first, a finite plate is an infinite one.

    F/v = 8√(Dρh) there, so that F/w = 8√(Dρh) s; λ = m/(8√(Dρh) time_unit).
    """
    plate = SupportedPlate(E=70e9, nu=0.3, rho=2700.0, thickness=2e-3, a=1.0, b=1.0)
    s = 6000.0
    impedance = 1 / (s * plate.receptance(0.5, 0.5, -(s**2)).real)
    mass, velocity, stiffness = 0.02, 1.5, 2e9
    lam = zener.inelasticity(mass, velocity, stiffness, plate.D, plate.surface_density)
    time = zener.time_unit(mass, velocity, stiffness)
    assert mass / (lam * time) == pytest.approx(impedance, rel=1e-4)


@pytest.mark.parametrize("point", [(0.5, 0.4), (0.02, 0.03), (0.98, 0.4)])
def test_the_receptance_tends_to_the_compliance_and_to_reciprocal_corners(point):
    """At low frequencies; and by the symmetry of the plate about its middle lines."""
    static = PLATE.compliance(*point)
    assert PLATE.receptance(*point, 1e-6).real == pytest.approx(static, rel=1e-9)
    x, y = point
    assert PLATE.compliance(1.0 - x, y) == pytest.approx(static, rel=1e-9)
    assert PLATE.compliance(x, 0.8 - y) == pytest.approx(static, rel=1e-9)
