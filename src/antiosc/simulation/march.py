"""The march: modes under contact forces that are quadratic over a step. One source, two modules.

State: modal displacements and velocities x = (q, v) of all bodies side by side. With m rows beta,
one a contact and one or two more for its friction,

    q'' + 2 d q' + omega^2 q = load - beta^T F,      delta = beta q - gap - R F.

Over a step h each row's force is the parabola through its values at 0, h/2 and h, and the motion
under it is exact. The force law is met at h/2 and h (collocation at Lobatto's nodes: order 4 for a
smooth force, order 3 between the nodes; a massless contact point, R > 0, is nothing special). The
error of the parabola is estimated from its third divided difference with the step before and
decides on the step, a power of two, so that the responses of a step are found once.

A law is smooth in pieces: within bounds of indentation and rate (`piece`). A step that leaves the
piece of a contact ends where it does: touch, release, turn, cut and the kinks of loading curves
are located. While nothing touches the motion is free, and no touch is stepped over: what a chord
can miss is bounded by the amplitudes of the modes.

`antiosc.simulation.engine` loads this file a second time, compiled by numba, where that pays. All
compiled functions stand in this one long file: numba's cache compares the time of the file of a
function only, so that it would miss a change of what is called from another file.
"""

from __future__ import annotations

from math import exp, inf, log, sqrt
from typing import Any

import numpy as np

COMPILED = __name__.endswith("_compiled")

if COMPILED:
    from numba import njit

    CACHE: bool = globals()["CACHE"]

    def compiled(signature: str, allocates: bool = False, inline: bool = False) -> Any:
        """Compile to the signature when first imported; afterwards the cache is read.

        What does not allocate needs no counting of references, which costs more than the work.
        `inline` what each step calls: to hand over all the arrays of a scene costs more than a
        step of twenty modes.
        """
        return njit(
            signature,
            cache=CACHE,
            nogil=True,
            _nrt=allocates,
            forceinline=inline,
            error_model="numpy",
            fastmath={"reassoc", "contract", "arcp", "nsz"},
        )

else:

    def compiled(signature: str, allocates: bool = False, inline: bool = False) -> Any:
        """Leave the function as it is."""
        return lambda function: function


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

# value, slope and curvature at 0 of the parabola through values at 0, 1/2, 1
TO_PARABOLA = np.array([[1.0, 0.0, 0.0], [-3.0, 4.0, -1.0], [4.0, -8.0, 4.0]])
LEVELS = 64  # steps H, H/2, H/4 ...
SCRATCH = LEVELS  # two slots more for a step of any length and its half
FULLY_PLASTIC, PRESSURE = 84.0, 3.3  # Stronge's law
SLOWEST = 0.01  # share of the fastest approach that a damped law's speed of approach is held above
GROWTH = 1.2  # of the bodies' energy, beyond what was given and the loads' work
INTERPOLATION = 0.0482  # max |s (s - 1/2)(s - 1)| on [0, 1]
RIPPLE = 2.0  # force of unresolved vibrations, over the error of force that a step may have
KINKED = 0.075  # error of the parabola through t^(3/2), over its second difference
SHARP = 1e-9  # of the depth or the speed: a bound is met
ROUNDING = 1e-13  # of the sum of the modes' parts: below it a speed of approach is rounding
SWEEPS, NEWTON = 12, 40
SQUARED = 1e-7  # of the forces: Newton's correction after which none is needed

# the user's own laws by their number: only the interpreted march calls them
LAWS: dict[int, Any] = {}


# -- laws as functions of indentation and rate. par: parameters, s: what the contact remembers


