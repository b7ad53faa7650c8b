"""The largest stress in the part for the impact at each site of a map."""

from __future__ import annotations

from collections.abc import Iterator
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from antiosc.base._types import Array, IntArray
from antiosc.base.progress import counting, doing
from antiosc.base.stresses import DEVIATOR
from antiosc.fem.assembly import with_parts
from antiosc.fem.platform import on_root
from antiosc.fem.structure.structure import Structure
from antiosc.fields.margin import is_within
from antiosc.impact.from_rest import Force, motions
from antiosc.recovery import source
from antiosc.recovery.place import NodeTensors, Place, place

if TYPE_CHECKING:
    from antiosc.strikes.free_sites import FreeSites

#: Sites whose static deflections are solved for together.
AT_ONCE = 16
#: Phase of the last mode between two sample times [rad]: they miss at most 2 % of its peak, 1 −
#: cos(PHASE/2).
PHASE = 0.4
#: Least and largest number of sample times over the run.
TIMES = (200, 3000)
#: Tensors times times whose stresses are evaluated at once, to fit the cache.
BLOCK = 200_000
#: Relative rounding of the bounds in single precision.
ROUNDING = 1e-3


class Stresses(NamedTuple):
    """The stress fields of an `ImpactMap`."""

    peak_stress: Array
    exposure: Array | None
    stress_points: Array


class _Sought(NamedTuple):
    """Parts of stresses (S, 5, J) of von Mises's length, points (S, 3), strengths (S,) or NaN."""

    modes: Array
    points: Array
    strength: Array


def largest_stresses(
    structure: Structure,
    sites: FreeSites,
    forces: list[Force],
    duration: float,
    which: IntArray,
    balls: Array,
) -> Stresses:
    """The largest stresses in impacts at the sites `which`; NaN at the others, on every rank.

    `balls` (P, 4): x, y, z and radius [m] of what is left out for the impact at each site.
    """
    places = sides(structure)
    with doing("stresses of the free modes", structure.comm.rank):
        modes = _stresses_of_shapes(structure, sites.phi, places)
    b = sites.b[which]
    slow = b / (sites.omega**2 + structure.shift)
    loads = sites.map_sites.sites.loads[:, which]
    largest: list[tuple[float, Array, float]] = []

    with counting("stresses of the map", len(forces), structure.comm.rank) as ready:
        for first in range(0, len(forces), AT_ONCE):
            span = slice(first, first + AT_ONCE)
            y = structure.factorize().solve_block(loads[:, span].toarray())
            residual_stresses = _stresses_of_shapes(structure, y - sites.phi @ slow[span].T, places)

            def work(
                span: slice = span, rest: _Sought = residual_stresses
            ) -> list[tuple[float, Array, float]]:
                arguments = sites.omega, b[span], forces[span], duration, balls[which[span]]
                found = []
                for one in _of_sites(modes, rest, *arguments):
                    found.append(one)
                    ready(span.start + len(found))

                return found

            largest += on_root(structure.comm, work)

    columns = [np.array(column) for column in zip(*largest, strict=True)]
    at_all = [np.full((len(sites.b), *column.shape[1:]), np.nan) for column in columns]
    for of_all, column in zip(at_all, columns, strict=True):
        of_all[which] = column
    values, points, exposure = at_all

    return Stresses(values, None if np.isnan(exposure).all() else exposure, points)


def sides(structure: Structure) -> list[Place]:
    """Both sides of sheets; for other parts a single position."""
    members = with_parts(structure).fields(np.zeros((structure.rows, 0)), None)
    sheets = any(member.part.kind.sheet for member, _ in members)
    return [place(side, None, None, "global") for side in ("top", "bottom")[: 1 + sheets]]


def _stresses_of_shapes(structure: Structure, shapes: Array, places: list[Place]) -> _Sought:
    """Stresses of shapes (rows of this rank, columns) on rank 0."""
    tensors: NodeTensors
    points, _, tensors = source(structure).tensors_at_nodes(structure, shapes, "stress", places)
    yields = [s if isinstance(s, float) else np.nan for s, _ in tensors.origins]
    parts: Array = (DEVIATOR @ tensors.columns).astype("f4")
    return _Sought(parts, points[tensors.nodes], np.array(yields)[tensors.origin])


def _of_sites(
    modes: _Sought,
    residual_stresses: _Sought,
    omega: Array,
    b: Array,
    site_forces: list[Force],
    duration: float,
    balls: Array,
) -> Iterator[tuple[float, Array, float]]:
    """Yields (largest stress [Pa], worst point, exposure there) for the impacts at some sites."""
    count = len(site_forces)
    steps = np.full(count, int(np.clip(np.ceil(duration * omega[-1] / PHASE), *TIMES)))
    durations = np.full(count, duration)
    omega = np.broadcast_to(omega, b.shape)
    run = list(motions(omega, b, np.zeros_like(b), site_forces, durations, steps))
    q, F = (np.array([step[k] for step in run], np.float32) for k in (1, 2))
    columns = np.concatenate([modes.modes, residual_stresses.modes[:, :, :1]], axis=2)
    for i in range(count):
        columns[:, :, -1] = residual_stresses.modes[:, :, i]
        x = np.column_stack([q[:, i], F[:, i]])
        outside = ~is_within(modes.points, balls[i : i + 1])
        outside |= not outside.any()
        stress, worst = _largest(columns, x, outside.astype(float))
        share = np.nan
        if np.isfinite(modes.strength[outside]).any():
            share, worst = _largest(columns, x, np.nan_to_num(outside / modes.strength))
        yield stress, modes.points[worst], share


def _largest(columns: Array, x: Array, weights: Array) -> tuple[float, int]:
    """(largest stress, its tensor) of parts (S, 5, B) with factors (n, B), times weights (S,).

    Tensors are evaluated in the order of a bound on them, until it is below the largest stress.
    """
    rotated, y, bounds = _bounded(columns, x)
    bounds *= weights
    order = np.argsort(-bounds)
    at_once = max(BLOCK // len(y), 1)
    most, at = -1.0, 0
    for first in range(0, len(order), at_once):
        block = order[first : first + at_once]
        if bounds[block[0]] * (1 + ROUNDING) <= most:
            break
        stress = (rotated[block].reshape(-1, rotated.shape[2]) @ y.T).reshape(len(block), 5, -1)
        largest = np.sqrt(np.einsum("spn,spn->sn", stress, stress).max(axis=1)) * weights[block]
        if largest.max() > most:
            most, at = float(largest.max()), int(block[largest.argmax()])

    return most, at


def _bounded(columns: Array, x: Array) -> tuple[Array, Array, Array]:
    """(columns, factors, bounds (S,) on the lengths of their products), rotated to principal
    factors: a few of these make up most of a run, and bound it closely.
    """
    sizes = np.sqrt(np.einsum("spb,spb->b", columns, columns))
    sizes = np.where(sizes > 0, sizes, 1.0)
    weighted = x * sizes
    directions = np.linalg.eigh(weighted.T @ weighted)[1].astype(columns.dtype)
    rotated = (columns / sizes.astype(columns.dtype)) @ directions
    y = (weighted @ directions).astype(columns.dtype)
    lengths = np.sqrt(np.einsum("spb,spb->sb", rotated, rotated))
    return rotated, y, lengths @ np.abs(y).max(axis=0)
