"""A uniform beam on any end supports, struck at any point: its exact anti-oscillators and modes.

Nothing is discretised. `UnitBeam` finds its eigenfrequencies, with the site free and with the site
constrained. The observable ones are the zeros and the poles of the driving-point dynamic stiffness
Z; one Newton step brings them to rounding, with the slope of Z from the integral of the response:

    H = 1/Z,   dH/d(ω²) = ∫ rhoA w² + rhoI θ² dx   (response to a unit force),
    m_i = 1/(ω_i⁴ dH/d(ω²))   at an antiresonance ω_i,
    b_j² = -1/(dZ/d(ω²))      at a natural frequency ω_j.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike
from scipy.linalg import null_space

from antiosc.base import checks
from antiosc.base._types import Array
from antiosc.base.errors import InputError
from antiosc.models.anti_oscillators import AntiOscillators
from antiosc.models.body import Body
from antiosc.models.closed_form.beams import ENDS, UniformBeam, UnitBeam
from antiosc.models.modal import ModalBody
from antiosc.models.motion import Inertia

#: Direction of the impact in the axes of `inertia`, the beam on x.
ACROSS = np.array([0.0, 1.0, 0.0])
#: Most frequencies that are sought at once.
MOST_FREQUENCIES = 10_000


class _Static(NamedTuple):
    """The static mode of the beam, or its rigid motion if it is free."""

    stiffness: float  # k0 in N/m
    mass: float  # m_st in kg
    moved: Array  # momentum of w as velocity, and about mid-span over the length: (2,) in kg


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
    inertia : momentum (h + n, 6) of the h rigid-body motions and the n modes; the beam lies on the
        x axis from 0, the impact is along y. None without rigid-body motions.
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
        """The beam as a body of an impact; its coordinates are the deflections at x."""
        zeros = np.zeros(len(self.hidden))
        weight = self.weight
        if self.inertia is not None:
            weight = np.append(self.inertia.momentum[: zeros.size, 1], weight)
        return ModalBody(
            np.append(zeros, self.omega),
            np.append(zeros, self.b),
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
        return checks.floats("coordinates", coordinates, None)


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

    # ---- statics -------------------------------------------------------------------------------

    @cached_property
    def rigid_modes(self) -> int:
        """Number of rigid-body modes."""
        return self._unit.rigid.shape[1]

    @property
    @checks.within_range
    def static_stiffness(self) -> float:
        """k0 in N/m, Article (20): force per deflection at the site; 0 with a rigid-body mode."""
        return self._static.stiffness

    @property
    @checks.within_range
    def static_mass(self) -> float:
        """m_st = M(φ_st, φ_st) in kg; with rigid-body modes φ_st is the one that moves the site.

        With rigid modes R (columns), G = RᵀMR and b = R at the site, φ_st = R G⁻¹b / (bᵀG⁻¹b) is
        M-orthogonal to the rigid motions that leave the site at rest, and m_st = 1/(bᵀG⁻¹b).
        """
        return self._static.mass

    # ---- harmonic response ---------------------------------------------------------------------

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
        n = checks.whole("n", n, most=MOST_FREQUENCIES)
        return np.sqrt(self._unit.eigenvalues(n, constrained=False)) * self.beam.omega_unit

    @checks.within_range
    def antiresonances(self, n: int) -> Array:
        """The first n > 0 with the site constrained, in rad/s, the unobservable ones included."""
        n = checks.whole("n", n, most=MOST_FREQUENCIES)
        return np.sqrt(self._unit.eigenvalues(n, constrained=True)) * self.beam.omega_unit

    # ---- the models ----------------------------------------------------------------------------

    @checks.within_range
    def anti_oscillators(self, n: int, x: ArrayLike = ()) -> AntiOscillators:
        """The first n anti-oscillators, Article (12), (15), (20), (23).

        Constraint modes that carry no mass are not counted. The model's `field` gives the
        deflections at the points `x` (m), Article (8).
        """
        points = self._checked_points(x)
        omega, m, psi, momenta = self._constraint_modes(
            checks.whole("n", n, most=MOST_FREQUENCIES), points
        )
        psi0 = self._static_shape(points)
        moved0 = self._static.moved
        hidden, hidden_momenta = self._hidden_motions(points)
        inertia = self._inertia(np.vstack((moved0, momenta, hidden_momenta)))
        return AntiOscillators(
            m0=self.static_mass - m.sum(),
            k0=self.static_stiffness,
            m=m,
            omega=omega,
            participation=np.concatenate(([moved0[0] - momenta[:, 0].sum()], momenta[:, 0])),
            shapes=np.column_stack((psi0, psi.T)) if points.size else None,
            direction=ACROSS,
            inertia=inertia,
            hidden=hidden if points.size and inertia is not None else None,
        )

    @checks.within_range
    def modes(self, n: int, x: ArrayLike = (), *, static_correction: bool = False) -> BeamModes:
        """The first n natural modes that move the site, the rigid-body one included.

        Of several rigid-body modes one moves the site, φ_st/√m_st. With `static_correction` the
        static deflection of the truncated modes is included.
        """
        points = self._checked_points(x)
        rigid = min(self.rigid_modes, 1)
        n = checks.whole("n", n, most=MOST_FREQUENCIES)
        checks.flag("static_correction", static_correction)
        omega = np.zeros(n)
        b = np.empty(n)
        momenta = np.empty((n, 2))
        shapes = np.empty((n, len(points)))
        if rigid:
            b[0] = 1 / np.sqrt(self.static_mass)
            momenta[0] = b[0] * self._static.moved
            shapes[0] = b[0] * self._static_shape(points)
        for j, zero in enumerate(self._unit.spectra(n)[1][: n - rigid], start=rigid):
            rough = self._unit.respond(zero, force=False)
            zero += rough.value / rough.mass
            response = self._unit.respond(zero, force=False, x=points / self.beam.length)
            omega[j] = np.sqrt(zero) * self.beam.omega_unit
            b[j] = 1 / np.sqrt(response.mass * self.beam.mass)
            momenta[j] = b[j] * response.moved * self.beam.mass
            shapes[j] = b[j] * response.w
        r = 0.0
        residual = np.zeros(len(points))
        if static_correction:
            r, residual = self._compliance(points)
            modal = b[rigid:] / omega[rigid:] ** 2
            r = r - modal @ b[rigid:]
            residual = residual - modal @ shapes[rigid:]
        hidden, hidden_momenta = self._hidden_motions(points)
        inertia = self._inertia(np.vstack((hidden_momenta, momenta)))
        return BeamModes(
            omega, b, momenta[:, 0], max(r, 0.0), points, shapes, residual, hidden.T, inertia
        )

    # ---- how -----------------------------------------------------------------------------------

    @cached_property
    def _unit(self) -> UnitBeam:
        """The beam in units of its length."""
        beam = self.beam
        return UnitBeam(beam.alpha, beam.eta, self.left, self.right, self.site / beam.length)

    def _constraint_modes(self, n: int, x: Array) -> tuple[Array, Array, Array, Array]:
        """ω_i (rad/s), m_i (kg), rows ψ_i at x (m), and momenta (n, 2) (kg) of ψ_i."""
        omega = np.empty(n)
        m = np.empty(n)
        psi = np.empty((n, len(x)))
        momenta = np.empty((n, 2))
        for i, pole in enumerate(self._unit.spectra(n)[0]):
            rough = self._unit.respond(pole, force=True)
            pole -= rough.value / rough.mass
            response = self._unit.respond(pole, force=True, x=x / self.beam.length)
            omega[i] = np.sqrt(pole) * self.beam.omega_unit
            m[i] = self.beam.mass / (pole**2 * response.mass)
            psi[i] = -response.w / (pole * response.mass)
            momenta[i] = -response.moved / (pole * response.mass) * self.beam.mass
        return omega, m, psi, momenta

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
    def _static(self) -> _Static:
        nodes, weights = np.polynomial.legendre.leggauss(4)  # exact: w² has degree 6
        mass = 0.0
        momentum = np.zeros(2)
        for start, length in self._unit.segments:
            points = start + length * (nodes + 1) / 2
            w, theta = self._static_state(points)
            mass += length / 2 * np.sum(weights * (w**2 + self.beam.alpha * theta**2))
            momentum += length / 2 * (weights @ self._unit.moved(points, w, theta))
        stiffness = 0.0 if self.rigid_modes else self._unit.solve(0.0, force=False)[1]
        unit = self.beam.EI / self.beam.length**3
        return _Static(stiffness * unit, mass * self.beam.mass, momentum * self.beam.mass)

    def _hidden_motions(self, x: Array) -> tuple[Array, Array]:
        """(values (len(x), h) at x (m), momenta (h, 2)) of rigid motions, site at rest."""
        at_site = np.array([[1, self.site / self.beam.length]]) @ self._unit.rigid
        motions = self._unit.rigid @ (null_space(at_site) if at_site.size else np.zeros((0, 0)))
        mass = np.array([[1, 0.5], [0.5, 1 / 3 + self.beam.alpha]])
        p, q = motions / np.sqrt(self.beam.mass * np.sum(motions * (mass @ motions), axis=0))
        momenta = np.column_stack((p + q / 2, q * (1 / 12 + self.beam.alpha)))
        return p + np.multiply.outer(x / self.beam.length, q), self.beam.mass * momenta

    def _inertia(self, moved: Array) -> Inertia | None:
        """The inertia of a free beam along x that moves along y; None for a supported one.

        moved : (C, 2) momentum of each shape, and its moment over the length [kg].
        """
        if not self.rigid_modes:
            return None
        length = self.beam.length
        momentum = np.zeros((len(moved), 6))
        matrix = np.zeros((6, 6))
        momentum[:, [1, 5]] = moved * [1, length]
        matrix[1, 1] = self.beam.mass
        matrix[5, 5] = self.beam.mass * length**2 * (1 / 12 + self.beam.alpha)
        return Inertia(np.array([length / 2, 0, 0]), matrix, momentum)

    def _static_shape(self, x: Array) -> Array:
        return self._static_state(x / self.beam.length)[0]

    def _static_state(self, x: Array) -> tuple[Array, Array]:
        """w and θ of the static mode (or rigid motion) at x (in L), with w = 1 at the site."""
        if not self.rigid_modes:
            return self._unit.state(0.0, self._unit.solve(0.0, force=False)[0], x)
        mass = np.array([[1, 0.5], [0.5, 1 / 3 + self.beam.alpha]])
        b = self._unit.rigid.T @ np.array([1, self.site / self.beam.length])
        p, q = self._unit.rigid @ np.linalg.solve(self._unit.rigid.T @ mass @ self._unit.rigid, b)
        at_site = p + q * self.site / self.beam.length
        return (p + q * x) / at_site, np.full_like(x, q / at_site)
