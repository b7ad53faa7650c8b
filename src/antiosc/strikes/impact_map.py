"""`impact_map`: anti-oscillators and impacts at every point of a surface.

All sites use one eigenproblem (`antiosc.models.free_modes`). Each site needs the displacements of
the free modes there, and the compliance b'y and the inertia y'My of its static deflection y
(`antiosc.fem.linalg.deflections`). The error of Z is bounded at each site.
"""

from __future__ import annotations

import contextlib
import math
from collections.abc import Sequence
from dataclasses import replace
from functools import partial

import numpy as np

from antiosc.base import checks
from antiosc.base._types import Array, BoolArray
from antiosc.base.checks import instance, positive, whole, within_range
from antiosc.base.errors import AccuracyWarning, InputError, warn, warnings_to
from antiosc.base.process import one_thread
from antiosc.base.progress import counting, doing
from antiosc.base.texts import engineering, percent, point_text as placed
from antiosc.engine.contact import ContactLaw, ElasticPlastic
from antiosc.engine.contact.curvature import SHARP_KINDS
from antiosc.fem.platform import collective, on_root, raise_on_all
from antiosc.fem.structure.structure import Structure, refuse_dampers, with_parts
from antiosc.impact.batch import simulate_many
from antiosc.impact.bodies import Obstacle
from antiosc.impact.from_rest import peak_deflections
from antiosc.impact.histories.linear_theory import beyond_theory_text
from antiosc.impact.histories.verdict import PLASTIC_ZONE_RADII
from antiosc.impact.scene import simulate_impact
from antiosc.impact.settings import Settings
from antiosc.impact.two_bodies import Impact
from antiosc.models import free_modes
from antiosc.models.body import (
    AUTO,
    BEYOND_WALL,
    EDGE_STRUCK,
    NARROW_HOLLOW,
    NO_RESULT,
    PIERCED_PART,
    AnyLaw,
    Body,
    LinearBody,
    checked_body,
    is_auto,
    law_of,
    second_contact_of,
)
from antiosc.models.free_modes import SiteModels
from antiosc.reduce.site.sites import doubtful_patches
from antiosc.reduce.site.surface import StruckStructure, surface_at
from antiosc.strikes.free_sites import BAND_FACTOR, FreeSites, free_sites
from antiosc.strikes.map_results import (
    ImpactMap,
    excited_band,
    hardest,
    left_out_text,
    low_band_text,
    spread_sites,
    with_doubts,
)
from antiosc.strikes.map_stresses import largest_stresses

#: Default band over the last free frequency, if neither a band nor an impactor is given.
DEFAULT_BAND_SHARE = 0.5
#: Most free modes if the impact determines the band.
MAX_MODES = 100
#: Numbers of anti-oscillators that are tried if `n` is not given.
OSCILLATOR_COUNTS = (12, 25, 50, 100)
#: Tolerance of the force on a rigid wall; excess over this force that makes a site doubtful.
WALL_TOL, WALL_MARGIN = 1e-3, 0.003
#: Mean pressure of a contact that yields all over, over the yield strength (Tabor).
FULLY_PLASTIC_PRESSURE_RATIO = 2.8


