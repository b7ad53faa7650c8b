"""Nastran's beams: their cross-sections, orientation, offsets and pin flags.

A tapered beam has its mean section. A beam with offset or released ends gets end nodes of its own;
these follow its grid points as rigid bodies, except in the released motions.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import replace
from inspect import signature
from typing import NamedTuple

import numpy as np

from antiosc.io.conversion import Array
from antiosc_decks import properties as profiles
from antiosc_decks.builder import ModelBuilder
from antiosc_decks.nastran_cards import BEAM_PROPERTIES, Entry, motions_of
from antiosc_decks.nastran_mesh import NastranDeck

#: Sections whose centroid may differ from the shear centre, on which the nodes of a CBEAM lie.
ASYMMETRIC_SECTIONS = ("T", "T1", "T2", "CHAN", "CHAN1", "CHAN2", "HAT", "BOX1")
#: A second moment of 0 is replaced by this share of the other one.
MIN_MOMENT_RATIO = 1e-6
#: Property -> fields of A, I1, I2, I12, J, NSM; field of K1 (-1: none, or after the sections).
CONSTANT_FIELDS = {"PBAR": ((2, 3, 4, 18, 5, 6), 16), "PBEAM": ((2, 3, 4, 5, 6, 7), -1)}
#: Shear coefficient of a plane that is rigid in shear, of a beam that deforms in the other one: its
#: shear deflection is below 1e-4 of that of bending where the beam is as long as its height.
RIGID_SHEAR_FACTOR = 1e4
#: What is ignored of a PBEAM -> its field, counted from the end of the sections.
IGNORED_PBEAM_FIELDS = {"S1": 2, "S2": 3, "NSI(A)": 4, "NSI(B)": 5, "CW(A)": 6, "CW(B)": 7}
IGNORED_PBEAM_FIELDS |= {"M1(A)": 8, "M2(A)": 9, "M1(B)": 10, "M2(B)": 11}


class BeamProfile(NamedTuple):
    """The mean cross-section of a beam."""

    profile: profiles.Profile
    #: nonstructural mass per length
    nonstructural_mass: float
    #: whether it deforms in shear
    sheared: bool
    #: angle about the beam's axis from plane 1 to the first principal axis, radians
    angle: float = 0.0


#: A, I1, I2, I12, J and nonstructural mass at one place along a beam.
Station = list[float]


class BeamProfiles:
    """The cross-sections along the beams of one property card."""

    def __init__(self, entry: Entry) -> None:
        self.entry = entry
        #: what is ignored, in the deck's terms
        self.remarks: list[str] = []
        #: offset of the neutral axis from the shear centre: (end, along planes 1 and 2)
        self.neutral = np.zeros((2, 2))
        #: profile whose numbers `stations` replace; whether the beams deform in shear
        self.form = profiles.rectangle(1.0, 1.0)
        self.sheared = True
        by_shapes = entry.name in ("PBARL", "PBEAML")
        read = self._stations_by_shapes if by_shapes else self._stations_by_constants
        #: place along the beam from 0 to 1, ascending -> the cross-section there
        self.stations: dict[float, Station] = dict(sorted(read().items()))
        first, *stations = self.stations.values()
        if not all(np.allclose(station, first, rtol=1e-6, atol=0) for station in stations):
            label = f"{entry.name} {entry.text(0)}"
            self.remarks.append(f"the taper of {label}, its mean section is taken")
        first_station = min(self.stations)
        last = max(self.stations)
        entry.needs(0 <= first_station <= last <= 1, f"X/XB of {entry.name} lies between 0 and 1.")
        is_complete = not stations or last == 1
        entry.needs(is_complete, f"{entry.name} gives no section at X/XB = 1.")

    def mean(self) -> BeamProfile:
        """The mean cross-section along the beam, linear between stations."""
        table = np.array(list(self.stations.values()))
        widths = np.diff(list(self.stations))
        if len(widths):
            table = widths[:, None] * (table[1:] + table[:-1]) / 2
        A, first, second, mixed, J, extra = table.sum(axis=0).tolist()

        mean = (first + second) / 2
        half = math.hypot((first - second) / 2, mixed)
        angle = math.atan2(2 * mixed, first - second) / 2 if mixed else 0.0
        form = self.form
        if mixed:
            first = mean + half
            second = mean - half
            form = form.sheared(*self._principal_shear_coefficients(angle))
        message = f"{self.entry.name} needs A, I1 and I2 above 0, and I12² below I1 I2."
        self.entry.needs(min(A, first, second) > 0, message)
        section = replace(form, A=A, I=first, I_side=second, J=J or (first + second) / 2)
        return BeamProfile(section, extra, self.sheared, angle)

    def _principal_shear_coefficients(self, angle: float) -> tuple[float, float]:
        """Shear coefficients along the principal axes at `angle`, by the compliances in shear."""
        first, second = self.form.shear_coefficients
        share = math.sin(angle) ** 2
        along = (1 - share) / first + share / second
        return 1 / along, 1 / (1 / first + 1 / second - along)

    def _stations_by_constants(self) -> dict[float, Station]:
        """Stations of PBAR and PBEAM, which give areas and moments."""
        entry = self.entry
        label = f"{entry.name} {entry.text(0)}"
        fields, start = CONSTANT_FIELDS[entry.name]
        values = [entry.real(k) if k > 0 else 0.0 for k in fields]
        values[0] = entry.real(2, None)
        rows = {0.0: values}

        if entry.name == "PBEAM":
            start = self._add_stations(rows)
            # blank at the second end: as at the first
            ends = (start + 12, start + 13)
            second = [k + 2 if entry.text(k + 2) else k for k in ends]
            self.neutral[:] = [[entry.real(k) for k in fields] for fields in (ends, second)]
            unread = [name for name, k in IGNORED_PBEAM_FIELDS.items() if entry.real(start + k)]
            if unread:
                self.remarks.append(f"{', '.join(unread)} of {label}")
        elif max(values[1:3]) > min(values[1:3]) == 0:
            told = f"the hinge that {label} is where its I1 or I2 is 0"
            self.remarks.append(f"{told}, {MIN_MOMENT_RATIO:g} of the other is taken")
            least = MIN_MOMENT_RATIO * max(values[1:3])
            values[1:3] = (max(moment, least) for moment in values[1:3])
        k_if_blank = 1.0 if entry.name == "PBEAM" else 0.0
        k1 = entry.real(start, k_if_blank)
        k2 = entry.real(start + 1, k_if_blank)
        entry.needs(min(values[:3]) > 0, f"{entry.name} needs A, I1 and I2 above 0.")
        self.sheared = bool(k1 or k2)
        if self.sheared:
            self.form = self.form.sheared(k1 or RIGID_SHEAR_FACTOR, k2 or RIGID_SHEAR_FACTOR)
        if k1 != k2 and any(row[3] for row in rows.values()):
            self.remarks.append(f"how I12 of {label} couples shear in planes 1 and 2 (K1, K2)")
        if not values[4]:
            self.remarks.append(f"the missing torsion constant J of {label}, (I1 + I2)/2 is taken")

        return rows

    def _add_stations(self, stations: dict[float, Station]) -> int:
        """Add PBEAM's further stations to `stations`; return the field after them."""
        entry = self.entry
        starts = {}
        words = ("YES", "YESA", "NO")
        # the places of stresses at the first end may be left out
        start = 8 if entry.text(8).upper() in words else 16
        while entry.text(start).upper() in words:
            starts[entry.real(start + 1, None)] = start + 2
            start += 16 if entry.text(start).upper() == "YES" else 8
        first = last = np.array(stations[0.0])
        for place in sorted(starts, reverse=True):
            # blank at the end: as at the start; between the ends: linear
            blank = (first + place * (last - first)).tolist()
            stations[place] = [entry.real(starts[place] + k, blank[k]) for k in range(6)]
            last = np.array(stations[place]) if place == 1 else last
        entry.needs(0.0 not in starts, "X/XB of PBEAM lies between 0 and 1.")
        return start

    def _stations_by_shapes(self) -> dict[float, Station]:
        """Stations of PBARL and PBEAML, which give a shape and its dimensions."""
        entry = self.entry
        kind = entry.text(3).upper()
        unknown = f"{entry.name} of the type {kind!r}: give its constants by PBAR."
        entry.needs(kind in BEAM_SHAPES, unknown)
        centred = entry.name != "PBEAML" or kind not in ASYMMETRIC_SECTIONS
        off = f"PBEAML {kind!r} has a neutral axis off its shear centre: give it by PBAR."
        entry.needs(centred, off)
        count = len(signature(BEAM_SHAPES[kind]).parameters)
        first = self._dimensions(8, [None] * count)

        if entry.name == "PBEAML" and kind == "L":
            middle = np.array([first[2], first[3]]) / 2
            self.neutral[:] = profiles.centroid(_l_walls(*first)) - middle
        extra = entry.real(8 + count)
        stations = {0.0: self._shape_station(kind, first, extra)}
        start = 9 + count

        while entry.name == "PBEAML" and entry.words(start, start + 2):
            d = self._dimensions(start + 2, first)
            station = self._shape_station(kind, d, entry.real(start + 2 + count, extra))
            stations[entry.real(start + 1, 1.0)] = station
            start += 3 + count
        if kind not in ("ROD", "TUBE", "TUBE2", "BAR", "BOX"):
            label = f"{entry.name} {entry.text(0)} ({kind})"
            told = f"the shear coefficients and the torsion constant that Nastran gives {label}"
            instead = f"{profiles.THIN_WALL_SHEAR:g} and that of thin walls are taken"
            self.remarks.append(f"{told}, {instead}")

        return stations

    def _dimensions(self, first_field: int, defaults: Sequence[float | None]) -> list[float]:
        """The dimensions that begin at field `first_field`, with defaults for blank fields."""
        d = [self.entry.real(first_field + k, value) for k, value in enumerate(defaults)]
        full = self.entry.text(3).upper() == "TUBE" and d[0] > 0 and d[1] == 0
        self.entry.needs(min(d) > 0 or full, f"{self.entry.name} needs dimensions above 0.")
        return d

    def _shape_station(self, shape: str, d: Sequence[float], nonstructural_mass: float) -> Station:
        """The station of a shape with dimensions `d`."""
        try:
            profile = BEAM_SHAPES[shape](*d)
            if not isinstance(profile, profiles.Profile):
                torsion = profiles.box_torsion(*d) if shape == "BOX1" else None
                profile = profiles.profile_of_walls(profile, torsion)
            self.form = profile
            mixed = profile.product_moment if shape in ("L", "Z") else 0.0
            return [profile.A, profile.I, profile.I_side, mixed, profile.J, nonstructural_mass]
        except ValueError as error:
            label = f"{self.entry.name} {self.entry.text(0)} of the type {shape!r}"
            message = f"the dimensions of {label} do not fit into each other."
            raise self.entry.place.error(message) from error


