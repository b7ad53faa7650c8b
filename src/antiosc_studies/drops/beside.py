"""The force of the surface beside the points of a contact, for the error bar of their force.

Vertices of the mesh stand for the surface. A vertex that the floor presses flat has what the floor
cuts of the part next to it (`blunt`), with the edges there; then only the division of the cut among
the vertices is in doubt. Elsewhere, as with facets that are higher than the dent, a line or a face
beside the points may touch too, and the bar holds what it carries at most. Of a latch of ABS that
fell onto six sides, round edges of 0.2 to 1.4 mm on its line bounds gave bars of 60 to 480 %; an
elastic half-space that yields at 2.4 times the strength carries 0.76 to 1.03 times the forces.
"""

from __future__ import annotations

from dataclasses import replace
from math import pi, sqrt

import numpy as np
from scipy.integrate import cumulative_trapezoid
from scipy.spatial import cKDTree
from scipy.special import ellipkm1

from antiosc.base._types import Array
from antiosc.engine.contact.geometry import effective_modulus
from antiosc_studies.drops.blunt import DEPTHS as OF_EXTENT, TINY
from antiosc_studies.drops.cuts import cut_areas
from antiosc_studies.drops.episode import Episode
from antiosc_studies.drops.floor import Floor
from antiosc_studies.drops.free_body import FreeBody
from antiosc_studies.drops.lines import TABOR, force_along
from antiosc_studies.drops.skin import Skin

#: Cause of the error by the surface beside a corner.
BESIDE = "an edge or a face beside the corner that meets the floor almost flat"
#: Cause of the error by the cut that the vertices divide among them.
BETWEEN = "the division of the dent among the vertices of the part"
#: Elastic force of a line over that of an elliptic punch. Of 15 steel cylinders of 20 x 50 mm (five
#: rolls, cells of 2, 4 and 10 mm) without their line the bars lacked 3 and 4 % of the force in two
#: cases with 1, and nothing with 1.3.
STIFFER = 1.3
#: Depths over the dent at which the cut of the surface is computed.
DEPTHS = np.geomspace(1e-3, 10.0, 61)


def share_beside(floor: Floor, current: Episode) -> float:
    """Force that the surface beside the points carries at most, over that of the points."""
    peak = current.peak_force()
    if not peak:
        return 0.0
    line = current.rough_line
    if line is not None and _solid_skin(current.body) is None:
        energy, *_ = current.start.energies(current.body, 0.0)
        matter = _matter(floor, current, line.point)
        return force_along(matter, line.radius, line.length, energy) / peak
    beside = max(_force_of_cut(floor, current) - peak, _force_beside_balls(floor, current))
    return max(beside / peak, 0.0)


def share_between(current: Episode) -> float:
    """Relative change of the force if the whole part had one cut, as it lies at its largest force.

    Each vertex has the cut of the surface next to it, as the part lies at the touch. Rounded edges
    of ABS of 90° that fell inclined by 3° and lay inclined by 1.9° at the largest force had 1.33 to
    1.5 times the force of a half-space with their shape, and 1.31 times that of their one cut.
    """
    pressed = current.at_peak
    blunt = current.body.blunt.get(int(pressed.points[0])) if len(pressed.points) else None
    if blunt is None or not current.complete(np.isin(current.which, pressed.points)):
        return 0.0
    depths = OF_EXTENT * current.body.extent
    whole = replace(blunt.corner, depths=depths, areas=_areas(current, depths, is_raised=False))
    return abs(whole.force_at(pressed.work, whole.law) / current.peak_force() - 1)


def _solid_skin(body: FreeBody) -> Skin | None:
    """The surface of a solid; None of a body without one, or with sheets."""
    skin = body.skin
    return None if skin is None or skin.half.any() or not len(skin.triangles) else skin


def _areas(current: Episode, depths: Array, is_raised: bool) -> Array:
    """Areas (n,) [m^2] of the cuts of a solid at depths (n,) [m] below its lowest vertex, as it
    lies at its largest force. `is_raised`: with its facets as far out as its round surface.
    """
    skin = _solid_skin(current.body)
    assert skin is not None
    up = current.at_peak.up
    heights = skin.points @ up
    heights -= heights.min()
    if is_raised:
        heights -= skin.sagittas
    triangles = skin.outward
    return cut_areas(skin.points[triangles], heights[triangles], up, depths)


