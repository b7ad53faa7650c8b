"""Impactors: linear bodies with a velocity, and those of standards and sports by name.

Each named one has the source of its numbers. What no source confirms is left out: a tip without a
modulus has no Hertz law of its own.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import lru_cache
from math import inf, pi, sqrt

import numpy as np

from antiosc.base import checks, plausible
from antiosc.base.checks import Checked, checked_by
from antiosc.base.errors import InputError
from antiosc.base.texts import Given
from antiosc.contact import Gonthier, Hertz
from antiosc.models.body import Body, LinearBody, checked_body
from antiosc.models.modal import ModalBody
from antiosc.models.motion import Motion


@dataclass(frozen=True)
class RigidMass(Checked, Body):
    """A rigid mass that moves along the direction of impact.

    Parameters
    ----------
    mass : float
        [kg].
    velocity : float
        [m/s], > 0 toward the structure.
    tip_radius, E, nu : float, optional
        Radius [m] of its spherical tip, Young's modulus [Pa] and Poisson's ratio of the tip;
        `hertz` needs all three.
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

    def hertz(
        self, E: float, nu: float, radii: float | tuple[float, float] = inf, angle: float = 0.0
    ) -> Hertz:
        """Hertz's law of its tip against a surface of modulus E [Pa], ratio nu and these radii.

        InputError for a mass without tip_radius, E and nu.
        """
        if self.tip_radius is None or self.E is None or self.nu is None:
            raise InputError(
                "Hertz's law of a rigid mass needs its tip: RigidMass(mass, tip_radius=…, E=…, "
                "nu=…); or give the law itself."
            )
        return Hertz.from_radii(self.tip_radius, self.E, self.nu, radii, E, nu, angle)

    def modal(self) -> ModalBody:
        return _rigid(self.mass)


@dataclass(frozen=True, init=False)
class Sphere(Given, Body):
    """A solid elastic sphere without vibrations.

    Parameters
    ----------
    radius : float
        [m].
    E, nu, rho : float
        Young's modulus [Pa], Poisson's ratio, density [kg/m^3].
    velocity : float
        [m/s], > 0 toward the structure.
    mass : float
        [kg], in place of rho.
    """

    radius: float
    E: float
    nu: float
    rho: float
    velocity: float

    def __init__(
        self,
        radius: float,
        E: float,
        nu: float,
        rho: float | None = None,
        velocity: float = 0.0,
        *,
        mass: float | None = None,
    ) -> None:
        if (rho is None) == (mass is None):
            raise InputError("a Sphere needs rho or mass, one of them.")
        radius = checks.positive("radius", radius, "m")
        if mass is not None:
            rho = checks.positive("mass", mass, "kg") / (4 / 3 * pi * radius**3)
        checks.store(
            self,
            radius=radius,
            E=checks.positive("E", E, "Pa"),
            nu=checks.poisson(nu),
            rho=checks.positive("rho", rho, "kg/m^3"),
            velocity=checks.number("velocity", velocity, "m/s"),
        )
        if mass is None:  # with a mass the radius may be that of a tip, and rho is no density
            plausible.tell([plausible.of_sphere(self.radius, self.rho)])

    @property
    def mass(self) -> float:
        """Mass [kg]."""
        return self.rho * 4 / 3 * pi * self.radius**3

    def hertz(
        self, E: float, nu: float, radii: float | tuple[float, float] = inf, angle: float = 0.0
    ) -> Hertz:
        """Hertz's law against a surface of modulus E [Pa], Poisson's ratio nu and these radii."""
        return Hertz.from_radii(self.radius, self.E, self.nu, radii, E, nu, angle)

    def modal(self) -> ModalBody:
        return _rigid(self.mass)


@dataclass(frozen=True)
class Obstacle(Given, Body):
    """A fixed rigid obstacle, `gap` [m] away from the structure; the structure moves."""

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

    def modal(self) -> ModalBody:
        return _fixed()


