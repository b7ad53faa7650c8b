"""Cells at a site that are too large for the waves of a contact.

A contact of the time T sends out waves of the frequency π/T. Bending waves have the length
2π √(c r/ω), c the speed in a bar and r the radius of gyration, others 2π c/ω (L. Cremer,
M. Heckl, *Structure-Borne Sound*, 1988). On an aluminium sheet of 1 mm (triangles of second degree,
patch of 1 mm, 10 g) triangles with sides of 0.2, 0.3, 0.5 and 1 wave length, their longest edge 1.4
times that, changed the peak force by 0.5 to 2, 1 to 4, 6 to 47 and 6 to 100 %.
"""

from __future__ import annotations

from math import inf, pi, sqrt
from typing import NamedTuple

from antiosc.base.texts import engineering
from antiosc.models.body import info_of

#: A warning is given if the longest edge of a cell over the wavelength exceeds this.
LARGE_CELL = 0.5


class Coarse(NamedTuple):
    """A cell at a site [m], the wavelength to be resolved, and the edge length that suffices."""

    size: float
    wave: float

    @property
    def allowed(self) -> float:
        """Recommended edge length [m], half of the largest without a warning."""
        return LARGE_CELL * self.wave / 2


def coarse_at(model: object, site: str, contact_time: float) -> Coarse | None:
    """The cell at a site if it does not resolve the waves of a contact; otherwise None."""
    known = (info_of(model).cells or {}).get(site)
    if known is None or getattr(model, "strain_error", None) is not None:  # its budget tells it
        return None
    size, bending, speed = known
    omega = pi / contact_time
    wave = min(2 * pi * sqrt(bending / omega) if bending else inf, 2 * pi * speed / omega)
    if size > LARGE_CELL * wave:
        return Coarse(size, wave)
    return None


def coarse_cell(model: object, site: str, contact_time: float) -> str:
    """Warning of a cell too large for the waves of a contact; "" if it is not."""
    cell = coarse_at(model, site, contact_time)
    if cell is None:
        return ""
    at = f" {site!r}" if site else ""
    return (
        f"The cell at the site{at} measures {engineering(cell.size, 'm')}, and the wave that a"
        f" contact of {engineering(contact_time, 's')} sends out {engineering(cell.wave, 'm')}:"
        " forces come out too large; take cells of at most"
        f" {engineering(cell.allowed, 'm')} there (refine=), or extract(…, error="
        '"estimate"), which tells the error.'
    )
