"""Errors of the strains of solids, by recovery.

The strain of each shape is projected (L2, consistent mass matrix) to continuous functions of degree
one, separately on the cells of each stiffness (material and thickness), across which strains jump.
The difference of the recovered and the discontinuous strain estimates the error (Zienkiewicz, Zhu,
Int. J. Numer. Meth. Engng 24 (1987) 337). Its energies and products for all shapes of a model are
the matrix by which the model is softened (`antiosc.models.parameters`).

The mass matrix of degree one is consistent, and is solved by conjugate gradients: with its diagonal
as the preconditioner its condition number is at most (d + 2) on simplices and 3^d on products of
intervals, whatever the mesh (Wathen, IMA J. Numer. Anal. 7 (1987) 449). No form is compiled.
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
import scipy.sparse

from antiosc.base._types import Array, IntArray
from antiosc.base.errors import AccuracyWarning, InputError, NotConvergedError
from antiosc.fem.elements.weak_form import Material, WeakForm
from antiosc.fem.linalg.algebra import conjugate_gradients
from antiosc.fem.mesh import Mesh
from antiosc.fem.platform import compat, warn
from antiosc.fem.structure.meshed import MeshedStructure
from antiosc.fem.structure.structure import Structure
from antiosc.models.anti_oscillators import AntiOscillators
from antiosc.models.body import FacetGaps
from antiosc.reduce.error.facets import faceted, layers
from antiosc.reduce.error.patch import patch_of
from antiosc.reduce.error.scheme import Estimate, StrainErrors, shapes_of
from antiosc.reduce.site import Functional

#: Quadrature degree of all integrals of strains, and of elements of degree two on products of
#: intervals: their strains hold terms of degree two in one direction, which are errors too and
#: vanish at the points of the lower rule (effectivities of 0.2 to 0.5 in place of 0.6 to 1.2).
RULE_DEGREE = 2
PRODUCT_DEGREE = 4
#: Numbers in a block of arrays in memory at once (2 MB), which stay in a cache.
BLOCK_NUMBERS = 250_000
#: Most blocks.
MOST_BLOCKS = 32
#: Places of the strains (ε11, ε22, ε33, γ23, γ13, γ12), or in the plane (ε11, ε22, γ12).
STRAIN_PLACES = {2: [(0, 0), (1, 1), (0, 1)], 3: [(0, 0), (1, 1), (2, 2), (1, 2), (0, 2), (0, 1)]}


class Quadrature:
    """Points and weights of a quadrature of the cells of a mesh, in slices of cells.

    Attributes
    ----------
    X : (points, tdim) reference coordinates.
    inverse : dX/dx (cells, points or 1, tdim, gdim); one serves all points of a cell with a linear
        map.
    weights : (cells, points), volumes included.
    """

    def __init__(self, mesh: Mesh, numbers_per_point: int, degree: int) -> None:
        self.mesh = mesh
        self.X, weights = compat.quadrature(mesh.cell, degree)
        slopes = mesh.geometry.slopes(self.X)
        owned_cells = compat.cell_map(mesh.dolfinx).size_local
        nodes = mesh.geometry.nodes[:owned_cells, :, : mesh.gdim]
        if mesh.geometry.affine:
            slopes = slopes[:1]
        self.inverse, volume = inverted(np.swapaxes(nodes, 1, 2)[:, None] @ slopes)
        self.weights = np.abs(volume) * weights
        self._width = max(1, BLOCK_NUMBERS // (numbers_per_point * len(self.X)))

    def slices(self, cells: IntArray) -> Iterator[slice]:
        """Slices of `cells` that are processed in one block."""
        width = max(self._width, -(-len(cells) // MOST_BLOCKS))
        return (slice(k, min(k + width, len(cells))) for k in range(0, len(cells), width))


def inverted(J: Array) -> tuple[Array, Array]:
    """(inverses, determinants) of matrices (…, d, d) of d = 2 or 3, by their minors."""
    if J.shape[-1] == 2:
        a = J[..., 0, 0]
        b = J[..., 0, 1]
        c = J[..., 1, 0]
        d = J[..., 1, 1]
        minors = np.stack([np.stack([d, -b], axis=-1), np.stack([-c, a], axis=-1)], axis=-2)
        volume = a * d - b * c
    else:
        u, v, w = (J[..., k] for k in range(3))
        minors = np.stack([np.cross(v, w), np.cross(w, u), np.cross(u, v)], axis=-2)
        volume = np.einsum("...i,...i->...", u, minors[..., 0, :])
    return minors / volume[..., None, None], volume


class CellStrains:
    """Evaluates strains of blocks of shapes (rows of this rank, k) of a solid."""

    def __init__(self, mesh: Mesh, form: WeakForm, shapes: Array) -> None:
        self.mesh = mesh
        self._space = form.space
        self.count = shapes.shape[1]
        self.components = len(STRAIN_PLACES[mesh.gdim])
        self._values = compat.with_ghosts(form.space, shapes)
        self._paths = list(form.components.values())
        quadratic = form.degree > 1
        degree = PRODUCT_DEGREE if quadratic and not mesh.geometry.simplex else RULE_DEGREE
        self.quadrature = Quadrature(mesh, self.count * mesh.gdim**2, degree)
        self._slopes = compat.tabulate_slopes(form.space, self._paths[0], self.quadrature.X)

    def at(self, cells: IntArray) -> tuple[Array, Array]:
        """(strains (components, points, k), weights (points,)) at all points of the cells, which
        are owned."""
        dim = self.mesh.gdim
        inverse = self.quadrature.inverse[cells]
        # derivatives of the functions along x (cells, points · gdim, functions)
        slopes = np.swapaxes(inverse, -1, -2) @ np.swapaxes(self._slopes, -1, -2)
        count, points, _, functions = slopes.shape
        slopes = slopes.reshape(count, points * dim, functions)
        gradients = []
        for path in self._paths:
            values = self._values[compat.cell_dofs(self._space, path, cells)]
            gradients.append((slopes @ values).reshape(count * points, dim, self.count))
        strains = np.empty((self.components, count * points, self.count))
        for k, (i, j) in enumerate(STRAIN_PLACES[dim]):
            strains[k] = gradients[i][:, j]
            if i != j:
                strains[k] += gradients[j][:, i]
        return strains, self.quadrature.weights[cells].ravel()


#: Relative residual at which the solve ends (the energies lose the square of it).
CG_RESIDUAL = 1e-5
#: Most steps of the solve.
CG_STEPS = 200


class Projection:
    """L2 projection onto continuous linear functions on owned `cells` of a mesh."""

    def __init__(self, quadrature: Quadrature, cells: IntArray) -> None:
        mesh = quadrature.mesh
        self._comm = mesh.comm
        self._space = compat.lagrange(mesh.dolfinx, 1, 0)
        # values of the functions at the points (points, corners)
        table = compat.tabulate(self._space, (), quadrature.X)
        index_map = self._space.dofmap.index_map
        #: corners of this rank, ghosts included
        self.size = int(index_map.size_local + index_map.num_ghosts)
        corners = compat.cell_dofs(self._space, (0,), cells)
        self._points = len(quadrature.X)
        self._count = corners.shape[1]
        weight = quadrature.weights[cells]
        # rows of matrices are points: the functions there, and those times the points' weights
        self._columns = np.repeat(corners[:, None], self._points, axis=1).reshape(-1, self._count)
        self._values = np.tile(table, (len(cells), 1))
        self._weighted = self._values * weight.reshape(-1, 1)
        all_cells = slice(0, len(cells))
        self._mass = self._at(self._weighted, all_cells).T.tocsr() @ self._at(
            self._values, all_cells
        )
        mass = compat.ghosts_added(self._space, self._mass.diagonal()[:, None])[:, 0]
        # corners of other cells have no function here
        self._inverse = np.divide(1.0, mass, out=np.zeros_like(mass), where=mass > 0)[:, None]

    def _at(self, numbers: Array, block: slice) -> scipy.sparse.csr_matrix:
        """Sparse matrix from values at corners to values at the quadrature points of the cells
        `block`.
        """
        rows = slice(block.start * self._points, block.stop * self._points)
        data = numbers[rows]
        columns = self._columns[rows]
        starts = np.arange(len(data) + 1) * self._count
        csr_arrays = data.ravel(), columns.ravel(), starts
        return scipy.sparse.csr_matrix(csr_arrays, shape=(len(data), self.size))

    def add_loads(self, loads: Array, block: slice, fields: Array) -> None:
        """Add ∫ f φ over the cells `block` to loads (corners, m, k).

        `fields` (m, points, k): values of f at all points of the cells.
        """
        gather = self._at(self._weighted, block).T
        for k, field in enumerate(fields):
            loads[:, k] += gather @ field

    def owned(self, loads: Array) -> Array:
        """Loads (rows, fields) at the corners of this rank, with the contributions of other
        ranks.
        """
        return compat.ghosts_added(self._space, loads)

    def solve(self, loads: Array) -> Array:
        """Corner values (rows, fields) on this rank for loads (rows, fields)."""
        start = self._dot(loads, self._inverse * loads)
        for x, residuals, _ in conjugate_gradients(
            loads, self._product, lambda r: self._inverse * r, self._dot, CG_STEPS
        ):
            if np.all(residuals <= CG_RESIDUAL**2 * start):
                return x
        raise NotConvergedError(
            f"the recovery of strains did not converge in {CG_STEPS} steps: the mesh has cells "
            "of nearly no volume; mesh the part anew, or leave the error out."
        )

    def at_points(self, block: slice, values: Array) -> Array:
        """Values (points, fields) at the points of some cells, from corner values with ghosts."""
        return np.asarray(self._at(self._values, block) @ values)

    def within(self, cells: IntArray, X: Array, values: Array) -> Array:
        """Values (n, fields) at reference points X (n, tdim) of cells (n,), from values with
        ghosts.
        """
        if not len(cells):
            return np.zeros((0, values.shape[1]))
        table = compat.tabulate(self._space, (), X)
        cell_dofs = compat.cell_dofs(self._space, (0,), cells)
        return np.asarray(np.einsum("na,naf->nf", table, values[cell_dofs]))

    def with_ghosts(self, values: Array) -> Array:
        """Corner values of this rank extended to its ghosts."""
        return compat.with_ghosts(self._space, values)

    def residual(self, loads: Array, x: Array) -> Array:
        """Loads minus the mass matrix times corner values x: (rows, fields)."""
        return np.asarray(loads - self._product(x))

    def _product(self, x: Array) -> Array:
        return self.owned(self._mass @ self.with_ghosts(x))

    def _dot(self, x: Array, y: Array) -> Array:
        return np.asarray(self._comm.allreduce(np.einsum("if,if->f", x, y)))


#: Poisson's ratio from which the bars of linear elements are too narrow at times, by up to a half:
#: the elements lock, and the strains that they lack are smooth, so that recovery sees nothing.
#: Clamped bars of 16 to 64 elements, in plane strain
#: (true errors at 0.45, 0.49, 0.499, 0.4999: 2.6, 5.1, 9.9, 11 %; bars: 3.0, 4.4, 3.7, 2.2 %).
LOCKING = 0.4
#: Poisson's ratio from which they are too narrow by a factor of 2 and more.
LOCKED = 0.48


def refuse_one_cell(structure: MeshedStructure) -> None:
    """InputError for a mesh of one cell, which has no neighbour."""
    if structure.mesh.n_cells < 2:
        raise InputError(
            "the error 'estimate' compares the strains of neighbouring cells, and"
            f" {structure.mesh.name} has one: give a smaller size."
        )


def refuse_locking(structure: MeshedStructure) -> None:
    """InputError for linear elements of a nearly incompressible solid; warned where locking begins.

    Plane stress and displacements of degree 2 do not lock. The Poisson's ratio of a
    material with directions is that of its mean bulk and shear moduli.
    """
    if structure.form.degree > 1:
        return
    nu = max(
        (_poisson(m) for m, _ in structure.parts if getattr(m, "plane", None) != "stress"),
        default=0.0,
    )
    message = (
        f"Poisson's ratio is {nu:.4g} and the {structure.mesh.cell} elements are linear (order 1): "
        f"from {LOCKING:g} on they lock, and the estimate of the error is too small; take order 2."
    )
    if nu >= LOCKED:
        raise InputError(message)
    if nu >= LOCKING:
        warn(structure.comm, message, AccuracyWarning)


def _poisson(material: Material) -> float:
    """Poisson's ratio of the isotropic material with the same mean (Voigt) bulk and shear
    moduli.
    """
    C = np.asarray(material.voigt)
    bulk = float(C[:3, :3].sum()) / 9
    shear = float(np.trace(C[:3, :3]) - 3 * bulk + 2 * np.trace(C[3:, 3:])) / 10
    return (3 * bulk - 2 * shear) / (2 * (3 * bulk + shear))


class SolidErrors(StrainErrors):
    """The estimator of 2-D and 3-D solids, whose flat faces may approximate a curved surface."""

    def prepare(self) -> None:
        refuse_locking(self.part)
        self._note = faceted(self.part.mesh)
        self._layers, self._mass = layers(self.part) if self._note else (np.zeros(0), 0.0)

    def estimate(self, structure: Structure, model: AntiOscillators, site: Functional) -> Estimate:
        shapes = shapes_of(model)
        energies, gaps = self.of_shapes(shapes, model.k0 == 0)
        facts = {"patch": patch_of(structure, site), "geometry": gaps}
        return Estimate(energies + self.of_state(structure, shapes, energies), facts=facts)

    def of_shapes(self, shapes: Array, rigid: bool) -> tuple[Array, FacetGaps | None]:
        """Energies of the errors of shapes (rows, k), of which the first may be rigid, and the
        record of the gaps between faces and surface.
        """
        energies, layer_energies = self.gram_and_layers(shapes, self._layers)
        return energies, self._gaps(layer_energies, rigid)

    def _gaps(self, outside: Array, rigid: bool) -> FacetGaps | None:
        """Record of the energies `outside` the faces; a rigid first shape has none. None without
        gaps.
        """
        if not self._note:
            return None
        if rigid:
            outside[0] = 0.0
        return {"note": self._note, "stiffness": outside.tolist(), "mass": self._mass}

    def gram(self, shapes: Array) -> Array:
        return self.gram_and_layers(shapes, np.zeros(0))[0]

    def gram_and_layers(self, shapes: Array, layers: Array) -> tuple[Array, Array]:
        """Energies E_ij = ∫ e_i:C:e_j (k, k) of errors, and ∫ ε*:C:ε* (k,) of layers on outer
        faces.

        `layers` (F,) are the volumes [m³] (areas in the plane) on the faces of this rank, or none.

        With the projections ε* = Σ x φ, their loads l and mass matrix M, E = ∫ ε:C:ε - lᵀx - xᵀl +
        xᵀMx: one pass over the cells suffices. The residual l - Mx of the solve matters to its
        square only; lᵀx alone would not be symmetric by as much as the residual itself.
        """
        strains = self._strains(shapes)
        count = strains.count
        total = np.zeros((count, count))
        energies = np.zeros((count, count))
        layer_energies = np.zeros(count)
        for root, cells in self._regions():
            projection = Projection(strains.quadrature, cells)
            loads = np.zeros((projection.size, strains.components, count))
            total_here = np.zeros((count, count))
            for block, strains_here, weights in _scaled(strains, root, cells):
                projection.add_loads(loads, block, strains_here)
                strains_here *= np.sqrt(weights)[:, None]
                flat = strains_here.reshape(-1, count)
                total_here += flat.T @ flat
            flat = projection.owned(loads.reshape(len(loads), -1))
            recovered = projection.solve(flat)
            corrected_loads = flat + projection.residual(flat, recovered)
            half = corrected_loads.reshape(-1, count).T @ recovered.reshape(-1, count)
            energies += total_here
            total += total_here - (half + half.T) / 2
            if self.part.comm.allreduce(len(layers)):
                layer_energies += self._outside(projection, cells, recovered, layers, count)
        total, energies, layer_energies = map(
            self.part.comm.allreduce, (total, energies, layer_energies)
        )
        return _positive(total, energies), layer_energies

    def _outside(
        self, projection: Projection, cells: IntArray, recovered: Array, layers: Array, count: int
    ) -> Array:
        """Energies (count,) of the shapes in the layers on the faces of `cells`."""
        faces = self.part.faces
        on_cells = np.flatnonzero(np.isin(faces.cells, cells))
        X = faces.reference(on_cells, faces.middle[on_cells])
        values = projection.within(faces.cells[on_cells], X, projection.with_ghosts(recovered))
        values = values.reshape(len(on_cells), -1, count)
        return np.asarray(np.einsum("fmk,fmk,f->k", values, values, layers[on_cells]))

    def of_cells(self, shapes: Array) -> Array:
        strains = self._strains(shapes)
        energies = np.zeros(compat.cell_map(self.part.mesh.dolfinx).size_local)
        for root, cells in self._regions():
            projection = Projection(strains.quadrature, cells)
            loads = np.zeros((projection.size, strains.components, strains.count))
            for block, strains_here, _ in _scaled(strains, root, cells):
                projection.add_loads(loads, block, strains_here)
            flat = projection.owned(loads.reshape(len(loads), -1))
            recovered = projection.with_ghosts(projection.solve(flat))
            for block, strains_here, weights in _scaled(strains, root, cells):
                smooth = projection.at_points(block, recovered)
                error = smooth.reshape(-1, *loads.shape[1:]) - np.swapaxes(strains_here, 0, 1)
                at_points = np.einsum("pmk,pmk,p->p", error, error, weights)
                energies[cells[block]] = at_points.reshape(len(cells[block]), -1).sum(axis=1)
        return energies

    def _strains(self, shapes: Array) -> CellStrains:
        return CellStrains(self.part.mesh, self.part.form, shapes)

    def _regions(self) -> Iterator[tuple[Array, IntArray]]:
        """Yield (root R of a stiffness RᵀR, owned cells that have it)."""
        mesh = self.part.mesh
        owned_cells = compat.cell_map(mesh.dolfinx).size_local
        regions: dict[bytes, tuple[Array, list[IntArray]]] = {}
        for material, cells in self.part.parts:
            root = np.linalg.cholesky(stiffness(material, mesh.gdim)).T
            regions.setdefault(root.tobytes(), (root, []))[1].append(cells)
        for root, groups in regions.values():
            cells = np.concatenate(groups)
            yield root, cells[cells < owned_cells]


#: Largest share of errors in the energies of shapes that is rounding.
ROUNDING = 1e-12


def _positive(errors: Array, energies: Array) -> Array:
    """Errors (k, k) whose negative eigenvalues over `energies` are zero where they are rounding:
    a cell alone, or strains of degree one, leave nothing to recover.
    """
    scale = np.sqrt(np.diag(energies))
    scale[scale == 0] = 1.0
    values, vectors = np.linalg.eigh(errors / np.outer(scale, scale))
    if not -ROUNDING < values.min() < 0:
        return errors
    vectors = scale[:, None] * vectors
    return np.asarray((vectors * np.maximum(values, 0.0)) @ vectors.T)


def _scaled(
    strains: CellStrains, root: Array, cells: IntArray
) -> Iterator[tuple[slice, Array, Array]]:
    """Yield (some cells, R × strains (components, points, k), weights (points,)) in blocks."""
    for block in strains.quadrature.slices(cells):
        values, weights = strains.at(cells[block])
        yield block, (root @ values.reshape(len(values), -1)).reshape(values.shape), weights


def stiffness(material: Material, dim: int) -> Array:
    """Stress, times thickness in the plane, for unit strains in the order of `CellStrains`."""
    C = np.asarray(material.voigt)
    if dim == 3:
        return C
    in_plane = [0, 1, 5]
    plane = C[np.ix_(in_plane, in_plane)]
    if material.plane == "stress":  # the normal stress across the plane is zero
        plane = plane - np.outer(C[in_plane, 2], C[2, in_plane]) / C[2, 2]
    return np.asarray(material.thickness * plane)
