"""How far a fall is, as progress: its impacts, or its time, of those that were asked for."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from math import isfinite

from antiosc.base.progress import doing
from antiosc.base.texts import engineering
from antiosc_studies.drops.floor import Setting
from antiosc_studies.drops.trajectory import MOST_IMPACTS


@contextmanager
def followed(setting: Setting) -> Iterator[Callable[[int, int, float], None]]:
    """Show how far a fall is; yields the `report` of `trajectory`."""
    with doing("the fall") as tell:
        yield lambda *reached: tell(reached_text(setting, *reached))


def reached_text(setting: Setting, impact: int, contact: int, time: float) -> str:
    """How far a fall is in a contact of an impact, both from 1, at this time of the fall [s].

    The remaining work is not estimated: of two impacts of a printed bracket one took ten times as
    long as the other, with six contacts.
    """
    place = f"contact {contact} of impact {impact}"
    if isfinite(setting.duration):
        return f"{1e3 * time:.0f} of {1e3 * setting.duration:.0f} ms, {place}"
    if setting.impacts == MOST_IMPACTS:
        return f"{place}, at {engineering(time, 's')}"
    return f"{place}; impacts done {impact - 1} of {setting.impacts:.0f}"
