"""Sites whose patch does not have the half-space compliance that is assumed for it."""

from __future__ import annotations

from collections.abc import Iterator
from typing import TypeAlias

import numpy as np

from antiosc.base._types import Array, BoolArray
from antiosc.base.errors import AccuracyWarning
from antiosc.base.texts import SMALLER_CELLS, engineering, percent, rounded_down, rounded_up
from antiosc.fem.mesh.closest import closest, size_at
from antiosc.fem.mesh.surface import SurfaceAtSites
from antiosc.fem.platform import warn
from antiosc.fem.structure.meshed import MeshedStructure
from antiosc.models.doubts import CUT, NEAR
from antiosc.reduce.site.sites import ON_SHEET, Sites

#: A patch counts as whole if at least this share of its load is on the face, free of supports.
WHOLE_PATCH = 0.9
#: Supports nearer than this many radii of a patch hold the surface about it: on a half-space
#: the displacement at this distance is 0.22 times that in the middle of the patch.
NEAR_RADII = 2.0
#: Rounding of the sizes of faces, which resolve a patch if they do not exceed its radius.
SIZE_ROUNDING = 1e-6
#: An impact is along the surface if its cosine with the normal is below this.
ALONG_SURFACE = 0.1

#: Mask (P,) of sites, and what is told of them.
Doubt: TypeAlias = tuple[BoolArray, str]


def warn_of_doubts(structure: MeshedStructure, sites: Sites, marked: bool = False) -> None:
    """Warn, on rank 0, of sites with an uncertain compliance.

    `marked`: a map marks and counts those of `doubtful_patches`; they are not told here.
    """
    doubts = list(_mesh_doubts(structure, sites))
    if not marked:
        cut = _cut(sites)
        free = percent(np.minimum(sites.share, sites.moving)[cut].min(initial=1.0))
        text = (
            f"an edge cuts the patch, or supports hold it: only {free} of its load area is free, so"
            " its half-space compliance does not hold; move the site or take a smaller radius."
        )
        doubts.append((cut, text))
    for which, text in doubts:
        if which.any():
            count = f" (At {which.sum()} of {len(sites)} sites.)" if len(sites) > 1 else ""
            warn(structure.comm, text + count, AccuracyWarning)


def doubtful_patches(sites: Sites) -> dict[str, BoolArray]:
    """Reason -> mask (P,) of the sites whose patch does not have the half-space compliance."""
    near = np.zeros(len(sites), dtype=bool)
    if sites.clear is not None:
        near = np.asarray((sites.clear < NEAR_RADII * sites.radii) & (sites.local > 0))
    return {CUT: _cut(sites), NEAR: near}


def surface_below(
    structure: MeshedStructure, points: Array, directions: Array, radii: Array
) -> SurfaceAtSites:
    """The surface of a solid at points (P, 3); `radii` (P,) of patches, NaN of points."""
    reach = np.where(np.isfinite(radii), radii, ON_SHEET * structure.mesh.extent())
    labels = np.zeros(len(structure.faces), dtype=int)
    return structure.faces.contact(points, directions, reach, labels)


def _mesh_doubts(structure: MeshedStructure, sites: Sites) -> Iterator[Doubt]:
    """The sites whose radius does not suit the mesh."""
    without_radius = np.isnan(sites.radii)
    if not structure.kind.point_load and without_radius.any():
        x = sites.points[np.argmax(without_radius)]
        size = size_at(structure.mesh, closest(structure.mesh, x))
        yield (
            without_radius,
            "the compliance under a point load on a solid grows without limit as the mesh is"
            f" refined: give a radius of {engineering(rounded_up(size), 'm', 2)} or more, the size"
            " of the element there.",
        )

    # patches that are smaller than the facets under them
    is_coarse = np.asarray(sites.size > (1 + SIZE_ROUNDING) * sites.radii)
    if not (structure.kind.outside and is_coarse.any()):
        return

    i = int(np.argmax(np.where(is_coarse, sites.size / sites.radii, 0.0)))
    size, radius = float(sites.size[i]), float(sites.radii[i])
    # where an edge cuts the patch, its radius must not be larger
    larger_radius = f", or a radius of {engineering(rounded_up(size), 'm', 2)}"
    yield (
        is_coarse,
        f"the facets at the site measure {engineering(size, 'm', 3)}, more than the radius"
        f" {engineering(radius, 'm', 3)}: the patch is not resolved; take cells of at most"
        f" {engineering(rounded_down(radius), 'm', 2)} there ({SMALLER_CELLS})"
        f"{'' if _cut(sites).any() else larger_radius}.",
    )


def _cut(sites: Sites) -> BoolArray:
    """Mask of the patches that an edge cuts, or supports hold."""
    held = (sites.moving < WHOLE_PATCH) & (sites.local > 0)
    return np.asarray((sites.share < WHOLE_PATCH) | held)
