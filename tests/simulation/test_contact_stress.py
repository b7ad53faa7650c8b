"""Hertz's stresses under a sphere: Johnson's figures, the law's own force, tips and hollows."""

from __future__ import annotations

import numpy as np
import pytest

import antiosc as ao

STEEL = {"E": 210e9, "nu": 0.3}


def test_johnson_s_figures_for_steel():
    """τ = 0.31 p0 at 0.48 a, edge tension 0.133 p0 (Contact Mechanics, section 3.4)."""
    ball = ao.Sphere(0.01, **STEEL, rho=7850.0)
    found = ao.contact_stress(ball, 100.0, **STEEL)
    assert found.shear / found.pressure == pytest.approx(0.31, abs=2e-3)
    assert found.depth / found.radius == pytest.approx(0.48, abs=5e-3)
    assert found.tension / found.pressure == pytest.approx(0.1333, abs=1e-3)
    assert 2 / 3 * found.pressure * np.pi * found.radius**2 == pytest.approx(100.0)


@pytest.mark.parametrize("radius", [np.inf, 0.05, -0.05])
def test_the_contact_radius_is_that_of_the_law(radius):
    """a² = R δ at the indentation of Hertz's law."""
    tip = ao.RigidMass(0.1, tip_radius=0.01, **STEEL)
    force = 250.0
    law = tip.hertz(70e9, 0.33, radius)
    relative = 1 / (1 / 0.01 + (0 if np.isinf(radius) else 1 / radius))
    delta = (force / law.stiffness) ** (2 / 3)
    found = ao.contact_stress(tip, force, 70e9, 0.33, radius)
    assert found.radius**2 == pytest.approx(relative * delta, rel=1e-12)


def test_what_has_no_tip_is_refused():
    with pytest.raises(ao.InputError, match="needs a Sphere"):
        ao.contact_stress(ao.RigidMass(0.1), 1.0, **STEEL)
    with pytest.raises(ao.InputError, match="hollow"):
        ao.contact_stress(ao.Sphere(0.01, **STEEL, rho=7850.0), 1.0, **STEEL, radius=-0.005)
