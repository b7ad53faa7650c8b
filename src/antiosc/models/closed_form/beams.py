"""A uniform beam on any end supports, struck at any point: its exact anti-oscillators and modes.

Lengths are in L, deflections in L, forces in EI/L², moments in EI/L, and Ω = ω² rhoA L⁴/EI. With
alpha = rhoI/(rhoA L²), η = EI/(kGA L²) and Q, M the shear force and the moment,

    w' = θ + η Q,   θ' = M,   Q' = -Ω w,   M' = -Q - alpha Ω θ.

w ~ exp(λx) needs μ = λ² with μ² + Ω (alpha + η) μ + Ω (Ω alpha η - 1) = 0. Its two roots have
opposite signs below the cut-off Ω = 1/(alpha η) (a wave and an edge effect) and are both negative
above (two waves: the first and the second spectrum). The two segments beside the site are solved
exactly at a given Ω; all formulae stay finite through μ = 0 and do not overflow.

Eigenvalues with the site free and with the site constrained are counted by Wittrick and Williams's
rule, so that none is missed, and bracketed by bisection. The observable ones are the zeros and the
poles of the driving-point dynamic stiffness Z; one Newton step brings them to rounding:

    H = 1/Z,   dH/d(ω²) = ∫ rhoA w² + rhoI θ² dx   (response to a unit force),
    m_i = 1/(ω_i⁴ dH/d(ω²))   at an antiresonance ω_i,
    b_j² = -1/(dZ/d(ω²))      at a natural frequency ω_j.

S. P. Timoshenko, Phil. Mag. 41 (1921) 744; W. P. Howson, F. W. Williams, J. Sound Vib. 26 (1973)
503; W. H. Wittrick, F. W. Williams, Q. J. Mech. Appl. Math. 24 (1971) 263.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.linalg import null_space

from antiosc.base import checks
from antiosc.base._types import Array
from antiosc.base.errors import AccuracyError, InputError
from antiosc.models.anti_oscillators import AntiOscillators
from antiosc.models.body import ModalModel
from antiosc.models.modal import ModalBody
from antiosc.models.motion import Inertia

#: End supports: which of the state (w, θ, Q, M) they hold at zero.
ENDS = {"free": (2, 3), "pinned": (0, 3), "clamped": (0, 1), "guided": (1, 2)}
#: A pole and a zero of Z closer than this (relative, in ω) belong to an unobservable mode.
SAME_ROOT = 1e-9
#: Direction of the impact in the axes of `inertia`, the beam on x.
ACROSS = np.array([0.0, 1.0, 0.0])
#: Most frequencies that are sought at once.
MOST_FREQUENCIES = 10_000


@dataclass(frozen=True)
class UniformBeam:
    """A straight beam of constant section that bends in one plane.

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
        """With shear and rotary inertia; G = E/2(1 + nu), kGA = shear_coefficient·G·area (SI)."""
        slender = cls.euler_bernoulli(E=E, rho=rho, area=area, inertia=inertia, length=length)
        G = E / (2 * (1 + checks.poisson(nu)))
        k = checks.positive("shear_coefficient", shear_coefficient)
        return cls(slender.EI, slender.rhoA, length, k * G * area, rho * inertia)

    @classmethod
    def euler_bernoulli(
        cls, *, E: float, rho: float, area: float, inertia: float, length: float
    ) -> UniformBeam:
        """The slender limit: rigid in shear, no rotary inertia (SI)."""
        E = checks.positive("E", E, "Pa")
        rho = checks.positive("rho", rho, "kg/m^3")
        area = checks.positive("area", area, "m^2")
        return cls(E * checks.positive("inertia", inertia, "m^4"), rho * area, length)

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


# --- One segment ----------------------------------------------------------------------------------


