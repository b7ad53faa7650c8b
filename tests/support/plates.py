"""Simply supported plates and laminates in closed form: references of tests.

Kirchhoff's plate struck at (x, y) has the receptance (Lévy's single series, α = mπ/a,
k⁴ = ω²ρh/D)

    H = 2/(aD) Σ_m sin²(αx) (g(α² − k²) − g(α² + k²))/(2k²),
    g(p²) = sinh(py) sinh(p(b − y))/(p sinh(pb)),

whose poles are the observable natural frequencies and whose zeros are the anti-oscillators', one
between two neighbouring poles; m_i = 1/(ω_i⁴ dH/d(ω²)). Mindlin's plate (its edges free of
rotation along themselves) is given by its double series.

S. Timoshenko and S. Woinowsky-Krieger, *Theory of Plates and Shells* (1959), articles 28 and 29;
R. D. Mindlin, J. Appl. Mech. 18 (1951) 31-38.

Laminates with shear deformation have Navier's solution of first-order theory. With α = mπ/a,
β = nπ/b the motions

    u = U cos αx sin βy    v = V sin αx cos βy    w = W sin αx sin βy
    φx = X cos αx sin βy   φy = Y sin αx cos βy

solve a cross-ply's equations on edges that fix the deflection and the displacements along the edge
(SS-1); for antisymmetric angle-plies sine and cosine of u and v change places, on edges that let
these slide along but not across (SS-2). Both give one 5 × 5 eigenproblem.

J. N. Reddy, *Mechanics of Laminated Composite Plates and Shells* (2004), articles 7.3 to 7.4;
C. W. Bert and T. L. C. Chen, Int. J. Solids Struct. 14 (1978) 465-473.
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise
from typing import NamedTuple

import numpy as np
import scipy.linalg
from numpy.typing import ArrayLike

from antiosc.base._types import Array, Index, Numbers
from antiosc.base.errors import AccuracyError
from antiosc.models.anti_oscillators import AntiOscillators

#: Terms of Lévy's series; what follows them is added as an integral.
TERMS = 2000
#: Natural frequencies closer than this (relatively) are one repeated frequency.
SAME_FREQUENCY = 1e-9
#: Share of the largest b² below which a frequency is unobservable at the point.
UNOBSERVABLE_SHARE = 1e-12
#: Mindlin's shear coefficient for the static and dynamic plate alike (Reissner's).
SHEAR = 5 / 6


class Observable(NamedTuple):
    """Natural frequencies that are observable at a point, ascending, and their multiplicities."""

    #: circular frequencies (n,), rad/s
    omega: Array
    #: Σ φ² of the mass-normalised modes of each frequency at the point (n,), 1/kg
    b2: Array
    #: modes that share each frequency and move the point (n,)
    modes: Index
    #: unobservable frequencies below the last one
    unobservable: int


@dataclass(frozen=True)
class SupportedPlate:
    """A rectangular plate 0 ≤ x ≤ a, 0 ≤ y ≤ b on simple supports.

    Parameters
    ----------
    E, nu, rho : float
        Young's modulus (Pa), Poisson's ratio, density (kg/m³).
    thickness, a, b : float
        Thickness and sides, m.
    """

    E: float
    nu: float
    rho: float
    thickness: float
    a: float
    b: float

    @property
    def D(self) -> float:
        """Bending stiffness, N m."""
        return self.E * self.thickness**3 / (12 * (1 - self.nu**2))

    @property
    def surface_density(self) -> float:
        """Mass per area, kg/m²."""
        return self.rho * self.thickness

    def wave_number_squared(self, m: ArrayLike, n: ArrayLike) -> Array | np.float64:
        """π²(m²/a² + n²/b²), 1/m²."""
        return np.pi**2 * (np.square(m) / self.a**2 + np.square(n) / self.b**2)

    def kirchhoff(self, m: ArrayLike, n: ArrayLike) -> Array | np.float64:
        """Natural circular frequency of the thin plate with m × n half waves, rad/s."""
        return self.wave_number_squared(m, n) * np.sqrt(self.D / self.surface_density)

    def mindlin(self, m: ArrayLike, n: ArrayLike) -> Array | np.float64:
        """As `kirchhoff`, with shear deformation and rotary inertia (lowest, flexural branch)."""
        q = self.wave_number_squared(m, n)
        G = self.E / (2 * (1 + self.nu))
        shear = SHEAR * G * self.thickness
        inertia = self.rho * self.thickness**3 / 12
        half = (self.surface_density * (self.D * q + shear) + shear * q * inertia) / 2
        product = self.surface_density * inertia
        constant = shear * q * self.D * q
        return np.sqrt(constant / (half + np.sqrt(half**2 - product * constant)))

    def mindlin_compliance(self, x: float, y: float, radius: float, terms: int = 1000) -> float:
        """Static compliance of a patch with Hertz's pressure, m/N; the plate with shear.

        The transform of √(1 − r²/r0²), of unit integral, is 3 (sin q − q cos q)/q³ with q = |k| r0.
        `terms` per direction must resolve the patch: terms ≫ a/radius.
        """
        m = np.arange(1, terms + 1)
        k2 = self.wave_number_squared(m[:, None], m)
        q = np.sqrt(k2) * radius
        pressure = 3 * (np.sin(q) - q * np.cos(q)) / q**3
        shape = np.outer(np.sin(m * np.pi * x / self.a), np.sin(m * np.pi * y / self.b))
        G = self.E / (2 * (1 + self.nu))
        flexibility = 1 / (self.D * k2**2) + 1 / (SHEAR * G * self.thickness * k2)
        return float(4 / (self.a * self.b) * np.sum((shape * pressure) ** 2 * flexibility))

    def observable(self, x: float, y: float, n: int) -> Observable:
        """The `n` lowest natural frequencies of the thin plate that are observable at (x, y)."""
        count = 4 * int(np.sqrt(n)) + 8
        while True:
            m = np.arange(1, count + 1)
            # complete below the frequency of the first mode left out
            limit = min(self.kirchhoff(count + 1, 1), self.kirchhoff(1, count + 1))
            omega = self.kirchhoff(m[:, None], m).ravel()
            sines = np.outer(np.sin(m * np.pi * x / self.a), np.sin(m * np.pi * y / self.b))
            b2 = (4 / (self.surface_density * self.a * self.b) * sines**2).ravel()
            below_limit = omega < limit
            order = np.argsort(omega[below_limit], kind="stable")
            omega = omega[below_limit][order]
            b2 = b2[below_limit][order]
            start = np.flatnonzero(np.diff(omega, prepend=-np.inf) > SAME_FREQUENCY * omega)
            sums = np.add.reduceat(b2, start)
            is_observable = b2 > UNOBSERVABLE_SHARE * b2.max()
            modes = np.add.reduceat(is_observable.astype(np.intp), start)
            observable = np.flatnonzero(modes > 0)
            if len(observable) >= n:
                observable = observable[:n]
                return Observable(
                    omega[start][observable],
                    sums[observable],
                    modes[observable],
                    int(observable[-1] + 1 - n),
                )
            count *= 2

    def receptance(self, x: float, y: float, omega2: complex) -> complex:
        """H = displacement/force of the thin plate at (x, y), m/N, at ω² = `omega2` ≠ 0."""
        alpha = np.arange(1, TERMS + 1) * np.pi / self.a
        k2 = np.sqrt(omega2 * self.surface_density / self.D + 0j)
        terms = (self._levy_term(alpha**2 - k2, y) - self._levy_term(alpha**2 + k2, y)) / (2 * k2)
        total = np.sum(np.sin(alpha * x) ** 2 * terms)
        return 2 / (self.a * self.D) * (total + self._series_tail())

    def compliance(self, x: float, y: float) -> float:
        """Static compliance of the thin plate at (x, y), m/N."""
        alpha = np.arange(1, TERMS + 1) * np.pi / self.a
        step = 1e-20 * alpha**2  # a complex step: the derivative to rounding
        terms = -self._levy_term(alpha**2 + 1j * step, y).imag / step
        total = np.sum(np.sin(alpha * x) ** 2 * terms)
        return float(2 / (self.a * self.D) * (total + self._series_tail()))

    def anti_oscillators(self, x: float, y: float, n: int) -> AntiOscillators:
        """The `n` lowest anti-oscillators of the thin plate at (x, y)."""
        C = self.compliance(x, y)
        poles = self.observable(x, y, n + 1).omega ** 2
        zeros = np.array([self._zero(x, y, low, high) for low, high in pairwise(poles)])
        # the slopes' double series converges fast, but must reach far beyond the last zero
        m = np.arange(1, 400 + 8 * int(np.sqrt(n)))
        sines = np.outer(np.sin(m * np.pi * x / self.a), np.sin(m * np.pi * y / self.b))
        b2 = 4 / (self.surface_density * self.a * self.b) * sines**2
        omega2 = self.kirchhoff(m[:, None], m) ** 2
        m_st = float(np.sum(b2 / omega2**2)) / C**2
        masses = np.array([1 / (z**2 * np.sum(b2 / (omega2 - z) ** 2)) for z in zeros])
        return AntiOscillators(
            m0=m_st - float(masses.sum()), k0=1 / C, m=masses, omega=np.sqrt(zeros)
        )

    def _zero(self, x: float, y: float, low: float, high: float) -> float:
        from scipy.optimize import brentq  # loaded where it is used: it takes long

        def value(omega2: float) -> float:
            return float(self.receptance(x, y, omega2).real)

        low = low * (1 + 1e-10)
        high = high * (1 - 1e-10)
        if not value(low) < 0 < value(high):
            raise AccuracyError(
                f"no zero of the receptance between {np.sqrt(low):g} and {np.sqrt(high):g} rad/s: "
                "the point lies almost on a nodal line; move it by a little."
            )
        return float(brentq(value, low, high, xtol=1e-13 * high, rtol=1e-13))

    def _levy_term(self, p2: Numbers, y: float) -> Numbers:
        """g(p²), without overflow, for complex p² too."""
        p = np.sqrt(p2 + 0j)
        p = np.where(np.abs(p) * self.b < 1e-6, 1e-6 / self.b, p)  # g is even and smooth there
        rise = np.expm1(-2 * p * y) * np.expm1(-2 * p * (self.b - y))
        return np.asarray(rise / (2 * p * -np.expm1(-2 * p * self.b)))

    def _series_tail(self) -> float:
        """Σ sin²(αx)/(4α³) beyond TERMS, with sin² at its mean."""
        return float((self.a / np.pi) ** 3 / 8 / (2 * (TERMS + 0.5) ** 2))


@dataclass(frozen=True, eq=False)
class SupportedLaminate:
    """A rectangular laminate 0 ≤ x ≤ a, 0 ≤ y ≤ b on simple supports.

    Parameters
    ----------
    A, B, D : array_like (3, 3)
        In-plane (N/m), coupling (N) and bending stiffness (N m) of (ε1, ε2, γ12), (κ1, κ2, 2κ12).
    S : array_like (2, 2)
        Transverse shear stiffness of (γ13, γ23), N/m, correction included.
    inertia : array_like (3,)
        ∫ ρ (1, z, z²) dz: kg/m², kg/m, kg.
    a, b : float
        Sides, m.
    """

    A: ArrayLike
    B: ArrayLike
    D: ArrayLike
    S: ArrayLike
    inertia: ArrayLike
    a: float
    b: float

    def frequencies(self, m: int, n: int) -> Array:
        """The five natural circular frequencies with m × n half waves, ascending, rad/s."""
        alpha = m * np.pi / self.a
        beta = n * np.pi / self.b
        # amplitudes of (ε1, ε2, γ12) of (U, V), and of (γ13, γ23) of (W, X, Y)
        E = np.array([[-alpha, 0], [0, -beta], [beta, alpha]])
        shear = np.array([[alpha, 1, 0], [beta, 0, 1]])
        A, B, D, S = (np.asarray(value) for value in (self.A, self.B, self.D, self.S))
        K = np.zeros((5, 5))
        K[:2, :2] = E.T @ A @ E
        K[:2, 3:] = E.T @ B @ E
        K[3:, :2] = K[:2, 3:].T
        K[3:, 3:] = E.T @ D @ E
        K[2:, 2:] += shear.T @ S @ shear
        I0, I1, I2 = np.asarray(self.inertia)
        M = np.diag([I0, I0, I0, I2, I2])
        M[[0, 1, 3, 4], [3, 4, 0, 1]] = I1
        high = np.sqrt(np.abs(scipy.linalg.eigh(K, M, eigvals_only=True)))
        # rounding of a thin plate's thickness-shear modes would drown its bending
        inverse = scipy.linalg.eigh(M, K, eigvals_only=True)[::-1]
        low = 1 / np.sqrt(np.maximum(inverse, 1e-30 * inverse[0]))
        return np.where(high < np.sqrt(low[0] * high[-1]), low, high)
