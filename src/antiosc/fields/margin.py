"""The largest stresses of a part over a run, relative to the strength, with warnings.

The jumps of stress between cells show how well the mesh resolves it. At a hole (P2 triangles of a
half, a quarter and an eighth of its radius) the jumps were 4.6, 1.3 and 0.4 % of the stress, and
its error 3.2, 0.8 and 0.2 %. In a re-entrant corner of 270° the jumps were 78, 77 and 65 % on three
meshes, each with half the cell size of the previous one, and the stress grew by 34 and 44 %.
"""

from __future__ import annotations

import functools
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from math import floor, inf
from typing import TYPE_CHECKING, NamedTuple, cast

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.spatial import cKDTree

from antiosc.base import checks
from antiosc.base._types import Array, IntArray
from antiosc.base.stresses import (
    Strengths,
    Tensile,
    equivalent_parts,
    exposure,
    extreme_principal,
    length,
    tension,
)
from antiosc.base.texts import (
    PATCH_RADIUS,
    SMALLER_CELLS,
    ReprMixin,
    capitalised,
    engineering,
    percent,
    point_text,
)
from antiosc.fem.structure.structure import Structure
from antiosc.fields.fields import stress_amplitudes
from antiosc.impact.histories import History
from antiosc.impact.histories.factors import AnyHistory
from antiosc.impact.histories.verdict import (
    CONTACT_RADII,
    EDGE_ERROR,
    HALF_SPACE,
    SheetPatch,
    YieldingZone,
    patches_of,
    yielding_zones,
    yields,
)
from antiosc.recovery import source
from antiosc.recovery.place import NodeTensors, Place, layers_of, strength_of

if TYPE_CHECKING:
    from antiosc.fem.structure.meshed import MeshedStructure

#: Criterion -> event at an exposure of 1, and the name of the criterion.
CRITERIA: dict[str, tuple[str, str]] = {
    "yield": ("yield", "von Mises"),
    "tension": ("the strength in tension", "tension"),
    "tsai_hill": ("failure of a ply", "Tsai–Hill"),
    "tsai_wu": ("failure of a ply", "Tsai–Wu"),
    "delamination": ("delamination", "interlaminar shear"),
}


#: Criterion of a largest stress that no strength judges.
UNJUDGED = "stress"
#: Criteria whose value is a stress -> its name, and that of the strength.
STRESSES = {
    UNJUDGED: ("von Mises stress", ""),
    "yield": ("von Mises stress", "yield strength"),
    "tension": ("tension", "strength in bending tests"),
}


#: Beside a stress that no strength judges.
NO_STRENGTH = "the material has no yield strength to compare it with"
#: Beside a strength without a range.
EXACT = " (taken as exact: no range was given)"


class Largest(NamedTuple):
    """The largest value of a field, its point [m] and time [s]."""

    value: float
    point: Array
    time: float


class Away(NamedTuple):
    """Least and largest distance [m] from sharp edges and supports, and which of both there are."""

    distances: tuple[float, float]
    edges: bool
    supports: bool

    @property
    def names(self) -> str:
        """What is left out, as text."""
        names = ["sharp inner edges"] * self.edges + ["rigidly held faces"] * self.supports
        return " and ".join(names)

    @property
    def text(self) -> str:
        """Distance and names: "1.9 mm of sharp inner edges"."""
        ends = dict.fromkeys(engineering(distance, "m", 2) for distance in self.distances)
        return f"{' to '.join(ends)} of {self.names}"

    @property
    def decides(self) -> str:
        """What decides the stress there."""
        names = ["the radius of the edge"] * self.edges + ["what holds the part"] * self.supports
        return capitalised(" or ".join(names))


#: Cause of the error of a stress that smaller cells there narrow.
OF_CELLS = f"the mesh at this place ({SMALLER_CELLS})"


