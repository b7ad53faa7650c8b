"""Envelopes: the largest value of a quantity at every node over a whole run, and when it occurs.

Values are sampled with a step short enough for the fastest mode, and refined at the maxima.

The motion of a node is a sum of modes. Its largest value is at t*; near t* the curvature of the
value is bounded by those of the modes. Samples with the step h therefore miss at most

    Σ_j W_j A_j min(2, (ω_j h)²/8),

where A_j is the largest amplitude of mode j in the run and W_j the value at the node for an
amplitude of 1. The step is chosen from the largest bound over all nodes. Samples are computed in
those windows of time in which values interpolated from few samples, and bounds of their errors,
do not exclude the largest one. Then each node's highest maximum, found by a parabola through three
samples, is refined.
"""

from __future__ import annotations

import functools
import os
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
import scipy.linalg
from numpy.typing import ArrayLike, NDArray

from antiosc.base import checks, files
from antiosc.base._types import Array, BoolArray, IntArray
from antiosc.base.errors import AccuracyWarning, InputError
from antiosc.base.process import one_thread
from antiosc.base.stresses import length
from antiosc.base.texts import Completed, engineering, percent, point_text as placed
from antiosc.fem.platform import collective, warn
from antiosc.fem.structure.structure import Structure
from antiosc.fields import margin
from antiosc.fields.fields import shapes_of, stress_amplitudes
from antiosc.fields.margin import Margin, Maxima, Search, mesh_error
from antiosc.fields.pictures import outer_faces
from antiosc.fields.second_order import tensors_at_nodes
from antiosc.impact.histories import History
from antiosc.impact.histories.factors import (
    AnyHistory,
    amplitudes,
    modal_amplitudes,
    stretch_in,
    times_of,
)
from antiosc.impact.histories.parts import BodyHistory
from antiosc.plot.charts import figure_or_path
from antiosc.recovery import source
from antiosc.recovery.place import Place, place
from antiosc.recovery.series import Frames

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from antiosc.plot.surfaces import Deformed


#: In double or single precision.
Reals = NDArray[np.floating[Any]]
#: Share of a node's value that the times before refinement may miss.
TIME_ERROR = 0.01
#: A node's value counts as at least this share of the largest one: smaller peaks may be missed.
FLOOR = 0.1
#: Fewest steps over the run.
FEWEST = 500
#: Most steps over the run, so that long runs of high modes end; a warning tells what they miss.
MOST = 40_000
#: Nodes of a history that are looked at, however few steps its modes need.
NODES = 5000
#: Times whose motion is computed together.
AT_ONCE = 1000
#: Successive times whose values are interpolated from those at few of them, and the largest error
#: of their motion over its size. In a curved panel of 229 columns 19 of 100 times sufficed, and the
#: nodes may have their largest value in 2 % of the windows; 22 and 1.4 % with an error of 0.003.
WINDOW, INTERPOLATED = 100, 0.01
#: Share by which a parabola may rise above the largest sample.
PARABOLA = 0.1
#: Parts into which a step about a maximum is divided.
PARTS = 8
#: Bytes of the values of a block of nodes at these times.
BLOCK_BYTES = 2**26
#: Two nodes of a history closer than this share of the run are one.
SAME_TIME = 1e-12


@dataclass(frozen=True, eq=False)
class BodyMotion:
    """Motion of a body over a run, in B coordinates of which each multiplies a column of a field.

    nodes : (n,) times of the history [s]. factors : function, times (k,) -> coordinates (k, B).
    omega : (J,) frequencies of the modes [rad/s]; shapes : (J, B) coordinates of each mode;
    sizes : (J,) largest amplitudes of the modes.
    """

    nodes: Array
    factors: Callable[[Array], Array]
    omega: Array
    shapes: Array
    sizes: Array


def refined_maxima(
    motion: BodyMotion, columns: Array, scalar: Callable[[Array], Array]
) -> tuple[Array, Array, float]:
    """(largest value (S,) of a scalar of components (S, c, B), its time, error bound).

    `scalar`: function (..., c) -> (...,), a norm. Single precision finds the times of the maxima.
    """
    step, missed = _step(motion, columns, scalar)
    if not len(columns):  # they are those of another rank
        return np.zeros(0), np.zeros(0), missed
    times = _sample_times(motion.nodes, step)
    size = np.sqrt(np.einsum("scb,scb->b", columns, columns))
    windows = _windows(motion, times, size / (size.max(initial=0.0) or 1.0))
    places = _coarse_places(windows, times, columns.astype(np.float32), scalar)
    values, peak_times = _refined_near(motion, columns, scalar, times, places[0])
    others = np.flatnonzero(places[0] != places[1])
    values_there, times_there = _refined_near(
        motion, columns[others], scalar, times, places[1, others]
    )
    above = values_there > values[others]
    values[others[above]] = values_there[above]
    peak_times[others[above]] = times_there[above]
    return values, peak_times, missed


