"""Static equilibrium of a loaded structure by Newton's method, and its load factor to buckling."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Protocol

import numpy as np
from petsc4py import PETSc
from slepc4py import SLEPc

from antiosc.base._types import Array
from antiosc.base.errors import AccuracyError, InputError, NotConvergedError
from antiosc.base.process import one_thread
from antiosc.fem.linalg import solver_for
from antiosc.fem.linalg.algebra import diagonal, dot, free_when_dropped, multiply, sum_of
from antiosc.fem.linalg.solver import Solver

#: The iteration has converged if the energy of a step over that of the state is below this.
CONVERGED = 1e-14
#: Motions below this share of the size are rounding: a bar between walls does not move at all.
LEAST_MOTION = 1e-15
#: Most steps; a plate whose deflection under pressure is ten thicknesses needs some 15.
MOST_STEPS = 40
#: Most steps with K instead of the tangent.
MOST_SOFT = 3
#: Vectors of SLEPc's basis.
BASIS = 24
#: Largest load factor that is reported; larger ones are infinite.
FAR = 100.0
#: Tolerance of SLEPc for the residual of a buckling mode in the energy norm over 1/λ.
ASKED = 1e-7
#: Most restarts: relevant modes are well separated from the many near 0.
RESTARTS = 12


class Loaded(Protocol):
    """A structure under loads: energy qᵀKq/2 + Π(q) − fᵀq, forces and tangent stiffness."""

    K: PETSc.Mat
    solver: Solver  # of K
    dead: Array  # f (rows of this rank,)
    size: float  # of the part [m]

    def forces(self, q: Array) -> Array:
        """dΠ/dq (rows of this rank,)."""
        ...

    def stiffness(self, q: Array, *, geometric: bool = False) -> PETSc.Mat:
        """d²Π/dq²; `geometric`: only the part proportional to the loads."""
        ...


@dataclass(frozen=True, eq=False)
class Equilibrium:
    """A static state under load.

    q : (rows of this rank,) displacements. K : the tangent stiffness there, solver : its solver.
    reserve : load factor at which the tangent becomes singular, if stresses and loads grow in
        proportion, in the deformed shape; inf above `FAR`.
    """

    q: Array
    K: PETSc.Mat
    solver: Solver
    reserve: float


def static_equilibrium(loaded: Loaded) -> Equilibrium:
    """The static equilibrium; InputError beyond buckling, or if none is found.

    A tangent without a factor, as that of a spin before it has stretched the part, is replaced by
    K in `MOST_SOFT` steps at most.
    """
    comm = loaded.solver.comm
    q = np.zeros(len(loaded.dead))
    stiffest = max(comm.allgather(diagonal(loaded.K).max(initial=0.0)))
    rounding = stiffest * (LEAST_MOTION * loaded.size) ** 2
    no_motions = np.zeros((len(q), 0))
    soft = 0
    for _ in range(MOST_STEPS):
        K = sum_of(loaded.K, 1.0, loaded.stiffness(q))
        free_when_dropped(K)
        try:  # under loads there is no coarser space: iterations take some forty times as long
            solver = solver_for(K, "auto", lambda: no_motions, columns=math.inf)
        except (NotConvergedError, AccuracyError):
            solver = loaded.solver
            soft += 1

        step = solver.solve(loaded.dead - multiply(loaded.K, q) - loaded.forces(q))
        q = q + step
        change, energy = (float(dot(comm, u, multiply(loaded.K, u))) for u in (step, q))
        if change <= max(CONVERGED * energy, rounding) and solver is not loaded.solver:
            geometric = loaded.stiffness(q, geometric=True)
            free_when_dropped(geometric)
            return Equilibrium(q, K, solver, 1 + buckling(K, solver, geometric))
        if soft > MOST_SOFT:
            break

    linear = loaded.solver.solve(loaded.dead - loaded.forces(0 * q))
    reserve = buckling(loaded.K, loaded.solver, loaded.stiffness(linear, geometric=True))
    raise InputError(
        f"no stable equilibrium is found under the prestress: the part buckles at some "
        f"{reserve:.3g} times these loads (a spin at {math.sqrt(reserve):.3g} times its speed), or "
        "deflects too far; lower them, or support the part."
    )


def buckling(K: PETSc.Mat, solver: Solver, geometric: PETSc.Mat) -> float:
    """The smallest λ > 0 for which K + λ geometric is singular; inf above `FAR`.

    SLEPc solves −geometric x = (1/λ) K x.
    """
    if not geometric.norm():
        return math.inf

    A = geometric.copy()
    A.scale(-1.0)
    free_when_dropped(A)
    eps = SLEPc.EPS().create(K.getComm())
    eps.setOperators(A, K)
    eps.setProblemType(SLEPc.EPS.ProblemType.GHEP)
    eps.setType(SLEPc.EPS.Type.KRYLOVSCHUR)
    eps.setWhichEigenpairs(SLEPc.EPS.Which.LARGEST_REAL)
    eps.setDimensions(1, BASIS)
    eps.setTolerances(ASKED, RESTARTS)
    eps.setConvergenceTest(SLEPc.EPS.Conv.REL)

    ksp = eps.getST().getKSP()
    ksp.setType(PETSc.KSP.Type.PREONLY)
    pc = ksp.getPC()
    pc.setType(PETSc.PC.Type.PYTHON)
    pc.setPythonContext(_StiffnessInverse(solver))

    largest = [math.inf]
    error = [math.inf]

    def watch(
        _: object, its: int, converged: int, values: list[complex], errors: list[float]
    ) -> None:
        largest[0] = values[0].real
        error[0] = errors[0] * abs(values[0])  # SLEPc divides by the value

    def reason(_: object, its: int, most: int, converged: int, wanted: int) -> int:
        if converged >= wanted or (largest[0] + error[0]) * FAR < 1:
            return int(SLEPc.EPS.ConvergedReason.CONVERGED_USER)
        if its >= most:
            return int(SLEPc.EPS.ConvergedReason.DIVERGED_ITS)
        return int(SLEPc.EPS.ConvergedReason.CONVERGED_ITERATING)

    eps.setMonitor(watch)
    eps.setStoppingTest(reason)

    with one_thread():
        eps.solve()
    if not eps.getConverged() and largest[0] * FAR < 1:
        return math.inf
    if not eps.getConverged():
        raise NotConvergedError(
            f"SLEPc did not find the buckling load within {RESTARTS} restarts: refine the mesh, or "
            "leave prestress out."
        )
    value = eps.getEigenvalue(0).real
    eps.destroy()
    return math.inf if value * FAR <= 1 else float(1 / value)


class _StiffnessInverse:
    """PETSc's Python preconditioner: the inverse of K."""

    def __init__(self, solver: Solver) -> None:
        self._solver = solver

    def apply(self, pc: PETSc.PC, r: PETSc.Vec, x: PETSc.Vec) -> None:
        x.setArray(self._solver.solve(np.array(r.array_r)))
