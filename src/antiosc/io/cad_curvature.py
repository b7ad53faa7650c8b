"""Curvature of the surfaces of CAD, which gmsh knows, at the nodes of their mesh."""

from __future__ import annotations

from collections.abc import Sequence
from types import ModuleType

import numpy as np

from antiosc.base._types import Array, BoolArray
from antiosc.io.neutral import CadSurface

#: At a pole of the parameters, the curvature is taken at a point shifted by this share of their
#: range.
BESIDE = 1e-4


def at_nodes(gmsh: ModuleType, surfaces: Sequence[int]) -> CadSurface | None:
    """Curvatures of OpenCASCADE surfaces at the nodes of their mesh; None if there are none."""
    curvatures = []
    for tag in surfaces:
        tags, x, parameters = gmsh.model.mesh.getNodes(2, tag, True, True)
        if not len(tags) or len(parameters) != 2 * len(tags):
            continue
        low, high = np.array(gmsh.model.getParametrizationBounds(2, tag))
        inner = parameters + BESIDE * (np.tile((low + high) / 2, len(tags)) - parameters)
        normals, tensors, is_known = _bent(gmsh, tag, parameters)
        inner_values = _bent(gmsh, tag, inner)
        positions = [
            np.reshape(gmsh.model.getValue(2, tag, p), (-1, 3)) for p in (parameters, inner)
        ]
        # a reversed surface has the curvature of the other normal
        bend_vectors = np.einsum("nij,nj->ni", tensors, positions[1] - positions[0])[is_known]
        if np.sum((inner_values[0] - normals)[is_known] * bend_vectors) < 0:
            tensors = -tensors
            inner_values = (inner_values[0], -inner_values[1], inner_values[2])
        poles = ~is_known & inner_values[2]
        normals[poles] = inner_values[0][poles]
        tensors[poles] = inner_values[1][poles]
        is_known[poles] = True
        # seams have their nodes twice
        first = np.flatnonzero(is_known)[np.unique(tags[is_known], return_index=True)[1]]
        number = np.full(len(first), tag, dtype=np.int64)
        curvatures.append([np.reshape(x, (-1, 3))[first], number, normals[first], tensors[first]])
    if not curvatures:
        return None
    return CadSurface(*(np.concatenate(columns) for columns in zip(*curvatures, strict=True)))


def _bent(gmsh: ModuleType, tag: int, at: Array) -> tuple[Array, Array, BoolArray]:
    """(normals (n, 3), curvature tensors (n, 3, 3), known (n,)) at parameters (2 n,)."""
    normals = np.reshape(gmsh.model.getNormal(tag, at), (-1, 3))
    high, low, *axes = gmsh.model.getPrincipalCurvatures(tag, at)
    first, second = (np.reshape(axis, (-1, 3)) for axis in axes)
    tensors = -np.einsum("n,ni,nj->nij", high, first, first)
    tensors -= np.einsum("n,ni,nj->nij", low, second, second)
    is_known = np.isfinite(tensors).all(axis=(1, 2))
    for unit in (normals, first, second):
        is_known &= np.abs(np.linalg.norm(unit, axis=1) - 1) < 1e-6
    return normals, tensors, is_known
