"""The contact forces of a step, at its middle and its end, that meet the laws and friction."""

from __future__ import annotations

from math import inf, sqrt
from typing import Any

import numpy as np

from .compiling import COMPILED, compiled
from .curves import curve
from .layout import (
    APART,
    BACK,
    BEND,
    CONTACTS,
    CUT,
    F1,
    F2,
    F3,
    F4,
    FORCE,
    FORCE_SCALE,
    FORWARD,
    I1,
    SLOPE,
    STATE,
    WORK,
)

SWEEPS, NEWTON = 12, 40
SQUARED = 1e-7  # of the forces: Newton's correction after which none is needed


@compiled(f"UniTuple(float64, 2)(int64, int64, {F4}, {F2}, {F2})")
def felt(stage: int, i: int, share: Any, base: Any, F: Any) -> Any:
    """Indentation and rate of row i at h/2 (stage 0) or h (stage 1) under the forces F."""
    delta, rate = base[2 * stage, i], base[2 * stage + 1, i]
    for j in range(F.shape[1]):
        delta -= share[2 * stage, 1, i, j] * F[1, j] + share[2 * stage, 2, i, j] * F[2, j]
        rate -= share[2 * stage + 1, 1, i, j] * F[1, j] + share[2 * stage + 1, 2, i, j] * F[2, j]
    return delta, rate


@compiled(f"float64(int64, int64, {F4}, {F2}, {F2}, {CONTACTS}, {F3})")
def rub(stage: int, c: int, share: Any, base: Any, F: Any, contacts: Any, anchor: Any) -> float:
    """Friction of one contact by a spring that slides; by how much the force changed."""
    _, _, slip, tangents, _ = contacts
    first, count = tangents[c, 0], tangents[c, 1]
    stiffness = slip[c, 1]
    one, two = F[stage + 1, first], F[stage + 1, first + count - 1]
    total = 0.0
    for r in range(count):
        i = first + r
        way = felt(stage, i, share, base, F)[0]
        held = share[2 * stage, stage + 1, i, i]
        stuck = stiffness * (way - anchor[stage, c, r])
        anchor[stage + 1, c, r] = way + held * F[stage + 1, i]  # the way without this force
        F[stage + 1, i] -= (F[stage + 1, i] - stuck) / (1.0 + stiffness * held)
        total += F[stage + 1, i] ** 2
    most = slip[c, 0] * max(F[stage + 1, c], 0.0)
    ratio = most / sqrt(total) if total > most * most else 1.0
    for r in range(count):
        i = first + r
        F[stage + 1, i] *= ratio
        held = share[2 * stage, stage + 1, i, i]
        anchor[stage + 1, c, r] -= F[stage + 1, i] * (held + 1.0 / stiffness)
    return max(abs(F[stage + 1, first] - one), abs(F[stage + 1, first + count - 1] - two))


@compiled(f"boolean({F2}, {F1})")
def eliminate(A: Any, b: Any) -> bool:
    """Solve A x = b in place by elimination with pivots; x into b."""
    n = b.size
    for k in range(n):
        best = k
        for i in range(k + 1, n):
            if abs(A[i, k]) > abs(A[best, k]):
                best = i
        if not abs(A[best, k]) > 1e-300:
            return False
        if best != k:
            for j in range(n):
                A[k, j], A[best, j] = A[best, j], A[k, j]
            b[k], b[best] = b[best], b[k]
        for i in range(k + 1, n):
            f = A[i, k] / A[k, k]
            if f != 0.0:
                for j in range(k, n):
                    A[i, j] -= f * A[k, j]
                b[i] -= f * b[k]
    for i in range(n - 1, -1, -1):
        for j in range(i + 1, n):
            b[i] -= A[i, j] * b[j]
        b[i] /= A[i, i]
    return True


