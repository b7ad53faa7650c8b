"""Some random scenes of benchmarks/fuzz_scenes.py, and that its checks would see a fault."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

import antiosc as ao
from paths import demo

fuzz = demo("fuzz_scenes")


def test_random_scenes() -> None:
    result = fuzz.main(scenes=17, first=212)
    assert result["failures"] == []
    assert result["counts"]["status 0"] + result["counts"].get("status 3", 0) >= 16
    assert max(result["figures"]["momentum"]) <= 1e-10


@pytest.mark.slow
def test_more_random_scenes() -> None:
    result = fuzz.main(scenes=150, first=2000)
    assert result["failures"] == []


class TestItSeesFaults:
    """A check that cannot fail proves nothing."""

    @pytest.fixture
    def hit(self) -> ao.SceneHistory:
        body = ao.RigidBody(0.5, (1e-4,) * 3, {"foot": ((0, 0, 0), (0, 0, 1.0))})
        contact = ao.Contact("body:foot", "floor", ao.Hertz(1e9), friction=0.3)
        motion = {"body": ao.Motion(velocity=(1.0, 0, -1.0))}
        return ao.Scene({"body": body, "floor": ao.Obstacle()}, [contact], motion=motion).run(2e-3)

    def test_good(self, hit: ao.SceneHistory) -> None:
        wrong, found = fuzz.check(hit)
        assert wrong == ""
        assert found["momentum"] < 1e-12

    def test_nan(self, hit: ao.SceneHistory) -> None:
        hit.run.depth[2, 0] = np.nan
        assert "not finite" in fuzz.check(hit)[0]

    def test_momentum(self, hit: ao.SceneHistory) -> None:
        hit.run.states[-1, 1] *= 1 + 1e-9
        assert "momentum" in fuzz.check(hit)[0]

    def test_friction(self, hit: ao.SceneHistory) -> None:
        hit.run.force[:, 1:] *= 1.01
        assert "cone" in fuzz.check(hit)[0]

    def test_energy(self, hit: ao.SceneHistory) -> None:
        hit.run.states[5:, 1] *= 1.01  # in the midst of the contact
        assert "gained" in fuzz.check(replace(hit))[0]  # nothing kept from before


def test_a_bound_that_is_not_met_closely_leaves_the_step_as_long_as_its_response() -> None:
    """Scene 48 cannot find the end of a piece closely enough in its first step, of 15 ps."""
    assert fuzz.momentum_error(fuzz.draw(48).run(fuzz.DURATION)) < 1e-12
