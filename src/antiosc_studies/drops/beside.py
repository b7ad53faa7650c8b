"""The force of the surface beside the points of a contact, for the error bar of their force.

Vertices of the mesh stand for the surface. A cylinder on its side touches along a line; edges and
faces that are little inclined touch beside a corner. On the extruder idler of a printer, which
lands on concrete with edges inclined by 1° to 4°, a half-space that yields at 2.8 times the
strength and has the shape of the part with its edges rounded by 1 mm carries 1.3, 1.7 and 1.7
times the force of balls of 1 mm at equal work, and the bound of this module is 1.35, 2.1 and 2.0
times this force; with edges inclined by 25° and more both lie below the bar of the law.
"""

from __future__ import annotations

from math import pi, sqrt

import numpy as np
from scipy.integrate import cumulative_trapezoid, trapezoid
from scipy.spatial import cKDTree

from antiosc.engine.contact.geometry import effective_modulus
from antiosc_studies.drops.cuts import cut_areas
from antiosc_studies.drops.episode import SAMPLES, Episode, path_of
from antiosc_studies.drops.floor import Floor
from antiosc_studies.drops.lines import TABOR, force_along

#: Cause of the error by the surface beside a corner.
BESIDE = "an edge or a face beside the corner that meets the floor almost flat"
#: Share by which the force of a line may exceed that of its vertices if these stand for it.
COARSE = 0.1
#: Depths over the dent at which the cut of the surface is computed.
DEPTHS = np.geomspace(1e-3, 10.0, 61)


def share_beside(floor: Floor, current: Episode) -> float:
    """Force that the surface beside the points carries at most, over that of the points."""
    peak = current.peak_force()
    if not peak:
        return 0.0
    line = current.rough_line
    if line is not None:
        energy, *_ = current.start.energies(current.body, 0.0)
        matter = _matter(floor, current, line.point)
        share = force_along(matter, line.radius, line.length, energy) / peak
        if current.complete(current.sunk() > 0) and share < 1 + COARSE:
            return max(share - 1, 0.0)  # what the floor cuts at the vertices is the whole line
        return share
    beside = max(_force_of_cut(floor, current) - peak, _force_beside_balls(floor, current))
    return max(beside / peak, 0.0)


def _force_of_cut(floor: Floor, current: Episode) -> float:
    """Upper bound [N] of the force of the surface at the work of the contacts; 0 if none is sharp.

    It is the lower one of Tabor's pressure on the area of the cut of the part by the floor, and of
    the elastic force of a flat punch with this area (Johnson, *Contact Mechanics*, (3.36)).
    """
    body = current.body
    skin = body.skin
    if skin is None or skin.half.any() or not len(skin.triangles):
        return 0.0
    times, forces = current.forces()
    peak = int(np.argmax(forces.sum(axis=1)))
    presses = forces[peak] > 0
    pressing = current.which[presses]
    nearest = cKDTree(skin.points).query(body.points[pressing] + body.centre)[1]
    if not skin.sharp[nearest].any() or current.complete(presses):
        return 0.0
    depths = current.history.run.depth[: peak + 1, : len(current.which)]
    work = float(trapezoid(forces[: peak + 1], depths, axis=0).sum())
    path = path_of(current.touch, current.history, np.linspace(0.0, times[peak], SAMPLES + 1))
    up = path.R[-1, 2]
    heights = (skin.points - body.centre) @ up - float((body.points[pressing] @ up).min())
    d = DEPTHS * current.deepest
    triangles = skin.outward
    area = cut_areas(skin.points[triangles], heights[triangles], up, d)
    modulus, strength = _matter(floor, current, int(pressing[0]))
    punch = 2 * modulus * np.sqrt(area / pi) * d
    force = np.fmin(TABOR * strength * area, punch)
    works = cumulative_trapezoid(force, d, initial=0.0)
    return float(np.interp(work, works, force))


def _force_beside_balls(floor: Floor, current: Episode) -> float:
    """Tabor's pressure [N] on what the floor cuts of the part next to balls, outside of them."""
    body = current.body
    skin = body.skin
    depths = current.sunk()
    whole = np.isin(current.which, [*body.cut])
    balls = np.flatnonzero((depths > 0) & (body.balls[current.which] > 0) & ~whole)
    if skin is None or skin.half.any() or not len(skin.triangles) or not len(balls):
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
