"""Surfaces in space with faces coloured by a value: maps, designs, the deformed part."""

from __future__ import annotations

import os
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from antiosc.base._types import Array, BoolArray, IntArray
from antiosc.plot.charts import figure_or_path, new_figure

if TYPE_CHECKING:
    from matplotlib.cm import ScalarMappable
    from matplotlib.figure import Figure
    from mpl_toolkits.mplot3d import Axes3D  # type: ignore[import-untyped]


#: Colour of faces without a reliable value.
NO_VALUE_COLOUR = "0.75"
#: Direction of the light, and the darkest shade.
LIGHT_DIRECTION = np.array([0.5, -0.4, 0.77])
DARKEST_SHADE = 0.62

#: A side shorter than this share of the longest one has no ticks: their numbers would overlap.
MIN_TICK_RATIO = 0.1


def axes_in_space(points: Array, shown: bool) -> tuple[Figure, Axes3D, float, str]:
    """(figure, 3-D axes, scale of the coordinates, their unit) for points (P, 3) [m]."""
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
    darkest_shade: float = DARKEST_SHADE,
    outlined: BoolArray | None = None,
) -> None:
    """Draw faces (F, 3 or 4, 3), lines (F, 2, 3) or points (F, 1, 3), coloured by `value` (F,).

    A colour scale is drawn if there is a `label`; `darkest_shade`: factor on the colour of faces
    that are parallel to the light; `outlined` (F,): faces drawn white with a black edge.
    """
    if label:
        figure.colorbar(scale, ax=axes, shrink=0.7, pad=0.12, label=label)
    colours = scale.to_rgba(value)
    if corners.shape[1] == 1:
        axes.scatter(*corners[:, 0].T, c=colours, s=20, depthshade=False)
        return

    from mpl_toolkits.mplot3d import art3d  # type: ignore[import-untyped]

    if corners.shape[1] == 2:
        axes.add_collection3d(art3d.Line3DCollection(corners, colors=colours, linewidths=3))
        return

    normal = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    length = np.maximum(np.linalg.norm(normal, axis=1), np.finfo(float).tiny)
    colours[:, :3] *= (
        darkest_shade + (1 - darkest_shade) * np.abs(normal @ LIGHT_DIRECTION) / length
    )[:, None]

    # an edge of the face's own colour hides the background between two faces
    edges = colours.copy()
    widths = np.full(len(colours), 0.2)
    if outlined is not None:
        colours[outlined, :3], edges[outlined, :3], widths[outlined] = 1.0, 0.0, 0.5
    faces = {"facecolors": colours, "edgecolors": edges, "linewidths": widths}
    axes.add_collection3d(art3d.Poly3DCollection(corners, **faces))


def colour_scale(value: Array) -> ScalarMappable:
    """Colour scale from the least to the largest value; NaN is grey."""
    from matplotlib import colormaps
    from matplotlib.cm import ScalarMappable
    from matplotlib.colors import Normalize

    colours = colormaps["viridis"].with_extremes(bad=NO_VALUE_COLOUR)
    return ScalarMappable(Normalize(np.nanmin(value), np.nanmax(value)), colours)


def fit_limits(axes: Axes3D, x: Array, zoom: float = 1.0) -> None:
    """Set limits and equal scales for the points (P, 3); short sides get few ticks or none."""
    low = x.min(axis=0)
    high = x.max(axis=0)
    side = np.maximum(high - low, 0.05 * max(float(np.ptp(x, axis=0).max()), 1e-12))

    is_short = side < MIN_TICK_RATIO * side.max()
    for name, middle, length, hidden in zip("xyz", (low + high) / 2, side, is_short, strict=True):
        getattr(axes, f"set_{name}lim")(middle - length / 2, middle + length / 2)
        axis = getattr(axes, f"{name}axis")
        if hidden:
            axis.set_ticks([])
            axis.label.set_visible(False)
        else:
            axis.get_major_locator().set_params(nbins=max(1, round(4 * length / side.max())))

    axes.set_box_aspect(side, zoom=zoom)


#: The largest displacement is drawn as this share of the part's largest dimension.
ENLARGED_SHARE = 0.08


