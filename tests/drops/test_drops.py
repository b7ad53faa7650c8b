"""Drops against closed forms, balances, and an integration in a floating frame."""

from __future__ import annotations

import re
from dataclasses import replace
from itertools import product
from typing import Any

import numpy as np
import pytest
from scipy.integrate import solve_ivp, trapezoid
from scipy.linalg import expm
from scipy.optimize import brentq

import antiosc as ao
from antiosc.base import progress
from antiosc.base.texts import engineering, percent
from antiosc_app import falls, results
from antiosc_studies.drops import trajectory
from antiosc_studies.drops.body import free_body
from antiosc_studies.drops.episode import final_state, run_episode
from antiosc_studies.drops.fall import fall_of, initial_state
from antiosc_studies.drops.flight import Flight, displacement_bounds, free_rotation, free_vibration
from antiosc_studies.drops.floor import law_at
from antiosc_studies.drops.free_body import State
from antiosc_studies.drops.impacts import Impacts
from antiosc_studies.drops.orientation import tilt_rotation
from antiosc_studies.drops.touching import BODY, Touch
from falling import CORNERS, HALF, G, bar, block, floating, landed, setting, started
from law_formulas import restitution_of

BALL = ao.Sphere(0.015, 200e9, 0.3, 7800.0)
HARD = ao.Sphere(0.015, material="bearing steel 100Cr6")
SOFT = "aluminium 6061-T6"


def test_the_strength_of_a_falling_ball_counts() -> None:
    """By symmetry, as that of a floor with the ball's material under a hard ball."""
    lead, steel = ao.Floor(SOFT), ao.Floor("bearing steel 100Cr6")
    ball = ao.Sphere(0.015, material=SOFT)
    fall = ao.drop(ball, 0.5, floor=steel, until=1)
    assert "the contact yields" in fall.contact_verdict
    assert f"across, in the part ({SOFT})" in fall.contact_verdict
    heavy = ao.drop(ao.Sphere(0.015, material="bearing steel 100Cr6"), 0.5, floor=lead, until=1)
    laws = [law_at(one.body, one.setting.floor, 0) for one in (fall, heavy)]
    assert laws[0] == laws[1]


def test_the_dent_of_one_of_several_places_has_its_own_force() -> None:
    """Four alike below a symmetric body: each has a quarter of the force."""
    feet = {f"{x}{y}": ((x, y, -0.01), (0, 0, 1)) for x in (-0.03, 0.03) for y in (-0.02, 0.02)}
    law = ao.contact_between(HARD, ao.Sphere(0.02, material=SOFT))
    told = []
    for sites in (feet, {"foot": ((0, 0, -0.01), (0, 0, 1))}):
        body = ao.RigidBody(0.2, [1e-4] * 3, sites)
        fall = ao.drop(body, 0.3, floor=ao.Floor(law=law), until=1)
        told.append((fall.contact_verdict, fall.peak_force))
    (several, force), (single, _) = told
    assert f"places that touch, under {engineering(force / 4, 'N')} of the force)" in several
    assert "the contact yields: a dent of" in single
    assert "places" not in single


def test_the_acceleration_of_the_centre_of_mass_is_told() -> None:
    """F/m of a contact of 12 ms, which the filter passes; less of a contact of 0.12 ms."""
    for stiffness, passed in ((1e5, True), (1e10, False)):
        fall = ao.drop(BALL, 0.1, floor=ao.Floor(law=ao.Hertz(stiffness)), until=1)
        (told,) = (note for note in fall.notes if note.startswith("the centre of mass has"))
        in_g = float(told.split()[7])
        assert "no error bar: that of the force is not known" in told  # the law was given
        whole = fall.peak_force / BALL.mass / 9.80665
        assert (abs(in_g / whole - 1) < 0.02) == passed
        assert in_g < 1.02 * whole
        assert "through CFC1000, in impact 1" in told


