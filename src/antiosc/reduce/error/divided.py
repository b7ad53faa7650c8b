"""Errors of shells of quadrilaterals, and of decks of several families, by the same mesh with each
cell divided.

The strains of quadrilaterals are most accurate at the points where the element takes them, so that
a recovery of strains finds a half to a fifth of their error. Instead the loads of the shapes (the
site's load, and inertia forces ω² M ψ with their reaction at the site) act on the divided mesh too,
which has all displacements of the mesh, and the same masses. The difference of the flexibilities,
times 4/3, is the error of the mesh: where a patch smaller than the cells is loaded, they converge
with the square of the size of the cells. Of 44 random shells (thickness 0.05 to 6 % of the length,
plates, skew ones, folds, curved panels and tubes) the impact on a mesh of up to an eighth of the
size differed by 0.6 to 1.4 times the estimate, and by 1.7 times on a tube that locks, 89 % too
stiff: the factors of solids hold.

A deck whose parts share nodes (triangles among quadrilaterals, beams on sheets) is read again with
halved elements: its joints follow the numbers of the nodes.
"""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Sequence
from dataclasses import replace
from typing import TYPE_CHECKING, cast
from weakref import WeakKeyDictionary

import basix
import numpy as np
import scipy.sparse
from mpi4py import MPI

from antiosc.base import process
from antiosc.base._types import Array, IntArray
from antiosc.base.clock import clock
from antiosc.base.errors import InputError, without_warnings
from antiosc.base.progress import doing
from antiosc.fem.assembly import with_parts
from antiosc.fem.linalg.algebra import dot, multiply
from antiosc.fem.linalg.forecast import OF_SHELLS, of_sheet
from antiosc.fem.mesh import Mesh, distributed
from antiosc.fem.mesh.halving import halved, scheme
from antiosc.fem.mesh.thirds import with_cells_near
from antiosc.fem.platform import compat
from antiosc.fem.structure.meshed import MeshedStructure
from antiosc.fem.structure.structure import Structure, holding, on_mesh
from antiosc.fem.structure.support import NumberedNodes, Support
from antiosc.io.neutral import KINDS, RawMesh
from antiosc.io.request import Refinement
from antiosc.models.anti_oscillators import AntiOscillators
from antiosc.reduce.error.bisection import gathered
from antiosc.reduce.error.scheme import Estimate, MeshErrors, loads_of_shapes, shapes_of
from antiosc.reduce.site import Functional, Site, functional

if TYPE_CHECKING:
    from antiosc.fem.assembly.assembled import AssembledMatrices

#: Number of cells for each cell, and the dofs of the divided mesh over those of the mesh.
CELLS = 4
#: The error over the difference of the flexibilities, which converge with the size squared.
REMAINING = 1 / (1 - 1 / 4)
#: The order of nodes in which cells are passed on.
CONVENTION = "gmsh"
#: Corrections of a solve with K + sM to one with K: each leaves a tenth of the error, of the lowest
#: mode alone.
CORRECTIONS = 3
#: Most dofs of a divided mesh: 767 000 took 50 s of one core.
MOST_DOFS = 800_000
#: Anti-oscillators for which the memory of the divided mesh is foreseen, and bytes of their
#: motions, forces and answers for each of its dofs: 309 000 dofs took 4.5 GB, 767 000 some 12 GB.
FORESEEN, EACH_ANSWER = 150, 52.0
#: What is computed, for who waits.
WORDS = "a mesh of half the size, for the error bar"
#: Parts and decks that are divided already, for further sites.
_DIVIDED: WeakKeyDictionary[MeshedStructure | AssembledMatrices, Structure] = WeakKeyDictionary()


def refuse_ranks(comm: MPI.Comm) -> None:
    """InputError for a structure on several ranks."""
    if comm.size > 1:
        raise InputError("the error 'estimate' of shells runs on one rank.")


def divides(part: MeshedStructure) -> bool:
    """Whether the mesh's error of a part is found by dividing its cells."""
    return bool(part.kind.sheet) and part.mesh.cell == "quadrilateral"


def too_large(dofs: float, name: str) -> str:
    """Why a mesh of these dofs is not divided; "" if it can be."""
    finer = CELLS * dofs
    need = (OF_SHELLS + EACH_ANSWER * FORESEEN) * finer + of_sheet(round(finer), 0)
    remedy = "compare with a mesh of larger cells"
    if finer > MOST_DOFS:
        return (
            f"it takes {name} with each cell divided into four, and {finer:.0f} dofs are more than"
            f" {MOST_DOFS}: {remedy}."
        )
    free = process.free_memory()
    if need > process.MEMORY_SHARE * free:
        what = f"{name} with each cell divided into four, which it takes,"
        return f"{process.shortage(what, need, free)}: {remedy}."
    return ""


class Divided(MeshErrors):
    """Estimator by a structure with each cell divided, on one rank."""

    def prepare(self) -> None:
        """Nothing: all is of a site."""

    @abstractmethod
    def divided(self) -> Structure:
        """The structure with each cell divided."""

    @abstractmethod
    def on_divided(self, shapes: Array) -> Array:
        """Shapes (rows, k) as displacements of the divided structure."""

    def estimate(self, structure: Structure, model: AntiOscillators, site: Functional) -> Estimate:
        if site.point is None or site.direction is None:
            raise InputError(
                "the error 'estimate' of these shells needs a Site with a point and a direction."
            )
        fine = self.divided()
        point, direction = site.point.tolist(), site.direction.tolist()
        place = Site(point, direction, radius=site.radius, part=site.part)
        load = functional(fine, place).b[:, None]
        motions = self.on_divided(shapes_of(model))
        forces = loads_of_shapes(fine, model, motions, load)
        forces[fine.fixed] = 0.0
        flexibility = forces.T @ answers(fine, forces)
        lack, surplus = lacking(np.append(model.k0, model.k), flexibility)
        return Estimate(REMAINING * lack, REMAINING * surplus, {"divided": True})


