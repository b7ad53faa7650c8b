"""The impacts of a fall as a table, and the largest value of a signal."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from antiosc.base._types import Array
from antiosc.base.texts import Given
from antiosc.studies.drops.body import FreeBody
from antiosc.studies.drops.episode import Episode
from antiosc.studies.drops.flight import State

#: Standard gravity, for results in g [m/s^2].
G = 9.80665


@dataclass(frozen=True, eq=False)
class Impact:
    """One impact: all contacts with less than a period of the slowest mode between them.

    Attributes
    ----------
    time : of the first touch [s]; contact_time : from there to the last release [s].
    place : (3,) point that takes most of the impulse, in the axes of the mesh [m].
    contacts : number of points that touched.
    peak_force : largest sum of the normal forces [N]; impulse : of the normal forces [N s].
    speed_before, speed_after : of that point along the normal, > 0 toward the floor before and
        away from it after [m/s], without vibrations.
    spin_before, spin_after : (3,) in the axes of the floor [rad/s].
    lost : energy that contacts and damping took [J].
    """

    time: float
    contact_time: float
    place: Array
    contacts: int
    peak_force: float
    impulse: float
    speed_before: float
    speed_after: float
    spin_before: Array
    spin_after: Array
    lost: float


#: Scalars of an impact, and their units.
UNITS = (
    ("time", "s"), ("peak_force", "N"), ("impulse", "N s"), ("contact_time", "s"),
    ("speed_before", "m/s"), ("speed_after", "m/s"), ("lost", "J"),
)  # fmt: skip


class Impacts(tuple[Impact, ...]):
    """The impacts of a fall; as text a table."""

    def column(self, name: str) -> Array:
        """One value of all impacts, (n,) or (n, 3)."""
        return np.array([getattr(one, name) for one in self])

    def columns(self) -> dict[str, Array]:
        """Name with unit -> (n,) values."""
        place = self.column("place").reshape(-1, 3)
        table = {f"{name.replace('_', ' ')} ({unit})": self.column(name) for name, unit in UNITS}
        table |= {f"place {axis} (m)": place[:, k] for k, axis in enumerate("xyz")}
        for name in ("spin_before", "spin_after"):
            spin = self.column(name).reshape(-1, 3)
            table[f"{name.replace('_', ' ')} (rad/s)"] = np.linalg.norm(spin, axis=1)
        return table

    def __str__(self) -> str:
        rows = [
            f"{'':>3} {'time s':>10} {'place m':>26} {'peak N':>10} {'impulse Ns':>10} "
            f"{'contact s':>9} {'before m/s':>10} {'after m/s':>9} {'spin rad/s':>10} {'lost J':>9}"
        ]
        for k, one in enumerate(self):
            place = ", ".join(f"{c:.3g}" for c in one.place)
            rows.append(
                f"{k + 1:>3} {one.time:>10.5f} {place:>26} {one.peak_force:>10.4g} "
                f"{one.impulse:>10.4g} {one.contact_time:>9.3g} {one.speed_before:>10.4g} "
                f"{one.speed_after:>9.4g} {np.linalg.norm(one.spin_after):>10.4g} {one.lost:>9.3g}"
            )
        return "\n".join(rows)


@dataclass(frozen=True)
class Peak(Given):
    """The largest value of a signal, as `Fall.peak` finds it.

    Attributes
    ----------
    value : in SI units.
    time : [s].
    impact : number of the impact, from 0.
    """

    value: float
    time: float
    impact: int

    @property
    def g(self) -> float:
        """An acceleration in g."""
        return self.value / G

    def __float__(self) -> float:
        return self.value


def impact_of(body: FreeBody, gravity: float, own: Sequence[Episode]) -> Impact:
    """The impact that some episodes make."""
    impulses: dict[int, float] = {}
    peak = 0.0
    for one in own:
        f = one.forces()[1]
        peak = max(peak, float(f.sum(axis=1).max(initial=0.0)))
        for i, value in zip(one.which.tolist(), one.impulses().tolist(), strict=True):
            impulses[i] = impulses.get(i, 0.0) + value
    most = max(impulses, key=lambda i: impulses[i])
    before, after = own[0].start, own[-1].end
    energies = [sum(s.energies(body, gravity)) for s in (before, after)]
    return Impact(
        time=before.time,
        contact_time=after.time - before.time,
        place=body.points[most] - body.balls[most] * before.R[2] + body.centre,
        contacts=sum(value > 0 for value in impulses.values()),
        peak_force=peak,
        impulse=sum(impulses.values()),
        speed_before=-_rising(body, before, most),
        speed_after=_rising(body, after, most),
        spin_before=before.spin(body),
        spin_after=after.spin(body),
        lost=energies[0] - energies[1],
    )


def _rising(body: FreeBody, state: State, point: int) -> float:
    """Speed [m/s] at which a point of the rigid body rises."""
    (arm,) = state.arms(body, [point])
    return float((state.velocity + np.cross(state.spin(body), arm))[2])
