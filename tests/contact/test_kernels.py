"""The laws of the C library against their formulas, their slopes and their energies."""

from __future__ import annotations

import pickle

import numpy as np
import pytest
from scipy.integrate import trapezoid

import antiosc as ao
from law_formulas import permanent, virgin
from laws import LAWS, laws

PLASTIC = [law for law in LAWS.values() if law.has_memory and not getattr(law, "elastic", False)]
DEPTHS = (1e-9, 3e-6, 2e-5, 7e-5, 2e-4, 2e-3)


@laws
def test_forces_are_those_of_the_formulas(law: ao.ContactLaw) -> None:
    state = law.touch(0.8)
    assert law.force(-1e-6, 0.3, state) == 0.0
    for d in DEPTHS:
        expected = virgin(law, d)
        assert law.force(d, 0.0, state) == pytest.approx(expected, rel=1e-9)
        if law.rate_dependent:
            grip = 1 + law.factor * 0.3 / 0.8
            assert law.force(d, 0.3, state) == pytest.approx(expected * grip, rel=1e-9)
            assert law.force(d, -1e6, state) == 0.0
            assert law.damping(d, 0.3, state) == pytest.approx(expected * (grip - 1), rel=1e-9)


@pytest.mark.parametrize("law", PLASTIC, ids=lambda law: type(law).__name__)
def test_unloading_and_reloading_are_those_of_the_formulas(law: ao.ContactLaw) -> None:
    deepest = 8e-5
    state = law.advance(deepest, 0.0, law.touch(0.8))
    low, top = permanent(law, deepest), virgin(law, deepest)
    assert law.origin(state) == pytest.approx(low, rel=2e-3, abs=1e-12)
    low = law.origin(state)
    if isinstance(law, ao.Tabulated):
        assert law.force(deepest, 0.0, state) == pytest.approx(top, rel=1e-9)
        return
    laminate = isinstance(law, ao.YangSun | ao.TanSun)
    for share in (0.2, 0.7, 1.0):
        d = low + share * (deepest - low)
        expected = top * share ** (2.5 if laminate else 1.5)
        assert law.force(d, 0.0, state) == pytest.approx(expected, rel=1e-9)
        again = law.touch(0.3, state)
        assert law.force(d, 0.0, again) == pytest.approx(top * share**1.5, rel=1e-9)


@laws
def test_slopes_and_energies_are_derivatives_and_integrals(law: ao.ContactLaw) -> None:
    state = law.touch(0.8)
    for d in DEPTHS[1:]:
        by_delta, by_rate = law.tangent(d, 0.1, state)
        h = 1e-5 * d
        slope = (law.force(d + h, 0.1, state) - law.force(d - h, 0.1, state)) / (2 * h)
        assert by_delta == pytest.approx(slope, rel=1e-3)
        rise = (law.force(d, 0.11, state) - law.force(d, 0.09, state)) / 0.02
        assert by_rate == pytest.approx(rise, rel=1e-6, abs=1e-9)
        path = np.linspace(0, d, 1001)
        force = [law.force(each, 0.0, state) for each in path]
        work = float(trapezoid(force, path))
        assert law.potential(d, state) == pytest.approx(work, rel=1e-4)
        np.testing.assert_allclose(law.energies(path, state)[-1], law.energy(d, state), rtol=1e-12)


@laws
def test_a_law_can_be_pickled_after_its_use(law: ao.ContactLaw) -> None:
    state = law.touch(0.8)
    force = law.force(1e-5, 0.1, state)
    assert pickle.loads(pickle.dumps(law)).force(1e-5, 0.1, state) == force
