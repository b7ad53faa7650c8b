"""Runs of the march share what depends on the bodies alone, and nothing else."""

from __future__ import annotations

import sys
from collections import OrderedDict
from concurrent.futures import ThreadPoolExecutor

import numpy as np
import pytest

import antiosc as ao
from antiosc.simulation import compilation, engine, march
from antiosc.simulation.assembly import assemble
from antiosc.simulation.march import pressing
from antiosc.simulation.scene_energy import _work_by_step, gained
from scenes import HERTZ, case_two

LAW = ao.Hertz(HERTZ)
MODEL = case_two(6)[0]


def blow(speed: float, law: ao.ContactLaw = LAW, mass: float = 0.24) -> ao.Scene:
    bodies = {"beam": MODEL, "mass": ao.RigidMass(mass, speed)}
    return ao.Scene(bodies, [ao.Contact("beam", "mass", law)])


SCENES = [
    blow(0.01),
    blow(0.5),
    blow(0.5, ao.HuntCrossley(1e10, 0.5)),
    blow(0.5, ao.Linear(1e7)),
    blow(0.01, mass=0.5),
]


@pytest.fixture(autouse=True)
def interpreted(monkeypatch) -> None:
    """One march for all: the compiled one rounds otherwise."""
    monkeypatch.setitem(sys.modules, compilation._COMPILED, None)


def forces(scene: ao.Scene, duration: float = 1e-3) -> np.ndarray:
    return scene.run(duration, tol=1e-2)["beam", "mass"].force


def test_runs_that_share_responses_give_the_numbers_of_runs_that_do_not(monkeypatch) -> None:
    monkeypatch.setattr(engine, "_kept", OrderedDict())
    shared = [forces(scene) for _ in range(2) for scene in SCENES]
    kept = len(engine._kept)
    monkeypatch.setattr(engine, "_LARGEST_KEPT", 0)
    engine._kept.clear()
    alone = [forces(scene) for scene in SCENES] * 2
    assert not engine._kept
    assert kept == 3  # two masses; a law that depends on the rate has its own
    for one, other in zip(shared, alone, strict=True):
        np.testing.assert_array_equal(one, other)


def test_another_duration_has_other_steps() -> None:
    first = forces(SCENES[1], 1e-3)
    longer = SCENES[1].run(2.5e-3, tol=1e-2)["beam", "mass"]
    assert longer.peak_force == pytest.approx(float(first.max()), rel=0.02)


def test_threads_do_not_share_responses_while_they_fill_them() -> None:
    engine._kept.clear()
    alone = [forces(scene) for scene in SCENES]
    engine._kept.clear()
    with ThreadPoolExecutor(4) as pool:
        together = list(pool.map(forces, SCENES * 4))
    for i, found in enumerate(together):
        np.testing.assert_array_equal(found, alone[i % len(SCENES)])


def test_memory_of_other_masses_serves_and_its_responses_do_not(monkeypatch) -> None:
    monkeypatch.setattr(engine, "_kept", OrderedDict())
    monkeypatch.setattr(engine, "_MOST_KEPT", 1)
    alone = forces(blow(0.3, mass=0.5))
    engine._kept.clear()
    forces(blow(0.3, mass=0.2))
    (space,) = engine._kept.values()
    np.testing.assert_array_equal(forces(blow(0.3, mass=0.5)), alone)
    assert list(engine._kept.values()) == [space]


def test_few_responses_are_kept(monkeypatch) -> None:
    monkeypatch.setattr(engine, "_kept", OrderedDict())
    for mass in np.linspace(0.1, 1, 2 * engine._MOST_KEPT):
        forces(blow(0.1, mass=float(mass)), 1e-4)
    assert len(engine._kept) == engine._MOST_KEPT


@pytest.mark.parametrize("gravity", [0.0, 1e-9])
def test_a_gain_is_that_of_the_whole_balance(gravity: float) -> None:
    """With and without loads; energy is put into the bodies in the midst of the contact."""
    bodies = {"beam": MODEL, "mass": ao.RigidMass(0.24, 0.5)}
    contacts = [ao.Contact("beam", "mass", LAW)]
    scene = ao.Scene(bodies, contacts, gravity=gravity)
    hit = scene.run(1e-3, tol=1e-3)
    made = assemble(scene, 1e-3)
    assert hit.run.states is not None
    assert gained(made, hit.run) < 1e-4
    hit.run.states[len(hit.run.states) // 2 :, 1] *= 1.01
    assert gained(made, hit.run) == pytest.approx(0.02, abs=0.015)


def test_the_work_of_loads_over_steps_is_that_of_the_whole_balance() -> None:
    """A held beam and a mass that is pushed in time, in flight and in contact."""
    bodies = {"beam": MODEL, "mass": ao.RigidMass(0.24, 0.5)}
    pulse = ao.Load("mass", [0.0, 3e-4, 5e-4, 9e-4], [0.0, 400.0, -300.0, 0.0])
    push = ao.Load("beam", [0.0, 4e-4, 8e-4], [50.0, 0.0, 80.0])
    scene = ao.Scene(bodies, [ao.Contact("beam", "mass", LAW, gap=2e-5)], loads=[pulse, push])
    hit = scene.run(1e-3, tol=1e-3)
    mechanical = np.empty(len(hit.run.states))
    march.energies(hit.run.states, hit.assembly.system.omega, mechanical)
    q, v = hit.run.states[:, 0], hit.run.states[:, 1]
    work = np.cumsum(_work_by_step(hit.assembly, hit.run, q, v, mechanical))
    known = hit.energy.gravity[2::2]
    assert np.abs(known).max() > 0.02
    np.testing.assert_allclose(work, known, rtol=0, atol=1e-7)
    assert gained(hit.assembly, hit.run) < 1e-4


@pytest.mark.parametrize(
    "law",
    [
        LAW,
        ao.Linear(1e7),
        ao.Power(1e9, 2.2),
        ao.Gonthier(1e10, 0.4),
        ao.Hertz(1e10, 1e-9),
        ao.Thornton(1e10, 1e-6),
    ],
    ids=lambda law: type(law).__name__,
)
def test_one_contact_has_the_forces_that_sweeps_find(monkeypatch, law: ao.ContactLaw) -> None:
    scene = blow(0.1, law)
    made = assemble(scene, 5e-4)
    one = engine.run(made.system, 5e-4, 1e-2, fine=made.lasting / 200)
    monkeypatch.setattr(pressing, "alone", lambda *_: False)
    other = engine.run(made.system, 5e-4, 1e-2, fine=made.lasting / 200)
    assert one.steps == other.steps
    atol = 1e-9 * float(other.force.max())
    assert atol > 0
    np.testing.assert_allclose(one.force, other.force, rtol=0, atol=atol)


def test_a_run_without_states_goes_through_several_buffers(monkeypatch: pytest.MonkeyPatch) -> None:
    made = assemble(blow(0.5), 4e-3)

    def forces(first: int, keep: bool) -> np.ndarray:
        monkeypatch.setattr(engine, "_FIRST", first)
        engine._kept.clear()
        found = engine.run(made.system, 4e-3, 1e-3, fine=made.lasting / 200, keep=keep)
        assert (found.states is not None) == keep
        return found.force

    np.testing.assert_array_equal(forces(16, keep=False), forces(4096, keep=True))
