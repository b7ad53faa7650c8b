"""The worst point of a part over a run: its largest stress, relative to the strength.

Points within three radii of a contact, or within r0 of sharp inner edges and rigid supports, are
not judged. The jumps of the stress between cells estimate its mesh error (Zienkiewicz and Zhu): at
a hole, with P2 triangles of a half, a quarter and an eighth of its radius, the jumps were 4.6, 1.3
and 0.4 %, and the true errors 3.2, 0.8 and 0.2 %. If the jumps reach half of the stress, there is
no error bar. Corners of quadratic cells are not judged: in four parts, stresses there were 2 to
30 % too large, while stresses in the middles of edges were 0 to 5 % off.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from math import inf, isfinite
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from antiosc.base._types import Array, BoolArray, IntArray
from antiosc.base.stresses import Strengths, TensileStrength
from antiosc.base.texts import CELL_ARGUMENTS, ReprMixin, capitalised, engineering, point_text
from antiosc.fem.structure.structure import Structure
from antiosc.impact.histories.verdict import PLASTIC_ZONE_RADII, ContactZone
from antiosc.io.isolation import Refinement
from antiosc.recovery import source
from antiosc.recovery.place import Place, layers_of, strength_of

#: Criterion -> what happens beyond the strength, and the name of the criterion.
CRITERION_TEXTS: dict[str, tuple[str, str]] = {
    "yield": ("bend for good", "von Mises"),
    "tension": ("break", "tension"),
    "tsai_hill": ("break", "Tsai–Hill"),
    "tsai_wu": ("break", "Tsai–Wu"),
    "delamination": ("delaminate", "interlaminar shear"),
}
#: Verb of a failure -> the verb if the failure is certain.
CERTAIN_TEXTS = {"bend for good": "bends for good", "break": "breaks", "delaminate": "delaminates"}
#: The answer of a stress whose bounds lie below the strength.
ELASTIC = "it stays elastic"
#: Criterion of a largest stress that no strength judges.
UNJUDGED_CRITERION = "stress"
#: Criteria whose value is a stress -> its name, and that of the strength.
STRESS_NAMES = {
    UNJUDGED_CRITERION: ("von Mises stress", ""),
    "yield": ("von Mises stress", "yield strength"),
    "tension": ("tension", "strength in bending tests"),
}
#: Jump of the stress over the stress from which it has no error bar.
UNRESOLVED_JUMP = 0.5
#: Largest size of cells over the radius of a contact that they resolve.
RESOLVED_SIZE_RATIO = 2.0
#: No points.
NO_POINTS = np.zeros((0, 3))


@dataclass(frozen=True, eq=False, repr=False)
class Margin(ReprMixin):
    """The worst point of a part over a run: the largest stress over the strength.

    The stresses are those of a linear-elastic part: beyond yield it deforms permanently, and its
    stresses stay lower.

    Attributes
    ----------
    criterion : "yield" (von Mises), "tension" (of materials that crack), "tsai_hill", "tsai_wu" or
        "delamination"; "stress" (von Mises) if no strength is known (`PeakField.worst_point`).
    value : the von Mises stress for "yield", the largest principal stress for "tension", Pa;
        otherwise the exposure.
    strength : the yield strength for "yield", the least strength in tension for "tension", Pa;
        otherwise 1.
    point, time : (3,) place of the worst point, m, and time at which it occurs, s.
    errors : least and largest value at all judged points within the errors of the mesh; the
        largest is inf if the stress has no error bar. None: the value is exact.
    force_error : relative error of the contact forces, to which the stresses are proportional.
    strength_range : least and largest strength of batches of the material [Pa], if known.
    scope : where the value is judged: "outside 3 radii of the contact (4.2 mm)"; "": anywhere.
    note : sentences on places that are not judged, and on the reason for a missing error bar.
    cells : place [m] and size [m] of cells that would give an error bar; None if there is one.
    layer : layer of a laminate, counted from the bottom: "layer 2 (top)".
    contact : whether the contact itself yields, which the values do not include.
    impact : number (from 1) of the impact of a fall in which it occurs; 0 if the run is no fall.
    """

    criterion: str
    value: float
    strength: float
    point: Array
    time: float
    errors: tuple[float, float] | None = None
    force_error: float = 0.0
    strength_range: tuple[float, float] | None = None
    scope: str = ""
    note: str = ""
    cells: Refinement | None = None
    layer: str = ""
    contact: bool = False
    impact: int = 0

    @property
    def is_stress(self) -> bool:
        """Whether the value is a stress [Pa]; otherwise it is an exposure."""
        return self.criterion in STRESS_NAMES

    @property
    def has_bar(self) -> bool:
        """Whether the mesh resolves the stress, so that its error bar is finite."""
        return self.errors is None or isfinite(self.errors[1])

    @property
    def remedy(self) -> str:
        """Size and place of cells that would give an error bar, in words; "" if there is one."""
        return "" if self.cells is None else _remedy_text(self.cells)

    @property
    def exposure(self) -> float:
        """Value over strength: 1 at yield or failure, proportional to the load."""
        return self.value / self.strength

    @property
    def margin(self) -> float:
        """Margin of safety, strength over stress minus 1; negative: yield or failure is reached."""
        return 1 / self.exposure - 1 if self.exposure else inf

    @property
    def least_margin(self) -> float:
        """The margin for the lowest strength of the material's range (batches, directions)."""
        return (1 + self.margin) * self._strengths[0] / self.strength - 1

    @property
    def reached(self) -> bool:
        """Whether yield or failure is reached at the worst point: exposure >= 1."""
        return self.exposure >= 1 and self.criterion != UNJUDGED_CRITERION

    @property
    def stresses(self) -> tuple[float, float]:
        """Least and largest value within the errors of the mesh and of the force."""
        least, largest = self.errors or (self.value, self.value)
        force_share = max(1 - self.force_error, 0.0)
        return max(least, 0.0) * force_share, largest * (1 + self.force_error)

    @property
    def bounds(self) -> tuple[float, float]:
        """Least and largest exposure within the errors of the stress and of the strength."""
        weakest, strongest = self._strengths
        least, largest = self.stresses
        return least / strongest, largest / weakest

    @property
    def _strengths(self) -> tuple[float, float]:
        """(least, largest) strength of the range; both are `strength` if no range is known."""
        return self.strength_range or (self.strength, self.strength)

    @property
    def answer(self) -> str:
        """What happens to the part; "cannot say" below the strength without an error bar."""
        event = CRITERION_TEXTS[self.criterion][0]
        least, largest = self.bounds
        if least >= 1:
            return f"it {CERTAIN_TEXTS[event]}"
        if not self.has_bar and not self.reached:
            return "cannot say"
        return f"it may {event}" if largest >= 1 else ELASTIC

    @property
    def sentence(self) -> str:
        """The verdict with its scope, the decisive stress, and reasons that may change it."""
        place = f"{self.layer} at".lstrip() if self.layer else "at"
        place = f"{place} {point_text(self.point)}, {engineering(self.time, 's')}"
        if self.impact:
            place += f", by impact {self.impact}"

        if self.criterion == UNJUDGED_CRITERION:
            largest = f"the largest von Mises stress {self.scope}".rstrip()
            told = f"{largest} is {engineering(self.value, 'Pa')} {place}; the material has no"
            sentences = [f"{told} yield strength to compare it with"]
        else:
            sentences = [self._verdict, f"the largest {self._largest(place)}"]

        if self.note:
            sentences.append(self.note)
        if self.criterion == "tension":
            sentences.append("cracks are not computed; scratches and edges decide")
        return ". ".join([sentences[0], *map(capitalised, sentences[1:])])

    @property
    def _verdict(self) -> str:
        """The answer and its scope, with the range of the stress if the strength lies in it."""
        told = self.answer
        least, largest = self.bounds
        if least < 1 <= largest:
            told += f" ({self._interval})"
        if self.contact:
            return f"{told} {self.scope or 'apart from the contact'}, where a dent remains"
        return f"{told} {self.scope}".rstrip()

    @property
    def _interval(self) -> str:
        """The stress with its bounds, and the strength with its range, in words."""
        if not self.has_bar:
            return "the stress has no bar"
        low, high = self.stresses
        if not self.is_stress:
            return f"exposure {low:.3g} to {high:.3g} with its errors, failure from 1"
        stress = _stress_range_text(low, high)
        return f"stress {stress} with its errors, strength {self._strength_text}"

    def _largest(self, place: str) -> str:
        """The largest stress or exposure at `place`, and the margin of safety, in words."""
        margins = f"margin of safety {self.margin:.3g}"
        if not self.is_stress:
            name = CRITERION_TEXTS[self.criterion][1]
            return f"exposure by {name} is {self.exposure:.3g}, {place}; {margins}"

        weakest, _ = self._strengths
        if weakest < self.strength:
            margins += f", {self.least_margin:.3g} against {engineering(weakest, 'Pa')}"
        name, of_strength = STRESS_NAMES[self.criterion]

        return (
            f"{name}, {engineering(self.value, 'Pa')} {place}, is {self.exposure:.3g} of the"
            f" {of_strength} {self._strength_text}; {margins}"
        )

    @property
    def _strength_text(self) -> str:
        """The strength with its range, in words."""
        told = engineering(self.strength, "Pa")
        if self.strength_range is None:
            return f"{told} (taken as exact: no range was given)"
        weakest, strongest = self.strength_range
        return (
            told if weakest == strongest else f"{told} ({_stress_range_text(weakest, strongest)})"
        )

    def __str__(self) -> str:
        return self.sentence

    def _facts(self) -> list[tuple[str, str]]:
        return [(self.criterion, self.sentence)]


