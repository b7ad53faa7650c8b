"""A free body as a drop needs it: rigid inertia, free modes, and the points that may touch.

All is given in axes fixed to the body whose origin is its centre of mass. The elastic displacement
of a point is sum_j phi_j q_j with mass-normalised free modes, to which a point of contact adds the
residual compliance r of the modes that are left out,

    r = B'(K + sM)^-1 B - sum_j phi_j phi_j'/(omega_j^2 + s),

B the loads of its patch along three directions and s the shift of the structure. What the patch of
a smooth solid gives way as a part of a half-space is taken out of r: Hertz's law has it.
"""

from __future__ import annotations

from collections.abc import Callable
from contextlib import suppress
from dataclasses import dataclass, field, fields, replace
from functools import cached_property, partial
from typing import TYPE_CHECKING, Any, cast

import numpy as np

from antiosc.base import checks
from antiosc.base._types import Array, BoolArray, IntArray
from antiosc.base.errors import InputError, finite_element_packages, without_warnings
from antiosc.contact import ContactLaw
from antiosc.contact.curvature import Curvature
from antiosc.models.modal import Damping, as_damping
from antiosc.simulation.bodies import RigidBody, Sphere
from antiosc.studies.drops.corners import columns, missing

if TYPE_CHECKING:
    from antiosc.fem.site import Site
    from antiosc.fem.structure.meshed import MeshedStructure
    from antiosc.fem.structure.structure import Structure
    from antiosc.studies.drops.bed import Bed


#: Radius [m] of a sharp corner where none is given, at most a quarter of the least dimension.
CORNER = 1e-3
#: Cosine of the angle between the facets at a vertex and its mean normal, below which it is sharp.
SMOOTH = float(np.cos(np.radians(35.0)))
#: A radius of curvature is at most this many times the size of the part.
FLATTEST = 10.0
#: Ratio of the principal curvatures from which a rounded place is taken as a part of a ball.
ROUND = 0.5
#: Ratio of the principal curvatures below which a place is straight in one direction.
STRAIGHT = 0.2
#: Directions whose extent is below this share of the largest one have none.
THIN = 1e-9


@dataclass(frozen=True, eq=False)
class Skin:
    """The vertices of a surface, P of them.

    Attributes
    ----------
    points, normals : (P, 3) coordinates [m] and outward unit normals, zero where not known.
    curvatures : (P, 2) principal curvatures [1/m], > 0 where the surface is convex.
    sharp : (P,) whether the vertex lies on an edge or a corner.
    sizes : (P,) mean length of the element edges there [m].
    materials : (P, 2) Young's modulus [Pa] and Poisson's ratio; NaN where not known.
    strengths : (P,) yield strengths [Pa]; NaN where not known.
    half : (P,) half the thickness of a sheet [m]; 0 of a solid.
    triangles : (T, 3) between the points.
    """

    points: Array
    normals: Array
    curvatures: Array
    sharp: BoolArray
    sizes: Array
    materials: Array
    strengths: Array
    half: Array
    triangles: IntArray

    @property
    def size(self) -> float:
        """Diagonal of the box around the points [m]."""
        return float(np.linalg.norm(np.ptp(self.points, axis=0)))

    def radii(self, which: int, corner: float) -> tuple[float, float]:
        """Principal radii [m] of a vertex; of a sharp one `corner`, of a sheet's half of it."""
        if self.sharp[which]:
            rounded = float(self.half[which]) or corner
            return rounded, rounded
        least = 1 / (FLATTEST * self.size)
        first, second = np.maximum(self.curvatures[which], least)
        return 1 / float(first), 1 / float(second)

    @property
    def balls(self) -> Array:
        """(P,) radius of the ball that a smooth vertex is a part of [m]; 0 of all others."""
        low, high = self.curvatures.T
        rounded = ~self.sharp & (low > ROUND * high) & (high * self.size > 1)
        return np.where(rounded, 2 / np.where(rounded, low + high, 1.0), 0.0)

    @property
    def lines(self) -> BoolArray:
        """(P,) whether a smooth vertex is curved in one direction alone, as on a cylinder."""
        low, high = self.curvatures.T
        return ~self.sharp & (np.abs(low) < STRAIGHT * high) & (high * self.size > 1)


