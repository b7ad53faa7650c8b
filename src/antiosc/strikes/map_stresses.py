"""The largest stress in the part for the impact at each site of a map.

Under the force F(t) at site i the free modes respond dynamically, all other modes statically,

    u(t) = sum_j phi_j q_j(t) + [y_i - sum_j phi_j b_ij / (omega_j^2 + s)] F(t)

with y_i = (K + sM)^-1 b_i. The stresses of the modes are recovered once for all sites.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from antiosc.base._types import Array, IntArray
from antiosc.base.progress import counting, doing
from antiosc.base.stresses import VON_MISES_ROOT
from antiosc.fem.platform import on_root
from antiosc.fem.structure.structure import Structure, with_parts
from antiosc.fields.margin import is_within
from antiosc.impact.from_rest import ForceSeries, motions_from_rest
from antiosc.recovery import source
from antiosc.recovery.place import NodeTensors, Place, place

if TYPE_CHECKING:
    from antiosc.strikes.free_sites import FreeSites

#: Sites whose static deflections are solved for together.
SITES_AT_ONCE = 16
#: Phase of the last mode between two sample times [rad]: they miss at most 2 % of its peak, 1 −
#: cos(SAMPLE_PHASE/2).
SAMPLE_PHASE = 0.4
#: Least and largest number of sample times over the run.
TIME_COUNT_LIMITS = (200, 3000)
#: Number of tensors times number of instants evaluated at once, to fit the cache.
VALUES_AT_ONCE = 200_000
#: Relative rounding of the bounds in single precision.
BOUND_ROUNDING = 1e-3


class MapStresses(NamedTuple):
    """The fields `peak_stress`, `exposure` and `stress_points` of an `ImpactMap`."""

    peak_stress: Array  # (P,) largest von Mises stress for each site [Pa]
    exposure: Array | None  # (P,) largest share of the yield strength
    stress_points: Array  # (P, 3) where [m]


class _ShapeStresses(NamedTuple):
    """Stresses of J shapes at S nodes."""

    components: Array  # (S, 5, J), of a length that is von Mises's stress [Pa]
    points: Array  # (S, 3) [m]
    strength: Array  # (S,) yield strengths [Pa], NaN where unknown


def largest_stresses(
    structure: Structure,
    sites: FreeSites,
    forces: list[ForceSeries],
    duration: float,
    site_numbers: IntArray,
    balls: Array,
) -> MapStresses:
    """The largest stresses in impacts at `site_numbers`; NaN at the other sites, on every rank.

    `balls` (P, 4): x, y, z and radius [m] of a ball to leave out for the impact at each site.
    """
    places = sides(structure)
    with doing("stresses of the free modes"):
        modes = _stresses_of_shapes(structure, sites.phi, places)
    b = sites.b[site_numbers]
    slow = b / (sites.omega**2 + structure.shift)
    loads = sites.map_sites.sites.loads[:, site_numbers]
    largest: list[tuple[float, Array, float]] = []

    with counting("stresses of the map", len(forces)) as ready:
        for first in range(0, len(forces), SITES_AT_ONCE):
            span = slice(first, first + SITES_AT_ONCE)
            y = structure.factorize().solve_block(loads[:, span].toarray())
            residual_stresses = _stresses_of_shapes(structure, y - sites.phi @ slow[span].T, places)

            def work(
                span: slice = span, rest: _ShapeStresses = residual_stresses
            ) -> list[tuple[float, Array, float]]:
                arguments = sites.omega, b[span], forces[span], duration, balls[site_numbers[span]]
                found = []
                for one in _stresses_of_sites(modes, rest, *arguments):
                    found.append(one)
                    ready(span.start + len(found))

                return found

            largest += on_root(structure.comm, work)

    columns = [np.array(column) for column in zip(*largest, strict=True)]
    at_all = [np.full((len(sites.b), *column.shape[1:]), np.nan) for column in columns]
    for of_all, column in zip(at_all, columns, strict=True):
        of_all[site_numbers] = column
    values, points, exposure = at_all

    return MapStresses(values, None if np.isnan(exposure).all() else exposure, points)


def sides(structure: Structure) -> list[Place]:
    """Places across the thickness to evaluate: both sides of sheets, one place in other parts."""
    members = with_parts(structure).fields(np.zeros((structure.rows, 0)), None)
    sheets = any(member.part.kind.sheet for member, _ in members)
    return [place(side, None, None, "global") for side in ("top", "bottom")[: 1 + sheets]]


def _stresses_of_shapes(structure: Structure, shapes: Array, places: list[Place]) -> _ShapeStresses:
    """Stresses of shapes (rows of this rank, columns) on rank 0."""
    tensors: NodeTensors
    points, _, tensors = source(structure).tensors_at_nodes(structure, shapes, "stress", places)
    yields = [s if isinstance(s, float) else np.nan for s, _ in tensors.origins]
    parts: Array = (VON_MISES_ROOT @ tensors.columns).astype("f4")
    return _ShapeStresses(parts, points[tensors.nodes], np.array(yields)[tensors.origin])


def _stresses_of_sites(
    modes: _ShapeStresses,
    residual_stresses: _ShapeStresses,
    omega: Array,
    b: Array,
    site_forces: list[ForceSeries],
    duration: float,
    balls: Array,
) -> Iterator[tuple[float, Array, float]]:
    """Yield (largest stress [Pa], worst point (3,), its exposure) for the impacts at S sites."""
    count = len(site_forces)
    steps = np.full(
        count, int(np.clip(np.ceil(duration * omega[-1] / SAMPLE_PHASE), *TIME_COUNT_LIMITS))
    )
    durations = np.full(count, duration)
    omega = np.broadcast_to(omega, b.shape)
    run = list(motions_from_rest(omega, b, np.zeros_like(b), site_forces, durations, steps))
    q, F = (np.array([step[k] for step in run], np.float32) for k in (1, 2))
    columns = np.concatenate([modes.components, residual_stresses.components[:, :, :1]], axis=2)
    for i in range(count):
        columns[:, :, -1] = residual_stresses.components[:, :, i]
        x = np.column_stack([q[:, i], F[:, i]])
        outside = ~is_within(modes.points, balls[i : i + 1])
        outside |= not outside.any()
        stress, worst = _largest_stress(columns, x, outside.astype(float))
        share = np.nan
        if np.isfinite(modes.strength[outside]).any():
            share, worst = _largest_stress(columns, x, np.nan_to_num(outside / modes.strength))
        yield stress, modes.points[worst], share


def _largest_stress(columns: Array, x: Array, weights: Array) -> tuple[float, int]:
    """Largest weighted von Mises stress in a run, and the number of its node.

    columns : (S, 5, B) stresses of the shapes; x : (n, B) their factors in time; weights : (S,).

    Tensors are evaluated by descending bounds, until a bound is below the largest stress found.
    """
    rotated, y, bounds = _principal_rotation(columns, x)
    bounds *= weights
    order = np.argsort(-bounds)
    at_once = max(VALUES_AT_ONCE // len(y), 1)
    most, at = -1.0, 0
    for first in range(0, len(order), at_once):
        block = order[first : first + at_once]
        if bounds[block[0]] * (1 + BOUND_ROUNDING) <= most:
            break
        stress = (rotated[block].reshape(-1, rotated.shape[2]) @ y.T).reshape(len(block), 5, -1)
        largest = np.sqrt(np.einsum("spn,spn->sn", stress, stress).max(axis=1)) * weights[block]
        if largest.max() > most:
            most, at = float(largest.max()), int(block[largest.argmax()])

    return most, at


def _principal_rotation(columns: Array, x: Array) -> tuple[Array, Array, Array]:
    """(`columns` and factors `x` in principal components, bounds (S,) on the stress in a run)."""
    sizes = np.sqrt(np.einsum("spb,spb->b", columns, columns))
    sizes = np.where(sizes > 0, sizes, 1.0)
    weighted = x * sizes
    directions = np.linalg.eigh(weighted.T @ weighted)[1].astype(columns.dtype)
    rotated = (columns / sizes.astype(columns.dtype)) @ directions
    y = (weighted @ directions).astype(columns.dtype)
    lengths = np.sqrt(np.einsum("spb,spb->sb", rotated, rotated))
    return rotated, y, lengths @ np.abs(y).max(axis=0)
