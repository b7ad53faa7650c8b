"""Tied faces or edges of two parts, and their overlap for meshes that do not match."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import basix
import numpy as np
import scipy.sparse

from antiosc.base._types import Array, BoolArray, IntArray
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

    @cached_property
    def outward(self) -> Array | None:
        """Unit vectors (F, 3) normal to the facets, outward; None where the part has no outside."""
        part = self.member.part
        if not part.kind.outside or self.dim != part.mesh.tdim - 1:
            return None
        nodes = compat.geometry_nodes(part.mesh.dolfinx)[self.cells]
        from_interior = self.centres - self.member.vertices[nodes].mean(axis=1)
        n = self.normals  # of edges the tangents
        normal_part = np.einsum("fc,fc->f", from_interior, n)[:, None] * n
        directions = normal_part if self.dim == 2 else from_interior - normal_part
        return np.asarray(directions / np.linalg.norm(directions, axis=1, keepdims=True))

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

        `pieces`: number of pieces into which each edge is divided.
        """
        shape = ("interval", "triangle" if self.simplex else "quadrilateral")[self.dim - 1]
        xi, w = basix.make_quadrature(getattr(basix.CellType, shape), 2 * self.degree)
        if pieces > 1:
            xi = ((np.arange(pieces)[:, None] + np.ravel(xi)) / pieces).reshape(-1, 1)
            w = np.tile(w, pieces) / pieces
        face = np.repeat(np.arange(len(self)), len(w))
        xi_of_faces = np.tile(np.asarray(xi).reshape(len(w), self.dim), (len(self), 1))
        _, J = self.at(face, xi_of_faces)
        size = np.sqrt(np.linalg.det(np.einsum("nxd,nxe->nde", J, J)))
        return face, xi_of_faces, size * np.tile(w, len(self))

    @cached_property
    def measure(self) -> float:
        """Total length or area, m or m²."""
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


#: Faces whose normals have a smaller cosine do not lie on each other.
FACING = 0.5
#: Fraction of a face's area below which a common polygon is rounding.
LEAST_OVERLAP = 1e-10
#: Pieces of an edge with a rule each: functions of the faces have kinks along it.
RULE_PIECES = 4
#: A point may lie this far outside of the reference face (curved faces do not cover each other).
OUTSIDE = 0.1


@dataclass(frozen=True, eq=False)
class Overlap:
    """n quadrature points on the intersection of two surfaces."""

    face: tuple[IntArray, IntArray]  # (n,), (n,) face of the first and of the second side
    xi: tuple[Array, Array]  # (n, dim), (n, dim) coordinates in these
    x: tuple[Array, Array]  # (n, 3), (n, 3) points of both sides [m]
    weight: Array  # (n,) [m or m²]

    def exchanged(self) -> Overlap:
        """The overlap with its two sides exchanged."""
        f, g = self.face
        xi, eta = self.xi
        x, y = self.x
        return Overlap((g, f), (eta, xi), (y, x), self.weight)

    def only(self, keep: BoolArray) -> Overlap:
        """The overlap restricted to the points in the mask `keep`."""
        f, g = self.face
        xi, eta = self.xi
        x, y = self.x
        sides = (f[keep], g[keep]), (xi[keep], eta[keep]), (x[keep], y[keep])
        return Overlap(*sides, self.weight[keep])


