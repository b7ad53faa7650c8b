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
from antiosc.fem.elements.beam import Beam
from antiosc.fem.elements.weak_form import Family, Parts, WeakForm, measure
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
    attachments_of,
)
from antiosc.fem.structure.meshed import MeshedStructure
from antiosc.fem.structure.stiffeners import add_beams
from antiosc.fem.structure.support import NO_DOFS, Support, fixed_dofs

#: Deviation from a line of points that lie on it, over the size of the part.
ON_LINE = 1e-6


def divided(mesh: Mesh, material: object) -> tuple[object, list[tuple[str, Beam, IntArray]]]:
    """(materials of the cells, beams on edges of a sheet as (group, beam, edges))."""
    if not isinstance(material, Mapping) or mesh.tdim != 2:
        return material, []
    beams = {name: one for name, one in material.items() if isinstance(one, Beam)}
    if not beams:
        return material, []
    cells = {name: one for name, one in material.items() if name not in beams}
    if not cells or not all(_family(one).kind.sheet for one in cells.values()):
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


def parts_of(mesh: Mesh, material: object) -> Parts:
    """[(material, cells of this rank)], each cell once."""
    imap = compat.cell_map(mesh.dolfinx)
    n_cells = imap.size_local + imap.num_ghosts
    if not isinstance(material, Mapping):
        return [(_family(material), np.arange(n_cells, dtype=np.int32))]
    if not material:
        raise InputError("material is an empty dict: give {group name: material}.")
    times = np.zeros(n_cells, dtype=int)
    parts: list[tuple[Family, IntArray]] = []
    for name, given in material.items():
        one = _family(given)
        cells = mesh.group(name).get(mesh.tdim)
        if cells is None:
            raise InputError(f"group {name!r} holds no cells (dimension {mesh.tdim}).")
        times[cells] += 1
        parts.append((one, cells))
    if len({one.kind for one, _ in parts}) > 1:
        raise InputError(
            "all materials of one structure must be of one family: Solid, Beam, Truss, or Shell "
            "and Laminate."
        )
    none = mesh.comm.allreduce(int(np.sum(times[: imap.size_local] == 0)))
    twice = mesh.comm.allreduce(int(np.sum(times[: imap.size_local] > 1)))
    if none or twice:
        raise InputError(
            f"every cell needs one material: of {mesh.n_cells} cells {none} have none and "
            f"{twice} more than one; the groups named are {', '.join(map(repr, material))}."
        )
    return parts


def _family(material: object) -> Family:
    """`material`, or InputError for anything else."""
    if isinstance(material, type) or not isinstance(material, Family):
        raise InputError(
            "material must be a Solid, Shell, Laminate, Beam or Truss, or a dict of them; got "
            f"{type(material).__name__}."
        )
    return material


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
            plausible.of_part(mesh.extent(), mesh.stated, mesh.tdim == 1),
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
    rest = K
    if form.strains is not None:
        rest = K.duplicate()
        rest.zeroEntries()
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
        thickness=_stretched(mesh, form, fixed, [one for one, _ in parts]),
    )


def _take_by_strains(K: PETSc.Mat, S: PETSc.Mat, rest: PETSc.Mat, fixed: IntArray) -> None:
    """Add `rest` to K, and let products with K be taken by S, its strains."""
    K.axpy(1.0, rest, structure=PETSc.Mat.Structure.SAME_NONZERO_PATTERN)
    first, last = rest.getOwnershipRange()
    for dof in fixed[fixed < last - first]:
        rest.setValue(first + dof, first + dof, 1.0)
    rest.assemble()
    attach(K, S, rest)


def _stretched(
    mesh: Mesh, form: WeakForm, fixed: IntArray, materials: Sequence[Any]
) -> float | None:
    """The least thickness [m] of a sheet, None where it is held at points of one line alone.

    Such a sheet bends as a cantilever does: large deflections hardly stretch it.
    """
    if not materials[0].kind.sheet:
        return None
    nodes = np.unique(fixed // form.space.dofmap.index_map_bs)
    x = np.vstack(mesh.comm.allgather(form.space.tabulate_dof_coordinates()[nodes]))
    spread = np.linalg.svd(x - x.mean(axis=0), compute_uv=False) if len(x) else np.ones(2)
    if spread[1:].sum() <= ON_LINE * mesh.extent():
        return None
    return float(min(one.section.thickness for one in materials))


def _of_section(material: Family, extent: float) -> str:
    """What is implausible of the size of a section; "" for nothing."""
    section: Any = getattr(material, "section", None)
    if hasattr(section, "thickness"):
        return plausible.of_thickness(section.thickness, extent)
    area = getattr(section, "A", 0.0)
    return plausible.of_thickness(float(np.sqrt(area)), extent, "beam")
