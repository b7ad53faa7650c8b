"""Contact laws as functions of indentation and rate.

`par` are the parameters of a law, as `antiosc.simulation.laws` packs them, `s` what the contact
remembers.
"""

from __future__ import annotations

from math import exp, inf, log, sqrt
from typing import Any

import numpy as np

from .compiling import COMPILED, compiled
from .layout import (
    APART,
    BACK,
    CUT,
    DAMPED,
    F1,
    FORWARD,
    HERTZ,
    LINEAR,
    LOW,
    POWER,
    SLOW,
    STRONGE,
    TABLE,
    TAN_SUN,
    THORNTON,
    USER,
    YANG_SUN,
)

FULLY_PLASTIC, PRESSURE = 84.0, 3.3  # Stronge's law
SLOWEST = 0.01  # share of the fastest approach that a damped law's speed of approach is held above

# the user's own laws by their number: only the interpreted march calls them
LAWS: dict[int, Any] = {}


@compiled(f"UniTuple(float64, 2)({F1}, int64, int64, float64)")
def table_at(par: Any, first: int, count: int, x: float) -> Any:
    """Value and slope of the packed monotone cubic, a straight line beyond its last knot.

    Rows of `count` knots from par[first]: x, then a, b, c, e of each interval, then value and slope
    at the end.
    """
    last = first + count - 1
    if x <= par[first]:
        return 0.0, 0.0
    if x >= par[last]:
        end = first + 5 * count
        return par[end] + par[end + 1] * (x - par[last]), par[end + 1]
    low, high = first, last
    while high - low > 1:
        middle = (low + high) // 2
        if par[middle] <= x:
            low = middle
        else:
            high = middle
    d = x - par[low]
    a, b = par[low + count], par[low + 2 * count]
    c, e = par[low + 3 * count], par[low + 4 * count]
    return ((a * d + b) * d + c) * d + e, (3 * a * d + 2 * b) * d + c


@compiled(f"UniTuple(float64, 2)(int64, float64, {F1})")
def loading(kind: int, delta: float, par: Any) -> Any:
    """Virgin force and its slope of a law with memory."""
    if delta <= 0.0:
        return 0.0, 0.0
    k = par[0]
    if kind == THORNTON:
        y = par[1]
        if delta <= y:
            return k * delta * sqrt(delta), 1.5 * k * sqrt(delta)
        return k * sqrt(y) * (1.5 * delta - 0.5 * y), 1.5 * k * sqrt(y)
    if kind == STRONGE:
        y = par[1]
        x = delta / y
        if x <= 1.0:
            return k * delta * sqrt(delta), 1.5 * k * sqrt(delta)
        area = 2.0 * x - 1.0
        growth = 1.0 + log(min(area, 2.0 * FULLY_PLASTIC - 1.0)) / PRESSURE
        top = k * y * sqrt(y)
        force = top * area * growth
        if x < FULLY_PLASTIC:
            growth += 1.0 / PRESSURE
        return force, 2.0 * top / y * growth
    if kind == TABLE:
        return table_at(par, 5, int(par[2]), delta)
    return k * delta * sqrt(delta), 1.5 * k * sqrt(delta)


@compiled(f"float64(int64, float64, {F1})")
def permanent(kind: int, deepest: float, par: Any) -> float:
    """Permanent indentation after a deepest one."""
    if kind == THORNTON:
        y = par[1]
        if deepest <= y:
            return 0.0
        x = sqrt(y / deepest)
        return deepest * (1.0 - x) ** 2 * (2.0 + x) / 2.0
    if kind == STRONGE:
        y = par[1]
        x = deepest / y
        if x <= 1.0:
            return 0.0
        printed = y * (x - 1.0) ** 2 / (x + sqrt(2.0 * x - 1.0))
        # what gives back no more than was put in
        s, full = 2.0 * x - 1.0, 2.0 * FULLY_PLASTIC - 1.0
        a = min(s, full)
        work = (a * a - 1.0) / 4 + (a * a * (2 * log(a) - 1.0) + 1.0) / (8 * PRESSURE)
        if s > full:
            work += (s * s - full * full) / 4 * (1.0 + log(full) / PRESSURE)
        top = par[0] * y * sqrt(y)
        work = 0.4 * top * y + top * y * work
        return max(printed, deepest - 2.5 * work / loading(kind, deepest, par)[0])
    if kind == YANG_SUN:
        if deepest <= par[1]:
            return 0.0
        return deepest * (1.0 - exp(0.4 * log(par[1] / deepest)))
    if kind == TAN_SUN:
        return par[2] * max(deepest - par[1], 0.0)
    return par[1] * deepest  # TABLE


