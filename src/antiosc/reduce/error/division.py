"""Discretisation error of beams and sheets, from the same mesh with each cell divided.

These elements evaluate strains at their most accurate points, so that a recovery of strains would
find only a part of the error. Instead the loads of the shapes (the load at the site, and inertia
forces ω² M ψ with their reaction at the site) act on the divided mesh too. The difference of the
flexibilities, times 1/(1 - 4^-p), is the error of the mesh: the flexibility of beams of degree p
converges with the power 2p of the cell size; the flexibility of sheets converges with its square
(p = 1) if the loaded patch is smaller than the cells.

This module also makes meshes of required cell sizes: gmsh meshes a geometry again; cells of a given
mesh are bisected. Meshes of lines are refined uniformly: they are small, and estimating an error
for each cell would cost more than it saves.

If the size of a cell with error η² becomes s h, its error becomes s^(2p) η², and 1/s^d cells
replace it (p the order of the elements, d the dimension). Among all sizes with the same total
error, s = λ (η²)^(-1/(q + d)) with q = 2p takes the fewest cells (Ladevèze, Coffignal and Pelle,
1986). But the largest errors are at inner edges, where the singularity determines q: 1.09 at a
right angle (Williams, J. Appl. Mech. 19 (1952) 526). For solids, sizes with q = 1 leave 0.7 of the
error left by q = 3 on a stiffened panel, and the same error on parts without inner edges.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Sequence
from dataclasses import replace
from functools import cached_property, partial
from math import exp
from pathlib import Path
from weakref import WeakKeyDictionary

import basix
import numpy as np
import scipy.sparse
from mpi4py import MPI

from antiosc.base._types import Array
from antiosc.base.clock import clock
from antiosc.base.errors import InputError, MeshError, without_warnings
from antiosc.base.progress import doing
from antiosc.fem.linalg.algebra import multiply
from antiosc.fem.mesh import Mesh, distributed
from antiosc.fem.mesh.finer import (
    KIND_OF_SHAPE,
    divisible,
    edge_lengths,
    gathered,
    graded_sizes,
    halved,
    halving_scheme,
    refined,
    refined_near,
    weights_at,
)
from antiosc.fem.mesh.reading import flattened, read_mesh, sound
from antiosc.fem.mesh.surface import mean_thickness, volume_and_surface
from antiosc.fem.platform import bounds, compat, on_root, warn
from antiosc.fem.structure.meshed import MeshedStructure, PartsMatrices
from antiosc.fem.structure.structure import Structure, on_mesh, structure_with
from antiosc.fem.structure.support import NumberedNodes, Support
from antiosc.io.by_gmsh import CORNERS_CUT_PHRASE, GEOMETRY_ENDINGS, SizeField
from antiosc.io.isolation import SIZE_GRADING as USUAL_GRADING, Refinement
from antiosc.io.neutral import RawMesh
from antiosc.io.reading import read
from antiosc.models.anti_oscillators import AntiOscillators
from antiosc.models.body import site_points
from antiosc.reduce.extraction import elastic_response
from antiosc.reduce.site import functionals
from antiosc.reduce.site.site import Site

#: Share of the energies of shapes below which a surplus is rounding.
LEAST_SURPLUS = 1e-9
#: Structures that are divided already, with their factors, for further sites.
_divided: WeakKeyDictionary[object, Structure] = WeakKeyDictionary()
#: About the largest number of cells of the first mesh of a geometry.
MOST_FIRST_CELLS = 6000
#: A size [m] above that of any part: gmsh then takes the coarsest mesh that the geometry allows.
UNLIMITED_SIZE = 1e6
#: Growth and reach of the small sizes at the site in the first mesh of a geometry.
FIRST_GRADING = (0.5, 1.5)
#: Growth and reach in all further meshes, where small cells only keep the patch resolved.
LATER_GRADING = (0.7, 1.5)
#: Least number of lines on the longest diagonal of a part, as many as `advise` takes.
LEAST_LINES = 8


class Division:
    """Discretisation error of one part of beams or sheets, by its divided mesh; on one rank."""

    divided = True

    def __init__(self, matrices: PartsMatrices) -> None:
        if matrices.comm.size > 1:
            raise InputError("the error 'estimate' of beams and shells runs on one rank.")
        self._matrices = matrices

    def missed(self, model: AntiOscillators) -> tuple[Array, Array | None]:
        """(strain energies (p + N, p + N) [N/m] that the shapes lack, those in excess or None)."""
        fine, _motions, forces = self._shapes_and_loads(model)
        flexibility = forces.T @ elastic_response(fine, fine.factorize(forces.shape[1]), forces)
        lack, surplus = lacking_energies(model.stiffness, flexibility)

        struck = self._matrices.members()[0].part
        order = struck.form.degree if struck.mesh.tdim == 1 else 1
        remaining = 1 / (1 - 4.0**-order)
        is_rounding = np.abs(surplus).max() <= LEAST_SURPLUS * np.abs(flexibility).max()
        return remaining * lack, None if is_rounding else remaining * surplus

    def of_cells(self, model: AntiOscillators, weights: Array) -> Array:
        """Energy (cells,) of the errors of the shapes combined by `weights` (p + N, k)."""
        fine, motions, forces = self._shapes_and_loads(model)
        solver = fine.factorize(weights.shape[1])
        errors = elastic_response(fine, solver, forces @ weights) - motions @ weights
        part = on_mesh(fine)
        energies = compat.cell_energies(
            part.form.stiffness, part.form.space, errors, np.ones(errors.shape[1]), 4
        )
        parent = np.asarray(part.mesh.dolfinx.topology.original_cell_index) // 2**part.mesh.tdim
        coarse = self._matrices.members()[0].part.mesh.dolfinx.topology
        of_input = np.bincount(parent, np.maximum(energies, 0.0))
        return np.asarray(of_input[coarse.original_cell_index])

    def _shapes_and_loads(self, model: AntiOscillators) -> tuple[Structure, Array, Array]:
        """(divided structure, shapes of the model on it (rows, p + N), loads that cause them)."""
        fine = divided_structure(self._matrices)
        parts = self._matrices.members()[0].part, on_mesh(fine)
        motions = np.asarray(interpolation_matrix(*parts) @ np.asarray(model.shapes))

        # k0 at the sites, and inertia forces with their reactions
        p = model.n_sites
        load = np.hstack([site.B for site in functionals(fine.matrices, _sites_of(model))])
        load = load[:, model.info.get("independent", [0])]
        squares = np.square(model.omega)
        inertia = model.inertias / model.unit[p:]
        forces = np.empty_like(motions)
        forces[:, :p] = load @ model.k0_matrix
        forces[:, p:] = squares * (multiply(fine.M, motions[:, p:]) - load @ inertia)
        forces[fine.fixed] = 0.0
        return fine, motions, forces


def _sites_of(model: AntiOscillators) -> list[Site]:
    """Sites at the points of a model; InputError if a point or direction is not known."""
    points, columns = site_points(model), model.columns or {"": (0,)}
    if model.direction is None or set(points) != set(columns):
        raise InputError(
            "the error 'estimate' of beams and shells needs a Site with point and direction."
        )

    directions = np.atleast_2d(model.direction)
    radii = model.radius if model.sites else (model.radius,)

    return [
        Site(points[name], directions[i[0]], radius=radius, tangential=len(i) > 1)
        for (name, i), radius in zip(columns.items(), radii, strict=True)
    ]


def divided_structure(matrices: PartsMatrices) -> Structure:
    """The structure on a mesh with each cell divided; it is made once for each `matrices`."""
    if matrices not in _divided:
        start_time = clock()
        with without_warnings(), doing("a mesh of half the size, for the error bar"):
            part = matrices.members()[0].part
            groups, supports = dict(part.mesh.groups), list(part.supports)
            for k, support in enumerate(supports):
                if isinstance(support.where, NumberedNodes):  # new nodes have no numbers
                    name = f"numbered nodes {k}"
                    groups[name] = support.where.entities(part.mesh)
                    supports[k] = Support(name, support.fix)
            fine = part.reassembled(divided_mesh(replace(part.mesh, groups=groups)), supports)
            _divided[matrices] = structure_with(fine, start_time)

    return _divided[matrices]


def lacking_energies(stiffness: Array, flexibility: Array) -> tuple[Array, Array]:
    """(positive, negative) parts (k, k) of `flexibility` - `stiffness`: energies of the shapes'
    loads on the divided mesh minus energies of the shapes. The second is not 0 if reduced
    integration makes elements too soft."""
    size = np.sqrt(stiffness.diagonal())
    inverse_size = np.divide(1.0, size, out=np.zeros_like(size), where=size > 0)
    relative = inverse_size[:, None] * (flexibility - stiffness) * inverse_size
    values, vectors = np.linalg.eigh((relative + relative.T) / 2)
    vectors = size[:, None] * vectors
    lack = (vectors * np.maximum(values, 0)) @ vectors.T
    surplus = (vectors * np.minimum(values, 0)) @ vectors.T

    return lack, surplus


# -- the divided mesh


def divided_mesh(mesh: Mesh) -> Mesh:
    """The mesh on one rank with each input cell c divided into h cells, h c to h c + h - 1."""
    whole = gathered(mesh, np.zeros(mesh.n_cells))
    assert whole is not None  # on one rank
    return distributed(halved(whole[0]), mesh.name, mesh.comm)


def interpolation_matrix(part: MeshedStructure, fine: MeshedStructure) -> scipy.sparse.csr_matrix:
    """Matrix (rows of `fine`, rows of `part`) that interpolates displacements of `part`."""
    corners = part.mesh.geometry.corners
    scheme = halving_scheme(part.mesh.cell)
    lattice = np.vstack([corners, *(corners[vertices].mean(axis=0) for vertices in scheme.members)])
    kind, family = getattr(basix.CellType, part.mesh.cell), basix.ElementFamily.P
    variant = basix.LagrangeVariant.gll_warped
    nodes = np.asarray(basix.create_element(family, kind, part.form.degree, variant).points)

    # reference coordinates (h, functions, dim) of the nodes of the h cells that divide a cell
    places = weights_at(part.mesh.cell, 1, nodes) @ lattice[scheme.halves]
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


class MeshSource(ABC):
    """Protocol of a source of ever finer meshes of one part; `coarsest` is the first mesh."""

    #: why there is only one mesh; "" if there are more
    fixed = ""
    coarsest: Mesh

    def thickness(self) -> float:
        """Twice the volume divided by the surface [m]: the thickness of a thin wall."""
        return mean_thickness(self.coarsest)

    def extent(self) -> float:
        """Diagonal of the box around the part [m]."""
        return self.coarsest.extent()

    @abstractmethod
    def first(self, size: float, refine: Sequence[Refinement]) -> Mesh:
        """A coarse mesh with elements of at most `size` [m], smaller at the points of `refine`."""

    @abstractmethod
    def finer(self, mesh: Mesh, ratio: Array) -> Mesh:
        """A mesh whose cell sizes are about `ratio` (cells of this rank) times those of `mesh`."""

    def around(self, mesh: Mesh, refine: Sequence[Refinement]) -> Mesh:
        """The mesh with smaller cells near points; MeshError if its cells cannot be divided."""
        if self.fixed:
            raise MeshError(self.fixed)
        return self.finer(mesh, np.minimum(graded_sizes(mesh, refine) / edge_lengths(mesh), 1.0))


def mesh_source(source: str | Path | Mesh, order: int = 2) -> MeshSource:
    """The source of meshes for a file or a mesh; `order`: order of the cells of a geometry."""
    path = None if isinstance(source, Mesh) else Path(source)
    if path is not None and path.suffix.lower() in GEOMETRY_ENDINGS:
        geometry = GeometryMeshes(path, order)
        if geometry.coarsest.tdim == 1:
            return LineMeshes(geometry.coarsest, path)
        return geometry

    mesh = source if isinstance(source, Mesh) else read_mesh(Path(source))
    return LineMeshes(mesh) if mesh.tdim == 1 else GivenMesh(mesh)


class GivenMesh(MeshSource):
    """A finished mesh: straight simplices are bisected; a mesh of other cells is not refined."""

    def __init__(self, mesh: Mesh) -> None:
        self.coarsest = mesh
        if not divisible(mesh):
            kind = f"{mesh.cell} cells" if mesh.order == 1 else f"curved {mesh.cell} cells"
            self.fixed = (
                f"{mesh.name} was used as it is: {kind} are not divided; give a geometry, or a "
                "mesh of straight triangles or tetrahedra."
            )

    def thickness(self) -> float:
        """Twice the volume over the surface [m]; the least extent if cells are not simplices."""
        if self.coarsest.cell in KIND_OF_SHAPE:
            return super().thickness()
        low, high = bounds(self.coarsest.comm, self.coarsest.dolfinx.geometry.x)
        return float(np.min((high - low)[: self.coarsest.gdim]))

    def first(self, size: float, refine: Sequence[Refinement]) -> Mesh:
        """The given mesh, divided near the points of `refine`."""
        return self.coarsest if self.fixed else refined_near(self.coarsest, refine)

    def finer(self, mesh: Mesh, ratio: Array) -> Mesh:
        """The mesh with cells bisected where `ratio` (required over present size) requires it."""
        return refined(mesh, ratio)


class GeometryMeshes(MeshSource):
    """A geometry that gmsh meshes again for each request."""

    def __init__(self, path: Path, order: int) -> None:
        self._path = path
        self._order = order
        self._refine: Sequence[Refinement] = ()

    @cached_property
    def coarsest(self) -> Mesh:  # type: ignore[override]
        """The mesh of the largest cells that the geometry permits."""
        raw = self._read(None, 1, (), None, USUAL_GRADING)
        for sentence in raw.remarks:
            warn(MPI.COMM_WORLD, sentence)
        return distributed(raw, self._path.name, MPI.COMM_WORLD)

    def first(self, size: float, refine: Sequence[Refinement]) -> Mesh:
        """A mesh with cells of about `size` [m], but at most some thousand cells."""
        coarse = self.coarsest
        self._refine = refine
        share = {2: 4 / 3**0.5, 3: 6 * 2**0.5}[coarse.tdim]
        of_cell = share * volume_and_surface(coarse)[0] / MOST_FIRST_CELLS
        coarsest_size = of_cell ** (1 / coarse.tdim)
        size_field = wished_sizes(coarse, max(size, coarsest_size) / edge_lengths(coarse))

        return self._meshed(coarse, size_field, FIRST_GRADING)

    def finer(self, mesh: Mesh, ratio: Array) -> Mesh:
        """The geometry meshed again in about Σ 1 / ratio^dim cells; patches keep small cells."""
        cell_goal = mesh.comm.allreduce(float(np.sum(ratio ** -float(mesh.tdim))))
        size_field = wished_sizes(mesh, ratio)
        if size_field is not None:
            growth = (size_field.expected() / cell_goal) ** (1 / mesh.tdim)
            sizes = np.array(size_field.sizes) * growth
            size_field = replace(size_field, sizes=sizes.tolist())

        return self._meshed(mesh, size_field, LATER_GRADING)

    def _meshed(self, like: Mesh, wished: SizeField | None, grading: Sequence[float]) -> Mesh:
        """A mesh of the dimension of `like` with the sizes `wished`, which grow by `grading`."""
        raw = self._read(like.gdim, self._order, self._refine, wished, grading)
        for sentence in raw.remarks:
            if CORNERS_CUT_PHRASE in sentence:
                warn(MPI.COMM_WORLD, sentence)
        return distributed(raw, self._path.name, MPI.COMM_WORLD)

    def _read(
        self,
        gdim: int | None,
        order: int,
        refine: Sequence[Refinement],
        wished: SizeField | None,
        grading: Sequence[float],
    ) -> RawMesh:
        """The geometry as gmsh meshes it for these sizes, on rank 0, as arrays."""

        def checked(raw: RawMesh) -> RawMesh:
            return sound(flattened(raw, gdim, self._path.name), self._path.name, True)

        def work() -> RawMesh:
            graded = partial(read, sizes=wished, grading=grading, sound=checked)
            return graded(self._path, UNLIMITED_SIZE, order, refine)

        return on_root(MPI.COMM_WORLD, work)


class LineMeshes(MeshSource):
    """A mesh of lines, which are all halved, or a geometry of lines, which is meshed again."""

    def __init__(self, mesh: Mesh, path: Path | None = None) -> None:
        self.coarsest = mesh
        self._path = path
        self._size = 0.0

    def thickness(self) -> float:
        """0: a line has no thickness."""
        return 0.0

    def first(self, size: float, refine: Sequence[Refinement]) -> Mesh:
        """A mesh with at least `LEAST_LINES` cells along the diagonal of the part."""
        self._size = self.extent() / LEAST_LINES
        return self._of_size(self.coarsest)

    def finer(self, mesh: Mesh, ratio: Array) -> Mesh:
        """The mesh with all cells halved as often as `ratio` requires, at least once."""
        smallest_ratio = mesh.comm.allreduce(float(np.min(ratio, initial=1.0)), MPI.MIN)
        self._size = longest_line(mesh) / 2 ** max(1, round(-np.log2(smallest_ratio)))
        return self._of_size(mesh)

    def _of_size(self, mesh: Mesh) -> Mesh:
        """The mesh with lines of at most `_size`: the geometry meshed again, or lines halved."""
        if self._path is not None:
            return read_mesh(self._path, size=self._size, order=1, comm=self.coarsest.comm)
        while longest_line(mesh) > (1 + 1e-9) * self._size:
            mesh = divided_mesh(mesh)
        return mesh


def longest_line(mesh: Mesh) -> float:
    """Length [m] of the longest line of a mesh."""
    return float(mesh.comm.allreduce(float(np.max(edge_lengths(mesh), initial=0.0)), MPI.MAX))


def wished_sizes(mesh: Mesh, ratio: Array) -> SizeField | None:
    """Field of sizes `ratio` × present cell size, at shared corners the least; None off rank 0."""
    whole = gathered(mesh, ratio * edge_lengths(mesh))
    if whole is None:
        return None
    raw, wished = whole
    corners = raw.cells[:, : mesh.tdim + 1]
    used_nodes, local = np.unique(corners, return_inverse=True)
    local = local.reshape(corners.shape)
    sizes = np.full(len(used_nodes), np.inf)
    np.minimum.at(sizes, local.ravel(), np.repeat(wished, corners.shape[1]))
    x = np.zeros((len(used_nodes), 3))
    x[:, : mesh.gdim] = raw.points[used_nodes]
    return SizeField(x.tolist(), local.tolist(), sizes.tolist())


#: Least ratio of sizes in one step.
LEAST_SIZE_RATIO = 0.15
#: Largest ratio of sizes in one step: errors of much coarser cells grow by more than expected.
LARGEST_SIZE_RATIO = 1.3
#: q by dimension: power of the size by which the energy of errors falls where it is largest.
ERROR_POWER = {1: 4.0, 2: 2.0, 3: 1.0}
#: The search for log λ covers this range about the value for cells with the mean error.
SEARCH_RANGE = 50.0


def size_ratios(comm: MPI.Comm, energies: Array, goal: float, order: int, dim: int) -> Array:
    """Ratios of new to old size, >= `LEAST_SIZE_RATIO`, of this rank's cells with errors η²
    `energies` (cells,). `goal`: required over present error sum; `order`, `dim`: of the mesh."""
    from scipy.optimize import brentq  # loaded where it is used: it takes long

    total, count = comm.allreduce(np.array([energies.sum(), float(len(energies))]))
    if total == 0:
        return np.ones(len(energies))
    share = np.maximum(energies / (total / count), np.finfo(float).tiny)
    optimal = share ** (-1 / (ERROR_POWER[dim] + dim))

    def sizes(scale: float) -> Array:
        """Ratios of new to old cell sizes: exp(`scale`) times the optimal ones, within limits."""
        return np.asarray(np.clip(exp(scale) * optimal, LEAST_SIZE_RATIO, LARGEST_SIZE_RATIO))

    def error_excess(scale: float) -> float:
        """Total error with the ratios `sizes(scale)` over the present one, minus `goal`."""
        total_error = float(np.sum(sizes(scale) ** (2 * order) * energies))
        return float(comm.allreduce(total_error)) / total - goal

    if error_excess(-SEARCH_RANGE) >= 0:
        return sizes(-SEARCH_RANGE)
    if error_excess(SEARCH_RANGE) <= 0:
        return sizes(SEARCH_RANGE)
    return sizes(brentq(error_excess, -SEARCH_RANGE, SEARCH_RANGE, xtol=1e-12, rtol=1e-14))


def cell_growth(comm: MPI.Comm, ratio: Array, dim: int) -> float:
    """Factor by which the number of cells grows if cell sizes change by `ratio` (cells,)."""
    n_new, n_old = comm.allreduce(np.array([np.sum(ratio ** -float(dim)), float(len(ratio))]))
    return float(n_new / n_old)