@dataclass(frozen=True)
class Impactor(Given, Body):
    """Any linear body as impactor, such as a second `AntiOscillators` (Article Fig. 1).

    Its contact point is the site of its model; the contact force acts in the direction of that
    site. `velocity` is a number [m/s], > 0 toward the structure, or a `Motion` in the axes of its
    own mesh, as `initial_velocity` of `simulate`. It must be 0 for a supported body.
    """

    body: LinearBody
    velocity: float | Motion = 0.0

    def __post_init__(self) -> None:
        velocity, own = self.velocity, checked_body("body", self.body)
        if not isinstance(velocity, Motion):
            velocity = checks.number("velocity", velocity, "m/s")
        checks.store(self, velocity=velocity, local_compliance=own.local_compliance)

    @property
    def patch_radius(self) -> float | None:
        """Radius [m] of the patch of the body's site; None: a point."""
        return checked_body("body", self.body).patch_radius

    def modal(self) -> ModalBody:
        return self.body.modal()


@lru_cache(maxsize=1)
def _fixed() -> ModalBody:
    return ModalBody(np.zeros(0), np.zeros(0), weight=np.zeros(0))


@lru_cache(maxsize=256)
def _rigid(mass: float) -> ModalBody:
    root = sqrt(mass)
    return ModalBody(
        np.zeros(1), np.array([1 / root]), weight=np.array([root]), shape=np.array([[1 / root]])
    )


#: Steel (handbook values), Pa and kg/m³.
STEEL = {"E": 210e9, "nu": 0.3}
STEEL_DENSITY = 7850.0
#: Ice at 0 °C, kg/m³ (handbook value).
ICE_DENSITY = 917.0
#: m/s²
GRAVITY = 9.80665


@dataclass(frozen=True)
class NamedImpactor(Given):
    """What is known of an impactor.

    Attributes
    ----------
    name : how `named_impactor` knows it.
    source : where the numbers are from.
    mass : kg; None: it follows from the diameter.
    speed : m/s, of the test that the standard prescribes; None: none is prescribed.
    tip_radius : m, or None.
    steel : whether its surface is steel.
    stiffness : N/m, of its contact with a plane, for a law F = k δ; None: not in the source.
    restitution : coefficient of restitution on a rigid surface; None: not in the source.
    note : what is not known, or left to the user.
    """

    name: str
    source: str
    mass: float | None
    speed: float | None = None
    tip_radius: float | None = None
    steel: bool = False
    stiffness: float | None = None
    restitution: float | None = None
    note: str = ""

    def law(self) -> Gonthier:
        """The law of its stiffness and restitution; InputError where the source has none."""
        if self.stiffness is None or self.restitution is None:
            raise InputError(
                f"the source on the {self.name} has no stiffness and no restitution: give a "
                "contact law."
            )
        return Gonthier(self.stiffness, self.restitution, exponent=1.0)


_HAMMERS = "IEC 60068-2-75, table 1 (striking elements), as interelectronix.com reprints it"
_POLYAMIDE = "tip of polyamide (Rockwell HRR 85 to 100): its modulus is not in the source"
_PANES = "EN 12600: two tyres, 50 kg (spevetro.it, fti-europe.com), drop heights (userdeck.net)"
_BALLS = (
    "ITF Rules of Tennis, appendix I, ball type 2 (as tenniscircle.us reprints it): 56.0 to "
    "59.4 g, 6.54 to 6.86 cm, forward deformation 0.56 to 0.74 cm at 8.165 kg, rebound of 135 to "
    "147 cm from 254 cm; here the middles"
)
#: Force of the deformation test of a tennis ball, N, and the deformation between two plates, m.
_TESTED = 8.165 * GRAVITY, 6.48e-3
_HEADFORMS = "headforms of EU directive 2003/102/EC, phase 1, which ECE R127 continues: "
_HAIL = "it crushes under impact, which no law here describes: give a contact law"
_TYRES = "the stiffness of the tyres is not in the sources: give a contact law"