@compiled(f"UniTuple(float64, 2)(int64, float64, boolean, {F1})")
def shape(kind: int, x: float, back: bool, par: Any) -> Any:
    """Unloading (`back`) or reloading curve from (0, 0) to (1, 1), and its slope."""
    if x <= 0.0:
        return 0.0, 0.0
    if kind == TABLE:
        return table_at(par, int(par[4]), int(par[3]), x)
    root = sqrt(x)
    if back and (kind in (YANG_SUN, TAN_SUN)):
        return x * x * root, 2.5 * x * root
    return x * root, 1.5 * root


@compiled(f"UniTuple(float64, 2)(int64, int64, float64, {F1}, {F1})")
def hysteretic(kind: int, mode: int, delta: float, par: Any, s: Any) -> Any:
    """Force and slope of a law with memory; s = (deepest, turning point)."""
    deepest, turn = s[0], s[1]
    if mode == FORWARD and delta >= deepest:
        return loading(kind, delta, par)
    low = permanent(kind, deepest, par)
    if delta <= low or deepest <= 0.0:
        return 0.0, 0.0
    top, from_here = loading(kind, deepest, par)[0], deepest
    if mode == FORWARD:
        value, slope = shape(kind, (delta - low) / (deepest - low), False, par)
        return top * value, top * slope / (deepest - low)
    if turn <= low:
        return 0.0, 0.0
    if turn < deepest:
        top *= shape(kind, (turn - low) / (deepest - low), False, par)[0]
        from_here = turn
    value, slope = shape(kind, (delta - low) / (from_here - low), True, par)
    return top * value, top * slope / (from_here - low)


def user_curve(mode: int, delta: float, rate: float, par: Any, s: Any) -> Any:
    """Force and its slopes of a law that is not one of ours."""
    law = LAWS[int(par[0])]
    state = tuple(s[: int(par[1])])
    force = law.force(delta, rate, state)
    by_delta, by_rate = law.tangent(delta, rate, state)
    return force, by_delta, by_rate


@compiled(f"UniTuple(float64, 3)(int64, int64, float64, float64, {F1}, {F1})")
def curve(kind: int, mode: int, delta: float, rate: float, par: Any, s: Any) -> Any:
    """Force of a piece and its slopes by indentation and rate; a linear law goes on below 0."""
    if mode in (APART, CUT):
        return 0.0, 0.0, 0.0
    if kind == LINEAR:
        return par[0] * delta, par[0], 0.0
    if kind == USER:
        if COMPILED:
            return 0.0, 0.0, 0.0
        return user_curve(mode, delta, rate, par, s)
    if kind >= THORNTON:
        force, slope = hysteretic(kind, mode, delta, par, s)
        return force, slope, 0.0
    if delta <= 0.0:
        return 0.0, 0.0, 0.0
    if kind == HERTZ:
        k, c = par[0], par[1]
        if c == 0.0:
            root = sqrt(delta)
            return k * delta * root, 1.5 * k * root, 0.0
        a, end = par[2], par[3]  # delta = a s^2 - c s^3 up to s = end, a straight line beyond
        reach = (a - c * end) * end * end
        if delta >= reach:
            return end * end * end + (delta - reach) / par[4], 1.0 / par[4], 0.0
        root = sqrt(delta / a)
        for _ in range(50):
            step = ((a - c * root) * root * root - delta) / ((2.0 * a - 3.0 * c * root) * root)
            root = min(root - step, end)
            if abs(step) <= 1e-9 * root:
                break
        return root * root * root, 1.0 / ((2.0 / 3.0) * a / root - c), 0.0
    n = par[1]
    if n == 1.5:
        elastic = par[0] * delta * sqrt(delta)
    elif n == 1.0:
        elastic = par[0] * delta
    else:
        elastic = par[0] * np.exp(n * log(delta))
    if kind == POWER:
        return elastic, n * elastic / delta, 0.0
    grip = 1.0 + s[0] * rate
    return elastic * grip, n * elastic / delta * grip, elastic * s[0]


