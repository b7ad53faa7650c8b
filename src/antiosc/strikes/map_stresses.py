"""The largest stress in the part for the impact at each site of a map."""

from __future__ import annotations

import time
from collections.abc import Callable
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from antiosc.base._types import Array, BoolArray, IntArray
from antiosc.base.progress import counting, doing
from antiosc.base.stresses import equivalent
from antiosc.fem.assembly import with_parts
from antiosc.fem.platform import on_root
from antiosc.fem.structure.structure import Structure
from antiosc.fields.margin import NOTHING, balls_of_edges, is_within
from antiosc.impact.from_rest import Force, motions
from antiosc.recovery import source
from antiosc.recovery.place import NodeTensors, Place, place
from antiosc.strikes.free_sites import FreeSites

if TYPE_CHECKING:
    from antiosc.strikes.map_results import MapInfo

#: Sites whose static deflections are solved for together.
AT_ONCE = 16
#: Phase of the last mode between two sample times [rad]: they miss at most 2 % of its peak, 1 −
#: cos(PHASE/2).
PHASE = 0.4
#: Every EVERY-th time is evaluated in all tensors (at most 17 % of the last mode are missed), …
EVERY = 3
#: … and all times in so many tensors with the largest values.
CLOSELY = 100
#: Least and largest number of sample times over the run.
TIMES = (200, 3000)
#: Seconds of the recovery of a shape's stresses for a dof.
RECOVERY = 3e-6
#: Tensors whose stresses at all times fit the cache.
BLOCK = 512


class Stresses(NamedTuple):
    """The stress fields of an `ImpactMap`."""

    peak_stress: Array
    exposure: Array | None
    stress_points: Array


class _Sought(NamedTuple):
    """Stress tensors of the modes (S, 6, J), points (S, 3), and yield strengths (S,), NaN if
    unknown.
    """

    modes: Array
    points: Array
    strength: Array

    def of(self, chosen: BoolArray) -> _Sought:
        """Those of some of the tensors."""
        return _Sought(self.modes[chosen], self.points[chosen], self.strength[chosen])


def largest_stresses(
    structure: Structure,
    sites: FreeSites,
    forces: list[Force],
    duration: float,
    which: IntArray,
    balls: Array,
    sharp_edges: bool = True,
) -> Stresses:
    """The largest stresses in impacts with these forces at the sites `which`, on every rank; NaN at
    the others.

    `balls` (P, 4): x, y, z and radius [m] of what is left out for the impact at each site. Without
    `sharp_edges` these and rigid supports are left out too, as by `peak_field`.

    InputError for parts whose stress is not known: beams whose section has no outline.
    """
    places = sides(structure)
    with doing("stresses of the free modes", structure.comm.rank):
        modes = _recovered(structure, sites.phi, places)
        edges = NOTHING
        if not sharp_edges:
            edges = np.concatenate(balls_of_edges(structure, sites.phi, None))
    judged = _outside(modes.points, edges)
    modes = modes.of(judged)
    b = sites.b[which]
    slow = b / (sites.omega**2 + structure.shift)
    loads = sites.map_sites.sites.loads[:, which]
    largest: list[tuple[float, Array, float]] = []
    with counting("stresses of the map", len(forces), structure.comm.rank) as ready:
        for first in range(0, len(forces), AT_ONCE):
            span = slice(first, first + AT_ONCE)
            y = structure.factorize().solve_block(loads[:, span].toarray())
            of_span = _recovered(structure, y - sites.phi @ slow[span].T, places)
            residual_stresses = of_span.of(judged)

            def work(
                span: slice = span, rest: _Sought = residual_stresses
            ) -> list[tuple[float, Array, float]]:
                arguments = sites.omega, b[span], forces[span], duration, balls[which[span]]
                return _of_sites(modes, rest, *arguments, lambda i: ready(span.start + i))

            largest += on_root(structure.comm, work)
    values, points, exposure = (
        _at_sites(np.array(column), which, len(sites.b)) for column in zip(*largest, strict=True)
    )
    return Stresses(values, None if np.isnan(exposure).all() else exposure, points)


def _at_sites(values: Array, which: IntArray, count: int) -> Array:
    """Values of some of `count` sites with NaN at the others."""
    of_all = np.full((count, *values.shape[1:]), np.nan)
    of_all[which] = values
    return of_all


