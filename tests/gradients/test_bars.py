"""The bars of gradients: they hold the derivatives of models of many more anti-oscillators."""

from __future__ import annotations

import numpy as np
import pytest

import antiosc as ao
from antiosc import closed_form

NAMES = ("mass", "velocity", "stiffness")


@pytest.mark.slow
def test_bars_hold_what_more_oscillators_and_finer_steps_give() -> None:
    beam = closed_form.UniformBeam.timoshenko(
        E=70e9, nu=0.33, rho=2700.0, area=2e-4, inertia=1.7e-9, length=0.3
    )
    struck = closed_form.pinned_pinned(beam, 0.13)
    few, many = struck.anti_oscillators(8), struck.anti_oscillators(40)
    inside = []
    for stiffness in (3e7, 1e9):
        blow = (ao.RigidMass(0.05, 1.0), ao.Hertz(stiffness), 1e-3)
        hit, best = ao.simulate(few, *blow), ao.simulate(many, *blow, tol=1e-5)
        for goal in ("peak_force", "impulse"):
            g, fine = ao.gradient(hit, goal, error="estimate"), ao.gradient(best, goal)
            assert g.error is not None
            inside += [
                abs(getattr(g, name) - getattr(fine, name)) <= getattr(g.error, name)
                for name in NAMES
            ]
            assert g.error.m is None  # the model of fewer has other ones
    assert np.mean(inside) >= 0.8, inside


def test_a_scene_has_no_bars() -> None:
    wall = ao.Scene(
        {"wall": ao.Obstacle(), "ball": ao.RigidMass(0.2, 1.0)},
        [ao.Contact("wall", "ball", ao.Linear(1e6))],
    )
    with pytest.raises(ao.InputError, match="bars"):
        ao.gradient(wall.run(2e-3), "impulse", error="estimate")
