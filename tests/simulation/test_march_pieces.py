"""The parts of a step of the march, NumPy's and the loops', against formulas of their own."""

from __future__ import annotations

from functools import cache
from math import hypot, inf
from types import ModuleType, SimpleNamespace
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

import antiosc as ao
from antiosc.simulation import engine, march
from antiosc.simulation.laws import packed
from antiosc.simulation.march import layout
from antiosc.simulation.system import System
from laws import laws
from marches import written_out

Array = NDArray[np.float64]
OMEGA, DECAY = np.array([0.0, 300.0, 2e3, 9e3, 3e4]), np.array([0.0, 4.0, 0.0, 90.0, 0.0])
SPRING = ao.Linear(3e5)


@cache
def loops() -> ModuleType:
    return written_out()


@pytest.fixture(params=["numpy", "loops"])
def module(request: pytest.FixtureRequest) -> ModuleType:
    return march if request.param == "numpy" else loops()


class Parts(SimpleNamespace):
    """The arrays of a march of several contacts (and rows of friction), filled at random."""

    system: System
    modes: Any
    contacts: Any
    state: Any
    tables: Any
    work: Any

    @classmethod
    def of(cls, laws: list[ao.ContactLaw], rubs: int = 0, seed: int = 3) -> Parts:
        rng = np.random.default_rng(seed)
        p = len(laws)
        m = p + rubs
        rows = [packed(law) for law in laws]
        params = np.zeros((p, max(values.size for _, values in rows)))
        for row, (_, values) in zip(params, rows, strict=True):
            row[: values.size] = values
        a = rng.normal(size=(m, m))
        system = System(
            omega=OMEGA, decay=DECAY, beta=rng.normal(size=(m, OMEGA.size)), R=1e-7 * a @ a.T,
            breaks=np.array([0.0, 0.2, 0.7]), loads=rng.normal(size=(3, OMEGA.size)),
            offsets=rng.normal(size=(3, m)) * 1e-6,
            kinds=np.array([kind for kind, _ in rows]), params=params,
            slip=np.tile([0.3, 2e5], (p, 1)),
            tangents=np.array([[p, rubs], *[[m, 0]] * (p - 1)]),
            q=rng.normal(size=OMEGA.size) * 1e-5, v=rng.normal(size=OMEGA.size),
            mass=rng.uniform(0.5, 2, p), depth=np.full(p, 1e-4), speed=np.full(p, 2.0),
            pressed=np.zeros(p),
        )  # fmt: skip
        space = engine.Space.of(p, m, OMEGA.size)
        space.begin(system.start)
        mode = space.state[4]
        mode[:] = layout.FORWARD
        row = space.state[3]
        row[:] = rng.normal(size=row.shape)
        row[layout.DEPTH], row[layout.FRESH] = rng.uniform(1e-5, 1e-4, m), 0.0
        row[layout.FORCE] = np.abs(row[layout.FORCE])
        for each in space.work[4:8]:
            each[:] = rng.normal(size=each.shape)
        return cls(
            system=system, modes=system.start.modes, contacts=system.start.contacts,
            state=space.state, tables=space.tables, work=space.work, acting=system.start.acting,
        )  # fmt: skip


# -- the error of a step


def test_the_misfit_of_a_cubic_is_its_distance_from_the_parabola(module: ModuleType) -> None:
    """On the nodes 0, h/2, h, with a value half a step before; a force that begins as t^(3/2)."""
    rng, t = np.random.default_rng(0), np.linspace(0, 1, 20_001)
    misfit = module.pressing.misfit
    for before, h in ((1.0, 1.0), (0.3, 0.9), (2.0, 0.4)):
        cubic = np.polynomial.Polynomial(rng.normal(size=4))
        nodes = cubic(np.array([-before / 2, 0.0, h / 2, h]))
        parabola = np.polynomial.Polynomial.fit([0, h / 2, h], nodes[1:], 2)
        worst = np.abs(cubic(h * t) - parabola(h * t)).max()
        assert misfit(*nodes, before, h, 0.0) == pytest.approx(worst, rel=2e-3)
    nodes = np.array([0.0, 0.5, 1.0]) ** 1.5
    worst = np.abs(t**1.5 - np.polynomial.Polynomial.fit([0, 0.5, 1], nodes, 2)(t)).max()
    assert worst < misfit(9.0, *nodes, 1.0, 1.0, 1.0) < 1.35 * worst


