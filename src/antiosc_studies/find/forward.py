"""The computed signals of an impact anywhere on a surface."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import ArrayLike
from scipy.optimize import nnls
from scipy.spatial import cKDTree

from antiosc import ContactLaw, ElasticPlastic, History, Linear, ModalBody, RigidMass
from antiosc.base._types import Array, IntArray
from antiosc.impact.scene import simulate_impact
from antiosc.impact.settings import Settings
from antiosc.impact.two_bodies import Impact
from antiosc.models.body import ModalModel
from antiosc_studies.find.recording import Recording

#: Dimension of the surface -> number of sites from which a value is interpolated.
NEIGHBOUR_COUNTS = {1: 7, 2: 24}
#: Least cosine between the directions of two sites on one smooth surface.
MIN_SIDE_COSINE = 0.7
#: Weight of the sum of barycentric coordinates over that of the distance.
BARYCENTRIC_WEIGHT = 1e4


@dataclass(frozen=True, eq=False)
class LocalChart:
    """Local coordinates around a place, and the sites from which values are interpolated."""

    origin: Array  # (3,) [m]
    axes: Array  # (d, 3) unit tangents, d = 0 among given points
    sites: IntArray  # (K,) numbers of the sites
    site_coordinates: Array  # (K, d) their coordinates over `size` [m]
    size: float

    def weights(self, x: Array) -> Array:
        """Weights (K,) of the sites for the value at local coordinates x (d,).

        Polyharmonic splines r³ with quadratic polynomials are exact at the sites and of third order
        between them.
        """
        if not len(self.axes):
            return np.ones(1)

        y = self.site_coordinates
        terms = _quadratic_monomials(y)
        terms_at_x = _quadratic_monomials(x[None])[0]
        count, extra = terms.shape
        cubes = np.linalg.norm(y[:, None] - y, axis=2) ** 3
        A = np.block([[cubes, terms], [terms.T, np.zeros((extra, extra))]])
        right = np.append(np.linalg.norm(y - x, axis=1) ** 3, terms_at_x)

        return np.linalg.lstsq(A, right, rcond=1e-12)[0][:count]


def _quadratic_monomials(y: Array) -> Array:
    """Monomials (K, .) of coordinates (K, d) up to degree 2."""
    i, j = np.tril_indices(y.shape[1])
    return np.column_stack([np.ones(len(y)), y, y[:, i] * y[:, j]])


class MapSurface:
    """The sites of a map and the elements between them.

    points, directions : (P, 3); elements : (T, 3) triangles, (T, 2) segments, or empty.
    """

    def __init__(self, points: Array, directions: Array, elements: IntArray) -> None:
        self.points = points
        self.directions = directions
        self.elements = elements
        self._tree = cKDTree(points)

    def spacing(self, i: int) -> float:
        """Mean edge length of the elements at site i [m]; 0 among given points."""
        corners = self.points[self._elements_at([i])]
        if not len(corners):
            return 0.0
        return float(np.linalg.norm(corners - np.roll(corners, 1, axis=1), axis=2).mean())

    def chart(self, place: Array, site: int) -> LocalChart:
        """Local coordinates around a place (3,) near a site."""
        size = self.spacing(site)
        if size == 0.0:
            return LocalChart(place, np.zeros((0, 3)), np.array([site]), np.zeros((1, 0)), 1.0)

        dimension = self.elements.shape[1] - 1
        count = NEIGHBOUR_COUNTS[dimension]
        sites = self._neighbours(place, site, 3 * count)[:count]
        offsets = self.points[sites[:9]] - self.points[site]
        axes = np.linalg.svd(offsets, full_matrices=False)[2][:dimension]

        return LocalChart(place, axes, sites, (self.points[sites] - place) @ axes.T / size, size)

    def nearest(self, place: Array, site: int) -> tuple[Array, int]:
        """(nearest point of the surface, its nearest site), on the side of `site`."""
        candidates = self._elements_at(self._neighbours(place, site, 12))
        if not len(candidates):
            return self.points[site], site

        feet = _nearest_points(place, self.points[candidates])
        best = np.argmin(np.linalg.norm(feet - place, axis=1))
        corners = candidates[best]
        distances = np.linalg.norm(self.points[corners] - feet[best], axis=1)
        return feet[best], int(corners[np.argmin(distances)])

    def _elements_at(self, sites: ArrayLike) -> IntArray:
        """The elements with one of these sites as a corner."""
        return self.elements[np.isin(self.elements, sites).any(axis=1)]

    def _neighbours(self, place: Array, site: int, count: int) -> IntArray:
        """The sites nearest to a place, at most `count`, on the side of `site`."""
        sites = np.atleast_1d(self._tree.query(place, min(count, len(self.points)))[1])
        return sites[self.directions[sites] @ self.directions[site] > MIN_SIDE_COSINE]


def _nearest_points(x: Array, corners: Array) -> Array:
    """Points (T, 3) of triangles (T, 3, 3) or segments (T, 2, 3) that are nearest to x (3,)."""
    offsets = corners - x
    size = BARYCENTRIC_WEIGHT * np.linalg.norm(offsets, axis=2).max()

    # the last row says that the weights of the corners add up to 1
    rows = np.pad(offsets, ((0, 0), (0, 0), (0, 1)), constant_values=size).transpose(0, 2, 1)
    weights = np.array([nnls(A, [0.0, 0.0, 0.0, size])[0] for A in rows])
    weights /= weights.sum(axis=1, keepdims=True)

    return x + np.einsum("tc,tcd->td", weights, offsets)


def has_stiffness(law: ContactLaw) -> bool:
    """Whether a law has a free stiffness; an elastic-plastic ball's stiffness follows from E*."""
    return hasattr(law, "stiffness") and not isinstance(law, ElasticPlastic)


