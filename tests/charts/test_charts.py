"""Charts show what they are given, where; without matplotlib they say what to install."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import pytest

import antiosc as ao
import pictures
from antiosc import plotting
from antiosc.plot import charts
from scenes import HERTZ, case_two

plt = pytest.importorskip("matplotlib.pyplot")


@pytest.fixture(autouse=True)
def _drawn_as_by_users(monkeypatch):
    monkeypatch.setattr(charts, "render", pictures.render)
    plt.switch_backend("Agg")
    yield
    plt.close("all")


def test_force_and_motion_are_those_of_the_history():
    model, striker = case_two(3)
    hit = ao.simulate(model, striker, ao.Hertz(HERTZ), 1e-3)
    line = plotting.plot_force(hit).lines[0]
    assert np.array_equal(line.get_xdata(), 1e6 * hit.time)
    assert np.array_equal(line.get_ydata(), hit.force)
    site, mass = plotting.plot_motion({"3 AO": hit}).lines
    assert np.array_equal(site.get_ydata(), 1e6 * hit.displacement)  # µm: 5.8 at most
    assert np.allclose(mass.get_ydata(), 1e6 * hit.impactor_displacement, atol=1e-12)


def test_the_motions_of_a_scene_meet_at_the_touch_under_the_names_of_its_bodies():
    contact = ao.Contact("beam", "stop", ao.Linear(1e6), gap=2e-4)
    pull = ao.Load("beam", [0.0, 1e-3, 2e-3], [0.0, -50.0, 0.0])
    scene = ao.Scene({"beam": case_two(3)[0], "stop": ao.Obstacle()}, [contact], loads=[pull])
    hit = scene.run(4e-3)
    (ax,) = hit.plot().axes[1:]
    beam, stop = ax.lines
    assert np.allclose(stop.get_ydata(), -200.0)  # µm
    low, high = ax.get_ylim()
    assert low < -200.0 < high
    assert [text.get_text() for text in ax.get_legend().get_texts()][:2] == [
        "beam, at the site",
        "stop",
    ]
    touch = hit.contacts[0][0]
    assert np.interp(1e3 * touch, beam.get_xdata(), beam.get_ydata()) == pytest.approx(
        -200.0, rel=1e-2
    )
    assert np.diff(beam.get_xdata()).max() < 0.1  # nodes in flights, too
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


def test_model_of_several_sites():
    model = ao.AntiOscillators(
        m0=[[0.2, 0.05], [0.05, 0.1]], k0=[[3e6, 1e6], [1e6, 2e6]], P=[[0.3, 0.1], [0.2, -0.2]],
        omega=[2e3, 6e3], sites=["tip", "heel"],
    )  # fmt: skip
    w = np.linspace(100, 5e3, 40)
    ax = plotting.plot_dynamic_stiffness({"part": model}, w)
    Z = np.abs(model.dynamic_stiffness(w))
    for line, entry in zip(ax.lines, ((0, 0), (0, 1), (1, 1)), strict=True):
        np.testing.assert_allclose(line.get_ydata(), Z[:, entry[0], entry[1]])
    names = [text.get_text() for text in ax.get_legend().get_texts()]
    assert names == ["part: tip", "part: tip, heel", "part: heel"]
    shares = plotting.plot_masses(model).lines[0].get_ydata()
    rest = np.trace(np.linalg.solve(model.m_st, model.m0)) / 2
    assert shares[-1] == pytest.approx(1 - rest)
    assert len(model.plot().axes) == 2


def impact(duration: float = 3e-3, **options) -> ao.History:
    return ao.simulate(*case_two(3), ao.Hertz(HERTZ), duration, **options)


def test_an_error_has_a_band():
    hit = impact(8e-3)
    hit.error.clear()
    assert not plotting.plot_force(hit).collections
    hit.error["peak"] = 0.1
    (band,) = plotting.plot_force(hit).collections
    assert band.get_paths()[0].get_extents().ymax == pytest.approx(1.1 * hit.force.max())
    told_beside = SimpleNamespace(sides=lambda _: (0.3, 0.3), no_bar=False, condition="")
    vars(hit)["error_budget"] = told_beside
    axes = plotting.plot_force(hit)
    (band,) = axes.collections
    assert band.get_paths()[0].get_extents().ymax == pytest.approx(1.3 * hit.force.max())
    assert axes.get_ylim()[1] > 1.3 * hit.force.max()  # the axis cut it
    told_beside.no_bar = True  # the band is the error of the run alone
    (band,) = plotting.plot_force(hit).collections
    assert band.get_paths()[0].get_extents().ymax == pytest.approx(1.1 * hit.force.max())


@pytest.mark.slow
def test_histories_and_models_plot_themselves(tmp_path):
    hit, model = impact(), case_two(3)[0]
    for one, name, panels in ((hit, "hit.png", 2), (model, "model.svg", 3)):
        assert one.plot(tmp_path / name) == tmp_path / name
        assert (tmp_path / name).stat().st_size > 3000
        assert len(one.plot().axes) == panels
    assert plt.get_fignums() == [1, 2]  # a figure that is only written is no pyplot figure
    with pytest.raises(ao.InputError, match="picture"):
        hit.plot(tmp_path / "hit.txt")
    with pytest.raises(ao.InputError, match="no anti-oscillator"):
        model.truncated(0).plot()
    # the picture tells what the model consists of: 6 of its anti-oscillators, and the others' mass
    words = " ".join(text.get_text() for text in model.plot().axes[0].texts)
    assert f"{model.omega[0] / (2 * np.pi):.3g}" in words
    # poles and zeros of Z are resolved: each antiresonance is a local maximum of the curve
    line = model.plot().axes[1].lines[0]
    at, value = line.get_xdata(), line.get_ydata()
    for omega in model.omega:
        near = np.abs(at - omega / (2 * np.pi)) < 0.02 * omega / (2 * np.pi)
        assert value[near].max() > 30 * np.median(value)