@dataclass(frozen=True, eq=False, repr=False)
class Margin(ReprMixin):
    """The worst point of a part over a run: the largest stress over the strength.

    The stresses are those of a linear-elastic part: beyond yield it deforms permanently, and its
    stresses stay lower.

    Attributes
    ----------
    criterion : "yield" (von Mises), "tension" (of what cracks), "tsai_hill", "tsai_wu" or
        "delamination"; "stress" (von Mises) where no strength is known (`PeakField.worst_point`).
    value : the von Mises stress for "yield", the largest principal stress for "tension", Pa;
        otherwise the exposure.
    strength : the yield strength for "yield", the least strength in tension for "tension", Pa;
        otherwise 1.
    strength_range : least and largest strength of batches of the material [Pa], if known.
    point : (3,) place of the worst point, m.
    time : time at which it occurs, s.
    layer, surface : for a laminate: number of the layer, from the bottom, and its surface.
    contact : whether the contact itself yields, which the values do not include.
    beyond : (n, 4) balls that are left out, as rows x, y, z, radius [m]: those that were asked for,
        then three radii of each contact that yields, in solids.
    asked : number of balls that were asked for.
    sharp : the worst point at sharp inner edges and rigid supports, if these are left out and have
        points outside the balls; `away` : least and largest distance from them, m, and their names.
    largest : the largest value where `value` with its `spread` is that of another place, which has
        less; None where it is `value`.
    spread : error of the value (in its unit) since a patch of another radius than the contact
        spreads its force; it is added to the value in the exposure and in the margin.
    edge_stress : largest stress on the surfaces of the balls by Hertz's pressure on a half-space,
        Pa; it counts where the nodes of the mesh are farther away and have lower stresses. 0 for a
        part that is thinner than six radii of the contact, where it does not hold.
    thin_stress : of such a part the same stress, within its thickness, Pa; it counts in the largest
        stress of the bar alone.
    thin : thickness of such a part under the contact over its radius, if the faces of the mesh are
        larger than that radius; else inf.
    hollow_stress : most by which the stress may be larger beside a hollow under the patch of a
        contact, Pa, since the patch is larger than the contact; it counts in the bar alone.
    hollow_patch : radius of the smallest patch there that its contact allows, m; 0 if the present
        one is not larger.
    mesh_error : error of the value by the mesh, in its unit; 0 where it is not estimated, of beams.
    others : least and largest stress that some other place has within its own error by the mesh,
        with the spread in the largest: the stress of the part is no less and no more either. In
        sheets the largest holds what cells lose that are larger than the patch of a contact.
    force_error : relative error of the forces of the contacts, which the stresses follow; 0 if it
        is not known. Like `mesh_error` it counts in the verdict alone.
    nearer : the worst point in the balls that are left out; None without balls.
    impact : number of the impact of a fall, from 1, in which it occurs; 0: of another run.
    spans : margins of the impacts of a fall, with the force errors of each; the verdict is that of
        all of them.
    row : number of the worst among the values that were judged; `columns` (c, B): its stress for
        each coordinate of the body, whose length over time is the value; None: not known.
    """

    criterion: str
    value: float
    strength: float
    point: Array
    time: float
    layer: int | None = None
    surface: str | None = None
    contact: bool = False
    beyond: Array = field(default_factory=lambda: np.zeros((0, 4)))
    nearer: Margin | None = None
    largest: Largest | None = None
    spread: float = 0.0
    edge_stress: float = 0.0
    thin_stress: float = 0.0
    hollow_stress: float = 0.0
    hollow_patch: float = 0.0
    mesh_error: float = 0.0
    others: tuple[float, float] = (0.0, 0.0)
    force_error: float = 0.0
    thin: float = inf
    impact: int = 0
    spans: tuple[Margin, ...] = ()
    strength_range: tuple[float, float] | None = None
    asked: int = 0
    sharp: Margin | None = None
    away: Away | None = None
    row: int = 0
    columns: Array | None = None

    @property
    def is_stress(self) -> bool:
        """Whether the value is a stress [Pa], and no exposure."""
        return self.criterion in STRESSES

    @property
    def is_mises(self) -> bool:
        """Whether the value is the von Mises stress: of yield, or without a strength."""
        return self.criterion in ("yield", UNJUDGED)

    @property
    def at_edge(self) -> bool:
        """Whether the stress at the edge of the balls counts: no node has a larger one."""
        return self.edge_stress > self.value + self.spread

    @property
    def stress(self) -> float:
        """The value with `spread`, or the stress at the edge of the balls if that is larger."""
        return max(self.value + self.spread, self.edge_stress)

    @property
    def exposure(self) -> float:
        """`stress` over strength: 1 at yield or failure, proportional to the load."""
        return self.stress / self.strength

    @property
    def of_model(self) -> float:
        """The value with `spread` over strength, without the stress at the edge of the balls."""
        return (self.value + self.spread) / self.strength

    @property
    def margin(self) -> float:
        """Margin of safety, strength over stress minus 1; negative: yield or failure is reached."""
        if not self.exposure:
            return float(np.inf)
        return 1 / self.exposure - 1

    @property
    def least_margin(self) -> float:
        """`margin` with the lowest strength of the range, of batches and directions."""
        lowest, _ = self._strengths
        return (1 + self.margin) * lowest / self.strength - 1

    @property
    def reached(self) -> bool:
        """Whether yield or failure is reached at the worst point: exposure >= 1."""
        return self.exposure >= 1 and self.criterion != UNJUDGED

    @property
    def scope(self) -> str:
        """Where the margin holds: "outside 3 radii of the contact (4.2 mm)"; "": anywhere."""
        of_contacts = self.beyond[self.asked :, 3]
        places = ["the balls of leave_out"] * (self.asked > 0)
        if self.away is not None:
            places.append(self.away.text)
        if len(of_contacts):
            ends = dict.fromkeys(engineering(end(of_contacts), "m", 2) for end in (min, max))
            places.append(f"{CONTACT_RADII:g} radii of the contact ({' to '.join(ends)})")
        return f"outside {', and '.join(places)}" if places else ""

    @property
    def stresses(self) -> tuple[float, float]:
        """Least and largest stress within the errors of mesh, edge of the balls, and force; of a
        fall those of the impact with the largest stress.
        """
        if self.spans:
            return max(self.spans, key=lambda span: span.exposure).stresses
        error, at_edge = self.mesh_error, EDGE_ERROR * self.edge_stress
        of_mesh = self.value - error, self.value + self.spread + error + self.hollow_stress
        most_of_hertz = (1 + EDGE_ERROR) * max(self.edge_stress, self.thin_stress)
        of_hertz = self.edge_stress - at_edge, most_of_hertz
        least, largest = map(max, of_mesh, of_hertz, self.others)
        return least * (1 - self.force_error), largest * (1 + self.force_error)

    @property
    def widest(self) -> str:
        """The largest cause of the difference of the largest of `stresses` to the stress."""
        if self.spans:
            return max(self.spans, key=lambda span: span.exposure).widest
        of_hertz = (1 + EDGE_ERROR) * max(self.edge_stress, self.thin_stress)
        of_mesh = self.value + self.spread + self.mesh_error
        in_all = max(self.others[1] - self.stress, 0.0)
        causes = {
            OF_CELLS: of_mesh - self.stress,
            f"the mesh at a place that may have more ({SMALLER_CELLS})": in_all,
            f"the hollow under the patch ({PATCH_RADIUS})": self.hollow_stress,
            "the contact's own stress, which the part's thickness there changes": of_hertz
            - self.stress,
            "the force": self.force_error * self.stress,
        }
        return max(causes, key=lambda cause: causes[cause])

    @property
    def is_of_cells(self) -> bool:
        """Whether the largest cause is the mesh at the place, which smaller cells there mend."""
        return self.widest == OF_CELLS

    @property
    def bounds(self) -> tuple[float, float]:
        """Least and largest exposure within the errors of the stress and the range of the
        strength.
        """
        weakest, strongest = self._strengths
        least, largest = self.stresses
        return least / strongest, largest / weakest

    @property
    def _strengths(self) -> tuple[float, float]:
        """Least and largest strength: both are `strength` where no range is known."""
        return self.strength_range or (self.strength, self.strength)

    @property
    def sentence(self) -> str:
        """The verdict with its scope, the stress that decides, and what may change the verdict."""
        if self.criterion == UNJUDGED:
            sentences = [self._without_strength]
        elif not self.scope and not self.contact and self.criterion != "tension":
            return f"{self._verdict}: {self._largest}"
        else:
            sentences = [self._verdict, self._largest]
        if self.nearer is not None and self.nearer.exposure > self.exposure:
            stress = engineering(self.nearer.value, "Pa")
            sentences.append(f"nearer it is up to {stress} at {point_text(self.nearer.point)}")
        if self.sharp is not None and self.away is not None:
            stress = engineering(self.sharp.value, "Pa")
            if self.sharp.reached:
                stress += f", {self.sharp.exposure:.3g} of the {STRESSES[self.criterion][1]},"
            fails = "cracks" if self.criterion == "tension" else "yields"
            sentences.append(
                f"at {self.away.names} an elastic stress has no limit: here up to {stress} at"
                f" {point_text(self.sharp.point)}, more with smaller cells. {self.away.decides}"
                f" decides whether it {fails} there"
            )
        if self.hollow_stress:
            more = engineering(self.hollow_stress, "Pa", 2)
            remedy = ""
            if self.hollow_patch:
                least = engineering(self.hollow_patch, "m", 2)
                remedy = f"; a smaller patch, down to a radius of {least}, narrows it, on cells not"
                remedy += f" larger than it ({PATCH_RADIUS})"
            sentences.append(
                f"a hollow lies under the patch, which is larger than the contact: beside it the"
                f" stress may be larger by up to {more}, which is in the bar{remedy}"
            )
        if self.needed_cells is not None:
            radius = engineering(self.needed_cells, "m", 2)
            sentences += [
                f"this {self._told} may change with the mesh: its cells at the contact are larger"
                f" than its radius, and the part is {self._radii_thick} contact radii thick there,"
                f" too thin (less than {HALF_SPACE:g}) for Hertz's stress in their place",
                f"make the cells there smaller than {radius} ({SMALLER_CELLS})",
            ]
        if self.criterion == "tension":
            sentences.append("cracks are not computed; scratches and edges decide")
        first, *others = sentences
        return ". ".join([first, *map(capitalised, others)])

    @property
    def needed_cells(self) -> float | None:
        """Size [m] that the cells at a contact on a thin part need, its radius; None where they are
        smaller already, or need not be.
        """
        return float(min(self.beyond[self.asked :, 3])) / CONTACT_RADII if self.thin < inf else None

    @property
    def _radii_thick(self) -> str:
        """Text: `thin`, rounded down, as it is less than `HALF_SPACE`."""
        return f"{floor(10 * self.thin) / 10:g}"

    @property
    def _told(self) -> str:
        """What a sentence tells: a verdict, or the stress alone."""
        return "stress" if self.criterion == UNJUDGED else "verdict"

    @property
    def _without_strength(self) -> str:
        """Text: the largest stress, where it is sought, and that no strength judges it."""
        largest = f"the largest von Mises stress {self.scope}".rstrip()
        return f"{largest} is {self._stress}; {NO_STRENGTH}"

    @property
    def _place(self) -> str:
        """Place and time of the worst point: "at (1, 2, 3) mm, 809 µs"."""
        place = _at(self.point, self.time)
        if len(self.spans) > 1:
            place += f", by impact {self.impact}"
        if self.layer is None:
            return place
        return f"in layer {self.layer} ({self.surface}) {place}"

    @property
    def _range(self) -> str:
        """Text: the stress with its errors beside the strength with its range."""
        low, high = (max(end, 0.0) for end in self.stresses)
        if not self.is_stress:
            return f"exposure {low:.3g} to {high:.3g} with its errors, failure from 1"
        strength = _range_of(*self._strengths)
        return f"stress {_range_of(low, high)} with its errors, strength {strength}"

    @property
    def _largest(self) -> str:
        """Text: the largest stress or exposure, and the margin of safety."""
        there = " there" if self.scope else ""
        if not self.is_stress:
            name = CRITERIA[self.criterion][1]
            exposure = f"{self.exposure:.3g}, {self._place}; margin of safety {self.margin:.3g}"
            return f"the largest exposure{there} by {name} is {exposure}"
        strength = engineering(self.strength, "Pa")
        if self.strength_range is None:
            strength += EXACT
        elif self.strength_range[0] < self.strength_range[1]:
            strength += f" ({_range_of(*self.strength_range)})"
        name, of_strength = STRESSES[self.criterion]
        return (
            f"the largest {name}{there}, {self._stress}, is {self.exposure:.3g} of the"
            f" {of_strength} {strength}; {self._margins}"
        )

    @property
    def _margins(self) -> str:
        """Text: the margins of safety against the strength and the lowest of its range."""
        lowest, _ = self._strengths
        margins = {self.strength: self.margin, lowest: self.least_margin}
        told = (f"{m:.3g} against {engineering(one, 'Pa')}" for one, m in margins.items())
        return f"margin of safety {', '.join(told)}"

    @property
    def _stress(self) -> str:
        """Text: the judged stress, its place, and what makes it larger than that of the model."""
        stress, of_model = (engineering(stress, "Pa") for stress in (self.stress, self.value))
        if self.at_edge:
            distance = f"{CONTACT_RADII:g} radii of the contact"
            place = self._place
            if self.largest is not None:
                of_model = engineering(self.largest.value, "Pa")
                place = _at(self.largest.point, self.largest.time)
            by_mesh = f"farther away, by the mesh, up to {of_model} {place}"
            return f"{stress} at {distance} by Hertz's pressure on a half-space ({by_mesh})"
        if stress == of_model:
            return f"{stress} {self._place}"
        spread = engineering(self.spread, "Pa")
        return f"{stress} {self._place} ({spread} of it for the radius of the patch)"

    @property
    def _verdict(self) -> str:
        """Text: whether yield or failure is reached, and where this holds."""
        noun = CRITERIA[self.criterion][0]
        runs = self.spans or (self,)
        is_certain = any(run.bounds[0] >= 1 for run in runs)
        possible = [run.impact for run in runs if run.bounds[1] >= 1]
        if possible and not is_certain:
            in_doubt = max(runs, key=lambda run: run.bounds[1])
            told = in_doubt._range
            if in_doubt.impact != self.impact:
                told = f"by impact {in_doubt.impact} {told}"
            verdict = f"{noun} may be reached{_in_impacts(possible, len(runs))} ({told})"
        else:
            verdict = f"{noun} is {'reached' if self.reached else 'not reached'}"
        if not self.contact:
            return f"{verdict} {self.scope}".rstrip()
        return f"{verdict} {self.scope or 'apart from the contact'}, which itself yields"

    def __str__(self) -> str:
        return self.sentence

    def _facts(self) -> list[tuple[str, str]]:
        return [(self.criterion, self.sentence)]