def skin_of(structure: Structure) -> Skin:
    """The surface of a structure of meshes, or the nodes of given matrices with coordinates."""
    from antiosc.fem.structure.structure import on_mesh  # needs the finite-element packages

    matrices: Any = structure.matrices
    if matrices.located:
        return of_points(matrices.nodes()[0])
    if not matrices.assembled:
        return of_mesh(on_mesh(structure, "matrices have no points: give a map with coordinates."))
    found, count = list[Skin](), 0
    for member in matrices.members():
        own, at = of_mesh(member.part), member.at
        x, n = at.placed(own.points), own.normals @ at.rotation.T
        found.append(replace(own, points=x, normals=n, triangles=own.triangles + count))
        count += len(x)
    each = [f.name for f in fields(Skin)]
    return Skin(*(np.concatenate([getattr(one, name) for one in found]) for name in each))


def of_points(points: Array) -> Skin:
    """Points without a surface: all of them are sharp."""
    zero, zeros = np.zeros(len(points)), np.zeros((len(points), 3))
    sharp, triangles = np.ones(len(points), dtype=bool), np.zeros((0, 3), dtype=int)
    unknown = np.full((len(points), 2), np.nan)
    known = zero, unknown, unknown[:, 0], zero
    return Skin(points, zeros, zeros[:, :2], sharp, *known, triangles)


def of_mesh(part: MeshedStructure) -> Skin:
    """The surface of one mesh."""
    from antiosc.fem.site.map_sites import surface

    ground = surface(part, None)
    x, normals, count = ground.points, ground.normals, ground.elements.shape[1]
    sides = np.vstack([ground.elements[:, [i, (i + 1) % count]] for i in range(count)])
    edges = np.unique(np.sort(sides, axis=1), axis=0)
    at = np.vstack([edges, edges[:, ::-1]])  # both ways
    length = np.linalg.norm(x[at[:, 0]] - x[at[:, 1]], axis=1)
    sizes = np.bincount(at[:, 0], length, len(x)) / np.maximum(
        np.bincount(at[:, 0], minlength=len(x)), 1
    )
    materials, strengths, half = _materials(part)
    found = replace(of_points(x), normals=normals, sizes=sizes, materials=materials)
    found = replace(found, strengths=strengths, half=half)
    if count != 3:
        return found
    found = replace(found, triangles=ground.elements)
    if not part.kind.outside:
        return found
    sharp = _sharp(x, normals, ground.elements)
    fitted, curvatures = _fitted(x, normals, at, sizes)
    normals = np.where(sharp[:, None], normals, fitted)
    return replace(found, normals=normals, curvatures=curvatures, sharp=sharp)


def _materials(part: MeshedStructure) -> tuple[Array, Array, Array]:
    """At the vertices moduli and Poisson's ratios (P, 2), yield strengths and half thicknesses."""
    faces = part.faces
    numbers = np.asarray(part.mesh.dolfinx.geometry.input_global_indices)[faces.vertices]
    vertices, index = np.unique(numbers, return_inverse=True)
    label = np.zeros(len(vertices), dtype=int)
    label[index.reshape(numbers.shape)] = part.part_of_cells()[faces.cells][:, None]
    known, half = np.full((len(part.parts), 2), np.nan), np.zeros(len(part.parts))
    strengths = np.full(len(part.parts), np.nan)
    for k, (material, _) in enumerate(part.parts):
        with suppress(InputError):  # of a material with directions
            known[k] = material.constants()[:2]
            strengths[k] = getattr(material, "yield_strength", None) or np.nan
        if part.kind.sheet:
            half[k] = 0.5 * material.section.thickness
    return known[label], strengths[label], half[label]


def _sharp(x: Array, normals: Array, triangles: IntArray) -> BoolArray:
    """Which vertices have facets that are inclined to their mean normal."""
    corners = x[triangles]
    across = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    across /= np.linalg.norm(across, axis=1, keepdims=True)
    cosine = np.abs(np.einsum("td,tvd->tv", across, normals[triangles]))
    least = np.ones(len(x))
    np.minimum.at(least, triangles, cosine)
    return least < SMOOTH


