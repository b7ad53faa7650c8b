"""Free flight: find the next touch without missing a grazing contact."""

from __future__ import annotations

import numpy as np

from antiosc._types import Array
from antiosc.simulation.integrators.problem import Problem
from antiosc.simulation.integrators.root import rising_root

_PIECES = 128
_GRID = np.arange(_PIECES + 1) / _PIECES


def next_touch(
    problem: Problem, q: Array, v: Array, origin: float, span: float, fine: float
) -> float | None:
    """Time [s] until the indentation first rises above `origin`, or None within `span`.

    On an interval of length L, delta is at most the larger of its end values plus the interpolation
    error bound sum_j |beta_j| A_j min(2, curvature_j L^2/8) of the chord (A_j: amplitude of the
    free motion). If this sum is negative, the interval contains no touch; otherwise it is divided,
    in order of time, until the bound is below the resolution. A sign change is accepted if the
    interval is shorter than `fine`.
    """
    search = _Search(problem, q, v, origin)
    now, speed = problem.approach(q) - origin, float(problem.beta @ v)
    if now >= 0.0 and speed > 0.0:
        return 0.0
    start, wait = min(now, 0.0), 0.0  # parted a moment ago: no touch by rounding
    if speed < 0.0:
        # receding from `start`: delta <= speed t + bound t^2/2 excludes a touch for some time
        bound = float(search.amplitude @ search.curvature) + search.bend
        wait = min(-speed / bound, span) if bound > 0.0 else span
    stack = [(wait, span)] if wait < span else []
    while stack:
        a, b = stack.pop()
        times, length = a + (b - a) * _GRID, (b - a) / _PIECES
        delta = search.delta(times)
        if a == 0.0:
            delta[0] = start
        missed = search.missed(length)
        # a touch shorter than fine/16 is below the integrator's step
        clear = 0.0 if length <= fine / 16 else min(problem.resolution - missed, 0.0)
        suspects = np.flatnonzero(np.maximum(delta[:-1], delta[1:]) > clear)
        if suspects.size == 0:
            continue
        first = int(suspects[0])
        left, right = float(times[first]), float(times[first + 1])
        at_left, at_right = float(delta[first]), float(delta[first + 1])
        if at_left > 0.0:
            return left
        if at_right > 0.0 and (length <= fine or missed <= problem.resolution):
            chord = left + (right - left) * at_left / (at_left - at_right)
            return rising_root(search.motion, left, right, chord) if at_left < 0.0 else left
        stack.extend((float(times[i]), float(times[i + 1])) for i in suspects[::-1])
    return None


class _Search:
    """delta(t) - origin of the free motion from one state, and the error bound of its chord."""

    def __init__(self, problem: Problem, q: Array, v: Array, origin: float) -> None:
        self.problem, self.q, self.v, self.origin = problem, q, v, origin
        prop, size = problem.propagator, np.abs(problem.beta)
        rest = problem.load * prop.inverse**2
        swing = np.hypot(q - rest, v * prop.inverse)
        self.amplitude = (1 - prop.rigid) * size * swing
        self.curvature = prop.square + 2 * prop.decay * prop.omega
        bend = np.abs(problem.load) + 2 * prop.decay * np.abs(v)
        self.bend = float((prop.rigid * size) @ bend)

    def delta(self, t: Array) -> Array:
        return self.problem.indentation(self.q, self.v, t) - self.origin

    def motion(self, t: float) -> tuple[float, float]:
        """delta and its rate."""
        q, v = self.problem.free(self.q, self.v, t)
        return self.problem.approach(q) - self.origin, float(self.problem.beta @ v)

    def missed(self, length: float) -> float:
        chord = np.minimum(2.0, self.curvature * (length**2 / 8))
        return float(self.amplitude @ chord) + self.bend * length**2 / 8
