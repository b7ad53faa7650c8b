"""The bound on what the truncated modes do to Z: their mass on poles above the last known one."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import pytest

pytest.importorskip("dolfinx")

from antiosc.fem.extraction.oscillators import left_out

pytestmark = pytest.mark.fem

TOP = 4e6
X = (np.linspace(2e2, 3e3, 60) * (1 + 0.01j)) ** 2


def found(m0, complete=False):
    return SimpleNamespace(
        poles=np.array([1e5, TOP]),
        modes=SimpleNamespace(complete=complete),
        m0=np.atleast_2d(m0),
    )


def effect(m, pole):
    """Z with m on a pole less Z with m at the site: ω⁴ m/(p − ω²)."""
    return np.abs(X**2 * m / (pole - X))


@pytest.mark.parametrize("pole", [TOP, 1.3 * TOP, 5 * TOP, 1e12])
def test_no_truncated_mode_does_more(pole):
    bound = left_out(found(0.3))(X)
    assert (effect(0.3, pole) <= bound * (1 + 1e-12)).all()
    if pole == TOP:  # below the last pole it is the least bound
        below = X.real < TOP
        np.testing.assert_allclose(effect(0.3, pole)[below], bound[below], rtol=1e-12)
