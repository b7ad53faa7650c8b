"""Charts show what they are given, where; without matplotlib they say what to install."""

from __future__ import annotations

import sys
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

import antiosc as ao
from antiosc import plotting
from antiosc.fields import deformed
from antiosc.plot import charts, surfaces
from antiosc.plot.surfaces import Deformed, deformed_figure
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


def test_without_matplotlib(monkeypatch):
    monkeypatch.setitem(sys.modules, "matplotlib.pyplot", None)
    with pytest.raises(ao.MissingDependencyError, match="python3-matplotlib"):
        plotting.plot_masses(case_two(1)[0])


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


@pytest.mark.parametrize(("settings", "told"), [({"text.usetex": True}, "usetex"), ({}, "names")])
def test_a_picture_that_cannot_be_drawn(tmp_path, monkeypatch, settings, told):
    """Without LaTeX, or with half a formula in a name."""
    monkeypatch.setenv("PATH", str(tmp_path))
    with plt.rc_context(settings):
        figure, _ = charts.panels(1, 1, (3.0, 2.0))
        figure.suptitle("$" + "\\half{$")
        with pytest.raises(ao.InputError, match=told):
            charts.save_figure(figure, tmp_path / "picture.svg")
    assert not list(tmp_path.iterdir())


def test_the_picture_of_a_body_is_at_its_own_largest_motion():
    model, striker = case_two(3)
    hit = ao.simulate(model, striker, ao.Hertz(HERTZ), 1e-3)
    largest = np.abs(hit.displacement), np.abs(hit.impactor_displacement)
    assert np.argmax(largest[0]) != np.argmax(largest[1])
    for body, expected in zip(("structure", "impactor"), largest, strict=True):
        assert np.array_equal(deformed._motion(hit, body), expected)


def test_each_contact_is_shaded():
    hit = impact(8e-3)
    (shades,) = plotting.plot_motion(hit).collections
    found = [path.get_extents() for path in shades.get_paths()]
    expected = [(1e3 * start, 1e3 * end) for start, end in hit.contacts]
    assert len(expected) > 1
    np.testing.assert_allclose([(box.xmin, box.xmax) for box in found], expected)


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


def pulses(*spans: tuple[float, float, float], end: float = 0.2, **error: float) -> Any:
    """A history of half-sine pulses (start, end, peak); the site follows, the impactor flies."""
    time = np.unique(np.concatenate([np.linspace(0, end, 301), *(np.linspace(a, b, 41)
                                     for a, b, _ in spans)]))  # fmt: skip
    force = np.zeros_like(time)
    for a, b, peak in spans:
        during = (time >= a) & (time <= b)
        force[during] = peak * np.sin(np.pi * (time[during] - a) / (b - a))
    areas = np.diff(time) * (force[1:] + force[:-1]) / 2
    return SimpleNamespace(
        time=time, force=force, displacement=1e-5 * force, impactor_displacement=0.3 * time - 0.01,
        indentation=0.3 * time - 0.01 - 1e-5 * force,
        peak_force=max((peak for _, _, peak in spans), default=0.0), error=error,
        contacts=[(a, b) for a, b, _ in spans],
        cumulative_impulse=np.append(0.0, np.cumsum(areas)),
    )  # fmt: skip


def test_the_axes_of_a_force_hold_the_pulses_with_room() -> None:
    """99 % of the impulse: a last pulse of 0.5 % is left out, one of 2 % is not."""
    late = (0.15, 0.16, 40.0 * 0.005), (0.15, 0.16, 40.0 * 0.02)
    for last, end in zip(late, (0.02, 0.16), strict=True):
        ax = plotting.plot_force(pulses((0.01, 0.02, 40.0), last))
        room = 0.06 * (end - 0.01)
        np.testing.assert_allclose(ax.get_xlim(), (1e3 * (0.01 - room), 1e3 * (end + room)))
        np.testing.assert_allclose(ax.get_ylim(), (-0.05 * 40, 1.14 * 40))
        assert ax.texts[0].get_text().startswith("40.00 N")
    both = {"a": pulses((0.01, 0.02, 40.0)), "b": pulses((0.03, 0.05, 10.0))}
    ax = plotting.plot_force(both)
    np.testing.assert_allclose(ax.get_xlim(), (1e3 * (0.01 - 0.0024), 1e3 * (0.05 + 0.0024)))
    assert not ax.texts
    assert [each.get_linewidth() for each in ax.lines[::2]] == [2.6, 1.0]