def stress_seconds(structure: Structure, info: MapInfo, duration: float, count: int) -> float:
    """Seconds that the largest stresses for blows at so many sites of a map will take.

    Of the search over nodes and times a small part is done here, so that its time is that of this
    machine, busy as it is.
    """
    modes = info["free_modes"]
    steps = sample_count(2 * np.pi * info["highest_mode"], duration)
    random = np.random.default_rng(0)
    shapes = (BLOCK, 6, modes + 1), (steps // EVERY, modes + 1)
    columns, x = (np.asarray(random.standard_normal(shape), dtype="f4") for shape in shapes)
    _largest(columns, x)  # the first one wakes the processor
    start_time = time.perf_counter()
    _largest(columns, x)
    of_block = time.perf_counter() - start_time
    tensors = structure.dofs / 3 * len(sides(structure)) + 2 * EVERY * CLOSELY
    solves = info["seconds"]["deflections"] / info["sites"]
    recovery = RECOVERY * structure.dofs
    return count * (of_block * tensors / BLOCK + solves + recovery) + recovery * modes


def sample_count(highest: float, duration: float) -> int:
    """Number of sample times of a run, for modes up to a frequency [rad/s]."""
    return int(np.clip(np.ceil(duration * highest / PHASE), *TIMES))


def sides(structure: Structure) -> list[Place]:
    """Both sides of sheets; for other parts a single position."""
    members = with_parts(structure).fields(np.zeros((structure.rows, 0)), None)
    sheets = any(member.part.kind.sheet for member, _ in members)
    return [place(side, None, None, "global") for side in ("top", "bottom")[: 1 + sheets]]


def _recovered(structure: Structure, shapes: Array, places: list[Place]) -> _Sought:
    """Stresses of shapes (rows of this rank, columns) on rank 0."""
    tensors: NodeTensors
    points, _, tensors = source(structure).tensors_at_nodes(structure, shapes, "stress", places)
    yields = [s if isinstance(s, float) else np.nan for s, _ in tensors.origins]
    return _Sought(
        tensors.columns.astype(np.float32), points[tensors.nodes], np.array(yields)[tensors.origin]
    )


def _of_sites(
    modes: _Sought,
    residual_stresses: _Sought,
    omega: Array,
    b: Array,
    site_forces: list[Force],
    duration: float,
    balls: Array,
    ready: Callable[[int], None],
) -> list[tuple[float, Array, float]]:
    """(largest stress [Pa], worst point, exposure there) for the impacts at some sites, whose
    displacements in the modes of frequencies `omega` (J,) are b (n, J).

    The worst point has the largest exposure, or the largest stress if no strength is known.
    """
    steps = sample_count(omega[-1], duration)
    omega = np.broadcast_to(omega, b.shape)
    run = list(motions(omega, b, np.zeros_like(b), site_forces, duration, steps))
    q, F = (np.array([step[k] for step in run], np.float32) for k in (1, 2))
    columns = np.concatenate([modes.modes, residual_stresses.modes[:, :, :1]], axis=2)
    scales = [np.ones(len(modes.strength)), 1 / modes.strength]
    results = []
    for i in range(len(site_forces)):
        columns[:, :, -1] = residual_stresses.modes[:, :, i]
        x = np.column_stack([q[:, i], F[:, i]])
        seldom = np.union1d(np.arange(0, len(x), EVERY), F[:, i].argmax())
        outside = _outside(modes.points, balls[i : i + 1])
        largest = _largest(columns, x[seldom]) * outside
        close = np.unique(
            [k for w in scales for k in np.argsort(np.nan_to_num(w * largest))[-CLOSELY:]]
        )
        largest[close] = _largest(columns[close], x) * outside[close]
        shares = largest * scales[1]
        has_strength = bool(np.isfinite(shares).any())
        worst = int(np.nanargmax(shares) if has_strength else largest.argmax())
        share = float(shares[worst]) if has_strength else np.nan
        results.append((float(largest.max()), modes.points[worst], share))
        ready(i + 1)
    return results


def _outside(points: Array, balls: Array) -> BoolArray:
    """Mask (S,) of the points (S, 3) outside balls (n, 4); all if none is."""
    outside = ~is_within(points, balls)
    return np.asarray(outside | ~outside.any())


def _largest(columns: Array, x: Array) -> Array:
    """Largest von Mises stress (S,) of tensors (S, 6, B) with factors (n, B)."""
    largest = np.zeros(len(columns))
    for first in range(0, len(columns), BLOCK):
        block = columns[first : first + BLOCK]
        stress = (block.reshape(-1, block.shape[2]) @ x.T).reshape(len(block), 6, len(x))
        largest[first : first + BLOCK] = equivalent(np.moveaxis(stress, 1, -1)).max(axis=1)
    return largest
