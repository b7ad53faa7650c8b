"""The course of events: flights and steps under contact, touches and releases."""

from __future__ import annotations

from math import inf
from typing import Any

import numpy as np

from .compiling import COMPILED, compiled
from .curves import change, expected, user_advance
from .flight import acting_now, amplitudes, fly
from .layout import (
    ACTING,
    APART,
    BEFORE,
    BEND,
    CAP,
    CONTACTS,
    CUT,
    DEPTH,
    DONE,
    DURATION,
    EVENTS,
    F1,
    F2,
    FORCE,
    FORCE_SCALE,
    FRESH,
    FULL,
    GIVEN,
    GREW,
    HIGHEST,
    I1,
    IDLE,
    KEEP,
    KNOWN,
    LEFT,
    LEVEL,
    LEVELS,
    LOADED,
    LONGEST,
    MIDDLE,
    MODES,
    MOST_STEPS,
    MOST_TOUCHES,
    NODES,
    NOTHING,
    OUT,
    RATE,
    RETRIES,
    ROOF,
    SEGMENT,
    SHIFTED,
    SLOPE,
    STATE,
    STATES,
    STEP,
    STEPS,
    STUCK,
    SURPLUS,
    TABLES,
    TIME,
    TOO_MANY_CONTACTS,
    TOO_MANY_STEPS,
    TOUCHES,
    USER,
    WORK,
    WORKED,
)
from .pressing import press
from .responses import copy
from .runs import mechanical
from .tables import moves, push

GROWTH = 1.2  # of the bodies' energy, beyond what was given and the loads' work
# value, slope and curvature at 0 of the parabola through values at 0, 1/2, 1
TO_PARABOLA = np.array([[1.0, 0.0, 0.0], [-3.0, 4.0, -1.0], [4.0, -8.0, 4.0]])


@compiled(f"boolean({I1})", inline=True)
def mode_is_free(mode: Any) -> bool:
    """Whether nothing touches."""
    touching = 0
    for c in range(len(mode)):
        if mode[c] != APART:
            touching += 1
    return touching == 0


@compiled(f"float64({F1}, {F1}, float64, {F2})")
def loads_on(at: Any, slope: Any, h: float, x: Any) -> float:
    """The mean loads over a step times the displacements: its change is their work, nearly."""
    total = 0.0
    if COMPILED:
        for j in range(at.size):
            total += (at[j] + 0.5 * h * slope[j]) * x[0, j]
    else:
        total = float((at + 0.5 * h * slope) @ x[0])
    return total