def test_the_worst_misfit_is_that_of_the_worst_row(module: ModuleType) -> None:
    parts = Parts.of([SPRING, SPRING], rubs=1)
    clock, row, F = parts.state[0], parts.state[3], parts.work[0]
    F[:] = np.random.default_rng(2).normal(size=F.shape)
    clock[layout.BEFORE], clock[layout.STEP] = 0.7, 0.4
    each = [
        module.pressing.misfit(row[layout.MIDDLE, i], *F[:, i], 0.7, 0.4, row[layout.FRESH, i])
        for i in range(3)
    ]
    assert module.pressing.worst_misfit(parts.state, parts.work) == max(each) > 0


@pytest.mark.parametrize("fresh", [0.0, 1.0])
def test_ripple_is_the_amplitude_of_what_a_step_does_not_resolve(
    module: ModuleType, fresh: float
) -> None:
    """On a spring k behind a compliance c an amplitude a of the free motion is k a/(1 + k c)."""
    parts = Parts.of([SPRING, ao.Linear(2e6)])
    clock, x, row, scale = (parts.state[i] for i in (0, 2, 3, 7))
    row[layout.FRESH], clock[layout.FORCE_SCALE] = fresh, 500.0
    beta, at, h = parts.system.beta, parts.work[4], 1e-3
    worst = []
    for c, k in enumerate((3e5, 2e6)):
        amplitude, soft = 0.0, 0.0
        for j in np.flatnonzero(h * OMEGA > 2):
            square = OMEGA[j] ** 2
            rest = (at[j] - row[layout.FORCE] @ beta[:, j]) / square
            moving = -(row[layout.SLOPE] @ beta[:, j]) / square
            amplitude += abs(beta[c, j]) * hypot(x[0, j] - rest, (x[1, j] - moving) / OMEGA[j])
            soft += beta[c, j] ** 2 / square
        if fresh:  # the force that begins sets the modes in motion
            ahead = k * (row[layout.DEPTH, c] + h * row[layout.RATE, c])
            amplitude += abs(ahead - row[layout.FORCE, c]) * soft
            k = max(k, 500.0 / scale[c, 0])
        worst.append(k * amplitude / (1 + k * (soft + parts.system.R[c, c])))
    found = module.pressing.ripple(h, parts.modes, parts.contacts, parts.state, parts.work)
    assert found == pytest.approx(max(worst), rel=1e-12)
    parts.state[4][np.argmax(worst)] = layout.APART
    found = module.pressing.ripple(h, parts.modes, parts.contacts, parts.state, parts.work)
    assert found == pytest.approx(min(worst), rel=1e-12)


# -- where a step ends


