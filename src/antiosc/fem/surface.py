"""Many sites on a surface at once: its points and normals, and the functional b of each.

`functional` makes one b with all its checks; here thousands come from one quadrature of the
surface, with the same pressure and the same choice of face, or from the nodes themselves.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

import basix
import numpy as np
import scipy.sparse
from scipy.spatial import cKDTree

from antiosc.errors import InputError
from antiosc.fem import compat
from antiosc.fem.algebra import Array
from antiosc.fem.compat import IntArray
from antiosc.fem.load import OFF_DISC, SAME_FACE, hertz_disc
from antiosc.fem.mesh import Mesh
from antiosc.fem.site import ON_STRUCTURE
from antiosc.fem.structure import Structure

#: Gauss points across one radius (the pressure's slope is infinite on the rim), and per direction
#: on a facet at least and at most.
GAUSS, FEWEST, MOST = 8, 4, 12
#: Cells of a sheet in which a point is looked for, and how far outside one it may lie (rounding).
NEAR, INSIDE = 16, 1e-8


@dataclass(frozen=True, eq=False)
class Surface:
    """Points of a surface, on every rank alike."""

    #: coordinates (P, 3), m
    points: Array
    #: unit normals (P, 3) out of the body; of either sign on shells, zero on lines
    normals: Array
    #: corners (T, 3) of triangles between the points; (T, 2) segments of lines
    elements: IntArray
    #: number of the material there in `structure.parts` (P,); where several meet, the least
    part: IntArray


def surface(structure: Structure, group: str | None) -> Surface:
    """The vertices of a group of facets (of cells on shells and beams); None: all there are."""
    mesh = structure.mesh
    if mesh is None:
        raise InputError("a map needs a mesh: matrices have no points.")
    assert structure.form is not None
    facets, dim = _facets(mesh, group, structure.form.patch == "facets")
    nodes = compat.entity_vertices(mesh.dolfinx, dim)[facets]
    numbers = np.asarray(mesh.dolfinx.geometry.input_global_indices)[nodes]
    cells = facets if dim == mesh.tdim else compat.cells_of(mesh.dolfinx, facets)
    part = _part_of_cells(structure)[cells]
    own = (numbers, mesh.dolfinx.geometry.x[nodes], _normals(mesh, dim, facets), part)
    numbers, x, normals, part = (
        np.concatenate(each) for each in zip(*mesh.comm.allgather(own), strict=True)
    )
    _, first, corner = np.unique(numbers.ravel(), return_index=True, return_inverse=True)
    corner = corner.reshape(numbers.shape)
    mean, least = np.zeros((len(first), 3)), np.full(len(first), len(structure.parts))
    for column in corner.T:
        np.add.at(mean, column, normals)
        np.minimum.at(least, column, part)
    length = np.linalg.norm(mean, axis=1, keepdims=True)
    mean = mean / np.where(length > 0, length, 1.0)
    if corner.shape[1] == 4:  # in tensor order: 0 1 / 2 3
        corner = np.vstack([corner[:, [0, 1, 2]], corner[:, [1, 3, 2]]])
    return Surface(x.reshape(-1, 3)[first], mean, corner, least)


def points_on_sheet(structure: Structure, points: Array) -> Surface:
    """The sheet at given points (P, 3) of it; no elements between them.

    Raises InputError for points off the sheet.
    """
    mesh, _ = structure.meshed()
    sheet = _Sheet(mesh)
    cell, X, distance = sheet.find(points)
    x, normals = sheet.at(cell, X)
    own = distance, x, normals, _part_of_cells(structure)[cell] if sheet.count else cell
    ranks = [np.array(each) for each in zip(*mesh.comm.allgather(own), strict=True)]
    nearest = ranks[0].argmin(axis=0), np.arange(len(points))
    distance, x, normals, part = (each[nearest] for each in ranks)
    off = np.flatnonzero(distance > ON_STRUCTURE * mesh.extent())
    if len(off):
        place = ", ".join(f"{c:.6g}" for c in points[off[0]])
        raise InputError(
            f"{len(off)} of {len(points)} points lie off the sheet, one at ({place}) m: give "
            "points on its middle surface, or the name of a group."
        )
    return Surface(x, normals, np.zeros((0, 3), dtype=int), part)


def point_loads(structure: Structure, points: Array, directions: Array) -> scipy.sparse.csr_matrix:
    """b of points that are nodes, as columns (rows of this rank, P)."""
    assert structure.mesh is not None
    assert structure.form is not None
    near = 1e-9 * structure.mesh.extent()
    rows, sites, values = [], [], []
    for axis, name in enumerate("xyz"):
        if name not in structure.form.components:
            continue
        dofs, x = compat.dof_coordinates(structure.form.space, structure.form.components[name])
        mine = dofs < structure.K.getLocalSize()[0]
        if not mine.any():
            continue
        distance, nearest = cKDTree(x[mine]).query(points, distance_upper_bound=near)
        found = np.flatnonzero(np.isfinite(distance))
        rows.append(dofs[mine][nearest[found]])
        sites.append(found)
        values.append(directions[found, axis])
    return _columns(structure, rows, sites, values, len(points))


def patch_loads(
    structure: Structure, points: Array, normals: Array, directions: Array, radius: float
) -> tuple[scipy.sparse.csr_matrix, Array]:
    """b of patches with Hertz's pressure on a solid's surface, and what share of it meets the face.

    The columns (rows of this rank, P) are scaled to a unit force; where the share is 0 they are 0.
    """
    mesh, form = structure.mesh, structure.form
    assert mesh is not None
    assert form is not None
    facets, corners, _ = mesh.outside
    centres = corners.mean(axis=1)
    reach = radius + np.linalg.norm(corners - centres[:, None], axis=2).max(axis=1, initial=0.0)
    tree = cKDTree(points)
    if len(facets):
        distance, _ = tree.query(centres)
        facets = facets[distance < 1.5 * reach]
    size = mesh.comm.allreduce(float(np.sum(reach - radius)))
    size = 1.5 * size / max(mesh.comm.allreduce(len(reach)), 1)
    order = int(np.clip(np.ceil(GAUSS * size / radius), FEWEST, MOST))
    rows, sites, values = [], [], []
    total = np.zeros(len(points))
    for part in _quadrature(mesh, structure, facets, order):
        if not len(part.x):
            continue
        near = cKDTree(part.x.reshape(-1, 3)).sparse_distance_matrix(
            tree, radius, output_type="ndarray"
        )
        at, site, gap = near["i"], near["j"], near["v"] / radius
        facet = at // part.x.shape[1]
        same = np.einsum("ij,ij->i", part.normals[facet], normals[site]) > SAME_FACE
        at, site, facet, gap = at[same], site[same], facet[same], gap[same]
        weight = part.dS.ravel()[at] * np.sqrt(np.maximum(1 - gap**2, 0.0))
        np.add.at(total, site, weight)
        # one entry per (site, facet): its pressure against each basis function
        pair, where = np.unique(site * len(part.cells) + facet, return_inverse=True)
        pressure = scipy.sparse.csr_matrix(
            (weight, (where.ravel(), at % part.x.shape[1])), shape=(len(pair), part.x.shape[1])
        )
        moments = pressure @ part.basis
        owner = pair // len(part.cells)
        for axis, name in enumerate("xyz"[: mesh.gdim]):
            dofmap = compat.subspace(form.space, form.components[name]).dofmap
            dofs = np.array([dofmap.cell_dofs(c) for c in part.cells])
            rows.append(dofs[pair % len(part.cells)].ravel())
            sites.append(np.repeat(owner, moments.shape[1]))
            values.append((moments * directions[owner, axis, None]).ravel())
    total = mesh.comm.allreduce(total)
    B = _columns(structure, rows, sites, values, len(points))
    ideal = 2 / 3 * np.pi * radius**2 if mesh.tdim == 3 else np.pi / 2 * radius
    scale = np.where(total > 0, 1 / np.where(total > 0, total, 1.0), 0.0)
    return (B @ scipy.sparse.diags(scale)).tocsr(), total / ideal


def sheet_loads(
    structure: Structure, points: Array, normals: Array, directions: Array, radius: float
) -> tuple[scipy.sparse.csr_matrix, Array]:
    """b of discs with Hertz's pressure on a shell, and what share of each lies on the sheet."""
    mesh, form = structure.meshed()
    cells = _Sheet(mesh)
    rings = min(4 + int(np.ceil(4 * radius / cells.size)), 24)
    flat, weights = hertz_disc(radius, np.array([0.0, 0.0, 1.0]), rings)
    # turned as for a single site: at a node the rule's error depends on where its rings begin
    first = np.cross(normals, np.eye(3)[np.argmin(np.abs(normals), axis=1)])
    first /= np.linalg.norm(first, axis=1, keepdims=True)
    second = np.cross(normals, first)
    offsets = flat[:, 1, None] * first[:, None] - flat[:, 0, None] * second[:, None]
    at = (points[:, None] + offsets).reshape(-1, 3)
    cell, X, distance = cells.find(at)
    # Each point belongs to the rank that holds it; at a seam to the first that does.
    inside = distance < OFF_DISC * radius
    ranks = mesh.comm.allgather(inside)
    taken = np.any(ranks[: mesh.comm.rank], axis=0) if mesh.comm.rank else np.zeros(len(at), bool)
    mine = np.flatnonzero(inside & ~taken)
    weight = np.tile(weights, len(points))
    share = np.where(np.any(ranks, axis=0), weight, 0.0).reshape(len(points), -1).sum(axis=1)
    site = mine // len(weights)
    scaled = weight[mine] / np.where(share > 0, share, 1.0)[site]
    rows, sites, values = [], [], []
    for axis, name in enumerate("xyz"):
        if name not in form.components or not directions[:, axis].any():
            continue
        path = form.components[name]
        basis = compat.tabulate(form.space, path, X[mine])
        dofs = compat.cell_dofs(form.space, path)[cell[mine]]
        rows.append(dofs.ravel())
        sites.append(np.repeat(site, basis.shape[1]))
        values.append((basis * (scaled * directions[site, axis])[:, None]).ravel())
    return _columns(structure, rows, sites, values, len(points)), share


