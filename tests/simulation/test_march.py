"""Parts of the march against closed forms: responses, crossings, chords, errors, differences."""

from __future__ import annotations

import ctypes
from math import inf
from types import SimpleNamespace

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.integrate import solve_ivp, trapezoid

import antiosc as ao
from antiosc.engine import library, march
from antiosc.engine.march import converge, difference
from antiosc.engine.system import System
from antiosc.impact.assembly import assemble_scene
from antiosc.impact.scene import set_initial_forces
from march_audit import motion
from march_builds import Stepper, built, doubles, law_at
from scenes import HERTZ, case_two

Array = NDArray[np.float64]
OMEGA, DECAY = np.array([0.0, 300.0, 2e3, 9e3, 3e4]), np.array([0.0, 4.0, 0.0, 90.0, 0.0])
LOW, HIGH, SLOW, FAST = range(4)  # the bounds of a branch


def system(laws: list[ao.ContactLaw], **given: Array) -> System:
    """Modes, loads and gaps at random for the laws."""
    rng, p = np.random.default_rng(3), len(laws)
    a = rng.normal(size=(p, p))
    own = {
        "omega": OMEGA, "decay": DECAY, "beta": rng.normal(size=(p, OMEGA.size)),
        "R": 1e-7 * a @ a.T, "breaks": np.array([0.0, 0.2, 0.7]),
        "loads": rng.normal(size=(3, OMEGA.size)), "offsets": rng.normal(size=(3, p)) * 1e-6,
        "q": rng.normal(size=OMEGA.size) * 1e-5, "v": rng.normal(size=OMEGA.size),
    }  # fmt: skip
    return System(
        **{**own, **given}, laws=laws, slip=np.zeros((p, 2)), tangents=np.array([[p, 0]] * p),
        mass=np.ones(p), depth=np.full(p, 1e-4), speed=np.full(p, 2.0), pressed=np.zeros(p),
    )  # fmt: skip


@pytest.mark.slow
def test_the_structures_have_the_sizes_of_the_librarys() -> None:
    sizes = (ctypes.c_size_t * 15)()
    built().part_sizes(sizes)
    mirrored = (library.UserLaw, library.CLaw, library.CContact, library.CSystem)
    mirrored += (
        library.COptions,
        library.CRecord,
        library.CSummary,
        library.CDifference,
        library.CSolution,
    )
    expected = [ctypes.sizeof(each) for each in mirrored]
    expected += [library.TOUCH.itemsize]
    batches = (
        library.CNumbers,
        library.CImpact,
        library.CExpected,
        library.COutcome,
        library.CPulseNodes,
    )
    assert list(sizes) == [*expected, *map(ctypes.sizeof, batches)]


@pytest.mark.slow
def test_a_crossing_is_that_of_the_polynomial() -> None:
    parts, p = built(), np.polynomial.Polynomial([1.0, 2.0, -7.0, 3.0, -1.0, 0.5])
    d, h, at = p.deriv(), 0.3, 0.28
    bound, y, s = float(p(at)), *(doubles([f(t) for t in (0.0, h / 2, h)]) for f in (p, d))
    cubic = parts.part_crossing(y[1], s[1], y[2], s[2], h / 2, bound) + h / 2
    assert cubic == pytest.approx(at, rel=1e-3)
    assert abs(cubic - at) > 1e-7
    assert parts.part_polished(cubic, y, s, h, bound) == pytest.approx(at, rel=1e-10)
    assert parts.part_polished(0.05, y, s, h, 5.0) == 0.05  # no crossing: left as it was


def test_the_misfit_of_a_cubic_is_its_distance_from_the_parabola() -> None:
    """On the nodes 0, h/2, h, with a value half a step before; a force that begins as t^(3/2)."""
    rng, t, misfit = np.random.default_rng(0), np.linspace(0, 1, 20_001), built().part_misfit
    for before, h in ((1.0, 1.0), (0.3, 0.9), (2.0, 0.4)):
        cubic = np.polynomial.Polynomial(rng.normal(size=4))
        earlier, *nodes = cubic(np.array([-before / 2, 0.0, h / 2, h]))
        parabola = np.polynomial.Polynomial.fit([0, h / 2, h], nodes, 2)
        worst = np.abs(cubic(h * t) - parabola(h * t)).max()
        assert misfit(earlier, doubles(nodes), before, h, 0) == pytest.approx(worst, rel=2e-3)
    nodes = np.array([0.0, 0.5, 1.0]) ** 1.5
    worst = np.abs(t**1.5 - np.polynomial.Polynomial.fit([0, 0.5, 1], nodes, 2)(t)).max()
    assert worst < misfit(9.0, doubles(nodes), 1.0, 1.0, 1) < 1.35 * worst


