"""Some random runs of benchmarks/fuzz*.py, and that their checks would see a fault."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

import antiosc as ao
from paths import demo
from scenes import rigid

fuzz, fuzz_scenes = demo("fuzz"), demo("fuzz_scenes")


@pytest.mark.parametrize(("scenes", "seed"), [(20, 3), pytest.param(50, 4, marks=pytest.mark.slow)])
def test_random_impacts(scenes, seed):
    result = fuzz.main(scenes=scenes, seed=seed)
    assert result["failures"] == []
    assert result["momentum"] <= 1e-9


@pytest.mark.parametrize(
    ("scenes", "first", "least"),
    [(17, 212, 16), pytest.param(150, 2000, 0, marks=pytest.mark.slow)],
)
def test_random_scenes(scenes, first, least):
    result = fuzz_scenes.main(scenes=scenes, first=first)
    assert result["failures"] == []
    assert result["counts"]["status 0"] + result["counts"].get("status 3", 0) >= least
    assert max(result["figures"]["momentum"]) <= 1e-10


def impact():
    return ao.simulate(rigid(1.0), ao.RigidMass(1.0, 1.0), ao.Hertz(1e9), 1e-2)


def oblique():
    body = ao.RigidBody(0.5, (1e-4,) * 3, {"foot": ((0, 0, 0), (0, 0, 1.0))})
    contact = ao.Contact("body:foot", "floor", ao.Hertz(1e9), friction=0.3)
    motion = {"body": ao.Motion(velocity=(1.0, 0, -1.0))}
    return ao.Scene({"body": body, "floor": ao.Obstacle()}, [contact], motion=motion).run(2e-3)


def test_sound_runs_pass():
    assert fuzz.check(impact(), {}) == ("", 0.0)
    wrong, found = fuzz_scenes.check(oblique())
    assert wrong == ""
    assert found["momentum"] < 1e-12


@pytest.mark.parametrize(
    ("run", "place", "index", "fault", "told"),
    [
        (impact, "run.force", 2, lambda x: np.nan, "not finite"),
        (impact, "force", 2, lambda x: -1e-3, "negative force"),
        (impact, "_numbers.impulse", None, lambda x: x * (1 + 1e-6), "momentum error"),
        (oblique, "run.depth", (2, 0), lambda x: np.nan, "not finite"),
        (oblique, "run.states", (-1, 1), lambda x: x * (1 + 1e-9), "momentum"),
        (oblique, "run.force", (slice(None), slice(1, None)), lambda x: 1.01 * x, "cone"),
        (oblique, "run.states", (slice(5, None), 1), lambda x: 1.01 * x, "gained"),
    ],
)
def test_faults_are_seen(run, place, index, fault, told):
    """A check that cannot fail proves nothing."""
    hit = run()
    *path, name = place.split(".")
    owner = getattr(hit, path[0]) if path else hit
    if index is None:
        setattr(owner, name, fault(getattr(owner, name)))
    else:
        getattr(owner, name)[index] = fault(getattr(owner, name)[index])
    if run is impact:
        assert told in fuzz.check(hit, {})[0]
    else:
        assert told in fuzz_scenes.check(replace(hit))[0]  # nothing kept from before


@pytest.mark.slow
def test_a_crash_is_seen(monkeypatch):
    def broken(self, *args, **kwargs):
        raise ZeroDivisionError("division by zero")

    monkeypatch.setattr(ao.ContactLaw, "implicit", broken)
    result = fuzz.main(scenes=40)
    assert any("division by zero" in failure for failure in result["failures"])


def test_unexpected_refusal():
    assert not fuzz.expected(ao.InputError("k0 must be >= 0"), {})
    law = replace(ao.Hertz(1.0), compliance=1.0)
    assert fuzz.expected(ao.AccuracyError("the peak force"), {"contact": law})
    assert not fuzz.expected(ao.AccuracyError("the peak force"), {"contact": ao.Hertz(1.0)})


def test_every_law_and_impactor_is_drawn():
    scenes = [fuzz.draw(np.random.default_rng(i)) for i in range(300)]
    assert len({type(s["contact"]) for s in scenes}) == 12
    kinds = {type(s["impactor"]) for s in scenes}
    assert kinds == {ao.RigidMass, ao.Sphere, ao.Obstacle, ao.Impactor, ao.AntiOscillators}
    light = [s for s in scenes if isinstance(s["impactor"], ao.RigidMass)]
    ratios = [s["impactor"].mass / s["model"].m_st for s in light]
    assert min(ratios) < 1e-5
    assert max(ratios) > 1e5
    assert {0.0} < {s["model"].m0 for s in scenes}


def test_a_bound_that_is_not_met_closely_leaves_the_step_as_long_as_its_response():
    """Scene 48 cannot find the end of a piece closely enough in its first step, of 15 ps."""
    run = fuzz_scenes.draw(48).run(fuzz_scenes.DURATION)
    assert fuzz_scenes.momentum_error(run) < 1e-12
