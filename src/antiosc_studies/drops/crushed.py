"""The contact law of a sharp corner that the floor presses flat, F = max(ball, 2.4 Y × cut) ± 40 %.

At first a sharp corner touches as a ball of the corner's radius. At larger indentations the edges
and faces beside the ball carry load too: the mean pressure of the ball, at most 2.4 times the yield
strength Y, acts on the whole cross-section of the part in the floor plane (the cut). The part is
taken as the cone of the facets at the corner, without the tip that the ball rounds off.
"""

from __future__ import annotations

from math import pi, sin

import numpy as np
from scipy.integrate import cumulative_trapezoid
from scipy.optimize import brentq, linprog

from antiosc import ContactLaw, ElasticPlastic, Tabulated
from antiosc.base._types import Array
from antiosc_studies.drops.free_body import FreeBody, State

#: Mean pressure on the cut over the yield strength: 1.9 to 2.9 for cones of 45° to balls (K. L.
#: Johnson, Contact Mechanics, 1985, 6.3).
PRESSURE_RATIO = 2.4
#: Relative error of the force of a sharp corner: the range of this pressure is 20 %; another radius
#: and cells larger than it each change the force of a plastic block by less than 30 %.
FORCE_ERROR = 0.4
#: Sine of the slope of an edge or a face beside the corner below which it lies flat.
LEAST_SLOPE_SINE = sin(np.radians(1.0))
#: Indentations of the tabulated law over that of the ball after the work.
DEPTH_RATIOS = np.geomspace(1e-3, 20.0, 80)
#: Largest share of the work that unloading returns, and of the indentation that remains as a dent.
LARGEST_RETURN, LARGEST_DENT = 0.95, 0.99


def corner_law(
    ball: ElasticPlastic, edges: Array, body: FreeBody, start: State, position: Array
) -> ContactLaw:
    """The contact law of a sharp corner of a body that touches in the state `start`.

    ball : law of the ball in the corner; edges : as for `cut_area_factor`, in the axes of the body;
    position : (3,) from the centre of mass to the corner [m].
    """
    up = start.R[2]
    work = _available_work(body, start, position)
    growth = cut_area_factor(edges, up)
    if growth is None:
        return ball
    return crushed_law(ball, growth, tip_height(edges, up, ball.radius), work)


def _available_work(body: FreeBody, start: State, position: Array) -> float:
    """Kinetic energy [J] that a vertical force at a position (3,) of the rigid body can absorb."""
    turning = np.cross(position, [0.0, 0.0, 1.0]) @ start.R
    inverse_mass = 1 / body.mass + float(turning @ body.inverse_inertia @ turning)
    speed = float((start.velocity + np.cross(start.spin(body), position))[2])
    return speed**2 / (2 * inverse_mass)


def crushed_law(ball: ElasticPlastic, area_factor: float, tip: float, work: float) -> ContactLaw:
    """The contact law of a corner that the floor presses flat.

    ball : law of the ball in the corner, which is returned if its force after the work `work` [J]
    is larger; area_factor : `cut_area_factor`; tip : `tip_height` [m].
    """
    depths = DEPTH_RATIOS * _depth_after(ball, work)
    of_ball = ball.forces_at_rest(depths, ball.touch(1.0))
    own_cut = 2 * pi * ball.radius * depths
    cut = np.maximum(area_factor * depths * (depths + 2 * tip), own_cut)

    pressure = np.minimum(of_ball / own_cut, PRESSURE_RATIO * ball.yield_strength)
    force = np.maximum(of_ball, pressure * cut)
    if force[np.searchsorted(DEPTH_RATIOS, 1.0)] <= of_ball[np.searchsorted(DEPTH_RATIOS, 1.0)]:
        return ball

    # below the cut the part gives way as under a punch; the law of the ball has that of its own
    gives = _punch_depth(ball, force, cut)
    depths = depths + np.maximum(gives - _punch_depth(ball, of_ball, own_cut), 0.0)
    x, F = (np.append(0.0, values) for values in (depths, force))

    # unloading goes back along the punch, and gives back no more than loading took
    works = cumulative_trapezoid(F, x)
    end = int(np.searchsorted(works, work).clip(0, len(depths) - 1))
    back = min(gives[end] / depths[end], LARGEST_RETURN * float((2 * works / (F * x)[1:]).min()))
    left = min(1 - back, LARGEST_DENT)
    return Tabulated(x, F, ([left * x[-1], x[-1]], [0.0, F[-1]]))


def cut_area_factor(edges: Array, up: Array) -> float | None:
    """Area of a horizontal cut through a corner over the square of its height; None if flat.

    edges : (n, 2, 3) two edges of each facet, from the corner; up : (3,) unit vector.
    """
    heights = edges @ up
    if (heights < LEAST_SLOPE_SINE * np.linalg.norm(edges, axis=2)).any():
        return None
    first, second = np.moveaxis(edges / heights[..., None], 1, 0)
    return float(abs((np.cross(first, second) @ up).sum()) / 2)


def tip_height(edges: Array, up: Array, radius: float) -> float:
    """Height [m] between a sharp corner and the lowest point of the ball of `radius` [m] in it.

    edges, up : as for `cut_area_factor`.
    """
    normals = np.cross(edges[:, 0], edges[:, 1])
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    lowest = linprog(up, A_ub=normals, b_ub=np.full(len(normals), -1.0), bounds=(None, None))
    return radius * max(float(lowest.fun) - 1.0, 0.0) if lowest.success else 0.0


def _punch_depth(law: ElasticPlastic, force: Array, area: Array) -> Array:
    """Indentation [m] of an elastic half-space by a round punch of this area (Johnson, (3.36))."""
    return np.asarray(force * np.sqrt(pi / area) / (2 * law.modulus))


def _depth_after(law: ElasticPlastic, work: float) -> float:
    """Indentation [m] at which the work of loading is `work` [J]."""
    high = law.yield_indentation
    while law.loading_work(high) < work:
        high *= 4
    return float(brentq(lambda depth: law.loading_work(depth) - work, 0.0, high, rtol=1e-9))