def _fitted(x: Array, normals: Array, edges: IntArray, size: Array) -> tuple[Array, Array]:
    """Normals (P, 3) and principal curvatures (P, 2), ascending, of quadrics through neighbours.

    Over the plane of the mean normal the neighbours lie at a u + b v + (c u^2 + 2 d u v + e v^2)/2.
    edges: (E, 2) from vertices to their neighbours; size: (P,) their mean lengths [m].
    """
    at = edges[:, 0]
    way = x[edges[:, 1]] - x[at]
    axis = np.eye(3)[np.argmin(np.abs(normals), axis=1)]
    first = np.cross(normals, axis)
    first /= np.maximum(np.linalg.norm(first, axis=1, keepdims=True), np.finfo(float).tiny)
    second = np.cross(normals, first)
    own = way / size[at, None]
    u, v, w = (np.einsum("ed,ed->e", own, axes[at]) for axes in (first, second, normals))
    rows = np.stack([u, v, u * u / 2, u * v, v * v / 2], axis=1)
    A, f = np.zeros((len(x), 5, 5)), np.zeros((len(x), 5))
    np.add.at(A, at, rows[:, :, None] * rows[:, None, :])
    np.add.at(f, at, rows * w[:, None])
    a, b, c, d, e = np.einsum("pij,pj->ip", np.linalg.pinv(A, rcond=1e-9), f)
    fitted = normals - a[:, None] * first - b[:, None] * second
    fitted /= np.maximum(np.linalg.norm(fitted, axis=1, keepdims=True), np.finfo(float).tiny)
    bend = -np.stack([np.stack([c, d], axis=1), np.stack([d, e], axis=1)], axis=1)
    return fitted, np.linalg.eigvalsh(bend / size[:, None, None])


def hull(points: Array) -> IntArray:
    """Numbers of the points (P, 3) that are vertices of their convex hull, flat or not."""
    from scipy.spatial import ConvexHull

    middle = points.mean(axis=0)
    _, size, axes = np.linalg.svd(points - middle, full_matrices=False)
    own = (points - middle) @ axes[size > THIN * size[0]].T
    if own.shape[1] == 0:
        return np.zeros(1, dtype=int)
    if own.shape[1] == 1:
        return np.array([np.argmin(own), np.argmax(own)])
    return np.sort(cast(IntArray, ConvexHull(own).vertices)).astype(int)


#: Free elastic modes where none are asked for, and most: their shapes and forces fill the memory.
MODES, MOST_MODES = 60, 5000
#: Damping ratio of the free modes where none is given.
RATIO = 0.01
#: Vertices of the hull up to which the patches of all of them are made with the modes.
FEW = 16
#: Points of a solid are one contact that lie closer together than this share of the extent.
APART = 0.04
#: Poisson's ratio of a material without one, for the tangential compliance of its patch.
UNKNOWN_NU = 0.3