@compiled(f"void(int64, {MODES}, {CONTACTS}, {STATE}, {TABLES}, {WORK}, {OUT})", inline=True)
def take(
    slot: int, modes: Any, contacts: Any, state: Any, tables: Any, work: Any, out: Any
) -> None:
    """Go to the end of the step and write it down."""
    omega, _, beta, _ = modes
    kinds, params, _, tangents, _ = contacts
    clock, count, x, row, mode, s, anchor, scale = state
    _, ready, table, _, _, _, move = tables
    F, base, motion, at, slope, drift = work[0], work[1], work[2], work[4], work[5], work[7]
    time_out, force_out, depth_out, state_out, _ = out
    h = clock[STEP]
    m = F.shape[1]
    if count[KEEP] > 0:
        if COMPILED:
            copy(x[0], state_out[count[STATES], 0])
            copy(x[1], state_out[count[STATES], 1])
        else:
            state_out[count[STATES]] = x
        count[STATES] += 1
    if COMPILED:
        for i in range(m):
            base[0, i] = F[0, i]
            base[1, i] = (4.0 * F[1, i] - 3.0 * F[0, i] - F[2, i]) / h
            base[2, i] = 4.0 * (F[0, i] - 2.0 * F[1, i] + F[2, i]) / (h * h)
    else:
        TO_PARABOLA.dot(F, out=base[:3])
        base[1] /= h
        base[2] /= h * h
    if count[LOADED] > 0:
        clock[WORKED] -= loads_on(at, slope, h, x)
    if ready[slot, 2] == 0:
        moves(slot, omega, beta, table, move)
        ready[slot, 2] = 1
    push(move[slot], base[:3], x)
    if count[LOADED] > 0:
        if COMPILED:
            for j in range(omega.size):
                S, J0, J1 = table[slot, 2, j], table[slot, 3, j], table[slot, 4, j]
                x[0, j] += at[j] * J0 + slope[j] * J1
                x[1, j] += at[j] * S + slope[j] * J0
        else:
            x[0] += at * table[slot, 3] + slope * table[slot, 4]
            x[1] += at * table[slot, 2] + slope * table[slot, 3]
        clock[WORKED] += loads_on(at, slope, h, x)
    if count[SHIFTED] > 0:
        for i in range(m):  # the moving gaps: loads on sites without mass
            clock[WORKED] -= drift[i] * h / 6.0 * (F[0, i] + 4.0 * F[1, i] + F[2, i])
    n = count[NODES]
    time_out[n], time_out[n + 1] = clock[TIME] + 0.5 * h, clock[TIME] + h
    if mode_is_free(mode):
        clock[WORKED] = mechanical(x, omega) - clock[GIVEN]  # flight is exact
    count[NODES] = n + 2
    count[STEPS] += 1
    count[IDLE] = 0
    clock[TIME] += h
    clock[BEFORE] = h
    if COMPILED:
        for i in range(m):
            for k in range(2):
                force_out[n + k, i], depth_out[n + k, i] = F[1 + k, i], motion[2 * k, i]
            row[FORCE, i], row[MIDDLE, i] = F[2, i], F[1, i]
            row[SLOPE, i], row[BEND, i] = base[1, i] + h * base[2, i], base[2, i]
            row[DEPTH, i], row[RATE, i] = motion[2, i], motion[3, i]
            row[FRESH, i] = 0.0
    else:
        force_out[n : n + 2], depth_out[n : n + 2] = F[1:], motion[::2]
        row[FORCE], row[MIDDLE], row[BEND], row[FRESH] = F[2], F[1], base[2], 0.0
        row[SLOPE] = base[1] + h * base[2]
        row[DEPTH:FRESH] = motion[2:]
    for c in range(len(kinds)):
        scale[c, 1] = max(scale[c, 1], abs(motion[3, c]))
        if mode[c] == APART:
            continue
        for r in range(tangents[c, 1]):
            anchor[0, c, r] = anchor[2, c, r]
        if clock[KNOWN] == 0.0:
            clock[FORCE_SCALE] = max(clock[FORCE_SCALE], float(F[2, c]))
        if kinds[c] == USER and not COMPILED:
            user_advance(motion[2, c], motion[3, c], params[c], s[c])


@compiled(f"float64(int64, float64, {MODES})")
def mass_felt(c: int, t: float, modes: Any) -> float:
    """Mass that a contact seems to push if a constant force acts for a time t."""
    omega, _, beta, R = modes
    give = R[c, c]
    if COMPILED:
        for j in range(omega.size):
            z = 0.5 * omega[j] * t
            part = beta[c, j] * (t * np.sin(z) / z if z > 1e-4 else t)
            give += 0.5 * part * part
    else:
        part = beta[c] * np.sinc(omega * (t / (2.0 * np.pi)))
        give += 0.5 * t * t * float(part.dot(part))
    return 0.5 * t * t / give if give > 0.0 else inf


@compiled(f"float64(int64, float64, float64, float64, {MODES}, {CONTACTS}, {STATE})")
def force_expected(
    c: int, depth: float, force: float, speed: float, modes: Any, contacts: Any, state: Any
) -> float:
    """Peak force of a contact with the mass that takes part while it lasts, roughly.

    `depth` and `force` are those with all the mass behind it.
    """
    kinds, params, _, _, met = contacts
    s = state[5]
    for _ in range(3):
        mass = min(mass_felt(c, 1.5 * depth / speed, modes), met[c, 0])
        depth, force = expected(kinds[c], mass, speed, params[c], s[c])
    return force


