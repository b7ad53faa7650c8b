"""Static equilibrium of a loaded structure by Newton's method, and its load factor to buckling.

Each Newton step is solved by conjugate gradients, preconditioned with the factor of K, the matrix
without load, so that no step needs a factorization. The energy along a step is a quartic polynomial
of the step length; four residuals give its slope exactly. A step ends at the first minimum.
"""

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
from antiosc.fem.linalg.algebra import (
    conjugate_gradients,
    dot,
    free_when_dropped,
    multiply,
    sum_of,
)
from antiosc.fem.linalg.solver import Solver

#: The iteration has converged if the energy of a Newton step over that of the state is below this.
CONVERGED = 1e-14
#: Most steps; a plate whose deflection under pressure is ten thicknesses needs 9.
MOST_STEPS = 40
#: Relative error in energy at which conjugate gradients end.
STEP_ERROR = 1e-12
#: Their most iterations, after which the tangent is factored.
MOST_CG_STEPS = 60
#: A step length is accepted if the slope of the energy there, over that at the start, is below
#: this.
FLAT_END = 0.1
#: Longest step, over that of Newton.
LONGEST = 4.0
#: Vectors of SLEPc's basis.
BASIS = 24
#: Largest load factor that is reported; larger ones are infinite.
FAR = 100.0
#: Tolerance of SLEPc for the residual of a buckling mode in the energy norm over 1/λ.
ASKED = 1e-7
#: Largest accepted residual; an exact 1/λ lies within it. Rounding errors of the solves grow with
#: 1/λ (1e-5 of it at 1/λ = 96, beams).
RESIDUAL = 1e-3
#: Most restarts: relevant modes are well separated from the many near 0.
RESTARTS = 12


class Loaded(Protocol):
    """A structure under loads: energy qᵀKq/2 + Π(q) − fᵀq, forces and tangent stiffness."""

    K: PETSc.Mat
    solver: Solver  # of K
    dead: Array  # f (rows of this rank,)

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

    Its solver is a factor where one fits, whatever the structure asks for: under loads there is no
    coarser space, so that iterations take some forty times as long.
    """
    q, tangent_change = _equilibrium(loaded)
    geometric = loaded.stiffness(q, geometric=True)
    K = sum_of(loaded.K, 1.0, tangent_change)
    free_when_dropped(K, geometric)
    try:
        solver = solver_for(K, "auto", lambda: np.zeros((len(q), 0)), columns=math.inf)
        load_factor = buckling(K, solver, geometric)
    except (NotConvergedError, AccuracyError):  # K has no factor
        reserve = buckling(loaded.K, loaded.solver, geometric)
        if reserve > 1:
            raise
        raise InputError(_beyond_buckling(reserve)) from None
    return Equilibrium(q, K, solver, 1 + load_factor)


def _beyond_buckling(reserve: float) -> str:
    """The message that the loads exceed the buckling load."""
    return (
        f"the part buckles under its prestress: at {reserve:.3g} times these loads (a spin at "
        f"{math.sqrt(reserve):.3g} times its speed) its tangent stiffness is singular; lower them, "
        "or support the part."
    )


def _equilibrium(loaded: Loaded) -> tuple[Array, PETSc.Mat]:
    """Newton's iteration: (q, d²Π/dq² at q)."""
    comm = loaded.solver.comm
    q = np.zeros(len(loaded.dead))
    residual = loaded.dead - loaded.forces(q)
    if not float(dot(comm, residual, residual)):
        return q, loaded.stiffness(q)
    for _ in range(MOST_STEPS):
        tangent_change = loaded.stiffness(q)
        step = _newton_step(loaded, tangent_change, residual)
        energy = float(dot(comm, step, multiply(loaded.K, step)))
        if energy <= CONVERGED * float(dot(comm, q, multiply(loaded.K, q))):
            return q + step, tangent_change
        length, residual = _line_search(loaded, q, step, residual)
        q = q + length * step
    raise InputError(
        f"no equilibrium under the prestress within {MOST_STEPS} steps: the part snaps through, or "
        "buckles, below these loads; lower them, or support the part."
    )


