"""Free motion under the loads, up to the next touch."""

from __future__ import annotations

from math import inf, sqrt
from typing import Any

import numpy as np

from .compiling import COMPILED, compiled
from .crossings import crossing
from .curves import piece
from .layout import (
    ACTING,
    APART,
    CONTACTS,
    DEPTH,
    DURATION,
    F2,
    FINE,
    HIGH,
    LEFT,
    LEVEL,
    LEVELS,
    LOADED,
    LONGEST,
    MODES,
    RATE,
    SCRATCH,
    SEGMENT,
    SHARP,
    SHIFTED,
    STATE,
    STEP,
    TABLES,
    TIME,
    WORK,
)
from .tables import loaded_rows, project, ready_rows, ready_step

ROUNDING = 1e-13  # of the sum of the modes' parts: below it a speed of approach is rounding


@compiled(f"void(int64, float64, {MODES}, {STATE}, {TABLES}, {WORK}, {F2})", inline=True)
def free_motion(
    slot: int, t: float, modes: Any, state: Any, tables: Any, work: Any, out: Any
) -> None:
    """Indentations and rates (2, m) after a time t without contact forces, into out."""
    beta = modes[2]
    count, x = state[1], state[2]
    table, rows = tables[2], tables[3]
    at, slope, offset, drift = work[4], work[5], work[6], work[7]
    project(rows[slot], x, out)
    if count[LOADED] > 0:
        loaded_rows(table[slot], beta, at, slope, out)
    for i in range(offset.size):
        out[0, i] -= offset[i] + drift[i] * t
        out[1, i] -= drift[i]


@compiled(f"void(int64, float64, {MODES}, {STATE}, {TABLES}, {WORK}, {F2})", inline=True)
def free_step(
    slot: int, h: float, modes: Any, state: Any, tables: Any, work: Any, out: Any
) -> None:
    """Indentations and rates at h/2, then at h, without contact forces, into out (4, m)."""
    count, x = state[1], state[2]
    rows, offset, drift = tables[3], work[6], work[7]
    if COMPILED or count[LOADED] > 0:
        free_motion(slot + 1, 0.5 * h, modes, state, tables, work, out[:2])
        free_motion(slot, h, modes, state, tables, work, out[2:])
    else:
        both = rows[slot : slot + 2].reshape(out.size, x.size).dot(x.ravel())
        out[:2], out[2:] = both.reshape(2, 2, -1)[::-1]
        if count[SHIFTED] > 0:
            out[0] -= offset + drift * (0.5 * h)
            out[1] -= drift
            out[2] -= offset + drift * h
            out[3] -= drift


@compiled(f"float64({ACTING}, {STATE}, {WORK})", inline=True)
def acting_now(acting: Any, state: Any, work: Any) -> float:
    """Loads and gaps from the present time on, with their slopes; the time that they hold."""
    breaks, loads, offsets = acting
    clock, count = state[0], state[1]
    at, slope, offset, drift = work[4], work[5], work[6], work[7]
    t, end = clock[TIME], clock[DURATION]
    k = count[SEGMENT]
    while k + 1 < breaks.size and breaks[k + 1] - t <= 1e-13 * end:
        k += 1
    count[SEGMENT] = k
    last = k + 1 == breaks.size
    span = inf if last else breaks[k + 1] - breaks[k]
    if count[SHIFTED] > 0:
        for i in range(offset.size):
            drift[i] = 0.0 if last else (offsets[k + 1, i] - offsets[k, i]) / span
            offset[i] = offsets[k, i] + drift[i] * (t - breaks[k])
    if count[LOADED] > 0:
        for j in range(at.size):
            slope[j] = 0.0 if last else (loads[k + 1, j] - loads[k, j]) / span
            at[j] = loads[k, j] + slope[j] * (t - breaks[k])
    return end - t if last else min(end, breaks[k + 1]) - t


