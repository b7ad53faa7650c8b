"""Windows of instability of the exact integrator, and detection of growing energy.

The force of the exact integrator is linear over a step. Its kinks contain frequencies above the
Nyquist frequency pi/h, which can excite the modes. For a contact of constant stiffness k the motion
is proportional to z^n, and with u = 1 - (z + 1/z)/2 every undamped mode responds to the force with
the compliance

    (b/omega)^2 [1 - sinc(y) u/(u - a)],    y = omega h,  a = 1 - cos y,  sinc y = sin(y)/y.

With the residual compliance r and the sum of all modes, the poles z obey f(u) = 1/k + D, where

    f(u) = sum A/(u - a),  A = (b/omega)^2 a sinc y,    D = r + sum (b/omega)^2 (1 - sinc y).

|z| = 1 as long as u is real and 0 <= u <= 2. From k = 0 on a root leaves each pole a of f, upward
if A > 0 (y below pi, or every second interval above), downward if A < 0, and none passes a pole.
So there are two ways out of the unit circle: the root above the last pole passes u = 2, which is
z = -1 (a mode below pi/h that the contact lifts above: with one free mass it is k h^2/m = 12), or
two roots between neighbouring poles with A > 0 and A < 0 meet (omega_i + omega_j = 2 pi/h nearly).
Both occur if min f there exceeds 1/k + D, the sooner the stiffer the contact.

Damping is neglected. It reduces the growth. It can widen a window only if one mode of a pair is
damped much more than the other; the growth is then below that without damping.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np

from antiosc._types import Array, BoolArray, Index
from antiosc.simulation.integrators.problem import Problem

STIFFNESS_SAFETY = 1.2  # on the contact stiffness, which is an estimate
_SLOW = 1e-3  # modes that could grow by no more in a step are left out
_NONE = 1e-290  # contact stiffness [N/m] that counts as none
_TRIES = 4  # to find the minimum of f between two poles
_FIRST, _MOST, _CUTS = 0.015, 0.2, 30  # by what, at first and at most, a step is cut; how often


def margin(omega: Array, beta: Array, r: Array, stiffness: Array, h: Array) -> Array:
    """Factor (S,) by which the contact may stiffen before the steps become unstable.

    Below 1 they are unstable at some stiffness up to the given one.

    Parameters
    ----------
    omega, beta : (S, J) circular frequencies [rad/s] and modal coefficients [kg^-1/2].
    r, stiffness, h : (S,) residual compliance [m/N], contact stiffness [N/m] and step [s].
    """
    y = omega * h[:, None]
    sine, cosine = np.sin(0.5 * y), np.cos(0.5 * y)
    half = np.divide(2 * sine, y, out=np.ones_like(y), where=y > 1e-8)
    sinc, a = half * cosine, 2 * sine**2
    reach = (beta * h[:, None]) ** 2  # b^2/omega^2 = reach/y^2
    A = 0.5 * reach * sinc * half**2
    rest = np.divide(1 - sinc, y**2, out=1 / 6 - y**2 / 120, where=y > 0.05)
    D = r + (reach * rest).sum(axis=1)
    soft = 1 / stiffness
    # two modes at one pole grow by sqrt(-A1 A2)/(1/k + D)/sin(angle of z) in a step
    size = np.abs(A)
    most = np.sqrt(size * size.max(axis=1)[:, None])
    heavy = most > _SLOW * (soft + D)[:, None] * np.abs(2 * sine * cosine)
    A = np.where(heavy, A, 0.0)
    a = np.where(heavy, a, -1.0)  # out of the way, at the front

    each = np.arange(h.size)
    lift = np.zeros(h.size)
    if (A < 0).any():
        order = each[:, None], np.argsort(a, axis=1)
        a, A = a[order], A[order]
        last = A[:, -1]
    else:
        last = A[each, a.argmax(axis=1)]
    up = np.flatnonzero(last > 0)
    with np.errstate(divide="ignore"):
        lift[up] = (A[up] / (2.0 - a[up])).sum(axis=1)
    rows, left = np.nonzero((A[:, :-1] > 0) & (A[:, 1:] < 0))
    if rows.size:
        np.maximum.at(lift, rows, _lowest(a[rows], A[rows], left))
    excess = lift - D
    return np.where(excess > 0, soft / np.where(excess > 0, excess, 1.0), np.inf)


def _lowest(a: Array, A: Array, left: Index) -> Array:
    """Minimum of f between the poles `left` and the next, from above; one row for each."""
    each, one = np.arange(left.size), np.ones(a.shape[1])
    below = np.where(np.arange(a.shape[1]) <= left[:, None], A, 0.0)
    a1, a2 = a[each, left], a[each, left + 1]
    w1, w2 = np.sqrt(A[each, left]), np.sqrt(-A[each, left + 1])
    low = np.full(left.size, np.inf)
    with np.errstate(divide="ignore", invalid="ignore"):
        for _ in range(_TRIES):
            # where poles of the weights w1^2 at a1 and w2^2 at a2 balance in f'
            u = (a1 * w2 + a2 * w1) / (w1 + w2)
            part = 1 / (u[:, None] - a)
            found = (a1 < u) & (u < a2)
            low = np.where(found, np.fmin(low, (A * part) @ one), low)
            # the weights with which they would stand for all the poles on their sides
            fall, rise = (below * part**2) @ one, ((below - A) * part**2) @ one
            w1 = np.sqrt(np.maximum(fall, 0.0)) * (u - a1)
            w2 = np.sqrt(np.maximum(rise, 0.0)) * (a2 - u)
    return low


def clear_steps(
    omega: Array, beta: Array, r: Array, stiffness: Array, h: Array, least: Array
) -> Array:
    """The largest steps (S,) at or just below `h` that lie outside the windows.

    Parameters
    ----------
    omega, beta, r, h : as for `margin`.
    stiffness : (S,) largest contact stiffness that is expected [N/m]; 0: not known.
    least : (S,) steps [s] below which `h` itself is returned: no stable step was found.
    """
    clear = h.copy()
    rows, cut = np.flatnonzero(stiffness > _NONE), _FIRST
    for _ in range(_CUTS):
        room = margin(omega[rows], beta[rows], r[rows], stiffness[rows], clear[rows])
        rows = rows[room < STIFFNESS_SAFETY]
        if rows.size == 0:
            break
        clear[rows] *= 1 - cut
        cut = min(2 * cut, _MOST)
        lost = clear[rows] < least[rows]
        clear[rows[lost]] = h[rows[lost]]
        rows = rows[~lost]
    clear[rows] = h[rows]
    return clear


def clear_step(problem: Problem, h: float, least: float = 0.0) -> float:
    """`clear_steps` for one problem."""
    p = problem
    r, stiffness, step, bound = (np.array([x]) for x in (p.r, p.stiffness, h, least))
    return float(clear_steps(p.omega[None], p.beta[None], r, stiffness, step, bound)[0])


def growth(
    square: Array, load: Array, q0: Array, v0: Array, most: float, beta: Array | float = 1.0
) -> Callable[[Array, Array], BoolArray]:
    """Function that tells whether the energy at (q, v) exceeds `most` times the energy supplied.

    The energy supplied is that at (q0, v0), without contact, plus the work of the loads; a contact
    cannot add to it. Modes that the contact does not excite (beta = 0) are left out, because their
    energy would hide a growth. All arrays of shape (J,) or (S, J); `square` is omega^2.
    """
    struck = np.not_equal(beta, 0)

    def product(a: Array, b: Array) -> Any:
        return a.dot(b) if a.ndim == 1 else np.einsum("sj,sj->s", a, b)

    def mechanical(q: Array, v: Array) -> Any:
        return 0.5 * (product(struck * v, v) + product(struck * square * q, q))

    start = mechanical(q0, v0)

    def grown(q: Array, v: Array) -> BoolArray:
        fall = abs(product(struck * load, q - q0))
        return np.logical_not(mechanical(q, v) <= most * (start + fall))

    return grown