def overlap(first: Facets, second: Facets, gap: float) -> Overlap:
    """The intersection of two sets of faces, or of edges, at most `gap` [m] apart."""
    first_faces, second_faces = pairs_within(
        second.centres, second.radii + first.radii.max() + gap, first.centres
    )[::-1]
    reach = first.radii[first_faces] + second.radii[second_faces] + gap
    in_reach = (
        np.linalg.norm(first.centres[first_faces] - second.centres[second_faces], axis=1) <= reach
    )
    facing = (
        np.abs(np.einsum("nd,nd->n", first.normals[first_faces], second.normals[second_faces]))
        > FACING
    )
    first_faces = first_faces[in_reach & facing]
    second_faces = second_faces[in_reach & facing]
    degree = first.degree + max(first.degree, second.degree)
    if first.dim == 2:
        pair, points, weight = _face_overlap(first, second, first_faces, second_faces, degree)
        normals = first.normals[first_faces[pair]]
    else:
        pair, points, weight = _edge_overlap(first, second, first_faces, second_faces, degree)
        normals = None
    face = first_faces[pair], second_faces[pair]
    sides = [
        _coordinates(side, faces_of_side, points, normals)
        for side, faces_of_side in zip((first, second), face, strict=True)
    ]
    (xi_1, x_1, in_1), (xi_2, x_2, in_2) = sides
    common = Overlap(face, (xi_1, xi_2), (x_1, x_2), weight)
    distances = np.linalg.norm(x_1 - x_2, axis=1)
    return common.only(in_1 & in_2 & (distances <= gap))


def on_faces(edges: Facets, faces: Facets, gap: float) -> Overlap:
    """Quadrature points of edges with the nearest points of faces, at most `gap` [m] away."""
    edge, xi, weight = edges.rule(RULE_PIECES)
    x = edges.at(edge, xi)[0]
    face, eta, y = closest(faces, x, gap)
    common = Overlap((edge, face), (xi, eta), (x, y), weight)
    return common.only(np.linalg.norm(x - y, axis=1) <= gap)


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


def _coordinates(
    side: Facets, face: IntArray, points: Array, along: Array | None
) -> tuple[Array, Array, BoolArray]:
    """(ξ, projected points, mask of those inside their face) of points projected onto faces."""
    xi = projected(
        lambda k, xi: side.at(face[k], xi),
        points,
        side.middle[face],
        affine=side.affine,
        along=along,
    )
    in_face = excess(xi, side.simplex) <= OUTSIDE
    xi = np.where(excess(xi, side.simplex)[:, None] > 1e-9, clamped(xi, side.simplex), xi)
    return xi, side.at(face, xi)[0], in_face


