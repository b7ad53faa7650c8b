"""Pictures of a fall: an overview, and a film."""

from __future__ import annotations

import os
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from antiosc.base import checks, files
from antiosc.base._types import Array, IntArray
from antiosc.base.charts.figures import finished, new_figure
from antiosc.base.errors import InputError
from antiosc.studies.drops.course import Course
from antiosc.studies.drops.flight import Flight, State

if TYPE_CHECKING:
    from matplotlib.figure import Figure

#: Frames of a film in a second, and points of a flight that are drawn.
RATE, DRAWN = 25, 60
#: Most triangles of a surface that are drawn.
TRIANGLES = 6000


def overview(fall: Course, path: str | os.PathLike[str] | None) -> Figure | Path:
    """The part as it first hits, its height, the energies, and the forces of the impacts."""
    figure = new_figure((9.0, 6.0), shown=path is None)
    grid = figure.add_gridspec(2, 2)
    first = fall.episodes[0].start if fall.episodes else fall.end
    axes = figure.add_subplot(grid[0, 0], projection="3d", proj_type="ortho", computed_zorder=False)
    _posed(axes, fall, first)
    axes.set_title("at the first touch", fontsize=10)
    height = figure.add_subplot(grid[0, 1])
    t, low, centre = _heights(fall)
    height.plot(t, centre, label="centre of mass")
    height.plot(t, low, label="lowest point")
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
    force.set(xlabel="impact", ylabel="peak force (N)")
    force.xaxis.get_major_locator().set_params(integer=True)
    return finished(figure, path)


def _heights(fall: Course) -> tuple[Array, Array, Array]:
    """Times [s], and heights of the lowest point and of the centre [m]."""
    every = np.arange(len(fall.body.points))
    rows: list[tuple[float, float, float]] = []
    ends = [one.start.time for one in fall.episodes] + [fall.end.time]
    for flight in fall.flights:
        end = min((e for e in ends if e >= flight.start.time), default=fall.end.time)
        for t in np.linspace(0.0, end - flight.start.time, DRAWN):
            low = float(flight.heights(np.array([t]), every).min())
            rows.append((flight.start.time + t, low, float(flight.at(t).centre[2])))
    found = np.array(rows)
    return found[:, 0], found[:, 1], found[:, 2]


def _surface(fall: Course) -> tuple[Array, IntArray]:
    """Points (P, 3) relative to the centre of mass, and triangles (T, 3), or lines of the hull."""
    body = fall.body
    if body.structure is not None:
        from antiosc.studies.drops.skin import skin_of

        skin = skin_of(body.structure)
        every = max(1, len(skin.triangles) // TRIANGLES)
        if every == 1 and len(skin.triangles):
            return skin.points - body.centre, skin.triangles
    from scipy.spatial import ConvexHull, QhullError

    points = body.points
    if body.balls.any() and len(points) == 1:  # a ball
        grid = np.stack(np.meshgrid(*[np.linspace(-1, 1, 9)] * 3), axis=-1).reshape(-1, 3)
        grid = grid[np.abs(grid).max(axis=1) == 1]
        points = body.balls[0] * grid / np.linalg.norm(grid, axis=1, keepdims=True)
    try:
        return points, np.asarray(ConvexHull(points).simplices)
    except (QhullError, ValueError):
        return points, np.zeros((0, 3), dtype=int)


def _posed(
    axes: Any, fall: Course, state: State, surface: tuple[Array, IntArray] | None = None
) -> None:
    """Draw the part in a state above the floor."""
    from mpl_toolkits.mplot3d.art3d import Poly3DCollection  # type: ignore[import-untyped]

    from antiosc.base.charts.surfaces import LIGHT

    points, triangles = _surface(fall) if surface is None else surface
    x = points @ state.R.T
    x[:, 2] += state.centre[2]
    half = 0.6 * fall.body.extent
    square = np.array([[-1, -1], [1, -1], [1, 1], [-1, 1]]) * half
    axes.add_collection3d(
        Poly3DCollection([np.column_stack((square, np.zeros(4)))], facecolors="0.85")
    )
    if len(triangles):
        corners = x[triangles]
        normal = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
        shade = np.abs(normal @ LIGHT) / np.maximum(np.linalg.norm(normal, axis=1), 1e-300)
        colours = np.outer(0.55 + 0.45 * shade, [0.35, 0.55, 0.8])
        axes.add_collection3d(Poly3DCollection(corners, facecolors=np.clip(colours, 0, 1)))
    else:
        axes.scatter(*x.T, s=12)
    top = max(float(x[:, 2].max()), half)
    axes.set(xlim=(-half, half), ylim=(-half, half), zlim=(0, top))
    axes.set_box_aspect((2 * half, 2 * half, top), zoom=1.15)
    axes.view_init(elev=18.0)
    axes.set_axis_off()


def film(fall: Course, path: str | os.PathLike[str], seconds: float) -> Path:
    """A film of the whole fall from the first impact's approach on."""
    target = checks.new_file("path", path)
    if target.suffix.lower() not in (".mp4", ".gif"):
        raise InputError(f"a film is .mp4 or .gif; got {target.name}.")
    from matplotlib import animation

    if target.suffix.lower() == ".mp4" and not animation.writers.is_available("ffmpeg"):
        raise InputError("an .mp4 needs ffmpeg, which is not installed; write a .gif.")
    figure = new_figure((6.0, 5.0), shown=False)
    axes = figure.add_subplot(projection="3d", proj_type="ortho", computed_zorder=False)
    surface = _surface(fall)
    begin = fall.episodes[0].start.time * 0.9 if fall.episodes else 0.0
    times = np.linspace(begin, fall.end.time, max(int(RATE * seconds), 2))

    def drawn(k: int) -> list[Any]:
        axes.clear()
        _posed(axes, fall, at(fall, float(times[k])), surface)
        axes.set_title(f"{times[k]:.4f} s", fontsize=10)
        return []

    moving = animation.FuncAnimation(figure, drawn, len(times))
    kind = "ffmpeg" if target.suffix.lower() == ".mp4" else "pillow"
    with files.complete(target, "the film") as part:
        own = part.with_name(f"{part.name}{target.suffix}")
        moving.save(str(own), writer=kind, fps=RATE)
        own.replace(part)
    return target


def at(fall: Course, time: float) -> State:
    """The state at a time [s] of the fall; during a contact that at its start or end."""
    before = [f for f in fall.flights if f.start.time <= time]
    flight: Flight = before[-1] if before else fall.flights[0]
    ends = [one for one in fall.episodes if flight.start.time <= one.start.time <= time]
    return ends[-1].start if ends else flight.at(time - flight.start.time)
