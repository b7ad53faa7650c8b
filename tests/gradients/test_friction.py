"""Gradients of oblique blows: sliding in closed form, sticking and both against differences."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

import antiosc as ao
from antiosc.base import march
from antiosc.simulation.assembly import assemble
from antiosc.simulation.march import engine
from antiosc.simulation.march.system import System

MASS, RADIUS, MU, END = 0.3, 0.02, 0.2, 3e-3
MOMENT = 0.4 * MASS * RADIUS**2


def system(speed: float, law: ao.ContactLaw, pull: float = 0.0, arm: float = 0.0) -> System:
    """A sphere that falls on the floor at 1 m/s and a tangential speed."""
    foot = ((arm, arm / 3, -RADIUS), (0, 0, 1.0))
    body = ao.RigidBody(MASS, (MOMENT,) * 3, {"foot": foot})
    contact = ao.Contact("ball:foot", "floor", law, friction=MU, tangential_stiffness=3e6, gap=1e-6)
    scene = ao.Scene(
        {"ball": body, "floor": ao.Obstacle()},
        [contact],
        motion={"ball": ao.Motion(velocity=(speed, 0, -1.0))},
        gravity=(0, 0, -pull),
    )
    return assemble(scene, END).system


def run_of(s: System, tol: float) -> engine.Run:
    options = march.Options(END, tol, 0.0, 0.0, 1e-7, 10_000, 1_000_000, 1)
    return engine.solve(s, options)[0]


def at_end(s: System, run: engine.Run, weights: np.ndarray) -> engine.Slopes:
    """Derivatives of weights (2 J,) times the state at the end."""
    n = run.time.size // 2
    place = np.array([(n - 1, 1.0, 0)], dtype=march.READING)
    weights = np.append(weights, np.zeros(len(s.beta)))[None]
    found, _, answer = engine.gradient(
        s, run, run.states, place, weights, np.zeros_like(run.force), np.zeros(n + 1)
    )
    assert answer == march.DONE
    return found


@pytest.mark.parametrize("law", [ao.Hertz(3e8), ao.Thornton(3e8, 1e-5)])
def test_a_sphere_that_slides_all_along(law: ao.ContactLaw) -> None:
    """Its foot loses mu J (1/m + r^2/I) = 3.5 mu J/m, J the normal impulse."""
    s = system(3.0, law)
    run = run_of(s, 1e-6)
    change = run.states[-1, 1] - run.states[0, 1]
    # along the first tangential row, against its speed at the start
    row = s.beta[1] * np.sign(s.beta[1] @ s.v)
    if abs(s.beta[1] @ s.v) < abs(s.beta[2] @ s.v):
        row = s.beta[2] * np.sign(s.beta[2] @ s.v)
    found = at_end(s, run, np.append(np.zeros(s.omega.size), row))
    lost = -float(row @ change)
    assert found.friction[0] == pytest.approx((-lost / MU, 0.0), rel=1e-5, abs=1e-9)
    assert lost == pytest.approx(3.5 * MU * abs(float(s.beta[0] @ change)), rel=1e-5)


@pytest.mark.parametrize("speed", [0.1, 1.0])
def test_stick_and_slip_against_differences(speed: float) -> None:
    """Where it goes over from one to the other is found to the step alone: order 1."""
    rng = np.random.default_rng(4)
    s = system(speed, ao.Hertz(3e8), pull=2000.0, arm=0.003)
    weights = rng.normal(size=2 * s.omega.size) * np.repeat([1e2, 1.0], s.omega.size)
    run, h = run_of(s, 1e-7), 1e-5
    found = at_end(s, run, weights)
    for name, by in (("v", found.v), ("beta", found.beta), ("slip", found.friction)):
        along = rng.normal(size=by.shape) * getattr(s, name)
        changed = [replace(s, **{name: getattr(s, name) + e * along}) for e in (-h, h)]
        ends = [run_of(each, 1e-9).states[-1].ravel() for each in changed]
        expected = float((ends[1] - ends[0]) @ weights) / (2 * h)
        assert float(np.sum(by * along)) == pytest.approx(expected, rel=5e-3), name
