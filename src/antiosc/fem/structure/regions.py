"""Regions of space that select points: a ball, a box, a plane."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from antiosc._types import Array, BoolArray
from antiosc.checks import array, coordinates, nonnegative, shown
from antiosc.errors import InputError

#: What lies outside a region by this share of the size of the mesh belongs to it.
AT_FACE = 1e-6


@dataclass(frozen=True)
class Ball:
    """Points that are no further than `radius` (m) from `centre` (m)."""

    centre: tuple[float, ...]
    radius: float

    def __call__(self, x: Array, size: float | None = None) -> BoolArray:
        """Which points x (3, n) belong to it; `size`: of the mesh, m."""
        offset = x - np.reshape(self.centre, (3, 1))
        return np.asarray(np.linalg.norm(offset, axis=0) <= self.radius + _slack(x, size))

    def __str__(self) -> str:
        return f"within {self.radius:g} m of {_point(self.centre)}"


@dataclass(frozen=True)
class Box:
    """Points between `lower` and `upper` (m) in every direction."""

    lower: tuple[float, ...]
    upper: tuple[float, ...]

    def __call__(self, x: Array, size: float | None = None) -> BoolArray:
        """Which points x (3, n) belong to it; `size`: of the mesh, m."""
        slack = _slack(x, size)
        low, high = (np.reshape(corner, (3, 1)) for corner in (self.lower, self.upper))
        return np.asarray(((x >= low - slack) & (x <= high + slack)).all(axis=0))

    def __str__(self) -> str:
        return f"in the box from {_point(self.lower)} to {_point(self.upper)}"


@dataclass(frozen=True)
class Plane:
    """Points of the plane through `point` (m) across the unit vector `normal`."""

    point: tuple[float, ...]
    normal: tuple[float, ...]

    def __call__(self, x: Array, size: float | None = None) -> BoolArray:
        """Which points x (3, n) belong to it; `size`: of the mesh, m."""
        height = np.asarray(self.normal) @ (x - np.reshape(self.point, (3, 1)))
        return np.asarray(np.abs(height) <= _slack(x, size))

    def __str__(self) -> str:
        return f"on the plane through {_point(self.point)} across {_numbers(self.normal)}"


Region = Ball | Box | Plane


def ball(given: Any) -> Ball:
    """near=(point, radius)."""
    centre, radius = _pair("near", given, "(point, radius), as near=((0, 0, 0.1), 5e-3)")
    return Ball(_padded("the point of near", centre), nonnegative("the radius of near", radius))


def box(given: Any) -> Box:
    """box=(lower, upper)."""
    pair = _pair("box", given, "(lower, upper), as box=((0, 0, 0), (0.1, 0.2, 0.05))")
    lower, upper = (_padded("a corner of box", corner) for corner in pair)
    if any(low > high for low, high in zip(lower, upper, strict=True)):
        raise InputError(
            f"box=(lower, upper) has a lower corner {_numbers(lower)} above the upper corner "
            f"{_numbers(upper)} in some direction: exchange these coordinates."
        )
    return Box(lower, upper)


def plane(given: Any) -> Plane:
    """plane=(point, normal)."""
    pair = _pair("plane", given, "(point, normal), as plane=((0, 0, 0), (0, 0, 1))")
    point, normal = _padded("the point of plane", pair[0]), array("normal", pair[1], (None,))
    across = np.array(_padded("the normal of plane", normal))
    length = float(np.linalg.norm(across))
    if length == 0:
        raise InputError("the normal of plane must not be the zero vector.")
    return Plane(point, tuple((across / length).tolist()))


def _pair(name: str, given: Any, form: str) -> tuple[Any, Any]:
    if not isinstance(given, list | tuple) or len(given) != 2:
        raise InputError(f"{name} must be a pair {form}; got {shown(given)}.")
    return given[0], given[1]


def _padded(name: str, given: Any) -> tuple[float, ...]:
    """Three coordinates; z = 0 where there are two."""
    point = coordinates(name, given)
    return (*point, 0.0) if len(point) == 2 else tuple(point)


def _slack(x: Array, size: float | None) -> float:
    if size is None:
        size = float(np.linalg.norm(np.ptp(x, axis=1))) if x.shape[1] else 0.0
    return AT_FACE * size


def _point(point: tuple[float, ...]) -> str:
    return f"{_numbers(point)} m"


def _numbers(values: tuple[float, ...]) -> str:
    return "(" + ", ".join(f"{value:g}" for value in values) + ")"