@compiled(f"UniTuple(float64, 3)({F1}, int64, int64, float64)")
def table_at(par: Any, first: int, count: int, x: float) -> Any:
    """Value, slope, integral of the packed monotone cubic: knots x, four coefficients, area, end.

    Rows of `count` knots from par[first]: x, then a, b, c, e of each interval, then value and slope
    at the end.
    """
    last = first + count - 1
    if x <= par[first]:
        return 0.0, 0.0, 0.0
    if x >= par[last]:
        end = first + 6 * count
        d = x - par[last]
        area = par[first + 6 * count - 1]
        return (
            par[end] + par[end + 1] * d,
            par[end + 1],
            area + d * (par[end] + 0.5 * par[end + 1] * d),
        )
    low, high = first, last
    while high - low > 1:
        middle = (low + high) // 2
        if par[middle] <= x:
            low = middle
        else:
            high = middle
    i = low - first
    d = x - par[low]
    a = par[first + count + i]
    b = par[first + 2 * count + i]
    c = par[first + 3 * count + i]
    e = par[first + 4 * count + i]
    area = par[first + 5 * count + i]
    return (
        ((a * d + b) * d + c) * d + e,
        (3 * a * d + 2 * b) * d + c,
        area + (((a * d / 4 + b / 3) * d + c / 2) * d + e) * d,
    )


@compiled(f"UniTuple(float64, 2)(int64, float64, {F1})")
def loading(kind: int, delta: float, par: Any) -> Any:
    """Virgin force and its slope of a law with memory."""
    if delta <= 0.0:
        return 0.0, 0.0
    k = par[0]
    if kind == THORNTON:
        y = par[1]
        if delta <= y:
            return k * delta * sqrt(delta), 1.5 * k * sqrt(delta)
        return k * sqrt(y) * (1.5 * delta - 0.5 * y), 1.5 * k * sqrt(y)
    if kind == STRONGE:
        y = par[1]
        x = delta / y
        if x <= 1.0:
            return k * delta * sqrt(delta), 1.5 * k * sqrt(delta)
        area = 2.0 * x - 1.0
        growth = 1.0 + log(min(area, 2.0 * FULLY_PLASTIC - 1.0)) / PRESSURE
        top = k * y * sqrt(y)
        force = top * area * growth
        if x < FULLY_PLASTIC:
            growth += 1.0 / PRESSURE
        return force, 2.0 * top / y * growth
    if kind == TABLE:
        value, slope, _ = table_at(par, 6, int(par[2]), delta)
        return value, slope
    return k * delta * sqrt(delta), 1.5 * k * sqrt(delta)


@compiled(f"float64(int64, float64, {F1})")
def permanent(kind: int, deepest: float, par: Any) -> float:
    """Permanent indentation after a deepest one."""
    if kind == THORNTON:
        y = par[1]
        if deepest <= y:
            return 0.0
        x = sqrt(y / deepest)
        return deepest * (1.0 - x) ** 2 * (2.0 + x) / 2.0
    if kind == STRONGE:
        y = par[1]
        x = deepest / y
        if x <= 1.0:
            return 0.0
        printed = y * (x - 1.0) ** 2 / (x + sqrt(2.0 * x - 1.0))
        # what gives back no more than was put in
        s, full = 2.0 * x - 1.0, 2.0 * FULLY_PLASTIC - 1.0
        a = min(s, full)
        work = (a * a - 1.0) / 4 + (a * a * (2 * log(a) - 1.0) + 1.0) / (8 * PRESSURE)
        if s > full:
            work += (s * s - full * full) / 4 * (1.0 + log(full) / PRESSURE)
        top = par[0] * y * sqrt(y)
        work = 0.4 * top * y + top * y * work
        return max(printed, deepest - 2.5 * work / loading(kind, deepest, par)[0])
    if kind == YANG_SUN:
        if deepest <= par[1]:
            return 0.0
        return deepest * (1.0 - exp(0.4 * log(par[1] / deepest)))
    if kind == TAN_SUN:
        return par[2] * max(deepest - par[1], 0.0)
    return par[1] * deepest  # TABLE


@compiled(f"UniTuple(float64, 2)(int64, float64, boolean, {F1})")
def shape(kind: int, x: float, back: bool, par: Any) -> Any:
    """Unloading (`back`) or reloading curve from (0, 0) to (1, 1), and its slope."""
    if x <= 0.0:
        return 0.0, 0.0
    if kind == TABLE:
        value, slope, _ = table_at(par, int(par[4]), int(par[3]), x)
        return value, slope
    root = sqrt(x)
    if back and (kind in (YANG_SUN, TAN_SUN)):
        return x * x * root, 2.5 * x * root
    return x * root, 1.5 * root


