"""Makes the free body of a falling part: rigid inertia, free modes, points that may touch.

All vectors are in axes fixed to the body with the centre of mass as origin. The elastic
displacement of a point is sum_j phi_j q_j with mass-normalised free modes, to which a contact point
adds the residual compliance r of the omitted modes,

    r = B'(K + sM)^-1 B - sum_j phi_j phi_j'/(omega_j^2 + s),

where B are the unit loads of its patch in three directions and s the shift of the structure. On a
smooth solid the half-space compliance of the patch is subtracted from r, since Hertz's law contains
it.
"""

from __future__ import annotations

from contextlib import suppress
from functools import partial
from typing import TYPE_CHECKING, Any

import numpy as np

from antiosc import Damping, RigidBody, Sphere
from antiosc.base import checks
from antiosc.base._types import Array, BoolArray, IntArray
from antiosc.base.errors import InputError, finite_element_packages, without_warnings
from antiosc.base.texts import engineering
from antiosc.engine.contact.curvature import CURVED, LINE, PLANE
from antiosc.engine.contact.surfaces import RIGID_MATTER, Matter
from antiosc.models.modal import as_damping
from antiosc_studies.drops.free_body import FreeBody
from antiosc_studies.drops.skin import ZERO_EXTENT, Skin, hull_indices, skin_of

if TYPE_CHECKING:
    from antiosc import Site, Structure


#: Default radius [m] of a sharp corner; at most a quarter of the least dimension is used.
CORNER_RADIUS = 1e-3
#: Default and largest number of free elastic modes; their shapes and forces fill the memory.
MODE_COUNT: int = 60
MOST_MODES = 5000  # 8 bytes × dofs × modes: 0.4 GB at 10 000 dofs
#: Default damping ratio of the free modes.
DAMPING_RATIO = 0.01


def free_body(part: Any, mode_count: int, damping: Any, corner_radius: float | None) -> FreeBody:
    """The free body of a `Structure`, a `RigidBody` or a `Sphere`; InputError for other objects."""
    model_damping = as_damping(damping)
    if isinstance(part, FreeBody):
        return part
    if corner_radius is not None:
        corner_radius = checks.positive("corner_radius", corner_radius, "m")

    if isinstance(part, Sphere):
        tensor = 0.4 * part.mass * part.radius**2 * np.eye(3)
        matter = part.material if isinstance(part.material, Matter) else None
        radii_and_material = part.radius, part.radius, matter
        return _rigid_body(part.mass, tensor, np.zeros((1, 3)), np.zeros(3), *radii_and_material)

    if isinstance(part, RigidBody):
        if not part.sites:
            raise InputError("a RigidBody that is dropped needs sites: the points that may touch.")
        points = np.array([x for x, _ in part.sites.values()])
        centre = np.asarray(part.centre)
        radius = CORNER_RADIUS if corner_radius is None else corner_radius
        return _rigid_body(part.mass, part.inertia, points - centre, centre, radius)

    with finite_element_packages():
        from antiosc import Structure
    checks.instance("part", part, Structure, "a Structure, a RigidBody or a Sphere")
    return _elastic_body(part, mode_count, model_damping, corner_radius)


def _rigid_body(
    mass: float,
    inertia: Array,
    points: Array,
    centre: Array,
    radius: float,
    ball_radius: float = 0.0,
    matter: Matter | None = None,
) -> FreeBody:
    """A body without modes whose points have this radius [m]; without a material it is rigid."""
    count = len(points)
    empty = np.zeros(0)
    materials = np.full(count, matter or RIGID_MATTER, dtype=object)
    extent = float(np.linalg.norm(np.ptp(points, axis=0))) or float(np.abs(points).max())
    points_data = np.full(count, ball_radius), np.full((count, 2), radius), materials
    modes = empty, empty, np.zeros((count, 0, 3))
    return FreeBody(mass, inertia, points, centre, *points_data, *modes, extent or 2 * radius)


