"""The exact integrator for many scenes at once, with arrays (S, J).

Every scene has its own step and its own sequence of events (flight, touch, contact, release). The
results equal those of `antiosc.simulation.integrators.exact` to rounding.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from antiosc._types import Array, BoolArray, Index
from antiosc.contact.many import VECTORISED, Laws
from antiosc.simulation.integrators.exact import DEPTH, ENERGY_GROWTH, LONGER, SHORT, Exact
from antiosc.simulation.integrators.problem import Problem
from antiosc.simulation.integrators.propagator import Propagator
from antiosc.simulation.integrators.root import NEWTON_SETTLED
from antiosc.simulation.integrators.stability import clear_steps, growth

_FEW = 8  # scenes that are quicker one by one ...
_LONG = 64  # ... if they go on for more steps than this


@dataclass(eq=False)
class Result:
    """Contacts (start, end, impulse), the nodes of the force, and how it was got."""

    contacts: list[tuple[float, float, float]] = field(default_factory=list)
    time: Array = field(default_factory=lambda: np.zeros(0))
    force: Array = field(default_factory=lambda: np.zeros(0))
    closing: float = 0.0
    parting: float = np.nan
    released: bool = False
    work: int = 0
    full: bool = False
    diverged: bool = False
    step: float = 0.0
    error: float = np.nan
    verdict: Any = None


class Stack:
    """Problems as arrays (S, J), padded with modes that have no effect."""

    def __init__(self, kind: type, problems: Sequence[Problem], durations: Sequence[float]) -> None:
        size = max(p.omega.size for p in problems)

        def pad(name: str) -> Array:
            array = np.zeros((len(problems), size))
            for row, p in zip(array, problems, strict=True):
                values = getattr(p, name)
                row[: values.size] = values
            return array

        self.omega, self.decay, self.beta = pad("omega"), pad("decay"), pad("beta")
        self.load, self.q, self.v = pad("load"), pad("q"), pad("v")
        self.r = np.array([p.r for p in problems])
        self.gap = np.array([p.gap for p in problems])
        self.resolution = np.array([p.resolution for p in problems])
        self.duration = np.array(durations)
        self.stiffness = np.array([p.stiffness for p in problems])
        self.kind, self.problems = kind, list(problems)
        self.loaded = bool(np.any(self.load))

    def implicit(self, rows: Index) -> Laws:
        return VECTORISED[self.kind]([self.problems[i].law for i in rows])

    def part(self, rows: Index) -> _Part:
        return _Part(self, rows)

    def clear(self, rows: Index, h: Array, least: Array | None = None) -> Array:
        """Steps at or just below `h` outside the windows of instability."""
        bodies = self.omega[rows], self.beta[rows], self.r[rows]
        least = np.zeros(h.size) if least is None else least
        return clear_steps(*bodies, self.stiffness[rows], h, least)


class _Part:
    """Some rows of a stack, with the motion of their modes."""

    def __init__(self, stack: Stack, rows: Index) -> None:
        self.stack, self.rows = stack, rows
        self.beta, self.gap, self.r = stack.beta[rows], stack.gap[rows], stack.r[rows]
        self.load = stack.load[rows] if stack.loaded else None
        self.resolution = stack.resolution[rows]
        self.propagator = Propagator(stack.omega[rows], stack.decay[rows])

    def take(self, keep: Index) -> _Part:
        return _Part(self.stack, self.rows[keep])

    def grown(self, q: Array, v: Array) -> BoolArray:
        """Where the bodies have gained energy since the start of the run."""
        s, rows = self.stack, self.rows
        square = self.propagator.square
        return growth(square, s.load[rows], s.q[rows], s.v[rows], ENERGY_GROWTH, self.beta)(q, v)

    def delta(self, q: Array) -> Array:
        return np.einsum("sj,sj->s", self.beta, q) - self.gap

    def free(self, q: Array, v: Array, t: Array) -> tuple[Array, Array]:
        P, S, W = self.propagator.motion(t)
        q1, v1 = P * q + S * v, W * v - self.propagator.square * S * q
        if self.load is not None:
            q1, v1 = q1 + self.propagator.step(t) * self.load, v1 + S * self.load
        return q1, v1

    def falling(self, q: Array, v: Array, force: Array, t: Array) -> tuple[Array, Array]:
        """States after `t` while the force falls linearly to 0."""
        P, S, W, J, R = self.propagator.responses(t)
        pull, t = self.beta * force[:, None], t[:, None]
        q1: Array = P * q + S * v - pull * (J - R / t)
        v1: Array = W * v - self.propagator.square * S * q - pull * (S - J / t)
        return (q1, v1) if self.load is None else (q1 + J * self.load, v1 + S * self.load)

    def ending(self, q: Array, v: Array, force: Array, t: Array) -> tuple[Array, Array]:
        """Indentation at the end of `falling`, and its derivative by `t`."""
        q1, v1 = self.falling(q, v, force, t)
        R = self.propagator.responses(t).R
        later = np.einsum("sj,sj->s", self.beta**2, R) * force / t**2
        return self.delta(q1), np.einsum("sj,sj->s", self.beta, v1) - later


class _Steps:
    """Coefficients of one step of length h (S,) for rows of a stack; `take` drops rows."""

    def __init__(self, part: _Part, h: Array) -> None:
        p, column = part.propagator, h[:, None]
        self.beta, self.gap = part.beta, part.gap
        self.P, self.S, self.W, J, R = p.responses(h)
        self.V = -p.square * self.S
        self.rise_q, self.rise_v = -part.beta * R / column, -part.beta * J / column
        self.fall_q = -part.beta * J - self.rise_q
        self.fall_v = -part.beta * self.S - self.rise_v
        self.push_q = None if part.load is None else J * part.load
        self.push_v = None if part.load is None else self.S * part.load
        self.alpha = part.r - np.einsum("sj,sj->s", part.beta, self.rise_q)

    def take(self, keep: Index) -> None:
        for name, value in vars(self).items():
            if value is not None:
                setattr(self, name, value[keep])

    def free(self, q: Array, v: Array, force: Array) -> tuple[Array, Array, Array]:
        """State and indentation after the step if the force fell to 0."""
        F = force[:, None]
        q1 = self.P * q
        q1 += self.S * v
        q1 += self.fall_q * F
        v1 = self.V * q
        v1 += self.W * v
        v1 += self.fall_v * F
        if self.push_q is not None and self.push_v is not None:
            q1, v1 = q1 + self.push_q, v1 + self.push_v
        return q1, v1, np.einsum("sj,sj->s", self.beta, q1) - self.gap


def run_many(
    stack: Stack, rows: Index, step: Array, max_contacts: int, max_steps: int
) -> list[Result]:
    """All events of the given rows, with one step each."""
    results = [Result() for _ in rows]
    size = rows.size
    q, v, t = stack.q[rows], stack.v[rows], np.zeros(size)
    end = stack.duration[rows]
    log = _Log(size)
    live = np.arange(size)
    while live.size:
        part = stack.part(rows[live])
        wait = _next_touch(part, q[live], v[live], end[live] - t[live], step[live] / 4)
        struck = np.isfinite(wait) & (t[live] + wait < end[live])
        live, wait = live[struck], wait[struck]
        if live.size == 0:
            break
        part = stack.part(rows[live])
        q[live], v[live] = part.free(q[live], v[live], wait)
        t[live] += wait
        rigid = np.where(part.propagator.omega == 0, part.beta, 0.0)
        closing = np.einsum("sj,sj->s", rigid, v[live])
        for i, speed in zip(live, closing, strict=True):
            if not results[i].contacts:
                results[i].closing = float(speed)
        parted = _contact(stack, rows, live, step, (q, v, t, end), log, results, max_steps)
        current = [results[i] for i in live]
        for result in current:
            result.full = result.full or len(result.contacts) >= max_contacts
        parting = np.einsum("sj,sj->s", rigid, v[live])
        for i, speed, out in zip(live, parting, parted, strict=True):
            results[i].parting, results[i].released = float(speed), bool(out)
        live = live[parted & np.array([not (r.full or r.diverged) for r in current])]
    log.fill(results)
    return results


class _Log:
    """Nodes of all scenes in the order of computation; sorted by scene at the end."""

    def __init__(self, size: int) -> None:
        self.size = size
        self.owner: list[Index] = []
        self.time: list[Array] = []
        self.force: list[Array] = []

    def add(self, owner: Index, time: Array, force: Array) -> None:
        self.owner.append(owner)
        self.time.append(time)
        self.force.append(force)

    def fill(self, results: list[Result]) -> None:
        if not self.owner:
            return
        owner = np.concatenate(self.owner)
        order = np.argsort(owner, kind="stable")
        bounds = np.searchsorted(owner[order], np.arange(self.size + 1))
        time, force = np.concatenate(self.time)[order], np.concatenate(self.force)[order]
        for i, result in enumerate(results):
            piece = slice(bounds[i], bounds[i + 1])
            result.time, result.force = time[piece], force[piece]


def _contact(
    stack: Stack,
    rows: Index,
    live: Index,
    step: Array,
    motion: tuple[Array, Array, Array, Array],
    log: _Log,
    results: list[Result],
    max_steps: int,
) -> BoolArray:
    """One contact of each active scene; short ones are repeated with smaller steps. True:
    released."""
    q, v, t, end = motion
    parted = np.zeros(live.size, dtype=bool)
    h = step[live].copy()
    coarse = h
    todo = np.arange(live.size)
    for depth in range(DEPTH + 1):
        who = live[todo]
        nodes = _Log(live.size)
        part = stack.part(rows[who])
        # done again at 1/8 of the step: should it not be over by now, go on as before
        until = (
            end[who] if depth == 0 else np.minimum(end[who], t[who] + LONGER * SHORT * coarse[todo])
        )
        out = _march(stack, part, (q[who], v[who], t[who], until), h[todo], nodes, max_steps)
        go_on = np.flatnonzero(~out.parted & (until < end[who]) & (out.count <= max_steps))
        if go_on.size:
            late = _Log(live.size)
            more = _march(
                stack,
                stack.part(part.rows[go_on]),
                (out.q[go_on], out.v[go_on], out.t[go_on], end[who][go_on]),
                coarse[todo][go_on],
                late,
                max_steps,
                out.force[go_on],
            )
            out.extend(go_on, more)
            for owner, time, force in zip(late.owner, late.time, late.force, strict=True):
                nodes.add(go_on[owner], time, force)
        for i, count in zip(who, out.count.tolist(), strict=True):
            results[i].work += count
            results[i].full |= count > max_steps
        short = out.parted & (out.t - t[who] <= SHORT * h[todo])
        short[go_on] = False
        again = short if depth < DEPTH else np.zeros(short.size, dtype=bool)
        done = ~again
        log.add(who[done], t[who[done]], np.zeros(int(done.sum())))
        owner = np.concatenate(nodes.owner)
        keep = done[owner]
        log.add(
            who[owner[keep]],
            np.concatenate(nodes.time)[keep],
            np.concatenate(nodes.force)[keep],
        )
        kept = who[done]
        spans = zip(t[kept].tolist(), out.t[done].tolist(), out.impulse[done].tolist(), strict=True)
        for i, span in zip(kept, spans, strict=True):
            results[i].contacts.append(span)
        q[kept], v[kept], t[kept] = out.q[done], out.v[done], out.t[done]
        parted[todo[done]] = out.parted[done]
        for i in who[done & (out.count <= max_steps) & part.grown(out.q, out.v)]:
            results[i].diverged = True
        todo = todo[again]
        if todo.size == 0:
            break
        coarse = h.copy()
        h[todo] = stack.clear(rows[live[todo]], h[todo] / 8)
    return parted


@dataclass(eq=False)
class _Outcome:
    """State at the end of a contact, its impulse and steps, and whether the bodies parted."""

    q: Array
    v: Array
    t: Array
    impulse: Array
    count: Index
    force: Array
    parted: BoolArray

    @classmethod
    def like(cls, q: Array, v: Array, t: Array) -> _Outcome:
        n = t.size
        zeros = np.zeros(n, dtype=np.intp)
        off = np.zeros(n, dtype=bool)
        return cls(q.copy(), v.copy(), t.copy(), np.zeros(n), zeros, np.zeros(n), off)

    def save(
        self, rows: Index, q: Array, v: Array, t: Any, impulse: Any, count: Any, force: Any
    ) -> None:
        self.q[rows], self.v[rows], self.t[rows] = q, v, t
        self.impulse[rows], self.count[rows], self.force[rows] = impulse, count, force

    def extend(self, rows: Index, more: _Outcome) -> None:
        """Go on from these rows with what came after."""
        self.q[rows], self.v[rows], self.t[rows] = more.q, more.v, more.t
        self.impulse[rows] = self.impulse[rows] + more.impulse
        self.count[rows] = self.count[rows] + more.count
        self.parted[rows] = more.parted


def _march(
    stack: Stack,
    part: _Part,
    start: tuple[Array, Array, Array, Array],
    h: Array,
    nodes: _Log,
    max_steps: int,
    force: Array | None = None,
) -> _Outcome:
    """Step until every scene has parted or reached its end."""
    q, v, t0, end = start
    size = t0.size
    out = _Outcome.like(q, v, t0)
    force = np.zeros(size) if force is None else force
    ids, previous = np.arange(size), force
    total = 0.5 * force  # of the forces, by the trapezoidal rule
    whole = ((end - t0) / h * (1 + 1e-12)).astype(np.intp)  # whole steps to the end of the run
    soonest = int(whole.min())
    last_force, last_h = np.zeros(size), h
    steps, implicit = _Steps(part, h), stack.implicit(part.rows)
    n = lonely = 0
    while ids.size and lonely < _LONG:
        lonely += ids.size <= _FEW
        n += 1
        near = None
        if n > soonest:  # the last step to the end of the run is shorter
            near = whole < n
            h = np.where(near, end - t0 - (n - 1) * h, h)
            steps = _Steps(stack.part(part.rows[ids]), h)
            t0 = np.where(near, end - n * h, t0)
            earlier = last_h[ids] / h * (total - 0.5 * force) + 0.5 * force
            total = np.where(near, earlier, total)
        q1, v1, trial = steps.free(q, v, force)
        guess = np.maximum(2 * force - previous, 0.5 * force)
        F1 = implicit.force(trial, steps.alpha, guess)
        leave = trial <= 0.0 if trial.min() <= 0.0 else None
        if leave is not None:
            g = ids[leave]
            t = t0[leave] + (n - 1) * h[leave]
            impulse = h[leave] * (total - 0.5 * force)[leave]
            out.save(g, q[leave], v[leave], t, impulse, n, 0.0)
            last_force[g], last_h = force[leave], _with(last_h, g, h[leave])
            out.parted[g] = True
        q1 += steps.rise_q * F1[:, None]
        v1 += steps.rise_v * F1[:, None]
        q, v, previous, force = q1, v1, force, F1
        total = total + F1
        t = t0 + n * h
        if leave is None:
            nodes.add(ids, t, F1)
        else:
            stay = np.flatnonzero(~leave)
            nodes.add(ids[stay], t[stay], F1[stay])
        if n >= soonest or n > max_steps:
            over = (end - t <= 1e-12 * end) | (n > max_steps)
            if leave is not None:
                over &= ~leave
            impulse = h * (total - 0.5 * force)
            out.save(ids[over], q[over], v[over], t[over], impulse[over], n, force[over])
            leave = over if leave is None else leave | over
        if leave is not None:
            keep = np.flatnonzero(~leave)
            ids, q, v, t0, end, h = ids[keep], q[keep], v[keep], t0[keep], end[keep], h[keep]
            previous, force, total, whole = previous[keep], force[keep], total[keep], whole[keep]
            soonest = int(whole.min(initial=max_steps))
            steps.take(keep)
            implicit.take(keep)
    _release(stack, part, out, last_force, last_h, nodes)
    for i in range(ids.size):  # quicker alone than side by side
        row = part.rows[ids[i]]
        problem = stack.problems[row]
        J = problem.omega.size
        phase = Exact(h[i], max_steps).resume(
            problem, t0[i] + n * h[i], q[i, :J], v[i, :J], (), end[i], h[i], float(force[i])
        )
        k = ids[i : i + 1]
        impulse = h[i] * (total[i] - 0.5 * force[i]) + sum(s.impulse for s in phase.segments)
        state = np.zeros((2, 1, q.shape[1]))
        state[0, 0, :J], state[1, 0, :J] = phase.q, phase.v
        last = float(phase.segments[-1].force[-1])
        out.save(k, state[0], state[1], phase.time, impulse, n + phase.evaluations, last)
        out.parted[k] = phase.released
        for segment in phase.segments:
            owner = np.full(segment.time.size - 1, ids[i])
            nodes.add(owner, segment.time[1:], segment.force[1:])
    return out


def _with(array: Array, rows: Index, values: Array) -> Array:
    """A copy of the array with some rows changed."""
    new = array.copy()
    new[rows] = values
    return new


def _release(stack: Stack, part: _Part, out: _Outcome, force: Array, h: Array, nodes: _Log) -> None:
    """The last step of the scenes that parted: delta falls to 0 as the force does."""
    g = np.flatnonzero(out.parted)
    if g.size == 0:
        return
    sub = stack.part(part.rows[g])
    q, v, f, h = out.q[g], out.v[g], force[g], h[g]

    def apart(t: Array) -> tuple[Array, Array]:
        delta, rate = sub.ending(q, v, f, t)
        return -delta, -rate

    length = _rising_root(apart, 1e-9 * h, h)
    out.q[g], out.v[g] = sub.falling(q, v, f, length)
    out.t[g] += length
    out.impulse[g] += 0.5 * length * f
    nodes.add(g, out.t[g], np.zeros(g.size))


def _next_touch(part: _Part, q: Array, v: Array, span: Array, fine: Array) -> Array:
    """As `flight.next_touch` for every row: the time of the first touch, inf if none."""
    p, size = part.propagator, np.abs(part.beta)
    elastic = p.omega > 0
    safe = np.where(elastic, p.omega, 1.0)
    load = np.zeros_like(q) if part.load is None else part.load
    swing = np.hypot(q - np.where(elastic, load / safe**2, 0.0), v / safe)
    amplitude = np.where(elastic, size * swing, 0.0)
    curvature = p.square + 2 * p.decay * p.omega
    bend = np.where(elastic, 0.0, size * (np.abs(load) + 2 * p.decay * np.abs(v))).sum(axis=1)

    def delta(rows: Index, t: Array) -> Array:
        sub = Propagator(p.omega[rows], p.decay[rows])
        P, S, _ = sub.motion(t)
        value = np.einsum("sj,sj->s", part.beta[rows], P * q[rows] + S * v[rows]) - part.gap[rows]
        if part.load is not None:
            push = sub.step(t) * load[rows]
            value = value + np.einsum("sj,sj->s", part.beta[rows], push)
        return value

    def missed(rows: Index, length: Array) -> Array:
        chord = np.minimum(2.0, curvature[rows] * (length**2 / 8)[:, None])
        return np.einsum("sj,sj->s", amplitude[rows], chord) + bend[rows] * length**2 / 8

    touch, left, right = np.full(span.size, np.inf), np.zeros(span.size), np.zeros(span.size)
    found = np.zeros(span.size, dtype=bool)
    # receding: delta <= speed t + bound t^2/2 stays below 0 for a while
    speed = np.einsum("sj,sj->s", part.beta, v)
    bound = np.einsum("sj,sj->s", amplitude, curvature) + bend
    a = np.where(speed < 0, np.minimum(-speed / np.maximum(bound, 1e-300), span), 0.0)
    at = delta(np.arange(span.size), a)
    touch[(at >= 0) & (speed > 0)] = 0.0
    rows = np.flatnonzero((a < span) & (touch > 0))
    a, at, length = a[rows], np.minimum(at[rows], 0.0), span[rows] / 32
    while rows.size:
        b = np.minimum(a + length, span[rows])
        reach = b - a
        ahead = delta(rows, b)
        slack = missed(rows, reach)
        clear = (ahead <= 0) & (np.maximum(at, ahead) + slack <= part.resolution[rows])
        hit = (ahead > 0) & ((reach <= fine[rows]) | (slack <= part.resolution[rows]))
        skip = ~clear & ~hit & (reach <= fine[rows] / 16)
        found[rows[hit]] = True
        left[rows[hit]], right[rows[hit]] = a[hit], b[hit]
        touch[rows[hit & (at >= 0)]] = a[hit & (at >= 0)]
        on = clear | skip
        length = np.where(on, 2 * length, reach / 4)
        a, at = np.where(on, b, a), np.where(on, ahead, at)
        keep = ~hit & (a < span[rows])
        rows, a, at, length = rows[keep], a[keep], at[keep], length[keep]
    todo = np.flatnonzero(found & np.isinf(touch))
    if todo.size:
        sub, q, v = part.take(todo), q[todo], v[todo]

        def motion(t: Array) -> tuple[Array, Array]:
            q1, v1 = sub.free(q, v, t)
            return sub.delta(q1), np.einsum("sj,sj->s", sub.beta, v1)

        touch[todo] = _rising_root(motion, left[todo], right[todo])
    return touch


def _rising_root(f: Callable[[Array], tuple[Array, Array]], low: Array, high: Array) -> Array:
    """`integrators.root.rising_root` for every row, from where the chord meets 0."""
    at_low, at_high = f(low)[0], f(high)[0]
    inside = (at_low < 0) & (at_high > 0)
    t = np.where(at_low < 0, high, low)
    t[inside] = (low - at_low * (high - low) / (at_high - at_low))[inside]
    close = NEWTON_SETTLED * (high - low)
    before = last = high - low
    done = ~inside
    while not done.all():
        value, slope = f(t)
        low, high = np.where(value > 0, low, t), np.where(value > 0, t, high)
        newton = t - value / np.where(slope > 0, slope, np.inf)
        good = (low <= newton) & (newton <= high) & (np.abs(newton - t) <= 0.5 * before)
        good &= slope > 0
        new = np.where(good, newton, 0.5 * (low + high))
        new = np.where(done, t, new)
        move = np.abs(new - t)
        done |= np.where(good, move <= close, (new == low) | (new == high))
        before, last, t = last, move, new
    return t
