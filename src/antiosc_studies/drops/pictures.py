"""The picture of a fall: the part at its first touch, its height, energies and forces."""

from __future__ import annotations

import os
from itertools import product
from pathlib import Path
from typing import Any

import numpy as np

from antiosc.base._types import Array, Figure, IntArray
from antiosc.plot.charts import figure_or_path, new_figure
from antiosc.plot.surfaces import LIGHT_DIRECTION
from antiosc_studies.drops.free_body import FreeBody, State

#: Number of times at which heights are drawn.
HEIGHT_TIMES = 500
#: Largest number of triangles of a surface that is drawn.
MOST_TRIANGLES = 6000
#: Colour of the triangles (red, green, blue).
COLOUR = (0.35, 0.55, 0.8)


def draw_fall(fall: Any, path: str | os.PathLike[str] | None) -> Figure | Path:
    """Draw the part at its first touch, its height, the energies, and the forces of the impacts."""
    figure = new_figure((9.0, 6.0), shown=path is None)
    grid = figure.add_gridspec(2, 2)
    first = fall.episodes[0].start if fall.episodes else fall.end
    axes = figure.add_subplot(grid[0, 0], projection="3d", proj_type="ortho", computed_zorder=False)
    _draw_part(axes, fall.body, first)
    axes.set_title("at the first touch", fontsize=10)
    height = figure.add_subplot(grid[0, 1])
    touches = [episode.start.time for episode in fall.episodes]
    times = np.union1d(np.linspace(0.0, fall.end.time, HEIGHT_TIMES), touches)
    states = [state_at(fall, t) for t in times.tolist()]
    height.plot(times, [state.centre[2] for state in states], label="centre of mass")
    lowest = [state.heights(fall.body).min() for state in states]
    height.plot(times, lowest, label="lowest point")
    height.set(xlabel="time (s)", ylabel="height (m)")
    height.legend(fontsize=8)
    energy = figure.add_subplot(grid[1, 0])
    t, parts = fall.energy()
    energy.plot(t, parts.sum(axis=1), label="whole")
    energy.plot(t, parts[:, 1], label="vibration")
    energy.set(xlabel="time (s)", ylabel="energy (J)", ylim=(0, None))
    energy.legend(fontsize=8)
    force = figure.add_subplot(grid[1, 1])
    peaks = fall.impacts.column("peak_force")
    force.bar(np.arange(1, len(peaks) + 1), peaks)
    force.set(xlabel="impact", ylabel="peak force (N)", xlim=(0, len(peaks) + 1))
    force.xaxis.get_major_locator().set_params(integer=True)
    return figure_or_path(figure, path)


def surface_of(body: FreeBody) -> tuple[Array, IntArray]:
    """(points (P, 3) [m] from the centre of mass, triangles (T, 3)) of the surface or hull."""
    from scipy.spatial import ConvexHull, QhullError

    skin = body.skin
    if skin is not None and 0 < len(skin.triangles) < MOST_TRIANGLES:
        return skin.points - body.centre, skin.triangles

    points = body.points
    if body.ball_radii.any() and len(points) == 1:  # a ball
        grid = np.array([*product(np.linspace(-1, 1, 9), repeat=3)])
        grid = grid[np.abs(grid).max(axis=1) == 1]
        points = body.ball_radii[0] * grid / np.linalg.norm(grid, axis=1, keepdims=True)

    try:
        return points, np.asarray(ConvexHull(points).simplices)
    except (QhullError, ValueError):
        return points, np.zeros((0, 3), dtype=int)


def _draw_part(axes: Any, body: FreeBody, state: State) -> None:
    """Draw the part and the floor in a state."""
    from mpl_toolkits.mplot3d.art3d import Poly3DCollection  # type: ignore[import-untyped]

    points, triangles = surface_of(body)
    x = points @ state.R.T
    x[:, 2] += state.centre[2]
    half = 0.6 * body.extent
    square = np.array([[-1, -1], [1, -1], [1, 1], [-1, 1]]) * half
    axes.add_collection3d(
        Poly3DCollection([np.column_stack((square, np.zeros(4)))], facecolors="0.85")
    )

    if len(triangles):
        corners = x[triangles]
        normal = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
        shade = np.abs(normal @ LIGHT_DIRECTION) / np.maximum(
            np.linalg.norm(normal, axis=1), 1e-300
        )
        colours = np.clip(np.outer(0.55 + 0.45 * shade, COLOUR), 0, 1)
        axes.add_collection3d(Poly3DCollection(corners, facecolors=colours))
    else:
        axes.scatter(*x.T, s=12)

    top = max(float(x[:, 2].max()), half)
    axes.set(xlim=(-half, half), ylim=(-half, half), zlim=(0, top))
    axes.set_box_aspect((2 * half, 2 * half, top), zoom=1.6)
    axes.view_init(elev=18.0)
    axes.set_axis_off()


def state_at(fall: Any, time: float) -> State:
    """The state at a time [s] of the fall; during a contact, the state at its start."""
    flight = [fall.flights[0], *(f for f in fall.flights if f.start.time <= time)][-1]
    starts = [one.start for one in fall.episodes if flight.start.time <= one.start.time <= time]
    state: State = starts[-1] if starts else flight.state_at(time - flight.start.time)
    return state