def _hammer(name: str, energy: float, mass: float, radius: float) -> NamedImpactor:
    """A hammer of IEC 60068-2-75 with its energy [J]; up to 1 J its tip is polyamide."""
    steel = energy > 1
    speed = sqrt(2 * energy / mass)
    note = "" if steel else _POLYAMIDE
    return NamedImpactor(name, _HAMMERS, mass, speed, radius, steel, note=note)


def _pendulum(number: int, height: float) -> NamedImpactor:
    """The twin-tyre pendulum of EN 12600 from its drop height [m]."""
    return NamedImpactor(
        f"EN 12600 class {number}", _PANES, 50.0, sqrt(2 * GRAVITY * height), note=_TYRES
    )


_ALL = (
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
        "tennis ball", _BALLS, 0.0577, tip_radius=0.067 / 2,
        # the ball is pressed between two plates: each contact takes half of the deformation
        stiffness=2 * _TESTED[0] / _TESTED[1], restitution=sqrt(1.41 / 2.54),
        note="its stiffness is that of the static test, its restitution that at 7 m/s",
    ),
    NamedImpactor("steel ball", "steel of 7850 kg/m³, 210 GPa (handbook)", None, steel=True),
    NamedImpactor("ice ball", "ice of 917 kg/m³ (handbook)", None, note=_HAIL),
    NamedImpactor(
        "hail 25 mm", "IEC 61215: ice balls of 25 mm and 7.53 g (th4.ilovetranslation.com)",
        7.53e-3, tip_radius=12.5e-3, note=f"its speed is not in the source; {_HAIL}",
    ),
    NamedImpactor(
        "hail 45 mm", "EN 12975: 45 mm at 30.7 m/s (energyprofessionalsymposium.com); its mass is"
        " that of ice of 917 kg/m³", ICE_DENSITY * pi / 6 * 0.045**3, 30.7, 22.5e-3, note=_HAIL,
    ),
    NamedImpactor(
        "child headform", _HEADFORMS + "3.5 kg, 35 km/h at 50° to the horizontal (OICA, headform"
        " tests data, GRSP informal group, January 2006)", 3.5, 35 / 3.6,
        note="the stiffness of its skin and its size are not in the source: give a contact law",
    ),
    NamedImpactor(
        "adult headform", _HEADFORMS + "4.5 kg (TRL report PPR052)", 4.5,
        note="its speed, size and stiffness are not in the source: give a contact law",
    ),
)  # fmt: skip
#: Name -> what is known of the impactor.
IMPACTORS = {one.name: one for one in _ALL}


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
        has its numbers, their source, and what is not known.
    velocity : float, optional
        [m/s]; default: that of the test, √(2 energy/mass) or √(2 g h). Balls need it.
    diameter : float
        [m], of the steel ball and the ice ball.

    Raises
    ------
    InputError
        An unknown name; a ball without velocity or diameter.
    """
    known = IMPACTORS[checks.choice("name", name, tuple(IMPACTORS))]
    if velocity is None:
        if known.speed is None:
            raise InputError(f"a {name} has no velocity of its own: give velocity=… in m/s.")
        velocity = known.speed
    if known.mass is None:
        if diameter is None:
            raise InputError(f"a {name} has no size of its own: give diameter=… in m.")
        radius = checks.positive("diameter", diameter, "m") / 2
        if known.steel:
            return Sphere(radius, **STEEL, rho=STEEL_DENSITY, velocity=velocity)
        return RigidMass(ICE_DENSITY * 4 / 3 * pi * radius**3, velocity, tip_radius=radius)
    if diameter is not None:
        raise InputError(f"diameter is for the steel ball and the ice ball; got it for {name}.")
    constants = STEEL if known.steel else {}
    return RigidMass(known.mass, velocity, tip_radius=known.tip_radius, **constants)
