"""`find_impact`: the place and the strength of an impact from the signals of sensors.

The structure's free modes give the model of every candidate place (`antiosc.strikes.impact_map`). A
scan with half-sine pulses (`scan_pulses`) finds starting places; a Gauss–Newton iteration in
logarithms (`Search`) finds the impact. Model errors are additional unknowns of known size: a
relative change of each natural frequency, and of each mode's share in each signal. The error bars
contain them.
"""

from __future__ import annotations

import os
import time
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
from numpy.typing import ArrayLike

from antiosc import ContactLaw, Damping, Hertz, History, RigidMass, Structure
from antiosc.base import checks
from antiosc.base._types import Array, Figure
from antiosc.base.errors import AccuracyWarning, InputError, without_warnings
from antiosc.base.process import one_thread
from antiosc.base.texts import Result
from antiosc.fem.platform import collective, warn
from antiosc.fem.structure.structure import refuse_dampers, with_parts
from antiosc.models.body import AUTO, AnyLaw
from antiosc.models.free_modes import residual_parameters
from antiosc.models.modal import as_damping
from antiosc.plot.charts import figure_or_path, panels
from antiosc.strikes.free_sites import BAND_FACTOR, FreeSites, SiteSelection, free_sites
from antiosc.strikes.impact_map import on_plane
from antiosc_studies.find.forward import MapSurface, SearchModel, has_stiffness
from antiosc_studies.find.recording import Recording, Sensor, recording_of, sensor_shapes
from antiosc_studies.find.search import (
    POOR_CHI2,
    ProbableImpact,
    PulseScan,
    most_probable_impacts,
    scan_pulses,
)

#: Values of `FoundImpact.status`.
FOUND = 0
UNDETERMINED = 1
UNEXPLAINED = 2


@dataclass(frozen=True, eq=False, repr=False)
class FoundImpact(Result):
    """An impact identified from measured signals.

    Attributes
    ----------
    place, direction : (3,) struck point [m], and unit vector of the impact.
    mass [kg], velocity [m/s], stiffness : mass and velocity of the impactor, stiffness of the
        contact law (None for a law without one).
    start : time of the first touch after the first sample [s]; may be negative.
    E : factor of the stiffness of the structure; 1 unless it was unknown.
    bars : name -> half-width of the 95 % confidence interval: "place" [m], "start" [s]; relative
        for "mass", "velocity", "stiffness", "E", "peak_force", "impulse". inf: the signals do not
        determine it; 0: it was known.
    chi2 : squared difference of the signals over its expected value; 1 for a sound fit.
    rank, unknowns : number of unknowns that the signals determine, and number of all.
    status : 0: found; 1: not all unknowns are determined, or other places are as probable; 2: the
        model does not explain the signals.
    message : the status in words.
    history : the impact, from the first touch on; its shapes are not known.
    time : (n,) samples [s]; force : (n,) contact force there [N].
    measured, computed : (n', m) signals in their units, in the compared band, at `compared_time`.
    band : the band that is compared [Hz].
    points, explained : (P, 3) sites of the scan [m]; (P,) share of the signals that the best
        pulse at each site explains.
    others : other places [m] that explain the signals equally well.
    info : seconds, numbers of sites and modes.
    """

    place: Array
    direction: Array
    mass: float
    velocity: float
    stiffness: float | None
    start: float
    E: float
    bars: Mapping[str, float]
    chi2: float
    rank: int
    unknowns: int
    status: int
    message: str
    history: History
    time: Array
    force: Array
    compared_time: Array
    measured: Array
    computed: Array
    band: float
    points: Array
    explained: Array
    others: Array
    info: dict[str, object] = field(default_factory=dict)

    @property
    def peak_force(self) -> float:
        """Largest contact force [N]."""
        return self.history.peak_force

    @property
    def impulse(self) -> float:
        """Time integral of the contact force [N s]."""
        return self.history.impulse

    def summary(self) -> str:
        """A table of the results with their error bars, and the message."""
        return "\n".join([*(f"{name:<12}{value}" for name, value in self.rows()), self.message])

    def rows(self) -> list[tuple[str, str]]:
        """(name, value with error bar) of each result."""
        place = ", ".join(f"{c:.5g}" for c in self.place)
        rows = [
            ("place", f"{place} m  ± {self.bars['place']:.2g} m"),
            ("start", f"{self.start:.5g} s  ± {self.bars['start']:.2g} s"),
        ]
        for name in ("peak_force", "impulse", "mass", "velocity", "stiffness", "E"):
            value = getattr(self, name)
            if value is None:
                continue
            bar = self.bars[name]
            bar_text = "not told" if np.isinf(bar) else f"± {100 * bar:.2f} %" if bar else "known"
            unit = {"peak_force": " N", "impulse": " N s", "mass": " kg", "velocity": " m/s"}
            rows.append((name, f"{value:.5g}{unit.get(name, '')}  {bar_text}"))

        return [*rows, ("chi2", f"{self.chi2:.3g}")]

    def numbers(self) -> dict[str, object]:
        """The results in SI units, with their bars, the status and the message."""
        names = ("place", "direction", "mass", "velocity", "stiffness", "start", "E", "peak_force")
        other_names = ("impulse", "bars", "chi2", "rank", "unknowns", "status", "message", "others")
        return {name: getattr(self, name) for name in (*names, *other_names)}

    def _facts(self) -> list[tuple[str, str]]:
        place, _, *rows = self.rows()
        return [place, *rows[:2], ("status", f"{self.status}: {self.message}")]

    def plot(self, path: str | os.PathLike[str] | None = None) -> Figure | Path:
        """The measured and the computed signals, the force, and the scan of the places.

        With `path` (PNG, PDF, SVG, …) the picture is written and the path is returned.
        """
        count = self.measured.shape[1]
        figure, axes = panels(1, 2, (9.5, 1.2 + 1.1 * max(count, 3)), shown=path is None)
        left, right = axes[0]

        t = 1e3 * self.compared_time
        for s, size in enumerate(np.abs(self.measured).max(axis=0)):
            offset = -2.2 * s
            left.plot(t, offset + self.measured[:, s] / size, color="0.75", lw=4)
            left.plot(t, offset + self.computed[:, s] / size, color="C0", lw=1)

        left.set(xlabel="time (ms)", title="measured (grey), computed", yticks=[])
        left.set_ylabel("sensors, the first on top")
        end = min(1.5 * max(self.history.contact_time, 1e-9), self.history.run.time[-1])
        t = np.linspace(0.0, end, 400)
        right.plot(1e3 * (t + self.start), self.history.force_at(t), color="C3")
        right.set(xlabel="time (ms)", ylabel="force (N)", ylim=(0, None), title="contact force")
        return figure_or_path(figure, path)


