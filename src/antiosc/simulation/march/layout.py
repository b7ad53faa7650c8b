"""The arrays that the march works on: their types, and what stands at which place."""

from __future__ import annotations

# what the functions take: arrays of floats and whole numbers, by their dimensions
F1, F2, F3 = "float64[::1]", "float64[:, ::1]", "float64[:, :, ::1]"
F4, F5 = "float64[:, :, :, ::1]", "float64[:, :, :, :, ::1]"
I1, I2 = "int64[::1]", "int64[:, ::1]"
# groups of arrays, by their names:
# omega, decay (J,), beta (m, J), R (m, m)
MODES = f"Tuple(({F1}, {F1}, {F2}, {F2}))"
# breaks (K,), loads (K, J), offsets (K, m): modal loads and gaps, linear in between, then constant
ACTING = f"Tuple(({F1}, {F2}, {F2}))"
# kinds (p,), params (p, .), slip (p, 2): friction and tangential stiffness, tangents (p, 2): first
# tangential row and their number, met (p, 2): mass behind each contact, roughly, and the least
# closing speed
CONTACTS = f"Tuple(({I1}, {F2}, {F2}, {I2}, {F2}))"
# clock, count, x (2, J), row (7, m), mode (p,), s (p, .), anchor (3, p, 2): where the tangential
# springs hang at 0, h/2, h, scale (p, 2): depths and speeds met so far
STATE = f"Tuple(({F1}, {I1}, {F2}, {F2}, {I1}, {F2}, {F3}, {F2}))"
# span (slots,), ready (slots, 3), table (slots, 6, J), rows (slots, 2, m, 2, J),
# coupling (slots, 4, m, m), share (slots, 4, 3, m, m), move (slots, 2 + 3 m, 2, J): responses of
# the steps used so far; `ready`: whether coupling, share, move are those of the slot's time `span`
TABLES = f"Tuple(({F1}, {I2}, {F3}, {F5}, {F4}, {F5}, {F4}))"
# F (3, m), base, motion (4, m), free (2, m), at, slope (J,), offset, drift (m,), which (2,),
# swing (p, J), bend (p,), missed (LEVELS + 1, p), known (LEVELS + 1,)
WORK = f"Tuple(({F2}, {F2}, {F2}, {F2}, {F1}, {F1}, {F1}, {F1}, {I1}, {F2}, {F1}, {F2}, {I1}))"
# time (n,), force, depth (n, m) at 0, h/2, h, 3h/2 ...; states (., 2, J) at the start of each step;
# events (., 4): time, contact, piece that begins, closing speed
OUT = f"Tuple(({F1}, {F2}, {F2}, {F3}, {F2}))"

# kinds of laws (`antiosc.simulation.laws` packs their parameters)
LINEAR, POWER, HERTZ, DAMPED, THORNTON, STRONGE, YANG_SUN, TAN_SUN, TABLE, USER = range(10)
# pieces of a law: apart; loading or reloading; force cut at 0 by its rate; unloading
APART, FORWARD, CUT, BACK = range(4)
# what ends a step: the bounds of a piece, in this order
LOW, HIGH, SLOW, FAST, NOTHING = range(5)
# answers of `march`
DONE, FULL, TOO_MANY_CONTACTS, TOO_MANY_STEPS, GREW, STUCK = range(6)

LEVELS = 64  # steps H, H/2, H/4 ...
SCRATCH = LEVELS  # two slots more for a step of any length and its half
SHARP = 1e-9  # of the depth or the speed: a bound is met

# clock
TIME, BEFORE, FORCE_SCALE, WORKED, GIVEN, HIGHEST, CAP, FINE = range(8)
DURATION, SHARE, LONGEST, KNOWN, STEP, LEFT, SURPLUS, ROOF = range(8, 16)
# count
LEVEL, SEGMENT, STEPS, TOUCHES, NODES, EVENTS, STATES, KEEP = range(8)
MOST_TOUCHES, MOST_STEPS, IDLE, LOADED, RETRIES, SHIFTED, REFUSED = range(8, 15)
# rows of `row`
FORCE, MIDDLE, SLOPE, BEND, DEPTH, RATE, FRESH = range(7)
