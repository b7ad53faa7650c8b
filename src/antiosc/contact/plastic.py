"""Laws with a permanent indentation: loading, unloading and reloading follow different curves.

All have one form. Virgin loading follows F_l(delta). Unloading from a turning point (delta_t, F_t)
falls to the permanent indentation delta_p of the deepest indentation delta_m so far,

    F = F_t U((delta - delta_p)/(delta_t - delta_p)),

and reloading, up to (delta_m, F_m), climbs F = F_m V((delta - delta_p)/(delta_m - delta_p)). Where
U = V reloading goes back along the unloading curve. Once the bodies have parted, the next contact
reloads from delta_p.
"""

from __future__ import annotations

from abc import abstractmethod
from dataclasses import dataclass
from math import log, pi, sqrt
from typing import ClassVar

from antiosc import checks
from antiosc.contact.base import ContactLaw, State
from antiosc.errors import InputError


class Hysteretic(ContactLaw):
    """Base of the laws of this module; U(x) = x^unload_exponent, V(x) = x^reload_exponent.

    The state is (delta_m, delta_t, lost): deepest indentation [m], turning point [m] from which
    unloading starts, and the energy lost so far [J].
    """

    has_memory: ClassVar[bool] = True
    unload_exponent: ClassVar[float] = 1.5
    reload_exponent: ClassVar[float] = 1.5
    #: reloading goes back along the unloading curve
    retraces: ClassVar[bool] = True

    @abstractmethod
    def loading(self, delta: float) -> float:
        """Virgin force [N] for delta > 0."""

    @abstractmethod
    def loading_slope(self, delta: float) -> float:
        """Its derivative [N/m]."""

    @abstractmethod
    def loading_work(self, delta: float) -> float:
        """Its integral from 0 [J]."""

    @abstractmethod
    def permanent(self, deepest: float) -> float:
        """Permanent indentation delta_p [m] after a deepest one, 0 <= delta_p < deepest."""

    # U and V with derivative and integral from 0: (value, slope, integral)
    def unload_shape(self, x: float) -> tuple[float, float, float]:
        return _power(x, self.unload_exponent)

    def reload_shape(self, x: float) -> tuple[float, float, float]:
        return _power(x, self.reload_exponent)

    # -- the contract

    def touch(self, speed: float, state: State | None = None) -> State:
        if state is None:
            return (0.0, 0.0, 0.0)
        turn = state[0] if self.retraces else self.permanent(state[0])
        return (state[0], turn, state[2])

    def origin(self, state: State) -> float:
        return self.permanent(state[0])

    def lost(self, state: State) -> float:
        return state[2]

    def force(self, delta: float, rate: float, state: State) -> float:
        return self._curve(delta, state)[0]

    def tangent(self, delta: float, rate: float, state: State) -> tuple[float, float]:
        return (self._curve(delta, state)[1], 0.0)

    def energy(self, delta: float, state: State) -> float:
        deepest, turn, _ = state
        low = self.permanent(deepest)
        if delta <= low:
            return 0.0
        if delta >= turn:
            top = self._curve(delta, state)[0]
            low = self.permanent(max(delta, deepest))
            return top * (delta - low) * self.unload_shape(1.0)[2]
        top = self._curve(turn, state)[0]
        return top * (turn - low) * self.unload_shape((delta - low) / (turn - low))[2]

    def advance(self, delta: float, rate: float, state: State) -> State:
        deepest, turn, lost = state
        if delta <= turn:
            return state
        work = self._work(delta, state) - self._work(turn, state)
        before = self.energy(turn, state)
        new = (max(deepest, delta), delta, lost)
        return (new[0], delta, lost + work - (self.energy(delta, new) - before))

    # -- inside

    def _curve(self, delta: float, state: State) -> tuple[float, float]:
        """Force and slope."""
        deepest, turn, _ = state
        if delta >= deepest:
            return (self.loading(delta), self.loading_slope(delta)) if delta > 0 else (0.0, 0.0)
        low = self.permanent(deepest)
        if delta <= low:
            return (0.0, 0.0)
        if delta >= turn:
            return self._reload(delta, deepest, low)
        top = self.loading(deepest) if turn == deepest else self._reload(turn, deepest, low)[0]
        value, slope, _ = self.unload_shape((delta - low) / (turn - low))
        return (top * value, top * slope / (turn - low))

    def _reload(self, delta: float, deepest: float, low: float) -> tuple[float, float]:
        top = self.loading(deepest)
        value, slope, _ = self.reload_shape((delta - low) / (deepest - low))
        return (top * value, top * slope / (deepest - low))

    def _work(self, delta: float, state: State) -> float:
        """Work along reloading and virgin loading up to delta >= delta_t, from a fixed origin."""
        deepest = state[0]
        if deepest == 0.0:
            return self.loading_work(delta)
        low = self.permanent(deepest)
        share = (min(delta, deepest) - low) / (deepest - low)
        work = self.loading(deepest) * (deepest - low) * self.reload_shape(share)[2]
        if delta > deepest:
            work += self.loading_work(delta) - self.loading_work(deepest)
        return work


