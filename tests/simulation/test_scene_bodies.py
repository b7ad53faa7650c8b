"""Whole bodies in scenes: momentum, energy, and closed forms of what falls, spins and is struck."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray

import antiosc as ao
from antiosc.models.closed_form import UniformBeam
from scenes import hertz_impact
from struck_beams import free_free


def contact_steps(hit: ao.SceneHistory, contact: ao.ContactHistory) -> float:
    """Steps of the march in the longest contact."""
    ends = hit.time[::2]
    return max(float(np.sum((ends > a) & (ends <= b))) for a, b in contact.contacts)


def colliding_boxes(friction: float) -> ao.Scene:
    """Two boxes that tumble into each other at two corners, one after the other."""
    points = {"a": (0.03, 0.02, 0.01), "b": (0.03, -0.02, 0.01)}
    left = {name: (point, (-1.0, 0, 0)) for name, point in points.items()}
    right = {name: (point, (1.0, 0, 0)) for name, point in points.items()}
    one = ao.RigidBody(0.4, (2e-4, 3e-4, 4e-4), left)
    two = ao.RigidBody(0.7, (3e-4, 2e-4, 5e-4), right, centre=(0.06, 0, 0.005))
    contacts = [
        ao.Contact("one:a", "two:a", ao.Hertz(1e8), friction=friction),
        ao.Contact("one:b", "two:b", ao.Hertz(1e8), gap=1e-4, friction=friction),
    ]
    start = ao.Motion(velocity=(2.0, 0.5, 0), spin=(1.0, 2.0, 3.0))
    return ao.Scene({"one": one, "two": two}, contacts, motion={"one": start})


Array = NDArray[np.float64]
BAR = UniformBeam.euler_bernoulli(E=70e9, rho=2700.0, area=2e-4, inertia=1.7e-9, length=0.6)
MASS = 2700.0 * 2e-4 * 0.6


def cross_mobility(moments: Array, arm: Array, along: Array) -> float:
    """n . ((r x n) I^-1) x r of a rigid body with principal moments about its centre [1/kg]."""
    turn = np.cross(arm, along)
    return float(turn @ (turn / moments))


def test_elastic_bar_falls_and_spins_in_closed_form() -> None:
    """All that a site does not see moves as well: the hidden rigid motion, exact in flight."""
    model = free_free(BAR, 0.1).anti_oscillators(8)
    speed, spin, g = (0.0, -1.5, 0.0), (0.0, 0.0, 2.0), (0.0, -9.81, 0.0)
    bodies = {"bar": model, "floor": ao.Obstacle()}
    scene = ao.Scene(
        bodies,
        [ao.Contact("bar", "floor", ao.Hertz(1e9), gap=0.5)],
        gravity=g,
        motion={"bar": ao.Motion(velocity=speed, spin=spin)},
    )
    hit = scene.run(0.02)
    bar, t = hit.bodies["bar"], hit.time
    moved = (speed[1] + spin[2] * (0.1 - 0.3)) * t + g[1] / 2 * t**2
    np.testing.assert_allclose(bar.displacement(), moved, atol=1e-9 * np.abs(moved).max())
    P = MASS * (np.array(speed) + t[:, None] * np.array(g))
    np.testing.assert_allclose(bar.momentum, P, atol=1e-9)
    turning = MASS * 0.6**2 / 12 * spin[2]
    about = bar.angular_momentum((0.3, 0, 0))
    np.testing.assert_allclose(about[:, 2], turning, rtol=1e-9)


def test_rigid_bar_struck_at_its_end_in_closed_form() -> None:
    """Hertz's impact with the mass that the end shows: 1/m = 1/M + d^2/J = 4/M."""
    J = MASS * 0.6**2 / 12
    body = ao.RigidBody(MASS, (1e-5, J, J), {"end": ((0.3, 0, 0), (0, -1.0, 0))})
    hammer = ao.RigidMass(0.5, 2.0)
    contact = ao.Contact("bar:end", "hammer", ao.Hertz(1e9))
    hit = ao.Scene({"bar": body, "hammer": hammer}, [contact]).run(2e-3, tol=1e-6)
    reduced = 1 / (4 / MASS + 1 / 0.5)
    peak, lasts = hertz_impact(reduced, 2.0, 1e9)
    one, impulse = hit["bar:end", "hammer"], 2 * 2.0 * reduced
    assert one.peak_force == pytest.approx(peak, rel=1e-6)
    assert one.contact_time == pytest.approx(lasts, rel=1e-6)
    assert one.impulse == pytest.approx(impulse, rel=1e-6)
    bar = hit.bodies["bar"]
    np.testing.assert_allclose(bar.momentum[-1], [0, -impulse, 0], atol=1e-6 * impulse)
    np.testing.assert_allclose(
        bar.angular_momentum()[-1], [0, 0, -0.3 * impulse], atol=1e-6 * impulse
    )
    assert hit.bodies["hammer"].velocity()[-1] == pytest.approx(2.0 - impulse / 0.5, abs=2e-6)


