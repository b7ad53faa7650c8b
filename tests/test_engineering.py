"""What people read has engineering units; what programs read is in SI."""

from __future__ import annotations

import pytest

import antiosc as ao
from antiosc.base.texts import prefixed

HIT = ao.simulate(
    ao.AntiOscillators(m0=2e-3, k0=5e5, m=[0.05], omega=[2e3]),
    ao.RigidMass(0.2, 1.5),
    ao.Hertz(1e9),
    2e-3,
)


def test_a_summary_is_in_engineering_units_and_files_in_si(tmp_path):
    told = HIT.summary()
    assert f"{1e3 * HIT.contact_time:.3f} ms" in told
    assert "e-0" not in told.replace(f"{HIT.energy.drift:.1e}", "").split("force error")[0]
    HIT.to_json(tmp_path / "hit.json")
    assert repr(HIT.contact_time) in (tmp_path / "hit.json").read_text()


@pytest.mark.parametrize(
    ("largest", "unit", "wanted"),
    [(2.5e-4, "s", (1e6, "µs")), (0.0, "s", (1.0, "s")), (3.0, "rad/s", (1.0, "rad/s"))],
)
def test_the_prefix_of_a_column(largest, unit, wanted):
    factor, own = prefixed(largest, unit)
    assert (factor, own) == (pytest.approx(wanted[0]), wanted[1])
