"""Gradients of oblique blows: sliding in closed form, sticking and both against differences."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

import antiosc as ao
from antiosc.engine import adjoint, library, march
from antiosc.engine.system import System
from antiosc.impact.assembly import assemble_scene

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
    return assemble_scene(scene, END).system


def run_of(s: System, tol: float) -> march.Run:
    options = library.COptions(END, tol, 0.0, 0.0, 1e-7, 10_000, 1_000_000, 1)
    return march.solve(s, options)[0]


def at_end(s: System, run: march.Run, weights: np.ndarray) -> adjoint.Slopes:
    """Derivatives of weights (2 J,) times the state at the end."""
    n = run.time.size // 2
    place = np.array([(n - 1, 1.0, 0)], dtype=library.READING)
    weights = np.append(weights, np.zeros(len(s.beta)))[None]
    found, _, answer = adjoint.gradient(
        s, run, run.states, place, weights, np.zeros_like(run.force), np.zeros(n + 1)
    )
    assert answer == library.DONE
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


def scene(x: dict[str, float], given: bool) -> ao.Scene:
    """A part on a rough floor that a hammer strikes from above, and it is pushed aside."""
    arm = {"foot": ((0.004, 0.001, -RADIUS), (0, 0, 1.0)), "head": ((0, 0, RADIUS), (0, 0, -1.0))}
    law = ao.Hertz(x["stiffness"])
    kt = x["tangential_stiffness"] if given else None
    return ao.Scene(
        {
            "part": ao.RigidBody(MASS, (MOMENT,) * 3, arm),
            "floor": ao.Obstacle(),
            "hammer": ao.RigidMass(0.1, x["velocity"]),
        },
        [
            ao.Contact("part:foot", "floor", law, 1e-6, MU, kt),
            ao.Contact("part:head", "hammer", ao.Hertz(1e8)),
        ],
    )


@pytest.mark.filterwarnings("ignore:The run ends during contact")
@pytest.mark.parametrize("given", [False, True])
def test_the_spring_of_friction_follows_from_the_contact(given: bool) -> None:
    """It changes with the law, and with the speed at which what rests is set in motion."""
    values = {"stiffness": 3e8, "velocity": 1.0} | ({"tangential_stiffness": 3e6} if given else {})
    pair, h = ("part:foot", "floor"), 1e-3

    def run(**change: float) -> ao.SceneHistory:
        x = {name: value * (1 + change.get(name, 0.0)) for name, value in values.items()}
        return scene(x, given).run(1e-3, tol=1e-7)

    g = ao.gradient(run(), "impulse", contact=pair)
    found = g.contacts[pair] | {"velocity": g.bodies["hammer"]["velocity"]}
    assert ("tangential_stiffness" in found) == given
    for name, value in values.items():
        ends = [run(**{name: s * h})[pair].impulse for s in (-1, 1)]
        expected = (ends[1] - ends[0]) / (2 * h)
        assert found[name] * value == pytest.approx(expected, abs=2e-5 * g.value), name
