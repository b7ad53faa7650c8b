"""How far the site of a struck part moves, and when the striker is out of its reach.

Without forces a mode vibrates with the amplitude A = √(q² + (v/ω)²), and less if it is damped: a
site never moves further than Σ |b| A.
"""

from __future__ import annotations

from math import inf
from typing import Any, NamedTuple

import numpy as np

from antiosc.base._types import Array
from antiosc.impact.histories.motion import RunHistory
from antiosc.models.modal import ModalBody

#: Times of a run, and of its contacts, at which the displacement is looked for first; times that
#: are then looked at beside each of the largest of these.
TIMES, LARGEST, BESIDE = 2000, 8, 60
#: First duration of an impact [s] that lasts until its bodies have parted, and the largest one over
#: it.
DURATION, LONGER = 1e-3, 32


class SiteMotion(NamedTuple):
    """The displacement of a site along the impact, of `History.displacement`.

    largest : the largest within the run [m]; `time` [s]: when.
    """

    largest: float
    time: float


def site_motion(hit: RunHistory) -> SiteMotion | None:
    """The motion of the only site of "structure"; None of a part that moves on as a whole."""
    placed = hit.assembly.bodies.get("structure")
    if len(hit.contact_histories) != 1 or placed is None:
        return None

    body = placed.modes
    if not isinstance(body, ModalBody) or not body.omega.all():
        return None

    span = hit.assembly.spans["structure"]

    def moved(times: Array) -> Array:
        """|Displacements| (n,) at times."""
        q = hit.states(times)[0][:, span]
        return np.abs(q @ body.b + body.r * hit.force_at(times))

    end = float(hit.run.time[-1])
    touched = hit.contacts[-1][1] if hit.contacts else end
    times = np.union1d(*(np.linspace(0.0, last, TIMES) for last in (end, touched)))
    sizes = moved(times)

    for k in np.argsort(-sizes)[:LARGEST]:
        near = times[max(k - 1, 0)], times[min(k + 1, times.size - 1)]
        beside = np.linspace(*near, BESIDE)
        times, sizes = np.append(times, beside), np.append(sizes, moved(beside))

    k = int(sizes.argmax())

    return SiteMotion(float(sizes[k]), float(times[k]))


def out_of_reach(hit: RunHistory) -> float | None:
    """Time [s] from which a free striker is further away than the part may swing after the run, if
    it flies on alone: inf if it comes nearer. None where forces act, or either is no such body.
    """
    a = hit.assembly
    part, striker = (a.bodies.get(name) for name in ("structure", "impactor"))
    if part is None or striker is None or striker.omega.any() or not part.omega.all():
        return None

    end = float(hit.run.time[-1])
    swing = _reach(hit, a.system.beta[0, a.spans["structure"]])
    if not np.isfinite(swing) or a.system.first is not None:
        return None

    q, v = (state[-1, a.spans["impactor"]] for state in hit.states([end]))
    beta = a.system.beta[0, a.spans["impactor"]]
    nearest = swing + float(beta @ q - a.system.offsets[-1, 0])  # indentation at the full swing
    away = -float(beta @ v)
    if nearest <= 0 <= away:
        return end
    return end + nearest / away if away > 0 else inf


def _reach(hit: RunHistory, b: Array) -> float:
    """The largest Σ |b| A [m] after the run; inf of a part under loads."""
    a = hit.assembly
    scene = a.scene
    loaded = len(scene.loads) > 0 or scene.base is not None or np.any(scene.gravity)
    if loaded:
        return inf

    span = a.spans["structure"]
    q, v = (state[-1, span] for state in hit.states([float(hit.run.time[-1])]))

    return float(np.abs(b) @ np.hypot(q, v / a.bodies["structure"].omega))


def parted(hit: Any) -> bool:
    """Whether striker and part of an impact neither touch nor approach at the end, nor meet again
    as far as is known.
    """
    end = float(hit.run.time[-1])
    touching = bool(hit.contacts) and hit.contacts[-1][1] >= end
    if touching or (hit.restitution is not None and hit.restitution < 0):
        return False
    return (out_of_reach(hit) or end) <= end