class _Sheet:
    """The cells of a shell that this rank owns, to find points on them."""

    def __init__(self, mesh: Mesh) -> None:
        self.count = int(compat.cell_map(mesh.dolfinx).size_local)
        nodes = compat.geometry_nodes(mesh.dolfinx)[: self.count]
        self.x = mesh.dolfinx.geometry.x[nodes]
        self.triangles = mesh.cell == "triangle"
        kind = getattr(basix.CellType, mesh.cell)
        self.element = basix.create_element(basix.ElementFamily.P, kind, mesh.order)
        corners = self.x[:, : 3 if self.triangles else 4]
        reach = np.linalg.norm(corners - corners.mean(axis=1, keepdims=True), axis=2)
        total, number = mesh.comm.allreduce(float(reach.sum())), mesh.comm.allreduce(reach.size)
        self.size = 2 * total / number
        self.tree = cKDTree(corners.mean(axis=1)) if self.count else None

    def find(self, points: Array) -> tuple[IntArray, Array, Array]:
        """(cell, reference coordinates in it, distance to it); inf where no near cell has it."""
        cell = np.zeros(len(points), dtype=int)
        X, distance = np.zeros((len(points), 2)), np.full(len(points), np.inf)
        if self.tree is None:
            return cell, X, distance
        _, near = self.tree.query(points, k=min(NEAR, self.count))
        near = near.reshape(len(points), -1)
        left = np.arange(len(points))
        for candidate in near.T:
            xi, off = self._projected(points[left], self.x[candidate[left]])
            better = off < distance[left]
            which = left[better]
            cell[which], X[which] = candidate[which], xi[better]
            distance[which] = off[better]
            left = left[~better]
            if not len(left):
                break
        return cell, X, distance

    def at(self, cell: IntArray, X: Array) -> tuple[Array, Array]:
        """(points (P, 3), unit normals) at reference coordinates in cells."""
        if not self.count:
            return np.zeros((len(X), 3)), np.zeros((len(X), 3))
        N = self.element.tabulate(1, X)[..., 0]
        x, first, second = np.einsum("kqn,qnd->kqd", N, self.x[cell])
        normals = np.cross(first, second)
        return x, normals / np.linalg.norm(normals, axis=1, keepdims=True)

    def _projected(self, points: Array, nodes: Array) -> tuple[Array, Array]:
        """(reference coordinates of the points' feet on their cells, distances; inf outside)."""
        xi = np.full((len(points), 2), 1 / 3 if self.triangles else 0.5)
        for _ in range(1 if self.triangles and nodes.shape[1] == 3 else 5):  # Gauss and Newton
            N = self.element.tabulate(1, xi)[..., 0]
            gap = points - np.einsum("qn,qnd->qd", N[0], nodes)
            J = np.einsum("kqn,qnd->qkd", N[1:], nodes)
            xi = (
                xi
                + np.linalg.solve(
                    J @ J.transpose(0, 2, 1), np.einsum("qkd,qd->qk", J, gap)[..., None]
                )[..., 0]
            )
        N = self.element.tabulate(0, np.clip(xi, -1, 2))[0, ..., 0]
        off = np.linalg.norm(points - np.einsum("qn,qnd->qd", N, nodes), axis=1)
        beyond = 1 - xi.sum(axis=1) if self.triangles else 1 - xi.max(axis=1)
        inside = np.minimum(xi.min(axis=1), beyond) > -INSIDE
        return xi, np.where(inside, off, np.inf)


