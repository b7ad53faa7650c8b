"""A cylindrical part of the surface of a body, on the straight line of which it may land."""

from __future__ import annotations

from dataclasses import dataclass
from math import pi

import numpy as np
from scipy.spatial import cKDTree

from antiosc.base._types import Array, BoolArray, IntArray

#: Number of stations of a line.
STATIONS = 7
#: Sine of the inclination of the axis up to which a cylinder lands along its line.
LEVEL = 0.02
#: Nodes from which the shapes of the modes at a station are taken.
NEAREST = 3


@dataclass(frozen=True, eq=False)
class Cylinder:
    """A part of the surface that is straight in one direction.

    Attributes
    ----------
    centre : (3,) of its axis, relative to the centre of mass [m]; axis : (3,) its direction.
    radius, length : [m].
    down, spread : (3,) direction of the middle of its arc, and half the angle of it [rad].
    compliance : of the whole line without modes and half-space [m/N].
    material : (2,) Young's modulus [Pa] and Poisson's ratio.
    members : numbers of the points of the body on it.
    nodes, shapes : (M, 3) nodes relative to the centre of mass [m], and (M, J, 3) the modes there.
    """

    centre: Array
    axis: Array
    radius: float
    length: float
    down: Array
    spread: float
    compliance: float
    material: Array
    members: IntArray
    nodes: Array
    shapes: Array

    @property
    def points(self) -> Array:
        """(STATIONS, 3) of the axis [m]."""
        return self.centre + np.outer(rule()[0] * self.length / 2, self.axis)

    def lands(self, up: Array) -> BoolArray:
        """Whether a body with verticals up (..., 3), in its axes, lands along this line."""
        level = np.abs(up @ self.axis) <= LEVEL
        inside = -up @ self.down >= np.cos(max(self.spread - LEVEL, 0.0))
        return np.asarray(level & (inside | (self.spread >= pi)))

    def shapes_at(self, up: Array) -> Array:
        """Mode shapes (STATIONS, J, 3) at the stations of the line for a vertical up (3,)."""
        away, number = cKDTree(self.nodes).query(self.points - self.radius * up, NEAREST)
        weights = 1 / np.maximum(away, 1e-9 * self.radius)
        weights /= weights.sum(axis=1, keepdims=True)
        return np.asarray(np.einsum("sn,snjd->sjd", weights, self.shapes[number]))


def rule() -> tuple[Array, Array]:
    """Nodes and weights (STATIONS,) of the Gauss-Lobatto rule; the weights add up to 1."""
    last = np.polynomial.legendre.Legendre.basis(STATIONS - 1)
    x = np.concatenate(([-1.0], np.sort(last.deriv().roots().real), [1.0]))
    return x, 1 / (STATIONS * (STATIONS - 1) * last(x) ** 2)
