"""The root of a function whose slope is known."""

from __future__ import annotations

from collections.abc import Callable

from antiosc.errors import NotConvergedError

NEWTON_SETTLED = 1e-8  # of the bracket: what Newton's step leaves is the square of it


def rising_root(
    f: Callable[[float], tuple[float, float]], low: float, high: float, start: float
) -> float:
    """Root in [low, high] of f, value and slope, that is < 0 at `low` and > 0 at `high`.

    Newton's method from `start`, and bisection if that leaves the bracket or becomes slow. If the
    sign does not change, the result is the end of the interval nearest to the root.
    """
    close = NEWTON_SETTLED * (high - low)
    t = start if low < start < high else 0.5 * (low + high)
    before = last = high - low
    for _ in range(400):
        value, slope = f(t)
        if value > 0.0:
            high = t
        else:
            low = t
        new = t - value / slope if slope > 0.0 else low
        if low <= new <= high and abs(new - t) <= 0.5 * before and slope > 0.0:
            if abs(new - t) <= close:
                return new
        else:
            new = 0.5 * (low + high)
            if new in (low, high):
                return new
        before, last, t = last, abs(new - t), new
    raise NotConvergedError(
        f"a root has not converged after 400 steps: it lies between {low!r} and {high!r} s."
    )