def test_box_that_lands_on_a_corner_in_closed_form() -> None:
    """An elastic blow at a corner reverses its normal speed; the rest follows from the impulse."""
    mass, half = 1.3, np.array([0.1, 0.05, 0.03])
    moments = mass / 3 * (np.sum(half**2) - half**2)
    corner, up = np.array([-0.1, 0.05, -0.03]), np.array([0, 0, 1.0])
    body = ao.RigidBody(mass, moments, {"corner": (corner, up)})
    velocity, spin = np.array([0.5, -0.2, -1.0]), np.array([1.0, -2.0, 3.0])
    scene = ao.Scene(
        {"box": body, "floor": ao.Obstacle()},
        [ao.Contact("box:corner", "floor", ao.Hertz(3e8))],
        motion={"box": ao.Motion(velocity=velocity.tolist(), spin=spin.tolist())},
    )
    hit = scene.run(3e-3, tol=1e-6)
    closing = -(velocity + np.cross(spin, corner)) @ up
    reduced = 1 / (1 / mass + cross_mobility(moments, corner, up))
    impulse = 2 * reduced * closing
    peak, lasts = hertz_impact(reduced, closing, 3e8)
    one, box = hit["box:corner", "floor"], hit.bodies["box"]
    assert one.peak_force == pytest.approx(peak, rel=1e-6)
    assert one.contact_time == pytest.approx(lasts, rel=1e-6)
    np.testing.assert_allclose(
        box.momentum[-1], mass * velocity + impulse * up, atol=1e-6 * mass * 1.1
    )
    angular = moments * spin + impulse * np.cross(corner, up)
    np.testing.assert_allclose(box.angular_momentum()[-1], angular, atol=1e-6 * impulse * 0.1)


@pytest.mark.slow
def test_a_damped_contact_that_begins_at_rest() -> None:
    """Its damping is defined by the closing speed that is expected, for all integrators."""
    K = 1e5 * np.array([[1, -1, 0], [-1, 2, -1], [0, -1, 1.0]])
    x, phi = np.linalg.eigh(K / 0.1)
    omega = np.sqrt(np.where(np.arange(3) == 0, 0.0, x))
    chain = ao.SiteModes(omega, phi[[0, 2]].T / np.sqrt(0.1), ("near", "far"))
    scene = ao.Scene(
        {"chain": chain, "floor": ao.Obstacle()},
        [ao.Contact("floor", "chain:near", ao.HuntCrossley(1e8, 0.5), gap=0.0)],
        loads=[ao.Load("chain:far", [0.0, 1e-3, 2e-3], [0.0, 50.0, 0.0])],
    )
    hit = scene.run(5e-3)
    other = scene.run(5e-3, method="newmark", tol=2e-3)
    assert hit.status == 3  # the contact goes on at the end
    assert hit.run.attempts < 2000
    one, two = hit["floor", "chain:near"], other["floor", "chain:near"]
    assert one.peak_force == pytest.approx(two.peak_force, rel=5e-3)
    assert one.impulse == pytest.approx(two.impulse, rel=5e-3)


@pytest.mark.parametrize("n", [1, 12])
def test_elastic_bar_lands_on_its_end(n: int) -> None:
    """The floor's impulse is all that the bar gains, along the contact and about any point."""
    model = free_free(BAR, 0.0).anti_oscillators(n)
    contact = ao.Contact("bar", "floor", ao.Hertz(2e9))
    start = ao.Motion(velocity=(0, -1.0, 0), spin=(0, 0, 1.5))
    scene = ao.Scene({"bar": model, "floor": ao.Obstacle()}, [contact], motion={"bar": start})
    hit = scene.run(2e-3)
    one, bar = hit["bar", "floor"], hit.bodies["bar"]
    assert one.peak_force > 100
    P, about = bar.momentum, bar.angular_momentum((0.0, 0, 0))
    np.testing.assert_allclose(P[-1] - P[0], [0, one.impulse, 0], atol=1e-10 * one.impulse)
    np.testing.assert_allclose(about, np.broadcast_to(about[0], about.shape), atol=1e-10)
    assert contact_steps(hit, one) < 130
    assert hit.energy.drift < 1e-4


@pytest.mark.parametrize("friction", [0.0, 0.3])
def test_boxes_that_collide_at_two_points(friction: float) -> None:
    hit = colliding_boxes(friction).run(3e-3)
    P = sum(body.momentum for body in hit.bodies.values())
    L = sum(body.angular_momentum() for body in hit.bodies.values())
    np.testing.assert_allclose(P, np.broadcast_to(P[0], P.shape), atol=1e-10 * np.abs(P).max())
    np.testing.assert_allclose(L, np.broadcast_to(L[0], L.shape), atol=1e-10 * np.abs(L).max())
    for pair in (("one:a", "two:a"), ("one:b", "two:b")):
        assert hit[pair].peak_force > 10
        assert friction == 0 or np.abs(hit[pair].friction).max() > 1
        assert contact_steps(hit, hit[pair]) < 130
    assert hit.energy.drift < 1e-4