#: Number of steps in the expected contact time.
STEPS_PER_CONTACT = 150
#: Largest number of contacts of a blow.
MAX_CONTACTS = 1000


@dataclass(frozen=True, eq=False)
class CandidateImpact:
    """A candidate impact: the values of all unknowns."""

    place: Array  # (3,) [m]
    site: int  # the nearest site of the map
    #: mass, velocity, stiffness: mass [kg] and velocity [m/s] of the impactor; stiffness of the
    #: law, in its unit
    mass: float
    velocity: float
    stiffness: float
    start: float  # time of the first touch after the first sample [s]
    contact_time_estimate: float  # expected contact time [s]
    frequency_changes: Array  # (J,) relative changes of the natural frequencies
    share_changes: Array  # (m, J) relative changes of the modes' shares in the signals
    E: float = 1.0  # factor of the stiffness of the whole structure


@dataclass(frozen=True, eq=False)
class ComputedSignals:
    """Computed signals of an impact, filtered and divided by their noise, of m sensors."""

    #: (n', m, J) contribution of each mode, without `CandidateImpact.share_changes`
    modal_signals: Array
    signals: Array  # (n', m) the sum
    hit: History  # the impact


@dataclass(frozen=True, eq=False)
class SearchModel:
    """The model of all candidate impacts: free modes, sites, sensors."""

    data: Recording
    surface: MapSurface
    #: omega, decay: (J,) frequencies [rad/s] and decay constants [1/s]
    omega: Array
    decay: Array
    #: rows, orders: (m, J) mode shapes at the sensors; (m,) orders of their time derivatives
    sensor_shapes: Array
    derivative_orders: Array
    site_table: Array  # (P, J + 2) b, residual compliance and local compliance of the sites
    radius: Array
    law: ContactLaw

    @property
    def law_exponent(self) -> float:
        """Exponent n of the law F = k d^n; 1.5 if the law has none."""
        if isinstance(self.law, Linear):
            return 1.0
        return float(getattr(self.law, "exponent", 1.5))

    def modes_at(self, chart: LocalChart, x: Array) -> Array:
        """Modal values b, residual and local compliance (J + 2,) at coordinates x of a chart."""
        return chart.weights(x) @ self.site_table[chart.sites]

    def history_of(self, blow: CandidateImpact, site_data: Array) -> History:
        """The impact at a place with the data `site_data` (J + 2,) of `modes_at`."""
        omega = self.omega * np.sqrt(blow.E) * (1 + blow.frequency_changes)
        b = site_data[:-2]
        r, local = np.maximum(site_data[-2:], 0.0) / blow.E
        modes = ModalBody(omega, b, r=r, decay=self.decay)
        radius = self.radius[blow.site]
        body = ModalModel(modes, local, None if np.isnan(radius) else radius)
        law = self.law
        if has_stiffness(law):
            law = replace(law, stiffness=blow.stiffness)  # type: ignore[type-var]

        end = len(self.data.values) * self.data.dt - blow.start
        step = min(blow.contact_time_estimate / STEPS_PER_CONTACT, end / 20)
        scene = Impact(body, RigidMass(blow.mass, blow.velocity), law, end)
        return simulate_impact(scene, Settings(1e-4, step=step, max_contacts=MAX_CONTACTS))

    def computed_signals(self, blow: CandidateImpact, site_data: Array) -> ComputedSignals:
        """Computed signals of an impact at a place with the data `site_data` (J + 2,)."""
        hit = self.history_of(blow, site_data)
        t = self.data.time - blow.start
        after_start = np.flatnonzero((t >= 0) & (t <= hit.run.time[-1]))
        J = len(self.omega)
        omega = self.omega * np.sqrt(blow.E) * (1 + blow.frequency_changes)
        q, v = (x[:, :J] for x in hit.states(t[after_start]))
        F = hit.force_at(t[after_start])[:, None]
        a = F * site_data[:J] - omega**2 * q - 2 * self.decay * v
        orders = self.derivative_orders.tolist()
        columns = self.data.filter_matrix[:, after_start]
        motions = {order: columns @ (q, v, a)[order] for order in set(orders)}
        rows = self.sensor_shapes / self.data.noise_sigma[:, None]
        parts = np.stack([motions[k] * row for k, row in zip(orders, rows, strict=True)], 1)
        return ComputedSignals(parts, np.sum(parts * (1 + blow.share_changes), axis=2), hit)
