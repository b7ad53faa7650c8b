"""Loads at points: Σ w φ(X)·d over points X with weights w and directions d.

A load b is a column of forces on the dofs; bᵀu is the displacement at the point where it acts.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import TypeAlias

import numpy as np
import scipy.linalg
import scipy.sparse
from mpi4py import MPI

from antiosc.base._types import Array, IntArray
from antiosc.fem.elements.weak_form import WeakForm
from antiosc.fem.mesh.surface import ClosestPoint
from antiosc.fem.platform import compat
from antiosc.fem.structure import Placement, skew
from antiosc.io.matrices import COMPONENTS

Sparse: TypeAlias = scipy.sparse.csr_matrix

#: Unit motions (6,) by the names of the components.
UNIT_MOTIONS = dict(zip(COMPONENTS, np.eye(6), strict=True))
#: A point this share of the size off the structure, as by a curved mesh, is moved onto it.
SNAP_SHARE = 1e-3
#: Values of basis functions below this are rounding.
ROUNDED_VALUE = 1e-13
#: Fraction of a direction that may be missing in what a point has of it: rounding.
MISSING_SHARE = 1e-6


@dataclass(frozen=True, eq=False)
class Points:
    """n weighted points in cells of this rank."""

    site: IntArray  # (n,) number of the site of each point, 0 to P − 1
    #: cell, X: (n,) cell of this rank and (n, tdim) reference coordinates in it
    cell: IntArray
    X: Array
    weight: Array  # (n,) share of the site's unit force

    @classmethod
    def joined(cls, parts: Sequence[Points]) -> Points:
        """The points of several sets as one."""
        columns = [[p.site, p.cell, p.X, p.weight] for p in parts]
        return cls(*(np.concatenate(arrays) for arrays in zip(*columns, strict=True)))


def loads(comm: MPI.Comm, form: WeakForm, points: Points, directions: Array) -> Sparse:
    """Load vectors of P sites as columns (rows of this rank, P), fixed dofs included. `directions`:
    forces (P, 3), or forces and moments (P, 6); parts along components that nodes do not have are
    left out."""
    rows = [np.zeros(0, dtype=np.int32)]
    sites = [np.zeros(0, dtype=int)]
    values = [np.zeros(0)]

    # one entry for each site and cell: the moments of its points with each basis function
    cells = int(points.cell.max(initial=0)) + 1
    key, pair = np.unique(points.site * cells + points.cell, return_inverse=True)
    site, cell = np.divmod(key, cells)
    gather = scipy.sparse.csr_matrix(
        (points.weight, (pair.ravel(), np.arange(len(points.weight)))),
        shape=(len(key), len(points.weight)),
    )
    cells_used, index = np.unique(cell, return_inverse=True)

    for name, forces in zip(COMPONENTS, directions.T, strict=False):
        force = forces[site]
        if name not in form.components or not force.any():
            continue
        path = form.components[name]
        moments = gather @ compat.tabulate(form.space, path, points.X)
        rows.append(compat.cell_dofs(form.space, path, cells_used)[index.ravel()].ravel())
        sites.append(np.repeat(site, moments.shape[1]))
        values.append((moments * force[:, None]).ravel())

    # entries at ghosts go to their owners
    size = compat.local_size(form.space)
    row = np.concatenate(rows).astype(np.int64)
    column, value = np.concatenate(sites), np.concatenate(values)
    ghost = row >= size
    sent = (compat.global_dofs(form.space, row[ghost]), column[ghost], value[ghost])
    first = form.space.dofmap.index_map.local_range[0] * form.space.dofmap.index_map_bs
    entries = [(row[~ghost], column[~ghost], value[~ghost])]
    for number, columns_sent, values_sent in comm.allgather(sent):
        is_owned = (number >= first) & (number < first + size)
        entries.append((number[is_owned] - first, columns_sent[is_owned], values_sent[is_owned]))

    row, column, value = (np.concatenate(part) for part in zip(*entries, strict=True))
    return Sparse((value, (row, column)), shape=(size, len(directions)))


def stacked_rows(displacements: Sparse, rotations: Sparse) -> Sparse:
    """Rows of `displacements` above those of `rotations`."""
    return scipy.sparse.vstack([displacements, rotations]).tocsr()


@dataclass(frozen=True, eq=False)
class PointMotion:
    """Motion of a point as six linear functionals of dofs u: displacements x, y, z, rotations."""

    functionals: Sparse  # (6, n) functionals of the displacement, then of the rotation
    space: Array  # (6, 6) projection onto motions that the point has: on a solid no rotation
    point: Array  # (3,) coordinates, m

    @cached_property
    def displacements(self) -> Sparse:
        """(3, n) functionals of the displacement."""
        return self.functionals[:3]

    @cached_property
    def rotations(self) -> Sparse:
        """(3, n) functionals of the rotation."""
        return self.functionals[3:]

    def placed(self, at: Placement) -> PointMotion:
        """This motion in the axes of an assembly in which the part is placed by `at`."""
        R = scipy.linalg.block_diag(at.rotation, at.rotation)
        point = at.placed(self.point[None])[0]
        return PointMotion((Sparse(R) @ self.functionals).tocsr(), R @ self.space @ R.T, point)

    def has(self, direction: Array) -> bool:
        """Whether the point can move along a unit direction (6,) of displacements and rotations."""
        return bool(direction @ self.space @ direction > 1 - MISSING_SHARE)

    def components(self, names: Sequence[str]) -> Sparse:
        """Functionals (k, n) of the k named displacements and rotations."""
        return self.functionals[[COMPONENTS.index(name) for name in names]]

    def lacking(self, names: Sequence[str]) -> list[str]:
        """The components among `names` that the point does not have."""
        return [name for name in names if not self.has(UNIT_MOTIONS[name])]

    def has_rotations(self, all_of: Array) -> bool:
        """Whether the point has every rotation in the image of the projection `all_of` (3, 3)."""
        missing_rotations = all_of - all_of @ self.space[3:, 3:] @ all_of
        return bool(np.abs(missing_rotations).max() <= MISSING_SHARE)

    def at(self, point: Array) -> PointMotion:
        """The motion of a `point` (3,) that is rigidly connected to this one."""
        displacements = self.displacements_at(point[None])
        return replace(self, functionals=stacked_rows(displacements, self.rotations), point=point)

    def displacements_at(self, points: Array) -> Sparse:
        """Displacements (3P, n) of points (P, 3) that are rigidly connected to this one."""
        arms = Sparse(skew(points - self.point).reshape(-1, 3))
        repeated = scipy.sparse.vstack([self.displacements] * len(points))
        return (repeated - arms @ self.rotations).tocsr()


def component_projection(form: WeakForm) -> Array:
    """Projection (6, 6) onto the displacements and rotations that nodes of `form` have."""
    return np.diag([float(name in form.components) for name in COMPONENTS])


def motion_at(comm: MPI.Comm, form: WeakForm, at: ClosestPoint) -> PointMotion:
    """Motion functionals of the point `at` on the dofs of this rank, fixed dofs included."""
    count = 6 * int(comm.rank == at.rank)
    sites, weights = np.arange(count), np.ones(count)
    points = Points(sites, np.full(count, at.cell), np.tile(at.X, (count, 1)), weights)

    six = loads(comm, form, points, np.eye(6)).T.tocsr()
    six.data[np.abs(six.data) < ROUNDED_VALUE] = 0.0
    six.eliminate_zeros()
    return PointMotion(six, component_projection(form), at.x)
