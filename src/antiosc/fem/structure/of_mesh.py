"""`assembled`: the structure of a mesh with its materials, supports and attached bodies."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from petsc4py import PETSc

from antiosc.base import plausible
from antiosc.base._types import IntArray
from antiosc.base.checks import several, whole
from antiosc.base.errors import InputError
from antiosc.base.progress import doing
from antiosc.fem.elements.weak_form import Family, measure
from antiosc.fem.linalg.solver import Choice, checked_choice
from antiosc.fem.linalg.strains import attach
from antiosc.fem.mesh.mesh import Mesh
from antiosc.fem.platform import compat
from antiosc.fem.platform.mpi import warn
from antiosc.fem.structure import rigid_body_modes
from antiosc.fem.structure.attachments import (
    Attachment,
    Matrices,
    add_at_points,
    add_beams,
    attachments_of,
)
from antiosc.fem.structure.materials import divided, parts_of
from antiosc.fem.structure.meshed import MeshedStructure
from antiosc.fem.structure.support import NO_DOFS, Support, fixed_dofs


def assembled(
    mesh: Mesh,
    material: Family | Mapping[str, Family],
    supports: Sequence[Support],
    *,
    order: int,
    attached: Sequence[Attachment],
    solver: Choice,
) -> MeshedStructure:
    """The structure of a mesh; parameters and errors are those of `Structure`."""
    if not isinstance(mesh, Mesh):
        raise InputError(f"mesh must come from read_mesh; got {type(mesh).__name__}.")
    order = whole("order", order)
    if order not in (1, 2):
        raise InputError(f"order must be 1 or 2; got {order}.")
    checked_choice(solver)
    held = several("supports", supports, Support, "Support(where, fix)")
    carried = attachments_of(attached)
    cells, beams = divided(mesh, material)
    parts = parts_of(mesh, cells)
    stiffeners = [beam for _, beam, _ in beams]
    materials = [*(one for one, _ in parts), *stiffeners]
    doubts = plausible.tell(
        [
            plausible.of_part(mesh.extent()),
            *map(plausible.of_material, materials),
            *(_of_section(one, mesh.extent()) for one in materials),
        ]
    )
    form = parts[0][0].weak_form(mesh, parts, order)
    conditions = fixed_dofs(mesh, form, held)
    with doing(f"assembly of {mesh.n_cells} cells", mesh.comm.rank):
        K = compat.assemble(form.stiffness, form.space, conditions, 1.0)
        M = compat.assemble(form.mass, form.space, conditions, 0.0)
    fixed = np.unique(np.concatenate([NO_DOFS, *conditions.values()]))
    free = compat.local_size(form.space) - int((fixed < compat.local_size(form.space)).sum())
    if mesh.comm.allreduce(free) == 0:
        raise InputError("the supports fix every dof of the structure: nothing can move.")
    mass = compat.integrate(form.density * measure(mesh, 5), mesh.dolfinx)
    # What is added to K, apart where K is taken by its strains.
    rest = K if form.strains is None else _zeros_like(K)
    to = Matrices(mesh, form, rest, M, fixed)
    on_edges = {name: add_beams(to, name, beam, edges) for name, beam, edges in beams}
    added = [one for one, _ in on_edges.values()]
    added += [add_at_points(to, one) for one in carried]
    if form.strains is not None:
        strains, degree = form.strains
        S = compat.strain_matrix(strains, degree, form.space, conditions)
        _take_by_strains(K, S, rest, fixed)
    mass += sum(one.mass for one in added)
    attached_inertia = sum(
        (one.inertia for one in added), np.zeros((compat.local_size(form.space), 3))
    )
    springs = np.column_stack([attached_inertia[:, :0], *(one.springs for one in added)])
    modes, shift = rigid_body_modes.of_mesh(form, fixed, K, M, springs)
    if conditions and modes.shape[1]:
        motions = rigid_body_modes.described(mesh, form, modes)
        warn(
            mesh.comm,
            f"the supports leave the structure free to move as a rigid body: {motions}; hold "
            "that too unless it is intended.",
        )
    given = dict(material) if isinstance(material, Mapping) else material

    def again(copy: Mesh, supports: Sequence[Support] = held) -> MeshedStructure:
        return assembled(copy, given, supports, order=order, attached=carried, solver=solver)

    return MeshedStructure(
        K,
        M,
        fixed,
        modes,
        shift,
        solver,
        mesh=mesh,
        form=form,
        parts=parts,
        total_mass=mass,
        attached_inertia=attached_inertia,
        again=again,
        supports=held,
        stiffeners={name: lines for name, (_, lines) in on_edges.items()},
        dampers=[damper for one in added for damper in one.dampers],
        conditions=conditions,
        doubts=doubts,
    )


def _take_by_strains(K: PETSc.Mat, S: PETSc.Mat, rest: PETSc.Mat, fixed: IntArray) -> None:
    """Add `rest` to K, and let products with K be taken by S, its strains."""
    K.axpy(1.0, rest, structure=PETSc.Mat.Structure.SAME_NONZERO_PATTERN)
    first, last = rest.getOwnershipRange()
    for dof in fixed[fixed < last - first]:
        rest.setValue(first + dof, first + dof, 1.0)
    rest.assemble()
    attach(K, S, rest)


def _zeros_like(matrix: PETSc.Mat) -> PETSc.Mat:
    result = matrix.duplicate()
    result.zeroEntries()
    return result


def _of_section(material: Family, extent: float) -> str:
    """What is implausible of the size of a section; "" for nothing."""
    section: Any = getattr(material, "section", None)
    if hasattr(section, "thickness"):
        return plausible.of_thickness(section.thickness, extent)
    area = getattr(section, "A", 0.0)
    return plausible.of_thickness(float(np.sqrt(area)), extent, "beam")
