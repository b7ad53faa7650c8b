"""Warnings in the order of their weight, each once, with remedies that exist for the scene."""

from __future__ import annotations

from dataclasses import replace

import pytest

import antiosc as ao
import sheets
from antiosc.base.errors import (
    warnings_to,
)
from antiosc.base.texts import percent
from antiosc.impact import stretching


@pytest.mark.slow
@pytest.mark.fem
@pytest.mark.filterwarnings("ignore::antiosc.AntioscWarning")
def test_a_force_without_the_mesh_s_error_has_that_of_the_law_where_it_is_known():
    steel = ao.material("steel S235", thickness=0.002)
    part = ao.Structure(sheets.plate(8, 0.002).mesh, steel, sheets.SIMPLE)
    model = ao.extract(part, ao.Site((0.5, 0.45, 0.0), (0, 0, -1)), n=30, stretch="auto")
    ball = ao.Sphere(0.01, material="steel S235", velocity=0.1)
    hit = ao.simulate(model, ball, "auto", 5e-3)
    bar = hit.error_budget["peak_force"]
    assert bar.law > 0
    assert bar.known == pytest.approx(bar.numerical + bar.law)
    assert hit.error_budget.sides("peak_force") == (min(bar.known, 1.0), bar.known)
    assert bar.total is None
    told = hit.error_budget.shown("peak_force")
    assert told.endswith(" N (no error bar)")
    assert f"law {percent(bar.law)}" in hit.error_budget.causes_text("peak_force")


@pytest.mark.fem
@pytest.mark.filterwarnings("ignore::antiosc.AntioscWarning")
@pytest.mark.slow
def test_the_force_is_off_by_no_more_than_is_told_for_too_few_second_order_modes(monkeypatch):
    part = sheets.plate(8, 0.001)
    model = ao.extract(part, ao.Site((0.5, 0.45, 0.0), (0, 0, -1)), n=30, stretch="auto")
    striker = ao.RigidMass(0.2, 1.5)
    exact = ao.simulate(model, striker, ao.Hertz(1e7), 1e-2).peak_force
    monkeypatch.setattr(stretching, "MOST_MODES", 6)
    messages: list[str] = []
    with warnings_to(messages.append):
        hit = ao.simulate(model, striker, ao.Hertz(1e7), 1e-2)
    (told,) = (message for message in messages if message.startswith("Second-order forces"))
    motions = next(iter(hit.assembly.stretch_forces.values())).size
    assert f"those of {motions} motions" in told
    assert f"second-order forces of {motions} motions" in hit.summary()
    off = abs(hit.peak_force / exact - 1)
    shares = [share for share in range(1, 300) if f"error of {percent(share / 100)} of" in told]
    assert shares
    assert off <= shares[0] / 100


@pytest.mark.fem
@pytest.mark.filterwarnings("ignore::antiosc.AntioscWarning")
@pytest.mark.slow
def test_a_peak_before_the_sheet_stretches_has_no_share_of_its_later_deflection():
    """A plate's force peaked after 11 µs of 60 ms; the later change of its deflection by motions
    stood in the bar of the peak, 30 %, beside a change of the peak of 0.01 %.
    """
    part = sheets.plate(12, 0.001)
    model = ao.extract(part, ao.Site((0.5, 0.45, 0.0), (0, 0, -1)), n=100, stretch="auto")
    for law, striker in (
        (ao.Hertz(1e9), ao.RigidMass(0.01, 30.0)),  # peaks after 14 µs
        (ao.Hertz(1e7), ao.RigidMass(0.2, 3.0)),  # after 3.2 ms, as deep as it goes
    ):
        hit = ao.simulate(model, striker, law, 1e-2)
        linear = ao.simulate(replace(model, stretch=None), striker, law, 1e-2)
        before = stretching.energy_ratio_before_peak(hit)
        effect = abs(hit.peak_force / linear.peak_force - 1)
        assert effect <= 2 * before
        assert (effect < 1e-6) == (before < 1e-6)
    assert effect > 0.5
    changes = {"peak_force": 1e-4, "impulse": 1e-3, "contact_time": 0.0, "deflection": 0.2}
    early, late = (stretching.stretch_shares(changes, before) for before in (1e-6, 1.0))
    assert early["peak_force"] < 0.01
    assert late["peak_force"] == pytest.approx(stretching.STRETCH_SAFETY * 0.1)
    assert early["impulse"] == late["impulse"]
