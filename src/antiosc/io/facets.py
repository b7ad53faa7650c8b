"""Surfaces of triangles (`.stl`, `.obj`, `.ply`, `.off`): cleaned, oriented, and filled as solids.

Such files come from scanners, printers and CAD programs. They contain degenerate and repeated
triangles, corners that almost coincide, small holes, and inconsistent normals.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, field, replace
from itertools import pairwise
from pathlib import Path
from types import ModuleType
from typing import NamedTuple

import numpy as np

from antiosc.base._types import Array, BoolArray, IntArray as AnyIntArray
from antiosc.base.errors import MeshError, PiecesError
from antiosc.base.texts import piece_is_read
from antiosc.io.cad import Attempt
from antiosc.io.neutral import FileMesh, IntArray, Piece
from antiosc.io.polygons import triangles_of
from antiosc.io.request import GRADING, Request

#: Endings of such files.
SURFACES = (".stl", ".obj", ".ply", ".off")
#: Angle between facets from which their common edge is an edge of the part, degrees.
SHARP_ANGLE = 40.0
#: Corners that lie closer, over the size of the surface, are one: coordinates have 24 bits.
COINCIDENT = 1e-6
#: Height of a triangle over its longest side below which it has no area.
FLAT = 1e-6
#: Rounds of cutting triangles at corners on their sides.
MOST_CUTS = 10
#: Largest hole that is closed, over the size of the surface.
SMALL_HOLE = 0.05
#: Mean thickness 2 V/A over the size from which a closed surface is that of a solid.
THICK = 1e-3
#: Number of gmsh's algorithm for sides. Of 48 closed surfaces by others it meshes all that the
#: default, Frontal-Delaunay, does; the default takes 18 s where it takes 1 s, and does not end in a
#: minute where it takes 0.6 s.
DELAUNAY = 5
#: Surfaces of few triangles are cut into as many at most.
MOST_CUT = 4000
#: Rounds of cutting the triangles near a point in halves, each of which halves its longest sides.
MOST_HALVINGS = 30
#: Facets that stay as they are, from which on they are not cut: 3184 of a carriage of 75 mm are
#: 17 214 at 4 mm, 131 370 at 1 mm and at most 203 776 below, each in less than 1 s.
MOST_KEPT = 100_000
#: More closed surfaces than this are not sorted into bodies and cavities.
MOST_BODIES = 200
#: Triangles of a piece by which it is found to lie in another.
MOST_LOOKED_AT = 40
#: Corners of the sides of a triangle.
SIDES = ((0, 1), (1, 2), (2, 0))


@dataclass
class FacetSkin:
    """A surface of triangles.

    Attributes
    ----------
    points : (n, 3)
    triangles : (t, 3) corners, consistently oriented; closed pieces have outward normals.
    piece : (t,) number of the piece of each triangle.
    open_edges : number of edges that are not passed once each way by two triangles, or by pairs.
    remarks : repairs that were made, one sentence each.
    """

    points: Array
    triangles: IntArray
    piece: IntArray
    open_edges: int = 0
    remarks: list[str] = field(default_factory=list)

    @property
    def closed(self) -> bool:
        """Whether each edge belongs to two triangles, or to pairs of these."""
        return self.open_edges == 0 and len(self.triangles) > 0

    @property
    def thick(self) -> bool:
        """Whether it is closed and encloses more volume than a sheet."""
        size = float(np.ptp(self.points, axis=0).max())
        volume = abs(volumes(self.points, self.triangles).sum())
        area = areas(self.points, self.triangles).sum()
        return self.closed and 2 * volume > THICK * size * area


def areas(points: Array, triangles: IntArray) -> Array:
    """Areas (t,) of triangles."""
    a, b, c = points[triangles].transpose(1, 0, 2)
    return np.asarray(np.linalg.norm(np.cross(b - a, c - a), axis=1) / 2)


def volumes(points: Array, triangles: IntArray) -> Array:
    """Signed volumes (t,) between the origin and triangles; they add up to the enclosed volume."""
    a, b, c = points[triangles].transpose(1, 0, 2)
    return np.asarray(np.einsum("ni,ni->n", a, np.cross(b, c)) / 6)


def oriented(points: Array, triangles: AnyIntArray) -> tuple[IntArray, IntArray]:
    """(triangles with consistent orientation, number of the connected piece of each).

    Pieces that enclose a volume are oriented outward. If a piece is one-sided, or more than two
    triangles meet at an edge, neighbours may differ, unless the triangles close as they are: bodies
    that touch along an edge are one piece.
    """
    count = len(triangles)
    consistent, a, b = _neighbours(triangles)
    if not _unpaired(triangles):
        piece = _components(*_along_edges(triangles), count)
        return _outward(points, np.array(triangles, dtype=np.int64), piece), piece
    # each triangle twice: as it is, and turned
    rows = np.concatenate([a, a + count])
    columns = np.concatenate(
        [np.where(consistent, b, b + count), np.where(consistent, b + count, b)]
    )
    side = _components(rows, columns, 2 * count)
    piece = _components(a, b, count)
    _, start = np.unique(piece, return_index=True)
    flipped = np.array(triangles, dtype=np.int64)
    reversed_side = side[:count] != side[start][piece]
    flipped[reversed_side] = flipped[reversed_side][:, ::-1]
    return _outward(points, flipped, piece), piece


def _outward(points: Array, triangles: IntArray, piece: IntArray) -> IntArray:
    """The triangles; pieces that enclose a negative volume are turned."""
    inward = np.bincount(piece, volumes(points - points.mean(axis=0), triangles)) < 0
    triangles[inward[piece]] = triangles[inward[piece]][:, ::-1]
    return triangles


def edges_of(triangles: AnyIntArray) -> tuple[IntArray, IntArray, IntArray]:
    """(ends (3t, 2) of the sides of t triangles, first sides first, number of the edge of each,
    uses of each edge).
    """
    ends = np.concatenate([triangles[:, list(side)] for side in SIDES])
    _, edge, uses = np.unique(
        np.sort(ends, axis=1), axis=0, return_inverse=True, return_counts=True
    )
    return ends, edge.ravel(), uses


def _unpaired(triangles: AnyIntArray) -> int:
    """Number of edges that are not passed equally often each way."""
    ends, edge, _ = edges_of(triangles)
    way = np.where(ends[:, 0] < ends[:, 1], 1.0, -1.0)
    return int((np.bincount(edge, way) != 0).sum())


def _along_edges(triangles: AnyIntArray) -> tuple[IntArray, IntArray]:
    """Pairs of triangles that share an edge, so that all at an edge are connected."""
    _, edge, _ = edges_of(triangles)
    order = np.argsort(edge, kind="stable")
    same = edge[order][1:] == edge[order][:-1]
    owner = order % len(triangles)
    return owner[:-1][same], owner[1:][same]


def _components(a: IntArray, b: IntArray, count: int) -> IntArray:
    """Number of the connected component of each of `count` nodes; edges are pairs (a, b)."""
    from scipy.sparse import coo_matrix  # the reading process loads it for surfaces alone
    from scipy.sparse.csgraph import connected_components

    graph = coo_matrix((np.ones(len(a)), (a, b)), shape=(count, count))
    return np.asarray(connected_components(graph, directed=False)[1], dtype=np.int64)


def _neighbours(triangles: AnyIntArray) -> tuple[BoolArray, IntArray, IntArray]:
    """(mask of consistent orientation, first triangle, second triangle) for edges of two
    triangles.
    """
    ends, edge, uses = edges_of(triangles)
    owner = np.tile(np.arange(len(triangles)), 3)
    order = np.argsort(edge, kind="stable")
    first = order[(np.cumsum(uses) - uses)[uses == 2]]
    second = order[(np.cumsum(uses) - uses)[uses == 2] + 1]
    # a common edge is passed once in each direction
    return ends[first, 0] != ends[second, 0], owner[first], owner[second]


def cleaned(points: Array, triangles: IntArray, name: str) -> FacetSkin:
    """The surface without degenerate and repeated triangles, small holes closed, oriented.

    Raises
    ------
    MeshError
        No triangle is left.
    """
    notes = []
    size = float(np.ptp(points[triangles].reshape(-1, 3), axis=0).max()) if len(triangles) else 0.0
    points, triangles = _merged(points, triangles, COINCIDENT * size)
    triangles, flipped = _flipped(points, triangles)
    if flipped:
        notes.append(f"{name}: triangles without area, cut out of their neighbours: {flipped}.")
    sound = ~_flat(points, triangles)
    repeated, wall = (np.zeros(len(triangles), dtype=bool) for _ in range(2))
    repeated[sound], wall[sound] = _repeats(triangles[sound])
    reasons = (
        (~sound, "without area"),
        (repeated, "equal to another"),
        (wall, "between bodies that touch, or folded,"),
    )
    for removed, reason in reasons:
        if removed.any():
            notes.append(
                f"{name}: triangles {reason} that are left out: {removed.sum()} of {len(removed)}."
            )
    triangles = triangles[sound & ~repeated & ~wall]
    if not len(triangles):
        raise MeshError(
            f"{name} holds no triangles with an area: write the surface of the part into it."
        )
    triangles, cut = _sewn(points, triangles, COINCIDENT * size)
    if cut:
        notes.append(f"{name}: triangles that are cut at corners of others on their sides: {cut}.")
    triangles, piece = oriented(points, triangles)
    points, more, holes = _caps(points, triangles, SMALL_HOLE * size)
    if holes:
        notes.append(f"{name}: small holes of the surface that are closed: {holes}.")
        triangles, piece = oriented(points, np.vstack([triangles, more]))
    return FacetSkin(points, triangles, piece, _unpaired(triangles), notes)


def _merged(points: Array, triangles: IntArray, distance: float) -> tuple[Array, IntArray]:
    """The used points, with points closer than a distance merged."""
    used_points, triangles = np.unique(triangles, return_inverse=True)
    points = points[used_points]
    triangles = triangles.reshape(-1, 3)
    from scipy.spatial import cKDTree

    pairs = cKDTree(points).query_pairs(distance, output_type="ndarray")
    label = _components(pairs[:, 0], pairs[:, 1], len(points))
    _, first = np.unique(label, return_index=True)
    return points[first], label[triangles].astype(np.int64)


def _flat(points: Array, triangles: IntArray) -> BoolArray:
    """Mask of triangles without area: two corners coincide, or all three are collinear."""
    corners = points[triangles]
    longest = np.linalg.norm(corners - np.roll(corners, 1, axis=1), axis=2).max(axis=1)
    return np.asarray(2 * areas(points, triangles) <= FLAT * longest**2)


def _flipped(points: Array, triangles: IntArray) -> tuple[IntArray, int]:
    """(triangles, number of flat ones that were removed by swapping an edge with a neighbour).

    Without the swap, removing a flat triangle leaves a hole without area, with a corner within a
    side. The neighbour across its longest side is therefore divided at that corner.
    """
    triangles, last_count, flat = triangles.copy(), 0, _flat(points, triangles)
    start = int(flat.sum())
    while last_count != flat.sum():  # the neighbour of one may be flat until that is cut
        last_count = flat.sum()
        for row in np.flatnonzero(flat):
            _cut_out(points, triangles, row, flat)
        flat = _flat(points, triangles)
    return triangles, start - int(last_count)


def _cut_out(points: Array, triangles: IntArray, row: int, flat: BoolArray) -> None:
    """Swap the longest edge of a flat triangle with its neighbour, if that has an area."""
    corners = triangles[row]
    ends = points[corners] - np.roll(points[corners], -1, axis=0)
    i, j, middle = np.roll(corners, -int(np.argmax(np.linalg.norm(ends, axis=1))))
    neighbours = np.flatnonzero((triangles == i).any(axis=1) & (triangles == j).any(axis=1))
    neighbours = neighbours[neighbours != row]
    if len(set(corners.tolist())) < 3 or len(neighbours) != 1 or flat[neighbours[0]]:
        return
    neighbour = triangles[neighbours[0]].copy()
    if middle not in neighbour:
        triangles[row] = np.where(neighbour == i, middle, neighbour)
        triangles[neighbours[0]] = np.where(neighbour == j, middle, neighbour)
        flat[row] = False


def _repeats(triangles: IntArray) -> tuple[BoolArray, BoolArray]:
    """Masks of triangles: (those that repeat another, those of walls, of which none is kept).

    Two bodies that share a face, and a surface that is folded onto itself, have each triangle there
    twice; the sides at the border of such a wall belong to two other triangles, those at the border
    of a patch that the file holds twice to one.
    """
    _, first, row, copies = np.unique(
        np.sort(triangles, axis=1),
        axis=0,
        return_index=True,
        return_inverse=True,
        return_counts=True,
    )
    repeated = np.ones(len(triangles), dtype=bool)
    repeated[first] = False
    several = copies > 1
    wall = np.zeros(len(first), dtype=bool)
    if several.any():
        _, edge, uses = edges_of(triangles[first])
        of_several = np.tile(several, 3)
        inside = np.bincount(edge[of_several], minlength=len(uses))
        others = uses - inside
        patch = _components(*_along_edges(triangles[first][several]), int(several.sum()))
        side_others = others[edge[of_several]] * (inside[edge[of_several]] == 1)
        vote = np.array([0.0, -1.0, 1.0])[np.where(side_others > 0, 2 - side_others % 2, 0)]
        is_wall = np.bincount(np.tile(patch, 3), vote) > 0
        wall[several] = is_wall[patch] & (copies[several] == 2)
    of_wall = wall[row.ravel()]
    return repeated & ~of_wall, of_wall


def _sewn(points: Array, triangles: IntArray, distance: float) -> tuple[IntArray, int]:
    """(triangles, number of those cut): along slits without width, cut at the corners across.

    Unchanged if no fewer edges belong to one triangle alone.
    """
    result, cut = triangles, 0
    for _ in range(MOST_CUTS):
        rows, parts = _cut_at_corners(points, result, distance)
        if not len(rows):
            break
        cut += len(rows)
        result = np.vstack([np.delete(result, rows, axis=0), *parts])
    if (edges_of(result)[2] == 1).sum() < (edges_of(triangles)[2] == 1).sum():
        return result, cut
    return triangles, 0


def _cut_at_corners(
    points: Array, triangles: IntArray, distance: float
) -> tuple[list[int], list[IntArray]]:
    """(rows of triangles with corners of others on a free side, the parts of each)."""
    from scipy.spatial import cKDTree

    ends, edge, uses = edges_of(triangles)
    free = np.flatnonzero(uses[edge] == 1)
    if not len(free):
        return [], []
    corners = np.unique(ends[free])
    x, y = points[ends[free]].transpose(1, 0, 2)
    length = np.linalg.norm(y - x, axis=1)
    near = cKDTree(points[corners]).query_ball_point((x + y) / 2, length / 2)
    rows: list[int] = []
    parts: list[IntArray] = []
    for k, among in enumerate(near):
        row = int(free[k] % len(triangles))
        along = (points[corners[among]] - x[k]) @ (y[k] - x[k]) / length[k]
        off = points[corners[among]] - x[k] - np.outer(along, (y[k] - x[k]) / length[k])
        inner = (along > distance) & (along < length[k] - distance)
        on = inner & (np.linalg.norm(off, axis=1) <= distance)
        if not on.any() or row in rows:
            continue
        i, j = ends[free[k]]
        chain = [i, *corners[among][on][np.argsort(along[on])], j]
        (apex,) = set(triangles[row].tolist()) - {int(i), int(j)}
        rows.append(row)
        parts.append(np.array([[a, b, apex] for a, b in pairwise(chain)], dtype=np.int64))
    return rows, parts


def _caps(points: Array, triangles: IntArray, most: float) -> tuple[Array, IntArray, int]:
    """(points with the centres of holes, triangles that close holes, number of closed holes).

    A hole is a closed chain of edges of one triangle each, at most `most` wide.
    """
    ends, edge, uses = edges_of(triangles)
    rim = ends[uses[edge] == 1]
    label = _components(rim[:, 0], rim[:, 1], len(points))
    middles: list[Array] = []
    caps = [np.zeros((0, 3), dtype=np.int64)]
    for k in np.unique(label[rim[:, 0]]) if len(rim) else ():
        chain = rim[label[rim[:, 0]] == k]
        x = points[chain[:, 0]]
        simple = (np.bincount(chain.ravel())[np.unique(chain)] == 2).all()
        if not simple or np.ptp(x, axis=0).max() > most:
            continue
        if len(chain) == 3:
            caps.append(np.unique(chain)[None])
            continue
        centre = np.full(len(chain), len(points) + len(middles))
        middles.append(x.mean(axis=0))
        caps.append(np.column_stack([chain[:, ::-1], centre]))
    return np.vstack([points, *middles]), np.vstack(caps), len(caps) - 1


# --- Reading --------------------------------------------------------------------------------------


def skin_of(ask: Request) -> FacetSkin:
    """The cleaned surface in a file."""
    path = Path(ask.path)
    points, triangles = triangles_of(path.read_bytes(), ask.name) or _by_meshio(path, ask.name)
    if not len(triangles):
        raise MeshError(f"{ask.name} holds no triangles: write the surface of the part into it.")
    if not np.isfinite(points[triangles]).all():
        raise MeshError(f"{ask.name} has corners whose coordinates are not finite.")
    return cleaned(points, triangles, ask.name)


def _by_meshio(path: Path, name: str) -> tuple[Array, IntArray]:
    """(points (n, 3), triangles (t, 3)) of a file that meshio reads."""
    from antiosc.io.mesh_files import content

    mesh = content(path, name)
    points = np.zeros((len(mesh.points), 3))
    points[:, : mesh.points.shape[1]] = mesh.points
    triangles = [np.zeros((0, 3), dtype=np.int64)]
    for block in mesh.cells:
        data = np.asarray(block.data, dtype=np.int64)
        if block.type in ("triangle", "quad", "polygon"):
            corners = range(1, data.shape[1] - 1)
            triangles += [data[:, [0, k, k + 1]] for k in corners]
    return points, np.vstack(triangles)


def read(ask: Request) -> FileMesh:
    """Read a surface as a sheet; of a closed one the bodies that it would enclose too."""
    skin = skin_of(ask)
    mesh = as_sheet(skin)
    if mesh.groups and 1 < int(skin.piece.max()) + 1 <= MOST_BODIES:
        mesh.pieces = _pieces(skin, ask.name)
    return mesh


def _pieces(skin: FacetSkin, name: str) -> list[Piece]:
    """The bodies that closed surfaces enclose, by their ranks in volume; [] of one."""
    bodies = _bodies(skin, name, alone=True)
    ranked = (_by_volume(skin, bodies, rank, name) for rank in range(1, len(bodies) + 1))
    corners = (skin.points[skin.triangles[skin.piece == body[0]]] for body in ranked)
    pieces = [Piece("", x.min(axis=(0, 1)), x.max(axis=(0, 1))) for x in corners]
    return pieces if len(pieces) > 1 else []


def as_sheet(skin: FacetSkin) -> FileMesh:
    """The triangles of a surface as a mesh."""
    groups = {}
    if skin.closed and skin.thick:
        groups = {CLOSED: {"triangle": np.arange(len(skin.triangles))}}
    mesh = FileMesh(skin.points, {"triangle": skin.triangles}, "vtk", groups)
    mesh.remarks = skin.remarks
    return mesh


#: Share of the volume from which on the deviation of a mesh from the surface of its file is told: a
#: regular polygon of 25 sides has 1 % less area than its circle.
TOLD_VOLUME = 0.01

#: Triangles by whose samples a point is looked for, distance of samples over the size of the
#: surface, and points that are looked for among all triangles.
NEAR, SPACING, MOST_AGAIN = 6, 0.01, 100
#: Samples near a triangle of a mesh among whose triangles the parallel one is looked for. Of the
#: 22 202 facets of a printed part all are on the face that all triangles tell, in 1.1 s (60 s among
#: all), and with 10 samples all but one.
AMONG = 30
#: So many of such triangles are looked at together: each array of their corners takes 43 MB.
AT_ONCE = 20_000
#: Group of all triangles of a sheet that is the closed surface of a solid.
CLOSED = "closed surface"


# --- Filling --------------------------------------------------------------------------------------


class Filled(NamedTuple):
    """A closed surface that is filled in gmsh's model.

    Attributes
    ----------
    skin : the surfaces of its bodies, with the repairs in words.
    faces : name -> triangles of the skin, of each of its smooth sides.
    volume : the enclosed volume in the file's unit.
    """

    skin: FacetSkin
    faces: dict[str, IntArray]
    volume: float


def fill(gmsh: ModuleType, ask: Request, attempt: Attempt) -> Filled:
    """Fill the closed surface of a file with solids in gmsh's model.

    If the attempt is flat, its triangles stay the boundary of the cells; else its sharp edges are
    kept.

    Raises
    ------
    MeshError
        A surface that is not closed.
    """
    skin = skin_of(ask)
    size = None if ask.size is None else ask.size / ask.unit[0]
    if attempt.flat:  # they bound the cells: long ones would let no small patch be resolved
        skin = skin if size is None else no_longer(skin, size)
        for point, size_there in ask.refine:
            skin = finer_near(skin, np.array(point) / ask.unit[0], size_there / ask.unit[0])
    elif size is not None:
        skin = _finer(skin, size)
    if not skin.closed:
        raise MeshError(
            f"{ask.name} is not closed: {skin.open_edges} of its edges do not belong to two "
            "triangles; repair the surface (holes, facets twice), or read it as a sheet, without "
            "solid."
        )
    bodies = _bodies(skin, ask.name, alone=ask.piece is not None)
    if ask.piece is not None:
        count = len(bodies)
        bodies = [_by_volume(skin, bodies, ask.piece, ask.name)]
        if count > 1:
            skin.remarks.append(piece_is_read(ask.name, ask.piece, count))
    surfaces = [_put(gmsh, skin, piece) for body in bodies for piece in body]
    if not attempt.flat:
        gmsh.option.setNumber("Mesh.Algorithm", DELAUNAY)
        gmsh.model.mesh.classifySurfaces(math.radians(attempt.sharp), True, True, math.pi)
        gmsh.model.mesh.createGeometry()
        surfaces = [tag for _, tag in gmsh.model.getEntities(2)]
    first = _first_triangles(gmsh, skin, surfaces)
    piece = skin.piece[first]
    for body in bodies:
        loops = []
        for shell in body:
            tags = [tag for tag, its in zip(surfaces, piece, strict=True) if its == shell]
            loops.append(gmsh.model.geo.addSurfaceLoop(tags))
        gmsh.model.geo.addVolume(loops)
    gmsh.model.geo.synchronize()
    of_bodies = np.isin(skin.piece, np.concatenate(bodies))
    outer = replace(skin, triangles=skin.triangles[of_bodies], piece=skin.piece[of_bodies])
    return Filled(outer, by_side(sides(skin)[of_bodies]), _enclosed(skin, bodies))


def _enclosed(skin: FacetSkin, bodies: list[list[int]]) -> float:
    """Volume within the outer surface of each body, and outside its cavities."""
    of_piece = np.abs(np.bincount(skin.piece, volumes(skin.points, skin.triangles)))
    of_bodies = (of_piece[body] for body in bodies)
    return float(sum(2 * pieces.max() - pieces.sum() for pieces in of_bodies))


def off(mesh: FileMesh, filled: Filled) -> float:
    """Share of the volume or the size by which a mesh is off the surface that it fills.

    Its nodes may be off the triangles, its box off theirs, or its volume off theirs.
    """
    sides = [nodes[:, :3] for kind, nodes in mesh.cells.items() if "triangle" in kind]
    if not sides:
        return 0.0
    x = mesh.points[np.unique(np.concatenate(sides))]
    corners = filled.skin.points[np.unique(filled.skin.triangles)]
    size = float(np.ptp(corners, axis=0).max())
    boxes = (np.array([p.min(axis=0), p.max(axis=0)]) for p in (x, corners))
    beyond = float(np.abs(np.subtract(*boxes)).max())
    distance = max(beyond, farthest(filled.skin, x))
    return max(abs(_change(mesh, filled.volume)), distance / size)


def by_side(side: IntArray) -> dict[str, IntArray]:
    """Name -> triangles of each face of a surface, of the number (t,) of each triangle's side."""
    return {f"face {n + 1}": np.flatnonzero(side == n) for n in np.unique(side)}