def wave_roots(
    Omega: Array | float, alpha: float, eta: float
) -> tuple[tuple[Array, Array], tuple[Array, Array]]:
    """Roots ((μ₁, β₁), (μ₂, β₂)) at Ω, where β = μ + Ωη couples the rotation: θ' = β w."""
    Omega = np.asarray(Omega, dtype=float)
    root = np.sqrt((Omega * (alpha - eta)) ** 2 + 4 * Omega)
    mu1 = -(Omega * (alpha + eta) + root) / 2
    mu2 = -Omega * (1 - Omega * alpha * eta) / mu1

    # β₁β₂ = -Ω: take from the formula the one that does not cancel
    if eta >= alpha:
        beta2 = (Omega * (eta - alpha) + root) / 2
        return (mu1, -Omega / beta2), (mu2, beta2)
    beta1 = (Omega * (eta - alpha) - root) / 2
    return (mu1, beta1), (mu2, -Omega / beta1)


def even_odd(mu: Array, x: Array | float, half: float) -> tuple[Array, Array]:
    """cosh(λx) and sinh(λx)/λ with λ² = μ, both divided by cosh(λ·half) where μ > 0."""
    mu, x = np.broadcast_arrays(np.asarray(mu, dtype=float), np.asarray(x, dtype=float))
    lam = np.sqrt(np.abs(mu))
    wave = mu <= 0
    cos = np.cos(lam * x)
    sin = x * np.sinc(lam * x / np.pi)

    a = np.where(wave, 1.0, lam)
    size = np.abs(x)
    decay = np.exp(-a * np.maximum(half - size, 0)) / (1 + np.exp(-2 * a * half))
    cosh = decay * (1 + np.exp(-2 * a * size))
    sinh = -decay * np.sign(x) * np.expm1(-2 * a * size) / a
    return np.where(wave, cos, cosh), np.where(wave, sin, sinh)


def _states(Omega: float, alpha: float, eta: float, length: float, x: Array) -> Array:
    """States (w, θ, Q, M) of four independent solutions at x of [0, length]: (4, len(x), 4)."""
    if Omega == 0:
        o, i = np.zeros_like(x), np.ones_like(x)
        w = (i, x, x**2 / 2, eta * x - x**3 / 6)
        theta = (o, i, x, -(x**2) / 2)
        rows = (w, theta, (o, o, o, i), (o, o, i, -x))
        return np.array([np.stack(row, axis=-1) for row in rows])

    columns = []
    for mu, beta in wave_roots(Omega, alpha, eta):
        C, S = even_odd(mu, x - length / 2, length / 2)
        size = 1 / np.sqrt(1 + np.abs(mu))
        columns.append((C, beta * S, -Omega * S, beta * C))
        columns.append(tuple(size * f for f in (mu * S, beta * C, -Omega * C, beta * mu * S)))
    return np.moveaxis(np.array(columns), 0, -1)


def _half_stiffness(Omega: Array, alpha: float, eta: float, length: float) -> tuple[Array, Array]:
    """(Q, M) from (w, θ) at the right end, for motions even and odd about the middle: (2, 2, n)."""
    (mu1, beta1), (mu2, beta2) = wave_roots(Omega, alpha, eta)
    C1, S1 = even_odd(mu1, length / 2, length / 2)
    C2, S2 = even_odd(mu2, length / 2, length / 2)

    def symmetric(w: Array, cross: Array, theta: Array, determinant: Array) -> Array:
        # a bisection can land on an eigenvalue of the clamped segment: step off it
        determinant = np.where(determinant == 0, 1e-30, determinant)
        return np.array([[w, cross], [cross, theta]]) / determinant

    even = symmetric(
        Omega * S1 * S2 * (beta1 - beta2),
        Omega * (S1 * C2 - S2 * C1),
        C1 * C2 * (beta2 - beta1),
        beta2 * C1 * S2 - beta1 * S1 * C2,
    )
    odd = symmetric(
        Omega * C1 * C2 * (beta1 - beta2),
        Omega * (C1 * S2 * mu2 - C2 * S1 * mu1),
        mu1 * mu2 * S1 * S2 * (beta2 - beta1),
        mu1 * beta2 * S1 * C2 - mu2 * beta1 * S2 * C1,
    )
    return even, odd


