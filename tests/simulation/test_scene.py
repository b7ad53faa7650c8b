"""Scenes of several contacts: against closed forms and solve_ivp on the physical system."""

from __future__ import annotations

import pickle
import signal
import sys
import warnings
from importlib.machinery import ModuleSpec

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.integrate import solve_ivp
from scipy.optimize import brentq

import antiosc as ao
from antiosc.simulation import compilation, convergence, march
from antiosc.simulation.assembly import assemble
from antiosc.simulation.compilation import compiled_march
from antiosc.simulation.engine import run
from antiosc.simulation.march import forces as solver
from antiosc.simulation.refinement import start
from antiosc.simulation.scene_states import forces, located
from direct import chain, force_error, free_modes, physical
from scenes import HERTZ, case_two, hertz_impact

Array = NDArray[np.float64]
UP = (0.0, 0.0, 1.0)


CORNERS = {"a": (0.1, 0.06), "b": (0.1, -0.06), "c": (-0.1, 0.06), "d": (-0.1, -0.06)}


def plate(law: ao.ContactLaw, tilt: float) -> tuple[ao.Scene, Array]:
    """A rigid plate that falls on springs at its corners, flat or tilted, and its gaps."""
    sites = {name: ((x, y, 0.0), UP) for name, (x, y) in CORNERS.items()}
    gaps = np.array([tilt * (x + 0.3 * y) for x, y in CORNERS.values()])
    gaps -= gaps.min()
    body = ao.RigidBody(2.0, (2 * 0.06**2 / 3, 2 * 0.1**2 / 3, 1.0), sites)
    contacts = [
        ao.Contact(f"plate:{c}", "floor", law, gap=float(g))
        for c, g in zip(CORNERS, gaps, strict=True)
    ]
    motion = {"plate": ao.Motion(velocity=(0, 0, -1.0))}
    bodies = {"plate": body, "floor": ao.Obstacle()}
    return ao.Scene(bodies, contacts, gravity=(0, 0, -9.81), motion=motion), gaps


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


def test_plate_that_lands_flat_is_one_mass_on_four_springs() -> None:
    scene, _ = plate(ao.Hertz(1e8), 0.0)
    peak, lasts = hertz_impact(2.0, 1.0, 4e8)
    hit = ao.Scene(scene.bodies, scene.contacts, motion=scene.motion).run(0.012)
    each = hit["plate:a", "floor"]
    assert 4 * each.peak_force == pytest.approx(peak, rel=1e-4)
    assert each.contact_time == pytest.approx(lasts, rel=1e-5)
    momentum = hit.bodies["plate"].momentum[-1]
    np.testing.assert_allclose(momentum, [0, 0, 2.0], atol=1e-4)


def rod_between_walls(n: float) -> tuple[ao.Scene, Array, Array]:
    k = 11 / 12 * 11 * 5000.0**2 / 11
    masses = np.full(12, 1 / 11)
    masses[[0, -1]] /= 2
    K, M = chain(12, k, masses, held=False)
    B = np.eye(12)[:, [0, 11]]
    omega, b = free_modes(K, M, B)
    # the middle of the rod is pushed for a moment, so that it flies to the left wall
    b = np.column_stack((b, free_modes(K, M, np.ones((12, 1)) / 12)[1]))
    rod = ao.SiteModes(omega, b, ("left", "right", "all"))
    law = ao.Power(1e8 if n == 1 else 1e10, n)
    contacts = [
        ao.Contact("rod:left", "wall", law, gap=1e-4),
        ao.Contact("other", "rod:right", law, gap=2e-4),
    ]
    load = ao.Load("rod:all", [0, 1e-4, 2e-4], [0, -3e4, 0])
    bodies = {"rod": rod, "wall": ao.Obstacle(), "other": ao.Obstacle()}
    return ao.Scene(bodies, contacts, loads=[load]), K, M


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


