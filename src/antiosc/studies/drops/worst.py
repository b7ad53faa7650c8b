"""The largest stress at every node over a whole fall."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from antiosc.base import checks
from antiosc.base._types import Array, IntArray
from antiosc.base.errors import InputError, without_warnings
from antiosc.results.peaks import PeakField, peak_field
from antiosc.simulation.histories.scene_history import BodyHistory
from antiosc.studies.drops.contact_scene import BODY
from antiosc.studies.drops.course import Course

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


def worst(fall: Course, quantity: str, impacts: Any = None, **options: Any) -> WorstField:
    """The largest value of a quantity at every node; see `Fall.worst`."""
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
    impact = np.searchsorted(begins, found.times, side="right") - 1
    return WorstField(**vars(replace(found, error=None)), impact=impact)


def _times(fall: Course, duration: float) -> Array:
    """Times of an episode that are looked at."""
    highest = float(fall.body.omega.max(initial=0.0)) / (2 * np.pi)
    return np.linspace(0.0, duration, int(min(max(LOOKS * highest * duration, 20), MOST)))
