"""Lines along which a part may land, as a cylinder on its side.

A straight line of contact is one law of the whole line (`antiosc.engine.contact.line`), shared by
stations along it by their lengths. The stations are the nodes of a Gauss-Lobatto rule on the
axis, each a ball of the cylinder's radius, so that the line rolls with the part and the force does
not depend on the mesh. They touch where the axis is level; otherwise the part lands on an end, as a
point.

The law of the line is that of two half-spaces. What the part gives way more or less than a
half-space, without its modes, is a compliance of the law: that of patches along the line on the
mesh, less their compliance on a half-space.
"""

from __future__ import annotations

from dataclasses import replace
from math import inf, log, pi
from typing import Any

import numpy as np
from scipy.spatial import cKDTree

from antiosc import Tabulated
from antiosc.base._types import Array, IntArray
from antiosc.base.errors import InputError, without_warnings
from antiosc.base.texts import engineering
from antiosc.engine.contact.curvature import LINE, Curvature
from antiosc.engine.contact.geometry import effective_modulus
from antiosc.engine.contact.line import line_curve
from antiosc_studies.drops.cylinder import STATIONS, Cylinder, rule
from antiosc_studies.drops.flight import State
from antiosc_studies.drops.floor import Floor
from antiosc_studies.drops.free_body import FreeBody

#: Deviation of vertices from a cylinder over its radius, from fit to fit; the share of the length
#: and the number of vertices that they cover at least.
OFF, COVERED, LEAST = (0.25, 0.15, 0.08, 0.04, 0.02, 0.01, 0.01), 0.9, 6
#: Curvature of vertices to which a cylinder is fitted over that of the surface.
ROUND = 0.7
#: Most places at which a line is looked for.
LOOKS = 40
#: Radius of the patches along a line over that of the cylinder, and the most of them. On steel
#: cylinders of 20 x 100 mm with cells of 10, 6, 4 mm the line's compliance then is 0.99, 1, 1.
PATCH, PATCHES = 0.4, 40
#: Largest gap between the vertices around an axis [rad] of a whole cylinder.
WHOLE = 1.2
#: 2 (1 - ln 2): the mean displacement along a uniform force lies below that in the middle by this
#: times F/(pi E* L).
MEAN = 2 * (1 - log(2))
#: Largest pressure of a line at first yield over the yield strength.
FIRST_YIELD = 1.79
#: Least slope of the indentation over its first one.
LEAST_SLOPE = 0.1


def with_lines(body: FreeBody, floor: Floor) -> FreeBody:
    """The body with stations on its cylinders, if the floor's law applies to lines."""
    plain = not (floor.layer or floor.law or (floor.restitution or 1.0) < 1)
    body = _without(body)
    if not (plain and body.cylinders):
        return body
    for cylinder in body.cylinders:
        body = _added(body, cylinder, floor)
    return body


def _without(body: FreeBody) -> FreeBody:
    """The body without its stations."""
    if not body.stations:
        return body
    first = int(body.stations[0][0])
    rows = ("points", "balls", "radii", "materials", "shapes", "strengths", "facing")
    kept = {name: getattr(body, name) for name in rows}
    kept = {name: None if one is None else one[:first] for name, one in kept.items()}
    return replace(body, **kept, stations=(), laws={}, idle=None, _placed={})


def _added(body: FreeBody, one: Cylinder, floor: Floor) -> FreeBody:
    first, count = len(body.points), body.omega.size
    which, shapes = np.arange(first, first + STATIONS), np.zeros((STATIONS, count, 3))
    law = _law(one, floor)
    shares = rule()[1].tolist()
    laws = {
        int(i): Tabulated(law[0], share * law[1]) for i, share in zip(which, shares, strict=True)
    }
    idle = np.zeros(first, dtype=bool) if body.idle is None else body.idle
    known = shapes[0], np.zeros((3, 3)), np.full(2, one.radius)
    more = np.ones(STATIONS)
    return replace(
        body,
        points=np.vstack((body.points, one.points)),
        balls=np.append(body.balls, one.radius * more),
        radii=np.vstack((body.radii, np.full((STATIONS, 2), one.radius))),
        materials=np.vstack((body.materials, np.tile(one.material, (STATIONS, 1)))),
        shapes=np.concatenate((body.shapes, shapes)),
        strengths=None if body.strengths is None else np.append(body.strengths, np.nan * more),
        facing=None if body.facing is None else np.vstack((body.facing, np.zeros((STATIONS, 3)))),
        stations=(*body.stations, which),
        laws=body.laws | laws,
        idle=np.append(idle, more > 0),
        _placed=body._placed | {int(i): known for i in which},
    )


