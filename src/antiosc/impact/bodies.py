"""Bodies of a scene: impactors (also standard ones by name), obstacles, rigid bodies, models.

In a scene, every body is a set of modes with the displacements of its sites, its initial motion
and its inertia (`SceneBody`). A site has one or more columns, each a displacement along a direction
in space; bodies without directions (a `RigidMass`, a model made by hand) have one column.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from functools import lru_cache
from math import inf, pi, sqrt
from typing import TYPE_CHECKING

import numpy as np

from antiosc.base import checks, plausible
from antiosc.base._types import Array, ArrayLike
from antiosc.base.checks import Checked, checked_by
from antiosc.base.errors import InputError
from antiosc.base.plausible import GRAVITY
from antiosc.base.texts import FieldsRepr
from antiosc.engine.contact import Gonthier, Hertz
from antiosc.engine.contact.surfaces import (
    RIGID_MATTER,
    Matter,
    Surface,
    ball,
    density_of,
    matter_of,
)
from antiosc.models.anti_oscillators import AntiOscillators
from antiosc.models.body import Body, LinearBody, ModelInfo, checked_body, info_of
from antiosc.models.modal import ModalBody, SiteModes, unchecked_body
from antiosc.models.motion import Inertia, ModalState, Motion, unit_vectors
from antiosc.models.stretch import Stretch, stretch_of

if TYPE_CHECKING:
    from antiosc.engine.first_order import StackedModes


@dataclass(frozen=True, repr=False)
class RigidMass(Checked, Body):
    """A rigid mass that moves along the direction of impact.

    Parameters
    ----------
    mass : float
        Mass [kg].
    velocity : float
        Velocity [m/s], > 0 toward the structure.
    tip_radius, E, nu : float, optional
        Radius [m] of the spherical tip, Young's modulus [Pa] and Poisson's ratio of the tip;
        `hertz` needs all three.
    yield_strength : float, optional
        Yield strength of the tip [Pa].
    material : str or a material, optional
        Material of the tip, instead of E, nu and yield_strength: a name, as for `material`, or a
        `Solid`.
    """

    mass: float = field(metadata=checked_by(checks.positive, "kg"))
    velocity: float = field(default=0.0, metadata=checked_by(checks.number, "m/s"))
    tip_radius: float | None = field(
        default=None, kw_only=True, metadata=checked_by(checks.positive, "m")
    )
    E: float | None = field(default=None, kw_only=True, metadata=checked_by(checks.positive, "Pa"))
    nu: float | None = field(
        default=None, kw_only=True, metadata=checked_by(lambda _, nu: checks.poisson(nu))
    )
    yield_strength: float | None = field(
        default=None, kw_only=True, metadata=checked_by(checks.positive, "Pa")
    )
    material: str | object | None = field(default=None, kw_only=True, repr=False)

    def __post_init__(self) -> None:
        super().__post_init__()
        if self.material is None and self.E is None:
            return
        matter = matter_of(self.material, self.E, self.nu, self.yield_strength)
        checks.store(self, material=matter, **_surface_constants(matter))

    def surface(self, site: str = "") -> Surface | None:
        """The surface of its spherical tip; None if radius or material is unknown."""
        if self.tip_radius is None or not isinstance(self.material, Matter):
            return None
        return ball(self.material, self.tip_radius)

    def hertz(
        self, E: float, nu: float, radii: float | tuple[float, float] = inf, angle: float = 0.0
    ) -> Hertz:
        """Hertz's law of the tip against a surface of modulus E [Pa], Poisson's ratio nu and
        `radii` [m].

        InputError for a mass without tip_radius, E and nu.
        """
        if self.tip_radius is None or self.E is None or self.nu is None:
            raise InputError(
                "Hertz's law of a rigid mass needs its tip: give tip_radius, E and nu, or the law "
                "itself."
            )
        return Hertz.from_radii(self.tip_radius, self.E, self.nu, radii, E, nu, angle)

    def modal(self) -> ModalBody:
        return _modes_of_mass(self.mass)


@dataclass(frozen=True, init=False, repr=False)
class Sphere(FieldsRepr, Body):
    """A solid elastic sphere without vibrations.

    Parameters
    ----------
    radius : float
        Radius [m].
    E, nu, rho : float
        Young's modulus [Pa], Poisson's ratio, density [kg/m^3].
    velocity : float
        Velocity [m/s], > 0 toward the structure.
    mass : float
        Mass [kg], instead of rho.
    yield_strength : float, optional
        Yield strength [Pa].
    material : str or a material, optional
        Instead of E, nu, rho and yield_strength: a name, as for `material`, or a `Solid`.
    """

    radius: float
    E: float
    nu: float
    rho: float
    velocity: float
    yield_strength: float | None = None
    material: str | object | None = field(default=None, repr=False)

    def __init__(
        self,
        radius: float,
        E: float | None = None,
        nu: float | None = None,
        rho: float | None = None,
        velocity: float = 0.0,
        *,
        mass: float | None = None,
        yield_strength: float | None = None,
        material: str | object | None = None,
    ) -> None:
        if material is not None and rho is None and mass is None:
            rho = density_of(material)
        if (rho is None) == (mass is None):
            raise InputError("a Sphere needs rho or mass, one of them, or a material.")
        if material is None and (E is None or nu is None):
            raise InputError("a Sphere needs E and nu, or the name of a material.")

        radius = checks.positive("radius", radius, "m")
        if mass is not None:
            rho = checks.positive("mass", mass, "kg") / (4 / 3 * pi * radius**3)

        modulus = None if E is None else checks.positive("E", E, "Pa")
        ratio = None if nu is None else checks.poisson(nu)
        matter = matter_of(material, modulus, ratio, yield_strength)
        checks.store(
            self,
            radius=radius,
            rho=checks.positive("rho", rho, "kg/m^3"),
            velocity=checks.number("velocity", velocity, "m/s"),
            material=matter,
            **_surface_constants(matter),
        )

        if mass is None:  # with a mass the radius may be that of a tip, and rho is no density
            size = plausible.range_doubt("radius", radius, "the radius of the sphere")
            density = plausible.range_doubt("density", self.rho, "the density of the sphere")
            plausible.warn_each([size, density])

    @property
    def mass(self) -> float:
        """Mass [kg]."""
        return self.rho * 4 / 3 * pi * self.radius**3

    def surface(self, site: str = "") -> Surface | None:
        """The surface of the sphere; None if its material is unknown."""
        if isinstance(self.material, Matter):
            return ball(self.material, self.radius)
        return None

    def hertz(
        self, E: float, nu: float, radii: float | tuple[float, float] = inf, angle: float = 0.0
    ) -> Hertz:
        """Hertz's law against a surface of modulus E [Pa], Poisson's ratio nu and `radii` [m]."""
        return Hertz.from_radii(self.radius, self.E, self.nu, radii, E, nu, angle)

    def modal(self) -> ModalBody:
        return _modes_of_mass(self.mass)


def _surface_constants(matter: Matter | None) -> dict[str, float | None]:
    """E, nu and yield strength of a surface's material."""
    names = ("E", "nu", "yield_strength")
    return {name: getattr(matter, name, None) for name in names}


