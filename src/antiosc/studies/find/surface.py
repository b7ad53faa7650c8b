"""Values between the sites of a surface, and the way along it: where the struck place may lie."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.spatial import cKDTree

from antiosc.base._types import Array, IntArray

#: Sites from which a value is interpolated, of surfaces and of lines.
NEIGHBOURS = {1: 7, 2: 24}
#: Cosine between the directions of two sites of one smooth surface, at least.
SAME_SIDE = 0.7


@dataclass(frozen=True, eq=False)
class Chart:
    """A neighbourhood of a place: its tangents, and the sites from which values are interpolated.

    Attributes
    ----------
    origin : (3,) [m]; axes : (d, 3) unit tangents, d = 0 among given points.
    near : (K,) numbers of sites; local : (K, d) their coordinates over `size` [m].
    """

    origin: Array
    axes: Array
    near: IntArray
    local: Array
    size: float

    def weights(self, x: Array) -> Array:
        """(K,) weights of the sites for the value at local coordinates x (d,).

        Polyharmonic splines r³ with polynomials of second degree: exact at the sites, and of third
        order between them.
        """
        if not len(self.axes):
            return np.ones(1)
        y = self.local
        terms, at = _quadratics(y), _quadratics(x[None])[0]
        count, extra = terms.shape
        A = np.zeros((count + extra, count + extra))
        A[:count, :count] = np.linalg.norm(y[:, None] - y[None], axis=2) ** 3
        A[:count, count:], A[count:, :count] = terms, terms.T
        right = np.append(np.linalg.norm(y - x, axis=1) ** 3, at)
        return np.asarray(np.linalg.lstsq(A, right, rcond=1e-12)[0][:count])


def _quadratics(y: Array) -> Array:
    """Monomials (K, .) of coordinates (K, d) up to the second degree."""
    products = [y[:, i] * y[:, j] for i in range(y.shape[1]) for j in range(i + 1)]
    return np.column_stack([np.ones(len(y)), y, *products])


class Surface:
    """The sites of a map with the elements between them.

    Parameters
    ----------
    points, directions : (P, 3); elements : (T, 3) triangles, (T, 2) segments, or none.
    """

    def __init__(self, points: Array, directions: Array, elements: IntArray) -> None:
        self.points, self.directions, self.elements = points, directions, elements
        self.dimension = elements.shape[1] - 1 if len(elements) else 0
        self._tree = cKDTree(points)
        self._of: list[IntArray] = []
        if self.dimension:
            order = np.argsort(elements.ravel(), kind="stable")
            ends = np.cumsum(np.bincount(elements.ravel(), minlength=len(points)))[:-1]
            self._of = np.split(order // elements.shape[1], ends)

    def spacing(self, i: int) -> float:
        """Mean length of the edges of the elements at site i [m]; 0 among given points."""
        if not self.dimension or not len(self._of[i]):
            return 0.0
        corners = self.points[self.elements[self._of[i]]]
        return float(np.linalg.norm(corners - np.roll(corners, 1, axis=1), axis=2).mean())

    def chart(self, place: Array, site: int) -> Chart:
        """The neighbourhood of a place (3,) beside a site."""
        size = self.spacing(site)
        if size == 0.0:
            return Chart(place, np.zeros((0, 3)), np.array([site]), np.zeros((1, 0)), 1.0)
        wanted = NEIGHBOURS[self.dimension]
        near = np.atleast_1d(self._tree.query(place, min(3 * wanted, len(self.points)))[1])
        near = near[self.directions[near] @ self.directions[site] > SAME_SIDE][:wanted]
        spread = self.points[near[: min(9, len(near))]] - self.points[site]
        axes = np.linalg.svd(spread, full_matrices=False)[2][: self.dimension]
        return Chart(place, axes, near, (self.points[near] - place) @ axes.T / size, size)

    def nearest(self, place: Array, site: int) -> tuple[Array, int]:
        """The point of the surface next to a place, and its next site, on the side of `site`."""
        if not self.dimension:
            return self.points[site], site
        near = np.atleast_1d(self._tree.query(place, min(12, len(self.points)))[1])
        near = near[self.directions[near] @ self.directions[site] > SAME_SIDE]
        around = [self._of[i] for i in near]
        if not sum(map(len, around)):
            return self.points[site], site
        found = self.elements[np.unique(np.concatenate(around))]
        feet = _feet(place, self.points[found])
        best = int(np.argmin(np.linalg.norm(feet - place, axis=1)))
        corners = found[best]
        far = np.linalg.norm(self.points[corners] - feet[best], axis=1)
        return feet[best], int(corners[np.argmin(far)])


def _feet(x: Array, corners: Array) -> Array:
    """Points (T, 3) next to x (3,) of triangles (T, 3, 3) or segments (T, 2, 3)."""
    count = corners.shape[1]
    edges = [(i, (i + 1) % count) for i in range(count if count > 2 else 1)]
    feet = []
    for i, j in edges:
        a, along = corners[:, i], corners[:, j] - corners[:, i]
        t = np.einsum("td,td->t", x - a, along) / np.einsum("td,td->t", along, along)
        feet.append(a + np.clip(t, 0.0, 1.0)[:, None] * along)
    every = np.array(feet)
    far = np.linalg.norm(every - x, axis=2)
    best = every[np.argmin(far, axis=0), np.arange(len(corners))]
    if count == 3:
        a, u, v = corners[:, 0], corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]
        uu, uv, vv = ((p * q).sum(axis=1) for p, q in ((u, u), (u, v), (v, v)))
        wu, wv = ((x - a) * u).sum(axis=1), ((x - a) * v).sum(axis=1)
        det = np.maximum(uu * vv - uv**2, np.finfo(float).tiny)
        s, t = (vv * wu - uv * wv) / det, (uu * wv - uv * wu) / det
        inside = (s >= 0) & (t >= 0) & (s + t <= 1)
        best = np.where(inside[:, None], a + s[:, None] * u + t[:, None] * v, best)
    return np.asarray(best)
