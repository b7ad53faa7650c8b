"""Cross-sections of Nastran's beams: PBAR, PBARL, PBEAM, PBEAML, PBEND."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np

from antiosc_decks.model import properties as profiles
from antiosc_decks.nastran.cards import Entry

#: Supported cross-sections and the number of their dimensions.
DIMENSIONS = {
    **{"ROD": 1, "TUBE": 2, "TUBE2": 2, "BAR": 2, "BOX": 4, "HEXA": 3, "CROSS": 4, "H": 4},
    **{"I": 6, "I1": 4, "T": 4, "T1": 4, "T2": 4, "CHAN": 4, "CHAN1": 4, "CHAN2": 4, "HAT": 4},
    **{"BOX1": 6, "Z": 4, "L": 4},
}
#: Those whose centroid need not be their shear centre, on which the nodes of a CBEAM lie.
LOPSIDED = ("T", "T1", "T2", "CHAN", "CHAN1", "CHAN2", "HAT", "BOX1")


#: Of a second moment that is 0 the share of the other one that is taken.
SLIGHT = 1e-6


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
        self.stations: list[tuple[float, BeamProfile]] = read()
        self.stations.sort(key=lambda one: one[0])

    @property
    def tapered(self) -> bool:
        """Whether the cross-section changes along the beam."""
        first = _numbers(self.stations[0][1])
        return any(
            not np.allclose(_numbers(one), first, rtol=1e-6, atol=0) for _, one in self.stations
        )

    def at(self, s: float) -> BeamProfile:
        """The cross-section at s from 0 to 1, linear between stations."""
        places = [place for place, _ in self.stations]
        table = np.array([_numbers(one) for _, one in self.stations])
        A, first, second, mixed, J, extra = (float(np.interp(s, places, c)) for c in table.T)
        near = self.stations[0][1]
        mean, half = (first + second) / 2, math.hypot((first - second) / 2, mixed)
        angle = math.atan2(2 * mixed, first - second) / 2 if mixed else 0.0
        if mixed:
            first, second = mean + half, mean - half
        if min(A, first, second) <= 0:
            raise self.entry.place.error(
                f"{self.entry.name} needs A, I1 and I2 above 0, and I12² below I1 I2."
            )
        own = replace(near.profile, A=A, I=first, I_side=second, J=J or (first + second) / 2)
        return BeamProfile(own, extra, near.sheared, angle)

    # --- By constants -----------------------------------------------------------------------------

    def _by_constants(self) -> list[tuple[float, BeamProfile]]:
        entry = self.entry
        area, first, second = entry.real(2, None), *(entry.real(k) for k in (3, 4))
        ends: dict[float, list[float]] = {}
        label = f"{entry.name} {entry.text(0)}"
        if entry.name == "PBEND":
            torsion, extra, mixed = entry.real(5), entry.real(18), 0.0
            k1, k2 = entry.real(16), entry.real(17)
            last = 19
            if "." not in entry.text(2):  # a pipe by its mean radius and its wall
                self.told.append(f"the flexibility of {label} by the ovalization of pipes (FSI)")
                pipe = profiles.tube(entry.real(3) + entry.real(4) / 2, entry.real(4))
                area, first, second, torsion = pipe.A, pipe.I, pipe.I_side, pipe.J
                extra, k1, k2, last = entry.real(10), 0.0, 0.0, 11
            if entry.real(last) or entry.real(last + 1):
                raise entry.place.error("PBEND with RC or ZC is not supported; move its nodes.")
        elif entry.name == "PBAR":
            if max(first, second) > min(first, second) == 0:
                self.told.append(f"the hinge that {label} is where its I1 or I2 is 0, {SLIGHT:g} "
                                 "of the other is taken")  # fmt: skip
                first, second = (max(one, SLIGHT * max(first, second)) for one in (first, second))
            torsion, extra, mixed = entry.real(5), entry.real(6), entry.real(18)
            k1, k2 = entry.real(16), entry.real(17)
        else:
            mixed, torsion, extra = entry.real(5), entry.real(6), entry.real(7)
            ends, start = self._along([area, first, second, mixed, torsion, extra])
            k1, k2 = entry.real(start, 1.0), entry.real(start + 1, 1.0)
            self._beside(start)
        if min(area, first, second) <= 0:
            raise entry.place.error(f"{entry.name} needs A, I1 and I2 above 0.")
        shear = (k1 + k2) / 2 if k1 and k2 else 0.0
        if bool(k1) != bool(k2) or (shear and not math.isclose(k1, k2, rel_tol=1e-3)):
            what = "their mean is taken" if shear else "both planes are taken as rigid in shear"
            self.told.append(f"K1 and K2 of {label}, which differ: {what}")
        if not torsion:
            self.told.append(f"the missing torsion constant J of {label}, (I1 + I2)/2 is taken")
        rows = {0.0: [area, first, second, mixed, torsion, extra], **ends}
        return [
            (place, self._station(values, shear or profiles.RECTANGLE, shear > 0))
            for place, values in rows.items()
        ]

    def _station(self, values: Sequence[float], shear: float, sheared: bool) -> BeamProfile:
        area, first, second, mixed, torsion, extra = values
        profile = profiles.Profile(area, first, second, torsion, shear, mixed=mixed)
        return BeamProfile(profile, extra, sheared)

    def _along(self, start_values: list[float]) -> tuple[dict[float, list[float]], int]:
        """(values of PBEAM at further places, the field after them)."""
        entry, starts = self.entry, {}
        # the places of stresses at the first end may be left out
        start = 8 if entry.text(8).upper() in ("YES", "YESA", "NO") else 16
        while entry.text(start).upper() in ("YES", "YESA", "NO"):
            starts[entry.real(start + 1, None)] = start + 2
            start += 16 if entry.text(start).upper() == "YES" else 8
        ends: dict[float, list[float]] = {}
        last = start_values
        for place in sorted(starts, reverse=True):
            # blank at the end: as at the start; between the ends: linear
            blank = np.array(start_values) + place * (np.array(last) - start_values)
            first = starts[place]
            ends[place] = [
                entry.real(first + k) if entry.text(first + k) else float(blank[k])
                for k in range(6)
            ]
            if place == 1:
                last = ends[place]
        for place in ends:
            if not 0 < place <= 1:
                raise entry.place.error(f"X/XB of {entry.name} lies between 0 and 1.")
        if ends and 1.0 not in ends:
            raise entry.place.error(f"{entry.name} gives no section at X/XB = 1.")
        return ends, start

    def _beside(self, start: int) -> None:
        """What follows the sections of PBEAM."""
        entry = self.entry
        self.neutral[:] = np.reshape([entry.real(start + k) for k in range(12, 16)], (2, 2))
        for k, other in ((14, 12), (15, 13)):
            if not entry.text(start + k):  # as at the first end
                self.neutral[1, k - 14] = entry.real(start + other)
        label = f"PBEAM {entry.text(0)}"
        names = {2: "S1", 3: "S2", 4: "NSI(A)", 5: "NSI(B)", 6: "CW(A)", 7: "CW(B)"}
        names |= {8: "M1(A)", 9: "M2(A)", 10: "M1(B)", 11: "M2(B)"}
        given = [name for k, name in names.items() if entry.real(start + k)]
        if given:
            self.told.append(f"{', '.join(given)} of {label}")

    # --- By dimensions ----------------------------------------------------------------------------

    def _listed(self) -> list[tuple[float, BeamProfile]]:
        entry = self.entry
        kind = entry.text(3).upper()
        if kind not in DIMENSIONS:
            raise entry.place.error(
                f"{entry.name} of the type {kind!r} is not supported; give its "
                f"constants by PBAR, or take one of {', '.join(DIMENSIONS)}."
            )
        if entry.name == "PBEAML" and kind in LOPSIDED:
            raise entry.place.error(
                f"PBEAML of the type {kind!r} has its neutral axis off the shear "
                "centre, which is not supported; give its constants by PBAR."
            )
        count = DIMENSIONS[kind]
        first = self._dimensions(8, count, [])
        if entry.name == "PBEAML" and kind == "L":
            middle = np.array([first[2], first[3]]) / 2
            self.neutral[:] = profiles.centroid(_l(*first)) - middle
        extra = entry.real(8 + count)
        stations = [(0.0, BeamProfile(self._shape(kind, first), extra, True))]
        start = 9 + count
        while entry.name == "PBEAML" and any(entry.text(k) for k in range(start, start + 2)):
            place = entry.real(start + 1, 1.0)
            own = self._dimensions(start + 2, count, first)
            beside = entry.real(start + 2 + count, extra)
            stations.append((place, BeamProfile(self._shape(kind, own), beside, True)))
            start += 3 + count
        if not all(0 <= place <= 1 for place, _ in stations):
            raise entry.place.error(f"X/XB of {entry.name} lies between 0 and 1.")
        if len(stations) > 1 and stations[-1][0] != 1:
            raise entry.place.error(f"{entry.name} gives no section at X/XB = 1.")
        if kind not in ("ROD", "TUBE", "TUBE2", "BAR", "BOX"):
            self.told.append(
                f"the shear coefficients and the torsion constant that Nastran gives {entry.name} "
                f"{entry.text(0)} ({kind}), {profiles.THIN:g} and that of thin walls are taken"
            )
        return stations

    def _dimensions(self, start: int, count: int, otherwise: Sequence[float]) -> list[float]:
        entry = self.entry
        d = [
            otherwise[k] if otherwise and not entry.text(start + k) else entry.real(start + k, None)
            for k in range(count)
        ]
        hollow = entry.text(3).upper() == "TUBE"
        if min(d) <= 0 and not (hollow and d[0] > 0 and d[1] == 0):
            raise entry.place.error(f"{entry.name} needs dimensions above 0.")
        return d

    def _shape(self, kind: str, d: Sequence[float]) -> profiles.Profile:
        if kind == "ROD":
            return profiles.ellipse(2 * d[0], 2 * d[0])
        if kind in ("TUBE", "TUBE2"):
            return profiles.tube(d[0], d[0] - d[1] if kind == "TUBE" else d[1])
        if kind == "BAR":  # the width along plane 2, the height along plane 1
            return profiles.rectangle(d[1], d[0])
        if kind == "BOX":
            found = profiles.box(d[1], d[0], (d[2], d[3], d[2], d[3]))
            assert found is not None
            return found
        if kind == "HEXA":
            return profiles.hexagon(d[2], d[1], d[0])
        try:
            walls = WALLS[kind](*d)
            bredt = profiles.box_torsion(*d) if kind == "BOX1" else None
            found = profiles.walled(walls, bredt)
            return found if kind in ("L", "Z") else replace(found, mixed=0.0)
        except ValueError as error:
            raise self.entry.place.error(
                f"the dimensions of {self.entry.name} {self.entry.text(0)} do "
                f"not fit into each other for the type {kind!r}."
            ) from error


def _numbers(one: BeamProfile) -> list[float]:
    p = one.profile
    return [p.A, p.I, p.I_side, p.mixed, p.J, one.extra]


Walls = list[profiles.Wall]


def _i(h: float, low: float, top: float, web: float, t_low: float, t_top: float) -> Walls:
    return [
        (0, t_low, -low / 2, low / 2),
        (t_low, h - t_top, -web / 2, web / 2),
        (h - t_top, h, -top / 2, top / 2),
    ]


def _t(width: float, h: float, flange: float, web: float) -> Walls:
    return [(h - flange, h, -width / 2, width / 2), (0, h - flange, -web / 2, web / 2)]


def _chan(width: float, h: float, web: float, flange: float) -> Walls:
    across = (0, width)
    return [(0, flange, *across), (flange, h - flange, 0, web), (h - flange, h, *across)]


def _chan2(leg: float, base: float, h: float, width: float) -> Walls:
    return [(0, base, 0, width), (base, h, 0, leg), (base, h, width - leg, width)]


def _h(between: float, legs: float, h: float, bar: float) -> Walls:
    a = between / 2
    sides = [(-h / 2, h / 2, a, a + legs / 2), (-h / 2, h / 2, -a - legs / 2, -a)]
    return [*sides, (-bar / 2, bar / 2, -a, a)]


def _cross(arms: float, t: float, h: float, bar: float) -> Walls:
    sides = [(-bar / 2, bar / 2, s * t / 2, s * (t + arms) / 2) for s in (1, -1)]
    return [(-h / 2, h / 2, -t / 2, t / 2), *((a, b, min(c, d), max(c, d)) for a, b, c, d in sides)]


def _hat(h: float, t: float, top: float, brim: float) -> Walls:
    webs = [(t, h - t, -top / 2, t - top / 2), (t, h - t, top / 2 - t, top / 2)]
    brims = [(0, t, -top / 2 - brim, t - top / 2), (0, t, top / 2 - t, top / 2 + brim)]
    return [(h - t, h, -top / 2, top / 2), *webs, *brims]


def _l(width: float, h: float, base: float, leg: float) -> Walls:
    return [(0, base, 0, width), (base, h, 0, leg)]


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
    "T": _t,
    "T1": lambda flange, web, t_flange, t_web: [
        (-flange / 2, flange / 2, 0, t_flange),
        (-t_web / 2, t_web / 2, t_flange, t_flange + web),
    ],
    "T2": _t,
    "CHAN": _chan,
    "CHAN1": lambda arm, web, inner, h: _chan(arm + web, h, web, (h - inner) / 2),
    "CHAN2": _chan2,
    "H": _h,
    "CROSS": _cross,
    "HAT": _hat,
    "BOX1": _box1,
    "L": _l,
    "Z": _z,
}
