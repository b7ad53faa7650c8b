"""Motion of bodies from rest under forces that are given in time."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np

from antiosc.base import checks
from antiosc.base._types import Array
from antiosc.engine import library
from antiosc.models.body import LinearBody

#: Bodies processed together, and times at which u is evaluated in addition to those of the force:
#: at least, at most, and in a period of the first mode.
BODIES_AT_ONCE, SAMPLES, MOST_SAMPLES, A_PERIOD = 200, 200, 20_000, 40
#: Times [s] and the force [N] at them, linear between them and zero outside.
Force = tuple[Array, Array]


def peak_deflections(
    bodies: Sequence[LinearBody], forces: Sequence[Force], duration: float
) -> Array:
    """Largest displacement u (S,) [m] of each body's site along the impact, up to `duration` [s].

    The bodies are at rest at the start. forces : times [s] and the force [N] on each body, linear
    between the times and zero outside. The result is exact at the times of the force, and at 200
    times over the duration or more: 40 a period of the first mode.
    """
    duration = checks.positive("duration", duration, "s")
    peaks = [
        _peaks(bodies[i : i + BODIES_AT_ONCE], forces[i : i + BODIES_AT_ONCE], duration)
        for i in range(0, len(bodies), BODIES_AT_ONCE)
    ]
    return np.concatenate([np.zeros(0), *peaks])


def _peaks(bodies: Sequence[LinearBody], forces: Sequence[Force], duration: float) -> Array:
    modal = [body.modal() for body in bodies]
    omega, b, decay = (
        _padded_rows([m.omega for m in modal], 0.0),
        _padded_rows([m.b for m in modal], 0.0),
        _padded_rows([np.zeros(m.b.size) if m.decay is None else m.decay for m in modal], 0.0),
    )
    r = np.array([m.r for m in modal])
    peak = np.zeros(len(modal))
    first = max((w[w > 0].min() for w in omega if (w > 0).any()), default=0.0)
    samples = int(np.clip(A_PERIOD * duration * first / (2 * np.pi), SAMPLES, MOST_SAMPLES))
    for _, q, F in motions(omega, b, decay, forces, duration, samples):
        peak = np.maximum(peak, np.sum(b * q, axis=1) + r * F)
    return peak


def motions(
    omega: Array, b: Array, decay: Array, forces: Sequence[Force], duration: float, samples: int
) -> Iterator[tuple[Array, Array, Array]]:
    """Motions of bodies from rest: times, modal displacements (S, J), forces, step by step.

    At the times of each force [s] and at `samples` over the duration; the last one is repeated
    where a body has fewer than another. omega, b, decay : (S, J) of the modes.
    """
    even = np.linspace(0, duration, samples)
    times = [np.union1d(even, time) for time, _ in forces]
    steps = zip(times, forces, strict=True)
    force = [
        np.interp(at, t, F, left=0.0, right=0.0) if t.size else np.zeros_like(at)
        for at, (t, F) in steps
    ]
    time, F = _padded_rows(times, None), _padded_rows(force, 0.0)
    q, v = np.zeros_like(b), np.zeros_like(b)
    for k in range(time.shape[1] - 1):
        h = time[:, k + 1] - time[:, k]
        P, W, S, J0, J1, _ = library.responses(omega, decay, h[:, None])
        rise = (b.T * ((F[:, k + 1] - F[:, k]) / np.where(h > 0, h, 1.0))).T
        push = b * F[:, k, None]
        q, v = (
            P * q + S * v + push * J0 + rise * J1,
            W * v - omega**2 * S * q + push * S + rise * J0,
        )
        yield time[:, k + 1], q, F[:, k + 1]


def _padded_rows(rows: Sequence[Array], filler: float | None) -> Array:
    """Rows of different length as one array; None repeats the last value."""
    size = max(row.size for row in rows)
    return np.array(
        [
            np.pad(row, (0, size - row.size), constant_values=row[-1] if filler is None else filler)
            for row in rows
        ]
    )
