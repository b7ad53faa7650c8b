"""Many impacts at once give what each gives alone."""

from __future__ import annotations

import pytest

import antiosc as ao


def test_the_patch_that_a_batch_asks_for_is_that_of_its_hardest_blow():
    """Of the scenes beyond the range of their law the one that needs the largest patch is told."""
    model = ao.AntiOscillators(0.1, 1e7, [], [], local_compliance=2e-8, radius=1e-3)
    balls = [ao.RigidMass(1.0, v) for v in (1e-3, 10.0, 30.0, 20.0)]
    with pytest.warns(ao.AccuracyWarning, match="3 of 4 scenes .1, 2, 3., as scene 2: the patch"):
        batch = ao.simulate_many(model, balls, ao.Hertz(1e9), 1e-2)
    assert "nan" not in repr(batch)
    assert "3 failed and count as the largest" in batch.summary()
    radii = [float(m.rpartition("at least ")[2].split()[0]) for m in batch.failures.values()]
    assert radii[1] == max(radii)
    with pytest.raises(ao.AccuracyError, match="scene 1: the patch radius"):
        ao.simulate_many(model, balls[1:], ao.Hertz(1e9), 1e-2)
