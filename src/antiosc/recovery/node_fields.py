"""Fields of K and M with the coordinates of their nodes; same functions as `mesh_fields`."""

from __future__ import annotations

from typing import cast

import numpy as np

from antiosc.base._types import Array, IntArray
from antiosc.base.errors import InputError
from antiosc.fem.structure import NodalMatrices
from antiosc.fem.structure.structure import Structure
from antiosc.recovery.place import NodeTensors, Reach, check_reach

NO_ELEMENTS_MESSAGE = (
    "given matrices have no {}: they know neither elements nor materials; ask for the displacement,"
    " velocity or acceleration of a node."
)


def at_point(
    structure: Structure, shapes: Array, x: Array, part: str | None, reach: Reach
) -> Array:
    """Displacements (3, columns) at the node nearest to x (3,), for all shapes (rows, columns)."""
    _refuse_part(part)
    nodal = cast(NodalMatrices, structure.matrices)
    points, rows = nodal.nodes()
    nearest = int(np.argmin(((points - x) ** 2).sum(axis=1)))
    check_reach(reach, x, points, nearest)
    return _displacements(rows[nearest : nearest + 1], shapes)[0]


def recovered(
    structure: Structure, shapes: Array, points: Array, part: str | None, quantity: str, *_: object
) -> Array:
    """Always raises InputError: K and M have neither elements nor materials."""
    raise InputError(NO_ELEMENTS_MESSAGE.format(quantity))


def tensors_at_nodes(
    structure: Structure, shapes: Array, quantity: str, *_: object, **__: object
) -> tuple[Array, list[tuple[str, IntArray]], NodeTensors]:
    """Always raises InputError: K and M have neither elements nor materials."""
    raise InputError(NO_ELEMENTS_MESSAGE.format(quantity))


def materials_of(
    structure: Structure, part: str | None, stiffener: str | None = None
) -> list[object]:
    """Always []: K and M have no materials."""
    return []


def families(structure: Structure, part: str | None = None) -> set[str]:
    """Always the empty set: K and M have no elements."""
    return set()


def relaxes(structure: Structure) -> bool:
    """Always False: K and M have no materials."""
    return False


def at_nodes(
    structure: Structure, shapes: Array, part: str | None = None
) -> tuple[Array, list[tuple[str, IntArray]], Array]:
    """(coordinates of nodes (P, 3), one vertex cell for each node, shapes (P, 3, columns))."""
    _refuse_part(part)
    points, rows = cast(NodalMatrices, structure.matrices).nodes()
    vertices = np.arange(len(points))[:, None]
    return points, [("vertex", vertices)], _displacements(rows, shapes)


def _refuse_part(part: str | None) -> None:
    """InputError if a part is named: matrices have no parts."""
    if part is not None:
        raise InputError(f"part={part!r} names a part of an assembly; given matrices are one.")


def _displacements(rows: IntArray, shapes: Array) -> Array:
    """Displacements (P, 3, columns) of P nodes from `rows` (P, 3) of `shapes`; row -1 is 0."""
    return np.where(rows[:, :, None] < 0, 0.0, shapes[rows])
