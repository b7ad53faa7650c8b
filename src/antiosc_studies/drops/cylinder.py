"""A straight line of a cylindrical surface, along which a body may land."""

from __future__ import annotations

from dataclasses import dataclass
from math import pi

import numpy as np
from scipy.spatial import cKDTree

from antiosc.base._types import Array, BoolArray, IntArray

#: Number of stations of a line.
STATIONS = 7
#: Largest sine of the axis's inclination with which a cylinder lands along its line.
LEVEL = 0.02
#: Number of nodes from which the mode shapes at a station are interpolated.
NEAREST = 3


@dataclass(frozen=True, eq=False)
class Cylinder:
    """A part of the surface that is straight in one direction.

    Attributes
    ----------
    centre : (3,) middle of its axis, relative to the centre of mass [m]; axis : (3,) its direction.
    radius, length : radius and length of the cylinder [m].
    down, spread : (3,) direction to the middle of its arc, and half the angle of the arc [rad].
    compliance : compliance of the whole line, without the modes' and the half-space's part [m/N].
    material : (2,) Young's modulus [Pa] and Poisson's ratio.
    members : numbers of the body's points that lie on it.
    nodes, shapes : (M, 3) nodes relative to the centre of mass [m]; (M, J, 3) mode shapes there.
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
        """(STATIONS, 3) positions of the stations on the axis [m]."""
        return self.centre + np.outer(rule()[0] * self.length / 2, self.axis)

    def lands(self, up: Array) -> BoolArray:
        """Whether a body lands along this line; up (..., 3): the vertical in its axes."""
        level = np.abs(up @ self.axis) <= LEVEL
        faces_down = -up @ self.down >= np.cos(max(self.spread - LEVEL, 0.0))
        return np.asarray(level & (faces_down | (self.spread >= pi)))

    def shapes_at(self, up: Array) -> Array:
        """Mode shapes (STATIONS, J, 3) at the stations of the line for a vertical up (3,)."""
        distances, number = cKDTree(self.nodes).query(self.points - self.radius * up, NEAREST)
        weights = 1 / np.maximum(distances, 1e-9 * self.radius)
        weights /= weights.sum(axis=1, keepdims=True)
        return np.asarray(np.einsum("sn,snjd->sjd", weights, self.shapes[number]))


def rule() -> tuple[Array, Array]:
    """Nodes in [-1, 1] and weights (STATIONS,) of the Gauss-Lobatto rule; the weights sum to 1."""
    last = np.polynomial.legendre.Legendre.basis(STATIONS - 1)
    x = np.concatenate(([-1.0], np.sort(last.deriv().roots().real), [1.0]))
    return x, 1 / (STATIONS * (STATIONS - 1) * last(x) ** 2)
