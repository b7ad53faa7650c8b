"""Too few anti-oscillators for a contact are told."""

from __future__ import annotations

import warnings

import numpy as np
import pytest

import antiosc as ao

BALL = ao.RigidMass(0.05, 1.0)
LAW = ao.Hertz(1e9)


def chain(n: int) -> ao.AntiOscillators:
    """A long string, struck in its middle, which is a damper for blows shorter than its waves."""
    size, pull, mass = 100, 4e6, 1e-3
    K = pull * (2 * np.eye(size) - np.eye(size, k=1) - np.eye(size, k=-1))
    part = ao.Structure.from_matrices(K, mass * np.eye(size))
    return ao.extract(part, ao.Site(dof=size // 2), n=n)


@pytest.mark.slow
def test_a_contact_that_is_too_short_for_the_model_is_told():
    whole = chain(60)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        truth = ao.simulate(whole, BALL, LAW, 4e-3)
    few = chain(16)
    with pytest.warns(ao.AccuracyWarning, match="too few for this contact"):
        hit = ao.simulate(few, BALL, LAW, 4e-3)
    assert "16 anti-oscillators" in hit.summary()
    wrong = abs(hit.peak_force / truth.peak_force - 1)
    assert 0.1 < wrong < ao.truncation_error(few, hit.rerun).peak_force
