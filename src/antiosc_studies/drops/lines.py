"""Lines along which a part may land, as a cylinder on its side.

The law of a straight line of contact (`antiosc.engine.contact.line`) is shared among stations along
it by their lengths. The stations are the nodes of a Gauss-Lobatto rule on the axis, each a ball of
the cylinder's radius, so that the line rolls with the part and the force does not depend on the
mesh. They touch if the axis is level; otherwise the part lands on an end, as a point.

The law of the line is that of two half-spaces. The difference between the part's compliance
(without its modes) and that of a half-space is added to the law: the compliance of patches along
the line on the mesh, minus their compliance on a half-space.
"""

from __future__ import annotations

from contextlib import suppress
from dataclasses import replace
from math import inf, log, pi, sqrt
from typing import Any

import numpy as np
from scipy.integrate import cumulative_trapezoid
from scipy.spatial import cKDTree

from antiosc import Tabulated
from antiosc.base._types import Array, IntArray
from antiosc.base.errors import InputError, without_warnings
from antiosc.base.texts import engineering
from antiosc.engine.contact.curvature import LINE, Curvature
from antiosc.engine.contact.geometry import effective_modulus
from antiosc.engine.contact.line import line_curve
from antiosc_studies.drops.cylinder import STATIONS, Cylinder, rule
from antiosc_studies.drops.floor import Floor
from antiosc_studies.drops.free_body import FreeBody, State

#: Largest deviation of vertices from a cylinder over its radius, for each of the fits.
OFF = (0.25, 0.15, 0.08, 0.04, 0.02, 0.01, 0.01)
#: Least share of the length that the vertices cover.
COVERED = 0.9
#: Least number of vertices: a cylinder has five unknowns.
LEAST = 6
#: Least curvature of vertices used in the fit of a cylinder, over that of the surface.
ROUND = 0.7
#: Largest number of vertices at which a line is sought.
SAMPLES = 40
#: Radius of the patches along a line over that of the cylinder. On steel cylinders of 20 x 100 mm
#: with cells of 10, 6, 4 mm the compliance is then 0.99, 1, 1 of the limit.
PATCH = 0.4
#: Largest number of patches along a line.
PATCHES = 40
#: Largest gap between the vertices around an axis [rad] of a whole cylinder.
WHOLE = 1.2
#: Angle [rad] beside an arc up to which vertices on the planes there belong to it.
BESIDE = 0.2
#: 2 (1 - ln 2): under a uniform line force the mean displacement is smaller than that in the middle
#: by this times F/(pi E* L).
MEAN = 2 * (1 - log(2))
#: Largest pressure of a line at first yield over the yield strength, by von Mises (K. L. Johnson,
#: *Contact Mechanics* (1985), (6.4)).
FIRST_YIELD = 1.79
#: Largest mean pressure of a contact that yields over the yield strength (Tabor).
TABOR = 2.8
#: Half widths over the radius at which the force of a cylinder is computed.
WIDTHS = np.geomspace(1e-5, 1.0, 200)
#: The law of a line ends where the slope dδ/dF falls below this share of its first value.
LEAST_SLOPE = 0.1


def with_lines(body: FreeBody, floor: Floor) -> FreeBody:
    """The body with stations on its cylinders, if the floor's law applies to lines."""
    elastic_floor = not (floor.layer or floor.law or (floor.restitution or 1.0) < 1)
    body = _without_stations(body)
    if not (elastic_floor and body.cylinders):
        return body
    for cylinder in body.cylinders:
        body = _with_cylinder(body, cylinder, floor)
    return body


def _without_stations(body: FreeBody) -> FreeBody:
    """The body without the stations of its lines."""
    if not body.stations:
        return body
    first = int(body.stations[0][0])
    rows = ("points", "balls", "radii", "materials", "shapes", "strengths", "facing")
    rows_before = {name: getattr(body, name) for name in rows}
    rows_before = {
        name: None if values is None else values[:first] for name, values in rows_before.items()
    }
    return replace(body, **rows_before, stations=(), laws={}, idle=None, _placed={})