@compiled(f"UniTuple(float64, 2)(int64, int64, float64, {F1}, {F1})")
def hysteretic(kind: int, mode: int, delta: float, par: Any, s: Any) -> Any:
    """Force and slope of a law with memory; s = (deepest, turning point)."""
    deepest, turn = s[0], s[1]
    if mode == FORWARD and delta >= deepest:
        return loading(kind, delta, par)
    low = permanent(kind, deepest, par)
    if delta <= low or deepest <= 0.0:
        return 0.0, 0.0
    top, from_here = loading(kind, deepest, par)[0], deepest
    if mode == FORWARD:
        value, slope = shape(kind, (delta - low) / (deepest - low), False, par)
        return top * value, top * slope / (deepest - low)
    if turn <= low:
        return 0.0, 0.0
    if turn < deepest:
        top *= shape(kind, (turn - low) / (deepest - low), False, par)[0]
        from_here = turn
    value, slope = shape(kind, (delta - low) / (from_here - low), True, par)
    return top * value, top * slope / (from_here - low)


def user_curve(mode: int, delta: float, rate: float, par: Any, s: Any) -> Any:
    """Force and its slopes of a law that is not one of ours."""
    law = LAWS[int(par[0])]
    state = tuple(s[: int(par[1])])
    force = law.force(delta, rate, state)
    by_delta, by_rate = law.tangent(delta, rate, state)
    return force, by_delta, by_rate


@compiled(f"UniTuple(float64, 3)(int64, int64, float64, float64, {F1}, {F1})")
def curve(kind: int, mode: int, delta: float, rate: float, par: Any, s: Any) -> Any:
    """Force of a piece and its slopes by indentation and rate; a linear law goes on below 0."""
    if mode in (APART, CUT):
        return 0.0, 0.0, 0.0
    if kind == LINEAR:
        return par[0] * delta, par[0], 0.0
    if kind == USER:
        if COMPILED:
            return 0.0, 0.0, 0.0
        return user_curve(mode, delta, rate, par, s)
    if kind >= THORNTON:
        force, slope = hysteretic(kind, mode, delta, par, s)
        return force, slope, 0.0
    if delta <= 0.0:
        return 0.0, 0.0, 0.0
    if kind == HERTZ:
        k, c = par[0], par[1]
        if c == 0.0:
            root = sqrt(delta)
            return k * delta * root, 1.5 * k * root, 0.0
        a, end = par[2], par[3]  # delta = a s^2 - c s^3 up to s = end, a straight line beyond
        reach = (a - c * end) * end * end
        if delta >= reach:
            return end * end * end + (delta - reach) / par[4], 1.0 / par[4], 0.0
        root = sqrt(delta / a)
        for _ in range(50):
            step = ((a - c * root) * root * root - delta) / ((2.0 * a - 3.0 * c * root) * root)
            root = min(root - step, end)
            if abs(step) <= 1e-9 * root:
                break
        return root * root * root, 1.0 / ((2.0 / 3.0) * a / root - c), 0.0
    n = par[1]
    if n == 1.5:
        elastic = par[0] * delta * sqrt(delta)
    elif n == 1.0:
        elastic = par[0] * delta
    else:
        elastic = par[0] * np.exp(n * log(delta))
    if kind == POWER:
        return elastic, n * elastic / delta, 0.0
    grip = 1.0 + s[0] * rate
    return elastic * grip, n * elastic / delta * grip, elastic * s[0]


