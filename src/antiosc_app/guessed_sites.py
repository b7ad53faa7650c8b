"""Guesses of where a part is struck: in sight, clear of edges and hollows, far from supports."""

from __future__ import annotations

import contextlib
from collections.abc import Iterator, Sequence
from itertools import chain, combinations, islice
from math import inf
from typing import TYPE_CHECKING, TypeVar

import numpy as np
from scipy.sparse import coo_matrix
from scipy.sparse.csgraph import connected_components
from scipy.spatial import cKDTree

from antiosc.base._types import Array, BoolArray, IntArray
from antiosc.base.errors import InputError, warnings_to
from antiosc_app.inspection import BALL_OVER_ROOM

if TYPE_CHECKING:
    from antiosc import Mesh, Structure
    from antiosc.extension import Faces

T = TypeVar("T")
#: Words in the names of groups that are struck.
SITE_WORDS = ("impact", "struck", "strike", "hit", "eye", "tip", "nose", "top", "front", "middle")
#: Cosine between neighbouring faces of one side of a part.
SAME_SIDE_COSINE = np.cos(np.radians(15.0))
#: Radius of a patch over the size of the faces there.
RESOLVED = 1.05
#: Radius of a site over the distance to the edge of its face.
RADIUS = 0.4
#: Largest radius of a site on a given mesh over that distance, if the facets need as much: at 1.2
#: 89 % of the load lie on a square face, and from 90 % on the patch counts as whole.
BEYOND_FACE = 1.1
#: Distance, over the edge of a facet, within which facets lie under a patch of 1.05 edges.
UNDER_PATCH = 2.0
#: A site is in a hollow if its concave curvature exceeds this share of the ball's curvature.
HOLLOW = 0.5
#: Upward direction of a sheet in any plane.
UP = np.array([0.1, 0.2, 1.0])
#: Distance from the edge of a face, over the size of the part, beyond which sites rate almost
#: equal.
ROOM = 0.1
#: Number of sites that are tried first, and then among the others; words of the warning about a
#: partly held patch.
MOST_TRIED = 40
PARTLY_HELD = "supports fix"


def face_areas(corners: Array) -> Array:
    """Area vectors (n, 3) of plane faces with corners (n, k, 3): parallelograms or, doubled,
    triangles.
    """
    return np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])


def far_from(
    fixed_points: Array, least: float, sites: Iterator[tuple[Array, Array, float | None]]
) -> Iterator[tuple[Array, Array, float | None]]:
    """The sites; those nearer than `least` [m] to fixed points (n, 3) come last."""
    if not len(fixed_points):
        yield from sites
        return
    tree = cKDTree(fixed_points)
    near_sites = []
    for site in sites:
        if tree.query(site[0])[0] < least:
            near_sites.append(site)
        else:
            yield site
    yield from near_sites


def outside_hollows(
    mesh: Mesh, outer: Faces, sites: Iterator[tuple[Array, Array, float | None]], ball: float
) -> Iterator[tuple[Array, Array, float | None]]:
    """Yield the sites of a solid; those in hollows into which a ball of a radius [m] does not fit
    come last.
    """
    from antiosc.extension import curvature

    hollow = []
    for site in sites:
        try:
            curvature_there = float(np.min(curvature(mesh, outer, *site[:2], lengths=False).values))
        except InputError:  # not known
            curvature_there = 0.0
        if curvature_there < -HOLLOW / ball:  # nan of edges is not
            hollow.append(site)
        else:
            yield site
    yield from hollow


def clear_of_edges(
    outer: Faces,
    x: Array,
    faces: IntArray,
    sites: Iterator[tuple[Array, Array, float | None]],
    meshed: bool,
) -> Iterator[tuple[Array, Array, float | None]]:
    """The sites of a solid; those where an edge cuts the smallest patch that the facets resolve
    come later, and last those where it cuts the own patch of the site, for which a geometry is
    meshed again (`meshed`).
    """
    later, cut = [], []
    for site in sites:
        if not _cuts_edge(outer, site, RESOLVED * facet_size_at(x, faces, site[0])):
            yield site
        elif meshed and site[2] and not _cuts_edge(outer, site, site[2]):
            later.append(site)
        else:
            cut.append(site)
    yield from later
    yield from cut


