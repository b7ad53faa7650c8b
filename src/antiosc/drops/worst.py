"""The largest stress at every node over a whole fall."""

from __future__ import annotations

import os
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from antiosc import checks
from antiosc._types import Array, IntArray
from antiosc.charts.figures import finished
from antiosc.charts.surfaces import colour_scale, draw_faces, frame, space
from antiosc.drops.episode import BODY
from antiosc.errors import InputError, without_warnings
from antiosc.fem.peaks import PeakField, peak_field

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from antiosc.drops.fall import Fall

#: Looks at a period of the mode that is the fastest of those which matter, at most so many.
LOOKS, MOST = 8, 400


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


def worst(fall: Fall, quantity: str, impacts: Any = None, **options: Any) -> WorstField:
    """The largest value of a quantity at every node; see `Fall.worst`."""
    from antiosc.drops.skin import skin_of

    structure = fall.body.structure
    if structure is None:
        raise InputError("a rigid part has no stress: drop a Structure.")
    if not fall.groups:
        raise InputError("the fall has no impact; let it last longer (until=).")
    chosen = range(len(fall.groups)) if impacts is None else checks.column("impacts", impacts)
    found: WorstField | None = None
    skin = skin_of(structure)
    for k in map(int, chosen):
        if not 0 <= k < len(fall.groups):
            raise InputError(f"impacts are numbered from 0 to {len(fall.groups) - 1}; got {k}.")
        for one in (fall.episodes[i] for i in fall.groups[k]):
            times = _times(fall, one.duration)
            with without_warnings():
                own = peak_field(structure, one.history, quantity, times, body=BODY, **options)
            then = own.times + one.start.time
            if found is None:
                which = np.full(own.values.size, k)
                found = WorstField(
                    quantity, own.unit, own.points, own.values, then, own._cells, None,
                    which, (skin.points, skin.triangles),
                )  # fmt: skip
            else:
                more = own.values > found.values
                found.values[more], found.times[more] = own.values[more], then[more]
                found.impact[more] = k
    assert found is not None
    return found


def _times(fall: Fall, duration: float) -> Array:
    """Times of an episode that are looked at."""
    highest = float(fall.body.omega.max(initial=0.0)) / (2 * np.pi)
    return np.linspace(0.0, duration, int(min(max(LOOKS * highest * duration, 20), MOST)))
