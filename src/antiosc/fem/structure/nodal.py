"""`NodalMatrices`: given matrices whose rows are known by node and direction."""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import cached_property
from typing import ClassVar

import numpy as np

from antiosc._types import Array, IntArray
from antiosc.checks import array
from antiosc.errors import InputError
from antiosc.fem.linalg.algebra import multiply
from antiosc.fem.linalg.scaling import force_ratios
from antiosc.fem.structure.matrices import StructureMatrices
from antiosc.fem.structure.null_space import RIGID_FORCE
from antiosc.matrix_files.dof_map import DofMap
from antiosc.models.motion import Inertia

#: Digits of coordinates in a file, as a share of the part's size: motions are rigid up to them.
FILE_DIGITS = 1e-4


@dataclass(eq=False)
class NodalMatrices(StructureMatrices):
    """K and M of another program with the node and direction of each row.

    Attributes
    ----------
    map : DofMap
    """

    map: DofMap = field(kw_only=True)

    #: whether the node and direction of each row are known
    nodal: ClassVar[bool] = True

    @property
    def located(self) -> bool:
        """Whether coordinates of nodes are known."""
        return self.map.located

    def nodes(self) -> tuple[Array, IntArray]:
        """Points (P, 3) of the nodes with coordinates, and the rows (P, 3) of x, y, z there.

        A row is -1 where the displacement is not among the dofs.
        """
        known = np.isfinite(self.map.points).all(axis=1)
        _, first, index = np.unique(self.map.node[known], return_index=True, return_inverse=True)
        own = np.flatnonzero(known)
        rows = np.full((len(first), 3), -1)
        for axis in range(3):
            along = self.map.component[own] == axis + 1
            rows[index.ravel()[along], axis] = own[along]
        return self.map.points[own[first]], rows

    @cached_property
    def _motions(self) -> tuple[Array, Array] | None:
        """(point, motions): reference point (3,) and six rigid motions (rows, 6).

        None if a row is not placed or no translation is a null vector of K: then supports have
        taken rows away, or coordinates do not fit.
        """
        component, points = self.map.component, self.map.points
        moving = (component >= 1) & (component <= 6)
        if not self.rigid_modes.shape[1] or not moving.all() or not np.isfinite(points).all():
            return None
        point = (points.min(axis=0) + points.max(axis=0)) / 2
        motions = np.zeros((len(component), 6))
        for axis in range(3):
            along, turning = component == axis + 1, component == axis + 4
            motions[along, axis] = 1.0
            motions[turning, 3 + axis] = 1.0
            for spin in range(3):
                turn = np.cross(np.eye(3)[spin], points - point)
                motions[along, 3 + spin] = turn[along, axis]
        there = motions.any(axis=0)
        forces = force_ratios(self.K, motions[:, there], multiply(self.K, motions[:, there]))
        limits = np.where(np.flatnonzero(there) < 3, RIGID_FORCE**0.5, FILE_DIGITS)
        return (point, motions) if (forces < limits).all() else None

    @property
    def mass(self) -> float:
        """Total mass in kg; InputError where supports have left rows out."""
        known = self.rigid_inertia
        if known is None:
            raise InputError(
                "the total mass is known only of free bodies with coordinates: matrices lack "
                "the mass of fixed dofs."
            )
        return known[0].mass

    def uniform_inertia(self, direction: Array) -> Array | None:
        """Me for e, a unit uniform motion along `direction` (3,); None where rows are left out."""
        direction = array("direction", direction, (3,))
        known = self.rigid_inertia
        return None if known is None else np.asarray(known[1][:, :3] @ direction)

    @cached_property
    def rigid_inertia(self) -> tuple[Inertia, Array] | None:  # type: ignore[override]
        """The whole body's inertia and M r of its rigid motions r; see `Structure`."""
        if self._motions is None:
            return None
        point, motions = self._motions
        loads = multiply(self.M, motions)
        S = motions.T @ loads
        return Inertia(point, (S + S.T) / 2, np.zeros((0, 6))), loads

    def describe(self, dofs: int) -> str:
        """One line: what was given and with how many dofs."""
        return f"given matrices, {len(np.unique(self.map.node))} nodes, {dofs} dofs"
