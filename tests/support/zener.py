"""Zener's impact of a sphere on an infinite thin plate: no wave returns.

Under a force F the struck point of an infinite Kirchhoff plate moves at F/(8√(Dρh)). With
Hertz's law F = kδ^{3/2}, lengths in (mv²/k)^{2/5} and times in that over v, the indentation obeys

    σ'' + (3/2) λ σ^{1/2} σ' + σ^{3/2} = 0,   σ(0) = 0, σ'(0) = 1,

and the sphere leaves with −σ' of its velocity, its inelasticity λ being the only parameter.

C. Zener, Phys. Rev. 59 (1941) 669-673.
"""

from __future__ import annotations

from math import sqrt

import numpy as np

from antiosc.base import checks
from antiosc.base.errors import InputError

#: Inelasticity beyond which the rebound velocity is zero.
HIGHEST_LAMBDA = 100.0


@checks.within_range
def inelasticity(
    mass: float, velocity: float, stiffness: float, D: float, surface_density: float
) -> float:
    """λ of a mass (kg) at `velocity` (m/s) with Hertz's `stiffness` (N m^-3/2) on a plate.

    `D`: the plate's bending stiffness, N m; `surface_density`: its mass per area, kg/m².
    """
    mass = checks.positive("mass", mass, "kg")
    velocity = checks.positive("velocity", velocity)
    stiffness = checks.positive("stiffness", stiffness)
    impedance = 8 * sqrt(
        checks.positive("D", D) * checks.positive("surface_density", surface_density)
    )
    return mass / (impedance * time_unit(mass, velocity, stiffness))


@checks.within_range
def time_unit(mass: float, velocity: float, stiffness: float) -> float:
    """Unit of time (mv²/k)^{2/5}/v in s; without the plate (λ = 0) a contact lasts 3.218 units."""
    mass = checks.positive("mass", mass, "kg")
    velocity = checks.positive("velocity", velocity)
    stiffness = checks.positive("stiffness", stiffness, "N m^-3/2")
    return float((mass * velocity**2 / stiffness) ** 0.4 / velocity)


def restitution(lam: float) -> float:
    """Restitution coefficient at inelasticity λ ≥ 0: 1 at 0, falling to 0."""
    return float(-_solution(lam)[1])


def contact_time(lam: float) -> float:
    """Contact time over `time_unit`."""
    return float(_solution(lam)[0])


def _solution(lam: float) -> tuple[float, float]:
    """(time of release, σ' there)."""
    lam = checks.nonnegative("lam", lam)
    if lam > HIGHEST_LAMBDA:
        raise InputError(
            f"lam must be at most {HIGHEST_LAMBDA:g}: the restitution is 0; got {lam:g}."
        )

    from scipy.integrate import solve_ivp  # loaded where it is used: it takes long

    def slope(_: float, state: np.ndarray) -> list[float]:
        root = sqrt(max(state[0], 0.0))
        return [state[1], -1.5 * lam * root * state[1] - root**3]

    def released(_: float, state: np.ndarray) -> float:
        return float(state[0])

    released.terminal = True  # type: ignore[attr-defined]
    released.direction = -1.0  # type: ignore[attr-defined]
    result = solve_ivp(
        slope,
        (0, 1e4 * (1 + lam) ** 2),
        [0, 1.0],
        "DOP853",
        events=released,
        rtol=1e-11,
        atol=1e-13,
    )
    return float(result.t_events[0][0]), float(result.y_events[0][0][1])
