"""The sites of a map, with the structure's free modes."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import TypeAlias

import numpy as np

from antiosc.base._types import Array
from antiosc.base.checks import whole
from antiosc.base.progress import doing
from antiosc.fem.linalg.deflections import deflections
from antiosc.fem.structure.meshed import PartsMatrices
from antiosc.fem.structure.structure import Structure
from antiosc.reduce.extraction.eigenmodes import Modes, ModeSolver
from antiosc.reduce.site.map_sites import MapSites, sites_of

#: Number of free modes if neither `modes` nor a band is given.
DEFAULT_FREE_MODES = 20
#: Frequency of the last free mode over the band.
BAND_FACTOR = 1.5

#: What names the sites of a map: surfaces, or points (P, 2 or 3).
SiteSelection: TypeAlias = str | Sequence[str] | Sequence[Sequence[float]] | None


@dataclass(frozen=True, eq=False)
class FreeSites:
    """P sites and J free modes of the structure, rigid-body modes first."""

    map_sites: MapSites  # the sites, with their points and directions
    #: omega, phi: (J,) [rad/s], shapes (rows of this rank, J) of unit modal mass
    omega: Array
    phi: Array
    b: Array  # (P, J) displacement of each site in each mode [kg^-1/2]
    #: compliance b'y [m/N] and inertia y'My (P,) of the deflection y = (K + shift M)^-1 b
    compliance: Array
    inertia: Array


def free_sites(
    structure: Structure,
    matrices: PartsMatrices,
    where: SiteSelection,
    direction: Sequence[float] | None,
    radius: float | None,
    modes: int | None,
    band: float | None,
    most: float = math.inf,
    most_sites: int | None = None,
) -> FreeSites:
    """`FreeSites` with at most `most` elastic modes; `band` [rad/s], the rest as `impact_map`."""
    with doing("finding the sites of the map"):
        map_sites = sites_of(matrices, where, direction, radius, most_sites)

    structure.factorize(math.inf)
    count = len(map_sites.sites)
    with doing(f"free modes for {count} sites"):
        free = _lowest_free_modes(structure, modes, band, most)

    omega = np.concatenate([np.zeros(structure.rigid_modes.shape[1]), free.omega])
    phi = np.column_stack([structure.rigid_modes, free.phi])
    b = structure.comm.allreduce(map_sites.sites.loads.T @ phi)
    with doing(f"compliances at {count} sites"):
        C, G = deflections(structure, map_sites.sites.loads, omega, b)
    return FreeSites(map_sites, omega, phi, b, C, G)


def _lowest_free_modes(
    structure: Structure, count: int | None, band: float | None, most: float
) -> Modes:
    """The lowest `count` elastic modes, or as many (at most `most`) as cover the band."""
    most = min(most, structure.dofs)
    mode_count = min(
        DEFAULT_FREE_MODES if count is None else whole("modes", count), structure.dofs - 1
    )
    reach = 0.0 if band is None or count is not None else BAND_FACTOR * band
    modes = ModeSolver(structure).lowest(
        mode_count, lambda m: m.omega.max(initial=0.0) >= reach, most
    )
    sufficient = max(mode_count, int(np.sum(modes.omega < reach)) + 1)
    sufficient = int(min(sufficient, most, len(modes.omega)))
    return Modes(modes.omega[:sufficient], modes.phi[:, :sufficient], modes.complete)
