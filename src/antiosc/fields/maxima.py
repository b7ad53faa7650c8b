"""The largest value of a scalar at every node over a run, and its time.

The motion of a node is a sum of modes. Near the largest value, its curvature in time is bounded by
the curvatures of the modes. Samples with the step h therefore miss at most

    Σ_j W_j A_j min(2, (ω_j h)²/8),

where A_j is the largest amplitude of mode j in the run and W_j the value at the node for an
amplitude of 1. All nodes are sampled at about 500 times. Nodes with at least half of the largest
judged value are sampled again with a step for which this bound is 1 %. A parabola through the
largest sample of a node and its neighbours gives the value.
"""

from __future__ import annotations

import functools
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from antiosc.base._types import Array, BoolArray
from antiosc.impact.histories.factors import (
    AnyHistory,
    modal_amplitudes,
    shape_factors,
    stretch_of_motion,
)
from antiosc.impact.histories.parts import BodyHistory

#: Arrays in double or single precision.
RealArray = NDArray[np.floating[Any]]
#: A scalar (...,) of components (..., c), a norm.
ScalarFunction = Callable[[Array], Array]
#: Function (components (S, c, B), scalar, mask (S,) of those that count) -> as `searched_maxima`.
MaximumSearch = Callable[[Array, ScalarFunction, BoolArray], tuple[Array, Array, float | None]]

#: Share of a value that the samples may miss, of those from half of the largest one on.
MAX_MISSED_SHARE, HIGH_VALUE_SHARE = 0.01, 0.5
#: Fewest steps over the run, and most, so that long runs of high modes end.
MIN_STEPS, MAX_STEPS = 500, 40_000
#: Times whose motion is computed together, and bytes of the values of a block of nodes.
TIMES_AT_ONCE, BLOCK_BYTES = 1000, 2**26
#: Two nodes of a history closer than this share of the run are one.
SAME_TIME_SHARE = 1e-12


@dataclass(frozen=True, eq=False)
class BodyMotion:
    """Motion of a body over a run, as the factors of the B columns of a field."""

    node_times: Array  # (n,) of the history [s]
    factors: Callable[[Array], Array]  # times (k,) -> (k, B)
    omega: Array  # (J,) of the modes [rad/s]
    shapes: Array  # (J, B) factors of a unit amplitude of each mode
    sizes: Array  # (J,) largest amplitudes of the modes


def search_of(
    history: AnyHistory, body: str, derivative: int, times: Array, *, given: bool, static: bool
) -> MaximumSearch:
    """Function for maxima over a run, or at `times` if `given`; `static`: last column is static."""

    def factors(at: Array) -> Array:
        """Factors (k, B) of the columns at times (k,) [s]."""
        found = shape_factors(history, at, body, derivative)
        return np.pad(found, ((0, 0), (0, int(static))), constant_values=1.0)

    if given or isinstance(history, BodyHistory):
        return search_at_times(factors(times), times)

    times = _evenly_chosen(times, MAX_STEPS)
    omega, modal, sizes = modal_amplitudes(history, times, body, derivative)
    columns = factors(times[:1]).shape[1]
    modal = np.pad(modal, ((0, 0), (0, columns - modal.shape[1])))
    motion = BodyMotion(times, factors, omega, modal, sizes)
    bounded = stretch_of_motion(history, body) is None
    return functools.partial(searched_maxima, motion, bounded=bounded)


def search_at_times(factors: Array, times: Array) -> MaximumSearch:
    """A function that finds the largest values at `times` (k,) from `factors` (k, B)."""

    def search(columns: Array, scalar: ScalarFunction, _: BoolArray) -> tuple[Array, Array, None]:
        """As `searched_maxima`, without an error bound."""
        return (*sampled_maxima(columns, factors, times, scalar), None)

    return search


def searched_maxima(
    motion: BodyMotion,
    columns: Array,
    scalar: ScalarFunction,
    counted: BoolArray,
    bounded: bool = True,
) -> tuple[Array, Array, float | None]:
    """(largest value (S,), its time (S,) [s], bound on what is missed if `bounded`) of `scalar`, a
    function (S, n, c) -> (S, n), of components `columns` (S, c, B); `counted` (S,): nodes that
    decide the time step."""
    if not len(columns):  # they are those of another rank
        return np.zeros(0), np.zeros(0), 0.0

    coarse = float(np.ptp(motion.node_times)) / MIN_STEPS
    values, times = _step_maxima(motion, coarse, columns, scalar)
    top = float(values[counted].max(initial=0.0))
    if not top:
        return values, times, 0.0

    high = np.flatnonzero(counted & (values >= HIGH_VALUE_SHARE * top))
    step, missed = _time_step(motion, coarse, columns[high], values[high], scalar)
    if step < coarse:
        values[high], times[high] = _step_maxima(motion, step, columns[high], scalar)
    return values, times, missed * top if bounded else None