def test_each_impact_has_its_dent_and_its_g() -> None:
    """F/m of contacts that the filter passes; no dent of a law that is elastic."""
    soft = ao.drop(BALL, 0.1, floor=ao.Floor(law=ao.Hertz(1e5)), until=2)
    columns = results.fall_table(soft)
    told = columns["centre of mass in g, CFC1000"]
    forces = soft.impacts.column("peak_force") / BALL.mass / 9.80665
    assert told == pytest.approx(forces, rel=0.02)
    assert np.isnan(columns["dent (m)"]).all()
    alloy = ao.drop(HARD, 0.5, floor=ao.Floor(SOFT), until=2)
    dents = [one.history.contact_histories[0].dent.depth for one in alloy.episodes]
    assert results.fall_table(alloy)["dent (m)"] == pytest.approx(dents)


def test_a_ball_bounces_by_the_law_it_has() -> None:
    e, k = 0.8, 1e10
    floor = ao.Floor(law=ao.HuntCrossley(k, e))
    ball = ao.Sphere(0.01, 200e9, 0.3, 7800)
    fall = ao.drop(ball, 0.5, floor=floor, until=4)
    v = np.sqrt(2 * G * 0.5) * restitution_of(1.5 * (1 - e)) ** np.arange(5)
    np.testing.assert_allclose(fall.impacts.column("speed_before"), v[:-1], rtol=2e-4)
    np.testing.assert_allclose(fall.impacts.column("speed_after"), v[1:], rtol=2e-4)
    starts, ends = (
        np.array([getattr(one, n).time for one in fall.episodes]) for n in ("start", "end")
    )
    np.testing.assert_allclose(starts[1:] - ends[:-1], 2 * v[1:-1] / G, rtol=1e-3)
    elastic = ao.drop(
        ao.Sphere(0.01, 200e9, 0.3, 7800), 0.5, floor=ao.Floor(law=ao.Hertz(k)), until=1
    )
    mass = ao.Sphere(0.01, 200e9, 0.3, 7800).mass
    assert elastic.peak("force").value == pytest.approx(
        k**0.4 * (1.25 * mass * v[0] ** 2) ** 0.6, rel=2e-3
    )


def test_an_impact_lasts_as_long_as_its_force() -> None:
    """Also where a dent that has parted begins an episode in which nothing pushes."""
    yielding = ao.Floor(law=ao.Thornton(1e9, 1e-6))
    fall = ao.drop(block(), 0.05, floor=yielding, until=4)
    assert any(not one.forces()[1].any() for one in fall.episodes)
    for one, own in zip(fall.impacts, fall.groups, strict=True):
        times = []
        for t, force in (fall.episodes[i].forces() for i in own):
            times += [t[n] for n in np.flatnonzero(force.any(axis=1))]
        assert one.contact_time == pytest.approx(max(times), rel=0.02)
        free = fall.body.mass * (one.speed_before + one.speed_after + G * one.contact_time)
        assert one.impulse == pytest.approx(free, rel=1e-3)


@pytest.mark.parametrize("e", [0.2, 0.5, 0.9])
def test_the_restitution_of_a_floor_is_that_of_the_bounce(e: float) -> None:
    one = ao.drop(BALL, 0.6, floor=ao.Floor(restitution=e), until=1).impacts[0]
    assert one.speed_after / one.speed_before == pytest.approx(e, rel=2e-3)


@pytest.mark.parametrize("loss", [0.1, 0.6])
def test_the_loss_factor_of_a_layer_is_that_of_half_a_cycle(loss: float) -> None:
    """Which dissipates pi loss of the energy that is left, all the time."""
    layer = ao.SoftLayer(1e-3, 1e9, loss=loss)
    one = ao.drop(BALL, 0.6, floor=ao.Floor(layer=layer), until=1).impacts[0]
    left = (one.speed_after / one.speed_before) ** 2
    assert left == pytest.approx(np.exp(-np.pi * loss), rel=5e-3)


