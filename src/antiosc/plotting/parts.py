"""Pictures of a part in space: quantities of a map, and the deformed part."""

from __future__ import annotations

import os
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any, Protocol

import numpy as np

from antiosc import checks
from antiosc._types import Array, BoolArray, IntArray
from antiosc.charts.figures import finished, new_figure
from antiosc.errors import InputError
from antiosc.plotting.turning import turning_page
from antiosc.simulation.history import History
from antiosc.simulation.scene_history import SceneHistory

if TYPE_CHECKING:
    from matplotlib.cm import ScalarMappable
    from matplotlib.figure import Figure
    from mpl_toolkits.mplot3d import Axes3D  # type: ignore[import-untyped]

    from antiosc.fem.structure.structure import Structure


#: Motions are drawn this share of the part's largest dimension.
ENLARGED = 0.08
#: Direction of the light, and the darkest shade.
LIGHT, DARK = np.array([0.5, -0.4, 0.77]), 0.62

QUANTITY_LABELS = {
    "k0": "static stiffness (N/m)",
    "m_st": "static mass (kg)",
    "omega_1": "first antiresonance (rad/s)",
    "error": "bound on the relative error of Z",
    "peak_force": "peak force (N)",
    "contact_time": "contact time (s)",
    "restitution": "coefficient of restitution",
    "impulse": "impulse (N s)",
    "peak_deflection": "peak deflection (m)",
}


class SurfaceMap(Protocol):
    """What `plot_map` reads of an `ImpactMap`."""

    @property
    def points(self) -> Array: ...
    @property
    def directions(self) -> Array: ...
    @property
    def elements(self) -> IntArray: ...
    @property
    def alone(self) -> IntArray: ...
    @property
    def info(self) -> dict[str, Any]: ...

    def quantities(self) -> dict[str, Array]:
        """Scalars of the map by name, (P,) each."""


def plot_map(
    found: SurfaceMap,
    path: str | os.PathLike[str] | None = None,
    quantity: str = "peak_force",
) -> Figure | Path:
    """One quantity of an impact map over the surface of the part.

    Parameters
    ----------
    found : ImpactMap
    path : str or Path, optional
        As for `plot_history`.
    quantity : str
        One of `found.quantities()`.
    """
    if not callable(getattr(found, "quantities", None)) or isinstance(found, type):
        raise InputError(f"found must be an ImpactMap; got {checks.shown(found)}.")
    known = found.quantities()
    if not isinstance(quantity, str) or quantity not in known:
        raise InputError(
            f"quantity must be one of {', '.join(known)}; got {checks.shown(quantity)}."
        )
    value, label = known[quantity], QUANTITY_LABELS.get(quantity, quantity)
    triangles = len(found.elements) > 0 and found.elements.shape[1] == 3
    figure, axes, scale, unit = _space(found.points, shown=path is None)
    x = scale * found.points
    if triangles:
        seen = _towards_viewer(found, axes)
        faces = found.elements[seen]
        values = value[faces].mean(axis=1)
        alone = found.alone
        scale = _scale(np.concatenate([values, value[alone]]))
        _faces(figure, axes, x[faces], values, label, scale, dark=0.85)
        if len(alone):
            axes.scatter(*x[alone].T, c=scale.to_rgba(value[alone]), s=30, depthshade=False)
    else:
        dots = axes.scatter(*x.T, c=value, s=30, depthshade=False)
        figure.colorbar(dots, ax=axes, shrink=0.7, pad=0.12, label=label)
    _frame(axes, x)
    axes.set(xlabel=f"x ({unit})", ylabel=f"y ({unit})", zlabel=f"z ({unit})")
    return finished(figure, path)