#: Quantities that may be unknown, besides the start.
POSSIBLE_UNKNOWNS = ("place", "mass", "velocity", "stiffness", "E")
#: Default number of free modes, if no band is given.
DEFAULT_MODES = 60
#: Initial stiffness of Hertz's law, if no law is given.
INITIAL_STIFFNESS = 1e9
#: Largest standard deviation of the logarithm of an unknown that counts as determined.
DETERMINED_LOG_SIGMA = 0.3
#: Largest standard deviation of a determined place over the extent of the sites.
DETERMINED_PLACE_RATIO = 0.05
#: Half-width of a 95 % interval in standard deviations, by the dimension of the unknown.
INTERVAL_HALF_WIDTHS = {0: 1.96, 1: 1.96, 2: 2.45}
#: Standard deviation of a place by the interpolation between sites, over their spacing (from 17
#: blows on two meshes).
INTERPOLATION_ERROR = 0.01
#: Relative error common to all modes, over `shape_error`: it scales the force, and no signal shows
#: it. Chosen by 64 blows on two meshes (benchmarks/find_impact.py).
COMMON_MODE_ERROR = 0.25
#: Two blows are equally probable if their costs differ by less than this times chi².
EQUAL_COST_DIFFERENCE = 9.0


@dataclass(frozen=True, eq=False)
class MonitoredStructure:
    """A structure with sensors, prepared once for many searches."""

    free_sites: FreeSites  # its sites in free modes
    #: rows, orders: (m, J) mode shapes at the sensors; (m,) orders of their time derivatives
    sensor_shapes: Array
    derivative_orders: Array
    residual_compliances: Array  # (P,) residual compliances of the sites
    mass: float  # mass of the structure [kg]


