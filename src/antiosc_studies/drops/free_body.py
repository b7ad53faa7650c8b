"""The record of a free body: rigid inertia, free modes, and the points that may touch."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np

from antiosc import ContactLaw
from antiosc.base._types import Array, BoolArray, IntArray
from antiosc.engine.contact.curvature import Curvature
from antiosc.engine.contact.surfaces import Matter
from antiosc_studies.drops.cylinder import Cylinder
from antiosc_studies.drops.layer_contact import LayerContact
from antiosc_studies.drops.skin import SMOOTH

if TYPE_CHECKING:
    from antiosc import Structure

#: Points of a solid are one contact that lie closer together than this share of the extent.
APART = 0.04

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
    matters : its materials, as far as they are known.
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
    matters: tuple[Matter, ...] = ()
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
        """Mass-normalised rigid modes at an orientation, as rows (6, 6) in the floor's axes.

        Velocities of the centre and spins; momenta, and angular momenta about the centre.
        """
        moments, axes = self.principal
        modes = np.eye(6)
        modes[3:, 3:] = axes @ R.T
        size = np.sqrt(np.append(np.full(3, self.mass), moments))[:, None]
        return modes / size, modes * size

    @property
    def slowest(self) -> float:
        """Longest period of the elastic modes [s]; 0 of a rigid body."""
        return 2 * np.pi / float(self.omega[0]) if self.omega.size else 0.0

    def reach(self, up: Array) -> Array:
        """(..., V) reach of the body below its points, for verticals (..., 3) in body axes.

        Stations of a line that does not land stay above the centre of mass: their axis may lie
        outside of the body, as that of a slightly bent face.
        """
        if not self.stations:
            return self.balls
        reach = np.broadcast_to(self.balls, (*up.shape[:-1], len(self.balls))).copy()
        for one, which in zip(self.cylinders, self.stations, strict=True):
            away = -np.linalg.norm(self.points[which], axis=1)
            reach[..., which] = np.where(one.lands(up)[..., None], self.balls[which], away)
        return reach

    def surface(self, which: int) -> Curvature:
        """Curvature at a point."""
        return Curvature.of_radii(*self.radii[which].tolist())

    def touching_as(self, which: list[int]) -> BoolArray:
        """(V,) mask of points that share a contact with one of the points `which`.

        Points of a solid are the same contact that are close together and face the same way, as
        on a round edge, or belong to one ball. Two corners of a slender bar are two.
        """
        touching = np.zeros(len(self.points), dtype=bool)
        touching[which] = True
        if self.facing is not None:
            by_itself = ~self.facing.any(axis=1)
            for i in which:
                near = np.linalg.norm(self.points - self.points[i], axis=1) <= APART * self.extent
                near &= ~(by_itself | by_itself[i])
                touching |= near & ((self.facing @ self.facing[i] >= SMOOTH) | (self.balls > 0))
        return touching

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
        """A copy without structure, with the data of all sites computed: for other processes."""
        self.sites(np.arange(len(self.points)))
        return replace(self, structure=None, basis=None, residual=None)
