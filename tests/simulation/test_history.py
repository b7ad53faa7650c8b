"""What a history says: nodes, motion at any time, numbers, and its own consistency."""

from __future__ import annotations

from dataclasses import replace
from functools import partial
from types import SimpleNamespace

import numpy as np
import pytest

import antiosc as ao
from antiosc.base import process
from antiosc.engine import march
from antiosc.impact import states, two_bodies
from scenes import HERTZ, case_two, random_model


@pytest.fixture(scope="module")
def hit() -> ao.History:
    model, striker = case_two(9)
    return ao.simulate(model, striker, ao.Hertz(HERTZ), 8e-3)


def test_later_impact_is_another_one():
    """A ball that falls back after a long flight: the main impact is the first."""
    body = ao.AntiOscillators(m0=1e9, k0=0, m=[], omega=[])
    run = ao.simulate(body, ao.Obstacle(), ao.Hertz(1e9), 1e-3, initial_velocity=0.0)
    assert run.contact_time == 0.0
    ground = ao.AntiOscillators(m0=1e9, k0=0.0, m=[], omega=[], participation=[0.0])
    ball = ao.simulate(
        ground, ao.RigidMass(0.1), ao.HuntCrossley(1e9, 0.7), 0.19, gravity=9.81, gap=0.01
    )
    assert len(ball.contacts) >= 3
    start, end = ball.contacts[0]
    assert ball.contact_time == pytest.approx(end - start)


@pytest.mark.parametrize("seconds", [1e3, 1.0, 1e-9])
def test_times_are_found_in_their_steps_in_any_unit(seconds):
    """A node begins its step, also where the time is off by rounding; steps have three nodes."""
    nodes = seconds * np.array([0.0, 0.1, 0.2, 0.5, 0.8, 0.9, 1.0])
    run = SimpleNamespace(time=nodes)
    for time, step, since in ((0.0, 0, 0.0), (0.05, 0, 0.05), (0.2, 1, 0.0), (0.7, 1, 0.5)):
        for off in (1.0, 1 - 1e-15, 1 + 1e-15):
            found = states.locate(run, np.array([seconds * time * off]))
            assert found[0] == [step]
            assert found[1] == pytest.approx(since * seconds, abs=1e-14 * seconds)


def test_a_picture_of_several_contacts_names_them():
    bodies = {
        "a": random_model(np.random.default_rng(0), 3),
        "b": ao.RigidMass(0.1, 2.0),
        "c": ao.RigidMass(0.2),
    }
    contacts = [ao.Contact("a", "b", ao.Hertz(HERTZ)), ao.Contact("b", "c", ao.Hertz(HERTZ), 1e-3)]
    with pytest.raises(ao.InputError, match="several contacts"):
        ao.Scene(bodies, contacts).run(1e-3).plot()


def test_a_step_of_no_length_changes_nothing() -> None:
    """An event may follow another within rounding."""
    one = ao.simulate(*case_two(6), ao.Hertz(HERTZ), 1e-3, tol=1e-2)
    found = one.run
    k = int(np.argmax(found.force[:, 0])) // 2
    at = [2 * k + 1, 2 * k + 1]
    doubled = replace(
        found,
        time=np.insert(found.time, at, found.time[2 * k]),
        force=np.insert(found.force, at, found.force[2 * k], axis=0),
        depth=np.insert(found.depth, at, found.depth[2 * k], axis=0),
        states=np.insert(found.states, k, found.states[k], axis=0),
    )
    other = replace(one, run=doubled)
    assert other.impulse == pytest.approx(one.impulse, rel=1e-12)
    assert other.peak_force == one.peak_force
    times = np.linspace(0, 1e-3, 200)
    np.testing.assert_allclose(other.force_at(times), one.force_at(times), rtol=1e-12)
    assert np.isfinite(other.energy.total).all()


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
    monkeypatch.setattr(march, "STATES", 500)
    monkeypatch.setattr(states, "STATES_AT_ONCE", 50)
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
    monkeypatch.setattr(process, "NEGLIGIBLE", 0)
    monkeypatch.setattr(march, "Buffers", lambda *given: pytest.fail("it ran"))
    with pytest.raises(ao.OutOfMemoryError, match=r"60 contacts .* GB are free"):
        many.run(1e-4)


