"""Strains or stresses of shapes at the nodes of a mesh.

In solids they are the means of the cells of one material around each node, so that a node between
two materials has two. In sheets and beams each cell has its own: neighbours may meet at a fold.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from types import ModuleType
from typing import Any

import numpy as np

from antiosc.base._types import Array, IntArray
from antiosc.base.errors import InputError
from antiosc.base.strengths import Strengths
from antiosc.base.stresses import PAIRS
from antiosc.fem import compat
from antiosc.fem.mpi import agree
from antiosc.fem.recovery import beam, sheet, solid, truss
from antiosc.fem.recovery.place import Place
from antiosc.fem.recovery.points import PointsInCells
from antiosc.fem.recovery.sheet import SheetAxes
from antiosc.fem.structure.meshed import MeshedStructure

FAMILIES: dict[str, ModuleType] = {"solid": solid, "beam": beam, "sheet": sheet, "truss": truss}
#: Gives a quantity (P, …, columns) at points.
Evaluate = Callable[[PointsInCells], Array]


def strength_of(material: Any, place: Place) -> float | Strengths | None:
    """Yield strength of a material, or the strengths of the layer of a laminate; None: unknown."""
    layers = getattr(material, "layers", None)
    if layers is None:
        return getattr(material, "yield_strength", None)
    return None if place.layer is None else layers[place.layer].strength


def evaluator(part: MeshedStructure, quantity: str, place: Place) -> Evaluate:
    """What gives "strain", "stress", "rotation" or "section_forces"; to be made on all ranks."""
    family = FAMILIES[part.kind.name]
    function = getattr(family, quantity)
    if family is sheet and quantity != "rotation":
        axes = SheetAxes(part)
        return lambda at: function(at, place, axes)
    return lambda at: function(at, place)


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
        np.add.at(total, where, np.stack([found[:, i, j] for i, j in PAIRS], axis=1))
        np.add.at(count, where, 1.0)
    agree(mesh.comm, error)
    if solid and mesh.comm.size > 1:
        _share(part, slots, total, count)
    return node, kind, total / count[:, None, None]


def _share(part: MeshedStructure, slots: IntArray, total: Array, count: Array) -> None:
    """Add what other ranks have in the slots of common nodes."""
    comm, parts = part.mesh.comm, len(part.parts)
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
                total[slot_of[name]] += value
                count[slot_of[name]] += cells
