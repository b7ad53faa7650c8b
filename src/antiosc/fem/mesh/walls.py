"""Thickness of the walls of a solid, from the faces that lie opposite to each other."""

from __future__ import annotations

from typing import NamedTuple, TypeVar

import numpy as np

from antiosc.base._types import Array, IntArray
from antiosc.fem.mesh import Mesh
from antiosc.fem.mesh.surface import Faces, quadrature
from antiosc.fem.platform import compat
from antiosc.io.neutral import connected

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
    skin = _whole_skin(faces)
    cumulated = np.cumsum(_everywhere(faces, areas))
    shares = (np.arange(POINTS) + 0.5) / POINTS
    chosen = np.unique(np.searchsorted(cumulated, shares * cumulated[-1]))
    depths = [skin.depth(skin.centres[k], int(k)) for k in chosen]
    thickness = float(np.quantile(depths, SHARE, method="higher"))
    return thickness if np.isfinite(thickness) else 0.0


def at_point(faces: Faces, point: Array) -> tuple[float, float]:
    """(thickness of a solid [m], size of the faces [m]) at the face nearest to a point (3,).

    The thickness is inf where nothing is opposite.
    """
    skin = _whole_skin(faces)
    k = int(np.argmin(np.linalg.norm(skin.centres - point, axis=1)))
    return skin.depth(point, k), float(_everywhere(faces, faces.sizes)[k])


class _Skin(NamedTuple):
    """Centres (F, 3), normals (F, 3) and numbers of the bodies (F,) of the faces of all ranks."""

    centres: Array
    normals: Array
    bodies: IntArray

    def depth(self, point: Array, face: int) -> float:
        """Distance [m] from a point of a face along its normal to the nearest opposite face of its
        body; inf without one.
        """
        gap = self.centres - point
        cosine = self.normals @ self.normals[face]
        behind = gap @ self.normals[face] < -TOUCHING * np.abs(gap).max()
        is_opposite = (cosine < OPPOSITE) & behind & (self.bodies == self.bodies[face])
        if not is_opposite.any():
            return np.inf
        distance = np.where(is_opposite, np.linalg.norm(gap, axis=1), np.inf)
        j = int(np.argmin(distance))
        return float(-(gap[j] @ self.normals[j]) / cosine[j])


def _whole_skin(faces: Faces) -> _Skin:
    """The faces of all ranks."""
    centres, normals = (_everywhere(faces, values) for values in (faces.centres, faces.normals))
    return _Skin(centres, normals, _everywhere(faces, _bodies(faces)))


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
