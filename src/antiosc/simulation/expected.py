"""What is expected of a contact, roughly: its depth, speed, duration and stiffness.

These estimates start the choice of the step; no result depends on them, but for the tangential
stiffness of friction that is not given, for which the depth is found accurately.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from math import isfinite

import numpy as np

from antiosc.contact import ContactLaw, State
from antiosc.models.modal import ModalBody
from antiosc.simulation.integrators import Problem


def scaled(
    problem: Problem, bodies: tuple[ModalBody, ModalBody], duration: float
) -> tuple[Problem, float]:
    """The problem with the depth, speed and mass of its contact, and the expected contact time [s].

    The estimate uses the effective mass of the slowest motion of each body at the contact point. It
    is only the start of the choice of the step.
    """
    mobility = sum(body.mobility for body in bodies)
    mass = 1 / mobility if mobility > 0 else 1.0
    push = abs(float(problem.beta @ problem.load)) * mass
    speed = abs(float(problem.beta @ problem.v))
    speed = float(np.sqrt(speed**2 + 2 * push / mass * problem.gap))
    if speed == 0.0 and push == 0.0:
        return replace(problem, mass=mass), duration / 16
    law = problem.law
    state = law.touch(speed)
    farthest = speed * duration + push / mass * duration**2
    delta = deepest(law, state, 0.5 * mass * speed**2, push, farthest)
    pace = speed + float(np.sqrt(2 * push / mass * delta))
    scale = min(3 * delta / pace, duration / 2)
    return replace(problem, depth=delta, speed=pace, mass=mass, farthest=farthest), scale


def stiffness_of(problem: Problem) -> float:
    """Largest stiffness [N/m] that is expected of the contact of a scaled problem."""
    law = problem.law
    state = law.touch(problem.speed)
    late = pressed_depth(problem, problem.mass, problem.speed, state, problem.farthest)
    return stiffness_at(law, problem.depth + late, state)


def deepest(
    law: ContactLaw,
    state: State,
    energy: float,
    push: float,
    high: float,
    soft: float = 0.0,
    close: float = 0.1,
) -> float:
    """Indentation [m], at most `high`, that absorbs an energy and the work of a force.

    The contact has a spring of compliance `soft` [m/N] in series. `close`: relative error.
    """

    def excess(delta: float) -> float:
        force = law.force(delta, 0.0, state) if soft else 0.0
        path = delta + soft * force
        return law.potential(delta, state) + 0.5 * soft * force**2 - energy - push * path

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


def pressed_depth(problem: Problem, mass: float, speed: float, state: State, high: float) -> float:
    """Indentation [m] of the whole impactor mass on the static compliance of both bodies.

    Under a light structure this comes after the first impact, on top of it.
    """
    rigid = problem.omega == 0
    mobility = float(np.sum(problem.beta[rigid] ** 2))
    mass = 1 / mobility if mobility > 0 else mass
    push = abs(float(problem.beta[rigid] @ problem.load[rigid])) * mass
    soft = problem.r + float(np.sum((problem.beta[~rigid] / problem.omega[~rigid]) ** 2))
    return deepest(problem.law, state, 0.5 * mass * speed**2, push, high, soft)


def stiffness_at(law: ContactLaw, delta: float, state: State) -> float:
    """Contact stiffness [N/m] at the deepest indentation: the larger of loading and unloading."""
    unloading = law.advance(delta, 0.0, state)
    slopes = law.tangent(delta, 0.0, state)[0], law.tangent((1 - 1e-9) * delta, 0.0, unloading)[0]
    steepest = float(max(slopes))
    return steepest if isfinite(steepest) else 0.0
