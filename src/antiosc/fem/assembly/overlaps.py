"""Tied faces or edges of two parts, and the points of one that lie on the other."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import basix
import numpy as np
import scipy.sparse

from antiosc.base._types import Array, IntArray
from antiosc.fem.assembly.layout import Sparse
from antiosc.fem.mesh.closest import clamped, excess, pairs_within, projected
from antiosc.fem.mesh.surface import Entities, largest
from antiosc.fem.platform import compat
from antiosc.fem.structure.meshed import Member


class Facets(Entities):
    """Entities of the largest dimension in a group of a part, in the assembly.

    Attributes
    ----------
    member : the part.
    dim : 0 points, 1 edges, 2 faces.
    corners : (F, v, 3) in order around each [m].
    """

    def __init__(self, member: Member, group: str) -> None:
        self.member = member
        super().__init__(member.part.mesh, *largest(member.part.mesh, group))
        corners = member.vertices[self.vertices]
        self.corners = corners if self.simplex else corners[:, [0, 1, 3, 2]]

    @cached_property
    def normals(self) -> Array:
        """Unit normals (F, 3) of faces, unit tangents of edges, at the middle."""
        _, J = self.at(np.arange(len(self)), self.middle)
        raw_normals = np.cross(J[:, :, 0], J[:, :, 1]) if self.dim == 2 else J[:, :, 0]
        return np.asarray(raw_normals / np.linalg.norm(raw_normals, axis=1, keepdims=True))

    @property
    def is_edge_of_sheet(self) -> bool:
        """Whether the facets are edges of shell cells."""
        return self.dim == 1 and self.member.part.kind.sheet

    @property
    def degree(self) -> int:
        """Total polynomial degree of the displacements on a face."""
        degree = self.member.part.form.degree
        return degree if self.simplex else 2 * degree

    def rule(self, pieces: int = 1) -> tuple[IntArray, Array, Array]:
        """(face, ξ, weight [m or m²]) of a quadrature for products of shape functions on all faces.

        `pieces`: number of pieces into which each edge of a face is divided.
        """
        shape = ("interval", "triangle" if self.simplex else "quadrilateral")[self.dim - 1]
        xi, w = basix.make_quadrature(getattr(basix.CellType, shape), 2 * self.degree)
        xi = np.asarray(xi).reshape(len(w), self.dim)
        lattice = np.indices((pieces,) * self.dim).reshape(self.dim, -1).T[:, None]
        if shape == "triangle":  # upright pieces, and inverted ones between them
            inverted = lattice[lattice.sum(axis=2).ravel() < pieces - 1]
            upright = lattice[lattice.sum(axis=2).ravel() < pieces]
            xi = np.vstack([*(upright + xi), *(inverted + 1 - xi)]) / pieces
        else:
            xi = np.vstack([*(lattice + xi)]) / pieces
        w = np.tile(w, pieces**self.dim) / pieces**self.dim

        face = np.repeat(np.arange(len(self)), len(w))
        xi_of_faces = np.tile(xi, (len(self), 1))
        _, J = self.at(face, xi_of_faces)
        size = np.sqrt(np.linalg.det(np.einsum("nxd,nxe->nde", J, J)))
        return face, xi_of_faces, size * np.tile(w, len(self))

    def at(self, face: IntArray, xi: Array) -> tuple[Array, Array]:
        """(points (n, 3) [m], derivatives (n, 3, dim)) in the assembly at ξ in faces."""
        x, J = super().at(face, xi)
        return self.member.at.placed(x), np.einsum("cx,nxd->ncd", self.member.at.rotation, J)

    def basis(self, face: IntArray, xi: Array) -> Sparse:
        """Values (n, nodes of the part) of the nodes' functions at ξ in faces."""
        form = self.member.part.form
        path = form.components["x"]
        weights = compat.tabulate(form.space, path, self.reference(face, xi))
        weights[np.abs(weights) < 1e-13] = 0.0
        nodes = compat.cell_dofs(form.space, path, self.cells[face]) // self.member.block
        row = np.repeat(np.arange(len(face)), nodes.shape[1])
        shape = len(face), len(self.member.nodes)
        result = scipy.sparse.csr_matrix((weights.ravel(), (row, nodes.ravel())), shape=shape)
        result.eliminate_zeros()
        return result


#: Faces whose normals have a smaller cosine do not lie on each other.
FACING = 0.5
#: Pieces of an edge with a rule each: functions of the leader have kinks within them.
EDGE_PIECES, FACE_PIECES = 4, 3
#: Share of the size of a face by which a point may lie beside the other surface.
BESIDE = 0.02


@dataclass(frozen=True, eq=False)
class Overlap:
    """n quadrature points of a follower, and the nearest points of its leader."""

    face: IntArray  # (n,) of the follower
    xi: Array  # (n, dim) coordinates in it
    x: Array  # (n, 3) [m]
    leader_face: IntArray  # (n,)
    eta: Array  # (n, dim) coordinates in it
    y: Array  # (n, 3) [m]
    weight: Array  # (n,) [m or m²]
    share: float  # of the follower's length or area


def overlap(follower: Facets, leader: Facets, gap: float) -> Overlap:
    """The points of the follower that lie on the leader, at most `gap` [m] away."""
    face, xi, weight = follower.rule(EDGE_PIECES if follower.dim == 1 else FACE_PIECES)
    x = follower.at(face, xi)[0]
    leader_face, eta, y = closest(leader, x, gap)
    lies = np.linalg.norm(x - y, axis=1) <= gap
    if follower.dim == leader.dim:
        n = follower.normals[face]
        lies &= np.abs(np.einsum("nc,nc->n", n, leader.normals[leader_face])) > FACING
        offset = np.where(lies[:, None], x - y, 0.0)
        along = np.linalg.norm(np.einsum("nc,nc->n", offset, n)[:, None] * n, axis=1)
        total = np.linalg.norm(offset, axis=1)
        beside = along if follower.dim == 1 else np.sqrt(np.maximum(total**2 - along**2, 0.0))
        lies &= beside <= BESIDE * follower.radii[face]

    share = float(weight[lies].sum() / weight.sum())
    of_leader = leader_face[lies], eta[lies], y[lies]
    return Overlap(face[lies], xi[lies], x[lies], *of_leader, weight[lies], share)


def closest(faces: Facets, points: Array, reach: float) -> tuple[IntArray, Array, Array]:
    """(face, ξ, point) of the nearest points of faces; the point is infinite beyond `reach`."""
    item, point = pairs_within(faces.centres, faces.radii + reach, points)
    xi = projected(
        lambda k, xi: faces.at(item[k], xi), points[point], faces.middle[item], affine=faces.affine
    )
    xi = np.where(excess(xi, faces.simplex)[:, None] > 0, clamped(xi, faces.simplex), xi)
    x = faces.at(item, xi)[0]
    order = np.argsort(-np.linalg.norm(x - points[point], axis=1), kind="stable")
    face = np.zeros(len(points), dtype=int)
    xi_start = np.zeros((len(points), faces.dim))
    nearest = np.full((len(points), 3), np.inf)
    face[point[order]] = item[order]  # the nearest is written last
    xi_start[point[order]] = xi[order]
    nearest[point[order]] = x[order]
    return face, xi_start, nearest
