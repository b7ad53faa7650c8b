"""Wanted sizes of cells, their bisection, and the error of beams by a mesh of half the size.

A cell of size h and error η² has the error s^(2p) η² if its size becomes s h, and 1/s^d cells
stand in its place (p the order of the elements, d the dimension). Of all sizes with the same total
error those with s = λ (η²)^(-1/(q + d)), q = 2p, take the fewest cells (Ladevèze, Coffignal and
Pelle, 1986). But the largest errors are those at inner edges, where q is that of the singularity,
whatever p is: 1.09 at a right angle (Williams, J. Appl. Mech. 19 (1952) 526). In space, where such
edges hold many cells, sizes for q = 1 leave 0.7 of the error on a stiffened panel with as many
cells as for q = 3, and as much of it on parts without such edges; in the plane they are corners.

The strains of beams are most accurate at the very points where the element takes them, so that
their recovery says nothing. A second mesh with two elements in place of each costs next to nothing:
the loads of the shapes (the site's load, and inertia forces ω² M ψ with their reaction at the site)
are put on both meshes, and the difference of the flexibilities under them is that which the coarse
mesh lacks, times 1/(1 - 4^-p) for all finer meshes (the flexibility of elements of degree p
converges with the power 2p of the size). A site inside an element is a node of the second mesh: the
kink there is an error that halving alone would change but little.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from math import exp

import dolfinx
import numpy as np
import scipy.sparse
import scipy.sparse.linalg
from mpi4py import MPI
from numpy.typing import NDArray
from scipy.optimize import brentq
from scipy.spatial import cKDTree

from antiosc.base._types import Array, IntArray
from antiosc.base.checks import ROUNDING
from antiosc.base.errors import InputError
from antiosc.fem.linalg.petsc_algebra import csr
from antiosc.fem.mesh import Mesh, distributed
from antiosc.fem.platform import compat
from antiosc.fem.structure.meshed import MeshedStructure
from antiosc.io.neutral import KINDS, RawMesh
from antiosc.io.reading import keys
from antiosc.models.anti_oscillators import AntiOscillators
from antiosc.reduce.site import Functional
from antiosc.reduce.site.sites import located

#: Least and largest change of a size at once: what is coarse already does not become much coarser,
#: for its errors would grow by more than is expected.
FINEST, COARSEST = 0.15, 1.3
#: q by dimension: power of the size by which the energy of errors falls where it is largest.
POWER = {1: 4.0, 2: 2.0, 3: 1.0}
#: log λ is sought within this of that of cells with the mean error.
WIDEST = 50.0


def ratios(comm: MPI.Comm, energies: Array, goal: float, order: int, dim: int) -> Array:
    """New over old size of each cell of this rank (cells,).

    Parameters
    ----------
    energies : (cells,) errors η² of the cells of this rank.
    goal : wanted total over the present one; less is not reached with sizes above `FINEST`.
    order, dim : of the elements, of the mesh.
    """
    total, count = comm.allreduce(np.array([energies.sum(), float(len(energies))]))
    if total == 0:
        return np.ones(len(energies))
    share = np.maximum(energies / (total / count), np.finfo(float).tiny)
    wanted = share ** (-1 / (POWER[dim] + dim))

    def sizes(scale: float) -> Array:
        return np.asarray(np.clip(exp(scale) * wanted, FINEST, COARSEST))

    def beyond(scale: float) -> float:
        left = float(np.sum(sizes(scale) ** (2 * order) * energies))
        return float(comm.allreduce(left)) / total - goal

    if beyond(-WIDEST) >= 0:
        return sizes(-WIDEST)
    if beyond(WIDEST) <= 0:
        return sizes(WIDEST)
    return sizes(brentq(beyond, -WIDEST, WIDEST, xtol=1e-12, rtol=1e-14))


def growth(comm: MPI.Comm, ratio: Array, dim: int) -> float:
    """Ratio of the number of cells after a change of sizes by these ratios to the present one."""
    new, old = comm.allreduce(np.array([np.sum(ratio ** -float(dim)), float(len(ratio))]))
    return float(new / old)


def edge_lengths(mesh: Mesh) -> Array:
    """Mean length [m] of the edges of each cell that this rank owns, (cells,)."""
    nodes = compat.geometry_nodes(mesh.dolfinx)[: compat.cell_map(mesh.dolfinx).size_local]
    corners = mesh.dolfinx.geometry.x[nodes[:, : len(mesh.geometry.corners)]]
    count = corners.shape[1]
    one, other = np.triu_indices(count, 1)  # of a simplex all pairs of corners are edges
    return np.asarray(np.linalg.norm(corners[:, one] - corners[:, other], axis=2).mean(axis=1))


#: A cell is divided if its new size over its own is below this, in at most so many rounds.
DIVIDED, ROUNDS = 0.75, 3
#: Kinds of cells that can be divided, by dolfinx's names.
KIND_OF = {"triangle": "triangle", "tetrahedron": "tetra"}


@dataclass(frozen=True)
class Pieces:
    """A whole mesh on one rank with a value for each cell.

    Attributes
    ----------
    points : (n, gdim) m.
    cells : (c, dim + 1) numbers of points.
    groups : name -> {dimension: (entities, vertices of one) numbers of points}.
    values : (c,)
    """

    points: Array
    cells: IntArray
    groups: dict[str, dict[int, IntArray]]
    values: Array


def divisible(mesh: Mesh) -> bool:
    """Whether the cells of the mesh can be bisected: straight triangles and tetrahedra."""
    return mesh.cell in KIND_OF and mesh.order == 1


def refined(mesh: Mesh, ratio: Array) -> Mesh:
    """The mesh with cells bisected until their sizes are about `ratio` times the present ones.

    `ratio` (cells that this rank owns,). The refinement is made on one rank and distributed anew.
    """
    pieces = gathered(mesh, ratio)
    if pieces is not None:
        for _ in range(ROUNDS):
            if not np.any(pieces.values < DIVIDED):
                break
            pieces = divided(pieces, mesh.cell)
    pieces = mesh.comm.bcast(pieces)
    kind = KINDS[KIND_OF[mesh.cell]]
    raw = RawMesh(pieces.points, pieces.cells, kind, "gmsh", pieces.groups)
    return distributed(raw, mesh.name, mesh.comm)


def gathered(mesh: Mesh, values: Array) -> Pieces | None:
    """The mesh and `values` of its cells on rank 0; None on other ranks."""
    geometry = mesh.dolfinx.geometry
    own = np.arange(len(geometry.x), dtype=np.int32)
    number = np.asarray(geometry.index_map().local_to_global(own))
    count = compat.cell_map(mesh.dolfinx).size_local
    cells = number[compat.geometry_nodes(mesh.dolfinx)[:count]]
    groups = {
        name: {
            dim: number[compat.entity_vertices(mesh.dolfinx, dim)[entities]]
            for dim, entities in sorted(parts.items())
        }
        for name, parts in mesh.groups.items()
    }
    found = mesh.comm.gather((number, geometry.x[:, : mesh.gdim], cells, values, groups))
    if found is None:
        return None
    points = np.zeros((int(geometry.index_map().size_global), mesh.gdim))
    whole: dict[str, dict[int, list[IntArray]]] = {}
    for numbers, x, _, _, own_groups in found:
        points[numbers] = x
        for name, parts in own_groups.items():
            for dim, rows in parts.items():
                whole.setdefault(name, {}).setdefault(dim, []).append(np.sort(rows, axis=1))
    return Pieces(
        points,
        np.vstack([each[2] for each in found]).astype(np.int64),
        {
            name: {dim: np.unique(np.vstack(rows), axis=0) for dim, rows in parts.items()}
            for name, parts in whole.items()
        },
        np.concatenate([each[3] for each in found]),
    )


def divided(pieces: Pieces, cell: str) -> Pieces:
    """One round: all edges of the cells with small values are halved.

    The new values are those of the parents times the old size over the new one.
    """
    arguments = np.ascontiguousarray(pieces.cells), pieces.points, cell, 1
    old = compat.create_mesh(MPI.COMM_SELF, *arguments)
    input_cells = np.asarray(old.topology.original_cell_index)
    marked = pieces.values[input_cells] < DIVIDED
    new = compat.refined(old, np.unique(compat.cell_entities(old, 1)[marked]))
    gdim = pieces.points.shape[1]
    x = new.geometry.x[:, :gdim].copy()
    support = _supports(pieces, x)
    cells = compat.geometry_nodes(new).astype(np.int64)
    fresh = replace(pieces, points=x, cells=cells, groups={})
    parent = _positions(_carriers(support, cells), pieces.cells)
    if cell == "triangle" and gdim == 3:  # the normals tell the side of layers
        turned = np.einsum("ci,ci->c", _normals(x[cells]), _normals(_corners(pieces)[parent])) < 0
        cells[turned] = cells[turned][:, [0, 2, 1]]
        fresh = replace(fresh, cells=cells)
    values = pieces.values[parent] * _sizes(pieces)[parent] / _sizes(fresh)
    groups = {
        name: {dim: _inside(new, dim, support, rows) for dim, rows in parts.items()}
        for name, parts in pieces.groups.items()
    }
    return replace(fresh, groups=groups, values=values)


def _corners(pieces: Pieces) -> Array:
    """Corners (cells, corners, gdim) of the cells."""
    return pieces.points[pieces.cells]


def _normals(corners: Array) -> Array:
    """Normals (cells, 3) of triangles in space."""
    return np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])


def _sizes(pieces: Pieces) -> Array:
    """Mean edge length of each cell."""
    corners = _corners(pieces)
    one, other = np.triu_indices(corners.shape[1], 1)
    return np.asarray(np.linalg.norm(corners[:, one] - corners[:, other], axis=2).mean(axis=1))


def _supports(pieces: Pieces, x: Array) -> IntArray:
    """Pairs (n, 2) of old points between which each new point lies; equal for an old point."""
    one, other = np.triu_indices(pieces.cells.shape[1], 1)
    edges = np.stack([pieces.cells[:, one].ravel(), pieces.cells[:, other].ravel()], axis=1)
    edges = np.unique(np.sort(edges, axis=1), axis=0)
    alone = np.repeat(np.arange(len(pieces.points))[:, None], 2, axis=1)
    pairs = np.vstack([alone, edges])
    _, found = cKDTree(pieces.points[pairs].mean(axis=1)).query(x)
    return np.asarray(pairs[found])


def _carriers(support: IntArray, entities: IntArray) -> IntArray:
    """Old points (n, k) that support each new entity (n, k); -1 if there are more than k.

    An entity lies in an old one of its own dimension exactly if it rests on as many points.
    """
    k = entities.shape[1]
    rows = np.sort(support[entities].reshape(len(entities), -1), axis=1)
    first = np.ones(rows.shape, dtype=bool)
    first[:, 1:] = np.diff(rows, axis=1) > 0
    fit = first.sum(axis=1) == k
    found = np.full((len(entities), k), -1, dtype=np.int64)
    found[fit] = rows[fit][first[fit]].reshape(-1, k)
    return found


def _positions(rows: IntArray, among: IntArray) -> IntArray:
    """Index of each row among others, in any order of its entries; -1 if absent."""
    code = keys(among.astype(np.int64))
    order = np.argsort(code)
    asked = keys(rows.astype(np.int64))
    at = np.minimum(np.searchsorted(code[order], asked), max(len(code) - 1, 0))
    if not len(code):
        return np.full(len(rows), -1)
    return np.where(code[order][at] == asked, order[at], -1)


def _inside(mesh: dolfinx.mesh.Mesh, dim: int, support: IntArray, group: IntArray) -> IntArray:
    """Vertices of the entities of the new mesh that lie in the old entities `group`."""
    entities = compat.entity_vertices(mesh, dim).astype(np.int64)
    carriers = _carriers(support, entities)
    return entities[(carriers[:, 0] >= 0) & (_positions(carriers, group) >= 0)]


class HalvedBeams:
    """Estimator for structures of beams, on one rank."""

    def __init__(self, part: MeshedStructure) -> None:
        if part.comm.size > 1:
            raise InputError("error='estimate' of beams runs on one rank; leave error=None here.")
        self._coarse = part

    def gram(self, model: AntiOscillators, site: Functional) -> Array:
        """Energies [N/m] by which the mesh is too stiff for psi_0 ... psi_N: (N + 1, N + 1)."""
        if site.point is None or site.direction is None:
            raise InputError("error='estimate' of beams needs a Site with a point and a direction.")
        place = site.point[None, :], site.direction[None, :], np.array([np.nan])
        fine = self._coarse.again(halved(self._coarse.mesh, site.point))
        up = interpolation(self._coarse, fine)
        b = located(fine, *place).loads[:, 0].toarray()
        shapes = np.asarray(model.shapes)
        masses = np.append(0.0, model.m)
        squares = np.append(0.0, np.square(model.omega))
        lacks = 0.0
        for part, load, values, sign in (
            (self._coarse, site.b[:, None], shapes, -1.0),
            (fine, b, up @ shapes, 1.0),
        ):
            forces = squares * (csr(part.M) @ values - masses * load)
            forces[:, :1] = model.k0 * load
            lacks = lacks + sign * (forces.T @ answers(part, forces))
        return excess(np.asarray(lacks) / (1 - 4.0**-self._coarse.form.degree))


def excess(lacks: Array) -> Array:
    """Excess energies E of shapes ψ whose loads Kψ have flexibilities `lacks` too small.

    These are E itself where a mesh lacks flexibility for every pattern of loads. Elements that are
    integrated with few points can have too much for some: the products of different shapes are then
    reduced, all by one factor.
    """
    size = np.sqrt(np.maximum(np.diag(lacks), 0.0))
    over = np.divide(1.0, size, out=np.zeros_like(size), where=size > 0)
    alike = np.clip(over[:, None] * (lacks + lacks.T) / 2 * over, -1.0, 1.0)
    np.fill_diagonal(alike, 1.0)
    negative = max(-float(np.linalg.eigvalsh(alike)[0]), 0.0) + ROUNDING
    alike = (alike + negative * np.eye(len(alike))) / (1 + negative)
    return np.asarray(size[:, None] * alike * size)


def answers(part: MeshedStructure, forces: Array) -> Array:
    """Displacements due to self-equilibrated forces (rows, k), orthogonal to the rigid motions."""
    free = np.setdiff1d(np.arange(compat.local_size(part.form.space)), part.fixed)
    K, R = csr(part.K)[free][:, free], (csr(part.M) @ part.rigid_modes)[free]
    if R.shape[1]:
        K = scipy.sparse.bmat([[K, R * (size := abs(K).max() / abs(R).max())], [R.T * size, None]])
    padded = np.vstack([forces[free], np.zeros((R.shape[1], forces.shape[1]))])
    found = np.zeros_like(forces)
    found[free] = scipy.sparse.linalg.splu(K.tocsc()).solve(padded)[: len(free)]
    return found


def interpolation(part: MeshedStructure, fine: MeshedStructure) -> scipy.sparse.csr_matrix:
    """Interpolation matrix (fine rows, coarse rows) of displacements from a mesh to a finer one."""
    parent = np.asarray(fine.mesh.dolfinx.topology.original_cell_index) // 2
    ends = part.mesh.geometry.nodes[parent]
    along = ends[:, 1] - ends[:, 0]
    done: list[tuple[Array, IntArray, IntArray]] = []
    for path in part.form.components.values():
        dofs = compat.cell_dofs(fine.form.space, path, np.arange(len(parent)))
        where, x = compat.dof_coordinates(fine.form.space, path)
        place = np.zeros((compat.local_size(fine.form.space), 3))
        place[where] = x
        reach = np.einsum("cfd,cd->cf", place[dofs] - ends[:, :1], along)
        X = reach / np.einsum("cd,cd->c", along, along)[:, None]
        table = compat.tabulate(part.form.space, path, X.reshape(-1, 1))
        own = np.repeat(compat.cell_dofs(part.form.space, path, parent), dofs.shape[1], axis=0)
        rows, first = np.unique(dofs.ravel(), return_index=True)
        done.append((table[first], np.repeat(rows[:, None], own.shape[1], axis=1), own[first]))
    values, rows, columns = (np.concatenate([each[k] for each in done]) for k in range(3))
    entries = values.ravel(), (rows.ravel(), columns.ravel())
    shape = tuple(compat.local_size(each.form.space) for each in (fine, part))
    return scipy.sparse.csr_matrix(entries, shape=shape)


#: Share of an element within which a site is taken to be at its node.
AT_NODE = 1e-3
#: Angles in degrees between the two cells at a node of a polygon that stands for a curve: above
#: rounding, and up to those of a circle of 16 cells.
LEAST_ANGLE, MOST_ANGLE = 0.2, 23.0


def halved(mesh: Mesh, point: Array | None = None) -> Mesh:
    """The mesh of lines with each cell c divided into two, the input cells 2c and 2c + 1.

    They meet in the middle, those nearest to `point` there, unless it lies close to a node.
    """
    return _divided(mesh, 0.5, point)


def with_node(mesh: Mesh, point: Array) -> Mesh:
    """The mesh of lines with a node at the point nearest to `point`."""
    return _divided(mesh, np.nan, point)


def inside(mesh: Mesh, point: Array) -> bool:
    """Whether a point lies within an element and not at a node."""
    ends = mesh.geometry.nodes[:, :2, : mesh.gdim]
    lengths = np.linalg.norm(ends[:, 1] - ends[:, 0], axis=1)
    away = np.linalg.norm(ends - point[: mesh.gdim], axis=2) / lengths[:, None]
    return bool(away.min() > AT_NODE)


def polygon(mesh: Mesh) -> str:
    """A sentence if the lines of a mesh seem to approximate a curve by a polygon; else ""."""
    pieces = gathered(mesh, np.zeros(compat.cell_map(mesh.dolfinx).size_local))
    angle = 0.0 if pieces is None else _largest_angle(pieces)
    angle = mesh.comm.bcast(angle)
    if not angle:
        return ""
    return (
        f"Not included: the lines of {mesh.name} that meet at angles of up to {angle:.2g}°, if "
        "they stand for a curve."
    )


def _largest_angle(pieces: Pieces) -> float:
    """Largest angle [degrees] between two adjacent cells that approximate a curve; 0 if none do."""
    cells = pieces.cells
    ends, cell = cells.ravel(), np.repeat(np.arange(len(cells)), 2)
    two = np.flatnonzero(np.bincount(ends, minlength=len(pieces.points)) == 2)
    order = np.argsort(ends, kind="stable")
    at = np.searchsorted(ends[order], two)
    outward = []
    for number in (order[at], order[np.minimum(at + 1, len(order) - 1)]):
        far = cells[cell[number], 1 - number % 2]
        along = pieces.points[far] - pieces.points[two]
        outward.append(along / np.linalg.norm(along, axis=1, keepdims=True))
    cosine = np.clip(-np.einsum("nd,nd->n", *outward), -1.0, 1.0)
    angle = np.degrees(np.arccos(cosine))
    return float(max(angle[(angle > LEAST_ANGLE) & (angle < MOST_ANGLE)], default=0.0))


def _divided(mesh: Mesh, usual: float, point: Array | None) -> Mesh:
    """The mesh with each cell cut at the share `usual` of its length (NaN: whole) or at `point`."""
    pieces = gathered(mesh, np.zeros(compat.cell_map(mesh.dolfinx).size_local))
    raw: RawMesh | InputError | None = None
    if pieces is not None:
        cuts = np.full(len(pieces.cells), usual)
        if point is not None:
            _cut_at(cuts, pieces, point)
        raw = _pieced(pieces, cuts)
    raw = mesh.comm.bcast(raw)
    if isinstance(raw, InputError):
        raise raw
    assert raw is not None
    return distributed(raw, mesh.name, mesh.comm)


def _cut_at(cuts: Array, pieces: Pieces, point: Array) -> None:
    """Cut the cell nearest to the point there, unless the point is close to a node."""
    ends = pieces.points[pieces.cells]
    along = ends[:, 1] - ends[:, 0]
    start = ends[:, 0] - point[: ends.shape[2]]
    nearest = np.clip(-np.einsum("cd,cd->c", start, along) / (along**2).sum(axis=1), 0.0, 1.0)
    distance = np.linalg.norm(start + nearest[:, None] * along, axis=1)
    closest = int(np.argmin(distance))
    if AT_NODE < nearest[closest] < 1 - AT_NODE:
        cuts[closest] = nearest[closest]


def _pieced(pieces: Pieces, cuts: Array) -> RawMesh | InputError:
    """The mesh with its cells cut at these shares of their lengths; NaN: whole."""
    cells = pieces.cells.astype(np.int64)
    known = keys(cells)
    if len(np.unique(known)) < len(known):
        return InputError("the error estimate of beams takes no two beams between the same nodes.")
    cut = np.isfinite(cuts)
    middle = np.full(len(cells), -1)
    middle[cut] = len(pieces.points) + np.arange(cut.sum())
    order = np.argsort(known)
    groups: dict[str, dict[int, NDArray[np.int64]]] = {}
    for name, parts in pieces.groups.items():
        groups[name] = {dim: rows.astype(np.int64) for dim, rows in parts.items()}
        if 1 in parts:
            found = order[np.searchsorted(known[order], keys(groups[name][1]))]
            groups[name][1] = _children(cells, middle, found)
    start, end = (pieces.points[cells[cut, side]] for side in (0, 1))
    points = np.vstack([pieces.points, start + cuts[cut, None] * (end - start)])
    every = _children(cells, middle, np.arange(len(cells)))
    return RawMesh(points, every, KINDS["line"], "gmsh", groups)


def _children(cells: IntArray, middle: IntArray, which: IntArray) -> NDArray[np.int64]:
    """The parts of cells `which`, in order; `middle` is -1 for whole cells."""
    ends, between = cells[which], middle[which]
    pairs = np.stack([ends[:, 0], between, between, ends[:, 1]], axis=1).reshape(-1, 2, 2)
    pairs[between < 0, 0] = ends[between < 0]
    kept = np.ones((len(which), 2), dtype=bool)
    kept[between < 0, 1] = False
    return pairs[kept].astype(np.int64)
