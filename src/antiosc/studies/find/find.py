"""`find_impact`: the place and the strength of a blow from the signals of sensors.

The structure's free modes give the model of every candidate place (`antiosc.studies.free_sites`). A
scan with half-sine pulses (`scan`) finds the places at which a search begins; Gauss–Newton in
logarithms (`fit`) finds the blow. Errors of the model are unknowns of known size: a relative change
of each natural frequency, and of each mode's share in each signal. The bars contain them.
"""

from __future__ import annotations

import os
import time
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import ArrayLike

from antiosc.base import checks
from antiosc.base._types import Array
from antiosc.base.errors import AccuracyWarning, InputError, without_warnings
from antiosc.base.process import one_thread
from antiosc.contact import ContactLaw, Hertz
from antiosc.fem.assembly import with_parts
from antiosc.fem.platform import collective, warn
from antiosc.fem.structure.structure import Structure, refuse_dampers
from antiosc.models.free_modes import residual
from antiosc.models.modal import Damping, as_damping
from antiosc.simulation.bodies.impactors import RigidMass
from antiosc.studies.find.fit import Fit
from antiosc.studies.find.forward import Struck
from antiosc.studies.find.found import FOUND, UNDETERMINED, UNEXPLAINED, FoundImpact
from antiosc.studies.find.recording import Recording, recording
from antiosc.studies.find.scan import Scan, scan
from antiosc.studies.find.search import POOR, most_probable
from antiosc.studies.find.sensor import Sensor, of_shapes
from antiosc.studies.find.surface import Surface
from antiosc.studies.free_sites import ABOVE, FreeSites, Where, free_sites

#: What may be unknown, besides the start.
UNKNOWN = ("place", "mass", "velocity", "stiffness", "E")
#: Free modes where neither `modes` nor a band says how many.
MODES = 60
#: Stiffness of Hertz's law with which a search begins where it is known of none.
STIFFNESS = 1e9
#: Standard deviations that a determined unknown has at most: of logarithms, and of the place over
#: the extent of the sites.
DETERMINED, DETERMINED_PLACE = 0.3, 0.05
#: Standard deviations of the half-widths of intervals of 95 %: of one number, of a place.
BAR = {0: 1.96, 1: 1.96, 2: 2.45}
#: Standard deviation of a place by the interpolation between sites, over their spacing: what 17
#: blows on two meshes showed.
INTERPOLATION = 0.01
#: Relative error that all modes have in common, over `shape_error`: it scales the force, and no
#: signal shows it. Chosen by 64 blows on two meshes (benchmarks/find_impact.py).
COMMON = 0.25
#: Difference of the costs of two blows that are as probable, per chi².
AS_PROBABLE = 9.0


@dataclass(frozen=True, eq=False)
class Monitored:
    """A structure with sensors: what many blows have in common.

    Attributes
    ----------
    seen : its sites in its free modes; rows (m, J) of the sensors, orders (m,) their derivatives.
    r : (P,) residual compliances; mass : of the structure [kg].
    """

    seen: FreeSites
    rows: Array
    orders: Array
    r: Array
    mass: float


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
    contact: ContactLaw | None = None,
    direction: Sequence[float] | None = None,
    radius: float | None = None,
    damping: float | Damping | None = None,
    noise: ArrayLike | None = None,
    modes: int | None = None,
    band: float | None = None,
    frequency_error: float = 0.01,
    shape_error: float = 0.03,
) -> FoundImpact:
    """The place and the strength of one blow on a structure at rest, from the signals of sensors.

    Parameters
    ----------
    structure : Structure
        With a mesh.
    sensors : sequence of Sensor
    signals : array_like (n, m), or path
        A column for each sensor, in its unit; the record may begin before the blow or after it. A
        file is a table in text, with the times [s] in a column before them or without.
    rate : float, optional
        Samples a second [Hz]; not needed for a file with times.
    where, direction, radius
        Where the blow may have been: as for `impact_map`. Among given points the place is one of
        them; on surfaces it lies between the vertices.
    unknown : sequence of "place", "mass", "velocity", "stiffness", "E"
        What is to be found, besides the start. "E" is one factor for the stiffness of the whole
        structure.
    impactor : RigidMass, optional
        Mass and velocity that are not unknown.
    contact : ContactLaw, optional
        With the stiffness, if that is not unknown; default: Hertz's law.
    damping : float or Damping, optional
        Of the structure.
    noise : float or (m,), optional
        Standard deviation of a sample, in the unit of each signal; default: from the signals above
        the band.
    modes : int, optional
        Free modes of the model; default 60, or as many as reach 1.5 times `band`.
    band : float, optional
        Highest circular frequency that is compared [rad/s]; default: where the power of the signals
        ends, at most the last free frequency over 1.5.
    frequency_error, shape_error : float
        Expected relative errors (standard deviations) of the model: of each natural frequency, and
        of each mode's part in each signal.

    Returns
    -------
    FoundImpact
        With status 1 or 2, and a message, where the signals do not tell.

    Raises
    ------
    InputError
        Signals that do not fit the sensors, too few samples, unsound arguments.

    Notes
    -----
    A pulse on a stiff structure depends on two numbers of the three mass, velocity and stiffness:
    then force and impulse are found, and the bars of the three are wide.
    """
    started = time.perf_counter()
    checks.instance("structure", structure, Structure, "a Structure")
    sensors = checks.several("sensors", sensors, Sensor, "Sensor")
    if not sensors:
        raise InputError("sensors must hold one Sensor or more.")
    names = _names(unknown, impactor, contact)
    expected = (
        checks.tolerance(frequency_error, "frequency_error"),
        checks.tolerance(shape_error, "shape_error"),
    )
    if band is not None:
        band = checks.positive("band", band, "rad/s")
    recording(signals, len(sensors), rate, noise, band, np.inf)  # refused before the modes
    monitored = prepared(structure, sensors, where, direction, radius, modes, band)
    prepared_at = time.perf_counter()
    data = recording(signals, len(sensors), rate, noise, band, monitored.seen.omega[-1] / ABOVE)
    with without_warnings():
        result = found_in(monitored, data, names, impactor, contact, as_damping(damping), expected)
    seconds = {"model": prepared_at - started, "search": time.perf_counter() - prepared_at}
    result = replace(result, info={**result.info, "seconds": seconds})
    if result.status:
        warn(structure.comm, result.message, AccuracyWarning)
    return result


