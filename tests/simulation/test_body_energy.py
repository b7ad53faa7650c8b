"""Energies of single bodies: they sum to the whole, and what vibrates is what the rebound lacks."""

from __future__ import annotations

import numpy as np
import pytest

import antiosc as ao

PLATE = ao.AntiOscillators(m0=0.02, k0=2e6, m=[0.2, 0.1], omega=[3e3, 1.1e4])
BALL = ao.RigidMass(0.05, 2.0)


@pytest.mark.parametrize("m0", [0.02, 0.0])  # without it the site has a residual compliance
def test_bodies_sum_to_the_energy_of_the_run(m0):
    plate = ao.AntiOscillators(m0=m0, k0=2e6, m=[0.2, 0.1], omega=[3e3, 1.1e4])
    hit = ao.simulate(plate, BALL, ao.Hertz(1e9), 2e-3)
    assert (plate.modal().r > 0) == (m0 == 0)
    own = [ao.body_energy(hit, name) for name in ("structure", "impactor")]
    kinetic = sum(e.rigid + e.kinetic for e in own)
    np.testing.assert_allclose(kinetic, hit.energy.kinetic, atol=1e-12)
    np.testing.assert_allclose(sum(e.strain for e in own), hit.energy.strain, rtol=1e-9, atol=1e-15)
    assert own[1].rigid[0] == pytest.approx(0.5 * 0.05 * 4)
    np.testing.assert_array_equal(own[1].vibration, 0)
    np.testing.assert_array_equal(own[0].rigid, 0)


def test_what_vibrates_is_what_the_rebound_lacks():
    """Without losses in the contact, 1 − e² of the ball's energy is in the plate."""
    hit = ao.simulate(PLATE, BALL, ao.Hertz(1e9), 2e-3, tol=1e-6)
    lost = 1 - (hit.impactor_velocity[-1] / 2.0) ** 2
    assert ao.vibration_share(hit) == pytest.approx(lost, abs=1e-4)
    still = ao.simulate(PLATE, ao.RigidMass(1.0), ao.Hertz(1e9), 1e-4)
    with pytest.raises(ao.InputError, match="at rest"):
        ao.vibration_share(still)


def test_a_row_of_masses_takes_what_a_dashpot_takes():
    """Spring k on an impedance Z: ζ = √(km)/2Z, e = exp(−ζπ/√(1−ζ²)); no wave returns in time."""
    n, mass, stiffness = 100, 1e-3, 1e6  # Z = √(1e3)
    K = np.diag(np.full(n, 2 * stiffness)) - stiffness * (np.eye(n, k=1) + np.eye(n, k=-1))
    K[0, 0] = stiffness
    part = ao.Structure.from_matrices(K, mass * np.eye(n), backend="scipy")
    ball = ao.RigidMass(2e-3, 1.0)
    hit = ao.simulate(ao.full(part, ao.Site(dof=0)), ball, ao.Linear(2e4), 2e-3)
    zeta = np.sqrt(2e4 * 2e-3 / 1e3) / 2
    e = np.exp(-zeta * np.pi / np.sqrt(1 - zeta**2))
    assert ao.vibration_share(hit) == pytest.approx(1 - e**2, rel=2e-2)