@compiled(f"void(float64, {MODES}, {STATE}, {WORK})")
def amplitudes(left: float, modes: Any, state: Any, work: Any) -> None:
    """How each contact sees the free motion about that which the loads give: `swing`, `bend`."""
    omega, decay, beta, _ = modes
    x = state[2]
    at, slope, swing, bend, missed, known = work[4], work[5], work[9], work[10], work[11], work[12]
    known[:] = 0
    if not COMPILED:
        elastic = omega > 0.0
        w = np.where(elastic, omega, 1.0)
        x_rest = (at - 2.0 * decay * slope / (w * w)) / (w * w)
        wide = np.hypot(x[0] - x_rest, (x[1] - slope / (w * w)) / w)
        falls = np.maximum(abs(at), abs(at + slope * left)) + 2.0 * decay * abs(x[1])
        swing[:] = abs(beta[: bend.size]) * np.where(elastic, wide, falls)
        bend[:] = swing @ (omega == 0.0)
        missed[LEVELS] = bend + swing @ (omega * (omega + 2.0 * decay))
        return
    for c in range(bend.size):
        bend[c], missed[LEVELS, c] = 0.0, 0.0
    for j in range(omega.size):
        w = omega[j]
        if w > 0.0:
            rest = (at[j] - 2.0 * decay[j] * slope[j] / (w * w)) / (w * w)
            amplitude = sqrt((x[0, j] - rest) ** 2 + ((x[1, j] - slope[j] / (w * w)) / w) ** 2)
        else:
            amplitude = max(abs(at[j]), abs(at[j] + slope[j] * left))
            amplitude += 2.0 * decay[j] * abs(x[1, j])
        for c in range(bend.size):
            swing[c, j] = abs(beta[c, j]) * amplitude
            if w > 0.0:
                missed[LEVELS, c] += swing[c, j] * (w * w + 2.0 * decay[j] * w)
            else:
                bend[c] += swing[c, j]
    for c in range(bend.size):
        missed[LEVELS, c] += bend[c]


@compiled(f"float64(int64, int64, float64, {MODES}, {WORK})")
def chord(c: int, level: int, h: float, modes: Any, work: Any) -> float:
    """The most by which free motion rises above its chord over h at a contact."""
    omega, decay, _, _ = modes
    swing, bend, missed, known = work[9], work[10], work[11], work[12]
    if level < LEVELS and known[level] > 0:
        return float(missed[level, c])
    total = bend[c] * h * h / 8.0
    if COMPILED:
        for j in range(omega.size):
            if omega[j] > 0.0:
                curvature = omega[j] * (omega[j] + 2.0 * decay[j])
                total += swing[c, j] * min(2.0, curvature * (h * h / 8.0))
    else:
        share = np.minimum(2.0, omega * (omega + 2.0 * decay) * (h * h / 8.0))
        total += float(swing[c] @ share)
    if level < LEVELS:
        missed[level, c] = total
    return total


@compiled(
    f"float64(int64, float64, float64, float64, {MODES}, {CONTACTS}, {STATE}, {TABLES}, {WORK})"
)
def touch_time(
    c: int,
    after: float,
    closing: float,
    h: float,
    modes: Any,
    contacts: Any,
    state: Any,
    tables: Any,
    work: Any,
) -> float:
    """When the contact c touches within h, by Newton's method on the exact motion.

    At the end of h it lies `after` beyond and closes at a rate `closing`.
    """
    kinds, params, _, _, _ = contacts
    row, s, scale = state[3], state[5], state[7]
    base = work[1]
    origin = piece(kinds[c], APART, params[c], s[c])[1]
    before = min(row[DEPTH, c] - origin, 0.0)
    guess = crossing(before, row[RATE, c], after, closing, h, 0.0)
    if not 0.0 < guess < h:
        guess = h * before / (before - after)
    low, high = 0.0, h
    for _ in range(60):
        ready_rows(SCRATCH, guess, modes, tables)
        free_motion(SCRATCH, guess, modes, state, tables, work, base[:2])
        g, v = base[0, c] - origin, base[1, c]
        if abs(g) <= 0.01 * SHARP * scale[c, 0]:
            break
        if g > 0.0:
            high = guess
        else:
            low = guess
        new = guess - g / v if v > 0.0 else -1.0
        if not low < new < high:
            new = 0.5 * (low + high)
        if abs(new - guess) <= 1e-15 * h:
            break
        guess = new
    return guess