def _edge_overlap(
    first: Facets, second: Facets, first_faces: IntArray, second_faces: IntArray, degree: int
) -> tuple[IntArray, Array, Array]:
    """(pair, points, weights) of quadrature on the common segments of pairs of edges."""
    start = first.corners[first_faces, 0]
    end = first.corners[first_faces, 1]
    length = np.linalg.norm(end - start, axis=1)
    axis = (end - start) / length[:, None]
    s = np.einsum("nvd,nd->nv", second.corners[second_faces] - start[:, None], axis)
    low = np.maximum(s.min(axis=1), 0.0)
    high = np.minimum(s.max(axis=1), length)
    common = np.flatnonzero(high - low > LEAST_OVERLAP * length)
    t, w = np.polynomial.legendre.leggauss(degree // 2 + 1)
    t = (t + 1) / 2
    w = w / 2
    size = (high - low)[common]
    positions = low[common, None] + size[:, None] * t
    points = start[common, None] + positions[..., None] * axis[common, None]
    weight = size[:, None] * w
    return np.repeat(common, len(w)), points.reshape(-1, 3), weight.ravel()


def _face_overlap(
    first: Facets, second: Facets, first_faces: IntArray, second_faces: IntArray, degree: int
) -> tuple[IntArray, Array, Array]:
    """(number of the pair, points, weights) of quadrature on the common polygons of pairs of faces.

    The polygons lie in the planes of the faces of `first`.
    """
    normal = first.normals[first_faces]
    smallest_axis = np.argmin(np.abs(normal), axis=1)
    e1 = np.cross(normal, np.eye(3)[smallest_axis])
    e1 /= np.linalg.norm(e1, axis=1, keepdims=True)
    axes = np.stack([e1, np.cross(normal, e1)], axis=1)
    centre = first.centres[first_faces]
    flat = [
        np.einsum("nad,nvd->nva", axes, side.corners[faces_of_side] - centre[:, None])
        for side, faces_of_side in ((first, first_faces), (second, second_faces))
    ]
    polygon, count = clipped(_counterclockwise(flat[1]), _counterclockwise(flat[0]))
    area = _area(flat[0])
    xi, w = basix.make_quadrature(basix.CellType.triangle, max(degree, 1))
    pairs = []
    points = []
    weights = []
    for k in range(1, polygon.shape[1] - 1):
        a = polygon[:, 0]
        b = polygon[:, k]
        c = polygon[:, k + 1]
        doubled_area = _cross(b - a, c - a)
        overlapping = np.flatnonzero((count > k + 1) & (doubled_area > LEAST_OVERLAP * area))
        u = xi[:, 0]
        v = xi[:, 1]
        parameters = (
            a[overlapping, None]
            + u[None, :, None] * (b - a)[overlapping, None]
            + v[None, :, None] * (c - a)[overlapping, None]
        )
        x = centre[overlapping, None] + np.einsum("nqa,nad->nqd", parameters, axes[overlapping])
        pairs.append(np.repeat(overlapping, len(w)))
        points.append(x.reshape(-1, 3))
        weights.append((doubled_area[overlapping, None] * np.asarray(w)).ravel())
    if not pairs:
        return np.zeros(0, dtype=int), np.zeros((0, 3)), np.zeros(0)
    return np.concatenate(pairs), np.vstack(points), np.concatenate(weights)


def clipped(polygons: Array, windows: Array) -> tuple[Array, IntArray]:
    """Convex polygons (n, v, 2) cut by convex windows (n, w, 2), both counterclockwise.

    Returns (vertices (n, v + w, 2), number of vertices of each (n,)).
    Sutherland and Hodgman, *Comm. ACM* 17 (1974).
    """
    n, v, _ = polygons.shape
    max_corners = v + windows.shape[1]
    vertices = np.zeros((n, max_corners, 2))
    vertices[:, :v] = polygons
    count = np.full(n, v)
    for k in range(windows.shape[1]):
        start = windows[:, k]
        end = windows[:, (k + 1) % windows.shape[1]]
        index = np.arange(max_corners)
        is_vertex_row = index < count[:, None]
        previous_vertex = np.where(index == 0, np.maximum(count - 1, 0)[:, None], index - 1)
        previous_points = np.take_along_axis(vertices, previous_vertex[..., None], axis=1)
        edge = (end - start)[:, None]
        side = _cross(edge, vertices - start[:, None])
        other_side = _cross(edge, previous_points - start[:, None])
        crossing = is_vertex_row & ((side >= 0) != (other_side >= 0))
        step = other_side - side
        share = np.divide(other_side, step, out=np.zeros_like(step), where=step != 0)
        crossings = previous_points + share[..., None] * (vertices - previous_points)
        candidates = np.stack([crossings, vertices], axis=2).reshape(n, 2 * max_corners, 2)
        is_vertex = np.stack([crossing, is_vertex_row & (side >= 0)], axis=2).reshape(
            n, 2 * max_corners
        )
        order = np.argsort(~is_vertex, axis=1, kind="stable")[:, :max_corners]
        vertices = np.take_along_axis(candidates, order[..., None], axis=1)
        count = np.minimum(is_vertex.sum(axis=1), max_corners)
    return vertices, count


def _counterclockwise(polygons: Array) -> Array:
    """Convex polygons (n, v, 2) with their corners in counterclockwise order."""
    return np.where((_area(polygons) < 0)[:, None, None], polygons[:, ::-1], polygons)


def _area(polygons: Array) -> Array:
    """Signed areas (n,)."""
    return np.asarray(_cross(polygons, np.roll(polygons, -1, axis=1)).sum(axis=1) / 2)


def _cross(a: Array, b: Array) -> Array:
    return np.asarray(a[..., 0] * b[..., 1] - a[..., 1] * b[..., 0])