def test_a_chord_misses_no_more_than_its_curvature_and_twice_its_amplitude() -> None:
    """Σ swing min(2, ω (ω + 2 d) h²/8), with the amplitudes about where the loads hold the modes;
    of what has no frequency the largest acceleration."""
    s = system([ao.Linear(1.0), ao.Linear(1.0)])
    load, rise = s.loads[0], (s.loads[1] - s.loads[0]) / 0.2
    square = np.where(OMEGA > 0, OMEGA, 1.0) ** 2
    rest = (load - 2 * DECAY * rise / square) / square
    wide = np.hypot(s.q - rest, (s.v - rise / square) / np.sqrt(square))
    wide[0] = max(abs(load[0]), abs(load[0] + 0.3 * rise[0]))
    stepper = Stepper(s, 0.3)
    for c in (0, 1):
        swing = np.abs(s.beta[c]) * wide
        for h in (1e-5, 1e-3, 0.2):
            expected = swing @ np.minimum(2.0, OMEGA * (OMEGA + 2 * DECAY) * h * h / 8)
            expected += swing[0] * h * h / 8
            found = stepper.library.part_chord(stepper.at, c, h)
            assert found == pytest.approx(expected, rel=1e-12)


def test_the_chord_of_a_mode_without_vibrations_is_that_of_two_exponentials() -> None:
    """q = a exp(-s t) + b exp(-f t), s + f = 2 d, s f = omega^2: a s^2 + b f^2 bends it at most."""
    slow, fast, a, b = 30.0, 4e5, 2e-5, -1e-6
    one = np.array([np.sqrt(slow * fast)]), np.array([(slow + fast) / 2])
    own = {
        "omega": one[0], "decay": one[1], "beta": np.array([[2.0]]), "breaks": np.zeros(1),
        "loads": np.zeros((1, 1)), "offsets": np.zeros((1, 1)), "q": np.array([a + b]),
        "v": np.array([-slow * a - fast * b]),
    }  # fmt: skip
    stepper = Stepper(system([ao.Linear(1.0)], **own), 0.3)
    for h in (1e-7, 1e-5, 1e-3, 0.1):
        t = np.linspace(0, h, 1001)
        q = 2 * (a * np.exp(-slow * t) + b * np.exp(-fast * t))
        above = (q - q[0] - (q[-1] - q[0]) * t / h).max()
        found = stepper.library.part_chord(stepper.at, 0, h)
        each = np.minimum(2.0, np.array([slow, fast]) ** 2 * h * h / 8)
        assert above <= found == pytest.approx(2 * each @ np.abs([a, b]), rel=1e-6)


@pytest.mark.parametrize("t", [1e-5, 1e-2])
def test_a_rigid_mass_and_a_spring_feel_a_force_as_they_do(t: float) -> None:
    """A mass alone is felt whole; on a spring the motion under a force is (1 - cos wt) F/k."""
    given = {
        "decay": np.zeros(1), "beta": np.array([[0.5]]), "R": np.zeros((1, 1)),
        "loads": np.zeros((3, 1)), "q": np.zeros(1), "v": np.ones(1),
    }  # fmt: skip
    way = 0.25 * (1 - np.cos(300.0 * t)) / 300.0**2
    for w, mass in ((0.0, 4.0), (300.0, 0.5 * t * t / way)):
        stepper = Stepper(system([ao.Linear(1.0)], omega=np.array([w]), **given), 1.0)
        found = stepper.library.part_mass_felt(stepper.at, 0, t)
        assert found == pytest.approx(mass, rel=1e-9)