Walls = list[profiles.Wall]


def _mirrored_walls(low: float, high: float, left: float, right: float) -> Walls:
    """A wall and its mirror image across the height."""
    return [(low, high, left, right), (low, high, -right, -left)]


def _i_walls(h: float, low: float, top: float, web: float, t_low: float, t_top: float) -> Walls:
    """Walls of an I section: height, widths of both flanges, thicknesses of web and flanges."""
    middle = (t_low, h - t_top, -web / 2, web / 2)
    return [(0, t_low, -low / 2, low / 2), middle, (h - t_top, h, -top / 2, top / 2)]


def _t_walls(width: float, h: float, flange: float, web: float) -> Walls:
    """Walls of a T section: width, height, thicknesses of flange and web."""
    return [(h - flange, h, -width / 2, width / 2), (0, h - flange, -web / 2, web / 2)]


def _channel_walls(width: float, h: float, web: float, flange: float) -> Walls:
    """Walls of a channel section: width, height, thicknesses of web and flanges."""
    return [(0, flange, 0, width), (flange, h - flange, 0, web), (h - flange, h, 0, width)]


def _l_walls(width: float, h: float, base: float, leg: float) -> Walls:
    """Walls of an L section: width, height, thicknesses of the base and the upright leg."""
    return [(0, base, 0, width), (base, h, 0, leg)]


