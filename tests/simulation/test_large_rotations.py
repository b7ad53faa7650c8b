"""Free bodies that turn far, which the small rotations of the theory do not cover."""

from __future__ import annotations

import warnings
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

import antiosc as ao
from antiosc.models.closed_form import UniformBeam
from struck_beams import free_free

BAR = UniformBeam.euler_bernoulli(E=70e9, rho=2700.0, area=2e-4, inertia=1.7e-9, length=0.4)
MODEL = free_free(BAR, 0.03).anti_oscillators(8)
LAW, TIME = ao.Hertz(1e9), 0.05


def struck(speed: float) -> ao.History:
    return ao.simulate(MODEL, ao.RigidMass(0.05, speed), LAW, TIME)


def scene(speed: float) -> ao.SceneHistory:
    bodies = {"structure": MODEL, "b": ao.RigidMass(0.05, speed)}
    return ao.Scene(bodies, [ao.Contact("structure", "b", LAW)]).run(TIME)


def spun(speed: float) -> ao.History:
    start = ao.Motion(velocity=(0.0, -1.0, 0.0), spin=(0.0, 0.0, 10 * speed))
    return ao.simulate(MODEL, ao.Obstacle(1.0), LAW, TIME, initial_velocity=start)


def told(run: Callable[[float], Any], speed: float) -> tuple[Any, list[str]]:
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        hit = run(speed)
    return hit, [str(w.message) for w in caught if "turned by" in str(w.message)]


@pytest.mark.parametrize("run", [struck, scene, spun])
def test_a_free_body_that_turns_far_is_told_however_it_is_run(run: Callable[[float], Any]) -> None:
    _, (sentence,) = told(run, 3.0)
    assert "structure" in sentence
    assert told(run, 0.1)[1] == []


def test_the_angle_is_that_of_the_angular_momentum() -> None:
    hit, (sentence,) = told(struck, 3.0)
    J = 2700.0 * 2e-4 * 0.4**3 / 12
    rate = hit.angular_momentum[:, 2] / J
    angle = np.sum(np.diff(hit.time) * (rate[1:] + rate[:-1]) / 2)
    assert float(sentence.split("turned by ")[1].split(" rad")[0]) == pytest.approx(
        abs(angle), rel=0.02
    )
    other, _ = told(scene, 3.0)
    assert other.largest_rotation()[1] == pytest.approx(abs(angle), rel=1e-3)
    body = other.bodies["structure"]
    assert body.rotation[-1] == pytest.approx([0.0, 0.0, angle], rel=1e-3, abs=1e-9)
