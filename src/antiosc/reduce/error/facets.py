"""Gaps between flat faces and the curved surface that they approximate.

No recovery of strains detects this error. The normal of the surface at a corner is the mean over
the faces around it (weighted as Max, J. Graphics Tools 4 (1999) 2: exact on spheres, and on circles
by the inverse lengths). Along a side of length l with the normals n, n' at its ends x, x', the
curvature times l² is (n' - n)·(x' - x). The mean gap of a segment is a twelfth of that; the mean
gap of a triangle or a quadrilateral is a twenty-fourth of the sum over its sides.
"""

from __future__ import annotations

import numpy as np
import scipy.sparse

from antiosc.base._types import Array, IntArray
from antiosc.fem.elements.weak_form import Material
from antiosc.fem.mesh import Mesh
from antiosc.fem.mesh.surface import Faces
from antiosc.fem.platform import compat
from antiosc.fem.structure.meshed import MeshedStructure

#: Least angle in degrees between neighbouring faces of a curved surface: above rounding.
LEAST_ANGLE = 0.2
#: Largest such angle: that of seven faces around a hole (51.4 degrees), the fewest that gmsh makes.
MOST_ANGLE = 52.0
#: Sides of an exterior facet as positions of its corners.
FACET_SIDES: dict[int, list[tuple[int, ...]]] = {
    2: [(0,), (1,)],
    3: [(0, 1), (0, 2), (1, 2)],
    4: [(0, 1), (0, 2), (1, 3), (2, 3)],
}


def faceted(mesh: Mesh) -> str:
    """A warning if straight cells seem to approximate a curved exterior; otherwise empty."""
    if mesh.order > 1:
        return ""
    facets = compat.exterior_facets(mesh.dolfinx)
    corners = compat.entity_vertices(mesh.dolfinx, mesh.tdim - 1)[facets]
    angles = mesh.comm.allgather(_angles(mesh.dolfinx.geometry.x, corners))
    angle = np.concatenate(angles)
    small = angle[(angle > LEAST_ANGLE) & (angle < MOST_ANGLE)]
    if not len(small):
        return ""
    return (
        f"The flat faces of {mesh.name} that meet at angles of up to {small.max():.2g}° are taken "
        "for a curved surface; cells of order 2 have it curved."
    )


def _angles(x: Array, corners: IntArray) -> Array:
    """Angles in degrees between facets (n, corners) that share a side."""
    if not len(corners):
        return np.zeros(0)
    points = x[corners]
    if corners.shape[1] == 2:
        edge = points[:, 1] - points[:, 0]
        normals = np.column_stack([-edge[:, 1], edge[:, 0], 0 * edge[:, 0]])
    elif corners.shape[1] == 3:
        normals = np.cross(points[:, 1] - points[:, 0], points[:, 2] - points[:, 0])
    else:
        normals = np.cross(points[:, 3] - points[:, 0], points[:, 2] - points[:, 1])
    normals = normals / np.linalg.norm(normals, axis=1, keepdims=True)
    places = FACET_SIDES[corners.shape[1]]
    sides = np.sort(np.concatenate([corners[:, list(place)] for place in places]), axis=1)
    facet = np.tile(np.arange(len(corners)), len(places))
    order = np.lexsort(sides.T)
    same_side = (np.diff(sides[order], axis=0) == 0).all(axis=1)
    first = facet[order[:-1][same_side]]
    second = facet[order[1:][same_side]]
    cosine = np.abs(np.einsum("nd,nd->n", normals[first], normals[second]))
    return np.asarray(np.degrees(np.arccos(np.minimum(cosine, 1.0))))


#: Corners around a face, in order; the ends of a segment.
AROUND = {2: [0, 1], 3: [0, 1, 2], 4: [0, 1, 3, 2]}


