"""Where charts put what they draw: limits, styles, labels and the numbers beside marks."""

from __future__ import annotations

from collections.abc import Iterator
from itertools import pairwise
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

import antiosc as ao
from antiosc import plotting
from antiosc.charts import figures, surfaces
from antiosc.charts.deformed import Deformed, deformed_figure

plt = pytest.importorskip("matplotlib.pyplot")


@pytest.fixture(autouse=True)
def _close() -> Iterator[None]:
    plt.switch_backend("Agg")
    yield
    plt.close("all")


def pulses(*spans: tuple[float, float, float], end: float = 0.2, **error: float) -> Any:
    """A history of half-sine pulses (start, end, peak); the site follows, the impactor flies."""
    time = np.unique(np.concatenate([np.linspace(0, end, 301), *(np.linspace(a, b, 41)
                                     for a, b, _ in spans)]))  # fmt: skip
    force = np.zeros_like(time)
    for a, b, peak in spans:
        during = (time >= a) & (time <= b)
        force[during] = peak * np.sin(np.pi * (time[during] - a) / (b - a))
    contacts = [
        SimpleNamespace(start=a, end=b, impulse=2 / np.pi * peak * (b - a)) for a, b, peak in spans
    ]
    return SimpleNamespace(
        time=time, force=force, displacement=1e-5 * force, impactor_displacement=0.3 * time - 0.01,
        peak_force=max((peak for _, _, peak in spans), default=0.0), error=error,
        contacts=[(a, b) for a, b, _ in spans], trajectory=SimpleNamespace(contacts=contacts),
    )  # fmt: skip


@pytest.mark.parametrize(
    ("spans", "side", "align"),
    [
        ([(0.0, 0.08, 30.0), (0.099, 0.1, 1.0)], 9, "left"),
        ([(0.0, 0.001, 1.0), (0.04, 0.1, 30.0)], -9, "right"),
    ],
)
def test_a_peak_is_named_on_the_side_with_more_space(spans: Any, side: int, align: str) -> None:
    """At 40 of 80 ms, and at 70 of 100."""
    hit = pulses(*spans)
    ax = plotting.plot_force(hit)
    (text,) = ax.texts
    at = 1e3 * hit.time[np.argmax(hit.force)]
    assert text.get_text() == f"30 N at {at:.3g} ms"
    assert (text.xy, text.xyann, text.get_ha()) == ((at, 30.0), (side, 4), align)
    mark = ax.lines[-1]
    assert mark.get_xydata().tolist() == [[at, 30.0]]
    assert (mark.get_marker(), mark.get_color()) == ("o", ax.lines[0].get_color())
    assert 3 <= mark.get_markersize() <= 8
    assert ax.lines[0].get_linewidth() == 1.5
    assert (ax.get_xlabel(), ax.get_ylabel()) == ("time (ms)", "contact force (N)")
    assert ax.get_legend() is None


def test_the_axes_of_a_force_hold_the_pulses_with_room() -> None:
    """99 % of the impulse: a last pulse of 0.5 % is left out, one of 2 % is not."""
    late = (0.15, 0.16, 40.0 * 0.005), (0.15, 0.16, 40.0 * 0.02)
    for last, end in zip(late, (0.02, 0.16), strict=True):
        ax = plotting.plot_force(pulses((0.01, 0.02, 40.0), last))
        room = 0.06 * (end - 0.01)
        np.testing.assert_allclose(ax.get_xlim(), (1e3 * (0.01 - room), 1e3 * (end + room)))
        np.testing.assert_allclose(ax.get_ylim(), (-0.05 * 40, 1.14 * 40))
    both = {"a": pulses((0.01, 0.02, 40.0)), "b": pulses((0.03, 0.05, 10.0))}
    ax = plotting.plot_force(both)
    np.testing.assert_allclose(ax.get_xlim(), (1e3 * (0.01 - 0.0024), 1e3 * (0.05 + 0.0024)))
    assert not ax.texts
    assert [each.get_linewidth() for each in ax.lines[::2]] == [2.6, 1.0]


