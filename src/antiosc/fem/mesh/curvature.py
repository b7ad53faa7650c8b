"""Curvature of the surface of a mesh at a point, by a fit to nodes of the surface.

The nodes of a mesh lie on the surface that was meshed; its faces do not. The fit is a polynomial
over the tangent plane. It uses the nodes within a radius that depends on the surface and not on the
cells: a third of the radius of curvature, or more if there are too few nodes. The uncertainty is
the difference from a fit with another radius, and the standard error of the fit.

Faces are parts of one smooth surface across edges at which their normals turn by less than
`SHARP_ANGLE`.
"""

from __future__ import annotations

from dataclasses import dataclass, fields
from functools import cached_property

import numpy as np
import scipy.sparse
from numpy.polynomial.polynomial import polyvander2d
from scipy.linalg import eigh
from scipy.sparse.csgraph import connected_components

from antiosc.base._types import Array, BoolArray, IntArray
from antiosc.base.errors import InputError
from antiosc.engine.contact.curvature import CORNER, CURVED, EDGE, LINE, PLANE, Curvature
from antiosc.fem.mesh import Mesh
from antiosc.fem.mesh.closest import clamped, projected
from antiosc.fem.mesh.surface import Faces

# Measured: fits on a sphere, a cylinder and a torus, cells of a quarter of the radius of curvature
# with straight sides. True curvatures are 20, 33.3, 50 and 12.5 1/m; the fits have 20.0, 33.9, 50.9
# and 12.5, each within its uncertainty. Factors of 2 on the constants below change nothing unless
# stated.
#: Least angle between the normals of two faces whose common edge is a sharp edge of the part
#: [degree].
SHARP_ANGLE = 40.0
#: Radius of the fit over the radius of curvature. With 1/6: 20.1, 33.6 and 50.6, from fewer nodes,
#: which noise of the nodes moves more; with 2/3: 19.8, 33.0 and 49.5, with 1.4 to 4.5 times the
#: uncertainty.
FIT_SHARE = 1 / 3
#: Largest radius of a fit over the size of the part, …
WIDEST = 0.1
#: … and over the size of the faces at the point: half as many change the cylinder by 0.2 %.
FACES_WIDE = 5.0
#: Ratio of the radii of two fits, whose difference is an uncertainty; with 3 it is 1.7 to 8 times
#: as large.
OTHER_SHARE = 1.5
#: Most iterations of the radius of a fit, …
CHOICES = 8
#: … and the relative change that ends them.
SETTLED = 0.1
#: Degrees of the polynomials, …
DEGREES = (4, 2)
#: … and nodes over coefficients that each needs. With 3 the sphere has 20.4, as the degree falls;
#: with 0.75 the fits have 20.0, 33.3 and 50.0, but few spare nodes against their noise.
NODES_EACH = 1.5
#: Singular values below this share of the largest one count as zero.
RANK = 1e-6
#: Least cosine between the normals of the faces in a fit and that of the point, …
LARGEST_TURN = 0.35
#: … and the cosine at which the first fit ends.
STARTS = 0.75
#: Distance of nodes from a plane over the radius of the fit, up to which they lie on it.
ON_PLANE = 1e-6
#: Distance of a middle node from the chord over the length of the side, from which it is curved.
BENT = 1e-6
#: The smaller of the two curvatures counts as zero below these multiples of the error and of the
#: larger one; above the third multiple of the larger one it never does.
NONE = (3.0, 1e-3, 0.2)
#: If a surface turns within a smaller radius by this share of its turn within a larger one, the
#: point lies on an edge.
SAME_TURN = 0.8
#: Relative error of a curvature k by a fit of a circle within a radius r, of degree 2 and of degree
#: 4: these times (k r)^2 and (k r)^4. Measured on spheres and cylinders: 0.25 and 0.07.
CUT_OFF = 0.35, 0.15
#: A fit within a radius r does not resolve a curvature k if k r is above this.
UNRESOLVED = 0.8
#: A sheet is struck on its rim if the direction has less than this cosine to the normal.
RIM = 0.5
#: Faces touch the point within this share of their size.
TOUCH = 1e-6