@collective()
@checks.within_range
@one_thread()
def find_impact(
    structure: Structure,
    sensors: Sequence[Sensor],
    signals: ArrayLike | str | os.PathLike[str],
    rate: float | None = None,
    where: str | Sequence[str] | Sequence[Sequence[float]] | None = None,
    unknown: Sequence[str] = ("place", "mass", "velocity", "stiffness"),
    *,
    impactor: RigidMass | None = None,
    contact: AnyLaw | None = None,
    direction: Sequence[float] | None = None,
    radius: float | None = None,
    damping: float | Damping | None = None,
    noise: ArrayLike | None = None,
    modes: int | None = None,
    band: float | None = None,
    frequency_error: float = 0.01,
    shape_error: float = 0.03,
) -> FoundImpact:
    """The place and the strength of one impact on a structure at rest, from signals of sensors.

    Parameters
    ----------
    structure : Structure
        With a mesh.
    sensors : sequence of Sensor
    signals : array_like (n, m), or path
        One column for each sensor, in its unit; the record may begin before or after the impact. A
        file is a text table, as for `read_frf`; a first column may give the times [s].
    rate : float, optional
        Sampling rate [Hz]; not needed for a file with times.
    where, direction, radius
        Candidate places of the impact, as for `impact_map`. Of given points, the place is one of
        them; on surfaces it may be between the vertices.
    unknown : sequence of "place", "mass", "velocity", "stiffness", "E"
        Quantities to be found, in addition to the start. "E" is one factor for the stiffness of the
        whole structure.
    impactor : RigidMass, optional
        Mass and velocity, as far as they are known.
    contact : ContactLaw or "auto", optional
        The contact law, with its stiffness if that is known; "auto": the law of the impactor's tip
        on a flat face of the structure. Default: Hertz's law with an unknown stiffness; if the
        stiffness is not among the unknowns and the impactor has a surface (tip_radius, material),
        "auto".
    damping : float or Damping, optional
        Damping of the structure.
    noise : float or (m,), optional
        Standard deviation of a sample, in the unit of each signal; default: from the signals above
        the band.
    modes : int, optional
        Free modes of the model; default 60, or as many as reach 1.5 times `band`.
    band : float, optional
        Highest frequency that is compared [Hz]; default: the end of the signals' power spectrum,
        at most the last free frequency over 1.5.
    frequency_error, shape_error : float
        Expected relative errors (standard deviations) of the model: of each natural frequency, and
        of each mode's part in each signal.

    Returns
    -------
    FoundImpact
        If the signals do not determine the impact, its status is 1 or 2, with a message.

    Raises
    ------
    InputError
        Signals that do not fit the sensors, too few samples, unsound arguments.

    Notes
    -----
    On a stiff structure the force pulse depends on only two combinations of mass, velocity and
    stiffness: force and impulse are then found, and the error bars of these three are wide.
    """
    start_time = time.perf_counter()
    checks.instance("structure", structure, Structure, "a Structure")
    sensors = checks.list_of("sensors", sensors, Sensor, "Sensor")
    if not sensors:
        raise InputError("sensors must hold one Sensor or more.")

    has_tip = isinstance(impactor, RigidMass) and impactor.surface() is not None
    if contact is None and has_tip and "stiffness" not in unknown:
        contact = AUTO

    law = None if contact is None else on_plane(structure, impactor, contact)
    names = _unknown_names(unknown, impactor, law)
    frequency_error = checks.tolerance(frequency_error, "frequency_error")
    sigmas = frequency_error, checks.tolerance(shape_error, "shape_error")
    if band is not None:
        band = checks.band(band)

    recording_of(signals, sensors, rate, noise, band, np.inf)  # refused before the modes
    monitored = monitored_structure(structure, sensors, where, direction, radius, modes, band)
    prepared_at = time.perf_counter()
    highest = monitored.free_sites.omega[-1] / BAND_FACTOR
    data = recording_of(signals, sensors, rate, noise, band, highest)
    with without_warnings():
        damping = as_damping(damping)
        found = impact_of_recording(monitored, data, names, impactor, law, damping, sigmas)

    seconds = {"model": prepared_at - start_time, "search": time.perf_counter() - prepared_at}
    found.info["seconds"] = seconds
    if found.status:
        warn(structure.comm, found.message, AccuracyWarning)

    return found


