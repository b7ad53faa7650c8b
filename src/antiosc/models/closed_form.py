"""A uniform beam on any end supports, struck at any point: its anti-oscillators and modes, exact to
rounding.

Lengths and deflections are in units of L, forces of EI/L², masses of rhoA L; Ω = ω² rhoA L⁴/EI,
alpha = rhoI/(rhoA L²), η = EI/(kGA L²). The curvature κ = θ' and the shear γ = w' - θ are
polynomials on each of the two segments beside the site (γ = 0 if η = 0),

    θ = θ₀ + ∫κ,   w = w₀ + θ₀ x + ∫∫κ + ∫γ,

so that w and θ are continuous; with orthonormal polynomials for κ and γ/√η the stiffness
∫ κ² + γ²/η is the identity. The lowest modes converge exponentially with the degree.
S. P. Timoshenko, Phil. Mag. 41 (1921) 744.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
import scipy.linalg
from numpy.polynomial import legendre
from scipy.linalg import null_space

from antiosc.base import checks
from antiosc.base._types import Array
from antiosc.base.errors import InputError
from antiosc.models.anti_oscillators import AntiOscillators

__all__ = ["StruckBeam", "UniformBeam", "cantilever", "pinned_free", "pinned_pinned"]

#: End supports: which of the motions w (0) and θ (1) they hold.
ENDS: dict[str, tuple[int, ...]] = {"free": (), "pinned": (0,), "clamped": (0, 1), "guided": (1,)}
#: Polynomials for each half wave on a segment, π/2 at least, and for its ends.
HALF_WAVE_POLYNOMIALS, END_POLYNOMIALS = 1.7, 30
#: Share of a mode at the site (in mass) below which it is rounding.
UNOBSERVABLE_SHARE = 1e-14


@dataclass(frozen=True)
class UniformBeam:
    """A straight beam of constant section that bends in one plane.

    Timoshenko's equations for the deflection w and the rotation θ of the section are

        EI θ'' + kGA (w' - θ) + ω² rhoI θ = 0,    kGA (w'' - θ') + ω² rhoA w = 0,

    and Euler-Bernoulli's beam is their limit kGA = ∞, rhoI = 0, which may be given exactly.

    Attributes
    ----------
    EI, rhoA, length : bending stiffness in N m², mass per length in kg/m, length in m.
    kGA : shear stiffness k'GS in N; ``math.inf`` for a beam that is rigid in shear.
    rhoI : rotary inertia per length in kg m; 0 leaves it out.
    """

    EI: float
    rhoA: float
    length: float
    kGA: float = math.inf
    rhoI: float = 0.0

    def __post_init__(self) -> None:
        for name, unit in (("EI", "N m^2"), ("rhoA", "kg/m"), ("length", "m")):
            checks.store(self, **{name: checks.positive(name, getattr(self, name), unit)})
        if not checks.is_rigid(self.kGA):
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
        """A beam with shear and rotary inertia, kGA = shear_coefficient·area·E/(2 (1 + nu)); SI."""
        slender = cls.euler_bernoulli(E=E, rho=rho, area=area, inertia=inertia, length=length)
        G = E / (2 * (1 + checks.poisson(nu)))
        kGA = checks.positive("shear_coefficient", shear_coefficient) * G * area
        return cls(slender.EI, slender.rhoA, length, kGA, rho * inertia)

    @classmethod
    def euler_bernoulli(
        cls, *, E: float, rho: float, area: float, inertia: float, length: float
    ) -> UniformBeam:
        """A slender beam: rigid in shear, without rotary inertia (SI)."""
        EI = checks.positive("E", E, "Pa") * checks.positive("inertia", inertia, "m^4")
        rhoA = checks.positive("rho", rho, "kg/m^3") * checks.positive("area", area, "m^2")
        return cls(EI, rhoA, length)

    @property
    def alpha(self) -> float:
        """Rotary inertia parameter rhoI/(rhoA L²); the article's (I/S)²/L² is a misprint."""
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
    def omega_unit(self) -> float:
        """√(EI/(rhoA L⁴)) in rad/s, so that ω = omega_unit·√Ω (Ω as in the article)."""
        return math.sqrt(self.EI / (self.rhoA * self.length**4))


