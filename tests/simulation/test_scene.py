"""Scenes of several contacts: against closed forms and solve_ivp on the physical system."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.integrate import solve_ivp

import antiosc as ao
from direct import force_error, physical
from scene_cases import CORNERS, LAWS, plate, random_scene, rod_between_walls, stops
from scenes import hertz_impact

Array = NDArray[np.float64]
UP = (0.0, 0.0, 1.0)


@pytest.mark.slow
@pytest.mark.parametrize("tilt", [0.0, 1e-3])
@pytest.mark.parametrize(("k", "n"), [(1e6, 1.0), (1e8, 1.5)])
def test_plate_on_four_corners(tilt: float, k: float, n: float) -> None:
    scene, gaps = plate(ao.Power(k, n), tilt)
    M = np.diag([2.0, 2 * 0.06**2 / 3, 2 * 0.1**2 / 3])
    rows = -np.array([[1, y, -x] for x, y in CORNERS.values()])
    start, load = np.array([-1.0, 0, 0]), np.array([-9.81 * 2, 0, 0])
    t, force = physical(np.zeros((3, 3)), M, rows, gaps, k, n, start, 0.012, load)
    hit = scene.run(0.012)
    assert force_error(hit, t, force) < 1e-3
    assert hit.status == 0
    assert hit.energy.drift < 1e-4


@pytest.mark.slow
def test_chatter_against_nine_stops_converges_with_the_tolerance() -> None:
    scene, K, M, rows, gaps, start = stops()
    t, force = physical(K, M, rows, gaps, 1e9, 1.5, start, 0.006)
    errors = [force_error(scene.run(0.006, tol=tol), t, force) for tol in (1e-2, 1e-3, 1e-4)]
    assert errors[0] < 1e-2
    assert errors[1] < 1e-3
    assert errors[2] < 1e-4


class Doubled(ao.Hertz):
    """A law of one's own."""

    def force(self, delta: float, rate: float, state: tuple[float, ...]) -> float:
        return 2 * super().force(delta, rate, state)

    def tangent(self, delta: float, rate: float, state: tuple[float, ...]) -> tuple[float, float]:
        return 2 * super().tangent(delta, rate, state)[0], 0.0


def test_a_law_of_ones_own() -> None:
    body = ao.RigidMass(0.5, 1.0)
    hit = ao.Scene({"m": body, "w": ao.Obstacle()}, [ao.Contact("w", "m", Doubled(1e9))]).run(3e-3)
    peak, lasts = hertz_impact(0.5, 1.0, 2e9)
    assert hit["w", "m"].peak_force == pytest.approx(peak, rel=1e-3)
    assert hit["w", "m"].contact_time == pytest.approx(lasts, rel=1e-3)


@pytest.mark.slow
def test_ground_that_accelerates_is_a_gravity_that_changes() -> None:
    """A mass on its stop under a ramp of the ground's acceleration, from rest."""
    omega, b = np.array([300.0]), np.array([[1.0]])
    inertia = ao.Inertia(np.zeros(3), np.eye(6), np.array([[0, 0, 1.0, 0, 0, 0]]))
    body = ao.SiteModes(omega, b, ("tip",), directions=[UP], inertia=inertia)
    contact = ao.Contact("tip", "stop", ao.Linear(2e5), gap=2e-5)
    base = ao.Base([0, 0.02, 0.04], [[0, 0, 0], [0, 0, 50.0], [0, 0, 0]])
    scene = ao.Scene({"tip": body, "stop": ao.Obstacle()}, [contact], base=base)

    def slope(t: float, y: Array) -> Array:
        push = -np.interp(t, [0, 0.02, 0.04], [0, 50.0, 0])
        F = 2e5 * max(-y[0] - 2e-5, 0)
        return np.array([y[1], push + F - 300.0**2 * y[0]])

    t = np.linspace(0, 0.04, 2000)
    s = solve_ivp(slope, (0, 0.04), [0, 0], "DOP853", t, rtol=1e-10, atol=1e-14, max_step=1e-4)
    force = 2e5 * np.maximum(-s.y[0] - 2e-5, 0)[:, None]
    assert force.max() > 1
    assert force_error(scene.run(0.04, tol=1e-4), t, force) < 1e-3
    for method in ("newmark", "DOP853"):
        assert force_error(scene.run(0.04, method=method, tol=1e-2), t, force) < 1e-2


