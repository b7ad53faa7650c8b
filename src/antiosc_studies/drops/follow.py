"""How far a fall is, as progress: its impacts, or its time, of those that were asked for."""

from __future__ import annotations

import time as clocks
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from math import isfinite

from antiosc.base.progress import doing, seconds_text
from antiosc.base.texts import engineering
from antiosc_studies.drops.floor import Setting
from antiosc_studies.drops.trajectory import MOST_IMPACTS


@contextmanager
def followed(setting: Setting) -> Iterator[Callable[[int, int, float], None]]:
    """Show how far a fall is; yields the `report` of `trajectory`."""
    began = clocks.monotonic()
    starts: dict[int, float] = {}
    with doing("the fall") as tell:

        def report(impact: int, contact: int, time: float) -> None:
            lasted = clocks.monotonic() - began
            start = starts.setdefault(impact, lasted)
            tell(reached_text(setting, impact, contact, time, start, lasted))

        yield report


def reached_text(
    setting: Setting, impact: int, contact: int, time: float, start: float, lasted: float
) -> str:
    """How far a fall is in a contact of an impact, both from 1, at this time of the fall [s].

    The impact began after `start` of the `lasted` seconds of work. Each impact to come is expected
    to take the mean time of those done; of two impacts of a printed bracket one took ten times as
    long as the other, with six contacts.
    """
    place = f"contact {contact} of impact {impact}"
    if isfinite(setting.duration):
        return f"{1e3 * time:.0f} of {1e3 * setting.duration:.0f} ms, {place}"
    if setting.impacts == MOST_IMPACTS:
        return f"{place}, at {engineering(time, 's')}"
    done = impact - 1
    text = f"{place}; impacts done {done} of {setting.impacts:.0f}"
    left = start * setting.impacts / done - lasted if done else 0.0
    return f"{text}, about {seconds_text(left)} left if all take as long" if left > 0 else text
