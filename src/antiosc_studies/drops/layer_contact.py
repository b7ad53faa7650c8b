"""The surface of a body in pieces, each of which displaces a volume of a soft layer."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from antiosc.base._types import Array, BoolArray, IntArray

#: Depth [m] by which a piece that displaces nothing is clear of the layer.
CLEAR = 1e-12


@dataclass(frozen=True, eq=False)
class LayerContact:
    """The surface of a body in pieces, each of which displaces a volume of a soft layer.

    Attributes
    ----------
    places : (P, 3 + 3 J) points relative to the centre of mass [m], and mode shapes there.
    triangles : (T, 3) between the points, oriented outward; areas : (T, 3) their normals [m^2].
    bounds : (B + 1,) first triangle of each piece, and the number of triangles.
    round : (V,) whether a vertex of the hull is round: then it touches by itself, with its radii.
    share, exponent : (B,) the law of a piece has the depth (share volume)^(1/exponent).
    height : height of the centre of mass over the floor at the touch [m]; speed : downward speed
        of the lowest vertex then [m/s].
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
        """Number of the first point that represents a piece."""
        return len(self.round)

    def pressed(
        self, pieces: IntArray, up: Array, q: Array, z: Array, lean: float = 0.0
    ) -> tuple[Array, Array, Array]:
        """Volumes, lowest heights and centres of pressure of pieces (b,) below the floor.

        Volumes (n, b) [m^3], heights (n, b) [m], centres (n, b, 3 + 3 J) like `places`; a piece
        that displaces nothing has its centroid instead. up : (3,) or (n, 3), the vertical in body
        axes; q : (J,) or (n, J) modal displacements; z : (n,) or (n, b) heights of the centre of
        mass over the floor [m]; lean : least projected share of the area of each triangle.
        """
        if not len(pieces):
            no_pieces = np.zeros((len(z), 0))
            return no_pieces, no_pieces, np.zeros((len(z), 0, self.places.shape[1]))
        counts = np.diff(self.bounds)[pieces]
        starts = np.cumsum(counts) - counts
        rows_of_pieces = np.repeat(self.bounds[pieces] - starts, counts) + np.arange(counts.sum())
        triangles = self.triangles[rows_of_pieces]
        vertices, position = np.unique(triangles, return_inverse=True)
        rows = (*np.broadcast_shapes(up.shape[:-1], q.shape[:-1]), -1)
        raised = np.concatenate((up, (q[..., None] * up[..., None, :]).reshape(rows)), axis=-1)
        h = np.atleast_2d(raised @ self.places[vertices].T)[:, position.reshape(-1, 3)]
        piece_of = np.repeat(np.arange(len(pieces)), counts)
        h = h + (z[:, None] if z.ndim == 1 else z[:, piece_of])[..., None]
        areas = np.linalg.norm(self.areas[rows_of_pieces], axis=1)
        projected = np.maximum(-up @ self.areas[rows_of_pieces].T, lean * areas)
        parts = np.maximum(projected, 0.0)[..., None] * below(h)
        volume = np.add.reduceat(parts.sum(axis=2), starts, axis=1)
        empty = volume <= 0
        total_area = np.add.reduceat(areas, starts)
        parts = np.where(empty[:, piece_of, None], areas[:, None] / 3, parts)
        parts /= np.where(empty, total_area, volume)[:, piece_of, None]
        centres = [
            parts[:, i : i + count].reshape(len(z), -1)
            @ self.places[triangles[i : i + count].ravel()]
            for i, count in zip(starts.tolist(), counts.tolist(), strict=True)
        ]
        lowest = np.minimum.reduceat(h.min(axis=2), starts, axis=1)
        return volume, lowest, np.stack(centres, axis=1)

    def depth(self, pieces: IntArray, volume: Array, low: Array) -> Array:
        """Depths (n, b) [m] at which the pieces' laws give the forces of these volumes; < 0 if
        empty.
        """
        depths = (self.share[pieces] * volume) ** (1 / self.exponent[pieces])
        return np.asarray(np.where(volume > 0, depths, -np.maximum(low, CLEAR)))

    def volume(self, pieces: IntArray, depth: Array) -> Array:
        """Volumes (n, b) [m^3] whose forces are those of the pieces' laws at depths [m]."""
        return np.asarray(np.maximum(depth, 0.0) ** self.exponent[pieces] / self.share[pieces])


def below(h: Array) -> Array:
    """Integrals (..., 3) of max(-h, 0) times barycentric coordinates over triangles of unit area.

    h : (..., 3) heights of their corners [m]. The three integrals add up to the volume below 0.
    """
    p = -h.reshape(-1, 3)
    integrals = np.zeros_like(p)
    lowest = p.min(axis=1)
    submerged = np.flatnonzero(lowest >= 0)
    integrals[submerged] = (p[submerged].sum(axis=1, keepdims=True) + p[submerged]) / 12
    crossed = np.flatnonzero((lowest < 0) & (p.max(axis=1) > 0))
    order = np.argsort(-p[crossed], axis=1)
    p = np.take_along_axis(p[crossed], order, axis=1)  # descending
    one_corner = p[:, 1] <= 0
    part = np.where(one_corner[:, None], 0.0, (p.sum(axis=1, keepdims=True) + p) / 12)
    part[~one_corner] += _tip(-p[~one_corner][:, ::-1])[:, ::-1]
    part[one_corner] = _tip(p[one_corner])
    integrals[crossed[:, None], order] = np.maximum(part, 0.0)
    return integrals.reshape(h.shape)


def _tip(p: Array) -> Array:
    """The integrals of `below` if only corner 0 is submerged: p (T, 3) is positive there alone."""
    share = p[:, :1] / (p[:, :1] - p[:, 1:])
    volume = share.prod(axis=1) * p[:, 0] / 3
    return volume[:, None] * np.column_stack((1 - share.sum(axis=1) / 4, share / 4))