@compiled(f"void({MODES}, {CONTACTS}, {STATE}, {WORK}, {OUT}, boolean)")
def enter(modes: Any, contacts: Any, state: Any, work: Any, out: Any, active: bool) -> None:
    """The contact `which` goes over to its next piece; `active`: others touched before."""
    kinds, params, _, tangents, met = contacts
    clock, count, _, row, mode, s, anchor, scale = state
    which, event_out = work[8], out[4]
    c = which[0]
    before, rate = mode[c], max(row[RATE, c], met[c, 1])
    mode[c] = change(kinds[c], before, which[1], row[DEPTH, c], rate, params[c], s[c])
    rest = mode[c] == APART or mode[c] == CUT
    for k in range(1 + tangents[c, 1]):
        i = c if k == 0 else tangents[c, 0] + k - 1
        row[FRESH, i], row[SLOPE, i], row[BEND, i] = 1.0, 0.0, 0.0
        if rest:
            row[FORCE, i] = 0.0
        if before == APART and k > 0:
            anchor[0, c, k - 1] = row[DEPTH, i]
    if before == APART or mode[c] == APART:
        n = count[EVENTS]
        event_out[n, 0], event_out[n, 1] = clock[TIME], c
        event_out[n, 2], event_out[n, 3] = mode[c], rate
        count[EVENTS] = n + 1
    if before == APART:
        count[TOUCHES] += 1
        speed = max(rate, 1e-2 * scale[c, 1])
        depth, force = expected(kinds[c], met[c, 0], speed, params[c], s[c])
        scale[c, 0] = max(scale[c, 0], depth)
        if clock[KNOWN] == 0.0:
            force = force_expected(c, depth, force, speed, modes, contacts, state)
            clock[FORCE_SCALE] = max(clock[FORCE_SCALE], force)
        lasts = 3.0 * depth / speed
        cap = min(clock[ROOF], lasts / 4.0)
        clock[CAP] = min(clock[CAP], cap) if active else cap
        level = count[LEVEL] if active else 0
        first = lasts / 64.0 if clock[ROOF] == inf else cap
        while clock[LONGEST] * 0.5**level > first and level < LEVELS - 8:
            level += 1
        count[LEVEL] = level


@compiled(f"int64({MODES}, {ACTING}, {CONTACTS}, {STATE}, {TABLES}, {WORK}, {OUT})")
def march(
    modes: Any, acting: Any, contacts: Any, state: Any, tables: Any, work: Any, out: Any
) -> int:
    """Go on from `state` until the end or a full buffer of `out`; the groups stand above."""
    omega = modes[0]
    clock, count, x, _, mode, _, _, _ = state
    which = work[8]
    segment, flying = -1, False
    while True:
        if clock[DURATION] - clock[TIME] <= 1e-13 * clock[DURATION]:
            clock[TIME] = clock[DURATION]
            return DONE
        full = count[NODES] + 3 > out[0].size or count[EVENTS] + 2 > out[4].shape[0]
        if full or (count[KEEP] > 0 and count[STATES] + 1 > out[3].shape[0]):
            return FULL
        if count[STEPS] + count[RETRIES] >= count[MOST_STEPS]:
            return TOO_MANY_STEPS
        clock[LEFT] = acting_now(acting, state, work)
        active = not mode_is_free(mode)
        which[0], which[1] = -1, NOTHING
        if active:
            flying = False
            slot = press(modes, contacts, state, tables, work)
        else:
            if not flying or count[SEGMENT] != segment:
                amplitudes(clock[LEFT], modes, state, work)
                flying, segment = True, count[SEGMENT]
            slot = fly(modes, contacts, state, tables, work)
        if slot == -2:
            return STUCK
        if slot == -1:
            count[IDLE] += 1
            count[RETRIES] += 1
        else:
            take(slot, modes, contacts, state, tables, work, out)
        if which[0] >= 0:
            if mode[which[0]] == APART and count[TOUCHES] >= count[MOST_TOUCHES]:
                return TOO_MANY_CONTACTS
            enter(modes, contacts, state, work, out, active)
        if active and (which[0] >= 0 or count[STEPS] % 32 == 0):
            clock[HIGHEST] = max(clock[HIGHEST], clock[GIVEN] + clock[WORKED])
            surplus = mechanical(x, omega) - clock[GIVEN] - clock[WORKED]
            clock[SURPLUS] = max(clock[SURPLUS], surplus)
            if not surplus <= (GROWTH - 1.0) * clock[HIGHEST]:
                return GREW