Y, Z = (0.0, 1.0, 0.0), (0.0, 0.0, 1.0)
DOWN = (0.0, -1.0, 0.0)
LAW = ao.Hertz(1e9)


def tip(direction: tuple[float, float, float]) -> ao.SiteModes:
    """A supported part whose tip is pushed along a direction."""
    return ao.SiteModes([3e3, 2e4], [[1.5], [1.0]], ["tip"], directions=[direction])


def between(mass: Any, other: tuple[float, float, float], **more: Any) -> ao.Scene:
    """`mass` strikes A's tip, which it pushes along +y, and falls back to B's."""
    bodies = {"A": tip(Y), "B": tip(other), **mass}
    first = "m:up" if isinstance(mass["m"], ao.RigidBody) else "m"
    second = "m:down" if isinstance(mass["m"], ao.RigidBody) else list(mass)[-1]
    contacts = [ao.Contact("A:tip", first, LAW), ao.Contact("B:tip", second, LAW, gap=1e-4)]
    if len(mass) > 1:
        contacts.append(ao.Contact(*mass, LAW, gap=5e-5))
    return ao.Scene(bodies, contacts, **more)


def test_a_mass_between_opposite_sites_moves_as_a_rigid_body_does() -> None:
    sites = {"up": ((0, 0, 0), DOWN), "down": ((0, 0, 0), Y)}
    body = ao.RigidBody(0.1, (1.0, 1.0, 1.0), sites)
    start = {"m": ao.Motion(velocity=(0.0, 1.0, 0.0))}
    expected = between({"m": body}, DOWN, motion=start).run(2e-3)
    hit = between({"m": ao.RigidMass(0.1, 1.0)}, DOWN).run(2e-3)
    for (a, b), (c, d) in (
        (("A:tip", "m"), ("A:tip", "m:up")),
        (("B:tip", "m"), ("B:tip", "m:down")),
    ):
        assert hit[a, b].peak_force > 10
        assert hit[a, b].impulse == pytest.approx(expected[c, d].impulse, rel=1e-6)
    moved = hit.bodies["m"].displacement("", DOWN)
    np.testing.assert_allclose(
        moved, -hit.bodies["m"].displacement(), atol=1e-12 * np.abs(moved).max()
    )
    with pytest.raises(ao.InputError, match="RigidBody"):
        hit.bodies["m"].displacement("", Z)
    assert hit.energy.drift < 1e-4


#: Steps that are tried at most: about five seconds.
ATTEMPTS = 2_000_000


@pytest.mark.slow
@pytest.mark.filterwarnings("ignore::antiosc.AccuracyWarning")
def test_random_scenes_end_with_their_energy() -> None:
    completed, seeds = 0, [104, *range(900, 1000)]
    for seed in seeds:
        hit = random_scene(seed).run(5e-3)
        energy = hit.energy
        assert hit.run.attempts <= ATTEMPTS, seed
        assert np.isfinite(hit.run.force).all(), seed
        if hit.status in (0, 3):
            completed += 1
            highest = np.max(energy.kinetic + energy.strain + energy.contact)
            assert np.max(energy.total - energy.total[0]) <= 1e-3 * highest, seed
    assert completed >= 0.98 * len(seeds)


def test_plate_that_lands_flat_is_one_mass_on_four_springs() -> None:
    scene, _ = plate(ao.Hertz(1e8), 0.0)
    peak, lasts = hertz_impact(2.0, 1.0, 4e8)
    hit = ao.Scene(scene.bodies, scene.contacts, motion=scene.motion).run(0.012)
    each = hit["plate:a", "floor"]
    assert 4 * each.peak_force == pytest.approx(peak, rel=1e-4)
    assert each.contact_time == pytest.approx(lasts, rel=1e-5)
    momentum = hit.bodies["plate"].momentum[-1]
    np.testing.assert_allclose(momentum, [0, 0, 2.0], atol=1e-4)


