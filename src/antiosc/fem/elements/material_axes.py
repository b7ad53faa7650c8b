"""Direction of 0° and side of the last layer of a layered shell in every cell.

Layers are stacked along the normals of the cells, which follow from the order of their nodes, or
toward a given `top`; on a plane mesh, where the node order is arbitrary, toward +z. Where a stack
differs from itself seen from the other side, cells with a common edge must have their normals on
one side: the energy alone does not show an error in this.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING

import numpy as np

from antiosc.base._types import Array, BoolArray, IntArray
from antiosc.base.checks import array, checked_by, in_words, positive
from antiosc.base.errors import InputError
from antiosc.fem.elements.weak_form import Parts
from antiosc.fem.mesh.mesh import Mesh
from antiosc.fem.platform import compat
from antiosc.fem.platform.mpi import agreed, on_root

if TYPE_CHECKING:
    from dolfinx import fem

#: A vector, or a function of points x (3, n) that gives one (3, n) in each
Direction = Sequence[float] | Callable[[Array], Array]

#: Sine of the least angle between `axis` and the normal, and between `top` and the sheet.
LEAST_SINE = 0.05
#: Corners of a cell in the order around it, dolfinx's numbers.
CORNERS_IN_TURN = {"triangle": [0, 1, 2], "quadrilateral": [0, 1, 3, 2]}


def checked(name: str, direction: object) -> Direction:
    """`direction` if it is a non-zero vector or a function; otherwise InputError."""
    if callable(direction):
        return direction  # type: ignore[no-any-return]
    vector = array(name, direction, (3,))
    positive(f"the length of {name}", np.linalg.norm(vector))
    return tuple(vector.tolist())


DIRECTION = checked_by(checked)


def axes_and_sides(mesh: Mesh, parts: Parts) -> tuple[fem.Function, fem.Function]:
    """(a vector near 0°, whose part along the sheet is meant; ±1 on the cell's normal), cell-wise.

    Raises
    ------
    InputError
        An axis along the normal, a top along the surface, inconsistent normals of neighbours.
    """
    x = mesh.dolfinx.geometry.x[compat.geometry_nodes(mesh.dolfinx)]
    normals = _normals(mesh, x)
    axes, sides = compat.cellwise(mesh.dolfinx, 3), compat.cellwise(mesh.dolfinx)
    axis, side = axes.x.array.reshape(-1, 3), sides.x.array
    axis[:], side[:] = x[:, 1] - x[:, 0], 1.0
    has_sides, stated = np.zeros(len(x), dtype=bool), np.zeros(len(x), dtype=bool)

    def work() -> None:
        for material, cells in parts:
            if material.axis is not None:
                axis[cells] = _axis(material.axis, x[cells], normals[cells])
            top = (0.0, 0.0, 1.0) if material.top is None and mesh.gdim == 2 else material.top
            if top is not None:
                side[cells] = _side(top, x[cells], normals[cells])
            has_sides[cells] = material.section.has_sides
            stated[cells] = material.top is not None

    agreed(mesh.comm, work)
    if any(material.section.has_sides for material, _ in parts):
        _check_neighbours(mesh, x, side, has_sides, stated)
    return axes, sides


def _normals(mesh: Mesh, x: Array) -> Array:
    """Unit normals (cells, points, 3) at the nodes of the cells."""
    slopes = compat.lattice_gradients(mesh.cell, mesh.order, mesh.order)
    J = np.einsum("dqn,cni->dcqi", slopes, x, optimize=True)
    normals = np.cross(J[0], J[1])
    return np.asarray(normals / np.linalg.norm(normals, axis=2, keepdims=True))


def _axis(direction: Direction, x: Array, normals: Array) -> Array:
    """Unit vectors (cells, 3) along `direction`, nowhere along the normal."""
    axis = _at("axis", direction, x)
    along = np.linalg.norm(np.cross(axis[:, None], normals), axis=2).min(axis=1)
    _refuse(
        along < LEAST_SINE,
        x,
        f"the axis{shown_direction(direction)} is normal to the sheet",
        "choose a direction along the surface, a function of x, or a separate laminate for these "
        "cells",
    )
    return axis


def _side(direction: Direction, x: Array, normals: Array) -> Array:
    """±1 (cells,): the sign with which the normal points to the top."""
    up = np.einsum("ci,cqi->cq", _at("top", direction, x), normals)
    side = np.sign(up[:, 0])
    _refuse(
        (up * side[:, None]).min(axis=1) < LEAST_SINE,
        x,
        f"top{shown_direction(direction)} lies along the sheet",
        "choose a direction off the surface, a function of x, or a separate laminate for these "
        "cells",
    )
    return np.asarray(side)


def _at(name: str, direction: Direction, x: Array) -> Array:
    """The unit direction at the middle of every cell (cells, 3)."""
    given = direction(x.mean(axis=1).T) if callable(direction) else np.reshape(direction, (3, 1))
    vectors = array(f"{name}, as a function of x (3, n),", given, (3, None)).T
    vectors = np.broadcast_to(vectors, (len(x), 3))
    lengths = np.linalg.norm(vectors, axis=1, keepdims=True)
    _refuse(lengths[:, 0] == 0, x, f"{name} has no length", "give a direction everywhere")
    return np.asarray(vectors / lengths)


def _refuse(bad: BoolArray, x: Array, what: str, remedy: str) -> None:
    if bad.any():
        at = in_words(x[np.argmax(bad)].mean(axis=0))
        raise InputError(f"{what} in {int(bad.sum())} cells, one at {at}: {remedy}.")


def shown_direction(direction: Direction) -> str:
    """A vector in a message; nothing for a function."""
    return "" if callable(direction) else f" ({', '.join(f'{c:g}' for c in direction)})"


def _check_neighbours(
    mesh: Mesh,
    x: Array,
    side: Array,
    has_sides: BoolArray,
    stated: BoolArray,
) -> None:
    """InputError where two cells on an edge have their normals on different sides of the sheet.

    Only if both stacks are unsymmetric and at least one uses the normals of the mesh. Edges of
    three or more cells are not checked.
    """
    owned = compat.cell_map(mesh.dolfinx).size_local
    around = CORNERS_IN_TURN[mesh.cell]
    number = np.asarray(mesh.dolfinx.geometry.input_global_indices)
    corners = number[compat.geometry_nodes(mesh.dolfinx)[:owned][:, around]]
    ends = np.stack([corners, np.roll(corners, -1, axis=1)], axis=2)
    middles = (x[:owned, around] + np.roll(x[:owned, around], -1, axis=1)) / 2
    # cells that agree go along their edge in opposite directions
    way = np.where(ends[..., 0] < ends[..., 1], 1.0, -1.0) * side[:owned, None]
    each = [np.repeat(flag[:owned, None], len(around), axis=1) for flag in (has_sides, stated)]
    table = (np.sort(ends.reshape(-1, 2), axis=1), way, *each, middles)
    found = mesh.comm.gather(table, root=0) or []

    def work() -> None:
        edges = np.vstack([part[0] for part in found])
        way, has_sides, stated = (np.concatenate([p[k].ravel() for p in found]) for k in (1, 2, 3))
        _compare(edges, way, has_sides, stated, np.vstack([p[4].reshape(-1, 3) for p in found]))

    on_root(mesh.comm, work)


def _compare(
    edges: IntArray, way: Array, has_sides: BoolArray, stated: BoolArray, points: Array
) -> None:
    order = np.lexsort((edges[:, 1], edges[:, 0]))
    edges = edges[order]
    first = np.flatnonzero(np.append(True, np.any(np.diff(edges, axis=0), axis=1)))
    count = np.diff(np.append(first, len(edges)))
    pairs = np.stack([order[first[count == 2]], order[first[count == 2] + 1]])
    concerned = has_sides[pairs].all(axis=0) & ~stated[pairs].all(axis=0)
    bad = concerned & (way[pairs].sum(axis=0) != 0)
    if bad.any():
        at = in_words(points[pairs[0, np.argmax(bad)]])
        raise InputError(
            f"neighbouring cells have opposite normals at {int(bad.sum())} edges, one at "
            f"{at}, so that the top of the sheet would change sides: reverse the node "
            "order of those cells, or give Laminate(..., top=…), or Shell(..., top=…), a direction "
            "on whose side the top lies."
        )
