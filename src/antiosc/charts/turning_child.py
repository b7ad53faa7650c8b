"""The process that lets PyVista draw a surface (`antiosc.charts.turning`)."""

from __future__ import annotations

import sys
import warnings
from math import cos, radians, sin
from typing import Any

import numpy as np

#: Pixels of a page and of a picture, without which PyVista asks for a screen.
PAGE, PICTURE = (900, 600), (780, 600)
#: From where it is seen: elevation and azimuth of matplotlib's pictures, degrees.
VIEW = (24.0, -52.0)


def main(source: str, target: str) -> None:
    """Write the page or the picture `target` of the surface in `source`."""
    import pyvista

    with np.load(source) as data:
        given = {name: data[name] for name in data.files}
    page = target.endswith(".html")
    plotter = pyvista.Plotter(off_screen=True, window_size=list(PAGE if page else PICTURE))
    plotter.set_background("white")
    _fill(pyvista, plotter, given, page)
    up, around = map(radians, given.get("view", VIEW))
    plotter.view_vector((cos(up) * cos(around), cos(up) * sin(around), sin(up)), (0, 0, 1))
    if not page:
        plotter.enable_parallel_projection()
        plotter.camera.zoom(1.15)
        plotter.camera.SetWindowCenter(0.18, 0.0)  # to the left, beside the scale
        plotter.screenshot(target)
        return
    # PyVista 0.48 moved the export to a component of trame
    of = getattr(plotter, "trame", plotter)
    of.export_html(target)


def _fill(pyvista: Any, plotter: Any, given: dict[str, Any], page: bool) -> None:
    """The surface with its scale of colours, and the arrow."""
    faces, label = given["faces"], str(given["label"])
    counts = np.full((len(faces), 1), faces.shape[1])
    surface = pyvista.PolyData(given["points"], np.hstack([counts, faces]).ravel())
    surface[label] = given["values"]
    bar = {"title": label, "color": "black", "n_labels": 4, "fmt": "%.3g"}
    if not page:
        bar |= {"title": label.replace(", ", ",\n") + "\n", "vertical": True, "height": 0.7}
        bar |= {"width": 0.07, "position_x": 0.84, "position_y": 0.12}
        bar |= {"title_font_size": 13, "label_font_size": 13}
    clim = given.get("scale", ())
    plotter.add_mesh(
        surface,
        scalars=label,
        cmap="viridis",
        ambient=0.25,
        clim=list(clim) if len(clim) else None,
        scalar_bar_args=bar,
    )
    if len(given["arrow"]):
        tail, tip = given["arrow"]
        length = float(np.linalg.norm(tip - tail))
        shape = pyvista.Arrow(tail, tip - tail, scale=length, tip_length=0.2, shaft_radius=0.025)
        plotter.add_mesh(shape, color="firebrick")


if __name__ == "__main__":
    warnings.simplefilter("ignore")
    main(*sys.argv[1:])
