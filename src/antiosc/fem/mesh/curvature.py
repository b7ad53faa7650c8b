"""Curvature of the surface of a mesh at a point, by a fit to nodes of the surface.

The nodes of a mesh lie on the surface that was meshed; its faces do not. The fit is a polynomial
over the tangent plane. It uses the nodes within a radius that depends on the surface and not on the
cells: a third of the radius of curvature, or more if there are too few nodes. The uncertainty is
the difference from a fit with another radius, and the standard error of the fit.

Faces are parts of one smooth surface across edges at which their normals turn by less than
`SHARP_ANGLE`.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, fields, replace
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
#: Ratio of the radii of two fits, whose difference is the uncertainty; with 3 it is 1.7 to 8 times
#: as large.
OTHER_SHARES = 1.5
#: Most iterations of the radius of a fit, …
CHOICES = 8
#: … and the relative change that ends them.
SETTLED = 0.1
#: Degrees of the polynomials, …
DEGREES = (4, 3, 2)
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
#: Relative error of a curvature k by a fit of a circle within a radius r, of degrees below 4 and of
#: degree 4: these times (k r)^2 and (k r)^4. Measured on spheres and cylinders: 0.25 and 0.07.
CUT_OFF = 0.35, 0.15
#: A fit within a radius r does not resolve a curvature k if k r is above this.
UNRESOLVED = 0.8
#: Points tried along a line, …
PROBES = 200
#: … refinements of the place of its end: it is then known to LOOKS^-4 of the part's size, …
CLOSER = 3
#: … and largest deviation of the surface from the line over its radius.
MISSED_DISTANCE = 0.1
#: Step along a curved line over its radius, …
STEP = 0.25
#: … drop of height over the radius at which it ends, …
FALLEN = 0.25
#: … and places across it, over the radius, at which the height is tried.
ACROSS = np.linspace(-0.3, 0.3, 5)
#: Longest such line over the size of the part.
LONGEST = 4.0
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
    weights : (n, v) weights of the vertices at the point of the face next to the given one.
    gap : (n,) distance of that point [m].
    """

    numbers: IntArray
    corners: Array
    middles: Array
    normals: Array
    weights: Array
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


def curvature(
    mesh: Mesh, faces: Faces, point: Array, direction: Array | None = None, lengths: bool = True
) -> Curvature:
    """Curvature of the surface of a mesh at its point nearest to `point` (3,).

    Parameters
    ----------
    faces : faces of the mesh; for a solid the outer ones.
    direction : (3,) direction of an impact, optional; the normal of a sheet is taken against it.
    lengths : whether to find the lengths of lines, which takes most of the time.

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
    size = mesh.extent()
    nearest_faces = _patch(faces, point)
    touching = nearest_faces.only(nearest_faces.touching)
    normal = _normal(touching, direction, faces.sheet)
    x = np.einsum("nv,nvd->d", touching.weights, touching.corners) / len(touching.gap)
    surfaces = len(np.unique(touching.surfaces(faces.sheet)))
    if surfaces > 1:
        return _sharp(EDGE if surfaces == 2 else CORNER, x, normal)
    towards = normal if direction is None or not faces.sheet else direction
    if abs(float(towards @ normal)) < RIM * float(np.linalg.norm(towards)):
        return _sharp(EDGE, x, normal)
    patch = _patch(faces, point, WIDEST * size, FACES_WIDE)
    label = patch.surfaces(faces.sheet)
    smooth = patch.only(np.isin(label, label[patch.touching]))
    result = _from_nodes(smooth, x, normal)
    if lengths and result.kind == LINE:
        return _with_length(faces, result, size)
    return result


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
    xi = clamped(xi, faces.simplex)
    gap = np.linalg.norm(faces.at(facets, xi)[0] - point, axis=1)
    s, t = xi.T
    if faces.simplex:
        weights = np.column_stack([1 - s - t, s, t])
    else:
        weights = np.column_stack([(1 - s) * (1 - t), s * (1 - t), s * t, (1 - s) * t])
    corner = tensor[corner_order]
    sides = (corner + np.roll(corner, -1, axis=0)) / 2
    values = [faces.across(facets, np.tile(side, (len(facets), 1))) for side in sides]
    middles, normals = (np.stack(arrays, axis=1) for arrays in zip(*values, strict=True))
    numbers = np.asarray(faces.mesh.dolfinx.geometry.input_global_indices)
    numbers = numbers[faces.vertices[facets][:, corner_order]]
    rows_here = numbers, faces.corners[facets][:, corner_order], middles, normals, weights, gap
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
    """

    values: Array
    directions: Array
    normal: Array
    deviation: float
    flat: bool
    degree: int