@dataclass(frozen=True, eq=False)
class DeformedSurface:
    """A deformed surface at one time; `displacements` are its moved points."""

    #: points, displacements: (P, 3) [m], positions at rest and with displacements drawn larger
    points: Array
    displacements: Array
    faces: IntArray  # (F, 3 or 4) indices of corners; (F, 2) of lines, (F, 1) of points
    values: Array  # (P,) displacement, or a `PeakField`'s values, in the unit that `label` states
    label: str  # label of the values, with the magnification of the displacements; "": no scale
    largest: float  # largest value at all times

    @classmethod
    def from_displacements(
        cls, points: Array, faces: IntArray, displacements: Array, largest: float
    ) -> DeformedSurface:
        """The surface with magnified displacements (P, 3) [m]; `largest` [m] sets the factor."""
        reference = largest or 1.0
        factor = magnification(points, largest)
        micro, unit = (1e6, "µm") if reference < 1e-3 else (1e3, "mm")
        size = np.linalg.norm(displacements, axis=1)
        label = f"displacement ({unit}), drawn × {factor:g}"
        return cls(
            points, points + factor * displacements, faces, micro * size, label, micro * largest
        )


def magnification(points: Array, largest: float) -> float:
    """Magnification of displacements in a picture if the largest is `largest` [m]."""
    return float(f"{ENLARGED_SHARE * np.ptp(points, axis=0).max() / (largest or 1.0):.1g}")


def deformed_figure(
    surface: DeformedSurface,
    *,
    arrow: tuple[Array, Array] | None = None,
    view: Array | None = None,
    whole_scale: bool = False,
    mark: int | None = None,
    shown: bool = False,
) -> Figure:
    """A figure of a deformed surface, coloured from zero on; view : (elevation, azimuth) [deg].

    whole_scale : whether the colours extend to the largest value at all times.
    mark : number of a point that gets a ring and its value.
    """
    figure, axes, scale, _ = axes_in_space(surface.points, shown)
    corners = scale * surface.displacements[surface.faces]
    values = surface.values[surface.faces].mean(axis=1)
    top = surface.largest if whole_scale or mark is not None else values
    colours = colour_scale(np.append(0.0, top))
    draw_faces(figure, axes, corners, values, surface.label, colours)
    undeformed = scale * surface.points[np.unique(surface.faces)]
    framed = [undeformed if whole_scale else corners.reshape(-1, 3)]
    if arrow is not None:
        tip, direction = (scale * np.asarray(end) for end in arrow)
        length = 0.25 * scale * np.ptp(surface.points, axis=0).max()
        tail = tip - length * direction / np.linalg.norm(direction)
        axes.quiver(*tail, *(tip - tail), color="C3", linewidth=2.5, zorder=9)
        framed.append(tail[None])

    if mark is not None:
        x = scale * surface.displacements[mark]
        axes.plot(*x[:, None], "o", ms=9, mfc="none", mec="C3", mew=2, zorder=9)
        axes.text(*x, f"  {surface.values[mark]:.3g}", color="C3", weight="bold", zorder=10)
    if view is not None:
        axes.view_init(elev=view[0], azim=view[1])
    fit_limits(axes, np.vstack(framed), zoom=1.1 if whole_scale else 1.2)
    axes.set_axis_off()
    return figure


#: Share of the faces whose values lie within the colour scale: a few at the site are far larger.
COLOUR_QUANTILE = 0.98


def draw_design(
    corners: Array, value: Array, label: str, path: str | os.PathLike[str] | None
) -> Figure | Path:
    """Figure of faces (F, 2 to 4, 3) [m], coloured by `value` (F,) about zero; NaN is grey."""
    from matplotlib.cm import ScalarMappable
    from matplotlib.colors import Normalize

    top = float(np.nanquantile(np.abs(value), COLOUR_QUANTILE)) or 1.0
    scale = ScalarMappable(Normalize(-top, top), "RdBu_r")
    figure, axes, unit, name = axes_in_space(corners.reshape(-1, 3), shown=path is None)
    order = [0, 1, 3, 2] if corners.shape[1] == 4 else list(range(corners.shape[1]))
    draw_faces(figure, axes, unit * corners[:, order], value, label, scale)
    axes.set(xlabel=f"x ({name})", ylabel=f"y ({name})", zlabel=f"z ({name})")
    plane = np.ptp(corners[..., 2]) == 0.0  # it is seen from above, and its labels stand beside it
    if plane:
        axes.view_init(elev=90, azim=-90)
    fit_limits(axes, unit * corners.reshape(-1, 3), zoom=0.85 if plane else 1.0)
    return figure_or_path(figure, path)