def _at(point: Array, time: float) -> str:
    """Place and time of a stress: "at (1, 2, 3) mm, 809 µs"."""
    return f"at {point_text(point)}, {engineering(time, 's')}"


def _range_of(*ends: float) -> str:
    """A range of stresses [Pa] as text, or the one stress that it is."""
    return " to ".join(dict.fromkeys(engineering(end, "Pa") for end in ends))


#: Largest number of impacts that a verdict lists.
LISTED = 3


def _in_impacts(numbers: Sequence[int], count: int) -> str:
    """Text of the impacts, of `count` in all, in which something happens; "" for all."""
    if len(numbers) == count:
        return ""
    if len(numbers) > LISTED:
        return f" in {len(numbers)} of {count} impacts"
    return f" in impact{'s' if len(numbers) > 1 else ''} {' and '.join(map(str, numbers))}"


#: No balls are left out.
NOTHING = np.zeros((0, 4))


class Zones(NamedTuple):
    """Balls (n, 4) that a margin leaves out, and the contacts whose patches spread their forces.

    `asked`: how many of the balls, the first ones, were asked for. `edges`, `supports`: balls
    about sharp inner edges and about rigid supports. `unjudged`: whether the largest stress is
    sought of materials without a strength. `patches`: of contacts on sheets.
    """

    balls: Array = NOTHING
    contacts: Sequence[YieldingZone] = ()
    asked: int = 0
    edges: Array = NOTHING
    supports: Array = NOTHING
    unjudged: bool = False
    patches: Sequence[SheetPatch] = ()

    @property
    def away(self) -> Away | None:
        """The distances from sharp edges and supports; None if these are not left out."""
        distances = np.concatenate([self.edges[:, 3], self.supports[:, 3]])
        if not len(distances):
            return None
        ends = float(distances.min()), float(distances.max())
        return Away(ends, len(self.edges) > 0, len(self.supports) > 0)

    def left_out(self, points: Array) -> NDArray[np.bool_]:
        """Whether points (P, 3) are left out."""
        return is_within(points, self.balls) | self.sharp(points)

    def sharp(self, points: Array) -> NDArray[np.bool_]:
        """Whether points (P, 3) lie at sharp edges or supports."""
        return is_within(points, np.concatenate([self.edges, self.supports]))

    @classmethod
    def about(cls, contacts: Sequence[YieldingZone]) -> Zones:
        """The zones about contacts that yield."""
        return cls(np.reshape([zone.ball for zone in contacts], (-1, 4)), contacts)

    def and_balls(self, leave_out: ArrayLike) -> Zones:
        """The zones with balls (n, 4) that were asked for."""
        balls = checks.floats("leave_out", leave_out, (None, 4))
        return self._replace(balls=np.vstack([balls, self.balls]), asked=len(balls))

    def of_span(self, span: int) -> Zones:
        """The same balls, with the contacts of one span of the run."""
        return self._replace(contacts=[zone for zone in self.contacts if zone.span == span])

    def spread_error(self, points: Array) -> Array:
        """Errors (P,) [Pa] of von Mises stresses at points (P, 3)."""
        spreading: list[YieldingZone | SheetPatch] = [*self.contacts, *self.patches]
        return sum((zone.spread_error(points) for zone in spreading), np.zeros(len(points)))

    def mesh_error(self, points: Array) -> Array:
        """Errors (P,) [Pa] at points (P, 3) by the cells of sheets, which spread forces."""
        return sum((one.mesh_error(points) for one in self.patches), np.zeros(len(points)))

    @property
    def edge_stress(self) -> float:
        """Largest von Mises stress [Pa] at the edges of the balls about contacts."""
        return max((zone.edge_stress for zone in self.contacts), default=0.0)

    @property
    def thin_stress(self) -> float:
        """The same of contacts on parts that are too thin for it, within their thickness."""
        return max((zone.thin_stress for zone in self.contacts), default=0.0)

    @property
    def hollow_stress(self) -> float:
        """Largest rise of the stress [Pa] beside a hollow under the patch of a contact."""
        return max((zone.hollow_stress for zone in self.contacts), default=0.0)

    @property
    def hollow_patch(self) -> float:
        """Radius [m] of the smallest patch over such a hollow; 0 if none may be smaller."""
        return max((zone.smallest_patch for zone in self.contacts if zone.hollow_stress), default=0)

    @property
    def thin(self) -> float:
        """Least thickness over the radius of a contact, of those that the mesh does not resolve."""
        return min((zone.unresolved_depth for zone in self.contacts), default=inf)