def _member(
    Omega: Array, alpha: float, eta: float, length: float
) -> tuple[Array, NDArray[np.int64]]:
    """(dynamic stiffness (n, 4, 4) for (w, θ) at both ends, eigenvalues below Ω if clamped there).

    Those of the hinged segment are known (wave number nπ/length, in both spectra; n = 0 of the
    second is pure shear); each hinge made rigid takes a negative rotational stiffness away.
    """
    even, odd = _half_stiffness(Omega, alpha, eta, length)
    to_even = np.array([[0.5, 0, 0.5, 0], [0, -0.5, 0, 0.5]])
    to_odd = np.array([[-0.5, 0, 0.5, 0], [0, 0.5, 0, 0.5]])
    K = np.einsum("ai,ab...,bj->...ij", to_even, even, to_even)
    K = 2 * (K + np.einsum("ai,ab...,bj->...ij", to_odd, odd, to_odd))

    (mu1, _), (mu2, _) = wave_roots(Omega, alpha, eta)
    y1 = np.sqrt(-mu1) * length / np.pi
    y2 = np.sqrt(np.maximum(-mu2, 0)) * length / np.pi
    hinged = (y1 + 1) // 2 + y1 // 2 + np.where(mu2 < 0, (y2 + 1) // 2 + y2 // 2 + 1, 0)
    return K, (hinged - (even[1, 1] < 0) - (odd[1, 1] < 0)).astype(np.int64)


# --- The beam of length 1 -------------------------------------------------------------------------


class Response(NamedTuple):
    """A harmonic response, in units of L, EI/L² and rhoA."""

    value: float  # H under F = 1, Z under w = 1
    mass: float  # ∫ w² + alpha θ² dx
    moved: Array  # ∫ w dx and ∫ w (x - 1/2) + alpha θ dx
    w: Array  # at the points asked for


