"""Monte Carlo: distributions and bars against closed forms."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scipy import stats

import antiosc as ao
from antiosc.models.free_modes import SiteModels

WALL = ao.AntiOscillators(m0=1e6, k0=0.0, m=[], omega=[])


def blow(mass, velocity, K):
    """A mass on a wall that hardly moves: F = (5/4)^(3/5) K^(2/5) m^(3/5) v^(6/5)."""
    return WALL, ao.RigidMass(mass, velocity), ao.Hertz(K), 30 * (mass / K / velocity**0.5) ** 0.4


INPUTS = {
    "mass": ao.lognormal(0.1, 0.05),
    "velocity": ao.lognormal(2.0, 0.1),
    "K": ao.lognormal(1e8, 0.3),
}
POWERS = {"mass": 0.6, "velocity": 1.2, "K": 0.4}


def test_the_force_of_a_blow_is_lognormal():
    many = ao.monte_carlo(blow, INPUTS, 400)
    spreads = {name: law.kwds.get("s", law.args[0]) for name, law in INPUTS.items()}
    spread = np.sqrt(sum((POWERS[name] * s) ** 2 for name, s in spreads.items()))
    medians = {name: law.median() for name, law in INPUTS.items()}
    middle = 1.25**0.6 * np.prod([medians[name] ** power for name, power in POWERS.items()])
    for q in (0.05, 0.5, 0.95):
        true = middle * np.exp(spread * stats.norm.ppf(q))
        found = many.quantile("peak_force", q, confidence=0.999)
        assert found.low < true < found.high
    share = many.exceedance("peak_force", middle, confidence=0.999)
    assert share.low < 0.5 < share.high
    assert not many.failures
    assert "400" in repr(many)


def test_a_normal_input_has_a_variation_in_place_of_its_sigma():
    drawn = ao.normal(-2.0, variation=0.1)
    assert (drawn.mean(), drawn.std()) == pytest.approx((-2.0, 0.2))
    for both in ({}, {"sigma": 0.2, "variation": 0.1}):
        with pytest.raises(ao.InputError, match="takes one of them"):
            ao.normal(-2.0, **both)


def test_the_same_quantiles_stand_in_text_numbers_and_figure():
    """By default the middle 90 %; others in their order, each once."""
    usual = ao.monte_carlo(lambda x: x, {"x": np.arange(100.0)}, 200)
    assert list(usual.numbers()["value"]) == ["5 %", "50 %", "95 %"]
    many = ao.monte_carlo(lambda x: x, {"x": np.arange(100.0)}, 200, quantiles=(0.99, 0.5, 0.5))
    assert list(many.numbers()["value"]) == ["50 %", "99 %"]
    assert "at 50 and 99 %" in many.summary()
    told = [text.get_text() for text in many.plot().axes[0].get_legend().get_texts()]
    assert [text.split(":")[0] for text in told] == ["50 %", "99 %"]
    for wrong in ((), (0.0,), (1.5,)):
        with pytest.raises(ao.InputError, match="quantiles"):
            ao.monte_carlo(lambda x: x, {"x": np.arange(3.0)}, 3, quantiles=wrong)


@pytest.mark.parametrize("q", [0.05, 0.5, 0.99])
def test_a_bar_without_an_end_says_how_many_results_have_one(q):
    def bar(n):
        return ao.Many({"y": np.arange(float(n))}, {}).quantile("y", q)

    few = bar(3)
    needed = [int(each.split()[-3]) for each in few.note.split("; ")]
    assert np.isinf([few.low, few.high]).sum() == len(needed)
    for n in needed:
        assert sum(np.isinf([bar(n - 1).low, bar(n - 1).high])) > sum(
            np.isinf([bar(n).low, bar(n).high])
        )
    assert not bar(max(needed)).note


def test_runs_without_a_result_are_told():
    many = ao.Many({"y": np.where(np.arange(200) % 2, 1.0, np.nan)}, {})
    for found in (many.quantile("y", 0.5), many.exceedance("y", 0.5)):
        assert found.note.startswith("100 of 200 runs have no y")
    assert "without 100 runs" in repr(many)


def test_runs_that_failed_count_as_larger_than_all_others():
    """Of 0 ... 999, where those from 970 on failed: P(y > 950) is 0.049, the 99 % not known."""
    values = np.where(np.arange(1000) < 970, np.arange(1000.0), np.nan)
    failed = dict.fromkeys(range(970, 1000), "too hard")
    many = ao.Many({"y": values}, failed)
    assert many.quantile("y", 0.5).value == pytest.approx(499.5)
    assert many.quantile("y", 0.95).value == pytest.approx(0.95 * 999)
    assert np.isinf(many.quantile("y", 0.99).value)
    assert many.exceedance("y", 950.0).value == pytest.approx(0.049)
    assert "30 of 1000 runs failed" in many.quantile("y", 0.5).note
    assert replace(many, quantiles=(0.99,)).numbers()["y"] == {"99 %": None}


def test_the_quantiles_of_blows_count_those_that_their_patch_does_not_carry():
    """30 % of the draws exceed the law of the patch: no quantile above 70 % is known."""
    patched = ao.AntiOscillators(0.1, 1e7, [], [], local_compliance=2e-8, radius=1e-3)
    speeds = [*np.linspace(1e-3, 2e-3, 7), 10.0, 20.0, 30.0]

    def blow(velocity):
        return patched, ao.RigidMass(1.0, velocity), ao.Hertz(1e9), 1e-2

    with pytest.warns(ao.AccuracyWarning, match="larger than all others"):
        many = ao.monte_carlo(blow, {"velocity": speeds}, 400)
    assert 0.2 < len(many.failures) / 400 < 0.4
    assert np.isinf(many.quantile("peak_force", 0.9).value)
    assert np.isfinite(many.quantile("peak_force", 0.5).value)


@pytest.mark.slow
def test_bars_of_quantiles_and_probabilities_cover():
    rng = np.random.default_rng(1)
    inside = []
    for q in (0.1, 0.95):
        for sample in rng.exponential(size=(80, 120)):
            found = ao.Many({"y": sample}, {}).quantile("y", q)
            inside.append(found.low <= -np.log(1 - q) <= found.high)
            share = ao.Many({"y": sample}, {}).exceedance("y", -np.log(q))
            inside.append(share.low <= q <= share.high)
    assert np.mean(inside) >= 0.94


def test_blows_that_all_fail_in_one_part_cost_no_other():
    """Runs are simulated in parts of 100; simulate_many refuses a batch of which all fail."""
    calls = []

    def run(v):
        calls.append(v)
        yielding = ao.Tabulated([0.0, 1e-9], [0.0, 1.0])  # ends long before the blow does
        law = yielding if len(calls) <= 100 else ao.Hertz(1e8)
        return WALL, ao.RigidMass(0.1, v), law, 5e-3

    with pytest.warns(ao.AccuracyWarning, match="100 of 150 runs failed"):
        many = ao.monte_carlo(run, {"v": ao.uniform(1.0, 2.0)}, 150)
    assert list(many.failures) == list(range(100))
    assert len(many.finite("peak_force")) == 50


def test_points_of_a_map_are_drawn_by_their_areas():
    """Two triangles of areas 1 and 3: a corner has a third of those that meet in it."""
    points = np.array([[0.0, 0, 0], [1, 0, 0], [0, 2, 0], [-3, 0, 0]])
    sites = SiteModels(*np.outer([0.0, 1.0, 1.0], np.arange(1.0, 5.0)), *np.zeros((2, 4, 0)))
    found = ao.ImpactMap(
        points=points, directions=-points, elements=np.array([[0, 1, 2], [0, 2, 3]]), models=sites,
        local_compliance=np.zeros(4), radius=None, band=1.0, error=np.zeros(4),
        skipped=0, names=np.array([""] * 4),
    )  # fmt: skip
    assert found.areas == pytest.approx([4 / 3, 1 / 3, 4 / 3, 1.0])
    many = ao.monte_carlo(lambda site: site.m_st, {"site": found}, 1000)
    share = np.bincount(many.inputs["site"]) / 1000
    assert share == pytest.approx(found.areas / 4, abs=0.06)
    assert np.array_equal(many.values["value"], many.inputs["site"] + 1.0)
    lines = replace(found, elements=np.array([[0, 1], [1, 2]]))
    assert lines.areas == pytest.approx([0.5, (1 + 5**0.5) / 2, 5**0.5 / 2, 0.0])


@pytest.mark.parametrize(
    ("inputs", "run", "word"),
    [
        ({}, blow, ""),
        ({"mass": 1.0}, blow, ""),
        ({"mass": "abc"}, blow, ""),
        ({"two words": ao.normal(1, 1)}, blow, ""),
        ({"v": ao.normal(1, 1)}, lambda v: (v, v), ""),
        ({"v": ao.normal(1, 1)}, lambda v: "text", ""),
        ({"v": stats.cauchy(loc=np.nan)}, lambda v: v, ""),
    ],
)
def test_what_cannot_be_drawn_is_refused(inputs, run, word):
    with pytest.raises(ao.InputError, match=word or None):
        ao.monte_carlo(run, inputs, 5)


def test_runs_that_all_fail_alike_end_the_study_at_once():
    begun = []

    def run(x):
        begun.append(x)
        raise ao.AntioscError("no law is known")

    with pytest.raises(ao.AntioscError, match=r"first 10 of 500 runs failed alike.*no law"):
        ao.monte_carlo(run, {"x": ao.uniform(0.0, 1.0)}, 500)
    assert len(begun) == 10
