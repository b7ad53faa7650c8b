"""Pictures of a part in space: quantities of a map, and the deformed part."""

from __future__ import annotations

import os
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Protocol

import numpy as np

from antiosc.base import checks
from antiosc.base._types import Array, BoolArray, IntArray
from antiosc.base.charts import finished
from antiosc.base.errors import InputError
from antiosc.base.surfaces import (
    Deformed,
    colour_scale,
    draw_deformed,
    draw_faces,
    frame,
    space,
)
from antiosc.simulation.histories.history import History, SceneHistory

if TYPE_CHECKING:
    from matplotlib.figure import Figure
    from mpl_toolkits.mplot3d import Axes3D  # type: ignore[import-untyped]

    from antiosc.fem.structure.structure import Structure


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
    "peak_stress": "largest stress in the part (Pa)",
    "exposure": "largest stress over the yield strength",
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
    def info(self) -> Mapping[str, object]: ...
    @property
    def doubtful(self) -> BoolArray: ...

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
        Its doubtful sites are grey.
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
    grey = found.doubtful & ~found.doubtful.all()
    value = np.where(grey, np.nan, known[quantity])
    label = QUANTITY_LABELS.get(quantity, quantity)
    triangles = len(found.elements) > 0 and found.elements.shape[1] == 3
    figure, axes, scale, unit = space(found.points, shown=path is None)
    x = scale * found.points
    if triangles:
        seen = _towards_viewer(found, axes)
        faces = found.elements[seen]
        values = value[faces].mean(axis=1)
        alone = found.alone
        scale = colour_scale(np.concatenate([values, value[alone]]))
        draw_faces(figure, axes, x[faces], values, label, scale, dark=0.85)
        if len(alone):
            axes.scatter(*x[alone].T, c=scale.to_rgba(value[alone]), s=30, depthshade=False)
    else:
        scale = colour_scale(value)
        axes.scatter(*x.T, c=scale.to_rgba(value), s=30, depthshade=False)
        figure.colorbar(scale, ax=axes, shrink=0.7, pad=0.12, label=label)
    frame(axes, x)
    axes.set(xlabel=f"x ({unit})", ylabel=f"y ({unit})", zlabel=f"z ({unit})")
    return finished(figure, path)


def plot_deformed(
    structure: Structure,
    history: History,
    path: str | os.PathLike[str] | None = None,
    time: float | None = None,
    *,
    body: str = "structure",
    point: Sequence[float] | None = None,
    direction: Sequence[float] | None = None,
    view: Sequence[float] | None = None,
    field: str | None = None,
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
    field : str, optional
        What colours it in place of the displacement: a quantity of `peak_field`, as "von_mises".

    Raises
    ------
    InputError
        A model without shapes, or extracted from another structure; a mesh of lines.
    """
    seen_from = None if view is None else checks.array("view", view, (2,))
    arrow = _arrow(point, direction)
    found = deformed(structure, history, time, body, field)
    mark = None if field is None else int(np.argmax(found.values))
    return draw_deformed(found, path, arrow=arrow, view=seen_from, mark=mark)


def deformed(
    structure: Structure,
    history: History,
    time: float | None,
    body: str,
    field: str | None = None,
) -> Deformed:
    """The surface of a part at one time; arguments as of `plot_deformed`."""
    from antiosc.results.fields import nodal_motion, skin
    from antiosc.results.peaks import peak_field

    checks.instance("history", history, History, "a History, which simulate and Scene.run return")
    history.of(body)
    if time is None:
        time = float(history.time[np.argmax(_motion(history, body))])
    if field is not None:
        peak = peak_field(structure, history, field, [time], body=body)
        moved = nodal_motion(structure, history, time, body=body)
        return peak.surface(f"{peak.label} at {1e3 * time:.4g} ms", moved)
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


def _motion(history: History, body: str) -> Array:
    """What is largest at the time of the picture: the motion of the site, or the contact forces."""
    if isinstance(history, SceneHistory):
        return np.asarray(np.abs(history.run.force).max(axis=1))
    impactor = body == "impactor"
    return np.abs(history.impactor_displacement if impactor else history.displacement)


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
