"""Every step of the march keeps the equations of motion, the laws, friction and its own error.

And so do the loops that numba compiles: they give the numbers of NumPy's operations.
"""

from __future__ import annotations

from functools import cache
from types import ModuleType

import numpy as np
import pytest

from antiosc.simulation import march
from antiosc.simulation.engine import run
from audited_scenes import GIVEN, SCENES, SHARE, checked
from marches import written_out


@cache
def loops() -> ModuleType:
    return written_out()


@pytest.mark.parametrize("name", SCENES)
def test_steps_keep_motion_and_law(name: str) -> None:
    found = checked(name)
    errors = found.errors[np.isfinite(found.errors)]
    if errors.size:
        assert errors.max() < 1.5  # of the tolerance
        # a step with the error e could be e^(-1/3) times as long: few are needlessly short
        assert name in ("preloaded", "given step") or np.cbrt(errors).mean() > 0.3
    assert found.run.attempts < 1.6 * found.run.steps + 4 * found.run.touches + 10


@pytest.mark.parametrize("name", [name for name in SCENES if name != "own"])
def test_loops_give_the_numbers_of_numpy(name: str) -> None:
    found, step = checked(name), GIVEN.get(name)
    system, duration = found.made.system, SCENES[name][1]
    fine, share = found.made.lasting / 200, 0.05 if step else SHARE
    other = run(system, duration, share, module=loops(), fine=fine, step=step)
    assert other.answer == march.DONE
    np.testing.assert_allclose(other.time, found.run.time, rtol=1e-7)
    atol = 1e-6 * np.abs(found.run.force).max()
    np.testing.assert_allclose(other.force, found.run.force, rtol=0, atol=atol)
