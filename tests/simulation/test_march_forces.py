"""Forces of a step of the march, NumPy's and the loops': laws, friction, Newton's method."""

from __future__ import annotations

from math import hypot
from types import ModuleType

import numpy as np
import pytest
from numpy.typing import NDArray

import antiosc as ao
from antiosc.simulation import march
from antiosc.simulation.laws import packed
from antiosc.simulation.march import layout
from laws import laws
from march_parts import SPRING, Parts

Array = NDArray[np.float64]


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
