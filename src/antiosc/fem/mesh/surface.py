"""Quadrature points of the groups of a mesh, and points on its outer faces and cells.

The faces that an impactor can strike are the outer facets of a solid and the cells of a sheet.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, fields
from functools import cached_property
from math import factorial, inf

import numpy as np
from mpi4py import MPI
from scipy.spatial import cKDTree

from antiosc.base._types import Array, BoolArray, IntArray
from antiosc.base.errors import InputError
from antiosc.fem.mesh import CellEntities, Mesh
from antiosc.fem.platform import compat
from antiosc.io.neutral import CELL_KINDS

#: Most Gauss–Newton steps onto a curved cell.
FOOT_STEPS = 12
#: Step (reference lengths) that ends the iteration; the remaining error is its square.
FOOT_SETTLED = 1e-8
#: The iteration ends for a foot that leaves its cell by more than this (reference lengths).
FOOT_BEYOND = 1.0
#: Bulge of a cell's points over that of its nodes: Σ|N| of those between corners, 1.93 in a prism.
BULGE_FACTOR = 2.0
#: Degree of the quadrature on groups: exact for products of two cubics on straight cells.
GROUP_DEGREE = 6


def projected(
    at: Callable[[IntArray, Array], tuple[Array, Array]],
    points: Array,
    start: Array,
    *,
    affine: BoolArray,
    along: Array | None = None,
) -> Array:
    """Reference coordinates ξ (n, t) at which x(ξ) is nearest to `points` (n, 3), inside their
    cells or outside.

    Gauss–Newton iteration from `start` (n, t); it stops for points whose projection lies far
    outside the cell. `at(k, ξ (k, t))` is (x (k, 3), dx/dξ (k, 3, t)) for the points numbered k;
    `affine` (n,): where x(ξ) is affine, one step is exact; `along`: unit vectors (n, 3) of the
    projection; None: to the nearest point.
    """
    xi = np.array(start)
    step = np.zeros_like(xi)
    least = np.full(len(points), np.inf)

    moving = np.arange(len(points))
    for _ in range(FOOT_STEPS):
        trial = xi[moving] + step[moving]
        x, J = at(moving, trial)
        gap = points[moving] - x
        if along is not None:
            gap, J = across(along[moving], gap[:, :, None])[:, :, 0], across(along[moving], J)
        distance = np.linalg.norm(gap, axis=1)

        # A step that leads away is halved: far from a curved cell, whole ones can grow for ever.
        closer = (distance <= least[moving])[:, None]
        least[moving] = np.minimum(least[moving], distance)
        xi[moving] = np.where(closer, trial, xi[moving])
        step[moving] = np.where(closer, _gauss_newton(J, gap), step[moving] / 2)
        ahead = xi[moving] + step[moving]
        far = np.maximum(-ahead.min(axis=1), ahead.max(axis=1) - 1) > FOOT_BEYOND
        unsettled = np.abs(step[moving]).max(axis=1) > FOOT_SETTLED
        moving = moving[unsettled & ~far & ~affine[moving]]
        if not len(moving):
            break

    return xi + step


def across(lines: Array, vectors: Array) -> Array:
    """Parts of `vectors` (n, 3, k) that are perpendicular to the unit vectors `lines` (n, 3)."""
    return vectors - lines[:, :, None] * (lines[:, None] @ vectors)


def _gauss_newton(J: Array, gap: Array) -> Array:
    """Steps (n, t) of ξ that make |gap − J step| smallest, for gaps (n, 3) and J (n, 3, t)."""
    normal = np.swapaxes(J, 1, 2) @ J
    size = np.einsum("ntt->n", normal)[:, None, None] + np.finfo(float).tiny
    # A direction in which the surface does not extend stays where it is.
    normal = normal / size + 1e-14 * np.eye(J.shape[2])
    right = np.einsum("ndt,nd->nt", J, gap)[..., None] / size
    return np.asarray(np.linalg.solve(normal, right)[..., 0])


def outside_distance(xi: Array, simplex: bool) -> Array:
    """Distance (n,) by which reference coordinates (n, t) lie outside their cells; <= 0 inside."""
    upper_excess = xi.sum(axis=1) - 1 if simplex else xi.max(axis=1) - 1
    return np.maximum(-xi.min(axis=1), upper_excess)


def moved_inside(xi: Array, simplex: bool) -> Array:
    """`xi` (n, t), with reference points outside the cell moved to its boundary."""
    xi = np.clip(xi, 0.0, 1.0)
    if simplex:
        xi = xi / np.maximum(xi.sum(axis=1, keepdims=True), 1.0)
    return xi


def pairs_within(centres: Array, reach: Array, points: Array) -> tuple[IntArray, IntArray]:
    """(ball, point) numbers of all `points` (P, 3) in balls with `centres`, radii `reach` (n,)."""
    if not len(points) or not len(centres):
        return np.zeros(0, dtype=int), np.zeros(0, dtype=int)

    low, high = points.min(axis=0), points.max(axis=0)
    gap = np.maximum(0.0, np.maximum(low - centres, centres - high))
    close = np.flatnonzero(np.linalg.norm(gap, axis=1) <= reach)
    near = cKDTree(points).query_ball_point(centres[close], reach[close])
    item = np.repeat(close, np.array([len(found) for found in near], dtype=int))
    return item, np.array([point for found in near for point in found], dtype=int)


#: Reference coordinates may lie this far outside a cell that still holds the point (rounding).
CELL_TOLERANCE = 1e-9


@dataclass(frozen=True)
class ClosestPoint:
    """The point of the structure closest to a given one."""

    #: rank that owns the cell, and the cell's number there
    rank: int
    cell: int
    X: Array  # reference coordinates (tdim,) in the cell
    x: Array  # the closest point itself (3,), m
    distance: float  # its distance to the given point, m


@dataclass(frozen=True, eq=False)
class ClosestPoints:
    """The points of the structure closest to P given points: fields of `ClosestPoint`, (P, …)."""

    rank: IntArray
    cell: IntArray
    X: Array
    x: Array
    distance: Array

    @classmethod
    def of(cls, several: Sequence[ClosestPoint]) -> ClosestPoints:
        """Several `ClosestPoint` as arrays."""
        columns = ([getattr(one, field.name) for one in several] for field in fields(cls))
        return cls(*map(np.array, columns))

    def __len__(self) -> int:
        return len(self.rank)

    def __getitem__(self, i: int) -> ClosestPoint:
        return ClosestPoint(
            int(self.rank[i]), int(self.cell[i]), self.X[i], self.x[i], float(self.distance[i])
        )


def closest(mesh: Mesh, point: Array) -> ClosestPoint:
    """The point of the mesh closest to `point` (3,), the same on every rank."""
    return closest_many(mesh, np.asarray(point)[None])[0]


def closest_many(mesh: Mesh, points: Array) -> ClosestPoints:
    """The points of the mesh closest to `points` (P, 3), the same on every rank."""
    cell, X, distance = _cells_containing(mesh, points)
    in_cell = np.array(mesh.comm.allgather(np.isfinite(distance)))

    x = points.copy()
    for i in np.flatnonzero(~in_cell.any(axis=0)):
        nearest = _closest_here(mesh, points[i])
        if nearest is not None:
            cell[i], X[i] = nearest.cell, nearest.X
            x[i], distance[i] = nearest.x, nearest.distance

    rank = np.array(mesh.comm.allgather(distance)).argmin(axis=0)
    on_rank = rank == mesh.comm.rank
    mine_or_zero = [
        np.where(on_rank if a.ndim == 1 else on_rank[:, None], a, 0) for a in (cell, X, x, distance)
    ]
    cell, X, x, distance = (mesh.comm.allreduce(a) for a in mine_or_zero)
    return ClosestPoints(rank, cell, X, x, distance)


def size_at(mesh: Mesh, nearest: ClosestPoint) -> float:
    """Largest distance [m] between corners of the cell of the closest point."""
    x = corners_at(mesh, nearest)
    return float(np.linalg.norm(x[:, None] - x[None], axis=2).max())


def corners_at(mesh: Mesh, nearest: ClosestPoint) -> Array:
    """Corners (n, 3) of the cell that holds the closest point, on all ranks."""
    corners = None
    if mesh.comm.rank == nearest.rank:
        corners = mesh.geometry.nodes[nearest.cell][: len(mesh.geometry.corners)]
    return np.asarray(mesh.comm.bcast(corners, root=nearest.rank))


def _cells_containing(mesh: Mesh, points: Array) -> tuple[IntArray, Array, Array]:
    """(cell, reference coordinates in it, distance [m], inf if in no cell) of `points` (P, 3)."""
    cell = np.zeros(len(points), dtype=int)
    distance = np.full(len(points), np.inf)
    X = np.zeros((len(points), mesh.tdim))
    low, high = mesh.boxes
    if not len(low):
        return cell, X, distance

    reach = 0.5 * np.linalg.norm(high - low, axis=1)
    item, point = pairs_within((low + high) / 2, reach * (1 + CELL_TOLERANCE), points)
    geometry = mesh.geometry
    margin = CELL_TOLERANCE * reach[item, None]
    boxed = (points[point] >= low[item] - margin) & (points[point] <= high[item] + margin)
    item, point = item[boxed.all(axis=1)], point[boxed.all(axis=1)]
    start = np.tile(geometry.centre(), (len(item), 1))
    xi = projected(
        lambda k, X: geometry.at(item[k], X), points[point], start, affine=geometry.affine[item]
    )
    gap = np.linalg.norm(geometry.at(item, xi)[0] - points[point], axis=1)
    holds = np.flatnonzero(
        (outside_distance(xi, geometry.simplex) <= CELL_TOLERANCE)
        & (gap <= CELL_TOLERANCE * reach[item])
    )
    last = holds[np.lexsort((-item[holds], point[holds]))]  # the first cell is written last
    cell[point[last]], X[point[last]], distance[point[last]] = item[last], xi[last], gap[last]
    return cell, X, distance


def _closest_here(mesh: Mesh, point: Array) -> ClosestPoint | None:
    """The closest point on this rank, by projections onto its cells, faces and edges."""
    n_cells = compat.cell_index_map(mesh.dolfinx).size_local
    if not n_cells:
        return None

    geometry = mesh.geometry
    low, high = mesh.boxes
    from_box = np.linalg.norm(np.maximum(0.0, np.maximum(low - point, point - high)), axis=1)
    from_nodes = np.linalg.norm(geometry.nodes[:n_cells] - point, axis=2).min()
    near_cells = np.flatnonzero(from_box <= from_nodes)

    cells = []
    reached = []
    for dim in range(1, mesh.tdim + 1):
        origin, axes = geometry.entities(dim)
        cell = np.repeat(near_cells, len(origin))
        of_cells = np.tile(np.arange(len(origin)), len(near_cells))
        entities = CellEntities(geometry, cell, origin[of_cells], axes[of_cells])
        item = np.arange(len(entities))
        xi = foot_coordinates(entities, item, np.broadcast_to(point, (len(entities), 3)))
        cells.append(cell)
        reached.append(entities.reference(item, xi))

    cell = np.concatenate(cells)
    X = np.concatenate(reached)
    x = geometry.at(cell, X)[0]
    distance = np.linalg.norm(x - point, axis=1)
    i = int(distance.argmin())
    return ClosestPoint(mesh.comm.rank, int(cell[i]), X[i], x[i], float(distance[i]))


def foot_coordinates(entities: CellEntities, item: IntArray, points: Array) -> Array:
    """Coordinates ξ (n, dim) on the entities `item` (n,) nearest to `points` (n, 3)."""
    start = entities.middle[item]
    affine = entities.affine[item]
    xi = projected(lambda k, xi: entities.at(item[k], xi), points, start, affine=affine)
    return moved_inside(xi, entities.simplex)


@dataclass(frozen=True, eq=False)
class WeightedPoints:
    """n weighted points in cells of a mesh."""

    #: cell, X: (n,) cell and (n, tdim) reference coordinates in it
    cell: IntArray
    X: Array
    x: Array  # (n, 3) coordinates [m]
    weight: Array  # (n,) [m, m² or m³; 1 for points]


def kind_of_cells(mesh: Mesh, cells: IntArray) -> str:
    """meshio's name of the mesh's cells, by their number of nodes: `cells` (n, nodes)."""
    return next(
        n for n, k in CELL_KINDS.items() if (k.shape, k.nodes) == (mesh.cell, cells.shape[1])
    )


def largest_entities(mesh: Mesh, group: str) -> tuple[int, IntArray]:
    """(dimension, entities of this rank) of the highest dimension in a group; InputError for an
    unknown or empty one."""
    by_dimension = mesh.group(group)
    dim_here = max((d for d in by_dimension if len(by_dimension[d])), default=-1)
    dim = mesh.comm.allreduce(dim_here, op=MPI.MAX)
    if dim < 0:
        raise InputError(f"the group {group!r} of {mesh.name} is empty.")

    return dim, np.asarray(by_dimension.get(dim, np.zeros(0, dtype=np.int32)))


def owned_entities(mesh: Mesh, dim: int, entities: IntArray) -> IntArray:
    """The entities in `entities` that this rank owns."""
    mesh.dolfinx.topology.create_entities(dim)
    return entities[entities < mesh.dolfinx.topology.index_map(dim).size_local]


def cells_at(mesh: Mesh, dim: int, entities: IntArray) -> tuple[IntArray, IntArray]:
    """(a cell (n,) at each entity, number (n,) of the entity within that cell)."""
    topology = mesh.dolfinx.topology
    if dim == mesh.tdim:
        return np.asarray(entities), np.zeros(len(entities), dtype=int)

    topology.create_entities(dim)
    topology.create_connectivity(dim, mesh.tdim)
    to_cell = topology.connectivity(dim, mesh.tdim)
    cells = np.asarray(to_cell.array)[np.asarray(to_cell.offsets)[entities]]
    entities_of_cells = compat.cell_entities(mesh.dolfinx, dim)[cells]
    return cells, np.asarray((entities_of_cells == np.asarray(entities)[:, None]).argmax(axis=1))


class Entities(CellEntities):
    """F entities of one dimension of a mesh, each with one of the cells that it bounds."""

    def __init__(self, mesh: Mesh, dim: int, entities: IntArray) -> None:
        cells, number = cells_at(mesh, dim, entities)
        origin, axes = np.zeros((1, dim)), np.eye(dim)[None]  # of the cells themselves
        if dim < mesh.tdim:
            origin, axes = mesh.geometry.entities(dim)
        super().__init__(mesh.geometry, cells, origin[number], axes[number])
        self.mesh = mesh
        self.dim = dim
        self.numbers = entities

    @cached_property
    def vertices(self) -> IntArray:
        """Numbers (F, v) of the geometry nodes at the vertices."""
        return compat.vertex_nodes(self.mesh.dolfinx, self.dim)[self.numbers]

    @cached_property
    def corners(self) -> Array:
        """Coordinates (F, v, 3) of the vertices [m]."""
        return np.asarray(self.mesh.dolfinx.geometry.x[self.vertices])

    @cached_property
    def centres(self) -> Array:
        """Middles of the vertices (F, 3) [m]."""
        return np.asarray(self.corners.mean(axis=1))

    @cached_property
    def radii(self) -> Array:
        """Radius (F,) [m] of a ball around the middle that contains the entity."""
        gap = np.linalg.norm(self.corners - self.centres[:, None], axis=2).max(axis=1, initial=0.0)
        return np.asarray(gap + BULGE_FACTOR * self.geometry.bulge[self.cells])


def entity_shape(mesh: Mesh, dim: int) -> str:
    """Shape of the entities of a dimension: "point", "interval", "triangle", …"""
    if dim == mesh.tdim:
        return mesh.cell
    if dim < 2:
        return ("point", "interval")[dim]
    return "triangle" if mesh.geometry.simplex else "quadrilateral"


def quadrature(mesh: Mesh, dim: int, entities: IntArray, degree: int) -> WeightedPoints:
    """Quadrature points on entities of dimension `dim`, exact to `degree` on straight simplices."""
    xi, weights = np.zeros((1, 0)), np.ones(1)
    if dim:
        xi, weights = compat.quadrature(entity_shape(mesh, dim), degree)

    on = Entities(mesh, dim, entities)
    count = len(entities)
    item = np.repeat(np.arange(count), len(weights))
    xi = np.tile(np.reshape(xi, (len(weights), dim)), (count, 1))

    x, J = on.at(item, xi)
    area = np.sqrt(np.linalg.det(np.einsum("nxd,nxe->nde", J, J)))
    cell, X = on.cells[item], on.reference(item, xi)
    return WeightedPoints(cell, X, x, area * np.tile(weights, count))


def group_centre(mesh: Mesh, group: str) -> Array:
    """Centroid (3,) [m] of the highest-dimensional entities of a group, on all ranks."""
    dim, entities = largest_entities(mesh, group)
    entities = owned_entities(mesh, dim, entities)
    points = quadrature(mesh, dim, entities, GROUP_DEGREE)
    total = mesh.comm.allreduce(points.weight.sum())
    return np.asarray(mesh.comm.allreduce(points.weight @ points.x) / total)


#: Faces whose normals have more than this cosine lie on one side of an edge.
SAME_FACE_COSINE = 0.5
#: A site closer to the edge of a face than this share of the face's size lies on the edge.
EDGE_DISTANCE = 0.25
#: Share of their size within which faces touch a point.
TOUCH_SHARE = 1e-6
#: Difference below which unit normals count as equal.
NORMAL_TOLERANCE = 1e-6
#: Reference coordinates may lie this far outside a face that still holds the point (rounding).
FACE_TOLERANCE = 1e-8
#: Of equal faces, the one whose normal points most against this is taken, the same on all ranks.
OBLIQUE_DIRECTION = np.array([0.43, 0.59, 0.68])


@dataclass(frozen=True, eq=False)
class SurfaceAtSites:
    """Properties of the surface at P sites, the same on all ranks."""

    normals: Array  # (P, 3) unit normals, against the direction of impact; 0 without faces
    depth: Array  # (P,) distance of the sites from the surface [m]; inf beyond the radius
    smallest: Array  # (P,) mean side of the smallest face under the patch [m]; inf if there is none
    largest: Array  # (P,) likewise of the largest; -inf if there is none
    rise: Array  # (P,) largest distance of their vertices from the tangent plane [m]; -inf likewise
    label: IntArray  # (P,) least label of the faces at the site; 0 if there is none

    def of(self, which: IntArray) -> SurfaceAtSites:
        """The properties at some of the sites."""
        return SurfaceAtSites(*(getattr(self, member.name)[which] for member in fields(self)))


class Faces(Entities):
    """F faces of one rank that can be struck: outer facets, or the cells of a sheet (`sheet`)."""

    def __init__(self, mesh: Mesh, sheet: bool) -> None:
        self.sheet = sheet
        if sheet:
            count = compat.cell_index_map(mesh.dolfinx).size_local
            #: (F,) their numbers on this rank
            self.facets: IntArray = np.arange(count, dtype=np.int32)
        else:
            self.facets = np.sort(compat.exterior_facets(mesh.dolfinx))

        super().__init__(mesh, mesh.tdim if sheet else mesh.tdim - 1, self.facets)

    def across(self, face: IntArray, xi: Array) -> tuple[Array, Array]:
        """(points, unit normals (n, 3)) at ξ on faces; the normals of solids point outward."""
        x, J = self.at(face, xi)
        if J.shape[2] == 1:
            normal = np.column_stack([J[:, 1, 0], -J[:, 0, 0], np.zeros(len(J))])
        else:
            normal = np.cross(J[:, :, 0], J[:, :, 1])

        size = np.linalg.norm(normal, axis=1, keepdims=True)
        normal = normal / np.where(size > 0, size, 1.0)

        if not self.sheet:
            inner = self.mesh.geometry.nodes[self.cells[face]].mean(axis=1)
            outward = np.einsum("nd,nd->n", normal, self.centres[face] - inner)
            normal = normal * np.where(outward < 0, -1.0, 1.0)[:, None]

        return x, normal

    @cached_property
    def normals(self) -> Array:
        """Unit normals (F, 3) at the middles of the faces."""
        return self.across(np.arange(len(self.facets)), self.middle)[1]

    @property
    def around(self) -> Array:
        """Corners (F, v, 3) in their order around each face [m]."""
        return self.corners[:, [0, 1, 3, 2]] if self.corners.shape[1] == 4 else self.corners

    @cached_property
    def samples(self) -> Array:
        """Points (n, 3) of the faces: their vertices, middles, and middles of their sides [m]."""
        sides = (self.around + np.roll(self.around, 1, axis=1)) / 2
        points = np.concatenate([self.corners, sides, self.centres[:, None]], axis=1)
        return np.unique(points.reshape(-1, 3), axis=0)

    @cached_property
    def sizes(self) -> Array:
        """Mean length of the sides (F,) [m]."""
        sides = self.around - np.roll(self.around, 1, axis=1)
        return np.asarray(np.linalg.norm(sides, axis=2).mean(axis=1))

    def contact(
        self, points: Array, directions: Array, radii: Array, labels: IntArray
    ) -> SurfaceAtSites:
        """Surface within `radii` (P,) [m] of sites (P, 3) struck along `directions` (P, 3); at
        edges, of the face most against the impact. `labels` (F,): integers, one for each face."""
        comm = self.mesh.comm
        count = len(points)
        mean = self.sizes
        face, site = self._pairs_within_radii(points, radii)
        x, normal = self.across(face, foot_coordinates(self, face, points[site]))
        gap = np.linalg.norm(x - points[site], axis=1)
        near = gap <= radii[site]
        face, site, normal, gap = face[near], site[near], normal[near], gap[near]

        depth = _least_over_ranks(comm, gap, site, count)
        facing = np.einsum("nd,nd->n", normal, directions[site])

        if self.sheet:
            is_clear = np.abs(facing) > NORMAL_TOLERANCE
            is_flipped = np.where(is_clear, facing, normal @ OBLIQUE_DIRECTION) > 0
            normal[is_flipped] = -normal[is_flipped]
            facing[is_flipped] = -facing[is_flipped]

        best = np.flatnonzero(gap <= depth[site] + EDGE_DISTANCE * mean[face])
        for measure in (facing, normal @ OBLIQUE_DIRECTION):  # the second decides between equals
            best_measure = _least_over_ranks(comm, measure[best], site[best], count)
            best = best[measure[best] <= best_measure[site[best]] + NORMAL_TOLERANCE]

        first = _mean(comm, normal[best], site[best], count)
        same = np.flatnonzero(np.einsum("nd,nd->n", normal, first[site]) > SAME_FACE_COSINE)
        face, site, normal, gap = face[same], site[same], normal[same], gap[same]
        nearest = gap <= _least_over_ranks(comm, gap, site, count)[site] + TOUCH_SHARE * mean[face]
        normals = _mean(comm, normal[nearest], site[nearest], count)
        label = _least_over_ranks(comm, labels[face[nearest]].astype(float), site[nearest], count)
        height = np.einsum("nvd,nd->nv", self.corners[face] - points[site, None], normals[site])

        return SurfaceAtSites(
            normals,
            depth,
            _least_over_ranks(comm, mean[face], site, count),
            -_least_over_ranks(comm, -mean[face], site, count),
            -_least_over_ranks(comm, -np.abs(height).max(axis=1, initial=0.0), site, count),
            np.where(np.isfinite(label), label, 0).astype(int),
        )

    def foot(self, point: Array, direction: Array, reach: float) -> tuple[float, Array]:
        """(distance [m] of `point` from the surface, nearest point (3,) on it within `reach`);
        faces whose normals oppose `direction` come first. (inf, `point`) without faces."""
        face, _ = self._pairs_within_radii(point[None], np.full(1, reach))
        points = np.tile(point, (len(face), 1))
        x, normal = self.across(face, foot_coordinates(self, face, points))
        gap = np.linalg.norm(x - points, axis=1)
        is_leaving = normal @ direction > -NORMAL_TOLERANCE * np.linalg.norm(direction)

        feet = [(bool(is_leaving[k]), gap[k], x[k].tolist()) for k in np.flatnonzero(gap <= reach)]
        nearest = (gap.min(initial=np.inf), min(feet, default=(True, np.inf, point.tolist())))
        distances, found = zip(*self.mesh.comm.allgather(nearest), strict=True)
        return float(min(distances)), np.array(min(found)[2])

    def _pairs_within_radii(self, points: Array, radii: Array) -> tuple[IntArray, IntArray]:
        """(face, point) numbers of all faces that may be within the radius of a point."""
        octave = np.frexp(radii)[1]
        pairs = [np.zeros((2, 0), dtype=int)]
        for one in np.unique(octave):
            alike = np.flatnonzero(octave == one)
            reach = self.radii + radii[alike].max()
            face, point = pairs_within(self.centres, reach, points[alike])
            pairs.append(np.array([face, alike[point]]))

        face, point = np.hstack(pairs)
        return face, point

    def along(self, points: Array, normals: Array, rise: float) -> tuple[IntArray, Array, Array]:
        """(face, ξ, distance [m], inf beyond `rise`) of points (n, 3) projected along `normals`."""
        face = np.zeros(len(points), dtype=int)
        distance = np.full(len(points), np.inf)
        xi = np.zeros((len(points), self.dim))
        item, point = self._pairs_on_lines(points, normals, rise)
        on_plane = projected(
            lambda k, xi: self.at(item[k], xi),
            points[point],
            self.middle[item],
            affine=self.affine[item],
            along=normals[point],
        )
        inside = outside_distance(on_plane, self.simplex) <= FACE_TOLERANCE
        item, point, on_plane = item[inside], point[inside], on_plane[inside]
        x, normal = self.across(item, on_plane)
        gap = np.abs(np.einsum("nd,nd->n", x - points[point], normals[point]))
        cosine = np.einsum("nd,nd->n", normal, normals[point])
        cosine = np.abs(cosine) if self.sheet else cosine

        hit = np.flatnonzero((cosine > SAME_FACE_COSINE) & (gap <= rise))

        # the nearest, then the first, is written last
        hit = hit[np.lexsort((-item[hit], -gap[hit], point[hit]))]
        face[point[hit]], xi[point[hit]], distance[point[hit]] = item[hit], on_plane[hit], gap[hit]
        return face, xi, distance

    def _pairs_on_lines(
        self, points: Array, normals: Array, rise: float
    ) -> tuple[IntArray, IntArray]:
        """Pairs (face, point) where the line through the point may cross the face."""
        face, point = pairs_within(self.centres, self.radii + rise, points)
        origin, axes = self.corners[:, 0], self.corners[:, 1 : 1 + self.dim] - self.corners[:, :1]
        lines = normals[point]
        J = across(lines, np.swapaxes(axes, 1, 2)[face])
        gap = across(lines, (points[point] - origin[face])[:, :, None])[:, :, 0]

        # what the face leaves its plane by moves ξ by no more than that over the least stretch of J
        squares = np.linalg.eigvalsh(np.swapaxes(J, 1, 2) @ J)[:, 0]
        least = np.sqrt(np.maximum(squares, np.finfo(float).tiny))
        outside = outside_distance(_gauss_newton(J, gap), self.simplex)
        crossed = outside <= FACE_TOLERANCE + np.sqrt(2) * self._unevenness[face] / least
        return face[crossed], point[crossed]

    @cached_property
    def _unevenness(self) -> Array:
        """Distance (F,) [m] by which a face may differ from a plane parallelogram."""
        bulge = BULGE_FACTOR * self.geometry.bulge[self.cells]
        if self.simplex:
            return bulge
        skew = self.corners[:, 0] - self.corners[:, 1] - self.corners[:, 2] + self.corners[:, 3]
        return np.asarray(bulge + np.linalg.norm(skew, axis=1))

    @cached_property
    def tangents(self) -> tuple[Array, Array]:
        """(points x (F, 3) [m], dx/dξ (F, 3, d)) at the middles of the faces."""
        return self.at(np.arange(len(self.facets)), self.middle)


def volume_and_surface(mesh: Mesh) -> tuple[float, float]:
    """(volume, surface) of a mesh with straight edges [m³, m²]; in the plane (area, length)."""
    cells = compat.geometry_nodes(mesh.dolfinx)[: compat.cell_index_map(mesh.dolfinx).size_local]
    cells = cells[:, : len(mesh.geometry.corners)]
    facets = compat.exterior_facets(mesh.dolfinx)
    sides = compat.vertex_nodes(mesh.dolfinx, mesh.tdim - 1)[facets]
    x = mesh.dolfinx.geometry.x
    of_rank = np.array([_measure(x[cells], mesh.tdim), _measure(x[sides], mesh.tdim - 1)])
    volume, surface = mesh.comm.allreduce(of_rank)
    return float(volume), float(surface)


def _measure(corners: Array, dim: int) -> float:
    """Total length, area or volume of simplices (n, dim + 1, 3), quadrilaterals or hexahedra."""
    if not len(corners):
        return 0.0

    if corners.shape[1] == dim + 1:
        sides, share = corners[:, 1:] - corners[:, :1], factorial(dim)
    else:
        cubes = corners.reshape(-1, *[2] * dim, 3)
        axes = range(1, dim + 1)
        spans = [np.diff(cubes, axis=k).reshape(len(cubes), -1, 3).mean(axis=1) for k in axes]
        sides, share = np.stack(spans, axis=1), 1

    gram = np.abs(np.linalg.det(sides @ sides.transpose(0, 2, 1)))
    return float(np.sqrt(gram).sum() / share)


def mean_thickness(mesh: Mesh) -> float:
    """Twice the volume over the surface [m], a wall's thickness; inf without a surface."""
    volume, surface = volume_and_surface(mesh)
    return 2 * volume / surface if surface else inf


