"""The main impact of a contact, of which the contact time is the length."""

from __future__ import annotations

from collections.abc import Iterable


def contact_time(contacts: Iterable[tuple[float, float, float]]) -> float:
    """Time [s] from the first touch to the last release of the main impact; 0 without contact.

    Successive contacts belong to one impact if the flight between them is shorter than the impact
    up to then; the main impact is the one with the largest impulse.

    Parameters
    ----------
    contacts : (start [s], end [s], impulse [N s]) of each contact, in order; one that goes on at
        the end of the run counts up to there.
    """
    impacts: list[tuple[float, float, float]] = []
    for start, end, impulse in contacts:
        if impacts and start - impacts[-1][1] < impacts[-1][1] - impacts[-1][0]:
            first, _, before = impacts.pop()
            start, impulse = first, before + impulse
        impacts.append((start, end, impulse))
    start, end, _ = max(impacts, key=lambda impact: impact[2], default=(0.0, 0.0, 0.0))
    return end - start
