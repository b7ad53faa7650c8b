"""Gradients: how close to complex steps and differences, and what they cost.

The cost is that of `aom_gradient`, all derivatives at once, over that of `aom_solve` of the same
impact with its error control at tol = 1e-3, and of `gradient` over `simulate`; least of repeats.

    OMP_NUM_THREADS=1 .venv/bin/python benchmarks/gradients.py
"""

from __future__ import annotations

import time
from collections.abc import Callable

import numpy as np

import antiosc as ao
from antiosc import closed_form
from antiosc.base import march
from antiosc.simulation import engine
from antiosc.studies.gradients.goals import seeds
from antiosc.studies.gradients.recorded import recorded

SIZES = (5, 20, 60)
GOALS = ("peak_force", "impulse", "contact_time")
REPEATS = 30


def main(sizes: tuple[int, ...] = SIZES, repeats: int = REPEATS) -> list[tuple[object, ...]]:
    """Rows (n, goal, derivatives, worst difference, cost in C, cost in Python), printed."""
    rows: list[tuple[object, ...]] = []
    print("  n goal          derivatives  off by   / aom_solve  / simulate")
    for n in sizes:
        model, ball, law, duration = impact(n)
        hit = ao.simulate(model, ball, law, duration)
        fine = ao.simulate(model, ball, law, duration, tol=1e-7)
        found = recorded(hit)
        options = march.Options(duration, 1e-3, 0.0, 0.0, 1e-6, 10_000, 1_000_000, 0)
        run = least(lambda: engine.solve(found.system, options), repeats)  # noqa: B023
        whole = least(lambda: ao.simulate(model, ball, law, duration), repeats)  # noqa: B023
        for goal in GOALS:
            g = ao.gradient(fine, goal)
            off = max(
                abs(value / difference(model, ball, law, duration, goal, name) - 1)
                for name, value in (("mass", g.mass), ("velocity", g.velocity))
            )
            wanted = seeds(found, goal, 0, None)
            places = wanted.arrays(2 * found.system.omega.size + 1)
            given = (found.states(), *places, wanted.force, wanted.time)
            back = least(lambda: engine.gradient(found.system, found.run, *given), repeats)  # noqa: B023
            python = least(lambda: ao.gradient(hit, goal), repeats)  # noqa: B023
            count = 2 * n + 5
            rows.append((n, goal, count, off, back / run, python / whole))
            print(
                f"{n:3} {goal:<13} {count:11} {off:8.1e} {back / run:11.2f} {python / whole:11.2f}"
            )
    return rows


def impact(n: int) -> tuple[ao.AntiOscillators, ao.RigidMass, ao.Hertz, float]:
    """The article's case 2: a mass strikes the middle of a pinned beam, with sub-impacts."""
    beam = closed_form.UniformBeam.euler_bernoulli(
        E=67e9, rho=2400.0, area=2e-4, inertia=0.33e-8, length=1.0
    )
    struck = closed_form.pinned_pinned(beam)
    return struck.anti_oscillators(n), ao.RigidMass(0.24, 1.0), ao.Hertz(1.55e10), 4e-3


def difference(
    model: ao.AntiOscillators,
    ball: ao.RigidMass,
    law: ao.Hertz,
    duration: float,
    goal: str,
    name: str,
    change: float = 1e-5,
) -> float:
    """Central difference of tight runs by the mass or the velocity."""
    ends = []
    for sign in (-1, 1):
        values = {"mass": ball.mass, "velocity": ball.velocity}
        values[name] *= 1 + sign * change
        other = ao.RigidMass(**values)
        ends.append(getattr(ao.simulate(model, other, law, duration, tol=1e-9), goal))
    return float(ends[1] - ends[0]) / (2 * change * getattr(ball, name))


def least(call: Callable[[], object], repeats: int) -> float:
    """Least seconds of a call."""
    spent = []
    for _ in range(repeats):
        began = time.process_time()
        call()
        spent.append(time.process_time() - began)
    return float(np.min(spent))


if __name__ == "__main__":
    main()