def test_a_rigid_blocks_first_two_impacts_are_those_of_impulses() -> None:
    """Planar, elastic, of no duration: J = 2 v/(1/m + x^2/I)."""
    height, angle, mass = 0.1, np.radians(12.0), 0.3
    fall = ao.drop(block(), height, tilt=(0, 12, 0), floor=ao.Floor(law=ao.Hertz(1e13)), until=2)
    inertia = mass / 3 * (HALF[0] ** 2 + HALF[2] ** 2)
    corners = CORNERS[CORNERS[:, 1] > 0][:, [0, 2]]
    turn = lambda a: np.array([[np.cos(a), np.sin(a)], [-np.sin(a), np.cos(a)]])  # noqa: E731
    placed = corners @ turn(angle).T
    low = placed[np.argmin(placed[:, 1])]
    v, z = -np.sqrt(2 * G * height), -low[1]
    J = -2 * v / (1 / mass + low[0] ** 2 / inertia)
    v, w = v + J / mass, -low[0] * J / inertia  # the spin about y that lowers +x

    def lowest(t: float) -> float:
        others = corners[np.any(corners @ turn(angle).T != low, axis=1)]
        return z + v * t - G * t * t / 2 + (others @ turn(angle + w * t).T)[:, 1].min()

    t = brentq(lowest, 1e-6, next(s for s in np.arange(1e-4, 0.1, 1e-4) if lowest(s) < 0))
    placed = corners @ turn(angle + w * t).T
    hit = placed[np.argmin(placed[:, 1])]
    speed = v - G * t - w * hit[0]
    second = -2 * speed / (1 / mass + hit[0] ** 2 / inertia)
    np.testing.assert_allclose(fall.impacts.column("impulse"), [J, second], rtol=5e-3)
    assert np.diff(fall.impacts.column("time"))[0] == pytest.approx(t, rel=5e-3)
    assert second > J


@pytest.mark.parametrize("e", [1.0, 0.6])
def test_a_rod_clatters(e: float) -> None:
    """A thin rod that lands almost flat: its ends strike in turn, with closed-form velocities.

    An end that arrives with the velocity a < 0 leaves with -e a; the other end's velocity changes
    by (1 + e) a/2, as 1/m + l^2/(4 I) = 4/m and 1/m - l^2/(4 I) = -2/m.
    """
    length, mass = 0.2, 0.1
    inertia = mass * length**2 / 12
    sites = {s: ((x, 0, 0), (0, 0, 1)) for s, x in (("a", -length / 2), ("b", length / 2))}
    rod = ao.RigidBody(mass, [1e-6, inertia, inertia], sites)
    floor = ao.Floor(law=ao.HuntCrossley(1e13, e) if e < 1 else ao.Hertz(1e13))
    fall = ao.drop(rod, 1.0, tilt=(0, 0.5, 0), floor=floor, until=3)
    e = restitution_of(1.5 * (1 - e))
    ends, own = np.full(2, -np.sqrt(2 * G)), 1  # a positive turn about y lowers +x
    before, after = [], []
    for _ in range(3):
        before.append(-ends[own])
        ends[1 - own] += (1 + e) / 2 * ends[own]
        ends[own] *= -e
        after.append(ends[own])
        own = 1 - own
    np.testing.assert_allclose(fall.impacts.column("speed_before"), before, rtol=0.02)
    np.testing.assert_allclose(fall.impacts.column("speed_after"), after, rtol=0.02)
    impulses = (1 + e) / 4 * mass * np.array(before)
    np.testing.assert_allclose(fall.impacts.column("impulse"), impulses, rtol=0.02)
    assert before[1] == pytest.approx((3 + e) / 2 * before[0])  # up to twice the first


@pytest.mark.parametrize("friction", [0.0, 0.3])
def test_what_a_hand_over_keeps(friction: float) -> None:
    """Momentum and angular momentum, in space, with spin and vibration; energy, if none is lost."""
    body = bar()
    body.decay = np.zeros(2)
    where = setting(ao.Hertz(1e9), friction, impacts=3, tol=1e-4 if friction else 1e-5)
    start = initial_state(
        body,
        where,
        tilt_rotation(np.array([8.0, 14.0, 5.0])),
        np.array([9.0, -4.0, 6.0]),
        np.zeros(3),
    )
    fall = fall_of(body, start, where)
    for one in fall.episodes:
        for state, t in ((one.start, 0.0), (one.end, one.duration)):
            scene = one.history.at([t])[BODY]
            np.testing.assert_allclose(scene.momentum[0], body.mass * state.velocity, atol=1e-9)
            L = scene.angular_momentum()[0]
            np.testing.assert_allclose(L, state.angular_momentum, atol=1e-6 * np.linalg.norm(L))
            np.testing.assert_allclose(scene.q[0, 6:], state.q, atol=1e-12)
            np.testing.assert_allclose(scene.v[0, 6:], state.p, atol=1e-9)
    assert len(fall.episodes) >= 3
    energy = fall.energy()[1].sum(axis=1)
    if friction:
        assert energy[-1] < energy[0]
        assert (np.diff(energy) < 1e-6 * energy[0]).all()
    else:
        np.testing.assert_allclose(energy, energy[0], rtol=1e-6)


