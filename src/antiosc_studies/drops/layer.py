"""A soft layer as an elastic foundation under the faces, edges and corners of a part.

A layer that is thin compared with the contact area deforms at each place independently (Winkler;
Johnson, Contact Mechanics, 1985, 4.3 and 5.8): the pressure is E/t times the indentation there, and
the force E/t times the volume V of the part below the layer's surface. The surface of the part is
divided into pieces, each of which is one contact. At the touch each gets a law F = k d^n from the
volumes that it displaces at its largest expected depth and at half of it: n = 1 for a flat face, 2
for an edge, 3 for a corner. This law is only a prediction: on the path of the part the gap is set
so that the force is E/t V of the rotated and bent piece, at its centre of pressure (`on_path`).
Such forces conserve energy.
"""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
from scipy.integrate import cumulative_trapezoid

from antiosc.base._types import Array, BoolArray, IntArray
from antiosc_studies.drops.floor import Setting, layer_law
from antiosc_studies.drops.free_body import FreeBody, State
from antiosc_studies.drops.layer_contact import LayerContact

#: Largest size of a piece over the extent.
PIECE = 0.35
#: Largest angle between normals of a piece [rad].
BENT = 0.35
#: The law of a piece is taken at a depth of at least this share of the greatest depth.
SHALLOW = 0.05
#: Depths over the extent at which the displaced volumes of a part that does not rotate are
#: computed.
DEPTHS = np.geomspace(1e-7, 1.0, 29)
#: Largest exponent of a law.
STEEPEST = 6.0
#: Least share of its area with which a piece faces the floor, for its law.
LEAN = 0.1


def with_layer_contact(body: FreeBody) -> FreeBody:
    """The body with its surface divided into pieces; itself if it has no faces."""
    if body.layer_contact is not None or body.balls.all():
        return body
    matrices: Any = None if body.structure is None else body.structure.matrices
    surface = _hull_surface(body) if matrices is None or matrices.located else _skin_surface(body)
    if surface is None:
        return body
    places, triangles, rounded = surface
    size = PIECE * body.extent
    places, triangles = _refined(places, triangles, size)
    x = places[triangles, :3]
    areas = np.cross(x[:, 1] - x[:, 0], x[:, 2] - x[:, 0]) / 2
    piece = _pieces(x.mean(axis=1), areas, size)
    order = np.argsort(piece, kind="stable")
    bounds = np.append(0, np.cumsum(np.bincount(piece)))
    return replace(
        body, layer_contact=LayerContact(places, triangles[order], areas[order], bounds, rounded)
    )


def _hull_surface(body: FreeBody) -> tuple[Array, IntArray, BoolArray] | None:
    """(points, triangles, mask of round vertices) of the convex hull of a body's points."""
    from scipy.spatial import ConvexHull, QhullError

    try:
        convex = ConvexHull(body.points)
    except (QhullError, ValueError):
        return None
    triangles = np.asarray(convex.simplices, dtype=int)
    x = body.points[triangles]
    normals = np.cross(x[:, 1] - x[:, 0], x[:, 2] - x[:, 0])
    inward = np.einsum("td,td->t", normals, convex.equations[:, :3]) < 0
    triangles[inward] = triangles[inward, ::-1]
    places = np.column_stack((body.points, body.shapes.reshape(len(body.points), -1)))
    return places, triangles, body.balls > 0


def _skin_surface(body: FreeBody) -> tuple[Array, IntArray, BoolArray] | None:
    """(points, triangles, mask of round vertices) of a mesh's surface.

    Triangles between round vertices are left out.
    """
    from scipy.spatial import cKDTree

    from antiosc.extension import source

    assert body.structure is not None
    assert body.basis is not None
    assert body.skin is not None
    skin = body.skin
    rounded = ~skin.sharp & (skin.curvatures[:, 0] * skin.size > 1)
    x = skin.points - body.centre
    triangles = skin.outward
    triangles = triangles[~rounded[triangles].all(axis=1)]
    if not len(triangles):
        return None
    if skin.half.any():  # a sheet has two sides
        triangles = np.vstack([triangles, triangles[:, ::-1]])
    nodes, _, displacements = source(body.structure).at_nodes(body.structure, body.basis)
    shapes = np.moveaxis(displacements[cKDTree(nodes).query(skin.points)[1]], 1, 2)
    nearest = cKDTree(skin.points).query(body.points + body.centre)[1]
    return np.column_stack((x, shapes.reshape(len(x), -1))), triangles, rounded[nearest]


def _refined(places: Array, triangles: IntArray, size: float) -> tuple[Array, IntArray]:
    """Bisect the longest sides of triangles until all sides are at most `size` [m]."""
    while True:
        x = places[triangles, :3]
        sides = np.linalg.norm(np.roll(x, -1, axis=1) - x, axis=2)
        is_long = sides.max(axis=1) > size
        if not is_long.any():
            return places, triangles
        first = sides[is_long].argmax(axis=1)[:, None]
        a, b, c = np.take_along_axis(triangles[is_long], (first + np.arange(3)) % 3, axis=1).T
        m = len(places) + np.arange(len(a))
        places = np.vstack((places, (places[a] + places[b]) / 2))
        halves = np.column_stack((a, m, c)), np.column_stack((m, b, c))
        triangles = np.vstack((triangles[~is_long], *halves))


