"""`ImpactMap`: models and impacts at many sites of a surface, as tables, files and pictures."""

from __future__ import annotations

import math
import os
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from antiosc.base import files
from antiosc.base._types import Array, BoolArray, Figure, IntArray
from antiosc.base.checks import path as checked_path, store, whole
from antiosc.base.errors import InputError
from antiosc.base.texts import CompletedResult, engineering, point_text, range_text
from antiosc.engine.contact import ContactLaw
from antiosc.fields.pictures import plot_map
from antiosc.impact.from_rest import ForceSeries
from antiosc.impact.two_bodies import impact_band
from antiosc.models.anti_oscillators import AntiOscillators
from antiosc.models.body import EDGE_STRUCK, REMEDIES, LinearBody, ModelInfo
from antiosc.models.free_modes import SiteModels

if TYPE_CHECKING:
    from antiosc.strikes.free_sites import FreeSites


@dataclass(frozen=True, eq=False, repr=False)
class ImpactMap(CompletedResult):
    """Anti-oscillators and impacts over a surface, the same on every rank.

    Attributes
    ----------
    points, directions : (P, 3) sites [m] and unit vectors of the directions of impact.
    elements : (T, 3) triangles between the points (or (T, 2) segments); empty for sites at points.
    models : SiteModels
        Parameters k0, m0, m_st, omega, m of all sites; `model(i)` is one of them.
    local_compliance : (P,) half-space compliance of the patch [m/N], 0 for a point.
    radius : (P,) radii of the patches [m], or None for points.
    error : (P,) bound on |dZ|/|Z| up to `band` [Hz].
    skipped : number of sites left out: fixed by supports, or without a surface under the patch.
    names : (P,) the group or part of each site, as named in `where`; "" without a name.
    doubtful : (P,) bool, sites whose impact is unreliable. An edge cuts the patch or supports fix a
        part of it, so that its half-space compliance is not valid; the striker also touches the
        part elsewhere; or the force exceeds that on a rigid wall. `summary` and `plot` omit them.
    reasons : (P,) the first reason why a site is doubtful; "" for reliable sites.
    peak_force [N], contact_time [s], restitution, impulse [N s], peak_deflection [m] : (P,) of the
        impacts, or None; restitution as in `History`, NaN if the bodies still touch at the end or
        never touched; the deflection of the site includes the indentation of the patch.
    peak_stress, exposure : (P,) largest von Mises stress [Pa] anywhere in the part for the impact
        at each site, and largest share of the yield strength, 1 at yield; NaN at sites where it is
        not computed; None if it was not requested, or no material has a yield_strength.
    stress_points : (P, 3) point [m] of the largest exposure, or stress if no strength is known.
    cell_dimension : dimension of the cells: 3 for solids, 2 for sheets.
    impactor, contact, duration : arguments of the impacts, or None; `contact` is the law on a flat
        face, `duration` the duration of all impacts [s].
    laws : (P,) laws of the sites; None if `contact` is the law at all sites.
    free_sites : the sites with the free modes of the structure, from which stresses are computed.
    forces : (P,) pairs of times [s] and forces [N] of the impacts; None without impacts.
    """

    points: Array
    directions: Array
    elements: IntArray
    models: SiteModels
    local_compliance: Array
    radius: Array | None
    band: float
    error: Array
    skipped: int
    names: NDArray[np.str_]
    peak_force: Array | None = None
    contact_time: Array | None = None
    restitution: Array | None = None
    impulse: Array | None = None
    peak_deflection: Array | None = None
    peak_stress: Array | None = None
    exposure: Array | None = None
    stress_points: Array | None = None
    cell_dimension: int = 0
    doubtful: BoolArray = field(default_factory=lambda: np.zeros(0, dtype=bool))
    reasons: NDArray[np.str_] = field(default_factory=lambda: np.zeros(0, dtype=str))
    impactor: LinearBody | None = None
    contact: ContactLaw | None = None
    laws: Sequence[ContactLaw] | None = None
    duration: float | None = None
    forces: Sequence[ForceSeries] | None = None
    free_sites: FreeSites | None = None

    def __post_init__(self) -> None:
        if not self.doubtful.size:
            store(self, doubtful=np.zeros(len(self.points), dtype=bool))
        if not self.reasons.size:
            store(self, reasons=np.full(len(self.points), ""))

    def __len__(self) -> int:
        return len(self.points)

    def model(self, i: int) -> AntiOscillators:
        """The model of site i, without shapes."""
        i = whole("i", i, least=0, most=len(self) - 1)
        return replace(
            self.models.model(i),
            local_compliance=float(self.local_compliance[i]),
            radius=None if self.radius is None else float(self.radius[i]),
            info=ModelInfo(point=self.points[i].tolist(), direction=self.directions[i].tolist()),
        )

    @property
    def areas(self) -> Array:
        """(P,) surface area of each site: a third of its triangles [m²], half of its segments [m].

        1 each for sites at points, without elements.
        """
        if not len(self.elements):
            return np.ones(len(self))
        corners = self.points[self.elements]
        edges = corners[:, 1:] - corners[:, :1]
        gram = edges @ edges.transpose(0, 2, 1)
        corners_of = self.elements.shape[1]
        size = np.sqrt(np.linalg.det(gram)) / (corners_of - 1)  # of a simplex, /(d!), d = 1 or 2
        shares = np.repeat(size / corners_of, corners_of)
        return np.asarray(np.bincount(self.elements.ravel(), shares, len(self)), dtype=float)

    def quantities(self) -> dict[str, Array]:
        """Every scalar of the map by name, as written to files: (P,) each."""
        first = np.where(self.models.m[:, 0] > 0, self.models.omega[:, 0], 0.0)
        arrays = {
            "k0": self.models.k0,
            "m_st": self.models.m_st,
            "omega_1": first,
            "error": self.error,
            "peak_force": self.peak_force,
            "contact_time": self.contact_time,
            "restitution": self.restitution,
            "impulse": self.impulse,
            "peak_deflection": self.peak_deflection,
            "peak_stress": self.peak_stress,
            "exposure": self.exposure,
        }
        return {name: value for name, value in arrays.items() if value is not None}

    def write(self, path: str | os.PathLike[str]) -> Path:
        """Write points, elements and all quantities to a VTU file (or another format of meshio).

        InputError if the file cannot be written, or its suffix belongs to no format of meshio.
        """
        import meshio  # takes a while to load

        target = checked_path("path", path)
        kind = "triangle" if self.elements.shape[1] == 3 else "line"
        cells = [(kind, self.elements), ("vertex", self.alone[:, None])]
        surface = np.unique(self.names, return_inverse=True)[1].astype(float)
        data = {**self.quantities(), "direction": self.directions, "surface": surface}
        data["doubtful"] = self.doubtful.astype(float)

        with files.atomic_file(target, "the map") as part:
            try:
                blocks = [(kind, numbers) for kind, numbers in cells if len(numbers)]
                meshio.Mesh(self.points, blocks, point_data=data).write(part)
            except (meshio.ReadError, meshio.WriteError, KeyError, SystemExit) as error:
                raise InputError(
                    f"meshio cannot write a map to {target.name!r}: give it a name that ends with "
                    ".vtu."
                ) from error

        return target

    @property
    def alone(self) -> IntArray:
        """Numbers of the sites that belong to no element."""
        return np.setdiff1d(np.arange(len(self)), self.elements)

    def surfaces(self) -> dict[str, IntArray]:
        """Numbers of the sites of each group or part, by its name."""
        return {name: np.flatnonzero(self.names == name) for name in dict.fromkeys(self.names)}

    def summary(self) -> str:
        """One line for each group or part: its sites, their stiffness, its largest peak force."""
        surfaces = self.surfaces()
        width = max(5, *(len(name) for name in surfaces))
        title = f"{'where':<{width}}{'sites':>7}{'k0':>32}"
        if self.peak_force is not None:
            title += f"{'peak force':>12}  at"
        rows = [title]
        for name, of_surface in surfaces.items():
            k0 = self.models.k0[trusted(self, of_surface)]
            stiffness = range_text(k0.min(), k0.max(), "N/m")
            row = f"{name or 'sites':<{width}}{len(of_surface):>7}{stiffness:>32}"
            if self.peak_force is not None:
                i = hardest(self, of_surface)
                force = engineering(self.peak_force[i], "N", 4)
                row += f"{force:>12}  {point_text(self.points[i])}"
            row += " (doubtful)" * bool(self.doubtful[of_surface].all())
            rows.append(row)

        if self.peak_force is not None:
            rows.append("forces have no error bar here: an impact at one site by itself has one")

        if self.doubtful.all():
            rows.append(left_out_text(self))
        elif self.doubtful.any():
            stress = "" if self.peak_stress is None else " and the largest stress"
            rows.append(f"{doubts_text(self)}; left out of k0, the peak forces{stress}")

        if self.peak_stress is not None and np.isfinite(self.peak_stress).any():
            i = hardest(self, values=self.peak_stress)
            assert self.stress_points is not None
            rows.append(
                f"largest stress {engineering(self.peak_stress[i], 'Pa', 3)} at"
                f" {point_text(self.stress_points[i])} for a blow at"
                f" {point_text(self.points[i])}; its mesh error is not known:"
                " a refined mesh there (refine of the geometry) shows how it grows"
            )

        return "\n".join(rows)

    def plot(
        self, path: str | os.PathLike[str] | None = None, quantity: str = "peak_force"
    ) -> Figure | Path:
        """One of `quantities()` over the surface; see `antiosc.plotting.plot_map`.

        With `path` (PNG, PDF, SVG, …) the picture is written and the path is returned.
        """
        return plot_map(self, path, quantity)


