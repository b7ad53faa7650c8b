"""The law of a line contact: a cylinder along a plane or another cylinder."""

from __future__ import annotations

from math import pi

import numpy as np

from antiosc.base import checks
from antiosc.base._types import Array
from antiosc.base.errors import InputError
from antiosc.engine.contact.laws import HalfSpaceTable

#: Points of the table, …
POINTS = 100
#: … the first of which has this share of the last force.
FIRST = 1e-9
#: Half the width of the contact over its length and over the radius, up to which the law holds.
NARROW = 0.25


def line_indentation(force: Array, modulus: float, radius: float, length: float) -> Array:
    """Indentation [m] of a line contact under forces [N]; see `line_law`."""
    share = pi * modulus * length**3 / (radius * np.asarray(force))
    return np.asarray(force / (pi * modulus * length) * (1 + np.log(share)))


def line_law(modulus: float, radius: float, length: float) -> HalfSpaceTable:
    """Elastic law of a contact along a straight line.

    The contact has Hertz's pressure across the line over the half width b, b² = 4 F R/(π E* L), and
    the force is uniform along it. Both bodies are half-spaces to the field around it, whose surface
    moves in the middle by δ = F/(π E* L) (1 + ln(π E* L³/(F R))). The displacement of a cylinder
    between two planes differs from it: the logarithm then has the diameter in place of the length.

    Parameters
    ----------
    modulus : float
        E* [Pa] of both bodies.
    radius : float
        R [m], with 1/R the sum of the curvatures across the line.
    length : float
        Length of the line [m].

    Notes
    -----
    K. L. Johnson, Contact Mechanics (1985), (3.14) and (4.43)-(4.45); ESDU 78035.
    """
    modulus = checks.positive("modulus", modulus, "Pa")
    radius = checks.positive("radius", radius, "m")
    length = checks.positive("length", length, "m")
    if not np.isfinite(length):
        raise InputError("length must be finite: a line contact gives way more the longer it is.")
    return HalfSpaceTable(*line_curve(modulus, radius, length))


def line_curve(modulus: float, radius: float, length: float) -> tuple[Array, Array]:
    """Indentations [m] and forces [N] of a line contact, (POINTS + 1,) each; see `line_law`."""
    largest_force = pi * modulus * length * (NARROW * min(length, radius)) ** 2 / (4 * radius)
    force = largest_force * np.geomspace(FIRST, 1.0, POINTS)
    depth = line_indentation(force, modulus, radius, length)
    return np.append(0.0, depth), np.append(0.0, force)
