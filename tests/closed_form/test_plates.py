"""The patch of a plate and Zener's impact against waves of layers and of finite plates."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.integrate import trapezoid
from scipy.optimize import brentq

from antiosc.models.closed_form import plate_patch, zener
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


E, NU, RHO, H = 210e9, 0.3, 7850.0, 6e-3


def radiated(nu: float, frequency: float, radius: float) -> tuple[float, float]:
    """Point mobility (real part, over Kirchhoff's) of a layer, and of Mindlin's plate with a disc.

    The layer by the residue of Lamb's first antisymmetric wave, the plate by that of its own.
    """
    w, G = 2 * np.pi * frequency, E / (2 * (1 + nu))
    D, m = E * H**3 / (12 * (1 - nu**2)), RHO * H
    cT = np.sqrt(G / RHO)
    cL = cT * np.sqrt(2 * (1 - nu) / (1 - 2 * nu))

    def layer(k: float) -> float:
        """Antisymmetric pressure on both faces over the displacement of a face."""
        p, q = np.sqrt(complex(k**2 - (w / cL) ** 2)), np.sqrt(complex(k**2 - (w / cT) ** 2))
        p_, q_ = p * H / 2, q * H / 2
        moved = p * (w / cT) ** 2 * np.cosh(p_) * np.cosh(q_) / G
        lamb = (k**2 + q**2) ** 2 * np.sinh(p_) * np.cosh(q_)
        lamb -= 4 * k**2 * p * q * np.cosh(p_) * np.sinh(q_)
        return float((lamb / moved).real)

    def plate(k: float) -> float:
        S, J = 5 / 6 * G * H, RHO * H**3 / 12
        return S * k**2 - m * w**2 - (S * k) ** 2 / (D * k**2 + S - J * w**2)

    def residue(stiffness, share: float) -> tuple[float, float]:
        near = np.sqrt(w) * (m / D) ** 0.25
        k = brentq(stiffness, 0.7 * near, 1.5 * near)
        slope = (stiffness(k * (1 + 1e-5)) - stiffness(k * (1 - 1e-5))) / (2e-5 * k)
        return k, abs(share * w * k / 2 / slope) * 8 * np.sqrt(D * m)

    z = residue(plate, 1.0)[0] * radius
    spread = 3 * (np.sin(z) - z * np.cos(z)) / z**3 if radius else 1.0
    return residue(layer, 0.5)[1], residue(plate, 1.0)[1] * spread**2


@pytest.mark.parametrize("nu", [0.1, 0.3, 0.45])
def test_the_shell_radiates_into_the_plate_as_a_layer_does(nu):
    radius = plate_patch(E, nu, H).radius
    errors = []
    for frequency in (2.5e3, 5e3, 1e4):
        layer, plate = radiated(nu, frequency, radius)
        point = radiated(nu, frequency, 0.0)[1]
        errors.append(abs(plate / layer - 1))
        assert errors[-1] < 0.25 * abs(point / layer - 1)
    # what is left is of higher order in kh: it grows faster than the frequency
    assert errors[2] > 1.8 * errors[1] > 3.2 * errors[0]


def test_a_disc_of_the_thickness_loses_the_share_that_the_page_says():
    frequency = 4e3
    layer, plate = radiated(NU, frequency, H)
    k = np.sqrt(2 * np.pi * frequency) * (12 * (1 - NU**2) * RHO / E / H**2) ** 0.25
    lost = (k * H) ** 2 * (1 - 2 * NU) / (5 * (1 - NU))
    assert 1 - plate / layer == pytest.approx(lost, rel=0.1)


def lifted(k: float, nu: float) -> float:
    """Displacement under a pressure cos kx on one face of a layer (h = 1, G = 1), of a half-space.

    Airy's function (A cosh + B sinh + kz (C cosh + D sinh)) cos kx; the other face is free. What
    the half-space would move, (1 - nu)/k, is taken off.
    """

    def rows(z: float) -> np.ndarray:
        c, s, t = np.cosh(k * z), np.sinh(k * z), k * z
        value = [c, s, t * c, t * s]
        slope = [k * s, k * c, k * (c + t * s), k * (s + t * c)]
        area = [s / k, c / k, (t * s - c) / k, (t * c - s) / k]
        return np.array([value, slope, area])

    near, far = rows(0.0), rows(1.0)
    pressed = np.array([1 / k**2, 0, 0, 0])  # the stress across is -k² times the function
    a = np.linalg.solve(np.stack([near[0], near[1], far[0], far[1]]), pressed)
    moved = -((1 - nu) * k**2 * near[2] + nu * near[1]) @ a / 2
    return abs(moved) - (1 - nu) / k


@pytest.mark.slow
@pytest.mark.parametrize("nu", [0.02, 0.3, 0.45])
def test_the_compliance_is_what_the_plate_moves_more_than_the_layer(nu):
    """The integral of both over all wave numbers, by Airy's function for the layer."""
    a = np.sqrt(nu / (1 - nu))
    G, D = 1.0, 1 / (6 * (1 - nu))

    def more(k: float) -> float:
        z = k * a
        P = 3 * (np.sin(z) - z * np.cos(z)) / z**3 if z > 0.05 else 1 - z**2 / 10
        layer = lifted(k, nu) if k < 18 else 0.0
        return k * (P**2 * (1 / (D * k**4) + 6 / (5 * G * k**2)) - layer)

    t = np.linspace(np.log(0.2), np.log(400 / a), 8000)
    above = trapezoid([np.exp(s) * more(np.exp(s)) for s in t], t)
    below = 0.2 * more(0.1)  # nearly straight there
    found = plate_patch(2 * (1 + nu), nu, 1.0).local_compliance
    assert found == pytest.approx((above + below) / (2 * np.pi), rel=2e-3)


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


def test_the_compliance_scales_and_falls_with_poissons_ratio():
    one = plate_patch(E, NU, H)
    assert plate_patch(2 * E, NU, 3 * H).local_compliance == pytest.approx(
        one.local_compliance / 6, rel=1e-12
    )
    values = [plate_patch(1.0, nu, 1.0).local_compliance for nu in (0.05, 0.2, 0.35, 0.49)]
    assert values == sorted(values, reverse=True)
    assert values[-1] > 0


def test_zener_parameter_is_free_of_units():
    lam = zener.inelasticity(0.01, 2.0, 1e9, 50.0, 8.0)
    # mass × 1000 (kg → g), length × 100 (m → cm): N m^-3/2 → 10⁵ · 10^-3
    scaled = zener.inelasticity(10.0, 200.0, 1e9 * 1e5 * 1e-3, 50.0 * 1e7, 8.0 * 0.1)
    assert scaled == pytest.approx(lam, rel=1e-12)
