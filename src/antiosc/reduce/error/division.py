"""The error of the mesh of beams and sheets, by the same mesh with each cell divided.

The strains of these elements are most accurate at the points where the element takes them, so that
a recovery of strains finds a part of their error alone. Instead the loads of the shapes (the site's
load, and inertia forces ω² M ψ with their reaction at the site) act on the divided mesh too. The
difference of the flexibilities, times 1/(1 - 4^-p), is the error of the mesh: the flexibility of
beams of degree p converges with the power 2p of the size of the cells; that of sheets with the
square, where a patch smaller than the cells is loaded.
"""

from __future__ import annotations

from dataclasses import replace
from typing import cast
from weakref import WeakKeyDictionary

import basix
import numpy as np
import scipy.sparse

from antiosc.base import process
from antiosc.base._types import Array, IntArray
from antiosc.base.clock import clock
from antiosc.base.errors import InputError, without_warnings
from antiosc.base.progress import doing
from antiosc.fem.assembly import MeshedParts, with_parts
from antiosc.fem.linalg.algebra import multiply
from antiosc.fem.linalg.forecast import OF_SHELLS, of_sheet
from antiosc.fem.mesh import Mesh, distributed
from antiosc.fem.mesh.finer import gathered, halved, scheme
from antiosc.fem.platform import compat
from antiosc.fem.structure.meshed import MeshedStructure
from antiosc.fem.structure.structure import Structure, holding, on_mesh
from antiosc.fem.structure.support import NumberedNodes, Support
from antiosc.io.neutral import KINDS, RawMesh
from antiosc.models.anti_oscillators import AntiOscillators
from antiosc.reduce.extraction import statics
from antiosc.reduce.site import Site, functional

#: Most dofs of a divided mesh: 767 000 took 50 s of one core.
MOST_DOFS = 800_000
#: Anti-oscillators for which the memory of the divided mesh is foreseen, and bytes of their
#: motions, forces and answers for each of its dofs: 309 000 dofs took 4.5 GB, 767 000 some 12 GB.
FORESEEN, EACH_ANSWER = 150, 52.0
#: Share of the energies of shapes below which a surplus is rounding.
SURPLUS = 1e-9
#: Structures that are divided already, with their factors, for further sites.
_divided: WeakKeyDictionary[object, Structure] = WeakKeyDictionary()


def too_large(matrices: MeshedParts) -> str:
    """Why the mesh of a structure is not divided; "" if it can be."""
    part = matrices.members()[0].part
    name = part.mesh.name
    finer = 2.0**part.mesh.tdim * part.rows
    need = (OF_SHELLS + EACH_ANSWER * FORESEEN) * finer + of_sheet(round(finer), 0)
    remedy = "compare with a mesh of larger cells"
    if finer > MOST_DOFS:
        return (
            f"it takes {name} with each cell divided, and {finer:.0f} dofs are more than"
            f" {MOST_DOFS}: {remedy}."
        )
    free = process.free_memory()
    if need > process.MEMORY_SHARE * free:
        what = f"{name} with each cell divided, which it takes,"
        return f"{process.shortage(what, need, free)}: {remedy}."
    return ""


class Division:
    """Estimator for one mesh of beams or sheets, on one rank."""

    divided = True

    def __init__(self, structure: Structure) -> None:
        if structure.comm.size > 1:
            raise InputError("the error 'estimate' of beams and shells runs on one rank.")
        self._matrices = with_parts(structure)

    def energies(self, model: AntiOscillators) -> tuple[Array, Array | None]:
        """(energies and products (N + 1, N + 1) that the mesh lacks in the shapes of a model, those
        that it has in excess, or None).
        """
        fine, _motions, forces = self._loaded(model)
        flexibility = forces.T @ statics(fine, forces)
        lack, surplus = lacking(np.append(model.k0, model.k), flexibility)
        struck = self._matrices.members()[0].part
        order = struck.form.degree if struck.mesh.tdim == 1 else 1
        remaining = 1 / (1 - 4.0**-order)
        is_rounding = np.abs(surplus).max() <= SURPLUS * np.abs(flexibility).max()
        return remaining * lack, None if is_rounding else remaining * surplus

    def of_cells(self, model: AntiOscillators, weights: Array) -> Array:
        """Energy (cells,) of the errors of the shapes times `weights` (N + 1, k), of one mesh."""
        fine, motions, forces = self._loaded(model)
        errors = statics(fine, forces @ weights) - motions @ weights
        part = on_mesh(fine)
        energies = compat.quadratic(
            part.form.stiffness, part.form.space, errors, np.ones(errors.shape[1]), 4
        )
        parent = np.asarray(part.mesh.dolfinx.topology.original_cell_index) // 2**part.mesh.tdim
        coarse = self._matrices.members()[0].part.mesh.dolfinx.topology
        of_input = np.bincount(parent, np.maximum(energies, 0.0))
        return np.asarray(of_input[coarse.original_cell_index])

    def _loaded(self, model: AntiOscillators) -> tuple[Structure, Array, Array]:
        """(the divided structure, the shapes of a model as its displacements (rows, N + 1), their
        loads).
        """
        point, direction = model.info.point, model.info.direction
        if point is None or direction is None:
            raise InputError(
                "the error 'estimate' of beams and shells needs a Site with point and direction."
            )
        fine = divided(self._matrices)
        place = Site(point, direction, radius=cast("float | None", model.radius))
        parts = self._matrices.members()[0].part, with_parts(fine).members()[0].part
        motions = np.asarray(interpolation(*parts) @ np.asarray(model.shapes))
        load = functional(fine, place).b[:, None]
        masses, squares = np.append(0.0, model.m), np.append(0.0, np.square(model.omega))
        forces = squares * (multiply(fine.M, motions) - masses * load)
        forces[:, :1] = model.k0 * load
        forces[fine.fixed] = 0.0
        return fine, motions, forces


