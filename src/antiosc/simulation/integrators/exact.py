"""The exact propagator: the force is linear over a step, everything else is exact. Order 2.

Over a run of steps h the indentation at the nodes is a sum of known responses,

    delta_n = free_n + half_n F_0 + sum_{0<m<n} hat_{n-m} F_m - alpha F_n,

where `half` and `hat` are the responses to the hat functions that interpolate F. A step therefore
takes one short scalar product and one scalar equation, for any number of modes; the modal state is
updated once in `CHUNK` steps. Massless contact points (r > 0) need no special treatment.

The method is unstable in narrow windows of the step, in which the contact excites the modes
(`integrators.stability`). Steps that are chosen here avoid the windows; for a given step the growth
of energy is detected.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import cached_property, lru_cache
from math import sqrt

import numpy as np
from scipy.linalg import toeplitz

from antiosc._types import Array, BoolArray
from antiosc.contact import State
from antiosc.simulation.integrators.problem import (
    MAX_STEPS,
    Phase,
    Problem,
    Segment,
    too_many_steps,
)
from antiosc.simulation.integrators.root import rising_root
from antiosc.simulation.integrators.stability import clear_step, growth

CHUNK = 96
SHORT = 8
DEPTH = 6
LONGER = 2
ENERGY_GROWTH = 1.2  # of the energy: coarse steps of random scenes stay below 1.01


class Exact:
    """Exact propagator with a fixed step [s] during contact; release is located within a step.

    A contact shorter than `SHORT` steps is repeated with a step 8 times smaller, at most `DEPTH`
    times. With a rate-dependent law at a massless contact point the order is 1, because the
    derivative of the force jumps at the touch.
    """

    order = 2
    name = "exact"

    def __init__(self, step: float, max_steps: int = MAX_STEPS) -> None:
        self.step, self.max_steps = step, max_steps
        self._kernel = lru_cache(maxsize=16)(_Kernel)
        self._clear = lru_cache(maxsize=16)(clear_step)
        self._grown = lru_cache(maxsize=1)(_growth)

    @staticmethod
    def stable_step(problem: Problem, step: float, least: float) -> float:
        """The largest step [s] up to `step` outside the windows, if it is not below `least`."""
        return clear_step(problem, step, least)

    def contact(
        self, problem: Problem, t: float, q: Array, v: Array, state: State, end: float
    ) -> Phase:
        step = self.step
        phase = self.resume(problem, t, q, v, state, end, step)
        work = phase.evaluations
        for _ in range(DEPTH):
            if not phase.released or phase.time - t > SHORT * step:
                break
            # with 1/8 of the step; if it is not over by then, continue with the given step
            until = min(end, t + LONGER * SHORT * step)
            coarse, step = step, self._clear(problem, step / 8)
            phase = self.resume(problem, t, q, v, state, until, step)
            work += phase.evaluations
            if not phase.released and not phase.failure and until < end:
                p, force = phase, float(phase.segments[-1].force[-1])
                phase = self.resume(problem, p.time, p.q, p.v, p.state, end, coarse, force)
                phase.segments[:0] = p.segments
                work += phase.evaluations
                break
        phase.evaluations = work
        if not phase.failure and self._grown(problem)(phase.q, phase.v):
            phase.failure, phase.diverged = self._gained(problem, phase.time), True
        return phase

    def _gained(self, problem: Problem, t: float) -> str:
        """The failure message of a run whose energy has grown."""
        clear = clear_step(problem, self.step)
        remedy = f"step={clear:.6g}" if clear < self.step else "a smaller step"
        return (
            f"exact gained energy by {t:g} s: at a step of {self.step:g} s the contact excites the "
            f"modes (unstable step); use {remedy} or no step, so that it is chosen automatically"
        )

    def resume(
        self,
        problem: Problem,
        t: float,
        q: Array,
        v: Array,
        state: State,
        end: float,
        step: float,
        force: float = 0.0,
    ) -> Phase:
        """Continue from any state of the contact, including `force`."""
        segments: list[Segment] = []
        count = 0
        while True:
            left = end - t
            size, h = min(CHUNK, int(left / step * (1 + 1e-12))), step
            if size < 1:
                size, h = 1, left
            kernel = self._kernel(problem, h, CHUNK if size > 1 else 1)
            forces, delta, state, parted = _march(kernel, q, v, force, state, size)
            if parted:
                ahead = float(delta[-1])
                forces, delta = forces[:-1], delta[:-1]
            done = forces.size - 1
            count += done + parted
            if done:
                segments.append(_segment(kernel, t, q, v, forces, delta))
                q, v = kernel.state(q, v, forces)
                t += done * h
                force = float(forces[-1])
            if parted:
                length = _release(problem, q, v, force, problem.law.origin(state), h, ahead)
                segments.append(_last(problem, t, q, v, force, float(delta[-1]), length, state))
                q, v = problem.forced(q, v, length, force, 0.0)
                return Phase(segments, t + length, q, v, state, count, True)
            if count > self.max_steps:
                failure = too_many_steps(t, self.max_steps)
                return Phase(segments, t, q, v, state, count, False, failure)
            if end - t <= 1e-12 * end:
                return Phase(segments, end, q, v, state, count, False)


def _growth(problem: Problem) -> Callable[[Array, Array], BoolArray]:
    p = problem
    return growth(p.propagator.square, p.load, p.q, p.v, ENERGY_GROWTH, p.beta)


class _Kernel:
    """Responses of one problem at the nodes 0 ... size of a uniform step h."""

    def __init__(self, problem: Problem, h: float, size: int) -> None:
        self.problem, self.h = problem, h
        beta, prop = problem.beta, problem.propagator
        times = h * np.arange(size + 1)
        self.P, self.S, self.W = prop.motion(times)
        self.V = -prop.square * self.S
        self.J = prop.step(times) if problem.loaded else None
        _, S, _, step, ramp = prop.responses(h)
        # states that unit forces leave: rising (0 to 1) and falling (1 to 0) over one step
        rise_q, rise_v = -beta * ramp / h, -beta * step / h
        fall_q, fall_v = -beta * step - rise_q, -beta * S - rise_v
        peak_q, peak_v = self._after(1, rise_q, rise_v)
        peak_q, peak_v = peak_q + fall_q, peak_v + fall_v
        self.hat_q, self.hat_v = self._train(rise_q, rise_v, peak_q, peak_v)
        zero = np.zeros_like(beta)
        self.half_q, self.half_v = self._train(zero, zero, fall_q, fall_v)
        self.hat, self.half = self.hat_q @ beta, self.half_q @ beta
        self.tails = _tails(self.hat)
        self.alpha = problem.r - float(self.hat[0])

    @cached_property
    def rates(self) -> tuple[Array, list[Array], float]:
        """The rates of `half`, `tails` and `alpha`."""
        hat_rate = self.hat_v @ self.problem.beta
        return self.half_v @ self.problem.beta, _tails(hat_rate), -float(hat_rate[0])

    def _after(self, n: int | slice, q: Array, v: Array) -> tuple[Array, Array]:
        return self.P[n] * q + self.S[n] * v, self.V[n] * q + self.W[n] * v

    def _train(self, q0: Array, v0: Array, q1: Array, v1: Array) -> tuple[Array, Array]:
        """(q0, v0) at node 0, then the free motion from (q1, v1) at node 1."""
        q, v = self._after(slice(0, self.P.shape[0] - 1), q1, v1)
        return np.vstack((q0, q)), np.vstack((v0, v))

    def free(self, q: Array, v: Array) -> Array:
        """Indentation at the nodes without contact force, (size + 1,)."""
        p = self.problem
        value = self.P @ (p.beta * q) + self.S @ (p.beta * v) - p.gap
        return value if self.J is None else value + self.J @ (p.beta * p.load)

    def free_rate(self, q: Array, v: Array) -> Array:
        p = self.problem
        value = self.V @ (p.beta * q) + self.W @ (p.beta * v)
        return np.asarray(value if self.J is None else value + self.S @ (p.beta * p.load))

    def state(self, q: Array, v: Array, forces: Array) -> tuple[Array, Array]:
        """Modal state after the steps whose nodal forces are given."""
        n = forces.size - 1
        q1, v1 = self._after(n, q, v)
        if self.J is not None:
            q1, v1 = q1 + self.J[n] * self.problem.load, v1 + self.S[n] * self.problem.load
        late = forces[:0:-1]
        q1 = q1 + late @ self.hat_q[:n] + forces[0] * self.half_q[n]
        v1 = v1 + late @ self.hat_v[:n] + forces[0] * self.half_v[n]
        return q1, v1

    def states(self, q: Array, v: Array, forces: Array) -> tuple[Array, Array]:
        """Modal states at all nodes, (n + 1, J) each."""
        n = forces.size
        qn, vn = self._after(slice(0, n), q, v)
        if self.J is not None:
            qn, vn = qn + self.J[:n] * self.problem.load, vn + self.S[:n] * self.problem.load
        inner = np.concatenate(([0.0], forces[1:]))
        T = toeplitz(inner, np.zeros(n))
        qn = qn + T @ self.hat_q[:n] + forces[0] * self.half_q[:n]
        vn = vn + T @ self.hat_v[:n] + forces[0] * self.half_v[:n]
        return qn, vn


def _tails(hat: Array) -> list[Array]:
    """For every node n, hat_{n-1} ... hat_1: the weights of F_1 ... F_{n-1}."""
    reverse, last = hat[::-1].copy(), hat.size
    return [reverse[last - n : last - 1] for n in range(last)]


def _march(
    kernel: _Kernel, q: Array, v: Array, force: float, state: State, size: int
) -> tuple[Array, Array, State, bool]:
    """Forces and indentations at nodes 0 ... `size`, or up to the first node after the release."""
    law, r, h = kernel.problem.law, kernel.problem.r, kernel.h
    alpha = kernel.alpha
    free = (kernel.free(q, v) + force * kernel.half).tolist()
    forces, delta = np.zeros(size + 1), np.zeros(size + 1)
    forces[0] = force
    delta[0] = free[0] - r * force
    tails = kernel.tails
    moving = law.rate_dependent or law.has_memory
    rate, rate_response, previous, before = 0.0, 0.0, force, force
    if moving:
        half_rate, tails_rate, alpha_rate = kernel.rates
        free_rate = (kernel.free_rate(q, v) + force * half_rate).tolist()
        rate_response = alpha_rate + r / h
    implicit, origin = law.implicit, law.origin(state)
    for n in range(1, size + 1):
        past = forces[1:n]
        trial = free[n] + float(tails[n].dot(past))
        if moving:
            rate = free_rate[n] + r * force / h + float(tails_rate[n].dot(past))
        guess = 3 * (force - previous) + before  # on a parabola
        if guess < 0.5 * force:
            guess = 0.5 * force
        new = implicit(trial, alpha, rate, rate_response, state, guess)
        if new == 0.0 and trial <= origin:
            delta[n] = trial
            return forces[: n + 1], delta[: n + 1], state, True
        before, previous, force = previous, force, new
        forces[n] = new
        delta[n] = trial - alpha * new
        if moving:
            state = law.advance(float(delta[n]), rate - rate_response * new, state)
            origin = law.origin(state)
    return forces, delta, state, False


def _release(
    problem: Problem, q: Array, v: Array, force: float, origin: float, h: float, ahead: float
) -> float:
    """Length of the last step, in which the force and delta - origin fall to 0 together.

    `ahead` is the indentation after a whole step h.
    """
    prop, beta = problem.propagator, problem.beta
    from_q, from_v, pull, push = beta * q, beta * v, force * beta**2, beta * problem.load
    turn = push - prop.square * from_q - pull
    level = problem.gap + origin

    def apart(t: float) -> tuple[float, float]:
        P, S, W, J, R = prop.responses(t)
        change = float((J - R / t) @ pull)
        delta = float(P @ from_q + S @ from_v + J @ push) - change
        rate = float(W @ from_v + S @ turn) + change / t
        return level - delta, -rate

    # a first guess on the parabola from here with this rate to the whole step's end
    depth, slope = max(problem.approach(q) - origin, 0.0), h * float(beta @ v)
    bend = min(ahead - origin, 0.0) - depth - slope
    root = sqrt(max(slope**2 - 4 * depth * bend, 0.0)) - slope
    return rising_root(apart, 1e-9 * h, h, 2 * depth * h / root if root > 0.0 else h)


def _segment(kernel: _Kernel, t: float, q: Array, v: Array, forces: Array, delta: Array) -> Segment:
    time = t + kernel.h * np.arange(forces.size)
    impulse = kernel.h * float(forces.sum() - 0.5 * (forces[0] + forces[-1]))
    return Segment(time, forces, lambda: delta, impulse, lambda: kernel.states(q, v, forces), True)


def _last(
    problem: Problem,
    t: float,
    q: Array,
    v: Array,
    force: float,
    delta: float,
    length: float,
    state: State,
) -> Segment:
    def states() -> tuple[Array, Array]:
        q1, v1 = problem.forced(q, v, length, force, 0.0)
        return np.vstack((q, q1)), np.vstack((v, v1))

    return Segment(
        np.array([t, t + length]),
        np.array([force, 0.0]),
        lambda: np.array([delta, problem.law.origin(state)]),
        0.5 * length * force,
        states,
        True,
    )