@pytest.mark.parametrize("fresh", [0, 1])
def test_ripple_is_the_amplitude_of_what_a_step_does_not_resolve(fresh: int) -> None:
    """On a spring k behind a compliance c an amplitude a of the free motion is k a/(1 + k c)."""
    stiffness, h, depth = (3e5, 2e6), 1e-3, 2e-4
    s = system([ao.Linear(k) for k in stiffness])
    stepper, worst = Stepper(s, 1.0, h), []
    for c, k in enumerate(stiffness):
        amplitude, soft = 0.0, 0.0
        for j in np.flatnonzero(h * OMEGA > 2):
            rest = s.loads[0, j] / OMEGA[j] ** 2
            amplitude += abs(s.beta[c, j]) * np.hypot(s.q[j] - rest, s.v[j] / OMEGA[j])
            soft += s.beta[c, j] ** 2 / OMEGA[j] ** 2
        if fresh:  # the force that begins sets the modes in motion
            amplitude += abs(k * (depth + h * (s.beta[c] @ s.v))) * soft
        worst.append(k * amplitude / (1 + k * (soft + s.R[c, c])))
    found = stepper.library.part_ripple(stepper.at, h, depth, fresh)
    assert found == pytest.approx(max(worst), rel=1e-9)


BOUNDS = [
    (ao.Linear(1e9), library.FORWARD, (), (0.0, inf, -inf, inf)),
    (ao.Linear(1e9), library.APART, (), (-inf, 0.0, -inf, inf)),
    (ao.HuntCrossley(1e9, 0.5), library.FORWARD, (0.25,), (0.0, inf, -4.0, inf)),
    (ao.HuntCrossley(1e9, 0.5), library.CUT, (0.25,), (0.0, inf, -inf, -4.0)),
    (ao.YangSun(1e9, 1e-5), library.FORWARD, (32e-5, 0.0, 26e-5), (24e-5, 32e-5, 0.0, inf)),
    (ao.YangSun(1e9, 1e-5), library.FORWARD, (32e-5, 0.0, 32e-5), (24e-5, inf, 0.0, inf)),
    (ao.YangSun(1e9, 1e-5), library.BACK, (32e-5, 28e-5, 0.0), (24e-5, 28e-5, -inf, inf)),
    (ao.YangSun(1e9, 1e-5), library.APART, (32e-5, 28e-5, 0.0), (-inf, 24e-5, -inf, inf)),
    (ao.Thornton(1e9, 1e-5), library.FORWARD, (0.0, 0.0, 0.0), (0.0, 1e-5, 0.0, inf)),
    (ao.Thornton(1e9, 1e-5), library.FORWARD, (1e-5, 0.0, 1.1e-5), (0.0, inf, 0.0, inf)),
]


@pytest.mark.parametrize(("law", "branch", "memory", "bounds"), BOUNDS)
def test_a_branch_of_a_law_ends_at_its_bounds(
    law: ao.ContactLaw, branch: int, memory: tuple, bounds: tuple
) -> None:
    out = doubles([0.0] * 4)
    built().part_bounds(law_at(law), branch, doubles([*memory, *[0.0] * 8]), out)
    assert tuple(out) == pytest.approx(bounds, rel=1e-12)


def test_a_law_with_memory_goes_through_its_branches() -> None:
    """Loading, turning, unloading, reloading from the turning point, and back along the curve."""
    law, memory, change = ao.Thornton(1e9, 1e-5), doubles([0.0] * 8), built().part_next_branch
    at = law_at(law)
    assert change(at, library.APART, HIGH, 0.0, 1.0, memory) == library.FORWARD
    assert change(at, library.FORWARD, SLOW, 4e-5, 0.0, memory) == library.BACK
    assert memory[:2] == [4e-5, 4e-5]
    assert change(at, library.BACK, LOW, 0.0, -1.0, memory) == library.APART
    assert change(at, library.APART, HIGH, 0.0, 1.0, memory) == library.BACK  # it retraces
    assert change(at, library.BACK, HIGH, 4e-5, 1.0, memory) == library.FORWARD
    law, memory = ao.HuntCrossley(1e9, 0.5), doubles([0.0] * 8)
    assert change(law_at(law), library.APART, HIGH, 0.0, 2.0, memory) == library.FORWARD
    assert memory[:2] == pytest.approx(law.touch(2.0))
    assert change(law_at(law), library.FORWARD, SLOW, 1e-5, -9.0, memory) == library.CUT
    assert change(law_at(law), library.CUT, FAST, 1e-5, 0.0, memory) == library.FORWARD


