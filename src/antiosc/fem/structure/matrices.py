"""K and M with their supports applied, and what is known of their dofs."""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import cached_property
from typing import ClassVar, TypedDict

import numpy as np

from antiosc.base._types import Array, Box, IntArray, Matrix
from antiosc.base.checks import array
from antiosc.base.errors import InputError
from antiosc.fem.linalg import algebra
from antiosc.fem.linalg.algebra import force_ratios, multiply
from antiosc.fem.linalg.solver import Choice, Solver, solver_for
from antiosc.fem.structure import null_space
from antiosc.fem.structure.dissipation import Dissipation
from antiosc.fem.structure.null_space import RIGID_FORCE
from antiosc.fem.structure.placement import rigid_motions
from antiosc.io.dof_map import DofMap
from antiosc.models.motion import Inertia

#: Most times that the shift of a free body is brought closer to its first elastic ω².
CLOSER = 6


class Plausibility(TypedDict, total=False):
    """What the extent of linear theory follows from.

    doubts : sentences on what is implausible of a part; wave_speed : the fastest along bars [m/s];
    thickness : the least of sheets [m], unless they are held along one line alone.
    """

    doubts: list[str]
    wave_speed: float
    thickness: float


@dataclass(eq=False)
class StructureMatrices:
    """K and M of a structure. Of matrices alone no more is known; a mesh adds the rest."""

    #: fixed dofs keep their rows: 1 on K's diagonal, 0 in M
    K: Matrix
    M: Matrix
    fixed: IntArray  # dofs of this rank that the supports hold; of a mesh, ghosts included
    #: M-orthonormal rigid-body modes that the supports leave (rows of this rank, r)
    rigid_modes: Array
    #: first estimate of the shift s of K + sM, rad²/s²; 0 without rigid-body modes
    first_shift: float
    solver: Choice = "auto"
    C: Matrix | None = field(default=None, kw_only=True)  # damping, of given matrices

    #: whether they are of a mesh, or of several that are joined
    meshed: ClassVar[bool] = False
    assembled: ClassVar[bool] = False
    #: whether the node and direction of each row are known
    nodal: ClassVar[bool] = False

    @property
    def lossy(self) -> bool:
        """Whether a material has a loss factor."""
        return False

    @property
    def plausibility(self) -> Plausibility:
        """What an extraction hands on for the plausibility of blows."""
        return {}

    @property
    def located(self) -> bool:
        """Whether they are given matrices with coordinates of their nodes."""
        return False

    @property
    def rigid_motions(self) -> Array:
        """Rigid-body motions of the unsupported body (rows of this rank, r), where they are known.

        The multigrid starts from them.
        """
        return np.zeros((algebra.rows(self.K), 0))

    def factored(self) -> tuple[Solver, float]:
        """(solver of K + sM, s): from the first shift on, until s fits the first elastic ω²."""
        shift = self.first_shift
        factor = self._solver_of(shift)
        for _ in range(CLOSER if self.rigid_modes.shape[1] else 0):
            better = null_space.closer_shift(factor, self.K, self.M, self.rigid_modes)
            if better >= null_space.FAR * shift:
                break
            shift = better
            del factor  # there may be no room for two
            factor = self._solver_of(shift)
        return factor, shift

    def _solver_of(self, shift: float) -> Solver:
        A = algebra.sum_of(self.K, shift, self.M)
        algebra.free_when_dropped(A)
        return solver_for(A, self.solver, lambda: self.rigid_motions)

    @property
    def mass(self) -> float:
        """Total mass in kg."""
        raise InputError(
            "the total mass is not known from matrices alone; build the Structure from a mesh."
        )

    @property
    def dimensions(self) -> Box:
        """Length, width and thickness of the part, m.

        Of the box along the axes around it; a shell's thickness is its least, a beam's width and
        thickness are those of the rectangle with its section's A and I.
        """
        raise InputError("matrices have no dimensions: give length, width and thickness.")

    def constants(self) -> tuple[float, float, float]:
        """(E [Pa], nu, rho [kg/m³]) of the first material; InputError for one with directions."""
        raise InputError("matrices have no material: give E, nu and rho.")

    def uniform_inertia(self, direction: Array) -> Array | None:
        """Me on the rows of this rank for e, a unit uniform motion along `direction` (3,).

        None for matrices, which do not tell where e points.
        """
        array("direction", direction, (3,))
        return None

    @property
    def rigid_inertia(self) -> tuple[Inertia, Array] | None:
        """The whole body's inertia (its momentum empty) and M r of its rigid motions r (rows, 6).

        With them any shape's momentum is its product with M r. None for matrices, which have no
        coordinates, and where no rigid-body mode is left.
        """
        return None

    def dissipation(self) -> list[Dissipation]:
        """Dashpots, Maxwell branches and layers that relax."""
        return [] if self.C is None else [Dissipation(matrix=self.C)]

    def loss_stiffness(self, V: Array) -> Array | None:
        """Σ η VᵀKV (k, k) of the materials, for V (rows of this rank, k); None without losses."""
        return None

    def describe(self, dofs: int) -> str:
        """One line: what was modelled and with how many dofs."""
        return f"given matrices, {dofs} dofs"


#: Digits of coordinates in a file, as a share of the part's size: motions are rigid up to them.
FILE_DIGITS = 1e-4


@dataclass(eq=False)
class NodalMatrices(StructureMatrices):
    """K and M of another program with the node and direction of each row."""

    map: DofMap = field(kw_only=True)

    nodal: ClassVar[bool] = True

    @property
    def located(self) -> bool:
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
        motions = rigid_motions(points, np.eye(3)[(component - 1) % 3], component <= 3, point)
        there = motions.any(axis=0)
        forces = force_ratios(self.K, motions[:, there], multiply(self.K, motions[:, there]))
        limits = np.where(np.flatnonzero(there) < 3, RIGID_FORCE**0.5, FILE_DIGITS)
        return (point, motions) if (forces < limits).all() else None

    @property
    def mass(self) -> float:
        known = self.rigid_inertia
        if known is None:
            raise InputError(
                "the total mass is known only of free bodies with coordinates: matrices lack "
                "the mass of fixed dofs."
            )
        return known[0].mass

    def uniform_inertia(self, direction: Array) -> Array | None:
        direction = array("direction", direction, (3,))
        known = self.rigid_inertia
        return None if known is None else np.asarray(known[1][:, :3] @ direction)

    @cached_property
    def rigid_inertia(self) -> tuple[Inertia, Array] | None:  # type: ignore[override]
        if self._motions is None:
            return None
        point, motions = self._motions
        loads = multiply(self.M, motions)
        S = motions.T @ loads
        return Inertia(point, (S + S.T) / 2, np.zeros((0, 6))), loads

    def describe(self, dofs: int) -> str:
        return f"given matrices, {len(np.unique(self.map.node))} nodes, {dofs} dofs"
