"""Sites whose patch does not have the half-space compliance that is assumed for it."""

from __future__ import annotations

from collections.abc import Iterator
from math import acos, degrees
from typing import NamedTuple

import numpy as np

from antiosc.base._types import Array, BoolArray
from antiosc.base.errors import AccuracyWarning
from antiosc.base.texts import SMALLER_CELLS, engineering, percent, rounded_down, rounded_up
from antiosc.fem.mesh.closest import closest, size_at
from antiosc.fem.mesh.surface import SurfaceAtSites
from antiosc.fem.platform import warn
from antiosc.fem.structure.meshed import MeshedStructure
from antiosc.models.doubts import CUT, NEAR, SUPPORTED
from antiosc.reduce.site.sites import ON_SHEET, Sites

#: A patch counts as whole if at least this share of its load is on the face,
WHOLE_PATCH = 0.9
#: and as partly supported if supports carry more than this share.
PARTLY = 0.1
#: Supports nearer than this many radii of a patch hold the surface about it: on a half-space
#: the displacement at this distance is 0.22 times that in the middle of the patch.
NEAR_RADII = 2.0
#: Rounding of the sizes of faces, which resolve a patch if they do not exceed its radius.
SIZE_ROUNDING = 1e-6
#: Largest cell of a sheet over the patch radius, at which the compliance is up to 3 % too low.
COARSE_SHEET = 8.0
#: Size of the cells over the thickness above which bending hides this error.
THIN = 4.0
#: An impact is along the surface if its cosine with the normal is below this.
ALONG_SURFACE = 0.1


class Doubt(NamedTuple):
    """A reason for which patches are doubtful.

    Attributes
    ----------
    which : (P,) mask of the sites.
    alone : the message if there is one site.
    among : the message for several sites, with "{}" in place of their number.
    """

    which: BoolArray
    alone: str
    among: str


def warn_of_doubts(
    structure: MeshedStructure, sites: Sites, marked: bool = False, fitted: bool = False
) -> None:
    """Warn, on rank 0, of sites with an uncertain compliance.

    `marked`: a map marks and counts those of `doubtful_patches`; they are not told here.
    `fitted`: the radii are those that the facets at the sites resolve.
    """
    if fitted:
        return
    told = _mesh_doubts(structure, sites) if marked else _doubts(structure, sites)
    doubts = [doubt for doubt in told if doubt.which.any()]
    if not doubts:
        return
    count = len(sites.points)
    if count == 1:
        for doubt in doubts:
            warn(structure.comm, doubt.alone, AccuracyWarning)
        return
    number = int(np.any([doubt.which for doubt in doubts], axis=0).sum())
    reasons = "; ".join(doubt.among.format(int(doubt.which.sum())) for doubt in doubts)
    message = f"look at the patch at {number} of {count} sites: {reasons}."
    warn(structure.comm, message, AccuracyWarning)


def doubtful_patches(sites: Sites) -> dict[str, BoolArray]:
    """Reason -> mask (P,) of the sites whose patch does not have the half-space compliance."""
    near = np.zeros(len(sites), dtype=bool)
    if sites.clear is not None:
        near = np.asarray((sites.clear < NEAR_RADII * sites.radii) & (sites.local > 0))
    return {CUT: _cut(sites), SUPPORTED: _supported(sites), NEAR: near}


def _doubts(structure: MeshedStructure, sites: Sites) -> Iterator[Doubt]:
    """The reasons for doubts, with the sites of each."""
    yield from _mesh_doubts(structure, sites)
    yield from _patch_doubts(sites)


def _mesh_doubts(structure: MeshedStructure, sites: Sites) -> Iterator[Doubt]:
    """The sites whose radius or direction does not suit the mesh."""
    if not structure.kind.point_load:
        yield _points_on_solids(structure, sites)
    yield _coarse(structure, sites)
    contact = sites.contact
    if contact is None and structure.kind.outside:
        contact = surface_below(structure, sites.points, sites.directions, sites.radii)
    if contact is not None and structure.mesh.gdim == 3:  # plane parts: loaded in shear, too
        yield _along_surface(sites, contact.normals, contact.depth)


def surface_below(
    structure: MeshedStructure, points: Array, directions: Array, radii: Array
) -> SurfaceAtSites:
    """The surface of a solid at points (P, 3); `radii` (P,) of patches, NaN of points."""
    reach = np.where(np.isfinite(radii), radii, ON_SHEET * structure.mesh.extent())
    labels = np.zeros(len(structure.faces), dtype=int)
    return structure.faces.contact(points, directions, reach, labels)


