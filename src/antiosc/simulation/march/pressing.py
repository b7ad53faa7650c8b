"""A step under contact, as long as its error permits, up to where a contact leaves its piece."""

from __future__ import annotations

from math import inf, sqrt
from typing import Any

import numpy as np

from .compiling import COMPILED, compiled
from .crossings import crossing, polished
from .curves import curve, piece
from .flight import free_step
from .forces import alone, solve
from .layout import (
    APART,
    BEFORE,
    BEND,
    CAP,
    CONTACTS,
    CUT,
    DAMPED,
    DEPTH,
    FAST,
    FORCE,
    FORCE_SCALE,
    FRESH,
    HIGH,
    I1,
    IDLE,
    LEFT,
    LEVEL,
    LEVELS,
    LONGEST,
    LOW,
    MIDDLE,
    MODES,
    NOTHING,
    RATE,
    REFUSED,
    RETRIES,
    ROOF,
    SCRATCH,
    SHARE,
    SHARP,
    SLOPE,
    SLOW,
    STATE,
    STEP,
    TABLES,
    USER,
    WORK,
)
from .tables import compliances, pair, ready_step

INTERPOLATION = 0.0482  # max |s (s - 1/2)(s - 1)| on [0, 1]
KINKED = 0.075  # error of the parabola through t^(3/2), over its second difference
RIPPLE = 2.0  # force of unresolved vibrations, over the error of force that a step may have


@compiled(f"boolean(int64, float64, {MODES}, {CONTACTS}, {STATE}, {TABLES}, {WORK})", inline=True)
def attempt(
    slot: int, h: float, modes: Any, contacts: Any, state: Any, tables: Any, work: Any
) -> bool:
    """Forces and motion of a step h under contact, into `work`; False if they are not found."""
    _, _, beta, R = modes
    clock, _, _, row, mode, s, anchor, _ = state
    _, ready, table, _, coupling, share, _ = tables
    F, base, motion = work[0], work[1], work[2]
    m = beta.shape[0]
    ready_step(slot, h, modes, tables)
    if ready[slot, 1] == 0:
        for each in range(slot, slot + 2):
            if ready[each, 0] == 0:
                compliances(table[each], beta, coupling[each])
                ready[each, 0] = 1
        rated = False
        for c in range(len(mode)):
            rated = rated or contacts[0][c] == DAMPED or contacts[0][c] == USER
        pair(slot, h, coupling[slot + 1], coupling[slot], R, rated, share)
        ready[slot, 1] = 1
    free_step(slot, h, modes, state, tables, work, base)
    if m == 1 and alone(h, contacts, state, share[slot], base, work):
        return True
    for i in range(m):
        F[0, i] = row[FORCE, i]
    for stage in range(2):
        u = 0.5 * h * (1 + stage)
        for i in range(m):
            d, v = base[2 * stage, i], base[2 * stage + 1, i]
            for j in range(m):
                d -= share[slot, 2 * stage, 0, i, j] * F[0, j]
                v -= share[slot, 2 * stage + 1, 0, i, j] * F[0, j]
            base[2 * stage, i], base[2 * stage + 1, i] = d, v
            # a first guess on the last parabola
            F[stage + 1, i] = row[FORCE, i] + u * (row[SLOPE, i] + 0.5 * u * row[BEND, i])
    return bool(solve(share[slot], base, F, motion, contacts, mode, s, anchor, clock[FORCE_SCALE]))


@compiled(f"float64({CONTACTS}, {STATE}, {WORK})", inline=True)
def first_exit(contacts: Any, state: Any, work: Any) -> float:
    """When the first contact leaves its piece in the step, inf if none does; sets `which`."""
    kinds, params, _, _, _ = contacts
    clock, _, _, row, mode, s, _, scale = state
    motion, which = work[2], work[8]
    half = 0.5 * clock[STEP]
    first = inf
    for c in range(len(kinds)):
        low, high, slow, fast = piece(kinds[c], mode[c], params[c], s[c])
        near, even = SHARP * scale[c, 0], 1e-6 * scale[c, 1]
        a, va = row[DEPTH, c], row[RATE, c]
        for stage in range(2):
            b, vb = motion[2 * stage, c], motion[2 * stage + 1, c]
            found, bound = inf, NOTHING
            if b < low - near:
                found, bound = crossing(a, va, b, vb, half, low), LOW
            elif b > high + near:
                found, bound = crossing(a, va, b, vb, half, high), HIGH
            if vb < slow - even or vb > fast + even:
                edge = slow if vb < slow else fast
                at = half * min(max((edge - va) / (vb - va), 0.0), 1.0) if vb != va else 0.0
                if at < found:
                    found, bound = at, SLOW if vb < slow else FAST
            if bound != NOTHING:
                found += half * stage
                if bound <= HIGH and found > 1e-3 * half:
                    edge = low if bound == LOW else high
                    y0, d0, y2, d2 = row[DEPTH, c], row[RATE, c], motion[2, c], motion[3, c]
                    y1, d1 = motion[0, c], motion[1, c]
                    found = polished(found, y0, d0, y1, d1, y2, d2, 2.0 * half, edge)
                if found < first:
                    first, which[0], which[1] = found, c, bound
                break
            a, va = b, vb
    return first


