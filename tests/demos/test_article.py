"""One test per claim of the article, on the demos that make benchmarks/ARTICLE.md."""

from __future__ import annotations

import importlib
from types import ModuleType
from typing import Any

import numpy as np
import pytest

from paths import demo

pytestmark = [pytest.mark.fem, pytest.mark.slow]

pytest.importorskip("dolfinx")


#: Models of case 2 of which another integrator repeats the run.
REPEATED = ("AO 9", "modes 10", "exact")


@pytest.fixture(scope="module")
def demos() -> dict[str, ModuleType]:
    """The demos' modules, which import one another by name."""
    names = {"article": "article", **{n: f"article_{n}" for n in ("case1", "case2", "parts")}}
    demo("article")  # puts their folder on the path
    return {short: importlib.import_module(name) for short, name in names.items()}


@pytest.fixture(scope="module")
def case1(demos) -> dict[str, Any]:
    return demos["case1"].main(
        step=1.2e-7, reference_modes=100, counts=(20, 50), refinements=((2, 50),), check=False
    )


@pytest.fixture(scope="module")
def case2(demos) -> dict[str, Any]:
    return demos["case2"].main(
        velocities=(0.01, 1.0),
        counts=(6, 12, 15, 20, 30),
        duration=2.5e-3,
        sweep=(1.55e10,),
        fe_counts=(5, 9, 20),
        reference_modes=80,
        check=REPEATED,
    )


def test_five_anti_oscillators_hold_89_percent(case1):
    """Of m_CR: 6/π² (1 + 1/4 + 1/9 + 1/16 + 1/25), and hardly less with rotary inertia."""
    series = 6 / np.pi**2 * sum(1 / i**2 for i in range(1, 6))
    assert case1["share_five_euler"] == pytest.approx(series, rel=1e-9)
    assert round(case1["share_five"], 2) == 0.89


def test_five_visible_anti_oscillators_hold_86_percent(case2):
    """Of m_st; the first five constraint modes, visible or not, hold 70 %."""
    assert round(case2["share_five"], 2) == 0.86
    assert round(case2["share_five_fe"], 2) == 0.86
    assert round(case2["share_first_five_modes"], 2) == 0.70


def test_no_lack_of_mass(case1, case2):
    assert case1["mass_balance"] < 1e-13
    assert case2["mass_balance"] < 1e-13


def test_half_periods_are_not_the_printed_ones(case1, case2):
    """π/ω₁ from the textbook: (π/L)² √(EI/rho S), and tan z = tanh z on half the span."""
    unit = np.sqrt(67e9 * 0.33e-8 / (2400 * 2e-4))
    assert case1["half_period_euler"] == pytest.approx(np.pi / (np.pi**2 * unit), rel=1e-9)
    z = 3.926602312047919
    assert case2["half_period_euler"] == pytest.approx(np.pi / ((2 * z) ** 2 * unit), rel=1e-9)
    assert case1["half_period"] == pytest.approx(14.84e-3, abs=0.005e-3)
    assert case2["half_period"] == pytest.approx(2.381e-3, abs=0.0005e-3)


def test_orders_of_convergence(case2):
    """Plain superposition is slow for shear's sake; static correction is the fastest."""
    ao, modes, corrected = case2["orders"][1.0].values()
    assert 0.7 < modes < 1.5
    assert ao > 2.5
    assert corrected > ao
    ao, modes, corrected = case2["orders"][0.01].values()
    assert modes < 2.5
    assert ao > 3.5
    assert corrected > 5


def test_nothing_left_out_is_the_unreduced_model(case1, case2):
    assert case1["untruncated"].force < 1e-6
    for errors in case2["untruncated"].values():
        assert errors.force < 1e-9


def test_two_integrators_agree_on_the_forces_of_case2(case2):
    """To the four digits that the table prints, where no sub-impact is left to chance."""
    for name in REPEATED:
        assert case2["integrators"][name].force < 2e-4
        assert case2["integrators"][name].peak < 1e-4
        assert case2["integrators"][name].contact_time < 1e-5


def test_plane_and_solid_parts_are_the_beam(demos):
    """Stiffness, mass, antiresonance and, where the contact is calm, the force."""
    parts = demos["parts"].main(
        across=3, per_fine=7, coarse=30e-3, n1=12, n2=12, reference_modes=60, check=False, step=2e-6
    )
    for beam, plane, solid in (case.values() for case in parts.values()):
        for part in (plane, solid):
            assert part.half_period == pytest.approx(beam.half_period, rel=2e-3)
            assert part.k0 == pytest.approx(beam.k0, rel=2e-3)
        assert plane.m_st == pytest.approx(beam.m_st, rel=2e-3)
    beam, plane, solid = parts["case 2"].values()
    assert plane.peak_force == pytest.approx(beam.peak_force, rel=0.03)
    assert plane.duration == pytest.approx(beam.duration, rel=0.01)
    assert solid.peak_force == pytest.approx(beam.peak_force, rel=0.05)


def test_figures_and_page(demos, case1, case2, tmp_path):
    """Every figure the page shows is drawn, and the page is written whole."""
    drawn = demos["case1"].figures(case1, tmp_path) + demos["case2"].figures(case2, tmp_path)
    assert all(path.stat().st_size > 1000 for path in drawn)
    article = demos["article"]
    sections = article.first_case(case1) + article.second_case(case2)
    shown = {part.split(")")[0] for part in sections.split("pictures/")[1:]}
    assert shown == {path.name for path in drawn}
    article.files.write_text(tmp_path / "page.md", sections)
    assert (tmp_path / "page.md").read_text(encoding="utf-8") == sections
    assert not list(tmp_path.glob(".*"))


def test_half_period_estimates_the_duration(case1, case2):
    assert case1["lasted"]["exact"] / case1["half_period"] == pytest.approx(1, abs=0.12)
    assert case2["lasted"]["exact"] / case2["half_period"] == pytest.approx(1, abs=0.05)


def test_duration_of_case1_read_from_the_displacement(case1):
    """The last contact ends well before the tip is seen to leave: 14.4 ms in the article."""
    assert case1["lasted"]["exact"] == pytest.approx(13.27e-3, abs=0.02e-3)
    assert case1["leaves_1mm"] == pytest.approx(14.4e-3, abs=0.1e-3)