def blow(duration: float) -> tuple[ao.Scene, float]:
    model, mass = case_two(9)
    return ao.Scene({"a": model, "b": mass}, [ao.Contact("a", "b", ao.Hertz(HERTZ))]), duration


def test_two_runs_serve_a_smooth_blow() -> None:
    made = assemble_scene(*blow(1e-3))
    set_initial_forces(made)
    tol = 1e-2
    found = converge(made.system, made.contact_time_estimate, 1e-3, tol, 100, 10**6)
    assert found.share == tol / 8  # half, and of this a quarter
    assert max(found.force, found.peak) <= tol


@pytest.mark.parametrize("finer", [2.0, 4.0, 8.0])
def test_what_is_left_of_a_difference(finer: float) -> None:
    """Errors e and e/f differ by e - e/f, of which the finer has 1/(f - 1); twice that is told."""
    assert built().part_left_over(finer) == pytest.approx(2 / (finer - 1))


def two_runs() -> list[SimpleNamespace]:
    """Runs of parabolas on unlike nodes, forces from the first node on; the second row is light."""
    time = np.array([0.0, 0.1, 0.2, 0.45, 0.7, 0.85, 1.0]), np.array([0.0, 0.3, 0.6, 0.8, 1.0])
    rng = np.random.default_rng(8)
    force = [rng.uniform(1.0, 3.0, (t.size, 2)) * [1.0, 0.01] for t in time]
    return [SimpleNamespace(time=t, force=f) for t, f in zip(time, force, strict=True)]


def forces_at(run: SimpleNamespace, t: float) -> np.ndarray:
    """Forces of all rows by the parabola of the step."""
    start = min(2 * int(np.searchsorted(run.time[2::2], t)), run.time.size - 3)
    x, y = run.time[start : start + 3], run.force[start : start + 3]
    u = (t - x[0]) / (x[2] - x[0])
    shares = np.array([(1 - u) * (1 - 2 * u), 4 * u * (1 - u), u * (2 * u - 1)])
    return np.asarray(shares @ y)


def test_the_difference_of_two_runs_is_that_of_the_row_that_differs_most() -> None:
    """Of each over its own forces: L2 norm, impulse and peak; by trapezoids between the nodes."""
    a, b = two_runs()
    nodes = np.sort(np.concatenate((a.time, b.time)))
    fa, fb = (np.array([forces_at(run, t) for t in nodes]) for run in (a, b))
    square = trapezoid((fa - fb) ** 2, nodes, axis=0) / trapezoid(fb**2, nodes, axis=0)
    impulse = abs(trapezoid(fa - fb, nodes, axis=0)) / trapezoid(fb, nodes, axis=0)
    peaks = fa.max(axis=0), fb.max(axis=0)
    found = difference(a, b, 10.0)
    assert found[0] == pytest.approx(max(*np.sqrt(square), *impulse), rel=1e-12)
    assert found[1] == pytest.approx((abs(peaks[0] - peaks[1]) / peaks[1]).max(), rel=1e-12)
    assert found[2] == 1.0


def test_runs_agree_until_the_first_row_differs() -> None:
    a, b = two_runs()
    nodes = np.sort(np.concatenate((a.time, b.time)))
    fa, fb = (np.array([forces_at(run, t) for t in nodes]) for run in (a, b))
    tol = 0.5 * difference(a, b, 10.0)[0]
    between = np.diff(nodes)[:, None] * ((fa - fb)[1:] ** 2 + (fa - fb)[:-1] ** 2) / 2
    used = np.vstack((np.zeros(2), np.cumsum(between, axis=0)))
    beyond = (used > tol**2 * trapezoid(fb**2, nodes, axis=0)).any(axis=1)
    assert difference(a, b, tol)[2] == nodes[np.flatnonzero(beyond)[0]]


def test_a_row_that_hardly_pushes_counts_as_a_thousandth_of_the_heaviest() -> None:
    a, b = two_runs()
    for run in (a, b):
        run.force[:, 1] *= 1e-6  # 1e-8 of the other
    one = [SimpleNamespace(time=run.time, force=run.force[:, :1]) for run in (a, b)]
    assert difference(a, b, 10.0) == difference(*one, 10.0)


