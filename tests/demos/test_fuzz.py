"""Some random scenes of benchmarks/fuzz_scenes.py; their checks would see a fault."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

import antiosc as ao
from paths import demo

fuzz_scenes = demo("fuzz_scenes")


@pytest.mark.parametrize(
    ("scenes", "first", "least"),
    [(17, 212, 16), pytest.param(150, 2000, 0, marks=pytest.mark.slow)],
)
def test_random_scenes(scenes, first, least):
    result = fuzz_scenes.main(scenes=scenes, first=first)
    assert result["failures"] == []
    assert result["counts"]["status 0"] + result["counts"].get("status 3", 0) >= least
    assert max(result["figures"]["momentum"]) <= 1e-10


def oblique():
    body = ao.RigidBody(0.5, (1e-4,) * 3, {"foot": ((0, 0, 0), (0, 0, 1.0))})
    contact = ao.Contact("body:foot", "floor", ao.Hertz(1e9), friction=0.3)
    motion = {"body": ao.Motion(velocity=(1.0, 0, -1.0))}
    return ao.Scene({"body": body, "floor": ao.Obstacle()}, [contact], motion=motion).run(2e-3)


def test_sound_runs_pass():
    wrong, found = fuzz_scenes.check(oblique())
    assert wrong == ""
    assert found["momentum"] < 1e-12


@pytest.mark.parametrize(
    ("place", "index", "fault", "told"),
    [
        ("run.depth", (2, 0), lambda x: np.nan, "not finite"),
        ("run.states", (-1, 1), lambda x: x * (1 + 1e-9), "momentum"),
        ("run.force", (slice(None), slice(1, None)), lambda x: 1.01 * x, "cone"),
        ("run.states", (slice(5, None), 1), lambda x: 1.01 * x, "gained"),
    ],
)
def test_faults_are_seen(place, index, fault, told):
    """A check that cannot fail proves nothing."""
    hit = oblique()
    *path, name = place.split(".")
    owner = getattr(hit, path[0]) if path else hit
    getattr(owner, name)[index] = fault(getattr(owner, name)[index])
    assert told in fuzz_scenes.check(replace(hit))[0]  # nothing kept from before


def test_a_bound_that_is_not_met_closely_leaves_the_step_as_long_as_its_response():
    """Scene 48 cannot find the end of a piece closely enough in its first step, of 15 ps."""
    run = fuzz_scenes.draw(48).run(fuzz_scenes.DURATION)
    assert fuzz_scenes.momentum_error(run) < 1e-12