def _unknown_names(
    unknown: Sequence[str], impactor: RigidMass | None, contact: ContactLaw | None
) -> list[str]:
    """Checked names of the unknowns; InputError if a known value is missing."""
    if isinstance(unknown, str) or not isinstance(unknown, Sequence):
        names = ", ".join(POSSIBLE_UNKNOWNS)
        raise InputError(f"unknown must list names of {names}; got {checks.shown(unknown)}.")

    for name in unknown:
        checks.choice("unknown", name, POSSIBLE_UNKNOWNS)

    if impactor is not None:
        checks.instance("impactor", impactor, RigidMass, "a RigidMass")

    known = {"mass", "velocity"} - set(unknown)
    if known and impactor is None:
        raise InputError(f"{min(known)} is not unknown: give it as impactor=RigidMass(…).")
    if "stiffness" not in unknown and contact is None:
        raise InputError("the stiffness is not unknown: give the law, as contact=Hertz(…).")
    if "stiffness" in unknown and contact is not None and not has_stiffness(contact):
        raise InputError(
            f"{type(contact).__name__} has no stiffness that could be unknown: leave it out of "
            "unknown, or give Hertz(…)."
        )

    return [name for name in POSSIBLE_UNKNOWNS if name in unknown]


def monitored_structure(
    structure: Structure,
    sensors: Sequence[Sensor],
    where: SiteSelection,
    direction: Sequence[float] | None,
    radius: float | None,
    modes: int | None,
    band: float | None,
) -> MonitoredStructure:
    """The model of all sites and sensors; arguments as for `find_impact`."""
    matrices = with_parts(structure, "finding a blow needs a mesh: matrices have no points.")
    refuse_dampers(structure, "find_impact")
    if radius is not None:
        radius = checks.positive("radius", radius, "m")
    count = DEFAULT_MODES if modes is None and band is None else modes
    with without_warnings():  # of patches that an edge cuts, at sites that were not struck
        sites = free_sites(structure, matrices, where, direction, radius, count, band)
    rows = np.array([sensor_shapes(sensor, structure, sites.phi) for sensor in sensors])
    site_data = sites.b, sites.compliance, sites.inertia
    r, _ = residual_parameters(sites.omega, *site_data, structure.shift)
    orders = np.array([sensor.derivative for sensor in sensors])
    return MonitoredStructure(sites, rows, orders, r, structure.mass)


def impact_of_recording(
    monitored: MonitoredStructure,
    recording: Recording,
    unknown: Sequence[str],
    impactor: RigidMass | None,
    contact: ContactLaw | None,
    damping: Damping | None,
    relative_sigmas: tuple[float, float],
) -> FoundImpact:
    """The impact that explains a recording best, with its uncertainty.

    relative_sigmas : standard deviations of natural frequencies, and of modes' shares.
    """
    seen = monitored.free_sites
    sites = seen.map_sites.sites
    if "place" not in unknown and len(sites) > 1:
        raise InputError(f"the place is not unknown: where gives {len(sites)} sites, not one.")
    omega = seen.omega
    decay = np.zeros(len(omega)) if damping is None else damping.decay(omega)
    elements = seen.map_sites.elements if "place" in unknown else seen.map_sites.elements[:0]
    model = SearchModel(
        recording,
        MapSurface(sites.points, sites.directions, elements),
        omega,
        decay,
        monitored.sensor_shapes,
        monitored.derivative_orders,
        np.column_stack([seen.b, monitored.residual_compliances, sites.local]),
        sites.radii,
        Hertz(INITIAL_STIFFNESS) if contact is None else contact,
    )
    known = {"stiffness": getattr(model.law, "stiffness", 1.0)}
    if impactor is not None:
        known |= {"mass": impactor.mass, "velocity": impactor.velocity}
    known = {name: value for name, value in known.items() if name not in unknown}
    scanned = scan_pulses(model, relative_sigmas[0])
    fits = most_probable_impacts(model, scanned, unknown, known, monitored.mass, *relative_sigmas)
    scale = COMMON_MODE_ERROR * relative_sigmas[1] if {"mass", "velocity"} & set(unknown) else 0.0
    return _found_impact(model, scanned, fits, scale)


# -- the result