def _stress_range_text(*ends: float) -> str:
    """A range of stresses [Pa], or a single one if both ends are equal, as text."""
    return " to ".join(dict.fromkeys(engineering(end, "Pa") for end in ends))


class ExcludedZones(NamedTuple):
    """Places that a margin does not judge: at contacts, and near edges and supports."""

    contacts: Sequence[ContactZone] = ()
    edges: Array = NO_POINTS  # (n, 3) [m] on sharp inner edges
    supports: Array = NO_POINTS  # (n, 3) [m] on rigidly supported faces
    distance: float = 0.0  # from these [m]

    def at_contacts(self, points: Array) -> BoolArray:
        """Mask (P,) of the points within three radii of a contact on a solid."""
        balls = [zone.ball for zone in self.contacts if not zone.thickness]
        return is_within(points, np.reshape(balls, (-1, 4)))

    def at_edges(self, points: Array) -> BoolArray:
        """Mask (P,) of the points near sharp inner edges or rigid supports."""
        sharp = np.concatenate([self.edges, self.supports])
        if not len(sharp) or not self.distance:
            return np.zeros(len(points), dtype=bool)
        return np.asarray(cKDTree(sharp).query(points)[0] <= self.distance)

    def judged_mask(self, points: Array, known: BoolArray) -> tuple[BoolArray, str]:
        """(mask (P,) of the `known` points that are judged, text on the zones). A zone that would
        exclude all points is ignored."""
        radii = sorted(zone.ball[3] for zone in self.contacts)
        ends = dict.fromkeys(engineering(radius, "m", 2) for radius in (*radii[:1], *radii[-1:]))
        of_contacts = f"{PLASTIC_ZONE_RADII:g} radii of the contact ({' to '.join(ends)})"
        of_edges = f"{engineering(self.distance, 'm', 2)} of {self.edge_names}"
        counts = known
        places = []

        on_solids = any(not zone.thickness for zone in self.contacts)
        at_edges = self.at_edges(points)
        for found, within, place in (
            (on_solids, self.at_contacts(points), of_contacts),
            (at_edges.any(), at_edges, of_edges),
        ):
            outside = counts & ~within
            if found and outside.any():
                counts = outside
                places.append(place)

        return counts, f"outside {', and '.join(places)}" if places else ""

    @property
    def edge_names(self) -> str:
        """Text that names the part's sharp inner edges and rigidly held faces, if it has any."""
        named = {"sharp inner edges": len(self.edges), "rigidly held faces": len(self.supports)}
        return " and ".join(name for name, count in named.items() if count)