#: The modes of an obstacle.
_NO_MODES = ModalBody(np.zeros(0), np.zeros(0), weight=np.zeros(0))


@dataclass(frozen=True, repr=False)
class Obstacle(FieldsRepr, Body):
    """A fixed rigid obstacle (velocity 0), `gap` [m] away from a structure that moves toward it."""

    gap: float = 0.0
    velocity: float = 0.0

    def __post_init__(self) -> None:
        velocity = checks.number("velocity", self.velocity, "m/s")
        if velocity != 0.0:
            raise InputError(
                f"an obstacle is fixed; give the structure an initial_velocity instead of"
                f" velocity = {velocity:g}."
            )

        checks.store(self, gap=checks.nonnegative("gap", self.gap, "m"), velocity=velocity)

    def surface(self, site: str = "") -> Surface | None:
        """The surface of the obstacle, a rigid plane."""
        return Surface(RIGID_MATTER)

    def modal(self) -> ModalBody:
        return _NO_MODES


@dataclass(frozen=True, repr=False)
class Impactor(FieldsRepr, Body):
    """Any linear body as impactor, such as a second `AntiOscillators` (Article Fig. 1).

    Its contact point is the site of its model; the contact force acts in the direction of the site.
    `velocity` is a number [m/s], > 0 toward the structure, or a `Motion` in the axes of the
    impactor's mesh, as `initial_velocity` of `simulate`. A supported body must have velocity 0.
    """

    body: LinearBody
    velocity: float | Motion = 0.0

    def __post_init__(self) -> None:
        velocity = self.velocity
        inner_body = checked_body("body", self.body)
        if not isinstance(velocity, Motion):
            velocity = checks.number("velocity", velocity, "m/s")
        checks.store(self, velocity=velocity, local_compliance=inner_body.local_compliance)

    @property
    def patch_radius(self) -> float | None:
        """Radius [m] of the patch of the body's site; None: a point."""
        return checked_body("body", self.body).patch_radius

    def surface(self, site: str = "") -> Surface | None:
        """The surface at the site of the body; None if it is unknown."""
        return checked_body("body", self.body).surface(site)

    def modal(self) -> ModalBody:
        return self.body.modal()


