"""Many impacts at once give what each gives alone."""

from __future__ import annotations

import os
from concurrent.futures import ProcessPoolExecutor, ThreadPoolExecutor

import numpy as np
import pytest

import antiosc as ao
from antiosc.models.body import ModelInfo
from scenes import case_two


def peak_of(mass: float, velocity: float) -> float:
    """A scene of one's own, which a process imports by its name; it fails for a mass below 0."""
    return ao.simulate(case_two(2)[0], ao.RigidMass(mass, velocity), ao.Hertz(1e9), 1e-3).peak_force


def test_the_patch_that_a_batch_asks_for_is_that_of_its_hardest_blow():
    """Of the scenes beyond the range of their law the one that needs the largest patch is told."""
    model = ao.AntiOscillators(0.1, 1e7, [], [], local_compliance=2e-8, radius=1e-3)
    balls = [ao.RigidMass(1.0, v) for v in (1e-3, 10.0, 30.0, 20.0)]
    with pytest.warns(ao.AccuracyWarning, match="3 of 4 scenes .1, 2, 3., as scene 2: the patch"):
        batch = ao.simulate_many(model, balls, ao.Hertz(1e9), 1e-2)
    radii = [float(m.rpartition("at least ")[2].split()[0]) for m in batch.message[1:]]
    assert radii[1] == max(radii)
    with pytest.raises(ao.AccuracyError, match="scene 1: the patch radius"):
        ao.simulate_many(model, balls[1:], ao.Hertz(1e9), 1e-2)


def test_a_batch_of_several_places_names_them():
    """The place of the one site that needs the largest patch comes first."""
    given = {"m0": 0.1, "k0": 1e7, "m": [], "omega": [], "local_compliance": 2e-8, "radius": 1e-3}
    infos = [ModelInfo(point=[1e-3 * i, 0.0, 0.02]) for i in range(3)]
    models = [ao.AntiOscillators(**given, info=info) for info in infos]
    balls = [ao.RigidMass(1.0, v) for v in (1e-3, 10.0, 30.0)]
    words = r"at 2 of 3 sites \(worst at \(2, 0, 20\) mm, others at \(1, 0, 20\) mm\): the patch"
    with pytest.warns(ao.AccuracyWarning, match=words):
        ao.simulate_many(models, balls, ao.Hertz(1e9), 1e-2)
    models[2] = models[0]  # one place is struck twice: numbers tell the scenes apart
    with pytest.warns(ao.AccuracyWarning, match="2 of 3 scenes .1, 2., as scene 2: the patch"):
        ao.simulate_many(models, balls, ao.Hertz(1e9), 1e-2)


@pytest.mark.parametrize("pool", [ThreadPoolExecutor, ProcessPoolExecutor])
def test_executors_keep_the_order_and_tell_a_scene_that_fails(pool):
    model = ao.AntiOscillators(0.1, 1e7, [], [], local_compliance=2e-8, radius=1e-3)
    speeds = [0.1, 30.0, 0.2, 0.05]  # the second leaves the range of its law
    balls = [ao.RigidMass(1.0 if v > 1 else 0.01, v) for v in speeds]
    with pytest.warns(ao.AccuracyWarning, match="1 of 4 scenes .1., as scene 1: the patch radius"):
        here = ao.simulate_many(model, balls, ao.Hertz(1e9), 1e-2)
    with pool(2) as executor:
        with pytest.warns(ao.AccuracyWarning, match="1 of 4 scenes .1., as scene 1"):
            there = ao.simulate_many(model, balls, ao.Hertz(1e9), 1e-2, executor=executor)
        with pytest.warns(ao.AccuracyWarning, match="1 of 3 calls failed, as call 1: mass must be"):
            peaks = ao.sweep(peak_of, mass=[0.1, -0.1, 0.2], velocity=0.01, executor=executor)
    for name in ("peak_force", "impulse", "contact_time", "restitution", "error", "status"):
        # a new process begins interpreted, whose rounding differs
        np.testing.assert_allclose(getattr(here, name), getattr(there, name), rtol=1e-6)
    assert here.message == there.message
    assert np.isnan(here.peak_force).tolist() == [False, True, False, False]
    assert isinstance(peaks[1], ao.InputError)
    assert peaks[0] == pytest.approx(peak_of(0.1, 0.01), rel=1e-6)
    assert peaks[2] == pytest.approx(peak_of(0.2, 0.01), rel=1e-6)


class Deadly(ao.Linear):
    """A law that ends another process as soon as it gets there."""

    def __reduce__(self):
        return revived, (os.getpid(), self.stiffness)


def revived(parent: int, stiffness: float) -> ao.Linear:
    if os.getpid() != parent:
        os._exit(1)
    return ao.Linear(stiffness)


class Unpicklable(ao.Linear):
    def __reduce__(self):
        raise TypeError("it holds a file")


def closed_pool() -> ThreadPoolExecutor:
    pool = ThreadPoolExecutor(1)
    pool.shutdown()
    return pool


@pytest.mark.parametrize(
    ("law", "says"), [(Deadly, "BrokenProcess"), (Unpicklable, "holds a file")]
)
def test_scenes_that_an_executor_loses_cost_no_other_and_can_be_made_up_for(law, says):
    """With `earlier` only the scenes without a result are integrated."""
    laws = [ao.Linear(2e6), ao.Linear(3e6), law(1e6)]
    given = case_two(3)[0], ao.RigidMass(0.1, 1.0)
    with ProcessPoolExecutor(1) as pool, pytest.warns(ao.AccuracyWarning, match=says):
        first = ao.simulate_many(*given, laws, 1e-3, executor=pool)
    assert first.status.tolist() == [0, 0, 2]
    assert np.isnan(first.peak_force).tolist() == [False, False, True]
    whole = ao.simulate_many(*given, laws, 1e-3, earlier=first)
    assert (whole.peak_force[:2] == first.peak_force[:2]).all()
    alone = ao.simulate_many(*given, ao.Linear(1e6), 1e-3).peak_force
    assert whole.peak_force[2] == pytest.approx(alone[0], rel=1e-9)
    with pytest.raises(ao.InputError, match="one entry for each of 2"):
        ao.simulate_many(*given, laws[:2], 1e-3, earlier=first)


def test_a_sweep_keeps_what_an_executor_has_made():
    with pytest.warns(ao.AccuracyWarning, match="2 of 2 calls failed.*shutdown"):
        lost = ao.sweep(ao.RigidMass, mass=[1.0, 2.0], velocity=1.0, executor=closed_pool())
    assert all(isinstance(each, ao.AntioscError) for each in lost)
    masses = ao.sweep(ao.RigidMass, mass=[1.0, 2.0], velocity=1.0, earlier=lost)
    again = ao.sweep(ao.RigidMass, mass=[1.0, 2.0], velocity=1.0, earlier=[masses[0], lost[1]])
    assert again[0] is masses[0]
    assert again[1].mass == 2.0
    with pytest.raises(ao.AntioscError, match="shutdown"):
        ao.simulate_many(case_two(2)[0], masses, ao.Hertz(1e9), 1e-3, executor=closed_pool())