@dataclass(eq=False)
class FreeBody:
    """A free body with the points that may touch, V of them.

    Attributes
    ----------
    mass : [kg]; tensor : (3, 3) inertia about the centre of mass [kg m^2].
    points : (V, 3) relative to the centre [m]; with `balls` > 0 the centre of a ball of that
        radius [m], of which the body's surface is a part there.
    centre : (3,) of mass in the axes of the mesh [m].
    radii : (V, 2) principal radii for the law of the contact [m].
    materials : (V, 2) Young's modulus [Pa] and Poisson's ratio; NaN where not known.
    strengths : (V,) yield strengths [Pa], NaN where not known; None: of none.
    omega, decay : (J,) of the elastic modes [rad/s], [1/s].
    shapes : (V, J, 3) displacements of the points in the modes [kg^-1/2].
    extent : size of the body [m].
    notes : what was taken for granted.
    facing : (V, 3) outward unit normals of a solid; None: each point touches by itself.
    structure : that it was made of, with `basis` (rows, J) the shapes of its modes.
    bed : its surface, if it falls on a layer.
    lines : (N, 3) points of surfaces that are curved in one direction alone [m].
    laws, idle : of a body on a bed, laws of pieces by their numbers, and (V,) what is no contact.
    """

    mass: float
    tensor: Array
    points: Array
    centre: Array
    balls: Array
    radii: Array
    materials: Array
    omega: Array
    decay: Array
    shapes: Array
    extent: float
    notes: tuple[str, ...] = ()
    facing: Array | None = None
    strengths: Array | None = None
    structure: Structure | None = None
    basis: Array | None = None
    residual: Callable[[IntArray], tuple[Array, Array]] | None = None
    bed: Bed | None = None
    laws: dict[int, ContactLaw] = field(default_factory=dict)
    idle: BoolArray | None = None
    lines: Array = field(default_factory=lambda: np.zeros((0, 3)))
    _known: dict[int, tuple[Array, Array]] = field(default_factory=dict)

    @cached_property
    def principal(self) -> tuple[Array, Array]:
        """Principal moments (3,) [kg m^2] and their axes as rows (3, 3)."""
        moments, axes = np.linalg.eigh(self.tensor)
        return moments, np.asarray(axes.T)

    @cached_property
    def inverse(self) -> Array:
        """(3, 3) inverse of the inertia tensor."""
        return np.linalg.inv(self.tensor)

    @property
    def sizes(self) -> Array:
        """(V, J) lengths of the displacements of the points in the modes [kg^-1/2]."""
        return np.asarray(np.linalg.norm(self.shapes, axis=2))

    def rigid_modes(self, R: Array) -> tuple[Array, Array]:
        """The mass-normalised rigid modes at an orientation, as rows (6, 6) in the floor's axes.

        Velocities of the centre and spins; momenta, and angular momenta about the centre.
        """
        moments, axes = self.principal
        own = np.eye(6)
        own[3:, 3:] = axes @ R.T
        size = np.sqrt(np.append(np.full(3, self.mass), moments))[:, None]
        return own / size, own * size

    @property
    def slowest(self) -> float:
        """Longest period of the elastic modes [s]; 0 of a rigid body."""
        return 2 * np.pi / float(self.omega[0]) if self.omega.size else 0.0

    def surface(self, which: int) -> Curvature:
        """Curvature at a point."""
        return Curvature.of_radii(*self.radii[which].tolist())

    def touching_as(self, which: list[int]) -> BoolArray:
        """(V,) whether a point is one of some points, or the same contact as one of them.

        Points of a solid are the same contact that are close together and face the same way, as
        on a round edge, or belong to one ball. Two corners of a slender bar are two.
        """
        found = np.zeros(len(self.points), dtype=bool)
        found[which] = True
        if self.facing is not None:
            by_itself = ~self.facing.any(axis=1)
            for i in which:
                near = np.linalg.norm(self.points - self.points[i], axis=1) <= APART * self.extent
                near &= ~(by_itself | by_itself[i])
                found |= near & ((self.facing @ self.facing[i] >= SMOOTH) | (self.balls > 0))
        return found

    def sites(self, which: IntArray) -> tuple[Array, Array]:
        """Shapes (n, J, 3) and residual compliances (n, 3, 3) of the patches at points (n,)."""
        new = np.array([i for i in which.tolist() if i not in self._known], dtype=int)
        if len(new):
            if self.residual is None:
                found = self.shapes[new], np.zeros((len(new), 3, 3))
            else:
                found = self.residual(new)
                self.shapes[new] = found[0]
            self._known.update(zip(new.tolist(), zip(*found, strict=True), strict=True))
        pairs = [self._known[i] for i in which.tolist()]
        return np.array([phi for phi, _ in pairs]), np.array([r for _, r in pairs])

    def alone(self) -> FreeBody:
        """The same without its structure, all its sites known: for other processes."""
        self.sites(np.arange(len(self.points)))
        return replace(self, structure=None, basis=None, residual=None)


