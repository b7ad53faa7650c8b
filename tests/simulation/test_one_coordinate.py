"""Bodies of one coordinate between sites that point along different directions."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

import antiosc as ao

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


def test_masses_that_touch_share_their_axis() -> None:
    """A chain of two between opposite sites keeps the momentum along y."""
    bodies = {"m": ao.RigidMass(0.1, 1.0), "n": ao.RigidMass(0.2, 0.0)}
    hit = between(bodies, DOWN).run(4e-3)
    m, n = (hit.bodies[name].momentum for name in bodies)
    given = hit["B:tip", "n"].impulse - hit["A:tip", "m"].impulse
    assert hit["m", "n"].peak_force > 10
    assert hit["B:tip", "n"].peak_force > 10
    assert (m + n)[-1] - (m + n)[0] == pytest.approx(given, abs=1e-9)


def test_a_mass_is_not_pressed_along_two_lines() -> None:
    with pytest.raises(ao.InputError, match=r"0.0, 1.0, 0.0.*RigidBody|RigidBody.*0.0, 1.0, 0.0"):
        between({"m": ao.RigidMass(0.1, 1.0)}, Z).run(1e-3)
