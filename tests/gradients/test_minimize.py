"""`minimize` on impacts whose optimum is known."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

import antiosc as ao

WALL = ao.AntiOscillators(m0=1e6, k0=1e12, m=[], omega=[])


def mass_on_a_wall(x: np.ndarray) -> tuple[Any, ...]:
    """Mass and speed on a wall: F = v sqrt(k m)."""
    return WALL, ao.RigidMass(x[0], x[1]), ao.Linear(1e6), 0.02


def test_a_mass_with_given_momentum_is_best_heavy_and_slow() -> None:
    """With m v = 1 the force is sqrt(k/m): least for the largest mass."""
    rule = {"type": "eq", "fun": lambda x: x[0] * x[1] - 1.0}
    found = ao.minimize(mass_on_a_wall, "peak_force", [0.5, 2.0], [(0.1, 2.0), (0.1, 10.0)], rule)
    assert found.converged
    assert found.x == pytest.approx([2.0, 0.5], rel=1e-4)
    assert found.value == pytest.approx((1e6 / 2) ** 0.5, rel=1e-4)
    assert found.hit.peak_force == pytest.approx(found.value, rel=1e-12)
    assert found.runs < 20


def test_two_springs_in_series_are_stiffest_when_equal() -> None:
    """A massless support k x and a contact k (1 - x): the contact time is least at x = 1/2."""

    def build(x: np.ndarray) -> tuple[Any, ...]:
        model = ao.AntiOscillators(m0=0.0, k0=2e6 * x[0], m=[], omega=[])
        return model, ao.RigidMass(0.2, 1.0), ao.Linear(2e6 * (1 - x[0])), 0.02

    found = ao.minimize(build, "contact_time", [0.2], [(0.05, 0.95)])
    assert found.x == pytest.approx([0.5], abs=2e-3)
    assert found.value == pytest.approx(np.pi * (0.2 / 5e5) ** 0.5, rel=1e-4)


def test_refused() -> None:
    with pytest.raises(ao.InputError, match="duration"):
        ao.minimize(lambda x: (WALL,), "peak_force", [1.0])  # type: ignore[arg-type]
    with pytest.raises(ao.InputError, match="goal"):
        ao.minimize(mass_on_a_wall, "force", [1.0, 1.0])
    with pytest.raises(ao.InputError, match="bounds"):
        ao.minimize(mass_on_a_wall, "peak_force", [1.0, 1.0], [(0, 1)])