#: No zones.
NO_ZONES = Zones()


def margin_of(
    criterion: str,
    values: Array,
    strengths: Array,
    points: Array,
    times: Array,
    places: list[Place],
    zones: Zones,
) -> Margin | None:
    """The margin of the worst of the values (S,) over the strengths (S,); None if all strengths are
    NaN.

    Balls of the zones, and sharp edges, are of no effect if nothing else is left.
    """
    if zones.away is not None:
        at_edges = zones.sharp(points)
        no_edges = zones._replace(edges=NOTHING, supports=NOTHING)
        others = np.where(at_edges, np.nan, strengths)
        off_balls = ~is_within(points, zones.balls)
        if not (off_balls & np.isfinite(others)).any():
            return margin_of(criterion, values, strengths, points, times, places, no_edges)
        beyond = margin_of(criterion, values, others, points, times, places, no_edges)
        assert beyond is not None
        within = np.where(at_edges & off_balls, strengths, np.nan)
        sharp = margin_of(criterion, values, within, points, times, places, NO_ZONES)
        if sharp is not None and sharp.exposure <= beyond.of_model:
            sharp = None
        return replace(beyond, sharp=sharp, away=zones.away)
    leave_out = zones.balls
    if len(leave_out):
        in_zones = is_within(points, leave_out)
        outside = np.where(in_zones, np.nan, strengths)
        inside = np.where(in_zones, strengths, np.nan)
        no_balls = zones._replace(balls=NOTHING, asked=0)
        beyond = margin_of(criterion, values, outside, points, times, places, no_balls)
        nearer = margin_of(criterion, values, inside, points, times, places, NO_ZONES)
        if beyond is None:
            return nearer
        beyond = replace(beyond, beyond=leave_out, nearer=nearer, asked=zones.asked)
        if not beyond.is_mises:
            return beyond
        names = ("edge_stress", "thin_stress", "hollow_stress", "hollow_patch", "thin")
        of_zones = {name: getattr(zones, name) for name in names}
        return replace(beyond, **of_zones)
    spread = zones.spread_error(points)
    exposure = (values + spread) / strengths
    if not np.isfinite(exposure).any():
        return None
    k = int(np.nanargmax(exposure))
    layer = places[k].layer
    side = str(places[k].surface) if places[k].layer is not None else None
    stress_and_strength = float(values[k]), float(strengths[k])
    at = points[k], float(times[k])
    worst = Margin(
        criterion, *stress_and_strength, *at, layer, side, spread=float(spread[k]), row=k
    )
    most = int(np.nanargmax(values / strengths))
    if values[most] > values[k]:
        largest = Largest(float(values[most]), points[most], float(times[most]))
        worst = replace(worst, largest=largest)
    return worst