@collective()
@within_range
@one_thread()
def impact_map(
    structure: Structure,
    where: str | Sequence[str] | Sequence[Sequence[float]] | None = None,
    impactor: LinearBody | None = None,
    contact: AnyLaw | None = AUTO,
    duration: float | None = None,
    *,
    direction: Sequence[float] | None = None,
    radius: float | None = None,
    n: int | None = None,
    modes: int | None = None,
    band: float | None = None,
    accuracy: float = 0.05,
    stress: bool | int = False,
    most_sites: int | None = None,
) -> ImpactMap:
    """Anti-oscillators at many sites of a structure, and the impact of one impactor at each.

    Parameters
    ----------
    structure : Structure
        With a mesh.
    where : str, list of str, or array_like (P, 2 or 3), optional
        A group of faces (cells of shells and beams) whose vertices are the sites, several groups,
        or points. None: the whole surface. In an assembly "part:group", or "part" for its whole
        surface, or several of them; None: all parts, including tied faces. A vertex of two groups
        is a site of each.
    impactor, contact, duration
        As for `simulate`; "auto" chooses the law at each site. Sites on edges, whose radius is
        assumed, are doubtful. Without an impactor there are models and no impacts.
    direction : sequence of float, optional
        Direction of impact at all sites; None: against the outward normal (only for solids).
    radius : float, optional
        Radius of the patch, m, as for `Site`.
    n : int, optional
        Number of anti-oscillators at each site, by the Krylov method on the free modes. Default:
        12; with an impactor the fewest of 12, 25, 50 and 100 whose Z(ω) meets `accuracy` over the
        band.
    modes : int, optional
        Number of free modes; default 20, or as many as reach 1.5 times the band, at most 100 if no
        band is given.
    band : float, optional
        Highest frequency of interest, Hz. Default: the band that the impact excites
        (`impact_band`). Without an impactor, or with `modes`: half of the last free frequency; if
        100 modes end below the impact's band: the last free frequency over 1.5.
    accuracy : float
        Largest |dZ|/|Z| over the band, at 1 % damping; a warning counts the sites above it.
    stress : bool or int
        Whether to compute the largest von Mises stress anywhere in the part for the impact at each
        site, as `peak_field` does for one impact (0.3 s per site for 33 000 dofs). A number limits
        it to this many sites, which are reliable and far from each other. For solids, three radii
        around a contact that yields are left out.
    most_sites : int, optional
        Largest number of sites on each group or part, as far from each other as possible. Default:
        all vertices.

    Raises
    ------
    InputError
        An empty group, points off the structure, no site that can move, a missing direction.
    """
    instance("structure", structure, Structure, "a Structure")
    accuracy = positive("accuracy", accuracy)
    if radius is not None:
        radius = positive("radius", radius, "m")
    if most_sites is not None:
        most_sites = whole("most_sites", most_sites)
    if band is not None:
        band = checks.band(band)
    with_law = contact is not None and not is_auto(contact)
    if (impactor is None) != (duration is None) or (impactor is None and with_law):
        raise InputError(
            "impacts need both impactor and duration; an extraction needs none of them."
        )
    if not isinstance(stress, bool):
        stress = whole("stress", stress)
    if stress and impactor is None:
        raise InputError("stress needs impacts: give impactor and duration.")
    if impactor is not None:
        checked_body("impactor", impactor)
        duration = positive("duration", duration, "s")

    matrices = with_parts(structure, "a map needs a mesh: matrices have no points.")
    refuse_dampers(structure, "a map")
    law = None
    if impactor is not None:
        law = on_plane(structure, impactor, AUTO if contact is None else contact)
    excited = excited_band(impactor, law) if band is None and modes is None else None
    counts = (OSCILLATOR_COUNTS[0],) if excited is None else OSCILLATOR_COUNTS
    if n is not None:
        counts = (whole("n", n),)

    places = where, direction, radius
    most = math.inf if excited is None else MAX_MODES
    sites_seen = free_sites(structure, matrices, *places, modes, band or excited, most, most_sites)
    map_sites = sites_seen.map_sites
    omega = sites_seen.omega
    sites = map_sites.sites
    if excited is not None:
        band = min(excited, float(omega[-1]) / BAND_FACTOR)
    band = DEFAULT_BAND_SHARE * float(omega[-1]) if band is None else band
    if band >= omega[-1]:
        asked, last = (engineering(w / (2 * math.pi), "Hz") for w in (band, omega[-1]))
        raise InputError(
            f"the band {asked} must end below the last of {len(omega)} free modes, {last}: ask for"
            " more modes, or lower the band, which is in Hz."
        )

    with doing(f"models of {len(sites)} sites"):
        models, error = _reduced_sites(sites_seen, counts, structure.shift, band, accuracy)

    result = ImpactMap(
        points=sites.points,
        directions=sites.directions,
        elements=map_sites.elements,
        models=models,
        local_compliance=sites.local,
        radius=None if np.isnan(sites.radii).any() else sites.radii,
        band=band / (2 * math.pi),
        error=error,
        skipped=map_sites.count - len(sites),
        names=map_sites.names,
        cell_dimension=map_sites.dimension,
    )
    for reason, is_doubtful in doubtful_patches(sites).items():
        result = with_doubts(result, is_doubtful, reason)
    on_root(structure.comm, partial(_warn_of_sites, result, accuracy))
    if impactor is None or law is None or duration is None:
        on_root(structure.comm, partial(_warn_of_impacts, result, None))
        return result

    laws = None
    if not with_law:
        laws, doubts = _laws_and_exceptions(structure, result, impactor, law)
        for reason, is_doubtful in doubts.items():
            result = with_doubts(result, is_doubtful, reason)

    result_map = _with_impacts(structure, result, impactor, law, laws, duration)
    result_map = replace(result_map, free_sites=sites_seen)
    if stress:
        result_map = with_stresses(structure, result_map, None if stress is True else stress)
    thickness = structure.plausibility.get("thickness")
    on_root(structure.comm, partial(_warn_of_impacts, result_map, thickness))
    return result_map