PIECES = [
    (SPRING, layout.FORWARD, (), (0.0, inf, -inf, inf)),
    (SPRING, layout.APART, (), (-inf, 0.0, -inf, inf)),
    (ao.HuntCrossley(1e9, 0.5), layout.FORWARD, (0.25,), (0.0, inf, -4.0, inf)),
    (ao.HuntCrossley(1e9, 0.5), layout.CUT, (0.25,), (0.0, inf, -inf, -4.0)),
    (ao.HuntCrossley(1e9, 0.5), layout.CUT, (0.0,), (0.0, inf, -inf, -inf)),
    (ao.TanSun(1e9, 1e-5, 0.4), layout.FORWARD, (3e-5, 0.0, 2e-5), (8e-6, 3e-5, 0.0, inf)),
    (ao.TanSun(1e9, 1e-5, 0.4), layout.FORWARD, (3e-5, 0.0, 3e-5), (8e-6, inf, 0.0, inf)),
    (ao.TanSun(1e9, 1e-5, 0.4), layout.BACK, (3e-5, 2e-5, 0.0), (8e-6, 2e-5, -inf, inf)),
    (ao.TanSun(1e9, 1e-5, 0.4), layout.APART, (3e-5, 2e-5, 0.0), (-inf, 8e-6, -inf, inf)),
    (ao.Thornton(1e9, 1e-5), layout.FORWARD, (0.0, 0.0, 0.0), (0.0, 1e-5, 0.0, inf)),
    (ao.Thornton(1e9, 1e-5), layout.FORWARD, (1e-5, 0.0, 1.1e-5), (0.0, inf, 0.0, inf)),
    (ao.Stronge(1e9, 1e-5), layout.FORWARD, (0.0, 0.0, 0.0), (0.0, 1e-5, 0.0, inf)),
    (ao.Stronge(1e9, 1e-5), layout.FORWARD, (1e-5, 0.0, 1e-5), (0.0, 84e-5, 0.0, inf)),
]


@pytest.mark.parametrize(("law", "mode", "memory", "bounds"), PIECES)
def test_a_piece_of_a_law_and_what_lies_beyond_it(
    module: ModuleType, law: ao.ContactLaw, mode: int, memory: tuple, bounds: tuple
) -> None:
    parts = Parts.of([SPRING, law])
    kinds, params = parts.contacts[:2]
    parts.state[4][1] = mode
    parts.state[5][1, : len(memory)] = memory
    found = module.curves.piece(kinds[1], mode, params[1], parts.state[5][1])
    assert found == pytest.approx(bounds, rel=1e-12)
    low, high, slow, fast = bounds
    for bound, expected in enumerate((low - 2e-5, 2e-5 - high, slow + 3.0, -3.0 - fast)):
        which = np.array([1, bound])
        lies = module.pressing.beyond(parts.contacts, parts.state, which, 2e-5, -3.0)
        assert lies == pytest.approx(expected, rel=1e-12)


@pytest.mark.parametrize(
    ("law", "mode", "memory", "start", "expected"),
    [  # (depth, rate, acceleration) at the start; bound and time of the exit
        (SPRING, layout.FORWARD, (), (2.0, -1.0, -1.0), (layout.LOW, np.sqrt(5.0) - 1)),
        (SPRING, layout.FORWARD, (), (2.0, -1.5, -1.0), (layout.LOW, 1.0)),
        (SPRING, layout.FORWARD, (), (1.0, -3.0, -1.0), (layout.LOW, np.sqrt(11.0) - 3)),
        (SPRING, layout.FORWARD, (), (3.0, -1.0, 0.1), (layout.NOTHING, inf)),
        (ao.TanSun(1.0, 9.0, 0.4), layout.BACK, (5.0, 4.0), (3.0, 0.5, 1.0), (layout.HIGH, 1.0)),
        (ao.TanSun(1.0, 9.0, 0.4), layout.FORWARD, (), (3.0, 1.0, -0.8), (layout.SLOW, 1.25)),
        (ao.TanSun(1.0, 9.0, 0.4), layout.FORWARD, (), (3.0, 1.0, -4.0), (layout.SLOW, 0.25)),
        (ao.HuntCrossley(1.0, 0.5), layout.FORWARD, (0.5,), (9.0, -1.0, -2.0), (layout.SLOW, 0.5)),
        (ao.HuntCrossley(1.0, 0.5), layout.CUT, (0.5,), (9.0, -3.0, 2.0), (layout.FAST, 0.5)),
        (ao.HuntCrossley(1.0, 0.5), layout.CUT, (0.5,), (9.0, -3.0, 0.8), (layout.FAST, 1.25)),
    ],
)
def test_the_first_exit_is_where_a_parabola_meets_its_bound(
    module: ModuleType,
    law: ao.ContactLaw,
    mode: int,
    memory: tuple,
    start: tuple[float, float, float],
    expected: tuple[int, float],
) -> None:
    """A step of 1.6 of two contacts, the first of which stays within its piece."""
    parts = Parts.of([SPRING, law])
    clock, row, motion = parts.state[0], parts.state[3], parts.work[2]
    parts.state[4][1], parts.state[5][1, : len(memory)] = mode, memory
    clock[layout.STEP] = 1.6
    for c, (d, v, a) in enumerate(((1.0, 0.1, 0.1), start)):
        row[layout.DEPTH, c], row[layout.RATE, c] = d, v
        for stage, t in enumerate((0.8, 1.6)):
            motion[2 * stage, c], motion[2 * stage + 1, c] = d + v * t + a * t * t / 2, v + a * t
    found = module.pressing.first_exit(parts.contacts, parts.state, parts.work)
    bound, at = expected
    assert found == pytest.approx(at, rel=1e-9)
    if bound != layout.NOTHING:
        assert parts.work[8].tolist() == [1, bound]