def is_within(points: Array, balls: Array) -> NDArray[np.bool_]:
    """Whether points (P, 3) lie in one of the balls (n, 4): x, y, z, radius [m]."""
    in_zones = np.zeros(len(points), dtype=bool)
    for radius in np.unique(balls[:, 3]):
        centres = cKDTree(balls[balls[:, 3] == radius, :3])
        in_zones |= centres.query(points)[0] <= radius
    return in_zones


#: Surfaces of a ply at which a criterion can be largest: in-plane stresses are linear through a
#: ply, the transverse shear is a parabola.
PLY_SURFACES = {
    "tsai_hill": ("bottom", "top"),
    "tsai_wu": ("bottom", "top"),
    "delamination": ("bottom", "middle", "top"),
}
#: Criterion -> strength that a material must have for it.
STRENGTH_OF = {
    "yield": "a yield_strength, as 250e6 Pa",
    "tension": "a strength in tension, as tensile = (45e6, 69e6) Pa",
    "tsai_hill": "layers that have Strengths",
    "tsai_wu": "layers that have Strengths",
    "delamination": "layers that have an interlaminar strength",
}
#: Function (components (S, c, B), scalar) -> (largest values (S,), their times, error bound).
Search = Callable[[Array, Callable[[Array], Array]], tuple[Array, Array, float | None]]


