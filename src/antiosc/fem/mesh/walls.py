"""Thickness of the walls of a solid, from the faces that lie opposite to each other."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import TypeVar

import numpy as np

from antiosc.base._types import Array, IntArray
from antiosc.fem.mesh import Mesh
from antiosc.fem.mesh.surface import Faces, quadrature
from antiosc.fem.platform import compat
from antiosc.io.neutral import connected

#: Points of the surface at which the thickness is measured; each has the same share of its area.
#: In four meshes of a bracket of 4000 to 24 000 cells 64 points had 1.20, 1.20, 2.05 and 2.84 mm,
#: 128 points 1.20 or 2.20 mm, and 256 points 1.20 mm in all.
OF_SURFACE = 256
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
    skin = _whole_skin(faces)
    centres = skin.centres
    chosen = np.unique(_evenly(_everywhere(faces, areas), OF_SURFACE))
    depths = [skin.depth(centres[k], int(k)) for k in chosen]
    thickness = float(np.quantile(depths, SHARE, method="higher"))
    return thickness if np.isfinite(thickness) else 0.0


def _evenly(areas: Array, count: int) -> IntArray:
    """Numbers (count,) of the faces of these areas at points that each have the same share."""
    cumulated = np.cumsum(areas)
    shares = (np.arange(count) + 0.5) / count
    return np.searchsorted(cumulated, shares * cumulated[-1])


@dataclass(frozen=True)
class _Skin:
    """Corners in order (F, v, 3), normals (F, 3) and numbers of the bodies (F,) of the faces of all
    ranks.
    """

    corners: Array
    normals: Array
    bodies: IntArray

    @cached_property
    def centres(self) -> Array:
        """Middles of the corners (F, 3)."""
        return np.asarray(self.corners.mean(axis=1))

    def depth(self, point: Array, face: int) -> float:
        """Distance [m] from a point of a face along its normal to the nearest opposite face of its
        body; inf without one.
        """
        gap = self.centres - point
        cosine = self.normals @ self.normals[face]
        behind = gap @ self.normals[face] < -TOUCHING * np.abs(gap).max()
        inside = np.einsum("fd,fd->f", gap, self.normals) > 0  # of the plane of the opposite face
        is_opposite = (cosine < OPPOSITE) & behind & inside
        is_opposite &= self.bodies == self.bodies[face]
        opposite: IntArray = np.flatnonzero(is_opposite)
        if not opposite.size:
            return np.inf
        j = int(opposite[np.argmin(np.linalg.norm(gap[opposite], axis=1))])
        return float(-(gap[j] @ self.normals[j]) / cosine[j])


def _whole_skin(faces: Faces) -> _Skin:
    """The faces of all ranks."""
    corners = _everywhere(faces, faces.corners)
    if corners.shape[1] == 4:
        corners = corners[:, [0, 1, 3, 2]]
    return _Skin(corners, _everywhere(faces, faces.normals), _everywhere(faces, _bodies(faces)))


Values = TypeVar("Values", Array, IntArray)


def _everywhere(faces: Faces, values: Values) -> Values:
    """Values of the faces of all ranks."""
    return np.concatenate(faces.mesh.comm.allgather(values))


def _bodies(faces: Faces) -> IntArray:
    """Number (F,) of the body of each face of this rank: cells that share nodes are one body.

    In decks pieces in contact overlap where flat faces stand for a curved surface: a face of one is
    no wall of the other.
    """
    mesh = faces.mesh
    geometry = mesh.dolfinx.geometry
    number = np.asarray(
        geometry.index_map().local_to_global(np.arange(len(geometry.x), dtype=np.int32))
    )
    owned = compat.cell_map(mesh.dolfinx).size_local
    corners = number[compat.geometry_nodes(mesh.dolfinx)[:owned, : len(mesh.geometry.corners)]]
    corners = np.concatenate(mesh.comm.allgather(corners))
    body = connected([corners], int(geometry.index_map().size_global))
    return body[number[faces.vertices[:, 0]]]
