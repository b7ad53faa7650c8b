"""What a step of some length needs of the modes, found once for all steps of this length."""

from __future__ import annotations

from typing import Any

import numpy as np

from .compiling import COMPILED, compiled
from .layout import F1, F2, F3, F4, F5, MODES, TABLES
from .responses import dot, dot3, multiply, response, responses, responses_twice, subtract, turn


@compiled(f"void(int64, int64, float64, {F1}, {F1}, {F2}, {F3}, {F5})")
def fill(
    slot: int, slots: int, t: float, omega: Any, decay: Any, beta: Any, table: Any, rows: Any
) -> None:
    """Responses after a time t, and the rows that give indentation and rate from (q, v).

    Of one or two slots; the second is for half the time.
    """
    if COMPILED:
        if slots == 1:
            responses(omega, decay, t, table[slot])
        else:
            responses_twice(omega, decay, t, table[slot], table[slot + 1])
        for each in range(slot, slot + slots):
            P, W, S = table[each, 0], table[each, 1], table[each, 2]
            for i in range(beta.shape[0]):
                multiply(1.0, beta[i], P, rows[each, 0, i, 0])
                multiply(1.0, beta[i], S, rows[each, 0, i, 1])
                multiply(1.0, beta[i], W, rows[each, 1, i, 1])
                multiply(-1.0, omega, omega, rows[each, 1, i, 0])
                multiply(1.0, rows[each, 1, i, 0], rows[each, 0, i, 1], rows[each, 1, i, 0])
    else:
        times, damped = np.array([[t], [0.5 * t]])[:slots], bool(np.any(decay))
        found = np.array(response(omega, decay, times, damped))  # (6, slots, J)
        table[slot : slot + slots] = found.transpose(1, 0, 2)
        P, W, S = found[:3, :, None, :]
        to = rows[slot : slot + slots]
        to[:, 0, :, 0], to[:, 0, :, 1], to[:, 1, :, 1] = beta * P, beta * S, beta * W
        to[:, 1, :, 0] = -(omega * omega) * to[:, 0, :, 1]


@compiled(f"void(int64, {F1}, {F2}, {F3}, {F4})")
def moves(slot: int, omega: Any, beta: Any, table: Any, move: Any) -> None:
    """What takes (q, v) over a step: (P, W), (S, -omega^2 S), and what forces of each row add.

    The latter are for values, slopes and curvatures of the forces at the step's start.
    """
    m = beta.shape[0]
    if COMPILED:
        for n in range(omega.size):
            move[slot, 0, 0, n], move[slot, 0, 1, n] = table[slot, 0, n], table[slot, 1, n]
            move[slot, 1, 0, n] = table[slot, 2, n]
            move[slot, 1, 1, n] = -omega[n] * omega[n] * table[slot, 2, n]
        for k in range(3):
            for i in range(m):
                multiply(1.0, beta[i], table[slot, 3 + k], move[slot, 2 + k * m + i, 0])
                multiply(1.0, beta[i], table[slot, 2 + k], move[slot, 2 + k * m + i, 1])
    else:
        to = move[slot]
        to[0], to[1, 0] = table[slot, :2], table[slot, 2]
        to[1, 1] = -(omega * omega) * table[slot, 2]
        by_force = to[2:].reshape(3, m, 2, omega.size)
        by_force[:, :, 0] = table[slot, 3:, None] * beta
        by_force[:, :, 1] = table[slot, 2:5, None] * beta


@compiled(f"void({F2}, {F2}, {F3})")
def compliances(table: Any, beta: Any, out: Any) -> None:
    """beta S beta^T, beta J0 beta^T, beta J1 beta^T, beta J2 beta^T into out (4, m, m)."""
    for k in range(4):
        if COMPILED:
            for i in range(beta.shape[0]):
                for j in range(i + 1):
                    out[k, i, j] = dot3(beta[i], beta[j], table[2 + k])
                    out[k, j, i] = out[k, i, j]
        else:
            out[k] = (beta * table[2 + k]) @ beta.T