def is_within(points: Array, balls: Array) -> NDArray[np.bool_]:
    """Mask (P,) of the points in at least one of the balls (n, 4): centre and radius [m]."""
    in_zones = np.zeros(len(points), dtype=bool)
    for radius in np.unique(balls[:, 3]):
        centres = cKDTree(balls[balls[:, 3] == radius, :3])
        in_zones |= centres.query(points)[0] <= radius
    return in_zones


class NodalExposures(NamedTuple):
    """Largest exposures (P,) of a part's nodes over a run, for `judged_margin`."""

    points: Array  # (P, 3) [m]
    exposure: Array
    strength: Array  # Pa or 1
    time: Array  # s
    error: Array  # relative, of the stress by the mesh
    cell_sizes: Array  # m


def judged_margin(criterion: str, nodes: NodalExposures, zones: ExcludedZones) -> Margin | None:
    """The margin of the worst node outside the zones; None if no exposure is above zero. It has no
    error bar if the stress differs by half between cells or the cells do not resolve a contact."""
    counts, scope = zones.judged_mask(nodes.points, nodes.exposure > 0)
    if not counts.any():
        return None
    exposure = np.where(counts, nodes.exposure, 0.0)
    worst = int(exposure.argmax())
    strength = float(nodes.strength[worst])

    # bounds of all places
    stress, unresolved = _hidden_stress(nodes, zones.contacts)
    hidden = np.divide(stress, nodes.strength, out=np.zeros_like(stress), where=counts)
    upper = exposure * (1 + nodes.error)
    lower = exposure * (1 - np.minimum(nodes.error, 1.0)) - hidden
    least, largest = float(lower.max(initial=0.0)), float((upper + hidden).max())

    # why there is no bar, and the cells that would give one
    cells: Refinement | None = None
    k = int(upper.argmax())
    if unresolved is not None:
        least = 0.0
        why = "the cells are larger than the contact"
        cells = (unresolved.point.tolist(), unresolved.radius)
    elif nodes.error[k] > UNRESOLVED_JUMP:
        why = "it differs by half or more between cells"
        cells = (nodes.points[k].tolist(), float(nodes.cell_sizes[k]) / 2)

    notes = _edge_sentences(criterion, nodes, zones, ~counts)
    if cells is not None:
        largest = inf
        notes.append(f"the stress has no bar: {why}; {_remedy_text(cells)}")

    return Margin(
        *(criterion, float(exposure[worst]) * strength, strength, nodes.points[worst]),
        time=float(nodes.time[worst]),
        errors=(strength * least, strength * largest),
        scope=scope,
        note=". ".join([*notes[:1], *map(capitalised, notes[1:])]),
        cells=cells,
    )