def free_body(part: Any, modes: int, damping: Any, corner: float | None) -> FreeBody:
    """The body of a `Structure`, a `RigidBody` or a `Sphere`; InputError for others."""
    given = as_damping(damping)
    if isinstance(part, FreeBody):
        return part
    if corner is not None:
        corner = checks.positive("corner_radius", corner, "m")
    if isinstance(part, Sphere):
        tensor = 0.4 * part.mass * part.radius**2 * np.eye(3)
        alike = part.radius, part.radius, (part.E, part.nu)
        return _rigid(part.mass, tensor, np.zeros((1, 3)), np.zeros(3), *alike)
    if isinstance(part, RigidBody):
        if not part.sites:
            raise InputError("a RigidBody that is dropped needs sites: the points that may touch.")
        points, centre = np.array([x for x, _ in part.sites.values()]), np.asarray(part.centre)
        radius = CORNER if corner is None else corner
        return _rigid(part.mass, part.inertia, points - centre, centre, radius)
    with finite_element_packages():
        from antiosc.fem.structure.structure import Structure
    checks.instance("part", part, Structure, "a Structure, a RigidBody or a Sphere")
    return _elastic(part, modes, given, corner)


def _rigid(
    mass: float,
    tensor: Array,
    points: Array,
    centre: Array,
    radius: float,
    ball: float = 0.0,
    material: tuple[float, float] = (np.nan, np.nan),
) -> FreeBody:
    """A body without modes, of points with a radius [m]."""
    count, none = len(points), np.zeros(0)
    extent = float(np.linalg.norm(np.ptp(points, axis=0))) or float(np.abs(points).max())
    alike = np.full(count, ball), np.full((count, 2), radius), np.full((count, 2), material)
    modes = none, none, np.zeros((count, 0, 3))
    return FreeBody(mass, tensor, points, centre, *alike, *modes, extent or 2 * radius)


def _elastic(
    structure: Structure, count: int, given: Damping | None, corner: float | None
) -> FreeBody:
    """The free modes of a structure and the points of its hull."""
    from scipy.spatial import cKDTree

    from antiosc.fem.extraction.eigenmodes import ModeSolver
    from antiosc.fem.fields import source
    from antiosc.fem.structure.structure import refuse_dampers

    if structure.comm.size > 1:
        raise InputError("a drop runs on one rank; start it without mpirun.")
    refuse_dampers(structure, "a drop")
    inertia = structure.rigid_inertia
    if structure.rigid_modes.shape[1] != 6 or inertia is None:
        raise InputError(
            f"a part that is dropped is free in space, with six rigid-body modes; this one has "
            f"{structure.rigid_modes.shape[1]}: leave its supports out."
        )
    whole, found = inertia[0], ModeSolver(structure).lowest(count)
    omega, phi = found.omega[:count], found.phi[:, :count]
    points, _, moved = source(structure).at_nodes(structure, phi)
    skin = skin_of(structure)
    own = hull(skin.points)
    at, balls = cKDTree(points).query(skin.points[own])[1], skin.balls[own]
    notes = []
    rounded = min(CORNER, _least(structure, skin) / 4) if corner is None else corner
    if corner is None and (skin.sharp[own] & (skin.half[own] == 0)).any():
        notes += [f"sharp corners are taken with a radius of {rounded:.3g} m (corner_radius)"]
    if given is None:
        notes += [f"the modes have a damping ratio of {RATIO:g} (damping)"]
    centre, arm = whole.centre, whole.point - whole.centre
    tensor = whole.matrix[3:, 3:] - whole.mass * (arm @ arm * np.eye(3) - np.outer(arm, arm))
    body = FreeBody(
        mass=whole.mass,
        centre=centre,
        tensor=(tensor + tensor.T) / 2,
        points=skin.points[own] - balls[:, None] * skin.normals[own] - centre,
        balls=balls,
        radii=np.array([skin.radii(i, rounded) for i in own]),
        materials=skin.materials[own],
        strengths=skin.strengths[own],
        omega=omega,
        decay=(Damping(ratio=RATIO) if given is None else given).decay(omega),
        shapes=np.moveaxis(moved[at], 1, 2).copy(),
        extent=skin.size,
        notes=tuple(notes),
        facing=None if skin.half.any() else skin.normals[own],
        structure=structure,
        basis=phi,
        residual=partial(_residual, structure, phi, omega, skin, own, rounded),
        lines=skin.points[skin.lines] - centre,
    )
    many = skin.sharp[own] & (skin.half[own] == 0)  # which take a finer mesh each
    if len(own) <= FEW and not many.any():  # all of them will touch: together they cost less
        body.sites(np.arange(len(own)))
    return body