def divided(matrices: MeshedParts) -> Structure:
    """The structure with each cell divided; it is kept, with its factor, for further sites."""
    if matrices not in _divided:
        start_time = clock()
        with without_warnings(), doing("a mesh of half the size, for the error bar"):
            part = matrices.members()[0].part
            groups, supports = _by_groups(part)
            fine = part.again(finer(replace(part.mesh, groups=groups)), supports)
            _divided[matrices] = holding(fine, start_time)
    return _divided[matrices]


def _by_groups(part: MeshedStructure) -> tuple[dict[str, dict[int, IntArray]], list[Support]]:
    """(groups, supports) with groups in place of numbers of nodes, which new nodes lack."""
    groups = {name: dict(entities) for name, entities in part.mesh.groups.items()}
    supports = []
    for k, support in enumerate(part.supports):
        if isinstance(support.where, NumberedNodes):
            name = f"numbered nodes {k}"
            groups[name] = support.where.entities(part.mesh)
            support = Support(name, support.fix)
        supports.append(support)
    return groups, supports


def lacking(stiffness: Array, flexibility: Array) -> tuple[Array, Array]:
    """(energies that the mesh lacks (k, k), those that it has in excess, negative) of its shapes.

    The latter come from few integration points, which make a mesh too flexible for some loads.

    stiffness : (k,) energies of the shapes on the mesh.
    flexibility : (k, k) energies and products of what their loads cause on the divided mesh.
    """
    size = np.sqrt(stiffness)
    inverse_size = np.divide(1.0, size, out=np.zeros_like(size), where=size > 0)
    relative = inverse_size[:, None] * (flexibility - np.diag(stiffness)) * inverse_size
    values, vectors = np.linalg.eigh((relative + relative.T) / 2)
    vectors = size[:, None] * vectors
    lack, surplus = (
        (vectors * part) @ vectors.T for part in (np.maximum(values, 0), np.minimum(values, 0))
    )
    return lack, surplus


# -- the divided mesh


def finer(mesh: Mesh) -> Mesh:
    """The mesh on one rank with each cell c divided into h cells with the input numbers h c to
    h c + h - 1.
    """
    return distributed(halved(_raw(mesh)), mesh.name, mesh.comm)


def _raw(mesh: Mesh) -> RawMesh:
    """The arrays of a mesh on one rank, with its cells by their input numbers."""
    pieces = gathered(mesh, np.zeros(mesh.n_cells))
    assert pieces is not None  # on one rank
    kind = next(k for k in KINDS.values() if (k.shape, k.order) == (mesh.cell, mesh.order))
    order = np.argsort(compat.node_order(kind.shape, kind.nodes, "vtk"))
    groups = {
        name: {dim: rows.astype(np.int64) for dim, rows in parts.items()}
        for name, parts in pieces.groups.items()
    }
    cells = pieces.cells[:, order].astype(np.int64)
    return RawMesh(pieces.points, cells, kind, groups)


def interpolation(part: MeshedStructure, fine: MeshedStructure) -> scipy.sparse.csr_matrix:
    """Interpolation matrix (fine rows, coarse rows) of displacements to the divided mesh."""
    places = _places_of_halves(part)
    input_number = np.asarray(fine.mesh.dolfinx.topology.original_cell_index)
    parent, half = np.divmod(input_number, len(places))
    blocks = []
    for path in part.form.components.values():
        tables = np.stack([compat.tabulate(part.form.space, path, X) for X in places])
        dofs = compat.cell_dofs(fine.form.space, path, np.arange(len(parent)))
        rows, first = np.unique(dofs.ravel(), return_index=True)
        cell, function = np.divmod(first, dofs.shape[1])
        columns = compat.cell_dofs(part.form.space, path, parent)[cell]
        fine_rows = np.repeat(rows[:, None], columns.shape[1], axis=1)
        blocks.append((tables[half[cell], function], fine_rows, columns))
    values, rows, columns = (np.concatenate([entry[k] for entry in blocks]) for k in range(3))
    shape = tuple(compat.local_size(entry.form.space) for entry in (fine, part))
    entries = values.ravel(), (rows.ravel(), columns.ravel())
    return scipy.sparse.csr_matrix(entries, shape=shape)


def _places_of_halves(part: MeshedStructure) -> Array:
    """Reference coordinates (halves, functions, dim) in a cell, of the nodes of its halves."""
    corners = part.mesh.geometry.corners
    shape = scheme(part.mesh.cell)
    lattice = np.vstack([corners, *(corners[vertices].mean(axis=0) for vertices in shape.members)])
    kind = getattr(basix.CellType, part.mesh.cell)
    linear, of_part = (
        basix.create_element(basix.ElementFamily.P, kind, degree, basix.LagrangeVariant.gll_warped)
        for degree in (1, part.form.degree)
    )
    weights = linear.tabulate(0, np.asarray(of_part.points))[0, :, :, 0]
    return np.asarray(weights @ lattice[shape.halves])