@pytest.mark.parametrize("run", ["scene", "simulate", "simulate_many"])
def test_an_allocation_that_fails_is_one_sentence(monkeypatch, run):
    def full(*given):
        raise MemoryError("Unable to allocate 7 GiB")

    monkeypatch.setattr(march, "Buffers", full)
    monkeypatch.setattr(two_bodies._Workspace, "reset", full)
    monkeypatch.setattr(march, "_kept", type(march._kept)())
    given = case_two(1)[0], ao.RigidMass(1, 1), ao.Linear(1e6)
    calls = {"scene": scene().run, "simulate": partial(ao.simulate, *given)}
    calls["simulate_many"] = partial(ao.simulate_many, *given)
    with pytest.raises(ao.OutOfMemoryError, match=r"ran out of memory \(Unable"):
        calls[run](1e-3)


def test_coordinates_hold_the_site_first(hit):
    lam = hit.coordinates(hit.time)
    assert lam.shape == (hit.time.size, 10)
    assert lam[:, 0] == pytest.approx(hit.displacement, abs=1e-15)
    assert hit.coordinates(1e-3).shape == (10,)


def test_massless_site_has_its_static_share():
    """With m0 = 0 the site follows k0 l0 + sum k_i (l0 - l_i) = F at every time."""
    rng = np.random.default_rng(0)
    base = random_model(rng, 4)
    model = ao.AntiOscillators(m0=0.0, k0=base.k0, m=base.m, omega=base.omega)
    run = ao.simulate(model, ao.RigidMass(0.1, 1.0), ao.Hertz(1e8), 1e-3)
    lam = run.coordinates(run.time)
    held = model.k0 * lam[:, 0] + np.sum(model.k * (lam[:, :1] - lam[:, 1:]), axis=1)
    assert held == pytest.approx(run.force, abs=1e-9 * run.peak_force)


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
    monkeypatch.setattr(march, "STATES", 3000)
    monkeypatch.setattr(states, "STATES_AT_ONCE", 50)
    for one, other in zip(numbers(), wanted, strict=True):
        np.testing.assert_allclose(one, other, rtol=1e-9, atol=1e-11 * np.abs(other).max())


def test_field_is_the_model_s(hit):
    model, striker = case_two(3)
    shapes = np.random.default_rng(0).standard_normal((5, 4))
    with_shapes = ao.AntiOscillators(model.m0, model.k0, model.m, model.omega, shapes=shapes)
    run = ao.simulate(with_shapes, striker, ao.Hertz(HERTZ), 1e-3)
    assert run.field(5e-4) == pytest.approx(with_shapes.field(run.coordinates(5e-4)))
    assert run.field([1e-4, 5e-4]).shape == (2, 5)
    with pytest.raises(ao.InputError, match="has no shapes"):
        hit.field(1e-3)


def test_again_is_the_same_impact_with_other_numbers():
    model, striker = case_two(6)
    hit = ao.simulate(model, striker, ao.Hertz(HERTZ), 4e-3, gap=1e-5)
    faster = ao.RigidMass(striker.mass, 2 * striker.velocity)
    other = ao.simulate(model, faster, ao.Hertz(2 * HERTZ), 3e-3, gap=1e-5)
    again = hit.again(velocity=faster.velocity, law=ao.Hertz(2 * HERTZ), duration=3e-3)
    assert again.peak_force == other.peak_force
    assert hit.again(model=model.truncated(3)).model.n == 3
    assert hit.again(step=1e-5).step == 1e-5


def test_again_of_a_scene_names_its_bodies():
    bodies = {"m": ao.RigidMass(0.5, 1.0), "w": ao.Obstacle()}
    scene = ao.Scene(bodies, [ao.Contact("w", "m", ao.Hertz(1e9))])
    hit = scene.run(2e-3)
    again = hit.again(velocity={"m": 2.0}, law={("w", "m"): ao.Hertz(4e9)}, duration=1e-3)
    assert again["w", "m"].peak_force == pytest.approx(
        2**1.2 * 4**0.4 * hit["w", "m"].peak_force, rel=5e-3
    )
    with pytest.raises(ao.InputError, match="budget"):
        print(hit.error_budget)