def _force_of_cut(floor: Floor, current: Episode) -> float:
    """Upper bound [N] of the force of the surface at the work of the contacts; 0 if they have it.

    It is the lower one of Tabor's pressure on the area of the cut of the part by the floor, at the
    work of the contacts, and of the elastic force of a flat punch with this area, at their work
    with that of the patches. Along a line the cut is that of the round surface over the facets,
    and the punch is slender.
    """
    body = current.body
    skin = _solid_skin(body)
    pressed = current.at_peak
    line = current.rough_line
    if skin is None or not len(pressed.points):
        return 0.0
    if line is None:
        nearest = cKDTree(skin.points).query(body.points[pressed.points] + body.centre)[1]
        has_all = current.complete(np.isin(current.which, pressed.points))
        if has_all or not skin.sharp[nearest].any():
            return 0.0
    d = DEPTHS * current.deepest
    area = _areas(current, d, is_raised=line is not None)
    modulus, strength = _matter(floor, current, int(pressed.points[0]))
    punch = 2 * modulus * np.sqrt(area / pi) * d
    if line is not None:
        punch *= STIFFER / _slender(line.length, area)
    crushed = _after(pressed.work, d, TABOR * strength * area)
    return float(np.fmin(crushed, _after(pressed.with_patches, d, punch)))


def _after(work: float, depths: Array, forces: Array) -> float:
    """Force [N] after a work [J], of forces (n,) at depths (n,) [m]."""
    return float(np.interp(work, cumulative_trapezoid(forces, depths, initial=0.0), forces))


def _slender(length: float, areas: Array) -> Array:
    """Compliances of elliptic punches of a length [m] over those of round ones with their areas.

    Half axes a > b give way by F K(√(1 - b²/a²))/(πE*a), and a = b by F/(2E*a) (Johnson, *Contact
    Mechanics*, (3.36)).
    """
    ratio = np.clip(4 * areas / (pi * length**2), TINY, 1.0)
    return np.asarray(2 / pi * ellipkm1(ratio**2) * np.sqrt(ratio))


def _force_beside_balls(floor: Floor, current: Episode) -> float:
    """Tabor's pressure [N] on what the floor cuts of the part next to balls, outside of them."""
    body = current.body
    skin = _solid_skin(body)
    depths = current.sunk()
    whole = np.isin(current.which, [*body.cut])
    balls = np.flatnonzero((depths > 0) & (body.balls[current.which] > 0) & ~whole)
    if skin is None or not len(balls):
        return 0.0
    up = current.start.R[2]
    lowest = body.points[current.which] - body.balls[current.which, None] * up
    corners = skin.points[skin.outward] - body.centre
    nearest = cKDTree(lowest).query(corners.mean(axis=1))[1]
    force = 0.0
    for k in balls.tolist():
        own = corners[nearest == k]
        d = depths[k] * DEPTHS
        heights = (own - lowest[k]) @ up
        area = float(np.interp(depths[k], d, cut_areas(own, heights, up, d)))
        beyond = area - 2 * pi * float(body.balls[current.which[k]]) * depths[k]
        modulus, strength = _matter(floor, current, int(current.which[k]))
        elastic = 2 * modulus * sqrt(max(beyond, 0.0) / pi) * depths[k]
        force += float(np.fmin(TABOR * strength * max(beyond, 0.0), elastic))
    return force


def _matter(floor: Floor, current: Episode, vertex: int) -> tuple[float, float]:
    """E* [Pa] of a vertex on the floor, and the lower yield strength [Pa]; NaN: unknown."""
    body = current.body
    matter = floor.face.matter
    E, nu = body.materials[vertex].tolist()
    strength = np.nan if body.strengths is None else body.strengths[vertex]
    lower_strength = float(np.fmin(strength, matter.yield_strength or np.nan))
    return effective_modulus(E, nu, matter.E, matter.nu), lower_strength