def _patch_doubts(sites: Sites) -> Iterator[Doubt]:
    """The sites of `doubtful_patches`."""
    is_cut = _cut(sites)
    share = percent(sites.share[is_cut].min(initial=1.0))
    yield Doubt(
        is_cut,
        f"an edge cuts the patch: only {share} of its load area lies on the face, so its "
        "half-space compliance does not hold; move the site or take a smaller radius.",
        f"an edge cuts it at {{}}, down to {share} of its load area (a smaller radius helps)",
    )
    supported = _supported(sites)
    share = percent(1 - sites.moving[supported].min(initial=1.0))
    yield Doubt(
        supported,
        f"supports fix {share} of the patch: its half-space compliance does not hold there; move "
        "the site or take a smaller radius.",
        f"supports fix up to {share} of it at {{}}",
    )


def _points_on_solids(structure: MeshedStructure, sites: Sites) -> Doubt:
    """The sites on a solid that have no radius."""
    without_radius = np.isnan(sites.radii)
    if not without_radius.any():
        return Doubt(without_radius, "", "")
    size = size_at(structure.mesh, closest(structure.mesh, sites.points[np.argmax(without_radius)]))
    here, there = (engineering(value, "m", 2) for value in (rounded_up(size), size))
    remedy = f"{here} (the element there measures {there}"
    reason = "the compliance under a point load on a solid grows without limit as the mesh is"
    return Doubt(
        without_radius,
        f"{reason} refined: give the site a radius, here for instance {remedy}; its radius should "
        "not be smaller).",
        f"{reason} refined, at {{}}: give a radius, for instance {remedy})",
    )


def _coarse(structure: MeshedStructure, sites: Sites) -> Doubt:
    """The sites whose patch is smaller than the facets or cells under it."""
    kind = structure.kind
    times = 1.0 if kind.outside else COARSE_SHEET
    is_coarse = np.asarray(sites.size > (1 + SIZE_ROUNDING) * times * sites.radii)
    if kind.sheet and sites.contact is not None:
        default_radii = [material.patch_radius for material, _ in structure.parts]
        thickness = np.array(default_radii, dtype=float)
        is_coarse &= sites.size < THIN * thickness[sites.contact.label]
    i = int(np.argmax(np.where(is_coarse, sites.size / sites.radii, 0.0)))
    size, radius = sites.size[i], sites.radii[i]
    entities, rule = ("facets", "") if kind.outside else ("cells", f"{times:g} times ")
    if not is_coarse.any():
        return Doubt(is_coarse, "", "")
    larger = "measure {}, more than {}the radius {}".format(*_told_apart(size, rule, radius, times))
    # where an edge cuts the patch, its radius must not be larger
    enough = engineering(rounded_up(size / times), "m", 2)
    remedy = "" if _cut(sites).any() else f", or a radius of {enough}"
    return Doubt(
        is_coarse,
        f"the {entities} at the site {larger}: the patch is not resolved; take cells of at most "
        f"{engineering(rounded_down(times * radius), 'm', 2)} there ({SMALLER_CELLS}){remedy}.",
        f"the {entities} at {{}} {larger} (smaller cells help: {SMALLER_CELLS}{remedy})",
    )


def _told_apart(size: float, rule: str, radius: float, times: float) -> tuple[str, str, str]:
    """A size [m], a rule, and the smaller radius [m] over `times`, with digits that tell it."""
    for digits in (2, 3, 4, 5):
        if float(f"{size:.{digits}g}") > times * float(f"{radius:.{digits}g}"):
            break
    return engineering(size, "m", digits), rule, engineering(radius, "m", digits)


def _along_surface(sites: Sites, normals: Array, depth: Array) -> Doubt:
    """The sites struck along the surface; `normals` (P, 3) and `depth` (P,) are of the contact."""
    cosines = np.abs(np.einsum("pd,pd->p", sites.directions, normals))
    is_tangential = np.asarray(np.isfinite(depth) & (cosines < ALONG_SURFACE))
    i = int(np.argmax(is_tangential))
    angle = f"{90 - degrees(acos(min(cosines[i], 1.0))):.2g}°"
    normal = ", ".join(f"{c:.3g}" for c in normals[i].round(9) + 0.0)
    return Doubt(
        is_tangential,
        f"the direction of the site lies along the surface, {angle} from it: an impactor slides "
        "there and does not strike; give the direction in which it flies, against the normal "
        f"({normal}).",
        f"the direction at {{}} lies along the surface, {angle} from it, where an impactor slides",
    )


def _cut(sites: Sites) -> BoolArray:
    """Mask of the patches that are cut by an edge."""
    return np.asarray(sites.share < WHOLE_PATCH)


def _supported(sites: Sites) -> BoolArray:
    """Mask of the patches that supports fix partly."""
    return np.asarray((1 - sites.moving > PARTLY) & (sites.local > 0))