def stops() -> tuple[ao.Scene, Array, Array, Array, Array, Array]:
    """A chain with nine stops that a hammer strikes at its tenth site; the physical system."""
    rng = np.random.default_rng(1)
    K, M = chain(20, 1e6, rng.uniform(0.05, 0.2, 20), held=True)
    omega, b = free_modes(K, M, np.eye(20)[:, ::2])
    gaps = np.append(rng.uniform(1e-5, 3e-4, 10)[:9], 0.0)
    law = ao.Hertz(1e9)
    names = [f"s{i}" for i in range(10)]
    contacts = [
        ao.Contact("ground", f"chain:{s}", law, gap=float(g))
        for s, g in zip(names[:9], gaps[:9], strict=True)
    ]
    contacts.append(ao.Contact("chain:s9", "hammer", law))
    bodies = {
        "chain": ao.SiteModes(omega, b, names),
        "ground": ao.Obstacle(),
        "hammer": ao.RigidMass(1.0, 3.0),
    }
    whole_K, whole_M, rows = np.zeros((21, 21)), np.eye(21), np.zeros((10, 21))
    whole_K[:20, :20], whole_M[:20, :20] = K, M
    for i in range(9):
        rows[i, 2 * i] = 1
    rows[9, 18], rows[9, 20] = -1, 1
    start = np.zeros(21)
    start[20] = 3.0
    return ao.Scene(bodies, contacts), whole_K, whole_M, rows, gaps, start


@pytest.mark.slow
def test_chatter_against_nine_stops_converges_with_the_tolerance() -> None:
    scene, K, M, rows, gaps, start = stops()
    t, force = physical(K, M, rows, gaps, 1e9, 1.5, start, 0.006)
    errors = [force_error(scene.run(0.006, tol=tol), t, force) for tol in (1e-2, 1e-3, 1e-4)]
    assert errors[0] < 1e-2
    assert errors[1] < 1e-3
    assert errors[2] < 1e-4


def test_two_contacts_at_one_site_are_one_site_with_two_rows() -> None:
    omega, b = np.array([500.0]), np.array([[2.0]])
    body = ao.SiteModes(omega, b, ("tip",))
    contacts = [
        ao.Contact("right", "tip", ao.Linear(1e6), gap=1e-4),
        ao.Contact("tip", "left", ao.Linear(1e6), gap=1e-4),
    ]
    loads = [ao.Load("tip", [0, 2e-3, 4e-3], [100, 100, -100])]
    bodies = {"tip": body, "right": ao.Obstacle(), "left": ao.Obstacle()}
    hit = ao.Scene(bodies, contacts, loads=loads).run(1e-2)

    def slope(t: float, y: Array) -> Array:
        u = 2.0 * y[0]
        F = 1e6 * max(u - 1e-4, 0) - 1e6 * max(-u - 1e-4, 0)
        push = np.interp(t, [0, 2e-3, 4e-3], [100, 100, -100])
        return np.array([y[1], 2 * (push - F) - 500.0**2 * y[0]])

    t = np.linspace(0, 1e-2, 2000)
    s = solve_ivp(slope, (0, 1e-2), [0, 0], "DOP853", t, rtol=1e-9, atol=1e-14, max_step=1e-5)
    u = 2.0 * s.y[0]
    force = 1e6 * np.maximum(np.column_stack((u, -u)) - 1e-4, 0)
    assert hit["right", "tip"].peak_force > 0
    assert hit["tip", "left"].peak_force > 0
    assert force_error(hit, t, force) < 1e-3


def test_a_scene_of_one_contact_is_simulate() -> None:
    model, mass = case_two(9)
    law = ao.Hertz(HERTZ)
    one = ao.simulate(model, mass, law, 4e-3, tol=1e-5)
    hit = ao.Scene({"beam": model, "mass": mass}, [ao.Contact("beam", "mass", law)]).run(
        4e-3, tol=1e-4
    )
    contact = hit["beam", "mass"]
    assert contact.peak_force == pytest.approx(one.peak_force, rel=1e-4)
    assert contact.impulse == pytest.approx(one.impulse, rel=1e-5)
    np.testing.assert_allclose(contact.contacts, one.contacts, atol=1e-7)
    end = hit.bodies["mass"].velocity()[-1]
    assert end == pytest.approx(one.impactor_velocity[-1], rel=1e-5)


LAWS = [
    ao.Linear(1e7),
    ao.Hertz(1e10),
    ao.Hertz(1e10, 2e-9),
    ao.Power(1e9, 2.0),
    ao.HuntCrossley(1e10, 0.7),
    ao.Flores(1e10, 0.3),
    ao.Gonthier(1e7, 0.5, exponent=1.0),
    ao.Thornton(1e10, 1e-5),
    ao.Stronge(1e10, 2e-6),
    ao.YangSun(1e10, 1e-6),
    ao.TanSun(1e10, 1e-6, 0.4),
    ao.Tabulated(
        np.linspace(0, 1e-3, 9),
        1e8 * np.linspace(0, 1e-3, 9) ** 1.3,
        (np.linspace(3e-4, 1e-3, 9), 1e8 * 1e-3**1.3 * np.linspace(0, 1, 9) ** 1.6),
    ),
    ao.Tabulated(np.linspace(0, 1e-3, 9), 1e8 * np.linspace(0, 1e-3, 9) ** 1.3),
]


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