def _elastic_body(
    structure: Structure, mode_count: int, damping: Damping | None, corner_radius: float | None
) -> FreeBody:
    """The free body of a structure: its lowest free modes and the vertices of its convex hull.

    corner_radius : radius [m] of sharp corners; None: the default.
    """
    from scipy.spatial import cKDTree

    from antiosc.fem.structure.structure import refuse_dampers
    from antiosc.recovery import source
    from antiosc.reduce.extraction.eigenmodes import ModeSolver

    if structure.comm.size > 1:
        raise InputError("a drop runs on one rank; start it without mpirun.")
    refuse_dampers(structure, "a drop")
    inertia = structure.rigid_inertia
    if structure.rigid_modes.shape[1] != 6 or inertia is None:
        raise InputError(
            f"a part that is dropped is free in space, with six rigid-body modes; this one has "
            f"{structure.rigid_modes.shape[1]}: leave its supports out."
        )
    structure.factorize(np.inf)  # for its modes, and the points that touch
    rigid = inertia[0]
    modes = ModeSolver(structure).lowest(mode_count)
    omega, phi = modes.omega[:mode_count], modes.phi[:, :mode_count]
    points, _, displacements = source(structure).at_nodes(structure, phi)
    skin = skin_of(structure)
    hull_points = hull_indices(skin.points)
    nodes_of_hull = cKDTree(points).query(skin.points[hull_points])[1]
    balls = skin.hull_ball_radii(hull_points)
    notes = []
    rounded = corner_radius or min(CORNER_RADIUS, _least_dimension(structure, skin) / 4)
    sharp = skin.sharp[hull_points] & (skin.half_thickness[hull_points] == 0)
    if corner_radius is None and sharp.any():
        radius = engineering(rounded, "m")
        notes += [f"sharp corners are taken with a radius of {radius} (corner_radius)"]
    if damping is None:
        notes += [f"the modes have a damping ratio of {DAMPING_RATIO:g} (damping)"]
    centre = rigid.centre
    arm = rigid.point - rigid.centre
    tensor = rigid.matrix[3:, 3:] - rigid.mass * (arm @ arm * np.eye(3) - np.outer(arm, arm))

    return FreeBody(
        mass=rigid.mass,
        centre=centre,
        inertia=(tensor + tensor.T) / 2,
        points=skin.points[hull_points] - balls[:, None] * skin.normals[hull_points] - centre,
        ball_radii=balls,
        radii=np.array([skin.radii(i, rounded) for i in hull_points]),
        materials=skin.materials[hull_points],
        omega=omega,
        decay=(Damping(ratio=DAMPING_RATIO) if damping is None else damping).decay(omega),
        shapes=np.moveaxis(displacements[nodes_of_hull], 1, 2).copy(),
        extent=skin.size,
        notes=tuple(notes),
        normals=None if skin.half_thickness.any() else skin.normals[hull_points],
        sharp=sharp,
        corner_radius=rounded,
        facets=_facets(skin, hull_points, sharp),
        structure=structure,
        basis=phi,
        skin=skin,
        patch_solver=partial(_patches, structure, phi, omega, skin, hull_points, rounded),
    )


def _facets(skin: Skin, hull_points: IntArray, sharp: BoolArray) -> dict[int, Array]:
    """Two edges of each facet (n, 2, 3) [m] at a sharp hull vertex, by index of the vertex."""
    if not len(skin.triangles):
        return {}

    facets = {}
    for i in np.flatnonzero(sharp).tolist():
        vertex = hull_points[i]
        faces, place = np.nonzero(skin.triangles == vertex)
        turned = (place[:, None] + [1, 2]) % 3
        others = np.take_along_axis(skin.triangles[faces], turned, axis=1)
        edges = skin.points[others] - skin.points[vertex]

        inward = np.cross(edges[:, 0], edges[:, 1]) @ skin.normals[vertex] < 0
        facets[i] = np.where(inward[:, None, None], edges[:, ::-1], edges)

    return facets


