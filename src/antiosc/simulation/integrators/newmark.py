"""Newmark's average acceleration with implicit contact. Order 2; stable when linear.

N. M. Newmark, J. Eng. Mech. Div. ASCE 85 (1959) 67-94 with beta = 1/4, gamma = 1/2. Its energy is
not conserved if the contact stiffens or opens within a step: a step as long as the contact can
double the energy.
"""

from __future__ import annotations

from antiosc.contact import State
from antiosc.simulation.integrators.onestep import Node, OneStep
from antiosc.simulation.integrators.problem import Problem


class Newmark(OneStep):
    """Average acceleration: the force at the end of the step is found implicitly."""

    order = 2
    name = "newmark"

    def advance(self, problem: Problem, start: Node, state: State, h: float) -> Node:
        p, x, d = problem, problem.square, problem.decay
        q, v, F = start.q, start.v, start.force
        scale = 1 + h * d + h * h * x / 4
        a = p.load - p.beta * F - x * q - 2 * d * v
        v1 = (v + h / 2 * (a + p.load - x * (q + h / 2 * v))) / scale
        pull = h / 2 * p.beta / scale  # how a unit of the new force slows the modes
        q1 = q + h / 2 * (v + v1)
        gain = float(p.beta @ pull)
        delta, rate = float(p.beta @ q1) - p.gap, float(p.beta @ v1) + p.r * F / h
        alpha, alpha_rate = p.r + h / 2 * gain, gain + p.r / h
        F1 = p.law.implicit(delta, alpha, rate, alpha_rate, state, F)
        return Node(
            q1 - h / 2 * pull * F1,
            v1 - pull * F1,
            F1,
            delta - alpha * F1,
            rate - alpha_rate * F1,
            (F + F1) / 2,
        )
