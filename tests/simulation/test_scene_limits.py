"""Scenes that are refused, and runs that reach a limit or gain energy: what is told."""

from __future__ import annotations

import pytest

import antiosc as ao
from antiosc.base import march
from antiosc.simulation.march.engine import run
from antiosc.simulation.problem.assembly import assemble
from scene_cases import bounce, random_scene, stops

UP = (0.0, 0.0, 1.0)


def test_bad_scenes_are_refused() -> None:
    mass, wall = ao.RigidMass(1.0, 1.0), ao.Obstacle()
    law = ao.Linear(1e6)
    good = ao.Contact("w", "m", law)
    bodies = {"m": mass, "w": wall}
    with pytest.raises(ao.InputError, match="at least one Contact"):
        ao.Scene(bodies, [])
    with pytest.raises(ao.InputError, match="no body 'x'"):
        ao.Scene(bodies, [ao.Contact("x", "m", law)]).run(1e-3)
    with pytest.raises(ao.InputError, match="both ends"):
        ao.Scene({**bodies, "v": wall}, [ao.Contact("w", "v", law)]).run(1e-3)
    with pytest.raises(ao.InputError, match="same ends"):
        ao.Scene(bodies, [good, ao.Contact("w", "m", law)])
    with pytest.raises(ao.InputError, match="friction between"):
        ao.Scene(bodies, [ao.Contact("w", "m", law, friction=0.3)]).run(1e-3)
    with pytest.raises(ao.InputError, match="must differ"):
        ao.Contact("m", "m", law)
    with pytest.raises(ao.InputError, match="ContactLaw"):
        ao.Contact("w", "m", 1e6)  # type: ignore[arg-type]
    with pytest.raises(ao.InputError, match="ascend"):
        ao.Load("m", [0, 0], [1, 2])
    with pytest.raises(ao.InputError, match="no contact"):
        ao.Scene(bodies, [good]).run(1e-3)["m", "w"]
    with pytest.raises(ao.InputError, match="duration"):
        ao.Scene(bodies, [good]).run(0.0)


def test_bounds_on_the_work_are_told() -> None:
    scene = bounce()
    with pytest.warns(ao.AccuracyWarning, match="more than 5 steps"):
        hit = scene.run(1e-2, max_steps=5)
    assert hit.status == 2
    with pytest.warns(ao.AccuracyWarning, match="leaves no finer run"):
        assert scene.run(1e-2, max_steps=30).status == 1


def test_steps_that_are_given_up_count_as_work() -> None:
    made = assemble(stops()[0], 0.006)
    found = run(made.system, 0.006, 1e-3, scale=1e-9, fine=made.lasting / 200, max_steps=200)
    assert found.answer == march.TOO_MANY_STEPS
    assert found.steps < found.attempts <= 200 + 64 + 14  # halvings, and tries of an exit


def test_what_touches_by_rounding_alone_is_no_contact() -> None:
    """A load far from a stop without gap draws the body away from it."""
    made = assemble(random_scene(1112), 5e-3)
    found = run(made.system, 5e-3, 1e-3, fine=made.lasting / 200, max_steps=100)
    assert found.answer == march.TOO_MANY_STEPS
    assert found.touches == 0


def test_a_gain_of_energy_is_told() -> None:
    with pytest.warns(ao.AccuracyWarning, match="gained energy"):
        hit = random_scene(3483).run(5e-3)
    assert hit.status == 1
    assert hit.energy.drift > 1e-3


def test_energy_held_without_mass_counts_as_given() -> None:
    """A load at the start presses a site without mass against its contact, and then releases it."""
    hit = random_scene(98).run(2e-4, tol=1e-2)
    assert hit.status == 3  # it ends during contact
    assert hit.energy.drift < 1e-4


def test_a_body_that_turns_far_is_told() -> None:
    box = ao.RigidBody(1.0, (1e-3,) * 3, {"c": ((0, 0, 0), UP)})
    contact = ao.Contact("box:c", "floor", ao.Linear(1e5), gap=1.0)
    scene = ao.Scene(
        {"box": box, "floor": ao.Obstacle()}, [contact], motion={"box": ao.Motion(spin=(0, 0, 50))}
    )
    with pytest.warns(ao.AccuracyWarning, match=r"turned by 0\.5 rad"):
        scene.run(1e-2)
