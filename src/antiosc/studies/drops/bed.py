"""A soft layer as a bed of springs under the faces and edges of a part.

A layer that is thin against the area of contact gives way at each place by itself (Winkler; Johnson,
Contact Mechanics, 1985, 4.3 and 5.8): the pressure is E/t times the indentation there, and the force
E/t times the volume V of the part below the surface of the layer. The surface of the part is divided
into pieces, each of which is one contact at its centre of pressure with a law by the volume that it
displaces as the part has turned at the touch,

    F = (E/t) V(d) = k d^n,

with k and n from the volumes at the depth that the piece reaches and at half of it: n = 1 of a face
that lies flat, 2 of an edge and 3 of a corner.
"""

from __future__ import annotations

from dataclasses import replace
from functools import partial

import numpy as np
from scipy.integrate import cumulative_trapezoid

from antiosc.base._types import Array, BoolArray, IntArray
from antiosc.studies.drops.body import Bed, FreeBody, skin_of
from antiosc.studies.drops.flight import State
from antiosc.studies.drops.floor import Setting, SoftLayer, cushion

#: Largest size of a piece over the extent, and largest angle between normals of a piece [rad].
PIECE, BENT = 0.25, 0.35
#: A piece has a depth of at least this share of the greatest, to take its law from.
SHALLOW = 0.05
#: Depths over the extent, between which that of a part which moves without turning is looked for.
DEPTHS = np.geomspace(1e-7, 1.0, 29)
#: Largest exponent, of a piece whose volume grows by steps; in place of 0 where it divides.
STEEPEST, TINY = 6.0, 1e-300


def bedded(body: FreeBody) -> FreeBody:
    """The body with its surface as a bed presses it; itself if it has no faces."""
    if body.bed is not None or body.balls.all():
        return body
    found = _of_hull(body) if body.structure is None else _of_skin(body)
    if found is None:
        return body
    places, triangles, rounded = found
    size = PIECE * body.extent
    places, triangles = _refined(places, triangles, size / 2)
    x = places[triangles, :3]
    areas = np.cross(x[:, 1] - x[:, 0], x[:, 2] - x[:, 0]) / 2
    piece = _pieces(x.mean(axis=1), areas, size)
    return replace(body, bed=Bed(places, triangles, areas, piece, rounded))


def _of_hull(body: FreeBody) -> tuple[Array, IntArray, BoolArray] | None:
    """Of a rigid body: the faces of the hull of its points."""
    from scipy.spatial import ConvexHull, QhullError

    try:
        found = ConvexHull(body.points)
    except (QhullError, ValueError):
        return None
    triangles = np.asarray(found.simplices, dtype=int)
    x = body.points[triangles]
    normals = np.cross(x[:, 1] - x[:, 0], x[:, 2] - x[:, 0])
    inside = np.einsum("td,td->t", normals, found.equations[:, :3]) < 0
    triangles[inside] = triangles[inside, ::-1]
    places = np.column_stack((body.points, body.shapes.reshape(len(body.points), -1)))
    return places, triangles, body.balls > 0


def _of_skin(body: FreeBody) -> tuple[Array, IntArray, BoolArray] | None:
    """Of a mesh: its surface, without the triangles between round vertices."""
    from scipy.spatial import cKDTree

    from antiosc.fem.fields import source

    assert body.structure is not None and body.basis is not None
    skin = skin_of(body.structure)
    rounded = ~skin.sharp & (skin.curvatures[:, 0] * skin.size > 1)
    x, triangles = skin.points - body.centre, skin.triangles
    triangles = triangles[~rounded[triangles].all(axis=1)]
    if not len(triangles):
        return None
    normals = np.cross(x[triangles[:, 1]] - x[triangles[:, 0]], x[triangles[:, 2]] - x[triangles[:, 0]])
    if skin.half.any():  # a sheet has two sides
        triangles = np.vstack([triangles, triangles[:, ::-1]])
    else:
        outside = np.einsum("td,tvd->t", normals, skin.normals[triangles]) < 0
        triangles = np.where(outside[:, None], triangles[:, ::-1], triangles)
    nodes, _, moved = source(body.structure).at_nodes(body.structure, body.basis)
    own = np.moveaxis(moved[cKDTree(nodes).query(skin.points)[1]], 1, 2)
    at = cKDTree(skin.points).query(body.points + body.centre)[1]
    return np.column_stack((x, own.reshape(len(x), -1))), triangles, rounded[at]


def _refined(places: Array, triangles: IntArray, size: float) -> tuple[Array, IntArray]:
    """Triangles whose longest sides are halved until they are at most a size [m]."""
    while True:
        x = places[triangles, :3]
        sides = np.linalg.norm(np.roll(x, -1, axis=1) - x, axis=2)
        long = sides.max(axis=1) > size
        if not long.any():
            return places, triangles
        first = sides[long].argmax(axis=1)[:, None]
        a, b, c = np.take_along_axis(triangles[long], (first + [0, 1, 2]) % 3, axis=1).T
        m = len(places) + np.arange(len(a))
        places = np.vstack((places, (places[a] + places[b]) / 2))
        halves = np.column_stack((a, m, c)), np.column_stack((m, b, c))
        triangles = np.vstack((triangles[~long], *halves))


def _pieces(centres: Array, areas: Array, size: float) -> IntArray:
    """Number of the piece of each triangle; pieces are halved until they are flat and small."""
    weights = np.linalg.norm(areas, axis=1)
    normals, number = areas / weights[:, None], np.zeros(len(areas), dtype=int)
    todo, count = [np.arange(len(areas))], 0
    while todo:
        own = todo.pop()
        w = weights[own, None]
        for values, most in ((normals[own], BENT), (centres[own], size)):
            off = values - (w * values).sum(axis=0) / w.sum()
            along = off @ np.linalg.eigh((w * off).T @ off)[1][:, -1]
            if np.ptp(along) > most:
                todo += [own[along < 0], own[along >= 0]]
                break
        else:
            number[own], count = count, count + 1
    return number


