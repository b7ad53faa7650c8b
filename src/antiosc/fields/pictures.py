"""Files of displacements; pictures of maps and of the deformed part in space."""

from __future__ import annotations

import os
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike

from antiosc.base import checks
from antiosc.base._types import Array, BoolArray
from antiosc.base.archives import Arrays, write_arrays
from antiosc.base.errors import InputError
from antiosc.base.process import one_thread
from antiosc.fem.platform import collective, on_root
from antiosc.fem.structure.structure import Structure
from antiosc.fields.fields import nodal_motion, outer_faces, shapes_of
from antiosc.fields.peaks import peak_field
from antiosc.impact.histories import History, SceneHistory
from antiosc.impact.histories.factors import shape_factors
from antiosc.plot import surfaces
from antiosc.plot.charts import figure_or_path
from antiosc.plot.surfaces import DeformedSurface
from antiosc.recovery import source

if TYPE_CHECKING:
    from matplotlib.figure import Figure
    from mpl_toolkits.mplot3d import Axes3D  # type: ignore[import-untyped]


@collective()
@one_thread()
def save_fields(
    structure: Structure,
    history: History,
    path: str | Path,
    times: ArrayLike | None = None,
    *,
    body: str = "structure",
) -> Path:
    """Write the displacements of all nodes at many times to one compact file.

    `numpy.load` reads the file. It holds `points` (P, 3) [m], the cells of part i as `cells0`,
    `cells1`, … in VTK's order, their `kinds` (meshio's names), `shapes` (P, 3, k), `time` (n,) [s]
    and `factors` (n, k). The displacements at time i are `shapes @ factors[i]` [m].

    Parameters
    ----------
    structure, history, body
        As for `write_series`.
    path : str or Path
        The `.npz` file.
    times : array_like (n,), optional
        Times in s; default: those of the history.

    Raises
    ------
    InputError
        A model without shapes, or extracted from another structure; a file that cannot be written.
    """
    target = checks.path("path", path)
    shapes_of_body = shapes_of(structure, history, body)
    time = np.unique(history.time) if times is None else checks.nonempty("times", times)
    points, cells, shapes = source(structure).at_nodes(structure, shapes_of_body)
    factors = shape_factors(history, time, body)

    arrays: Arrays = {"points": points, "shapes": shapes, "time": time, "factors": factors}
    arrays["kinds"] = np.array([kind for kind, _ in cells])
    arrays |= {f"cells{i}": numbers for i, (_, numbers) in enumerate(cells)}
    on_root(structure.comm, lambda: write_arrays(target, arrays, "the fields"))
    return target


#: Quantity of a map -> what it is, and its unit.
MAP_QUANTITIES = {
    "k0": ("static stiffness", "N/m"),
    "m_st": ("static mass", "kg"),
    "omega_1": ("first antiresonance", "rad/s"),
    "error": ("bound on the relative error of Z", ""),
    "peak_force": ("peak force", "N"),
    "contact_time": ("contact time", "s"),
    "restitution": ("coefficient of restitution", ""),
    "impulse": ("impulse", "N s"),
    "peak_deflection": ("peak deflection", "m"),
    "peak_stress": ("largest stress in the part", "Pa"),
    "exposure": ("largest stress over the yield strength", ""),
}


def plot_map(
    impact_map: Any, path: str | os.PathLike[str] | None = None, quantity: str = "peak_force"
) -> Figure | Path:
    """Picture of one quantity of an impact map over the surface of the part.

    Parameters
    ----------
    impact_map : ImpactMap
        Faces with two or more doubtful corners, and doubtful sites drawn as dots, are white with
        dark edges.
    path : str or Path, optional
        As for `plot_history`.
    quantity : str
        One of `impact_map.quantities()`.
    """
    if not callable(getattr(impact_map, "quantities", None)) or isinstance(impact_map, type):
        raise InputError(f"impact_map must be an ImpactMap; got {checks.shown(impact_map)}.")
    quantities = impact_map.quantities()
    if not isinstance(quantity, str) or quantity not in quantities:
        names = ", ".join(quantities)
        raise InputError(f"quantity must be one of {names}; got {checks.shown(quantity)}.")
    outlined = impact_map.doubtful & ~impact_map.doubtful.all()
    value = np.where(outlined, np.nan, quantities[quantity])
    label, unit = MAP_QUANTITIES.get(quantity, (quantity, ""))
    label += f" ({unit})" if unit else ""
    triangles = len(impact_map.elements) > 0 and impact_map.elements.shape[1] == 3
    figure, axes, scale, unit = surfaces.axes_in_space(impact_map.points, shown=path is None)
    x = scale * impact_map.points

    if triangles:
        faces = impact_map.elements[_front_faces(impact_map, axes)]
        corners = value[faces]
        known = (~np.isnan(corners)).sum(axis=1)
        values = np.where(known > 1, np.nansum(corners, axis=1) / np.maximum(known, 1), np.nan)
        alone = impact_map.alone
        scale = surfaces.colour_scale(np.concatenate([values, value[alone]]))
        doubted = outlined[faces].sum(axis=1) > 1
        surfaces.draw_faces(figure, axes, x[faces], values, label, scale, 0.85, doubted)
        _draw_dots(axes, x[alone], scale.to_rgba(value[alone]), outlined[alone])
    else:
        scale = surfaces.colour_scale(value)
        _draw_dots(axes, x, scale.to_rgba(value), outlined)
        figure.colorbar(scale, ax=axes, shrink=0.7, pad=0.12, label=label)

    if outlined.any():
        from matplotlib.patches import Patch  # which takes long to load

        patch = Patch(facecolor="white", edgecolor="black", label="doubtful sites")
        figure.legend(handles=[patch], loc="lower left", frameon=False)

    surfaces.fit_limits(axes, x)
    axes.set(xlabel=f"x ({unit})", ylabel=f"y ({unit})", zlabel=f"z ({unit})")
    return figure_or_path(figure, path)


