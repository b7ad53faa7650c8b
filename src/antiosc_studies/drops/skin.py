"""The surface of a part that falls: its vertices, their curvatures and materials."""

from __future__ import annotations

from dataclasses import dataclass, fields, replace
from typing import TYPE_CHECKING, Any, TypeAlias, cast

import numpy as np
from numpy.typing import NDArray

from antiosc.base._types import Array, BoolArray, IntArray
from antiosc.engine.contact.surfaces import RIGID_MATTER, isotropic

if TYPE_CHECKING:
    from antiosc import Structure
    from antiosc.fem.structure.meshed import MeshedStructure


#: Array of `Matter`.
Materials: TypeAlias = NDArray[np.object_]
#: A vertex is sharp if the cosine between a facet and the mean normal there is below this.
SMOOTH_COSINE = float(np.cos(np.radians(35.0)))
#: Largest radius of curvature over the size of the part.
FLATTEST = 10.0
#: Least ratio of the principal curvatures of a place that counts as part of a ball.
LEAST_CURVATURE_RATIO = 0.5
#: Largest protrusion of a ball from the hull over its radius, in addition to the height of facets.
MOST_PROTRUSION = 0.05
#: Number of directions in which it is checked: neighbours are some 0.25 rad apart, √(4π/200).
DIRECTION_COUNT = 200
#: An extent below this share of the largest counts as zero.
ZERO_EXTENT = 1e-9


@dataclass(frozen=True, eq=False)
class Skin:
    """The surface of a part, described at its P vertices."""

    #: points, normals: (P, 3) coordinates [m] and outward unit normals (zero if unknown)
    points: Array
    normals: Array
    curvatures: Array  # (P, 2) principal curvatures [1/m], > 0 where the surface is convex
    sharp: BoolArray  # (P,) whether the vertex lies on an edge or a corner
    edge_lengths: Array  # (P,) mean length of the element edges there [m]
    materials: Materials  # (P,) the `Matter` there; `RIGID_MATTER` if it is unknown
    half_thickness: Array  # (P,) half the thickness of a sheet [m]; 0 for a solid
    triangles: IntArray  # (T, 3) between the points

    @property
    def size(self) -> float:
        """Diagonal of the box around the points [m]."""
        return float(np.linalg.norm(np.ptp(self.points, axis=0)))

    def radii(self, vertex: int, corner_radius: float) -> tuple[float, float]:
        """Principal radii [m] at a vertex; if sharp, half a sheet thickness or `corner_radius`."""
        if self.sharp[vertex]:
            rounded = float(self.half_thickness[vertex]) or corner_radius
            return rounded, rounded
        return self.limited_radii(self.curvatures[vertex])

    def limited_radii(self, curvatures: Array) -> tuple[float, float]:
        """Radii [m] for principal curvatures (2,) [1/m], at most FLATTEST times the part's size."""
        first, second = np.maximum(curvatures, 1 / (FLATTEST * self.size))
        return 1 / float(first), 1 / float(second)

    @property
    def ball_radii(self) -> Array:
        """Radii (P,) [m] of balls that fit the surface at the vertices; 0 where none fits."""
        low, high = self.curvatures.T
        rounded = ~self.sharp & (low > LEAST_CURVATURE_RATIO * high) & (high * self.size > 1)
        return np.where(rounded, 2 / np.where(rounded, low + high, 1.0), 0.0)

    def hull_ball_radii(self, vertices: IntArray) -> Array:
        """Radii (V,) [m] of balls at hull vertices (V,); 0 for balls that protrude from the hull.

        A protruding ball, as at a shallow dome or with cells too coarse for the curvature, would
        touch where there is no part.
        """
        balls = self.ball_radii[vertices]
        points = self.points[vertices]
        sizes = self.edge_lengths[vertices]
        centres = points - balls[:, None] * self.normals[vertices]
        allowed = MOST_PROTRUSION * balls + sizes**2 / (4 * np.maximum(balls, np.finfo(float).tiny))
        for direction in _sphere_directions():
            protrusion = centres @ direction + balls - (points @ direction).max()
            balls = np.where(protrusion > allowed, 0.0, balls)

        return balls


def _sphere_directions() -> Array:
    """Directions (DIRECTIONS, 3) distributed evenly on a spiral."""
    k = np.arange(DIRECTION_COUNT)
    z = 1 - (2 * k + 1) / DIRECTION_COUNT
    angle = k * np.pi * (3 - np.sqrt(5))
    horizontal = np.sqrt(1 - z * z)
    return np.column_stack([horizontal * np.cos(angle), horizontal * np.sin(angle), z])


def skin_of(structure: Structure) -> Skin:
    """The surface of a structure of meshes, or the nodes of given matrices with coordinates."""
    from antiosc.fem.structure.structure import on_mesh

    matrices: Any = structure.matrices
    if matrices.located:
        return points_skin(matrices.nodes()[0])
    if not matrices.assembled:
        return mesh_skin(
            on_mesh(structure, "matrices have no points: give a map with coordinates.")
        )

    skins = list[Skin]()
    count = 0
    for member in matrices.members():
        skin = mesh_skin(member.part)
        placement = member.at
        x = placement.placed(skin.points)
        n = skin.normals @ placement.rotation.T
        skins.append(replace(skin, points=x, normals=n, triangles=skin.triangles + count))
        count += len(x)

    names = [f.name for f in fields(Skin)]

    return Skin(
        *(np.concatenate([getattr(skin_of_part, name) for skin_of_part in skins]) for name in names)
    )