def _law(one: Cylinder, floor: Floor) -> tuple[Array, Array]:
    """Indentations [m] and forces [N] of the whole line."""
    E, nu = one.material.tolist()
    under = floor.face.matter
    modulus = effective_modulus(E, nu, under.E, under.nu)
    depth, force = line_curve(modulus, one.radius, one.length)
    depth = depth + (one.compliance - MEAN / (pi * modulus * one.length)) * force
    slope = np.diff(depth) / np.diff(force)
    soft = np.append(True, slope > LEAST_SLOPE * slope[0])
    last = len(soft) if soft.all() else int(np.argmin(soft))
    return depth[:last], force[:last]


def landing(body: FreeBody, start: State) -> FreeBody:
    """The body at a touch: level lines touch with their stations, others with points."""
    if not body.stations or body.idle is None:
        return body
    up, idle, shapes, known = start.R[2], body.idle.copy(), body.shapes.copy(), dict(body._placed)
    for one, which in zip(body.cylinders, body.stations, strict=True):
        if one.lands(up):
            idle[which], idle[one.members] = False, True
            shapes[which] = one.shapes_at(up)
            stiff, radii = np.zeros((3, 3)), np.full(2, one.radius)
            known |= {int(i): (shapes[i], stiff, radii) for i in which}
    return replace(body, idle=idle, shapes=shapes, _placed=known)


def yielding(body: FreeBody, floor: Floor, line: int, force: float) -> str:
    """Sentence that a line yields under a force [N], although its law is elastic; "" if not.

    Yield begins below the surface at 1.79 times the strength (von Mises; Johnson, 6.2).
    """
    one, which = body.cylinders[line], int(body.stations[line][0])
    near = int(one.members[0]) if len(one.members) else which
    strength = np.nan if body.strengths is None else float(body.strengths[near])
    E, nu = one.material.tolist()
    under = floor.face.matter
    modulus = effective_modulus(E, nu, under.E, under.nu)
    pressure = float(np.sqrt(force * modulus / (pi * one.radius * one.length)))
    share = pressure / (FIRST_YIELD * strength)
    if not share > 1:
        return ""
    return (
        f"the line of contact yields: its pressure of {engineering(pressure, 'Pa')} is {share:.3g} "
        f"times that of first yield; its law is elastic, and its force too high"
    )


# -- where the lines of a part are


def cylinders(body: FreeBody, skin: Any, own: IntArray) -> tuple[Cylinder, ...]:
    """The straight lines of the surface of a solid; own: numbers of the points in the skin."""
    from antiosc.reduce.site.surface import curvature_at

    assert body.structure is not None
    cylinders_found, remaining = [], own[skin.lines[own] & (skin.half[own] == 0)]
    sharp = cKDTree(skin.points[skin.sharp]) if skin.sharp.any() else None
    for _ in range(LOOKS):
        if not len(remaining):
            break
        away = np.zeros(len(remaining)) if sharp is None else sharp.query(skin.points[remaining])[0]
        at = int(remaining[np.argmax(away)])
        remaining = remaining[remaining != at]
        try:
            surface = curvature_at(body.structure, skin.points[at])
        except InputError:  # of a mesh with too few nodes there
            continue
        one = _cylinder(body, skin, own, surface, at)
        if one is not None:
            cylinders_found.append(one)
            remaining = np.setdiff1d(remaining, own[one.members])
    return tuple(cylinders_found)