def _front_faces(impact_map: Any, axes: Axes3D) -> BoolArray:
    """Mask (T,) of the faces to draw: without back faces of solids, visible through openings."""
    corners = impact_map.points[impact_map.elements]
    normal = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    directions = impact_map.directions[impact_map.elements].mean(axis=1)
    cosines = np.einsum("td,td->t", normal, directions)
    is_frontal = np.abs(cosines) > 0.5 * np.linalg.norm(normal, axis=1)
    if impact_map.cell_dimension != 3 or np.mean(is_frontal) < 0.9:
        return np.ones(len(corners), dtype=bool)

    elevation, azimuth = np.radians([axes.elev, axes.azim])
    level = np.cos(elevation)
    view = np.array([level * np.cos(azimuth), level * np.sin(azimuth), np.sin(elevation)])
    return np.asarray((normal @ view) * -np.sign(cosines) > 0)


def _draw_dots(axes: Axes3D, points: Array, colours: Array, outlined: BoolArray) -> None:
    """Draw dots at points (n, 3), with dark edges where the mask `outlined` is true."""
    edges = colours.copy()
    colours[outlined, :3], edges[outlined, :3] = 1.0, 0.0
    axes.scatter(*points.T, c=colours, edgecolors=edges, s=30, depthshade=False)


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
    """Picture of the deformed part at one time, coloured by the (magnified) displacement.

    Parameters
    ----------
    structure, history, body
        As for `write_series`.
    path : str or Path, optional
        As for `plot_history`.
    time : float, optional
        Time in s; default: the time of the largest displacement of the site, or for a scene of the
        largest contact force.
    point, direction : sequence of 3 floats, optional
        An arrow that ends at `point` (m) shows the impact.
    view : (elevation, azimuth), optional
        Direction of view, degrees: elevation 90 is from above, azimuth 0 from +x and 90 from +y.
    field : str, optional
        Quantity of `peak_field` that gives the colours instead of the displacement, such as
        "von_mises".

    Raises
    ------
    InputError
        A model without shapes, or extracted from another structure; a mesh of lines.
    """
    seen_from = None if view is None else checks.floats("view", view, (2,))
    arrow = _impact_arrow(point, direction)
    surface = deformed_surface(structure, history, time, body, field)
    mark = None if field is None else int(np.argmax(surface.values))
    figure = surfaces.deformed_figure(
        surface, arrow=arrow, view=seen_from, mark=mark, shown=path is None
    )
    return figure_or_path(figure, path)


def deformed_surface(
    structure: Structure, history: History, time: float | None, body: str, field: str | None = None
) -> DeformedSurface:
    """The surface of a part at a time, for pictures; arguments as for `plot_deformed`."""
    checks.instance("structure", structure, Structure, "a Structure")
    checks.instance("history", history, History, "a History, which simulate and Scene.run return")
    history.of(body)
    if time is None:
        if isinstance(history, SceneHistory):
            motion = history.run.force.T
        else:
            impactor = body == "impactor"
            motion = history.impactor_displacement if impactor else history.displacement
        time = float(history.time[np.abs(np.atleast_2d(motion)).max(axis=0).argmax()])

    time = checks.number("time", time, "s")
    points, cells, displacements = nodal_motion(structure, history, time, body=body)
    if field is not None:
        peak = peak_field(structure, history, field, [time], body=body)
        return peak.surface(f"{peak.label} at {1e3 * time:.4g} ms", displacements)

    faces = outer_faces(cells)
    if faces.shape[1] < 3:
        raise InputError("lines and nodes have no surface: write_series writes their motion.")
    largest = float(np.linalg.norm(displacements, axis=1).max())
    return DeformedSurface.from_displacements(points, faces, displacements, largest)


def _impact_arrow(
    point: Sequence[float] | None, direction: Sequence[float] | None
) -> tuple[Array, Array] | None:
    """(point, direction) of the impact's arrow; None without both, InputError if one is missing."""
    if (point is None) != (direction is None):
        raise InputError("the arrow of the impact needs both point and direction.")
    if point is None or direction is None:
        return None
    tip = np.array(checks.coordinates("point", point))
    return tip, np.array(checks.coordinates("direction", direction))
