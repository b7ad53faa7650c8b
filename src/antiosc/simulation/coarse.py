"""Cells at a site that are too large for the waves of a contact.

A contact of the time T sends out waves of the frequency π/T. Bending waves have the length
2π √(c r/ω), c the speed in a bar and r the radius of gyration, others 2π c/ω (L. Cremer,
M. Heckl, *Structure-Borne Sound*, 1988). On an aluminium sheet of 1 mm (triangles of second degree,
patch of 1 mm, 10 g) triangles with sides of 0.2, 0.3, 0.5 and 1 wave length, their longest edge 1.4
times that, changed the peak force by 0.5 to 2, 1 to 4, 6 to 47 and 6 to 100 %.
"""

from __future__ import annotations

from math import inf, pi, sqrt

from antiosc.base.texts import engineering
from antiosc.models.body import info_of

#: Longest edge of a cell over the wave length from which it is told.
LARGE_CELL = 0.5


def coarse_cell(model: object, site: str, contact_time: float) -> str:
    """The warning of a cell at a site that a contact's waves do not fit in; "" of others."""
    known = (info_of(model).cells or {}).get(site)
    if known is None or getattr(model, "strain_error", None) is not None:  # its budget tells it
        return ""
    size, bending, speed = known
    omega = pi / contact_time
    wave = min(2 * pi * sqrt(bending / omega) if bending else inf, 2 * pi * speed / omega)
    if not size > LARGE_CELL * wave:
        return ""
    at = f" {site!r}" if site else ""
    return (
        f"The cell at the site{at} measures {engineering(size, 'm')}, and the wave that a contact"
        f" of {engineering(contact_time, 's')} sends out {engineering(wave, 'm')}: forces come out"
        f" too large; take cells of at most {engineering(LARGE_CELL * wave / 2, 'm')} there"
        ' (refine=), or extract(…, error="estimate"), which tells the error.'
    )
