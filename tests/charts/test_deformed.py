"""Deformed surfaces: what is drawn."""

from __future__ import annotations

import numpy as np
import pytest

from antiosc.base.charts import surfaces

plt = pytest.importorskip("matplotlib.pyplot")


@pytest.fixture(autouse=True)
def _close():
    plt.switch_backend("Agg")
    yield
    plt.close("all")


@pytest.mark.sample(-1)
@pytest.mark.parametrize("corners", [1, 2, 3, 4])
def test_a_deformed_surface_is_drawn_in_its_scale_without_axes(corners):
    """Colours of the mean values of faces; the arrow ends where the impact is."""
    points = np.array([[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0.0]])
    moved = np.outer(np.arange(4), [0, 0, 1e-6])
    faces = np.arange(4)[None, :corners]
    found = surfaces.Deformed.of(points, faces, moved, 3e-6)
    assert found.values == pytest.approx([0, 1, 2, 3])
    assert found.largest == pytest.approx(3)
    factor = float(found.label.split("× ")[1])
    assert found.label == f"displacement (µm), drawn × {factor:g}"
    assert factor == pytest.approx(surfaces.ENLARGED / 3e-6, rel=0.34)  # of one digit
    np.testing.assert_allclose(found.moved, points + factor * moved, rtol=1e-12)
    tail, tip = found.arrow(np.array([1.0, 1, 0]), np.array([0, 0, -2.0]))
    assert tip.tolist() == [1, 1, 0]
    assert tail.tolist() == [1, 1, 0.25]
    figure = surfaces.deformed_figure(found, arrow=(tip, np.array([0, 0, -1.0])), view=(20, 30))
    axes = figure.axes[0]
    assert not axes._axis3don
    assert (axes.elev, axes.azim) == (20, 30)