# -- forces


@pytest.mark.parametrize("n", [1, 2, 5, 8])
def test_elimination_solves_with_pivots(module: ModuleType, n: int) -> None:
    rng = np.random.default_rng(n)
    A, b = rng.normal(size=(n, n)), rng.normal(size=n)
    if n > 1:
        A[0, 0] = 0.0
    expected, found = np.linalg.solve(A, b), b.copy()
    assert module.forces.eliminate(A.copy(), found)
    np.testing.assert_allclose(found, expected, rtol=1e-9)
    A[:, 0] = 0.0
    assert not module.forces.eliminate(A, b)


def couplings(parts: Parts, seed: int) -> tuple[Array, Array]:
    """share (4, 3, m, m) and base (4, m) of a step at random, as small as compliances are."""
    rng, m = np.random.default_rng(seed), len(parts.system.beta)
    share, base = rng.normal(size=(4, 3, m, m)) * 1e-8, rng.uniform(1e-5, 1e-4, (4, m))
    for i in range(m):
        share[0, 1, i, i] = share[2, 2, i, i] = 4e-6
    return share, base


@pytest.mark.parametrize("stage", [0, 1])
@pytest.mark.parametrize("normal", [1e3, 10.0])
@pytest.mark.parametrize("rubs", [1, 2])
def test_friction_is_its_spring_within_the_cone(
    module: ModuleType, rubs: int, normal: float, stage: int
) -> None:
    """Stuck under a large normal force: the linear equation of each row; else on the cone."""
    parts = Parts.of([SPRING], rubs)
    share, base = couplings(parts, 5)
    share[:, :, 1, 2:] = share[:, :, 2:, 1] = 0.0  # the rows of friction do not move each other
    rng = np.random.default_rng(6)
    F, anchor = rng.normal(size=(3, 1 + rubs)), rng.normal(size=(3, 1, 2)) * 1e-6
    F[:, 0] = normal
    before, hung = F.copy(), anchor[stage, 0].copy()
    call = (stage, 0, share, base, F, parts.contacts, anchor)
    change = module.forces.rub(*call)
    ends = stage + 1, [1, rubs]
    assert change == np.abs(F[ends] - before[ends]).max()
    for _ in range(30):
        module.forces.rub(*call)
    way = base[2 * stage] - share[2 * stage, 1] @ F[1] - share[2 * stage, 2] @ F[2]
    stuck, size = 2e5 * (way[1:] - hung[:rubs]), np.linalg.norm(F[stage + 1, 1:])
    if normal > 100:
        np.testing.assert_allclose(F[stage + 1, 1:], stuck, rtol=1e-7)
        np.testing.assert_allclose(anchor[stage + 1, 0, :rubs], hung[:rubs], rtol=1e-6, atol=1e-12)
    else:
        assert size == pytest.approx(0.3 * normal, rel=1e-12)
        slides = way[1:] - F[stage + 1, 1:] / 2e5
        np.testing.assert_allclose(anchor[stage + 1, 0, :rubs], slides, rtol=1e-6, atol=1e-12)


