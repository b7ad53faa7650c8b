"""Motion of bodies from rest under given force histories."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np

from antiosc.base import checks
from antiosc.base._types import Array, IntArray
from antiosc.base.progress import counting
from antiosc.engine import library
from antiosc.models.body import LinearBody

#: Bodies processed together.
BODIES_AT_ONCE = 200
#: Times at which u is evaluated in addition to those of the force, at least and at most, and in a
#: period of the first mode, whose largest value they miss by at most 0.3 %.
MIN_SAMPLES, MAX_SAMPLES, SAMPLES_PER_PERIOD = 200, 20_000, 40
#: Times [s] and the force [N] at them, linear between them and zero outside.
ForceSeries = tuple[Array, Array]


def peak_deflections(
    bodies: Sequence[LinearBody], forces: Sequence[ForceSeries], duration: float | Array
) -> Array:
    """Largest displacement u (S,) [m] of each body's site along the impact, from rest.

    The forces are linear between their times and zero outside. The displacement is exact at these
    times and at 200 to 20 000 times over the duration (40 per period of the first mode).
    """
    longest = checks.positive("duration", float(np.max(duration)), "s")
    durations = np.broadcast_to(duration, len(bodies)) if len(bodies) else np.array([longest])
    peaks = np.zeros(len(bodies))

    with counting("largest deflections", len(bodies)) as ready:
        for first in range(0, len(bodies), BODIES_AT_ONCE):
            span = slice(first, first + BODIES_AT_ONCE)
            peaks[span] = _peak_deflections(bodies[span], forces[span], durations[span])
            ready(min(span.stop, len(bodies)))

    return peaks


def _peak_deflections(
    bodies: Sequence[LinearBody], forces: Sequence[ForceSeries], durations: Array
) -> Array:
    modes = [body.modal() for body in bodies]
    omega = _padded_rows([body.omega for body in modes], 0.0)
    b = _padded_rows([body.b for body in modes], 0.0)
    decays = [np.zeros(body.b.size) if body.decay is None else body.decay for body in modes]
    decay = _padded_rows(decays, 0.0)
    residual = np.array([body.r for body in modes])
    first = max((row[row > 0].min() for row in omega if (row > 0).any()), default=0.0)
    periods = durations * first / (2 * np.pi)
    samples = np.clip(SAMPLES_PER_PERIOD * periods, MIN_SAMPLES, MAX_SAMPLES).astype(int)
    peak = np.zeros(len(modes))
    for _, q, force in motions_from_rest(omega, b, decay, forces, durations, samples):
        u = np.sum(b * q, axis=1) + residual * force
        peak = np.maximum(peak, u)

    return peak


def motions_from_rest(
    omega: Array,
    b: Array,
    decay: Array,
    forces: Sequence[ForceSeries],
    durations: Array,
    samples: IntArray,
) -> Iterator[tuple[Array, Array, Array]]:
    """Yield (times, modal displacements (S, J), forces) of S bodies from rest, step by step."""
    even_times = map(np.linspace, np.zeros(len(forces)), durations, samples)
    times = [np.union1d(even, own) for even, (own, _) in zip(even_times, forces, strict=True)]
    values = [
        np.interp(t, *force, left=0.0, right=0.0) if force[0].size else np.zeros(t.size)
        for t, force in zip(times, forces, strict=True)
    ]
    time = _padded_rows(times, None)
    force = _padded_rows(values, 0.0)

    q = np.zeros_like(b)
    v = np.zeros_like(b)
    for k in range(time.shape[1] - 1):
        h = time[:, k + 1] - time[:, k]
        P, W, S, J0, J1, _ = library.responses(omega, decay, h[:, None])
        slope = (force[:, k + 1] - force[:, k]) / np.where(h > 0, h, 1.0)
        rise = (b.T * slope).T
        modal_force = b * force[:, k, None]
        q_end = P * q + S * v + modal_force * J0 + rise * J1
        v = W * v - omega**2 * S * q + modal_force * S + rise * J0
        q = q_end
        yield time[:, k + 1], q, force[:, k + 1]


def _padded_rows(rows: Sequence[Array], filler: float | None) -> Array:
    """Rows of different lengths as one array, padded with `filler` or (None) the last value."""
    size = max(row.size for row in rows)
    padded = []
    for row in rows:
        value = row[-1] if filler is None else filler
        padded.append(np.pad(row, (0, size - row.size), constant_values=value))
    return np.array(padded)
