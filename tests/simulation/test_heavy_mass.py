"""A heavy mass that bends a light beam: its steps grow where the force is smooth."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scipy.optimize import brentq

import antiosc as ao
from antiosc.models.closed_form import UniformBeam
from struck_beams import pinned_pinned

BEAM = UniformBeam.euler_bernoulli(E=67e9, rho=2400.0, area=2e-4, inertia=0.33e-8, length=1.0)
HERTZ = ao.Hertz(1.55e10)
RATIOS = (1e5, 1e6, 1e8)  # of the masses
SPEED, TOL = 1.0, 1e-3


def beam(n: int, damping: float) -> ao.AntiOscillators:
    model = pinned_pinned(BEAM).anti_oscillators(n)
    return replace(model, damping=ao.Damping(damping)) if damping else model


def work(law: ao.ContactLaw, k0: float, force: float) -> float:
    """Energy of a massless beam and of the contact under a force, in closed form."""
    if isinstance(law, ao.Hertz):
        return force**2 / (2 * k0) + 0.4 * force ** (5 / 3) / law.stiffness ** (2 / 3)
    return force**2 / 2 * (1 / k0 + 1 / 1e7)


@pytest.mark.slow
@pytest.mark.parametrize("ratio", RATIOS)
def test_peak_and_time_are_those_of_a_mass_on_a_spring(ratio: float) -> None:
    """v sqrt(k M) and half a period; the beam's own mass counts by about its share, and the first
    touches by the ratio of their length to the half period.
    """
    model, law = beam(8, 0.03), HERTZ
    mass = ratio * model.m_st
    energy = mass * SPEED**2 / 2
    bound = SPEED * np.sqrt(model.k0 * mass)
    peak = brentq(lambda f: work(law, model.k0, f) - energy, 0.1 * bound, 2 * bound)
    half_period = np.pi * mass * SPEED / peak
    hit = ao.simulate(model, ao.RigidMass(mass, SPEED), law, 1.2 * half_period, tol=TOL)
    assert hit.status == 0
    assert hit.run.attempts < 20_000
    assert hit.peak_force == pytest.approx(peak, rel=2 * TOL)
    assert hit.contact_time == pytest.approx(half_period, rel=5e-3)
    assert hit.impulse == pytest.approx(2 * mass * SPEED, rel=3e-3)


@pytest.mark.slow
@pytest.mark.parametrize("ratio", [1e4, 1e6])
def test_a_mass_laid_on_the_beam_presses_with_twice_its_weight(ratio: float) -> None:
    model, law = beam(8, 0.01), HERTZ
    weight = 9.81 * ratio * model.m_st
    half = np.pi * np.sqrt(ratio * model.m_st / model.k0)
    striker = ao.RigidMass(ratio * model.m_st, 0.0)
    hit = ao.simulate(model, striker, law, 1.5 * half, tol=TOL, gravity=9.81)
    assert hit.run.attempts < 20_000
    assert hit.peak_force == pytest.approx(2 * weight, rel=2 * TOL)


@pytest.mark.slow
def test_without_damping_the_beam_goes_on_to_vibrate() -> None:
    """A mass laid on it: the force is smooth though its modes never die away."""
    model = beam(20, 0.0)
    mass = 1e6 * model.m_st
    half = np.pi * np.sqrt(mass / model.k0)
    hit = ao.simulate(model, ao.RigidMass(mass, 0.0), ao.Linear(1e7), 1.5 * half, gravity=9.81)
    assert hit.run.attempts < 10_000
    assert hit.peak_force == pytest.approx(2 * 9.81 * mass, rel=1e-5)


@pytest.mark.slow
def test_the_force_is_that_of_an_integrator_that_resolves_all() -> None:
    """DOP853, which shares neither steps nor their errors with the march."""
    model, law = beam(3, 0.05), HERTZ
    mass, duration = 7.5e4 * model.m_st, 0.1
    hit, other = (
        ao.simulate(model, ao.RigidMass(mass, 0.0), law, duration, method, gravity=9.81)
        for method in ("exact", "DOP853")
    )
    times = np.linspace(0.0, duration, 2001)
    mine, exact = hit.force_at(times), other.force_at(times)
    assert np.linalg.norm(mine - exact) < 2 * TOL * np.linalg.norm(exact)
    assert hit.peak_force == pytest.approx(other.peak_force, rel=2 * TOL)
    np.testing.assert_allclose(hit.displacement[-1], other.displacement[-1], rtol=5e-3)
    assert hit.run.attempts < other.run.attempts  # of which each takes twelve evaluations
