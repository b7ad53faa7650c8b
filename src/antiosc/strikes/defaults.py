"""Default values of numbers that a user may leave out, shared by programs, scenes and pages.

The cell size of a geometry is `default_size` of `antiosc.fem.mesh.reading`. The patch of a solid is
the smallest that its facets resolve and that carries the striker's force on a rigid wall, the
largest possible one. The duration is doubled until striker and part have separated.
"""

from __future__ import annotations

from dataclasses import replace
from math import floor, log2
from typing import TYPE_CHECKING

from antiosc.base.errors import AntioscError, without_warnings
from antiosc.base.texts import rounded_up
from antiosc.fem.structure.structure import with_parts
from antiosc.impact.bodies import Obstacle
from antiosc.impact.scene import simulate
from antiosc.impact.truncation import truncation_error
from antiosc.impact.two_bodies import BAND_TIME_PRODUCT, impact_band
from antiosc.models.body import AUTO, AnyLaw, LinearBody, law_of
from antiosc.reduce.site import functional
from antiosc.reduce.site.map_sites import resolved_radius
from antiosc.reduce.site.surface import StruckStructure, surface_at

if TYPE_CHECKING:
    from antiosc.fem.structure.structure import Structure
    from antiosc.impact.histories import History
    from antiosc.reduce.site.site import Functional, Site

#: Cells across the thickness under a site, none of them longer than the ball's radius.
CELLS_THROUGH_THICKNESS = 3
#: Radius of the ball over the longest side of the part.
BALL_RADIUS_SHARE = 0.02
#: Numbers of anti-oscillators. A printed bar of 13.6 × 5 × 100 mm: 40 % with 20, 0.05 % with 80. A
#: sheet of 85 572 dofs under a ball of 20 mm: 1205, 521, 416 and 407 N with 20, 150, 400 and 800.
OSCILLATOR_COUNTS = (20, 60, 150, 400)
MAX_TRUNCATION_ERROR = 0.1
#: Largest product of dofs and anti-oscillators: 3.4e7 took 85 s for this sheet, beside other work.
MAX_DOFS_TIMES_COUNT = 8e7
#: Expansion points are at this share of the inverse of the contact time, or down to half of it. Of
#: 1 mm of aluminium under a ball for 41 µs the force was 120 and 36 % off with 60 and 150
#: anti-oscillators about the static point, 2.5 and 0.2 % with a share of 0.67.
EXPANSION_SHARE = 0.7
#: Duration of the run on a rigid wall over the contact time.
WALL_DURATION_RATIO = 4.0


def default_cell_size(length: float, thickness: float) -> float:
    """Cell size [m] at the site of a solid of this length [m] and local thickness [m]."""
    return rounded_up(min(BALL_RADIUS_SHARE * length, thickness / CELLS_THROUGH_THICKNESS))


def default_ball_radius(length: float) -> float:
    """Default radius [m] of a ball that strikes a part whose longest side is `length` [m]."""
    return float(f"{BALL_RADIUS_SHARE * length:.1g}")


def patch_radius(
    structure: Structure, site: Site, striker: LinearBody, contact: AnyLaw = AUTO
) -> float | None:
    """Radius [m] of the patch of a solid at a site; None if no patch is known there."""
    try:
        resolved = resolved_radius(with_parts(structure), site)
        if resolved is None:
            return None
        load = functional(structure, replace(site, radius=resolved))
    except AntioscError:
        return None

    try:
        with without_warnings():
            needed = _carrying_radius(structure, load, resolved, striker, contact)
    except AntioscError:  # no striker that flies, or a surface that is not known
        needed = None

    assert load.place is not None
    largest = load.place.member.part.mesh.extent()
    return min(rounded_up(max(resolved, needed or 0.0)), largest)


def _carrying_radius(
    structure: Structure, load: Functional, radius: float, striker: LinearBody, contact: AnyLaw
) -> float | None:
    """Radius [m] of a patch that carries the force of the striker on a rigid wall."""
    face = StruckStructure(structure, surface_at(structure, load.point, load.direction, radius))
    law = law_of(contact, face, striker)

    pulse = BAND_TIME_PRODUCT / (2 * impact_band(striker, law))
    wall = simulate(Obstacle(), striker, law, duration=WALL_DURATION_RATIO * pulse)
    return law.without(load.local_compliance).enough_radius(wall.peak_force, radius)


def next_count(hit: History) -> int | None:
    """The next larger number of anti-oscillators; None if it is not needed or too expensive."""
    model = hit.model
    if hit.rerun is None or truncation_error(model, hit.rerun).peak_force <= MAX_TRUNCATION_ERROR:
        return None

    dofs = model.info.dofs or 0
    return next(
        (n for n in OSCILLATOR_COUNTS if n > model.n and n * dofs <= MAX_DOFS_TIMES_COUNT), None
    )


def expansion_frequency(hit: History) -> float:
    """Expansion point [Hz] for more anti-oscillators: a power of two below 1/contact time."""
    return float(2.0 ** floor(log2(EXPANSION_SHARE / hit.assembly.contact_time_estimate)))
