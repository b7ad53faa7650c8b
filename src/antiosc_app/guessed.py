"""Guesses where a part is struck and held, if the user does not say it.

It is struck at the middle of its largest free visible face, and held at a group with the name of a
support, else at its lowest flat side.
"""

from __future__ import annotations

from collections.abc import Sequence
from itertools import combinations
from typing import TYPE_CHECKING, TypeAlias

import numpy as np
from scipy.sparse import coo_matrix
from scipy.sparse.csgraph import connected_components
from scipy.spatial import cKDTree

from antiosc.base._types import Array, BoolArray, IntArray
from antiosc.base.errors import AntioscError

if TYPE_CHECKING:
    from antiosc import Mesh, Structure
    from antiosc.fem.mesh.surface import Faces

#: Words in the names of groups that are struck.
SITE_WORDS = ("impact", "struck", "strike", "hit", "eye", "tip", "nose", "top", "front", "middle")
#: Cosine between neighbouring faces of one side of a part.
SAME_SIDE_COSINE = np.cos(np.radians(15.0))
#: Upward direction of a sheet in any plane.
UPWARD = np.array([0.1, 0.2, 1.0])
#: Distance over the size of the part below which a face before a site is the site's own.
OWN_FACE_DISTANCE = 1e-3

#: Point and direction of a site.
SitePlace: TypeAlias = tuple[Array, Array]


def face_area_vectors(corners: Array) -> Array:
    """Area vectors (n, 3) of parallelograms with corners (n, k, 3); twice those of triangles."""
    return np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])


def distances_along(corners: Array, point: Array, direction: Array) -> Array:
    """Signed distances (m,) [m] at which a line meets faces with corners (F, k, 3).

    Source: Möller and Trumbore.
    """
    fans = [corners[:, [0, i, i + 1]] for i in range(1, corners.shape[1] - 1)]
    triangles = np.concatenate(fans)
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
    return np.asarray(distance[inside])


def thickness_at(x: Array, faces: IntArray, place: SitePlace) -> float:
    """Thickness [m] of a solid behind a site; inf if no face (F, k) is behind it."""
    gap = OWN_FACE_DISTANCE * float(np.ptp(x, axis=0).max())
    behind = distances_along(x[faces], *place)
    return float(behind[behind > gap].min(initial=np.inf))


def guess_on_faces(
    x: Array, faces: IntArray, outer: Faces, held: BoolArray, struck: IntArray
) -> SitePlace:
    """The middle of the largest free face that is visible from outside, and the inward direction.

    `x`: nodes (N, 3); `faces` (F, k): their corners, of `outer`; `held`: mask (N, 3) of the
    directions in which nodes are held; `struck`: nodes of groups that are struck by their name.
    """
    corners = x[faces]
    normals = _outward_normals(x, faces, outer.normals) if outer.sheet else outer.normals
    side, edges = _sides_with_edges(x, faces, normals)

    # the area across the directions in which a corner can move
    areas = np.linalg.norm(face_area_vectors(corners) * ~held[faces].all(axis=1), axis=1)
    named = np.isin(faces, struck).all(axis=1)
    if areas[named].any():
        areas[~named] = 0.0
    if not areas.any():  # a sheet that is held across its plane
        return guess_on_lines(x, faces, held, struck)

    # of faces that are about equal that on top
    area = np.bincount(side, areas)
    height = np.bincount(side, areas * normals[:, 2])
    ranked = np.lexsort((-height, -np.round(area / area.max(), 2)))

    gap = OWN_FACE_DISTANCE * float(np.ptp(x, axis=0).max())
    middles = corners.mean(axis=1)
    hidden: list[SitePlace] = []
    for number in ranked[area[ranked] > 0]:
        on_side = np.flatnonzero((side == number) & (areas > 0))
        edge = edges[number]  # the middle is farthest from it
        inner = int(np.argmax(cKDTree(edge).query(middles[on_side])[0])) if len(edge) else 0
        best = on_side[inner]
        before = distances_along(corners, middles[best], normals[best])
        hidden.append((middles[best], -normals[best]))
        if not (before > gap).any():
            return hidden[-1]
    return hidden[0]


