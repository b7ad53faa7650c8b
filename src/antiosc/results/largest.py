"""The largest stresses of a part over a run, and how much of the strength they use."""

from __future__ import annotations

import functools
from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np

from antiosc.base._types import Array, IntArray
from antiosc.base.strengths import Strengths, exposure
from antiosc.base.stresses import equivalent, extreme_principal
from antiosc.fem.fields import source
from antiosc.fem.recovery.place import NodeTensors, Place, layers_of
from antiosc.fem.structure.structure import Structure
from antiosc.results.margin import Margin, margin_of

#: Surfaces of every ply at which a criterion of plies is largest: stresses in the plane are linear
#: in a layer, the shear across it is a parabola.
PLY_SURFACES = {
    "tsai_hill": ("bottom", "top"),
    "tsai_wu": ("bottom", "top"),
    "delamination": ("bottom", "middle", "top"),
}
#: Criterion -> what a material needs for it.
STRENGTH_OF = {
    "yield": "a yield_strength, as Solid(…, yield_strength=250e6)",
    "tsai_hill": "layers that have a strength: Layer(…, strength=Strengths(…))",
    "tsai_wu": "layers that have a strength: Layer(…, strength=Strengths(…))",
    "delamination": "layers that have Layer(…, strength=Strengths(…, interlaminar=…))",
}
#: Components (S, c, B), scalar -> largest values (S,), their times, what they may miss.
Search = Callable[[Array, Callable[[Array], Array]], tuple[Array, Array, float | None]]


class Largest(NamedTuple):
    """Largest values at all points and what goes with them, as in a `PeakField`."""

    values: Array
    times: Array
    error: float | None
    exposure: Array | None = None
    margin: Margin | None = None

    def or_larger(self, other: Largest) -> Largest:
        """At each point the larger of both."""
        times = np.where(other.values > self.values, other.times, self.times)
        margins = [one.margin for one in (self, other) if one.margin is not None]
        worst = max(margins, key=lambda margin: margin.exposure, default=None)
        values, error = np.maximum(self.values, other.values), _larger(self.error, other.error)
        return Largest(values, times, error, values, worst)


def _larger(error: float | None, other: float | None) -> float | None:
    """The larger of two errors, or the one that is known."""
    known = [one for one in (error, other) if one is not None]
    return max(known, default=None)


def plies(structure: Structure, quantity: str, part: str | None) -> list[Place | None]:
    """Surfaces of layers at which a criterion of plies is looked at; [None] of other quantities."""
    if quantity not in PLY_SURFACES:
        return [None]
    materials = source(structure).materials_of(structure, part)
    return [
        Place(surface, layer, local=True)
        for layer in range(max(map(len, map(layers_of, materials)), default=0))
        for surface in PLY_SURFACES[quantity]
    ]


def criteria_of(structure: Structure) -> list[str]:
    """The quantities of `peak_field` for which materials of the structure have strengths."""
    materials = source(structure).materials_of(structure, None)
    own = [getattr(material, "yield_strength", None) for material in materials]
    own += [layer.strength for material in materials for layer in layers_of(material)]
    asked = {"von_mises": "yield", "tsai_wu": "tsai_wu", "delamination": "delamination"}
    return [name for name, c in asked.items() if any(_knows(strength, c) for strength in own)]


def with_strength(criterion: str, found: NodeTensors) -> NodeTensors:
    """The tensors whose material has the strength; no origins if none has."""
    known = [_knows(strength, criterion) for strength, _ in found.origins]
    own = np.array(known, dtype=bool)[found.origin]
    arrays = found.nodes[own], found.columns[own], found.origin[own]
    return NodeTensors(*arrays, found.origins if any(known) else [])


def _knows(strength: Any, criterion: str) -> bool:
    """Whether a strength serves a criterion."""
    if criterion == "delamination":
        return getattr(strength, "interlaminar", None) is not None
    return isinstance(strength, Strengths if criterion in PLY_SURFACES else float)


def stresses(quantity: str, points: Array, found: NodeTensors, search: Search) -> Largest:
    """The largest values of tensors, with exposures and margin where strengths are known."""
    criterion = quantity
    if quantity in PLY_SURFACES:
        own, then, error = _of_plies(quantity, found, search)
        strengths = np.ones(len(own))
    else:
        scalar = extreme_principal if quantity in ("stress", "strain") else equivalent
        own, then, error = search(found.columns, scalar)
        yields = [s if isinstance(s, float) else np.nan for s, _ in found.origins]
        strengths, criterion = np.array(yields)[found.origin], "yield"
        if scalar is extreme_principal:
            strengths[:] = np.nan
    exposures, margin = None, None
    if np.isfinite(strengths).any():
        share = np.nan_to_num(own / strengths)
        exposures, _ = at_points(found.nodes, share, then, len(points))
        places = [found.origins[k].place for k in found.origin]
        margin = margin_of(criterion, own, strengths, points[found.nodes], then, places)
        if quantity == "yield":
            own, error = share, error and error / float(strengths.min())
    values, when = at_points(found.nodes, own, then, len(points))
    return Largest(values, when, error, exposures, margin)


def _of_plies(
    criterion: str, found: NodeTensors, search: Search
) -> tuple[Array, Array, float | None]:
    """Largest exposures, their times, what they may miss: layers of equal strength together."""
    values, when, missed = np.zeros(len(found.nodes)), np.zeros(len(found.nodes)), None
    of_origin = [strength for strength, _ in found.origins]
    for strength in dict.fromkeys(s for s in of_origin if isinstance(s, Strengths)):
        own = np.isin(found.origin, [k for k, s in enumerate(of_origin) if s == strength])
        scalar = functools.partial(exposure, criterion, strength)
        values[own], when[own], error = search(found.columns[own], scalar)
        missed = _larger(missed, error)
    return values, when, missed


def at_points(nodes: IntArray, values: Array, when: Array, count: int) -> tuple[Array, Array]:
    """The largest of the values of each node, and its time."""
    order = np.argsort(values, kind="stable")  # the largest is written last
    best, time = np.zeros(count), np.zeros(count)
    best[nodes[order]], time[nodes[order]] = values[order], when[order]
    return best, time