def _cuts_edge(outer: Faces, site: tuple[Array, Array, float | None], radius: float) -> bool:
    """Whether an edge of its face cuts the patch of a radius [m] at a site."""
    from antiosc.reduce.site.doubts import WHOLE_PATCH
    from antiosc.reduce.site.sites import MOST_RINGS_OF_MAP, patches

    place, radii = site[0][None], np.array([radius])
    contact = outer.contact(place, site[1][None], radii, np.zeros(len(outer), dtype=int))
    share = patches(outer, place, radii, contact, most_rings=MOST_RINGS_OF_MAP)[1][0]
    return bool(share < WHOLE_PATCH)


def facet_size_at(x: Array, faces: IntArray, point: Sequence[float] | Array) -> float:
    """Size [m] of the facets under the patch that they resolve at a point, as a site measures it:
    the largest mean side of the facets within its radius that face alike.
    """
    from antiosc.extension import SAME_FACE

    corners = x[faces]
    centres = corners.mean(axis=1)
    away = np.linalg.norm(centres - point, axis=1)
    gap = away - np.linalg.norm(corners - centres[:, None], axis=2).max(axis=1)
    nearest = int(np.argmin(away))
    alike = np.ones(len(corners), dtype=bool)
    if corners.shape[1] > 2:
        normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
        normals /= np.linalg.norm(normals, axis=1, keepdims=True)
        alike = normals @ normals[nearest] > SAME_FACE
    sizes = np.linalg.norm(corners - np.roll(corners, 1, axis=1), axis=2).mean(axis=1)
    size = 0.0
    largest = float(sizes[nearest])
    while largest > size:
        size = largest
        largest = float(sizes[alike & (gap <= RESOLVED * size)].max(initial=size))
    return size


def with_room(
    outer: Faces, sites: Iterator[tuple[Array, Array, float | None]], ball: float
) -> Iterator[tuple[Array, Array, float | None]]:
    """The sites; those where a ball of a radius [m] meets the part elsewhere come last."""
    narrow_sites = []
    for site in sites:
        if room_at(outer, site) * BALL_OVER_ROOM < ball:
            narrow_sites.append(site)
        else:
            yield site
    yield from sorted(narrow_sites, key=lambda site: -room_at(outer, site))


def in_sight(
    corners: Array, sites: Iterator[tuple[Array, Array, float | None]], gap: float
) -> Iterator[tuple[Array, Array, float | None]]:
    """The sites; those that the part itself hides, as the inside of a box, come last.

    Parameters
    ----------
    corners : (F, k, 3), in cyclic order
    gap : distance [m] below which a face before the site is that of the site
    """
    triangles = np.concatenate([corners[:, [0, i, i + 1]] for i in range(1, corners.shape[1] - 1)])
    hidden = []
    for site in sites:
        point, direction, _ = site
        if _meets(triangles, point, -direction, gap):
            hidden.append(site)
        else:
            yield site
    yield from hidden


def _meets(triangles: Array, point: Array, direction: Array, least: float) -> bool:
    """Whether a ray from a point meets one of the triangles (F, 3, 3) beyond a distance (Möller and
    Trumbore).
    """
    first, second = triangles[:, 1] - triangles[:, 0], triangles[:, 2] - triangles[:, 0]
    start = point - triangles[:, 0]
    across = np.cross(direction, second)
    turned = np.cross(start, first)
    volume = np.einsum("fi,fi->f", first, across)
    with np.errstate(divide="ignore", invalid="ignore"):
        u = np.einsum("fi,fi->f", start, across) / volume
        v = turned @ direction / volume
        distance = np.einsum("fi,fi->f", second, turned) / volume
        # an edge belongs to both its triangles; nan of a triangle along the ray is no place in it
        inside = np.minimum(np.minimum(u, v), 1 - u - v) > -1e-9
    return bool((inside & (distance > least)).any())


def room_at(outer: Faces, site: tuple[Array, Array, float | None]) -> float:
    """Radius [m] of the largest ball that touches a site of solids and sheets alone."""
    from antiosc.extension import largest_ball

    point, direction, radius = site
    if outer.mesh.tdim == 1 or outer.mesh.gdim < 3:
        return inf
    return largest_ball(outer, np.asarray(point), -np.asarray(direction), radius or 0.0)[0]


