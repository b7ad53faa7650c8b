"""The run of one contact read as flights and contacts."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

import antiosc as ao
from antiosc.simulation.engine import run
from antiosc.simulation.exact import of_problem, trajectory
from antiosc.simulation.expected import scaled
from antiosc.simulation.two_bodies import assemble
from scenes import HERTZ, case_two


def test_a_step_of_no_length_changes_nothing() -> None:
    """An event may follow another within rounding."""
    model, mass = case_two(6)
    problem, bodies = assemble(model, mass, ao.Hertz(HERTZ))
    problem, lasting = scaled(problem, bodies, 1e-3)
    system = of_problem(problem)
    found = run(system, 1e-3, 1e-2, fine=lasting / 200)
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
    one, other = (trajectory(problem, system, each, 1e-3) for each in (found, doubled))
    assert other.impulse == pytest.approx(one.impulse, rel=1e-12)
    assert other.peak_force == one.peak_force
    times = np.linspace(0, 1e-3, 200)
    np.testing.assert_allclose(other.force_at(times), one.force_at(times), rtol=1e-12)
    assert all(np.isfinite(segment.bends).all() for segment in other.segments)
