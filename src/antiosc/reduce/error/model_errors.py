"""The error estimates that an extraction with error="estimate" adds to its models.

The error of solids is estimated by recovered strains, the error of beams and sheets by the same
mesh with each cell divided.

The compliance of a patch contains its half-space compliance, which the contact law subtracts. The
remainder does not depend on the radius if the radius is small against the local thickness and the
mesh resolves it. A patch of a second radius measures the dependence.

The strain of each shape is projected (L2, consistent mass matrix) to continuous functions of degree
one. Strains jump between materials and thicknesses, so each region of equal stiffness has its own
projection. The difference of the recovered and the discontinuous strain estimates the error
(Zienkiewicz, Zhu, Int. J. Numer. Meth. Engng 24 (1987) 337). Conjugate gradients with diagonal
scaling solve the mass matrix; its scaled condition number does not depend on the mesh (Wathen, IMA
J. Numer. Anal. 7 (1987) 449). No form is compiled.
"""

from __future__ import annotations

import time
from collections.abc import Iterator, Mapping
from dataclasses import replace
from functools import cached_property
from typing import TYPE_CHECKING, cast

import numpy as np
import scipy.sparse

from antiosc.base import process
from antiosc.base._types import Array, IntArray
from antiosc.base.errors import InputError, NotConvergedError
from antiosc.fem.elements.solid import voigt_stiffness
from antiosc.fem.linalg.algebra import conjugate_gradients, dot
from antiosc.fem.linalg.solver import SHELL_BYTES, Solver, bytes_of_shells
from antiosc.fem.platform import compat
from antiosc.fem.structure.meshed import MeshedStructure, PartsMatrices
from antiosc.fem.structure.structure import Structure
from antiosc.models.anti_oscillators import AntiOscillators
from antiosc.models.parameters import JOINTED_MESSAGE
from antiosc.reduce.error.division import Division
from antiosc.reduce.site.site import Functional
from antiosc.reduce.site.sites import WHOLE_PATCH_SHARE, Sites, located_sites

if TYPE_CHECKING:
    from antiosc.fem.assembly.assembled import AssembledMatrices

#: Quadrature degree of all integrals of strains, and of elements of degree two on products of
#: intervals: their strains hold terms of degree two in one direction, which are errors too and
#: vanish at the points of the lower rule (effectivities of 0.2 to 0.5 in place of 0.6 to 1.2).
RULE_DEGREE, PRODUCT_DEGREE = 2, 4
#: Numbers in a block of arrays in memory at once (2 MB), which stay in a cache.
BLOCK_NUMBERS = 250_000
#: Components of the strains (ε11, ε22, ε33, γ23, γ13, γ12), or in the plane (ε11, ε22, γ12).
STRAIN_INDICES = {2: [(0, 0), (1, 1), (0, 1)], 3: [(0, 0), (1, 1), (2, 2), (1, 2), (0, 2), (0, 1)]}
#: Relative residual at which the solve ends (the energies lose the square of it), and most steps.
CG_RESIDUAL, CG_STEPS = 1e-5, 200
#: Poisson's ratio from which linear elements lock: the strains that they lack are smooth, so that
#: recovery sees a half of the error at 0.45 and a fifth at 0.4999 (clamped bars, plane strain).
LOCKING_POISSON = 0.4
TRUSS_REFUSAL = "the nodes of a truss are hinges, so that no mesh could be finer."
#: Text on the error that no mesh refinement shows.
THEORY_NOTE = "Not included: the error of {} theory itself."
#: Share of an element within which a site is at its end.
NODE_SHARE = 1e-3
#: Angles [degree] between straight cells that stand for a curve: no rounding, no sharp edge.
SMOOTH_ANGLES = 0.2, 40.0


class Recovery:
    """Discretisation error of solids, by recovered strains; joints of parts count as exact."""

    divided = False

    def __init__(self, matrices: PartsMatrices) -> None:
        self._matrices = matrices
        for member in self._matrices.members():
            _check_part(member.part)

    def missed(self, model: AntiOscillators) -> tuple[Array, None]:
        """(error energies (p + N, p + N) [N/m] of a model's shapes, None as there is no excess)."""
        fields = self._matrices.fields(np.asarray(model.shapes))
        grams = [error_energies(member.part, u) for member, u in fields]
        return np.sum(grams, axis=0), None

    def of_cells(self, model: AntiOscillators, weights: Array) -> Array:
        """Energy (cells of this rank,) of errors of the shapes combined by `weights` (p + N, k)."""
        ((member, shapes),) = self._matrices.fields(np.asarray(model.shapes) @ weights)
        energies = np.zeros(compat.cell_index_map(member.part.mesh.dolfinx).size_local)
        for cells, errors in strain_errors(member.part, shapes):
            energies[cells] = np.einsum("cmk,cmk->c", errors, errors)
        return energies