@pytest.mark.parametrize("tol", [1e-2, 1e-3])
@pytest.mark.parametrize("law", [ao.Linear(1e5), ao.HuntCrossley(1e6, 0.6)])
def test_a_hand_over_keeps_the_energy_at_any_tol(
    tol: float, law: ao.ContactLaw, monkeypatch: pytest.MonkeyPatch
) -> None:
    """That of the flight after it is that of the path at the end of the contact."""
    ends = []

    def kept(touch: Touch, history: Any, path: Any, which: Any) -> Any:
        body, start = touch[:2]
        found = final_state(touch, history, path, which)
        scene = history.at(path.times[-1:])[BODY]
        L = path.R[-1].T @ scene.angular_momentum()[0]
        q, v, P = scene.q[0], scene.v[0], scene.momentum[0]
        moving = P @ P / body.mass + L @ body.inverse_inertia @ L + v[6:] @ v[6:]
        strain = (body.omega**2 * q[6:]) @ q[6:]
        z = start.centre[2] + q[2] / np.sqrt(body.mass)
        known = (moving + strain) / 2 + body.mass * G * z
        ends.append((known, sum(found[0].energies(body, G))))
        return found

    monkeypatch.setattr("antiosc_studies.drops.episode.final_state", kept)
    rigid = free_body(block(), 0, None, None)
    for body, tilt in ((bar(), (8.0, 14.0, 5.0)), (rigid, (0.02, 0.05, 0))):
        where = setting(law, 0.3, impacts=3, tol=tol)
        fall = fall_of(body, started(body, where, tilt), where)
        before, after = np.array(ends[-len(fall.episodes) :]).T
        np.testing.assert_allclose(after, before, rtol=0, atol=1e-9 * fall.energy()[1][0].sum())


@pytest.mark.parametrize("law", [ao.Linear(1e5), ao.Hertz(1e6), ao.Hertz(1e9)])
@pytest.mark.parametrize("tilt", [(0.0, 0.0, 0.0), (90.0, 0.0, 0.0), (0.0, 20.0, 0.0)])
def test_a_face_that_lands_flat_keeps_the_energy(
    tilt: tuple[float, ...], law: ao.ContactLaw
) -> None:
    """Two or four corners at once; on edge the corners press the block out of its balance."""
    body, where = free_body(block(), 0, None, None), setting(law, height=1.0, tol=1e-3)
    fall = fall_of(body, started(body, where, tilt), where)
    assert len(fall.episodes[0].indices) > 1
    energy = fall.energy()[1].sum(axis=1)
    np.testing.assert_allclose(energy, energy[0], rtol=5e-5)


@pytest.mark.parametrize(("friction", "rounded"), [(0.0, 0.0), (0.3, 2e-3)])
def test_a_spinning_block_lands_as_eulers_equations_say(friction: float, rounded: float) -> None:
    """The first impact in space, where the body turns by 15 degrees and its spin with it."""
    body, k = free_body(block(), 0, None, None), 1e6
    body.ball_radii[:] = rounded
    where = setting(ao.Hertz(k), friction, impacts=1)
    start = initial_state(
        body,
        where,
        tilt_rotation(np.array([30.0, 40.0, 5.0])),
        np.array([9.0, -14.0, 26.0]),
        np.zeros(3),
    )
    one = fall_of(body, start, where).episodes[0]
    R, v, L, peak = landed(body, one, k, friction)
    assert one.forces()[1].sum(axis=1).max() == pytest.approx(peak, rel=5e-4)
    assert np.degrees(np.arccos((np.trace(one.start.R.T @ R) - 1) / 2)) > 10
    np.testing.assert_allclose(one.end.velocity, v, atol=2e-3)
    np.testing.assert_allclose(one.end.angular_momentum, L, atol=1e-3 * np.linalg.norm(L))
    np.testing.assert_allclose(one.end.R, R, atol=3e-4)


