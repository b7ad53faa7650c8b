"""Energy-conserving midpoint rule with a discrete gradient of the contact potential. Order 2.

O. Gonzalez, J. Nonlinear Sci. 6 (1996) 449-467. The force over a step is the difference quotient of
the contact potential. The sum of kinetic, strain and contact energy is therefore conserved to
rounding for any step; the losses by damping and plasticity are exact as well.
"""

from __future__ import annotations

from antiosc.base.errors import InputError
from antiosc.contact import ContactLaw, State
from antiosc.simulation.integrators.onestep import Node, OneStep
from antiosc.simulation.integrators.problem import Problem


class Conserving(OneStep):
    """Midpoint rule; the potential includes the residual compliance in series with the contact."""

    order = 2
    name = "conserving"

    def advance(self, problem: Problem, start: Node, state: State, h: float) -> Node:
        p, x, d = problem, problem.square, problem.decay
        if p.r > 0 and p.law.rate_dependent:
            raise InputError(
                "method='conserving' does not support a rate-dependent law at a massless contact "
                "point (m0 = 0), which has no potential; use method='exact'."
            )
        q, v = start.q, start.v
        stiff = h * d + h * h * x / 4
        v1 = (v * (1 - stiff) + h * (p.load - x * q)) / (1 + stiff)
        pull = h * p.beta / (1 + stiff)
        q1 = q + h / 2 * (v + v1)
        alpha = h / 2 * float(p.beta @ pull)
        before = float(p.beta @ q) - p.gap
        free = float(p.beta @ q1) - p.gap
        step = Quotient(p.law, p.r, state, before, h)
        F = step.solve(free, alpha)
        q1, v1 = q1 - h / 2 * pull * F, v1 - pull * F
        after = free - alpha * F
        rate = (after - before) / h
        force = p.law.implicit(after, p.r, float(p.beta @ v1), 0.0, state)
        return Node(q1, v1, force, after - p.r * force, rate, F)


class Quotient:
    """Mean force over a step h that takes the unloaded indentation from `before` to `after`.

    The unloaded indentation includes that of the residual compliance r in series.
    """

    def __init__(self, law: ContactLaw, r: float, state: State, before: float, h: float) -> None:
        self.law, self.r, self.state, self.before, self.h = law, r, state, before, h
        self.start = self._potential(before)

    def solve(self, free: float, alpha: float) -> float:
        """F = mean(free - alpha F): the right-hand side does not rise with F."""
        high = self.mean(free)
        if high <= 0.0:
            return 0.0

        from scipy.optimize import brentq  # loaded where it is used: it takes long

        def excess(F: float) -> float:
            return F - self.mean(free - alpha * F)

        if excess(high) <= 0.0:  # by rounding, when alpha F is nothing beside the indentation
            return high
        return float(brentq(excess, 0.0, high, xtol=1e-300, rtol=1e-15, maxiter=2000))

    def mean(self, after: float) -> float:
        law, change = self.law, after - self.before
        energy, force = self._potential(after)
        energy0, force0 = self.start
        if abs(change) > 1e-5 * max(abs(after), abs(self.before)):
            F = (energy - energy0) / change
        else:
            F = 0.5 * (force + force0)
        if law.rate_dependent:
            middle = 0.5 * (after + self.before)
            F = max(F + law.damping(middle, change / self.h, self.state), 0.0)
        return F

    def _potential(self, free: float) -> tuple[float, float]:
        """Energy of contact and residual compliance in series, and the force."""
        F = self.law.implicit(free, self.r, 0.0, 0.0, self.state)
        delta = free - self.r * F
        return self.law.potential(delta, self.state) + 0.5 * self.r * F * F, F
