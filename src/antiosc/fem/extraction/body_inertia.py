"""Momentum of shapes: of the motions of a whole body, and of its uniform accelerations."""

from __future__ import annotations

import numpy as np

from antiosc.base._types import Array
from antiosc.fem.linalg.algebra import dot
from antiosc.fem.site.site import Functional
from antiosc.fem.structure.structure import Structure
from antiosc.models.motion import Inertia


def inertia_of(structure: Structure, *shapes: Array) -> Inertia | None:
    """The inertia of a body that can move as a whole, with the momentum of these shapes."""
    if structure.rigid_inertia is None:
        return None
    inertia, loads = structure.rigid_inertia
    return inertia.along(np.vstack([dot(structure.comm, block, loads) for block in shapes]))


def uniform_inertia(structure: Structure, target: Functional) -> Array | None:
    """Me on the rows of this rank; None for matrices, which have no coordinates."""
    return None if target.direction is None else structure.uniform_inertia(target.direction)


def weights_of(structure: Structure, shapes: Array) -> Array | None:
    """Generalised masses (k, 3) of unit uniform accelerations along x, y, z of shapes (rows, k).

    None for matrices. A plane structure does not move along z.
    """
    loads = [structure.uniform_inertia(axis) for axis in np.eye(3)]
    if any(load is None for load in loads):
        return None
    return np.asarray(dot(structure.comm, shapes, np.column_stack(loads)))  # type: ignore[arg-type]