def _names(
    unknown: Sequence[str], impactor: RigidMass | None, contact: ContactLaw | None
) -> list[str]:
    """Checked names of the unknowns; InputError where a known value is missing."""
    if isinstance(unknown, str) or not isinstance(unknown, Sequence):
        raise InputError(
            f"unknown must list names of {', '.join(UNKNOWN)}; got {checks.shown(unknown)}."
        )
    for name in unknown:
        checks.choice("unknown", name, UNKNOWN)
    if impactor is not None:
        checks.instance("impactor", impactor, RigidMass, "a RigidMass")
    if contact is not None:
        checks.instance("contact", contact, ContactLaw, "a ContactLaw such as Hertz(stiffness)")
    missing = {"mass", "velocity"} - set(unknown)
    if missing and impactor is None:
        raise InputError(f"{min(missing)} is not unknown: give it as impactor=RigidMass(…).")
    if "stiffness" not in unknown and contact is None:
        raise InputError("the stiffness is not unknown: give the law, as contact=Hertz(…).")
    if "stiffness" in unknown and contact is not None and not hasattr(contact, "stiffness"):
        raise InputError(f"{type(contact).__name__} has no stiffness that could be unknown.")
    return [name for name in UNKNOWN if name in unknown]


def prepared(
    structure: Structure,
    sensors: Sequence[Sensor],
    where: Where,
    direction: Sequence[float] | None,
    radius: float | None,
    modes: int | None,
    band: float | None,
) -> Monitored:
    """The model of all sites and sensors; arguments as of `find_impact`."""
    matrices = with_parts(structure, "finding a blow needs a mesh: matrices have no points.")
    refuse_dampers(structure, "find_impact")
    if radius is not None:
        radius = checks.positive("radius", radius, "m")
    count = MODES if modes is None and band is None else modes
    with without_warnings():  # of patches that an edge cuts, at sites that were not struck
        seen = free_sites(structure, matrices, where, direction, radius, count, band)
    rows = np.array([of_shapes(one, structure, seen.phi) for one in sensors])
    r, _ = residual(seen.omega, seen.b, seen.compliance, seen.inertia, structure.shift)
    orders = np.array([one.derivative for one in sensors])
    return Monitored(seen, rows, orders, r, structure.mass)


def found_in(
    monitored: Monitored,
    data: Recording,
    unknown: Sequence[str],
    impactor: RigidMass | None,
    contact: ContactLaw | None,
    damping: Damping | None,
    expected: tuple[float, float],
) -> FoundImpact:
    """The blow in one record."""
    seen, sites = monitored.seen, monitored.seen.found.sites
    if "place" not in unknown and len(sites) > 1:
        raise InputError(f"the place is not unknown: where gives {len(sites)} sites, not one.")
    omega = seen.omega
    decay = np.zeros(len(omega)) if damping is None else damping.decay(omega)
    elements = seen.found.elements if "place" in unknown else seen.found.elements[:0]
    model = Struck(
        data, Surface(sites.points, sites.directions, elements), omega, decay, monitored.rows,
        monitored.orders, np.column_stack([seen.b, monitored.r, sites.local]), sites.radii,
        Hertz(STIFFNESS) if contact is None else contact,
    )  # fmt: skip
    known = {"stiffness": getattr(model.law, "stiffness", 1.0)}
    if impactor is not None:
        known |= {"mass": impactor.mass, "velocity": impactor.velocity}
    known = {name: value for name, value in known.items() if name not in unknown}
    scanned = scan(model, expected[0])
    fits = most_probable(model, scanned, unknown, known, monitored.mass, *expected)
    scale = COMMON * expected[1] if {"mass", "velocity"} & set(unknown) else 0.0
    return _told(model, scanned, fits, unknown, scale)