def _edge_sentences(
    criterion: str, nodes: NodalExposures, zones: ExcludedZones, left_out: BoolArray
) -> list[str]:
    """A sentence on the largest stress of the nodes `left_out` at sharp edges; [] if none is."""
    sharp = left_out & zones.at_edges(nodes.points) & ~zones.at_contacts(nodes.points)
    exposure = np.where(sharp, nodes.exposure, 0.0)
    k = int(exposure.argmax())
    if not exposure[k]:
        return []
    value = float(exposure[k] * nodes.strength[k])
    shown = engineering(value, "Pa") if criterion in STRESS_NAMES else f"{value:.3g}"

    return [
        f"at {zones.edge_names} an elastic stress has no limit: here up to {shown} at"
        f" {point_text(nodes.points[k])}, more with smaller cells"
    ]


def _hidden_stress(
    nodes: NodalExposures, contacts: Sequence[ContactZone]
) -> tuple[Array, ContactZone | None]:
    """(contact stress (P,) [Pa] that a too large patch or cell may smear out, a contact that the
    mesh does not resolve or None)."""
    hidden = np.zeros(len(nodes.points))
    unresolved = None
    for zone in contacts:
        distance = np.linalg.norm(nodes.points - zone.point, axis=1)
        size = float(nodes.cell_sizes[distance.argmin()])
        if zone.patch == inf and size > RESOLVED_SIZE_RATIO * zone.radius:
            unresolved = unresolved or zone
            continue

        patch = size / 2 if zone.patch == inf else max(zone.patch, size / 2)
        edge = 0.0 if zone.thickness else PLASTIC_ZONE_RADII * zone.radius
        hidden += zone.spread(patch, np.maximum(distance - nodes.cell_sizes, edge))

    return hidden, unresolved