@lru_cache(maxsize=256)
def _modes_of_mass(mass: float) -> ModalBody:
    root = sqrt(mass)
    b = np.array([1 / root])
    return unchecked_body(omega=np.zeros(1), b=b, weight=np.array([root]), shape=b[None])


#: Steel (handbook values), Pa and kg/m³.
STEEL_CONSTANTS = {"E": 210e9, "nu": 0.3}
STEEL_DENSITY = 7850.0  # handbook value
#: Ice at 0 °C, kg/m³ (handbook value).
ICE_DENSITY = 917.0


@dataclass(frozen=True, repr=False)
class NamedImpactor(FieldsRepr):
    """A named impactor with the source of its numbers; numbers not in the source are None."""

    name: str  #: its name in `named_impactor`
    source: str  #: the document that gives the numbers
    mass: float | None  #: kg; None: it follows from the diameter
    speed: float | None = None  #: of the test that the standard prescribes, m/s
    tip_radius: float | None = None  #: m
    steel: bool = False  #: whether its surface is steel
    yield_strength: float | None = None  #: of its surface, Pa
    stiffness: float | None = None  #: of its contact with a plane, F = k δ, N/m
    restitution: float | None = None  #: on a rigid surface
    note: str = ""  #: unknown properties, and choices left to the user

    def law(self) -> Gonthier:
        """The contact law from stiffness and restitution; InputError if the source has none."""
        if self.stiffness is None or self.restitution is None:
            raise InputError(
                f"the source on the {self.name} has no stiffness and no restitution: give a "
                "contact law."
            )
        return Gonthier(self.stiffness, self.restitution, exponent=1.0)


_HAMMER_SOURCE = (
    "IEC 60068-2-75, table 1 (striking elements), as interelectronix.com reprints it; its steel is"
    " Fe 490-2 of ISO 1052, which yields at 290 MPa (issuhub.com, tensile properties of steels)"
)
#: Yield strength of the hammers' steel [Pa].
_HAMMER_STRENGTH = 290e6
_POLYAMIDE_NOTE = "tip of polyamide (Rockwell HRR 85 to 100): its modulus is not in the source"
_PENDULUM_SOURCE = (
    "EN 12600: two tyres, 50 kg (spevetro.it, fti-europe.com), drop heights (userdeck.net)"
)
_TENNIS_BALL_SOURCE = (
    "ITF Rules of Tennis, appendix I, ball type 2 (as tenniscircle.us reprints it): 56.0 to "
    "59.4 g, 6.54 to 6.86 cm, forward deformation 0.56 to 0.74 cm at 8.165 kg, rebound of 135 to "
    "147 cm from 254 cm; here the middles"
)
#: Force of the deformation test of a tennis ball, N, and the deformation between two plates, m.
_TENNIS_BALL_TEST = 8.165 * GRAVITY, 6.48e-3
_HEADFORM_SOURCE = "headforms of EU directive 2003/102/EC, phase 1, which ECE R127 continues: "
_HAIL_NOTE = "it crushes under impact, which no law here describes: give a contact law"
_TYRE_NOTE = "the stiffness of the tyres is not in the sources: give a contact law"


