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

from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
from scipy.integrate import cumulative_trapezoid

from antiosc.base._types import Array, BoolArray, IntArray
from antiosc_studies.drops.body import FreeBody
from antiosc_studies.drops.flight import State
from antiosc_studies.drops.floor import Setting, cushion
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
#: Depth [m] by which a piece that displaces nothing is clear of the layer.
CLEAR = 1e-12


@dataclass(frozen=True, eq=False)
class LayerContact:
    """The surface of a body in pieces, as a soft layer presses it.

    Attributes
    ----------
    places : (P, 3 + 3 J) points relative to the centre of mass [m], and displacements in the modes.
    triangles : (T, 3) between the points, counted from outside; areas : (T, 3) their normals [m^2].
    bounds : (B + 1,) first triangles of the pieces.
    round : (V,) whether a vertex of the hull is round: it touches by itself, with its radii.
    share, exponent : (B,) of the laws of the pieces, whose depths are (share volume)^(1/exponent).
    height : of the centre of mass over the floor at the touch [m]; speed : at which the lowest
        vertex then comes down [m/s].
    """

    places: Array
    triangles: IntArray
    areas: Array
    bounds: IntArray
    round: BoolArray
    share: Array = field(default_factory=lambda: np.zeros(0))
    exponent: Array = field(default_factory=lambda: np.zeros(0))
    height: float = 0.0
    speed: float = 0.0

    @property
    def every(self) -> IntArray:
        """Numbers (B,) of the pieces."""
        return np.arange(len(self.bounds) - 1)

    @property
    def first(self) -> int:
        """Number of the point that is the first piece."""
        return len(self.round)

    def pressed(
        self, pieces: IntArray, up: Array, q: Array, z: Array, lean: float = 0.0
    ) -> tuple[Array, Array, Array]:
        """Volumes (n, b) [m^3] of pieces (b,) below the floor, their lowest heights (n, b) [m], and
        centres of pressure (n, b, 3 + 3 J) as `places`; without volume those of whole pieces.

        up : (3,) or (n, 3), the vertical in the axes of the body; q : (J,) or (n, J) of the modes.
        z : (n,) or (n, b) heights of the centre of mass over the floor [m].
        lean : share of its area that each triangle turns to the floor at least.
        """
        if not len(pieces):
            none = np.zeros((len(z), 0))
            return none, none, np.zeros((len(z), 0, self.places.shape[1]))
        counts = np.diff(self.bounds)[pieces]
        begins = np.cumsum(counts) - counts
        own = np.repeat(self.bounds[pieces] - begins, counts) + np.arange(counts.sum())
        triangles = self.triangles[own]
        which, back = np.unique(triangles, return_inverse=True)
        rows = (*np.broadcast_shapes(up.shape[:-1], q.shape[:-1]), -1)
        raised = np.concatenate((up, (q[..., None] * up[..., None, :]).reshape(rows)), axis=-1)
        h = np.atleast_2d(raised @ self.places[which].T)[:, back.reshape(-1, 3)]
        each = np.repeat(np.arange(len(pieces)), counts)
        h = h + (z[:, None] if z.ndim == 1 else z[:, each])[..., None]
        areas = np.linalg.norm(self.areas[own], axis=1)
        found = np.maximum(-up @ self.areas[own].T, lean * areas)
        parts = np.maximum(found, 0.0)[..., None] * below(h)
        volume = np.add.reduceat(parts.sum(axis=2), begins, axis=1)
        empty, whole = volume <= 0, np.add.reduceat(areas, begins)
        parts = np.where(empty[:, each, None], areas[:, None] / 3, parts)
        parts /= np.where(empty, whole, volume)[:, each, None]
        centres = [
            parts[:, i : i + count].reshape(len(z), -1)
            @ self.places[triangles[i : i + count].ravel()]
            for i, count in zip(begins.tolist(), counts.tolist(), strict=True)
        ]
        low = np.minimum.reduceat(h.min(axis=2), begins, axis=1)
        return volume, low, np.stack(centres, axis=1)

    def depth(self, pieces: IntArray, volume: Array, low: Array) -> Array:
        """Depths (n, b) [m] at which the laws of pieces have the forces of volumes; < 0 without."""
        deep = (self.share[pieces] * volume) ** (1 / self.exponent[pieces])
        return np.asarray(np.where(volume > 0, deep, -np.maximum(low, CLEAR)))

    def volume(self, pieces: IntArray, depth: Array) -> Array:
        """Volumes (n, b) [m^3] of which the laws of pieces have the forces at depths [m]."""
        return np.asarray(np.maximum(depth, 0.0) ** self.exponent[pieces] / self.share[pieces])


