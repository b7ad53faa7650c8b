"""The largest stress at every node over a whole fall."""

from __future__ import annotations

import os
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from antiosc.base import checks
from antiosc.base._types import Array, IntArray
from antiosc.base.errors import InputError, without_warnings
from antiosc.charts.figures import finished
from antiosc.charts.surfaces import colour_scale, draw_faces, frame, space
from antiosc.results.peaks import PeakField, peak_field
from antiosc.simulation.scene_history import BodyHistory
from antiosc.studies.drops.contact_scene import BODY
from antiosc.studies.drops.course import Course

if TYPE_CHECKING:
    from matplotlib.figure import Figure

#: Looks at a period of the mode that is the fastest of those which matter, at most so many.
LOOKS, MOST = 8, 200


@dataclass(frozen=True, eq=False, repr=False)
class WorstField(PeakField):
    """A `PeakField` over the impacts of a fall; its times are those of the fall.

    Attributes
    ----------
    impact : (P,) number of the impact, from 0, in which each node has its largest value.
    """

    impact: IntArray = field(default_factory=lambda: np.zeros(0, dtype=int))
    _faces: tuple[Array, IntArray] = field(
        default=(np.zeros((0, 3)), np.zeros((0, 3), dtype=int)), repr=False
    )

    def plot(self, path: str | os.PathLike[str] | None = None) -> Figure | Path:
        """The values on the surface of the part; `path` as of `plot_history`."""
        from scipy.spatial import cKDTree

        points, faces = self._faces
        if not len(faces):
            raise InputError("the part has no surface to draw: use write(path).")
        figure, axes, scale, unit = space(points, shown=path is None)
        own = self.values[cKDTree(self.points).query(points)[1]]
        shown = own[faces].mean(axis=1)
        label = f"{self.quantity.replace('_', ' ')} ({self.unit})"
        draw_faces(figure, axes, scale * points[faces], shown, label, colour_scale(shown))
        frame(axes, scale * points)
        axes.set(xlabel=f"x ({unit})", ylabel=f"y ({unit})", zlabel=f"z ({unit})")
        return finished(figure, path)


def worst(fall: Course, quantity: str, impacts: Any = None, **options: Any) -> WorstField:
    """The largest value of a quantity at every node; see `Fall.worst`."""
    from antiosc.studies.drops.skin import skin_of

    structure = fall.body.structure
    if structure is None:
        raise InputError("a rigid part has no stress: drop a Structure.")
    if not fall.groups:
        raise InputError("the fall has no impact; let it last longer (until=).")
    chosen = range(len(fall.groups)) if impacts is None else checks.column("impacts", impacts)
    parts: list[BodyHistory] = []
    for k in map(int, chosen):
        if not 0 <= k < len(fall.groups):
            raise InputError(f"impacts are numbered from 0 to {len(fall.groups) - 1}; got {k}.")
        for one in (fall.episodes[i] for i in fall.groups[k]):
            times = _times(fall, one.duration)
            own = one.history.at(times)[BODY]
            parts.append(replace(own, time=times + one.start.time))
    joined = {n: np.concatenate([getattr(p, n) for p in parts]) for n in ("time", "q", "v", "a")}
    count = joined["time"].size, parts[0].forces.shape[1]
    whole = replace(parts[0], forces=np.zeros(count), **joined)
    with without_warnings():
        found = peak_field(structure, whole, quantity, **options)
    begins = [fall.episodes[own[0]].start.time for own in fall.groups]
    skin = skin_of(structure)
    return WorstField(
        quantity, found.unit, found.points, found.values, found.times, found._cells, None,
        np.searchsorted(begins, found.times, side="right") - 1, (skin.points, skin.triangles),
    )  # fmt: skip


def _times(fall: Course, duration: float) -> Array:
    """Times of an episode that are looked at."""
    highest = float(fall.body.omega.max(initial=0.0)) / (2 * np.pi)
    return np.linspace(0.0, duration, int(min(max(LOOKS * highest * duration, 20), MOST)))