@pytest.mark.slow
@pytest.mark.sample(-1)
@pytest.mark.parametrize("n", [1.0, 1.5])
def test_rod_bounces_between_walls(n: float) -> None:
    scene, K, M = rod_between_walls(n)
    k = 1e8 if n == 1 else 1e10
    rows = np.zeros((2, 12))
    rows[0, 0], rows[1, 11] = -1, 1
    inverse = np.linalg.inv(M)
    gaps = np.array([1e-4, 2e-4])

    def force(u: Array) -> Array:
        return k * np.maximum(rows @ u - gaps, 0.0) ** n

    def slope(t: float, y: Array) -> Array:
        push = np.interp(t, [0, 1e-4, 2e-4], [0, -3e4, 0]) * np.ones(12) / 12
        return np.concatenate((y[12:], inverse @ (push - K @ y[:12] - rows.T @ force(y[:12]))))

    t = np.linspace(0, 1e-3, 3000)
    s = solve_ivp(slope, (0, 1e-3), np.zeros(24), "DOP853", t, rtol=1e-9, atol=1e-12, max_step=4e-6)
    hit = scene.run(1e-3)
    assert hit.run.touches >= 2
    assert force_error(hit, t, np.array([force(u) for u in s.y[:12].T])) < 1e-3
    assert hit.energy.drift < 1e-4


@pytest.mark.parametrize("law", LAWS, ids=lambda law: type(law).__name__)
def test_every_law_gives_what_simulate_gives(law: ao.ContactLaw) -> None:
    """`simulate` marches with another scheme and the laws' own methods."""
    model = ao.AntiOscillators(m0=0.05, k0=1e5, m=[0.1, 0.05], omega=[2e3, 9e3])
    mass = ao.RigidMass(0.3, 2.0)
    one = ao.simulate(model, mass, law, 2e-3, tol=1e-4)
    hit = ao.Scene({"a": model, "b": mass}, [ao.Contact("a", "b", law)]).run(2e-3, tol=1e-4)
    assert hit["a", "b"].impulse == pytest.approx(one.impulse, rel=1e-4)
    assert hit["a", "b"].peak_force == pytest.approx(one.peak_force, rel=1e-3)
    assert hit.energy.drift < 1e-3


def test_residual_compliance_is_a_spring_in_series() -> None:
    """A mass on a site without inertia: half a sine with 1/k = 1/k_contact + r."""
    site = ao.SiteModes([1e3], [[0.0]], ("tip",), r=[[2e-6]])
    bodies = {"site": site, "m": ao.RigidMass(0.5, 2.0)}
    hit = ao.Scene(bodies, [ao.Contact("site:tip", "m", ao.Linear(1e6))]).run(0.01, tol=1e-4)
    k = 1 / (1e-6 + 2e-6)
    contact = hit["site:tip", "m"]
    assert contact.peak_force == pytest.approx(2.0 * np.sqrt(0.5 * k), rel=1e-5)
    assert contact.contact_time == pytest.approx(np.pi * np.sqrt(0.5 / k), rel=1e-5)
    pressed = 2e-6 * contact.force  # along the push
    np.testing.assert_allclose(hit.bodies["site"].displacement("tip"), pressed, atol=1e-12)
    assert hit.energy.drift < 1e-4


def test_flight_under_gravity_and_spin() -> None:
    box = ao.RigidBody(2.0, (1e-2, 2e-2, 3e-2), {"foot": ((0.1, 0, -0.05), UP)})
    contact = ao.Contact("box:foot", "floor", ao.Linear(1e5), gap=1.0)
    start = ao.Motion(velocity=(1.0, 0, 2.0), spin=(0, 0.5, 0.0))
    scene = ao.Scene(
        {"box": box, "floor": ao.Obstacle()},
        [contact],
        gravity=(0, 0, -9.81),
        motion={"box": start},
    )
    hit = scene.run(0.1)
    t = hit.time
    u = hit.bodies["box"].displacement("foot")
    np.testing.assert_allclose(u, (2.0 - 0.5 * 0.1) * t - 9.81 / 2 * t**2, atol=1e-12)
    assert hit["box:foot", "floor"].contacts == []


def test_preload_rests_until_something_moves() -> None:
    scene, _ = plate(ao.Hertz(1e8), 0.0)
    rest = ao.Scene(scene.bodies, scene.contacts, gravity=scene.gravity, preload=True)
    hit = rest.run(0.01)
    force = hit["plate:a", "floor"].force
    np.testing.assert_allclose(force, 2.0 * 9.81 / 4, rtol=1e-8)
    assert hit["plate:a", "floor"].contacts == [(0.0, 0.01)]
