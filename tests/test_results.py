"""Results of one family: each has a status, a message, a summary, numbers and a picture."""

from __future__ import annotations

import json

import numpy as np
import pytest

import antiosc as ao

FAMILY = {
    *("DesignMap", "Fall", "ForceComparison", "FoundImpact", "Gradient", "History", "ImpactMap"),
    *("Many", "PeakField", "SceneHistory", "ShockSpectrum"),
}
MODEL = ao.AntiOscillators(m0=0.1, k0=1e6, m=[0.3, 0.2], omega=[2e3, 7e3])
BALL, LAW, DURATION = ao.RigidMass(mass=0.2, velocity=1.0), ao.Hertz(1e9), 3e-3


def spread():
    def run(velocity):
        hit = ao.simulate(MODEL, ao.RigidMass(0.2, velocity), LAW, DURATION)
        return {"peak_force": hit.peak_force}

    return ao.monte_carlo(run, {"velocity": ao.normal(1.0, 0.05)}, n=60, seed=3)


RESULTS = {
    "History": lambda: ao.simulate(MODEL, BALL, LAW, DURATION),
    "impacts": lambda: ao.simulate_many(MODEL, [BALL, ao.RigidMass(0.1, 2.0)], LAW, DURATION),
    "draws": spread,
    "Gradient": lambda: ao.gradient(ao.simulate(MODEL, BALL, LAW, DURATION), "peak_force"),
}


@pytest.mark.parametrize("name", sorted(FAMILY))
def test_results_have_the_same_five_names(name):
    kind = getattr(ao, name)
    for member in ("status", "message", "summary", "numbers", "plot"):
        assert hasattr(kind, member) or member in kind.__dataclass_fields__, member


@pytest.mark.slow
@pytest.mark.parametrize("name", RESULTS)
def test_a_result_is_told_written_and_drawn(name, tmp_path):
    found = RESULTS[name]()
    assert not np.any(found.status)
    numbers = json.loads(json.dumps(found.numbers(), allow_nan=False))
    assert numbers["status"] == 0
    assert numbers["message"]
    assert found.summary().strip()
    picture = found.plot(tmp_path / "picture.png")
    assert picture.stat().st_size > 1000


def test_numbers_of_a_sample_are_its_quantiles():
    found = spread()
    numbers = found.numbers()
    assert numbers["peak_force"]["50 %"] == found.quantile("peak_force", 0.5).value
    assert found.numbers()["runs"] == 60
