"""Beams on the edges of a sheet, without dofs of their own.

A beam is assembled on a mesh of those edges, whose dofs are dofs of the sheet: K + Tᵀ K_beam T.
"""

from __future__ import annotations

from dataclasses import dataclass

import dolfinx
import numpy as np
import scipy.spatial
from petsc4py import PETSc

from antiosc.base._types import Array, IntArray
from antiosc.base.errors import InputError
from antiosc.fem.elements.beam import Beam, on_lines
from antiosc.fem.elements.weak_form import Parts, WeakForm
from antiosc.fem.linalg.algebra import multiply
from antiosc.fem.mesh.mesh import Mesh
from antiosc.fem.platform import compat
from antiosc.fem.platform.mpi import agree
from antiosc.fem.structure.attachments import Added, Matrices

#: Dofs of a beam and of the sheet are the same within this share of the beam's extent.
SAME_DOF = 1e-7


@dataclass(frozen=True)
class Stiffener:
    """Beams on edges of a sheet, as a part of their own."""

    mesh: Mesh
    form: WeakForm
    #: the beam and its cells of this rank, ghosts included
    parts: Parts
    K: PETSc.Mat
    M: PETSc.Mat
    #: T of beam dofs = T · sheet dofs
    shared: PETSc.Mat

    def rows_of(self, columns: Array) -> Array:
        """Beam dofs (rows of this rank, k) of dofs of the sheet (rows of this rank, k)."""
        return multiply(self.shared, columns)


def add_beams(to: Matrices, name: str, beam: Beam, edges: IntArray) -> tuple[Added, Stiffener]:
    """Add `beam` on the `edges` of a sheet, entities of this rank in the group `name`."""
    if to.mesh.cell == "quadrilateral" and to.mesh.order > 1:
        raise InputError(
            f"beams on curved quadrilaterals (group {name!r}): these are too soft under the pull "
            "of a stiffener if they are thinner than their rise; mesh the surface with triangles."
        )
    if not beam.shear:
        raise InputError(
            f"stiffeners (group {name!r}) deform in shear with their shell: shear=False is for "
            "beams without a shell only."
        )
    line = _edge_mesh(to.mesh, edges, f"the edges of group {name!r}")
    cells = compat.cell_map(line.dolfinx)
    parts = [(beam, np.arange(cells.size_local + cells.num_ghosts, dtype=np.int32))]
    form = on_lines(line, parts, 3 if to.mesh.cell == "triangle" else 2, on_sheet=True)
    T = _shared_dofs(to, edges, form, line)
    own = [compat.assemble(forms, form.space, {}, 0.0) for forms in (form.stiffness, form.mass)]
    for matrix, one in zip((to.K, to.M), own, strict=True):
        matrix.axpy(1.0, one.ptap(T), structure=PETSc.Mat.Structure.SUBSET_NONZERO_PATTERN)
    moving = np.zeros((compat.local_size(form.space), 3))
    for axis, component in enumerate("xyz"):
        dofs, _ = compat.dof_coordinates(form.space, form.components[component])
        moving[dofs[dofs < len(moving)], axis] = 1.0
    inertia = multiply(own[1], moving)
    mass = line.comm.allreduce(float(moving[:, 0] @ inertia[:, 0]))
    rows = compat.local_size(to.form.space)
    on_sheet = multiply(T.transpose(PETSc.Mat()), inertia)
    added = Added(mass, on_sheet, np.zeros((rows, 0)))
    return added, Stiffener(line, form, parts, own[0], own[1], T)


#: Corners of the edges of a cell, in dolfinx's order; mid-side nodes follow the corners.
SHEET_EDGES = {
    "triangle": ((1, 2), (0, 2), (0, 1)),
    "quadrilateral": ((0, 1), (0, 2), (1, 3), (2, 3)),
}


def _edge_mesh(mesh: Mesh, edges: IntArray, name: str) -> Mesh:
    """A mesh in space of some edges, with the curvature that they have in the sheet."""
    topology = mesh.dolfinx.topology
    topology.create_connectivity(1, 2)
    topology.create_connectivity(2, 1)
    owned = edges[edges < topology.index_map(1).size_local]
    nodes = np.zeros((len(owned), mesh.order + 1), dtype=np.int64)
    of_cell = compat.geometry_nodes(mesh.dolfinx)
    table = SHEET_EDGES[mesh.cell]
    for row, edge in enumerate(owned):
        cell = topology.connectivity(1, 2).links(edge)[0]
        local = int(np.flatnonzero(topology.connectivity(2, 1).links(cell) == edge)[0])
        positions = [*table[local], len(table) + local][: mesh.order + 1]
        nodes[row] = of_cell[cell][positions]
    x = np.zeros((len(mesh.dolfinx.geometry.x), 3))
    x[:] = mesh.dolfinx.geometry.x
    numbers = np.asarray(mesh.dolfinx.geometry.input_global_indices)[nodes]
    everywhere = mesh.comm.allgather((numbers, x[nodes]))
    numbers = np.vstack([one for one, _ in everywhere])
    points = np.concatenate([one for _, one in everywhere])
    _, first, cells = np.unique(numbers.ravel(), return_index=True, return_inverse=True)
    cells, points = cells.reshape(numbers.shape), points.reshape(-1, 3)[first]
    if mesh.comm.rank:
        cells, points = cells[:0], points[:0]
    line = compat.create_mesh(mesh.comm, cells, points, "interval", mesh.order)
    return Mesh(line, {}, name)


def _shared_dofs(to: Matrices, edges: IntArray, form: WeakForm, line: Mesh) -> PETSc.Mat:
    """T with beam dofs = T · shell dofs; the rows of fixed dofs are empty."""
    size = line.extent()
    rows, first = compat.local_size(form.space), form.space.dofmap.index_map.local_range[0]
    first *= form.space.dofmap.index_map_bs
    T = PETSc.Mat().createAIJ(
        ((rows, None), (compat.local_size(to.form.space), None)), nnz=1, comm=to.mesh.comm
    )
    error = None
    for component, path in form.components.items():
        sheet = compat.subspace(to.form.space, to.form.components[component])
        all_dofs, all_x = compat.dof_coordinates(to.form.space, to.form.components[component])
        there = np.asarray(dolfinx.fem.locate_dofs_topological(sheet, 1, edges))
        order = np.argsort(all_dofs)
        x = all_x[order[np.searchsorted(all_dofs, there, sorter=order)]]
        numbers = compat.global_dofs(to.form.space, there)
        fixed = np.isin(there, to.fixed)
        found = to.mesh.comm.allgather((x, numbers, fixed))
        x, numbers, fixed = (np.concatenate([one[k] for one in found]) for k in range(3))
        mine, points = compat.dof_coordinates(form.space, path)
        points, mine = points[mine < rows], mine[mine < rows]
        if not len(mine):
            continue
        distance, nearest = scipy.spatial.cKDTree(x).query(points)
        if distance.max() > SAME_DOF * size:
            error = InputError(f"{line.name} do not carry the dofs of the sheet.")
            continue
        for dof, k in zip(mine, nearest, strict=True):
            if not fixed[k]:
                T.setValue(first + dof, numbers[k], 1.0)
    agree(to.mesh.comm, error)
    T.assemble()
    return T