class Window(NamedTuple):
    """Successive times, from number `first` on, and the factors of the columns at them.

    factors : (n, B). selected : (r,) those times from whose values, times `weights` (n, r), the
    factors at all of them follow but for at most `errors` (B,).
    """

    first: int
    factors: Reals
    selected: IntArray
    weights: Reals
    errors: Reals


def _windows(motion: BodyMotion, times: Array, size: Array) -> list[Window]:
    """Windows over all times, each of which shares two times with the next.

    size : (B,) of the columns.
    """
    windows = []
    for start in range(0, max(len(times) - 2, 1), AT_ONCE - 2):
        factors = motion.factors(times[start : start + AT_ONCE]).astype(np.float32)
        for first in range(0, max(len(factors) - 2, 1), WINDOW - 2):
            of_window = factors[first : first + WINDOW]
            selected, weights = _selected(size * of_window)
            errors = np.abs(of_window - weights @ of_window[selected]).max(axis=0)
            windows.append(Window(start + first, of_window, selected, weights, errors))
    return windows


def _selected(rows: Array) -> tuple[IntArray, Reals]:
    """(r of the rows (n, B), from which all are interpolated; weights (n, r))."""
    upper, order = scipy.linalg.qr(rows.T, mode="r", pivoting=True)
    size = np.abs(np.diag(upper))
    rank = int((size > INTERPOLATED * size[0]).sum())
    weights = np.zeros((len(rows), rank), dtype=np.float32)
    weights[order[:rank]] = np.eye(rank)
    weights[order[rank:]] = np.linalg.solve(upper[:rank, :rank], upper[:rank, rank:]).T
    return order[:rank], weights


def _coarse_places(
    windows: Sequence[Window], times: Array, columns: Reals, scalar: Callable[[Array], Array]
) -> IntArray:
    """Numbers (2, S) of the times of the largest sample, and of the top of the largest parabola."""
    best = np.full((2, len(columns)), -np.inf)
    places = np.zeros((2, len(columns)), dtype=int)
    reached = _reached(windows, columns, scalar)
    for window, in_window in zip(windows, reached, strict=True):
        t = times[window.first : window.first + len(window.factors)]
        candidates = np.flatnonzero(in_window)
        for block in _blocks(len(candidates), columns.shape[1] * len(t)):
            nodes = candidates[block]
            y = _values(columns[nodes], window.factors, scalar)
            for k, found in enumerate((y, _parabola_maxima(t, y))):
                index = found.argmax(axis=1)
                top = found[np.arange(len(index)), index]
                higher = top > best[k, nodes]
                best[k, nodes[higher]] = top[higher]
                places[k, nodes[higher]] = window.first + index[higher]
    return places