def test_a_history_without_a_contact_has_its_whole_time_and_no_mark() -> None:
    ax = plotting.plot_force(pulses(end=0.4))
    np.testing.assert_allclose(ax.get_xlim(), (-24, 424))
    assert len(ax.lines) == 1
    assert not ax.texts
    low, high = ax.get_ylim()
    assert low < 0 < high


@pytest.mark.parametrize(
    ("count", "alpha", "thick"), [(6, None, 1.5), (7, 0.8, 1.0), (20, 0.8, 1.0), (21, 0.35, 0.6)]
)
def test_many_pulses_are_drawn_lightly_below_their_mean(
    count: int, alpha: float | None, thick: float
) -> None:
    spans = [(0.01 * i, 0.01 * i + 0.004, 5.0) for i in range(count)]
    hit = pulses(*spans, end=0.3)
    ax = plotting.plot_force(hit)
    line = ax.lines[0]
    assert (line.get_alpha(), line.get_linewidth()) == (alpha, thick)
    many = count >= 7
    np.testing.assert_allclose(ax.get_ylim(), (-0.25, 5 * (1.14 + (0.16 if many else 0.0))))
    if not many:
        return
    mean = ax.lines[1]
    window = (spans[-1][1] - spans[0][0]) / 25
    assert mean.get_label() == f"mean over {1e3 * window:.3g} ms"
    assert (mean.get_linewidth(), mean.get_color()) == (2, line.get_color())
    expected = plotting.running_mean(hit.time, hit.force, window)
    np.testing.assert_allclose(mean.get_xdata(), 1e3 * expected[0])
    np.testing.assert_allclose(mean.get_ydata(), expected[1])
    named = plotting.plot_force({"x": hit, "y": pulses((0.0, 0.1, 9.0))})
    names = [text.get_text() for text in named.get_legend().get_texts()]
    window = max(spans[-1][1], 0.1) / 25  # of the axis of both
    assert names == [f"x, mean over {1e3 * window:.3g} ms", "y"]


def test_an_error_is_a_band_from_half_a_percent_on() -> None:
    hit = pulses((0.0, 0.1, 10.0), peak=0.003)
    assert not plotting.plot_force(hit).collections
    hit.error["truncation peak_force"] = 0.002
    ax = plotting.plot_force(hit)
    (band,) = ax.collections
    assert band.get_label() == "estimated error ±0.5%"
    box = band.get_paths()[0].get_extents()
    np.testing.assert_allclose((box.ymin, box.ymax), (0.0, 10.05), atol=1e-9)
    assert 0 < band.get_alpha() < 0.5


def test_motions_are_in_the_box_of_the_site_and_of_the_contact() -> None:
    hit = pulses((0.02, 0.05, 100.0), (0.08, 0.1, 60.0))
    ax = plotting.plot_motion(hit)
    site, impactor = ax.lines
    assert (site.get_label(), impactor.get_label()) == ("structure, at the site", "impactor")
    assert (site.get_linestyle(), impactor.get_linestyle()) == ("-", "--")
    assert site.get_color() != impactor.get_color() == "C1"
    assert site.get_linewidth() == impactor.get_linewidth() == 1.5
    np.testing.assert_allclose(site.get_xdata(), 1e3 * hit.time)
    during = (hit.time >= 0.02) & (hit.time <= 0.1)
    seen = np.concatenate([hit.displacement, hit.impactor_displacement[during]])
    low, high = 1e3 * seen.min(), 1e3 * seen.max()
    room = 0.08 * (high - low)
    np.testing.assert_allclose(ax.get_ylim(), (low - room, high + room))
    np.testing.assert_allclose(ax.get_xlim(), (-4.0, 204.0))
    (shades,) = ax.collections
    boxes = [path.get_extents() for path in shades.get_paths()]
    found = [(box.xmin, box.ymin, box.xmax, box.ymax) for box in boxes]
    np.testing.assert_allclose(found, [(20, 0, 50, 1), (80, 0, 100, 1)])
    assert shades.get_zorder() == 0
    assert (ax.get_xlabel(), ax.get_ylabel()) == ("time (ms)", "displacement (mm)")
    two = plotting.plot_motion({"a": hit, "b": pulses((0.0, 0.1, 9.0), end=0.5)})
    assert not two.collections
    colors = [line.get_color() for line in two.lines]
    assert colors[0] == colors[1] != colors[2] == colors[3]
    np.testing.assert_allclose(two.get_xlim(), (-10, 510))
    assert [text.get_text() for text in two.get_legend().get_texts()] == ["a", "b"]


