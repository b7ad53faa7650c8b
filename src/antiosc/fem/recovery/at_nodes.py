"""Strains or stresses of shapes at the nodes of a mesh.

In solids they are the means of the cells of one material around each node, so that a node between
two materials has two. In sheets and beams each cell has its own: neighbours may meet at a fold.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from scipy.sparse import csr_matrix

from antiosc.base._types import Array, IntArray
from antiosc.base.errors import InputError
from antiosc.base.stresses import PAIRS, equivalent
from antiosc.fem.platform import compat
from antiosc.fem.platform.mpi import agree
from antiosc.fem.recovery import Place
from antiosc.fem.recovery.tensors import PointsInCells, evaluator
from antiosc.fem.structure.meshed import MeshedStructure

#: Points at which shapes are evaluated at once.
AT_ONCE = 4096


def at_nodes(
    part: MeshedStructure, shapes: Array, quantity: str, place: Place, materials: Sequence[int]
) -> tuple[IntArray, IntArray, Array]:
    """Nodes (S,) of this rank, number of the material (S,), six components (S, 6, columns) there.

    `quantity` "strain" or "stress"; `shapes` (rows of this rank, columns); `materials`: numbers of
    those whose cells are meant. To be called on all ranks.
    """
    mesh = part.mesh
    shapes = compat.with_ghosts(part.form.space, shapes)
    evaluate = evaluator(part, quantity, place)
    material = part.part_of_cells()[: compat.cell_map(mesh.dolfinx).size_local]
    chosen = np.flatnonzero(np.isin(material, materials))
    nodes, material = compat.geometry_nodes(mesh.dolfinx)[chosen], material[chosen]
    X = mesh.geometry.reference_nodes
    solid = part.kind.name == "solid"
    if solid:  # a slot for each node and material
        keys = nodes * len(part.parts) + material[:, None]
    else:
        keys = np.arange(nodes.size).reshape(nodes.shape)
    slots, slot_of = np.unique(keys, return_inverse=True)
    slot_of = slot_of.reshape(keys.shape)
    node = slots // len(part.parts) if solid else nodes.ravel()
    kind = slots % len(part.parts) if solid else np.repeat(material, nodes.shape[1])
    total, count = np.zeros((len(slots), 6, shapes.shape[1])), np.zeros(len(slots))
    step = max(1, AT_ONCE // len(X))
    error = None
    for first in range(0, len(chosen), step):
        cells = chosen[first : first + step]
        at = PointsInCells(part, shapes, np.repeat(cells, len(X)), np.tile(X, (len(cells), 1)))
        try:
            found = evaluate(at)
        except InputError as caught:  # on this rank perhaps alone
            error = caught
            break
        where = slot_of[first : first + step].ravel()
        six = np.stack([found[:, i, j] for i, j in PAIRS], axis=1).reshape(len(where), -1)
        one, column = np.ones(len(where)), np.arange(len(where))
        at_slots = csr_matrix((one, (where, column)), (len(slots), len(where)))
        total += (at_slots @ six).reshape(total.shape)
        count += np.bincount(where, minlength=len(slots))
    agree(mesh.comm, error)
    if solid:
        _share(part, slots, total, count)
    return node, kind, total / count[:, None, None]


def jumps(part: MeshedStructure, shapes: Array, factors: Array) -> Array:
    """Largest von Mises stress (nodes,) of what stresses of a solid's cells differ from their mean.

    Zienkiewicz and Zhu's estimate of the error of a stress, at each node of this rank: the mean of
    the cells of one material is taken for the smooth stress. Of a node of one cell, the largest
    difference at the other nodes of this cell. `factors` (nodes, columns) of the shapes there. To
    be called on all ranks.
    """
    mesh = part.mesh
    shapes = compat.with_ghosts(part.form.space, shapes)
    evaluate = evaluator(part, "stress", Place())
    own = compat.cell_map(mesh.dolfinx).size_local
    nodes, X = compat.geometry_nodes(mesh.dolfinx)[:own], mesh.geometry.reference_nodes
    six = np.zeros((own, len(X), 6))
    step = max(1, AT_ONCE // len(X))
    for first in range(0, own, step):
        cells = np.arange(first, min(own, first + step))
        at = PointsInCells(part, shapes, np.repeat(cells, len(X)), np.tile(X, (len(cells), 1)))
        found = np.einsum("pijk,pk->pij", evaluate(at), factors[nodes[cells].ravel()])
        six[cells] = np.stack([found[:, i, j] for i, j in PAIRS], axis=1).reshape(-1, len(X), 6)
    keys = nodes * len(part.parts) + part.part_of_cells()[:own, None]
    slots, slot_of = np.unique(keys, return_inverse=True)
    slot_of = slot_of.reshape(keys.shape)
    total, count = np.zeros((len(slots), 6, 1)), np.zeros(len(slots))
    np.add.at(total, slot_of, six[..., None])
    np.add.at(count, slot_of, 1.0)
    _share(part, slots, total, count, np.add)
    different = equivalent(six - total[slot_of, :, 0] / count[slot_of][..., None])
    alone = count[slot_of] == 1
    different = np.where(alone, different.max(axis=1, keepdims=True), different)
    largest = np.zeros((len(slots), 1, 1))
    np.maximum.at(largest[:, 0, 0], slot_of, different)
    _share(part, slots, largest, count, np.maximum)
    result = np.zeros(len(mesh.dolfinx.geometry.x))
    np.maximum.at(result, slots // len(part.parts), largest[:, 0, 0])
    return result


def _share(
    part: MeshedStructure, slots: IntArray, total: Array, count: Array, joined: np.ufunc = np.add
) -> None:
    """Join what other ranks have in the slots of common nodes to the totals."""
    comm, parts = part.mesh.comm, len(part.parts)
    if comm.size == 1:
        return
    number = np.asarray(part.mesh.dolfinx.geometry.input_global_indices)
    names = number[slots // parts] * parts + slots % parts
    every = np.concatenate(comm.allgather(names))
    common, times = np.unique(every, return_counts=True)
    mine = np.flatnonzero(np.isin(names, common[times > 1]))
    pieces = comm.allgather((names[mine], total[mine], count[mine]))
    slot_of = {name: i for i, name in zip(mine, names[mine], strict=True)}
    for rank, (those, sums, numbers) in enumerate(pieces):
        if rank == comm.rank:
            continue
        for name, value, cells in zip(those, sums, numbers, strict=True):
            if name in slot_of:
                total[slot_of[name]] = joined(total[slot_of[name]], value)
                count[slot_of[name]] += cells
