"""Nastran's coordinate systems, and parts of a deck, which have scopes of their own.

CORD1 and CORD2, rectangular, cylindrical, spherical. Parts (BEGIN SUPER) number their nodes,
materials and properties anew: where they give one number to different things, or SELOC moves a
part, each part has a scope, which is added to its numbers. Nodes of two such parts that coincide
are one node, but for parts that SEBULK joins by SECONCT alone (MANUAL).
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, replace

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


# --- Parts ----------------------------------------------------------------------------------------


#: Above all numbers of a part.
SCOPE = 10**10
#: Beginnings of the names of entries that define what others name.
DEFINED = ("GRID", "P", "MAT", "CORD")
#: Nodes of two parts that are nearer are one, in the deck's unit.
NEAR = 1e-5


def scope_parts(entries: list[Entry]) -> None:
    """Set the scopes of the entries, where the parts need them."""
    part, found = 0, []
    known: dict[tuple[str, str], tuple[int, list[str]]] = {}
    clash = any(entry.name == "SELOC" for entry in entries)
    for entry in entries:
        part = entry.whole(0) if entry.name == "BEGIN SUPER" else part
        found.append(part)
        if entry.name.startswith(DEFINED) and entry.name not in ("PARAM", "PLOTEL"):
            other, fields = known.setdefault((entry.name, entry.text(0)), (part, entry.fields))
            clash = clash or (other != part and fields != entry.fields)
    for entry, part in zip(entries, found, strict=True):
        if clash and part:
            entry.place = replace(entry.place, scope=part * SCOPE)


def label_of(number: int) -> str:
    """The name of a property of a part."""
    part, own = divmod(number, SCOPE)
    return f"{own}" + (f" of part {part}" if part else "")


def place_in(entries: list[Entry], entry: Entry, k: int) -> Place:
    """The place of an entry as if it stood in the part that its field k names."""
    scoped = any(one.place.scope for one in entries)
    return replace(entry.place, scope=entry.whole(k, 0) * SCOPE * scoped)


def moved_parts(
    entries: list[Entry], node: Callable[[int, Place], Array], systems: Systems
) -> dict[int, System]:
    """Scope of a part -> where SELOC moves its basic system: three of its nodes to three others."""
    points = {entry.whole(0): entry for entry in entries if entry.name == "POINT"}
    found = {}

    def aim(number: int, place: Place) -> Array:
        if number not in points:
            return node(number, place)
        at = points[number]
        return systems(at.whole(1, 0), at.place).point(np.array(at.reals(2, 5)))

    for entry in entries:
        if entry.name == "SELOC":
            own = place_in(entries, entry, 0)
            a = axes_of([node(entry.whole(k), own) for k in (1, 2, 3)], entry)
            b = axes_of([aim(entry.whole(k), entry.place) for k in (4, 5, 6)], entry)
            turn = a.axes.T @ b.axes
            found[own.scope] = System(b.origin - a.origin @ turn, turn)
    return found


def coincident(
    grids: list[Entry], points: Array, entries: list[Entry]
) -> Iterator[tuple[int, int]]:
    """Pairs (row, row of an earlier node) of nodes of two parts in one place."""
    scopes = np.array([grid.place.scope for grid in grids])
    manual = {one.whole(0) * SCOPE for one in entries if one.name == "SEBULK"
              and one.text(3).upper() == "MANUAL"}  # fmt: skip
    if not scopes.any():
        return
    from scipy.spatial import cKDTree  # few decks need it, and it loads slowly

    done: set[int] = set()
    for first, second in sorted(cKDTree(points[: len(grids)]).query_pairs(NEAR)):
        apart = scopes[first] != scopes[second]
        if apart and second not in done and not {scopes[first], scopes[second]} & manual:
            done.add(second)
            yield second, first