def _with_cylinder(body: FreeBody, cylinder: Cylinder, floor: Floor) -> FreeBody:
    """The body with the stations of one more cylinder."""
    first = len(body.points)
    count = body.omega.size
    stations = np.arange(first, first + STATIONS)
    shapes = np.zeros((STATIONS, count, 3))
    law = _law(cylinder, floor)
    shares = rule()[1].tolist()
    laws = {
        int(i): Tabulated(law[0], share * law[1]) for i, share in zip(stations, shares, strict=True)
    }
    is_idle = np.zeros(first, dtype=bool) if body.idle is None else body.idle
    station_data = shapes[0], np.zeros((3, 3)), np.full(2, cylinder.radius)
    ones = np.ones(STATIONS)
    return replace(
        body,
        points=np.vstack((body.points, cylinder.points)),
        balls=np.append(body.balls, cylinder.radius * ones),
        radii=np.vstack((body.radii, np.full((STATIONS, 2), cylinder.radius))),
        materials=np.vstack((body.materials, np.tile(cylinder.material, (STATIONS, 1)))),
        shapes=np.concatenate((body.shapes, shapes)),
        strengths=None if body.strengths is None else np.append(body.strengths, np.nan * ones),
        facing=None if body.facing is None else np.vstack((body.facing, np.zeros((STATIONS, 3)))),
        stations=(*body.stations, stations),
        laws=body.laws | laws,
        idle=np.append(is_idle, ones > 0),
        _placed=body._placed | {int(i): station_data for i in stations},
    )


def _law(cylinder: Cylinder, floor: Floor) -> tuple[Array, Array]:
    """Indentations [m] and forces [N] of the whole line."""
    modulus = _modulus(cylinder, floor)
    depth, force = line_curve(modulus, cylinder.radius, cylinder.length)
    depth = depth + (cylinder.compliance - MEAN / (pi * modulus * cylinder.length)) * force
    slope = np.diff(depth) / np.diff(force)
    valid = np.append(True, slope > LEAST_SLOPE * slope[0])
    last = len(valid) if valid.all() else int(np.argmin(valid))
    return depth[:last], force[:last]


def landing(body: FreeBody, start: State) -> FreeBody:
    """The body at a touch: level lines touch with their stations, other places with points."""
    if not body.stations or body.idle is None:
        return body
    vertical = start.R[2]
    is_idle = body.idle.copy()
    shapes = body.shapes.copy()
    site_cache = dict(body._placed)
    for cylinder, stations in zip(body.cylinders, body.stations, strict=True):
        if cylinder.lands(vertical):
            is_idle[stations] = False
            is_idle[cylinder.members] = True
            shapes[stations] = cylinder.shapes_at(vertical)
            no_compliance = np.zeros((3, 3))
            radii = np.full(2, cylinder.radius)
            site_cache |= {int(i): (shapes[i], no_compliance, radii) for i in stations}
    return replace(body, idle=is_idle, shapes=shapes, _placed=site_cache)


def yielding(body: FreeBody, floor: Floor, line: int, force: float) -> str:
    """Sentence that a line, whose law is elastic, yields under a force [N]; "" if it does not."""
    share, pressure = _yield_share(body, floor, line, force)
    if not share > 1:
        return ""
    return (
        f"the line of contact yields: its pressure of {engineering(pressure, 'Pa')} is {share:.3g} "
        f"times that of first yield; its law is elastic, and its force too high"
    )


def _yield_share(body: FreeBody, floor: Floor, line: int, force: float) -> tuple[float, float]:
    """(pressure of a line over that of first yield, NaN if the strength is unknown; pressure [Pa]).

    Yield begins below the surface at 1.79 times the strength (von Mises; Johnson, 6.2).
    """
    cylinder = body.cylinders[line]
    first_station = int(body.stations[line][0])
    vertex = int(cylinder.members[0]) if len(cylinder.members) else first_station
    strength = np.nan if body.strengths is None else float(body.strengths[vertex])
    modulus = _modulus(cylinder, floor)
    pressure = float(np.sqrt(force * modulus / (pi * cylinder.radius * cylinder.length)))
    return pressure / (FIRST_YIELD * strength), pressure


def _modulus(cylinder: Cylinder, floor: Floor) -> float:
    """E* [Pa] of a cylinder on a floor."""
    E, nu = cylinder.material.tolist()
    matter = floor.face.matter
    return effective_modulus(E, nu, matter.E, matter.nu)


def line_error(
    body: FreeBody, floor: Floor, line: int, force: float, carried: float
) -> float | None:
    """Relative error of the largest force [N] of a line by its law; None: unknown strength.

    `carried`: the share of its length that carries the force. At equal work a force
    proportional to the indentation grows as the root of the stiffness. What the part adds to the
    compliance of a half-space counts as its error; and of a line that carries on a share w of its
    length the logarithm ln(1/w) by which a shorter line is more compliant. Of a line that yields
    the force lies between that of first yield and the elastic one.
    """
    cylinder = body.cylinders[line]
    share, _ = _yield_share(body, floor, line, force)
    if np.isnan(share):
        return None
    depths, of_depths = _law(cylinder, floor)
    depth = float(np.interp(force, of_depths, depths))
    shorter = log(1 / carried) / (carried * pi * _modulus(cylinder, floor) * cylinder.length)
    doubtful = (abs(cylinder.compliance) + shorter) * force / depth
    by_yield = 1 - 1 / share**2 if share > 1 else 0.0
    return sqrt(1 + doubtful) - 1 + by_yield


