"""The uniform straight beam of the closed forms: five numbers, Timoshenko's or Euler's theory."""

from __future__ import annotations

import math
from dataclasses import dataclass

from antiosc.base import checks


@dataclass(frozen=True)
class UniformBeam:
    r"""A straight beam of constant section that bends in one plane.

    Timoshenko's equations for the deflection w and the rotation θ of the section are

        EI θ'' + kGA (w' - θ) + ω² rhoI θ = 0,    kGA (w'' - θ') + ω² rhoA w = 0,

    and Euler-Bernoulli's beam is their limit kGA → ∞, rhoI → 0, which this class allows exactly.

    Attributes
    ----------
    EI : bending stiffness in N m².
    rhoA : mass per length in kg/m.
    length : in m.
    kGA : shear stiffness k'GS in N; ``math.inf`` for a beam that is rigid in shear.
    rhoI : rotary inertia per length in kg m; 0 leaves it out.

    Notes
    -----
    The article writes its characteristic equation (before (24)) with η = EI/(k'GS L²) and
    alpha = (I/S)²/L². That alpha is misprinted. Dimensions: (I/S)²/L² is in m², and alpha must be
    a pure number. Limit: for short waves, or a thick beam, that equation gives Ω = i²π²/η, which
    is the shear wave, c² = k'G/rho, and Ω = i²π²/alpha, which is the longitudinal wave of the
    rotating sections, c² = E/rho, only if

        alpha = I/(S L²) = rhoI/(rhoA L²),

    the squared ratio of the radius of gyration √(I/S) to the length. The cut-off Ω = 1/(η alpha)
    is then ω² = k'GS/(rho I), which does not depend on L, as it must not.

    References
    ----------
    S. P. Timoshenko, Phil. Mag. 41 (1921) 744; S. M. Han, H. Benaroya, T. Wei, J. Sound Vib. 225
    (1999) 935 (four theories, their frequency equations and limits).
    """

    EI: float
    rhoA: float
    length: float
    kGA: float = math.inf
    rhoI: float = 0.0

    def __post_init__(self) -> None:
        for name, unit in (("EI", "N m^2"), ("rhoA", "kg/m"), ("length", "m")):
            checks.store(self, **{name: checks.positive(name, getattr(self, name), unit)})
        if not checks.rigid(self.kGA):
            checks.store(self, kGA=checks.positive("kGA", self.kGA, "N"))
        checks.store(self, rhoI=checks.nonnegative("rhoI", self.rhoI, "kg m"))

    @classmethod
    def timoshenko(
        cls,
        *,
        E: float,
        nu: float,
        rho: float,
        area: float,
        inertia: float,
        length: float,
        shear_coefficient: float = 5 / 6,
    ) -> UniformBeam:
        """With shear and rotary inertia; G = E/2(1 + nu), kGA = shear_coefficient·G·area (SI)."""
        E, rho = checks.positive("E", E, "Pa"), checks.positive("rho", rho, "kg/m^3")
        area = checks.positive("area", area, "m^2")
        inertia = checks.positive("inertia", inertia, "m^4")
        G = E / (2 * (1 + checks.poisson(nu)))
        k = checks.positive("shear_coefficient", shear_coefficient)
        return cls(E * inertia, rho * area, length, k * G * area, rho * inertia)

    @classmethod
    def euler_bernoulli(
        cls, *, E: float, rho: float, area: float, inertia: float, length: float
    ) -> UniformBeam:
        """The slender limit: rigid in shear, no rotary inertia (SI)."""
        E, rho = checks.positive("E", E, "Pa"), checks.positive("rho", rho, "kg/m^3")
        area = checks.positive("area", area, "m^2")
        return cls(E * checks.positive("inertia", inertia, "m^4"), rho * area, length)

    @property
    def alpha(self) -> float:
        """Rotary inertia parameter rhoI/(rhoA L²)."""
        return self.rhoI / (self.rhoA * self.length**2)

    @property
    def eta(self) -> float:
        """Shear parameter EI/(kGA L²)."""
        return self.EI / (self.kGA * self.length**2)

    @property
    def mass(self) -> float:
        """Total mass in kg."""
        return self.rhoA * self.length

    @property
    def cutoff(self) -> float:
        """√(kGA/rhoI) in rad/s: above it waves of the second spectrum travel; inf without shear."""
        return math.sqrt(self.kGA / self.rhoI) if self.rhoI > 0 else math.inf

    @property
    def omega_unit(self) -> float:
        """√(EI/(rhoA L⁴)) in rad/s, so that ω = omega_unit·√Ω (Ω as in the article)."""
        return math.sqrt(self.EI / (self.rhoA * self.length**4))
