"""Parts of the march against closed forms: responses, crossings, the mass that a blow meets."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import pytest
from scipy.integrate import trapezoid

import antiosc as ao
from antiosc.simulation import compilation, convergence, engine, march
from antiosc.simulation.assembly import assemble
from antiosc.simulation.convergence import converge, difference, left
from antiosc.simulation.march.course import mass_felt
from antiosc.simulation.march.crossings import crossing, polished
from antiosc.simulation.march.curves import table_at
from antiosc.simulation.march.responses import responses, responses_twice
from antiosc.simulation.march.tables import moves, push
from antiosc.simulation.refinement import start
from marches import written_out
from scenes import HERTZ, case_two


def test_a_step_and_its_half_share_their_sines() -> None:
    omega = np.array([0.0, 1e-3, 0.3, 2.0, 40.0, 7.0])
    decay = np.array([0.0, 0.0, 0.0, 0.0, 0.0, 0.5])
    whole, half, one, other = (np.empty((6, omega.size)) for _ in range(4))
    responses_twice(omega, decay, 1.3, whole, half)
    responses(omega, decay, 1.3, one)
    responses(omega, decay, 0.65, other)
    np.testing.assert_allclose(whole, one, rtol=1e-13, atol=1e-15)
    np.testing.assert_allclose(half, other, rtol=1e-13, atol=1e-15)


def test_a_mode_over_a_step_under_a_parabola() -> None:
    """q'' + w^2 q = -(a + b t + c t^2/2), solved by hand; rows of zeros add nothing."""
    w, h, (a, b, c), (q, v) = 3.0, 0.7, (2.0, -5.0, 11.0), (0.3, -0.8)
    omega, beta = np.array([w]), np.array([[1.0], [0.0]])
    table, move = np.empty((1, 6, 1)), np.empty((1, 8, 2, 1))
    responses(omega, np.zeros(1), h, table[0])
    moves(0, omega, beta, table, move)
    x = np.array([[q], [v]])
    push(move[0], np.array([[a, 9.0], [b, 9.0], [c, 9.0]]), x)

    def rest(t: float) -> np.ndarray:  # a particular solution and its rate
        value = -(a + b * t + c * t * t / 2 - c / w**2) / w**2
        return np.array([value, -(b + c * t) / w**2])

    free = np.array([q, v]) - rest(0.0)
    cosine, sine = np.cos(w * h), np.sin(w * h)
    turned = np.array([[cosine, sine / w], [-w * sine, cosine]]) @ free
    np.testing.assert_allclose(x[:, 0], turned + rest(h), rtol=1e-13)


def test_a_crossing_is_that_of_the_polynomial() -> None:
    p = np.polynomial.Polynomial([1.0, 2.0, -7.0, 3.0, -1.0, 0.5])
    d, h, at = p.deriv(), 0.3, 0.28
    bound = float(p(at))
    cubic = crossing(p(h / 2), d(h / 2), p(h), d(h), h / 2, bound) + h / 2
    values = [f(t) for t in (0.0, h / 2, h) for f in (p, d)]
    assert cubic == pytest.approx(at, rel=1e-3)
    assert abs(cubic - at) > 1e-7
    assert polished(cubic, *values, h, bound) == pytest.approx(at, rel=1e-10)
    assert polished(0.05, *values, h, 5.0) == 0.05  # no crossing: left as it was


@pytest.mark.parametrize("t", [1e-5, 1e-2])
def test_a_rigid_mass_and_a_spring_feel_a_force_as_they_do(t: float) -> None:
    """A mass alone is felt whole; on a spring the motion under a force is (1 - cos wt) F/k."""
    none = np.zeros((1, 1))
    modes = (np.zeros(1), np.zeros(1), np.array([[0.5]]), none)
    assert mass_felt(0, t, modes) == pytest.approx(4.0)
    w = 300.0
    modes = (np.array([w]), np.zeros(1), np.array([[0.5]]), none)
    way = 0.25 * (1 - np.cos(w * t)) / w**2
    assert mass_felt(0, t, modes) == pytest.approx(0.5 * t * t / way, rel=1e-9)


def test_two_runs_serve_a_smooth_blow(monkeypatch) -> None:
    model, mass = case_two(9)
    scene = ao.Scene({"a": model, "b": mass}, [ao.Contact("a", "b", ao.Hertz(HERTZ))])
    made = assemble(scene, 1e-3)
    start(made)
    shares = []

    def run(system, duration, share, **how):
        shares.append(share)
        return engine.run(system, duration, share, **how)

    monkeypatch.setattr(convergence, "run", run)
    tol = 1e-2
    found = converge(made.system, made.laws, made.lasting, 1e-3, tol, 100, 10**6)
    assert shares == [tol * convergence.FIRST, tol * convergence.FIRST / convergence.SECOND]
    assert max(found.force, found.peak) <= tol


@pytest.mark.parametrize("finer", [2.0, 4.0, 8.0])
def test_what_is_left_of_a_difference(finer: float) -> None:
    """Errors e and e/f differ by e - e/f, of which the finer has 1/(f - 1)."""
    assert left(finer, rated=False) == pytest.approx(convergence.MARGIN / (finer - 1))
    assert left(finer**3, rated=True) == pytest.approx(convergence.MARGIN / (finer - 1))


@pytest.mark.parametrize("by_numba", [False, pytest.param(True, marks=pytest.mark.slow)])
def test_compiled_differences_and_energies_are_those_of_numpy(monkeypatch, by_numba) -> None:
    if by_numba:
        pytest.importorskip("numba")
    model, mass = case_two(9)
    scene = ao.Scene({"a": model, "b": mass}, [ao.Contact("a", "b", ao.Hertz(HERTZ))])
    made = assemble(scene, 2e-3)
    compiled = compilation.compiled_march() if by_numba else written_out()
    if compiled is None:
        pytest.skip("numba does not work here")
    runs = [engine.run(made.system, 2e-3, share, fine=made.lasting / 200) for share in (0.1, 1e-2)]
    found = {}
    for module in (march, compiled):
        monkeypatch.setattr(convergence, "fitting_march", lambda _, module=module: module)
        found[module] = [difference(*runs, tol) for tol in (1e-3, 1.0)]
    np.testing.assert_allclose(found[compiled], found[march], rtol=1e-10)
    assert found[march][0][2] < found[march][1][2] == 2e-3
    assert runs[0].states is not None
    energies = np.empty((2, len(runs[0].states)))
    march.energies(runs[0].states, made.system.omega, energies[0])
    compiled.energies(runs[0].states, made.system.omega, energies[1])
    np.testing.assert_allclose(energies[1], energies[0], rtol=1e-12)


def free_flight(module, seed: int, damped: bool) -> list[float]:
    """`chord` of arrays at random, by the loops or by NumPy."""
    rng = np.random.default_rng(seed)
    omega = np.array([0.0, 3.0, 40.0, 900.0])
    decay = 0.4 * omega if damped else np.zeros(4)
    work: list[object] = [None] * 13
    levels = march.LEVELS
    work[9], work[10] = rng.uniform(0.1, 1, (2, 4)), rng.uniform(0.1, 1, 2)
    work[11], work[12] = np.zeros((levels + 1, 2)), np.zeros(levels + 1, dtype=np.int64)
    modes = (omega, decay, None, None)
    chord, spans = module.flight.chord, (1e-3, 0.05, 2.0)
    return [chord(c, levels, h, modes, work) for c in (0, 1) for h in spans]


@pytest.mark.parametrize("damped", [False, True])
def test_a_chord_misses_no_more_than_its_curvature_and_twice_its_amplitude(damped) -> None:
    """Σ swing min(2, ω (ω + 2 d) h²/8) and what has no frequency, by both branches."""
    rng = np.random.default_rng(5)
    swing, bend = rng.uniform(0.1, 1, (2, 4)), rng.uniform(0.1, 1, 2)
    omega = np.array([0.0, 3.0, 40.0, 900.0])
    growth = omega * (omega + 2 * (0.4 * omega if damped else 0.0))
    expected = [
        bend[c] * h**2 / 8 + sum(swing[c] * np.minimum(2.0, growth * h**2 / 8))
        for c in (0, 1)
        for h in (1e-3, 0.05, 2.0)
    ]
    for module in (march, written_out()):
        np.testing.assert_allclose(free_flight(module, 5, damped), expected, rtol=1e-12)


@pytest.mark.parametrize("module", ["numpy", "loops"])
def test_the_difference_of_two_runs_is_the_integral_of_its_square(monkeypatch, module) -> None:
    """Runs of parabolas on unlike nodes, forces from the first node on; by trapezoids between."""
    other = march if module == "numpy" else written_out()
    monkeypatch.setattr(convergence, "fitting_march", lambda _: other)
    time = np.array([0.0, 0.1, 0.2, 0.45, 0.7, 0.85, 1.0]), np.array([0.0, 0.3, 0.6, 0.8, 1.0])
    rng = np.random.default_rng(8)
    force = [rng.uniform(1.0, 3.0, (t.size, 2)) for t in time]
    a, b = (SimpleNamespace(time=t, force=f) for t, f in zip(time, force, strict=True))

    def at(k: int, t: float) -> np.ndarray:
        start = min(2 * int(np.searchsorted(time[k][2::2], t)), time[k].size - 3)
        x, y = time[k][start : start + 3], force[k][start : start + 3]
        u = (t - x[0]) / (x[2] - x[0])
        return y[0] * (1 - u) * (1 - 2 * u) + 4 * y[1] * u * (1 - u) + y[2] * u * (2 * u - 1)

    nodes = np.sort(np.concatenate(time))
    apart = [((at(0, t) - at(1, t)) ** 2).sum() for t in nodes]
    size = [(at(1, t) ** 2).sum() for t in nodes]
    peaks = np.array([[abs(at(k, t)) for t in nodes] for k in (0, 1)]).max(axis=1)
    expected = np.sqrt(trapezoid(apart, nodes) / trapezoid(size, nodes))
    found = difference(a, b, 10.0)
    assert found[0] == pytest.approx(expected, rel=1e-12)
    assert found[1] == pytest.approx(abs(peaks[0] - peaks[1]).max() / peaks[1].max(), rel=1e-12)
    assert found[2] == 1.0
    until = difference(a, b, 0.5 * expected)[2]
    used = np.concatenate([[0], np.cumsum(np.diff(nodes) * (np.array(apart)[1:] + apart[:-1]) / 2)])
    limit = 0.25 * expected**2 * trapezoid(size, nodes)
    assert until == nodes[np.flatnonzero(used > limit)[0]]


@pytest.mark.parametrize("x", [-0.3, 0.0, 0.25, 0.5, 0.8, 1.5, 1.9, 2.0, 2.7])
def test_a_table_is_its_cubic_and_a_straight_line_beyond(x) -> None:
    """Packed from x³ on three knots, behind two other parameters."""
    knots = np.array([0.0, 0.5, 2.0])
    packed = [np.array([7.0, 7.0]), knots, np.ones(3), 3 * knots, 3 * knots**2, knots**3]
    found = table_at(np.concatenate([*packed, np.array([8.0, 12.0])]), 2, 3, x)
    inside, beyond = min(max(x, 0.0), 2.0), max(x - 2.0, 0.0)
    np.testing.assert_allclose(found, [inside**3 + 12 * beyond, 3 * inside**2], rtol=1e-12)