@compiled(f"float64({CONTACTS}, {STATE}, {I1}, float64, float64)")
def beyond(contacts: Any, state: Any, which: Any, d: float, v: float) -> float:
    """How far indentation d and rate v lie beyond the bound `which` of a piece."""
    kinds, params, _, _, _ = contacts
    mode, s = state[4], state[5]
    c = which[0]
    low, high, slow, fast = piece(kinds[c], mode[c], params[c], s[c])
    if which[1] == LOW:
        return low - d
    if which[1] == HIGH:
        return d - high
    if which[1] == SLOW:
        return slow - v
    return v - fast


@compiled(f"boolean(float64, {MODES}, {CONTACTS}, {STATE}, {TABLES}, {WORK})", inline=True)
def end_at_exit(
    first: float, modes: Any, contacts: Any, state: Any, tables: Any, work: Any
) -> bool:
    """Shorten the step to end where the contact `which` leaves its piece, at about `first`."""
    clock, count, _, row, _, _, _, scale = state
    motion, which = work[2], work[8]
    c, bound = which[0], which[1]
    short, long = 0.0, clock[STEP]
    g_short = beyond(contacts, state, which, row[DEPTH, c], row[RATE, c])
    g_long = beyond(contacts, state, which, motion[2, c], motion[3, c])
    length, near = first, False
    # a damped law's force is cut where it is 0: what is left of it there is lost
    even = SHARP if contacts[0][c] == DAMPED else 1e-6
    for tries in range(14):
        count[RETRIES] += 1
        clock[STEP] = length  # of the attempt that counts, should the tries end before it is close
        if not attempt(SCRATCH, length, modes, contacts, state, tables, work):
            return False
        d, v = motion[2, c], motion[3, c]
        g = beyond(contacts, state, which, d, v)
        close = SHARP * scale[c, 0] if bound <= HIGH else even * scale[c, 1]
        if abs(g) <= close:
            if near or bound != LOW or -v * length < 1e3 * close:
                break
            near = True  # a release is located to rounding: once more
        if g > 0.0:
            long, g_long = length, g
        else:
            short, g_short = length, g
        speed = -v if bound == LOW else v
        new = length - g / speed if bound <= HIGH and speed > 0.0 else -1.0
        if not short < new < long and g_short < 0.0 < g_long and tries < 8:
            new = short + (long - short) * g_short / (g_short - g_long)
        if not short < new < long:
            new = 0.5 * (short + long)
        length = new
    return True


@compiled("float64(float64, float64, float64, float64, float64, float64, float64)", inline=True)
def misfit(
    before: float, f0: float, f1: float, f2: float, hp: float, h: float, fresh: float
) -> float:
    """Error of a step's parabola: from the third difference with the value hp/2 before the step.

    In the first step of a contact, whose force may rise as t^(3/2), from the second difference.
    """
    if fresh > 0.0:
        return KINKED * abs(f0 - 2.0 * f1 + f2)
    g, e = 0.5 * hp, 0.5 * h
    d1, d2, d3 = (f0 - before) / g, (f1 - f0) / e, (f2 - f1) / e
    third = ((d3 - d2) / h - (d2 - d1) / (g + e)) / (g + h)
    return INTERPOLATION * h**3 * abs(third)


@compiled(f"float64({STATE}, {WORK})", inline=True)
def worst_misfit(state: Any, work: Any) -> float:
    """Largest error of the parabolas of the step."""
    clock, row = state[0], state[3]
    F = work[0]
    worst = 0.0
    for i in range(F.shape[1]):
        error = misfit(
            row[MIDDLE, i], F[0, i], F[1, i], F[2, i], clock[BEFORE], clock[STEP], row[FRESH, i]
        )
        worst = max(worst, error)
    return worst


