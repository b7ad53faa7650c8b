"""`Structure`: mesh, materials and supports as assembled K and M, or matrices from elsewhere."""

from __future__ import annotations

import time
from collections.abc import Mapping, Sequence
from functools import cached_property, partial
from typing import Any

import numpy as np
from mpi4py import MPI
from numpy.typing import ArrayLike, NDArray
from petsc4py import PETSc

from antiosc.checks import array, shown, whole
from antiosc.errors import InputError
from antiosc.fem import compat
from antiosc.fem.compat import IntArray
from antiosc.fem.elements.beam import Beam
from antiosc.fem.elements.shell import Sheet
from antiosc.fem.elements.weak_form import Family, Parts, WeakForm, measure
from antiosc.fem.linalg.solver_choice import Choice, checked_choice, solver_for
from antiosc.fem.linalg.solvers import Solver, dot, multiply, sum_of
from antiosc.fem.linalg.strains import attach
from antiosc.fem.mesh.mesh import Mesh
from antiosc.fem.mesh.units import tell_of_units
from antiosc.fem.mpi import bounds, collective, warn
from antiosc.fem.structure import remaining_motions, rigid_body_modes
from antiosc.fem.structure.attachments import Matrices, PointMass, Spring, add_at_points, add_beams
from antiosc.fem.structure.given_matrices import as_petsc, supported
from antiosc.fem.structure.support import NO_DOFS, Support, held_dofs
from antiosc.models.motion import Inertia

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
        How K is solved with: by a Cholesky factor, or where its memory is not to be had by
        conjugate gradients with multigrid (`antiosc.fem.linalg.solver_choice`).

    Attributes
    ----------
    K, M : PETSc.Mat
        Stiffness (N/m) and mass (kg). Fixed dofs keep their rows: 1 on K's diagonal, 0 in M.
    dofs : int
        Dofs that are not fixed, on all ranks.
    mass : float
        Total mass, kg.
    rigid_modes : ndarray (rows of this rank, r)
        M-orthonormal rigid-body modes that the supports leave.
    seconds : dict
        What assembly and factorization (its forecast of memory included) took.

    Raises
    ------
    InputError
        Unknown group, support that selects nothing, cells without a material, family and mesh
        that do not fit.
    """

    @collective()
    def __init__(
        self,
        mesh: Mesh,
        material: Family | Mapping[str, Family],
        supports: Sequence[Support] = (),
        *,
        order: int = 2,
        attached: Sequence[PointMass | Spring] = (),
        solver: Choice = "auto",
    ) -> None:
        if not isinstance(mesh, Mesh):
            raise InputError(f"mesh must come from read_mesh; got {type(mesh).__name__}.")
        order = whole("order", order)
        if order not in (1, 2):
            raise InputError(f"order must be 1 or 2; got {order}.")
        started = time.perf_counter()
        self._solver: Choice = checked_choice(solver)
        self.mesh: Mesh | None = mesh
        cells, beams = _divided(mesh, material)
        self.parts: Parts = _parts(mesh, cells)
        stiffeners = [beam for _, beam, _ in beams]
        tell_of_units(mesh.extent(), [*(one for one, _ in self.parts), *stiffeners])
        self.form: WeakForm | None = self.parts[0][0].weak_form(mesh, self.parts, order)
        held = held_dofs(mesh, self.form, supports)
        space = self.form.space
        self.K: PETSc.Mat = compat.assemble(self.form.stiffness, space, held, 1.0)
        self.M: PETSc.Mat = compat.assemble(self.form.mass, space, held, 0.0)
        # dofs of this rank, ghosts included, that the supports hold
        self.fixed: IntArray = np.unique(np.concatenate([NO_DOFS, *held.values()]))
        owned = self.fixed[self.fixed < compat.local_size(space)]
        self.dofs: int = self.K.getSize()[0] - self.comm.allreduce(len(owned))
        if self.dofs == 0:
            raise InputError("the supports fix every dof of the structure: nothing can move.")
        self._mass: float | None = compat.integrate(
            self.form.density * measure(mesh, 5), mesh.dolfinx
        )
        # What is added to K, apart where K is taken by its strains.
        rest = self.K if self.form.strains is None else _zeros_like(self.K)
        to = Matrices(mesh, self.form, rest, self.M, self.fixed)
        added = [add_beams(to, name, beam, edges) for name, beam, edges in beams]
        added += [add_at_points(to, one) for one in _checked(attached)]
        if self.form.strains is not None:
            self._by_strains(self.form.strains, held, rest)
        self._mass += sum(one.mass for one in added)
        self._attached_inertia = sum(
            (one.inertia for one in added), np.zeros((self.K.getLocalSize()[0], 3))
        )
        springs = np.column_stack([self._attached_inertia[:, :0], *(one.springs for one in added)])
        self.rigid_modes, self.shift = rigid_body_modes.of_mesh(
            self.form, self.fixed, self.K, self.M, springs
        )
        if held and self.rigid_modes.shape[1]:
            motions = remaining_motions.described(mesh, self.form, self.rigid_modes)
            warn(
                mesh.comm,
                f"the supports leave the structure free to move as a rigid body: {motions}; hold "
                "that too if it is not meant.",
            )
        self.seconds: dict[str, float] = {"assembly": time.perf_counter() - started}

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
        self = cls.__new__(cls)
        self.K, self.M = as_petsc("K", K), as_petsc("M", M)
        self.fixed = supported(self.K, self.M)
        self.mesh = self.form = self._mass = None
        self._solver = "auto"
        self.parts = []
        self.dofs = self.K.getSize()[0] - self.comm.allreduce(len(self.fixed))
        given = None
        if rigid_modes is not None:
            given = array("rigid_modes", rigid_modes, (self.K.getLocalSize()[0], None))
        self.rigid_modes, self.shift = rigid_body_modes.of_matrices(self.K, self.M, given)
        self.seconds = {"assembly": time.perf_counter() - started}
        return self

    @property
    def comm(self) -> MPI.Comm:
        """The MPI communicator that shares the matrices."""
        if self.mesh is not None:
            return self.mesh.comm
        return self.K.getComm().tompi4py()

    def meshed(self) -> tuple[Mesh, WeakForm]:
        """The mesh and the form that was assembled on it; InputError for matrices."""
        if self.mesh is None or self.form is None:
            raise InputError("matrices carry no mesh: build the Structure of one for this.")
        return self.mesh, self.form

    @property
    def mass(self) -> float:
        """Total mass in kg."""
        if self._mass is None:
            raise InputError(
                "matrices alone do not tell a total mass; build the Structure of a mesh."
            )
        return self._mass

    @cached_property
    def factorization(self) -> Solver:
        """The one factor of K + shift·M that every site and every mode of this structure uses."""
        started = time.perf_counter()
        factor = self._factored()
        for _ in range(CLOSER if self.rigid_modes.shape[1] else 0):
            better = rigid_body_modes.closer_shift(factor, self.K, self.M, self.rigid_modes)
            if better >= rigid_body_modes.FAR * self.shift:
                break
            self.shift = better
            factor = self._factored()
        self.seconds["factorization"] = time.perf_counter() - started
        return factor

    def _by_strains(
        self,
        strains: tuple[Any, int],
        held: Mapping[tuple[int, ...], IntArray],
        rest: PETSc.Mat,
    ) -> None:
        """Add `rest` to K, and let products with K be taken by its strains."""
        self.K.axpy(1.0, rest, structure=PETSc.Mat.Structure.SAME_NONZERO_PATTERN)
        first, last = rest.getOwnershipRange()
        for dof in self.fixed[self.fixed < last - first]:
            rest.setValue(first + dof, first + dof, 1.0)
        rest.assemble()
        space = self.meshed()[1].space
        attach(self.K, compat.strain_matrix(*strains, space, held), rest)

    def _factored(self) -> Solver:
        motions = partial(rigid_body_modes.motions, self.form, self.K)
        return solver_for(sum_of(self.K, self.shift, self.M), self._solver, motions)

    def uniform_inertia(self, direction: NDArray[np.float64]) -> NDArray[np.float64] | None:
        """Me on the rows of this rank for e, a unit uniform motion along `direction` (3,).

        None for matrices, which do not tell where e points.
        """
        direction = array("direction", direction, (3,))
        if self.mesh is None or self.form is None:
            return None
        along = compat.constant(self.mesh.dolfinx, direction)
        load = self.form.momentum(along) * measure(self.mesh, 5)
        own = compat.assemble_functional(load, self.form.space)
        return np.asarray(own[: len(self._attached_inertia)] + self._attached_inertia @ direction)

    @cached_property
    def rigid_inertia(self) -> tuple[Inertia, NDArray[np.float64]] | None:
        """The whole body's inertia (its momentum empty) and M r of its rigid motions r (rows, 6).

        With them any shape's momentum is its product with M r. None for matrices, which have no
        coordinates, and where no rigid-body mode is left.
        """
        if self.mesh is None or self.form is None or not self.rigid_modes.shape[1]:
            return None
        low, high = bounds(self.comm, self.mesh.dolfinx.geometry.x)
        point = (low + high) / 2
        motions = rigid_body_modes.about(self.form, point)
        loads = multiply(self.M, motions)
        owned = self.fixed[self.fixed < len(motions)]
        if self.comm.allreduce(len(owned)):
            # M has no entries on the held dofs, whose mass moves with a motion of the whole body
            whole = compat.assemble(self.form.mass, self.form.space, {}, 0.0)
            free = motions.copy()
            free[owned] = 0.0
            kept = multiply(whole, free)
            kept[owned] = 0.0
            loads += multiply(whole, motions) - kept
        S = dot(self.comm, motions, loads)
        return Inertia(point, (S + S.T) / 2, np.zeros((0, 6))), loads

    @property
    def dimensions(self) -> tuple[float, float, float]:
        """Length, width and thickness of the part, m, as `antiosc.advice` wants them.

        Of the box along the axes around it; a shell's thickness is its least, a beam's width and
        thickness are those of the rectangle with its section's A and I.
        """
        if self.mesh is None:
            raise InputError("matrices have no dimensions: give length, width and thickness.")
        low, high = bounds(self.comm, self.mesh.dolfinx.geometry.x)
        length, width, thickness = sorted((float(e) for e in high - low), reverse=True)
        materials = [material for material, _ in self.parts]
        if isinstance(materials[0], Sheet):
            thickness = min(one.thickness for one in materials)
        elif isinstance(materials[0], Beam):
            thickness = min((12 * one.section.I / one.section.A) ** 0.5 for one in materials)
            width = max(one.section.A for one in materials) / thickness
        elif materials[0].plane is not None:
            width, thickness = materials[0].thickness, width
        return length, width, thickness

    def part_of_cells(self) -> IntArray:
        """Number in `parts` of the material of each cell of this rank, ghosts included."""
        imap = compat.cell_map(self.meshed()[0].dolfinx)
        part = np.zeros(imap.size_local + imap.num_ghosts, dtype=int)
        for number, (_, cells) in enumerate(self.parts):
            part[cells] = number
        return part

    def describe(self) -> str:
        """One line: what was modelled and with how many dofs."""
        if self.mesh is None:
            return f"given matrices, {self.dofs} dofs"
        family = " and ".join(sorted({type(material).__name__ for material, _ in self.parts}))
        return (
            f"{self.mesh.name}: {self.mesh.n_cells} {self.mesh.cell} cells, {family}, "
            f"{self.dofs} dofs, {self.rigid_modes.shape[1]} rigid-body modes"
        )


def _zeros_like(matrix: PETSc.Mat) -> PETSc.Mat:
    result = matrix.duplicate()
    result.zeroEntries()
    return result


def _divided(mesh: Mesh, material: Any) -> tuple[Any, list[tuple[str, Beam, IntArray]]]:
    """(materials of the cells, beams on edges of a sheet as (group, beam, edges))."""
    if not isinstance(material, Mapping) or mesh.tdim != 2:
        return material, []
    beams = {name: one for name, one in material.items() if isinstance(one, Beam)}
    if not beams:
        return material, []
    cells = {name: one for name, one in material.items() if name not in beams}
    if not cells or not all(isinstance(one, Sheet) for one in cells.values()):
        raise InputError(
            f"a Beam on edges (group {next(iter(beams))!r}) stiffens a shell: give the cells of "
            f"{mesh.name} a Shell or Laminate; a frame of beams alone needs a mesh of lines."
        )
    found = []
    for name, beam in beams.items():
        edges = mesh.group(name).get(1)
        if edges is None:
            raise InputError(
                f"group {name!r} holds no edges of the sheet's cells, which a Beam there needs: "
                "let its lines lie in the surface that is meshed (in gmsh: BooleanFragments)."
            )
        found.append((name, beam, edges))
    return cells, found


def _checked(attached: Any) -> Sequence[PointMass | Spring]:
    items = [attached] if isinstance(attached, PointMass | Spring) else attached
    if not isinstance(items, Sequence):
        raise InputError(
            f"attached must be a list of PointMass and Spring objects; got {shown(attached)}."
        )
    for one in items:
        if not isinstance(one, PointMass | Spring):
            raise InputError(
                f"attached must hold PointMass and Spring objects; got {type(one).__name__}."
            )
    return items


def _parts(mesh: Mesh, material: Any) -> Parts:
    """[(material, cells of this rank)], each cell once."""
    imap = compat.cell_map(mesh.dolfinx)
    n_cells = imap.size_local + imap.num_ghosts
    if not isinstance(material, Mapping):
        _check_family(material)
        return [(material, np.arange(n_cells, dtype=np.int32))]
    if not material:
        raise InputError("material is an empty dict: give {group name: material}.")
    times = np.zeros(n_cells, dtype=int)
    parts = []
    for name, one in material.items():
        _check_family(one)
        cells = mesh.group(name).get(mesh.tdim)
        if cells is None:
            raise InputError(f"group {name!r} holds no cells (dimension {mesh.tdim}).")
        times[cells] += 1
        parts.append((one, cells))
    if len({type(one).weak_form for one, _ in parts}) > 1:  # Shell and Laminate share theirs
        raise InputError(
            "all materials of one structure must be of one family: Solid, Beam, or Shell and "
            "Laminate."
        )
    none = mesh.comm.allreduce(int(np.sum(times[: imap.size_local] == 0)))
    twice = mesh.comm.allreduce(int(np.sum(times[: imap.size_local] > 1)))
    if none or twice:
        raise InputError(
            f"every cell needs one material: of {mesh.n_cells} cells {none} have none and "
            f"{twice} more than one; the groups named are {', '.join(map(repr, material))}."
        )
    return parts


def _check_family(material: Any) -> None:
    if isinstance(material, type) or not hasattr(material, "weak_form"):
        raise InputError(
            "material must be a Solid, Shell, Laminate or Beam, or a dict of them; got "
            f"{type(material).__name__}."
        )