def test_sweeps_and_newtons_method_give_the_same_forces(monkeypatch) -> None:
    """Four contacts that are coupled through a compliance without inertia, as stiff as they are."""
    coupling = 1e-7 * (np.eye(4) + 0.5)
    b = [[1, 0.5, -0.3, 0.2], [0.2, 1, 0.6, -1]]
    body = ao.SiteModes([2e3, 5e3], b, list("abcd"), r=coupling)
    masses = {f"m{i}": ao.RigidMass(0.2, 1.0 + 0.2 * i) for i in range(4)}
    laws = [ao.Hertz(1e9), ao.Linear(1e7), ao.Power(1e8, 1.3), ao.Thornton(1e9, 1e-5)]
    ends = [(f"b:{s}", f"m{i}") for i, s in enumerate("abcd")]
    contacts = [ao.Contact(*pair, law) for pair, law in zip(ends, laws, strict=True)]
    made = assemble(ao.Scene({"b": body, **masses}, contacts), 5e-4)
    runs = []
    for sweeps in (solver.SWEEPS, 0):
        monkeypatch.setattr(solver, "SWEEPS", sweeps)
        runs.append(run(made.system, 5e-4, 1e-3, module=march, fine=1e-8))
    a, b = runs
    assert a.time.size == b.time.size
    np.testing.assert_allclose(a.force, b.force, atol=1e-10 * a.force.max())


# -- whole bodies


def test_two_free_bodies_keep_momentum_and_angular_momentum() -> None:
    """A tumbling box strikes another off its centre; friction included."""
    one = ao.RigidBody(0.4, (1e-4, 2e-4, 3e-4), {"c": ((0.03, 0.01, 0), (-1, 0, 0))})
    two = ao.RigidBody(
        0.7, (3e-4, 2e-4, 4e-4), {"c": ((0.03, 0.01, 0), (1, 0, 0))}, centre=(0.06, 0, 0.005)
    )
    contact = ao.Contact("one:c", "two:c", ao.Hertz(1e8), friction=0.4)
    start = ao.Motion(velocity=(2.0, 0.5, 0), spin=(1.0, 2.0, 3.0))
    hit = ao.Scene({"one": one, "two": two}, [contact], motion={"one": start}).run(3e-3)
    assert hit["one:c", "two:c"].peak_force > 10
    assert np.abs(hit["one:c", "two:c"].friction).max() > 1
    P = sum(body.momentum for body in hit.bodies.values())
    L = sum(body.angular_momentum() for body in hit.bodies.values())
    np.testing.assert_allclose(P, np.broadcast_to(P[0], P.shape), atol=1e-10 * np.abs(P).max())
    np.testing.assert_allclose(L, np.broadcast_to(L[0], L.shape), atol=1e-10 * np.abs(L).max())
    assert hit.energy.drift < 1e-3


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


def test_ground_that_accelerates_is_a_gravity_that_changes() -> None:
    """A mass on its stop under a ramp of the ground's acceleration, from rest."""
    omega, b = np.array([300.0]), np.array([[1.0]])
    inertia = ao.Inertia(np.zeros(3), np.eye(6), np.array([[0, 0, 1.0, 0, 0, 0]]))
    body = ao.SiteModes(omega, b, ("tip",), directions=[UP], inertia=inertia)
    contact = ao.Contact("tip", "stop", ao.Linear(2e5), gap=2e-5)
    base = ao.Base([0, 0.02, 0.04], [[0, 0, 0], [0, 0, 50.0], [0, 0, 0]])
    hit = ao.Scene({"tip": body, "stop": ao.Obstacle()}, [contact], base=base).run(0.04, tol=1e-4)

    def slope(t: float, y: Array) -> Array:
        push = -np.interp(t, [0, 0.02, 0.04], [0, 50.0, 0])
        F = 2e5 * max(-y[0] - 2e-5, 0)
        return np.array([y[1], push + F - 300.0**2 * y[0]])

    t = np.linspace(0, 0.04, 2000)
    s = solve_ivp(slope, (0, 0.04), [0, 0], "DOP853", t, rtol=1e-10, atol=1e-14, max_step=1e-4)
    force = 2e5 * np.maximum(-s.y[0] - 2e-5, 0)[:, None]
    assert force.max() > 1
    assert force_error(hit, t, force) < 1e-3