@compiled(f"UniTuple(float64, 4)(int64, int64, {F1}, {F1})")
def piece(kind: int, mode: int, par: Any, s: Any) -> Any:
    """Bounds of the piece: least and largest indentation, least and largest rate."""
    origin = 0.0
    if THORNTON <= kind <= TABLE:
        origin = permanent(kind, s[0], par)
    elif kind == USER:
        origin = s[int(par[1])]
    if mode == APART:
        return -inf, origin, -inf, inf
    if kind == DAMPED:
        slow = -1.0 / s[0] if s[0] > 0.0 else -inf
        if mode == CUT:
            return 0.0, inf, -inf, slow
        return 0.0, inf, slow, inf
    if kind < THORNTON or kind == USER:
        return origin, inf, -inf, inf
    if kind == TABLE and par[0] == 1.0:  # elastic
        return origin, inf, -inf, inf
    if mode == BACK:
        return origin, s[1], -inf, inf
    # loading or reloading, up to the next kink
    high = inf
    deepest = s[0]
    if s[2] < deepest:
        high = deepest
    elif kind in (THORNTON, STRONGE):
        if s[2] < par[1]:
            high = par[1]
        elif kind == STRONGE and s[2] < FULLY_PLASTIC * par[1]:
            high = FULLY_PLASTIC * par[1]
    return origin, high, 0.0, inf


@compiled(f"int64(int64, int64, int64, float64, float64, {F1}, {F1})")
def change(kind: int, mode: int, bound: int, delta: float, rate: float, par: Any, s: Any) -> int:
    """The piece beyond a bound; what the contact remembers is brought up to date in `s`.

    With memory s = (deepest, turning point, indentation from which the loading goes on).
    """
    if mode == APART:
        if kind == DAMPED:
            s[1] = max(rate, s[1])
            slow = max(rate, SLOWEST * s[1])
            s[0] = par[2] / slow if slow > 0.0 else 0.0
        elif THORNTON <= kind <= TABLE:
            low = permanent(kind, s[0], par)
            s[2] = low
            retraces = kind != YANG_SUN and kind != TAN_SUN
            if retraces and s[0] > 0.0:
                s[1] = s[0]
                return BACK
            s[1] = low
        elif kind == USER and not COMPILED:
            user_touch(rate, par, s)
        return FORWARD
    if bound == LOW:
        return APART
    if kind == DAMPED:
        return CUT if mode == FORWARD else FORWARD
    if mode == BACK:
        s[2] = max(delta, s[1])
        return FORWARD
    if bound == SLOW:
        s[1] = delta
        s[0] = max(s[0], delta)
        return BACK
    s[2] = delta * (1.0 + 1e-12)  # over a kink
    if s[0] < s[2]:
        s[0] = s[2]
    return FORWARD


def user_touch(rate: float, par: Any, s: Any) -> None:
    law = LAWS[int(par[0])]
    size = int(par[1])
    state = law.touch(max(rate, 0.0), tuple(s[:size]) if s[size + 1] else None)
    s[:size] = state
    s[size], s[size + 1] = law.origin(state), 1.0


def user_advance(delta: float, rate: float, par: Any, s: Any) -> None:
    law = LAWS[int(par[0])]
    size = int(par[1])
    state = law.advance(delta, rate, tuple(s[:size]))
    s[:size] = state
    s[size] = law.origin(state)


@compiled(f"UniTuple(float64, 2)(int64, float64, float64, {F1}, {F1})")
def expected(kind: int, mass: float, speed: float, par: Any, s: Any) -> Any:
    """Depth and force at which a mass would have turned, roughly: F delta = m v^2."""
    base = 0.0
    if THORNTON <= kind <= TABLE:
        base = s[2]
    work = mass * speed * speed
    depth = 1e-6
    for _ in range(60):
        force = curve(kind, FORWARD, base + depth, 0.0, par, s)[0]
        ratio = work / (force * depth) if force * depth > 0.0 else 1e6
        ratio = min(max(ratio, 1e-6), 1e6)
        depth *= ratio**0.4
        if 0.9 < ratio < 1.1:
            break
    return depth, curve(kind, FORWARD, base + depth, 0.0, par, s)[0]


# -- the modes over a step

# What runs over the modes at each step, in the form that compilers turn into vector instructions.


@compiled(f"float64({F1}, {F1})")
def dot(a: Any, b: Any) -> float:
    """a . b"""
    total = 0.0
    for n in range(a.size):
        total += a[n] * b[n]
    return total


@compiled(f"float64({F1}, {F1}, {F1})")
def dot3(a: Any, b: Any, c: Any) -> float:
    """The sum of a b c."""
    total = 0.0
    for n in range(a.size):
        total += a[n] * b[n] * c[n]
    return total


