"""Anti-oscillators from free modes: exact with all modes, close with some, bounded always."""

from __future__ import annotations

import numpy as np
import pytest

import antiosc as ao
from antiosc.models.closed_form import UniformBeam
from antiosc.models.free_modes import error_bound, from_free_modes, site_models, stiffness_error
from struck_beams import free_free, modes, pinned_pinned

BEAM = UniformBeam.euler_bernoulli(E=67e9, rho=2400, area=2e-4, inertia=0.33e-8, length=1.0)


def receptance(omega, b, at):
    return np.sum(b**2 / (omega**2 - np.asarray(at)[..., None] ** 2), axis=-1)


def structure(rng, n=60, rigid=0):
    """Free modes of nobody's structure, and its compliance and inertia about a shift."""
    omega = np.sort(rng.uniform(50, 2e4, n))
    omega[:rigid] = 0.0
    b = rng.uniform(0.2, 1, n) * rng.choice([-1, 1], n)
    shift = 0.1 * omega[rigid] ** 2 if rigid else 0.0
    C, G = (np.sum(b**2 / (omega**2 + shift) ** k) for k in (1, 2))
    return omega, b, C, G, shift


@pytest.mark.parametrize("rigid", [0, 1, 3])
def test_all_modes_give_the_structure(rng, rigid):
    omega, b, C, G, shift = structure(rng, 12, rigid)
    model = from_free_modes(omega, b, C, G, shift=shift)
    at = np.linspace(10, 1.2 * omega[-1], 50) * (1 + 0.01j)
    np.testing.assert_allclose(model.dynamic_stiffness(at), 1 / receptance(omega, b, at), rtol=1e-6)
    assert (model.k0 == 0) == (rigid > 0)
    m_st = 1 / np.sum(b[:rigid] ** 2) if rigid else G / C**2
    assert model.m_st == pytest.approx(m_st, rel=1e-9)
    # the antiresonances interlace with the free frequencies
    joined = np.sort(np.concatenate([np.unique(omega), model.omega]))
    assert np.all(np.isin(joined[::2], omega))


@pytest.mark.slow
@pytest.mark.parametrize("place", [0.5, 0.17])
def test_pinned_beam_anywhere(place):
    struck = pinned_pinned(BEAM, place)
    free = modes(struck, 40).modal()
    model = from_free_modes(free.omega, free.b, 1 / struck.static_stiffness)
    exact = struck.anti_oscillators(8)
    assert model.m0 == 0
    np.testing.assert_allclose(model.omega[:8], exact.omega, rtol=1e-4)
    np.testing.assert_allclose(model.m[:8], exact.m, rtol=2e-3)
    # with the inertia of the static deflection too, the modes left out count almost nothing
    inertia = struck.static_mass / struck.static_stiffness**2
    model = from_free_modes(free.omega, free.b, 1 / struck.static_stiffness, inertia)
    np.testing.assert_allclose(model.omega[:8], exact.omega, rtol=2e-6)
    np.testing.assert_allclose(model.m[:8], exact.m, rtol=5e-5)
    assert model.m_st == pytest.approx(struck.static_mass, rel=1e-9)


@pytest.mark.parametrize("rigid", [0, 2])
def test_bound_holds_and_falls(rng, rigid):
    omega, b, C, G, shift = structure(rng, 300, rigid)
    band = omega[20]
    bounds, errors = [], []
    for kept in (30, 60, 120):
        part = omega[:kept], b[None, :kept], [C], [G]
        models = site_models(*part, shift=shift)
        bounds.append(float(np.sum(error_bound(models, *part, band, shift))))
        errors.append(
            stiffness_error(
                models.model(0).dynamic_stiffness,
                lambda at: 1 / receptance(omega, b, at),
                band,
                omega[rigid],
            )
        )
    assert np.all(np.array(errors) < np.array(bounds))
    assert np.all(np.diff(bounds) < 0)
    assert bounds[-1] < 2e-2


@pytest.mark.slow
def test_free_beam_off_centre():
    struck = free_free(BEAM, 0.3)
    free = modes(struck, 60, static_correction=True).modal()
    assert free.omega[0] == 0
    shift = 0.1 * free.omega[free.omega > 0][0] ** 2
    H = np.sum(free.b**2 / (free.omega**2 + shift)) + free.r
    model = from_free_modes(free.omega, free.b, H, shift=shift)
    exact = struck.anti_oscillators(8)
    assert model.k0 == 0
    assert model.m_st == pytest.approx(struck.static_mass, rel=1e-6)
    np.testing.assert_allclose(model.omega[:8], exact.omega, rtol=1e-4)
    np.testing.assert_allclose(model.m[:8], exact.m, rtol=2e-3)


def test_many_sites_are_many_times_one(rng, monkeypatch):
    monkeypatch.setattr("antiosc.models.free_modes.SITES_AT_ONCE", 3)
    omega, *_ = structure(rng, 15)
    b = rng.uniform(-1, 1, (8, 15))
    b[4, ::2] = 0.0  # a site that half the modes cannot move: it has fewer anti-oscillators
    C, G = 1.2 * (b**2 @ omega**-2.0), b**2 @ omega**-4.0 * 1.0001
    models = site_models(omega, b, C, G, 10)
    for i in range(8):
        one = from_free_modes(omega, b[i], C[i], G[i], 10)
        same = models.model(i)
        np.testing.assert_allclose(same.omega, one.omega, rtol=1e-12)
        np.testing.assert_allclose(same.m, one.m, rtol=1e-10)
        at = np.array([30.0, 700.0]) * (1 + 0.01j)
        np.testing.assert_allclose(
            models.dynamic_stiffness(at)[i], one.dynamic_stiffness(at), rtol=1e-12
        )
    assert models.model(4).n < 10
    assert np.all(models.m[4, models.model(4).n :] == 0)


@pytest.mark.parametrize("speed", [0.1, 3.0])
def test_band_of_an_impact(speed):
    ball, law = ao.RigidMass(mass=0.1, velocity=speed), ao.Hertz(1e9)
    # Hertz's contact time against a wall: 2.9432 delta/v, delta = (5 m v^2/4 k)^(2/5)
    duration = 2.9432 * (1.25 * 0.1 * speed**2 / 1e9) ** 0.4 / speed
    assert ao.impact_band(ball, law) == pytest.approx(1.5 / duration, rel=0.15)