@pytest.mark.slow
@pytest.mark.parametrize("law", [ao.Hertz(1e6), ao.HuntCrossley(1e6, 0.8)])
def test_a_contact_that_is_cut_goes_on(law: ao.ContactLaw, monkeypatch: pytest.MonkeyPatch) -> None:
    """In a new orientation, with friction and damping: no matter where the contact is cut."""
    body, found = free_body(block(), 0, None, None), []
    where = setting(law, 0.3, impacts=1)
    start = initial_state(
        body,
        where,
        tilt_rotation(np.array([30.0, 40.0, 5.0])),
        np.array([9.0, -14.0, 26.0]),
        np.zeros(3),
    )
    for turns in (1.0, 0.05):
        monkeypatch.setattr("antiosc_studies.drops.episode.LARGEST_ROTATION", turns)
        fall = fall_of(body, start, where)
        one = fall.impacts[0]
        found.append([one.peak_force, one.impulse, one.lost, *fall.end.angular_momentum * 1e3])
    assert len(fall.episodes) > 3
    np.testing.assert_allclose(found[1], found[0], rtol=5e-3)


@pytest.mark.slow
def test_a_slender_body_rolls_over_its_corners() -> None:
    """No corner sinks deeper than contacts press in: two corners side by side are two contacts."""
    half, mass = np.array([0.15, 0.005, 0.005]), 0.3
    corners = half * np.array(list(product((-1, 1), repeat=3)))
    moments = mass / 3 * (half @ half - half**2)
    bar = ao.RigidBody(mass, moments, {f"{i}": (p, (0, 0, 1)) for i, p in enumerate(corners)})
    floor = ao.Floor(law=ao.HuntCrossley(1e5, 0.4), friction=0.3)
    fall = ao.drop(bar, 0.05, (20, 0, 0), floor, until=3, tol=1e-2)
    for one in fall.episodes:
        assert one.end.heights(fall.body).min() > -1.01 * one.largest_approach
    assert np.arccos(fall.end.R[2] @ fall.start.R[2]) > 0.3  # it has rolled


def test_free_flight_is_exact() -> None:
    body = bar()
    L = np.array([0.002, -0.02, 0.03])
    none = np.zeros(2)
    R = tilt_rotation(np.array([20.0, 30.0, 0.0]))
    start = State(0.0, np.array([0, 0, 1.0]), np.zeros(3), R, L, none, np.array([0.01, 0.003]))
    flight = Flight(body, start, G)
    found = flight.first_touch(flight.longest_duration())
    assert found is not None
    every = np.arange(2)
    assert abs(flight.heights(np.array([found]), every).min()) < 1e-9
    assert (flight.heights(np.linspace(0, 0.9999 * found, 3000), every) > 0).all()
    end = flight.state_at(found)
    spin = [0.5 * L @ s.spin(body) for s in (start, end)]
    assert spin[1] == pytest.approx(spin[0], rel=1e-7)
    np.testing.assert_allclose(end.R @ end.R.T, np.eye(3), atol=1e-12)