def _step_maxima(
    motion: BodyMotion, step: float, columns: Array, scalar: ScalarFunction
) -> tuple[Array, Array]:
    """(largest value (S,), its time (S,)), by parabolas, with time steps of `step` [s]."""
    times = _sample_times(motion.node_times, step)
    blocks = (times[k : k + TIMES_AT_ONCE] for k in range(0, len(times), TIMES_AT_ONCE))
    factors = np.concatenate([motion.factors(block) for block in blocks])
    number = np.arange(1.0 * len(times))
    single = columns.astype(np.float32), factors.astype(np.float32)
    k = sampled_maxima(*single, number, scalar)[1].astype(int)

    three = np.clip(k[:, None] + (-1, 0, 1), 0, len(times) - 1)
    y = np.zeros(three.shape)
    for block in _node_blocks(len(columns), 3 * factors.shape[1]):
        near = np.einsum("scb,snb->snc", columns[block], factors[three[block]], optimize=True)
        y[block] = scalar(near)
    return _parabola_tops(times[three], y)


def sampled_maxima(
    columns: RealArray, factors: RealArray, times: Array, scalar: ScalarFunction
) -> tuple[Array, Array]:
    """(largest value (S,) of a scalar of `columns` (S, c, B) at `times`, its time (S,))."""
    values = np.zeros(len(columns))
    peak_times = np.zeros(len(columns))
    for block in _node_blocks(len(columns), columns.shape[1] * len(times)):
        sampled = _scalar_values(columns[block], factors, scalar)
        k = sampled.argmax(axis=1)
        values[block] = sampled[np.arange(len(k)), k]
        peak_times[block] = times[k]
    return values, peak_times


def _parabola_tops(t: Array, y: Array) -> tuple[Array, Array]:
    """(largest values (S,), their times (S,)) of parabolas through y (S, 3) at t (S, 3)."""
    before, after = t[:, 1] - t[:, 0], t[:, 2] - t[:, 1]
    inner = (before > 0) & (after > 0)
    before, after = np.where(inner, before, 1.0), np.where(inner, after, 1.0)
    rise, fall = (y[:, 1] - y[:, 0]) / before, (y[:, 2] - y[:, 1]) / after

    curvature = (fall - rise) / (before + after)
    slope = (fall * before + rise * after) / (before + after)
    is_top = inner & (curvature < 0) & (rise >= 0) & (fall <= 0)
    shift = np.divide(slope, -2 * curvature, out=np.zeros_like(slope), where=is_top)
    return y[:, 1] + slope * shift / 2, t[:, 1] + shift


def _time_step(
    motion: BodyMotion, coarse: float, columns: Array, values: Array, scalar: ScalarFunction
) -> tuple[float, float]:
    """(time step [s] <= `coarse`, bound on the share of a value that it misses)."""
    curved = 0.0
    weights = np.zeros(len(motion.omega))
    # of the node where the modes curve the value most, relative to it
    for block in _node_blocks(len(columns), columns.shape[1] * len(weights)):
        of_modes = _scalar_values(columns[block], motion.shapes, scalar) * motion.sizes
        share = of_modes / values[block, None]
        curvatures = share @ motion.omega**2
        worst = int(curvatures.argmax())
        if curvatures[worst] > curved:
            curved = float(curvatures[worst])
            weights = share[worst]

    def missed(h: float) -> float:
        """Upper bound on the share of a value that steps of h [s] miss."""
        return float(weights @ np.minimum(2.0, (motion.omega * h) ** 2 / 8))

    step = coarse
    least = coarse * MIN_STEPS / MAX_STEPS
    while missed(step) > MAX_MISSED_SHARE and step > least:
        step = max(step / 1.5, least)
    return step, missed(step)


def _sample_times(nodes: Array, step: float) -> Array:
    """Times about `step` [s] apart: some of the history's times `nodes`, and times between them."""
    nodes = np.unique(nodes)
    if not step:
        return nodes
    span = nodes[-1] - nodes[0]
    nodes = _evenly_chosen(nodes, int(span / step))
    nodes = nodes[np.append(True, np.diff(nodes) > SAME_TIME_SHARE * span)]

    gaps = np.diff(nodes)
    intervals = np.maximum(np.ceil(gaps / step), 1).astype(int)
    first = np.repeat(np.cumsum(intervals) - intervals, intervals)
    share = (np.arange(intervals.sum()) - first) / np.repeat(intervals, intervals)
    inner = np.repeat(nodes[:-1], intervals) + share * np.repeat(gaps, intervals)
    return np.append(inner, nodes[-1])


def _evenly_chosen(times: Array, most: int) -> Array:
    """At most `most` of the times, evenly chosen, including the first and the last."""
    if len(times) <= most:
        return times
    return times[np.linspace(0, len(times) - 1, most).astype(int)]


def _scalar_values(columns: RealArray, factors: RealArray, scalar: ScalarFunction) -> Array:
    """Scalar (S, n) of components (S, c, B) at n times, with `factors` (n, B)."""
    rows = columns.reshape(-1, columns.shape[2]) @ factors.T  # one product is 5 times S products
    return scalar(np.moveaxis(rows.reshape(*columns.shape[:2], len(factors)), 1, -1))


def _node_blocks(nodes: int, numbers: int) -> Iterator[slice]:
    """Slices of nodes whose arrays, with `numbers` numbers per node, fit in `BLOCK_BYTES`."""
    size = max(1, BLOCK_BYTES // (8 * 3 * max(numbers, 1)))
    return (slice(first, first + size) for first in range(0, nodes, size))
