"""A soft layer as springs side by side under the faces, edges and corners of a part.

A layer that is thin against the area of contact gives way at each place by itself (Winkler;
Johnson, Contact Mechanics, 1985, 4.3 and 5.8): the pressure is E/t times the indentation there,
and the force E/t times the volume V of the part below the surface of the layer. The surface of the
part is divided into pieces, each of which is one contact. At the touch it gets a law F = k d^n by
the volumes that it displaces as deep as it may come, and half as deep: n = 1 of a face that lies
flat, 2 of an edge, 3 of a corner. The law only predicts: on the path of the part its gap is such
that the force is E/t V of the piece as it has turned and bent, and acts at its centre of pressure
(`on_path`). Such forces keep the energy.
"""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
from scipy.integrate import cumulative_trapezoid

from antiosc.base._types import Array, BoolArray, IntArray
from antiosc_studies.drops.flight import State
from antiosc_studies.drops.floor import Setting, layer_law
from antiosc_studies.drops.free_body import FreeBody
from antiosc_studies.drops.layer_contact import LayerContact
from antiosc_studies.drops.skin import skin_of

#: Largest size of a piece over the extent, and largest angle between normals of a piece [rad].
PIECE, BENT = 0.35, 0.35
#: A piece has a depth of at least this share of the greatest, to take its law from.
SHALLOW = 0.05
#: Depths over the extent, between which that of a part which moves without turning is looked for.
DEPTHS = np.geomspace(1e-7, 1.0, 29)
#: Largest exponent, of a piece whose volume grows by steps; and least share of its area that a
#: piece is taken to turn to the floor for its law.
STEEPEST, LEAN = 6.0, 0.1


def with_layer_contact(body: FreeBody) -> FreeBody:
    """The body with its surface divided into pieces; itself if it has no faces."""
    if body.layer_contact is not None or body.balls.all():
        return body
    matrices: Any = None if body.structure is None else body.structure.matrices
    surface = _of_hull(body) if matrices is None or matrices.located else _of_skin(body)
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


def _of_hull(body: FreeBody) -> tuple[Array, IntArray, BoolArray] | None:
    """(points, triangles, round vertices) from the convex hull of points alone."""
    from scipy.spatial import ConvexHull, QhullError

    try:
        convex = ConvexHull(body.points)
    except (QhullError, ValueError):
        return None
    triangles = np.asarray(convex.simplices, dtype=int)
    x = body.points[triangles]
    normals = np.cross(x[:, 1] - x[:, 0], x[:, 2] - x[:, 0])
    inside = np.einsum("td,td->t", normals, convex.equations[:, :3]) < 0
    triangles[inside] = triangles[inside, ::-1]
    places = np.column_stack((body.points, body.shapes.reshape(len(body.points), -1)))
    return places, triangles, body.balls > 0


def _of_skin(body: FreeBody) -> tuple[Array, IntArray, BoolArray] | None:
    """(points, triangles, round vertices) of a mesh's surface, without triangles between round
    ones.
    """
    from scipy.spatial import cKDTree

    from antiosc.extension import source

    assert body.structure is not None
    assert body.basis is not None
    skin = skin_of(body.structure)
    rounded = ~skin.sharp & (skin.curvatures[:, 0] * skin.size > 1)
    x, triangles = skin.points - body.centre, skin.triangles
    triangles = triangles[~rounded[triangles].all(axis=1)]
    if not len(triangles):
        return None
    corners = x[triangles]
    normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    if skin.half.any():  # a sheet has two sides
        triangles = np.vstack([triangles, triangles[:, ::-1]])
    else:
        outside = np.einsum("td,tvd->t", normals, skin.normals[triangles]) < 0
        triangles = np.where(outside[:, None], triangles[:, ::-1], triangles)
    nodes, _, moved = source(body.structure).at_nodes(body.structure, body.basis)
    shapes = np.moveaxis(moved[cKDTree(nodes).query(skin.points)[1]], 1, 2)
    at = cKDTree(skin.points).query(body.points + body.centre)[1]
    return np.column_stack((x, shapes.reshape(len(x), -1))), triangles, rounded[at]


def _refined(places: Array, triangles: IntArray, size: float) -> tuple[Array, IntArray]:
    """Triangles whose longest sides are bisected until they are at most a size [m]."""
    while True:
        x = places[triangles, :3]
        sides = np.linalg.norm(np.roll(x, -1, axis=1) - x, axis=2)
        long = sides.max(axis=1) > size
        if not long.any():
            return places, triangles
        first = sides[long].argmax(axis=1)[:, None]
        a, b, c = np.take_along_axis(triangles[long], (first + np.arange(3)) % 3, axis=1).T
        m = len(places) + np.arange(len(a))
        places = np.vstack((places, (places[a] + places[b]) / 2))
        halves = np.column_stack((a, m, c)), np.column_stack((m, b, c))
        triangles = np.vstack((triangles[~long], *halves))


