"""The free and the forced motion of modes after a time, and what runs over the modes at each step.

The latter in the form that compilers turn into vector instructions. `choose`, `some`, `phi`,
`undamped` and `response` are written once for a mode (compiled) and for all modes at once (NumPy).
"""

from __future__ import annotations

from typing import Any

import numpy as np

from .compiling import COMPILED, compiled
from .layout import F1, F2


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
