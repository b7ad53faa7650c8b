"""Where charts put what they draw: limits, styles, labels and the numbers beside marks."""

from __future__ import annotations

from collections.abc import Iterator
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from antiosc import plotting
from antiosc.base import surfaces
from antiosc.base.surfaces import Deformed, deformed_figure

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


# -- surfaces in space


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
    assert np.all(drawn.get_linewidth() > 0)
    assert figure.axes[1].get_ylabel() == "what (N)"
    assert np.linalg.norm(surfaces.LIGHT) == pytest.approx(1, abs=0.02)
