"""Any method of scipy.integrate.solve_ivp, with events at release and at turning points.

It integrates the modal equations and evaluates the contact law at every call of the right-hand
side. It is an independent check of the other integrators; it becomes slow as m0 -> 0.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np

from antiosc.base._types import Array
from antiosc.base.errors import InputError
from antiosc.contact import State
from antiosc.simulation.integrators.problem import MAX_STEPS, Phase, Problem, Segment

METHODS = ("RK45", "RK23", "DOP853", "Radau", "BDF", "LSODA")
_ORDERS = {"RK45": 5, "RK23": 3, "DOP853": 8, "Radau": 5, "BDF": 5, "LSODA": 5}
_NODES = 8  # per solver step, from its dense output; even: the force is a parabola over each two


class SolveIVP:
    """`solve_ivp` with relative tolerance `rtol`.

    `max_step` [s] bounds its steps, `max_evaluations` those of the force in one contact.
    """

    def __init__(
        self,
        method: str,
        rtol: float,
        max_step: float = np.inf,
        max_evaluations: int = 5 * MAX_STEPS,
    ) -> None:
        self.name, self.rtol, self.max_step = method, rtol, max_step
        self.max_evaluations = max_evaluations
        self.order = _ORDERS[method]

    def contact(
        self, problem: Problem, t: float, q: Array, v: Array, state: State, end: float
    ) -> Phase:
        from scipy.integrate import solve_ivp  # loaded where it is used: it takes long

        law = problem.law
        if problem.r > 0 and law.rate_dependent:
            raise InputError(
                f"{self.name} does not support a rate-dependent law at a massless contact point "
                "(m0 = 0), where the force depends on its own derivative; use method='exact'."
            )
        size = q.size
        struck = problem.beta != 0  # what a body carries beside the blow sets no tolerance
        segments: list[Segment] = []
        count, turn = 0, -1.0
        y = np.concatenate((q, v, [0.0]))  # the last: impulse

        def ended(released: bool, failure: str = "") -> Phase:
            impulse = float(y[-1])
            return Phase(
                segments, t, y[:size], y[size:-1], state, count, released, impulse, failure
            )

        while True:
            motion = _Contact(problem, state, self.max_evaluations - count)
            # a hysteretic law changes branch where the indentation turns
            events: list[Callable[..., float]] = [motion.parted(law.origin(state))]
            if law.has_memory:
                events.append(motion.reversal(turn))
                turn = -turn
            pause = min(self.max_step, end - t)  # a time in which gravity sets things moving
            fall = np.abs(problem.load[struck]).max(initial=0.0) * pause
            speed = max(np.abs(y[size:-1][struck]).max(initial=0.0), fall, 1e-200)
            scale = max(np.abs(y[:size][struck]).max(initial=0.0), speed * pause)
            atol = self.rtol * np.concatenate(
                (
                    np.full(size, min(scale, 1.0) * 1e-3),
                    np.full(size, speed * 1e-3),
                    [1e-12 * speed],
                )
            )
            try:
                with np.errstate(all="ignore"):  # a failing method says so below
                    solution: Any = solve_ivp(
                        motion.slope,
                        (t, end),
                        y,
                        method=self.name,
                        rtol=self.rtol,
                        atol=atol,
                        max_step=self.max_step,
                        events=events,
                        dense_output=True,
                    )
            except (_GaveUp, ArithmeticError, ValueError) as error:
                reason = (
                    f"more than {self.max_evaluations} evaluations of the force in one contact"
                    if isinstance(error, _GaveUp)
                    else f"no finite step ({error})"
                )
                failure = f"{self.name} gave up after {t:g} s: {reason}; use method='exact'"
                count += motion.evaluations
                return ended(False, failure)
            count += motion.evaluations
            if solution.status < 0:
                reason = solution.message
                return ended(False, f"{self.name} gave up at {t:g} s: {reason}; use method='exact'")
            segments.append(_segment(motion, solution))
            t, y = float(solution.t[-1]), solution.y[:, -1].copy()
            delta, rate, _ = motion.contact(y)
            state = law.advance(delta, rate, state)
            released = solution.status == 1 and solution.t_events[0].size > 0
            if released or solution.status == 0:
                return ended(released)


class _GaveUp(Exception):
    """The limit of evaluations is reached."""


class _Contact:
    """Right-hand side during one branch of contact; y = (q, v, impulse)."""

    def __init__(self, problem: Problem, state: State, most: int) -> None:
        self.problem, self.state = problem, state
        self.evaluations, self.most = 0, most
        self.size = problem.omega.size

    def contact(self, y: Array) -> tuple[float, float, float]:
        """Indentation, its rate and the force."""
        p = self.problem
        free = float(p.beta @ y[: self.size]) - p.gap
        rate = float(p.beta @ y[self.size : -1])
        force = p.law.implicit(free, p.r, rate, 0.0, self.state)
        return free - p.r * force, rate, force

    def slope(self, t: float, y: Array) -> Array:
        p, n = self.problem, self.size
        self.evaluations += 1
        if self.evaluations > self.most:
            raise _GaveUp
        force = self.contact(y)[2]
        v = y[n:-1]
        a = p.load - p.beta * force - p.omega**2 * y[:n] - 2 * p.decay * v
        return np.concatenate((v, a, [force]))

    def parted(self, origin: float) -> Callable[..., float]:
        def event(t: float, y: Array) -> float:
            return float(self.problem.beta @ y[: self.size]) - self.problem.gap - origin

        event.terminal, event.direction = True, -1.0  # type: ignore[attr-defined]
        return event

    def reversal(self, direction: float) -> Callable[..., float]:
        def event(t: float, y: Array) -> float:
            return float(self.problem.beta @ y[self.size : -1])

        event.terminal, event.direction = True, direction  # type: ignore[attr-defined]
        return event


def _segment(motion: _Contact, solution: Any) -> Segment:
    steps = [
        np.linspace(a, b, _NODES, endpoint=False)
        for a, b in zip(solution.t[:-1], solution.t[1:], strict=True)
    ]
    time = np.concatenate([*steps, solution.t[-1:]])
    y = solution.sol(time)
    delta, _, force = np.array([motion.contact(column) for column in y.T]).T
    n = motion.size
    span = time[2::2] - time[:-2:2]
    curved = 4 * (force[:-2:2] - 2 * force[1:-1:2] + force[2::2])
    bend = np.divide(curved, span**2, out=np.zeros_like(span), where=span > 0)
    states = y[:n].T, y[n:-1].T
    return Segment(time, force, lambda: delta, lambda: states, bend=np.repeat(bend, 2))