def _cylinder(
    body: FreeBody, skin: Any, own: IntArray, surface: Curvature, at: int
) -> Cylinder | None:
    """The cylinder through a point of the skin; None if the surface is not cylindrical there."""
    bend = float(surface.values.max())
    if surface.kind != LINE or surface.middle is None or bend <= 0:
        return None
    radius = 1 / bend
    if surface.length == inf:
        return None
    axis = surface.directions[int(np.argmin(np.abs(surface.values)))]
    middle = surface.middle - radius * surface.normal
    curved = skin.lines & (skin.curvatures[:, 1] > ROUND * bend)  # not those on planes beside it
    for near in OFF:
        along, aside = _split(skin.points - middle, axis)
        off = np.linalg.norm(aside, axis=1) - radius
        on = (np.abs(off) < near * radius) & (np.abs(along) < 1.01 * surface.length / 2)
        if on.sum() < LEAST or np.ptp(along[on]) < COVERED * surface.length:
            return None
        fit = on & curved if (on & curved).sum() >= LEAST else on
        shift, turn, more = _closer(along[fit], aside[fit], off[fit], axis)
        middle, axis, radius = middle + shift, axis + turn, radius + more
        axis = axis / np.linalg.norm(axis)
    down, spread = _arc(aside[fit], axis)
    material, centre = skin.materials[at], middle - body.centre
    if np.isnan(material).any():
        return None
    from antiosc.extension import source

    structure: Any = body.structure
    nodes, _, moved = source(structure).at_nodes(structure, body.basis)
    nearest = cKDTree(nodes).query(skin.points[on])[1]
    one = Cylinder(
        centre=centre,
        axis=axis,
        radius=radius,
        length=surface.length,
        down=down,
        spread=spread,
        compliance=0.0,
        material=material,
        members=np.flatnonzero(on[own]),
        nodes=skin.points[on] - body.centre,
        shapes=np.moveaxis(moved[nearest], 1, 2).copy(),
    )
    return replace(one, compliance=_compliance(body, one))


def _split(way: Array, axis: Array) -> tuple[Array, Array]:
    """Components of vectors along an axis (n,) and perpendicular to it (n, 3)."""
    along = way @ axis
    return along, way - np.outer(along, axis)


def _closer(along: Array, aside: Array, off: Array, axis: Array) -> tuple[Array, Array, float]:
    """One Gauss-Newton step of the fit of a cylinder: changes of middle, axis (3,) and radius.

    `along` and `aside` are the components of the points along the axis and across it, `off` their
    distances from the cylinder.
    """
    basis = np.linalg.svd(axis[None])[2][1:]
    facing = aside @ basis.T / np.linalg.norm(aside, axis=1, keepdims=True)
    rows = np.column_stack((facing, along[:, None] * facing, np.ones(len(along))))
    step = np.linalg.lstsq(rows, off, rcond=None)[0]
    return step[:2] @ basis, step[2:4] @ basis, float(step[4])


def _arc(aside: Array, axis: Array) -> tuple[Array, float]:
    """Direction (3,) of the middle of an arc of points around an axis, and half its angle [rad]."""
    first = aside[0] / np.linalg.norm(aside[0])
    second = np.cross(axis, first)
    angles = np.sort(np.arctan2(aside @ second, aside @ first))
    gaps = np.diff(np.append(angles, angles[0] + 2 * pi))
    widest = int(np.argmax(gaps))
    gap = float(gaps[widest])
    middle = float(angles[widest]) + gap / 2 + pi
    down = np.cos(middle) * first + np.sin(middle) * second
    return down, pi if gap < WHOLE else pi - gap / 2


def _compliance(body: FreeBody, one: Cylinder) -> float:
    """The part's compliance along a line, less that of its modes and of a half-space [m/N]."""
    from antiosc import Site
    from antiosc.reduce.site import functionals

    structure: Any = body.structure
    assert body.basis is not None
    radius = max(PATCH * one.radius, one.length / (2 * PATCHES))
    count = max(2, round(one.length / (2 * radius)))
    along = ((np.arange(count) + 0.5) / count - 0.5) * one.length
    places = body.centre + one.centre + one.radius * one.down + np.outer(along, one.axis)
    push = tuple((-one.down).tolist())
    sites = [Site(tuple(x), push, radius, snap=True) for x in places.tolist()]
    with without_warnings():
        loads = functionals(structure, sites)
    b = np.mean([each.b for each in loads], axis=0)
    y = structure.factorize().solve_block(b[:, None])[:, 0]
    rigid, moved = b @ structure.rigid_modes, b @ body.basis
    modes = float(np.sum(moved**2 / (body.omega**2 + structure.shift)))
    whole = float(b @ y - rigid @ rigid / structure.shift)
    E, nu = one.material.tolist()
    apart = np.abs(along[:, None] - along)
    np.fill_diagonal(apart, inf)
    patches = sum(each.local_compliance for each in loads) / count**2
    others = float((1 / apart).sum()) * (1 - nu**2) / (pi * E * count**2)
    return whole - modes - patches - others
