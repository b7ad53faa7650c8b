"""A meshed structure under its prestress: its static equilibrium by Newton's method, and the load
factor to buckling.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np
from petsc4py import PETSc
from slepc4py import SLEPc

from antiosc.base._types import Array
from antiosc.base.checks import instance
from antiosc.base.errors import AccuracyError, InputError, NotConvergedError
from antiosc.base.process import one_thread
from antiosc.base.progress import doing
from antiosc.fem.linalg import solver_for
from antiosc.fem.linalg.algebra import diagonal, dot, free_when_dropped, multiply, sum_of
from antiosc.fem.linalg.solver import Solver
from antiosc.fem.mesh import Mesh
from antiosc.fem.prestress import Preload, Prestress
from antiosc.fem.prestress.loaded_part import LoadedPart, Tendon, dead_forces, freed, tendon
from antiosc.fem.structure.meshed import MeshedStructure
from antiosc.fem.structure.support import Support

#: Least stiffness of the rest of the part against a tension, as a share of EA.
YIELDS = 1e-6
#: The iteration has converged if the energy of a step over that of the state is below this.
CONVERGED = 1e-14
#: Motions below this share of the size are rounding: a bar between walls does not move at all.
LEAST_MOTION = 1e-15
#: Most steps; a plate whose deflection under pressure is ten thicknesses needs some 15.
MOST_STEPS = 40
#: Vectors of SLEPc's basis.
BASIS = 24
#: Largest load factor that is reported; larger ones are infinite.
FAR = 100.0
#: Tolerance of SLEPc for the residual of a buckling mode in the energy norm over 1/λ.
ASKED = 1e-7
#: Most restarts: relevant modes are well separated from the many near 0.
RESTARTS = 12


def with_prestress(base: MeshedStructure, prestress: object) -> MeshedStructure:
    """The matrices `base` under loads; InputError for loads that do not fit, or beyond buckling."""
    loads = instance("prestress", prestress, Prestress, "a Prestress(spin=…, tension=…, …)")
    if base.rigid_modes.shape[1]:
        raise InputError(
            f"a prestress needs supports that hold the part: {base.rigid_modes.shape[1]} rigid-body"
            " modes are left."
        )

    with doing("static step of the prestress", base.comm.rank):
        solver, _ = base.factored(math.inf)
        tendons = {name: tendon(base, name) for name in loads.tension}
        initial = tightened(loads, tendons, solver)
        dead = freed(base, dead_forces(base, loads) + weight(base, loads))
        loaded = LoadedPart(base, loads, initial)
        q, K, tangent = equilibrium(base, loaded, dead, solver)
        geometric = loaded.stiffness(q, geometric=True)
        free_when_dropped(geometric)
        reserve = 1 + buckling(K, tangent, geometric)

    def added(motions: Array) -> Array:
        free = LoadedPart(base.unsupported(), loads, initial)
        return multiply(free.stiffness(q), motions)

    def reassembled(copy: Mesh, supports: Sequence[Support] = base.supports) -> MeshedStructure:
        return with_prestress(base.again(copy, supports), loads)

    preload = Preload(loads, q, reserve, initial, added)
    return replace(
        base, K=K, again=reassembled, preload=preload, unloaded=base, solver_of_K=tangent
    )


def weight(base: MeshedStructure, loads: Prestress) -> Array:
    """Gravity loads (rows of this rank,)."""
    g = np.array(loads.gravity)
    size = float(np.linalg.norm(g))
    return size * base.uniform_inertia(g / size) if size else np.zeros(base.rows)


def tightened(loads: Prestress, tendons: Mapping[str, Tendon], solver: Solver) -> dict[str, float]:
    """Initial strains by tendon that produce the required tensions of all tendons together."""
    if not tendons:
        return {}
    tendons_listed = list(tendons.values())
    pulls = np.column_stack([group.load for group in tendons_listed])
    lengths = np.array([group.length for group in tendons_listed])
    stiffnesses = np.diag([group.stiffness for group in tendons_listed])
    displacements = solver.solve_block(pulls)
    forces = np.asarray(dot(solver.comm, pulls, displacements)) / lengths[:, None] - stiffnesses
    for name, group, force in zip(tendons, tendons_listed, forces.diagonal(), strict=True):
        if -force <= YIELDS * group.stiffness:
            raise InputError(
                f"{name!r} cannot be tightened: nothing holds its ends against the tension."
            )
    strains = np.linalg.solve(forces, [loads.tension[name] for name in tendons])
    return dict(zip(tendons, strains.tolist(), strict=True))


def equilibrium(
    part: MeshedStructure, loaded: LoadedPart, dead: Array, elastic: Solver
) -> tuple[Array, PETSc.Mat, Solver]:
    """(displacements q, tangent stiffness K, its solver) under constant forces `dead` and loads.

    The first step is that of linear theory. InputError beyond buckling, or if none is found.
    """
    comm = part.comm
    stiffest = max(comm.allgather(diagonal(part.K).max(initial=0.0)))
    rounding = stiffest * (LEAST_MOTION * part.mesh.extent()) ** 2
    q = elastic.solve(dead - loaded.forces(np.zeros(len(dead))))
    no_motions = np.zeros((len(q), 0))
    for _ in range(MOST_STEPS):
        K = sum_of(part.K, 1.0, loaded.stiffness(q))
        free_when_dropped(K)
        try:  # under loads there is no coarser space: iterations take some forty times as long
            solver = solver_for(K, "auto", lambda: no_motions, columns=math.inf)
        except (NotConvergedError, AccuracyError):
            break

        step = solver.solve(dead - multiply(part.K, q) - loaded.forces(q))
        q = q + step
        change, energy = (float(dot(comm, u, multiply(part.K, u))) for u in (step, q))
        if change <= max(CONVERGED * energy, rounding):
            return q, K, solver

    linear = elastic.solve(dead - loaded.forces(0 * q))
    reserve = buckling(part.K, elastic, loaded.stiffness(linear, geometric=True))
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