def _facets(mesh: Mesh, group: str | None, outside: bool) -> tuple[IntArray, int]:
    """Facets on the outside of a solid, or cells of a shell or a beam, owned by this rank."""
    dim = mesh.tdim - outside
    if outside:
        own = mesh.outside.facets
    else:
        own = np.arange(compat.cell_map(mesh.dolfinx).size_local, dtype=np.int32)
    if group is not None:
        parts = mesh.group(group)
        own = own[np.isin(own, parts[dim])] if dim in parts else own[:0]
    if not mesh.comm.allreduce(len(own)):
        raise InputError(
            f"group {group!r} holds no outer faces of {mesh.name} (dimension {dim}): a map needs "
            "a surface; name one, or leave it out for all."
        )
    return own, dim


def _part_of_cells(structure: Structure) -> IntArray:
    """Number of the material of each cell of this rank, ghosts included."""
    imap = compat.cell_map(structure.meshed()[0].dolfinx)
    part = np.zeros(imap.size_local + imap.num_ghosts, dtype=int)
    for number, (_, cells) in enumerate(structure.parts):
        part[cells] = number
    return part


def _normals(mesh: Mesh, dim: int, facets: IntArray) -> Array:
    if dim < mesh.tdim:
        return compat.facet_normals(mesh.dolfinx, facets)
    if dim == 1:
        return np.zeros((len(facets), 3))
    x = mesh.dolfinx.geometry.x[compat.entity_vertices(mesh.dolfinx, dim)[facets]]
    normals = np.cross(x[:, 1] - x[:, 0], x[:, 2] - x[:, 0])
    # a sheet's cells lie either way round: all are turned to one side of an oblique plane
    normals *= np.where(normals @ [0.43, 0.59, 0.68] < 0, -1.0, 1.0)[:, None]
    return normals / np.linalg.norm(normals, axis=1, keepdims=True)