def test_a_running_mean_of_unequal_steps_is_the_integral_over_its_window() -> None:
    rng = np.random.default_rng(7)
    t = np.cumsum(rng.uniform(0.1, 1, 30)) + 3
    y = rng.normal(size=t.size)
    window = 2.5
    at, mean = plotting.running_mean(t, y, window)
    assert at.size == 400
    assert (at[0], at[-1]) == (t[0], t[-1])
    for i in range(0, 400, 37):
        fine = np.linspace(max(at[i] - window / 2, t[0]), min(at[i] + window / 2, t[-1]), 20_001)
        assert mean[i] == pytest.approx(np.interp(fine, t, y).mean(), abs=2e-4)
    still = plotting.running_mean([0.0, 0.0], [1.0, 1.0], 1.0)[1]
    np.testing.assert_array_equal(still, 1.0)


def test_masses_and_stiffness_have_their_axes() -> None:
    model = ao.AntiOscillators(m0=0.1, k0=1e5, m=[0.3, 0.2, 0.1], omega=[900.0, 2e3, 5e3])
    ax = plotting.plot_masses(model)
    np.testing.assert_allclose([bar.get_height() for bar in ax.patches], model.mass_shares)
    centres = [bar.get_x() + bar.get_width() / 2 for bar in ax.patches]
    np.testing.assert_allclose(centres, [1, 2, 3])
    together = ax.lines[0]
    np.testing.assert_allclose(together.get_ydata(), np.cumsum(model.mass_shares))
    np.testing.assert_allclose(together.get_xdata(), [1, 2, 3])
    assert (ax.get_xlim(), ax.get_ylim()) == ((0.4, 3.6), (0, 1.08))
    assert (ax.get_xlabel(), ax.get_ylabel()) == ("anti-oscillator", "share of the static mass")
    assert [text.get_text() for text in ax.get_legend().get_texts()] == ["together", "each"]
    omega = np.linspace(10.0, 6e3, 40)
    ax = plotting.plot_dynamic_stiffness(model, omega)
    np.testing.assert_allclose(ax.lines[0].get_xdata(), omega / (2 * np.pi))
    assert (ax.get_yscale(), ax.get_xscale()) == ("log", "linear")
    assert ax.get_legend() is None
    upper, lower = plotting.plot_model(model).axes
    assert upper.get_xlim() == (0, pytest.approx(1.1 * 5e3 / (2 * np.pi)))
    at = upper.lines[0].get_xdata()
    edges = np.array([0, 900.0, 2e3, 5e3, 5.5e3]) / (2 * np.pi)
    assert np.all(np.diff(at) > 0)
    for low, high in pairwise(edges):
        own = at[(at > low) & (at < high)]
        assert own.size == 159
        # denser near the ends, and alike at both
        np.testing.assert_allclose(own - low, high - own[::-1], rtol=1e-6, atol=1e-9)
        assert own[0] - low < 0.02 * (own[80] - own[79])
    assert lower.get_xlim() == (0.4, 3.6)