def _pieces(centres: Array, areas: Array, size: float) -> IntArray:
    """Piece number of each triangle; pieces are bisected until they are flat and small."""
    weights = np.linalg.norm(areas, axis=1)
    normals = areas / weights[:, None]
    number = np.zeros(len(areas), dtype=int)
    stack = [np.arange(len(areas))]
    count = 0
    while stack:
        piece = stack.pop()
        w = weights[piece, None]
        for values, limit in ((normals[piece], BENT), (centres[piece], size)):
            deviations = values - (w * values).sum(axis=0) / w.sum()
            principal_axis = deviations @ np.linalg.eigh((w * deviations).T @ deviations)[1][:, -1]
            if np.ptp(principal_axis) > limit:
                stack += [piece[principal_axis < 0], piece[principal_axis >= 0]]
                break
        else:
            number[piece] = count
            count += 1
    return number


def with_layer_laws(body: FreeBody, start: State, setting: Setting) -> FreeBody:
    """The body with pieces of its surface as points, numbered from `layer_contact.first`.

    The height of a piece is that at which its law gives the force of the displaced volume. Vertices
    that are not round, and pieces that will hardly touch, are `idle`. A body without a layer is
    returned as it is.
    """
    surface = body.layer_contact
    layer = setting.floor.layer
    if surface is None or layer is None:
        return body
    vertical = start.R[2]
    z = start.centre[2] + start.lowered(setting.floor.ground)
    depths = np.append(0.0, DEPTHS * body.extent)
    numbers = surface.every
    volumes, (lowest, *_), _ = surface.pressed(numbers, vertical, start.q, z - depths)
    modulus = layer.E / layer.thickness
    work = modulus * cumulative_trapezoid(volumes.sum(axis=1), depths, initial=0.0)
    arms = start.arms(body)
    speed = (start.velocity + np.cross(start.spin(body), arms[np.argmin(arms[:, 2])]))[2]
    speed = max(-float(speed), 0.0)
    deepest = max(float(np.interp(body.mass * speed**2 / 2, work, depths)), float(depths[1]))
    depth = np.maximum(deepest - lowest, SHALLOW * max(deepest - lowest.min(), float(depths[1])))
    test_heights = z - lowest - np.outer([1.0, 0.5], depth)
    (volume, half), _, (place, _) = surface.pressed(numbers, vertical, start.q, test_heights, LEAN)
    n = np.clip(np.log2(volume / half), 1.0, STEEPEST)
    stiffness = modulus * volume / depth**n
    surface_with_laws = replace(
        surface, share=modulus / stiffness, exponent=n, height=z, speed=speed
    )
    points = place[:, :3]
    shapes = place[:, 3:].reshape(len(place), -1, 3)
    first = surface.first
    deep = surface_with_laws.depth(numbers, volumes[0], lowest)
    lifts = z + points @ vertical + np.einsum("vjd,d,j->v", shapes, vertical, start.q) + deep
    flat = np.full((len(place), 2), np.inf)
    rigid = np.zeros((3, 3))
    return replace(
        body,
        points=np.vstack((body.points, points)),
        shapes=np.concatenate((body.shapes, shapes)),
        balls=np.append(body.balls, lifts),
        radii=np.vstack((body.radii, flat)),
        materials=np.vstack((body.materials, np.nan * flat)),
        facing=None if body.facing is None else np.vstack((body.facing, 0 * points)),
        layer_contact=surface_with_laws,
        laws={
            first + k: layer_law(layer, float(stiffness[k]), float(n[k])) for k in numbers.tolist()
        },
        idle=np.append(~surface.round, volumes[np.searchsorted(depths, deepest)] == 0),
        _placed=body._placed | {first + k: (shapes[k], rigid, flat[k]) for k in numbers.tolist()},
    )


def layer_energy(body: FreeBody, state: State, setting: Setting) -> float:
    """Elastic energy [J] of a layer under a body: E/t times the integral of the displaced
    volume.
    """
    surface = body.layer_contact
    layer = setting.floor.layer
    if surface is None or layer is None:
        return 0.0
    z = state.centre[2] + state.lowered(setting.floor.ground)
    depth_now = max(-float(state.heights(body, setting.floor.ground)[: surface.first].min()), 0.0)
    s, weights = np.polynomial.legendre.leggauss(16)
    lifts = depth_now * (1 + s) / 2
    volumes = surface.pressed(surface.every, state.R[2], state.q, z + lifts)[0]
    return float(layer.E / layer.thickness * depth_now / 2 * weights @ volumes.sum(axis=1))
