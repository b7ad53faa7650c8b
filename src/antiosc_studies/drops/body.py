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
from dataclasses import dataclass, field, replace
from functools import cached_property, partial
from typing import TYPE_CHECKING, Any

import numpy as np

from antiosc.base import checks
from antiosc.base._types import Array, BoolArray, IntArray
from antiosc.base.errors import InputError, finite_element_packages, without_warnings
from antiosc.engine.contact import ContactLaw
from antiosc.engine.contact.curvature import CURVED, LINE, PLANE, Curvature
from antiosc.impact.bodies import RigidBody, Sphere
from antiosc.models.modal import Damping, as_damping
from antiosc_studies.drops.corners import columns, missing
from antiosc_studies.drops.lines import Cylinder, cylinders
from antiosc_studies.drops.skin import SMOOTH, THIN, Skin, hull, skin_of

if TYPE_CHECKING:
    from antiosc.fem.structure.structure import Structure
    from antiosc.reduce.site import Site
    from antiosc_studies.drops.layer import LayerContact


#: Radius [m] of a sharp corner where none is given, at most a quarter of the least dimension.
CORNER = 1e-3
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


Known = tuple[Array, Array, Array]


@dataclass(eq=False)
class FreeBody:
    """A free body with the points that may touch, V of them.

    Attributes
    ----------
    mass : [kg]; tensor : (3, 3) inertia about the centre of mass [kg m^2].
    points : (V, 3) relative to the centre [m]; with `balls` > 0 the centre of a ball of that
        radius [m], of which the body's surface is a part there.
    centre : (3,) of mass in the axes of the mesh [m].
    radii : (V, 2) principal radii for the law of the contact [m]; those of smooth places of a
        solid are rough until `sites` fits them.
    materials : (V, 2) Young's modulus [Pa] and Poisson's ratio; NaN where not known.
    strengths : (V,) yield strengths [Pa], NaN where not known; None: of none.
    omega, decay : (J,) of the elastic modes [rad/s], [1/s].
    shapes : (V, J, 3) displacements of the points in the modes [kg^-1/2].
    extent : size of the body [m].
    notes : what was taken for granted.
    facing : (V, 3) outward unit normals of a solid; None: each point touches by itself.
    structure : that it was made of, with `basis` (rows, J) the shapes of its modes.
    layer_contact : its surface, if it falls on a layer.
    lines : (N, 3) points of surfaces that are curved in one direction alone [m].
    laws, idle : of pieces of its surface on a layer and of stations on lines the laws by their
        numbers, and (V,) what is no contact.
    cylinders, stations : straight lines of the surface, and (STATIONS,) numbers of the points that
        stand for each where it may land along it.
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
    residual: Callable[[IntArray], tuple[Array, Array, Array]] | None = None
    layer_contact: LayerContact | None = None
    laws: dict[int, ContactLaw] = field(default_factory=dict)
    idle: BoolArray | None = None
    lines: Array = field(default_factory=lambda: np.zeros((0, 3)))
    cylinders: tuple[Cylinder, ...] = ()
    stations: tuple[IntArray, ...] = ()
    #: shapes, residual compliances and radii of points, which all copies share; those of stations
    #: of lines and of pieces of its surface on a layer
    _known: dict[int, Known] = field(default_factory=dict)
    _placed: dict[int, Known] = field(default_factory=dict)

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

    def reach(self, up: Array) -> Array:
        """(..., V) how far the body reaches below its points, for verticals (..., 3) in its axes.

        Stations of a line that does not land stay above the centre of mass: their axis may lie
        outside of the body, as that of a slightly bent face.
        """
        if not self.stations:
            return self.balls
        found = np.broadcast_to(self.balls, (*up.shape[:-1], len(self.balls))).copy()
        for one, which in zip(self.cylinders, self.stations, strict=True):
            away = -np.linalg.norm(self.points[which], axis=1)
            found[..., which] = np.where(one.lands(up)[..., None], self.balls[which], away)
        return found

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
        there = self._placed.keys() | self._known.keys()
        new = np.array([i for i in which.tolist() if i not in there], dtype=int)
        if len(new):
            r = np.zeros((len(new), 3, 3))
            if self.residual is not None:
                self.shapes[new], r, self.radii[new] = self.residual(new)
            pairs = zip(self.shapes[new], r, self.radii[new].copy(), strict=True)
            self._known.update(zip(new.tolist(), pairs, strict=True))
        known = [self._placed.get(i) or self._known[i] for i in which.tolist()]
        phi, r, self.radii[which] = (np.array(each) for each in zip(*known, strict=True))
        self.shapes[which] = phi
        return phi, r

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
    whole, found = inertia[0], ModeSolver(structure).lowest(count)
    omega, phi = found.omega[:count], found.phi[:, :count]
    points, _, moved = source(structure).at_nodes(structure, phi)
    skin = skin_of(structure)
    own = hull(skin.points)
    at, balls = cKDTree(points).query(skin.points[own])[1], skin.balls_within(own)
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
    body.cylinders = cylinders(body, skin, own)
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
) -> tuple[Array, Array, Array]:
    """Shapes, residual compliances and radii of patches at vertices of the hull `own`."""
    from antiosc.reduce.site import functionals

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
    radii = [_radii(structure, skin, k, corner) for k in chosen.tolist()]
    return np.array(shapes), np.array(residual), np.array(radii)


def _radii(structure: Structure, skin: Skin, which: int, corner: float) -> tuple[float, float]:
    """Principal radii [m] of a vertex, of a smooth place of a solid from the surface around it."""
    from antiosc.reduce.site.curvature import curvature_at

    if skin.sharp[which] or skin.half[which] or not len(skin.triangles):
        return skin.radii(which, corner)
    with suppress(InputError):  # of a mesh with too few nodes there
        surface = curvature_at(structure, skin.points[which], lengths=False)
        if surface.kind in (CURVED, LINE, PLANE):
            return skin.rounded(surface.values)
    return skin.radii(which, corner)


def _site(skin: Skin, which: int, corner: float) -> Site:
    """The site of a vertex: a patch on a solid, of the size of its radius on edges and corners."""
    from antiosc.reduce.site import Site

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
