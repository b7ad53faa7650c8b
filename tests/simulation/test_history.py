"""What a history says: nodes, motion at any time, numbers, and its own consistency."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

import antiosc as ao
from antiosc.simulation import states
from scenes import HERTZ, case_two, random_model


def test_later_impact_is_another_one():
    """A ball that falls back after a long flight: the main impact is the first."""
    body = ao.AntiOscillators(m0=1e9, k0=0, m=[], omega=[])
    run = ao.simulate(body, ao.Obstacle(), ao.Hertz(1e9), 1e-3, initial_velocity=0.0)
    assert run.contact_time == 0.0
    ground = ao.AntiOscillators(m0=1e9, k0=0.0, m=[], omega=[], participation=[0.0])
    ball = ao.simulate(
        ground, ao.RigidMass(0.1), ao.HuntCrossley(1e9, 0.7), 0.19, gravity=9.81, gap=0.01
    )
    assert len(ball.contacts) >= 3
    start, end = ball.contacts[0]
    assert ball.contact_time == pytest.approx(end - start)


@pytest.mark.parametrize("seconds", [1e3, 1.0, 1e-9])
def test_times_are_found_in_their_steps_in_any_unit(seconds):
    """A node begins its step, also where the time is off by rounding; steps have three nodes."""
    nodes = seconds * np.array([0.0, 0.1, 0.2, 0.5, 0.8, 0.9, 1.0])
    run = SimpleNamespace(time=nodes)
    for time, step, since in ((0.0, 0, 0.0), (0.05, 0, 0.05), (0.2, 1, 0.0), (0.7, 1, 0.5)):
        for off in (1.0, 1 - 1e-15, 1 + 1e-15):
            found = states.located(run, np.array([seconds * time * off]))
            assert found[0] == [step]
            assert found[1] == pytest.approx(since * seconds, abs=1e-14 * seconds)


def test_a_picture_of_several_contacts_names_them():
    bodies = {
        "a": random_model(np.random.default_rng(0), 3),
        "b": ao.RigidMass(0.1, 2.0),
        "c": ao.RigidMass(0.2),
    }
    contacts = [ao.Contact("a", "b", ao.Hertz(HERTZ)), ao.Contact("b", "c", ao.Hertz(HERTZ), 1e-3)]
    with pytest.raises(ao.InputError, match="several contacts"):
        ao.Scene(bodies, contacts).run(1e-3).plot()


def test_a_step_of_no_length_changes_nothing() -> None:
    """An event may follow another within rounding."""
    one = ao.simulate(*case_two(6), ao.Hertz(HERTZ), 1e-3, tol=1e-2)
    found = one.run
    assert found.states is not None
    k = int(np.argmax(found.force[:, 0])) // 2
    at = [2 * k + 1, 2 * k + 1]
    doubled = replace(
        found,
        time=np.insert(found.time, at, found.time[2 * k]),
        force=np.insert(found.force, at, found.force[2 * k], axis=0),
        depth=np.insert(found.depth, at, found.depth[2 * k], axis=0),
        states=np.insert(found.states, k, found.states[k], axis=0),
    )
    other = replace(one, run=doubled)
    assert other.impulse == pytest.approx(one.impulse, rel=1e-12)
    assert other.peak_force == one.peak_force
    times = np.linspace(0, 1e-3, 200)
    np.testing.assert_allclose(other.force_at(times), one.force_at(times), rtol=1e-12)
    assert np.isfinite(other.energy.total).all()
