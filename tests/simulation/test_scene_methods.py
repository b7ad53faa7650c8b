"""Newmark's method, the leapfrog and solve_ivp on scenes: the march's checks."""

from __future__ import annotations

import numpy as np
import pytest

import antiosc as ao
from scenes import hertz_impact

STEPS = ["newmark", "leapfrog"]


def several(law: ao.ContactLaw) -> ao.Scene:
    """A mass strikes a model that strikes a wall behind it."""
    body = ao.SiteModes([0.0, 4e3], [[1.5, 1.5], [2.0, -2.0]], ("front", "back"))
    contacts = [
        ao.Contact("body:front", "mass", law),
        ao.Contact("wall", "body:back", law, gap=2e-4),
    ]
    bodies = {"body": body, "mass": ao.RigidMass(0.3, 2.0), "wall": ao.Obstacle()}
    return ao.Scene(bodies, contacts)


def test_a_step_beyond_the_limit_of_stability_is_refused() -> None:
    with pytest.raises(ao.InputError, match="unstable"):
        several(ao.Linear(1e7)).run(0.1, method="leapfrog", step=6e-4)


@pytest.mark.parametrize("method", [*STEPS, "DOP853"])
def test_hertz_in_closed_form(method: str) -> None:
    bodies = {"m": ao.RigidMass(0.5, 1.0), "w": ao.Obstacle()}
    scene = ao.Scene(bodies, [ao.Contact("w", "m", ao.Hertz(1e9), gap=1e-4)])
    hit = scene.run(3e-3, method=method)
    peak, lasts = hertz_impact(0.5, 1.0, 1e9)
    assert hit["w", "m"].peak_force == pytest.approx(peak, rel=1e-3)
    assert hit["w", "m"].contact_time == pytest.approx(lasts, rel=1e-2)
    assert hit["w", "m"].contacts[0][0] == pytest.approx(1e-4, rel=1e-3)
    assert hit.bodies["m"].velocity()[-1] == pytest.approx(-1.0, abs=1e-3)


@pytest.mark.parametrize("method", ["newmark", "leapfrog", "DOP853"])
def test_coupling_without_mass_and_a_preload(method: str) -> None:
    """A site without inertia under a load that is released: the exact method's forces."""
    r = 1e-7 * (np.eye(2) + 0.5)
    body = ao.SiteModes([2e3, 5e3], [[1.0, 0.5], [0.2, 1.0]], ("a", "b"), r=r)
    contacts = [
        ao.Contact("body:a", "m", ao.Hertz(1e9)),
        ao.Contact("wall", "body:b", ao.Power(3e8, 1.3)),
    ]
    bodies = {"body": body, "m": ao.RigidMass(0.2, 1.0), "wall": ao.Obstacle()}
    load = ao.Load("body:b", [0, 1e-4, 2e-4], [50.0, 50.0, 0])
    scene = ao.Scene(bodies, contacts, loads=[load], preload=True, motion={"m": 1.0})
    exact, hit = scene.run(5e-4), scene.run(5e-4, method=method, tol=1e-2)
    assert exact["wall", "body:b"].force[0] > 1
    for pair in (("body:a", "m"), ("wall", "body:b")):
        one, other = exact[pair], hit[pair]
        assert other.force[0] == pytest.approx(one.force[0], rel=1e-9)
        assert other.impulse == pytest.approx(one.impulse, rel=5e-3)
        assert other.peak_force == pytest.approx(one.peak_force, rel=5e-3)