def _hammer(name: str, energy: float, mass: float, radius: float) -> NamedImpactor:
    """A hammer of IEC 60068-2-75 of this energy [J]; up to 1 J the tip is polyamide."""
    steel = energy > 1
    speed = sqrt(2 * energy / mass)
    note = "" if steel else _POLYAMIDE_NOTE
    strength = _HAMMER_STRENGTH if steel else None
    return NamedImpactor(name, _HAMMER_SOURCE, mass, speed, radius, steel, strength, note=note)


def _pendulum(number: int, height: float) -> NamedImpactor:
    """The twin-tyre pendulum of EN 12600 for a drop height [m]."""
    return NamedImpactor(
        f"EN 12600 class {number}",
        _PENDULUM_SOURCE,
        50.0,
        sqrt(2 * GRAVITY * height),
        note=_TYRE_NOTE,
    )


_IMPACTOR_LIST = (
    *(_hammer(f"IK0{k}", energy, 0.25, 0.010)
      for k, energy in enumerate((0.14, 0.20, 0.35, 0.50, 0.70, 1.00), start=1)),
    _hammer("IK07", 2.0, 0.5, 0.025),
    _hammer("IK08", 5.0, 1.7, 0.025),
    _hammer("IK09", 10.0, 5.0, 0.050),
    _hammer("IK10", 20.0, 5.0, 0.050),
    _hammer("IK11", 50.0, 10.0, 0.050),
    _pendulum(1, 1.200),
    _pendulum(2, 0.450),
    _pendulum(3, 0.190),
    NamedImpactor(
        "golf ball", "USGA, Rules of Golf 2016, appendix III: at most 45.93 g, at least 42.67 mm",
        0.04593, tip_radius=0.04267 / 2, note="its modulus is not in the source",
    ),
    NamedImpactor(
        "tennis ball", _TENNIS_BALL_SOURCE, 0.0577, tip_radius=0.067 / 2,
        # the ball is pressed between two plates: each contact takes half of the deformation
        stiffness=2 * _TENNIS_BALL_TEST[0] / _TENNIS_BALL_TEST[1], restitution=sqrt(1.41 / 2.54),
        note="its stiffness is that of the static test, its restitution that at 7 m/s",
    ),
    NamedImpactor("steel ball", "steel of 7850 kg/m³, 210 GPa (handbook)", None, steel=True),
    NamedImpactor("ice ball", "ice of 917 kg/m³ (handbook)", None, note=_HAIL_NOTE),
    NamedImpactor(
        "hail 25 mm", "IEC 61215: ice balls of 25 mm and 7.53 g (th4.ilovetranslation.com)",
        7.53e-3, tip_radius=12.5e-3, note=f"its speed is not in the source; {_HAIL_NOTE}",
    ),
    NamedImpactor(
        "hail 45 mm", "EN 12975: 45 mm at 30.7 m/s (energyprofessionalsymposium.com); its mass is"
        " that of ice of 917 kg/m³", ICE_DENSITY * pi / 6 * 0.045**3, 30.7, 22.5e-3,
        note=_HAIL_NOTE,
    ),
    NamedImpactor(
        "child headform", _HEADFORM_SOURCE + "3.5 kg, 35 km/h at 50° to the horizontal (OICA,"
        " headform tests data, GRSP informal group, January 2006)", 3.5, 35 / 3.6,
        note="the stiffness of its skin and its size are not in the source: give a contact law",
    ),
    NamedImpactor(
        "adult headform", _HEADFORM_SOURCE + "4.5 kg (TRL report PPR052)", 4.5,
        note="its speed, size and stiffness are not in the source: give a contact law",
    ),
)  # fmt: skip
#: Name -> the named impactor.
IMPACTORS = {impactor.name: impactor for impactor in _IMPACTOR_LIST}