@dataclass(frozen=True, eq=False)
class Patch:
    """Faces near a point, n of them, equal on all ranks.

    Attributes
    ----------
    numbers : (n, v) numbers of their vertices in the file, around each face.
    corners, middles : (n, v, 3) vertices, and middles of the sides [m].
    normals : (n, v, 3) unit normals at these middles.
    nearest : (n, 3) the point of the face nearest to the given one [m].
    gap : (n,) distance of that point [m].
    """

    numbers: IntArray
    corners: Array
    middles: Array
    normals: Array
    nearest: Array
    gap: Array

    def only(self, which: BoolArray | IntArray) -> Patch:
        """The patch with some of its faces."""
        return Patch(*(getattr(self, member.name)[which] for member in fields(self)))

    @cached_property
    def sides(self) -> Array:
        """Lengths of the sides (n, v) [m]."""
        sides = np.roll(self.corners, -1, axis=1) - self.corners
        return np.asarray(np.linalg.norm(sides, axis=2))

    @cached_property
    def touching(self) -> BoolArray:
        """Mask (n,) of the faces on which the point lies."""
        return np.asarray(self.gap <= self.gap.min() + TOUCH * self.sides.max(axis=1))

    @cached_property
    def pairs(self) -> tuple[IntArray, IntArray]:
        """Pairs of coincident sides, as indices into the n v sides of all faces."""
        ends = np.stack([self.numbers, np.roll(self.numbers, -1, axis=1)], axis=2)
        ends = np.sort(ends.reshape(-1, 2), axis=1)
        _, side = np.unique(ends, axis=0, return_inverse=True)
        order = np.argsort(side.ravel(), kind="stable")
        coincident = np.flatnonzero(np.diff(side.ravel()[order]) == 0)
        return order[coincident], order[coincident + 1]

    def surfaces(self, sheet: bool) -> IntArray:
        """Number (n,) of the smooth surface to which each face belongs."""
        first, second = self.pairs
        count, corner_count = self.numbers.shape
        normals = self.normals.reshape(-1, 3)
        cosine = np.einsum("nd,nd->n", normals[first], normals[second])
        cosine = np.abs(cosine) if sheet else cosine
        smooth = cosine > np.cos(np.radians(SHARP_ANGLE))
        first = first[smooth] // corner_count
        second = second[smooth] // corner_count
        graph = scipy.sparse.coo_matrix((np.ones(len(first)), (first, second)), (count, count))
        return np.asarray(connected_components(graph, directed=False)[1])

    def nodes(self) -> Array:
        """Nodes on the surface (k, 3) [m]: vertices, and mid-side nodes of curved sides."""
        chord = (self.corners + np.roll(self.corners, -1, axis=1)) / 2
        is_curved = np.linalg.norm(self.middles - chord, axis=2) > BENT * self.sides
        points = self.corners.reshape(-1, 3)
        if is_curved.any():
            points = np.concatenate([points, self.middles.reshape(-1, 3)])
        rounded = np.round(points / (TOUCH * self.sides.min()))
        return np.asarray(points[np.unique(rounded, axis=0, return_index=True)[1]])


def curvature(mesh: Mesh, faces: Faces, point: Array, direction: Array | None = None) -> Curvature:
    """Curvature of the surface of a mesh at its point nearest to `point` (3,).

    Parameters
    ----------
    faces : faces of the mesh; for a solid the outer ones.
    direction : (3,) direction of an impact, optional; the normal of a sheet is taken against it.

    Raises
    ------
    InputError
        A mesh of lines, or one in a plane.
    """
    if faces.dim != 2 or mesh.gdim != 3:
        raise InputError(
            "curvature is that of a surface in space, which beams and plane parts do not have: "
            "give the law of the contact."
        )
    nearest_faces = _patch(faces, point)
    touching = nearest_faces.only(nearest_faces.touching)
    normal = _normal(touching, direction, faces.sheet)
    x = touching.nearest.mean(axis=0)
    surfaces = len(np.unique(touching.surfaces(faces.sheet)))
    if surfaces > 1:
        return _sharp(EDGE if surfaces == 2 else CORNER, x, normal)
    towards = normal if direction is None or not faces.sheet else direction
    if abs(float(towards @ normal)) < RIM * float(np.linalg.norm(towards)):
        return _sharp(EDGE, x, normal)

    patch = _patch(faces, point, WIDEST * mesh.extent(), FACES_WIDE)
    label = patch.surfaces(faces.sheet)
    return _from_nodes(patch.only(np.isin(label, label[patch.touching])), x, normal)