def _newton_step(loaded: Loaded, added: PETSc.Mat, residual: Array) -> Array:
    """Newton's step if the tangent is positive definite, otherwise a descent direction.

    Conjugate gradients stop at a direction of negative curvature.
    """
    comm = loaded.solver.comm

    def product(x: Array) -> Array:
        return multiply(loaded.K, x) + multiply(added, x)

    def inner(x: Array, y: Array) -> Array:
        return np.asarray(comm.allreduce(np.einsum("ij,ij->j", x, y)))

    steps = conjugate_gradients(
        residual[:, None], product, loaded.solver.solve_block, inner, MOST_CG_STEPS
    )
    best = np.zeros((len(residual), 1))
    gained = 0.0
    first = 0.0
    for X, residual_energy, energy in steps:
        if energy[0] < gained:  # negative curvature
            break
        best = X.copy()
        gained = float(energy[0])
        first = first or float(residual_energy[0])
        if float(residual_energy[0]) <= STEP_ERROR * first:
            return best[:, 0]
    else:
        return _by_factor(loaded, added, residual)
    if best.any():
        return best[:, 0]
    return loaded.solver.solve(residual)


def _by_factor(loaded: Loaded, added: PETSc.Mat, residual: Array) -> Array:
    """Newton's step by a factorization of the tangent: for loads that make it much stiffer
    than K.
    """
    A = sum_of(loaded.K, 1.0, added)
    free_when_dropped(A)
    try:
        solver = solver_for(A, "auto", lambda: np.zeros((len(residual), 0)), columns=math.inf)
        return solver.solve(residual)
    except NotConvergedError:
        return loaded.solver.solve(residual)


def _line_search(
    loaded: Loaded, q: Array, step: Array, start_residual: Array
) -> tuple[float, Array]:
    """(step length of least energy, residual (rows of this rank,) at its end)."""
    comm = loaded.solver.comm

    def residual(length: float) -> Array:
        state = q + length * step
        return loaded.dead - multiply(loaded.K, state) - loaded.forces(state)

    def slope(residual: Array) -> float:
        return -float(dot(comm, step, residual))

    full_step = residual(1.0)
    start = slope(start_residual)
    end = slope(full_step)
    if abs(end) <= FLAT_END * abs(start):
        return 1.0, full_step
    lengths = np.array([0.0, 1 / 3, 2 / 3, 1.0])
    slopes = [start, *(slope(residual(t)) for t in lengths[1:3]), end]
    roots = np.roots(np.polyfit(lengths, slopes, 3))
    real_roots = roots[np.abs(roots.imag) <= 1e-9 * np.abs(roots)].real
    positive = real_roots[real_roots > 0]
    length = float(min(positive.min(initial=LONGEST), LONGEST))
    return length, residual(length)


def buckling(K: PETSc.Mat, solver: Solver, geometric: PETSc.Mat) -> float:
    """The smallest λ > 0 for which K + λ geometric is singular; inf above `FAR`.

    SLEPc solves −geometric x = (1/λ) K x; the residual of its result is checked.
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
    x = K.createVecRight()
    value = eps.getEigenpair(0, x).real
    shape = np.array(x.array_r)
    eps.destroy()
    if value * FAR <= 1:
        return math.inf
    _check(K, solver, multiply(A, shape), value, shape)
    return float(1 / value)


def _check(K: PETSc.Mat, solver: Solver, forces: Array, value: float, shape: Array) -> None:
    """AccuracyError if the residual of a buckling mode over 1/λ, measured with K⁻¹, is large.

    `forces`: those of the loads on the mode shape, `value` θ = 1/λ. With K x = f/θ, an eigenvalue
    lies within ‖K⁻¹ f − θ x‖ (energy norm) of θ (Weinstein).
    """
    comm = solver.comm
    elastic = multiply(K, shape)
    residual = forces - value * elastic
    residual_energy = float(dot(comm, residual, solver.solve(residual)))
    size = value**2 * float(dot(comm, shape, elastic))
    if not residual_energy <= RESIDUAL**2 * size:
        raise AccuracyError(
            "SLEPc's buckling mode leaves a relative residual of "
            f"{math.sqrt(residual_energy / size):.1e} (limit {RESIDUAL:.0e}): the prestress is too "
            "large for double precision."
        )


class _StiffnessInverse:
    """PETSc's Python preconditioner: the inverse of K."""

    def __init__(self, solver: Solver) -> None:
        self._solver = solver

    def apply(self, pc: PETSc.PC, r: PETSc.Vec, x: PETSc.Vec) -> None:
        x.setArray(self._solver.solve(np.array(r.array_r)))
