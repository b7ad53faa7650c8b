"""Linear constraints of ends: `Weld`, `Ball`, `Hinge`, `Slider` at one point, and `Equation`."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from typing import ClassVar

import numpy as np
import scipy.sparse

from antiosc.base._types import Array
from antiosc.base.checks import checked_by, coordinates, number, shown, store
from antiosc.base.errors import InputError
from antiosc.fem.assembly.ends import End, Motion, checked_end, end_text, motion, tell_gap
from antiosc.fem.assembly.joint import NAME, Between, Held, Joint, Rows
from antiosc.fem.assembly.layout import Layout, Sparse
from antiosc.fem.structure.meshed import DISPLACEMENTS, ROTATIONS
from antiosc.fem.structure.placement import checked_axis, in_space

#: Points this share of the size of the assembly apart are one; coefficients this share apart too.
COINCIDENT = 1e-9
#: Share of a rotation that an end must have to be held by it.
HAS_ROTATION = 1 - 1e-6


@dataclass(frozen=True)
class _Pin(Between):
    point: Sequence[float] | None = field(default=None, metadata=checked_by(coordinates))
    name: str | None = field(default=None, metadata=NAME)

    def constraints(self, layout: Layout, held: Held, label: str) -> list[Rows]:
        """The displacements and rotations in which both ends move alike."""
        ends = motion(layout, self.a), motion(layout, self.b)
        tell_gap(layout, label, [(self.a, ends[0]), (self.b, ends[1])])
        x = ends[0].point if self.point is None else in_space(self.point)
        a, b = (
            carried(layout, label, end, one, x)
            for end, one in zip((self.a, self.b), ends, strict=True)
        )
        displacements, rotations = self._constrained()
        if layout.plane:
            displacements, rotations = (
                displacements[:, :2] @ np.eye(2, 3),
                rotations * np.array([0.0, 0.0, 1.0]),
            )
            displacements, rotations = (
                m[np.abs(m).max(axis=1) > 1e-9] for m in (displacements, rotations)
            )
        _check_rotations(label, self, rotations, a, b)
        apart = _apart(displacements, a.displacements, b.displacements)
        rotated = _apart(rotations, a.rotations, b.rotations)
        rows = scipy.sparse.vstack([layout.nothing(0), apart, rotated]).tocsr()
        rows.eliminate_zeros()
        if not rows.nnz:
            raise InputError(f"{label} joins nothing: both of its ends are the same point.")
        return [Rows.free(rows, label)]

    def _constrained(self) -> tuple[Array, Array]:
        """Directions (k, 3) in which displacements, and (l, 3) in which rotations are equal."""
        raise NotImplementedError


@dataclass(frozen=True)
class Weld(_Pin):
    """Two ends that have the same displacement and rotation at a point.

    Parameters
    ----------
    a, b : ends
        "part:group" (of several nodes: their mean motion), ("part", (x, y, z)), ("part", (x, y, z),
        radius): the mean motion of the surface within the radius of a point, as under a screw's
        head, or the name of a reference point.
    point : sequence of floats, optional
        Where they are joined, m; default: the point, or the centroid, of `a`. Ends that lie
        elsewhere are connected to it rigidly.
    name : str, optional
        What messages call the joint.
    """

    def _constrained(self) -> tuple[Array, Array]:
        return np.eye(3), np.eye(3)


@dataclass(frozen=True)
class Ball(_Pin):
    """Two ends that have the same displacement at a point and rotate freely.

    Parameters as for `Weld`.
    """

    def _constrained(self) -> tuple[Array, Array]:
        return np.eye(3), np.zeros((0, 3))


@dataclass(frozen=True)
class _Axis(_Pin):
    axis: Sequence[float] = field(default=(0.0, 0.0, 1.0), metadata=checked_by(checked_axis))

    #: whether the axis is that of a rotation
    _turns_about_axis: ClassVar[bool] = True

    def constraints(self, layout: Layout, held: Held, label: str) -> list[Rows]:
        """As of every pin; in a plane the axis must be one about or along which parts move."""
        rotated = abs(self.axis[2]) / float(np.linalg.norm(self.axis))
        across = self._turns_about_axis
        if layout.plane and abs(rotated - across) > COINCIDENT:
            raise InputError(
                f"{label}: plane parts rotate about z and slide along x and y; the axis "
                f"{tuple(self.axis)} allows neither."
            )
        return super().constraints(layout, held, label)

    def _across(self) -> Array:
        """Two unit vectors (2, 3) across the axis."""
        unit = np.array(self.axis) / np.linalg.norm(self.axis)
        first = np.cross(unit, np.eye(3)[np.argmin(np.abs(unit))])
        first /= np.linalg.norm(first)
        return np.vstack([first, np.cross(unit, first)])


@dataclass(frozen=True)
class Hinge(_Axis):
    """Two ends that can only rotate relative to each other about an axis through a point.

    Parameters as for `Weld`, and

    axis : sequence of 3 floats
        Direction of the axis in the assembly, default z.
    """

    def _constrained(self) -> tuple[Array, Array]:
        return np.eye(3), self._across()


@dataclass(frozen=True)
class Slider(_Axis):
    """Two ends that can only move relative to each other along an axis.

    Parameters as for `Hinge`.
    """

    _turns_about_axis: ClassVar[bool] = False

    def _constrained(self) -> tuple[Array, Array]:
        return self._across(), np.eye(3)


def carried(layout: Layout, label: str, end: End, own: Motion, x: Array) -> Motion:
    """The motion of an end at x, to which it is connected rigidly."""
    arm = x - own.point
    length = float(np.linalg.norm(arm))
    if length <= COINCIDENT * layout.size:
        return replace(own, point=x)
    unit = arm / length
    across = np.eye(3) - np.outer(unit, unit)
    if layout.plane:
        across = layout.rotations
    missing = across @ (np.eye(3) - own.rotation_space) @ across
    if np.abs(missing).max() > 1 - HAS_ROTATION:
        raise InputError(
            f"{label} lies {length:.3g} m away from {end_text(end)}, which has no rotation to "
            "carry it there: points of solids do not rotate; give a group of faces, or a point "
            "where the joint is."
        )
    return own.at(x)


def _apart(directions: Array, a: Sparse, b: Sparse) -> Sparse:
    """b − a along directions (k, 3), without entries that are the rounding of equal ones."""
    along = scipy.sparse.csr_matrix(directions)
    found = (along @ (b - a)).tocsr()
    distinct = abs(found) > COINCIDENT * (abs(along) @ (abs(a) + abs(b)))
    return found.multiply(distinct).tocsr()


def _check_rotations(label: str, joint: _Pin, rotations: Array, a: Motion, b: Motion) -> None:
    """InputError where an end does not have a rotation that the joint holds."""
    for end, one in ((joint.a, a), (joint.b, b)):
        for direction in rotations:
            if direction @ one.rotation_space @ direction < HAS_ROTATION * (direction @ direction):
                raise InputError(
                    f"{label} holds a rotation that {end_text(end)} does not have: a point of a "
                    "solid, or a straight row of them, does not rotate; give a group of faces, a "
                    'radius, ("part", point, radius), or use a Ball.'
                )


@dataclass(frozen=True)
class Equation(Joint):
    """Σ coefficient · component = 0 of displacements (m) and rotations (rad).

    Parameters
    ----------
    terms : sequence of (end, component, coefficient)
        `end` as for `Weld`; `component` is "x", "y", "z", "rx", "ry" or "rz" in the axes of the
        assembly.
    name : str, optional
        What messages call the equation.
    """

    terms: Sequence[tuple[End, str, float]]
    name: str | None = field(default=None, metadata=NAME)

    def __post_init__(self) -> None:
        if not isinstance(self.terms, Sequence) or isinstance(self.terms, str) or not self.terms:
            raise InputError(
                f"terms must list (end, component, coefficient); got {shown(self.terms)}."
            )
        terms = tuple(_checked_term(term) for term in self.terms)
        if not any(coefficient for _, _, coefficient in terms):
            raise InputError("an Equation needs a coefficient that is not 0.")
        store(self, terms=terms)
        super().__post_init__()

    def constraints(self, layout: Layout, held: Held, label: str) -> list[Rows]:
        """The one row of the equation."""
        total = layout.nothing(1)
        for end, component, coefficient in self.terms:
            own = motion(layout, end, partly=True)
            row = own.components([component])
            if own.lacking([component]):
                raise InputError(
                    f"{label}: {end_text(end)} has no component {component!r}; points of solids "
                    "have no rotations, plane parts move along x and y, a site of a model along "
                    "its direction."
                )
            total = total + coefficient * row
        total = total.tocsr()
        total.eliminate_zeros()
        if not total.nnz:
            raise InputError(f"{label} says 0 = 0: its terms cancel.")
        return [Rows(total, np.full(1, -1), label)]


def _checked_term(term: object) -> tuple[End, str, float]:
    if not isinstance(term, tuple | list) or len(term) != 3:
        raise InputError(
            f"a term must be (end, component, coefficient), as (('plate', (0, 0, 0)), 'z', 1.0); "
            f"got {shown(term)}."
        )
    end, component, coefficient = term
    if not isinstance(component, str) or component not in DISPLACEMENTS + ROTATIONS:
        raise InputError(
            f"a component must be one of {', '.join(DISPLACEMENTS + ROTATIONS)}; "
            f"got {shown(component)}."
        )
    return checked_end("end", end), component, number("a coefficient", coefficient)