def _check_part(part: MeshedStructure) -> None:
    """InputError for a part of one cell, or of linear elements that lock."""
    if part.mesh.n_cells < 2:
        raise InputError(
            "the error 'estimate' compares neighbouring cells, and the mesh has one: give a"
            " smaller size."
        )

    strained = [m for m, _ in part.parts if getattr(m, "plane", None) != "stress"]
    nu = max((getattr(material, "nu", 0.0) for material in strained), default=0.0)
    if part.form.degree == 1 and nu >= LOCKING_POISSON:
        raise InputError(
            f"Poisson's ratio is {nu:.4g} and the {part.mesh.cell} elements are linear (order 1):"
            f" from {LOCKING_POISSON:g} on they lock, and no error is estimated; take order 2."
        )


def error_energies(part: MeshedStructure, shapes: Array) -> Array:
    """Energies E_ij = ∫ e_i:C:e_j (k, k) [J] of the strain errors e of `shapes` (rows, k)."""
    total = np.zeros((shapes.shape[1],) * 2)
    for _, errors in strain_errors(part, shapes):
        flat = errors.reshape(-1, len(total))
        total += flat.T @ flat
    return np.asarray(part.comm.allreduce(total))


def strain_errors(part: MeshedStructure, shapes: Array) -> Iterator[tuple[IntArray, Array]]:
    """Yield (n cells, R e √w (n, points · components, k)) with the strain errors e of k shapes,
    quadrature weights w and the stiffness RᵀR."""
    strains = Strains(part, shapes)
    k = shapes.shape[1]
    for root, cells in _regions(part):
        projection = Projection(strains, cells)
        blocks = strains.slices(cells)
        loads = np.zeros((projection.size, strains.components * k))
        for block in blocks:
            functions, weights = projection.functions(block)
            loads += functions.T @ (weights * strains.at(cells[block]))
        recovered = projection.solve(loads)
        for block in blocks:
            functions, weights = projection.functions(block)
            errors = np.sqrt(weights) * (functions @ recovered - strains.at(cells[block]))
            scaled = root @ errors.reshape(len(errors), -1, k)
            yield cells[block], scaled.reshape(len(cells[block]), -1, k)


def _regions(part: MeshedStructure) -> Iterator[tuple[Array, IntArray]]:
    """Yield (R, cells of this rank) for each different stiffness RᵀR of the part."""
    owned = compat.cell_index_map(part.mesh.dolfinx).size_local
    regions: dict[bytes, tuple[Array, list[IntArray]]] = {}
    for material, cells in part.parts:
        root = np.linalg.cholesky(voigt_stiffness(material, part.mesh.gdim)).T
        regions.setdefault(root.tobytes(), (root, []))[1].append(cells[cells < owned])

    for root, groups in regions.values():
        yield root, np.concatenate(groups)


