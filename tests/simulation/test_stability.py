"""Steps at which the contact drives the modes: avoided, or told."""

from __future__ import annotations

import numpy as np
import pytest

import antiosc as ao
from antiosc.engine.system import BodyModes, system_of_bodies
from antiosc.impact.reference import newmark

# a heavy mass on a soft structure whose light residual mass has its mode far above the others
MODEL = ao.AntiOscillators(m0=2e-4, k0=7e6, m=[0.18, 0.01, 0.001], omega=[1.5e4, 6e4, 2.5e5])
LAW = ao.Hertz(1.2e10)
TOP = float(MODEL.modal().omega.max())
STRIKER = ao.RigidMass(10.0, 0.3)
DURATION = 3e-3
TOUCHING = 3  # status: the heavy striker is still in contact at the end


def one(omega, beta, r=0.0):
    """Modes, rows and compliance of one contact."""
    return np.asarray(omega, float), np.asarray(beta, float)[None], np.array([[r]])


@pytest.mark.parametrize("r", [0.0, 1e-2])
def test_average_acceleration_has_no_windows(r):
    """On a linear contact no step of it grows, whatever its length."""
    omega, beta, R = one([1.0, 3.0, 7.0, 0.0], [1.0, 0.5, -2.0, 0.3], r)
    n, nothing = omega.size, np.zeros((1, omega.size))
    for k in (0.1, 10.0, 1e4):
        system = system_of_bodies([BodyModes(omega, None, beta, nothing[0])], [ao.Linear(k)], R)
        for h in (0.1, 0.9, 1.0, 1.05, 2.0, 10.0, 1e3):
            less, slower, predict = newmark(system, h)
            columns = []
            for unit in np.eye(2 * n):
                q, v = unit[:n], unit[n:] / h
                q, v = predict(q, v, -k / (1 + k * r) * (beta @ q) @ beta, nothing[0])
                force = k * (beta @ q) / (1 + k * (R + less @ beta.T)[0])
                columns.append(np.concatenate((q - force @ less, (v - force @ slower) * h)))
            assert np.abs(np.linalg.eigvals(np.array(columns).T)).max() <= 1 + 1e-6


@pytest.fixture(scope="module")
def truth():
    return ao.simulate(MODEL, STRIKER, LAW, DURATION, step=3e-7)


class TestRuns:
    """Of the whole simulation."""

    def test_a_given_step_that_the_contact_excites_stops_with_a_sentence(self):
        """k h^2/m = 10.6 lies in a window of growth from 9.6 to 12."""
        bodies = {"m": ao.RigidMass(1.0, 1e-4), "w": ao.Obstacle()}
        contact = ao.Contact("w", "m", ao.Linear(10.6e6))
        scene = ao.Scene(bodies, [contact], gravity=100.0, preload=True)
        with pytest.warns(ao.AccuracyWarning, match="gained energy"):
            hit = scene.run(0.2, step=1e-3)
        assert hit.status == 2

    @pytest.mark.slow
    @pytest.mark.parametrize("speed", [0.3, 0.6, 0.8])
    def test_chosen_steps_keep_the_tolerance(self, speed):
        """Steps in a window show as an error of the force, and are refused."""
        striker = ao.RigidMass(10.0, speed)
        hit = ao.simulate(MODEL, striker, LAW, DURATION, tol=3e-3)
        assert hit.status == TOUCHING
        assert len(hit.contacts) == 1
        truth = ao.simulate(MODEL, striker, LAW, DURATION, "newmark", step=3e-7)
        assert hit.peak_force == pytest.approx(truth.peak_force, rel=3e-3)
        assert hit.run.attempts < 10_000

    def test_short_contacts_are_resolved(self):
        """A step longer than the contact is halved until it resolves it."""
        striker = ao.RigidMass(0.01, 0.8)
        step = 8 * 3.0 / TOP
        hit = ao.simulate(MODEL, striker, LAW, DURATION / 10, step=step)
        truth = ao.simulate(MODEL, striker, LAW, DURATION / 10, tol=1e-5)
        start, end = hit.contacts[0]
        assert end - start < 8 * step
        assert hit.peak_force == pytest.approx(truth.peak_force, rel=0.05)
        assert hit.impulse == pytest.approx(truth.impulse, rel=0.05)
