"""The data of a free body: rigid inertia, free modes, and the points that may touch."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from typing import TYPE_CHECKING, TypeAlias

import numpy as np

from antiosc.base._types import Array, BoolArray, IntArray
from antiosc.engine.contact.surfaces import Matter
from antiosc_studies.drops.skin import Materials, Skin

if TYPE_CHECKING:
    from antiosc import Structure

#: Of at most so many points the patches of all are computed together: that costs less.
FEW_POINTS = 16

#: Indices of points.
Indices: TypeAlias = "slice | IntArray | Sequence[int]"
#: Shapes (J, 3), residual compliance (3, 3) and radii (2,) of the patch at a point.
Patch: TypeAlias = tuple[Array, Array, Array]


@dataclass(eq=False)
class FreeBody:
    """A free body with V points that may touch."""

    mass: float  # mass of the body [kg]
    inertia: Array  # (3, 3) inertia about the centre of mass [kg m^2]
    #: (V, 3) relative to the centre [m]; if `ball_radii` > 0, the centre of a ball of that radius
    #: [m] whose surface is that of the body there
    points: Array
    centre: Array  # (3,) centre of mass in the axes of the mesh [m]
    ball_radii: Array
    #: (V, 2) principal radii for the contact law [m]; at smooth places of a solid they are
    #: approximate until `patches` fits them
    radii: Array
    materials: Materials  # (V,) the `Matter` at the points; `RIGID_MATTER` if it is unknown
    #: omega, decay: (J,) frequencies [rad/s] and decay constants [1/s] of the elastic modes
    omega: Array
    decay: Array
    shapes: Array  # (V, J, 3) displacements of the points in the modes [kg^-1/2]
    extent: float  # size of the body [m]
    notes: tuple[str, ...] = ()  # assumptions that were made
    #: (V, 3) outward unit normals of a solid; None: each point touches by itself
    normals: Array | None = None
    #: the part, with `basis` (rows, J) the shapes of its modes and `skin` its surface
    structure: Structure | None = None
    basis: Array | None = None
    skin: Skin | None = None
    patch_solver: Callable[[tuple[int, ...]], Patch] | None = None  # computes the patches at points
    #: (V,) whether a point is a sharp corner of a solid; None: none is
    sharp: BoolArray | None = None
    corner_radius: float = 0.0  # [m]; points of a solid that are closer are one contact
    #: index of a sharp point of a solid -> (n, 2, 3) two edges of each facet, from the point
    facets: dict[int, Array] = field(default_factory=dict)
    #: index of a point -> its patch, if computed; shared by all copies of the body
    _patches: dict[int, Patch] = field(default_factory=dict)

    @cached_property
    def principal_inertia(self) -> tuple[Array, Array]:
        """Principal moments (3,) [kg m^2] and their axes as rows (3, 3)."""
        moments, axes = np.linalg.eigh(self.inertia)
        return moments, np.asarray(axes.T)

    @cached_property
    def inverse_inertia(self) -> Array:
        """(3, 3) inverse of the inertia tensor."""
        return np.linalg.inv(self.inertia)

    @property
    def mode_sizes(self) -> Array:
        """Magnitudes (V, J) of the displacements of the points in the modes [kg^-1/2]."""
        return np.asarray(np.linalg.norm(self.shapes, axis=2))

    def rigid_modes(self, R: Array) -> tuple[Array, Array]:
        """Mass-normalised rigid modes (6, 6) and their momenta (6, 6), as rows in the floor's axes.

        A mode is a velocity of the centre and a spin; its momentum is linear, and angular about the
        centre.
        """
        moments, axes = self.principal_inertia
        modes = np.eye(6)
        modes[3:, 3:] = axes @ R.T
        size = np.sqrt(np.append(np.full(3, self.mass), moments))[:, None]
        return modes / size, modes * size

    @property
    def longest_period(self) -> float:
        """Longest period of the elastic modes [s]; 0 for a rigid body."""
        return 2 * np.pi / float(self.omega[0]) if self.omega.size else 0.0

    @property
    def vertices(self) -> Array:
        """(V, 3) vertices of the surface relative to the centre [m]."""
        if self.normals is None:
            return self.points
        return self.points + self.ball_radii[:, None] * self.normals

    @property
    def matters(self) -> list[Matter]:
        """The known materials of the surface, without repetition."""
        materials = self.materials if self.skin is None else self.skin.materials
        return [m for m in {id(m): m for m in materials}.values() if not m.rigid]

    def patches(self, indices: IntArray) -> tuple[Array, Array]:
        """Shapes (n, J, 3) and residual compliances (n, 3, 3) of the patches at points (n,)."""
        count = len(self.points)
        asked = range(count) if count <= FEW_POINTS else indices.tolist()
        new = tuple(i for i in asked if i not in self._patches)
        if new:
            rows = list(new)
            r = np.zeros((len(new), 3, 3))
            if self.patch_solver is not None:
                self.shapes[rows], r, self.radii[rows] = self.patch_solver(new)
            patches = zip(self.shapes[rows], r, self.radii[rows], strict=True)
            self._patches.update(zip(new, patches, strict=True))

        phi, r, _ = (
            np.array(part) for part in zip(*map(self._patches.get, indices.tolist()), strict=True)
        )
        return phi, r


@dataclass(frozen=True, eq=False)
class State:
    """The motion of a free body at one time."""

    time: float  # [s]
    #: centre, velocity: (3,) position and velocity of the centre of mass in the axes of the floor
    #: [m], [m/s]
    centre: Array
    velocity: Array
    R: Array  # (3, 3) rotation from the axes of the body to those of the floor
    angular_momentum: Array  # (3,) about the centre [kg m^2/s]
    #: q, p: (J,) elastic modal displacements and velocities
    q: Array
    p: Array

    def spin(self, body: FreeBody) -> Array:
        """Angular velocity (3,) in the axes of the floor [rad/s]."""
        return np.asarray(self.R @ (body.inverse_inertia @ (self.R.T @ self.angular_momentum)))

    def positions(self, body: FreeBody, indices: Indices = slice(None)) -> Array:
        """Positions (n, 3) [m] of the points relative to the centre, in the axes of the floor.

        For a ball it is the lowest point.
        """
        displaced = body.points[indices] + np.einsum("njd,j->nd", body.shapes[indices], self.q)
        arms = displaced @ self.R.T
        arms[:, 2] -= body.ball_radii[indices]
        return np.asarray(arms)

    def heights(self, body: FreeBody) -> Array:
        """Heights (V,) [m] of the points over the floor."""
        return np.asarray(self.centre[2] + self.positions(body)[:, 2])

    def energies(self, body: FreeBody, gravity: float) -> tuple[float, float, float]:
        """(kinetic energy of the rigid motion, energy of vibration, potential by gravity) [J]."""
        rigid = 0.5 * body.mass * self.velocity @ self.velocity
        rigid += 0.5 * self.angular_momentum @ self.spin(body)
        elastic = 0.5 * (self.p @ self.p + (body.omega * self.q) @ (body.omega * self.q))
        return float(rigid), float(elastic), float(body.mass * gravity * self.centre[2])
