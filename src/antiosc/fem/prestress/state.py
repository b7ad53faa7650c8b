"""A meshed structure under prestress: static equilibrium by Newton's method, and load factor to
buckling.

Loads add an energy Π to uᵀKu/2 of each meshed part. With the pressure p on surfaces
with normals n and the spin Ω about an axis,

    Π(u) = Π₂(u) − p ∫ (u·n + u·δn(u)/2) − Ω²/2 ∫ ρ |P (x + u)|²,

where Π₂ is the energy of the second-order strains (`antiosc.fem.elements.second_order`), P the
projection normal to the axis, and δn dA = ((div_s u) n − (∇_s u)ᵀ n) dA. In the sections of beams
and through the thickness of sheets, the displacement includes the rotations to second order,
u + θ×r + θ×(θ×r)/2. The stiffness of the pressure is symmetric, which is exact if the surface is
closed or its rim is fixed.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import TYPE_CHECKING

import dolfinx
import numpy as np
import ufl
from mpi4py import MPI
from petsc4py import PETSc
from slepc4py import SLEPc

from antiosc.base._types import Array, IntArray
from antiosc.base.checks import instance
from antiosc.base.errors import AccuracyError, InputError, NotConvergedError
from antiosc.base.process import one_thread
from antiosc.base.progress import doing
from antiosc.fem.elements.beam import Beam, Truss, axes_of_beams
from antiosc.fem.elements.second_order import second_order_strain
from antiosc.fem.elements.shell import frames, section_fields, tangential_slopes
from antiosc.fem.elements.solid import thickness_of
from antiosc.fem.elements.weak_form import (
    Parts,
    axes_and_sides,
    coefficient,
    in_space,
    jacobian_columns,
    measure,
    split_motion,
)
from antiosc.fem.linalg import solver_for
from antiosc.fem.linalg.algebra import diagonal, dot, free_when_dropped, multiply, sum_of
from antiosc.fem.linalg.petsc_algebra import use_inverse
from antiosc.fem.linalg.solver import Solver
from antiosc.fem.mesh import Mesh
from antiosc.fem.mesh.surface import largest_entities, owned_entities, quadrature
from antiosc.fem.platform import compat
from antiosc.fem.prestress import Preload, Prestress, Spin
from antiosc.fem.structure.loads import Points, loads as load_columns
from antiosc.fem.structure.meshed import MeshedStructure
from antiosc.fem.structure.support import Support

if TYPE_CHECKING:
    from ufl.core.expr import Expr

#: Least stiffness of the rest of the part against a tension, as a share of EA.
LEAST_RESTRAINT = 1e-6
#: The iteration has converged if the energy of a step over that of the state is below this.
ENERGY_TOLERANCE = 1e-14
#: Motions below this share of the size are rounding: a bar between walls does not move at all.
LEAST_MOTION = 1e-15
#: Most steps; a plate whose deflection under pressure is ten thicknesses needs some 15.
MOST_STEPS = 40
#: Vectors of SLEPc's basis.
BASIS_SIZE = 24
#: Largest load factor that is reported; larger ones are infinite.
LARGEST_LOAD_FACTOR = 100.0
#: Tolerance of SLEPc for the residual of a buckling mode in the energy norm over 1/λ.
BUCKLING_TOLERANCE = 1e-7
#: Most restarts: relevant modes are well separated from the many near 0.
MOST_RESTARTS = 12


class LoadedPart:
    """Forces and tangent stiffness by second-order and initial strains, pressure and spin.
    `initial`: group of beams or bars -> stress-free strain of its cells."""

    def __init__(
        self, part: MeshedStructure, loads: Prestress, initial: Mapping[str, float]
    ) -> None:
        self.part = part
        form = part.form
        mesh = part.mesh
        self._u = dolfinx.fem.Function(form.space)
        if part.stiffeners:
            raise InputError("a prestress takes no sheet with beams on edges: omit one of them.")
        self.initial = initial_strain(part, initial)
        stretch = second_order_strain(mesh, part.parts, form.degree)
        free = self.initial if initial else None
        v = ufl.TestFunction(form.space)
        w = ufl.TrialFunction(form.space)
        dx = measure(mesh, stretch.degree)
        second = stretch.energy(self._u, free) * dx
        of_loads = []
        for group, p in loads.pressure.items():
            region = (group, *largest_entities(mesh, group))
            work = pressure_energy(mesh, part.parts, self._u, region)
            of_loads += [-compat.constant(mesh.dolfinx, p) * work] if p else []

        if loads.spin is not None and loads.spin.omega:
            if part.comm.allreduce(bool(part.attached_inertia.any()), op=MPI.LOR):
                raise InputError(
                    "a spin acts on cells alone: mesh what a PointMass stands for, or omit spin."
                )
            spin = spin_energy(mesh, part.parts, self._u, loads.spin, form.density)
            of_loads.append(-spin)

        forces = [ufl.derivative(energy, self._u, v) for energy in (second, *of_loads)]
        slopes = [ufl.derivative(force, self._u, w) for force in forces]
        of_stress = stretch.geometric_stiffness(self._u, free, v, w) * dx

        # sums, as matrices of cells and of facets have entries at different places
        self._forces = sum(forces)
        self._tangent = sum(slopes)
        self._geometric = sum([of_stress, *slopes[1:]])

    def forces(self, u: Array) -> Array:
        """dΠ/du (rows of this rank,) [N, N m] at u (rows,), Π: energy added to uᵀKu/2, without dead
        forces; 0 on fixed dofs."""
        self._move(u)
        total = compat.assemble_functional(self._forces, self.part.form.space)[: len(u)]
        return zero_on_fixed(self.part, total)

    def stiffness(self, u: Array, *, geometric: bool = False) -> PETSc.Mat:
        """d²Π/du² (see `forces`), empty at fixed dofs; `geometric`: terms proportional to loads."""
        self._move(u)
        part = self.part
        form = self._geometric if geometric else self._tangent
        return compat.assemble([form], part.form.space, part.conditions, 0.0)

    def _move(self, u: Array) -> None:
        """Set the displacements u (rows of this rank,) at which forms are evaluated."""
        self._u.x.array[: len(u)] = u
        self._u.x.scatter_forward()


def zero_on_fixed(part: MeshedStructure, forces: Array) -> Array:
    """`forces` (rows of this rank,), set to zero on fixed dofs in place."""
    forces[part.fixed[part.fixed < len(forces)]] = 0.0
    return forces


def initial_strain(part: MeshedStructure, initial: Mapping[str, float]) -> Expr:
    """Stress-free strain of each cell, from that of groups, as a cell-wise constant function.
    InputError for a group without cells of beams or bars."""
    strain_of_cells = compat.cellwise_function(part.mesh.dolfinx)
    for group, strain in initial.items():
        dim, cells = largest_entities(part.mesh, group)
        if dim != part.mesh.tdim or not isinstance(part.parts[0][0], Beam | Truss):
            raise InputError(
                f"tension needs a group of cells of beams or bars, not {group!r}: take force={{…}}."
            )
        strain_of_cells.x.array[cells] += strain

    return strain_of_cells


def tendon(part: MeshedStructure, name: str) -> tuple[Array, float, float]:
    """(forces (rows of this rank,) that pull its ends, length [m], mean EA [N]) of a group of beams
    or bars with a unit stress-free strain."""
    unit_strain = initial_strain(part, {name: 1.0})
    stretch = second_order_strain(part.mesh, part.parts, part.form.degree)
    dx = measure(part.mesh, stretch.degree)
    v = ufl.TestFunction(part.form.space)
    work = ufl.inner(stretch.forces(unit_strain), stretch.strain(v)) * dx
    rows = part.rows
    load = compat.assemble_functional(work, part.form.space)[:rows]
    length = compat.integrate(unit_strain * dx, part.mesh.dolfinx)
    EA = compat.integrate(stretch.forces(unit_strain) * dx, part.mesh.dolfinx)
    return zero_on_fixed(part, load), length, EA / length


def dead_forces(part: MeshedStructure, loads: Prestress) -> Array:
    """The forces on groups of `loads.force` alone, (rows of this rank,), also on fixed dofs."""
    forces = np.zeros(part.rows)
    for group, resultant in loads.force.items():
        force = np.array(resultant)
        if np.abs(force[part.mesh.gdim :]).max(initial=0.0):
            raise InputError(f"the force on {group!r} points out of the plane of the part.")
        if not force.any():
            continue
        points = _loaded_points(part, group)
        column = load_columns(part.comm, part.form, points, force[None])
        forces += column.toarray()[:, 0]

    return forces


def _loaded_points(part: MeshedStructure, group: str) -> Points:
    """Points of a group over which a force is distributed evenly, of weights whose sum is 1.
    InputError for edges of volumes, and for faces inside the part."""
    mesh = part.mesh
    dim, entities = largest_entities(mesh, group)
    if dim not in (0, mesh.tdim - 1, mesh.tdim):
        raise InputError(f"a force acts on points, faces or cells; group {group!r} holds edges.")

    entities = owned_entities(mesh, dim, entities)
    if dim and dim < mesh.tdim:
        entities = np.intersect1d(entities, compat.exterior_facets(mesh.dolfinx)).astype(np.int32)
    points = quadrature(mesh, dim, entities, LOAD_DEGREE)
    total = part.comm.allreduce(points.weight.sum())
    if not total:
        raise InputError(f"the group {group!r} holds no outer faces, on which loads act.")
    return Points(np.zeros(len(points.cell), int), points.cell, points.X, points.weight / total)


# -- energies (UFL) of pressures and of spin on a mesh; measures of its groups


#: Degree of the quadrature of loads: products of P2 displacements, slopes and normals.
LOAD_DEGREE = 5


def measure_on(mesh: Mesh, dim: int, entities: IntArray) -> tuple[Expr, ufl.Measure]:
    """(factor, UFL measure) that together integrate over cells or outer facets of this rank."""
    if dim == mesh.tdim:
        indicator = compat.cellwise_function(mesh.dolfinx)
        indicator.x.array[entities] = 1.0
        return indicator, measure(mesh, LOAD_DEGREE)
    marks = np.ones(len(entities), dtype=np.int32)
    order = np.argsort(entities)
    tags = dolfinx.mesh.meshtags(mesh.dolfinx, dim, entities[order].astype(np.int32), marks)
    metadata = {"quadrature_degree": LOAD_DEGREE}
    ds = ufl.Measure("ds", domain=mesh.dolfinx, subdomain_data=tags, metadata=metadata)
    return compat.constant(mesh.dolfinx, 1.0), ds(1)


def pressure_energy(
    mesh: Mesh, parts: Parts, u: Expr, where: tuple[str, int, IntArray]
) -> ufl.Form:
    """Work of a unit pressure, inward on solids and toward the top of sheets, to second order in u;
    `where`: group, dimension, local entities. InputError for other entities."""
    group, dim, entities = where
    sheet = parts[0][0].kind.sheet
    if dim != (mesh.tdim if sheet else mesh.tdim - 1) or mesh.tdim == 1:
        raise InputError(
            f"pressure acts on faces of solids and on cells of sheets; group {group!r} holds "
            f"entities of dimension {dim}: give force={{{group!r}: (x, y, z)}} there."
        )
    factor, dx = measure_on(mesh, dim, entities)
    if not sheet:
        n = ufl.FacetNormal(mesh.dolfinx)
        slope = ufl.grad(u)
        normal_change = ufl.tr(slope) * n - ufl.dot(ufl.transpose(slope), n)
        against = -thickness_of(mesh, parts) * factor
        return against * (ufl.dot(u, n) + ufl.dot(u, normal_change) / 2) * dx

    frame = frames(mesh, parts)
    _, side = axes_and_sides(mesh, parts)
    normal = ufl.cross(*jacobian_columns(mesh))
    to_top = side * ufl.sign(ufl.dot(normal, frame.n))
    displacement, _ = split_motion(u)
    u1, u2 = tangential_slopes(frame, displacement)
    normal_change = ufl.cross(u1, frame.e2) + ufl.cross(frame.e1, u2)
    work = ufl.dot(displacement, frame.n) + ufl.dot(displacement, normal_change) / 2
    return factor * to_top * work * dx


def spin_energy(mesh: Mesh, parts: Parts, u: Expr, spin: Spin, density: Expr) -> ufl.Form:
    """∫ ρ |Ω × (x + u)|²/2 over the cells, to second order in the rotations."""
    # constants, as numbers would be compiled anew for each spin
    S = compat.constant(mesh.dolfinx, spin.stiffness)
    origin = compat.constant(mesh.dolfinx, np.array(spin.about))
    x = ufl.SpatialCoordinate(mesh.dolfinx)
    position = in_space([x[i] - origin[i] + u[i] for i in range(mesh.gdim)])
    dx = measure(mesh, LOAD_DEGREE + 1)
    energy = density * ufl.dot(position, S * position) / 2
    for direction, first, second in _mass_fibres(mesh, parts):
        _, rotation = split_motion(u)
        rotated = ufl.cross(rotation, direction)
        arm = direction + rotated + ufl.cross(rotation, rotated) / 2
        energy += first * ufl.dot(position, S * arm) + second * ufl.dot(arm, S * arm) / 2
    return energy * dx


def _mass_fibres(mesh: Mesh, parts: Parts) -> list[tuple[Expr, Expr, Expr]]:
    """(unit vector (3,), ∫ρ z, ∫ρ z²) (UFL) for each direction across the sections or thickness; z:
    coordinate along it; integrals per cell measure."""
    material = parts[0][0]
    if material.kind.sheet:
        section = section_fields(mesh, parts)
        n = frames(mesh, parts).n
        return [(n, 0.0 if section.I1 is None else section.I1, section.I2)]
    if not isinstance(material, Beam) or mesh.gdim == 2:
        return []
    axes = axes_of_beams(mesh, parts)

    def of(value: str) -> Expr:
        return coefficient(mesh, parts, lambda b: b.rho * getattr(b.section, value))

    offset = coefficient(mesh, parts, lambda b: b.offset)
    first = of("A") * offset
    return [(axes.y, first, of("I") + first * offset), (axes.z, 0.0, of("side"))]


def with_prestress(base: MeshedStructure, prestress: object) -> MeshedStructure:
    """`base` under `prestress`, with its tangent stiffness as K; InputError for a part with
    rigid-body modes, and beyond buckling."""
    loads = instance("prestress", prestress, Prestress, "a Prestress(spin=…, tension=…, …)")
    if base.rigid_modes.shape[1]:
        raise InputError(
            f"a prestress needs supports: {base.rigid_modes.shape[1]} rigid-body modes are left."
        )

    with doing("static step of the prestress"):
        solver, _ = base.factored(math.inf)
        initial = tendon_strains(base, loads.tension, solver)
        dead = dead_forces(base, loads)
        g = np.array(loads.gravity)
        if g.any():
            size = float(np.linalg.norm(g))
            dead += size * base.uniform_inertia(g / size)
        dead = zero_on_fixed(base, dead)
        loaded = LoadedPart(base, loads, initial)
        q, K, tangent = equilibrium(base, loaded, dead, solver)
        geometric = loaded.stiffness(q, geometric=True)
        free_when_dropped(geometric)
        reserve = 1 + buckling_factor(K, tangent, geometric)

    def added(motions: Array) -> Array:
        free = LoadedPart(base.unsupported(), loads, initial)
        return multiply(free.stiffness(q), motions)

    def reassembled(copy: Mesh, supports: Sequence[Support] = base.supports) -> MeshedStructure:
        return with_prestress(base.reassembled(copy, supports), loads)

    preload = Preload(loads, q, reserve, initial, added)
    return replace(
        base, K=K, reassembled=reassembled, preload=preload, unloaded=base, solver_of_K=tangent
    )


def tendon_strains(
    part: MeshedStructure, tensions: Mapping[str, float], solver: Solver
) -> dict[str, float]:
    """Stress-free strain of each group such that all groups together have the `tensions` [N], in
    linear theory; `solver`: of K without loads. InputError if nothing holds the ends of a group."""
    if not tensions:
        return {}
    pulls, lengths, stiffnesses = zip(*(tendon(part, name) for name in tensions), strict=True)
    loads = np.column_stack(pulls)
    forces = np.asarray(dot(solver.comm, loads, solver.solve_block(loads)))
    forces = forces / np.array(lengths)[:, None] - np.diag(stiffnesses)
    for name, stiffness, force in zip(tensions, stiffnesses, forces.diagonal(), strict=True):
        if -force <= LEAST_RESTRAINT * stiffness:
            raise InputError(f"{name!r} cannot be tightened: nothing holds its ends.")
    strains = np.linalg.solve(forces, list(tensions.values()))
    return dict(zip(tensions, strains.tolist(), strict=True))


def equilibrium(
    part: MeshedStructure, loaded: LoadedPart, dead: Array, elastic: Solver
) -> tuple[Array, PETSc.Mat, Solver]:
    """(displacements q (rows of this rank,), tangent stiffness K, its solver); InputError beyond
    buckling. `dead` (rows,): constant forces; `elastic`: solver of K without loads."""
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
        if change <= max(ENERGY_TOLERANCE * energy, rounding):
            return q, K, solver

    linear = elastic.solve(dead - loaded.forces(0 * q))
    reserve = buckling_factor(part.K, elastic, loaded.stiffness(linear, geometric=True))
    raise InputError(
        f"no stable equilibrium is found under the prestress: the part buckles at some "
        f"{reserve:.3g} times these loads (a spin at {math.sqrt(reserve):.3g} times its speed), or "
        "deflects too far; lower them, or support the part."
    )


def buckling_factor(K: PETSc.Mat, solver: Solver, geometric: PETSc.Mat) -> float:
    """The smallest λ > 0 for which K + λ geometric is singular; inf above `LARGEST_LOAD_FACTOR`.
    `solver`: of K. NotConvergedError if SLEPc finds none."""
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
    eps.setDimensions(1, BASIS_SIZE)
    eps.setTolerances(BUCKLING_TOLERANCE, MOST_RESTARTS)
    eps.setConvergenceTest(SLEPc.EPS.Conv.REL)
    use_inverse(eps.getST().getKSP(), solver.solve)

    largest = [math.inf]
    error = [math.inf]

    def watch(
        _: object, its: int, converged: int, values: list[complex], errors: list[float]
    ) -> None:
        largest[0] = values[0].real
        error[0] = errors[0] * abs(values[0])  # SLEPc divides by the value

    def reason(_: object, its: int, most: int, converged: int, wanted: int) -> int:
        if converged >= wanted or (largest[0] + error[0]) * LARGEST_LOAD_FACTOR < 1:
            return int(SLEPc.EPS.ConvergedReason.CONVERGED_USER)
        if its >= most:
            return int(SLEPc.EPS.ConvergedReason.DIVERGED_ITS)
        return int(SLEPc.EPS.ConvergedReason.CONVERGED_ITERATING)

    eps.setMonitor(watch)
    eps.setStoppingTest(reason)

    with one_thread():
        eps.solve()
    if not eps.getConverged() and largest[0] * LARGEST_LOAD_FACTOR < 1:
        return math.inf
    if not eps.getConverged():
        raise NotConvergedError(
            f"SLEPc found no buckling load in {MOST_RESTARTS} restarts: refine the mesh."
        )
    value = eps.getEigenvalue(0).real
    eps.destroy()
    return math.inf if value * LARGEST_LOAD_FACTOR <= 1 else float(1 / value)