def test_energies_are_those_of_the_modes() -> None:
    x = np.random.default_rng(1).normal(size=(7, 2, OMEGA.size))
    expected = 0.5 * ((OMEGA * x[:, 0]) ** 2 + x[:, 1] ** 2).sum(axis=1)
    np.testing.assert_allclose(library.energies(x, OMEGA), expected, rtol=1e-12)


def test_the_march_is_a_collocation_of_order_four() -> None:
    """Against a march of fixed steps in NumPy, written for one contact of one spring."""
    model, mass = case_two(9)
    made = assemble_scene(
        ao.Scene({"a": model, "b": mass}, [ao.Contact("a", "b", ao.Linear(1e6))]), 1e-4
    )
    set_initial_forces(made)
    s = made.system
    found = march.run(s, 1e-4, 1e-7, fine=made.contact_time_estimate / 200)
    errors = []
    for count in (8, 16):
        q, v, f = s.q.copy(), s.v.copy(), 0.0
        for _ in range(count):
            q, v, f = collocated(s, 1e6, q, v, f, 1e-4 / count)
        errors.append(abs(f / found.force[-1, 0] - 1))
    assert errors[1] < 1e-4
    assert errors[0] / errors[1] > 10


def collocated(s: System, k: float, q: Array, v: Array, f0: float, h: float) -> tuple:
    """A step under the parabola of the force that meets F = k delta at h/2 and h."""
    b = s.beta[0]

    def moved(f: Array, t: float) -> tuple[Array, Array]:
        a = np.array([f[0], (4 * f[1] - 3 * f[0] - f[2]) / h, 4 * (f[0] - 2 * f[1] + f[2]) / h**2])
        return motion(s.omega, s.decay, np.full((1, 1), t), q[None], v[None], -a[:, None, None] * b)

    zero = np.array([f0, 0.0, 0.0])
    free = np.array([b @ moved(zero, t)[0][0] for t in (h / 2, h)])
    unit = [zero + np.eye(3)[i] for i in (1, 2)]
    give = free[:, None] - [[b @ moved(e, t)[0][0] for e in unit] for t in (h / 2, h)]
    f = np.append(f0, np.linalg.solve(np.eye(2) + k * give, k * free))
    (q1,), (v1,) = moved(f, h)
    return q1, v1, f[2]


def test_a_gap_that_bends_makes_a_damped_force_jump() -> None:
    """Its rate jumps there: the run has the force behind it too, and needs no short steps."""
    law, end = ao.HuntCrossley(1e6, 0.5), 0.02
    breaks = np.linspace(0.0, end, 101)
    gaps = 1e-3 * np.sin(400.0 * np.maximum(breaks - breaks[1], 0.0))
    one, none = np.ones((1, 1)), np.zeros(1)
    given = {
        "omega": none, "decay": none, "beta": one, "R": 0 * one, "breaks": breaks, "q": none,
        "loads": np.zeros((101, 1)), "offsets": gaps[:, None], "v": np.array([2.0]),
    }  # fmt: skip
    found = march.run(system([law], **given), end, 1e-6, fine=1e-6)
    rates = np.append(np.diff(gaps) / np.diff(breaks), 0.0)
    state = law.touch(2.0)

    def rate(t: float, y: Array, k: int) -> list[float]:
        gap = gaps[k] + rates[k] * (t - breaks[k])
        deep, speed = y[0] - gap, y[1] - rates[k]
        return [y[1], -max(law.force(deep, speed, state), 0.0) if deep > 0 else 0.0]

    y = np.array([0.0, 2.0])
    for k in range(100):
        span = breaks[k], breaks[k + 1]
        y = solve_ivp(rate, span, y, args=(k,), rtol=1e-10, atol=1e-13).y[:, -1]
    assert found.states is not None
    np.testing.assert_allclose(found.states[-1, :, 0], y, rtol=1e-5)
    jumps = np.flatnonzero(np.diff(found.time[::2]) == 0)
    assert len(jumps) > 3
    assert np.abs(np.diff(found.force[::2, 0])[jumps]).max() > 1e-3 * found.force.max()
    assert found.attempts < 700