def test_errors_have_markers_that_leave_each_other_visible() -> None:
    series = {name: ([1.0, 10.0], [0.1, 0.01]) for name in "abc"}
    ax = plotting.plot_errors(series, styles={"b": "C3s--"})
    assert [line.get_markersize() for line in ax.lines] == [8, 6, 4]
    assert [line.get_marker() for line in ax.lines] == ["o", "s", "o"]
    assert {line.get_markerfacecolor() for line in ax.lines} == {"none"}
    assert (ax.get_xscale(), ax.get_yscale()) == ("log", "log")
    assert ax.xaxis.get_gridlines()[0].get_visible()
    alone = plotting.plot_errors({"a": ([1.0], [0.1])})
    assert alone.lines[0].get_markersize() == 8
    with pytest.raises(ao.InputError, match=r"must be \(cost, error\)"):
        plotting.plot_errors({"a": ([1.0], [0.1], [2.0])})


def test_logarithmic_axes_have_few_labels() -> None:
    """Of less than 1.5 decades 1, 2, 5, else decades alone."""
    for high, labels in ((29.0, ["1", "2", "5", "10", "20"]), (300.0, None)):
        ax = plotting.plot_errors({"a": ([1.1, 0.9 * high], [0.1, 0.01])})
        ax.set_xlim(1.0, high)
        figures.few_log_ticks(ax)
        ticks = ax.xaxis.get_major_locator().tick_values(1.0, high)
        shown = [ax.xaxis.get_major_formatter()(x) for x in ticks if 1 <= x <= high]
        assert shown == labels if labels else len(shown) == 3
        assert ax.xaxis.get_minor_formatter()(2.0) == ""


@pytest.mark.parametrize(
    ("values", "below", "above", "expected"),
    [([0, 10], 0.1, 0.2, (-1, 12)), ([5, 5], 0.1, 0.2, (4.5, 6)), ([0, 0], 0.1, 0.2, (-0.1, 0.2)),
     ([-4, -4, -4], 0.5, 0.25, (-6, -3))],
)  # fmt: skip
def test_room_around_values(values: Any, below: float, above: float, expected: Any) -> None:
    assert figures.with_room(values, below, above) == pytest.approx(expected)


def test_widths_fall_from_the_first_curve_to_the_last() -> None:
    np.testing.assert_allclose(figures.widths(dict.fromkeys("abc")), [2.6, 1.8, 1.0])
    np.testing.assert_allclose(figures.widths({"": 1}), [1.5])


def test_panels_have_the_size_that_is_asked_for() -> None:
    figure, axes = figures.panels(2, 3, (5.0, 4.0))
    assert axes.shape == (2, 3)
    np.testing.assert_allclose(figure.get_size_inches(), (5, 4))
    assert plt.get_fignums() == []
    figures.panels(1, 1, (0.5, 100.0), shown=True)
    assert len(plt.get_fignums()) == 1
    for size in ((0.49, 4.0), (4.0, 0.49), (101.0, 4.0), (4.0, 101.0)):
        with pytest.raises(ao.InputError, match=r"two lengths from 0\.5 to 100 inches"):
            figures.panels(1, 1, size)
    for count in ((21, 1), (1, 21), (0, 1)):
        with pytest.raises(ao.InputError):
            figures.panels(*count, (4.0, 4.0))


# -- surfaces in space


@pytest.mark.parametrize(("extent", "scale", "unit"), [(0.5, 1e3, "mm"), (1.5, 1.0, "m")])
def test_space_is_in_millimetres_below_a_metre(extent: float, scale: float, unit: str) -> None:
    points = np.array([[0, 0, 0], [0.1, extent, 0.2]])
    figure, axes, found, name = surfaces.space(points, shown=False)
    assert (found, name) == (scale, unit)
    assert (axes.elev, axes.azim) == (24, -52)
    assert axes.get_figure() is figure


