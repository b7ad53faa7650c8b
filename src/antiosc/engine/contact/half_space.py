"""Stresses in a half-space under Hertz's pressure on a circle.

M. T. Huber, Annalen der Physik 319 (1904) 153; A. C. Fischer-Cripps, *Introduction to Contact
Mechanics*, Springer 2007, (5.4.2).
"""

from __future__ import annotations

from math import pi

import numpy as np

from antiosc.base._types import Array

#: Least distance from the axis over the radius: the formulas divide by it.
AXIS = 1e-4
#: Least depth over the radius: at the edge of the circle the formulas divide by 0 on the surface.
SURFACE = 1e-8


def hertz_stresses(force: float, radius: float, nu: float, r: Array, z: Array) -> Array:
    """Stresses [Pa] rr, tt, zz, rz (4, …) at distances r from the axis and depths z >= 0 [m].

    `force` [N] is spread over a circle of `radius` [m] by Hertz's pressure.
    """
    a = radius
    r, z = np.maximum(r, AXIS * a), np.maximum(z, SURFACE * a)
    beyond = r**2 + z**2 - a**2
    root = np.hypot(beyond, 2 * a * z)
    inside = beyond < 0
    u = np.where(inside, 0.0, (beyond + root) / 2)
    np.divide(2 * (a * z) ** 2, root - beyond, out=u, where=inside)
    squared = np.where(inside, (root - beyond) / (2 * a**2), 0.0)  # z^2/u
    np.divide(2 * z**2, root + beyond, out=squared, where=~inside)
    share = np.sqrt(squared)
    of_angle = (1 + nu) * np.sqrt(u) / a * np.arctan2(a, np.sqrt(u))
    of_depth = u * (1 - nu) / (a**2 + u)
    lateral = (1 - 2 * nu) / 3 * (a / r) ** 2 * (1 - share**3)
    along = a**2 / (u + a**2 * squared)
    rr = lateral + share**3 * along + share * (of_depth + of_angle - 2)
    tt = -lateral - share * (2 * nu + of_depth - of_angle)
    rz = -r * squared / (u + a**2 * squared) * a**2 * np.sqrt(u) / (a**2 + u)
    return 1.5 * force / (pi * a**2) * np.stack([rr, tt, -(share**3) * along, rz])


def von_mises(stresses: Array) -> Array:
    """Von Mises stress [Pa] (…) of stresses rr, tt, zz, rz (4, …)."""
    rr, tt, zz, rz = stresses
    squares = (rr - tt) ** 2 + (tt - zz) ** 2 + (zz - rr) ** 2
    return np.sqrt(squares / 2 + 3 * rz**2)