@compiled(f"UniTuple(float64, 4)(int64, int64, {F1}, {F1})")
def piece(kind: int, mode: int, par: Any, s: Any) -> Any:
    """Bounds of the piece: least and largest indentation, least and largest rate."""
    origin = 0.0
    if THORNTON <= kind <= TABLE:
        origin = permanent(kind, s[0], par)
    elif kind == USER:
        origin = s[int(par[1])]
    if mode == APART:
        return -inf, origin, -inf, inf
    if kind == DAMPED:
        slow = -1.0 / s[0] if s[0] > 0.0 else -inf
        if mode == CUT:
            return 0.0, inf, -inf, slow
        return 0.0, inf, slow, inf
    if kind < THORNTON or kind == USER:
        return origin, inf, -inf, inf
    if kind == TABLE and par[0] == 1.0:  # elastic
        return origin, inf, -inf, inf
    if mode == BACK:
        return origin, s[1], -inf, inf
    # loading or reloading, up to the next kink
    high = inf
    deepest = s[0]
    if s[2] < deepest:
        high = deepest
    elif kind in (THORNTON, STRONGE):
        if s[2] < par[1]:
            high = par[1]
        elif kind == STRONGE and s[2] < FULLY_PLASTIC * par[1]:
            high = FULLY_PLASTIC * par[1]
    return origin, high, 0.0, inf


@compiled(f"int64(int64, int64, int64, float64, float64, {F1}, {F1})")
def change(kind: int, mode: int, bound: int, delta: float, rate: float, par: Any, s: Any) -> int:
    """The piece beyond a bound; what the contact remembers is brought up to date in `s`.

    With memory s = (deepest, turning point, indentation from which the loading goes on).
    """
    if mode == APART:
        if kind == DAMPED:
            s[1] = max(rate, s[1])
            slow = max(rate, SLOWEST * s[1])
            s[0] = par[2] / slow if slow > 0.0 else 0.0
        elif THORNTON <= kind <= TABLE:
            low = permanent(kind, s[0], par)
            s[2] = low
            retraces = kind != YANG_SUN and kind != TAN_SUN
            if retraces and s[0] > 0.0:
                s[1] = s[0]
                return BACK
            s[1] = low
        elif kind == USER and not COMPILED:
            user_touch(rate, par, s)
        return FORWARD
    if bound == LOW:
        return APART
    if kind == DAMPED:
        return CUT if mode == FORWARD else FORWARD
    if mode == BACK:
        s[2] = max(delta, s[1])
        return FORWARD
    if bound == SLOW:
        s[1] = delta
        s[0] = max(s[0], delta)
        return BACK
    s[2] = delta * (1.0 + 1e-12)  # over a kink
    if s[0] < s[2]:
        s[0] = s[2]
    return FORWARD


def user_touch(rate: float, par: Any, s: Any) -> None:
    law = LAWS[int(par[0])]
    size = int(par[1])
    state = law.touch(max(rate, 0.0), tuple(s[:size]) if s[size + 1] else None)
    s[:size] = state
    s[size], s[size + 1] = law.origin(state), 1.0


def user_advance(delta: float, rate: float, par: Any, s: Any) -> None:
    law = LAWS[int(par[0])]
    size = int(par[1])
    state = law.advance(delta, rate, tuple(s[:size]))
    s[:size] = state
    s[size] = law.origin(state)


@compiled(f"UniTuple(float64, 2)(int64, float64, float64, {F1}, {F1})")
def expected(kind: int, mass: float, speed: float, par: Any, s: Any) -> Any:
    """Depth and force at which a mass would have turned, roughly: F delta = m v^2."""
    base = 0.0
    if THORNTON <= kind <= TABLE:
        base = s[2]
    work = mass * speed * speed
    depth = 1e-6
    for _ in range(60):
        force = curve(kind, FORWARD, base + depth, 0.0, par, s)[0]
        ratio = work / (force * depth) if force * depth > 0.0 else 1e6
        ratio = min(max(ratio, 1e-6), 1e6)
        depth *= ratio**0.4
        if 0.9 < ratio < 1.1:
            break
    return depth, curve(kind, FORWARD, base + depth, 0.0, par, s)[0]