@checks.within_range
def named_impactor(
    name: str, velocity: float | None = None, *, diameter: float | None = None
) -> RigidMass | Sphere:
    """An impactor by name: a RigidMass, or for the steel ball a Sphere.

    Parameters
    ----------
    name : str
        "IK01" to "IK11" (hammers of IEC 60068-2-75), "EN 12600 class 1" to "3" (twin-tyre
        pendulum), "child headform", "adult headform", "golf ball", "tennis ball", "steel ball",
        "ice ball", "hail 25 mm", "hail 45 mm". `antiosc.IMPACTORS[name]`
        has its numbers, their source, and unknown properties.
    velocity : float, optional
        Velocity [m/s]; default: as in the test, √(2 energy/mass) or √(2 g h). Required for balls.
    diameter : float
        Diameter [m] of the steel ball and the ice ball.

    Raises
    ------
    InputError
        An unknown name; a ball without velocity or diameter.
    """
    impactor = IMPACTORS[checks.choice("name", name, tuple(IMPACTORS))]

    if velocity is None:
        if impactor.speed is None:
            raise InputError(f"a {name} has no velocity of its own: give a velocity in m/s.")
        velocity = impactor.speed

    if impactor.mass is None:
        if diameter is None:
            raise InputError(f"a {name} has no size of its own: give a diameter in m.")
        radius = checks.positive("diameter", diameter, "m") / 2
        if impactor.steel:
            return Sphere(radius, **STEEL_CONSTANTS, rho=STEEL_DENSITY, velocity=velocity)
        return RigidMass(ICE_DENSITY * 4 / 3 * pi * radius**3, velocity, tip_radius=radius)

    if diameter is not None:
        raise InputError(f"diameter is for the steel ball and the ice ball; got it for {name}.")

    constants = STEEL_CONSTANTS if impactor.steel else {}

    return RigidMass(
        impactor.mass,
        velocity,
        tip_radius=impactor.tip_radius,
        yield_strength=impactor.yield_strength,
        **constants,
    )


#: two directions count as parallel if the cosine of their angle is at least this
PARALLEL_COSINE = 0.999
#: largest permitted ratio of a principal moment to the sum of the others; above 1 for rounding
MAX_MOMENT_RATIO = 1.01
#: share of a body's momentum in its elastic modes from which supports hold it
SUPPORTED_MOMENTUM_SHARE = 1e-6


@dataclass(frozen=True, eq=False, repr=False)
class RigidBody(FieldsRepr):
    """A rigid body with several sites that moves in space with small rotations.

    Parameters
    ----------
    mass : float
        Mass [kg].
    inertia : array_like, shape (3,) or (3, 3)
        Principal moments about the axes, or the inertia tensor, about the centre [kg m^2].
    sites : mapping
        Name -> (point, direction): point (3,) [m], and direction (3,) in which the contact pushes
        the body there.
    centre : array_like, shape (3,)
        Centre of mass [m].

    Raises
    ------
    InputError
        A mass that is not > 0; an inertia that is not positive definite or physically impossible.
    """

    mass: float
    inertia: Array
    sites: Mapping[str, tuple[ArrayLike, ArrayLike]]
    centre: Array = (0.0, 0.0, 0.0)  # type: ignore[assignment]

    def __post_init__(self) -> None:
        mass = checks.positive("mass", self.mass, "kg")
        tensor = checks.floats("inertia", self.inertia, None)
        tensor = np.diag(tensor) if tensor.shape == (3,) else tensor
        tensor = checks.floats("inertia", tensor, (3, 3))
        size = np.abs(tensor).max()
        if np.abs(tensor - tensor.T).max() > 1e-9 * size or np.linalg.eigvalsh(tensor).min() <= 0:
            raise InputError(
                "inertia must be symmetric and positive definite [kg m^2]: three moments > 0 or"
                " their tensor."
            )

        moments = np.linalg.eigvalsh(tensor)
        if moments[2] > MAX_MOMENT_RATIO * (moments[0] + moments[1]):
            raise InputError(
                f"inertia has the principal moments {moments[0]:g}, {moments[1]:g},"
                f" {moments[2]:g} kg m^2, which no body has: none exceeds the sum of the others."
            )

        centre = checks.floats("centre", self.centre, (3,))
        sites = {}
        checks.instance("sites", self.sites, Mapping, "a dict {name: (point, direction)}")

        for name, site in self.sites.items():
            checks.name("the name of a site", name)
            if not isinstance(site, tuple | list) or len(site) != 2:
                raise InputError(
                    f"site {name!r} must be (point, direction); got {checks.shown(site)}."
                )
            point = checks.floats(f"point of site {name!r}", site[0], (3,))
            direction = checks.floats(f"direction of site {name!r}", site[1], (3,))
            sites[str(name)] = (
                point,
                unit_vectors(f"direction of site {name!r}", direction[None])[0],
            )

        checks.store(self, mass=mass, inertia=tensor, centre=centre, sites=sites)