def _from_nodes(smooth: Patch, x: Array, normal: Array) -> Curvature:
    """Curvature from a fit to the nodes of a smooth surface (see the module's docstring)."""
    cosine = np.abs(smooth.normals.mean(axis=1) @ normal)
    distances = np.linalg.norm(smooth.corners.mean(axis=1) - x, axis=1)
    nodes = smooth.only(cosine > LARGEST_TURN).nodes() - x
    widest = float(np.linalg.norm(nodes, axis=1).max()) * (1 + TOUCH)
    start = _fit_within(
        nodes, normal, min(widest, float(distances[cosine < STARTS].min(initial=widest)))
    )
    basis = np.linalg.svd(normal[None])[2][1:]
    if start is None:
        if _in_one_plane(smooth.nodes() - x, normal):  # sharp edges all around
            return Curvature(PLANE, np.zeros(2), 0.0, basis, x, normal)
        raise InputError(
            f"the mesh has {len(nodes)} nodes on the surface around the site, too few for its "
            "curvature: refine it there, or give the radius."
        )
    fit, radius = start
    for _ in range(CHOICES):
        if fit.flat:
            break
        normal = fit.normal
        fit_radius = FIT_SHARE / float(np.abs(fit.values).max())
        smaller_fit = _fit_within(nodes, normal, min(fit_radius, radius))
        if smaller_fit is None or smaller_fit[1] > radius:
            break
        settled = smaller_fit[1] > (1 - SETTLED) * radius
        fit, radius = smaller_fit
        if settled:
            break
    if fit.flat:
        basis = np.linalg.svd(normal[None])[2][1:]
        return Curvature(PLANE, np.zeros(2), 0.0, basis, x, normal)
    curvature = float(np.abs(fit.values).max())
    arc_angle = curvature * radius
    start_angle = float(np.abs(start[0].values).max()) * start[1]
    if arc_angle > max(FIT_SHARE, SAME_TURN * start_angle) and radius < start[1] / OTHER_SHARES**2:
        return _sharp(EDGE, x, normal)
    smaller, larger = (
        _fit(nodes, normal, radius * share) for share in (1 / OTHER_SHARES, OTHER_SHARES)
    )
    error = max(_spread(fit, smaller, larger), 2 * fit.deviation, _cut_off(fit, curvature * radius))
    if curvature * radius > UNRESOLVED:
        error = max(error, curvature)
    if error > curvature / 2 and _flat_within(nodes, normal, radius):
        return Curvature(PLANE, np.zeros(2), 0.0, basis, x, normal)
    values, kind = _kind(fit.values, error)
    return Curvature(kind, values, error, fit.directions, x, fit.normal)


def _in_one_plane(nodes: Array, normal: Array) -> bool:
    """Whether nodes (n, 3) lie on the plane through the origin with this normal."""
    size = float(np.linalg.norm(nodes, axis=1).max())
    return bool(np.abs(nodes @ normal).max() <= TOUCH * size)