def _power(x: float, n: float) -> tuple[float, float, float]:
    if x <= 0.0:
        return (0.0, 0.0, 0.0)
    value = x**n
    return (value, n * value / x, value * x / (n + 1))


@dataclass(frozen=True)
class Thornton(Hysteretic):
    """Elastic, perfectly plastic sphere. C. Thornton, J. Appl. Mech. 64 (1997) 383-386.

    Hertz's law up to the yield indentation; beyond, the pressure is cut off and the force goes on
    along the tangent; unloading is Hertzian with the flattened radius R F_e/F_m, F_e being Hertz's
    force at the deepest indentation, so that delta_p = delta_m (1 - F_m/F_e).

    Parameters
    ----------
    stiffness : float
        Hertz's k_H [N m^-3/2].
    yield_indentation : float
        delta_y [m] at first yield.
    """

    stiffness: float
    yield_indentation: float

    def __post_init__(self) -> None:
        checks.store(
            self,
            stiffness=checks.positive("stiffness", self.stiffness, "N m^-3/2"),
            yield_indentation=checks.positive("yield_indentation", self.yield_indentation, "m"),
        )

    @classmethod
    @checks.within_range
    def from_material(cls, E_star: float, radius: float, yield_pressure: float) -> Thornton:
        """From E* [Pa], relative radius [m] and contact pressure at yield p_y [Pa] (1.6 Y).

        delta_y = R (pi p_y/(2 E*))^2.
        """
        E = checks.positive("E_star", E_star, "Pa")
        R = checks.positive("radius", radius, "m")
        p = checks.positive("yield_pressure", yield_pressure, "Pa")
        return cls(4 / 3 * E * sqrt(R), R * (pi * p / (2 * E)) ** 2)

    def loading(self, delta: float) -> float:
        y = self.yield_indentation
        if delta <= y:
            return self.stiffness * delta * sqrt(delta)
        return self.stiffness * sqrt(y) * (1.5 * delta - 0.5 * y)

    def loading_slope(self, delta: float) -> float:
        return 1.5 * self.stiffness * sqrt(min(delta, self.yield_indentation))

    def loading_work(self, delta: float) -> float:
        y = self.yield_indentation
        elastic = 0.4 * self.stiffness * min(delta, y) ** 2.5
        if delta <= y:
            return elastic
        return elastic + self.stiffness * sqrt(y) * (delta - y) * (0.75 * (delta + y) - 0.5 * y)

    def permanent(self, deepest: float) -> float:
        y = self.yield_indentation
        if deepest <= y:
            return 0.0
        # 1 - F_m/F_e with x = sqrt(y/delta_m): (1 - x)^2 (2 + x)/2 > 0 without cancellation
        x = sqrt(y / deepest)
        return deepest * (1 - x) ** 2 * (2 + x) / 2


