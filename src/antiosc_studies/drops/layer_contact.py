"""The surface of a body in pieces, of which each displaces a volume of a soft layer."""

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
        """Number of the first point that represents a piece."""
        return len(self.round)

    def pressed(
        self, pieces: IntArray, up: Array, q: Array, z: Array, lean: float = 0.0
    ) -> tuple[Array, Array, Array]:
        """Volumes, lowest heights and centres of pressure of pieces (b,) below the floor.

        Volumes (n, b) [m^3], heights (n, b) [m], centres (n, b, 3 + 3 J) in the form of `places`; a
        piece that displaces nothing has its centroid instead.

        up : (3,) or (n, 3), the vertical in the axes of the body; q : (J,) or (n, J) of the modes.
        z : (n,) or (n, b) heights of the centre of mass over the floor [m]. lean : least projected
        share of the area of each triangle.
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
        projected = np.maximum(-up @ self.areas[own].T, lean * areas)
        parts = np.maximum(projected, 0.0)[..., None] * below(h)
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
        """Depths (n, b) [m] at which the laws of pieces give the forces of these volumes; < 0 if
        empty.
        """
        deep = (self.share[pieces] * volume) ** (1 / self.exponent[pieces])
        return np.asarray(np.where(volume > 0, deep, -np.maximum(low, CLEAR)))

    def volume(self, pieces: IntArray, depth: Array) -> Array:
        """Volumes (n, b) [m^3] of the layer that make the forces of pieces' laws at depths [m]."""
        return np.asarray(np.maximum(depth, 0.0) ** self.exponent[pieces] / self.share[pieces])


def below(h: Array) -> Array:
    """Integrals (..., 3) of max(-h, 0) times the barycentric coordinates, over triangles of area 1.

    h : (..., 3) heights of their corners [m]. Each sum is the volume below 0.
    """
    p = -h.reshape(-1, 3)
    integrals, lowest = np.zeros_like(p), p.min(axis=1)
    under = np.flatnonzero(lowest >= 0)
    integrals[under] = (p[under].sum(axis=1, keepdims=True) + p[under]) / 12
    cut = np.flatnonzero((lowest < 0) & (p.max(axis=1) > 0))
    order = np.argsort(-p[cut], axis=1)
    p = np.take_along_axis(p[cut], order, axis=1)  # descending
    alone = p[:, 1] <= 0
    part = np.where(alone[:, None], 0.0, (p.sum(axis=1, keepdims=True) + p) / 12)
    part[~alone] += _tip(-p[~alone][:, ::-1])[:, ::-1]
    part[alone] = _tip(p[alone])
    integrals[cut[:, None], order] = np.maximum(part, 0.0)
    return integrals.reshape(h.shape)


def _tip(p: Array) -> Array:
    """As `below` where only corner 0 is submerged, p (T, 3) positive there alone."""
    share = p[:, :1] / (p[:, :1] - p[:, 1:])
    volume = share.prod(axis=1) * p[:, 0] / 3
    return volume[:, None] * np.column_stack((1 - share.sum(axis=1) / 4, share / 4))