def _columns(
    structure: Structure, rows: list[Any], sites: list[Any], values: list[Any], count: int
) -> scipy.sparse.csr_matrix:
    """The sparse matrix of entries at dofs of this rank, ghosts included, sent to their owners."""
    assert structure.form is not None
    size = structure.K.getLocalSize()[0]
    row = np.concatenate([np.zeros(0, dtype=np.int32), *rows]).astype(np.int64)
    site = np.concatenate([np.zeros(0, dtype=int), *sites])
    value = np.concatenate([np.zeros(0), *values])
    ghost = row >= size
    sent = (compat.global_dofs(structure.form.space, row[ghost]), site[ghost], value[ghost])
    first = structure.K.getOwnershipRange()[0]
    entries = [(row[~ghost], site[~ghost], value[~ghost])]
    for number, at, what in structure.comm.allgather(sent):
        mine = (number >= first) & (number < first + size)
        entries.append((number[mine] - first, at[mine], what[mine]))
    row, site, value = (np.concatenate(part) for part in zip(*entries, strict=True))
    free = np.ones(size, dtype=bool)
    free[structure.fixed[structure.fixed < size]] = False
    keep = free[row]
    return scipy.sparse.csr_matrix((value[keep], (row[keep], site[keep])), shape=(size, count))


# --- Quadrature of facets -----------------------------------------------------------------------


