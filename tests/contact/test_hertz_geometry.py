"""Hertz's contact of curved bodies, and the stresses under it, against closed forms."""

from __future__ import annotations

import numpy as np
import pytest

import antiosc as ao

STEEL = {"E": 210e9, "nu": 0.3}


def test_sphere_on_plane_and_sphere_on_sphere():
    E, nu, R = 2.1e11, 0.3, 0.01
    E_star = E / (1 - nu**2)
    law = ao.Hertz.from_radii(R, E, nu)
    assert law.stiffness == pytest.approx(4 / 3 * E_star * np.sqrt(R))
    pair = ao.Hertz.from_radii(R, E, nu, R, E, nu)
    assert pair.stiffness == pytest.approx(4 / 3 * (E_star / 2) * np.sqrt(R / 2))
    cup = ao.Hertz.from_radii(R, E, nu, -3 * R)
    assert cup.stiffness == pytest.approx(4 / 3 * E_star * np.sqrt(1.5 * R))


def test_ellipse_against_the_integral():
    """delta and the curvatures from the potential of Hertz's pressure, by direct quadrature.

    With semi-axes a, b and the peak pressure p0: A, B and delta are p0 a b/(2 E*) times integrals
    of ds/sqrt((a^2 + s)(b^2 + s) s) with weights 1/(a^2 + s), 1/(b^2 + s), 1.
    """
    from scipy.integrate import quad

    a, b, p0, E_star = 3e-4, 1e-4, 1e9, 1e11

    def integral(weight):
        # s = (u/(1-u))^2 takes the root singularity and the infinite range away
        def f(u):
            s = a * b * (u / (1 - u)) ** 2
            ds = 2 * a * b * u / (1 - u) ** 3
            return weight(s) * ds / np.sqrt((a * a + s) * (b * b + s) * s)

        return p0 * a * b / (2 * E_star) * quad(f, 0, 1, epsrel=1e-11)[0]

    A = integral(lambda s: 1 / (a * a + s))
    B = integral(lambda s: 1 / (b * b + s))
    delta = integral(lambda s: 1.0)
    force = 2 / 3 * np.pi * p0 * a * b
    law = ao.Hertz.from_radii((1 / (2 * A), 1 / (2 * B)), E_star, 0.0)
    assert law.force(delta, 0.0, ()) == pytest.approx(force, rel=1e-8)


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
