"""Surfaces of triangles (`.stl`, `.obj`, `.ply`, `.off`): trimesh loads and repairs them; they are
oriented, and filled as solids by gmsh, or by fTetWild if gmsh cannot.
"""

from __future__ import annotations

import math
import re
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from types import ModuleType

import numpy as np

from antiosc.base._types import Array, BoolArray, IntArray as AnyIntArray
from antiosc.base.errors import MeshError, MissingDependencyError, UnmeshableError
from antiosc.base.texts import piece_text
from antiosc.io.isolation import Request
from antiosc.io.neutral import (
    FACETS,
    EntityNames,
    FileMesh,
    IntArray,
    Piece,
    connected_pieces,
    outer_facets,
)

#: Endings of such files.
SURFACE_ENDINGS = (".stl", ".obj", ".ply", ".off")
#: Angle between facets from which their common edge is an edge of the part, degrees.
SHARP_ANGLE = 40.0
#: Decimal digits of the size of a surface up to which two corners are one.
MERGE_DIGITS = 6
#: Height of a triangle, over the size of the surface, below which it has no area.
DEGENERATE_HEIGHT = 1e-7
#: Mean thickness 2 V/A over the size from which a closed surface is that of a solid.
LEAST_SOLID_THICKNESS = 1e-3
#: Number of gmsh's algorithm for sides. Of 48 closed surfaces by others it meshes all that the
#: default, Frontal-Delaunay, does; the default takes 18 s where it takes 1 s, and does not end in a
#: minute where it takes 0.6 s.
DELAUNAY_ALGORITHM = 5
#: Triangles by which surfaces of few are divided: a side of one has no parameters in gmsh.
MOST_DIVIDED_TRIANGLES = 4000
#: More closed surfaces than this are not sorted into bodies and cavities.
MOST_BODIES = 200
#: Corners of a piece by which it is found to lie in another.
SAMPLED_CORNERS = 40
#: Corners of the sides of a triangle.
TRIANGLE_SIDES = ((0, 1), (1, 2), (2, 0))
#: Group of all triangles of a sheet that is the closed surface of a solid.
CLOSED_SURFACE_GROUP = "closed surface"
#: Words of the remark on a surface that gmsh could not fill.
FTETWILD_PHRASE = "is filled by fTetWild"
#: Envelope of fTetWild over the diagonal of the box; the processor time that it may take, s.
FTETWILD_ENVELOPE, FTETWILD_TIME = 1e-3, 600.0


def signed_volumes(points: Array, triangles: IntArray) -> Array:
    """Signed volumes (t,) of the tetrahedra over triangles (t, 3) with their apex at the origin."""
    a, b, c = points[triangles].transpose(1, 0, 2)
    return np.asarray(np.einsum("ni,ni->n", a, np.cross(b, c)) / 6)


def oriented(points: Array, triangles: AnyIntArray) -> tuple[IntArray, IntArray]:
    """(triangles (t, 3) of consistent orientation, outward on closed pieces; their pieces (t,))."""
    count = len(triangles)
    consistent, pairs, _ = _edges_of_triangles(triangles)

    # each triangle twice: as it is, and turned
    a, b = pairs.T
    turn = np.where(consistent, 0, count)
    links = [np.column_stack([a, b + turn]), np.column_stack([a + count, b + count - turn])]
    side = connected_pieces(links, 2 * count)
    piece = connected_pieces([pairs], count)
    _, start = np.unique(piece, return_index=True)
    turned = np.array(triangles, dtype=np.int64)
    other = side[:count] != side[start][piece]
    turned[other] = turned[other][:, ::-1]

    inward = np.bincount(piece, signed_volumes(points - points.mean(axis=0), turned)) < 0
    turned[inward[piece]] = turned[inward[piece]][:, ::-1]
    return turned, piece


def _edges_of_triangles(triangles: AnyIntArray) -> tuple[BoolArray, IntArray, IntArray]:
    """(whether the two triangles at an edge have the same orientation (k,), their numbers (k, 2),
    number of triangles at every edge); k: number of edges with exactly two triangles."""
    ends = np.concatenate([triangles[:, list(side)] for side in TRIANGLE_SIDES])
    ends_of_edges = np.sort(ends, axis=1)
    _, edge, uses = np.unique(ends_of_edges, axis=0, return_inverse=True, return_counts=True)
    order = np.argsort(edge.ravel(), kind="stable")
    start = (np.cumsum(uses) - uses)[uses == 2]
    sides = order[start[:, None] + np.arange(2)]
    # a common edge is passed once in each direction
    first, second = ends[sides, 0].T
    return first != second, sides % len(triangles), uses


# --- Reading --------------------------------------------------------------------------------------


