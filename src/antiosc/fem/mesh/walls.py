"""Thickness of the walls of a solid, from the faces that lie opposite to each other."""

from __future__ import annotations

import numpy as np

from antiosc.base._types import Array
from antiosc.fem.mesh import Mesh
from antiosc.fem.mesh.surface import Faces, quadrature

#: Points of the surface at which the thickness is measured; each has the same share of its area.
POINTS = 64
#: Cosine of the normals of two opposite faces, at most.
OPPOSITE = -0.5
#: Share of the surface over walls that are thinner than the result: edges of holes and chamfers,
#: which are thin too, have less.
SHARE = 0.25


def wall_thickness(mesh: Mesh) -> float:
    """Thickness [m] of the walls of a solid: a quarter of its surface has thinner ones.

    At a point of the surface it is the distance, along the normal, to the plane of the nearest
    opposite face. 0.0 for a mesh in the plane, and where nothing is opposite.
    """
    if mesh.tdim != 3:
        return 0.0
    faces = Faces(mesh, sheet=False)
    points = quadrature(mesh, 2, faces.facets, 0)
    areas = np.bincount(points.entity, points.weight, len(faces.facets))
    gathered = mesh.comm.allgather((faces.centres, faces.normals, areas))
    centres, normals, areas = (np.concatenate(rows) for rows in zip(*gathered, strict=True))
    cumulated = np.cumsum(areas)
    shares = (np.arange(POINTS) + 0.5) / POINTS
    chosen = np.unique(np.searchsorted(cumulated, shares * cumulated[-1]))
    depths = [_depth(centres, normals, k) for k in chosen]
    thickness = float(np.quantile(depths, SHARE, method="higher"))
    return thickness if np.isfinite(thickness) else 0.0


def _depth(centres: Array, normals: Array, k: int) -> float:
    """Distance [m] from the centre of face k along its normal to the opposite face; inf: none."""
    gap = centres - centres[k]
    cosine = normals @ normals[k]
    is_opposite = (cosine < OPPOSITE) & (gap @ normals[k] < 0)
    if not is_opposite.any():
        return np.inf
    distance = np.where(is_opposite, np.linalg.norm(gap, axis=1), np.inf)
    j = int(np.argmin(distance))
    return float(-(gap[j] @ normals[j]) / cosine[j])