def laid(
    body: FreeBody, start: State, setting: Setting, reached: dict[int, float] | None = None
) -> FreeBody:
    """The body whose points are the pieces that face the floor, and its round vertices.

    A body without a bed is returned as it is.

    reached : number of a point -> its largest depth [m], where it is known.
    """
    bed, layer, up = body.bed, setting.floor.layer, start.R[2]
    if bed is None or layer is None:
        return body
    down = -(bed.areas @ up)
    facing = np.flatnonzero(down > 0)
    triangles, piece, down = bed.triangles[facing], bed.piece[facing], down[facing]
    raised = np.concatenate((up, np.outer(start.q, up).ravel()))
    z = (bed.places @ raised)[triangles] + start.centre[2] + start.lowered(setting.floor.ground)
    low = np.full(bed.count, np.inf)
    np.minimum.at(low, piece, z.min(axis=1))
    first = len(body.points) if bed.round.any() else 0
    deepest = _deepest(body, start, layer, z, down)
    depth = np.maximum(deepest + low.min() - low, SHALLOW * deepest)
    for i, d in (reached or {}).items():
        if i >= first:
            depth[i - first] = max(d, SHALLOW * deepest)
    whole, half = (
        down[:, None] * wetted(z - low[piece, None], d[piece]) for d in (depth, depth / 2)
    )
    volume, part = (np.bincount(piece, each.sum(axis=1), bed.count) for each in (whole, half))
    places = np.zeros((bed.count, bed.places.shape[1]))
    for k in range(3):
        np.add.at(places, piece, whole[:, k, None] * bed.places[triangles[:, k]])
    touching = np.flatnonzero(volume > 0)
    places[touching] /= volume[touching, None]
    n = np.ones(bed.count)
    n[touching] = np.clip(np.log2(volume[touching] / part[touching]), 1.0, STEEPEST)
    k = layer.E / layer.thickness * volume / depth**n
    lifts = np.zeros(bed.count)
    lifts[touching] = (places @ raised - low)[touching] + z[0, 0] - bed.places[triangles[0, 0]] @ raised
    idle = np.ones(first + bed.count, dtype=bool)
    idle[first + touching] = False
    idle[:first] = ~bed.round[:first]
    shapes = places[:, 3:].reshape(bed.count, -1, 3)
    points = np.vstack((body.points[:first], places[:, :3]))
    shapes = np.concatenate((body.shapes[:first], shapes))
    count = np.full((bed.count, 2), np.inf)
    return replace(
        body,
        points=points,
        shapes=shapes,
        balls=np.append(body.balls[:first], lifts),
        radii=np.vstack((body.radii[:first], count)),
        materials=np.vstack((body.materials[:first], np.nan * count)),
        strengths=None,
        facing=None if body.facing is None else np.vstack((body.facing[:first], 0 * points[first:])),
        residual=partial(_sites, body, shapes) if first else None,
        laws={first + i: cushion(layer, float(k[i]), float(n[i])) for i in touching.tolist()},
        idle=idle,
        deepest=deepest,
        _known={},
    )


def _sites(body: FreeBody, shapes: Array, which: IntArray) -> tuple[Array, Array]:
    """Shapes and residual compliances of vertices of a body, and of pieces, which have none."""
    phi, r, own = shapes[which], np.zeros((len(which), 3, 3)), which < len(body.points)
    if own.any():
        phi[own], r[own] = body.sites(which[own])
    return phi, r


def _deepest(body: FreeBody, start: State, layer: SoftLayer, z: Array, down: Array) -> float:
    """Depth [m] of the lowest place where the bed has taken the speed of that place, or is now."""
    d = DEPTHS * body.extent
    now = max(-float(z.min()), 0.0)
    volume = np.array([down @ wetted(z - z.min(), np.full(len(z), at)).sum(axis=1) for at in d])
    work = layer.E / layer.thickness * cumulative_trapezoid(volume, d, initial=0.0)
    arms = start.arms(body)
    speed = start.velocity + np.cross(start.spin(body), arms[np.argmin(arms[:, 2])])
    return max(float(np.interp(body.mass * min(speed[2], 0.0) ** 2 / 2, work, d)), now)


def wetted(h: Array, d: Array) -> Array:
    """Integrals (T, 3) of max(d - h, 0) times the barycentric coordinates, over triangles of area 1.

    h : (T, 3) heights of their corners [m]; d : (T,) depth. Each sum is the volume below d.
    """
    order = np.argsort(h, axis=1)
    p = d[:, None] - np.take_along_axis(h, order, axis=1)  # descending
    found = (p.sum(axis=1, keepdims=True) + p) / 12  # as if all of it were below
    above, alone = (p[:, 2] < 0) & (p[:, 1] > 0), (p[:, 1] <= 0) & (p[:, 0] > 0)
    found[above] += _tip(-p[above][:, ::-1])[:, ::-1]
    found[alone] = _tip(p[alone])
    found[p[:, 0] <= 0] = 0.0
    back = np.empty_like(found)
    np.put_along_axis(back, order, found, axis=1)
    return back


def _tip(p: Array) -> Array:
    """The same of the corner 0 alone, where p (T, 3) is > 0; it vanishes across the triangle."""
    share = p[:, :1] / (p[:, :1] - p[:, 1:])
    volume = share.prod(axis=1) * p[:, 0] / 3
    return volume[:, None] * np.column_stack((1 - share.sum(axis=1) / 4, share / 4))