@dataclass
class Surface:
    """A surface of triangles, in one or several connected pieces."""

    points: Array  # (n, 3) coordinates of the corners, in the file's unit
    triangles: IntArray  # (t, 3) corners, consistently oriented; closed pieces have outward normals
    piece: IntArray  # (t,) number of the piece of each triangle
    remarks: list[str]  # repairs that were made, one sentence each

    @property
    def open_edges(self) -> int:
        """Number of edges with an odd number of triangles: 0 for a closed surface."""
        return int((_edges_of_triangles(self.triangles)[2] % 2 != 0).sum())

    @property
    def normals(self) -> Array:
        """Normals (t, 3) of the triangles; their length is twice the area."""
        a, b, c = self.points[self.triangles].transpose(1, 0, 2)
        return np.cross(b - a, c - a)

    @property
    def volume(self) -> float:
        """Enclosed volume; positive if the normals point outward."""
        return float(signed_volumes(self.points, self.triangles).sum())

    def only(self, pieces: Sequence[int]) -> Surface:
        """The surface with only the triangles of `pieces`."""
        rows = np.isin(self.piece, pieces)
        return Surface(self.points, self.triangles[rows], self.piece[rows], self.remarks)

    def sides(self) -> IntArray:
        """Number (t,) of the smooth side of each triangle; sharp edges separate the sides."""
        _, pairs, _ = _edges_of_triangles(self.triangles)
        normals = self.normals / np.linalg.norm(self.normals, axis=1, keepdims=True)
        cosine = np.einsum("ni,ni->n", *normals[pairs].transpose(1, 0, 2))
        smooth = cosine > math.cos(math.radians(SHARP_ANGLE))
        return connected_pieces([pairs[smooth]], len(normals))


def read_surface(request: Request) -> Surface:
    """The surface in a file, repaired and oriented."""
    try:
        import trimesh
    except ImportError as error:
        raise MissingDependencyError(
            "trimesh and networkx, which read surfaces of triangles, are not installed: "
            "pip install trimesh networkx"
        ) from error
    path = Path(request.path)
    suffix = path.suffix.lower()
    content = path.read_bytes()

    with path.open("rb") as file:
        mesh = trimesh.load_mesh(file, file_type=suffix[1:], process=False, skip_materials=True)
    _check_triangles(mesh, content, suffix, request.name)
    if not np.isfinite(mesh.vertices[mesh.faces]).all():
        raise MeshError(f"{request.name} has corners whose coordinates are not finite.")

    # corners that almost coincide, triangles without area, repeated ones, small holes
    count = len(mesh.faces)
    size = float(np.ptp(mesh.vertices[mesh.faces], axis=(0, 1)).max())
    if size > 0:
        digits = MERGE_DIGITS - math.ceil(math.log10(size))
        mesh.merge_vertices(merge_tex=True, merge_norm=True, digits_vertex=digits)
        mesh.update_faces(mesh.nondegenerate_faces(DEGENERATE_HEIGHT * size) & mesh.unique_faces())
        mesh.remove_unreferenced_vertices()
    kept = len(mesh.faces)
    if not kept:
        raise MeshError(f"{request.name} holds no triangles with an area.")

    trimesh.repair.fill_holes(mesh)
    left, added = count - kept, len(mesh.faces) - kept
    notes = []
    if left:
        without = "triangles without area or equal to another that are left out"
        notes.append(f"{request.name}: {without}: {left} of {count}.")
    if added:
        notes.append(f"{request.name}: small holes of the surface are closed by {added} triangles.")

    points = np.array(mesh.vertices, dtype=float)
    return Surface(points, *oriented(points, np.asarray(mesh.faces)), notes)


def _check_triangles(mesh: object, content: bytes, suffix: str, name: str) -> None:
    """MeshError for a surface without triangles, or with fewer than the file's header announces."""
    faces = getattr(mesh, "faces", np.zeros((0, 3)))
    count = len(getattr(mesh, "vertices", ()))
    unused = count - len(np.unique(faces))
    lacks = not len(faces) or bool(faces.max() >= count)

    if suffix == ".stl" and len(content) != 84 + 50 * len(faces):  # a text
        words = content.lower()
        lacks |= words.count(b"endfacet") != len(faces) or b"endsolid" not in words
    elif suffix == ".ply":
        stated = dict(re.findall(rb"element (vertex|face) (\d+)", content[:4096]))
        lacks |= count < int(stated.get(b"vertex", count))
        lacks |= len(faces) < int(stated.get(b"face", 0))
    elif suffix == ".off":
        lines = [line.split(b"#")[0].split() for line in content.splitlines()]
        numbers = [line[1:] if line[0].upper().endswith(b"OFF") else line for line in lines if line]
        numbers = [line for line in numbers if line]
        lacks |= sum(int(n) for n in numbers[0][:2]) != len(numbers) - 1
    elif suffix == ".obj" and not content.endswith(b"\n"):
        last = content.splitlines()[-1].split()  # it has no counts: its corners come first
        lacks |= unused > 0 or last[:1] != [b"f"] or len(last) < 4

    if lacks:
        has = f"{len(faces)} triangles and {count} corners"
        raise MeshError(f"{name} is empty or damaged: it has {has}; write it anew.")


