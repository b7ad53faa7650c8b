"""The surface of a structure at a site: material and curvature, for the contact law.

The nodes of a mesh lie on the surface that was meshed; its faces do not. A quadric is therefore
fitted to the nearest nodes. The uncertainty is the larger of the standard error of the fit and the
difference from a fit to twice as many nodes.

Faces are parts of one smooth surface across edges at which their normals turn by less than
`SHARP_ANGLE`.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, fields
from functools import cached_property
from math import hypot, inf, isclose
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from antiosc.base._types import Array, BoolArray, IntArray
from antiosc.base.errors import InputError
from antiosc.engine.contact.curvature import (
    CORNER,
    CURVED,
    EDGE,
    LINE,
    PLANE,
    SHARP_KINDS,
    Curvature,
)
from antiosc.engine.contact.surfaces import Matter, Surface, isotropic
from antiosc.fem.elements.beam import Beam
from antiosc.fem.elements.shell import Laminate
from antiosc.fem.mesh import Mesh
from antiosc.fem.mesh.surface import Faces, moved_inside, projected
from antiosc.fem.structure import in_space
from antiosc.fem.structure.meshed import PartsMatrices
from antiosc.fem.structure.place import Place, places_at
from antiosc.fem.structure.structure import Structure, with_parts
from antiosc.io.neutral import connected_pieces
from antiosc.models.body import Body

#: Least angle between the normals of two faces whose common edge is sharp [degree].
SHARP_ANGLE = 40.0
#: Interior angle in degrees from which an edge is sharp; straight fillets of three cells have 210.
INNER_ANGLE = 215.0
#: Nodes of a fit of nine coefficients; twice as many give its uncertainty.
FIT_NODES = 24
#: Coefficients of a fit.
FIT_COEFFICIENTS = 9
#: Faces whose nodes are taken: those within this many radii of the face at the point.
FIT_REACH = 8.0
#: Least relative error that is reported, as coordinates of CAD files are rounded.
LEAST_CURVATURE_ERROR = 1e-3
#: Singular values below this share of the largest one count as zero.
RANK_TOLERANCE = 1e-6
#: Least cosine between the normals of the faces in a fit and that of the point.
LEAST_NORMAL_COSINE = 0.35
#: Distance of nodes from a plane over the radius of the fit, up to which they lie on it.
PLANE_DISTANCE = 1e-6
#: Distance of a middle node from the chord over the length of the side, from which it is curved.
CURVED_SHARE = 1e-6
#: Multiples of error and larger curvature below which the smaller is zero; above the third never.
ZERO_CURVATURE = (3.0, 1e-3, 0.2)
#: Turn [rad] in a fit, and share of it in a wider one, from which a surface has an edge there.
EDGE_TURN, SAME_TURN_SHARE = 0.3, 0.9
#: A sheet is struck on its rim if the direction has less than this cosine to the normal.
RIM_COSINE = 0.5
#: Faces touch the point within this share of their size.
TOUCH_SHARE = 1e-6
NO_SURFACE = "matrices have no surface: give the law of the contact."
NO_POINT = "the site is no point of a surface."
#: Default radius [m] of an edge or a corner, at most a quarter of the least dimension.
CORNER_RADIUS = 1e-3
#: Indentation from which graphite and epoxy are damaged [m]; Yang and Sun (1982).
CRITICAL_INDENTATION = 8.03e-5


@dataclass(frozen=True, eq=False)
class Patch:
    """The n faces near a point, equal on all ranks."""

    numbers: IntArray  # (n, v) of their vertices in the file, around each face
    corners: Array  # (n, v, 3) [m]
    middles: Array  # (n, v, 3) of the sides [m]
    normals: Array  # (n, v, 3) unit normals at these middles
    nearest: Array  # (n, 3) the point of the face nearest to the given one [m]
    gap: Array  # (n,) distance of that point [m]

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
        """Mask (n,) of the faces that contain the point."""
        return np.asarray(self.gap <= self.gap.min() + TOUCH_SHARE * self.sides.max(axis=1))

    @cached_property
    def pairs(self) -> IntArray:
        """Pairs (k, 2) of coinciding sides of faces; side j of face i has the number i v + j."""
        ends = np.stack([self.numbers, np.roll(self.numbers, -1, axis=1)], axis=2)
        _, side = np.unique(np.sort(ends.reshape(-1, 2), axis=1), axis=0, return_inverse=True)
        order = np.argsort(side.ravel(), kind="stable")
        coincident = np.flatnonzero(np.diff(side.ravel()[order]) == 0)
        return np.column_stack([order[coincident], order[coincident + 1]])

    @cached_property
    def cosines(self) -> Array:
        """Cosines (k,) between the normals of the two faces of each of the `pairs`."""
        normals = self.normals.reshape(-1, 3)[self.pairs]
        return np.asarray(np.einsum("nd,nd->n", normals[:, 0], normals[:, 1]))

    def surfaces(self, sheet: bool) -> IntArray:
        """Number (n,) of each face's smooth surface; the normals of a `sheet` have no sign."""
        cosines = np.abs(self.cosines) if sheet else self.cosines
        smooth = cosines > np.cos(np.radians(SHARP_ANGLE))
        count, corners = self.numbers.shape
        return connected_pieces([self.pairs[smooth] // corners], count)

    def inner_edges(self) -> Array:
        """Ends (e, 2, 3) [m] of edges at which the angle of the solid is at least `INNER_ANGLE`."""
        ends = np.stack([self.corners, np.roll(self.corners, -1, axis=1)], axis=2)
        across = np.cross(self.normals, ends[:, :, 1] - ends[:, :, 0])
        inward = self.corners.mean(axis=1)[:, None] - self.middles
        across *= np.sign(np.einsum("nvd,nvd->nv", across, inward))[:, :, None]

        # seen from the second face, the first one rises along an inner edge
        first, second = self.pairs.T
        normals = self.normals.reshape(-1, 3)
        rise = np.einsum("nd,nd->n", across.reshape(-1, 3)[first], normals[second])
        sharp = (rise > 0) & (self.cosines < np.cos(np.radians(INNER_ANGLE - 180)))
        return np.asarray(ends.reshape(-1, 2, 3)[first[sharp]])

    def nodes(self) -> Array:
        """Nodes (k, 3) [m] of the faces: vertices, and mid-side nodes of curved sides."""
        chord = (self.corners + np.roll(self.corners, -1, axis=1)) / 2
        is_curved = np.linalg.norm(self.middles - chord, axis=2) > CURVED_SHARE * self.sides
        points = self.corners.reshape(-1, 3)
        if is_curved.any():
            points = np.concatenate([points, self.middles.reshape(-1, 3)])
        rounded = np.round(points / (TOUCH_SHARE * self.sides.min()))
        return np.asarray(points[np.unique(rounded, axis=0, return_index=True)[1]])


def curvature(mesh: Mesh, faces: Faces, point: Array, direction: Array | None = None) -> Curvature:
    """Curvature of the surface of a mesh at its point nearest to `point` (3,).

    `faces` are the outer faces of a solid or the cells of a sheet; `direction` (3,) is that of the
    impact, against which a sheet's normal points. InputError for a mesh of lines or in a plane.
    """
    if faces.dim != 2 or mesh.gdim != 3:
        raise InputError("beams and plane parts have no surface: give the law of the contact.")

    patch = _nearby_faces(faces, point)
    touching = patch.only(patch.touching)
    normal = _mean_normal(touching, direction, faces.sheet)
    x = touching.nearest.mean(axis=0)
    surfaces = len(np.unique(touching.surfaces(faces.sheet)))
    if surfaces > 1:
        return _sharp_curvature(EDGE if surfaces == 2 else CORNER, x, normal)

    towards = normal if direction is None or not faces.sheet else direction
    if abs(float(towards @ normal)) < RIM_COSINE * float(np.linalg.norm(towards)):
        return _sharp_curvature(EDGE, x, normal)

    label = patch.surfaces(faces.sheet)
    return _curvature_by_fit(patch.only(np.isin(label, label[patch.touching])), x, normal)


def _nearby_faces(faces: Faces, point: Array) -> Patch:
    """The faces of all ranks around the face nearest to a point."""
    comm = faces.mesh.comm
    distances = np.linalg.norm(faces.centres - point, axis=1) - faces.radii
    nearest = comm.allgather(float(distances.min(initial=np.inf)))
    near_faces = np.flatnonzero(distances <= min(nearest) + faces.radii)
    largest = max(comm.allgather(float(faces.radii[near_faces].max(initial=0.0))))
    facets = np.flatnonzero(distances <= min(nearest) + FIT_REACH * largest)
    xi = projected(
        lambda k, xi: faces.at(facets[k], xi),
        np.tile(point, (len(facets), 1)),
        faces.middle[facets],
        affine=faces.affine[facets],
    )
    nearest_points = faces.at(facets, moved_inside(xi, faces.simplex))[0]
    gap = np.linalg.norm(nearest_points - point, axis=1)
    return _gathered_faces(faces, facets, nearest_points, gap)


def _gathered_faces(faces: Faces, facets: IntArray, nearest: Array, gap: Array) -> Patch:
    """The faces `facets` of all ranks as one patch; `gap`: distances [m] of `nearest`."""
    tensor = np.array([[0.0, 0.0], [1.0, 0.0], [0.0, 1.0], [1.0, 1.0]])
    corner_order = [0, 1, 2] if faces.simplex else [0, 1, 3, 2]
    corner = tensor[corner_order]
    sides = (corner + np.roll(corner, -1, axis=0)) / 2
    values = [faces.across(facets, np.tile(side, (len(facets), 1))) for side in sides]
    middles, normals = (np.stack(arrays, axis=1) for arrays in zip(*values, strict=True))
    numbers = np.asarray(faces.mesh.dolfinx.geometry.input_global_indices)
    numbers = numbers[faces.vertices[facets][:, corner_order]]
    corners = faces.corners[facets][:, corner_order]
    of_rank = numbers, corners, middles, normals, nearest, gap
    of_ranks = zip(*faces.mesh.comm.allgather(of_rank), strict=True)
    patch = Patch(*(np.concatenate(rows) for rows in of_ranks))
    return patch.only(np.unique(np.sort(patch.numbers, axis=1), axis=0, return_index=True)[1])


def inner_points(matrices: PartsMatrices, part: str | None, spacing: float) -> Array:
    """Points (n, 3) [m], `spacing` apart, along sharp inner edges of solids. Stress is singular
    there, as r^-0.46 at 270° (M. L. Williams, J. Appl. Mech. 19 (1952) 526), and grows with mesh
    refinement; fillets are not sharp."""
    found = [np.zeros((0, 3))]
    for member in matrices.members(part):
        faces = member.part.faces
        if faces.sheet or faces.dim != 2:
            continue
        count = len(faces.facets)
        skin = _gathered_faces(faces, np.arange(count), faces.centres, np.zeros(count))
        start, end = np.moveaxis(member.at.placed(skin.inner_edges()), 1, 0)
        longest = np.linalg.norm(end - start, axis=1).max(initial=0.0)
        share = np.linspace(0.0, 1.0, 2 + int(longest / spacing))[:, None, None]
        found.append(np.unique((start + (end - start) * share).reshape(-1, 3), axis=0))

    return np.concatenate(found)


def _mean_normal(at: Patch, direction: Array | None, sheet: bool) -> Array:
    """Mean unit normal (3,) at the point: outward on solids, against `direction` on sheets."""
    normals = at.normals.mean(axis=1)
    if sheet:
        reference = normals[0] if direction is None else -direction
        normals = normals * np.where(normals @ reference < 0, -1.0, 1.0)[:, None]

    mean = normals.sum(axis=0)
    size = float(np.linalg.norm(mean))
    return np.asarray(mean / size if size > 0 else normals[0])


# -- from the nodes


class _Quadric(NamedTuple):
    """A quadric fitted to nodes of the surface."""

    values: Array  # (2,) principal curvatures [1/m], ascending
    directions: Array  # (2, 3)
    normal: Array  # (3,) at the point
    deviation: float  # standard error of the curvatures [1/m]
    radius: float  # of the nodes around the point [m]


def _curvature_by_fit(smooth: Patch, x: Array, normal: Array) -> Curvature:
    """Curvature at `x` (3,) by fits of quadrics to the nodes of a smooth surface."""
    cosine = np.abs(smooth.normals.mean(axis=1) @ normal)
    nodes = smooth.only(cosine > LEAST_NORMAL_COSINE).nodes() - x
    nodes = nodes[np.argsort(np.linalg.norm(nodes, axis=1), kind="stable")]

    if _are_coplanar(nodes[:FIT_NODES]):
        return _flat_curvature(x, normal)
    if len(nodes) < FIT_COEFFICIENTS:
        raise InputError(
            f"the mesh has {len(nodes)} nodes on the surface around the site, too few for its "
            "curvature: refine it there, or give the radius."
        )

    count = min(FIT_NODES, max(FIT_COEFFICIENTS, len(nodes) // 2))
    fit = _fitted_quadric(nodes[:count], normal)
    wider = _fitted_quadric(nodes[: 2 * count], normal)
    largest = float(np.abs(fit.values).max())
    turn, wider_turn = (float(np.abs(one.values).max()) * one.radius for one in (fit, wider))
    if turn > max(EDGE_TURN, SAME_TURN_SHARE * wider_turn) and wider.radius > fit.radius:
        return _sharp_curvature(EDGE, x, fit.normal)

    change = float(np.abs(fit.values - wider.values).max()) if len(nodes) > count else largest
    error = max(2 * fit.deviation, 2 * change, LEAST_CURVATURE_ERROR * largest)
    if error > largest / 2 and _are_coplanar(nodes[:FIT_COEFFICIENTS]):
        return _flat_curvature(x, normal)  # a flat beside a rounded edge

    # curvatures count as zero within the error
    limit = max(ZERO_CURVATURE[0] * error, ZERO_CURVATURE[1] * largest)
    is_flat = np.abs(fit.values) <= min(limit, ZERO_CURVATURE[2] * largest)
    kind = PLANE if largest == 0.0 else LINE if is_flat.any() else CURVED
    values = np.where(is_flat, 0.0, fit.values)
    return Curvature(kind, values, error, fit.directions, x, fit.normal)


def _are_coplanar(nodes: Array) -> bool:
    """Whether nodes (n, 3) lie on one plane."""
    from_middle = nodes - nodes.mean(axis=0)
    across = np.linalg.svd(from_middle)[2][2]
    size = np.linalg.norm(nodes, axis=1).max()
    return bool(np.abs(from_middle @ across).max() <= PLANE_DISTANCE * size)


def _flat_curvature(x: Array, normal: Array) -> Curvature:
    """The curvature of a plane with this normal at x."""
    return Curvature(PLANE, np.zeros(2), 0.0, _tangents(normal), x, normal)


def _sharp_curvature(kind: str, x: Array, normal: Array) -> Curvature:
    """Curvature record of an edge or a corner (`kind`), which has no values."""
    return Curvature(kind, np.full(2, np.nan), np.nan, np.full((2, 3), np.nan), x, normal)


def _tangents(normal: Array) -> Array:
    """Two orthogonal unit vectors (2, 3) perpendicular to a normal (3,)."""
    return np.asarray(np.linalg.svd(normal[None])[2][1:])


def _fitted_quadric(nodes: Array, normal: Array) -> _Quadric:
    """The quadric w = c + b·y + yᵀ H y/2 through nodes y (n, 3), exact on spheres and cylinders."""
    radius = float(np.linalg.norm(nodes[-1])) * (1 + TOUCH_SHARE)
    basis = np.vstack([_tangents(normal), normal])
    u, v, w = basis @ nodes.T / radius
    weight = np.sqrt(1 - u * u - v * v - w * w)

    columns = [np.ones_like(u), u, v, u * u / 2, u * v, v * v / 2, u * w, v * w, w * w / 2]
    rows = weight[:, None] * np.column_stack(columns)
    inverse = np.linalg.pinv(rows, rcond=RANK_TOLERANCE)
    c = inverse @ (weight * w)
    residual = rows @ c - weight * w
    variance = float(residual @ residual) / max(len(nodes) - len(c), 1)
    spread = np.sqrt(variance * (inverse**2).sum(axis=1))[3:6]

    # principal curvatures: the Hessian of the height over the slope, on the tangent plane
    H = np.array([[c[3], c[4], c[6]], [c[4], c[5], c[7]], [c[6], c[7], c[8]]])
    gradient = np.array([-c[1], -c[2], 1.0])
    slope = float(np.linalg.norm(gradient))
    tangents = _tangents(gradient / slope)
    values, vectors = np.linalg.eigh(-tangents @ H @ tangents.T / (slope * radius))
    directions = vectors.T @ tangents @ basis
    up = gradient @ basis / slope
    return _Quadric(values, directions, up, float(spread.max()) / radius, radius)


# -- the largest ball that touches the surface at a site and meets the part nowhere else


#: Reach of the contact itself over the radius of the patch or the size of the site's face.
CONTACT_REACH = 2.0
#: Height of a point over the tangent plane, over its distance from the site, that the error of the
#: normal may make: at facets of 15° it is 0.03. A wall at a distance D is met by balls from 1.08 D.
NORMAL_ERROR = 0.05
#: Height of a point over its distance from which on it is another face, half as near too. A post
#: beside a site, 1.6 patch radii away, was left out: a ball of 4 mm struck it 0.3 mm before.
OTHER_FACE_SLOPE = 0.3


def _largest_ball(
    matrices: PartsMatrices, at: Curvature, patch_radius: float
) -> tuple[float, tuple[float, float, float] | None]:
    """(radius [m] of the largest ball that touches only the site, second contact point or None)."""
    balls: list[tuple[float, tuple[float, float, float] | None]] = [(inf, None)]
    for member in matrices.members():
        faces, point = member.part.faces, member.at.own(at.point[None])[0]
        if member.part.mesh.tdim < 2 or not len(faces.facets):
            continue
        size = float(faces.sizes[np.argmin(np.linalg.norm(faces.centres - point, axis=1))])
        r = faces.samples - point
        distance = np.linalg.norm(r, axis=1)
        height = r @ (at.normal @ member.at.rotation) - NORMAL_ERROR * distance
        beside = np.where(height > OTHER_FACE_SLOPE * distance, CONTACT_REACH / 2, CONTACT_REACH)
        near = beside * max(patch_radius, size)
        touched = (height > 0) & (distance > near)
        if touched.any():
            radii = distance[touched] ** 2 / (2 * height[touched])
            i = int(np.argmin(radii))
            x, y, z = member.at.placed(faces.samples[touched][[i]])[0].tolist()
            balls.append((float(radii[i]), (x, y, z)))

    of_ranks = matrices.comm.allgather(min(balls, key=lambda ball: ball[0]))
    return min(of_ranks, key=lambda ball: ball[0])


def surface_at(
    structure: Structure,
    point: Array | None,
    direction: Array | None = None,
    radius: float | None = None,
) -> Surface:
    """The surface of a structure nearest to `point` (3,) [m], under a patch of `radius` [m]."""
    if point is None:
        raise InputError(NO_POINT)
    matrices = with_parts(structure, NO_SURFACE)
    return surface_of(matrices, _place_at(matrices, point, direction), radius)


def surface_of(matrices: PartsMatrices, place: Place, radius: float | None) -> Surface:
    """The surface at a place, under a patch of `radius` [m] or None; InputError if unknown."""
    material = place.material
    matter = _contact_material(material)
    if matter is None:
        raise InputError("a plane part has no surface in space.")
    if isinstance(material, Beam):  # struck from the side
        section = material.section
        if not section.isotropic or len(section.outline) <= 4:
            return Surface(matter, radius=radius)
        bent = 1 / hypot(*section.outline[0])
        return Surface(matter, (0.0, bent), kind=LINE, radius=radius)

    curved = _curvature(place)
    if curved.kind in SHARP_KINDS:
        bent = 1 / min(CORNER_RADIUS, matrices.dimensions[2] / 4)
        return Surface(matter, (bent, bent), kind=curved.kind, radius=radius)

    low, high = curved.values.tolist()
    x, y, z = curved.directions[0].tolist()
    ball_radius, second_contact = _largest_ball(matrices, curved, radius or 0.0)
    return Surface(
        matter,
        (low, high),
        float(curved.error),
        curved.kind,
        along=(x, y, z),
        radius=radius,
        largest_ball=ball_radius,
        meets=second_contact,
    )


def curvature_at(
    structure: Structure, point: ArrayLike, direction: Sequence[float] | None = None
) -> Curvature:
    """Principal curvatures of the outer surface at its point nearest to `point` [m]."""
    along = None if direction is None else in_space(direction)
    return _curvature(_place_at(with_parts(structure, NO_SURFACE), in_space(point), along))


def _place_at(matrices: PartsMatrices, point: Array, direction: Array | None) -> Place:
    """The place of the structure nearest to a point (3,), for an impact along `direction` (3,)."""
    directions = None if direction is None else direction[None]
    return places_at(matrices.members(), point[None], directions)[0]


def material_at(structure: Structure, point: Array, direction: Array | None = None) -> Any:
    """The material of a meshed structure at its point nearest to `point` [m]."""
    return _place_at(with_parts(structure, NO_SURFACE), point, direction).material


def _curvature(place: Place) -> Curvature:
    """Curvature of the outer surface at a place, in the axes of the structure."""
    part = place.member.part
    at = place.member.at
    along = place.direction if place.direction.any() else None

    if part.kind.sheet and part.mesh.gdim == 2:  # in the plane z = 0, seen by the impactor
        side = -1.0 if along is not None and along[2] > 0 else 1.0
        curved = _flat_curvature(place.point * [1.0, 1.0, 0.0], np.array([0.0, 0.0, side]))
    else:
        curved = curvature(part.mesh, part.faces, place.point, along)

    if part.kind.sheet:
        curved = curved.beyond(place.material.section.thickness / 2)
    return curved.placed(at.rotation, at.placed(np.zeros((1, 3)))[0])


class StruckStructure(Body):
    """A structure as the struck body; the default `surface` is a flat face of its material."""

    def __init__(self, structure: Structure, surface: Surface | None = None) -> None:
        self._surface = surface or flat_face(structure)

    def surface(self, site: str = "") -> Surface | None:
        return self._surface


def flat_face(structure: Structure) -> Surface | None:
    """A flat face of the first material of a structure; None if the material is unknown."""
    try:
        member = with_parts(structure, "matrices have no material.").members()[0]
    except InputError:
        return None

    matter = _contact_material(member.part.parts[0][0])
    if matter is None:
        return None
    return Surface(matter)


def _contact_material(material: Any) -> Matter | None:
    """Material properties for contact laws; None for an anisotropic or a plane material."""
    if getattr(material, "plane", None) is not None:
        return None
    if isinstance(material, Laminate):
        outer = min((material.layers[0], material.layers[-1]), key=lambda layer: layer.E2)
        if isclose(outer.E1, outer.E2):
            return Matter(outer.E2, outer.nu12)
        return Matter(outer.E2, 0.0, critical=CRITICAL_INDENTATION, name="laminate")

    return isotropic(material)
