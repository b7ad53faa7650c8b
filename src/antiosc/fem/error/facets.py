"""Whether flat faces approximate a curved surface, an error that no recovery of strains detects."""

from __future__ import annotations

import numpy as np

from antiosc._types import Array, IntArray
from antiosc.fem import compat
from antiosc.fem.mesh.mesh import Mesh

#: Angles in degrees between neighbouring faces of a curved surface: above rounding, and up to those
#: of seven faces around a hole, the fewest that gmsh makes.
LEAST_ANGLE, MOST_ANGLE = 0.2, 52.0
#: Sides of an exterior facet as positions of its corners.
FACET_SIDES: dict[int, list[tuple[int, ...]]] = {
    2: [(0,), (1,)],
    3: [(0, 1), (0, 2), (1, 2)],
    4: [(0, 1), (0, 2), (1, 3), (2, 3)],
}


def faceted(mesh: Mesh) -> str:
    """A sentence if the exterior of a mesh of straight cells looks like facets of a curved one."""
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
        "for a curved surface; read the geometry with order=2 to have it curved."
    )


def _angles(x: Array, corners: IntArray) -> Array:
    """Angles in degrees between facets (n, corners) that share a side."""
    if not len(corners):
        return np.zeros(0)
    points = x[corners]
    if corners.shape[1] == 2:
        along = points[:, 1] - points[:, 0]
        normals = np.column_stack([-along[:, 1], along[:, 0], 0 * along[:, 0]])
    elif corners.shape[1] == 3:
        normals = np.cross(points[:, 1] - points[:, 0], points[:, 2] - points[:, 0])
    else:
        normals = np.cross(points[:, 3] - points[:, 0], points[:, 2] - points[:, 1])
    normals = normals / np.linalg.norm(normals, axis=1, keepdims=True)
    places = FACET_SIDES[corners.shape[1]]
    sides = np.sort(np.concatenate([corners[:, list(place)] for place in places]), axis=1)
    facet = np.tile(np.arange(len(corners)), len(places))
    order = np.lexsort(sides.T)
    same = (np.diff(sides[order], axis=0) == 0).all(axis=1)
    one, other = facet[order[:-1][same]], facet[order[1:][same]]
    cosine = np.abs(np.einsum("nd,nd->n", normals[one], normals[other]))
    return np.asarray(np.degrees(np.arccos(np.minimum(cosine, 1.0))))
