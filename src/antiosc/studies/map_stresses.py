"""The largest stress anywhere in a part, for the blow at each site of a map.

Struck at the site i by the force F(t), the part moves in the free modes of the map, and in all
modes above them as if F stood still:

    u(t) = sum_j phi_j q_j(t) + [y_i - sum_j phi_j b_ij / (omega_j^2 + s)] F(t)

with y_i = (K + sM)^-1 b_i. The stresses of the modes are recovered once for all sites, those of the
second term at each; these and the search over all nodes and times are the cost.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from antiosc.base._types import Array
from antiosc.base.progress import counting
from antiosc.base.stresses import equivalent
from antiosc.fem.assembly import with_parts
from antiosc.fem.fields import source
from antiosc.fem.platform import on_root
from antiosc.fem.recovery import NodeTensors, Place, place
from antiosc.fem.structure.structure import Structure
from antiosc.simulation.histories.body_motion import Force, motions
from antiosc.studies.free_sites import FreeSites

#: Sites whose static deflections are solved for together.
AT_ONCE = 64
#: Phase in rad by which the last mode turns from one time to the next; of so many times one is
#: looked at in all tensors, and all are in the largest of these.
PHASE, EVERY, CLOSELY = 0.4, 3, 100
#: Times over the run, at least and at most.
TIMES = (200, 3000)
#: Tensors whose stresses at all times fit the cache.
BLOCK = 512


class Stresses(NamedTuple):
    """Fields of an `ImpactMap`."""

    peak_stress: Array
    exposure: Array | None
    stress_points: Array


class _Sought(NamedTuple):
    """Tensors of the modes (S, 6, J), their places (S, 3), their yield strengths (S,) or NaN."""

    modes: Array
    points: Array
    strength: Array


def largest_stresses(
    structure: Structure, seen: FreeSites, forces: list[Force], duration: float
) -> Stresses:
    """The stresses of impacts with these forces, on every rank.

    InputError for parts whose stress is not known: beams whose section has no outline.
    """
    places = sides(structure)
    modes = _recovered(structure, seen.phi, places)
    slow = seen.b / (seen.omega**2 + structure.shift)
    found: list[tuple[float, Array, float]] = []
    with counting("stresses of the map", len(forces), structure.comm.rank) as ready:
        for first in range(0, len(forces), AT_ONCE):
            own = slice(first, first + AT_ONCE)
            y = structure.factorize().solve_block(seen.found.sites.loads[:, own].toarray())
            rest = _recovered(structure, y - seen.phi @ slow[own].T, places)

            def work(own: slice = own, rest: _Sought = rest) -> list[tuple[float, Array, float]]:
                return _of_sites(modes, rest, seen, forces, own, duration)

            found += on_root(structure.comm, work)
            ready(len(found))
    values, points, exposure = (np.array(each) for each in zip(*found, strict=True))
    return Stresses(values, None if np.isnan(exposure).all() else exposure, points)


def sides(structure: Structure) -> list[Place]:
    """Both sides of sheets; of other parts the one place that there is."""
    members = with_parts(structure).fields(np.zeros((structure.rows, 0)), None)
    sheets = any(member.part.kind.sheet for member, _ in members)
    return [place(side, None, None, "global") for side in ("top", "bottom")[: 1 + sheets]]


def _recovered(structure: Structure, shapes: Array, places: list[Place]) -> _Sought:
    """Stresses of shapes (rows of this rank, columns) on the first rank."""
    found: NodeTensors
    points, _, found = source(structure).tensors_at_nodes(structure, shapes, "stress", places)
    yields = [s if isinstance(s, float) else np.nan for s, _ in found.origins]
    return _Sought(
        found.columns.astype(np.float32), points[found.nodes], np.array(yields)[found.origin]
    )


def _of_sites(
    modes: _Sought,
    rest: _Sought,
    seen: FreeSites,
    forces: list[Force],
    own: slice,
    duration: float,
) -> list[tuple[float, Array, float]]:
    """Largest stress, its place and the exposure of some sites."""
    steps = int(np.clip(np.ceil(duration * seen.omega[-1] / PHASE), *TIMES))
    some, b = forces[own], seen.b[own]
    omega = np.broadcast_to(seen.omega, b.shape)
    run = list(motions(omega, b, np.zeros_like(b), some, duration, steps))
    q, F = (np.array([step[k] for step in run], np.float32) for k in (1, 2))
    columns = np.concatenate([modes.modes, rest.modes[:, :, :1]], axis=2)
    sought = [np.ones(len(modes.strength)), 1 / modes.strength]
    found = []
    for i in range(len(some)):
        columns[:, :, -1] = rest.modes[:, :, i]
        x = np.column_stack([q[:, i], F[:, i]])
        seldom = np.union1d(np.arange(0, len(x), EVERY), F[:, i].argmax())
        largest = _largest(columns, x[seldom])
        close = np.unique(
            [k for w in sought for k in np.argsort(np.nan_to_num(w * largest))[-CLOSELY:]]
        )
        largest[close] = _largest(columns[close], x)
        shares = largest * sought[1]
        known = bool(np.isfinite(shares).any())
        worst = int(np.nanargmax(shares) if known else largest.argmax())
        share = float(shares[worst]) if known else np.nan
        found.append((float(largest.max()), modes.points[worst], share))
    return found


def _largest(columns: Array, x: Array) -> Array:
    """Largest von Mises stress (S,) of tensors (S, 6, B) with factors (n, B)."""
    found = np.zeros(len(columns))
    for first in range(0, len(columns), BLOCK):
        block = columns[first : first + BLOCK]
        stress = (block.reshape(-1, block.shape[2]) @ x.T).reshape(len(block), 6, len(x))
        found[first : first + BLOCK] = equivalent(np.moveaxis(stress, 1, -1)).max(axis=1)
    return found
