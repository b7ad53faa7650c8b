"""Faces or edges of a part that are tied, with their geometry in the assembly."""

from __future__ import annotations

from functools import cached_property

import basix
import numpy as np
import scipy.sparse

from antiosc.base._types import Array, IntArray
from antiosc.fem.assembly.layout import Sparse
from antiosc.fem.mesh.entities import Entities, largest
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
    def centres(self) -> Array:
        """Middles of the corners (F, 3) [m]."""
        return np.asarray(self.corners.mean(axis=1))

    @cached_property
    def sizes(self) -> Array:
        """Radius (F,) of a ball around the middle that holds the face [m]."""
        ball = np.linalg.norm(self.corners - self.centres[:, None], axis=2).max(axis=1)
        return np.asarray(ball * (1.0 if self.affine else 1.3))

    @cached_property
    def normals(self) -> Array:
        """Unit normals (F, 3) of faces, unit tangents of edges, at the middle."""
        _, J = self.at(np.arange(len(self)), self.middle)
        across = np.cross(J[:, :, 0], J[:, :, 1]) if self.dim == 2 else J[:, :, 0]
        return np.asarray(across / np.linalg.norm(across, axis=1, keepdims=True))

    @cached_property
    def outward(self) -> Array | None:
        """Unit vectors (F, 3) across the facets, out of the part; None where it has no outside."""
        part = self.member.part
        if not part.kind.outside or self.dim != part.mesh.tdim - 1:
            return None
        nodes = compat.geometry_nodes(part.mesh.dolfinx)[self.cells]
        away = self.centres - self.member.vertices[nodes].mean(axis=1)
        n = self.normals  # of edges the tangents
        along = np.einsum("fc,fc->f", away, n)[:, None] * n
        across = along if self.dim == 2 else away - along
        return np.asarray(across / np.linalg.norm(across, axis=1, keepdims=True))

    @property
    def is_edge_of_sheet(self) -> bool:
        """Whether these are edges of the cells of a shell."""
        return self.dim == 1 and self.member.part.kind.sheet

    @property
    def degree(self) -> int:
        """Polynomial degree of the displacements on a face, in all directions together."""
        space = self.member.part.form.space
        path = self.member.part.form.components["x"]
        own = int(compat.subspace(space, path).element.basix_element.degree)
        return own if self.simplex else 2 * own

    def rule(self, pieces: int = 1) -> tuple[IntArray, Array, Array]:
        """(face, ξ, weight [m or m²]) of a rule for products of functions on all faces.

        `pieces`: into which each edge is divided.
        """
        shape = ("interval", "triangle" if self.simplex else "quadrilateral")[self.dim - 1]
        xi, w = basix.make_quadrature(getattr(basix.CellType, shape), 2 * self.degree)
        if pieces > 1:
            xi = ((np.arange(pieces)[:, None] + np.ravel(xi)) / pieces).reshape(-1, 1)
            w = np.tile(w, pieces) / pieces
        face = np.repeat(np.arange(len(self)), len(w))
        at = np.tile(np.asarray(xi).reshape(len(w), self.dim), (len(self), 1))
        _, J = self.at(face, at)
        size = np.sqrt(np.linalg.det(np.einsum("nxd,nxe->nde", J, J)))
        return face, at, size * np.tile(w, len(self))

    @cached_property
    def measure(self) -> float:
        """Area or length, m² or m."""
        return float(self.rule()[2].sum())

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
