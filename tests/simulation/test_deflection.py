"""Peak deflections of many bodies from their forces, against closed forms and single histories."""

from __future__ import annotations

import numpy as np
import pytest

import antiosc as ao
from antiosc.simulation.histories.body_motion import peak_deflections
from scenes import finely


def test_step_and_pulse_on_one_oscillator():
    body = ao.AntiOscillators(m0=2.0, k0=800.0, m=[], omega=[])  # 20 rad/s
    step = np.array([0.0, 1.0]), np.array([8.0, 8.0])
    # a short impulse I moves it to I/(m omega)
    pulse = np.array([0.0, 1e-4, 2e-4]), np.array([0.0, 40.0, 0.0])
    none = np.zeros(0), np.zeros(0)
    peaks = peak_deflections([body] * 3, [step, pulse, none], 1.0)
    np.testing.assert_allclose(peaks, [2 * 8.0 / 800.0, 4e-3 / 40.0, 0.0], rtol=1e-3)


def test_the_peak_does_not_depend_on_how_long_the_body_swings_on():
    body = ao.AntiOscillators(m0=2.0, k0=800.0, m=[], omega=[])  # 20 rad/s
    pulse = np.array([0.0, 1e-4, 2e-4]), np.array([0.0, 40.0, 0.0])
    for duration in (1.0, 199 * np.pi / 10):  # in periods of pi/10
        peak = peak_deflections([body, ao.RigidMass(1.0)], [pulse] * 2, duration)[0]
        assert peak == pytest.approx(4e-3 / 40.0, rel=4e-3)


@pytest.mark.slow
def test_bodies_of_different_size_are_histories(rng, monkeypatch):
    monkeypatch.setattr("antiosc.simulation.histories.body_motion.BODIES_AT_ONCE", 2)
    ball, law = ao.RigidMass(mass=0.3, velocity=1.0), ao.Hertz(1e8)
    bodies = [
        ao.AntiOscillators(m0=0.0, k0=1e6, m=[0.4], omega=[900.0]),
        ao.AntiOscillators(
            m0=0.2, k0=0.0, m=rng.uniform(0.1, 1, 5), omega=rng.uniform(1e3, 9e3, 5)
        ),
        ao.AntiOscillators(
            m0=0.1, k0=3e6, m=[0.2, 0.1], omega=[2e3, 5e3], damping=ao.Damping(ratio=0.02)
        ),
    ]
    hits = [ao.simulate(body, ball, law, 0.02) for body in bodies]
    forces = [finely(hit) for hit in hits]
    peaks = peak_deflections(bodies, forces, 0.02)
    for peak, hit, (times, _) in zip(peaks, hits, forces, strict=True):
        assert peak == pytest.approx(hit.coordinates(times)[:, 0].max(), rel=1e-6)