def force_along(matter: tuple[float, float], radius: float, length: float, work: float) -> float:
    """Upper bound [N] of the force of a line that takes a work [J].

    `matter`: E* and yield strength [Pa], NaN: unknown. It is the lower one of the forces of an
    elastic cylinder up to its axis (Johnson, (5.57)) and of Tabor's pressure on its whole width.
    """
    modulus, strength = matter
    half_width = radius * WIDTHS
    force = pi * modulus * length * half_width**2 / (4 * radius)
    depth = half_width**2 / (4 * radius) * (2 * np.log(4 * radius / half_width) - 1)
    works = cumulative_trapezoid(force, depth, initial=0.0)
    elastic = float(np.interp(work, works, force)) * max(work / works[-1], 1.0)
    # F = p 2 sqrt(2 R d) L, the work 2/3 F d
    width = 2 * TABOR * strength * sqrt(2 * radius) * length
    return float(np.fmin(elastic, np.cbrt(1.5 * work * width**2)))


# -- the lines of a part


def cylinders(body: FreeBody, skin: Any, body_points: IntArray) -> tuple[Cylinder, ...]:
    """The straight lines of a solid's surface; `body_points`: the body's points in the skin."""
    from antiosc.reduce.site.surface import curvature_at

    assert body.structure is not None
    cylinders_found = []
    remaining = body_points[skin.lines[body_points] & (skin.half[body_points] == 0)]
    sharp = cKDTree(skin.points[skin.sharp]) if skin.sharp.any() else None
    for _ in range(SAMPLES):
        if not len(remaining):
            break
        distances = (
            np.zeros(len(remaining)) if sharp is None else sharp.query(skin.points[remaining])[0]
        )
        vertex = int(remaining[np.argmax(distances)])
        remaining = remaining[remaining != vertex]
        try:
            surface = curvature_at(body.structure, skin.points[vertex])
        except InputError:  # of a mesh with too few nodes there
            continue
        cylinder = _cylinder(body, skin, body_points, surface, vertex)
        if cylinder is not None:
            cylinders_found.append(cylinder)
            remaining = np.setdiff1d(remaining, body_points[cylinder.members])
    return tuple(cylinders_found)


def _cylinder(
    body: FreeBody, skin: Any, body_points: IntArray, surface: Curvature, at: int
) -> Cylinder | None:
    """The cylinder through a vertex of the skin; None if the surface is not cylindrical there."""
    curvature = float(surface.values.max())
    if surface.kind != LINE or surface.middle is None or curvature <= 0:
        return None
    radius = 1 / curvature
    if surface.length == inf:
        return None
    axis = surface.directions[int(np.argmin(np.abs(surface.values)))]
    middle = surface.middle - radius * surface.normal
    curved = skin.lines & (
        skin.curvatures[:, 1] > ROUND * curvature
    )  # not those on planes beside it
    for deviation in OFF:
        axial, radial = _split(skin.points - middle, axis)
        distances = np.linalg.norm(radial, axis=1) - radius
        on_cylinder = (np.abs(distances) < deviation * radius) & (
            np.abs(axial) < 1.01 * surface.length / 2
        )
        if on_cylinder.sum() < LEAST or np.ptp(axial[on_cylinder]) < COVERED * surface.length:
            return None
        fit = on_cylinder & curved if (on_cylinder & curved).sum() >= LEAST else on_cylinder
        shift, rotation, growth = _closer(axial[fit], radial[fit], distances[fit], axis)
        middle = middle + shift
        axis = axis + rotation
        radius = radius + growth
        axis = axis / np.linalg.norm(axis)
    down, half_angle = _arc(radial[fit], axis)
    cosine = np.cos(min(half_angle + BESIDE, pi))
    on_cylinder &= radial @ down >= cosine * np.linalg.norm(radial, axis=1)
    fit &= on_cylinder
    if fit.sum() < LEAST:
        return None
    material = skin.materials[at]
    centre = middle - body.centre
    if np.isnan(material).any():
        return None
    from antiosc.extension import source

    structure: Any = body.structure
    nodes, _, displacements = source(structure).at_nodes(structure, body.basis)
    nearest = cKDTree(nodes).query(skin.points[on_cylinder])[1]
    cylinder = Cylinder(
        centre=centre,
        axis=axis,
        radius=radius,
        length=surface.length,
        down=down,
        spread=half_angle,
        compliance=0.0,
        material=material,
        members=np.flatnonzero(on_cylinder[body_points]),
        nodes=skin.points[on_cylinder] - body.centre,
        shapes=np.moveaxis(displacements[nearest], 1, 2).copy(),
    )
    facing = radial[fit] / np.linalg.norm(radial[fit], axis=1, keepdims=True)
    for outward in (down, facing[np.argmax(facing @ down)]):
        with suppress(InputError):  # a plane cuts the arc in its middle: no surface is there
            return replace(cylinder, compliance=_compliance(body, cylinder, outward))
    return None  # its line has gaps


