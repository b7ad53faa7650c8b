"""The soil under a footing: the elastic half-space under a rigid disk as a truncated cone.

J. Wolf, *Foundation Vibration Analysis Using Simple Physical Models* (1994), table 2-3: a bar whose
area grows with the depth has the disk's static stiffness, and sends its waves away as a dashpot.
"""

from __future__ import annotations

from dataclasses import dataclass
from math import pi, sqrt
from typing import Literal

import numpy as np

from antiosc.base import checks
from antiosc.base.texts import FieldsRepr
from antiosc.engine.damping import DampingMatrix
from antiosc.models.anti_oscillators import AntiOscillators
from antiosc.models.modal import ModalBody

#: Poisson's ratio above which waves take twice the shear-wave speed, and soil moves with the disk.
NEARLY_INCOMPRESSIBLE = 1 / 3
#: Mass of soil that has none, over c^2/k.
LIGHT = 1e-6


@dataclass(frozen=True)
class SoilCone(FieldsRepr):
    """The soil under a footing."""

    #: static stiffness [N/m], that of the disk on the half-space
    stiffness: float
    #: dashpot of the waves that are radiated [N s/m]
    damping: float
    #: mass of the soil that moves with the disk [kg], 0 for nu <= 1/3
    mass: float

    def model(self, mass: float = 0.0) -> AntiOscillators:
        """A rigid footing of this mass [kg] on the soil, as a model that can be struck.

        InputError where neither it nor the soil has a mass.
        """
        total = checks.nonnegative("mass", mass, "kg") + self.mass
        total = checks.positive("the mass of the footing and the soil", total, "kg")
        empty = np.zeros(0)
        damping = DampingMatrix(np.array([[self.damping]]))
        return AntiOscillators(m0=total, k0=self.stiffness, m=empty, omega=empty, damping=damping)

    def modal(self) -> ModalBody:
        """The soil alone, without a footing, as a body of an impact.

        Soil without mass gets the mass `LIGHT` c^2/k, which has an effect above k/(LIGHT c)
        [rad/s].
        """
        smallest_mass = LIGHT * self.damping**2 / self.stiffness
        return self.model(max(0.0, smallest_mass - self.mass)).modal()


def soil_cone(
    radius: float,
    G: float,
    nu: float,
    rho: float,
    motion: Literal["vertical", "horizontal"] = "vertical",
) -> SoilCone:
    """The cone under a rigid disk on an elastic half-space.

    Parameters
    ----------
    radius : float
        Radius of the disk [m]; for another footing that of a disk of the same area.
    G, nu, rho : float
        Shear modulus [Pa], Poisson's ratio in 0 <= nu < 0.5 and density [kg/m^3] of the soil.
    motion : "vertical" or "horizontal"
    """
    radius = checks.positive("radius", radius, "m")
    G = checks.positive("G", G, "Pa")
    rho = checks.positive("rho", rho, "kg/m^3")
    nu = checks.nonnegative("nu", checks.poisson(nu))
    checks.choice("motion", motion, ("vertical", "horizontal"))
    area = pi * radius**2
    shear = sqrt(G / rho)
    if motion == "horizontal":
        height = pi / 8 * (2 - nu) * radius
        speed = shear
        mass = 0.0
    else:
        dense = nu > NEARLY_INCOMPRESSIBLE
        speed = 2 * shear if dense else shear * sqrt(2 * (1 - nu) / (1 - 2 * nu))
        height = pi / 4 * (1 - nu) * (speed / shear) ** 2 * radius
        mass = 2.4 * (nu - NEARLY_INCOMPRESSIBLE) * rho * area * radius if dense else 0.0
    return SoilCone(rho * speed**2 * area / height, rho * speed * area, mass)
