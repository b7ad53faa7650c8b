"""The faces of a part at which impacts are possible: the outer facets of a solid, the cells of a
shell.

Both are treated in the same way.
"""

from __future__ import annotations

from dataclasses import dataclass, fields
from functools import cached_property

import numpy as np
from mpi4py import MPI

from antiosc.base._types import Array, IntArray
from antiosc.fem.mesh.entities import Entities
from antiosc.fem.mesh.mesh import Mesh, clamped, excess, near, projected
from antiosc.fem.platform import compat

#: Faces whose normals differ by less than this cosine lie on one side of an edge.
SAME_FACE = 0.5
#: A site that lies this share of a face's size from it lies on its edge.
AT_EDGE = 0.25
#: Faces touch a point within this share of their size; normals that differ by less are equal.
TOUCH, LEVEL = 1e-6, 1e-6
#: Reference coordinates may lie this far outside a face that still holds the point (rounding).
OUTSIDE_FACE = 1e-8
#: On the plane that touches a curved face, the foot of a point of the face may lie outside by this
#: times the face's bend (reference lengths).
NEARLY = 5.0
#: A face is flat that bends by less than this share of its size.
STRAIGHT = 1e-9
#: The face whose normal points most along this is taken where faces are equal, on all ranks alike.
OBLIQUE = np.array([0.43, 0.59, 0.68])


@dataclass(frozen=True, eq=False)
class Contact:
    """Data of the surface at P sites, equal on all ranks.

    Attributes
    ----------
    normals : (P, 3) unit normals, against the direction of impact.
    depth : (P,) distance of the sites from the surface [m]; inf beyond the radius.
    smallest, largest : (P,) sizes of the faces under the patch [m]; inf and -inf if there is none.
    label : (P,) least label of the faces at the site; 0 if there is none.
    rise : (P,) how far the vertices of these faces lie from the tangent plane, at most [m].
    """

    normals: Array
    depth: Array
    smallest: Array
    largest: Array
    rise: Array
    label: IntArray

    def of(self, which: IntArray) -> Contact:
        """Some of the sites."""
        return Contact(*(getattr(self, one.name)[which] for one in fields(self)))


