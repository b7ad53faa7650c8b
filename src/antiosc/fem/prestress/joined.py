"""An assembly with its prestress: energy of its parts and bolts under load, with u = T q."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial

import numpy as np
import scipy.sparse
from petsc4py import PETSc

from antiosc.base._types import Array
from antiosc.base.checks import shown
from antiosc.base.errors import InputError, name_list
from antiosc.base.progress import doing
from antiosc.fem.assembly.assembled import AssembledMatrices
from antiosc.fem.assembly.bolts import Bolt, lengthening
from antiosc.fem.assembly.joint import Joint
from antiosc.fem.assembly.layout import Layout, Sparse
from antiosc.fem.linalg.algebra import multiply
from antiosc.fem.linalg.petsc_algebra import csr
from antiosc.fem.linalg.solver import Solver
from antiosc.fem.platform import on_root
from antiosc.fem.prestress import Preload, Prestress, Spin, loads_on_part, named_from
from antiosc.fem.prestress.equilibrium import Loaded, static_equilibrium
from antiosc.fem.prestress.loaded_part import (
    LoadedPart,
    Tendon,
    accelerations,
    dead_forces,
    tendon,
)
from antiosc.fem.prestress.state import checked, tightened, weight
from antiosc.fem.structure.meshed import Member

#: Largest N L²/EI of a bolt; its cubic deflection between clamped ends is 3 % too stiff at 10, 4 %
#: at 12.
SLENDER = 12.0


@dataclass(frozen=True, eq=False)
class LoadedBolt:
    """A bolt under load: its energy EA L (s η/2 + η²/8 − e (s + η/2)) beyond the linear EA L s²/2.

    Here s = a·g/L, η = gᵀBg/L and g = G u.
    """

    G: Sparse  # (12, n)
    a: Array  # (12,)
    B: Array  # (12, 12)
    length: float  # m
    EA: float  # N
    initial: float  # e, the stress-free strain

    @classmethod
    def of(cls, joint: Bolt, layout: Layout, label: str, initial: float) -> LoadedBolt:
        """The loaded bolt of a joint of an assembly; `initial` is its stress-free strain."""
        (elastic,) = joint.elastic(layout, label)
        length = joint._reach(layout)
        a, B = lengthening(joint.beam, length)
        return cls(elastic.G, a, B, length, joint.beam.E * joint.beam.section.A, initial)

    def _strain(self, g: Array) -> float:
        """Elastic strain s + η/2 − e of the bolt with the dofs g."""
        return float(self.a @ g + g @ self.B @ g / 2) / self.length - self.initial

    def forces(self, u: Array) -> Array:
        """Gradient of the energy at u (n,)."""
        g = self.G @ u
        slope = self.B @ g
        eta = float(g @ slope) / self.length
        bolt_forces = (eta / 2 - self.initial) * self.a + self._strain(g) * slope
        return np.asarray(self.G.T @ (self.EA * bolt_forces))

    def stiffness(self, u: Array, *, geometric: bool = False) -> Sparse:
        """Second derivative (n, n) of the energy; `geometric`: only the part due to the bolt's
        force.
        """
        g = self.G @ u
        bolt_stiffness = self._strain(g) * self.B
        if not geometric:
            slope = self.B @ g
            coupling = np.outer(self.a, slope)
            bolt_stiffness += (coupling + coupling.T + np.outer(slope, slope)) / self.length
        return (self.G.T @ scipy.sparse.csr_matrix(self.EA * bolt_stiffness) @ self.G).tocsr()


def with_prestress(
    base: AssembledMatrices, prestress: object, joints: Sequence[Joint]
) -> AssembledMatrices:
    """The matrices `base` under loads; InputError for loads that do not fit, or beyond buckling."""
    loads = checked(base, prestress)
    layout = base.layout
    for name in layout.condensed:
        raise InputError(f"a prestress of an assembly needs meshes; {name!r} is a superelement.")
    bolts = {
        joint.name or joint.label(k + 1): joint
        for k, joint in enumerate(joints)
        if isinstance(joint, Bolt)
    }
    _check_names(layout, loads, bolts)
    with doing("static step of the prestress", base.comm.rank):
        solver, _ = base.factored(math.inf)
        tendons = {name: _tendon(base, bolts, name) for name in loads.tension}
        initial = tightened(loads, tendons, solver)
        assembly = _LoadedAssembly(base, loads, initial, bolts, solver)
        state = static_equilibrium(assembly, base.solver)
    load_forces = partial(assembly.added, base.expanded(state.q))
    preload = Preload(loads, state.q, state.reserve, initial, load_forces)
    return replace(base, K=state.K, preload=preload, solver_of_K=state.solver)


def _check_names(layout: Layout, loads: Prestress, bolts: Mapping[str, Bolt]) -> None:
    """InputError for loads on unknown parts or bolts, and for bolts that are too slender."""
    for kind, loads_by_group in (("pressure", loads.pressure), ("force", loads.force)):
        for name in loads_by_group:
            if kind == "force" and name in layout.points:
                continue
            if name.partition(":")[0] not in layout.members or ":" not in name:
                parts = name_list(name, layout.members, "the parts")
                raise InputError(f'{kind} acts on "part:group"; got {shown(name)}; {parts}.')
    for name in loads.tension:
        if name not in bolts and name.partition(":")[0] not in layout.members:
            raise InputError(
                f'tension acts on a Bolt by its name, or on "part:group"; got {shown(name)}; '
                f"{name_list(name, bolts, 'the bolts')}."
            )
        if name in bolts:
            _check_slender(layout, name, bolts[name], loads.tension[name])


def _check_slender(layout: Layout, name: str, bolt: Bolt, tension: float) -> None:
    """InputError for a bolt whose N L²/EI exceeds `SLENDER`."""
    section = bolt.beam.section
    bending = bolt.beam.E * min(section.I, section.side)
    ratio = abs(tension) * bolt._reach(layout) ** 2 / bending
    if ratio > SLENDER:
        raise InputError(
            f"the bolt {name!r} is too slender for one element: N L²/EI is {ratio:.3g}, at most "
            f"{SLENDER:g}; make it a part of Beam cells, welded at its ends."
        )


def _tendon(base: AssembledMatrices, bolts: Mapping[str, Bolt], name: str) -> Tendon:
    """The tendon `name`, a bolt or a group of a part: its forces on the dofs q of this rank."""

    def work() -> tuple[Array, float, float]:
        if name in bolts:
            bolt = LoadedBolt.of(bolts[name], base.layout, name, 1.0)
            load = -bolt.forces(np.zeros(base.layout.count))
            return base.joined(load), bolt.length, bolt.EA
        part, _, group = name.partition(":")
        member = base.layout.members[part]
        part_tendon = tendon(member.part, group)
        return base.joined(part_tendon.load, member.rows), part_tendon.length, part_tendon.stiffness

    load, length, stiffness = on_root(base.comm, work)
    return Tendon(base.own(load), length, stiffness)


class _LoadedAssembly(Loaded):
    """Forces and tangent stiffness of an assembly under loads; rank 0 holds its parts."""

    def __init__(
        self,
        base: AssembledMatrices,
        loads: Prestress,
        initial: Mapping[str, float],
        bolts: Mapping[str, Bolt],
        solver: Solver,
    ) -> None:
        self.K = base.K
        self.solver = solver
        self._base = base
        self._loads = loads
        self._initial = initial
        self._parts: list[tuple[Member, LoadedPart]] = []
        self._bolts: list[LoadedBolt] = []
        self._spun = Sparse((0, 0))
        self._start = np.zeros(base.layout.count)
        layout = base.layout

        def work() -> Array:
            dead_loads = np.zeros(layout.count)
            for member in layout.members.values():
                part_loads, strains = member_loads(loads, initial, member)
                self._parts.append((member, LoadedPart(member.part, part_loads, strains)))
                dead_loads[member.rows] = dead_forces(member.part, part_loads)
            for name, point in loads.force.items():
                if name in layout.points:
                    dead_loads[layout.of_point(name)[:3]] += point
            for name, bolt in bolts.items():
                strain = initial.get(name, 0.0)
                self._bolts.append(LoadedBolt.of(bolt, layout, name, strain))
            if loads.spin is not None:
                self._spin(loads.spin)
            return base.joined(dead_loads)

        self.dead = base.own(on_root(base.comm, work)) + weight(base, loads)

    def _spin(self, spin: Spin) -> None:
        """Spin loads of the masses of joints and attachments."""
        layout = self._base.layout
        M = self._base.added.mass_on_u(layout.count)
        start, centrifugal = accelerations(layout.places, spin)
        self._start = M @ start
        self._spun = ((M @ centrifugal + centrifugal @ M) / 2).tocsr()

    def forces(self, q: Array) -> Array:
        base = self._base
        u = base.expanded(q)

        def work() -> Array:
            forces = -self._start
            if self._spun.nnz:
                forces = forces - self._spun @ u
            for member, part in self._parts:
                forces[member.rows] += part.forces(u[member.rows])
            for bolt in self._bolts:
                forces += bolt.forces(u)
            return base.joined(forces)

        return base.own(on_root(base.comm, work))

    def stiffness(self, q: Array, *, geometric: bool = False) -> PETSc.Mat:
        base = self._base
        u = base.expanded(q)
        on_root_only = list[Sparse]()

        def work() -> None:
            total = Sparse((base.layout.count, base.layout.count))
            for member, part in self._parts:
                T = base.T[member.rows]
                total += T.T @ csr(part.stiffness(u[member.rows], geometric=geometric)) @ T
            other_terms = [bolt.stiffness(u, geometric=geometric) for bolt in self._bolts]
            other_terms += [-self._spun] if self._spun.nnz else []
            total += sum(base.T.T @ matrix @ base.T for matrix in other_terms)
            total = ((total + total.T) / 2).tocsr()
            total.sort_indices()
            on_root_only.append(total)

        on_root(base.comm, work)
        return base.local.spread("K", on_root_only[0] if on_root_only else None)

    def added(self, u: Array, motions: Array) -> Array:
        """Forces (n, k) that the loads add for motions (n, k) about displacements u (n,), on one
        rank.

        The parts are without their supports.
        """
        forces = -self._spun @ motions if self._spun.nnz else np.zeros(motions.shape)
        for member, _ in self._parts:
            part_loads = member_loads(self._loads, self._initial, member)
            free = LoadedPart(member.part.unsupported(), *part_loads)
            tangent = free.stiffness(u[member.rows])
            forces[member.rows] += multiply(tangent, motions[member.rows])
        for bolt in self._bolts:
            forces += bolt.stiffness(u) @ motions
        return forces


def member_loads(
    loads: Prestress, initial: Mapping[str, float], member: Member
) -> tuple[Prestress, dict[str, float]]:
    """(loads, initial strains by group) of one part of an assembly, in the axes of the part."""
    spin_origin = np.zeros(3) if loads.spin is None else np.array(loads.spin.about)
    point = member.at.own(spin_origin[None])[0]
    part_loads = loads_on_part(loads, member.name, member.at.rotation, point)
    return part_loads, named_from(f"{member.name}:", initial)