class Maxima(NamedTuple):
    """Largest values of all points with times, errors, exposures and margin, for a `PeakField`."""

    values: Array
    times: Array
    error: float | None
    exposure: Array | None = None
    margin: Margin | None = None

    def or_larger(self, other: Maxima) -> Maxima:
        """At each point the larger of two maxima."""
        times = np.where(other.values > self.values, other.times, self.times)
        margins = [maxima.margin for maxima in (self, other) if maxima.margin is not None]
        worst = max(margins, key=lambda margin: margin.exposure, default=None)
        values = np.maximum(self.values, other.values)
        error = _larger_error(self.error, other.error)
        return Maxima(values, times, error, values, worst)


def _larger_error(error: float | None, other: float | None) -> float | None:
    """The larger of two errors; the other if one is None."""
    known_errors = [value for value in (error, other) if value is not None]
    return max(known_errors, default=None)


def plies(structure: Structure, quantity: str, part: str | None) -> list[Place | None]:
    """Ply surfaces at which a ply criterion is evaluated; [None] for other quantities."""
    if quantity not in PLY_SURFACES:
        return [None]
    materials = source(structure).materials_of(structure, part)
    return [
        Place(surface, layer, local=True)
        for layer in range(max(map(len, map(layers_of, materials)), default=0))
        for surface in PLY_SURFACES[quantity]
    ]


def criteria_of(structure: Structure) -> list[str]:
    """The criteria for which materials of the structure have strengths."""
    materials = source(structure).materials_of(structure, None)
    strengths = [getattr(material, "yield_strength", None) for material in materials]
    strengths += [strength_of(material, Place()) for material in materials]
    strengths += [layer.strength for material in materials for layer in layers_of(material)]
    computed_from = {
        "von_mises": "yield",
        "tension": "tension",
        "tsai_wu": "tsai_wu",
        "delamination": "delamination",
    }
    return [
        name
        for name, c in computed_from.items()
        if any(_has_strength(strength, c) for strength in strengths)
    ]


