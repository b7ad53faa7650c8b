"""Cross-sections of Nastran's beams: PBAR, PBARL, PBEAM, PBEAML, PBEND."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from antiosc_decks.model import properties as profiles
from antiosc_decks.nastran.cards import Entry

#: Those whose centroid need not be their shear centre, on which the nodes of a CBEAM lie.
LOPSIDED = ("T", "T1", "T2", "CHAN", "CHAN1", "CHAN2", "HAT", "BOX1")
#: Of a second moment that is 0 the share of the other one that is taken.
SLIGHT = 1e-6
#: Property -> fields of A, I1, I2, I12, J, NSM, and of K1 (-1: none, or behind the sections).
FIELDS = {
    "PBAR": ((2, 3, 4, 18, 5, 6), 16),
    "PBEND": ((2, 3, 4, -1, 5, 18), 16),
    "PBEAM": ((2, 3, 4, 5, 6, 7), -1),
}
#: What is not taken of a PBEAM -> its fields behind the sections.
BEHIND = {"S1": 2, "S2": 3, "NSI(A)": 4, "NSI(B)": 5, "CW(A)": 6, "CW(B)": 7}
BEHIND |= {"M1(A)": 8, "M2(A)": 9, "M1(B)": 10, "M2(B)": 11}


@dataclass(frozen=True)
class BeamProfile:
    """The cross-section of a beam at one place."""

    profile: profiles.Profile
    #: nonstructural mass per length
    extra: float
    #: whether it deforms in shear
    sheared: bool
    #: from plane 1 to the first principal axis, about the beam's axis, radians
    angle: float = 0.0

    @property
    def numbers(self) -> list[float]:
        """What changes along a tapered beam."""
        p = self.profile
        return [p.A, p.I, p.I_side, p.mixed, p.J, self.extra]


class BeamProfiles:
    """The cross-sections along the beams of one property."""

    def __init__(self, entry: Entry) -> None:
        self.entry = entry
        #: what is not taken, in the deck's terms
        self.told: list[str] = []
        #: places (end, along planes 1 and 2) of the neutral axis beside the shear centre
        self.neutral = np.zeros((2, 2))
        read = self._listed if entry.name in ("PBARL", "PBEAML") else self._by_constants
        #: (place from 0 to 1, cross-section), ascending
        self.stations: list[tuple[float, BeamProfile]] = sorted(read(), key=lambda one: one[0])
        places = [place for place, _ in self.stations]
        inside = 0 <= places[0] <= places[-1] <= 1
        entry.needs(inside, f"X/XB of {entry.name} lies between 0 and 1.")
        ended = len(places) == 1 or places[-1] == 1
        entry.needs(ended, f"{entry.name} gives no section at X/XB = 1.")

    @property
    def tapered(self) -> bool:
        """Whether the cross-section changes along the beam."""
        first, *others = (one.numbers for _, one in self.stations)
        return any(not np.allclose(one, first, rtol=1e-6, atol=0) for one in others)

    def at(self, s: float) -> BeamProfile:
        """The cross-section at s from 0 to 1, linear between stations."""
        places, some = zip(*self.stations, strict=True)
        table = np.array([one.numbers for one in some]).T
        A, first, second, mixed, J, extra = (float(np.interp(s, places, c)) for c in table)
        mean, half = (first + second) / 2, math.hypot((first - second) / 2, mixed)
        angle = math.atan2(2 * mixed, first - second) / 2 if mixed else 0.0
        if mixed:
            first, second = mean + half, mean - half
        told = f"{self.entry.name} needs A, I1 and I2 above 0, and I12² below I1 I2."
        self.entry.needs(min(A, first, second) > 0, told)
        own = replace(some[0].profile, A=A, I=first, I_side=second, J=J or (first + second) / 2)
        return BeamProfile(own, extra, some[0].sheared, angle)

    def _by_constants(self) -> list[tuple[float, BeamProfile]]:
        entry = self.entry
        label = f"{entry.name} {entry.text(0)}"
        fields, start = FIELDS[entry.name]
        values = [entry.real(k) if k > 0 else 0.0 for k in fields]
        values[0] = entry.real(2, None)
        rows = {0.0: values}
        if entry.name == "PBEND":
            last = 19
            if "." not in entry.text(2):  # a pipe by its mean radius and its wall
                self.told.append(f"the flexibility of {label} by the ovalization of pipes (FSI)")
                pipe = profiles.tube(entry.real(3) + entry.real(4) / 2, entry.real(4))
                values[:] = pipe.A, pipe.I, pipe.I_side, 0.0, pipe.J, entry.real(10)
                start, last = len(entry.fields), 11
            beside = entry.real(last) or entry.real(last + 1)
            entry.needs(not beside, "PBEND with RC or ZC is not supported; move its nodes.")
        elif entry.name == "PBEAM":
            start = self._along(rows)
            self._behind(start)
        elif max(values[1:3]) > min(values[1:3]) == 0:
            self.told.append(f"the hinge that {label} is where its I1 or I2 is 0, {SLIGHT:g} "
                             "of the other is taken")  # fmt: skip
            values[1:3] = (max(one, SLIGHT * max(values[1:3])) for one in values[1:3])
        blank = 1.0 if entry.name == "PBEAM" else 0.0
        k1, k2 = entry.real(start, blank), entry.real(start + 1, blank)
        entry.needs(min(values[:3]) > 0, f"{entry.name} needs A, I1 and I2 above 0.")
        shear = (k1 + k2) / 2 if k1 and k2 else 0.0
        if bool(k1) != bool(k2) or (shear and not math.isclose(k1, k2, rel_tol=1e-3)):
            what = "their mean is taken" if shear else "both planes are taken as rigid in shear"
            self.told.append(f"K1 and K2 of {label}, which differ: {what}")
        if not values[4]:
            self.told.append(f"the missing torsion constant J of {label}, (I1 + I2)/2 is taken")
        found = []
        for place, (area, first, second, mixed, torsion, extra) in rows.items():
            factor = shear or profiles.RECTANGLE
            own = profiles.Profile(area, first, second, torsion, factor, mixed=mixed)
            found.append((place, BeamProfile(own, extra, shear > 0)))
        return found

    def _along(self, rows: dict[float, list[float]]) -> int:
        """Add the values of PBEAM at further places to those at 0; the field after them."""
        entry, starts = self.entry, {}
        given = ("YES", "YESA", "NO")
        # the places of stresses at the first end may be left out
        start = 8 if entry.text(8).upper() in given else 16
        while entry.text(start).upper() in given:
            starts[entry.real(start + 1, None)] = start + 2
            start += 16 if entry.text(start).upper() == "YES" else 8
        first = last = np.array(rows[0.0])
        for place in sorted(starts, reverse=True):
            # blank at the end: as at the start; between the ends: linear
            blank = (first + place * (last - first)).tolist()
            rows[place] = [entry.real(starts[place] + k, blank[k]) for k in range(6)]
            last = np.array(rows[place]) if place == 1 else last
        entry.needs(0.0 not in starts, "X/XB of PBEAM lies between 0 and 1.")
        return start

    def _behind(self, start: int) -> None:
        entry = self.entry
        ends = [start + 12, start + 13]
        own = [k + 2 if entry.text(k + 2) else k for k in ends]  # blank: as at the first end
        self.neutral[:] = [[entry.real(k) for k in some] for some in (ends, own)]
        if given := [name for name, k in BEHIND.items() if entry.real(start + k)]:
            self.told.append(f"{', '.join(given)} of PBEAM {entry.text(0)}")

    def _listed(self) -> list[tuple[float, BeamProfile]]:
        entry = self.entry
        kind = entry.text(3).upper()
        entry.needs(
            kind in DIMENSIONS,
            f"{entry.name} of the type {kind!r} is not supported; give its "
            f"constants by PBAR, or take one of {', '.join(DIMENSIONS)}.",
        )
        entry.needs(
            entry.name != "PBEAML" or kind not in LOPSIDED,
            f"PBEAML of the type {kind!r} has its neutral axis off the shear "
            "centre, which is not supported; give its constants by PBAR.",
        )
        count = DIMENSIONS[kind]
        first = self._dimensions(8, count, [None] * count)
        if entry.name == "PBEAML" and kind == "L":
            middle = np.array([first[2], first[3]]) / 2
            self.neutral[:] = profiles.centroid(WALLS["L"](*first)) - middle
        extra = entry.real(8 + count)
        stations = [(0.0, BeamProfile(self._shape(kind, first), extra, True))]
        start = 9 + count
        while entry.name == "PBEAML" and entry.words(start, start + 2):
            own = self._dimensions(start + 2, count, first)
            beside = entry.real(start + 2 + count, extra)
            one = BeamProfile(self._shape(kind, own), beside, True)
            stations.append((entry.real(start + 1, 1.0), one))
            start += 3 + count
        if kind not in ("ROD", "TUBE", "TUBE2", "BAR", "BOX"):
            self.told.append(
                f"the shear coefficients and the torsion constant that Nastran gives {entry.name} "
                f"{entry.text(0)} ({kind}), {profiles.THIN:g} and that of thin walls are taken"
            )
        return stations

    def _dimensions(self, start: int, count: int, blank: Sequence[float | None]) -> list[float]:
        d = [self.entry.real(start + k, blank[k]) for k in range(count)]
        full = self.entry.text(3).upper() == "TUBE" and d[0] > 0 and d[1] == 0
        self.entry.needs(min(d) > 0 or full, f"{self.entry.name} needs dimensions above 0.")
        return d

    def _shape(self, kind: str, d: Sequence[float]) -> profiles.Profile:
        try:
            if kind in FULL:
                return FULL[kind](*d)
            bredt = profiles.box_torsion(*d) if kind == "BOX1" else None
            found = profiles.walled(WALLS[kind](*d), bredt)
            return found if kind in ("L", "Z") else replace(found, mixed=0.0)
        except ValueError as error:
            raise self.entry.place.error(
                f"the dimensions of {self.entry.name} {self.entry.text(0)} do "
                f"not fit into each other for the type {kind!r}."
            ) from error


#: Cross-sections by closed forms, from dimensions, plane 1 upright.
FULL: dict[str, Callable[..., Any]] = {
    "ROD": lambda r: profiles.ellipse(2 * r, 2 * r),
    "TUBE": lambda outer, inner: profiles.tube(outer, outer - inner),
    "TUBE2": profiles.tube,
    "BAR": lambda width, h: profiles.rectangle(h, width),
    "BOX": lambda width, h, flange, web: profiles.box(h, width, (flange, web, flange, web)),
    "HEXA": lambda tip, width, h: profiles.hexagon(h, width, tip),
}
Walls = list[profiles.Wall]


def _i(h: float, low: float, top: float, web: float, t_low: float, t_top: float) -> Walls:
    middle = (t_low, h - t_top, -web / 2, web / 2)
    return [(0, t_low, -low / 2, low / 2), middle, (h - t_top, h, -top / 2, top / 2)]


def _t(width: float, h: float, flange: float, web: float) -> Walls:
    return [(h - flange, h, -width / 2, width / 2), (0, h - flange, -web / 2, web / 2)]


def _chan(width: float, h: float, web: float, flange: float) -> Walls:
    ends = [(0, flange, 0, width), (h - flange, h, 0, width)]
    return [ends[0], (flange, h - flange, 0, web), ends[1]]


def _h(between: float, legs: float, h: float, bar: float) -> Walls:
    a, b = between / 2, (between + legs) / 2
    return [(-h / 2, h / 2, a, b), (-h / 2, h / 2, -b, -a), (-bar / 2, bar / 2, -a, a)]


def _cross(arms: float, t: float, h: float, bar: float) -> Walls:
    a, b = t / 2, (t + arms) / 2
    return [(-h / 2, h / 2, -a, a), (-bar / 2, bar / 2, a, b), (-bar / 2, bar / 2, -b, -a)]


def _hat(h: float, t: float, top: float, brim: float) -> Walls:
    a, b = top / 2 - t, top / 2
    webs = [(t, h - t, -b, -a), (t, h - t, a, b)]
    return [(h - t, h, -b, b), *webs, (0, t, -b - brim, -a), (0, t, a, b + brim)]


def _z(arm: float, web: float, inner: float, h: float) -> Walls:
    flange, a = (h - inner) / 2, web / 2
    ends = [(0, flange, -a, a + arm), (h - flange, h, -a - arm, a)]
    return [*ends, (flange, h - flange, -a, a)]


def _box1(width: float, h: float, top: float, low: float, left: float, right: float) -> Walls:
    sides = [(low, h - top, 0, left), (low, h - top, width - right, width)]
    return [(0, low, 0, width), (h - top, h, 0, width), *sides]


#: Cross-sections of walls: rectangles from dimensions, plane 1 upright.
WALLS: dict[str, Callable[..., Walls]] = {
    "I": _i,
    "I1": lambda arms, web, inner, h: _i(
        h, arms + web, arms + web, web, (h - inner) / 2, (h - inner) / 2
    ),
    **{"T": _t, "T2": _t, "CHAN": _chan, "H": _h, "CROSS": _cross, "HAT": _hat},
    "T1": lambda flange, web, t_flange, t_web: [
        (-flange / 2, flange / 2, 0, t_flange),
        (-t_web / 2, t_web / 2, t_flange, t_flange + web),
    ],
    "CHAN1": lambda arm, web, inner, h: _chan(arm + web, h, web, (h - inner) / 2),
    "CHAN2": lambda leg, base, h, width: [
        (0, base, 0, width),
        (base, h, 0, leg),
        (base, h, width - leg, width),
    ],
    "L": lambda width, h, base, leg: [(0, base, 0, width), (base, h, 0, leg)],
    **{"Z": _z, "BOX1": _box1},
}
#: Supported cross-sections and the number of their dimensions.
DIMENSIONS = {
    **{"ROD": 1, "TUBE": 2, "TUBE2": 2, "BAR": 2, "BOX": 4, "HEXA": 3, "CROSS": 4, "H": 4},
    **{"I": 6, "I1": 4, "T": 4, "T1": 4, "T2": 4, "CHAN": 4, "CHAN1": 4, "CHAN2": 4, "HAT": 4},
    **{"BOX1": 6, "Z": 4, "L": 4},
}
