"""Strain, stress and axial force of the bars of a truss."""

from __future__ import annotations

import numpy as np

from antiosc.base._types import Array
from antiosc.base.errors import InputError
from antiosc.fem.recovery.place import Place
from antiosc.fem.recovery.points import PointsInCells


def strain(at: PointsInCells, place: Place) -> Array:
    """Tensors (P, 3, 3, columns): along the bar, and its contraction across."""
    return _tensors(at, place, at.each(lambda bar: [1.0, -bar.nu]))


def stress(at: PointsInCells, place: Place) -> Array:
    """Tensors (P, 3, 3, columns), Pa."""
    return _tensors(at, place, at.each(lambda bar: [bar.E, 0.0]))


def section_forces(at: PointsInCells, place: Place) -> Array:
    """The axial force N (P, 1, columns), N."""
    return np.asarray((at.each(lambda bar: [bar.E * bar.area]) * _axial(at))[:, None])


def rotation(at: PointsInCells, place: Place) -> Array:
    """InputError: the ends of the bars are hinges."""
    raise InputError("the bars of a truss end in hinges, which have no rotation to probe.")


def _axial(at: PointsInCells) -> Array:
    """Axial strain (P, columns)."""
    length = np.linalg.norm(at.J[:, :, 0], axis=1)[:, None]
    slope = at.slopes(at.dofs("xyz"))[:, :, 0] / length[:, :, None]
    return np.einsum("pck,pc->pk", slope, at.J[:, :, 0] / length)


def _tensors(at: PointsInCells, place: Place, sizes: Array) -> Array:
    """Tensors with these sizes (P, 2) along and across the bar, times the axial strain."""
    if place.local:
        along = np.broadcast_to(np.diag([1.0, 0, 0]), (len(at.cells), 3, 3))
    else:
        t = at.J[:, :, 0] / np.linalg.norm(at.J[:, :, 0], axis=1)[:, None]
        along = np.einsum("pi,pj->pij", t, t)
    shape = sizes[:, :1, None] * along + sizes[:, 1:, None] * (np.eye(3) - along)
    return np.asarray(shape[..., None] * _axial(at)[:, None, None])