def below(h: Array) -> Array:
    """Integrals (..., 3) of max(-h, 0) times the barycentric coordinates, over triangles of area 1.

    h : (..., 3) heights of their corners [m]. Each sum is the volume below 0.
    """
    p = -h.reshape(-1, 3)
    found, lowest = np.zeros_like(p), p.min(axis=1)
    under = np.flatnonzero(lowest >= 0)
    found[under] = (p[under].sum(axis=1, keepdims=True) + p[under]) / 12
    cut = np.flatnonzero((lowest < 0) & (p.max(axis=1) > 0))
    order = np.argsort(-p[cut], axis=1)
    p = np.take_along_axis(p[cut], order, axis=1)  # descending
    alone = p[:, 1] <= 0
    part = np.where(alone[:, None], 0.0, (p.sum(axis=1, keepdims=True) + p) / 12)
    part[~alone] += _tip(-p[~alone][:, ::-1])[:, ::-1]
    part[alone] = _tip(p[alone])
    found[cut[:, None], order] = np.maximum(part, 0.0)
    return found.reshape(h.shape)


def _tip(p: Array) -> Array:
    """The same of the corner 0 alone, where p (T, 3) is > 0; it vanishes across the triangle."""
    share = p[:, :1] / (p[:, :1] - p[:, 1:])
    volume = share.prod(axis=1) * p[:, 0] / 3
    return volume[:, None] * np.column_stack((1 - share.sum(axis=1) / 4, share / 4))


def with_layer_contact(body: FreeBody) -> FreeBody:
    """The body with its surface as a layer presses it; itself if it has no faces."""
    if body.layer_contact is not None or body.balls.all():
        return body
    matrices: Any = None if body.structure is None else body.structure.matrices
    found = _of_hull(body) if matrices is None or matrices.located else _of_skin(body)
    if found is None:
        return body
    places, triangles, rounded = found
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
    """Of points alone: the faces of their hull."""
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

    from antiosc.recovery import source

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
        a, b, c = np.take_along_axis(triangles[long], (first + np.arange(3)) % 3, axis=1).T
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
    own = replace(surface, share=modulus / stiffness, exponent=n, height=z, speed=speed)
    points, shapes, first = place[:, :3], place[:, 3:].reshape(len(place), -1, 3), surface.first
    deep = own.depth(each, volumes[0], low)
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
        layer_contact=own,
        laws={first + k: cushion(layer, float(stiffness[k]), float(n[k])) for k in each.tolist()},
        idle=np.append(~surface.round, volumes[np.searchsorted(ways, deepest)] == 0),
        _placed=body._placed | {first + k: (shapes[k], rigid, none[k]) for k in each.tolist()},
    )


def layer_energy(body: FreeBody, state: State, setting: Setting) -> float:
    """Energy [J] of a layer under a body: E/t times the volumes on the way up to it."""
    surface, layer = body.layer_contact, setting.floor.layer
    if surface is None or layer is None:
        return 0.0
    z = state.centre[2] + state.lowered(setting.floor.ground)
    deep = max(-float(state.heights(body, setting.floor.ground)[: surface.first].min()), 0.0)
    s, weights = np.polynomial.legendre.leggauss(16)
    ways = deep * (1 + s) / 2
    volumes = surface.pressed(surface.every, state.R[2], state.q, z + ways)[0]
    return float(layer.E / layer.thickness * deep / 2 * weights @ volumes.sum(axis=1))
