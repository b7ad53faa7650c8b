"""A meshed structure with its prestress: K plus the stiffness that the loads add."""

from __future__ import annotations

import math
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
from antiosc.fem.prestress.equilibrium import Loaded, static_equilibrium
from antiosc.fem.prestress.loaded_part import LoadedPart, Tendon, dead_forces, freed, tendon
from antiosc.fem.structure import StructureMatrices
from antiosc.fem.structure.meshed import MeshedStructure
from antiosc.fem.structure.support import Support

#: Least stiffness of the rest of the part against a tension, as a share of EA.
YIELDS = 1e-6


def with_prestress(base: MeshedStructure, prestress: object) -> MeshedStructure:
    """The matrices `base` under loads; InputError for loads that do not fit, or beyond buckling."""
    loads = checked(base, prestress)
    with doing("static step of the prestress", base.comm.rank):
        solver, _ = base.factored(math.inf)
        tendons = {name: tendon(base, name) for name in loads.tension}
        initial = tightened(loads, tendons, solver)
        part = _LoadedMesh(base, loads, initial, solver)
        state = static_equilibrium(part)

    def added(motions: Array) -> Array:
        free = LoadedPart(base.unsupported(), loads, initial)
        return multiply(free.stiffness(state.q), motions)

    preload = Preload(loads, state.q, state.reserve, initial, added)

    def reassembled(copy: Mesh, supports: Sequence[Support] = base.supports) -> MeshedStructure:
        return with_prestress(base.again(copy, supports), loads)

    K = state.K
    solver_of_K = state.solver
    return replace(
        base, K=K, again=reassembled, preload=preload, unloaded=base, solver_of_K=solver_of_K
    )


def checked(base: StructureMatrices, prestress: object) -> Prestress:
    """`prestress` as a checked Prestress of a supported structure."""
    loads = instance("prestress", prestress, Prestress, "a Prestress(spin=…, tension=…, …)")
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
        self.K = base.K
        self.size = base.mesh.extent()
        self.solver = solver
        self._part = LoadedPart(base, loads, initial)
        self.dead = freed(base, dead_forces(base, loads) + weight(base, loads))

    def forces(self, q: Array) -> Array:
        """dΠ/dq of the part."""
        return self._part.forces(q)

    def stiffness(self, q: Array, *, geometric: bool = False) -> PETSc.Mat:
        """d²Π/dq² of the part."""
        return self._part.stiffness(q, geometric=geometric)


def weight(base: StructureMatrices, loads: Prestress) -> Array:
    """Gravity loads (rows of this rank,)."""
    g = np.array(loads.gravity)
    size = float(np.linalg.norm(g))
    if not size:
        return np.zeros(len(base.rigid_modes))
    inertia = base.uniform_inertia(g / size)
    assert inertia is not None  # of a mesh
    return size * inertia


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