@dataclass(eq=False)
class SceneBody:
    """A body in a scene: its free modes and its initial motion."""

    name: str
    body: object  # the user's object
    modes: ModalBody | SiteModes  # the body in its free modes
    start_velocities: Array  # (J,) modal velocities
    initial_displacements: Array | None = None  # (J,) modal displacements; None: none
    gap: float = 0.0  # distance [m] of an `Obstacle` from the structure at the start
    #: site -> half-space compliance [m/N] of its patch, which the modes contain
    local_compliance: Mapping[str, float] = field(default_factory=dict)
    patch_radius: float | None = None  # radius [m] of the patch of its one site, if it has one
    #: direction (3,) in which the contact pushes each site, if known
    push_directions: dict[str, Array] = field(default_factory=dict)
    #: for a body without directions in space: direction (3,) of each site, from its contacts
    site_axes: dict[str, Array] = field(default_factory=dict)
    #: initial states (2, I) of the first-order modes; None: they follow from the initial
    #: displacements and velocities, with relaxed Maxwell branches
    first_order_start: Array | None = None

    def __post_init__(self) -> None:
        if self.modes.axes is not None and not self.push_directions:
            self.push_directions = {
                site: self.modes.axes[columns[0]] for site, columns in self.sites.items()
            }

    @property
    def omega(self) -> Array:
        """Frequencies (J,) of its modes [rad/s]."""
        return self.modes.omega

    @property
    def decay(self) -> Array:
        """Decay constants (J,) [1/s]."""
        if self.modes.decay is None:
            return np.zeros(self.omega.size)
        return self.modes.decay

    @property
    def sites(self) -> dict[str, tuple[int, ...]]:
        """Site name -> numbers of its columns; {"": ()} for an obstacle, which does not move."""
        if isinstance(self.body, Obstacle):
            return {"": ()}
        return self.modes.columns

    @property
    def inertia(self) -> Inertia | None:
        """Inertia of the body and momentum of its modes; None if unknown."""
        return self.modes.inertia

    @property
    def info(self) -> ModelInfo:
        """The record `info` of the user's object; an empty record if it has none."""
        return info_of(self.body)

    @property
    def stretch(self) -> Stretch | None:
        """Second-order forces of the body; None if it is linear."""
        return stretch_of(self.body)

    def site_directions(self, site: str) -> Array | None:
        """Unit vectors (k, 3) in space of the columns of a site; None if they are unknown."""
        if self.modes.axes is not None:
            return self.modes.axes[list(self.sites[site])]
        if site in self.site_axes:
            return self.site_axes[site][None]
        return None

    def rotation(self, q: Array) -> Array:
        """Rotation vectors (n, 3) [rad] of the rigid motion in the modal displacements q (n, J)."""
        if self.inertia is None:
            raise InputError(f"the model of {self.name!r} does not know how it turns.")
        return self.inertia.rotation(np.where(self.omega == 0, q, 0.0))

    @property
    def supported(self) -> bool:
        """Whether no rigid-body mode moves a site; displacements then count from equilibrium."""
        return not bool(np.any(self.modes.B[self.omega == 0] != 0))

    @property
    def grounded(self) -> bool:
        """Whether motion of the ground excites the body: an obstacle, or a supported body."""
        rigid = self.omega == 0
        if isinstance(self.body, Obstacle) or not rigid.any():
            return True

        weights = self.modes.weight if self.inertia is None else self.inertia.momentum[:, :3]
        if weights is None:
            return False

        size = float(np.abs(weights).max(initial=0.0))

        return bool(np.any(np.abs(weights[~rigid]) > SUPPORTED_MOMENTUM_SHARE * size))


def stacked_first_order(bodies: Iterable[SceneBody]) -> StackedModes | None:
    """First-order modes of all bodies, stacked; None if no body has any."""
    parts = [
        (body.omega, body.decay, body.modes.first_order, body.first_order_start) for body in bodies
    ]
    if all(first is None for _, _, first, _ in parts):
        return None
    from antiosc.engine.first_order import StackedModes  # loaded where dampers couple modes

    return StackedModes(parts)