@compiled(f"void(float64, {F1}, {F1}, {F1})")
def multiply(f: float, a: Any, b: Any, out: Any) -> None:
    """out = f a b"""
    for n in range(out.size):
        out[n] = f * a[n] * b[n]


@compiled(f"void({F1}, {F1}, {F1}, {F1}, {F1}, {F1})")
def turn(qq: Any, qv: Any, vv: Any, vq: Any, q: Any, v: Any) -> None:
    """q, v = qq q + qv v, vv v + vq q"""
    for n in range(q.size):
        a, b = q[n], v[n]
        q[n] = qq[n] * a + qv[n] * b
        v[n] = vv[n] * b + vq[n] * a


@compiled(f"void(float64, {F1}, float64, {F1}, float64, {F1}, {F1})")
def subtract(f: float, a: Any, g: float, b: Any, h: float, c: Any, out: Any) -> None:
    """out -= f a + g b + h c"""
    for n in range(out.size):
        out[n] -= f * a[n] + g * b[n] + h * c[n]


@compiled(f"void({F1}, {F1})")
def copy(a: Any, out: Any) -> None:
    """out = a"""
    for n in range(out.size):
        out[n] = a[n]


# Each of the next four is written once for a mode (compiled) and for all modes at once (NumPy).


@compiled("float64(boolean, float64, float64)")
def choose(condition: Any, yes: Any, no: Any) -> Any:
    """`yes` where the condition holds, else `no`."""
    if COMPILED:
        return yes if condition else no
    return np.where(condition, yes, no)


@compiled("boolean(boolean)")
def some(condition: Any) -> Any:
    """Whether the condition holds for any mode."""
    if COMPILED:
        return condition
    return np.any(condition)


@compiled("UniTuple(float64, 3)(float64)")
def phi(z: Any) -> Any:
    """(e^z - 1)/z, (e^z - 1 - z)/z^2 and (e^z - 1 - z - z^2/2)/z^3."""
    near = abs(z) < 0.7
    safe = choose(near, 1.0, z)
    p1 = np.expm1(safe) / safe
    p2 = (p1 - 1.0) / safe
    p3 = (p2 - 0.5) / safe
    zn = choose(near, z, 0.0)
    t1, t2, t3 = 1.0 + 0.0 * zn, 0.5 + 0.0 * zn, 1 / 6 + 0.0 * zn
    s1, s2, s3 = t1, t2, t3
    for k in range(1, 20):
        t1 = t1 * zn / (k + 1)
        t2 = t2 * zn / (k + 2)
        t3 = t3 * zn / (k + 3)
        s1, s2, s3 = s1 + t1, s2 + t2, s3 + t3
    return choose(near, s1, p1), choose(near, s2, p2), choose(near, s3, p3)


@compiled("UniTuple(float64, 6)(float64, float64, float64, float64)")
def undamped(z: Any, t: Any, half: Any, cosine: Any) -> Any:
    """`response` without damping, from z = omega t, sin(z/2) and cos(z/2)."""
    y = choose(z > 0.0, z, 1.0)
    ratio = choose(z > 0.0, half / y, 0.5)
    S, J0 = 2.0 * ratio * cosine, 2.0 * ratio * ratio
    P = 1.0 - 2.0 * half * half
    y = choose(z > 1e-3, y, 1.0)  # whose square is not 0
    over = 1.0 / (y * y)
    J1, J2 = (1.0 - S) * over, (0.5 - J0) * over
    small = z < 1.0
    if some(small):
        near = choose(small, z * z, 0.0)
        a, b = 1.0 - near / 156, 1.0 - near / 182
        a, b = 1.0 - near / 110 * a, 1.0 - near / 132 * b
        a, b = 1.0 - near / 72 * a, 1.0 - near / 90 * b
        a, b = 1.0 - near / 42 * a, 1.0 - near / 56 * b
        a, b = 1.0 - near / 20 * a, 1.0 - near / 30 * b
        J1, J2 = choose(small, a / 6, J1), choose(small, b / 24, J2)
    square = t * t
    return P, P, S * t, J0 * square, J1 * square * t, J2 * square * square