def strength_range(structure: Structure, margin: Margin) -> tuple[float, float] | None:
    """Range of the strength of the materials that have that of a margin [Pa]; None: not known."""
    materials = source(structure).materials_of(structure, None)
    strength = margin.strength
    if margin.criterion == "tension":
        tensile = [strength_of(material, Place()) for material in materials]
        found = (t for t in tensile if isinstance(t, Tensile) and t.low == strength)
        return next(((t.low, t.high) for t in found), None)
    ranges = [
        material.yield_range
        for material in materials
        if getattr(material, "yield_strength", None) == strength
        and getattr(material, "yield_range", None) is not None
    ]
    return (min(low for low, _ in ranges), max(high for _, high in ranges)) if ranges else None


def with_strength(criterion: str, tensors: NodeTensors) -> NodeTensors:
    """The tensors of materials with the strength that a criterion needs."""
    has_strength = [_has_strength(strength, criterion) for strength, _ in tensors.origins]
    with_strength = np.array(has_strength, dtype=bool)[tensors.origin]
    arrays = (
        tensors.nodes[with_strength],
        tensors.columns[with_strength],
        tensors.origin[with_strength],
    )
    return NodeTensors(*arrays, tensors.origins if any(has_strength) else [])


def _has_strength(strength: object, criterion: str) -> bool:
    """Whether a strength is of the kind that a criterion needs."""
    if criterion == "delamination":
        return getattr(strength, "interlaminar", None) is not None
    kinds = {"yield": float, "tension": Tensile}
    return isinstance(strength, kinds.get(criterion, Strengths))


def stresses(
    quantity: str,
    points: Array,
    tensors: NodeTensors,
    search: Search,
    zones: Zones = NO_ZONES,
) -> Maxima:
    """The largest values of tensors, with exposures and margin if the strengths are known."""
    criterion = quantity
    if quantity in PLY_SURFACES:
        extremes, times_of_plies, error = _of_plies(quantity, tensors, search)
        strengths = np.ones(len(extremes))
    else:
        scalar = SCALARS.get(quantity, length)
        columns = tensors.columns if quantity in SCALARS else equivalent_parts(tensors.columns)
        extremes, times_of_plies, error = search(columns, scalar)
        criterion = "tension" if quantity == "tension" else "yield"
        known = [_pascals_of(strength, criterion) for strength, _ in tensors.origins]
        strengths = np.array(known)[tensors.origin]
        if quantity in ("stress", "strain"):
            strengths[:] = np.nan
    exposures = None
    margin = None
    if np.isfinite(strengths).any():
        share = np.nan_to_num(extremes / strengths)
        exposures, _ = nodal_maxima(tensors.nodes, share, times_of_plies, len(points))
        places = [tensors.origins[k].place for k in tensors.origin]
        positions = points[tensors.nodes]
        margin = margin_of(criterion, extremes, strengths, positions, times_of_plies, places, zones)
        if margin is not None and criterion == "yield":
            margin = replace(margin, columns=columns[margin.row])
        if quantity == "yield":
            extremes = share
            error = error and error / float(strengths.min())
    elif zones.unjudged:
        places = [tensors.origins[k].place for k in tensors.origin]
        of_points = points[tensors.nodes], times_of_plies, places, zones
        margin = margin_of(UNJUDGED, extremes, np.ones(len(extremes)), *of_points)
    values, peak_times = nodal_maxima(tensors.nodes, extremes, times_of_plies, len(points))
    return Maxima(values, peak_times, error, exposures, margin)


#: Quantity -> scalar of its components; others are lengths of their equivalent parts.
SCALARS = {"stress": extreme_principal, "strain": extreme_principal, "tension": tension}


def _pascals_of(strength: object, criterion: str) -> float:
    """The strength [Pa] by which a criterion judges; NaN for a material without."""
    if not _has_strength(strength, criterion):
        return float("nan")
    return strength.low if isinstance(strength, Tensile) else cast("float", strength)


def _of_plies(
    criterion: str, tensors: NodeTensors, search: Search
) -> tuple[Array, Array, float | None]:
    """(largest exposures, their times, error bound); layers of equal strength are searched
    together.
    """
    values = np.zeros(len(tensors.nodes))
    peak_times = np.zeros(len(tensors.nodes))
    error_bound = None
    of_origin = [strength for strength, _ in tensors.origins]
    for strength in dict.fromkeys(s for s in of_origin if isinstance(s, Strengths)):
        of_material = np.isin(tensors.origin, [k for k, s in enumerate(of_origin) if s == strength])
        scalar = functools.partial(exposure, criterion, strength)
        values[of_material], peak_times[of_material], error = search(
            tensors.columns[of_material], scalar
        )
        error_bound = _larger_error(error_bound, error)
    return values, peak_times, error_bound