@compiled(f"void(int64, float64, {F3}, {F3}, {F2}, boolean, {F5})")
def pair(slot: int, h: float, half: Any, whole: Any, R: Any, rated: bool, share: Any) -> None:
    """How the forces at 0, h/2, h hold back the indentations and rates at h/2 and h.

    share[slot][2 stage + (0: indentation, 1: rate), node] is (m, m). The rate of what has no mass,
    -R F', is that of the parabola; backward differences where a law depends on the rate (`rated`):
    there it relaxes, the faster the less the contact is closed, and only they damp that out.
    """
    for stage in range(2):
        K = half if stage == 0 else whole
        for k in range(2):
            to = share[slot, 2 * stage + k]
            for i in range(R.shape[0]):
                for j in range(R.shape[0]):
                    one, two = K[2 - k, i, j] / h, K[3 - k, i, j] / (h * h)
                    to[0, i, j] = K[1 - k, i, j] - 3.0 * one + 4.0 * two
                    to[1, i, j] = 4.0 * one - 8.0 * two
                    to[2, i, j] = 4.0 * two - one
    for i in range(R.shape[0]):
        for j in range(R.shape[0]):
            r = R[i, j]
            share[slot, 0, 1, i, j] += r
            share[slot, 2, 2, i, j] += r
            if rated:
                share[slot, 1, 0, i, j] -= 2.0 * r / h
                share[slot, 1, 1, i, j] += 2.0 * r / h
                share[slot, 3, 1, i, j] -= 2.0 * r / h
                share[slot, 3, 2, i, j] += 2.0 * r / h
            else:
                share[slot, 1, 0, i, j] -= r / h
                share[slot, 1, 2, i, j] += r / h
                share[slot, 3, 0, i, j] += r / h
                share[slot, 3, 1, i, j] -= 4.0 * r / h
                share[slot, 3, 2, i, j] += 3.0 * r / h


@compiled(f"void(int64, float64, {MODES}, {TABLES})", inline=True)
def ready_rows(slot: int, t: float, modes: Any, tables: Any) -> None:
    """See to it that a slot holds the responses after t."""
    omega, decay, beta, _ = modes
    span, ready, table, rows, _, _, _ = tables
    if span[slot] != t:
        fill(slot, 1, t, omega, decay, beta, table, rows)
        span[slot] = t
        ready[slot, 0], ready[slot, 1], ready[slot, 2] = 0, 0, 0


@compiled(f"void(int64, float64, {MODES}, {TABLES})", inline=True)
def ready_step(slot: int, h: float, modes: Any, tables: Any) -> None:
    """See to it that a slot holds the responses after h, and the next one those after h/2."""
    omega, decay, beta, _ = modes
    span, ready, table, rows, _, _, _ = tables
    if span[slot] == h and span[slot + 1] == 0.5 * h:
        return
    if span[slot] == h or span[slot + 1] == 0.5 * h:
        ready_rows(slot, h, modes, tables)
        ready_rows(slot + 1, 0.5 * h, modes, tables)
        return
    fill(slot, 2, h, omega, decay, beta, table, rows)
    span[slot], span[slot + 1] = h, 0.5 * h
    for each in range(slot, slot + 2):
        ready[each, 0], ready[each, 1], ready[each, 2] = 0, 0, 0


@compiled(f"void({F4}, {F2}, {F2})", inline=True)
def project(rows: Any, x: Any, out: Any) -> None:
    """out (2, m) = rows (2, m, 2, J) x (2, J)."""
    if COMPILED:
        for k in range(2):
            for i in range(rows.shape[1]):
                out[k, i] = dot(rows[k, i, 0], x[0]) + dot(rows[k, i, 1], x[1])
    else:
        rows.reshape(out.size, x.size).dot(x.ravel(), out=out.reshape(out.size))


@compiled(f"void({F2}, {F2}, {F1}, {F1}, {F2})")
def loaded_rows(table: Any, beta: Any, at: Any, slope: Any, out: Any) -> None:
    """What linear modal loads add to indentations and rates, added to out (2, m)."""
    if COMPILED:
        for i in range(beta.shape[0]):
            for j in range(at.size):
                out[0, i] += beta[i, j] * (at[j] * table[3, j] + slope[j] * table[4, j])
                out[1, i] += beta[i, j] * (at[j] * table[2, j] + slope[j] * table[3, j])
    else:
        out[0] += beta @ (at * table[3] + slope * table[4])
        out[1] += beta @ (at * table[2] + slope * table[3])


@compiled(f"void({F3}, {F2}, {F2})", inline=True)
def push(move: Any, parabola: Any, x: Any) -> None:
    """The state after a step: free motion, and forces with value, slope, curvature (3, m)."""
    if COMPILED:
        turn(move[0, 0], move[1, 0], move[0, 1], move[1, 1], x[0], x[1])
        m = parabola.shape[1]
        for i in range(m):
            f, g, h = parabola[0, i], parabola[1, i], parabola[2, i]
            a, b, c = move[2 + i], move[2 + m + i], move[2 + 2 * m + i]
            if f != 0.0 or g != 0.0 or h != 0.0:
                subtract(f, a[0], g, b[0], h, c[0], x[0])
                subtract(f, a[1], g, b[1], h, c[1], x[1])
    else:
        new = move[0] * x
        new += move[1] * x[::-1]
        new -= parabola.ravel().dot(move[2:].reshape(parabola.size, x.size)).reshape(x.shape)
        x[:] = new