@dataclass(frozen=True)
class UnitBeam:
    """A beam of length 1 with its end supports (names of `ENDS`) and the site, 0 to 1."""

    alpha: float
    eta: float
    left: str
    right: str
    site: float

    @property
    def segments(self) -> list[tuple[float, float]]:
        """(start, length) of the one or two segments that the site separates."""
        a = self.site
        return [(s, length) for s, length in ((0.0, a), (a, 1 - a)) if length > 0]

    @cached_property
    def rigid(self) -> Array:
        """Rigid modes (p, q), w = p + qx and θ = q, as columns: shape (2, r)."""
        rows = [
            (1.0, end) if condition == 0 else (0.0, 1.0)
            for end, support in ((0.0, self.left), (1.0, self.right))
            for condition in ENDS[support]
            if condition < 2
        ]
        return null_space(np.array(rows)) if rows else np.eye(2)

    @property
    def rigid_mass(self) -> Array:
        """Mass matrix (2, 2) of the motions w = p + qx."""
        return np.array([[1, 0.5], [0.5, 1 / 3 + self.alpha]])

    def rigid_moved(self, motions: Array) -> Array:
        """Momentum, and angular momentum about mid-span (n, 2), of motions (p, q) (2, n)."""
        p, q = motions
        return np.column_stack((p + q / 2, q * (1 / 12 + self.alpha)))

    def solve(self, Omega: float, *, force: bool) -> tuple[list[Array], float]:
        """(coefficients of each segment's solutions, F) for F = 1 or w = 1 at the site."""
        segments = self.segments
        last = len(segments) - 1
        size = 4 * len(segments)
        first = slice(0, 4)
        second = slice(4 * last, size)
        # (state, end, solution)
        ends = [
            _states(Omega, self.alpha, self.eta, length, np.array([0.0, length]))
            for _, length in segments
        ]

        # supports; the force at the site: Q jumps down by F there, beyond an end Q is zero
        A = []
        jump = np.zeros(size)
        for columns, segment, end, support, at_site in (
            (first, ends[0], 0, self.left, self.site == 0),
            (second, ends[last], 1, self.right, self.site == 1),
        ):
            for condition in ENDS[support]:
                if not (at_site and condition == 2):
                    A.append(np.zeros(size))
                    A[-1][columns] = segment[condition, end]
        if self.site != 0:
            jump[first] += ends[0][2, 1]
        if self.site != 1:
            jump[second] -= ends[last][2, 0]

        if last == 1:
            A += [np.append(ends[0][state, 1], -ends[1][state, 0]) for state in (0, 1, 3)]
        deflection = np.zeros(size)
        deflection[first] = ends[0][0, 0 if self.site == 0 else 1]
        A.append(jump if force else deflection)

        scale = np.abs(A).max(axis=1)
        load = np.zeros(size)
        load[-1] = 1 / scale[-1]
        try:
            c = np.linalg.solve(np.array(A) / scale[:, None], load)
        except np.linalg.LinAlgError:
            raise AccuracyError(
                f"the beam has no bounded response at Ω = {Omega:g}: that is one of its own"
                " frequencies; choose another one."
            ) from None
        return [c[4 * s : 4 * s + 4] for s in range(last + 1)], float(jump @ c)

    def state(self, Omega: float, c: list[Array], x: Array) -> tuple[Array, Array]:
        """w and θ at points x of the solution with coefficients c."""
        w = np.empty_like(x)
        theta = np.empty_like(x)
        for (start, length), coefficients in zip(self.segments, c, strict=True):
            inside = (x >= start) & (x <= start + length)
            states = _states(Omega, self.alpha, self.eta, length, x[inside] - start)
            w[inside] = states[0] @ coefficients
            theta[inside] = states[1] @ coefficients
        return w, theta

    def respond(self, Omega: float, *, force: bool, x: Array) -> Response:
        """Response to F = 1, or to w = 1, at the site, with the deflection w at x."""
        c, reaction = self.solve(Omega, force=force)
        shortest = 0.0
        if Omega:
            shortest = float(max(abs(mu) for mu, _ in wave_roots(Omega, self.alpha, self.eta)))
        nodes, weights = np.polynomial.legendre.leggauss(12)

        mass = 0.0
        moved = np.zeros(2)
        for start, length in self.segments:
            panels = int(np.ceil(math.sqrt(shortest) * length / 2)) + 1
            h = length / panels
            points = start + h * (np.arange(panels)[:, None] + (nodes + 1) / 2).ravel()
            w, theta = self.state(Omega, c, points)
            rule = h / 2 * np.tile(weights, panels)
            mass += float(rule @ (w**2 + self.alpha * theta**2))
            moved += rule @ np.column_stack((w, w * (points - 0.5) + self.alpha * theta))
        value = self.state(Omega, c, np.array([self.site]))[0][0] if force else reaction
        return Response(value, mass, moved, self.state(Omega, c, x)[0])

    def _count(self, Omega: Array, *, constrained: bool) -> NDArray[np.int64]:
        """Number of eigenvalues below Ω, rigid-body ones included (Wittrick-Williams)."""
        nodes = len(self.segments) + 1
        K = np.zeros((len(Omega), 2 * nodes, 2 * nodes))
        count = np.zeros(len(Omega), dtype=np.int64)
        for s, (_, length) in enumerate(self.segments):
            part = slice(2 * s, 2 * s + 4)
            stiffness, clamped = _member(Omega, self.alpha, self.eta, length)
            K[:, part, part] += stiffness
            count += clamped

        fixed = {condition for condition in ENDS[self.left] if condition < 2}
        fixed |= {2 * nodes - 2 + condition for condition in ENDS[self.right] if condition < 2}
        if constrained:
            fixed.add(0 if self.site == 0 else 2)
        free = [dof for dof in range(2 * nodes) if dof not in fixed]
        if not free:
            return count

        # signs do not change under scaling; rows of one size keep the digits of small entries
        K = K[:, free][:, :, free]
        d = 1 / np.sqrt(np.maximum(np.abs(K).max(axis=2), np.finfo(float).tiny))
        return count + np.sum(np.linalg.eigvalsh(K * d[:, :, None] * d[:, None, :]) < 0, axis=1)

    def eigenvalues(self, n: int, *, constrained: bool) -> Array:
        """The first n eigenvalues Ω > 0 with the site free or constrained, by bisection."""
        rigid = self.rigid.shape[1]
        if constrained and rigid:  # one rigid motion less: the site sees every straight beam's
            rigid -= 1
        low = 0.1 / (1 + self.alpha + self.eta)
        if self._count(np.array([low]), constrained=constrained)[0] != rigid:
            raise AccuracyError(
                f"the count of eigenvalues below Ω = {low:g} is not the number of rigid modes,"
                f" {rigid}: the site is too close to an end for this beam."
            )
        high = 1e3 * low
        while self._count(np.array([high]), constrained=constrained)[0] < n + rigid:
            high *= 4

        # in Ω^(1/4) the spectrum is evenly spread
        lo = np.full(n, low**0.25)
        hi = np.full(n, high**0.25)
        counts = rigid + 1 + np.arange(n)
        while np.any(hi - lo > 1e-12 * hi):
            middle = (lo + hi) / 2
            high_enough = self._count(middle**4, constrained=constrained) >= counts
            lo = np.where(high_enough, lo, middle)
            hi = np.where(high_enough, middle, hi)
        return ((lo + hi) / 2) ** 4

    def observable(self, n: int, *, constrained: bool) -> Array:
        """The first n poles (site constrained) or zeros of Z, as Ω, without common values."""
        count = 2 * n + 4
        while True:
            own, others = (
                self.eigenvalues(count, constrained=c) for c in (constrained, not constrained)
            )
            top = min(own[-1], others[-1]) * (1 + SAME_ROOT)
            own, others = own[own <= top], others[others <= top]
            nearest = np.abs(own[:, None] - others).min(axis=1)
            own = own[nearest > 2 * SAME_ROOT * own]
            if len(own) >= n:
                return own[:n]
            count *= 2


