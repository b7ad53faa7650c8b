"""The impacts of a fall as a table."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from antiosc.base._types import Array
from antiosc.base.plausible import GRAVITY
from antiosc.base.texts import FieldsRepr, percent
from antiosc.impact.histories.bars import OF_ALL_CONTACTS
from antiosc_studies.drops.episode import Episode
from antiosc_studies.drops.free_body import FreeBody, State
from antiosc_studies.drops.yielding import PointContacts


@dataclass(frozen=True, eq=False)
class FallImpact:
    """One impact: a contact, and those that follow within the longest modal period or its length.

    time : time of the first touch [s]; contact_time : from there to the last release [s].
    touches : number of times that the part touches in the contact time, with flights in between.
    hardest_touch_duration : duration [s] of the touch with the largest force.
    place : (3,) point that takes the largest impulse, in the axes of the mesh [m].
    contacts : number of points that touched.
    peak_force : largest sum of the normal forces [N]; impulse : sum of the normal impulses [N s].
    speed_before, speed_after : normal speeds [m/s] of this point without vibrations, > 0 toward the
        floor before and away from it after the impact.
    spin_before, spin_after : (3,) spins in the axes of the floor [rad/s].
    lost : energy dissipated by contacts and damping [J].
    law_error : relative error of the largest force at a point due to its law; None if unknown.
    """

    time: float
    contact_time: float
    touches: int
    hardest_touch_duration: float
    place: Array
    contacts: int
    peak_force: float
    impulse: float
    speed_before: float
    speed_after: float
    spin_before: Array
    spin_after: Array
    lost: float
    law_error: float | None


#: Scalars of an impact, and their units.
UNITS = (
    ("time", "s"), ("peak_force", "N"), ("impulse", "N s"), ("contact_time", "s"),
    ("speed_before", "m/s"), ("speed_after", "m/s"), ("lost", "J"),
)  # fmt: skip
#: Headings of the printed table, their units, and how each is printed.
TABLE_COLUMNS = (
    ("time", "s", "time", ".5f"), ("peak", "N", "peak_force", ".4g"),
    ("impulse", "N s", "impulse", ".4g"), ("contact", "s", "contact_time", ".4g"),
    ("touches", "", "touches", "d"), ("speed before", "m/s", "speed_before", ".4g"),
    ("speed after", "m/s", "speed_after", ".4g"), ("lost", "J", "lost", ".3g"),
)  # fmt: skip


class Impacts(tuple[FallImpact, ...]):
    """The impacts of a fall; its text is a table."""

    def column(self, name: str) -> Array:
        """One quantity of all impacts: (n,) or (n, 3); NaN where it is unknown."""
        values = (getattr(impact, name) for impact in self)
        return np.array([np.nan if value is None else value for value in values])

    def columns(self) -> dict[str, Array]:
        """Columns (n,) of the table by name with unit."""
        place = self.column("place").reshape(-1, 3)
        table = {f"{name.replace('_', ' ')} ({unit})": self.column(name) for name, unit in UNITS}
        table["touches"] = self.column("touches")
        table |= {f"place {axis} (m)": place[:, k] for k, axis in enumerate("xyz")}
        for name in ("spin_before", "spin_after"):
            spin = self.column(name).reshape(-1, 3)
            table[f"{name.replace('_', ' ')} (rad/s)"] = np.linalg.norm(spin, axis=1)

        return table | {"law error (%)": 100 * self.column("law_error")}

    def numbers(self) -> dict[str, object]:
        """Columns of the table by name with unit, as JSON values; None where unknown."""
        columns = {name: values.tolist() for name, values in self.columns().items()}
        return {name: [None if v != v else v for v in values] for name, values in columns.items()}

    @property
    def touch_again(self) -> bool:
        """Whether the part touches several times in an impact."""
        return any(impact.touches > 1 for impact in self)

    def __str__(self) -> str:
        columns = [
            (heading, unit, *(format(getattr(impact, name), form) for impact in self))
            for heading, unit, name, form in TABLE_COLUMNS
            if name != "touches" or self.touch_again
        ]
        bars = ("–" if one.law_error is None else percent(one.law_error) for one in self)
        places = (", ".join(f"{c:.3g}" for c in one.place) for one in self)
        columns.insert(0, ("no.", "", *(f"{k + 1}" for k in range(len(self)))))
        columns.insert(2, ("place", "m", *places))
        columns.insert(4, ("± law", "", *bars))
        spins = (f"{np.linalg.norm(one.spin_after):.4g}" for one in self)
        columns.insert(-1, ("spin after", "rad/s", *spins))
        aligned = [[cell.rjust(max(map(len, column))) for cell in column] for column in columns]
        lines = ["  ".join(row) for row in zip(*aligned, strict=True)]
        if self.touch_again:
            lines.append(f"contact: {OF_ALL_CONTACTS}")

        return "\n".join(lines)


@dataclass(frozen=True)
class Peak(FieldsRepr):
    """The largest value of a signal, from `Fall.peak`.

    Attributes
    ----------
    value : value in SI units.
    time : time [s].
    impact : number of the impact, from 0.
    """

    value: float
    time: float
    impact: int

    @property
    def g(self) -> float:
        """The value of an acceleration in g."""
        return self.value / GRAVITY

    def __float__(self) -> float:
        return self.value


def impact_of(body: FreeBody, gravity: float, contacts: PointContacts) -> FallImpact:
    """The table row of one impact from its contacts, under a gravity [m/s^2]."""
    # a point above its dent begins an episode without force, which counts as flight
    episodes = [one for one in contacts.episodes if one.forces()[1].any()] or contacts.episodes
    impulses: dict[int, float] = {}
    for current in episodes:
        for i, value in zip(current.indices.tolist(), current.impulses().tolist(), strict=True):
            impulses[i] = impulses.get(i, 0.0) + value

    strongest = max(impulses, key=lambda i: impulses[i])
    first, last = episodes[0].start, episodes[-1].end
    energies = [sum(state.energies(body, gravity)) for state in (first, last)]
    time, force = total_force(episodes)
    place = body.points[strongest] - body.ball_radii[strongest] * first.R[2] + body.centre

    return FallImpact(
        time=first.time,
        contact_time=last.time - first.time,
        touches=_touch_count(force),
        hardest_touch_duration=_hardest_touch_duration(time, force),
        place=place,
        contacts=sum(value > 0 for value in impulses.values()),
        peak_force=max(current.peak_force() for current in episodes),
        impulse=sum(impulses.values()),
        speed_before=-_upward_speed(body, first, strongest),
        speed_after=_upward_speed(body, last, strongest),
        spin_before=first.spin(body),
        spin_after=last.spin(body),
        lost=energies[0] - energies[1],
        law_error=contacts.law_error,
    )


def total_force(episodes: Sequence[Episode]) -> tuple[Array, Array]:
    """Times (n,) [s] since the first touch, and sums of the normal forces (n,) [N]."""
    first = episodes[0].start.time
    records = [(episode.start.time - first, *episode.forces()) for episode in episodes]
    time = np.concatenate([offset + t for offset, t, _ in records])
    return time, np.concatenate([force.sum(axis=1) for _, _, force in records])


def _touch_count(force: Array) -> int:
    """Number of times that a force (n,) rises from zero."""
    touching = np.append(False, force > 0)
    return int(np.sum(touching[1:] & ~touching[:-1]))


def _hardest_touch_duration(time: Array, force: Array) -> float:
    """Duration [s] of the touch with the largest of the forces (n,) at these times."""
    top = int(np.argmax(force))
    off = np.flatnonzero(force <= 0)
    before, after = off[off < top], off[off > top]
    first = before[-1] if len(before) else 0
    last = after[0] if len(after) else len(time) - 1
    return float(time[last] - time[first])


def _upward_speed(body: FreeBody, state: State, index: int) -> float:
    """Upward speed [m/s] of the point `index` of the rigid body."""
    (arm,) = state.positions(body, [index])
    return float((state.velocity + np.cross(state.spin(body), arm))[2])