def scene_body(name: str, body: object, motion: Motion | ModalState | float | None) -> SceneBody:
    """The body of a scene with its initial motion; InputError for an impossible motion."""
    if isinstance(body, RigidBody):
        body_in_scene = _scene_body_of_rigid(name, body)
    elif isinstance(body, SiteModes) or (isinstance(body, AntiOscillators) and body.sites):
        modes = body if isinstance(body, SiteModes) else body.site_modes()
        at_rest = np.zeros(modes.omega.size)
        body_in_scene = SceneBody(
            name, body, modes, at_rest, local_compliance=modes.local_compliance
        )
    else:
        body_in_scene = _scene_body_of_modal(name, body)

    if motion is not None:
        if isinstance(body, Obstacle):
            raise InputError(f"body {name!r} is an obstacle, which does not move.")
        if isinstance(motion, ModalState):
            first = body_in_scene.modes.first_order
            own = body_in_scene.omega.size, 0 if first is None else first.omega.size
            given = motion.velocities.size, own[1]
            if motion.first_order is not None:
                given = given[0], motion.first_order.shape[1]
            if given != own:
                raise InputError(
                    f"the ModalState of {name!r} has {given[0]} modes and {given[1]} of first"
                    f" order, the body {own[0]} and {own[1]}."
                )

            body_in_scene.initial_displacements = motion.displacements
            body_in_scene.start_velocities = motion.velocities
            body_in_scene.first_order_start = motion.first_order
        else:
            body_in_scene.start_velocities = _initial_velocities(body_in_scene, motion)

    return body_in_scene


def _scene_body_of_modal(name: str, body: object) -> SceneBody:
    """The `SceneBody` of a body that has a modal form."""
    linear_body = checked_body(f"body {name!r}", body)
    modes = linear_body.modal()
    velocity = linear_body.velocity
    is_impactor = isinstance(body, Impactor)
    if is_impactor and not isinstance(velocity, Motion):
        velocity = -float(velocity) if modes.direction is not None else float(velocity)

    return single_site_body(name, body, linear_body, modes, modes.rigid_motion(velocity))


def single_site_body(
    name: str, body: object, linear_body: Body, modes: ModalBody, start_velocities: Array
) -> SceneBody:
    """The `SceneBody` of a body with one contact point and modal initial velocities (J,)."""
    local = {"": linear_body.local_compliance}
    return SceneBody(
        name,
        body,
        modes,
        start_velocities,
        gap=linear_body.gap,
        local_compliance=local,
        patch_radius=linear_body.patch_radius,
    )


def _scene_body_of_rigid(name: str, body: RigidBody) -> SceneBody:
    """The `SceneBody` of a `RigidBody`."""
    moments, axes = np.linalg.eigh(body.inertia)
    columns: list[Array] = []
    sites: dict[str, tuple[int, ...]] = {}
    directions: dict[str, Array] = {}
    for i, (site, (point, direction)) in enumerate(body.sites.items()):
        arm = np.asarray(point) - body.centre
        rotations = np.cross(axes.T, arm) / np.sqrt(moments)[:, None]  # (3 rotations, 3 directions)
        columns.append(np.concatenate((np.eye(3) / np.sqrt(body.mass), rotations)))
        sites[site] = (3 * i, 3 * i + 1, 3 * i + 2)
        directions[site] = np.asarray(direction)

    matrix = np.zeros((6, 6))
    matrix[:3, :3] = body.mass * np.eye(3)
    matrix[3:, 3:] = body.inertia
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

    return SceneBody(name, body, modes, np.zeros(6), push_directions=directions)


def _initial_velocities(body: SceneBody, motion: Motion | float) -> Array:
    """Modal initial velocities (J,) of a rigid-body motion."""
    if not isinstance(motion, Motion):
        one_coordinate = body.modes.axes is None or body.inertia is None  # the speed along it
        if not one_coordinate or body.modes.B.shape[1] != 1:
            raise InputError(
                f"body {body.name!r} moves in space: give its start as a Motion of velocity"
                f" and spin, not as the number {motion!r}."
            )

    return body.modes.rigid_motion(motion)