def _split(vectors: Array, axis: Array) -> tuple[Array, Array]:
    """Components of vectors along an axis (n,) and perpendicular to it (n, 3)."""
    axial = vectors @ axis
    return axial, vectors - np.outer(axial, axis)


def _closer(
    along: Array, aside: Array, distances: Array, axis: Array
) -> tuple[Array, Array, float]:
    """One Gauss-Newton step of a cylinder fit: changes of middle (3,), axis (3,) and radius.

    `along`, `aside`: components of the points along the axis and across it; `distances`: those from
    the cylinder.
    """
    basis = np.linalg.svd(axis[None])[2][1:]
    facing = aside @ basis.T / np.linalg.norm(aside, axis=1, keepdims=True)
    rows = np.column_stack((facing, along[:, None] * facing, np.ones(len(along))))
    step = np.linalg.lstsq(rows, distances, rcond=None)[0]
    return step[:2] @ basis, step[2:4] @ basis, float(step[4])


def _arc(aside: Array, axis: Array) -> tuple[Array, float]:
    """(direction (3,) to the middle of an arc of points around an axis, half of its angle [rad]).

    Points may lie on several arcs of one cylinder, as those of the fillets of a grip: the arc with
    most of them counts, and there is no surface between it and the others.
    """
    first = aside[0] / np.linalg.norm(aside[0])
    second = np.cross(axis, first)
    angles = np.sort(np.arctan2(aside @ second, aside @ first))
    gaps = np.diff(np.append(angles, angles[0] + 2 * pi))
    last = int(np.argmax(gaps)) + 1
    around = np.append(angles[last:], angles[:last] + 2 * pi)
    arcs = np.split(around, np.flatnonzero(np.diff(around) >= WHOLE) + 1)
    arc = max(arcs, key=len)
    middle, half = (arc[0] + arc[-1]) / 2, (arc[-1] - arc[0]) / 2
    down = np.cos(middle) * first + np.sin(middle) * second
    return down, float(pi if gaps.max() < WHOLE else half)


def _compliance(body: FreeBody, cylinder: Cylinder, outward: Array) -> float:
    """The part's compliance along a line [m/N], without that of its modes and of a half-space.

    `outward` (3,): from the axis to the line.
    """
    from antiosc import Site
    from antiosc.reduce.site import functionals

    structure: Any = body.structure
    assert body.basis is not None
    radius = max(PATCH * cylinder.radius, cylinder.length / (2 * PATCHES))
    count = max(2, round(cylinder.length / (2 * radius)))
    positions = ((np.arange(count) + 0.5) / count - 0.5) * cylinder.length
    places = (
        body.centre
        + cylinder.centre
        + cylinder.radius * outward
        + np.outer(positions, cylinder.axis)
    )
    inward = tuple((-outward).tolist())
    sites = [Site(tuple(x), inward, radius, snap=True) for x in places.tolist()]
    with without_warnings():
        loads = functionals(structure, sites)
    b = np.mean([load.b for load in loads], axis=0)
    y = structure.factorize().solve_block(b[:, None])[:, 0]
    rigid = b @ structure.rigid_modes
    displacements = b @ body.basis
    modes = float(np.sum(displacements**2 / (body.omega**2 + structure.shift)))
    total = float(b @ y - rigid @ rigid / structure.shift)
    E, nu = cylinder.material.tolist()
    distances = np.abs(positions[:, None] - positions)
    np.fill_diagonal(distances, inf)
    patches = sum(load.local_compliance for load in loads) / count**2
    half_space = float((1 / distances).sum()) * (1 - nu**2) / (pi * E * count**2)
    return total - modes - patches - half_space