def guess_on_lines(x: Array, nodes: IntArray, held: BoolArray, struck: IntArray) -> SitePlace:
    """The node of cells `nodes` (n, k) farthest from supports, and a direction across them.

    Only nodes of `struck` are chosen if there are any; `held` as in `guess_on_faces`.
    """
    candidates = struck if len(struck) else np.unique(nodes)
    best = candidates[np.argmax(_distances_from_supports(x, supported(held), x[candidates]))]
    rows = nodes[(nodes == best).any(axis=1)]
    extents = np.abs(x[rows[:, 1]] - x[rows[:, 0]]).sum(axis=0)
    extents[held[best]] = np.inf
    axis = int(np.argmin(extents[::-1]))  # z before y before x
    return x[best], -np.eye(3)[2 - axis]


def guess_on_rim(x: Array, faces: IntArray, held: BoolArray) -> SitePlace:
    """The middle of a plane part's outer edge that is farthest from supports, and the inward
    direction; `held` as in `guess_on_faces`.
    """
    ends = np.stack([faces, np.roll(faces, -1, axis=1)], axis=-1).reshape(-1, 2)
    owner = np.repeat(np.arange(len(faces)), faces.shape[1])
    edge, count = np.unique(np.sort(ends), axis=0, return_inverse=True, return_counts=True)[1:]
    outer = count[edge.ravel()] == 1

    a, b = x[ends[outer].T]
    middle = (a + b) / 2
    across = np.cross([0.0, 0.0, 1.0], b - a) / np.linalg.norm(b - a, axis=1)[:, None]
    inward = x[faces[owner[outer]]].mean(axis=1) - middle
    across *= np.sign(np.einsum("ni,ni->n", across, inward))[:, None]

    offset = np.abs(middle[:, 0] - x[:, 0].mean())
    moves = (across * ~held[ends[outer]].all(axis=1)).any(axis=1)
    far = _distances_from_supports(x, supported(held), middle) * moves
    best = np.lexsort((offset, -np.round(middle[:, 1], 9), -far))[0]
    return middle[best], across[best]


def _distances_from_supports(x: Array, fixed: BoolArray, points: Array) -> Array:
    """Distances (n,) [m] of points (n, 3) from the nearest fixed node; all 1 without one."""
    if not fixed.any():
        return np.ones(len(points))
    return np.asarray(cKDTree(x[fixed]).query(points)[0])


def _outward_normals(x: Array, faces: IntArray, normal: Array) -> Array:
    """`normal` (F, 3) with signs such that it points outward if a sheet is closed, else upward."""
    from antiosc.io.facets import TRIANGLE_SIDES, oriented

    triangles = faces[:, :3]
    ends = np.sort(np.concatenate([triangles[:, list(side)] for side in TRIANGLE_SIDES]), axis=1)
    closed = (np.unique(ends, axis=0, return_counts=True)[1] == 2).all()
    if faces.shape[1] == 3 and closed:
        a, b, c = x[oriented(x, faces)[0]].transpose(1, 0, 2)
        volumes = np.einsum("ni,ni->n", np.cross(b - a, c - a), normal)
    else:
        volumes = normal @ UPWARD
    return np.asarray(normal * np.where(volumes < 0, -1.0, 1.0)[:, None])


# --- The skin of a part ---------------------------------------------------------------------------


def nodes_around(outer: Faces) -> IntArray:
    """Corners (F, k) of faces, in cyclic order."""
    return outer.vertices[:, [0, 1, 3, 2] if outer.vertices.shape[1] == 4 else slice(None)]


def sides_of(x: Array, outer: Faces) -> IntArray:
    """Number (F,) of the smooth side of the part to which each outer face belongs."""
    return _sides_with_edges(x, nodes_around(outer), outer.normals)[0]


def _sides_with_edges(
    x: Array, faces: IntArray, normal: Array
) -> tuple[IntArray, dict[int, Array]]:
    """(number (F,) of the smooth side of each face, side -> points (n, 3) on its edges)."""
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