@pytest.mark.parametrize(
    ("moments", "handed"),
    [([1.0, 2.0, 2.5], 1), ([1.0, 2.0, 2.5], -1), ([1.0, 1.0, 2.0], 1), ([1.0, 2.0, 2.0], -1),
     ([1.0, 1.00001, 1.00003], 1)],
)  # fmt: skip
def test_a_tumbling_body_turns_as_eulers_equations_say(moments: list[float], handed: int) -> None:
    """Slow and fast precession, symmetric bodies, a mirrored set of axes."""
    axes = tilt_rotation(np.array([50.0, -20.0, 75.0])) * np.array([[1.0], [handed], [1.0]])
    R = tilt_rotation(np.array([10.0, 130.0, 40.0]))
    inverse = (axes.T / moments) @ axes
    t = np.linspace(0.0, 5.0, 4)
    for spin in ([2.0, 0.3, 0.5], [0.3, 0.1, 3.0], [0.5, -2.0, -0.4]):
        L = R @ axes.T @ (np.array(moments) * spin)

        def rate(_: float, y: np.ndarray, L: np.ndarray = L) -> np.ndarray:
            own = y.reshape(3, 3)
            return np.cross(own @ inverse @ own.T @ L, own.T).T.ravel()

        known = solve_ivp(rate, (0, t[-1]), R.ravel(), "DOP853", t, rtol=1e-10, atol=1e-10)
        found = free_rotation(np.array(moments), axes, R, L)(t)
        np.testing.assert_allclose(found, known.y.T.reshape(-1, 3, 3), atol=2e-8)


@pytest.mark.slow
def test_a_bar_flies_as_in_a_floating_frame() -> None:
    """Three peaks; the third one depends on the vibration at the touch."""
    body, k = bar(), 2e8
    where = setting(ao.Hertz(k), impacts=3)
    start = started(body, where, (0.0, 30.0, 0.0))
    fall = fall_of(body, start, where)
    touch = Flight(body, start, G).state_at(fall.episodes[0].start.time - 1e-5)
    peaks = floating(body, touch, k, fall.episodes[-1].end.time - touch.time + 1e-5)
    mine = fall.impacts.column("peak_force")
    np.testing.assert_allclose(mine, peaks[:3], rtol=2e-4)
    assert mine[1] > 1.3 * mine[0]


def test_modes_ring_whatever_their_damping() -> None:
    """Weak, nearly critical, critical and over-damped ones, and the bounds of their motion."""
    omega, t = np.full(5, 3.0), np.linspace(0.0, 4.0, 30)
    decay = np.array([0.1, 2.9, 3.0, 3.1, 40.0])
    q0, p0 = np.full(5, 0.2), np.full(5, -4.0)
    q, p = free_vibration(omega, decay, q0, p0, t)
    for j in range(5):
        A = np.array([[0.0, 1.0], [-(omega[j] ** 2), -2 * decay[j]]])
        known = np.array([expm(A * s) @ [q0[j], p0[j]] for s in t])
        np.testing.assert_allclose(np.column_stack((q[:, j], p[:, j])), known, atol=1e-12)
    later = np.maximum.accumulate(np.abs(q)[::-1])[::-1]
    assert (np.abs(displacement_bounds(omega, q, p)) >= later - 1e-12).all()


@pytest.mark.parametrize(
    ("how", "count"), [({"face": "-x"}, 4), ({"edge": "-x+z"}, 2), ({"corner": "+x-y-z"}, 1)]
)
def test_faces_edges_and_corners_hit_first(how: dict[str, str], count: int) -> None:
    fall = ao.drop(block(), 0.3, floor=ao.Floor(law=ao.Hertz(1e9)), until=0.01, **how)
    low = CORNERS @ fall.start.R[2]
    lowest = np.flatnonzero(low < low.min() + 1e-9)
    assert len(lowest) == count
    np.testing.assert_allclose((CORNERS @ fall.start.R.T)[lowest, :2].mean(axis=0), 0, atol=1e-12)
    assert fall.start.centre[2] + low.min() == pytest.approx(0.3)


def test_a_beam_that_bends_upward_falls_on() -> None:
    """Its centre is below the floor before its ends touch."""
    body = bar(1)
    body.points[:, 2] = 0.0
    up = 0.004 / body.shapes[0, 0, 2]
    start = State(0.0, np.array([0, 0, 1e-5]), np.array([0, 0, -1.5]), np.eye(3), np.zeros(3),
                  np.array([up]), np.zeros(1))  # fmt: skip
    flight = Flight(body, start, G)
    found = flight.first_touch(flight.longest_duration())
    assert found is not None
    assert flight.state_at(found).centre[2] < -1e-4
    assert abs(flight.heights(np.array([found]), np.arange(2)).min()) < 1e-9


