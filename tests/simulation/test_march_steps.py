"""A step of the march, NumPy's and the loops': its error, its end, its length, its record."""

from __future__ import annotations

from math import hypot, inf
from types import ModuleType

import numpy as np
import pytest
from numpy.typing import NDArray

import antiosc as ao
from antiosc.simulation import engine
from antiosc.simulation.march import layout
from march_audit import motion
from march_parts import DECAY, OMEGA, SPRING, Parts

Array = NDArray[np.float64]


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


# -- the length of a step


def pressed(
    module: ModuleType, monkeypatch: pytest.MonkeyPatch, misfits: list[float], **given: float
) -> tuple[int, int, int, list[float]]:
    """(slot, level afterwards, attempts given up, lengths tried) of `press` from level 5.

    `misfits` of the attempts, over the limit; NaN: no forces are found.
    """
    parts = Parts.of([SPRING])
    clock, count = parts.state[:2]
    own = {"SHARE": 1e-3, "FORCE_SCALE": 100.0, "LONGEST": 1.0, "CAP": 1.0, "LEFT": 9.0}
    for name, value in {**own, "ROOF": inf, **given}.items():
        clock[getattr(layout, name)] = value
    count[layout.LEVEL] = 5
    lengths: list[float] = []

    def attempt(slot: int, h: float, *_: object) -> bool:
        lengths.append(h)
        return not np.isnan(misfits[len(lengths) - 1])

    monkeypatch.setattr(module.pressing, "attempt", attempt)
    monkeypatch.setattr(module.pressing, "worst_misfit", lambda *_: 0.1 * misfits[len(lengths) - 1])
    monkeypatch.setattr(module.pressing, "first_exit", lambda *_: inf)
    arguments = parts.modes, parts.contacts, parts.state, parts.tables, parts.work
    slot = module.pressing.press(*arguments)
    assert count[layout.RETRIES] == len(lengths) - 1  # of those that were tried
    assert clock[layout.STEP] == lengths[-1]
    return slot, int(count[layout.LEVEL]), int(count[layout.REFUSED]), lengths


@pytest.mark.parametrize(
    ("misfits", "level", "tried"),
    [
        ([0.5], 5, [5]),
        ([1.0], 5, [5]),
        ([0.063], 5, [5]),
        ([0.062], 4, [5]),  # a sixteenth: the next step is twice as long
        ([1.01, 0.5], 6, [5, 6]),
        ([15.9, 0.5], 6, [5, 6]),
        ([16.1, 0.5], 7, [5, 7]),
        ([127.0, 0.5], 7, [5, 7]),
        ([129.0, 0.01], 7, [5, 8]),
        ([np.nan, 20.0, 0.5], 8, [5, 6, 8]),
    ],
)
def test_steps_are_halved_by_their_misfit_and_doubled(
    module: ModuleType,
    monkeypatch: pytest.MonkeyPatch,
    misfits: list[float],
    level: int,
    tried: list[int],
) -> None:
    slot, after, refused, lengths = pressed(module, monkeypatch, misfits)
    assert lengths == [0.5**each for each in tried]
    assert (slot, after, refused) == (tried[-1], level, len(tried) - 1)


def test_steps_end_with_the_loads_and_keep_below_their_cap(
    module: ModuleType, monkeypatch: pytest.MonkeyPatch
) -> None:
    slot, level, _, lengths = pressed(module, monkeypatch, [0.001], LEFT=0.02)
    assert (slot, level, lengths) == (layout.SCRATCH, 5, [0.02])  # the rest; it tells no length
    slot, level, _, lengths = pressed(module, monkeypatch, [0.5], CAP=0.01)
    assert (slot, level, lengths) == (7, 7, [0.5**7])
    # half the rest is not left over
    slot, level, _, lengths = pressed(module, monkeypatch, [2.0, 0.5], LEFT=0.02)
    assert (slot, level, lengths) == (7, 7, [0.02, 0.5**7])


