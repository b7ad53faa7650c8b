"""Envelopes: the largest value of a quantity at every node over a whole run, and when it occurs.

The motion of a node is a sum of modes. Its largest value is at t*; near t* the curvature of the
value is bounded by those of the modes. Samples with the step h therefore miss at most

    Σ_j W_j A_j min(2, (ω_j h)²/8),

where A_j is the largest amplitude of mode j in the run and W_j the value at the node for an
amplitude of 1. The step is chosen from the largest bound over all nodes; a parabola through the
largest sample of a node and its neighbours gives the value.
"""

from __future__ import annotations

import functools
import os
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple, cast

import numpy as np
from numpy.typing import ArrayLike, NDArray

from antiosc.base import checks, files
from antiosc.base._types import Array, BoolArray, IntArray
from antiosc.base.errors import AccuracyWarning, InputError
from antiosc.base.process import one_thread
from antiosc.base.stresses import (
    Strengths,
    Tensile,
    equivalent_parts,
    exposure,
    extreme_principal,
    length,
    tension,
)
from antiosc.base.texts import Completed, engineering, percent, point_text as placed
from antiosc.fem.platform import collective, warn
from antiosc.fem.structure.structure import Structure
from antiosc.fields import margin
from antiosc.fields.fields import shapes_of
from antiosc.fields.margin import Margin, Nodal, Zones
from antiosc.fields.pictures import outer_faces, without_unused
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
from antiosc.impact.histories.verdict import contact_zones, yields
from antiosc.plot.charts import figure_or_path
from antiosc.recovery import source
from antiosc.recovery.place import NodeTensors, Place, place
from antiosc.recovery.series import write_vtu
from antiosc.recovery.sharp_edges import sharp_points

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from antiosc.plot.surfaces import Deformed


#: In double or single precision.
Reals = NDArray[np.floating[Any]]
#: A scalar (...,) of components (..., c), a norm.
Scalar = Callable[[Array], Array]
#: Share of a node's value that the samples may miss.
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


def searched_maxima(
    motion: BodyMotion, columns: Array, scalar: Scalar
) -> tuple[Array, Array, float | None]:
    """(largest value (S,) of a scalar of components (S, c, B), its time, error bound).

    Single precision finds the largest sample; its value and its neighbours' are double.
    """
    step, missed = _step(motion, columns, scalar)
    if not len(columns):  # they are those of another rank
        return np.zeros(0), np.zeros(0), missed
    times = _sample_times(motion.nodes, step)
    factors = np.concatenate(
        [motion.factors(times[k : k + AT_ONCE]) for k in range(0, len(times), AT_ONCE)]
    )
    single = columns.astype(np.float32)
    k = sampled_maxima(single, factors.astype(np.float32), np.arange(1.0 * len(times)), scalar)[1]
    three = np.clip(k.astype(int)[:, None] + (-1, 0, 1), 0, len(times) - 1)
    y = np.concatenate(
        [
            scalar(np.einsum("scb,snb->snc", columns[block], factors[three[block]], optimize=True))
            for block in _blocks(len(columns), 3 * factors.shape[1])
        ]
    )
    return *_parabola_tops(times[three], y), missed


