"""The structure of a mesh with its prestress: K with what the loads add to it."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np
from petsc4py import PETSc

from antiosc.base._types import Array
from antiosc.base.checks import instance
from antiosc.base.errors import InputError
from antiosc.base.progress import doing
from antiosc.fem.linalg.algebra import dot, multiply
from antiosc.fem.linalg.solver import Solver
from antiosc.fem.mesh import Mesh
from antiosc.fem.prestress import Preload, Prestress
from antiosc.fem.prestress.equilibrium import Loaded, found
from antiosc.fem.prestress.loaded_part import LoadedPart, Tendon, dead_forces, freed, tendon
from antiosc.fem.structure import StructureMatrices
from antiosc.fem.structure.meshed import MeshedStructure
from antiosc.fem.structure.support import Support

#: Share of EA that the rest of the part must hold against a tension.
YIELDS = 1e-6


def with_prestress(base: MeshedStructure, given: object) -> MeshedStructure:
    """The matrices `base` under loads; InputError for loads that do not fit, or beyond buckling."""
    loads = checked(base, given)
    with doing("static step of the prestress", base.comm.rank):
        solver, _ = base.factored()
        tendons = {name: tendon(base, name) for name in loads.tension}
        initial = tightened(loads, tendons, solver)
        of = _LoadedMesh(base, loads, initial, solver)
        state = found(of, base.solver)

    def added(motions: Array) -> Array:
        free = LoadedPart(base.unsupported(), loads, initial)
        return multiply(free.stiffness(state.q), motions)

    preload = Preload(loads, state.q, state.reserve, initial, added)

    def again(copy: Mesh, supports: Sequence[Support] = base.supports) -> MeshedStructure:
        return with_prestress(base.again(copy, supports), loads)

    K, made = state.K, state.solver
    return replace(base, K=K, again=again, preload=preload, unloaded=base, solver_of_K=made)


def checked(base: StructureMatrices, given: object) -> Prestress:
    """`given` as a checked Prestress of a supported structure."""
    loads = instance("prestress", given, Prestress, "a Prestress(spin=…, tension=…, …)")
    if base.rigid_modes.shape[1]:
        raise InputError(
            f"a prestress needs supports that hold the part: {base.rigid_modes.shape[1]} rigid-body"
            " modes are left."
        )
    return loads


class _LoadedMesh(Loaded):
    """A meshed part under its loads."""

    def __init__(
        self,
        base: MeshedStructure,
        loads: Prestress,
        initial: Mapping[str, float],
        solver: Solver,
    ) -> None:
        self.K, self.solver = base.K, solver
        self._part = LoadedPart(base, loads, initial)
        self.dead = freed(base, dead_forces(base, loads) + weight(base, loads))

    def forces(self, q: Array) -> Array:
        return self._part.forces(q)

    def stiffness(self, q: Array, *, geometric: bool = False) -> PETSc.Mat:
        return self._part.stiffness(q, geometric=geometric)


def weight(base: StructureMatrices, loads: Prestress) -> Array:
    """Gravity loads (rows of this rank,)."""
    g = np.array(loads.gravity)
    size = float(np.linalg.norm(g))
    if not size:
        return np.zeros(len(base.rigid_modes))
    found = base.uniform_inertia(g / size)
    assert found is not None  # of a mesh
    return size * found


def tightened(loads: Prestress, tendons: Mapping[str, Tendon], solver: Solver) -> dict[str, float]:
    """Initial strains that produce the required tensions, all at once."""
    if not tendons:
        return {}
    own = list(tendons.values())
    pulls = np.column_stack([one.load for one in own])
    lengths = np.array([one.length for one in own])
    held = np.diag([one.stiffness for one in own])
    moved = solver.solve_block(pulls)
    forces = np.asarray(dot(solver.comm, pulls, moved)) / lengths[:, None] - held
    for name, one, force in zip(tendons, own, forces.diagonal(), strict=True):
        if -force <= YIELDS * one.stiffness:
            raise InputError(
                f"{name!r} cannot be tightened: nothing holds its ends against the tension."
            )
    strains = np.linalg.solve(forces, [loads.tension[name] for name in tendons])
    return dict(zip(tendons, strains.tolist(), strict=True))