#: Shape -> its cross-section, or its walls, as a function of its dimensions; plane 1 is upright.
BEAM_SHAPES: dict[str, Callable[..., profiles.Profile | Walls]] = {
    "ROD": lambda r: profiles.ellipse(2 * r, 2 * r),
    "TUBE": lambda outer, inner: profiles.tube(outer, outer - inner),
    "TUBE2": profiles.tube,
    "BAR": lambda width, h: profiles.rectangle(h, width),
    "BOX": lambda width, h, flange, web: profiles.box(h, width, flange, web),
    "HEXA": lambda tip, width, h: profiles.hexagon(h, width, tip),
    "CROSS": lambda arms, t, h, bar: [
        (-h / 2, h / 2, -t / 2, t / 2),
        *_mirrored_walls(-bar / 2, bar / 2, t / 2, (t + arms) / 2),
    ],
    "H": lambda between, legs, h, bar: [
        *_mirrored_walls(-h / 2, h / 2, between / 2, (between + legs) / 2),
        (-bar / 2, bar / 2, -between / 2, between / 2),
    ],
    "I": _i_walls,
    "I1": lambda arms, t, inner, h: _i_walls(
        h, arms + t, arms + t, t, (h - inner) / 2, (h - inner) / 2
    ),
    "T": _t_walls,
    "T1": lambda flange, web, t_flange, t_web: [
        (-flange / 2, flange / 2, 0, t_flange),
        (-t_web / 2, t_web / 2, t_flange, t_flange + web),
    ],
    "T2": _t_walls,
    "CHAN": _channel_walls,
    "CHAN1": lambda arm, web, inner, h: _channel_walls(arm + web, h, web, (h - inner) / 2),
    "CHAN2": lambda leg, base, h, width: [
        *((0, base, 0, width), (base, h, 0, leg), (base, h, width - leg, width))
    ],
    "HAT": lambda h, t, top, brim: [
        (h - t, h, -top / 2, top / 2),
        *_mirrored_walls(t, h - t, -top / 2, t - top / 2),
        *_mirrored_walls(0, t, -top / 2 - brim, t - top / 2),
    ],
    "BOX1": lambda width, h, top, low, left, right: [
        *((0, low, 0, width), (h - top, h, 0, width)),
        *((low, h - top, 0, left), (low, h - top, width - right, width)),
    ],
    "Z": lambda arm, web, inner, h: [
        (0, (h - inner) / 2, -web / 2, web / 2 + arm),
        (h - (h - inner) / 2, h, -web / 2 - arm, web / 2),
        ((h - inner) / 2, h - (h - inner) / 2, -web / 2, web / 2),
    ],
    "L": _l_walls,
}