def _patch(faces: Faces, point: Array, reach: float = 0.0, wide: float = 1.0) -> Patch:
    """The faces of all ranks near a point.

    They are no farther from it than the nearest face plus `reach` [m], or plus `wide` radii of the
    faces there if that is more.
    """
    comm = faces.mesh.comm
    distances = np.linalg.norm(faces.centres - point, axis=1) - faces.radii
    nearest = comm.allgather(float(distances.min(initial=np.inf)))
    near_faces = np.flatnonzero(distances <= min(nearest) + faces.radii)
    largest = max(comm.allgather(float(faces.radii[near_faces].max(initial=0.0))))
    facets = np.flatnonzero(distances <= min(nearest) + max(reach, wide * largest))
    tensor = np.array([[0.0, 0.0], [1.0, 0.0], [0.0, 1.0], [1.0, 1.0]])
    corner_order = [0, 1, 2] if faces.simplex else [0, 1, 3, 2]
    xi = projected(
        lambda k, xi: faces.at(facets[k], xi),
        np.tile(point, (len(facets), 1)),
        faces.middle[facets],
        affine=faces.affine,
    )
    nearest_points = faces.at(facets, clamped(xi, faces.simplex))[0]
    gap = np.linalg.norm(nearest_points - point, axis=1)

    corner = tensor[corner_order]
    sides = (corner + np.roll(corner, -1, axis=0)) / 2
    values = [faces.across(facets, np.tile(side, (len(facets), 1))) for side in sides]
    middles, normals = (np.stack(arrays, axis=1) for arrays in zip(*values, strict=True))
    numbers = np.asarray(faces.mesh.dolfinx.geometry.input_global_indices)
    numbers = numbers[faces.vertices[facets][:, corner_order]]
    corners = faces.corners[facets][:, corner_order]
    rows_here = numbers, corners, middles, normals, nearest_points, gap
    rows_of_all = (
        np.concatenate(arrays) for arrays in zip(*comm.allgather(rows_here), strict=True)
    )
    patch = Patch(*rows_of_all)
    unique_faces = np.unique(np.sort(patch.numbers, axis=1), axis=0, return_index=True)[1]
    return patch.only(unique_faces)


def _normal(at: Patch, direction: Array | None, sheet: bool) -> Array:
    """Mean unit normal (3,) of the faces at the point: outward, or for a sheet against the
    direction.
    """
    normals = at.normals.mean(axis=1)
    if sheet:
        reference = normals[0] if direction is None else -direction
        normals = normals * np.where(normals @ reference < 0, -1.0, 1.0)[:, None]
    mean = normals.sum(axis=0)
    size = float(np.linalg.norm(mean))
    if size > 0:
        return np.asarray(mean / size)
    return np.asarray(normals[0])


def _kind(values: Array, error: float) -> tuple[Array, str]:
    """(principal curvatures, with zeros for those within `error` of zero; kind of surface)."""
    largest = float(np.abs(values).max())
    if largest == 0.0:
        return values, PLANE
    is_flat = np.abs(values) <= min(max(NONE[0] * error, NONE[1] * largest), NONE[2] * largest)
    return np.where(is_flat, 0.0, values), LINE if is_flat.any() else CURVED


# -- from the nodes


@dataclass(frozen=True)
class SurfaceFit:
    """A polynomial w(u, v) over the tangent plane through nodes of the surface.

    Attributes
    ----------
    values, directions : (2,) principal curvatures [1/m], ascending, and (2, 3) their directions.
    normal : (3,) normal of the polynomial surface at the point.
    deviation : standard error of the curvatures [1/m].
    flat : whether all nodes lie on a plane.
    degree : degree of the polynomial.
    radius : of the nodes around the point [m].
    """

    values: Array
    directions: Array
    normal: Array
    deviation: float
    flat: bool
    degree: int
    radius: float

    @property
    def curvature(self) -> float:
        """The larger of the principal curvatures in magnitude [1/m]."""
        return float(np.abs(self.values).max())

    @property
    def turn(self) -> float:
        """Angle by which a surface of this curvature turns within the radius [rad]."""
        return self.curvature * self.radius


def _from_nodes(smooth: Patch, x: Array, normal: Array) -> Curvature:
    """Curvature from a fit to the nodes of a smooth surface (see the module's docstring)."""
    cosine = np.abs(smooth.normals.mean(axis=1) @ normal)
    distances = np.linalg.norm(smooth.corners.mean(axis=1) - x, axis=1)
    nodes = smooth.only(cosine > LARGEST_TURN).nodes() - x
    widest = float(np.linalg.norm(nodes, axis=1).max()) * (1 + TOUCH)

    start = _fit_within(nodes, normal, float(distances[cosine < STARTS].min(initial=widest)))
    if start is None:
        everywhere = smooth.nodes() - x
        size = float(np.linalg.norm(everywhere, axis=1).max())
        if np.abs(everywhere @ normal).max() <= TOUCH * size:  # sharp edges all around
            return _plane(x, normal)
        raise InputError(
            f"the mesh has {len(nodes)} nodes on the surface around the site, too few for its "
            "curvature: refine it there, or give the radius."
        )

    fit = start
    for _ in range(CHOICES):
        if fit.flat or (1 - SETTLED) * fit.turn < FIT_SHARE:
            break
        smaller = _fit_within(nodes, fit.normal, FIT_SHARE / fit.curvature)
        if smaller is None or smaller.radius >= fit.radius:
            break
        fit = smaller
    if fit.flat:
        return _plane(x, fit.normal)
    if fit.turn > max(FIT_SHARE, SAME_TURN * start.turn) and fit.radius < start.radius / 2:
        return _sharp(EDGE, x, fit.normal)

    error = _error(fit, nodes)
    smallest = _fit_within(nodes, fit.normal, 0.0)
    if error > fit.curvature / 2 and smallest is not None and smallest.flat:
        return _plane(x, fit.normal)  # a flat beside a rounded edge
    values, kind = _kind(fit.values, error)
    return Curvature(kind, values, error, fit.directions, x, fit.normal)