def _found_impact(
    model: SearchModel,
    scanned: PulseScan,
    fits: list[ProbableImpact],
    model_error: float,
) -> FoundImpact:
    """The result from the best fits, the most probable first.

    model_error : relative error that is common to all modes.
    """
    best = fits[0]
    data = model.data
    blow = best.blow
    hit = best.hit
    extent = np.ptp(model.surface.points, axis=0).max() or 1.0
    limit_of = {"place": DETERMINED_PLACE_RATIO * extent, "start": blow.contact_time_estimate}
    limits = np.array([limit_of.get(name, DETERMINED_LOG_SIGMA) for name in best.unknown_names])
    scaled = best.covariance / limits / limits[:, None]
    rank = int(np.sum(np.linalg.eigvalsh(scaled) < 1))
    bars = _interval_half_widths(best, model_error)
    distance = max(3 * bars["place"], 0.05 * extent)
    highest = best.cost + EQUAL_COST_DIFFERENCE * max(best.chi2, 1.0)
    as_probable = [fit.blow.place for fit in fits[1:] if fit.cost < highest]
    others = [x for x in as_probable if np.linalg.norm(x - blow.place) > distance]
    status, message = _status_and_message(best, rank, limits, others)
    t = data.time
    later = np.minimum(t - blow.start, hit.run.time[-1])
    force = np.where(later < 0, 0.0, hit.force_at(np.maximum(later, 0.0)))
    stride = len(t) // max(len(data.scaled_signals), 1) or 1
    gain = data.noise_sigma / np.abs(data.filter_matrix.sum(axis=1)).max()

    return FoundImpact(
        place=blow.place,
        direction=model.surface.directions[blow.site],
        mass=blow.mass,
        velocity=blow.velocity,
        stiffness=blow.stiffness if hasattr(model.law, "stiffness") else None,
        start=blow.start,
        E=blow.E,
        bars=bars,
        chi2=best.chi2,
        rank=rank,
        unknowns=len(limits),
        status=status,
        message=message,
        history=hit,
        time=t,
        force=force,
        compared_time=t[::stride][: len(data.scaled_signals)],
        measured=data.scaled_signals * gain,
        computed=best.signals * gain,
        band=data.band / (2 * np.pi),
        points=model.surface.points,
        explained=scanned.power_share,
        others=np.reshape(others, (-1, 3)),
        info={"sites": len(model.surface.points), "modes": len(model.omega)},
    )


def _interval_half_widths(fit: ProbableImpact, model_error: float) -> dict[str, float]:
    """Half-widths of 95 % intervals by name; `model_error`: relative error of the whole model."""
    variance = np.diag(fit.covariance)
    d = fit.unknown_names.count("place")  # its coordinates are the first unknowns
    place = fit.covariance[:d, :d]
    bars = {"place": 0.0}

    if d:
        interpolation = (INTERPOLATION_ERROR * fit.chart.size) ** 2
        widest = float(np.sqrt(np.linalg.eigvalsh(place)[-1] + interpolation))
        bars["place"] = INTERVAL_HALF_WIDTHS[d] * widest

    for name, v in zip(fit.unknown_names[d:], variance[d:], strict=True):
        deviation = float(np.sqrt(v + model_error**2 * (name == "velocity")))
        determined = name == "start" or deviation < DETERMINED_LOG_SIGMA
        bars[name] = INTERVAL_HALF_WIDTHS[1] * deviation if determined else np.inf

    for k, name in enumerate(("peak_force", "impulse")):
        g = fit.strength_derivatives[k]
        deviation = float(np.sqrt(g @ fit.covariance @ g + model_error**2))
        bars[name] = INTERVAL_HALF_WIDTHS[1] * deviation

    names = (*POSSIBLE_UNKNOWNS, "start", "peak_force", "impulse")
    return {name: bars.get(name, 0.0) for name in names}


def _status_and_message(
    fit: ProbableImpact, rank: int, limits: Array, others: list[Array]
) -> tuple[int, str]:
    """(status, message) of a search.

    rank : number of unknowns that are determined; limits : (U,) largest standard deviations of
    determined unknowns; others : other places as probable.
    """
    count = len(limits)
    if fit.chi2 > POOR_CHI2:
        return UNEXPLAINED, (
            f"cannot tell: no blow explains the signals, chi² = {fit.chi2:.3g} where 1 is expected:"
            " free E, give the damping, allow for a larger frequency_error, or compare a lower"
            " band."
        )
    if others:
        places = "; ".join(checks.point_text(place) for place in others)
        return UNDETERMINED, (
            f"cannot tell the place: the signals fit as well at {places}; add a sensor off the"
            " axis of symmetry."
        )

    if rank < count:
        out = np.sqrt(np.diag(fit.covariance)) > limits
        free = np.array(fit.unknown_names)[out].tolist()
        params = ", ".join(dict.fromkeys(free)) or "a combination of them"
        return UNDETERMINED, (
            f"the signals determine {rank} of {count} unknowns; not told: {params}. Give what is"
            " known of the impactor, or add sensors."
        )

    return FOUND, f"the signals determine all {count} unknowns, chi² = {fit.chi2:.3g}."
