"""What is expected of a contact, roughly: its depth, speed, duration and stiffness.

These estimates start the choice of the step; no result depends on them, but for the tangential
stiffness of friction that is not given, for which the depth is found accurately.
"""

from __future__ import annotations

from ctypes import byref
from math import isfinite

from antiosc.base import march
from antiosc.base._types import Array
from antiosc.contact import ContactLaw, State
from antiosc.simulation.march.laws import packed, raise_error

CLOSE = 0.1  # relative error of a depth


def expected_impact(
    law: ContactLaw,
    mass: float,
    beta: Array,
    v: Array,
    load: Array,
    gap: float,
    duration: float,
) -> tuple[float, float, float]:
    """Depth [m], speed [m/s] and contact time [s] that are expected of one contact.

    Parameters
    ----------
    mass : inertia [kg] behind the contact, of the slowest motion of each body.
    beta, v, load : (J,) displacement of the contact in the modes, their velocities and forces at
        the start.
    """
    kernel, own = packed(law)
    at = map(march.address, (beta, v, load))
    impact = march.Impact(
        beta.size, 0, None, None, *at, None, kernel, 0.0, gap, mass, duration, 0.0, 0, 0
    )
    found = march.library.aom_expect(byref(impact))
    raise_error(own)
    depth, speed, time = found.depth, found.speed, found.time
    if not isfinite(depth + speed + time):
        raise OverflowError("the depth of the contact")
    return depth, speed, time


def deepest(
    law: ContactLaw, speed: float, energy: float, push: float, high: float, close: float = CLOSE
) -> float:
    """Indentation [m], at most `high`, that absorbs an energy and the work of a force.

    Of a new contact that closes at a `speed`; `close`: relative error.
    """
    kernel, own = packed(law)
    found = march.library.aom_law_deepest(byref(kernel), speed, energy, push, high, close)
    raise_error(own)
    return float(found)


def stiffness_at(law: ContactLaw, delta: float, state: State) -> float:
    """Contact stiffness [N/m] at the deepest indentation: the larger of loading and unloading."""
    unloading = law.advance(delta, 0.0, state)
    slopes = law.tangent(delta, 0.0, state)[0], law.tangent((1 - 1e-9) * delta, 0.0, unloading)[0]
    steepest = float(max(slopes))
    return steepest if isfinite(steepest) else 0.0