@dataclass(frozen=True)
class StruckBeam:
    """A beam, its two end supports and the impact site (deflection w, positive along the impact).

    Attributes
    ----------
    left, right : "free", "pinned" (w = 0), "clamped" (w = θ = 0) or "guided" (θ = 0).
    site : distance of the impact site from the left end in m.
    """

    beam: UniformBeam
    left: str
    right: str
    site: float

    def __post_init__(self) -> None:
        checks.instance("beam", self.beam, UniformBeam, "a UniformBeam")
        for name in ("left", "right"):
            checks.choice(name, getattr(self, name), tuple(ENDS))

        site, length = checks.number("site", self.site, "m"), self.beam.length
        if not 0 <= site <= length:
            raise InputError(f"site must lie on the beam, 0 to {length:g} m; got {site:g} m.")
        if (site == 0 and 0 in ENDS[self.left]) or (site == length and 0 in ENDS[self.right]):
            raise InputError(f"the site at {site:g} m sits on a support and cannot move.")
        checks.store(self, site=site)

    @property
    @checks.within_range
    def static_stiffness(self) -> float:
        """k0 in N/m, Article (20): force per deflection at the site; 0 with a rigid-body mode."""
        return self._in_polynomials(0).k0 * self.beam.EI / self.beam.length**3

    @property
    @checks.within_range
    def static_mass(self) -> float:
        """m_st = M(φ_st, φ_st) in kg, with a rigid-body mode M(φ_CR, φ_CR)."""
        return self._in_polynomials(0).m_st * self.beam.mass

    @checks.within_range
    def anti_oscillators(self, n: int) -> AntiOscillators:
        """The n lowest anti-oscillators with mass, Article (12), (15), (20), (23)."""
        solved, omega, phi, c = self._observable(checks.whole("n", n, most=1000))
        m = c**2 * self.beam.mass
        moved = self.beam.mass * (solved.moved @ np.column_stack((solved.static, c * phi)))
        moved[0] -= moved[1:].sum()

        return AntiOscillators(
            m0=self.static_mass - m.sum(),
            k0=self.static_stiffness,
            m=m,
            omega=omega * self.beam.omega_unit,
            participation=moved,
        )

    def _in_polynomials(self, count: int) -> PolynomialBeam:
        """The beam in polynomials of the degree that its `count` lowest modes need."""
        site = self.site / self.beam.length
        degrees = (
            math.ceil(HALF_WAVE_POLYNOMIALS * count * share) + END_POLYNOMIALS
            for share in (site, 1 - site)
        )
        return PolynomialBeam(self, *degrees)

    def _observable(
        self, n: int, *, held: bool = True
    ) -> tuple[PolynomialBeam, Array, Array, Array]:
        """(beam, √Ω (n,), shapes, b (n,)) of the n lowest modes that move the site by b. With
        `held`: constraint modes, and instead of b their inertial coupling to the static shape."""
        count = n + 2
        while True:
            solved = self._in_polynomials(count)
            omega, phi = solved.lowest(count, held=held)
            share = (solved.mass @ solved.static if held else solved.at_site) @ phi
            least = UNOBSERVABLE_SHARE * (solved.m_st if held else 1.0)
            seen = np.flatnonzero(share**2 > least)[:n]
            if len(seen) == n:
                return solved, omega[seen], phi[:, seen], share[seen]
            count *= 2


