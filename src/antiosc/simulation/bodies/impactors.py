"""Impactors: linear bodies with a velocity along the direction of impact."""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import lru_cache
from math import inf, pi, sqrt

import numpy as np

from antiosc.base import checks, plausible
from antiosc.base.brief import Given
from antiosc.base.errors import InputError
from antiosc.contact import Hertz
from antiosc.models.body import Body, LinearBody, checked_body
from antiosc.models.modal import ModalBody
from antiosc.models.motion import Motion


@dataclass(frozen=True)
class RigidMass(Given, Body):
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

    mass: float
    velocity: float = 0.0
    tip_radius: float | None = field(default=None, kw_only=True)
    E: float | None = field(default=None, kw_only=True)
    nu: float | None = field(default=None, kw_only=True)

    def __post_init__(self) -> None:
        checks.store(
            self,
            mass=checks.positive("mass", self.mass, "kg"),
            velocity=checks.number("velocity", self.velocity, "m/s"),
        )
        for name, unit in (("tip_radius", "m"), ("E", "Pa")):
            if getattr(self, name) is not None:
                checks.store(self, **{name: checks.positive(name, getattr(self, name), unit)})
        if self.nu is not None:
            checks.store(self, nu=checks.poisson(self.nu))

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
