"""What a history says: nodes, motion at any time, numbers, and its own consistency."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import pytest

import antiosc as ao
from antiosc.base import process
from antiosc.engine import march
from antiosc.impact import states
from scenes import HERTZ, case_two


@pytest.fixture(scope="module")
def hit() -> ao.History:
    model, striker = case_two(9)
    return ao.simulate(model, striker, ao.Hertz(HERTZ), 8e-3)


@pytest.mark.parametrize("seconds", [1e3, 1.0, 1e-9])
def test_times_are_found_in_their_steps_in_any_unit(seconds):
    """A node begins its step, also where the time is off by rounding; steps have three nodes."""
    nodes = seconds * np.array([0.0, 0.1, 0.2, 0.5, 0.8, 0.9, 1.0])
    run = SimpleNamespace(time=nodes)
    for time, step, since in ((0.0, 0, 0.0), (0.05, 0, 0.05), (0.2, 1, 0.0), (0.7, 1, 0.5)):
        for off in (1.0, 1 - 1e-15, 1 + 1e-15):
            found = states.steps_at(run, np.array([seconds * time * off]))
            assert found[0] == [step]
            assert found[1] == pytest.approx(since * seconds, abs=1e-14 * seconds)


TIMES = np.linspace(0.0, 2e-3, 57)


def motion(hit: ao.SceneHistory) -> list[np.ndarray]:
    found = []
    for body in (hit.bodies["part"], hit.at(TIMES)["part"], hit.at(TIMES[::-1])["part"]):
        found += [body.q, body.v, body.kinetic, body.strain]
    energy = hit.energy
    return [*found, energy.kinetic, energy.dissipated, energy.gravity]


def test_contacts_that_do_not_fit_are_refused_before_the_work(monkeypatch):
    """The space of a run grows with the contacts."""
    bodies = {f"m{i}": ao.RigidMass(0.01, 1.0) for i in range(60)}
    contacts = [ao.Contact("wall", name, ao.Hertz(1e8)) for name in bodies]
    many = ao.Scene(bodies={"wall": ao.Obstacle(), **bodies}, contacts=contacts)
    monkeypatch.setattr(process, "free_memory", lambda: 1e5)
    monkeypatch.setattr(process, "NEGLIGIBLE_BYTES", 0)
    monkeypatch.setattr(march, "Buffers", lambda *given: pytest.fail("it ran"))
    with pytest.raises(ao.OutOfMemoryError, match=r"60 contacts .* GB are free"):
        many.run(1e-4)


@pytest.mark.parametrize("method", ["exact", "newmark"])
def test_a_massless_site_holds_the_energy_of_its_spring(method):
    """On a spring without mass F²/2k0 is held; what the mass brings is always there in full."""
    k0, mass, speed = 2e6, 0.3, 1.5
    spring = ao.AntiOscillators(m0=0.0, k0=k0, m=[], omega=[])
    hit = ao.simulate(
        spring, ao.RigidMass(mass, speed), ao.Linear(3e6), 2e-3, tol=1e-5, method=method
    )
    np.testing.assert_allclose(hit.energy.strain, hit.force**2 / (2 * k0), rtol=1e-9, atol=1e-9)
    np.testing.assert_allclose(hit.energy.total, mass * speed**2 / 2, rtol=1e-3)
    # two springs in series: F = v √(k m)
    series = 1 / (1 / k0 + 1 / 3e6)
    assert hit.peak_force == pytest.approx(speed * np.sqrt(series * mass), rel=1e-4)


@pytest.mark.parametrize("law", [ao.Hertz(1e8), ao.HuntCrossley(1e8, 0.5)], ids=["hertz", "damped"])
def test_an_impact_of_two_bodies_too(monkeypatch, law):
    def numbers() -> list[np.ndarray]:
        hit = ao.simulate(case_two(6)[0], ao.RigidMass(0.2, 1.0), law, 4e-3)
        energy = hit.energy
        found = [hit.time, hit.displacement, hit.velocity, *hit.states(np.linspace(0, 4e-3, 91))]
        found += [energy.kinetic, energy.strain, energy.gravity, energy.total]
        return [*found, np.array([hit.impulse, hit.contact_time, len(hit.contacts)])]

    wanted = numbers()
    monkeypatch.setattr(march, "MOST_STATE_BYTES", 3000)
    monkeypatch.setattr(states, "STATES_AT_ONCE", 50)
    for one, other in zip(numbers(), wanted, strict=True):
        np.testing.assert_allclose(one, other, rtol=1e-9, atol=1e-11 * np.abs(other).max())


def test_again_is_the_same_impact_with_other_numbers():
    model, striker = case_two(6)
    hit = ao.simulate(model, striker, ao.Hertz(HERTZ), 4e-3, gap=1e-5)
    faster = ao.RigidMass(striker.mass, 2 * striker.velocity)
    other = ao.simulate(model, faster, ao.Hertz(2 * HERTZ), 3e-3, gap=1e-5)
    again = hit.again(velocity=faster.velocity, law=ao.Hertz(2 * HERTZ), duration=3e-3)
    assert again.peak_force == other.peak_force
    assert hit.again(model=model.truncated(3)).model.n == 3
    assert hit.again(step=1e-5).step == 1e-5
