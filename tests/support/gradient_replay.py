"""The steps of a run of one contact once more, in complex numbers: derivatives by complex steps.

Written from the equations in csrc/antiosc_march.h alone; responses by the matrix exponential.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
from numpy.polynomial.polynomial import polyval
from scipy.linalg import expm

import law_formulas
from antiosc.engine import library
from antiosc.engine.march import Run

LOW, HIGH, SLOW, FAST = range(4)
FULLY = 84.0


@dataclass
class Inputs:
    """All numbers of a system of one contact; `law`: its parameters as the library has them.

    `gamma`, `drive`: of modes whose rate counts too; 0 of others.
    """

    omega: np.ndarray
    decay: np.ndarray
    beta: np.ndarray
    load: np.ndarray
    q: np.ndarray
    v: np.ndarray
    R: complex
    gap: complex
    law: np.ndarray
    kind: int
    slowest: float = 0.0
    gamma: Any = 0.0
    drive: Any = 0.0

    def __post_init__(self) -> None:
        self.gamma = self.gamma + np.zeros(self.omega.size)
        self.drive = self.drive + np.zeros(self.omega.size)

    @property
    def by_rate(self) -> np.ndarray:
        """What the rates v have of the rate of the indentation, and a force of v'."""
        return self.beta - 2 * self.decay * self.gamma

    def rates(self, q: np.ndarray, v: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """q' and v' under the loads."""
        way = v + self.drive
        return way, self.load - 2 * self.decay * way - self.omega**2 * q

    def rate(self, q: np.ndarray, v: np.ndarray) -> complex:
        """The rate of the indentation under the loads."""
        way, turn = self.rates(q, v)
        return self.beta @ way + self.gamma @ turn


@dataclass
class Steps:
    """What `replay` returns: the end state, times (n + 1,) of the edges, forces (2 n + 1,)."""

    q: np.ndarray
    v: np.ndarray
    time: list[complex] = field(default_factory=list)
    force: list[complex] = field(default_factory=list)


Tables = Callable[[complex], np.ndarray]


def _tables(s: Inputs) -> Tables:
    """Of t: (J, 2, 8), q and v after t by q0, v0, by 1, t, t^2/2 in v' and in q'; kept."""
    kept: dict[str, np.ndarray] = {}

    def of(t: complex) -> np.ndarray:
        name = f"{t.real:.11e} {t.imag:.17e}"  # times are differences
        if name not in kept:
            kept[name] = np.array(
                [_responses(w, d, t) for w, d in zip(s.omega, s.decay, strict=True)]
            )
        return kept[name]

    return of


def _responses(omega: complex, decay: complex, t: complex) -> np.ndarray:
    A = np.zeros((8, 8), dtype=complex)
    A[0, 1] = A[1, 2] = A[2, 3] = A[3, 4] = A[0, 5] = A[5, 6] = A[6, 7] = 1.0
    A[1, 0], A[1, 1] = -(omega**2), -2 * decay
    scale = t.real ** np.array([0, 1, 2, 3, 4, 1, 2, 3])  # in units of the step
    return (expm(A * t * np.outer(1 / scale, scale)) / np.outer(1 / scale, scale))[:2]


def _mixed(name: str, p: np.ndarray) -> np.ndarray:
    more = np.array(law_formulas.numbers_of(f"{name}_ELASTIC"))
    return np.array(law_formulas.numbers_of(name)) + p[2] * more


def _loading(kind: int, p: np.ndarray, d: complex) -> complex:
    if kind == library.TABLE:
        return _cubic(p[5:], int(p[2].real), d)
    k, y = p[0], p[1]
    if kind == library.THORNTON and d.real > y.real:
        return k * np.sqrt(y) * (1.5 * d - 0.5 * y)
    if kind == library.STRONGE and d.real > y.real:
        s = 2 * d / y - 1
        return k * y**1.5 * s * (1 + np.log(s if s.real < 2 * FULLY - 1 else 2 * FULLY - 1) / 3.3)
    if kind == library.ELASTIC_PLASTIC and d.real > y.real:
        return k * y**0.5 * d * polyval((y / d) ** 0.25, _mixed("PRESSING", p))
    return k * d**1.5


def _cubic(x: np.ndarray, n: int, at: complex) -> complex:
    if at.real >= x[n - 1].real:
        return x[5 * n] + x[5 * n + 1] * (at - x[n - 1])
    i = max(int(np.searchsorted(x[:n].real, at.real, side="right")) - 1, 0)
    d = at - x[i]
    return ((x[n + i] * d + x[2 * n + i]) * d + x[3 * n + i]) * d + x[4 * n + i]


def _permanent(kind: int, p: np.ndarray, m: complex) -> complex:
    y = p[1]
    if kind == library.TABLE:
        return y * m
    if m.real <= y.real:
        return 0j
    if kind == library.THORNTON:
        return m * (1 - _loading(kind, p, m) / (p[0] * m**1.5))
    if kind == library.YANG_SUN:
        return m * (1 - (y / m) ** 0.4)
    if kind == library.TAN_SUN:
        return p[2] * (m - y)
    if kind == library.ELASTIC_PLASTIC:
        root = (y / m) ** 0.25
        return m * (1 - root**2 * polyval(root, _mixed("RECOVERY", p)))
    s = 2 * m / y - 1
    a = s if s.real < 2 * FULLY - 1 else 2 * FULLY - 1 + 0j
    work = (a * a - 1) / 4 + (a * a * (2 * np.log(a) - 1) + 1) / (8 * 3.3)
    if s.real > a.real:
        work += (s * s - a * a) / 4 * (1 + np.log(a) / 3.3)
    whole = 0.4 * p[0] * y**2.5 + p[0] * y**2.5 * work
    lossless, printed = m - 2.5 * whole / _loading(kind, p, m), m - y * np.sqrt(s)
    return printed if printed.real > lossless.real else lossless


def _shape(kind: int, p: np.ndarray, x: complex, back: bool, deepest: complex) -> complex:
    if kind == library.TABLE:
        return _cubic(p[int(p[4].real) :], int(p[3].real), x)
    if kind == library.ELASTIC_PLASTIC and deepest.real > p[1].real:
        return np.exp((1.25 + 0.25 * np.sqrt(p[1] / deepest)) * np.log(x))
    return x ** (2.5 if back and kind in (library.YANG_SUN, library.TAN_SUN) else 1.5)


def force(s: Inputs, branch: int, d: complex, rate: complex, memory: np.ndarray) -> complex:
    """Force of a branch of a law."""
    kind, p = s.kind, s.law
    if branch not in (library.FORWARD, library.BACK):
        return 0j
    if kind == library.LINEAR:
        return p[0] * d
    if d.real <= (-1e-8 if kind == library.TABLE else 0):  # a table's curve has a kink at 0
        return 0j
    if kind == library.HERTZ and p[1].real > 0:
        root = (p[0] ** 2 * d**3) ** (1 / 6) + 0j  # of F^(1/3)
        a = p[0] ** (-2 / 3)
        for _ in range(60):
            root -= ((a - p[1] * root) * root**2 - d) / ((2 * a - 3 * p[1] * root) * root)
        return root**3
    if kind in (library.HERTZ, library.POWER, library.DAMPED):
        n = 1.5 if kind == library.HERTZ else p[1]
        whole = p[0] * np.exp(n * np.log(d))
        return whole * (1 + memory[0] * rate) if kind == library.DAMPED else whole
    deepest, turn = memory[:2]
    elastic = kind == library.TABLE and p[0] == 1
    if branch == library.FORWARD and (elastic or d.real >= deepest.real):
        return _loading(kind, p, d)
    low = _permanent(kind, p, deepest)
    if d.real <= low.real:
        return 0j
    top, start = _loading(kind, p, deepest), deepest
    if branch == library.BACK and turn.real < deepest.real:
        top *= _shape(kind, p, (turn - low) / (deepest - low), False, deepest)
        start = turn
    return top * _shape(kind, p, (d - low) / (start - low), branch == library.BACK, deepest)


def _remembers(kind: int) -> bool:
    return library.THORNTON <= kind <= library.TABLE


def _bound(s: Inputs, branch: int, exit: int, memory: np.ndarray) -> complex:
    """Indentation or rate at which a branch ends."""
    if exit >= SLOW:
        return -1 / memory[0] if s.kind == library.DAMPED else 0j
    if not _remembers(s.kind):
        return 0j
    if exit == LOW or branch == library.APART:
        return _permanent(s.kind, s.law, memory[0]) if memory[0].real > 0 else 0j
    if branch == library.BACK:
        return memory[1]
    if memory[2].real < memory[0].real:
        return memory[0]
    y = s.law[1]
    return y if memory[2].real < y.real else FULLY * y


def _remembered(
    s: Inputs, row: np.ndarray, d: complex, rate: complex, before: np.ndarray
) -> np.ndarray:
    """What a contact remembers after an exit."""
    after = before.copy()
    after[2] = row[12]
    exit, branch = int(row[2]), int(row[5])
    if s.kind == library.DAMPED and branch == library.APART:
        speed = rate if rate.real > s.slowest else s.slowest + 0j
        after[1] = max(speed, before[1], key=np.real)
        after[0] = s.law[2] / max(speed, 0.01 * after[1], key=np.real)
    elif _remembers(s.kind) and branch == library.APART:
        after[1] = before[0] if int(row[9]) == library.BACK else 0j
    elif _remembers(s.kind):
        if exit == SLOW:
            after[1] = d
        if row[10] > row[6]:
            after[0] = d
    return after


def replay(s: Inputs, run: Run) -> Steps:
    """The steps of the run, those that a contact ends with their own lengths."""
    assert run.exits is not None
    edges, tables = run.time[::2], _tables(s)
    n, q, v, f0 = edges.size - 1, s.q.astype(complex), s.v.astype(complex), 0j
    branch, memory = library.APART, np.zeros(3, dtype=complex)
    out, t, exits = Steps(q, v, [0j], [0j]), 0j, list(run.exits)
    at_end, before = (0j, 0j), None
    for k in range(n + 1):
        d, rate = s.beta @ q + s.gamma @ v - s.gap - s.R * f0, s.rate(q, v)
        if k > 0:
            d, rate = at_end
        while exits and int(exits[0][0]) == k:
            row, before = exits.pop(0), None
            if int(row[3]) == 2:  # a flight of no length before the touch
                extra = (_bound(s, branch, HIGH, memory) - d) / rate
                way, turn = s.rates(q, v)
                extra = 1j * extra.imag
                q, v, t = q + extra * way, v + extra * turn, t + extra
                d, rate = s.beta @ q + s.gamma @ v - s.gap, s.rate(q, v)
                out.time[-1] = t
            memory = _remembered(s, row, d, rate, memory)
            branch = int(row[9])
            if branch not in (library.FORWARD, library.BACK):
                f0 = 0j
        if k == n:
            break
        ended = next((row for row in exits if int(row[0]) == k + 1 and int(row[3]) == 1), None)
        h = complex(edges[k + 1] - edges[k])
        if ended is None and k == n - 1:
            h = edges[-1] - t
        forces = run.force[2 * k + 1 : 2 * k + 3, 0].astype(complex)
        if ended is None:
            forces, state, motion = _solved(s, tables, h, q, v, f0, forces, branch, memory, before)
        else:
            which, given = int(int(ended[2]) >= SLOW), (q, v, f0, forces, branch, memory, before)
            ahead, behind = (
                _solved(s, tables, h * (1 + e), *given)[2][which] for e in (1e-5, -1e-5)
            )
            for tries in range(3):
                forces, state, motion = _solved(s, tables, h, *given)
                g = motion[which] - _bound(s, branch, int(ended[2]), memory)
                if tries == 0:
                    target = g.real  # how far the run itself was off
                h -= (g - target) * 2e-5 * h.real / (ahead - behind)
        before = (f0 - 4 * forces[0] + 3 * forces[1]) / h
        q, v, f0, t = state[0], state[1], forces[1], t + h
        at_end = motion
        out.time.append(t)
        out.force += list(forces)
    out.q, out.v = q, v
    return out


def _solved(
    s: Inputs,
    tables: Tables,
    h: complex,
    q: np.ndarray,
    v: np.ndarray,
    f0: complex,
    forces: np.ndarray,
    branch: int,
    memory: np.ndarray,
    before: complex | None,
) -> tuple[np.ndarray, np.ndarray, tuple[complex, complex]]:
    """Forces at h/2 and h that meet the law, the state at the end, indentation and rate there.

    `before`: the slope of the force at the end of the last step, which the rate at h/2 takes.
    """
    to_parabola = np.array([[1, 0, 0], [-3 / h, 4 / h, -1 / h], [4 / h**2, -8 / h**2, 4 / h**2]])
    slopes = np.array([[-1, 0, 1], [1, -4, 3]]) / h
    if before is not None:
        slopes[0] += np.array([-3, 4, -1]) / (4 * h)
    start = np.stack([q, v, s.load - 2 * s.decay * s.drive], axis=1)
    base, by = np.empty((2, 2), dtype=complex), np.empty((2, 2, 3), dtype=complex)
    for stage in range(2):
        T = tables(0.5 * h * (1 + stage))
        free = np.einsum("jak,jk->aj", T[:, :, :3], start) + T[:, :, 5].T * s.drive
        pushed = -np.einsum("jak,j->akj", T[:, :, 2:5], s.by_rate)
        pushed -= np.einsum("jak,j->akj", T[:, :, 5:], s.gamma)
        base[stage] = s.beta @ free[0] + s.gamma @ free[1] - s.gap, s.rate(*free)
        t, jump = 0.5 * h * (1 + stage), -(s.beta + s.by_rate) @ s.gamma
        at_once = jump * np.array([1, t, t**2 / 2])
        by[stage, 0] = (pushed[0] @ s.beta + pushed[1] @ s.gamma) @ to_parabola
        turned = pushed[1] @ s.by_rate - pushed[0] @ (s.omega**2 * s.gamma)
        by[stage, 1] = (turned + at_once) @ to_parabola
        by[stage, 0, 1 + stage] -= s.R
        by[stage, 1] -= s.R * slopes[stage]
    base[0, 1] += 0 if before is None else s.R * before / 4
    f = np.array([f0, *forces])
    for _ in range(4 if branch in (library.FORWARD, library.BACK) else 0):
        rest, slope = np.empty(2, dtype=complex), np.empty((2, 2), dtype=complex)
        for stage in range(2):
            d, rate = base[stage] + by[stage] @ f
            at = force(s, branch, d, rate, memory)
            step = 1e-6 * abs(d), 1e-6 * (abs(rate) + 1e-9)
            by_d = (force(s, branch, d + step[0], rate, memory) - at) / step[0]
            by_rate = (force(s, branch, d, rate + step[1], memory) - at) / step[1]
            rest[stage] = f[1 + stage] - at
            slope[stage] = -(by_d * by[stage, 0, 1:] + by_rate * by[stage, 1, 1:])
            slope[stage, stage] += 1
        f[1:] -= np.linalg.solve(slope, rest)
    if branch not in (library.FORWARD, library.BACK):
        f[1:] = 0
    state = free + np.einsum("akj,k->aj", pushed, to_parabola @ f)
    d, rate = base[1] + by[1] @ f
    return f[1:], state, (d, rate)


def derivative(
    s: Inputs, run: Run, along: dict[str, Any], goal: Callable[[Steps], complex]
) -> float:
    """Derivative of a goal along changes of the inputs, name -> change."""
    changed = {name: getattr(s, name) + 1e-30j * change for name, change in along.items()}
    return goal(replay(replace(s, **changed), run)).imag / 1e-30