@compiled(f"boolean(int64, {MODES}, {STATE}, {WORK})")
def approaches(c: int, modes: Any, state: Any, work: Any) -> bool:
    """Whether the bodies approach each other at a contact, by more than the rounding of the modes.

    A site that the motion has not reached yet moves to and fro by rounding alone.
    """
    beta = modes[2]
    x, row, drift = state[2], state[3], work[7]
    total = abs(drift[c])
    if COMPILED:
        for j in range(x.shape[1]):
            total += abs(beta[c, j] * x[1, j])
    else:
        total += float(abs(beta[c]).dot(abs(x[1])))
    return bool(row[RATE, c] > ROUNDING * total)


@compiled(f"int64({MODES}, {CONTACTS}, {STATE}, {TABLES}, {WORK})", inline=True)
def fly(modes: Any, contacts: Any, state: Any, tables: Any, work: Any) -> int:
    """The next step of free flight, up to a touch: its slot, -1 if one touches now, -2: stuck.

    An interval holds no touch if the larger of its ends lies below 0 by more than a chord can miss,
    or while the bodies recede fast enough.
    """
    kinds, params, _, _, _ = contacts
    clock, count, _, row, _, s, _, scale = state
    motion, free, which, missed, known = work[2], work[3], work[8], work[11], work[12]
    p = len(kinds)
    for c in range(p):
        origin = piece(kinds[c], APART, params[c], s[c])[1]
        close = row[DEPTH, c] >= origin - SHARP * scale[c, 0]
        if close and approaches(c, modes, state, work):
            which[0], which[1] = c, HIGH
            return -1
    level, left = count[LEVEL], clock[LEFT]
    slot, h = level, 0.0
    struck = False
    while True:
        slot, h = level, clock[LONGEST] * 0.5**level
        if h >= left:
            slot, h = SCRATCH, left
        ready_rows(slot, h, modes, tables)
        free_motion(slot, h, modes, state, tables, work, free)
        clear, struck = True, False
        for c in range(p):
            origin = piece(kinds[c], APART, params[c], s[c])[1]
            before, after = min(row[DEPTH, c] - origin, 0.0), free[0, c] - origin
            most, close = chord(c, slot, h, modes, work), SHARP * scale[c, 0]
            room = close if h <= clock[FINE] / 16.0 else min(close - most, 0.0)
            keeps = abs(row[RATE, c]) >= h * missed[LEVELS, c]  # the sign of its rate
            if max(before, after) <= room or (keeps and row[RATE, c] < 0.0 and after <= 0.0):
                continue
            if after > close and (keeps or h <= clock[FINE] or most <= close):
                struck = True
            else:
                clear = False
        if slot < LEVELS:
            known[level] = 1
        if clear:
            break
        level += 1
        while slot == SCRATCH and clock[LONGEST] * 0.5**level >= 0.5 * left:
            level += 1
        if level >= LEVELS - 1:
            return -2
    count[LEVEL] = max(level - 1, 0)
    if struck:
        first = inf
        for c in range(p):
            after = free[0, c] - piece(kinds[c], APART, params[c], s[c])[1]
            if after > SHARP * scale[c, 0]:
                closing = free[1, c]
                found = touch_time(c, after, closing, h, modes, contacts, state, tables, work)
                if found < first:
                    first, which[0], which[1] = found, c, HIGH
        slot, h = SCRATCH, first
        if h <= 1e-15 * clock[DURATION]:
            return -1
    ready_step(slot, h, modes, tables)
    free_step(slot, h, modes, state, tables, work, motion)
    work[0][:] = 0.0
    clock[STEP] = h
    return slot