def mean_gaps(faces: Faces) -> tuple[Array, Array]:
    """(mean gap [m], area [m²] or, in the plane, length [m]) of this rank's faces, (F,) each.

    A gap is positive where the surface lies outside of the face (it is convex).
    """
    mesh = faces.mesh
    numbers = np.asarray(mesh.dolfinx.geometry.input_global_indices)[faces.vertices]
    faces_of_ranks = mesh.comm.allgather((numbers, faces.corners, faces.normals))
    first = sum(len(arrays[0]) for arrays in faces_of_ranks[: mesh.comm.rank])
    vertices, x, normals = (np.concatenate(arrays) for arrays in zip(*faces_of_ranks, strict=True))
    neighbours = AROUND[vertices.shape[1]]
    gap = _gaps(vertices[:, neighbours], x[:, neighbours], normals)
    area = _areas(faces.corners[:, neighbours])
    return gap[first : first + len(area)], area


def _gaps(vertices: IntArray, x: Array, normals: Array) -> Array:
    """Mean gaps (F,) of faces with corners x (F, v, 3) around them, at `vertices` (F, v)."""
    corners = vertices.shape[1]
    to_next = np.roll(x, -1, axis=1) - x
    to_previous = np.roll(x, 1, axis=1) - x
    size = np.linalg.norm(to_next, axis=2)
    weight = 1 / size
    if corners > 2:
        length = np.linalg.norm(to_previous, axis=2)
        weight = np.linalg.norm(np.cross(to_next, to_previous), axis=2) / (size * length) ** 2
    n = _normals(vertices.ravel(), np.repeat(normals, corners, axis=0), weight.ravel())
    n = n.reshape(x.shape)
    bent = np.einsum("fvd,fvd->f", np.roll(n, -1, axis=1) - n, to_next)
    return np.asarray(bent / 24)  # a segment is gone along twice


def _normals(vertex: IntArray, normals: Array, weights: Array) -> Array:
    """Normal (C, 3) at each corner: the mean over the faces at the vertex on the same smooth
    surface.
    """
    count = len(vertex)
    _, number = np.unique(vertex, return_inverse=True)
    incidence = scipy.sparse.csr_matrix((np.ones(count), (np.arange(count), number.ravel())))
    pairs = (incidence @ incidence.T).tocoo()
    cosine = np.einsum("nd,nd->n", normals[pairs.row], normals[pairs.col])
    smooth = cosine > np.cos(np.radians(MOST_ANGLE))
    share = weights[pairs.col] * smooth
    mean = scipy.sparse.csr_matrix((share, (pairs.row, pairs.col)), shape=(count, count)) @ normals
    return np.asarray(mean / np.linalg.norm(mean, axis=1, keepdims=True))


def _areas(x: Array) -> Array:
    """Areas of faces (F, v, 3); lengths of segments."""
    if x.shape[1] == 2:
        return np.asarray(np.linalg.norm(x[:, 1] - x[:, 0], axis=1))
    first = x[:, 1] - x[:, 0]
    second = x[:, -1] - x[:, 0]
    if x.shape[1] == 4:
        first = x[:, 2] - x[:, 0]
        second = x[:, 3] - x[:, 1]
    return np.asarray(np.linalg.norm(np.cross(first, second), axis=1) / 2)


def layers(part: MeshedStructure) -> tuple[Array, float]:
    """The layers between the faces of this rank and the curved surface that they approximate.

    Returns (volumes (F,) [m³] or, in the plane, areas [m²], negative where the mesh has too much;
    mass of the layers over that of the structure).
    """
    gap, area = mean_gaps(part.faces)
    volumes = gap * area
    heaviness = [material.rho * depth(material) for material, _ in part.parts]
    number = part.part_of_cells()[part.faces.cells]
    mass = part.comm.allreduce(float(volumes @ np.array(heaviness)[number]))
    return volumes, mass / part.total_mass


def depth(material: Material) -> float:
    """Thickness of a plane material; 1 for others, whose volumes contain it."""
    if getattr(material, "plane", None):
        return float(material.thickness)
    return 1.0