def _remedy_text(cells: Refinement) -> str:
    """The recommendation of smaller cells, in words."""
    point, size, *_ = cells
    told = f"cells of {engineering(size, 'm', 2)} ({CELL_ARGUMENTS})"
    return f"{told} at {point_text(point)} would give one"


#: Where a criterion is largest in a ply: in-plane stresses are linear, shear is a parabola.
PLY_SURFACES = {
    "tsai_hill": ("bottom", "top"),
    "tsai_wu": ("bottom", "top"),
    "delamination": ("bottom", "middle", "top"),
}
#: Criterion -> strength that a material must have for it.
NEEDED_STRENGTHS = {
    "tension": "a strength in tension, as tensile = (45e6, 69e6) Pa",
    "tsai_hill": "layers that have Strengths",
    "tsai_wu": "layers that have Strengths",
    "delamination": "layers that have an interlaminar strength",
}
#: Quantity of a criterion that `criteria_of` names -> the criterion.
CRITERIA_BY_QUANTITY = {
    "von_mises": "yield",
    "tension": "tension",
    "tsai_wu": "tsai_wu",
    "delamination": "delamination",
}


def ply_places(structure: Structure, quantity: str, part: str | None) -> list[Place | None]:
    """Places in the plies at which a ply criterion is evaluated; [None] for other quantities."""
    if quantity not in PLY_SURFACES:
        return [None]
    materials = source(structure).materials_of(structure, part)
    return [
        Place(surface, layer, local=True)
        for layer in range(max(map(len, map(layers_of, materials)), default=0))
        for surface in PLY_SURFACES[quantity]
    ]


def criteria_of(structure: Structure) -> list[str]:
    """Quantities of `peak_field` that judge the known strengths; [] if a material relaxes."""
    module = source(structure)
    if module.relaxes(structure):
        return []
    materials = module.materials_of(structure, None)
    strengths = [getattr(material, "yield_strength", None) for material in materials]
    strengths += [strength_of(material, Place()) for material in materials]
    strengths += [layer.strength for material in materials for layer in layers_of(material)]

    return [
        quantity
        for quantity, criterion in CRITERIA_BY_QUANTITY.items()
        if any(has_strength(strength, criterion) for strength in strengths)
    ]


def strength_range(structure: Structure, margin: Margin) -> tuple[float, float] | None:
    """(least, largest) strength [Pa] of batches of the material of a margin; None if unknown."""
    materials = source(structure).materials_of(structure, None)
    strength = margin.strength
    if margin.criterion == "tension":
        tensile = [strength_of(material, Place()) for material in materials]
        known = (t for t in tensile if isinstance(t, TensileStrength) and t.low == strength)
        return next(((t.low, t.high) for t in known), None)

    ranges = [
        material.yield_range
        for material in materials
        if getattr(material, "yield_strength", None) == strength
        and getattr(material, "yield_range", None) is not None
    ]

    return (min(low for low, _ in ranges), max(high for _, high in ranges)) if ranges else None


def has_strength(strength: object, criterion: str) -> bool:
    """Whether a material's `strength` is of the kind that the criterion needs."""
    if criterion == "delamination":
        return getattr(strength, "interlaminar", None) is not None
    kinds = {"yield": float, "tension": TensileStrength}
    return isinstance(strength, kinds.get(criterion, Strengths))


def sizes_at_nodes(points: Array, cells: Sequence[tuple[str, IntArray]]) -> Array:
    """Size (P,) [m] of the largest cell at each point; size: largest extent along an axis."""
    sizes = np.zeros(len(points))
    for _, numbers in cells:
        extent = np.ptp(points[numbers], axis=1).max(axis=1)
        np.maximum.at(sizes, numbers.ravel(), np.repeat(extent, numbers.shape[1]))
    return sizes
