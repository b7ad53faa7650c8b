"""Random scenes end: with finite forces, their energy, and after not too many steps."""

from __future__ import annotations

import numpy as np
import pytest

from scene_cases import random_scene

#: Steps that are tried at most: about five seconds.
ATTEMPTS = 2_000_000


@pytest.mark.slow
@pytest.mark.filterwarnings("ignore::antiosc.AccuracyWarning")
def test_random_scenes_end_with_their_energy() -> None:
    completed, seeds = 0, [104, *range(900, 1000)]
    for seed in seeds:
        hit = random_scene(seed).run(5e-3)
        energy = hit.energy
        assert hit.run.attempts <= ATTEMPTS, seed
        assert np.isfinite(hit.run.force).all(), seed
        if hit.status in (0, 3):
            completed += 1
            highest = np.max(energy.kinetic + energy.strain + energy.contact)
            assert np.max(energy.total - energy.total[0]) <= 1e-3 * highest, seed
    assert completed >= 0.98 * len(seeds)