class Strains:
    """Strains of `shapes` (rows of this rank, k) at the quadrature points of this rank's cells."""

    def __init__(self, part: MeshedStructure, shapes: Array) -> None:
        mesh, form = part.mesh, part.form
        self.mesh = mesh
        self.components = len(STRAIN_INDICES[mesh.gdim])
        by_products = form.degree > 1 and not mesh.geometry.simplex
        degree = PRODUCT_DEGREE if by_products else RULE_DEGREE
        self.X, weights = compat.quadrature(mesh.cell, degree)
        owned = compat.cell_index_map(mesh.dolfinx).size_local
        slopes = mesh.geometry.slopes(self.X)[: 1 if mesh.geometry.affine.all() else None]
        J = np.swapaxes(mesh.geometry.nodes[:owned, :, : mesh.gdim], 1, 2)[:, None] @ slopes
        self._inverse = np.linalg.inv(J)

        #: (cells, points) quadrature weights times |det J|
        self.weights = np.abs(np.linalg.det(J)) * weights
        self._space, self._paths = form.space, list(form.components.values())
        self._values = compat.with_ghosts(form.space, shapes)
        self._slopes = compat.tabulate_derivatives(form.space, self._paths[0], self.X)

    def slices(self, cells: IntArray) -> list[slice]:
        """Slices of `cells`, each small enough for its strains to stay in the processor's cache."""
        each = len(self.X) * self.mesh.gdim**2 * self._values.shape[1]
        width = max(1, BLOCK_NUMBERS // each)
        return [slice(first, first + width) for first in range(0, len(cells), width)]

    def at(self, cells: IntArray) -> Array:
        """Strains (cells · points, components · k) at the quadrature points of `cells`."""
        slopes = np.swapaxes(self._inverse[cells], -1, -2) @ np.swapaxes(self._slopes, -1, -2)
        dofs = [compat.cell_dofs(self._space, path, cells) for path in self._paths]

        # derivatives ∂u_i/∂x_j as [i] (cells, points, j, k)
        slopes = slopes.reshape(len(cells), -1, slopes.shape[-1])
        shape = len(cells), len(self.X), self.mesh.gdim, -1
        gradients = [(slopes @ self._values[of_axis]).reshape(shape) for of_axis in dofs]
        strains = [
            gradients[i][:, :, j] + (gradients[j][:, :, i] if i != j else 0.0)
            for i, j in STRAIN_INDICES[self.mesh.gdim]
        ]

        return np.stack(strains, axis=2).reshape(len(cells) * len(self.X), -1)


class Projection:
    """L2 projection of fields on `cells` of this rank onto continuous linear functions."""

    def __init__(self, strains: Strains, cells: IntArray) -> None:
        mesh = strains.mesh
        self._comm = mesh.comm
        self._space = compat.lagrange_space(mesh.dolfinx, 1, 0)
        self._table = compat.tabulate(self._space, (), strains.X)
        self._corners = compat.cell_dofs(self._space, (0,), cells)
        self._weights = strains.weights[cells]
        index_map = self._space.dofmap.index_map

        #: number of corners of this rank, ghosts included
        self.size = int(index_map.size_local + index_map.num_ghosts)
        functions, weights = self.functions(slice(None))
        self._mass = (functions.T @ functions.multiply(weights)).tocsr()
        diagonal = compat.ghosts_added(self._space, self._mass.diagonal()[:, None])

        # corners of other cells have no function here
        self._inverse = np.divide(1.0, diagonal, out=np.zeros_like(diagonal), where=diagonal > 0)

    def functions(self, block: slice) -> tuple[scipy.sparse.csr_matrix, Array]:
        """(values (points, size) of the functions in a block of cells, weights (points, 1))."""
        weights = self._weights[block].reshape(-1, 1)
        corners = np.repeat(self._corners[block], len(self._table), axis=0)
        values = np.tile(self._table, (len(corners) // len(self._table), 1))
        starts = np.arange(len(corners) + 1) * corners.shape[1]
        arrays = values.ravel(), corners.ravel(), starts
        return scipy.sparse.csr_matrix(arrays, shape=(len(corners), self.size)), weights

    def solve(self, loads: Array) -> Array:
        """Corner values (size, fields) of the projected f, from this rank's `loads` ∫ f φ."""
        loads = compat.ghosts_added(self._space, loads)
        start = self._dot(loads, self._inverse * loads)

        def mass_times(x: Array) -> Array:
            return compat.ghosts_added(self._space, self._mass @ compat.with_ghosts(self._space, x))

        for x, residuals, _ in conjugate_gradients(
            loads, mass_times, lambda r: self._inverse * r, self._dot, CG_STEPS
        ):
            if np.all(residuals <= CG_RESIDUAL**2 * start):
                return compat.with_ghosts(self._space, x)

        raise NotConvergedError(
            f"the recovery of strains did not converge in {CG_STEPS} steps: the mesh has cells of"
            " nearly no volume; mesh the part anew, or leave the error out."
        )

    def _dot(self, x: Array, y: Array) -> Array:
        """Scalar products (fields,) of the columns of two arrays over all ranks."""
        return np.asarray(self._comm.allreduce(np.einsum("if,if->f", x, y)))


#: Most dofs of a divided mesh: 767 000 took 50 s of one core.
MOST_DIVIDED_DOFS = 800_000
#: Anti-oscillators for which the divided mesh's memory is foreseen, bytes of each for a dof.
FORESEEN_COUNT, BYTES_PER_DOF = 150, 52.0


def _why_too_large(matrices: PartsMatrices) -> str:
    """Reason why a structure's mesh is too large for uniform refinement; "" if it is not."""
    part = matrices.members()[0].part
    name = part.mesh.name
    finer = 2.0**part.mesh.tdim * part.rows
    need = (SHELL_BYTES + BYTES_PER_DOF * FORESEEN_COUNT) * finer + bytes_of_shells(round(finer), 0)
    remedy = "compare with a mesh of larger cells"
    if finer > MOST_DIVIDED_DOFS:
        return (
            f"it takes {name} with each cell divided, and {finer:.0f} dofs are more than"
            f" {MOST_DIVIDED_DOFS}: {remedy}."
        )

    free = process.free_memory()
    if need > process.MEMORY_SHARE * free:
        what = f"{name} with each cell divided, which it takes,"
        return f"{process.shortage_text(what, need, free)}: {remedy}."

    return ""


def _are_solids(matrices: PartsMatrices) -> bool:
    """Whether all parts of a structure are solids."""
    if matrices.assembled and cast("AssembledMatrices", matrices).layout.condensed:
        return False
    return all(member.part.kind.outside for member in matrices.members())


def refusal(matrices: PartsMatrices) -> str:
    """Reason why a structure's discretisation error cannot be estimated; "" if it can."""
    if not matrices.assembled and matrices.members()[0].part.kind.name == "truss":
        return TRUSS_REFUSAL
    if _are_solids(matrices) and not (matrices.assembled and matrices.preload):
        return ""
    if matrices.assembled:
        return JOINTED_MESSAGE
    return _why_too_large(matrices)


class ModelErrors:
    """Estimates of the discretisation error for the models of one structure."""

    def __init__(self, structure: Structure) -> None:
        if not structure.matrices.meshed:
            raise InputError("the error of a mesh needs the mesh: given matrices have none.")
        self._matrices = cast("PartsMatrices", structure.matrices)
        self.skipped = refusal(self._matrices)  # why there is no estimate, told by bars, or ""

    def check(self) -> None:
        """InputError for a structure whose models cannot have error bars."""
        if self.skipped == TRUSS_REFUSAL:
            raise InputError(f"the error 'estimate' is of solids, beams, shells: {TRUSS_REFUSAL}")
        if not self.skipped:
            _ = self._estimator

    @cached_property
    def _estimator(self) -> Recovery | Division:
        """The estimator of the structure: by recovered strains, or by a divided mesh."""
        return (Recovery if _are_solids(self._matrices) else Division)(self._matrices)

    def added_to(
        self, model: AntiOscillators, sites: Mapping[str, Functional], solver: Solver
    ) -> AntiOscillators:
        """The model with its `strain_error`, and with data for the error budget in its `info`."""
        if self.skipped:
            return replace(model, info=replace(model.info, no_estimate=self.skipped))
        start_time = time.perf_counter()
        energies, misfit = self._estimator.missed(model)

        first = self._matrices.members()[0]
        struck = [site.place.member if site.place else first for site in sites.values()]
        parts = list(dict.fromkeys(member.part for member in struck))
        inside = (_is_inside(m.part, s) for m, s in zip(struck, sites.values(), strict=True))
        left_out = " ".join(filter(None, map(_not_included, parts)))
        patch = None
        if not (model.sites or self._estimator.divided):
            (site,) = sites.values()
            patch = patch_of(self._matrices, site, solver)

        spent = model.info.get("seconds", {})
        info = model.info.having(
            divided=parts[0].mesh.cell if self._estimator.divided else None,
            patch=patch,
            inside_element=any(inside),
            not_included=left_out or None,
            no_estimate=None,
            seconds={**spent, "error": time.perf_counter() - start_time},
        )

        return replace(model, strain_error=energies, strain_misfit=misfit, info=info)

    def of_cells(self, model: AntiOscillators, weights: Array) -> Array:
        """Energy (cells of this rank,) of errors of shapes combined by `weights` (p + N, k)."""
        return self._estimator.of_cells(model, weights)


def _not_included(part: MeshedStructure) -> str:
    """Sentences that name errors the estimate does not include; "" for straight solids."""
    name = "shell" if part.kind.sheet else part.kind.name
    theory = "" if part.kind.outside else THEORY_NOTE.format(name)
    return " ".join(filter(None, [theory, flat_cells_note(part)]))


def _is_inside(part: MeshedStructure, site: Functional) -> bool:
    """Whether a site lies within an element of a beam, away from its nodes."""
    if part.mesh.tdim > 1 or site.point is None:
        return False

    ends = part.mesh.geometry.nodes[:, :2]
    lengths = np.linalg.norm(ends[:, 1] - ends[:, 0], axis=1)
    distances = np.linalg.norm(ends - site.point, axis=2) / lengths[:, None]
    return bool(distances.min() > NODE_SHARE)


def flat_cells_note(part: MeshedStructure) -> str:
    """A sentence if straight cells of a mesh seem to approximate a curve, else ""."""
    mesh = part.mesh
    if mesh.order > 1:
        return ""
    dim, entities = mesh.tdim, np.arange(compat.cell_index_map(mesh.dolfinx).size_local)
    if part.kind.outside:
        dim, entities = mesh.tdim - 1, compat.exterior_facets(mesh.dolfinx)
    angles = _angles(mesh.dolfinx.geometry.x, compat.vertex_nodes(mesh.dolfinx, dim)[entities])
    small = angles[(angles > SMOOTH_ANGLES[0]) & (angles < SMOOTH_ANGLES[1])]
    largest = max(mesh.comm.allgather(float(small.max(initial=0.0))))
    if not largest:
        return ""

    return (
        f"Not included: the straight cells of {mesh.name}, which meet at angles of up to"
        f" {largest:.2g}°, if they stand for a curve; cells of order 2 have it curved."
    )


def _angles(x: Array, corners: IntArray) -> Array:
    """Angles (k,) [degree] between neighbouring lines or faces of the `corners` (n, v) of x."""
    points = x[corners]
    along = points[:, -1] - points[:, 0]

    if corners.shape[1] > 2:
        along = np.cross(
            along if corners.shape[1] == 4 else points[:, 1] - points[:, 0],
            points[:, 2] - points[:, 1 if corners.shape[1] == 4 else 0],
        )

    unit = along / np.linalg.norm(along, axis=1, keepdims=True)
    places = {2: [[0], [1]], 3: [[0, 1], [0, 2], [1, 2]], 4: [[0, 1], [0, 2], [1, 3], [2, 3]]}
    sides = [corners[:, place] for place in places[corners.shape[1]]]
    keys = np.sort(np.concatenate(sides), axis=1)
    owner = np.tile(np.arange(len(corners)), len(sides))
    _, side, count = np.unique(keys, axis=0, return_inverse=True, return_counts=True)
    order = np.argsort(side.ravel(), kind="stable")
    pairs = owner[order][np.repeat(count == 2, count)].reshape(-1, 2)
    cosine = np.abs(np.einsum("nd,nd->n", *unit[pairs.T]))
    return np.asarray(np.degrees(np.arccos(np.minimum(cosine, 1.0))))


#: The second radius over the first, and the ratio used instead if the larger patch leaves the face.
RADIUS_RATIOS = (np.sqrt(2.0), np.sqrt(0.5))
#: Least share of the load of the second patch on its face.
WHOLE_LOAD_SHARE = 0.99


def patch_of(matrices: PartsMatrices, site: Functional, solver: Solver) -> dict[str, float] | None:
    """Data of a site's patch for the error budget, as in `ModelInfo.notes`; None for a point."""
    place = site.place
    if site.radius is None or place is None:
        return None
    member = place.member

    def of_radius(radius: float) -> Sites:
        """The site with a patch of this radius [m]."""
        radii = np.array([radius])
        return located_sites(member.part, place.point[None], place.direction[None], radii)

    first = of_radius(site.radius)
    facts = {"faces": float(first.size[0]), "cut": float(first.share[0] < WHOLE_PATCH_SHARE)}
    if facts["cut"] or not site.local_compliance:
        return facts

    for factor in RADIUS_RATIOS:
        second = of_radius(factor * site.radius)
        if second.share[0] >= WHOLE_LOAD_SHARE:
            break
    else:
        return facts

    b = matrices.joined(second.loads[:, 0].toarray().ravel(), member.rows)

    # bᵀA⁻¹b of both is a difference of two squares: one solve, without cancellation
    solution = solver.solve_checked((b - site.b)[:, None])[:, 0]
    change = float(dot(solver.comm, solution, b + site.b))
    change -= float(second.local[0]) - site.local_compliance
    return {**facts, "radius": float(second.radii[0]), "compliance": change}
