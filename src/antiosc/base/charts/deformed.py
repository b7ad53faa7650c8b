"""The deformed surface of a part as a picture."""

from __future__ import annotations

import os
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from antiosc.base._types import Array, IntArray
from antiosc.base.charts.figures import finished
from antiosc.base.charts.surfaces import colour_scale, draw_faces, draw_lines, frame, space

if TYPE_CHECKING:
    from matplotlib.figure import Figure

#: Motions are drawn this share of the part's largest dimension.
ENLARGED = 0.08


@dataclass(frozen=True, eq=False)
class Deformed:
    """A surface at one time.

    Attributes
    ----------
    points, moved : (P, 3) [m], at rest and with displacements drawn larger.
    faces : (F, 3 or 4) indices of corners; (F, 2) of lines, (F, 1) of points.
    values : (P,) magnitude of the displacements, in the unit that `label` states.
    label : of the values, with the factor by which displacements are drawn larger.
    largest : value of all times.
    """

    points: Array
    moved: Array
    faces: IntArray
    values: Array
    label: str
    largest: float

    @classmethod
    def of(cls, points: Array, faces: IntArray, moved: Array, largest: float) -> Deformed:
        """Of displacements (P, 3) [m], drawn larger by what suits the largest one [m]."""
        shown, factor = largest or 1.0, enlarged(points, largest)
        micro, unit = (1e6, "µm") if shown < 1e-3 else (1e3, "mm")
        size = np.linalg.norm(moved, axis=1)
        label = f"displacement ({unit}), drawn × {factor:g}"
        return cls(points, points + factor * moved, faces, micro * size, label, micro * largest)

    def arrow(self, point: Array, direction: Array) -> Array:
        """Tail and tip (2, 3) [m] of an arrow along `direction` that ends at `point`."""
        length = 0.25 * np.ptp(self.points, axis=0).max()
        return np.array([point - length * direction / np.linalg.norm(direction), point])


def enlarged(points: Array, largest: float) -> float:
    """The factor by which displacements are drawn larger, of which the largest one is this [m]."""
    return float(f"{ENLARGED * np.ptp(points, axis=0).max() / (largest or 1.0):.1g}")


def draw_deformed(
    found: Deformed,
    path: str | os.PathLike[str] | None,
    *,
    arrow: tuple[Array, Array] | None = None,
    view: Array | None = None,
    whole_scale: bool = False,
    mark: int | None = None,
) -> Figure | Path:
    """A figure of a deformed surface, or its file; options as of `deformed_figure`."""
    figure = deformed_figure(
        found, arrow=arrow, view=view, whole_scale=whole_scale, mark=mark, shown=path is None
    )
    return finished(figure, path)


def deformed_figure(
    found: Deformed,
    *,
    arrow: tuple[Array, Array] | None = None,
    view: Array | None = None,
    whole_scale: bool = False,
    mark: int | None = None,
    shown: bool = False,
) -> Figure:
    """A figure of a deformed surface.

    arrow : point and direction of the impact.
    view : (elevation, azimuth), degrees.
    whole_scale : colours from zero to the largest of all times, in the box of the part at rest.
    mark : number of a point that gets a ring and its value.
    """
    figure, axes, scale, _ = space(found.points, shown)
    corners = scale * found.moved[found.faces]
    values = found.values[found.faces].mean(axis=1)
    colours = colour_scale(np.array([0.0, found.largest]) if whole_scale else values)
    if found.faces.shape[1] > 2:
        draw_faces(figure, axes, corners, values, found.label, colours)
    else:
        draw_lines(figure, axes, corners, values, found.label, colours)
    rest = scale * found.points[np.unique(found.faces)]
    framed = [rest if whole_scale else corners.reshape(-1, 3)]
    if arrow is not None:
        tail, tip = scale * found.arrow(*arrow)
        axes.quiver(*tail, *(tip - tail), color="C3", linewidth=2.5, zorder=9)
        framed.append(tail[None])
    if mark is not None:
        x = scale * found.moved[mark]
        axes.plot(*x[:, None], "o", ms=9, mfc="none", mec="C3", mew=2, zorder=9)
        axes.text(*x, f"  {found.values[mark]:.3g}", color="C3", weight="bold", zorder=10)
    if view is not None:
        axes.view_init(elev=view[0], azim=view[1])
    frame(axes, np.vstack(framed), zoom=1.1 if whole_scale else 1.2)
    axes.set_axis_off()
    return figure