def plot_deformed(
    structure: Structure,
    history: History | SceneHistory,
    path: str | os.PathLike[str] | None = None,
    time: float | None = None,
    *,
    body: str = "structure",
    point: Sequence[float] | None = None,
    direction: Sequence[float] | None = None,
    view: Sequence[float] | None = None,
) -> Figure | Path:
    """The deformed part at one time; displacements are magnified and coloured by their magnitude.

    Parameters
    ----------
    structure, history, body
        As for `write_series`.
    path : str or Path, optional
        As for `plot_history`.
    time : float, optional
        In s; default: where the displacement of the site is largest, of a scene where the largest
        contact force is.
    point, direction : sequence of 3 floats, optional
        An arrow that ends at `point` (m) shows the impact.
    view : (elevation, azimuth), optional
        From where it is seen, degrees: 90 is from above, azimuth 0 from +x and 90 from +y.

    Raises
    ------
    InputError
        A model without shapes, or extracted from another structure; a mesh of lines.
    """
    seen_from = None if view is None else checks.array("view", view, (2,))
    arrow = _arrow(point, direction)
    found = deformed(structure, history, time, body)
    return draw_deformed(found, path, arrow=arrow, view=seen_from)


def turning_deformed(
    structure: Structure,
    history: History | SceneHistory,
    time: float | None = None,
    *,
    body: str = "structure",
    point: Sequence[float] | None = None,
    direction: Sequence[float] | None = None,
) -> str:
    """A page in HTML with the deformed part, which is turned by hand; needs PyVista with trame.

    Arguments as of `plot_deformed`, errors too, and those of `antiosc.plotting.turning`.
    """
    arrow = _arrow(point, direction)
    found = deformed(structure, history, time, body)
    way = None if arrow is None else found.arrow(*arrow)
    return turning_page(found.moved, found.faces, found.values, found.label, way)


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
        shown = largest or 1.0
        factor = float(f"{ENLARGED * np.ptp(points, axis=0).max() / shown:.1g}")
        micro, unit = (1e6, "µm") if shown < 1e-3 else (1e3, "mm")
        size = np.linalg.norm(moved, axis=1)
        label = f"displacement ({unit}), drawn × {factor:g}"
        return cls(points, points + factor * moved, faces, micro * size, label, micro * largest)

    def arrow(self, point: Array, direction: Array) -> Array:
        """Tail and tip (2, 3) [m] of an arrow along `direction` that ends at `point`."""
        length = 0.25 * np.ptp(self.points, axis=0).max()
        return np.array([point - length * direction / np.linalg.norm(direction), point])


def draw_deformed(
    found: Deformed,
    path: str | os.PathLike[str] | None,
    *,
    arrow: tuple[Array, Array] | None = None,
    view: Array | None = None,
    whole_scale: bool = False,
) -> Figure | Path:
    """A figure of a deformed surface, or its file; options as of `deformed_figure`."""
    figure = deformed_figure(
        found, arrow=arrow, view=view, whole_scale=whole_scale, shown=path is None
    )
    return finished(figure, path)


def deformed_figure(
    found: Deformed,
    *,
    arrow: tuple[Array, Array] | None = None,
    view: Array | None = None,
    whole_scale: bool = False,
    shown: bool = False,
) -> Figure:
    """A figure of a deformed surface.

    arrow : point and direction of the impact.
    view : (elevation, azimuth), degrees.
    whole_scale : colours from zero to the largest of all times, in the box of the part at rest.
    """
    figure, axes, scale, _ = _space(found.points, shown)
    corners = scale * found.moved[found.faces]
    values = found.values[found.faces].mean(axis=1)
    colours = _scale(np.array([0.0, found.largest]) if whole_scale else values)
    if found.faces.shape[1] > 2:
        _faces(figure, axes, corners, values, found.label, colours)
    else:
        _lines(figure, axes, corners, values, found.label, colours)
    rest = scale * found.points[np.unique(found.faces)]
    framed = [rest if whole_scale else corners.reshape(-1, 3)]
    if arrow is not None:
        tail, tip = scale * found.arrow(*arrow)
        axes.quiver(*tail, *(tip - tail), color="C3", linewidth=2.5, zorder=9)
        framed.append(tail[None])
    if view is not None:
        axes.view_init(elev=view[0], azim=view[1])
    _frame(axes, np.vstack(framed), zoom=1.1 if whole_scale else 1.2)
    axes.set_axis_off()
    return figure