def _pieces(centres: Array, areas: Array, size: float) -> IntArray:
    """Number of the piece of each triangle; pieces are bisected until they are flat and small."""
    weights = np.linalg.norm(areas, axis=1)
    normals, number = areas / weights[:, None], np.zeros(len(areas), dtype=int)
    todo, count = [np.arange(len(areas))], 0
    while todo:
        piece = todo.pop()
        w = weights[piece, None]
        for values, most in ((normals[piece], BENT), (centres[piece], size)):
            off = values - (w * values).sum(axis=0) / w.sum()
            along = off @ np.linalg.eigh((w * off).T @ off)[1][:, -1]
            if np.ptp(along) > most:
                todo += [piece[along < 0], piece[along >= 0]]
                break
        else:
            number[piece], count = count, count + 1
    return number


def with_layer_laws(body: FreeBody, start: State, setting: Setting) -> FreeBody:
    """The body with pieces of its surface as points, from `layer_contact.first` on, after vertices.

    The height of a piece is that at which its law has the force of the volume that it displaces.
    Vertices that are not round are `idle`, and pieces that will hardly touch. A body without a
    layer is returned as it is.
    """
    surface, layer = body.layer_contact, setting.floor.layer
    if surface is None or layer is None:
        return body
    up, z = start.R[2], start.centre[2] + start.lowered(setting.floor.ground)
    ways, each = np.append(0.0, DEPTHS * body.extent), surface.every
    volumes, (low, *_), _ = surface.pressed(each, up, start.q, z - ways)
    modulus = layer.E / layer.thickness
    work = modulus * cumulative_trapezoid(volumes.sum(axis=1), ways, initial=0.0)
    arms = start.arms(body)
    speed = (start.velocity + np.cross(start.spin(body), arms[np.argmin(arms[:, 2])]))[2]
    speed = max(-float(speed), 0.0)
    deepest = max(float(np.interp(body.mass * speed**2 / 2, work, ways)), float(ways[1]))
    depth = np.maximum(deepest - low, SHALLOW * max(deepest - low.min(), float(ways[1])))
    at = z - low - np.outer([1.0, 0.5], depth)
    (volume, half), _, (place, _) = surface.pressed(each, up, start.q, at, LEAN)
    n = np.clip(np.log2(volume / half), 1.0, STEEPEST)
    stiffness = modulus * volume / depth**n
    surface_with_laws = replace(
        surface, share=modulus / stiffness, exponent=n, height=z, speed=speed
    )
    points, shapes, first = place[:, :3], place[:, 3:].reshape(len(place), -1, 3), surface.first
    deep = surface_with_laws.depth(each, volumes[0], low)
    lifts = z + points @ up + np.einsum("vjd,d,j->v", shapes, up, start.q) + deep
    none, rigid = np.full((len(place), 2), np.inf), np.zeros((3, 3))
    return replace(
        body,
        points=np.vstack((body.points, points)),
        shapes=np.concatenate((body.shapes, shapes)),
        balls=np.append(body.balls, lifts),
        radii=np.vstack((body.radii, none)),
        materials=np.vstack((body.materials, np.nan * none)),
        facing=None if body.facing is None else np.vstack((body.facing, 0 * points)),
        layer_contact=surface_with_laws,
        laws={first + k: layer_law(layer, float(stiffness[k]), float(n[k])) for k in each.tolist()},
        idle=np.append(~surface.round, volumes[np.searchsorted(ways, deepest)] == 0),
        _placed=body._placed | {first + k: (shapes[k], rigid, none[k]) for k in each.tolist()},
    )


def layer_energy(body: FreeBody, state: State, setting: Setting) -> float:
    """Elastic energy [J] of a layer under a body: E/t times the integral of displaced volume."""
    surface, layer = body.layer_contact, setting.floor.layer
    if surface is None or layer is None:
        return 0.0
    z = state.centre[2] + state.lowered(setting.floor.ground)
    deep = max(-float(state.heights(body, setting.floor.ground)[: surface.first].min()), 0.0)
    s, weights = np.polynomial.legendre.leggauss(16)
    ways = deep * (1 + s) / 2
    volumes = surface.pressed(surface.every, state.R[2], state.q, z + ways)[0]
    return float(layer.E / layer.thickness * deep / 2 * weights @ volumes.sum(axis=1))
