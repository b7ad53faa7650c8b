"""Thresholds of decks: when a material is isotropic and directions are one."""

from __future__ import annotations

import numpy as np
import pytest

from antiosc.fem.readers.decks.deck import Place
from antiosc.fem.readers.decks.geometry import common_direction
from antiosc.fem.readers.decks.material import Material, isotropic


@pytest.mark.parametrize("k", range(9))
def test_a_material_is_isotropic_within_a_ten_thousandth(k):
    """Moduli and shear moduli relatively, Poisson's ratios by their difference."""
    for size, alike in ((0.9e-4, True), (1.2e-4, False), (-0.9e-4, True), (-1.2e-4, False)):
        v = isotropic(2e5, 0.3)
        v[k] += size * (1.0 if 3 <= k < 6 else v[k])
        if k in (0, 3):  # the first is what the others are compared with
            v = isotropic(2e5, 0.3)
        found = Material("a", Place("a deck", 1), v).isotropic
        assert (found is not None) == (alike or k in (0, 3))


def test_a_common_direction_has_a_cosine_with_each():
    a, b = np.array([1.0, 0, 0]), np.array([np.cos(0.4), np.sin(0.4), 0])
    mean = common_direction(np.array([a, a, b, b]), least=np.cos(0.21))
    np.testing.assert_allclose(mean, [np.cos(0.2), np.sin(0.2), 0])
    assert common_direction(np.array([a, b]), least=np.cos(0.19)) is None
    assert common_direction(np.array([a, -a])) is None
    wide = np.array([a, [np.cos(2.4), np.sin(2.4), 0]])
    assert common_direction(wide) is not None  # 69° to each side
    assert common_direction(np.array([a, [np.cos(2.6), np.sin(2.6), 0]])) is None
