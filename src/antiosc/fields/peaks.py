"""`peak_field`: the largest value of a quantity at every node over a whole run, and its time;
`PrestressedState`: displacements and stresses of the static state before an impact.
"""

from __future__ import annotations

import os
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property, partial
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike

from antiosc.base import checks
from antiosc.base._types import Array, BoolArray, IntArray
from antiosc.base.errors import InputError
from antiosc.base.process import one_thread
from antiosc.base.stresses import (
    VON_MISES_ROOT,
    Strengths,
    TensileStrength,
    exposure,
    extreme_principal,
    largest_tension,
    vector_length,
)
from antiosc.base.texts import CompletedResult, ReprMixin, engineering, point_text as placed
from antiosc.fem.platform import collective
from antiosc.fem.prestress import Prestress
from antiosc.fem.structure.structure import Structure, with_parts
from antiosc.fields import margin
from antiosc.fields.fields import outer_faces, shapes_of, tensors_at_nodes, without_unused_nodes
from antiosc.fields.margin import ExcludedZones, Margin, NodalExposures
from antiosc.fields.maxima import MaximumSearch, ScalarFunction, search_at_times, search_of
from antiosc.impact.histories import History
from antiosc.impact.histories.factors import checked_times, shape_factors
from antiosc.impact.histories.parts import BodyHistory
from antiosc.impact.histories.verdict import ContactZone, contact_zones, yield_share
from antiosc.io.neutral import CELL_KINDS
from antiosc.plot.charts import figure_or_path
from antiosc.recovery import source
from antiosc.recovery.place import AnyStrength, NodeTensors, Place, place
from antiosc.recovery.series import write_vtu_file

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from antiosc.plot.surfaces import DeformedSurface

#: Quantity -> (what is recovered, time derivative, unit).
PEAK_QUANTITIES = {
    "displacement": ("motion", 0, "m"),
    "velocity": ("motion", 1, "m/s"),
    "acceleration": ("motion", 2, "m/s²"),
    "von_mises": ("stress", 0, "Pa"),
    "stress": ("stress", 0, "Pa"),
    "strain": ("strain", 0, ""),
    "tension": ("stress", 0, "Pa"),
    **{name: ("stress", 0, "") for name in margin.PLY_SURFACES},
}
#: Distance between two places of `PeakField.largest`, over the size of the part.
MIN_PLACE_DISTANCE = 0.05