# -- preload


def test_preload_rests_until_something_moves() -> None:
    scene, _ = plate(ao.Hertz(1e8), 0.0)
    rest = ao.Scene(scene.bodies, scene.contacts, gravity=scene.gravity, preload=True)
    hit = rest.run(0.01)
    force = hit["plate:a", "floor"].force
    np.testing.assert_allclose(force, 2.0 * 9.81 / 4, rtol=1e-8)
    assert hit["plate:a", "floor"].contacts == [(0.0, 0.01)]


def test_preload_of_a_site_without_mass() -> None:
    """A load on a massless spring, which no mode feels: the contact takes its share of it."""
    compliance, stiffness, load = 1e-4, 3e4, -50.0
    body = ao.SiteModes(omega=[300.0], b=[[0.0]], sites=["tip"], r=[[compliance]])
    scene = ao.Scene(
        {"part": body, "stop": ao.Obstacle()},
        [ao.Contact("part:tip", "stop", ao.Linear(stiffness))],
        loads=[ao.Load("part:tip", [0.0, 1.0], [load, load])],
        preload=True,
    )
    force = scene.run(0.01)["part:tip", "stop"].force
    share = stiffness * compliance / (1 + stiffness * compliance)
    np.testing.assert_allclose(force, -share * load, rtol=1e-8)


def test_preload_without_equilibrium_is_refused() -> None:
    body = ao.RigidBody(1.0, (1, 1, 1), {"c": ((0, 0, 0), UP)})
    contact = ao.Contact("b:c", "floor", ao.Linear(1e5))
    bodies = {"b": body, "floor": ao.Obstacle()}
    with pytest.raises(ao.InputError, match="no static equilibrium"):
        ao.Scene(bodies, [contact], gravity=(0, 0, 9.81), preload=True).run(0.01)


# -- friction


def ball(vx: float, friction: float, law: ao.ContactLaw, kt: float | None = None) -> ao.Scene:
    """A ball of 0.3 kg and 20 mm that falls on the floor at 1 m/s, and vx along it."""
    moment = 0.4 * 0.3 * 0.02**2
    body = ao.RigidBody(0.3, (moment,) * 3, {"foot": ((0, 0, -0.02), UP)})
    contact = ao.Contact("ball:foot", "floor", law, friction=friction, tangential_stiffness=kt)
    start = ao.Motion(velocity=(vx, 0.0, -1.0), spin=(3.0, 0.0, 5.0) if vx > 2 else (0, 0, 0))
    return ao.Scene({"ball": body, "floor": ao.Obstacle()}, [contact], motion={"ball": start})


def test_gross_sliding_with_spin() -> None:
    """The tangential impulse is mu (1 + e) times the normal one, along the sliding."""
    hit = ball(5.0, 0.2, ao.Hertz(1e9)).run(2e-3)
    P = hit.bodies["ball"].momentum
    change = (P[-1] - P[0]) / 0.3
    slide = np.array([5.0, 0.0]) + np.cross((3.0, 0, 5.0), (0, 0, -0.02))[:2]
    slide /= np.linalg.norm(slide)
    np.testing.assert_allclose(change[:2], -0.2 * 2 * slide, atol=1e-4)
    assert change[2] == pytest.approx(2.0, abs=1e-4)
    assert hit.energy.drift < 1e-3


@pytest.mark.parametrize("vx", [0.1, 0.3])
def test_stick_then_slip_in_closed_form(vx: float) -> None:
    """Linear compliances: T = kt vx/w sin wt sticks until |T| = mu N; then it slides to the end.

    W. J. Stronge, Impact Mechanics, Cambridge 2000, ch. 5; sliding persists as N falls.
    """
    k, kt, mu = 1e7, 1e7 * 1.4 / 1.7, 0.5
    mass_t = 0.3 * 2 / 7
    W, w = np.sqrt(k / 0.3), np.sqrt(kt / mass_t)
    end = np.pi / W
    times = np.linspace(0, end, 20001)[1:]

    def room(t: float) -> float:
        return mu * k / W * np.sin(W * t) - abs(kt * vx / w * np.sin(w * t))

    i = int(np.argmax([room(t) < 0 for t in times]))
    slip = brentq(room, times[i - 1], times[i])
    side = np.sign(np.sin(w * slip))
    left = mu * k / W**2 * (np.cos(W * slip) - np.cos(W * end))  # impulse of friction
    expected = vx * np.cos(w * slip) - side * left / mass_t
    hit = ball(vx, mu, ao.Linear(k), kt).run(1e-3, tol=1e-4)
    assert hit.bodies["ball"].velocity("foot", (1, 0, 0))[-1] == pytest.approx(expected, abs=5e-4)
    total = hit.energy.kinetic + hit.energy.contact
    assert total.max() <= total[0] * (1 + 1e-5)  # friction makes no energy