def read(request: Request) -> FileMesh:
    """Read a surface as a mesh of triangles; the `pieces` of a closed surface are its bodies."""
    surface = read_surface(request)
    groups = {}
    area = np.linalg.norm(surface.normals, axis=1).sum() / 2
    size = float(np.ptp(surface.points[surface.triangles], axis=(0, 1)).max())
    if not surface.open_edges and 2 * abs(surface.volume) > LEAST_SOLID_THICKNESS * size * area:
        groups = {CLOSED_SURFACE_GROUP: {"triangle": np.arange(len(surface.triangles))}}

    mesh = FileMesh(surface.points, {"triangle": surface.triangles}, groups)
    mesh.remarks = surface.remarks
    if groups and 0 < surface.piece.max() < MOST_BODIES:
        bodies = _by_volume(surface, _bodies(surface, request.name)[0])
        outer = (surface.triangles[surface.piece == body[0]] for body in bodies)
        corners = [surface.points[np.unique(triangles)] for triangles in outer]
        pieces = [Piece("", x.min(axis=0), x.max(axis=0)) for x in corners]
        mesh.pieces = pieces if len(pieces) > 1 else []
    return mesh


# --- Bodies ---------------------------------------------------------------------------------------


def _bodies(surface: Surface, name: str) -> tuple[list[list[int]], bool]:
    """([outer piece, its cavities …] of each body, whether some pieces pierce each other)."""
    count = int(surface.piece.max()) + 1
    if count > MOST_BODIES:
        raise MeshError(f"{name} has {count} closed surfaces: give one body a file.")

    # share of the corners of each piece (row) within another (column)
    inside = np.zeros((count, count))
    corners = [surface.points[surface.triangles[surface.piece == k]] for k in range(count)]
    for k, own in enumerate(corners):
        places = own.mean(axis=1)[:: max(1, len(own) // SAMPLED_CORNERS)]
        for m, other in enumerate(corners):
            low, high = other.min(axis=(0, 1)), other.max(axis=(0, 1))
            in_box = ((places > low) & (places < high)).all(axis=1)
            if k != m and in_box.any():
                turns = np.array([winding_number(other, place) for place in places[in_box]])
                inside[k, m] = (np.abs(turns) > 0.5).sum() / len(places)
    pierced = bool(((inside > 0) & (inside < 1)).any())

    # a piece within an odd number of others is a cavity of the innermost of them
    contains = inside == 1
    depth = contains.sum(axis=1)
    bodies = {k: [k] for k in range(count) if depth[k] % 2 == 0}
    for k in np.flatnonzero(depth % 2):
        around = np.flatnonzero(contains[k])
        outer = int(around[np.argmax(depth[around])])
        bodies.setdefault(outer, [outer]).append(int(k))
    return list(bodies.values()), pierced


def _by_volume(surface: Surface, bodies: list[list[int]]) -> list[list[int]]:
    """The bodies by descending volume."""
    volume = np.abs(np.bincount(surface.piece, signed_volumes(surface.points, surface.triangles)))
    return sorted(bodies, key=lambda body: -volume[body[0]])


def winding_number(corners: Array, point: Array) -> float:
    """Winding number of triangles (t, 3, 3) around a point (3,): 1 inside, 0 outside; the solid
    angle over 4π (A. van Oosterom, J. Strackee, IEEE Trans. Biomed. Eng. 30 (1983) 125)."""
    a, b, c = (corners - point).transpose(1, 0, 2)
    la, lb, lc = (np.linalg.norm(side, axis=1) for side in (a, b, c))
    ab, bc, ca = (np.einsum("ni,ni->n", *pair) for pair in ((a, b), (b, c), (c, a)))
    triple = np.einsum("ni,ni->n", a, np.cross(b, c))
    angles = np.arctan2(triple, la * lb * lc + ab * lc + bc * la + ca * lb)
    return float(angles.sum() / (2 * np.pi))


def _surface_to_fill(request: Request) -> tuple[Surface, list[list[int]]]:
    """(closed surface of the requested bodies, pieces of each); normals point out of the solid."""
    surface = read_surface(request)
    if surface.open_edges:
        raise MeshError(
            f"{request.name} is not closed, with {surface.open_edges} open edges: repair it, or"
            " read it as a sheet, without solid."
        )

    bodies, pierced = _bodies(surface, request.name)
    if request.piece is not None:
        if request.piece > len(bodies):
            raise MeshError(f"{request.name} has {len(bodies)} bodies, no piece {request.piece}.")
        if len(bodies) > 1:
            surface.remarks.append(piece_text(request.name, request.piece, len(bodies)))
        bodies = [_by_volume(surface, bodies)[request.piece - 1]]
    elif pierced and not request.by_ftetwild:
        raise UnmeshableError(f"the closed surfaces of {request.name} pierce each other.")

    cavities = np.isin(surface.piece, [k for body in bodies for k in body[1:]])
    surface.triangles[cavities] = surface.triangles[cavities][:, ::-1]
    return surface.only([k for body in bodies for k in body]), bodies


# --- Filling --------------------------------------------------------------------------------------


def add_filled_surface(gmsh: ModuleType, request: Request) -> tuple[Surface, EntityNames]:
    """Add the closed surface to gmsh's model as volumes; returns (surface, names of the faces)."""
    import trimesh

    surface, bodies = _surface_to_fill(request)
    side = surface.sides()
    points, triangles, piece = surface.points, surface.triangles, surface.piece
    size = np.inf if request.size is None else request.size / request.unit[0]
    while (
        4 * len(triangles) <= MOST_DIVIDED_TRIANGLES
        and trimesh.Trimesh(points, triangles, process=False).edges_unique_length.max() > size
    ):
        points, triangles = trimesh.remesh.subdivide(points, triangles)
        side, piece = np.repeat(side, 4), np.repeat(piece, 4)

    for k in np.unique(piece):
        own = np.flatnonzero(piece == k)
        nodes = np.unique(triangles[own])
        tag = gmsh.model.addDiscreteEntity(2)
        gmsh.model.mesh.addNodes(2, tag, nodes + 1, points[nodes].ravel())
        gmsh.model.mesh.addElementsByType(tag, 2, own + 1, (triangles[own] + 1).ravel())
    gmsh.option.setNumber("Mesh.Algorithm", DELAUNAY_ALGORITHM)
    gmsh.model.mesh.classifySurfaces(math.radians(SHARP_ANGLE), True, True, math.pi)
    gmsh.model.mesh.createGeometry()

    # gmsh's surfaces, each with one of its triangles
    triangle_of = {
        tag: int(gmsh.model.mesh.getElementsByType(2, tag)[0][0]) - 1
        for _, tag in gmsh.model.getEntities(2)
    }
    for body in bodies:
        shells = ([t for t, row in triangle_of.items() if piece[row] == k] for k in body)
        gmsh.model.geo.addVolume([gmsh.model.geo.addSurfaceLoop(tags) for tags in shells])
    gmsh.model.geo.synchronize()
    return surface, {(2, tag): [f"face {side[k] + 1}"] for tag, k in triangle_of.items()}


def mesh_by_ftetwild(request: Request) -> FileMesh:
    """Fill a surface with tetrahedra by fTetWild (Hu et al., ACM Trans. Graph. 39 (2020) 117)."""
    import pytetwild
    from scipy.spatial import cKDTree

    request.limit_time(FTETWILD_TIME)
    surface, _ = _surface_to_fill(request)
    corners = surface.points[surface.triangles]
    diagonal = float(np.linalg.norm(np.ptp(corners, axis=(0, 1))))
    size = np.inf if request.size is None else request.size / request.unit[0]
    points, cells = pytetwild.tetrahedralize(
        surface.points,
        surface.triangles.astype(np.int32),
        edge_length_fac=min(size / diagonal, 1.0),
        epsilon=FTETWILD_ENVELOPE,
        num_threads=1,
    )

    cells = cells.astype(np.int64)
    x = points[cells]
    turned = np.linalg.det(x[:, 1:] - x[:, :1]) < 0
    cells[turned] = cells[turned][:, [1, 0, 2, 3]]
    outer = outer_facets(cells, FACETS["tetrahedron"])  # of the side of the nearest triangle
    nearest = cKDTree(corners.mean(axis=1)).query(points[outer].mean(axis=1))[1]
    side = surface.sides()[nearest]
    groups = {f"face {k + 1}": {"triangle": np.flatnonzero(side == k)} for k in np.unique(side)}

    mesh = FileMesh(points, {"tetra": cells, "triangle": outer}, groups, of_gmsh=True)
    told = (
        f"{request.name} {FTETWILD_PHRASE} with tetrahedra of one size, without smaller ones "
        "(refine), "
        f"whose faces lie within {100 * FTETWILD_ENVELOPE:g} % of its diagonal from its surface."
    )
    mesh.remarks = [*surface.remarks, told]
    return mesh