class BeamEnd(NamedTuple):
    """The end node of a beam away from its grid point, and the motions in which it follows it."""

    #: row of the end node
    row: int
    #: row of the grid point
    node: int
    #: motions (0 to 5) along `axes` in which the end follows the grid point
    motions: tuple[int, ...]
    #: tangent, height and width of the beam, as rows (3, 3)
    axes: Array
    #: vector from the shear centre, about which the beam twists, to the end
    eccentricity: Array


def separate_ends(deck: NastranDeck) -> list[BeamEnd]:
    """Give offset and released beams their own end nodes, which must be joined later."""
    beams = deck.entries_named(*BEAM_PROPERTIES)
    neutral_axes = {beam.integer(0): BeamProfiles(beam).neutral for beam in beams}
    ends: list[BeamEnd] = []
    places: list[Array] = []
    count = len(deck.deck.points)

    for block, numbers in deck.deck.numbered():
        if block.role != "beam":
            continue
        for nodes, element in zip(block.corners, numbers.tolist(), strict=True):
            entry = deck.elements[element]
            neutral = neutral_axes.get(entry.property_number(), np.zeros((2, 2)))
            ends_moved = _ends_of(deck, entry, nodes.tolist(), neutral)
            for k, (place, motions, axes) in ends_moved.items():
                row = count + len(places)
                beside = neutral[k] @ axes[1:]
                ends.append(BeamEnd(row, int(nodes[k]), motions, axes, beside))
                places.append(place)
                nodes[k] = row
            if ends_moved:
                deck.beams_with_own_ends.add(element)

    deck.deck.points = np.vstack([deck.deck.points, *places])
    return ends


