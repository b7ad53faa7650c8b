"""Exact motion of uncoupled damped oscillators, rigid-body modes included.

For q'' + 2 d q' + omega^2 q = f the response is built from the impulse response S(t), with S(0) = 0
and S'(0) = 1, its integral J (response to a unit step) and the integral R of J (unit ramp). The
formulas are free of cancellation for small and large omega t and d t.
"""

from __future__ import annotations

from math import factorial
from typing import NamedTuple

import numpy as np

from antiosc._types import Array

# R/t^3 as a power series in (omega t)^2: (-1)^k/(2 k + 3)!
_RAMP = tuple((-1) ** k / factorial(2 * k + 3) for k in range(6))


class Motion(NamedTuple):
    """q = P q0 + S v0 + J f, v = -omega^2 S q0 + W v0 + S f; each of shape (..., J)."""

    P: Array
    S: Array
    W: Array


class Responses(NamedTuple):
    """The free motion and the responses J to a unit force and R to a force that grows as t."""

    P: Array
    S: Array
    W: Array
    J: Array
    R: Array


class Propagator:
    """Closed-form responses of the modes (omega, decay), each of shape (J,)."""

    def __init__(self, omega: Array, decay: Array) -> None:
        self.omega = omega
        self.square = omega**2
        self.decay = decay
        self.damped = bool(np.any(decay))
        self.rigid = (omega == 0).astype(float)
        self.inverse = (1 - self.rigid) / np.where(omega == 0, 1.0, omega)
        if self.damped:
            excess = (decay - omega) * (decay + omega)
            self.over = excess > 0
            self.gamma = np.sqrt(np.abs(excess))
            # real roots far enough apart for partial fractions
            self.split = excess > decay**2 / 4

    def motion(self, t: Array | float) -> Motion:
        """Free motion after times `t` [s] of any shape."""
        t = np.asarray(t, dtype=float)[..., np.newaxis]
        if not self.damped:
            z = self.omega * t
            P = np.cos(z)
            return Motion(P, np.sin(z) * self.inverse + t * self.rigid, P)
        C, S = self._decaying(t)
        return Motion(C + self.decay * S, S, C - self.decay * S)

    def weighted(self, t: Array | float, a: Array, b: Array) -> Array:
        """sum_j (a_j P_j + b_j S_j) after times `t` [s], of the shape of `t`."""
        if self.damped:
            P, S, _ = self.motion(t)
            return np.asarray(P @ a + S @ b)
        z = np.multiply.outer(t, self.omega)
        drift = float(b @ self.rigid)
        return np.asarray(np.cos(z) @ a + np.sin(z) @ (b * self.inverse) + np.multiply(t, drift))

    def step(self, t: Array | float) -> Array:
        """J(t) [s^2], the displacement under a unit modal force since 0."""
        time = np.asarray(t, dtype=float)[..., np.newaxis]
        if not self.damped:
            S = np.sin(0.5 * self.omega * time) * self.inverse + 0.5 * time * self.rigid
            return np.asarray(2 * S * S)
        return self._damped_step_and_ramp(time)[0]

    def step_and_ramp(self, t: Array | float) -> tuple[Array, Array]:
        """J(t) and R(t) [s^3], the displacement under a modal force that grows as t."""
        responses = self.responses(t)
        return responses.J, responses.R

    def responses(self, t: Array | float) -> Responses:
        """All responses after times `t` [s] of any shape."""
        time = np.asarray(t, dtype=float)[..., np.newaxis]
        if self.damped:
            return Responses(*self.motion(t), *self._damped_step_and_ramp(time))
        z = self.omega * time
        sine, cosine = np.sin(0.5 * z), np.cos(0.5 * z)
        double = 2 * sine * self.inverse + time * self.rigid
        P, S, J = cosine * cosine - sine * sine, cosine * double, 0.5 * double * double
        y = z * z
        series = _RAMP[-1]
        for coefficient in _RAMP[-2::-1]:
            series = coefficient + y * series
        R = np.where(z < 0.5, time**3 * series, (time - S) * self.inverse**2)
        return Responses(P, S, P, J, R)

    def _decaying(self, t: Array) -> tuple[Array, Array]:
        """C and S with S = exp(-d t) sin(g t)/g and C = exp(-d t) cos(g t), or sinh and cosh."""
        d, g = self.decay, self.gamma
        fade = np.exp(-d * t)
        S = fade * t * _sinc(g * t)
        C = fade * np.cos(g * t)
        # the slow root is -omega^2/(d + g): no difference of large numbers
        slow = np.exp(-self.square * t / np.where(self.over, d + g, 1.0))
        fast = np.expm1(-2 * np.where(self.over, g, 0.0) * t)
        g_safe = np.where(self.over & (g > 0), g, 1.0)
        S = np.where(self.over, np.where(g > 0, -slow * fast / (2 * g_safe), slow * t), S)
        C = np.where(self.over, slow * (1 + 0.5 * fast), C)
        return C, S

    def _damped_step_and_ramp(self, t: Array) -> tuple[Array, Array]:
        d, x = self.decay, self.square
        C, S = self._decaying(t)
        small = np.maximum(self.omega * t, 2 * d * t) < 0.5
        safe_x = np.where(x > 0, x, 1.0)
        J = (1 - C - d * S) / safe_x
        R = (t - S - 2 * d * J) / safe_x
        if np.any(self.split):
            slow = -x / np.where(self.split, d + self.gamma, 1.0)
            fast = -np.where(self.split, d + self.gamma, 1.0)
            width = np.where(self.split, 2 * self.gamma, 1.0)
            J = np.where(self.split, t * (_phi1(slow * t) - _phi1(fast * t)) / width, J)
            R = np.where(self.split, t**2 * (_phi2(slow * t) - _phi2(fast * t)) / width, R)
        if np.any(small):
            J_series, R_series = self._series(np.where(small, t, 0.0))
            J, R = np.where(small, J_series, J), np.where(small, R_series, R)
        return J, R

    def _series(self, t: Array) -> tuple[Array, Array]:
        """Power series of J and R from the recurrence of the differential equation."""
        a, b = np.zeros_like(t), np.ones_like(t)  # coefficients of S, scaled by t^k
        J, R = 0.5 * b, b / 6
        for k in range(22):
            a, b = (
                b,
                -(2 * self.decay * t * (k + 1) * b + (self.omega * t) ** 2 * a)
                / ((k + 1) * (k + 2)),
            )
            if np.abs(b).max() < 1e-20:
                break
            J = J + b / (k + 3)
            R = R + b / ((k + 3) * (k + 4))
        return J * t**2, R * t**3


def _sinc(z: Array) -> Array:
    safe = np.where(z == 0, 1e-20, z)
    return np.asarray(np.sin(safe) / safe)


def _phi1(z: Array) -> Array:
    """(exp z - 1)/z."""
    safe = np.where(z == 0, 1.0, z)
    return np.where(z == 0, 1.0, np.expm1(safe) / safe)


def _phi2(z: Array) -> Array:
    """(exp z - 1 - z)/z^2."""
    near = np.abs(z) < 0.5
    safe = np.where(near, 1.0, z)
    series, term = np.full_like(z, 0.5), np.full_like(z, 0.5)
    zn = np.where(near, z, 0.0)
    for k in range(3, 18):
        term = term * zn / k
        series = series + term
    return np.where(near, series, (np.expm1(safe) - safe) / safe**2)
