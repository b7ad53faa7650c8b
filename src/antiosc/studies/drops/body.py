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
from dataclasses import dataclass, field, replace
from functools import cached_property, partial
from typing import TYPE_CHECKING, Any

import numpy as np
from scipy.linalg import block_diag

from antiosc.base import checks
from antiosc.base._types import Array, BoolArray, IntArray
from antiosc.base.errors import InputError, finite_element_packages, without_warnings
from antiosc.models.modal import Damping, as_damping
from antiosc.simulation.bodies import RigidBody, Sphere
from antiosc.studies.drops.skin import CORNER, SMOOTH, Skin, hull, skin_of

if TYPE_CHECKING:
    from antiosc.fem.structure.structure import Structure

#: Free elastic modes where none are asked for.
MODES = 60
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
        own = block_diag(np.eye(3), axes @ R.T)
        size = np.sqrt(np.append(np.full(3, self.mass), moments))[:, None]
        return own / size, own * size

    @property
    def slowest(self) -> float:
        """Longest period of the elastic modes [s]; 0 of a rigid body."""
        return 2 * np.pi / float(self.omega[0]) if self.omega.size else 0.0

    def touching_as(self, which: list[int]) -> BoolArray:
        """(V,) whether a point is one of some points, or the same contact as one of them.

        Points of a solid are the same contact that are close together and face the same way, as
        on a round edge, or belong to one ball. Two corners of a slender bar are two.
        """
        found = np.zeros(len(self.points), dtype=bool)
        found[which] = True
        if self.facing is not None:
            for i in which:
                near = np.linalg.norm(self.points - self.points[i], axis=1) <= APART * self.extent
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
    return _elastic(part, modes, damping, corner)


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


def _elastic(structure: Structure, count: int, damping: Any, corner: float | None) -> FreeBody:
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
    whole, given = inertia[0], as_damping(damping)
    found = ModeSolver(structure).lowest(checks.whole("modes", count))
    omega, phi = found.omega[:count], found.phi[:, :count]
    points, _, moved = source(structure).at_nodes(structure, phi)
    skin = skin_of(structure)
    own = hull(skin.points)
    at, balls = cKDTree(points).query(skin.points[own])[1], skin.balls[own]
    notes = []
    rounded = min(CORNER, structure.dimensions[2] / 4) if corner is None else corner
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
        residual=partial(_residual, structure, phi, omega, skin, own),
    )
    if len(own) <= FEW:  # all of them will touch, and together they cost less
        body.sites(np.arange(len(own)))
    return body


def _residual(
    structure: Structure, phi: Array, omega: Array, skin: Skin, own: IntArray, which: IntArray
) -> tuple[Array, Array]:
    """Shapes and residual compliances of patches at vertices of the hull `own`; see `sites`."""
    from antiosc.fem.site.functionals import functionals
    from antiosc.fem.site.site import Site

    sites = []
    for k in own[which].tolist():
        push = -skin.normals[k] if np.any(skin.normals[k]) else np.array([0.0, 0.0, 1.0])
        solid = skin.half[k] == 0 and skin.sizes[k] > 0 and len(skin.triangles)
        radius = float(skin.sizes[k]) if solid else None
        sites.append(Site(tuple(skin.points[k]), tuple(push), radius, tangential=True))
    with without_warnings():
        found = functionals(structure, sites)
    B = np.column_stack([np.column_stack([f.b, *(a.b for a in f.across)]) for f in found])
    Y = structure.factorize().solve_block(B)
    x, shapes, residual = omega**2 + structure.shift, [], []
    for n, (k, one) in enumerate(zip(own[which], found, strict=True)):
        b, y = (each[:, 3 * n : 3 * n + 3] for each in (B, Y))
        axes = np.array([one.direction, *(a.direction for a in one.across)])
        moved, rigid = b.T @ phi, b.T @ structure.rigid_modes
        r = b.T @ y - (moved / x) @ moved.T - rigid @ rigid.T / structure.shift
        if not skin.sharp[k]:
            nu = float(np.nan_to_num(skin.materials[k, 1], nan=UNKNOWN_NU))
            aside = (2 - nu) / (2 * (1 - nu))
            r = r - one.local_compliance * np.diag([1.0, aside, aside])
        residual.append(axes.T @ _positive(r) @ axes)
        shapes.append((axes.T @ moved).T)
    return np.array(shapes), np.array(residual)


def _positive(matrix: Array) -> Array:
    """The symmetric matrix without its negative eigenvalues."""
    values, vectors = np.linalg.eigh((matrix + matrix.T) / 2)
    return np.asarray((vectors * np.maximum(values, 0.0)) @ vectors.T)