def struck_point(faces: Faces, group: str) -> tuple[Array, Array]:
    """(middle (3,) [m] of the outer face nearest to the centroid of a group, inward normal)."""
    mesh = faces.mesh
    in_group = np.flatnonzero(np.isin(faces.facets, mesh.group(group).get(faces.dim, ())))
    x = faces.tangents[0][in_group]
    normals = faces.normals[in_group]
    area = faces.sizes[in_group] ** 2
    total = mesh.comm.allreduce(area.sum())
    if not total:
        raise InputError(f"the group {group!r} of {mesh.name} has no faces on the outside.")
    middle = mesh.comm.allreduce(area @ x) / total
    gap = np.linalg.norm(x - middle, axis=1)
    nearest = inf, middle, middle
    if len(gap):
        best = int(np.argmin(gap))
        nearest = float(gap[best]), x[best], -normals[best]

    _, point, direction = min(mesh.comm.allgather(nearest), key=lambda entry: entry[0])
    return point, direction


def _least_over_ranks(comm: MPI.Comm, values: Array, site: IntArray, count: int) -> Array:
    """Smallest value (count,) of each site over all ranks; inf for a site without values."""
    smallest = np.full(count, np.inf)
    result = np.empty(count)
    np.minimum.at(smallest, site, values)
    comm.Allreduce(smallest, result, op=MPI.MIN)
    return result


def _mean(comm: MPI.Comm, vectors: Array, site: IntArray, count: int) -> Array:
    """Unit vectors (count, 3) along the mean of the vectors of each site, over all ranks."""
    total = np.zeros((count, 3))
    np.add.at(total, site, vectors)
    total = np.asarray(comm.allreduce(total))
    size = np.linalg.norm(total, axis=1, keepdims=True)
    return total / np.where(size > 0, size, 1.0)
