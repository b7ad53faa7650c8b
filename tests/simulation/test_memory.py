"""Long runs keep few states and find the others; a run that does not fit is refused before it."""

from __future__ import annotations

from functools import partial

import numpy as np
import pytest

import antiosc as ao
from antiosc.base import process
from antiosc.simulation import states, two_bodies
from antiosc.simulation.march import engine
from scenes import case_two

TIMES = np.linspace(0.0, 2e-3, 57)


def scene() -> ao.Scene:
    """A damped part with a load, two masses and gravity."""
    damping = ao.Damping(0.02)
    part = ao.AntiOscillators(m0=0.1, k0=1e6, m=[0.3, 0.2], omega=[2e3, 9e3], damping=damping)
    masses = {"one": ao.RigidMass(0.05, 1.0), "other": ao.RigidMass(0.02, 0.5)}
    contacts = [ao.Contact("part", name, ao.Hertz(1e8)) for name in masses]
    load = ao.Load("part", [0.0, 1e-3, 2e-3], [0.0, 300.0, 0.0])
    return ao.Scene(bodies={"part": part, **masses}, contacts=contacts, gravity=9.81, loads=[load])


def motion(hit: ao.SceneHistory) -> list[np.ndarray]:
    found = []
    for body in (hit.bodies["part"], hit.at(TIMES)["part"], hit.at(TIMES[::-1])["part"]):
        found += [body.q, body.v, body.kinetic, body.strain]
    energy = hit.energy
    return [*found, energy.kinetic, energy.dissipated, energy.gravity]


def test_states_that_are_not_kept_are_found_from_those_that_are(monkeypatch):
    """The motion over steps is exact: only rounding tells them apart."""
    whole = scene().run(2e-3)
    wanted = motion(whole)
    assert whole.run.every == 1
    monkeypatch.setattr(engine, "STATES", 500)
    monkeypatch.setattr(states, "AT_ONCE", 50)
    monkeypatch.setattr(states, "BLOCK", 20)
    thinned = scene().run(2e-3)
    assert thinned.run.every > 4
    assert thinned.run.states.nbytes <= 500
    np.testing.assert_array_equal(thinned.time, whole.time)
    for one, other in zip(motion(thinned), wanted, strict=True):
        np.testing.assert_allclose(one, other, rtol=1e-9, atol=1e-11 * np.abs(other).max())


def test_contacts_that_do_not_fit_are_refused_before_the_work(monkeypatch):
    """The space of a run grows with the square of the contacts."""
    bodies = {f"m{i}": ao.RigidMass(0.01, 1.0) for i in range(60)}
    contacts = [ao.Contact("wall", name, ao.Hertz(1e8)) for name in bodies]
    many = ao.Scene(bodies={"wall": ao.Obstacle(), **bodies}, contacts=contacts)
    monkeypatch.setattr(process, "free_memory", lambda: 1e6)
    monkeypatch.setattr(process, "UNNOTICED", 0)
    monkeypatch.setattr(engine, "Buffers", lambda *given: pytest.fail("it ran"))
    with pytest.raises(ao.OutOfMemoryError, match=r"60 contacts .* GB are free"):
        many.run(1e-4)


@pytest.mark.parametrize("run", ["scene", "simulate", "simulate_many"])
def test_an_allocation_that_fails_is_one_sentence(monkeypatch, run):
    def full(*given):
        raise MemoryError("Unable to allocate 7 GiB")

    monkeypatch.setattr(engine, "Buffers", full)
    monkeypatch.setattr(two_bodies._Space, "renew", full)
    monkeypatch.setattr(engine, "_kept", type(engine._kept)())
    given = case_two(1)[0], ao.RigidMass(1, 1), ao.Linear(1e6)
    calls = {"scene": scene().run, "simulate": partial(ao.simulate, *given)}
    calls["simulate_many"] = partial(ao.simulate_many, *given)
    with pytest.raises(ao.OutOfMemoryError, match=r"ran out of memory \(Unable"):
        calls[run](1e-3)