@compiled(f"boolean({F4}, {F2}, {F2}, {CONTACTS}, {I1}, {F2})", allocates=True)
def together(share: Any, base: Any, F: Any, contacts: Any, mode: Any, s: Any) -> bool:
    """One step of Newton's method for all normal forces of both stages, shortened if need be."""
    kinds, params, _, _, _ = contacts
    p = len(kinds)
    active = np.empty(p, dtype=np.int64)
    n = 0
    for c in range(p):
        if mode[c] == FORWARD or mode[c] == BACK:
            active[n] = c
            n += 1
    A, g = np.zeros((2 * n, 2 * n)), np.zeros(2 * n)
    start, best, length = F.copy(), inf, 1.0
    for attempt in range(12):
        norm, size = 0.0, 0.0
        for stage in range(2):
            for i in range(n):
                c = active[i]
                delta, rate = felt(stage, c, share, base, F)
                f, by_delta, by_rate = curve(kinds[c], mode[c], delta, rate, params[c], s[c])
                k = stage * n + i
                norm += (F[stage + 1, c] - f) ** 2
                size += F[stage + 1, c] ** 2
                if attempt == 0:
                    g[k] = F[stage + 1, c] - f
                    for other in range(2):
                        for j in range(n):
                            A[k, other * n + j] = (
                                by_delta * share[2 * stage, other + 1, c, active[j]]
                                + by_rate * share[2 * stage + 1, other + 1, c, active[j]]
                            )
                    A[k, k] += 1.0
        if attempt == 0:
            best = norm
            if norm <= 1e-28 * size:
                return True
            if not eliminate(A, g):
                return False
        elif norm < best:
            return True
        else:
            length *= 0.5
        for stage in range(2):
            for i in range(n):
                c = active[i]
                F[stage + 1, c] = start[stage + 1, c] - length * g[stage * n + i]
    F[:] = start
    return best <= 1e-20 * size  # what is left is rounding


@compiled(f"boolean(float64, {CONTACTS}, {STATE}, {F4}, {F2}, {WORK})", inline=True)
def alone(h: float, contacts: Any, state: Any, share: Any, free: Any, work: Any) -> bool:
    """`attempt` for one contact without friction: Newton's method for its two forces at once."""
    kinds, params, _, _, _ = contacts
    clock, row, mode, s = state[0], state[3], state[4][0], state[5][0]
    F, motion = work[0], work[2]
    kind, par, scale = kinds[0], params[0], clock[FORCE_SCALE]
    if COMPILED:
        a10, a11, a12 = share[0, 0, 0, 0], share[0, 1, 0, 0], share[0, 2, 0, 0]
        b10, b11, b12 = share[1, 0, 0, 0], share[1, 1, 0, 0], share[1, 2, 0, 0]
        a20, a21, a22 = share[2, 0, 0, 0], share[2, 1, 0, 0], share[2, 2, 0, 0]
        b20, b21, b22 = share[3, 0, 0, 0], share[3, 1, 0, 0], share[3, 2, 0, 0]
        d1, v1, d2, v2 = free[0, 0], free[1, 0], free[2, 0], free[3, 0]
        f0, slope, bend = row[FORCE, 0], row[SLOPE, 0], row[BEND, 0]
    else:  # numbers of Python are quicker than those of NumPy
        a10, a11, a12, b10, b11, b12, a20, a21, a22, b20, b21, b22 = share.ravel().tolist()
        d1, v1, d2, v2 = free.ravel().tolist()
        f0, _, slope, bend = row[:4, 0].tolist()
        h, kind, mode, scale = float(h), int(kind), int(mode), float(scale)
        par, s = par.tolist(), s.tolist()
    d1, v1, d2, v2 = d1 - a10 * f0, v1 - b10 * f0, d2 - a20 * f0, v2 - b20 * f0
    f1, f2 = 0.0, 0.0
    pressed = mode in (FORWARD, BACK)
    if pressed:  # a first guess on the last parabola
        f1 = f0 + 0.5 * h * (slope + 0.25 * h * bend)
        f2 = f0 + h * (slope + 0.5 * h * bend)
    close = not pressed
    x1, y1, x2, y2 = d1, v1, d2, v2
    for tries in range(SWEEPS):
        x1, y1 = d1 - a11 * f1 - a12 * f2, v1 - b11 * f1 - b12 * f2
        x2, y2 = d2 - a21 * f1 - a22 * f2, v2 - b21 * f1 - b22 * f2
        if close:
            F[0, 0], F[1, 0], F[2, 0] = f0, f1, f2
            motion[0, 0], motion[1, 0], motion[2, 0], motion[3, 0] = x1, y1, x2, y2
            return True
        g1, k1, c1 = curve(kind, mode, x1, y1, par, s)
        g2, k2, c2 = curve(kind, mode, x2, y2, par, s)
        j11, j12 = 1.0 + k1 * a11 + c1 * b11, k1 * a12 + c1 * b12
        j21, j22 = k2 * a21 + c2 * b21, 1.0 + k2 * a22 + c2 * b22
        det = j11 * j22 - j12 * j21
        if not abs(det) > 1e-300:
            return False
        r1, r2 = f1 - g1, f2 - g2
        e1, e2 = (r1 * j22 - r2 * j12) / det, (r2 * j11 - r1 * j21) / det
        size, far = max(1e-3 * scale, abs(f1), abs(f2)), max(abs(e1), abs(e2))
        close = far <= SQUARED * size  # what the correction leaves is its square
        if tries > 2 and not close:
            noise = max(k1 * abs(d1) / max(j11, 1.0), k2 * abs(d2) / max(j22, 1.0))
            close = far <= 1e-15 * noise
        f1, f2 = f1 - e1, f2 - e2
        if not abs(f1) + abs(f2) < 1e300:
            return False
    return False


