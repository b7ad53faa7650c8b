"""Strains and stresses of parts that stretch: columns of pairs of modes beside those of shapes.

With amplitudes x of the shapes and a of the modes φ in which a part stretches its motion is
u = Σ x_s ψ_s + Σ a_i a_j v_ij (`antiosc.models.stretch`), and its strain to second order

    ε(u) + η(u, u)/2 = Σ x_s ε(ψ_s) + Σ a_i a_j (ε(v_ij) + η(φ_i, φ_j)/2).

A function that evaluates whole strains ε(s) + η(s, s)/2 gives η of two modes from the strains of
their sum. About the static state q under a prestress, ε(s) is ε(s) + η(q, s).
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np

from antiosc.base._types import Array
from antiosc.fem.structure.structure import Structure
from antiosc.impact.histories.factors import (
    AnyHistory,
    stretch_factors,
    stretch_in,
)
from antiosc.recovery import source
from antiosc.recovery.place import NodeTensors

#: What gives columns (…, B) of shapes (rows, B); True: with the strain η(s, s)/2 of each.
Columns = Callable[[Array, bool], Array]


def _state_strain(at: Columns, structure: Structure, shapes: Array) -> Array:
    """Second-order strains η(q, s) (…, B) of the static state q with shapes s (rows, B)."""
    preload = structure.matrices.preload
    if preload is None or not structure.comm.allreduce(preload.q.any()):
        return np.zeros(shapes.shape[1])
    q = preload.q[:, None]
    largest_of_rank = np.abs(np.hstack([q, shapes])).max(axis=0, initial=0.0)
    largest = np.max(structure.comm.allgather(largest_of_rank), axis=0)
    scale = largest[0] / np.where(largest[1:] > 0, largest[1:], 1.0)
    small = shapes * scale
    return np.asarray((at(q + small, True) - at(q, True) - at(small, True)) / scale)


def with_pairs(
    at: Columns, structure: Structure, history: AnyHistory, body: str, shapes: Array
) -> Array:
    """Columns (…, B) of a body's shapes (rows, B), with η of its modes for the pairs."""
    forces = stretch_in(history, body)
    if forces is None:
        linear = at(shapes, False)
        of_state = _state_strain(at, structure, shapes)
        return linear + of_state if linear.size else linear  # empty on other ranks than the first
    pairs = forces.size * (forces.size + 1) // 2
    count = shapes.shape[1] - pairs
    modes = stretch_factors(history, body).T
    i, j = np.triu_indices(forces.size)
    sums = modes[:, i] + np.where(i == j, 0.0, modes[:, j])
    linear = at(shapes, False)
    square = at(shapes[:, :count] @ sums, True) - linear[..., :count] @ sums  # η(s, s)/2 of each
    squares = square[..., i == j]
    products = (square - squares[..., i] - squares[..., j]) / 2
    linear += _state_strain(at, structure, shapes)
    linear[..., count:] += np.where(i == j, square, products)
    return linear


def tensors_at_nodes(
    structure: Structure, history: AnyHistory, body: str, shapes: Array, *selection: Any
) -> tuple[Any, Any, NodeTensors]:
    """`mesh_fields.tensors_at_nodes` for the motion of a body."""
    results: list[Any] = []

    def at(columns: Array, second_order: bool) -> Array:
        result = source(structure).tensors_at_nodes(
            structure, columns, *selection, second_order=second_order
        )
        results.append(result)
        return np.asarray(result[2].columns)

    columns = with_pairs(at, structure, history, body, shapes)
    points, cells, tensors = results[0]
    return points, cells, tensors._replace(columns=columns)
