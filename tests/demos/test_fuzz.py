"""A few of the random scenes of benchmarks/fuzz.py, and that its checks would see a fault."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

import antiosc as ao
from paths import demo
from scenes import rigid

fuzz = demo("fuzz")


def test_random_scenes():
    result = fuzz.main(scenes=20, seed=3)
    assert result["failures"] == []
    assert result["momentum"] <= 1e-9


@pytest.mark.slow
def test_more_random_scenes():
    result = fuzz.main(scenes=50, seed=4)
    assert result["failures"] == []


class TestItSeesFaults:
    """A check that cannot fail proves nothing."""

    @pytest.fixture
    def hit(self):
        return ao.simulate(rigid(1.0), ao.RigidMass(1.0, 1.0), ao.Hertz(1e9), 1e-2)

    def test_good(self, hit):
        assert fuzz.check(hit, {}) == ("", 0.0)

    def test_nan(self, hit):
        hit.run.force[2] = np.nan
        assert "not finite" in fuzz.check(hit, {})[0]

    def test_negative_force(self, hit):
        hit.force[2] = -1e-3
        assert "negative force" in fuzz.check(hit, {})[0]

    def test_momentum(self, hit):
        hit._numbers.impulse *= 1 + 1e-6
        assert "momentum error" in fuzz.check(hit, {})[0]

    @pytest.mark.slow
    def test_crash(self, monkeypatch):
        def broken(self, *args, **kwargs):
            raise ZeroDivisionError("division by zero")

        monkeypatch.setattr(ao.ContactLaw, "implicit", broken)
        result = fuzz.main(scenes=40)
        assert any("division by zero" in failure for failure in result["failures"])

    def test_unexpected_refusal(self):
        assert not fuzz.expected(ao.InputError("k0 must be >= 0"), {})
        law = replace(ao.Hertz(1.0), compliance=1.0)
        assert fuzz.expected(ao.AccuracyError("the peak force"), {"contact": law})
        assert not fuzz.expected(ao.AccuracyError("the peak force"), {"contact": ao.Hertz(1.0)})


def test_every_law_and_impactor_is_drawn():
    scenes = [fuzz.draw(np.random.default_rng(i)) for i in range(300)]
    assert len({type(s["contact"]) for s in scenes}) == 12
    kinds = {type(s["impactor"]) for s in scenes}
    assert kinds == {ao.RigidMass, ao.Sphere, ao.Obstacle, ao.Impactor, ao.AntiOscillators}
    ratios = [
        s["impactor"].mass / s["model"].m_st
        for s in scenes
        if isinstance(s["impactor"], ao.RigidMass)
    ]
    assert min(ratios) < 1e-5
    assert max(ratios) > 1e5
    assert {0.0} < {s["model"].m0 for s in scenes}
