"""`StructureMatrices`: K and M with their supports applied, and what is known of their dofs."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np

from antiosc._types import Array, Box, IntArray, Matrix
from antiosc.checks import array
from antiosc.errors import InputError
from antiosc.fem.linalg import algebra
from antiosc.fem.linalg.factor import solver_for
from antiosc.fem.linalg.solver import Choice, Solver
from antiosc.fem.structure import null_space
from antiosc.models.motion import Inertia

#: Most times that the shift of a free body is brought closer to its first elastic ω².
CLOSER = 6


@dataclass(eq=False)
class StructureMatrices:
    """K and M of a structure. Of matrices alone no more is known; a mesh adds the rest.

    Attributes
    ----------
    K, M : PETSc.Mat or scipy.sparse.csr_matrix
        Fixed dofs keep their rows: 1 on K's diagonal, 0 in M.
    fixed : dofs of this rank that the supports hold; of a mesh, ghosts included.
    rigid_modes : M-orthonormal rigid-body modes that the supports leave (rows of this rank, r).
    first_shift : first estimate of the shift s of K + sM, rad²/s²; 0 without rigid-body modes.
    solver : choice of the solver.
    """

    K: Matrix
    M: Matrix
    fixed: IntArray
    rigid_modes: Array
    first_shift: float
    solver: Choice = "auto"

    #: whether they are of a mesh, or of several that are joined
    meshed: ClassVar[bool] = False
    assembled: ClassVar[bool] = False
    #: whether the node and direction of each row are known
    nodal: ClassVar[bool] = False

    @property
    def plausibility(self) -> dict[str, Any]:
        """What an extraction hands on for the plausibility of blows: "doubts", "wave_speed"."""
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
        """Length, width and thickness of the part, m; see `Structure.dimensions`."""
        raise InputError("matrices have no dimensions: give length, width and thickness.")

    def constants(self) -> tuple[float, float, float]:
        """(E [Pa], nu, rho [kg/m³]) of the first material; InputError for one with directions."""
        raise InputError("matrices have no material: give E, nu and rho.")

    def uniform_inertia(self, direction: Array) -> Array | None:
        """Me on the rows of this rank for e, a unit uniform motion along `direction` (3,)."""
        array("direction", direction, (3,))
        return None

    @property
    def rigid_inertia(self) -> tuple[Inertia, Array] | None:
        """The whole body's inertia and M r of its rigid motions r; see `Structure`."""
        return None

    def dampers(self) -> list[tuple[Any, Array]]:
        """(functionals of the rows of this rank (j, rows), damping (j, j)) of all dampers."""
        return []

    def describe(self, dofs: int) -> str:
        """One line: what was modelled and with how many dofs."""
        return f"given matrices, {dofs} dofs"