def _reached(
    windows: Sequence[Window], columns: Reals, scalar: Callable[[Array], Array]
) -> BoolArray:
    """Mask (windows, S) of those windows in which a value may be the largest one.

    With |x + e| <= |x| + |e| the interpolated values and their errors bound the sampled ones.
    """
    selected = np.concatenate([window.factors[window.selected] for window in windows])
    starts = np.cumsum([0] + [len(window.selected) for window in windows])
    bounds = np.stack([window.errors for window in windows])
    unit = np.eye(columns.shape[2])  # double: stresses of pairs of motions are 1e20, and squared
    result = np.zeros((len(windows), len(columns)), dtype=bool)
    for block in _blocks(len(columns), columns.shape[1] * len(selected) // 6):  # one array, single
        of_block = columns[block]
        count, components, _ = of_block.shape
        rows = np.swapaxes(of_block, 0, 1).reshape(components * count, -1)
        known = selected @ rows.T
        tops = np.empty((len(windows), count), dtype=columns.dtype)
        for k, window in enumerate(windows):
            y = window.weights @ known[starts[k] : starts[k + 1]]
            tops[k] = scalar(np.moveaxis(y.reshape(-1, components, count), 1, -1)).max(axis=0)
        sizes = [_values(of_block, sign * unit, scalar) for sign in (1, -1)]
        errors = bounds @ np.maximum(*sizes).T
        result[:, block] = tops + errors >= (1 - PARABOLA) * (tops - errors).max(axis=0)
    return result


def sampled_maxima(
    columns: Array, factors: Array, times: Array, scalar: Callable[[Array], Array]
) -> tuple[Array, Array]:
    """(largest value (S,) of a scalar of components (S, c, B) at these times, its time)."""
    values = np.zeros(len(columns))
    peak_times = np.zeros(len(columns))
    for block in _blocks(len(columns), columns.shape[1] * len(times)):
        sampled = _values(columns[block], factors, scalar)
        k = sampled.argmax(axis=1)
        values[block] = sampled[np.arange(len(k)), k]
        peak_times[block] = times[k]
    return values, peak_times


def _step(
    motion: BodyMotion, columns: Array, scalar: Callable[[Array], Array]
) -> tuple[float, float]:
    """(time step [s] of the search, largest possible underestimate of a peak)."""
    stride = max(1, len(motion.nodes) // FEWEST)
    samples = motion.nodes[::stride]
    values, _ = sampled_maxima(columns, motion.factors(samples), samples, scalar)
    top = float(values.max(initial=0.0))
    values = np.maximum(values, FLOOR * top)
    # of the node where the modes curve the value most, relative to it
    curved = 0.0
    weights = np.zeros(len(motion.omega))
    for block in _blocks(len(columns), columns.shape[1] * len(weights)) if top else ():
        share = _values(columns[block], motion.shapes, scalar) * motion.sizes / values[block, None]
        curvatures = share @ motion.omega**2
        worst = int(curvatures.argmax())
        if curvatures[worst] > curved:
            curved = float(curvatures[worst])
            weights = share[worst]

    def missed(h: float) -> float:
        """Upper bound of the underestimate with the step h."""
        return float(weights @ np.minimum(2.0, (motion.omega * h) ** 2 / 8))

    duration = float(motion.nodes[-1] - motion.nodes[0])
    step = duration / FEWEST
    while missed(step) > TIME_ERROR and step > duration / MOST:
        step = max(step / 1.5, duration / MOST)
    return step, missed(step) * top


def _sample_times(nodes: Array, step: float) -> Array:
    """The history times, with evenly spaced times between those farther apart than the step.

    History times beyond `NODES` and the number of steps are thinned evenly by index, since most of
    them lie in contacts.
    """
    nodes = np.unique(nodes)
    steps = (nodes[-1] - nodes[0]) / step if step else 0.0
    nodes = _evenly(nodes, max(NODES, int(steps)))
    nodes = nodes[np.append(True, np.diff(nodes) > SAME_TIME * (nodes[-1] - nodes[0]))]
    gaps = np.diff(nodes)
    intervals = np.maximum(np.ceil(gaps / step), 1).astype(int) if step else np.ones(len(gaps), int)
    first = np.repeat(np.cumsum(intervals) - intervals, intervals)
    share = (np.arange(intervals.sum()) - first) / np.repeat(intervals, intervals)
    return np.append(
        np.repeat(nodes[:-1], intervals) + share * np.repeat(gaps, intervals), nodes[-1]
    )


def _evenly(times: Array, most: int) -> Array:
    """At most `most` of the times, with the first and the last."""
    if len(times) <= most:
        return times
    return times[np.linspace(0, len(times) - 1, most).astype(int)]


def _parabola_maxima(t: Array, y: Array) -> Array:
    """Values (S, n) in which each local maximum is that of the parabola through three values."""
    tops = y.copy()
    if len(t) < 3:
        return tops
    node, k = np.nonzero((y[:, 1:-1] >= y[:, :-2]) & (y[:, 1:-1] >= y[:, 2:]))
    before = np.diff(t)[k]
    after = np.diff(t)[k + 1]
    middle = y[node, k + 1].astype(float)
    rise = (middle - y[node, k]) / before
    fall = (y[node, k + 2] - middle) / after
    curvature = (fall - rise) / (before + after)
    slope = (fall * before + rise * after) / (before + after)
    gain = np.divide(slope**2, -4 * curvature, out=np.zeros_like(curvature), where=curvature < 0)
    tops[node, k + 1] += gain
    return tops


def _refined_near(
    motion: BodyMotion,
    columns: Array,
    scalar: Callable[[Array], Array],
    times: Array,
    coarse_places: IntArray,
) -> tuple[Array, Array]:
    """(largest values (S,) within a step of the times `coarse_places` (S,), their times)."""
    values = np.zeros(len(columns))
    peak_times = np.zeros(len(columns))
    order = np.argsort(coarse_places, kind="stable")
    used_places, starts = np.unique(coarse_places[order], return_index=True)
    groups = np.split(order, starts[1:])
    share = np.linspace(0, 1, PARTS + 1)
    before = times[np.maximum(used_places - 1, 0)]
    after = times[np.minimum(used_places + 1, len(times) - 1)]
    centres = times[used_places]
    times_near = np.concatenate(
        (
            before[:, None] + (centres - before)[:, None] * share,
            centres[:, None] + (after - centres)[:, None] * share[1:],
        ),
        axis=1,
    )
    for first in range(0, len(used_places), AT_ONCE // times_near.shape[1]):
        block = slice(first, first + AT_ONCE // times_near.shape[1])
        factors = motion.factors(times_near[block].ravel()).reshape(*times_near[block].shape, -1)
        for factors_of_group, t, group in zip(
            factors, times_near[block], groups[block], strict=True
        ):
            values[group], peak_times[group] = sampled_maxima(
                columns[group], factors_of_group, t, scalar
            )
    return values, peak_times


def _values(columns: Reals, factors: Reals, scalar: Callable[[Array], Array]) -> Array:
    """Scalar (S, n) of components (S, c, B) at times with factors (n, B)."""
    rows = columns.reshape(-1, columns.shape[2]) @ factors.T  # one product is 5 times S products
    return scalar(np.moveaxis(rows.reshape(*columns.shape[:2], len(factors)), 1, -1))


def _blocks(nodes: int, numbers: int) -> Iterator[slice]:
    """Slices of nodes of which so many numbers each fit in `BLOCK_BYTES`."""
    size = max(1, BLOCK_BYTES // (8 * 3 * max(numbers, 1)))
    return (slice(first, first + size) for first in range(0, nodes, size))


#: Quantity -> (what is recovered, time derivative, unit).
PEAK_QUANTITIES = {
    "displacement": ("motion", 0, "m"),
    "velocity": ("motion", 1, "m/s"),
    "acceleration": ("motion", 2, "m/s²"),
    "von_mises": ("stress", 0, "Pa"),
    "stress": ("stress", 0, "Pa"),
    "strain": ("strain", 0, ""),
    **{name: ("stress", 0, "") for name in margin.CRITERIA},
    "tension": ("stress", 0, "Pa"),
}
#: Share of the largest value from which what the times may miss is told.
UNRESOLVED = 0.05
#: Distance between two places of `PeakField.largest`, over the size of the part.
PLACES_APART = 0.05


@dataclass(frozen=True, eq=False, repr=False)
class PeakField(Completed):
    """The largest value of one quantity at every node of a part.

    Attributes
    ----------
    quantity, unit : the quantity and its unit.
    points : (P, 3) nodes of the mesh, m.
    values : (P,) largest value at each node.
    times : (P,) time at which it occurs, s.
    error : bound on the underestimate of a value by sampling in time; None for given times.
    exposure : (P,) for stresses: the share of the strength, 1 at yield or failure, 0 where no
        strength is known; None for other quantities, and where no material has a strength.
    mesh_error : (P,) estimated mesh error of stresses of solids and sheets, in their unit: the
        deviation of the stresses of the cells around a node from their mean (Zienkiewicz and Zhu);
        0 in beams beside them, otherwise None.
    doubt : why the judged stress is unreliable: a re-entrant corner, the edge of a support, cells
        that are too large; "" otherwise.
    judged : node of the largest value; with a margin its worst point, outside the zones that
        it leaves out (`Margin.beyond`).
    """

    quantity: str
    unit: str
    points: Array
    values: Array
    times: Array
    _cells: list[tuple[str, IntArray]] = field(repr=False)
    error: float | None = None
    exposure: Array | None = None
    mesh_error: Array | None = None
    doubt: str = ""
    _margin: Margin | None = field(default=None, repr=False)

    def _facts(self) -> list[tuple[str, str]]:
        value, x, t = self.largest(1)[0]
        where = f"{placed(x)}, {engineering(t, 's')}"
        facts = [(f"largest {self.quantity}", f"{engineering(value, self.unit, 4)} at {where}")]
        facts += [("nodes", f"{len(self.values)}")]
        facts += [] if self._margin is None else [("verdict", self._margin.sentence)]
        return facts + ([("doubt", self.doubt)] if self.doubt else [])

    def margin(self) -> Margin:
        """How far the worst point is from yield, or from the failure of a ply.

        Raises
        ------
        InputError
            The quantity is not a stress that has a strength, or no material has one.
        """
        if self._margin is None or self._margin.criterion == margin.UNJUDGED:
            raise InputError(
                f"no margin for {self.quantity}: the material has no strength; give it a "
                "yield_strength for 'von_mises', or its layers a strength for 'tsai_wu'."
            )
        return self._margin

    @property
    def worst_point(self) -> Margin | None:
        """The margin; where no strength is known, and `sharp_edges` was False, the largest von
        Mises stress of the same places (its criterion is "stress"). None: neither.
        """
        return self._margin

    @property
    def judged(self) -> int:
        """Node of the largest value; of the worst point of the margin if there is one."""
        if self._margin is None or not self._margin.is_stress:
            return int(np.argmax(self.values))
        return int(np.argmin(np.linalg.norm(self.points - self._margin.point, axis=1)))

    def largest(
        self, count: int = 5, apart: float | None = None
    ) -> list[tuple[float, Array, float]]:
        """(value, point (3,) [m], time [s]) of the largest values, at least `apart` from each
        other.

        `apart` [m]: default 5 % of the size of the part.
        """
        count = checks.whole("count", count)
        if apart is None:
            apart = PLACES_APART * float(np.ptp(self.points, axis=0).max())
        apart = checks.nonnegative("apart", apart, "m")
        open_to = np.ones(len(self.values), dtype=bool)
        largest_of_kind: list[tuple[float, Array, float]] = []
        while open_to.any() and len(largest_of_kind) < count:
            k = int(np.argmax(np.where(open_to, self.values, -np.inf)))
            largest_of_kind.append((float(self.values[k]), self.points[k], float(self.times[k])))
            open_to &= np.linalg.norm(self.points - self.points[k], axis=1) > apart
        return largest_of_kind

    @property
    def largest_mesh_error(self) -> float | None:
        """Estimated mesh error of the largest value; None without an estimate.

        A node of one cell has none: the estimate compares the cells that meet there. The stress at
        the edge of a contact's surroundings (`Margin.at_edge`) is not that of the mesh.
        """
        if self.mesh_error is None or (self._margin is not None and self._margin.at_edge):
            return None
        if self._margin is not None and self._margin.away is not None:
            scale = self._margin.strength if self.quantity == "yield" else 1.0
            return self._margin.mesh_error / scale or None
        return float(self.mesh_error[self.judged]) or None

    def summary(self, count: int = 5) -> str:
        """The largest values with point and time, as a table."""
        rows = [f"largest {self.quantity}, where and when"]
        for value, x, t in self.largest(count):
            largest = engineering(value, self.unit, 4)
            rows.append(f"{largest:>12}  {placed(x)}  {engineering(t, 's')}")
        if self.error is not None:
            error_text = engineering(self.error, self.unit)
            rows.append(f"between the times that were looked at: up to {error_text} more")
        left_out = ""
        if self._margin is not None and self._margin.scope:
            left_out = " that is judged"
        if self.largest_mesh_error:
            mesh_error = engineering(self.largest_mesh_error, self.unit)
            rows.append(f"estimated error by the mesh, of the largest{left_out}: {mesh_error}")
        rows += [self.doubt] if self.doubt else []
        if self._margin is not None:
            rows.append(self._margin.sentence)
        return "\n".join(rows)

    def plot(
        self, path: str | os.PathLike[str] | None = None, *, view: Sequence[float] | None = None
    ) -> Figure | Path:
        """The values on the surface of the part, the judged one marked.

        `path` and `view` as for `plotting.plot_deformed`.
        """
        from antiosc.plot.surfaces import deformed_figure

        seen_from = None if view is None else checks.floats("view", view, (2,))
        surface = self.surface(f"largest {self.label}", np.zeros_like(self.points))
        return figure_or_path(
            deformed_figure(surface, view=seen_from, mark=self.judged, shown=path is None), path
        )

    @property
    def label(self) -> str:
        """The quantity with the unit in which it is drawn: MPa for Pa."""
        unit = {"Pa": "MPa"}.get(self.unit, self.unit)
        name = self.quantity.replace("_", " ").replace("von mises", "von Mises stress")
        return name + (f" ({unit})" if unit else "")

    def surface(self, label: str, moved: Array) -> Deformed:
        """The surface coloured by the values, displaced by magnified (P, 3) [m]."""
        from antiosc.plot.surfaces import Deformed, magnification

        label = checks.instance("label", label, str, "a text")
        moved = checks.floats("moved", moved, (len(self.points), 3))
        values = (1e-6 if self.unit == "Pa" else 1.0) * self.values
        size = float(np.linalg.norm(moved, axis=1).max())
        factor = magnification(self.points, size)
        label += f", motion drawn × {factor:g}" if size else ""
        faces = outer_faces(self._cells)
        displaced = self.points + factor * moved
        return Deformed(self.points, displaced, faces, values, label, float(values.max()))

    def write(self, path: str | Path) -> Path:
        """Write the values and their times to a `.vtu` file, which ParaView opens.

        Raises
        ------
        InputError
            The file cannot be written.
        """
        target = checks.new_file("path", path)
        if target.suffix.lower() != ".vtu":
            target = target.with_name(f"{target.name}.vtu")
        fields = {self.quantity: self.values, "time": self.times}
        with files.atomic_file(target, "the field") as part:
            part.write_bytes(Frames(self.points, self._cells).content(fields))
        return target


@collective()
@one_thread()
def peak_field(
    structure: Structure,
    history: History | BodyHistory,
    quantity: str = "von_mises",
    times: ArrayLike | None = None,
    *,
    body: str = "structure",
    part: str | None = None,
    surface: str | Sequence[float] | None = None,
    layer: int | None = None,
    fibre: Sequence[float] | None = None,
    leave_out: ArrayLike | None = None,
    sharp_edges: bool = True,
) -> PeakField:
    """The largest value of a quantity at every node over the run, and its time.

    Parameters
    ----------
    structure : Structure
        The structure from which the model of the body was extracted.
    history : History or BodyHistory
    quantity : str
        "von_mises": equivalent stress; "stress", "strain": the principal value of largest size;
        "displacement", "velocity", "acceleration": the length of the vector. "yield": the
        equivalent stress over the yield strength; "tension": the largest principal stress of
        materials that crack (`tensile`); "tsai_hill", "tsai_wu", "delamination": the
        exposure of the worst ply (`Strengths`), 1 at failure, the last one by the interlaminar
        shear stresses that are in equilibrium with the shear forces.
    times : array_like (n,), optional
        Times in s at which the quantity is evaluated. Default: enough to resolve the fastest motion
        of the model, and more near the largest value of each node; `error` of the result bounds the
        value that they miss. A BodyHistory is known at its own times alone.
    body : str
        As in `probe`.
    part : str, optional
        For an assembly: the part to evaluate; default: all parts.
    surface, layer : optional
        As in `probe`; default: the larger of the top and the bottom of a sheet.
    fibre : (y, z), optional
        As in `probe`; default: the outline of the sections of beams, which sections given by A and
        I do not have.
    leave_out : array_like (n, 4), optional
        For solids: balls whose stresses the margin does not judge, as rows x, y, z, radius [m],
        besides three radii of each contact that yields. Farther away, the difference between the
        contact and the patch that carries its force in the model is in `Margin.spread`.
    sharp_edges : bool
        Whether the margin of a solid judges sharp inner edges and rigid supports too, where an
        elastic stress has no limit. False: points farther from them than half the thickness of the
        walls, so that the judged stress converges with the mesh; `Margin.sharp` is the worst of the
        others. A von Mises stress without a strength is sought there too (`worst_point`).

    Notes
    -----
    At the nodes of solids, on the surface too, strains and stresses are those of the cells there
    (not of their Gauss points), as means of the cells of one material; in sheets and beams the
    largest of the cells is taken. Near a point load or a re-entrant corner the values grow with
    every refinement of the mesh: `mesh_error` and `doubt` show this. Stresses and strains of a
    structure with a prestress are those of the static state plus those of the impact.

    Raises
    ------
    InputError
        As `probe`.

    Warns
    -----
    AccuracyWarning
        The run is too long for times that resolve all its motion.
    """
    checks.choice("quantity", quantity, tuple(PEAK_QUANTITIES))
    checks.instance("structure", structure, Structure, "a Structure")
    recovered, derivative, unit = PEAK_QUANTITIES[quantity]
    places = _places(surface, layer, fibre)
    if part is not None:
        checks.text("part", part)
    shapes = shapes_of(structure, history, body)
    judges_edges = checks.flag("sharp_edges", sharp_edges)
    unjudged = not judges_edges and quantity == "von_mises"
    unjudged = unjudged and quantity not in margin.criteria_of(structure)
    zones = _zones(leave_out, history, body, unjudged)
    if recovered == "stress":
        zones = margin.zones_on(structure, shapes, part, zones, history, body)
    zones = zones._replace(unjudged=unjudged)
    if not judges_edges and recovered == "stress":
        edges, supports = margin.balls_of_edges(structure, shapes, part)
        zones = zones._replace(edges=edges, supports=supports)
    instants = times_of(history, times)
    search: Search
    searches: list[Search] = []  # of the spans of a run
    factors = functools.partial(amplitudes, history, body=body, derivative=derivative)
    if recovered == "stress":
        factors = functools.partial(stress_amplitudes, structure, history, body=body)
    static = recovered != "motion" and structure.matrices.preload is not None
    if times is None and not isinstance(history, BodyHistory):
        instants = _evenly(instants, MOST)
        omega, modal, sizes = modal_amplitudes(history, instants, body, derivative)
        if stretch_in(history, body) is None:
            # a spring is stretched by no more than the body
            modal = np.tile(modal, factors(times=instants[:1]).shape[1] // max(modal.shape[1], 1))
        else:
            omega, modal, sizes = _with_pairs(
                history, instants, body, derivative, omega, modal, sizes
            )
        if static:
            modal = np.pad(modal, ((0, 0), (0, 1)))
            factors = functools.partial(_beside_static, factors)
        search = functools.partial(
            refined_maxima, BodyMotion(instants, factors, omega, modal, sizes)
        )
    else:
        factors_of_motion = factors(times=instants)
        factors_of_motion = (
            np.pad(factors_of_motion, ((0, 0), (0, 1)), constant_values=1.0)
            if static
            else factors_of_motion
        )
        search = functools.partial(_at_times, factors_of_motion, instants)
        searches = _of_spans(history, factors_of_motion, instants)
    if recovered == "motion":
        points, cells, displacements = source(structure).at_nodes(structure, shapes, part)
        best = Maxima(*search(displacements, length))
        of_spans: list[Maxima] = []
        zones_of_spans = [zones]
    else:
        zones_of_spans = [zones, *(zones.of_span(k) for k in range(len(searches)))]
        maxima: list[list[Maxima]] = []
        for ply in margin.plies(structure, quantity, part):
            selection = recovered, places, part, ply
            points, cells, tensors = tensors_at_nodes(structure, history, body, shapes, *selection)
            if static:
                at_rest = source(structure).tensors_at_nodes(structure, None, *selection)[2]
                columns = np.concatenate([tensors.columns, at_rest.columns], axis=2)
                tensors = tensors._replace(columns=columns)
            if quantity in margin.CRITERIA:
                tensors = margin.with_strength(quantity, tensors)
            if tensors.origins:
                pairs = zip([search, *searches], zones_of_spans, strict=True)
                maxima.append([margin.stresses(quantity, points, tensors, *pair) for pair in pairs])
        if not maxima:
            raise InputError(
                f"the criterion {quantity!r} needs materials with {margin.STRENGTH_OF[quantity]}."
            )
        best, *of_spans = (
            functools.reduce(Maxima.or_larger, plies) for plies in zip(*maxima, strict=True)
        )
    points, cells, best, of_spans = structure.comm.bcast((points, cells, best, of_spans), root=0)
    result = _peak_field_of(quantity, unit, points, cells, best)
    if quantity in ("von_mises", "stress", "yield", "tension"):
        peak_times = np.where(best.values > 0, best.times, instants[-1])
        errors = mesh_error(structure, shapes, part, history, peak_times, body)
        result = _with_mesh_error(result, structure.comm.bcast(errors, root=0), cells)
        by_hertz = result._margin is not None and result._margin.at_edge
        if result.mesh_error is not None and result.values.any() and not by_hertz:
            k = result.judged
            share = float(result.mesh_error[k] / (result.values[k] or 1.0))
            sentence = margin.doubt_at(structure, shapes, part, result.points[k], share)
            result = replace(result, doubt=sentence)
    if result._margin is not None and result._margin.is_stress:
        judged = replace(
            result._margin,
            contact=margin.contact_yields(history),
            strength_range=margin.strength_range(structure, result._margin),
        )
        judged = _with_errors(result, judged, zones)
        result = replace(result, _margin=judged)
    if result._margin is not None:
        spans = tuple(_margins_of_spans(result, cells, of_spans, zones_of_spans[1:]))
        result = replace(result, _margin=replace(result._margin, spans=spans))
    largest = float(result.values.max(initial=0.0))
    if result.error is not None and result.error > UNRESOLVED * largest:
        warn(
            structure.comm,
            f"the {quantity} may be up to {percent(result.error / largest)} of its largest value"
            f" higher between the {MOST} times that are looked at, which is too few for"
            f" {history.time[-1]:g} s: give times in the part that matters, or shorten the run.",
            AccuracyWarning,
        )
    return result


def _of_spans(history: AnyHistory, factors: Array, times: Array) -> list[Search]:
    """The searches in the spans of a run, if it has several and no other times are asked for."""
    spans = getattr(history, "spans", None)
    if spans is None or len(spans) != len(times):
        return []
    rows = [spans == k for k in range(int(spans.max()) + 1)]
    return [functools.partial(_at_times, factors[row], times[row]) for row in rows]


def _zones(
    leave_out: ArrayLike | margin.Zones | None, history: AnyHistory, body: str, unjudged: bool
) -> margin.Zones:
    """The zones that the margin leaves out: those of the history, and the given balls."""
    if isinstance(leave_out, margin.Zones):  # of a fall
        return leave_out
    zones = margin.zones_of(history, body, unjudged=unjudged)
    return zones if leave_out is None else zones.and_balls(leave_out)


def _with_pairs(
    history: History,
    times: Array,
    body: str,
    derivative: int,
    omega: Array,
    shapes: Array,
    sizes: Array,
) -> tuple[Array, Array, Array]:
    """(omega, shapes, sizes) of `BodyMotion`, with a further entry for each pair of stretching
    modes.
    """
    count = shapes.shape[1]
    motions, bends = (
        np.abs(amplitudes(history, times, body, order)[:, count:]).max(axis=0) for order in (0, 2)
    )
    pairs = np.where(motions > 0, motions, 1.0)
    size = motions if derivative == 0 else bends if derivative == 2 else np.sqrt(motions * bends)
    of_motion = np.eye(len(motions), count + len(motions), count)
    all_shapes = np.vstack([np.pad(shapes, ((0, 0), (0, len(motions)))), of_motion])
    return np.append(omega, np.sqrt(bends / pairs)), all_shapes, np.append(sizes, size)


def static_stress(structure: Structure) -> PeakField:
    """The von Mises stress of the static state under a prestress. All ranks must call it."""

    def search(columns: Array, scalar: Callable[[Array], Array]) -> tuple[Array, Array, None]:
        return _at_times(np.ones((1, columns.shape[2])), np.zeros(1), columns, scalar)

    places = _places(None, None, None)
    points, cells, tensors = source(structure).tensors_at_nodes(structure, None, "stress", places)
    best = margin.stresses("von_mises", points, tensors, search)
    points, cells, best = structure.comm.bcast((points, cells, best), root=0)
    return _peak_field_of("von_mises", "Pa", points, cells, best)


def _beside_static(factors: Callable[..., Array], times: Array) -> Array:
    """The factors with one more column: 1, for the static state."""
    return np.pad(factors(times=times), ((0, 0), (0, 1)), constant_values=1.0)


def _at_times(
    factors: Array, times: Array, columns: Array, scalar: Callable[[Array], Array]
) -> tuple[Array, Array, None]:
    return (*sampled_maxima(columns, factors, times, scalar), None)


def _peak_field_of(
    quantity: str, unit: str, points: Array, cells: list[tuple[str, IntArray]], best: Maxima
) -> PeakField:
    """The field at the nodes of these cells, without nodes of other ranks."""
    used_nodes = _used_nodes(cells)
    renumbered: list[tuple[str, IntArray]] = [
        (kind, np.searchsorted(used_nodes, c)) for kind, c in cells
    ]
    exposures = None if best.exposure is None else best.exposure[used_nodes]
    at_used = points[used_nodes], best.values[used_nodes], best.times[used_nodes]
    field = PeakField(quantity, unit, *at_used, renumbered, best.error, exposures)
    return replace(field, _margin=best.margin)


def _used_nodes(cells: list[tuple[str, IntArray]]) -> IntArray:
    return np.unique(np.concatenate([numbers.ravel() for _, numbers in cells]))


def _with_mesh_error(
    field: PeakField, errors: Array | None, cells: list[tuple[str, IntArray]]
) -> PeakField:
    """The field with its estimated errors [Pa]."""
    if errors is None:
        return field
    mesh_error = errors[_used_nodes(cells)]
    if field.quantity == "yield" and field._margin is not None:
        mesh_error = mesh_error / field._margin.strength
    return replace(field, mesh_error=mesh_error)


#: Largest error over the stress of a node that is not the judged one. Where the cells differ by
#: more, one of them touches a sharp edge: of a printed cover a node of 10 MPa between cells that
#: differed by 24 MPa had 11 MPa on cells of half the size.
UNKNOWN = 1.0


def _with_errors(field: PeakField, judged: Margin, zones: margin.Zones) -> Margin:
    """A margin with the mesh error of the field, relative to the stress, at its worst point, and
    of sheets, and where sharp edges are left out, with the stresses of all places that are judged.
    """
    if field.mesh_error is None:
        return judged
    k = int(np.argmin(np.linalg.norm(field.points - judged.point, axis=1)))
    shares = _mesh_shares(field)
    judged = replace(judged, mesh_error=float(shares[k]) * judged.value)
    if judged.away is None and not zones.patches:
        return judged
    exposure = field.values if field.exposure is None else field.exposure
    others = ~zones.left_out(field.points)
    spread, by_cells = (of(field.points[others]) for of in (zones.spread_error, zones.mesh_error))
    stresses, shares = judged.strength * exposure[others], shares[others]
    least = float((stresses * (1 - shares)).max(initial=0.0))
    largest = stresses * (1 + np.minimum(shares, UNKNOWN)) + spread + by_cells
    return replace(judged, others=(least, float(largest.max(initial=0.0))))


def _margins_of_spans(
    field: PeakField,
    cells: list[tuple[str, IntArray]],
    of_spans: Sequence[Maxima],
    zones: Sequence[margin.Zones],
) -> Iterator[Margin]:
    """Yields the margins of the spans of a run, each with the errors of the span's own stresses."""
    assert field._margin is not None
    used_nodes = _used_nodes(cells)
    for one, of_span in zip(of_spans, zones, strict=True):
        if one.margin is None or one.exposure is None:
            continue
        judged = replace(one.margin, strength_range=field._margin.strength_range)
        if judged.is_stress:
            values = one.values[used_nodes]
            own = replace(field, values=values, exposure=one.exposure[used_nodes])
            if field.mesh_error is not None:
                own = replace(own, mesh_error=_mesh_shares(field) * values)
            judged = _with_errors(own, judged, of_span)
        yield judged


def _mesh_shares(field: PeakField) -> Array:
    """Estimated errors by the mesh over the stresses of all nodes."""
    return np.asarray(field.mesh_error) / np.where(field.values > 0, field.values, 1.0)


def _places(
    surface: str | Sequence[float] | None, layer: int | None, fibre: Sequence[float] | None
) -> list[Place]:
    """Positions in the thickness or section where the quantity is evaluated; default both sides."""
    surfaces = ["top", "bottom"] if surface is None else [surface]
    return [place(side, layer, fibre, "global") for side in surfaces]
