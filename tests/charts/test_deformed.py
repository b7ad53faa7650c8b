"""Deformed surfaces: what is drawn by matplotlib, and what PyVista is asked for."""

from __future__ import annotations

import sys
from types import ModuleType, SimpleNamespace

import numpy as np
import pytest

from antiosc.charts import deformed, turning_child

plt = pytest.importorskip("matplotlib.pyplot")


@pytest.fixture(autouse=True)
def _close():
    plt.switch_backend("Agg")
    yield
    plt.close("all")


@pytest.mark.parametrize("corners", [1, 2, 3, 4])
def test_a_deformed_surface_is_drawn_in_its_scale_without_axes(corners):
    """Colours of the mean values of faces; the arrow ends where the impact is."""
    points = np.array([[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0.0]])
    moved = np.outer(np.arange(4), [0, 0, 1e-6])
    faces = np.arange(4)[None, :corners]
    found = deformed.Deformed.of(points, faces, moved, 3e-6)
    assert found.values == pytest.approx([0, 1, 2, 3])
    assert found.largest == pytest.approx(3)
    factor = float(found.label.split("× ")[1])
    assert found.label == f"displacement (µm), drawn × {factor:g}"
    assert factor == pytest.approx(deformed.ENLARGED / 3e-6, rel=0.34)  # of one digit
    np.testing.assert_allclose(found.moved, points + factor * moved, rtol=1e-12)
    tail, tip = found.arrow(np.array([1.0, 1, 0]), np.array([0, 0, -2.0]))
    assert tip.tolist() == [1, 1, 0]
    assert tail.tolist() == [1, 1, 0.25]
    figure = deformed.deformed_figure(found, arrow=(tip, np.array([0, 0, -1.0])), view=(20, 30))
    axes = figure.axes[0]
    assert not axes._axis3don
    assert (axes.elev, axes.azim) == (20, 30)


class Screen:
    """What PyVista is asked for."""

    def __init__(self) -> None:
        self.calls: dict[str, tuple] = {}

    def __getattr__(self, name: str):
        if name in ("camera", "trame"):
            return self

        def call(*args, **options):
            self.calls[name] = (args, options)
            return self

        return call


@pytest.mark.parametrize("page", [True, False])
@pytest.mark.parametrize("given", [True, False])
def test_pyvista_is_asked_for_surface_view_and_arrow(tmp_path, monkeypatch, page, given):
    """From above at 30° and from the side at 90°; by default as matplotlib's pictures are seen."""
    screen, drawn = Screen(), {}
    pyvista = ModuleType("pyvista")
    pyvista.Plotter = lambda **options: drawn.update(options) or screen
    pyvista.PolyData = lambda points, faces: drawn.update(points=points, faces=faces) or drawn
    pyvista.Arrow = lambda *args, **options: drawn.update(arrow=(args, options))
    monkeypatch.setitem(sys.modules, "pyvista", pyvista)
    points = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0.0]])
    arrow = np.array([[0, 0, 3.0], [0, 0, 1.0]])
    more = {"view": (30.0, 90.0), "scale": (0.0, 5.0)} if given else {}
    data = {"points": points, "faces": [[0, 1, 2]], "values": [1.0, 2, 3], "label": "a, b"}
    np.savez(tmp_path / "in.npz", arrow=arrow if given else np.zeros((0, 3)), **data, **more)
    target = str(tmp_path / ("page.html" if page else "picture.png"))
    turning_child.main(str(tmp_path / "in.npz"), target)
    assert drawn["off_screen"] is True
    assert drawn["window_size"] == ([900, 600] if page else [780, 600])
    assert drawn["faces"].tolist() == [3, 0, 1, 2]
    assert drawn["a, b"].tolist() == [1, 2, 3]
    (towards, up), _ = screen.calls["view_vector"]
    elevation, azimuth = np.radians((30, 90) if given else turning_child.VIEW)
    around = np.cos(elevation) * np.array([np.cos(azimuth), np.sin(azimuth)])
    np.testing.assert_allclose(towards, [*around, np.sin(elevation)], atol=1e-12)
    assert up == (0, 0, 1)
    assert ("arrow" in drawn) == given
    if given:
        (tail, along), options = drawn["arrow"]
        assert tail.tolist() == [0, 0, 3]
        assert along.tolist() == [0, 0, -2]
        assert options["scale"] == 2.0
    assert screen.calls["set_background"] == (("white",), {})
    if page:
        assert screen.calls["export_html"][0] == (target,)
        assert "screenshot" not in screen.calls
        return
    assert screen.calls["screenshot"][0] == (target,)
    assert screen.calls["enable_parallel_projection"] == ((), {})
    right, above = screen.calls["SetWindowCenter"][0]
    assert right > 0 == above  # the surface stands left of its scale
    assert screen.calls["zoom"][0][0] > 1


def test_the_scale_of_colours_is_that_which_is_given(tmp_path, monkeypatch):
    meshes = []
    plotter = SimpleNamespace(add_mesh=lambda *args, **options: meshes.append(options))
    pyvista = SimpleNamespace(PolyData=lambda points, faces: {})
    given = {"faces": np.array([[0, 1]]), "points": np.zeros((2, 3)), "values": [0, 1],
             "label": "a", "arrow": np.zeros((0, 3))}  # fmt: skip
    for scale, clim in ((np.array([0.0, 5.0]), [0, 5]), (np.zeros(0), None)):
        turning_child._fill(pyvista, plotter, {**given, "scale": scale}, False)
        assert meshes[-1]["clim"] == clim
        bar = meshes[-1]["scalar_bar_args"]
        assert bar["vertical"]
        assert bar["position_x"] + bar["width"] < 1
