"""A uniform beam on any end supports, struck at any point: its exact anti-oscillators and modes.

Nothing is discretised. Its eigenfrequencies, with the site free and with the site constrained, are
counted by Wittrick and Williams's rule, so that none is missed, and bracketed by bisection. The
observable ones are the zeros and the poles of the driving-point dynamic stiffness Z; one Newton
step brings them to rounding, with the slope of Z from the integral of the response:

    H = 1/Z,   dH/d(ω²) = ∫ rhoA w² + rhoI θ² dx   (response to a unit force),
    m_i = 1/(ω_i⁴ dH/d(ω²))   at an antiresonance ω_i,
    b_j² = -1/(dZ/d(ω²))      at a natural frequency ω_j.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.linalg import null_space

from antiosc import checks
from antiosc._types import Array
from antiosc.closed_form import waves
from antiosc.closed_form.uniform import UniformBeam
from antiosc.errors import AccuracyError, InputError
from antiosc.models.anti_oscillators import AntiOscillators
from antiosc.models.body import Body
from antiosc.models.modal import ModalBody
from antiosc.models.motion import Inertia

#: End supports: which of the state (w, θ, Q, M) they hold at zero.
ENDS = {"free": (2, 3), "pinned": (0, 3), "clamped": (0, 1), "guided": (1, 2)}
#: Direction of the impact in the axes of `inertia`, the beam on x.
ACROSS = np.array([0.0, 1.0, 0.0])
#: A pole and a zero of Z closer than this (relative, in ω) belong to an unobservable mode.
SAME_ROOT = 1e-9
#: Most frequencies that are sought at once.
MOST_FREQUENCIES = 10_000


class _Static(NamedTuple):
    """Of φ_st, or of φ_CR with rigid-body modes."""

    stiffness: float  # k0 in N/m
    mass: float  # m_st or m_CR in kg
    moved: Array  # momentum of w as velocity, and about mid-span over the length: (2,) in kg


class _Response(NamedTuple):
    """A harmonic response, in units of L, EI/L² and rhoA."""

    value: float  # H under F = 1, Z under w = 1
    mass: float  # ∫ w² + alpha θ² dx
    moved: Array  # ∫ w dx and ∫ w (x - 1/2) + alpha θ dx
    w: Array  # at the points asked for


@dataclass(frozen=True)
class BeamModes(Body):
    """Natural modes of a struck beam: the mode-superposition model, accepted by `simulate`.

    Attributes
    ----------
    omega : natural circular frequencies in rad/s, ascending, shape (n,); 0 for the rigid body's.
    b : deflection at the site in kg^-1/2, shape (n,), all > 0; ∫ rhoA w² + rhoI θ² dx = 1.
    weight : ∫ rhoA w dx in kg^1/2, shape (n,).
    r : residual compliance in m/N, 0 without static correction.
    x : points in m at which the shapes were asked for.
    shapes : deflections of the modes at x in kg^-1/2, shape (n, len(x)).
    residual : deflection at x per unit force in m/N that goes with r, shape (len(x),).
    hidden : deflections at x of the h rigid-body motions that leave the site at rest, (h, len(x)).
    inertia : momentum (h + n, 6) of those and of the modes, in axes with the beam on x from 0 and
        the impact along y; None without rigid-body motions.
    """

    omega: Array
    b: Array
    weight: Array
    r: float
    x: Array
    shapes: Array
    residual: Array
    hidden: Array
    inertia: Inertia | None = None

    def modal(self) -> ModalBody:
        """As a body of an impact; its coordinates are the deflections at x."""
        none = np.zeros(len(self.hidden))
        weight = self.weight
        if self.inertia is not None:
            weight = np.append(self.inertia.momentum[: none.size, 1], weight)
        return ModalBody(
            np.append(none, self.omega),
            np.append(none, self.b),
            self.r,
            weight=weight,
            shape=np.vstack((self.hidden, self.shapes)).T,
            residual=self.residual,
            basis=(np.eye(len(self.x)),),
            direction=ACROSS,
            inertia=self.inertia,
        )

    def field(self, coordinates: ArrayLike) -> Array:
        """The deflections at x (m): the coordinates themselves."""
        return checks.array("coordinates", coordinates, None)


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
        site, length = checks.number("site", self.site, "m"), self.beam.length
        if not 0 <= site <= length:
            raise InputError(f"site must lie on the beam, 0 to {length:g} m; got {site:g} m.")
        if (site == 0 and 0 in ENDS[self.left]) or (site == length and 0 in ENDS[self.right]):
            raise InputError(f"the site at {site:g} m sits on a support and cannot move.")
        checks.store(self, site=site)

    # ---- statics -------------------------------------------------------------------------------

    @cached_property
    def rigid_modes(self) -> int:
        """Number of rigid-body modes."""
        return self._rigid.shape[1]

    @property
    @checks.within_range
    def static_stiffness(self) -> float:
        """k0 in N/m, Article (20): force per deflection at the site; 0 with a rigid-body mode."""
        return self._static.stiffness

    @property
    @checks.within_range
    def static_mass(self) -> float:
        """m_st = M(φ_st, φ_st) in kg, or m_CR = M(φ_CR, φ_CR) with rigid-body modes.

        With rigid modes R (columns), G = RᵀMR and b = R at the site, φ_CR = R G⁻¹b / (bᵀG⁻¹b) is
        M-orthogonal to the rigid motions that leave the site at rest, and m_CR = 1/(bᵀG⁻¹b).
        """
        return self._static.mass

    # ---- harmonic response ---------------------------------------------------------------------

    @checks.within_range
    def dynamic_stiffness(self, omega: ArrayLike) -> Array:
        """Driving-point dynamic stiffness Z in N/m at `omega` (rad/s, > 0), same shape."""
        omega = checks.array("omega", omega, None)
        if not np.all(omega > 0):
            raise InputError("omega must be finite and > 0 rad/s (static_stiffness is Z at 0).")
        Omega = (omega / self.beam.omega_unit) ** 2
        Z = [self._solve(value, force=False)[1] for value in Omega.ravel()]
        return np.array(Z).reshape(omega.shape) * self.beam.EI / self.beam.length**3

    @checks.within_range
    def natural_frequencies(self, n: int) -> Array:
        """The first n natural frequencies > 0 in rad/s, those with a node at the site included."""
        n = checks.whole("n", n, most=MOST_FREQUENCIES)
        return np.sqrt(self._eigenvalues(n, constrained=False)) * self.beam.omega_unit

    @checks.within_range
    def antiresonances(self, n: int) -> Array:
        """The first n > 0 with the site constrained, in rad/s, the unobservable ones included."""
        n = checks.whole("n", n, most=MOST_FREQUENCIES)
        return np.sqrt(self._eigenvalues(n, constrained=True)) * self.beam.omega_unit

    # ---- the models ----------------------------------------------------------------------------

    @checks.within_range
    def anti_oscillators(self, n: int, x: ArrayLike = ()) -> AntiOscillators:
        """The first n anti-oscillators, Article (12), (15), (20), (23).

        Constraint modes that carry no mass are not counted. The model's `field` gives the
        deflections at the points `x` (m), Article (8).
        """
        points = self._points(x)
        omega, m, psi, moved = self._constraint_modes(
            checks.whole("n", n, most=MOST_FREQUENCIES), points
        )
        psi0, moved0 = self._static_shape(points), self._static.moved
        hidden, carried = self._hidden(points)
        inertia = self._inertia(np.vstack((moved0, moved, carried)))
        return AntiOscillators(
            m0=self.static_mass - m.sum(),
            k0=self.static_stiffness,
            m=m,
            omega=omega,
            participation=np.concatenate(([moved0[0] - moved[:, 0].sum()], moved[:, 0])),
            shapes=np.column_stack((psi0, psi.T)) if points.size else None,
            direction=ACROSS,
            inertia=inertia,
            hidden=hidden if points.size and inertia is not None else None,
        )

    @checks.within_range
    def modes(self, n: int, x: ArrayLike = (), *, static_correction: bool = False) -> BeamModes:
        """The first n natural modes that move the site, the rigid-body one included.

        Of several rigid-body modes one moves the site, φ_CR/√m_CR. With `static_correction` the
        static deflection of the truncated modes is included.
        """
        points = self._points(x)
        rigid = min(self.rigid_modes, 1)
        n = checks.whole("n", n, most=MOST_FREQUENCIES)
        checks.flag("static_correction", static_correction)
        omega, b, moved = np.zeros(n), np.empty(n), np.empty((n, 2))
        shapes = np.empty((n, len(points)))
        if rigid:
            b[0] = 1 / np.sqrt(self.static_mass)
            moved[0] = b[0] * self._static.moved
            shapes[0] = b[0] * self._static_shape(points)
        for j, zero in enumerate(self._spectra(n)[1][: n - rigid], start=rigid):
            rough = self._respond(zero, force=False)
            zero += rough.value / rough.mass
            response = self._respond(zero, force=False, x=points)
            omega[j] = np.sqrt(zero) * self.beam.omega_unit
            b[j] = 1 / np.sqrt(response.mass * self.beam.mass)
            moved[j] = b[j] * response.moved * self.beam.mass
            shapes[j] = b[j] * response.w
        r, residual = 0.0, np.zeros(len(points))
        if static_correction:
            r, residual = self._compliance(points)
            modal = b[rigid:] / omega[rigid:] ** 2
            r, residual = r - modal @ b[rigid:], residual - modal @ shapes[rigid:]
        hidden, carried = self._hidden(points)
        inertia = self._inertia(np.vstack((carried, moved)))
        return BeamModes(
            omega, b, moved[:, 0], max(r, 0.0), points, shapes, residual, hidden.T, inertia
        )

    # ---- how -----------------------------------------------------------------------------------

    def _constraint_modes(self, n: int, x: Array) -> tuple[Array, Array, Array, Array]:
        """ω_i (rad/s), m_i (kg), ψ_i at x (m) as rows, what ψ_i moves (n, 2) (kg)."""
        omega, m, psi, moved = np.empty(n), np.empty(n), np.empty((n, len(x))), np.empty((n, 2))
        for i, pole in enumerate(self._spectra(n)[0]):
            rough = self._respond(pole, force=True)
            pole -= rough.value / rough.mass
            response = self._respond(pole, force=True, x=x)
            omega[i] = np.sqrt(pole) * self.beam.omega_unit
            m[i] = self.beam.mass / (pole**2 * response.mass)
            psi[i] = -response.w / (pole * response.mass)
            moved[i] = -response.moved / (pole * response.mass) * self.beam.mass
        return omega, m, psi, moved

    def _compliance(self, x: Array) -> tuple[float, Array]:
        """Elastic deflection at the site and at x (m) under a unit force, without rigid modes.

        The constant term in ω² of H and of the field H·(φ_CR + Σ ω²/(ω_i² - ω²) ψ_i). The series
        falls as 1/i⁶.
        """
        if not self.rigid_modes:
            return 1 / self.static_stiffness, self._static_shape(x) / self.static_stiffness
        omega, m, psi, _ = self._constraint_modes(60, x)
        total = self.static_mass
        site = float(np.sum(m / omega**2)) / total**2
        return site, site * self._static_shape(x) - omega**-2.0 @ psi / total

    def _points(self, x: ArrayLike) -> Array:
        points = checks.array("x", x, (None,))
        if points.size and not (points.min() >= 0 and points.max() <= self.beam.length):
            raise InputError(f"x must lie on the beam, 0 to {self.beam.length:g} m.")
        return points

    @property
    def _segments(self) -> list[tuple[float, float]]:
        """(start, length) of the one or two segments that the site leaves, in units of L."""
        a = self.site / self.beam.length
        return [(s, length) for s, length in ((0.0, a), (a, 1 - a)) if length > 0]

    @cached_property
    def _rigid(self) -> Array:
        """Rigid modes (p, q), w = p + qx and θ = q, as columns: shape (2, r)."""
        rows = [
            (1.0, end) if which == 0 else (0.0, 1.0)
            for end, support in ((0.0, self.left), (1.0, self.right))
            for which in ENDS[support]
            if which < 2
        ]
        return null_space(np.array(rows)) if rows else np.eye(2)

    @cached_property
    def _static(self) -> _Static:
        nodes, weights = np.polynomial.legendre.leggauss(4)  # exact: w² has degree 6
        mass, moved = 0.0, np.zeros(2)
        for start, length in self._segments:
            points = start + length * (nodes + 1) / 2
            w, theta = self._static_state(points)
            mass += length / 2 * np.sum(weights * (w**2 + self.beam.alpha * theta**2))
            moved += length / 2 * (weights @ self._moved(points, w, theta))
        stiffness = 0.0 if self.rigid_modes else self._solve(0.0, force=False)[1]
        unit = self.beam.EI / self.beam.length**3
        return _Static(stiffness * unit, mass * self.beam.mass, moved * self.beam.mass)

    def _moved(self, x: Array, w: Array, theta: Array) -> Array:
        """Momentum and angular momentum about mid-span at points x (in L): (n, 2)."""
        return np.column_stack((w, w * (x - 0.5) + self.beam.alpha * theta))

    def _hidden(self, x: Array) -> tuple[Array, Array]:
        """Rigid motions of unit mass that leave the site at rest: (len(x), h) at x (m), (h, 2)."""
        at_site = np.array([[1, self.site / self.beam.length]]) @ self._rigid
        motions = self._rigid @ (null_space(at_site) if at_site.size else np.zeros((0, 0)))
        mass = np.array([[1, 0.5], [0.5, 1 / 3 + self.beam.alpha]])
        p, q = motions / np.sqrt(self.beam.mass * np.sum(motions * (mass @ motions), axis=0))
        moved = np.column_stack((p + q / 2, q * (1 / 12 + self.beam.alpha)))
        return p + np.multiply.outer(x / self.beam.length, q), self.beam.mass * moved

    def _inertia(self, moved: Array) -> Inertia | None:
        """Of a beam that can move as a whole, along y with the beam on x; `moved` (C, 2) in kg."""
        if not self.rigid_modes:
            return None
        length, momentum, matrix = self.beam.length, np.zeros((len(moved), 6)), np.zeros((6, 6))
        momentum[:, [1, 5]] = moved * [1, length]
        matrix[1, 1] = self.beam.mass
        matrix[5, 5] = self.beam.mass * length**2 * (1 / 12 + self.beam.alpha)
        return Inertia(np.array([length / 2, 0, 0]), matrix, momentum)

    def _static_shape(self, x: Array) -> Array:
        return self._static_state(x / self.beam.length)[0]

    def _static_state(self, x: Array) -> tuple[Array, Array]:
        """w and θ of the static mode or of φ_CR at x (in L), with w = 1 at the site."""
        if not self.rigid_modes:
            return self._state(0.0, self._solve(0.0, force=False)[0], x)
        mass = np.array([[1, 0.5], [0.5, 1 / 3 + self.beam.alpha]])
        b = self._rigid.T @ np.array([1, self.site / self.beam.length])
        p, q = self._rigid @ np.linalg.solve(self._rigid.T @ mass @ self._rigid, b)
        at_site = p + q * self.site / self.beam.length
        return (p + q * x) / at_site, np.full_like(x, q / at_site)

    def _states(self, Omega: float, length: float, x: Array) -> Array:
        alpha, eta = self.beam.alpha, self.beam.eta
        if Omega == 0:
            return waves.static_states(eta, x)
        return waves.harmonic_states(Omega, alpha, eta, length, x)

    def _solve(self, Omega: float, *, force: bool) -> tuple[list[Array], float]:
        """Coefficients of each segment's solutions under F = 1, or w = 1, at the site; and F."""
        segments = self._segments
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
        at_left, at_right = self.site == 0, self.site == self.beam.length
        if not at_left:
            jump[:4] += ends[0][2, 1]
        if not at_right:
            jump[4 * last :] -= ends[last][2, 0]
        for segment, end, support, struck in (
            (0, 0, self.left, at_left),
            (last, 1, self.right, at_right),
        ):
            for which in ENDS[support]:
                if not (struck and which == 2):
                    row((segment, ends[segment][which, end]))
        if last == 1:
            for which in (0, 1, 3):
                row((0, ends[0][which, 1]), (1, -ends[1][which, 0]))
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
                " frequencies; move off it."
            ) from None
        return [c[4 * s : 4 * s + 4] for s in range(len(segments))], float(jump @ c)

    def _state(self, Omega: float, c: list[Array], x: Array) -> tuple[Array, Array]:
        """w and θ at points x (in L) of the solution with coefficients c."""
        w, theta = np.empty_like(x), np.empty_like(x)
        for (start, length), coefficients in zip(self._segments, c, strict=True):
            here = (x >= start) & (x <= start + length)
            states = self._states(Omega, length, x[here] - start)
            w[here], theta[here] = states[0] @ coefficients, states[1] @ coefficients
        return w, theta

    def _respond(self, Omega: float, *, force: bool, x: Array | None = None) -> _Response:
        """Harmonic response to F = 1, or to w = 1, at the site; its w at x (m)."""
        c, reaction = self._solve(Omega, force=force)
        (mu1, _), (mu2, _) = waves.wave_roots(Omega, self.beam.alpha, self.beam.eta)
        shortest = float(np.sqrt(max(abs(mu1), abs(mu2))))
        nodes, weights = np.polynomial.legendre.leggauss(12)
        mass, moved = 0.0, np.zeros(2)
        for start, length in self._segments:
            panels = int(np.ceil(shortest * length / 2)) + 1
            h = length / panels
            points = start + h * (np.arange(panels)[:, None] + (nodes + 1) / 2).ravel()
            w, theta = self._state(Omega, c, points)
            rule = h / 2 * np.tile(weights, panels)
            mass += float(rule @ (w**2 + self.beam.alpha * theta**2))
            moved += rule @ self._moved(points, w, theta)
        at_site = self._state(Omega, c, np.array([self.site / self.beam.length]))[0][0]
        shape = np.empty(0) if x is None else self._state(Omega, c, x / self.beam.length)[0]
        return _Response(at_site if force else reaction, mass, moved, shape)

    def _count(self, Omega: Array, *, constrained: bool) -> NDArray[np.int64]:
        """Number of eigenvalues below Ω, zero ones included (Wittrick-Williams)."""
        alpha, eta = self.beam.alpha, self.beam.eta
        segments = self._segments
        nodes = len(segments) + 1
        K = np.zeros((len(Omega), 2 * nodes, 2 * nodes))
        count = np.zeros(len(Omega), dtype=np.int64)
        for s, (_, length) in enumerate(segments):
            part = slice(2 * s, 2 * s + 4)
            K[:, part, part] += waves.member_stiffness(Omega, alpha, eta, length)
            count += waves.clamped_count(Omega, alpha, eta, length)
        fixed = {which for which in ENDS[self.left] if which < 2}
        fixed |= {2 * nodes - 2 + which for which in ENDS[self.right] if which < 2}
        if constrained:
            fixed.add(0 if self.site == 0 else 2)
        free = [dof for dof in range(2 * nodes) if dof not in fixed]
        if not free:
            return count
        K = K[:, free][:, :, free]
        # Signs do not change under scaling; rows of one size keep the digits of small entries.
        d = 1 / np.sqrt(np.maximum(np.abs(K).max(axis=2), np.finfo(float).tiny))
        return count + np.sum(np.linalg.eigvalsh(K * d[:, :, None] * d[:, None, :]) < 0, axis=1)

    def _eigenvalues(self, n: int, *, constrained: bool) -> Array:
        """The first n eigenvalues Ω > 0 with the site free or constrained, by bisection."""
        rigid = self.rigid_modes
        if constrained and rigid:  # one rigid motion less: the site sees every straight beam's
            rigid -= 1
        low = 0.1 / (1 + self.beam.alpha + self.beam.eta)
        if self._count(np.array([low]), constrained=constrained)[0] != rigid:
            raise AccuracyError(
                f"the count of eigenvalues below Ω = {low:g} is not the number of rigid modes,"
                f" {rigid}: the site is too close to an end for this beam."
            )
        high = 1e3 * low
        while self._count(np.array([high]), constrained=constrained)[0] < n + rigid:
            high *= 4
        # Bisection in Ω^(1/4), in which the spectrum is evenly spread.
        lo, hi = np.full(n, low**0.25), np.full(n, high**0.25)
        wanted = rigid + 1 + np.arange(n)
        while np.any(hi - lo > 1e-12 * hi):
            middle = (lo + hi) / 2
            enough = self._count(middle**4, constrained=constrained) >= wanted
            lo, hi = np.where(enough, lo, middle), np.where(enough, middle, hi)
        return ((lo + hi) / 2) ** 4

    def _spectra(self, n: int) -> tuple[Array, Array]:
        """The first n observable poles and zeros of Z, as Ω: the two spectra, common ones out."""
        asked = 2 * n + 4
        while True:
            poles, zeros = (self._eigenvalues(asked, constrained=p) for p in (True, False))
            top = min(poles[-1], zeros[-1]) * (1 + SAME_ROOT)
            poles, zeros = _unmatched(poles[poles <= top], zeros[zeros <= top])
            if min(len(poles), len(zeros)) >= n:
                return poles[:n], zeros[:n]
            asked *= 2


def _unmatched(a: Array, b: Array) -> tuple[Array, Array]:
    """Two ascending lists without the pairs they share (each entry pairs at most once)."""
    keep_a, keep_b = np.ones(len(a), dtype=bool), np.ones(len(b), dtype=bool)
    i = j = 0
    while i < len(a) and j < len(b):
        if abs(a[i] - b[j]) <= 2 * SAME_ROOT * b[j]:
            keep_a[i] = keep_b[j] = False
            i, j = i + 1, j + 1
        elif a[i] < b[j]:
            i += 1
        else:
            j += 1
    return a[keep_a], b[keep_b]
