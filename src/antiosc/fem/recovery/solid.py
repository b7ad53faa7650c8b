"""Strain, stress and rotation in solids."""

from __future__ import annotations

import numpy as np

from antiosc.base._types import Array
from antiosc.base.errors import InputError
from antiosc.base.stresses import PAIRS, full
from antiosc.fem.elements.solid import Solid
from antiosc.fem.recovery.place import Place
from antiosc.fem.recovery.points import PointsInCells


def strain(at: PointsInCells, place: Place) -> Array:
    """Tensors (P, 3, 3, columns)."""
    gradient = _gradient(at)
    result = (gradient + np.swapaxes(gradient, 1, 2)) / 2
    number = at.part.part_of_cells()[at.cells]
    for k, (material, _) in enumerate(at.part.parts):
        if getattr(material, "plane", None) == "stress":  # it contracts freely across the plane
            own = result[number == k]
            across = -material.nu / (1 - material.nu) * (own[:, 0, 0] + own[:, 1, 1])
            result[number == k, 2, 2] = across
    return _turned(at, result, place)


def stress(at: PointsInCells, place: Place) -> Array:
    """Tensors (P, 3, 3, columns), Pa."""
    strains = strain(at, Place())
    engineering = np.stack([(1 if i == j else 2) * strains[:, i, j] for i, j in PAIRS], axis=1)
    number = at.part.part_of_cells()[at.cells]
    result = np.zeros_like(engineering)
    for k, (material, _) in enumerate(at.part.parts):
        own = number == k
        result[own] = np.einsum("ij,pjk->pik", material.voigt, engineering[own])
    return _turned(at, np.moveaxis(full(np.moveaxis(result, 1, -1)), 1, -1), place)


def rotation(at: PointsInCells, place: Place) -> Array:
    """Half the curl of the displacement (P, 3, columns), rad; (P, 1, columns) of plane parts."""
    g = _gradient(at)
    if at.part.mesh.gdim == 2:
        return np.asarray((g[:, 1, 0] - g[:, 0, 1])[:, None] / 2)
    pairs = ((2, 1), (0, 2), (1, 0))
    return np.stack([(g[:, i, j] - g[:, j, i]) / 2 for i, j in pairs], axis=1)


def section_forces(at: PointsInCells, place: Place) -> Array:
    """InputError: a solid has stresses."""
    raise InputError("a solid has no section forces: probe its 'stress'.")


def _gradient(at: PointsInCells) -> Array:
    """∂u_i/∂x_j (P, 3, 3, columns)."""
    gdim = at.part.mesh.gdim
    inverse = np.linalg.inv(at.J[:, :gdim, :])
    slopes = at.slopes(at.dofs("xyz"[:gdim]))
    result = np.zeros((len(at.cells), 3, 3, slopes.shape[-1]))
    result[:, :gdim, :gdim] = np.einsum("pcdk,pdj->pcjk", slopes, inverse, optimize=True)
    return result


def _turned(at: PointsInCells, tensors: Array, place: Place) -> Array:
    """The tensors in the axes of an anisotropic material, where the local ones are meant."""
    if not place.local:
        return tensors
    number = at.part.part_of_cells()[at.cells]
    result = tensors.copy()
    for k, (material, _) in enumerate(at.part.parts):
        if not isinstance(material, Solid):
            R = np.asarray(material.axes)
            own = number == k
            result[own] = np.einsum("ia,pabk,jb->pijk", R, tensors[own], R, optimize=True)
    return result
