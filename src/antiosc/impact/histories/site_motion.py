"""Largest displacement of the site of a struck part, and whether the bodies have parted.

They have parted if no contact is closed at the end of the run, their rigid-body motions do not
approach, and the striker is farther from the site's place at rest than the site has moved from it
at any time of the run. Of a free part this distance is not checked.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from antiosc.base._types import Array
from antiosc.impact.histories.motion import RunHistory
from antiosc.models.modal import ModalBody

#: Number of times at which displacements are evaluated first, number of peaks around which they
#: are refined, and times for each peak (within 1e-6 of 20 000 times, measured).
TIME_COUNT, MAX_PEAKS, TIMES_PER_PEAK = 400, 8, 60
#: First duration [s] of a run that is extended until the bodies have parted; largest ratio to it.
INITIAL_DURATION, LONGER = 1e-3, 32


class SiteMotion(NamedTuple):
    """Largest displacement of a site along the impact, and its time."""

    largest_displacement: float  # within the run [m]
    time: float  # when [s]


def site_motion(hit: RunHistory) -> SiteMotion | None:
    """The largest displacement of the site of "structure"; None for a free part."""
    placed = hit.assembly.bodies.get("structure")
    if len(hit.contact_histories) != 1 or placed is None:
        return None

    body = placed.modes
    if not isinstance(body, ModalBody) or not body.omega.all():
        return None

    span = hit.assembly.stacked.spans["structure"]

    def displacements(times: Array) -> Array:
        """|Displacements| (n,) at times."""
        q = hit.states(times)[0][:, span]
        return np.abs(q @ body.b + body.r * hit.force_at(times))

    end = float(hit.run.time[-1])
    touched = hit.contacts[-1][1] if hit.contacts else end
    times = np.union1d(*(np.linspace(0.0, last, TIME_COUNT) for last in (end, touched)))
    sizes = displacements(times)

    largest = np.argsort(-sizes)[:MAX_PEAKS]
    before, after = np.maximum(largest - 1, 0), np.minimum(largest + 1, times.size - 1)
    beside = np.linspace(times[before], times[after], TIMES_PER_PEAK).ravel()
    times, sizes = np.append(times, beside), np.append(sizes, displacements(beside))

    k = int(sizes.argmax())

    return SiteMotion(float(sizes[k]), float(times[k]))


def parted(hit: Any) -> bool:
    """Whether at the end the bodies are farther apart than the site has moved."""
    touching = bool(hit.contacts) and hit.contacts[-1][1] >= float(hit.run.time[-1])
    if touching or (hit.restitution is not None and hit.restitution < 0):
        return False

    away = -float(hit.indentation[-1] + hit.displacement[-1])
    return hit.site_motion is None or away > hit.site_motion.largest_displacement