# -- what is told


def _told(
    model: Struck, scanned: Scan, fits: list[Fit], unknown: Sequence[str], scale: float
) -> FoundImpact:
    best, data = fits[0], model.data
    blow, hit = best.blow, best.hit
    extent = float(np.ptp(model.surface.points, axis=0).max()) or 1.0
    limits = np.array([
        DETERMINED_PLACE * extent if name == "place"
        else blow.lasting if name == "start" else DETERMINED
        for name in best.names
    ])  # fmt: skip
    scaled = best.covariance / limits / limits[:, None]
    rank = int(np.sum(np.linalg.eigvalsh(scaled) < 1))
    bars = _bars(best, scale)
    near = max(3 * bars["place"], 0.05 * extent)
    others = [
        fit.blow.place
        for fit in fits[1:]
        if fit.cost - best.cost < AS_PROBABLE * max(best.chi2, 1.0)
        and np.linalg.norm(fit.blow.place - blow.place) > near
    ]
    status, message = _verdict(best, rank, limits, others, data)
    t, on = data.time, data.time >= blow.start
    force = np.zeros(len(t))
    force[on] = hit.force_at(np.minimum(t[on] - blow.start, hit.run.time[-1]))
    every = len(t) // max(len(data.compared), 1) or 1
    gain = data.sigma / float(np.abs(data.filter.sum(axis=1)).max())
    return FoundImpact(
        place=blow.place, direction=model.surface.directions[blow.site],
        mass=blow.mass, velocity=blow.velocity,
        stiffness=blow.stiffness if hasattr(model.law, "stiffness") else None,
        start=blow.start, E=blow.E, bars=bars, chi2=best.chi2, rank=rank,
        unknowns=len(limits), status=status, message=message, history=hit, time=t, force=force,
        compared_time=t[::every][: len(data.compared)], measured=data.compared * gain,
        computed=best.signals * gain, band=data.band, points=model.surface.points,
        explained=scanned.explained, others=np.reshape(others, (-1, 3)),
        info={"sites": len(model.surface.points), "modes": len(model.omega)},
    )  # fmt: skip


def _bars(fit: Fit, scale: float) -> dict[str, float]:
    """Half-widths of intervals of 95 %; `scale`: relative error of the whole model."""
    variance = np.diag(fit.covariance)
    along = np.array([name == "place" for name in fit.names])
    d = int(along.sum())
    place = fit.covariance[np.ix_(along, along)]
    bars = {"place": 0.0}
    if d:
        between = (INTERPOLATION * fit.chart.size) ** 2
        bars["place"] = BAR[d] * float(np.sqrt(np.linalg.eigvalsh(place)[-1] + between))
    for name, own in zip(fit.names[d:], variance[d:], strict=True):
        deviation = float(np.sqrt(own + scale**2 * (name == "velocity")))
        told = name == "start" or deviation < DETERMINED
        bars[name] = BAR[1] * deviation if told else np.inf
    for k, name in enumerate(("peak_force", "impulse")):
        g = fit.gains[k]
        bars[name] = BAR[1] * float(np.sqrt(g @ fit.covariance @ g + scale**2))
    return {name: bars.get(name, 0.0) for name in (*UNKNOWN, "start", "peak_force", "impulse")}


def _verdict(
    fit: Fit, rank: int, limits: Array, others: list[Array], data: Recording
) -> tuple[int, str]:
    """Status and message."""
    count = len(limits)
    if fit.chi2 > POOR:
        return UNEXPLAINED, (
            f"cannot tell: no blow explains the signals, chi² = {fit.chi2:.3g} where 1 is expected:"
            " free E, give the damping, allow for a larger frequency_error, or compare a lower"
            " band."
        )
    if others:
        places = "; ".join(checks.in_words(place) for place in others)
        return UNDETERMINED, (
            f"cannot tell the place: the signals fit as well at {places}; add a sensor off the"
            " axis of symmetry."
        )
    if rank < count:
        deviations = np.sqrt(np.diag(fit.covariance))
        free = [n for n, s, limit in zip(fit.names, deviations, limits, strict=True) if s > limit]
        named = ", ".join(dict.fromkeys(free)) or "a combination of them"
        return UNDETERMINED, (
            f"the signals determine {rank} of {count} unknowns; not told: {named}. Give what is"
            " known of the impactor, or add sensors."
        )
    return FOUND, f"the signals determine all {count} unknowns, chi² = {fit.chi2:.3g}."