def nodal_maxima(nodes: IntArray, values: Array, when: Array, count: int) -> tuple[Array, Array]:
    """(largest value at each of `count` nodes, its time)."""
    order = np.argsort(values, kind="stable")  # the largest is written last
    best = np.zeros(count)
    time = np.zeros(count)
    best[nodes[order]] = values[order]
    time[nodes[order]] = when[order]
    return best, time


def contact_yields(history: AnyHistory) -> bool:
    """Whether any contact of a history yields."""
    return isinstance(history, History) and any(map(yields, history.contact_histories))


def zones_of(history: AnyHistory, body: str, *, unjudged: bool = False) -> Zones:
    """The zones about contacts that yield, which a margin of a solid body leaves out; `unjudged`:
    of materials without a strength, of which it is not known.
    """
    if not isinstance(history, History):
        return NO_ZONES
    contacts = history.contact_histories, history.name_of(body)
    return Zones.about(yielding_zones(*contacts, unknown=unjudged))


def zones_on(
    structure: Structure, shapes: Array, part: str | None, zones: Zones, run: AnyHistory, body: str
) -> Zones:
    """What is left out, and which patches spread their forces, on a solid or a sheet."""
    if only_solids(structure, shapes, part):
        return on_part(structure, zones) if len(zones.balls) else zones
    return Zones(patches=_patches_on_sheets(structure, run, body), unjudged=zones.unjudged)


def _patches_on_sheets(structure: Structure, run: AnyHistory, body: str) -> list[SheetPatch]:
    """The patches of the contacts of an impact on isotropic sheets."""
    from antiosc.recovery.mesh_fields import isotropic_sheet_at  # needs dolfinx

    if not isinstance(run, History):
        return []
    patches = []
    for patch in patches_of(run.contact_histories, run.name_of(body)):
        found = isotropic_sheet_at(structure, patch.point)
        if found is not None:
            sheet, cell = found
            patches.append(patch._replace(nu=sheet.nu, thickness=sheet.thickness, cell=cell))
    return patches


def on_part(structure: Structure, zones: Zones) -> Zones:
    """The zones with the thickness of a part of one mesh at the contacts; of others as they are."""
    matrices = structure.matrices
    if not matrices.meshed or matrices.assembled:
        return zones
    from antiosc.fem.mesh.walls import under_patch  # needs dolfinx

    faces = cast("MeshedStructure", matrices).faces
    at_contacts = [under_patch(faces, zone.point, zone.radii[1]) for zone in zones.contacts]
    contacts = [
        zone._replace(depth=depth, hollow=hollow, faces=size)
        for zone, (depth, hollow, size) in zip(zones.contacts, at_contacts, strict=True)
    ]
    return zones._replace(contacts=contacts)


def balls_of_edges(structure: Structure, shapes: Array, part: str | None) -> tuple[Array, Array]:
    """Balls (n, 4) about sharp inner edges and about rigid supports of the solids of a part."""
    from antiosc.recovery.sharp_edges import sharp_edges  # needs dolfinx

    return sharp_edges(structure, shapes, part)


#: The mesh does not resolve the stress if its jumps over the largest stress exceed this.
UNRESOLVED_JUMP = 0.2


def mesh_error(
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
    factors = stress_amplitudes(structure, history, instants, body)[number.ravel()]
    return stress_jumps(structure, shapes, factors, part)


#: What judges a stress at a distance.
AT_A_DISTANCE = "leave_out=[(x, y, z, radius)]"


def doubt_at(structure: Structure, shapes: Array, part: str | None, x: Array, share: float) -> str:
    """A warning about the largest stress at x (3,) with this relative mesh error; "" if there is
    none.
    """
    from antiosc.recovery.sharp_edges import RE_ENTRANT, corner_at  # needs dolfinx

    angle, supported = corner_at(structure, shapes, x, part)
    if angle >= RE_ENTRANT:
        return (
            f"the largest stress lies in a re-entrant corner of {angle:.0f} degrees, where it grows"
            " with every refinement of the mesh: model the fillet, or judge it at a distance"
            f" ({AT_A_DISTANCE})"
        )
    if supported:
        return (
            "the largest stress lies at a support that holds the part rigidly, where it grows with"
            f" refinements of the mesh: judge it at a distance ({AT_A_DISTANCE}), or model what"
            " holds the part"
        )
    if share >= UNRESOLVED_JUMP:
        place = ", ".join(f"{c:.4g}" for c in x)
        refined = f"refine=[(({place}), size)], or size"
        return (
            f"the cells at the largest stress differ by {percent(share)} of it: the mesh does not"
            f" resolve it; make the cells there smaller ({refined})"
        )
    return ""


def only_solids(structure: Structure, shapes: Array, part: str | None) -> bool:
    """Whether the selected parts are solids."""
    from antiosc.recovery.mesh_fields import families  # needs dolfinx

    return families(structure, shapes, part) == {"solid"}