# -- what goes wrong


def bounce() -> ao.Scene:
    """A mass of 1 kg that strikes a stiff wall at 1 m/s."""
    bodies = {"m": ao.RigidMass(1.0, 1.0), "w": ao.Obstacle()}
    return ao.Scene(bodies, [ao.Contact("w", "m", ao.Linear(1e6))])


def test_order_of_the_march() -> None:
    """Third-order forces: an eighth of the share of error, half the step."""

    scene, _ = plate(ao.Linear(1e6), 1e-3)
    made = assemble(scene, 0.012)
    runs = [run(made.system, 0.012, 1e-2 / 8**i, scale=1e3, fine=1e-6) for i in range(6)]
    t = np.linspace(0, 0.012, 5000)
    exact = forces(runs[-1], *located(runs[-1], t))[:, :4]
    errors = [np.linalg.norm(forces(r, *located(r, t))[:, :4] - exact) for r in runs[:4]]
    steps = [r.steps for r in runs[:4]]
    order = np.log(errors[0] / errors[-1]) / np.log(steps[-1] / steps[0])
    assert order > 1.7


def test_bad_scenes_are_refused() -> None:
    mass, wall = ao.RigidMass(1.0, 1.0), ao.Obstacle()
    law = ao.Linear(1e6)
    good = ao.Contact("w", "m", law)
    bodies = {"m": mass, "w": wall}
    with pytest.raises(ao.InputError, match="at least one Contact"):
        ao.Scene(bodies, [])
    with pytest.raises(ao.InputError, match="no body 'x'"):
        ao.Scene(bodies, [ao.Contact("x", "m", law)]).run(1e-3)
    with pytest.raises(ao.InputError, match="both ends"):
        ao.Scene({**bodies, "v": wall}, [ao.Contact("w", "v", law)]).run(1e-3)
    with pytest.raises(ao.InputError, match="same ends"):
        ao.Scene(bodies, [good, ao.Contact("w", "m", law)])
    with pytest.raises(ao.InputError, match="friction between"):
        ao.Scene(bodies, [ao.Contact("w", "m", law, friction=0.3)]).run(1e-3)
    with pytest.raises(ao.InputError, match="must differ"):
        ao.Contact("m", "m", law)
    with pytest.raises(ao.InputError, match="ContactLaw"):
        ao.Contact("w", "m", 1e6)  # type: ignore[arg-type]
    with pytest.raises(ao.InputError, match="ascend"):
        ao.Load("m", [0, 0], [1, 2])
    with pytest.raises(ao.InputError, match="no contact"):
        ao.Scene(bodies, [good]).run(1e-3)["m", "w"]
    with pytest.raises(ao.InputError, match="duration"):
        ao.Scene(bodies, [good]).run(0.0)


def test_bounds_on_the_work_are_told() -> None:
    scene = bounce()
    with pytest.warns(ao.AccuracyWarning, match="more than 5 steps"):
        hit = scene.run(1e-2, max_steps=5)
    assert hit.status == 2
    with pytest.warns(ao.AccuracyWarning, match="leaves no finer run"):
        assert scene.run(1e-2, max_steps=30).status == 1


def test_a_finer_run_that_takes_far_more_steps_is_stopped(monkeypatch) -> None:
    monkeypatch.setattr(convergence, "DEARER", 0)
    monkeypatch.setattr(convergence, "CHEAP", 10)
    with pytest.warns(ao.AccuracyWarning, match="Up to .* the two agree"):
        hit = bounce().run(1e-2)
    assert hit.status == 1
    assert hit.time[-1] == 1e-2


