"""Errors of beams, by a mesh of half the size.

The strains of beams are most accurate at the points where the element evaluates them, so that a
recovery of strains shows no error. Instead each element is divided into two, which costs little.
The loads of the shapes (the site's load, and inertia forces ω² M ψ with their reaction at the site)
act on both meshes. The difference of the flexibilities, times 1/(1 - 4^-p), is the error of the
coarse mesh (the flexibility of elements of degree p converges with the power 2p of their size). A
site inside an element becomes a node of the second mesh, since halving alone would hardly reduce
the error of the kink there.
"""

from __future__ import annotations

import numpy as np
import scipy.sparse
import scipy.sparse.linalg
from numpy.typing import NDArray

from antiosc.base._types import Array, IntArray
from antiosc.base.checks import ROUNDING
from antiosc.base.errors import InputError
from antiosc.fem.linalg.petsc_algebra import csr
from antiosc.fem.mesh import Mesh, distributed
from antiosc.fem.platform import compat
from antiosc.fem.structure.meshed import MeshedStructure
from antiosc.fem.structure.structure import Structure
from antiosc.io.neutral import KINDS, RawMesh
from antiosc.io.reading import keys
from antiosc.models.anti_oscillators import AntiOscillators
from antiosc.reduce.error.beam_facts import beam_facts
from antiosc.reduce.error.bisection import Pieces, gathered
from antiosc.reduce.error.scheme import Estimate, PartErrors, loads_of_shapes
from antiosc.reduce.site import Functional
from antiosc.reduce.site.sites import located


class HalvedBeams(PartErrors):
    """Estimator for structures of beams, on one rank."""

    def __init__(self, part: MeshedStructure) -> None:
        if part.comm.size > 1:
            raise InputError("the error 'estimate' of beams runs on one rank.")
        super().__init__(part)

    def prepare(self) -> None:
        self.not_included = polygon(self.part.mesh)

    def estimate(self, structure: Structure, model: AntiOscillators, site: Functional) -> Estimate:
        if site.point is None or site.direction is None:
            raise InputError(
                "the error 'estimate' of beams needs a Site with a point and a direction."
            )
        energies = self._energies(model, site, site.point, site.direction)
        in_element = is_inside(self.part.mesh, site.point)
        facts = {"inside_element": in_element, "model": beam_facts(self.part, site)}
        return Estimate(energies, facts=facts)

    def _energies(
        self, model: AntiOscillators, site: Functional, point: Array, direction: Array
    ) -> Array:
        """Energies [N/m] by which the mesh is too stiff for psi_0 ... psi_N: (N + 1, N + 1)."""
        coarse = self.part
        place = point[None, :], direction[None, :], np.array([np.nan])
        fine_part = self._fine(point)
        to_fine = interpolation(coarse, fine_part)
        b = located(fine_part, *place).loads[:, 0].toarray()
        shapes = np.asarray(model.shapes)
        missing = np.zeros((1, 1))
        for part, load, values, sign in (
            (coarse, site.b[:, None], shapes, -1.0),
            (fine_part, b, to_fine @ shapes, 1.0),
        ):
            forces = loads_of_shapes(part, model, values, load)
            missing = missing + sign * (forces.T @ answers(part, forces))
        return excess(missing / (1 - 4.0**-coarse.form.degree))

    def _fine(self, point: Array) -> MeshedStructure:
        """The part with halved cells and a node at `point`; the last one is stored for all models
        of a site.
        """
        cache = self.part.halves
        if point.tobytes() not in cache:
            cache.clear()
            cache[point.tobytes()] = self.part.again(halved(self.part.mesh, point))
        return cache[point.tobytes()]


def excess(lacks: Array) -> Array:
    """Excess energies E (k, k) of shapes ψ, from the compliances that the mesh lacks for the loads
    Kψ.

    E equals `lacks` if that is semidefinite. Elements with few integration points can be too
    flexible for some loads; all products of different shapes are then reduced by one factor that
    makes E semidefinite.
    """
    size = np.sqrt(np.maximum(np.diag(lacks), 0.0))
    inverse_size = np.divide(1.0, size, out=np.zeros_like(size), where=size > 0)
    cosines = np.clip(inverse_size[:, None] * (lacks + lacks.T) / 2 * inverse_size, -1.0, 1.0)
    np.fill_diagonal(cosines, 1.0)
    negative = max(-float(np.linalg.eigvalsh(cosines)[0]), 0.0) + ROUNDING
    cosines = (cosines + negative * np.eye(len(cosines))) / (1 + negative)
    return np.asarray(size[:, None] * cosines * size)


