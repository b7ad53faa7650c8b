"""The run of one contact read as its touches."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

import antiosc as ao
from scenes import HERTZ, case_two


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
