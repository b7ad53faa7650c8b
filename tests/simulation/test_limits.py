"""Runs that reach a limit or gain energy: what is told, and that what is there by then is kept."""

from __future__ import annotations

import subprocess
import sys
from dataclasses import dataclass, field

import numpy as np
import pytest

import antiosc as ao
from antiosc.engine import library
from antiosc.engine.contact import State
from antiosc.engine.march import converge, run
from antiosc.impact.assembly import assemble_scene
from scene_cases import bounce, random_scene


def test_bounds_on_the_work_are_told() -> None:
    scene = bounce()
    with pytest.warns(ao.AccuracyWarning, match="more than 5 steps"):
        hit = scene.run(1e-2, max_steps=5)
    assert hit.status == 2
    with pytest.warns(ao.AccuracyWarning, match="leaves no finer run"):
        assert scene.run(1e-2, max_steps=30).status == 1


def test_a_gain_of_energy_is_told() -> None:
    with pytest.warns(ao.AccuracyWarning, match="gained energy"):
        hit = random_scene(3483).run(5e-3)
    assert hit.status == 1
    assert hit.energy.drift > 1e-3


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
        ("DOP853", {"max_steps": 4}, "more than 4 steps"),
        ("DOP853", {"max_steps": 1}, "more than 1 steps"),
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


def test_contacts_without_end_are_stopped() -> None:
    for method in ("exact",):
        with pytest.warns(ao.AccuracyWarning, match="more than 3 contacts"):
            hit = ao.simulate(
                ao.AntiOscillators(m0=1.0, k0=1e9, m=[], omega=[]), ao.RigidMass(0.1),
                ao.HuntCrossley(1e9, 0.9), 0.3, method, gravity=9.81, gap=1e-3, max_contacts=3,
                step=2e-6,
            )  # fmt: skip
        assert len(hit.contacts) == 3
        assert hit.status == 2


@dataclass
class Unlike(ao.ContactLaw):
    """A spring that is another one in every run."""

    runs: list[float] = field(default_factory=list)

    def touch(self, speed: float, state: State | None = None) -> State:
        if speed == 1.0 and state is None:
            self.runs.append(1e6 * (1.0 + 0.05 * np.sin(2.4 * len(self.runs))))
        return ()

    def force(self, delta: float, rate: float, state: State) -> float:
        return self.runs[-1] * max(delta, 0.0)

    def tangent(self, delta: float, rate: float, state: State) -> tuple[float, float]:
        return (self.runs[-1] if delta > 0 else 0.0, 0.0)

    def energy(self, delta: float, state: State) -> float:
        return 0.5 * self.runs[-1] * max(delta, 0.0) ** 2


def test_a_run_whose_forces_do_not_settle_is_not_taken_for_converged() -> None:
    law = Unlike()
    bodies = {"wall": ao.Obstacle(), "mass": ao.RigidMass(1.0, 1.0)}
    scene = ao.Scene(bodies, [ao.Contact("wall", "mass", law)])
    made = assemble_scene(scene, 1e-2)
    law.runs.clear()
    found = converge(made.system, made.contact_time_estimate, 1e-2, 1e-3, 100, 10**6)
    assert found.force > 1e-3
    assert len(law.runs) > 3


def test_what_touches_by_rounding_alone_is_no_contact() -> None:
    """A load far from a stop without gap draws the body away from it."""
    made = assemble_scene(random_scene(1112), 5e-3)
    found = run(made.system, 5e-3, 1e-3, fine=made.contact_time_estimate / 200, max_steps=100)
    assert found.answer == library.TOO_MANY_STEPS
    assert found.touches == 0


def test_energy_held_without_mass_counts_as_given() -> None:
    """A load at the start presses a site without mass against its contact, and then releases it."""
    hit = random_scene(98).run(2e-4, tol=1e-2)
    assert hit.status == 3  # it ends during contact
    assert hit.energy.drift < 1e-4


@pytest.mark.slow
def test_a_start_loads_nothing_for_mails_and_pages():
    """Modules of Python that take a third of the time to load `simulate`; SciPy may load some."""
    program = (
        "import sys, scipy.linalg, scipy.sparse, scipy.spatial\n"
        "before = set(sys.modules)\n"
        "import antiosc as ao; ao.simulate, ao.AntiOscillators\n"
        "loaded = set(sys.modules) - before\n"
        "print(sorted({'html', 'email', 'importlib.metadata'} & loaded))"
    )
    done = subprocess.run(
        [sys.executable, "-c", program], capture_output=True, text=True, check=True
    )
    assert done.stdout.strip() == "[]"


def test_a_scene_of_thousands_of_bodies_is_refused_at_once():
    law = ao.Hertz(1e9)
    names = [f"b{i}" for i in range(1500)]
    chain = [ao.Contact(*pair, law) for pair in zip(names, names[1:])]  # noqa: B905, RUF007
    with pytest.raises(ao.InputError, match="at most 1000 bodies; got 1500"):
        ao.Scene({name: ao.RigidMass(0.1) for name in names}, chain)
