"""A measured force over the computed one: shift, scale, L2, peak."""

from __future__ import annotations

import numpy as np
import pytest

import antiosc as ao


@pytest.fixture(scope="module")
def hit() -> ao.History:
    model = ao.AntiOscillators(m0=0.02, k0=1e6, m=[0.1], omega=[2000.0])
    return ao.simulate(model, ao.RigidMass(0.1, velocity=1.0), ao.Hertz(1e9), duration=3e-3)


@pytest.mark.slow
def test_shift_and_scale_come_back(hit, tmp_path):
    t = np.linspace(0.0, 2.5e-3, 1001)
    path = tmp_path / "measured.csv"
    rows = np.column_stack([t + 0.7123, 1.1 * hit.force_at(t)])
    np.savetxt(path, rows, header="time (s), force (N)", delimiter=",", fmt="%.12e")
    found = ao.compare(hit, path)
    assert found.shift == pytest.approx(-0.7123, abs=1e-6)
    assert found.scale == pytest.approx(1.1, rel=1e-3)
    assert pytest.approx(0.1, rel=0.02) == found.L2
    assert found.scaled_L2 < 2e-3
    assert found.peak == pytest.approx(0.1, abs=1e-3)
    assert found.impulse == pytest.approx(0.1, abs=1e-3)
    assert found.plot(tmp_path / "over.png").is_file()


@pytest.mark.parametrize(
    "measured",
    [
        ([0.0, 1.0], [0.0, 1.0]),
        (np.arange(9.0), -np.ones(9)),
        (np.zeros(9), np.ones(9)),
        "none.csv",
    ],
)
def test_what_is_no_measured_force(hit, measured):
    with pytest.raises(ao.InputError):
        ao.compare(hit, measured)