class PolynomialBeam:
    """A struck beam of length 1, with polynomial curvature and shear on each side of the site.

    Coefficients: deflection w₀ and rotation θ₀ at 0, then curvature κ and shear γ/√η by segments.

    Attributes
    ----------
    at_site, moved : (size,) deflection of the site and transverse momentum, per unit coefficient.
    rigid, hidden : (size, r) M-orthonormal rigid-body modes, and rigid-body modes with the site at
        rest.
    static : (size,) φ_st, or with rigid-body modes the rigid motion that moves the site by 1.
    k0, m_st : stiffness and mass of `static`.
    deflection : (size,) elastic deflection under a unit force.
    """

    def __init__(self, struck: StruckBeam, *degrees: int) -> None:
        beam, site = struck.beam, struck.site / struck.beam.length
        self._eta = beam.eta
        parts = zip((0.0, site), (site, 1 - site), degrees, strict=True)
        self._segments = [part for part in parts if part[1] > 0]
        self.size = 2 + sum(part[2] + 1 for part in self._segments) * (2 if beam.eta else 1)

        points, weights = [], []
        for start, length, degree in self._segments:
            nodes, rule = legendre.leggauss(degree + 4)
            points.append(start + length * (nodes + 1) / 2)
            weights.append(length * rule / 2)

        x, rule = np.concatenate(points), np.concatenate(weights)
        w, theta = self.motions(x)
        self.mass = (w.T * rule) @ w + beam.alpha * (theta.T * rule) @ theta
        self.moved = rule @ w

        self.at_site = self.motions(np.array([site]))[0][0]
        ends = np.array(self.motions(np.array([0.0, 1.0])))
        rows = [ends[motion, 0] for motion in ENDS[struck.left]]
        rows += [ends[motion, 1] for motion in ENDS[struck.right]]
        self._held = np.array(rows).reshape(-1, self.size)

        free = np.eye(self.size)[:, :2] @ null_space(np.vstack((self._held[:, :2], [0.0, 0.0])))
        self.rigid = free @ np.linalg.inv(np.linalg.cholesky(free.T @ self.mass @ free)).T
        at_site = self.at_site @ self.rigid
        self.hidden = self.rigid @ null_space(at_site[None]) if at_site.size else self.rigid

        N = null_space(self._held) if len(rows) else np.eye(self.size)
        heavy = self.mass @ self.rigid
        load = self.at_site - heavy @ at_site
        pushed = N.T @ heavy
        stiffness = _stiffness(N) + pushed @ pushed.T
        self.deflection = N @ scipy.linalg.solve(stiffness, N.T @ load, assume_a="pos")

        compliance = float(self.at_site @ self.deflection)
        self.k0 = 0.0 if at_site.size else 1 / compliance
        self.static = self.deflection / compliance
        if at_site.size:
            self.static = self.rigid @ at_site / (at_site @ at_site)
        self.m_st = float(self.static @ self.mass @ self.static)

    def motions(self, x: Array) -> tuple[Array, Array]:
        """(w, θ), each (len(x), size), at points x in [0, 1] for unit coefficients."""
        once, twice = [], []
        for start, length, degree in self._segments:
            size = np.sqrt((2 * np.arange(degree + 1) + 1) / length)
            inside = np.clip(2 * (x - start) / length - 1, -1, 1)
            integrals = _integrals(legendre.legvander(inside, degree + 2))
            first = length / 2 * integrals[:, :-1] * size
            second = (length / 2) ** 2 * _integrals(integrals) * size
            beyond = np.maximum(x - start - length, 0.0)[:, None]
            once.append(first)
            twice.append(second + beyond * first)

        one, zero = np.ones((len(x), 1)), np.zeros((len(x), 1))
        w, theta = [one, x[:, None], *twice], [zero, one, *once]
        if self._eta:
            w += [math.sqrt(self._eta) * first for first in once]
            theta += [np.zeros_like(first) for first in once]

        return np.hstack(w), np.hstack(theta)

    def lowest(self, n: int, *, held: bool) -> tuple[Array, Array]:
        """(√Ω > 0 ascending (n,), shapes of unit mass (size, n)); `held`: the site is fixed."""
        rows = np.vstack((self._held, self.at_site)) if held else self._held
        N = null_space(rows) if len(rows) else np.eye(self.size)

        # the rounding of 1/(Ω + s) is small at both ends of the spectrum with s between them
        shift = 3 * (max(n, 1) * math.pi) ** 2 / (1 + self._eta)
        M = N.T @ self.mass @ N
        A = _stiffness(N) + shift * M
        most = len(M) - (self.hidden if held else self.rigid).shape[1]
        theta, phi = scipy.linalg.eigh(M, A, subset_by_index=[most - n, most - 1])
        phi = N @ (phi / np.sqrt(theta))[:, ::-1]
        return np.sqrt(1 / theta - shift)[::-1], phi


def _stiffness(shapes: Array) -> Array:
    """Stiffness φᵀKφ of `shapes` (size, n); K is diagonal, 0 for w₀ and θ₀, else 1."""
    strains = shapes[2:]
    return strains.T @ strains


def _integrals(values: Array) -> Array:
    """Integrals (points, k) from -1 of Legendre polynomials or their integrals (points, k + 1)."""
    differences = values[:, 1:].copy()
    differences[:, 0] += values[:, 0]
    differences[:, 1:] -= values[:, :-2]
    return differences / (2 * np.arange(differences.shape[1]) + 1)


def pinned_free(beam: UniformBeam, site: float | None = None) -> StruckBeam:
    """Pinned at x = 0, free at x = L, struck at `site` (m) or at the tip: Article (24)-(27)."""
    return StruckBeam(beam, "pinned", "free", _site(beam, 1.0, site))


def pinned_pinned(beam: UniformBeam, site: float | None = None) -> StruckBeam:
    """Pinned at both ends, struck at `site` (m); default: mid-span."""
    return StruckBeam(beam, "pinned", "pinned", _site(beam, 0.5, site))


def cantilever(beam: UniformBeam, site: float | None = None) -> StruckBeam:
    """Clamped at x = 0, struck at x = a = `site` (m), default: the tip; 1/k0 = a³/3EI + a/kGA."""
    return StruckBeam(beam, "clamped", "free", _site(beam, 1.0, site))


def _site(beam: UniformBeam, share: float, site: float | None) -> float:
    """`site` [m], or `share` of the length if it is None."""
    length = checks.instance("beam", beam, UniformBeam, "a UniformBeam").length
    return share * length if site is None else site