def test_a_fall_that_is_not_a_number_is_refused(monkeypatch) -> None:
    body, where = bar(), setting(ao.Linear(1e6))

    def lost(*given: Any) -> Any:
        one = run_episode(*given)
        return replace(one, end=replace(one.end, centre=np.full(3, np.nan)))

    monkeypatch.setattr(trajectory, "run_episode", lost)
    with pytest.raises(ao.AccuracyError, match="sank through the floor"):
        trajectory.trajectory(body, started(body, where, (5, 0, 0)), where, lambda *_: None)


@pytest.mark.slow
def test_the_ends_of_a_fall() -> None:
    floor = ao.Floor(law=ao.HuntCrossley(1e8, 0.4), friction=0.4)
    fall = ao.drop(block(), 0.05, tilt=(4, 7, 0), floor=floor, tol=1e-2)
    assert fall.message == "at rest"
    assert abs(fall.end.R[2, 2]) > 0.999  # it lies flat
    assert fall.end.centre[2] == pytest.approx(HALF[2], abs=2e-3)
    _, energies = fall.energy()
    assert (np.diff(energies.sum(axis=1)) < 1e-4 * energies[0].sum()).all()
    assert ao.drop(block(), 0.05, floor=floor, until=0.02).end.time == pytest.approx(0.02)
    assert " peak " in str(fall.impacts)


def test_an_accelerometer_feels_what_the_rigid_body_does() -> None:
    fall = ao.drop(block(), 0.2, tilt=(5, 9, 0), floor=ao.Floor(law=ao.Hertz(1e8)), until=1)
    one = fall.episodes[0]
    peak = fall.peak("acceleration", at=(0, 0, 0))
    assert peak.value == pytest.approx(fall.peak_force / 0.3, rel=2e-3)
    assert peak.g == pytest.approx(peak.value / 9.80665)
    change = np.linalg.norm(one.end.velocity - one.start.velocity + [0, 0, G * one.duration])
    t, a = fall.signal((0, 0, 0))
    assert np.linalg.norm(trapezoid(a, t, axis=0)) == pytest.approx(change, rel=5e-3)
    assert fall.peak("acceleration", (0, 0, 0), filter="CFC180").value < 0.5 * peak.value
    assert fall.srs((0, 0, 0), 0, [10.0, 1e5]).positive[1] == pytest.approx(peak.value, rel=0.05)


@pytest.mark.slow
def test_ensembles_have_bars_and_begin_with_the_falls_of_smaller_ones() -> None:
    given = {"height": 0.1, "floor": ao.Floor(law=ao.Hertz(1e9)), "until": 1, "tol": 1e-2}
    spread = ao.Tilts(sigma=3.0, height=0.02)
    many = ao.drop(block(), **given, ensemble=spread, n=24)
    numbers = many.numbers()
    assert numbers["peak_force"]["50 %"] == many.quantile("peak_force", 0.5).value
    assert (numbers["falls"], numbers["status"]) == (24, 0)
    fewer = ao.drop(block(), **given, ensemble=spread, n=3)
    np.testing.assert_array_equal(many.values["peak_force"][:3], fewer.values["peak_force"])
    median = many.quantile("peak_force", 0.5)
    assert median.low < median.value < median.high
    assert many.quantile("peak_force", 0.99).high == np.inf  # 24 falls do not bound it
    assert not many.failures