def with_doubts(impact_map: ImpactMap, mask: BoolArray, reason: str) -> ImpactMap:
    """The map with further doubtful sites `mask` (P,); sites keep the first reason they got."""
    reasons = np.where(mask & ~impact_map.doubtful, reason, impact_map.reasons)
    return replace(impact_map, doubtful=impact_map.doubtful | mask, reasons=reasons)


def doubts_text(impact_map: ImpactMap) -> str:
    """Text on the number of doubtful sites, in total and for each reason."""
    reasons, counts = np.unique(impact_map.reasons[impact_map.doubtful], return_counts=True)
    number = int(impact_map.doubtful.sum())
    total = f"{number} doubtful site{'s' * (number != 1)}"
    texts = [f"{counts[i]} where {reasons[i]}" for i in np.argsort(-counts) if reasons[i]]
    return f"{total}: {', '.join(texts)}" if texts else total


def left_out_text(impact_map: ImpactMap) -> str:
    """Sentence on the doubtful sites that results leave out; "" if there are none."""
    if not impact_map.doubtful.any():
        return ""

    text = f"Left out of the ranges of {len(impact_map)} sites are {doubts_text(impact_map)}"
    if impact_map.doubtful.all():
        text = f"No site is free of doubts: the ranges are those of {doubts_text(impact_map)}"

    reasons, counts = np.unique(impact_map.reasons[impact_map.doubtful], return_counts=True)
    reason = str(reasons[np.argmax(counts)])
    is_one_face = len(set(impact_map.names)) == 1 and bool(impact_map.names[0])
    remedy = "" if is_one_face and reason == EDGE_STRUCK else REMEDIES.get(reason, "")
    return f"{text}; {remedy}." if remedy else f"{text}."