def points_skin(points: Array) -> Skin:
    """A skin of points without a surface; all of them are sharp."""
    zero = np.zeros(len(points))
    zeros = np.zeros((len(points), 3))
    sharp = np.ones(len(points), dtype=bool)
    triangles = np.zeros((0, 3), dtype=int)
    unknown = np.full(len(points), RIGID_MATTER, dtype=object)
    return Skin(points, zeros, zeros[:, :2], sharp, zero, unknown, zero, triangles)


def mesh_skin(part: MeshedStructure) -> Skin:
    """The surface of one mesh."""
    from antiosc.reduce.site.map_sites import surface_sample

    ground = surface_sample(part, None)
    x = ground.points
    normals = ground.normals
    count = ground.elements.shape[1]
    sides = np.vstack([ground.elements[:, [i, (i + 1) % count]] for i in range(count)])
    edges = np.unique(np.sort(sides, axis=1), axis=0)
    directed_edges = np.vstack([edges, edges[:, ::-1]])  # both ways
    length = np.linalg.norm(x[directed_edges[:, 0]] - x[directed_edges[:, 1]], axis=1)
    sizes = np.bincount(directed_edges[:, 0], length, len(x)) / np.maximum(
        np.bincount(directed_edges[:, 0], minlength=len(x)), 1
    )
    materials, half = _materials(part)
    skin = replace(points_skin(x), normals=normals, edge_lengths=sizes)
    skin = replace(skin, materials=materials, half_thickness=half)
    if count != 3:
        return skin

    skin = replace(skin, triangles=ground.elements)
    if not part.kind.outside:
        return skin

    sharp = _sharp_vertices(x, normals, ground.elements)
    fitted, curvatures = _quadrics(x, normals, directed_edges, sizes)
    normals = np.where(sharp[:, None], normals, fitted)
    return replace(skin, normals=normals, curvatures=curvatures, sharp=sharp)


def _materials(part: MeshedStructure) -> tuple[Materials, Array]:
    """Materials (P,) of the vertices, and half thicknesses (P,) [m] of sheets."""
    faces = part.faces
    numbers = np.asarray(part.mesh.dolfinx.geometry.input_global_indices)[faces.vertices]
    vertices, index = np.unique(numbers, return_inverse=True)
    label = np.zeros(len(vertices), dtype=int)
    label[index.reshape(numbers.shape)] = part.part_of_cells()[faces.cells][:, None]

    matters = np.empty(len(part.parts), dtype=object)
    half = np.zeros(len(part.parts))
    for k, (material, _) in enumerate(part.parts):
        matters[k] = isotropic(material) or RIGID_MATTER

        if part.kind.sheet:
            half[k] = 0.5 * material.section.thickness

    return matters[label], half[label]


def _sharp_vertices(x: Array, normals: Array, triangles: IntArray) -> BoolArray:
    """Mask (P,) of vertices with a facet that is inclined to the mean normal."""
    corners = x[triangles]
    raw_normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    raw_normals /= np.linalg.norm(raw_normals, axis=1, keepdims=True)
    cosine = np.abs(np.einsum("td,tvd->tv", raw_normals, normals[triangles]))
    smallest_cosine = np.ones(len(x))
    np.minimum.at(smallest_cosine, triangles, cosine)
    return smallest_cosine < SMOOTH_COSINE


def _quadrics(x: Array, normals: Array, edges: IntArray, lengths: Array) -> tuple[Array, Array]:
    """Normals (P, 3) and ascending principal curvatures (P, 2) of quadrics fitted to neighbours.

    Relative to the plane of the mean normal the neighbours lie at the height a u + b v + (c u^2 + 2
    d u v + e v^2)/2. edges: (E, 2) from vertices to their neighbours; lengths: (P,) mean lengths
    of these [m].
    """
    vertex = edges[:, 0]
    edge = x[edges[:, 1]] - x[vertex]
    axis = np.eye(3)[np.argmin(np.abs(normals), axis=1)]
    first = np.cross(normals, axis)
    first /= np.maximum(np.linalg.norm(first, axis=1, keepdims=True), np.finfo(float).tiny)
    second = np.cross(normals, first)
    unit = edge / lengths[vertex, None]
    u, v, w = (np.einsum("ed,ed->e", unit, axes[vertex]) for axes in (first, second, normals))
    rows = np.stack([u, v, u * u / 2, u * v, v * v / 2], axis=1)
    A = np.zeros((len(x), 5, 5))
    f = np.zeros((len(x), 5))
    np.add.at(A, vertex, rows[:, :, None] * rows[:, None, :])
    np.add.at(f, vertex, rows * w[:, None])
    a, b, c, d, e = np.einsum("pij,pj->ip", np.linalg.pinv(A, rcond=1e-9), f)
    fitted = normals - a[:, None] * first - b[:, None] * second
    fitted /= np.maximum(np.linalg.norm(fitted, axis=1, keepdims=True), np.finfo(float).tiny)
    curvature = -np.stack([np.stack([c, d], axis=1), np.stack([d, e], axis=1)], axis=1)
    return fitted, np.linalg.eigvalsh(curvature / lengths[:, None, None])


def hull_indices(points: Array) -> IntArray:
    """Indices of the vertices of the convex hull of points (P, 3)."""
    from scipy.spatial import ConvexHull

    middle = points.mean(axis=0)
    _, size, axes = np.linalg.svd(points - middle, full_matrices=False)
    flattened = (points - middle) @ axes[size > ZERO_EXTENT * size[0]].T
    if flattened.shape[1] == 0:
        return np.zeros(1, dtype=int)
    if flattened.shape[1] == 1:
        return np.array([np.argmin(flattened), np.argmax(flattened)])
    return np.sort(cast(IntArray, ConvexHull(flattened).vertices)).astype(int)