@compiled(f"boolean({F4}, {F2}, {F2}, {F2}, {CONTACTS}, {I1}, {F2}, {F3}, float64)")
def solve(
    share: Any,
    base: Any,
    F: Any,
    motion: Any,
    contacts: Any,
    mode: Any,
    s: Any,
    anchor: Any,
    scale: float,
) -> bool:
    """Forces F (3, m) at the nodes 0, h/2, h that meet laws and friction; F[0] is given.

    base (4, m): indentation and rate at h/2, then at h, that F[0] alone leaves; motion (4, m): the
    same with all forces. Gauss and Seidel's sweeps, each force by Newton's method on its own law;
    the whole system by Newton's method where they do not converge.
    """
    kinds, params, _, tangents, _ = contacts
    p = len(kinds)
    for sweep in range(SWEEPS + NEWTON):
        if sweep == SWEEPS:  # the sweeps may have led away
            for c in range(p):
                F[1, c], F[2, c] = F[0, c], F[0, c]
        if sweep >= SWEEPS and not together(share, base, F, contacts, mode, s):
            return False
        change, size, noise = 0.0, 1e-3 * scale, 0.0
        for stage in range(2):
            for c in range(p):
                if mode[c] == APART or mode[c] == CUT:
                    F[stage + 1, c] = 0.0
                    for r in range(tangents[c, 1]):
                        F[stage + 1, tangents[c, 0] + r] = 0.0
                    continue
                delta, rate = felt(stage, c, share, base, F)
                old = F[stage + 1, c]
                f, by_delta, by_rate = curve(kinds[c], mode[c], delta, rate, params[c], s[c])
                a = share[2 * stage, stage + 1, c, c]
                b = share[2 * stage + 1, stage + 1, c, c]
                grip = 1.0 + max(a * by_delta + b * by_rate, 0.0)
                new = old - (old - f) / grip
                noise = max(noise, 1e-15 * by_delta / grip * abs(base[2 * stage, c]))
                if sweep < SWEEPS:
                    F[stage + 1, c] = new
                change = max(change, abs(new - old))
                size = max(size, abs(new))
                if tangents[c, 1] > 0:
                    change = max(change, rub(stage, c, share, base, F, contacts, anchor))
        total = 0.0
        for i in range(F.shape[1]):
            total += abs(F[1, i]) + abs(F[2, i])
        if not total + change < 1e300:
            return False
        if change <= 1e-12 * size + noise:
            for stage in range(2):
                for i in range(F.shape[1]):
                    delta, rate = felt(stage, i, share, base, F)
                    motion[2 * stage, i], motion[2 * stage + 1, i] = delta, rate
            return True
    return False
