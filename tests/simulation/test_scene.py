"""Scenes of several contacts: against closed forms and solve_ivp on the physical system."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.integrate import solve_ivp

import antiosc as ao
from direct import force_error, physical
from scene_cases import CORNERS, plate, stops
from scenes import hertz_impact

Array = NDArray[np.float64]
UP = (0.0, 0.0, 1.0)


@pytest.mark.sample
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