def _flat_within(nodes: Array, normal: Array, radius: float) -> bool:
    """Whether nodes within some smaller radius are coplanar, as on a flat beside a rounded edge."""
    while True:
        radius /= OTHER_SHARES
        fit = _fit(nodes, normal, radius)
        if fit is None or fit.flat:
            return fit is not None


def _sharp(kind: str, x: Array, normal: Array) -> Curvature:
    """The result at an edge or a corner, without curvatures."""
    return Curvature(kind, np.full(2, np.nan), np.nan, np.full((2, 3), np.nan), x, normal)


def _spread(fit: SurfaceFit, smaller: SurfaceFit | None, larger: SurfaceFit | None) -> float:
    """Truncation error of the polynomial [1/m], from fits with a smaller and a larger radius."""
    shrinks = OTHER_SHARES ** (4 if fit.degree == 4 else 2)
    error = 0.0
    if larger is not None:
        error = float(np.abs(fit.values - larger.values).max())
    if smaller is not None:
        change = float(np.abs(fit.values - smaller.values).max())
        error = max(error, change * shrinks / (shrinks - 1))
    return error


def _cut_off(fit: SurfaceFit, share: float) -> float:
    """Truncation error [1/m] of a fit to a circle whose radius of fit is `share` radii of
    curvature.
    """
    relative = CUT_OFF[1] * share**4 if fit.degree == 4 else CUT_OFF[0] * share**2
    return relative * float(np.abs(fit.values).max())


def _fit_within(nodes: Array, normal: Array, radius: float) -> tuple[SurfaceFit, float] | None:
    """The fit within a radius [m], or within the smallest larger one that holds enough nodes."""
    distance = np.sort(np.linalg.norm(nodes, axis=1))
    while True:
        fit = _fit(nodes, normal, radius)
        if fit is not None:
            return fit, radius
        if radius >= distance[-1]:
            return None
        radius = min(max(1.1 * radius, float(distance[0])), float(distance[-1]) * 1.001)


def _fit(nodes: Array, normal: Array, radius: float) -> SurfaceFit | None:
    """The fit of the highest degree for which there are enough nodes (n, 3); None if there are too
    few.
    """
    near_nodes = nodes[np.linalg.norm(nodes, axis=1) < radius]
    basis = np.linalg.svd(normal[None])[2][1:]
    u, v = basis @ near_nodes.T / radius
    w = near_nodes @ normal / radius
    for degree in DEGREES:
        powers = np.array([(i, j) for i in range(degree + 1) for j in range(degree + 1 - i)])
        if len(near_nodes) < NODES_EACH * len(powers):
            continue
        rows = polyvander2d(u, v, [degree, degree]).reshape(len(near_nodes), degree + 1, -1)
        rows = rows[:, powers[:, 0], powers[:, 1]]
        weight = np.sqrt(np.clip(1 - u * u - v * v, 0.0, 1.0))
        U, s, V = np.linalg.svd(weight[:, None] * rows, full_matrices=False)
        if s[-1] < RANK * s[0]:
            continue
        c = V.T @ ((U.T @ (weight * w)) / s)
        residuals = weight * (w - rows @ c)
        variance = float(residuals @ residuals) / max(len(near_nodes) - len(c), 1)
        number = {(int(i), int(j)): k for k, (i, j) in enumerate(powers)}
        second_order = [number[power] for power in ((2, 0), (1, 1), (0, 2))]
        deviation = np.sqrt(variance * ((V.T / s) ** 2).sum(axis=1))[second_order] * [2, 1, 2]
        a, b, cuu, cuv, cvv = (
            c[number[power]] for power in ((1, 0), (0, 1), (2, 0), (1, 1), (0, 2))
        )
        first = np.array([[1 + a * a, a * b], [a * b, 1 + b * b]])
        slope = np.sqrt(1 + a * a + b * b)
        tensor = -np.array([[2 * cuu, cuv], [cuv, 2 * cvv]]) / (slope * radius)
        values, vectors = eigh(tensor, first)
        tangents = basis + np.outer([a, b], normal)
        up = (normal - a * basis[0] - b * basis[1]) / slope
        plane = rows[:, [number[power] for power in ((0, 0), (1, 0), (0, 1))]]
        level = plane @ np.linalg.lstsq(plane, w, rcond=None)[0]
        flat = bool(np.abs(w - level).max() <= ON_PLANE)
        return SurfaceFit(
            values, vectors.T @ tangents, up, float(deviation.max()) / radius, flat, degree
        )
    return None