@compiled("UniTuple(float64, 6)(float64, float64, float64, boolean)")
def response(omega: Any, decay: Any, t: Any, damped: bool) -> Any:
    """P, W, S, J0, J1, J2 after a time t.

    Free motion q = P q0 + S v0, v = W v0 - omega^2 S q0; J0, J1, J2 answer to the modal forces 1,
    t and t^2/2. Nothing cancels for small or large omega t or d t.
    """
    z = omega * t
    x = z * z
    if not damped:
        return undamped(z, t, np.sin(0.5 * z), np.cos(0.5 * z))
    e = decay * t
    gap = (e - z) * (e + z)
    g = np.sqrt(abs(gap))
    over = gap > 0.0
    alike = g < 1e-6
    gs = choose(alike, 1.0, g)
    fade = np.exp(-choose(over, 0.0, e))
    # over-damped: the slow root is -x/(e + g), no difference of large numbers
    slow = np.exp(choose(over, -x / choose(over, e + g, 1.0), 0.0))
    fast = np.expm1(choose(over, -2.0 * g, 0.0))
    S = choose(over, -slow * fast / (2.0 * gs), fade * np.sin(g) / gs)
    S = choose(alike, np.exp(-e), S)
    C = choose(over, slow * (1.0 + 0.5 * fast), fade * np.cos(choose(over, 0.0, g)))
    P, W = C + e * S, C - e * S
    xs = choose(x > 0.0, x, 1.0)
    J0 = (1.0 - P) / xs
    J1 = (1.0 - S - 2.0 * e * J0) / xs
    J2 = (0.5 - J0 - 2.0 * e * J1) / xs
    split = gap > 0.25 * e * e
    if some(split):  # partial fractions: J_k = (phi_k+1(slow) - phi_k+1(fast))/(2 g)
        root = choose(split, e + g, 1.0)
        p1, p2, p3 = phi(-x / root)
        f1, f2, f3 = phi(-root)
        width = choose(split, 2.0 * g, 1.0)
        J0 = choose(split, (p1 - f1) / width, J0)
        J1 = choose(split, (p2 - f2) / width, J1)
        J2 = choose(split, (p3 - f3) / width, J2)
    small = (z < 1.0) & (e < 0.5)
    if some(small):  # power series of S, from the differential equation
        e, x = choose(small, e, 0.0), choose(small, x, 0.0)
        a, b = 0.0 * x, 1.0 + 0.0 * x
        s0, s1, s2 = 0.5 * b, b / 6, b / 24
        for k in range(20):
            a, b = b, -(2.0 * e * (k + 1) * b + x * a) / ((k + 1) * (k + 2))
            s0 = s0 + b / (k + 3)
            s1 = s1 + b / ((k + 3) * (k + 4))
            s2 = s2 + b / ((k + 3) * (k + 4) * (k + 5))
        J0, J1, J2 = choose(small, s0, J0), choose(small, s1, J1), choose(small, s2, J2)
    return P, W, S * t, J0 * t**2, J1 * t**3, J2 * t**4


@compiled(f"void({F1}, {F1}, float64, {F2})")
def responses(omega: Any, decay: Any, t: Any, out: Any) -> None:
    """`response` of every mode into out (6, J)."""
    if COMPILED:
        for j in range(omega.size):
            P, W, S, J0, J1, J2 = response(omega[j], decay[j], t, decay[j] > 0.0)
            out[0, j], out[1, j], out[2, j] = P, W, S
            out[3, j], out[4, j], out[5, j] = J0, J1, J2
    else:
        out[:] = response(omega, decay, t, bool(np.any(decay)))