@pytest.mark.parametrize(
    ("change", "word"),
    [
        ({"until": "now"}, "until"),
        ({"height": -1.0}, "height"),
        ({"face": "-z", "edge": "-x-z"}, "one of"),
        ({"corner": "-x"}, "corner"),
        ({"height": 0.0}, "height"),
        ({"height": np.nan}, "height"),
        ({"tilt": (1, 2)}, "three angles in degrees"),
        ({"spin": (0, 1e6, 0)}, "spin"),
        ({"until": 0}, "until"),
        ({"until": True}, "until"),
        ({"ensemble": ao.Tilts(1.0), "n": 0}, "n must"),
        ({"floor": ao.Floor()}, "rigid"),
        ({"floor": "steel"}, "Floor of a Solid"),
        ({"floor": ao.Solid(210e9, 0.3, 7800.0)}, "Floor of this material"),
        ({"floor": ao.AntiOscillators(m0=300.0, k0=1e8, m=[], omega=[])}, "Scene of the part"),
        ({"floor": ao.SoftLayer(0.01, 1e6)}, "Floor with this layer"),
        ({"floor": ao.Hertz(1e9)}, "Floor with this law"),
        ({"modes": "x"}, "modes must be a whole number"),
        ({"modes": 10**9}, "modes must be at most 5000"),
        ({"damping": np.nan}, "ratio must be finite"),
        ({"ensemble": ao.Tilts(spin=1e9), "n": 2}, "standard deviations .* spin in rad/s"),
        ({"ensemble": ao.Tilts(height=1e12), "n": 2}, "standard deviations"),
    ],
)
def test_bad_input(change: dict[str, object], word: str) -> None:
    given = {"height": 0.1, "floor": ao.Floor(law=ao.Hertz(1e9)), "until": 1} | change
    with pytest.raises(ao.InputError, match=word):
        ao.drop(block(), **given)  # type: ignore[arg-type]


@pytest.mark.parametrize(
    ("until", "done"),
    [(3, ["0 of 3", "1 of 3", "2 of 3"]), (0.5, []), ("rest", [])],
)
def test_a_fall_tells_how_far_it_is(until, done) -> None:
    told: list[str] = []
    with progress.following_progress(told.append):
        fall = ao.drop(HARD, 0.05, floor=ao.Floor(ao.material(SOFT)), until=until)
    steps = [text for text in told if text.startswith("the fall: ")]
    impacts = [
        f"contact {c + 1} of impact {k + 1}"
        for k, g in enumerate(fall.groups)
        for c in range(len(g))
    ]
    assert len(steps) == len(impacts)
    assert all(place in text for place, text in zip(impacts, steps, strict=True))
    told = [text.split("impacts done ")[1].split(",")[0] for text in steps if "done" in text]
    assert told == done
    if until == 0.5:
        times = [int(re.search(r": (\d+) of 500 ms, ", text)[1]) for text in steps]
        touched = [1e3 * fall.episodes[i].start.time for i in range(len(steps))]
        assert times == pytest.approx(touched, abs=0.5)


def test_a_fall_tells_force_bar_and_dent_of_its_hardest_impact(monkeypatch) -> None:
    """The dent of one impact stood beside the force and the bar of another one."""
    fall = ao.drop(HARD, 0.5, floor=ao.Floor(SOFT), until=2)
    dents = [episode.history.contact_histories[0].dent for episode in fall.episodes]
    assert dents[0].depth > dents[1].depth
    for hardest in (0, 1):
        forces = [2e4 if k == hardest else 1e4 for k in range(2)]
        pairs = zip(fall.impacts, forces, strict=True)
        impacts = Impacts(replace(one, peak_force=force) for one, force in pairs)
        monkeypatch.setitem(vars(fall), "impacts", impacts)
        bar = percent(impacts[hardest].law_error)
        told = f"in impact {hardest + 1}, the hardest, the contact yields: {dents[hardest].text}, "
        assert fall.hardest == hardest
        assert fall.contact_verdict.startswith(told)
        assert f"that force may be off by {bar}" in fall.contact_verdict
        text = fall.summary()
        assert f"\nthe hardest is impact {hardest + 1}, 20.0 kN ± {bar}\n" in text
        assert dents[1 - hardest].text not in text
        found = " ".join(falls.sentences_of_fall(fall, None))
        assert dents[hardest].text in found
        assert dents[1 - hardest].text not in found


def test_channel_frequency_classes_are_those_of_j211() -> None:
    t = np.arange(0, 0.2, 1e-5)
    for name, cfc in (("CFC60", 60), ("CFC1000", 1000)):
        wave = np.sin(2 * np.pi * 5 / 3 * cfc * t)
        assert ao.cfc_filter(1e-5, wave, name)[5000:15000].max() == pytest.approx(0.7071, abs=0.005)
    with pytest.raises(ao.InputError, match="samples"):
        ao.cfc_filter(1e-3, t, "CFC180")
