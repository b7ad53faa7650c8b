"""Every linear body in an impact is a set of free modes with their values at the contact point.

With mass-normalised free modes q_j, a force F on the contact point along the impact direction
and a gravity g in that direction,

    q_j'' + 2 d_j q_j' + omega_j^2 q_j = b_j F + w_j g,      u = sum_j b_j q_j + r F,

so the receptance is H(omega) = sum_j b_j^2/(omega_j^2 - omega^2) + r when nothing is damped. Any
object whose `modal()` returns a `ModalBody` can take part in an impact (`antiosc.models.body`).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from antiosc import checks
from antiosc._types import Array, ComplexArray, Index
from antiosc.brief import Brief
from antiosc.errors import InputError, NotConvergedError
from antiosc.models.motion import Inertia, Motion, unit_vector

#: Share of a rigid motion's kinetic energy outside the body's rigid-body modes that is rounding.
MISSED_ENERGY = 1e-8
#: Message for a body without a displacement field.
NO_SHAPES = (
    "this model has no displacement field: it has no shapes (model files do not store them); "
    "extract it again to recover fields."
)


@dataclass(frozen=True)
class Damping:
    """Damping of the free modes: decay d_j = ratio_j omega_j + alpha/2 + beta omega_j^2/2 [1/s].

    Parameters
    ----------
    ratio : float or sequence of float
        Damping ratios of the elastic free modes in ascending order; the last value applies to all
        higher modes.
    alpha, beta : float
        Rayleigh coefficients of C = alpha M + beta K [1/s], [s]. beta acts as a dashpot parallel to
        every spring of the model; alpha damps rigid-body motion as well.
    """

    ratio: float | Sequence[float] = 0.0
    alpha: float = 0.0
    beta: float = 0.0

    def __post_init__(self) -> None:
        ratios = checks.column("ratio", self.ratio)
        if not ratios.size or np.any(ratios < 0):
            raise InputError(f"damping ratios must be >= 0; got {checks.shown(self.ratio)}.")
        checks.store(
            self,
            ratio=float(ratios[0]) if ratios.size == 1 else tuple(ratios.tolist()),
            alpha=checks.nonnegative("alpha", self.alpha, "1/s"),
            beta=checks.nonnegative("beta", self.beta, "s"),
        )

    def decay(self, omega: Array) -> Array:
        """Decay constants d_j [1/s] for ascending circular frequencies, shape (J,)."""
        omega = checks.array("omega", omega, (None,))
        ratios = checks.column("ratio", self.ratio)
        rigid = int(np.count_nonzero(omega == 0))
        index = np.clip(np.arange(omega.size) - rigid, 0, ratios.size - 1)
        return np.asarray(ratios[index] * omega + self.alpha / 2 + self.beta * omega**2 / 2)

    def as_dict(self) -> dict[str, Any]:
        """Constructor arguments as JSON values."""
        return {
            "ratio": np.asarray(self.ratio, dtype=float).tolist(),
            "alpha": float(self.alpha),
            "beta": float(self.beta),
        }


def as_damping(value: Any) -> Damping | None:
    """A Damping of itself, of one ratio or of the ratios of the modes; None for None."""
    if value is None or isinstance(value, Damping):
        return value
    return Damping(ratio=value)


@dataclass(frozen=True, eq=False, repr=False)
class ModalBody(Brief):
    """A linear body in free modes (see the module's equations).

    Attributes
    ----------
    omega : (J,) circular frequencies [rad/s]; exactly 0 for rigid-body modes.
    b : (J,) displacement of the contact point in each mass-normalised mode [kg^-1/2]; 0 for hidden
        rigid-body motions, which do not move the contact point.
    r : residual compliance [m/N] >= 0 of the contact point, without inertia.
    decay : (J,) decay constants d [1/s]; None: undamped.
    weight : (J,) modal force of a unit gravity along the impact direction [kg^1/2]; None: unknown.
    shape, residual : (C, J) and (C,) the transformation to the body's own coordinates,
        x = shape q + residual F; None: the modes are the coordinates.
    basis : displacement shapes of the whole body, blocks (n, .) of columns side by side, on the
        rows of this rank; None: unknown.
    amplitude : (B, C) amplitudes of the B columns of `basis` per unit coordinate; None: each
        coordinate is the amplitude of one column.
    direction : (3,) unit vector along which the contact force pushes; None: unknown.
    inertia : momentum (J, 6) of each mode and the mass of the whole body; None: unknown.
    """

    omega: Array
    b: Array
    r: float = 0.0
    decay: Array | None = None
    weight: Array | None = None
    shape: Array | None = None
    residual: Array | None = None
    basis: tuple[Array, ...] | None = None
    amplitude: Array | None = None
    direction: Array | None = None
    inertia: Inertia | None = None

    def __post_init__(self) -> None:
        checks.store(self, omega=checks.array("omega", self.omega, (None,)))
        size = self.omega.size
        for name in ("b", "decay", "weight"):
            value = getattr(self, name)
            if value is not None or name == "b":
                checks.store(self, **{name: checks.array(name, value, (size,))})
        if np.any(self.omega < 0):
            raise InputError(f"omega must be >= 0; its least entry is {self.omega.min():g} rad/s.")
        if self.decay is not None and np.any(self.decay < 0):
            raise InputError("decay must be >= 0: negative damping adds energy.")
        checks.store(self, r=checks.nonnegative("r", self.r, "m/N"))
        if self.shape is not None:
            checks.store(self, shape=checks.array("shape", self.shape, (None, size)))
        if self.residual is not None:
            rows = None if self.shape is None else len(self.shape)
            checks.store(self, residual=checks.array("residual", self.residual, (rows,)))
        own = size if self.shape is None else len(self.shape)
        if self.basis is not None:
            checks.store(self, basis=checked_basis(self.basis))
        if self.amplitude is not None:
            checks.store(self, amplitude=checks.array("amplitude", self.amplitude, (None, own)))
        if self.direction is not None:
            checks.store(self, direction=unit_vector("direction", self.direction))
        if self.inertia is not None:
            checks.instance("inertia", self.inertia, Inertia, "an Inertia")
        if self.inertia is not None and len(self.inertia.momentum) != size:
            raise InputError(
                f"inertia.momentum needs one row for each of {size} modes; got"
                f" {len(self.inertia.momentum)}."
            )

    def coordinates(self, q: ArrayLike, force: ArrayLike) -> Array:
        """Own coordinates (..., C) for modal ones of shape (..., J) and contact forces (...,)."""
        q = checks.array("q", q, None)
        force = checks.array("force", force, None)
        if q.ndim == 0 or q.shape[-1] != self.omega.size or force.shape not in ((), q.shape[:-1]):
            raise InputError(
                f"q must have shape (..., {self.omega.size}) and force shape (...,); got {q.shape}"
                f" and {force.shape}."
            )
        if self.shape is None:
            return q
        x = q @ self.shape.T
        if self.residual is not None:
            x = x + np.multiply.outer(force, self.residual)
        return np.asarray(x)

    def amplitudes(self, coordinates: ArrayLike) -> Array:
        """Amplitudes (..., B) of the columns of `basis` for own coordinates (..., C)."""
        x = checks.array("coordinates", coordinates, None)
        size = len(self.omega) if self.shape is None else len(self.shape)
        if x.ndim == 0 or x.shape[-1] != size:
            raise InputError(f"coordinates must have shape (..., {size}); got {x.shape}.")
        return x if self.amplitude is None else np.asarray(x @ self.amplitude.T)

    def field(self, coordinates: ArrayLike) -> Array:
        """Displacements (..., n) of the whole body for own coordinates (..., C)."""
        if self.basis is None:
            raise InputError(NO_SHAPES)
        return combined(self.basis, self.amplitudes(coordinates))

    def receptance(self, omega: ArrayLike) -> ComplexArray:
        """H(omega) = u/F [m/N], damping included."""
        w = checks.spectrum("omega", omega)[..., np.newaxis]
        loss = 0.0 if self.decay is None else 2j * self.decay * w
        return np.asarray(np.sum(self.b**2 / (self.omega**2 - w**2 + loss), axis=-1) + self.r + 0j)

    def rigid_motion(self, velocity: float | Motion) -> Array:
        """Modal velocities (J,) of a rigid-body motion.

        Parameters
        ----------
        velocity : float or Motion
            A number is the velocity of the contact point along the impact direction [m/s]. If the
            body is free in this direction, the whole body translates. If supports restrain it, or
            if `inertia` is unknown, the motion is the rigid-body motion of least kinetic energy
            with this velocity of the contact point, phi_CR of the article.

        Raises
        ------
        InputError
            For a body without such a rigid-body motion.
        """
        rigid = self.omega == 0
        if isinstance(velocity, Motion):
            return self._moving(velocity)
        velocity = checks.number("velocity", velocity, "m/s")
        if velocity == 0.0:
            return np.zeros(self.omega.size)
        if not np.any(self.b[rigid]):
            raise InputError(
                f"a velocity of {velocity:g} m/s was asked of a supported body, which has no"
                f" rigid-body motion at its contact point; use 0 or free its supports."
            )
        if self.inertia is not None and self.direction is not None:
            translation = np.concatenate((velocity * self.direction, np.zeros(3)))
            start, left = self._projected(self.inertia, translation)
            if left <= MISSED_ENERGY:
                return start
        along = np.where(rigid, self.b, 0.0)
        return np.asarray(velocity * along / np.sum(along**2))

    def _moving(self, motion: Motion) -> Array:
        if self.inertia is None:
            raise InputError(
                "the model of this body has no rigid-body inertia (the body is supported, or the "
                "model was made by hand or from matrices): give its velocity as a number, along "
                "the direction of impact."
            )
        start, left = self._projected(self.inertia, motion.at(self.inertia))
        if left > MISSED_ENERGY:
            raise InputError(
                f"the supports restrain the body: the share {left:.2g} of the kinetic energy of "
                f"{motion} lies outside the rigid-body motions that the supports permit; give a "
                "motion that they permit."
            )
        return start

    def _projected(self, inertia: Inertia, motion: Array) -> tuple[Array, float]:
        """Modal velocities of the rigid motion (6,), and its share of energy outside the modes."""
        start = np.where(self.omega == 0, inertia.momentum @ motion, 0.0)
        whole = float(motion @ inertia.matrix @ motion)
        if not np.any(motion):
            return start, 0.0
        return start, abs(1 - float(start @ start) / whole) if whole > 0 else np.inf


def combined(basis: tuple[Array, ...], amplitudes: Array) -> Array:
    """Displacements (..., n) of shapes in blocks (n, .) with amplitudes (..., B)."""
    rest = amplitudes
    total = np.zeros((*rest.shape[:-1], len(basis[0])))
    for block in basis:
        size = block.shape[1]
        total += rest[..., :size] @ block.T
        rest = rest[..., size:]
    return total


def checked_basis(basis: Any) -> tuple[Array, ...]:
    """Blocks of columns with equal numbers of rows; not copied, since they may be large."""
    blocks = tuple(basis) if isinstance(basis, tuple | list) else ()
    if not blocks or not all(isinstance(b, np.ndarray) and b.ndim == 2 for b in blocks):
        raise InputError(f"basis must list arrays of columns (n, …); got {checks.shown(basis)}.")
    if len({len(b) for b in blocks}) > 1:
        raise InputError("basis must list arrays with one number of rows.")
    return blocks


def arrow_modes(k0: float, m0: float, m: Array, poles: Array) -> tuple[Array, Array]:
    """Free modes of the anti-oscillator model, to full relative precision for any ratio of masses.

    Parameters
    ----------
    k0, m0 : stiffness [N/m] and mass [kg] of the residual system; m0 = 0 removes its mode.
    m, poles : (N,) masses > 0 [kg] and *distinct* ascending omega_i^2 > 0 [rad^2/s^2].

    Returns
    -------
    x : (J,) squared free frequencies, J = N + 1, or N if m0 = 0.
    shape : (N + 1, J) mass-normalised modes; row 0 is the site.

    Notes
    -----
    The x_j are the zeros of Z(x) = k0 - x m0 - sum_i m_i x p_i/(p_i - x), which falls from +inf
    to -inf between two neighbouring poles p_i. Each is sought as a shift from its nearest pole,
    so that p_i - x_j is never a difference of nearly equal numbers (the device of
    divide-and-conquer eigensolvers); a dense eigensolver would lose the low modes to the rounding
    of the highest as m0 -> 0.
    """
    n = poles.size
    if n == 0:
        if m0 == 0:
            return np.zeros(0), np.zeros((1, 0))
        return np.array([k0 / m0]), np.array([[1 / np.sqrt(m0)]])
    lower = np.concatenate(([0.0], poles))
    upper = poles
    if m0 > 0:
        top = (k0 + np.sum(m * poles)) / m0
        upper = np.append(poles, 2 * (max(top, poles[-1]) + np.sqrt(poles[-1] * top)))
    lower = lower[: upper.size]

    origin, shift = _zeros(k0, m0, m, poles, lower, upper)
    base = np.where(origin >= 0, poles[origin], 0.0)
    x = base + shift
    column = np.arange(x.size)
    at_pole = origin >= 0
    distance = (poles[:, None] - base) - shift
    own = np.zeros(distance.shape, dtype=bool)
    own[origin[at_pole], column[at_pole]] = True
    safe = np.where(own, 1.0, distance)
    rest = m0 + np.sum(np.where(own, 0.0, m[:, None] * (poles[:, None] / safe) ** 2), axis=0)
    heavy = np.where(at_pole, m[origin] * base**2, 0.0)
    # b^2 = -1/Z'(x), written so that a vanishing shift divides nothing
    root = np.sqrt(np.where(at_pole, shift**2 * rest + heavy, rest))
    b = np.where(at_pole, np.abs(shift), 1.0) / root
    shape = np.empty((n + 1, x.size))
    shape[0] = b
    shape[1:] = poles[:, None] * b / safe
    beside = column[at_pole]
    shape[1 + origin[beside], beside] = -np.sign(shift[beside]) * base[beside] / root[beside]
    return x, shape


def _zeros(
    k0: float, m0: float, m: Array, poles: Array, lower: Array, upper: Array
) -> tuple[Index, Array]:
    """Zeros of Z in each (lower, upper): index of the nearest pole (-1: zero) and shift from it."""
    n, size = poles.size, upper.size
    middle = 0.5 * (lower + upper)

    def stiffness(x: Array) -> Array:
        return np.asarray(
            k0 - x * m0 - x * np.sum((m * poles)[:, None] / (poles[:, None] - x), axis=0)
        )

    right = stiffness(middle) > 0
    right[n:] = False  # no pole bounds the last interval
    origin = np.where(right, np.arange(size), np.arange(size) - 1)
    at_pole = origin >= 0
    base = np.where(at_pole, poles[origin], 0.0)
    low = np.where(right, middle - upper, 0.0)
    high = np.where(right, 0.0, np.where(np.arange(size) < n, middle, upper) - lower)

    gap = poles[:, None] - base
    weight = (m * poles)[:, None] * np.ones(size)
    own = np.where(at_pole, weight[origin, np.arange(size)], 0.0)
    weight[origin[at_pole], np.arange(size)[at_pole]] = 0.0
    gap = np.where(weight == 0.0, np.inf, gap)  # the nearest pole is treated apart

    shift = 0.5 * (low + high)
    seed = np.zeros(size)
    for sweep in range(200):
        trial = seed if sweep == 0 else shift
        x = base + trial
        distance = gap - trial
        ratio = weight / distance
        rest = k0 - x * m0 - x * ratio.sum(axis=0)
        slope = -m0 - np.sum(ratio / distance * poles[:, None], axis=0)
        # g = shift * Z has no pole at shift = 0; beside no pole (first interval) g = Z
        g = np.where(at_pole, trial * rest + own * x, rest)
        g_slope = np.where(at_pole, rest + trial * slope + own, slope)
        if sweep > 0:
            falling = np.where(at_pole & (trial < 0), -g, g)  # has the sign of Z
            low = np.where(falling > 0, trial, low)
            high = np.where(falling > 0, high, trial)
        with np.errstate(divide="ignore", invalid="ignore"):
            step = trial - g / g_slope
        inside = (step > low) & (step < high)
        new = np.where(inside, step, 0.5 * (low + high))
        done = np.abs(new - trial) <= 4e-16 * np.abs(new)
        done |= (sweep > 0) & (g == 0)
        done[0] |= k0 == 0  # that zero is x = 0 itself
        shift = np.where((sweep > 0) & (g == 0), trial, new)
        if np.all(done):
            break
    unsettled = ~done & (np.abs(new - trial) > 1e-12 * np.abs(new))
    if np.any(unsettled):
        raise NotConvergedError(
            f"{int(unsettled.sum())} of {size} free frequencies have not converged after 200 "
            "steps; masses or frequencies differ too much for double precision."
        )
    if k0 == 0:
        origin[0], shift[0] = -1, 0.0
    return origin, shift