def on_plane(structure: Structure, impactor: LinearBody | None, contact: AnyLaw) -> ContactLaw:
    """The law `contact`; for "auto" the law for the impactor on a flat face of the structure."""
    return law_of(contact, StruckStructure(structure), impactor)


def _laws_and_exceptions(
    structure: Structure, impact_map: ImpactMap, impactor: LinearBody, plane: ContactLaw
) -> tuple[list[ContactLaw], dict[str, BoolArray]]:
    """(laws of the P sites, masks (P,) by reason of sites where the law does not hold)."""
    laws = []
    sharp, hollow, pierced = (np.zeros(len(impact_map), dtype=bool) for _ in range(3))
    radii = impact_map.radius if impact_map.radius is not None else np.full(len(impact_map), np.nan)
    sites = zip(impact_map.points, impact_map.directions, radii.tolist(), strict=True)
    striker = impactor.surface() if isinstance(impactor, Body) else None

    with counting("laws of the sites", len(impact_map)) as ready:
        for i, (point, direction, radius) in enumerate(sites):
            of_site = None
            with contextlib.suppress(InputError):
                patch = None if np.isnan(radius) else radius
                of_site = surface_at(structure, point, direction, patch)
            body = StruckStructure(structure, of_site)
            try:
                laws.append(law_of(AUTO, body, impactor))
            except InputError:
                laws.append(plane)
                hollow[i] = True
            if of_site is not None:
                sharp[i] = of_site.kind in SHARP_KINDS
                pierced[i] = striker is not None and second_contact_of(of_site, striker) is not None
            ready(i + 1)

    return laws, {EDGE_STRUCK: sharp, NARROW_HOLLOW: hollow, PIERCED_PART: pierced}


def _reduced_sites(
    sites: FreeSites, counts: Sequence[int], shift: float, band: float, accuracy: float
) -> tuple[SiteModels, Array]:
    """(models with the first number in `counts` that meets `accuracy`, error bounds (P,))."""
    of_sites = sites.omega, sites.b, sites.compliance, sites.inertia
    for n in counts:
        models = free_modes.site_models(*of_sites, n, shift)
        left_out, reduction = free_modes.error_bound(models, *of_sites, band, shift)
        if np.all(reduction <= accuracy / 2):
            break

    return models, left_out + reduction


def _warn_of_sites(result: ImpactMap, accuracy: float) -> None:
    """Warn of sites without a result, and of errors above `accuracy`."""
    if result.skipped:
        warn(
            f"{result.skipped} of {result.skipped + len(result)} sites are left out: supports fix "
            "them along the direction of impact, or there is no surface under their patch.",
            AccuracyWarning,
        )

    poor = int(np.sum(result.error > accuracy))
    if poor:
        warn(
            f"Z may be off by more than {percent(accuracy)} at {poor} of {len(result)} sites up to "
            f"{engineering(result.band, 'Hz')} (at worst {percent(result.error.max())}), a bound at"
            " single frequencies and no bar of the force: take more anti-oscillators (n or modes),"
            " a lower band, or an impact at one site alone, which has a bar.",
            AccuracyWarning,
        )


