"""Quantities at one point of a body after an impact: motion, strain, stress, section forces.

The shapes of the model (for instance their strains) are evaluated once at the point, and combined
with the coordinates of the model at all times. The static shape contains the stress near the site;
points far from the site, and accelerations, need more anti-oscillators than the force.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from contextlib import suppress
from dataclasses import replace
from functools import partial
from math import ceil, inf, isfinite
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from antiosc.base import checks
from antiosc.base._types import Array
from antiosc.base.cfc import cfc_filter, filter_memory, sampling_step
from antiosc.base.errors import AccuracyWarning, AntioscError, InputError, warn, without_warnings
from antiosc.base.process import one_thread
from antiosc.base.stresses import von_mises
from antiosc.base.texts import engineering, percent
from antiosc.fem.elements import Section
from antiosc.fem.platform import collective, on_root
from antiosc.fem.structure.structure import Structure, with_parts
from antiosc.fields.fields import shapes_of, with_pair_columns
from antiosc.impact.histories import History
from antiosc.impact.histories.factors import (
    TIMES_AT_ONCE,
    AnyHistory,
    checked_times,
    modes_with_shapes,
    shape_factors,
)
from antiosc.impact.histories.motion import RunHistory
from antiosc.impact.histories.parts import BodyHistory
from antiosc.models.anti_oscillators import AntiOscillators
from antiosc.models.parameters import has_error_bars
from antiosc.recovery import source
from antiosc.recovery.place import NO_OUTLINE_REASON, Place, Reach, on_outlines, place
from antiosc.reduce.site.site import located_point, motions_without_mesh

#: The quantities of `probe`.
PROBED_QUANTITIES = (
    *("displacement", "velocity", "acceleration", "rotation"),
    *("strain", "stress", "von_mises", "section_forces"),
)
#: The quantities that are vectors.
MOTION_QUANTITIES = PROBED_QUANTITIES[:4]
#: Quantity -> order of the time derivative of the coordinates in it; otherwise 0.
DERIVATIVE_ORDERS = {"velocity": 1, "acceleration": 2}
#: Gauss points along a strain gauge: an even number, since its middle often lies between two cells.
GAUGE_POINT_COUNT = 6
#: Distance of a gauge from the structure, over its length, that is taken as lying on it.
GAUGE_TOLERANCE = 0.05
#: Samples of a filtered signal in a period of the highest mode, and in the shortest contact; least
#: and largest number of them. On a bracket the peak acceleration through CFC1000 and CFC600 is
#: within 6e-5 of that of 12 samples in a period (n = 20, 40 and 160).
SAMPLES_PER_PERIOD, SAMPLES_PER_CONTACT, SAMPLE_LIMITS = 3, 50, (50, 200_000)
#: Share of the anti-oscillators without a bar: of 0.89, 26 km/s² with 40 became 64 with 160.
MAX_TRUNCATION_ERROR = 0.1
#: Least and largest time integration error of a repeated impact.
MIN_TIME_ERROR, MAX_TIME_ERROR = 1e-6, 1e-4


@collective()
@one_thread()
def probe(
    structure: Structure,
    history: History | BodyHistory,
    point: Sequence[float] | str | None = None,
    quantity: str = "displacement",
    times: ArrayLike | None = None,
    *,
    node: int | None = None,
    body: str = "structure",
    part: str | None = None,
    surface: str = "top",
    layer: int | None = None,
    fibre: Sequence[float] | None = None,
    axes: str = "global",
    stiffener: str | None = None,
    snap: float | None = None,
    filter: str | None = None,
) -> Array:
    """One quantity at one point of the structure at `times`.

    Parameters
    ----------
    structure : Structure
        The structure from which the model of the body was extracted.
    history : History or BodyHistory
        A BodyHistory is `hit.bodies[name]` of a scene.
    point : sequence of floats, or str
        Coordinates in m; the nearest point of the structure within `snap` is used. A text names a
        group, in an assembly "part:group": the point of its entities nearest to their centroid is
        used, as for a `Site` with this text. In an assembly it may also name a reference point or a
        site of a superelement, which have only displacements and rotations.
    quantity : str
        "displacement" (n, 3) m, "velocity" (n, 3) m/s, "acceleration" (n, 3) m/s²; (n, 2) for plane
        parts. They are relative to the supports if a `Base` moves these.
        "rotation" (n, 3) rad: rotation of sections of beams and shells, half the curl in solids;
        (n, 1) for plane parts.
        "strain" (n, 3, 3): the tensor (its entry 12 is half the shear angle γ12). "stress"
        (n, 3, 3) Pa. "von_mises" (n,) Pa. See `von_mises`, `principal`, `Strengths`.
        "section_forces": for beams in space (n, 6) the forces N, Vy, Vz [N] and moments T, My, Mz
        [N m], where y is the height of the section; for plane beams (n, 3) N, V, M; for shells
        (n, 8) per width N1, N2, N12 [N/m], M1, M2, M12 [N], Q1, Q2 [N/m] in the axes of the
        laminate; axis 1 of a `Shell` is x along its surface, or y if x is near its normal.
    times : array_like (n,), optional
        Times in s; default: those of the history.
    node : int
        Instead of a point: the number of a node in the file of the mesh or deck.
    body : str
        The body whose structure is `structure`: "structure" or "impactor"; for a scene its name
        (default: the only one that has shapes).
    part : str, optional
        For an assembly: the part on which the nearest point is sought; default: all parts.
    surface : "top", "bottom" or "middle"
        For a shell: the surface of the sheet or of its `layer`. "top" is the side of the cell
        normals or of `Laminate(top=…)`, +z on plane meshes.
    layer : int, optional
        For a laminate: number of the layer, 0 for the lowest.
    fibre : (y, z)
        For a beam: distances from the centroid along the height and across it, m. The stress of a
        beam is the normal stress of N, My and Mz. Default: the centroid; for "von_mises" the point
        of the section's outline with the largest value at each time.
    axes : "global" or "local"
        Axes of tensors: the axes of the mesh, or local axes: fibre direction, transverse direction
        and normal of a layer; axes of an anisotropic solid; tangent, height and side of a beam.
    stiffener : str, optional
        Group of a `Beam` on the edges of a shell: strain, stress and section forces of this beam,
        at its point next to `point`.
    snap : float, optional
        Largest distance in m of the point from the structure; default: 2 % of the part's size, or
        one element.
    filter : "CFC60", "CFC180", "CFC600" or "CFC1000", optional
        Channel frequency class of SAE J211-1 by which the signal is filtered; for "von_mises" the
        stresses are filtered first. A filtered value depends on the motion up to two periods of the
        class before and after it (CFC1000: 2 ms). The run is repeated for longer to obtain the
        motion after its end; before its start accelerations are 0, and other quantities are as at
        the start.

    Notes
    -----
    Strains are those of the cell that contains the point, not averaged with neighbouring cells.
    The contact law (Hertz) gives the stress in the contact itself; the mesh does not contain it.
    Velocity and acceleration follow from the equations of motion; they do not contain the part of
    the displacement that follows the force without inertia (`ModalBody.residual`). No quantity
    includes the weight of a supported body: all are measured from its equilibrium under gravity.

    The result does not include the error due to the number of anti-oscillators, which may be large
    for accelerations and for stresses far from the site: `probe_error` with the same arguments
    estimates it. `antiosc run` adds it to the error of the force as the error bar of each probe.

    Raises
    ------
    InputError
        A model without shapes, or extracted from another structure; a quantity that the element
        family does not have; a stress of materials that relax; an unknown layer, part or group; a
        point too far from the structure; an unknown filter, or a filter for a BodyHistory.

    Warns
    -----
    AccuracyWarning
        If the run cannot be repeated for as long as the filter needs.
    """
    checks.choice("quantity", quantity, PROBED_QUANTITIES)
    checks.instance("structure", structure, Structure, "a Structure")
    position = place(surface, layer, fibre, axes, stiffener)
    reach = _reach_of_point(point, snap)
    x, part, end = located_point(structure, point, part, node)
    shapes = shapes_of(structure, history, body)
    sample_times = checked_times(history, times)
    if end is None:
        places = (
            _outline_places(structure, part, position) if quantity == "von_mises" else [position]
        )
        probed = structure, history, body, shapes, x[None], quantity, part
        columns = [_probe_columns(*probed, tensors, reach)[0] for tensors in places]
    else:
        columns = [motions_without_mesh(structure, shapes, str(point), end, quantity)]

    # a filtered acceleration is the rate of the filtered velocity, of which no sample misses a peak
    is_rate = filter is not None and quantity == "acceleration"
    derivative = DERIVATIVE_ORDERS.get(quantity, 0) - is_rate

    def signal(run: AnyHistory, at_times: Array) -> Array:
        """The quantity (n, places, …) at times; for a filtered acceleration, the velocity."""
        factors = shape_factors(run, at_times, body, derivative)
        return np.stack([np.moveaxis(x @ factors.T, -1, 0) for x in columns], axis=1)

    if filter is None:
        values = signal(history, sample_times)
    else:
        values = _filtered_derivative(
            structure, history, body, sample_times, filter, signal, int(is_rate)
        )
    if quantity == "von_mises":
        return np.asarray(von_mises(values).max(axis=1))
    return values[:, 0]


def _reach_of_point(point: object, snap: float | None) -> Reach:
    """Limit for moving the point onto the structure: `snap`; by default none for a named group."""
    if snap is not None:
        snap = inf if checks.is_rigid(snap) else checks.positive("snap", snap, "m")
    elif isinstance(point, str):
        snap = inf
    return Reach("the point of the probe", snap)


def probed_point(
    structure: Structure,
    point: Sequence[float] | str | None = None,
    node: int | None = None,
    part: str | None = None,
    snap: float | None = None,
) -> Array | None:
    """The point (3,) [m] of a probe; None for matrices and for points without a mesh.

    InputError for a point that is off the structure.
    """
    x, part, end = located_point(structure, point, part, node)
    reach = _reach_of_point(point, snap)
    if end is not None:
        return None
    if not structure.matrices.meshed:
        source(structure).at_point(structure, np.zeros((structure.rows, 1)), x, part, reach)
        return None
    from antiosc.fem.structure.place import places_at  # needs dolfinx

    (place,) = places_at(with_parts(structure).members(part), x[None])
    reach.check_at(x, place)
    return place.placed


def _outline_places(structure: Structure, part: str | None, position: Place) -> list[Place]:
    """Places for the von Mises stress on the outlines of beam sections; else `[position]`."""
    materials = source(structure).materials_of(structure, part, position.stiffener)
    sections = [getattr(material, "section", None) for material in materials]
    of_beams = [section for section in sections if isinstance(section, Section)]
    if not of_beams or position.fibre is not None:
        return [position]
    on_edge = on_outlines(of_beams, position)
    if on_edge:
        return on_edge
    sentence = (
        f"the von Mises stress is that of the centroid, without bending: {NO_OUTLINE_REASON}."
    )
    on_root(structure.comm, partial(warn, sentence, AccuracyWarning))
    return [position]


@collective()
@one_thread()
def strain_gauge(
    structure: Structure,
    history: History | BodyHistory,
    point: Sequence[float] | str,
    direction: Sequence[float],
    length: float,
    times: ArrayLike | None = None,
    *,
    body: str = "structure",
    part: str | None = None,
    surface: str = "top",
    layer: int | None = None,
    fibre: Sequence[float] = (0.0, 0.0),
) -> Array:
    """Signal (n,) of a strain gauge: the mean strain along `direction` over the gauge length.

    Parameters
    ----------
    structure, history, times, body, part, surface, layer, fibre
        As in `probe`.
    point : sequence of floats, or str
        The middle of the gauge, m; a text names a group as in `probe`.
    direction : sequence of 2 or 3 floats
        Direction in which the gauge measures.
    length : float
        Length of the gauge, m.

    Raises
    ------
    InputError
        As `probe`; a gauge whose ends do not lie on the structure.
    """
    position = place(surface, layer, fibre, "global")
    checks.instance("structure", structure, Structure, "a Structure")
    length = checks.positive("length", length, "m")
    d = np.zeros(3)
    direction_cosines = checks.coordinates("direction", direction)
    d[: len(direction_cosines)] = direction_cosines
    if not np.linalg.norm(d):
        raise InputError("direction must not be the zero vector: the gauge measures along it.")
    d /= np.linalg.norm(d)
    x, part, end = located_point(structure, point, part)
    if end is not None:
        raise InputError(f"{point!r} is a point without a mesh: a gauge needs the cells of a part.")
    nodes, weights = np.polynomial.legendre.leggauss(GAUGE_POINT_COUNT)
    points = x + np.outer(nodes, d) * length / 2
    shapes = shapes_of(structure, history, body)
    sample_times = checked_times(history, times)
    remedy = "shorten the gauge, or move it"
    reach = Reach("a point of the gauge,", GAUGE_TOLERANCE * length, remedy)
    columns = _probe_columns(
        structure, history, body, shapes, points, "strain", part, position, reach
    )
    mean_strain = np.einsum("p,i,pijk,j->k", weights / 2, d, columns, d, optimize=True)
    return np.asarray(shape_factors(history, sample_times, body) @ mean_strain)


def _probe_columns(
    structure: Structure,
    history: AnyHistory,
    body: str,
    shapes: Array,
    points: Array,
    quantity: str,
    part: str | None,
    position: Place,
    reach: Reach,
) -> Array:
    """The quantity (P, …, columns) at points (P, 3) for each shape (column of `shapes`)."""
    module = source(structure)
    recovered = {"von_mises": "stress"}.get(quantity, quantity)
    if quantity in ("displacement", "velocity", "acceleration"):
        return np.stack([module.at_point(structure, shapes, x, part, reach) for x in points])
    selection = points, part, recovered, position, reach

    def at(columns: Array, second_order: bool) -> Array:
        """Strains, stresses, … of `columns` at the points."""
        values = module.recovered(structure, columns, *selection, second_order=second_order)
        return np.asarray(values)

    return with_pair_columns(at, structure, history, body, shapes)


def _filtered_derivative(
    structure: Structure,
    history: AnyHistory,
    body: str,
    times: Array,
    name: str,
    signal: Callable[[AnyHistory, Array], Array],
    derivative: int,
) -> Array:
    """Filtered `signal(history, t)` or its derivative (n, …); the run may be repeated longer."""
    if not isinstance(history, RunHistory):
        raise InputError(
            "a filter needs motion before and after the times: probe the scene's history with body."
        )
    memory = filter_memory(name)
    end = times.max() + memory
    if history.time[-1] < end and isinstance(history, History) and history.source is not None:
        with suppress(AntioscError), without_warnings():  # the law may end its range
            history = history.again(duration=end)

    if history.time[-1] < end * (1 - 1e-9):
        sentence = (
            f"Values through {name} depend on the motion up to {engineering(memory, 's')}"
            f" later, and the run ends at {engineering(history.time[-1], 's')}: those near the end"
            f" are not reliable. Simulate for {engineering(end, 's')}."
        )
        on_root(structure.comm, partial(warn, sentence, AccuracyWarning))

    # samples from the memory before the first time to that after the last
    begin = max(times.min() - memory, 0.0)
    end = min(times.max() + memory, history.time[-1])
    fastest = modes_with_shapes(history, body).omega.max(initial=0.0)
    of_modes = SAMPLES_PER_PERIOD * fastest / (2 * np.pi)
    of_contact = SAMPLES_PER_CONTACT / history.assembly.contact_time_estimate
    rate = min(max(of_modes, of_contact), SAMPLE_LIMITS[1] / (end - begin))
    count = max(ceil(max(rate, 1 / sampling_step(name)) * (end - begin)), SAMPLE_LIMITS[0])
    t, step = np.linspace(begin, end, count, retstep=True)
    blocks = np.array_split(t, ceil(count / TIMES_AT_ONCE))
    values = np.concatenate([signal(history, block) for block in blocks])

    margin = ceil(memory / step)
    columns = np.pad(values.reshape(count, -1), ((margin, margin), (0, 0)), "edge")
    smooth = cfc_filter(step, columns, name)[margin:-margin]
    from scipy.interpolate import CubicSpline  # which takes long to load

    at_times = CubicSpline(t, smooth)(times, derivative)
    return np.asarray(at_times).reshape(len(times), *values.shape[1:])


class ProbeError(float):
    """Relative error of the largest value of a probe, a sum of shares; inf without an error bar.

    Attributes
    ----------
    truncation : share due to the number of anti-oscillators; from 0.1 on it is not a bound.
    force : share due to the error of the force; None if the force has no error bar.
    mesh : share due to the mesh error of the motion; None if it is not estimated.
    """

    truncation: float
    force: float | None
    mesh: float | None

    def __new__(cls, truncation: float, force: float | None, mesh: float | None) -> ProbeError:
        """A number that is the sum of the shares; inf if a share is unknown or too large."""
        total = inf
        if force is not None and mesh is not None and truncation < MAX_TRUNCATION_ERROR:
            total = truncation + mesh + force
        error = super().__new__(cls, total)
        error.truncation, error.force, error.mesh = truncation, force, mesh
        return error

    def __str__(self) -> str:
        named = {"anti-oscillators": self.truncation, "mesh": self.mesh, "force": self.force}
        shares = [f"{name} {percent(x)}" for name, x in named.items() if x is not None]
        told = f"± {percent(self)}" if isfinite(self) else "no error bar"
        return f"{told} ({', '.join(shares)})"

    __repr__ = __str__

    def __reduce__(self) -> tuple[type[ProbeError], tuple[Any, ...]]:
        return ProbeError, (self.truncation, self.force, self.mesh)


def probe_error(
    structure: Structure,
    history: History,
    point: Sequence[float] | str | None = None,
    quantity: str = "displacement",
    times: ArrayLike | None = None,
    **options: Any,
) -> ProbeError:
    """Relative error of the largest value of a `probe`.

    It is the sum of three shares: `.truncation`, the largest difference to the same impact with
    half of the anti-oscillators; `.mesh`, the change of the largest value on the model corrected
    for its mesh error, times the safety factor of the budget; `.force`, the error in
    `hit.error_budget["peak_force"]` without its truncation. It is infinite if `.mesh` or
    `.force` is missing (extract with `error="estimate"`) or `.truncation` is 0.1 or more (take
    more anti-oscillators). For a part that stretches, linear runs are compared.

    Parameters
    ----------
    structure, history, point, quantity, times, **options
        As for `probe`; the history is from `simulate` or `strike` and is simulated again.

    Raises
    ------
    InputError
        As `probe`; a history of a scene; a model with fewer than two anti-oscillators.
    """
    checks.choice("quantity", quantity, PROBED_QUANTITIES)
    checks.instance("history", history, History, "a History of simulate or strike")
    model = history.model
    if history.rerun is None or not isinstance(model, AntiOscillators) or model.n < 2:
        raise InputError(
            "only an impact of simulate or strike can be repeated with half the anti-oscillators,"
            " of which there must be two or more."
        )
    linear = replace(model, stretch=None)
    at = checked_times(history, times)
    tol = min(max(history.error.get("force", MAX_TIME_ERROR), MIN_TIME_ERROR), MAX_TIME_ERROR)

    def values(run: History) -> Array:
        """Components (n, c) of the quantity at the times of the probe."""
        return probe(structure, run, point, quantity, at, **options).reshape(len(at), -1)

    def largest(signal: Array) -> float:
        """Largest length of a motion's vector, or largest size of another quantity's component."""
        is_motion = quantity in MOTION_QUANTITIES
        sizes = np.linalg.norm(signal, axis=1) if is_motion else np.abs(signal[:, k])
        return float(sizes.max())

    own = values(history if model.stretch is None else history.rerun(linear, tol))
    k = int(np.abs(own).max(axis=0).argmax())
    size = largest(own) or inf
    half = values(history.rerun(linear.truncated(model.n // 2), tol))
    truncation = largest(own - half) / size

    budget = history.error_budget if has_error_bars(model) else None
    mesh = None
    if budget is not None and model.strain_error is not None:
        corrected = largest(values(history.rerun(linear.corrected(), tol)))
        mesh = budget.safety * abs(corrected - largest(own)) / size
    return ProbeError(truncation, None if budget is None else budget.rest_of_force, mesh)
