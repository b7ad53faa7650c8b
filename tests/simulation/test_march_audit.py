"""Every step of the march keeps the equations of motion, the laws, friction and its own error."""

from __future__ import annotations

import numpy as np
import pytest

import antiosc as ao
from antiosc.engine import library
from antiosc.engine.equilibrium import set_initial_forces
from antiosc.impact.assembly import assemble_scene
from antiosc.impact.reference import Settings, integrate_reference
from antiosc.impact.states import contact_forces, steps_at
from audited_scenes import SCENES, checked


@pytest.mark.parametrize("name", SCENES)
def test_steps_keep_motion_and_law(name: str) -> None:
    found = checked(name)
    errors = found.errors[np.isfinite(found.errors)]
    if errors.size:
        assert errors.max() < 1.5  # of the tolerance
        # a step with the error e could be e^(-1/3) times as long: few are needlessly short
        assert name in ("preloaded", "given step") or np.cbrt(errors).mean() > 0.3
    located = (
        30 if found.made.system.contacts["friction"].any() else 10
    )  # where friction begins to slip too
    assert found.run.attempts < 1.6 * found.run.steps + 4 * found.run.touches + located


SOLVED = ["HuntCrossley4", "loaded"]


@pytest.mark.parametrize("name", SOLVED)
def test_forces_and_motion_are_those_of_solve_ivp(name: str) -> None:
    """Which shares the bodies with the march, and neither its laws nor its events."""
    (scene, duration), found = SCENES[name], checked(name)
    made = assemble_scene(scene(), duration)
    set_initial_forces(made.system, made.scene.preload)
    longest = min(made.contact_time_estimate, duration) / 4
    other = integrate_reference(made, duration, Settings(1e-5, "DOP853", longest)).run
    assert other.answer == library.DONE
    assert (other.touches, len(other.events)) == (found.run.touches, len(found.run.events))
    at = 1e-3 * duration
    np.testing.assert_allclose(other.events[:, 0], found.run.events[:, 0], rtol=0, atol=at)
    np.testing.assert_array_equal(other.events[:, 1], found.run.events[:, 1])
    times = np.linspace(0, duration, 301)
    mine, exact = (contact_forces(each, *steps_at(each, times)) for each in (found.run, other))
    assert np.linalg.norm(mine - exact) < 3e-3 * np.linalg.norm(exact)
    for ours, theirs in zip(found.run.states[-1], other.states[-1], strict=True):
        np.testing.assert_allclose(ours, theirs, rtol=0, atol=3e-3 * np.abs(theirs).max())
    hit = ao.SceneHistory(made, other, {}, 0, "Completed.")
    assert hit.energy.drift < 2e-3
    s, size = made.system, np.abs(other.depth).max()
    gap = np.array([np.interp(other.time[::2], s.breaks, each) for each in s.offsets.T]).T
    depth = other.states[:, 0] @ s.beta.T - gap - other.force[::2] @ s.R
    np.testing.assert_allclose(other.depth[::2], depth, rtol=0, atol=1e-9 * size)