def answers(part: MeshedStructure, forces: Array) -> Array:
    """Displacements (rows, k) under self-equilibrated forces (rows, k), orthogonal to the rigid
    motions.
    """
    free = np.setdiff1d(np.arange(compat.local_size(part.form.space)), part.fixed)
    K = csr(part.K)[free][:, free]
    R = (csr(part.M) @ part.rigid_modes)[free]
    if R.shape[1]:
        K = scipy.sparse.bmat([[K, R * (size := abs(K).max() / abs(R).max())], [R.T * size, None]])
    padded = np.vstack([forces[free], np.zeros((R.shape[1], forces.shape[1]))])
    result = np.zeros_like(forces)
    result[free] = scipy.sparse.linalg.splu(K.tocsc()).solve(padded)[: len(free)]
    return result


def interpolation(part: MeshedStructure, fine: MeshedStructure) -> scipy.sparse.csr_matrix:
    """Interpolation matrix (fine rows, coarse rows) of displacements from a mesh to a finer one."""
    parent = np.asarray(fine.mesh.dolfinx.topology.original_cell_index) // 2
    ends = part.mesh.geometry.nodes[parent]
    axes = ends[:, 1] - ends[:, 0]
    blocks: list[tuple[Array, IntArray, IntArray]] = []
    for path in part.form.components.values():
        dofs = compat.cell_dofs(fine.form.space, path, np.arange(len(parent)))
        dofs_here, x = compat.dof_coordinates(fine.form.space, path)
        place = np.zeros((compat.local_size(fine.form.space), 3))
        place[dofs_here] = x
        reach = np.einsum("cfd,cd->cf", place[dofs] - ends[:, :1], axes)
        X = reach / np.einsum("cd,cd->c", axes, axes)[:, None]
        table = compat.tabulate(part.form.space, path, X.reshape(-1, 1))
        parent_dofs = compat.cell_dofs(part.form.space, path, parent)
        parent_dofs = np.repeat(parent_dofs, dofs.shape[1], axis=0)
        rows, first = np.unique(dofs.ravel(), return_index=True)
        fine_rows = np.repeat(rows[:, None], parent_dofs.shape[1], axis=1)
        blocks.append((table[first], fine_rows, parent_dofs[first]))
    values, rows, columns = (np.concatenate([entry[k] for entry in blocks]) for k in range(3))
    entries = values.ravel(), (rows.ravel(), columns.ravel())
    shape = tuple(compat.local_size(entry.form.space) for entry in (fine, part))
    return scipy.sparse.csr_matrix(entries, shape=shape)


#: A site closer to a node than this share of the element is at the node.
AT_NODE = 1e-3
#: Least angle in degrees between two cells of a polygon that approximates a curve: above rounding.
LEAST_ANGLE = 0.2
#: Largest such angle: that of a circle of 16 cells (22.5 degrees).
MOST_ANGLE = 23.0


def halved(mesh: Mesh, point: Array | None = None) -> Mesh:
    """The mesh of lines with each cell c divided into two, with the input numbers 2c and 2c + 1.

    A cell is divided in its middle; the one nearest to `point` is divided there, unless the point
    lies close to a node.
    """
    return _divided(mesh, 0.5, point)


def with_node(mesh: Mesh, point: Array) -> Mesh:
    """The mesh of lines with a node at the point nearest to `point`."""
    return _divided(mesh, np.nan, point)


def is_inside(mesh: Mesh, point: Array) -> bool:
    """Whether a point lies within an element and not at a node."""
    ends = mesh.geometry.nodes[:, :2, : mesh.gdim]
    lengths = np.linalg.norm(ends[:, 1] - ends[:, 0], axis=1)
    distances = np.linalg.norm(ends - point[: mesh.gdim], axis=2) / lengths[:, None]
    return bool(distances.min() > AT_NODE)