def test_one_call_solves_a_row_of_friction(module: ModuleType) -> None:
    parts = Parts.of([SPRING], 1)
    share, base = couplings(parts, 5)
    F, anchor = np.full((3, 2), 1e4), np.zeros((3, 1, 2))
    module.forces.rub(0, 0, share, base, F, parts.contacts, anchor)
    way = base[0] - share[0, 1] @ F[1] - share[0, 2] @ F[2]
    assert F[1, 1] == pytest.approx(2e5 * way[1], rel=1e-9)


def test_newtons_method_solves_springs_at_once(module: ModuleType) -> None:
    """Two of three contacts are closed: a linear system of their forces at h/2 and h."""
    k = np.array([3e5, 1e6, 2e4])
    parts = Parts.of([ao.Linear(each) for each in k])
    share, base = couplings(parts, 8)
    share *= 30.0  # coupled
    mode = np.array([layout.FORWARD, layout.APART, layout.BACK])
    F = np.random.default_rng(9).uniform(1, 2, (3, 3))
    F[1:, 1] = 0.0
    s = parts.state[5]
    assert module.forces.together(share, base, F, parts.contacts, mode, s)
    for stage in (0, 1):
        way = base[2 * stage] - share[2 * stage, 1] @ F[1] - share[2 * stage, 2] @ F[2]
        np.testing.assert_allclose(F[stage + 1, [0, 2]], (k * way)[[0, 2]], rtol=1e-9)
    kept = F.copy()
    assert module.forces.together(share, base, F, parts.contacts, mode, s)
    np.testing.assert_allclose(F, kept, rtol=1e-12)


def test_a_newton_step_that_leads_away_is_shortened(module: ModuleType) -> None:
    parts = Parts.of([ao.Power(1e12, 3.0)])
    share, base = couplings(parts, 8)
    base[:] = 1e-4
    F = np.array([[0.0], [25.0], [25.0]])
    mode, s = np.array([layout.FORWARD]), parts.state[5]

    def unmet() -> float:
        found = [
            F[i + 1, 0] - 1e12 * max(base[2 * i, 0] - share[2 * i, 1:, 0, 0] @ F[1:, 0], 0.0) ** 3
            for i in (0, 1)
        ]
        return hypot(*found)

    before = unmet()
    for _ in range(40):
        assert module.forces.together(share, base, F, parts.contacts, mode, s)
        after = unmet()
        assert after < before or after < 1e-9
        before = after
    assert before < 1e-6


# -- flight


def test_loads_and_gaps_are_linear_between_their_breaks(module: ModuleType) -> None:
    parts = Parts.of([SPRING], 1)
    clock, count = parts.state[:2]
    at, slope, offset, drift = parts.work[4:8]
    breaks, loads, offsets = parts.acting
    clock[layout.DURATION] = 1.0
    for t, end in ((0.0, 0.2), (0.15, 0.2), (0.2, 0.7), (0.6999, 0.7), (0.7, 1.0), (0.95, 1.0)):
        count[layout.SEGMENT], clock[layout.TIME] = 0, t
        span = module.flight.acting_now(parts.acting, parts.state, parts.work)
        assert span == pytest.approx(end - t, abs=1e-15)
        for found, rise, values in ((at, slope, loads), (offset, drift, offsets)):
            now, later = (
                np.array([np.interp(x, breaks, column) for column in values.T])
                for x in (t, t + span)
            )
            np.testing.assert_allclose(found, now, rtol=1e-12, atol=1e-18)
            np.testing.assert_allclose(rise, (later - now) / span, rtol=1e-9, atol=1e-15)
    clock[layout.DURATION], clock[layout.TIME] = 0.5, 0.3
    assert module.flight.acting_now(parts.acting, parts.state, parts.work) == pytest.approx(0.2)


