"""The sites of a map: the vertices of a surface, or given points, and their directions."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
import scipy.sparse
import scipy.sparse.linalg
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from antiosc.base._types import Array, BoolArray, IntArray
from antiosc.base.checks import coordinates, floats, positive
from antiosc.base.errors import InputError
from antiosc.fem.assembly.assembled import group_of
from antiosc.fem.mesh.surface import SurfaceAtSites
from antiosc.fem.structure import in_space
from antiosc.fem.structure.meshed import Member, MeshedStructure, PartsMatrices
from antiosc.fem.structure.place import places_at
from antiosc.reduce.site.at_points import STRUCTURE_TOLERANCE, places_of
from antiosc.reduce.site.site import LEAST_FREE_SHARE, Site
from antiosc.reduce.site.sites import MOST_RINGS_OF_MAP, Sites, located_sites, warn_of_doubts

#: Radius of a patch that facets resolve over their size.
RESOLVED_RATIO = 1.05
#: Distance over the size of the mesh within which facets touch a point.
TOUCH_DISTANCE = 1e-6
#: The supports fix a site if less than this share of its load is on free dofs.
LEAST_FREE_SHARE_ON_MAP = 0.05


@dataclass(frozen=True, eq=False)
class MapSites:
    """The sites of a map, and the triangles or segments that connect them."""

    sites: Sites  # the P sites that can move and have a surface
    #: (T, 3) triangles between the sites, or (T, 2) segments of lines; none for single points
    elements: IntArray
    count: int  # number of all requested sites
    names: NDArray[np.str_]  # (P,) name of the group or part of each site; "" for none
    dimension: int  # dimension of the cells

    def only(self, keep: BoolArray) -> MapSites:
        """The sites where the mask `keep` is true, and the elements between them."""
        whole = self.elements[keep[self.elements].all(axis=1)]
        elements = (np.cumsum(keep) - 1)[whole]
        return replace(self.taken(np.flatnonzero(keep)), elements=elements)

    def taken(self, which: IntArray) -> MapSites:
        """The sites with the numbers `which` (n,); `elements` is not renumbered."""
        return replace(self, sites=self.sites.taken(which), names=self.names[which])


def surface_names(where: object) -> Sequence[str] | None:
    """Names of surfaces in `where`; None for the whole structure (`where` None) or points."""
    if where is None or isinstance(where, str):
        return None if where is None else [where]
    where_list = where.tolist() if isinstance(where, np.ndarray) and where.ndim == 1 else where
    where_list = where_list if isinstance(where_list, list | tuple) else []
    names = [name for name in where_list if isinstance(name, str)]
    if not names:
        return None
    if len(names) < len(where_list):
        raise InputError(
            "where lists names and points; give names of groups and parts alone, or points alone."
        )

    repeated = [name for k, name in enumerate(names) if name in names[:k]]
    if repeated:
        raise InputError(f"where lists {repeated[0]!r} twice.")
    return names


def concatenated_sites(surfaces: Sequence[MapSites]) -> MapSites:
    """Sites of several surfaces joined; if one has triangles, segments of others are dropped."""
    if len(surfaces) == 1:
        return surfaces[0]
    corners = max(surface.elements.shape[1] for surface in surfaces)
    starts = np.cumsum([0, *(len(surface.sites) for surface in surfaces)])
    elements = [
        surface.elements + start
        for surface, start in zip(surfaces, starts[:-1], strict=True)
        if surface.elements.shape[1] == corners
    ]

    return MapSites(
        Sites.joined([surface.sites for surface in surfaces]),
        np.concatenate([np.zeros((0, corners), dtype=int), *elements]),
        sum(surface.count for surface in surfaces),
        np.concatenate([surface.names for surface in surfaces]),
        min(surface.dimension for surface in surfaces),
    )


@dataclass(frozen=True, eq=False)
class SurfaceSample:
    """Points of a surface and the elements between them; the same on all ranks."""

    points: Array  # (P, 3) coordinates [m]
    normals: Array  # (P, 3) unit normals out of the body; zero on sheets and lines
    #: (T, 3) triangles between the points, (T, 2) segments of lines; (0, 3) for none
    elements: IntArray


def sites_of(
    structure: PartsMatrices,
    where: object,
    direction: Sequence[float] | None,
    radius: float | None,
    most: int | None = None,
) -> MapSites:
    """Sites of a map on groups, parts, points or all surfaces, at most `most` on each."""
    names = surface_names(where)
    if where is not None and names is None:
        return _at_points(structure, where, direction, radius)
    places: list[tuple[Member, str | None, str]]
    if names is None:
        places = [(member, None, member.name) for member in structure.members()]
    else:
        places = [
            (*group_of(structure, name, "where"), name)
            if ":" in name or not structure.assembled
            else (structure.members(name)[0], None, name)
            for name in names
        ]

    surfaces = []
    for member, group, name in places:
        sample = farthest_points(surface_sample(member.part, group), most)
        on_part, is_movable = _on_part(structure, member, sample, direction, radius, name)
        on_part = on_part.only(is_movable)
        surfaces.append(on_part if names is None else checked_sites(on_part, name))

    return checked_sites(concatenated_sites(surfaces), None)


def checked_sites(sites: MapSites, where: object) -> MapSites:
    """Returns `sites`; InputError if it is empty."""
    if not len(sites.sites):
        place = f" on {where!r}" if isinstance(where, str) else ""
        raise InputError(f"no site of the map can move{place}: give another group.")

    return sites


def _at_points(
    structure: PartsMatrices, where: object, direction: Sequence[float] | None, radius: float | None
) -> MapSites:
    """Sites at given points, each on the part that a `Site` at the point would choose."""
    points = checked_points(where, direction)
    assert direction is not None  # checked_points has seen to that
    members = structure.members()
    found = places_at(members, points, np.tile(_in_space(direction), (len(points), 1)))
    size = float(np.linalg.norm(structure.dimensions)) if structure.assembled else None
    distance = np.array([place.nearest.distance for place in found])
    off_points = np.flatnonzero(
        distance > STRUCTURE_TOLERANCE * (size or members[0].part.mesh.extent())
    )
    if len(off_points):
        first = off_points[0]
        at_point = ", ".join(f"{c:.6g}" for c in points[first])
        raise InputError(
            f"{len(off_points)} of {len(points)} points lie off the structure, one at "
            f"({at_point}) m by {distance[first]:.3g} m: give points on it, or the name of a group."
        )

    of_parts = []
    order = []
    for member in members:
        of_part = np.flatnonzero([place.member.name == member.name for place in found])
        if len(of_part):
            x = np.array([found[k].point for k in of_part])
            sample = SurfaceSample(x, np.zeros_like(x), np.zeros((0, 3), dtype=int))
            on_part, is_movable = _on_part(
                structure, member, sample, direction, radius, member.name
            )
            of_parts.append(on_part.only(is_movable))
            order.append(of_part[is_movable])

    all_sites = checked_sites(concatenated_sites(of_parts), None)
    return all_sites.taken(np.argsort(np.concatenate(order)))


def _on_part(
    structure: PartsMatrices,
    member: Member,
    sample: SurfaceSample,
    direction: Sequence[float] | None,
    radius: float | None,
    name: str,
) -> tuple[MapSites, BoolArray]:
    """(sites at points of a part, in the assembly's axes; mask of the sites that can move)."""
    part = member.part
    if direction is None and not part.kind.outside:
        suffix = f" (the part {member.name!r})" if member.name else ""
        raise InputError(
            f"shells and beams have no outward normal{suffix}: give the direction, as (0, 0, -1)."
        )

    R = member.at.rotation
    count = len(sample.points)
    directions = -sample.normals
    if direction is not None:
        along = _in_space(direction) @ R
        directions = np.tile(along / np.linalg.norm(along), (count, 1))

    # those with a surface under them that can move in the part
    radii = np.full(count, np.nan if radius is None else positive("radius", radius, "m"))
    sites = located_sites(part, sample.points, directions, radii, most_rings=MOST_RINGS_OF_MAP)
    sites = replace(sites, clear=_from_supports(part, sample.points))
    on_face = np.isnan(sites.radii) | ((sites.share > 0) & (sites.depth <= sites.radii))
    is_movable = on_face & (sites.moving > LEAST_FREE_SHARE_ON_MAP)
    if is_movable.any():
        warn_of_doubts(part, sites.taken(np.flatnonzero(is_movable)), True)

    # those that can move in the assembly
    loads = structure.joined(sites.loads, member.rows).tocsr()
    if structure.assembled:
        size = scipy.sparse.linalg.norm(loads, axis=0)
        is_movable &= size > LEAST_FREE_SHARE * scipy.sparse.linalg.norm(sites.loads, axis=0)
    points, directions = member.at.placed(sites.points), sites.directions @ R.T
    sites = replace(sites, points=points, directions=directions, loads=loads)
    names = np.full(count, name)
    return MapSites(sites, sample.elements, count, names, part.mesh.tdim), is_movable


#: Distance between points with opposite normals over the size: both sides of a plate have sites.
OPPOSITE_DISTANCE = 0.5


def farthest_points(ground: SurfaceSample, most: int | None) -> SurfaceSample:
    """At most `most` points, chosen one by one as the farthest from the points chosen before."""
    if most is None or len(ground.points) <= most:
        return ground
    extent = float(np.ptp(ground.points, axis=0).max())
    places = np.hstack([ground.points, OPPOSITE_DISTANCE / 2 * extent * ground.normals])
    kept = [0]
    nearest = np.zeros(len(places), dtype=int)

    gap = np.linalg.norm(places - places[0], axis=1)
    while len(kept) < most:
        i = int(gap.argmax())
        further = np.linalg.norm(places - places[i], axis=1)
        nearest[further < gap] = len(kept)
        gap = np.minimum(gap, further)
        kept.append(i)

    elements = nearest[ground.elements]
    corners = np.sort(elements, axis=1)
    own = (np.diff(corners, axis=1) > 0).all(axis=1)
    first = np.unique(corners[own], axis=0, return_index=True)[1]
    return SurfaceSample(ground.points[kept], ground.normals[kept], elements[own][first])


def resolved_radius(structure: PartsMatrices, site: Site) -> float | None:
    """Least radius [m] of a patch at a site that facets resolve, at most the size of the part; None
    on sheets and beams."""
    ((place, end),) = places_of(structure, [site])
    if end is not None or not place.member.part.kind.outside:
        return None
    part = place.member.part
    point = place.point[None]
    direction = (place.direction / np.linalg.norm(place.direction))[None]

    def contact(reach: float) -> SurfaceAtSites:
        """The surface at the site under a patch of radius `reach` [m]."""
        return part.surface_below(point, direction, np.array([reach]))

    extent = part.mesh.extent()
    largest = float(contact(TOUCH_DISTANCE * extent).largest[0])
    if largest <= 0:
        depth = float(contact(extent).depth[0])
        reach = TOUCH_DISTANCE * extent + (depth if np.isfinite(depth) else 0.0)
        largest = float(contact(reach).largest[0])

    if largest <= 0:
        return None

    radius = RESOLVED_RATIO * largest
    while (largest := float(contact(radius).largest[0])) > radius:
        radius = RESOLVED_RATIO * largest
    return min(radius, extent)


def _from_supports(structure: MeshedStructure, points: Array) -> Array:
    """Distance (P,) [m] of points from the nearest supported node; inf without supports."""
    space = structure.form.space
    nodes = np.unique(structure.fixed // space.dofmap.index_map_bs)
    x = np.vstack(structure.comm.allgather(space.tabulate_dof_coordinates()[nodes]))
    return np.asarray(cKDTree(x).query(points)[0]) if len(x) else np.full(len(points), np.inf)


def surface_sample(structure: MeshedStructure, group: str | None) -> SurfaceSample:
    """Vertices and elements of a group of faces (cells of sheets and lines); None: all faces."""
    mesh = structure.mesh
    is_solid = structure.kind.outside
    faces = structure.faces
    in_group = np.ones(len(faces.facets), dtype=bool)
    if group is not None:
        in_group = np.isin(faces.facets, mesh.group(group).get(faces.dim, []))

    if not mesh.comm.allreduce(int(in_group.sum())):
        raise InputError(f"group {group!r} holds no outer faces of {mesh.name} ({faces.dim}-D).")

    numbers = np.asarray(mesh.dolfinx.geometry.input_global_indices)[faces.vertices[in_group]]
    normals = faces.normals[in_group] if is_solid else np.zeros((int(in_group.sum()), 3))
    of_rank = numbers, faces.corners[in_group], normals
    numbers, x, normals = (
        np.concatenate(arrays) for arrays in zip(*mesh.comm.allgather(of_rank), strict=True)
    )
    _, first, corner = np.unique(numbers.ravel(), return_index=True, return_inverse=True)
    corner = corner.reshape(numbers.shape)
    mean = np.zeros((len(first), 3))
    for column in corner.T:
        np.add.at(mean, column, normals)
    length = np.linalg.norm(mean, axis=1, keepdims=True)
    mean = mean / np.where(length > 0, length, 1.0)
    if corner.shape[1] == 4:  # in tensor order: 0 1 / 2 3
        corner = np.vstack([corner[:, [0, 1, 2]], corner[:, [1, 3, 2]]])
    return SurfaceSample(x.reshape(-1, 3)[first], mean, corner)


def checked_points(points: object, direction: object) -> Array:
    """The argument `where` of a map as points (P, 3); InputError if it is no list of points, or the
    `direction` of the impacts is None."""
    if direction is None:
        raise InputError("points need the direction of impact, as (0, 0, -1).")
    coordinates = floats("where, if no group's name, the points,", points, None)
    if not coordinates.size:
        raise InputError("a map needs at least one point.")
    if coordinates.ndim != 2 or coordinates.shape[1] not in (2, 3):
        raise InputError(f"where must list points (n, 2 or 3); got shape {coordinates.shape}.")
    return np.pad(coordinates, ((0, 0), (0, 3 - coordinates.shape[1])))


def _in_space(direction: Sequence[float]) -> Array:
    """The direction with three components; InputError if it is invalid or zero."""
    components = coordinates("direction", direction, "")
    if not np.linalg.norm(components):
        raise InputError("direction must not be the zero vector.")
    return in_space(components)
