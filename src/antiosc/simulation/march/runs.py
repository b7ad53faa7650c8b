"""What is read from runs: energies, the pulse of a contact, the difference of two runs."""

from __future__ import annotations

from typing import Any

import numpy as np

from .compiling import COMPILED, compiled
from .layout import F1, F2, F3


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