def _least(structure: Structure, skin: Skin) -> float:
    """Least dimension of a part [m]; of nodes alone that of their box that is not 0."""
    matrices: Any = structure.matrices
    if not matrices.located:
        return structure.dimensions[2]
    sides = np.ptp(skin.points, axis=0)
    return float(sides[sides > THIN * skin.size].min())


def _residual(
    structure: Structure,
    phi: Array,
    omega: Array,
    skin: Skin,
    own: IntArray,
    corner: float,
    which: IntArray,
) -> tuple[Array, Array]:
    """Shapes and residual compliances of patches at vertices of the hull `own`; see `sites`."""
    from antiosc.fem.site import functionals

    chosen = own[which]
    sites = [_site(skin, k, corner) for k in chosen.tolist()]
    with without_warnings():
        found = functionals(structure, sites)
    B = np.column_stack([columns(one) for one in found])
    Y = structure.factorize().solve_block(B)
    lacks = _lacking(structure, skin, chosen, sites)
    x, shapes, residual = omega**2 + structure.shift, [], []
    for n, (k, one) in enumerate(zip(chosen, found, strict=True)):
        b, y = (each[:, 3 * n : 3 * n + 3] for each in (B, Y))
        axes = np.array([one.direction, *(a.direction for a in one.across)])
        moved, rigid = b.T @ phi, b.T @ structure.rigid_modes
        r = b.T @ y - (moved / x) @ moved.T - rigid @ rigid.T / structure.shift + lacks[n]
        nu = float(np.nan_to_num(skin.materials[k, 1], nan=UNKNOWN_NU))
        aside = (2 - nu) / (2 * (1 - nu))
        r = r - one.local_compliance * np.diag([1.0, aside, aside])
        residual.append(axes.T @ _positive(r) @ axes)
        shapes.append((axes.T @ moved).T)
    return np.array(shapes), np.array(residual)


def _site(skin: Skin, which: int, corner: float) -> Site:
    """The site of a vertex: a patch on a solid, of the size of its radius on edges and corners."""
    from antiosc.fem.site import Site

    normal = skin.normals[which]
    push = -normal if normal.any() else np.array([0.0, 0.0, 1.0])
    solid = skin.half[which] == 0 and skin.sizes[which] > 0 and len(skin.triangles)
    radius = corner if skin.sharp[which] else float(skin.sizes[which])
    place = tuple(skin.points[which].tolist())
    return Site(place, tuple(push.tolist()), radius if solid else None, tangential=True)


def _lacking(structure: Structure, skin: Skin, chosen: IntArray, sites: list[Site]) -> Array:
    """What the mesh lacks of the compliances of sites (n, 3, 3) on edges and corners [m/N]."""
    found = np.zeros((len(sites), 3, 3))
    sharp = np.flatnonzero(skin.sharp[chosen] & [site.radius is not None for site in sites])
    matrices: Any = structure.matrices
    if not len(sharp) or matrices.located:
        return found
    members = matrices.members()
    points = skin.points[chosen[sharp]]
    nearest = np.argmin([member.closest(points).distance for member in members], axis=0)
    for number, member in enumerate(members):
        those = sharp[nearest == number]
        own = [_in_part(sites[i], member) for i in those]
        lacks = missing(member.part, own) if len(those) else None
        if lacks is not None:
            found[those] = lacks
    return found


def _in_part(site: Site, member: Any) -> Site:
    """A site in the axes of its part."""
    place = member.at.own(np.array([site.point]))[0]
    along = np.array(site.direction) @ member.at.rotation
    return replace(site, point=tuple(place.tolist()), direction=tuple(along.tolist()))


def _positive(matrix: Array) -> Array:
    """The symmetric matrix without its negative eigenvalues."""
    values, vectors = np.linalg.eigh((matrix + matrix.T) / 2)
    return np.asarray((vectors * np.maximum(values, 0.0)) @ vectors.T)
