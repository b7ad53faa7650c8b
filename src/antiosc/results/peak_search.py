"""Largest values over a run: at times fine enough for the fastest motion, refined at the maxima.

The motion of a node is a sum of modes. Near its largest value, at t*, the value falls by no more
than half the square of the distance from t* times what the modes can curve it, so that times with
the step h miss at most

    Σ_j W_j A_j min(2, (ω_j h)²/8),

A_j the largest amplitude of the mode j in the run and W_j its value at the node with the amplitude
1. The step is chosen by the largest of this bound over the values of the nodes. Then each node's
highest maximum, that of the parabola through three times, is looked at closely.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass

import numpy as np

from antiosc.base._types import Array, IntArray

#: Share of a node's value that the times before refinement may miss; values below this share of
#: the largest one count as that.
MISSED, FLOOR = 0.01, 0.1
#: Steps over the run, at least and at most.
FEWEST, MOST = 500, 40_000
#: Times that are looked at together, and parts of a step about a maximum.
WINDOW, PARTS = 1000, 8
#: Bytes of the values of a block of nodes at these times.
BLOCK_BYTES = 2**26
#: Two nodes of a history closer than this share of the run are one.
SAME_TIME = 1e-12


@dataclass(frozen=True, eq=False)
class Motion:
    """The motion of a body over a run.

    Attributes
    ----------
    nodes : (n,) times of the history [s].
    factors : times (k,) -> factors (k, B) of the columns.
    omega : (J,) of the modes [rad/s]; shapes (J, B) their factors; sizes (J,) their amplitudes.
    """

    nodes: Array
    factors: Callable[[Array], Array]
    omega: Array
    shapes: Array
    sizes: Array


def search(
    motion: Motion, columns: Array, scalar: Callable[[Array], Array]
) -> tuple[Array, Array, float]:
    """Largest value (S,) of a scalar of components (S, c, B), its time, and what it may miss.

    `scalar`: (..., c) -> (...,), a norm.
    """
    step, missed = _step(motion, columns, scalar)
    times = _divided(motion.nodes, step)
    sampled, near = np.full((2, len(columns)), -np.inf), np.zeros((2, len(columns)), dtype=int)
    for first in range(0, max(len(times) - 2, 1), WINDOW - 2):
        t = times[first : first + WINDOW]
        factors = motion.factors(t)
        for block in _blocks(columns, len(t)):
            y = _values(columns[block], factors, scalar)
            for best, k, found in zip(sampled, near, (y, _tops(t, y)), strict=True):
                at = found.argmax(axis=1)
                top = found[np.arange(len(at)), at]
                higher = np.flatnonzero(top > best[block])
                best[block][higher], k[block][higher] = top[higher], first + at[higher]
    values, when = sampled[0], times[near[0]]
    finer, then = _refined(motion, columns, scalar, times, near[1])
    higher = finer > values
    return np.where(higher, finer, values), np.where(higher, then, when), missed


def largest(
    columns: Array, factors: Array, times: Array, scalar: Callable[[Array], Array]
) -> tuple[Array, Array]:
    """Largest value (S,) of a scalar of components (S, c, B) at these times, and its time."""
    values, when = np.zeros(len(columns)), np.zeros(len(columns))
    for block in _blocks(columns, len(times)):
        found = _values(columns[block], factors, scalar)
        k = found.argmax(axis=1)
        values[block], when[block] = found[np.arange(len(k)), k], times[k]
    return values, when


def _step(motion: Motion, columns: Array, scalar: Callable[[Array], Array]) -> tuple[float, float]:
    """Step [s] of the times, and what they may miss."""
    every = max(1, len(motion.nodes) // FEWEST)
    at = motion.nodes[::every]
    values, _ = largest(columns, motion.factors(at), at, scalar)
    top = float(values.max(initial=0.0))
    values = np.maximum(values, FLOOR * top)
    # of the node where the modes curve the value most, relative to it
    curved, weights = 0.0, np.zeros(len(motion.omega))
    for block in _blocks(columns, len(weights)) if top else ():
        own = _values(columns[block], motion.shapes, scalar) * motion.sizes / values[block, None]
        bends = own @ motion.omega**2
        worst = int(bends.argmax())
        if bends[worst] > curved:
            curved, weights = float(bends[worst]), own[worst]

    def missed(h: float) -> float:
        return float(weights @ np.minimum(2.0, (motion.omega * h) ** 2 / 8))

    whole = float(motion.nodes[-1] - motion.nodes[0])
    step = whole / FEWEST
    while missed(step) > MISSED and step > whole / MOST:
        step = max(step / 1.5, whole / MOST)
    return step, missed(step) * top


def _divided(nodes: Array, step: float) -> Array:
    """The nodes, and even times between those that are farther apart than the step."""
    nodes = np.unique(nodes)
    nodes = nodes[np.append(True, np.diff(nodes) > SAME_TIME * (nodes[-1] - nodes[0]))]
    gaps = np.diff(nodes)
    parts = np.maximum(np.ceil(gaps / step), 1).astype(int) if step else np.ones(len(gaps), int)
    first = np.repeat(np.cumsum(parts) - parts, parts)
    share = (np.arange(parts.sum()) - first) / np.repeat(parts, parts)
    return np.append(np.repeat(nodes[:-1], parts) + share * np.repeat(gaps, parts), nodes[-1])


def _tops(t: Array, y: Array) -> Array:
    """Values (S, n), at local maxima those of the parabola through three of them."""
    tops = y.copy()
    if len(t) < 3:
        return tops
    before, after = np.diff(t)[:-1], np.diff(t)[1:]
    rise, fall = np.diff(y)[:, :-1] / before, np.diff(y)[:, 1:] / after
    bend = (fall - rise) / (before + after)
    slope = (fall * before + rise * after) / (before + after)
    inside = (rise >= 0) & (fall <= 0) & (bend < 0)
    gain = np.divide(slope**2, -4 * bend, out=np.zeros_like(bend), where=inside)
    tops[:, 1:-1] += gain
    return tops


def _refined(
    motion: Motion, columns: Array, scalar: Callable[[Array], Array], times: Array, near: IntArray
) -> tuple[Array, Array]:
    """Largest values (S,) within a step of the times `near` (S,), and their times."""
    values, when = np.zeros(len(columns)), np.zeros(len(columns))
    order = np.argsort(near, kind="stable")
    used, starts = np.unique(near[order], return_index=True)
    groups = np.split(order, starts[1:])
    share = np.linspace(0, 1, PARTS + 1)
    before, after = times[np.maximum(used - 1, 0)], times[np.minimum(used + 1, len(times) - 1)]
    at = times[used]
    fine = np.concatenate(
        (
            before[:, None] + (at - before)[:, None] * share,
            at[:, None] + (after - at)[:, None] * share[1:],
        ),
        axis=1,
    )
    for first in range(0, len(used), WINDOW // fine.shape[1]):
        some = slice(first, first + WINDOW // fine.shape[1])
        factors = motion.factors(fine[some].ravel()).reshape(*fine[some].shape, -1)
        for own, t, group in zip(factors, fine[some], groups[some], strict=True):
            values[group], when[group] = largest(columns[group], own, t, scalar)
    return values, when


def _values(columns: Array, factors: Array, scalar: Callable[[Array], Array]) -> Array:
    """Scalar (S, n) of components (S, c, B) with factors (n, B)."""
    return scalar(np.moveaxis(columns @ factors.T, 1, -1))


def _blocks(columns: Array, times: int) -> Iterator[slice]:
    """Slices of nodes whose values at so many times fit `BLOCK_BYTES`."""
    size = max(1, int(BLOCK_BYTES / (8 * 3 * columns.shape[1] * times)))
    return (slice(first, first + size) for first in range(0, len(columns), size))
