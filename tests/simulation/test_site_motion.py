"""How far a site moves, later too, and when its striker is out of reach."""

from __future__ import annotations

import numpy as np
import pytest

import antiosc as ao
from antiosc.impact.histories.site_motion import parted

LAW = ao.Hertz(1e8)
THREE = ao.AntiOscillators(m0=0.3, k0=1e6, m=[0.2, 0.15], omega=[3e3, 5.2e3])
LIGHT = ao.RigidMass(0.02, 1.0)


def struck(model: ao.AntiOscillators, striker: ao.RigidMass, duration: float) -> ao.History:
    return ao.simulate(model, striker, LAW, duration, tol=1e-6)


@pytest.mark.slow
def test_the_largest_motion_is_that_of_the_history() -> None:
    hit = struck(THREE, LIGHT, 0.02)
    motion = hit.site_motion
    times = np.linspace(0.0, 0.02, 200_001)
    moved = np.abs(hit.at(times)["structure"].displacement())
    assert motion.largest_displacement == pytest.approx(moved.max(), rel=1e-6)
    assert motion.time == pytest.approx(times[moved.argmax()], abs=2e-6)


def test_a_striker_out_of_reach_does_not_meet_the_part_again() -> None:
    for mass in (0.02, 0.1, 0.3, 0.45, 0.6):
        striker = ao.RigidMass(mass, 1.0)
        long = struck(THREE, striker, 0.1)
        assert parted(long)
        for later in (1e-5, 3e-4, 1e-3, 3e-3):
            hit = struck(THREE, striker, long.contacts[0][1] + later)
            assert not parted(hit) or len(long.contacts) == len(hit.contacts)


def test_an_impact_whose_duration_is_auto_lasts_until_its_bodies_have_parted():
    """A soft contact needs longer than the first duration, and twice its last one is not tried."""
    model, ball = ao.AntiOscillators(m0=0.1, k0=1e6, m=[], omega=[]), ao.RigidMass(0.3, 1.0)
    hit = ao.simulate(model, ball, ao.Linear(1e5), "auto")
    duration = float(hit.run.time[-1])
    assert duration == 8e-3
    assert hit.contacts[-1][1] < duration
    half = ao.simulate(model, ball, ao.Linear(1e5), duration / 2)
    assert not parted(half)
    assert hit.peak_force == ao.simulate(model, ball, ao.Linear(1e5), duration).peak_force
