"""Pictures of a part as it is deformed at one time."""

from __future__ import annotations

import os
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from antiosc.base import checks
from antiosc.base._types import Array
from antiosc.base.errors import InputError
from antiosc.fem.structure.structure import Structure
from antiosc.fields.fields import nodal_motion, skin
from antiosc.fields.peaks import peak_field
from antiosc.impact.histories import History, SceneHistory
from antiosc.plot import surfaces
from antiosc.plot.charts import figure_or_path
from antiosc.plot.surfaces import Deformed

if TYPE_CHECKING:
    from matplotlib.figure import Figure


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
        In s; default: the time of the largest displacement of the site, for a scene that of the
        largest contact force.
    point, direction : sequence of 3 floats, optional
        An arrow that ends at `point` (m) shows the impact.
    view : (elevation, azimuth), optional
        Direction of view, degrees: elevation 90 is from above, azimuth 0 from +x and 90 from +y.
    field : str, optional
        Quantity that gives the colours in place of the displacement: one of `peak_field`, as
        "von_mises".

    Raises
    ------
    InputError
        A model without shapes, or extracted from another structure; a mesh of lines.
    """
    seen_from = None if view is None else checks.floats("view", view, (2,))
    arrow = _arrow(point, direction)
    surface = deformed(structure, history, time, body, field)
    mark = None if field is None else int(np.argmax(surface.values))
    figure = surfaces.deformed_figure(
        surface, arrow=arrow, view=seen_from, mark=mark, shown=path is None
    )
    return figure_or_path(figure, path)


def deformed(
    structure: Structure,
    history: History,
    time: float | None,
    body: str,
    field: str | None = None,
) -> Deformed:
    """The surface of a part at one time; arguments as for `plot_deformed`."""
    checks.instance("structure", structure, Structure, "a Structure")
    checks.instance("history", history, History, "a History, which simulate and Scene.run return")
    history.of(body)
    if time is None:
        time = float(history.time[np.argmax(_motion(history, body))])
    if field is not None:
        peak = peak_field(structure, history, field, [time], body=body)
        *_, displacements = nodal_motion(structure, history, time, body=body)
        return peak.surface(f"{peak.label} at {1e3 * time:.4g} ms", displacements)
    points, faces, displacements = skin(
        structure, history, checks.number("time", time, "s"), body=body
    )
    largest = float(np.linalg.norm(displacements, axis=1).max())
    return Deformed.of(points, faces, displacements, largest)


def _arrow(
    point: Sequence[float] | None, direction: Sequence[float] | None
) -> tuple[Array, Array] | None:
    """Point and direction of the arrow that shows the impact, if both are known."""
    if (point is None) != (direction is None):
        raise InputError("the arrow of the impact needs both point and direction.")
    if point is None or direction is None:
        return None
    tip = np.array(checks.coordinates("point", point))
    return tip, np.array(checks.coordinates("direction", direction))


def _motion(history: History, body: str) -> Array:
    """The curve that sets the time of the picture: motion of the site, or contact forces."""
    if isinstance(history, SceneHistory):
        return np.asarray(np.abs(history.run.force).max(axis=1))
    impactor = body == "impactor"
    return np.abs(history.impactor_displacement if impactor else history.displacement)