def test_steps_that_are_given_up_count_as_work() -> None:
    made = assemble(stops()[0], 0.006)
    found = run(made.system, 0.006, 1e-3, scale=1e-9, fine=made.lasting / 200, max_steps=200)
    assert found.answer == march.TOO_MANY_STEPS
    assert found.steps < found.attempts <= 200 + march.LEVELS + 14


def test_what_touches_by_rounding_alone_is_no_contact() -> None:
    """A load far from a stop without gap draws the body away from it."""
    made = assemble(random_scene(1112), 5e-3)
    found = run(made.system, 5e-3, 1e-3, fine=made.lasting / 200, max_steps=100)
    assert found.answer == march.TOO_MANY_STEPS
    assert found.touches == 0


def test_a_gain_of_energy_is_told() -> None:
    with pytest.warns(ao.AccuracyWarning, match="gained energy"):
        hit = random_scene(3483).run(5e-3)
    assert hit.status == 1
    assert hit.energy.drift > 1e-3


def test_energy_held_without_mass_counts_as_given() -> None:
    """A load at the start presses a site without mass against its contact, and then releases it."""
    hit = random_scene(98).run(2e-4, tol=1e-2)
    assert hit.status == 0
    assert hit.energy.drift < 1e-4


def test_an_interrupted_compilation_leaves_no_half_module(monkeypatch) -> None:
    pytest.importorskip("numba")
    monkeypatch.setattr(compilation, "_COMPILED", "march_that_is_interrupted")

    def interrupted(path: str) -> None:
        raise KeyboardInterrupt

    monkeypatch.setattr(
        compilation.importlib.util, "spec_from_file_location", lambda *a, **k: Spec()
    )

    class Loader:
        create_module = staticmethod(lambda spec: None)
        exec_module = staticmethod(interrupted)

    def Spec() -> ModuleSpec:
        return ModuleSpec("march_that_is_interrupted", Loader())  # type: ignore[arg-type]

    with pytest.raises(KeyboardInterrupt):
        compiled_march()
    assert "march_that_is_interrupted" not in sys.modules


def test_a_body_that_turns_far_is_told() -> None:
    box = ao.RigidBody(1.0, (1e-3,) * 3, {"c": ((0, 0, 0), UP)})
    contact = ao.Contact("box:c", "floor", ao.Linear(1e5), gap=1.0)
    scene = ao.Scene(
        {"box": box, "floor": ao.Obstacle()}, [contact], motion={"box": ao.Motion(spin=(0, 0, 50))}
    )
    with pytest.warns(ao.AccuracyWarning, match=r"turned by 0\.5 rad"):
        scene.run(1e-2)


def test_scenes_and_histories_pickle() -> None:
    scene = bounce()
    hit = pickle.loads(pickle.dumps(pickle.loads(pickle.dumps(scene)).run(1e-2)))
    assert hit["w", "m"].peak_force == pytest.approx(np.sqrt(1e6), rel=1e-4)


# -- random scenes


def random_law(rng: np.random.Generator) -> ao.ContactLaw:
    k, depth = 10 ** rng.uniform(6, 10), 10 ** rng.uniform(-7, -4)
    return [
        ao.Linear(10 ** rng.uniform(4, 8)),
        ao.Hertz(k),
        ao.Power(k, rng.uniform(1, 3)),
        ao.HuntCrossley(k, rng.uniform(0.2, 1)),
        ao.Thornton(k, depth),
        ao.Stronge(k, depth),
        ao.YangSun(k, depth),
    ][rng.integers(7)]


def random_scene(seed: int) -> ao.Scene:
    """One to four chains and masses with one to six contacts, loads, residual compliance."""
    rng = np.random.default_rng(seed)
    bodies, ends = {"floor": ao.Obstacle()}, ["floor"]
    for i in range(int(rng.integers(1, 5))):
        name, sites = f"b{i}", int(rng.integers(1, 4))
        if rng.random() < 0.3:
            bodies[name] = ao.RigidMass(10 ** rng.uniform(-2, 1), rng.uniform(-3, 5))
            ends.append(name)
            continue
        n = int(rng.integers(2, 12))
        K, M = chain(n, 10 ** rng.uniform(4, 7), rng.uniform(0.02, 0.3, n), rng.random() < 0.5)
        omega, b = free_modes(K, M, np.eye(n)[:, rng.integers(0, n, sites)])
        a = rng.normal(size=(sites, sites)) * (rng.random() < 0.3)
        names = [f"s{j}" for j in range(sites)]
        bodies[name] = ao.SiteModes(
            omega, b, names, r=a @ a.T * 1e-8, decay=0.01 * (rng.random() < 0.5) * omega
        )
        ends += [f"{name}:{s}" for s in names]
    pairs = {tuple(map(str, rng.choice(ends, 2, replace=False))) for _ in range(rng.integers(1, 7))}
    contacts = [
        ao.Contact(a, b, random_law(rng), gap=float(rng.choice([0, 10 ** rng.uniform(-6, -3)])))
        for a, b in sorted(pairs)
    ]
    times, forces = np.sort(rng.uniform(0, 5e-3, 3)), rng.normal(size=3) * 10 ** rng.uniform(0, 3)
    return ao.Scene(bodies, contacts, loads=[ao.Load(str(rng.choice(ends[1:])), times, forces)])