@pytest.mark.parametrize("whole", [False, True])
def test_a_deformed_part_stays_in_its_box(whole: bool) -> None:
    points = np.array([[0, 0, 0], [4, 0, 0], [4, 2, 0], [0, 2, 0.0]])
    moved = np.outer([0, 1, 2, 3.0], [0, 0, 1e-3])
    found = Deformed.of(points, np.arange(4)[None], moved, 6e-3)
    assert found.label.startswith("displacement (mm), drawn × ")
    np.testing.assert_allclose((found.values.max(), found.largest), (3, 6))
    arrow = np.array([4.0, 2, 0]), np.array([0, 0, -3.0])
    np.testing.assert_allclose(found.arrow(*arrow), [[4, 2, 1], [4, 2, 0]])
    axes, bar = deformed_figure(found, arrow=arrow, view=(20, 30), whole_scale=whole).axes
    assert not axes._axis3don
    assert (axes.elev, axes.azim) == (20, 30)
    top = 1.0 if whole else max(1.0, found.moved[:, 2].max())
    np.testing.assert_allclose(axes.get_zlim(), (0, top))
    np.testing.assert_allclose(axes.get_xlim(), (0, 4))
    assert bar.get_ylim()[1] == pytest.approx(6 if whole else 1.5, abs=0.2)
    still = Deformed.of(points, np.arange(4)[None], 0 * moved, 0.0)
    np.testing.assert_array_equal(still.moved, points)


def test_faces_of_a_mask_are_white_with_dark_edges() -> None:
    corners = np.add([[0.0, 0, 0], [1, 0, 0], [1, 1, 0]], [[[0.0, 0, k]] for k in range(3)])
    figure, axes, _, _ = surfaces.axes_in_space(corners[0], shown=False)
    scale, mask = surfaces.colour_scale(np.arange(3.0)), np.array([False, True, False])
    surfaces.draw_faces(figure, axes, corners, np.arange(3.0), "", scale, outlined=mask)
    (drawn,) = axes.collections
    assert (drawn._facecolor3d[:, :3] == 1).all(axis=1).tolist() == mask.tolist()
    assert (drawn._edgecolor3d[:, :3] == 0).all(axis=1).tolist() == mask.tolist()


def test_faces_are_shaded_by_the_angle_to_the_light() -> None:
    """Faces across the axes: the colour of the value times what a light from LIGHT leaves."""
    flat = np.add([[0.0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]], [2.0, 5.0, 3.0])
    corners = np.stack([flat, flat[:, [2, 0, 1]], flat[:, [1, 2, 0]]])
    value = np.array([1.0, 2.0, 4.0])
    figure, axes, _, _ = surfaces.axes_in_space(flat, shown=False)
    scale = surfaces.colour_scale(value)
    assert (scale.norm.vmin, scale.norm.vmax) == (1, 4)
    surfaces.draw_faces(figure, axes, corners, value, "what (N)", scale, dark=0.5)
    (drawn,) = axes.collections
    colours = scale.to_rgba(value)
    across = [np.cross(c[1] - c[0], c[2] - c[0]) for c in corners]  # of length 1
    shade = 0.5 + 0.5 * np.abs(np.array(across) @ surfaces.LIGHT)
    expected = colours.copy()
    expected[:, :3] *= shade[:, None]
    np.testing.assert_allclose(drawn._facecolor3d, expected)
    np.testing.assert_allclose(drawn._edgecolor3d, expected)
    assert np.min(drawn.get_linewidth()) > 0
    assert figure.axes[1].get_ylabel() == "what (N)"
    assert np.linalg.norm(surfaces.LIGHT) == pytest.approx(1, abs=0.02)
