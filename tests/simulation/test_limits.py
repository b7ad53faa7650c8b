"""Runs that reach a limit or gain energy: what is told, and that what is there by then is kept."""

from __future__ import annotations

import numpy as np
import pytest

import antiosc as ao
from scene_cases import bounce


def test_bounds_on_the_work_are_told() -> None:
    scene = bounce()
    with pytest.warns(ao.AccuracyWarning, match="more than 5 steps"):
        hit = scene.run(1e-2, max_steps=5)
    assert hit.status == 2
    with pytest.warns(ao.AccuracyWarning, match="leaves no finer run"):
        assert scene.run(1e-2, max_steps=30).status == 1


MODEL = ao.AntiOscillators(m0=0.05, k0=1e5, m=[0.02, 0.08], omega=[1.5e3, 2e4])
MASS, LAW = ao.RigidMass(0.1, 1.0), ao.Hertz(1e8)


@pytest.mark.parametrize("method", ["newmark", "leapfrog"])
def test_steps_without_an_end_are_refused_beforehand(method: str) -> None:
    with pytest.raises(ao.InputError, match="more than max_steps = 1000000"):
        ao.simulate(MODEL, MASS, LAW, 2e-3, method, step=2e-12)


@pytest.mark.parametrize(
    ("method", "limits", "words"),
    [
        ("newmark", {"step": 1e-6, "max_steps": 20}, "more than 20 steps"),
        ("leapfrog", {"step": 1e-6, "max_steps": 21}, "more than 21 steps"),
        ("exact", {"step": 1e-6, "max_steps": 30}, "more than 30 steps"),
    ],
)
def test_a_method_that_gives_up_says_why_and_where(method: str, limits: dict, words: str) -> None:
    with pytest.warns(ao.AccuracyWarning, match=words):
        hit = ao.simulate(MODEL, MASS, LAW, 2e-3, method, gap=2e-5, **limits)
    assert hit.status == 2
    assert words in hit.message
    assert hit.message[0].isupper()
    assert hit.time[-1] < 1e-4
    assert np.isfinite(hit.displacement).all()
    if "step" in limits and method != "exact":
        count = limits["max_steps"]
        assert hit.time[-1] == pytest.approx(count * 1e-6, rel=1e-9)
        assert hit.run.attempts == count


@pytest.mark.parametrize("most", [1, 4])
def test_another_integrator_that_gives_up_has_no_answer(most: int) -> None:
    with pytest.raises(ao.NotConvergedError, match=f"more than max_steps = {most}: use the method"):
        ao.simulate(MODEL, MASS, LAW, 2e-3, "DOP853", gap=2e-5, max_steps=most)


def test_a_scene_of_thousands_of_bodies_is_refused_at_once():
    law = ao.Hertz(1e9)
    names = [f"b{i}" for i in range(1500)]
    chain = [ao.Contact(*pair, law) for pair in zip(names, names[1:])]  # noqa: B905, RUF007
    with pytest.raises(ao.InputError, match="at most 1000 bodies and contacts; got 1500"):
        ao.Scene({name: ao.RigidMass(0.1) for name in names}, chain)