def polygon(mesh: Mesh) -> str:
    """A warning if the lines of a mesh seem to approximate a curve by a polygon; otherwise
    empty.
    """
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
    ends = cells.ravel()
    cell = np.repeat(np.arange(len(cells)), 2)
    shared_nodes = np.flatnonzero(np.bincount(ends, minlength=len(pieces.points)) == 2)
    order = np.argsort(ends, kind="stable")
    position = np.searchsorted(ends[order], shared_nodes)
    outward = []
    for number in (order[position], order[np.minimum(position + 1, len(order) - 1)]):
        far_ends = cells[cell[number], 1 - number % 2]
        directions = pieces.points[far_ends] - pieces.points[shared_nodes]
        outward.append(directions / np.linalg.norm(directions, axis=1, keepdims=True))
    cosine = np.clip(-np.einsum("nd,nd->n", *outward), -1.0, 1.0)
    angle = np.degrees(np.arccos(cosine))
    return float(max(angle[(angle > LEAST_ANGLE) & (angle < MOST_ANGLE)], default=0.0))


def _divided(mesh: Mesh, share: float, point: Array | None) -> Mesh:
    """The mesh with each cell cut at the share `share` of its length (NaN: not cut), or at
    `point`.
    """
    pieces = gathered(mesh, np.zeros(compat.cell_map(mesh.dolfinx).size_local))
    raw: RawMesh | InputError | None = None
    if pieces is not None:
        cuts = np.full(len(pieces.cells), share)
        if point is not None:
            _cut_at(cuts, pieces, point)
        raw = _cut_mesh(pieces, cuts)
    raw = mesh.comm.bcast(raw)
    if isinstance(raw, InputError):
        raise raw
    assert raw is not None
    return distributed(raw, mesh.name, mesh.comm)


def _cut_at(cuts: Array, pieces: Pieces, point: Array) -> None:
    """Cut the cell nearest to the point there, unless the point is close to a node."""
    ends = pieces.points[pieces.cells]
    axes = ends[:, 1] - ends[:, 0]
    start = ends[:, 0] - point[: ends.shape[2]]
    nearest = np.clip(-np.einsum("cd,cd->c", start, axes) / (axes**2).sum(axis=1), 0.0, 1.0)
    distance = np.linalg.norm(start + nearest[:, None] * axes, axis=1)
    closest = int(np.argmin(distance))
    if AT_NODE < nearest[closest] < 1 - AT_NODE:
        cuts[closest] = nearest[closest]


def _cut_mesh(pieces: Pieces, cuts: Array) -> RawMesh | InputError:
    """The mesh with cells cut at the shares `cuts` of their lengths; NaN: not cut."""
    cells = pieces.cells.astype(np.int64)
    cell_keys = keys(cells)
    if len(np.unique(cell_keys)) < len(cell_keys):
        return InputError("the error estimate of beams takes no two beams between the same nodes.")
    is_cut = np.isfinite(cuts)
    middle = np.full(len(cells), -1)
    middle[is_cut] = len(pieces.points) + np.arange(is_cut.sum())
    order = np.argsort(cell_keys)
    groups: dict[str, dict[int, NDArray[np.int64]]] = {}
    for name, parts in pieces.groups.items():
        groups[name] = {dim: rows.astype(np.int64) for dim, rows in parts.items()}
        if 1 in parts:
            members = order[np.searchsorted(cell_keys[order], keys(groups[name][1]))]
            groups[name][1] = _children(cells, middle, members)
    start, end = (pieces.points[cells[is_cut, side]] for side in (0, 1))
    points = np.vstack([pieces.points, start + cuts[is_cut, None] * (end - start)])
    children = _children(cells, middle, np.arange(len(cells)))
    return RawMesh(points, children, KINDS["line"], "gmsh", groups)


def _children(cells: IntArray, middle: IntArray, which: IntArray) -> NDArray[np.int64]:
    """The cells (n, 2) that replace the cells `which`; `middle` is the new node, -1 for uncut
    cells.
    """
    ends = cells[which]
    middle_nodes = middle[which]
    pairs = np.stack([ends[:, 0], middle_nodes, middle_nodes, ends[:, 1]], axis=1).reshape(-1, 2, 2)
    pairs[middle_nodes < 0, 0] = ends[middle_nodes < 0]
    exists = np.ones((len(which), 2), dtype=bool)
    exists[middle_nodes < 0, 1] = False
    return pairs[exists].astype(np.int64)