@compiled(f"void({F1}, {F1}, float64, {F2}, {F2})")
def responses_twice(omega: Any, decay: Any, t: float, out: Any, half: Any) -> None:
    """`responses` after a time t and after t/2, which share their sines."""
    for j in range(omega.size):
        z = omega[j] * t
        if decay[j] > 0.0:
            whole = response(omega[j], decay[j], t, True)
            early = response(omega[j], decay[j], 0.5 * t, True)
        else:
            sine, cosine = np.sin(0.25 * z), np.cos(0.25 * z)
            whole = undamped(z, t, 2.0 * sine * cosine, 1.0 - 2.0 * sine * sine)
            early = undamped(0.5 * z, 0.5 * t, sine, cosine)
        out[0, j], out[1, j], out[2, j], out[3, j], out[4, j], out[5, j] = whole
        half[0, j], half[1, j], half[2, j], half[3, j], half[4, j], half[5, j] = early


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


# clock
TIME, BEFORE, FORCE_SCALE, WORKED, GIVEN, HIGHEST, CAP, FINE = range(8)
DURATION, SHARE, LONGEST, KNOWN, STEP, LEFT, SURPLUS, ROOF = range(8, 16)
# count
LEVEL, SEGMENT, STEPS, TOUCHES, NODES, EVENTS, STATES, KEEP = range(8)
MOST_TOUCHES, MOST_STEPS, IDLE, LOADED, RETRIES, SHIFTED, REFUSED = range(8, 15)
# rows of `row`
FORCE, MIDDLE, SLOPE, BEND, DEPTH, RATE, FRESH = range(7)


# -- one step: the forces at h/2 and h


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


@compiled("float64(float64, float64, float64, float64, float64, float64)")
def crossing(y0: float, d0: float, y1: float, d1: float, h: float, bound: float) -> float:
    """When the cubic through values y and slopes d over h meets the bound, which y1 lies beyond."""
    sign = 1.0 if y1 > bound else -1.0
    if sign * (y0 - bound) >= 0.0:
        if sign * d0 >= 0.0:
            return 0.0
        y0 = bound  # it was on the bound, but for rounding, and goes inward first
    a, b = h * d0, 3.0 * (y1 - y0) - h * (2.0 * d0 + d1)
    c = 2.0 * (y0 - y1) + h * (d0 + d1)
    low, high = 0.0, 1.0
    u = min(max((bound - y0) / (y1 - y0), 0.1), 0.9)
    for _ in range(60):
        y = y0 + u * (a + u * (b + u * c)) - bound
        if sign * y > 0.0:
            high = u
        else:
            low = u
        slope = a + u * (2.0 * b + 3.0 * c * u)
        new = u - y / slope if slope * sign > 0.0 else -1.0
        if not low < new < high:
            new = 0.5 * (low + high)
        if abs(new - u) < 1e-12:
            break
        u = new
    return u * h


@compiled(f"float64({F2}, {F1})")
def mechanical(x: Any, omega: Any) -> float:
    """Kinetic and strain energy."""
    total = 0.0
    if COMPILED:
        for j in range(omega.size):
            total += (omega[j] * x[0, j]) ** 2 + x[1, j] ** 2
    else:
        strained = omega * x[0]
        total = float(strained.dot(strained) + x[1].dot(x[1]))
    return 0.5 * total


# -- free flight


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


# -- contact


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


@compiled(f"float64({', '.join(['float64'] * 9)})")
def polished(
    at: float,
    y0: float,
    d0: float,
    y1: float,
    d1: float,
    y2: float,
    d2: float,
    h: float,
    bound: float,
) -> float:
    """A crossing at about the time `at`, on the polynomial through values and slopes at 0, h/2, h.

    Two steps of Newton's method; `at` itself where they lead away.
    """
    a1 = h * d0
    first, second = 2.0 * (y1 - y0), 2.0 * (y2 - y1)
    middle = h * d1
    a2, b2 = 2.0 * (first - a1), 2.0 * (middle - first)
    c2, e2 = 2.0 * (second - middle), 2.0 * (h * d2 - second)
    a3, b3, c3 = 2.0 * (b2 - a2), c2 - b2, 2.0 * (e2 - c2)
    a4 = b3 - a3
    a5 = c3 - b3 - a4
    u = at / h
    for _ in range(2):
        w, z = u - 0.5, u - 1.0
        inner = a3 + w * (a4 + z * a5)
        y = y0 + u * (a1 + u * (a2 + w * inner)) - bound
        slope = a1 + u * (2.0 * a2 + 2.0 * w * inner + u * (inner + w * (a4 + (z + w) * a5)))
        if slope == 0.0:
            return at
        u -= y / slope
    return u * h if abs(u * h - at) < 0.1 * h and 0.0 < u < 1.0 else at


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