@dataclass(frozen=True, eq=False)
class _Rule:
    """Quadrature points on the facets that have one place in their cells."""

    cells: IntArray  # (F,)
    normals: Array  # (F, 3)
    x: Array  # (F, Q, 3)
    dS: Array  # (F, Q)
    basis: Array  # (Q, functions): of one displacement component


def _quadrature(mesh: Mesh, structure: Structure, facets: IntArray, order: int) -> Iterator[_Rule]:
    """Gauss points on the facets, curved ones included, for each place of a facet in its cell."""
    assert structure.form is not None
    tdim, topology = mesh.tdim, mesh.dolfinx.topology
    topology.create_connectivity(tdim, tdim - 1)
    to_facet = topology.connectivity(tdim, tdim - 1)
    cells = compat.cells_of(mesh.dolfinx, facets)
    place = np.array(
        [
            int(np.flatnonzero(to_facet.links(c) == f)[0])
            for c, f in zip(cells, facets, strict=True)
        ],
        dtype=int,
    )
    kind = getattr(basix.CellType, mesh.cell)
    corners, faces = np.asarray(basix.geometry(kind)), basix.topology(kind)[tdim - 1]
    cmap, geometry = compat.coordinate_map(mesh.dolfinx), compat.geometry_nodes(mesh.dolfinx)
    path = structure.form.components["x"]
    for k, face in enumerate(faces):
        here = np.flatnonzero(place == k)
        nodes, points, weights, powers = _facet_rule(len(face), order)
        flat = _facet_rule(len(face), 1, degree=1)
        to_cell_of = np.linalg.solve(_monomials(flat[0], flat[3]), corners[face])
        X = _monomials(nodes, flat[3]) @ to_cell_of  # reference coordinates in the cell
        shape = np.linalg.inv(_monomials(nodes, powers))
        at = np.zeros((len(here), len(nodes), 3))
        for i, cell in enumerate(cells[here]):
            x = np.ascontiguousarray(mesh.dolfinx.geometry.x[geometry[cell]][:, : mesh.gdim])
            at[i, :, : mesh.gdim] = cmap.push_forward(X, x)
        slopes = [
            np.einsum("qn,fnd->fqd", _monomials(points, powers, axis) @ shape, at)
            for axis in range(points.shape[1])
        ]
        stretch = slopes[0] if len(slopes) == 1 else np.cross(*slopes)
        yield _Rule(
            cells[here],
            compat.facet_normals(mesh.dolfinx, facets[here]),
            np.einsum("qn,fnd->fqd", _monomials(points, powers) @ shape, at),
            weights * np.linalg.norm(stretch, axis=2),
            compat.tabulate(structure.form.space, path, _monomials(points, flat[3]) @ to_cell_of),
        )


def _facet_rule(corners: int, gauss: int, degree: int = 2) -> tuple[Array, Array, Array, IntArray]:
    """(Lagrange nodes, Gauss points, weights, powers of the monomials) of a reference facet."""
    s, w = np.polynomial.legendre.leggauss(gauss)
    s, w = (s + 1) / 2, w / 2
    steps = np.linspace(0, 1, degree + 1)
    if corners == 2:
        return steps[:, None], s[:, None], w, np.arange(degree + 1)[:, None]
    # the second coordinate runs slowest, as in the corners' order 0 1 / 2 3
    nodes = np.array([(a, b) for b in steps for a in steps])
    powers = np.array([(i, j) for j in range(degree + 1) for i in range(degree + 1)])
    x, y = (v.ravel() for v in np.meshgrid(s, s, indexing="ij"))
    weights = np.outer(w, w).ravel()
    if corners == 4:
        return nodes, np.column_stack([x, y]), weights, powers
    nodes, powers = nodes[nodes.sum(axis=1) <= 1], powers[powers.sum(axis=1) <= degree]
    return nodes, np.column_stack([x, y * (1 - x)]), weights * (1 - x), powers


def _monomials(xi: Array, powers: IntArray, derivative: int | None = None) -> Array:
    """Products of powers of the coordinates (n, terms), or their derivative along one of them."""
    factors = xi[:, None, :] ** powers
    if derivative is not None:
        p = powers[:, derivative]
        factors[:, :, derivative] = p * xi[:, None, derivative] ** np.maximum(p - 1, 0)
    return np.asarray(factors.prod(axis=2))