def test_a_step_that_is_taken_is_written_down(module: ModuleType) -> None:
    """Its nodes, the parabolas that the next step begins with, its state, the work of loads."""
    parts, h = Parts.of([SPRING, SPRING]), 3e-5
    clock, count, x, row = parts.state[:4]
    scale, F, after = parts.state[7], parts.work[0], parts.work[2]
    at, slope, _, drift = parts.work[4:8]
    F[:] = np.random.default_rng(11).uniform(1, 9, F.shape)
    after[:] = np.random.default_rng(12).normal(size=after.shape)
    clock[layout.STEP], clock[layout.TIME], clock[layout.FORCE_SCALE] = h, 0.25, 0.1
    count[layout.NODES], count[layout.KEEP], count[layout.IDLE] = 7, 1, 3
    count[layout.LOADED] = count[layout.SHIFTED] = 1
    out = engine.buffers(40, 2, 2, OMEGA.size)
    before, worked = x.copy(), clock[layout.WORKED]
    module.tables.ready_step(9, h, parts.modes, parts.tables)
    arguments = parts.modes, parts.contacts, parts.state, parts.tables, parts.work, out
    module.course.take(9, *arguments)
    curve = [np.polynomial.Polynomial.fit([0, h / 2, h], each, 2) for each in F.T]
    np.testing.assert_allclose(row[layout.FORCE], F[2])
    np.testing.assert_allclose(row[layout.MIDDLE], F[1])
    np.testing.assert_allclose(row[layout.SLOPE], [p.deriv()(h) for p in curve], rtol=1e-9)
    np.testing.assert_allclose(row[layout.BEND], [p.deriv(2)(h) for p in curve], rtol=1e-9)
    np.testing.assert_allclose(row[layout.DEPTH], after[2])
    np.testing.assert_allclose(row[layout.RATE], after[3])
    assert not row[layout.FRESH].any()
    time, force, depth, states, _ = out
    np.testing.assert_allclose(time[7:9], [0.25 + h / 2, 0.25 + h], rtol=1e-15)
    np.testing.assert_array_equal(force[7:9], F[1:])
    np.testing.assert_array_equal(depth[7:9], after[::2])
    np.testing.assert_array_equal(states[0], before)
    assert (clock[layout.TIME], clock[layout.BEFORE]) == (0.25 + h, h)
    assert count[[layout.NODES, layout.STATES, layout.STEPS, layout.IDLE]].tolist() == [9, 1, 1, 0]
    assert clock[layout.FORCE_SCALE] == F[2].max()
    np.testing.assert_array_equal(scale[:, 1], np.maximum(2.0, np.abs(after[3])))
    beta = parts.system.beta
    rise, bend = (np.array([p.deriv(k)(0.0) for p in curve]) for k in (1, 2))
    push = np.stack([at - F[0] @ beta, slope - rise @ beta, -bend @ beta])[:, None]
    moved = motion(OMEGA, DECAY, np.array([[h]]), *before[:, None], push)
    np.testing.assert_allclose(x, np.vstack(moved), rtol=1e-9, atol=1e-15)
    done = (at + slope * h / 2) @ (x[0] - before[0])
    done -= drift @ [p.integ()(h) - p.integ()(0.0) for p in curve]
    assert clock[layout.WORKED] - worked == pytest.approx(done, rel=1e-6)


def test_a_given_step_is_halved_for_vibrations_that_it_does_not_resolve(
    module: ModuleType, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Until the force that they may cause is twice the error of a step; other steps are not."""
    asked: list[float] = []

    def ripple(h: float, *_: object) -> float:
        asked.append(h)
        return 0.201 if h > 0.01 else 0.199

    monkeypatch.setattr(module.pressing, "ripple", ripple)
    slot, level, refused, lengths = pressed(module, monkeypatch, [0.5], ROOF=1.0)
    assert asked == [0.5**5, 0.5**6, 0.5**7]
    assert (slot, level, lengths) == (7, 7, [0.5**7])
    assert refused == 2
    slot, _, refused, _ = pressed(module, monkeypatch, [0.5])
    assert (slot, refused, len(asked)) == (5, 0, 3)
