"""Nastran's coordinate systems: CORD1 and CORD2, rectangular, cylindrical, spherical."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass

import numpy as np

from antiosc.io.deck import Array, Place
from antiosc_decks.nastran.cards import Entry


@dataclass(frozen=True)
class System:
    """A coordinate system: its origin, its axes as rows, and its kind."""

    origin: Array
    axes: Array
    #: "R", "C" (r, θ in degrees, z) or "S" (r, θ from z, φ in degrees)
    kind: str = "R"

    def point(self, c: Array) -> Array:
        """The point with coordinates `c`, in the basic system."""
        if self.kind != "R":
            theta, phi = math.radians(c[1]), math.radians(c[2 if self.kind == "S" else 1])
            across, up = (c[0], c[2]) if self.kind == "C" else (
                c[0] * math.sin(theta), c[0] * math.cos(theta))  # fmt: skip
            c = np.array([across * math.cos(phi), across * math.sin(phi), up])
        return np.asarray(self.origin + c @ self.axes)

    def frame(self, x: Array) -> Array:
        """Unit vectors (3, 3), as rows, of the system's directions at the point `x`."""
        if self.kind == "R":
            return self.axes
        a, b, c = self.axes @ (x - self.origin)
        phi = math.atan2(b, a)
        outward = np.array([math.cos(phi), math.sin(phi), 0.0])
        around = np.array([-outward[1], outward[0], 0.0])
        up = np.array([0.0, 0.0, 1.0])
        rows = [outward, around, up]
        if self.kind == "S":
            theta = math.atan2(math.hypot(a, b), c)
            sine, cosine = math.sin(theta), math.cos(theta)
            rows = [sine * outward + cosine * up, cosine * outward - sine * up, around]
        return np.asarray(np.stack(rows) @ self.axes)


BASIC = System(np.zeros(3), np.eye(3))


def axes_of(points: list[Array], entry: Entry) -> System:
    """The system of three points: its origin, x to the second, z across all."""
    a = points[0]
    x, arm = points[1] - a, points[2] - a
    z, size = np.cross(x, arm), np.linalg.norm(x)
    apart = np.linalg.norm(z) > 1e-12 * size * np.linalg.norm(arm)
    entry.needs(apart, f"the three points of {entry.name} lie on one line.")
    x, z = x / size, z / np.linalg.norm(z)
    return System(a, np.stack([x, np.cross(z, x), z]))


class Systems:
    """The coordinate systems of a deck, each computed when it is first used."""

    def __init__(self, entries: list[Entry], node: Callable[[int, Place], Array]) -> None:
        self._node = node
        self._placed: dict[int, System] = {}
        self._open: set[int] = set()
        self._given: dict[int, tuple[Entry, int]] = {}
        self._moved: Mapping[int, System] = {}
        for entry in entries:
            if entry.name.startswith("CORD1"):
                for start in (0, 4):
                    if entry.text(start):
                        self._give(entry, start, 4)
            elif entry.name.startswith("CORD2"):
                self._give(entry, 0, 16)

    def move(self, moved: Mapping[int, System]) -> None:
        """Parts of the deck lie elsewhere: scope -> where their basic system is."""
        self._moved = moved
        self._placed.clear()

    def _give(self, entry: Entry, start: int, width: int) -> None:
        """Define a system; MeshError if it is defined otherwise, too."""
        known, first = self._given.setdefault(entry.number(start), (entry, start))
        alike = known.name == entry.name and all(
            known.text(first + k) == entry.text(start + k) for k in range(width)
        )
        entry.needs(alike, f"the coordinate system {entry.text(start)} is defined more than once, "
                    f"first otherwise in {known.place}.")  # fmt: skip

    def __call__(self, number: int, place: Place) -> System:
        """The system `number`; MeshError if there is none, or it depends on itself."""
        own = number
        if not number:
            return self._moved.get(place.scope, BASIC)
        number += place.scope
        if number not in self._placed:
            place.needs(number in self._given, f"there is no coordinate system {own}.")
            if number in self._open or len(self._open) > 200:
                raise place.error(f"the coordinate system {own} depends on itself.")
            self._open.add(number)
            self._placed[number] = self._place(*self._given[number])
            self._open.discard(number)
        return self._placed[number]

    def _place(self, entry: Entry, start: int) -> System:
        if entry.name.startswith("CORD1"):
            points = [self._node(entry.whole(start + k), entry.place) for k in (1, 2, 3)]
        else:
            base = self(entry.whole(1, 0), entry.place)
            points = [base.point(np.array(entry.reals(k, k + 3))) for k in (2, 5, 8)]
        z, x, y = axes_of(points, entry).axes  # z to the second point, y across all
        return System(points[0], np.stack([x, y, z]), entry.name[-1])
