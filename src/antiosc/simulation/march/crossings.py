"""When a polynomial through values and slopes meets a bound."""

from __future__ import annotations

from .compiling import compiled


@compiled("float64(float64, float64, float64, float64, float64, float64)")
def crossing(y0: float, d0: float, y1: float, d1: float, h: float, bound: float) -> float:
    """When the cubic through values y and slopes d over h meets the bound, which y1 lies beyond."""
    sign = 1.0 if y1 > bound else -1.0
    if sign * (y0 - bound) >= 0.0:
        if sign * d0 >= 0.0:
            return 0.0
        y0 = bound  # it was on the bound, but for rounding, and goes inward first
    a, b = h * d0, 3.0 * (y1 - y0) - h * (2.0 * d0 + d1)
    c = 2.0 * (y0 - y1) + h * (d0 + d1)
    low, high = 0.0, 1.0
    u = min(max((bound - y0) / (y1 - y0), 0.1), 0.9)
    for _ in range(60):
        y = y0 + u * (a + u * (b + u * c)) - bound
        if sign * y > 0.0:
            high = u
        else:
            low = u
        slope = a + u * (2.0 * b + 3.0 * c * u)
        new = u - y / slope if slope * sign > 0.0 else -1.0
        if not low < new < high:
            new = 0.5 * (low + high)
        if abs(new - u) < 1e-12:
            break
        u = new
    return u * h


@compiled(f"float64({', '.join(['float64'] * 9)})")
def polished(
    at: float,
    y0: float,
    d0: float,
    y1: float,
    d1: float,
    y2: float,
    d2: float,
    h: float,
    bound: float,
) -> float:
    """A crossing at about the time `at`, on the polynomial through values and slopes at 0, h/2, h.

    Two steps of Newton's method; `at` itself where they lead away.
    """
    a1 = h * d0
    first, second = 2.0 * (y1 - y0), 2.0 * (y2 - y1)
    middle = h * d1
    a2, b2 = 2.0 * (first - a1), 2.0 * (middle - first)
    c2, e2 = 2.0 * (second - middle), 2.0 * (h * d2 - second)
    a3, b3, c3 = 2.0 * (b2 - a2), c2 - b2, 2.0 * (e2 - c2)
    a4 = b3 - a3
    a5 = c3 - b3 - a4
    u = at / h
    for _ in range(2):
        w, z = u - 0.5, u - 1.0
        inner = a3 + w * (a4 + z * a5)
        y = y0 + u * (a1 + u * (a2 + w * inner)) - bound
        slope = a1 + u * (2.0 * a2 + 2.0 * w * inner + u * (inner + w * (a4 + (z + w) * a5)))
        if slope == 0.0:
            return at
        u -= y / slope
    return u * h if abs(u * h - at) < 0.1 * h and 0.0 < u < 1.0 else at
