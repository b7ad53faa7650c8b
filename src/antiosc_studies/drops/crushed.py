"""A sharp corner that the floor presses flat: F = max(ball, 2.4 Y × cut), with ± 40 %.

A sharp corner touches as a ball of the corner's radius. Pressed in farther, edges and faces beside
the ball carry too: the mean pressure of the ball, at most 2.4 times the yield strength, acts on the
whole cut of the part by the floor. The part is the cone of the facets at the corner, less the tip
that the radius takes off.
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
PRESSURE = 2.4
#: Relative error of the force of a sharp corner: the range of this pressure is 20 %; another radius
#: and cells larger than it each change the force of a plastic block by less than 30 %.
FORCE_ERROR = 0.4
#: Sine of the least slope of an edge or a face beside the corner: below, it lies flat.
LEVEL_SINE = sin(np.radians(1.0))
#: Depths of the law over the depth of a ball.
DEPTHS = np.geomspace(1e-3, 20.0, 80)
#: Largest share of the work that unloading gives back, and of a depth that remains.
MOST_RETURNED, MOST_LEFT = 0.95, 0.99


def law_of_corner(
    ball: ElasticPlastic, edges: Array, body: FreeBody, start: State, arm: Array
) -> ContactLaw:
    """The law of a sharp corner of a body that touches in the state `start`.

    ball : law of the ball in the corner; edges : as for `cut_growth`, in the axes of the body;
    arm : (3,) from the centre of mass to the corner [m].
    """
    up = start.R[2]
    work = _work(body, start, arm)
    growth = cut_growth(edges, up)
    if growth is None:
        return ball
    return crushed(ball, growth, tip(edges, up, ball.radius), work)


def _work(body: FreeBody, start: State, arm: Array) -> float:
    """Kinetic energy [J] that a force at an arm (3,) of the rigid body can take."""
    turning = np.cross(arm, [0.0, 0.0, 1.0]) @ start.R
    inverse_mass = 1 / body.mass + float(turning @ body.inverse @ turning)
    speed = float((start.velocity + np.cross(start.spin(body), arm))[2])
    return speed**2 / (2 * inverse_mass)


def crushed(ball: ElasticPlastic, growth: float, tip: float, work: float) -> ContactLaw:
    """The law of a corner that the floor presses flat.

    ball : law of the ball in the corner, which is returned if it has the larger force after the
    work `work` [J]; growth : `cut_growth`; tip : height [m] that the ball takes off the corner.
    """
    depths = DEPTHS * _depth(ball, work)
    of_ball = ball.forces_at_rest(depths, ball.touch(1.0))
    own_cut = 2 * pi * ball.radius * depths
    cut = np.maximum(growth * depths * (depths + 2 * tip), own_cut)

    pressure = np.minimum(of_ball / own_cut, PRESSURE * ball.yield_strength)
    force = np.maximum(of_ball, pressure * cut)
    if force[np.searchsorted(DEPTHS, 1.0)] <= of_ball[np.searchsorted(DEPTHS, 1.0)]:
        return ball

    # below the cut the part gives way as under a punch; the law of the ball has that of its own
    gives = _punch(ball, force, cut)
    depths = depths + np.maximum(gives - _punch(ball, of_ball, own_cut), 0.0)
    x, F = (np.append(0.0, values) for values in (depths, force))

    # unloading goes back along the punch, and gives back no more than loading took
    works = cumulative_trapezoid(F, x)
    end = int(np.searchsorted(works, work).clip(0, len(depths) - 1))
    back = min(gives[end] / depths[end], MOST_RETURNED * float((2 * works / (F * x)[1:]).min()))
    left = min(1 - back, MOST_LEFT)
    return Tabulated(x, F, ([left * x[-1], x[-1]], [0.0, F[-1]]))


def cut_growth(edges: Array, up: Array) -> float | None:
    """Area of a horizontal cut through a corner over the square of its height; None if flat.

    edges : (n, 2, 3) two edges of each facet, from the corner; up : (3,) unit vector.
    """
    heights = edges @ up
    if (heights < LEVEL_SINE * np.linalg.norm(edges, axis=2)).any():
        return None
    first, second = np.moveaxis(edges / heights[..., None], 1, 0)
    return float(abs((np.cross(first, second) @ up).sum()) / 2)


def tip(edges: Array, up: Array, radius: float) -> float:
    """Height [m] between a sharp corner and the lowest point of the ball of `radius` [m] in it.

    edges, up : as for `cut_growth`.
    """
    normals = np.cross(edges[:, 0], edges[:, 1])
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    lowest = linprog(up, A_ub=normals, b_ub=np.full(len(normals), -1.0), bounds=(None, None))
    return radius * max(float(lowest.fun) - 1.0, 0.0) if lowest.success else 0.0


def _punch(law: ElasticPlastic, force: Array, area: Array) -> Array:
    """Indentation [m] of an elastic half-space by a round punch of this area (Johnson, (3.36))."""
    return np.asarray(force * np.sqrt(pi / area) / (2 * law.modulus))


def _depth(law: ElasticPlastic, work: float) -> float:
    """Indentation [m] up to which loading takes the work [J]."""
    high = law.yield_indentation
    while law.loading_work(high) < work:
        high *= 4
    return float(brentq(lambda depth: law.loading_work(depth) - work, 0.0, high, rtol=1e-9))
