"""Random scenes end: with finite forces, their energy, and in seconds."""

from __future__ import annotations

import signal
import warnings

import numpy as np
import pytest

import antiosc as ao
from scene_cases import random_scene


@pytest.mark.slow
def test_no_random_scene_takes_ten_seconds_of_cpu() -> None:
    def late(number: int, frame: object) -> None:
        raise TimeoutError

    before = signal.signal(signal.SIGPROF, late)
    completed, seeds = 0, [104, *range(900, 1000)]
    try:
        for seed in seeds:
            signal.setitimer(signal.ITIMER_PROF, 10.0)
            with warnings.catch_warnings():
                warnings.simplefilter("ignore", ao.AccuracyWarning)
                hit = random_scene(seed).run(5e-3)
            signal.setitimer(signal.ITIMER_PROF, 0.0)
            energy = hit.energy
            assert np.isfinite(hit.run.force).all(), seed
            if hit.status in (0, 3):
                completed += 1
                highest = np.max(energy.kinetic + energy.strain + energy.contact)
                assert np.max(energy.total - energy.total[0]) <= 1e-3 * highest, seed
    finally:
        signal.setitimer(signal.ITIMER_PROF, 0.0)
        signal.signal(signal.SIGPROF, before)
    assert completed >= 0.98 * len(seeds)