@compiled(f"float64(float64, {MODES}, {CONTACTS}, {STATE}, {WORK})")
def ripple(h: float, modes: Any, contacts: Any, state: Any, work: Any) -> float:
    """Force that the vibrations which a step h does not resolve may cause, at most.

    A mode with omega h > 2 vibrates about its deflection under the present forces. Unresolved
    vibrations can be driven by the steps themselves (`antiosc.simulation.stability`), and at
    omega h = 2 pi the nodes do not see them.
    """
    omega, _, beta, R = modes
    kinds, params, _, _, _ = contacts
    clock, _, x, row, mode, s, _, scale = state
    at = work[4]
    worst = 0.0
    for c in range(len(kinds)):
        if mode[c] == APART or mode[c] == CUT:
            continue
        d, rate = row[DEPTH, c], row[RATE, c]
        stiffness = curve(kinds[c], mode[c], d, rate, params[c], s[c])[1]
        begun = 0.0
        if row[FRESH, c] > 0.0:
            stiffness = max(stiffness, clock[FORCE_SCALE] / scale[c, 0])
            after = curve(kinds[c], mode[c], d + h * rate, rate, params[c], s[c])[0]
            begun = abs(after - row[FORCE, c])
        swing, soft = 0.0, R[c, c]
        if COMPILED:
            for j in range(omega.size):
                if omega[j] * h <= 2.0:
                    continue
                w2 = omega[j] * omega[j]
                pull, change = -at[j], 0.0
                for i in range(beta.shape[0]):
                    pull += beta[i, j] * row[FORCE, i]
                    change += beta[i, j] * row[SLOPE, i]
                q, v = x[0, j] + pull / w2, x[1, j] + change / w2
                swing += abs(beta[c, j]) * sqrt(q * q + v * v / w2)
                soft += beta[c, j] * beta[c, j] / w2
        else:
            fast = omega * h > 2.0
            w2 = omega[fast] ** 2
            q = x[0, fast] + (row[FORCE] @ beta[:, fast] - at[fast]) / w2
            v = x[1, fast] + (row[SLOPE] @ beta[:, fast]) / w2
            swing = float(np.abs(beta[c, fast]) @ np.sqrt(q * q + v * v / w2))
            soft += float(np.sum(beta[c, fast] ** 2 / w2))
        swing += begun * (soft - R[c, c])
        worst = max(worst, stiffness * swing / (1.0 + stiffness * soft))
    return worst


@compiled(f"int64({MODES}, {CONTACTS}, {STATE}, {TABLES}, {WORK})", inline=True)
def press(modes: Any, contacts: Any, state: Any, tables: Any, work: Any) -> int:
    """The next step under contact, up to the first exit: its slot, -1: at once, -2: stuck."""
    kinds = contacts[0]
    clock, count = state[0], state[1]
    limit, left = clock[SHARE] * clock[FORCE_SCALE], clock[LEFT]
    level = count[LEVEL]
    while clock[LONGEST] * 0.5**level > clock[CAP] and level < LEVELS - 3:
        level += 1
    blind = count[IDLE] > 4 * len(kinds) + 8  # exits without end at one time: step over them
    if blind:
        level = min(level + 3, LEVELS - 3)
    while clock[ROOF] < inf and level < LEVELS - 3 and not blind:
        if ripple(clock[LONGEST] * 0.5**level, modes, contacts, state, work) <= RIPPLE * limit:
            break
        level += 1
        count[REFUSED] += 1
    while level < LEVELS - 2:
        slot, h = level, clock[LONGEST] * 0.5**level
        if h >= left:
            slot, h = SCRATCH, left
        clock[STEP] = h
        found = attempt(slot, h, modes, contacts, state, tables, work)
        worst = worst_misfit(state, work) if found else inf
        finer = 0
        jump = h <= 1e-9 * clock[CAP]  # no smaller step helps
        if worst > limit and not (found and (blind or jump)):
            count[REFUSED] += 1
            finer = 1 if not found or worst < 16.0 * limit else 2 if worst < 128.0 * limit else 3
        elif not blind:
            first = first_exit(contacts, state, work)
            if first <= 1e-9 * h:
                return -1
            if first < inf:
                if end_at_exit(first, modes, contacts, state, tables, work):
                    count[LEVEL] = level
                    return SCRATCH
                work[8][0] = -1
                finer = 1
        if finer == 0:
            coarser = worst < limit / 16.0 and level > 0 and slot != SCRATCH
            count[LEVEL] = level - 1 if coarser else level
            return slot
        count[RETRIES] += 1
        level += finer
        while slot == SCRATCH and clock[LONGEST] * 0.5**level >= 0.5 * left:
            level += 1
    return -2