def join_ends(builder: ModelBuilder, ends: list[BeamEnd]) -> None:
    """Let the end nodes of offset and released beams follow the grid points."""
    for end in ends:
        builder.apart.append(end.row)
        leader = builder.joints.leader_point(end.node)
        if end.eccentricity.any():
            builder.report_once("how mass off the shear centre (N1, N2) couples twist with sway")
        row = np.array([end.row])
        frames = {end.row: end.axes}
        builder.joints.add_rigid(row, leader, end.motions, frames, end.eccentricity)


def _ends_of(
    deck: NastranDeck, entry: Entry, nodes: list[int], neutral: Array
) -> dict[int, tuple[Array, tuple[int, ...], Array]]:
    """(place, motions that follow, axes) by the end (0, 1) of a beam that needs its own node.

    `neutral` (2, 2): offsets of the neutral axis at both ends, along height and width.
    """
    pins = [motions_of(entry.text(k), entry.place) for k in (8, 9)]
    offsets = offsets_of(deck, entry)
    if not any(pins) and not offsets.any() and not neutral.any():
        return {}
    x = deck.deck.points[nodes]
    line = x[1] + offsets[1] - x[0] - offsets[0]
    length = float(np.linalg.norm(line))
    is_offset = length > 1e-12 * max(float(np.abs(x).max()), 1e-300)
    entry.needs(is_offset, f"{entry.name} {entry.text(0)} has no length.")
    height = plane_1_vector(deck, entry, line / length)
    common_offset = float(offsets[0] @ height)
    residual = max(np.abs(offsets[0] - v).max() for v in (offsets[1], common_offset * height))
    if not any(pins) and not neutral.any() and residual <= 1e-6 * abs(common_offset):
        return {}  # both ends are equally far off along the height: by the section
    axes = np.stack([line / length, height, np.cross(line / length, height)])
    places = x + offsets + neutral @ axes[1:]
    ends = [k for k in (0, 1) if pins[k] or offsets[k].any() or neutral[k].any()]
    held_motions = [tuple(c for c in range(6) if c not in released) for released in pins]
    return {k: (places[k], held_motions[k], axes) for k in ends}


def offsets_of(deck: NastranDeck, entry: Entry) -> Array:
    """Offsets (2, 3) of the ends from their nodes along the axes of the deck."""
    offsets = np.reshape(entry.reals(10, 16), (2, 3))
    if not offsets.any():
        return offsets
    kind = entry.text(7).upper()
    of_nodes = not kind.isalpha() or not set(kind[1:]) & set("OE")
    fault = f"{entry.name}: give offsets in the displacement system, not OFFT = {kind}."
    entry.needs(of_nodes, fault)
    frames = [deck.frame(deck.node_in(entry, k), entry.place) for k in (2, 3)]
    return np.stack([w @ frame for w, frame in zip(offsets, frames, strict=True)])


def plane_1_vector(deck: NastranDeck, entry: Entry, tangent: Array) -> Array:
    """Unit vector of plane 1 across the beam's axis `tangent`."""
    v = _orientation_vector(deck, entry)
    height = v - (v @ tangent) * tangent
    size = float(np.linalg.norm(height))
    message = f"the orientation of {entry.name} {entry.text(0)} is missing, or along its axis."
    entry.needs(size > 1e-9 * float(np.linalg.norm(v)), message)
    return height / size


def _orientation_vector(deck: NastranDeck, entry: Entry) -> Array:
    """Orientation vector of an element: fields 5 to 7, or to the node in field 5."""
    a = deck.node_in(entry, 2)
    if entry.text(4) and not entry.text(5) and not entry.text(6) and "." not in entry.text(4):
        return deck.deck.points[deck.node_in(entry, 4)] - deck.deck.points[a]
    v = np.array(entry.reals(4, 7))
    if entry.text(7).upper()[:1] == "B":
        return v
    return v @ deck.frame(a, entry.place)
