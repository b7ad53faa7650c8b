"""Surfaces in space whose faces are coloured by a value: axes, faces, lines and frame."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from antiosc.base._types import Array
from antiosc.base.charts.figures import new_figure

if TYPE_CHECKING:
    from matplotlib.cm import ScalarMappable
    from matplotlib.figure import Figure
    from mpl_toolkits.mplot3d import Axes3D  # type: ignore[import-untyped]

#: Colour of what has no value to be trusted.
GREY = "0.75"
#: Direction of the light, and the darkest shade.
LIGHT, DARK = np.array([0.5, -0.4, 0.77]), 0.62

#: Share of the axes that a part may fill, whose edge would cut it.
WITHIN = 0.97


def space(points: Array, shown: bool) -> tuple[Figure, Axes3D, float, str]:
    """A figure with axes in space, and the scale and name of the unit of its coordinates."""
    figure = new_figure((6.5, 5.0), shown)
    axes = figure.add_subplot(projection="3d", proj_type="ortho", computed_zorder=False)
    axes.view_init(elev=24, azim=-52)
    return figure, axes, *((1e3, "mm") if np.ptp(points, axis=0).max() < 1.0 else (1.0, "m"))


def draw_faces(
    figure: Figure,
    axes: Axes3D,
    corners: Array,
    value: Array,
    label: str,
    scale: ScalarMappable,
    dark: float = DARK,
) -> None:
    """Faces (F, 3 or 4, 3) coloured by `value` (F,) and shaded by a light, with the scale."""
    from mpl_toolkits.mplot3d.art3d import Poly3DCollection  # type: ignore[import-untyped]

    normal = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    length = np.maximum(np.linalg.norm(normal, axis=1), np.finfo(float).tiny)
    colours = scale.to_rgba(value)
    colours[:, :3] *= (dark + (1 - dark) * np.abs(normal @ LIGHT) / length)[:, None]
    # an edge of the face's own colour hides the background between two faces
    axes.add_collection3d(
        Poly3DCollection(corners, facecolors=colours, edgecolors=colours, linewidths=0.2)
    )
    figure.colorbar(scale, ax=axes, shrink=0.7, pad=0.12, label=label)


def draw_lines(
    figure: Figure, axes: Axes3D, corners: Array, value: Array, label: str, scale: ScalarMappable
) -> None:
    """Lines (F, 2, 3) or points (F, 1, 3) coloured by `value` (F,), with the scale."""
    from mpl_toolkits.mplot3d.art3d import Line3DCollection  # type: ignore[import-untyped]

    colours = scale.to_rgba(value)
    if corners.shape[1] == 2:
        axes.add_collection3d(Line3DCollection(corners, colors=colours, linewidths=3))
    else:
        axes.scatter(*corners[:, 0].T, c=colours, s=20, depthshade=False)
    figure.colorbar(scale, ax=axes, shrink=0.7, pad=0.12, label=label)


def colour_scale(value: Array) -> ScalarMappable:
    """Colours from the least to the largest value; NaN is grey."""
    from matplotlib import colormaps
    from matplotlib.cm import ScalarMappable
    from matplotlib.colors import Normalize

    colours = colormaps["viridis"].with_extremes(bad=GREY)
    return ScalarMappable(Normalize(np.nanmin(value), np.nanmax(value)), colours)


def frame(axes: Axes3D, x: Array, zoom: float = 1.0) -> None:
    """Limits and equal scales around the points (P, 3); few ticks, fewer on short sides."""
    low, high = x.min(axis=0), x.max(axis=0)
    side = np.maximum(high - low, 0.05 * max(float(np.ptp(x, axis=0).max()), 1e-12))
    for name, middle, length in zip("xyz", (low + high) / 2, side, strict=True):
        getattr(axes, f"set_{name}lim")(middle - length / 2, middle + length / 2)
        ticks = max(1, round(4 * length / side.max()))
        getattr(axes, f"{name}axis").get_major_locator().set_params(nbins=ticks)
    axes.set_box_aspect(side, zoom=zoom)
    axes.set_box_aspect(side, zoom=zoom * min(1.0, WITHIN / _reach(axes, x)))


def _reach(axes: Axes3D, x: Array) -> float:
    """How far the points (P, 3) are seen from the middle of the axes, 1 at their edge."""
    from mpl_toolkits.mplot3d import proj3d

    axes.apply_aspect()
    seen = proj3d.proj_transform(*x.T, axes.get_proj())[:2]
    (left, bottom), (right, top) = axes.transAxes.transform([(0, 0), (1, 1)])
    pixels = axes.transData.transform(np.column_stack(seen))
    share = 2 * (pixels - (left, bottom)) / (right - left, top - bottom) - 1
    return float(np.abs(share).max(initial=WITHIN))
