"""Bodies of a scene: models, impactors, obstacles, rigid bodies, and modes seen from several sites.

Whatever a body is, a scene sees its modes, the displacements of its sites in them, and what its
motion carries (`Placed`). A site has one or more columns, each a displacement along a direction of
space; bodies that know no directions (a `RigidMass`, a model made by hand) have one column.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from antiosc.base import checks
from antiosc.base._types import Array
from antiosc.base.errors import InputError
from antiosc.base.texts import Given
from antiosc.models.anti_oscillators import AntiOscillators
from antiosc.models.body import Body, checked_body
from antiosc.models.first_order import SideBySide
from antiosc.models.modal import ModalBody
from antiosc.models.motion import Inertia, ModalState, Motion, unit_vectors
from antiosc.models.site_modes import SiteModes
from antiosc.simulation.bodies.impactors import Impactor, Obstacle

#: cosine of the angle beyond which two directions are not taken as one
PARALLEL = 0.999
#: the largest principal moment over the sum of the others, in figures that are rounded
TRIANGLE = 1.01
#: share of a body's momentum in its elastic modes from which supports hold it
HELD = 1e-6


@dataclass(frozen=True, eq=False)
class RigidBody(Given):
    """A rigid body with several sites; it moves in space, its rotations are small.

    Parameters
    ----------
    mass : float
        [kg].
    inertia : array_like, shape (3,) or (3, 3)
        Principal moments about the axes, or the inertia tensor, about the centre [kg m^2].
    sites : mapping
        Name -> (point, direction): place (3,) [m] and the direction (3,) in which the contact
        pushes the body there.
    centre : array_like, shape (3,)
        Centre of mass [m].

    Raises
    ------
    InputError
        For a mass that is not > 0 and an inertia that is not positive definite, or that no body
        has.
    """

    mass: float
    inertia: Array
    sites: Mapping[str, tuple[ArrayLike, ArrayLike]]
    centre: Array = (0.0, 0.0, 0.0)  # type: ignore[assignment]

    def __post_init__(self) -> None:
        object.__setattr__(self, "mass", checks.positive("mass", self.mass, "kg"))
        tensor = checks.array("inertia", self.inertia, None)
        tensor = np.diag(tensor) if tensor.shape == (3,) else tensor
        tensor = checks.array("inertia", tensor, (3, 3))
        size = np.abs(tensor).max()
        if np.abs(tensor - tensor.T).max() > 1e-9 * size or np.linalg.eigvalsh(tensor).min() <= 0:
            raise InputError(
                "inertia must be symmetric and positive definite [kg m^2]: three moments > 0 or"
                " their tensor."
            )
        moments = np.linalg.eigvalsh(tensor)
        if moments[2] > TRIANGLE * (moments[0] + moments[1]):
            raise InputError(
                f"inertia has the principal moments {moments[0]:g}, {moments[1]:g},"
                f" {moments[2]:g} kg m^2, which no body has: none exceeds the sum of the others."
            )
        object.__setattr__(self, "inertia", tensor)
        object.__setattr__(self, "centre", checks.array("centre", self.centre, (3,)))
        sites = {}
        checks.instance("sites", self.sites, Mapping, "a dict {name: (point, direction)}")
        for name, site in self.sites.items():
            checks.text("the name of a site", name)
            if not isinstance(site, tuple | list) or len(site) != 2:
                raise InputError(
                    f"site {name!r} must be (point, direction); got {checks.shown(site)}."
                )
            at = checks.array(f"point of site {name!r}", site[0], (3,))
            along = checks.array(f"direction of site {name!r}", site[1], (3,))
            sites[str(name)] = (at, unit_vectors(f"direction of site {name!r}", along[None])[0])
        object.__setattr__(self, "sites", sites)


@dataclass(eq=False)
class Placed:
    """A body as a scene sees it: its free modes, and how it begins.

    Attributes
    ----------
    body : as it was given.
    modes : its form in free modes.
    start : (J,) modal velocities; displaced : (J,) modal displacements, None for zero.
    gap : distance [m] that the body brings with it.
    local_compliance : half-space compliances [m/N] of the patches by site, which its modes contain.
    patch_radius : radius [m] of the patch of its one site, if it has one.
    pushes : direction (3,) in which the contact pushes each site, where known.
    axes : direction (3,) of each site's coordinate, of a body without `directions`, that its
        contacts give it.
    begun : states (2, I) of first-order modes at the start, None: those of `displaced` and `start`
        with relaxed branches.
    """

    name: str
    body: Any
    modes: ModalBody | SiteModes
    start: Array
    displaced: Array | None = None
    gap: float = 0.0
    local_compliance: Mapping[str, float] = field(default_factory=dict)
    patch_radius: float | None = None
    pushes: dict[str, Array] = field(default_factory=dict)
    axes: dict[str, Array] = field(default_factory=dict)
    begun: Array | None = None

    def __post_init__(self) -> None:
        if self.directions is not None and not self.pushes:
            self.pushes = {site: self.directions[own[0]] for site, own in self.sites.items()}

    @property
    def omega(self) -> Array:
        """Frequencies (J,) of its modes [rad/s]."""
        return self.modes.omega

    @property
    def decay(self) -> Array:
        """Decay constants (J,) [1/s]."""
        return np.zeros(self.omega.size) if self.modes.decay is None else self.modes.decay

    @property
    def B(self) -> Array:
        """Displacements (J, P) of all columns."""
        return self.modes.B

    @property
    def r(self) -> Array:
        """Residual compliance (P, P) of all columns."""
        return self.modes.R

    @property
    def sites(self) -> dict[str, tuple[int, ...]]:
        """The columns of each site."""
        return self.modes.columns

    @property
    def directions(self) -> Array | None:
        """Unit vectors (P, 3) of the columns, where known."""
        return self.modes.axes

    @property
    def inertia(self) -> Inertia | None:
        """Momentum of the modes, where known."""
        return self.modes.inertia

    @property
    def weight(self) -> Array | None:
        """Modal forces of a unit gravity: (J,) along its one coordinate, or (J, 3) along axes."""
        return self.modes.weight

    def columns_of(self, site: str) -> tuple[int, ...]:
        """The columns of a site; () of an obstacle."""
        return () if isinstance(self.body, Obstacle) else self.sites[site]

    def known(self, site: str) -> Array | None:
        """Directions (k, 3) of the first k columns of a site; None where they are not known."""
        if self.directions is not None:
            return self.directions[list(self.sites[site])]
        return self.axes[site][None] if site in self.axes else None

    def rotation(self, q: Array) -> Array:
        """Rotation vectors (n, 3) [rad] of the rigid motion with modal displacements q (n, J)."""
        if self.inertia is None:
            raise InputError(f"the model of {self.name!r} does not know how it turns.")
        return self.inertia.rotation(np.where(self.omega == 0, q, 0.0))

    @property
    def supported(self) -> bool:
        """Whether no rigid-body mode moves a site: measured from its equilibrium under gravity."""
        return not bool(np.any(self.B[self.omega == 0] != 0))

    @property
    def grounded(self) -> bool:
        """Whether it is the ground or its supports hold it, so that motion of the ground acts."""
        rigid = self.omega == 0
        if isinstance(self.body, Obstacle) or not rigid.any():
            return True
        carried = self.weight if self.inertia is None else self.inertia.momentum[:, :3]
        if carried is None:
            return False
        size = float(np.abs(carried).max(initial=0.0))
        return bool(np.any(np.abs(carried[~rigid]) > HELD * size))


def may_turn(body: Placed | ModalBody | SiteModes) -> bool:
    """Whether a body may turn, and its inertia in space is known."""
    return body.inertia is not None and not body.omega.all()


def first_order_of(bodies: Iterable[Placed]) -> SideBySide | None:
    """First-order modes of all bodies side by side, if one has them."""
    parts = [(body.omega, body.decay, body.modes.first_order, body.begun) for body in bodies]
    return None if all(first is None for _, _, first, _ in parts) else SideBySide(parts)


def place(name: str, body: object, motion: Motion | ModalState | float | None) -> Placed:
    """The body of that name with its start; InputError for a motion that it cannot have."""
    if isinstance(body, RigidBody):
        placed = _rigid(name, body)
    elif isinstance(body, SiteModes) or (isinstance(body, AntiOscillators) and body.sites):
        modes = body if isinstance(body, SiteModes) else body.site_modes()
        still = np.zeros(modes.omega.size)
        placed = Placed(name, body, modes, still, local_compliance=modes.local_compliance)
    else:
        placed = _single(name, body)
    if motion is not None:
        if isinstance(body, Obstacle):
            raise InputError(f"body {name!r} is an obstacle, which does not move.")
        if isinstance(motion, ModalState):
            if motion.velocities.size != placed.omega.size:
                raise InputError(
                    f"the ModalState of {name!r} has {motion.velocities.size} modes, the body"
                    f" {placed.omega.size}."
                )
            placed.displaced, placed.start = motion.displacements, motion.velocities
            placed.begun = motion.first_order
            first = placed.modes.first_order
            own = 0 if first is None else first.omega.size
            if placed.begun is not None and placed.begun.shape[1] != own:
                raise InputError(
                    f"the ModalState of {name!r} has {placed.begun.shape[1]} first-order modes, the"
                    f" body {own}."
                )
        else:
            placed.start = _started(placed, motion)
    return placed


def _single(name: str, body: object) -> Placed:
    asked = checked_body(f"body {name!r}", body)
    modes, velocity = asked.modal(), asked.velocity
    own = isinstance(body, Impactor)
    if own and not isinstance(velocity, Motion):
        velocity = -float(velocity) if modes.direction is not None else float(velocity)
    return of_one_site(name, body, asked, modes, modes.rigid_motion(velocity))


def of_one_site(name: str, body: object, asked: Body, modes: ModalBody, start: Array) -> Placed:
    """A body of one contact point, with its modal velocities (J,) at the start."""
    local = {"": asked.local_compliance}
    return Placed(
        name, body, modes, start,
        gap=asked.gap, local_compliance=local, patch_radius=asked.patch_radius,
    )  # fmt: skip


def _rigid(name: str, body: RigidBody) -> Placed:
    moments, axes = np.linalg.eigh(body.inertia)
    columns: list[Array] = []
    sites: dict[str, tuple[int, ...]] = {}
    pushes: dict[str, Array] = {}
    for i, (site, (point, push)) in enumerate(body.sites.items()):
        arm = np.asarray(point) - body.centre
        turn = np.cross(axes.T, arm) / np.sqrt(moments)[:, None]  # (3 rotations, 3 directions)
        columns.append(np.concatenate((np.eye(3) / np.sqrt(body.mass), turn)))
        sites[site] = (3 * i, 3 * i + 1, 3 * i + 2)
        pushes[site] = np.asarray(push)
    matrix = np.zeros((6, 6))
    matrix[:3, :3], matrix[3:, 3:] = body.mass * np.eye(3), body.inertia
    momentum = np.zeros((6, 6))
    momentum[:3, :3] = np.sqrt(body.mass) * np.eye(3)
    momentum[3:, 3:] = (axes * np.sqrt(moments)).T
    modes = SiteModes(
        omega=np.zeros(6),
        b=np.concatenate([np.zeros((6, 0)), *columns], axis=1),
        sites=sites,
        directions=np.tile(np.eye(3), (len(sites), 1)),
        inertia=Inertia(body.centre, matrix, momentum),
    )
    return Placed(name, body, modes, np.zeros(6), pushes=pushes)


def _started(placed: Placed, motion: Motion | float) -> Array:
    """Modal velocities of a body that moves without strain."""
    if not isinstance(motion, Motion):
        along = placed.directions is None or placed.inertia is None  # the speed along it
        if not along or placed.B.shape[1] != 1:
            raise InputError(
                f"body {placed.name!r} moves in space: give its start as a Motion(velocity=(...),"
                f" spin=(...)), not as the number {motion!r}."
            )
        motion = checks.number(f"motion of {placed.name!r}", motion, "m/s")
    return placed.modes.rigid_motion(motion)