class DividedShells(Divided):
    """Estimator for shells of quadrilaterals."""

    def __init__(self, part: MeshedStructure) -> None:
        refuse_ranks(part.comm)
        self._part = part

    def divided(self) -> Structure:
        return divided(self._part)

    def on_divided(self, shapes: Array) -> Array:
        return np.asarray(interpolation(self._part, on_mesh(self.divided())) @ shapes)


class DividedDeck(Divided):
    """Estimator for an assembly of the parts of a deck whose elements can be halved."""

    def __init__(self, matrices: AssembledMatrices) -> None:
        refuse_ranks(matrices.comm)
        self._matrices = matrices

    def divided(self) -> Structure:
        if self._matrices not in _DIVIDED:
            assert self._matrices.halved is not None
            with without_warnings(), doing(WORDS):
                _DIVIDED[self._matrices] = self._matrices.halved()
        return _DIVIDED[self._matrices]

    def on_divided(self, shapes: Array) -> Array:
        fine = cast("AssembledMatrices", self.divided().matrices)
        u = np.zeros((fine.layout.count, shapes.shape[1]))
        for member, motion in self._matrices.fields(shapes):
            (finer_member,) = fine.members(member.name)
            cells = np.argsort(member.part.mesh.dolfinx.topology.original_cell_index)
            u[finer_member.rows] = interpolation(member.part, finer_member.part, cells) @ motion
        for name in fine.layout.points:
            rows = self._matrices.layout.of_point(name)
            u[fine.layout.of_point(name)] = self._matrices.expanded(shapes)[rows]
        u[fine.eliminated.dependent] = 0.0
        return u


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


def divided(part: MeshedStructure) -> Structure:
    """The part with each cell divided; it is kept, with its factor, for further sites."""
    if part not in _DIVIDED:
        start_time = clock()
        groups, supports = _by_groups(part)
        with without_warnings(), doing(WORDS):
            fine = part.again(finer(replace(part.mesh, groups=groups)), supports)
        _DIVIDED[part] = holding(fine, start_time)
    return _DIVIDED[part]


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


def finer(mesh: Mesh) -> Mesh:
    """The mesh on one rank with each cell c divided, into those with the input numbers 4c to
    4c + 3.
    """
    return distributed(halved([_raw(mesh)])[0], mesh.name, mesh.comm)


def _raw(mesh: Mesh) -> RawMesh:
    """The arrays of a mesh on one rank, with its cells by their input numbers."""
    pieces = gathered(mesh, np.zeros(mesh.n_cells))
    assert pieces is not None  # on one rank
    kind = next(k for k in KINDS.values() if (k.shape, k.order) == (mesh.cell, mesh.order))
    order = np.argsort(compat.node_order(kind.shape, kind.nodes, CONVENTION))
    groups = {
        name: {dim: rows.astype(np.int64) for dim, rows in parts.items()}
        for name, parts in pieces.groups.items()
    }
    return RawMesh(
        pieces.points,
        pieces.cells[:, order].astype(np.int64),
        kind,
        CONVENTION,
        groups,
        numbers=np.arange(len(pieces.points)),
    )


def added_cells(structure: Structure, refine: Sequence[Refinement]) -> int:
    """Number of cells by which those of the sheets and lines of a structure, on one rank, become
    more with `refine`.
    """
    count = 0
    for member in with_parts(structure).members():
        raw = _raw(replace(member.part.mesh, groups={}))
        count += len(with_cells_near(refine, [raw], raw.kind.shape)[0].cells) - len(raw.cells)
    return count


def interpolation(
    part: MeshedStructure, fine: MeshedStructure, cells: IntArray | None = None
) -> scipy.sparse.csr_matrix:
    """Interpolation matrix (fine rows, coarse rows) of displacements to the divided mesh.

    cells : the cell whose halves have the input numbers c k to c k + c - 1; by default k.
    """
    places = _places_of_halves(part)
    input_number = np.asarray(fine.mesh.dolfinx.topology.original_cell_index)
    parent, half = np.divmod(input_number, len(places))
    if cells is not None:
        parent = cells[parent]
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
    """Reference coordinates (halves, functions, 2) in a cell, of the nodes of its halves."""
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


def answers(structure: Structure, forces: Array) -> Array:
    """Displacements (rows, k) under self-equilibrated forces (rows, k), orthogonal to the rigid
    motions.
    """
    solver = structure.factorize(forces.shape[1])
    result = solver.solve_block(forces)
    rigid = structure.rigid_modes
    loads = multiply(structure.M, rigid)
    for _ in range(CORRECTIONS if rigid.shape[1] else 0):
        result -= rigid @ dot(structure.comm, loads, result)
        result = solver.solve_block(forces + structure.shift * multiply(structure.M, result))
    return np.asarray(result - rigid @ dot(structure.comm, loads, result))