def _error(fit: SurfaceFit, nodes: Array) -> float:
    """Bound on the error of the curvatures of a fit [1/m]."""
    if fit.turn > UNRESOLVED:
        return fit.curvature

    power, factor = (4, CUT_OFF[1]) if fit.degree == 4 else (2, CUT_OFF[0])
    errors = [2 * fit.deviation, factor * fit.turn**power * fit.curvature]
    for ratio in (1 / OTHER_SHARE, OTHER_SHARE):
        other = _fit(nodes, fit.normal, fit.radius * ratio)
        if other is not None:
            errors.append(float(np.abs(fit.values - other.values).max()))
    return max(errors)


def _plane(x: Array, normal: Array) -> Curvature:
    """The result on a plane."""
    return Curvature(PLANE, np.zeros(2), 0.0, _tangents(normal), x, normal)


def _sharp(kind: str, x: Array, normal: Array) -> Curvature:
    """The result at an edge or a corner, without curvatures."""
    return Curvature(kind, np.full(2, np.nan), np.nan, np.full((2, 3), np.nan), x, normal)


def _tangents(normal: Array) -> Array:
    """Two unit vectors (2, 3) across a normal."""
    return np.asarray(np.linalg.svd(normal[None])[2][1:])


def _fit_within(nodes: Array, normal: Array, radius: float) -> SurfaceFit | None:
    """The fit within a radius [m], or within the smallest larger one that holds enough nodes."""
    distance = np.sort(np.linalg.norm(nodes, axis=1))
    while True:
        fit = _fit(nodes, normal, radius)
        if fit is not None or radius >= distance[-1]:
            return fit
        nearest = float(distance[distance > 0].min(initial=distance[-1]))  # a site may be a node
        radius = min(max(1.1 * radius, nearest), float(distance[-1]) * 1.001)


def _fit(nodes: Array, normal: Array, radius: float) -> SurfaceFit | None:
    """The fit of the highest degree for which there are enough nodes (n, 3); None if there are too
    few.
    """
    near_nodes = nodes[np.linalg.norm(nodes, axis=1) < radius]
    basis = _tangents(normal)
    u, v = basis @ near_nodes.T / radius if radius else np.zeros((2, 0))
    w = near_nodes @ normal / radius if radius else np.zeros(0)
    weight = np.sqrt(np.clip(1 - u * u - v * v, 0.0, 1.0))

    for degree in DEGREES:
        powers = np.array([(i, j) for i in range(degree + 1) for j in range(degree + 1 - i)])
        if len(near_nodes) < NODES_EACH * len(powers):
            continue
        rows = polyvander2d(u, v, [degree, degree]).reshape(len(near_nodes), degree + 1, -1)
        rows = rows[:, powers[:, 0], powers[:, 1]]
        U, s, V = np.linalg.svd(weight[:, None] * rows, full_matrices=False)
        if s[-1] < RANK * s[0]:
            continue

        c = V.T @ ((U.T @ (weight * w)) / s)
        residuals = weight * (w - rows @ c)
        variance = float(residuals @ residuals) / max(len(near_nodes) - len(c), 1)
        number = {(int(i), int(j)): k for k, (i, j) in enumerate(powers)}
        second_order = [number[power] for power in ((2, 0), (1, 1), (0, 2))]
        deviation = np.sqrt(variance * ((V.T / s) ** 2).sum(axis=1))[second_order] * [2, 1, 2]

        # principal curvatures from the two fundamental forms at the point
        a, b = c[number[1, 0]], c[number[0, 1]]
        cuu, cuv, cvv = c[second_order]
        first = np.array([[1 + a * a, a * b], [a * b, 1 + b * b]])
        slope = np.sqrt(1 + a * a + b * b)
        second = -np.array([[2 * cuu, cuv], [cuv, 2 * cvv]]) / (slope * radius)
        values, vectors = eigh(second, first)
        tangents = basis + np.outer([a, b], normal)
        up = (normal - a * basis[0] - b * basis[1]) / slope

        plane = rows[:, [number[power] for power in ((0, 0), (1, 0), (0, 1))]]
        level = plane @ np.linalg.lstsq(plane, w, rcond=None)[0]
        flat = bool(np.abs(w - level).max() <= ON_PLANE)
        return SurfaceFit(
            values, vectors.T @ tangents, up, float(deviation.max()) / radius, flat, degree, radius
        )
    return None
