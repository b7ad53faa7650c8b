"""What is expected of a contact, roughly: its depth, speed, duration and stiffness.

These estimates start the choice of the step; no result depends on them, but for the tangential
stiffness of friction that is not given, for which the depth is found accurately.
"""

from __future__ import annotations

from collections.abc import Callable
from math import isfinite

import numpy as np

from antiosc.contact import ContactLaw, State


def expected_impact(
    law: ContactLaw, mass: float, speed: float, push: float, gap: float, duration: float
) -> tuple[float, float, float]:
    """Depth [m], speed [m/s] and contact time [s] that are expected of one contact.

    Parameters
    ----------
    mass : inertia [kg] behind the contact, of the slowest motion of each body.
    speed, push : closing speed [m/s] and acceleration [m/s^2] at the start.
    """
    push *= mass
    speed = float(np.sqrt(speed**2 + 2 * push / mass * gap))
    if speed == 0.0 and push == 0.0:
        return 1e-300, 1e-300, duration / 16
    farthest = speed * duration + push / mass * duration**2
    depth = deepest(law, law.touch(speed), 0.5 * mass * speed**2, push, farthest)
    pace = speed + float(np.sqrt(2 * push / mass * depth))
    return depth, pace, min(3 * depth / pace, duration / 2)


def deepest(
    law: ContactLaw,
    state: State,
    energy: float,
    push: float,
    high: float,
    close: float = 0.1,
) -> float:
    """Indentation [m], at most `high`, that absorbs an energy and the work of a force.

    `close`: relative error.
    """

    def excess(delta: float) -> float:
        return law.potential(delta, state) - energy - push * delta

    beyond = excess(high)
    if beyond <= 0:  # the law is softer than the whole run can show
        return high
    wanted = energy + push * high
    guess = high * (wanted / (beyond + wanted)) ** 0.4  # exact for Hertz's law without push
    low, high = _narrowed(excess, 0.95 * guess, min(1.04 * guess, high), high)
    for _ in range(400):
        if high <= (1.0 + close) * low:
            break
        middle = 0.5 * (low + high) if low > 0 else 0.1 * high
        low, high = (low, middle) if excess(middle) > 0 else (middle, high)
    return high


def _narrowed(
    excess: Callable[[float], float], first: float, last: float, high: float
) -> tuple[float, float]:
    """A part of (0, high), in which `excess` changes its sign: first to last if it does there."""
    if excess(last) <= 0:
        return last, high
    return (first, last) if excess(first) <= 0 else (0.0, first)


def stiffness_at(law: ContactLaw, delta: float, state: State) -> float:
    """Contact stiffness [N/m] at the deepest indentation: the larger of loading and unloading."""
    unloading = law.advance(delta, 0.0, state)
    slopes = law.tangent(delta, 0.0, state)[0], law.tangent((1 - 1e-9) * delta, 0.0, unloading)[0]
    steepest = float(max(slopes))
    return steepest if isfinite(steepest) else 0.0
