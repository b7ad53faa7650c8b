"""Meshes with required sizes of cells: gmsh meshes a geometry again, others are halved.

Meshes of lines are made finer everywhere alike: they are small, and to estimate the error of each
cell would cost more than the cells that this saves.

If the size of a cell with error η² becomes s h, its error becomes s^(2p) η², and 1/s^d cells
replace it (p the order of the elements, d the dimension). Among all sizes with the same total error
those with s = λ (η²)^(-1/(q + d)), q = 2p, take the fewest cells (Ladevèze, Coffignal and Pelle,
1986). But the largest errors are those at inner edges, where q is that of the singularity, whatever
p is: 1.09 at a right angle (Williams, J. Appl. Mech. 19 (1952) 526). In space, where such edges
hold many cells, sizes for q = 1 leave 0.7 of the error on a stiffened panel with as many cells as
for q = 3, and the same error on parts without such edges. In the plane the singularities are
corners.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Sequence
from dataclasses import replace
from functools import cached_property
from math import exp
from pathlib import Path

import numpy as np
from mpi4py import MPI

from antiosc.base._types import Array
from antiosc.base.errors import InputError, MeshError
from antiosc.fem.mesh import Mesh, distributed
from antiosc.fem.mesh.finer import (
    KIND_OF,
    divisible,
    edge_lengths,
    gathered,
    graded_sizes,
    near,
    refined,
)
from antiosc.fem.mesh.reading import flattened, read_mesh
from antiosc.fem.mesh.soundness import sound
from antiosc.fem.mesh.surface import mean_thickness, measures
from antiosc.fem.platform import bounds, on_root, warn
from antiosc.io.by_gmsh import CUT, GEOMETRY, SizeField
from antiosc.io.isolation import GRADING as USUAL, Refinement
from antiosc.io.neutral import RawMesh
from antiosc.io.reading import read
from antiosc.reduce.error.division import finer

#: About the largest number of cells of the first mesh of a geometry.
MOST_FIRST = 6000
#: A size [m] above that of any part: gmsh then takes the coarsest mesh that the geometry allows.
ANY = 1e6
#: Growth and reach of the small sizes at the site in the first mesh of a geometry.
FIRST_GRADING = (0.5, 1.5)
#: Those in all further meshes, where they only keep the patch resolved.
GRADING = (0.7, 1.5)
#: Least number of lines on the longest diagonal of a part, as many as `advise` takes.
LINES = 8


class MeshSource(ABC):
    """Protocol: a source of finer and finer meshes of one part; `coarsest` is the first mesh."""

    #: why there is only one mesh; "" if there are more
    fixed = ""
    coarsest: Mesh

    def thickness(self) -> float:
        """Twice the volume over the surface [m]: the thickness of a thin wall."""
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
        """The mesh with smaller cells around points; MeshError if its cells stay as they are."""
        if self.fixed:
            raise MeshError(self.fixed)
        return self.finer(mesh, np.minimum(graded_sizes(mesh, refine) / edge_lengths(mesh), 1.0))


def source_of(source: str | Path | Mesh, order: int = 2) -> MeshSource:
    """The source for a file or a mesh; `order`: geometric order of the cells of a geometry."""
    if isinstance(source, Mesh):
        if source.tdim == 1:
            return OfLines(source)
        return OfMesh(source)
    path = Path(source)
    if path.suffix.lower() in GEOMETRY:
        geometry = OfGeometry(path, order)
        if geometry.coarsest.tdim == 1:
            return OfLines(geometry.coarsest, path)
        return geometry
    mesh = read_mesh(path)
    if mesh.tdim == 1:
        return OfLines(mesh)
    return OfMesh(mesh)


class OfMesh(MeshSource):
    """A mesh as source of meshes: straight simplices are bisected, other cells stay."""

    def __init__(self, mesh: Mesh) -> None:
        self.coarsest = mesh
        if not divisible(mesh):
            kind = f"{mesh.cell} cells" if mesh.order == 1 else f"curved {mesh.cell} cells"
            self.fixed = (
                f"{mesh.name} was used as it is: {kind} are not divided; give a geometry, or a "
                "mesh of straight triangles or tetrahedra."
            )

    def thickness(self) -> float:
        """Twice the volume over the surface [m]; for other cells than simplices the least
        extent.
        """
        if self.coarsest.cell in KIND_OF:
            return super().thickness()
        low, high = bounds(self.coarsest.comm, self.coarsest.dolfinx.geometry.x)
        return float(np.min((high - low)[: self.coarsest.gdim]))

    def first(self, size: float, refine: Sequence[Refinement]) -> Mesh:
        """The mesh itself, divided near the points."""
        return self.coarsest if self.fixed else near(self.coarsest, refine)

    def finer(self, mesh: Mesh, ratio: Array) -> Mesh:
        """The mesh with its cells divided."""
        return refined(mesh, ratio)


class OfGeometry(MeshSource):
    """A geometry as source, meshed by gmsh."""

    def __init__(self, path: Path, order: int) -> None:
        self._path = path
        self._order = order
        self._refine: Sequence[Refinement] = ()
        self._divided: OfMesh | None = None

    @cached_property
    def coarsest(self) -> Mesh:  # type: ignore[override]
        """The mesh of the largest cells that the geometry permits."""
        raw = self._read(None, 1, (), None, USUAL)
        for sentence in raw.remarks:
            warn(MPI.COMM_WORLD, sentence)
        return distributed(raw, self._path.name, MPI.COMM_WORLD)

    def first(self, size: float, refine: Sequence[Refinement]) -> Mesh:
        """A mesh with cells of about `size` [m], and some thousand cells at most."""
        coarse = self.coarsest
        self._refine = refine
        share = {2: 4 / 3**0.5, 3: 6 * 2**0.5}[coarse.tdim]
        coarsest_size = (share * measures(coarse)[0] / MOST_FIRST) ** (1 / coarse.tdim)
        size_field = wished_sizes(coarse, max(size, coarsest_size) / edge_lengths(coarse))
        try:
            return self._meshed(coarse, size_field, FIRST_GRADING)
        except InputError:
            self._divided = OfMesh(coarse)
            if self._divided.fixed:
                raise
            sentence = "is not meshed with cells of the sizes wanted: its coarse mesh is divided"
            warn(MPI.COMM_WORLD, f"{self._path.name} {sentence}, with flat faces.")
            return self._divided.first(size, refine)

    def finer(self, mesh: Mesh, ratio: Array) -> Mesh:
        """The geometry meshed again, with about Σ 1 / ratio^d cells.

        The patch stays resolved.
        """
        if self._divided is not None:
            return self._divided.finer(mesh, ratio)
        cell_goal = mesh.comm.allreduce(float(np.sum(ratio ** -float(mesh.tdim))))
        size_field = wished_sizes(mesh, ratio)
        if size_field is not None:
            sizes = np.array(size_field.sizes) * (size_field.expected() / cell_goal) ** (
                1 / mesh.tdim
            )
            size_field = replace(size_field, sizes=sizes.tolist())
        return self._meshed(mesh, size_field, GRADING)

    def _meshed(self, like: Mesh, wished: SizeField | None, grading: Sequence[float]) -> Mesh:
        raw = self._read(like.gdim, self._order, self._refine, wished, grading)
        for sentence in raw.remarks:
            if CUT in sentence:
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
        def checked(raw: RawMesh) -> RawMesh:
            return sound(flattened(raw, gdim, self._path.name), self._path.name, True)

        def work() -> RawMesh:
            return read(
                self._path, ANY, order, refine, sizes=wished, grading=grading, sound=checked
            )

        return on_root(MPI.COMM_WORLD, work)


class OfLines(MeshSource):
    """A mesh of lines as source, whose cells are halved, or a geometry of lines."""

    def __init__(self, mesh: Mesh, path: Path | None = None) -> None:
        self.coarsest = mesh
        self._path = path
        self._size = 0.0

    def thickness(self) -> float:
        """0: a line has no thickness."""
        return 0.0

    def first(self, size: float, refine: Sequence[Refinement]) -> Mesh:
        """At least `LINES` cells on the diagonal."""
        self._size = self.extent() / LINES
        return self._of_size(self.coarsest)

    def finer(self, mesh: Mesh, ratio: Array) -> Mesh:
        """All cells halved, as often as `ratio` requires, at least once."""
        smallest_ratio = mesh.comm.allreduce(float(np.min(ratio, initial=1.0)), MPI.MIN)
        self._size = largest(mesh) / 2 ** max(1, round(-np.log2(smallest_ratio)))
        return self._of_size(mesh)

    def _of_size(self, mesh: Mesh) -> Mesh:
        """A mesh with lines of at most the wanted size."""
        if self._path is not None:
            return read_mesh(self._path, size=self._size, order=1, comm=self.coarsest.comm)
        while largest(mesh) > (1 + 1e-9) * self._size:
            mesh = finer(mesh)
        return mesh


def largest(mesh: Mesh) -> float:
    """Length [m] of the longest line of a mesh."""
    return float(mesh.comm.allreduce(float(np.max(edge_lengths(mesh), initial=0.0)), MPI.MAX))


def wished_sizes(mesh: Mesh, ratio: Array) -> SizeField | None:
    """Size field on rank 0 for `ratio`: at each corner the smallest size of its cells; None
    elsewhere.

    A mean would lose the small sizes of single cells, such as those under a patch.
    """
    pieces = gathered(mesh, ratio * edge_lengths(mesh))
    if pieces is None:
        return None
    corners = pieces.cells[:, : mesh.tdim + 1]
    used_nodes, local = np.unique(corners, return_inverse=True)
    local = local.reshape(corners.shape)
    sizes = np.full(len(used_nodes), np.inf)
    np.minimum.at(sizes, local.ravel(), np.repeat(pieces.values, corners.shape[1]))
    x = np.zeros((len(used_nodes), 3))
    x[:, : mesh.gdim] = pieces.points[used_nodes]
    return SizeField(x.tolist(), local.tolist(), sizes.tolist())


#: Least ratio of sizes in one step.
FINEST = 0.15
#: Largest ratio of sizes in one step: coarse cells do not become much coarser, since their errors
#: would grow by more than expected.
COARSEST = 1.3
#: q by dimension: power of the size by which the energy of errors falls where it is largest.
POWER = {1: 4.0, 2: 2.0, 3: 1.0}
#: The search for log λ covers this range about the value for cells with the mean error.
WIDEST = 50.0


def ratios(comm: MPI.Comm, energies: Array, goal: float, order: int, dim: int) -> Array:
    """New size over old size of each cell of this rank (cells,).

    Parameters
    ----------
    energies : (cells,) errors η² of the cells of this rank.
    goal : required total error over the present one; not reached if it needs sizes below `FINEST`.
    order, dim : order of the elements, dimension of the mesh.
    """
    from scipy.optimize import brentq  # loaded where it is used: it takes long

    total, count = comm.allreduce(np.array([energies.sum(), float(len(energies))]))
    if total == 0:
        return np.ones(len(energies))
    share = np.maximum(energies / (total / count), np.finfo(float).tiny)
    optimal = share ** (-1 / (POWER[dim] + dim))

    def sizes(scale: float) -> Array:
        """Ratios of new to old cell sizes for the logarithm `scale` of λ (see the module)."""
        return np.asarray(np.clip(exp(scale) * optimal, FINEST, COARSEST))

    def error_excess(scale: float) -> float:
        total_error = float(np.sum(sizes(scale) ** (2 * order) * energies))
        return float(comm.allreduce(total_error)) / total - goal

    if error_excess(-WIDEST) >= 0:
        return sizes(-WIDEST)
    if error_excess(WIDEST) <= 0:
        return sizes(WIDEST)
    return sizes(brentq(error_excess, -WIDEST, WIDEST, xtol=1e-12, rtol=1e-14))


def growth(comm: MPI.Comm, ratio: Array, dim: int) -> float:
    """Ratio of the number of cells after a change of sizes by `ratio` to the present number."""
    n_new, n_old = comm.allreduce(np.array([np.sum(ratio ** -float(dim)), float(len(ratio))]))
    return float(n_new / n_old)
