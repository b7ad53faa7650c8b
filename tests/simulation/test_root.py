"""Root finding of touch and release: closed forms, hard cases, one function and many."""

from __future__ import annotations

import numpy as np
import pytest

import antiosc as ao
from antiosc.simulation.integrators.many import _rising_root
from antiosc.simulation.integrators.root import rising_root

# value, slope, bracket, root
CASES = {
    "straight": (lambda t: t - 0.3, lambda t: 1.0 + 0 * t, (0.0, 1.0), 0.3),
    "sine": (lambda t: np.sin(t) - 0.5, np.cos, (0.0, 1.5), np.pi / 6),
    "tiny scale": (lambda t: 1e-9 * t - 1e-24, lambda t: 1e-9 + 0 * t, (0.0, 1e-6), 1e-15),
    "Newton leaves": (lambda t: np.arctan(40 * (t - 1)), None, (-30.0, 20.0), 1.0),
    "flat": (lambda t: (t - 0.7) ** 3, lambda t: 3 * (t - 0.7) ** 2, (0.0, 1.0), 0.7),
    "slope of the wrong sign": (lambda t: t**3 - t - 1, lambda t: 3 * t * t - 1, (-1, 2.0), None),
    "no sign change, below": (lambda t: t - 2.0, lambda t: 1.0 + 0 * t, (0.0, 1.0), 1.0),
    "no sign change, above": (lambda t: t + 2.0, lambda t: 1.0 + 0 * t, (0.5, 1.0), 0.5),
}
cases = pytest.mark.parametrize(("value", "slope", "ends", "root"), CASES.values(), ids=CASES)


def complete(slope, root):
    """What the table leaves out."""
    if slope is None:
        slope = lambda t: 40 / (1 + (40 * (t - 1)) ** 2)  # noqa: E731
    if root is None:
        root = float(np.roots([1, 0, -1, -1]).real.max())
    return slope, root


@cases
@pytest.mark.parametrize("start", [0.0, 0.5, 0.999])
def test_one(value, slope, ends, root, start):
    slope, root = complete(slope, root)
    calls = []

    def f(t):
        calls.append(t)
        return value(t), slope(t)

    low, high = ends
    found = rising_root(f, low, high, low + start * (high - low))
    width = 1e-5 if value(root) == 0 and slope(root) == 0 else 1e-14  # a triple root has no more
    assert found == pytest.approx(root, rel=1e-14, abs=width * (high - low))
    assert len(calls) < 200
    assert all(low <= t <= high for t in calls)


@cases
def test_many(value, slope, ends, root):
    """Shifted copies side by side, each in its own bracket."""
    slope, root = complete(slope, root)
    shift = np.linspace(0.0, 3.0, 7)
    low, high = ends[0] + shift, ends[1] + shift
    found = _rising_root(lambda t: (value(t - shift), slope(t - shift)), low, high)
    width = 1e-5 if value(root) == 0 and slope(root) == 0 else 1e-14
    assert found - shift == pytest.approx(root, abs=max(width * (high - low).max(), 1e-14))


def test_smooth_roots_take_few_evaluations():
    calls = []

    def f(t):
        calls.append(t)
        return np.sin(t) - 0.5, np.cos(t)

    rising_root(f, 0.0, 1.0, 0.5)
    assert len(calls) <= 4


def test_bodies_part_where_the_law_ends():
    """At release the indentation is the law's origin, here 0."""
    model = ao.AntiOscillators(k0=1e5, m0=0.05, m=[0.02, 0.05], omega=[1.5e3, 6e3])
    hit = ao.simulate(model, ao.RigidMass(0.1, 1.0), ao.Hertz(1.55e8), 5e-3, step=4e-6)
    assert hit.trajectory.contacts[0].released
    last = hit.trajectory.segments[hit.trajectory.contacts[0].segments[1] - 1]
    q, _ = last.states()
    depth = hit.problem.approach(q[-1])
    assert abs(depth) <= 1e-13 * hit.indentation.max()
