"""Gradients of oblique blows that stick and slip, against differences of runs."""

from __future__ import annotations

import pytest

import antiosc as ao

MASS, RADIUS, MU = 0.3, 0.02, 0.2
MOMENT = 0.4 * MASS * RADIUS**2


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
            ao.Contact("part:foot", "floor", law, 1e-6, x["friction"], kt),
            ao.Contact("part:head", "hammer", ao.Hertz(1e8)),
        ],
    )


@pytest.mark.slow
@pytest.mark.filterwarnings("ignore:The run ends during contact")
@pytest.mark.parametrize("given", [False, True])
def test_the_spring_of_friction_follows_from_the_contact(given: bool) -> None:
    """It changes with the law, and with the speed at which what rests is set in motion."""
    values = {"stiffness": 3e8, "velocity": 1.0, "friction": MU} | (
        {"tangential_stiffness": 3e6} if given else {}
    )
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