def trusted(impact_map: ImpactMap, sites: IntArray | None = None) -> IntArray:
    """Numbers of the reliable sites among `sites` (None: all); all `sites` if none is reliable."""
    sites = np.arange(len(impact_map)) if sites is None else sites
    sound = sites[~impact_map.doubtful[sites]]
    return sound if sound.size else sites


def hardest(
    impact_map: ImpactMap, sites: IntArray | None = None, values: Array | None = None
) -> int:
    """Number of the reliable site in `sites` with the largest of `values` (P,) or peak force."""
    values = impact_map.peak_force if values is None else values
    assert values is not None
    sites = trusted(impact_map, sites)
    return int(sites[np.argmax(np.nan_to_num(values[sites], nan=-1.0))])


def spread_sites(impact_map: ImpactMap, most: int) -> IntArray:
    """At most `most` reliable sites, far apart, with the site of the largest force among them."""
    sites = trusted(impact_map)
    if len(sites) <= most:
        return sites

    points = impact_map.points[sites]
    taken = [int(np.flatnonzero(sites == hardest(impact_map))[0])]
    gap = np.linalg.norm(points - points[taken[0]], axis=1)
    while len(taken) < most:
        taken.append(int(np.argmax(gap)))
        gap = np.minimum(gap, np.linalg.norm(points - points[taken[-1]], axis=1))

    return np.sort(sites[taken])


def excited_band(impactor: LinearBody | None, contact: ContactLaw | None) -> float | None:
    """The band [rad/s] that an impact excites; None without a moving impactor or a law."""
    if impactor is None or contact is None or not getattr(impactor, "velocity", 0.0) > 0:
        return None
    return 2 * math.pi * impact_band(impactor, contact)


def low_band_text(result: ImpactMap) -> str:
    """Sentence if the impact excites frequencies above the band of the map's models; else ""."""
    excited = excited_band(result.impactor, result.contact)
    if excited is None or 2 * math.pi * result.band >= excited:
        return ""

    return (
        f"the models of the map hold up to {engineering(result.band, 'Hz')}, the blow excites"
        f" up to {engineering(excited / (2 * math.pi), 'Hz')}: the anti-oscillators are too few"
        " for this contact where the part is thin, and forces are too large there; strike such a"
        f" site by itself, or take band = {excited / (2 * math.pi):.2g}."
    )
