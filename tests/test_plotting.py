"""Charts show what they are given; without matplotlib they say what to install."""

from __future__ import annotations

import sys

import numpy as np
import pytest

import antiosc as ao
from antiosc import plotting
from scenes import HERTZ, case_two

plt = pytest.importorskip("matplotlib.pyplot")


@pytest.fixture(autouse=True)
def _close():
    plt.switch_backend("Agg")
    yield
    plt.close("all")


def test_force_and_motion_are_those_of_the_history():
    model, striker = case_two(3)
    hit = ao.simulate(model, striker, ao.Hertz(HERTZ), 1e-3)
    line = plotting.plot_force(hit).lines[0]
    assert np.array_equal(line.get_xdata(), 1e3 * hit.time)
    assert np.array_equal(line.get_ydata(), hit.force)
    site, mass = plotting.plot_motion({"3 AO": hit}).lines
    assert np.array_equal(site.get_ydata(), 1e3 * hit.displacement)
    assert np.array_equal(mass.get_ydata(), 1e3 * hit.impactor_displacement)
    ax = plotting.plot_force({"a": hit, "b": hit})
    assert [t.get_text() for t in ax.get_legend().get_texts()] == ["a", "b"]


def test_model_charts():
    model, _ = case_two(5)
    omega = np.linspace(10.0, 2e4, 50)
    ax = plotting.plot_dynamic_stiffness({"five": model, "two": model.truncated(2)}, omega)
    assert ax.lines[0].get_ydata() == pytest.approx(np.abs(model.dynamic_stiffness(omega)))
    ax = plotting.plot_masses(model)
    assert ax.lines[0].get_ydata()[-1] == pytest.approx(1 - model.m0 / model.m_st)
    with pytest.raises(ao.InputError, match="no anti-oscillator"):
        plotting.plot_masses(model.truncated(0))


def test_without_matplotlib(monkeypatch):
    monkeypatch.setitem(sys.modules, "matplotlib.pyplot", None)
    with pytest.raises(ao.MissingDependencyError, match="python3-matplotlib"):
        plotting.plot_masses(case_two(1)[0])