# --- Supports -------------------------------------------------------------------------------------

#: Words in the names of groups that are supports, the likeliest first.
SUPPORT_WORDS = (
    *("clamp", "fix", "held", "hold", "support", "encastre", "mount", "bolt", "feet", "foot"),
    *("base", "ground", "root", "rim", "ends", "left", "bottom", "edges"),
)
#: A side that is held has at most these shares of the nodes, and of the surface of a solid: held on
#: its underside a plate would be a layer on a rigid floor.
MAX_PLANE_SHARE, MAX_SIDE_SHARE = 0.6, 0.3
#: Nodes lie on a plane, and are one node, if their distance is below this share of the size.
PLANE_TOLERANCE = 1e-6
#: A number of which no two multiples have a common part behind the point.
GOLDEN_RATIO = 0.6180339887498949
#: Largest rounding of a motion of 1 to 2: 1e-15 at the middles of edges of triangles.
MOTION_ROUNDING = 1e-9


def groups_with(mesh: Mesh, words: Sequence[str]) -> tuple[str, ...]:
    """Groups of facets, edges or nodes whose name contains a word, in the order of the words."""
    of_sides = [n for n, parts in mesh.groups.items() if min(parts, default=mesh.tdim) < mesh.tdim]
    return tuple(name for word in words for name in of_sides if word in name.lower())


def nodes_of(mesh: Mesh, groups: Sequence[str]) -> IntArray:
    """Numbers of the nodes of groups."""
    from antiosc.fem.platform import compat

    vertices = [
        compat.vertex_nodes(mesh.dolfinx, dim)[entities].ravel()
        for group in groups
        for dim, entities in mesh.groups[group].items()
    ]
    return np.unique(np.concatenate([np.zeros(0, dtype=int), *vertices]))


def supporting_side(
    x: Array, size: float, faces: IntArray | None
) -> tuple[BoolArray, list[Array] | None]:
    """(mask (N,) of the nodes on the lowest flat side that is not too large, [point, normal]).

    None instead of [point, normal] if there is no such side; `size` [m]: diagonal of the part;
    `faces`: faces of a solid, whose areas are then compared, too.
    """
    low, high = x.min(axis=0), x.max(axis=0)
    area = None if faces is None else np.linalg.norm(face_area_vectors(x[faces]), axis=1)

    for axis, corner in [(2, low), (0, low), (1, low), (0, high), (1, high)]:
        on_side = np.abs(x[:, axis] - corner[axis]) < PLANE_TOLERANCE * size
        if not min(3, len(x) // 4) <= on_side.sum() <= max(1.0, MAX_PLANE_SHARE * len(x)):
            continue
        if area is not None and faces is not None:
            share = area[on_side[faces].all(axis=1)].sum() / area.sum()
            if not 0 < share <= MAX_SIDE_SHARE:
                continue
        return on_side, [corner, np.eye(3)[axis]]
    return np.zeros(len(x), dtype=bool), None


def held_nodes(structure: Structure, x: Array, size: float) -> BoolArray:
    """Mask (N, 3) of the directions in which the nodes `x` (N, 3) are held; `size` [m] of the
    part."""
    from antiosc.recovery import source

    held = np.zeros(x.shape, dtype=bool)
    motion = 1.0 + (np.arange(structure.rows)[:, None] * GOLDEN_RATIO) % 1.0  # none cancels another
    motion[structure.fixed[structure.fixed < structure.rows]] = 0.0
    try:
        nodes, _, displacements = source(structure).at_nodes(structure, motion)
    except AntioscError:
        return held

    at_rest = np.abs(displacements[:, :, 0]) <= MOTION_ROUNDING
    for axis in range(3):
        if at_rest[:, axis].any():
            distance = cKDTree(nodes[at_rest[:, axis]]).query(x)[0]
            held[:, axis] = distance < PLANE_TOLERANCE * size
    return held


def supported(held: BoolArray) -> BoolArray:
    """Mask (N,) of the nodes held in a direction in which others can move."""
    return np.asarray(held[:, ~held.all(axis=0)].any(axis=1))