# -- the course of events


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


# -- what two runs differ by, and the energy along a run


@compiled(f"float64({F1}, {F2}, int64, int64, float64)", inline=True)
def force_at(time: Any, force: Any, start: int, i: int, t: float) -> float:
    """Force of a row at a time t of the step that starts at a node."""
    h = time[start + 2] - time[start]
    u = min(max((t - time[start]) / h, 0.0), 1.0) if h > 0.0 else 0.0
    f0, f1, f2 = force[start, i], force[start + 1, i], force[start + 2, i]
    return f0 + u * ((4.0 * f1 - 3.0 * f0 - f2) + 2.0 * u * (f0 - 2.0 * f1 + f2))


@compiled(f"UniTuple(float64, 3)({F1}, {F2}, {F1}, {F2}, float64, float64, {F2})")
def compare(
    time_a: Any, force_a: Any, time_b: Any, force_b: Any, end: float, limit: float, peaks: Any
) -> Any:
    """Integrals of |a - b|^2 and |b|^2 up to `end` over the nodes of both runs.

    With them the time when the first has used up `limit`; the largest |a| and |b| of every row into
    peaks (2, m). Compiled only; `convergence.difference` does it with NumPy.
    """
    gap, size, before, last, last_size = 0.0, 0.0, 0.0, 0.0, 0.0
    na, nb, i, j, a, b = time_a.size, time_b.size, 0, 0, 0, 0
    until = end
    while i < na or j < nb:
        if j >= nb or (i < na and time_a[i] <= time_b[j]):
            t = time_a[i]
            i += 1
        else:
            t = time_b[j]
            j += 1
        if t > end:
            break
        while a + 3 < na and time_a[a + 2] <= t:
            a += 2
        while b + 3 < nb and time_b[b + 2] <= t:
            b += 2
        apart, square = 0.0, 0.0
        for r in range(force_a.shape[1]):
            fa, fb = force_at(time_a, force_a, a, r, t), force_at(time_b, force_b, b, r, t)
            apart += (fa - fb) ** 2
            square += fb * fb
            peaks[0, r], peaks[1, r] = max(peaks[0, r], abs(fa)), max(peaks[1, r], abs(fb))
        gap += 0.5 * (t - before) * (apart + last)
        size += 0.5 * (t - before) * (square + last_size)
        before, last, last_size = t, apart, square
        if gap > limit and until == end:
            until = t
    return gap, size, until


@compiled(f"UniTuple(float64, 2)({F1}, {F2}, int64, int64, int64)")
def pulse(time: Any, force: Any, i: int, first: int, last: int) -> Any:
    """Time integral of the force of row i from step `first` to `last`, and its largest value."""
    area, top = 0.0, 0.0
    for n in range(2 * first, 2 * last, 2):
        f0, f1, f2 = force[n, i], force[n + 1, i], force[n + 2, i]
        area += (time[n + 2] - time[n]) * (f0 + 4.0 * f1 + f2) / 6.0
        a, b = f1 - f0, f2 - f1
        if 3.0 * a > b and 3.0 * b < a:  # it rises at first and falls at last
            top = max(top, f0 + (3.0 * a - b) ** 2 / (8.0 * (a - b)))
        else:
            top = max(top, f0, f2)
    return area, top


@compiled(f"void({F3}, {F1}, {F1})")
def energies(states: Any, omega: Any, out: Any) -> None:
    """`mechanical` of states (n, 2, J) into out (n,)."""
    if COMPILED:
        for k in range(out.size):
            out[k] = mechanical(states[k], omega)
    else:
        strained, moving = states[:, 0] * omega, states[:, 1]
        out[:] = np.einsum("nj,nj->n", strained, strained) + np.einsum("nj,nj->n", moving, moving)
        out *= 0.5