def test_swings_are_the_amplitudes_of_free_motion_about_its_rest(module: ModuleType) -> None:
    """And a rigid mode's is its largest acceleration, with what its damping may take."""
    parts = Parts.of([SPRING, SPRING])
    x, beta = parts.state[2], parts.system.beta
    at, slope = parts.work[4:6]
    module.flight.amplitudes(0.3, parts.modes, parts.state, parts.work)
    swing, bend, missed, known = parts.work[9:13]
    square = np.where(OMEGA > 0, OMEGA, 1.0) ** 2
    rest = (at - 2 * DECAY * slope / square) / square
    wide = np.hypot(x[0] - rest, (x[1] - slope / square) / np.sqrt(square))
    wide[0] = max(abs(at[0]), abs(at[0] + 0.3 * slope[0])) + 2 * DECAY[0] * abs(x[1, 0])
    np.testing.assert_allclose(swing, np.abs(beta) * wide, rtol=1e-12)
    np.testing.assert_allclose(bend, swing[:, 0], rtol=1e-12)
    curved = swing @ (OMEGA * (OMEGA + 2 * DECAY)) + swing[:, 0]
    np.testing.assert_allclose(missed[layout.LEVELS], curved, rtol=1e-12)
    assert not known.any()


@pytest.mark.parametrize("loaded", [False, True])
@pytest.mark.parametrize("shifted", [False, True])
def test_free_motion_after_half_and_whole_a_step(
    module: ModuleType, loaded: bool, shifted: bool
) -> None:
    parts = Parts.of([SPRING, SPRING])
    h, count, x, out = 1e-3, parts.state[1], parts.state[2], np.empty((4, 2))
    at, slope, offset, drift = parts.work[4:8]
    count[layout.LOADED], count[layout.SHIFTED] = loaded, shifted
    for each, used in ((at, loaded), (slope, loaded), (offset, shifted), (drift, shifted)):
        each[:] *= used
    module.tables.ready_step(4, h, parts.modes, parts.tables)
    arguments = parts.modes, parts.state, parts.tables, parts.work, out
    module.flight.free_step(4, h, *arguments)
    for i, t in enumerate((h / 2, h)):
        for rate in (0, 1):
            expected = []
            for c in (0, 1):
                total = -drift[c] if rate else -offset[c] - drift[c] * t
                for j, (w, d) in enumerate(zip(OMEGA, DECAY, strict=True)):
                    table = march.response(np.array([w]), np.array([d]), t, True)
                    P, W, S, J0, J1, _ = (float(np.ravel(each)[0]) for each in table)
                    way = P * x[0, j] + S * x[1, j] + J0 * at[j] + J1 * slope[j]
                    speed = W * x[1, j] - w * w * S * x[0, j] + S * at[j] + J0 * slope[j]
                    total += parts.system.beta[c, j] * (speed if rate else way)
                expected.append(total)
            np.testing.assert_allclose(out[2 * i + rate], expected, rtol=1e-9, atol=1e-15)


@pytest.mark.parametrize(
    "law",
    [SPRING, ao.Hertz(1e9), ao.Power(1e8, 2.2), ao.Thornton(1e9, 1e-6), ao.HuntCrossley(1e9, 0.5)],
)
@pytest.mark.parametrize("speed", [1e-3, 1.0, 50.0])
def test_what_is_expected_of_a_blow_turns_the_mass(
    module: ModuleType, law: ao.ContactLaw, speed: float
) -> None:
    """Force times depth is m v^2, within a tenth; the force is that of the law."""
    kind, values = packed(law)
    depth, force = module.curves.expected(kind, 0.7, speed, values, np.zeros(8))
    assert 0.9 < force * depth / (0.7 * speed**2) < 1.12
    assert force == pytest.approx(law.force(depth, 0.0, law.touch(speed)), rel=1e-9)


