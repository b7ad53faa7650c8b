"""The uniform straight beam: its theory, exact responses and eigenvalues.

A uniform beam with a site, in units of its length L, EI/L² and rhoA: responses and eigenvalues.

The two segments beside the site are solved exactly at a given Ω = ω²/`omega_unit`². Eigenvalues are
counted by Wittrick and Williams's rule, so that none is missed, and bracketed by bisection.

Exact solutions of Timoshenko's beam equations on one segment, static and harmonic.

Everything here is dimensionless: lengths in L, deflections in L, forces in EI/L², moments in EI/L,
and Ω = ω² rhoA L⁴/EI. With alpha and η of `UniformBeam` and Q, M the shear force and the moment,

    w' = θ + η Q,   θ' = M,   Q' = -Ω w,   M' = -Q - alpha Ω θ.

w ~ exp(λx) needs μ = λ² with μ² + Ω (alpha + η) μ + Ω (Ω alpha η - 1) = 0. Its two roots have
opposite signs below the cut-off Ω = 1/(alpha η) (a wave and an edge effect) and are both negative
above (two waves: the first and the second spectrum). All formulae below stay finite through μ = 0
and do not overflow, however short the waves.

Source: S. P. Timoshenko (1921); the dynamic stiffness of such a member and the rule that counts
its eigenvalues: W. P. Howson, F. W. Williams, J. Sound Vib. 26 (1973) 503, and W. H. Wittrick,
F. W. Williams, Q. J. Mech. Appl. Math. 24 (1971) 263.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import null_space

from antiosc.base import checks
from antiosc.base._types import Array
from antiosc.base.errors import AccuracyError


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
        E = checks.positive("E", E, "Pa")
        rho = checks.positive("rho", rho, "kg/m^3")
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
        E = checks.positive("E", E, "Pa")
        rho = checks.positive("rho", rho, "kg/m^3")
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
        if self.rhoI > 0:
            return math.sqrt(self.kGA / self.rhoI)
        return math.inf

    @property
    def omega_unit(self) -> float:
        """√(EI/(rhoA L⁴)) in rad/s, so that ω = omega_unit·√Ω (Ω as in the article)."""
        return math.sqrt(self.EI / (self.rhoA * self.length**4))


def wave_roots(
    Omega: Array | float, alpha: float, eta: float
) -> tuple[tuple[Array, Array], tuple[Array, Array]]:
    """Roots ((μ₁, β₁), (μ₂, β₂)) at Ω, where β = μ + Ωη couples the rotation: θ' = β w.

    Root 1 is the first spectrum's (always μ₁ < 0); root 2 changes sign at the cut-off.
    """
    Omega = np.asarray(Omega, dtype=float)
    root = np.sqrt((Omega * (alpha - eta)) ** 2 + 4 * Omega)
    mu1 = -(Omega * (alpha + eta) + root) / 2
    mu2 = -Omega * (1 - Omega * alpha * eta) / mu1
    # β₁β₂ = -Ω: take from the formula the one that does not cancel.
    if eta >= alpha:
        beta2 = (Omega * (eta - alpha) + root) / 2
        beta1 = -Omega / beta2
    else:
        beta1 = (Omega * (eta - alpha) - root) / 2
        beta2 = -Omega / beta1
    return (mu1, beta1), (mu2, beta2)


def even_odd(mu: Array, x: Array | float, half: float) -> tuple[Array, Array]:
    """cosh(λx) and sinh(λx)/λ with λ² = μ, both divided by cosh(λ·half) where μ > 0."""
    mu, x = np.broadcast_arrays(np.asarray(mu, dtype=float), np.asarray(x, dtype=float))
    lam = np.sqrt(np.abs(mu))
    wave = mu <= 0
    # np.sinc(z/π) = sin(z)/z is exact at z = 0.
    cos = np.cos(lam * x)
    sin = x * np.sinc(lam * x / np.pi)
    a = np.where(wave, 1.0, lam)
    size = np.abs(x)
    decay = np.exp(-a * np.maximum(half - size, 0)) / (1 + np.exp(-2 * a * half))
    cosh = decay * (1 + np.exp(-2 * a * size))
    sinh = -decay * np.sign(x) * np.expm1(-2 * a * size) / a
    return np.where(wave, cos, cosh), np.where(wave, sin, sinh)


def harmonic_states(Omega: float, alpha: float, eta: float, length: float, x: Array) -> Array:
    """States (w, θ, Q, M) of four independent solutions at points x of a segment [0, length].

    Returns shape (4 states, len(x), 4 solutions).
    """
    half = length / 2
    xi = np.asarray(x, dtype=float) - half
    columns = []
    for mu, beta in wave_roots(Omega, alpha, eta):
        C, S = even_odd(mu, xi, half)
        columns.append((C, beta * S, -Omega * S, beta * C))
        size = 1 / np.sqrt(1 + np.abs(mu))
        columns.append(
            tuple(size * f for f in (mu * S, beta * C, -Omega * C, beta * mu * S)),
        )
    return np.moveaxis(np.array(columns), 0, -1)


def static_states(eta: float, x: Array) -> Array:
    """As `harmonic_states` at Ω = 0: the cubic with w, θ, M, Q at x = 0 as its coefficients."""
    x = np.asarray(x, dtype=float)
    o = np.zeros_like(x)
    i = np.ones_like(x)
    w = (i, x, x**2 / 2, eta * x - x**3 / 6)
    theta = (o, i, x, -(x**2) / 2)
    Q = (o, o, o, i)
    M = (o, o, i, -x)
    return np.array([np.stack(rows, axis=-1) for rows in (w, theta, Q, M)])


def _half_stiffness(Omega: Array, alpha: float, eta: float, length: float) -> tuple[Array, Array]:
    """(Q, M) from (w, θ) at the right end, for motions even and odd about the middle.

    Two symmetric matrices of shape (2, 2, len(Ω)).
    """
    (mu1, beta1), (mu2, beta2) = wave_roots(Omega, alpha, eta)
    C1, S1 = even_odd(mu1, length / 2, length / 2)
    C2, S2 = even_odd(mu2, length / 2, length / 2)
    cross = Omega * (S1 * C2 - S2 * C1)
    even = np.array(
        [
            [Omega * S1 * S2 * (beta1 - beta2), cross],
            [cross, C1 * C2 * (beta2 - beta1)],
        ]
    ) / _nonzero(beta2 * C1 * S2 - beta1 * S1 * C2)
    cross = Omega * (C1 * S2 * mu2 - C2 * S1 * mu1)
    odd = np.array(
        [
            [Omega * C1 * C2 * (beta1 - beta2), cross],
            [cross, mu1 * mu2 * S1 * S2 * (beta2 - beta1)],
        ]
    ) / _nonzero(mu1 * beta2 * S1 * C2 - mu2 * beta1 * S2 * C1)
    return even, odd


def _nonzero(determinant: Array) -> Array:
    # A bisection can land on an eigenvalue of the clamped segment: step off it.
    return np.where(determinant == 0, 1e-30, determinant)


def member_stiffness(Omega: Array, alpha: float, eta: float, length: float) -> Array:
    """Dynamic stiffness of a segment for (w, θ) at its two ends, shape (len(Ω), 4, 4)."""
    to_even = np.array([[0.5, 0, 0.5, 0], [0, -0.5, 0, 0.5]])
    to_odd = np.array([[-0.5, 0, 0.5, 0], [0, 0.5, 0, 0.5]])
    even, odd = _half_stiffness(Omega, alpha, eta, length)
    return 2 * (
        np.einsum("ai,ab...,bj->...ij", to_even, even, to_even)
        + np.einsum("ai,ab...,bj->...ij", to_odd, odd, to_odd)
    )


def clamped_count(Omega: Array, alpha: float, eta: float, length: float) -> NDArray[np.int64]:
    """How many eigenvalues of the segment clamped at both ends lie below Ω.

    Those of the hinged segment are known (wave number nπ/length, in both spectra; n = 0 of the
    second is pure shear); each hinge made rigid takes a negative rotational stiffness away.
    """
    (mu1, _), (mu2, _) = wave_roots(Omega, alpha, eta)
    y1 = np.sqrt(-mu1) * length / np.pi
    y2 = np.sqrt(np.maximum(-mu2, 0)) * length / np.pi
    below_cutoff = mu2 < 0
    hinged = (y1 + 1) // 2 + y1 // 2 + np.where(below_cutoff, (y2 + 1) // 2 + y2 // 2 + 1, 0)
    even, odd = _half_stiffness(Omega, alpha, eta, length)
    return (hinged - (even[1, 1] < 0) - (odd[1, 1] < 0)).astype(np.int64)


#: End supports: which of the state (w, θ, Q, M) they hold at zero.
ENDS = {"free": (2, 3), "pinned": (0, 3), "clamped": (0, 1), "guided": (1, 2)}
#: A pole and a zero of Z closer than this (relative, in ω) belong to an unobservable mode.
SAME_ROOT = 1e-9


class Response(NamedTuple):
    """A harmonic response, in units of L, EI/L² and rhoA."""

    value: float  # H under F = 1, Z under w = 1
    mass: float  # ∫ w² + alpha θ² dx
    moved: Array  # ∫ w dx and ∫ w (x - 1/2) + alpha θ dx
    w: Array  # at the points asked for


@dataclass(frozen=True)
class UnitBeam:
    """A beam of length 1 with its end supports and the site.

    Attributes
    ----------
    alpha, eta : rotary inertia and shear compliance over those of the length, as for `UniformBeam`.
    left, right : names of `ENDS`.
    site : distance of the site from the left end, 0 to 1.
    """

    alpha: float
    eta: float
    left: str
    right: str
    site: float

    @property
    def segments(self) -> list[tuple[float, float]]:
        """(start, length) of the one or two segments that the site separates, in units of L."""
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
        if rows:
            return null_space(np.array(rows))
        return np.eye(2)

    def moved(self, x: Array, w: Array, theta: Array) -> Array:
        """Momentum and angular momentum about mid-span of shapes at points x: (n, 2)."""
        return np.column_stack((w, w * (x - 0.5) + self.alpha * theta))

    def _states(self, Omega: float, length: float, x: Array) -> Array:
        alpha = self.alpha
        eta = self.eta
        if Omega == 0:
            return static_states(eta, x)
        return harmonic_states(Omega, alpha, eta, length, x)

    def solve(self, Omega: float, *, force: bool) -> tuple[list[Array], float]:
        """(coefficients of each segment's solutions, F) for F = 1 or w = 1 at the site."""
        segments = self.segments
        size = 4 * len(segments)
        ends = [
            self._states(Omega, length, np.array([0.0, length])) for _, length in segments
        ]  # each (state, end, solution)
        rows: list[Array] = []

        def row(*terms: tuple[int, Array]) -> None:
            line = np.zeros(size)
            for segment, values in terms:
                line[4 * segment : 4 * segment + 4] += values
            rows.append(line)

        last = len(segments) - 1
        # The force at the site: Q jumps down by F there, beyond an end Q is zero.
        jump = np.zeros(size)
        at_left = self.site == 0
        at_right = self.site == 1
        if not at_left:
            jump[:4] += ends[0][2, 1]
        if not at_right:
            jump[4 * last :] -= ends[last][2, 0]
        for segment, end, support, site_index in (
            (0, 0, self.left, at_left),
            (last, 1, self.right, at_right),
        ):
            for condition in ENDS[support]:
                if not (site_index and condition == 2):
                    row((segment, ends[segment][condition, end]))
        if last == 1:
            for condition in (0, 1, 3):
                row((0, ends[0][condition, 1]), (1, -ends[1][condition, 0]))
        deflection = np.zeros(size)
        deflection[:4] = ends[0][0, 0 if at_left else 1]
        rows.append(jump if force else deflection)
        A = np.array(rows)
        scale = np.abs(A).max(axis=1)
        load = np.zeros(size)
        load[-1] = 1 / scale[-1]
        try:
            c = np.linalg.solve(A / scale[:, None], load)
        except np.linalg.LinAlgError:
            raise AccuracyError(
                f"the beam has no bounded response at Ω = {Omega:g}: that is one of its own"
                " frequencies; choose another one."
            ) from None
        return [c[4 * s : 4 * s + 4] for s in range(len(segments))], float(jump @ c)

    def state(self, Omega: float, c: list[Array], x: Array) -> tuple[Array, Array]:
        """w and θ at points x of the solution with coefficients c."""
        w = np.empty_like(x)
        theta = np.empty_like(x)
        for (start, length), coefficients in zip(self.segments, c, strict=True):
            in_segment = (x >= start) & (x <= start + length)
            states = self._states(Omega, length, x[in_segment] - start)
            w[in_segment] = states[0] @ coefficients
            theta[in_segment] = states[1] @ coefficients
        return w, theta

    def respond(self, Omega: float, *, force: bool, x: Array | None = None) -> Response:
        """Harmonic response to F = 1, or to w = 1, at the site, with the deflection w at x."""
        c, reaction = self.solve(Omega, force=force)
        (mu1, _), (mu2, _) = wave_roots(Omega, self.alpha, self.eta)
        shortest = float(np.sqrt(max(abs(mu1), abs(mu2))))
        nodes, weights = np.polynomial.legendre.leggauss(12)
        mass = 0.0
        momentum = np.zeros(2)
        for start, length in self.segments:
            panels = int(np.ceil(shortest * length / 2)) + 1
            h = length / panels
            points = start + h * (np.arange(panels)[:, None] + (nodes + 1) / 2).ravel()
            w, theta = self.state(Omega, c, points)
            rule = h / 2 * np.tile(weights, panels)
            mass += float(rule @ (w**2 + self.alpha * theta**2))
            momentum += rule @ self.moved(points, w, theta)
        at_site = self.state(Omega, c, np.array([self.site]))[0][0]
        shape = np.empty(0) if x is None else self.state(Omega, c, x)[0]
        return Response(at_site if force else reaction, mass, momentum, shape)

    def _count(self, Omega: Array, *, constrained: bool) -> NDArray[np.int64]:
        """Number of eigenvalues below Ω, rigid-body ones included (Wittrick-Williams)."""
        alpha = self.alpha
        eta = self.eta
        segments = self.segments
        nodes = len(segments) + 1
        K = np.zeros((len(Omega), 2 * nodes, 2 * nodes))
        count = np.zeros(len(Omega), dtype=np.int64)
        for s, (_, length) in enumerate(segments):
            part = slice(2 * s, 2 * s + 4)
            K[:, part, part] += member_stiffness(Omega, alpha, eta, length)
            count += clamped_count(Omega, alpha, eta, length)
        fixed = {condition for condition in ENDS[self.left] if condition < 2}
        fixed |= {2 * nodes - 2 + condition for condition in ENDS[self.right] if condition < 2}
        if constrained:
            fixed.add(0 if self.site == 0 else 2)
        free = [dof for dof in range(2 * nodes) if dof not in fixed]
        if not free:
            return count
        K = K[:, free][:, :, free]
        # Signs do not change under scaling; rows of one size keep the digits of small entries.
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
        # Bisection in Ω^(1/4), in which the spectrum is evenly spread.
        lo = np.full(n, low**0.25)
        hi = np.full(n, high**0.25)
        counts = rigid + 1 + np.arange(n)
        while np.any(hi - lo > 1e-12 * hi):
            middle = (lo + hi) / 2
            high_enough = self._count(middle**4, constrained=constrained) >= counts
            lo = np.where(high_enough, lo, middle)
            hi = np.where(high_enough, middle, hi)
        return ((lo + hi) / 2) ** 4

    def spectra(self, n: int) -> tuple[Array, Array]:
        """The first n observable poles and zeros of Z, as Ω: two spectra without common values."""
        count = 2 * n + 4
        while True:
            poles, zeros = (self.eigenvalues(count, constrained=p) for p in (True, False))
            top = min(poles[-1], zeros[-1]) * (1 + SAME_ROOT)
            poles, zeros = _unmatched(poles[poles <= top], zeros[zeros <= top])
            if min(len(poles), len(zeros)) >= n:
                return poles[:n], zeros[:n]
            count *= 2


def _unmatched(a: Array, b: Array) -> tuple[Array, Array]:
    """Two ascending lists without their common values, each of which cancels one of the other
    list.
    """
    keep_a = np.ones(len(a), dtype=bool)
    keep_b = np.ones(len(b), dtype=bool)
    i = j = 0
    while i < len(a) and j < len(b):
        if abs(a[i] - b[j]) <= 2 * SAME_ROOT * b[j]:
            keep_a[i] = keep_b[j] = False
            i = i + 1
            j = j + 1
        elif a[i] < b[j]:
            i += 1
        else:
            j += 1
    return a[keep_a], b[keep_b]
