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
