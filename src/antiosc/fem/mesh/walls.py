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
#: Distance behind a face, over the size of the part, up to which an opposite face touches it, as
#: those of pieces in contact do: their nodes in decks agree to the digits that are written.
TOUCHING = 1e-5
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
    areas = np.zeros(len(faces.facets))
    np.add.at(areas, points.entity, points.weight)
    centres, normals, areas = _gathered(faces, areas)
    cumulated = np.cumsum(areas)
    shares = (np.arange(POINTS) + 0.5) / POINTS
    chosen = np.unique(np.searchsorted(cumulated, shares * cumulated[-1]))
    depths = [_depth(centres, normals, centres[k], normals[k]) for k in chosen]
    thickness = float(np.quantile(depths, SHARE, method="higher"))
    return thickness if np.isfinite(thickness) else 0.0


def at_point(faces: Faces, point: Array) -> tuple[float, float]:
    """(thickness of a solid [m], size of the faces [m]) at the face nearest to a point (3,).

    The thickness is inf where nothing is opposite.
    """
    centres, normals, sizes = _gathered(faces, faces.sizes)
    k = int(np.argmin(np.linalg.norm(centres - point, axis=1)))
    return _depth(centres, normals, point, normals[k]), float(sizes[k])


def _gathered(faces: Faces, values: Array) -> tuple[Array, Array, Array]:
    """Centres (F, 3), normals (F, 3) and values (F,) of the faces of all ranks."""
    gathered = faces.mesh.comm.allgather((faces.centres, faces.normals, values))
    centres, normals, everywhere = (np.concatenate(rows) for rows in zip(*gathered, strict=True))
    return centres, normals, everywhere


def _depth(centres: Array, normals: Array, point: Array, normal: Array) -> float:
    """Distance [m] from a point of the surface along its normal to the nearest opposite face."""
    gap = centres - point
    cosine = normals @ normal
    is_opposite = (cosine < OPPOSITE) & (gap @ normal < -TOUCHING * np.abs(gap).max())
    if not is_opposite.any():
        return np.inf
    distance = np.where(is_opposite, np.linalg.norm(gap, axis=1), np.inf)
    j = int(np.argmin(distance))
    return float(-(gap[j] @ normals[j]) / cosine[j])
