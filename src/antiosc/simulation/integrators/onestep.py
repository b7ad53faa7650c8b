"""Base of the one-step methods with a fixed step: integrate a contact and locate its release."""

from __future__ import annotations

from abc import ABC, abstractmethod
from typing import ClassVar, NamedTuple

import numpy as np

from antiosc.base._types import Array
from antiosc.contact import State
from antiosc.simulation.integrators.growth import growth
from antiosc.simulation.integrators.problem import (
    MAX_STEPS,
    Phase,
    Problem,
    Segment,
    too_many_steps,
)

COARSE_GROWTH = 2.0  # of the energy: less may be the error of a coarse step


class Node(NamedTuple):
    """State at the end of a step; `mean` is the force over the step that made the impulse."""

    q: Array
    v: Array
    force: float
    delta: float
    rate: float
    mean: float


class OneStep(ABC):
    """A one-step method of fixed `step` [s]; subclasses give one step."""

    order: ClassVar[int]
    name: ClassVar[str]

    def __init__(self, step: float, max_steps: int = MAX_STEPS) -> None:
        self.step, self.max_steps = step, max_steps

    @abstractmethod
    def advance(self, problem: Problem, start: Node, state: State, h: float) -> Node:
        """One step of length h from `start`."""

    @staticmethod
    def stable_step(problem: Problem, step: float, least: float) -> float:
        """The largest stable step [s] up to `step`, if it is not below `least`."""
        return step

    def contact(
        self, problem: Problem, t: float, q: Array, v: Array, state: State, end: float
    ) -> Phase:
        p, law = problem, problem.law
        node = Node(q, v, 0.0, problem.approach(q), float(problem.beta @ v), 0.0)
        nodes, times = [node], [t]
        grown = growth(p.square, p.load, p.q, p.v, COARSE_GROWTH, p.beta)
        released, failure, diverged = False, "", False
        with np.errstate(over="ignore", invalid="ignore"):
            while end - t > 1e-12 * end and not released:
                h = min(self.step, end - t)
                new = self.advance(problem, node, state, h)
                if grown(new.q, new.v):
                    diverged = True
                    failure = (
                        f"{self.name} diverged at {t:g} s with a step of {self.step:g} s"
                        f" (h omega_max = {self.step * problem.omega.max():.3g}); use a smaller"
                        f" step or method='exact'"
                    )
                    break
                if len(nodes) > self.max_steps:
                    failure = too_many_steps(t, self.max_steps)
                    break
                if new.force == 0.0 and new.delta <= law.origin(state):
                    h, new = self._release(problem, node, state, h, new)
                    released = True
                t += h
                node = new
                state = law.advance(node.delta, node.rate, state)
                nodes.append(node)
                times.append(t)
        count = len(nodes) - 1
        impulse = float(np.diff(times) @ np.array([n.mean for n in nodes[1:]]))
        if not released and not failure:
            t = end
        segments = [_segment(np.array(times), nodes)]
        return Phase(
            segments, t, node.q, node.v, state, count, released, impulse, failure, diverged
        )

    def _release(
        self, problem: Problem, node: Node, state: State, h: float, last: Node
    ) -> tuple[float, Node]:
        """The fraction of the step after which the indentation reaches the origin of the law."""
        origin = problem.law.origin(state)

        from scipy.optimize import brentq  # loaded where it is used: it takes long

        def above(part: float) -> float:
            return self.advance(problem, node, state, part).delta - origin

        if node.delta <= origin or above(1e-9 * h) <= 0:
            return h, last
        part = float(brentq(above, 1e-9 * h, h, xtol=1e-18, rtol=1e-13, maxiter=500))
        return part, self.advance(problem, node, state, part)._replace(force=0.0)


def _segment(times: Array, nodes: list[Node]) -> Segment:
    q, v = np.array([n.q for n in nodes]), np.array([n.v for n in nodes])
    return Segment(
        times,
        np.array([n.force for n in nodes]),
        lambda: np.array([n.delta for n in nodes]),
        lambda: (q, v),
    )