def deformed(
    structure: Structure, history: History | SceneHistory, time: float | None, body: str
) -> Deformed:
    """The surface of a part at one time; arguments as of `plot_deformed`."""
    from antiosc.fem.fields import skin

    kinds = (History, SceneHistory)
    checks.instance("history", history, kinds, "a History, which simulate and Scene.run return")
    history.of(body)  # type: ignore[arg-type]
    if time is None:
        time = float(history.time[np.argmax(_motion(history, body))])
    points, faces, moved = skin(structure, history, checks.number("time", time, "s"), body=body)
    largest = float(np.linalg.norm(moved, axis=1).max())
    return Deformed.of(points, faces, moved, largest)


def _arrow(
    point: Sequence[float] | None, direction: Sequence[float] | None
) -> tuple[Array, Array] | None:
    """Point and direction of the arrow of the impact, if they are given."""
    if (point is None) != (direction is None):
        raise InputError("the arrow of the impact needs both point and direction.")
    if point is None or direction is None:
        return None
    tip = np.array(checks.coordinates("point", point))
    return tip, np.array(checks.coordinates("direction", direction))


def _motion(history: History | SceneHistory, body: str) -> Array:
    """What is largest at the time of the picture: the motion of the site, or the contact forces."""
    if isinstance(history, SceneHistory):
        return np.asarray(np.abs(history.run.force).max(axis=1))
    impactor = body == "impactor"
    return np.abs(history.impactor_displacement if impactor else history.displacement)


def _space(points: Array, shown: bool) -> tuple[Figure, Axes3D, float, str]:
    """A figure with axes in space, and the scale and name of the unit of its coordinates."""
    figure = new_figure((6.5, 5.0), shown)
    axes = figure.add_subplot(projection="3d", proj_type="ortho", computed_zorder=False)
    axes.view_init(elev=24, azim=-52)
    return figure, axes, *((1e3, "mm") if np.ptp(points, axis=0).max() < 1.0 else (1.0, "m"))


def _towards_viewer(found: SurfaceMap, axes: Axes3D) -> BoolArray:
    """Faces to draw (T,): where those of a solid are struck against the surface, its front faces.

    matplotlib sorts faces by their centres; back faces would show through openings.
    """
    corners = found.points[found.elements]
    normal = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    into = found.directions[found.elements].mean(axis=1)
    across = np.einsum("td,td->t", normal, into)
    steep = np.abs(across) > 0.5 * np.linalg.norm(normal, axis=1)
    if found.info.get("cell_dimension") != 3 or np.mean(steep) < 0.9:
        return np.ones(len(corners), dtype=bool)
    up, around = np.radians(axes.elev), np.radians(axes.azim)
    view = np.array([np.cos(up) * np.cos(around), np.cos(up) * np.sin(around), np.sin(up)])
    return np.asarray((normal @ view) * -np.sign(across) > 0)


def _faces(
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


def _lines(
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


def _scale(value: Array) -> ScalarMappable:
    """Colours from the least to the largest value."""
    from matplotlib.cm import ScalarMappable
    from matplotlib.colors import Normalize

    return ScalarMappable(Normalize(np.nanmin(value), np.nanmax(value)), "viridis")


def _frame(axes: Axes3D, x: Array, zoom: float = 1.0) -> None:
    """Limits and equal scales around the points (P, 3); few ticks, fewer on short sides."""
    low, high = x.min(axis=0), x.max(axis=0)
    side = np.maximum(high - low, 0.05 * max(float(np.ptp(x, axis=0).max()), 1e-12))
    for name, middle, length in zip("xyz", (low + high) / 2, side, strict=True):
        getattr(axes, f"set_{name}lim")(middle - length / 2, middle + length / 2)
        ticks = max(1, round(4 * length / side.max()))
        getattr(axes, f"{name}axis").get_major_locator().set_params(nbins=ticks)
    axes.set_box_aspect(side, zoom=zoom)