@pytest.mark.slow
def test_random_scenes_end_with_finite_forces_and_their_energy() -> None:
    compiled_march()  # sooner, where there is one
    completed = 0
    for seed in range(60):
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", ao.AccuracyWarning)
            hit = random_scene(seed).run(5e-3)
        assert np.isfinite(hit.run.force).all(), seed
        if hit.status == 0:
            completed += 1
            assert hit.energy.drift < 1e-2, seed
    assert completed >= 59


@pytest.mark.slow
def test_no_random_scene_takes_ten_seconds_of_cpu() -> None:
    if compiled_march() is None:
        pytest.skip("the interpreted march is slower")

    def late(number: int, frame: object) -> None:
        raise TimeoutError

    before = signal.signal(signal.SIGPROF, late)
    completed, seeds = 0, [104, *range(900, 1200)]
    try:
        for seed in seeds:
            signal.setitimer(signal.ITIMER_PROF, 10.0)
            with warnings.catch_warnings():
                warnings.simplefilter("ignore", ao.AccuracyWarning)
                hit = random_scene(seed).run(5e-3)
            energy = hit.energy
            signal.setitimer(signal.ITIMER_PROF, 0.0)
            assert np.isfinite(hit.run.force).all(), seed
            if hit.status == 0:
                completed += 1
                highest = np.max(energy.kinetic + energy.strain + energy.contact)
                assert np.max(energy.total - energy.total[0]) <= 1e-3 * highest, seed
    finally:
        signal.setitimer(signal.ITIMER_PROF, 0.0)
        signal.signal(signal.SIGPROF, before)
    assert completed >= 0.98 * len(seeds)


@pytest.mark.slow
def test_the_compiled_march_gives_the_numbers_of_the_interpreted_one() -> None:
    pytest.importorskip("numba")

    compiled = compiled_march()
    assert compiled is not None
    mass, body = ao.RigidMass(0.3, 2.0), ao.SiteModes([2e3, 9e3], [[3.0], [4.0]], ["tip"])
    scenes = [ao.Scene({"a": body, "b": mass}, [ao.Contact("a", "b", law)]) for law in LAWS]
    scenes += [plate(ao.Hertz(1e8), 1e-3)[0], rod_between_walls(1.5)[0], stops()[0]]
    scenes.append(ball(5.0, 0.2, ao.Hertz(1e9)))
    for scene in scenes:
        made = assemble(scene, 2e-3)
        start(made)
        a, b = (
            run(made.system, 2e-3, 1e-3, module=m, fine=made.lasting / 200)
            for m in (march, compiled)
        )
        assert a.answer == b.answer == march.DONE
        np.testing.assert_allclose(a.time, b.time, rtol=1e-7)
        np.testing.assert_allclose(a.force, b.force, atol=1e-6 * np.abs(a.force).max())


def test_one_model_may_be_two_bodies():
    """Each body has its own field, though both are one object."""
    model = ao.AntiOscillators(m0=1.0, k0=1e6, m=[0.5], omega=[2000.0], shapes=np.ones((3, 2)))
    hit = ao.Scene(
        bodies={"struck": model, "far": model, "mass": ao.RigidMass(0.2, 1.0)},
        contacts=[
            ao.Contact("struck", "mass", ao.Linear(1e6)),
            ao.Contact("far", "struck", ao.Linear(1e6), gap=1.0),
        ],
    ).run(1e-3)
    assert np.all(hit.field(1e-3, "struck") > 1e-6)
    np.testing.assert_array_equal(hit.field(1e-3, "far"), 0.0)