# --- The models -----------------------------------------------------------------------------------


@dataclass(frozen=True)
class StruckBeam:
    """A beam, its two end supports and the impact site (deflection w, positive along the impact).

    Attributes
    ----------
    beam : the uniform beam.
    left, right : "free", "pinned" (w = 0), "clamped" (w = θ = 0) or "guided" (θ = 0).
    site : distance of the impact site from the left end in m.

    Raises
    ------
    InputError : unknown support, site off the beam or on a support.
    """

    beam: UniformBeam
    left: str
    right: str
    site: float

    def __post_init__(self) -> None:
        checks.instance("beam", self.beam, UniformBeam, "a UniformBeam")
        for name in ("left", "right"):
            checks.choice(name, getattr(self, name), tuple(ENDS))
        site = checks.number("site", self.site, "m")
        length = self.beam.length
        if not 0 <= site <= length:
            raise InputError(f"site must lie on the beam, 0 to {length:g} m; got {site:g} m.")
        if (site == 0 and 0 in ENDS[self.left]) or (site == length and 0 in ENDS[self.right]):
            raise InputError(f"the site at {site:g} m sits on a support and cannot move.")
        checks.store(self, site=site)

    @cached_property
    def rigid_modes(self) -> int:
        """Number of rigid-body modes."""
        return self._unit.rigid.shape[1]

    @property
    @checks.within_range
    def static_stiffness(self) -> float:
        """k0 in N/m, Article (20): force per deflection at the site; 0 with a rigid-body mode."""
        return self._static.value * self.beam.EI / self.beam.length**3

    @property
    @checks.within_range
    def static_mass(self) -> float:
        """m_st = M(φ_st, φ_st) in kg; with rigid-body modes φ_st is the one that moves the site.

        With rigid modes R (columns), G = RᵀMR and b = R at the site, φ_st = R G⁻¹b / (bᵀG⁻¹b) is
        M-orthogonal to the rigid motions that leave the site at rest, and m_st = 1/(bᵀG⁻¹b).
        """
        return self._static.mass * self.beam.mass

    @checks.within_range
    def dynamic_stiffness(self, omega: ArrayLike) -> Array:
        """Driving-point dynamic stiffness Z in N/m at `omega` (rad/s, > 0), same shape."""
        omega = checks.floats("omega", omega, None)
        if not np.all(omega > 0):
            raise InputError("omega must be finite and > 0 rad/s (static_stiffness is Z at 0).")
        Omega = (omega / self.beam.omega_unit) ** 2
        Z = [self._unit.solve(value, force=False)[1] for value in Omega.ravel()]
        return np.array(Z).reshape(omega.shape) * self.beam.EI / self.beam.length**3

    @checks.within_range
    def natural_frequencies(self, n: int) -> Array:
        """The first n natural frequencies > 0 in rad/s, those with a node at the site included."""
        return self._frequencies(self._unit.eigenvalues(_count_of(n), constrained=False))

    @checks.within_range
    def antiresonances(self, n: int) -> Array:
        """The first n > 0 with the site constrained, in rad/s, the unobservable ones included."""
        return self._frequencies(self._unit.eigenvalues(_count_of(n), constrained=True))

    @checks.within_range
    def anti_oscillators(self, n: int, x: ArrayLike = ()) -> AntiOscillators:
        """The first n anti-oscillators, Article (12), (15), (20), (23).

        Constraint modes that carry no mass are not counted. The model's `field` gives the
        deflections at the points `x` (m), Article (8).
        """
        points = self._checked_points(x)
        omega, m, psi, momenta = self._constraint_modes(_count_of(n), points)
        moved0 = self._static.moved * self.beam.mass
        hidden, hidden_momenta = self._hidden_motions(points)
        inertia = self._inertia(np.vstack((moved0, momenta, hidden_momenta)))
        return AntiOscillators(
            m0=self.static_mass - m.sum(),
            k0=self.static_stiffness,
            m=m,
            omega=omega,
            participation=np.concatenate(([moved0[0] - momenta[:, 0].sum()], momenta[:, 0])),
            shapes=np.column_stack((self._static_shape(points), psi.T)) if points.size else None,
            direction=ACROSS,
            inertia=inertia,
            hidden=hidden if points.size and inertia is not None else None,
        )

    @checks.within_range
    def modes(self, n: int, x: ArrayLike = (), *, static_correction: bool = False) -> ModalModel:
        """The first n natural modes that move the site, the rigid-body one included.

        Rigid-body motions that leave the site at rest are before them, with b = 0. The coordinates
        are the deflections at x [m]. With `static_correction` the static deflection of the
        truncated modes is included.
        """
        points = self._checked_points(x)
        rigid = min(self.rigid_modes, 1)
        n = _count_of(n)
        checks.flag("static_correction", static_correction)
        Omega, elastic = self._exact(n - rigid, points, constrained=False)
        mass = np.array([r.mass for r in elastic])
        moved = np.array([r.moved for r in elastic]).reshape(-1, 2)
        shapes = np.array([r.w for r in elastic]).reshape(len(elastic), points.size)
        if rigid:
            mass = np.append(self._static.mass, mass)
            moved = np.vstack((self._static.moved, moved))
            shapes = np.vstack((self._static_shape(points), shapes))

        omega = np.append(np.zeros(rigid), self._frequencies(Omega))
        b = 1 / np.sqrt(mass * self.beam.mass)
        shapes = b[:, None] * shapes
        r = 0.0
        residual = np.zeros(points.size)
        if static_correction:
            r, residual = self._compliance(points)
            modal = b[rigid:] / omega[rigid:] ** 2
            r = max(r - float(modal @ b[rigid:]), 0.0)
            residual = residual - modal @ shapes[rigid:]

        hidden, hidden_momenta = self._hidden_motions(points)
        momenta = np.vstack((hidden_momenta, b[:, None] * moved * self.beam.mass))
        zeros = np.zeros(len(hidden_momenta))
        return ModalModel(
            ModalBody(
                np.append(zeros, omega),
                np.append(zeros, b),
                r,
                weight=momenta[:, 0],
                shape=np.column_stack((hidden, shapes.T)),
                residual=residual,
                basis=(np.eye(points.size),),
                direction=ACROSS,
                inertia=self._inertia(momenta),
            )
        )

    @cached_property
    def _unit(self) -> UnitBeam:
        """The beam in units of its length."""
        beam = self.beam
        return UnitBeam(beam.alpha, beam.eta, self.left, self.right, self.site / beam.length)

    def _frequencies(self, Omega: Array) -> Array:
        return np.sqrt(Omega) * self.beam.omega_unit

    def _exact(self, n: int, x: Array, *, constrained: bool) -> tuple[Array, list[Response]]:
        """(Ω of the first n antiresonances or natural frequencies, the response there)."""
        unit = self._unit
        Omega = unit.observable(n, constrained=constrained) if n else np.zeros(0)
        for k, rough in enumerate(Omega):
            response = unit.respond(rough, force=constrained, x=x[:0])
            Omega[k] -= (1 if constrained else -1) * response.value / response.mass
        x = x / self.beam.length
        return Omega, [unit.respond(value, force=constrained, x=x) for value in Omega]

    def _constraint_modes(self, n: int, x: Array) -> tuple[Array, Array, Array, Array]:
        """ω_i (rad/s), m_i (kg), rows ψ_i at x (m), and momenta (n, 2) (kg) of ψ_i."""
        Omega, responses = self._exact(n, x, constrained=True)
        mass = Omega * np.array([r.mass for r in responses])
        psi = -np.array([r.w for r in responses]).reshape(n, len(x)) / mass[:, None]
        moved = -np.array([r.moved for r in responses]).reshape(n, 2) / mass[:, None]
        m = self.beam.mass / (Omega * mass)
        return self._frequencies(Omega), m, psi, moved * self.beam.mass

    def _compliance(self, x: Array) -> tuple[float, Array]:
        """Elastic deflection at the site and at x (m) under a unit force, without rigid modes.

        They are the values at ω = 0 of H and of the field H·(φ_st + Σ ω²/(ω_i² - ω²) ψ_i), a
        series whose terms fall as 1/i⁶.
        """
        if not self.rigid_modes:
            return 1 / self.static_stiffness, self._static_shape(x) / self.static_stiffness
        omega, m, psi, _ = self._constraint_modes(60, x)
        total = self.static_mass
        site = float(np.sum(m / omega**2)) / total**2
        return site, site * self._static_shape(x) - omega**-2.0 @ psi / total

    def _checked_points(self, x: ArrayLike) -> Array:
        points = checks.floats("x", x, (None,))
        if points.size and not (points.min() >= 0 and points.max() <= self.beam.length):
            raise InputError(f"x must lie on the beam, 0 to {self.beam.length:g} m.")
        return points

    @cached_property
    def _swing(self) -> Array:
        """(p, q) of the rigid motion w = p + qx that moves the site by 1."""
        unit = self._unit
        at_site = np.array([1, unit.site])
        G = unit.rigid.T @ unit.rigid_mass @ unit.rigid
        motion = unit.rigid @ np.linalg.solve(G, unit.rigid.T @ at_site)
        return np.asarray(motion / (motion @ at_site))

    @cached_property
    def _static(self) -> Response:
        """The static mode of the beam, or its rigid motion if it is free."""
        unit = self._unit
        if not self.rigid_modes:
            return unit.respond(0.0, force=False, x=np.zeros(0))
        mass = float(self._swing @ unit.rigid_mass @ self._swing)
        return Response(0.0, mass, unit.rigid_moved(self._swing[:, None])[0], np.zeros(0))

    def _static_shape(self, x: Array) -> Array:
        x = x / self.beam.length
        if self.rigid_modes:
            return np.asarray(self._swing[0] + self._swing[1] * x)
        return self._unit.state(0.0, self._unit.solve(0.0, force=False)[0], x)[0]

    def _hidden_motions(self, x: Array) -> tuple[Array, Array]:
        """(values (len(x), h) at x (m), momenta (h, 2)) of rigid motions, site at rest."""
        unit = self._unit
        at_site = np.array([[1, unit.site]]) @ unit.rigid
        motions = unit.rigid @ (null_space(at_site) if at_site.size else np.zeros((0, 0)))
        mass = self.beam.mass * np.sum(motions * (unit.rigid_mass @ motions), axis=0)
        motions = motions / np.sqrt(mass)
        values = motions[0] + np.multiply.outer(x / self.beam.length, motions[1])
        return values, self.beam.mass * unit.rigid_moved(motions)

    def _inertia(self, moved: Array) -> Inertia | None:
        """The inertia of a free beam along x that moves along y; None for a supported one.

        moved : (C, 2) momentum of each shape, and its moment over the length [kg].
        """
        if not self.rigid_modes:
            return None
        length = self.beam.length
        momentum = np.zeros((len(moved), 6))
        momentum[:, [1, 5]] = moved * [1, length]
        matrix = np.zeros((6, 6))
        matrix[1, 1] = self.beam.mass
        matrix[5, 5] = self.beam.mass * length**2 * (1 / 12 + self.beam.alpha)
        return Inertia(np.array([length / 2, 0, 0]), matrix, momentum)


def _count_of(n: object) -> int:
    return checks.whole("n", n, most=MOST_FREQUENCIES)