def movable_sites(
    structure: Structure,
    first: tuple[Array, Array, float | None],
    others: Iterator[tuple[Array, Array, float | None]],
) -> tuple[Array, Array, float | None]:
    """The first site that no support fixes, with a patch; else the first that is partly fixed."""
    from antiosc import Site
    from antiosc.reduce.site import functional

    partly_held = None
    for point, normal, radius in chain([first], others):
        attempts = [(normal, radius), (normal, None), *((-axis, None) for axis in np.eye(3)[::-1])]
        for direction, patch_radius in attempts:
            warnings_given: list[str] = []
            with contextlib.suppress(InputError), warnings_to(warnings_given.append):
                functional(
                    structure, Site(point.tolist(), direction.tolist(), patch_radius, snap=True)
                )
                if not any(PARTLY_HELD in warning for warning in warnings_given):
                    return point, direction, patch_radius
                partly_held = partly_held or (point, direction, patch_radius)
    return partly_held or first


def spread_out(sites: Iterator[T]) -> Iterator[T]:
    """Yield the first sites, then a sample of the others."""
    yield from islice(sites, MOST_TRIED)
    remaining = list(sites)
    yield from remaining[:: 1 + len(remaining) // MOST_TRIED]


def on_faces(
    x: Array, faces: IntArray, outer: Faces, supported: BoolArray, struck: IntArray, size: float
) -> Iterator[tuple[Array, Array, float, float]]:
    """Yields candidate sites: point, inward direction, distance to the face's edge, edge length of
    the facets around.

    First the middle of the largest face, preferably far from supports and on top; then other
    places, those with most room first. Held faces are none, unless all are held.
    """
    corners = x[faces]
    middle = corners.mean(axis=1)
    area = np.linalg.norm(face_areas(corners), axis=1)
    fixed = supported[faces].all(axis=1)
    area[fixed] = 0.0
    normal = outer.normals
    if outer.sheet:
        normal = _outward(x, faces, normal)
    side, edge_points = _sides(x, faces, normal)
    support_distance = _from_supports(x, supported, middle)
    total = np.maximum(np.bincount(side, area), np.finfo(float).tiny)
    mean_distance = np.bincount(side, area * (support_distance + 0.2 * size)) / total
    mean_height = np.bincount(side, area * normal[:, 2]) / total
    rating = total * mean_distance * (1.5 + mean_height)
    chosen = side == np.argmax(rating)
    if len(struck):
        in_group = np.isin(faces, struck).all(axis=1)
        chosen = in_group if in_group.any() else chosen
    edge_distance = np.full(len(faces), size)
    for number in np.unique(side[chosen]):
        if len(edge_points[number]):
            on_side = side == number
            edge_distance[on_side] = cKDTree(edge_points[number]).query(middle[on_side])[0]
    clearance = (np.minimum(edge_distance, ROOM * size) + ROOM * edge_distance) * (
        support_distance + ROOM * size
    )
    clearance[supported[faces].any(axis=1)] = 0.0
    lengths = np.linalg.norm(corners - np.roll(corners, 1, axis=1), axis=2).max(axis=1)
    tree = cKDTree(middle)
    ranked = np.lexsort((-clearance, -rating[side], ~chosen, fixed))
    for best in ranked[: (~fixed).sum() or None]:
        if not chosen[best] and len(edge_points[side[best]]):
            edge_distance[best] = cKDTree(edge_points[side[best]]).query(middle[best])[0]
        neighbours = np.array(tree.query_ball_point(middle[best], UNDER_PATCH * lengths[best]))
        longest = float(lengths[neighbours[side[neighbours] == side[best]]].max())
        yield middle[best], -normal[best], float(edge_distance[best]), longest


def _outward(x: Array, faces: IntArray, normal: Array) -> Array:
    """Normals of a sheet, outward if it is closed, else upward."""
    from antiosc.io.facets import SIDES, oriented

    triangles = faces[:, :3]
    ends = np.sort(np.concatenate([triangles[:, list(side)] for side in SIDES]), axis=1)
    closed = (np.unique(ends, axis=0, return_counts=True)[1] == 2).all()
    if faces.shape[1] == 3 and closed:
        a, b, c = x[oriented(x, faces)[0]].transpose(1, 0, 2)
        volumes = np.einsum("ni,ni->n", np.cross(b - a, c - a), normal)
    else:
        volumes = normal @ UP
    return np.asarray(normal * np.where(volumes < 0, -1.0, 1.0)[:, None])


def _from_supports(x: Array, supported: BoolArray, points: Array) -> Array:
    """Distances of points (n, 3) from the nearest fixed node; all equal for a free part."""
    if not supported.any():
        return np.ones(len(points))
    return np.asarray(cKDTree(x[supported]).query(points)[0])


def nodes_around(outer: Faces) -> IntArray:
    """Corners of faces in cyclic order."""
    return outer.vertices[:, [0, 1, 3, 2] if outer.vertices.shape[1] == 4 else slice(None)]


def sides_of(x: Array, outer: Faces) -> IntArray:
    """Number of the smooth side of the part to which each outer face belongs."""
    return _sides(x, nodes_around(outer), outer.normals)[0]


def _sides(x: Array, faces: IntArray, normal: Array) -> tuple[IntArray, dict[int, Array]]:
    """Number of the smooth side of each face; points on the edges of each side."""
    k = faces.shape[1]
    ends = np.sort(np.stack([faces, np.roll(faces, -1, axis=1)], axis=-1).reshape(-1, 2), axis=1)
    owner = np.repeat(np.arange(len(faces)), k)
    _, edge, count = np.unique(ends, axis=0, return_inverse=True, return_counts=True)
    order = np.argsort(edge.ravel(), kind="stable")
    starts = np.cumsum(count) - count
    pairs = [np.zeros((0, 2), dtype=int)]
    for first, second in combinations(range(4), 2):  # sheets join where three or four meet
        starts_of_edge = starts[count > second]
        pairs.append(
            np.stack([order[starts_of_edge + first], order[starts_of_edge + second]], axis=1)
        )
    neighbours = np.vstack(pairs)
    a, b = owner[neighbours].T
    neighbours = neighbours[np.abs(np.einsum("ij,ij->i", normal[a], normal[b])) > SAME_SIDE_COSINE]
    links = coo_matrix((np.ones(len(neighbours)), owner[neighbours].T), shape=(len(faces),) * 2)
    side = connected_components(links, directed=False)[1]
    at_edge = np.ones(len(owner), dtype=bool)
    at_edge[neighbours.ravel()] = False
    points = np.concatenate([x[ends[:, 0]], x[ends].mean(axis=1), x[ends[:, 1]]])
    of_side = np.tile(np.where(at_edge, side[owner], -1), 3)
    return side, {int(s): points[of_side == s] for s in np.unique(side)}


def on_lines(
    x: Array, nodes: IntArray, supported: BoolArray, struck: IntArray
) -> Iterator[tuple[Array, Array, None]]:
    """Yields candidate sites of beams: nodes of the struck group or far from supports, across."""
    candidates = struck if len(struck) else np.unique(nodes)
    for best in candidates[np.argsort(-_from_supports(x, supported, x[candidates]), kind="stable")]:
        rows = nodes[(nodes == best).any(axis=1)]
        extents = np.abs(x[rows[:, 1]] - x[rows[:, 0]]).sum(axis=0)
        axis = int(np.argmin(extents[::-1]))  # z before y before x
        yield x[best], -np.eye(3)[2 - axis], None


def on_rim(x: Array, faces: IntArray, supported: BoolArray) -> Iterator[tuple[Array, Array, float]]:
    """Yields candidate sites of a plane part: edge middle, inward direction, radius; farthest
    first.
    """
    ends = np.stack([faces, np.roll(faces, -1, axis=1)], axis=-1).reshape(-1, 2)
    owner = np.repeat(np.arange(len(faces)), faces.shape[1])
    edge, count = np.unique(np.sort(ends), axis=0, return_inverse=True, return_counts=True)[1:]
    outer = count[edge.ravel()] == 1
    a, b = x[ends[outer].T]
    middle = (a + b) / 2
    length = np.linalg.norm(b - a, axis=1)
    across = np.cross([0.0, 0.0, 1.0], b - a) / length[:, None]
    inward = x[faces[owner[outer]]].mean(axis=1) - middle
    across *= np.sign(np.einsum("ni,ni->n", across, inward))[:, None]
    support_distance = _from_supports(x, supported, middle)
    offset = np.abs(middle[:, 0] - x[:, 0].mean())
    for best in np.lexsort((offset, -np.round(middle[:, 1], 9), -support_distance)):
        yield middle[best], across[best], float(f"{1.05 * length[best]:.2g}")


def radius_of_patch(inscribed: float, edge: float, largest: float, meshed: bool) -> float:
    """Radius of the patch: inside its face, and on a given mesh at least the edges if they fit."""
    radius = min(RADIUS * inscribed, largest)
    if not meshed:
        largest_share = BEYOND_FACE if 1.05 * edge <= BEYOND_FACE * inscribed else 0.9
        radius = min(max(radius, 1.05 * edge), largest_share * inscribed)
    return float(f"{radius:.2g}")