class Faces(Entities):
    """Faces of one rank; `facets` (F,) are the numbers of the facets, of the cells on sheets."""

    def __init__(self, mesh: Mesh, sheet: bool) -> None:
        self.sheet = sheet
        if sheet:
            self.facets: IntArray = np.arange(
                compat.cell_map(mesh.dolfinx).size_local, dtype=np.int32
            )
        else:
            self.facets = np.sort(compat.exterior_facets(mesh.dolfinx))
        super().__init__(mesh, mesh.tdim if sheet else mesh.tdim - 1, self.facets)

    def across(self, face: IntArray, xi: Array) -> tuple[Array, Array]:
        """(points, unit normals (n, 3)) at ξ in faces: outward on solids."""
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

    @cached_property
    def sizes(self) -> Array:
        """Mean length of the sides (F,) [m]."""
        around = [0, 1, 3, 2] if self.corners.shape[1] == 4 else list(range(self.corners.shape[1]))
        side = self.corners[:, around] - np.roll(self.corners[:, around], 1, axis=1)
        return np.asarray(np.linalg.norm(side, axis=2).mean(axis=1))

    def contact(self, points: Array, directions: Array, radii: Array, labels: IntArray) -> Contact:
        """Data of the surface at sites (P, 3) with unit directions of impact (P, 3).

        On an edge the face whose normal is most opposite to the direction is taken. `labels` (F,)
        are numbers of the faces of this rank, `radii` (P,) the search radii.
        """
        comm, count = self.mesh.comm, len(points)
        mean = self.sizes
        face, site, normal, gap = self._feet(points, radii)
        depth = _least(comm, gap, site, count)
        facing = np.einsum("nd,nd->n", normal, directions[site])
        if self.sheet:
            turn = np.where(np.abs(facing) > LEVEL, facing, normal @ OBLIQUE) > 0
            normal[turn], facing[turn] = -normal[turn], -facing[turn]
        best = np.flatnonzero(gap <= depth[site] + AT_EDGE * mean[face])
        for measure in (facing, normal @ OBLIQUE):  # the second decides between equals
            least = _least(comm, measure[best], site[best], count)
            best = best[measure[best] <= least[site[best]] + LEVEL]
        first = _mean(comm, normal[best], site[best], count)
        same = np.flatnonzero(np.einsum("nd,nd->n", normal, first[site]) > SAME_FACE)
        face, site, normal, gap = face[same], site[same], normal[same], gap[same]
        here = gap <= _least(comm, gap, site, count)[site] + TOUCH * mean[face]
        normals = _mean(comm, normal[here], site[here], count)
        label = _least(comm, labels[face[here]].astype(float), site[here], count)
        height = np.einsum("nvd,nd->nv", self.corners[face] - points[site, None], normals[site])
        return Contact(
            normals,
            depth,
            _least(comm, mean[face], site, count),
            -_least(comm, -mean[face], site, count),
            -_least(comm, -np.abs(height).max(axis=1, initial=0.0), site, count),
            np.where(np.isfinite(label), label, 0).astype(int),
        )

    def _feet(self, points: Array, radii: Array) -> tuple[IntArray, IntArray, Array, Array]:
        """(face, point, unit normal, distance) of the faces of this rank near each point."""
        face, point = near(self.centres, self.radii + radii.max(initial=0.0), points)
        xi = projected(
            lambda k, xi: self.at(face[k], xi), points[point], self.middle[face], affine=self.affine
        )
        x, normal = self.across(face, clamped(xi, self.simplex))
        gap = np.linalg.norm(x - points[point], axis=1)
        inside = gap <= radii[point]
        return face[inside], point[inside], normal[inside], gap[inside]

    def along(self, points: Array, normals: Array, rise: float) -> tuple[IntArray, Array, Array]:
        """Points (n, 3) projected along unit normals (n, 3) onto the surface, at most by `rise`
        [m].

        Returns (face, ξ, distance), the distance inf where no face of this rank lies there.
        """
        face, distance = np.zeros(len(points), dtype=int), np.full(len(points), np.inf)
        xi = np.zeros((len(points), self.dim))
        item, point = near(self.centres, self.radii + rise, points)
        found = self._on_plane(item, points[point], normals[point])
        bend = self.bend[item]
        close = excess(found, self.simplex) <= OUTSIDE_FACE + NEARLY * bend
        item, point, found = item[close], point[close], found[close]
        bent = np.flatnonzero(bend[close] > 0)
        found[bent] = projected(
            lambda k, xi: self.at(item[bent[k]], xi),
            points[point[bent]],
            found[bent],
            affine=False,
            along=normals[point[bent]],
        )
        inside = excess(found, self.simplex) <= OUTSIDE_FACE
        item, point, found = item[inside], point[inside], found[inside]
        x, normal = self.across(item, found)
        off = np.abs(np.einsum("nd,nd->n", x - points[point], normals[point]))
        cosine = np.einsum("nd,nd->n", normal, normals[point])
        cosine = np.abs(cosine) if self.sheet else cosine
        on = (cosine > SAME_FACE) & (off <= rise)
        item, point, found, off = item[on], point[on], found[on], off[on]
        order = np.lexsort((-item, -off, point))  # the nearest, then the first, is written last
        face[point[order]], xi[point[order]] = item[order], found[order]
        distance[point[order]] = off[order]
        return face, xi, distance

    def _on_plane(self, face: IntArray, points: Array, normals: Array) -> Array:
        """ξ (n, d) of points brought along normals onto the planes that touch faces in the middle.

        For a straight side of a plane part the normals lie in the plane of the part.
        """
        x, J = self.tangents
        gap, first = points - x[face], J[face, :, 0]
        if self.dim == 1:
            side = np.column_stack([-normals[:, 1], normals[:, 0]])
            step = _dot(gap[:, :2], side) / _nonzero(_dot(first[:, :2], side))
            return np.asarray(self.middle[face] + step[:, None])
        second = J[face, :, 1]
        # gap = a t1 + b t2 + s n
        volume = _nonzero(_dot(np.cross(first, second), normals))
        a = _dot(np.cross(gap, second), normals) / volume
        b = _dot(np.cross(first, gap), normals) / volume
        return np.asarray(self.middle[face] + np.column_stack([a, b]))

    @cached_property
    def tangents(self) -> tuple[Array, Array]:
        """(points (F, 3), derivatives (F, 3, d)) at the middles of the faces."""
        return self.at(np.arange(len(self.facets)), self.middle)

    @cached_property
    def bend(self) -> Array:
        """Largest distance of each face from its tangent plane in the middle, over its size
        (F,)."""
        every = np.arange(len(self.facets))
        bend = np.zeros(len(every))
        if self.affine:
            return bend
        x, J = self.tangents
        for corner in self._lattice():
            xi = np.tile(corner, (len(every), 1))
            straight = x + np.einsum("nxd,nd->nx", J, xi - self.middle)
            off = np.linalg.norm(self.at(every, xi)[0] - straight, axis=1)
            bend = np.maximum(bend, off / self.sizes)
        return np.where(bend > STRAIGHT, bend, 0.0)

    def _lattice(self) -> Array:
        """Corners and mid-sides (n, d) of the reference face."""
        steps = np.array([0.0, 0.5, 1.0])
        grid = np.stack(np.meshgrid(*[steps] * self.dim), axis=-1).reshape(-1, self.dim)
        return np.asarray(grid[grid.sum(axis=1) <= 1] if self.simplex else grid)


def _dot(a: Array, b: Array) -> Array:
    return np.asarray((a * b).sum(axis=1))


def _nonzero(values: Array) -> Array:
    """Divisors without zeros: a face parallel to the normal has no point of the patch."""
    return np.asarray(np.where(values == 0, np.finfo(float).tiny, values))


def _least(comm: MPI.Comm, values: Array, site: IntArray, count: int) -> Array:
    """Least value of each site (count,) over all ranks; inf where there is none."""
    least, result = np.full(count, np.inf), np.empty(count)
    np.minimum.at(least, site, values)
    comm.Allreduce(least, result, op=MPI.MIN)
    return result


def _mean(comm: MPI.Comm, vectors: Array, site: IntArray, count: int) -> Array:
    """Unit vectors (count, 3) along the sums of each site's vectors over all ranks."""
    total = np.zeros((count, 3))
    np.add.at(total, site, vectors)
    total = np.asarray(comm.allreduce(total))
    size = np.linalg.norm(total, axis=1, keepdims=True)
    return total / np.where(size > 0, size, 1.0)
