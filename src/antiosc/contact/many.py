"""Laws of the power type for arrays of scenes: one implicit force equation a row.

The results are those of `antiosc.contact.power` to rounding.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable
from typing import Any

import numpy as np

from antiosc._types import Array, Index
from antiosc.contact.power import Hertz, Linear, Power


class Laws(ABC):
    """Solves F = law(delta - alpha F) for all rows; `take` drops rows."""

    def take(self, keep: Index) -> None:
        for name, value in vars(self).items():
            if isinstance(value, np.ndarray):
                setattr(self, name, value[keep])

    @abstractmethod
    def force(self, delta: Array, alpha: Array, guess: Array) -> Array:
        """The force [N], 0 where delta <= 0; `guess` is the force before."""


class _Linear(Laws):
    def __init__(self, laws: list[Any]) -> None:
        self.k = np.array([law.stiffness for law in laws])

    def force(self, delta: Array, alpha: Array, guess: Array) -> Array:
        return self.k * np.maximum(delta, 0.0) / (1 + self.k * alpha)


class _Hertz(Laws):
    def __init__(self, laws: list[Any]) -> None:
        self.a = np.array([law.stiffness for law in laws]) ** (-2 / 3)
        self.c = np.array([law.compliance for law in laws])
        self.end = np.cbrt([law.valid_force for law in laws])
        self.slope = np.array([law._end_slope for law in laws])
        self.bounded = bool(np.any(self.c > 0))

    def force(self, delta: Array, alpha: Array, guess: Array) -> Array:
        """Newton on a s^2 + (alpha - c) s^3 = delta, s = F^(1/3), as `Hertz.implicit`."""
        a, cubic = self.a, alpha - self.c
        if not self.bounded and guess.min() > 0 and delta.min() > 0 and cubic.min() > 0:
            s = self._newton(np.cbrt(guess), delta, cubic)
            return s * s * s
        touching = delta > 0
        d = np.where(touching, delta, a + cubic)  # s = 1 solves the rows that do not touch
        warm = touching & (guess > 0) & (cubic > 0)
        s = np.ones_like(d)
        cold = touching & ~warm
        if cold.any():
            start = np.sqrt(d[cold] / a[cold])
            positive = cubic[cold] > 0
            limit = np.cbrt(d[cold] / np.where(positive, cubic[cold], 1.0))
            s[cold] = np.where(positive, np.minimum(start, limit), start)
        s[warm] = np.cbrt(guess[warm])
        top = np.where(touching, self.end, 1.0) if self.bounded else None
        s = self._newton(s, d, cubic, top)
        force = np.where(touching, s * s * s, 0.0)
        return self._beyond(force, delta, alpha, cubic) if self.bounded else force

    def _newton(self, s: Array, d: Array, cubic: Array, top: Array | None = None) -> Array:
        a, a2 = self.a, 2 * self.a
        for _ in range(100):
            bend = cubic * s
            step = ((a + bend) * s * s - d) / ((a2 + 3 * bend) * s)
            s = s - step
            if top is not None:
                s = np.minimum(s, top)
            if (np.abs(step) <= 1e-8 * s).all():  # the error left is the square of that
                break
        return s

    def _beyond(self, force: Array, delta: Array, alpha: Array, cubic: Array) -> Array:
        limited = np.isfinite(self.end)
        e = np.where(limited, self.end, 1.0)
        reach = (self.a + cubic * e) * e * e
        line = e**3 + (delta - reach) / (self.slope + alpha + ~limited)
        return np.where(limited & (delta >= reach), line, force)


class _Power(Laws):
    def __init__(self, laws: list[Any]) -> None:
        self.k = np.array([law.stiffness for law in laws])
        self.n = np.array([law.exponent for law in laws])

    def force(self, delta: Array, alpha: Array, guess: Array) -> Array:
        """Newton on x + alpha k x^n = delta: convex, so that it falls to the root from above."""
        touching = delta > 0
        d = np.where(touching, delta, 1.0)
        with np.errstate(divide="ignore"):
            x = np.minimum(d, (d / (alpha * self.k)) ** (1 / self.n))
        for _ in range(100):
            F = self.k * x**self.n
            step = (x + alpha * F - d) / (1 + alpha * self.n * F / x)
            x = x - step
            if (np.abs(step) <= 1e-8 * x).all():
                break
        return np.where(touching, self.k * x**self.n, 0.0)


#: the laws that are vectorised, by their class
VECTORISED: dict[type, Callable[[list[Any]], Laws]] = {
    Linear: _Linear,
    Hertz: _Hertz,
    Power: _Power,
}
