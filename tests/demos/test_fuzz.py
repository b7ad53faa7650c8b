"""A few of the random scenes of demos/fuzz.py, and that its checks would see a fault."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

import antiosc as ao
from paths import demo
from scenes import HERTZ, case_two, rigid

fuzz = demo("fuzz")


def test_random_scenes():
    result = fuzz.main(scenes=20, seed=3)
    assert result["failures"] == []
    assert result["momentum"] <= 1e-9


@pytest.mark.slow
def test_more_random_scenes():
    result = fuzz.main(scenes=1000, seed=4)
    assert result["failures"] == []


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
        hit.contact_histories[0]._impulses[0] *= 1 + 1e-6
        assert "momentum error" in fuzz.check(hit, {})[0]

    def test_crash(self, monkeypatch):
        def broken(self, *args, **kwargs):
            raise ZeroDivisionError("division by zero")

        monkeypatch.setattr(ao.Hertz, "implicit", broken)
        result = fuzz.main(scenes=40)
        assert any("division by zero" in failure for failure in result["failures"])

    def test_unexpected_refusal(self):
        assert not fuzz.expected(ao.InputError("k0 must be >= 0"), {})
        law = replace(ao.Hertz(1.0), compliance=1.0)
        assert fuzz.expected(ao.AccuracyError("the peak force"), {"contact": law})
        assert not fuzz.expected(ao.AccuracyError("the peak force"), {"contact": ao.Hertz(1.0)})


@pytest.mark.slow
def test_stability_demo_small(tmp_path):
    stability = demo("stability")
    result = stability.main(most=4, counts=2, steps=5, decades=2, hard=False, fine=26, out=tmp_path)
    limits = result["limits"]
    # central differences diverge above the limit that the contact lowers; the others nowhere
    model = stability.pinned_pinned(stability.BEAM).anti_oscillators(4)
    bound = 0.7 * demo("stability_scenes").stable_steps(model)[1]
    failed = [r for r in result["runs"] if r["kind"] == "diverged" and "margin" not in r]
    assert {r["method"] for r in failed} == {"leapfrog"}
    assert all(r["step"] > bound for r in failed)
    assert limits["exact"]["first diverged"] is None
    assert limits["newmark"]["first diverged"] is None
    drifts = [r["drift"] for r in result["runs"] if r["method"] == "conserving"]
    assert max(drifts) < 1e-9
    assert (tmp_path / "stability.png").stat().st_size > 0
    # the exact integrator fails in the predicted windows alone, the implicit ones in none
    windows = result["windows"]
    bad = [r for r in windows if r["kind"] in ("wrong", "diverged") and r["method"] != "leapfrog"]
    assert len(bad) >= 3
    assert {r["method"] for r in bad} == {"exact"}
    assert all(r["margin"] < 1 for r in bad)
    assert (tmp_path / "stability_windows.png").stat().st_size > 0
    assert not list(tmp_path.glob("*.part"))


@pytest.mark.slow
def test_work_precision_parts(tmp_path):
    work = demo("work_precision")
    model, _ = case_two(4)
    run = work.default_run(model, 4, 0.01, repeats=1)
    assert run["error"] < 1e-3
    batch = work.batch_rate(model, scenes=24, repeats=1)
    assert batch["largest difference"] < 1e-9
    assert batch["largest error"] <= 1e-3
    steps = np.array([1.6e-5, 8e-6])
    scene = work.Scene("small", model, work.STRIKER, ao.Hertz(HERTZ), 3e-4, steps)
    truth = scene.run("DOP853", tol=1e-5)
    rows = [work.measure(scene, truth, "exact", {"step": float(h)}, 1) for h in scene.steps]
    assert rows[1]["error"] < 0.4 * rows[0]["error"]
    work.chart(rows, tmp_path / "chart.png")
    assert (tmp_path / "chart.png").stat().st_size > 0
    stops = [work.on_stops(p, 6, 1) for p in (1, 3)]
    assert all(row["touches"] >= row["contacts"] and row["error"] <= 1e-3 for row in stops)
    work.chart_contacts(stops, tmp_path / "contacts.png")
    assert (tmp_path / "contacts.png").stat().st_size > 0
