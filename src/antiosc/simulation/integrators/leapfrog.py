"""Leapfrog (central differences) in its velocity form. Order 2, stable for h omega_max < 2.

The contact force follows from the new displacement, so that a step is explicit. If the contact
point is massless (r > 0) or the law depends on the rate, a step solves one scalar equation.
"""

from __future__ import annotations

from typing import ClassVar

from antiosc.contact import State
from antiosc.simulation.integrators.onestep import Node, OneStep
from antiosc.simulation.integrators.problem import Problem


class Leapfrog(OneStep):
    """Central differences, q'' at the start and at the end of the step."""

    order = 2
    name = "leapfrog"
    #: share of the limit h omega_max = 2 that the automatic step keeps
    SAFETY: ClassVar[float] = 0.9

    @staticmethod
    def stable_step(problem: Problem, step: float, least: float) -> float:
        top = float(problem.omega.max(initial=0.0))
        return min(step, Leapfrog.SAFETY * 2 / top) if top > 0 else step

    def advance(self, problem: Problem, start: Node, state: State, h: float) -> Node:
        p, x, d = problem, problem.square, problem.decay
        q, v, F = start.q, start.v, start.force
        half = v + h / 2 * (p.load - p.beta * F - x * q - 2 * d * v)
        q1 = q + h * half
        scale = 1 + h * d
        v1 = (half + h / 2 * (p.load - x * q1)) / scale
        pull = h / 2 * p.beta / scale
        delta, rate = float(p.beta @ q1) - p.gap, float(p.beta @ v1) + p.r * F / h
        alpha_rate = float(p.beta @ pull) + p.r / h
        if not p.law.rate_dependent:
            alpha_rate = 0.0
        F1 = p.law.implicit(delta, p.r, rate, alpha_rate, state, F)
        v1 = v1 - pull * F1
        rate = float(p.beta @ v1) - p.r * (F1 - F) / h
        return Node(q1, v1, F1, delta - p.r * F1, rate, (F + F1) / 2)