def named(mesh: FileMesh, filled: Filled) -> dict[str, dict[str, IntArray]]:
    """The faces of a filled surface as groups of the triangles of its mesh.

    gmsh's surfaces do not tell them: small patches cross the edges of the part, and one surface has
    all facets that stay as they are.
    """
    groups: dict[str, dict[str, IntArray]] = {}
    for kind, nodes in mesh.cells.items():
        if "triangle" not in kind:
            continue
        nearest = nearest_triangles(filled.skin, mesh.points[nodes[:, :3]])
        for name, rows in filled.faces.items():
            members = np.flatnonzero(np.isin(nearest, rows))
            if len(members):
                groups.setdefault(name, {})[kind] = members
    return groups


def nearest_triangles(skin: FacetSkin, corners: Array) -> IntArray:
    """Row of the triangle of a surface that is nearest to each of other triangles (n, 3, 3).

    Inclined ones count as farther by up to the size of the other triangle: beside an edge its
    middle may be as near to the face beyond.
    """
    from scipy.spatial import cKDTree

    places, owner = _samples(skin)
    tree = cKDTree(places)
    own = skin.points[skin.triangles]
    normals = _normals(own)
    nearest = [np.zeros(0, dtype=np.int64)]
    for x in np.array_split(corners, 1 + len(corners) // AT_ONCE):
        middles = x.mean(axis=1)
        near = owner[tree.query(middles, min(AMONG, len(places)))[1]]
        distance = _distances(middles[:, None], own[near])
        along = np.abs(np.einsum("nki,ni->nk", normals[near], _normals(x)))
        size = np.linalg.norm(x - np.roll(x, 1, axis=1), axis=2).max(axis=1)
        best = (distance - size[:, None] * along).argmin(axis=1)
        nearest.append(near[np.arange(len(near)), best])
    return np.concatenate(nearest)


def farthest(skin: FacetSkin, points: Array) -> float:
    """Largest distance of points (n, 3) from the nearest triangle of a surface.

    The triangles near a point are found by samples of them; the points that seem the farthest are
    looked at again.
    """
    from scipy.spatial import cKDTree

    places, owner = _samples(skin)
    corners = skin.points[skin.triangles]
    near = owner[cKDTree(places).query(points, NEAR)[1]]
    distance = _distances(points[:, None], corners[near]).min(axis=1)
    for row in np.argsort(distance)[-MOST_AGAIN:]:
        distance[row] = _distances(points[row], corners).min()
    return float(distance.max())


def _samples(skin: FacetSkin) -> tuple[Array, IntArray]:
    """(places (n, 3) all over the triangles, the triangle of each)."""
    corners = skin.points[skin.triangles]
    longest = np.linalg.norm(corners - np.roll(corners, 1, axis=1), axis=2).max(axis=1)
    size = float(np.ptp(corners.reshape(-1, 3), axis=0).max())
    divisions = np.clip(np.ceil(longest / (SPACING * size)), 1, 1 / SPACING).astype(int)
    places, owners = [], []
    for count in np.unique(divisions):
        rows = np.flatnonzero(divisions == count)
        i, j = np.triu_indices(count + 1)
        u, v = (i + 1 / 3) / (count + 1), (j - i + 1 / 3) / (count + 1)
        weights = np.column_stack([1 - u - v, u, v])
        places.append(np.einsum("wk,tkx->twx", weights, corners[rows]).reshape(-1, 3))
        owners.append(np.repeat(rows, len(weights)))
    return np.vstack(places), np.concatenate(owners)


def _distances(points: Array, corners: Array) -> Array:
    """Distances (…) of points (…, 3) from triangles (…, 3, 3)."""
    a, b, c = (corners[..., k, :] for k in range(3))
    normal = np.cross(b - a, c - a)
    normal = normal / np.linalg.norm(normal, axis=-1, keepdims=True)
    above = np.abs(((points - a) * normal).sum(axis=-1))
    inside = np.ones(above.shape, dtype=bool)
    aside = np.full(above.shape, np.inf)
    for start, end in ((a, b), (b, c), (c, a)):
        side = end - start
        t = ((points - start) * side).sum(axis=-1) / (side * side).sum(axis=-1)
        foot = start + np.clip(t, 0, 1)[..., None] * side
        aside = np.minimum(aside, np.linalg.norm(points - foot, axis=-1))
        inside &= (np.cross(side, points - start) * normal).sum(axis=-1) >= 0
    return np.where(inside, above, aside)


def _change(mesh: FileMesh, volume: float) -> float:
    """Relative change of the volume of a mesh of tetrahedra from that of the surface."""
    cells = [nodes[:, :4] for kind, nodes in mesh.cells.items() if "tetra" in kind]
    if not cells or not volume:  # other checks refuse such a mesh
        return 0.0
    corners = mesh.points[np.concatenate(cells)]
    meshed = np.abs(np.linalg.det(corners[:, 1:] - corners[:, :1])).sum() / 6
    return float(meshed / volume - 1)


def deviation(mesh: FileMesh, volume: float) -> list[str]:
    """Sentence on a mesh of tetrahedra whose volume differs from that of the surface; or none."""
    change = _change(mesh, volume)
    if abs(change) < TOLD_VOLUME:
        return []
    less = "less" if change < 0 else "more"
    return [
        f"the mesh has {100 * abs(change):.2g} % {less} volume than the surface of the file, whose "
        "edges and holes it cuts: a smaller size follows them."
    ]


def _finer(skin: FacetSkin, size: float) -> FacetSkin:
    """Triangles cut into four until their sides are below `size`, or MOST_CUT is reached.

    gmsh finds no parameters of a side that is one triangle, and keeps triangles that it cannot
    mesh anew.
    """
    points = skin.points
    triangles = skin.triangles
    piece = skin.piece
    while 4 * len(triangles) <= MOST_CUT:
        ends = np.concatenate([triangles[:, list(side)] for side in SIDES])
        if np.linalg.norm(np.diff(points[ends], axis=1), axis=2).max() <= size:
            break
        edges, middle = np.unique(np.sort(ends, axis=1), axis=0, return_inverse=True)
        m = len(points) + middle.reshape(3, -1).T  # of the sides 01, 12, 20
        a, b, c = triangles.T
        ab, bc, ca = m.T
        points = np.vstack([points, points[edges].mean(axis=1)])
        parts = [(a, ab, ca), (ab, b, bc), (ca, bc, c), (ab, bc, ca)]
        triangles = np.vstack([np.column_stack(part) for part in parts])
        piece = np.tile(piece, 4)
    return replace(skin, points=points, triangles=triangles, piece=piece)


def finer_near(skin: FacetSkin, point: Array, size: float) -> FacetSkin:
    """Triangles cut in halves until their sides are below a size, which grows from a point on."""
    growth, reach = GRADING

    def allowed(first: Array, second: Array, length: Array) -> Array:
        along = np.clip(((point - first) * (second - first)).sum(axis=1) / length**2, 0, 1)
        away = np.linalg.norm(first + along[:, None] * (second - first) - point, axis=1)
        return size + growth * np.maximum(away - reach * size, 0.0)

    return _cut_to(skin, allowed)


def no_longer(skin: FacetSkin, size: float) -> FacetSkin:
    """Triangles cut in halves until their sides are below a size, or there are `MOST_KEPT`."""
    return _cut_to(skin, lambda *_: size, MOST_KEPT)


def _cut_to(
    skin: FacetSkin, allowed: Callable[[Array, Array, Array], Array | float], most: float = math.inf
) -> FacetSkin:
    """Triangles cut in halves until no side is longer than `allowed`, of the ends and the lengths
    of the sides, or there are `most`.
    """
    for _ in range(MOST_HALVINGS):
        ends, edge, _ = edges_of(skin.triangles)
        first, second = skin.points[ends[:, 0]], skin.points[ends[:, 1]]
        length = np.linalg.norm(second - first, axis=1)
        is_long = length > allowed(first, second, length)
        if not is_long.any() or len(skin.triangles) >= most:
            break
        skin = _halved(skin, ends, edge, length, is_long)
    return skin


def _halved(
    skin: FacetSkin, ends: IntArray, edge: IntArray, length: Array, is_long: BoolArray
) -> FacetSkin:
    """Triangles cut through the middles of long edges, the longest edge of each first (Rivara, Int.
    J. Numer. Meth. Eng. 20 (1984) 745), so that angles stay above half the least.

    `ends` (3t, 2) and `edge` (3t,) of the sides as `edges_of` gives them, and their lengths.
    """
    cut = np.zeros(edge.max() + 1, dtype=bool)
    cut[edge[is_long]] = True
    edges = edge.reshape(3, -1).T  # of each triangle, sides 01, 12, 20
    first = length.reshape(3, -1).argmax(axis=0)
    longest = edges[np.arange(len(edges)), first]
    while not cut[longest[cut[edges].any(axis=1)]].all():
        cut[longest[cut[edges].any(axis=1)]] = True
    pair = np.zeros((len(cut), 2), dtype=np.int64)
    pair[edge] = ends
    middle = len(skin.points) + np.cumsum(cut) - 1
    points = np.vstack([skin.points, skin.points[pair[cut]].mean(axis=1)])
    turn = (first[:, None] + np.arange(3)) % 3  # the longest side comes first
    a, b, c = np.take_along_axis(skin.triangles, turn, axis=1).T
    ab, bc, ca = np.take_along_axis(edges, turn, axis=1).T
    m, n, o = middle[ab], middle[bc], middle[ca]
    whole, right, left = ~cut[ab], cut[bc], cut[ca]
    parts = [
        ((a, b, c), whole),
        ((m, b, c), ~whole & ~right),
        ((m, b, n), right),
        ((m, n, c), right),
        ((a, m, c), ~whole & ~left),
        ((a, m, o), left),
        ((m, c, o), left),
    ]
    triangles = np.vstack([np.column_stack(part)[mask] for part, mask in parts])
    piece = np.concatenate([skin.piece[mask] for _, mask in parts])
    return replace(skin, points=points, triangles=triangles, piece=piece)


def sides(skin: FacetSkin) -> IntArray:
    """Number of the smooth side of each triangle; sharp edges separate sides."""
    a, b = _neighbours(skin.triangles)[1:]
    normal = _normals(skin.points[skin.triangles])
    smooth = np.einsum("ni,ni->n", normal[a], normal[b]) > math.cos(math.radians(SHARP_ANGLE))
    return _components(a[smooth], b[smooth], len(normal))


def _normals(corners: Array) -> Array:
    """Unit normals (n, 3) of triangles (n, 3, 3)."""
    normal = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    return np.asarray(normal / np.linalg.norm(normal, axis=1, keepdims=True))


def _put(gmsh: ModuleType, skin: FacetSkin, piece: int) -> int:
    """The triangles of a piece as a discrete surface of gmsh; its tag."""
    triangles = skin.triangles[skin.piece == piece]
    nodes = np.unique(triangles)
    tag = int(gmsh.model.addDiscreteEntity(2))
    gmsh.model.mesh.addNodes(2, tag, nodes + 1, skin.points[nodes].ravel())
    gmsh.model.mesh.addElementsByType(tag, 2, [], (triangles + 1).ravel())
    return tag


def _first_triangles(gmsh: ModuleType, skin: FacetSkin, surfaces: list[int]) -> IntArray:
    """For each surface of gmsh's model, a triangle of the skin on it."""
    from scipy.spatial import cKDTree

    middles = []
    for tag in surfaces:
        nodes, x, _ = gmsh.model.mesh.getNodes(2, tag, includeBoundary=True)
        _, corners = gmsh.model.mesh.getElementsByType(2, tag)
        place = dict(zip(nodes.tolist(), np.reshape(x, (-1, 3)), strict=True))
        middles.append(np.mean([place[node] for node in corners[:3].tolist()], axis=0))
    tree = cKDTree(skin.points[skin.triangles].mean(axis=1))
    return np.asarray(tree.query(np.array(middles))[1])


def _bodies(skin: FacetSkin, name: str, alone: bool = False) -> list[list[int]]:
    """The surfaces of each body: its outer surface first, then those of its cavities.

    `alone`: only one body is to be filled, so that bodies may intersect.
    """
    count = int(skin.piece.max()) + 1
    if count > MOST_BODIES:
        raise MeshError(
            f"{name} has {count} closed surfaces, more than {MOST_BODIES}: give one body a file."
        )
    contains = _inside(skin, count)
    if ((contains > 0) & (contains < 1)).any() and not alone:
        raise PiecesError(
            f"the closed surfaces of {name} pierce each other: unite its bodies in the program "
            "that wrote it, or read one of them (piece 1 is the largest)."
        )
    contains = contains == 1
    depth = contains.sum(axis=1)
    bodies = {k: [k] for k in range(count) if depth[k] % 2 == 0}
    for k in np.flatnonzero(depth % 2):
        containing = np.flatnonzero(contains[k])
        outer = int(containing[np.argmax(depth[containing])])
        bodies.setdefault(outer, [outer]).append(int(k))
    return list(bodies.values())


def _inside(skin: FacetSkin, count: int) -> Array:
    """Share of the sample points of each piece (k) that lie inside another (m): (count, count)."""
    middles = skin.points[skin.triangles].mean(axis=1)
    shares = np.zeros((count, count))
    order = np.argsort(skin.piece, kind="stable")
    rows = np.split(order, np.flatnonzero(np.diff(skin.piece[order])) + 1)
    for m in range(count) if count > 1 else ():
        corners = skin.points[skin.triangles[rows[m]]].reshape(-1, 3)
        low = corners.min(axis=0)
        high = corners.max(axis=0)
        for k in range(count):
            samples = middles[rows[k][:: max(1, len(rows[k]) // MOST_LOOKED_AT)]]
            samples_in_box = samples[((samples > low) & (samples < high)).all(axis=1)]
            if k != m and len(samples_in_box):
                shares[k, m] = (np.abs(winding(skin, m, samples_in_box)) > 0.5).sum() / len(samples)
    return shares


def _by_volume(skin: FacetSkin, bodies: list[list[int]], piece: int, name: str) -> list[int]:
    """The pieces of one body, by their rank in volume (1 is the largest)."""
    if piece > len(bodies):
        raise MeshError(f"{name} has {len(bodies)} bodies; there is no piece {piece}.")
    volume = np.abs(np.bincount(skin.piece, volumes(skin.points, skin.triangles)))
    return sorted(bodies, key=lambda body: -volume[body[0]])[piece - 1]


def winding(skin: FacetSkin, piece: int, points: Array) -> Array:
    """Winding number of a piece about points (p, 3): solid angle over 4π (Van Oosterom 1983)."""
    corners = skin.points[skin.triangles[skin.piece == piece]]
    angle = np.zeros(len(points))
    for row, point in enumerate(points):
        a, b, c = (corners - point).transpose(1, 0, 2)
        la, lb, lc = (np.linalg.norm(side, axis=1) for side in (a, b, c))
        dots = [np.einsum("ni,ni->n", *pair) for pair in ((a, b), (b, c), (c, a))]
        denominator = la * lb * lc + dots[0] * lc + dots[1] * la + dots[2] * lb
        triple_product = np.einsum("ni,ni->n", a, np.cross(b, c))
        angle[row] = np.arctan2(triple_product, denominator).sum() / (2 * np.pi)
    return angle
