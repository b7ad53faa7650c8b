"""Closed forms of plates: two series agree, the anti-oscillator identity, Zener's limits."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.integrate import trapezoid
from scipy.optimize import brentq

from antiosc.base.errors import InputError
from antiosc.models.closed_form import plate_patch, zener
from plates import SupportedLaminate, SupportedPlate

PLATE = SupportedPlate(E=70e9, nu=0.3, rho=2700.0, thickness=1e-3, a=1.0, b=0.8)
SQUARE = SupportedPlate(E=70e9, nu=0.3, rho=2700.0, thickness=1e-3, a=1.0, b=1.0)
POINTS = [(0.5, 0.4), (0.35, 0.3)]


@pytest.mark.slow
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


A, D, S = np.diag([9e7, 4e7, 2e7]), np.diag([80.0, 30.0, 15.0]), np.diag([6e6, 5e6])


def laminate(A=A, B=((0, 0, 0),) * 3, D=D, S=S, inertia=(20.0, 0.0, 2e-5)):
    return SupportedLaminate(A, np.array(B, dtype=float), D, S, inertia, 0.4, 0.3)


def entry(matrix, i, j, share):
    changed = np.array(matrix, dtype=float)
    changed[i, j] = changed[j, i] = share * changed.max()
    return changed


SCALE = np.sqrt(A.max() * D.max())
TWIST, STRETCH, SHEAR = np.zeros((3, 3)), np.zeros((3, 3)), np.zeros((3, 3))
TWIST[0, 2] = TWIST[2, 0] = 0.1 * SCALE
STRETCH[1, 1] = 0.1 * SCALE
SHEAR[2, 2] = 0.1 * SCALE


@pytest.mark.parametrize("B", [TWIST, STRETCH, SHEAR, STRETCH + SHEAR])
def test_cross_plies_and_antisymmetric_angle_plies(B):
    omega = laminate(B=B).frequencies(1, 1)
    assert (np.diff(omega) > 0).all()
    assert omega[0] < laminate().frequencies(1, 1)[0]  # coupling makes a plate softer


@pytest.mark.parametrize(
    "changes",
    [
        {"A": entry(A, 0, 2, 0.1)},
        {"A": entry(A, 1, 2, 0.1)},
        {"D": entry(D, 0, 2, 0.1)},
        {"D": entry(D, 1, 2, 0.1)},
        {"S": entry(S, 0, 1, 0.1)},
        {"B": TWIST + STRETCH},
        {"B": TWIST + SHEAR},
        {"B": TWIST, "inertia": (20.0, 1e-3, 2e-5)},
    ],
)
def test_other_stacks_are_refused(changes):
    with pytest.raises(InputError, match="antisymmetric"):
        laminate(**changes)


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


def _modes(plate: SupportedPlate, x: float, y: float, count: int = 1500):
    m = np.arange(1, count + 1)
    sines = np.outer(np.sin(m * np.pi * x / plate.a), np.sin(m * np.pi * y / plate.b))
    b2 = 4 / (plate.surface_density * plate.a * plate.b) * sines**2
    return plate.kirchhoff(m[:, None], m) ** 2, b2


@pytest.mark.parametrize("point", POINTS)
def test_single_and_double_series_agree(point):
    omega2, b2 = _modes(PLATE, *point)
    assert np.sum(b2 / omega2) == pytest.approx(PLATE.compliance(*point), rel=1e-6)
    for x in (1e2, 1e4, 3e5):
        # the same difference of slow tails on both sides
        double = np.sum(b2 * (1 / (omega2 - x) - 1 / omega2)) + PLATE.compliance(*point)
        assert PLATE.receptance(*point, x).real == pytest.approx(double, rel=1e-6)


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


def test_observable_frequencies_are_counted():
    # at the centre only odd m and n move the point; (1, 3) and (3, 1) are one
    seen = SQUARE.observable(0.5, 0.5, 4)
    assert seen.modes.tolist() == [1, 2, 1, 2]
    assert seen.omega[1] / seen.omega[0] == pytest.approx(5)
    # below (1, 5): 2·(1,2) (2,2) 2·(2,3) 2·(1,4) 2·(2,4) 2·(3,4): six unobservable frequencies
    assert seen.unobservable == 6
    everywhere = SQUARE.observable(0.35, 0.3, 4)
    assert everywhere.modes.tolist() == [1, 2, 1, 2]
    assert everywhere.unobservable == 0


@pytest.mark.slow
def test_mindlin_compliance_grows_as_the_logarithm_of_the_radius():
    thick = SupportedPlate(70e9, 0.3, 2700.0, 0.1, 1.0, 1.0)
    wide, narrow = (thick.mindlin_compliance(0.5, 0.5, r, 2000) for r in (0.01, 0.005))
    per_ln = 1 / (2 * np.pi * 5 / 6 * 70e9 / 2.6 * 0.1)
    assert (narrow - wide) / (per_ln * np.log(2)) == pytest.approx(1, abs=0.05)


def test_zener_parameter_is_free_of_units():
    lam = zener.inelasticity(0.01, 2.0, 1e9, 50.0, 8.0)
    # mass × 1000 (kg → g), length × 100 (m → cm): N m^-3/2 → 10⁵ · 10^-3
    scaled = zener.inelasticity(10.0, 200.0, 1e9 * 1e5 * 1e-3, 50.0 * 1e7, 8.0 * 0.1)
    assert scaled == pytest.approx(lam, rel=1e-12)
