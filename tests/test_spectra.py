"""Shock response spectra against integrations and closed forms."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.sparse import csr_array

import antiosc as ao

WIDTH = 1e-3


def half_sine(n: int = 101):
    t = np.linspace(0, WIDTH, n)
    return t, 500 * np.sin(np.pi * t / WIDTH)


def integrated(t, a, f: float, Q: float) -> tuple[float, float]:
    """Extreme absolute accelerations by DOP853, from sample to sample and one period beyond."""
    w = 2 * np.pi * f

    def slope(now, y):  # relative motion z of the mass, z'' = -a - w z'/Q - w² z
        base = np.interp(now, t, a, left=0, right=0)
        return [y[1], -base - w / Q * y[1] - w * w * y[0]]

    found = []
    y = np.zeros(2)
    for start, end in zip(t, [*t[1:], t[-1] + 1 / f], strict=True):
        inner = np.linspace(start, end, 400 if start == t[-1] else 20)
        y = solve_ivp(slope, (start, end), y[:, -1] if y.ndim > 1 else y, "DOP853", inner,
                      rtol=1e-10, atol=1e-12).y  # fmt: skip
        found.append(-(w / Q * y[1] + w * w * y[0]))
    every = np.concatenate(found)
    return every.max(), -every.min()


@pytest.mark.parametrize("Q", [3.0, 50.0])
@pytest.mark.parametrize("even", [True, False])
def test_srs_is_the_extreme_of_integrated_oscillators(Q, even):
    rng = np.random.default_rng(0)
    t = np.linspace(0, 2e-3, 21)
    if not even:
        t = np.sort(np.append(rng.uniform(0, 2e-3, 30), [0, 2e-3]))
    a = rng.standard_normal(t.size)
    a[0] = a[-1] = 0
    frequencies = [200.0, 900.0, 3000.0]
    found = ao.srs(t, a, frequencies, Q)
    for i, f in enumerate(frequencies):
        exact = integrated(t, a, f, Q)
        tol = 2e-3 if even else 2e-2  # unequal samples are interpolated
        assert found.positive[i] == pytest.approx(exact[0], rel=tol)
        assert found.negative[i] == pytest.approx(exact[1], rel=tol)
        assert found.maximax[i] == pytest.approx(max(exact), rel=tol)


def test_velocities_have_the_spectrum_that_samples_of_accelerations_miss():
    """A slow vibration below a strong one that the samples turn into one of 600 Hz."""
    fine, coarse = np.linspace(0, 5e-3, 100_001), np.linspace(0, 5e-3, 2001)
    w = 2 * np.pi * (4e5 + 600)

    def acceleration(t):
        return np.sin(2 * np.pi * 300 * t) + 10 * np.cos(w * t)

    def velocity(t):
        return -np.cos(2 * np.pi * 300 * t) / (2 * np.pi * 300) + 10 * np.sin(w * t) / w

    frequencies = [200.0, 300.0, 1000.0]
    exact = ao.srs(fine, acceleration(fine), frequencies).maximax
    found = ao.srs(coarse, velocity(coarse), frequencies, signal="velocity").maximax
    np.testing.assert_allclose(found, exact, rtol=0.03)
    assert np.abs(ao.srs(coarse, acceleration(coarse), frequencies).maximax / exact).max() > 3


def test_frequencies_end_where_a_model_resolves_no_more():
    t, a = half_sine()
    assert ao.srs(t, a, resolved=2500.0).frequency[-1] == pytest.approx(2500.0)
    assert ao.srs(t, a, resolved=float("inf")).frequency[-1] == ao.srs(t, a).frequency[-1]


def test_the_resolved_frequency_is_that_of_converged_antiresonances():
    """A chain of springs and masses: its antiresonances are those of the chain held at its end."""
    size = 60
    K = 1e8 * (2 * np.eye(size) - np.eye(size, k=1) - np.eye(size, k=-1))
    K[-1, -1] = 1e8
    part = ao.Structure.from_matrices(csr_array(K), csr_array(0.1 * np.eye(size)), backend="scipy")
    model = ao.extract(part, ao.Site(dof=size - 1), n=20)
    held = np.sqrt(np.linalg.eigvalsh(K[:-1, :-1] / 0.1)) / (2 * np.pi)
    top = ao.resolved_frequency(model)
    assert top > 0
    assert np.abs(held / top - 1).min() < 1e-4
    hit = ao.simulate(model, ao.RigidMass(1.0, 1.0), ao.Hertz(1e9), 1e-3)
    assert ao.resolved_frequency(hit) == top
    assert ao.resolved_frequency(ao.full(part, ao.Site(dof=size - 1))) == float("inf")
    with pytest.raises(ao.InputError, match="superposition"):
        ao.resolved_frequency(ao.AntiOscillators(m0=0.1, k0=1e6, m=[0.3], omega=[2e3]))


def test_srs_of_a_half_sine_has_its_limits():
    """Slow oscillators feel the impulse, ωΔv; fast ones the signal itself; 1.77 times between."""
    t, a = half_sine(401)
    found = ao.srs(t, a, [1.0, 0.8 / WIDTH, 200 / WIDTH], Q=1e4)
    impulse = 500 * 2 * WIDTH / np.pi
    assert found.maximax[0] == pytest.approx(2 * np.pi * impulse, rel=1e-3)
    assert found.maximax[1] == pytest.approx(1.768 * 500, rel=2e-3)
    assert found.maximax[2] == pytest.approx(500, rel=1e-2)


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ({"t": [0.0, 2.0, 1.0], "a": [0.0, 1.0, 0.0]}, "ascend"),
        ({"t": [0.0], "a": [1.0]}, "two samples"),
        ({"t": [0.0, 1.0], "a": [0.0, 1.0, 2.0]}, "signal"),
        ({"t": [0.0, 1.0], "a": [0.0, 1.0], "frequencies": [0.0]}, "frequencies must be > 0"),
        ({"t": [0.0, 1.0], "a": [0.0, 1.0], "Q": 0.5}, "above 0.5"),
        ({"t": [0.0, 1.0], "a": [0.0, 1.0], "frequencies": [1e9]}, "samples, more than"),
    ],
)
def test_what_is_no_signal_is_refused(arguments, message):
    with pytest.raises(ao.InputError, match=message):
        ao.srs(**arguments)


@pytest.mark.parametrize("even", [True, False])
def test_srs_of_velocities_is_that_of_the_mean_accelerations(even):
    """Against integrations with the acceleration that is constant in each step."""
    rng = np.random.default_rng(3)
    t = np.linspace(0, 2e-3, 41) if even else np.cumsum([0, *rng.choice([1e-5, 4e-5], 60)])
    v = np.cumsum(rng.standard_normal(t.size))
    v[-1] = v[0] = 3.0
    steps = np.repeat(np.diff(v) / np.diff(t), 2)
    edges = np.sort([*t[:-1], *(t[1:] - 1e-12)])
    edges[0], edges = 0.0, np.append(edges, t[-1])
    for f in (300.0, 2000.0):
        exact = integrated(edges, np.append(steps, 0.0), f, 10.0)
        found = ao.srs(t, v, [f], signal="velocity")
        assert found.positive[0] == pytest.approx(exact[0], rel=3e-3)
        assert found.negative[0] == pytest.approx(exact[1], rel=3e-3)


def test_srs_of_a_step_overshoots_by_its_damping():
    """Absolute acceleration 1 + exp(−ζπ/√(1−ζ²)) cos … of a base that starts suddenly: Q large."""
    t = np.linspace(0, 1, 1001)
    found = ao.srs(t, np.ones_like(t), [5.0], Q=1e5)
    assert found.positive[0] == pytest.approx(2.0, rel=1e-3)


def test_a_shock_spectrum_of_almost_no_damping_is_finite():
    t = np.linspace(0.0, 0.01, 101)
    found = ao.srs(t, np.sin(1e3 * t), frequencies=[50.0, 500.0], Q=1e50)
    assert np.isfinite(found.positive).all()


@pytest.mark.parametrize("resolved", [np.ones(3), [1.0, 2.0], None, "all"])
def test_a_resolved_frequency_that_is_no_number_is_refused(resolved):
    with pytest.raises(ao.InputError, match="resolved must be a number"):
        ao.srs([0.0, 0.1], [0.0, 1.0], resolved=resolved)