@dataclass(frozen=True, eq=False, repr=False)
class PeakField(CompletedResult):
    """The largest value of one quantity at every node of a part.

    Attributes
    ----------
    quantity, unit : the quantity and its unit.
    points : (P, 3) nodes of the mesh, m.
    values : (P,) largest value at each node.
    times : (P,) time at which it occurs, s.
    error : bound on the underestimate of values by sampling in time, in their unit; None if the
        caller gave the times, and for a part that stretches.
    exposure : (P,) for stresses: the share of the strength, 1 at yield or failure, 0 where no
        strength is known; None for other quantities, and if no material has a strength.
    mesh_error : (P,) estimated mesh error of stresses of solids and sheets, in their unit: the
        deviation of the stresses of the cells around a node from their mean (Zienkiewicz and Zhu);
        0 in beams of the same structure; None for other structures and quantities.
    counts : (P,) for stresses: whether the margin judges a node; None for other quantities.
    rounds : text on the rounds of refinement to a stress tolerance; "" without a tolerance.
    judged : node of the largest value; with a margin the worst judged point (`Margin.scope`).
    """

    quantity: str
    unit: str
    points: Array
    values: Array
    times: Array
    #: (meshio's cell type, (cells, v) nodes of each) by part
    _cells: list[tuple[str, IntArray]] = field(repr=False)
    error: float | None = None
    exposure: Array | None = None
    mesh_error: Array | None = None
    counts: BoolArray | None = None
    rounds: str = ""
    _margin: Margin | None = field(default=None, repr=False)

    def _facts(self) -> list[tuple[str, str]]:
        value, x, t = self.largest(1)[0]
        where = f"{placed(x)}, {engineering(t, 's')}"
        facts = [(f"largest {self.quantity}", f"{engineering(value, self.unit, 4)} at {where}")]
        facts += [("nodes", f"{len(self.values)}")]
        facts += [] if self._margin is None else [("verdict", self._margin.sentence)]
        return facts

    def margin(self) -> Margin:
        """Margin of the worst point against yield, cracking or the failure of a ply.

        Raises
        ------
        InputError
            The quantity is not a stress that has a strength, or no material has one.
        """
        if self._margin is None or self._margin.criterion == margin.UNJUDGED_CRITERION:
            raise InputError(
                f"no margin for {self.quantity}: the material has no strength; give it a "
                "yield_strength for 'von_mises', or its layers a strength for 'tsai_wu'."
            )
        return self._margin

    @property
    def worst_point(self) -> Margin | None:
        """The margin; without strengths, of the largest von Mises stress; None if not a stress."""
        return self._margin

    @property
    def judged(self) -> int:
        """Node of the largest value; with a margin, of its worst point."""
        if self._margin is None or not self._margin.is_stress:
            return int(np.argmax(self.values))
        return int(np.argmin(np.linalg.norm(self.points - self._margin.point, axis=1)))

    def largest(
        self, count: int = 5, apart: float | None = None
    ) -> list[tuple[float, Array, float]]:
        """(value, point (3,) [m], time [s]) of the `count` largest values at separate places.

        `apart` [m]: least distance between the places; default: 5 % of the size of the part.
        """
        count = checks.whole("count", count)
        if apart is None:
            apart = MIN_PLACE_DISTANCE * float(np.ptp(self.points, axis=0).max())
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
        """Estimated mesh error of the judged value; None without an estimate or error bar."""
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

        if self._margin is not None:
            rows.append(self._margin.sentence)
        return "\n".join(rows)

    def plot(
        self, path: str | os.PathLike[str] | None = None, *, view: Sequence[float] | None = None
    ) -> Figure | Path:
        """The values on the surface of the part, with the judged point marked.

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
        """The quantity and the unit of its values in a picture, with MPa for Pa."""
        unit = {"Pa": "MPa"}.get(self.unit, self.unit)
        name = self.quantity.replace("_", " ").replace("von mises", "von Mises stress")
        return name + (f" ({unit})" if unit else "")

    def surface(self, label: str, moved: Array) -> DeformedSurface:
        """The outer surface, displaced by `moved` (P, 3) [m], magnified, coloured by the values."""
        from antiosc.plot.surfaces import DeformedSurface, magnification

        label = checks.instance("label", label, str, "a text")
        moved = checks.floats("moved", moved, (len(self.points), 3))
        values = (1e-6 if self.unit == "Pa" else 1.0) * self.values
        size = float(np.linalg.norm(moved, axis=1).max())
        factor = magnification(self.points, size)
        label += f", motion drawn × {factor:g}" if size else ""
        faces = outer_faces(self._cells)
        displaced = self.points + factor * moved
        return DeformedSurface(self.points, displaced, faces, values, label, float(values.max()))

    def write(self, path: str | Path) -> Path:
        """Write the values and their times to a `.vtu` file for ParaView.

        Raises
        ------
        InputError
            The file cannot be written.
        """
        fields = {self.quantity: self.values, "time": self.times}
        return write_vtu_file(path, self.points, self._cells, fields)


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
    surface: str | None = None,
    layer: int | None = None,
    fibre: Sequence[float] | None = None,
    contacts: Sequence[ContactZone] | None = None,
    r0: float | None = None,
) -> PeakField:
    """The largest value of a quantity at every node over the whole run, and its time.

    Parameters
    ----------
    structure : Structure
        The structure from which the model of the body was extracted.
    history : History or BodyHistory
    quantity : str
        "von_mises": equivalent stress; "stress", "strain": the principal value of largest size;
        "displacement", "velocity", "acceleration": the length of the vector. "tension": the
        largest principal stress of materials that crack (`tensile`); "tsai_hill", "tsai_wu",
        "delamination": the exposure of the worst ply (`Strengths`), 1 at failure; "delamination"
        uses the interlaminar shear stresses in equilibrium with the shear forces.
    times : array_like (n,), optional
        Times in s at which the quantity is evaluated. Default: about 500 times; at nodes with at
        least half of the largest judged value, enough to resolve the fastest motion of the model
        (`error` of the result bounds what they miss). A parabola through the largest sample gives
        the value. A BodyHistory is known only at its own times.
    body : str
        As in `probe`.
    part : str, optional
        For an assembly: the part to evaluate; default: all parts.
    surface, layer : optional
        As in `probe`; default: the larger of the top and the bottom of a sheet.
    fibre : (y, z), optional
        As in `probe`; default: all points of the outline of beam sections. Sections given by A and
        I have no outline.
    contacts : sequence of ContactZone, optional
        Contacts around which the margin of a solid does not judge points within three radii;
        default: the contacts of the history. Near a contact that is smaller than its patch or the
        cells, the error bar is wide.
    r0 : float, optional
        For solids: the margin does not judge points within this distance [m] of sharp inner edges
        (more than 215° within the material) and rigid supports, as elastic stress is unbounded
        there. Default: half the mean thickness of the part (volume over surface), so that the
        judged stress converges with the mesh. 0: all points are judged. A note of the margin names
        the worst place that is not judged.

    Notes
    -----
    At the nodes of solids, also on the surface, strains and stresses of the cells are evaluated at
    the node (not at Gauss points) and averaged over the cells of one material; in sheets and beams
    the largest of the cells is taken. At corners of quadratic cells the stresses are too large: the
    margin judges the middles of edges. Near a point load or a re-entrant corner the values grow
    with every refinement of the mesh, as `mesh_error` shows. With a prestress, strains and stresses
    are the sum of the static state and the impact.

    Raises
    ------
    InputError
        As `probe`.
    """
    checks.choice("quantity", quantity, tuple(PEAK_QUANTITIES))
    checks.instance("structure", structure, Structure, "a Structure")
    recovered, derivative, unit = PEAK_QUANTITIES[quantity]
    places = _thickness_places(surface, layer, fibre)
    if part is not None:
        checks.text("part", part)
    if r0 is not None:
        r0 = checks.nonnegative("r0", r0, "m")
    shapes = shapes_of(structure, history, body)
    if contacts is None:
        contacts = ()
        if isinstance(history, History):
            contacts = contact_zones(history.contact_histories, history.name_of(body))
    contacts = checks.list_of("contacts", contacts, ContactZone, "ContactZone")

    # nodes, and those that count
    points, cells, moved = source(structure).at_nodes(structure, shapes, part)
    zones = ExcludedZones()
    if recovered == "stress":
        zones = _excluded_zones(structure, part, contacts, r0, points[~moved.any(axis=(1, 2))])
    counts = ~(zones.at_contacts(points) | zones.at_edges(points))

    # the largest values of all nodes
    static = recovered != "motion" and structure.matrices.preload is not None
    instants = checked_times(history, times)
    search = search_of(history, body, derivative, instants, given=times is not None, static=static)

    if recovered == "motion":
        best = NodalMaxima(*search(moved, vector_length, counts))
    else:
        best = NodalMaxima.none(len(points))
        known: set[AnyStrength] = set()
        plies = margin.ply_places(structure, quantity, part)
        for number, ply in enumerate(plies):
            selection = recovered, places, part, ply
            tensors = tensors_at_nodes(structure, history, body, shapes, *selection)[2]
            if static:
                at_rest = source(structure).tensors_at_nodes(structure, None, *selection)[2]
                columns = np.concatenate([tensors.columns, at_rest.columns], axis=2)
                tensors = tensors._replace(columns=columns)
            _add_maxima(best, quantity, tensors, search, counts, number)
            known.update(strength for strength, _ in tensors.origins)
        criterion = quantity in margin.CRITERION_TEXTS
        if criterion and not any(margin.has_strength(one, quantity) for one in known):
            strengths = margin.NEEDED_STRENGTHS[quantity]
            raise InputError(f"the criterion {quantity!r} needs materials with {strengths}.")

    # errors by the mesh
    points, cells, best = structure.comm.bcast((points, cells, best), root=0)
    if quantity in ("von_mises", "stress", "tension"):
        peak_times = np.where(best.values > 0, best.times, instants[-1])
        from antiosc.recovery.mesh_fields import stress_jumps  # needs dolfinx

        moments, number = np.unique(peak_times, return_inverse=True)
        factors = shape_factors(history, moments, body)[number.ravel()]
        errors = stress_jumps(structure, shapes, factors, part)
        best.mesh_error = structure.comm.bcast(errors, root=0)

    # the worst point
    result, best = _peak_field_of(quantity, unit, points, cells, best)
    if recovered == "stress":
        result = _with_margin(result, best, structure, zones)

    if result._margin is not None:
        at_ply = plies[int(best.ply[result.judged])]
        told = "" if at_ply is None else f"layer {at_ply.layer} ({at_ply.surface})"
        touched = history.contact_histories if isinstance(history, History) else ()
        dents = any((yield_share(contact) or 0.0) > 1 for contact in touched)
        own = replace(result._margin, layer=told, contact=dents and result._margin.is_stress)
        result = replace(result, _margin=own)

    return result


@dataclass
class NodalMaxima:
    """Largest values (P,) at all points, their times, and largest exposures of stresses."""

    values: Array
    times: Array
    error: float | None = None  # bound, by sampling
    exposure: Array = field(default_factory=lambda: np.zeros(0))
    #: strength, exposure_times, ply of `exposure`: Pa or 1 (inf: unknown), s, index in `ply_places`
    strength: Array = field(default_factory=lambda: np.zeros(0))
    exposure_times: Array = field(default_factory=lambda: np.zeros(0))
    ply: IntArray = field(default_factory=lambda: np.zeros(0, dtype=int))
    mesh_error: Array | None = None  # (P,) estimated error of `values` by the mesh

    @classmethod
    def none(cls, count: int) -> NodalMaxima:
        """Maxima at `count` points, without any value yet."""
        values, times, exposure, exposed = np.zeros((4, count))
        strength, ply = np.full(count, np.inf), np.zeros(count, dtype=int)
        return cls(values, times, None, exposure, strength, exposed, ply)

    def add(
        self, nodes: IntArray, found: tuple[Array, Array, float | None], strength: float, ply: int
    ) -> None:
        """Replace maxima at `nodes` (S,) where `found` has larger values. `strength` of the
        material, nan if unknown; `ply`: number of the ply."""
        values, times, error = found
        if error is not None:
            self.error = max(self.error or 0.0, error)

        order = np.argsort(values, kind="stable")  # the largest is written last
        k = order[values[order] >= self.values[nodes[order]]]
        self.values[nodes[k]], self.times[nodes[k]] = values[k], times[k]
        k = order[values[order] / strength >= self.exposure[nodes[order]]]
        self.exposure[nodes[k]], self.exposure_times[nodes[k]] = values[k] / strength, times[k]
        self.strength[nodes[k]], self.ply[nodes[k]] = strength, ply

    def selected(self, nodes: IntArray) -> NodalMaxima:
        """The maxima at some of the points."""
        arrays = {k: v[nodes] for k, v in vars(self).items() if np.size(v) > 1}
        return replace(self, **arrays)


def _add_maxima(
    best: NodalMaxima,
    quantity: str,
    tensors: NodeTensors,
    search: MaximumSearch,
    counts: BoolArray,
    ply: int,
) -> None:
    """Add the largest values of `tensors` to `best`, by one search for each strength."""
    strengths = [strength for strength, _ in tensors.origins]
    for strength in dict.fromkeys(strengths):
        if quantity in margin.CRITERION_TEXTS and not margin.has_strength(strength, quantity):
            continue
        same = [k for k, other in enumerate(strengths) if other == strength]
        rows = np.isin(tensors.origin, same)
        nodes, columns = tensors.nodes[rows], tensors.columns[rows]

        scalar, own = _scalar_and_strength(quantity, strength)
        if scalar is vector_length:
            columns = VON_MISES_ROOT @ columns
        best.add(nodes, search(columns, scalar, counts[nodes]), own, ply)


def _scalar_and_strength(quantity: str, strength: AnyStrength) -> tuple[ScalarFunction, float]:
    """(function from a tensor to the scalar `quantity`, strength for it or nan if unknown)."""
    if quantity in margin.PLY_SURFACES:
        assert isinstance(strength, Strengths)
        return partial(exposure, quantity, strength), 1.0
    if quantity in ("stress", "strain"):
        return extreme_principal, np.nan
    if quantity == "tension":
        assert isinstance(strength, TensileStrength)
        return largest_tension, strength.low
    return vector_length, strength if isinstance(strength, float) else np.nan


def _peak_field_of(
    quantity: str, unit: str, points: Array, cells: list[tuple[str, IntArray]], best: NodalMaxima
) -> tuple[PeakField, NodalMaxima]:
    """(the field, its maxima) at the nodes of `cells`."""
    used, numbered = without_unused_nodes(cells)
    best = best.selected(used)
    exposures = best.exposure if best.exposure.any() else None
    of_values = points[used], best.values, best.times, numbered, best.error
    return PeakField(quantity, unit, *of_values, exposures, best.mesh_error), best


def _excluded_zones(
    structure: Structure,
    part: str | None,
    contacts: Sequence[ContactZone],
    r0: float | None,
    held: Array,
) -> ExcludedZones:
    """Zones of the margin: contacts (not on beams) and, on solids, sharp edges and `held` points.
    Contacts on sheets are judged."""
    module = source(structure)
    families = module.families(structure, part)
    if not families & {"solid", "sheet"}:
        return ExcludedZones()
    if "solid" not in families:
        materials = module.materials_of(structure, part)
        thickness = max(getattr(material, "thickness", 0.0) for material in materials)
        return ExcludedZones([zone._replace(thickness=thickness) for zone in contacts])

    held = structure.comm.bcast(held, root=0)
    half = module.half_thickness(structure, part)
    if not half:
        return ExcludedZones(contacts)
    from antiosc.reduce.site.surface import inner_points  # needs dolfinx

    edges = inner_points(with_parts(structure), part, half / 4)
    return ExcludedZones(contacts, edges, held, half if r0 is None else r0)


def _with_margin(
    field: PeakField, best: NodalMaxima, structure: Structure, zones: ExcludedZones
) -> PeakField:
    """The field with the margin of its worst point, or of the largest von Mises stress."""
    criterion = {"von_mises": "yield"}.get(field.quantity, field.quantity)
    exposures, strength, times = best.exposure, best.strength, best.exposure_times
    if field.exposure is None:
        criterion, exposures, times = margin.UNJUDGED_CRITERION, field.values, field.times
        strength = np.ones(len(times))

    if field.exposure is None and field.quantity != "von_mises":
        return field

    # the means at corners of quadratic cells are too large
    exposures = exposures.copy()
    for name, cells in field._cells:
        kind = CELL_KINDS[name]
        if kind.order == 2:
            exposures[cells[:, : kind.vertices]] = 0.0

    share = np.zeros(len(times))
    if field.mesh_error is not None:
        share = field.mesh_error / np.where(field.values > 0, field.values, 1.0)
    sizes = margin.sizes_at_nodes(field.points, field._cells)
    nodes = NodalExposures(field.points, exposures, strength, times, share, sizes)
    counts, _ = zones.judged_mask(field.points, exposures > 0)
    worst = margin.judged_margin(criterion, nodes, zones)
    if worst is not None:
        known = margin.strength_range(structure, worst) if worst.is_stress else None
        worst = replace(worst, strength_range=known)
    return replace(field, counts=counts, _margin=worst)


def _thickness_places(
    surface: str | None, layer: int | None, fibre: Sequence[float] | None
) -> list[Place]:
    """Places of evaluation through the thickness; both surfaces if `surface` is None."""
    surfaces = ["top", "bottom"] if surface is None else [surface]
    return [place(side, layer, fibre, "global") for side in surfaces]


class PrestressedState(ReprMixin):
    """The static state of a structure under its `Prestress`, as `part.prestress` returns it.

    Parameters
    ----------
    structure : Structure
        With a prestress.

    Attributes
    ----------
    loads : Prestress
    reserve : float
        Load factor to buckling: the factor on all loads (Ω² of a spin) at which the tangent
        stiffness becomes singular, if the geometric stiffness grows in proportion; inf above 100.
    points : (P, 3) nodes of the mesh, m.
    displacement : (P, 3) at the points, m.
    stress : PeakField of the von Mises stress, with `values`, `margin()` and `plot()`.

    Points, displacement and stress are collective: all ranks must read them.

    Raises
    ------
    InputError
        A structure without prestress.
    """

    @collective()
    def __init__(self, structure: Structure) -> None:
        part = checks.instance("structure", structure, Structure, "a Structure with prestress=")
        preload = part.matrices.preload
        if preload is None:
            raise InputError("the structure has no prestress: give Structure(…, prestress=…).")
        self._structure = structure
        self._preload = preload

    @property
    def loads(self) -> Prestress:
        return self._preload.loads

    @property
    def reserve(self) -> float:
        return self._preload.reserve

    @cached_property
    def _moved(self) -> tuple[Array, Array]:
        structure = self._structure
        points, cells, moved = source(structure).at_nodes(structure, self._preload.q[:, None])
        used, _ = without_unused_nodes(cells)
        both: tuple[Array, Array] = structure.comm.bcast((points[used], moved[used, :, 0]), root=0)
        return both

    @property
    def points(self) -> Array:
        return self._moved[0]

    @property
    def displacement(self) -> Array:
        return self._moved[1]

    @cached_property
    def stress(self) -> PeakField:
        structure = self._structure
        module = source(structure)
        places = _thickness_places(None, None, None)
        points, cells, tensors = module.tensors_at_nodes(structure, None, "stress", places)

        search = search_at_times(np.ones((1, tensors.columns.shape[2])), np.zeros(1))
        counts = np.ones(len(points), dtype=bool)
        best = NodalMaxima.none(len(points))
        _add_maxima(best, "von_mises", tensors, search, counts, 0)
        points, cells, best = structure.comm.bcast((points, cells, best), root=0)
        field, best = _peak_field_of("von_mises", "Pa", points, cells, best)
        return _with_margin(field, best, structure, ExcludedZones())

    def _facts(self) -> list[tuple[str, str]]:
        facts = [("reserve", self._preload.reserve_text)]
        if self._structure.comm.size == 1:
            largest = float(np.linalg.norm(self.displacement, axis=1).max())
            facts += [("displacement", f"up to {engineering(largest, 'm')}")]

        if self.loads.spin is not None:
            facts += [("spin", f"{self.loads.spin.omega:g} rad/s, Coriolis forces left out")]
        return facts