def _warn_of_impacts(result: ImpactMap, thickness: float | None) -> None:
    """Warn of doubtful sites, of impacts beyond the band, and of a sheet that stretches."""
    sentences = [left_out_text(result), low_band_text(result)]

    if (
        thickness is not None
        and result.peak_deflection is not None
        and (result.models.k0 > 0).all()
    ):
        i = hardest(result, values=result.peak_deflection)
        largest = float(result.peak_deflection[i])
        if far := beyond_theory_text("structure", largest, thickness, False):
            sentences.append(f"a blow at {placed(result.points[i])}: {far}")

    for sentence in filter(None, sentences):
        warn(sentence, AccuracyWarning)


def _with_impacts(
    structure: Structure,
    result: ImpactMap,
    impactor: LinearBody,
    contact: ContactLaw,
    laws: list[ContactLaw] | None,
    duration: float,
) -> ImpactMap:
    """The map with one impact at each site, shared among the ranks."""
    comm = structure.comm
    sites_of_rank = np.array_split(np.arange(len(result)), comm.size)[comm.rank]
    part = None
    error = None
    messages: list[str] = []

    try:
        if len(sites_of_rank):
            models = [result.model(i) for i in sites_of_rank]
            laws_here = [contact if laws is None else laws[i] for i in sites_of_rank]
            durations = np.full(len(models), duration)
            with warnings_to(messages.append):
                batch = simulate_many(models, impactor, laws_here, durations)
            part = batch, peak_deflections(models, batch.force, durations)
    except Exception as caught:
        error = caught

    raise_on_all(comm, error)
    parts = [p for p in comm.allgather(part) if p is not None]
    for message in messages:
        warn(message, AccuracyWarning)
    deflections = np.concatenate([deflection for _, deflection in parts])

    def gathered(name: str) -> Array:
        return np.concatenate([getattr(batch, name) for batch, _ in parts])

    # nothing is harder than a rigid wall: where the force is larger, the patch is at fault
    stiffest = max(laws or [contact], key=lambda law: getattr(law, "stiffness", 0.0))
    wall = Impact(Obstacle(), impactor, stiffest, duration)
    on_wall = simulate_impact(wall, Settings(WALL_TOL)).peak_force
    peaks = gathered("peak_force")
    result = with_doubts(result, np.isnan(peaks), NO_RESULT)
    result = with_doubts(result, peaks > (1 + WALL_MARGIN) * on_wall, BEYOND_WALL)

    return replace(
        result,
        impactor=impactor,
        contact=contact,
        laws=None if laws is None or all(law == contact for law in laws) else tuple(laws),
        duration=duration,
        peak_force=peaks,
        contact_time=gathered("contact_time"),
        restitution=gathered("restitution"),
        impulse=gathered("impulse"),
        peak_deflection=deflections,
        forces=tuple(force for batch, _ in parts for force in batch.force),
    )


def with_stresses(structure: Structure, impact_map: ImpactMap, most: int | None) -> ImpactMap:
    """A map with the largest stresses at `most` reliable sites far apart; None: at all of them."""
    assert impact_map.forces is not None
    assert impact_map.duration is not None
    assert impact_map.free_sites is not None
    which = np.arange(len(impact_map)) if most is None else spread_sites(impact_map, most)
    forces = [impact_map.forces[i] for i in which]
    zones = np.zeros(len(impact_map))
    if with_parts(structure).members()[0].part.kind.outside:
        assert impact_map.peak_force is not None
        laws = impact_map.laws or (impact_map.contact,) * len(impact_map)
        radii = [*map(_yielded_radius, laws, impact_map.peak_force.tolist())]
        zones = PLASTIC_ZONE_RADII * np.array(radii)

    balls = np.column_stack([impact_map.points, zones])
    arguments = forces, impact_map.duration, which, balls
    stresses = largest_stresses(structure, impact_map.free_sites, *arguments)
    return replace(impact_map, **stresses._asdict())


def _yielded_radius(law: ContactLaw | None, force: float) -> float:
    """Radius [m] of a yielding contact, the larger of Hertz's and the plastic; 0 if elastic."""
    if not isinstance(law, ElasticPlastic) or not law.yield_force < force:
        return 0.0
    hertz = (force * law.radius**1.5 / law.stiffness) ** (1 / 3)
    plastic = math.sqrt(force / (math.pi * FULLY_PLASTIC_PRESSURE_RATIO * law.yield_strength))
    return float(max(hertz, plastic))
