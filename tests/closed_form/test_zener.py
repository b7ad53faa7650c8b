"""Zener's impact against finite plates and first orders."""

from __future__ import annotations

import numpy as np
import pytest

import zener
from plates import SupportedPlate

SQUARE = SupportedPlate(E=70e9, nu=0.3, rho=2700.0, thickness=1e-3, a=1.0, b=1.0)


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


def test_compliance_at_the_centre_is_timoshenkos():
    # Theory of Plates and Shells, table 23: 0.01160 P a²/D
    assert SQUARE.compliance(0.5, 0.5) * SQUARE.D == pytest.approx(0.01160, abs=5e-6)


@pytest.mark.slow
def test_zener_limits():
    assert zener.restitution(0.0) == pytest.approx(1, abs=1e-9)
    # two bodies through Hertz alone: 2.9433 (5/4)^{2/5}
    assert zener.contact_time(0.0) == pytest.approx(2.9432 * 1.25**0.4, rel=1e-4)
    values = [zener.restitution(lam) for lam in (0.1, 0.3, 0.5, 1.0)]
    assert np.all(np.diff(values) < 0)
    # first order: the work of the damping force along the undamped path,
    # 1 − e = λ ∫ (3/2)√σ σ'² dτ = λ · 2 ∫ (3/2)√σ √(1 − (4/5)σ^{5/2}) dσ
    from scipy.integrate import quad

    top = 1.25**0.4
    work = 2 * quad(lambda s: 1.5 * np.sqrt(s * max(1 - 0.8 * s**2.5, 0.0)), 0, top)[0]
    assert (1 - zener.restitution(1e-4)) / 1e-4 == pytest.approx(work, rel=1e-3)
    assert zener.restitution(3.0) > 0


def test_zener_parameter_is_free_of_units():
    lam = zener.inelasticity(0.01, 2.0, 1e9, 50.0, 8.0)
    # mass × 1000 (kg → g), length × 100 (m → cm): N m^-3/2 → 10⁵ · 10^-3
    scaled = zener.inelasticity(10.0, 200.0, 1e9 * 1e5 * 1e-3, 50.0 * 1e7, 8.0 * 0.1)
    assert scaled == pytest.approx(lam, rel=1e-12)