def _least_dimension(structure: Structure, skin: Skin) -> float:
    """Least dimension of a part [m]; for nodes without a mesh, the least side > 0 of their box."""
    matrices: Any = structure.matrices
    if not matrices.located:
        return structure.dimensions[2]
    sides = np.ptp(skin.points, axis=0)
    return float(sides[sides > ZERO_EXTENT * skin.size].min())


def _patches(
    structure: Structure,
    phi: Array,
    omega: Array,
    skin: Skin,
    hull_points: IntArray,
    corner_radius: float,
    points: tuple[int, ...],
) -> tuple[Array, Array, Array]:
    """The contact patches at n vertices of the hull, with indices `points` among `hull_points`.

    Returns their shapes (n, J, 3), residual compliances (n, 3, 3) [m/N] and radii (n, 2) [m].
    """
    from antiosc.reduce.site import functionals

    skin_points = hull_points[list(points)]
    sites = [_site(skin, k, corner_radius) for k in skin_points.tolist()]
    with without_warnings():
        loads = functionals(structure.matrices, sites)
    B = np.hstack([load.B for load in loads])
    Y = structure.factorize().solve_block(B)
    x = omega**2 + structure.shift

    shapes = []
    residual = []
    for n, (k, load) in enumerate(zip(skin_points, loads, strict=True)):
        b, y = (block[:, 3 * n : 3 * n + 3] for block in (B, Y))
        axes = load.directions
        assert axes is not None  # the sites have directions
        displacements = b.T @ phi
        rigid = b.T @ structure.rigid_modes
        r = b.T @ y - (displacements / x) @ displacements.T - rigid @ rigid.T / structure.shift
        nu = skin.materials[k].nu
        tangential = (2 - nu) / (2 * (1 - nu))
        r = r - load.local_compliance * np.diag([1.0, tangential, tangential])
        residual.append(axes.T @ _positive_part(r) @ axes)
        shapes.append((axes.T @ displacements).T)

    radii = [_radii(structure, skin, k, corner_radius) for k in skin_points.tolist()]
    return np.array(shapes), np.array(residual), np.array(radii)


def _radii(
    structure: Structure, skin: Skin, vertex: int, corner_radius: float
) -> tuple[float, float]:
    """Principal radii [m] at a vertex: of the fitted surface on a smooth solid, else of `skin`.

    corner_radius : radius [m] of sharp corners.
    """
    from antiosc.reduce.site.surface import curvature_at

    if skin.sharp[vertex] or skin.half_thickness[vertex] or not len(skin.triangles):
        return skin.radii(vertex, corner_radius)
    with suppress(InputError):  # of a mesh with too few nodes there
        surface = curvature_at(structure, skin.points[vertex])
        if surface.kind in (CURVED, LINE, PLANE):
            return skin.limited_radii(surface.values)
    return skin.radii(vertex, corner_radius)


def _site(skin: Skin, vertex: int, corner_radius: float) -> Site:
    """The site at a vertex: a patch on a solid, with the corner radius at a sharp vertex."""
    from antiosc import Site

    normal = skin.normals[vertex]
    inward = -normal if normal.any() else np.array([0.0, 0.0, 1.0])
    length = float(skin.edge_lengths[vertex])
    solid = skin.half_thickness[vertex] == 0 and length > 0 and len(skin.triangles)
    radius = corner_radius if skin.sharp[vertex] else length
    place = tuple(skin.points[vertex].tolist())
    return Site(place, tuple(inward.tolist()), radius if solid else None, tangential=True)


def _positive_part(matrix: Array) -> Array:
    """The symmetric part of a matrix with negative eigenvalues set to 0."""
    values, vectors = np.linalg.eigh((matrix + matrix.T) / 2)
    return np.asarray((vectors * np.maximum(values, 0.0)) @ vectors.T)
