"""Corners and edges that a floor presses flat, as balls that are as blunt.

A sharp vertex touches as a ball of the corner's radius. Pressed in by a share of this radius it is
no ball any more: edges and faces beside it carry too. It then touches as a larger ball, which has
the force of the flattened corner at equal work, so that its law is still that of a ball
(`ElasticPlastic`). The force of the flattened corner is a pressure on the cut of the part by the
floor, less what the radius rounds off; under it an elastic punch of this area gives way (Johnson,
*Contact Mechanics*, (3.36)).
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import combinations
from math import pi, sqrt

import numpy as np
from scipy.integrate import cumulative_trapezoid
from scipy.optimize import brentq
from scipy.spatial import cKDTree

from antiosc import ElasticPlastic
from antiosc.base._types import Array, IntArray
from antiosc.engine.contact.peak_error import force_after
from antiosc_studies.drops.cuts import cut_areas
from antiosc_studies.drops.floor import Floor, law_at
from antiosc_studies.drops.free_body import Blunt, FreeBody, State

#: A smooth vertex touches as a ball of its own curvature if that of its cut has its radius up to
#: this factor: beside an edge it has a part of its ball alone, and other vertices have the rest.
BROADER = 1.1
#: Depths over the size of the part at which its cut is computed.
DEPTHS = np.geomspace(1e-6, 0.3, 121)
#: Mean pressure on the cut of a flattened corner over the yield strength, its lowest and its
#: highest value.
PRESSURE, PRESSURES = 2.4, (1.9, 2.9)
#: Elastic indentation of a flattened corner over that of a punch, lowest and highest.
GIVES = (0.5, 2.0)
#: Radii over the assumed one between which its effect is told: half and double, and what these
#: change in the compliance of the part.
RADII = (0.4, 2.5)
#: Largest relative difference of the forces of a ball and of the corner for which it stands.
ALIKE = 0.02
#: Decimals to which normals of facets differ, and most normals of a corner that count.
DIGITS, FACES = 5, 12
#: Replaces 0 in denominators.
TINY = 1e-30
#: Least and largest radius of a ball over that of the corner.
ROUNDEST, FLATTEST = 0.1, 1e6


@dataclass(frozen=True, eq=False)
class Corner:
    """A sharp vertex over the floor.

    Attributes
    ----------
    law : that of a ball with the radius of the corner.
    depths, areas : (n,) [m], [m^2] of the cut of the part, whose corner is sharp.
    tip : depth over the radius that the rounding takes off.
    sagitta : height [m] of the facets of the mesh where the surface is round.
    hidden : its share by which the round surface is lower than the facets.
    """

    law: ElasticPlastic
    depths: Array
    areas: Array
    tip: float
    sagitta: float
    hidden: float = 0.5

    def rounded(self, law: ElasticPlastic) -> Array:
        """Areas (n,) [m^2] of the cut with the radius of a law."""
        lost = self.tip * law.radius + self.hidden * self.sagitta
        deeper = self.depths + lost
        sharp = np.interp(deeper, self.depths, self.areas)
        ball = np.minimum(2 * pi * law.radius * self.depths, sharp)
        return np.maximum(np.maximum(ball, sharp * (1 - (lost / deeper) ** 2)), TINY)

    def force_at(
        self, work: float, law: ElasticPlastic, pressure: float = PRESSURE, give: float = 1.0
    ) -> float:
        """Force [N] of the flattened corner after a work [J], by the constants of a law.

        `give`: elastic indentation over that of a punch.
        """
        return float(np.interp(work, *self._curve(law, pressure, give)[:2]))

    def area_at(self, work: float) -> float:
        """Area [m^2] of the flattened corner after a work [J]."""
        works, _, areas = self._curve(self.law)
        return float(np.interp(work, works, areas))

    def _curve(
        self, law: ElasticPlastic, pressure: float = PRESSURE, give: float = 1.0
    ) -> tuple[Array, Array, Array]:
        """Works (n,) [J], forces (n,) [N] and areas (n,) [m^2]."""
        d = self.depths
        touch = law.touch(1.0)
        of_ball = np.array([law.force(depth, 0.0, touch) for depth in d.tolist()])
        plastic = PRESSURE * law.yield_strength
        pressures = np.minimum(of_ball / (2 * pi * law.radius * d), plastic)
        pressures *= 1 + (pressure / PRESSURE - 1) * pressures / plastic
        areas = self.rounded(law)
        forces = np.maximum.accumulate(pressures * areas)
        # elastic indentations of punches; that of the ball is in its law
        punches = [F / np.sqrt(A) for F, A in ((forces, areas), (of_ball, 2 * pi * law.radius * d))]
        excess = np.maximum(punches[0] - punches[1], 0.0)
        elastic = give * excess * sqrt(pi) / (2 * law.modulus)
        d = np.maximum.accumulate(d + elastic)
        return np.asarray(cumulative_trapezoid(forces, d, initial=0.0)), forces, areas

    def differs(self, law: ElasticPlastic, work: float) -> bool:
        """Whether a ball has another force than the flattened corner after a work [J]."""
        return abs(force_after(law, work) / self.force_at(work, self.law) - 1) > ALIKE

    def ball(self, work: float) -> float:
        """Radius [m] of the ball that has the force of the flattened corner after a work [J]."""
        force = self.force_at(work, self.law)

        def excess(exponent: float) -> float:
            radius = self.law.radius * float(np.exp(exponent))
            return force_after(replace(self.law, radius=radius), work) - force

        ends = np.log([ROUNDEST, FLATTEST]).tolist()
        values = [excess(end) for end in ends]
        if values[0] > 0 or values[1] < 0:
            return self.law.radius * float(np.exp(ends[0] if values[0] > 0 else ends[1]))
        return self.law.radius * float(np.exp(brentq(excess, *ends, xtol=1e-3)))

    def shares(
        self, law: ElasticPlastic, depth: float, strengths: Sequence[float], assumed: bool
    ) -> dict[str, float]:
        """Relative errors of the force of its ball at a largest depth [m], by their causes.

        `strengths` [Pa]: others that the side which yields may have; `assumed`: whether nobody
        gave the radius.
        """
        work = law.loading_work(depth)
        force = self.force_at(work, self.law)
        radii = [share * self.law.radius for share in RADII] if assumed else []
        others = {
            PRESSING: [self.force_at(work, self.law, pressure) for pressure in PRESSURES],
            ELASTIC: [self.force_at(work, self.law, give=give) for give in GIVES],
            STRENGTH: [self.force_at(work, replace(self.law, yield_strength=y)) for y in strengths],
            RADIUS: [self.force_at(work, replace(self.law, radius=radius)) for radius in radii],
            BALL: [force_after(law, work)],
            FACETS: [
                replace(self, hidden=hidden).force_at(work, self.law) for hidden in (0.0, 1.0)
            ],
        }
        return {
            name: max((abs(other / force - 1) for other in found), default=0.0)
            for name, found in others.items()
        }


#: Causes of the error of a flattened corner.
PRESSING, STRENGTH = "the pressure on a flattened corner", "the range of the yield strength"
RADIUS, BALL = "the assumed corner radius", "the ball that stands for the corner"
FACETS = "the facets of the mesh"
ELASTIC = "the elasticity under a flattened corner"


def flatten(
    body: FreeBody, start: State, floor: Floor, which: IntArray, works: Mapping[int, float]
) -> None:
    """Blunt the sharp vertices of a body that may touch, in place.

    `which`: the points that may touch; `works`: number of a point -> its work [J] in a run before;
    without one that of the rigid body at the vertex alone.
    """
    skin = body.skin
    if skin is None or skin.half.any() or not len(skin.triangles) or body.layer_contact is not None:
        return
    done = body.cut | body.blunt.keys() | body.laws.keys()
    new = [k for k, i in enumerate(which.tolist()) if i not in done]
    if not new:
        return
    on_skin = cKDTree(skin.points).query(body.vertices[which] + body.centre)[1]
    places = body.points[which] - body.balls[which, None] * start.R[2]
    lowest = places[np.argmin(places @ start.R[2])]
    triangles = skin.outward
    corners = skin.points[triangles] - body.centre
    nearest = cKDTree(places).query(corners.mean(axis=1))[1]
    for k in new:
        i = int(which[k])
        vertex = int(on_skin[k])
        law = law_at(body, floor, i)
        if not isinstance(law, ElasticPlastic):
            continue
        depths = DEPTHS * body.extent
        own = corners[nearest == k]
        up = _level(start.R[2], places[k] - lowest)
        heights = (own - places[k]) @ up
        areas = cut_areas(own, heights, up, depths)
        tip, sagitta = 0.0, float(skin.sizes[vertex]) ** 2 / (8 * law.radius)
        if skin.sharp[vertex]:
            at = triangles[(triangles == vertex).any(axis=1)]
            tip, sagitta = _tip(skin.points[at], up), 0.0
        corner = Corner(law, depths, areas, tip, sagitta)
        work = works.get(i) or _work(body, start, i)
        radius, area = corner.ball(work), corner.area_at(work)
        if not area > TINY or (body.balls[i] and radius < BROADER * law.radius):
            continue  # a ball stays one
        body.cut.add(i)
        if skin.sharp[vertex] or not law.radius / BROADER < radius < BROADER * law.radius:
            share = min(1.0, law.radius / sqrt(area / pi))
            body.blunt[i] = Blunt(radius, share if skin.sharp[vertex] else 1.0, corner)


def _level(up: Array, apart: Array) -> Array:
    """The vertical (3,) turned until a vertex is as low as the lowest one, when it touches too."""
    length = float(np.linalg.norm(apart))
    if not length:
        return up
    along = apart / length
    level = up - (up @ along) * along
    return np.asarray(level / np.linalg.norm(level))


def _tip(facets: Array, up: Array) -> float:
    """Depth over the radius by which a ball in a corner of facets (n, 3, 3) is above its tip.

    It is the largest sum of the weights with which up to three of the normals make up the vertical
    (the dual of: the lowest centre that is a radius away from all facets).
    """
    normals = np.cross(facets[:, 1] - facets[:, 0], facets[:, 2] - facets[:, 0])
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    normals = np.unique(normals.round(DIGITS), axis=0)[:FACES]
    largest = 1.0
    for count in (1, 2, 3):
        for chosen in combinations(normals, count):
            weights, *_ = np.linalg.lstsq(np.array(chosen).T, -up, rcond=None)
            fits = np.allclose(weights @ np.array(chosen), -up, atol=10.0**-DIGITS)
            if fits and weights.min() > -(10.0**-DIGITS):
                largest = max(largest, float(weights.sum()))
    return largest - 1


def _work(body: FreeBody, start: State, i: int) -> float:
    """Kinetic energy [J] that a force on a vertex of the rigid body can take."""
    (arm,) = start.arms(body, [i])
    turning = np.cross(arm, [0.0, 0.0, 1.0]) @ start.R
    inverse_mass = 1 / body.mass + float(turning @ body.inverse @ turning)
    speed = float((start.velocity + np.cross(start.spin(body), arm))[2])
    return speed**2 / (2 * inverse_mass)
