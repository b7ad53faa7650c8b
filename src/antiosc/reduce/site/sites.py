"""Sites as arrays: their patches on the mesh, and their loads b as sparse columns.

A load is a set of weighted points: one point, or the quadrature points of Hertz's pressure
√(1 − r²/a²). They lie on a disc in the tangent plane (at the edge of a plane part on a segment) and
are projected along the normal onto the surface. All functions take arrays of P sites.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from typing import Any, TypeAlias

import numpy as np
import scipy.sparse

from antiosc.base._types import Array, BoolArray, IntArray
from antiosc.base.errors import AccuracyWarning, InputError
from antiosc.base.progress import counting
from antiosc.base.texts import CELL_ARGUMENTS, engineering, percent, rounded_down, rounded_up
from antiosc.fem.mesh.surface import (
    ClosestPoints,
    Faces,
    SurfaceAtSites,
    closest,
    closest_many,
    size_at,
)
from antiosc.fem.platform import warn
from antiosc.fem.structure.loads import Points, loads
from antiosc.fem.structure.meshed import SURFACE_TOLERANCE, MeshedStructure
from antiosc.models.body import CUT_PATCH, NEAR_SUPPORT

#: Rings of a disc's quadrature beyond those that cells require: fewer load cells by single forces.
EXTRA_RINGS = 4
#: Most rings, by the dimension of the faces.
MOST_RINGS = {1: 500, 2: 60}
#: The same for the sites of a map: 60 rings took 98 s of 115 s of one of 256 sites.
MOST_RINGS_OF_MAP = {1: 500, 2: 16}
#: A surface is flat if it rises by less than this share of the radius.
FLAT_RISE = 1e-6
#: A patch may rise by this share of its radius.
MOST_RISE = 0.5
#: Points of patches processed at once: 132 000 had 32 million pairs with faces, in 5.8 GB.
POINTS_AT_ONCE = 20_000


def disc_rule(rings: int) -> tuple[Array, Array]:
    """Points (n, 2) in the unit disc and weights (sum 1) for Hertz's pressure √(1 − r²): Gauss rule
    in s = √(1 − r²), where s r dr = s² ds, times equidistant angles."""
    s, w = np.polynomial.legendre.leggauss(rings)
    s, w = (s + 1) / 2, w * ((s + 1) / 2) ** 2
    angles = np.pi * (np.arange(2 * rings) + 0.5) / rings  # none along an edge of the face
    ring = np.column_stack([np.cos(angles), np.sin(angles)])
    points = np.sqrt(1 - s**2)[:, None, None] * ring
    return points.reshape(-1, 2), np.repeat(w / w.sum(), len(angles)) / len(angles)


def segment_rule(count: int) -> tuple[Array, Array]:
    """Gauss–Chebyshev quadrature for √(1 − x²): (points (n, 1) of [−1, 1], weights with sum 1)."""
    angles = np.pi * np.arange(1, count + 1) / (count + 1)
    weights = np.sin(angles) ** 2
    return np.cos(angles)[:, None], weights / weights.sum()


def patch_points(
    faces: Faces,
    points: Array,
    radii: Array,
    contact: SurfaceAtSites,
    most_rings: dict[int, int] = MOST_RINGS,
) -> tuple[Points, Array]:
    """(quadrature points of all patches on this rank, share (P,) of each patch on a face)."""
    size = np.where(np.isfinite(contact.smallest), contact.smallest, radii)
    rings = np.minimum(EXTRA_RINGS + np.ceil(4 * radii / size - 1e-6), most_rings[faces.dim])
    rings = rings.astype(int)
    flat = contact.rise <= FLAT_RISE * radii  # then few faces come into question for a point

    # one large patch would have the small ones projected as far as itself
    octave = np.frexp(radii)[1]
    groups, group = np.unique(np.column_stack([rings, flat, octave]), axis=0, return_inverse=True)
    share = np.zeros(len(points))
    point_sets = []
    done = 0

    with counting("patches of the sites", len(points)) as ready:
        for number, (count, is_flat, _) in enumerate(groups.tolist()):
            rule, weights = disc_rule(count) if faces.dim == 2 else segment_rule(4 * count)
            members = np.flatnonzero(group.ravel() == number)
            rise = FLAT_RISE if is_flat else MOST_RISE
            for part in np.array_split(members, 1 + len(members) * len(rule) // POINTS_AT_ONCE):
                on_faces, share[part] = _rule_on_faces(
                    faces, points, radii, contact.normals, part, rule, weights, rise
                )
                point_sets.append(on_faces)
                done += len(part)
                ready(done)

    return Points.joined(point_sets), share


def _rule_on_faces(
    faces: Faces,
    points: Array,
    radii: Array,
    normals: Array,
    part: IntArray,
    rule: Array,
    weights: Array,
    rise: float,
) -> tuple[Points, Array]:
    """(quadrature points, share of each patch on a face) of the sites `part`, by one `rule`."""
    comm = faces.mesh.comm
    normal = normals[part]

    # between axes that are equally oblique rounding must not decide how the rule is oriented
    helper_axis = np.argmin(np.abs(normal).round(6), axis=1)
    first = np.cross(normal, np.eye(3)[helper_axis])
    if rule.shape[1] == 1:
        first = np.cross(normal, [0.0, 0.0, 1.0])
    size = np.linalg.norm(first, axis=1, keepdims=True)
    first = first / np.where(size > 0, size, 1.0)
    axes = np.stack([first, np.cross(normal, first)], axis=1)[:, : rule.shape[1]]
    x = points[part, None] + radii[part, None, None] * np.einsum("qk,pkd->pqd", rule, axes)
    count = len(weights)
    line = x.reshape(-1, 3), np.repeat(normal, count, axis=0), rise * float(radii[part].max())
    face, xi, distance = faces.along(*line)
    ranks = np.array(comm.allgather(distance))
    hit = np.isfinite(ranks).any(axis=0)
    share = (np.tile(weights, len(part)) * hit).reshape(len(part), count).sum(axis=1)
    owned_points = np.flatnonzero(hit & (ranks.argmin(axis=0) == comm.rank))
    site_index = owned_points // count
    weight = np.tile(weights, len(part))[owned_points] / share[site_index]
    reference = faces.reference(face[owned_points], xi[owned_points])
    return Points(part[site_index], faces.cells[face[owned_points]], reference, weight), share


@dataclass(frozen=True, eq=False)
class Sites:
    """Arrays of P sites and their load vectors; all but `loads` are equal on all ranks."""

    #: points, directions: (P, 3) coordinates [m] and unit directions of impact
    points: Array
    directions: Array
    #: b of all sites as columns (rows of this rank, P), zero on fixed dofs
    loads: scipy.sparse.csr_matrix
    radii: Array  # (P,) radii of the patches [m]; NaN for points
    local: Array  # (P,) half-space compliances of the patches [m/N]
    share: Array  # (P,) share of each patch that lies on its face; 1 for points
    #: depth, size: (P,) distance of the site from the surface, and size of the faces there [m]
    depth: Array
    size: Array
    moving: Array  # (P,) share of the load on free dofs
    #: the points at which each load acts; None for a selection of sites
    weighted: Points | None = None
    #: (P,) distances from the nearest supported node [m]; None except for the sites of a map
    clear: Array | None = None

    def __len__(self) -> int:
        return len(self.points)

    def taken(self, which: IntArray) -> Sites:
        """The sites with the numbers `which` (n,)."""
        rows: dict[str, Any] = {name: values[which] for name, values in self._arrays().items()}
        return Sites(loads=self.loads[:, which], **rows)

    @classmethod
    def joined(cls, several: Sequence[Sites]) -> Sites:
        """Several sets of sites joined into one."""
        arrays = [sites._arrays() for sites in several]
        columns: dict[str, Any] = {
            name: np.concatenate([each[name] for each in arrays]) for name in arrays[0]
        }
        return cls(loads=scipy.sparse.hstack([one.loads for one in several]).tocsr(), **columns)

    def _arrays(self) -> dict[str, Any]:
        """All arrays with a row for each site, by name."""
        rows = {k: v for k, v in vars(self).items() if k not in ("loads", "weighted")}
        return {name: values for name, values in rows.items() if values is not None}


def located_sites(
    structure: MeshedStructure,
    points: Array,
    directions: Array,
    radii: Array,
    nearest: ClosestPoints | None = None,
    most_rings: dict[int, int] = MOST_RINGS,
) -> Sites:
    """Sites at points (P, 3) with unit `directions` and `radii` (P,) [m]; NaN: default radius."""
    mesh = structure.mesh
    kind = structure.kind
    count = len(points)
    radii = np.array(radii, dtype=float)
    local = np.zeros(count)
    share = np.ones(count)
    depth = np.zeros(count)
    size = np.zeros(count)
    has_radius = np.isfinite(radii)
    if kind.point_load and has_radius.any():
        raise InputError("a radius applies to solids and shells: leave it out on beams.")

    point_sets = []
    own_radii = [material.patch_radius for material, _ in structure.parts]
    default_radii = np.array([np.nan if radius is None else radius for radius in own_radii])
    patch = np.isfinite(default_radii).all() | has_radius

    if patch.any():
        faces = structure.faces
        labels = structure.part_of_cells()[faces.cells]
        if not has_radius[patch].all():
            reach = np.full(count, SURFACE_TOLERANCE * mesh.extent())
            part = faces.contact(points, directions, reach, labels).label
            radii = np.where(has_radius, radii, default_radii[part])

        contact = faces.contact(points[patch], directions[patch], radii[patch], labels)
        on_patches, share[patch] = patch_points(
            faces, points[patch], radii[patch], contact, most_rings=most_rings
        )
        point_sets.append(replace(on_patches, site=np.flatnonzero(patch)[on_patches.site]))

        cosines = np.einsum("pd,pd->p", directions[patch], contact.normals)
        pairs = zip(contact.label, cosines, strict=True)
        half_space = [structure.parts[k][0].half_space_compliance(float(c)) for k, c in pairs]
        local[patch] = np.array(half_space) / radii[patch]
        depth[patch] = contact.depth
        size[patch] = contact.largest

        far_points = np.flatnonzero(np.isinf(depth))
        if len(far_points):  # how deep is told to the caller
            reaches = np.full(len(far_points), mesh.extent())
            deep = faces.contact(points[far_points], directions[far_points], reaches, labels)
            depth[far_points] = deep.depth

    if not patch.all():
        point_sets.append(_point_loads(structure, points, np.flatnonzero(~patch), nearest))

    weighted = Points.joined(point_sets)
    B = loads(structure.comm, structure.form, weighted, directions)
    weight = load_sums(structure, B)
    B = structure.joined(B).tocsr()
    free_share = load_sums(structure, B) / np.where(weight > 0, weight, 1.0)
    return Sites(points, directions, B, radii, local, share, depth, size, free_share, weighted)


def load_sums(structure: MeshedStructure, B: scipy.sparse.csr_matrix) -> Array:
    """Sum (P,) of the absolute entries of each load vector over all ranks."""
    return np.asarray(structure.comm.allreduce(np.asarray(abs(B).sum(axis=0)).ravel()))


def _point_loads(
    structure: MeshedStructure, points: Array, which: IntArray, nearest: ClosestPoints | None
) -> Points:
    """Point loads, in cells of this rank, at the points with the numbers `which`."""
    numbers: IntArray = which
    if nearest is None:
        nearest = closest_many(structure.mesh, points[which])
        numbers = np.arange(len(which))
    here = nearest.rank[numbers] == structure.comm.rank
    numbers = numbers[here]
    return Points(which[here], nearest.cell[numbers], nearest.X[numbers], np.ones(len(numbers)))


#: A patch counts as whole if at least this share of its load is on the face, free of supports.
WHOLE_PATCH_SHARE = 0.9
#: Radii within which supports hold a patch's surface: 0.22 of its displacement on a half-space.
NEAR_RADII = 2.0
#: Rounding of the sizes of faces, which resolve a patch if they do not exceed its radius.
SIZE_ROUNDING = 1e-6
#: An impact is along the surface if its cosine with the normal is below this.
SURFACE_COSINE = 0.1

#: Mask (P,) of sites, and the warning about them.
Doubt: TypeAlias = tuple[BoolArray, str]


def warn_of_doubts(structure: MeshedStructure, sites: Sites, marked: bool = False) -> None:
    """Warn of uncertain compliances; `marked`: a map marks cut patches, so do not warn of them."""
    doubts = list(_mesh_doubts(structure, sites))
    if not marked:
        cut = _is_cut(sites)
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
    """Masks (P,), by reason, of patches whose local compliance differs from a half-space's."""
    near = np.zeros(len(sites), dtype=bool)
    if sites.clear is not None:
        near = np.asarray((sites.clear < NEAR_RADII * sites.radii) & (sites.local > 0))
    return {CUT_PATCH: _is_cut(sites), NEAR_SUPPORT: near}


def _mesh_doubts(structure: MeshedStructure, sites: Sites) -> Iterator[Doubt]:
    """Yield (mask (P,), warning) for sites whose radius does not suit the mesh."""
    without_radius = np.isnan(sites.radii)
    if not structure.kind.point_load and without_radius.any():
        x = sites.points[np.argmax(without_radius)]
        size = size_at(structure.mesh, closest(structure.mesh, x))
        yield (
            without_radius,
            "the compliance under a point load on a solid grows without limit as the mesh is"
            " refined: give a site on a Solid a radius of"
            f" {engineering(rounded_up(size), 'm', 2)} or more, the size of the element there.",
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
        f" {engineering(rounded_down(radius), 'm', 2)} there ({CELL_ARGUMENTS})"
        f"{'' if _is_cut(sites).any() else larger_radius}.",
    )


def _is_cut(sites: Sites) -> BoolArray:
    """Mask (P,) of patches that an edge cuts or supports partly hold."""
    held = (sites.moving < WHOLE_PATCH_SHARE) & (sites.local > 0)
    return np.asarray((sites.share < WHOLE_PATCH_SHARE) | held)
