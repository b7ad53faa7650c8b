"""The process that lets PyVista write the page of a surface (`antiosc.plotting.turning`)."""

from __future__ import annotations

import sys
import warnings

import numpy as np

#: Pixels of the page, without which PyVista asks for a screen.
SIZE = (900, 600)
#: From where it is seen first: 24° above the horizon, as matplotlib's pictures.
VIEW = (0.56, -0.72, 0.41)


def main(source: str, target: str) -> None:
    """Write the page `target` of the surface in `source`."""
    import pyvista

    with np.load(source) as data:
        points, faces, values = data["points"], data["faces"], data["values"]
        label, arrow = str(data["label"]), data["arrow"]
    counts = np.full((len(faces), 1), faces.shape[1])
    surface = pyvista.PolyData(points, np.hstack([counts, faces]).ravel())
    surface[label] = values
    plotter = pyvista.Plotter(off_screen=True, window_size=list(SIZE))
    plotter.set_background("white")
    bar = {"title": label, "color": "black", "n_labels": 4, "fmt": "%.3g"}
    plotter.add_mesh(surface, scalars=label, cmap="viridis", ambient=0.25, scalar_bar_args=bar)
    if len(arrow):
        tail, tip = arrow
        length = float(np.linalg.norm(tip - tail))
        shape = pyvista.Arrow(tail, tip - tail, scale=length, tip_length=0.2, shaft_radius=0.025)
        plotter.add_mesh(shape, color="firebrick")
    plotter.view_vector(VIEW, viewup=(0, 0, 1))
    # PyVista 0.48 moved the export to a component of trame
    of = getattr(plotter, "trame", plotter)
    of.export_html(target)


if __name__ == "__main__":
    warnings.simplefilter("ignore")
    main(*sys.argv[1:])
