"""Gradients: how close to complex steps and differences, and what they cost.

The cost is that of `aom_gradient`, all derivatives at once, over that of `aom_solve` of the same
impact with its error control at tol = 1e-3, both alone in the library, and of `gradient` over
`simulate`, all in Python; least of repeats, taken in turns.

    OMP_NUM_THREADS=1 .venv/bin/python benchmarks/gradients.py
"""

from __future__ import annotations

import time
from collections.abc import Callable
from typing import Any

import numpy as np

import antiosc as ao
from antiosc import closed_form
from antiosc.engine import adjoint, library, march
from antiosc_studies.gradients.goals import recorded, seeds

SIZES = (5, 20, 60)
GOALS = ("peak_force", "impulse", "contact_time")
REPEATS = 300


def main(sizes: tuple[int, ...] = SIZES, repeats: int = REPEATS) -> list[tuple[object, ...]]:
    """Rows (n, goal, derivatives, worst difference, cost in C, cost in Python), printed."""
    rows: list[tuple[object, ...]] = []
    print("  n goal          derivatives  off by   / aom_solve  / simulate")
    for n in sizes:
        model, ball, law, duration = impact(n)
        hit = ao.simulate(model, ball, law, duration)
        fine = ao.simulate(model, ball, law, duration, tol=1e-7)
        for goal in GOALS:
            g = ao.gradient(fine, goal)
            off = max(
                abs(value / difference(model, ball, law, duration, goal, name) - 1)
                for name, value in (("mass", g.mass), ("velocity", g.velocity))
            )
            run, back, whole, python = costs(hit, (model, ball, law, duration), goal, repeats)
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


def costs(hit: Any, blow: tuple[Any, ...], goal: str, repeats: int) -> list[float]:
    """Seconds of `aom_solve`, `aom_gradient`, `simulate` and `gradient`."""
    found = recorded(hit)
    options = library.COptions(blow[-1], 1e-3, 0.0, 0.0, 1e-6, 10_000, 1_000_000, 0)
    wanted = seeds(found, goal, 0, None)
    places = wanted.arrays(2 * found.system.omega.size + 1)
    given = (found.system, found.run, found.states(), *places, wanted.force, wanted.time)
    calls: list[Callable[[], float]] = [
        lambda: in_library("aom_solve", march.solve, found.system, options),
        lambda: in_library("aom_gradient", adjoint.gradient, *given),
        lambda: timed(ao.simulate, *blow),
        lambda: timed(ao.gradient, hit, goal),
    ]
    return least(calls, repeats)


def timed(call: Callable[..., Any], *given: Any) -> float:
    """Seconds of a call."""
    began = time.perf_counter()
    call(*given)
    return time.perf_counter() - began


def in_library(name: str, call: Callable[..., Any], *given: Any) -> float:
    """Seconds of a call within one function of the library."""
    spent = 0.0

    class Library:
        def __getattr__(self, asked: str) -> Any:
            function = getattr(plain, asked)
            return counted if asked == name else function

    def counted(*arguments: Any) -> Any:
        nonlocal spent
        began = time.perf_counter()
        answer = getattr(plain, name)(*arguments)
        spent += time.perf_counter() - began
        return answer

    plain = library.library
    library.library = Library()  # type: ignore[assignment]
    try:
        call(*given)
    finally:
        library.library = plain
    return spent


def least(calls: list[Callable[[], float]], repeats: int) -> list[float]:
    """Least seconds of each call, made in turns."""
    return np.min([[call() for call in calls] for _ in range(repeats)], axis=0).tolist()


if __name__ == "__main__":
    main()