def sampled_maxima(
    columns: Reals, factors: Reals, times: Array, scalar: Scalar
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


def _parabola_tops(t: Array, y: Array) -> tuple[Array, Array]:
    """(largest values (S,), their times) of parabolas through the samples y (S, 3) at t (S, 3),
    the middle one being the largest; its own where it is the first or the last of a run.
    """
    before, after = t[:, 1] - t[:, 0], t[:, 2] - t[:, 1]
    inner = (before > 0) & (after > 0)
    before, after = np.where(inner, before, 1.0), np.where(inner, after, 1.0)
    rise, fall = (y[:, 1] - y[:, 0]) / before, (y[:, 2] - y[:, 1]) / after
    curvature = (fall - rise) / (before + after)
    slope = (fall * before + rise * after) / (before + after)
    is_top = inner & (curvature < 0) & (rise >= 0) & (fall <= 0)
    shift = np.divide(slope, -2 * curvature, out=np.zeros_like(slope), where=is_top)
    return y[:, 1] + slope * shift / 2, t[:, 1] + shift


def _step(motion: BodyMotion, columns: Array, scalar: Scalar) -> tuple[float, float]:
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


def _values(columns: Reals, factors: Reals, scalar: Scalar) -> Array:
    """Scalar (S, n) of components (S, c, B) at times with factors (n, B)."""
    rows = columns.reshape(-1, columns.shape[2]) @ factors.T  # one product is 5 times S products
    return scalar(np.moveaxis(rows.reshape(*columns.shape[:2], len(factors)), 1, -1))


def _blocks(nodes: int, numbers: int) -> Iterator[slice]:
    """Slices of nodes of which so many numbers each fit in `BLOCK_BYTES`."""
    size = max(1, BLOCK_BYTES // (8 * 3 * max(numbers, 1)))
    return (slice(first, first + size) for first in range(0, nodes, size))


#: Function (components (S, c, B), scalar) -> (largest values (S,), their times, error bound).
Search = Callable[[Array, Scalar], tuple[Array, Array, float | None]]


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
#: Quantity -> scalar of its components; others are lengths of their equivalent parts.
SCALARS = {"stress": extreme_principal, "strain": extreme_principal, "tension": tension}
#: Jumps of the stress over itself from which they are told.
DOUBTFUL = 0.2
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
    counts : (P,) of stresses: whether the margin judges a node; None for other quantities.
    doubt : that the cells at the judged stress are too large; "" otherwise.
    rounds : rounds, cells and seconds by which the stress was brought to a tolerance; "": none.
    judged : node of the largest value; with a margin its worst point, outside the zones that
        it leaves out (`Margin.scope`).
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
    counts: BoolArray | None = None
    doubt: str = ""
    rounds: str = ""
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
        """The margin; where no strength is known, the largest von Mises stress of the same places
        (its criterion is "stress"). None: neither.
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
        """Estimated mesh error of the judged value; None without an estimate, as of a node of one
        cell and of a stress that has no bar.
        """
        if self.mesh_error is None:
            return None
        if self._margin is not None and not self._margin.has_bar:
            return None
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
        if self.largest_mesh_error:
            mesh_error = engineering(self.largest_mesh_error, self.unit)
            rows.append(f"estimated error by the mesh, of the largest that is judged: {mesh_error}")
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
            write_vtu(part, self.points, self._cells, fields)
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
    r0: float | None = None,
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
        of the model, with a parabola at the largest sample of each node; `error` of the result
        bounds what they miss. A BodyHistory is known at its own times alone.
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
        besides three radii of each contact. Near a contact that is smaller than its patch, or than
        the cells, the bar is wide.
    r0 : float, optional
        For solids: distance [m] from sharp inner edges (more than 215° within the material) and
        rigid supports that the margin does not judge, since an elastic stress has no limit there.
        Default: half the mean thickness of the part, its volume over its surface, so that the
        judged stress converges with the mesh. 0: the margin judges all of it. A note of the margin
        names the worst place that is left out.

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
    if r0 is not None:
        r0 = checks.nonnegative("r0", r0, "m")
    shapes = shapes_of(structure, history, body)
    zones = leave_out if isinstance(leave_out, Zones) else _zones(history, body, leave_out)
    is_static = recovered != "motion" and structure.matrices.preload is not None
    instants = times_of(history, times)
    is_sampled = times is None and not isinstance(history, BodyHistory)
    search = _search(history, body, derivative, instants, is_static, is_sampled)

    # the largest values of all nodes
    if recovered == "motion":
        points, cells, columns = source(structure).at_nodes(structure, shapes, part)
        best = Maxima(*search(columns, length))
    else:
        found = []
        plies = margin.plies(structure, quantity, part)
        for number, ply in enumerate(plies):
            selection = recovered, places, part, ply
            points, cells, tensors = tensors_at_nodes(structure, history, body, shapes, *selection)
            if is_static:
                at_rest = source(structure).tensors_at_nodes(structure, None, *selection)[2]
                columns = np.concatenate([tensors.columns, at_rest.columns], axis=2)
                tensors = tensors._replace(columns=columns)
            if quantity in margin.CRITERIA:
                tensors = _with_strength(quantity, tensors)
            if tensors.origins:
                found.append(_maxima_of(quantity, len(points), tensors, search, number))
        if not found:
            raise InputError(
                f"the criterion {quantity!r} needs materials with {margin.STRENGTH_OF[quantity]}."
            )
        best = functools.reduce(Maxima.or_larger, found)
    points, cells, best = structure.comm.bcast((points, cells, best), root=0)

    # errors by the mesh, and the worst point
    if quantity in ("von_mises", "stress", "yield", "tension"):
        peak_times = np.where(best.values > 0, best.times, instants[-1])
        errors = _mesh_error(structure, shapes, part, history, peak_times, body)
        best = best._replace(mesh_error=structure.comm.bcast(errors, root=0))
    result, best = _peak_field_of(quantity, unit, points, cells, best)
    if recovered == "stress":
        zones = _zones_on(structure, shapes, part, zones, r0)
        result = _with_margin(result, best, structure, zones)
    if result._margin is not None:
        at_ply = plies[int(best.ply[result.judged])]
        told = "" if at_ply is None else f"layer {at_ply.layer} ({at_ply.surface})"
        dents = isinstance(history, History) and any(map(yields, history.contact_histories))
        own = replace(result._margin, layer=told, contact=dents and result._margin.is_stress)
        result = replace(result, _margin=own)

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


def _search(
    history: AnyHistory,
    body: str,
    derivative: int,
    instants: Array,
    is_static: bool,
    is_sampled: bool,
) -> Search:
    """The search over a run, at its times (`is_sampled`) or at the given ones.

    `is_static`: with one more column, of factor 1, for the static state.
    """

    def factors(times: Array) -> Array:
        found = amplitudes(history, times, body, derivative)
        return np.pad(found, ((0, 0), (0, int(is_static))), constant_values=1.0)

    if not is_sampled or isinstance(history, BodyHistory):
        return functools.partial(_at_times, factors(instants), instants)

    instants = _evenly(instants, MOST)
    omega, modal, sizes = modal_amplitudes(history, instants, body, derivative)
    if stretch_in(history, body) is not None:
        omega, modal, sizes = _with_pairs(history, instants, body, derivative, omega, modal, sizes)
    modal = np.pad(modal, ((0, 0), (0, int(is_static))))
    return functools.partial(searched_maxima, BodyMotion(instants, factors, omega, modal, sizes))


def _at_times(
    factors: Array, times: Array, columns: Array, scalar: Scalar
) -> tuple[Array, Array, None]:
    """The search at times with known factors."""
    return (*sampled_maxima(columns, factors, times, scalar), None)


def _with_pairs(
    history: AnyHistory,
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
    places = _places(None, None, None)
    points, cells, tensors = source(structure).tensors_at_nodes(structure, None, "stress", places)
    search = functools.partial(_at_times, np.ones((1, tensors.columns.shape[2])), np.zeros(1))
    best = _maxima_of("von_mises", len(points), tensors, search, 0)
    points, cells, best = structure.comm.bcast((points, cells, best), root=0)
    field, best = _peak_field_of("von_mises", "Pa", points, cells, best)
    return _with_margin(field, best, structure, Zones())


class Maxima(NamedTuple):
    """Largest values of all points with times and error bound; of stresses the exposures with
    strengths and times, numbers of the plies, and errors by the mesh [Pa].
    """

    values: Array
    times: Array
    error: float | None
    exposure: Array = np.zeros(0)
    strength: Array = np.zeros(0)
    exposed: Array = np.zeros(0)
    ply: IntArray = np.zeros(0, dtype=int)
    mesh_error: Array | None = None

    def or_larger(self, other: Maxima) -> Maxima:
        """At each point the larger of two maxima, of exposures of plies."""
        is_larger = other.values > self.values
        names = ("values", "times", "exposure", "strength", "exposed", "ply")
        pairs = ((getattr(other, name), getattr(self, name)) for name in names)
        values, times, *others = (np.where(is_larger, *pair) for pair in pairs)
        return Maxima(values, times, _larger_error(self.error, other.error), *others)

    def at(self, nodes: IntArray) -> Maxima:
        """Those of some of the points."""
        arrays = {k: v[nodes] for k, v in self._asdict().items() if np.size(v) > 1}
        return self._replace(**arrays)


def _larger_error(error: float | None, other: float | None) -> float | None:
    """The larger of two errors; the other if one is None."""
    return max((value for value in (error, other) if value is not None), default=None)


def _with_strength(criterion: str, tensors: NodeTensors) -> NodeTensors:
    """The tensors of materials with the strength that a criterion needs."""
    has_strength = [margin.has_strength(strength, criterion) for strength, _ in tensors.origins]
    kept = np.array(has_strength, dtype=bool)[tensors.origin]
    arrays = tensors.nodes[kept], tensors.columns[kept], tensors.origin[kept]
    return NodeTensors(*arrays, tensors.origins if any(has_strength) else [])


def _maxima_of(quantity: str, count: int, tensors: NodeTensors, search: Search, ply: int) -> Maxima:
    """The largest values of tensors at `count` points, with exposures where strengths are known."""
    if quantity in margin.PLY_SURFACES:
        values, times, error = _of_plies(quantity, tensors, search)
        strengths = np.ones(len(values))
    else:
        scalar = SCALARS.get(quantity, length)
        columns = tensors.columns if quantity in SCALARS else equivalent_parts(tensors.columns)
        values, times, error = search(columns, scalar)
        criterion = "tension" if quantity == "tension" else "yield"
        known = [_pascals_of(strength, criterion) for strength, _ in tensors.origins]
        strengths = np.array(known)[tensors.origin]
        if quantity in ("stress", "strain"):
            strengths[:] = np.nan

    share = np.nan_to_num(values / strengths)
    exposures, exposed, strength = _at_nodes(tensors.nodes, count, share, times, strengths)
    if quantity == "yield":
        error = error and error / float(strengths.min())
        values = share
    largest, peak_times = _at_nodes(tensors.nodes, count, values, times)
    plies = np.full(count, ply)
    return Maxima(largest, peak_times, error, exposures, strength, exposed, plies)


def _pascals_of(strength: object, criterion: str) -> float:
    """The strength [Pa] by which a criterion judges; NaN for a material without."""
    if not margin.has_strength(strength, criterion):
        return float("nan")
    return strength.low if isinstance(strength, Tensile) else cast("float", strength)


def _of_plies(
    criterion: str, tensors: NodeTensors, search: Search
) -> tuple[Array, Array, float | None]:
    """(largest exposures, their times, error bound); layers of equal strength are searched
    together.
    """
    values = np.zeros(len(tensors.nodes))
    times = np.zeros(len(tensors.nodes))
    error = None
    of_origin = [strength for strength, _ in tensors.origins]
    for strength in dict.fromkeys(s for s in of_origin if isinstance(s, Strengths)):
        same = [k for k, s in enumerate(of_origin) if s == strength]
        rows = np.isin(tensors.origin, same)
        scalar = functools.partial(exposure, criterion, strength)
        values[rows], times[rows], bound = search(tensors.columns[rows], scalar)
        error = _larger_error(error, bound)
    return values, times, error


def _at_nodes(nodes: IntArray, count: int, values: Array, *others: Array) -> list[Array]:
    """[largest of the values at each of `count` nodes, and of the others what belongs to it]."""
    order = np.argsort(values, kind="stable")  # the largest is written last
    found = []
    for array in (values, *others):
        at = np.zeros(count)
        at[nodes[order]] = array[order]
        found.append(at)
    return found


def _peak_field_of(
    quantity: str, unit: str, points: Array, cells: list[tuple[str, IntArray]], best: Maxima
) -> tuple[PeakField, Maxima]:
    """(the field, its maxima) at the nodes of these cells, without nodes of other ranks."""
    used, numbered = without_unused(cells)
    best = best.at(used)
    exposures = best.exposure if best.exposure.any() else None
    errors = best.mesh_error
    if errors is not None and quantity == "yield":
        errors = errors / np.where(best.strength > 0, best.strength, 1.0)
    of_values = points[used], best.values, best.times, numbered, best.error, exposures, errors
    return PeakField(quantity, unit, *of_values), best


def _mesh_error(
    structure: Structure,
    shapes: Array,
    part: str | None,
    history: AnyHistory,
    times: Array,
    body: str,
) -> Array | None:
    """Estimated mesh errors (P,) [Pa] of the von Mises stress at each point's time, on rank 0; else
    None.
    """
    from antiosc.recovery.mesh_fields import stress_jumps  # needs dolfinx

    instants, number = np.unique(times, return_inverse=True)
    factors = amplitudes(history, instants, body)[number.ravel()]
    return stress_jumps(structure, shapes, factors, part)


def _zones(history: AnyHistory, body: str, leave_out: ArrayLike | None) -> Zones:
    """The contacts of the body, and the balls that were asked for."""
    zones = Zones()
    if isinstance(history, History):
        zones = Zones(contact_zones(history.contact_histories, history.name_of(body)))
    return zones if leave_out is None else zones.and_balls(leave_out)


def _zones_on(
    structure: Structure, shapes: Array, part: str | None, zones: Zones, r0: float | None
) -> Zones:
    """The zones on a part: balls and edges of solids alone, and no contacts on beams, which are
    exact.
    """
    families = source(structure).families(structure, shapes, part)
    if not families & {"solid", "sheet"}:
        return Zones()
    if "solid" not in families:
        materials = source(structure).materials_of(structure, part)
        thickness = max(getattr(material, "thickness", 0.0) for material in materials)
        return Zones([zone._replace(thickness=thickness) for zone in zones.contacts])

    points, cells, moved = source(structure).at_nodes(structure, shapes, part)
    points, cells, held = structure.comm.bcast((points, cells, ~moved.any(axis=(1, 2))), root=0)
    edges, distance = sharp_points(points, cells)
    return zones._replace(
        edges=edges, supports=points[held], distance=distance if r0 is None else r0
    )


def _with_margin(field: PeakField, best: Maxima, structure: Structure, zones: Zones) -> PeakField:
    """The field with its worst point, and with doubts in its largest stress."""
    criterion = {"von_mises": "yield"}.get(field.quantity, field.quantity)
    exposures, strength, times = best.exposure, best.strength, best.exposed
    if field.exposure is None:
        criterion, exposures, times = margin.UNJUDGED, field.values, field.times
        strength = np.ones(len(times))
    share = np.zeros(len(times))
    if field.mesh_error is not None:
        share = field.mesh_error / np.where(field.values > 0, field.values, 1.0)

    if field.exposure is not None or field.quantity == "von_mises":
        sizes = margin.sizes_at_nodes(field.points, field._cells)
        nodes = Nodal(field.points, exposures, strength, times, share, sizes)
        counts = zones.judged(field.points, exposures > 0)[0]
        field = replace(field, counts=counts)
        worst = margin.judged(criterion, nodes, zones)
        if worst is not None:
            known = margin.strength_range(structure, worst) if worst.is_stress else None
            field = replace(field, _margin=replace(worst, strength_range=known))

    k = field.judged
    if share[k] < DOUBTFUL or (field._margin is not None and not field._margin.has_bar):
        return field
    place = ", ".join(f"{c:.4g}" for c in field.points[k])
    doubt = (
        f"the cells at the largest stress differ by {percent(share[k])} of it: make the cells there"
        f" smaller (refine=[(({place}), size)], or size)"
    )
    return replace(field, doubt=doubt)


def _places(
    surface: str | Sequence[float] | None, layer: int | None, fibre: Sequence[float] | None
) -> list[Place]:
    """Positions in the thickness or section where the quantity is evaluated; default both sides."""
    surfaces = ["top", "bottom"] if surface is None else [surface]
    return [place(side, layer, fibre, "global") for side in surfaces]
