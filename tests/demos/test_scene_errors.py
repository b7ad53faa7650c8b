"""Errors of random blows under all laws, by benchmarks/scene_errors.py."""

from __future__ import annotations

import numpy as np
import pytest

from paths import demo

errors = demo("scene_errors")


@pytest.mark.slow
def test_a_few_blows() -> None:
    result = errors.main(scenes=4, first=20, tol=1e-2)
    assert set(result["counts"]) <= {"status 0", "status 3"}
    assert len(result["errors"]) == 4
    assert max(result["errors"]) <= 1
    assert min(result["errors"]) > 1e-4  # the truth is another run


@pytest.mark.slow
def test_forces_are_within_the_tolerance_in_99_of_100_scenes() -> None:
    result = errors.main(scenes=100)
    assert len(result["laws"]) == 12
    assert len(result["errors"]) >= 95
    assert np.mean(np.array(result["errors"]) <= 1) >= 0.99
