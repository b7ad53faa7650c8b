"""A batch that the march solves in one call is what `simulate` gives, to the last bit."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

import antiosc as ao
from antiosc.impact import batch as batches, two_bodies
from laws import LAWS
from scenes import random_model

NUMBERS = ("peak_force", "impulse", "contact_time", "restitution", "step")


def drawn(rng: np.random.Generator, law: ao.ContactLaw) -> tuple:
    """A model, an impactor, a law, a duration, and the other arguments of `simulate`."""
    model = random_model(rng, int(rng.integers(0, 8)), supported=bool(rng.integers(2)))
    if rng.random() < 0.3:
        model = ao.AntiOscillators(
            m0=0.0,
            k0=model.k0,
            m=np.append(model.m, 0.2),
            omega=np.append(model.omega, 3e4),
            damping=ao.Damping(0.02),
            local_compliance=1e-10,
            radius=1e-2,
        )
    mass = float(10 ** rng.uniform(-2, 0.5))
    speed = float(10 ** rng.uniform(-2, 0.7) * rng.choice([1, 1, 1, 1, 1, -1]))
    own = {"m0": mass, "k0": 0.0, "m": [0.1], "omega": [2e4], "participation": [mass, 0.1]}
    other = ao.AntiOscillators(**own)
    kinds = (
        ao.RigidMass(mass, speed),
        ao.Sphere(0.01, 2e11, 0.3, mass=mass, velocity=speed),
        ao.Impactor(other, speed),
    )
    options = {"gap": float(rng.choice([0.0, 1e-5])), "gravity": 0.0, "initial_velocity": 0.0}
    if model.participation is not None:
        options["gravity"] = float(rng.choice([0.0, 9.81]))
    return model, kinds[rng.integers(3)], law, float(10 ** rng.uniform(-3.5, -2)), options


def alone(model, impactor, law, duration, options, **limits) -> tuple[ao.History | None, str]:
    """What `simulate` gives, and its message; none where it raises an error."""
    try:
        hit = ao.simulate(model, impactor, law, duration, **options, **limits)
    except ao.AntioscError as error:
        return None, str(error)
    return hit, hit.message


@pytest.mark.filterwarnings("ignore::antiosc.AntioscWarning")
def test_a_batch_is_what_simulate_gives_to_the_last_bit(rng, monkeypatch):
    """All laws, struck by each kind of impactor, and limits that some runs reach."""
    scenes = [drawn(rng, law) for law in LAWS.values() for _ in range(2)]
    falling = {"gap": 0.0, "gravity": -9.81, "initial_velocity": 1.3}
    body = replace(random_model(rng, 8, supported=False), damping=ao.Damping(0.02, alpha=1.0))
    scenes.append((body, ao.Obstacle(), ao.Hertz(1e8), 8e-3, falling))
    limits = {"max_contacts": 2, "max_steps": 700}
    apart = []
    monkeypatch.setattr(
        batches,
        "_solve_single",
        lambda *given, real=batches._solve_single: apart.append(0) or real(*given),
    )
    models, strikers, laws, durations, options = zip(*scenes, strict=True)
    columns = {name: [each[name] for each in options] for name in falling}
    rows = map(list, (models, strikers, laws, durations))
    many = ao.simulate_many(*rows, **columns, **limits)
    assert len(apart) < 3
    for i, scene in enumerate(scenes):
        hit, message = alone(*scene, **limits)
        assert message.startswith(many.messages.get(i, "Completed."))
        if hit is None:
            assert many.facts["status"][i] == 2
            continue
        assert (many.facts["status"][i], many.contacts[i]) == (hit.status, len(hit.contacts))
        for name in NUMBERS:
            expected = getattr(hit, name)
            found = getattr(many, name)[i]
            assert found == expected or (np.isnan(found) and expected is None), name
        assert many.error[i] == hit.error["force"]
        time, force = hit.contact_histories[0].pulses()
        assert np.array_equal(many.force[i][0], time)
        assert np.array_equal(many.force[i][1], force)
    assert len(set(many.facts["status"].tolist())) > 2
    assert any("touched" in message for message in many.messages.values())


def test_a_long_batch_can_be_interrupted(monkeypatch):
    """The library returns after few of the scenes, which chatter for long."""
    model = ao.AntiOscillators(m0=1e-2, k0=1e4, m=[1.0] * 4, omega=[300.0, 500.0, 900.0, 1e3])
    strikers = [ao.RigidMass(10.0, 1.0 + 1e-6 * i) for i in range(2000)]
    counts = []

    def returned(_space, solved) -> list:
        counts.append(len(solved))
        if len(counts) == 3:
            raise KeyboardInterrupt
        return [()] * len(solved)

    monkeypatch.setattr(two_bodies._Workspace, "read_pulses", returned)
    with pytest.raises(KeyboardInterrupt):
        ao.simulate_many(model, strikers, ao.Hertz(1e11), 0.05, tol=1e-6)
    assert sum(counts) < 0.1 * len(strikers)