def test_a_frame_has_equal_scales_and_few_ticks() -> None:
    """A box of 4 x 2 x 0: the flat side gets a twentieth of the longest."""
    _, axes, _, _ = surfaces.space(np.eye(3), shown=False)
    surfaces.frame(axes, np.array([[1.0, 2, 3], [5.0, 4, 3], [2.0, 3, 3]]), zoom=1.3)
    np.testing.assert_allclose(axes.get_xlim(), (1, 5))
    np.testing.assert_allclose(axes.get_ylim(), (2, 4))
    np.testing.assert_allclose(axes.get_zlim(), (2.9, 3.1))
    box = np.asarray(axes._box_aspect)
    np.testing.assert_allclose(box / box[0], [1, 0.5, 0.05])
    for axis, ticks in ((axes.xaxis, 4), (axes.yaxis, 2), (axes.zaxis, 1)):
        assert axis.get_major_locator()._nbins == ticks
    surfaces.frame(axes, np.zeros((1, 3)))
    assert axes.get_xlim()[0] < 0 < axes.get_xlim()[1]


def test_faces_are_shaded_by_the_angle_to_the_light() -> None:
    """Faces across the axes: the colour of the value times what a light from LIGHT leaves."""
    flat = np.add([[0.0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]], [2.0, 5.0, 3.0])
    corners = np.stack([flat, flat[:, [2, 0, 1]], flat[:, [1, 2, 0]]])
    value = np.array([1.0, 2.0, 4.0])
    figure, axes, _, _ = surfaces.space(flat, shown=False)
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
    assert np.all(drawn.get_linewidth() > 0)
    assert figure.axes[1].get_ylabel() == "what (N)"
    assert np.linalg.norm(surfaces.LIGHT) == pytest.approx(1, abs=0.02)


@pytest.mark.parametrize("corners", [1, 2])
def test_lines_and_points_have_the_colours_of_their_values(corners: int) -> None:
    at = np.array([[[0.0, 0, 0], [1, 0, 0]], [[0, 1, 0], [1, 1, 1]]])[:, :corners]
    value = np.array([3.0, 7.0])
    figure, axes, _, _ = surfaces.space(at.reshape(-1, 3), shown=False)
    scale = surfaces.colour_scale(value)
    surfaces.draw_lines(figure, axes, at, value, "what (m)", scale)
    (drawn,) = axes.collections
    if corners == 2:
        np.testing.assert_allclose(drawn.get_edgecolor(), scale.to_rgba(value))
    else:
        np.testing.assert_allclose(np.transpose(drawn._offsets3d), at[:, 0])
    assert figure.axes[1].get_ylabel() == "what (m)"


@pytest.mark.parametrize("whole", [False, True])
def test_a_deformed_part_stays_in_its_box(whole: bool) -> None:
    points = np.array([[0, 0, 0], [4, 0, 0], [4, 2, 0], [0, 2, 0.0]])
    moved = np.outer([0, 1, 2, 3.0], [0, 0, 1e-3])
    found = Deformed.of(points, np.arange(4)[None], moved, 6e-3)
    assert found.label.startswith("displacement (mm), drawn × ")
    np.testing.assert_allclose((found.values.max(), found.largest), (3, 6))
    arrow = np.array([4.0, 2, 0]), np.array([0, 0, -3.0])
    np.testing.assert_allclose(found.arrow(*arrow), [[4, 2, 1], [4, 2, 0]])
    axes, bar = deformed_figure(found, arrow=arrow, whole_scale=whole).axes
    top = 1.0 if whole else max(1.0, found.moved[:, 2].max())
    np.testing.assert_allclose(axes.get_zlim(), (0, top))
    np.testing.assert_allclose(axes.get_xlim(), (0, 4))
    assert bar.get_ylim()[1] == pytest.approx(6 if whole else 1.5, abs=0.2)
    still = Deformed.of(points, np.arange(4)[None], 0 * moved, 0.0)
    np.testing.assert_array_equal(still.moved, points)
