"""Free modes of a reduced model of several sites: the shift that keeps its low modes exact."""

from __future__ import annotations

import numpy as np
import pytest

from antiosc.models.reduced_modes import MODEL_SHIFT, _lowest


@pytest.mark.parametrize("highest", [1e2, 1e8, 1e12])
def test_the_shift_is_of_the_size_of_the_lowest_elastic_mode(highest):
    """Two masses on a spring, beside a stiff oscillator: omega^2 = 2 k/m, whatever is above."""
    K = np.zeros((3, 3))
    K[:2, :2], K[2, 2] = [[3.0, -3.0], [-3.0, 3.0]], highest
    rigid = np.array([[1.0], [1.0], [0.0]]) / np.sqrt(2)
    assert _lowest(K, np.eye(3), rigid) == pytest.approx(MODEL_SHIFT * 6.0, rel=1e-3)
