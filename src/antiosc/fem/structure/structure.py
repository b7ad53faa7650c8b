"""`Structure`: K and M with supports, and the one factor of them that every site and mode uses.

A structure of a mesh is a `MeshedStructure`, which has a mesh and a weak form besides; matrices of
another code are a `Structure` and no more. Extraction reads what both have.
"""

from __future__ import annotations

import time
from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np
from mpi4py import MPI
from numpy.typing import ArrayLike
from petsc4py import PETSc

from antiosc._types import Array, IntArray
from antiosc.checks import array
from antiosc.errors import InputError
from antiosc.fem.elements.weak_form import Box, Family
from antiosc.fem.linalg.solver_choice import Choice, solver_for
from antiosc.fem.linalg.solvers import Solver, sum_of
from antiosc.fem.mesh.mesh import Mesh
from antiosc.fem.mpi import collective
from antiosc.fem.structure import rigid_body_modes
from antiosc.fem.structure.attachments import PointMass, Spring
from antiosc.fem.structure.given_matrices import as_petsc, supported
from antiosc.fem.structure.support import Support
from antiosc.models.motion import Inertia

if TYPE_CHECKING:
    from antiosc.fem.structure.meshed import MeshedStructure

#: Most times that the shift of a free body is brought closer to its first elastic ω².
CLOSER = 6


class Structure:
    """M and K of a part, with its supports applied.

    Parameters
    ----------
    mesh : Mesh
        From `read_mesh`.
    material : Solid, Shell, Laminate, Beam or dict
        One material, or {group name: material} that covers every cell once. On a shell's mesh
        groups of edges may carry a `Beam` besides: a stiffener that moves with the sheet.
    supports : sequence of Support
        None: a free body.
    order : 1 or 2
        Degree of the displacements.
    attached : sequence of PointMass and Spring
        Masses and grounded springs at points of the structure.
    solver : "auto", "direct" or "iterative"
        Solver for K: a Cholesky factor, or, if the memory is not sufficient, conjugate gradients
        with multigrid (`antiosc.fem.linalg.solver_choice`).

    Attributes
    ----------
    K, M : PETSc.Mat
        Stiffness (N/m) and mass (kg). Fixed dofs keep their rows: 1 on K's diagonal, 0 in M.
    dofs : int
        Dofs that are not fixed, on all ranks.
    fixed : ndarray of int
        Dofs of this rank that the supports hold; of a mesh, ghosts included.
    mass : float
        Total mass, kg.
    rigid_modes : ndarray (rows of this rank, r)
        M-orthonormal rigid-body modes that the supports leave.
    shift : float
        s of K + sM, the matrix that `factorize` factors, rad²/s²; 0 without rigid-body modes.
    seconds : dict
        What assembly and factorization (its forecast of memory included) took.

    Raises
    ------
    InputError
        Unknown group, support that selects nothing, cells without a material, family and mesh
        that do not fit.
    """

    K: PETSc.Mat
    M: PETSc.Mat
    dofs: int
    fixed: IntArray
    rigid_modes: Array
    seconds: dict[str, float]
    #: the first estimate of the shift, which `factorize` brings closer
    _first_shift: float
    _solver: Choice = "auto"
    #: (the solver of K + shift·M, shift) once it is made
    _factored: tuple[Solver, float] | None = None

    @collective()
    def __new__(
        cls,
        mesh: Mesh,
        material: Family | Mapping[str, Family],
        supports: Sequence[Support] = (),
        *,
        order: int = 2,
        attached: Sequence[PointMass | Spring] = (),
        solver: Choice = "auto",
    ) -> MeshedStructure:
        """Assemble the structure of a mesh."""
        from antiosc.fem.structure.meshed import assembled  # which builds on this class

        return assembled(mesh, material, supports, order=order, attached=attached, solver=solver)

    @classmethod
    @collective(MPI.COMM_SELF, rigid_modes=lambda _: "rows of one rank")
    def from_matrices(cls, K: Any, M: Any, *, rigid_modes: ArrayLike | None = None) -> Structure:
        """A structure from the matrices of any finite-element code, supports already applied.

        Parameters
        ----------
        K, M : SciPy sparse, dense or PETSc matrix (n, n)
            Symmetric; K positive semidefinite, M too. SI units. Penalties on K's diagonal, 1e14
            times the rest of their rows or more, become supports.
        rigid_modes : array_like (n, r), optional
            A basis of K's null space; found by itself where K is singular.
        """
        started = time.perf_counter()
        self = object.__new__(Structure)
        self.K, self.M = as_petsc("K", K), as_petsc("M", M)
        self.fixed = supported(self.K, self.M)
        self.dofs = self.K.getSize()[0] - self.comm.allreduce(len(self.fixed))
        given = None
        if rigid_modes is not None:
            given = array("rigid_modes", rigid_modes, (self.K.getLocalSize()[0], None))
        self.rigid_modes, self._first_shift = rigid_body_modes.of_matrices(self.K, self.M, given)
        self.seconds = {"assembly": time.perf_counter() - started}
        return self

    @property
    def comm(self) -> MPI.Comm:
        """The MPI communicator that shares the matrices."""
        return self.K.getComm().tompi4py()

    def factorize(self) -> Solver:
        """The one solver of K + shift·M that every site and every mode of this structure uses.

        The first call makes it and spends the time; later calls return the same.
        """
        if self._factored is None:
            started = time.perf_counter()
            shift = self._first_shift
            factor = self._solver_of(shift)
            for _ in range(CLOSER if self.rigid_modes.shape[1] else 0):
                better = rigid_body_modes.closer_shift(factor, self.K, self.M, self.rigid_modes)
                if better >= rigid_body_modes.FAR * shift:
                    break
                shift = better
                factor = self._solver_of(shift)
            self.seconds["factorization"] = time.perf_counter() - started
            self._factored = factor, shift
        return self._factored[0]

    @property
    def shift(self) -> float:
        """s of the factor of K + sM, rad²/s²: factorizes first where rigid-body modes are left."""
        if not self.rigid_modes.shape[1]:
            return 0.0
        self.factorize()
        assert self._factored is not None
        return self._factored[1]

    def _solver_of(self, shift: float) -> Solver:
        return solver_for(sum_of(self.K, shift, self.M), self._solver, self._rigid_motions)

    def _rigid_motions(self) -> Array:
        """Rigid-body motions of the unsupported body (rows of this rank, r), where they are known.

        The multigrid starts from them.
        """
        return np.zeros((self.K.getLocalSize()[0], 0))

    # -- what matrices alone do not tell

    @property
    def mass(self) -> float:
        """Total mass in kg."""
        raise InputError(
            "the total mass is not known from matrices alone; build the Structure from a mesh."
        )

    @property
    def dimensions(self) -> Box:
        """Length, width and thickness of the part, m, as `antiosc.advice` wants them.

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

    def describe(self) -> str:
        """One line: what was modelled and with how many dofs."""
        return f"given matrices, {self.dofs} dofs"
