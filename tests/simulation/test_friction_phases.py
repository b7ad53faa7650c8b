"""Friction that reverses, sticks and slips again: phases located as touches are.

The truth of `sliding` integrates each phase by itself with located events.
"""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

import antiosc as ao
from sliding import Scene, Truth, errors, random_scene, run_scene


def released(start: float, stiffness: float, duration: float) -> Scene:
    """1 kg on 1e4 N/m, pressed by 10 N, with a coefficient of friction of 0.1."""
    return Scene(1.0, (1e4,), (start,), 10.0, 1e6, 0.0, 0.1, stiffness, duration)


SEEDS = [(0, 1e-3), (2, 1e-3), (19, 1e-6), (63, 1e-5)]


@pytest.mark.slow
@pytest.mark.parametrize(("seed", "tol"), SEEDS)
def test_errors_keep_the_tolerance_and_the_claims(seed: int, tol: float) -> None:
    """Steady, vibrating and bouncing normal forces, in one and two directions."""
    scene = random_scene(seed)
    found = run_scene(scene, tol)
    error = errors(Truth(scene), found)
    assert max(error.force, error.peak, error.way) <= tol
    assert error.force <= found.force_error
    assert max(error.force, error.peak) <= found.peak_error


@pytest.mark.slow
def test_a_reversal_is_located() -> None:
    """16 reversals: each lets the spring of friction turn by 2 mu N."""
    scene = released(8.5e-3, 1e5, 0.5)
    found = run_scene(scene, 1e-6)
    assert found.run.depth[-1, 1] == pytest.approx(5.147e-3, abs=2e-6)
    assert errors(Truth(scene), found).way <= 1e-6


@pytest.mark.slow
def test_coulombs_oscillator() -> None:
    """Each half swing is shorter by 2 mu N/k: code_aster SDND100 (recalled), but for the spring.

    With a spring of friction of 4e5 N/m the exact motion is 4.3 % off the last of its values.
    """
    times = np.pi / 100 * np.arange(1, 5)
    scene = released(8.5e-4, 4e5, times[-1])
    found = run_scene(scene, 1e-4)
    x = np.interp(times, found.run.time, found.run.depth[:, 1])
    np.testing.assert_allclose(x, Truth(scene).at(times)[1][:, 0], rtol=0, atol=2e-7)
    np.testing.assert_allclose(x, [-6.5e-4, 4.5e-4, -2.5e-4, 0.5e-4], rtol=0, atol=2.5e-6)


@pytest.mark.parametrize("stiffness", [1e10, 1e12, 1e13, 1e14, 1e15])
def test_a_stiff_law_on_a_point_without_mass_parts_once(stiffness: float) -> None:
    """Two touches, as with a law a thousand times softer, that last as long."""
    model: Any = ao.AntiOscillators(m0=0.0, k0=1e6, m=[0.1, 0.05], omega=[1e3, 6e3])
    hits = [
        ao.simulate(model, ao.RigidMass(0.1, 1.0), ao.Linear(k), 8e-3) for k in (1e11, stiffness)
    ]
    one, other = [np.diff(np.array(hit.contacts), axis=1).ravel() for hit in hits]
    assert one.size == other.size == 2
    np.testing.assert_allclose(one, other, rtol=2e-3)