# -- lines


def _with_length(faces: Faces, curvature: Curvature, size: float) -> Curvature:
    """The curvature, completed by length and middle of the line along which the surface is
    straight.
    """
    axis = curvature.directions[int(np.argmin(np.abs(curvature.values)))]
    radius = 1 / float(np.abs(curvature.values).max())

    def depth(points: Array, rise: float) -> Array:
        """Distances (n,) [m] of the surface from points along the normal; inf if it is farther than
        `rise`.
        """
        normals = np.tile(curvature.normal, (len(points), 1))
        distance = faces.along(points, normals, rise)[2]
        return np.asarray(np.min(np.array(faces.mesh.comm.allgather(distance)), axis=0))

    def exists(distances: Array) -> BoolArray:
        return np.isfinite(
            depth(curvature.point + distances[:, None] * axis, MISSED_DISTANCE * radius)
        )

    ends = _end(exists, size), -_end(lambda t: exists(-t), size)
    end_points = curvature.point + (1 + TOUCH) * np.array(ends)[:, None] * axis
    if np.isfinite(depth(end_points, 2 * MISSED_DISTANCE * radius)).any():
        return _along_crest(curvature, lambda points: depth(points, radius), axis, radius, size)
    middle = curvature.point + (ends[0] + ends[1]) / 2 * axis
    return replace(curvature, length=ends[0] - ends[1], middle=middle)


def _end(exists: Callable[[Array], BoolArray], size: float) -> float:
    """Distance [m] along a line at which the surface ends, at most `size`; `exists` is a mask of
    distances at which it exists.
    """
    lower = 0.0
    upper = size
    for _ in range(1 + CLOSER):
        t = np.linspace(lower, upper, PROBES)
        last = int(np.argmin(np.append(exists(t[1:-1]), False)))
        lower = float(t[last])
        upper = float(t[last + 1])
    return lower


def _along_crest(
    curvature: Curvature, depth: Callable[[Array], Array], along: Array, radius: float, size: float
) -> Curvature:
    """The curvature with length and middle of a curved crest, such as the top of a torus, in
    steps.
    """
    length = 0.0
    step = STEP * radius
    for start in (along, -along):
        x = curvature.point
        step_direction = start
        for number in range(int(LONGEST * size / step)):
            across: Array = np.cross(curvature.normal, step_direction).astype(float)
            probes = x + step * step_direction + radius * ACROSS[:, None] * across
            low = depth(probes)
            on_surface = np.flatnonzero(np.isfinite(low))
            if len(on_surface) < 3 or len(ACROSS) // 2 not in on_surface:
                break
            quadratic, slope, level = np.polyfit(ACROSS[on_surface], low[on_surface] / radius, 2)
            shift = (
                np.clip(-slope / (2 * quadratic), ACROSS[0], ACROSS[-1]) if quadratic > 0 else 0.0
            )
            if level - quadratic * shift**2 > FALLEN:
                break
            crest = x + step * step_direction + radius * shift * across
            step_length = float(np.linalg.norm(crest - x))
            length = length + step_length
            step_direction = (crest - x) / step_length
            x = crest
            from_start = float(np.linalg.norm(x - curvature.point))
            if number > 3 and from_start < step:
                return replace(curvature, length=length + from_start, middle=curvature.point)
    return replace(curvature, length=length, middle=curvature.point)