@dataclass(frozen=True)
class Stronge(Hysteretic):
    """Elastic-plastic sphere. W. J. Stronge, Impact Mechanics, Cambridge 2000, ch. 6.

    Hertz up to yield at delta_y; then F/F_y = (2 x - 1)(1 + ln(2 x - 1)/3.3) with
    x = delta/delta_y, and the mean pressure stays 2.55 times that at yield from x = 84 on.
    Unloading is Hertzian from delta_m to delta_p = delta_m - delta_y sqrt(2 x_m - 1). Taken as
    printed, that would give back more than was put in for x_m < 1.9; there delta_p is the one
    without loss.

    Parameters
    ----------
    stiffness : float
        Hertz's k_H [N m^-3/2].
    yield_indentation : float
        delta_y [m] at first yield.
    """

    stiffness: float
    yield_indentation: float

    FULLY_PLASTIC: ClassVar[float] = 84.0
    PRESSURE: ClassVar[float] = 3.3  # 3 times p_y/Y = 1.1 at yield

    def __post_init__(self) -> None:
        checks.store(
            self,
            stiffness=checks.positive("stiffness", self.stiffness, "N m^-3/2"),
            yield_indentation=checks.positive("yield_indentation", self.yield_indentation, "m"),
        )

    def _yield_force(self) -> float:
        return float(self.stiffness * self.yield_indentation**1.5)

    def loading(self, delta: float) -> float:
        x = delta / self.yield_indentation
        if x <= 1:
            return self.stiffness * delta * sqrt(delta)
        area = 2 * x - 1
        return self._yield_force() * area * (1 + log(min(area, self._full())) / self.PRESSURE)

    def loading_slope(self, delta: float) -> float:
        x = delta / self.yield_indentation
        if x <= 1:
            return 1.5 * self.stiffness * sqrt(delta)
        area = 2 * x - 1
        growth = 1 + log(min(area, self._full())) / self.PRESSURE
        if x < self.FULLY_PLASTIC:
            growth += 1 / self.PRESSURE
        return 2 * self._yield_force() / self.yield_indentation * growth

    def loading_work(self, delta: float) -> float:
        y = self.yield_indentation
        x = delta / y
        elastic = 0.4 * self.stiffness * min(delta, y) ** 2.5
        if x <= 1:
            return elastic
        s, full = 2 * x - 1, self._full()
        a = min(s, full)
        # integral of s (1 + ln s/P) ds/2 from 1 to a
        work = (a * a - 1) / 4 + (a * a * (2 * log(a) - 1) + 1) / (8 * self.PRESSURE)
        if s > full:
            work += (s * s - full * full) / 4 * (1 + log(full) / self.PRESSURE)
        return elastic + self._yield_force() * y * work

    def permanent(self, deepest: float) -> float:
        x = deepest / self.yield_indentation
        if x <= 1:
            return 0.0
        # x - sqrt(2x - 1) = (x - 1)^2/(x + sqrt(2x - 1))
        printed = self.yield_indentation * (x - 1) ** 2 / (x + sqrt(2 * x - 1))
        lossless = deepest - 2.5 * self.loading_work(deepest) / self.loading(deepest)
        return max(printed, lossless)

    def _full(self) -> float:
        return 2 * self.FULLY_PLASTIC - 1


@dataclass(frozen=True)
class _Laminate(Hysteretic):
    """F = k delta^1.5 on loading and reloading, unloading with the power 2.5."""

    stiffness: float
    critical: float

    unload_exponent: ClassVar[float] = 2.5
    retraces: ClassVar[bool] = False

    def __post_init__(self) -> None:
        checks.store(
            self,
            stiffness=checks.positive("stiffness", self.stiffness, "N m^-3/2"),
            critical=checks.positive("critical", self.critical, "m"),
        )

    def loading(self, delta: float) -> float:
        return self.stiffness * delta * sqrt(delta)

    def loading_slope(self, delta: float) -> float:
        return 1.5 * self.stiffness * sqrt(delta)

    def loading_work(self, delta: float) -> float:
        return 0.4 * self.stiffness * delta * delta * sqrt(delta)


@dataclass(frozen=True)
class YangSun(_Laminate):
    """Indentation of laminates. S. H. Yang, C. T. Sun, ASTM STP 787 (1982) 425-449.

    delta_p = delta_m [1 - (critical/delta_m)^(2/5)] beyond the critical indentation [m], else 0.
    `stiffness` in N m^-3/2.
    """

    def permanent(self, deepest: float) -> float:
        if deepest <= self.critical:
            return 0.0
        return float(deepest * (1 - (self.critical / deepest) ** 0.4))


@dataclass(frozen=True)
class TanSun(_Laminate):
    """Indentation of laminates. T. M. Tan, C. T. Sun, J. Appl. Mech. 52 (1985) 6-12.

    delta_p = slope * (delta_m - critical) beyond the critical indentation [m], else 0, with
    0 < slope < 1. `stiffness` in N m^-3/2.
    """

    slope: float = 0.5

    def __post_init__(self) -> None:
        super().__post_init__()
        slope = checks.number("slope", self.slope)
        if not 0 < slope < 1:
            raise InputError(f"slope must lie in 0 < slope < 1; got {slope:g}.")
        checks.store(self, slope=slope)

    def permanent(self, deepest: float) -> float:
        return self.slope * max(deepest - self.critical, 0.0)
