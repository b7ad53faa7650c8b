"""Gradients against differences of an integrator that shares nothing with the engine: DOP853."""

from __future__ import annotations

import numpy as np
import pytest

from gradient_scenes import rows

#: Largest error, over the goal by the number.
BOUND = 1e-5


@pytest.mark.slow
@pytest.mark.parametrize("seed", [1, 2])
def test_derivatives_and_their_errors(seed: int) -> None:
    """All goals by all numbers; `benchmarks/gradients.py` has 20 of these impacts."""
    found = rows(seed)
    errors, bars = (np.array([row[i] for row in found]) for i in (2, 3))
    assert errors.max() <= BOUND, found[int(np.argmax(errors))]
    # the references are themselves within some 1e-8
    assert np.all(errors <= bars + 2e-8), found[int(np.argmax(errors - bars))]
