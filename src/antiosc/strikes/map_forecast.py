"""How many sites a map has and how long it takes, before it is computed.

A few sites are found, and one solve is made if the structure is factored, so that the times are
those of this machine, busy as it is.
"""

from __future__ import annotations

import time
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from antiosc.base.errors import without_warnings
from antiosc.base.progress import doing, range_text
from antiosc.fem.assembly import with_parts
from antiosc.fem.linalg.forecast import EACH_DOF, EACH_STEP
from antiosc.fem.structure.structure import Structure
from antiosc.reduce.extraction.eigenmodes import solves_of_search
from antiosc.reduce.site.map_sites import FACETS, Radius, Resolved, number_of_sites, sites_of
from antiosc.strikes.free_sites import FREE_MODES, Where

#: Sites whose search is timed.
TIMED = 20
#: Most free modes, and the seconds that are told over those of the parts of a map.
MOST_MODES = 100
SPREAD = (0.7, 1.6)
#: Seconds of a mode search over those of its solves: 1.2 for 24 modes of 66 921 dofs, 1.5 for 100.
SEARCH = 1.4
#: Solves that are timed.
TIMED_SOLVES = 4
#: Seconds that all compliances take over those of the factor: 1.3 on a block of 23 037 dofs, 1.7
#: and 2.2 on a printed part of 122 025; and seconds of a site for its model, law and impact.
FACTORS, EACH_SITE = 1.8, 4e-3


class MapForecast(NamedTuple):
    """Number of sites of a map, and its least and its largest seconds: `fixed`, and for `each`."""

    sites: int
    fixed: Sequence[float]
    each: Sequence[float]

    @property
    def ends(self) -> list[float]:
        """Least and largest seconds of the map."""
        return [
            fixed + self.sites * each for fixed, each in zip(self.fixed, self.each, strict=True)
        ]

    def text(self) -> str:
        """The numbers in words."""
        return f"{self.sites} sites, about {range_text(self.ends)}"


def foreseen_map(
    structure: Structure,
    where: Where,
    direction: Sequence[float] | None,
    radius: Radius,
    most_sites: int | None = None,
    modes: int | None = None,
) -> MapForecast:
    """Forecast of a map of impacts; the arguments are those of `impact_map`.

    InputError as by `impact_map` where there are no sites.
    """
    matrices = with_parts(structure)
    radius = Resolved() if radius == FACETS else radius
    started = time.perf_counter()
    with doing("counting the sites of the map", structure.comm.rank), without_warnings():
        count = number_of_sites(matrices, where, radius, most_sites)
        counted = time.perf_counter()
        found = sites_of(matrices, where, direction, radius, TIMED)
        located = time.perf_counter()
    begins = counted - started
    site = max(located - counted - begins, 0.0) / max(len(found.sites), 1)
    factor, solve = _solver_seconds(structure)
    known = "factorization" in structure.seconds
    begins += (FACTORS + (not known)) * factor
    least, most = (FREE_MODES, MOST_MODES) if modes is None else (modes, modes)
    searches = [SEARCH * solve * solves_of_search(number) for number in (least, most)]
    each = site + EACH_SITE
    return MapForecast(
        count,
        [share * (begins + search) for share, search in zip(SPREAD, searches, strict=True)],
        [share * each for share in SPREAD],
    )


def _solver_seconds(structure: Structure) -> tuple[float, float]:
    """Seconds of a factor and of a solve."""
    if "factorization" not in structure.seconds:
        return EACH_DOF * structure.dofs, EACH_STEP * structure.dofs
    solver = structure.factorize()
    load = np.ones(structure.rows)
    started = time.perf_counter()
    for _ in range(TIMED_SOLVES):
        solver.solve(load)
    solve = (time.perf_counter() - started) / TIMED_SOLVES
    return structure.seconds["factorization"], solve
