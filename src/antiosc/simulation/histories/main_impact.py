"""The main impact of a contact, of which the contact time is the length."""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np

from antiosc.base import march


def contact_time(contacts: Iterable[tuple[float, float, float]]) -> float:
    """Time [s] from the first touch to the last release of the main impact; 0 without contact.

    Successive contacts belong to one impact if the flight between them is shorter than the impact
    up to then; the main impact is the one with the largest impulse.

    Parameters
    ----------
    contacts : (start [s], end [s], impulse [N s]) of each contact, in order; one that goes on at
        the end of the run counts up to there.
    """
    found = np.array([(a, b, 0.0, each, 0.0, 0, 0) for a, b, each in contacts], march.TOUCH)
    return float(march.library.aom_main_impact(found.size, march.address(found)))