@laws
@pytest.mark.parametrize("deepest", [0.0, 8e-6, 9e-5, 1.3e-3])
def test_curves_are_those_of_the_laws(
    module: ModuleType, law: ao.ContactLaw, deepest: float
) -> None:
    """Force and slopes where the law loads, has turned at some depth, and reloads."""
    kind, values = packed(law)
    state = law.touch(0.8)
    if deepest:
        state = law.touch(0.5, law.advance(deepest, 0.0, state))
    turns = (0.0, 0.5 * deepest, 0.9 * deepest, deepest) if law.has_memory else (0.0,)
    for turn in turns:
        own = law.advance(turn, 0.0, state) if turn > law.origin(state) else state
        s = np.zeros(8)
        s[: len(own)] = own
        if law.has_memory:
            assert module.curves.permanent(kind, own[0], values) == pytest.approx(
                law.origin(own), rel=1e-9, abs=1e-16
            )
        for delta in (-1e-6, 1e-9, 3e-6, 2e-5, 7e-5, 2e-4, 2e-3):
            back = law.has_memory and delta < own[1]
            mode = layout.BACK if back else layout.FORWARD
            found = module.curves.curve(kind, mode, delta, 0.3, values, s)
            if kind == march.LINEAR:  # it goes on below 0, where the contact ends
                assert found == pytest.approx((values[0] * delta, values[0], 0.0))
                continue
            force, slopes = law.force(delta, 0.3, own), law.tangent(delta, 0.3, own)
            assert found[0] == pytest.approx(force, rel=1e-8, abs=1e-9)
            assert found[1:] == pytest.approx(slopes, rel=1e-6, abs=1e-6)
        assert module.curves.curve(kind, layout.APART, 1e-4, 0.3, values, s) == (0.0, 0.0, 0.0)


@laws
def test_a_touch_leaves_what_the_law_remembers(module: ModuleType, law: ao.ContactLaw) -> None:
    """At first, after a deep contact, and after a slow one."""
    kind, values = packed(law)
    s, state = np.zeros(8), None
    for speed, depth in ((0.8, 9e-5), (1e-4, 2e-5), (0.3, 0.0)):
        state = law.touch(speed, state)
        mode = module.curves.change(kind, layout.APART, layout.HIGH, 0.0, speed, values, s)
        remembered = state[:2]  # not what is lost
        np.testing.assert_allclose(s[: len(remembered)], remembered, rtol=1e-12, atol=1e-18)
        turned = law.has_memory and state[1] > law.origin(state)
        assert mode == (layout.BACK if turned else layout.FORWARD)
        if not law.has_memory:
            continue
        # on to the turning point, beyond it, and back down from the deepest point
        if mode == layout.BACK:
            mode = module.curves.change(kind, mode, layout.HIGH, s[1], 0.1, values, s)
        assert mode == layout.FORWARD
        state = law.advance(max(depth, state[1]), 0.0, state)
        mode = module.curves.change(kind, mode, layout.SLOW, state[1], 0.0, values, s)
        assert mode == layout.BACK
        np.testing.assert_allclose(s[:2], state[:2], rtol=1e-12)
        assert module.curves.change(kind, mode, layout.LOW, 0.0, 0.0, values, s) == layout.APART
    if law.rate_dependent:
        change = module.curves.change
        assert change(kind, layout.FORWARD, layout.SLOW, 1e-5, 0.0, values, s) == layout.CUT
        assert change(kind, layout.CUT, layout.FAST, 1e-5, 0.0, values, s) == layout.FORWARD
